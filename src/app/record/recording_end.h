/* The last message of a recording, which shows that the log is whole: how many iterations and
 * events came before it, the hash of all their bytes, and whether the recording ended with the run.
 * Real-time safe but for the decoder. */
#ifndef FOVEA_APP_RECORD_RECORDING_END_H
#define FOVEA_APP_RECORD_RECORDING_END_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "support/lcmlog.h"

enum { FV_RECORDING_END_REASON_BYTES = 192, FV_RECORDING_END_BYTES_MAX = 256 };

struct fv_recording_end {
    uint64_t iterations, events,
        hash; /* hash: of the events alone when encoding, of reason too when decoded */
    char reason[FV_RECORDING_END_REASON_BYTES]; /* why the recording ended before the run; "": with
                                                   it */
};

/* Write the 28 bytes that stand before every event of a log. */
void fv_recording_event_head(uint8_t head[FV_LCMLOG_HEADER_BYTES], int64_t number, int64_t time_us,
                             size_t channel_bytes, uint32_t bytes);

/* Go on with the hash of a recording (first FV_HASH_START) by one event, in the two pieces that a
 * reader has.
 */
uint64_t fv_recording_hash_event(uint64_t hash, const uint8_t *head_and_channel,
                                 size_t head_and_channel_bytes, const uint8_t *data,
                                 uint32_t bytes);

/* The bytes written, or 0 when `capacity` is below FV_RECORDING_END_BYTES_MAX. */
uint32_t fv_recording_end_encode(const struct fv_recording_end *end, uint8_t *buffer,
                                 size_t capacity);

/* False: it is not a well-formed one, and `*problem` and `*at` (byte within the message) say why
 * and where.
 */
bool fv_recording_end_decode(const uint8_t *data, size_t bytes, struct fv_recording_end *end,
                             const char **problem, size_t *at);

#endif
