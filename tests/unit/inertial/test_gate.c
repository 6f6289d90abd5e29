/* The gate of inertial samples: what each fault is counted as and named, that the clean samples
 * are the sensor's own in rising order, and a campaign over seeded mixtures of all faults. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/elementary.h"
#include "inertial/gate.h"

enum { HZ = 200, PER_STEP = 10, STREAM_MAX = 2400, CAMPAIGN_SEEDS = 400 };

static const int64_t period_ns = 1000000000 / HZ, begin_ns = 5000000000;

static _Alignas(64) uint8_t memory[1 << 16];
static struct fv_imu_gate gate;
static struct fovea_imu_status status;
static struct fv_imu_clean passed[2 * STREAM_MAX];
static uint32_t passed_count;
static int64_t now_ns;

static void open_gate(const struct fovea_rig_imu *rig)
{
    struct fv_arena arenas[2];
    fv_arena_init(&arenas[0], memory, sizeof memory / 2);
    fv_arena_init(&arenas[1], memory + sizeof memory / 2, sizeof memory / 2);
    fv_imu_gate_carve(&gate, rig, &arenas[0], &arenas[1]);
    assert_false(arenas[0].exhausted || arenas[1].exhausted);
    passed_count = 0;
    now_ns = begin_ns;
}

static const struct fovea_rig_imu usual = {.rate_hz = HZ, .gyro_noise = 1e-4};

/* Sample n of a sensor that works: no two are alike. */
static struct fovea_sample sound(uint64_t n)
{
    struct fovea_sample sample = {.kind = FOVEA_SAMPLE_IMU,
                                  .imu.stamp_ns = begin_ns + (int64_t)n * period_ns};
    struct fv_random random;
    fv_random_seed(&random, n);
    for (int i = 0; i < 3; i++) {
        sample.imu.gyro[i] = 0.3 * fv_random_normal(&random);
        sample.imu.acceleration[i] = (i == 2 ? 9.8 : 0) + 0.5 * fv_random_normal(&random);
    }
    return sample;
}

static void step(const struct fovea_sample *samples, uint32_t count, int64_t at_ns)
{
    now_ns = at_ns;
    fv_imu_gate_step(&gate, samples, count, now_ns);
    for (uint32_t i = 0; i < gate.count; i++)
        passed[passed_count++] = gate.clean[i];
    fv_imu_gate_status(&gate, &status);
}

/* A stream in steps of PER_STEP, the time of a step being the true one of its last sample. */
static void steps(const struct fovea_sample *samples, uint32_t count)
{
    for (uint32_t i = 0; i < count; i += PER_STEP)
        step(samples + i, count - i < PER_STEP ? count - i : PER_STEP,
             begin_ns + (int64_t)(i + PER_STEP - 1) * period_ns);
}

static uint64_t all_counted(void)
{
    const struct fovea_imu_counts *c = &status.counts;
    return c->taken + c->repeated + c->late + c->not_finite + c->saturated + c->frozen +
           c->off_clock;
}

static struct fovea_sample stream[2 * STREAM_MAX];

static void make_stream(uint32_t count)
{
    for (uint32_t n = 0; n < count; n++)
        stream[n] = sound(n);
}

static void a_sound_sensor_passes_whole(void **state)
{
    (void)state;
    open_gate(&usual);
    make_stream(2000);
    steps(stream, 2000);
    assert_int_equal(status.state, FOVEA_IMU_OK);
    assert_int_equal(status.counts.taken, 2000);
    assert_int_equal(all_counted(), 2000);
    assert_int_equal(status.counts.missing + status.counts.gaps + status.counts.jumps, 0);
    assert_true(fabs(status.rate_hz - HZ) < 1e-6);
    for (uint32_t n = 0; n < 2000; n++) {
        assert_memory_equal(&passed[n].sample, &stream[n].imu, sizeof stream[n].imu);
        assert_int_equal(passed[n].notes, n == 0 ? FV_IMU_AFTER_JUMP : 0);
    }
}

/* Stamps that a bus makes uneven are no loss, at nominal rates that are wrong by a few percent
 * either, and at none. */
