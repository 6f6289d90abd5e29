/* Several cameras to each other, from pictures that they take of one board at the same instants.
 *
 * All cameras and the places of the board are solved for together: bundle adjustment with the pose
 * of the board before the first camera, and T_cam_first of each other camera. */
#ifndef FOVEA_CALIBRATE_RIG_H
#define FOVEA_CALIBRATE_RIG_H

#include "calibrate/verdict.h"

namespace calibrate
{

/* A camera with its pictures: those of one index are taken at one instant. */
struct RigInput {
    std::string source;       /* as --source names it */
    fovea_camera camera = {}; /* width and height; `held`: all of it, prepared */
    bool held = false;        /* its lens is known, from a file */
    Model model = Model::radtan;
    bool four_coefficients = false; /* k3 = 0, as Kalibr's files hold a lens */
    std::vector<View> views;
};

struct RigCamera {
    fovea_camera camera = {}; /* not prepared */
    Model model = Model::radtan;
    bool held = false;
    Pose T_cam_first = {};
    /* Of the camera's place before the first, T_first_cam: of a small rotation about the camera's
     * own axes (radians), of its centre (metres). 0 of the first camera. */
    std::array<double, 6> stdev = {};
    std::array<double, PARAMETERS_MAX> lens_stdev = {}; /* 0: held */
    /* Standard deviation of where a far point that the first camera sees appears in this one, by
     * both lenses and the rotation, in its worst place of a grid and its worst direction. NaN: the
     * first camera's, and where they see nothing in common. */
    double transfer_px = NAN;
    double rms_px = 0;       /* 2-D, in this camera's pictures */
    double alone_rms_px = 0; /* of the same corners, each picture posed by itself */
    int views_used = 0;      /* of them, those that another camera uses too */
    int views_shared = 0;
    int corners_used = 0;
};

struct RigSolution {
    std::vector<RigCamera> cameras;
    std::vector<Pose> poses;                          /* T_first_board, per instant */
    std::vector<std::vector<std::string>> left_out;   /* per camera and view: why, or empty */
    std::vector<std::vector<std::vector<char>>> used; /* per camera, view and corner */
    std::vector<std::vector<char>> turned; /* per camera and view: its corners count from the other
                                              end than the first camera's */
    int corners_used = 0;
    double rms_px = 0, noise_px = 0; /* as of Solution */
};

/* False, with a line: a camera shares too few pictures with the others, or nothing fits. */
bool solve_rig(const Board &board, const std::vector<RigInput> &inputs, RigSolution &solution,
               std::string &error);

/* RMS distance, in both images, of a corner from the epipolar curve of the same corner in another
 * camera: the plane that it spans with both centres, as the other lens sees it. Of instants where
 * `of` is not 0 (empty: all). Negative: there is none. */
double epipolar_rms_px(const std::vector<RigInput> &inputs, const RigSolution &solution,
                       const std::vector<char> &of);

/* The same of instants that the solve does not see, in `folds` parts. Negative: one of the parts
 * could not be solved. */
double held_out_epipolar_px(const Board &board, const std::vector<RigInput> &inputs,
                            const RigSolution &solution, int folds);

/* `held_out_px` from held_out_epipolar_px. */
Verdict judge_rig(const std::vector<RigInput> &inputs, const RigSolution &solution,
                  double held_out_px);

} // namespace calibrate
#endif
