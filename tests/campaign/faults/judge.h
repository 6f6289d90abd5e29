/* What a run with faults is worth, against the truth of the simulation.
 *
 * False confidence: a frame in state `tracking` whose pose is off by more than its covariance
 * allows. As tools/evaluate has it (nees6_keyframe): the pose relative to its reference keyframe,
 * which is what the covariance is of, against the same of the truth; error = log(T_est^-1 T_true),
 * NEES = error^T S^-1 error, false where it is over 22.5 (99.9 % of six degrees of freedom are
 * below). Frames that are their own reference have no error and are not judged. A tracking frame
 * whose pose or covariance is not finite is false, whatever the truth.
 *
 * A pose that claims metres is compared as it is. One whose scale is free is known up to the unit,
 * one for each map: of those that the single `tracking` poses of the map say, relative to their
 * keyframes, the one that most of them agree with to a tenth of the way; or all its poses, where
 * fewer than 3 are `tracking`. The covariances, which are judged by it, have no part in it. A mean
 * would not do: frames before the first fault are the same bits as without faults, and became false
 * by a unit that few wrong poses at the end had pulled away. Nor would a similarity of the whole
 * path to the truth: where the path leaps, as it states, or is noisy, that makes the unit too long,
 * by 20 % in a run whose lens zooms, 40 times in one that is blurred. It stands in where that unit
 * is not determined. Maps with fewer than 10 poses, or without extent, are not judged. */
#ifndef FOVEA_TESTS_CAMPAIGN_FAULTS_JUDGE_H
#define FOVEA_TESTS_CAMPAIGN_FAULTS_JUDGE_H

#include "plan.h"
#include "play.h"

struct faults_verdict {
    uint32_t given, processed, posed;
    uint32_t tracking, due, /* frames: of the first that have an exact truth, and those that */
        judged, wrong;      /* are not finite; of these that could be judged; of these false */
    double worst;           /* largest NEES of a judged frame */
    double error_m;         /* largest error of a judged frame since its keyframe */
    uint32_t returns, late; /* ends of faults; of these without a processed frame in 1 s */
    double last_s;          /* longest time until the frames flowed again */
};

/* `truth_is_exact`: else nothing is judged by it. NEES of each judged frame stands in `nees`, NaN
 * for the others. */
void faults_judge(const struct faults_plan *plan, const struct faults_play *play,
                  bool truth_is_exact, double nees[FAULTS_GIVEN_MAX],
                  struct faults_verdict *verdict);

/* A line on stdout for each frame of false confidence: its error and what its covariance allows. */
void faults_explain(const struct faults_play *play, const double nees[FAULTS_GIVEN_MAX]);

/* Similarity from the published world of a map to the truth, over its frames as above; a rigid
 * motion where it is in metres. False: too few, or without extent. */
struct faults_fit {
    double scale, R[9], t[3];
};
bool faults_fit(const struct faults_play *play, uint32_t map_id, bool metric,
                struct faults_fit *fit);

/* Whether a fault strikes frame `index` of the source. */
bool faults_strikes(const struct faults_plan *plan, uint64_t index);

#endif