static void jitter_is_no_loss(void **state)
{
    (void)state;
    static const double rates[] = {HZ, 0.96 * HZ, 1.04 * HZ, 0};
    for (int r = 0; r < 4; r++) {
        struct fovea_rig_imu rig = usual;
        struct fv_random random;
        rig.rate_hz = rates[r];
        open_gate(&rig);
        make_stream(2000);
        fv_random_seed(&random, 3);
        for (uint32_t n = 0; n < 2000; n++)
            stream[n].imu.stamp_ns +=
                (int64_t)((fv_random_unit(&random) - 0.5) * 0.5 * (double)period_ns);
        steps(stream, 2000);
        assert_int_equal(status.counts.taken, 2000);
        assert_int_equal(status.counts.missing, 0);
        assert_true(fabs(status.rate_hz / HZ - 1) < 0.05);
    }
}

static void what_is_missing_is_counted(void **state)
{
    (void)state;
    for (int stated = 0; stated < 2; stated++) {
        struct fovea_rig_imu rig = usual;
        rig.rate_hz = stated ? HZ : 0;
        open_gate(&rig);
        make_stream(1000);
        uint32_t kept = 0, lost = 0;
        for (uint32_t n = 0; n < 1000; n++) {
            const bool gone = n == 300 || n == 500 || n == 501 || (n >= 700 && n < 740);
            if (gone) lost++;
            if (!gone) stream[kept++] = sound(n);
        }
        for (uint32_t i = 0; i < kept; i++) /* with the time of its own stamp */
            step(&stream[i], 1, stream[i].imu.stamp_ns);
        assert_int_equal(status.counts.missing, lost);
        assert_int_equal(status.counts.gaps, 3);
        assert_int_equal(passed[300].notes, FV_IMU_AFTER_GAP);
        assert_int_equal(passed[300].lacking, 1);
        assert_int_equal(passed[499].lacking, 2);
        assert_int_equal(passed[697].lacking, 40);
    }
}

/* A tenth lost at random: counted to a few, at a nominal rate and at none; then half of the rate,
 * which counts as loss only where another is stated. */
static void a_lossy_sensor_is_counted(void **state)
{
    (void)state;
    for (int stated = 0; stated < 2; stated++) {
        struct fovea_rig_imu rig = usual;
        struct fv_random random;
        uint32_t lost = 0;
        rig.rate_hz = stated ? HZ : 0;
        open_gate(&rig);
        fv_random_seed(&random, 5);
        for (uint32_t n = 0; n < 2000; n++) {
            const struct fovea_sample sample = sound(n);
            const bool gone = n > 20 && n < 1999 && fv_random_below(&random, 10) == 0;
            lost += gone;
            if (!gone) step(&sample, 1, sample.imu.stamp_ns);
        }
        assert_in_range(status.counts.missing, lost - 3, lost + 3);
        assert_true(fabs(status.rate_hz / HZ - 1) < 0.02);
        const uint64_t before = status.counts.missing;
        for (uint32_t n = 2000; n < 4000; n += 2) {
            const struct fovea_sample sample = sound(n);
            step(&sample, 1, sample.imu.stamp_ns);
        }
        assert_true(fabs(status.rate_hz / HZ - 0.5) < 0.01);
        assert_true(stated ? status.counts.missing - before > 900
                           : status.counts.missing - before < 150);
    }
}

static void repeated_and_late_ones_are_refused(void **state)
{
    (void)state;
    struct fovea_sample list[8];
    open_gate(&usual);
    make_stream(8);
    list[0] = stream[0], list[1] = stream[1], list[2] = stream[1];
    list[3] = stream[3], list[4] = stream[2], list[5] = stream[4];
    list[6] = stream[4], list[6].imu.gyro[1] += 1; /* the same stamp, another value */
    list[7] = stream[5];
    step(list, 8, stream[5].imu.stamp_ns);
    assert_int_equal(status.counts.repeated, 1);
    assert_int_equal(status.counts.late, 2);
    assert_int_equal(status.counts.taken, 5);
    assert_int_equal(status.counts.missing, 1); /* the one that came late was missed */
    assert_int_equal(passed[2].notes, FV_IMU_AFTER_GAP);
    assert_int_equal(status.state, FOVEA_IMU_OK);
}

