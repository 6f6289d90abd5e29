/* Free space in the loop: the grid and the scan that are sent are those of fovea/grid.h for the
 * masks and the poses of the run, however the work is divided and whoever copies the runtime; and a
 * lost pose leaves nothing known. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "app/run/grid_file.h"
#include "base/elementary.h"
#include "common/detector.h"
#include "common/sent_grid.h"
#include "common/sim_rig.h"
#include "geometry/se3.h"
#include "nn/model.h"
#include "odometry/surface.h"
#include "runtime/state.h"
#include "support/picture.h"

#define WAY "sim:orbit?width=320&height=240&lens=pinhole&fov=70&rate=10"
enum {
    FRAMES = 120,
    SIDE = SENT_SIDE,
    RAYS = SENT_RAYS,
};
static const double T_body_cam[12] = {0, 0, 1, 0.4, -1, 0, 0, 0.1, 0, -1, 0, 0.8};

static struct sim_rig rig;
static bool with_heights = true;

static void open_rig(const char *way)
{
    sim_rig_open_kept(&rig, way, 0, FRAMES);
    rig.config.scale.source = FOVEA_SCALE_WHEEL_ODOMETRY;
    memcpy(rig.config.rig.cameras[0].T_body_cam, T_body_cam, sizeof T_body_cam);
    rig.config.detect.model = detector_as_segmenter(&rig.config.detect.model_bytes);
    assert_non_null(rig.config.detect.model);
    struct fovea_grid_job_config *job = &rig.config.grid_job;
    job->enabled = true;
    job->grid.resolution_m = 0.05;
    job->grid.side_cells = SIDE; /* in two messages */
    job->grid.range_m = 6;
    job->grid.rays = RAYS;
    job->grid.heights = with_heights;
    memset(job->labels, FOVEA_GRID_FLOOR, sizeof job->labels);
    job->labels[1] = FOVEA_GRID_OBSTACLE;
    job->labels[2] = FOVEA_GRID_MOVABLE;
}

/* Where the wheels have the body now, relative to its first place. */
static struct fovea_sample wheels(void)
{
    struct fovea_sample sample = {.kind = FOVEA_SAMPLE_WHEEL_ODOMETRY};
    struct fv_se3 B, back, T, start;
    fv_se3_from_rows(T_body_cam, &B);
    fv_se3_from_rows(rig.truth[rig.frames], &T);
    fv_se3_from_rows(rig.truth[0], &start);
    fv_se3_invert(&start, &back);
    fv_se3_compose(&back, &T, &T);
    fv_se3_compose(&B, &T, &T);
    fv_se3_invert(&B, &back);
    fv_se3_compose(&T, &back, &T);
    sample.wheel_odometry.stamp_ns = rig.frame.stamp_ns;
    memcpy(sample.wheel_odometry.position_m, T.t, sizeof T.t);
    fv_so3_to_quaternion(T.R, sample.wheel_odometry.orientation);
    return sample;
}

/* What a run has of a mask: where it was seen from, by the frame's stamp. */
enum { POINTS_MAX = 1000 };
struct seen_from {
    int64_t stamp_ns;
    struct fovea_pose pose;
    struct fv_surface_point points[POINTS_MAX];
    uint32_t point_count;
};

static void remember_frame(struct seen_from *from)
{
    uint32_t next = 0;
    from->stamp_ns = rig.frame.stamp_ns;
    fovea_pose_get(rig.rt, &from->pose);
    from->point_count = fv_odometry_surface(&rig.rt->odometry, &next, from->points, POINTS_MAX);
}

/* Its points in metres; the scale is the pose's. */
static uint32_t points_of(const struct seen_from *from, const struct fv_se3 *T_odom_cam,
                          struct fovea_grid_point points[POINTS_MAX])
{
    for (uint32_t i = 0; i < from->point_count; i++) {
        const double metres = from->pose.scale;
        double q[3], p[3];
        for (int k = 0; k < 3; k++)
            q[k] = metres * (double)from->points[i].position[k];
        fv_se3_apply(T_odom_cam, q, p);
        const double along = metres * (double)from->points[i].along,
                     unit = from->pose.scale_sigma * fv_norm3(q);
        points[i] = (struct fovea_grid_point){{(float)p[0], (float)p[1], (float)p[2]},
                                              (float)__builtin_sqrt(along * along + unit * unit),
                                              (float)(metres * (double)from->points[i].across)};
    }
    return from->point_count;
}

