/* A network of $FOVEA_DATA, imported by the build's Python. */
#ifndef FOVEA_TESTS_COMMON_IMPORTED_H
#define FOVEA_TESTS_COMMON_IMPORTED_H

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "common/data_folder.h"

/* Write models/NAME.tflite of the folder as a model file to `target`; `labels`: a file of its
 * images, NULL: none. False, with a line that says why the test is skipped, where there is no such
 * network or no Python with the packages. */
static inline bool fv_test_import(const char *name, const char *labels, const char *target)
{
    char source[512], option[600] = "", command[2048];
    const char *python = getenv("FOVEA_PYTHON"), *data = fv_data_folder();
    snprintf(source, sizeof source, "%s/models/%s.tflite", data, name);
    if (access(source, R_OK) != 0) {
        printf("SKIPPED %s: no %s\n", name, source);
        return false;
    }
    if (labels != NULL) snprintf(option, sizeof option, "--labels '%s/images/%s'", data, labels);
    snprintf(command, sizeof command, "%s tools/import '%s' -o '%s' %s >/dev/null 2>&1",
             python != NULL ? python : "build/venv-import/bin/python", source, target, option);
    if (system(command) == 0) return true;
    printf("SKIPPED %s: no Python with the packages tflite and numpy\n", name);
    return false;
}

#endif
