/* What an earlier run knew of the floor, taken back: where it belongs in whatever position,
 * direction and resolution, where nothing is known yet and once; it gives way to what is seen, and
 * is forgotten as the rest. And what of a grid is saved: what is known and stays where it is. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "common/grid_mask.h"
#include "grid/recall.h"

enum { W = 80, H = 60, MOST = 512 };
static const int64_t SECOND = 1000000000;

static uint8_t mask[W * H];
static struct fovea_grid_config config;
static struct fv_grid grid;
static struct fv_grid_recall recall;
static int8_t kept[MOST * MOST], cells[MOST * MOST];
static struct fv_random dice;
static void *memory;

static void carve(struct fv_arena *arena)
{
    fv_grid_carve(&grid, &config, arena);
    fv_grid_recall_carve(&recall, &config, arena);
}

static void make(void)
{
    struct fv_arena arena;
    assert_int_equal(fv_grid_check(&config, NULL), FOVEA_OK);
    fv_arena_count(&arena);
    carve(&arena);
    free(memory);
    memory = aligned_alloc(64, (arena.used + 63) / 64 * 64);
    fv_arena_init(&arena, memory, arena.used);
    carve(&arena);
}

static int setup(void **state)
{
    (void)state;
    grid_mask_make(mask, W, H, 1, 40);
    fovea_grid_config_default(&config);
    config.side_cells = 32;
    config.range_m = 1.6;
    config.robot_radius_m = 0;
    fv_random_seed(&dice, 3);
    make();
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    free(memory);
    memory = NULL;
    return 0;
}

/* The camera is 1 m above the floor at (x, y) and looks straight down: all of the mask is one
 * class. Returns the pieces of the recall that followed; -1: there was nothing to do. */
static int update(int64_t stamp_ns, double x, double y, int class_id, const double kept_odom[12])
{
    const double T[12] = {0, -1, 0, x, -1, 0, 0, y, 0, 0, -1, 1};
    struct fovea_grid_view view = {.stamp_ns = stamp_ns,
                                   .seen = &seen,
                                   .labels = labels,
                                   .camera = &camera,
                                   .position_m = {x, y}};
    memcpy(view.T_odom_cam, T, sizeof T);
    memset(mask, class_id, sizeof mask);
    assert_true(fv_grid_begin(&grid, &view));
    while (!fv_grid_advance(&grid, &view))
        ;
    if (!fv_grid_recall_begin(&recall, &grid, kept_odom, 0)) return -1;
    int pieces = 1;
    while (!fv_grid_recall_advance(&recall, &grid))
        pieces++;
    return pieces;
}

/* Rows that take the odometry frame to kept cells whose corner is at (x, y), turned by `turn` and
 * `scale` times as long. */
static const double *lies(double x, double y, double turn, double scale)
{
    static double P[12];
    const double c = scale * cos(turn), s = scale * sin(turn);
    const double rows[12] = {c, s, 0, -c * x - s * y, -s, c, 0, s * x - c * y, 0, 0, scale, 0};
    memcpy(P, rows, sizeof P);
    return P;
}

static void fill(uint32_t side)
{
    for (uint32_t i = 0; i < side * side; i++) {
        const int pick = (int)fv_random_below(&dice, 3);
        kept[i] = (int8_t)(pick == 0   ? FOVEA_GRID_UNKNOWN
                           : pick == 1 ? (int)fv_random_below(&dice, 35)
                                       : 66 + (int)fv_random_below(&dice, 35));
    }
}

static int kind(int percent)
{
    return percent < 0 ? 0 : percent < 35 ? 1 : percent > 65 ? 2 : 3;
}

static const int8_t *all_cells(void)
{
    fv_grid_rows(&grid, 0, config.side_cells, cells);
    return cells;
}

/* ---- tests ----------------------------------------------------------------------------------- */

