/* Metres, gravity and velocity from an inertial sensor beside the camera's poses.
 *
 * Ten times a second a frame's pose becomes a station of the inertial estimator
 * (inertial/estimator.h), with the sigma of what the frame errs by alone (fv_odometry_own_sigmas),
 * with the attitude that its picture alone showed (odometry/turn.h), given relative to its
 * reference keyframe, so that what optimisation makes of the map improves the stations too. Poses
 * are those of `world`, the continuous frame of struct fovea_pose. Units of work keep the estimate
 * up to date. It is *claimed*, which makes poses metric and upright, when it says and shows that it
 * is good: a sigma of the scale of at most 4 %, a misfit that noise explains, seconds of motion,
 * and estimates that agree with each other; before that it is not used. Constant velocity,
 * hovering, pure rotation and free fall show no scale. Once claimed in a map, a scale stays known
 * there, and grows less sure while nothing adds to it.
 *
 * From frame to frame the samples say how the camera moved (inertial/live.h): odometry searches
 * from there, the published velocity is this one, and while the pictures show nothing, the pose
 * goes on by the samples for up to 2 s.
 *
 * Where another map begins behind that, in metres by two cameras, it does so in the same world, and
 * what is known goes on; only stations begin anew.
 *
 * Where pictures and samples show that the camera stands (inertial/still.h), its velocity is 0,
 * and while the pictures show nothing, it stays where it is as long as the samples are quiet.
 *
 * The offset between the clocks of camera and sensor is estimated beside that, always
 * (inertial/clock.h). Where it is found to be another than the rig states, by more than noise and
 * by 1.5 ms, samples are moved by it from then on. Beyond 3 ms all that came of them begins anew,
 * and what was claimed is in doubt until the estimate has shown itself again. With a right clock
 * nothing of it happens.
 *
 * State holds no addresses. Real-time safe: every function is bounded; no heap. */
#ifndef FOVEA_SCALE_INERTIAL_H
#define FOVEA_SCALE_INERTIAL_H

#include "base/arena.h"
#include "fovea/rig.h"
#include "fovea/sensor.h"
#include "inertial/clock.h"
#include "inertial/estimator.h"
#include "inertial/gate.h"
#include "inertial/live.h"
#include "inertial/still.h"
#include "odometry/odometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Estimates that must agree before the scale is claimed. */
enum { FV_INERTIAL_AGREEING = 4 };

/* What is known, in the axes of `world`. */
struct fv_inertial_known {
    bool claimed;
    double scale, scale_sigma; /* metres per unit of world, now; relative */
    double map_scale;          /* the same in the mean of the way through this map */
    double gravity[3];         /* m/s^2 */
    double gravity_sigma;      /* rad, of an axis; at least what a map tilts by while it grows */
    bool settled;              /* gravity is known well enough to turn `odom` by it */
    /* Gravity in the mean of the way through this map, together with what the map brought. */
    struct fv_map_gravity map_gravity;
    struct fv_imu_biases biases;
    double bias_covariance[21]; /* gyro, acceleration; upper triangle by rows */
    /* Of the camera, now; where `moving`. */
    bool moving;
    double velocity[3], velocity_sigma; /* m/s */
    double rate[3], rate_sigma;         /* rad/s, in its own axes */
    /* The frame has no pose, and this is where the camera is by the samples since the last. */
    bool coasting;
    struct fv_se3 T_last_now; /* metres */
    double covariance[21];    /* of T_last_now, as that of struct fovea_pose */
};

/* Of clocks and mount; it outlasts maps. The offset comes of a filter that takes the mount as
 * stated until the mount is wrong, then of the one that estimates both. */
struct fv_inertial_stage_clock {
    struct fv_imu_clock found, mounted;
    int64_t moved_ns;       /* added to samples' stamps besides what the rig states */
    int64_t mount_since_ns; /* since when the mount is significantly off; 0: it is not */
    bool mount_wrong;       /* it was for a while, and stays so */
};

struct fv_inertial_stage_state {
    struct fv_inertial_known known;
    uint32_t map, reset_counter; /* that all this belongs to */
    bool begun, metric;          /* a map has; its unit is the metre by two cameras */
    int64_t station_ns;          /* the last station */
    struct fv_se3 T_world_cam;   /* the last pose, in world's unit */
    struct fv_inertial_live live;
    uint64_t cuts;           /* of the estimator's links, as last seen */
    bool anew;               /* the estimate began again since the last that counted */
    int64_t claimed_ns;      /* of the last estimate that counted, */
    double claimed_sigma;    /* and its sigma of the scale */
    uint32_t agreeing;       /* estimates that agreed with the one before */
    double log_scale, sigma; /* of the one before */
    struct fv_imu_still still;
    struct fv_map_gravity brought; /* by the map when it was entered */
    double depth;                  /* at the last station, in world's unit */
    bool doubted;                  /* what is claimed came of samples by a wrong clock */
};

