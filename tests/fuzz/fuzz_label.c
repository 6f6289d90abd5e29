/* Label pictures: any bytes as a PNG of class numbers, by the name of a file in memory. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "app/lab/label_picture.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const int32_t sizes[][2] = {{32, 32}, {64, 48}, {1, 1}};
    char path[64];
    const int file = memfd_create("labels", 0);
    if (file < 0 || write(file, data, size) != (ssize_t)size) abort();
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    for (int i = 0; i < 3; i++) {
        uint8_t *labels = NULL;
        struct fovea_error error;
        unsigned sum = 0;
        if (fv_label_picture_read(path, sizes[i][0], sizes[i][1], &labels, &error) != FOVEA_OK)
            continue;
        for (int32_t at = 0; at < sizes[i][0] * sizes[i][1]; at++)
            sum += labels[at];
        if (sum > 255u * (unsigned)(sizes[i][0] * sizes[i][1])) abort();
        free(labels);
    }
    close(file);
    return 0;
}
