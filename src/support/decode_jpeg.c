#include "support/decode.h"

#include <setjmp.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>

#include <jerror.h>

/* Pictures of several scans keep 6 bytes of each pixel. */
enum { MEMORY_BYTES_MAX = 1 << 27, PIXEL_BYTES = 8, SCANS_MAX = 64 };

struct job {
    struct jpeg_decompress_struct jpeg;
    struct jpeg_error_mgr errors;
    struct jpeg_progress_mgr progress;
    jmp_buf escape;
    const struct fv_decode_image *image;
    struct fovea_error *reason;
};

static void on_error(j_common_ptr jpeg)
{
    struct job *job = jpeg->client_data;
    char message[JMSG_LENGTH_MAX];
    jpeg->err->format_message(jpeg, message);
    fovea_error_set(job->reason, FOVEA_ERROR_INPUT, "damaged JPEG: %s", message);
    longjmp(job->escape, 1);
}

/* libjpeg makes up what is missing and only warns. A frame that is partly made up is no frame;
 * warnings that do not touch the picture are let pass. */
static void on_message(j_common_ptr jpeg, int level)
{
    const int code = jpeg->err->msg_code;
    if (level >= 0 || code == JWRN_EXTRANEOUS_DATA || code == JWRN_JFIF_MAJOR ||
        code == JWRN_ADOBE_XFORM || code == JWRN_TOO_MUCH_DATA)
        return;
    on_error(jpeg);
}

/* A small file may hold thousands of progressive scans, each as slow as a picture. */
static void on_progress(j_common_ptr jpeg)
{
    struct job *job = jpeg->client_data;
    if (job->jpeg.input_scan_number <= SCANS_MAX) return;
    fovea_error_set(job->reason, FOVEA_ERROR_INPUT,
                    "damaged JPEG: found more than %d scans, expected fewer", SCANS_MAX);
    longjmp(job->escape, 1);
}

static void create(struct job *job)
{
    jpeg_create_decompress(&job->jpeg);
    job->jpeg.mem->max_memory_to_use = MEMORY_BYTES_MAX;
    job->jpeg.progress = &job->progress;
}

static void read_header(struct job *job, const uint8_t *data, size_t bytes)
{
    jpeg_mem_src(&job->jpeg, (unsigned char *)(uintptr_t)data, bytes);
    jpeg_read_header(&job->jpeg, TRUE);
}

/* Output as RGB where that is asked for; as grey where the file has a luma channel, else as RGB to
 * be weighted here. */
static enum fovea_status set_output(struct job *job)
{
    job->jpeg.dct_method = JDCT_ISLOW;
    switch (job->jpeg.jpeg_color_space) {
    case JCS_GRAYSCALE:
    case JCS_YCbCr:
        job->jpeg.out_color_space = job->image->colour ? JCS_RGB : JCS_GRAYSCALE;
        return FOVEA_OK;
    case JCS_RGB:
        job->jpeg.out_color_space = JCS_RGB;
        return FOVEA_OK;
    default:
        return fovea_error_set(job->reason, FOVEA_ERROR_INPUT,
                               "JPEG: found %d colour channels, expected grey, YCbCr or RGB",
                               job->jpeg.num_components);
    }
}

static enum fovea_status decode(struct job *job, const uint8_t *data, size_t bytes)
{
    read_header(job, data, bytes);
    const struct fv_decode_image *image = job->image;
    if (job->jpeg.image_width != (JDIMENSION)image->width ||
        job->jpeg.image_height != (JDIMENSION)image->height)
        return fovea_error_set(job->reason, FOVEA_ERROR_INPUT,
                               "found %u x %u pixels, expected %d x %d", job->jpeg.image_width,
                               job->jpeg.image_height, image->width, image->height);
    const enum fovea_status status = set_output(job);
    if (status != FOVEA_OK) return status;
    const bool weigh = job->jpeg.out_color_space == JCS_RGB && !image->colour;
    uint8_t *rgb = NULL;
    if (weigh)
        rgb = job->jpeg.mem->alloc_large((j_common_ptr)&job->jpeg, JPOOL_IMAGE,
                                         3 * (size_t)image->width);
    jpeg_start_decompress(&job->jpeg);
    for (int32_t y = 0; y < image->height; y++) {
        uint8_t *to = image->pixels + (size_t)y * (size_t)image->stride_bytes;
        JSAMPROW row = weigh ? rgb : to;
        if (jpeg_read_scanlines(&job->jpeg, &row, 1) != 1)
            return fovea_error_set(job->reason, FOVEA_ERROR_INPUT,
                                   "damaged JPEG: row %d is missing", y);
        if (weigh) fv_decode_rgb_row(rgb, to, image->width);
    }
    jpeg_finish_decompress(&job->jpeg);
    return FOVEA_OK;
}

