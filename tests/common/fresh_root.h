/* For tests: a folder of their own, made for each and removed behind it. */
#ifndef FOVEA_TESTS_COMMON_FRESH_ROOT_H
#define FOVEA_TESTS_COMMON_FRESH_ROOT_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char root[64];

/* A setup of cmocka. */
static inline int make_root(void **state)
{
    (void)state;
    strcpy(root, "/tmp/fovea-root-XXXXXX");
    return mkdtemp(root) == NULL;
}

/* A teardown of cmocka. */
static inline int remove_root(void **state)
{
    char command[128];
    (void)state;
    snprintf(command, sizeof command, "rm -r %s", root);
    return system(command);
}

/* Write a file below it, and the folders that it lies in. */
static inline void put(const char *path, const char *text)
{
    char whole[512], *slash;
    snprintf(whole, sizeof whole, "%s%s", root, path);
    for (slash = whole + strlen(root) + 1; (slash = strchr(slash, '/')) != NULL; slash++) {
        *slash = '\0';
        mkdir(whole, 0777);
        *slash = '/';
    }
    FILE *file = fopen(whole, "w");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
}

#endif
