/* What a run says while it goes on: the status of a terminal, and a line per change of state. */
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/run/run.h"
#include "support/say.h"
#include "support/text.h"

static enum fv_say_colour colour_of(enum fv_watch_state state)
{
    switch (state) {
    case FV_WATCH_TRACKING:
        return FV_SAY_GREEN;
    case FV_WATCH_LOST:
        return FV_SAY_RED;
    case FV_WATCH_RUNNING:
        return FV_SAY_PLAIN;
    default:
        return FV_SAY_YELLOW;
    }
}

static bool change_say(const struct fv_watch_change *change)
{
    char before[64] = "";
    if (change->from != FV_WATCH_WAITING)
        snprintf(before, sizeof before, ", after %.3f s %s", (double)change->lasted_ns * 1e-9,
                 fv_watch_name(change->from));
    return fv_say_word(colour_of(change->to), fv_watch_name(change->to),
                       " from frame %" PRIu64 " on, at %.3f s%s", change->frame,
                       (double)change->at_ns * 1e-9, before);
}

/* Of states that follow fast, the one that is seen. */
static void imu_say(struct fv_run *run)
{
    const int state = atomic_load(&run->watch.imu_state), before = run->imu_said;
    if (state == before) return;
    run->imu_said = state;
    if (run->quiet || (state == FOVEA_IMU_OK && before == FOVEA_IMU_NONE)) return;
    fv_say_word(state == FOVEA_IMU_OK ? FV_SAY_GREEN : FV_SAY_YELLOW, "inertial sensor", ": %s",
                fovea_imu_state_name((enum fovea_imu_state)state));
}

/* The offset between the clocks is another than the rig states, and is used. */
static void imu_moved_say(struct fv_run *run)
{
    const int64_t moved_ns = atomic_load(&run->watch.imu_moved_ns);
    if (llabs(moved_ns - run->imu_moved_said) < 1000000) return; /* it is followed */
    run->imu_moved_said = moved_ns;
    if (run->quiet) return;
    fv_say_word(FV_SAY_YELLOW, "inertial sensor",
                ": the camera's stamps are %.1f ms %s against it (sigma %.1f): samples are moved",
                fabs((double)moved_ns * 1e-6), moved_ns < 0 ? "early" : "late",
                (double)atomic_load(&run->watch.imu_moved_sigma_ns) * 1e-6);
}

const char *fv_run_imu_calibration(const struct fv_run *run)
{
    return run->settings.imu_file[0] != '\0' ? run->settings.imu_file : run->settings.source;
}

/* The rotation of the sensor's mount is another than the rig states. */
static void imu_turned_say(struct fv_run *run)
{
    const int64_t turned_mdeg = atomic_load(&run->watch.imu_turned_mdeg);
    if (turned_mdeg == 0 || run->imu_turned_said) return;
    run->imu_turned_said = true;
    if (run->quiet) return;
    fv_say_word(FV_SAY_RED, "inertial sensor",
                " is turned by %.1f degrees (sigma %.1f) against T_body_imu of %s: calibrate again",
                (double)turned_mdeg * 1e-3,
                (double)atomic_load(&run->watch.imu_turned_sigma_mdeg) * 1e-3,
                fv_run_imu_calibration(run));
}

/* A terminal that takes nothing costs one wait per call, since files are written meanwhile. */
void fv_run_changes_say(struct fv_run *run)
{
    struct fv_watch_change change;
    bool taken = !run->quiet;
    while (fv_watch_take(&run->watch, &change)) {
        fv_service_state(&run->service, fv_watch_name(change.to));
        if (taken) taken = change_say(&change);
    }
    const uint64_t lost = atomic_exchange(&run->watch.changes_lost, 0);
    if (lost > 0 && taken)
        fv_say("%" PRIu64 " more changes of state: they came too fast to be listed", lost);
    imu_say(run);
    imu_moved_say(run);
    imu_turned_say(run);
    const char *reason = fv_watch_calibration(&run->watch, &run->calibration_said);
    if (reason != NULL && !run->quiet) fv_say_word(FV_SAY_RED, "calibration", ": %s", reason);
}

/* ---- the status line ------------------------------------------------------------------------- */

struct fields {
    char text[512];
    size_t length;
};

