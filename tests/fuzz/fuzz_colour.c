/* Pictures for networks: any bytes as PNG, JPEG or BMP in colour. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "support/picture.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fovea_image image = {0};
    struct fovea_error error;
    char path[64];
    uint64_t sum = 0;
    const int file = memfd_create("picture", 0);
    if (file < 0 || write(file, data, size) != (ssize_t)size) abort();
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    if (fv_picture_read_colour(path, &image, &error) == FOVEA_OK) {
        for (size_t i = 0; i < image.size_bytes; i++)
            sum += ((const uint8_t *)image.data)[i];
        if (image.width <= 0 || image.height <= 0 || sum == UINT64_MAX) abort();
        free((void *)image.data);
    }
    close(file);
    return 0;
}
