#include "app/run/recordings.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>

#include "drivers/clock.h"
#include "support/aligned.h"
#include "support/say.h"
#include "support/stall.h"

#include "fovea_recorder_t.h"

enum {
    MESSAGE_BYTES_MAX = 1024,
    SPARE_BYTES = 64 << 20 /* that stay free: beyond the state and the ring, to begin */
};

static const char stopped[] = "ended by a command";

/* ---- opening --------------------------------------------------------------------------------- */

static enum fovea_status make_folder(const struct fv_recordings *recordings,
                                     struct fovea_error *error)
{
    struct stat found;
    const bool made = mkdir(recordings->folder, 0777) == 0;
    if (made || (stat(recordings->folder, &found) == 0 && S_ISDIR(found.st_mode))) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "record_folder: %.400s: %s, expected a folder",
                           recordings->folder,
                           errno == ENOTDIR ? "found a file" : strerrordesc_np(errno));
}

enum fovea_status fv_recordings_open(struct fv_recordings *recordings, struct fovea *rt,
                                     const struct fv_recorder_setup *setup, int64_t run_id,
                                     struct fovea_error *error)
{
    const char *folder = setup->settings->record_folder;
    memset(recordings, 0, sizeof *recordings);
    if (folder[0] == '\0') return FOVEA_OK;
    const char *slash = folder[strlen(folder) - 1] == '/' ? "" : "/";
    snprintf(recordings->folder, sizeof recordings->folder, "%s%s", folder, slash);
    const enum fovea_status status = make_folder(recordings, error);
    if (status != FOVEA_OK) return status;
    struct fv_recorder_setup *ours = &recordings->setup;
    *ours = *setup;
    ours->path = recordings->folder;
    ours->state_bytes = fovea_state_bytes(rt);
    ours->state = fv_aligned_zeroed(ours->state_bytes);
    ours->ring_bytes = fv_recorder_ring_bytes(ours);
    ours->ring_memory = fv_aligned_zeroed(ours->ring_bytes);
    recordings->rt = rt;
    recordings->run_id = run_id;
    recordings->told_stage = -1;
    fv_message_channel(setup->settings->runtime.channel_prefix, FV_MESSAGE_RECORDER,
                       recordings->channel);
    if (ours->state != NULL && ours->ring_memory != NULL) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%.400s: no memory to record (%zu bytes)",
                           folder, ours->state_bytes + ours->ring_bytes);
}

void fv_recordings_close(struct fv_recordings *recordings)
{
    fv_recorder_close(recordings->recorder, NULL);
    free(recordings->setup.state);
    free(recordings->setup.ring_memory);
    memset(recordings, 0, sizeof *recordings);
}

/* ---- the loop's ------------------------------------------------------------------------------ */

static int stage_of(const struct fv_recordings *recordings)
{
    return atomic_load_explicit(&recordings->stage, memory_order_acquire);
}

static void pass(struct fv_recordings *recordings, enum fv_recordings_stage stage)
{
    atomic_store_explicit(&recordings->stage, (int)stage, memory_order_release);
}

const char *fv_recordings_ask(struct fv_recordings *recordings, uint32_t bits)
{
    const int stage = stage_of(recordings);
    const bool begin = (bits & FOVEA_COMMAND_RECORD) != 0;
    if (recordings->setup.path == NULL)
        return "found no folder for recordings, expected one in record_folder";
    if (begin && stage != FV_RECORDINGS_READY)
        return stage == FV_RECORDINGS_CLOSES ? "the recording before is still being written"
                                             : "a recording has been begun already";
    if (!begin && stage == FV_RECORDINGS_READY && recordings->reason[0] != '\0') {
        snprintf(recordings->refusal, sizeof recordings->refusal,
                 "found no recording to end: the last one ended: %s", recordings->reason);
        return recordings->refusal;
    }
    if (!begin && stage != FV_RECORDINGS_RECORDS)
        return stage == FV_RECORDINGS_READY ? "found no recording to end"
                                            : "the recording is still being begun or ended";
    recordings->asked++;
    recordings->by_command = !begin;
    pass(recordings, begin ? FV_RECORDINGS_OPENS : FV_RECORDINGS_CLOSES);
    return NULL;
}

