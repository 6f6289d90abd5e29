/* LCM logs with fovea.frame_t messages: our own recordings, and logs of other programs that publish
 * the type. Any channel whose last part is FRAME; frames as recorded, in any pixel format;
 * compressed ones are decoded to grey here. Damage is passed over to the next event that can be
 * read, as liblcm does, but counted: as one damaged frame. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/calibration.h"
#include "support/decode.h"
#include "support/lcmlog.h"
#include "kind.h"
#include "listing.h"
#include "log_rig.h"
#include "player.h"
#include "samples.h"

struct entry {
    int64_t offset; /* of the frame's event, or of what could not be read */
    int64_t stamp_ns;
    bool stamped;
    bool sample; /* of a sensor, damaged */
};

enum { HEADS_MAX = 8 };

/* The first head of each recorder that the log holds. */
struct heads {
    uint32_t count;
    char channel[HEADS_MAX][FV_LCMLOG_CHANNEL_BYTES];
    int64_t offset[HEADS_MAX];
};

struct recording {
    char *path;
    struct fv_lcmlog *log;
    struct entry *entries;
    size_t count, capacity;
    char channel[FV_LCMLOG_CHANNEL_BYTES]; /* of the first frame; frames on others are another
                                              camera's */
    struct fv_samples samples;             /* of the same recorder as the frames */
    bool sampled;                          /* the log holds some */
    struct fovea_rig rig; /* from the head of our own recordings; without one a camera_count of 0 */
};

static void close_recording(void *argument)
{
    struct recording *recording = argument;
    if (recording == NULL) return;
    if (recording->log != NULL) fv_lcmlog_close(recording->log);
    fv_samples_free(&recording->samples);
    free(recording->entries);
    free(recording->path);
    free(recording);
}

/* ---- index ----------------------------------------------------------------------------------- */

static enum fovea_status add_entry(struct recording *recording, const struct entry *entry,
                                   struct fovea_error *error)
{
    if (recording->count == recording->capacity) {
        const size_t larger = recording->capacity == 0 ? 1024 : 2 * recording->capacity;
        struct entry *moved = larger > FV_LISTING_FRAMES_MAX
                                  ? NULL
                                  : realloc(recording->entries, larger * sizeof *moved);
        if (moved == NULL)
            return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                                   "%s: no memory for an index of %zu frames", recording->path,
                                   larger);
        recording->entries = moved;
        recording->capacity = larger;
    }
    recording->entries[recording->count++] = *entry;
    return FOVEA_OK;
}

/* Whether two channels differ in their last parts only: that of the first is FRAME, the other's is
 * `last`, which it is known to end in. */
static bool of_one_prefix(const char *frame, const char *other, const char *last)
{
    const size_t length = strlen(frame) - strlen("FRAME");
    return length == strlen(other) - strlen(last) && memcmp(frame, other, length) == 0;
}

static bool is_sample(const char *channel)
{
    for (int kind = 0; kind < FOVEA_SAMPLE_KIND_COUNT; kind++)
        if (fv_lcmlog_channel_is(channel, fovea_sample_channel(kind))) return true;
    return false;
}

static bool is_own_sample(const struct recording *recording, const char *channel)
{
    for (int kind = 0; kind < FOVEA_SAMPLE_KIND_COUNT; kind++)
        if (fv_lcmlog_channel_is(channel, fovea_sample_channel(kind)) &&
            of_one_prefix(recording->channel, channel, fovea_sample_channel(kind)))
            return true;
    return false;
}

/* The head of a recording of ours: first of all in it, or somewhere in a log that heard others too.
 */
static enum fovea_status read_head(struct recording *recording, const struct heads *heads,
                                   const struct fovea_source_selection *selection,
                                   struct fovea_error *error)
{
    struct fv_lcmlog_event event;
    uint32_t i = 0;
    while (i < heads->count && !of_one_prefix(recording->channel, heads->channel[i], "RECORDING"))
        ++i;
    if (i == heads->count || fv_lcmlog_seek(recording->log, heads->offset[i], NULL) != FOVEA_OK ||
        fv_lcmlog_next(recording->log, &event, NULL) != FOVEA_OK)
        return FOVEA_OK;
    const enum fovea_status status = fv_log_rig(recording->path, &event, &recording->rig, error);
    const bool needed = !selection->camera_given || status == FOVEA_ERROR_UNSUPPORTED;
    return status < 0 && needed ? status : FOVEA_OK;
}

static void note_head(struct heads *heads, const struct fv_lcmlog_event *event)
{
    for (uint32_t i = 0; i < heads->count; i++)
        if (strcmp(heads->channel[i], event->channel) == 0) return;
    if (heads->count == HEADS_MAX) return;
    memcpy(heads->channel[heads->count], event->channel, sizeof event->channel);
    heads->offset[heads->count++] = event->offset;
}

