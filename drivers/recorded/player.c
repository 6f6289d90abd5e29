#include "player.h"

#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "../clock.h"
#include "../slot_ring.h"
#include "../table.h"
#include "../thread.h"
#include "due.h"

enum {
    COMPLAINTS_BYTES = 32768, /* some 300 lines */
    COMPLAINTS_PATIENCE_NS = 500000000,
    STAMPS_AROUND = 8, /* frames to come that a stamp is held against */
    RATE_STEPS = 101
};

struct fovea_source {
    const struct fv_recording_ops *ops;
    void *recording;
    char *origin; /* names the recording in complaints */
    struct fovea_source_info info;

    /* The order of play: index = first + step * position, `count` of them (UINT64_MAX: until the
     * end). */
    uint64_t first, count;
    int64_t step;
    int64_t mirror_ns; /* reverse: stamp becomes mirror_ns - stamp */
    bool reverse;

    struct fv_slot slots[FV_PLAYER_SLOTS];
    uint8_t *pixels;
    struct fv_slot_ring ready, free;
    sem_t ready_count, free_count; /* ready: one for each frame, and one for the end */

    pthread_t reader;
    bool started;
    _Atomic bool quit, ended;
    struct fovea_source_counts end_counts; /* written before `ended` */

    /* Loop thread only. */
    bool held[FV_PLAYER_SLOTS];
    uint32_t held_count, held_max;
    struct fovea_source_counts counts;
    bool seen_end;
    bool sensed; /* samples were asked for */
    struct fv_due due;

    /* Between the reader and whoever asks for complaints; never the loop. */
    struct complaints {
        pthread_mutex_t lock;
        pthread_cond_t room;
        char text[COMPLAINTS_BYTES]; /* lines, each with the zero byte at its end */
        size_t bytes;
        uint64_t unnamed; /* since nobody asked in time */
        bool nobody_asks;
    } complaints;
};

/* Unsigned, since stamps may be anything. */
static int64_t mirrored(const struct fovea_source *source, int64_t stamp_ns)
{
    return (int64_t)((uint64_t)source->mirror_ns - (uint64_t)stamp_ns);
}

static uint64_t index_at(const struct fovea_source *source, uint64_t position)
{
    return source->first + (uint64_t)source->step * position;
}

/* As it is played; false where it is not known. */
static bool stamp_at(const struct fovea_source *source, uint64_t position, int64_t *stamp_ns)
{
    if (source->ops->stamp == NULL || position >= source->count) return false;
    if (source->ops->stamp(source->recording, index_at(source, position), stamp_ns) != FOVEA_OK)
        return false;
    if (source->reverse) *stamp_ns = mirrored(source, *stamp_ns);
    return true;
}

/* ---- reader thread --------------------------------------------------------------------------- */

/* Every frame that is skipped is named. When many are missing at once the reader, which only skips,
 * waits a while for the lines to be fetched; it stops doing so where nobody fetches them. */
static void complain(struct complaints *complaints, const struct fovea_error *error)
{
    const size_t bytes = strlen(error->text) + 1;
    const struct timespec until =
        fv_clock_timespec(fv_clock_ns(CLOCK_MONOTONIC) + COMPLAINTS_PATIENCE_NS);
    pthread_mutex_lock(&complaints->lock);
    while (complaints->bytes + bytes > COMPLAINTS_BYTES && !complaints->nobody_asks)
        if (pthread_cond_clockwait(&complaints->room, &complaints->lock, CLOCK_MONOTONIC, &until) !=
            0)
            complaints->nobody_asks = true;
    if (complaints->bytes + bytes <= COMPLAINTS_BYTES) {
        memcpy(complaints->text + complaints->bytes, error->text, bytes);
        complaints->bytes += bytes;
    } else {
        complaints->unnamed++;
    }
    pthread_mutex_unlock(&complaints->lock);
}

/* How far the reader is. */
struct reading {
    uint64_t position; /* of the frame to fetch next */
    struct fovea_source_counts counts;
    bool any;
    int64_t newest_ns; /* largest stamp delivered */
};

