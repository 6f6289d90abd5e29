/* Another source with faults: `fault:URI?kind=KIND[,KIND...][&OPTION=VALUE...]`.
 *
 *     fault:kitti:DIR?kind=freeze,noise&first=40&shortest=15&longest=15&count=1
 *     fault:sim:orbit?seed=3?kind=blur&seed=7
 *
 * What follows the last '?' is for the faults, the rest is the URI of the source. Frames, stamps,
 * samples and truth are the source's own; of a faulty frame the pictures of all cameras are
 * changed, each on its own. Which frames these are, and how they are changed, follows from the
 * options and the frame's index in the source (of a live source: its count of frames), so it is the
 * same in any selection and in reverse; only what is frozen is the last good picture of those that
 * were played. */
#include <stdlib.h>
#include <string.h>

#include "../table.h"
#include "fault.h"

enum { ADDRESS_MAX = 4096 };

static const struct {
    bool needs_last;
    void (*apply)(struct fv_fault_picture *picture);
} faults[FV_FAULT_COUNT] = {
#define FV_FAULT(name, needs_last) {needs_last, fv_fault_##name},
#include "faults.def"
#undef FV_FAULT
};

struct held {
    bool used;
    struct fovea_frame own; /* as the source gave it */
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
    struct held held[FOVEA_SOURCE_FRAMES_HELD];
    uint8_t *last[FOVEA_CAMERAS_MAX]; /* pictures before a fault; NULL where none needs them */
    bool has_last[FOVEA_CAMERAS_MAX];
    uint8_t *scratch;
    uint64_t taken; /* frames */
    bool ended;
};

/* ---- open and close -------------------------------------------------------------------------- */

static void fault_close(struct fovea_source *source)
{
    if (source->inner != NULL) source->ops->close(source->inner);
    for (int i = 0; i < FOVEA_CAMERAS_MAX; i++) {
        for (int k = 0; k < FOVEA_SOURCE_FRAMES_HELD; k++)
            free(source->held[k].pixels[i]);
        free(source->last[i]);
    }
    free(source->scratch);
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
    *memory = malloc(bytes);
    source->info.heap_bytes += bytes;
    return *memory != NULL;
}

static enum fovea_status memory_take(struct fovea_source *source, struct fovea_error *error)
{
    size_t most = 1;
    bool enough = true;
    source->info.heap_bytes += sizeof *source;
    for (uint32_t i = 0; i < source->info.rig.camera_count; i++) {
        const size_t bytes = picture_bytes(source, i);
        for (int k = 0; k < FOVEA_SOURCE_FRAMES_HELD; k++)
            enough = enough && take(source, &source->held[k].pixels[i], bytes);
        if (source->needs_last) enough = enough && take(source, &source->last[i], bytes);
        if (bytes > most) most = bytes;
    }
    enough = enough && take(source, &source->scratch, most);
    if (enough) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "fault: out of memory");
}

/* The source of an address, whose faults are cut off. */
static enum fovea_status inner_open(struct fovea_source *source, const char *uri,
                                    const struct fovea_source_selection *selection,
                                    struct fovea_error *error)
{
    const char *address;
    enum fovea_status status = fv_source_find(uri, &source->ops, &address, error);
    if (status == FOVEA_OK) status = source->ops->open(address, selection, &source->inner, error);
    if (status != FOVEA_OK) return status;
    source->info = *source->ops->info(source->inner);
    const enum fovea_pixel_format format = source->info.format;
    if (format == FOVEA_PIXEL_GREY8) source->channels = 1;
    if (format == FOVEA_PIXEL_RGB24 || format == FOVEA_PIXEL_BGR24) source->channels = 3;
    if (source->channels != 0) return memory_take(source, error);
    return fovea_error_set(
        error, FOVEA_ERROR_UNSUPPORTED,
        "fault: found pictures of another format, expected 8-bit grey levels or RGB (of a camera: format=GREY)");
}

static enum fovea_status fault_open(const char *address,
                                    const struct fovea_source_selection *selection,
                                    struct fovea_source **source, struct fovea_error *error)
{
    char uri[ADDRESS_MAX];
    const char *mark = strrchr(address, '?');
    const size_t length = mark != NULL ? (size_t)(mark - address) : strlen(address);
    if (length >= sizeof uri)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "fault: found a URI of more than %d bytes, expected less",
                               ADDRESS_MAX - 1);
    memcpy(uri, address, length);
    uri[length] = '\0';
    struct fovea_source *opened = calloc(1, sizeof *opened);
    if (opened == NULL) return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "fault: out of memory");
    enum fovea_status status =
        fv_fault_options_parse(mark != NULL ? mark + 1 : "", &opened->options, error);
    for (int kind = 0; kind < FV_FAULT_COUNT; kind++)
        if (opened->options.kinds & 1u << kind) opened->needs_last |= faults[kind].needs_last;
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
    for (uint32_t i = 0; i < frame->image_count && source->needs_last; i++) {
        if (frame->images[i].data == NULL) continue;
        pack(source, i, &frame->images[i], source->last[i]);
        source->has_last[i] = true;
    }
}

