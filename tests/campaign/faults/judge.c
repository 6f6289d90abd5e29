#include "judge.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "app/run/trajectory.h"
#include "geometry/linear.h"
#include "geometry/se3.h"
#include "geometry/vec.h"

enum { POSES_MIN = 10, SURE_MIN = 3 };
static const double nees_max = 22.5;
static const int64_t flow_ns = 1000000000;

static bool is_metric(const struct fovea_pose *pose)
{
    return pose->scale_source != FOVEA_SCALE_FREE;
}

static bool all_finite(const double *value, int count)
{
    for (int i = 0; i < count; i++)
        if (!isfinite(value[i])) return false;
    return true;
}

static bool is_finite(const struct fovea_pose *pose)
{
    return all_finite(pose->T_world_cam, 12) && all_finite(pose->T_keyframe_cam, 12) &&
           all_finite(pose->covariance, 21);
}

/* Whether a frame's pose is of this map and has a truth; `sure`: only in state `tracking`. */
static bool takes_part(const struct faults_frame *frame, uint32_t map_id, bool metric, bool sure)
{
    const struct fovea_pose *pose = &frame->pose;
    return frame->processed && pose->posed && frame->has_truth && pose->map_id == map_id &&
           is_metric(pose) == metric && !(sure && pose->state != FOVEA_TRACKING_OK);
}

/* Positions of a map's poses and of the truth; `sure`: of those in state `tracking` only. */
static void gather(const struct faults_play *play, uint32_t map_id, bool metric, bool sure,
                   struct fv_similarity_sums *sums)
{
    memset(sums, 0, sizeof *sums);
    for (uint32_t i = 0; i < play->count; i++) {
        const struct faults_frame *frame = &play->frame[i];
        const double *T = frame->pose.T_world_cam;
        if (!takes_part(frame, map_id, metric, sure) || !all_finite(T, 12)) continue;
        const double p[3] = {T[3], T[7], T[11]},
                     q[3] = {frame->truth[3], frame->truth[7], frame->truth[11]};
        fv_similarity_add(sums, p, q);
    }
}

bool faults_fit(const struct faults_play *play, uint32_t map_id, bool metric,
                struct faults_fit *fit)
{
    struct fv_similarity_sums sums;
    double rms;
    gather(play, map_id, metric, true, &sums);
    if (sums.n < POSES_MIN) gather(play, map_id, metric, false, &sums);
    if (sums.n < POSES_MIN || !fv_similarity_fit(&sums, &fit->scale, fit->R, fit->t, &rms) ||
        !(fit->scale > 0))
        return false;
    if (metric) { /* the same rotation without the scale */
        double turned[3], mean[3];
        for (int i = 0; i < 3; i++)
            mean[i] = sums.p[i] / sums.n;
        fv_rotate3(fit->R, mean, turned);
        for (int i = 0; i < 3; i++)
            fit->t[i] = sums.q[i] / sums.n - turned[i];
        fit->scale = 1;
    }
    return true;
}

/* ---- NEES ------------------------------------------------------------------------------------ */

/* (rho, omega) with exp of it the motion T. */
static void logarithm(const struct fv_se3 *T, double error[6])
{
    double crossed[3], twice[3];
    fv_so3_log(T->R, error + 3);
    const double angle2 = fv_dot3(error + 3, error + 3), angle = sqrt(angle2),
                 factor = angle2 < 1e-8 ? 1.0 / 12 + angle2 / 720
                                        : (1 - 0.5 * angle / tan(0.5 * angle)) / angle2;
    fv_cross3(error + 3, T->t, crossed);
    fv_cross3(error + 3, crossed, twice);
    for (int i = 0; i < 3; i++)
        error[i] = T->t[i] - 0.5 * crossed[i] + factor * twice[i];
}

/* Infinite where the covariance is none. */
static double squared_error(const double covariance[21], const double error[6])
{
    double S[36], solved[6], sum = 0;
    for (int row = 0, k = 0; row < 6; row++)
        for (int column = row; column < 6; column++, k++)
            S[6 * row + column] = S[6 * column + row] = covariance[k];
    memcpy(solved, error, sizeof solved);
    if (!fv_ldlt_solve(S, 6, solved)) return INFINITY;
    for (int i = 0; i < 6; i++)
        sum += error[i] * solved[i];
    return sum;
}

static const struct faults_frame *at_stamp(const struct faults_play *play, int64_t stamp_ns)
{
    for (uint32_t i = 0; i < play->count; i++)
        if (play->frame[i].processed && play->frame[i].stamp_ns == stamp_ns) return &play->frame[i];
    return NULL;
}

/* Error of a frame's pose relative to its reference keyframe, in the published unit and rad, where
 * a metre has `units` of them. False: there is nothing to compare with. */
