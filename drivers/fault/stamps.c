#include "../clock.h"
#include "base/elementary.h"
#include "fault.h"

void fv_fault_stamp_pass(struct fv_fault_stamp *stamp, int64_t stamp_ns)
{
    stamp->any = true;
    stamp->last_ns = stamp_ns;
}

int64_t fv_fault_stamp(const struct fv_fault_options *options, uint64_t seed,
                       struct fv_fault_stamp *stamp, int64_t stamp_ns)
{
    double moved_ms = 0;
    struct fv_random random;
    fv_random_seed(&random, seed);
    if (fv_fault_has(options, FV_FAULT_jitter))
        moved_ms += options->spread_ms * (2 * fv_random_unit(&random) - 1);
    if (fv_fault_has(options, FV_FAULT_jump)) moved_ms += options->leap_ms;
    if (!stamp->any) fv_fault_stamp_pass(stamp, stamp_ns);
    if (fv_fault_has(options, FV_FAULT_hold)) stamp_ns = stamp->last_ns;
    return stamp_ns + fv_clock_from_ms(moved_ms);
}
