/* Masks: any bytes as the PNG of a mask. What is decoded holds 0 and 255 only. */
#include <stdint.h>
#include <stdlib.h>

#include "app/config/mask.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const int32_t sizes[][2] = {{32, 32}, {64, 48}, {1, 1}};
    for (int i = 0; i < 3; i++) {
        uint8_t *mask = NULL;
        struct fovea_error error;
        if (fv_mask_decode("mask", data, size, sizes[i][0], sizes[i][1], &mask, &error) != FOVEA_OK)
            continue;
        for (int32_t at = 0; at < sizes[i][0] * sizes[i][1]; at++)
            if (mask[at] != 0 && mask[at] != 255) abort();
        free(mask);
    }
    return 0;
}
