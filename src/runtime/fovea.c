/* The loop: one step per frame, then work. */
#include <string.h>

#include "runtime/jobs.h"
#include "runtime/state.h"

/* ---- stage clock -------------------------------------------------------------------------------------------- */

struct fv_instant fv_stage_begin(struct fovea *rt)
{
    struct fv_instant now = {0, 0};
    if (rt->config.clock != NULL) rt->config.clock(rt->config.clock_context, &now.wall_ns, &now.cpu_ns);
    return now;
}

void fv_stage_end(struct fovea *rt, enum fovea_stage stage, struct fv_instant begin)
{
    const struct fv_instant end = fv_stage_begin(rt);
    rt->times.wall_ns[stage] = end.wall_ns - begin.wall_ns;
    rt->times.cpu_ns[stage] = end.cpu_ns - begin.cpu_ns;
}

/* ---- taking inputs ------------------------------------------------------------------------------------------ */

/* Forget what was learnt; counters of frames go on. */
static void reset(struct fovea *rt)
{
    struct fv_state *state = rt->state;
    state->reset_counter++;
    state->any_frame = 0;
    state->features = 0;
    memset(rt->preview.state, 0, sizeof *rt->preview.state);
    fovea_random_seed(&state->random, rt->config.seed);
}

static void take_commands(struct fovea *rt, uint32_t commands, struct fovea_outputs *outputs)
{
    if (commands & FOVEA_COMMAND_RESET) reset(rt);
    if (commands & FOVEA_COMMAND_PAUSE) rt->state->paused = 1;
    if (commands & FOVEA_COMMAND_RESUME) rt->state->paused = 0;
    outputs->save_asked = (commands & FOVEA_COMMAND_SAVE) != 0;
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
    const struct fovea_image *image = &frame->image;
    if (state->paused) {
        state->refused_paused++;
    } else if (fovea_image_check(image) != FOVEA_OK || image->width != rt->config.camera.width ||
               image->height != rt->config.camera.height || image->format == FOVEA_PIXEL_MJPEG) {
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
    state->frame = (struct fv_frame_id){
        .stamp_ns = frame->stamp_ns,
        .exposure_ns = frame->exposure_ns,
        .utc_offset_ns = utc_offset_ns,
        .sequence = frame->sequence,
        .clock = (uint32_t)frame->clock,
        .stamp_meaning = (uint32_t)frame->stamp_meaning,
        .pixel_format = (uint32_t)frame->image.format,
    };
    state->any_frame = 1;
    state->frames_processed++;
}

/* ---- encode ------------------------------------------------------------------------------------------------- */

fovea_stamp_t fv_stamp_of(const struct fv_frame_id *id)
{
    const struct fovea_frame frame = {
        .stamp_ns = id->stamp_ns,
        .exposure_ns = id->exposure_ns,
        .clock = (enum fovea_clock)id->clock,
        .stamp_meaning = (enum fovea_stamp_meaning)id->stamp_meaning,
        .sequence = id->sequence,
    };
    return fv_message_stamp(&frame, id->utc_offset_ns);
}

static fovea_stamp_t last_stamp(const struct fovea *rt)
{
    return rt->state->any_frame ? fv_stamp_of(&rt->state->frame) : fv_message_stamp(NULL, 0);
}

static void encode_features(struct fovea *rt, uint32_t asked, struct fovea_outputs *outputs)
{
    struct fv_message_features message = {
        .stamp = last_stamp(rt),
        .reset_counter = rt->state->reset_counter,
        .width = rt->config.camera.width,
        .height = rt->config.camera.height,
        .asked = asked,
    };
    message.features = fovea_features_get(rt, &message.count);
    struct fv_outbox *outbox = &rt->outbox;
    fv_output_add(rt, FV_MESSAGE_FEATURES,
                  fv_message_features_encode(&message, outbox->features_scratch, outbox->buffer[FV_MESSAGE_FEATURES],
                                             outbox->capacity[FV_MESSAGE_FEATURES]),
                  outputs);
}

static void encode_camera_status(struct fovea *rt, const struct fovea_inputs *inputs, struct fovea_outputs *outputs)
{
    const struct fv_message_camera_status message = {
        .stamp = last_stamp(rt),
        .now_ns = inputs->now_ns,
        .state = inputs->source_state,
        .width = rt->config.camera.width,
        .height = rt->config.camera.height,
        .pixel_format = fovea_pixel_format_name((enum fovea_pixel_format)rt->state->frame.pixel_format),
        .exposure_ns = rt->state->frame.exposure_ns,
        .counts = inputs->source_counts,
    };
    fv_output_add(rt, FV_MESSAGE_CAMERA_STATUS,
                  fv_message_camera_status_encode(&message, rt->outbox.buffer[FV_MESSAGE_CAMERA_STATUS],
                                                  rt->outbox.capacity[FV_MESSAGE_CAMERA_STATUS]),
                  outputs);
}

static void encode_statistics(struct fovea *rt, struct fovea_outputs *outputs)
{
    const char *stages[FOVEA_STAGE_COUNT], *jobs[FOVEA_JOB_COUNT];
    for (int i = 0; i < FOVEA_STAGE_COUNT; i++) stages[i] = fovea_stage_name((enum fovea_stage)i);
    for (int i = 0; i < FOVEA_JOB_COUNT; i++) jobs[i] = fovea_job_name((enum fovea_job)i);
    struct fovea_stats stats;
    fovea_stats_get(rt, &stats);
    const struct fv_message_statistics message = {
        .stamp = last_stamp(rt),
        .kernel_set = fovea_cpu_name(rt),
        .stats = &stats,
        .inputs = &rt->inputs,
        .work_grants = &rt->work_grants,
        .units_done = rt->units_done,
        .jobs_waiting = fv_jobs_waiting(rt),
        .memory_bytes = rt->part_bytes,
        .stage_names = stages,
        .job_names = jobs,
    };
    fv_output_add(rt, FV_MESSAGE_STATISTICS,
                  fv_message_statistics_encode(&message, rt->outbox.buffer[FV_MESSAGE_STATISTICS],
                                               rt->outbox.capacity[FV_MESSAGE_STATISTICS]),
                  outputs);
}

static bool every(uint64_t steps, uint32_t period)
{
    return period != 0 && steps % period == 0;
}

static void encode(struct fovea *rt, const struct fovea_inputs *inputs, bool processed, struct fovea_outputs *outputs)
{
    const struct fovea_config *config = &rt->config;
    const uint64_t steps = rt->state->steps;
    if (processed && every(rt->state->frames_processed - 1, config->features_every)) {
        encode_features(rt, inputs->grants.features, outputs);
    }
    if (every(steps, config->camera_status_every)) encode_camera_status(rt, inputs, outputs);
    if (every(steps, config->statistics_every)) encode_statistics(rt, outputs);
}

/* ---- the loop ----------------------------------------------------------------------------------------------- */

static void ask_preview(struct fovea *rt)
{
    const bool due = every(rt->state->frames_processed - 1, rt->config.preview.period_frames);
    if (due || rt->preview.state->due) fv_preview_ask(&rt->preview, &rt->state->frame);
}

static void process(struct fovea *rt, const struct fovea_inputs *inputs)
{
    struct fv_instant begin = fv_stage_begin(rt);
    fv_pyramid_build(&rt->pyramid, &rt->kernels, &inputs->frame->image);
    fv_stage_end(rt, FOVEA_STAGE_PYRAMID, begin);

    begin = fv_stage_begin(rt);
    rt->state->features =
        fv_features_find(&rt->features, &rt->kernels, &rt->pyramid, rt->mask, inputs->grants.features);
    fv_stage_end(rt, FOVEA_STAGE_FEATURES, begin);
}

enum fovea_status fovea_step(struct fovea *rt, const struct fovea_inputs *inputs, struct fovea_outputs *outputs)
{
    memset(outputs, 0, sizeof *outputs);
    rt->inputs = *inputs;
    take_commands(rt, inputs->commands, outputs);
    const bool processed = admit(rt, inputs->frame);
    if (processed) {
        remember(rt->state, inputs->frame, inputs->utc_offset_ns);
        process(rt, inputs);
        ask_preview(rt);
    }
    const struct fv_instant begin = fv_stage_begin(rt);
    encode(rt, inputs, processed, outputs);
    fv_stage_end(rt, FOVEA_STAGE_ENCODE, begin);
    rt->inputs.frame = NULL; /* the caller's, and gone after this */
    rt->state->steps++;
    outputs->jobs_waiting = fv_jobs_waiting(rt);
    return processed ? FOVEA_OK : FOVEA_AGAIN;
}

static const enum fovea_stage stage_of_job[FOVEA_JOB_COUNT] = {[FOVEA_JOB_PREVIEW] = FOVEA_STAGE_PREVIEW};

enum fovea_status fovea_work(struct fovea *rt, const struct fovea_grants *grants, struct fovea_outputs *outputs)
{
    memset(outputs, 0, sizeof *outputs);
    rt->work_grants = *grants;
    for (int job = 0; job < FOVEA_JOB_COUNT; job++) {
        const struct fv_instant begin = fv_stage_begin(rt);
        rt->units_done[job] = fv_job_advance(rt, (enum fovea_job)job, grants->units[job], outputs);
        outputs->units_done[job] = rt->units_done[job];
        fv_stage_end(rt, stage_of_job[job], begin);
    }
    outputs->jobs_waiting = fv_jobs_waiting(rt);
    return outputs->jobs_waiting ? FOVEA_AGAIN : FOVEA_OK;
}

/* ---- looking inside ----------------------------------------------------------------------------------------- */

const struct fovea_feature *fovea_features_get(const struct fovea *rt, uint32_t *count)
{
    *count = rt->state->features;
    return rt->features.list;
}

const char *fovea_stage_name(enum fovea_stage stage)
{
    static const char *const names[FOVEA_STAGE_COUNT] = {"pyramid", "features", "encode", "preview"};
    return stage >= 0 && stage < FOVEA_STAGE_COUNT ? names[stage] : "unknown";
}

const char *fovea_job_name(enum fovea_job job)
{
    static const char *const names[FOVEA_JOB_COUNT] = {"preview"};
    return job >= 0 && job < FOVEA_JOB_COUNT ? names[job] : "unknown";
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
        .reset_counter = state->reset_counter,
        .features = state->features,
    };
    memcpy(stats->stage_cpu_ns, rt->times.cpu_ns, sizeof stats->stage_cpu_ns);
    memcpy(stats->stage_wall_ns, rt->times.wall_ns, sizeof stats->stage_wall_ns);
}

const char *fovea_cpu_name(const struct fovea *rt)
{
    return fv_cpu_set_name(rt->kernels.set);
}
