/* Size, format and rate: what is asked for, what the driver makes of it, and that it stays so. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "v4l2.h"

/* The two layouts of VIDIOC_G_FMT behind one. */
struct picture {
    uint32_t width, height, fourcc, stride_bytes, field, plane_count;
};

static void unpack(const struct fv_v4l2_device *device, const struct v4l2_format *format,
                   struct picture *picture)
{
    const struct v4l2_pix_format *pix = &format->fmt.pix;
    const struct v4l2_pix_format_mplane *planes = &format->fmt.pix_mp;
    if (device->planes)
        *picture = (struct picture){planes->width,       planes->height,
                                    planes->pixelformat, planes->plane_fmt[0].bytesperline,
                                    planes->field,       planes->num_planes};
    else
        *picture = (struct picture){pix->width,        pix->height, pix->pixelformat,
                                    pix->bytesperline, pix->field,  1};
}

static void pack(const struct fv_v4l2_device *device, const struct picture *picture,
                 struct v4l2_format *format)
{
    struct v4l2_pix_format *pix = &format->fmt.pix;
    struct v4l2_pix_format_mplane *planes = &format->fmt.pix_mp;
    *format = (struct v4l2_format){.type = fv_v4l2_type(device)};
    if (device->planes) {
        planes->width = picture->width;
        planes->height = picture->height;
        planes->pixelformat = picture->fourcc;
        planes->field = V4L2_FIELD_NONE;
        planes->num_planes = 1;
    } else {
        pix->width = picture->width;
        pix->height = picture->height;
        pix->pixelformat = picture->fourcc;
        pix->field = V4L2_FIELD_NONE;
    }
}

/* ---- what it is ------------------------------------------------------------------------------ */

static enum fovea_status check_kind(struct fv_v4l2_device *device, struct fovea_error *error)
{
    struct v4l2_capability capability = {0};
    if (fv_v4l2_system->ioctl(device->fd, VIDIOC_QUERYCAP, &capability) != 0) {
        if (errno != ENOTTY && errno != EINVAL)
            return fv_v4l2_failed(device, "asking for it", errno, error);
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found no video device, expected a camera", device->uri);
    }
    const uint32_t can = capability.capabilities & V4L2_CAP_DEVICE_CAPS ? capability.device_caps
                                                                        : capability.capabilities;
    device->planes =
        (can & V4L2_CAP_VIDEO_CAPTURE) == 0 && (can & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0;
    if ((can & V4L2_CAP_VIDEO_CAPTURE) == 0 && !device->planes)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: found a node of '%.32s' that gives no pictures, expected a capture device (a camera's other node?)",
            device->uri, (const char *)capability.card);
    if ((can & V4L2_CAP_STREAMING) == 0)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "%s: found '%.32s', expected one that can stream", device->uri,
                               (const char *)capability.card);
    return FOVEA_OK;
}

/* ---- format ---------------------------------------------------------------------------------- */

/* The driver's formats, as a list for people; the row of the best one that we take, or NULL. */
static const struct fv_v4l2_format *list_formats(const struct fv_v4l2_device *device, char *list,
                                                 size_t bytes)
{
    const struct fv_v4l2_format *best = NULL;
    size_t used = 0;
    list[0] = '\0';
    for (uint32_t i = 0; i < 64; i++) {
        struct v4l2_fmtdesc row = {.index = i, .type = fv_v4l2_type(device)};
        char text[5];
        if (fv_v4l2_system->ioctl(device->fd, VIDIOC_ENUM_FMT, &row) != 0) break;
        const struct fv_v4l2_format *format = fv_v4l2_format_by_fourcc(row.pixelformat);
        if (format != NULL && (best == NULL || format < best)) best = format;
        if (used < bytes)
            used += (size_t)snprintf(list + used, bytes - used, "%s%s", i > 0 ? " " : "",
                                     fv_v4l2_fourcc(row.pixelformat, text));
    }
    return best;
}