uint32_t fv_recordings_ended(const struct fv_recordings *recordings, const char **failure)
{
    const int stage = stage_of(recordings);
    const bool through =
        stage == FV_RECORDINGS_READY ||
        (stage == FV_RECORDINGS_RECORDS && fv_recorder_written(recordings->recorder) > 0);
    *failure = through ? recordings->failure : "";
    return through || recordings->asked == 0 ? recordings->asked : recordings->asked - 1;
}

void fv_recordings_sense(struct fv_recordings *recordings, const struct fovea_inputs *inputs,
                         bool busy)
{
    const int stage = stage_of(recordings);
    if (stage == FV_RECORDINGS_BEGINS && !busy) {
        fv_recorder_begin(recordings->recorder, recordings->rt, inputs);
        pass(recordings, FV_RECORDINGS_RECORDS);
    }
    if (stage == FV_RECORDINGS_RECORDS &&
        (fv_recorder_has_ended(recordings->recorder) || atomic_load(&recordings->full))) {
        recordings->by_command = false;
        pass(recordings, FV_RECORDINGS_CLOSES);
    }
}

struct fv_recorder *fv_recordings_recorder(const struct fv_recordings *recordings)
{
    return stage_of(recordings) == FV_RECORDINGS_RECORDS ? recordings->recorder : NULL;
}

void fv_recordings_work(struct fv_recordings *recordings, struct fv_transport *transport,
                        struct fv_feed *feed)
{
    uint8_t data[MESSAGE_BYTES_MAX];
    if (!atomic_load_explicit(&recordings->news, memory_order_acquire)) return;
    struct fv_recordings_state *told = &recordings->told;
    const fovea_recorder_t message = {.utime = fv_clock_ns(CLOCK_REALTIME) / 1000,
                                      .run_id = recordings->run_id,
                                      .state = told->state,
                                      .file = told->file,
                                      .bytes = told->bytes,
                                      .free_bytes = told->free_bytes,
                                      .reason = told->reason};
    const int bytes = fovea_recorder_t_encode(data, 0, sizeof data, &message);
    atomic_store_explicit(&recordings->news, false, memory_order_release);
    if (bytes <= 0) return;
    const struct fovea_message out = {recordings->channel, data, (uint32_t)bytes, true};
    fv_transport_put(transport, &out);
    fv_feed_put(feed, &out);
}

/* ---- the watching thread's ------------------------------------------------------------------- */

static int64_t free_bytes(const struct fv_recordings *recordings)
{
    struct statvfs disk;
    const int call = fv_stall_enter(recordings->folder);
    const int failed = statvfs(recordings->folder, &disk);
    fv_stall_leave(call);
    return failed != 0 ? -1 : (int64_t)disk.f_bavail * (int64_t)disk.f_frsize;
}

static void keep_name(struct fv_recordings *recordings, const char *path)
{
    const char *slash = strrchr(path, '/');
    snprintf(recordings->file, sizeof recordings->file, "%.*s", FV_RECORDINGS_NAME_BYTES - 1,
             slash != NULL ? slash + 1 : path);
}

static enum fovea_status open_recorder(struct fv_recordings *recordings, struct fovea_error *error)
{
    const int call = fv_stall_enter(recordings->folder);
    const enum fovea_status status =
        fv_recorder_open(&recordings->setup, &recordings->recorder, error);
    fv_stall_leave(call);
    return status;
}

static void open_file(struct fv_recordings *recordings)
{
    const int64_t there = free_bytes(recordings);
    const int64_t needed = (int64_t)recordings->setup.state_bytes +
                           (int64_t)recordings->setup.ring_bytes + SPARE_BYTES;
    struct fovea_error error = {0};
    recordings->failure[0] = recordings->reason[0] = recordings->low[0] = '\0';
    atomic_store(&recordings->full, false);
    if (there >= 0 && there < needed)
        snprintf(recordings->failure, sizeof recordings->failure,
                 "%.150s: found %lld MB free, expected %lld", recordings->folder,
                 (long long)there / 1000000, (long long)needed / 1000000);
    else if (open_recorder(recordings, &error) != FOVEA_OK)
        snprintf(recordings->failure, sizeof recordings->failure, "%.255s", error.text);
    if (recordings->failure[0] != '\0') {
        recordings->recorder = NULL;
        pass(recordings, FV_RECORDINGS_READY);
        return;
    }
    keep_name(recordings, fv_recorder_path(recordings->recorder));
    pass(recordings, FV_RECORDINGS_BEGINS);
}

