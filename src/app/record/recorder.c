#include "app/record/recorder.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "support/aligned.h"
#include "app/record/recording_file.h"
#include "app/record/recording_header.h"
#include "support/say.h"
#include "support/stall.h"
#include "base/hash.h"
#include "base/ring.h"
#include "drivers/thread.h"
#include "support/lcmlog.h"
#include "image/jpeg.h"
#include "message/message.h"
#include "message/recorded.h"
#include "message/wire.h"
#include "runtime/lockstep.h"

enum {
    PACED_FRAMES = 4, /* the loop waits for the disk: no need to hold more */
    SMALL_BYTES =
        32 << 10, /* inputs, grants and the messages of one iteration that are not named below */
    FEATURE_BYTES = 16,
    OBJECTS_BYTES = 256 << 10, /* detections and objects, as many as there may be */
    WRITE_BYTES_MAX = 1 << 20,
    POLL_NS = 4000000,
    LOOK_POLLS = 64 /* between looks whether the file is still there: 0.3 s */
};

enum ending { RUNNING = 0, ENDED_SLOW = 1, ENDED_FAILED = 2 };

/* How far the log goes: up to here it could end. */
struct extent {
    uint64_t events, bytes, iterations, hash;
    int64_t time_us; /* of the last event */
};

struct fv_recorder {
    struct fv_ring ring;
    void *ring_memory;
    size_t iteration_bytes;          /* room that pace waits for */
    char path[FV_OUTPUT_PATH_BYTES]; /* of the file that is written */
    char channels[FV_MESSAGE_KIND_COUNT][FV_MESSAGE_CHANNEL_BYTES];

    /* The loop thread's. */
    uint8_t *header; /* encoded recording_t, sent with the first iteration since it needs a time */
    uint32_t header_bytes;
    bool started;
    int64_t event_number;
    uint64_t steps_lost;
    int64_t samples[FOVEA_SAMPLE_KIND_COUNT]; /* so far */
    uint32_t parameters;                      /* changes recorded for the step to come */
    enum fovea_clock clock;                   /* of the frames, of which the last said so */

    /* Shared. */
    atomic_int ending; /* enum ending; set by either thread, once */
    atomic_bool stop;  /* no more will come */

    /* The writer's. */
    pthread_t thread;
    struct fv_recording_file place;
    int file;                /* of `place` */
    int looks;               /* since the file was looked for */
    struct extent written;   /* whole events */
    struct extent iteration; /* those before the last iteration that has begun */
    bool iteration_begun;    /* by samples or a frame: the inputs that follow belong to it */
    char reason[FV_RECORDING_END_REASON_BYTES];
};

/* ---- the loop's side ------------------------------------------------------------------------- */

