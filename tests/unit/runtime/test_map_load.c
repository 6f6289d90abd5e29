/* Maps loaded while the loop runs: the camera is found in the map, whose poses are those of the run
 * that made it; ids and numbers go on; the same inputs give the same bits on every kernel set. What
 * does not fit is refused whole. Damaged files whose checksum is right do no harm. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "common/sim_rig.h"
#include "runtime/ready_map.h"
#include "runtime/state.h"
#include "support/aligned.h"

enum { FRAMES = 80, FROM = 30, AGAIN = 45, LOAD = 20 };
#define WAY "sim:orbit?width=320&height=240"

static struct sim_rig rig;
static double made[FRAMES][12];
static uint8_t *file;
static size_t file_bytes;

static void open_rig(const char *uri, int start, int frames)
{
    sim_rig_open_kept(&rig, uri, start, frames);
    rig.config.preview.period_frames = 0;
    rig.config.features.count_max = 400;
}

static uint8_t *save(size_t *bytes)
{
    const size_t capacity = fovea_map_bytes_max(&rig.config);
    uint8_t *map = malloc(capacity);
    assert_non_null(map);
    *bytes = fovea_map_save(rig.rt, map, capacity);
    assert_true(*bytes > 0);
    return map;
}

/* The path has no closure of its own. */
static void add_edge(struct fv_map *map)
{
    uint32_t ends[2], count = 0;
    for (uint32_t k = 0; k < map->limits.keyframes && count < 2; k++)
        if (map->keyframes[k].used) ends[count++] = k;
    assert_int_equal(count, 2);
    assert_int_equal(map->state->edge_count, 0);
    fv_map_add_edge(map, ends[0], ends[1]);
}

static int make_map(void **state)
{
    (void)state;
    open_rig(WAY, 0, FRAMES);
    sim_rig_build(&rig);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    for (int n = 0; n < FRAMES; n++)
        memcpy(made[n], rig.pose[n].T_world_cam, sizeof made[n]);
    add_edge(&rig.rt->odometry.map);
    file = save(&file_bytes);
    sim_rig_close(&rig);
    return 0;
}

static int drop_map(void **state)
{
    (void)state;
    free(file);
    return 0;
}

static void *ready_memory(size_t *bytes)
{
    *bytes = fovea_map_prepared_bytes(&rig.config);
    void *memory = fv_aligned_new(*bytes);
    assert_non_null(memory);
    memset(memory, 0xa5, *bytes);
    return memory;
}

static const struct fovea_ready_map *prepare(void *memory, size_t bytes)
{
    const struct fovea_ready_map *ready = NULL;
    struct fovea_error error;
    assert_int_equal(
        fovea_map_prepare(rig.rt, memory, bytes, file, file_bytes, "m", &ready, &error), FOVEA_OK);
    return ready;
}

/* A run of its own that takes the map on the way; what it has at the end. */
static uint64_t run_and_load(const char *set)
{
    size_t bytes;
    if (set != NULL)
        setenv("FOVEA_CPU", set, 1);
    else
        unsetenv("FOVEA_CPU");
    open_rig(WAY, FROM, AGAIN);
    sim_rig_build(&rig);
    unsetenv("FOVEA_CPU");
    void *memory = ready_memory(&bytes);
    for (int n = 0; sim_rig_next(&rig); n++) {
        if (n == LOAD) rig.inputs.map = prepare(memory, bytes);
        sim_rig_process(&rig);
        if (n == LOAD) memset(memory, 0xa5, bytes); /* not read after the step */
    }
    const uint64_t hash = fovea_state_hash(rig.rt);
    free(memory);
    return hash;
}

static void the_camera_is_found_in_it(void **state)
{
    (void)state;
    struct fovea_stats stats;
    struct fovea_keyframe keyframes[256];
    const uint64_t hash = run_and_load(NULL);
    const struct fovea_pose *before = &rig.pose[LOAD - 1], *end = &rig.pose[AGAIN - 1];
    assert_true(before->posed);
    assert_int_equal(end->reset_counter, before->reset_counter + 1);
    assert_true(end->map_id > before->map_id);
    fovea_stats_get(rig.rt, &stats);
    assert_int_equal(stats.reset_counter, end->reset_counter);
    int posed = 0;
    const double way = sim_rig_moved(made[FROM], made[FROM + AGAIN - 1]);
    for (int n = LOAD; n < AGAIN; n++) {
        assert_int_equal(rig.pose[n].map_id, end->map_id);
        if (!rig.pose[n].posed) continue;
        posed++;
        assert_true(sim_rig_moved(rig.pose[n].T_world_cam, made[FROM + n]) < .05 * way);
    }
    print_message("posed in %d of %d frames after the load\n", posed, AGAIN - LOAD);
    assert_in_range(posed, AGAIN - LOAD - 6, AGAIN - LOAD);
    const uint32_t slots = fovea_keyframes_get(rig.rt, keyframes, 256);
    uint32_t used = 0;
    for (uint32_t i = 0; i < slots; i++) {
        used += keyframes[i].used;
        if (keyframes[i].used) assert_true(keyframes[i].number >= before->keyframes);
    }
    assert_true(used > 4);
    sim_rig_close(&rig);
    assert_true(run_and_load("c") == hash);
    sim_rig_close(&rig);
}

