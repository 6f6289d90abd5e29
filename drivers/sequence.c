/* Several recordings played one after the other, as if one camera had made them.
 *
 *     sequence:PART then PART ...       PART: URI, or URI[start=N,step=N,frames=N,reverse]
 *
 * Parts have as many cameras as the first one, at the same places, and all of them or none an
 * inertial sensor; samples of other sensors are left out, as those of two parts do not go together.
 * All parts are open from the start; each goes on one period after the last frame of the one
 * before. Frames come as the first part's cameras would have seen them: images of a camera with
 * another calibration are resampled (bilinear, edge pixels repeated beyond the border). Truth goes
 * with the picture, so parts of different recordings have different worlds. `sequence` of a frame
 * counts all frames played. Live sources cannot be parts. */
#include <stdlib.h>
#include <string.h>

#include "table.h"
#include "fovea/source.h"
#include "support/text.h"
#include "sequence.h"
#include "sequence_map.h"

enum { PARTS_MAX = 8, ADDRESS_MAX = 4096 };

struct part {
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fv_sequence_place *map[FOVEA_CAMERAS_MAX]; /* by camera; NULL: its pictures fit */
};

struct held {
    bool used;
    uint32_t part;
    struct fovea_frame own;             /* as the part gave it */
    int64_t move_ns;                    /* added to its stamps */
    uint8_t *pixels[FOVEA_CAMERAS_MAX]; /* of resampled pictures */
};

struct fovea_source { /* NOLINT(clang-analyzer-optin.performance.Padding): in order of meaning */
    struct fovea_source_info info;
    struct fovea_source_selection selection;
    struct part parts[PARTS_MAX];
    uint32_t count, playing;
    bool started;
    struct held held[FOVEA_SOURCE_FRAMES_HELD_MAX];
    uint64_t position; /* of the next frame among all */
    uint64_t delivered;
    int64_t period_ns, last_ns; /* stamp of the last frame, moved */
    int64_t move_ns;            /* added to stamps of the part that plays */
    bool any, begun;            /* a frame came; the part that plays has given one */
};

/* ---- reading the address --------------------------------------------------------------------- */

static enum fovea_status read_option(const char *option, struct fovea_source_selection *selection,
                                     struct fovea_error *error)
{
    struct {
        const char *name;
        uint64_t *value;
    } const names[] = {{"start=", &selection->start},
                       {"step=", &selection->step},
                       {"frames=", &selection->frames}};
    char quoted[FV_TEXT_QUOTED_BYTES];
    if (strcmp(option, "reverse") == 0) {
        selection->reverse = true;
        return FOVEA_OK;
    }
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        int64_t value;
        const size_t length = strlen(names[i].name);
        if (strncmp(option, names[i].name, length) != 0) continue;
        if (!fv_text_integer(option + length, &value) || value < 0) break;
        *names[i].value = (uint64_t)value;
        return FOVEA_OK;
    }
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "sequence: found %s, expected start=N, step=N, frames=N or reverse",
                           fv_text_quote(option, quoted, sizeof quoted));
}

/* Take the brackets at the end of a part off it. */
static enum fovea_status read_selection(char *text, struct fovea_source_selection *selection,
                                        struct fovea_error *error)
{
    *selection = (struct fovea_source_selection){.step = 1};
    const size_t length = strlen(text);
    char *open = strrchr(text, '[');
    if (open == NULL || text[length - 1] != ']') return FOVEA_OK;
    text[length - 1] = '\0';
    *open = '\0';
    for (char *option = open + 1, *end; option != NULL; option = end) {
        end = strchr(option, ',');
        if (end != NULL) *end++ = '\0';
        const enum fovea_status status = read_option(option, selection, error);
        if (status != FOVEA_OK) return status;
    }
    return FOVEA_OK;
}

static bool same_place(const double a[12], const double b[12])
{
    for (int i = 0; i < 12; i++)
        if (!(a[i] - b[i] < 1e-6 && b[i] - a[i] < 1e-6)) return false;
    return true;
}

