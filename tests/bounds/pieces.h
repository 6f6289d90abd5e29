/* Pieces of work whose instructions are measured, each on its worst input (table.h). The list says
 * what each is; the files piece_*.c measure them, those of one source file each, of which they
 * include the source: so they reach functions that nobody else may call. */
#ifndef FOVEA_TESTS_BOUNDS_PIECES_H
#define FOVEA_TESTS_BOUNDS_PIECES_H

#include <stdint.h>

#define PIECES(ROW)                                                                                \
    /* image and features */                                                                       \
    ROW(pixel_taken, "a pixel of the frame to grey and to all levels, the dearest format")         \
    ROW(pixel_scored, "a pixel of a level, FAST, where most pass its first tests")                 \
    ROW(row_walked, "a row of a level, besides its pixels")                                        \
    ROW(row_needed, "the scores that corners of a row need")                                       \
    ROW(corner_offered, "a corner offered to its cell")                                            \
    ROW(corners_begin, "cells emptied")                                                            \
    ROW(corners_picked, "corners picked from full cells")                                          \
    ROW(corners_ranked, "all cells ranked once more")                                              \
    ROW(corner_refined, "a corner to a fraction of a pixel")                                       \
    ROW(corner_described, "a corner described")                                                    \
    ROW(row_smoothed, "a pixel of a level smoothed for descriptors")                               \
    ROW(patterns_turned, "patterns of descriptors turned, with the first frame")                   \
    ROW(box_masked, "a box that covers the image, masked")                                         \
    ROW(mask_begun, "a mask begun")                                                                \
    /* odometry: a frame */                                                                        \
    ROW(frame_filled, "features sorted into the grid, with their bearings")                        \
    ROW(frame_usable, "features compared with those of earlier pictures")                          \
    ROW(noise_measured, "the noise of the picture")                                                \
    ROW(recent_matched, "landmarks of the last frame, each searched among all features")           \
    ROW(local_matched, "the local map, each landmark searched among all features")                 \
    ROW(observations, "matches to observations")                                                   \
    ROW(pose_step, "a step of the pose over all observations")                                     \
    ROW(pose_sorted, "observations sorted into inliers and outliers")                              \
    ROW(pose_fit, "what a fit says of the pose")                                                   \
    ROW(projected, "a point projected")                                                            \
    ROW(remembered, "matches remembered for the next frame")                                       \
    ROW(parts_collected, "errors by part of the image")                                            \
    ROW(jackknife, "the jackknife over the parts of the image")                                    \
    ROW(lens_current, "the focal length of the frame")                                             \
    ROW(units_spread, "the mean difference of the keyframes' units of length")                     \
    ROW(joint, "the joint problem of the pose, most poses and observers")                          \
    ROW(depth, "the median depth, by halving")                                                     \
    ROW(published, "the pose, its covariance and its rates for those outside")                     \
    ROW(map_given_up, "a map given up that the pictures contradict")                               \
    /* two cameras */                                                                              \
    ROW(rays_found, "rays of the features of both cameras, sorted")                                \
    ROW(stereo_matched, "a feature along its curve, most looked at, most compared")                \
    ROW(patch_aligned, "a patch taken and aligned")                                                \
    ROW(patch_step, "a further step of its alignment")                                             \
    /* finding the camera again */                                                                 \
    ROW(words, "features to visual words")                                                         \
    ROW(scores, "scores of all keyframes, every word in each")                                     \
    ROW(neighbours, "keyframes that share landmarks with one")                                     \
    ROW(keyframe_matched, "features against the landmarks around a keyframe")                      \
    ROW(pose_sampled, "three matches to poses (P3P)")                                              \
    ROW(cubic_root, "a root of a cubic that converges slowest")                                    \
    ROW(pose_cost, "the cost of a pose over all matches")                                          \
    ROW(pose_angular, "a step of local optimisation over all matches")                             \
    /* making a keyframe, and room for it */                                                       \
    ROW(landmark_linked, "a landmark linked that gives up an observer")                            \
    ROW(landmark_refreshed, "a landmark of most observers refreshed")                              \
    ROW(landmark_unlinked, "an observation taken from a landmark of most observers")               \
    ROW(landmark_removed, "a landmark without observers removed")                                  \
    ROW(landmark_swept, "a landmark passed by the sweep for room")                                 \
    ROW(keyframe_chosen, "the most redundant keyframe, rated again most often")                    \
    ROW(keyframe_removed, "a keyframe removed with all its links")                                 \
    ROW(keyframe_added, "a frame copied to a keyframe")                                            \
    /* the first map */                                                                            \
    ROW(views_matched, "all features of one view against all of another")                          \
    ROW(matches_noted, "matches of a view noted")                                                  \
    ROW(pairs_taken, "matches to pairs and tracks")                                                \
    ROW(tracks_extended, "tracks found in the views between")                                      \
    ROW(view_held, "a view held")                                                                  \
    ROW(homography_four, "four pairs to a homography")                                             \
    ROW(homography_cost, "the cost of a homography over all tracks")                               \
    ROW(homography_fit, "a homography fitted to all tracks and compared")                          \
    ROW(five_point, "five pairs to essential matrices, the dearest of 2000 samples")               \
    ROW(root_step, "a step towards a root of a polynomial of degree 10")                           \
    ROW(essential_cost, "the cost of an essential matrix over all tracks")                         \
    ROW(motion_picked, "the motion of an essential matrix by votes of all tracks")                 \
    ROW(motion_refined, "a step of a motion over all tracks")                                      \
    ROW(motion_added, "a motion judged on all tracks, and listed")                                 \
    ROW(motion_followed, "a motion followed to its minimum over 150 tracks")                       \
    ROW(track_guessed, "the inverse depth of a track by a motion")                                 \
    ROW(bundle_built, "a track in the normal equations of a bundle of most views")                 \
    ROW(bundle_solved, "a bundle's system solved, and its views moved")                            \
    ROW(bundle_moved, "a track's own step")                                                        \
    ROW(bundle_judged, "a track judged")                                                           \
    ROW(bundle_direction, "the bundle's direction and its uncertainty, for each track")            \
    ROW(view_placed, "a view of a bundle placed at first")                                         \
    ROW(guess_noted, "a bundle noted as the next guess")                                           \
    ROW(scale_found, "the unit of the first map, by halving")                                      \
    ROW(track_added, "a track that becomes a landmark")                                            \
    /* the map's job */                                                                            \
    ROW(shared_chosen, "the keyframe that shares most chosen, and its baseline judged")            \
    ROW(bearings, "bearings of a keyframe's features")                                             \
    ROW(feature_measured, "a feature of known distance made a landmark")                           \
    ROW(feature_unmeasured, "a feature passed by, its distance not known")                         \
    ROW(feature_triangulated, "a feature searched along its line among all features")              \
    ROW(feature_passed, "a feature passed by")                                                     \
    ROW(landmark_searched, "a landmark searched in a keyframe among all features")                 \
    ROW(keyframe_rated, "a keyframe's redundancy")                                                 \
    ROW(agreement_matched, "64 features of a keyframe against all of another")                     \
    ROW(agreement_judged, "all matches of two keyframes held against the map")                     \
    ROW(agreement_fitted, "the motion of two keyframes fitted to their matches, half of it")       \
    ROW(window_picked, "keyframes of a window picked")                                             \
    ROW(observation_copied, "an observation copied to the window")                                 \
    ROW(feature_scanned, "a feature looked at for the window")                                     \
    ROW(observation_passed, "an observation linearised, its landmark's share with it")             \
    ROW(pass_ended, "a pass judged, and the window's system solved")                               \
    ROW(turns_taken, "turns between the window's keyframes joined")                                \
    ROW(turns_added, "these turns added to a pass")                                                \
    ROW(misfit_dropped, "an observation that does not fit, unlinked")                              \
    ROW(landmark_moved, "a landmark moved with its reference")                                     \
    ROW(keyframe_moved, "a keyframe moved with its parent")                                        \
    ROW(landmark_culled, "a landmark looked at by culling")                                        \
    ROW(words_256, "256 features to visual words")                                                 \
    ROW(words_inserted, "words of a keyframe into the index")                                      \
    ROW(saved_landmark, "a landmark saved")                                                        \
    ROW(saved_feature, "a feature saved")                                                          \
    ROW(saved_edges, "edges, scales and the header saved")                                         \
    /* closures */                                                                                 \
    ROW(closure_offered, "a keyframe offered: scores, and candidates picked")                      \
    ROW(features_gathered, "features of a keyframe gathered")                                      \
    ROW(closure_matched, "64 features against all of a candidate")                                 \
    ROW(correspondences_made, "matches to correspondences")                                        \
    ROW(similarity_solved, "three correspondences to a similarity, the dearest of 500 samples")    \
    ROW(similarity_tested, "a correspondence tested")                                              \
    ROW(similarity_judged, "the best similarity judged on all correspondences")                    \
    ROW(similarity_refined, "a similarity refined on all correspondences, three steps")            \
    ROW(similarity_levelled, "a similarity levelled on all correspondences, three steps")          \
    ROW(group_gathered, "landmarks around a candidate gathered")                                   \
    ROW(closure_judged, "whether a closure is plausible, certain and believed already")            \
    ROW(group_begun, "a guided search begun")                                                      \
    ROW(group_searched, "a landmark of the group searched among all features")                     \
    ROW(landmark_fused, "the same, and fused with what is found")                                  \
    ROW(graph_begun, "nodes of the essential graph")                                               \
    ROW(closures_held, "edges of closures to the graph")                                           \
    ROW(keyframe_held, "edges of a keyframe to the graph")                                         \
    ROW(graph_started, "the spanning tree of the graph")                                           \
    ROW(graph_linearised, "a unit of linearising the graph")                                       \
    ROW(graph_factored, "the tree factored")                                                       \
    ROW(graph_iterated, "a unit of conjugate gradients")                                           \
    ROW(graph_judged, "a unit of judging a step")                                                  \
    ROW(closure_committed, "the map corrected")                                                    \
    /* the calibration */                                                                          \
    ROW(lens_begun, "keyframes of a window of the calibration")                                    \
    ROW(lens_looked, "a landmark looked at for the calibration")                                   \
    ROW(lens_added, "a landmark in the equations of the calibration")                              \
    ROW(lens_solved, "the equations of the calibration solved")                                    \
    ROW(lens_frame, "a frame measured for the calibration")                                        \
    /* messages, pictures, networks */                                                             \
    ROW(encoded, "messages of all kinds, full")                                                    \
    ROW(samples_observed, "most samples of wheel odometry looked at")                              \
    ROW(inputs_taken, "inputs taken, with most boxes")                                             \
    ROW(jobs_asked, "a preview asked for")                                                         \
    ROW(picture_copied, "a picture in colours copied for a network")                               \
    ROW(preview_unit, "a unit of a preview, of noise")                                             \
    ROW(network_input, "a unit of a network's input")                                              \
    ROW(network_unit, "a unit of a network, the dearest of all")                                   \
    ROW(candidates_read, "a unit of a network's outputs, the dearest of eleven decoders")          \
    ROW(candidates_sorted, "most candidates sorted")                                               \
    ROW(candidates_removed, "a unit of overlaps, upright or turned")                               \
    ROW(picture_relit, "a picture given another luma for a network")                               \
    ROW(network_balanced, "a unit of balancing the colours of a picture")                          \
    ROW(keypoints_read, "keypoints of all objects, the dearest of five decoders")                  \
    ROW(mask_pixel, "a pixel of an object's mask, with one prototype")                             \
    ROW(mask_product, "each prototype of a pixel")                                                 \
    ROW(mask_cleared, "a pixel of a mask cleared")                                                 \
    ROW(tensors_sent, "a message of a network's outputs, full")                                    \
    ROW(mask_decoded, "a unit of a mask, the dearest of three outputs of the shipped network")     \
    ROW(mask_sent, "rows of a mask sent, the dearest of seven masks")                              \
    ROW(boxes_sent, "boxes of a picture mapped, objects updated, messages made")                   \
    ROW(floor_looked, "a landmark looked at for the floor")                                        \
    ROW(floor_estimated, "the floor estimated from 512 points, 96 samples")                        \
    ROW(edges_found, "a unit of edges, the dearest of six pictures")                               \
    ROW(segments_found, "a unit of line segments, the dearest of six pictures")                    \
    ROW(edges_sent, "rows of edges, and segments, sent")                                           \
    ROW(objects_assigned, "most detections assigned to most objects")                              \
    /* an inertial sensor */                                                                       \
    ROW(imu_judged, "a sample judged by the gate")                                                 \
    ROW(imu_observed, "a sample taken, where all that wait are as many as may")                    \
    ROW(motion_predicted, "the motion predicted by all samples that wait")                         \
    ROW(turn_held, "a pose held by a measured turn, and the turn joined")                          \
    ROW(inertial_posed, "a frame compared with all samples that wait, and made a station")         \
    ROW(inertial_entered, "the same in another map, where all begins anew")                        \
    ROW(inertial_coasted, "a frame without a pose, carried on by all samples that wait")           \
    ROW(feature_placed, "a feature of a rolling shutter placed")                                   \
    ROW(sense_offered, "a pose offered to samples between frames")                                 \
    ROW(sense_taken, "a sample carried on to a pose")                                              \
    ROW(sense_carried, "a sample that is kept, applied again from a new pose")                     \
    ROW(sense_sent, "a pose between frames sent")                                                  \
    ROW(inertial_begun, "poses of all stations taken from the map, and an estimate begun")         \
    ROW(inertial_interval, "an interval between samples summed")                                   \
    ROW(inertial_link, "a link between stations begun, and the next station led on")               \
    ROW(inertial_guessed, "gravity guessed from all links")                                        \
    ROW(inertial_eliminated, "a station eliminated")                                               \
    ROW(inertial_solved, "the newest station solved, with its covariance")                         \
    ROW(inertial_stepped, "a station moved by its step")                                           \
    ROW(inertial_ended, "stations of one unit moved, the newest first, and the estimate judged")   \
    /* free space */                                                                               \
    ROW(ground_followed, "the floor carried on with a pose")                                       \
    ROW(space_noted, "points of most landmarks noted for a mask")                                  \
    ROW(grid_forgotten, "all cells forgotten")                                                     \
    ROW(space_asked, "a unit of free space in which nothing is left")                              \
    ROW(ground_begun, "landmarks begun to be gathered")                                            \
    ROW(ground_gathered, "a unit of landmarks looked at, all on pixels of floor")                  \
    ROW(ground_fitted, "a fit of the floor to most points")                                        \
    ROW(grid_laid, "a mask laid, the robot gone by all cells but one, along both axes")            \
    ROW(cell_decayed, "a cell with a height that forgets")                                         \
    ROW(mask_looked, "a mask made ready to be looked up")                                          \
    ROW(point_taken, "a point above the floor, or below, with others all around")                  \
    ROW(ray_looked, "a step of a ray over floor")                                                  \
    ROW(ray_freed, "a step of a ray that becomes free later")                                      \
    ROW(ray_begun, "a ray that ends where it begins")                                              \
    ROW(cell_stood, "a cell that the robot may stand in")                                          \
    ROW(cell_applied, "a cell that takes its evidence")                                            \
    ROW(recall_begun, "a recall begun")                                                            \
    ROW(grid_recalled, "a unit of kept cells offered, as fine as the grid, or four times")         \
    ROW(grid_scanned, "a unit of the scan, the dearest of five grids")                             \
    ROW(grid_sent, "rows of cells sent")                                                           \
    ROW(scan_sent, "a scan sent")                                                                  \
    ROW(heights_sent, "rows of heights sent")                                                      \
    ROW(grid_searched, "a grid searched for what is known")                                        \
    ROW(grid_saved, "rows of cells saved")                                                         \
    ROW(clock, "the readings of the clock, and a job asked in vain")

