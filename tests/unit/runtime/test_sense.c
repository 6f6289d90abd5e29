/* The pose between frames: it ends where the next frame's begins, its velocity is that of the
 * motion, it stops where samples or poses lack, and no step's result depends on it. */
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
#include "geometry/vec.h"
#include "runtime/state.h"
#include "support/aligned.h"

#include "fovea_fast_pose_t.h"

enum { WARM = 100, FRAMES = 200 };

static struct sim_rig rig;
static struct fovea_sample list[FOVEA_INPUT_SAMPLES_MAX];

/* ---- by hand --------------------------------------------------------------------------------- */

static struct fv_sense sense;
static const struct fovea_rig_imu at_body = {.T_body_imu = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};

static void fresh(void)
{
    memset(&sense, 0, sizeof sense);
    fv_sense_init(&sense);
}

static struct fovea_imu_sample still_at(int64_t stamp_ns)
{
    return (struct fovea_imu_sample){.stamp_ns = stamp_ns, .acceleration = {0, 0, 9.8}};
}

static struct fv_sense_anchor moving_at(int64_t stamp_ns)
{
    struct fv_sense_anchor anchor = {
        .posed = true, .frame.stamp_ns = stamp_ns, .velocity = {1, 0, 0}, .gravity = {0, 0, -9.8}};
    fv_se3_identity(&anchor.T_odom_body);
    return anchor;
}

/* A turn about an axis beside the sensor, with biases: the body stands, and so it says. */
static void an_arm_and_biases_are_taken_away(void **state)
{
    (void)state;
    const double w = 0.7, arm = 0.4;
    struct fovea_rig_imu rig_imu = {.T_body_imu = {1, 0, 0, arm, 0, 1, 0, 0, 0, 0, 1, 0}};
    struct fv_sense_anchor anchor = {.posed = true,
                                     .gravity = {0, 0, -9.8},
                                     .angular_rate = {0, 0, w},
                                     .biases = {{0.01, 0, 0}, {0, 0.2, 0}}};
    struct fv_sense_pose pose = {.stamp_ns = 0};
    fresh();
    fv_se3_identity(&anchor.T_odom_body);
    struct fovea_imu_sample sample = {.gyro = {0.01, 0, w},
                                      .acceleration = {-w * w * arm, 0.2, 9.8}};
    assert_false(fv_sense_take(&sense, &rig_imu, &sample, &pose)); /* no pose yet */
    fv_sense_offer(&sense, &anchor);
    for (int n = 1; n <= 200; n++) {
        sample.stamp_ns = n * 5000000;
        assert_true(fv_sense_take(&sense, &rig_imu, &sample, &pose));
    }
    assert_true(pose.stamp_ns == 1000000000 && pose.since_ns == 1000000000);
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(pose.T_odom_body.t[i]) < 1e-4 && fabs(pose.velocity[i]) < 1e-4);
        assert_true(fabs(pose.angular_rate[i] - (i == 2 ? w : 0)) < 1e-12);
    }
    assert_true(fabs(pose.T_odom_body.R[3] - sin(w)) < 1e-9);
}

/* Samples that came before the pose of their frame was known are applied again from it on. */
static void a_pose_that_comes_late_is_carried_on_at_once(void **state)
{
    (void)state;
    struct fv_sense_pose pose = {.stamp_ns = 0};
    fresh();
    for (int n = 0; n < 400; n++) { /* more than are kept */
        const struct fovea_imu_sample sample = still_at((int64_t)n * 5000000);
        (void)fv_sense_take(&sense, &at_body, &sample, &pose);
    }
    const struct fv_sense_anchor anchor = moving_at(1900000000);
    fv_sense_offer(&sense, &anchor);
    const struct fovea_imu_sample next = still_at(2000000000);
    assert_true(fv_sense_take(&sense, &at_body, &next, &pose));
    assert_true(fabs(pose.T_odom_body.t[0] - 0.1) < 1e-9 && fabs(pose.velocity[0] - 1) < 1e-9);
    assert_true(pose.since_ns == 100000000);
    assert_false(fv_sense_take(&sense, &at_body, &next, &pose)); /* once more */
    struct fovea_imu_sample broken = still_at(2005000000);
    broken.gyro[1] = NAN;
    assert_false(fv_sense_take(&sense, &at_body, &broken, &pose));
    const struct fovea_imu_sample after = still_at(2010000000);
    assert_true(fv_sense_take(&sense, &at_body, &after, &pose));
    assert_true(fabs(pose.T_odom_body.t[0] - 0.11) < 1e-9);
    const struct fovea_imu_sample far = still_at(2100000000); /* 90 ms without a sample */
    assert_false(fv_sense_take(&sense, &at_body, &far, &pose));
    const struct fovea_imu_sample later = still_at(2105000000);
    assert_false(fv_sense_take(&sense, &at_body, &later, &pose)); /* until the next pose */
}