/* Each cell is what is kept at its middle, and never surer than two views or one. */
static void it_lies_where_it_was(void **state)
{
    (void)state;
    const struct {
        uint32_t side;
        double resolution_m, x, y, turn, scale;
    } cases[] = {{32, 0.1, -1.6, -1.6, 0, 1},       {32, 0.1, 0.3, -1, 0, 1},
                 {32, 0.1, -0.3, -1.8, 0.6435, 1},  {20, 0.1, 1.1, -0.4, 2.5, 1},
                 {32, 0.1, -1.2, -1.7, -1.1, 1.02}, {25, 0.16, -1.9, -2.1, 0.3, 1}};
    for (size_t n = 0; n < sizeof cases / sizeof cases[0]; n++) {
        const double cell = cases[n].resolution_m;
        const uint32_t side = cases[n].side;
        int known = 0;
        make();
        fill(side);
        fv_grid_recall_keep(&recall, side, cell, kept);
        const double *P = lies(cases[n].x, cases[n].y, cases[n].turn, cases[n].scale);
        assert_int_equal(update(SECOND, 0.02, 0.05, SKY, P), 1);
        all_cells();
        for (int y = 0; y < 32; y++)
            for (int x = 0; x < 32; x++) {
                const double at[2] = {0.1 * (x - 16) + 0.05, 0.1 * (y - 16) + 0.05};
                const double u = (P[0] * at[0] + P[1] * at[1] + P[3]) / cell,
                             v = (P[4] * at[0] + P[5] * at[1] + P[7]) / cell;
                const bool in = u >= 0 && v >= 0 && u < side && v < side;
                const int was = in ? kept[(int)v * (int)side + (int)u] : FOVEA_GRID_UNKNOWN;
                if (fabs(u - round(u)) < 1e-6 || fabs(v - round(v)) < 1e-6) continue;
                if (kind(cells[32 * y + x]) != kind(was))
                    fail_msg("case %zu, cell %d %d: %d, kept %d", n, x, y, cells[32 * y + x], was);
                assert_true(cells[32 * y + x] < 0 ||
                            (cells[32 * y + x] >= 31 && cells[32 * y + x] <= 70));
                known += was >= 0;
            }
        if (known < 100) fail_msg("case %zu: only %d are known", n, known);
    }
}

/* Along the camera's middle, what is seen decides: two obstacles or four floors. */
static void it_gives_way_to_what_is_seen(void **state)
{
    (void)state;
    const int middle = 32 * 16 + 16;
    for (int occupied = 0; occupied < 2; occupied++) {
        const int class_id = occupied ? FLOOR : WALL, needed = occupied ? 4 : 2;
        make();
        memset(kept, occupied ? 100 : 0, sizeof kept);
        fv_grid_recall_keep(&recall, 32, 0.1, kept);
        const double *P = lies(-1.6, -1.6, 0, 1);
        update(SECOND, 0.06, 0.05, SKY, P);
        assert_int_equal(kind(all_cells()[middle]), occupied ? 2 : 1);
        for (int views = 1; views <= needed; views++) {
            assert_int_equal(update(SECOND + views, 0.06, 0.05, class_id, P), -1);
            assert_int_equal(kind(all_cells()[middle]), views == needed ? (occupied ? 1 : 2) : 3);
        }
    }
}

/* What is known already stays; what was seen once gets what is kept added. */
static void it_comes_where_nothing_is_known(void **state)
{
    (void)state;
    const int middle = 32 * 16 + 16;
    const double *P = lies(-1.6, -1.6, 0, 1);
    memset(kept, 0, sizeof kept);
    fv_grid_recall_keep(&recall, 32, 0.1, kept);
    update(SECOND, 0.06, 0.05, CART, P); /* one obstacle: known */
    assert_int_equal(all_cells()[middle], 70);
    make();
    fv_grid_recall_keep(&recall, 32, 0.1, kept);
    update(SECOND, 0.06, 0.05, FLOOR, P); /* one of floor is not */
    assert_int_equal(all_cells()[middle], 23);
    assert_int_equal(all_cells()[0], 31);
}