static void no_number_is_refused(void **state)
{
    (void)state;
    const double bad[] = {NAN, INFINITY, -INFINITY, 1e300, -2e5};
    open_gate(&usual);
    make_stream(60);
    for (uint32_t i = 0; i < 30; i++) {
        double *values = i % 2 != 0 ? stream[20 + i].imu.gyro : stream[20 + i].imu.acceleration;
        values[i % 3] = bad[i % 5];
    }
    steps(stream, 50);
    assert_int_equal(status.state, FOVEA_IMU_NOT_FINITE);
    assert_int_equal(status.counts.not_finite, 30);
    assert_int_equal(passed_count, 20);
    steps(stream + 50, 0);
    step(stream + 50, 10, stream[59].imu.stamp_ns);
    assert_int_equal(status.state, FOVEA_IMU_OK);
    assert_int_equal(passed[20].notes, FV_IMU_AFTER_GAP);
    assert_int_equal(passed[20].lacking, 30);
    assert_int_equal(status.counts.missing, 0);
}

/* By the range that the rig states, and by the one that is learned. */
static void the_end_of_a_range_is_seen(void **state)
{
    (void)state;
    struct fovea_rig_imu rig = usual;
    rig.gyro_range = 8.7;
    open_gate(&rig);
    make_stream(400);
    for (uint32_t n = 100; n < 120; n++)
        stream[n].imu.gyro[1] = n % 2 ? -8.7 : 8.6999;
    steps(stream, 400);
    assert_int_equal(status.counts.saturated, 20);
    assert_int_equal(passed[100].lacking, 20);

    open_gate(&usual);
    make_stream(600);
    for (uint32_t n = 100; n < 120; n++) /* the first three are not yet known for what they are */
        stream[n].imu.acceleration[0] = -39.2;
    for (uint32_t n = 300; n < 310; n++)
        stream[n].imu.acceleration[2] = 39.2;
    stream[500].imu.acceleration[2] = 50; /* so it was not the end */
    stream[510].imu.acceleration[2] = 39.2;
    steps(stream, 600);
    assert_int_equal(status.counts.saturated, 17 + 10);
    assert_int_equal(status.counts.taken, 600 - 27);

    rig = usual;
    rig.acceleration_range = 100; /* it stops before its numbers do */
    open_gate(&rig);
    make_stream(400);
    for (uint32_t n = 100; n < 120; n++)
        stream[n].imu.acceleration[0] = -39.2;
    steps(stream, 400);
    assert_int_equal(status.counts.saturated, 17);
    assert_string_equal(fovea_imu_state_name((enum fovea_imu_state)99), "unknown");
}

static void a_frozen_sensor_is_named(void **state)
{
    (void)state;
    open_gate(&usual);
    make_stream(400);
    for (uint32_t n = 100; n < 200; n++) {
        const int64_t stamp_ns = stream[n].imu.stamp_ns;
        stream[n] = stream[99];
        stream[n].imu.stamp_ns = stamp_ns;
    }
    steps(stream, 200);
    assert_int_equal(status.state, FOVEA_IMU_FROZEN);
    assert_int_equal(status.counts.frozen, 100 - 19); /* a tenth of a second is not enough */
    steps(stream, 0);
    for (uint32_t i = 200; i < 400; i += PER_STEP)
        step(stream + i, PER_STEP, stream[i + PER_STEP - 1].imu.stamp_ns);
    assert_int_equal(status.state, FOVEA_IMU_OK);
    assert_int_equal(passed[119].notes, FV_IMU_AFTER_GAP);
    assert_int_equal(passed[119].lacking, 81);

    const struct fovea_rig_imu ideal = {.rate_hz = HZ}; /* without noise it may stand */
    open_gate(&ideal);
    for (uint32_t n = 0; n < 400; n++) {
        stream[n] = sound(0);
        stream[n].imu.stamp_ns = begin_ns + (int64_t)n * period_ns;
    }
    steps(stream, 400);
    assert_int_equal(status.counts.taken, 400);
}

