#include "samples.h"

#include <string.h>

#include "../clock.h"
#include "base/elementary.h"

uint32_t fv_fault_samples_growth(const struct fv_fault_options *options)
{
    return fv_fault_has(options, FV_FAULT_imu_repeat) ? 2 : 1;
}

void fv_fault_samples_pass(struct fv_fault_imu *imu, const struct fovea_sample *samples,
                           uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        if (samples[i].kind == FOVEA_SAMPLE_IMU) {
            imu->last = samples[i].imu;
            imu->any = true;
        }
}

/* A unit vector that a fault draws. */
static void direction(struct fv_random *random, double out[3])
{
    double length2 = 0;
    for (int i = 0; i < 3; i++) {
        out[i] = fv_random_normal(random);
        length2 += out[i] * out[i];
    }
    const double length = __builtin_sqrt(length2);
    for (int i = 0; i < 3; i++)
        out[i] = length > 0 ? out[i] / length : 0;
}

/* What changes the values of one sample. */
static void values_spoil(const struct fv_fault_options *o, const double gyro[3],
                         const double acceleration[3], const struct fv_fault_imu *imu,
                         struct fovea_imu_sample *sample)
{
    for (int i = 0; i < 3; i++) {
        if (fv_fault_has(o, FV_FAULT_imu_bias)) {
            sample->gyro[i] += o->gyro_rad_s * gyro[i];
            sample->acceleration[i] += o->acceleration_m_s2 * acceleration[i];
        }
        if (fv_fault_has(o, FV_FAULT_imu_saturate)) {
            sample->gyro[i] = fv_within(sample->gyro[i], o->gyro_end_rad_s);
            sample->acceleration[i] = fv_within(sample->acceleration[i], o->acceleration_end_m_s2);
        }
        if (fv_fault_has(o, FV_FAULT_imu_stuck) && imu->any) {
            sample->gyro[i] = imu->last.gyro[i];
            sample->acceleration[i] = imu->last.acceleration[i];
        }
    }
    if (fv_fault_has(o, FV_FAULT_imu_jump)) sample->stamp_ns += fv_clock_from_ms(o->leap_ms);
}

/* Whether one of the faults that strike single samples does. */
static bool strikes(const struct fv_fault_options *o, enum fv_fault_kind kind,
                    struct fv_random *random)
{
    return fv_fault_has(o, kind) && fv_random_unit(random) < o->chance;
}

/* Without those that are dropped. */
static uint32_t drop(const struct fv_fault_options *o, struct fv_random *random,
                     struct fovea_sample *samples, uint32_t count)
{
    uint32_t kept = 0;
    const bool all = fv_fault_has(o, FV_FAULT_imu_unplug);
    for (uint32_t i = 0; i < count; i++) {
        const bool imu = samples[i].kind == FOVEA_SAMPLE_IMU;
        if (imu && (all || strikes(o, FV_FAULT_imu_drop, random))) continue;
        samples[kept++] = samples[i];
    }
    return kept;
}

/* With repetitions, from the last to the first, so that each is moved once. */
static uint32_t repeat(const struct fv_fault_options *o, struct fv_random *random,
                       struct fovea_sample *samples, uint32_t count)
{
    bool again[FOVEA_INPUT_SAMPLES_MAX];
    uint32_t more = 0;
    for (uint32_t i = 0; i < count; i++) {
        again[i] = samples[i].kind == FOVEA_SAMPLE_IMU && strikes(o, FV_FAULT_imu_repeat, random);
        more += again[i];
    }
    for (uint32_t i = count, at = count + more; i-- > 0;) {
        const struct fovea_sample sample = samples[i];
        samples[--at] = sample;
        if (again[i]) samples[--at] = sample;
    }
    return count + more;
}

static void swap(const struct fv_fault_options *o, struct fv_random *random,
                 struct fovea_sample *samples, uint32_t count)
{
    for (uint32_t i = 0; i + 1 < count; i++) {
        const bool both =
            samples[i].kind == FOVEA_SAMPLE_IMU && samples[i + 1].kind == FOVEA_SAMPLE_IMU;
        if (!both || !strikes(o, FV_FAULT_imu_swap, random)) continue;
        const struct fovea_sample sample = samples[i];
        samples[i] = samples[i + 1];
        samples[++i] = sample;
    }
}

uint32_t fv_fault_samples(const struct fv_fault_options *options, uint64_t seed,
                          uint64_t window_seed, struct fv_fault_imu *imu,
                          struct fovea_sample *samples, uint32_t count)
{
    double gyro[3], acceleration[3];
    struct fv_random random;
    fv_random_seed(&random, window_seed ^ 0x1A57u);
    direction(&random, gyro);
    direction(&random, acceleration);
    fv_random_seed(&random, seed ^ 0x51D3u);
    for (uint32_t i = 0; i < count; i++) {
        struct fovea_imu_sample *sample = &samples[i].imu;
        if (samples[i].kind != FOVEA_SAMPLE_IMU) continue;
        if (!imu->any) { /* the fault begins with the first of all: that one is repeated */
            imu->last = *sample;
            imu->any = true;
        }
        values_spoil(options, gyro, acceleration, imu, sample);
        if (strikes(options, FV_FAULT_imu_nan, &random))
            sample->gyro[fv_random_below(&random, 3)] = __builtin_nan("");
    }
    count = drop(options, &random, samples, count);
    count = repeat(options, &random, samples, count);
    swap(options, &random, samples, count);
    return count;
}
