/* Standing still: pictures and samples both say so, so the velocity is 0 (a zero-velocity update,
 * as of I. Skog, P. Handel, J.-O. Nilsson, J. Rantakokko, "Zero-velocity detection - an algorithm
 * evaluation", IEEE T-BME 2010: what samples vary by, over a window).
 *
 * Samples are *quiet* while over two blocks of 0.25 s they vary by no more than 1.6 times the noise
 * that is stated, and their means stay the same; one sample far from that ends it at once. A cruise
 * at constant velocity is quiet too, so it takes pictures besides: poses that for 0.5 s stay
 * within 2 mrad of the distance of what is seen, and of a turn, of pictures that are of use
 * (odometry/usable.h). A picture that sticks in the middle of a way shows the same, so no way ends
 * without a force: since the last frame before which a velocity was known, samples must have
 * stirred. A cruise of less than 3 cm/s and two sigmas of the velocity is not told from standing
 * then.
 *
 * Once it stands, quiet samples alone are enough to say that it still does, where no picture comes:
 * nothing begins to move without a force. State holds no addresses. Real-time safe; constant time
 * per call. */
#ifndef FOVEA_INERTIAL_STILL_H
#define FOVEA_INERTIAL_STILL_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/se3.h"
#include "inertial/reading.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_imu_still {
    /* samples: gyro, then acceleration */
    int64_t block_ns, last_ns; /* where the block began; the last sample */
    double sum[6], square[6];  /* of its differences from `mean` */
    double mean[6];            /* of the block before */
    uint64_t count, blocks;    /* samples of the block; quiet blocks in succession */
    /* pictures */
    struct fv_se3 anchor;        /* where the pose has stayed */
    int64_t since_ns;            /* since when */
    int64_t fast_ns, stirred_ns; /* the last frame with a velocity; the last sample not quiet */
    bool anchored;
    bool standing;
};

/* Standard deviations of a sample by its stated noise. */
struct fv_imu_still_noise {
    double gyro, acceleration;
};

struct fv_imu_still_seen {
    int64_t stamp_ns;
    struct fv_se3 T_world_cam;       /* in any unit: that of the metres is still being found */
    double depth;                    /* of what is seen, in the same */
    double velocity, velocity_sigma; /* before this frame; m/s */
    bool of_use;                     /* the picture is */
};

void fv_imu_still_init(struct fv_imu_still *still);
/* A sample, corrected. */
void fv_imu_still_take(struct fv_imu_still *still, const struct fv_imu_still_noise *noise,
                       const struct fv_imu_reading *sample);
/* A frame with a pose, whose velocity before it is known. */
void fv_imu_still_see(struct fv_imu_still *still, const struct fv_imu_still_seen *seen);
/* Another world, or the velocity is not known: nothing stands. */
void fv_imu_still_forget(struct fv_imu_still *still);

#ifdef __cplusplus
}
#endif
#endif
