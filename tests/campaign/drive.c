/* The robot of sim:drive finds its way through unseen halls: grid of free space from true masks,
 * the planner of tools/examples/navigate, velocity commands, frame by frame in lock-step. Poses are
 * the truth's, or those of the runtime with two cameras (--stereo 1).
 *
 *     drive [--first SEED] [--worlds N] [--needed N] [--stereo 0|1] [--options TEXT]
 *
 * A line for each world: when it came to the goal, how long the shortest way takes at the same
 * speed, and contacts. Exit 0 when at least `needed` of the worlds were driven within three times
 * the shortest way's time, without a contact. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/sim_cells.h"
#include "../../tools/examples/navigate/plan.h"
#include "fovea/fovea.h"
#include "geometry/se3.h"

static const struct fovea_source_ops *const ops = &fv_source_sim;
static const double late = 3; /* times the shortest way's time */

struct settings {
    long first, worlds, needed, stereo;
    const char *options;
};

static struct navigate planner;
static struct fovea_grid *grid;
static struct fovea_config config;
static struct fovea *rt;           /* NULL: poses are the truth's */
static struct fv_se3 T_world_odom; /* of the runtime's poses, by the first of them */
static bool begun;

static void *make_grid(void)
{
    struct fovea_grid_config cells;
    struct fovea_error error;
    size_t bytes;
    fovea_grid_config_default(&cells);
    if (fovea_grid_size(&cells, &bytes, &error) != FOVEA_OK) return NULL;
    void *memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
    return fovea_grid_init(&grid, &cells, memory, bytes, &error) == FOVEA_OK ? memory : NULL;
}

/* ---- poses ----------------------------------------------------------------------------------- */

static bool make_runtime(const struct fovea_source *source)
{
    struct fovea_error error;
    size_t bytes;
    fovea_config_default(&config);
    config.rig = source->info.rig;
    rt = NULL;
    begun = false;
    if (fovea_size(&config, &bytes, &error) != FOVEA_OK) return false;
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    return memory != NULL && fovea_init(memory, bytes, &config, &rt, &error) == FOVEA_OK;
}

/* Where the camera is, in the world; the runtime's poses are laid on the truth at the first frame
 * alone. False: there is no pose. */
static bool find_pose(const struct fovea_frame *frame, const double truth[12], struct fv_se3 *T)
{
    struct fovea_inputs inputs = {.frame = frame, .now_ns = frame->stamp_ns};
    struct fovea_outputs outputs;
    struct fovea_pose pose;
    fv_se3_from_rows(truth, T);
    if (rt == NULL) return true;
    fovea_grants_fixed(&config, &inputs.grants);
    (void)fovea_step(rt, &inputs, &outputs);
    fovea_pose_get(rt, &pose);
    (void)fovea_work(rt, &inputs.grants, &outputs);
    if (!pose.posed || pose.scale_source == FOVEA_SCALE_FREE || pose.reset_counter > 0)
        return false;
    struct fv_se3 seen, back;
    fv_se3_from_rows(pose.T_world_cam, &seen);
    if (!begun) {
        fv_se3_invert(&seen, &back);
        fv_se3_compose(T, &back, &T_world_odom);
        begun = true;
    }
    fv_se3_compose(&T_world_odom, &seen, T);
    return true;
}

/* ---- a frame --------------------------------------------------------------------------------- */

static bool update(const struct fovea_source *source, const struct fovea_frame *frame,
                   const struct fovea_truth *truth, const struct fv_se3 *T_world_cam,
                   const struct fv_se3 *T_world_body)
{
    const struct fovea_camera *camera = &source->info.rig.cameras[0].camera;
    const struct fovea_segmentation seen = sim_mask_of(truth, camera);
    struct fovea_grid_view view = {.stamp_ns = frame->stamp_ns,
                                   .seen = &seen,
                                   .labels = sim_labels,
                                   .camera = camera,
                                   .position_m = {T_world_body->t[0], T_world_body->t[1]},
                                   .yaw_rad = fv_atan2(T_world_body->R[3], T_world_body->R[0]),
                                   .floor_m = T_world_body->t[2]};
    fv_se3_to_rows(T_world_cam, view.T_odom_cam);
    return fovea_grid_update(grid, &view) == FOVEA_OK;
}

