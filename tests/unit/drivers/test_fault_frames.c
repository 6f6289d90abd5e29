/* Faults of whole frames and of inertial samples (`fault:`): which frames and samples the source
 * gives, their order and their stamps. No other frame or sample is lost, and the same options give
 * the same run. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../../../drivers/clock.h"
#include "../../../drivers/fault/fault.h"
#include "../../../drivers/fault/samples.h"
#include "../../../drivers/table.h"

#define SIM "sim:orbit?width=96&height=64&imu=200&wheel_odometry=0&baseline=0.1&frames=40"
enum { FRAMES = 40, SAMPLES_MAX = 600, ALL_MAX = 100, FIRST = 10, LAST = 19 };
#define WINDOW "&first=10&shortest=10&longest=10&count=1" /* FIRST to LAST */

struct come {
    uint64_t index;
    int64_t stamp_ns;
    bool image[2];
    enum fovea_source_state state;
    uint32_t samples; /* up to and with this frame */
};

struct run {
    uint32_t count, samples;
    struct come come[ALL_MAX];
    struct fovea_imu_sample sample[SAMPLES_MAX];
    struct fovea_source_counts counts;
    uint64_t frame_count;
};

static struct run own, faulty, again;

static uint64_t sum_of(const struct fovea_frame *frame)
{
    uint64_t sum = 0;
    for (size_t i = 0; frame->images[0].data != NULL && i < frame->images[0].size_bytes; i++)
        sum = 31 * sum + frame->images[0].data[i];
    return sum;
}

/* Play all of a source; each frame's true pose is that of its index, and its picture stays while it
 * is held. `held_max`: frames that are held at once, the oldest goes back first. */
static void play_holding(const char *uri, uint32_t held_max, struct run *run)
{
    const struct fovea_source_selection all = {.step = 1};
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea_error error = {.text = ""};
    const char *address;
    struct fovea_frame frame, held[FOVEA_SOURCE_FRAMES_HELD];
    uint64_t sums[FOVEA_SOURCE_FRAMES_HELD];
    struct fovea_sample list[FOVEA_INPUT_SAMPLES_MAX];
    memset(run, 0, sizeof *run);
    if (fv_source_find(uri, &ops, &address, &error) != FOVEA_OK ||
        ops->open(address, &all, &source, &error) != FOVEA_OK ||
        ops->start(source, &error) != FOVEA_OK) {
        fail_msg("%s: %s", uri, error.text);
        return;
    }
    run->frame_count = ops->info(source)->frame_count;
    while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        held[run->count % held_max] = frame;
        sums[run->count % held_max] = sum_of(&frame);
        struct come *come = &run->come[run->count++];
        double T[12];
        assert_true(run->count < ALL_MAX);
        *come = (struct come){.index = frame.index,
                              .stamp_ns = frame.stamp_ns,
                              .image = {frame.images[0].data != NULL, frame.images[1].data != NULL},
                              .state = ops->state != NULL ? ops->state(source) : FOVEA_SOURCE_OK};
        assert_int_equal(frame.image_count, 2);
        assert_int_equal(ops->truth_pose(source, &frame, T), FOVEA_OK);
        const uint32_t count = ops->samples(source, &frame, list, FOVEA_INPUT_SAMPLES_MAX);
        for (uint32_t i = 0; i < count; i++) {
            assert_int_equal(list[i].kind, FOVEA_SAMPLE_IMU);
            assert_true(run->samples < SAMPLES_MAX);
            run->sample[run->samples++] = list[i].imu;
        }
        come->samples = run->samples;
        const uint32_t oldest = run->count % held_max;
        if (run->count < held_max) continue;
        assert_true(sum_of(&held[oldest]) == sums[oldest]);
        ops->requeue(source, &held[oldest]);
    }
    if (ops->counts != NULL) ops->counts(source, &run->counts);
    ops->stop(source);
    ops->close(source);
}

static void play(const char *uri, struct run *run)
{
    play_holding(uri, 1, run);
}

/* With faults, every third time twice, and once the source alone beside it. */
static void play_all(const char *faults)
{
    static int times;
    char uri[256];
    snprintf(uri, sizeof uri, "fault:%s?%s", SIM, faults);
    if (own.count == 0) play(SIM, &own);
    play(uri, &faulty);
    assert_int_equal(own.count, FRAMES);
    if (times++ % 3 != 0) return;
    play(uri, &again);
    assert_true(again.count == faulty.count && again.samples == faulty.samples);
    for (uint32_t i = 0; i < faulty.count; i++)
        assert_true(again.come[i].index == faulty.come[i].index &&
                    again.come[i].stamp_ns == faulty.come[i].stamp_ns &&
                    again.come[i].samples == faulty.come[i].samples);
    assert_memory_equal(again.sample, faulty.sample, faulty.samples * sizeof faulty.sample[0]);
}