/* The offset between the clocks that the loop found moves samples from its pose on. */
static void samples_are_moved_as_the_loop_has_them(void **state)
{
    (void)state;
    struct fv_sense_pose pose = {.stamp_ns = 0};
    fresh();
    struct fv_sense_anchor anchor = moving_at(0);
    anchor.moved_ns = 12000000;
    const struct fovea_imu_sample first = still_at(5000000), next = still_at(10000000);
    fv_sense_offer(&sense, &anchor);
    (void)fv_sense_take(&sense, &at_body, &first, &pose);
    assert_true(fv_sense_take(&sense, &at_body, &next, &pose));
    assert_true(pose.stamp_ns == 22000000);
    assert_true(fabs(pose.T_odom_body.t[0] - 0.022) < 1e-9);
}

static void it_ends_two_seconds_after_the_last_pose(void **state)
{
    (void)state;
    struct fv_sense_pose pose = {.stamp_ns = 0};
    fresh();
    const struct fv_sense_anchor anchor = moving_at(0);
    fv_sense_offer(&sense, &anchor);
    int carried = 0;
    for (int n = 1; n < 600; n++) {
        const struct fovea_imu_sample sample = still_at((int64_t)n * 5000000);
        carried += fv_sense_take(&sense, &at_body, &sample, &pose);
    }
    assert_int_equal(carried, 400);
    const struct fovea_imu_sample next = still_at(3000000000);
    const struct fv_sense_anchor again = moving_at(2990000000), none = {.posed = false};
    fv_sense_offer(&sense, &again);
    assert_true(fv_sense_take(&sense, &at_body, &next, &pose));
    fv_sense_offer(&sense, &none);
    const struct fovea_imu_sample last = still_at(3005000000);
    assert_false(fv_sense_take(&sense, &at_body, &last, &pose));
}

static void a_clock_that_was_set_back_is_followed(void **state)
{
    (void)state;
    struct fv_sense_pose pose;
    fresh();
    const struct fv_sense_anchor before = moving_at(3600000000000), after = moving_at(1000000);
    const struct fovea_imu_sample late = still_at(3600005000000), back = still_at(5000000),
                                  next = still_at(10000000);
    fv_sense_offer(&sense, &before);
    assert_true(fv_sense_take(&sense, &at_body, &late, &pose));
    assert_false(fv_sense_take(&sense, &at_body, &back, &pose)); /* of the pose of another time */
    fv_sense_offer(&sense, &after);
    assert_true(fv_sense_take(&sense, &at_body, &next, &pose));
    assert_true(pose.stamp_ns == 10000000 && pose.since_ns == 9000000);
}

/* ---- in the runtime -------------------------------------------------------------------------- */

static bool heard(const struct fovea_outputs *outputs, fovea_fast_pose_t *pose)
{
    if (outputs->message_count == 0) return false;
    const struct fovea_message *message = &outputs->messages[0];
    assert_int_equal(outputs->message_count, 1);
    assert_string_equal(message->channel, "FOVEA_POSE_FAST");
    assert_int_equal(fovea_fast_pose_t_decode(message->data, 0, (int)message->bytes, pose),
                     message->bytes);
    return true;
}