static enum fovea_status choose_format(const struct fv_v4l2_device *device, struct picture *picture,
                                       struct fovea_error *error)
{
    char list[256];
    if (device->known) {
        picture->fourcc = device->agreed.format->fourcc;
        return FOVEA_OK;
    }
    const struct fv_v4l2_format *best = list_formats(device, list, sizeof list);
    if (device->options.format > 0) best = &fv_v4l2_formats[device->options.format - 1];
    if (best == NULL)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "%s: format: found only %s, expected one that Fovea reads",
                               device->uri, list);
    picture->fourcc = best->fourcc;
    return FOVEA_OK;
}

static enum fovea_status refuse_format(const struct fv_v4l2_device *device, uint32_t asked,
                                       uint32_t given, struct fovea_error *error)
{
    char list[256], wanted[5], found[5];
    list_formats(device, list, sizeof list);
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%s: format: found %s, expected %s; the camera gives: %s", device->uri,
                           fv_v4l2_fourcc(given, found), fv_v4l2_fourcc(asked, wanted), list);
}

void fv_v4l2_notice(struct fovea_error *notice, const struct fv_v4l2_device *device,
                    const char *what, double asked, double given)
{
    if (notice == NULL) return;
    const size_t used = strlen(notice->text);
    snprintf(notice->text + used, sizeof notice->text - used,
             "%s%s%s: asked %g, the camera gives %g", used > 0 ? "" : device->uri,
             used > 0 ? "; " : ": ", what, asked, given);
}

static enum fovea_status check_picture(const struct fv_v4l2_device *device,
                                       const struct picture *asked, const struct picture *given,
                                       struct fovea_error *error)
{
    const struct fv_v4l2_agreed *agreed = &device->agreed;
    if (given->fourcc != asked->fourcc)
        return refuse_format(device, asked->fourcc, given->fourcc, error);
    if (given->plane_count != 1)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "%s: found pictures in %u pieces, expected one", device->uri,
                               given->plane_count);
    if (given->field != V4L2_FIELD_NONE && given->field != V4L2_FIELD_ANY)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "%s: found interlaced pictures, expected progressive ones",
                               device->uri);
    if (given->width < FOVEA_IMAGE_WIDTH_MIN || given->width > FOVEA_IMAGE_WIDTH_MAX ||
        given->height < FOVEA_IMAGE_HEIGHT_MIN || given->height > FOVEA_IMAGE_HEIGHT_MAX)
        return fovea_error_set(
            error, FOVEA_ERROR_UNSUPPORTED, "%s: found %u x %u pixels, expected %d to %d",
            device->uri, given->width, given->height, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_WIDTH_MAX);
    if (device->known &&
        (given->width != (uint32_t)agreed->width || given->height != (uint32_t)agreed->height))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found %u x %u pixels after it came back, expected %d x %d",
                               device->uri, given->width, given->height, agreed->width,
                               agreed->height);
    return FOVEA_OK;
}

/* Formats that a Y16 with fewer significant bits is the same as. */
static const struct fv_v4l2_format *shifted(const struct fv_v4l2_options *options,
                                            const struct fv_v4l2_format *format)
{
    static const struct fv_v4l2_format by_shift[] = {
        {"Y16", V4L2_PIX_FMT_Y16, FOVEA_PIXEL_Y10},
        {"Y16", V4L2_PIX_FMT_Y16, FOVEA_PIXEL_Y12},
        {"Y16", V4L2_PIX_FMT_Y16, FOVEA_PIXEL_Y14},
    };
    if (format->format != FOVEA_PIXEL_Y16 || options->shift == 8) return format;
    return &by_shift[options->shift / 2 - 1];
}

