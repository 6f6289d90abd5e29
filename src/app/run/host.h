/* The machine as Linux states it in sysfs: temperatures, the trip points at which the system itself
 * takes processor time away, and what the firmware of a Raspberry Pi says of throttling. And how
 * much of a frame's period the governor may then use.
 *
 * The reading calls files: off the loop thread. The rest is pure. Sources: the kernel's
 * Documentation/driver-api/thermal/sysfs-api.rst (millidegrees, trip types `passive`, `hot`,
 * `critical`); for the Raspberry Pi `vcgencmd get_throttled` of its documentation, whose value the
 * firmware driver shows as hexadecimal text in .../soc:firmware/get_throttled. */
#ifndef FOVEA_APP_RUN_HOST_H
#define FOVEA_APP_RUN_HOST_H

#include <stdbool.h>
#include <stdint.h>

/* Bits of get_throttled that hold now (16 higher: since the start of the machine). */
enum fv_host_throttled {
    FV_HOST_UNDER_VOLTAGE = 1,
    FV_HOST_CAPPED = 2,    /* the frequency of the processor is capped */
    FV_HOST_THROTTLED = 4, /* and cut */
    FV_HOST_SOFT_LIMIT = 8 /* the soft limit of the temperature is reached */
};

struct fv_host {
    /* Of the processor's zones the one that is nearest to its limit; where none names the
     * processor, the hottest of all; degrees Celsius; NaN: there is none. A zone that states no
     * number from -40 to 150 is left out. Names of the processor: cpu, soc, x86_pkg, package, core
     * and cluster, anywhere in the type of the zone. */
    float temperature_c;
    /* Where the system begins to throttle: the lowest passive or hot trip point of that zone, or
     * else, at most 80, 10 degrees below the lowest critical one, at which it is switched off; NaN:
     * it states none. */
    float trip_c;
    uint32_t throttled; /* enum fv_host_throttled; 0: nothing, or not known */
    /* The zone is of something else than the processor (a battery, a radio): its temperature is
     * shown, and nothing is done about it. */
    bool other;
};

/* `root` stands before "/sys", "" is this machine: tests give a folder with files of their own.
 * `limit_c`: of all zones; 0: each by its own trip points. */
void fv_host_read(const char *root, double limit_c, struct fv_host *host);

/* Where `limit_c` is 0: the trip point, or 80 where none is known (a Raspberry Pi throttles from 80
 * on). Processors of PCs mostly state none and stand 95 to 100: there `limit_c` should be given. */
float fv_host_limit_c(const struct fv_host *host, double limit_c);

/* Percent of the period that step and work may use together: 100 up to 10 degrees below the limit,
 * falling evenly to 50 at 2 degrees below it, so that less heat is made before the system acts; and
 * 50 while it does. A fall counts at once; `before` rises by at most 1, so that the load does not
 * swing with the temperature: called four times a second, 12 s from 50 to 100. */
enum { FV_HOST_SHARE_MIN = 50, FV_HOST_SHARE_MAX = 100 };
uint32_t fv_host_share(const struct fv_host *host, double limit_c, uint32_t before);

#endif
