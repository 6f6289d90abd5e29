/* LCM logs as a source: opened and played, forwards and in reverse. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "drivers/table.h"
#include "fovea/source.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static void play(const char *uri, bool reverse)
{
    const struct fovea_source_selection selection = {.step = 1, .frames = 8, .reverse = reverse};
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error = {.text = ""};
    if (fv_source_find(uri, &ops, &address, &error) != FOVEA_OK) abort();
    if (ops->open(address, &selection, &source, &error) != FOVEA_OK) {
        if (error.text[0] == '\0' || strchr(error.text, '\n') != NULL) abort();
        return;
    }
    if (ops->start(source, &error) == FOVEA_OK) {
        while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
            if (fovea_image_check(&frame.images[0]) != FOVEA_OK) abort();
            unsigned sum = 0;
            for (size_t i = 0; i < frame.images[0].size_bytes; i += 61)
                sum += frame.images[0].data[i];
            volatile unsigned kept = sum;
            (void)kept;
            ops->requeue(source, &frame);
        }
        ops->stop(source);
    }
    ops->close(source);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    char uri[64];
    const int file = memfd_create("log", 0);
    if (file < 0 || write(file, data, bytes) != (ssize_t)bytes) abort();
    snprintf(uri, sizeof uri, "lcmlog:/proc/self/fd/%d", file);
    play(uri, false);
    play(uri, true);
    close(file);
    return 0;
}
