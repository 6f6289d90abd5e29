/* A value for a control of a camera (fovea_source_ops.control), from the thread that asks to the
 * camera thread, which alone calls the device, and its answer back. One at a time. */
#ifndef FOVEA_LIVE_CONTROL_REQUEST_H
#define FOVEA_LIVE_CONTROL_REQUEST_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "fovea/source.h"

enum fv_control_request_stage {
    FV_CONTROL_REQUEST_NONE,
    FV_CONTROL_REQUEST_ASKED,
    FV_CONTROL_REQUEST_BEGUN,
    FV_CONTROL_REQUEST_DONE
};

struct fv_control_request {
    atomic_bool asked; /* what the camera thread looks at */

    /* Under the lock. */
    pthread_mutex_t lock;
    pthread_cond_t done;
    enum fv_control_request_stage stage;
    bool abandoned; /* nobody waits for the answer any more */
    enum fovea_source_control control;
    double value;
    enum fovea_status status;
    struct fovea_error error;
};

void fv_control_request_open(struct fv_control_request *request);
void fv_control_request_close(struct fv_control_request *request);

/* Ask, ring `wake_fd`, and wait for the answer, at most 3 seconds. `uri` begins the line of an
 * error. */
enum fovea_status fv_control_request_ask(struct fv_control_request *request, const char *uri,
                                         int wake_fd, enum fovea_source_control control,
                                         double value, struct fovea_error *error);

/* On the camera thread. False: there is none, which takes no system call. Whoever takes one answers
 * it. */
bool fv_control_request_take(struct fv_control_request *request, enum fovea_source_control *control,
                             double *value);
void fv_control_request_answer(struct fv_control_request *request, enum fovea_status status,
                               const struct fovea_error *error);

#endif