/* Whether a stamp leaps ahead of its place, as on a damaged line: the loop would take it and then
 * refuse all that follows as going back. It does when most of the next frames lie between the
 * frames before and this one, in order; a stamp that itself goes back or repeats is the loop's to
 * refuse, and a clock that was set back starts below what was. */
static bool leaps_ahead(const struct fovea_source *source, const struct reading *reading,
                        int64_t stamp_ns, int64_t *next_ns)
{
    int64_t ahead_of = reading->newest_ns, other_ns;
    bool any = reading->any;
    int between = 0, beyond = 0;
    if (any && stamp_ns <= ahead_of) return false;
    for (uint64_t i = 1; i <= STAMPS_AROUND; i++) {
        if (!stamp_at(source, reading->position + i, &other_ns)) continue;
        beyond += other_ns > stamp_ns;
        if (other_ns >= stamp_ns || (any && other_ns <= ahead_of)) continue;
        if (between++ == 0) *next_ns = other_ns;
        ahead_of = other_ns;
        any = true;
    }
    return between > 1 && between > beyond;
}

static enum fovea_status fetch_at(const struct fovea_source *source, const struct reading *reading,
                                  struct fv_slot *slot, struct fovea_error *error)
{
    const uint64_t index = index_at(source, reading->position);
    const enum fovea_status status = source->ops->fetch(source->recording, index, slot, error);
    int64_t *stamp_ns = &slot->frame.stamp_ns, found_ns = *stamp_ns, next_ns = 0;
    if (status != FOVEA_OK) return status;
    slot->frame.index = index;
    if (source->reverse) *stamp_ns = mirrored(source, found_ns);
    if (!leaps_ahead(source, reading, *stamp_ns, &next_ns)) return FOVEA_OK;
    return fovea_error_set(
        error, FOVEA_ERROR_INPUT,
        "%.256s: frame %llu: timestamp: found %lld ns, expected one before the next frames' %lld ns",
        source->origin, (unsigned long long)index, (long long)found_ns,
        (long long)(source->reverse ? mirrored(source, next_ns) : next_ns));
}

/* The next frame that can be had. FOVEA_END: there is none. */
static enum fovea_status fetch_next(struct fovea_source *source, struct reading *reading,
                                    struct fv_slot *slot)
{
    struct fovea_source_counts *counts = &reading->counts;
    while (reading->position < source->count &&
           !atomic_load_explicit(&source->quit, memory_order_relaxed)) {
        struct fovea_error error = {.text = ""};
        for (uint32_t i = 0; i < slot->frame.image_count; i++)
            slot->frame.images[i].data = slot->pixels[i]; /* that were absent in the last frame */
        const enum fovea_status status = fetch_at(source, reading, slot, &error);
        if (status == FOVEA_END) break;
        ++reading->position;
        if (status == FOVEA_OK) {
            if (error.text[0] != '\0') complain(&source->complaints, &error);
            if (!reading->any || slot->frame.stamp_ns > reading->newest_ns)
                reading->newest_ns = slot->frame.stamp_ns;
            reading->any = true;
            counts->delivered++;
            slot->counts = *counts;
            return FOVEA_OK;
        }
        const bool missing = status == FOVEA_GONE;
        ++*(missing ? &counts->missing : &counts->damaged);
        complain(&source->complaints, &error);
    }
    return FOVEA_END;
}

static void *read_frames(void *argument)
{
    struct fovea_source *source = argument;
    struct reading reading = {.position = 0};
    for (;;) {
        uint8_t slot;
        while (sem_wait(&source->free_count) != 0)
            continue; /* interrupted */
        if (atomic_load(&source->quit) || !fv_slot_ring_pop(&source->free, &slot)) return NULL;
        if (fetch_next(source, &reading, &source->slots[slot]) != FOVEA_OK) break;
        fv_slot_ring_push(&source->ready, slot);
        sem_post(&source->ready_count);
    }
    source->end_counts = reading.counts;
    atomic_store_explicit(&source->ended, true, memory_order_release);
    sem_post(&source->ready_count);
    return NULL;
}

/* ---- open and close -------------------------------------------------------------------------- */

