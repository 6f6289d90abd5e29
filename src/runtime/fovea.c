/* The loop: one step per frame, then work. */
#include <string.h>

#include "geometry/vec.h"
#include "odometry/rolling.h"
#include "runtime/encode_pose.h"
#include "runtime/jobs.h"
#include "runtime/kept_grid.h"
#include "runtime/live.h"
#include "runtime/ready_map.h"
#include "runtime/state.h"

enum {
    STAND_IN_BELOW = 40, /* features of the first camera: next to nothing */
    STAND_IN_LEAST = 80  /* of the second */
};

/* ---- stage clock ----------------------------------------------------------------------------- */

/* Clock readings around a stage; nothing where the configuration has no clock. */
struct instant {
    int64_t wall_ns, cpu_ns;
};

static struct instant stage_begin(const struct fovea *rt)
{
    struct instant now = {0, 0};
    if (rt->config.clock != NULL)
        rt->config.clock(rt->config.clock_context, &now.wall_ns, &now.cpu_ns);
    return now;
}

static void stage_end(struct fovea *rt, enum fovea_stage stage, struct instant begin)
{
    const struct instant end = stage_begin(rt);
    rt->times.wall_ns[stage] = end.wall_ns - begin.wall_ns;
    rt->times.cpu_ns[stage] = end.cpu_ns - begin.cpu_ns;
}

/* ---- taking inputs --------------------------------------------------------------------------- */

/* Forget what was learnt; counters of frames go on. */
static void reset(struct fovea *rt)
{
    struct fv_state *state = rt->state;
    state->reset_counter++;
    state->any_frame = 0;
    state->features = 0;
    fv_random_seed(&state->random, rt->config.seed);
    if (rt->config.odometry.enabled) fv_odometry_reset(&rt->odometry);
    fv_jobs_reset(rt);
}

/* No more poses between frames until a frame has one again. */
static void end_sense(struct fovea *rt)
{
    if (rt->sense != NULL) fv_sense_offer(rt->sense, &(struct fv_sense_anchor){.posed = false});
}

static void take_commands(struct fovea *rt, uint32_t commands)
{
    if (commands & (FOVEA_COMMAND_RESET | FOVEA_COMMAND_PAUSE)) end_sense(rt);
    if (commands & FOVEA_COMMAND_RESET) reset(rt);
    if (commands & FOVEA_COMMAND_PAUSE) rt->state->paused = 1;
    if (commands & FOVEA_COMMAND_RESUME) rt->state->paused = 0;
    if ((commands & FOVEA_COMMAND_SAVE) && rt->config.odometry.enabled &&
        !fv_odometry_saving(&rt->odometry)) {
        fv_odometry_save_begin(&rt->odometry);
        fv_kept_grid_save_begin(&rt->free_space, &rt->odometry);
    }
}

static void take_map(struct fovea *rt, const struct fovea_ready_map *ready)
{
    if (!rt->config.odometry.enabled || !fv_map_same_limits(&rt->odometry.map, &ready->map)) return;
    end_sense(rt);
    fv_odometry_take_map(&rt->odometry, &ready->map, ready->frame_number);
    struct fv_archive_grid grid = ready->grid;
    grid.map_id +=
        fv_map_current_id(fv_odometry_map(&rt->odometry)) - fv_map_current_id(&ready->map);
    fv_kept_grid_take(&rt->free_space, &grid, ready->cells);
    /* A save that was under way has begun anew, with the map taken. */
    if (fv_odometry_saving(&rt->odometry)) fv_kept_grid_save_begin(&rt->free_space, &rt->odometry);
}

/* Whether an image is one of a camera of the rig. */
static bool fits(const struct fovea *rt, uint32_t camera, const struct fovea_image *image)
{
    return fovea_image_check(image) == FOVEA_OK &&
           image->width == rt->config.rig.cameras[camera].camera.width &&
           image->height == rt->config.rig.cameras[camera].camera.height &&
           image->format != FOVEA_PIXEL_MJPEG;
}

/* The first camera gave no image, and the second did. */
static bool is_absent(const struct fovea *rt, const struct fovea_frame *frame)
{
    return frame->images[0].data == NULL && rt->stereo_used && frame->image_count > 1 &&
           fits(rt, 1, &frame->images[1]);
}

/* Whether there is a frame to process; counts what is refused. */
static bool admit(struct fovea *rt, const struct fovea_frame *frame)
{
    struct fv_state *state = rt->state;
    if (frame == NULL) {
        state->steps_without_frame++;
        return false;
    }
    state->frames_in++;
    if (state->paused) {
        state->refused_paused++;
    } else if (!fits(rt, 0, &frame->images[0]) && !is_absent(rt, frame)) {
        state->refused_format++;
    } else if (state->any_frame && frame->stamp_ns <= state->frame.stamp_ns) {
        state->refused_stamp++;
    } else {
        return true;
    }
    return false;
}

