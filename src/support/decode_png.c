#include "support/decode.h"

#include <png.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

enum { CHUNK_BYTES_MAX = 1 << 22, CHUNKS_MAX = 256 };

struct job {
    png_structp png;
    png_infop info;
    const uint8_t *data;
    size_t bytes, at;
    const struct fv_decode_image *image;
    uint8_t *rows; /* colour rows: one, or the whole image when it is interlaced */
    struct fovea_error *reason;
};

static void on_error(png_structp png, png_const_charp message)
{
    const struct job *job = png_get_error_ptr(png);
    fovea_error_set(job->reason, FOVEA_ERROR_INPUT, "damaged PNG near byte %zu: %s", job->at,
                    message);
    longjmp(png_jmpbuf(png), 1);
}

static void on_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

static void on_read(png_structp png, png_bytep bytes, png_size_t count)
{
    struct job *job = png_get_io_ptr(png);
    if (count > job->bytes - job->at) png_error(png, "the file ends too early");
    memcpy(bytes, job->data + job->at, count);
    job->at += count;
}

/* Ask for 8-bit grey or RGB without alpha, or for RGB alone. Returns the passes. */
static int set_transforms(struct job *job)
{
    png_set_expand(job->png);
    png_set_strip_16(job->png);
    png_set_strip_alpha(job->png);
    if (job->image->colour) png_set_gray_to_rgb(job->png);
    const int passes = png_set_interlace_handling(job->png);
    png_read_update_info(job->png, job->info);
    return passes;
}

static void read_as_is(struct job *job, int passes)
{
    const struct fv_decode_image *image = job->image;
    for (int pass = 0; pass < passes; pass++)
        for (int32_t y = 0; y < image->height; y++)
            png_read_row(job->png, image->pixels + (size_t)y * (size_t)image->stride_bytes, NULL);
}

static void read_weighted(struct job *job, int passes)
{
    const struct fv_decode_image *image = job->image;
    const size_t row_bytes = 3 * (size_t)image->width,
                 kept = passes > 1 ? (size_t)image->height : 1;
    job->rows = calloc(kept, row_bytes);
    if (job->rows == NULL) png_error(job->png, "out of memory");
    for (int pass = 0; pass < passes; pass++) {
        for (int32_t y = 0; y < image->height; y++) {
            uint8_t *row = job->rows + (passes > 1 ? (size_t)y * row_bytes : 0);
            png_read_row(job->png, row, NULL);
            if (pass == passes - 1)
                fv_decode_rgb_row(row, image->pixels + (size_t)y * (size_t)image->stride_bytes,
                                  image->width);
        }
    }
}

/* Everything that may jump. */
static enum fovea_status decode(struct job *job)
{
    if (setjmp(png_jmpbuf(job->png))) return FOVEA_ERROR_INPUT;
    png_set_read_fn(job->png, job, on_read);
    png_set_user_limits(job->png, FV_DECODE_SIDE_MAX, FV_DECODE_SIDE_MAX);
    png_set_chunk_malloc_max(job->png, CHUNK_BYTES_MAX);
    png_set_chunk_cache_max(job->png, CHUNKS_MAX);
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
    png_set_crc_action(job->png, PNG_CRC_QUIET_USE,
                       PNG_CRC_QUIET_USE); /* let mutated chunks get further */
    png_set_option(job->png, PNG_IGNORE_ADLER32, PNG_OPTION_ON);
#endif
    png_read_info(job->png, job->info);
    const int64_t width = png_get_image_width(job->png, job->info),
                  height = png_get_image_height(job->png, job->info);
    if (width != job->image->width || height != job->image->height)
        return fovea_error_set(job->reason, FOVEA_ERROR_INPUT,
                               "found %lld x %lld pixels, expected %d x %d", (long long)width,
                               (long long)height, job->image->width, job->image->height);
    const int passes = set_transforms(job);
    const int channels = png_get_channels(job->png, job->info);
    if (png_get_rowbytes(job->png, job->info) != (size_t)channels * (size_t)width ||
        (channels != 1 && channels != 3))
        png_error(job->png, "unknown sample format");
    if (channels == 1 || job->image->colour)
        read_as_is(job, passes);
    else
        read_weighted(job, passes);
    png_read_end(job->png, NULL);
    return FOVEA_OK;
}

enum fovea_status fv_decode_png(const uint8_t *data, size_t bytes,
                                const struct fv_decode_image *image, struct fovea_error *reason)
{
    struct job job = {.data = data, .bytes = bytes, .image = image, .reason = reason};
    enum fovea_status status;
    job.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &job, on_error, on_warning);
    if (job.png != NULL) job.info = png_create_info_struct(job.png);
    if (job.info != NULL)
        status = decode(&job);
    else
        status = fovea_error_set(reason, FOVEA_ERROR_SYSTEM, "libpng: out of memory");
    png_destroy_read_struct(&job.png, &job.info, NULL);
    free(job.rows);
    return status;
}
