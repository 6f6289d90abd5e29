#include "bounds/stages.h"

#include "bounds/limits.h"
#include "bounds/table.h"
#include "features/spread.h"

static double least(double a, double b)
{
    return a < b ? a : b;
}

/* Of the cells that it stands in or may touch. */
static double robot_cells(const struct fovea_grid_config *grid)
{
    const double across = 2 * ((int32_t)(grid->robot_radius_m / grid->resolution_m) + 1) + 1;
    return across * across;
}

struct capacities capacities_of(const struct fovea *rt, const struct fovea *grid)
{
    const struct fovea_config *config = &rt->config;
    const struct fovea_grid_config *cells = &grid->config.grid_job.grid;
    const struct fv_pyramid *pyramid = &rt->front_end.images.main;
    struct capacities c = {.width = config->rig.cameras[0].camera.width,
                           .height = config->rig.cameras[0].camera.height,
                           .features = config->features.count_max,
                           .keyframes = config->odometry.keyframes,
                           .landmarks = config->odometry.landmarks,
                           .window = config->odometry.window,
                           .per_cell = config->features.per_cell,
                           .model = (double)config->detect.model_bytes,
                           .grid_side = cells->side_cells,
                           .grid_rays = cells->rays,
                           .grid_steps = (int32_t)(2 * cells->range_m / cells->resolution_m),
                           .grid_robot = robot_cells(cells)};
    for (uint32_t i = 0; i < pyramid->levels; i++) {
        c.level_pixels += (double)pyramid->level[i].width * pyramid->level[i].height;
        c.level_rows += pyramid->level[i].height;
    }
    return c;
}

/* ---- image and features ---------------------------------------------------------------------- */

static void derive_pyramid(const struct capacities *c)
{
    struct bound *b = bound_of("pyramid");
    const double width = c->width, height = c->height;
    TERM(b, BOUND_ALWAYS, width * height, pixel_taken);
}

static void add_features(struct bound *b, const struct capacities *c)
{
    const double level_pixels = c->level_pixels, level_rows = c->level_rows, features = c->features,
                 per_cell = c->per_cell;
    TERM(b, BOUND_ALWAYS, level_pixels, pixel_scored);
    TERM(b, BOUND_ALWAYS, level_rows, row_walked);
    TERM(b, BOUND_ALWAYS, level_rows, row_needed);
    TERM(b, BOUND_ALWAYS, level_pixels / 4, corner_offered); /* peaks: one of 2 x 2 at most */
    TERM(b, BOUND_ALWAYS, 1, corners_begin);
    TERM(b, BOUND_ALWAYS, 1, corners_picked);
    TERM(b, BOUND_ALWAYS, FV_SPREAD_KEPT - per_cell, corners_ranked);
    TERM(b, BOUND_ALWAYS, features, corner_refined);
    TERM(b, BOUND_ALWAYS, features, corner_described);
    TERM(b, BOUND_ALWAYS, level_pixels, row_smoothed);
    TERM(b, BOUND_ALWAYS, 1, patterns_turned);
}

static void derive_features(const struct capacities *c)
{
    struct bound *b = bound_of("features");
    TERM(b, BOUND_ALWAYS, 1, mask_begun);
    TERM(b, BOUND_ALWAYS, FOVEA_INPUT_BOXES_MAX, box_masked);
    add_features(b, c);
}

/* The second camera's images and features, then distances. */
static void derive_stereo(const struct capacities *c)
{
    struct bound *b = bound_of("stereo: two cameras");
    const double width = c->width, height = c->height, features = c->features;
    TERM(b, BOUND_ALWAYS, width * height, pixel_taken);
    add_features(b, c);
    TERM(b, BOUND_ALWAYS, 1, rays_found);
    TERM(b, BOUND_ALWAYS, features, stereo_matched);
    TERM(b, BOUND_ALWAYS, least(FV_STEREO_ALIGNED_MAX, features), patch_aligned);
    TERM(b, BOUND_ALWAYS, STEREO_STEPS * least(FV_STEREO_ALIGNED_MAX, features), patch_step);
}

/* ---- odometry -------------------------------------------------------------------------------- */

