#include "app/run/process.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint64_t row_kib(const char *path, const char *key)
{
    char line[256];
    uint64_t kib = 0;
    FILE *file = fopen(path, "re");
    if (file == NULL) return 0;
    while (fgets(line, sizeof line, file) != NULL)
        if (strncmp(line, key, strlen(key)) == 0) kib = strtoull(line + strlen(key), NULL, 10);
    fclose(file);
    return kib;
}

uint64_t fv_process_resident_bytes(void)
{
    return row_kib("/proc/self/status", "VmRSS:") * 1024;
}

uint64_t fv_process_resident_max_bytes(void)
{
    return row_kib("/proc/self/status", "VmHWM:") * 1024;
}

uint64_t fv_process_anonymous_bytes(void)
{
    return row_kib("/proc/self/smaps_rollup", "Anonymous:") * 1024;
}
