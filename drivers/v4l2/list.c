/* The V4L2 cameras of this host (drivers/cameras.h). */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../cameras.h"
#include "v4l2.h"

static int call(int fd, unsigned long request, void *argument)
{
    return fv_v4l2_system->ioctl(fd, request, argument);
}

static int by_name(const void *a, const void *b)
{
    const char *first = a, *second = b;
    const size_t one = strlen(first), two = strlen(second);
    return one != two ? (one > two) - (one < two) : strcmp(first, second); /* video2, video10 */
}

/* A name that udev keeps: by the serial number where it is this camera's alone, else by the port,
 * else by the model. */
static void name_camera(struct fv_camera *camera, const struct fv_v4l2_identity *identity)
{
    static const char by_id[] = "/dev/v4l/by-id", by_path[] = "/dev/v4l/by-path";
    const bool serial = identity->serial[0] != '\0';
    if (fv_v4l2_system->link(serial ? by_id : by_path, camera->node, camera->name)) return;
    if (fv_v4l2_system->link(serial ? by_path : by_id, camera->node, camera->name)) return;
    memcpy(camera->name, camera->node, sizeof camera->name);
}

/* ---- formats, sizes, rates ------------------------------------------------------------------- */

static void add_rate(struct fv_camera_mode *mode, const struct v4l2_fract *period)
{
    if (period->numerator == 0 || mode->rate_count == FV_CAMERA_RATES_MAX) return;
    const double rate = (double)period->denominator / period->numerator;
    uint32_t at = mode->rate_count;
    while (at > 0 && mode->rates_hz[at - 1] < rate) {
        mode->rates_hz[at] = mode->rates_hz[at - 1];
        at--;
    }
    mode->rates_hz[at] = rate;
    mode->rate_count++;
}

static void add_rates(int fd, uint32_t fourcc, struct fv_camera_mode *mode)
{
    struct v4l2_frmivalenum row = {
        .pixel_format = fourcc, .width = (uint32_t)mode->width, .height = (uint32_t)mode->height};
    while (call(fd, VIDIOC_ENUM_FRAMEINTERVALS, &row) == 0 &&
           mode->rate_count < FV_CAMERA_RATES_MAX) {
        if (row.type != V4L2_FRMIVAL_TYPE_DISCRETE) { /* everything between */
            add_rate(mode, &row.stepwise.min);
            add_rate(mode, &row.stepwise.max);
            return;
        }
        add_rate(mode, &row.discrete);
        row.index++;
    }
}

/* One more mode of the format, or NULL where the table is full. */
static struct fv_camera_mode *add_mode(struct fv_camera *camera, uint32_t fourcc)
{
    if (camera->mode_count == FV_CAMERA_MODES_MAX) return NULL;
    struct fv_camera_mode *mode = &camera->modes[camera->mode_count++];
    const struct fv_v4l2_format *format = fv_v4l2_format_by_fourcc(fourcc);
    char text[5];
    snprintf(mode->format, sizeof mode->format, "%s",
             format != NULL ? format->name : fv_v4l2_fourcc(fourcc, text));
    mode->read = format != NULL;
    mode->rank = format != NULL ? (int32_t)(format - fv_v4l2_formats) : 0;
    return mode;
}

static void add_sizes(int fd, uint32_t fourcc, struct fv_camera *camera)
{
    struct v4l2_frmsizeenum row = {.pixel_format = fourcc};
    struct fv_camera_mode *mode;
    if (call(fd, VIDIOC_ENUM_FRAMESIZES, &row) != 0) {
        add_mode(camera, fourcc);
        return;
    }
    do {
        if ((mode = add_mode(camera, fourcc)) == NULL) return;
        const bool discrete = row.type == V4L2_FRMSIZE_TYPE_DISCRETE;
        mode->width = (int32_t)(discrete ? row.discrete.width : row.stepwise.min_width);
        mode->height = (int32_t)(discrete ? row.discrete.height : row.stepwise.min_height);
        mode->width_max = discrete ? mode->width : (int32_t)row.stepwise.max_width;
        mode->height_max = discrete ? mode->height : (int32_t)row.stepwise.max_height;
        add_rates(fd, fourcc, mode);
        row.index++;
        if (!discrete) return;
    } while (call(fd, VIDIOC_ENUM_FRAMESIZES, &row) == 0);
}

static void add_formats(int fd, uint32_t type, struct fv_camera *camera)
{
    struct v4l2_fmtdesc row = {.type = type};
    while (row.index < 64 && call(fd, VIDIOC_ENUM_FMT, &row) == 0) {
        add_sizes(fd, row.pixelformat, camera);
        row.index++;
    }
}

/* ---- controls -------------------------------------------------------------------------------- */