struct fv_inertial_stage {
    bool enabled;
    struct fovea_rig_imu imu;
    double gyro_noise, acceleration_noise; /* densities, as stated or usual */
    struct fv_inertial estimator;
    struct fv_inertial_stage_state *state;
    struct fv_inertial_stage_clock *clock;
};

/* `noise_factor`: how many times larger the sensor's noise is than its data sheet says. */
void fv_inertial_stage_carve(struct fv_inertial_stage *stage, const struct fovea_rig *rig,
                             double noise_factor, double gravity_m_s2, struct fv_arena *persistent);
void fv_inertial_stage_init(struct fv_inertial_stage *stage);

/* What the gate let through in this step. */
void fv_inertial_stage_observe(struct fv_inertial_stage *stage, const struct fv_imu_gate *gate);
/* Before a frame: what the samples say of the motion since the last pose. */
void fv_inertial_stage_predict(struct fv_inertial_stage *stage, const struct fv_odometry *odometry,
                               int64_t stamp_ns, struct fv_motion_hint *hint);
/* How the camera turns about its own axes at a frame's instant, rad/s, by the last sample before
 * it; after fv_inertial_stage_predict. False: no sample in the 20 ms before; or the sensor's bias
 * is not known yet, and the turn is so slow that it could be the bias. */
bool fv_inertial_stage_rate(const struct fv_inertial_stage *stage, int64_t stamp_ns,
                            double rate[3]);
/* After each frame. */
void fv_inertial_stage_step(struct fv_inertial_stage *stage, const struct fv_odometry *odometry,
                            int64_t stamp_ns);

bool fv_inertial_stage_waiting(const struct fv_inertial_stage *stage);
void fv_inertial_stage_unit(struct fv_inertial_stage *stage, const struct fv_odometry *odometry);

/* NULL: nothing is claimed. */
const struct fv_inertial_known *fv_inertial_stage_known(const struct fv_inertial_stage *stage);
/* Biases with their covariance as that of struct fv_inertial_known: what is claimed, or before that
 * in a map what the maps before it left of them, the axes independent of each other. False, and
 * zeros: nothing is known of them. */
bool fv_inertial_stage_biases(const struct fv_inertial_stage *stage, struct fv_imu_biases *biases,
                              double covariance[21]);

/* How far the clocks are apart beyond what the rig states, seconds to add to a sample's stamp, and
 * how many of them are added. False: no inertial stage. */
struct fv_inertial_stage_offset {
    double offset_s, sigma_s, used_s;
};
bool fv_inertial_stage_offset(const struct fv_inertial_stage *stage,
                              struct fv_inertial_stage_offset *offset);

/* By which rotation the sensor is off the rig's T_body_imu. False: no inertial stage. */
struct fv_inertial_stage_mount {
    struct fv_imu_clock_mount found;
    bool wrong; /* significantly, at some time: calibrate again */
};
bool fv_inertial_stage_mount(const struct fv_inertial_stage *stage,
                             struct fv_inertial_stage_mount *mount);

/* ---- between the stage's own files ----------------------------------------------------------- */

/* Of the motion since the last pose, by `sum`, after which the sensor's attitude is R: covariance
 * of the camera, on its side and as that of struct fovea_pose, in metres; and sigma of its
 * velocity. */
void fv_inertial_stage_coast_covariance(const struct fv_inertial_stage *stage,
                                        const struct fv_preintegration *sum, const double R[9],
                                        double out[21]);
double fv_inertial_stage_coast_velocity_sigma(const struct fv_inertial_stage *stage,
                                              const struct fv_preintegration *sum);

void fv_inertial_stage_init_clocks(struct fv_inertial_stage *stage);
/* After a frame with a pose: clocks and mount are judged by what its picture showed. From now on
 * samples are moved by clock->moved_ns. True: that is so far from what it was that nothing of
 * before holds. */
bool fv_inertial_stage_compare_clocks(struct fv_inertial_stage *stage,
                                      const struct fv_odometry *odometry, int64_t stamp_ns);

/* An estimate has come: whether it counts, and what is known by it. */
void fv_inertial_stage_judge(struct fv_inertial_stage *stage);

/* A sample; a frame with a pose, before the filter of frames takes it; the filter after that; and a
 * frame without one, whose motion by the samples is in `known`. */
void fv_inertial_stage_still_take(struct fv_inertial_stage *stage,
                                  const struct fv_imu_reading *reading);
void fv_inertial_stage_still_see(struct fv_inertial_stage *stage, const struct fovea_pose *pose,
                                 int64_t stamp_ns);
void fv_inertial_stage_still_stop(struct fv_inertial_stage *stage);
void fv_inertial_stage_still_stay(struct fv_inertial_stage *stage, int64_t stamp_ns);

#ifdef __cplusplus
}
#endif
#endif
