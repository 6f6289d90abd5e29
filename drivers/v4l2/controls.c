/* Exposure, gain and controls by name, held against the ranges that the driver states. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "support/uri_options.h"
#include "support/text.h"
#include "v4l2.h"

enum { CONTROLS_MAX = 96 };

typedef struct v4l2_query_ext_ctrl control_info;

void fv_v4l2_option_name(const char *name, char out[32])
{
    size_t used = 0;
    for (bool gap = false; *name != '\0' && used < 31; name++) {
        const bool upper = *name >= 'A' && *name <= 'Z';
        const bool kept = upper || (*name >= 'a' && *name <= 'z') || (*name >= '0' && *name <= '9');
        if (kept && gap && used > 0) out[used++] = '_';
        if (kept) out[used++] = upper ? (char)(*name - 'A' + 'a') : *name;
        gap = !kept;
    }
    out[used] = '\0';
}

static bool query(const struct fv_v4l2_device *device, uint32_t id, control_info *info)
{
    *info = (control_info){.id = id};
    return fv_v4l2_system->ioctl(device->fd, VIDIOC_QUERY_EXT_CTRL, info) == 0 &&
           (info->flags & V4L2_CTRL_FLAG_DISABLED) == 0;
}

static enum fovea_status unknown(const struct fv_v4l2_device *device, const char *name,
                                 char names[][32], size_t count, struct fovea_error *error)
{
    const char *list[CONTROLS_MAX];
    for (size_t i = 0; i < count; i++)
        list[i] = names[i];
    return fv_uri_unknown(device->uri, "control", name, list, count, error);
}

/* The control of that name. */
static enum fovea_status find_by_name(const struct fv_v4l2_device *device, const char *name,
                                      control_info *info, struct fovea_error *error)
{
    char names[CONTROLS_MAX][32];
    size_t count = 0;
    for (uint32_t id = 0; count < CONTROLS_MAX;) {
        if (!query(device, id | V4L2_CTRL_FLAG_NEXT_CTRL, info)) break;
        id = info->id;
        if (info->type == V4L2_CTRL_TYPE_CTRL_CLASS) continue;
        fv_v4l2_option_name(info->name, names[count]);
        if (strcmp(names[count++], name) == 0) return FOVEA_OK;
    }
    return unknown(device, name, names, count, error);
}

/* ---- values ---------------------------------------------------------------------------------- */

/* A row of a menu by its name, in the form of option_name. */
static bool menu_row(const struct fv_v4l2_device *device, const control_info *info,
                     const char *text, int64_t *value)
{
    for (int64_t i = info->minimum; i <= info->maximum && i < 64; i++) {
        struct v4l2_querymenu row = {.id = info->id, .index = (uint32_t)i};
        char name[32], wanted[FV_V4L2_WORD_BYTES];
        if (fv_v4l2_system->ioctl(device->fd, VIDIOC_QUERYMENU, &row) != 0) continue;
        fv_v4l2_option_name((const char *)row.name, name);
        fv_v4l2_option_name(text, wanted);
        if (strcmp(name, wanted) != 0) continue;
        *value = i;
        return true;
    }
    return false;
}

static bool menu_has(const struct fv_v4l2_device *device, const control_info *info, int64_t value)
{
    struct v4l2_querymenu row = {.id = info->id, .index = (uint32_t)value};
    return fv_v4l2_system->ioctl(device->fd, VIDIOC_QUERYMENU, &row) == 0;
}

static enum fovea_status check_range(const struct fv_v4l2_device *device, const char *what,
                                     const control_info *info, int64_t value, double unit,
                                     struct fovea_error *error)
{
    const uint64_t step = info->step > 0 ? info->step : 1;
    const bool inside = value >= info->minimum && value <= info->maximum;
    if (inside && (uint64_t)(value - info->minimum) % step == 0) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%s: %s: found %.10g, expected [%.10g, %.10g] in steps of %.10g",
                           device->uri, what, (double)value * unit, (double)info->minimum * unit,
                           (double)info->maximum * unit, (double)step * unit);
}

static enum fovea_status write_value(const struct fv_v4l2_device *device, const char *what,
                                     const control_info *info, int64_t value,
                                     struct fovea_error *error)
{
    struct v4l2_ext_control control = {.id = info->id};
    struct v4l2_ext_controls all = {
        .which = V4L2_CTRL_WHICH_CUR_VAL, .count = 1, .controls = &control};
    if (info->type == V4L2_CTRL_TYPE_INTEGER64)
        control.value64 = value;
    else
        control.value = (int32_t)value;
    if (fv_v4l2_system->ioctl(device->fd, VIDIOC_S_EXT_CTRLS, &all) == 0) return FOVEA_OK;
    if (errno == ENODEV) return fv_v4l2_failed(device, "setting a control", errno, error);
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: %s: the camera refuses %lld: %s%s",
                           device->uri, what, (long long)value, strerror(errno),
                           info->flags & V4L2_CTRL_FLAG_READ_ONLY ? " (it can only be read)"
                           : info->flags & V4L2_CTRL_FLAG_INACTIVE
                               ? " (an automatic control is in charge of it)"
                               : "");
}

