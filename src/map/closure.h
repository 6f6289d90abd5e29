/* Closures: loops of the path that are closed, and maps that are merged; a job of low priority.
 *
 * A keyframe that has entered the place index is offered. Keyframes that look like it, but share no
 * landmark with it, are tried in turn: features with landmarks are matched by descriptor, a
 * similarity between the two cameras is sampled and refined, then the landmarks around the
 * candidate are searched for where it predicts them in the keyframe's image. What agrees is a
 * confirmation. A closure is accepted when FV_CLOSURE_CONFIRMATIONS keyframes have confirmed the
 * same correction of the map, those before the offered one or those after it, and the correction is
 * no larger than drift can be and more certain than a turn of a degree. Precision comes before
 * recall: a false closure ruins a map, a missed one comes again.
 *
 * Within one map, the keyframes' poses are then optimised over the essential graph (pose_graph.h):
 * parents, strong neighbours, all closures. Between two maps, the younger one is taken to the world
 * of the older one as a whole. In maps whose unit is the metre by two cameras (fv_map_metric_of)
 * corrections are motions, of 6 degrees of freedom, and where the landmarks say that the scale is
 * not 1, the place is another. A map of another unit that one in metres meets comes to metres: when
 * it is the older one, its lengths change, and origin and axes stay.
 *
 * Where the maps of both keyframes know gravity to 20 mrad (fv_map_upright: a unit vector in the
 * axes of the map, its standard deviation in rad), corrections keep it. The relation is levelled:
 * turned so that it takes gravity in the one camera to gravity in the other, and refined in what
 * that leaves open. Keyframes turn about gravity alone (pose_graph.h), and so does the younger of
 * two maps against the older one. In metres by two cameras that leaves 4 degrees of freedom, yaw
 * and position, as in T. Qin, P. Li, S. Shen, "VINS-Mono" (T-RO 2018). In a map by one camera the
 * scale is a fifth, also where an inertial sensor has shown its metres: its unit drifts on the way,
 * and closures that hold it leave keyframes off by 1.2 to 4 times as much (sim:corridor). A
 * relation that tilts the ends by more than gravity is known to, or in which the metres of two maps
 * differ by a fifth more than three of their standard deviations, is another place. A map that
 * knows nothing of gravity learns it from the one that it is merged with by all its degrees of
 * freedom.
 *
 * The commit is one bounded unit: keyframes move by their own correction (those made since by that
 * of the nearest ancestor that has one), landmarks with their reference keyframe, the frame in work
 * with its parent; the jump goes to S_map_world, so that the pose in `odom` does not. Then
 * landmarks that are the same thing are fused.
 *
 * Steps after R. Mur-Artal, J. Montiel, J. Tardos, "ORB-SLAM" (T-RO 2015), section VII, and C.
 * Campos et al., "ORB-SLAM3" (T-RO 2021), section VI. State holds no addresses. Real-time safe;
 * every unit is bounded. */
#ifndef FOVEA_MAP_CLOSURE_H
#define FOVEA_MAP_CLOSURE_H

#include "map/map.h"
#include "map/place.h"
#include "map/pose_graph.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_CLOSURE_CANDIDATES_MAX = 3, /* keyframes tried for one that is offered */
    FV_CLOSURE_GROUP_MAX = 2000,   /* landmarks around a candidate */
    FV_CLOSURE_NEIGHBOURS = 6,     /* keyframes around a candidate */
    FV_CLOSURE_FUSED_INTO = 8,     /* keyframes that the group is fused into */
    FV_CLOSURE_HELD_BY_KEYFRAME =
        5, /* edges of the graph: to its parent and the neighbours that share most with it */
    FV_CLOSURE_CONFIRMATIONS = 3
};

enum fv_closure_phase {
    FV_CLOSURE_IDLE = 0,
    FV_CLOSURE_MATCH = 1,  /* descriptors of the keyframe's landmarks against the candidate's */
    FV_CLOSURE_SAMPLE = 2, /* similarities from three matches */
    FV_CLOSURE_REFINE =
        3, /* the best of them, then the landmarks around the candidate are gathered */
    FV_CLOSURE_GUIDED = 4, /* the group's landmarks in the keyframe's image */
    FV_CLOSURE_LEVEL = 5,  /* the relation against gravity, where both maps know that */
    FV_CLOSURE_BEFORE = 6, /* as guided, in keyframes made before it */
    FV_CLOSURE_GRAPH = 7,  /* the essential graph, some keyframes per unit */
    FV_CLOSURE_SOLVE = 8,
    FV_CLOSURE_COMMIT = 9,
    FV_CLOSURE_FUSE = 10
};

/* A keyframe or landmark by slot; the generation shows when the slot was given to another. */
struct fv_map_handle {
    uint32_t slot, generation;
};

/* A correction that keyframes confirmed, waiting for more of them. */
struct fv_closure_belief {
    struct fv_map_handle candidate;
    struct fv_sim3
        correction;         /* takes the world of the offered keyframe to that of the candidate */
    uint64_t number;        /* of the last keyframe that confirmed it */
    uint32_t confirmations; /* 0: nothing is believed */
    uint32_t reserved;
};

struct fv_closure_counts {
    uint32_t offered, tried, sampled, confirmed, implausible, closed, merged;
    uint32_t fused; /* landmarks */
};

