/* Loop closing and merging of maps; a job of low priority.
 *
 * A keyframe that has entered the place index is offered. Keyframes that look like it, but share no
 * landmark with it, are tried in turn: features with landmarks are matched by descriptor, a
 * similarity between the two cameras is sampled and refined, then the landmarks around the
 * candidate are searched for where it predicts them in the keyframe's image. What agrees is a
 * sighting. A loop is believed when FV_LOOP_SIGHTINGS keyframes have sighted the same correction of
 * the map, those before the offered one or those after it, and the correction is no larger than
 * drift can be and more certain than a turn of a degree. Precision comes before recall: a false
 * loop ruins a map, a missed one comes again.
 *
 * Within one map, the keyframes' poses are then optimised over the essential graph (pose_graph.h):
 * parents, strong neighbours, all loops. Between two maps, the younger one is taken to the world of
 * the older one as a whole. The commit is one bounded unit: keyframes move by their own correction
 * (those made since by that of the nearest ancestor that has one), landmarks with their reference
 * keyframe, the frame in work with its parent; the jump goes to S_map_odom, so that the pose in
 * `odom` does not. Then landmarks that are the same thing are fused.
 *
 * Steps after R. Mur-Artal, J. Montiel, J. Tardos, "ORB-SLAM" (T-RO 2015), section VII, and C.
 * Campos et al., "ORB-SLAM3" (T-RO 2021), section VI. State holds no addresses. Real-time safe;
 * every unit is bounded. */
#ifndef FOVEA_MAP_LOOP_H
#define FOVEA_MAP_LOOP_H

#include "fovea/camera.h"
#include "map/map.h"
#include "map/place.h"
#include "map/pose_graph.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_LOOP_CANDIDATES_MAX = 3, /* keyframes tried for one that is offered */
    FV_LOOP_GROUP_MAX = 2000,   /* landmarks around a candidate */
    FV_LOOP_NEIGHBOURS = 6,     /* keyframes around a candidate */
    FV_LOOP_FUSED_INTO = 8,     /* keyframes that the group is fused into */
    FV_LOOP_HELD_BY_KEYFRAME =
        5, /* edges of the graph: to its parent and the neighbours that share most with it */
    FV_LOOP_SIGHTINGS = 3
};

enum fv_loop_phase {
    FV_LOOP_IDLE = 0,
    FV_LOOP_MATCH = 1,  /* descriptors of the keyframe's landmarks against the candidate's */
    FV_LOOP_SAMPLE = 2, /* similarities from three matches */
    FV_LOOP_REFINE = 3, /* the best of them, then the landmarks around the candidate are gathered */
    FV_LOOP_GUIDED = 4, /* the group's landmarks in the keyframe's image */
    FV_LOOP_BEFORE = 5, /* the same in keyframes made before it */
    FV_LOOP_GRAPH = 6,  /* the essential graph, some keyframes per unit */
    FV_LOOP_SOLVE = 7,
    FV_LOOP_COMMIT = 8,
    FV_LOOP_FUSE = 9
};

/* A keyframe, named so that its absence can be found out. */
struct fv_loop_name {
    uint32_t slot, generation;
};

/* A correction that was sighted and waits for more sightings. */
struct fv_loop_belief {
    struct fv_loop_name candidate;
    struct fv_sim3
        correction;     /* takes the world of the offered keyframe to that of the candidate */
    uint64_t number;    /* of the last keyframe that sighted it */
    uint32_t sightings; /* 0: nothing is believed */
    uint32_t reserved;
};

struct fv_loop_closer_counts {
    uint32_t offered, tried, sampled, sighted, implausible, closed, merged;
    uint32_t fused; /* landmarks */
};

struct fv_loop_state {
    enum fv_loop_phase phase;
    uint32_t candidate_count, candidate; /* the one that is tried */
    struct fv_loop_name keyframe, candidates[FV_LOOP_CANDIDATES_MAX];
    struct fv_loop_belief belief;
    struct fv_sim3 S_keyframe_candidate; /* cameras */
    struct fv_sim3 correction;
    struct fv_sim3_search search;
    struct fv_random random;
    uint32_t next; /* item of the phase */
    uint32_t query_count, train_count, correspondence_count, group_count;
    uint32_t inliers;           /* of the similarity as it is refined */
    uint32_t visible, found;    /* of the guided search */
    struct fv_loop_name before; /* keyframe that is asked after the offered one */
    uint32_t asked, seen_before;
    uint32_t fuse_count, fuse_at;
    struct fv_loop_name fuse_into[FV_LOOP_FUSED_INTO];
    struct fv_loop_closer_counts counts;
};