static bool read_value(const struct fv_v4l2_device *device, uint32_t id, int32_t *value)
{
    struct v4l2_ext_control control = {.id = id};
    struct v4l2_ext_controls all = {
        .which = V4L2_CTRL_WHICH_CUR_VAL, .count = 1, .controls = &control};
    if (fv_v4l2_system->ioctl(device->fd, VIDIOC_G_EXT_CTRLS, &all) != 0) return false;
    *value = control.value;
    return true;
}

/* What the camera made of a value, in our unit, where that is not what was asked for. */
static void notice_difference(const struct fv_v4l2_device *device, const char *what, uint32_t id,
                              double asked, double unit, struct fovea_error *notice)
{
    int32_t value;
    if (!read_value(device, id, &value)) return;
    if (fabs(value * unit - asked) > 0.01 * fabs(asked))
        fv_v4l2_notice(notice, device, what, asked, value * unit);
}

static enum fovea_status set_control_value(const struct fv_v4l2_device *device,
                                           const struct fv_v4l2_control_value *given,
                                           struct fovea_error *notice, struct fovea_error *error)
{
    control_info info;
    char what[FV_V4L2_WORD_BYTES + 16], quoted[FV_TEXT_QUOTED_BYTES];
    int64_t value = 0;
    snprintf(what, sizeof what, "control.%s", given->name);
    enum fovea_status status = find_by_name(device, given->name, &info, error);
    if (status != FOVEA_OK) return status;
    const bool menu = info.type == V4L2_CTRL_TYPE_MENU || info.type == V4L2_CTRL_TYPE_INTEGER_MENU;
    const bool number = menu || info.type == V4L2_CTRL_TYPE_INTEGER ||
                        info.type == V4L2_CTRL_TYPE_BOOLEAN ||
                        info.type == V4L2_CTRL_TYPE_INTEGER64 ||
                        info.type == V4L2_CTRL_TYPE_BITMASK || info.type == V4L2_CTRL_TYPE_BUTTON;
    if (!number)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "%s: %s: found a control of type %u, expected a number", device->uri,
                               what, info.type);
    const bool read = fv_text_integer(given->value, &value) ||
                      (menu && menu_row(device, &info, given->value, &value));
    if (!read || (menu && !menu_has(device, &info, value)))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: %s: found %s, expected %s in [%lld, %lld]", device->uri, what,
                               fv_text_quote(given->value, quoted, sizeof quoted),
                               menu ? "a row of the menu, by name or number," : "a whole number",
                               (long long)info.minimum, (long long)info.maximum);
    status = info.type == V4L2_CTRL_TYPE_BITMASK
                 ? FOVEA_OK
                 : check_range(device, what, &info, value, 1, error);
    if (status == FOVEA_OK) status = write_value(device, what, &info, value, error);
    if (status == FOVEA_OK && (menu || info.type == V4L2_CTRL_TYPE_INTEGER))
        notice_difference(device, what, info.id, (double)value, 1, notice);
    return status;
}

/* ---- exposure and gain ----------------------------------------------------------------------- */

/* Automatic exposure on or off. "Off" is the manual mode, "on" aperture priority (the lens is what
 * it is) or full. */
static enum fovea_status set_auto_exposure(const struct fv_v4l2_device *device, bool on,
                                           struct fovea_error *error)
{
    control_info info;
    if (!query(device, V4L2_CID_EXPOSURE_AUTO, &info)) {
        if (!on) return FOVEA_OK; /* nothing to switch off */
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: auto_exposure: this camera has none",
                               device->uri);
    }
    const int order[2][2] = {{V4L2_EXPOSURE_MANUAL, V4L2_EXPOSURE_SHUTTER_PRIORITY},
                             {V4L2_EXPOSURE_APERTURE_PRIORITY, V4L2_EXPOSURE_AUTO}};
    int value = order[on][0];
    if (!menu_has(device, &info, value)) value = order[on][1];
    return write_value(device, "auto_exposure", &info, value, error);
}