/* Everything that may jump is called from here and the next two. */
static enum fovea_status probe(struct job *job, const uint8_t *data, size_t bytes)
{
    if (setjmp(job->escape)) return FOVEA_ERROR_INPUT;
    create(job);
    read_header(job, data, bytes);
    return FOVEA_OK;
}

static enum fovea_status decode_once(struct job *job, const uint8_t *data, size_t bytes)
{
    if (setjmp(job->escape)) return FOVEA_ERROR_INPUT;
    create(job);
    const long needed = (long)job->image->width * job->image->height * PIXEL_BYTES;
    if (needed > MEMORY_BYTES_MAX) job->jpeg.mem->max_memory_to_use = needed;
    return decode(job, data, bytes);
}

static void prepare(struct job *job)
{
    job->jpeg.err = jpeg_std_error(&job->errors);
    job->jpeg.client_data = job;
    job->errors.error_exit = on_error;
    job->errors.emit_message = on_message;
    job->progress.progress_monitor = on_progress;
}

enum fovea_status fv_decode_jpeg_size(const uint8_t *data, size_t bytes, int64_t *width,
                                      int64_t *height, struct fovea_error *reason)
{
    struct job job = {.reason = reason};
    prepare(&job);
    const enum fovea_status status = probe(&job, data, bytes);
    *width = job.jpeg.image_width;
    *height = job.jpeg.image_height;
    jpeg_destroy_decompress(&job.jpeg);
    return status;
}

enum fovea_status fv_decode_jpeg(const uint8_t *data, size_t bytes,
                                 const struct fv_decode_image *image, struct fovea_error *reason)
{
    struct job job = {.image = image, .reason = reason};
    prepare(&job);
    const enum fovea_status status = decode_once(&job, data, bytes);
    jpeg_destroy_decompress(&job.jpeg);
    return status;
}

/* ---- with memory of its own ------------------------------------------------------------------ */

/* What one baseline picture needs of libjpeg is bounded by a few rows of blocks; the rest are
 * tables. */
enum { ARENA_TABLES_BYTES = 64 * 1024, ARENA_COLUMN_BYTES = 192, ARENA_ALIGNMENT = 32 };

struct fv_jpeg_decoder {
    struct job job;
    struct jpeg_decompress_struct fresh; /* as it was made: every picture starts from this */
    struct jpeg_memory_mgr *heap;        /* libjpeg's own manager, for what was made with it */
    struct jpeg_memory_mgr manager;
    uint8_t *arena;
    size_t used, most, capacity;
};

static struct fv_jpeg_decoder *decoder_of(j_common_ptr jpeg)
{
    return (struct fv_jpeg_decoder *)((char *)jpeg->client_data -
                                      offsetof(struct fv_jpeg_decoder, job));
}

static void *arena_take(j_common_ptr jpeg, int pool, size_t bytes)
{
    struct fv_jpeg_decoder *decoder = decoder_of(jpeg);
    (void)pool;
    const size_t rounded = (bytes + ARENA_ALIGNMENT - 1) / ARENA_ALIGNMENT * ARENA_ALIGNMENT;
    if (bytes > decoder->capacity || rounded > decoder->capacity - decoder->used) {
        fovea_error_set(
            decoder->job.reason, FOVEA_ERROR_INPUT,
            "damaged JPEG: found a header that asks for more than %zu bytes of memory, expected fewer",
            decoder->capacity);
        longjmp(decoder->job.escape, 1);
    }
    void *taken = decoder->arena + decoder->used;
    decoder->used += rounded;
    if (decoder->used > decoder->most) decoder->most = decoder->used;
    return taken;
}

/* Rows are padded as libjpeg-turbo's manager pads them: its vector code writes past their ends. */
static JSAMPARRAY arena_samples(j_common_ptr jpeg, int pool, JDIMENSION samples, JDIMENSION rows)
{
    const size_t row_bytes =
        ((size_t)samples + 2 * ARENA_ALIGNMENT - 1) / (2 * ARENA_ALIGNMENT) * (2 * ARENA_ALIGNMENT);
    JSAMPARRAY array = arena_take(jpeg, pool, rows * sizeof *array);
    JSAMPLE *all = arena_take(jpeg, pool, rows * row_bytes);
    for (JDIMENSION i = 0; i < rows; i++)
        array[i] = all + i * row_bytes;
    return array;
}

