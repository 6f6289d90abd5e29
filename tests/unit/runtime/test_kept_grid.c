/* Free space that outlives a run, in whole runs (hall_runs.h): the first one saves its map with its
 * grid; later ones begin elsewhere in the hall, know what it knew as soon as they know where they
 * are, and correct what has changed since. */
#include "common/hall_runs.h"

#include "app/lab/map_open.h"
#include "runtime/kept_grid.h"
#include "runtime/state.h"

static void the_file_holds_what_is_known_and_static(void **state)
{
    (void)state;
    const int8_t *kept = cells_of(saved, saved_bytes, SIDE);
    int known = 0, movable = 0;
    for (int i = 0; i < CELLS; i++) {
        const int8_t now = first_run.cells[i];
        assert_true(fv_archive_cell(kept[i]));
        if (kept[i] != FOVEA_GRID_UNKNOWN) assert_int_equal(kept[i], now);
        known += kept[i] != FOVEA_GRID_UNKNOWN;
        movable += kept[i] == FOVEA_GRID_UNKNOWN && is_occupied(now);
    }
    print_message("%d cells known at the end, %d saved, %d occupied ones that may move are not\n",
                  count_known(first_run.cells, CELLS), known, movable);
    assert_true(known > 1500 && known + 300 > count_known(first_run.cells, CELLS));
    assert_true(movable > 0);
}

/* With the map, as soon as the pose is known, many times as many cells are known as without; they
 * say what the first run said. */
static void it_is_known_where_the_run_is_found(void **state)
{
    (void)state;
    static struct grid with, without;
    open_rig(START, 10);
    sim_rig_build(&rig);
    const int frames_without = first_grid(&without);
    sim_rig_close(&rig);
    open_rig(START, 10);
    load(saved, saved_bytes);
    sim_rig_build(&rig);
    const int frames = first_grid(&with);
    draw("found", SIDE);
    sim_rig_close(&rig);
    const int known = count_known(with.cells, CELLS),
              known_without = count_known(without.cells, CELLS),
              wrong = count_contradictions(&with);
    print_message(
        "first grid after %d frames: %d cells known, %d contradict the first run; without "
        "the map after %d frames %d\n",
        frames, known, wrong, frames_without, known_without);
    assert_true(frames <= 4);
    assert_true(known > 1500 && known > 4 * known_without);
    assert_true(wrong * 100 < known);
}

/* The robot's axes are others than in the run that saved the map: so are those of `odom`. */
static void it_is_turned_with_the_frame(void **state)
{
    (void)state;
    static struct grid grid;
    struct fv_se3 B, turn = {.R = {0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1}, .t = {0.3, -0.2, 0}};
    open_rig(START, 10);
    double *rows = rig.config.rig.cameras[0].T_body_cam;
    fv_se3_from_rows(rows, &B);
    fv_se3_compose(&turn, &B, &B);
    fv_se3_to_rows(&B, rows);
    load(saved, saved_bytes);
    sim_rig_build(&rig);
    (void)first_grid(&grid);
    draw("turned", SIDE);
    const int known = count_known(grid.cells, CELLS), wrong = count_contradictions(&grid);
    print_message("turned: %d cells known, %d contradict the first run\n", known, wrong);
    assert_true(known > 1500 && wrong * 100 < known);
    sim_rig_close(&rig);
}

/* Of the cells that the later run sees as floor in its first frames, and the first run saw: those
 * that lie together and are surest. */
enum { BLOCK = 4 };

static int free_block(const struct grid *seen)
{
    int best = -1, least = BLOCK * BLOCK * 35;
    for (int y = 0; y + BLOCK <= SIDE; y++)
        for (int x = 0; x + BLOCK <= SIDE; x++) {
            int free = 0, percent = 0;
            for (int k = 0; k < BLOCK * BLOCK; k++) {
                const int cell = (y + k / BLOCK) * SIDE + x + k % BLOCK, at = place_in(seen, cell);
                if (at < 0 || !is_free(seen->cells[at]) || !is_free(first_run.cells[cell])) break;
                percent += seen->cells[at];
                free++;
            }
            if (free < BLOCK * BLOCK || percent >= least) continue;
            least = percent;
            best = y * SIDE + x;
        }
    if (best < 0) fail_msg("no floor is seen by both runs");
    return best;
}

static int count_block(const struct grid *grid, int block, bool (*is)(int8_t))
{
    int count = 0;
    for (int k = 0; k < BLOCK * BLOCK; k++) {
        const int at = place_in(grid, block + k / BLOCK * SIDE + k % BLOCK);
        count += at >= 0 && is(grid->cells[at]);
    }
    return count;
}

