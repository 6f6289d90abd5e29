/* ORB: an orientation and a binary descriptor of 256 bits for each corner (Rublee, Rabaud, Konolige
 * and Bradski, "ORB: an efficient alternative to SIFT or SURF", ICCV 2011).
 *
 * Orientation is the direction from the corner to the intensity centroid of the circle of radius 15
 * around it. The descriptor compares 256 pairs of pixels of the smoothed level, their positions
 * turned by the orientation and rounded to whole pixels. Pattern, circle, smoothing (7x7 Gaussian,
 * sigma 2) and rounding are those of OpenCV's ORB. Given the same level and angle, descriptors
 * equal those made from cv::GaussianBlur's bit-exact result; cv::ORB itself blurs a sub-image,
 * which OpenCV does in floating point whose rounding differs between processors: there about one
 * grey level in 70 differs by 1. */
#ifndef FOVEA_FEATURES_ORB_H
#define FOVEA_FEATURES_ORB_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "features/spread.h"
#include "image/pyramid.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Corners closer than this to the border of their level have no whole patch. */
enum { FV_ORB_MARGIN_PX = 19 };

/* Orientation is one of this number of directions, 1.4 degrees apart (Rublee et al. take 30): then
 * the turned pattern is read from a table, and a quarter turn of it is a swap of coordinates. */
enum { FV_ORB_DIRECTIONS = 256, FV_ORB_QUARTER = FV_ORB_DIRECTIONS / 4 };

enum { FV_ORB_SAMPLES = 2 * FV_BRIEF_BITS };

/* Positions of the samples, x and y in turn, the first members of all pairs before the second ones.
 */
struct fv_orb_pattern {
    int8_t xy[2 * FV_ORB_SAMPLES];
};

struct fv_orb {
    uint32_t count_max;
    float *angle_rad;              /* of each corner, clockwise in the image from +x, (-pi, pi] */
    uint8_t *descriptors;          /* FV_DESCRIPTOR_BYTES each, 64-byte aligned */
    struct fv_orb_pattern *turned; /* the pattern in the directions of the first quarter */
    bool turned_ready;             /* filled by the first describe */
    bool upright;                  /* all orientations are 0; set after carving */
    uint8_t *smooth;     /* the smoothed level in work; rows far from corners are undefined */
    uint8_t *row_needed; /* one flag per row of it */
    uint16_t *row;       /* scratch of the blur */
};

/* Take memory for `count_max` corners in a pyramid of this size. Fills sizes and addresses only.
 * Init-only.
 */
void fv_orb_carve(struct fv_orb *orb, uint32_t count_max, const struct fv_pyramid *pyramid,
                  struct fv_arena *frame);

/* Fill orb->angle_rad and orb->descriptors for corners[0 .. count - 1]; count <= count_max. Corners
 * of a level must follow each other and keep FV_ORB_MARGIN_PX from its border. Real-time safe;
 * cost: smoothing of the rows that corners need, at most all pixels of the pyramid, and a constant
 * per corner. */
void fv_orb_describe(struct fv_orb *orb, const struct fv_kernels *kernels,
                     const struct fv_pyramid *pyramid, const struct fv_corner *corners,
                     uint32_t count);

/* Direction of the centroid with the moments m10, m01 (|m| < 2^31): the nearest of
 * FV_ORB_DIRECTIONS, counted from +x towards +y; 0 where both are 0. Integer only. */
uint8_t fv_orb_direction(int32_t m10, int32_t m01);

/* Angle of a direction, (-pi, pi]. */
float fv_orb_angle(uint8_t direction);

/* The pattern turned by an angle, rounded to whole pixels with OpenCV's arithmetic and so to the
 * same pixels.
 */
void fv_orb_turn(float angle_rad, struct fv_orb_pattern *turned);

/* The unturned positions: x of all samples, then y of all. */
extern const int8_t fv_orb_places[2][FV_ORB_SAMPLES];

#ifdef __cplusplus
}
#endif
#endif