static struct fovea_grid_view view_of(const struct seen_from *from,
                                      const struct fovea_segmentation *seen)
{
    static struct fovea_grid_point points[POINTS_MAX];
    const struct fovea_pose *pose = &from->pose;
    struct fv_se3 B, back, T_odom_cam, T_odom_body;
    struct fovea_grid_view view = {.stamp_ns = seen->stamp_ns,
                                   .seen = seen,
                                   .labels = rig.config.grid_job.labels,
                                   .camera = &rig.config.rig.cameras[0].camera};
    fv_se3_from_rows(T_body_cam, &B);
    fv_se3_from_rows(pose->T_world_cam, &T_odom_cam);
    fv_se3_compose(&B, &T_odom_cam, &T_odom_cam);
    fv_se3_invert(&B, &back);
    fv_se3_compose(&T_odom_cam, &back, &T_odom_body);
    fv_se3_to_rows(&T_odom_cam, view.T_odom_cam);
    view.position_m[0] = T_odom_body.t[0];
    view.position_m[1] = T_odom_body.t[1];
    view.yaw_rad = fv_atan2(T_odom_body.R[3], T_odom_body.R[0]);
    struct fovea_ground ground;
    assert_true(fovea_ground_get(rig.rt, &ground) && ground.stamp_ns == seen->stamp_ns);
    assert_true(ground.position_m[0] == view.position_m[0]);
    view.floor_m = ground.height_m;
    memcpy(view.floor_slope, ground.slope, sizeof view.floor_slope);
    memcpy(view.floor_covariance, ground.covariance, sizeof view.floor_covariance);
    assert_true(ground.covariance[5] > 0);
    view.points = points;
    view.point_count = rig.config.grid_job.landmarks ? points_of(from, &T_odom_cam, points) : 0;
    return view;
}

static struct fovea_grid *beside;
static void *beside_memory;
static void make_beside(void)
{
    size_t bytes;
    assert_int_equal(fovea_grid_size(&rig.config.grid_job.grid, &bytes, NULL), FOVEA_OK);
    beside_memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
    assert_int_equal(
        fovea_grid_init(&beside, &rig.config.grid_job.grid, beside_memory, bytes, NULL), FOVEA_OK);
}

/* The loop has laid the mask on its floor. */
static bool is_laid(const struct fovea_segmentation *seen)
{
    struct fovea_ground ground;
    return fovea_ground_get(rig.rt, &ground) && ground.stamp_ns == seen->stamp_ns;
}

/* The grid beside takes each new mask of a frame that was posed in metres. */
static void update_beside(const struct seen_from *poses, uint64_t *inferences)
{
    struct fovea_segmentation seen;
    fovea_segmentation_get(rig.rt, 0, &seen);
    if (seen.inferences == *inferences || !is_laid(&seen)) return;
    *inferences = seen.inferences;
    for (int i = 0; i < FRAMES; i++) {
        if (poses[i].stamp_ns != seen.stamp_ns || !poses[i].pose.posed ||
            poses[i].pose.scale_source == FOVEA_SCALE_FREE)
            continue;
        const struct fovea_grid_view view = view_of(&poses[i], &seen);
        assert_int_equal(fovea_grid_update(beside, &view), FOVEA_OK);
    }
}

/* A grid that is complete is the one beside, where that is of the same mask; after a loss nothing
 * is known. */
static void compare(struct sent_grid *run)
{
    static int8_t cells[SIDE * SIDE];
    struct fovea_grid_place place;
    fovea_grid_cells(beside, cells, &place);
    if (run->grid_stamp_ns != place.stamp_ns || rig.pose[rig.frames - 1].posed == false) return;
    assert_memory_equal(run->cells, cells, sizeof cells);
    run->compared++;
}