static void silence_is_named_and_ends(void **state)
{
    (void)state;
    open_gate(&usual);
    make_stream(300);
    step(NULL, 0, begin_ns - 1);
    assert_int_equal(status.state, FOVEA_IMU_SILENT);
    steps(stream, 100);
    assert_int_equal(status.state, FOVEA_IMU_OK);
    for (int i = 1; i <= 10; i++) {
        step(NULL, 0, begin_ns + (100 + 10 * i) * period_ns);
        assert_int_equal(status.state, i > 3 ? FOVEA_IMU_SILENT : FOVEA_IMU_OK);
    }
    step(stream + 200, 1, begin_ns + 200 * period_ns);
    assert_int_equal(status.state, FOVEA_IMU_OK);
    assert_int_equal(passed[100].lacking, 100);
}

/* The sensor's clock leaps by `leap_ns` after 200 of 600 samples. */
static void leap(int64_t leap_ns)
{
    open_gate(&usual);
    make_stream(600);
    for (uint32_t n = 200; n < 600; n++)
        stream[n].imu.stamp_ns += leap_ns;
    steps(stream, 600);
}

static void a_clock_that_leaps_is_followed(void **state)
{
    (void)state;
    static const int64_t leaps_ns[] = {-800000000, -300000000, 400000000, 900000000};
    for (int i = 0; i < 4; i++) {
        leap(leaps_ns[i]);
        assert_int_equal(status.state, FOVEA_IMU_OK);
        assert_int_equal(status.counts.jumps, 1);
        assert_int_equal(all_counted(), 600);
        assert_in_range(status.counts.taken, 350, 560);
        uint32_t at = 200; /* of the first that is clean after it */
        while (at < passed_count && passed[at].notes != FV_IMU_AFTER_JUMP)
            at++;
        assert_in_range(at, 200, 200);
    }
    /* More than a second off, the samples say nothing about these frames. */
    static const int64_t far_ns[] = {-3000000000, 3000000000, INT64_MIN / 2, INT64_MAX / 2};
    for (int i = 0; i < 4; i++) {
        leap(far_ns[i]);
        assert_int_equal(status.state, FOVEA_IMU_OFF_CLOCK);
        assert_int_equal(status.counts.off_clock, 400);
        assert_int_equal(passed_count, 200);
    }
}

/* One stamp that is wrong costs one sample. */
static void a_wrong_stamp_costs_one_sample(void **state)
{
    (void)state;
    static const int64_t wrong_ns[] = {-500000000, 500000000, 20000000000, INT64_MAX / 2};
    for (int i = 0; i < 4; i++) {
        open_gate(&usual);
        make_stream(600);
        stream[300].imu.stamp_ns += wrong_ns[i];
        steps(stream, 600);
        assert_int_equal(status.counts.taken, 599);
        assert_int_equal(status.counts.missing, 1);
        assert_int_equal(status.counts.jumps, 0);
    }
}

/* The time offset takes the sensor's clock to the frames'; other kinds are none of the gate's. */
static void the_time_offset_counts(void **state)
{
    (void)state;
    struct fovea_rig_imu rig = usual;
    rig.time_offset_ns = -7000000000;
    open_gate(&rig);
    make_stream(100);
    for (uint32_t n = 0; n < 100; n++)
        stream[n].imu.stamp_ns += 7000000000;
    stream[50].kind = FOVEA_SAMPLE_WHEEL_ODOMETRY;
    steps(stream, 100);
    assert_int_equal(status.counts.taken, 99);
    assert_int_equal(status.counts.missing, 1);
    assert_true(status.stamp_ns == stream[99].imu.stamp_ns);
}

/* ---- campaign -------------------------------------------------------------------------------- */

enum fault { DROP, REPEAT, SWAP, ABSURD, FREEZE, SATURATE, STAMP, FAULTS };

