/* Another source with faults: `fault:URI?kind=KIND[,KIND...][&OPTION=VALUE...]`, or
 * `fault:URI?file=PATH` with a schedule in each line of a file (file.h).
 *
 *     fault:kitti:DIR?kind=freeze,noise&first=40&shortest=15&longest=15&count=1
 *     fault:sim:orbit?seed=3?kind=blur&seed=7
 *
 * What follows the last '?' is for the faults, the rest is the URI of the source. Truth, and what
 * no fault was asked for, is the source's own. Which frames are faulty, and how, follows from the
 * options and the frame's index in the source (of a live source: its count of frames), so it is the
 * same in any selection and in reverse; only what is frozen is the last good picture of those that
 * were played. Samples are faulty when they come with a faulty frame.
 *
 * Nothing is copied but pictures that are changed. A frame that is to come later is kept beside
 * those that are lent, for which the source within lends one more; one that comes again is lent
 * twice, and goes back with the last of the two. */
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "../clock.h"
#include "../table.h"
#include "base/elementary.h"
#include "fault.h"
#include "file.h"
#include "samples.h"

enum { ADDRESS_MAX = 4096 };

static const struct {
    bool needs_last;
    void (*apply)(struct fv_fault_picture *picture);
} faults[FV_FAULT_OF_FRAMES] = {
#define FV_FAULT(name, needs_last) {needs_last, fv_fault_##name},
#include "faults.def"
};

/* A frame of the source within, and its place in the schedule. */
struct taken {
    struct fovea_frame own; /* as the source gave it */
    uint64_t index;
    bool faulty;
    struct fv_fault_window window;
};

struct held {
    bool used;
    struct held *twin; /* the slot that has the same frame of the source; NULL: none */
    struct taken taken;
    uint8_t *pixels[FOVEA_CAMERAS_MAX];
};

struct fovea_source { /* NOLINT(clang-analyzer-optin.performance.Padding): in order of meaning */
    const struct fovea_source_ops *ops;
    struct fovea_source *inner;
    struct fovea_source_info info;
    struct fv_fault_options options;
    struct fv_fault_schedule schedule;
    int32_t channels;
    bool needs_last;
    struct held held[FOVEA_SOURCE_FRAMES_HELD_MAX];
    uint32_t held_max;
    uint8_t *last[FOVEA_CAMERAS_MAX]; /* pictures before a fault; NULL where none needs them */
    bool has_last[FOVEA_CAMERAS_MAX];
    uint8_t *scratch;

    /* A frame that comes later than it was taken (delay, reorder), or again (duplicate). */
    struct {
        bool any, ready;   /* ready: it is the next */
        bool repeats;      /* it has come once */
        struct held *twin; /* the slot that has it too; NULL: none has it any more */
        struct taken taken;
    } waiting;
    struct fv_fault_imu imu;
    uint64_t count; /* frames taken */
    uint64_t lost, returns;
    bool away, inner_ended, ended;
    struct fv_fault_stamp stamp;
    char *file; /* of schedules, this one's among them; NULL: none */
};

static bool has_between(const struct fovea_source *source, int from, int to)
{
    return (source->options.kinds >> from & ((1u << (to - from)) - 1)) != 0;
}

static bool has_pictures(const struct fovea_source *source)
{
    return has_between(source, 0, FV_FAULT_OF_FRAMES);
}

static bool has_samples(const struct fovea_source *source)
{
    return has_between(source, FV_FAULT_OF_SAMPLES, FV_FAULT_OF_CALLS);
}

/* ---- open and close -------------------------------------------------------------------------- */

static void fault_close(struct fovea_source *source)
{
    if (source->inner != NULL) source->ops->close(source->inner);
    for (int i = 0; i < FOVEA_CAMERAS_MAX; i++) {
        for (int k = 0; k < FOVEA_SOURCE_FRAMES_HELD_MAX; k++)
            free(source->held[k].pixels[i]);
        free(source->last[i]);
    }
    free(source->scratch);
    free(source->file);
    free(source);
}

