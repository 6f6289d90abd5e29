#include "recovery.h"

static const int64_t ms_ns = 1000000;

void fv_recovery_times_default(struct fv_recovery_times *times, double rate_hz)
{
    const double rate = rate_hz >= 0.1 && rate_hz <= 10000.0 ? rate_hz : 30.0;
    const int64_t period_ns = (int64_t)(1e9 / rate);
    const int64_t stalled_ns = 10 * period_ns > 500 * ms_ns ? 10 * period_ns : 500 * ms_ns;
    *times = (struct fv_recovery_times){
        .late_ns = period_ns * 5 / 2,
        .stalled_ns = stalled_ns,
        .restart_ns = 2 * stalled_ns,
        .first_ns = 2 * stalled_ns > 3000 * ms_ns ? 2 * stalled_ns : 3000 * ms_ns,
        .absent_ns = 50 * ms_ns,
        .backoff_min_ns = 50 * ms_ns,
        .backoff_max_ns = 1000 * ms_ns,
        .bad_frames = 30,
    };
}

static void enter(struct fv_recovery *recovery, enum fv_recovery_phase phase, int64_t now_ns)
{
    recovery->view = (struct fv_recovery_view){.phase = phase, .mark_ns = now_ns};
    recovery->bad_in_row = 0;
}

/* Look again after a pause that grows. */
static void back_off(struct fv_recovery *recovery, int64_t now_ns)
{
    recovery->next_ns = now_ns + recovery->backoff_ns;
    recovery->backoff_ns *= 2;
    if (recovery->backoff_ns > recovery->times.backoff_max_ns)
        recovery->backoff_ns = recovery->times.backoff_max_ns;
}

void fv_recovery_start(struct fv_recovery *recovery, const struct fv_recovery_times *times,
                       int64_t now_ns)
{
    *recovery = (struct fv_recovery){
        .times = *times, .next_ns = now_ns, .backoff_ns = times->backoff_min_ns};
    enter(recovery, FV_RECOVERY_LOOKING, now_ns);
}

static void away(struct fv_recovery *recovery, int64_t now_ns)
{
    if (recovery->view.phase != FV_RECOVERY_ABSENT) enter(recovery, FV_RECOVERY_ABSENT, now_ns);
    recovery->next_ns = now_ns + recovery->times.absent_ns;
    recovery->backoff_ns = recovery->times.backoff_min_ns;
}

void fv_recovery_tried(struct fv_recovery *recovery, enum fovea_status status, int64_t now_ns)
{
    if (status == FOVEA_OK) {
        enter(recovery, FV_RECOVERY_FIRST, now_ns);
    } else if (status == FOVEA_GONE) {
        away(recovery, now_ns);
    } else {
        if (recovery->view.phase != FV_RECOVERY_REFUSED)
            enter(recovery, FV_RECOVERY_REFUSED, now_ns);
        back_off(recovery, now_ns);
    }
}

void fv_recovery_good(struct fv_recovery *recovery, int64_t now_ns)
{
    if (recovery->view.phase == FV_RECOVERY_FIRST && recovery->ever) recovery->recovered++;
    recovery->ever = true;
    recovery->backoff_ns = recovery->times.backoff_min_ns;
    enter(recovery, FV_RECOVERY_STREAMING, now_ns);
}

bool fv_recovery_bad(struct fv_recovery *recovery)
{
    return ++recovery->bad_in_row >= recovery->times.bad_frames;
}

void fv_recovery_broken(struct fv_recovery *recovery, enum fovea_status status, int64_t now_ns)
{
    const bool had_frames = recovery->view.phase == FV_RECOVERY_STREAMING;
    if (status == FOVEA_GONE) {
        away(recovery, now_ns);
        return;
    }
    /* After good frames it is set up again at once; where none had come, only after the pause. */
    enter(recovery, had_frames ? FV_RECOVERY_LOOKING : FV_RECOVERY_REFUSED, now_ns);
    recovery->next_ns = now_ns;
    if (!had_frames) back_off(recovery, now_ns);
}

void fv_recovery_excused(struct fv_recovery *recovery, int64_t now_ns)
{
    recovery->view.mark_ns = now_ns;
}

bool fv_recovery_waited_enough(const struct fv_recovery *recovery, int64_t now_ns)
{
    const int64_t waited_ns = now_ns - recovery->view.mark_ns;
    return recovery->view.phase == FV_RECOVERY_FIRST ? waited_ns >= recovery->times.first_ns
                                                     : waited_ns >= recovery->times.restart_ns;
}

enum fovea_source_state fv_recovery_state(const struct fv_recovery_times *times,
                                          struct fv_recovery_view view, int64_t now_ns)
{
    const int64_t waited_ns = now_ns - view.mark_ns;
    switch (view.phase) {
    case FV_RECOVERY_ABSENT:
        return FOVEA_SOURCE_GONE;
    case FV_RECOVERY_REFUSED:
        return FOVEA_SOURCE_STALLED;
    case FV_RECOVERY_LOOKING:
    case FV_RECOVERY_FIRST:
        return waited_ns < times->first_ns ? FOVEA_SOURCE_RETURNING : FOVEA_SOURCE_STALLED;
    case FV_RECOVERY_STREAMING:
        break;
    }
    return waited_ns < times->late_ns      ? FOVEA_SOURCE_OK
           : waited_ns < times->stalled_ns ? FOVEA_SOURCE_LATE
                                           : FOVEA_SOURCE_STALLED;
}
