/* The noise of an inertial sensor from a log in which it stands still, by its Allan variance.
 *
 * IEEE Std 952-1997, annex C: white noise of density N gives a variance of N^2 / tau, bias
 * instability B a floor of B^2 2 ln 2 / pi, a random walk K of the bias K^2 tau / 3. The
 * overlapping estimate of the variance at times that double is fitted by the sum of the three, none
 * below zero. */
#ifndef FOVEA_CALIBRATE_ALLAN_H
#define FOVEA_CALIBRATE_ALLAN_H

#include "calibrate/verdict.h"
#include "fovea/sensor.h"

namespace calibrate
{

struct AllanPoint {
    double tau_s, variance;
    double freedom; /* degrees of freedom of the estimate */
};

struct AllanFit {
    std::vector<AllanPoint> points;
    double white = 0, white_stdev = 0;   /* N, unit / sqrt(Hz) */
    double floor = 0;                    /* B, unit */
    double walk = 0, walk_stdev = 0;     /* K, unit / s / sqrt(Hz); 0: not seen */
    double walk_most = 0;                /* two standard deviations above what was seen */
    double variance(double tau_s) const; /* of the fit */
};

enum { GYRO, ACCELERATION, IMU_PARTS };

struct ImuNoise {
    double rate_hz = 0, duration_s = 0;
    size_t samples = 0, gaps = 0; /* gaps: more than half a period too late */
    std::array<AllanFit, 6> axes; /* gyro x y z, acceleration x y z */
    /* Root mean square of the axes. */
    std::array<double, IMU_PARTS> white = {}, white_stdev = {}, walk = {}, walk_stdev = {},
                                  walk_most = {};
    double specific_force = 0; /* length of the mean acceleration, m/s^2 */
    double moved_at_s = -1;    /* where it moved most; negative: it stood */
};

/* False, with a line: too few samples to say anything. */
bool measure_imu(const std::vector<fovea_imu_sample> &samples, ImuNoise &noise, std::string &error);

Verdict judge_imu(const ImuNoise &noise);

} // namespace calibrate
#endif
