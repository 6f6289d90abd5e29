#include "odometry/odometry.h"

#include <string.h>

#include "geometry/vec.h"

enum {
    WINDOW_LANDMARKS = 1200,
    WINDOW_OBSERVATIONS = 9000,
    WINDOW_PASSES = 6,
    DROP_AFTER_KEYFRAMES = 10,
    MAP_KEYFRAMES_MIN = 5
};

static const double window_converged =
    1e-4; /* of the cost; what is left is far below the pixels' noise */

void fv_odometry_carve(struct fv_odometry *o, const struct fovea_odometry_config *config,
                       const struct fovea_camera *camera, uint32_t features_max, bool distances,
                       bool gyro, struct fv_arena *persistent, struct fv_arena *job,
                       struct fv_arena *frame)
{
    memset(o, 0, sizeof *o);
    o->config = *config;
    o->camera = *camera;
    o->focal_px = __builtin_sqrt(camera->fx * camera->fy);
    fv_bearing_carve(&o->bearings, camera->width, camera->height, persistent);
    const struct fv_map_limits limits = {config->keyframes, config->landmarks, features_max,
                                         camera->width,     camera->height,    distances};
    fv_map_carve(&o->map, &limits, &o->camera, &o->bearings, persistent);
    o->state = fv_arena_take(persistent, 1, sizeof *o->state);
    fv_localiser_carve(&o->localiser, features_max, distances, persistent, frame);
    fv_initialiser_carve(&o->initialiser, &o->map, o->focal_px, features_max, persistent, frame);
    fv_matches_carve(&o->matches, features_max, frame);
    fv_covariance_carve(&o->covariance, frame);
    fv_distances_carve(&o->distances, distances, features_max, frame);
    const struct fv_window_limits window = {config->window, WINDOW_LANDMARKS, WINDOW_OBSERVATIONS,
                                            WINDOW_PASSES, window_converged};
    o->turns = gyro ? fv_arena_take(persistent, 1, sizeof *o->turns) : NULL;
    fv_window_carve(&o->window, &window, &o->map, gyro, job);
    o->window.turns = o->turns;
    fv_creator_carve(&o->creator, features_max, job);
    fv_agreement_carve(&o->agreement, features_max, job);
    if (config->closures) fv_closure_carve(&o->closure, &limits, persistent, job);
    fv_relocaliser_carve(&o->relocaliser, config->keyframes, persistent, frame);
    o->saver.archive = fv_arena_take(persistent, 1, sizeof *o->saver.archive);
}

/* Forget what was found out about the map that there was. */
static void begin_in_map(struct fv_odometry *o)
{
    struct fv_odometry_state *s = o->state;
    fv_window_abort(&o->window);
    fv_relocaliser_reset(&o->relocaliser);
    if (o->config.closures) fv_closure_reset(&o->closure, o->state->random.s[0]);
    s->state = FOVEA_TRACKING_STARTING;
    fv_motion_forget(&s->localise.motion);
    s->job_wanted = false;
    s->lost_frames = s->localise.recent_count = o->initialiser.state->count = 0;
    s->keyframe_matches = 0;
    memset(&s->creation, 0, sizeof s->creation);
    memset(&s->agreement, 0, sizeof s->agreement);
    memset(&s->usable, 0, sizeof s->usable);
    memset(&s->covariance, 0, sizeof s->covariance);
    memset(&s->turn, 0, sizeof s->turn);
    if (o->turns != NULL) fv_turns_forget(o->turns);
    if (o->config.localise_only) s->state = FOVEA_TRACKING_LOST;
    if (fv_odometry_saving(o)) { /* half of one map and half of another are none */
        fv_odometry_save_drop(o);
        fv_odometry_save_begin(o);
    }
}

static void begin(struct fv_odometry *o)
{
    fv_map_reset(&o->map);
    begin_in_map(o);
}

void fv_odometry_set(struct fv_odometry *o, const struct fovea_odometry_config *config)
{
    o->config.inliers_good = config->inliers_good;
    o->config.lost_frames_reset = config->lost_frames_reset;
}

void fv_odometry_init(struct fv_odometry *o, uint64_t seed)
{
    fv_bearing_init(&o->bearings, &o->camera);
    fv_random_seed(&o->state->random, seed);
    begin(o);
}

