/* Bounds of each kind of unit, by the names of kinds.c. */
#include "bounds/limits.h"
#include "bounds/stages.h"
#include "bounds/table.h"
#include "grid/cells.h"

static double least(double a, double b)
{
    return a < b ? a : b;
}

static void derive_creation(const struct capacities *c)
{
    const double features = c->features, keyframes = c->keyframes;
    struct bound *b = bound_of("map: keyframe taken up");
    TERM(b, BOUND_ALWAYS, 1, neighbours);
    TERM(b, BOUND_ALWAYS, keyframes, shared_chosen);
    b = bound_of("map: landmarks of measured distances");
    TERM(b, BOUND_ALWAYS, CREATION_FEATURES, feature_measured);
    TERM(b, BOUND_ALWAYS, features, feature_unmeasured);
    b = bound_of("map: new landmarks");
    TERM(b, BOUND_ALWAYS, 1, bearings);
    TERM(b, BOUND_ALWAYS, CREATION_FEATURES, feature_triangulated);
    TERM(b, BOUND_ALWAYS, features, feature_passed);
    b = bound_of("map: landmarks searched in neighbours");
    TERM(b, BOUND_ALWAYS, features, feature_passed);
    TERM(b, BOUND_ALWAYS, CREATION_FEATURES * FV_CREATION_NEIGHBOURS_MAX, landmark_searched);
    TERM(b, BOUND_ALWAYS, CREATION_FEATURES * FV_CREATION_NEIGHBOURS_MAX, landmark_linked);
    TERM(b, BOUND_ALWAYS, CREATION_FEATURES * FV_CREATION_NEIGHBOURS_MAX, landmark_refreshed);
    TERM(b, BOUND_ALWAYS, 1, neighbours);
    TERM(b, BOUND_ALWAYS, 1 + FV_LOCAL_KEYFRAMES_MAX, keyframe_rated);
}

static void derive_agreement(void)
{
    struct bound *b = bound_of("map: agreement");
    b->ways[1] = "matches";
    b->ways[2] = "a motion fitted to them";
    TERM(b, 1, 1, agreement_matched);
    TERM(b, 1, 1, agreement_judged);
    TERM(b, 2, 1, agreement_fitted);
    b = bound_of("map: keyframe given up");
    TERM(b, BOUND_ALWAYS, 1, keyframe_removed);
    TERM(b, BOUND_ALWAYS, 1, keyframe_chosen); /* as many are looked at */
}

static void derive_window(const struct capacities *c)
{
    const double features = c->features, keyframes = c->keyframes, landmarks = c->landmarks,
                 window = c->window;
    struct bound *b = bound_of("map: window begun");
    TERM(b, BOUND_ALWAYS, 1, window_picked);
    TERM(b, BOUND_ALWAYS, 1, turns_taken);
    TERM(b, BOUND_ALWAYS, 2 * window * features, feature_scanned);
    TERM(b, BOUND_ALWAYS, WINDOW_OBSERVATIONS_MOST, observation_copied);
    b = bound_of("map: window pass");
    TERM(b, BOUND_ALWAYS, WINDOW_UNIT_OBSERVATIONS + FV_MAP_OBSERVERS_MAX - 1, observation_passed);
    TERM(b, BOUND_ALWAYS, 1, pass_ended);
    TERM(b, BOUND_ALWAYS, 1, turns_added);
    b = bound_of("map: window committed");
    TERM(b, BOUND_ALWAYS, keyframes + 1, keyframe_moved);
    TERM(b, BOUND_ALWAYS, landmarks + 2 * WINDOW_LANDMARKS_MOST, landmark_moved);
    TERM(b, BOUND_ALWAYS, WINDOW_OBSERVATIONS_MOST, misfit_dropped);
    TERM(b, BOUND_ALWAYS, landmarks, landmark_culled);
    TERM(b, BOUND_ALWAYS, landmarks, landmark_removed);
    TERM(b, BOUND_ALWAYS, least(landmarks * FV_MAP_OBSERVERS_MAX, keyframes * features),
         landmark_unlinked);
}

