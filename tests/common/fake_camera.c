#include "common/fake_inside.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

int64_t fake_clock_ns(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

int fake_refuse(int reason)
{
    errno = reason;
    return -1;
}

bool fake_alive(const struct fake_camera *camera)
{
    return camera->plugged && camera->open_now > 0 && !camera->dead;
}

/* ---- pictures -------------------------------------------------------------------------------- */

static size_t bytes_per_2_pixels(uint32_t format)
{
    switch (format) {
    case V4L2_PIX_FMT_RGB24:
    case V4L2_PIX_FMT_BGR24:
        return 6;
    case V4L2_PIX_FMT_YUYV:
    case V4L2_PIX_FMT_UYVY:
    case V4L2_PIX_FMT_Y10:
    case V4L2_PIX_FMT_Y12:
    case V4L2_PIX_FMT_Y16:
        return 4;
    default:
        return 2;
    }
}

static uint32_t stride_of(const struct fake_camera *camera)
{
    if (camera->format == V4L2_PIX_FMT_MJPEG) return 0;
    return (uint32_t)((size_t)camera->set_width * bytes_per_2_pixels(camera->format) / 2) +
           (uint32_t)camera->stride_padding;
}

static uint32_t size_of(const struct fake_camera *camera)
{
    const bool chroma =
        camera->format == V4L2_PIX_FMT_NV12 || camera->format == V4L2_PIX_FMT_YUV420;
    if (camera->format == V4L2_PIX_FMT_MJPEG) return FAKE_FRAME_BYTES_MAX / 16;
    return stride_of(camera) * (uint32_t)camera->set_height * (chroma ? 3 : 2) / 2;
}

static size_t fill_frame(const struct fake_camera *camera, uint32_t index, uint8_t *data)
{
    if (camera->fill != NULL) return camera->fill(index, data, camera->buffer_bytes);
    const size_t bytes = size_of(camera);
    for (size_t i = 0; i < bytes; i++)
        data[i] = (uint8_t)(i + 37 * (size_t)index);
    return bytes;
}

static int64_t make_stamp(struct fake_camera *camera, uint32_t *flags)
{
    const int64_t now_ns = fake_clock_ns(CLOCK_MONOTONIC), before_ns = camera->last_stamp_ns;
    int64_t stamp_ns = now_ns;
    *flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    switch (camera->stamps) {
    case FAKE_STAMPS_MONOTONIC:
        break;
    case FAKE_STAMPS_END:
        *flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
        break;
    case FAKE_STAMPS_BOOTTIME:
        *flags = 0, stamp_ns = fake_clock_ns(CLOCK_BOOTTIME);
        break;
    case FAKE_STAMPS_REALTIME:
        *flags = 0, stamp_ns = fake_clock_ns(CLOCK_REALTIME);
        break;
    case FAKE_STAMPS_STRANGE:
        *flags = 0, stamp_ns = 123456789000 + camera->made * INT64_C(1000);
        break;
    case FAKE_STAMPS_REPEATED:
        if (camera->made % 2 == 1) stamp_ns = before_ns;
        break;
    case FAKE_STAMPS_BACKWARD:
        if (camera->made % 3 == 2) stamp_ns = before_ns - 5000000;
        break;
    }
    /* The kernel's stamps have microseconds. */
    if (stamp_ns != before_ns && stamp_ns / 1000 == before_ns / 1000) stamp_ns += 1000;
    camera->last_stamp_ns = stamp_ns;
    return stamp_ns;
}

static bool every(uint32_t made, uint32_t period)
{
    return period > 0 && made % period == period - 1;
}

/* ---- buffers --------------------------------------------------------------------------------- */

bool fake_frame_ready(const struct fake_camera *camera)
{
    return camera->streaming && !camera->silent && camera->queue_count > 0 &&
           (camera->set_rate_hz == 0 || fake_clock_ns(CLOCK_MONOTONIC) >= camera->due_ns);
}

static void set_used(const struct fake_camera *camera, struct v4l2_buffer *buffer, uint32_t bytes)
{
    if (camera->planes)
        buffer->m.planes[0].bytesused = bytes, buffer->m.planes[0].data_offset = 0;
    else
        buffer->bytesused = bytes;
}

static int dequeue(struct fake_camera *camera, struct v4l2_buffer *buffer)
{
    if (camera->fatal) return fake_refuse(EIO);
    if (!camera->streaming) return fake_refuse(EINVAL);
    if (!fake_frame_ready(camera)) return fake_refuse(EAGAIN);
    const int64_t now_ns = fake_clock_ns(CLOCK_MONOTONIC);
    uint32_t flags;
    if (camera->set_rate_hz > 0) {
        camera->due_ns += (int64_t)(1e9 / camera->set_rate_hz);
        if (camera->due_ns < now_ns - 100000000) camera->due_ns = now_ns;
    }
    const uint32_t index = camera->queue[0];
    memmove(camera->queue, camera->queue + 1, --camera->queue_count * sizeof camera->queue[0]);
    camera->queued[index] = false;
    if (every(camera->made, camera->drop_every)) camera->sequence++;
    size_t used = fill_frame(camera, camera->made, camera->memory + index * camera->buffer_bytes);
    if (every(camera->made, camera->truncate_every)) used /= 2;
    const int64_t stamp_ns = make_stamp(camera, &flags);
    buffer->index = index;
    buffer->flags = flags | (every(camera->made, camera->error_every) ? V4L2_BUF_FLAG_ERROR : 0);
    buffer->sequence = camera->sequence++;
    buffer->timestamp.tv_sec = stamp_ns / 1000000000;
    buffer->timestamp.tv_usec = stamp_ns / 1000 % 1000000;
    set_used(camera, buffer, (uint32_t)used);
    camera->made++;
    camera->frames++;
    return 0;
}

static int request_buffers(struct fake_camera *camera, struct v4l2_requestbuffers *request)
{
    if (request->count == 0) {
        camera->buffer_count = camera->queue_count = 0;
        return camera->mapped_now > 0 ? fake_refuse(EBUSY) : 0;
    }
    if (camera->buffers_max > 0 && request->count > camera->buffers_max)
        request->count = camera->buffers_max;
    camera->buffer_count = request->count;
    camera->queue_count = 0;
    memset(camera->queued, 0, sizeof camera->queued);
    camera->buffer_bytes = (size_of(camera) + 4095u) / 4096u * 4096u;
    return 0;
}

static int query_buffer(struct fake_camera *camera, struct v4l2_buffer *buffer)
{
    if (buffer->index >= camera->buffer_count) return fake_refuse(EINVAL);
    const uint32_t offset = buffer->index * (uint32_t)camera->buffer_bytes;
    if (camera->planes)
        buffer->m.planes[0].length = (uint32_t)camera->buffer_bytes,
        buffer->m.planes[0].m.mem_offset = offset;
    else
        buffer->length = (uint32_t)camera->buffer_bytes, buffer->m.offset = offset;
    return 0;
}

static int queue_buffer(struct fake_camera *camera, const struct v4l2_buffer *buffer)
{
    if (buffer->index >= camera->buffer_count || camera->queued[buffer->index])
        return fake_refuse(EINVAL);
    camera->queued[buffer->index] = true;
    camera->queue[camera->queue_count++] = buffer->index;
    return 0;
}

int fake_stream(struct fake_camera *camera, bool on)
{
    camera->streaming = on;
    camera->fatal = camera->fatal && on;
    camera->queue_count = on ? camera->queue_count : 0;
    camera->due_ns = fake_clock_ns(CLOCK_MONOTONIC);
    if (!on) memset(camera->queued, 0, sizeof camera->queued);
    if (on) camera->set_ups++;
    if (on) camera->made = 0;
    return 0;
}

/* ---- formats and controls -------------------------------------------------------------------- */

static void describe(const struct fake_camera *camera, struct v4l2_format *format)
{
    struct v4l2_pix_format *pix = &format->fmt.pix;
    struct v4l2_pix_format_mplane *planes = &format->fmt.pix_mp;
    if (camera->planes) {
        planes->width = (uint32_t)camera->set_width, planes->height = (uint32_t)camera->set_height;
        planes->pixelformat = camera->format, planes->field = V4L2_FIELD_NONE,
        planes->num_planes = 1;
        planes->plane_fmt[0].bytesperline = stride_of(camera),
        planes->plane_fmt[0].sizeimage = size_of(camera);
    } else {
        pix->width = (uint32_t)camera->set_width, pix->height = (uint32_t)camera->set_height;
        pix->pixelformat = camera->format, pix->field = V4L2_FIELD_NONE;
        pix->bytesperline = stride_of(camera), pix->sizeimage = size_of(camera);
    }
}

static int set_format(struct fake_camera *camera, struct v4l2_format *format)
{
    const uint32_t wanted =
        camera->planes ? format->fmt.pix_mp.pixelformat : format->fmt.pix.pixelformat;
    const uint32_t width = camera->planes ? format->fmt.pix_mp.width : format->fmt.pix.width;
    const uint32_t height = camera->planes ? format->fmt.pix_mp.height : format->fmt.pix.height;
    camera->format = camera->formats[0];
    for (int i = 0; i < FAKE_FORMATS_MAX; i++)
        if (camera->formats[i] == wanted) camera->format = wanted;
    camera->set_width = camera->any_size ? (int32_t)width : camera->width;
    camera->set_height = camera->any_size ? (int32_t)height : camera->height;
    if (camera->width_now > 0) camera->set_width = camera->width_now;
    describe(camera, format);
    return 0;
}

static struct fake_control *control_of(struct fake_camera *camera, uint32_t id)
{
    struct fake_control *found = NULL;
    const bool next = (id & V4L2_CTRL_FLAG_NEXT_CTRL) != 0;
    id &= ~V4L2_CTRL_FLAG_NEXT_CTRL;
    for (int i = 0; i < FAKE_CONTROLS_MAX; i++) {
        struct fake_control *each = &camera->controls[i];
        if (each->name == NULL || (next ? each->id <= id : each->id != id)) continue;
        if (found == NULL || each->id < found->id) found = each;
    }
    return found;
}

const struct fake_control *fake_control(const struct fake_camera *camera, uint32_t id)
{
    return control_of((struct fake_camera *)(uintptr_t)camera, id);
}

static int query_control(struct fake_camera *camera, struct v4l2_query_ext_ctrl *info)
{
    const struct fake_control *control = control_of(camera, info->id);
    if (control == NULL) return fake_refuse(EINVAL);
    *info = (struct v4l2_query_ext_ctrl){.id = control->id,
                                         .type = control->type,
                                         .minimum = control->minimum,
                                         .maximum = control->maximum,
                                         .step = (uint64_t)control->step,
                                         .default_value = control->minimum};
    snprintf(info->name, sizeof info->name, "%s", control->name);
    return 0;
}

static int query_menu(struct fake_camera *camera, struct v4l2_querymenu *row)
{
    const struct fake_control *control = control_of(camera, row->id);
    if (control == NULL || row->index >= 5 || control->menu[row->index] == NULL)
        return fake_refuse(EINVAL);
    snprintf((char *)row->name, sizeof row->name, "%s", control->menu[row->index]);
    return 0;
}

static int access_control(struct fake_camera *camera, const struct v4l2_ext_controls *all,
                          bool write)
{
    struct fake_control *control = control_of(camera, all->controls[0].id);
    if (control == NULL) return fake_refuse(EINVAL);
    if (!write) {
        all->controls[0].value = (int32_t)control->value;
        return 0;
    }
    if (control->refuses != 0) return fake_refuse(control->refuses);
    if (all->controls[0].value < control->minimum || all->controls[0].value > control->maximum)
        return fake_refuse(ERANGE);
    control->value = all->controls[0].value;
    if (camera->grain > 0) control->value -= control->value % camera->grain;
    return 0;
}

static int parameters(struct fake_camera *camera, struct v4l2_streamparm *p, bool write)
{
    struct v4l2_fract *period = &p->parm.capture.timeperframe;
    if (camera->no_rates) return fake_refuse(ENOTTY);
    /* It gives at most its own rate. */
    if (write && period->numerator > 0 && camera->rate_hz > 0) {
        const double asked = (double)period->denominator / period->numerator;
        camera->set_rate_hz = asked < camera->rate_hz ? asked : camera->rate_hz;
    }
    p->parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
    *period = (struct v4l2_fract){1000, (uint32_t)(camera->set_rate_hz * 1000 + 0.5)};
    if (camera->set_rate_hz == 0) *period = (struct v4l2_fract){1, 900};
    return 0;
}

static int capability(const struct fake_camera *camera, struct v4l2_capability *c)
{
    *c = (struct v4l2_capability){.capabilities = V4L2_CAP_DEVICE_CAPS,
                                  .device_caps = V4L2_CAP_STREAMING};
    c->device_caps |= camera->planes ? V4L2_CAP_VIDEO_CAPTURE_MPLANE : V4L2_CAP_VIDEO_CAPTURE;
    snprintf((char *)c->driver, sizeof c->driver, "%s", camera->driver);
    snprintf((char *)c->card, sizeof c->card, "%s", camera->card);
    snprintf((char *)c->bus_info, sizeof c->bus_info, "%s", camera->bus_info);
    return 0;
}

static int enumerate(const struct fake_camera *camera, struct v4l2_fmtdesc *row)
{
    if (row->index >= FAKE_FORMATS_MAX || camera->formats[row->index] == 0)
        return fake_refuse(EINVAL);
    row->pixelformat = camera->formats[row->index];
    return 0;
}

/* Twice the size with half the rate is listed too, and every size of a camera that takes any. */
static int enumerate_sizes(const struct fake_camera *camera, struct v4l2_frmsizeenum *row)
{
    const uint32_t width = (uint32_t)camera->width, height = (uint32_t)camera->height;
    if (camera->no_rates) return fake_refuse(ENOTTY);
    if (row->index >= (camera->any_size ? 1 : 2)) return fake_refuse(EINVAL);
    row->type = camera->any_size ? V4L2_FRMSIZE_TYPE_STEPWISE : V4L2_FRMSIZE_TYPE_DISCRETE;
    if (camera->any_size)
        row->stepwise =
            (struct v4l2_frmsize_stepwise){width, 16 * width, 2, height, 16 * height, 2};
    else
        row->discrete = (struct v4l2_frmsize_discrete){width << row->index, height << row->index};
    return 0;
}

static int enumerate_rates(const struct fake_camera *camera, struct v4l2_frmivalenum *row)
{
    const bool twice = row->width > (uint32_t)camera->width;
    if (row->index >= 2) return fake_refuse(EINVAL);
    row->type = V4L2_FRMIVAL_TYPE_DISCRETE; /* the lower first */
    row->discrete = (struct v4l2_fract){
        twice ? 2000 : 1000, (uint32_t)(camera->rate_hz * (row->index == 0 ? 500 : 1000))};
    return 0;
}

static int event(struct fake_camera *camera, struct v4l2_event *out)
{
    if (!camera->source_change) return fake_refuse(ENOENT);
    camera->source_change = false;
    *out = (struct v4l2_event){.type = V4L2_EVENT_SOURCE_CHANGE};
    return 0;
}

int fake_answer(struct fake_camera *camera, unsigned long request, void *argument)
{
    switch (request) {
    case VIDIOC_QUERYCAP:
        return capability(camera, argument);
    case VIDIOC_ENUM_FMT:
        return enumerate(camera, argument);
    case VIDIOC_ENUM_FRAMESIZES:
        return enumerate_sizes(camera, argument);
    case VIDIOC_ENUM_FRAMEINTERVALS:
        return enumerate_rates(camera, argument);
    case VIDIOC_G_FMT:
        describe(camera, argument);
        return 0;
    case VIDIOC_S_FMT:
        return set_format(camera, argument);
    case VIDIOC_G_PARM:
        return parameters(camera, argument, false);
    case VIDIOC_S_PARM:
        return parameters(camera, argument, true);
    case VIDIOC_REQBUFS:
        return request_buffers(camera, argument);
    case VIDIOC_QUERYBUF:
        return query_buffer(camera, argument);
    case VIDIOC_QBUF:
        return queue_buffer(camera, argument);
    case VIDIOC_DQBUF:
        return dequeue(camera, argument);
    case VIDIOC_STREAMON:
        return fake_stream(camera, true);
    case VIDIOC_STREAMOFF:
        return fake_stream(camera, false);
    case VIDIOC_QUERY_EXT_CTRL:
        return query_control(camera, argument);
    case VIDIOC_QUERYMENU:
        return query_menu(camera, argument);
    case VIDIOC_G_EXT_CTRLS:
        return access_control(camera, argument, false);
    case VIDIOC_S_EXT_CTRLS:
        return access_control(camera, argument, true);
    case VIDIOC_SUBSCRIBE_EVENT:
        return 0;
    case VIDIOC_DQEVENT:
        return event(camera, argument);
    default:
        return fake_refuse(ENOTTY);
    }
}
