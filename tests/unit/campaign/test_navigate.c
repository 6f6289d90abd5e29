/* The planner of tools/examples/navigate on drawn grids: it leads round what is occupied, through
 * what is not known only when it must and then slowly, and never into what is occupied. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <string.h>

#include <cmocka.h>

#include "../../../tools/examples/navigate/map.h"
#include "../../../tools/examples/navigate/pieces.h"
#include "../../../tools/examples/navigate/plan.h"
#include "base/elementary.h"

enum { SIDE = 100, FREE = 10, SUSPECTED = 80, OCCUPIED = 97, UNKNOWN = -1 };
static const double origin[2] = {-5, -5};
static struct navigate planner;
static int8_t cells[SIDE * SIDE];

static void fill(double x0, double x1, double y0, double y1, int8_t value)
{
    for (int i = 0; i < SIDE * SIDE; i++) {
        const double x = origin[0] + (i % SIDE + 0.5) * 0.1, y = origin[1] + (i / SIDE + 0.5) * 0.1;
        if (x > x0 && x < x1 && y > y0 && y < y1) cells[i] = value;
    }
}

static void begin(double goal_x, double goal_y, int8_t value)
{
    const struct navigate_robot robot = {0.2, 0.5, 1.2};
    const double goal[2] = {goal_x, goal_y};
    memset(cells, value, sizeof cells);
    navigate_init(&planner, &robot, goal);
}

static void plan(void)
{
    assert_true(navigate_plan(&planner, cells, SIDE, SIDE, 0.1, origin));
}

/* On the x axis, a twentieth of a second later. */
static struct navigate_motion steer_at(double x, double yaw)
{
    return navigate_steer(&planner, (const double[2]){x, 0}, yaw, planner.now_s + 0.05);
}

static double took_s;                    /* to arrive */
static double farthest_back;             /* in one go */
static double cleared_from_x = INFINITY; /* from there on nothing is suspected any more */

static void clear_suspected(void)
{
    for (int i = 0; i < SIDE * SIDE; i++)
        if (cells[i] == SUSPECTED) cells[i] = FREE;
    cleared_from_x = INFINITY;
    plan();
}

/* Drives on until it arrives; `*farthest`: the largest |y|. Keeps off what is occupied all the way,
 * and backs only from where it was too narrow. */
static bool arrives(double *farthest)
{
    double at[2] = {0, 0}, yaw = 0, back = 0;
    *farthest = farthest_back = 0;
    for (int step = 0; step < 2000; step++) {
        const struct navigate_motion motion = navigate_steer(&planner, at, yaw, step * 0.05);
        took_s = step * 0.05;
        if (motion.arrived) return true;
        if (at[0] > cleared_from_x) clear_suspected();
        assert_true(motion.speed_m_s >= (planner.narrow_until_s > 0 ? -0.2 : 0));
        assert_true(motion.speed_m_s <= 0.5);
        back = motion.speed_m_s < 0 ? back - motion.speed_m_s * 0.05 : 0;
        farthest_back = fmax(farthest_back, back);
        assert_true(fabs(motion.turning_rad_s) <= 1.2);
        yaw += motion.turning_rad_s * 0.05;
        at[0] += motion.speed_m_s * 0.05 * cos(yaw);
        at[1] += motion.speed_m_s * 0.05 * sin(yaw);
        *farthest = fmax(*farthest, fabs(at[1]));
        for (int i = 0; i < SIDE * SIDE; i++) {
            const double x = fabs(origin[0] + (i % SIDE + 0.5) * 0.1 - at[0]),
                         y = fabs(origin[1] + (i / SIDE + 0.5) * 0.1 - at[1]);
            if (cells[i] >= SUSPECTED)
                assert_true(hypot(fmax(x - 0.05, 0), fmax(y - 0.05, 0)) > 0.2);
        }
    }
    return false;
}