/* fv_localiser_refine, `to_noise` or not: in rounds of steps, all of them taken. */
#define REFINED(b, way, times, rounds, steps, noise)                                               \
    do {                                                                                           \
        TERM(b, way, (times)*1, observations);                                                     \
        TERM(b, way, (times) * ((rounds) * (steps) + 2 * (noise)), pose_step);                     \
        TERM(b, way, (times) * ((rounds) + 3 * (noise)), pose_sorted);                             \
        TERM(b, way, (times) * (1 + (noise)), pose_fit);                                           \
    } while (0)

/* fv_odometry_try_keyframe, `tries` times. */
static void add_tries(struct bound *b, uint32_t way, const char *often, double tries)
{
#define TIMES(piece, count) bound_add(b, way, often, tries *(count), PIECE_##piece)
    TIMES(keyframe_matched, 1);
    TIMES(observations, 2);
    TIMES(pose_sampled, FV_PLACE_SAMPLES_MAX);
    TIMES(cubic_root, FV_PLACE_SAMPLES_MAX);
    TIMES(pose_cost, FV_PLACE_SAMPLES_MAX * (FV_P3P_SOLUTIONS_MAX + 1) + 2);
    TIMES(pose_angular, FV_PLACE_SAMPLES_MAX * 2);
    TIMES(local_matched, 1);
    TIMES(observations, 2);
    TIMES(pose_step, 2 * 15);
    TIMES(pose_sorted, 2 * 3);
    TIMES(pose_fit, 2);
#undef TIMES
}

/* fv_map_make_room: sweeps, then keyframes go until two are left. */
static void add_room(struct bound *b, uint32_t way, const struct capacities *c, double wanted)
{
    const double landmarks = c->landmarks, keyframes = c->keyframes;
    TERM(b, way, ROOM_SWEEPS * landmarks, landmark_swept);
    TERM(b, way, wanted, landmark_removed);
    TERM(b, way, wanted * FV_MAP_OBSERVERS_MAX, landmark_unlinked);
    TERM(b, way, keyframes - 2, keyframe_chosen);
    TERM(b, way, keyframes - 2, keyframe_removed);
}

/* After a rough pose: the local map, the covariance, and a keyframe. */
static void add_rest(struct bound *b, uint32_t way, const struct capacities *c)
{
    const double features = c->features, landmarks = c->landmarks;
    TERM(b, way, 2, local_matched);
    TERM(b, way, 2, observations);
    REFINED(b, way, 1, 2, 4, 1);
    REFINED(b, way, 1, 3, 5, 0);
    TERM(b, way, 4 * features, projected); /* of two poses twice, where none is in the image */
    TERM(b, way, 1, parts_collected);
    TERM(b, way, 1, jackknife);
    TERM(b, way, 1, lens_current);
    TERM(b, way, 1, joint);
    TERM(b, way, 1, remembered);
    TERM(b, way, 2, depth);
    add_room(b, way, c, least(ROOM_LANDMARKS, landmarks / 4));
    TERM(b, way, 1, keyframe_chosen);
    TERM(b, way, 1, keyframe_removed);
    TERM(b, way, 1, keyframe_added);
    TERM(b, way, 1, units_spread);
    TERM(b, way, features, landmark_linked);
    TERM(b, way, features, landmark_refreshed);
}

static void derive_tracking(struct bound *b, uint32_t way, const struct capacities *c)
{
    const double features = c->features;
    b->ways[way] = "tracked, every search in vain but the last, and a keyframe made in a full map";
    TERM(b, way, 2 * features / 16, projected); /* whether the motion goes far */
    TERM(b, way, 3, recent_matched);
    REFINED(b, way, 2, 2, 4, 1);
    REFINED(b, way, 1, 3, 5, 0);
    TERM(b, way, 1, local_matched);
    REFINED(b, way, 1, 3, 5, 0);
    add_tries(b, way, "1 keyframe tried", 1);
    add_rest(b, way, c);
}

static void derive_relocalised(struct bound *b, uint32_t way, const struct capacities *c)
{
    b->ways[way] = "lost, found again at the last try, and a keyframe made in a full map";
    TERM(b, way, 1, words);
    TERM(b, way, FV_RELOCALISE_TRIES, scores);
    TERM(b, way, FV_RELOCALISE_TRIES, neighbours);
    add_tries(b, way, "FV_RELOCALISE_TRIES", FV_RELOCALISE_TRIES);
    add_rest(b, way, c);
}

