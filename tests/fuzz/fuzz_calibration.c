/* Calibration files: any bytes are refused in one line or give a camera; a camera that was read can
 * be written in every format that holds it, and reads back the same. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "support/calibration.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static void check_line(const struct fovea_error *error)
{
    if (error->text[0] == '\0' || strpbrk(error->text, "\n\r") != NULL) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    struct fv_calibration found, again;
    struct fovea_error error = {.text = ""}, lost;
    if (fv_calibration_parse("fuzz", (const char *)data, bytes, NULL, &found, &error) != FOVEA_OK) {
        check_line(&error);
        return 0;
    }
    for (int format = 0; format < FV_CALIBRATION_FORMAT_COUNT; format++) {
        char text[FV_CALIBRATION_BYTES_MAX];
        if (fv_calibration_format_text((enum fv_calibration_format)format, &found, text, &lost,
                                       &error) != FOVEA_OK) {
            check_line(&error);
            continue;
        }
        if (fv_calibration_parse("again", text, strlen(text), NULL, &again, &error) != FOVEA_OK)
            abort();
        if (again.camera.fx != found.camera.fx || again.camera.cy != found.camera.cy ||
            again.camera.lens != found.camera.lens || again.camera.width != found.camera.width)
            abort();
        for (int i = 0; i < FOVEA_LENS_COEFFICIENTS; i++)
            if (again.camera.k[i] != found.camera.k[i]) abort();
    }
    return 0;
}