static void add_menu(int fd, const struct v4l2_query_ext_ctrl *info,
                     struct fv_camera_control *control)
{
    size_t used = 0;
    for (int64_t i = info->minimum; i <= info->maximum && i < 64; i++) {
        struct v4l2_querymenu row = {.id = info->id, .index = (uint32_t)i};
        char name[32];
        if (call(fd, VIDIOC_QUERYMENU, &row) != 0) continue;
        if (info->type == V4L2_CTRL_TYPE_INTEGER_MENU)
            snprintf(name, sizeof name, "%lld", (long long)row.value);
        else
            fv_v4l2_option_name((const char *)row.name, name);
        if (used + strlen(name) + 3 > sizeof control->menu) return;
        used += (size_t)snprintf(control->menu + used, sizeof control->menu - used, "%s%s",
                                 used > 0 ? ", " : "", name);
    }
}

static void add_value(int fd, uint32_t id, struct fv_camera_control *control)
{
    struct v4l2_ext_control one = {.id = id};
    struct v4l2_ext_controls all = {.which = V4L2_CTRL_WHICH_CUR_VAL, .count = 1, .controls = &one};
    control->has_value = call(fd, VIDIOC_G_EXT_CTRLS, &all) == 0;
    control->value = one.value;
}

static void add_controls(int fd, struct fv_camera *camera)
{
    struct v4l2_query_ext_ctrl info = {.id = V4L2_CTRL_FLAG_NEXT_CTRL};
    for (; camera->control_count < FV_CAMERA_CONTROLS_MAX &&
           call(fd, VIDIOC_QUERY_EXT_CTRL, &info) == 0;
         info = (struct v4l2_query_ext_ctrl){.id = info.id | V4L2_CTRL_FLAG_NEXT_CTRL}) {
        const bool number =
            info.type == V4L2_CTRL_TYPE_INTEGER || info.type == V4L2_CTRL_TYPE_BOOLEAN ||
            info.type == V4L2_CTRL_TYPE_MENU || info.type == V4L2_CTRL_TYPE_INTEGER_MENU;
        if (!number || (info.flags & V4L2_CTRL_FLAG_DISABLED) != 0) continue;
        struct fv_camera_control *control = &camera->controls[camera->control_count++];
        fv_v4l2_option_name(info.name, control->name);
        control->has_range = true;
        control->minimum = (double)info.minimum;
        control->maximum = (double)info.maximum;
        control->step = (double)info.step;
        control->standard = (double)info.default_value;
        add_value(fd, info.id, control);
        if (info.type == V4L2_CTRL_TYPE_MENU || info.type == V4L2_CTRL_TYPE_INTEGER_MENU)
            add_menu(fd, &info, control);
    }
}

/* ---- nodes ----------------------------------------------------------------------------------- */

/* False: the node takes no pictures, as those of metadata beside a USB camera. */
static bool list_node(const char *node, struct fv_camera *camera)
{
    struct fv_v4l2_identity identity;
    struct v4l2_capability capability = {0};
    memset(camera, 0, sizeof *camera);
    camera->driver = "v4l2";
    snprintf(camera->node, sizeof camera->node, "%s", node);
    const int fd = fv_v4l2_system->open(node);
    if (fd < 0) {
        snprintf(camera->trouble, sizeof camera->trouble, "cannot be opened: %s%s", strerror(errno),
                 errno == EACCES ? ": add the user to the group video" : "");
        memcpy(camera->name, camera->node, sizeof camera->name);
        fv_camera_make_uri(camera);
        return errno != ENOENT && errno != ENODEV;
    }
    const bool known =
        call(fd, VIDIOC_QUERYCAP, &capability) == 0 && fv_v4l2_identify(fd, node, &identity);
    const uint32_t can = capability.capabilities & V4L2_CAP_DEVICE_CAPS ? capability.device_caps
                                                                        : capability.capabilities;
    const bool planes = (can & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0;
    const bool captures = known && (planes || (can & V4L2_CAP_VIDEO_CAPTURE) != 0);
    if (captures) {
        fv_v4l2_identity_settle(&identity, node);
        snprintf(camera->model, sizeof camera->model, "%s", identity.card);
        snprintf(camera->place, sizeof camera->place, "%s, %s", identity.driver, identity.bus_info);
        name_camera(camera, &identity);
        add_formats(fd, planes ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE,
                    camera);
        add_controls(fd, camera);
        fv_camera_make_uri(camera);
    }
    fv_v4l2_system->close(fd);
    return captures && camera->mode_count > 0;
}

void fv_cameras_v4l2(struct fv_camera *cameras, size_t capacity, size_t *count)
{
    static char nodes[FV_V4L2_NODES_MAX][FV_V4L2_PATH_BYTES]; /* init-only */
    const size_t node_count = fv_v4l2_system->nodes(nodes);
    qsort(nodes, node_count, sizeof nodes[0], by_name);
    for (size_t i = 0; i < node_count && *count < capacity; i++)
        if (list_node(nodes[i], &cameras[*count])) ++*count;
}
