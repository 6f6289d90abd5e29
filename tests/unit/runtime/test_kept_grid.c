/* Free space that outlives a run, in whole runs of the robot with two cameras and the shipped
 * network in a hall of `sim:drive`: the first run saves its map with its grid; later ones begin
 * elsewhere in the hall, know what it knew as soon as they know where they are, and correct what
 * has changed since. FOVEA_PICTURES=DIR: grids of the runs. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "app/config/model_file.h"
#include "app/lab/map_open.h"
#include "app/run/grid_file.h"
#include "common/sim_rig.h"
#include "geometry/se3.h"
#include "map/archive.h"
#include "runtime/kept_grid.h"
#include "runtime/state.h"

#define HALL "sim:drive?seed=7&width=320&height=240&rate=10&baseline=0.12"
enum { SIDE = 128, CELLS = SIDE * SIDE, SAVED_FRAMES = 120, START = 80, DARK = 1000 };
enum { FLOOR = 0, WALL, OBSTACLE, MOVABLE, OTHER };

static struct sim_rig rig;
static struct fv_model_file model;
static uint8_t *saved; /* the first run's map */
static size_t saved_bytes;

/* A grid, and where the truth's world lies against it. */
struct grid {
    int8_t cells[CELLS];
    struct fovea_grid_place place;
    double T_odom_world[12];
};
static struct grid first_run;

/* ---- runs ------------------------------------------------------------------------------------ */

static void open_rig(int start, int frames)
{
    sim_rig_open_kept(&rig, HALL, start, frames);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.detect.model = model.data;
    rig.config.detect.model_bytes = model.bytes;
    struct fovea_grid_job_config *job = &rig.config.grid_job;
    job->grid.side_cells = SIDE;
    job->enabled = true;
    memset(job->labels, FOVEA_GRID_OBSTACLE, sizeof job->labels);
    job->labels[FLOOR] = FOVEA_GRID_FLOOR;
    job->labels[MOVABLE] = FOVEA_GRID_MOVABLE;
    job->labels[OTHER] = FOVEA_GRID_BEYOND;
    double *rows = rig.config.rig.cameras[0].T_body_cam; /* as one writes it: three digits */
    for (int k = 0; k < 12; k++)
        rows[k] = floor(1000 * rows[k] + 0.5) / 1000;
}

static void load(const uint8_t *map, size_t bytes)
{
    rig.config.map = map;
    rig.config.map_bytes = bytes;
}

static int light_again = DARK; /* number of the frame */

/* What a run's network and odometry are granted in a frame; false: it is at its end. */
static bool next(int dark)
{
    static uint8_t black[320 * 240];
    if (!sim_rig_next(&rig)) return false;
    for (uint32_t i = 0; i < 2 && rig.frames >= dark && rig.frames < light_again; i++)
        rig.frame.images[i].data = black;
    rig.inputs.grants.units[FOVEA_JOB_DETECT] = 400; /* a mask with every frame */
    sim_rig_process(&rig);
    return true;
}

/* False: there is none. */
static bool take(struct grid *grid)
{
    struct fv_se3 B, T, back;
    if (!fovea_free_space_get(rig.rt, grid->cells, &grid->place)) return false;
    const int n = rig.frames - 1;
    if (!rig.pose[n].posed) return false;
    fv_se3_from_rows(rig.config.rig.cameras[0].T_body_cam, &B);
    fv_se3_from_rows(rig.pose[n].T_world_cam, &T);
    fv_se3_compose(&B, &T, &T);
    fv_se3_from_rows(rig.truth[n], &back);
    fv_se3_invert(&back, &back);
    fv_se3_compose(&T, &back, &T);
    fv_se3_to_rows(&T, grid->T_odom_world);
    return true;
}

static void draw(const char *name, uint32_t side)
{
    char path[256];
    struct fv_grid_counts counts;
    if (getenv("FOVEA_PICTURES") == NULL) return;
    snprintf(path, sizeof path, "%s/%s.png", getenv("FOVEA_PICTURES"), name);
    assert_int_equal(fv_grid_file_write(path, rig.rt, side, &counts, NULL), FOVEA_OK);
}

/* The sealed map, from malloc. */
static uint8_t *save(size_t *bytes)
{
    const size_t capacity = fovea_map_bytes_max(&rig.config);
    uint8_t *map = malloc(capacity);
    *bytes = fovea_map_save(rig.rt, map, capacity);
    assert_true(*bytes > 0);
    return map;
}

/* What a map file says of its grid, whose cells are the last part before the checksum. */
static const int8_t *cells_of(const uint8_t *map, size_t bytes, uint32_t side)
{
    return (const int8_t *)map + bytes - FV_ARCHIVE_CHECKSUM_BYTES - (size_t)side * side;
}

