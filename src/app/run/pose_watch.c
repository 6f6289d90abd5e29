#include "app/run/pose_watch.h"

#include <string.h>

#include "app/run/timing.h"
#include "base/elementary.h"

void fv_watch_open(struct fv_watch *watch, bool odometry, bool by_clock)
{
    memset(watch, 0, sizeof *watch);
    watch->odometry = odometry;
    watch->by_clock = by_clock;
    watch->ribbon.stride = 1;
    fv_ring_init(&watch->ring, watch->changes, sizeof watch->changes);
}

const char *fv_watch_name(enum fv_watch_state state)
{
    static const char *const names[FV_WATCH_STATES] = {
        [FV_WATCH_WAITING] = "waiting",   [FV_WATCH_RUNNING] = "running",
        [FV_WATCH_STARTING] = "starting", [FV_WATCH_TRACKING] = "tracking",
        [FV_WATCH_WEAK] = "weak",         [FV_WATCH_LOST] = "lost",
        [FV_WATCH_PAUSED] = "paused",     [FV_WATCH_COASTING] = "coasting",
    };
    return (unsigned)state < FV_WATCH_STATES ? names[state] : "unknown";
}

/* ---- the loop thread ------------------------------------------------------------------------- */

static void ribbon_add(struct fv_watch_ribbon *ribbon, enum fv_watch_state state)
{
    if (ribbon->bins == FV_WATCH_BINS && ribbon->in_last == ribbon->stride) {
        for (uint32_t i = 0; i < FV_WATCH_BINS / 2; i++) {
            const uint8_t a = ribbon->state[2 * i], b = ribbon->state[2 * i + 1];
            ribbon->state[i] = a > b ? a : b;
        }
        ribbon->bins = FV_WATCH_BINS / 2;
        ribbon->stride *= 2;
        ribbon->in_last = ribbon->stride;
    }
    if (ribbon->bins == 0 || ribbon->in_last == ribbon->stride) {
        ribbon->state[ribbon->bins++] = (uint8_t)state;
        ribbon->in_last = 1;
        return;
    }
    uint8_t *last = &ribbon->state[ribbon->bins - 1];
    if (state > *last) *last = (uint8_t)state;
    ribbon->in_last++;
}

static void change(struct fv_watch *watch, enum fv_watch_state to)
{
    const int64_t lasted_ns = watch->last_ns - watch->since_ns;
    const struct fv_watch_change record = {watch->state, to, watch->frames,
                                           watch->last_ns - watch->first_ns, lasted_ns};
    uint8_t *place = fv_ring_reserve(&watch->ring, sizeof record);
    if (place != NULL) {
        memcpy(place, &record, sizeof record);
        fv_ring_commit(&watch->ring, sizeof record);
    } else {
        atomic_fetch_add_explicit(&watch->changes_lost, 1, memory_order_relaxed);
    }
    watch->total_ns[watch->state] += lasted_ns;
    watch->state = to;
    watch->since_ns = watch->last_ns;
}

static enum fv_watch_state state_of(const struct fv_watch *watch, const struct fovea_pose *pose)
{
    if (watch->paused) return FV_WATCH_PAUSED;
    if (!watch->begun) return FV_WATCH_WAITING;
    if (!watch->odometry) return FV_WATCH_RUNNING;
    switch (pose->state) {
    case FOVEA_TRACKING_STARTING:
        return FV_WATCH_STARTING;
    case FOVEA_TRACKING_OK:
        return FV_WATCH_TRACKING;
    case FOVEA_TRACKING_WEAK:
        return FV_WATCH_WEAK;
    case FOVEA_TRACKING_COASTING:
        return FV_WATCH_COASTING;
    default:
        return FV_WATCH_LOST;
    }
}

static void time_note(struct fv_watch *watch, const struct fovea_inputs *inputs)
{
    int64_t now_ns = inputs->now_ns, cpu_ns;
    if (watch->by_clock) fv_timing_clock(NULL, &now_ns, &cpu_ns);
    if (watch->frames <= 1 && !watch->begun) {
        watch->first_ns = watch->since_ns = watch->last_ns = now_ns;
        return;
    }
    int64_t gap;
    if (!__builtin_sub_overflow(now_ns, watch->last_ns, &gap) && gap > 0) watch->last_ns = now_ns;
}

/* Once: what is known when the mount is first wrong. */
static void mount_note(struct fv_watch *watch, const struct fovea_imu_status *imu)
{
    const double mdeg = 1e3 * 180 / FV_PI;
    if (!imu->mount_wrong || atomic_load_explicit(&watch->imu_turned_mdeg, memory_order_relaxed))
        return;
    atomic_store_explicit(&watch->imu_turned_sigma_mdeg, (int64_t)(imu->mount_angle_sigma * mdeg),
                          memory_order_relaxed);
    atomic_store_explicit(&watch->imu_turned_mdeg, (int64_t)(imu->mount_angle * mdeg),
                          memory_order_release);
}

