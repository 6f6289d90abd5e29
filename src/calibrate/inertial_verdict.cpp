/* Whether the place of an inertial sensor can be trusted, and why not. */
#include "calibrate/inertial.h"

#include <algorithm>
#include <cmath>

namespace calibrate
{
namespace
{

/* Limits of doubt and failure; of standard deviations. */
constexpr double DEGREE = 57.29577951308232;
constexpr double TURN_PASS_RAD = .05 / DEGREE, TURN_DOUBTFUL_RAD = .2 / DEGREE;
constexpr double PLACE_PASS_M = .003, PLACE_DOUBTFUL_M = .012;
constexpr double SHIFT_PASS_S = 1e-4, SHIFT_DOUBTFUL_S = 5e-4;
/* What the hand did: a deviation that is too large has its reason here. */
constexpr double TURN_RAD_S = .1, ACCELERATION_M_S2 = .3;
constexpr double FITS_PASS = .9;
constexpr double EXCESS_PASS = 3, EXCESS_DOUBTFUL = 10; /* times the stated noise */
constexpr double RMS_PASS_PX = .5, RMS_DOUBTFUL_PX = 1.5;
constexpr double TOGETHER_PASS = 1.5, TOGETHER_DOUBTFUL = 3;
constexpr double DRIFT_PASS_S = 2e-4, DRIFT_DOUBTFUL_S = 2e-3; /* between begin and end */
constexpr double SATURATED_PASS = .001, SATURATED_DOUBTFUL = .02;
constexpr double MISSING_PASS = .02, LEFT_OUT_PASS = .34;
constexpr double DURATION_PASS_S = 15;
constexpr double BIAS_PASS[INERTIAL_PARTS] = {.1, .5};

void judge_motion(const InertialSolution &solution, Verdict &verdict)
{
    const auto &d = solution.stdev;
    const double turn_rad = std::max({d[0], d[1], d[2]}), place_m = std::max({d[3], d[4], d[5]});
    const Grade turn = grade_of(turn_rad, TURN_PASS_RAD, TURN_DOUBTFUL_RAD),
                place = grade_of(place_m, PLACE_PASS_M, PLACE_DOUBTFUL_M),
                shift = grade_of(solution.time_shift_stdev_s, SHIFT_PASS_S, SHIFT_DOUBTFUL_S);
    const bool one_axis = solution.turn_rad_s[1] < TURN_RAD_S;
    if (one_axis)
        add_reason(verdict, std::max({Grade::doubtful, turn, place}),
                   "the sensor turned by %.2g rad/s rms about one axis and %.2g about the second, "
                   "expected %.1g or more about two: turn the camera quickly about all its axes",
                   solution.turn_rad_s[0], solution.turn_rad_s[1], TURN_RAD_S);
    else if (turn != Grade::pass)
        add_reason(verdict, turn,
                   "its rotation is known to %.2g degrees (one standard deviation), expected %.2g "
                   "or better: turn the camera faster, and for longer",
                   DEGREE * turn_rad, DEGREE * TURN_PASS_RAD);
    const bool slow = solution.acceleration_m_s2 < ACCELERATION_M_S2;
    if (place != Grade::pass && slow)
        add_reason(verdict, place,
                   "the sensor accelerated by %.2g m/s^2 rms, expected %.1g or more, so that its "
                   "place is known to %.1f mm (one standard deviation): move and turn faster",
                   solution.acceleration_m_s2, ACCELERATION_M_S2, 1e3 * place_m);
    else if (place != Grade::pass && !one_axis)
        add_reason(verdict, place,
                   "its place is known to %.1f mm (one standard deviation), expected %.0f mm or "
                   "better: turn the camera faster about all its axes, and for longer",
                   1e3 * place_m, 1e3 * PLACE_PASS_M);
    if (shift != Grade::pass)
        add_reason(verdict, shift,
                   "the time shift is known to %.2f ms (one standard deviation), expected %.1f ms "
                   "or better: turn the camera faster, and for longer",
                   1e3 * solution.time_shift_stdev_s, 1e3 * SHIFT_PASS_S);
    if (solution.duration_s < DURATION_PASS_S)
        add_reason(verdict, Grade::doubtful,
                   "the pictures with a board last %.1f s, expected %.0f s or more",
                   solution.duration_s, DURATION_PASS_S);
}

void judge_clocks(const InertialSolution &solution, Verdict &verdict)
{
    const double ends_s = std::fabs(solution.clock_drift) * solution.duration_s;
    const bool shows = std::fabs(solution.clock_drift) > 4 * solution.clock_drift_stdev;
    Grade grade = grade_of(ends_s, DRIFT_PASS_S, DRIFT_DOUBTFUL_S);
    if (shows && grade != Grade::pass)
        add_reason(verdict, grade,
                   "the clocks differ: the sensor's runs %.0f ppm %s than the cameras', which is "
                   "%.2f ms over the pictures: one time shift does not hold; stamp both by one "
                   "clock",
                   1e6 * std::fabs(solution.clock_drift),
                   solution.clock_drift > 0 ? "faster" : "slower", 1e3 * ends_s);
    if (solution.fits < FITS_PASS)
        add_reason(verdict, Grade::doubtful,
                   "the angular rates explain %.0f %% of the pictures' rotation, expected %.0f or "
                   "more: the stamps are uneven, or the sensor is not fixed to the camera",
                   100 * solution.fits, 100 * FITS_PASS);
}

void judge_samples(const InertialSolution &solution, Verdict &verdict)
{
    static const char *const names[] = {"gyroscope", "accelerometer"};
    static const char *const units[] = {"rad/s", "m/s^2"};
    for (int part = 0; part < INERTIAL_PARTS; part++) {
        const double share = solution.saturated[part] / (double)std::max(1, solution.samples_used);
        Grade grade = share > 0 ? grade_of(share, SATURATED_PASS, SATURATED_DOUBTFUL) : Grade::pass;
        if (grade != Grade::pass)
            add_reason(verdict, grade,
                       "the %s is at the end of its range in %d of %d samples, which are left out: "
                       "move more slowly, or widen its range",
                       names[part], solution.saturated[part], solution.samples_used);
        grade = grade_of(solution.excess[part], EXCESS_PASS, EXCESS_DOUBTFUL);
        if (grade != Grade::pass)
            add_reason(verdict, grade,
                       "the noise of the %s is %.1f times what its file states: the densities are "
                       "not this sensor's ('fovea-calibrate imu' finds them), its scale is wrong, "
                       "or it shakes on its mount",
                       names[part], solution.excess[part]);
        for (int i = 0; i < 3; i++)
            if (std::fabs(solution.bias[part][i]) > BIAS_PASS[part])
                add_reason(verdict, Grade::doubtful,
                           "the bias of the %s's axis %c is %.2g %s, expected at most %.1g: the "
                           "sensor is not calibrated, or its values are in another unit",
                           names[part], "xyz"[i], solution.bias[part][i], units[part],
                           BIAS_PASS[part]);
    }
    if (solution.missing > MISSING_PASS * solution.samples_used)
        add_reason(verdict, Grade::doubtful,
                   "%d samples are missing among %d: the sensor or its link loses them",
                   solution.missing, solution.samples_used);
}

void judge_pictures(const InertialSolution &solution, Verdict &verdict)
{
    const double ratio = solution.noise_px / std::max(solution.alone_px, 1e-9),
                 rms_px = std::sqrt(2.) * solution.noise_px;
    Grade grade = grade_of(rms_px, RMS_PASS_PX, RMS_DOUBTFUL_PX);
    if (rms_px > .1 && ratio > TOGETHER_PASS)
        add_reason(verdict, std::max(grade, grade_of(ratio, TOGETHER_PASS, TOGETHER_DOUBTFUL)),
                   "the corners are %.2f px RMS off the motion, %.2f px off pictures posed by "
                   "themselves: a rolling shutter, uneven stamps, or a sensor that is not fixed "
                   "to the camera",
                   rms_px, std::sqrt(2.) * solution.alone_px);
    else if (grade != Grade::pass)
        add_reason(verdict, grade,
                   "RMS error of the corners is %.2f px, expected %.1f or less: the board is not "
                   "flat, its size or the camera file is wrong, or the pictures are blurred",
                   rms_px, RMS_PASS_PX);
    const int lost = solution.views_with_board - solution.views_used;
    if (lost > LEFT_OUT_PASS * solution.views_with_board)
        add_reason(verdict, Grade::doubtful,
                   "%d of %d pictures with a board are left out: see their reasons", lost,
                   solution.views_with_board);
}

} // namespace

Verdict judge_inertial(const InertialSolution &solution)
{
    Verdict verdict;
    judge_motion(solution, verdict);
    judge_clocks(solution, verdict);
    judge_samples(solution, verdict);
    judge_pictures(solution, verdict);
    verdict.views_used = solution.views_used;
    verdict.views_with_board = solution.views_with_board;
    return verdict;
}

} // namespace calibrate
