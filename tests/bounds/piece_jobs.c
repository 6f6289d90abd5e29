/* Of messages, networks, previews, and what a step does besides its stages. */
#include <stdlib.h>
#include <string.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/pieces.h"
#include "objects/assign.h"
#include "runtime/jobs.h"

struct working {
    struct fovea *rt;
    enum fovea_job job;
    struct fovea_inputs inputs;
    struct fovea_outputs outputs;
    struct fovea_frame frame;
    uint8_t *pixels;
};

/* ---- messages -------------------------------------------------------------------------------- */

static void encode(void *context)
{
    struct working *w = context;
    memset(&w->outputs, 0, sizeof w->outputs);
    fv_encode(w->rt, &w->inputs, true, false, &w->outputs);
}

/* Poses turned half around an axis; axis 3: not turned. */
static void turn_all(struct fovea *rt, int axis, enum fovea_tracking_state state)
{
    struct fovea_pose *pose = &rt->odometry.state->pose;
    for (int i = 0; i < 9; i++) {
        const double element = i % 4 != 0 ? 0 : axis == 3 || i / 4 == axis ? 1 : -1;
        for (uint32_t k = 0; k < rt->config.odometry.keyframes; k++)
            rt->odometry.map.keyframes[k].T_cam_world.R[i] = element;
        pose->T_world_cam[i / 3 * 4 + i % 3] = pose->T_map_world[i / 3 * 4 + i % 3] =
            pose->T_keyframe_cam[i / 3 * 4 + i % 3] = element;
    }
    pose->map_scale = pose->scale = 1;
    pose->posed = true;
    pose->state = state;
    fv_publish_step(&rt->publish, &rt->odometry, &rt->scale, NULL, axis + 1);
}

/* All kinds are due, and full. */
static void of_messages(struct working *w)
{
    enum { STATES = FOVEA_TRACKING_COASTING + 1, SOURCE_STATES = FOVEA_SOURCE_ENDED + 1 };
    struct fovea *rt = w->rt;
    full_map_fill(&rt->odometry, FV_MAP_OBSERVERS_MAX);
    rt->state->features = rt->front_end.features.count = rt->config.features.count_max;
    for (uint32_t f = 0; f < rt->state->features; f++)
        rt->front_end.features.list[f] =
            (struct fovea_feature){.x_px = 100.5f, .y_px = 100.25f, .size_px = 31, .level = 7};
    rt->state->any_frame = 1;
    rt->state->frames_processed = 1;
    rt->state->steps = 0;
    for (int n = 0; n < 8 * STATES; n++) { /* quaternions take four ways, texts differ */
        rt->scale.state->known = n >= 4 * STATES;
        rt->scale.state->source = FOVEA_SCALE_CAMERA_HEIGHT;
        rt->scale.state->log_scale = 0.01 * n;
        rt->scale.state->variance = 0.01;
        turn_all(rt, n % 4, (enum fovea_tracking_state)(n / 4 % STATES));
        rt->state->map_keyframe = rt->state->map_landmark = 0;
        w->inputs.source_state = (enum fovea_source_state)(n / 4 % SOURCE_STATES);
        rt->state->frame.pixel_format = (uint32_t)(n % FOVEA_PIXEL_FORMAT_COUNT);
        NOTE(encoded, encode, w, 1);
    }
}

/* ---- besides the stages ---------------------------------------------------------------------- */

static void observe(void *context)
{
    struct working *w = context;
    fv_scale_observe(&w->rt->scale, w->inputs.samples, w->inputs.sample_count);
}

static void offer(void *context)
{
    struct working *w = context;
    fv_jobs[FOVEA_JOB_DETECT]->frame(w->rt, &w->frame);
}

static void ask(void *context)
{
    struct working *w = context;
    fv_jobs[FOVEA_JOB_PREVIEW]->frame(w->rt, &w->frame);
    fv_jobs[FOVEA_JOB_EDGES]->frame(w->rt, &w->frame);
}

static void take_boxes(void *context)
{
    struct working *w = context;
    w->rt->inputs = w->inputs;
    memset(&w->outputs, 0, sizeof w->outputs);
    fv_boxes_take(&w->rt->boxes, 0, w->inputs.boxes, FOVEA_INPUT_BOXES_MAX);
}

