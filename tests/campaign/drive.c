/* The robot of sim:drive finds its way through unseen halls: grid of free space from true masks,
 * the planner of tools/examples/navigate, velocity commands, frame by frame in lock-step.
 *
 *     drive [--first SEED] [--worlds N] [--needed N] [--options TEXT]
 *
 * A line for each world: when it came to the goal, how long the shortest way takes at the same
 * speed, and contacts. Exit 0 when at least `needed` of the worlds were driven within three times
 * the shortest way's time, without a contact. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../../drivers/sim/sim.h"
#include "../../tools/examples/navigate/plan.h"
#include "fovea/grid.h"

static const struct fovea_source_ops *const ops = &fv_source_sim;
static const double late = 3; /* times the shortest way's time */

struct settings {
    long first, worlds, needed;
    const char *options;
};

static struct navigate planner;
static struct fovea_grid *grid;

static const uint8_t labels[256] = {
    [FOVEA_TRUTH_BACKGROUND] = FOVEA_GRID_IGNORED, [FOVEA_TRUTH_BALL] = FOVEA_GRID_MOVABLE,
    [FOVEA_TRUTH_CONE] = FOVEA_GRID_MOVABLE,       [FOVEA_TRUTH_BOX] = FOVEA_GRID_MOVABLE,
    [FOVEA_TRUTH_PERSON] = FOVEA_GRID_MOVABLE,     [FOVEA_TRUTH_FLOOR] = FOVEA_GRID_FLOOR,
    [FOVEA_TRUTH_WALL] = FOVEA_GRID_OBSTACLE,      [FOVEA_TRUTH_OBSTACLE] = FOVEA_GRID_OBSTACLE};

static void *make_grid(void)
{
    struct fovea_grid_config config;
    struct fovea_error error;
    size_t bytes;
    fovea_grid_config_default(&config);
    if (fovea_grid_size(&config, &bytes, &error) != FOVEA_OK) return NULL;
    void *memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
    return fovea_grid_init(&grid, &config, memory, bytes, &error) == FOVEA_OK ? memory : NULL;
}

static bool update(const struct fovea_source *source, const struct fovea_frame *frame,
                   const struct fovea_truth *truth, const double T_world_body[12])
{
    static struct fovea_segmentation_class list[FOVEA_TRUTH_CLASS_COUNT];
    static uint8_t index[256];
    const struct fovea_camera *camera = &source->info.rig.cameras[0].camera;
    for (int i = 0; i < FOVEA_TRUTH_CLASS_COUNT; i++) {
        list[i].class_id = i;
        index[i] = (uint8_t)i;
    }
    const struct fovea_segmentation seen = {.width = camera->width,
                                            .height = camera->height,
                                            .image_width = camera->width,
                                            .image_height = camera->height,
                                            .raw_scale = {1, 1},
                                            .count = FOVEA_TRUTH_CLASS_COUNT,
                                            .list = list,
                                            .pixels = truth->class_mask,
                                            .index = index};
    struct fovea_grid_view view = {.stamp_ns = frame->stamp_ns,
                                   .seen = &seen,
                                   .labels = labels,
                                   .camera = camera,
                                   .position_m = {T_world_body[3], T_world_body[7]},
                                   .yaw_rad = fv_atan2(T_world_body[4], T_world_body[0])};
    memcpy(view.T_odom_cam, truth->T_world_cam, sizeof view.T_odom_cam);
    return fovea_grid_update(grid, &view) == FOVEA_OK;
}

static bool answer(struct fovea_source *source, const struct fovea_frame *frame)
{
    static struct fovea_truth truth;
    static int8_t cells[128 * 128];
    struct fovea_grid_place at;
    struct fovea_error error;
    double T[12];
    if (ops->truth(source, frame, &truth) != FOVEA_OK) return false;
    fv_sim_motion_body(&source->motion, fv_sim_frame_time(source, frame->sequence), T);
    if (!update(source, frame, &truth, T)) return false;
    fovea_grid_cells(grid, cells, &at);
    if (!navigate_plan(&planner, cells, (int32_t)at.width, (int32_t)at.height, at.resolution_m,
                       at.origin_m))
        return false;
    const double position[2] = {T[3], T[7]};
    const struct navigate_motion motion = navigate_steer(&planner, position, fv_atan2(T[4], T[0]));
    const struct fovea_velocity_command command = {.sequence = (int64_t)frame->sequence,
                                                   .velocity_m_s = {motion.speed_m_s, 0, 0},
                                                   .angular_rate = {0, 0, motion.turning_rad_s}};
    return ops->drive(source, &command, &error) == FOVEA_OK;
}

/* 1: driven as required; 0: not; -1: it could not be tried. */
static int drive(long seed, const char *options)
{
    const struct navigate_robot robot = {FV_SIM_DRIVE_RADIUS_M, FV_SIM_DRIVE_SPEED_M_S, 1.2};
    char address[256];
    struct fovea_source *source = NULL;
    struct fovea_frame frame;
    struct fovea_error error;
    snprintf(address, sizeof address, "drive?seed=%ld&commands=1&wheel_odometry=0%s", seed,
             options);
    if (ops->open(address, NULL, &source, &error) != FOVEA_OK ||
        ops->start(source, &error) != FOVEA_OK) {
        fprintf(stderr, "%s\n", error.text);
        return -1;
    }
    const struct fv_sim_drive *d = &source->world.drive;
    const double shortest_s = d->shortest_m / FV_SIM_DRIVE_SPEED_M_S;
    void *memory = make_grid();
    bool fine = memory != NULL;
    navigate_init(&planner, &robot, d->goal);
    while (fine && (double)d->tick_count * d->tick_s < late * shortest_s + 1 &&
           ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        fine = answer(source, &frame);
        ops->requeue(source, &frame);
    }
    const double reached_s = d->reached < 0 ? 0 : (double)d->reached * d->tick_s;
    const bool good = reached_s > 0 && reached_s <= late * shortest_s && d->contacts == 0;
    printf("seed %ld: %s at the goal after %.1f s, shortest %.1f s (%.2f), contacts %d%s\n", seed,
           reached_s > 0 ? "" : "not", reached_s, shortest_s, reached_s / shortest_s,
           (int)d->contacts, good ? "" : "   FAILED");
    fflush(stdout);
    ops->stop(source);
    ops->close(source);
    free(memory);
    return fine ? good : -1;
}

int main(int argc, char **argv)
{
    struct settings s = {1, 100, 95, "&width=320&height=240&rate=10"};
    long done = 0;
    for (int i = 1; i + 1 < argc; i += 2) {
        if (strcmp(argv[i], "--first") == 0) s.first = strtol(argv[i + 1], NULL, 10);
        if (strcmp(argv[i], "--worlds") == 0) s.worlds = strtol(argv[i + 1], NULL, 10);
        if (strcmp(argv[i], "--needed") == 0) s.needed = strtol(argv[i + 1], NULL, 10);
        if (strcmp(argv[i], "--options") == 0) s.options = argv[i + 1];
    }
    for (long seed = s.first; seed < s.first + s.worlds; seed++) {
        const int good = drive(seed, s.options);
        if (good < 0) return 2;
        done += good;
    }
    printf("%ld of %ld worlds within %g times the shortest way's time and without a contact\n",
           done, s.worlds, late);
    return done >= s.needed ? 0 : 1;
}
