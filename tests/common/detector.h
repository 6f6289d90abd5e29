/* The small detector of the tests (tests/golden/detector.fvm), in memory as the runtime wants it.
 */
#ifndef FOVEA_TESTS_DETECTOR_H
#define FOVEA_TESTS_DETECTOR_H

#include <stdint.h>
#include <stdio.h>

/* NULL when the file is not there. Lives as long as the program. */
static inline const void *detector_model(size_t *bytes)
{
    static _Alignas(64) uint8_t file[1 << 18];
    FILE *in = fopen("tests/golden/detector.fvm", "rb");
    if (in == NULL) return NULL;
    *bytes = fread(file, 1, sizeof file, in);
    fclose(in);
    return *bytes > 0 && *bytes < sizeof file ? file : NULL;
}

#endif
