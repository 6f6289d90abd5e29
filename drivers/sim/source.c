#include "../clock.h"
#include "../table.h"
#include "sim.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BLUR_STEPS = 8, ROLLING_ROWS = 4 };

/* A sensor's gain, and how much brighter than the address has it a picture can become. */
static const double gain_min = 0.0625, gain_max = 16, bright_max = 64;

double fv_sim_frame_time(const struct fovea_source *source, uint64_t index)
{
    const double delay = source->options.rolling ? 0.5 * source->options.readout_ms : 0.0;
    return source->options.time_s + (double)index / source->options.rate_hz +
           (0.5 * source->options.exposure_ms + delay) * 1e-3;
}

/* ---- opening --------------------------------------------------------------------------------- */

static void sim_close(struct fovea_source *source)
{
    if (source == NULL) return;
    fv_sim_world_free(&source->world);
    fv_sim_raster_free(&source->raster);
    free(source->canvas.linear);
    free(source->canvas.surface);
    free(source->exposed);
    free(source->lensed);
    for (int k = 0; k < FOVEA_CAMERAS_MAX; k++)
        free(source->dirt[k]);
    for (int32_t i = 0; i < FOVEA_SOURCE_FRAMES_HELD_MAX; i++)
        for (int k = 0; k < FOVEA_CAMERAS_MAX; k++)
            free(source->image[i][k]);
    fv_sim_body_sensors_close(source);
    sem_destroy(&source->commands.waiting);
    free(source->depth_m);
    free(source->class_mask);
    free(source->object_map);
    free(source);
}

/* What comes through the lens: dirt takes light, the sun spreads some. */
static const uint16_t *through_lens(struct fovea_source *source, const uint16_t *linear,
                                    int32_t first, int32_t count)
{
    const uint8_t *dirt = source->dirt[source->camera] + first;
    for (int32_t i = 0; i < count; i++) {
        const int32_t light = (linear[i] * (dirt[i] + 1) >> 8) + source->veil;
        source->lensed[i] = (uint16_t)(light < 65535 ? light : 65535);
    }
    return source->lensed;
}

/* Rows of an instant are done: they go through the sensor, or into what the whole frame is exposed
 * to. */
static void rows_done(void *context, const uint16_t *linear, int32_t y_begin, int32_t y_end)
{
    struct fovea_source *source = context;
    const int32_t first = y_begin * source->options.width,
                  count = y_end * source->options.width - first;
    if (source->lensed != NULL) linear = through_lens(source, linear, first, count);
    if (source->exposed == NULL) {
        fv_sim_sensor_expose(&source->sensor, linear, count, source->grey + first);
        return;
    }
    uint16_t *exposed = source->exposed + first;
    if (!source->options.blur) {
        memcpy(exposed, linear, (size_t)count * sizeof *exposed);
        return;
    }
    for (int32_t i = 0; i < count; i++)
        exposed[i] = (uint16_t)(exposed[i] + linear[i] / BLUR_STEPS);
}

/* Dirt is the same in all frames, other on each camera. */
static bool allocate_lens(struct fovea_source *source, size_t in_canvas)
{
    const struct fv_sim_options *o = &source->options;
    if (o->trajectory != FV_SIM_ROAD) return true;
    source->lensed = calloc(in_canvas, sizeof(uint16_t));
    source->info.heap_bytes += in_canvas * sizeof(uint16_t);
    for (uint32_t k = 0; k < source->info.rig.camera_count; k++) {
        const size_t pixels = (size_t)o->width * (size_t)o->height;
        source->dirt[k] = calloc(pixels, 1);
        if (source->dirt[k] == NULL) return false;
        source->info.heap_bytes += pixels;
        fv_sim_road_dirt(&source->world.road, source->world.seed + k, o->width, o->height,
                         source->dirt[k]);
    }
    return source->lensed != NULL;
}