/* Append sample n with a fault, or without; returns how many were appended. */
static uint32_t append(struct fv_random *random, uint64_t n, enum fault fault, uint32_t count)
{
    struct fovea_sample *at = &stream[count];
    *at = sound(n);
    switch (fault) {
    case DROP:
        return 0;
    case REPEAT:
        at[1] = at[0];
        return 2;
    case SWAP:
        at[1] = at[0];
        at[0] = sound(n + 1);
        return 2;
    case ABSURD:
        at->any.values[fv_random_below(random, 6)] = fv_random_below(random, 2) ? NAN : 1e9;
        return 1;
    case FREEZE:
        if (count > 0) memcpy(at->any.values, at[-1].any.values, 6 * sizeof(double));
        return 1;
    case SATURATE:
        at->imu.gyro[fv_random_below(random, 3)] = 35;
        return 1;
    default:
        at->imu.stamp_ns += (int64_t)fv_random_u32(random) * 8 - 17000000000;
        return 1;
    }
}

/* Whatever comes: nothing but sound values in rising order, all counted, gaps told; and a tenth of
 * a second of sound samples later all is well. */
static void any_mixture_is_survived(void **state)
{
    (void)state;
    struct fovea_rig_imu rig = usual;
    rig.gyro_range = 35;
    for (uint64_t seed = 1; seed <= CAMPAIGN_SEEDS; seed++) {
        struct fv_random random;
        fv_random_seed(&random, seed);
        const uint32_t percent = fv_random_below(&random, 60);
        uint32_t count = 0, dropped = 0;
        uint64_t n = 0, fed = 0;
        open_gate(&rig);
        while (n < STREAM_MAX) {
            const uint32_t begin = count;
            const uint64_t end = n + 1 + fv_random_below(&random, 40);
            for (; n < end; n++) {
                const bool faulty =
                    n > 0 && n < STREAM_MAX - 200 && fv_random_below(&random, 100) < percent;
                const enum fault fault = (enum fault)fv_random_below(&random, FAULTS);
                if (faulty && fault == DROP) dropped++;
                if (faulty)
                    count += append(&random, n, fault, count);
                else
                    stream[count++] = sound(n);
                if (faulty && fault == SWAP) n++;
            }
            fed += count - begin;
            step(stream + begin, count - begin, begin_ns + (int64_t)(n - 1) * period_ns);
        }
        assert_int_equal(all_counted(), fed);
        assert_int_equal(status.counts.taken, passed_count);
        assert_int_equal(status.state, FOVEA_IMU_OK);
        assert_true(status.counts.missing >= dropped / 2);
        for (uint32_t i = 0; i < passed_count; i++) {
            const struct fovea_imu_sample *s = &passed[i].sample;
            for (int k = 0; k < 3; k++)
                assert_true(fabs(s->gyro[k]) < 35 && fabs(s->acceleration[k]) < 100);
            if (i == 0 || (passed[i].notes & FV_IMU_AFTER_JUMP) != 0) continue;
            const int64_t apart_ns = s->stamp_ns - passed[i - 1].sample.stamp_ns;
            assert_true(apart_ns > 0);
            assert_true(apart_ns < 5 * period_ns / 2 || (passed[i].notes & FV_IMU_AFTER_GAP) != 0);
        }
        for (uint32_t i = passed_count - 150; i < passed_count; i++)
            assert_int_equal(passed[i].notes, 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sound_sensor_passes_whole),
        cmocka_unit_test(jitter_is_no_loss),
        cmocka_unit_test(what_is_missing_is_counted),
        cmocka_unit_test(a_lossy_sensor_is_counted),
        cmocka_unit_test(repeated_and_late_ones_are_refused),
        cmocka_unit_test(no_number_is_refused),
        cmocka_unit_test(the_end_of_a_range_is_seen),
        cmocka_unit_test(a_frozen_sensor_is_named),
        cmocka_unit_test(silence_is_named_and_ends),
        cmocka_unit_test(a_clock_that_leaps_is_followed),
        cmocka_unit_test(a_wrong_stamp_costs_one_sample),
        cmocka_unit_test(the_time_offset_counts),
        cmocka_unit_test(any_mixture_is_survived),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