void fv_odometry_reset(struct fv_odometry *o)
{
    o->state->reset_counter++;
    if (!o->config.localise_only) {
        begin(o);
        return;
    }
    o->state->state = FOVEA_TRACKING_LOST; /* what is known was known at the start */
    fv_motion_forget(&o->state->localise.motion);
    o->state->localise.recent_count = o->state->lost_frames = 0;
}

/* ---- what a pose says beside itself ---------------------------------------------------------- */

/* Nothing of a pose is published. */
static void withhold(struct fovea_pose *pose)
{
    memset(pose, 0, sizeof *pose);
    pose->state = FOVEA_TRACKING_LOST;
}

/* The map that it is of. */
static void write_map(struct fv_odometry *o)
{
    struct fovea_pose *pose = &o->state->pose;
    pose->reset_counter = o->state->reset_counter;
    pose->map_id = o->map.state->odom_id;
    pose->keyframes = o->map.state->keyframe_count;
    pose->landmarks = o->map.state->landmark_count;
}

/* ---- maps that are loaded -------------------------------------------------------------------- */

/* The camera is looked for in a map that was loaded. */
static void look_in_map(struct fv_odometry *o)
{
    struct fv_odometry_state *s = o->state;
    s->state = FOVEA_TRACKING_LOST;
    s->newest = 0;
    for (uint32_t k = 0; k < o->map.limits.keyframes; k++)
        if (o->map.keyframes[k].used &&
            (!o->map.keyframes[s->newest].used ||
             o->map.keyframes[k].number > o->map.keyframes[s->newest].number))
            s->newest = k;
}

enum fovea_status fv_odometry_load(struct fv_odometry *o, const struct fv_kernels *kernels,
                                   const uint8_t *data, size_t bytes, const char *name,
                                   struct fv_archive_info *info, struct fovea_error *error)
{
    struct fv_odometry_state *s = o->state;
    const enum fovea_status status = fv_archive_read(data, bytes, name, &o->map, info, error);
    if (status != FOVEA_OK || o->map.state->keyframe_count == 0) return status;
    s->frame_number = s->keyframe_frame = info->frame_number;
    look_in_map(o);
    while (fv_odometry_index_waiting(o))
        fv_odometry_index_unit(o, kernels);
    return FOVEA_OK;
}

void fv_odometry_take_map(struct fv_odometry *o, const struct fv_map *from, uint64_t frame_number)
{
    struct fv_odometry_state *s = o->state;
    s->first_keyframe = o->map.state->keyframe_number;
    s->keyframe_frame = s->frame_number;
    s->reset_counter++;
    fv_map_take(&o->map, from, (uint32_t)(s->frame_number - frame_number));
    begin_in_map(o);
    look_in_map(o);
    withhold(&s->pose);
    write_map(o);
}

/* The frame's features are seen from there: so is its pose, which is that of the last frame yet. */
static void see_from(struct fv_keyframe *frame, const double place[3])
{
    for (int i = 0; i < 3; i++) {
        frame->T_cam_world.t[i] += frame->seen_from[i] - place[i];
        frame->seen_from[i] = place[i];
    }
}

/* The motion of the place that the features are seen from. */
static struct fv_motion_hint hint_there(const struct fv_odometry_input *input)
{
    struct fv_motion_hint hint = input->hint;
    double turned[3];
    fv_rotate3(hint.T_now_last.R, input->seen_from, turned);
    for (int i = 0; i < 3 && (hint.whole || hint.continues); i++)
        hint.T_now_last.t[i] += turned[i] - input->seen_from[i];
    return hint;
}

/* Fill the current frame of the map from the image's features. */
static void odometry_fill_view(struct fv_odometry *o, const struct fv_odometry_input *input)
{
    const uint32_t current = fv_map_current(&o->map);
    see_from(&o->map.keyframes[current], input->seen_from);
    fv_map_fill_frame(&o->map, current, input->placed != NULL ? input->placed : input->features,
                      input->descriptors, input->count, o->distances.from);
    o->map.keyframes[current].stamp_ns = input->stamp_ns;
    fv_odometry_take_distances(o, input);
}

