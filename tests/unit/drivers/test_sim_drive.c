/* The robot that drives through simulated halls: its path leads to the goal and touches nothing,
 * every hall leaves a way that is wide enough, what moves is slow and gives way, and the truth of
 * the floor's cells is what the pictures show. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/sim_cells.h"
#include "common/sim_source.h"

enum { SEEDS = 24 };

static const struct fovea_source_ops *const ops = &fv_source_sim;
static struct fv_sim_world world;

static void build_with(int seed, const char *more)
{
    char address[48];
    struct fv_sim_options options;
    struct fovea_error error;
    snprintf(address, sizeof address, "drive?seed=%d%s", seed, more);
    assert_int_equal(fv_sim_options_parse(address, &options, &error), FOVEA_OK);
    assert_true(fv_sim_world_build(&world, &options));
}

static void build(int seed)
{
    build_with(seed, "");
}

/* ---- the path -------------------------------------------------------------------------------- */

static double mover_gap(const struct fv_sim_drive *d, double t, const double robot[2])
{
    double least = 1e9;
    for (int32_t i = 0; i < d->mover_count; i++) {
        double at[2], heading, along;
        fv_sim_drive_mover(d, i, t, at, &heading, &along);
        least = fmin(least, hypot(at[0] - robot[0], at[1] - robot[1]) - d->mover[i].radius -
                                FV_SIM_DRIVE_RADIUS_M);
    }
    return least;
}

static void the_path_leads_to_the_goal_and_touches_nothing(void **state)
{
    double least = 1e9, least_mover = 1e9, speed = 0, acceleration = 0, turning = 0, longest = 0;
    (void)state;
    for (int seed = 0; seed < SEEDS; seed++) {
        build(seed);
        const struct fv_sim_drive *d = &world.drive;
        const double dt = 1.0 / 30, seconds = fv_sim_drive_seconds(d);
        double p[2], was[2], before[2], yaw, yaw_was;
        fv_sim_drive_robot(d, 0, before, &yaw_was);
        fv_sim_drive_robot(d, dt, was, &yaw_was);
        assert_true(hypot(before[0] - d->start[0], before[1] - d->start[1]) < 0.1);
        for (int n = 2; n * dt < seconds; n++) {
            fv_sim_drive_robot(d, n * dt, p, &yaw);
            least = fmin(least, fv_sim_drive_gap(d, p, FV_SIM_DRIVE_RADIUS_M));
            least_mover = fmin(least_mover, mover_gap(d, n * dt, p));
            speed = fmax(speed, hypot(p[0] - was[0], p[1] - was[1]) / dt);
            acceleration =
                fmax(acceleration,
                     hypot(p[0] - 2 * was[0] + before[0], p[1] - 2 * was[1] + before[1]) / dt / dt);
            turning = fmax(turning, fabs(yaw - yaw_was) / dt);
            memcpy(before, was, sizeof was);
            memcpy(was, p, sizeof p);
            yaw_was = yaw;
        }
        assert_true(d->reached > 0 && d->contacts == 0);
        assert_true(hypot(was[0] - d->goal[0], was[1] - d->goal[1]) < 0.1);
        assert_true(hypot(was[0] - before[0], was[1] - before[1]) < 1e-6); /* it stands */
        assert_true(seconds * FV_SIM_DRIVE_SPEED_M_S > d->shortest_m);
        longest = fmax(longest, seconds);
        fv_sim_world_free(&world);
    }
    print_message("nearest %.2f m, to what moves %.2f; at most %.2f m/s, %.2f m/s^2, %.2f rad/s, "
                  "%.0f s\n",
                  least, least_mover, speed, acceleration, turning, longest);
    assert_true(least > 0.03 && least_mover > 0.1);
    assert_true(speed < 0.51 && acceleration < 1.6 && turning < 1.51 && longest < 90);
}

/* Flood fill on cells of 5 cm, of which each is clear by more than half of the stated width. */
static bool way_is_wide(const struct fv_sim_drive *d)
{
    enum { SIDE = 256 };
    static uint8_t seen[SIDE * SIDE];
    static int32_t queue[SIDE * SIDE];
    const double cell = 0.05;
    int32_t count = 0, read = 0;
    memset(seen, 0, sizeof seen);
    queue[count++] = (int32_t)((d->start[1] + d->half[1]) / cell) * SIDE +
                     (int32_t)((d->start[0] + d->half[0]) / cell);
    while (read < count) {
        const int32_t at = queue[read++], step[4] = {1, -1, SIDE, -SIDE};
        const double p[2] = {(at % SIDE + 0.5) * cell - d->half[0],
                             (at / SIDE + 0.5) * cell - d->half[1]};
        if (hypot(p[0] - d->goal[0], p[1] - d->goal[1]) < 2 * cell) return true;
        for (int k = 0; k < 4; k++) {
            const int32_t next = at + step[k];
            const double q[2] = {(next % SIDE + 0.5) * cell - d->half[0],
                                 (next / SIDE + 0.5) * cell - d->half[1]};
            if (next < 0 || next >= SIDE * SIDE || seen[next] ||
                fv_sim_drive_gap(d, q, FV_SIM_DRIVE_RADIUS_M + 0.15) < 0)
                continue;
            seen[next] = 1;
            queue[count++] = next;
        }
    }
    return false;
}

