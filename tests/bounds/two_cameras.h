/* Two cameras side by side, and features of both that are as hard to match as any. */
#ifndef FOVEA_TESTS_BOUNDS_TWO_CAMERAS_H
#define FOVEA_TESTS_BOUNDS_TWO_CAMERAS_H

#include "fovea/fovea.h"
#include "runtime/state.h"

/* The default configuration for the simulated pair of cameras of a size. */
void two_cameras_config(struct fovea_config *config, int32_t width, int32_t height);
/* Features in the front ends of both: those of the first all at one place, those of the second as
 * many as a search looks at, on and beside its curve, the last of them candidates; all alike, on
 * pictures of noise. */
void two_cameras_see(struct fovea *rt, struct fv_stereo_view views[FV_STEREO_CAMERAS]);

#endif
