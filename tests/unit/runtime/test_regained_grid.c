/* Free space that comes back within a run (hall_runs.h): after the loss of the pose, and with a map
 * that the run takes on its way. */
#include "common/hall_runs.h"

#include "runtime/kept_grid.h"
#include "runtime/state.h"

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
        cmocka_unit_test(lost_nothing_is_known_and_nothing_is_lost),
        cmocka_unit_test(what_a_loss_ended_is_known_again),
        cmocka_unit_test(it_comes_with_a_map_that_a_run_takes),
        cmocka_unit_test(a_save_goes_on_with_the_map_taken),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
