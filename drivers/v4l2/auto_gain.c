/* Automatic gain for cameras that have a gain but no automatism of their own: the camera thread
 * measures how bright the frames are and moves the gain by a fraction of what is missing (an
 * integrating controller). */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "v4l2.h"

enum {
    TARGET = 112,  /* mean grey level: below the middle, since what is overexposed is lost */
    DEAD_BAND = 8, /* levels about the target that are left alone */
    /* A new gain shows in the frame after the next with most sensors; it is judged by what it made.
     */
    FRAMES_APART = 4,
    /* A miss of this number of levels moves the gain by its whole range: the loop is stable for
     * cameras whose whole range changes the picture by less than twice that. */
    LEVELS_FULL = 1024,
    GRID = 32 /* measured at GRID x GRID places, at each a square of four pixels (all colours of a
                 Bayer pattern) */
};

/* Where the grey level of a pixel lies: at pixel * bytes + offset, of `bits` bits. */
static void layout(enum fovea_pixel_format format, size_t *bytes, size_t *offset, int *bits)
{
    *bytes = 1;
    *offset = 0;
    *bits = 8;
    switch (format) {
    case FOVEA_PIXEL_YUYV:
        *bytes = 2;
        break;
    case FOVEA_PIXEL_UYVY:
        *bytes = 2, *offset = 1;
        break;
    case FOVEA_PIXEL_Y10:
        *bytes = 2, *bits = 10;
        break;
    case FOVEA_PIXEL_Y12:
        *bytes = 2, *bits = 12;
        break;
    case FOVEA_PIXEL_Y14:
        *bytes = 2, *bits = 14;
        break;
    case FOVEA_PIXEL_Y16:
        *bytes = 2, *bits = 16;
        break;
    case FOVEA_PIXEL_RGB24:
    case FOVEA_PIXEL_BGR24: /* green, of which grey levels are mostly made */
        *bytes = 3, *offset = 1;
        break;
    default:
        break;
    }
}

int fv_v4l2_brightness(const struct fovea_image *image)
{
    size_t bytes, offset;
    int bits;
    uint32_t sum = 0;
    layout(image->format, &bytes, &offset, &bits);
    for (int32_t j = 0; j < 2 * GRID; j++) {
        const int32_t y = (2 * (j / 2) + 1) * image->height / (2 * GRID) - j % 2;
        const uint8_t *row = image->data + (ptrdiff_t)y * image->stride_bytes + offset;
        for (int32_t i = 0; i < 2 * GRID; i++) {
            const uint8_t *at =
                row + (size_t)((2 * (i / 2) + 1) * image->width / (2 * GRID) - i % 2) * bytes;
            sum += bits == 8 ? at[0] : (uint32_t)(at[0] | at[1] << 8) >> (bits - 8) & 255u;
        }
    }
    return (int)(sum / (4 * GRID * GRID));
}

static bool write_gain(const struct fv_v4l2_device *device, int32_t value)
{
    struct v4l2_ext_control control = {.id = device->gain.id, .value = value};
    struct v4l2_ext_controls all = {
        .which = V4L2_CTRL_WHICH_CUR_VAL, .count = 1, .controls = &control};
    return fv_v4l2_system->ioctl(device->fd, VIDIOC_S_EXT_CTRLS, &all) == 0;
}

enum fovea_status fv_v4l2_auto_gain_begin(struct fv_v4l2_device *device,
                                          const struct v4l2_query_ext_ctrl *info,
                                          struct fovea_error *error)
{
    struct fv_v4l2_auto_gain *gain = &device->gain;
    struct v4l2_ext_control control = {.id = info->id};
    struct v4l2_ext_controls all = {
        .which = V4L2_CTRL_WHICH_CUR_VAL, .count = 1, .controls = &control};
    const bool again = gain->id == info->id; /* goes on where it was before the camera went away */
    if (!again && fv_v4l2_system->ioctl(device->fd, VIDIOC_G_EXT_CTRLS, &all) != 0)
        return fv_v4l2_failed(device, "auto_gain: asking for the gain", errno, error);
    *gain = (struct fv_v4l2_auto_gain){
        .id = info->id,
        .minimum = (int32_t)info->minimum,
        .maximum = (int32_t)info->maximum,
        .step = info->step > 0 ? (int32_t)info->step : 1,
        .value = again ? gain->value : control.value,
    };
    if (write_gain(device, gain->value)) return FOVEA_OK;
    const int reason = errno;
    gain->id = 0;
    if (reason == ENODEV) return fv_v4l2_failed(device, "setting a control", reason, error);
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: auto_gain: the camera refuses a gain: %s",
                           device->uri, strerror(reason));
}

void fv_v4l2_auto_gain_seen(struct fv_v4l2_device *device, const struct fovea_image *image)
{
    struct fv_v4l2_auto_gain *gain = &device->gain;
    if (gain->id == 0 || ++gain->frames < FRAMES_APART) return;
    gain->frames = 0;
    const int missing = TARGET - fv_v4l2_brightness(image);
    if (abs(missing) <= DEAD_BAND) return;
    const int64_t steps = ((int64_t)gain->maximum - gain->minimum) / gain->step;
    int64_t change = missing * steps / LEVELS_FULL;
    if (change == 0) change = missing > 0 ? 1 : -1;
    int64_t value = gain->value + change * gain->step;
    if (value < gain->minimum) value = gain->minimum;
    if (value > gain->maximum) value = gain->maximum;
    /* One that fails is tried again with a later frame; an unplugged camera is noticed when frames
     * are waited for. */
    if (value != gain->value && write_gain(device, (int32_t)value)) gain->value = (int32_t)value;
}
