#include "app/run/timing.h"

#include <string.h>

#include "drivers/clock.h"

enum { EXACT = 256, PER_OCTAVE = 128, PER_OCTAVE_BITS = 7 };

static uint32_t bucket_of(int64_t value_ns)
{
    if (value_ns < EXACT) return (uint32_t)value_ns;
    int shift =
        63 - __builtin_clzll((unsigned long long)value_ns) - PER_OCTAVE_BITS; /* at least 1 */
    int64_t bucket = EXACT + (int64_t)(shift - 1) * PER_OCTAVE + (value_ns >> shift) - PER_OCTAVE;
    return bucket < FV_HISTOGRAM_BUCKETS ? (uint32_t)bucket : FV_HISTOGRAM_BUCKETS - 1;
}

/* Middle of a bucket. */
static int64_t value_of(uint32_t bucket)
{
    if (bucket < EXACT) return bucket;
    int shift = (int)(bucket - EXACT) / PER_OCTAVE + 1;
    int64_t low = (int64_t)((bucket - EXACT) % PER_OCTAVE + PER_OCTAVE) << shift;
    return low + ((int64_t)1 << shift >> 1);
}

void fv_histogram_add(struct fv_histogram *histogram, int64_t value_ns)
{
    if (value_ns < 0) value_ns = 0;
    histogram->count++;
    histogram->sum_ns += value_ns;
    if (value_ns > histogram->max_ns) histogram->max_ns = value_ns;
    histogram->buckets[bucket_of(value_ns)]++;
}

int64_t fv_histogram_mean(const struct fv_histogram *histogram)
{
    return histogram->count > 0 ? histogram->sum_ns / (int64_t)histogram->count : 0;
}

int64_t fv_histogram_percentile(const struct fv_histogram *histogram, double fraction)
{
    uint64_t seen = 0;
    if (histogram->count == 0) return 0;
    for (uint32_t i = 0; i < FV_HISTOGRAM_BUCKETS; i++) {
        seen += histogram->buckets[i];
        if ((double)seen < fraction * (double)histogram->count) continue;
        return value_of(i) < histogram->max_ns ? value_of(i) : histogram->max_ns;
    }
    return histogram->max_ns;
}

void fv_curve_init(struct fv_curve *curve)
{
    memset(curve, 0, sizeof *curve);
    curve->stride = 1;
}

static void merge_neighbours(struct fv_curve *curve)
{
    for (uint32_t i = 0; i < FV_CURVE_BINS / 2; i++) {
        int64_t a = curve->max_ns[2 * i], b = curve->max_ns[2 * i + 1];
        curve->max_ns[i] = a > b ? a : b;
        curve->sum_ns[i] = curve->sum_ns[2 * i] + curve->sum_ns[2 * i + 1];
    }
    curve->bins = FV_CURVE_BINS / 2;
    curve->stride *= 2;
    curve->in_last = curve->stride;
}

void fv_curve_add(struct fv_curve *curve, int64_t value_ns)
{
    if (curve->bins == 0 || curve->in_last == curve->stride) {
        if (curve->bins == FV_CURVE_BINS) merge_neighbours(curve);
        curve->max_ns[curve->bins] = curve->sum_ns[curve->bins] = 0;
        curve->bins++;
        curve->in_last = 0;
    }
    uint32_t last = curve->bins - 1;
    if (value_ns > curve->max_ns[last]) curve->max_ns[last] = value_ns;
    curve->sum_ns[last] += value_ns;
    curve->in_last++;
}

void fv_timings_init(struct fv_timings *timings)
{
    /* Most pages of fresh memory stay zero, and take no memory where nothing writes to them. */
    uint8_t *bytes = (uint8_t *)timings;
    for (size_t i = 0; i < sizeof *timings; i++)
        if (bytes[i] != 0) bytes[i] = 0;
    fv_curve_init(&timings->step_curve);
    fv_curve_init(&timings->frame_curve);
}

void fv_timing_clock(void *context, int64_t *wall_ns, int64_t *cpu_ns)
{
    (void)context;
    *wall_ns = fv_clock_ns(CLOCK_MONOTONIC);
    *cpu_ns = fv_clock_ns(CLOCK_THREAD_CPUTIME_ID);
}