static void it_goes_straight_where_all_is_free(void **state)
{
    double farthest;
    (void)state;
    begin(3, 0, FREE);
    plan();
    assert_true(arrives(&farthest) && farthest < 0.15);
}

/* In no direction of cells: it neither goes along them nor turns on its way. */
static void it_goes_straight_at_any_angle(void **state)
{
    const double goals[][2] = {{3, 0.5}, {3, 1.3}, {3, -2}, {2.5, 2.3}};
    double farthest;
    (void)state;
    for (int i = 0; i < 4; i++) {
        begin(goals[i][0], goals[i][1], FREE);
        plan();
        assert_true(arrives(&farthest) && farthest < fabs(goals[i][1]) + 0.05);
        print_message("%.2f s for %.2f m\n", took_s, hypot(goals[i][0], goals[i][1]) - 0.2);
        assert_true(took_s < hypot(goals[i][0], goals[i][1]) / 0.5 + 1.2);
    }
}

static void it_goes_round_a_wall(void **state)
{
    double farthest;
    (void)state;
    begin(3, 0, FREE);
    fill(1.4, 1.6, -5, 1.5, OCCUPIED);
    plan();
    assert_true(arrives(&farthest) && farthest > 1.7 && farthest < 2.6);
    fill(1.4, 1.6, -5, 5, OCCUPIED); /* no way at all: it stands */
    plan();
    assert_true(steer_at(0, 0).speed_m_s == 0);
}

static void a_gap_wider_than_the_robot_is_passed(void **state)
{
    double farthest;
    (void)state;
    begin(3, 0, FREE);
    fill(1.4, 1.6, -5, 5, OCCUPIED);
    fill(1.4, 1.6, 0.6, 1.4, FREE);
    plan();
    assert_true(arrives(&farthest) && farthest > 0.8 && farthest < 1.2);
}

/* The edge of what is occupied may lie a cell nearer than the grid has it, and the robot anywhere
 * in its own cell: three cells from the next that is occupied it may touch. */
static void three_cells_from_a_wall_are_a_squeeze(void **state)
{
    double price[2];
    (void)state;
    begin(3, 0, FREE);
    fill(1.4, 1.6, -5, 5, OCCUPIED);
    plan();
    for (int i = 0; i < 2; i++)
        price[i] = navigate_price(&planner, navigate_cell(&planner, 1.15 - 0.1 * i, 0));
    assert_true(price[0] > 5 * price[1] && price[1] > 1 && price[1] < 10);
}

static void a_gap_narrower_than_the_robot_is_not(void **state)
{
    double farthest;
    (void)state;
    begin(3, 0, FREE);
    fill(1.4, 1.6, -5, 3.5, OCCUPIED);
    fill(1.4, 1.6, -0.15, 0.15, FREE);
    plan();
    assert_true(arrives(&farthest) && farthest > 3.7);
}

/* A wall all along, with a passage of 1.2 m, of which something leaves it two cells less than it
 * needs; round that it is 20 m. */
static void begin_narrow(int8_t seen)
{
    begin(3, 0, FREE);
    fill(1.4, 1.5, -5, 4.2, OCCUPIED);
    fill(-4, 1.5, 4.1, 4.2, OCCUPIED);
    fill(1.4, 1.5, -0.6, 0.6, FREE);
    fill(1.4, 1.5, -0.2, 0.6, seen);
    plan();
}

/* Where it is sure it goes round; where it is not, it goes to see from near, here that nothing was
 * there. */
static void what_is_suspected_is_looked_at_from_near(void **state)
{
    double farthest;
    (void)state;
    begin_narrow(OCCUPIED);
    assert_true(arrives(&farthest) && farthest > 4.2 && planner.touches == 0);
    begin_narrow(SUSPECTED);
    cleared_from_x = 0.6;
    assert_true(arrives(&farthest) && farthest < 0.6 && planner.touches == 0);
}