/* Bytes of a picture of camera i without gaps. */
static size_t picture_bytes(const struct fovea_source *source, uint32_t i)
{
    return (size_t)source->info.cameras[i].width * (size_t)source->info.cameras[i].height *
           (size_t)source->channels;
}

static bool take(struct fovea_source *source, uint8_t **memory, size_t bytes)
{
    *memory = malloc(bytes > 0 ? bytes : 1);
    source->info.heap_bytes += bytes;
    return *memory != NULL;
}

static enum fovea_status memory_take(struct fovea_source *source, struct fovea_error *error)
{
    size_t most = 1;
    bool enough = true;
    source->info.heap_bytes += sizeof *source;
    if (!has_pictures(source)) return FOVEA_OK;
    for (uint32_t i = 0; i < source->info.rig.camera_count; i++) {
        const size_t bytes = picture_bytes(source, i);
        for (uint32_t k = 0; k < source->held_max; k++)
            enough = enough && take(source, &source->held[k].pixels[i], bytes);
        if (source->needs_last) enough = enough && take(source, &source->last[i], bytes);
        if (bytes > most) most = bytes;
    }
    enough = enough && take(source, &source->scratch, most);
    if (enough) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "fault: out of memory");
}

/* Whether the source has what is to be spoiled. */
static enum fovea_status check_fit(const struct fovea_source *source, struct fovea_error *error)
{
    const uint32_t cameras = source->info.rig.camera_count;
    if (has_pictures(source) && source->channels == 0)
        return fovea_error_set(
            error, FOVEA_ERROR_UNSUPPORTED,
            "fault: found pictures of another format, expected 8-bit grey levels or RGB (of a camera: format=GREY)");
    if ((uint32_t)source->options.camera > cameras)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "fault: camera: found %d, expected at most %u, as the source has",
                               (int)source->options.camera, cameras);
    if (has_samples(source) && (source->info.sample_kinds & 1u << FOVEA_SAMPLE_IMU) == 0)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "fault: kind: found a fault of the inertial sensor, expected a source that has one (sim: imu=200, euroc: imu=1)");
    return FOVEA_OK;
}

/* The source of an address, whose faults are cut off. */
static enum fovea_status inner_open(struct fovea_source *source, const char *uri,
                                    const struct fovea_source_selection *selection,
                                    struct fovea_error *error)
{
    const char *address;
    struct fovea_source_selection within = *selection;
    source->held_max = fv_source_frames_held(selection);
    within.frames_held = source->held_max + (fv_fault_has(&source->options, FV_FAULT_delay) ||
                                             fv_fault_has(&source->options, FV_FAULT_reorder));
    if (within.frames_held > FOVEA_SOURCE_FRAMES_HELD_MAX)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "fault: kind: found delay or reorder in more than %d faults upon each other, expected at most as many",
            FOVEA_SOURCE_FRAMES_HELD_MAX - FOVEA_SOURCE_FRAMES_HELD);
    enum fovea_status status = fv_source_find(uri, &source->ops, &address, error);
    if (status == FOVEA_OK) status = source->ops->open(address, &within, &source->inner, error);
    if (status != FOVEA_OK) return status;
    source->info = *source->ops->info(source->inner);
    if (fv_fault_has(&source->options, FV_FAULT_drop) ||
        fv_fault_has(&source->options, FV_FAULT_duplicate))
        source->info.frame_count = 0; /* not known without playing */
    const enum fovea_pixel_format format = source->info.format;
    if (format == FOVEA_PIXEL_GREY8) source->channels = 1;
    if (format == FOVEA_PIXEL_RGB24 || format == FOVEA_PIXEL_BGR24) source->channels = 3;
    status = check_fit(source, error);
    return status == FOVEA_OK ? memory_take(source, error) : status;
}

/* The address's own URI, and the faults behind it; false: it is too long. */
static bool address_cut(const char *address, char uri[ADDRESS_MAX], const char **faults_of)
{
    const char *mark = strrchr(address, '?');
    const size_t length = mark != NULL ? (size_t)(mark - address) : strlen(address);
    if (length >= ADDRESS_MAX) return false;
    memcpy(uri, address, length);
    uri[length] = '\0';
    *faults_of = mark != NULL ? mark + 1 : "";
    return true;
}