/* Between the first and the last frame that has a stamp. */
static enum fovea_status set_mirror(struct fovea_source *source, const char *origin,
                                    struct fovea_error *error)
{
    uint64_t first = 0, last = source->count - 1;
    int64_t first_ns, last_ns;
    source->reverse = false; /* stamps as recorded, here */
    while (first < last && !stamp_at(source, first, &first_ns))
        ++first;
    while (last > first && !stamp_at(source, last, &last_ns))
        --last;
    const bool found = stamp_at(source, first, &first_ns) && stamp_at(source, last, &last_ns);
    source->reverse = true;
    if (!found)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found no frame with a stamp, expected one for reverse", origin);
    source->mirror_ns = (int64_t)((uint64_t)first_ns + (uint64_t)last_ns);
    return FOVEA_OK;
}

static enum fovea_status set_order(struct fovea_source *source, uint64_t count, const char *origin,
                                   const struct fovea_source_selection *selection,
                                   struct fovea_error *error)
{
    if (selection->step == 0 || selection->step > INT64_MAX)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "step: found %llu, expected at least 1",
                               (unsigned long long)selection->step);
    if (count == 0 && selection->reverse)
        return fovea_error_set(
            error, FOVEA_ERROR_UNSUPPORTED,
            "%s: reverse: its frames can only be played in order, expected no reverse", origin);
    if (count > 0 && selection->start >= count)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "%s: start: found %llu, expected less than its %llu frames", origin,
                               (unsigned long long)selection->start, (unsigned long long)count);
    uint64_t chosen = count > 0 ? (count - selection->start - 1) / selection->step + 1 : UINT64_MAX;
    source->first = selection->start;
    source->held_max = fv_source_frames_held(selection);
    source->step = (int64_t)selection->step;
    source->reverse = selection->reverse;
    if (selection->frames > 0 && selection->frames < chosen) chosen = selection->frames;
    if (selection->reverse) {
        source->first += (chosen - 1) * selection->step;
        source->step = -source->step;
    }
    source->count = chosen;
    source->info.frame_count = chosen == UINT64_MAX ? 0 : chosen;
    if (!selection->reverse) return FOVEA_OK;
    return set_mirror(source, origin, error);
}

/* The kinds among its samples. In reverse they are left out, and the inertial sensor with them: a
 * sensor's motion does not turn round with the pictures. Sources that are asked for samples refuse
 * that; a recording that just holds some says so. */
static void note_samples(struct fovea_source *source)
{
    struct fovea_error left_out;
    if (source->ops->samples == NULL) return;
    const size_t count = source->due.count;
    for (size_t i = 0; i < count && !source->reverse; i++)
        source->info.sample_kinds |= 1u << source->due.list[i].kind;
    if (!source->reverse) return;
    source->info.rig.has_imu = false;
    memset(&source->info.rig.imu, 0, sizeof source->info.rig.imu);
    fovea_error_set(
        &left_out, FOVEA_ERROR_UNSUPPORTED,
        "%.300s: played in reverse without its %zu samples of sensors: they do not turn round",
        source->origin, count);
    if (count > 0) complain(&source->complaints, &left_out);
}

static enum fovea_status order_samples(struct fovea_source *source, struct fovea_error *error)
{
    size_t count = 0;
    if (source->ops->samples == NULL) return FOVEA_OK;
    const struct fovea_sample *list = source->ops->samples(source->recording, &count);
    return fv_due_open(&source->due, list, count, source->origin, error);
}

/* What cannot be taken with the frames would lag behind them without end. A gap between frames
 * alone is caught up with. */
static enum fovea_status check_samples(const struct fovea_source *source, uint64_t count,
                                       const struct fovea_source_selection *selection,
                                       struct fovea_error *error)
{
    const size_t samples = source->due.count;
    if (source->reverse || source->count < 2 || samples < 2) return FOVEA_OK;
    const double seconds =
        ((double)fv_due_at(&source->due, samples - 1) - (double)fv_due_at(&source->due, 0)) * 1e-9;
    const double frames_hz =
        fv_player_rate(source->ops, source->recording, count) / (double)selection->step;
    if ((double)(samples - 1) <= seconds * frames_hz * FOVEA_INPUT_SAMPLES_MAX || frames_hz <= 0)
        return FOVEA_OK;
    return fovea_error_set(
        error, FOVEA_ERROR_INPUT,
        "%.256s: found %.6g samples per second beside %.6g frames, expected at most %d with each frame",
        source->origin, (double)(samples - 1) / seconds, frames_hz, FOVEA_INPUT_SAMPLES_MAX);
}

