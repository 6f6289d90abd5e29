/* A rig: the cameras and the inertial sensor that are fixed to one body.
 *
 * A source describes its rig; one camera alone is the rig with one. Frames hold one image per
 * camera, in the rig's order, taken at one stamp (fovea/source.h). Odometry uses the first
 * camera, and the second where both are calibrated and placed (odometry.sensors).
 *
 * T_body_cam takes points of a camera's frame to the body's frame. Body frames follow REP-103
 * (x forward, y left, z up), unless the source's documentation says otherwise: `euroc:` applies no
 * rotation, so that its body is that of the data set, the frame of the inertial sensor (x up); that
 * of `kitti:` is the frame of the first grey camera. */
#ifndef FOVEA_RIG_H
#define FOVEA_RIG_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/camera.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FOVEA_CAMERAS_MAX = 4 };

struct fovea_rig_camera {
    /* `camera` is known, prepared by fovea_camera_prepare; false: at most its width and height are,
     * those of the images */
    bool calibrated;
    bool has_T_body_cam;
    bool has_readout; /* `readout_ns` is known */
    struct fovea_camera camera;
    /* nanoseconds from the exposure of the first row to that of the last; 0: global shutter */
    int64_t readout_ns;
    /* row-major 3x4, metres; where has_T_body_cam; of the first camera of a configuration default
     * identity */
    double T_body_cam[12];
    /* Pixels that this camera never sees the world in: camera.width x camera.height bytes, 0 where
     * features are ignored; NULL: none. Owned by whoever made the rig. */
    const uint8_t *mask;
};

/* Noise as datasheets and Kalibr state it: densities of white noise on the samples, and of the
 * random walk of their biases. 0: not stated. */
struct fovea_rig_imu {
    double T_body_imu[12]; /* row-major 3x4: points of the sensor's frame to the body's, metres */
    double rate_hz;        /* nominal; 0: not known */
    double gyro_noise;     /* rad/s/sqrt(Hz) */
    double gyro_walk;      /* rad/s^2/sqrt(Hz) */
    double acceleration_noise; /* m/s^2/sqrt(Hz) */
    double acceleration_walk;  /* m/s^3/sqrt(Hz) */
    double gyro_range;         /* largest rate that an axis can report, rad/s; 0: not known */
    double acceleration_range; /* likewise, m/s^2 */
    /* Row-major 3x4: take a measured sample (and 1) to the true one, both in the sensor's frame:
     * scale, misalignment and constant bias. All 0: not stated. */
    double gyro_correction[12], acceleration_correction[12];
    int64_t time_offset_ns; /* add to a sample's stamp for the cameras' clock */
};

struct fovea_rig {
    uint32_t camera_count; /* 1 to FOVEA_CAMERAS_MAX */
    bool has_imu;
    struct fovea_rig_camera cameras[FOVEA_CAMERAS_MAX];
    struct fovea_rig_imu imu; /* of a rig that has one */
};

#ifdef __cplusplus
}
#endif
#endif
