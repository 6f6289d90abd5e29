/* Whether a calibration can be trusted, and why not. */
#ifndef FOVEA_CALIBRATE_VERDICT_H
#define FOVEA_CALIBRATE_VERDICT_H

#include <cmath>

#include "calibrate/calibrate.h"

namespace calibrate
{

/* Deviation of projection, where corners were seen, with which a calibration passes, and up to
 * which pictures can judge another one. */
constexpr double PROJECTION_PASS_PX = 1;

enum class Grade { pass, doubtful, fail };
const char *grade_name(Grade grade);

struct Reason {
    Grade grade;
    std::string text; /* what was found, what is expected, what to do */
};

struct Verdict {
    Grade grade = Grade::pass;
    std::vector<Reason> reasons; /* of the grade or below; empty after pass */
    double coverage = 0; /* fraction of cells that the lens sees which hold a corner that is used */
    double tilt_rad = 0; /* largest angle between the normals of two boards */
    double uncertainty_seen_px = 0; /* worst where corners are */
    double residual_pattern = NAN;  /* ResidualPattern::ratio */
    int views_used = 0, views_with_board = 0;
};

/* Add a reason, and lower the grade to its. */
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
void
add_reason(Verdict &verdict, Grade grade, const char *format, ...);

/* Grade of a value that is better when smaller. */
Grade grade_of(double value, double pass, double doubtful);

/* `held_out_px` from held_out_rms_px. Views are those that were solved. */
Verdict judge(const std::vector<View> &views, const Solution &solution, double held_out_px);

/* Of views that could not be solved, for the reason `error`. */
Verdict judge_unsolved(const std::vector<View> &views, const std::string &error);

/* Add to the verdict on `flat` what `bent`, solved with the board's bend, says of the board. */
void judge_bend(const Board &board, const Solution &flat, const Solution &bent, Verdict &verdict);

/* The cameras of two halves of the pictures. Their differences are in standard deviations of the
 * normal distribution. */
struct Halves {
    double difference_px = NAN; /* of projection: worst where both saw corners; NaN: not known */
    double sigmas = 0;          /* of all parameters together */
    double focal_change = 0;    /* where all else is the same, relative */
    double focal_sigmas = 0;
};

/* Add to the verdict what they say of the lens, where chance does not explain it. */
void judge_halves(const Halves &halves, Verdict &verdict);

/* Leave out the views whose edges are much wider than the others'. */
void leave_out_blurred(std::vector<View> &views);

} // namespace calibrate
#endif
