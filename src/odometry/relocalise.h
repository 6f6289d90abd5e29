/* Finding the camera again in the maps that are kept, from the image alone.
 *
 * Keyframes enter the place index in units of the map's job. A lost frame is turned into words; the
 * keyframes most like it, of every map, are tried: landmarks seen by the keyframe and its
 * neighbours are matched by descriptor, a pose is sampled from three of them at a time, and
 * refined; then all landmarks of that part of the map are searched for where the pose predicts
 * them. The pose counts only with FV_RELOCALISED_INLIERS_MIN that agree, most of the matches: a
 * wrong place costs more than a frame without a pose.
 *
 * Bounded work per frame: at most FV_RELOCALISE_TRIES keyframes. Real-time safe. */
#ifndef FOVEA_ODOMETRY_RELOCALISE_H
#define FOVEA_ODOMETRY_RELOCALISE_H

#include "geometry/pose.h"
#include "map/map.h"
#include "map/place.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_RELOCALISE_TRIES = 3,
    FV_RELOCALISE_NEIGHBOURS = 4, /* of a candidate, whose landmarks are matched as well */
    FV_RELOCALISE_LANDMARKS = 1500,
    FV_RELOCALISED_INLIERS_MIN = 30,
    FV_RELOCALISED_INLIERS_MAX = 50 /* more are not asked for, however many features there are */
};

/* The keyframe that is entering the index. */
struct fv_index_state {
    struct fv_place_words words;
    uint32_t slot, generation;
    uint32_t next; /* feature */
    bool busy;
    uint8_t reserved[3];
};

struct fv_relocaliser {
    struct fv_place place;
    struct fv_index_state *index; /* persistent */
    struct fv_place_words *words; /* frame part: of the current frame */
    uint32_t *scores;             /* frame part */
    uint8_t *gathered;            /* frame part: descriptors of landmarks around a candidate */
};

struct fv_odometry;

void fv_relocaliser_carve(struct fv_relocaliser *relocaliser, uint32_t keyframes,
                          struct fv_arena *persistent, struct fv_arena *frame);
/* Forget all places. */
void fv_relocaliser_reset(struct fv_relocaliser *relocaliser);

/* Whether a keyframe waits to be indexed, and one unit of that work. */
bool fv_odometry_index_waiting(const struct fv_odometry *odometry);
void fv_odometry_index_unit(struct fv_odometry *odometry, const struct fv_kernels *kernels);

/* Pose of the current frame against the neighbourhood of one keyframe, without prediction: sampled,
 * refined, and verified by guided search. True: T and the frame's links to landmarks are set.
 */
bool fv_odometry_try_keyframe(struct fv_odometry *odometry, const struct fv_kernels *kernels,
                              uint32_t slot, struct fv_se3 *T, struct fv_pose_fit *fit);

/* The same against the keyframes most like the frame, of all maps. On success the keyframe found is
 * the newest: its map is the current one, and the frame's pose is bound to it. */
bool fv_odometry_relocalise(struct fv_odometry *odometry, const struct fv_kernels *kernels,
                            struct fv_se3 *T, struct fv_pose_fit *fit);

#ifdef __cplusplus
}
#endif
#endif
