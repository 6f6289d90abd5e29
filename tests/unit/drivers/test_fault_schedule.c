/* Faults on demand: which frames a schedule strikes, and which options and kinds are taken. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "../../../drivers/fault/fault.h"

/* ---- schedule -------------------------------------------------------------------------------- */

static struct fv_fault_options options_of(const char *text)
{
    struct fv_fault_options options;
    struct fovea_error error = {.text = ""};
    if (fv_fault_options_parse(text, &options, &error) != FOVEA_OK)
        fail_msg("%s: %s", text, error.text);
    return options;
}

static void schedule_is_the_same_in_any_order(void **state)
{
    enum { FRAMES = 3000 };
    static bool rising[FRAMES];
    static uint64_t seeds[FRAMES];
    (void)state;
    const struct fv_fault_options options = options_of("kind=black&seed=9&first=7");
    struct fv_fault_schedule schedule;
    struct fv_fault_window window;
    fv_fault_schedule_open(&schedule, &options);
    for (uint64_t i = 0; i < FRAMES; i++) {
        rising[i] = fv_fault_schedule_at(&schedule, i, &window);
        seeds[i] = rising[i] ? window.seed : 0;
        assert_true(!rising[i] || (i >= window.begin && i < window.end));
    }
    for (uint64_t n = 0; n < FRAMES; n++) { /* falling, and then by leaps */
        const uint64_t at[] = {FRAMES - 1 - n, n * 1777 % FRAMES};
        for (int k = 0; k < 2; k++) {
            assert_int_equal(fv_fault_schedule_at(&schedule, at[k], &window), rising[at[k]]);
            if (rising[at[k]]) assert_true(window.seed == seeds[at[k]]);
        }
    }
}

/* Lengths of the faults among `frames` frames, at most 64 of them. Returns their number. */
static int windows_of(const char *text, uint64_t frames, uint64_t lengths[64], uint64_t *faulty)
{
    const struct fv_fault_options options = options_of(text);
    struct fv_fault_schedule schedule;
    struct fv_fault_window window;
    uint64_t last_begin = UINT64_MAX;
    int count = 0;
    *faulty = 0;
    fv_fault_schedule_open(&schedule, &options);
    for (uint64_t i = 0; i < frames; i++) {
        if (!fv_fault_schedule_at(&schedule, i, &window)) continue;
        ++*faulty;
        if (window.begin == last_begin) continue;
        last_begin = window.begin;
        if (count < 64) lengths[count++] = window.end - window.begin;
    }
    return count;
}

static void schedule_keeps_what_the_options_say(void **state)
{
    uint64_t lengths[64], faulty, longest = 0, shortest = 1000;
    (void)state;
    assert_int_equal(
        windows_of("kind=black&first=40&shortest=15&longest=15&count=1", 5000, lengths, &faulty),
        1);
    assert_int_equal(faulty, 15);
    const struct fv_fault_options options =
        options_of("kind=black&first=40&shortest=15&longest=15");
    struct fv_fault_schedule schedule;
    struct fv_fault_window window;
    fv_fault_schedule_open(&schedule, &options);
    assert_false(fv_fault_schedule_at(&schedule, 39, &window));
    assert_true(fv_fault_schedule_at(&schedule, 40, &window));
    assert_int_equal(windows_of("kind=black&count=3", 100000, lengths, &faulty), 3);
    (void)windows_of("kind=black&fraction=0.3&first=0", 200000, lengths, &faulty);
    assert_true(faulty > 58000 && faulty < 62000);
    for (int i = 0; i < 64; i++) {
        if (lengths[i] > longest) longest = lengths[i];
        if (lengths[i] < shortest) shortest = lengths[i];
    }
    assert_in_range(shortest, 5, 7);
    assert_in_range(longest, 28, 30);
    (void)windows_of("kind=black&fraction=1&first=10", 1000, lengths, &faulty);
    assert_int_equal(faulty, 990);
    uint64_t other;
    (void)windows_of("kind=black&seed=2&first=0", 5000, lengths, &other);
    (void)windows_of("kind=black&seed=3&first=0", 5000, lengths, &faulty);
    assert_int_not_equal(other, faulty);
}