static bool allocate(struct fovea_source *source)
{
    const size_t pixels = (size_t)source->options.width * (size_t)source->options.height;
    const int32_t rows =
        source->options.height < FV_SIM_CANVAS_ROWS ? source->options.height : FV_SIM_CANVAS_ROWS;
    const size_t in_canvas = (size_t)source->options.width * (size_t)rows;
    const bool whole = source->options.blur || source->options.rolling;
    const uint32_t cameras = source->info.rig.camera_count;
    const size_t tiles = pixels / FV_SIM_TILE_PIXELS + 1;
    source->canvas = (struct fv_sim_canvas){.linear = calloc(in_canvas, sizeof(uint16_t)),
                                            .surface = calloc(in_canvas, sizeof(uint16_t)),
                                            .rows = rows,
                                            .finished = rows_done,
                                            .context = source};
    source->depth_m = calloc(pixels, sizeof(float));
    source->class_mask = calloc(pixels, 1);
    source->object_map = calloc(pixels, 1);
    bool fine = source->canvas.linear && source->canvas.surface && source->depth_m &&
                source->class_mask && source->object_map;
    if (whole) {
        source->exposed = calloc(pixels, sizeof(uint16_t));
        fine = fine && source->exposed != NULL;
    }
    const uint32_t held = fv_source_frames_held(&source->selection);
    for (uint32_t i = 0; i < held; i++) {
        for (uint32_t k = 0; k < cameras; k++) {
            source->image[i][k] = calloc(pixels, 1);
            fine = fine && source->image[i][k] != NULL;
        }
    }
    size_t bytes = sizeof *source + in_canvas * 2 * sizeof(uint16_t) +
                   pixels * (sizeof(float) + 2 + held * (size_t)cameras) +
                   tiles * (FV_SIM_TILE_PIXELS * 2 * sizeof(float) + sizeof(struct fv_sim_rect) +
                            sizeof(float)) +
                   (whole ? pixels * sizeof(uint16_t) : 0);
    for (int32_t i = 0; i < source->world.texture_count; i++)
        bytes += source->world.texture[i].bytes;
    source->info.heap_bytes = bytes;
    return fine && allocate_lens(source, in_canvas);
}

/* A stamp holds 292 years. Where no number of frames is asked for, the first two must have one:
 * nobody waits for more. */
static enum fovea_status check_time(const struct fovea_source *source, struct fovea_error *error)
{
    static const double seconds_max = 9e9;
    const struct fovea_source_selection *s = &source->selection;
    const bool count_known = s->frames > 0 || s->reverse || source->deliverable == 1;
    const double steps = count_known ? (double)(source->deliverable - 1) : 1.0;
    const double last_s = ((double)s->start + (double)s->step * steps) / source->options.rate_hz;
    if (last_s <= seconds_max) return FOVEA_OK;
    return fovea_error_set(
        error, FOVEA_ERROR_ARGUMENT,
        "sim: start, step, frames: found a last frame at %.9g s, expected at most %g s", last_s,
        seconds_max);
}

/* Frames on the trajectory that the selection leaves: start, start + step, ... `frames` of them;
 * then turned round. */
static enum fovea_status select_frames(struct fovea_source *source, struct fovea_error *error)
{
    const struct fovea_source_selection *s = &source->selection;
    const uint64_t all = source->options.frames;
    if (s->step == 0)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "sim: step: found 0, expected at least 1");
    source->deliverable = s->frames;
    if (all == 0 && s->frames == 0 && s->reverse)
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT,
            "sim: reverse: the trajectory is endless, expected a number of frames");
    if (all == 0) return check_time(source, error);
    if (s->start >= all)
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT,
            "sim: start: found %llu, expected less than the trajectory's %llu frames",
            (unsigned long long)s->start, (unsigned long long)all);
    const uint64_t left = (all - s->start - 1) / s->step + 1;
    if (s->frames == 0 || s->frames > left) source->deliverable = left;
    return check_time(source, error);
}

/* Ticks of at most a 50th of a second, a whole number of them in a frame period. */
static int64_t ticks_of_frame(const struct fv_sim_options *options)
{
    const int64_t least = (int64_t)(50 / options->rate_hz);
    return (double)least * options->rate_hz < 50 ? least + 1 : least;
}

