/* Differences of stamps, which may be any: those that do not fit are the largest there are. */
#ifndef FOVEA_INERTIAL_STAMP_H
#define FOVEA_INERTIAL_STAMP_H

#include <stdint.h>

/* Any thread. */
static inline int64_t fv_stamp_since(int64_t later_ns, int64_t earlier_ns)
{
    int64_t since_ns;
    if (__builtin_sub_overflow(later_ns, earlier_ns, &since_ns))
        return later_ns > earlier_ns ? INT64_MAX : INT64_MIN;
    return since_ns;
}

#endif