static void it_comes_once_and_is_forgotten_as_the_rest(void **state)
{
    (void)state;
    const double *P = lies(-3.2, -1.6, 0, 1);
    config.half_life_s = 1;
    make();
    memset(kept, 100, sizeof kept);
    fv_grid_recall_keep(&recall, 32, 0.1, kept); /* x from -3.2 to 0 */
    assert_int_equal(update(SECOND, 0.06, 0.05, SKY, P), 1);
    assert_int_equal(kind(all_cells()[0]), 2);
    assert_int_equal(cells[16], FOVEA_GRID_UNKNOWN);
    assert_int_equal(update(3 * SECOND, 0.06, 0.05, SKY, P), -1);
    assert_int_equal(kind(all_cells()[0]), 3);
    assert_int_equal(update(60 * SECOND, 0.06, 0.05, SKY, P), -1);
    assert_int_equal(all_cells()[0], FOVEA_GRID_UNKNOWN);
    /* Two columns come in at the left, and get theirs; the others have had it. */
    assert_int_equal(update(61 * SECOND, -0.15, 0.05, SKY, P), 1);
    all_cells();
    for (int x = 0; x < 32; x++)
        assert_int_equal(kind(cells[32 * 7 + x]), x < 2 ? 2 : 0);
    /* Back, and there again; and a row above. */
    assert_int_equal(update(61 * SECOND + 1, 0.06, 0.05, SKY, P), 1);
    assert_int_equal(all_cells()[32 * 7], FOVEA_GRID_UNKNOWN);
    assert_int_equal(update(61 * SECOND + 2, -0.15, 0.15, SKY, P), 1);
    all_cells();
    for (int x = 0; x < 32; x++)
        assert_int_equal(kind(cells[32 * 7 + x]), x < 2 ? 2 : 0);
    for (int x = 0; x < 32; x++) /* none is kept there */
        assert_int_equal(cells[32 * 31 + x], FOVEA_GRID_UNKNOWN);
    fv_grid_forget(&grid);
    fv_grid_recall_forget(&recall);
    assert_int_equal(update(62 * SECOND, 0.06, 0.05, SKY, P), 1);
    assert_int_equal(kind(all_cells()[0]), 2);
}

/* An obstacle in a part of a cell before floor, floor where all of it is. */
static void finer_cells_hide_no_obstacle(void **state)
{
    (void)state;
    const double *P = lies(-0.8, -0.8, 0, 1);
    for (int part = 2; part <= 4; part++) {
        const int side = 32;
        make();
        memset(kept, 10, sizeof kept);
        kept[side * (part + 1) + 2 * part] = 90;     /* in cell (2, 1) */
        kept[side * (4 * part) + 3 * part + 1] = -1; /* in cell (3, 4) */
        fv_grid_recall_keep(&recall, (uint32_t)side, 0.1 / part, kept);
        update(SECOND, 0.06, 0.05, SKY, P);
        all_cells();
        assert_int_equal(kind(cells[32 * 9 + 10]), 2);
        assert_int_equal(kind(cells[32 * 12 + 11]), 0);
        assert_int_equal(kind(cells[32 * 9 + 11]), 1);
        assert_int_equal(kind(cells[32 * 10 + 10]), 1);
    }
    make();
    fv_grid_recall_keep(&recall, 32, 0.02, kept); /* a fifth */
    assert_int_equal(update(SECOND, 0.06, 0.05, SKY, P), -1);
}

static void another_floor_is_not_taken(void **state)
{
    (void)state;
    memset(kept, 10, sizeof kept);
    for (int n = 0; n < 4; n++) {
        const double tilt = n == 0 ? 0.2 : n == 1 ? 0.3 : 0, up = n == 2 ? 0.25 : n == 3 ? 0.35 : 0;
        const double c = cos(tilt), s = sin(tilt);
        const double P[12] = {1, 0, 0, 1.6, 0, c, s, 1.6, 0, -s, c, up};
        make();
        fv_grid_recall_keep(&recall, 32, 0.1, kept);
        assert_int_equal(update(SECOND, 0.06, 0.05, SKY, P), n == 1 ? -1 : 1);
        assert_int_equal(kind(all_cells()[32 * 16 + 16]), n == 0 || n == 2 ? 1 : 0);
        if (n == 0) assert_int_equal(kind(cells[32 * 30 + 16]), 1); /* .3 m at 1.5 m */
    }
    const double none[12] = {NAN, 0, 0, 0, 0, NAN, 0, 0, 0, 0, NAN, 0};
    make();
    fv_grid_recall_keep(&recall, 32, 0.1, kept);
    assert_int_equal(update(SECOND, 0.06, 0.05, SKY, none), -1);
}

