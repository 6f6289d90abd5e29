/* Metric scale on the simulated camera: from odometry with errors, slips and a lever arm, from the
 * camera's height; what is said while it is unknown; and boxes in which nothing is looked at. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/sim_rig.h"
#include "geometry/se3.h"
#include "runtime/state.h"

#include "fovea_pose_t.h"

static struct sim_rig rig;
static uint8_t *saved; /* the map of the first test */
static size_t saved_bytes;
static double saved_scale;

static void odometry_gives_metres(void **state)
{
    (void)state;
    sim_rig_open(&rig, "sim:orbit?width=400&height=300&wheel_odometry_noise=0.1", 0, 240);
    rig.config.scale.source = FOVEA_SCALE_WHEEL_ODOMETRY;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        sim_rig_take_samples(&rig);
        /* Every 2.5 s a wheel slips: 40 cm that nothing moved by. */
        for (uint32_t i = 0; i < rig.inputs.sample_count; i++)
            rig.samples[i].wheel_odometry.position_m[0] += 0.4 * (double)(rig.frames / 75);
        sim_rig_process(&rig);
    }
    const struct fovea_pose *last = &rig.pose[rig.frames - 1];
    double scale = sim_rig_scale(&rig, 120, rig.frames);
    printf("odometry: scale off by %+.2f %%, said to be sure to %.2f %%\n", 100 * (scale - 1),
           100 * last->scale_sigma);
    assert_int_equal(last->scale_source, FOVEA_SCALE_WHEEL_ODOMETRY);
    assert_true(fabs(scale - 1) < 0.02);
    assert_true(last->scale_sigma > 0.002 && last->scale_sigma < 0.05);
    saved_scale = last->scale;
    saved = malloc(fovea_map_bytes_max(&rig.config));
    saved_bytes = fovea_map_save(rig.rt, saved, fovea_map_bytes_max(&rig.config));
    assert_true(saved_bytes > 0);
    sim_rig_close(&rig);
}

/* One sample from another day, as before a clock is set: odometry after it counts again. */
static void a_wrong_stamp_does_not_end_odometry(void **state)
{
    (void)state;
    sim_rig_open(&rig, "sim:orbit?width=320&height=240", 30, 150);
    rig.config.scale.source = FOVEA_SCALE_WHEEL_ODOMETRY;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        sim_rig_take_samples(&rig);
        assert_true(rig.inputs.sample_count > 0);
        if (rig.frames == 2) rig.samples[0].wheel_odometry.stamp_ns += INT64_C(86400000000000);
        sim_rig_process(&rig);
    }
    double scale = sim_rig_scale(&rig, 100, rig.frames);
    printf("odometry after a wrong stamp: scale off by %+.2f %%\n", 100 * (scale - 1));
    assert_int_equal(rig.pose[rig.frames - 1].scale_source, FOVEA_SCALE_WHEEL_ODOMETRY);
    assert_true(fabs(scale - 1) < 0.02);
    sim_rig_close(&rig);
}

/* A map keeps its metres: a run that has no odometry publishes them, and says from where they are.
 */
static void a_saved_map_keeps_its_scale(void **state)
{
    (void)state;
    for (int localise_only = 0; localise_only < 2; localise_only++) {
        sim_rig_open(&rig, "sim:orbit?width=400&height=300", 120, 90);
        rig.config.map = saved;
        rig.config.map_bytes = saved_bytes;
        rig.config.odometry.localise_only = localise_only;
        sim_rig_build(&rig);
        while (sim_rig_next(&rig))
            sim_rig_process(&rig);
        const struct fovea_pose *last = &rig.pose[rig.frames - 1];
        double scale = sim_rig_scale(&rig, 20, rig.frames);
        printf("saved map, %s: scale off by %+.2f %%\n", localise_only ? "localised" : "mapped on",
               100 * (scale - 1));
        assert_int_equal(last->scale_source, FOVEA_SCALE_WHEEL_ODOMETRY);
        assert_true(fabs(last->scale / saved_scale - 1) < 1e-9 && last->scale_sigma > 0.002 &&
                    last->map_scale == 1);
        assert_true(fabs(scale - 1) < 0.02);
        sim_rig_close(&rig);
    }
    free(saved);
}