/* Of one picture alone; neighbours of any of the three have nothing in common. */
static uint64_t picture_seed(const struct fv_fault_window *window, uint64_t index, uint32_t camera)
{
    return window->seed + (index + 1) * 0x9e3779b97f4a7c15u + camera * 0xd1b54a32d192ed03u;
}

static void image_spoil(struct fovea_source *source, struct held *held, uint32_t i, uint64_t index,
                        const struct fv_fault_window *window, struct fovea_image *image)
{
    const struct fovea_source_camera *camera = &source->info.cameras[i];
    struct fv_fault_picture picture = {.options = &source->options,
                                       .pixels = held->pixels[i],
                                       .width = camera->width,
                                       .height = camera->height,
                                       .channels = source->channels,
                                       .seed = picture_seed(window, index, i),
                                       .window_seed = window->seed,
                                       .last = source->last[i],
                                       .scratch = source->scratch};
    pack(source, i, image, picture.pixels);
    if (source->needs_last && !source->has_last[i]) {
        memcpy(source->last[i], picture.pixels, picture_bytes(source, i));
        source->has_last[i] = true;
    }
    for (int kind = 0; kind < FV_FAULT_COUNT; kind++)
        if (source->options.kinds & 1u << kind) faults[kind].apply(&picture);
    image->data = picture.pixels;
    image->stride_bytes = camera->width * source->channels;
    image->size_bytes = picture_bytes(source, i);
}

static enum fovea_status fault_dequeue(struct fovea_source *source, int64_t deadline_ns,
                                       struct fovea_frame *frame)
{
    uint32_t slot = 0;
    struct fv_fault_window window;
    while (slot < FOVEA_SOURCE_FRAMES_HELD && source->held[slot].used)
        slot++;
    if (slot == FOVEA_SOURCE_FRAMES_HELD) return FOVEA_AGAIN;
    struct held *held = &source->held[slot];
    const enum fovea_status status = source->ops->dequeue(source->inner, deadline_ns, &held->own);
    source->ended = status == FOVEA_END;
    if (status != FOVEA_OK) return status;
    const uint64_t index = source->info.live ? source->taken : held->own.index;
    held->used = true;
    source->taken++;
    *frame = held->own;
    frame->slot = slot;
    if (!fv_fault_schedule_at(&source->schedule, index, &window)) {
        keep_last(source, frame);
        return FOVEA_OK;
    }
    for (uint32_t i = 0; i < frame->image_count; i++)
        if (frame->images[i].data != NULL)
            image_spoil(source, held, i, index, &window, &frame->images[i]);
    return FOVEA_OK;
}

static void fault_requeue(struct fovea_source *source, const struct fovea_frame *frame)
{
    struct held *held = &source->held[frame->slot];
    source->ops->requeue(source->inner, &held->own);
    held->used = false;
}

/* ---- what the source says, passed on --------------------------------------------------------- */

static enum fovea_status fault_truth(struct fovea_source *source, const struct fovea_frame *frame,
                                     struct fovea_truth *truth)
{
    if (source->ops->truth == NULL) return FOVEA_ERROR_UNSUPPORTED;
    return source->ops->truth(source->inner, &source->held[frame->slot].own, truth);
}

static enum fovea_status fault_truth_pose(struct fovea_source *source,
                                          const struct fovea_frame *frame, double T_world_cam[12])
{
    if (source->ops->truth_pose == NULL) return FOVEA_ERROR_UNSUPPORTED;
    return source->ops->truth_pose(source->inner, &source->held[frame->slot].own, T_world_cam);
}

static uint32_t fault_samples(struct fovea_source *source, const struct fovea_frame *frame,
                              struct fovea_sample *samples, uint32_t count_max)
{
    if (source->ops->samples == NULL) return 0;
    return source->ops->samples(source->inner, &source->held[frame->slot].own, samples, count_max);
}

static void fault_counts(const struct fovea_source *source, struct fovea_source_counts *counts)
{
    if (source->ops->counts != NULL)
        source->ops->counts(source->inner, counts);
    else
        *counts = (struct fovea_source_counts){.delivered = source->taken};
}

static enum fovea_source_state fault_state(const struct fovea_source *source)
{
    if (source->ops->state != NULL) return source->ops->state(source->inner);
    return source->ended ? FOVEA_SOURCE_ENDED : FOVEA_SOURCE_OK;
}

static enum fovea_status fault_complaint(struct fovea_source *source, struct fovea_error *error)
{
    return source->ops->complaint != NULL ? source->ops->complaint(source->inner, error)
                                          : FOVEA_AGAIN;
}

static void fault_reads(const struct fovea_source *source,
                        void (*visit)(void *context, const char *path), void *context)
{
    if (source->ops->reads != NULL) source->ops->reads(source->inner, visit, context);
}

const struct fovea_source_ops fv_source_fault = {
    .name = "fault",
    .help =
        "URI?kind=KIND[,KIND...][&OPTION=VALUE...]  another source with faults by a seeded schedule:"
#define FV_FAULT(name, needs_last) " " #name
#include "faults.def"
#undef FV_FAULT
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
};
