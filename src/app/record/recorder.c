#include "app/record/recorder_internal.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/aligned.h"
#include "app/record/recording_header.h"
#include "support/say.h"
#include "support/stall.h"
#include "base/hash.h"
#include "drivers/thread.h"
#include "support/lcmlog.h"
#include "image/jpeg.h"
#include "message/recorded.h"
#include "runtime/lockstep.h"

enum {
    PACED_FRAMES = 4, /* the loop waits for the disk: no need to hold more */
    SMALL_BYTES =
        32 << 10, /* inputs, grants and the messages of one iteration that are not named below */
    FEATURE_BYTES = 16,
    OBJECTS_BYTES = 256 << 10 /* detections and objects, as many as there may be */
};

/* ---- the loop's side ------------------------------------------------------------------------- */

/* Room for an event with at most `bytes_max` of data; NULL ends the recording. */
static uint8_t *event_begin(struct fv_recorder *recorder, const char *channel, size_t bytes_max)
{
    if (atomic_load_explicit(&recorder->ending, memory_order_relaxed) != FV_RECORDER_RUNNING)
        return NULL;
    size_t channel_bytes = strlen(channel);
    uint8_t *event =
        fv_ring_reserve(&recorder->ring, FV_LCMLOG_HEADER_BYTES + channel_bytes + bytes_max);
    if (event == NULL) {
        int running = FV_RECORDER_RUNNING;
        atomic_compare_exchange_strong(&recorder->ending, &running, FV_RECORDER_SLOW);
        return NULL;
    }
    /* A log holds the bytes alone. NOLINTNEXTLINE(bugprone-not-null-terminated-result) */
    memcpy(event + FV_LCMLOG_HEADER_BYTES, channel, channel_bytes);
    return event;
}

static void event_end(struct fv_recorder *recorder, uint8_t *event, const char *channel,
                      int64_t time_us, uint32_t bytes)
{
    size_t channel_bytes = strlen(channel);
    fv_recording_event_head(event, recorder->event_number++, time_us, channel_bytes, bytes);
    fv_ring_commit(&recorder->ring, FV_LCMLOG_HEADER_BYTES + channel_bytes + bytes);
}

static uint8_t *data_of(uint8_t *event, const char *channel)
{
    return event + FV_LCMLOG_HEADER_BYTES + strlen(channel);
}

static void record_copy(struct fv_recorder *recorder, const char *channel, int64_t time_us,
                        const uint8_t *data, uint32_t bytes)
{
    uint8_t *event = event_begin(recorder, channel, bytes);
    if (event == NULL) return;
    memcpy(data_of(event, channel), data, bytes);
    event_end(recorder, event, channel, time_us, bytes);
}

static void record_messages(struct fv_recorder *recorder, int64_t time_us,
                            const struct fovea_outputs *outputs)
{
    for (uint32_t i = 0; i < outputs->message_count; i++)
        record_copy(recorder, outputs->messages[i].channel, time_us, outputs->messages[i].data,
                    outputs->messages[i].bytes);
}

static void record_frame(struct fv_recorder *recorder, int64_t time_us,
                         const struct fovea_inputs *inputs)
{
    const char *channel = recorder->channels[FV_MESSAGE_FRAME];
    size_t size = fv_message_frame_size_max(inputs->frame);
    uint8_t *event = event_begin(recorder, channel, size);
    if (event != NULL)
        event_end(recorder, event, channel, time_us,
                  fv_message_frame_encode(inputs->frame, inputs->utc_offset_ns,
                                          data_of(event, channel), size));
}

/* Each at its own time. */
static void record_samples(struct fv_recorder *recorder, const struct fovea_inputs *inputs)
{
    const size_t size = fv_message_sample_size_max();
    if (inputs->frame != NULL) recorder->clock = inputs->frame->clock;
    for (uint32_t i = 0; i < inputs->sample_count; i++) {
        const struct fovea_sample *sample = &inputs->samples[i];
        const char *channel = recorder->channels[fv_message_of_sample(sample->kind)];
        const fovea_stamp_t stamp = {.clock = (int8_t)recorder->clock,
                                     .utc_offset_ns = inputs->utc_offset_ns,
                                     .sequence = recorder->samples[sample->kind]++};
        uint8_t *event = event_begin(recorder, channel, size);
        if (event != NULL)
            event_end(recorder, event, channel,
                      (fovea_sample_stamp(sample) + inputs->utc_offset_ns) / 1000,
                      fv_message_sample_encode(sample, &stamp, data_of(event, channel), size));
    }
}

static int64_t event_time_us(const struct fovea_inputs *inputs)
{
    return (inputs->now_ns + inputs->utc_offset_ns) / 1000;
}