static bool error_of(const struct faults_play *play, const struct faults_frame *frame, double units,
                     double vector[6])
{
    const struct fovea_pose *pose = &frame->pose;
    const struct faults_frame *keyframe = at_stamp(play, pose->keyframe_stamp_ns);
    if (keyframe == NULL || keyframe == frame || !keyframe->has_truth) return false;
    /* The published unit per unit of the map, as in the message's T_keyframe_child. */
    const double unit = is_metric(pose) ? pose->scale : 1 / pose->map_scale;
    struct fv_se3 T_keyframe_cam, T_world_keyframe, T_world_cam, truth, error;
    fv_se3_from_rows(pose->T_keyframe_cam, &T_keyframe_cam);
    fv_se3_from_rows(keyframe->truth, &T_world_keyframe);
    fv_se3_from_rows(frame->truth, &T_world_cam);
    fv_se3_invert(&T_world_keyframe, &truth);
    fv_se3_compose(&truth, &T_world_cam, &truth);
    for (int i = 0; i < 3; i++) {
        T_keyframe_cam.t[i] *= unit;
        truth.t[i] *= units;
    }
    fv_se3_invert(&T_keyframe_cam, &error);
    fv_se3_compose(&error, &truth, &error);
    logarithm(&error, vector);
    return true;
}

/* What one pose says of the unit: of the motion since its keyframe the published one, and the true
 * one of as many units as it has metres. */
struct vote {
    double published[3], truth[3];
};

/* False: it says nothing. */
static bool vote_of(const struct faults_play *play, const struct faults_frame *frame,
                    struct vote *vote)
{
    double none[6], one[6];
    if (!is_finite(&frame->pose) || !error_of(play, frame, 0, none) ||
        !error_of(play, frame, 1, one))
        return false;
    for (int k = 0; k < 3; k++) {
        vote->published[k] = -none[k];
        vote->truth[k] = one[k] - none[k];
    }
    return fv_norm3(vote->truth) > 0 && fv_dot3(vote->published, vote->truth) > 0;
}

/* How little the poses agree with the truth where a metre has so many units: each by its error
 * relative to the way that the camera has gone, up to 1 where it is beyond `right` (S. Geman and D.
 * McClure, 1987). */
static double disagreement(const struct vote *votes, uint32_t count, double units)
{
    const double right = 0.1;
    double sum = 0;
    for (uint32_t i = 0; i < count; i++) {
        double error2 = 0, way2 = 0;
        for (int k = 0; k < 3; k++) {
            const double way = units * votes[i].truth[k], error = votes[i].published[k] - way;
            error2 += error * error;
            way2 += way * way;
        }
        sum += error2 / (error2 + right * right * way2);
    }
    return sum;
}

/* Units per metre of a map in a unit of its own: of those that single poses say, relative to their
 * keyframes, the one that most agree with. Covariances, which are judged by it, have no part in it;
 * and poses that are wrong do not make right ones wrong. `sure`: of poses in state `tracking` only.
 */
static bool fit_units(const struct faults_play *play, uint32_t map_id, bool sure, double *units)
{
    static struct vote votes[FAULTS_GIVEN_MAX];
    double least = INFINITY;
    uint32_t count = 0;
    for (uint32_t i = 0; i < play->count; i++)
        count += takes_part(&play->frame[i], map_id, false, sure) &&
                 vote_of(play, &play->frame[i], &votes[count]);
    for (uint32_t i = 0; i < count; i++) {
        const double *truth = votes[i].truth,
                     of = fv_dot3(votes[i].published, truth) / fv_dot3(truth, truth),
                     now = disagreement(votes, count, of);
        if (now < least) *units = of;
        least = fmin(least, now);
    }
    return count >= (sure ? SURE_MIN : POSES_MIN) && isfinite(*units);
}

/* Metres per unit of the published world. 0: not known. */
static double metres_of(const struct faults_play *play, const struct fovea_pose *pose)
{
    struct faults_fit fit;
    double units;
    if (is_metric(pose)) return 1;
    if (fit_units(play, pose->map_id, true, &units) || fit_units(play, pose->map_id, false, &units))
        return 1 / units;
    return faults_fit(play, pose->map_id, false, &fit) ? fit.scale : 0;
}

/* NEES of a frame's pose relative to its reference keyframe; infinite: it is none at all; NaN: it
 * cannot be judged. `vector`: its error, in metres and rad. */
static double nees_of(const struct faults_play *play, const struct faults_frame *frame,
                      double vector[6])
{
    const double metres = metres_of(play, &frame->pose);
    if (!(metres > 0) || !error_of(play, frame, 1 / metres, vector)) return NAN;
    const double nees = squared_error(frame->pose.covariance, vector);
    for (int i = 0; i < 3; i++)
        vector[i] *= metres;
    return isnan(nees) ? INFINITY : nees;
}

/* ---- frames flow again ----------------------------------------------------------------------- */