/* The robot is driven from its start on: frame after frame, for at most ten minutes where nothing
 * else is asked for. */
static enum fovea_status begin_driven(struct fovea_source *source, struct fovea_error *error)
{
    struct fv_sim_options *o = &source->options;
    struct fovea_source_selection *s = &source->selection;
    const int64_t ticks = ticks_of_frame(o);
    const double most = FV_SIM_DRIVE_SECONDS_MAX * o->rate_hz;
    if (!o->commands) return FOVEA_OK;
    if (s->reverse || s->start > 0 || s->step != 1)
        return fovea_error_set(
            error, FOVEA_ERROR_UNSUPPORTED,
            "sim: commands: found a selection of frames, expected all in order: the robot is driven");
    if (!fv_sim_option_given(o, offsetof(struct fv_sim_options, frames)))
        o->frames = (uint64_t)(0.5 * most);
    if (o->frames == 0 || (double)o->frames > most)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: frames: found %llu, expected 1 to %.0f with commands",
                               (unsigned long long)o->frames, most);
    source->commands.enabled = true;
    source->commands.by_clock = s->by_clock;
    source->commands.patience_s = o->patience_s;
    source->info.sample_kinds |= 1u << FOVEA_SAMPLE_VELOCITY;
    if (!fv_sim_drive_begin(&source->world.drive, fv_sim_frame_time(source, 0),
                            (double)ticks * o->rate_hz, ticks * (int64_t)(o->frames + 2)))
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "sim: out of memory");
    return FOVEA_OK;
}

static enum fovea_status refuse_fov(const struct fovea_source *source, struct fovea_error *error)
{
    return fovea_error_set(
        error, FOVEA_ERROR_INPUT,
        "sim: fov: found %g, but the corners of a %d x %d image look too far aside; expected less",
        source->options.fov_deg, (int)source->options.width, (int)source->options.height);
}

static enum fovea_status sim_open(const char *address,
                                  const struct fovea_source_selection *selection,
                                  struct fovea_source **out, struct fovea_error *error)
{
    struct fv_sim_options options;
    enum fovea_status status = fv_sim_options_parse(address, &options, error);
    if (status != FOVEA_OK) return status;
    struct fovea_source *source = calloc(1, sizeof *source);
    if (source == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "sim: out of memory");
    source->options = options;
    sem_init(&source->commands.waiting, 0, 0);
    atomic_init(&source->requested.exposure_ms, options.exposure_ms);
    atomic_init(&source->requested.gain, 1);
    source->selection = selection != NULL ? *selection : (struct fovea_source_selection){.step = 1};
    if (!fv_sim_world_build(&source->world, &options))
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "sim: out of memory");
    if (options.trajectory == FV_SIM_DRIVE &&
        !fv_sim_option_given(&options, offsetof(struct fv_sim_options, frames)))
        source->options.frames =
            (uint64_t)(fv_sim_drive_seconds(&source->world.drive) * options.rate_hz);
    if (status == FOVEA_OK) status = begin_driven(source, error);
    if (status == FOVEA_OK) status = select_frames(source, error);
    if (status == FOVEA_OK) status = fv_sim_rig_describe(&options, &source->info.rig, error);
    if (status == FOVEA_OK) status = fv_sim_body_sensors_open(source, error);
    if (status == FOVEA_OK &&
        !fv_sim_raster_create(&source->raster, &source->info.rig.cameras[0].camera))
        status = refuse_fov(source, error);
    if (status == FOVEA_OK && !allocate(source))
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "sim: out of memory");
    if (status != FOVEA_OK) {
        sim_close(source);
        return status;
    }
    fv_sim_motion_create(&source->motion, &options, &source->world);
    if (options.trajectory == FV_SIM_TOUR) {
        /* Here the ways cross, at the door; elsewhere they are apart by construction. */
        const double seconds =
            options.frames == 0 ? 600.0 : (double)options.frames / options.rate_hz;
        fv_sim_objects_clear(&source->world, &source->motion, options.time_s,
                             options.time_s + (seconds < 600.0 ? seconds : 600.0));
    }
    struct fovea_source_info *info = &source->info;
    info->format = FOVEA_PIXEL_GREY8;
    info->rate_hz = options.rate_hz / (double)source->selection.step;
    info->frame_count = source->deliverable;
    info->has_truth = true;
    for (uint32_t i = 0; i < info->rig.camera_count; i++)
        info->cameras[i] = (struct fovea_source_camera){
            .width = options.width, .height = options.height, .origin = "built in"};
    *out = source;
    return FOVEA_OK;
}

