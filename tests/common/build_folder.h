/* Where a test finds the programs and files that were built with it. */
#ifndef FOVEA_TESTS_BUILD_FOLDER_H
#define FOVEA_TESTS_BUILD_FOLDER_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The folder that the running test was built into, absolute: BUILD of BUILD/tests/.../NAME. Ends
 * the test where there is none. */
static inline const char *build_folder(void)
{
    static char path[512];
    if (path[0] != '\0') return path;
    const ssize_t length = readlink("/proc/self/exe", path, sizeof path - 1);
    char *tests = length > 0 ? strstr(path, "/tests/") : NULL;
    for (char *later = tests; later != NULL; later = strstr(later + 1, "/tests/"))
        tests = later;
    if (tests == NULL) {
        fprintf(stderr, "found a test at %s, expected it below BUILD/tests\n", path);
        exit(1);
    }
    *tests = '\0';
    return path;
}

#endif
