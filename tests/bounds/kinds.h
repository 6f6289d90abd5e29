/* What kind of unit a job does next, by its state. */
#ifndef FOVEA_TESTS_BOUNDS_KINDS_H
#define FOVEA_TESTS_BOUNDS_KINDS_H

#include "runtime/state.h"

/* Every kind of unit that jobs do: each has a bound of this name. */
#define KINDS(KIND)                                                                                \
    KIND(KEYFRAME_TAKEN, "map: keyframe taken up")                                                 \
    KIND(LANDMARKS_MEASURED, "map: landmarks of measured distances")                               \
    KIND(LANDMARKS_NEW, "map: new landmarks")                                                      \
    KIND(LANDMARKS_SEARCHED, "map: landmarks searched in neighbours")                              \
    KIND(AGREEMENT, "map: agreement")                                                              \
    KIND(KEYFRAME_GIVEN_UP, "map: keyframe given up")                                              \
    KIND(WINDOW_BEGUN, "map: window begun")                                                        \
    KIND(WINDOW_PASS, "map: window pass")                                                          \
    KIND(WINDOW_COMMITTED, "map: window committed")                                                \
    KIND(INDEX, "map: index")                                                                      \
    KIND(FLOOR, "map: floor")                                                                      \
    KIND(INERTIAL_BEGUN, "map: inertial estimate begun")                                           \
    KIND(INERTIAL_INTEGRATED, "map: inertial samples summed")                                      \
    KIND(INERTIAL_ELIMINATED, "map: inertial stations eliminated")                                 \
    KIND(INERTIAL_MOVED, "map: inertial stations moved")                                           \
    KIND(MAP_SAVED, "map: saving")                                                                 \
    KIND(GRID_SAVED, "map: grid saved")                                                            \
    KIND(CLOSURE_MATCH, "closure: match")                                                          \
    KIND(CLOSURE_SAMPLE, "closure: sample")                                                        \
    KIND(CLOSURE_REFINE, "closure: refine")                                                        \
    KIND(CLOSURE_GUIDED, "closure: guided")                                                        \
    KIND(CLOSURE_LEVEL, "closure: level")                                                          \
    KIND(CLOSURE_BEFORE, "closure: before")                                                        \
    KIND(CLOSURE_GRAPH, "closure: graph")                                                          \
    KIND(CLOSURE_LINEARISE, "closure: linearise")                                                  \
    KIND(CLOSURE_FACTOR, "closure: factor")                                                        \
    KIND(CLOSURE_ITERATE, "closure: iterate")                                                      \
    KIND(CLOSURE_JUDGE, "closure: judge step")                                                     \
    KIND(CLOSURE_COMMITTED, "closure: committed")                                                  \
    KIND(CLOSURE_FUSE, "closure: fuse")                                                            \
    KIND(CALIBRATION, "calibration")                                                               \
    KIND(CALIBRATION_MESSAGE, "calibration: message")                                              \
    KIND(PREVIEW, "preview")                                                                       \
    KIND(EDGES, "edges")                                                                           \
    KIND(EDGE_SEGMENTS, "edges: segments")                                                         \
    KIND(EDGES_SENT, "edges: sent")                                                                \
    KIND(DETECT_BALANCE, "detect: white balance")                                                  \
    KIND(DETECT_INPUT, "detect: input")                                                            \
    KIND(DETECT_NETWORK, "detect: network")                                                        \
    KIND(DETECT_DECODE, "detect: decode")                                                          \
    KIND(DETECT_KEYPOINTS, "detect: keypoints")                                                    \
    KIND(DETECT_BOXES, "detect: boxes and objects")                                                \
    KIND(DETECT_OBJECT_MASKS, "detect: masks of objects")                                          \
    KIND(DETECT_MASK, "detect: mask decoded")                                                      \
    KIND(DETECT_MASK_SENT, "detect: mask sent")                                                    \
    KIND(DETECT_TENSORS, "detect: outputs sent")                                                   \
    KIND(SPACE_MASK, "free space: mask taken")                                                     \
    KIND(SPACE_LANDMARKS, "free space: landmarks on floor")                                        \
    KIND(SPACE_FLOOR, "free space: floor fitted")                                                  \
    KIND(SPACE_DECAY, "free space: cells forget")                                                  \
    KIND(SPACE_POINTS, "free space: points")                                                       \
    KIND(SPACE_RAYS, "free space: rays")                                                           \
    KIND(SPACE_EVIDENCE, "free space: evidence")                                                   \
    KIND(SPACE_RECALL, "free space: recall")                                                       \
    KIND(SPACE_SCAN, "free space: scan")                                                           \
    KIND(SPACE_GRID_SENT, "free space: grid sent")                                                 \
    KIND(SPACE_SCAN_SENT, "free space: scan sent")                                                 \
    KIND(SPACE_HEIGHTS_SENT, "free space: heights sent")

enum kind {
#define KIND_CONSTANT(name, text) KIND_##name,
    KINDS(KIND_CONSTANT)
#undef KIND_CONSTANT
        KIND_COUNT
};

const char *kind_name(enum kind kind);

/* Of the unit that the job would do now; KIND_COUNT: it does not wait. A switch over every phase
 * and no default, so that a phase that is new does not compile before it has a kind. */
enum kind kind_of(const struct fovea *rt, enum fovea_job job);

#endif