/* The image of a camera as it comes; a row is a whole number of cache lines. */
static struct fovea_image image_of(const struct fovea_source_info *info, uint32_t camera)
{
    const struct fovea_source_camera *seen = &info->cameras[camera];
    const int32_t row_bytes = fovea_image_stride_min(info->format, seen->width);
    const int32_t whole = (row_bytes + 63) / 64 * 64,
                  stride = seen->stride_bytes > whole ? seen->stride_bytes : whole;
    return (struct fovea_image){.width = seen->width,
                                .height = seen->height,
                                .stride_bytes = stride,
                                .format = info->format,
                                .size_bytes =
                                    fovea_image_bytes(info->format, seen->height, stride)};
}

static enum fovea_status make_slots(struct fovea_source *source, const size_t *image_bytes,
                                    struct fovea_error *error)
{
    const uint32_t cameras = source->info.rig.camera_count;
    struct fovea_image images[FOVEA_CAMERAS_MAX];
    size_t capacity[FOVEA_CAMERAS_MAX], begin[FOVEA_CAMERAS_MAX], frame_bytes = 0;
    for (uint32_t k = 0; k < cameras; k++) {
        images[k] = image_of(&source->info, k);
        source->info.cameras[k].stride_bytes = images[k].stride_bytes;
        capacity[k] = images[k].size_bytes;
        if (image_bytes != NULL && image_bytes[k] > capacity[k]) capacity[k] = image_bytes[k];
        begin[k] = frame_bytes; /* a line more, for kernels that read past the end */
        frame_bytes += (capacity[k] + 127) / 64 * 64;
    }
    if (posix_memalign((void **)&source->pixels, 64, frame_bytes * FV_PLAYER_SLOTS) != 0) {
        source->pixels = NULL;
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "out of memory for %d frames of %zu bytes", FV_PLAYER_SLOTS,
                               frame_bytes);
    }
    memset(source->pixels, 0, frame_bytes * FV_PLAYER_SLOTS);
    for (uint32_t i = 0; i < FV_PLAYER_SLOTS; i++) {
        struct fv_slot *slot = &source->slots[i];
        slot->frame.slot = i;
        slot->frame.image_count = cameras;
        for (uint32_t k = 0; k < cameras; k++) {
            slot->capacity_bytes[k] = capacity[k];
            slot->pixels[k] = source->pixels + i * frame_bytes + begin[k];
            slot->frame.images[k] = images[k];
            slot->frame.images[k].data = slot->pixels[k];
        }
    }
    source->info.heap_bytes += frame_bytes * FV_PLAYER_SLOTS + sizeof *source;
    return FOVEA_OK;
}

double fv_player_rate(const struct fv_recording_ops *ops, void *recording, uint64_t count)
{
    int64_t steps[RATE_STEPS], before_ns = 0, now_ns;
    size_t found = 0;
    bool any = false;
    for (uint64_t i = 0; i < count && found < RATE_STEPS; i++) {
        if (ops->stamp(recording, i, &now_ns) != FOVEA_OK) continue;
        if (any && before_ns < now_ns && (before_ns >= 0 || now_ns <= INT64_MAX + before_ns)) {
            size_t at = found++;
            for (; at > 0 && steps[at - 1] > now_ns - before_ns; --at)
                steps[at] = steps[at - 1];
            steps[at] = now_ns - before_ns;
        }
        before_ns = now_ns;
        any = true;
    }
    const size_t middle = found / 2;
    return found == 0 ? 0.0 : 1e9 / (double)steps[middle];
}