static void record_header(struct fv_recorder *recorder, int64_t time_us)
{
    if (!recorder->started)
        record_copy(recorder, recorder->channels[FV_MESSAGE_RECORDING], time_us, recorder->header,
                    recorder->header_bytes);
    recorder->started = true;
}

void fv_recorder_begin(struct fv_recorder *recorder, const struct fovea *rt,
                       const struct fovea_inputs *inputs)
{
    fovea_state_save(rt, recorder->setup.state);
    recorder->in_force = *fovea_config_get(rt);
    recorder->begin_us = event_time_us(inputs);
    recorder->started = true; /* the writer writes the header, which has number 0 */
    recorder->event_number = 1;
    atomic_store_explicit(&recorder->begun, true, memory_order_release);
}

void fv_recorder_parameter(struct fv_recorder *recorder, const struct fovea_inputs *inputs,
                           const char *key, const char *value)
{
    if (recorder == NULL ||
        atomic_load_explicit(&recorder->ending, memory_order_relaxed) != FV_RECORDER_RUNNING)
        return;
    const int64_t time_us = event_time_us(inputs);
    const char *channel = recorder->channels[FV_MESSAGE_PARAMETER];
    const size_t size = fv_message_parameter_size_max();
    record_header(recorder, time_us);
    uint8_t *event = event_begin(recorder, channel, size);
    if (event == NULL) return;
    event_end(recorder, event, channel, time_us,
              fv_message_parameter_encode(key, value, data_of(event, channel), size));
    recorder->before_step++;
}

void fv_recorder_map(struct fv_recorder *recorder, const struct fovea_inputs *inputs,
                     const char *file, const uint8_t *data, size_t bytes)
{
    if (recorder == NULL ||
        atomic_load_explicit(&recorder->ending, memory_order_relaxed) != FV_RECORDER_RUNNING)
        return;
    const int64_t time_us = event_time_us(inputs);
    const char *channel = recorder->channels[FV_MESSAGE_LOADED_MAP];
    const size_t size = fv_message_loaded_map_size_max(bytes);
    record_header(recorder, time_us);
    uint8_t *event = event_begin(recorder, channel, size);
    if (event == NULL) return;
    event_end(recorder, event, channel, time_us,
              fv_message_loaded_map_encode(file, data, bytes, data_of(event, channel), size));
    recorder->before_step++;
}

/* The inputs, and how many events before them belong to them. */
static void record_inputs(struct fv_recorder *recorder, int64_t time_us,
                          const struct fovea_inputs *inputs)
{
    const char *channel = recorder->channels[FV_MESSAGE_INPUTS];
    const size_t size = fv_message_inputs_size_max();
    uint8_t *event = event_begin(recorder, channel, size);
    if (event == NULL) return;
    struct fovea_inputs counted = *inputs;
    counted.sample_count += recorder->before_step;
    recorder->before_step = 0;
    event_end(recorder, event, channel, time_us,
              fv_message_inputs_encode(&counted, fv_lockstep_frame_hash(inputs->frame),
                                       data_of(event, channel), size));
}

void fv_recorder_step(struct fv_recorder *recorder, const struct fovea_inputs *inputs,
                      const struct fovea_outputs *outputs)
{
    if (recorder == NULL) return;
    if (atomic_load_explicit(&recorder->ending, memory_order_relaxed) != FV_RECORDER_RUNNING) {
        recorder->steps_lost++;
        return;
    }
    int64_t time_us = event_time_us(inputs);
    record_header(recorder, time_us);
    record_samples(recorder, inputs);
    if (inputs->frame != NULL) record_frame(recorder, time_us, inputs);
    record_inputs(recorder, time_us, inputs);
    record_messages(recorder, time_us, outputs);
}

void fv_recorder_work(struct fv_recorder *recorder, const struct fovea_inputs *inputs,
                      const struct fovea_grants *grants, const struct fovea_outputs *outputs)
{
    if (recorder == NULL) return;
    int64_t time_us = event_time_us(inputs);
    const char *channel = recorder->channels[FV_MESSAGE_GRANTS];
    size_t size = fv_message_grants_size_max();
    uint8_t *event = event_begin(recorder, channel, size);
    if (event == NULL) return;
    event_end(recorder, event, channel, time_us,
              fv_message_grants_encode(inputs->now_ns, grants, data_of(event, channel), size));
    record_messages(recorder, time_us, outputs);
}

bool fv_recorder_room(struct fv_recorder *recorder)
{
    return recorder == NULL || fv_ring_room(&recorder->ring) >= recorder->iteration_bytes ||
           atomic_load(&recorder->ending) != FV_RECORDER_RUNNING;
}

/* ---- opening and closing --------------------------------------------------------------------- */