/* A source within that has a frame at once, whatever the deadline, and no end: dropping them all
 * ends at the deadline, and goes on with the next call. */
static void dropping_ends_at_the_deadline(void **state)
{
    const struct fovea_source_selection all = {.step = 1};
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea_source_counts counts;
    struct fovea_error error;
    struct fovea_frame frame;
    const char *address;
    (void)state;
    assert_int_equal(fv_source_find("fault:sim:orbit?width=96&height=64?kind=drop&first=1&"
                                    "shortest=30&longest=30&count=1",
                                    &ops, &address, &error),
                     FOVEA_OK);
    assert_int_equal(ops->open(address, &all, &source, &error), FOVEA_OK);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_OK);
    ops->requeue(source, &frame);
    for (uint64_t dropped = 1; dropped <= 30; dropped++) {
        assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_AGAIN);
        ops->counts(source, &counts);
        assert_int_equal(counts.dropped, dropped);
    }
    assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_OK);
    assert_int_equal(frame.index, 31);
    ops->requeue(source, &frame);
    ops->stop(source);
    ops->close(source);
}

static bool in_window(uint64_t index)
{
    return index >= FIRST && index <= LAST;
}

static void what_is_dropped_does_not_come(void **state)
{
    (void)state;
    play_all("kind=drop" WINDOW);
    assert_int_equal(faulty.count, FRAMES - 10);
    assert_int_equal(faulty.counts.dropped, 10);
    assert_int_equal(faulty.frame_count, 0);
    for (uint32_t i = 0; i < faulty.count; i++)
        assert_int_equal(faulty.come[i].index, i < FIRST ? i : i + 10);
    assert_int_equal(faulty.samples, own.samples); /* they come with the next frame */
    assert_memory_equal(faulty.sample, own.sample, own.samples * sizeof own.sample[0]);
    play_all("kind=drop&shortest=1&longest=1&fraction=0.3&first=0");
    assert_in_range(faulty.count, FRAMES * 6 / 10, FRAMES * 8 / 10);
    play_all("kind=drop&first=5&fraction=1"); /* to the end */
    assert_int_equal(faulty.count, 5);
}

static void duplicates_come_twice(void **state)
{
    (void)state;
    play_all("kind=duplicate" WINDOW);
    assert_int_equal(faulty.count, FRAMES + 10);
    uint32_t at = 0;
    for (uint32_t i = 0; i < FRAMES; i++)
        for (int k = 0; k < (in_window(i) ? 2 : 1); k++, at++) {
            assert_int_equal(faulty.come[at].index, i);
            assert_true(faulty.come[at].stamp_ns == own.come[i].stamp_ns);
            assert_int_equal(faulty.come[at].samples, own.come[i].samples);
        }
    play_all("kind=duplicate,noise&first=0&fraction=1");
    assert_int_equal(faulty.count, 2 * FRAMES);
}

/* A delayed frame comes when the next is there, and so after that one's samples. */
static void delayed_frames_come_after_later_samples(void **state)
{
    (void)state;
    play_all("kind=delay" WINDOW);
    assert_int_equal(faulty.count, FRAMES);
    for (uint32_t i = 0; i < FRAMES; i++) {
        assert_int_equal(faulty.come[i].index, i);
        assert_true(faulty.come[i].stamp_ns == own.come[i].stamp_ns);
        assert_int_equal(faulty.come[i].samples, own.come[in_window(i) ? i + 1 : i].samples);
    }
    play_all("kind=delay&first=0&fraction=1"); /* the last has no next */
    assert_int_equal(faulty.count, FRAMES);
    assert_int_equal(faulty.samples, own.samples);
}

static void reordered_frames_change_places_in_pairs(void **state)
{
    (void)state;
    play_all("kind=reorder" WINDOW);
    assert_int_equal(faulty.count, FRAMES);
    for (uint32_t i = 0; i < FRAMES; i++)
        assert_int_equal(faulty.come[i].index, in_window(i) ? i ^ 1 : i);
    assert_int_equal(faulty.samples, own.samples);
    play_all("kind=reorder&first=39&fraction=1"); /* the last one, alone */
    assert_int_equal(faulty.count, FRAMES);
}