/* Positions do not jump when the scale becomes better known. */
static void the_path_bends_but_does_not_tear(void **state)
{
    (void)state;
    sim_rig_open(&rig, "sim:corridor?width=320&height=240", 0, 240);
    rig.config.scale.source = FOVEA_SCALE_CAMERA_HEIGHT;
    rig.config.scale.camera_height_m = 1.25;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    int metric = 0;
    double worst = 0, last_scale = 0;
    bool changed = false;
    for (int n = 1; n < rig.frames; n++) {
        const struct fovea_pose *a = &rig.pose[n - 1], *b = &rig.pose[n];
        if (b->scale_source == FOVEA_SCALE_FREE) assert_true(!b->posed || b->scale == 1.0);
        if (a->scale_source == FOVEA_SCALE_FREE || !b->posed) continue;
        metric++;
        changed |= last_scale != 0 && last_scale != b->scale;
        last_scale = b->scale;
        worst = fmax(worst, sim_rig_moved(a->T_world_cam, b->T_world_cam));
    }
    double scale = sim_rig_scale(&rig, 150, rig.frames);
    printf("camera height: %d frames in metres, scale off by %+.1f %%, largest step %.3f m\n",
           metric, 100 * (scale - 1), worst);
    assert_true(metric > 120 && changed && worst < 0.1 && fabs(scale - 1) < 0.1);
    sim_rig_close(&rig);
}

/* What closing a loop does to the map's unit, here everywhere alike. */
static void grow_map(double factor)
{
    struct fv_odometry *o = &rig.rt->odometry;
    for (uint32_t i = 0; i < o->map.limits.landmarks; i++) {
        for (int k = 0; k < 3; k++)
            o->map.landmarks[i].point[k] *= factor;
        o->map.landmarks[i].distance *= (float)factor;
    }
    for (uint32_t v = 0; v < fv_map_frame_count(&o->map); v++) {
        for (int k = 0; k < 3; k++)
            o->map.keyframes[v].T_cam_world.t[k] *= factor;
        o->map.keyframes[v].depth *= factor;
    }
    for (int k = 0; k < 3; k++)
        o->map.state->S_map_world.t[k] *= factor;
    o->map.state->S_map_world.s *= factor;
    struct fv_sim3 grown;
    fv_sim3_identity(&grown);
    grown.s = factor;
    fv_odometry_follow_correction(o, &grown);
    o->state->job_wanted = true;
}

enum { GROWN = 120 };

static void run_grown(double factor)
{
    sim_rig_open(&rig, "sim:corridor?width=320&height=240", 0, GROWN + 30);
    rig.config.scale.source = FOVEA_SCALE_CAMERA_HEIGHT;
    rig.config.scale.camera_height_m = 1.25;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        if (rig.frames == GROWN && factor != 1) grow_map(factor);
        sim_rig_process(&rig);
    }
    sim_rig_close(&rig);
}

/* A closure that changes the map's unit changes neither the published metres nor their uncertainty.
 */
static void the_maps_unit_is_minded(void **state)
{
    (void)state;
    run_grown(1);
    const struct fovea_pose plain = rig.pose[GROWN];
    const double way = sim_rig_moved(plain.T_world_cam, rig.pose[rig.frames - 1].T_world_cam);
    run_grown(3);
    const struct fovea_pose *grown = &rig.pose[GROWN];
    const double off = sim_rig_moved(plain.T_world_cam, grown->T_world_cam),
                 way_grown =
                     sim_rig_moved(grown->T_world_cam, rig.pose[rig.frames - 1].T_world_cam);
    printf("map's unit a third: place off by %.4f m, the way from there %.3f m, %.3f m without\n",
           off, way_grown, way);
    assert_int_equal(plain.scale_source, FOVEA_SCALE_CAMERA_HEIGHT);
    assert_int_equal(grown->scale_source, FOVEA_SCALE_CAMERA_HEIGHT);
    assert_true(fabs(3 * grown->scale / plain.scale - 1) < 0.01);
    assert_true(off < 0.002 && fabs(way_grown / way - 1) < 0.05);
    for (int row = 0, k = 0; row < 6; k += 6 - row++) /* the diagonal */
        assert_true(fabs(grown->covariance[k] / plain.covariance[k] - 1) < 0.1);
}

/* Beyond what the odometry states, in metres, the covariance holds the scale's share: of the way
 * since the keyframe, along it. */