static void remember(struct fv_state *state, const struct fovea_frame *frame, int64_t utc_offset_ns)
{
    state->frame = fv_frame_id(frame, utc_offset_ns);
    state->any_frame = 1;
    state->frames_processed++;
}

/* ---- the loop -------------------------------------------------------------------------------- */

/* The pose from which samples between frames carry on, or none. */
static void offer_sense(struct fovea *rt)
{
    const struct fv_inertial_known *known = fv_inertial_stage_known(&rt->inertial);
    const struct fv_rates *rates = fv_publish_rates(&rt->publish, FV_PUBLISH_BODY);
    const struct fovea_pose *pose = fv_publish_pose(&rt->publish);
    if (rt->sense == NULL) return;
    struct fv_sense_anchor anchor = {.posed = known != NULL && pose->posed && rates->known &&
                                              rates->velocity_sigma > 0};
    if (anchor.posed) {
        anchor.frame = rt->state->frame;
        anchor.reset_counter = fv_reset_counter(rt);
        anchor.map_id = pose->map_id;
        anchor.change_count = fv_publish_last_change(&rt->publish).count;
        anchor.T_odom_body = fv_publish_child_pose(&rt->publish, FV_PUBLISH_BODY);
        anchor.biases = known->biases;
        anchor.moved_ns = rt->inertial.clock->moved_ns;
        memcpy(anchor.velocity, rates->velocity, sizeof anchor.velocity);
        memcpy(anchor.angular_rate, rates->rotation_rate, sizeof anchor.angular_rate);
        fv_publish_turn(&rt->publish, known->gravity, anchor.gravity);
    }
    fv_sense_offer(rt->sense, &anchor);
}

/* After odometry has the pose of a frame, or knows that it has none. */
static void publish_pose(struct fovea *rt)
{
    const int64_t stamp_ns = rt->state->frame.stamp_ns;
    fv_inertial_stage_step(&rt->inertial, &rt->odometry, stamp_ns);
    fv_scale_step(&rt->scale, &rt->odometry, fv_inertial_stage_known(&rt->inertial));
    fv_publish_step(&rt->publish, &rt->odometry, &rt->scale, fv_inertial_stage_known(&rt->inertial),
                    stamp_ns);
    fv_relative_note(&rt->relative, fv_publish_pose(&rt->publish),
                     fv_publish_last_change(&rt->publish).count, stamp_ns);
    offer_sense(rt);
}

static struct fv_stereo_view view_of(const struct fv_front_end *front_end)
{
    const struct fv_front_end_found found = fv_front_end_found(front_end);
    return (struct fv_stereo_view){
        .pyramid = fv_seen_pyramid(fv_front_end_images(front_end), FV_VIEWER_FEATURES),
        .count = found.count,
        .features = found.features,
        .descriptors = found.descriptors};
}

/* Features of the second camera. False: it gave no image that serves. */
static bool find_second(struct fovea *rt, const struct fovea_inputs *inputs)
{
    if (!rt->stereo_used || inputs->frame->image_count < 2 ||
        !fits(rt, 1, &inputs->frame->images[1]))
        return false;
    fv_front_end_take(&rt->second_front_end, &rt->kernels, &inputs->frame->images[1]);
    (void)fv_front_end_find(&rt->second_front_end, &rt->kernels,
                            rt->masks[1].pixels != NULL ? &rt->masks[1] : NULL,
                            inputs->grants.features);
    return true;
}

/* The first camera shows next to nothing, as when it is covered, and the second does, in a map in
 * metres: the features are those of the second. */
static bool stand_in(struct fovea *rt, struct fv_odometry_input *input)
{
    const struct fv_stereo_view second = view_of(&rt->second_front_end);
    if (rt->state->features >= STAND_IN_BELOW || second.count < STAND_IN_LEAST ||
        !fv_map_metric(fv_odometry_map(&rt->odometry)))
        return false;
    input->count = fv_stereo_stand_in(&rt->stereo, &second);
    input->features = rt->stereo.moved;
    input->descriptors = rt->stereo.moved_descriptors;
    input->noise = fv_front_end_noise(&rt->second_front_end);
    fv_stereo_centre(&rt->stereo, input->seen_from);
    return true;
}

