#include "order.h"

static const int64_t oldest_ns = 10000000000, ahead_ns = 1000000000;

void fv_order_start(struct fv_order *order, int64_t readout_ns)
{
    *order = (struct fv_order){.readout_ns = readout_ns};
}

void fv_order_again(struct fv_order *order)
{
    order->sequence_any = false;
    order->clock_found = false;
    order->last_raw_ns = INT64_MIN;
}

static bool plausible(int64_t stamp_ns, int64_t now_ns)
{
    return stamp_ns > now_ns - oldest_ns && stamp_ns <= now_ns + ahead_ns;
}

/* The clock on which the stamp is the least old; false when on none. Clocks that agree count as
 * MONOTONIC. */
static bool find_clock(int64_t stamp_ns, const struct fv_order_now *now, enum fovea_clock *clock)
{
    bool found = false;
    int64_t least_ns = 0;
    for (int i = 0; i < 3; i++) {
        if (!plausible(stamp_ns, now->clock_ns[i])) continue;
        const int64_t age_ns = now->clock_ns[i] - stamp_ns;
        const int64_t away_ns = age_ns < 0 ? -age_ns : age_ns;
        if (found && away_ns + 1000000 >= least_ns) continue;
        found = true;
        least_ns = away_ns;
        *clock = (enum fovea_clock)i;
    }
    return found;
}

/* Gaps in the driver's numbers; a number that goes back is a counter that began anew. */
uint64_t fv_order_count(struct fv_order *order, const struct fv_order_stamp *stamp)
{
    uint64_t lost = 0;
    if (stamp->sequence_known && order->sequence_any) {
        const uint32_t step = stamp->sequence - order->last_number;
        if (step > 1 && step < UINT32_C(1) << 31) lost = step - 1;
    }
    order->sequence_any = stamp->sequence_known;
    order->last_number = stamp->sequence;
    if (order->counted_any) order->sequence += lost + 1;
    order->counted_any = true;
    return lost;
}

/* The stamp on the source's clock. False: it had to be replaced by the time of arrival. */
static bool place(struct fv_order *order, const struct fv_order_stamp *stamp,
                  const struct fv_order_now *now, int64_t *stamp_ns)
{
    if (!order->clock_found) {
        enum fovea_clock clock = stamp->clock;
        if (!stamp->clock_known && !find_clock(stamp->stamp_ns, now, &clock))
            clock = FOVEA_CLOCK_MONOTONIC;
        order->driver_clock = clock;
        if (!order->any)
            order->clock = clock == FOVEA_CLOCK_REALTIME ? FOVEA_CLOCK_MONOTONIC : clock;
        order->clock_found = true;
    }
    const int64_t now_ns = now->clock_ns[order->clock];
    const int64_t driver_ns = now->clock_ns[order->driver_clock];
    if (!plausible(stamp->stamp_ns, driver_ns)) {
        *stamp_ns = now_ns;
        order->replaced++;
        return false;
    }
    *stamp_ns = stamp->stamp_ns + (now_ns - driver_ns);
    return true;
}

static int64_t to_middle(const struct fv_order *order, const struct fv_order_stamp *stamp)
{
    const bool readout_known = order->readout_ns >= 0;
    const int64_t half_ns = (stamp->exposure_ns + (readout_known ? order->readout_ns : 0)) / 2;
    if (stamp->exposure_ns <= 0) return 0;
    if (stamp->meaning == FOVEA_STAMP_EXPOSURE_START) return half_ns;
    return stamp->meaning == FOVEA_STAMP_EXPOSURE_END && readout_known ? -half_ns : 0;
}

enum fv_order_verdict fv_order_frame(struct fv_order *order, const struct fv_order_stamp *stamp,
                                     const struct fv_order_now *now, struct fovea_frame *frame)
{
    int64_t stamp_ns;
    const bool repeated = order->any && stamp->stamp_ns == order->last_raw_ns;
    const bool placed = place(order, stamp, now, &stamp_ns);
    order->last_raw_ns = stamp->stamp_ns;
    if (repeated) return FV_ORDER_REPEATED;
    const int64_t shift_ns = placed ? to_middle(order, stamp) : 0;
    stamp_ns += shift_ns;
    if (order->any && stamp_ns <= order->last_stamp_ns) return FV_ORDER_BACKWARD;
    order->any = true;
    order->last_stamp_ns = stamp_ns;
    frame->stamp_ns = stamp_ns;
    frame->clock = order->clock;
    frame->stamp_meaning = !placed         ? FOVEA_STAMP_UNKNOWN
                           : shift_ns != 0 ? FOVEA_STAMP_EXPOSURE_MIDDLE
                                           : stamp->meaning;
    frame->exposure_ns[0] = stamp->exposure_ns;
    frame->sequence = order->sequence;
    return FV_ORDER_GOOD;
}