static void of_step(struct working *w)
{
    static struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX];
    for (int i = 0; i < FOVEA_INPUT_SAMPLES_MAX; i++)
        samples[i].any.stamp_ns = 1000000 * (i + 1);
    w->inputs.samples = samples;
    w->inputs.sample_count = FOVEA_INPUT_SAMPLES_MAX;
    NOTE(samples_observed, observe, w, 1);
    NOTE(inputs_taken, take_boxes, w, 1);
    NOTE(jobs_asked, ask, w, 1);
}

/* ---- units ----------------------------------------------------------------------------------- */

static void unit(void *context)
{
    struct working *w = context;
    (void)fv_jobs[w->job]->advance(w->rt, 1, &w->outputs);
}

static void noise(struct working *w)
{
    const struct fovea_camera *camera = &w->rt->config.rig.cameras[0].camera;
    const size_t pixels = (size_t)camera->width * (size_t)camera->height;
    for (size_t i = 0; i < 3 * pixels; i++)
        w->pixels[i] = (uint8_t)((uint32_t)(i + 1) * 2654435761u >> 19);
    w->frame = (struct fovea_frame){.stamp_ns = 1, .image_count = 1};
    w->frame.images[0] = (struct fovea_image){.data = w->pixels,
                                              .width = camera->width,
                                              .height = camera->height,
                                              .stride_bytes = 3 * camera->width,
                                              .format = FOVEA_PIXEL_RGB24,
                                              .size_bytes = 3 * pixels};
}

static void of_preview(struct working *w)
{
    w->job = FOVEA_JOB_PREVIEW;
    w->rt->config.preview.quality = 100; /* no coefficient vanishes */
    fv_front_end_take(&w->rt->front_end, &w->rt->kernels, &w->frame.images[0]);
    const struct fv_plane *level = fv_pyramid_level(
        fv_seen_pyramid(&w->rt->front_end.images, FV_VIEWER_PREVIEW), w->rt->config.preview.level);
    for (int32_t y = 0; y < level->height; y++)
        for (int32_t x = 0; x < level->width; x++)
            fv_plane_row(level, y)[x] =
                (uint32_t)(y * 7919 + x + 1) * 2654435761u >> 19 & 1 ? 255 : 0;
    fv_preview_ask(&w->rt->preview, &w->rt->state->frame, 0);
    while (fv_preview_waiting(&w->rt->preview)) {
        memset(&w->outputs, 0, sizeof w->outputs);
        NOTE(preview_unit, unit, w, 1);
    }
}

/* The outputs of the network: all alike and high, or the later the higher. */
static void spoil(struct working *w, int how)
{
    const struct fv_detect_memory *memory = &w->rt->detection.memory;
    const struct fv_model *model = memory->nn.model;
    for (uint32_t i = 0; i < model->header->output_count; i++) {
        uint8_t *data = fv_nn_tensor(model, memory->nn.arena, model->outputs[i]);
        const size_t bytes = (size_t)model->tensors[model->outputs[i]].bytes;
        for (size_t k = 0; k < bytes; k++)
            data[k] =
                how == 0 ? 127 : (uint8_t)(how == 1 ? k * 127 / bytes : k * 2654435761u >> 20);
    }
}

static enum piece decoding_piece(const struct working *w)
{
    const int32_t phase = w->rt->detection.memory.scratch->progress.phase;
    return phase == FV_DECODE_SCAN   ? PIECE_candidates_read
           : phase == FV_DECODE_SORT ? PIECE_candidates_sorted
                                     : PIECE_candidates_removed;
}