/* Automatic exposure may otherwise lower the frame rate in the dark. */
static void keep_rate(const struct fv_v4l2_device *device)
{
    control_info info;
    struct fovea_error unused;
    if (query(device, V4L2_CID_EXPOSURE_AUTO_PRIORITY, &info) &&
        (info.flags & V4L2_CTRL_FLAG_INACTIVE) == 0)
        (void)write_value(device, "exposure_dynamic_framerate", &info, 0, &unused);
}

static const double unit_ms = 0.1; /* of V4L2_CID_EXPOSURE_ABSOLUTE */

/* The time that is asked for, in the driver's unit, if that is in its range. */
static enum fovea_status find_exposure(const struct fv_v4l2_device *device, control_info *info,
                                       int64_t *value, struct fovea_error *error)
{
    if (!query(device, V4L2_CID_EXPOSURE_ABSOLUTE, info))
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: exposure: this driver knows no exposure in units of time, expected control.exposure=N in its own unit",
            device->uri);
    const int64_t step = info->step > 0 ? (int64_t)info->step : 1;
    const int64_t asked = (int64_t)(device->options.exposure_ms / unit_ms + 0.5);
    *value = asked < info->minimum || asked > info->maximum
                 ? asked
                 : info->minimum + (asked - info->minimum + step / 2) / step * step;
    return check_range(device, "exposure (ms)", info, *value, unit_ms, error);
}

static enum fovea_status set_exposure(const struct fv_v4l2_device *device,
                                      struct fovea_error *notice, struct fovea_error *error)
{
    control_info info;
    int64_t value = 0;
    enum fovea_status status = find_exposure(device, &info, &value, error);
    if (status == FOVEA_OK) status = write_value(device, "exposure", &info, value, error);
    if (status == FOVEA_OK)
        notice_difference(device, "exposure (ms)", info.id, device->options.exposure_ms, unit_ms,
                          notice);
    return status;
}

static enum fovea_status set_gain(struct fv_v4l2_device *device, struct fovea_error *notice,
                                  struct fovea_error *error)
{
    control_info info, automatic;
    const bool can = query(device, V4L2_CID_AUTOGAIN, &automatic);
    enum fovea_status status = FOVEA_OK;
    if (device->options.auto_gain_given && device->options.auto_gain && !can) {
        if (query(device, V4L2_CID_GAIN, &info) || query(device, V4L2_CID_ANALOGUE_GAIN, &info))
            return fv_v4l2_auto_gain_begin(device, &info, error);
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: auto_gain: this camera has no gain",
                               device->uri);
    }
    if (can && (device->options.auto_gain_given || device->options.gain >= 0))
        status = write_value(device, "auto_gain", &automatic, device->options.auto_gain, error);
    if (status != FOVEA_OK || device->options.gain < 0) return status;
    if (!query(device, V4L2_CID_GAIN, &info) && !query(device, V4L2_CID_ANALOGUE_GAIN, &info))
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: gain: this camera has none",
                               device->uri);
    const int64_t value = (int64_t)(device->options.gain + 0.5);
    status = check_range(device, "gain", &info, value, 1, error);
    if (status == FOVEA_OK) status = write_value(device, "gain", &info, value, error);
    if (status == FOVEA_OK)
        notice_difference(device, "gain", info.id, device->options.gain, 1, notice);
    return status;
}

/* Known only where it does not change by itself. */
static int64_t known_exposure(const struct fv_v4l2_device *device)
{
    int32_t mode, value;
    if (!read_value(device, V4L2_CID_EXPOSURE_ABSOLUTE, &value) || value <= 0) return 0;
    const bool can = read_value(device, V4L2_CID_EXPOSURE_AUTO, &mode);
    if (can && mode != V4L2_EXPOSURE_MANUAL && mode != V4L2_EXPOSURE_SHUTTER_PRIORITY) return 0;
    return (int64_t)value * 100000;
}

/* As the options have it. */
static enum fovea_status apply_exposure(const struct fv_v4l2_device *device,
                                        struct fovea_error *notice, struct fovea_error *error)
{
    const struct fv_v4l2_options *options = &device->options;
    enum fovea_status status = FOVEA_OK;
    if (options->auto_exposure_given)
        status = set_auto_exposure(device, options->auto_exposure, error);
    if (status == FOVEA_OK && options->auto_exposure_given) keep_rate(device);
    if (status == FOVEA_OK && options->exposure_ms > 0)
        status = set_exposure(device, notice, error);
    return status;
}