static void the_covariance_holds_the_scale(void **state)
{
    (void)state;
    int checked = 0;
    sim_rig_open(&rig, "sim:corridor?width=320&height=240", 0, GROWN);
    rig.config.scale.source = FOVEA_SCALE_CAMERA_HEIGHT;
    rig.config.scale.camera_height_m = 1.25;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        sim_rig_process(&rig);
        const struct fovea_pose *pose = &rig.pose[rig.frames - 1],
                                *raw = fv_odometry_pose(&rig.rt->odometry);
        if (!pose->posed || pose->scale_source == FOVEA_SCALE_FREE) continue;
        const double unit = pose->scale * raw->map_scale, *T = pose->T_keyframe_cam;
        double way[3];
        for (int c = 0; c < 3; c++)
            way[c] = pose->scale * (T[c] * T[3] + T[4 + c] * T[7] + T[8 + c] * T[11]);
        for (int row = 0, k = 0; row < 6; row++)
            for (int column = row; column < 6; column++, k++) {
                const double lengths = (row < 3 ? unit : 1) * (column < 3 ? unit : 1),
                             share = column < 3 ? way[row] * way[column] * pose->scale_sigma *
                                                      pose->scale_sigma
                                                : 0,
                             expected = raw->covariance[k] * lengths + share;
                assert_true(fabs(pose->covariance[k] - expected) <= 1e-9 * fabs(expected) + 1e-18);
            }
        checked += way[0] * way[0] + way[1] * way[1] + way[2] * way[2] > 0.01;
    }
    assert_true(checked > 20);
    sim_rig_close(&rig);
}

/* A pose message of the last step. */
static fovea_pose_t pose_message(const char *channel)
{
    fovea_pose_t pose;
    memset(&pose, 0, sizeof pose);
    for (uint32_t i = 0; i < rig.outputs.message_count; i++)
        if (strcmp(rig.outputs.messages[i].channel, channel) == 0)
            assert_true(fovea_pose_t_decode(rig.outputs.messages[i].data, 0,
                                            (int)rig.outputs.messages[i].bytes, &pose) > 0);
    return pose;
}

static struct fv_se3 transform_of(const double position[3], const double orientation[4])
{
    struct fv_se3 T;
    fv_so3_from_quaternion(orientation, T.R);
    memcpy(T.t, position, sizeof T.t);
    return T;
}

static double origin_distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

/* Both messages speak of one frame: T_odom_cam = T_odom_body T_body_cam, now and since the
 * keyframe; and each moves as its velocity says. */
static void check_children(const struct fv_se3 *B)
{
    static fovea_pose_t before;
    fovea_pose_t body = pose_message("FOVEA_POSE"), camera = pose_message("FOVEA_CAMERA_POSE");
    struct fv_se3 T = transform_of(body.position, body.orientation), inverse;
    fv_se3_compose(&T, B, &T);
    assert_true(origin_distance(T.t, camera.position) < 1e-9);
    assert_string_equal(camera.parent_frame, body.parent_frame);
    assert_string_equal(camera.child_frame, "cam0");
    assert_true(body.scale_state == FOVEA_POSE_T_SCALE_METRIC && body.map_id == camera.map_id);
    assert_true(body.keyframe_stamp_ns > 0 && body.keyframe_stamp_ns <= body.stamp.time_ns);
    T = transform_of(body.keyframe_position, body.keyframe_orientation);
    fv_se3_invert(B, &inverse);
    fv_se3_compose(&inverse, &T, &T);
    fv_se3_compose(&T, B, &T);
    assert_true(origin_distance(T.t, camera.keyframe_position) < 1e-9);
    if (before.stamp.sequence + 1 == body.stamp.sequence && !isnan(body.velocity[0])) {
        const double step_s = 1e-9 * (double)(body.stamp.time_ns - before.stamp.time_ns);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(body.position[i] - before.position[i] - step_s * body.velocity[i]) <
                        1e-9);
    }
    before = body;
    fovea_pose_t_decode_cleanup(&body);
    fovea_pose_t_decode_cleanup(&camera);
}

/* The last pose before metres, taken over by the announced change, is where the first one in metres
 * is, up to what the camera moves between two frames. */
static void check_change(const fovea_pose_t *unscaled)
{
    fovea_pose_t first = pose_message("FOVEA_CAMERA_POSE");
    double moved[3];
    for (int i = 0; i < 3; i++)
        moved[i] = first.change_scale * unscaled->position[i] + first.change_position[i];
    assert_true(unscaled->scale_state == FOVEA_POSE_T_SCALE_INITIALISING &&
                unscaled->change_count == 0 && unscaled->change_scale == 1);
    assert_true(first.change_count == 1 && first.change_orientation[0] == 1);
    assert_true(origin_distance(moved, first.position) < 0.1);
    assert_true(origin_distance(unscaled->position, first.position) > 0.3);
    fovea_pose_t_decode_cleanup(&first);
}

/* The message's pose of the body must be that of the camera with the lever arm, to the last digits.
 */