static void release(struct fv_recorder *recorder)
{
    fv_output_discard(&recorder->place.output);
    free(recorder->header);
    if (recorder->setup.ring_memory == NULL) free(recorder->ring_memory);
    free(recorder);
}

static enum fovea_status start_thread(struct fv_recorder *recorder, struct fovea_error *error)
{
    int failed = fv_thread_start(&recorder->thread, fv_recorder_write, recorder);
    if (failed == 0) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: no thread to write it: %s",
                           recorder->path, strerror(failed));
}

/* The most that an iteration takes: the level that a preview shows has at most 1 / 1.4 of the
 * pixels of the one below it. */
static size_t iteration_bytes(const struct fv_recorder_setup *setup)
{
    const struct fovea_config *config = &setup->settings->runtime;
    size_t pixels = 0;
    for (uint32_t i = 0; i < config->preview.cameras && i < config->rig.camera_count; i++) {
        const struct fovea_camera *camera = &config->rig.cameras[i].camera;
        const size_t of_camera = (size_t)camera->width * (size_t)camera->height;
        if (of_camera > pixels) pixels = of_camera;
    }
    for (uint32_t level = 0; level < config->preview.level; level++)
        pixels = pixels * 10 / 14;
    const size_t sample_bytes =
        FV_LCMLOG_HEADER_BYTES + FV_MESSAGE_CHANNEL_BYTES + fv_message_sample_size_max();
    const size_t parameter_bytes =
        FV_LCMLOG_HEADER_BYTES + FV_MESSAGE_CHANNEL_BYTES + fv_message_parameter_size_max();
    const size_t map_bytes = setup->settings->map_folder[0] != '\0'
                                 ? FV_LCMLOG_HEADER_BYTES + FV_MESSAGE_CHANNEL_BYTES +
                                       fv_message_loaded_map_size_max(fovea_map_bytes_max(config))
                                 : 0;
    return setup->frame_bytes + map_bytes + fv_jpeg_capacity((int32_t)pixels, 1) + SMALL_BYTES +
           FOVEA_INPUT_SAMPLES_MAX * sample_bytes + FV_MESSAGE_PARAMETERS_MAX * parameter_bytes +
           (size_t)config->features.count_max * FEATURE_BYTES +
           (config->detect.model != NULL ? OBJECTS_BYTES : 0) +
           (config->detect2.model != NULL ? OBJECTS_BYTES : 0);
}

/* While the writer is at a header with a state, a disk that keeps up with the frames is behind by
 * the frames of the time that the state takes: as many bytes again. */
static size_t ring_bytes(const struct fv_recorder_setup *setup, size_t header_bytes)
{
    const size_t iteration = iteration_bytes(setup), least = 2 * (iteration + header_bytes) + 4096;
    const size_t frames = setup->real_time ? setup->settings->record_buffer : PACED_FRAMES;
    const size_t bytes = setup->ring_bytes != 0 ? setup->ring_bytes
                                                : frames * setup->frame_bytes + setup->state_bytes;
    return ((bytes > least ? bytes : least) + 63) / 64 * 64;
}

size_t fv_recorder_ring_bytes(const struct fv_recorder_setup *setup)
{
    return ring_bytes(setup, 0);
}

static enum fovea_status make_ring(struct fv_recorder *recorder,
                                   const struct fv_recorder_setup *setup, struct fovea_error *error)
{
    const bool given = setup->ring_memory != NULL;
    const size_t bytes = given ? setup->ring_bytes : ring_bytes(setup, recorder->header_bytes);
    recorder->iteration_bytes = iteration_bytes(setup) + recorder->header_bytes;
    recorder->ring_memory = given ? setup->ring_memory : fv_aligned_zeroed(bytes); /* touched */
    if (recorder->ring_memory == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory for %zu bytes of buffer",
                               recorder->path, bytes);
    fv_ring_init(&recorder->ring, recorder->ring_memory, bytes);
    return FOVEA_OK;
}

/* Last: by then nothing but the thread can fail, and an earlier recording is not replaced in vain.
 */
static enum fovea_status open_place(struct fv_recorder *recorder,
                                    const struct fv_recorder_setup *setup,
                                    struct fovea_error *error)
{
    const enum fovea_status status =
        fv_recording_file_open(&recorder->place, setup->path, setup->settings->record_keep, error);
    recorder->file = recorder->place.output.file;
    if (status == FOVEA_OK) strcpy(recorder->path, recorder->place.output.path);
    return status;
}

const char *fv_recorder_path(const struct fv_recorder *recorder)
{
    return recorder->path;
}

