/* What a service manager learns of the run, by the protocol of sd_notify(3): datagrams to the
 * socket that NOTIFY_SOCKET names. Without it nothing happens.
 *
 * READY=1 when the loop runs, STATUS= with the state of the pose, STOPPING=1 at the end. Where
 * WATCHDOG_USEC asks for it, WATCHDOG=1 at a third of that period, but only if the loop has beaten
 * since: a step that does not return, a loop that waits for ever, or a process that is stopped gets
 * none, and the manager restarts it. A camera that is gone is no reason: the loop goes on. A thread
 * of its own sends, so that a disk that stalls the watching thread is none either. */
#ifndef FOVEA_APP_RUN_SERVICE_H
#define FOVEA_APP_RUN_SERVICE_H

#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "fovea/status.h"

struct fv_service {
    const _Atomic uint64_t *beats; /* of the loop */
    _Atomic(const char *) state;   /* of the pose, one word; NULL: not known */
    int socket;                    /* -1: no manager */
    struct sockaddr_un address;
    socklen_t address_bytes;
    int64_t period_ns; /* between two looks at the loop */
    bool guarded;      /* the manager asks for WATCHDOG=1 */
    pthread_t thread;
    sem_t end;
    bool running;
};

/* The socket that NOTIFY_SOCKET names; NULL: it is not set, or empty, and there is no manager. */
const char *fv_service_manager(void);

/* Start to tell the manager that the environment names, from the first beat on. Wrong values in the
 * environment are said, and ignored. `beats` stays the caller's. Init-only. */
void fv_service_open(struct fv_service *service, const _Atomic uint64_t *beats);

/* The state of the pose for the status; `state` must stay. Any thread. */
void fv_service_state(struct fv_service *service, const char *state);

/* The configuration is read again, and has been. Any thread. */
void fv_service_reloading(struct fv_service *service);
void fv_service_ready(struct fv_service *service);

/* The run ends: nothing is guarded any more. After fv_service_open, once. */
void fv_service_close(struct fv_service *service);

#endif