/* After the last frame, whose pose samples carry on: `next` is its last one. */
static void it_ends_with(struct fovea *rt, uint32_t command, const struct fovea_ready_map *map,
                         struct fovea_sample next)
{
    struct fovea_outputs outputs;
    next.imu.stamp_ns += 5000000;
    assert_int_equal(fovea_sense(rt, &next, 1, &outputs), FOVEA_OK);
    const struct fovea_inputs inputs = {
        .commands = command, .map = map, .now_ns = next.imu.stamp_ns};
    (void)fovea_step(rt, &inputs, &outputs);
    next.imu.stamp_ns += 5000000;
    assert_int_equal(fovea_sense(rt, &next, 1, &outputs), FOVEA_AGAIN);
}

/* With a map of its own that is loaded. */
static void it_ends_with_a_map(struct fovea *rt, struct fovea_sample next)
{
    const size_t capacity = fovea_map_bytes_max(&rig.config),
                 bytes = fovea_map_prepared_bytes(&rig.config);
    uint8_t *file = malloc(capacity);
    void *memory = fv_aligned_new(bytes);
    const struct fovea_ready_map *map = NULL;
    struct fovea_error error;
    assert_non_null(file);
    assert_non_null(memory);
    const size_t saved = fovea_map_save(rt, file, capacity);
    assert_int_equal(fovea_map_prepare(rt, memory, bytes, file, saved, "m", &map, &error),
                     FOVEA_OK);
    it_ends_with(rt, 0, map, next);
    free(memory);
    free(file);
}

static void it_leads_from_frame_to_frame(void **state)
{
    fovea_fast_pose_t pose = {.since_ns = 0};
    struct fovea_outputs outputs, twin_outputs;
    struct fovea_sample last = {.kind = FOVEA_SAMPLE_IMU};
    struct fovea *twin = NULL;
    double worst_m = 0, worst_rad = 0, sum2 = 0;
    int carried = 0, asked = 0, compared = 0;
    (void)state;
    sim_rig_open(
        &rig,
        "sim:orbit?width=320&height=240&rate=20&imu=200&baseline=0.12&imu_pose=0.1,0.05,-0.08,0,0,30&gyro_bias=0.01&acceleration_bias=0.03",
        0, FRAMES);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.odometry.keyframes = 40;
    sim_rig_build(&rig);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (rig.rt->block_bytes + 63) / 64 * 64);
    assert_non_null(memory);
    assert_int_equal(fovea_copy(rig.rt, memory, rig.rt->block_bytes, &twin), FOVEA_OK);
    while (sim_rig_next(&rig)) {
        const uint32_t count =
            rig.ops->samples(rig.source, &rig.frame, list, FOVEA_INPUT_SAMPLES_MAX);
        bool any = false;
        for (uint32_t i = 0; i < count; i++) {
            const enum fovea_status status = fovea_sense(rig.rt, &list[i], 1, &outputs);
            const bool imu = list[i].kind == FOVEA_SAMPLE_IMU;
            any = heard(&outputs, &pose) || (any && !imu);
            assert_int_equal(status == FOVEA_OK, outputs.message_count == 1);
            if (imu) last = list[i];
            if (rig.frames < WARM || !imu) continue;
            asked++;
            carried += status == FOVEA_OK;
        }
        rig.inputs.samples = list;
        rig.inputs.sample_count = count;
        const struct fovea_inputs inputs = rig.inputs;
        sim_rig_process(&rig);
        (void)fovea_step(twin, &inputs, &twin_outputs);
        (void)fovea_work(twin, &inputs.grants, &twin_outputs);
        if (!any || rig.frames <= WARM) continue;
        const struct fv_se3 T = fv_publish_child_pose(&rig.rt->publish, FV_PUBLISH_BODY);
        const double rest_s = (double)(rig.frame.stamp_ns - pose.stamp.time_ns) * 1e-9;
        double off2 = 0, R[9], trace = 0;
        assert_true(rest_s >= 0 && rest_s < 0.011 && pose.since_ns > 30000000);
        for (int i = 0; i < 3; i++) {
            const double off = pose.position[i] + rest_s * pose.velocity[i] - T.t[i];
            off2 += off * off;
        }
        fv_so3_from_quaternion(pose.orientation, R);
        for (int i = 0; i < 9; i++)
            trace += R[i] * T.R[i];
        const double turned = acos(fmin(1, (trace - 1) / 2)),
                     rest_rad = rest_s * fv_norm3(pose.angular_rate);
        worst_m = fmax(worst_m, sqrt(off2));
        worst_rad = fmax(worst_rad, turned - rest_rad);
        sum2 += off2;
        compared++;
    }
    print_message(
        "%d of %d samples carried on, %d frames: off by %.2f mm rms, %.2f worst; %.3f degrees worst\n",
        carried, asked, compared, 1e3 * sqrt(sum2 / compared), 1e3 * worst_m, worst_rad * 57.3);
    assert_true(carried > asked * 9 / 10 && compared > (FRAMES - WARM) * 8 / 10);
    /* What single poses of this small picture are off by; holding the last one is off by 25 mm. */
    assert_true(sqrt(sum2 / compared) < 0.008 && worst_m < 0.025 && worst_rad < 0.005);
    assert_true(fovea_state_hash(twin) == fovea_state_hash(rig.rt));
    it_ends_with(twin, FOVEA_COMMAND_RESET, NULL, last);
    assert_int_equal(fovea_copy(rig.rt, memory, rig.rt->block_bytes, &twin), FOVEA_OK);
    it_ends_with_a_map(twin, last);
    free(memory);
    it_ends_with(rig.rt, FOVEA_COMMAND_PAUSE, NULL, last);
    sim_rig_close(&rig);
}

