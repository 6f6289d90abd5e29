/* Overlap of boxes that are turned about their centre.
 *
 * Each box is taken as the normal distribution with its centre and covariance, and the overlap is
 * one minus the Hellinger distance of two of them: ProbIoU (Llerena et al., "Gaussian Bounding
 * Boxes and Probabilistic Intersection-over-Union for Object Detection", arXiv:2106.06072), by
 * which YOLOv8's oriented boxes are suppressed. Real-time safe. */
#ifndef FOVEA_DETECT_TURNED_H
#define FOVEA_DETECT_TURNED_H

#include <stdbool.h>

#include "fovea/detect.h"

struct fv_turned {
    double x, y;    /* centre */
    double a, b, c; /* covariance: of x, of y, of both */
    double largest; /* no variance in any direction is above this */
};

struct fv_turned fv_turned_of(const struct fovea_detection *box);

/* Whether the overlap is above `least`, in [0, 1]. `cost` takes about how many comparisons of
 * upright boxes this takes as long as. */
bool fv_turned_overlaps(const struct fv_turned *one, const struct fovea_detection *other,
                        double least, int *cost);

#endif
