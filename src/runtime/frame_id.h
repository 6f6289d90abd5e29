/* Which frame a result is about, as states remember it and messages carry it. Real-time safe. */
#ifndef FOVEA_RUNTIME_FRAME_ID_H
#define FOVEA_RUNTIME_FRAME_ID_H

#include "message/message.h"

/* No addresses and no padding: part of states that are hashed. */
struct fv_frame_id {
    int64_t stamp_ns, exposure_ns, utc_offset_ns;
    uint64_t sequence;
    uint32_t clock, stamp_meaning, pixel_format, reserved;
};

struct fv_frame_id fv_frame_id(const struct fovea_frame *frame, int64_t utc_offset_ns);

fovea_stamp_t fv_frame_id_stamp(const struct fv_frame_id *id);

#endif
