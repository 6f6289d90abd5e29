/* Calibration files: reading and writing the formats that the field uses.
 *
 *  - ROS camera_info YAML, as camera_calibration writes it (camera_matrix, distortion_coefficients,
 *    ...) and as `ros2 topic echo` prints it (K, D or k, d); also the camera.yaml beside recordings
 *    in TUM layout;
 *  - OpenCV FileStorage YAML, as its calibration programs write it (camera_matrix or cameraMatrix
 *    or K with distortion_coefficients or distCoeffs or D; image_width, image_height;
 *    fisheye_model);
 *  - Kalibr camchain (cam0, cam1, ...) with pinhole projection, also as fovea-calibrate writes
 * rigs;
 *  - EuRoC/ASL sensor.yaml;
 *  - ORB-SLAM3 settings (Camera1.fx, ...; the older Camera.fx, ...), PinHole, KannalaBrandt8 and
 *    Rectified;
 *  - Basalt calibration JSON (value0), cameras pinhole, pinhole-radtan8 and kb4;
 *  - PhotonVision's JSON of one camera at one resolution (cameraIntrinsics, distCoeffs).
 * The format is found from the keys; keys that are not needed are ignored. Lens models:
 * FOVEA_LENS_RADTAN for plumb_bob, rational_polynomial, radtan and radial-tangential,
 * FOVEA_LENS_EQUIDISTANT for equidistant, equi and fisheye. What struct fovea_camera cannot hold
 * (skew, thin prism and tilt terms, omnidirectional models, binning) is refused unless it is zero.
 * Every error is one line with file, line, key, found and expected. Of the drivers and the command,
 * which need libyaml: not in the library, and not installed. */
#ifndef FOVEA_SUPPORT_CALIBRATION_H
#define FOVEA_SUPPORT_CALIBRATION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/camera.h"
#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fv_calibration_format {
    FV_CALIBRATION_ROS = 0,         /* camera_matrix, distortion_coefficients */
    FV_CALIBRATION_ROS_MESSAGE = 1, /* K, D, R, P */
    FV_CALIBRATION_OPENCV = 2,
    FV_CALIBRATION_KALIBR = 3,
    FV_CALIBRATION_EUROC = 4,
    FV_CALIBRATION_ORBSLAM3 = 5,
    FV_CALIBRATION_BASALT = 6,
    FV_CALIBRATION_PHOTONVISION = 7,
    FV_CALIBRATION_FORMAT_COUNT
};

/* How a calibration was made and how good it is, as fovea-calibrate states it. A mapping
 * `calibration` beside the keys that other programs read; they ignore it. Empty texts and zeros:
 * not stated. */
struct fv_calibration_record {
    char program[64];    /* "fovea-calibrate 0.2.0"; empty: there is no record */
    char date[32];       /* ISO 8601, UTC */
    char verdict[16];    /* pass or doubtful */
    char camera_id[128]; /* the source of the pictures: "v4l2:/dev/v4l/by-id/..." */
    char board[64];      /* as fovea-calibrate takes it */
    int32_t views, corners;
    double rms_px, noise_px; /* 2-D RMS as OpenCV's; deviation of one coordinate */
    double held_out_rms_px, projection_stdev_px;
    /* Of the camera's place in its rig: a small rotation about the camera's axes (radians), its
     * translation (metres). */
    double place_stdev[6];
    double time_shift_stdev_s;                 /* of time_shift_s */
    double stdev[4 + FOVEA_LENS_COEFFICIENTS]; /* of fx fy cx cy k...; 0: held, or not stated */
};

struct fv_calibration {
    struct fovea_camera camera;        /* prepared; 0 x 0 where the file does not state the size */
    enum fv_calibration_format format; /* as found by reading; ignored by writing */
    char name[64]; /* camera_name, or the key of a camchain ("cam0"); "" where not stated */
    bool has_T_body_cam;
    double T_body_cam[12]; /* row-major 3x4: camera points to the body or IMU frame, metres */
    double rate_hz;        /* 0: not stated */
    bool has_time_shift;
    double time_shift_s; /* added to a camera stamp it gives the stamp of the IMU, as in Kalibr */
    struct fv_calibration_record record;
};

enum { FV_CALIBRATION_BYTES_MAX = 8192 }; /* of a file that is written */

