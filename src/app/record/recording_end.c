#include "app/record/recording_end.h"

#include <stdio.h>
#include <string.h>

#include "base/hash.h"
#include "message/fields.h"

#include "fovea_recording_end_t.h"

static void write_big(uint8_t *out, uint64_t value, int bytes)
{
    for (int i = bytes - 1; i >= 0; i--, value >>= 8)
        out[i] = (uint8_t)value;
}

void fv_recording_event_head(uint8_t head[FV_LCMLOG_HEADER_BYTES], int64_t number, int64_t time_us,
                             size_t channel_bytes, uint32_t bytes)
{
    write_big(head, FV_LCMLOG_SYNC, 4);
    write_big(head + 4, (uint64_t)number, 8);
    write_big(head + 12, (uint64_t)time_us, 8);
    write_big(head + 20, channel_bytes, 4);
    write_big(head + 24, bytes, 4);
}

uint64_t fv_recording_hash_event(uint64_t hash, const uint8_t *head_and_channel,
                                 size_t head_and_channel_bytes, const uint8_t *data, uint32_t bytes)
{
    return fv_hash_bulk(fv_hash(hash, head_and_channel, head_and_channel_bytes), data, bytes);
}

uint32_t fv_recording_end_encode(const struct fv_recording_end *end, uint8_t *buffer,
                                 size_t capacity)
{
    const fovea_recording_end_t message = {
        .iterations = (int64_t)end->iterations,
        .events = (int64_t)end->events,
        .hash = (int64_t)fv_hash(end->hash, end->reason, strlen(end->reason)),
        .reason = (char *)end->reason, /* lcm-gen knows no const; it only reads */
    };
    if (capacity < FV_RECORDING_END_BYTES_MAX) return 0;
    int bytes = fovea_recording_end_t_encode(buffer, 0, FV_RECORDING_END_BYTES_MAX, &message);
    return bytes > 0 ? (uint32_t)bytes : 0;
}

bool fv_recording_end_decode(const uint8_t *data, size_t bytes, struct fv_recording_end *end,
                             const char **problem, size_t *at)
{
    fovea_recording_end_t message;
    if (!fv_message_check("fovea.recording_end_t", data, bytes, problem, at)) return false;
    if (fovea_recording_end_t_decode(data, 0, (int)bytes, &message) < 0) {
        *problem = "the end of the recording cannot be decoded";
        *at = 0;
        return false;
    }
    *end = (struct fv_recording_end){.iterations = (uint64_t)message.iterations,
                                     .events = (uint64_t)message.events,
                                     .hash = (uint64_t)message.hash};
    snprintf(end->reason, sizeof end->reason, "%s", message.reason);
    fovea_recording_end_t_decode_cleanup(&message);
    return true;
}
