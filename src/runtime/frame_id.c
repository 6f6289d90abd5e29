#include "runtime/frame_id.h"

struct fv_frame_id fv_frame_id(const struct fovea_frame *frame, int64_t utc_offset_ns)
{
    return (struct fv_frame_id){
        .stamp_ns = frame->stamp_ns,
        .exposure_ns = frame->exposure_ns[0],
        .utc_offset_ns = utc_offset_ns,
        .sequence = frame->sequence,
        .clock = (uint32_t)frame->clock,
        .stamp_meaning = (uint32_t)frame->stamp_meaning,
        .pixel_format = (uint32_t)frame->images[0].format,
    };
}

fovea_stamp_t fv_frame_id_stamp(const struct fv_frame_id *id)
{
    const struct fovea_frame frame = {
        .stamp_ns = id->stamp_ns,
        .clock = (enum fovea_clock)id->clock,
        .stamp_meaning = (enum fovea_stamp_meaning)id->stamp_meaning,
        .sequence = id->sequence,
    };
    return fv_message_stamp(&frame, id->utc_offset_ns);
}
