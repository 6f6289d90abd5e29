/* What the parts of fovea-calibrate share: boards, views, models and solutions. Nothing of OpenCV
 * or Ceres stands here, so that few files need their headers.
 *
 * A view is one picture of the board. Pixels are Fovea's: (0, 0) is the centre of the top left
 * pixel. Board points are in metres, z = 0 on a flat board, x along the rows of corners. */
#ifndef FOVEA_CALIBRATE_CALIBRATE_H
#define FOVEA_CALIBRATE_CALIBRATE_H

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "fovea/camera.h"

namespace calibrate
{

using Pixel = std::array<double, 2>;
using Point = std::array<double, 3>;
/* Board to camera: angle-axis (radians), then translation (metres). */
using Pose = std::array<double, 6>;

enum class Pattern { chessboard, charuco, aprilgrid, circles, asymmetric_circles };

/* A flat target with points in rows. What is counted and measured is what the makers of each kind
 * state of it. */
struct Board {
    /* Of a chessboard the inner corners, of a ChArUco board the squares, of an AprilGrid the tags,
     * of circles the circles (of an asymmetric grid: those of a row, and the rows). */
    int columns = 0, rows = 0;
    /* Side of a square or of a tag; from circle to circle (asymmetric: from row to row). */
    double square_m = 0;
    Pattern pattern = Pattern::chessboard;
    double marker_m = 0;      /* charuco: side of a marker; aprilgrid: gap between two tags */
    int dictionary = 0;       /* charuco: number of its dictionary, see dictionary_name */
    bool white_first = false; /* charuco: the first square of the first row is white */

    int point_columns() const;
    int point_rows() const;
    std::vector<Point> points() const; /* row by row, from (0, 0, 0) on */
    std::string text() const;          /* as board_parse takes it */
};

/* Names of dictionaries of markers, as 4x4_50; nullptr past the last one. */
const char *dictionary_name(int dictionary);

/* chessboard:9x6:0.025 and the like. False, with a line, for anything else. */
bool board_parse(const std::string &text, Board &board, std::string &error);

/* The forms that board_parse takes, for help texts. */
extern const char board_forms[];

/* A picture made smaller, for the report: each pixel is the mean of `reduction` x `reduction`. */
struct Thumbnail {
    int width = 0, height = 0, reduction = 1; /* width 0: there is none */
    std::vector<uint8_t> grey;
};

struct View {
    std::string name;           /* file or frame number */
    int64_t stamp_ns = -1;      /* negative: not known */
    std::vector<Pixel> corners; /* as Board::points, NaN: not seen; empty: no board was found */
    double edge_px = 0;         /* 10 to 90 % width of its edges; a blurred picture has wide ones */
    std::string left_out;       /* why it is not used; empty: it is used */
    std::string note;           /* what the user should know of its board; mostly empty */
    int width = 0, height = 0;  /* of its picture; 0: not known */
    /* Chessboards: the inner corners that the picture shows where --target states others; else 0.
     */
    int shown_columns = 0, shown_rows = 0;
    bool mirrored = false; /* its markers are found when the picture is flipped */
    Thumbnail thumbnail;
};

/* Whether a point of the board was seen in a view. */
inline bool seen(const Pixel &corner)
{
    return std::isfinite(corner[0]);
}

enum class Model { radtan, rational, equidistant };
const char *model_name(Model model);

enum { PARAMETERS_MAX = 4 + FOVEA_LENS_COEFFICIENTS };
/* Names in the order of parameters: fx fy cx cy, then the coefficients of fovea_camera::k. */
const char *parameter_name(Model model, int parameter);
int coefficient_count(Model model); /* 5, 8 or 4 */

struct SolveOptions {
    Model model = Model::radtan;
    bool equal_focal = false;       /* fx = fy */
    bool four_coefficients = false; /* radtan: k3 = 0, as Kalibr's files hold it */
    bool reject = true;             /* leave outlying corners and views out */
    bool bend = false;              /* estimate how the board is bent (two parameters) */
};

struct LeftOut { /* a corner */
    int view, corner;
    double error_px;
};

/* Standard deviation of projection in its worst direction, at infinity; NaN where the model has no
 * ray. Cells of a grid over the image, row by row, taken at their centres. */
struct Uncertainty {
    int columns = 0, rows = 0;
    std::vector<double> stdev_px;
};

struct Solution {
    Model model = Model::radtan;
    fovea_camera camera = {}; /* not prepared */
    std::vector<Pose> poses;  /* of all views; of those left out, the last that was tried */
    std::array<double, 2> bend_m = {0, 0}; /* height of the middle above the edges, along x and y */
    std::vector<std::string> left_out;     /* per view: why, or empty */
    std::vector<LeftOut> corners_left_out; /* of views that are used */
    std::vector<std::vector<double>> errors_px; /* per view and corner, 2-D; of all views posed */
    /* Predicted less found, of the views that are used; NaN for corners that are left out. */
    std::vector<std::vector<Pixel>> residuals_px;
    int corners_used = 0;
    double rms_px = 0;   /* 2-D, as OpenCV: sqrt of the mean squared distance */
    double noise_px = 0; /* of one coordinate: residuals over degrees of freedom */
    std::array<double, PARAMETERS_MAX> stdev = {}; /* of fx fy cx cy k...; 0: held */
    /* Of fx fy cx cy k..., PARAMETERS_MAX squared, row by row. */
    std::vector<double> covariance;
    Uncertainty uncertainty;
    Uncertainty uncertainty_fine; /* the same in smaller cells, for a picture */
};

/* Camera and poses from nothing but the pictures. `views` with corners and no reason to be left out
 * take part, at least two. False, with a line, where none can be found. */
bool solve(const Board &board, const std::vector<View> &views, int width, int height,
           const SolveOptions &options, Solution &solution, std::string &error);

/* A first guess for solve: a focal length and the poses by it, the rest of the camera ideal.
 * `root_mean_square_px` judges it. */
bool initial_guess(const Board &board, const std::vector<View> &views, int width, int height,
                   bool equidistant, fovea_camera &camera, std::vector<Pose> &poses,
                   std::string &error);

/* T_cam_board of one view by a camera that is known and prepared, from a homography of its
 * bearings. False: fewer than six corners are seen where the camera has rays, or nothing fits. */
bool initial_pose(const Board &board, const fovea_camera &camera, const View &view, Pose &pose);

/* RMS over views that the solve does not see, in `folds` parts of all used views: each is posed by
 * the camera of the others. Negative: one of the parts could not be solved. */
double held_out_rms_px(const Board &board, const std::vector<View> &views, const Solution &solution,
                       int folds, const SolveOptions &options);

/* RMS of the views and corners that a solution uses, each posed anew by another camera of its
 * model; negative where that fails. */
double held_camera_rms_px(const Board &board, const std::vector<View> &views,
                          const Solution &solution, const fovea_camera &camera);

/* Of those that are numbers (NaN: not known); 0 where there is none. */
double median(std::vector<double> values);

} // namespace calibrate
#endif