/* ---- frames ---------------------------------------------------------------------------------- */

static const struct fovea_source_info *sim_info(const struct fovea_source *source)
{
    return &source->info;
}

static enum fovea_status sim_start(struct fovea_source *source, struct fovea_error *error)
{
    if (!fv_sim_raster_fill(&source->raster, &source->info.rig.cameras[0].camera))
        return refuse_fov(source, error);
    source->started = true;
    return FOVEA_OK;
}

static void sim_stop(struct fovea_source *source)
{
    source->started = false;
    memset(source->held, 0, sizeof source->held);
}

static struct fv_sim_rect rows_bound(const struct fv_sim_raster *raster, int32_t y_begin,
                                     int32_t y_end)
{
    struct fv_sim_rect all = {1e9f, -1e9f, 1e9f, -1e9f};
    for (int32_t ty = y_begin / FV_SIM_TILE; ty * FV_SIM_TILE < y_end; ty++) {
        for (int32_t tx = 0; tx < raster->tiles_x; tx++) {
            const struct fv_sim_rect *b = &raster->bound[ty * raster->tiles_x + tx];
            all.x_min = b->x_min < all.x_min ? b->x_min : all.x_min;
            all.x_max = b->x_max > all.x_max ? b->x_max : all.x_max;
            all.y_min = b->y_min < all.y_min ? b->y_min : all.y_min;
            all.y_max = b->y_max > all.y_max ? b->y_max : all.y_max;
        }
    }
    return all;
}

void fv_sim_set_scene(struct fovea_source *source, double time_s, int32_t y_begin, int32_t y_end)
{
    double T_world_cam[12];
    const struct fv_sim_rect bound = rows_bound(&source->raster, y_begin, y_end);
    fv_sim_world_place(&source->world, time_s);
    if (source->camera > 0) {
        fv_sim_motion_body(&source->motion, time_s, T_world_cam);
        fv_sim_compose(T_world_cam, source->info.rig.cameras[source->camera].T_body_cam,
                       T_world_cam);
    } else {
        fv_sim_motion_pose(&source->motion, time_s, T_world_cam);
    }
    source->veil = source->lensed != NULL ? fv_sim_road_veil(&source->world.road, T_world_cam) : 0;
    fv_sim_scene_set(&source->scene, &source->world, T_world_cam, &bound);
}

double fv_sim_row_delay(const struct fovea_source *source, int32_t y_begin, int32_t y_end)
{
    if (!source->options.rolling) return 0.0;
    return ((0.5 * (y_begin + y_end) / source->options.height) - 0.5) * source->options.readout_ms *
           1e-3;
}

int32_t fv_sim_band_rows(const struct fovea_source *source)
{
    return source->options.rolling ? ROLLING_ROWS : source->options.height;
}

/* One picture at a time: rows in bands that share an instant. */
static void render_instant(struct fovea_source *source, double time_s)
{
    const int32_t height = source->options.height, band = fv_sim_band_rows(source);
    for (int32_t y = 0; y < height; y += band) {
        const int32_t end = y + band < height ? y + band : height;
        fv_sim_set_scene(source, time_s + fv_sim_row_delay(source, y, end), y, end);
        fv_sim_render(&source->scene, &source->raster, y, end, &source->canvas);
    }
}