static enum fovea_status add_frame(struct recording *recording, const struct fv_lcmlog_event *event,
                                   struct fovea_error *error)
{
    struct entry entry = {.offset = event->offset};
    if (recording->channel[0] == '\0')
        memcpy(recording->channel, event->channel, sizeof recording->channel);
    if (strcmp(event->channel, recording->channel) != 0) return FOVEA_OK;
    entry.stamped = fv_lcmlog_frame_stamp(recording->log, event, &entry.stamp_ns) == FOVEA_OK;
    return add_entry(recording, &entry, error);
}

/* Find the frames, and the places that cannot be read: one for all that lies between two events
 * that can. */
static enum fovea_status make_index(struct recording *recording, struct heads *heads,
                                    struct fovea_error *error)
{
    struct fv_lcmlog_event event;
    struct fovea_error first = {.text = ""};
    struct entry damage = {.offset = 0};
    bool in_damage = false;
    enum fovea_status status;
    while ((status = fv_lcmlog_skim(recording->log, &event, first.text[0] ? NULL : &first)) !=
           FOVEA_END) {
        if (status != FOVEA_OK) {
            damage.offset = event.offset;
            status = in_damage ? FOVEA_OK : add_entry(recording, &damage, error);
            in_damage = true;
            if (status == FOVEA_OK) status = fv_lcmlog_resync(recording->log);
            if (status == FOVEA_END) break;
        } else {
            in_damage = false;
            if (fv_lcmlog_channel_is(event.channel, "RECORDING")) note_head(heads, &event);
            recording->sampled = recording->sampled || is_sample(event.channel);
            if (fv_lcmlog_channel_is(event.channel, "FRAME"))
                status = add_frame(recording, &event, error);
        }
        if (status != FOVEA_OK) return status;
    }
    if (recording->channel[0] != '\0') return FOVEA_OK;
    if (recording->count > 0) return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s", first.text);
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%s: found no frames, expected fovea.frame_t on a channel ...FRAME",
                           recording->path);
}

static int compare_entries(const void *a, const void *b)
{
    const struct entry *p = a, *q = b;
    return p->offset < q->offset ? -1 : p->offset > q->offset;
}

/* The samples beside the frames, whose channel is known by now. Damage is passed over as in the
 * index, which has counted it; a sample that cannot be read becomes an entry, in its place. */
static enum fovea_status read_samples(struct recording *recording, struct fovea_error *error)
{
    struct fv_lcmlog_event event;
    struct fovea_sample sample;
    enum fovea_status status = fv_lcmlog_seek(recording->log, 0, error);
    if (!recording->sampled || status != FOVEA_OK) return status;
    while ((status = fv_lcmlog_skim(recording->log, &event, NULL)) != FOVEA_END) {
        if (status != FOVEA_OK) {
            if (fv_lcmlog_resync(recording->log) == FOVEA_END) break;
            continue;
        }
        if (!is_own_sample(recording, event.channel)) continue;
        status = fv_lcmlog_seek(recording->log, event.offset, error);
        if (status == FOVEA_OK) status = fv_lcmlog_next(recording->log, &event, error);
        if (status != FOVEA_OK) return status;
        const struct entry damage = {.offset = event.offset, .sample = true};
        status = fv_lcmlog_sample(recording->path, &event, &sample, NULL) == FOVEA_OK
                     ? fv_samples_add(&recording->samples, &sample, recording->path, error)
                     : add_entry(recording, &damage, error);
        if (status != FOVEA_OK) return status;
    }
    qsort(recording->entries, recording->count, sizeof recording->entries[0], compare_entries);
    fv_samples_sort(&recording->samples);
    return FOVEA_OK;
}

/* ---- frames ---------------------------------------------------------------------------------- */

static enum fovea_status read_frame(struct recording *recording, uint64_t index,
                                    struct fovea_frame *frame, struct fovea_error *error)
{
    struct fv_lcmlog_event event;
    struct fovea_sample sample;
    enum fovea_status status =
        fv_lcmlog_seek(recording->log, recording->entries[index].offset, error);
    if (status == FOVEA_OK) status = fv_lcmlog_next(recording->log, &event, error);
    if (status == FOVEA_OK && recording->entries[index].sample) {
        status = fv_lcmlog_sample(recording->path, &event, &sample, error);
        if (status != FOVEA_OK) return status;
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found other bytes than before, expected a file at rest",
                               recording->path);
    }
    if (status == FOVEA_OK) status = fv_lcmlog_frame(recording->path, &event, frame, error);
    return status;
}

