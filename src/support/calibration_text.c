#include "support/calibration_writer.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* ---- text ------------------------------------------------------------------------------------ */

void fv_calibration_put(struct fv_calibration_writer *w, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int length =
        vsnprintf(w->text + w->used, FV_CALIBRATION_BYTES_MAX - w->used, format, arguments);
    va_end(arguments);
    w->used += (size_t)length;
    if (w->used >= FV_CALIBRATION_BYTES_MAX)
        w->used = FV_CALIBRATION_BYTES_MAX - 1; /* cannot be: sizes are fixed */
}

void fv_calibration_put_numbers(struct fv_calibration_writer *w, const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        char number[40];
        snprintf(number, sizeof number, "%.17g", values[i]);
        fv_calibration_put(w, "%s%s%s", i > 0 ? ", " : "", number,
                           strpbrk(number, ".e") == NULL ? ".0" : "");
    }
}

/* A string in double quotes, in which everything may stand. */
static void put_string(struct fv_calibration_writer *w, const char *text)
{
    fv_calibration_put(w, "\"");
    for (; *text != '\0'; text++) {
        const unsigned char c = (unsigned char)*text;
        if (c < 32 || c == 127)
            fv_calibration_put(w, w->json ? "\\u%04X" : "\\x%02X", c);
        else
            fv_calibration_put(w, "%s%c", c == '"' || c == '\\' ? "\\" : "", c);
    }
    fv_calibration_put(w, "\"");
}

void fv_calibration_put_text(struct fv_calibration_writer *w, const char *key, const char *text)
{
    fv_calibration_put(w, "%s: ", key);
    put_string(w, text);
    fv_calibration_put(w, "\n");
}

void fv_calibration_put_matrix(struct fv_calibration_writer *w, const char *key, bool opencv,
                               int rows, int cols, const double *values)
{
    fv_calibration_put(w,
                       opencv
                           ? "%s: !!opencv-matrix\n   rows: %d\n   cols: %d\n   dt: d\n   data: ["
                           : "%s:\n  rows: %d\n  cols: %d\n  data: [",
                       key, rows, cols);
    fv_calibration_put_numbers(w, values, (size_t)rows * (size_t)cols);
    fv_calibration_put(w, "]\n");
}

void fv_calibration_put_list(struct fv_calibration_writer *w, const char *key, const double *values,
                             size_t count)
{
    fv_calibration_put(w, "%s: [", key);
    fv_calibration_put_numbers(w, values, count);
    fv_calibration_put(w, "]\n");
}

/* ---- the formats ----------------------------------------------------------------------------- */

size_t fv_calibration_coefficient_count(const struct fovea_camera *camera, size_t least)
{
    if (camera->lens == FOVEA_LENS_EQUIDISTANT) return 4;
    if (camera->k[5] != 0 || camera->k[6] != 0 || camera->k[7] != 0) return 8;
    return camera->k[4] != 0 || least == 5 ? 5 : 4;
}

/* radtan, rational or equidistant. */
static const char *model_name(const struct fovea_camera *camera)
{
    return camera->lens == FOVEA_LENS_EQUIDISTANT             ? "equidistant"
           : fv_calibration_coefficient_count(camera, 5) == 8 ? "rational"
                                                              : "radtan";
}

/* ---- the record ------------------------------------------------------------------------------ */

/* The next key of the mapping: on a line of its own, `indent` spaces in. */
static void put_key(struct fv_calibration_writer *w, int indent, const char *key, bool *first)
{
    if (w->json)
        fv_calibration_put(w, "%s\n%*s\"%s\": ", *first ? "" : ",", indent, "", key);
    else
        fv_calibration_put(w, "\n%*s%s:%s", indent, "", key, strcmp(key, "stdev") == 0 ? "" : " ");
    *first = false;
}

static void put_stated_text(struct fv_calibration_writer *w, int indent, const char *key,
                            const char *text, bool *first)
{
    if (text[0] == '\0') return;
    put_key(w, indent, key, first);
    put_string(w, text);
}

static void put_stated(struct fv_calibration_writer *w, int indent, const char *key, double value,
                       bool *first)
{
    if (value == 0) return;
    put_key(w, indent, key, first);
    fv_calibration_put(w, "%.12g", value); /* counts have ten digits at most */
}

void fv_calibration_put_record(struct fv_calibration_writer *w, int indent,
                               const struct fv_calibration *c, bool with_name)
{
    const struct fv_calibration_record *record = &c->record;
    const bool named = with_name && c->name[0] != '\0';
    const int inner = indent + (w->json ? 4 : 2);
    bool first = true;
    if (record->program[0] == '\0' && !named) return;
    fv_calibration_put(w, w->json ? ",\n%*s\"calibration\": {" : "%*scalibration:", indent, "");
    put_stated_text(w, inner, "program",
                    record->program[0] != '\0' ? record->program : "fovea-calibrate", &first);
    if (named) put_stated_text(w, inner, "name", c->name, &first);
    put_stated_text(w, inner, "camera_id", record->camera_id, &first);
    put_stated_text(w, inner, "date", record->date, &first);
    put_stated_text(w, inner, "verdict", record->verdict, &first);
    put_stated_text(w, inner, "model", model_name(&c->camera), &first);
    put_stated_text(w, inner, "board", record->board, &first);
    put_stated(w, inner, "views", record->views, &first);
    put_stated(w, inner, "corners", record->corners, &first);
    put_stated(w, inner, "rms_px", record->rms_px, &first);
    put_stated(w, inner, "noise_px", record->noise_px, &first);
    put_stated(w, inner, "held_out_rms_px", record->held_out_rms_px, &first);
    put_stated(w, inner, "projection_stdev_px", record->projection_stdev_px, &first);
    put_stated(w, inner, "time_shift_stdev_s", record->time_shift_stdev_s, &first);
    bool placed = false;
    for (int i = 0; i < 6; i++)
        placed |= record->place_stdev[i] != 0;
    if (placed) {
        put_key(w, inner, "place_stdev", &first);
        fv_calibration_put(w, "[");
        for (int i = 0; i < 6; i++)
            fv_calibration_put(w, "%s%.12g", i > 0 ? ", " : "", record->place_stdev[i]);
        fv_calibration_put(w, "]");
    }
    bool any = false;
    for (int i = 0; i < 4 + FOVEA_LENS_COEFFICIENTS; i++)
        any |= record->stdev[i] != 0;
    if (any) {
        put_key(w, inner, "stdev", &first);
        if (w->json) fv_calibration_put(w, "{");
        first = true;
        for (int i = 0; fv_calibration_parameter_name(c->camera.lens, i) != NULL; i++)
            put_stated(w, inner + (w->json ? 4 : 2),
                       fv_calibration_parameter_name(c->camera.lens, i), record->stdev[i], &first);
        if (w->json) fv_calibration_put(w, "}");
    }
    fv_calibration_put(w, w->json ? "}" : "\n");
}