static void imu_note(struct fv_watch *watch, const struct fovea *rt)
{
    struct fovea_imu_status imu;
    fovea_imu_status_get(rt, &imu);
    mount_note(watch, &imu);
    atomic_store_explicit(&watch->imu_state, (int)imu.state, memory_order_relaxed);
    const int64_t moved_ns = (int64_t)(imu.time_offset_used_s * 1e9);
    if (moved_ns == atomic_load_explicit(&watch->imu_moved_ns, memory_order_relaxed)) return;
    atomic_store_explicit(&watch->imu_moved_sigma_ns, (int64_t)(imu.time_offset_sigma_s * 1e9),
                          memory_order_relaxed);
    atomic_store_explicit(&watch->imu_moved_ns, moved_ns, memory_order_release);
}

static void calibration_note(struct fv_watch *watch, const struct fovea *rt)
{
    struct fovea_calibration calibration;
    fovea_calibration_get(rt, &calibration);
    const int before = atomic_load_explicit(&watch->calibration, memory_order_relaxed);
    atomic_store_explicit(&watch->calibration, (int)calibration.state, memory_order_relaxed);
    if ((int)calibration.state <= before) return;
    const uint32_t number =
        atomic_load_explicit(&watch->calibration_verdicts, memory_order_relaxed) + 1;
    memcpy(watch->calibration_reasons[number % FV_WATCH_REASONS], calibration.reason,
           sizeof calibration.reason);
    atomic_store_explicit(&watch->calibration_verdicts, number, memory_order_release);
}

void fv_watch_step(struct fv_watch *watch, const struct fovea *rt,
                   const struct fovea_inputs *inputs, bool processed)
{
    struct fovea_stats stats;
    struct fovea_pose pose;
    fovea_stats_get(rt, &stats);
    fovea_pose_get(rt, &pose);
    watch->frames += inputs->frame != NULL;
    time_note(watch, inputs);
    if (processed) watch->begun = true, watch->paused = false;
    if (stats.refused_paused > watch->refused_paused) watch->paused = true;
    watch->refused_paused = stats.refused_paused;
    const enum fv_watch_state state = state_of(watch, &pose);
    if (state != watch->state) change(watch, state);
    if (inputs->frame != NULL) ribbon_add(&watch->ribbon, state);
    if (processed && state == FV_WATCH_STARTING) {
        watch->starting_frames++;
        watch->starting_features += stats.features;
        watch->starting_matched +=
            pose.matches >= FOVEA_START_MATCHES_MIN || 4 * pose.matches >= stats.features;
    }
    atomic_store_explicit(&watch->now_state, (int)state, memory_order_relaxed);
    atomic_store_explicit(&watch->source_state, (int)inputs->source_state, memory_order_relaxed);
    atomic_store_explicit(&watch->lasts_ns, watch->last_ns - watch->since_ns, memory_order_relaxed);
    atomic_store_explicit(&watch->landmarks, pose.landmarks, memory_order_relaxed);
    atomic_store_explicit(&watch->keyframes, pose.keyframes, memory_order_relaxed);
    atomic_store_explicit(&watch->closures, stats.closures, memory_order_relaxed);
    atomic_store_explicit(&watch->merges, stats.maps_merged, memory_order_relaxed);
    imu_note(watch, rt);
    calibration_note(watch, rt);
}

/* ---- the watching thread --------------------------------------------------------------------- */

bool fv_watch_take(struct fv_watch *watch, struct fv_watch_change *change)
{
    size_t bytes;
    const uint8_t *oldest = fv_ring_peek(&watch->ring, &bytes);
    if (oldest == NULL) return false;
    memcpy(change, oldest, sizeof *change);
    fv_ring_release(&watch->ring, sizeof *change);
    return true;
}

const char *fv_watch_calibration(struct fv_watch *watch, uint32_t *taken)
{
    const uint32_t number =
        atomic_load_explicit(&watch->calibration_verdicts, memory_order_acquire);
    if (number == *taken) return NULL;
    *taken = number;
    return watch->calibration_reasons[number % FV_WATCH_REASONS];
}

void fv_watch_close(struct fv_watch *watch)
{
    watch->total_ns[watch->state] += watch->last_ns - watch->since_ns;
    watch->since_ns = watch->last_ns;
}

const char *fv_watch_why_no_pose(const struct fv_watch *watch, bool localise_only)
{
    if (!watch->odometry) return NULL;
    if (!watch->begun)
        return watch->paused ? "the run was paused all the time" : "no frame was processed";
    if (localise_only) return "the camera was never found in the loaded map";
    if (watch->starting_frames == 0) return "no state but lost was reached";
    if (watch->starting_features < FOVEA_START_MATCHES_MIN * watch->starting_frames)
        return "too few corners in the images: more light, texture or focus is needed";
    if (watch->starting_matched * 4 < watch->starting_frames)
        return "too few corners were found again from image to image: the motion is too fast, or "
               "frames are missing";
    return "never enough parallax: the camera must move sideways, turning is not enough";
}
