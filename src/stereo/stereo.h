/* Stereo: how far the features of one camera are, by a second camera at a known place.
 *
 * Both images stay as they are: nothing is rectified, and any pair of calibrated cameras with a
 * common view serves, whatever their lenses, sizes and directions. A ray of the first camera is a
 * curve in the second image, and a half-plane of rays that ends in the line through both cameras'
 * centres. So candidates for a match are the features of the second camera whose bearings lie in
 * the ray's plane; they are found by its angle around that line, in bins (candidates.c). The
 * nearest by descriptor is taken when it is clearly nearer than any other place on the curve, and
 * no other feature of the first camera is nearer to it.
 *
 * Each match is refined along the curve: a patch around the feature, warped as the two cameras see
 * a surface across the ray, is aligned with the second image by Gauss-Newton steps on the inverse
 * distance, gain and offset of the brightness left free (align.c; B. Lucas and T. Kanade, 1981; S.
 * Baker and I. Matthews, "Lucas-Kanade 20 years on", IJCV 2004, inverse compositional). Its
 * uncertainty follows from what is left of the difference, the contrast along the curve, and a
 * floor.
 *
 * Distances are in metres along the ray from the first camera's centre, as inverse distances
 * (geometry/inverse_distance.h). Knows no map. State holds no addresses; nothing lives from frame
 * to frame. Integer sums and fixed orders: the same bits on every machine. */
#ifndef FOVEA_STEREO_STEREO_H
#define FOVEA_STEREO_STEREO_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "fovea/camera.h"
#include "fovea/features.h"
#include "geometry/bearing.h"
#include "geometry/inverse_distance.h"
#include "geometry/se3.h"
#include "image/pyramid.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_STEREO_CAMERAS = 2,
    FV_STEREO_BINS = 1024,          /* of the angle around the baseline: 0.2 to 0.45 degrees each */
    FV_STEREO_CANDIDATES_MAX = 128, /* of one feature; one with more is not matched */
    FV_STEREO_LOOKED_MAX = 512,     /* features in the bins of one, likewise */
    /* of a frame, spread over its matches: the pose gains next to nothing by more, and each costs
     * as much as finding a feature */
    FV_STEREO_ALIGNED_MAX = 400
};

/* Between the centres: nearer cameras measure nothing. */
#define FV_STEREO_BASELINE_MIN_M 0.005

/* What a camera saw, as its front end gives it. */
struct fv_stereo_view {
    const struct fv_pyramid *pyramid;
    uint32_t count;
    const struct fovea_feature *features;
    const uint8_t *descriptors; /* 32 bytes each */
};

struct fv_stereo {
    const struct fovea_camera *camera[FV_STEREO_CAMERAS]; /* the caller's */
    struct fv_se3 T_1_0; /* takes points of the first camera to the second */
    double baseline_m;
    double axis[3], ahead[3], aside[3]; /* of the second camera: along the baseline, and across */
    double focal_px[FV_STEREO_CAMERAS]; /* mean */
    uint32_t features_max;
    struct fv_bearing_table table[FV_STEREO_CAMERAS];
    struct fv_ray *ray;                 /* frame part: of each feature of the first camera */
    float (*bearing)[3];                /* frame part: of each feature of the second; 0 0 0: none */
    uint16_t *bin_of;                   /* frame part: of each feature of the second */
    uint16_t *first;                    /* frame part: in `order`, by bin, then their number */
    uint16_t *order;                    /* frame part: features of the second camera, bin by bin */
    uint16_t *match, *distance, *owner; /* frame part: of the first, of the first, of the second */
    struct fv_inverse_distance *measured; /* frame part: of each feature of the first camera */
    struct fovea_feature *moved; /* frame part: those of the second (fv_stereo_stand_in), */
    uint8_t *moved_descriptors;  /* 32 bytes each */
};

/* Whether two cameras can measure distances: calibrated, at known places, far enough apart. */
bool fv_stereo_serves(const double T_body_cam0[12], const double T_body_cam1[12]);

/* Take memory for `features_max` features of either camera. Fills sizes and addresses only. The
 * cameras stay the caller's. Init-only. */
void fv_stereo_carve(struct fv_stereo *stereo, const struct fovea_camera *camera0,
                     const struct fovea_camera *camera1, const double T_body_cam0[12],
                     const double T_body_cam1[12], uint32_t features_max,
                     struct fv_arena *persistent, struct fv_arena *frame);
/* Fill the tables of bearings. Init-only. */
void fv_stereo_init(struct fv_stereo *stereo);

/* Measure the features of the first view: stereo->measured by feature, weight 0 where nothing is
 * measured. Returns how many are. Real-time safe; time in proportion to the features, for each
 * at most FV_STEREO_LOOKED_MAX looked at, FV_STEREO_CANDIDATES_MAX comparisons and five alignments
 * of 64 pixels. */
uint32_t fv_stereo_measure(struct fv_stereo *stereo, const struct fv_kernels *kernels,
                           const struct fv_stereo_view view[FV_STEREO_CAMERAS]);

/* Where the first camera shows nothing: the second's features as a camera with the lens and the
 * attitude of the first would see them from the second's place, in stereo->moved with their
 * descriptors. Returns how many; what that camera would not show is left out. Real-time safe. */
uint32_t fv_stereo_stand_in(struct fv_stereo *stereo, const struct fv_stereo_view *second);
/* The second camera's place in the first one's axes, metres. */
void fv_stereo_centre(const struct fv_stereo *stereo, double centre[3]);

/* ---- between the files of the room ----------------------------------------------------------- */

#define FV_STEREO_NONE 0xffff

/* Where the point of a ray at an inverse distance lies in the second image. */
struct fv_stereo_place {
    double pixel[2]; /* raw image */
    double along[2]; /* d(pixel)/d(inverse distance), px m */
    double J[6];     /* d(pixel)/d(point) at R b + value t */
};

/* R b, which is where the ray points from the second camera. */
static inline void fv_stereo_turn(const struct fv_stereo *stereo, const double bearing[3],
                                  double turned[3])
{
    fv_rotate3(stereo->T_1_0.R, bearing, turned);
}

/* False: the second camera does not see it. */
bool fv_stereo_project(const struct fv_stereo *stereo, const double turned[3], double value,
                       struct fv_stereo_place *place);

/* Sort the features of the second view by bin. */
void fv_stereo_sort(struct fv_stereo *stereo, const struct fv_stereo_view *view);
/* Match the features of the first view: stereo->match, FV_STEREO_NONE where there is none. Returns
 * how many have one. */
uint32_t fv_stereo_match(struct fv_stereo *stereo, const struct fv_kernels *kernels,
                         const struct fv_stereo_view view[FV_STEREO_CAMERAS]);
/* Inverse distance of a ray by a bearing of the second camera, the nearest of the ray's plane. */
double fv_stereo_intersect(const struct fv_stereo *stereo, const double turned[3],
                           const float bearing[3]);
/* Refine the match of a feature. False: the patches do not agree. */
bool fv_stereo_align(const struct fv_stereo *stereo,
                     const struct fv_stereo_view view[FV_STEREO_CAMERAS], uint32_t feature,
                     uint32_t other, struct fv_inverse_distance *measured);

#ifdef __cplusplus
}
#endif
#endif