/* Distances of the features found, by the second camera. */
static void measure_distances(struct fovea *rt, struct fv_odometry_input *input)
{
    const struct fv_stereo_view views[FV_STEREO_CAMERAS] = {view_of(&rt->front_end),
                                                            view_of(&rt->second_front_end)};
    rt->distances = fv_stereo_measure(&rt->stereo, &rt->kernels, views);
    input->distances = rt->stereo.measured;
}

/* Features of a rolling shutter, where a global one would have seen them. */
static void place(struct fovea *rt, struct fv_odometry_input *input)
{
    struct fv_rolling rolling = {.readout_s = 1e-9 * (double)rt->config.rig.cameras[0].readout_ns};
    if (rt->placed == NULL || !fv_inertial_stage_rate(&rt->inertial, input->stamp_ns, rolling.rate))
        return;
    fv_odometry_place(&rt->odometry, &rolling, input, rt->placed);
    input->placed = rt->placed;
}

/* Features of the first camera; none where it gave no image. */
static struct fv_odometry_input find_first(struct fovea *rt, const struct fovea_inputs *inputs)
{
    struct fv_odometry_input input = {.stamp_ns = inputs->frame->stamp_ns};
    rt->state->features = 0;
    if (inputs->frame->images[0].data == NULL) return input;
    struct instant begin = stage_begin(rt);
    fv_front_end_take(&rt->front_end, &rt->kernels, &inputs->frame->images[0]);
    stage_end(rt, FOVEA_STAGE_PYRAMID, begin);

    begin = stage_begin(rt);
    const struct fv_plane *mask = fv_boxes_mask(
        &rt->boxes, rt->masks[0].pixels != NULL ? &rt->masks[0] : NULL, inputs->frame->stamp_ns);
    rt->state->features =
        fv_front_end_find(&rt->front_end, &rt->kernels, mask, inputs->grants.features);
    stage_end(rt, FOVEA_STAGE_FEATURES, begin);
    const struct fv_front_end_found found = fv_front_end_found(&rt->front_end);
    input.count = found.count;
    input.features = found.features;
    input.descriptors = found.descriptors;
    input.noise = fv_front_end_noise(&rt->front_end);
    return input;
}

static void process(struct fovea *rt, const struct fovea_inputs *inputs)
{
    struct fv_odometry_input input = find_first(rt, inputs);
    bool stands_in = false;
    if (!rt->config.odometry.enabled) return;
    struct instant begin = stage_begin(rt);
    rt->distances = 0;
    if (find_second(rt, inputs)) {
        stands_in = stand_in(rt, &input);
        if (!stands_in && input.count > 0) measure_distances(rt, &input);
    }
    stage_end(rt, FOVEA_STAGE_STEREO, begin);
    begin = stage_begin(rt);
    fv_inertial_stage_predict(&rt->inertial, &rt->odometry, input.stamp_ns, &input.hint);
    if (!stands_in) place(rt, &input);
    fv_odometry_step(&rt->odometry, &rt->kernels, &input);
    publish_pose(rt);
    stage_end(rt, FOVEA_STAGE_ODOMETRY, begin);
}

/* Without a frame for as long as the source calls it stalled or gone, there is no pose to go on
 * from. */
static bool interrupt(struct fovea *rt, const struct fovea_inputs *inputs)
{
    const bool away = inputs->source_state == FOVEA_SOURCE_STALLED ||
                      inputs->source_state == FOVEA_SOURCE_GONE ||
                      inputs->source_state == FOVEA_SOURCE_RETURNING;
    if (inputs->frame != NULL || !away || !rt->config.odometry.enabled) return false;
    if (!fv_odometry_interrupt(&rt->odometry)) return false;
    publish_pose(rt);
    fv_free_space_follow(&rt->free_space, &rt->publish);
    return true;
}

