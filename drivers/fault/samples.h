/* Faults of the inertial sensor: those of the samples that come with the frames of a fault. Other
 * kinds of samples pass. The same bits everywhere: doubles without libm. */
#ifndef FOVEA_DRIVERS_FAULT_SAMPLES_H
#define FOVEA_DRIVERS_FAULT_SAMPLES_H

#include "fault.h"

struct fv_fault_imu {
    bool any;
    struct fovea_imu_sample last; /* before the fault: what a stuck sensor repeats */
};

/* How many samples may come out for one. */
uint32_t fv_fault_samples_growth(const struct fv_fault_options *options);

/* Remember the last one of samples without a fault. */
void fv_fault_samples_pass(struct fv_fault_imu *imu, const struct fovea_sample *samples,
                           uint32_t count);

/* Spoil `count` samples in place; `capacity` is fv_fault_samples_growth times that at least.
 * `seed`: of this frame alone. Returns how many there are now. No heap. */
uint32_t fv_fault_samples(const struct fv_fault_options *options, uint64_t seed,
                          uint64_t window_seed, struct fv_fault_imu *imu,
                          struct fovea_sample *samples, uint32_t count);

#endif
