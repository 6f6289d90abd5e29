/* What a camera is to be told (fovea_source_ops.control), from the thread that asks to the camera
 * thread, which alone calls the device, and its answer back. One at a time. */
#ifndef FOVEA_LIVE_WISH_H
#define FOVEA_LIVE_WISH_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "fovea/source.h"

enum fv_wish_stage { FV_WISH_NONE, FV_WISH_ASKED, FV_WISH_BEGUN, FV_WISH_DONE };

struct fv_wish {
    atomic_bool asked; /* what the camera thread looks at */

    /* Under the lock. */
    pthread_mutex_t lock;
    pthread_cond_t done;
    enum fv_wish_stage stage;
    bool left; /* nobody waits for the answer any more */
    enum fovea_source_control control;
    double value;
    enum fovea_status status;
    struct fovea_error error;
};

void fv_wish_open(struct fv_wish *wish);
void fv_wish_close(struct fv_wish *wish);

/* Ask, ring `wake_fd`, and wait for the answer, at most 3 seconds. `uri` begins the line of an
 * error. */
enum fovea_status fv_wish_ask(struct fv_wish *wish, const char *uri, int wake_fd,
                              enum fovea_source_control control, double value,
                              struct fovea_error *error);

/* On the camera thread. False: there is none, which takes no system call. Whoever takes one answers
 * it. */
bool fv_wish_take(struct fv_wish *wish, enum fovea_source_control *control, double *value);
void fv_wish_answer(struct fv_wish *wish, enum fovea_status status,
                    const struct fovea_error *error);

#endif
