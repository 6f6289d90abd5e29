/* v4l2: the device behind the live source. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../clock.h"
#include "../live/split.h"
#include "v4l2.h"

static void close_node(struct fv_v4l2_device *device)
{
    if (device->fd >= 0) fv_v4l2_system->close(device->fd);
    device->fd = -1;
}

static enum fovea_status open_node(struct fv_v4l2_device *device, struct fovea_error *error)
{
    device->fd = fv_v4l2_system->open(device->node);
    return device->fd >= 0 ? FOVEA_OK : fv_v4l2_failed(device, "opening it", errno, error);
}

static void tear_down(void *of)
{
    struct fv_v4l2_device *device = of;
    fv_v4l2_stream_off(device);
    close_node(device);
}

static enum fovea_status set_up(void *of, int quit_fd, struct fovea_error *error)
{
    struct fv_v4l2_device *device = of;
    (void)quit_fd; /* no call of the kernel can be left early */
    struct fovea_error refused = {.text = ""};
    enum fovea_status status = open_node(device, error);
    if (status != FOVEA_OK) return status;
    status = fv_v4l2_negotiate(device, NULL, error);
    /* A camera that came back and now refuses a control is still better than none: a line says so.
     */
    if (status == FOVEA_OK && fv_v4l2_controls_set(device, NULL, &refused) == FOVEA_GONE)
        status = FOVEA_GONE;
    if (status == FOVEA_OK) status = fv_v4l2_stream_on(device, error);
    if (status != FOVEA_OK)
        tear_down(device);
    else if (refused.text[0] != '\0')
        *error = refused;
    return status;
}

static enum fovea_status find(void *device, int quit_fd, struct fovea_error *error)
{
    (void)quit_fd;
    return fv_v4l2_find(device, error);
}

static enum fovea_status change(void *of, enum fovea_source_control control, double value,
                                int quit_fd, struct fovea_error *error)
{
    struct fv_v4l2_device *device = of;
    const bool closed = device->fd < 0;
    (void)quit_fd;
    enum fovea_status status = closed ? open_node(device, error) : FOVEA_OK;
    if (status == FOVEA_OK) status = fv_v4l2_control(device, control, value, error);
    if (closed) close_node(device);
    return status;
}

static void seen(void *device, const struct fovea_image *image)
{
    fv_v4l2_auto_gain_seen(device, image);
}

static const struct fv_live_ops live_ops = {
    .find = find,
    .set_up = set_up,
    .tear_down = tear_down,
    .take = fv_v4l2_take,
    .give = fv_v4l2_give,
    .control = change,
    .seen = seen,
    .close = free,
};

/* Look once at everything: the camera is there, gives what is asked for, and takes its controls. */
static enum fovea_status learn(struct fv_v4l2_device *device, struct fovea_error *notice,
                               struct fovea_error *error)
{
    if (fv_v4l2_find(device, error) != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found no such device, expected a camera: is it plugged in?",
                               device->uri);
    enum fovea_status status = open_node(device, error);
    if (status != FOVEA_OK) return status;
    status = fv_v4l2_negotiate(device, notice, error);
    if (status == FOVEA_OK) status = fv_v4l2_controls_set(device, notice, error);
    if (status == FOVEA_OK && !fv_v4l2_identify(device->fd, device->node, &device->identity))
        status = fv_v4l2_failed(device, "asking for it", errno, error);
    close_node(device);
    if (status != FOVEA_OK) return status;
    fv_v4l2_identity_settle(&device->identity, device->node);
    device->known = true;
    return FOVEA_OK;
}

static enum fovea_status check_split(const struct fv_v4l2_device *device, struct fovea_error *error)
{
    const struct fv_v4l2_format *format = device->agreed.format;
    if (device->options.split < 2 || fv_split_possible(format->format, device->agreed.width))
        return FOVEA_OK;
    return fovea_error_set(
        error, FOVEA_ERROR_INPUT,
        "%s: split: found 2 with %s, %d pixels wide, expected a format of one plane (GREY, YUYV, MJPG and others) whose halves are at least %d pixels wide",
        device->uri, format->name, device->agreed.width, FOVEA_IMAGE_WIDTH_MIN);
}

static enum fovea_status open_camera(const char *address,
                                     const struct fovea_source_selection *selection,
                                     struct fovea_source **source, struct fovea_error *error)
{
    struct fovea_error notice = {.text = ""};
    struct fv_v4l2_options options;
    enum fovea_status status = fv_live_selection("v4l2", selection, error);
    if (status == FOVEA_OK) status = fv_v4l2_options_parse(address, &options, error);
    if (status != FOVEA_OK) return status;
    struct fv_v4l2_device *device = calloc(1, sizeof *device);
    if (device == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "v4l2: out of memory");
    device->options = device->asked = options;
    device->fd = -1;
    snprintf(device->uri, sizeof device->uri, "v4l2:%s", options.path);
    status = learn(device, &notice, error);
    if (status == FOVEA_OK) status = check_split(device, error);
    if (status != FOVEA_OK) {
        free(device);
        return status == FOVEA_GONE ? FOVEA_ERROR_SYSTEM : status;
    }
    const struct fv_live_setup setup = {
        .uri = device->uri,
        .info = {.cameras[0] = {.width = device->agreed.width,
                                .height = device->agreed.height,
                                .stride_bytes = device->agreed.stride_bytes},
                 .format = device->agreed.format->format,
                 .rate_hz = device->agreed.rate_hz,
                 .heap_bytes = sizeof *device},
        .split = options.split == 2,
        .buffers = (uint32_t)options.buffers,
        .readout_ns = options.readout_ms < 0 ? -1 : fv_clock_from_ms(options.readout_ms),
    };
    status = fv_live_open(&live_ops, device, &setup, selection, source, error);
    if (status == FOVEA_OK && notice.text[0] != '\0') fv_live_notice(*source, &notice);
    return status;
}

const struct fovea_source_ops fv_source_v4l2 = FV_LIVE_OPS(
    "v4l2", "DEVICE[?width=..&format=..]  camera by Video4Linux, as /dev/video0", open_camera);