static void render_frame(struct fovea_source *source, double time_s, uint64_t seed, uint8_t *grey)
{
    const struct fv_sim_options *o = &source->options;
    const int32_t pixels = o->width * o->height, steps = o->blur ? BLUR_STEPS : 1;
    source->grey = grey;
    const double road =
        o->trajectory == FV_SIM_ROAD ? fv_sim_road_gain(&source->world.road, time_s) : 1.0;
    const double sensitivity = source->taken.exposure_ms / o->exposure_ms * source->taken.gain;
    const double bright = o->light * road * sensitivity;
    fv_sim_sensor_begin(&source->sensor, bright < bright_max ? bright : bright_max,
                        source->taken.gain > 1 ? o->noise * source->taken.gain : o->noise, seed);
    if (o->blur) memset(source->exposed, 0, (size_t)pixels * sizeof *source->exposed);
    for (int32_t k = 0; k < steps; k++)
        render_instant(source,
                       time_s + ((k + 0.5) / steps - 0.5) * source->taken.exposure_ms * 1e-3);
    if (source->exposed != NULL)
        fv_sim_sensor_expose(&source->sensor, source->exposed, pixels, grey);
}

static uint64_t frame_index(const struct fovea_source *source, uint64_t n)
{
    const struct fovea_source_selection *s = &source->selection;
    return s->start + s->step * (s->reverse ? source->deliverable - 1 - n : n);
}

/* Stamps rise in reverse too: they are mirrored inside the range that is played. */
static int64_t frame_stamp(const struct fovea_source *source, uint64_t n)
{
    const uint64_t like = source->selection.reverse ? source->deliverable - 1 - n : n;
    return (int64_t)((double)frame_index(source, like) / source->options.rate_hz * 1e9 + 0.5);
}

/* A driven robot has been at its goal for a second. */
static bool has_arrived(const struct fovea_source *source)
{
    const struct fv_sim_drive *drive = &source->world.drive;
    return source->commands.enabled && drive->reached >= 0 &&
           (double)(drive->tick_count - drive->reached) * drive->tick_s > 1;
}

static bool has_ended(const struct fovea_source *source)
{
    return (source->deliverable != 0 && source->delivered == source->deliverable) ||
           has_arrived(source);
}

/* Of a driven robot, the motion until the frame after the next; waits for its command. */
static enum fovea_status advance_drive(struct fovea_source *source, int64_t deadline_ns)
{
    const struct fv_sim_options *o = &source->options;
    if (!source->commands.enabled) return FOVEA_OK;
    return fv_sim_commands_advance(&source->commands, &source->world.drive, source->delivered,
                                   ticks_of_frame(o), o->rate_hz, deadline_ns);
}

/* Without commands a frame is always at hand: it is rendered now. */
static enum fovea_status sim_dequeue(struct fovea_source *source, int64_t deadline_ns,
                                     struct fovea_frame *frame)
{
    if (!source->started || has_ended(source)) {
        fv_sim_commands_end(&source->commands);
        return FOVEA_END;
    }
    const uint32_t held = fv_source_frames_held(&source->selection);
    uint32_t slot = 0;
    while (slot < held && source->held[slot])
        slot++;
    if (slot == held) return FOVEA_AGAIN;
    const enum fovea_status status = advance_drive(source, deadline_ns);
    if (status != FOVEA_OK) return status;
    const struct fv_sim_options *o = &source->options;
    const int32_t pixels = o->width * o->height;
    const uint64_t n = source->delivered, index = frame_index(source, n);
    const uint64_t seed = o->seed ^ (index + 1) * 0x9E3779B97F4A7C15u;
    const uint32_t cameras = source->info.rig.camera_count;
    source->taken.exposure_ms = atomic_load(&source->requested.exposure_ms);
    source->taken.gain = atomic_load(&source->requested.gain);
    for (uint32_t k = 0; k < cameras; k++) {
        source->camera = k;
        render_frame(source, fv_sim_frame_time(source, index), seed + k * 0xC2B2AE3D27D4EB4Fu,
                     source->image[slot][k]);
    }
    source->camera = 0; /* truth is that of the first camera */
    source->image_index[slot] = index;
    source->held[slot] = true;
    source->delivered++;
    source->commands.last_stamp_ns = frame_stamp(source, n);
    if (has_ended(source)) fv_sim_commands_end(&source->commands);
    *frame = (struct fovea_frame){
        .image_count = cameras,
        .stamp_ns = frame_stamp(source, n),
        .clock = FOVEA_CLOCK_SIMULATED,
        .stamp_meaning = FOVEA_STAMP_EXPOSURE_MIDDLE,
        .sequence = index,
        .index = index,
        .slot = slot,
    };
    for (uint32_t k = 0; k < cameras; k++) {
        frame->exposure_ns[k] = fv_clock_from_ms(source->taken.exposure_ms);
        frame->images[k] =
            (struct fovea_image){source->image[slot][k], o->width,      o->height, o->width,
                                 FOVEA_PIXEL_GREY8,      (size_t)pixels};
    }
    return FOVEA_OK;
}

