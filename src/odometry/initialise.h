/* Initialisation: the first map, from several views.
 *
 * The last frames are held as waiting views, thinned out as the wait grows. Each new frame is
 * matched against the oldest of them. Two-view geometry gives a few motions that may explain the
 * matches (initialise_motions.c); each is bundled over the views in between (initialise_bundle.c),
 * and the best is noted as the first guess of the next frame's bundle, which costs little. Motions
 * are sampled anew every few frames, and when that guess would serve. The best is taken when it is
 * clearly the best, fits, explains far more than turning alone, leaves little open, and its errors
 * are noise rather than of all sizes; otherwise initialisation goes on waiting. So a turn on the
 * spot, a view without parallax and the wrong one of two motions that a plane allows are waited out
 * instead of guessed. */
#ifndef FOVEA_ODOMETRY_INITIALISE_H
#define FOVEA_ODOMETRY_INITIALISE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "base/elementary.h"
#include "geometry/essential.h"
#include "geometry/se3.h"
#include "geometry/vec.h"
#include "map/map.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_INITIALISE_MIDDLE_MAX = 3, /* views between the first and the last that take part */
    FV_INITIALISE_VIEWS_MAX = FV_INITIALISE_MIDDLE_MAX + 2,
    FV_INITIALISE_MOTIONS_MAX = 4,
    FV_INITIALISE_POINTS_MIN = 50, /* with enough parallax */
    FV_INITIALISE_PARALLAX_PX = 4  /* that is enough: angle between rays times focal length; a match
                                 is  good to half a pixel */
};

struct fv_initialise_state {
    uint32_t count;  /* views held, oldest first */
    uint32_t stride; /* frames between them */
    uint32_t slots[FV_MAP_WAITING_MAX];
    uint64_t frames[FV_MAP_WAITING_MAX]; /* their numbers */
    uint64_t sampled; /* number of the frame in which motions were last sampled */
    uint64_t
        guessed; /* number of the first view that `guess` and initialiser->guessed_depth hold for */
    struct fv_se3 guess; /* of the newest view */
    /* number of the first view that the links of a view's features lead
     * to; 0: none */
    uint64_t matched[FV_MAP_WAITING_MAX];
};

/* What one pair of the first and the last view is seen as, by view; FV_MAP_NONE: not found there.
 */
struct fv_feature_track {
    int32_t feature[FV_INITIALISE_VIEWS_MAX];
};

/* The views of an initialisation, the first one the reference, and the result of bundling. */
struct fv_initialise_bundle {
    uint32_t view_count;
    uint32_t slots[FV_INITIALISE_VIEWS_MAX];
    double fraction[FV_INITIALISE_VIEWS_MAX]; /* of the time between the first and the last */
    struct fv_se3 T_view_first[FV_INITIALISE_VIEWS_MAX]; /* |t| of the last is 1 */
    double cost;                                         /* robust, over all tracks */
    double noise; /* of an error, in sigmas of its key points */
    /* rad, of the last view's direction from the first: by noise, and by what parts
     * of the image pull to either side */
    double direction_sigma;
    /* that fit in all their views; of these with enough parallax to be landmarks */
    uint32_t points, parallax_points;
};

/* Inverse depth of a track along the first view's bearing, in units of the bundle, and what
 * adjusting it needs. */
struct fv_initialise_depth {
    double value, before;
    double inverse, gradient; /* of its damped 1x1 block, which is eliminated */
    double cross[6 * (FV_INITIALISE_VIEWS_MAX - 1)]; /* blocks between it and the views */
};

/* Addresses of what initialisation works on; the caller keeps the map. */
struct fv_initialiser {
    struct fv_map *map;
    double focal_px;
    struct fv_initialise_state *state; /* persistent */
    float *guessed_depth;            /* persistent: inverse depths, by feature of the first view */
    struct fv_pair *pairs;           /* frame part */
    struct fv_feature_track *tracks; /* frame part: of each pair */
    struct fv_initialise_depth *depths; /* frame part: of each track */
    uint8_t *inlier;                    /* frame part: of each pair or track */
};

void fv_initialiser_carve(struct fv_initialiser *initialiser, struct fv_map *map, double focal_px,
                          uint32_t features_max, struct fv_arena *persistent,
                          struct fv_arena *frame);

