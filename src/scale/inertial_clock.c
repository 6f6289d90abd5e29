/* The clocks of camera and inertial sensor, and how it is mounted, from frame to frame. */
#include <string.h>

#include "geometry/vec.h"
#include "inertial/stamp.h"
#include "scale/inertial.h"

/* Of an offset that samples are moved by: on odd seeds of sim:orbit, wander and corridor no error
 * is beyond 2.2 sigmas then. From then on the offset is followed in smaller steps. */
static const double move_sigma_s = 1e-3, move_least_s = 1.5e-3, move_sigmas = 4;
static const double follow_least_s = 0.5e-3, follow_sigmas = 2;
/* Of a step that leaves nothing of what came of the samples before. */
static const double doubt_least_s = 3e-3;

/* Of the mount's error per axis before anything is seen, rad. */
static const double mount_sigma = 0.1;
/* Where the mount is wrong: rad, sigmas, and for how long. Found on odd seeds of sim:orbit, wander,
 * corridor and fast, and on euroc_mh05_a: while a map begins, a right one is off by 4 sigmas. */
static const double mount_least = 0.035, mount_sigmas = 5;
static const int64_t mount_lasts_ns = 1000000000;

void fv_inertial_stage_init_clocks(struct fv_inertial_stage *stage)
{
    struct fv_inertial_stage_clock *clock = stage->clock;
    fv_imu_clock_init(&clock->found, 0);
    fv_imu_clock_init(&clock->mounted, mount_sigma);
    clock->moved_ns = 0;
    clock->mount_since_ns = 0;
    clock->mount_wrong = false;
}

static void judge_mount(struct fv_inertial_stage_clock *clock, int64_t stamp_ns)
{
    struct fv_imu_clock_mount mount;
    fv_imu_clock_mount(&clock->mounted, &mount);
    if (mount.angle < mount_least || mount.angle < mount_sigmas * mount.angle_sigma)
        clock->mount_since_ns = 0;
    else if (clock->mount_since_ns == 0)
        clock->mount_since_ns = stamp_ns;
    else if (fv_stamp_since(stamp_ns, clock->mount_since_ns) >= mount_lasts_ns)
        clock->mount_wrong = true;
}

static const struct fv_imu_clock *clock_of(const struct fv_inertial_stage *stage)
{
    return stage->clock->mount_wrong ? &stage->clock->mounted : &stage->clock->found;
}

/* The turn's covariance of a pose, on the sensor's side: those of cameras are on their own. */
static void turn_covariance(const struct fv_se3 *T_cam_imu, const double pose[21], double out[9])
{
    static const int places[9] = {15, 16, 17, 16, 18, 19, 17, 19, 20};
    double C[9], CR[9];
    for (int i = 0; i < 9; i++)
        C[i] = pose[places[i]];
    fv_multiply33(C, T_cam_imu->R, CR);
    fv_multiply_back33(T_cam_imu->R, CR, out);
}

bool fv_inertial_stage_compare_clocks(struct fv_inertial_stage *stage,
                                      const struct fv_odometry *odometry, int64_t stamp_ns)
{
    const struct fv_inertial_config *config = &stage->estimator.config;
    const struct fovea_pose *pose = fv_odometry_pose(odometry);
    struct fv_inertial_stage_clock *clock = stage->clock;
    const struct fv_imu_clock_noise noise = {stage->estimator.state->noise.gyro,
                                             stage->imu.gyro_walk * stage->imu.gyro_walk};
    struct fv_imu_clock_frame frame = {.stamp_ns = stamp_ns};
    struct fv_se3 T_world_cam;
    fv_se3_from_rows(pose->T_world_cam, &T_world_cam);
    fv_odometry_seen_attitude(odometry, T_world_cam.R);
    fv_multiply33(T_world_cam.R, config->T_cam_imu.R, frame.R);
    turn_covariance(&config->T_cam_imu, pose->covariance, frame.covariance);
    fv_imu_clock_frame(&clock->found, &noise, &frame);
    fv_imu_clock_frame(&clock->mounted, &noise, &frame);
    judge_mount(clock, stamp_ns);
    const struct fv_imu_clock *known = clock_of(stage);
    const double sigma_s = fv_imu_clock_sigma(known),
                 off_s = fv_abs(known->offset_s - (double)clock->moved_ns * 1e-9);
    const bool followed = clock->moved_ns != 0;
    if (sigma_s > move_sigma_s || off_s < (followed ? follow_least_s : move_least_s) ||
        off_s < (followed ? follow_sigmas : move_sigmas) * sigma_s)
        return false;
    clock->moved_ns = (int64_t)(known->offset_s * 1e9);
    return off_s > doubt_least_s;
}

bool fv_inertial_stage_offset(const struct fv_inertial_stage *stage,
                              struct fv_inertial_stage_offset *offset)
{
    memset(offset, 0, sizeof *offset);
    if (!stage->enabled) return false;
    offset->offset_s = clock_of(stage)->offset_s;
    offset->sigma_s = fv_imu_clock_sigma(clock_of(stage));
    offset->used_s = (double)stage->clock->moved_ns * 1e-9;
    return true;
}

bool fv_inertial_stage_mount(const struct fv_inertial_stage *stage,
                             struct fv_inertial_stage_mount *mount)
{
    memset(mount, 0, sizeof *mount);
    if (!stage->enabled) return false;
    fv_imu_clock_mount(&stage->clock->mounted, &mount->found);
    mount->wrong = stage->clock->mount_wrong;
    return true;
}