static void a_kind_may_stand_with_its_fraction(void **state)
{
    (void)state;
    const struct fv_fault_options brief = options_of("seed=3&drop=0.1&first=7"),
                                  whole = options_of("seed=3&kind=drop&fraction=0.1&first=7");
    assert_true(brief.kinds == whole.kinds && brief.fraction == whole.fraction);
    assert_true(brief.fraction == 0.1 && brief.first == 7 && brief.seed == 3);
}

static void wrong_options_are_refused_in_one_line(void **state)
{
    static const char *const wrong[][2] = {
        {"", "kind: found none"},
        {"seed=1", "kind: found none"},
        {"kind=", "kind: found ''"},
        {"kind=blurr", "kind: found 'blurr'"},
        {"kind=blur,", "kind: found 'blur,'"},
        {"kind=blur,,black", "kind: found"},
        {"kind=blur&kind=black", "kind: found a second time"},
        {"drop=0.1&blur=0.1", "blur: found beside another kind"},
        {"drop=0.1&kind=blur", "drop: found beside another kind"},
        {"fraction=0.2&drop=0.1", "drop: found beside another kind or fraction"},
        {"drop=2", "drop: found"},
        {"drop=", "drop: found ''"},
        {"drop", "drop: found"},
        {"kind=blur&fraction=0", "fraction: found '0'"},
        {"kind=blur&shortest=0", "shortest: found '0'"},
        {"kind=blur&shortest=9&longest=8", "longest: found 8"},
        {"kind=blur&sigma=21", "sigma: found '21'"},
        {"kind=blur&length=1", "length: found '1'"},
        {"kind=blur&sigmas=2", "did you mean 'sigma'"},
        {"kind=reorder,duplicate", "kind: found duplicate beside reorder, where it does nothing"},
        {"kind=duplicate,delay", "kind: found duplicate beside delay, where"},
        {"kind=delay,blur,reorder", "kind: found reorder beside delay, where"},
        {"kind=drop,imu_nan", "kind: found imu_nan beside drop, where"},
        {"kind=noise,drop", "kind: found noise beside drop, where"},
        {"kind=unplug,drop", "kind: found unplug beside drop, where"},
        {"kind=unplug,partial&camera=2", "kind: found partial beside unplug, where"},
        {"kind=freeze,black", "kind: found freeze beside black, where"},
        {"kind=black,noise,white", "kind: found black beside white, where"},
        {"kind=imu_bias,imu_stuck", "kind: found imu_bias beside imu_stuck, where"},
        {"kind=imu_unplug,imu_nan", "kind: found imu_nan beside imu_unplug, where"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct fv_fault_options options;
        struct fovea_error error = {.text = ""};
        if (fv_fault_options_parse(wrong[i][0], &options, &error) != FOVEA_ERROR_INPUT)
            fail_msg("[%s] was taken", wrong[i][0]);
        if (strstr(error.text, "fault: ") != error.text ||
            strstr(error.text, wrong[i][1]) == NULL || strchr(error.text, '\n') != NULL)
            fail_msg("[%s]: [%s]", wrong[i][0], error.text);
    }
}

/* Kinds that each leave something of the others stand together. */
static void kinds_that_add_up_are_taken(void **state)
{
    static const char *const right[] = {"kind=black,occlusion,noise,partial,jitter,delay,imu_nan",
                                        "kind=duplicate,jump,white,imu_saturate,imu_bias",
                                        "kind=unplug,jitter,reorder,imu_stuck,imu_nan",
                                        "kind=imu_unplug,freeze,recompress"};
    (void)state;
    for (size_t i = 0; i < sizeof right / sizeof right[0]; i++)
        (void)options_of(right[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(schedule_is_the_same_in_any_order),
        cmocka_unit_test(schedule_keeps_what_the_options_say),
        cmocka_unit_test(a_kind_may_stand_with_its_fraction),
        cmocka_unit_test(wrong_options_are_refused_in_one_line),
        cmocka_unit_test(kinds_that_add_up_are_taken),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
