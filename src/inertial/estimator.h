/* The inertial estimator: what an inertial sensor adds to poses that a camera gives, over the last
 * stretch of the way: gravity's direction, metres per unit, velocities and biases, and how sure
 * they are.
 *
 * A *station* is an instant at which the camera's pose is known, in a frame `world` of any axes and
 * unit that does not move. Between two stations stands what the samples say (preintegration.h).
 * Estimated together by Gauss-Newton are, by station, an error of the turn and of the position,
 * velocity, scale, acceleration bias and the direction of gravity, and for all the gyro bias. From
 * station to station the scale drifts, as that of a map by one camera does, and so does gravity's
 * direction, since such a map bends; the acceleration bias walks. This is the inertial-only
 * estimate of C. Campos, J. Montiel, J. Tardos, "Inertial-only optimization for visual-inertial
 * initialization" (ICRA 2020), with errors of the poses besides, so that the stated sigma holds;
 * the first step, from no velocity and a scale of 1, is linear in scale and velocities and so is
 * the closed form of L. von Stumberg et al. and others. Stations are eliminated from the oldest on
 * (a Kalman smoother in information form): what is left of the newest is its covariance. A station
 * that makes room hands what it knew on as a prior, at the values it was linearised at: so do as
 * many as may have to go until the next estimate.
 *
 * Errors of stations are taken for independent, so their sigma is to be that of what each frame
 * errs by alone, and no more. With errors on both sides, of poses and of samples, a fit is right
 * where their ratio is (W. E. Deming, "Statistical adjustment of data", 1943): poses that state too
 * much take the errors of the samples for theirs, which costs less the larger the scale is, and the
 * scale comes out too large. In simulation and on EuRoC second differences of stations, less what
 * the samples say, are correlated by -.6 to -.7 with the next; of independent errors it is -.67. A
 * station that errs by more than it states counts for less (Huber's function). While at most a
 * fourth of them do, one that errs by more than six sigmas states that from then on.
 *
 * The noise of the samples is what the configuration states or, where the sensor is shaken, what
 * they show: on EuRoC's drone forces are 30 to 50 times noisier than the data sheet says, at rest 5
 * to 9 times; a fourth of it is left in what links sum up (found on starts 7 and 15 of
 * euroc_mh05_a).
 *
 * Capacities: FV_INERTIAL_STATIONS_MAX stations, and FV_INERTIAL_SAMPLES_MAX samples between two,
 * which is .32 s at 1,000 Hz. Where samples overflow, or lack for longer than they may, the link
 * between two stations is cut: the estimate begins anew there, with the biases known so far.
 *
 * One estimate takes several units; samples and stations may come in between. State holds no
 * addresses. Real-time safe: fixed memory, each unit at most some 0.1 ms; same bits on every
 * machine. */
#ifndef FOVEA_INERTIAL_ESTIMATOR_H
#define FOVEA_INERTIAL_ESTIMATOR_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "geometry/se3.h"
#include "inertial/preintegration.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_INERTIAL_WINDOW = 96, /* stations of an estimate */
    FV_INERTIAL_ROOM = 6,    /* for those that come while one is made, which they would break off */
    FV_INERTIAL_STATIONS_MAX = FV_INERTIAL_WINDOW + FV_INERTIAL_ROOM,
    FV_INERTIAL_SAMPLES_MAX = 320,
    FV_INERTIAL_STATIONS_PER_ESTIMATE = 3, /* so many new ones make another estimate worth while */
    /* Variables of a station, by where each begins, and those of all: a tail is both. */
    FV_INERTIAL_TURN = 0,
    FV_INERTIAL_OFFSET = 3,
    FV_INERTIAL_VELOCITY = 6,
    FV_INERTIAL_SCALE = 9,
    FV_INERTIAL_ACCELERATION_BIAS = 10,
    FV_INERTIAL_DOWN = 13, /* gravity's direction: two */
    FV_INERTIAL_OWN = 15,
    FV_INERTIAL_GYRO_BIAS = FV_INERTIAL_OWN,
    FV_INERTIAL_SHARED = 3,
    FV_INERTIAL_TAIL = FV_INERTIAL_OWN + FV_INERTIAL_SHARED,
    FV_INERTIAL_PAIR = 2 * FV_INERTIAL_OWN + FV_INERTIAL_SHARED
};

/* Of the gyro's bias before anything is known, rad/s. */
#define FV_INERTIAL_GYRO_BIAS_SIGMA 0.1

