/* Bias of a map's motion: whether the pictures ask for the same correction of it again and again.
 *
 * A map that hangs half on the world and half on something large that moves along (a lorry beside
 * the camera) is a compromise: turned and shifted sideways, it fits both within noise, and its
 * landmarks, made by its own poses, agree with it. So from each pair of keyframes that was matched
 * without the map, the relative motion is fitted alone, from the map's on: by five degrees of
 * freedom, robustly; or by the two of its direction where a gyro has measured the turn, which is
 * surer of it than two pictures are: the one they ask for beside a wrong direction is none of the
 * map's errors. What it is moved by is the *correction* that the pair asks for. In a right map
 * it is noise, or what this picture alone suffers from (rolling lines, blur, a thing that passes),
 * and serves no other pair. In a biased one it lasts. So half the mean correction of the pairs
 * before (which fades by .7 per pair) is tried on each new pair *before* that is fitted: by what
 * the cost of its matches falls there is *evidence* of a bias, by what it rises against one. The
 * sum fades likewise and is kept from falling below 0 (E. Page, "Continuous inspection schemes",
 * 1954).
 *
 * The cost is the sum of squared distances from epipolar lines in sigmas of half a pixel (of the
 * match's level), each at most 9; a match that the motion puts behind the camera has its distance
 * from the point at infinity. A difference of costs is twice the logarithm of a ratio of
 * likelihoods.
 *
 * The motion is biased where the evidence is 25 or more, of a map that has held for more than
 * twelve pairs 75, and the mean correction turns the way by more than 2 degrees: a smaller one is a
 * lens that is off a little, or a pull that the covariance counts (covariance.h). Matches are those
 * of up to 512 features, 160 to 200 on roads. Chosen on odd seeds of sim:road, where right maps had
 * up to 24; on the recordings corrections last for no more than two or three pairs.
 *
 * Plain data without addresses; real-time safe, bounded by the matches. */
#ifndef FOVEA_ODOMETRY_MOTION_BIAS_H
#define FOVEA_ODOMETRY_MOTION_BIAS_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/se3.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_MOTION_BIAS_PASSES = 8 }; /* of a fit: four units of a quarter of them */

/* One point in two views. */
struct fv_motion_bias_match {
    float x1[3], x2[3]; /* unit bearings */
    float weight;       /* 1 / sigma_px^2 of the second */
};

struct fv_motion_bias_state {
    /* faded sums over pairs: corrections (turn in rad, change of the direction of translation, both
     * in the second view's axes), and their number */
    double turn[3], way[3], pairs;
    double evidence;
    /* the pair in work: the map's motion and the fit so far (|t| = 1) */
    struct fv_se3 map, fit;
    double cost; /* of the map's motion */
    uint32_t pass;
    uint32_t seen; /* pairs of this map */
    uint32_t held; /* the turn of the pair in work was measured */
    uint32_t reserved;
};

/* Nothing is known of this map. */
void fv_motion_bias_forget(struct fv_motion_bias_state *state);
/* A pair begins, with its motion as the map has it (T_2_1); lengths do not matter. `held`: a gyro
 * has measured its turn. False: there is no translation, and nothing to fit. */
bool fv_motion_bias_begin(struct fv_motion_bias_state *state, const struct fv_se3 *T_2_1,
                          bool held);
/* The evidence of the pair's matches, and the first quarter of a fit; or the next one. True: the
 * pair is done, and its correction noted. */
bool fv_motion_bias_unit(struct fv_motion_bias_state *state,
                         const struct fv_motion_bias_match *matches, uint32_t count,
                         double focal_px);
/* Whether the motion is biased by what is known so far. */
bool fv_motion_bias_found(const struct fv_motion_bias_state *state);
/* Whether there is no hint of a bias, of whatever size. */
bool fv_motion_bias_clear(const struct fv_motion_bias_state *state);

#ifdef __cplusplus
}
#endif
#endif
