/* Whether the places of a rig's cameras can be trusted, and why not. */
#include "calibrate/rig.h"
#include "calibrate/rigid.h"

#include <algorithm>
#include <cmath>

namespace calibrate
{
namespace
{

/* Limits of doubt and failure. */
constexpr int SHARED_PASS = 8, SHARED_DOUBTFUL = 4;
constexpr double RMS_PASS_PX = .5, RMS_DOUBTFUL_PX = 1.5;
constexpr double TOGETHER_PASS = 1.5, TOGETHER_DOUBTFUL = 3; /* times the error of pictures alone */
constexpr double EPIPOLAR_PASS_PX = .5, EPIPOLAR_DOUBTFUL_PX = 1.5;
constexpr double TURN_PASS_PX = PROJECTION_PASS_PX, TURN_DOUBTFUL_PX = 3;
constexpr double PLACE_PASS = .01, PLACE_DOUBTFUL = .03;         /* over the baseline */
constexpr double PLACE_PASS_M = .0005, PLACE_DOUBTFUL_M = .0015; /* of cameras that are close */
constexpr double LEFT_OUT_PASS = .34;

std::string name_of(size_t camera)
{
    return "cam" + std::to_string(camera);
}

void judge_camera(const RigInput &input, const RigSolution &solution, size_t k, Verdict &verdict)
{
    const RigCamera &camera = solution.cameras[k];
    const std::string name = name_of(k);
    Grade grade = grade_of(-camera.views_shared, -SHARED_PASS, -SHARED_DOUBTFUL);
    if (grade != Grade::pass)
        add_reason(verdict, grade,
                   "%s: shares %d pictures of the board with other cameras, expected %d or more: "
                   "hold the board where both cameras see it",
                   name.c_str(), camera.views_shared, SHARED_PASS);
    grade = grade_of(camera.rms_px, RMS_PASS_PX, RMS_DOUBTFUL_PX);
    const double ratio = camera.rms_px / std::max(camera.alone_rms_px, 1e-9);
    const bool apart = camera.rms_px > .1 && ratio > TOGETHER_PASS;
    if (apart)
        add_reason(
            verdict, std::max(grade, grade_of(ratio, TOGETHER_PASS, TOGETHER_DOUBTFUL)),
            "%s: RMS error is %.2f px together with the other cameras, %.2f px by itself: the "
            "pictures were not taken at one instant, a camera moved, or its camera file is "
            "wrong",
            name.c_str(), camera.rms_px, camera.alone_rms_px);
    else if (grade != Grade::pass)
        add_reason(
            verdict, grade,
            "%s: RMS error is %.2f px, expected %.1f or less: the board is not flat, its size "
            "is wrong, or the camera file is not of this camera",
            name.c_str(), camera.rms_px, RMS_PASS_PX);
    int with_board = 0;
    for (const View &view : input.views)
        with_board += !view.corners.empty();
    if (with_board - camera.views_used > LEFT_OUT_PASS * with_board)
        add_reason(verdict, Grade::doubtful,
                   "%s: %d of %d pictures with a board are left out: see their reasons",
                   name.c_str(), with_board - camera.views_used, with_board);
}

/* The nearest other camera: what lengths are measured by. */
double baseline_m(const RigSolution &solution, size_t k)
{
    double nearest = INFINITY;
    for (size_t other = 0; other < solution.cameras.size(); other++) {
        if (other == k) continue;
        const Rigid T = rigid_of(solution.cameras[k].T_cam_first) *
                        rigid_of(solution.cameras[other].T_cam_first).inverse();
        nearest = std::min(nearest, T.t.norm());
    }
    return nearest;
}

void judge_place(const RigSolution &solution, size_t k, Verdict &verdict)
{
    const RigCamera &camera = solution.cameras[k];
    /* Where the cameras see nothing far away in common, by the turn alone. */
    const double turn_px =
        std::isfinite(camera.transfer_px)
            ? camera.transfer_px
            : std::max({camera.stdev[0], camera.stdev[1], camera.stdev[2]}) * camera.camera.fx;
    const double place_m = std::max({camera.stdev[3], camera.stdev[4], camera.stdev[5]});
    const double baseline = baseline_m(solution, k);
    Grade grade = grade_of(turn_px, TURN_PASS_PX, TURN_DOUBTFUL_PX);
    if (grade != Grade::pass)
        add_reason(
            verdict, grade,
            "%s: where it sees what cam0 sees far away is known to %.2f px (one standard "
            "deviation), expected %.1f or better: take more pictures, with the board all over "
            "both images",
            name_of(k).c_str(), turn_px, TURN_PASS_PX);
    grade = grade_of(place_m, std::max(PLACE_PASS_M, PLACE_PASS * baseline),
                     std::max(PLACE_DOUBTFUL_M, PLACE_DOUBTFUL * baseline));
    if (grade != Grade::pass)
        add_reason(
            verdict, grade,
            "%s: its place is known to %.1f mm (one standard deviation) at a distance of %.0f "
            "mm to the next camera, expected %.1f mm or better: take more pictures, with the "
            "board near and tilted",
            name_of(k).c_str(), 1e3 * place_m, 1e3 * baseline,
            1e3 * std::max(PLACE_PASS_M, PLACE_PASS * baseline));
}

} // namespace

Verdict judge_rig(const std::vector<RigInput> &inputs, const RigSolution &solution,
                  double held_out_px)
{
    Verdict verdict;
    for (size_t k = 0; k < solution.cameras.size(); k++) {
        fovea_camera camera = solution.cameras[k].camera;
        fovea_error why;
        judge_camera(inputs[k], solution, k, verdict);
        if (k > 0) judge_place(solution, k, verdict);
        verdict.views_used = std::max(verdict.views_used, solution.cameras[k].views_shared);
        if (fovea_camera_prepare(&camera, &why) != FOVEA_OK)
            add_reason(verdict, Grade::fail, "%s: the model is of no use: %s", name_of(k).c_str(),
                       why.text);
    }
    const Grade grade = grade_of(held_out_px, EPIPOLAR_PASS_PX, EPIPOLAR_DOUBTFUL_PX);
    if (held_out_px < 0)
        add_reason(verdict, Grade::doubtful,
                   "no part of the pictures determines the rig without the rest: take more "
                   "pictures");
    else if (grade != Grade::pass)
        add_reason(verdict, grade,
                   "in pictures that the solve did not see, corners are %.2f px RMS from the "
                   "epipolar lines, expected %.1f or less: take more pictures, all cameras at one "
                   "instant",
                   held_out_px, EPIPOLAR_PASS_PX);
    return verdict;
}

} // namespace calibrate