static void check_body(const struct fv_se3 *B)
{
    struct fv_se3 expected, inverse;
    fovea_pose_t pose = pose_message("FOVEA_POSE");
    const struct fovea_pose *camera = &rig.pose[rig.frames - 1];
    fv_se3_from_rows(camera->T_world_cam, &expected);
    fv_se3_invert(B, &inverse);
    fv_se3_compose(B, &expected, &expected);
    fv_se3_compose(&expected, &inverse, &expected);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(pose.position[i] - expected.t[i]) < 1e-9);
    assert_string_equal(pose.parent_frame, "odom");
    assert_string_equal(pose.child_frame, "body");
    assert_true(pose.scale == camera->scale && pose.scale_sigma == camera->scale_sigma);
    /* Turning is as uncertain for the body as for the camera, whatever the axes. */
    double of_body = pose.covariance[15] + pose.covariance[18] + pose.covariance[20];
    double of_camera = camera->covariance[15] + camera->covariance[18] + camera->covariance[20];
    assert_true(fabs(of_body / of_camera - 1) < 1e-9);
    fovea_pose_t_decode_cleanup(&pose);
}

/* The base rides 0.4 m behind and 0.3 m below the camera and moves otherwise when it turns. */
static void a_lever_arm_is_minded(void **state)
{
    (void)state;
    static const double T_body_cam[12] = {0, 0, 1, 0.4, -1, 0, 0, 0.1, 0, -1, 0, 0.3};
    struct fv_se3 B, inverse, T, start = {{0}, {0}}, start_inverse;
    int checked = 0;
    fovea_pose_t unscaled = {.change_count = -1}; /* the last pose of the camera before metres */
    fv_se3_from_rows(T_body_cam, &B);
    fv_se3_invert(&B, &inverse);
    sim_rig_open(&rig, "sim:orbit?width=320&height=240", 30, 200);
    memcpy(rig.config.rig.cameras[0].T_body_cam, T_body_cam, sizeof T_body_cam);
    rig.config.scale.source = FOVEA_SCALE_WHEEL_ODOMETRY;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        fv_se3_from_rows(rig.truth[rig.frames], &T);
        if (rig.frames == 0) start = T;
        fv_se3_invert(&start, &start_inverse);
        fv_se3_compose(&start_inverse, &T, &T);
        fv_se3_compose(&B, &T, &T);
        fv_se3_compose(&T, &inverse, &T); /* T_odom_body by odometry */
        struct fovea_wheel_odometry_sample *sample = &rig.samples[0].wheel_odometry;
        rig.samples[0].kind = FOVEA_SAMPLE_WHEEL_ODOMETRY;
        rig.inputs.samples = rig.samples;
        rig.inputs.sample_count = 1;
        sample->stamp_ns = rig.frame.stamp_ns;
        memcpy(sample->position_m, T.t, sizeof T.t);
        fv_so3_to_quaternion(T.R, sample->orientation);
        sim_rig_process(&rig);
        if (rig.pose[rig.frames - 1].scale_source == FOVEA_SCALE_FREE) {
            fovea_pose_t_decode_cleanup(&unscaled);
            unscaled = pose_message("FOVEA_CAMERA_POSE");
            continue;
        }
        if (checked == 0) check_change(&unscaled);
        check_body(&B);
        check_children(&B);
        checked++;
    }
    double scale = sim_rig_scale(&rig, 120, rig.frames);
    fovea_pose_t_decode_cleanup(&unscaled);
    printf("lever arm: %d poses of the body checked, scale off by %+.2f %%\n", checked,
           100 * (scale - 1));
    assert_true(checked > 100 && fabs(scale - 1) < 0.02);
    sim_rig_close(&rig);
}

static int count_channel(const char *channel)
{
    int count = 0;
    for (uint32_t i = 0; i < rig.outputs.message_count; i++)
        count += strcmp(rig.outputs.messages[i].channel, channel) == 0;
    return count;
}

static void without_scale_no_bot_core_pose(void **state)
{
    (void)state;
    for (int allow = 0; allow < 2; allow++) {
        int sent = 0, posed = 0;
        sim_rig_open(&rig, "sim:orbit?width=320&height=240", 0, 50);
        rig.config.scale.source = FOVEA_SCALE_WHEEL_ODOMETRY; /* which never comes */
        rig.config.scale.allow_unscaled = allow;
        sim_rig_build(&rig);
        while (sim_rig_next(&rig)) {
            sim_rig_process(&rig);
            sent += count_channel("FOVEA_BOT_CORE_POSE");
            posed += rig.pose[rig.frames - 1].posed;
            assert_int_equal(rig.pose[rig.frames - 1].scale_source, FOVEA_SCALE_FREE);
        }
        assert_true(posed > 10);
        assert_int_equal(sent, allow ? posed : 0);
        sim_rig_close(&rig);
    }
}