/* Obstacles that the saved grid has, and that have been taken away: one is in view at first, and
 * counts as an obstacle or as not known until it was seen a few times. */
static void what_has_changed_is_corrected(void **state)
{
    (void)state;
    static struct grid grid;
    enum { FRAMES = 6, VIEWS = 5 };
    open_rig(START, FRAMES);
    sim_rig_build(&rig);
    while (next(DARK))
        ;
    assert_true(take(&grid));
    const int block = free_block(&grid);
    sim_rig_close(&rig);

    uint8_t *map = malloc(saved_bytes);
    memcpy(map, saved, saved_bytes);
    int8_t *kept = (int8_t *)(uintptr_t)cells_of(map, saved_bytes, SIDE);
    for (int k = 0; k < BLOCK * BLOCK; k++)
        kept[block + k / BLOCK * SIDE + k % BLOCK] = 100;
    fv_archive_seal(map, saved_bytes);
    open_rig(START, 2 * VIEWS);
    load(map, saved_bytes);
    sim_rig_build(&rig);
    (void)first_grid(&grid);
    draw("phantom", SIDE);
    const int at_first = count_block(&grid, block, is_free);
    int frames = 0;
    while (count_block(&grid, block, is_free) < BLOCK * BLOCK && next(DARK)) {
        assert_true(take(&grid));
        frames++;
    }
    draw("corrected", SIDE);
    print_message(
        "an obstacle that is gone: %d of its 16 cells free at first, all %d frames later\n",
        at_first, frames);
    assert_int_equal(at_first, 0);
    assert_in_range(frames, 1, VIEWS);
    sim_rig_close(&rig);
    free(map);
}

/* Move the map as a closure does that corrects all of it alike; `odom` and the last pose stay. */
static void correct(const struct fv_sim3 *S)
{
    struct fv_map *map = &rig.rt->odometry.map;
    for (uint32_t k = 0; k <= map->limits.keyframes; k++)
        fv_sim3_move_pose(S, &map->keyframes[k].T_cam_world);
    for (uint32_t i = 0; i < map->limits.landmarks; i++)
        fv_sim3_apply(S, map->landmarks[i].point, map->landmarks[i].point);
    fv_sim3_compose(S, &map->state->S_map_world, &map->state->S_map_world);
}

static struct fv_archive_grid grid_now(void)
{
    struct fv_map_open open;
    struct fovea_error error;
    size_t bytes;
    uint8_t *map = save(&bytes);
    if (fv_map_open_bytes(map, bytes, "now", &open, &error) != FOVEA_OK) fail_msg("%s", error.text);
    const struct fv_archive_grid grid = open.info.grid;
    fv_map_open_free(&open);
    free(map);
    assert_int_equal(grid.side, SIDE);
    return grid;
}

static double apart(const struct fv_sim3 *A, const struct fv_sim3 *B)
{
    double p[3], q[3], most = 0;
    for (int corner = 0; corner < 4; corner++) {
        const double at[3] = {12.8 * (corner & 1), 12.8 * (corner >> 1), 0};
        fv_sim3_apply(A, at, p);
        fv_sim3_apply(B, at, q);
        for (int k = 0; k < 3; k++)
            most = __builtin_fmax(most, __builtin_fabs(p[k] - q[k]));
    }
    return most;
}

/* The file has the cells where the map has the place, also where a closure has moved it since the
 * last frame; and so it is offered from the next frame on. */
static void it_lies_in_the_map_and_not_in_odom(void **state)
{
    (void)state;
    const double turn[3] = {0.05, 0.4, -0.1};
    struct fv_sim3 S = {.t = {0.7, -0.2, 1.1}, .s = 1}, expected, own, now;
    fv_so3_exp(turn, S.R);
    open_rig(0, 32);
    sim_rig_build(&rig);
    while (rig.frames < 30)
        assert_true(next(DARK));
    const struct fv_archive_grid before = grid_now();
    own = fv_kept_grid_own(&rig.rt->publish);
    correct(&S);
    const struct fv_archive_grid after = grid_now();
    fv_sim3_compose(&S, &before.S_map_grid, &expected);
    assert_true(apart(&before.S_map_grid, &expected) > 0.5);
    if (!(apart(&after.S_map_grid, &expected) < 1e-9))
        fail_msg("%g", apart(&after.S_map_grid, &expected));
    assert_true(next(DARK) && rig.pose[30].posed);
    now = fv_kept_grid_own(&rig.rt->publish);
    fv_sim3_compose(&S, &own, &expected);
    if (!(apart(&now, &expected) < 0.02)) fail_msg("%g", apart(&now, &expected));
    sim_rig_close(&rig);
}

/* Where the run's own map is in metres, one that was loaded comes to metres, and its grid with it.
 */