enum fovea_status fv_v4l2_controls_set(struct fv_v4l2_device *device, struct fovea_error *notice,
                                       struct fovea_error *error)
{
    const struct fv_v4l2_options *options = &device->options;
    enum fovea_status status = apply_exposure(device, notice, error);
    if (status == FOVEA_OK) status = set_gain(device, notice, error);
    for (uint32_t i = 0; i < options->control_value_count && status == FOVEA_OK; i++)
        status = set_control_value(device, &options->control_values[i], notice, error);
    device->exposure_ns = known_exposure(device);
    return status;
}

/* ---- while it runs --------------------------------------------------------------------------- */

static uint32_t mode_id(enum fovea_source_control control)
{
    return control == FOVEA_SOURCE_EXPOSURE ? V4L2_CID_EXPOSURE_AUTO : V4L2_CID_AUTOGAIN;
}

static uint32_t value_id(const struct fv_v4l2_device *device, enum fovea_source_control control)
{
    control_info info;
    if (control == FOVEA_SOURCE_EXPOSURE) return V4L2_CID_EXPOSURE_ABSOLUTE;
    return query(device, V4L2_CID_GAIN, &info) ? V4L2_CID_GAIN : V4L2_CID_ANALOGUE_GAIN;
}

static void remember(struct fv_v4l2_device *device, enum fovea_source_control control)
{
    struct fv_v4l2_before *before = &device->before[control];
    if (before->known) return;
    before->known = true;
    before->has_mode = read_value(device, mode_id(control), &before->mode);
    before->has_value = read_value(device, value_id(device, control), &before->value);
}

/* Where the address says nothing: as it was. An automatism that is on has the number to itself. */
static enum fovea_status put_back(const struct fv_v4l2_device *device,
                                  enum fovea_source_control control, struct fovea_error *error)
{
    static const char *const names[FOVEA_SOURCE_CONTROL_COUNT] = {"exposure", "gain"};
    const struct fv_v4l2_before *before = &device->before[control];
    control_info info;
    enum fovea_status status = FOVEA_OK;
    if (before->has_mode && query(device, mode_id(control), &info))
        status = write_value(device, names[control], &info, before->mode, error);
    if (status != FOVEA_OK || !before->has_value ||
        !query(device, value_id(device, control), &info) ||
        (info.flags & V4L2_CTRL_FLAG_INACTIVE) != 0)
        return status;
    return write_value(device, names[control], &info, before->value, error);
}

/* What the options say of the control, or as it was where they say nothing. */
static enum fovea_status apply(struct fv_v4l2_device *device, enum fovea_source_control control,
                               struct fovea_error *notice, struct fovea_error *error)
{
    const struct fv_v4l2_options *options = &device->options;
    const bool exposure = control == FOVEA_SOURCE_EXPOSURE;
    control_info info;
    int64_t value = 0;
    if (exposure ? !options->auto_exposure_given && !(options->exposure_ms > 0)
                 : !options->auto_gain_given && options->gain < 0)
        return put_back(device, control, error);
    if (!exposure) return set_gain(device, notice, error);
    /* Before the automatism is switched off for it. */
    if (options->exposure_ms > 0 && find_exposure(device, &info, &value, error) != FOVEA_OK)
        return FOVEA_ERROR_INPUT;
    return apply_exposure(device, notice, error);
}

static void change_options(struct fv_v4l2_device *device, enum fovea_source_control control,
                           double value)
{
    struct fv_v4l2_options *options = &device->options;
    const struct fv_v4l2_options *asked = &device->asked;
    if (control == FOVEA_SOURCE_EXPOSURE) {
        const bool given = value > 0;
        options->exposure_ms = given ? value : asked->exposure_ms;
        options->auto_exposure = !given && asked->auto_exposure;
        options->auto_exposure_given = given || asked->auto_exposure_given;
    } else {
        const bool given = value >= 0;
        options->gain = given ? value : asked->gain;
        options->auto_gain = !given && asked->auto_gain;
        options->auto_gain_given = given || asked->auto_gain_given;
        device->gain.id = 0; /* ours begins again where it is asked for */
    }
}

enum fovea_status fv_v4l2_control(struct fv_v4l2_device *device, enum fovea_source_control control,
                                  double value, struct fovea_error *error)
{
    const struct fv_v4l2_options before = device->options;
    const struct fv_v4l2_auto_gain gain = device->gain;
    struct fovea_error notice = {.text = ""}, unused;
    remember(device, control);
    change_options(device, control, value);
    const enum fovea_status status = apply(device, control, &notice, error);
    if (status != FOVEA_OK) {
        device->options = before;
        device->gain = gain;
        (void)apply(device, control, NULL, &unused);
    } else if (error != NULL) {
        *error = notice;
    }
    device->exposure_ns = known_exposure(device);
    return status;
}
