/* One picture through the decoder, into a buffer of exactly its size. */
#ifndef FOVEA_TESTS_FUZZ_DECODE_ONE_H
#define FOVEA_TESTS_FUZZ_DECODE_ONE_H

#include <stdlib.h>
#include <string.h>

#include "support/decode.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static inline int decode_one(const uint8_t *data, size_t bytes)
{
    struct fovea_error reason = {.text = ""};
    int32_t width = 64, height = 64;
    const enum fovea_status probed = fv_decode_probe(data, bytes, &width, &height, &reason);
    if (probed != FOVEA_OK && (reason.text[0] == '\0' || strchr(reason.text, '\n') != NULL))
        abort();
    if ((int64_t)width * height > 1 << 18) return 0; /* larger ones only take longer */
    uint8_t *pixels = malloc((size_t)width * (size_t)height);
    if (pixels == NULL) return 0;
    const struct fv_decode_image image = {
        .pixels = pixels, .width = width, .height = height, .stride_bytes = width};
    const enum fovea_status decoded = fv_decode(data, bytes, &image, &reason);
    if (decoded == FOVEA_OK && probed != FOVEA_OK) abort();
    unsigned sum = 0; /* every pixel of a whole picture was written */
    for (size_t i = 0; decoded == FOVEA_OK && i < (size_t)width * (size_t)height; i++)
        sum += pixels[i];
    volatile unsigned kept = sum;
    (void)kept;
    free(pixels);
    return 0;
}

#endif