/* What links keyframes and landmarks, of a map that was read again, and closures. */
static uint64_t links_of(const struct fovea_ready_map *ready)
{
    uint64_t links =
        ready->map.state->landmark_count + UINT64_C(1000000000000) * ready->map.state->edge_count;
    for (uint32_t k = 0; k < ready->map.limits.keyframes; k++)
        if (ready->map.keyframes[k].used)
            links += UINT64_C(1000000) * ready->map.keyframes[k].landmarks;
    return links;
}

/* Frames go on from those that there were. */
static void assert_seen_as_long_ago(const struct fovea_ready_map *ready)
{
    const struct fv_odometry *o = &rig.rt->odometry;
    const uint32_t now = (uint32_t)o->state->frame_number, then = (uint32_t)ready->frame_number;
    for (uint32_t i = 0; i < o->map.limits.landmarks; i++) {
        const struct fv_landmark *a = &ready->map.landmarks[i], *b = &o->map.landmarks[i];
        if (!a->used) continue;
        assert_int_equal(now - b->seen, then - a->seen);
        assert_int_equal(now - b->born, then - a->born);
    }
}

/* Loaded over the map of a start, of the same file: nothing is lost on the way. */
static void it_is_as_at_the_start(void **state)
{
    (void)state;
    size_t bytes;
    open_rig(WAY, FROM, AGAIN);
    rig.config.map = file;
    rig.config.map_bytes = file_bytes;
    rig.config.odometry.localise_only = true;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    void *memory = ready_memory(&bytes);
    const uint32_t resets = rig.pose[AGAIN - 1].reset_counter;
    rig.inputs = (struct fovea_inputs){.map = prepare(memory, bytes)};
    const uint64_t links = links_of(rig.inputs.map);
    fovea_grants_fixed(&rig.config, &rig.inputs.grants);
    assert_int_equal(fovea_step(rig.rt, &rig.inputs, &rig.outputs), FOVEA_AGAIN);
    struct fovea_stats stats;
    fovea_stats_get(rig.rt, &stats);
    assert_int_equal(stats.reset_counter, resets + 1);
    assert_seen_as_long_ago(rig.inputs.map);
    size_t again_bytes;
    uint8_t *again = save(&again_bytes);
    struct fovea_error error;
    const struct fovea_ready_map *ready;
    assert_int_equal(
        fovea_map_prepare(rig.rt, memory, bytes, again, again_bytes, "m", &ready, &error),
        FOVEA_OK);
    assert_int_equal(again_bytes, file_bytes);
    assert_true(links > 0 && links_of(ready) == links);
    free(again);
    free(memory);
    sim_rig_close(&rig);
}

/* What a map knows of its unit holds in a run that knew nothing. */
static void metres_come_with_a_map(void **state)
{
    (void)state;
    const struct fv_map_scale known = {FOVEA_SCALE_WHEEL_ODOMETRY, 0, .3, 1e-4};
    uint8_t *const unscaled = file;
    const size_t unscaled_bytes = file_bytes;
    size_t bytes;
    open_rig(WAY, FROM, AGAIN);
    rig.config.map = file;
    rig.config.map_bytes = file_bytes;
    sim_rig_build(&rig);
    fv_odometry_keep_scale(&rig.rt->odometry, &known);
    file = save(&file_bytes);
    sim_rig_close(&rig);
    open_rig(WAY, FROM, AGAIN);
    sim_rig_build(&rig);
    void *memory = ready_memory(&bytes);
    for (int n = 0; sim_rig_next(&rig); n++) {
        if (n == LOAD) rig.inputs.map = prepare(memory, bytes);
        sim_rig_process(&rig);
    }
    const struct fovea_pose *before = &rig.pose[LOAD - 1], *end = &rig.pose[AGAIN - 1];
    assert_true(before->posed && before->scale_source == FOVEA_SCALE_FREE);
    assert_true(end->posed && end->scale_source == FOVEA_SCALE_WHEEL_ODOMETRY);
    assert_true(end->scale > 1.3 && end->scale < 1.4); /* exp(.3) is 1.35 */
    free(file);
    file = unscaled;
    file_bytes = unscaled_bytes;
    free(memory);
    sim_rig_close(&rig);
}

