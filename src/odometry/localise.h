/* Localisation: the pose of a frame against the local map.
 *
 * The landmarks of the last frame are searched for where constant motion predicts them, then those
 * of the keyframes that share most landmarks with the frame; the pose is refined on both. Where
 * that fails, relocalisation takes over (relocalise.h). Bounded by the features and by
 * FV_LOCAL_LANDMARKS_MAX. Real-time safe. */
#ifndef FOVEA_ODOMETRY_LOCALISE_H
#define FOVEA_ODOMETRY_LOCALISE_H

#include "base/arena.h"
#include "geometry/pose.h"
#include "kernels/kernels.h"
#include "map/map.h"
#include "odometry/motion.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_LOCAL_KEYFRAMES_MAX = 12, FV_LOCAL_LANDMARKS_MAX = 3000 };

/* A landmark as the last frame saw it. */
struct fv_recent {
    uint32_t landmark, generation;
    uint32_t level;
};

struct fv_localise_state {
    struct fv_motion motion;
    struct fv_motion_hint hint; /* of the current frame */
    uint32_t recent_count;      /* landmarks of the last frame */
};

/* Matching of descriptors, by feature; frame part. */
struct fv_matches {
    uint16_t *distance;         /* of the match taken */
    uint32_t *nearest, *second; /* as hamming_two_u8 leaves them */
};

struct fv_localiser {
    struct fv_recent *recent;            /* persistent: localise.recent_count of them */
    struct fv_observation *observations; /* frame part: of the matched features */
    uint32_t *observed_feature;          /* frame part: feature of each observation */
    uint32_t *local;                     /* frame part: landmarks of the local map */
    /* frame part: of each observation; NULL: no features have distances */
    struct fv_inverse_distance *distances;
    /* They count: from when the frame's distances were judged until the next frame. A rough pose
     * for matching does without. */
    bool measures;
};

struct fv_odometry;

void fv_localiser_carve(struct fv_localiser *localiser, uint32_t features_max, bool distances,
                        struct fv_arena *persistent, struct fv_arena *frame);
void fv_matches_carve(struct fv_matches *matches, uint32_t features_max, struct fv_arena *frame);
/* Forget the frame's matches. */
void fv_matches_clear(const struct fv_matches *matches, const struct fv_map_frame *frame);

/* A key point that sees a point of the world. */
static inline void fv_observation_from(const struct fv_keypoint *p, const double point[3],
                                       struct fv_observation *s)
{
    for (int k = 0; k < 3; k++) {
        s->point[k] = point[k];
        s->bearing[k] = (double)p->bearing[k];
    }
    for (int k = 0; k < 6; k++)
        s->A[k] = (double)p->A[k];
    s->weight = (double)p->weight;
    s->inlier = true;
}

/* Pose of the current frame against the local map; number of inliers (0: failed). */
uint32_t fv_odometry_localise(struct fv_odometry *odometry, const struct fv_kernels *kernels);
/* Pieces that relocalisation shares: make observations of the matches, returning their number;
 * refine over them and forget those that do not fit; match the local map around them (`widen` times
 * the usual radius), returning the number of visible landmarks. */
uint32_t fv_localiser_collect(struct fv_localiser *localiser, const struct fv_map *map,
                              const struct fv_map_frame *frame);
uint32_t fv_localiser_refine(struct fv_localiser *localiser, const struct fv_map *map,
                             const struct fv_map_frame *frame, int rounds, int steps,
                             struct fv_se3 *T, struct fv_pose_fit *fit);
uint32_t fv_odometry_match_local(struct fv_odometry *odometry, const struct fv_kernels *kernels,
                                 const struct fv_map_frame *frame, const struct fv_se3 *T,
                                 double widen);

#ifdef __cplusplus
}
#endif
#endif