/* The whole run, with `units` of the networks' job per work call and `calls` of them per frame; the
 * grid beside is kept with it. `dark`: frames from there on are black. */
static void run_with(uint32_t units, int calls, int dark, bool copied, struct sent_grid *run)
{
    static struct seen_from poses[FRAMES];
    static uint8_t black[320 * 240];
    uint64_t inferences = 0;
    void *other = NULL;
    memset(run, 0, sizeof *run);
    open_rig(WAY);
    sim_rig_build(&rig);
    make_beside();
    while (sim_rig_next(&rig)) {
        const struct fovea_sample sample = wheels();
        struct fovea_outputs outputs;
        const int n = rig.frames;
        rig.inputs.sample_count = 1;
        rig.inputs.samples = &sample;
        if (n >= dark) rig.frame.images[0].data = black;
        rig.inputs.grants.units[FOVEA_JOB_DETECT] = units;
        (void)fovea_step(rig.rt, &rig.inputs, &outputs);
        sent_grid_take(&outputs, run);
        remember_frame(&poses[n]);
        rig.pose[rig.frames++] = poses[n].pose;
        rig.ops->requeue(rig.source, &rig.frame);
        for (int i = 0; i < calls; i++) {
            (void)fovea_work(rig.rt, &rig.inputs.grants, &outputs);
            const int before = run->grids;
            sent_grid_take(&outputs, run);
            update_beside(poses, &inferences);
            if (run->grids > before) compare(run);
        }
        if (copied && n == FRAMES / 2) { /* go on in a copy */
            size_t bytes;
            assert_int_equal(fovea_size(&rig.config, &bytes, NULL), FOVEA_OK);
            other = rig.rt;
            assert_int_equal(
                fovea_copy(other, aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64),
                           bytes, &rig.rt),
                FOVEA_OK);
            memset(other, 0x5a, bytes);
        }
    }
    run->known = sent_grid_known(run->cells);
    free(other);
}

static void end_run(void)
{
    free(beside_memory);
    sim_rig_close(&rig);
}

/* The end of a run that several tests go on from, each in a copy of its runtime. */
static struct ended {
    int dark;
    void *memory;
    size_t bytes;
    struct sent_grid run;
    struct sim_rig rig;
} ended[2] = {{.dark = FRAMES}, {.dark = FRAMES - 10}};

/* `run` and `rig` as a whole run leaves them: ended by free_copy. */
static void run_to_the_end(int dark, struct sent_grid *run)
{
    struct ended *e = &ended[dark == FRAMES ? 0 : 1];
    assert_int_equal(e->dark, dark);
    if (e->memory == NULL) {
        run_with(400, 4, dark, false, &e->run);
        e->rig = rig;
        e->bytes = rig.rt->block_bytes;
        e->memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (e->bytes + 63) / 64 * 64);
        assert_int_equal(fovea_copy(rig.rt, e->memory, e->bytes, &e->rig.rt), FOVEA_OK);
        end_run();
    }
    rig = e->rig;
    *run = e->run;
    assert_int_equal(fovea_copy(e->rig.rt,
                                aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (e->bytes + 63) / 64 * 64),
                                e->bytes, &rig.rt),
                     FOVEA_OK);
}

static void free_copy(void)
{
    free(rig.rt);
}

static int tear_down(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++)
        free(ended[i].memory);
    return 0;
}

/* The picture of a run: a pixel for each cell, y up. */
static void check_picture(const int8_t *cells)
{
    char path[] = "/tmp/fovea-grid-XXXXXX";
    struct fovea_error error;
    struct fovea_image image;
    struct fv_grid_counts counts;
    uint32_t found[256] = {0};
    close(mkstemp(path));
    assert_int_equal(fv_grid_file_write(path, rig.rt, SIDE, &counts, &error), FOVEA_OK);
    assert_int_equal(fv_picture_read(path, &image, &error), FOVEA_OK);
    unlink(path);
    assert_true(image.width == SIDE && image.height == SIDE);
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            const int8_t percent = cells[y * SIDE + x];
            const uint8_t grey = image.data[(SIDE - 1 - y) * SIDE + x];
            assert_int_equal(grey, percent > 65 ? 0 : percent >= 0 && percent < 35 ? 254 : 205);
            found[grey]++;
        }
    assert_true(counts.free == found[254] && counts.occupied == found[0]);
    assert_true(counts.free > 50 && counts.occupied > 5);
    free((void *)(uintptr_t)image.data);
}