bool fv_odometry_interrupt(struct fv_odometry *o)
{
    struct fv_odometry_state *s = o->state;
    if (s->state != FOVEA_TRACKING_OK && s->state != FOVEA_TRACKING_WEAK) return false;
    s->state = s->pose.state = FOVEA_TRACKING_LOST;
    fv_motion_forget(&s->localise.motion);
    s->pose.posed = false;
    s->pose.matches = s->pose.inliers = 0;
    s->pose.quality = 0;
    return true;
}

/* ---- the step -------------------------------------------------------------------------------- */

static void write_rows(const double R[9], const double t[3], double rows[12])
{
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++)
            rows[4 * r + c] = R[3 * r + c];
        rows[4 * r + 3] = t[r];
    }
}

/* Few landmarks, a covariance that is not to be relied on, or pictures that do not agree with the
 * map: weak. */
static enum fovea_tracking_state confidence(const struct fv_odometry *o, uint32_t inliers)
{
    const bool good = inliers >= o->config.inliers_good && o->state->covariance_reliable &&
                      fv_usable(&o->state->usable) &&
                      fv_agreement_verdict(&o->state->agreement) == FV_AGREEMENT_GOOD;
    return good ? FOVEA_TRACKING_OK : FOVEA_TRACKING_WEAK;
}

/* Pose of a frame in the world that poses are published in. */
static void published_pose(const struct fv_odometry *o, const struct fv_sim3 *S_odom_map,
                           uint32_t frame, struct fv_se3 *T_odom_cam)
{
    struct fv_sim3 S_odom_cam;
    const struct fv_se3 T_map_cam = fv_map_camera_at(&o->map, frame);
    fv_sim3_from_se3(&T_map_cam, 1, &S_odom_cam);
    fv_sim3_compose(S_odom_map, &S_odom_cam, &S_odom_cam);
    memcpy(T_odom_cam->R, S_odom_cam.R, sizeof T_odom_cam->R);
    fv_copy3(S_odom_cam.t, T_odom_cam->t);
}

bool fv_odometry_reference_known(const struct fv_odometry *o)
{
    const struct fv_reference_state *reference = &o->state->reference;
    const uint32_t slot = o->state->newest;
    return reference->slot == slot && reference->generation == o->map.keyframes[slot].generation;
}

static const double correction_fraction = 0.25; /* of its square */

/* Optimisation has moved the reference keyframe since its own frame's pose was published: by so
 * much the two published poses disagree with the map. The pose relative to the keyframe is the
 * map's, the way between the published ones is not, and one covariance holds for both: half of it
 * is added. */
static void add_correction(struct fv_odometry *o, const struct fv_sim3 *S_odom_map,
                           const struct fv_se3 *T_odom_cam)
{
    struct fv_odometry_state *s = o->state;
    const uint32_t slot = s->newest, generation = o->map.keyframes[slot].generation;
    struct fv_se3 T_odom_ref, inverse, now, published;
    double between[3], turned[9], e[6];
    published_pose(o, S_odom_map, slot, &T_odom_ref);
    if (!fv_odometry_reference_known(o)) {
        const bool is_own =
            o->map.keyframes[slot].stamp_ns == o->map.keyframes[fv_map_current(&o->map)].stamp_ns;
        s->reference = (struct fv_reference_state){slot, generation, T_odom_ref, {0}, {0}, 0};
        if (is_own) memcpy(s->reference.parts, s->parts, sizeof s->parts);
        if (is_own) memcpy(s->reference.lens, s->covariance.lens, sizeof s->covariance.lens);
        if (is_own) s->reference.focal = s->covariance.focal;
    }
    fv_se3_invert(&T_odom_ref, &inverse);
    fv_se3_compose(&inverse, T_odom_cam, &now);
    fv_se3_invert(&s->reference.published, &inverse);
    fv_se3_compose(&inverse, T_odom_cam, &published);
    fv_subtract3(now.t, published.t, between);
    fv_rotate_back3(published.R, between, e);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            turned[3 * r + c] = published.R[r] * now.R[c] + published.R[3 + r] * now.R[3 + c] +
                                published.R[6 + r] * now.R[6 + c];
    fv_so3_log(turned, e + 3);
    for (int row = 0, k = 0; row < 6; row++)
        for (int column = row; column < 6; column++, k++)
            s->pose.covariance[k] += correction_fraction * e[row] * e[column];
}