static bool fault_takes_device(const char *address)
{
    char uri[ADDRESS_MAX];
    const char *faults_of;
    return address_cut(address, uri, &faults_of) && fv_source_takes_device(uri);
}

/* As many sources within each other as the file has lines; the outermost keeps its name. */
static enum fovea_status file_open(char address[ADDRESS_MAX], const char *path,
                                   const struct fovea_source_selection *selection,
                                   struct fovea_source **source, struct fovea_error *error)
{
    char *file = strdup(path);
    if (file == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "fault: out of memory");
    enum fovea_status status = fv_fault_file_read(file, address, ADDRESS_MAX, error);
    if (status == FOVEA_OK)
        status = fv_source_fault.open(address + strlen("fault:"), selection, source, error);
    if (status == FOVEA_OK)
        (*source)->file = file;
    else
        free(file);
    return status;
}

static enum fovea_status fault_open(const char *address,
                                    const struct fovea_source_selection *selection,
                                    struct fovea_source **source, struct fovea_error *error)
{
    char uri[ADDRESS_MAX];
    const char *faults_of;
    if (!address_cut(address, uri, &faults_of))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "fault: found a URI of more than %d bytes, expected less",
                               ADDRESS_MAX - 1);
    if (strncmp(faults_of, "file=", strlen("file=")) == 0)
        return file_open(uri, faults_of + strlen("file="), selection, source, error);
    struct fovea_source *opened = calloc(1, sizeof *opened);
    if (opened == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "fault: out of memory");
    enum fovea_status status = fv_fault_options_parse(faults_of, &opened->options, error);
    for (int kind = 0; kind < FV_FAULT_OF_FRAMES; kind++)
        if (fv_fault_has(&opened->options, (enum fv_fault_kind)kind))
            opened->needs_last |= faults[kind].needs_last;
    if (status == FOVEA_OK) status = inner_open(opened, uri, selection, error);
    if (status != FOVEA_OK) {
        fault_close(opened);
        return status;
    }
    fv_fault_schedule_open(&opened->schedule, &opened->options);
    *source = opened;
    return FOVEA_OK;
}

static const struct fovea_source_info *fault_info(const struct fovea_source *source)
{
    return &source->info;
}

static enum fovea_status fault_start(struct fovea_source *source, struct fovea_error *error)
{
    return source->ops->start(source->inner, error);
}

static void fault_stop(struct fovea_source *source)
{
    if (source->waiting.any && source->waiting.twin == NULL)
        source->ops->requeue(source->inner, &source->waiting.taken.own);
    source->waiting.any = false;
    source->ops->stop(source->inner);
}

/* ---- pictures -------------------------------------------------------------------------------- */

/* An image of camera i without the gaps of its rows. */
static void pack(const struct fovea_source *source, uint32_t i, const struct fovea_image *image,
                 uint8_t *to)
{
    const size_t row = (size_t)source->info.cameras[i].width * (size_t)source->channels;
    for (int32_t y = 0; y < image->height; y++, to += row)
        memcpy(to, image->data + (size_t)y * (size_t)image->stride_bytes, row);
}

static void keep_last(struct fovea_source *source, const struct fovea_frame *frame)
{
    fv_fault_stamp_pass(&source->stamp, frame->stamp_ns);
    for (uint32_t i = 0; i < frame->image_count && source->needs_last; i++) {
        if (frame->images[i].data == NULL) continue;
        pack(source, i, &frame->images[i], source->last[i]);
        source->has_last[i] = true;
    }
}

/* Of one picture alone; neighbours of any of the three have nothing in common. */
static uint64_t picture_seed(const struct taken *taken, uint32_t camera)
{
    return taken->window.seed + (taken->index + 1) * 0x9e3779b97f4a7c15u +
           camera * 0xd1b54a32d192ed03u;
}