static enum navigate_kind kind_with(int8_t value, double time_s)
{
    fill(1.4, 1.5, 0, 0.1, value);
    planner.now_s = time_s;
    plan();
    return (enum navigate_kind)planner.kind[navigate_cell(&planner, 1.45, 0.05)];
}

/* What more speaks for an obstacle than for floor is suspected for 3 s where floor was free: there
 * something comes. Elsewhere, and later, it is as little known as before. */
static void what_comes_to_free_floor_is_suspected(void **state)
{
    static const struct {
        int8_t value;
        enum navigate_kind before, after;
    } cases[] = {
        {34, NAVIGATE_FREE, NAVIGATE_FREE},           {50, NAVIGATE_UNKNOWN, NAVIGATE_UNKNOWN},
        {51, NAVIGATE_UNKNOWN, NAVIGATE_SUSPECTED},   {65, NAVIGATE_UNKNOWN, NAVIGATE_SUSPECTED},
        {66, NAVIGATE_SUSPECTED, NAVIGATE_SUSPECTED}, {89, NAVIGATE_OCCUPIED, NAVIGATE_OCCUPIED}};
    (void)state;
    for (int i = 0; i < 6; i++) {
        begin(3, 0, UNKNOWN);
        assert_int_equal(kind_with(cases[i].value, 5), cases[i].before);
        begin(3, 0, UNKNOWN);
        assert_int_equal(kind_with(FREE, 5), NAVIGATE_FREE);
        assert_int_equal(kind_with(cases[i].value, 7.9), cases[i].after);
        if (cases[i].value != 34) assert_int_equal(kind_with(cases[i].value, 8.1), cases[i].before);
    }
}

/* The time goes with the cell while the grid's window moves, and not back into it. */
static void a_cell_keeps_when_it_was_free(void **state)
{
    const double moved[2] = {origin[0] + 0.5, origin[1]}, far[2] = {origin[0] + 9, origin[1]};
    (void)state;
    begin(3, 0, UNKNOWN);
    assert_int_equal(kind_with(FREE, 5), NAVIGATE_FREE);
    memset(cells, 60, sizeof cells);
    assert_true(navigate_plan(&planner, cells, SIDE, SIDE, 0.1, moved));
    assert_int_equal(planner.kind[navigate_cell(&planner, 1.45, 0.05)], NAVIGATE_SUSPECTED);
    assert_int_equal(planner.kind[navigate_cell(&planner, 1.95, 0.05)], NAVIGATE_UNKNOWN);
    assert_true(navigate_plan(&planner, cells, SIDE, SIDE, 0.1, far));
    assert_int_equal(navigate_cell(&planner, 1.45, 0.05), -1);
    plan();
    assert_int_equal(planner.kind[navigate_cell(&planner, 1.45, 0.05)], NAVIGATE_UNKNOWN);
    begin(3, 0, UNKNOWN);
    assert_int_equal(kind_with(FREE, 5), NAVIGATE_FREE);
    navigate_forget(&planner); /* its frame is another */
    assert_int_equal(kind_with(60, 6), NAVIGATE_UNKNOWN);
}

/* The gap between two suspected cells is too narrow, and a way round is 5 m longer: the robot takes
 * that, for to look from near has its price, too. */
static void a_free_way_is_preferred_to_a_suspected_one(void **state)
{
    double farthest;
    (void)state;
    begin(3, 0, FREE);
    fill(1.4, 1.5, -5, 2.9, OCCUPIED);
    fill(1.4, 1.5, 4.4, 5, OCCUPIED);
    fill(1.4, 1.5, -0.8, 0.9, SUSPECTED);
    fill(1.4, 1.5, -0.1, 0.2, FREE);
    plan();
    assert_true(arrives(&farthest) && farthest > 2.9 && planner.narrow_until_s == 0);
}

/* At each distance from what is not known it can still stop before that: 0.1 m before, by 0.6 m/s^2
 * and 0.4 s after it has seen it. */
