/* The real-time loop: dequeue, step, publish, work, publish, requeue.
 *
 * Runs on a thread of its own, which from the first frame to the last makes no heap call and only
 * these system calls: clock_gettime, clock_nanosleep and what the source's dequeue needs. Messages
 * are copied into rings, from which a thread of its own sends. The thread that started the loop
 * watches signals, the terminal and /proc meanwhile, and talks to it through struct fv_loop_shared
 * only.
 *
 * Frames of a source that is not live are paced by their stamps when `real_time` is set. A frame is
 * late by the time since it was due, or since it was asked for when the source itself was slow; one
 * that is late by more than FV_LOOP_QUEUE frame periods is dropped and counted, as a camera's
 * driver with that many buffers would. Until then the loop catches up, so that no frame is dropped
 * for which there was processor time. */
#ifndef FOVEA_APP_RUN_LOOP_H
#define FOVEA_APP_RUN_LOOP_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "app/run/timing.h"
#include "fovea/fovea.h"
#include "fovea/source.h"

enum { FV_LOOP_QUEUE = 4 };

/* Between the loop and the thread that watches it. */
struct fv_loop_shared {
    atomic_bool stop;                /* set by the watcher: end after this frame */
    _Atomic uint64_t resident_bytes; /* set by the watcher */
    _Atomic float temperature_c;     /* set by the watcher */
    /* Set by the watcher: percent of the period that step and work may use, by the clock; 0: all of
     * it. Grants follow, and they are recorded. */
    _Atomic uint32_t share;
    _Atomic uint64_t frames, features;
    _Atomic uint64_t pictures;                  /* frames that a step has processed */
    _Atomic uint64_t images[FOVEA_CAMERAS_MAX]; /* of each camera, likewise */
    _Atomic uint64_t dropped; /* by the loop as too late, and by the source, as the loop was busy */
    _Atomic uint64_t beats;   /* rises while the loop runs, with and without frames */
    _Atomic int64_t step_ns;
};

/* What happens around a step and a work; each may be NULL. Called on the loop's thread: no heap,
 * and no waiting but in `pace`. Outputs are valid during the call. */
struct fv_loop_hooks {
    void *context;
    void (*pace)(void *context); /* before a frame is taken, when none comes by the clock; returns
                                    soon after `stop` */
    uint32_t (*commands)(void *context); /* enum fovea_command bits that came since the last call */
    /* Fill in the samples and boxes that have come; the rest of `inputs` is set. `given`: what the
     * source gave, NULL: nothing; where no camera gave an image, inputs->frame is NULL. */
    void (*sense)(void *context, const struct fovea_frame *given, struct fovea_inputs *inputs);
    /* `pose` is that of this frame; NULL when none was processed. */
    void (*step_done)(void *context, const struct fovea_inputs *inputs,
                      const struct fovea_outputs *outputs, const struct fovea_pose *pose);
    void (*work_done)(void *context, const struct fovea_inputs *inputs,
                      const struct fovea_grants *grants, const struct fovea_outputs *outputs);
};

struct fv_loop_counts {
    uint64_t in;        /* frames taken from the source */
    uint64_t processed; /* of these: went through a step */
    uint64_t posed;     /* of the processed: with a pose */
    uint64_t lost;      /* of the processed: state `lost`; the rest was looking for a start */
    uint64_t refused;   /* of these: not taken by the step (stamp, format, paused) */
    uint64_t late;      /* of these: dropped since the loop was busy or had no processor time */
    uint64_t starved;   /* of the late: in time if the loop had had a processor to itself */
    uint64_t without_frame;
};

struct fv_loop {
    /* Given by the caller. */
    struct fovea *rt;
    const struct fovea_config *config;
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    bool real_time;
    uint64_t frames_max; /* 0: no limit */
    struct fv_loop_hooks hooks;
    struct fv_timings *timings; /* fv_timings_init */
    struct fv_loop_shared *shared;

    /* Results, when the loop has ended. */
    struct fv_loop_counts counts;
    struct fovea_source_counts source_counts;
    /* FOVEA_END, FOVEA_OK (stopped, or frames_max reached), negative: the source failed */
    enum fovea_status status;
    uint64_t heap_calls;
    int64_t wall_ns, cpu_ns;

    /* The loop's own. */
    struct fovea_governor governor;
    int64_t period_ns; /* nominal time between frames */
    int64_t last_stamp_ns, last_due_ns;
    enum fovea_clock clock;           /* of the last frame */
    int64_t mark_due_ns, mark_cpu_ns; /* of the last frame taken by the clock */
    int64_t own_late_ns; /* how late it would be had the loop had a processor to itself */
    bool any_frame;
    bool waiting; /* the last iteration of a live source was without a frame */
};

/* Run until the source ends, `frames_max` is reached or `shared->stop` is set. The source must have
 * been started. */
void fv_loop_run(struct fv_loop *loop);

#endif