static void derive_rest_of_map(const struct capacities *c)
{
    const double features = c->features;
    struct bound *b = bound_of("map: index");
    TERM(b, BOUND_ALWAYS, 1, words_256);
    TERM(b, BOUND_ALWAYS, 1, words_inserted);
    TERM(b, BOUND_ALWAYS, 1, closure_offered);
    b = bound_of("map: floor");
    TERM(b, BOUND_ALWAYS, FV_FLOOR_SLOTS, floor_looked);
    TERM(b, BOUND_ALWAYS, 1, floor_estimated);
    b = bound_of("map: saving");
    b->ways[1] = "landmarks";
    b->ways[2] = "a keyframe";
    b->ways[3] = "the end";
    TERM(b, 1, FV_ARCHIVE_UNIT_LANDMARKS, saved_landmark);
    TERM(b, 2, least(features, FV_ARCHIVE_UNIT_FEATURES), saved_feature);
    TERM(b, 3, 1, saved_edges);
}

static void derive_inertial(void)
{
    const double stations = FV_INERTIAL_WINDOW;
    struct bound *b = bound_of("map: inertial estimate begun");
    TERM(b, BOUND_ALWAYS, 1, inertial_begun);
    b = bound_of("map: inertial samples summed");
    TERM(b, BOUND_ALWAYS, INERTIAL_INTEGRATED, inertial_interval);
    TERM(b, BOUND_ALWAYS, stations - 1, inertial_link);
    TERM(b, BOUND_ALWAYS, 1, inertial_guessed);
    b = bound_of("map: inertial stations eliminated");
    TERM(b, BOUND_ALWAYS, INERTIAL_ELIMINATED, inertial_eliminated);
    TERM(b, BOUND_ALWAYS, 1, inertial_solved);
    b = bound_of("map: inertial stations moved");
    b->ways[1] = "all of a unit";
    b->ways[2] = "the newest first, and the end";
    TERM(b, 1, INERTIAL_STEPPED, inertial_stepped);
    TERM(b, 2, 1, inertial_ended);
}

static void derive_closure(const struct capacities *c)
{
    const double features = c->features;
    struct bound *b = bound_of("closure: match");
    TERM(b, BOUND_ALWAYS, 2, features_gathered);
    TERM(b, BOUND_ALWAYS, 1, closure_matched);
    TERM(b, BOUND_ALWAYS, 1, correspondences_made);
    b = bound_of("closure: sample");
    TERM(b, BOUND_ALWAYS, 1, similarity_judged);
    /* The fewer correspondences, the more samples; each is tested on all of them. */
    TERM(b, BOUND_ALWAYS,
         (double)CLOSURE_TESTS / (FV_PLACE_MATCHES_MIN + CLOSURE_TESTS_OF_SAMPLE) + 1,
         similarity_solved);
    TERM(b, BOUND_ALWAYS, CLOSURE_TESTS + features, similarity_tested);
    b = bound_of("closure: refine");
    TERM(b, BOUND_ALWAYS, 1, similarity_refined);
    TERM(b, BOUND_ALWAYS, 1, group_gathered);
    b = bound_of("closure: guided");
    TERM(b, BOUND_ALWAYS, 1, group_begun);
    TERM(b, BOUND_ALWAYS, CLOSURE_GROUP, group_searched);
    TERM(b, BOUND_ALWAYS, CLOSURE_REFINEMENTS, similarity_refined);
    TERM(b, BOUND_ALWAYS, 1, closure_judged);
    b = bound_of("closure: level");
    TERM(b, BOUND_ALWAYS, 1, similarity_levelled);
    b = bound_of("closure: before");
    b->ways[1] = "the next asked";
    b->ways[2] = "judged, and the graph begun";
    TERM(b, 1, 1, group_begun);
    TERM(b, 1, CLOSURE_GROUP, group_searched);
    TERM(b, 2, 1, closure_judged);
    TERM(b, 2, 1, graph_begun);
}