struct fv_inertial_config {
    struct fv_se3 T_cam_imu;
    struct fv_imu_noise noise; /* squared densities: the least that is believed */
    double acceleration_walk;  /* squared density of the bias's walk, m^2/s^6/Hz */
    double gravity;            /* m/s^2 */
};

/* How much samples differ from those around them, lately: what shakes the sensor is noise beside
 * its own. Of three samples in a row, x0 - 2 x1 + x2 holds 6 times the variance of white noise and
 * next to nothing of the motion. */
struct fv_imu_shake {
    uint32_t count; /* samples so far, up to those that the mean is of */
    int64_t stamps_ns[2];
    double gyro[2][3], acceleration[2][3]; /* the last two samples, older first */
    double square[2];                      /* mean square of a sample's noise: gyro, acceleration */
};

/* A sample as a station keeps it. */
struct fv_inertial_sample {
    int32_t after_ns; /* the station */
    float gyro[3], acceleration[3];
};

/* Where the camera is at a station, and whose that is: the estimator keeps `of` for its caller. */
struct fv_inertial_pose {
    struct fv_se3 T_world_cam;
    double position_sigma, turn_sigma; /* of each axis: world's unit, rad */
};
struct fv_inertial_owner {
    uint64_t slot, number; /* of one size: no padding, which would be hashed */
    struct fv_se3 T_keyframe_cam;
};

/* Values of a station, and of all of them. */
struct fv_inertial_own {
    double turn[3], offset[3]; /* errors of its pose: R exp(turn), t + offset */
    double velocity[3];        /* of the sensor in world, m/s */
    double scale;              /* metres per unit */
    double acceleration_bias[3];
    double down[3]; /* unit vector, in the axes that world has there */
};
struct fv_inertial_shared {
    double gyro_bias[3];
};

struct fv_inertial_station {
    int64_t stamp_ns;
    struct fv_inertial_owner of;
    struct fv_inertial_pose pose;
    struct fv_inertial_own now;
    double live[3]; /* velocity as its caller had it then; 0: not known */
    /* To the next station. */
    struct fv_preintegration link;
    uint32_t sample_count;
    uint32_t integrated; /* intervals of the samples that are in `link` */
    bool closed;         /* no sample before the next station's instant is missing */
    bool cut;            /* there is no link */
    bool corrected;      /* the pose's sigmas are those that an estimate showed */
    /* Elimination: own block, factored; coupling to the next station and the shared; gradient. */
    double block[FV_INERTIAL_OWN * FV_INERTIAL_OWN];
    double coupling[FV_INERTIAL_OWN * FV_INERTIAL_TAIL];
    double gradient[FV_INERTIAL_OWN];
};

/* What was known of a station and the shared before the window, at values. */
struct fv_inertial_prior {
    bool known;
    double H[FV_INERTIAL_TAIL * FV_INERTIAL_TAIL], g[FV_INERTIAL_TAIL];
    struct fv_inertial_own own;
    struct fv_inertial_shared shared;
};

/* What is known at the newest station that took part. */
struct fv_inertial_estimate {
    bool known;
    uint32_t stations; /* that took part */
    int64_t stamp_ns;
    double time_s; /* between the first and the last */
    struct fv_inertial_own own;
    struct fv_inertial_shared shared;
    /* Over own (turn, offset, velocity, scale, acceleration bias, gravity's direction along
     * `across`) and shared (gyro bias), row-major, inflated by the misfit */
    double covariance[FV_INERTIAL_TAIL * FV_INERTIAL_TAIL];
    double across[2][3];
    double scale_sigma; /* relative */
    double log_scale; /* natural, of the whole way: the mean of all stations since the restart, but
                         for those before a cut */
    double gravity_sigma; /* rad, of an axis */
    /* Gravity in the mean of the same stations, a unit vector, and the variance of an axis of
     * theirs about it, rad^2: `world` is no more upright than that. */
    double mean_down[3], down_variance;
    double misfit; /* squared errors over what they should be */
};

enum fv_inertial_phase {
    FV_INERTIAL_IDLE = 0,
    FV_INERTIAL_INTEGRATE = 1,
    FV_INERTIAL_ELIMINATE = 2,
    FV_INERTIAL_BACK = 3
};