static void expect_refused(const uint8_t *data, size_t bytes, const char *said)
{
    struct fovea_error error = {0};
    size_t memory_bytes;
    void *memory = ready_memory(&memory_bytes);
    const struct fovea_ready_map *const untouched = memory, *ready = untouched;
    const uint64_t hash = fovea_state_hash(rig.rt);
    assert_int_equal(
        fovea_map_prepare(rig.rt, memory, memory_bytes, data, bytes, "m", &ready, &error),
        FOVEA_ERROR_INPUT);
    if (strstr(error.text, said) == NULL) fail_msg("found \"%s\", expected %s", error.text, said);
    assert_ptr_equal(ready, untouched);
    assert_true(fovea_state_hash(rig.rt) == hash);
    free(memory);
}

static void what_does_not_fit_is_refused(void **state)
{
    (void)state;
    struct fovea_error error;
    const struct fovea_ready_map *ready;
    uint8_t *bad = malloc(file_bytes);
    assert_non_null(bad);
    memcpy(bad, file, file_bytes);
    bad[file_bytes / 2] ^= 1;
    open_rig(WAY, 0, 12);
    sim_rig_build(&rig);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    expect_refused(bad, file_bytes, "m: byte ");
    expect_refused(file, file_bytes - 1, "size stated");
    expect_refused((const uint8_t *)"", 0, "size of the file");
    size_t bytes;
    void *memory = ready_memory(&bytes);
    assert_int_equal(
        fovea_map_prepare(rig.rt, memory, bytes - 1, file, file_bytes, "m", &ready, &error),
        FOVEA_ERROR_MEMORY);
    sim_rig_close(&rig);

    size_t none_bytes;
    open_rig(WAY, 0, 1); /* no map yet */
    sim_rig_build(&rig);
    uint8_t *none = save(&none_bytes);
    expect_refused(none, none_bytes, "found a map without keyframes");
    free(none);
    sim_rig_close(&rig);

    open_rig("sim:orbit?width=352&height=240", 0, 12);
    sim_rig_build(&rig);
    expect_refused(file, file_bytes, "camera: found 320 x 240");
    sim_rig_close(&rig);

    open_rig(WAY, 0, 12);
    rig.config.features.count_max = 200;
    sim_rig_build(&rig);
    expect_refused(file, file_bytes, "at most features.count_max");
    sim_rig_close(&rig);
    free(memory);
    free(bad);
}

/* Prepared for another runtime: of the same configuration it is taken, of another one left. */
static void one_of_another_runtime(void **state)
{
    (void)state;
    size_t bytes, block_bytes;
    struct fovea_error error;
    struct fovea_stats stats;
    open_rig(WAY, 0, 12);
    sim_rig_build(&rig);
    void *memory = ready_memory(&bytes);
    rig.inputs = (struct fovea_inputs){.map = prepare(memory, bytes)};
    for (int i = 0; i < 3; i++) {
        struct fovea_config config = rig.config;
        struct fovea *other;
        if (i == 1) config.odometry.landmarks /= 2;
        if (i == 2) config.odometry.enabled = false;
        assert_int_equal(fovea_size(&config, &block_bytes, &error), FOVEA_OK);
        void *block = fv_aligned_new(block_bytes);
        assert_int_equal(fovea_init(block, block_bytes, &config, &other, &error), FOVEA_OK);
        assert_int_equal(fovea_step(other, &rig.inputs, &rig.outputs), FOVEA_AGAIN);
        fovea_stats_get(other, &stats);
        assert_int_equal(stats.reset_counter, i == 0 ? 1 : 0);
        free(block);
    }
    free(memory);
    sim_rig_close(&rig);
}