enum fovea_status fv_recorder_open(const struct fv_recorder_setup *setup,
                                   struct fv_recorder **recorder, struct fovea_error *error)
{
    struct fv_recorder *opened = fv_aligned_zeroed(sizeof *opened);
    if (opened == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory to record", setup->path);
    snprintf(opened->path, sizeof opened->path, "%s", setup->path);
    opened->written.hash = FV_HASH_START;
    fv_message_prepare();
    for (int kind = 0; kind < FV_MESSAGE_KIND_COUNT; kind++)
        fv_message_channel(setup->settings->runtime.channel_prefix, (enum fv_message_kind)kind,
                           opened->channels[kind]);
    signal(SIGXFSZ, SIG_IGN); /* a file size limit shall end the recording, not the run */
    enum fovea_status status = FOVEA_OK;
    opened->place.output = FV_OUTPUT_CLOSED;
    opened->setup = *setup;
    if (setup->state == NULL)
        status = fv_recording_header_encode(setup->settings, setup->identity, setup->kernel_set,
                                            setup->real_time, NULL, &opened->header,
                                            &opened->header_bytes, error);
    if (status == FOVEA_OK) status = make_ring(opened, setup, error);
    if (status == FOVEA_OK) status = open_place(opened, setup, error);
    if (status == FOVEA_OK) status = start_thread(opened, error);
    if (status != FOVEA_OK) {
        release(opened);
        return status;
    }
    *recorder = opened;
    return FOVEA_OK;
}

size_t fv_recorder_bytes(const struct fv_recorder_setup *setup)
{
    struct fovea_error error;
    uint8_t *header = NULL;
    uint32_t header_bytes = 0;
    if (fv_recording_header_encode(setup->settings, setup->identity, setup->kernel_set,
                                   setup->real_time, NULL, &header, &header_bytes,
                                   &error) != FOVEA_OK)
        return 0;
    free(header);
    return sizeof(struct fv_recorder) + ring_bytes(setup, header_bytes) + header_bytes +
           FV_THREAD_STACK_BYTES;
}

uint64_t fv_recorder_written(const struct fv_recorder *recorder)
{
    return atomic_load_explicit(&recorder->bytes, memory_order_relaxed);
}

bool fv_recorder_has_ended(const struct fv_recorder *recorder)
{
    return atomic_load(&recorder->ending) != FV_RECORDER_RUNNING;
}

void fv_recorder_stop(struct fv_recorder *recorder, const char *reason)
{
    snprintf(recorder->stop_reason, sizeof recorder->stop_reason, "%s", reason);
}

/* Of a run whose recording ended early: one without an iteration is of no use. */
static enum fv_recording_holds part_held(struct fv_recorder *recorder)
{
    if (recorder->written.iterations > 0 || !recorder->place.numbered) return FV_RECORDING_PART;
    if (recorder->reason[0] == '\0') return FV_RECORDING_NONE; /* stopped before it began */
    const size_t length = strlen(recorder->reason);
    snprintf(recorder->reason + length, sizeof recorder->reason - length,
             "; it held no iteration and is removed");
    return FV_RECORDING_NONE;
}

enum fovea_status fv_recorder_close(struct fv_recorder *recorder,
                                    struct fv_recorder_summary *summary)
{
    struct fv_recorder_summary closed = {.complete = true};
    if (recorder != NULL) {
        atomic_store_explicit(&recorder->stop, true, memory_order_release);
        pthread_join(recorder->thread, NULL);
        closed.complete = atomic_load(&recorder->ending) == FV_RECORDER_RUNNING;
        const int call = fv_stall_enter(recorder->path);
        struct fovea_error why;
        /* A numbered one without an iteration would push out one of an earlier run. */
        const bool empty = recorder->written.iterations == 0 &&
                           (recorder->setup.state != NULL || recorder->place.numbered);
        const enum fv_recording_holds holds =
            closed.complete && !empty ? FV_RECORDING_ALL : part_held(recorder);
        if (fv_recording_file_close(&recorder->place, holds, &why) != FOVEA_OK && closed.complete) {
            snprintf(recorder->reason, sizeof recorder->reason, "%.180s", why.text);
            fv_recorder_say_ended(recorder);
            closed.complete = false;
        }
        closed.removed = holds == FV_RECORDING_NONE;
        memcpy(closed.path, recorder->place.output.path, sizeof closed.path);
        fv_stall_leave(call);
        closed.events = recorder->written.events;
        closed.bytes = recorder->written.bytes;
        closed.steps_lost = recorder->steps_lost;
        memcpy(closed.reason, recorder->reason, sizeof closed.reason);
        release(recorder);
    }
    if (summary != NULL) *summary = closed;
    return closed.complete ? FOVEA_OK : FOVEA_ERROR_SYSTEM;
}