static void derive_correction(void)
{
    struct bound *b = bound_of("closure: graph");
    TERM(b, BOUND_ALWAYS, 1, closures_held);
    TERM(b, BOUND_ALWAYS, CLOSURE_GRAPH_KEYFRAMES, keyframe_held);
    TERM(b, BOUND_ALWAYS, 1, graph_started);
    b = bound_of("closure: linearise");
    TERM(b, BOUND_ALWAYS, 1, graph_linearised);
    b = bound_of("closure: factor");
    TERM(b, BOUND_ALWAYS, 1, graph_factored);
    b = bound_of("closure: iterate");
    TERM(b, BOUND_ALWAYS, 1, graph_iterated);
    b = bound_of("closure: judge step");
    TERM(b, BOUND_ALWAYS, 1, graph_judged);
    b = bound_of("closure: committed");
    TERM(b, BOUND_ALWAYS, 1, closure_committed);
    b = bound_of("closure: fuse");
    TERM(b, BOUND_ALWAYS, CLOSURE_FUSED, landmark_fused);
}

static void derive_others(const struct capacities *c)
{
    struct bound *b = bound_of("calibration");
    b->ways[1] = "landmarks";
    b->ways[2] = "the end, or begun anew";
    TERM(b, 1, LENS_SLOTS, lens_looked);
    TERM(b, 1, LENS_POINTS, lens_added);
    TERM(b, 2, 1, lens_solved);
    TERM(b, 2, 1, lens_begun);
    b = bound_of("calibration: message");
    TERM(b, BOUND_ALWAYS, 1, encoded); /* one of those that a step sends, and a small one */
    b = bound_of("preview");
    TERM(b, BOUND_ALWAYS, 1, preview_unit);
    b = bound_of("edges");
    TERM(b, BOUND_ALWAYS, 1, edges_found);
    b = bound_of("edges: segments");
    TERM(b, BOUND_ALWAYS, 1, segments_found);
    b = bound_of("edges: sent");
    TERM(b, BOUND_ALWAYS, 1, edges_sent);
    if (c->model == 0) return;
    b = bound_of("detect: input");
    TERM(b, BOUND_ALWAYS, 1, network_input);
    b = bound_of("detect: network");
    TERM(b, BOUND_ALWAYS, 1, network_unit);
    b = bound_of("detect: decode");
    b->ways[1] = "candidates read";
    b->ways[2] = "sorted";
    b->ways[3] = "those that overlap removed";
    TERM(b, 1, 1, candidates_read);
    TERM(b, 2, 1, candidates_sorted);
    TERM(b, 3, 1, candidates_removed);
    b = bound_of("detect: boxes and objects");
    TERM(b, BOUND_ALWAYS, 1, boxes_sent);
    TERM(b, BOUND_ALWAYS, 1, objects_assigned);
    b = bound_of("detect: white balance");
    TERM(b, BOUND_ALWAYS, 1, network_balanced);
    b = bound_of("detect: keypoints");
    TERM(b, BOUND_ALWAYS, 1, keypoints_read);
    b = bound_of("detect: masks of objects");
    b->ways[1] = "cleared";
    b->ways[2] = "an object; the last row may begin with one product left";
    TERM(b, 1, MASK_SIDE * MASK_SIDE, mask_cleared);
    TERM(b, 2, least(MASK_SIDE * MASK_SIDE, MASK_PRODUCTS + MASK_SIDE), mask_pixel);
    TERM(b, 2, MASK_PRODUCTS + MASK_SIDE * MASK_COEFFICIENTS, mask_product);
    b = bound_of("detect: outputs sent");
    TERM(b, BOUND_ALWAYS, 1, tensors_sent);
    b = bound_of("detect: mask decoded");
    TERM(b, BOUND_ALWAYS, 1, mask_decoded);
    b = bound_of("detect: mask sent");
    TERM(b, BOUND_ALWAYS, 1, mask_sent);
}