/* Room for an event with at most `bytes_max` of data; NULL ends the recording. */
static uint8_t *event_begin(struct fv_recorder *recorder, const char *channel, size_t bytes_max)
{
    if (atomic_load_explicit(&recorder->ending, memory_order_relaxed) != RUNNING) return NULL;
    size_t channel_bytes = strlen(channel);
    uint8_t *event =
        fv_ring_reserve(&recorder->ring, FV_LCMLOG_HEADER_BYTES + channel_bytes + bytes_max);
    if (event == NULL) {
        int running = RUNNING;
        atomic_compare_exchange_strong(&recorder->ending, &running, ENDED_SLOW);
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

void fv_recorder_parameter(struct fv_recorder *recorder, const struct fovea_inputs *inputs,
                           const char *key, const char *value)
{
    if (recorder == NULL ||
        atomic_load_explicit(&recorder->ending, memory_order_relaxed) != RUNNING)
        return;
    const int64_t time_us = event_time_us(inputs);
    const char *channel = recorder->channels[FV_MESSAGE_PARAMETER];
    const size_t size = fv_message_parameter_size_max();
    record_header(recorder, time_us);
    uint8_t *event = event_begin(recorder, channel, size);
    if (event == NULL) return;
    event_end(recorder, event, channel, time_us,
              fv_message_parameter_encode(key, value, data_of(event, channel), size));
    recorder->parameters++;
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
    counted.sample_count += recorder->parameters;
    recorder->parameters = 0;
    event_end(recorder, event, channel, time_us,
              fv_message_inputs_encode(&counted, fv_lockstep_frame_hash(inputs->frame),
                                       data_of(event, channel), size));
}

void fv_recorder_step(struct fv_recorder *recorder, const struct fovea_inputs *inputs,
                      const struct fovea_outputs *outputs)
{
    if (recorder == NULL) return;
    if (atomic_load_explicit(&recorder->ending, memory_order_relaxed) != RUNNING) {
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

static void sleep_a_little(void)
{
    const struct timespec pause = {.tv_nsec = POLL_NS};
    nanosleep(&pause, NULL);
}

bool fv_recorder_room(struct fv_recorder *recorder)
{
    return recorder == NULL || fv_ring_room(&recorder->ring) >= recorder->iteration_bytes ||
           atomic_load(&recorder->ending) != RUNNING;
}

/* ---- the writer ------------------------------------------------------------------------------ */

/* Lengths as an event's header states them. */
static uint32_t channel_bytes_of(const uint8_t *event)
{
    return (uint32_t)fv_wire_read(event + 20, 4);
}

static uint32_t data_bytes_of(const uint8_t *event)
{
    return (uint32_t)fv_wire_read(event + 24, 4);
}

static size_t event_bytes(const uint8_t *event)
{
    return FV_LCMLOG_HEADER_BYTES + (size_t)channel_bytes_of(event) + data_bytes_of(event);
}

/* The bytes of the whole events within the first `limit` bytes of `data`, at least one. */
static size_t whole_events(const uint8_t *data, size_t bytes, size_t limit)
{
    size_t at = 0;
    while (at < bytes && (at == 0 || at + event_bytes(data + at) <= limit))
        at += event_bytes(data + at);
    return at;
}

static bool is_on(const struct fv_recorder *recorder, const uint8_t *event,
                  enum fv_message_kind kind)
{
    const char *channel = recorder->channels[kind];
    return channel_bytes_of(event) == strlen(channel) &&
           memcmp(event + FV_LCMLOG_HEADER_BYTES, channel, strlen(channel)) == 0;
}

/* Whether inputs are still to come in the iteration that begins with it. */
static bool before_inputs(const struct fv_recorder *recorder, const uint8_t *event)
{
    bool sample = false;
    for (int kind = 0; kind < FOVEA_SAMPLE_KIND_COUNT; kind++)
        sample = sample || is_on(recorder, event, fv_message_of_sample(kind));
    return sample || is_on(recorder, event, FV_MESSAGE_PARAMETER) ||
           is_on(recorder, event, FV_MESSAGE_FRAME);
}

static bool begins_iteration(const struct fv_recorder *recorder, const uint8_t *event)
{
    return !recorder->iteration_begun &&
           (before_inputs(recorder, event) || is_on(recorder, event, FV_MESSAGE_INPUTS));
}

static void count_event(struct fv_recorder *recorder, const uint8_t *event)
{
    const size_t head_bytes = FV_LCMLOG_HEADER_BYTES + channel_bytes_of(event);
    struct extent *written = &recorder->written;
    if (begins_iteration(recorder, event)) {
        recorder->iteration = *written;
        written->iterations++;
    }
    recorder->iteration_begun = before_inputs(recorder, event);
    written->hash = fv_recording_hash_event(written->hash, event, head_bytes, event + head_bytes,
                                            data_bytes_of(event));
    written->time_us = (int64_t)fv_wire_read(event + 12, 8);
    written->bytes += event_bytes(event);
    written->events++;
}

/* How many bytes were written; fewer than asked: errno says why. */
static size_t write_bytes(int file, const char *path, const uint8_t *data, size_t bytes)
{
    size_t done = 0;
    const int call = fv_stall_enter(path);
    while (done < bytes) {
        ssize_t wrote = write(file, data + done, bytes - done);
        if (wrote < 0 && errno == EINTR) continue;
        if (wrote == 0) errno = ENOSPC;
        if (wrote <= 0) break;
        done += (size_t)wrote;
        fv_stall_move(call);
    }
    const int reason = errno;
    fv_stall_leave(call);
    errno = reason;
    return done;
}

/* The last message: without it, a replay takes the log for one that was cut off. Not in a log that
 * has not begun. */
static bool write_end(struct fv_recorder *recorder)
{
    const struct extent *at = &recorder->written;
    const char *channel = recorder->channels[FV_MESSAGE_RECORDING_END];
    const size_t channel_bytes = strlen(channel),
                 head_bytes = FV_LCMLOG_HEADER_BYTES + channel_bytes;
    uint8_t event[FV_LCMLOG_HEADER_BYTES + FV_MESSAGE_CHANNEL_BYTES + FV_RECORDING_END_BYTES_MAX];
    struct fv_recording_end end = {
        .iterations = at->iterations, .events = at->events, .hash = at->hash};
    if (at->events == 0) return true;
    memcpy(end.reason, recorder->reason, sizeof end.reason);
    const uint32_t bytes =
        fv_recording_end_encode(&end, event + head_bytes, FV_RECORDING_END_BYTES_MAX);
    fv_recording_event_head(event, (int64_t)at->events, at->time_us, channel_bytes, bytes);
    /* A log holds the bytes alone. NOLINTNEXTLINE(bugprone-not-null-terminated-result) */
    memcpy(event + FV_LCMLOG_HEADER_BYTES, channel, channel_bytes);
    if (write_bytes(recorder->file, recorder->path, event, head_bytes + bytes) < head_bytes + bytes)
        return false;
    recorder->written.events++;
    recorder->written.bytes += head_bytes + bytes;
    return true;
}

static bool cut_to(struct fv_recorder *recorder, const struct extent *extent)
{
    if (ftruncate(recorder->file, (off_t)extent->bytes) != 0) return false;
    recorder->written = *extent;
    return lseek(recorder->file, (off_t)extent->bytes, SEEK_SET) >= 0;
}

/* End the log before the run, after a whole iteration: the one that is written, when
 * `between_iterations`, and else (or when that leaves no room for the log's own end) the one before
 * it. */
static void end_early(struct fv_recorder *recorder, enum ending ending, const char *reason,
                      bool between_iterations)
{
    const struct extent iteration = recorder->iteration;
    snprintf(recorder->reason, sizeof recorder->reason, "%s", reason);
    atomic_store(&recorder->ending, ending);
    if (between_iterations && cut_to(recorder, &recorder->written) && write_end(recorder)) return;
    if (cut_to(recorder, &iteration)) {
        if (!write_end(recorder)) cut_to(recorder, &iteration);
    } else {
        snprintf(recorder->reason, sizeof recorder->reason,
                 "%.120s, and its end could not be cut to a whole iteration", reason);
    }
}

/* Write one run of whole events from the ring. False: nothing to do, or the disk refused. */
static bool write_some(struct fv_recorder *recorder)
{
    size_t bytes;
    const uint8_t *data = fv_ring_peek(&recorder->ring, &bytes);
    if (data == NULL) return false;
    bytes = whole_events(data, bytes, WRITE_BYTES_MAX);
    const size_t done = write_bytes(recorder->file, recorder->path, data, bytes);
    const char *problem = done < bytes ? strerrordesc_np(errno) : NULL;
    size_t at = 0;
    for (; at < bytes && at + event_bytes(data + at) <= done; at += event_bytes(data + at))
        count_event(recorder, data + at);
    if (problem != NULL)
        end_early(recorder, ENDED_FAILED, problem, begins_iteration(recorder, data + at));
    else
        fv_ring_release(&recorder->ring, bytes);
    return problem == NULL;
}

static void say_ended(const struct fv_recorder *recorder)
{
    fv_say("%s: recording ended after %" PRIu64 " events (%" PRIu64 " bytes): %s; the run goes on",
           recorder->path, recorder->written.events, recorder->written.bytes, recorder->reason);
}

static void end_slow(struct fv_recorder *recorder)
{
    char reason[FV_RECORDING_END_REASON_BYTES];
    snprintf(
        reason, sizeof reason,
        "the disk is too slow: %zu MiB waited to be written; record to a faster disk, fewer frames, or raise record_buffer",
        recorder->ring.capacity >> 20);
    end_early(recorder, ENDED_SLOW, reason, false);
}

/* A few times a second: whoever deletes the file shall not believe that it is being written. */
static void look_for_file(struct fv_recorder *recorder)
{
    if (recorder->looks < 0 || ++recorder->looks < LOOK_POLLS) return;
    const int call = fv_stall_enter(recorder->path);
    recorder->looks = fv_output_there(&recorder->place.output) ? 0 : -1;
    fv_stall_leave(call);
    if (recorder->looks < 0)
        fv_say(
            "%s: the recording was deleted or moved during the run; the run goes on, and a deleted recording is lost when the run ends",
            recorder->path);
}

static void *write_all(void *context)
{
    struct fv_recorder *recorder = context;
    for (;;) {
        bool stopping = atomic_load_explicit(&recorder->stop, memory_order_acquire);
        int ending = atomic_load(
            &recorder->ending); /* read first: what was committed before it is still written */
        while (write_some(recorder))
            ;
        if (atomic_load(&recorder->ending) == ENDED_FAILED) break;
        if (ending == ENDED_SLOW) {
            end_slow(recorder);
            break;
        }
        if (stopping && write_end(recorder)) return NULL;
        if (stopping) {
            end_early(recorder, ENDED_FAILED, strerrordesc_np(errno), true);
            break;
        }
        look_for_file(recorder);
        sleep_a_little();
    }
    say_ended(recorder);
    return NULL;
}

/* ---- opening and closing --------------------------------------------------------------------- */

static void release(struct fv_recorder *recorder)
{
    fv_output_discard(&recorder->place.output);
    free(recorder->header);
    free(recorder->ring_memory);
    free(recorder);
}

static enum fovea_status start_thread(struct fv_recorder *recorder, struct fovea_error *error)
{
    int failed = fv_thread_start(&recorder->thread, write_all, recorder);
    if (failed == 0) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: no thread to write it: %s",
                           recorder->path, strerror(failed));
}

/* The most that an iteration takes: the level that a preview shows has at most 1 / 1.4 of the
 * pixels of the one below it. */
static size_t iteration_bytes(const struct fv_recorder_setup *setup)
{
    const struct fovea_config *config = &setup->settings->runtime;
    const struct fovea_camera *camera = &config->rig.cameras[0].camera;
    size_t pixels = (size_t)camera->width * (size_t)camera->height;
    for (uint32_t level = 0; level < config->preview.level; level++)
        pixels = pixels * 10 / 14;
    const size_t sample_bytes =
        FV_LCMLOG_HEADER_BYTES + FV_MESSAGE_CHANNEL_BYTES + fv_message_sample_size_max();
    const size_t parameter_bytes =
        FV_LCMLOG_HEADER_BYTES + FV_MESSAGE_CHANNEL_BYTES + fv_message_parameter_size_max();
    return setup->frame_bytes + fv_jpeg_capacity((int32_t)pixels, 1) + SMALL_BYTES +
           FOVEA_INPUT_SAMPLES_MAX * sample_bytes + FV_MESSAGE_PARAMETERS_MAX * parameter_bytes +
           (size_t)config->features.count_max * FEATURE_BYTES +
           (config->detect.model != NULL ? OBJECTS_BYTES : 0) +
           (config->detect2.model != NULL ? OBJECTS_BYTES : 0);
}

static size_t ring_bytes(const struct fv_recorder_setup *setup, size_t header_bytes)
{
    const size_t iteration = iteration_bytes(setup), least = 2 * (iteration + header_bytes) + 4096;
    const size_t frames = setup->real_time ? setup->settings->record_buffer : PACED_FRAMES;
    const size_t bytes = setup->ring_bytes != 0 ? setup->ring_bytes : frames * setup->frame_bytes;
    return ((bytes > least ? bytes : least) + 63) / 64 * 64;
}

static enum fovea_status make_ring(struct fv_recorder *recorder,
                                   const struct fv_recorder_setup *setup, struct fovea_error *error)
{
    const size_t bytes = ring_bytes(setup, recorder->header_bytes);
    recorder->iteration_bytes = iteration_bytes(setup) + recorder->header_bytes;
    recorder->ring_memory = fv_aligned_zeroed(bytes); /* touches every page before the loop */
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
    status =
        fv_recording_header_encode(setup->settings, setup->identity, setup->kernel_set,
                                   setup->real_time, &opened->header, &opened->header_bytes, error);
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
                                   setup->real_time, &header, &header_bytes, &error) != FOVEA_OK)
        return 0;
    free(header);
    return sizeof(struct fv_recorder) + ring_bytes(setup, header_bytes) + header_bytes +
           FV_THREAD_STACK_BYTES;
}

/* Of a run whose recording ended early: one without an iteration is of no use. */
static enum fv_recording_holds part_held(struct fv_recorder *recorder)
{
    if (recorder->written.iterations > 0 || !recorder->place.numbered) return FV_RECORDING_PART;
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
        closed.complete = atomic_load(&recorder->ending) == RUNNING;
        const int call = fv_stall_enter(recorder->path);
        struct fovea_error why;
        const enum fv_recording_holds holds =
            closed.complete ? FV_RECORDING_ALL : part_held(recorder);
        if (fv_recording_file_close(&recorder->place, holds, &why) != FOVEA_OK && closed.complete) {
            snprintf(recorder->reason, sizeof recorder->reason, "%.180s", why.text);
            say_ended(recorder);
            closed.complete = false;
        }
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