static void it_can_stop_within_what_is_free(void **state)
{
    double fastest = 0;
    (void)state;
    begin(3, 0, FREE);
    fill(1, 4, -5, 5, UNKNOWN);
    plan();
    for (double x = 0; x < 0.9; x += 0.05) {
        planner.asked = (struct navigate_motion){0};
        const double v = steer_at(x, 0).speed_m_s;
        assert_true(0.4 * v + v * v / 1.2 <= fmax(1 - x - 0.1, 0) + 0.051);
        fastest = fmax(fastest, v);
    }
    assert_true(fastest > 0.44); /* it turns a little to the middle of a cell */
}

/* The same, but it stays too narrow, however long the robot looks: it stands before it, looks from
 * farther off, gives that way up the second time for a while, and takes the other one. */
static void what_stays_too_narrow_is_given_up(void **state)
{
    double farthest;
    (void)state;
    begin_narrow(SUSPECTED);
    assert_true(arrives(&farthest) && farthest > 4.2);
    print_message("at the goal after %.1f s\n", took_s);
    assert_true(planner.touches == 1 && planner.given_up == 1);
    assert_true(farthest_back > 0.4); /* the first time it looks at it from there */
}

/* What appears beside the robot, nearer than it would go there, holds it where that is sure; where
 * it is not the robot goes on, but no nearer to it. */
static void what_is_suspected_beside_it_holds_it_not(void **state)
{
    const int8_t seen[] = {OCCUPIED, SUSPECTED};
    (void)state;
    for (int i = 0; i < 2; i++)
        for (int nearer = 0; nearer < 2; nearer++) {
            begin(3, 0, FREE);
            fill(-1, 1, 0.2, 0.3, seen[i]);
            fill(-1, 1, -0.4, -0.2, seen[i]);
            if (nearer) fill(0.2, 1, 0.1, 0.2, seen[i]);
            plan();
            assert_true((steer_at(0, 0).speed_m_s > 0.05) == (seen[i] == SUSPECTED && !nearer));
        }
}

/* What is not known costs three times as much as what is free. */
static void a_free_way_is_preferred_to_an_unknown_one(void **state)
{
    double farthest;
    (void)state;
    begin(4, 0, FREE);
    fill(1, 3, -1.0, 1.0, UNKNOWN);
    plan();
    assert_true(arrives(&farthest) && farthest > 0.9);
}

/* It does not drive into what is not known, but looks at it, and then goes on slowly. */
static void what_is_not_known_is_entered_slowly(void **state)
{
    double fastest = 0;
    (void)state;
    begin(4, 0, UNKNOWN);
    fill(-1, 0.5, -1, 1, FREE);
    plan();
    for (int step = 0; step < 15; step++)
        fastest = fmax(fastest, steer_at(0.42, 0).speed_m_s);
    assert_true(fastest == 0);
    for (int step = 0; step < 15; step++)
        fastest = fmax(fastest, steer_at(0.42, 0).speed_m_s);
    assert_true(fastest > 0.05 && fastest < 0.2);
}

/* Something stands at x = 1 that the grid calls free floor, 0.6 m wide. The robot comes to stand at
 * it once, backs off and goes round it, as one that turns on at a wall never would. */
