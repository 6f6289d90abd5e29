/* A runtime whose map is as full as its capacities allow, and as unkind: every keyframe has all its
 * features in one cell of the grid, so that each search looks at all of them; levels are such that
 * the last CROWD_MATCHES of them alone may match; landmarks have as many observers as they
 * remember; descriptors of keyframes are all equal, and 40 bits from those of the current frame. */
#ifndef FOVEA_TESTS_BOUNDS_FULL_MAP_H
#define FOVEA_TESTS_BOUNDS_FULL_MAP_H

#include "fovea/fovea.h"
#include "runtime/state.h"

enum { CROWD_MATCHES = 96 }; /* candidates that a search takes at most (map/keyframe.c) */

/* A runtime of the configuration, from malloc; free(rt) gives it back. NULL, after a line on
 * stderr: refused. */
struct fovea *full_map_runtime(const struct fovea_config *config);
/* The cameras of a source. Ends the program, after a line on stderr, where it cannot be opened. */
struct fovea_rig full_map_rig(const char *uri);
/* The default configuration for the simulated camera of a size, with a detector. */
void full_map_config(struct fovea_config *config, int32_t width, int32_t height);

/* How features of a frame lie and match. */
struct crowd {
    uint32_t levels_high; /* of the features, the first, on the highest level; the others on 0 */
    float off_px;         /* by which those of the first `off` lie below the others */
    uint32_t off;
    uint8_t descriptor; /* every byte of all of them */
};

/* Fill the current frame, seen from place `place` of PLACES on an arc around the scene. */
enum { FULL_MAP_PLACES = 12 };
void full_map_view(struct fv_odometry *o, const struct crowd *crowd, uint32_t place);
/* The points of the scene that features of a frame see, by feature. */
void full_map_point(const struct fv_odometry *o, uint32_t feature, double point[3]);
/* Keyframes in all slots, each of which sees a landmark with every feature; a landmark has
 * `observers` of them, as far as slots of landmarks suffice. The newest keyframe is the last. */
void full_map_fill(struct fv_odometry *o, uint32_t observers);
/* The usual crowd of the current frame: levels high but for the last, 40 bits off. */
struct crowd full_map_crowd(const struct fv_odometry *o);
/* Make every landmark predict level 0 from level 7, which takes the longest. */
void full_map_far_levels(struct fv_odometry *o);

#endif