static void stamps_jitter_and_leap(void **state)
{
    (void)state;
    play_all("kind=jitter&spread=4" WINDOW);
    double sum = 0, most = 0;
    uint32_t early = 0, late = 0;
    for (uint32_t i = 0; i < FRAMES; i++) {
        const double off_ms = (double)(faulty.come[i].stamp_ns - own.come[i].stamp_ns) * 1e-6;
        assert_true(in_window(i) || off_ms == 0);
        sum += fabs(off_ms);
        most = fmax(most, fabs(off_ms));
        early += off_ms < 0;
        late += off_ms > 0;
    }
    assert_true(early >= 2 && late >= 2 && early + late == LAST - FIRST + 1); /* either way */
    assert_true(most <= 4 && sum > 8 && sum < 32);                            /* 20 expected */
    play_all("kind=jump&leap=-700" WINDOW);
    for (uint32_t i = 0; i < FRAMES; i++)
        assert_true(faulty.come[i].stamp_ns - own.come[i].stamp_ns ==
                    (in_window(i) ? -700000000 : 0));
}

static void stamps_are_held(void **state)
{
    (void)state;
    play_all("kind=hold" WINDOW);
    assert_int_equal(faulty.count, FRAMES);
    for (uint32_t i = 0; i < FRAMES; i++)
        assert_true(faulty.come[i].stamp_ns == own.come[in_window(i) ? FIRST - 1 : i].stamp_ns);
    play_all("kind=hold,jump&leap=-700&first=0&shortest=5&longest=5&count=1"); /* none before */
    for (uint32_t i = 0; i < FRAMES; i++)
        assert_true(faulty.come[i].stamp_ns ==
                    (i < 5 ? own.come[0].stamp_ns - 700000000 : own.come[i].stamp_ns));
}

/* Frames without pictures, so that the loop goes on by the clock of the source and with samples. */
static void unplugged_cameras_give_no_picture(void **state)
{
    (void)state;
    play_all("kind=unplug" WINDOW);
    assert_int_equal(faulty.count, FRAMES);
    assert_int_equal(faulty.samples, own.samples);
    assert_int_equal(faulty.counts.recovered, 1);
    for (uint32_t i = 0; i < FRAMES; i++) {
        const struct come *come = &faulty.come[i];
        assert_true(come->stamp_ns == own.come[i].stamp_ns);
        assert_true(come->image[0] == !in_window(i) && come->image[1] == !in_window(i));
        assert_int_equal(come->state == FOVEA_SOURCE_GONE, in_window(i));
    }
    for (int camera = 1; camera <= 2; camera++) {
        char text[128];
        snprintf(text, sizeof text, "kind=unplug&camera=%d%s", camera, WINDOW);
        play_all(text);
        for (uint32_t i = 0; i < FRAMES; i++) {
            assert_true(faulty.come[i].image[0] == !(camera == 1 && in_window(i)));
            assert_true(faulty.come[i].image[1] == !(camera == 2 && in_window(i)));
            assert_int_not_equal(faulty.come[i].state, FOVEA_SOURCE_GONE);
        }
    }
}

/* ---- samples --------------------------------------------------------------------------------- */

/* Samples [begin, end) are those that come with the frames of the window. */
static void window_of(uint32_t *begin, uint32_t *end)
{
    *begin = own.come[FIRST - 1].samples;
    *end = own.come[LAST].samples;
    assert_in_range(*end - *begin, 60, 70);
}

static bool alike(const struct fovea_imu_sample *a, const struct fovea_imu_sample *b)
{
    bool same = true;
    for (int i = 0; i < 3; i++)
        same = same && a->gyro[i] == b->gyro[i] && a->acceleration[i] == b->acceleration[i];
    return same;
}

