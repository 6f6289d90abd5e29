#include <string.h>

#include "support/uri_options.h"
#include "support/text.h"
#include "v4l2.h"

#define AT(member) offsetof(struct fv_v4l2_options, member)
enum { EXPOSURE = 5, AUTO_EXPOSURE = 7, AUTO_GAIN = 8 }; /* rows of the table */
static const struct fv_uri_option option_table[] = {
    {"width", FV_URI_I32, AT(width), FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_WIDTH_MAX, "pixels", NULL},
    {"height", FV_URI_I32, AT(height), FOVEA_IMAGE_HEIGHT_MIN, FOVEA_IMAGE_HEIGHT_MAX, "rows",
     NULL},
    {"rate", FV_URI_REAL, AT(rate_hz), 0.1, 1000, "Hz", NULL},
    {"format", FV_URI_WORD, AT(format), 0, 0,
     "any, GREY, NV12, YU12, YUYV, UYVY, Y10, Y12, Y16, RGGB, BGGR, GRBG, GBRG, MJPG, JPEG, RGB3 or BGR3",
     fv_v4l2_format_names},
    {"shift", FV_URI_I32, AT(shift), 2, 8, "bits that Y16 words are shifted right by", NULL},
    {"exposure", FV_URI_REAL, AT(exposure_ms), 0.01, 10000, "milliseconds", NULL},
    {"gain", FV_URI_REAL, AT(gain), 0, 1e9, "the driver's unit", NULL},
    {"auto_exposure", FV_URI_FLAG, AT(auto_exposure), 0, 1, "0 or 1", NULL},
    {"auto_gain", FV_URI_FLAG, AT(auto_gain), 0, 1, "0 or 1", NULL},
    {"readout", FV_URI_REAL, AT(readout_ms), 0, 1000, "milliseconds, first row to last", NULL},
    {"buffers", FV_URI_I32, AT(buffers), FV_LIVE_BUFFERS_MIN, FV_LIVE_BUFFERS_MAX,
     "buffers of the driver", NULL},
    {"split", FV_URI_I32, AT(split), 1, 2, "cameras side by side in one picture", NULL},
};

static enum fovea_status add_control_value(void *to, const char *name, const char *value,
                                           struct fovea_error *error)
{
    struct fv_v4l2_options *options = to;
    char quoted[FV_TEXT_QUOTED_BYTES];
    if (options->control_value_count == FV_V4L2_CONTROL_VALUES_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "v4l2: control.: found more than %d, expected fewer",
                               FV_V4L2_CONTROL_VALUES_MAX);
    if (name[0] == '\0' || strlen(name) >= FV_V4L2_WORD_BYTES ||
        strlen(value) >= FV_V4L2_WORD_BYTES)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "v4l2: control.: found %s, expected a name and a value of less than %d bytes",
            fv_text_quote(name, quoted, sizeof quoted), FV_V4L2_WORD_BYTES);
    struct fv_v4l2_control_value *given = &options->control_values[options->control_value_count++];
    memcpy(given->name, name, strlen(name) + 1);
    memcpy(given->value, value, strlen(value) + 1);
    return FOVEA_OK;
}

static const struct fv_uri_table options_table = {
    "v4l2",     option_table,      sizeof option_table / sizeof option_table[0],
    "control.", add_control_value, NULL};

static enum fovea_status check_together(const struct fv_v4l2_options *options,
                                        struct fovea_error *error)
{
    const bool y16 =
        options->format > 0 && strcmp(fv_v4l2_format_names[options->format], "Y16") == 0;
    if (options->exposure_ms > 0 && options->auto_exposure)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "v4l2: exposure: found a time together with auto_exposure=1, expected one of them");
    if (options->gain >= 0 && options->auto_gain)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "v4l2: gain: found a number together with auto_gain=1, expected one of them");
    if (options->shift != 2 && options->shift != 4 && options->shift != 6 && options->shift != 8)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "v4l2: shift: found %d, expected 2, 4, 6 or 8 (10, 12, 14 or 16 significant bits)",
            options->shift);
    if (options->shift != 8 && !y16)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "v4l2: shift: found %d, expected it with format=Y16 only",
                               options->shift);
    if ((options->width == 0) != (options->height == 0))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "v4l2: %s: found none, expected width and height or neither",
                               options->width == 0 ? "width" : "height");
    return FOVEA_OK;
}

enum fovea_status fv_v4l2_options_parse(const char *address, struct fv_v4l2_options *options,
                                        struct fovea_error *error)
{
    struct fv_v4l2_options o = {.gain = -1, .readout_ms = -1, .buffers = 4, .shift = 8, .split = 1};
    char quoted[FV_TEXT_QUOTED_BYTES];
    uint64_t given;
    const size_t length = strcspn(address, "?");
    if (length == 0 || length >= sizeof o.path || address[0] != '/')
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "v4l2: found %s, expected the path of a device, as /dev/video0 or /dev/v4l/by-id/...",
            fv_text_quote(address, quoted, sizeof quoted));
    memcpy(o.path, address, length);
    address += length;
    if (*address == '?') address++;
    enum fovea_status status = fv_uri_options_parse(&options_table, address, &o, &given, error);
    if (status == FOVEA_OK) status = check_together(&o, error);
    if (status != FOVEA_OK) return status;
    o.auto_exposure_given = (given >> AUTO_EXPOSURE & 1) != 0;
    o.auto_gain_given = (given >> AUTO_GAIN & 1) != 0;
    /* A camera whose exposure follows the light by itself has other blur and other stamps in every
     * room. */
    if ((given >> EXPOSURE & 1) != 0) o.auto_exposure_given = true;
    *options = o;
    return FOVEA_OK;
}