static void image_spoil(struct fovea_source *source, struct held *held, uint32_t i,
                        struct fovea_image *image)
{
    const struct fovea_source_camera *camera = &source->info.cameras[i];
    struct fv_fault_picture picture = {.options = &source->options,
                                       .pixels = held->pixels[i],
                                       .width = camera->width,
                                       .height = camera->height,
                                       .channels = source->channels,
                                       .seed = picture_seed(&held->taken, i),
                                       .window_seed = held->taken.window.seed,
                                       .last = source->last[i],
                                       .scratch = source->scratch};
    pack(source, i, image, picture.pixels);
    if (source->needs_last && !source->has_last[i]) {
        memcpy(source->last[i], picture.pixels, picture_bytes(source, i));
        source->has_last[i] = true;
    }
    for (int kind = 0; kind < FV_FAULT_OF_FRAMES; kind++)
        if (fv_fault_has(&source->options, (enum fv_fault_kind)kind)) faults[kind].apply(&picture);
    image->data = picture.pixels;
    image->stride_bytes = camera->width * source->channels;
    image->size_bytes = picture_bytes(source, i);
}

/* ---- frames ---------------------------------------------------------------------------------- */

/* Take a frame of the source within; those that are dropped are gone. FOVEA_AGAIN past the
 * deadline, too: the source may have a frame at once each time, and drop them for long. */
static enum fovea_status inner_take(struct fovea_source *source, int64_t deadline_ns,
                                    struct taken *taken)
{
    for (;;) {
        const enum fovea_status status =
            source->ops->dequeue(source->inner, deadline_ns, &taken->own);
        source->inner_ended = status == FOVEA_END;
        if (status != FOVEA_OK) return status;
        taken->index = source->info.live ? source->count : taken->own.index;
        taken->faulty = fv_fault_schedule_at(&source->schedule, taken->index, &taken->window);
        source->count++;
        if (!taken->faulty || !fv_fault_has(&source->options, FV_FAULT_drop)) return FOVEA_OK;
        source->ops->requeue(source->inner, &taken->own);
        source->lost++;
        if (deadline_ns != INT64_MAX && fv_clock_ns(CLOCK_MONOTONIC) >= deadline_ns)
            return FOVEA_AGAIN;
    }
}

static void wait_for_turn(struct fovea_source *source, const struct taken *taken, bool ready)
{
    source->waiting.any = true;
    source->waiting.ready = ready;
    source->waiting.repeats = false;
    source->waiting.twin = NULL;
    source->waiting.taken = *taken;
}

static void give_waiting(struct fovea_source *source, struct held *held)
{
    held->taken = source->waiting.taken;
    held->twin = source->waiting.twin;
    if (held->twin != NULL) held->twin->twin = held;
    source->waiting.any = false;
}

/* The next frame in the order in which they come: delayed by one, two exchanged, or as it is. */
static enum fovea_status next_take(struct fovea_source *source, int64_t deadline_ns,
                                   struct held *held)
{
    struct taken taken;
    for (;;) {
        if (source->waiting.any && (source->waiting.ready || source->inner_ended)) {
            give_waiting(source, held);
            return FOVEA_OK;
        }
        const enum fovea_status status = inner_take(source, deadline_ns, &taken);
        if (status == FOVEA_END && source->waiting.any) continue;
        if (status != FOVEA_OK) return status;
        const bool late = taken.faulty && fv_fault_has(&source->options, FV_FAULT_delay),
                   swapped = taken.faulty && fv_fault_has(&source->options, FV_FAULT_reorder);
        if (source->waiting.any && fv_fault_has(&source->options, FV_FAULT_delay)) {
            give_waiting(source, held);
            wait_for_turn(source, &taken, !late);
            return FOVEA_OK;
        }
        if (!source->waiting.any && (late || swapped)) {
            wait_for_turn(source, &taken, false);
            continue;
        }
        held->taken = taken;
        source->waiting.ready = source->waiting.any; /* the exchanged one is the next */
        return FOVEA_OK;
    }
}

