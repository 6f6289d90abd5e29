/* What happens to a live source when its camera does not do what it should: one state machine for
 * all of them.
 *
 *            find: there             set up                first good frame
 *   GONE ───────────────► RETURNING ───────► RETURNING ───────────────────► OK ◄──────────┐
 *    ▲  ◄─ find: away ─┐     │ refused        │ no frame within first_ns     │ late_ns     │ frame
 *    │                 │     ▼                ▼                              ▼             │
 *    │                 └─ STALLED ◄───────────┴──────────────── STALLED ◄── LATE ──────────┘
 *    │                     │ back-off, then find                 │ stalled_ns
 *    └─ unplugged: from anywhere                                 └ restart_ns: set up again
 *
 * States as in enum fovea_source_state and camera_status_t: `ok` frames come; `late` one is
 * overdue; `stalled` the camera is there but gives no frame (or refuses to be set up); `gone` it is
 * not there; `returning` it is being set up, or was and its first frame is awaited (so also right
 * after the start).
 *
 * A fault ends streaming (unplugged, an error that the driver does not get over, too many bad
 * frames in a row, or restart_ns without a frame); the camera is then torn down, looked for and set
 * up again. It is looked for every absent_ns while away. Where set-up is refused, or frames do not
 * come back, the pause grows from backoff_min_ns by doubling and never beyond backoff_max_ns; it
 * starts over with the first good frame or when the camera has been away.
 *
 * Plain data and pure functions of (state, event, time), so that it is tested without a camera.
 * Times are CLOCK_MONOTONIC. */
#ifndef FOVEA_LIVE_RECOVERY_H
#define FOVEA_LIVE_RECOVERY_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/source.h"

struct fv_recovery_times {
    int64_t late_ns, stalled_ns, restart_ns; /* since the last good frame */
    int64_t first_ns;                        /* since set-up, for the first frame */
    int64_t absent_ns;                       /* between looks for a camera that is away */
    int64_t backoff_min_ns, backoff_max_ns;
    uint32_t bad_frames; /* after this number in a row the camera is set up again */
};

/* For a camera of this nominal rate (0: not known): late after 2.5 periods, stalled after 10 and at
 * least 0.5 s, set up again after twice that; 3 s for a first frame; a look every 50 ms; back-off
 * from 50 ms to 1 s. */
void fv_recovery_times_default(struct fv_recovery_times *times, double rate_hz);

enum fv_recovery_phase {
    FV_RECOVERY_LOOKING = 0, /* about to be looked for and set up */
    FV_RECOVERY_ABSENT = 1,
    FV_RECOVERY_REFUSED = 2, /* there, but was not set up */
    FV_RECOVERY_FIRST = 3,   /* set up, no good frame yet */
    FV_RECOVERY_STREAMING = 4
};

/* What the state is a function of; two words, so that another thread can read them. */
struct fv_recovery_view {
    enum fv_recovery_phase phase;
    int64_t mark_ns; /* last good frame while streaming, else when the phase began */
};

struct fv_recovery {
    struct fv_recovery_times times;
    struct fv_recovery_view view;
    int64_t next_ns;    /* not to be looked for before */
    int64_t backoff_ns; /* the next pause */
    uint32_t bad_in_row;
    bool ever;          /* a good frame has come since the start */
    uint64_t recovered; /* times that frames came back */
};

void fv_recovery_start(struct fv_recovery *recovery, const struct fv_recovery_times *times,
                       int64_t now_ns);

/* Looked for, and set up where it was there. FOVEA_OK: streaming. FOVEA_GONE: away. Negative:
 * refused. */
void fv_recovery_tried(struct fv_recovery *recovery, enum fovea_status status, int64_t now_ns);
/* A good frame came. */
void fv_recovery_good(struct fv_recovery *recovery, int64_t now_ns);
/* A bad frame came. True: it was one too many, set the camera up again. */
bool fv_recovery_bad(struct fv_recovery *recovery);
/* Streaming is over: FOVEA_GONE when unplugged, negative for other faults. */
void fv_recovery_broken(struct fv_recovery *recovery, enum fovea_status status, int64_t now_ns);
/* No frame can come at present, and not for the camera's fault: this time is not waited. */
void fv_recovery_excused(struct fv_recovery *recovery, int64_t now_ns);
/* Whether frames have been waited for long enough: streaming is then broken. */
bool fv_recovery_waited_enough(const struct fv_recovery *recovery, int64_t now_ns);

static inline bool fv_recovery_streams(const struct fv_recovery *recovery)
{
    return recovery->view.phase >= FV_RECOVERY_FIRST;
}

/* Any thread that holds a copy of the view. */
enum fovea_source_state fv_recovery_state(const struct fv_recovery_times *times,
                                          struct fv_recovery_view view, int64_t now_ns);

#endif
