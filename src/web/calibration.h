/* The calibration of a run's camera from the page: a process of fovea-calibrate beside the server,
 * which reads the pictures of the run's feed, so that the run keeps its camera, and serves a page
 * of its own at the next port, with the same address, names, tokens and certificate. Its result is
 * a camera file in one folder, whose name is made here. One at a time; it ends with the server. */
#ifndef FOVEA_WEB_CALIBRATION_H
#define FOVEA_WEB_CALIBRATION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "fovea/status.h"

enum { FV_WEB_TARGET_BYTES = 64, FV_WEB_CALIBRATION_NAME_BYTES = 64 };

struct fv_web_calibration {
    const char *folder; /* NULL: none, and nothing is started */
    const char *address, *name, *token, *certificate, *certificate_key; /* NULL: none */
    uint16_t port;                                                      /* of its page */

    pid_t process;                            /* 0: none runs */
    bool ran;                                 /* one has ended */
    int status;                               /* its exit status; -1: by a signal */
    char file[FV_WEB_CALIBRATION_NAME_BYTES]; /* of the last one; "": none */
};

/* Start one of the run whose feed is at `socket`, with a board as of its --target.
 * FOVEA_ERROR_INPUT: the board is none; one runs; FOVEA_ERROR_SYSTEM: it cannot be started. */
enum fovea_status fv_web_calibration_start(struct fv_web_calibration *calibration,
                                           const char *socket, const char *target,
                                           struct fovea_error *error);
/* Let it come to its end with the pictures that it has. */
void fv_web_calibration_stop(struct fv_web_calibration *calibration);
/* How it stands, as JSON: {"state":"none|runs|ended","port":7681,"status":0,"file":"..."}, `file`
 * where there is a result. In memory of malloc; NULL: none. */
char *fv_web_calibration_json(struct fv_web_calibration *calibration);
/* The last result, in memory of malloc. NULL: there is none. */
char *fv_web_calibration_result(const struct fv_web_calibration *calibration, size_t *bytes);
/* With the server. */
void fv_web_calibration_end(struct fv_web_calibration *calibration);

#endif