/* Heights of the run are those of the grid beside; so are those sent, and so is their picture. */
static void check_heights(const struct sent_grid *run)
{
    static int16_t own[SIDE * SIDE], of_beside[SIDE * SIDE];
    static uint8_t counts[2][SIDE * SIDE];
    char path[] = "/tmp/fovea-grid-XXXXXX.png", drawn[sizeof path + 16];
    struct fovea_grid_place place;
    struct fovea_error error;
    struct fovea_image image;
    int known = 0;
    assert_true(fovea_free_space_heights(rig.rt, own, counts[0], &place));
    assert_true(fovea_grid_heights(beside, of_beside, counts[1], &place));
    assert_memory_equal(own, of_beside, sizeof own);
    assert_memory_equal(counts[0], counts[1], sizeof counts[0]);
    assert_int_equal(run->height_grids, run->grids);
    assert_memory_equal(run->heights_mm, own, sizeof own);
    assert_memory_equal(run->height_counts, counts[0], sizeof counts[0]);
    close(mkstemps(path, 4));
    unlink(path);
    assert_int_equal(fv_grid_file_write_heights(path, rig.rt, &rig.config.grid_job.grid, &error),
                     FOVEA_OK);
    snprintf(drawn, sizeof drawn, "%.*s-heights.png", (int)strlen(path) - 4, path);
    assert_int_equal(fv_picture_read(drawn, &image, &error), FOVEA_OK);
    unlink(drawn);
    assert_true(image.width == SIDE && image.height == SIDE);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int height = own[i], grey = image.data[(SIDE - 1 - i / SIDE) * SIDE + i % SIDE];
        known += height != FOVEA_GRID_HEIGHT_UNKNOWN;
        assert_true((grey == 0) == (height == FOVEA_GRID_HEIGHT_UNKNOWN));
        if (grey == 0) continue;
        assert_true(abs(height) < 1500 && (grey >= 64) == (height * 63 > -1500));
    }
    print_message("%d heights known\n", known);
    assert_true(known > 5);
    free((void *)(uintptr_t)image.data);
}

/* ---- tests ----------------------------------------------------------------------------------- */

static void what_is_sent_is_the_grid_of_the_masks_and_poses(void **state)
{
    (void)state;
    static struct sent_grid run;
    static int8_t cells[SIDE * SIDE], got[SIDE * SIDE];
    float ranges[RAYS];
    struct fovea_grid_place place, own;
    run_with(400, 10, FRAMES, false, &run); /* heights come in several messages */
    fovea_grid_cells(beside, cells, &place);
    fovea_grid_scan(beside, ranges);
    print_message("%d grids, %d scans, %d cells known\n", run.grids, run.scans, run.known);
    assert_true(run.grids > 20 && run.scans == run.grids && run.compared == run.grids);
    assert_true(run.known > 500);
    assert_true(run.grid_stamp_ns == place.stamp_ns && run.scan_stamp_ns == place.stamp_ns);
    assert_memory_equal(run.cells, cells, sizeof cells);
    assert_memory_equal(run.ranges, ranges, sizeof ranges);
    assert_true(run.origin[0] == place.origin_m[0] && run.origin[1] == place.origin_m[1]);
    assert_true(fovea_free_space_get(rig.rt, got, &own));
    assert_memory_equal(got, cells, sizeof cells);
    assert_memory_equal(&own, &place, sizeof own);
    const struct fovea_pose *pose = &rig.pose[FRAMES - 1];
    assert_true(run.reset_counter == (int32_t)pose->reset_counter);
    assert_true(run.map_id == (int32_t)pose->map_id);
    check_picture(cells);
    check_heights(&run);
    end_run();
}