enum fovea_status fv_player_open(const struct fv_recording_ops *ops, void *recording,
                                 uint64_t count, const size_t *image_bytes, const char *origin,
                                 const struct fovea_source_selection *selection,
                                 const struct fovea_source_info *info, struct fovea_source **source,
                                 struct fovea_error *error)
{
    struct fovea_source *made;
    if (posix_memalign((void **)&made, 64, sizeof *made) != 0) {
        ops->close(recording);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", origin);
    }
    memset(made, 0, sizeof *made);
    made->ops = ops;
    made->recording = recording;
    made->info = *info;
    if (made->info.rig.camera_count == 0) made->info.rig.camera_count = 1;
    made->origin = strdup(origin);
    pthread_mutex_init(&made->complaints.lock, NULL);
    pthread_cond_init(&made->complaints.room, NULL);
    enum fovea_status status = FOVEA_OK;
    if (made->origin == NULL)
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", origin);
    if (status == FOVEA_OK) status = set_order(made, count, origin, selection, error);
    if (status == FOVEA_OK) status = order_samples(made, error);
    if (status == FOVEA_OK) status = check_samples(made, count, selection, error);
    if (status == FOVEA_OK) note_samples(made);
    if (status == FOVEA_OK) status = make_slots(made, image_bytes, error);
    if (status != FOVEA_OK) {
        fv_player_close(made);
        return status;
    }
    *source = made;
    return FOVEA_OK;
}

void fv_player_close(struct fovea_source *source)
{
    fv_player_stop(source);
    fv_due_close(&source->due);
    source->ops->close(source->recording);
    pthread_mutex_destroy(&source->complaints.lock);
    pthread_cond_destroy(&source->complaints.room);
    free(source->pixels);
    free(source->origin);
    free(source);
}

const struct fovea_source_info *fv_player_info(const struct fovea_source *source)
{
    return &source->info;
}

void fv_player_reads(const struct fovea_source *source,
                     void (*visit)(void *context, const char *path), void *context)
{
    if (source->ops->reads != NULL) source->ops->reads(source->recording, visit, context);
}

/* ---- start and stop -------------------------------------------------------------------------- */

enum fovea_status fv_player_start(struct fovea_source *source, struct fovea_error *error)
{
    if (source->started)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "the recording is being played already");
    memset(&source->ready, 0, sizeof source->ready);
    memset(&source->free, 0, sizeof source->free);
    memset(source->held, 0, sizeof source->held);
    source->held_count = 0;
    source->counts = (struct fovea_source_counts){0};
    source->seen_end = source->sensed = false;
    source->complaints.nobody_asks = false;
    atomic_store(&source->quit, false);
    atomic_store(&source->ended, false);
    for (int i = 0; i < FV_PLAYER_SLOTS; i++)
        fv_slot_ring_push(&source->free, (uint8_t)i);
    sem_init(&source->ready_count, 0, 0);
    sem_init(&source->free_count, 0, FV_PLAYER_SLOTS);
    const int failed = fv_thread_start(&source->reader, read_frames, source);
    if (failed != 0) {
        sem_destroy(&source->ready_count);
        sem_destroy(&source->free_count);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "the reader thread cannot be started: %s",
                               strerror(failed));
    }
    source->started = true;
    return FOVEA_OK;
}

void fv_player_stop(struct fovea_source *source)
{
    if (!source->started) return;
    atomic_store(&source->quit, true);
    sem_post(&source->free_count);
    pthread_mutex_lock(&source->complaints.lock);
    source->complaints.nobody_asks = true;
    pthread_cond_signal(&source->complaints.room);
    pthread_mutex_unlock(&source->complaints.lock);
    pthread_join(source->reader, NULL);
    sem_destroy(&source->ready_count);
    sem_destroy(&source->free_count);
    source->started = false;
}

/* ---- loop thread ----------------------------------------------------------------------------- */