/* Half of one map and half of another would be none. */
static void a_save_under_way_is_of_the_new_map(void **state)
{
    (void)state;
    size_t bytes, small_bytes, saved = 0;
    struct fovea_error error;
    const struct fovea_ready_map *ready;
    open_rig(WAY, FROM, 25);
    sim_rig_build(&rig);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    uint8_t *small = save(&small_bytes);
    sim_rig_close(&rig);
    assert_true(small_bytes < file_bytes);
    open_rig(WAY, FROM, 40);
    rig.config.odometry.localise_only = true;
    rig.config.map = small;
    rig.config.map_bytes = small_bytes;
    sim_rig_build(&rig);
    void *memory = ready_memory(&bytes);
    uint8_t *buffer = calloc(1, fovea_map_bytes_max(&rig.config));
    for (int n = 0; sim_rig_next(&rig) && saved == 0; n++) {
        if (n == 3) {
            fovea_map_save_to(rig.rt, buffer, fovea_map_bytes_max(&rig.config));
            rig.inputs.commands = FOVEA_COMMAND_SAVE;
        }
        if (n == 3 || n == 4) rig.inputs.grants.units[FOVEA_JOB_MAP] = 2;
        if (n == 4) rig.inputs.map = prepare(memory, bytes);
        sim_rig_process(&rig);
        saved = rig.work.map_bytes;
    }
    assert_int_equal(saved, file_bytes);
    fovea_map_seal(buffer, saved);
    assert_int_equal(fovea_map_prepare(rig.rt, memory, bytes, buffer, saved, "m", &ready, &error),
                     FOVEA_OK);
    const uint64_t links = links_of(ready);
    assert_true(links_of(prepare(memory, bytes)) == links);
    free(small);
    free(buffer);
    free(memory);
    sim_rig_close(&rig);
}

/* Landmarks of the map that was discarded would be in the file, without keyframes. */
static void a_save_under_way_is_of_the_map_after_a_reset(void **state)
{
    (void)state;
    size_t saved = 0;
    open_rig(WAY, FROM, 25);
    sim_rig_build(&rig);
    uint8_t *buffer = calloc(1, fovea_map_bytes_max(&rig.config));
    assert_non_null(buffer);
    for (int n = 0; sim_rig_next(&rig) && saved == 0; n++) {
        if (n == 20) {
            assert_true(rig.pose[n - 1].posed);
            fovea_map_save_to(rig.rt, buffer, fovea_map_bytes_max(&rig.config));
            rig.inputs.commands = FOVEA_COMMAND_SAVE;
            rig.inputs.grants.units[FOVEA_JOB_MAP] = 2; /* landmarks alone */
        }
        if (n == 21) rig.inputs.commands = FOVEA_COMMAND_RESET;
        sim_rig_process(&rig);
        saved = rig.work.map_bytes;
        assert_true(n == 21 || saved == 0);
    }
    struct fv_archive_outline outline = {.landmarks = UINT32_MAX};
    assert_int_equal(saved, FV_ARCHIVE_HEADER_BYTES + FV_ARCHIVE_CHECKSUM_BYTES); /* none yet */
    assert_true(fv_archive_outline(buffer, saved, &outline));
    assert_int_equal(outline.landmarks, 0);
    free(buffer);
    sim_rig_close(&rig);
}

/* Bytes changed at random under a right checksum: refused, or taken and stepped with. */
static void damaged_files_do_no_harm(void **state)
{
    (void)state;
    enum { TRIES = 40, EACH = 3 };
    struct fv_random random;
    struct fovea_error error;
    size_t bytes;
    int taken = 0;
    uint8_t *bad = malloc(file_bytes);
    assert_non_null(bad);
    fv_random_seed(&random, 5);
    open_rig(WAY, FROM, TRIES + 1);
    sim_rig_build(&rig);
    void *memory = ready_memory(&bytes);
    while (sim_rig_next(&rig)) {
        const struct fovea_ready_map *ready = NULL;
        memcpy(bad, file, file_bytes);
        for (int i = 0; i < EACH; i++) /* mostly landmarks and poses, where numbers matter */
            bad[64 + fv_random_below(&random, (uint32_t)file_bytes - 72)] ^=
                (uint8_t)(1u << fv_random_below(&random, 8));
        fovea_map_seal(bad, file_bytes);
        if (fovea_map_prepare(rig.rt, memory, bytes, bad, file_bytes, "m", &ready, &error) ==
            FOVEA_OK)
            taken++;
        else
            assert_non_null(strstr(error.text, "m: byte "));
        rig.inputs.map = ready;
        sim_rig_process(&rig);
    }
    print_message("%d of %d damaged maps were taken\n", taken, TRIES);
    assert_in_range(taken, 1, TRIES);
    free(memory);
    free(bad);
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_camera_is_found_in_it),
        cmocka_unit_test(it_is_as_at_the_start),
        cmocka_unit_test(metres_come_with_a_map),
        cmocka_unit_test(what_does_not_fit_is_refused),
        cmocka_unit_test(one_of_another_runtime),
        cmocka_unit_test(a_save_under_way_is_of_the_new_map),
        cmocka_unit_test(a_save_under_way_is_of_the_map_after_a_reset),
        cmocka_unit_test(damaged_files_do_no_harm),
    };
    if (getenv("FOVEA_EMULATED") != NULL) {
        puts("SKIPPED test_map_load: minutes under an emulator");
        return 0;
    }
    return cmocka_run_group_tests(tests, make_map, drop_map);
}