static void every_hall_leaves_a_way_wider_than_the_robot(void **state)
{
    int pits = 0, blocks = 0, movers = 0;
    (void)state;
    for (int seed = 0; seed < SEEDS; seed++) {
        build(seed);
        assert_true(way_is_wide(&world.drive));
        pits += world.drive.pit[1] > world.drive.pit[0];
        blocks += world.drive.block_count;
        movers += world.drive.mover_count;
        fv_sim_world_free(&world);
    }
    print_message("%d halls: %d with a pit, %d blocks, %d that move\n", SEEDS, pits, blocks,
                  movers);
    assert_true(pits > SEEDS / 3 && pits < SEEDS && blocks > 8 * SEEDS && movers > 2 * SEEDS);
}

/* ---- beside the pit -------------------------------------------------------------------------- */

/* How far a place is from the pit, and how far off its direction the robot looks. */
static double pit_distance(const struct fv_sim_drive *d, const double p[2], double yaw, double *off)
{
    const double x = fmax(fmax(d->pit[0] - p[0], p[0] - d->pit[1]), 0),
                 y = fmax(fmax(d->pit[2] - p[1], p[1] - d->pit[3]), 0),
                 to = atan2(0.5 * (d->pit[2] + d->pit[3]) - p[1],
                            0.5 * (d->pit[0] + d->pit[1]) - p[0]);
    *off = fabs(remainder(yaw - to, 2 * FV_PI));
    return hypot(x, y);
}

/* In each second elsewhere, off all that stands and moves; truly still in between. */
static void it_stands_beside_the_pit_where_that_is_asked_for(void **state)
{
    double least = 1e9, farthest = 0;
    int halls = 0, near = 0, places = 0;
    (void)state;
    for (int seed = 0; seed < SEEDS; seed++) {
        build_with(seed, "&stands=1");
        const struct fv_sim_drive *d = &world.drive;
        double p[2], later[2], was[2] = {0, 0}, yaw, yaw_later, off;
        assert_true(fv_sim_drive_seconds(d) == FV_SIM_DRIVE_STANDS);
        for (int n = 0; n < FV_SIM_DRIVE_STANDS && d->pit[1] > d->pit[0]; n++) {
            fv_sim_drive_robot(d, n + 0.01, p, &yaw);
            fv_sim_drive_robot(d, n + 0.99, later, &yaw_later);
            assert_true(p[0] == later[0] && p[1] == later[1] && yaw == yaw_later);
            assert_true(n == 0 || hypot(p[0] - was[0], p[1] - was[1]) > 1e-3);
            assert_true(fv_sim_drive_gap(d, p, FV_SIM_DRIVE_RADIUS_M) > 0);
            assert_true(mover_gap(d, n, p) > 0);
            const double away = pit_distance(d, p, yaw, &off);
            least = fmin(least, away);
            farthest = fmax(farthest, away);
            assert_true(off < 0.5 * FV_PI + 0.5);
            near += away < 0.6;
            places++;
            memcpy(was, p, sizeof was);
        }
        halls += d->pit[1] > d->pit[0];
        fv_sim_world_free(&world);
    }
    print_message("%d halls: %.2f to %.2f m from the pit, %d of %d within 0.6 m\n", halls, least,
                  farthest, near, places);
    assert_true(halls > SEEDS / 3 && least < 0.25 && farthest > 2 && farthest < 5);
    assert_true(5 * near > 2 * places);
}

/* ---- what moves ------------------------------------------------------------------------------ */

