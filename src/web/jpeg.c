#include "web/jpeg.h"

#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>

static const struct {
    int32_t shrink;
    int quality;
} classes[FV_WEB_JPEGS] = {{1, 80}, {1, 60}, {1, 40}, {2, 60}, {2, 40},
                           {4, 50}, {1, 80}, {1, 60}, {1, 40}};

enum { SHRINK_MAX = 64, ROW_BYTES_MAX = 3 * FV_WEB_WIDTH_MAX };

struct job {
    struct jpeg_compress_struct jpeg;
    struct jpeg_error_mgr errors;
    jmp_buf escape;
};

static void on_error(j_common_ptr jpeg)
{
    struct job *job = jpeg->client_data;
    longjmp(job->escape, 1);
}

static void on_message(j_common_ptr jpeg, int level)
{
    (void)jpeg;
    (void)level;
}

int32_t fv_web_jpeg_shrink(int32_t width, int picture_class)
{
    const int32_t least = (width + FV_WEB_WIDTH_MAX - 1) / FV_WEB_WIDTH_MAX;
    if (picture_class >= FV_WEB_CLASSES) return 1;
    return classes[picture_class].shrink * (least > 1 ? least : 1);
}

int fv_web_jpeg_whole(int32_t width, int quality)
{
    return width <= FV_WEB_WIDTH_MAX ? quality : FV_WEB_CLASSES + quality;
}

/* The means of squares of `shrink` pixels a side, of `channels` bytes each. */
static void row_shrink(const struct fovea_image *image, int32_t y, int32_t shrink, int32_t channels,
                       uint8_t *to)
{
    const int32_t width = image->width / shrink, count = shrink * shrink;
    for (int32_t i = 0; i < width * channels; i++) {
        const int32_t x = i / channels * shrink * channels + i % channels;
        int32_t sum = count / 2;
        for (int32_t down = 0; down < shrink; down++) {
            const uint8_t *row =
                image->data + (size_t)(y * shrink + down) * (size_t)image->stride_bytes + x;
            for (int32_t right = 0; right < shrink; right++)
                sum += row[right * channels];
        }
        to[i] = (uint8_t)(sum / count);
    }
}

static void compress(struct job *job, const struct fovea_image *image, int32_t shrink,
                     int picture_class, int32_t channels)
{
    uint8_t small[ROW_BYTES_MAX];
    struct jpeg_compress_struct *jpeg = &job->jpeg;
    jpeg->image_width = (JDIMENSION)(image->width / shrink);
    jpeg->image_height = (JDIMENSION)(image->height / shrink);
    jpeg->input_components = channels;
    jpeg->in_color_space = channels == 3 ? JCS_RGB : JCS_GRAYSCALE;
    jpeg_set_defaults(jpeg);
    jpeg_set_quality(jpeg, classes[picture_class].quality, TRUE);
    jpeg->dct_method = JDCT_IFAST;
    jpeg_start_compress(jpeg, TRUE);
    while (jpeg->next_scanline < jpeg->image_height) {
        const int32_t y = (int32_t)jpeg->next_scanline;
        JSAMPROW row = small;
        if (shrink > 1)
            row_shrink(image, y, shrink, channels, small);
        else
            row = (JSAMPROW)(uintptr_t)(image->data + (size_t)y * (size_t)image->stride_bytes);
        jpeg_write_scanlines(jpeg, &row, 1);
    }
    jpeg_finish_compress(jpeg);
}

size_t fv_web_jpeg_make(const struct fovea_image *image, int picture_class, uint8_t **jpeg,
                        size_t *capacity)
{
    struct job job;
    unsigned char *memory = *jpeg;
    unsigned long bytes = (unsigned long)*capacity;
    const int32_t channels = image->format == FOVEA_PIXEL_RGB24 ? 3 : 1;
    const int32_t shrink = fv_web_jpeg_shrink(image->width, picture_class);
    if ((channels == 1 && image->format != FOVEA_PIXEL_GREY8) || shrink > SHRINK_MAX ||
        image->width < shrink || image->height < shrink)
        return 0;
    job.jpeg.err = jpeg_std_error(&job.errors);
    job.errors.error_exit = on_error;
    job.errors.emit_message = on_message;
    job.jpeg.client_data = &job;
    if (setjmp(job.escape) != 0) {
        jpeg_destroy_compress(&job.jpeg);
        return 0;
    }
    jpeg_create_compress(&job.jpeg);
    jpeg_mem_dest(&job.jpeg, &memory, &bytes);
    compress(&job, image, shrink, picture_class, channels);
    jpeg_destroy_compress(&job.jpeg);
    if (memory != *jpeg) { /* it grew: libjpeg leaves the old memory to us */
        free(*jpeg);
        *jpeg = memory;
        *capacity = bytes;
    }
    return bytes;
}