static void single_samples_are_struck(void **state)
{
    uint32_t begin, end, at = 0, gone = 0, twice = 0, swapped = 0, broken = 0;
    (void)state;
    play_all("kind=imu_drop&chance=0.3" WINDOW);
    window_of(&begin, &end);
    for (uint32_t i = 0; i < own.samples; i++) {
        if (at < faulty.samples && faulty.sample[at].stamp_ns == own.sample[i].stamp_ns) {
            assert_true(alike(&faulty.sample[at++], &own.sample[i]));
            continue;
        }
        assert_in_range(i, begin, end - 1);
        gone++;
    }
    assert_true(at == faulty.samples && gone > 10 && gone < 32);

    play_all("kind=imu_repeat&chance=0.3" WINDOW);
    at = 0;
    for (uint32_t i = 0; i < own.samples; i++) {
        assert_memory_equal(&faulty.sample[at], &own.sample[i], sizeof own.sample[i]);
        at++;
        if (at >= faulty.samples || faulty.sample[at].stamp_ns != own.sample[i].stamp_ns) continue;
        assert_memory_equal(&faulty.sample[at], &own.sample[i], sizeof own.sample[i]);
        assert_in_range(i, begin, end - 1);
        at++;
        twice++;
    }
    assert_true(at == faulty.samples && twice > 10 && twice < 32);

    play_all("kind=imu_swap,imu_nan&chance=0.3" WINDOW);
    assert_int_equal(faulty.samples, own.samples);
    for (uint32_t i = 0; i < own.samples; i++) {
        const struct fovea_imu_sample *s = &faulty.sample[i];
        swapped += i > 0 && s->stamp_ns < faulty.sample[i - 1].stamp_ns;
        const bool nan = isnan(s->gyro[0]) || isnan(s->gyro[1]) || isnan(s->gyro[2]);
        broken += nan;
        assert_true(!nan || (i >= begin && i < end));
    }
    assert_true(swapped > 5 && swapped < 25 && broken > 10 && broken < 32);
}

static void values_and_stamps_are_spoiled(void **state)
{
    uint32_t begin, end;
    double step[6] = {0};
    (void)state;
    play_all("kind=imu_bias&gyro=0.2&acceleration=3" WINDOW);
    window_of(&begin, &end);
    for (uint32_t i = 0; i < own.samples; i++)
        for (int k = 0; k < 6; k++) {
            const double off =
                k < 3 ? faulty.sample[i].gyro[k] - own.sample[i].gyro[k]
                      : faulty.sample[i].acceleration[k - 3] - own.sample[i].acceleration[k - 3];
            if (i == begin) step[k] = off;
            assert_true(i < begin || i >= end ? off == 0 : fabs(off - step[k]) < 1e-12);
        }
    assert_true(fabs(hypot(hypot(step[0], step[1]), step[2]) - 0.2) < 1e-12);
    assert_true(fabs(hypot(hypot(step[3], step[4]), step[5]) - 3) < 1e-12);

    play_all("kind=imu_saturate&gyro_end=0.05&acceleration_end=5" WINDOW);
    for (uint32_t i = 0; i < own.samples; i++)
        for (int k = 0; k < 3; k++) {
            const bool struck = i >= begin && i < end;
            const double gyro = own.sample[i].gyro[k], a = own.sample[i].acceleration[k];
            assert_true(faulty.sample[i].gyro[k] ==
                        (struck ? fmax(-0.05, fmin(0.05, gyro)) : gyro));
            assert_true(faulty.sample[i].acceleration[k] == (struck ? fmax(-5, fmin(5, a)) : a));
        }

    play_all("kind=imu_stuck" WINDOW);
    for (uint32_t i = 0; i < own.samples; i++) {
        const uint32_t as = i >= begin && i < end ? begin - 1 : i;
        assert_true(alike(&faulty.sample[i], &own.sample[as]));
        assert_true(faulty.sample[i].stamp_ns == own.sample[i].stamp_ns);
    }

    play_all("kind=imu_jump&leap=250" WINDOW);
    for (uint32_t i = 0; i < own.samples; i++)
        assert_true(faulty.sample[i].stamp_ns - own.sample[i].stamp_ns ==
                    (i >= begin && i < end ? 250000000 : 0));

    play_all("kind=imu_unplug" WINDOW);
    assert_int_equal(faulty.samples, own.samples - (end - begin));
    assert_int_equal(faulty.count, FRAMES); /* pictures are whole */
}

/* The call for the first frame of each fault does not return in time; all frames come as they are.
 */