/* fv_initialise_adjust with `stages` stages, on so many tracks. */
static void add_adjusted(struct bound *b, uint32_t way, const char *often, double times,
                         double stages, double tracks)
{
    const double minimised = times * (stages + BUNDLE_ROUNDS);
#define TIMES(piece, count) bound_add(b, way, often, count, PIECE_##piece)
    TIMES(bundle_built, minimised * (1 + 2 * BUNDLE_STEPS) * tracks);
    TIMES(bundle_solved, minimised * BUNDLE_STEPS);
    TIMES(bundle_moved, minimised * BUNDLE_STEPS * tracks);
    TIMES(bundle_judged, times * (BUNDLE_ROUNDS + 1) * tracks);
    TIMES(bundle_direction, times * tracks);
#undef TIMES
}

/* fv_initialise_motions. */
static void add_motions(struct bound *b, uint32_t way)
{
    TERM(b, way, MOTION_SAMPLES, homography_four);
    TERM(b, way, MOTION_SAMPLES + 2, homography_cost);
    TERM(b, way, MOTION_SAMPLES + 3, homography_fit);
    TERM(b, way, MOTION_ESTIMATES * MOTION_SAMPLES, five_point);
    TERM(b, way, MOTION_ESTIMATES * MOTION_SAMPLES * ROOTS_SEARCHED * ROOT_STEPS, root_step);
    TERM(b, way, MOTION_ESTIMATES * MOTION_SAMPLES * (FV_ESSENTIAL_SOLUTIONS_MAX + 1),
         essential_cost);
    TERM(b, way, MOTION_ESTIMATES * (MOTION_SAMPLES + 2), motion_picked);
    TERM(b, way,
         MOTION_ESTIMATES *
                 (MOTION_SAMPLES * ESSENTIAL_STEPS * ESSENTIAL_TRACKS / FIRST_TRACKS + 3) +
             6,
         motion_refined);
    TERM(b, way, 2 + MOTIONS_FOLLOWED, motion_added);
    TERM(b, way, MOTIONS_FOLLOWED, motion_followed);
}

static void derive_first_map(struct bound *b, uint32_t way, const struct capacities *c)
{
    const double tracks = least(FIRST_TRACKS, c->features),
                 tried = least(FIRST_TRACKS_TRIED, tracks);
    enum { GUESSES = 2 * FV_INITIALISE_MOTIONS_MAX };
    b->ways[way] = "lost for long, no keyframe found, every motion followed to a first map";
    TERM(b, way, 1, words);
    TERM(b, way, FV_RELOCALISE_TRIES, scores);
    TERM(b, way, FV_RELOCALISE_TRIES, neighbours);
    add_tries(b, way, "FV_RELOCALISE_TRIES", FV_RELOCALISE_TRIES);
    TERM(b, way, 3, views_matched);
    TERM(b, way, 2, matches_noted);
    TERM(b, way, 1, pairs_taken);
    TERM(b, way, 1, tracks_extended);
    TERM(b, way, 1, view_held);
    add_motions(b, way);
    TERM(b, way, (2 + GUESSES + 3) * (FV_INITIALISE_VIEWS_MAX - 1), view_placed);
    TERM(b, way, GUESSES * tried, track_guessed);
    TERM(b, way, 2 + GUESSES, guess_noted);
    add_adjusted(b, way, "the last guess", 1, BUNDLE_STAGES - FV_INITIALISE_FAIR, tried);
    add_adjusted(b, way, "4 motions and a reversal, from rough", FV_INITIALISE_MOTIONS_MAX + 1,
                 BUNDLE_STAGES - FV_INITIALISE_ROUGH, tried);
    add_adjusted(b, way, "4 motions, sure", FV_INITIALISE_MOTIONS_MAX,
                 BUNDLE_STAGES - FV_INITIALISE_SURE, tried);
    add_adjusted(b, way, "the best, on all tracks", 1, BUNDLE_STAGES - FV_INITIALISE_FINE, tracks);
    TERM(b, way, 2 * tracks, bundle_judged);
    TERM(b, way, 1, scale_found);
    add_room(b, way, c, tracks);
    TERM(b, way, FV_INITIALISE_VIEWS_MAX, keyframe_chosen);
    TERM(b, way, FV_INITIALISE_VIEWS_MAX + SMALL_MAP_KEYFRAMES_DROPPED, keyframe_removed);
    TERM(b, way, FV_INITIALISE_VIEWS_MAX, keyframe_added);
    TERM(b, way, tracks, track_added);
    REFINED(b, way, 1, 1, 3, 0);
    TERM(b, way, 1, parts_collected);
    TERM(b, way, 1, jackknife);
    TERM(b, way, 1, lens_current);
    TERM(b, way, 1, joint);
}

