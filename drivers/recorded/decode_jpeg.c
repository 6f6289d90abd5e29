#include "decode.h"

#include <setjmp.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include <jpeglib.h>

#include <jerror.h>

enum { MEMORY_BYTES_MAX = 1 << 27, SCANS_MAX = 64 };

struct job {
    struct jpeg_decompress_struct jpeg;
    struct jpeg_error_mgr errors;
    struct jpeg_progress_mgr progress;
    jmp_buf escape;
    const struct fv_decode_image *image;
    uint8_t *row;
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

/* libjpeg makes up what is missing and only warns. A frame that is partly made up is no frame; warnings that
 * do not touch the picture are let pass. */
static void on_message(j_common_ptr jpeg, int level)
{
    const int code = jpeg->err->msg_code;
    if (level >= 0 || code == JWRN_EXTRANEOUS_DATA || code == JWRN_JFIF_MAJOR || code == JWRN_ADOBE_XFORM ||
        code == JWRN_TOO_MUCH_DATA)
        return;
    on_error(jpeg);
}

/* A small file may hold thousands of progressive scans, each as slow as a picture. */
static void on_progress(j_common_ptr jpeg)
{
    struct job *job = jpeg->client_data;
    if (job->jpeg.input_scan_number <= SCANS_MAX) return;
    fovea_error_set(job->reason, FOVEA_ERROR_INPUT, "damaged JPEG: found more than %d scans, expected fewer",
                    SCANS_MAX);
    longjmp(job->escape, 1);
}

static void read_header(struct job *job, const uint8_t *data, size_t bytes)
{
    jpeg_create_decompress(&job->jpeg);
    job->jpeg.mem->max_memory_to_use = MEMORY_BYTES_MAX;
    job->jpeg.progress = &job->progress;
    jpeg_mem_src(&job->jpeg, (unsigned char *)(uintptr_t)data, bytes);
    jpeg_read_header(&job->jpeg, TRUE);
}

/* Output as grey where the file has a luma channel, else as RGB to be weighted here. */
static enum fovea_status set_output(struct job *job)
{
    job->jpeg.dct_method = JDCT_ISLOW;
    switch (job->jpeg.jpeg_color_space) {
    case JCS_GRAYSCALE:
    case JCS_YCbCr:
        job->jpeg.out_color_space = JCS_GRAYSCALE;
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

/* Everything that may jump. */
static enum fovea_status decode(struct job *job, const uint8_t *data, size_t bytes)
{
    if (setjmp(job->escape)) return FOVEA_ERROR_INPUT;
    read_header(job, data, bytes);
    const struct fv_decode_image *image = job->image;
    if (job->jpeg.image_width != (JDIMENSION)image->width ||
        job->jpeg.image_height != (JDIMENSION)image->height)
        return fovea_error_set(job->reason, FOVEA_ERROR_INPUT, "found %u x %u pixels, expected %d x %d",
                               job->jpeg.image_width, job->jpeg.image_height, image->width, image->height);
    const enum fovea_status status = set_output(job);
    if (status != FOVEA_OK) return status;
    const bool colour = job->jpeg.out_color_space == JCS_RGB;
    if (colour && (job->row = malloc(3 * (size_t)image->width)) == NULL)
        return fovea_error_set(job->reason, FOVEA_ERROR_SYSTEM, "out of memory");
    jpeg_start_decompress(&job->jpeg);
    for (int32_t y = 0; y < image->height; ++y) {
        uint8_t *grey = image->pixels + (size_t)y * (size_t)image->stride_bytes;
        JSAMPROW row = colour ? job->row : grey;
        if (jpeg_read_scanlines(&job->jpeg, &row, 1) != 1)
            return fovea_error_set(job->reason, FOVEA_ERROR_INPUT, "damaged JPEG: row %d is missing", y);
        if (colour) fv_decode_rgb_row(job->row, grey, image->width);
    }
    jpeg_finish_decompress(&job->jpeg);
    return FOVEA_OK;
}

static enum fovea_status probe(struct job *job, const uint8_t *data, size_t bytes)
{
    if (setjmp(job->escape)) return FOVEA_ERROR_INPUT;
    read_header(job, data, bytes);
    return FOVEA_OK;
}

static void prepare(struct job *job)
{
    job->jpeg.err = jpeg_std_error(&job->errors);
    job->jpeg.client_data = job;
    job->errors.error_exit = on_error;
    job->errors.emit_message = on_message;
    job->progress.progress_monitor = on_progress;
}

enum fovea_status fv_decode_jpeg_probe(const uint8_t *data, size_t bytes, int32_t *width, int32_t *height,
                                       struct fovea_error *reason)
{
    struct job job = {.reason = reason};
    prepare(&job);
    enum fovea_status status = probe(&job, data, bytes);
    const int64_t w = job.jpeg.image_width, h = job.jpeg.image_height;
    jpeg_destroy_decompress(&job.jpeg);
    if (status != FOVEA_OK || (status = fv_decode_check_size(w, h, reason)) != FOVEA_OK) return status;
    *width = (int32_t)w;
    *height = (int32_t)h;
    return FOVEA_OK;
}

enum fovea_status fv_decode_jpeg(const uint8_t *data, size_t bytes, const struct fv_decode_image *image,
                                 struct fovea_error *reason)
{
    struct job job = {.image = image, .reason = reason};
    prepare(&job);
    const enum fovea_status status = decode(&job, data, bytes);
    jpeg_destroy_decompress(&job.jpeg);
    free(job.row);
    return status;
}