/* Inverse depth (of |t|) at which a motion sees the first ray of a pair nearest the second; 0, far
 * away, where noise has turned nearly parallel rays apart. False: the pair does not fit the motion.
 */
bool fv_initialise_inverse_depth(const struct fv_initialiser *initialiser,
                                 const struct fv_pair *pair, const struct fv_se3 *T_last_first,
                                 double *inverse_depth);
/* Angle between the rays of the first and the last view to a point, times the focal length. */
double fv_initialise_parallax_px(const struct fv_initialiser *initialiser,
                                 const struct fv_pair *pair, const struct fv_se3 *T_last_first,
                                 double inverse_depth);

/* Motions (T_last_first, |t| = 1) that may explain initialiser->pairs, best first; returns their
 * number. */
uint32_t fv_initialise_motions(struct fv_initialiser *initialiser, struct fv_random *random,
                               uint32_t count, struct fv_se3 T[FV_INITIALISE_MOTIONS_MAX]);

/* Whether two bundles ended at the same motion. */
bool fv_initialise_same(const struct fv_initialise_bundle *a, const struct fv_initialise_bundle *b);

/* First guesses of the bundle's poses and of initialiser->depths. False: too little fits.
 * From a motion of the last view: */
bool fv_initialise_guess_motion(struct fv_initialiser *initialiser, uint32_t count,
                                const struct fv_se3 *T_last_first,
                                struct fv_initialise_bundle *bundle);
/* From what was noted for the same first view a few frames ago: */
bool fv_initialise_guess_again(struct fv_initialiser *initialiser, uint32_t count,
                               struct fv_initialise_bundle *bundle);
/* From a bundle that was noted, its reversal: what is near becomes far, the way turns round, and a
 * turn makes up for it. Of a shallow scene both are seen almost alike (J. Koenderink and A. van
 * Doorn, "Affine structure from motion", 1991). */
bool fv_initialise_guess_reversed(struct fv_initialiser *initialiser, uint32_t count,
                                  struct fv_initialise_bundle *bundle);
/* Note a bundle of the first `count` of `all` tracks; `now`: number of the current frame. */
void fv_initialise_note_guess(struct fv_initialiser *initialiser, uint64_t now, uint32_t count,
                              uint32_t all, const struct fv_initialise_bundle *bundle);

/* How far off a first guess may be. */
enum fv_initialise_trust {
    FV_INITIALISE_ROUGH = 0,
    FV_INITIALISE_FAIR = 1,
    FV_INITIALISE_FINE = 2,
    FV_INITIALISE_SURE = 3
};

/* Adjust poses and points of the tracks together, from a first guess. Errors count less and less
 * beyond a limit, which in the end is that of the noise found: a thing that moves along its
 * epipolar lines nearly fits, and would bend a bundle of little parallax. Afterwards the last view
 * is at distance 1, initialiser->depths holds the points by track, and ->inlier tells which fit in
 * all their views. */
void fv_initialise_adjust(struct fv_initialiser *initialiser, uint32_t count,
                          enum fv_initialise_trust trust, struct fv_initialise_bundle *bundle);
/* Cost of the tracks when the views do no more than turn: what a bundle must beat. Uses up
 * initialiser->depths.
 */
double fv_initialise_turn_cost(struct fv_initialiser *initialiser, uint32_t count,
                               const struct fv_initialise_bundle *bundle);

/* Of the tracks that fit to four times the limit that the noise found sets, the fraction that fits
 * to the limit itself. Where the bundle is right, errors are noise and the rest is mismatches and
 * things that move, far off: the fraction is high whatever the noise. A bundle that is bent between
 * two motions has errors of all sizes. After fv_initialise_adjust. */
double fv_initialise_fit_clarity(const struct fv_initialiser *initialiser, uint32_t count,
                                 const struct fv_initialise_bundle *bundle);

/* Whether a track's point is fit to be a landmark: it fits in all its views, and has parallax. */
bool fv_initialise_point_serves(const struct fv_initialiser *initialiser,
                                const struct fv_initialise_bundle *bundle, uint32_t track);

#ifdef __cplusplus
}
#endif
#endif
