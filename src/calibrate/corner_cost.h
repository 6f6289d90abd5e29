/* One corner of a board in one picture as Ceres takes it: predicted less found, in pixels, with
 * derivatives written out. Automatic ones took half of the time of a solve. Needs Ceres: of the
 * files that solve alone. */
#ifndef FOVEA_CALIBRATE_CORNER_COST_H
#define FOVEA_CALIBRATE_CORNER_COST_H

#include <Eigen/Dense>

#include "calibrate/projection.h"

namespace calibrate
{

/* Of a pixel, by the camera's parameters and by the point in its frame. */
struct ProjectionDerivatives {
    Eigen::Matrix<double, 2, PARAMETERS_MAX, Eigen::RowMajor> by_camera;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
};

/* As `project`, with derivatives. */
bool project_derivatives(Model model, const double *camera, const double *point, double *pixel,
                         ProjectionDerivatives &derivatives);

/* A corner of a board whose height at (x, y) of [-1, 1] is bend[0] (1 - x^2) + bend[1] (1 - y^2)
 * metres. Blocks: camera, pose T_cam_board, bend. */
struct Corner {
    Model model;
    Point point;
    double x, y;
    Pixel found;

    /* False: behind the camera. */
    bool residual(const double *camera, const double *pose, const double *bend, double *out) const;
};

class CornerCost final : public ceres::SizedCostFunction<2, PARAMETERS_MAX, 6, 2>
{
  public:
    explicit CornerCost(const Corner &of) : corner(of)
    {
    }
    bool Evaluate(const double *const *blocks, double *residuals,
                  double **jacobians) const override;

  private:
    Corner corner;
};

/* A corner in one camera of a rig. Blocks: camera, T_cam_first, T_first_board. */
struct RigCorner {
    Model model;
    Point point;
    Pixel found;

    bool residual(const double *camera, const double *T_cam_first, const double *T_first_board,
                  double *out) const;
};

class RigCornerCost final : public ceres::SizedCostFunction<2, PARAMETERS_MAX, 6, 6>
{
  public:
    explicit RigCornerCost(const RigCorner &of) : corner(of)
    {
    }
    bool Evaluate(const double *const *blocks, double *residuals,
                  double **jacobians) const override;

  private:
    RigCorner corner;
};

} // namespace calibrate
#endif