/* One field behind two spaces; those that do not fit are left out. */
__attribute__((format(printf, 2, 3))) static void add(struct fields *fields, const char *format,
                                                      ...)
{
    va_list arguments;
    char field[80];
    va_start(arguments, format);
    vsnprintf(field, sizeof field, format, arguments);
    va_end(arguments);
    const size_t room = sizeof fields->text - fields->length;
    if (strlen(field) + 2 >= room) return;
    fields->length += (size_t)snprintf(fields->text + fields->length, room, "  %s", field);
}

static void add_count(struct fields *fields, uint64_t count, const char *of)
{
    char text[FV_TEXT_COUNT_BYTES];
    add(fields, "%s", fv_text_count(count, of, text));
}

static const char *source_trouble(int state)
{
    switch (state) {
    case FOVEA_SOURCE_LATE:
        return "camera late";
    case FOVEA_SOURCE_STALLED:
        return "camera stalled";
    case FOVEA_SOURCE_GONE:
        return "camera gone";
    case FOVEA_SOURCE_RETURNING:
        return "camera returning";
    default:
        return NULL;
    }
}

/* Frames that the run will take; 0: not known. */
static uint64_t frames_expected(const struct fv_run *run)
{
    const uint64_t count = run->setup.ops->info(run->setup.source)->frame_count,
                   limit = run->selection.frames;
    return count == 0 || (limit > 0 && limit < count) ? limit : count;
}

static void frame_field(struct fields *fields, const struct fv_run *run, uint64_t frames)
{
    const uint64_t expected = frames_expected(run);
    if (expected > 0)
        add(fields, "frame %" PRIu64 "/%" PRIu64, frames, expected);
    else
        add(fields, "frame %" PRIu64, frames);
}

static void map_fields(struct fields *fields, struct fv_run *run)
{
    struct fv_watch *watch = &run->watch;
    if (run->settings.runtime.odometry.enabled) {
        add_count(fields, atomic_load(&watch->landmarks), "landmark");
        add_count(fields, atomic_load(&watch->keyframes), "keyframe");
    }
    if (atomic_load(&watch->closures) > 0)
        add_count(fields, atomic_load(&watch->closures), "closure");
    if (atomic_load(&watch->merges) > 0) add_count(fields, atomic_load(&watch->merges), "merge");
    if (run->settings.model[0] != '\0')
        add_count(fields, atomic_load(&watch->detections), "detection");
}

void fv_run_status_show(struct fv_run *run, struct fv_run_pace *pace)
{
    enum { SHORTEST_NS = 200000000 };
    int64_t wall_ns, cpu_ns;
    fv_timing_clock(NULL, &wall_ns, &cpu_ns);
    if (wall_ns - pace->wall_ns < SHORTEST_NS) return;
    struct fields fields = {0};
    const enum fv_watch_state state = (enum fv_watch_state)atomic_load(&run->watch.now_state);
    const uint64_t frames = atomic_load(&run->shared.frames);
    const char *trouble = source_trouble(atomic_load(&run->watch.source_state));
    if (trouble != NULL) add(&fields, "%s", trouble);
    const int imu = atomic_load(&run->watch.imu_state);
    if (imu != FOVEA_IMU_NONE && imu != FOVEA_IMU_OK)
        add(&fields, "imu %s", fovea_imu_state_name((enum fovea_imu_state)imu));
    frame_field(&fields, run, frames);
    add(&fields, "%.1f Hz",
        (double)(frames - pace->frames) * 1e9 / (double)(wall_ns - pace->wall_ns));
    const int calibration = atomic_load(&run->watch.calibration);
    if (calibration != FOVEA_CALIBRATION_OK)
        add(&fields, "calibration %s",
            calibration == FOVEA_CALIBRATION_WRONG ? "wrong" : "doubtful");
    map_fields(&fields, run);
    if (atomic_load(&run->shared.dropped) > 0)
        add(&fields, "%" PRIu64 " dropped", atomic_load(&run->shared.dropped));
    add(&fields, "step %.2f ms", (double)atomic_load(&run->shared.step_ns) * 1e-6);
    add_count(&fields, atomic_load(&run->shared.features), "corner");
    add(&fields, "%.1f MiB", (double)atomic_load(&run->shared.resident_bytes) / 1048576.0);
    fv_say_status_word(colour_of(state), fv_watch_name(state), " %.1f s%s",
                       (double)atomic_load(&run->watch.lasts_ns) * 1e-9, fields.text);
    *pace = (struct fv_run_pace){wall_ns, frames};
}