/* Name of a format: ros, ros-message, opencv, kalibr, euroc, orb-slam3, basalt, photonvision. NULL
 * out of range. */
const char *fv_calibration_format_name(enum fv_calibration_format format);

/* Name of parameter `index` of a lens in the order fx fy cx cy k...: "k1", "p1"; NULL past the
 * last. */
const char *fv_calibration_parameter_name(enum fovea_lens lens, int index);

/* Read a calibration file, or text that errors call `name`. `which` chooses the camera of a file
 * with several (Kalibr, ORB-SLAM3, Basalt): "cam1" is the second; NULL takes the first.
 * FOVEA_ERROR_INPUT: malformed; FOVEA_ERROR_UNSUPPORTED: a model that Fovea does not have.
 * Init-only. */
enum fovea_status fv_calibration_read(const char *path, const char *which,
                                      struct fv_calibration *calibration,
                                      struct fovea_error *error);
enum fovea_status fv_calibration_parse(const char *name, const char *text, size_t bytes,
                                       const char *which, struct fv_calibration *calibration,
                                       struct fovea_error *error);

/* As fv_calibration_read. A calibration without the camera `which` is FOVEA_OK with `*found` false.
 * Init-only. */
enum fovea_status fv_calibration_read_if_there(const char *path, const char *which,
                                               struct fv_calibration *calibration, bool *found,
                                               struct fovea_error *error);

/* Write a calibration. Numbers keep all their bits, so reading the file again gives the same
 * camera. A camera that the format cannot hold (k3 to k6 in Kalibr and EuRoC files, k4 to k6 in
 * ORB-SLAM3's, a fisheye in PhotonVision's; a size that is not stated) is refused with
 * FOVEA_ERROR_UNSUPPORTED and a line that names what would be lost. What else the format has no
 * place for (T_body_cam, rate, time shift) is named in `lost` (which may be NULL): "" when nothing
 * is. Name and record go into a mapping `calibration` where the format has no other place; a ROS
 * message (ros-message) may hold no further keys. A Basalt file must state T_imu_cam: the identity
 * stands for one that is not known, and its time shift is in whole nanoseconds. A file is replaced
 * as a whole or not at all; a device or pipe is written to. Init-only. */
enum fovea_status fv_calibration_write(const char *path, enum fv_calibration_format format,
                                       const struct fv_calibration *calibration,
                                       struct fovea_error *lost, struct fovea_error *error);
enum fovea_status fv_calibration_format_text(enum fv_calibration_format format,
                                             const struct fv_calibration *calibration,
                                             char text[FV_CALIBRATION_BYTES_MAX],
                                             struct fovea_error *lost, struct fovea_error *error);

/* The cameras of a rig as a camchain, cam0 on; all have a T_body_cam. T_cn_cnm1 leads from each to
 * the next; where the body is the inertial sensor (`of_imu`), T_cam_imu is stated too. `kalibr`: as
 * Kalibr reads it, which refuses k3 to k6 as above; else distortion_coeffs lists as many as the
 * lens has. Reading cam1 and on gives the T_body_cam of T_cam_imu; where that is not stated, the
 * place before the first camera, which is then the body. Init-only. */
enum { FV_CALIBRATION_CHAIN_BYTES_MAX = 4 * FV_CALIBRATION_BYTES_MAX }; /* FOVEA_CAMERAS_MAX */
enum fovea_status fv_calibration_chain_text(const struct fv_calibration *cameras, size_t count,
                                            bool of_imu, bool kalibr,
                                            char text[FV_CALIBRATION_CHAIN_BYTES_MAX],
                                            struct fovea_error *error);

/* Make a camera fit frames of width x height, and prepare it. A size that is not stated becomes the
 * frames'. Another size is refused (FOVEA_ERROR_INPUT), or, when `scale` is set and the shape
 * agrees to a pixel, the focal lengths and the centre are scaled, pixel centres staying whole
 * numbers. `origin` names the calibration in errors. Init-only. */
enum fovea_status fv_calibration_fit(struct fovea_camera *camera, int32_t width, int32_t height,
                                     bool scale, const char *origin, struct fovea_error *error);

/* Whether the left 3 x 3 of a transform of 3 x 4, row by row, is a rotation: orthonormal to 1e-3,
 * right-handed. */
bool fv_calibration_is_rotation(const double T[12]);

#ifdef __cplusplus
}
#endif
#endif