static JBLOCKARRAY arena_blocks(j_common_ptr jpeg, int pool, JDIMENSION blocks, JDIMENSION rows)
{
    JBLOCKARRAY array = arena_take(jpeg, pool, rows * sizeof(JBLOCKROW));
    JBLOCK *all = arena_take(jpeg, pool, (size_t)rows * blocks * sizeof *all);
    for (JDIMENSION i = 0; i < rows; i++)
        array[i] = all + (size_t)i * blocks;
    return array;
}

/* Whole-picture arrays are asked for by pictures of several scans only, which no camera sends. */
static jvirt_barray_ptr refuse_blocks(j_common_ptr jpeg, int pool, boolean zero, JDIMENSION blocks,
                                      JDIMENSION rows, JDIMENSION access)
{
    (void)pool, (void)zero, (void)blocks, (void)rows, (void)access;
    struct fv_jpeg_decoder *decoder = decoder_of(jpeg);
    fovea_error_set(decoder->job.reason, FOVEA_ERROR_INPUT,
                    "damaged JPEG: found a picture of several scans, expected one");
    longjmp(decoder->job.escape, 1);
}

static void nothing(j_common_ptr jpeg)
{
    (void)jpeg;
}

static void free_nothing(j_common_ptr jpeg, int pool)
{
    (void)jpeg, (void)pool;
}

static enum fovea_status make(struct fv_jpeg_decoder *decoder)
{
    if (setjmp(decoder->job.escape)) return FOVEA_ERROR_SYSTEM;
    create(&decoder->job);
    return FOVEA_OK;
}

enum fovea_status fv_jpeg_decoder_open(int32_t width, struct fv_jpeg_decoder **out,
                                       struct fovea_error *error)
{
    struct fv_jpeg_decoder *decoder = calloc(1, sizeof *decoder);
    if (decoder == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory for decoding JPEG");
    decoder->capacity = ARENA_TABLES_BYTES + (size_t)width * ARENA_COLUMN_BYTES;
    decoder->job.reason = error;
    prepare(&decoder->job);
    if (make(decoder) != FOVEA_OK ||
        posix_memalign((void **)&decoder->arena, 64, decoder->capacity) != 0) {
        decoder->arena = NULL;
        decoder->heap = decoder->job.jpeg.mem;
        decoder->fresh = decoder->job.jpeg;
        fv_jpeg_decoder_close(decoder);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "out of memory for decoding JPEG");
    }
    memset(decoder->arena, 0, decoder->capacity); /* touched now, not by the first picture */
    decoder->heap = decoder->job.jpeg.mem;
    decoder->manager = *decoder->heap;
    decoder->manager.alloc_small = arena_take;
    decoder->manager.alloc_large = arena_take;
    decoder->manager.alloc_sarray = arena_samples;
    decoder->manager.alloc_barray = arena_blocks;
    decoder->manager.request_virt_barray = refuse_blocks;
    decoder->manager.realize_virt_arrays = nothing;
    decoder->manager.free_pool = free_nothing;
    decoder->manager.self_destruct = nothing;
    decoder->job.jpeg.mem = &decoder->manager;
    decoder->fresh = decoder->job.jpeg;
    *out = decoder;
    return FOVEA_OK;
}

void fv_jpeg_decoder_close(struct fv_jpeg_decoder *decoder)
{
    if (decoder == NULL) return;
    decoder->job.jpeg = decoder->fresh;
    decoder->job.jpeg.mem = decoder->heap;
    jpeg_destroy_decompress(&decoder->job.jpeg);
    free(decoder->arena);
    free(decoder);
}

size_t fv_jpeg_decoder_bytes(const struct fv_jpeg_decoder *decoder, size_t *most)
{
    if (most != NULL) *most = decoder->most;
    return sizeof *decoder + decoder->capacity;
}

enum fovea_status fv_jpeg_decode(struct fv_jpeg_decoder *decoder, const uint8_t *data, size_t bytes,
                                 const struct fv_decode_image *image, struct fovea_error *reason)
{
    struct job *job = &decoder->job;
    job->jpeg = decoder->fresh; /* no table of an earlier picture is left for this one */
    job->image = image;
    job->reason = reason;
    decoder->used = 0;
    if (setjmp(job->escape)) return FOVEA_ERROR_INPUT;
    return decode(job, data, bytes);
}