/* Whether a fault strikes camera i. */
static bool strikes(const struct fovea_source *source, uint32_t i)
{
    return source->options.camera == 0 || (uint32_t)source->options.camera == i + 1;
}

static void frame_spoil(struct fovea_source *source, struct held *held, struct fovea_frame *frame)
{
    frame->stamp_ns =
        fv_fault_stamp(&source->options, picture_seed(&held->taken, FOVEA_CAMERAS_MAX),
                       &source->stamp, frame->stamp_ns);
    for (uint32_t i = 0; i < frame->image_count; i++) {
        struct fovea_image *image = &frame->images[i];
        if (image->data == NULL || !strikes(source, i)) continue;
        if (fv_fault_has(&source->options, FV_FAULT_unplug))
            *image = (struct fovea_image){.data = NULL};
        else if (has_pictures(source))
            image_spoil(source, held, i, image);
    }
}

/* Whether all cameras are unplugged, which is the state of the source. */
static void note_away(struct fovea_source *source, const struct held *held)
{
    const bool away = held->taken.faulty && fv_fault_has(&source->options, FV_FAULT_unplug) &&
                      source->options.camera == 0;
    source->returns += source->away && !away;
    source->away = away;
}

/* A driver that does not return, as of a device that hangs in the kernel: whatever the deadline. */
static void stall(const struct fovea_source *source, const struct taken *taken)
{
    const bool begins = taken->faulty && taken->index == taken->window.begin;
    if (!begins || !fv_fault_has(&source->options, FV_FAULT_stall)) return;
    struct timespec left = fv_clock_timespec(fv_clock_from_ms(source->options.wait_ms));
    while (nanosleep(&left, &left) != 0)
        continue;
}

static enum fovea_status fault_dequeue(struct fovea_source *source, int64_t deadline_ns,
                                       struct fovea_frame *frame)
{
    uint32_t slot = 0;
    while (slot < source->held_max && source->held[slot].used)
        slot++;
    if (slot == source->held_max) return FOVEA_AGAIN;
    struct held *held = &source->held[slot];
    const bool repeated = source->waiting.any && source->waiting.repeats;
    const enum fovea_status status = next_take(source, deadline_ns, held);
    source->ended = status == FOVEA_END;
    if (status != FOVEA_OK) return status;
    if (!repeated) stall(source, &held->taken);
    held->used = true;
    if (held->taken.faulty && fv_fault_has(&source->options, FV_FAULT_duplicate) && !repeated &&
        !source->waiting.any) {
        wait_for_turn(source, &held->taken, true);
        source->waiting.repeats = true;
        source->waiting.twin = held;
    }
    *frame = held->taken.own;
    frame->slot = slot;
    note_away(source, held);
    if (held->taken.faulty)
        frame_spoil(source, held, frame);
    else
        keep_last(source, frame);
    return FOVEA_OK;
}

static void fault_requeue(struct fovea_source *source, const struct fovea_frame *frame)
{
    struct held *held = &source->held[frame->slot];
    const bool waits = source->waiting.any && source->waiting.twin == held;
    if (waits) source->waiting.twin = NULL;
    if (held->twin != NULL) held->twin->twin = NULL;
    if (held->twin == NULL && !waits) source->ops->requeue(source->inner, &held->taken.own);
    held->used = false;
    held->twin = NULL;
}

/* ---- samples --------------------------------------------------------------------------------- */

/* Those that have come by the time that the frame does: of a delayed frame, later ones too. */
static uint32_t fault_samples(struct fovea_source *source, const struct fovea_frame *frame,
                              struct fovea_sample *samples, uint32_t count_max)
{
    const struct taken *taken = &source->held[frame->slot].taken;
    const struct fovea_frame *newest = &taken->own;
    if (source->ops->samples == NULL) return 0;
    if (source->waiting.any && source->waiting.taken.own.stamp_ns > newest->stamp_ns)
        newest = &source->waiting.taken.own;
    const uint32_t growth = fv_fault_samples_growth(&source->options);
    uint32_t count = source->ops->samples(source->inner, newest, samples, count_max / growth);
    if (taken->faulty && has_samples(source))
        return fv_fault_samples(&source->options, picture_seed(taken, FOVEA_CAMERAS_MAX + 1),
                                taken->window.seed, &source->imu, samples, count);
    fv_fault_samples_pass(&source->imu, samples, count);
    return count;
}

