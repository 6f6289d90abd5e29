/* Which samples of the inertial sensor the estimator gets: clean ones alone, with strictly rising
 * stamps, and where samples are lacking before one, it says so.
 *
 * A sample is refused that is a repetition of the last one, not after it, not finite or absurd, at
 * the end of an axis' range, frozen, or off the frames' clock. Rules:
 *
 * - Saturated: |value| reaches the range that the rig states, but for a thousandth, or an end below
 *   it: the largest value so far that comes four times in succession, beyond 2 rad/s or 15 m/s^2,
 *   is taken for the end of the range until a larger one comes.
 * - Frozen: all six values are the same over at least 10 samples and 0.1 s. Judged only where the
 *   rig states a noise density, since a sensor without noise that stands gives the same values.
 * - Off the clock: the stamp, with the rig's time offset, is over 1 s after this step's time or
 *   before that of the last step; or it leaps ahead by over 0.1 s more than the time that passed.
 * - A clock that leaps by less than 1 s is followed once 20 samples in succession agree on it, and
 *   none has been taken for a quarter of a second: `FV_IMU_AFTER_JUMP` marks the first.
 * - Missing: by the nominal rate, or the observed one where none is stated; the count follows the
 *   mean of the stamps, so that jitter of stamps is not taken for loss.
 *
 * State holds no addresses and no padding: copied, hashed and replayed as bytes. Real-time safe:
 * constant time per sample, no heap. */
#ifndef FOVEA_INERTIAL_GATE_H
#define FOVEA_INERTIAL_GATE_H

#include "base/arena.h"
#include "fovea/rig.h"
#include "fovea/sensor.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a clean sample comes after, as bits. */
enum fv_imu_note {
    /* samples are lacking since the clean one before: lost, or refused */
    FV_IMU_AFTER_GAP = 1,
    /* nothing before continues in it: its clock leapt (back or ahead), or it is the first of all */
    FV_IMU_AFTER_JUMP = 2
};

struct fv_imu_clean {
    struct fovea_imu_sample sample; /* on the sensor's clock and uncorrected, as it came */
    uint32_t notes;                 /* enum fv_imu_note bits */
    uint32_t lacking;               /* samples between it and the clean one before */
};

/* Stamps are on the frames' clock. */
struct fv_imu_gate_state {
    struct fovea_imu_counts counts;
    double values[6]; /* of the last sample that came in order */
    double peak[2];   /* largest magnitude of gyro and acceleration so far */
    double level[2];  /* end of the range, as learned; 0: not */
    double lossy;     /* share of intervals with samples missing, lately */
    double period_ns; /* observed; 0: not yet */
    double behind_ns; /* how far the stamps are behind the rate, since the last that was missing */
    int64_t seen_ns;  /* of the last sample that came in order */
    int64_t clean_ns; /* of the last clean one */
    int64_t seen_now_ns;   /* time of the step with the last one in order */
    int64_t heard_now_ns;  /* likewise with any */
    int64_t same_since_ns; /* since when all values are the same */
    int64_t other_ns;      /* of the last sample in a run that is not in order */
    int64_t step_ns;       /* time of the last step */
    uint32_t same;         /* samples in succession with the same values */
    uint32_t axis_same[6]; /* likewise by axis, beyond the peak before */
    uint32_t others;       /* samples of that run */
    uint32_t lacking;      /* samples since the last clean one: missing, or refused in order */
    uint32_t verdict;      /* enum fovea_imu_state of the last sample in order */
    uint32_t intervals;    /* that period_ns is the mean of */
    uint32_t told;         /* the runtime's: enum fovea_imu_state that was sent last */
    uint32_t any_step, any_heard, any_seen, any_clean;
};

struct fv_imu_gate {
    struct fovea_rig_imu rig;
    struct fv_imu_gate_state *state;
    struct fv_imu_clean *clean; /* of this step, FOVEA_INPUT_SAMPLES_MAX */
    uint32_t count;
};

void fv_imu_gate_carve(struct fv_imu_gate *gate, const struct fovea_rig_imu *rig,
                       struct fv_arena *persistent, struct fv_arena *frame);

/* Judge the inertial samples of a step, which may stand in any order among other kinds. `now_ns`:
 * time of the step on the frames' clock. The clean ones are gate->clean[0 .. count - 1] until the
 * next step. */
void fv_imu_gate_step(struct fv_imu_gate *gate, const struct fovea_sample *samples, uint32_t count,
                      int64_t now_ns);

/* As of the last step. */
void fv_imu_gate_status(const struct fv_imu_gate *gate, struct fovea_imu_status *status);

#ifdef __cplusplus
}
#endif
#endif