/* Few units per frame: an update takes several frames. */
static void with_few_units_the_same_grid_comes_later(void **state)
{
    (void)state;
    static struct sent_grid run;
    run_with(12, 1, FRAMES, false, &run);
    print_message("with 12 units per frame: %d grids, %d compared\n", run.grids, run.compared);
    assert_true(run.grids > 10 && run.compared > run.grids / 2);
    end_run();
}

static void copies_go_on_alike(void **state)
{
    (void)state;
    static struct sent_grid run, copied;
    run_with(37, 2, FRAMES, false, &run);
    end_run();
    run_with(37, 2, FRAMES, true, &copied);
    end_run();
    assert_memory_equal(&run, &copied, sizeof run);
}

static void a_lost_pose_leaves_nothing_known(void **state)
{
    (void)state;
    static struct sent_grid run;
    static int8_t cells[SIDE * SIDE];
    struct fovea_grid_place place;
    run_to_the_end(FRAMES - 10, &run);
    assert_true(run.grids > 10);
    assert_int_equal(rig.pose[FRAMES - 1].state, FOVEA_TRACKING_LOST);
    assert_int_equal(run.known, 0);
    for (int i = 0; i < RAYS; i++)
        assert_true(run.ranges[i] != run.ranges[i]);     /* NaN */
    assert_in_range(run.grids - run.height_grids, 0, 1); /* those of the last grid were dropped */
    assert_int_equal(run.height_row, 0);
    for (int i = 0; i < SIDE * SIDE; i++)
        assert_int_equal(run.heights_mm[i], FOVEA_GRID_HEIGHT_UNKNOWN);
    assert_false(fovea_free_space_get(rig.rt, cells, &place));
    free_copy();
}

/* Heights that are being sent do not keep the empty grid waiting: it is sent, as a whole, and
 * heights begin anew after it. */
static void heights_make_way_for_the_empty_grid(void **state)
{
    (void)state;
    static struct sent_grid run;
    struct fovea_outputs outputs;
    run_to_the_end(FRAMES - 10, &run);
    struct fv_free_space_state *s = rig.rt->free_space.state;
    const int64_t second_ns = 1000000000;
    for (int heights = 0; heights < 2; heights++) {
        s->phase = heights ? FV_FREE_SPACE_SENDING_HEIGHTS : FV_FREE_SPACE_SENDING_SCAN;
        s->sent = heights ? 70 : 0;
        s->emptied_ns = rig.rt->publish.state->stamp_ns - second_ns;
        fv_free_space_follow(&rig.rt->free_space, &rig.rt->publish);
        assert_int_equal(s->phase, heights ? FV_FREE_SPACE_SCANNING : FV_FREE_SPACE_SENDING_SCAN);
    }
    const int before = run.grids, heights_before = run.height_grids;
    s->world.reset_counter = 7;
    s->world.map_id = 9;
    run.grid_row = run.height_row = 0;
    rig.inputs.grants.units[FOVEA_JOB_DETECT] = 400;
    for (int i = 0; i < 8; i++) {
        (void)fovea_work(rig.rt, &rig.inputs.grants, &outputs);
        sent_grid_take(&outputs, &run);
    }
    assert_true(run.grids == before + 1 && run.height_grids == heights_before + 1);
    assert_true(run.reset_counter == 7 && run.map_id == 9);
    free_copy();
}

/* A packet may be lost: while the pose is, the empty grid and its scan come again with every second
 * of the frames' time, and no more often. Heights that are not asked for are not sent. */
static void while_it_stays_lost_that_is_said_every_second(void **state)
{
    (void)state;
    enum { DARK = 60 };
    static struct sent_grid run;
    with_heights = false;
    run_with(400, 4, DARK, false, &run);
    with_heights = true;
    int lost = DARK; /* the first frame without a pose */
    while (rig.pose[lost].posed)
        lost++;
    const int seconds = (FRAMES - 1 - lost) / 10;
    print_message("%d grids, %d scans; lost from frame %d on\n", run.grids, run.scans, lost);
    assert_true(seconds >= 4);
    assert_int_equal(run.known, 0);
    assert_int_equal(run.empty, 1 + seconds);
    assert_int_equal(run.scans, run.grids);
    assert_int_equal(run.height_grids, 0);
    end_run();
}