/* The largest grid, in pieces: the same as of pieces that a smaller one makes at once. */
static void the_work_is_in_pieces(void **state)
{
    (void)state;
    config.side_cells = MOST;
    make();
    fill(MOST);
    fv_grid_recall_keep(&recall, MOST, 0.1, kept);
    const double *P = lies(-25.6, -25.6, 0, 1);
    const int pieces = update(SECOND, 0.06, 0.05, SKY, P);
    assert_in_range(pieces, MOST * MOST / FV_GRID_RECALL_SAMPLES,
                    MOST * MOST / FV_GRID_RECALL_SAMPLES + 1);
    all_cells();
    for (int i = 0; i < MOST * MOST; i++)
        assert_int_equal(kind(cells[i]), kind(kept[i]));
    assert_int_equal(update(SECOND + 1, 0.15, 0.05, SKY, P), 1); /* one column */
}

static void what_is_known_and_static_is_saved(void **state)
{
    (void)state;
    static int8_t saved[32 * 32], later[32 * 32];
    const double *P = lies(0, 0, 0, 1);
    assert_false(fv_grid_recall_any(&grid));
    update(SECOND, 0.06, 0.05, CART, P);
    assert_int_equal(kind(all_cells()[32 * 16 + 16]), 2);
    assert_false(fv_grid_recall_any(&grid)); /* it may move */
    fv_grid_recall_rows(&grid, grid.state->corner, 0, 32, saved);
    for (int i = 0; i < 32 * 32; i++)
        assert_int_equal(saved[i], FOVEA_GRID_UNKNOWN);
    make();
    update(SECOND, 0.06, 0.05, FLOOR, P); /* not known yet */
    assert_false(fv_grid_recall_any(&grid));
    update(SECOND, 0.06, 0.05, FLOOR, P);
    assert_true(fv_grid_recall_any(&grid));
    const int64_t corner[2] = {grid.state->corner[0], grid.state->corner[1]};
    fv_grid_recall_rows(&grid, corner, 0, 32, saved);
    all_cells();
    int known = 0;
    for (int i = 0; i < 32 * 32; i++) {
        assert_int_equal(saved[i], kind(cells[i]) == 3 ? FOVEA_GRID_UNKNOWN : cells[i]);
        known += saved[i] != FOVEA_GRID_UNKNOWN;
    }
    assert_true(known > 100);
    /* The grid moves on, 13 cells along x and 3 along y, and what has left it is not known. */
    update(SECOND, 1.35, 0.35, SKY, P);
    fv_grid_recall_rows(&grid, corner, 0, 20, later);
    fv_grid_recall_rows(&grid, corner, 20, 12, later + 20 * 32);
    for (int y = 0; y < 32; y++)
        for (int x = 0; x < 32; x++)
            assert_int_equal(later[32 * y + x],
                             x < 13 || y < 3 ? FOVEA_GRID_UNKNOWN : saved[32 * y + x]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(it_lies_where_it_was, setup, teardown),
        cmocka_unit_test_setup_teardown(it_gives_way_to_what_is_seen, setup, teardown),
        cmocka_unit_test_setup_teardown(it_comes_where_nothing_is_known, setup, teardown),
        cmocka_unit_test_setup_teardown(it_comes_once_and_is_forgotten_as_the_rest, setup,
                                        teardown),
        cmocka_unit_test_setup_teardown(finer_cells_hide_no_obstacle, setup, teardown),
        cmocka_unit_test_setup_teardown(another_floor_is_not_taken, setup, teardown),
        cmocka_unit_test_setup_teardown(the_work_is_in_pieces, setup, teardown),
        cmocka_unit_test_setup_teardown(what_is_known_and_static_is_saved, setup, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
