/* Cameras to an inertial sensor, from pictures and samples while both are moved before a board that
 * stands still: rotation, translation, time offset, biases, gravity.
 *
 * The motion of the sensor is a B-spline over time, which is fitted together with them to the
 * corners of the board at the time of each picture plus the offset, to the angular rates and to the
 * accelerations, each weighed by its noise (P. Furgale, J. Rehder, R. Siegwart, Unified temporal
 * and spatial calibration for multi-sensor systems, IROS 2013). The lenses and the cameras' places
 * to each other are known. */
#ifndef FOVEA_CALIBRATE_INERTIAL_H
#define FOVEA_CALIBRATE_INERTIAL_H

#include "calibrate/rigid.h"
#include "calibrate/verdict.h"
#include "fovea/rig.h"
#include "fovea/sensor.h"

namespace calibrate
{

struct InertialCamera {
    fovea_camera camera = {}; /* prepared */
    Rigid T_cam_first;
    double readout_s = 0;    /* from the first row to the last; a stamp is that of the middle row */
    std::vector<View> views; /* with stamps, in their order */
};

struct InertialInput {
    Board board;
    std::vector<InertialCamera> cameras;
    std::vector<fovea_imu_sample> samples; /* in the order of their stamps */
    fovea_rig_imu imu = {}; /* rate, densities, ranges; its place and offset are not read */
};

/* Of angular rates and accelerations, in this order. */
enum { INERTIAL_PARTS = 2 };

struct InertialSolution {
    Rigid T_cam_imu; /* of the first camera */
    /* Of the camera's place on the sensor, T_imu_cam: of a small rotation about the camera's own
     * axes (radians), of its centre (metres). */
    Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
    std::array<double, 6> stdev = {};
    double time_shift_s = 0; /* added to the stamp of a picture it gives that of the sensor */
    double time_shift_stdev_s = 0;
    /* How much faster the sensor's clock runs than the cameras', where that is let free. */
    double clock_drift = NAN, clock_drift_stdev = NAN;
    Eigen::Vector3d gravity_m_s2 = Eigen::Vector3d::Zero(); /* in the board's frame, down */
    double gravity_stdev_rad = 0;
    double bias[INERTIAL_PARTS][3] = {}, bias_stdev[INERTIAL_PARTS][3] = {}; /* half-way */
    double noise_px = 0;                /* of one coordinate of the corners */
    double alone_px = 0;                /* of the same corners, each picture posed by itself */
    double excess[INERTIAL_PARTS] = {}; /* residuals over what the densities state */
    double knots_hz = 0;
    /* Of the rotation: rms of the rates about the two axes of most of it, rad/s. Of accelerations:
     * rms without gravity, m/s^2. */
    double turn_rad_s[2] = {}, acceleration_m_s2 = 0;
    double fits = 0; /* share of the pictures' rotation that the angular rates explain, at most 1 */
    double rate_ratio = 0; /* rates of the sensor over those of the pictures: 1 */
    double duration_s = 0; /* of the pictures that are used */
    int views_used = 0, views_with_board = 0, corners_used = 0;
    int samples_used = 0, saturated[INERTIAL_PARTS] = {}, missing = 0; /* samples */
    std::vector<std::vector<std::string>> left_out; /* per camera and view: why, or empty */
};

/* False, with a line: too few pictures or samples, clocks that do not meet, or nothing fits. */
bool solve_inertial(const InertialInput &input, InertialSolution &solution, std::string &error);

/* Six standard deviations of the place on the sensor of another camera, whose place before the
 * first one is known to `T_first_cam_stdev` (both as RigCamera::stdev). */
std::array<double, 6> place_stdev(const InertialSolution &solution, const Rigid &T_first_cam,
                                  const std::array<double, 6> &T_first_cam_stdev);

Verdict judge_inertial(const InertialSolution &solution);

} // namespace calibrate
#endif