static void it_stretches_with_its_map(void **state)
{
    (void)state;
    open_rig(START, 10);
    load(saved, saved_bytes);
    sim_rig_build(&rig);
    const uint32_t map_id = rig.rt->free_space.kept->loaded.map_id;
    const struct fv_archive_grid before = grid_now();
    fv_kept_grid_stretch(&rig.rt->free_space, map_id + 1, 3);
    struct fv_archive_grid after = grid_now();
    assert_true(apart(&before.S_map_grid, &after.S_map_grid) == 0);
    fv_kept_grid_stretch(&rig.rt->free_space, map_id, 3);
    after = grid_now();
    struct fv_sim3 expected, stretch;
    fv_sim3_identity(&stretch);
    stretch.s = 3;
    fv_sim3_compose(&stretch, &before.S_map_grid, &expected);
    assert_true(apart(&before.S_map_grid, &expected) > 1);
    assert_true(apart(&after.S_map_grid, &expected) < 1e-9);
    sim_rig_close(&rig);
}

/* A run without a grid takes the map, and one of other cells takes the middle. */
static void runs_of_other_grids_load_it(void **state)
{
    (void)state;
    static struct grid grid;
    size_t bytes;
    open_rig(START, 6);
    rig.config.grid_job.enabled = false;
    load(saved, saved_bytes);
    sim_rig_build(&rig);
    while (next(DARK))
        ;
    assert_true(rig.pose[5].posed);
    uint8_t *map = save(&bytes);
    assert_true(map[8] == 3 || map[8] == 4);
    free(map);
    sim_rig_close(&rig);

    open_rig(START, 6);
    rig.config.grid_job.grid.resolution_m = 0.2;
    rig.config.grid_job.grid.side_cells = 64;
    load(saved, saved_bytes);
    sim_rig_build(&rig);
    (void)first_grid(&grid);
    draw("coarse", 64);
    const int known = count_known(grid.cells, 64 * 64);
    print_message("in cells of 20 cm, of the middle 6.4 m: %d known\n", known);
    assert_true(known > 150 && known < 1024);
    sim_rig_close(&rig);
}

/* Bit for bit: again, in a copy, and with the save asked for in the loop, which others' units
 * share.
 */
static void it_is_the_same_again(void **state)
{
    (void)state;
    uint64_t hash[2];
    const size_t capacity = fovea_map_bytes_max(&rig.config);
    uint8_t *map[2];
    size_t bytes[2] = {0, 0};
    for (int n = 0; n < 2; n++) {
        void *other = NULL;
        map[n] = calloc(capacity, 1);
        open_rig(START, 24);
        load(saved, saved_bytes);
        sim_rig_build(&rig);
        while (sim_rig_next(&rig)) {
            if (n == 1 && rig.frames == 4) { /* go on in a copy */
                size_t size;
                assert_int_equal(fovea_size(&rig.config, &size, NULL), FOVEA_OK);
                other = rig.rt;
                assert_int_equal(
                    fovea_copy(other, aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (size + 63) / 64 * 64),
                               size, &rig.rt),
                    FOVEA_OK);
                memset(other, 0x5a, size);
            }
            fovea_map_save_to(rig.rt, map[n], capacity);
            if (rig.frames == 10) rig.inputs.commands = FOVEA_COMMAND_SAVE;
            rig.inputs.grants.units[FOVEA_JOB_DETECT] = 37;
            rig.inputs.grants.units[FOVEA_JOB_MAP] = 20;
            sim_rig_process(&rig);
            if (rig.work.map_bytes > 0) bytes[n] = rig.work.map_bytes;
        }
        hash[n] = fovea_state_hash(rig.rt);
        free(other);
        sim_rig_close(&rig);
    }
    assert_int_equal(hash[0], hash[1]);
    assert_true(bytes[0] > 0 && bytes[0] == bytes[1]);
    assert_memory_equal(map[0], map[1], bytes[0]);
    fovea_map_seal(map[0], bytes[0]);
    assert_int_equal(map[0][8], 6);
    assert_true(count_known(cells_of(map[0], bytes[0], SIDE), CELLS) > 1500);
    free(map[0]);
    free(map[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_file_holds_what_is_known_and_static),
        cmocka_unit_test(it_is_known_where_the_run_is_found),
        cmocka_unit_test(it_is_turned_with_the_frame),
        cmocka_unit_test(what_has_changed_is_corrected),
        cmocka_unit_test(it_lies_in_the_map_and_not_in_odom),
        cmocka_unit_test(it_stretches_with_its_map),
        cmocka_unit_test(runs_of_other_grids_load_it),
        cmocka_unit_test(it_is_the_same_again),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
