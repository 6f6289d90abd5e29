/* Residuals of a motion by a spline (spline.h) as Ceres takes them, with derivatives written out:
 * the corners of a picture, and the samples of an inertial sensor between two knots. Needs Ceres.
 *
 * The world is a frame in which the board stands still; T_world_imu is the spline's. */
#ifndef FOVEA_CALIBRATE_INERTIAL_COST_H
#define FOVEA_CALIBRATE_INERTIAL_COST_H

#include "calibrate/projection.h"
#include "calibrate/rigid.h"
#include "calibrate/spline.h"

namespace calibrate
{

/* T_world_imu and its derivatives by time. */
struct Motion {
    Eigen::Vector3d turn, turn_rate; /* the angle-axis vector */
    Eigen::Vector3d place, speed, acceleration;
    Eigen::Matrix3d R; /* R_world_imu */
    Eigen::Matrix3d J; /* right Jacobian: turn_rate to angular rate in the sensor's frame */
};

/* Of control points from `control[0]` on. */
Motion motion_of(const double *const *control, const SplineWeights &weights);

/* Blocks: the control points on which a picture may depend when its time moves by less than a step,
 * the pose T_cam_imu of the first camera, the clock (time shift in seconds, drift). */
class PictureCost final : public ceres::CostFunction
{
  public:
    enum { CONTROLS = SPLINE_ORDER + 2, BLOCKS = CONTROLS + 2 };
    struct Corner {
        Eigen::Vector3d point; /* in the world */
        Pixel found;
    };
    struct Camera {
        Model model;
        Parameters parameters;
        Rigid T_cam_first;
        double readout_s, height;
    };
    /* `time_s` of the picture's stamp; `middle_s` is where the drift counts from. The first control
     * point is `first`, as `shift_s` says. */
    PictureCost(const Spline &spline, const Camera &camera, std::vector<Corner> corners,
                double time_s, double middle_s, double shift_s, double sigma_px);

    int first() const
    {
        return first_;
    }
    size_t corner_count() const
    {
        return corners_.size();
    }
    bool Evaluate(const double *const *blocks, double *residuals,
                  double **jacobians) const override;

  private:
    bool evaluate_corner(const double *const *blocks, const Corner &corner, double *residuals,
                         double **jacobians, size_t row) const;

    double begin_s_, step_s_;
    Camera camera_;
    std::vector<Corner> corners_;
    double time_s_, middle_s_, weight_;
    int first_;
};

/* A sample: rates, accelerations; the weight of each, 0: not used. */
struct Reading {
    double time_s;
    Eigen::Vector3d gyro, acceleration;
    double weights[2];
};

/* Samples between two knots. Blocks: the control points, the biases (gyro, then accelerometer) at
 * the begin and at the end of the stretch that it lies in, gravity. */
class ReadingsCost final : public ceres::CostFunction
{
  public:
    enum { BLOCKS = SPLINE_ORDER + 3 };
    ReadingsCost(const Spline &spline, int segment, double bias_begin_s, double bias_step_s,
                 std::vector<Reading> readings);

    int segment() const
    {
        return segment_;
    }
    const std::vector<Reading> &readings() const
    {
        return readings_;
    }
    bool Evaluate(const double *const *blocks, double *residuals,
                  double **jacobians) const override;

  private:
    double step_s_, bias_begin_s_, bias_step_s_;
    int segment_;
    std::vector<Reading> readings_;
    std::vector<SplineWeights> weights_;
};

} // namespace calibrate
#endif
