/* What the halves of the recorder share: recorder.c with the loop's side, recorder_writer.c. */
#ifndef FOVEA_APP_RECORD_RECORDER_INTERNAL_H
#define FOVEA_APP_RECORD_RECORDER_INTERNAL_H

#include <pthread.h>
#include <stdatomic.h>

#include "app/record/recorder.h"
#include "app/record/recording_file.h"
#include "base/ring.h"
#include "message/message.h"

enum fv_recorder_ending { FV_RECORDER_RUNNING = 0, FV_RECORDER_SLOW = 1, FV_RECORDER_FAILED = 2 };

/* How far the log goes: up to here it could end. */
struct fv_recorder_extent {
    uint64_t events, bytes, iterations, hash;
    int64_t time_us; /* of the last event */
};

struct fv_recorder {
    struct fv_ring ring;
    void *ring_memory;
    size_t iteration_bytes;          /* room that pace waits for */
    char path[FV_OUTPUT_PATH_BYTES]; /* of the file that is written */
    char channels[FV_MESSAGE_KIND_COUNT][FV_MESSAGE_CHANNEL_BYTES];

    /* The loop thread's. */
    uint8_t *header; /* encoded recording_t, sent with the first iteration since it needs a time */
    uint32_t header_bytes;
    bool started;
    int64_t event_number;
    uint64_t steps_lost;
    int64_t samples[FOVEA_SAMPLE_KIND_COUNT]; /* so far */
    uint32_t before_step;   /* changes of parameters and maps recorded for the step to come */
    enum fovea_clock clock; /* of the frames, of which the last said so */

    /* Of a recording that begins in the middle of its run: the loop's until `begun`. */
    struct fv_recorder_setup setup;
    int64_t begin_us;
    struct fovea_config in_force;
    atomic_bool begun;

    /* Shared. */
    _Atomic uint64_t bytes; /* written */
    atomic_int ending;      /* enum fv_recorder_ending; set by either thread, once */
    atomic_bool stop;       /* no more will come */

    /* The writer's. */
    pthread_t thread;
    struct fv_recording_file place;
    int file;                            /* of `place` */
    int looks;                           /* since the file was looked for */
    struct fv_recorder_extent written;   /* whole events */
    struct fv_recorder_extent iteration; /* those before the last iteration that has begun */
    bool iteration_begun; /* by samples or a frame: the inputs that follow belong to it */
    char reason[FV_RECORDING_END_REASON_BYTES];
    char stop_reason[FV_RECORDING_END_REASON_BYTES]; /* before `stop`; "": with the run */
};

/* The body of the thread that writes; the argument is a struct fv_recorder. */
void *fv_recorder_write(void *context);
/* On stderr, why it ended before the run. */
void fv_recorder_say_ended(const struct fv_recorder *recorder);

#endif
