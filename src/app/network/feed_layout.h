/* The shared memory of a feed: what its writer (feed.h) and its readers (feed_reader.h) agree on.
 *
 *   header, one page
 *   a ring of records, one per outgoing message, in one piece each, a multiple of
 *     FV_FEED_RECORD_UNIT bytes: struct fv_feed_record, the message, padding, and in the last 8
 *     bytes the record's number again
 *   FV_FEED_FRAMES slots of raw frames: struct fv_feed_slot, then the images one after the other
 *
 * Positions in the ring count bytes since the start and never wrap. The writer waits for nobody: it
 * announces what it is about to overwrite (`begun`), writes, and then publishes (`written`). A
 * reader copies first and believes afterwards, if what it copied was not begun to be overwritten
 * meanwhile. All numbers are those of the host. */
#ifndef FOVEA_APP_NETWORK_FEED_LAYOUT_H
#define FOVEA_APP_NETWORK_FEED_LAYOUT_H

#include <stdatomic.h>
#include <stdint.h>

#include "fovea/image.h"
#include "fovea/rig.h"
#include "message/message.h"

#define FV_FEED_MAGIC UINT64_C(0x3130444545465646) /* "FVFEED01" */

enum {
    FV_FEED_HEADER_BYTES = 4096,
    FV_FEED_RECORD_UNIT = 128,
    FV_FEED_RING_BYTES = 2 << 20, /* a second and a half at 30 frames of 1,000 features a second */
    FV_FEED_FRAMES = 3,
};

struct fv_feed_header {
    uint64_t magic;
    uint64_t bytes; /* of all */
    uint64_t ring_bytes, slot_bytes;
    int64_t run_id;
    char prefix[FV_MESSAGE_CHANNEL_BYTES];

    _Alignas(64) atomic_uint_fast64_t begun; /* ring: bytes that are written or being written */
    atomic_uint_fast64_t written;            /* bytes of whole records */
    atomic_uint_fast64_t frames;             /* whole frames; slot (frames - 1) % FV_FEED_FRAMES */
};

struct fv_feed_record {
    uint64_t number; /* from 1; 0: only fills the end of the ring */
    uint32_t size;   /* of the record */
    uint32_t bytes;  /* of the message */
    char channel[FV_MESSAGE_CHANNEL_BYTES];
};

struct fv_feed_frame {
    int64_t stamp_ns;
    int64_t sequence;
    int32_t clock; /* enum fovea_clock */
    uint32_t image_count;
    struct fv_feed_image {
        int32_t width, height, stride_bytes, format; /* enum fovea_pixel_format */
        uint64_t offset, bytes; /* from the end of the slot's head; 0 bytes: absent */
    } images[FOVEA_CAMERAS_MAX];
};

/* `begun` and `whole` are the frame's number, from 1; equal when the slot is whole. */
struct fv_feed_slot {
    atomic_uint_fast64_t begun, whole;
    struct fv_feed_frame frame;
};

/* What is written or read before it is so for the other process, too, before what comes after it.
 * ThreadSanitizer knows no fences, and sees one process only; there x86's own order is enough. */
static inline void fv_feed_fence(void)
{
#ifdef __SANITIZE_THREAD__
    atomic_signal_fence(memory_order_acq_rel);
#else
    atomic_thread_fence(memory_order_acq_rel);
#endif
}

/* What a reader may send: frames that it wants in 1,000 seconds; 0: none. */
struct fv_feed_wish {
    uint32_t frames_per_1000_s;
};

#endif
