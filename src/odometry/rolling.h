/* Rolling shutter: the rows of a picture are exposed one after the other, so that each feature
 * shows the world from where the camera was at its row's instant. A frame's stamp is the middle
 * row's. Before the map takes them, features are moved to where a camera that exposes all rows at
 * that instant would have seen them, so that all that follows is of one pose:
 *
 *   p = exp(rate dt) q + velocity dt,    dt = (y / height - 1/2) readout,
 *
 * q being the point in the camera at the row's instant, p at the stamp. The turn is that of the
 * inertial sensor, the velocity that of the last two posed frames, or of the sensor where it knows
 * it, in the map's unit. q is the bearing times the measured distance, or times the median depth of
 * the last frame where there is none: what is much nearer keeps an error of velocity dt over its
 * depth. Both are taken as constant over the readout. Real-time safe, any thread. */
#ifndef FOVEA_ODOMETRY_ROLLING_H
#define FOVEA_ODOMETRY_ROLLING_H

#include "fovea/features.h"
#include "odometry/odometry.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_rolling {
    double readout_s; /* from the exposure of the first row to that of the last */
    double rate[3];   /* of the camera in its own axes, rad/s */
};

/* `placed`: input->count features, those of the input moved; at most to the edge of the picture.
 * Before fv_odometry_step, which still needs the last frame. */
void fv_odometry_place(const struct fv_odometry *odometry, const struct fv_rolling *rolling,
                       const struct fv_odometry_input *input, struct fovea_feature *placed);

#ifdef __cplusplus
}
#endif
#endif