/* What to do now: nothing without a pose. False: it failed. */
static bool decide(const struct fovea_source *source, const struct fovea_frame *frame,
                   const struct fovea_truth *truth, struct navigate_motion *motion)
{
    static int8_t cells[512 * 512]; /* as many as a grid may have */
    struct fovea_grid_place at;
    struct fv_se3 T_cam_body, T_world_cam, T_world_body;
    *motion = (struct navigate_motion){0};
    if (!find_pose(frame, truth->T_world_cam, &T_world_cam)) {
        fovea_grid_forget(grid);
        return true;
    }
    fv_se3_from_rows(source->info.rig.cameras[0].T_body_cam, &T_cam_body);
    fv_se3_invert(&T_cam_body, &T_cam_body);
    fv_se3_compose(&T_world_cam, &T_cam_body, &T_world_body);
    if (!update(source, frame, truth, &T_world_cam, &T_world_body)) return false;
    fovea_grid_cells(grid, cells, &at);
    if (!navigate_plan(&planner, cells, (int32_t)at.width, (int32_t)at.height, at.resolution_m,
                       at.origin_m))
        return false;
    *motion =
        navigate_steer(&planner, T_world_body.t, fv_atan2(T_world_body.R[3], T_world_body.R[0]),
                       (double)frame->stamp_ns * 1e-9);
    return true;
}

static bool answer(struct fovea_source *source, const struct fovea_frame *frame)
{
    static struct fovea_truth truth;
    struct navigate_motion motion;
    struct fovea_error error;
    if (ops->truth(source, frame, &truth) != FOVEA_OK || !decide(source, frame, &truth, &motion))
        return false;
    const struct fovea_velocity_command command = {.sequence = (int64_t)frame->sequence,
                                                   .velocity_m_s = {motion.speed_m_s, 0, 0},
                                                   .angular_rate = {0, 0, motion.turning_rad_s}};
    return ops->drive(source, &command, &error) == FOVEA_OK;
}

/* 1: driven as required; 0: not; -1: it could not be tried. */
static int drive(long seed, const struct settings *settings, long *touched)
{
    const struct navigate_robot robot = {FV_SIM_DRIVE_RADIUS_M, FV_SIM_DRIVE_SPEED_M_S, 1.2};
    char address[256];
    struct fovea_source *source = NULL;
    struct fovea_frame frame;
    struct fovea_error error;
    snprintf(address, sizeof address, "drive?seed=%ld&commands=1&wheel_odometry=0%s%s", seed,
             settings->stereo ? "&baseline=0.12" : "", settings->options);
    if (ops->open(address, NULL, &source, &error) != FOVEA_OK ||
        ops->start(source, &error) != FOVEA_OK) {
        fprintf(stderr, "%s\n", error.text);
        return -1;
    }
    const struct fv_sim_drive *d = &source->world.drive;
    const double shortest_s = d->shortest_m / FV_SIM_DRIVE_SPEED_M_S;
    void *memory = make_grid();
    bool fine = memory != NULL && (!settings->stereo || make_runtime(source));
    navigate_init(&planner, &robot, d->goal);
    while (fine && (double)d->tick_count * d->tick_s < late * shortest_s + 1 &&
           ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        fine = answer(source, &frame);
        ops->requeue(source, &frame);
    }
    const double reached_s = d->reached < 0 ? 0 : (double)d->reached * d->tick_s;
    const bool good = reached_s > 0 && reached_s <= late * shortest_s && d->contacts == 0;
    *touched += d->contacts != 0;
    printf("seed %ld: %s at the goal after %.1f s, shortest %.1f s (%.2f), contacts %d%s\n", seed,
           reached_s > 0 ? "" : "not", reached_s, shortest_s, reached_s / shortest_s,
           (int)d->contacts, good ? "" : "   FAILED");
    fflush(stdout);
    ops->stop(source);
    ops->close(source);
    free(memory);
    free(rt);
    rt = NULL;
    return fine ? good : -1;
}

int main(int argc, char **argv)
{
    struct settings s = {1, 100, 95, 0, "&width=320&height=240&rate=10"};
    long done = 0, touched = 0;
    for (int i = 1; i + 1 < argc; i += 2) {
        if (strcmp(argv[i], "--first") == 0) s.first = strtol(argv[i + 1], NULL, 10);
        if (strcmp(argv[i], "--worlds") == 0) s.worlds = strtol(argv[i + 1], NULL, 10);
        if (strcmp(argv[i], "--needed") == 0) s.needed = strtol(argv[i + 1], NULL, 10);
        if (strcmp(argv[i], "--stereo") == 0) s.stereo = strtol(argv[i + 1], NULL, 10);
        if (strcmp(argv[i], "--options") == 0) s.options = argv[i + 1];
    }
    for (long seed = s.first; seed < s.first + s.worlds; seed++) {
        const int good = drive(seed, &s, &touched);
        if (good < 0) return 2;
        done += good;
    }
    printf(
        "%ld of %ld worlds within %g times the shortest way's time and without a contact; with a "
        "contact %ld, expected none\n",
        done, s.worlds, late, touched);
    return done >= s.needed && touched == 0 ? 0 : 1;
}
