#include "picture.h"

#include <stdlib.h>
#include <string.h>

#include "split.h"

/* ---- memory ---------------------------------------------------------------------------------- */

static enum fovea_status make_decoder(struct fv_live_pictures *pictures,
                                      struct fovea_source_info *info, struct fovea_error *error)
{
    struct fovea_source_camera *camera = &info->cameras[0];
    const int32_t stride = (camera->width + 63) / 64 * 64;
    const size_t bytes = (size_t)stride * (size_t)camera->height,
                 slot_bytes = (bytes + 64 + 63) / 64 * 64;
    enum fovea_status status = fv_jpeg_decoder_open(camera->width, &pictures->jpeg, error);
    if (status != FOVEA_OK) return status;
    pictures->count = FV_LIVE_DECODED;
    if (posix_memalign((void **)&pictures->memory, 64, slot_bytes * FV_LIVE_DECODED) != 0) {
        pictures->memory = NULL;
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", pictures->uri);
    }
    memset(pictures->memory, 0, slot_bytes * FV_LIVE_DECODED);
    for (uint32_t i = 0; i < FV_LIVE_DECODED; i++)
        pictures->whole[i] = (struct fovea_image){
            .data = pictures->memory + i * slot_bytes, .stride_bytes = stride, .size_bytes = bytes};
    info->format = FOVEA_PIXEL_GREY8;
    camera->stride_bytes = stride;
    info->heap_bytes += slot_bytes * FV_LIVE_DECODED + fv_jpeg_decoder_bytes(pictures->jpeg, NULL);
    return FOVEA_OK;
}

/* Memory for the halves of each slot's picture, and a rig of two. */
static enum fovea_status make_halves(struct fv_live_pictures *pictures,
                                     struct fovea_source_info *info, struct fovea_error *error)
{
    struct fovea_source_camera *camera = &info->cameras[0];
    pictures->halves_bytes = 2 * fv_split_bytes(info->format, camera->width, camera->height);
    pictures->halves = calloc(1, pictures->count * pictures->halves_bytes + 1);
    if (pictures->halves == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", pictures->uri);
    camera->width /= 2;
    camera->stride_bytes = 0;
    info->cameras[1] = *camera;
    info->rig.camera_count = 2;
    info->rig.cameras[1] = info->rig.cameras[0];
    info->heap_bytes += pictures->count * pictures->halves_bytes;
    return FOVEA_OK;
}

enum fovea_status fv_live_pictures_open(struct fv_live_pictures *pictures, const char *uri,
                                        const struct fv_live_setup *setup,
                                        struct fovea_source_info *info, struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    pictures->uri = uri;
    pictures->frame_bytes_min = setup->frame_bytes_min;
    pictures->count = setup->buffers;
    if (info->format == FOVEA_PIXEL_MJPEG) status = make_decoder(pictures, info, error);
    for (uint32_t i = 0; i < pictures->count; i++) {
        pictures->whole[i].width = info->cameras[0].width;
        pictures->whole[i].height = info->cameras[0].height;
        pictures->whole[i].format = info->format;
    }
    if (status == FOVEA_OK && setup->split) status = make_halves(pictures, info, error);
    return status;
}

void fv_live_pictures_close(struct fv_live_pictures *pictures)
{
    fv_jpeg_decoder_close(pictures->jpeg);
    free(pictures->memory);
    free(pictures->halves);
}

/* ---- pictures -------------------------------------------------------------------------------- */

static enum fovea_status decode(struct fv_live_pictures *pictures, uint32_t slot,
                                const struct fv_live_buffer *buffer, struct fovea_error *error)
{
    const struct fovea_image *image = &pictures->whole[slot];
    const struct fv_decode_image grey = {.pixels = (uint8_t *)(uintptr_t)image->data, /* our own */
                                         .width = image->width,
                                         .height = image->height,
                                         .stride_bytes = image->stride_bytes};
    struct fovea_error reason = {.text = ""};
    const enum fovea_status status =
        fv_jpeg_decode(pictures->jpeg, buffer->data, buffer->bytes, &grey, &reason);
    if (status == FOVEA_OK) return status;
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: frame skipped: %.256s", pictures->uri,
                           reason.text);
}

enum fovea_status fv_live_picture_take(struct fv_live_pictures *pictures, uint32_t slot,
                                       const struct fv_live_buffer *buffer,
                                       struct fovea_error *error)
{
    struct fovea_image *image = &pictures->whole[slot];
    if (buffer->damaged)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: the driver marks frames as damaged",
                               pictures->uri);
    if (pictures->jpeg != NULL) return decode(pictures, slot, buffer, error);
    const size_t needed = fovea_image_bytes(image->format, image->height, buffer->stride_bytes);
    /* The last row need not be padded. */
    const int32_t padding =
        buffer->stride_bytes - fovea_image_stride_min(image->format, image->width);
    const size_t least =
        pictures->frame_bytes_min > 0 ? pictures->frame_bytes_min : needed - (size_t)padding;
    if (buffer->bytes < least)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: frame skipped: found %zu bytes, expected %zu", pictures->uri,
                               buffer->bytes, needed);
    image->data = buffer->data;
    image->stride_bytes = buffer->stride_bytes;
    image->size_bytes = needed;
    return FOVEA_OK;
}

void fv_live_picture_images(const struct fv_live_pictures *pictures, uint32_t slot,
                            struct fovea_image *images)
{
    if (pictures->halves != NULL)
        fv_split(&pictures->whole[slot], pictures->halves + slot * pictures->halves_bytes, images);
    else
        images[0] = pictures->whole[slot];
}