static void of_network(struct working *w)
{
    enum { WAYS = 3 };
    struct fv_detect_memory *memory = &w->rt->detection.memory;
    if (!w->rt->detection.enabled) return;
    w->job = FOVEA_JOB_DETECT;
    for (int how = 0; how < WAYS; how++) {
        bool spoilt = false;
        w->frame.stamp_ns++;
        NOTE(picture_copied, offer, w, 1);
        MUST(!fv_nn_job_idle(&memory->nn));
        while (fv_detection_waiting(&w->rt->detection)) {
            const int32_t phase = memory->job->nn.phase;
            memset(&w->outputs, 0, sizeof w->outputs);
            if (phase == FV_NN_JOB_DONE && !spoilt) spoil(w, how);
            spoilt = spoilt || phase == FV_NN_JOB_DONE;
            const enum piece piece = phase == FV_NN_JOB_FILL   ? PIECE_network_input
                                     : phase == FV_NN_JOB_RUN  ? PIECE_network_unit
                                     : phase == FV_NN_JOB_DONE ? decoding_piece(w)
                                                               : PIECE_boxes_sent;
            piece_note(piece, (double)counter_of(unit, w));
        }
    }
}

/* As many detections as a message holds, in other places each time, so that objects fill up. */
static void detect(struct working *w, uint32_t time)
{
    const struct fv_detect_memory *memory = &w->rt->detection.memory;
    struct fv_detection_state *state = w->rt->detection.state;
    struct fv_detect_job *job = memory->job;
    job->count = (int32_t)w->rt->config.detect.count_max;
    job->uncertain = 0;
    job->found_stamp_ns = INT64_C(100000000) * (time + 1);
    job->found_sequence = time + 1;
    for (int32_t i = 0; i < job->count; i++) {
        const float x = (float)(((uint32_t)i * 53 + time * 17) % 500),
                    y = (float)(((uint32_t)i * 29 + time * 7) % 400);
        job->found[i] = (struct fovea_detection){
            .x_min_px = x, .y_min_px = y, .x_max_px = x + 90, .y_max_px = y + 70, .score = 0.9f};
    }
    state->mapping = FV_DETECTION_MAPPING;
    state->mapped = 0;
    state->frame.stamp_ns = job->found_stamp_ns;
}

static void assign(void *context)
{
    struct working *w = context;
    const struct fv_objects *pool = &w->rt->objects.pool;
    const int32_t rows = (int32_t)w->rt->config.objects.count_max,
                  columns = (int32_t)w->rt->config.detect.count_max;
    fv_assign(pool->cost, columns, rows, columns, pool->assign, pool->column_of);
}

/* A matrix of products, in which every row takes a column from all before it. */
static void of_objects(struct working *w)
{
    enum { TIMES = 12 };
    const int32_t rows = (int32_t)w->rt->config.objects.count_max,
                  columns = (int32_t)w->rt->config.detect.count_max;
    if (!w->rt->objects.enabled) return;
    for (uint32_t time = 0; time < TIMES; time++) {
        detect(w, time);
        while (w->rt->detection.state->mapping != FV_DETECTION_IDLE) {
            memset(&w->outputs, 0, sizeof w->outputs);
            NOTE(boxes_sent, unit, w, 1);
        }
    }
    for (int32_t r = 0; r < rows; r++)
        for (int32_t c = 0; c < columns; c++)
            w->rt->objects.pool.cost[r * columns + c] =
                (float)(r + 1) * (float)(c + 1) / (float)((rows + 1) * (columns + 1));
    NOTE(objects_assigned, assign, w, 1);
}

/* ---- the clock ------------------------------------------------------------------------------- */

/* What a stage without work takes: jobs that are granted nothing. */
static void of_clock(struct working *w)
{
    const struct fovea_grants none = {.features = 0};
    struct fovea_stats stats;
    w->rt->config.clock = counter_clock;
    (void)fovea_work(w->rt, &none, &w->outputs);
    fovea_stats_get(w->rt, &stats);
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        piece_note(PIECE_clock, (double)stats.stage_wall_ns[FOVEA_STAGE_JOBS + job]);
    w->rt->config.clock = NULL;
}

void pieces_of_jobs(struct fovea *rt)
{
    static struct working w;
    const struct fovea_camera *camera = &rt->config.rig.cameras[0].camera;
    w.rt = rt;
    w.pixels = malloc(3 * (size_t)camera->width * (size_t)camera->height);
    MUST(w.pixels != NULL);
    noise(&w);
    of_preview(&w);
    of_network(&w);
    of_objects(&w);
    of_clock(&w);
    of_step(&w);
    of_messages(&w);
    free(w.pixels);
}
