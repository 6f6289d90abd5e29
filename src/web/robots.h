/* The robots of one page: each browser chooses one of them and shows it. All pages show what each
 * robot is doing. One thread. */
#ifndef FOVEA_WEB_ROBOTS_H
#define FOVEA_WEB_ROBOTS_H

#include <stdbool.h>
#include <stdint.h>

#include "web/relay.h"

enum { FV_WEB_ROBOTS_MAX = 8, FV_WEB_ROBOT_NAME_BYTES = 48 };

struct fv_web_robots {
    uint32_t count;
    struct fv_web_robot {
        struct fv_web_relay *relay; /* the caller's */
        char name[FV_WEB_ROBOT_NAME_BYTES];
        bool running; /* this and `state` as `text` has them */
        int state;
    } robots[FV_WEB_ROBOTS_MAX];
    uint32_t version;                                              /* counts changes of the text */
    char text[FV_WEB_ROBOTS_MAX * (FV_WEB_ROBOT_NAME_BYTES + 64)]; /* of all, as a list in JSON */
};

/* Add one, by the name of its socket without its folder and ".sock", or by its prefix. False: there
 * are FV_WEB_ROBOTS_MAX. Init-only. */
bool fv_web_robots_add(struct fv_web_robots *robots, struct fv_web_relay *relay, const char *name);

/* Take what has come of each, with its pictures where relay->cameras names one. `*pictured`: one
 * has a new picture of its first camera. Returns whether a store or the text has changed. */
bool fv_web_robots_tick(struct fv_web_robots *robots, bool *pictured);

#endif
