/* libcamera: options, and the process's camera behind the live source. */
#include <stdio.h>
#include <string.h>

#include "../clock.h"
#include "support/uri_options.h"
#include "support/text.h"
#include "client.h"

#define NAME_ROW(name, theirs, format) name,
static const char *const format_names[] = {"any", FV_LIBCAMERA_FORMATS(NAME_ROW) NULL};
static const char *const role_names[] = {"video", "viewfinder", "still", "raw", NULL};

#define AT(member) offsetof(struct fv_libcamera_options, member)
enum { EXPOSURE = 5, AUTO_EXPOSURE = 7, AUTO_GAIN = 8 }; /* rows of the table */
static const struct fv_uri_option option_table[] = {
    {"width", FV_URI_I32, AT(width), FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_WIDTH_MAX, "pixels", NULL},
    {"height", FV_URI_I32, AT(height), FOVEA_IMAGE_HEIGHT_MIN, FOVEA_IMAGE_HEIGHT_MAX, "rows",
     NULL},
    {"rate", FV_URI_REAL, AT(rate_hz), 0.1, 1000, "Hz", NULL},
    {"format", FV_URI_WORD, AT(format), 0, 0,
     "any, GREY, NV12, YU12, YUYV, UYVY, Y10, Y12, RGGB, BGGR, GRBG, GBRG, MJPG, RGB3 or BGR3",
     format_names},
    {"role", FV_URI_WORD, AT(role), 0, 0, "video, viewfinder, still or raw", role_names},
    {"exposure", FV_URI_REAL, AT(exposure_ms), 0.01, 10000, "milliseconds", NULL},
    {"gain", FV_URI_REAL, AT(gain), 0, 1000, "factor", NULL},
    {"auto_exposure", FV_URI_FLAG, AT(auto_exposure), 0, 1, "0 or 1", NULL},
    {"auto_gain", FV_URI_FLAG, AT(auto_gain), 0, 1, "0 or 1", NULL},
    {"readout", FV_URI_REAL, AT(readout_ms), 0, 1000, "milliseconds, first row to last", NULL},
    {"buffers", FV_URI_I32, AT(buffers), FV_LIVE_BUFFERS_MIN, FV_LIVE_BUFFERS_MAX, "requests",
     NULL},
};

static enum fovea_status add_control_value(void *to, const char *name, const char *value,
                                           struct fovea_error *error)
{
    struct fv_libcamera_options *options = to;
    char quoted[FV_TEXT_QUOTED_BYTES];
    struct fv_libcamera_control_value *given =
        &options->control_values[options->control_value_count];
    if (options->control_value_count == FV_LIBCAMERA_CONTROL_VALUES_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "libcamera: control.: found more than %d, expected fewer",
                               FV_LIBCAMERA_CONTROL_VALUES_MAX);
    if (name[0] == '\0' || strlen(name) >= sizeof given->name ||
        strlen(value) >= sizeof given->value)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "libcamera: control.: found %s, expected a name and a value of less than %zu bytes",
            fv_text_quote(name, quoted, sizeof quoted), sizeof given->name);
    options->control_value_count++;
    memcpy(given->name, name, strlen(name) + 1);
    memcpy(given->value, value, strlen(value) + 1);
    return FOVEA_OK;
}

static const struct fv_uri_table options_table = {
    "libcamera", option_table,      sizeof option_table / sizeof option_table[0],
    "control.",  add_control_value, NULL};

static enum fovea_status parse(const char *address, struct fv_libcamera_options *options,
                               struct fovea_error *error)
{
    struct fv_libcamera_options o = {.gain = -1, .readout_ms = -1, .buffers = 4};
    char quoted[FV_TEXT_QUOTED_BYTES];
    uint64_t given;
    const size_t length = strcspn(address, "?");
    if (length == 0 || length >= sizeof o.id)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "libcamera: found %s, expected a camera's id or its number from 0",
                               fv_text_quote(address, quoted, sizeof quoted));
    memcpy(o.id, address, length);
    address += length;
    if (*address == '?') address++;
    const enum fovea_status status =
        fv_uri_options_parse(&options_table, address, &o, &given, error);
    if (status != FOVEA_OK) return status;
    o.auto_exposure_given = (given >> AUTO_EXPOSURE & 1) != 0 || (given >> EXPOSURE & 1) != 0;
    o.auto_gain_given = (given >> AUTO_GAIN & 1) != 0;
    if (o.exposure_ms > 0 && o.auto_exposure)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "libcamera: exposure: found a time together with auto_exposure=1, expected one of them");
    if (o.gain >= 0 && o.auto_gain)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "libcamera: gain: found a number together with auto_gain=1, expected one of them");
    if ((o.width == 0) != (o.height == 0))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "libcamera: %s: found none, expected width and height or neither",
                               o.width == 0 ? "width" : "height");
    *options = o;
    return FOVEA_OK;
}

static enum fovea_status open_camera(const char *address,
                                     const struct fovea_source_selection *selection,
                                     struct fovea_source **source, struct fovea_error *error)
{
    struct fv_libcamera_options options;
    struct fv_libcamera_agreed agreed = {.width = 0};
    struct fovea_error notice = {.text = ""};
    struct fv_libcamera_client *client = NULL;
    char uri[FV_LIBCAMERA_ID_BYTES + 16];
    enum fovea_status status = fv_live_selection("libcamera", selection, error);
    if (status == FOVEA_OK) status = parse(address, &options, error);
    if (status == FOVEA_OK) status = fv_libcamera_open(&options, &client, &agreed, &notice, error);
    if (status != FOVEA_OK) return status;
    snprintf(uri, sizeof uri, "libcamera:%s", agreed.id);
    const struct fv_live_setup setup = {
        .uri = uri,
        .info = {.cameras[0] = {.width = agreed.width, .height = agreed.height},
                 .format = agreed.format,
                 .rate_hz = agreed.rate_hz,
                 .heap_bytes = fv_libcamera_heap_bytes()},
        .buffers = agreed.buffers,
        .readout_ns = options.readout_ms < 0 ? -1 : fv_clock_from_ms(options.readout_ms),
    };
    status = fv_live_open(&fv_libcamera_live, client, &setup, selection, source, error);
    if (status == FOVEA_OK && notice.text[0] != '\0') fv_live_notice(*source, &notice);
    return status;
}

const struct fovea_source_ops fv_source_libcamera = FV_LIVE_OPS(
    "libcamera", "ID[?width=..&format=..]  camera by libcamera: its id, or its number from 0",
    open_camera);
