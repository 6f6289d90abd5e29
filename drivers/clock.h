/* Clocks of this host in nanoseconds. Drivers and the application read them; the runtime never
 * does. Real-time safe. */
#ifndef FOVEA_DRIVERS_CLOCK_H
#define FOVEA_DRIVERS_CLOCK_H

#include <stdint.h>
#include <time.h>

#include "fovea/source.h"

#define FV_SECOND_NS INT64_C(1000000000)

/* `time` as nanoseconds, and back. */
static inline int64_t fv_clock_from_timespec(struct timespec time)
{
    return (int64_t)time.tv_sec * FV_SECOND_NS + time.tv_nsec;
}

static inline struct timespec fv_clock_timespec(int64_t ns)
{
    return (struct timespec){.tv_sec = ns / FV_SECOND_NS, .tv_nsec = ns % FV_SECOND_NS};
}

/* Milliseconds, rounded to the nearest nanosecond. */
static inline int64_t fv_clock_from_ms(double ms)
{
    return (int64_t)(ms * 1e6 + (ms < 0 ? -0.5 : 0.5));
}

/* The host's clock that stamps are on; of recorded and simulated ones, CLOCK_MONOTONIC. */
static inline clockid_t fv_clock_of(enum fovea_clock clock)
{
    return clock == FOVEA_CLOCK_BOOTTIME   ? CLOCK_BOOTTIME
           : clock == FOVEA_CLOCK_REALTIME ? CLOCK_REALTIME
                                           : CLOCK_MONOTONIC;
}

static inline int64_t fv_clock_ns(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return fv_clock_from_timespec(now);
}

/* By how much `clock` is ahead of CLOCK_MONOTONIC. They are read in turn, and another program may
 * take the processor between: of a few tries that counts which took least. */
static inline int64_t fv_clock_ahead_ns(clockid_t clock)
{
    const int64_t short_ns = 20000;
    int64_t ahead_ns = 0, least_ns = INT64_MAX;
    if (clock == CLOCK_MONOTONIC) return 0;
    for (int i = 0; i < 4 && least_ns > short_ns; i++) {
        const int64_t before_ns = fv_clock_ns(CLOCK_MONOTONIC), there_ns = fv_clock_ns(clock),
                      took_ns = fv_clock_ns(CLOCK_MONOTONIC) - before_ns;
        if (took_ns >= least_ns) continue;
        least_ns = took_ns;
        ahead_ns = there_ns - before_ns - took_ns / 2;
    }
    return ahead_ns;
}

#endif
