/* The start: the first map, from several views.
 *
 * The last frames are held as waiting views, thinned out as the wait grows. Each new frame is matched against
 * the oldest of them. Two-view geometry gives a few motions that may explain the matches (start_motions.c);
 * each is bundled over the views in between (start_bundle.c), and the best is taken when it is clearly the
 * best, fits, and leaves little open; otherwise the start goes on waiting. So a turn on the spot, a view
 * without parallax and the wrong one of two motions that a plane allows are waited out instead of guessed. */
#ifndef FOVEA_ODOMETRY_START_H
#define FOVEA_ODOMETRY_START_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/essential.h"
#include "geometry/se3.h"
#include "map/map.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_START_MIDDLE_MAX = 3, /* views between the first and the last that take part */
    FV_START_VIEWS_MAX = FV_START_MIDDLE_MAX + 2,
    FV_START_MOTIONS_MAX = 3,
    FV_START_POINTS_MIN = 50, /* with enough parallax */
    FV_START_PARALLAX_PX =
        4 /* that is enough: angle between rays times focal length; a match is good to half a pixel */
};

struct fv_odometry;

struct fv_start_state {
    uint32_t count;  /* views held, oldest first */
    uint32_t stride; /* frames between them */
    uint32_t slots[FV_MAP_WAITING_MAX];
    uint64_t frames[FV_MAP_WAITING_MAX]; /* their numbers */
};

/* What one pair of the first and the last view is seen as, by view; FV_MAP_NONE: not found there. */
struct fv_track {
    int32_t feature[FV_START_VIEWS_MAX];
};

/* The views of a start, the first one the reference, and what bundling made of them. */
struct fv_start_bundle {
    uint32_t view_count;
    uint32_t slots[FV_START_VIEWS_MAX];
    double share[FV_START_VIEWS_MAX];               /* of the time between the first and the last */
    struct fv_se3 T_view_first[FV_START_VIEWS_MAX]; /* median depth 1 */
    double cost;                                    /* robust, over all tracks */
    double direction_sigma;                         /* rad, of the last view's direction from the first */
    uint32_t points,
        parallax_points; /* that fit in all their views; of these with enough parallax to start on */
};

/* Where a motion puts the point of a pair, in the first view's frame. Noise alone may turn rays that are
 * nearly parallel apart: such a point is far away, if it is seen where a far point must be. False: the pair
 * does not fit the motion. */
bool fv_start_place_point(const struct fv_odometry *odometry, const struct fv_pair *pair,
                          const struct fv_se3 *T_last_first, double point[3]);
/* Angle between the rays of the first and the last view to a point, times the focal length. */
double fv_start_parallax_px(const struct fv_odometry *odometry, const struct fv_se3 *T_last_first,
                            const double point[3]);

/* Motions (T_last_first, |t| = 1) that may explain odometry->pairs, best first; returns their number. */
uint32_t fv_start_motions(struct fv_odometry *odometry, uint32_t count,
                          struct fv_se3 T[FV_START_MOTIONS_MAX]);

/* Whether two bundles ended at the same motion. */
bool fv_start_same(const struct fv_start_bundle *a, const struct fv_start_bundle *b);

/* Adjust poses and points of the tracks together, from a motion of the last view. False when it does not hold
 * together. Points are in window.landmarks[].before, by track. */
bool fv_start_adjust(struct fv_odometry *odometry, uint32_t count, const struct fv_se3 *T_last_first,
                     struct fv_start_bundle *bundle);
/* Whether a track's point is fit to be a landmark: it fits in all its views, and has parallax. */
bool fv_start_point_serves(const struct fv_odometry *odometry, const struct fv_start_bundle *bundle,
                           uint32_t track);

#ifdef __cplusplus
}
#endif
#endif