struct fv_closure_state {
    enum fv_closure_phase phase;
    uint32_t candidate_count, candidate; /* the one that is tried */
    struct fv_map_handle keyframe, candidates[FV_CLOSURE_CANDIDATES_MAX];
    struct fv_closure_belief belief;
    struct fv_sim3 S_keyframe_candidate; /* cameras */
    struct fv_sim3 level;                /* the same without what it tilts them against gravity */
    struct fv_sim3 correction;
    struct fv_sim3_search search;
    struct fv_random random;
    uint32_t next; /* item of the phase */
    uint32_t query_count, train_count, correspondence_count, group_count;
    uint32_t inliers;            /* of the similarity as it is refined */
    uint32_t visible, found;     /* of the guided search */
    struct fv_map_handle before; /* keyframe that is asked after the offered one */
    uint32_t asked, seen_before;
    uint32_t fuse_count, fuse_at;
    uint32_t levelled; /* `level` is known */
    struct fv_map_handle fuse_into[FV_CLOSURE_FUSED_INTO];
    struct fv_closure_counts counts;
};

struct fv_closure {
    struct fv_closure_state *state;
    struct fv_pose_graph graph;
    /* Job part. */
    uint16_t *query_feature, *train_feature;
    uint8_t *queries, *trains; /* descriptors */
    uint32_t *nearest, *second, *best_of_train;
    struct fv_correspondence *correspondences;
    struct fv_map_handle *group; /* landmarks around the candidate */
    int16_t *node_of;            /* node of the graph, by keyframe slot */
    struct fv_map_handle *nodes; /* keyframes of the graph's nodes */
    struct fv_sim3 *corrections; /* by keyframe slot, and of the current frame; takes the old world
                                    to the new */
    uint8_t *corrected;
    uint32_t *scores;
};

void fv_closure_carve(struct fv_closure *closure, const struct fv_map_limits *limits,
                      struct fv_arena *persistent, struct fv_arena *job);
/* Forget what was confirmed and drop the work in progress. */
void fv_closure_reset(struct fv_closure *closure, uint64_t seed);

/* Offer a keyframe whose words were just indexed; passed over while the job is busy. One unit of
 * work. */
void fv_closure_offer(struct fv_closure *closure, const struct fv_map *map,
                      const struct fv_place *place, const struct fv_place_words *words,
                      uint32_t slot);
bool fv_closure_waiting(const struct fv_closure *closure);

/* What a unit did to the map. */
struct fv_closure_outcome {
    bool committed; /* the map moved: windows in work no longer fit it */
    bool fused;     /* the last unit of fusing: a window around the newest keyframe is of use */
    struct fv_sim3 S_new_current; /* takes the old world of the current frame to the new one */
    /* Lengths of this map were multiplied by a factor before, in place, because it came into one in
     * metres; 1: of none. */
    uint32_t stretched_map;
    double stretch;
};

/* One unit, bounded work (docs/bounds.md); the commit in proportion to the pools. True when units
 * are left. */
bool fv_closure_unit(struct fv_closure *closure, struct fv_map *map,
                     const struct fv_kernels *kernels, struct fv_closure_outcome *outcome);

/* ---- between the files of the job ------------------------------------------------------------ */

bool fv_closure_holds(const struct fv_map *map, struct fv_map_handle handle);
/* Camera a's side of a correspondence, or camera b's: the landmark of a feature in its frame, and
 * what the feature says of it. */
void fv_closure_side_a(const struct fv_map *map, const struct fv_map_frame *frame, uint32_t feature,
                       struct fv_correspondence *m);
void fv_closure_side_b(const struct fv_map *map, const struct fv_map_frame *frame, uint32_t feature,
                       struct fv_correspondence *m);
/* Standard deviation of a landmark's distance, relative, by its parallax; A and weight: of an
 * observation of it. */
double fv_closure_distance_sigma(const struct fv_landmark *l, const double A[6], double weight);
/* Search the group's landmarks in a keyframe that S_keyframe_candidate is said to hold for, from
 * state->next on, in one unit; counts into visible and found, and fills correspondences where the
 * feature has a landmark itself. True when done. */
bool fv_closure_search_group(struct fv_closure *closure, const struct fv_map *map,
                             const struct fv_kernels *kernels, uint32_t slot,
                             const struct fv_sim3 *S_keyframe_candidate);
/* Correction of the keyframe's world that makes S_keyframe_candidate true. */
void fv_closure_correction(const struct fv_map *map, struct fv_closure_state *state);
/* Whether it says the same as what is believed, at the offered keyframe. */
bool fv_closure_same(const struct fv_map *map, const struct fv_closure_state *state);
/* Whether the maps of both keyframes know gravity well enough; and then: find `level` by the
 * inliers, which takes the one's to the other's. False: the relation contradicts gravity, or the
 * metres of two maps that know them, so it is another place.
 */
bool fv_closure_upright(const struct fv_closure_state *state, const struct fv_map *map);
bool fv_closure_level(struct fv_closure *closure, const struct fv_map *map, bool rigid);
/* Whether drift may have been that large. */
bool fv_closure_plausible(const struct fv_map *map, uint32_t keyframe, uint32_t candidate,
                          const struct fv_sim3 *correction);
/* Fill the graph from state->next on; true when done. */
bool fv_closure_graph_unit(struct fv_closure *closure, const struct fv_map *map);
void fv_closure_graph_begin(struct fv_closure *closure, const struct fv_map *map);
void fv_closure_commit(struct fv_closure *closure, struct fv_map *map,
                       struct fv_closure_outcome *outcome);
bool fv_closure_fuse_unit(struct fv_closure *closure, struct fv_map *map,
                          const struct fv_kernels *kernels);

#ifdef __cplusplus
}
#endif
#endif
