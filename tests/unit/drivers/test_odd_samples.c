/* Samples of a EuRoC data set that repeat, come late, leap or are no numbers: they reach the gate
 * in the order of the file, which counts and names them, and hold no others up. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../../../drivers/recorded/due.h"
#include "../../../drivers/recorded/player.h"
#include "common/datasets.h"
#include "inertial/gate.h"

enum { PER_FRAME = 10, SAMPLES = (FV_TEST_FRAMES - 1) * PER_FRAME + 1 };

static const long long first_ns = 1403638538577829376LL, period_ns = 5000000LL;

static const struct fovea_source_selection everything = {.step = 1};
static char uri[FV_TEST_PATH_BYTES], top[FV_TEST_PATH_BYTES];

/* `text` stands in place of the line of sample `at`. */
struct odd {
    int at;
    const char *text;
};

static void write_set(const struct odd *odd, size_t odd_count)
{
    char text[SAMPLES * 96];
    size_t used = 0;
    snprintf(top, sizeof top, "%s", fv_test_euroc(fv_test_place));
    fv_test_make_folder(fv_test_path(top, "mav0/imu0"));
    fv_test_write_text(fv_test_path(top, "mav0/imu0/sensor.yaml"),
                       "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n"
                       "rate_hz: 200\ngyroscope_noise_density: 1e-4\n"
                       "gyroscope_random_walk: 2e-5\naccelerometer_noise_density: 2e-3\n"
                       "accelerometer_random_walk: 3e-3\n");
    for (int k = 0; k < SAMPLES; k++) {
        const char *instead = NULL;
        for (size_t i = 0; i < odd_count; i++)
            if (odd[i].at == k) instead = odd[i].text;
        used += (size_t)(instead != NULL
                             ? snprintf(text + used, sizeof text - used, "%s\n", instead)
                             : snprintf(text + used, sizeof text - used, "%lld,.%03d,0,0,9.8,0,0\n",
                                        first_ns + k * period_ns, k));
    }
    fv_test_write_text(fv_test_path(top, "mav0/imu0/data.csv"), text);
    snprintf(uri, sizeof uri, "%.200s?imu=1", top);
}

/* Play all and let the gate judge; returns how many samples came. */
static uint32_t play(struct fovea_imu_counts *counts)
{
    const struct fovea_source_ops *ops = &fv_source_euroc;
    struct fv_imu_gate_state state = {.any_step = 0};
    struct fv_imu_clean clean[FOVEA_INPUT_SAMPLES_MAX];
    struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX];
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error;
    struct fovea_imu_status status;
    uint32_t all = 0;
    if (ops->open(uri, &everything, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
    struct fv_imu_gate gate = {.rig = ops->info(source)->rig.imu, .state = &state, .clean = clean};
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        const uint32_t count = ops->samples(source, &frame, samples, FOVEA_INPUT_SAMPLES_MAX);
        fv_imu_gate_step(&gate, samples, count, frame.stamp_ns);
        ops->requeue(source, &frame);
        all += count;
    }
    ops->close(source);
    fv_imu_gate_status(&gate, &status);
    *counts = status.counts;
    fv_test_folder_remove(top);
    return all;
}

static void a_sound_set_is_taken_whole(void **state)
{
    struct fovea_imu_counts counts;
    (void)state;
    write_set(NULL, 0);
    assert_int_equal(play(&counts), SAMPLES);
    assert_true(counts.taken == SAMPLES && counts.gaps == 0 && counts.missing == 0);
}

/* Sample 20 is at ...677829376. */
static void repeated_and_late_ones_are_counted(void **state)
{
    const struct odd again = {21, "1403638538677829376,.020,0,0,9.8,0,0"},
                     late = {41, "1403638538682829376,.5,0,0,9.8,0,0"},
                     swapped[] = {{30, "1403638538732829376,.031,0,0,9.8,0,0"},
                                  {31, "1403638538727829376,.030,0,0,9.8,0,0"}};
    struct fovea_imu_counts counts;
    (void)state;
    write_set(&again, 1); /* in place of sample 21, which is missing then */
    assert_int_equal(play(&counts), SAMPLES);
    assert_true(counts.repeated == 1 && counts.taken == SAMPLES - 1 && counts.missing == 1);
    write_set(&late, 1);
    assert_int_equal(play(&counts), SAMPLES);
    assert_true(counts.late == 1 && counts.taken == SAMPLES - 1 && counts.missing == 1);
    write_set(swapped, 2);
    assert_int_equal(play(&counts), SAMPLES);
    assert_true(counts.late == 1 && counts.taken == SAMPLES - 1);
}