static void what_moves_is_slow_and_stays_off_what_stands(void **state)
{
    double fastest = 0;
    (void)state;
    for (int seed = 0; seed < SEEDS; seed++) {
        build(seed);
        const struct fv_sim_drive *d = &world.drive;
        for (int32_t i = 0; i < d->mover_count; i++) {
            double at[2], was[2] = {0, 0}, heading, along, way = 0;
            for (double t = 0; t < fv_sim_drive_seconds(d); t += 0.1) {
                fv_sim_drive_mover(d, i, t, at, &heading, &along);
                assert_true(fv_sim_drive_gap(d, at, d->mover[i].radius) > 0.03);
                const double moved = t > 0 ? hypot(at[0] - was[0], at[1] - was[1]) : 0;
                fastest = fmax(fastest, moved / 0.1);
                way += moved;
                memcpy(was, at, sizeof at);
            }
            assert_true(way > 0.3);
        }
        fv_sim_world_free(&world);
    }
    assert_true(fastest > 0.3 && fastest <= 0.5);
}

/* A robot that stands in the way of what moves is not run into, however long it stands there. */
static void what_moves_gives_way(void **state)
{
    static struct fv_sim_drive_tick ticks[6000];
    struct fv_sim_drive d = {.half = {5, 4},
                             .goal = {4, 0},
                             .mover_count = 1,
                             .tick_s = 0.02,
                             .tick = ticks,
                             .tick_count = 1,
                             .tick_room = 6000,
                             .reached = -1};
    double least = 1e9, at[2], robot[2], heading, along, yaw;
    int away = 0;
    (void)state;
    d.mover[0] = (struct fv_sim_mover){
        .from = {0, -2}, .way = {0, 1}, .length = 4, .speed = 0.45, .radius = 0.22};
    memset(ticks, 0, sizeof ticks);
    ticks[0].direction[0] = 1;
    ticks[0].position[0] = 0.3;
    while (d.tick_count < d.tick_room)
        fv_sim_drive_step(&d, 0, 0);
    for (double t = 0; t < 119; t += 0.05) {
        fv_sim_drive_mover(&d, 0, t, at, &heading, &along);
        fv_sim_drive_robot(&d, t, robot, &yaw);
        least = fmin(least, hypot(at[0] - robot[0], at[1] - robot[1]) - 0.42);
        away += along < 0.05;
    }
    assert_true(least > 0.5 && away > 20 && d.contacts == 0);
}

/* The robot stops at what stands, and that counts once. */
static void a_contact_stops_the_robot_and_is_counted(void **state)
{
    static struct fv_sim_drive_tick ticks[1000];
    struct fv_sim_drive d = {.half = {5, 4},
                             .goal = {-4, 0},
                             .tick_s = 0.02,
                             .tick = ticks,
                             .tick_count = 1,
                             .tick_room = 1000,
                             .reached = -1};
    (void)state;
    d.block[d.block_count++] =
        (struct fv_sim_block){.center = {2, 0}, .half = {0.5, 0.5}, .cosine = 1};
    memset(ticks, 0, sizeof ticks);
    for (int i = 0; i < 400; i++)
        fv_sim_drive_step(&d, 0.5, 0);
    assert_true(d.contacts == 1 && d.reached < 0);
    assert_true(fabs(ticks[d.tick_count - 1].position[0] - 1.3) < 0.02);
    while (d.tick_count < d.tick_room)
        fv_sim_drive_step(&d, -0.3, 0);
    assert_true(d.contacts == 1 && ticks[d.tick_count - 1].position[0] < 0);
}

/* ---- the camera and the truth ---------------------------------------------------------------- */

static void the_rig_is_that_of_the_robot(void **state)
{
    struct fovea_frame frame;
    double T[12], T_body[12], along[3];
    (void)state;
    struct fovea_source *source =
        sim_source_open_at("drive?seed=5&baseline=0.12&imu=200&width=96&height=64", 300);
    const struct fovea_rig *rig = &ops->info(source)->rig;
    assert_true(rig->camera_count == 2 && rig->has_imu && rig->cameras[0].has_T_body_cam);
    assert_true(rig->cameras[0].T_body_cam[11] == FV_SIM_DRIVE_CAMERA_M);
    for (int k = 0; k < 3; k++) /* the second is to the right of the first, along its x axis */
        along[k] = rig->cameras[1].T_body_cam[4 * k + 3] - rig->cameras[0].T_body_cam[4 * k + 3];
    assert_true(fabs(along[0]) < 1e-12 && fabs(along[1] + 0.12) < 1e-12 && fabs(along[2]) < 1e-12);
    assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_OK);
    assert_int_equal(ops->truth_pose(source, &frame, T), FOVEA_OK);
    fv_sim_motion_body(&source->motion, fv_sim_frame_time(source, 300), T_body);
    assert_true(T_body[10] == 1 && T_body[11] == 0);
    fv_sim_compose(T_body, rig->cameras[0].T_body_cam, T_body);
    for (int k = 0; k < 12; k++)
        assert_true(fabs(T[k] - T_body[k]) < 1e-12);
    assert_true(T[10] < -0.3 && T[10] > -0.4); /* looks down by 20 degrees */
    sim_source_close(source);
}