static void what_holds_the_robot_is_kept_in_mind_and_passed(void **state)
{
    double at[2] = {0, 0}, yaw = 0, back = 0, time_s = 0;
    bool arrived = false;
    (void)state;
    begin(3, 0, FREE);
    for (int step = 0; step < 800 && !arrived; step++, time_s += 0.05) {
        if (step % 6 == 0) plan(); /* the grid goes on to call it free */
        const struct navigate_motion motion = navigate_steer(&planner, at, yaw, time_s);
        arrived = motion.arrived;
        yaw += motion.turning_rad_s * 0.05;
        const double x = at[0] + motion.speed_m_s * 0.05 * cos(yaw),
                     y = at[1] + motion.speed_m_s * 0.05 * sin(yaw);
        const double in_x = fmax(fmax(1 - x, x - 1.3), 0), in_y = fmax(fabs(y + 0.1) - 0.3, 0);
        back = fmin(back, motion.speed_m_s);
        if (hypot(in_x, in_y) < 0.2) continue; /* it stands */
        at[0] = x;
        at[1] = y;
    }
    print_message("at the goal after %.1f s, %d touches\n", time_s, (int)planner.touches);
    assert_true(arrived && back < 0);
    assert_in_range(planner.touches, 1, 3);
    assert_true(time_s < 25);
}

/* What was touched is gone after a while: the straight way is taken again, and a new frame has none
 * of it from the first. */
static void what_held_the_robot_is_forgotten(void **state)
{
    double farthest;
    (void)state;
    for (int anew = 0; anew < 2; anew++) {
        begin(3, 0, FREE);
        plan();
        for (int step = 0; step < 30; step++)
            (void)steer_at(0, 0);
        assert_int_equal(planner.touches, 1);
        plan();
        assert_true(planner.kind[50 * SIDE + 52] == NAVIGATE_OCCUPIED); /* ahead of its edge */
        if (anew)
            navigate_forget(&planner);
        else
            planner.now_s += 31;
        plan();
        assert_true(planner.kind[50 * SIDE + 52] == NAVIGATE_FREE);
        planner.due_m = 0;
        assert_true(arrives(&farthest) && farthest < 0.15);
    }
}

/* A turn on the spot and a wait are no touches; nor is a robot that is slower than it was asked. */
static void standing_as_asked_is_no_touch(void **state)
{
    (void)state;
    begin(-3, 0, FREE);
    plan();
    for (int step = 0; step < 200; step++)
        assert_true(steer_at(0, 0).speed_m_s == 0);
    begin(3, 0, FREE);
    plan();
    for (int step = 0; step < 100; step++)
        (void)steer_at(step * 0.05 * 0.1, 0);
    assert_int_equal(planner.touches, 0);
}

static void a_goal_beyond_the_grid_is_driven_towards(void **state)
{
    (void)state;
    begin(9, 0, FREE);
    plan();
    const struct navigate_motion ahead = steer_at(0, 0);
    const struct navigate_motion back = steer_at(0, 3);
    assert_true(ahead.speed_m_s > 0.3 && back.speed_m_s == 0 && fabs(back.turning_rad_s) == 1.2);
    assert_false(navigate_plan(&planner, cells, 300, 300, 0.1, origin));
}

/* A world of 30 m, of which the grid shows 10 m around the robot, what is nearer than 3 m or was,
 * with the errors of a frame. */
static int8_t world[3 * SIDE][3 * SIDE];
static bool shown[3 * SIDE][3 * SIDE];
static struct fv_random draws;

static void draw_world(void)
{
    memset(world, FREE, sizeof world);
    memset(shown, 0, sizeof shown);
    for (int block = 0; block < 500; block++) {
        const uint32_t x = fv_random_below(&draws, 3 * SIDE - 8),
                       y = fv_random_below(&draws, 3 * SIDE - 8);
        const uint32_t length = 1 + fv_random_below(&draws, 8);
        for (uint32_t i = 0; i < 8; i++)
            memset(&world[y + i][x], OCCUPIED, length);
    }
    for (int i = 0; i < 20 * 20; i++)
        world[3 * SIDE / 2 - 10 + i / 20][3 * SIDE / 2 - 10 + i % 20] = FREE;
}

/* The grid around a place, from the cell `corner` of the world. */
static void show(const double at[2], const int corner[2])
{
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int x = corner[0] + i % SIDE, y = corner[1] + i / SIDE;
        const double dx = x * 0.1 - 15 - at[0], dy = y * 0.1 - 15 - at[1];
        shown[y][x] = shown[y][x] || hypot(dx, dy) < 3;
        cells[i] = !shown[y][x] || fv_random_below(&draws, 5000) == 0 ? UNKNOWN : world[y][x];
    }
}