/* In what a part's rig is not that of the first part, beside its calibrations; NULL: in nothing. */
static const char *rig_differs(const struct fovea_rig *first, const struct fovea_rig *rig)
{
    if (rig->camera_count != first->camera_count) return "other numbers of cameras";
    for (uint32_t i = 0; i < rig->camera_count && rig->camera_count > 1; i++)
        if (rig->cameras[i].has_T_body_cam != first->cameras[i].has_T_body_cam ||
            !same_place(rig->cameras[i].T_body_cam, first->cameras[i].T_body_cam))
            return "other places of cameras";
    if (rig->has_imu != first->has_imu) return "other inertial sensors";
    if (rig->has_imu && (rig->imu.time_offset_ns != first->imu.time_offset_ns ||
                         !same_place(rig->imu.T_body_imu, first->imu.T_body_imu)))
        return "other places or clocks of inertial sensors";
    return NULL;
}

static enum fovea_status open_part(struct fovea_source *source, char *text,
                                   struct fovea_error *error)
{
    struct fovea_source_selection selection;
    char quoted[FV_TEXT_QUOTED_BYTES];
    const char *address;
    if (source->count == PARTS_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "sequence: found more than %d parts",
                               PARTS_MAX);
    struct part *part = &source->parts[source->count];
    enum fovea_status status = read_selection(text, &selection, error);
    selection.camera_given = source->selection.camera_given;
    selection.frames_held = source->selection.frames_held;
    if (status == FOVEA_OK) status = fv_source_find(text, &part->ops, &address, error);
    if (status != FOVEA_OK) return status;
    if (part->ops == &fv_source_sequence)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sequence: found %s as a part, expected no sequence",
                               fv_text_quote(text, quoted, sizeof quoted));
    status = part->ops->open(address, &selection, &part->source, error);
    if (status != FOVEA_OK) return status;
    source->count++;
    if (part->ops->info(part->source)->live)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sequence: found the live source %s, expected recordings",
                               fv_text_quote(text, quoted, sizeof quoted));
    const char *differs = rig_differs(&source->parts[0].ops->info(source->parts[0].source)->rig,
                                      &part->ops->info(part->source)->rig);
    if (differs == NULL) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "sequence: found %s with %s, expected those of the first part",
                           fv_text_quote(text, quoted, sizeof quoted), differs);
}

/* ---- open and close -------------------------------------------------------------------------- */

static void sequence_close(struct fovea_source *source)
{
    for (uint32_t i = 0; i < source->count; i++) {
        source->parts[i].ops->close(source->parts[i].source);
        for (int k = 0; k < FOVEA_CAMERAS_MAX; k++)
            free(source->parts[i].map[k]);
    }
    for (int i = 0; i < FOVEA_SOURCE_FRAMES_HELD_MAX; i++)
        for (int k = 0; k < FOVEA_CAMERAS_MAX; k++)
            free(source->held[i].pixels[k]);
    free(source);
}

static enum fovea_status open_parts(struct fovea_source *source, char *text,
                                    struct fovea_error *error)
{
    static const char between[] = " then ";
    enum fovea_status status = FOVEA_OK;
    for (char *part = text, *next; part != NULL && status == FOVEA_OK; part = next) {
        next = strstr(part, between);
        if (next != NULL) {
            *next = '\0';
            next += sizeof between - 1;
        }
        status = open_part(source, part, error);
    }
    return status;
}

static uint64_t frames_of(const struct fovea_source_selection *selection, uint64_t all)
{
    const uint64_t left =
        all > selection->start ? (all - selection->start - 1) / selection->step + 1 : 0;
    return selection->frames > 0 && selection->frames < left ? selection->frames : left;
}

/* What a resampled picture of camera i takes. */
static size_t picture_bytes(const struct fovea_source_info *info, uint32_t i)
{
    return (size_t)info->cameras[i].width * (size_t)info->cameras[i].height;
}

