#include "app/run/host.h"

#include <errno.h>
#include <glob.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ZONES_MAX = 16, TRIPS_MAX = 12, PATH_BYTES = 512 };
static const float limit_without_trips_c = 80, before_critical_c = 10, begin_c = 10, full_c = 2;
static const long lowest_mc = -40000, highest_mc = 150000; /* what is no fault of a sensor */

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

/* A line of millidegrees. False: it is none, or no temperature of a machine. */
static bool celsius_of(const char *line, float *celsius)
{
    char *end;
    errno = 0;
    const long millidegrees = strtol(line, &end, 10);
    if (end == line || (*end != '\0' && *end != '\n') || errno != 0 || millidegrees < lowest_mc ||
        millidegrees > highest_mc)
        return false;
    *celsius = (float)millidegrees / 1000.0F;
    return true;
}

/* Where the system begins to take processor time away in a zone; NaN: it states nothing. */
static float trip_of(const char *root, int zone)
{
    float lowest = NAN, critical = NAN;
    char line[64];
    for (int trip = 0; trip < TRIPS_MAX; trip++) {
        float celsius, *of;
        if (!line_read(line, sizeof line, "%s/sys/class/thermal/thermal_zone%d/trip_point_%d_type",
                       root, zone, trip))
            break;
        const bool is_critical = strncmp(line, "critical", 8) == 0;
        if (!is_critical && strncmp(line, "passive", 7) != 0 && strncmp(line, "hot", 3) != 0)
            continue;
        of = is_critical ? &critical : &lowest;
        if (line_read(line, sizeof line, "%s/sys/class/thermal/thermal_zone%d/trip_point_%d_temp",
                      root, zone, trip) &&
            celsius_of(line, &celsius) && celsius > 0 && !(celsius >= *of))
            *of = celsius;
    }
    if (!isnan(lowest) || isnan(critical)) return lowest;
    return fminf(limit_without_trips_c, critical - before_critical_c);
}

static bool is_of_processor(const char *type)
{
    static const char *const names[] = {"cpu", "soc", "x86_pkg", "package", "core", "cluster"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcasestr(type, names[i]) != NULL) return true;
    return false;
}

static void zones_read(const char *root, double limit_c, struct fv_host *host)
{
    for (int zone = 0; zone < ZONES_MAX; zone++) {
        char line[64];
        struct fv_host of = {.trip_c = NAN};
        if (!line_read(line, sizeof line, "%s/sys/class/thermal/thermal_zone%d/temp", root, zone) ||
            !celsius_of(line, &of.temperature_c))
            continue;
        of.other =
            !line_read(line, sizeof line, "%s/sys/class/thermal/thermal_zone%d/type", root, zone) ||
            !is_of_processor(line);
        if (!of.other) of.trip_c = trip_of(root, zone);
        const bool nearer = fv_host_limit_c(&of, limit_c) - of.temperature_c <
                            fv_host_limit_c(host, limit_c) - host->temperature_c;
        if (isnan(host->temperature_c) || (of.other == host->other ? nearer : host->other))
            *host = of;
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

void fv_host_read(const char *root, double limit_c, struct fv_host *host)
{
    *host = (struct fv_host){.temperature_c = NAN, .trip_c = NAN};
    zones_read(root, limit_c, host);
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
    const float below = host->other ? NAN : fv_host_limit_c(host, limit_c) - host->temperature_c;
    uint32_t share = FV_HOST_SHARE_MAX;
    if ((host->throttled & cut) != 0 || below <= full_c)
        share = FV_HOST_SHARE_MIN;
    else if (below < begin_c)
        share = FV_HOST_SHARE_MIN + (uint32_t)((FV_HOST_SHARE_MAX - FV_HOST_SHARE_MIN) *
                                               (below - full_c) / (begin_c - full_c));
    return share > before ? before + 1 : share;
}
