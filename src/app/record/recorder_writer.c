/* The recorder's thread: from the ring into the file, and how a recording ends. */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "app/record/recorder_internal.h"
#include "app/record/recording_header.h"
#include "message/wire.h"
#include "support/lcmlog.h"
#include "support/say.h"
#include "support/stall.h"

enum {
    WRITE_BYTES_MAX = 1 << 20,
    POLL_NS = 4000000,
    LOOK_POLLS = 64 /* between looks whether the file is still there: 0.3 s */
};

static void sleep_a_little(void)
{
    const struct timespec pause = {.tv_nsec = POLL_NS};
    nanosleep(&pause, NULL);
}

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
           is_on(recorder, event, FV_MESSAGE_LOADED_MAP) ||
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
    struct fv_recorder_extent *written = &recorder->written;
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
    atomic_store_explicit(&recorder->bytes, written->bytes, memory_order_relaxed);
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
    const struct fv_recorder_extent *at = &recorder->written;
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

static bool cut_to(struct fv_recorder *recorder, const struct fv_recorder_extent *extent)
{
    if (ftruncate(recorder->file, (off_t)extent->bytes) != 0) return false;
    recorder->written = *extent;
    return lseek(recorder->file, (off_t)extent->bytes, SEEK_SET) >= 0;
}

/* End the log before the run, after a whole iteration: the one that is written, when
 * `between_iterations`, and else (or when that leaves no room for the log's own end) the one before
 * it. */
static void end_early(struct fv_recorder *recorder, enum fv_recorder_ending ending,
                      const char *reason, bool between_iterations)
{
    const struct fv_recorder_extent iteration = recorder->iteration;
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
        end_early(recorder, FV_RECORDER_FAILED, problem, begins_iteration(recorder, data + at));
    else
        fv_ring_release(&recorder->ring, bytes);
    return problem == NULL;
}

void fv_recorder_say_ended(const struct fv_recorder *recorder)
{
    fv_say("%s: recording ended after %" PRIu64 " events (%" PRIu64 " bytes): %s; the run goes on",
           recorder->path, recorder->written.events, recorder->written.bytes, recorder->reason);
}

static void end_slow(struct fv_recorder *recorder)
{
    char reason[FV_RECORDING_END_REASON_BYTES];
    const size_t mib = recorder->ring.capacity >> 20;
    snprintf(
        reason, sizeof reason,
        "the disk is too slow: %zu %s waited to be written; record to a faster disk, fewer frames, or raise record_buffer",
        mib > 0 ? mib : recorder->ring.capacity, mib > 0 ? "MiB" : "bytes");
    end_early(recorder, FV_RECORDER_SLOW, reason, false);
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

/* The header of a recording that begins in the middle of its run, into the file: with the state it
 * is too long for the ring. Its bytes are those of an event on the heap, since all that counts
 * events takes them in one piece. */
static bool write_middle(struct fv_recorder *recorder, struct fovea_error *error)
{
    const struct fv_recorder_setup *setup = &recorder->setup;
    const char *channel = recorder->channels[FV_MESSAGE_RECORDING];
    const size_t head_bytes = FV_LCMLOG_HEADER_BYTES + strlen(channel);
    const struct fv_recording_middle middle = {setup->state, setup->state_bytes,
                                               &recorder->in_force};
    uint8_t head[FV_LCMLOG_HEADER_BYTES + FV_MESSAGE_CHANNEL_BYTES];
    if (fv_recording_header_encode(setup->settings, setup->identity, setup->kernel_set,
                                   setup->real_time, &middle, &recorder->header,
                                   &recorder->header_bytes, error) != FOVEA_OK)
        return false;
    const uint32_t bytes = recorder->header_bytes;
    fv_recording_event_head(head, 0, recorder->begin_us, strlen(channel), bytes);
    /* A log holds the bytes alone. NOLINTNEXTLINE(bugprone-not-null-terminated-result) */
    memcpy(head + FV_LCMLOG_HEADER_BYTES, channel, strlen(channel));
    const bool written =
        write_bytes(recorder->file, recorder->path, head, head_bytes) == head_bytes &&
        write_bytes(recorder->file, recorder->path, recorder->header, bytes) == bytes;
    if (!written) {
        fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s", strerrordesc_np(errno));
        return false;
    }
    struct fv_recorder_extent *extent = &recorder->written;
    extent->hash = fv_recording_hash_event(extent->hash, head, head_bytes, recorder->header, bytes);
    extent->time_us = recorder->begin_us;
    extent->bytes = head_bytes + bytes;
    extent->events = 1;
    recorder->iteration = *extent;
    atomic_store_explicit(&recorder->bytes, extent->bytes, memory_order_relaxed);
    free(recorder->header);
    recorder->header = NULL;
    return true;
}

/* Whether there is something to write after it: false where the recording ends. */
static bool begin_middle(struct fv_recorder *recorder)
{
    struct fovea_error error;
    while (!atomic_load_explicit(&recorder->begun, memory_order_acquire)) {
        if (atomic_load_explicit(&recorder->stop, memory_order_acquire)) return false;
        sleep_a_little();
    }
    if (write_middle(recorder, &error)) return true;
    snprintf(recorder->reason, sizeof recorder->reason, "%.180s", error.text);
    atomic_store(&recorder->ending, FV_RECORDER_FAILED);
    if (ftruncate(recorder->file, 0) != 0) recorder->written.bytes = 0;
    fv_recorder_say_ended(recorder);
    return false;
}

void *fv_recorder_write(void *context)
{
    struct fv_recorder *recorder = context;
    if (recorder->setup.state != NULL && !begin_middle(recorder)) return NULL;
    for (;;) {
        bool stopping = atomic_load_explicit(&recorder->stop, memory_order_acquire);
        int ending = atomic_load(
            &recorder->ending); /* read first: what was committed before it is still written */
        while (write_some(recorder))
            ;
        if (atomic_load(&recorder->ending) == FV_RECORDER_FAILED) break;
        if (ending == FV_RECORDER_SLOW) {
            end_slow(recorder);
            break;
        }
        if (stopping) memcpy(recorder->reason, recorder->stop_reason, sizeof recorder->reason);
        if (stopping && write_end(recorder)) return NULL;
        if (stopping) {
            end_early(recorder, FV_RECORDER_FAILED, strerrordesc_np(errno), true);
            break;
        }
        look_for_file(recorder);
        sleep_a_little();
    }
    fv_recorder_say_ended(recorder);
    return NULL;
}