/* The maps of a part, and memory for the pictures that they make, once for all parts. */
static enum fovea_status make_maps(struct fovea_source *source, struct part *part,
                                   struct fovea_error *error)
{
    struct fovea_source_info *info = &source->info;
    for (uint32_t i = 0; i < info->rig.camera_count; i++) {
        const size_t bytes = picture_bytes(info, i);
        const enum fovea_status status =
            fv_sequence_map_make(info, part->ops->info(part->source), i, &part->map[i], error);
        if (status != FOVEA_OK) return status;
        if (part->map[i] == NULL) continue;
        info->heap_bytes += bytes * sizeof *part->map[i];
        for (uint32_t k = 0; k < fv_source_frames_held(&source->selection); k++) {
            uint8_t **pixels = &source->held[k].pixels[i];
            if (*pixels != NULL) continue;
            *pixels = malloc(bytes);
            if (*pixels == NULL)
                return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "sequence: out of memory");
            info->heap_bytes += bytes;
        }
    }
    return FOVEA_OK;
}

static enum fovea_status unite(struct fovea_source *source, struct fovea_error *error)
{
    struct fovea_source_info *info = &source->info;
    *info = *source->parts[0].ops->info(source->parts[0].source);
    info->sample_kinds &= 1u << FOVEA_SAMPLE_IMU;
    uint64_t frames = 0;
    bool known = true;
    info->heap_bytes = sizeof *source;
    info->has_truth = true;
    for (uint32_t i = 0; i < source->count; i++) {
        const enum fovea_status status = make_maps(source, &source->parts[i], error);
        if (status != FOVEA_OK) return status;
        const struct fovea_source_info *own = source->parts[i].ops->info(source->parts[i].source);
        known = known && own->frame_count > 0;
        frames += own->frame_count;
        info->heap_bytes += own->heap_bytes;
        info->sample_kinds &= own->sample_kinds;
        info->has_truth = info->has_truth && own->has_truth;
    }
    source->period_ns = (int64_t)(1e9 / (info->rate_hz > 0 ? info->rate_hz : 30));
    info->frame_count = known ? frames_of(&source->selection, frames) : source->selection.frames;
    info->rate_hz /= (double)source->selection.step;
    if (known && info->frame_count == 0)
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT, "start: found %llu, expected less than %llu frames",
            (unsigned long long)source->selection.start, (unsigned long long)frames);
    return FOVEA_OK;
}

static enum fovea_status sequence_open(const char *address,
                                       const struct fovea_source_selection *selection,
                                       struct fovea_source **opened, struct fovea_error *error)
{
    char text[ADDRESS_MAX];
    if (selection->step == 0)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "step: found 0, expected at least 1");
    if (selection->reverse)
        return fovea_error_set(
            error, FOVEA_ERROR_UNSUPPORTED,
            "sequence: cannot be played in reverse as a whole, expected [reverse] after a part");
    if (strlen(address) >= sizeof text)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sequence: found %zu bytes, expected less than %d", strlen(address),
                               ADDRESS_MAX);
    struct fovea_source *source = calloc(1, sizeof *source);
    if (source == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "sequence: out of memory");
    source->selection = *selection;
    strcpy(text, address);
    enum fovea_status status = open_parts(source, text, error);
    if (status == FOVEA_OK) status = unite(source, error);
    if (status != FOVEA_OK)
        sequence_close(source);
    else
        *opened = source;
    return status;
}

/* ---- playing --------------------------------------------------------------------------------- */

static const struct fovea_source_info *sequence_info(const struct fovea_source *source)
{
    return &source->info;
}

static void sequence_stop(struct fovea_source *source)
{
    for (uint32_t i = 0; source->started && i < source->count; i++)
        source->parts[i].ops->stop(source->parts[i].source);
    source->started = false;
}

static enum fovea_status sequence_start(struct fovea_source *source, struct fovea_error *error)
{
    for (uint32_t i = 0; i < source->count; i++) {
        const enum fovea_status status =
            source->parts[i].ops->start(source->parts[i].source, error);
        if (status == FOVEA_OK) continue;
        while (i-- > 0)
            source->parts[i].ops->stop(source->parts[i].source);
        return status;
    }
    source->started = true;
    return FOVEA_OK;
}

/* Whether a frame is among those selected; counts it. */
static bool chosen(struct fovea_source *source)
{
    const uint64_t position = source->position++;
    return position >= source->selection.start &&
           (position - source->selection.start) % source->selection.step == 0;
}