/* A planner that goes on with its search, and one that has the same in mind but begins anew with
 * each grid, ask for the same by the same costs. `looks`: cells that each looked at. */
static void drive_two(const double goal[2], int64_t looks[2])
{
    static struct navigate other;
    const struct navigate_robot robot = {0.2, 0.5, 1.2};
    double at[2] = {0, 0}, yaw = 0;
    navigate_init(&planner, &robot, goal);
    for (int step = 0; step < 150; step++) {
        const int corner[2] = {(int)floor(at[0] * 10) + 100, (int)floor(at[1] * 10) + 100};
        const double from[2] = {corner[0] * 0.1 - 15, corner[1] * 0.1 - 15};
        show(at, corner);
        if (step % 50 == 49) navigate_forget(&planner);
        const int64_t before = planner.ways.looks;
        other = planner;
        other.begun = false;
        assert_true(navigate_plan(&planner, cells, SIDE, SIDE, 0.1, from));
        assert_true(navigate_plan(&other, cells, SIDE, SIDE, 0.1, from));
        const struct navigate_motion motion = navigate_steer(&planner, at, yaw, step * 0.1),
                                     same = navigate_steer(&other, at, yaw, step * 0.1);
        assert_true(motion.speed_m_s == same.speed_m_s);
        assert_true(motion.turning_rad_s == same.turning_rad_s && motion.arrived == same.arrived);
        if (motion.speed_m_s >= 0 && !motion.arrived) /* it does not search to back off */
            assert_int_equal(planner.ways.g[planner.ways.from], other.ways.g[other.ways.from]);
        looks[0] += planner.ways.looks - before;
        looks[1] += other.ways.looks - before;
        yaw += motion.turning_rad_s * 0.1;
        if (step % 50 > 25) continue; /* something holds it */
        at[0] += 2 * motion.speed_m_s * 0.1 * cos(yaw);
        at[1] += 2 * motion.speed_m_s * 0.1 * sin(yaw);
    }
    assert_true(hypot(at[0], at[1]) > 1);
}

static void a_search_that_goes_on_finds_what_one_anew_does(void **state)
{
    const double goals[][2] = {{4, 2}, {-5.6, -1}, {3, 5.5}, {12, -9}};
    int64_t looks[2] = {0, 0};
    (void)state;
    fv_random_seed(&draws, 1);
    for (int i = 0; i < 4; i++) {
        draw_world();
        drive_two(goals[i], looks);
    }
    print_message("cells looked at: %lld, anew %lld\n", (long long)looks[0], (long long)looks[1]);
    assert_true(3 * looks[0] < 2 * looks[1]); /* though half of what it sees is new */
}

/* Rows `first` to `first + count - 1` of a grid of 100 by 100, with the stamp given. */
static fovea_grid_t piece(int64_t sequence, int32_t first, int32_t count)
{
    return (fovea_grid_t){.stamp = {.sequence = sequence},
                          .map_id = 3,
                          .reset_counter = 2,
                          .resolution_m = 0.1,
                          .width = SIDE,
                          .height = SIDE,
                          .first_row = first,
                          .row_count = count,
                          .cell_count = SIDE * count,
                          .cells = cells + (ptrdiff_t)first * SIDE};
}

static struct navigate_grid grid;

static bool take(fovea_grid_t message)
{
    return navigate_take(&grid, &message);
}

