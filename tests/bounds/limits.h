/* Limits of loops that stand in one source file each, under names of their own: the files
 * piece_*.c, which include these sources, assert that they agree. */
#ifndef FOVEA_TESTS_BOUNDS_LIMITS_H
#define FOVEA_TESTS_BOUNDS_LIMITS_H

enum {
    /* odometry/initialise.c */
    FIRST_TRACKS = 800,
    FIRST_TRACKS_TRIED = 200,
    /* odometry/initialise_bundle.c */
    BUNDLE_STEPS = 16,
    BUNDLE_STAGES = 3,
    BUNDLE_ROUNDS = 2,
    /* odometry/initialise_motions.c: samples of each estimate, directions and planes followed */
    MOTION_SAMPLES = 300,
    MOTIONS_FOLLOWED = 13 + 4,
    MOTION_ESTIMATES = 2, /* essential matrices, by a wide and by a tight limit */
    /* geometry/essential.c */
    ESSENTIAL_TRACKS = 512,
    ESSENTIAL_STEPS = 4,
    /* geometry/polynomial.c: roots of degrees 1 to 10, as many as the degree */
    ROOTS_SEARCHED = 55,
    ROOT_STEPS = 60,
    /* odometry/keyframe.c, odometry/odometry.c, map/keep.c */
    ROOM_LANDMARKS = 1000,
    ROOM_SWEEPS = 3,
    SMALL_MAP_KEYFRAMES_DROPPED = 4,
    /* odometry/landmark_creation.c */
    CREATION_FEATURES = 96,
    /* odometry/odometry.c, map/window.c */
    WINDOW_LANDMARKS_MOST = 1200,
    WINDOW_OBSERVATIONS_MOST = 9000,
    WINDOW_UNIT_OBSERVATIONS = 350,
    /* map/closure.c */
    CLOSURE_TESTS = 1500,
    CLOSURE_TESTS_OF_SAMPLE = 50,
    CLOSURE_REFINEMENTS = 2,
    CLOSURE_QUERIES = 64,
    /* map/closure_search.c, map/closure_commit.c */
    CLOSURE_GROUP = 300,
    CLOSURE_FUSED = 120,
    CLOSURE_GRAPH_KEYFRAMES = 8,
    /* stereo/align.c */
    STEREO_STEPS = 5,
    /* inertial/estimator.c: samples and stations of a unit */
    INERTIAL_INTEGRATED = 48,
    INERTIAL_ELIMINATED = 4,
    INERTIAL_STEPPED = 16,
    /* detect/mask.c; and the masks of YOLOv8 and YOLO11 on pictures of 640 x 640 */
    MASK_PRODUCTS = 1 << 17,
    MASK_SIDE = 160,
    MASK_COEFFICIENTS = 32,
    /* odometry/lens_window.c */
    LENS_SLOTS = 1500,
    LENS_POINTS = 20,
    /* grid/rays.c */
    GRID_COARSE = 8,
    GRID_END_LOOKUPS = 3
};

#define LIMIT(here, there)                                                                         \
    _Static_assert((int)(here) == (int)(there), "tests/bounds/limits.h says otherwise")

#endif