static void expect_cell(const struct sim_cells *grid, const uint8_t *cells, const double p[3],
                        bool moves, int counts[3])
{
    const int32_t x = (int32_t)((p[0] - grid->origin_m[0]) / grid->cell_m),
                  y = (int32_t)((p[1] - grid->origin_m[1]) / grid->cell_m);
    const double edge = 0.01 / grid->cell_m, fx = (p[0] - grid->origin_m[0]) / grid->cell_m - x,
                 fy = (p[1] - grid->origin_m[1]) / grid->cell_m - y;
    const uint8_t cell = cells[y * grid->width + x];
    if (fx < edge || fx > 1 - edge || fy < edge || fy > 1 - edge || moves) return;
    if (p[2] > SIM_CELL_LOW_M + 0.01 && p[2] < SIM_CELL_HIGH_M - 0.01) {
        assert_int_equal(cell, SIM_CELL_OCCUPIED);
        counts[0]++;
    } else if (fabs(p[2]) < 1e-3) {
        if (cell == SIM_CELL_NONE) counts[2]++; /* at the edge of the pit */
        counts[1]++;
    } else if (p[2] < -0.05) {
        assert_int_equal(cell, SIM_CELL_NONE);
    }
}

/* Every pixel's point is in a cell of its kind. */
static void cells_hold_what_the_pictures_show(void **state)
{
    static struct fovea_truth truth;
    static uint8_t cells[128 * 128];
    int counts[3] = {0, 0, 0};
    (void)state;
    for (int n = 0; n < 8; n++) {
        struct fovea_frame frame;
        struct fovea_source *source =
            sim_source_open_at("drive?seed=3&width=160&height=120", 90 * (uint64_t)n);
        const struct fovea_camera *camera = &source->info.rig.cameras[0].camera;
        const struct sim_cells grid = {{-6.4, -6.4}, 0.1, 128, 128};
        assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_OK);
        assert_int_equal(ops->truth(source, &frame, &truth), FOVEA_OK);
        sim_cells_find(&source->world, &grid, false, cells);
        for (int32_t i = 0; i < 160 * 120; i++) {
            const double depth = (double)truth.depth_m[i], *T = truth.T_world_cam;
            double b[3], p[3];
            if (truth.class_mask[i] == FOVEA_TRUTH_BACKGROUND) continue;
            assert_int_equal(fovea_camera_unproject(
                                 camera, (const double[2]){i % 160, (int32_t)(i / 160)}, b, NULL),
                             FOVEA_OK);
            for (int k = 0; k < 3; k++)
                p[k] = T[4 * k + 3] +
                       depth / b[2] * (T[4 * k] * b[0] + T[4 * k + 1] * b[1] + T[4 * k + 2] * b[2]);
            expect_cell(&grid, cells, p, truth.class_mask[i] < FOVEA_TRUTH_OBJECT_COUNT, counts);
        }
        sim_source_close(source);
    }
    print_message("%d points on surfaces, %d on the floor, %d of these beside a pit\n", counts[0],
                  counts[1], counts[2]);
    assert_true(counts[0] > 5000 && counts[1] > 10000 && counts[2] * 50 < counts[1]);
}

static void what_does_not_fit_is_refused(void **state)
{
    struct fovea_source *source = NULL;
    struct fovea_error error;
    (void)state;
    assert_int_equal(ops->open("drive?objects=9", NULL, &source, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "objects: found 9, expected at most 8"));
    assert_int_equal(ops->open("drive?stands=1&commands=1", NULL, &source, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "stands: found 1 with commands, expected drive without"));
    assert_int_equal(ops->open("orbit?stands=1", NULL, &source, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "stands: found 1 with orbit, expected drive without"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_path_leads_to_the_goal_and_touches_nothing),
        cmocka_unit_test(every_hall_leaves_a_way_wider_than_the_robot),
        cmocka_unit_test(it_stands_beside_the_pit_where_that_is_asked_for),
        cmocka_unit_test(what_moves_is_slow_and_stays_off_what_stands),
        cmocka_unit_test(what_moves_gives_way),
        cmocka_unit_test(a_contact_stops_the_robot_and_is_counted),
        cmocka_unit_test(the_rig_is_that_of_the_robot),
        cmocka_unit_test(cells_hold_what_the_pictures_show),
        cmocka_unit_test(what_does_not_fit_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