bool faults_strikes(const struct faults_plan *plan, uint64_t index)
{
    for (uint32_t i = 0; i < plan->count; i++) {
        struct fv_fault_options options;
        struct fv_fault_schedule schedule;
        struct fv_fault_window window;
        struct fovea_error error;
        if (fv_fault_options_parse(plan->options[i], &options, &error)) faults_die(error.text);
        fv_fault_schedule_open(&schedule, &options);
        if (fv_fault_schedule_at(&schedule, index, &window)) return true;
    }
    return false;
}

/* Time of the source between two frames of it, by frames without a fault: stamps may be at fault.
 */
static double period_ns(const struct faults_plan *plan, const struct faults_play *play)
{
    const struct faults_frame *first = NULL, *last = NULL;
    for (uint32_t i = 0; i < play->count; i++) {
        if (faults_strikes(plan, play->frame[i].index)) continue;
        last = &play->frame[i];
        if (first == NULL) first = last;
    }
    return first == NULL || last->index <= first->index
               ? 0
               : (double)(last->stamp_ns - first->stamp_ns) / (double)(last->index - first->index);
}

/* From the first good frame behind a fault to the next processed frame, by the time of the source.
 * Ends that have less than a second of the source behind them count only when frames flow in it. */
static void judge_returns(const struct faults_plan *plan, const struct faults_play *play,
                          struct faults_verdict *verdict)
{
    const double period = period_ns(plan, play);
    bool before = false;
    for (uint32_t i = 0; i < play->count; i++) {
        const struct faults_frame *good = &play->frame[i];
        const bool returns = !faults_strikes(plan, good->index) && good->index > 0 &&
                             faults_strikes(plan, good->index - 1);
        const bool first = returns && !before;
        before = returns;
        if (!first) continue;
        int64_t waited_ns = -1;
        for (uint32_t k = i; k < play->count && waited_ns < 0; k++)
            if (play->frame[k].processed && play->frame[k].stamp_ns >= good->stamp_ns)
                waited_ns = (int64_t)(period * (double)(play->frame[k].index - good->index));
        const int64_t left_ns =
            (int64_t)(period * (double)(play->frame[play->count - 1].index - good->index));
        if (waited_ns < 0 && left_ns < flow_ns) continue;
        verdict->returns++;
        verdict->late += waited_ns < 0 || waited_ns > flow_ns;
        if (1e-9 * (double)waited_ns > verdict->last_s) verdict->last_s = 1e-9 * (double)waited_ns;
    }
}

void faults_explain(const struct faults_play *play, const double nees[FAULTS_GIVEN_MAX])
{
    for (uint32_t i = 0; i < play->count; i++) {
        const struct faults_frame *frame = &play->frame[i], *keyframe;
        const struct fovea_pose *pose = &frame->pose;
        double error[6];
        if (!(nees[i] > nees_max)) continue;
        if (!is_finite(pose)) {
            printf("  frame %llu: its pose is not finite\n", (unsigned long long)frame->index);
            continue;
        }
        (void)nees_of(play, frame, error);
        keyframe = at_stamp(play, pose->keyframe_stamp_ns);
        printf(
            "  frame %llu: NEES %.4g, of keyframe %llu at frame %llu, %u inliers of %u; error (mm, mrad) "
            "over sigma:",
            (unsigned long long)frame->index, nees[i], (unsigned long long)pose->reference_keyframe,
            (unsigned long long)keyframe->index, pose->inliers, pose->matches);
        for (int row = 0, k = 0; row < 6; k += 6 - row, row++)
            printf(" %.2f/%.2f", 1e3 * error[row],
                   1e3 * sqrt(pose->covariance[k]) * (row < 3 ? metres_of(play, pose) : 1));
        putchar('\n');
    }
}

void faults_judge(const struct faults_plan *plan, const struct faults_play *play,
                  bool truth_is_exact, double nees[FAULTS_GIVEN_MAX],
                  struct faults_verdict *verdict)
{
    memset(verdict, 0, sizeof *verdict);
    verdict->given = play->count;
    for (uint32_t i = 0; i < play->count; i++) {
        const struct faults_frame *frame = &play->frame[i];
        double error[6];
        nees[i] = NAN;
        verdict->processed += frame->processed;
        verdict->posed += frame->processed && frame->pose.posed;
        if (!frame->processed || frame->pose.state != FOVEA_TRACKING_OK) continue;
        verdict->tracking++;
        const bool finite = is_finite(&frame->pose);
        if (finite && (!truth_is_exact || !frame->has_truth)) continue;
        verdict->due++;
        nees[i] = finite ? nees_of(play, frame, error) : INFINITY;
        if (isnan(nees[i])) continue;
        verdict->judged++;
        verdict->wrong += !(nees[i] <= nees_max);
        if (nees[i] > verdict->worst) verdict->worst = nees[i];
        if (finite) verdict->error_m = fmax(verdict->error_m, fv_norm3(error));
    }
    if (plan->count > 0) judge_returns(plan, play, verdict);
}
