#include "runtime/sense.h"

#include <string.h>

#include "geometry/se3.h"
#include "geometry/vec.h"

static const int64_t gap_max_ns = 60000000, most_ns = 2000000000;

/* ---- samples --------------------------------------------------------------------------------- */

static struct fv_imu_reading *kept_at(struct fv_sense *sense, uint32_t i)
{
    return &sense->kept[(sense->first + i) % FV_SENSE_KEPT];
}

static bool keep(struct fv_sense *sense, const struct fovea_rig_imu *rig,
                 const struct fovea_imu_sample *sample)
{
    struct fv_imu_reading next;
    if (!fv_imu_possible(sample) || !fv_imu_read(rig, sample, &next)) return false;
    if (__builtin_add_overflow(next.stamp_ns, sense->anchor.moved_ns, &next.stamp_ns)) return false;
    int64_t back_ns = -1;
    if (sense->count > 0) {
        const int64_t last_ns = kept_at(sense, sense->count - 1)->stamp_ns;
        if (__builtin_sub_overflow(last_ns, next.stamp_ns, &back_ns)) back_ns = INT64_MAX;
    }
    if (back_ns > most_ns) { /* the clock was set back: what is kept is of another time */
        sense->count = 0;
        sense->begun = false;
    } else if (back_ns >= 0) {
        return false;
    }
    if (sense->count == FV_SENSE_KEPT) {
        sense->first = (sense->first + 1) % FV_SENSE_KEPT;
        sense->count--;
    }
    *kept_at(sense, sense->count++) = next;
    return true;
}

/* ---- motion ---------------------------------------------------------------------------------- */

/* From reached_ns to sample i, by its mean with the one before. False: samples lack. */
static bool advance(struct fv_sense *sense, uint32_t i)
{
    const struct fv_imu_reading *now = kept_at(sense, i),
                                *before = i > 0 ? kept_at(sense, i - 1) : now;
    const struct fv_imu_biases *biases = &sense->anchor.biases;
    const int64_t from_ns = i > 0 ? before->stamp_ns : sense->reached_ns;
    if (now->stamp_ns <= sense->reached_ns) return true;
    if (now->stamp_ns - from_ns > gap_max_ns ||
        now->stamp_ns - sense->anchor.frame.stamp_ns > most_ns)
        return false;
    const double t = (double)(now->stamp_ns - sense->reached_ns) * 1e-9;
    double half[3], force[3], R[9], turned[9], step[9], a[3];
    for (int k = 0; k < 3; k++) {
        half[k] = ((now->gyro[k] + before->gyro[k]) / 2 - biases->gyro[k]) * t / 2;
        force[k] = (now->acceleration[k] + before->acceleration[k]) / 2 - biases->acceleration[k];
    }
    fv_so3_exp(half, step);
    fv_multiply33(sense->T_odom_imu.R, step, R);
    fv_multiply33(R, step, turned);
    fv_rotate3(R, force, a);
    for (int k = 0; k < 3; k++) {
        a[k] += sense->anchor.gravity[k];
        sense->T_odom_imu.t[k] += sense->velocity[k] * t + a[k] * t * t / 2;
        sense->velocity[k] += a[k] * t;
    }
    memcpy(sense->T_odom_imu.R, turned, sizeof turned);
    sense->reached_ns = now->stamp_ns;
    return true;
}

/* From a pose that has been offered. */
static void begin(struct fv_sense *sense, const struct fovea_rig_imu *rig,
                  const struct fv_sense_anchor *anchor)
{
    struct fv_se3 T_body_imu;
    double lever[3], turned[3];
    sense->begun = anchor->posed;
    if (!anchor->posed) return;
    sense->anchor = *anchor;
    fv_se3_from_rows(rig->T_body_imu, &T_body_imu);
    fv_se3_compose(&anchor->T_odom_body, &T_body_imu, &sense->T_odom_imu);
    fv_cross3(anchor->angular_rate, T_body_imu.t, lever);
    fv_rotate3(anchor->T_odom_body.R, lever, turned);
    for (int i = 0; i < 3; i++)
        sense->velocity[i] = anchor->velocity[i] + turned[i];
    sense->reached_ns = anchor->frame.stamp_ns;
    for (uint32_t i = 0; i < sense->count && sense->begun; i++)
        sense->begun = advance(sense, i);
}

/* The body's from the sensor's. */
static void write_pose(struct fv_sense *sense, const struct fovea_rig_imu *rig,
                       struct fv_sense_pose *pose)
{
    const struct fv_imu_reading *last = kept_at(sense, sense->count - 1);
    struct fv_se3 T_body_imu, T_imu_body;
    double rate[3], lever[3], turned[3];
    fv_se3_from_rows(rig->T_body_imu, &T_body_imu);
    fv_se3_invert(&T_body_imu, &T_imu_body);
    fv_se3_compose(&sense->T_odom_imu, &T_imu_body, &pose->T_odom_body);
    fv_subtract3(last->gyro, sense->anchor.biases.gyro, rate);
    fv_rotate3(T_body_imu.R, rate, pose->angular_rate);
    fv_cross3(pose->angular_rate, T_body_imu.t, lever);
    fv_rotate3(pose->T_odom_body.R, lever, turned);
    fv_subtract3(sense->velocity, turned, pose->velocity);
    pose->stamp_ns = sense->reached_ns;
    pose->since_ns = sense->reached_ns - sense->anchor.frame.stamp_ns;
}

/* ---- between the threads --------------------------------------------------------------------- */

void fv_sense_init(struct fv_sense *sense)
{
    sense->loops = 0;
    sense->anchor.moved_ns = 0;
    atomic_init(&sense->between, 1);
    sense->own = 2;
}

void fv_sense_offer(struct fv_sense *sense, const struct fv_sense_anchor *anchor)
{
    sense->offers[sense->loops] = *anchor;
    const uint32_t was = atomic_exchange_explicit(&sense->between, sense->loops | FV_SENSE_NEWER,
                                                  memory_order_acq_rel);
    sense->loops = was & ~(uint32_t)FV_SENSE_NEWER;
}

/* The newest pose, or NULL: none has come since. */
static const struct fv_sense_anchor *newest(struct fv_sense *sense)
{
    if ((atomic_load_explicit(&sense->between, memory_order_relaxed) & FV_SENSE_NEWER) == 0)
        return NULL;
    const uint32_t was =
        atomic_exchange_explicit(&sense->between, sense->own, memory_order_acq_rel);
    sense->own = was & ~(uint32_t)FV_SENSE_NEWER;
    return &sense->offers[sense->own];
}

bool fv_sense_take(struct fv_sense *sense, const struct fovea_rig_imu *rig,
                   const struct fovea_imu_sample *sample, struct fv_sense_pose *pose)
{
    const struct fv_sense_anchor *anchor = newest(sense);
    if (anchor != NULL) begin(sense, rig, anchor);
    if (!keep(sense, rig, sample)) return false;
    if (!sense->begun) return false;
    sense->begun = advance(sense, sense->count - 1);
    if (!sense->begun || sense->reached_ns < kept_at(sense, sense->count - 1)->stamp_ns ||
        sense->reached_ns <= sense->anchor.frame.stamp_ns)
        return false;
    write_pose(sense, rig, pose);
    return true;
}
