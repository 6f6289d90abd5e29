/* Pictures of a live source, from a device's buffer to the images that the loop gets: raw ones as
 * they lie there, MJPEG decoded, and both halves of what two cameras share (split.h). One for each
 * slot. All memory is taken at open. */
#ifndef FOVEA_LIVE_PICTURE_H
#define FOVEA_LIVE_PICTURE_H

#include <stddef.h>
#include <stdint.h>

#include "live.h"
#include "support/decode.h"

struct fv_live_pictures {
    const char *uri;              /* the source's, for complaints */
    struct fv_jpeg_decoder *jpeg; /* NULL: raw frames */
    uint8_t *memory, *halves;     /* of all slots: decoded, NULL where raw; NULL: one camera */
    size_t halves_bytes;          /* of a slot */
    size_t frame_bytes_min;
    uint32_t count;                                /* slots */
    struct fovea_image whole[FV_LIVE_BUFFERS_MAX]; /* as the device gave it, or decoded */
};

/* Take memory, and state in `info` what the loop will get: format, stride, rig, bytes. Zeroed
 * memory; to be closed also on error. Init-only. */
enum fovea_status fv_live_pictures_open(struct fv_live_pictures *pictures, const char *uri,
                                        const struct fv_live_setup *setup,
                                        struct fovea_source_info *info, struct fovea_error *error);
void fv_live_pictures_close(struct fv_live_pictures *pictures);

/* The picture of a buffer into a slot. FOVEA_ERROR_INPUT: it is damaged; `error` says how. No heap.
 */
enum fovea_status fv_live_picture_take(struct fv_live_pictures *pictures, uint32_t slot,
                                       const struct fv_live_buffer *buffer,
                                       struct fovea_error *error);
/* The images of a slot whose picture is good, one per camera. */
void fv_live_picture_images(const struct fv_live_pictures *pictures, uint32_t slot,
                            struct fovea_image *images);

#endif