static enum fovea_status set_format(struct fv_v4l2_device *device, struct fovea_error *notice,
                                    struct fovea_error *error)
{
    struct v4l2_format format = {.type = fv_v4l2_type(device)};
    struct picture asked, given;
    const struct fv_v4l2_options *options = &device->options;
    if (fv_v4l2_system->ioctl(device->fd, VIDIOC_G_FMT, &format) != 0)
        return fv_v4l2_failed(device, "asking for its format", errno, error);
    unpack(device, &format, &asked);
    if (options->width > 0) {
        asked.width = (uint32_t)options->width;
        asked.height = (uint32_t)options->height;
    }
    if (device->known) {
        asked.width = (uint32_t)device->agreed.width;
        asked.height = (uint32_t)device->agreed.height;
    }
    enum fovea_status status = choose_format(device, &asked, error);
    if (status != FOVEA_OK) return status;
    pack(device, &asked, &format);
    if (fv_v4l2_system->ioctl(device->fd, VIDIOC_S_FMT, &format) != 0) {
        if (errno == EINVAL) return refuse_format(device, asked.fourcc, 0, error);
        return fv_v4l2_failed(device, "setting its format", errno, error);
    }
    unpack(device, &format, &given);
    status = check_picture(device, &asked, &given, error);
    if (status != FOVEA_OK) return status;
    if (given.width != asked.width)
        fv_v4l2_notice(notice, device, "width", asked.width, given.width);
    if (given.height != asked.height)
        fv_v4l2_notice(notice, device, "height", asked.height, given.height);
    device->agreed.format = shifted(options, fv_v4l2_format_by_fourcc(given.fourcc));
    device->agreed.width = (int32_t)given.width;
    device->agreed.height = (int32_t)given.height;
    const int32_t least =
        fovea_image_stride_min(device->agreed.format->format, (int32_t)given.width);
    device->agreed.stride_bytes = (int32_t)given.stride_bytes;
    if (device->agreed.stride_bytes < least)
        device->agreed.stride_bytes = least; /* some drivers say 0 */
    return FOVEA_OK;
}

/* ---- rate ------------------------------------------------------------------------------------ */

static enum fovea_status set_rate(struct fv_v4l2_device *device, struct fovea_error *notice,
                                  struct fovea_error *error)
{
    struct v4l2_streamparm parameters = {.type = fv_v4l2_type(device)};
    struct v4l2_fract *period = &parameters.parm.capture.timeperframe;
    const double asked = device->options.rate_hz;
    if (fv_v4l2_system->ioctl(device->fd, VIDIOC_G_PARM, &parameters) != 0) {
        if (errno == ENODEV) return fv_v4l2_failed(device, "asking for its rate", errno, error);
        device->agreed.rate_hz = asked; /* the driver knows of no rates */
        return FOVEA_OK;
    }
    if (asked > 0 && (parameters.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) != 0) {
        period->numerator = 1000;
        period->denominator = (uint32_t)(asked * 1000 + 0.5);
        if (fv_v4l2_system->ioctl(device->fd, VIDIOC_S_PARM, &parameters) != 0 &&
            fv_v4l2_system->ioctl(device->fd, VIDIOC_G_PARM, &parameters) != 0)
            return fv_v4l2_failed(device, "setting its rate", errno, error);
    }
    device->agreed.rate_hz = asked;
    if (period->numerator > 0 && period->denominator > 0)
        device->agreed.rate_hz = (double)period->denominator / period->numerator;
    const double rate = device->agreed.rate_hz;
    if (asked > 0 && (rate < 0.99 * asked || rate > 1.01 * asked))
        fv_v4l2_notice(notice, device, "rate", asked, rate);
    return FOVEA_OK;
}

enum fovea_status fv_v4l2_negotiate(struct fv_v4l2_device *device, struct fovea_error *notice,
                                    struct fovea_error *error)
{
    enum fovea_status status = check_kind(device, error);
    if (status == FOVEA_OK) status = set_format(device, notice, error);
    return status == FOVEA_OK ? set_rate(device, notice, error) : status;
}