struct fv_inertial_state {
    uint32_t first, count; /* stations: a ring */
    uint32_t waiting;      /* stations that came since the last estimate began */
    enum fv_inertial_phase phase;
    uint32_t taking_part;     /* stations of this pass, from the oldest on */
    uint32_t next, iteration; /* of the pass */
    uint32_t handed; /* the last so many of `hand_on` are of this window's oldest stations */
    bool moved_far;  /* the last step did, so another is worth while */
    double square;   /* sum of the squared errors */
    uint32_t errors; /* their number less that of the variables */
    double tail[FV_INERTIAL_TAIL * FV_INERTIAL_TAIL], tail_gradient[FV_INERTIAL_TAIL];
    double solution[FV_INERTIAL_TAIL]; /* of the station after `next`, and the shared */
    struct fv_inertial_shared shared;
    double gyro_bias[3], acceleration_bias[3], down[3]; /* to begin with */
    double bias_sigma[2];                               /* gyro, acceleration */
    struct fv_inertial_prior prior, hand_on[FV_INERTIAL_ROOM];
    struct fv_inertial_estimate estimate;
    double scale_drift;        /* squared, relative, per second */
    double tilt_drift;         /* squared, rad of an axis, per second */
    double metric_sigma;       /* of a unit that is the metre, relative; 0: of any length */
    struct fv_imu_noise noise; /* that is believed now, squared densities */
    struct fv_imu_shake shake;
    /* Sums over the stations that have left the window, and their number. */
    double gone_log_scale, gone_down[3];
    uint64_t gone;
    uint64_t cuts, overflows; /* links cut, and by too many samples */
    int64_t last_sample_ns;
    bool any_sample;
    struct fv_inertial_sample last_sample;
};

struct fv_inertial {
    struct fv_inertial_config config;
    struct fv_inertial_state *state;
    struct fv_inertial_station *stations; /* FV_INERTIAL_STATIONS_MAX */
    struct fv_inertial_sample *samples;   /* FV_INERTIAL_SAMPLES_MAX of each station */
};

void fv_inertial_carve(struct fv_inertial *inertial, const struct fv_inertial_config *config,
                       struct fv_arena *persistent);
void fv_inertial_init(struct fv_inertial *inertial);

/* Forget the stations; the biases stay known as well as they are. The unit of `world` is the metre
 * to `metric_sigma`, relative (0: of any length), and drifts by `scale_drift`: squared, relative,
 * per second. Its axes tilt by `tilt_drift`: squared, rad of an axis, per second. */
void fv_inertial_restart(struct fv_inertial *inertial, double metric_sigma, double scale_drift,
                         double tilt_drift);

/* Whether an estimate before the last restart left biases (gyro_bias and those after it). */
static inline bool fv_inertial_biases_kept(const struct fv_inertial *inertial)
{
    return inertial->state->bias_sigma[0] < FV_INERTIAL_GYRO_BIAS_SIGMA;
}

/* A sample by the camera's clock; one that is not after the last is left out. */
void fv_inertial_take(struct fv_inertial *inertial, int64_t stamp_ns, const double gyro[3],
                      const double acceleration[3]);

/* The clock of the samples leapt: nothing from before continues. */
void fv_inertial_jump(struct fv_inertial *inertial);

/* A station at an instant after the last. With each third a new estimate is wanted. */
void fv_inertial_add_station(struct fv_inertial *inertial, int64_t stamp_ns,
                             const struct fv_inertial_owner *of,
                             const struct fv_inertial_pose *pose);

/* The stations, oldest first, so that the caller can give them better poses while
 * !fv_inertial_busy. */
uint32_t fv_inertial_station_count(const struct fv_inertial *inertial);
struct fv_inertial_station *fv_inertial_station_at(const struct fv_inertial *inertial, uint32_t i);

/* A new estimate waits to be begun; one is under way. */
bool fv_inertial_wanted(const struct fv_inertial *inertial);
bool fv_inertial_busy(const struct fv_inertial *inertial);
void fv_inertial_begin(struct fv_inertial *inertial);
/* One unit; true when units are left. */
bool fv_inertial_unit(struct fv_inertial *inertial);

static inline const struct fv_inertial_estimate *
fv_inertial_result(const struct fv_inertial *inertial)
{
    return &inertial->state->estimate;
}

/* ---- between the files of the room ----------------------------------------------------------- */

/* Eliminate station `i` of the pass: its errors and its link to the next go into the tail. False:
 * singular. */
bool fv_inertial_eliminate(struct fv_inertial *inertial, uint32_t i);
/* The newest station and the shared: solve the tail, and its inverse is the covariance. */
bool fv_inertial_solve_tail(struct fv_inertial *inertial);
/* Move a station by its step, once that after it has moved. */
void fv_inertial_step_back(struct fv_inertial *inertial, uint32_t i);
/* Two directions at right angles to a unit vector. */
void fv_inertial_across(const double down[3], double across[2][3]);

#ifdef __cplusplus
}
#endif
#endif