static void derive_odometry(const struct capacities *c)
{
    struct bound *b = bound_of("odometry");
    TERM(b, BOUND_ALWAYS, 1, frame_filled);
    TERM(b, BOUND_ALWAYS, 1, frame_usable);
    TERM(b, BOUND_ALWAYS, 1, noise_measured);
    TERM(b, BOUND_ALWAYS, 1, published);
    TERM(b, BOUND_ALWAYS, 1, map_given_up);
    derive_tracking(b, 1, c);
    derive_relocalised(b, 2, c);
    derive_first_map(b, 3, c);
}

/* What the step does besides its stages: inputs, and what jobs are asked for. */
static void add_rest_of_step(struct bound *b, const struct capacities *c)
{
    TERM(b, BOUND_ALWAYS, 1, inputs_taken);
    TERM(b, BOUND_ALWAYS, 1, samples_observed);
    TERM(b, BOUND_ALWAYS, 1, jobs_asked);
    TERM(b, BOUND_ALWAYS, 1, lens_frame);
    if (c->model > 0) TERM(b, BOUND_ALWAYS, 1, picture_copied);
}

/* What an inertial sensor adds: samples come in, and the stage of odometry goes on by them. */
static void derive_inertial(const struct capacities *c)
{
    struct bound *b = bound_of("the rest of the step: inertial sensor");
    const double features = c->features;
    add_rest_of_step(b, c);
    TERM(b, BOUND_ALWAYS, FOVEA_INPUT_SAMPLES_MAX, imu_judged);
    TERM(b, BOUND_ALWAYS, FOVEA_INPUT_SAMPLES_MAX, imu_observed);
    b = bound_of("odometry: motion by samples");
    TERM(b, BOUND_ALWAYS, 1, motion_predicted);
    TERM(b, BOUND_ALWAYS, 1, turn_held);
    b = bound_of("odometry: rolling shutter");
    TERM(b, BOUND_ALWAYS, features, feature_placed);
    TERM(b, BOUND_ALWAYS, 1, depth);
    b = bound_of("odometry: inertial sensor");
    b->ways[1] = "a pose";
    b->ways[2] = "a pose in another map";
    b->ways[3] = "no pose";
    TERM(b, BOUND_ALWAYS, 1, depth);
    TERM(b, BOUND_ALWAYS, 1, sense_offered);
    TERM(b, 1, 1, inertial_posed);
    TERM(b, 2, 1, inertial_entered);
    TERM(b, 3, 1, inertial_coasted);
    b = bound_of("fovea_sense");
    TERM(b, BOUND_ALWAYS, FOVEA_INPUT_SAMPLES_MAX, sense_taken);
    TERM(b, BOUND_ALWAYS, FV_SENSE_KEPT, sense_carried); /* once in a call: frames are rarer */
    TERM(b, BOUND_ALWAYS, 1, sense_sent);
}

/* Messages, and the rest. */
static void derive_others(const struct capacities *c)
{
    struct bound *b = bound_of("stereo"); /* one camera: nothing */
    TERM(b, BOUND_ALWAYS, 0, clock);
    b = bound_of("encode");
    TERM(b, BOUND_ALWAYS, 1, encoded);
    add_rest_of_step(bound_of("the rest of the step"), c);
    b = bound_of("the rest of the step: preprocessing for networks");
    add_rest_of_step(b, c);
    TERM(b, BOUND_ALWAYS, 1, picture_relit);
    b = bound_of("the rest of the step: free space");
    add_rest_of_step(b, c);
    TERM(b, BOUND_ALWAYS, 1, ground_followed);
    TERM(b, BOUND_ALWAYS, 1, grid_forgotten);
    TERM(b, BOUND_ALWAYS, 1, space_noted);
}

void stages_derive(const struct capacities *c)
{
    derive_pyramid(c);
    derive_features(c);
    derive_stereo(c);
    derive_odometry(c);
    derive_others(c);
    derive_inertial(c);
}
