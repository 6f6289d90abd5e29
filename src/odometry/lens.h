/* Whether the lens is still that of the calibration: the focal length that the pictures fit.
 *
 * Two measures, each the natural logarithm of (the focal length that fits / that of the
 * calibration) with its standard deviation. Both are Gauss-Newton steps from the present estimate
 * with the focal length freed, at which pixels move along the line through the principal point;
 * errors are those of the prediction, so that noise of the features pulls at neither.
 *
 * - Change (fv_lens_frame): pose and focal length of one frame, landmarks fixed. It is zero while
 *   the lens is the one that the map was made with, right or wrong, and shows a lens that was
 *   knocked in the first picture behind it; it fades as the map is made anew.
 * - Mismatch (fv_lens_window): poses of the newest keyframes, their landmarks (eliminated by the
 *   Schur complement) and the focal length: self-calibration, as in R. Hartley and A. Zisserman,
 *   "Multiple View Geometry" (2004), chapter 19. It shows a wrong calibration from the start.
 *   Motion along straight lines leaves it open, which the standard deviation states. A job in
 *   units.
 *
 * Real-time safe; no addresses in the state. */
#ifndef FOVEA_ODOMETRY_LENS_H
#define FOVEA_ODOMETRY_LENS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "map/map.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_LENS_KEYFRAMES = 8,
    FV_LENS_SIZE = 6 * FV_LENS_KEYFRAMES + 1, /* of the normal equations: poses, focal length */
    FV_LENS_FRAME_POINTS = 200 /* landmarks of a frame that the watch uses, at most */
};

struct fv_odometry;

/* ---- a frame --------------------------------------------------------------------------------- */

struct fv_lens_frame {
    double change, sigma;
    double sigma_unit; /* of errors of variance 1 px^2 */
    double moved[6];   /* what the pose moves by with that change, order as in fv_se3_move */
    double error2,
        error2_fitted; /* px^2, sums over `points`: as it is; focal length and pose freed */
    uint32_t points;
    uint32_t part_points[FV_MAP_PARTS]; /* by part of the image */
    float part_sum_px[FV_MAP_PARTS][2]; /* of seen - predicted, x y */
};

/* Measure the current frame as its pose and landmarks stand, by every `stride`-th of them, also
 * where the picture is weak. `distances`, unless NULL, are those that a second camera measured of
 * its features, whose lens is taken to change alike. Points at one depth tell nothing of the focal
 * length, and then the sigmas are large. False: it is not determined at all. */
bool fv_lens_frame_current(const struct fv_odometry *odometry,
                           const struct fv_inverse_distance *distances, uint32_t stride,
                           struct fv_lens_frame *frame);
/* The same of the last frame, by its pixels alone, of FV_LENS_FRAME_POINTS landmarks at most.
 * False: it has no pose, is frozen, or has too few landmarks. */
bool fv_lens_frame_measure(const struct fv_odometry *odometry, struct fv_lens_frame *frame);

/* ---- a window -------------------------------------------------------------------------------- */

enum fv_lens_phase { FV_LENS_IDLE = 0, FV_LENS_ADDING, FV_LENS_SOLVING };

struct fv_lens_window_state {
    uint32_t phase; /* enum fv_lens_phase */
    uint32_t next;  /* landmark slot */
    uint32_t points, observations;
    double cost;     /* weighted */
    uint64_t newest; /* number of the newest keyframe */
    uint32_t slots[FV_LENS_KEYFRAMES], generations[FV_LENS_KEYFRAMES];
    struct fv_se3 T_cam_world[FV_LENS_KEYFRAMES]; /* when it began */
};

struct fv_lens_window {
    struct fv_lens_window_state *state; /* job part, as are the next two */
    double *matrix;                     /* FV_LENS_SIZE squared, lower triangle */
    double *vector;
};

struct fv_lens_mismatch {
    double mismatch, sigma;
    uint64_t newest; /* number of the newest keyframe */
};

void fv_lens_window_carve(struct fv_lens_window *window, struct fv_arena *job);
/* Whether there are new keyframes enough since the one of number `newest`. */
bool fv_lens_window_due(const struct fv_odometry *odometry, uint64_t newest);
/* Begin with the newest keyframes of the map; idle where it has too few. Returns the number of the
 * newest. */
uint64_t fv_lens_window_begin(struct fv_lens_window *window, const struct fv_odometry *odometry);
/* One unit. True: done, and `found` is filled in; where keyframes moved meanwhile it begins again,
 * and where the window cannot be solved it becomes idle. */
bool fv_lens_window_unit(struct fv_lens_window *window, const struct fv_odometry *odometry,
                         struct fv_lens_mismatch *found);

/* ---- between the two files ------------------------------------------------------------------- */

/* Error of a point of the world as a feature sees it, and its derivatives: by a small motion of the
 * camera (translation first), the logarithm of the focal length, and the point. */
struct fv_lens_error {
    double error[2]; /* predicted - seen, px */
    double by[2][10];
    double weight; /* 1 / px^2 */
};
/* False: the camera cannot see the point. */
bool fv_lens_error(const struct fv_map *map, const struct fv_se3 *T_cam_world,
                   const double point[3], const struct fv_pixel *seen, struct fv_lens_error *error);

#ifdef __cplusplus
}
#endif
#endif