/* The stamp of a frame of the part that plays, moved behind the part before. */
static int64_t moved_stamp(struct fovea_source *source, int64_t stamp_ns)
{
    if (!source->begun)
        source->move_ns = source->any ? (int64_t)((uint64_t)source->last_ns +
                                                  (uint64_t)source->period_ns - (uint64_t)stamp_ns)
                                      : 0;
    source->begun = source->any = true;
    return source->last_ns = (int64_t)((uint64_t)stamp_ns + (uint64_t)source->move_ns);
}

static void hand_out(struct fovea_source *source, uint32_t slot, struct fovea_frame *frame)
{
    struct held *held = &source->held[slot];
    const struct part *part = &source->parts[held->part];
    *frame = held->own;
    frame->stamp_ns = source->last_ns;
    frame->clock = FOVEA_CLOCK_RECORDED;
    frame->sequence = frame->index = source->position - 1;
    frame->slot = slot;
    held->move_ns = source->move_ns;
    for (uint32_t i = 0; i < frame->image_count && i < source->info.rig.camera_count; i++) {
        const struct fovea_source_camera *seen = &source->info.cameras[i];
        const struct fovea_image *own = &held->own.images[i];
        if (part->map[i] == NULL || own->data == NULL) continue;
        fv_sequence_map_apply(part->map[i], seen, own, held->pixels[i]);
        frame->images[i] = (struct fovea_image){.data = held->pixels[i],
                                                .width = seen->width,
                                                .height = seen->height,
                                                .stride_bytes = seen->width,
                                                .format = FOVEA_PIXEL_GREY8,
                                                .size_bytes = picture_bytes(&source->info, i)};
    }
}

/* Inertial samples of the frame's part, on the clock of the sequence. */
static uint32_t take_samples(struct fovea_source *source, const struct held *held,
                             struct fovea_sample *samples, uint32_t count_max)
{
    const struct part *part = &source->parts[held->part];
    uint32_t kept = 0;
    if (part->ops->samples == NULL || source->info.sample_kinds == 0) return 0;
    const uint32_t count = part->ops->samples(part->source, &held->own, samples, count_max);
    for (uint32_t i = 0; i < count; i++) {
        if (samples[i].kind != FOVEA_SAMPLE_IMU) continue;
        samples[kept] = samples[i];
        samples[kept++].any.stamp_ns += held->move_ns;
    }
    return kept;
}

/* Of a frame before the first that is played. */
static void drop_samples(const struct part *part, const struct fovea_frame *own)
{
    enum { AT_ONCE = 16 };
    struct fovea_sample gone[AT_ONCE];
    while (part->ops->samples != NULL &&
           part->ops->samples(part->source, own, gone, AT_ONCE) == AT_ONCE)
        continue;
}

static uint32_t sequence_samples(struct fovea_source *source, const struct fovea_frame *frame,
                                 struct fovea_sample *samples, uint32_t count_max)
{
    return take_samples(source, &source->held[frame->slot], samples, count_max);
}

static enum fovea_status sequence_dequeue(struct fovea_source *source, int64_t deadline_ns,
                                          struct fovea_frame *frame)
{
    const uint32_t held_max = fv_source_frames_held(&source->selection);
    uint32_t slot = 0;
    if (!source->started) return FOVEA_END;
    while (slot < held_max && source->held[slot].used)
        slot++;
    if (slot == held_max) return FOVEA_AGAIN;
    if (source->selection.frames > 0 && source->delivered == source->selection.frames)
        source->playing = source->count;
    while (source->playing < source->count) {
        struct part *part = &source->parts[source->playing];
        struct held *held = &source->held[slot];
        const enum fovea_status status = part->ops->dequeue(part->source, deadline_ns, &held->own);
        if (status == FOVEA_END) {
            source->playing++;
            source->begun = false;
            continue;
        }
        if (status != FOVEA_OK) return status;
        (void)moved_stamp(source, held->own.stamp_ns);
        if (!chosen(source)) {
            if (source->position <= source->selection.start) drop_samples(part, &held->own);
            part->ops->requeue(part->source, &held->own);
            continue;
        }
        held->used = true;
        held->part = source->playing;
        source->delivered++;
        hand_out(source, slot, frame);
        return FOVEA_OK;
    }
    return FOVEA_END;
}

