/* What a robot has been through: counters that survive restarts, in a small file that is replaced
 * whole (the key health.state_file). One line "NAME: NUMBER" for each, in this order. The heap is
 * used; off the loop thread. */
#ifndef FOVEA_APP_RUN_HISTORY_H
#define FOVEA_APP_RUN_HISTORY_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

/* A row makes the member and its line. */
#define FV_HISTORY_COUNTERS(ROW)                                                                   \
    ROW(starts)          /* runs that began */                                                     \
    ROW(ends)            /* of these, that ended in order: not by a crash, a kill, a power cut */  \
    ROW(seconds)         /* of running */                                                          \
    ROW(frames)          /* that were taken */                                                     \
    ROW(source_failures) /* times that the source failed (health.h), likewise below */             \
    ROW(pose_failures)                                                                             \
    ROW(hot_seconds) /* with less work granted, as the host was hot or throttled */

struct fv_history {
#define FV_HISTORY_MEMBER(name) uint64_t name;
    FV_HISTORY_COUNTERS(FV_HISTORY_MEMBER)
#undef FV_HISTORY_MEMBER
};

/* Where a run by the configuration file `config` ("": by none) keeps them, the key being `asked`.
 * Of "auto" it is NAME.health in the first folder of the environment's STATE_DIRECTORY, which
 * systemd sets for units that have one, and NAME that of `config` without ".yaml"; without either
 * "". */
void fv_history_path(const char *asked, const char *config, char *path, size_t capacity);

/* Zeros where there is no file, or an empty one. FOVEA_ERROR_INPUT: it cannot be read, or is none
 * of these; `error` names the line, what was found and what was expected. */
enum fovea_status fv_history_read(const char *path, struct fv_history *history,
                                  struct fovea_error *error);
/* The text of such a file, cut up in place; `name` is for errors. */
enum fovea_status fv_history_parse(const char *name, char *text, struct fv_history *history,
                                   struct fovea_error *error);
/* Whole and synced, or what was there stays. */
enum fovea_status fv_history_write(const char *path, const struct fv_history *history,
                                   struct fovea_error *error);

#endif