/* It lasts from step to step: the mask of boxes, which shares memory with what does not, lies
 * elsewhere at every size. */
static void the_mask_of_boxes_lies_elsewhere(void **state)
{
    static const char *const sizes[] = {"width=320&height=240", "width=1280&height=960",
                                        "width=1920&height=1200"};
    (void)state;
    for (int i = 0; i < 3; i++) {
        char uri[128];
        snprintf(uri, sizeof uri, "sim:orbit?%s&imu=200&baseline=0.12", sizes[i]);
        sim_rig_open(&rig, uri, 0, 1);
        rig.config.rig = rig.ops->info(rig.source)->rig;
        sim_rig_build(&rig);
        const struct fv_plane *mask = &rig.rt->boxes.mask;
        const uint8_t *end = mask->pixels + (size_t)mask->stride * (size_t)mask->height,
                      *sense_at = (const uint8_t *)rig.rt->sense;
        assert_true(end <= sense_at || sense_at + sizeof *rig.rt->sense <= mask->pixels);
        sim_rig_close(&rig);
    }
}

static void without_a_sensor_there_is_nothing(void **state)
{
    struct fovea_outputs outputs;
    const struct fovea_sample sample = {.kind = FOVEA_SAMPLE_IMU};
    (void)state;
    sim_rig_open(&rig, "sim:orbit?width=160&height=120", 0, 1);
    sim_rig_build(&rig);
    assert_int_equal(fovea_sense(rig.rt, &sample, 1, &outputs), FOVEA_AGAIN);
    assert_int_equal(outputs.message_count, 0);
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_arm_and_biases_are_taken_away),
        cmocka_unit_test(a_pose_that_comes_late_is_carried_on_at_once),
        cmocka_unit_test(samples_are_moved_as_the_loop_has_them),
        cmocka_unit_test(it_ends_two_seconds_after_the_last_pose),
        cmocka_unit_test(a_clock_that_was_set_back_is_followed),
        cmocka_unit_test(it_leads_from_frame_to_frame),
        cmocka_unit_test(the_mask_of_boxes_lies_elsewhere),
        cmocka_unit_test(without_a_sensor_there_is_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