/* Features in boxes, and the largest fraction of the image that boxes covered. */
static int features_in_boxes(bool masked, double *fraction)
{
    static struct fovea_truth truth;
    int inside = 0;
    *fraction = 0;
    sim_rig_open(&rig, "sim:still?width=400&height=300&objects=48&seed=3", 0, 12);
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        uint32_t count;
        double area = 0;
        assert_int_equal(rig.ops->truth(rig.source, &rig.frame, &truth), FOVEA_OK);
        rig.inputs.has_boxes = masked;
        rig.inputs.boxes_stamp_ns = rig.frame.stamp_ns;
        for (uint32_t b = 0; b < truth.box_count && b < FOVEA_INPUT_BOXES_MAX; b++) {
            const struct fovea_truth_box *t = &truth.boxes[b];
            area += (double)(t->x_max_px - t->x_min_px) * (double)(t->y_max_px - t->y_min_px);
            if (masked)
                rig.inputs.boxes[rig.inputs.box_count++] =
                    (struct fovea_box){t->x_min_px, t->y_min_px, t->x_max_px, t->y_max_px};
        }
        *fraction = fmax(*fraction, area / (400.0 * 300.0));
        sim_rig_process(&rig);
        const struct fovea_feature *f = fovea_features_get(rig.rt, &count);
        for (uint32_t i = 0; i < count; i++)
            for (uint32_t b = 0; b < truth.box_count; b++)
                inside +=
                    f[i].x_px >= truth.boxes[b].x_min_px && f[i].x_px < truth.boxes[b].x_max_px &&
                    f[i].y_px >= truth.boxes[b].y_min_px && f[i].y_px < truth.boxes[b].y_max_px;
    }
    sim_rig_close(&rig);
    return inside;
}

static void nothing_is_taken_in_boxes(void **state)
{
    (void)state;
    double fraction;
    int open = features_in_boxes(false, &fraction), masked = features_in_boxes(true, &fraction);
    printf("boxes: cover up to %.0f %%; %d features in them without a mask, %d with it\n",
           100 * fraction, open, masked);
    assert_true(fraction > 0.15 && open > 100);
    assert_int_equal(masked, 0);
}

/* However the landmarks are gathered, a unit looks at FV_FLOOR_SLOTS of them, and all are met. */
static void the_floor_is_looked_for_in_pieces(void **state)
{
    (void)state;
    static struct fv_floor_point points[FV_FLOOR_POINTS_MAX];
    struct fv_random random;
    fv_random_seed(&random, 1);
    sim_rig_open(&rig, "sim:corridor?width=400&height=300", 0, 90);
    sim_rig_build(&rig);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    const struct fv_odometry *o = &rig.rt->odometry;
    const struct fv_floor_look look = {
        .down = {0, 1, 0}, .random = &random, .points = points, .points_max = FV_FLOOR_POINTS_MAX};
    struct fv_floor_gather gather = fv_scale_gather_begin(o);
    const uint32_t top = fv_odometry_map(o)->state->landmark_top;
    uint32_t pieces = 0, met = 0;
    for (bool done = false; !done; pieces++) {
        const uint32_t before = gather.next;
        done = fv_scale_gather_floor(o, &look, &gather);
        assert_true(gather.next - before <= FV_FLOOR_SLOTS && gather.met >= met);
        met = gather.met;
    }
    assert_true(top > 2 * FV_FLOOR_SLOTS && gather.next == top);
    assert_int_equal(pieces, (top + FV_FLOOR_SLOTS - 1) / FV_FLOOR_SLOTS);
    assert_true(gather.count > 20 && gather.count <= FV_FLOOR_POINTS_MAX);
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_floor_is_looked_for_in_pieces),
        cmocka_unit_test(odometry_gives_metres),
        cmocka_unit_test(a_wrong_stamp_does_not_end_odometry),
        cmocka_unit_test(a_saved_map_keeps_its_scale),
        cmocka_unit_test(the_path_bends_but_does_not_tear),
        cmocka_unit_test(the_maps_unit_is_minded),
        cmocka_unit_test(the_covariance_holds_the_scale),
        cmocka_unit_test(a_lever_arm_is_minded),
        cmocka_unit_test(without_scale_no_bot_core_pose),
        cmocka_unit_test(nothing_is_taken_in_boxes),
    };
    if (getenv("FOVEA_EMULATED") != NULL) {
        puts("SKIPPED test_scale: minutes under an emulator");
        return 0;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