/* Wherever one stamp stands that is far from the others, it alone is refused; but at the ends,
 * where one sample shows no order. */
static void leaping_stamps_hold_nothing_up(void **state)
{
    static const char *const lines[] = {"0,.5,0,0,9.8,0,0", "-9000000000000000000,.5,0,0,9.8,0,0",
                                        "9000000000000000000,.5,0,0,9.8,0,0",
                                        "1403638541577829376,.5,0,0,9.8,0,0"};
    (void)state;
    for (int at = 2; at < SAMPLES - 1; at += (SAMPLES - 4) / 4)
        for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
            const struct odd leap = {at, lines[i]};
            struct fovea_imu_counts counts;
            write_set(&leap, 1);
            const uint32_t all = play(&counts);
            if (all != SAMPLES || counts.off_clock != 1 || counts.taken != SAMPLES - 1)
                fail_msg("sample %d, %s: %u came, %llu off the clock, %llu taken", at, lines[i],
                         all, (unsigned long long)counts.off_clock,
                         (unsigned long long)counts.taken);
        }
}

static void what_is_not_finite_is_counted(void **state)
{
    static const struct odd odd[] = {{5, "1403638538602829376,nan,0,0,9.8,0,0"},
                                     {6, "1403638538607829376,0,-NaN,0,9.8,0,0"},
                                     {17, "1403638538662829376,0,0,0,inf,0,0"},
                                     {33, "1403638538742829376,0,0,0,9.8,0,-Infinity"},
                                     {34, "1403638538747829376,0,0,1e300,9.8,0,0"}};
    struct fovea_imu_counts counts;
    (void)state;
    write_set(odd, sizeof odd / sizeof odd[0]);
    assert_int_equal(play(&counts), SAMPLES);
    assert_true(counts.not_finite == 5 && counts.taken == SAMPLES - 5 && counts.gaps == 3);
}

/* ---- when samples are due -------------------------------------------------------------------- */

/* The order of the list stays, none is due before the one before it, and those of the longest
 * rising row at their own stamp. */
static void due_by(const int64_t *stamps, const int64_t *expected, size_t count)
{
    struct fovea_sample list[16];
    struct fovea_error error;
    struct fv_due due;
    for (size_t i = 0; i < count; i++)
        list[i] = (struct fovea_sample){.kind = FOVEA_SAMPLE_IMU, .imu.stamp_ns = stamps[i]};
    assert_int_equal(fv_due_open(&due, list, count, "list", &error), FOVEA_OK);
    for (size_t i = 0; i < count; i++)
        if (fv_due_at(&due, i) != expected[i])
            fail_msg("sample %zu of %lld: found %lld, expected %lld", i, (long long)stamps[i],
                     (long long)fv_due_at(&due, i), (long long)expected[i]);
    fv_due_close(&due);
}

static void odd_stamps_are_due_between_their_neighbours(void **state)
{
    (void)state;
    due_by((int64_t[]){1, 2, 2, 5}, (int64_t[]){1, 2, 2, 5}, 4);
    due_by((int64_t[]){1, 2, 9, 3, 4}, (int64_t[]){1, 2, 3, 3, 4}, 5);
    due_by((int64_t[]){1, 2, 0, 3, 4}, (int64_t[]){1, 2, 2, 3, 4}, 5);
    due_by((int64_t[]){9, 1, 2, 3}, (int64_t[]){1, 1, 2, 3}, 4);
    due_by((int64_t[]){-9, 4, 5, -8, 6}, (int64_t[]){-9, 4, 5, 5, 6}, 5);
    due_by((int64_t[]){1, 2, 3, 90, 91, 4, 5, 6}, (int64_t[]){1, 2, 3, 4, 4, 4, 5, 6}, 8);
    due_by((int64_t[]){1, 2, 3, 90, 4, 0}, (int64_t[]){1, 2, 3, 4, 4, 4}, 6);
    due_by((int64_t[]){5}, (int64_t[]){5}, 1);
}

int main(void)
{
#define WITH_PLACE(name)                                                                           \
    cmocka_unit_test_setup_teardown(name, fv_test_place_set_up, fv_test_place_tear_down)
    const struct CMUnitTest tests[] = {
        WITH_PLACE(a_sound_set_is_taken_whole),
        WITH_PLACE(repeated_and_late_ones_are_counted),
        WITH_PLACE(leaping_stamps_hold_nothing_up),
        WITH_PLACE(what_is_not_finite_is_counted),
        cmocka_unit_test(odd_stamps_are_due_between_their_neighbours),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