enum fovea_status fv_player_dequeue(struct fovea_source *source, int64_t deadline_ns,
                                    struct fovea_frame *frame)
{
    if (!source->started) return FOVEA_END;
    if (source->held_count >= source->held_max ||
        !fv_thread_take(&source->ready_count, deadline_ns))
        return FOVEA_AGAIN;
    uint8_t slot;
    if (!fv_slot_ring_pop(&source->ready, &slot)) {
        (void)atomic_load_explicit(&source->ended, memory_order_acquire);
        source->counts = source->end_counts;
        source->seen_end = true;
        sem_post(&source->ready_count); /* the end stays the end */
        return FOVEA_END;
    }
    source->held[slot] = true;
    source->held_count++;
    source->counts = source->slots[slot].counts;
    *frame = source->slots[slot].frame;
    for (uint32_t i = 0; i < frame->image_count; i++)
        if (frame->images[i].data == NULL) frame->images[i] = (struct fovea_image){0};
    return FOVEA_OK;
}

void fv_player_requeue(struct fovea_source *source, const struct fovea_frame *frame)
{
    if (!source->started || frame->slot >= FV_PLAYER_SLOTS || !source->held[frame->slot]) return;
    source->held[frame->slot] = false;
    source->held_count--;
    fv_slot_ring_push(&source->free, (uint8_t)frame->slot);
    sem_post(&source->free_count);
}

enum fovea_status fv_player_truth(struct fovea_source *source, const struct fovea_frame *frame,
                                  struct fovea_truth *truth)
{
    if (source->ops->truth == NULL || !source->info.has_truth) return FOVEA_ERROR_UNSUPPORTED;
    struct fovea_frame recorded = *frame;
    if (source->reverse) recorded.stamp_ns = mirrored(source, frame->stamp_ns);
    return source->ops->truth(source->recording, &recorded, truth);
}

enum fovea_status fv_player_truth_pose(struct fovea_source *source, const struct fovea_frame *frame,
                                       double T_world_cam[12])
{
    struct fovea_truth truth = {.has_pose = false};
    const enum fovea_status status = fv_player_truth(source, frame, &truth);
    if (status != FOVEA_OK) return status;
    if (!truth.has_pose) return FOVEA_ERROR_UNSUPPORTED;
    memcpy(T_world_cam, truth.T_world_cam, sizeof truth.T_world_cam);
    return FOVEA_OK;
}

uint32_t fv_player_samples(struct fovea_source *source, const struct fovea_frame *frame,
                           struct fovea_sample *samples, uint32_t count_max)
{
    const double rate_hz = source->info.rate_hz;
    const int64_t period_ns = rate_hz > 0.1 ? (int64_t)(1e9 / rate_hz) : INT64_C(1000000000);
    int64_t from_ns;
    if (source->info.sample_kinds == 0) return 0;
    if (__builtin_sub_overflow(frame->stamp_ns, period_ns, &from_ns)) from_ns = INT64_MIN;
    if (!source->sensed) fv_due_start_after(&source->due, from_ns);
    source->sensed = true;
    return fv_due_take(&source->due, frame->stamp_ns, samples, count_max);
}

void fv_player_counts(const struct fovea_source *source, struct fovea_source_counts *counts)
{
    *counts = source->counts;
}

enum fovea_source_state fv_player_state(const struct fovea_source *source)
{
    return source->seen_end ? FOVEA_SOURCE_ENDED : FOVEA_SOURCE_OK;
}

enum fovea_status fv_player_complaint(struct fovea_source *source, struct fovea_error *error)
{
    struct complaints *complaints = &source->complaints;
    enum fovea_status status = FOVEA_OK;
    pthread_mutex_lock(&complaints->lock);
    complaints->nobody_asks = false;
    if (complaints->bytes > 0) {
        const size_t bytes = strlen(complaints->text) + 1;
        fovea_error_set(error, FOVEA_ERROR_INPUT, "%s", complaints->text);
        complaints->bytes -= bytes;
        memmove(complaints->text, complaints->text + bytes, complaints->bytes);
        pthread_cond_signal(&complaints->room);
    } else if (complaints->unnamed > 0) {
        fovea_error_set(error, FOVEA_ERROR_INPUT,
                        "%llu more frames were missing or damaged and are not named",
                        (unsigned long long)complaints->unnamed);
        complaints->unnamed = 0;
    } else {
        status = FOVEA_AGAIN;
    }
    pthread_mutex_unlock(&complaints->lock);
    return status;
}