enum fovea_status fovea_step(struct fovea *rt, const struct fovea_inputs *inputs,
                             struct fovea_outputs *outputs)
{
    memset(outputs, 0, sizeof *outputs);
    rt->inputs = *inputs;
    fv_lockstep_begin(rt, inputs);
    if (inputs->parameters != NULL) fv_live_take(rt, inputs->parameters);
    take_commands(rt, inputs->commands);
    if (inputs->map != NULL) take_map(rt, inputs->map);
    if (rt->config.rig.has_imu)
        fv_imu_gate_step(&rt->imu, inputs->samples, inputs->sample_count, inputs->now_ns);
    if (rt->config.odometry.enabled) {
        fv_scale_observe(&rt->scale, inputs->samples, inputs->sample_count);
        fv_inertial_stage_observe(&rt->inertial, &rt->imu);
        if (inputs->has_boxes)
            fv_boxes_take(&rt->boxes, inputs->boxes_stamp_ns, inputs->boxes, inputs->box_count);
    }
    const bool processed = admit(rt, inputs->frame), interrupted = interrupt(rt, inputs);
    if (processed) {
        remember(rt->state, inputs->frame, inputs->utc_offset_ns);
        process(rt, inputs);
        if (inputs->frame->images[0].data != NULL) fv_jobs_frame(rt, inputs->frame);
    }
    const struct instant begin = stage_begin(rt);
    fv_encode(rt, inputs, processed, interrupted, outputs);
    fv_lockstep_sent(rt, outputs);
    stage_end(rt, FOVEA_STAGE_ENCODE, begin);
    rt->inputs.frame = NULL; /* the caller's, and gone after this; likewise the rest */
    rt->inputs.samples = NULL;
    rt->inputs.parameters = NULL;
    rt->inputs.map = NULL;
    rt->state->steps++;
    outputs->jobs_waiting = fv_jobs_waiting(rt);
    return processed ? FOVEA_OK : FOVEA_AGAIN;
}

enum fovea_status fovea_sense(struct fovea *rt, const struct fovea_sample *samples, uint32_t count,
                              struct fovea_outputs *outputs)
{
    struct fv_sense_pose pose;
    bool any = false;
    memset(outputs, 0, sizeof *outputs);
    if (rt->sense == NULL) return FOVEA_AGAIN;
    for (uint32_t i = 0; i < count && i < FOVEA_INPUT_SAMPLES_MAX; i++)
        if (samples[i].kind == FOVEA_SAMPLE_IMU)
            any = fv_sense_take(rt->sense, &rt->config.rig.imu, &samples[i].imu, &pose);
    if (!any) return FOVEA_AGAIN;
    fv_encode_fast_pose(rt, &pose, outputs);
    return FOVEA_OK;
}

enum fovea_status fovea_work(struct fovea *rt, const struct fovea_grants *grants,
                             struct fovea_outputs *outputs)
{
    memset(outputs, 0, sizeof *outputs);
    rt->work_grants = *grants;
    for (int job = 0; job < FOVEA_JOB_COUNT; job++) {
        const struct instant begin = stage_begin(rt);
        rt->units_done[job] = fv_jobs[job]->advance(rt, grants->units[job], outputs);
        outputs->units_done[job] = rt->units_done[job];
        stage_end(rt, (enum fovea_stage)(FOVEA_STAGE_JOBS + job), begin);
    }
    fv_lockstep_end(rt, grants, outputs);
    outputs->jobs_waiting = fv_jobs_waiting(rt);
    return outputs->jobs_waiting ? FOVEA_AGAIN : FOVEA_OK;
}

/* ---- looking inside -------------------------------------------------------------------------- */

const struct fovea_feature *fovea_features_get(const struct fovea *rt, uint32_t *count)
{
    *count = rt->state->features;
    return fv_front_end_found(&rt->front_end).features;
}

void fovea_pose_get(const struct fovea *rt, struct fovea_pose *pose)
{
    if (rt->config.odometry.enabled) {
        *pose = *fv_publish_pose(&rt->publish);
    } else {
        memset(pose, 0, sizeof *pose);
    }
}

bool fovea_relative_pose_get(const struct fovea *rt, uint32_t frames,
                             struct fovea_relative_pose *relative)
{
    memset(relative, 0, sizeof *relative);
    return rt->config.odometry.enabled && fv_relative_get(&rt->relative, frames, relative);
}

void fovea_detections_get(const struct fovea *rt, struct fovea_detections *detections)
{
    fv_detection_get(&rt->detection, detections);
}

void fovea_detections2_get(const struct fovea *rt, struct fovea_detections *detections)
{
    fv_detection_get(&rt->detection2, detections);
}

const char *fovea_detect_label(const struct fovea *rt, int32_t class_id)
{
    return fv_detection_label(&rt->detection, class_id);
}

void fovea_segmentation_get(const struct fovea *rt, uint32_t network,
                            struct fovea_segmentation *segmentation)
{
    const struct fv_detection none = {.enabled = false};
    fv_detection_get_segmentation(network == 0   ? &rt->detection
                                  : network == 1 ? &rt->detection2
                                                 : &none,
                                  segmentation);
}

const char *fovea_detect2_label(const struct fovea *rt, int32_t class_id)
{
    return fv_detection_label(&rt->detection2, class_id);
}

bool fovea_free_space_get(const struct fovea *rt, int8_t *cells, struct fovea_grid_place *place)
{
    const struct fv_grid *grid = &rt->free_space.grid;
    if (!rt->free_space.enabled || !grid->state->begun) return false;
    *place = fv_grid_place(grid);
    fv_grid_rows(grid, 0, place->height, cells);
    return true;
}