/* A mask, and the floor that it is laid on. */
static void derive_ground(const struct capacities *c)
{
    const double grid_cells = c->grid_side * c->grid_side;
    struct bound *b = bound_of("free space: mask taken");
    b->ways[1] = "landmarks are due";
    b->ways[2] = "laid on the floor, and the first cells forget";
    TERM(b, BOUND_ALWAYS, 1, space_asked);
    TERM(b, 1, 1, ground_begun);
    TERM(b, 1, 1, ground_gathered);
    TERM(b, 2, 1, grid_laid);
    TERM(b, 2, least(grid_cells, FV_GRID_CELLS), cell_decayed);
    b = bound_of("free space: landmarks on floor");
    TERM(b, BOUND_ALWAYS, 1, space_asked);
    TERM(b, BOUND_ALWAYS, 1, ground_gathered);
    b = bound_of("free space: floor fitted");
    TERM(b, BOUND_ALWAYS, 1, space_asked);
    TERM(b, BOUND_ALWAYS, 1, ground_fitted);
}

/* An update of the grid. */
static void derive_grid(const struct capacities *c)
{
    const double grid_cells = c->grid_side * c->grid_side, grid_steps = c->grid_steps,
                 grid_robot = c->grid_robot, features = c->features;
    struct bound *b = bound_of("free space: cells forget");
    TERM(b, BOUND_ALWAYS, 1, space_asked);
    TERM(b, BOUND_ALWAYS, least(grid_cells, FV_GRID_CELLS), cell_decayed);
    b = bound_of("free space: points");
    TERM(b, BOUND_ALWAYS, 1, space_asked);
    TERM(b, BOUND_ALWAYS, 1, mask_looked);
    TERM(b, BOUND_ALWAYS, least(features, FV_GRID_POINTS), point_taken);
    b = bound_of("free space: rays");
    TERM(b, BOUND_ALWAYS, 1, space_asked);
    TERM(b, BOUND_ALWAYS, 1, mask_looked);
    /* The last ray may begin with one lookup left, or its floor may end with none. */
    TERM(b, BOUND_ALWAYS,
         FV_GRID_LOOKUPS + grid_steps / GRID_COARSE + GRID_COARSE + GRID_END_LOOKUPS, ray_looked);
    TERM(b, BOUND_ALWAYS, grid_steps, ray_freed); /* looked up in units before */
    TERM(b, BOUND_ALWAYS, (double)FV_GRID_LOOKUPS / (GRID_COARSE + 1) + 1, ray_begun);
    TERM(b, BOUND_ALWAYS, grid_robot, cell_stood);
    b = bound_of("free space: evidence");
    TERM(b, BOUND_ALWAYS, 1, space_asked);
    TERM(b, BOUND_ALWAYS, least(grid_cells, FV_GRID_CELLS), cell_applied);
    TERM(b, BOUND_ALWAYS, 1, recall_begun);
}

/* What follows it, and saving. */
static void derive_free_space(void)
{
    struct bound *b = bound_of("free space: recall");
    TERM(b, BOUND_ALWAYS, 1, grid_recalled);
    b = bound_of("free space: scan");
    TERM(b, BOUND_ALWAYS, 1, grid_scanned);
    b = bound_of("free space: grid sent");
    TERM(b, BOUND_ALWAYS, 1, grid_sent);
    b = bound_of("free space: scan sent");
    TERM(b, BOUND_ALWAYS, 1, scan_sent);
    b = bound_of("free space: heights sent");
    TERM(b, BOUND_ALWAYS, 1, heights_sent);
    b = bound_of("map: grid saved");
    b->ways[1] = "the grid searched for what is known";
    b->ways[2] = "rows";
    TERM(b, 1, 1, grid_searched);
    TERM(b, 2, 1, grid_saved);
}

void units_derive(const struct capacities *c)
{
    derive_creation(c);
    derive_agreement();
    derive_window(c);
    derive_rest_of_map(c);
    derive_inertial();
    derive_closure(c);
    derive_correction();
    derive_others(c);
    derive_ground(c);
    derive_grid(c);
    derive_free_space();
}