static void a_grid_is_whole_when_all_its_rows_came(void **state)
{
    (void)state;
    for (int i = 0; i < SIDE * SIDE; i++)
        cells[i] = (int8_t)(i % 100);
    assert_false(take(piece(7, 0, 40)));
    assert_true(take(piece(7, 40, 60)));
    assert_int_equal(grid.width, SIDE);
    assert_true(navigate_is_for(&grid.frame, &(fovea_pose_t){.map_id = 3, .reset_counter = 2}));
    assert_false(navigate_is_for(&grid.frame, &(fovea_pose_t){.map_id = 2, .reset_counter = 2}));
    assert_false(navigate_is_for(&grid.frame, &(fovea_pose_t){.map_id = 3, .reset_counter = 3}));
    assert_memory_equal(grid.cells, cells, sizeof cells);
    /* One whose first piece is lost is left out, as is one of two stamps; the next is taken. */
    assert_false(take(piece(8, 40, 60)));
    assert_false(take(piece(9, 0, 40)));
    assert_false(take(piece(10, 40, 60)));
    assert_false(take(piece(9, 40, 60)));
    assert_true(take(piece(11, 0, 100)));
}

static void grids_that_cannot_be_are_left_out(void **state)
{
    const double numbers[] = {NAN, -0.1, 0, INFINITY, 1e-9};
    (void)state;
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        fovea_grid_t odd = piece(1, 0, 100);
        odd.resolution_m = numbers[i];
        assert_false(take(odd));
    }
    fovea_grid_t odd = piece(1, 0, 100);
    odd.origin_position[1] = NAN;
    assert_false(take(odd));
    odd = piece(1, 0, 100);
    odd.cell_count = 99;
    assert_false(take(odd));
    odd = piece(1, 0, 100);
    odd.height = INT32_MAX;
    assert_false(take(odd));
    odd = piece(1, 0, 100);
    odd.row_count = 101;
    odd.cell_count = 10100;
    assert_false(take(odd));
}

/* Nobody knows what became of a command while poses were away for seconds. */
static void a_gap_of_poses_is_no_touch(void **state)
{
    (void)state;
    begin(3, 0, FREE);
    plan();
    (void)steer_at(0, 0);
    assert_true(steer_at(0, 0).speed_m_s > 0);
    (void)navigate_steer(&planner, (const double[2]){0, 0}, 0, planner.now_s + 5);
    (void)steer_at(0, 0);
    assert_int_equal(planner.touches, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_goes_straight_where_all_is_free),
        cmocka_unit_test(it_goes_straight_at_any_angle),
        cmocka_unit_test(it_goes_round_a_wall),
        cmocka_unit_test(a_gap_wider_than_the_robot_is_passed),
        cmocka_unit_test(three_cells_from_a_wall_are_a_squeeze),
        cmocka_unit_test(a_gap_narrower_than_the_robot_is_not),
        cmocka_unit_test(what_is_suspected_is_looked_at_from_near),
        cmocka_unit_test(what_comes_to_free_floor_is_suspected),
        cmocka_unit_test(a_cell_keeps_when_it_was_free),
        cmocka_unit_test(a_free_way_is_preferred_to_a_suspected_one),
        cmocka_unit_test(it_can_stop_within_what_is_free),
        cmocka_unit_test(what_stays_too_narrow_is_given_up),
        cmocka_unit_test(what_is_suspected_beside_it_holds_it_not),
        cmocka_unit_test(a_free_way_is_preferred_to_an_unknown_one),
        cmocka_unit_test(what_is_not_known_is_entered_slowly),
        cmocka_unit_test(what_holds_the_robot_is_kept_in_mind_and_passed),
        cmocka_unit_test(what_held_the_robot_is_forgotten),
        cmocka_unit_test(standing_as_asked_is_no_touch),
        cmocka_unit_test(a_goal_beyond_the_grid_is_driven_towards),
        cmocka_unit_test(a_search_that_goes_on_finds_what_one_anew_does),
        cmocka_unit_test(a_grid_is_whole_when_all_its_rows_came),
        cmocka_unit_test(grids_that_cannot_be_are_left_out),
        cmocka_unit_test(a_gap_of_poses_is_no_touch),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