static void sequence_requeue(struct fovea_source *source, const struct fovea_frame *frame)
{
    struct held *held = &source->held[frame->slot];
    const struct part *part = &source->parts[held->part];
    part->ops->requeue(part->source, &held->own);
    held->used = false;
}

/* ---- the rest of the table ------------------------------------------------------------------- */

static enum fovea_status sequence_truth(struct fovea_source *source,
                                        const struct fovea_frame *frame, struct fovea_truth *truth)
{
    const struct held *held = &source->held[frame->slot];
    const struct part *part = &source->parts[held->part];
    if (part->ops->truth == NULL) return FOVEA_ERROR_UNSUPPORTED;
    const enum fovea_status status = part->ops->truth(part->source, &held->own, truth);
    if (status != FOVEA_OK || part->map[0] == NULL) return status;
    truth->box_count = 0; /* these and the maps belong to the part's own picture */
    truth->depth_m = NULL;
    truth->class_mask = NULL;
    return FOVEA_OK;
}

static enum fovea_status sequence_truth_pose(struct fovea_source *source,
                                             const struct fovea_frame *frame,
                                             double T_world_cam[12])
{
    const struct held *held = &source->held[frame->slot];
    const struct part *part = &source->parts[held->part];
    if (part->ops->truth_pose == NULL) return FOVEA_ERROR_UNSUPPORTED;
    return part->ops->truth_pose(part->source, &held->own, T_world_cam);
}

static void sequence_counts(const struct fovea_source *source, struct fovea_source_counts *counts)
{
    *counts = (struct fovea_source_counts){.delivered = source->delivered};
    for (uint32_t i = 0; i < source->count; i++) {
        struct fovea_source_counts own = {0};
        if (source->parts[i].ops->counts != NULL)
            source->parts[i].ops->counts(source->parts[i].source, &own);
        counts->missing += own.missing;
        counts->damaged += own.damaged;
        counts->dropped += own.dropped;
        counts->recovered += own.recovered;
    }
}

static enum fovea_source_state sequence_state(const struct fovea_source *source)
{
    return source->playing == source->count ? FOVEA_SOURCE_ENDED : FOVEA_SOURCE_OK;
}

/* Of the part that is played. */
static enum fovea_status sequence_failure(const struct fovea_source *source,
                                          struct fovea_error *error)
{
    if (source->playing == source->count) return FOVEA_AGAIN;
    const struct part *part = &source->parts[source->playing];
    return fv_source_failure(part->ops, part->source, error);
}

static enum fovea_status sequence_complaint(struct fovea_source *source, struct fovea_error *error)
{
    for (uint32_t i = 0; i < source->count; i++)
        if (source->parts[i].ops->complaint != NULL &&
            source->parts[i].ops->complaint(source->parts[i].source, error) != FOVEA_AGAIN)
            return FOVEA_OK;
    return FOVEA_AGAIN;
}

static void sequence_reads(const struct fovea_source *source,
                           void (*visit)(void *context, const char *path), void *context)
{
    for (uint32_t i = 0; i < source->count; i++)
        if (source->parts[i].ops->reads != NULL)
            source->parts[i].ops->reads(source->parts[i].source, visit, context);
}

const struct fovea_source_ops fv_source_sequence = {
    .name = "sequence",
    .help =
        "URI[SELECTION] then URI[SELECTION]...  recordings one after the other; a selection is start=N,step=K,frames=N,reverse",
    .open = sequence_open,
    .info = sequence_info,
    .start = sequence_start,
    .dequeue = sequence_dequeue,
    .requeue = sequence_requeue,
    .stop = sequence_stop,
    .close = sequence_close,
    .truth = sequence_truth,
    .truth_pose = sequence_truth_pose,
    .samples = sequence_samples,
    .counts = sequence_counts,
    .state = sequence_state,
    .complaint = sequence_complaint,
    .failure = sequence_failure,
    .reads = sequence_reads,
};
