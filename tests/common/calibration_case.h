/* Calibration files of tests, and what their refusal says. Include after cmocka. */
#ifndef FOVEA_TESTS_COMMON_CALIBRATION_CASE_H
#define FOVEA_TESTS_COMMON_CALIBRATION_CASE_H

#include <string.h>

#include "support/calibration.h"

#define PHOTON_SIZE "\"resolution\": {\"width\": 1280.0, \"height\": 720.0}"
#define PHOTON_MATRIX                                                                                  \
    "\"cameraIntrinsics\": {\"rows\": 3, \"cols\": 3, \"type\": 6, \"data\": [900.5, 0, 640, 0, 901, " \
    "360, 0, 0, 1]}"

/* The text, as the file c.yaml, is refused with exactly this line. */
static inline void refused(enum fovea_status status, const char *text, const char *line)
{
    struct fv_calibration calibration;
    struct fovea_error error = {.text = ""};
    assert_int_equal(fv_calibration_parse("c.yaml", text, strlen(text), NULL, &calibration, &error),
                     status);
    assert_string_equal(error.text, line);
    assert_int_equal(error.status, status);
}

#endif
