/* Robots as lines: a table for people, objects of JSON for programs. */
#ifndef FOVEA_APP_WATCH_ROBOTS_PRINT_H
#define FOVEA_APP_WATCH_ROBOTS_PRINT_H

#include <stdio.h>

#include "app/watch/robots.h"

struct fv_robots_look {
    unsigned columns,
        lines;   /* of the terminal: longer lines are cut, further ones left out; 0: any */
    bool screen; /* colours, and each line ends with what clears the rest of it */
};

/* A heading, a line for each robot and one with the mean times of its stages. */
void fv_robots_table(FILE *out, const struct fv_robots *robots, const struct fv_robots_look *look);

/* One object on one line; `utime` is the time of now, microseconds since 1970. */
void fv_robots_json(FILE *out, const struct fv_robots *robots, const struct fv_robot *robot,
                    int64_t utime);

#endif
