#include "app/run/process.h"

#include <math.h>
#include <stdbool.h>
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

static bool line_read(const char *path, char *line, int bytes)
{
    FILE *file = fopen(path, "re");
    if (file == NULL) return false;
    bool read = fgets(line, bytes, file) != NULL;
    fclose(file);
    return read;
}

float fv_process_temperature_c(void)
{
    enum { ZONES_MAX = 16 };
    float hottest = NAN;
    bool of_processor = false;
    for (int zone = 0; zone < ZONES_MAX; zone++) {
        char path[64], line[64];
        snprintf(path, sizeof path, "/sys/class/thermal/thermal_zone%d/temp", zone);
        if (!line_read(path, line, sizeof line)) continue;
        float celsius = (float)strtol(line, NULL, 10) * 1e-3F;
        snprintf(path, sizeof path, "/sys/class/thermal/thermal_zone%d/type", zone);
        bool processor = line_read(path, line, sizeof line) &&
                         (strcasestr(line, "cpu") != NULL || strcasestr(line, "soc") != NULL ||
                          strcasestr(line, "x86_pkg") != NULL);
        if (processor == of_processor ? !(celsius <= hottest) : processor) hottest = celsius;
        of_processor = of_processor || processor;
    }
    return hottest;
}