static void a_call_stalls(void **state)
{
    const struct fovea_source_selection all = {.step = 1};
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea_error error = {.text = ""};
    const char *address;
    struct fovea_frame frame;
    enum { WAIT_MS = 60 };
    (void)state;
    assert_int_equal(
        fv_source_find("fault:" SIM "?kind=stall&wait=60" WINDOW, &ops, &address, &error),
        FOVEA_OK);
    assert_int_equal(ops->open(address, &all, &source, &error), FOVEA_OK);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    uint32_t count = 0;
    int64_t before_ns = fv_clock_ns(CLOCK_MONOTONIC), took_ns = 0, least_ns = INT64_MAX;
    while (ops->dequeue(source, 0, &frame) == FOVEA_OK) {
        const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
        if (frame.index == FIRST) took_ns = now_ns - before_ns;
        if (frame.index > FIRST && frame.index <= LAST && now_ns - before_ns < least_ns)
            least_ns = now_ns - before_ns;
        assert_true(frame.images[0].data != NULL && frame.index == count);
        count++;
        ops->requeue(source, &frame);
        before_ns = now_ns;
    }
    assert_int_equal(count, FRAMES);
    assert_true(took_ns >= WAIT_MS * 1000000);
    assert_true(least_ns < WAIT_MS * 1000000); /* those behind it do not wait */
    ops->stop(source);
    ops->close(source);
}

/* A fault upon a fault: each with its schedule. */
static void faults_stand_in_each_other(void **state)
{
    (void)state;
    play(SIM, &own);
    play("fault:fault:" SIM "?kind=unplug" WINDOW "?kind=drop&first=30&fraction=1", &faulty);
    assert_int_equal(faulty.count, 30);
    for (uint32_t i = 0; i < 30; i++)
        assert_true(faulty.come[i].image[0] == !in_window(i));
}

/* Faults that keep a frame back, or give it again, upon each other and under a program that holds
 * as many frames as it may: none waits for ever for the other, and every frame comes. */
static void faults_that_keep_frames_stand_in_each_other(void **state)
{
    static const char *const kinds[] = {"duplicate", "delay", "reorder"};
    (void)state;
    for (uint32_t i = 0; i < 9; i++) {
        for (uint32_t held = 1; held <= FOVEA_SOURCE_FRAMES_HELD; held++) {
            bool came[FRAMES] = {false};
            char uri[256];
            (void)snprintf(uri, sizeof uri, "fault:fault:" SIM "?kind=%s" WINDOW "?kind=%s" WINDOW,
                           kinds[i % 3], kinds[i / 3]);
            play_holding(uri, held, &faulty);
            for (uint32_t k = 0; k < faulty.count; k++)
                came[faulty.come[k].index] = true;
            for (uint32_t k = 0; k < FRAMES; k++)
                assert_true(came[k]);
            assert_int_equal(faulty.count, i == 0                ? FRAMES + 3 * (LAST - FIRST + 1)
                                           : i < 3 || i % 3 == 0 ? FRAMES + (LAST - FIRST + 1)
                                                                 : FRAMES);
        }
    }
}

static void what_the_source_has_not_is_refused(void **state)
{
    static const char *const wrong[][2] = {
        {"sim:orbit?kind=imu_drop", "expected a source that has one (sim: imu=200"},
        {"sim:orbit?kind=black&camera=2", "fault: camera: found 2, expected at most 1"},
        {"sim:orbit?kind=jump&leap=1e9", "fault: leap: found '1e9'"},
        {"sim:orbit?kind=imu_dropp", "fault: kind: found 'imu_dropp'"},
        {"fault:fault:sim:orbit?kind=delay?kind=reorder?kind=delay",
         "found delay or reorder in more than 2 faults upon each other"},
    };
    const struct fovea_source_selection all = {.step = 1};
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct fovea_source *source;
        struct fovea_error error = {.text = ""};
        assert_int_equal(fv_source_fault.open(wrong[i][0], &all, &source, &error),
                         FOVEA_ERROR_INPUT);
        if (strstr(error.text, wrong[i][1]) == NULL) fail_msg("%s: %s", wrong[i][0], error.text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_dropped_does_not_come),
        cmocka_unit_test(dropping_ends_at_the_deadline),
        cmocka_unit_test(duplicates_come_twice),
        cmocka_unit_test(delayed_frames_come_after_later_samples),
        cmocka_unit_test(reordered_frames_change_places_in_pairs),
        cmocka_unit_test(stamps_jitter_and_leap),
        cmocka_unit_test(stamps_are_held),
        cmocka_unit_test(unplugged_cameras_give_no_picture),
        cmocka_unit_test(single_samples_are_struck),
        cmocka_unit_test(values_and_stamps_are_spoiled),
        cmocka_unit_test(a_call_stalls),
        cmocka_unit_test(faults_stand_in_each_other),
        cmocka_unit_test(faults_that_keep_frames_stand_in_each_other),
        cmocka_unit_test(what_the_source_has_not_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