bool fovea_ground_get(const struct fovea *rt, struct fovea_ground *ground)
{
    if (!rt->free_space.enabled || !rt->ground.state->begun) return false;
    *ground = rt->free_space.state->ground;
    fv_ground_stage_mount(&rt->ground, ground);
    return true;
}

bool fovea_free_space_heights(const struct fovea *rt, int16_t *heights_mm, uint8_t *counts,
                              struct fovea_grid_place *place)
{
    const struct fv_grid *grid = &rt->free_space.grid;
    if (!rt->free_space.enabled || !grid->state->begun || grid->heights == NULL) return false;
    *place = fv_grid_place(grid);
    fv_grid_height_rows(grid, 0, place->height, heights_mm, counts);
    return true;
}

void fovea_objects_get(const struct fovea *rt, struct fovea_objects *objects)
{
    memset(objects, 0, sizeof *objects);
    if (rt->objects.enabled) fv_objects_get(&rt->objects.pool, objects);
}

void fovea_calibration_get(const struct fovea *rt, struct fovea_calibration *calibration)
{
    memset(calibration, 0, sizeof *calibration);
    if (rt->calibration.state != NULL) fv_calibration_get(&rt->calibration, calibration);
}

void fovea_imu_status_get(const struct fovea *rt, struct fovea_imu_status *status)
{
    memset(status, 0, sizeof *status);
    if (rt->config.rig.has_imu) fv_imu_gate_status(&rt->imu, status);
    struct fv_inertial_stage_offset offset;
    if (!rt->config.odometry.enabled || !fv_inertial_stage_offset(&rt->inertial, &offset)) return;
    status->time_offset_s = offset.offset_s;
    status->time_offset_sigma_s = offset.sigma_s;
    status->time_offset_used_s = offset.used_s;
    struct fv_inertial_stage_mount mount;
    if (!fv_inertial_stage_mount(&rt->inertial, &mount)) return;
    fv_copy3(mount.found.error, status->mount_error);
    fv_copy3(mount.found.sigma, status->mount_sigma);
    status->mount_angle = mount.found.angle;
    status->mount_angle_sigma = mount.found.angle_sigma;
    status->mount_wrong = mount.wrong;
}

double fovea_map_scale_get(const struct fovea *rt, uint32_t map_id)
{
    if (!rt->config.odometry.enabled) return 0;
    return fv_map_scale_of(fv_odometry_map(&rt->odometry), map_id, NULL);
}

uint32_t fovea_keyframes_get(const struct fovea *rt, struct fovea_keyframe *list,
                             uint32_t count_max)
{
    if (!rt->config.odometry.enabled) return 0;
    const struct fv_map *map = fv_odometry_map(&rt->odometry);
    const uint32_t slots = fv_map_slot_counts(map).keyframes,
                   count = count_max < slots ? count_max : slots;
    for (uint32_t i = 0; i < count; i++) {
        struct fv_map_keyframe keyframe;
        list[i] = (struct fovea_keyframe){.used = fv_map_keyframe_at(map, i, &keyframe)};
        if (!list[i].used) continue;
        list[i].map_id = keyframe.map_id;
        list[i].number = keyframe.number;
        fv_se3_to_rows(&keyframe.T_world_cam, list[i].T_world_cam);
    }
    return count;
}

void fovea_stats_get(const struct fovea *rt, struct fovea_stats *stats)
{
    const struct fv_state *state = rt->state;
    *stats = (struct fovea_stats){
        .frames_in = state->frames_in,
        .frames_processed = state->frames_processed,
        .frames_refused = state->refused_stamp + state->refused_format + state->refused_paused,
        .steps_without_frame = state->steps_without_frame,
        .refused_stamp = state->refused_stamp,
        .refused_format = state->refused_format,
        .refused_paused = state->refused_paused,
        .reset_counter = fv_reset_counter(rt),
        .features = state->features,
        .distances = rt->distances,
    };
    if (rt->config.odometry.enabled) {
        const struct fv_closure_counts counts = fv_odometry_closure_counts(&rt->odometry);
        stats->closures = counts.closed;
        stats->maps_merged = counts.merged;
    }
    memcpy(stats->stage_cpu_ns, rt->times.cpu_ns, sizeof stats->stage_cpu_ns);
    memcpy(stats->stage_wall_ns, rt->times.wall_ns, sizeof stats->stage_wall_ns);
}

const char *fovea_cpu_name(const struct fovea *rt)
{
    return fv_cpu_set_name(rt->kernels.set);
}