/* ---- what the source says, passed on --------------------------------------------------------- */

static enum fovea_status fault_truth(struct fovea_source *source, const struct fovea_frame *frame,
                                     struct fovea_truth *truth)
{
    if (source->ops->truth == NULL) return FOVEA_ERROR_UNSUPPORTED;
    return source->ops->truth(source->inner, &source->held[frame->slot].taken.own, truth);
}

static enum fovea_status fault_truth_pose(struct fovea_source *source,
                                          const struct fovea_frame *frame, double T_world_cam[12])
{
    if (source->ops->truth_pose == NULL) return FOVEA_ERROR_UNSUPPORTED;
    return source->ops->truth_pose(source->inner, &source->held[frame->slot].taken.own,
                                   T_world_cam);
}

static void fault_counts(const struct fovea_source *source, struct fovea_source_counts *counts)
{
    if (source->ops->counts != NULL)
        source->ops->counts(source->inner, counts);
    else
        *counts = (struct fovea_source_counts){.delivered = source->count};
    counts->delivered -= source->lost < counts->delivered ? source->lost : counts->delivered;
    counts->dropped += source->lost;
    counts->recovered += source->returns;
}

static enum fovea_source_state fault_state(const struct fovea_source *source)
{
    if (source->away) return FOVEA_SOURCE_GONE;
    if (source->ops->state != NULL) return source->ops->state(source->inner);
    return source->ended ? FOVEA_SOURCE_ENDED : FOVEA_SOURCE_OK;
}

static enum fovea_status fault_complaint(struct fovea_source *source, struct fovea_error *error)
{
    return source->ops->complaint != NULL ? source->ops->complaint(source->inner, error)
                                          : FOVEA_AGAIN;
}

static enum fovea_status fault_control(struct fovea_source *source,
                                       enum fovea_source_control control, double value,
                                       struct fovea_error *error)
{
    return fv_source_control(source->ops, source->inner, control, value, error);
}

static enum fovea_status fault_drive(struct fovea_source *source,
                                     const struct fovea_velocity_command *command,
                                     struct fovea_error *error)
{
    return fv_source_drive(source->ops, source->inner, command, error);
}

static enum fovea_status fault_failure(const struct fovea_source *source, struct fovea_error *error)
{
    return fv_source_failure(source->ops, source->inner, error);
}

static void fault_reads(const struct fovea_source *source,
                        void (*visit)(void *context, const char *path), void *context)
{
    if (source->file != NULL) visit(context, source->file);
    if (source->ops->reads != NULL) source->ops->reads(source->inner, visit, context);
}

const struct fovea_source_ops fv_source_fault = {
    .name = "fault",
    .help =
        "URI?kind=KIND[,KIND...][&OPTION=VALUE...]  another source with faults by a seeded schedule (KIND=FRACTION is short for kind=KIND&fraction=FRACTION), or by those of a file (URI?file=PATH):"
#define FV_FAULT(name, needs_last) " " #name
#define FV_FAULT_OTHER(name) " " #name
#include "faults.def"
        "; options"
#define FV_FAULT_OPTION(name, kind, type, member, value, low, high, unit) " " #name
#include "options.def"
#undef FV_FAULT_OPTION
    ,
    .open = fault_open,
    .info = fault_info,
    .start = fault_start,
    .dequeue = fault_dequeue,
    .requeue = fault_requeue,
    .stop = fault_stop,
    .close = fault_close,
    .truth = fault_truth,
    .truth_pose = fault_truth_pose,
    .samples = fault_samples,
    .counts = fault_counts,
    .state = fault_state,
    .complaint = fault_complaint,
    .reads = fault_reads,
    .control = fault_control,
    .drive = fault_drive,
    .failure = fault_failure,
    .takes_device = fault_takes_device,
};
