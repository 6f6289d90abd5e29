/* Times of a run of any length in fixed memory: histograms for percentiles, and a curve over the
 * run for the picture.
 *
 * A histogram is exact below 256 ns; above, buckets are 1/128 of their octave wide, so that a
 * percentile is off by at most 0.4 % (mean and maximum are exact). Adding is a handful of
 * instructions and real-time safe.
 */
#ifndef FOVEA_APP_RUN_TIMING_H
#define FOVEA_APP_RUN_TIMING_H

#include <stdint.h>

#include "fovea/fovea.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_HISTOGRAM_BUCKETS = 256 + 33 * 128 }; /* up to 2^41 ns, 36 minutes; more counts as that */

struct fv_histogram {
    uint64_t count;
    int64_t sum_ns, max_ns;
    uint32_t buckets[FV_HISTOGRAM_BUCKETS];
};

/* Negative values count as 0. */
void fv_histogram_add(struct fv_histogram *histogram, int64_t value_ns);
int64_t fv_histogram_mean(const struct fv_histogram *histogram); /* 0 when empty */
/* The smallest value that at least `fraction` (in (0, 1]) of the samples do not exceed; 0 when
 * empty.
 */
int64_t fv_histogram_percentile(const struct fv_histogram *histogram, double fraction);

/* Largest and mean value per bin. Bins hold `stride` frames each; when all are full, neighbours
 * merge. */
enum { FV_CURVE_BINS = 1024 };

struct fv_curve {
    uint32_t bins, stride, in_last; /* bins in use, frames per bin, frames in the last one */
    int64_t max_ns[FV_CURVE_BINS], sum_ns[FV_CURVE_BINS];
};

void fv_curve_init(struct fv_curve *curve);
void fv_curve_add(struct fv_curve *curve, int64_t value_ns);

/* CPU time of the loop thread and wall time, of one thing. */
struct fv_times_pair {
    struct fv_histogram cpu, wall;
};

struct fv_timings {
    struct fv_times_pair stages[FOVEA_STAGE_COUNT];
    struct fv_times_pair step, work, frame; /* frame: step and work together */
    struct fv_histogram
        latency; /* from a frame's time to its step, when frames come by the clock */
    struct fv_curve step_curve, frame_curve; /* CPU time over the run */
};

void fv_timings_init(struct fv_timings *timings);

/* CLOCK_MONOTONIC and CLOCK_THREAD_CPUTIME_ID as fovea_clock_function; `context` is not used. */
void fv_timing_clock(void *context, int64_t *wall_ns, int64_t *cpu_ns);

#ifdef __cplusplus
}
#endif
#endif