/* By the command, and by a camera that is gone: an empty grid is sent, and nothing is given. */
static void a_reset_and_a_camera_that_is_gone_leave_nothing_known(void **state)
{
    (void)state;
    for (int gone = 0; gone < 2; gone++) {
        static struct sent_grid run;
        static int8_t cells[SIDE * SIDE];
        struct fovea_grid_place place;
        struct fovea_outputs outputs;
        run_to_the_end(FRAMES, &run);
        assert_true(run.known > 0 && fovea_free_space_get(rig.rt, cells, &place));
        struct fovea_inputs inputs = {.now_ns = rig.frame.stamp_ns + 1000000000};
        fovea_grants_fixed(&rig.config, &inputs.grants);
        if (gone)
            inputs.source_state = FOVEA_SOURCE_GONE;
        else
            inputs.commands = FOVEA_COMMAND_RESET;
        (void)fovea_step(rig.rt, &inputs, &outputs);
        assert_false(fovea_free_space_get(rig.rt, cells, &place));
        const int before = run.grids;
        for (int i = 0; i < 8; i++) {
            (void)fovea_work(rig.rt, &inputs.grants, &outputs);
            sent_grid_take(&outputs, &run);
        }
        assert_int_equal(run.grids, before + 1);
        for (int i = 0; i < SIDE * SIDE; i++)
            assert_int_equal(run.cells[i], FOVEA_GRID_UNKNOWN);
        free_copy();
    }
}

/* As when gravity becomes known after metres. */
static void nothing_is_known_once_odom_has_changed(void **state)
{
    (void)state;
    static struct sent_grid run;
    static int8_t cells[SIDE * SIDE];
    struct fovea_grid_place place;
    run_to_the_end(FRAMES, &run);
    for (uint32_t changed = 0; changed < 2; changed++) {
        rig.rt->publish.state->changes += changed;
        fv_free_space_follow(&rig.rt->free_space, &rig.rt->publish);
        assert_int_equal(fovea_free_space_get(rig.rt, cells, &place), !changed);
    }
    free_copy();
}

static void a_camera_on_the_floor_is_refused(void **state)
{
    (void)state;
    size_t bytes;
    struct fovea_error error;
    open_rig(WAY);
    rig.config.rig.cameras[0].T_body_cam[11] = 0;
    assert_int_equal(fovea_size(&rig.config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "grid.enabled: found a camera 0 m over"));
    rig.config.rig.cameras[0].T_body_cam[11] = 1;
    rig.config.odometry.enabled = false;
    assert_int_equal(fovea_size(&rig.config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "grid.enabled: found odometry.enabled false"));
    rig.config.odometry.enabled = true;
    rig.config.grid_job.enabled = false;
    rig.config.grid_job.grid.heights = true;
    assert_int_equal(fovea_size(&rig.config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "grid.heights: found true, expected grid.enabled"));
    rig.config.grid_job.enabled = true;
    rig.config.grid_job.landmarks = false;
    assert_int_equal(fovea_size(&rig.config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "grid.heights: found true with grid.landmarks false"));
    rig.config.grid_job.landmarks = true;
    rig.config.grid_job.grid.range_m = 6.5;
    assert_int_equal(fovea_size(&rig.config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "grid.range_m: found 6.5, expected at most half the side"));
    rig.ops->close(rig.source);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_sent_is_the_grid_of_the_masks_and_poses),
        cmocka_unit_test(with_few_units_the_same_grid_comes_later),
        cmocka_unit_test(copies_go_on_alike),
        cmocka_unit_test(a_lost_pose_leaves_nothing_known),
        cmocka_unit_test(heights_make_way_for_the_empty_grid),
        cmocka_unit_test(while_it_stays_lost_that_is_said_every_second),
        cmocka_unit_test(a_reset_and_a_camera_that_is_gone_leave_nothing_known),
        cmocka_unit_test(nothing_is_known_once_odom_has_changed),
        cmocka_unit_test(a_camera_on_the_floor_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, tear_down);
}
