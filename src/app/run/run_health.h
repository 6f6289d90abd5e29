/* The health of a run, gathered four times a second by the watching thread and sent by the loop as
 * health_t: once a second, and when the state of a part changes. While a step hangs, or the loop
 * waits for longer, the watching thread sends it, over LCM alone. Only where frames come by the
 * clock: a recording at full speed is no robot.
 *
 * Heat: the watching thread also lowers the share of the period that the governor may use
 * (host.h). */
#ifndef FOVEA_APP_RUN_RUN_HEALTH_H
#define FOVEA_APP_RUN_RUN_HEALTH_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "app/run/health.h"
#include "app/run/history.h"
#include "app/config/settings.h"
#include "app/run/self_test.h"
#include "fovea_health_t.h"
#include "message/message.h"

struct fv_run;

/* Whose `told` is: what the loop has not begun to send, the watching thread may take back, so that
 * after a step that hung what is newest is sent. */
enum fv_run_health_news {
    FV_RUN_HEALTH_SENT,  /* the watching thread's */
    FV_RUN_HEALTH_READY, /* whoever takes it */
    FV_RUN_HEALTH_TAKEN  /* the loop's */
};

struct fv_run_health {
    bool on; /* frames come by the clock */
    char channel[FV_MESSAGE_CHANNEL_BYTES];
    const char *root; /* before /sys: the environment's FOVEA_SYS_ROOT, "" by default */
    char self_test[FV_SELF_TEST_REASON_BYTES];

    /* The watching thread's. */
    struct fv_health judged;        /* the newest; the host is its last part */
    enum fv_health_state host_said; /* on the terminal */
    struct fv_host host;
    uint32_t share;
    uint64_t frames, pictures, inferences, beats; /* as last seen */
    uint64_t images[FOVEA_CAMERAS_MAX];           /* likewise */
    int64_t image_ns[FOVEA_CAMERAS_MAX];          /* when they last changed */
    uint64_t dropped_now, unsent_now;             /* counts at the last look */
    uint64_t late, unsent;                        /* those that were last sent */
    uint64_t sent;                                /* messages, as last seen */
    int64_t picture_ns, inference_ns, sent_ns;    /* when they last changed */
    int64_t looked_ns, stood_ns; /* the last look; for how long the loop has not moved */
    int64_t told_ns;
    uint64_t takes_seen; /* `takes`, when it was last told */
    bool untaken;        /* the loop has sent nothing of what it was handed a second before */
    char history_path[FV_SETTINGS_PATH_BYTES]; /* as settings say; "": it is not kept */
    struct fv_history history;
    int64_t counted_ns, kept_ns;  /* when seconds were last counted, and the file written */
    int64_t rest_ns, hot_rest_ns; /* of seconds that are not whole yet */

    /* Handed to the loop. */
    struct fv_health told;
    uint64_t told_late, told_unsent; /* what `told` has counted; the watching thread's */
    _Atomic int news;                /* enum fv_run_health_news */

    /* The loop's. */
    _Atomic uint64_t inferences_now, takes; /* of networks; of what was told */
    fovea_stamp_t stamp;                    /* of the last frame */
};

/* Before the loop: whether there is health at all, the self-test, and one start more in the
 * history. A robot does not stand still for its counters: a file that is damaged is left as it is,
 * one that cannot be written is tried again each minute, and a line says so (a wrong name in the
 * configuration was refused before: run_files.c). Init-only. */
void fv_run_health_open(struct fv_run *run);
/* Look at everything; the watching thread. */
void fv_run_health_tend(struct fv_run *run);
/* The loop has ended: keep the history. */
void fv_run_health_end(struct fv_run *run);
/* After a work: send what is new. Loop thread: no heap, no system call but clocks. */
void fv_run_health_work(struct fv_run *run, const struct fovea_inputs *inputs);

#endif
