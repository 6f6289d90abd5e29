/* A camera that stands: its velocity, and where it is without a picture. */
#include <string.h>

#include "geometry/vec.h"
#include "inertial/stamp.h"
#include "scale/inertial.h"

/* What standing leaves open. */
static const double stop_sigma = 0.005;                         /* of a velocity, m/s */
static const double stay_sigma = 0.002, stay_turn_sigma = 1e-3; /* by s: m, rad */

void fv_inertial_stage_still_take(struct fv_inertial_stage *stage,
                                  const struct fv_imu_reading *reading)
{
    const double root = __builtin_sqrt(stage->imu.rate_hz > 0 ? stage->imu.rate_hz : 200);
    const struct fv_imu_still_noise noise = {root * stage->gyro_noise,
                                             root * stage->acceleration_noise};
    fv_imu_still_take(&stage->state->still, &noise, reading);
}

void fv_inertial_stage_still_see(struct fv_inertial_stage *stage, const struct fovea_pose *pose,
                                 int64_t stamp_ns)
{
    struct fv_inertial_stage_state *s = stage->state;
    if (!s->known.claimed || s->doubted || !s->live.moving) {
        fv_imu_still_forget(&s->still);
        return;
    }
    const struct fv_imu_still_seen seen = {.stamp_ns = stamp_ns,
                                           .T_world_cam = s->T_world_cam,
                                           .depth = s->depth,
                                           .velocity = fv_norm3(s->live.velocity),
                                           .velocity_sigma = __builtin_sqrt(s->live.variance),
                                           .of_use = pose->state == FOVEA_TRACKING_OK};
    fv_imu_still_see(&s->still, &seen);
}

void fv_inertial_stage_still_stop(struct fv_inertial_stage *stage)
{
    struct fv_inertial_live *live = &stage->state->live;
    if (!stage->state->still.standing || !live->moving) return;
    memset(live->velocity, 0, sizeof live->velocity);
    live->variance = stop_sigma * stop_sigma;
}

void fv_inertial_stage_still_stay(struct fv_inertial_stage *stage, int64_t stamp_ns)
{
    static const int diagonal[6] = {0, 6, 11, 15, 18, 20};
    struct fv_inertial_stage_state *s = stage->state;
    const double t = (double)fv_stamp_since(stamp_ns, s->live.pose_ns) * 1e-9;
    if (!s->still.standing) return;
    fv_se3_identity(&s->known.T_last_now);
    memset(s->known.covariance, 0, sizeof s->known.covariance);
    for (int i = 0; i < 6; i++) {
        const double sigma = (i < 3 ? stay_sigma : stay_turn_sigma) * t;
        s->known.covariance[diagonal[i]] = sigma * sigma;
    }
    memset(s->known.velocity, 0, sizeof s->known.velocity);
    s->known.velocity_sigma = stop_sigma;
}
