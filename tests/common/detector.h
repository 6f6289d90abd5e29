/* The small detector of the tests (tests/golden/detector.fvm), in memory as the runtime wants it.
 */
#ifndef FOVEA_TESTS_DETECTOR_H
#define FOVEA_TESTS_DETECTOR_H

#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "nn/model.h"

/* NULL when the file is not there. Lives as long as the program. */
static inline const void *detector_model(size_t *bytes)
{
    static _Alignas(64) uint8_t file[1 << 18];
    FILE *in = fopen("tests/golden/detector.fvm", "rb");
    if (in == NULL) return NULL;
    *bytes = fread(file, 1, sizeof file, in);
    fclose(in);
    return *bytes > 0 && *bytes < sizeof file ? file : NULL;
}

/* The same network as one that labels pixels, likewise. */
static inline const void *detector_as_segmenter(size_t *bytes)
{
    static _Alignas(64) uint8_t model[1 << 18];
    const void *file = detector_model(bytes);
    if (file == NULL) return NULL;
    memcpy(model, file, *bytes);
    struct fv_model_header *header = (struct fv_model_header *)(void *)model;
    header->decode = (struct fv_model_decode){.kind = FV_DECODER_SEGMENT};
    header->checksum = fv_model_checksum(model + 16, *bytes - 16);
    return model;
}

#endif