struct fv_loop_closer {
    const struct fovea_camera *camera;
    struct fv_loop_state *state;
    struct fv_pose_graph graph;
    /* Job part. */
    uint16_t *query_feature, *train_feature;
    uint8_t *queries, *trains; /* descriptors */
    uint32_t *nearest, *second, *best_of_train;
    struct fv_correspondence *correspondences;
    struct fv_loop_name *group;  /* landmarks around the candidate */
    int16_t *node_of;            /* node of the graph, by keyframe slot */
    struct fv_loop_name *nodes;  /* keyframes of the graph's nodes */
    struct fv_sim3 *corrections; /* by keyframe slot, and of the current frame; takes the old world
                                    to the new */
    uint8_t *corrected;
    uint32_t *scores;
};

/* `camera` stays the caller's and must be set again after a copy, as carving does. */
void fv_loop_carve(struct fv_loop_closer *loop, const struct fv_map_limits *limits,
                   const struct fovea_camera *camera, struct fv_arena *persistent,
                   struct fv_arena *job);
/* Forget what was sighted and drop the work in progress. */
void fv_loop_reset(struct fv_loop_closer *loop, uint64_t seed);

/* Offer a keyframe whose words were just indexed; passed over while the job is busy. One unit of
 * work. */
void fv_loop_offer(struct fv_loop_closer *loop, const struct fv_map *map,
                   const struct fv_place *place, const struct fv_place_words *words, uint32_t slot);
bool fv_loop_waiting(const struct fv_loop_closer *loop);

/* What a unit did to the map. */
struct fv_loop_outcome {
    bool committed; /* the map moved: windows in work no longer fit it */
    bool fused;     /* the last unit of fusing: a window around the newest keyframe is of use */
    struct fv_sim3 S_new_current; /* takes the old world of the current frame to the new one */
};

/* One unit, at most about 0.25 ms; the commit longer, in proportion to the pools. True when units
 * are left.
 */
bool fv_loop_unit(struct fv_loop_closer *loop, struct fv_map *map, const struct fv_kernels *kernels,
                  struct fv_loop_outcome *outcome);

/* ---- between the files of the job ------------------------------------------------------------ */

bool fv_loop_named(const struct fv_map *map, struct fv_loop_name name);
/* Camera a's side of a correspondence, or camera b's: the landmark of a feature in its frame, and
 * what the feature says of it. */
void fv_loop_side_a(const struct fv_map *map, const struct fv_view *view, uint32_t feature,
                    struct fv_correspondence *m);
void fv_loop_side_b(const struct fv_map *map, const struct fv_view *view, uint32_t feature,
                    struct fv_correspondence *m);
/* Standard deviation of a landmark's distance, relative, by its parallax; A and weight: of an
 * observation of it. */
double fv_loop_distance_sigma(const struct fv_landmark *l, const double A[6], double weight);
/* Search the group's landmarks in a keyframe that S_keyframe_candidate is said to hold for, from
 * state->next on, in one unit; counts into visible and found, and fills correspondences where the
 * feature has a landmark itself. True when done. */
bool fv_loop_search_group(struct fv_loop_closer *loop, const struct fv_map *map,
                          const struct fv_kernels *kernels, uint32_t slot,
                          const struct fv_sim3 *S_keyframe_candidate);
/* Whether drift may have been that large. */
bool fv_loop_plausible(const struct fv_map *map, uint32_t keyframe, uint32_t candidate,
                       const struct fv_sim3 *correction);
/* Fill the graph from state->next on; true when done. */
bool fv_loop_graph_unit(struct fv_loop_closer *loop, const struct fv_map *map);
void fv_loop_graph_begin(struct fv_loop_closer *loop, const struct fv_map *map);
void fv_loop_commit(struct fv_loop_closer *loop, struct fv_map *map,
                    struct fv_loop_outcome *outcome);
bool fv_loop_fuse_unit(struct fv_loop_closer *loop, struct fv_map *map,
                       const struct fv_kernels *kernels);

#ifdef __cplusplus
}
#endif
#endif