/* From the place that the features were seen from to the camera. */
static void carry_covariance(const struct fv_keyframe *frame, double covariance[21])
{
    struct fv_se3 T_cam_place;
    double carried[21];
    if (fv_norm3(frame->seen_from) == 0) return;
    fv_se3_identity(&T_cam_place);
    fv_copy3(frame->seen_from, T_cam_place.t);
    fv_se3_carry_covariance(&T_cam_place, covariance, carried);
    memcpy(covariance, carried, sizeof carried);
}

static void write_pose(struct fv_odometry *o)
{
    struct fovea_pose *pose = &o->state->pose;
    const struct fv_sim3 *S_map_world = &o->map.state->S_map_world;
    struct fv_sim3 S_odom_map;
    struct fv_se3 T_odom_cam;
    fv_sim3_invert(S_map_world, &S_odom_map);
    published_pose(o, &S_odom_map, fv_map_current(&o->map), &T_odom_cam);
    write_rows(T_odom_cam.R, T_odom_cam.t, pose->T_world_cam);
    write_rows(S_map_world->R, S_map_world->t, pose->T_map_world);
    pose->map_scale = S_map_world->s;
    fv_covariance_rescale(pose->covariance, S_odom_map.s); /* lengths are the map's so far */
    carry_covariance(&o->map.keyframes[fv_map_current(&o->map)], pose->covariance);
    add_correction(o, &S_odom_map, &T_odom_cam);
    pose->posed = true;
}

/* A metric map from this frame, or one from several. A picture that is old in part is none of them:
 * between it and a whole one a part of the world stands, and the rest has moved. Nor is a noisy
 * one. */
static bool begin_map(struct fv_odometry *o, const struct fv_kernels *kernels, bool *continues)
{
    *continues = false;
    if (o->state->usable.patched || o->state->usable.noisy) return false;
    if (fv_norm3(o->map.keyframes[fv_map_current(&o->map)].seen_from) > 0) return false;
    return fv_odometry_begin_metric(o, continues) || fv_odometry_initialise(o, kernels);
}

/* Lost for long: try to make another map beside those that are kept. A map too small to be met
 * again goes. */
static void start_another(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    struct fv_odometry_state *s = o->state;
    const uint32_t map_id = o->map.state->map_id;
    bool continues;
    if (!begin_map(o, kernels, &continues)) return;
    if (o->map.state->map_id != map_id &&
        fv_map_count_keyframes(&o->map, map_id) < MAP_KEYFRAMES_MIN)
        fv_map_drop(&o->map, map_id);
    s->lost_frames = 0;
    s->reset_counter += !continues;
    fv_odometry_confirm(o);
    s->state = confidence(o, s->pose.inliers);
    write_pose(o);
}

static void localise_step(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    struct fv_odometry_state *s = o->state;
    uint32_t inliers = fv_odometry_localise(o, kernels);
    if (inliers == 0) {
        s->state = FOVEA_TRACKING_LOST;
        fv_motion_forget(&s->localise.motion);
        /* While poses go on without the picture, so does their map. */
        if (++s->lost_frames > o->config.lost_frames_reset && !o->config.localise_only &&
            !s->localise.hint.whole)
            start_another(o, kernels);
        return;
    }
    s->lost_frames = 0;
    o->initialiser.state->count = 0;
    s->state = confidence(o, inliers);
    if (!o->config.localise_only && fv_usable(&s->usable) &&
        fv_odometry_keyframe_needed(o, inliers))
        fv_odometry_make_keyframe(o);
    write_pose(o);
}

static bool contradicted(const struct fv_odometry *o)
{
    const struct fv_odometry_state *s = o->state;
    return (s->state == FOVEA_TRACKING_OK || s->state == FOVEA_TRACKING_WEAK) &&
           !o->config.localise_only && !s->agreement.dropping &&
           fv_agreement_verdict(&s->agreement) == FV_AGREEMENT_CONTRADICTED;
}