/* One image into its buffer; an absent one stays absent. */
static enum fovea_status fill(const struct fovea_image *from, struct fv_slot *slot, uint32_t camera,
                              const char *path, uint64_t index, struct fovea_error *error)
{
    struct fovea_image *to = &slot->frame.images[camera];
    if (from->data == NULL) {
        to->data = NULL;
        return FOVEA_OK;
    }
    if (from->format == FOVEA_PIXEL_MJPEG && to->format == FOVEA_PIXEL_GREY8) {
        const struct fv_decode_image target = {.pixels = slot->pixels[camera],
                                               .width = to->width,
                                               .height = to->height,
                                               .stride_bytes = to->stride_bytes};
        struct fovea_error reason = {.text = ""};
        const enum fovea_status status = fv_decode(from->data, from->size_bytes, &target, &reason);
        if (status == FOVEA_OK) return FOVEA_OK;
        return fovea_error_set(error, status, "%s: frame %llu: %.256s", path,
                               (unsigned long long)index, reason.text);
    }
    if (from->format != to->format || from->width != to->width || from->height != to->height)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: frame %llu: found %d x %d %s, expected %d x %d %s", path,
                               (unsigned long long)index, from->width, from->height,
                               fovea_pixel_format_name(from->format), to->width, to->height,
                               fovea_pixel_format_name(to->format));
    const size_t bytes = fovea_image_bytes(from->format, from->height, from->stride_bytes);
    if (bytes > slot->capacity_bytes[camera])
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: frame %llu: found a stride of %d bytes, expected that of the first", path,
            (unsigned long long)index, from->stride_bytes);
    memcpy(slot->pixels[camera], from->data, bytes);
    to->stride_bytes = from->stride_bytes;
    to->size_bytes = bytes;
    return FOVEA_OK;
}

static enum fovea_status fetch(void *argument, uint64_t index, struct fv_slot *slot,
                               struct fovea_error *error)
{
    struct recording *recording = argument;
    struct fovea_frame frame;
    enum fovea_status status = read_frame(recording, index, &frame, error);
    if (status == FOVEA_OK && frame.image_count != slot->frame.image_count)
        status = fovea_error_set(
            error, FOVEA_ERROR_INPUT, "%s: frame %llu: image_count: found %u, expected %u",
            recording->path, (unsigned long long)index, frame.image_count, slot->frame.image_count);
    for (uint32_t i = 0; status == FOVEA_OK && i < frame.image_count; i++)
        status = fill(&frame.images[i], slot, i, recording->path, index, error);
    if (status != FOVEA_OK) return status == FOVEA_END ? FOVEA_ERROR_INPUT : status;
    slot->frame.stamp_ns = frame.stamp_ns;
    memcpy(slot->frame.offset_ns, frame.offset_ns, sizeof frame.offset_ns);
    memcpy(slot->frame.exposure_ns, frame.exposure_ns, sizeof frame.exposure_ns);
    slot->frame.clock = frame.clock;
    slot->frame.stamp_meaning = frame.stamp_meaning;
    slot->frame.sequence = frame.sequence;
    return FOVEA_OK;
}

static enum fovea_status stamp(void *argument, uint64_t index, int64_t *stamp_ns)
{
    const struct entry *entry = &((struct recording *)argument)->entries[index];
    if (!entry->stamped) return FOVEA_ERROR_INPUT;
    *stamp_ns = entry->stamp_ns;
    return FOVEA_OK;
}

static void visit_file(const void *recording, void (*visit)(void *context, const char *path),
                       void *context)
{
    visit(context, ((const struct recording *)recording)->path);
}

static const struct fovea_sample *samples(const void *argument, size_t *count)
{
    const struct recording *recording = argument;
    *count = recording->samples.count;
    return recording->samples.list;
}

static const struct fv_recording_ops lcmlog_ops = {.fetch = fetch,
                                                   .stamp = stamp,
                                                   .samples = samples,
                                                   .close = close_recording,
                                                   .reads = visit_file};

/* ---- opening --------------------------------------------------------------------------------- */

/* What is stated of a camera's image: size and bytes, with its stride. */
static enum fovea_status describe_image(const struct fovea_image *image,
                                        struct fovea_source_camera *camera, size_t *image_bytes,
                                        struct fovea_error *error)
{
    camera->width = image->width;
    camera->height = image->height;
    camera->stride_bytes = image->stride_bytes;
    *image_bytes = image->format == FOVEA_PIXEL_MJPEG ? 0 : image->size_bytes;
    if (image->format != FOVEA_PIXEL_MJPEG) return FOVEA_OK;
    return fv_decode_probe(image->data, image->size_bytes, &camera->width, &camera->height, error);
}