static int set_up(void **state)
{
    struct fovea_error error;
    (void)state;
    if (fv_model_file_read("src/detect/segmenter.fvm", &model, &error) != FOVEA_OK) return -1;
    open_rig(0, SAVED_FRAMES);
    sim_rig_build(&rig);
    while (next(DARK))
        ;
    if (!take(&first_run)) return -1;
    saved = save(&saved_bytes);
    draw("saved", SIDE);
    sim_rig_close(&rig);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    free(saved);
    fv_model_file_free(&model);
    return 0;
}

/* ---- comparing ------------------------------------------------------------------------------- */

static bool is_free(int8_t percent)
{
    return percent >= 0 && percent < 35;
}

static bool is_occupied(int8_t percent)
{
    return percent > 65;
}

static int count_known(const int8_t *cells, int count)
{
    int known = 0;
    for (int i = 0; i < count; i++)
        known += is_free(cells[i]) || is_occupied(cells[i]);
    return known;
}

/* Place of a cell of the first run in another; -1: outside. */
static int place_in(const struct grid *grid, int cell)
{
    const double at[3] = {first_run.place.origin_m[0] + 0.1 * (cell % SIDE + 0.5),
                          first_run.place.origin_m[1] + 0.1 * ((double)(cell / SIDE) + 0.5), 0};
    struct fv_se3 T;
    double p[3];
    fv_se3_from_rows(first_run.T_odom_world, &T);
    fv_se3_apply_inverse(&T, at, p);
    fv_se3_from_rows(grid->T_odom_world, &T);
    fv_se3_apply(&T, p, p);
    const double x = fv_floor((p[0] - grid->place.origin_m[0]) * 10),
                 y = fv_floor((p[1] - grid->place.origin_m[1]) * 10);
    return x < 0 || y < 0 || x >= SIDE || y >= SIDE ? -1 : (int)y * SIDE + (int)x;
}

/* A cell that says the other thing than all nine of the first run about it. */
static int count_contradictions(const struct grid *grid)
{
    int count = 0;
    for (int y = 1; y < SIDE - 1; y++)
        for (int x = 1; x < SIDE - 1; x++) {
            const int at = place_in(grid, y * SIDE + x);
            int free = 0, occupied = 0;
            for (int k = 0; k < 9; k++) {
                const int8_t near = first_run.cells[(y + k / 3 - 1) * SIDE + x + k % 3 - 1];
                free += is_free(near);
                occupied += is_occupied(near);
            }
            if (at < 0) continue;
            count += (free == 9 && is_occupied(grid->cells[at])) ||
                     (occupied > 5 && is_free(grid->cells[at]));
        }
    return count;
}

/* Frames until the first grid, which is left in `grid`; none is there without a pose. */
static int first_grid(struct grid *grid)
{
    for (int n = 1; next(DARK); n++) {
        const bool posed = rig.pose[n - 1].posed;
        if (!take(grid)) continue;
        assert_true(posed);
        return n;
    }
    fail_msg("no grid came");
    return 0;
}

/* ---- tests ----------------------------------------------------------------------------------- */

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

/* Nothing before the pose and nothing after its loss. The file keeps what it held, or gets what was
 * known when the pose was lost. */
static void lost_nothing_is_known_and_nothing_is_lost(void **state)
{
    (void)state;
    static struct grid grid;
    size_t bytes;
    for (int dark = 0; dark <= 6; dark += 6) {
        int grids = 0, known = 0;
        open_rig(START, 10);
        load(saved, saved_bytes);
        sim_rig_build(&rig);
        while (next(dark))
            grids += take(&grid);
        assert_int_equal(rig.pose[9].state, FOVEA_TRACKING_LOST);
        assert_false(fovea_free_space_get(rig.rt, (int8_t[CELLS]){0}, &grid.place));
        uint8_t *map = save(&bytes);
        const int8_t *kept = cells_of(map, bytes, SIDE);
        if (dark == 0) {
            assert_int_equal(grids, 0);
            assert_memory_equal(kept - FV_ARCHIVE_GRID_BYTES,
                                cells_of(saved, saved_bytes, SIDE) - FV_ARCHIVE_GRID_BYTES,
                                fv_archive_grid_bytes(SIDE));
        }
        for (int i = 0; dark > 0 && i < CELLS; i++) {
            if (kept[i] != FOVEA_GRID_UNKNOWN) assert_int_equal(kept[i], grid.cells[i]);
            known += kept[i] != FOVEA_GRID_UNKNOWN;
        }
        assert_true(dark == 0 || known + 100 > count_known(grid.cells, CELLS));
        free(map);
        sim_rig_close(&rig);
    }
}

