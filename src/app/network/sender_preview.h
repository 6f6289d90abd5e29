/* Making a preview message smaller: its picture is decoded and encoded again with less quality, and
 * where that does not do, at half and a quarter and an eighth of the size. The recording keeps what
 * the runtime made. Uses the heap (libjpeg's). */
#ifndef FOVEA_APP_NETWORK_SENDER_PREVIEW_H
#define FOVEA_APP_NETWORK_SENDER_PREVIEW_H

#include <stddef.h>
#include <stdint.h>

/* How small the last one had to be; the next one begins a step above. Zeroed at first. */
struct fv_preview_fit {
    uint32_t step;
};

/* Encode a fovea.preview_t of `bytes` as one of at most `most`. Its width, height and scale say
 * what is shown; the stamp stays. Returns the bytes written, or 0: the message is damaged, or
 * nothing fits. */
uint32_t fv_preview_shrink(struct fv_preview_fit *fit, const uint8_t *data, uint32_t bytes,
                           uint8_t *shrunk, size_t most);

#endif