/* Format and sizes from a frame, as far as no frame before it stated them. */
static enum fovea_status describe_frame(struct recording *recording, uint64_t index,
                                        struct fovea_source_info *info, size_t *image_bytes,
                                        struct fovea_error *error)
{
    struct fovea_frame frame;
    const bool first = info->rig.camera_count == 0;
    enum fovea_status status = read_frame(recording, index, &frame, error);
    if (status != FOVEA_OK) return status;
    bool any = false;
    for (uint32_t i = 0; i < frame.image_count && status == FOVEA_OK; i++) {
        const struct fovea_image *image = &frame.images[i];
        if (image->data == NULL || info->cameras[i].width != 0) continue;
        status = describe_image(image, &info->cameras[i], &image_bytes[i], error);
        if (first && !any)
            info->format = image->format == FOVEA_PIXEL_MJPEG ? FOVEA_PIXEL_GREY8 : image->format;
        if (first) info->heap_bytes += image->size_bytes;
        any = true;
    }
    if (status == FOVEA_OK && first && !any)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "all its images are absent");
    if (status == FOVEA_OK && first) info->rig.camera_count = frame.image_count;
    return status;
}

/* The sizes of cameras whose image is absent in the first frame, from the frames after it, or from
 * the rig that the log describes, or as the first camera's. */
static void describe_absent(struct recording *recording, uint64_t next,
                            struct fovea_source_info *info, size_t *image_bytes)
{
    enum { LOOKED_AT = 64 };
    const struct fovea_rig *rig = &recording->rig;
    for (uint64_t i = next; i < next + LOOKED_AT && i < recording->count; i++) {
        bool all = true;
        for (uint32_t k = 0; k < info->rig.camera_count; k++)
            all = all && info->cameras[k].width != 0;
        if (all) return;
        (void)describe_frame(recording, i, info, image_bytes, NULL);
    }
    uint32_t stated = 0;
    while (info->cameras[stated].width == 0)
        stated++;
    for (uint32_t k = 0; k < info->rig.camera_count; k++) {
        struct fovea_source_camera *camera = &info->cameras[k];
        const bool known = k < rig->camera_count && rig->cameras[k].camera.width != 0;
        if (camera->width != 0) continue;
        camera->width = known ? rig->cameras[k].camera.width : info->cameras[stated].width;
        camera->height = known ? rig->cameras[k].camera.height : info->cameras[stated].height;
    }
}

static enum fovea_status describe(struct recording *recording,
                                  const struct fovea_source_selection *selection,
                                  struct fovea_source_info *info, size_t *image_bytes,
                                  struct fovea_error *error)
{
    struct fovea_error why = {.text = ""};
    enum fovea_status status = FOVEA_ERROR_INPUT;
    uint64_t next = 0;
    for (; next < recording->count && status != FOVEA_OK; next++) {
        *info = (struct fovea_source_info){.rate_hz = 0.0};
        status = describe_frame(recording, next, info, image_bytes, next == 0 ? &why : NULL);
    }
    if (status != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found no frame that can be read among %zu; the first: %.256s",
                               recording->path, recording->count, why.text);
    describe_absent(recording, next, info, image_bytes);
    if (recording->rig.camera_count > 0) info->rig = recording->rig;
    for (uint32_t i = 0; i < recording->rig.camera_count; i++)
        snprintf(info->cameras[i].origin, sizeof info->cameras[i].origin, "%.230s: camera %u",
                 recording->path, i);
    info->rate_hz =
        fv_player_rate(&lcmlog_ops, recording, recording->count) / (double)selection->step;
    info->heap_bytes += sizeof *recording + recording->capacity * sizeof recording->entries[0] +
                        recording->samples.capacity * sizeof recording->samples.list[0];
    return FOVEA_OK;
}

static enum fovea_status open_lcmlog(const char *address,
                                     const struct fovea_source_selection *selection,
                                     struct fovea_source **source, struct fovea_error *error)
{
    struct fovea_source_info info;
    struct heads heads = {.count = 0};
    size_t image_bytes[FOVEA_CAMERAS_MAX] = {0};
    struct recording *recording = calloc(1, sizeof *recording);
    if (recording == NULL || (recording->path = strdup(address)) == NULL) {
        free(recording);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", address);
    }
    enum fovea_status status = fv_lcmlog_open(address, &recording->log, error);
    if (status == FOVEA_OK) status = make_index(recording, &heads, error);
    if (status == FOVEA_OK) status = read_head(recording, &heads, selection, error);
    if (status == FOVEA_OK) status = read_samples(recording, error);
    if (status == FOVEA_OK) status = describe(recording, selection, &info, image_bytes, error);
    if (status != FOVEA_OK) {
        close_recording(recording);
        return fv_kind_hint("lcmlog", address, status, error);
    }
    return fv_player_open(&lcmlog_ops, recording, recording->count, image_bytes, address, selection,
                          &info, source, error);
}

const struct fovea_source_ops fv_source_lcmlog = FV_PLAYER_OPS(
    "lcmlog", "FILE  frames and sensor samples in an LCM log (fovea.frame_t)", open_lcmlog);
