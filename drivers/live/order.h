/* Sequence numbers and stamps of a live camera, made fit for the runtime: numbers that grow over
 * wraps and restarts, and stamps that rise, on one clock, from the first frame to the last.
 *
 * Clock: a driver that says CLOCK_MONOTONIC is held to it; where it does not say, the clock is
 * found out from the first frame, as the one of MONOTONIC, BOOTTIME and REALTIME on which the stamp
 * is the least old. Stamps of REALTIME, which may be set back, are moved to MONOTONIC on arrival.
 * The clock of the first frame stays that of the source; a camera that comes back with another has
 * its stamps moved. A stamp that is not within ten seconds before its arrival on its clock is
 * replaced by the time of arrival, with FOVEA_STAMP_UNKNOWN.
 *
 * Meaning: with a known exposure, a stamp at the start of exposure is moved to its middle,
 * (exposure + readout) / 2 later: the middle row's. A stamp at the end of the frame is taken when
 * the last row has come, and is moved back by as much only when the readout time was given; else it
 * stays as it is.
 *
 * Repeated and backward stamps make a frame bad. Plain data, no system calls. */
#ifndef FOVEA_LIVE_ORDER_H
#define FOVEA_LIVE_ORDER_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/source.h"

/* The three clocks of this host, read together. */
struct fv_order_now {
    int64_t clock_ns[3]; /* by enum fovea_clock: MONOTONIC, BOOTTIME, REALTIME */
};

/* What a driver knows of a frame's time. */
struct fv_order_stamp {
    int64_t stamp_ns;
    bool clock_known;
    enum fovea_clock clock; /* where clock_known */
    enum fovea_stamp_meaning meaning;
    int64_t exposure_ns; /* 0: not known */
    bool sequence_known;
    uint32_t sequence;
};

enum fv_order_verdict {
    FV_ORDER_GOOD = 0,
    FV_ORDER_REPEATED, /* the stamp of the frame before, again */
    FV_ORDER_BACKWARD
};

struct fv_order {
    int64_t readout_ns; /* given by the user, or negative */
    bool any, counted_any, sequence_any, clock_found;
    enum fovea_clock driver_clock, clock; /* of the driver's stamps since set-up; of the source */
    uint32_t last_number;
    uint64_t sequence; /* of the buffer counted last */
    int64_t last_stamp_ns, last_raw_ns;
    uint64_t replaced; /* stamps replaced by the time of arrival */
};

/* `readout_ns`: negative where not given. */
void fv_order_start(struct fv_order *order, int64_t readout_ns);
/* The camera was set up again: numbers and clocks begin anew, earlier ones no longer count. */
void fv_order_again(struct fv_order *order);
/* Count one buffer, good or bad: how many frames the driver lost before it, by its numbers. */
uint64_t fv_order_count(struct fv_order *order, const struct fv_order_stamp *stamp);
/* Fill stamp_ns, clock, stamp_meaning, exposure_ns and sequence of `frame`, the buffer counted
 * last; untouched when it is not good. */
enum fv_order_verdict fv_order_frame(struct fv_order *order, const struct fv_order_stamp *stamp,
                                     const struct fv_order_now *now, struct fovea_frame *frame);

#endif
