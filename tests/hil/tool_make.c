/* hil-tool make FORMAT WIDTH HEIGHT COUNT FILE
 *     Frames in which every byte value occurs and no two are alike; MJPG also writes FILE.grey,
 *     what the pictures decode to.
 * hil-tool make sim URI COUNT FILE
 *     Grey frames of the simulated camera. */
#include "tool.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>

#include "support/decode.h"
#include "drivers/table.h"
#include "fovea/source.h"

static void put(FILE *file, const void *data, size_t bytes)
{
    if (fwrite(data, 1, bytes, file) != bytes) tool_fail("cannot write: %s", strerror(errno));
}

static void put_jpeg(FILE *file, FILE *grey_file, int width, int height, int index)
{
    struct jpeg_compress_struct jpeg;
    struct jpeg_error_mgr errors;
    unsigned char *out = NULL;
    unsigned long bytes = 0;
    uint8_t *row = malloc((size_t)width * 3), *grey = malloc((size_t)width * (size_t)height);
    jpeg.err = jpeg_std_error(&errors);
    jpeg_create_compress(&jpeg);
    jpeg_mem_dest(&jpeg, &out, &bytes);
    jpeg.image_width = (JDIMENSION)width;
    jpeg.image_height = (JDIMENSION)height;
    jpeg.input_components = 3;
    jpeg.in_color_space = JCS_RGB;
    jpeg_set_defaults(&jpeg);
    jpeg_set_quality(&jpeg, 85, TRUE);
    jpeg.restart_in_rows = 4;
    jpeg_start_compress(&jpeg, TRUE);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            row[3 * x] = (uint8_t)(2 * x + 3 * index);
            row[3 * x + 1] = (uint8_t)(3 * y + 7 * index);
            row[3 * x + 2] = (uint8_t)(x * y / 16);
        }
        JSAMPROW rows = row;
        jpeg_write_scanlines(&jpeg, &rows, 1);
    }
    jpeg_finish_compress(&jpeg);
    put(file, out, bytes);
    const struct fv_decode_image image = {
        .pixels = grey, .width = width, .height = height, .stride_bytes = width};
    struct fovea_error error;
    if (fv_decode_jpeg(out, bytes, &image, &error) != FOVEA_OK) tool_fail("%s", error.text);
    put(grey_file, grey, (size_t)width * (size_t)height);
    jpeg_destroy_compress(&jpeg);
    free(out);
    free(row);
    free(grey);
}

static int make_sim(const char *uri, int count, FILE *file)
{
    const struct fovea_source_selection selection = {.step = 1, .frames = (uint64_t)count};
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error;
    if (fv_source_find(uri, &ops, &address, &error) != FOVEA_OK ||
        ops->open(address, &selection, &source, &error) != FOVEA_OK ||
        ops->start(source, &error) != FOVEA_OK)
        tool_fail("%s", error.text);
    while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        for (int32_t y = 0; y < frame.images[0].height; y++)
            put(file, frame.images[0].data + (ptrdiff_t)y * frame.images[0].stride_bytes,
                (size_t)frame.images[0].width);
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
    return 0;
}

int tool_make(int argc, char **argv)
{
    const int sim = argc == 5 && strcmp(argv[1], "sim") == 0;
    if (argc != 6 && !sim)
        tool_fail("usage: make FORMAT WIDTH HEIGHT COUNT FILE | make sim URI COUNT FILE");
    FILE *file = fopen(argv[argc - 1], "wb");
    if (file == NULL) tool_fail("%s: %s", argv[argc - 1], strerror(errno));
    if (sim) return make_sim(argv[2], atoi(argv[3]), file) + fclose(file);
    const struct tool_format *format = tool_format(argv[1]);
    const int width = atoi(argv[2]), height = atoi(argv[3]), count = atoi(argv[4]);
    const size_t bytes = tool_frame_bytes(format, width, height);
    char grey_name[512];
    snprintf(grey_name, sizeof grey_name, "%s.grey", argv[5]);
    FILE *grey = bytes == 0 ? fopen(grey_name, "wb") : NULL;
    for (int k = 0; k < count; k++) {
        if (bytes == 0) put_jpeg(file, grey, width, height, k);
        for (size_t i = 0; i < bytes; i++)
            fputc((int)(i + i / (size_t)width * 3 + (size_t)k * 37) & 255, file);
    }
    if (grey != NULL) fclose(grey);
    return fclose(file);
}