enum piece {
#define PIECE_CONSTANT(name, text) PIECE_##name,
    PIECES(PIECE_CONSTANT)
#undef PIECE_CONSTANT
        PIECE_COUNT
};

extern double piece_costs[PIECE_COUNT]; /* instructions */
const char *piece_text(enum piece piece);
/* Keep the larger of what was known and `instructions`. */
void piece_note(enum piece piece, double instructions);

struct fovea;

/* Measure all, on runtimes that they use up: `two` has two cameras, `inertial` a sensor besides,
 * `grid` that of grid_case.h. */
void pieces_measure(struct fovea *rt, struct fovea *two, struct fovea *inertial,
                    struct fovea *grid);

/* By file. */
void pieces_of_features(struct fovea *rt);
void pieces_of_localise(struct fovea *rt);
void pieces_of_pose(struct fovea *rt);
void pieces_of_relocalise(struct fovea *rt);
void pieces_of_map(struct fovea *rt);
void pieces_of_odometry(struct fovea *rt);
void pieces_of_covariance(struct fovea *rt);
void pieces_of_initialise(struct fovea *rt);
void pieces_of_bundle(struct fovea *rt);
void pieces_of_motions(struct fovea *rt);
void pieces_of_essential(struct fovea *rt);
void pieces_of_homography(struct fovea *rt);
void pieces_of_roots(struct fovea *rt);
void pieces_of_window(struct fovea *rt);
void pieces_of_window_copy(struct fovea *rt);
void pieces_of_creation(struct fovea *rt);
void pieces_of_agreement(struct fovea *rt);
void pieces_of_archive(struct fovea *rt);
void pieces_of_lens(struct fovea *rt);
void pieces_of_jobs(struct fovea *rt);
void pieces_of_masks(void);
void pieces_of_decoders(void);
void pieces_of_inputs(int32_t width, int32_t height);
void pieces_of_tensors(void);
void pieces_of_distances(struct fovea *rt);
void pieces_of_inertial(struct fovea *rt);
void pieces_of_inertial_samples(struct fovea *rt);
void pieces_of_turns(struct fovea *rt);
void pieces_of_edges(struct fovea *rt);
void pieces_of_stereo(struct fovea *rt);
void pieces_of_stereo_match(struct fovea *rt);
void pieces_of_stereo_align(struct fovea *rt);
void pieces_of_floor(struct fovea *rt);
void pieces_of_ground(struct fovea *rt);
void pieces_of_grid(struct fovea *rt);
void pieces_of_free_space(struct fovea *rt);
void pieces_of_closure(struct fovea *rt);
void pieces_of_similarity(struct fovea *rt);
void pieces_of_closure_search(struct fovea *rt);
void pieces_of_closure_commit(struct fovea *rt);

/* A worst input that is not what it should be ends the program. */
#define MUST(holds)                                                                                \
    do {                                                                                           \
        if (!(holds)) piece_wrong(__FILE__, __LINE__, #holds);                                     \
    } while (0)
_Noreturn void piece_wrong(const char *file, int line, const char *what);

#define NOTE(piece, work, context, items)                                                          \
    piece_note(PIECE_##piece, (double)counter_of(work, context) / (items))

#endif