/* Whether the pose of this step is not to be published, once its state is known. */
static bool withholds(struct fv_odometry *o)
{
    struct fv_odometry_state *s = o->state;
    const bool alone = o->turns == NULL && !o->config.localise_only && !fv_map_metric(&o->map);
    if (s->state == FOVEA_TRACKING_OK) fv_agreement_confirm(&s->agreement);
    if (s->state == FOVEA_TRACKING_WEAK) fv_agreement_note_weak(&s->agreement);
    return fv_agreement_withholds(&s->agreement) || (alone && fv_agreement_unsure(&s->agreement));
}

void fv_odometry_step(struct fv_odometry *o, const struct fv_kernels *kernels,
                      const struct fv_odometry_input *input)
{
    struct fv_odometry_state *s = o->state;
    bool continues;
    memset(&s->pose, 0, sizeof s->pose);
    memset(s->parts, 0, sizeof s->parts);
    fv_covariance_begin(&s->covariance);
    s->frame_number++;
    s->localise.hint = hint_there(input);
    odometry_fill_view(o, input);
    fv_usable_picture(&s->usable, input->count, input->features, input->descriptors);
    fv_usable_noise(&s->usable, input->noise);
    if (contradicted(o)) fv_odometry_give_up(o);
    if (s->state != FOVEA_TRACKING_STARTING) {
        localise_step(o, kernels);
    } else if (begin_map(o, kernels, &continues)) {
        fv_odometry_confirm(o);
        s->state = confidence(o, s->pose.inliers);
        write_pose(o);
    }
    fv_odometry_follow_turn(o);
    s->pose.state = s->state;
    if (withholds(o)) withhold(&s->pose); /* odometry itself goes on */
    write_map(o);
}

/* ---- the job --------------------------------------------------------------------------------- */

bool fv_odometry_job_waiting(const struct fv_odometry *o)
{
    const struct fv_odometry_state *s = o->state;
    return fv_archive_busy(o->saver.archive) || s->creation.pending_count > 0 ||
           s->creation.phase != FV_CREATION_IDLE || s->job_wanted ||
           o->window.state->phase != FV_WINDOW_IDLE || fv_odometry_agreement_waiting(o) ||
           fv_odometry_index_waiting(o) || fv_odometry_agreement_fits(o);
}

/* The window of the newest keyframe: started, advanced, or committed. */
static void window_job(struct fv_odometry *o)
{
    struct fv_odometry_state *s = o->state;
    struct fv_window_state *w = o->window.state;
    if (w->phase == FV_WINDOW_IDLE) {
        s->job_wanted = false;
        if (!fv_window_start(&o->window, &o->map, s->newest)) fv_window_abort(&o->window);
        return;
    }
    if (w->phase == FV_WINDOW_PASS) {
        (void)fv_window_unit(&o->window);
        return;
    }
    if (o->map.state->keyframe_number > w->keyframe_number + DROP_AFTER_KEYFRAMES)
        fv_window_abort(&o->window);
    else
        (void)fv_window_commit(&o->window, &o->map);
    fv_odometry_cull(o);
}

/* Behind new landmarks. A pair's motion is fitted when nothing else is left to do. */
static bool agreement_is_next(const struct fv_odometry *o)
{
    return fv_odometry_agreement_waiting(o) ||
           (fv_odometry_agreement_fits(o) && !o->state->job_wanted &&
            o->window.state->phase == FV_WINDOW_IDLE && !fv_odometry_index_waiting(o));
}

bool fv_odometry_unit(struct fv_odometry *o, const struct fv_kernels *kernels)
{
    struct fv_odometry_state *s = o->state;
    if (fv_archive_busy(o->saver.archive)) { /* the rest waits, so that the map stays as it is */
        fv_archive_unit(o->saver.archive, &o->map, &o->camera, o->saver.buffer, o->saver.capacity);
        return true;
    }
    /* New landmarks come first: localisation needs them, and the window works on its own copy. */
    if (s->creation.pending_count > 0 || s->creation.phase != FV_CREATION_IDLE)
        (void)fv_odometry_creation_unit(o, kernels);
    else if (agreement_is_next(o))
        fv_odometry_agreement_unit(o, kernels);
    else if (s->job_wanted || o->window.state->phase != FV_WINDOW_IDLE)
        window_job(o);
    else if (fv_odometry_index_waiting(o))
        fv_odometry_index_unit(o, kernels);
    return fv_odometry_job_waiting(o);
}
