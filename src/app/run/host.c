#include "app/run/host.h"

#include <glob.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ZONES_MAX = 16, TRIPS_MAX = 12, PATH_BYTES = 512 };
static const float limit_without_trips_c = 80, begin_c = 10, full_c = 2;

__attribute__((format(printf, 3, 4))) static bool line_read(char *line, int bytes,
                                                            const char *format, ...)
{
    char path[PATH_BYTES];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(path, sizeof path, format, arguments);
    va_end(arguments);
    FILE *file = fopen(path, "re");
    if (file == NULL) return false;
    const bool read = fgets(line, bytes, file) != NULL;
    fclose(file);
    return read;
}

/* The lowest temperature at which the system acts by itself in a zone. */
static float trip_of(const char *root, int zone)
{
    float lowest = NAN;
    char line[64];
    for (int trip = 0; trip < TRIPS_MAX; trip++) {
        if (!line_read(line, sizeof line, "%s/sys/class/thermal/thermal_zone%d/trip_point_%d_type",
                       root, zone, trip))
            break;
        const bool acts = strncmp(line, "passive", 7) == 0 || strncmp(line, "hot", 3) == 0 ||
                          strncmp(line, "critical", 8) == 0;
        if (!acts ||
            !line_read(line, sizeof line, "%s/sys/class/thermal/thermal_zone%d/trip_point_%d_temp",
                       root, zone, trip))
            continue;
        const float celsius = (float)strtol(line, NULL, 10) / 1000.0F;
        if (celsius > 0 && !(celsius >= lowest)) lowest = celsius;
    }
    return lowest;
}

static void zones_read(const char *root, struct fv_host *host)
{
    bool of_processor = false;
    for (int zone = 0; zone < ZONES_MAX; zone++) {
        char line[64];
        if (!line_read(line, sizeof line, "%s/sys/class/thermal/thermal_zone%d/temp", root, zone))
            continue;
        const float celsius = (float)strtol(line, NULL, 10) / 1000.0F;
        const bool processor =
            line_read(line, sizeof line, "%s/sys/class/thermal/thermal_zone%d/type", root, zone) &&
            (strcasestr(line, "cpu") != NULL || strcasestr(line, "soc") != NULL ||
             strcasestr(line, "x86_pkg") != NULL);
        if (processor == of_processor ? !(celsius <= host->temperature_c) : processor) {
            host->temperature_c = celsius;
            host->trip_c = trip_of(root, zone);
        }
        of_processor = of_processor || processor;
    }
}

/* The folder's name holds an address on newer boards: soc@107c000000:firmware. */
static uint32_t throttled_read(const char *root)
{
    char pattern[PATH_BYTES], line[64];
    uint32_t bits = 0;
    glob_t found;
    snprintf(pattern, sizeof pattern, "%s/sys/devices/platform/soc*/soc*:firmware/get_throttled",
             root);
    if (glob(pattern, GLOB_NOSORT, NULL, &found) != 0) return 0;
    if (line_read(line, sizeof line, "%s", found.gl_pathv[0]))
        bits = (uint32_t)strtoul(line, NULL, 16) & 15;
    globfree(&found);
    return bits;
}

void fv_host_read(const char *root, struct fv_host *host)
{
    *host = (struct fv_host){.temperature_c = NAN, .trip_c = NAN};
    zones_read(root, host);
    host->throttled = throttled_read(root);
}

float fv_host_limit_c(const struct fv_host *host, double limit_c)
{
    if (limit_c > 0) return (float)limit_c;
    return isnan(host->trip_c) ? limit_without_trips_c : host->trip_c;
}

uint32_t fv_host_share(const struct fv_host *host, double limit_c, uint32_t before)
{
    const uint32_t cut = FV_HOST_CAPPED | FV_HOST_THROTTLED | FV_HOST_SOFT_LIMIT;
    const float below = fv_host_limit_c(host, limit_c) - host->temperature_c;
    uint32_t share = FV_HOST_SHARE_MAX;
    if ((host->throttled & cut) != 0 || below <= full_c)
        share = FV_HOST_SHARE_MIN;
    else if (below < begin_c)
        share = FV_HOST_SHARE_MIN + (uint32_t)((FV_HOST_SHARE_MAX - FV_HOST_SHARE_MIN) *
                                               (below - full_c) / (begin_c - full_c));
    return share > before ? before + 1 : share;
}