static void close_file(struct fv_recordings *recordings)
{
    struct fv_recorder_summary summary;
    const bool by_command = stage_of(recordings) == FV_RECORDINGS_CLOSES && recordings->by_command;
    const char *reason = by_command ? stopped : recordings->low;
    fv_recorder_stop(recordings->recorder, reason);
    const bool whole = fv_recorder_close(recordings->recorder, &summary) == FOVEA_OK;
    recordings->recorder = NULL;
    keep_name(recordings, summary.removed ? "" : summary.path);
    recordings->bytes = (int64_t)summary.bytes;
    snprintf(recordings->failure, sizeof recordings->failure, "%s", whole ? "" : summary.reason);
    snprintf(recordings->reason, sizeof recordings->reason, "%s",
             whole ? recordings->low : summary.reason);
    (whole ? fv_say_note : fv_say)("%s: recorded %llu events (%llu bytes)%s", summary.path,
                                   (unsigned long long)summary.events,
                                   (unsigned long long)summary.bytes, whole ? "" : ", not all");
    pass(recordings, FV_RECORDINGS_READY);
}

/* What waits in the ring still goes to the disk. */
static void look_for_room(struct fv_recordings *recordings, int stage)
{
    const int64_t there = recordings->told.free_bytes;
    const int64_t needed = (int64_t)recordings->setup.ring_bytes + SPARE_BYTES;
    if (stage != FV_RECORDINGS_RECORDS || there < 0 || there >= needed) return;
    snprintf(recordings->low, sizeof recordings->low,
             "the disk is almost full: %.80s: found %lld MB free, expected %lld",
             recordings->folder, (long long)there / 1000000, (long long)needed / 1000000);
    atomic_store(&recordings->full, true);
}

/* Once a second, and when the stage has changed: the loop passes it on. */
static void tell(struct fv_recordings *recordings)
{
    static const int8_t states[] = {
        [FV_RECORDINGS_READY] = FOVEA_RECORDER_T_STATE_READY,
        [FV_RECORDINGS_OPENS] = FOVEA_RECORDER_T_STATE_BEGINS,
        [FV_RECORDINGS_BEGINS] = FOVEA_RECORDER_T_STATE_BEGINS,
        [FV_RECORDINGS_RECORDS] = FOVEA_RECORDER_T_STATE_RECORDS,
        [FV_RECORDINGS_CLOSES] = FOVEA_RECORDER_T_STATE_ENDS,
    };
    const int stage = stage_of(recordings);
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    if (stage == recordings->told_stage && now_ns - recordings->told_ns < FV_SECOND_NS) return;
    if (atomic_load_explicit(&recordings->news, memory_order_acquire)) return;
    recordings->told_stage = stage;
    recordings->told_ns = now_ns;
    if (recordings->recorder != NULL)
        recordings->bytes = (int64_t)fv_recorder_written(recordings->recorder);
    recordings->told.bytes = recordings->bytes;
    recordings->told.state = states[stage];
    recordings->told.free_bytes = free_bytes(recordings);
    look_for_room(recordings, stage);
    memcpy(recordings->told.file, recordings->file, sizeof recordings->file);
    memcpy(recordings->told.reason, recordings->reason, sizeof recordings->reason);
    atomic_store_explicit(&recordings->news, true, memory_order_release);
}

void fv_recordings_tend(struct fv_recordings *recordings)
{
    if (recordings->setup.path == NULL) return;
    const int stage = stage_of(recordings);
    if (stage == FV_RECORDINGS_OPENS) open_file(recordings);
    if (stage == FV_RECORDINGS_CLOSES) close_file(recordings);
    tell(recordings);
}

void fv_recordings_end(struct fv_recordings *recordings)
{
    const int stage = stage_of(recordings);
    if (recordings->setup.path == NULL) return;
    const bool begun = stage == FV_RECORDINGS_RECORDS || stage == FV_RECORDINGS_CLOSES;
    if (recordings->recorder != NULL) close_file(recordings);
    if (!begun && stage != FV_RECORDINGS_READY)
        snprintf(recordings->failure, sizeof recordings->failure, "the run has ended");
    pass(recordings, FV_RECORDINGS_READY);
}
