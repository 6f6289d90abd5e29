#include "app/network/wheel_odometry_gate.h"

#include <math.h>
#include <string.h>

static const double jitter_s = 0.1;

const char *fv_wheel_odometry_verdict_name(enum fv_wheel_odometry_verdict verdict)
{
    static const char *const names[FV_WHEEL_ODOMETRY_VERDICTS] = {
        [FV_WHEEL_ODOMETRY_TAKEN] = "taken",      [FV_WHEEL_ODOMETRY_MALFORMED] = "malformed",
        [FV_WHEEL_ODOMETRY_OLD] = "out of order", [FV_WHEEL_ODOMETRY_TOO_FAST] = "too fast",
        [FV_WHEEL_ODOMETRY_BUSY] = "loop busy",
    };
    return names[verdict];
}

void fv_wheel_odometry_gate_init(struct fv_wheel_odometry_gate *gate,
                                 const struct fv_wheel_odometry_limits *limits)
{
    memset(gate, 0, sizeof *gate);
    gate->limits = *limits;
    if (limits->speed_m_s == 0) gate->limits.speed_m_s = HUGE_VAL;
    if (limits->turn_rad_s == 0) gate->limits.turn_rad_s = HUGE_VAL;
}

/* A pose as wheel odometry: finite, with a quaternion that is one, at a time that fits nanoseconds.
 */
static bool sample_from(const bot_core_pose_t *pose, struct fovea_wheel_odometry_sample *sample)
{
    const double *q = pose->orientation;
    const double norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    if (!(norm2 > 0.98 && norm2 < 1.02) || pose->utime < 0 || pose->utime > INT64_MAX / 1000)
        return false;
    sample->stamp_ns = pose->utime * 1000;
    for (int i = 0; i < 4; i++)
        sample->orientation[i] = q[i] / sqrt(norm2);
    for (int i = 0; i < 3; i++) {
        if (!(pose->pos[i] > -1e9 && pose->pos[i] < 1e9)) return false;
        sample->position_m[i] = pose->pos[i];
    }
    return true;
}

static double distance_m(const struct fovea_wheel_odometry_sample *a,
                         const struct fovea_wheel_odometry_sample *b)
{
    double sum = 0;
    for (int i = 0; i < 3; i++)
        sum += (a->position_m[i] - b->position_m[i]) * (a->position_m[i] - b->position_m[i]);
    return sqrt(sum);
}

/* Between two unit quaternions, of which q and -q are the same rotation. */
static double angle_rad(const double a[4], const double b[4])
{
    double apart = 0, opposite = 0;
    for (int i = 0; i < 4; i++) {
        apart += (a[i] - b[i]) * (a[i] - b[i]);
        opposite += (a[i] + b[i]) * (a[i] + b[i]);
    }
    const double chord = sqrt(apart < opposite ? apart : opposite);
    return 4 * asin(fmin(chord / 2, 1));
}

/* What is left of `room` after `moved` in `dt_s`; negative: too much. */
static double use_room(double room, double limit, double dt_s, double moved)
{
    const double left = room + limit * dt_s - moved;
    return fmin(left, limit * jitter_s);
}

static enum fv_wheel_odometry_verdict judge(struct fv_wheel_odometry_gate *gate,
                                            const bot_core_pose_t *pose,
                                            struct fovea_wheel_odometry_sample *sample)
{
    const struct fv_wheel_odometry_limits *limits = &gate->limits;
    if (!sample_from(pose, sample)) return FV_WHEEL_ODOMETRY_MALFORMED;
    if (gate->any) {
        const double dt_s = (double)(sample->stamp_ns - gate->last.stamp_ns) * 1e-9;
        if (sample->stamp_ns <= gate->last.stamp_ns) return FV_WHEEL_ODOMETRY_OLD;
        const double room_m =
            use_room(gate->room_m, limits->speed_m_s, dt_s, distance_m(sample, &gate->last));
        const double room_rad = use_room(gate->room_rad, limits->turn_rad_s, dt_s,
                                         angle_rad(sample->orientation, gate->last.orientation));
        if (room_m < 0 || room_rad < 0) return FV_WHEEL_ODOMETRY_TOO_FAST;
        gate->room_m = room_m;
        gate->room_rad = room_rad;
    } else {
        gate->room_m = limits->speed_m_s * jitter_s;
        gate->room_rad = limits->turn_rad_s * jitter_s;
    }
    gate->any = true;
    gate->last = *sample;
    return FV_WHEEL_ODOMETRY_TAKEN;
}

void fv_wheel_odometry_gate_count(struct fv_wheel_odometry_gate *gate,
                                  enum fv_wheel_odometry_verdict verdict)
{
    atomic_fetch_add_explicit(&gate->counts[verdict], 1, memory_order_relaxed);
}

enum fv_wheel_odometry_verdict
fv_wheel_odometry_gate_judge(struct fv_wheel_odometry_gate *gate, const bot_core_pose_t *pose,
                             struct fovea_wheel_odometry_sample *sample)
{
    const enum fv_wheel_odometry_verdict verdict = judge(gate, pose, sample);
    if (verdict != FV_WHEEL_ODOMETRY_TAKEN) fv_wheel_odometry_gate_count(gate, verdict);
    return verdict;
}