/* Found again in its map, a run knows what it knew before the loss, at once. */
static void what_a_loss_ended_is_known_again(void **state)
{
    (void)state;
    static struct grid before, grid;
    open_rig(0, 80);
    sim_rig_build(&rig);
    light_again = 65;
    while (rig.frames < 60 && next(60))
        (void)take(&before);
    while (rig.frames < 65 && next(60))
        assert_true(rig.frames < 62 || !take(&grid));
    assert_true(next(60) && !rig.pose[64].posed);
    while (next(60) && !take(&grid))
        ;
    light_again = DARK;
    const int known = count_known(before.cells, CELLS), again = count_known(grid.cells, CELLS);
    print_message("%d cells known before the loss, %d in the first grid behind it\n", known, again);
    assert_true(known > 1000 && again > 0.8 * known);
    /* What an earlier loss kept gives way to the next one, whichever map it is of. */
    struct fv_archive_grid *kept = &rig.rt->free_space.kept->loaded;
    kept->map_id = 77;
    while (next(75))
        ;
    assert_int_equal(rig.pose[79].state, FOVEA_TRACKING_LOST);
    assert_true(kept->side == SIDE && kept->map_id != 77);
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

/* Loaded by a run that goes on. */
static void it_comes_with_a_map_that_a_run_takes(void **state)
{
    (void)state;
    static struct grid grid;
    const struct fovea_ready_map *ready;
    struct fovea_error error;
    open_rig(START, 20);
    sim_rig_build(&rig);
    const size_t bytes = fovea_map_prepared_bytes(&rig.config);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    if (fovea_map_prepare(rig.rt, memory, bytes, saved, saved_bytes, "a.map", &ready, &error))
        fail_msg("%s", error.text);
    int before = 0, after = 0;
    while (sim_rig_next(&rig)) {
        if (rig.frames == 8) rig.inputs.map = ready;
        rig.inputs.grants.units[FOVEA_JOB_DETECT] = 400;
        sim_rig_process(&rig);
        if (rig.frames == 8) before = take(&grid) ? count_known(grid.cells, CELLS) : 0;
        if (rig.frames == 9) assert_false(take(&grid) && count_known(grid.cells, CELLS) == before);
        if (rig.frames == 14) after = take(&grid) ? count_known(grid.cells, CELLS) : 0;
    }
    print_message("%d cells known before the map is taken, %d after\n", before, after);
    assert_true(before > 0 && after > 1500 && after > 2 * before);
    assert_true(count_contradictions(&grid) * 100 < after);
    free(memory);
    sim_rig_close(&rig);
}

/* A save that is under way when a map is taken begins anew, with that map and its grid. */
static void a_save_goes_on_with_the_map_taken(void **state)
{
    (void)state;
    const struct fovea_ready_map *ready;
    struct fovea_error error;
    size_t made = 0;
    open_rig(START, 20);
    sim_rig_build(&rig);
    const size_t bytes = fovea_map_prepared_bytes(&rig.config),
                 capacity = fovea_map_bytes_max(&rig.config);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    uint8_t *map = malloc(capacity);
    if (fovea_map_prepare(rig.rt, memory, bytes, saved, saved_bytes, "a.map", &ready, &error))
        fail_msg("%s", error.text);
    fovea_map_save_to(rig.rt, map, capacity);
    while (sim_rig_next(&rig)) {
        if (rig.frames == 6) rig.inputs.commands = FOVEA_COMMAND_SAVE;
        if (rig.frames == 7) rig.inputs.map = ready;
        rig.inputs.grants.units[FOVEA_JOB_DETECT] = 400;
        rig.inputs.grants.units[FOVEA_JOB_MAP] = rig.frames < 7 ? 1 : 2000;
        sim_rig_process(&rig);
        assert_true(rig.frames > 7 || rig.work.map_bytes == 0); /* it was under way */
        if (rig.work.map_bytes > 0 && made == 0) made = rig.work.map_bytes;
    }
    assert_true(made > 0);
    fovea_map_seal(map, made);
    assert_true(map[8] == 5 || map[8] == 6);
    assert_true(count_known(cells_of(map, made, SIDE), CELLS) > 1500);
    free(map);
    free(memory);
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_file_holds_what_is_known_and_static),
        cmocka_unit_test(it_is_known_where_the_run_is_found),
        cmocka_unit_test(it_is_turned_with_the_frame),
        cmocka_unit_test(what_has_changed_is_corrected),
        cmocka_unit_test(it_lies_in_the_map_and_not_in_odom),
        cmocka_unit_test(lost_nothing_is_known_and_nothing_is_lost),
        cmocka_unit_test(what_a_loss_ended_is_known_again),
        cmocka_unit_test(runs_of_other_grids_load_it),
        cmocka_unit_test(it_is_the_same_again),
        cmocka_unit_test(it_comes_with_a_map_that_a_run_takes),
        cmocka_unit_test(a_save_goes_on_with_the_map_taken),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