static void sim_requeue(struct fovea_source *source, const struct fovea_frame *frame)
{
    if (frame->slot < FOVEA_SOURCE_FRAMES_HELD_MAX) source->held[frame->slot] = false;
}

static enum fovea_status sim_control(struct fovea_source *source, enum fovea_source_control control,
                                     double value, struct fovea_error *error)
{
    const double period_ms = 1000 / source->options.rate_hz;
    const bool exposure = control == FOVEA_SOURCE_EXPOSURE;
    const double low = exposure ? 0.05 : gain_min, high = !exposure         ? gain_max
                                                          : period_ms < 100 ? period_ms
                                                                            : 100;
    const bool given = exposure ? value > 0 : value >= 0;
    if (given && !(value >= low && value <= high))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: %s: found %.10g, expected [%.10g, %.10g]",
                               exposure ? "exposure (ms)" : "gain", value, low, high);
    if (exposure)
        atomic_store(&source->requested.exposure_ms, given ? value : source->options.exposure_ms);
    else
        atomic_store(&source->requested.gain, given ? value : 1);
    return FOVEA_OK;
}

static void sim_counts(const struct fovea_source *source, struct fovea_source_counts *counts)
{
    *counts = (struct fovea_source_counts){.delivered = source->delivered};
}

static enum fovea_source_state sim_state(const struct fovea_source *source)
{
    return has_ended(source) ? FOVEA_SOURCE_ENDED : FOVEA_SOURCE_OK;
}

static enum fovea_status sim_drive(struct fovea_source *source,
                                   const struct fovea_velocity_command *command,
                                   struct fovea_error *error)
{
    return fv_sim_commands_bring(&source->commands, command, error);
}

static enum fovea_status sim_failure(const struct fovea_source *source, struct fovea_error *error)
{
    return fv_sim_commands_failure(&source->commands, error);
}

/* Where a driven robot's goal is, and how its way ended, once each. */
static enum fovea_status sim_complaint(struct fovea_source *source, struct fovea_error *error)
{
    return fv_sim_commands_tell(&source->commands, &source->world.drive, error);
}

const struct fovea_source_ops fv_source_sim = {
    .name = "sim",
    .help =
        "[TRAJECTORY][?OPTION=VALUE&...]  simulated camera: tour (default), orbit, corridor, rotate, stopgo, fast, kidnap, wander, still, stand, road, board, drive; options"
#define FV_SIM_OPTION(name, kind, type, member, value, low, high, unit, words) " " name
#include "options.def"
#undef FV_SIM_OPTION
    ,
    .open = sim_open,
    .info = sim_info,
    .start = sim_start,
    .dequeue = sim_dequeue,
    .requeue = sim_requeue,
    .stop = sim_stop,
    .close = sim_close,
    .truth = fv_sim_truth,
    .truth_pose = fv_sim_truth_pose,
    .samples = fv_sim_samples,
    .counts = sim_counts,
    .state = sim_state,
    .control = sim_control,
    .drive = sim_drive,
    .failure = sim_failure,
    .complaint = sim_complaint,
};
