#include "listing.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "support/decode.h"
#include "support/calibration.h"
#include "lines.h"
#include "player.h"

#define NO_PARTNER UINT32_MAX

struct listed {
    int64_t stamp_ns;
    size_t name; /* offset into `names` */
};

struct fv_listing {
    char *folder;
    struct listed *frames;
    size_t count, capacity;
    char *names;
    size_t names_bytes, names_capacity;
    struct fv_poses poses;
    struct fv_samples samples;
    uint32_t other_count;
    struct fv_listing
        *others[FOVEA_CAMERAS_MAX - 1]; /* the frames of the cameras after the first */
    uint32_t *partner; /* of such a one: its frame for each of the first's; NO_PARTNER: none */
    struct fv_file_buffer file;
    size_t reads_count;
    char reads[FV_LISTING_READS_MAX][FV_PATH_BYTES];
};

/* ---- paths ----------------------------------------------------------------------------------- */

enum fovea_status fv_path_join(char path[FV_PATH_BYTES], const char *folder, const char *name,
                               struct fovea_error *error)
{
    const char *slash = folder[0] == '\0' || folder[strlen(folder) - 1] == '/' ? "" : "/";
    if (snprintf(path, FV_PATH_BYTES, "%s%s%s", folder, slash, name) < FV_PATH_BYTES)
        return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%.64s...: found a path of more than %d bytes, expected less", folder,
                           FV_PATH_BYTES - 1);
}

bool fv_path_exists(const char *path)
{
    return access(path, F_OK) == 0;
}

enum fovea_status fv_info_set_calibration(struct fovea_source_info *info, const char *path,
                                          const struct fovea_source_selection *selection,
                                          double T_body_cam[12], bool *has_T_body_cam,
                                          struct fovea_error *error)
{
    struct fv_calibration calibration;
    if (!fv_path_exists(path)) return FOVEA_OK;
    const enum fovea_status status = fv_calibration_read(path, NULL, &calibration, error);
    if (status != FOVEA_OK) return selection->camera_given ? FOVEA_OK : status;
    info->rig.cameras[0].camera = calibration.camera;
    info->rig.cameras[0].calibrated = true;
    info->rig.cameras[0].has_T_body_cam = calibration.has_T_body_cam;
    memcpy(info->rig.cameras[0].T_body_cam, calibration.T_body_cam, sizeof calibration.T_body_cam);
    info->rate_hz = calibration.rate_hz;
    snprintf(info->cameras[0].origin, sizeof info->cameras[0].origin, "%s", path);
    if (T_body_cam != NULL) {
        memcpy(T_body_cam, calibration.T_body_cam, sizeof calibration.T_body_cam);
        *has_T_body_cam = calibration.has_T_body_cam;
    }
    return FOVEA_OK;
}

/* ---- the list -------------------------------------------------------------------------------- */

struct fv_listing *fv_listing_new(const char *folder)
{
    struct fv_listing *listing = calloc(1, sizeof *listing);
    if (listing != NULL && (listing->folder = strdup(folder)) == NULL) {
        free(listing);
        listing = NULL;
    }
    return listing;
}

static void free_one(struct fv_listing *listing)
{
    free(listing->folder);
    free(listing->frames);
    free(listing->names);
    fv_poses_free(&listing->poses);
    fv_samples_free(&listing->samples);
    free(listing->partner);
    fv_file_free(&listing->file);
    free(listing);
}

void fv_listing_free(struct fv_listing *listing)
{
    if (listing == NULL) return;
    for (uint32_t i = 0; i < listing->other_count; i++)
        free_one(listing->others[i]);
    free_one(listing);
}

static bool grow(void **memory, size_t needed, size_t *capacity, size_t size)
{
    if (needed <= *capacity) return true;
    size_t larger = *capacity < 1024 ? 1024 : *capacity;
    while (larger < needed)
        larger *= 2;
    void *moved = realloc(*memory, larger * size);
    if (moved == NULL) return false;
    *memory = moved;
    *capacity = larger;
    return true;
}

enum fovea_status fv_listing_add(struct fv_listing *listing, int64_t stamp_ns, const char *name,
                                 struct fovea_error *error)
{
    const size_t bytes = strlen(name) + 1;
    void *frames = listing->frames, *names = listing->names;
    if (listing->count >= FV_LISTING_FRAMES_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found more than %d frames, expected at most that",
                               listing->folder, (int)FV_LISTING_FRAMES_MAX);
    const bool fits =
        grow(&frames, listing->count + 1, &listing->capacity, sizeof listing->frames[0]);
    listing->frames = frames;
    const bool name_fits = grow(&names, listing->names_bytes + bytes, &listing->names_capacity, 1);
    listing->names = names;
    if (!fits || !name_fits)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "%s: out of memory for the list of frames", listing->folder);
    memcpy(listing->names + listing->names_bytes, name, bytes);
    listing->frames[listing->count++] =
        (struct listed){.stamp_ns = stamp_ns, .name = listing->names_bytes};
    listing->names_bytes += bytes;
    return FOVEA_OK;
}

enum fovea_status fv_listing_read(struct fv_listing *listing, const char *path,
                                  const char *separators,
                                  bool (*stamp_of)(const char *text, int64_t *stamp_ns),
                                  const char *expected, struct fovea_error *error)
{
    struct fv_lines lines;
    enum fovea_status status = fv_lines_open(&lines, path, error);
    if (status != FOVEA_OK) return status;
    while ((status = fv_lines_next(&lines, separators, error)) == FOVEA_OK) {
        int64_t stamp_ns;
        if (!stamp_of(lines.fields[0], &stamp_ns))
            status = fv_lines_refuse(&lines, "timestamp", lines.fields[0], expected, error);
        else if (lines.field_count < 2)
            status = fv_lines_refuse(&lines, "filename", NULL, "the file of the frame", error);
        else
            status = fv_listing_add(listing, stamp_ns, lines.fields[1], error);
        if (status != FOVEA_OK) break;
    }
    fv_lines_close(&lines);
    return status == FOVEA_END ? FOVEA_OK : status;
}

size_t fv_listing_count(const struct fv_listing *listing)
{
    return listing->count;
}

void fv_listing_reads(struct fv_listing *listing, const char *path)
{
    if (listing->reads_count < FV_LISTING_READS_MAX)
        snprintf(listing->reads[listing->reads_count++], FV_PATH_BYTES, "%s", path);
}

void fv_listing_set_poses(struct fv_listing *listing, const struct fv_poses *poses)
{
    listing->poses = *poses;
}

void fv_listing_set_samples(struct fv_listing *listing, const struct fv_samples *samples)
{
    listing->samples = *samples;
}

struct place {
    int64_t stamp_ns;
    uint32_t index; /* of a frame */
};

static int compare_places(const void *a, const void *b)
{
    const struct place *p = a, *q = b;
    if (p->stamp_ns != q->stamp_ns) return p->stamp_ns < q->stamp_ns ? -1 : 1;
    return p->index < q->index ? -1 : p->index > q->index;
}

/* The frames of a list by their stamps, whatever the order in which they are listed; NULL: out of
 * memory. The caller frees it. */
static struct place *sort_by_stamp(const struct fv_listing *listing)
{
    struct place *places = malloc((listing->count + 1) * sizeof *places);
    for (size_t i = 0; places != NULL && i < listing->count; i++)
        places[i] = (struct place){.stamp_ns = listing->frames[i].stamp_ns, .index = (uint32_t)i};
    if (places != NULL) qsort(places, listing->count, sizeof *places, compare_places);
    return places;
}

/* The first frame that has the stamp. */
static uint32_t find_stamp(const struct place *places, size_t count, int64_t stamp_ns)
{
    size_t low = 0, high = count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (places[middle].stamp_ns < stamp_ns)
            low = middle + 1;
        else
            high = middle;
    }
    return low < count && places[low].stamp_ns == stamp_ns ? places[low].index : NO_PARTNER;
}

enum fovea_status fv_listing_pair(struct fv_listing *listing, struct fv_listing *other,
                                  struct fovea_error *error)
{
    size_t pairs = 0;
    struct place *places = sort_by_stamp(other);
    listing->others[listing->other_count++] = other;
    other->partner = malloc((listing->count + 1) * sizeof other->partner[0]);
    if (places == NULL || other->partner == NULL) {
        free(places);
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory for another camera",
                               other->folder);
    }
    for (size_t i = 0; i < listing->count; i++) {
        other->partner[i] = find_stamp(places, other->count, listing->frames[i].stamp_ns);
        pairs += other->partner[i] != NO_PARTNER;
    }
    free(places);
    if (pairs > 0 || listing->count == 0) return FOVEA_OK;
    return fovea_error_set(
        error, FOVEA_ERROR_INPUT,
        "%s: found none of the first camera's %zu stamps among %zu, expected equal stamps",
        other->folder, listing->count, other->count);
}

/* ---- for the player -------------------------------------------------------------------------- */

static enum fovea_status frame_path(const struct fv_listing *listing, uint64_t index,
                                    char path[FV_PATH_BYTES], struct fovea_error *error)
{
    return fv_path_join(path, listing->folder, listing->names + listing->frames[index].name, error);
}

/* One camera's image of a frame. */
static enum fovea_status fetch_image(struct fv_listing *listing, uint64_t index,
                                     const struct fovea_image *image, uint8_t *pixels,
                                     struct fovea_error *error)
{
    const struct fv_decode_image target = {.pixels = pixels,
                                           .width = image->width,
                                           .height = image->height,
                                           .stride_bytes = image->stride_bytes,
                                           .colour = image->format == FOVEA_PIXEL_RGB24};
    char path[FV_PATH_BYTES];
    struct fovea_error reason = {.text = ""};
    enum fovea_status status = frame_path(listing, index, path, error);
    if (status != FOVEA_OK) return status;
    status = fv_file_read(&listing->file, path, &reason);
    if (status == FOVEA_OK)
        status = fv_decode(listing->file.data, listing->file.bytes, &target, &reason);
    return status == FOVEA_OK ? FOVEA_OK
                              : fovea_error_set(error, status, "%s: %.256s", path, reason.text);
}

/* The image of a camera after the first; when there is none it is absent, and `error` names a file
 * that was listed. */
static void fetch_other(struct fv_listing *other, uint32_t camera, uint64_t index,
                        struct fv_slot *slot, struct fovea_error *error)
{
    struct fovea_image *image = &slot->frame.images[camera];
    const uint32_t partner = other->partner[index];
    if (partner == NO_PARTNER ||
        fetch_image(other, partner, image, slot->pixels[camera], error) != FOVEA_OK)
        image->data = NULL;
}

static enum fovea_status fetch(void *recording, uint64_t index, struct fv_slot *slot,
                               struct fovea_error *error)
{
    struct fv_listing *listing = recording;
    const enum fovea_status status =
        fetch_image(listing, index, &slot->frame.images[0], slot->pixels[0], error);
    if (status != FOVEA_OK) return status;
    for (uint32_t i = 0; i < listing->other_count; i++)
        fetch_other(listing->others[i], i + 1, index, slot, error);
    slot->frame.stamp_ns = listing->frames[index].stamp_ns;
    slot->frame.exposure_ns[0] = 0;
    slot->frame.clock = FOVEA_CLOCK_RECORDED;
    slot->frame.stamp_meaning = FOVEA_STAMP_UNKNOWN;
    slot->frame.sequence = index;
    return FOVEA_OK;
}

static enum fovea_status stamp(void *recording, uint64_t index, int64_t *stamp_ns)
{
    *stamp_ns = ((struct fv_listing *)recording)->frames[index].stamp_ns;
    return FOVEA_OK;
}

static enum fovea_status truth(const void *recording, const struct fovea_frame *frame,
                               struct fovea_truth *truth)
{
    const struct fv_listing *listing = recording;
    truth->has_pose =
        fv_poses_at(&listing->poses, frame->stamp_ns, frame->sequence, truth->T_world_cam);
    truth->box_count = 0;
    truth->depth_m = NULL;
    truth->class_mask = NULL;
    return FOVEA_OK;
}

static void visit_one(const struct fv_listing *listing,
                      void (*visit)(void *context, const char *path), void *context)
{
    char path[FV_PATH_BYTES];
    for (size_t i = 0; i < listing->reads_count; i++)
        visit(context, listing->reads[i]);
    for (size_t i = 0; i < listing->count; i++)
        if (frame_path(listing, i, path, NULL) == FOVEA_OK) visit(context, path);
}

static void visit_all(const void *recording, void (*visit)(void *context, const char *path),
                      void *context)
{
    const struct fv_listing *listing = recording;
    visit_one(listing, visit, context);
    for (uint32_t i = 0; i < listing->other_count; i++)
        visit_one(listing->others[i], visit, context);
}

static void close_listing(void *recording)
{
    fv_listing_free(recording);
}

static const struct fovea_sample *samples(const void *recording, size_t *count)
{
    const struct fv_listing *listing = recording;
    *count = listing->samples.count;
    return listing->samples.list;
}

static const struct fv_recording_ops listing_ops = {.samples = samples,
                                                    .fetch = fetch,
                                                    .stamp = stamp,
                                                    .truth = truth,
                                                    .close = close_listing,
                                                    .reads = visit_all};

/* ---- opening --------------------------------------------------------------------------------- */

enum { PROBES = 5 };

struct probe {
    int32_t width, height;
    bool colour;
};

static enum fovea_status probe_frame(struct fv_listing *listing, uint64_t index,
                                     struct probe *probe, struct fovea_error *error)
{
    char path[FV_PATH_BYTES];
    struct fovea_error reason = {.text = ""};
    enum fovea_status status = frame_path(listing, index, path, error);
    if (status != FOVEA_OK) return status;
    status = fv_file_read(&listing->file, path, &reason);
    if (status == FOVEA_OK)
        status = fv_decode_probe(listing->file.data, listing->file.bytes, &probe->width,
                                 &probe->height, &reason);
    if (status != FOVEA_OK) return fovea_error_set(error, status, "%s: %.256s", path, reason.text);
    probe->colour = fv_decode_has_colour(listing->file.data, listing->file.bytes);
    return FOVEA_OK;
}

/* The size that most probed frames of a camera have, the earlier one when equally many. All frames
 * are asked when none of the five can be read. */
static enum fovea_status find_size(struct fv_listing *listing, const char *list_file,
                                   struct probe *size, struct fovea_error *error)
{
    struct probe probes[PROBES] = {{0}};
    struct fovea_error why = {.text = ""};
    int found = 0, best = 0, best_votes = 0;
    for (uint64_t i = 0; i < PROBES && i < listing->count; i++)
        found += probe_frame(listing, i * listing->count / PROBES, &probes[found],
                             found == 0 ? &why : NULL) == FOVEA_OK;
    for (uint64_t i = 0; found == 0 && i < listing->count; i++)
        found += probe_frame(listing, i, &probes[0], i == 0 ? &why : NULL) == FOVEA_OK;
    if (found == 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found no frame that can be read among %zu; the first is %.300s",
                               list_file, listing->count, why.text);
    for (int i = 0; i < found; i++) {
        int votes = 0;
        for (int j = 0; j < found; j++)
            votes += probes[i].width == probes[j].width && probes[i].height == probes[j].height;
        if (votes > best_votes) {
            best = i;
            best_votes = votes;
        }
    }
    *size = probes[best];
    return FOVEA_OK;
}

/* The size of each camera's images; the first camera's colour is that of all. */
static enum fovea_status find_sizes(struct fv_listing *listing, const char *list_file, bool colour,
                                    struct fovea_source_info *info, struct fovea_error *error)
{
    struct probe size;
    enum fovea_status status = FOVEA_OK;
    for (uint32_t i = 0; i <= listing->other_count && status == FOVEA_OK; i++) {
        struct fv_listing *camera = i == 0 ? listing : listing->others[i - 1];
        status = find_size(camera, i == 0 ? list_file : camera->folder, &size, error);
        if (status != FOVEA_OK) return status;
        info->cameras[i].width = size.width;
        info->cameras[i].height = size.height;
        if (i == 0) info->format = colour && size.colour ? FOVEA_PIXEL_RGB24 : FOVEA_PIXEL_GREY8;
    }
    return FOVEA_OK;
}

/* Cameras whose calibration states no size have that of the images. Another size is held against
 * the images by who takes the calibration, which may scale it. */
static enum fovea_status fit_cameras(struct fovea_source_info *info,
                                     const struct fovea_source_selection *selection,
                                     struct fovea_error *error)
{
    for (uint32_t i = 0; i < FOVEA_CAMERAS_MAX; i++) {
        struct fovea_rig_camera *camera = &info->rig.cameras[i];
        const struct fovea_source_camera *seen = &info->cameras[i];
        if (!camera->calibrated || camera->camera.width != 0) continue;
        const enum fovea_status status = fv_calibration_fit(
            &camera->camera, seen->width, seen->height, false, seen->origin, error);
        camera->calibrated = status == FOVEA_OK;
        if (status != FOVEA_OK && !selection->camera_given) return status; /* its own is needed */
    }
    return FOVEA_OK;
}

enum fovea_status fv_listing_open(struct fv_listing *listing, const char *list_file,
                                  const struct fovea_source_selection *selection,
                                  struct fovea_source_info *info, struct fovea_source **source,
                                  struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    if (listing->count == 0)
        status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                 "%s: found no frames, expected at least one", list_file);
    if (status == FOVEA_OK) status = find_sizes(listing, list_file, selection->colour, info, error);
    if (status == FOVEA_OK) status = fit_cameras(info, selection, error);
    if (status != FOVEA_OK) {
        fv_listing_free(listing);
        return status;
    }
    if (info->rate_hz <= 0.0) info->rate_hz = fv_player_rate(&listing_ops, listing, listing->count);
    if (selection->step > 1) info->rate_hz /= (double)selection->step;
    info->has_truth = listing->poses.count > 0;
    info->heap_bytes = sizeof *listing + listing->capacity * sizeof listing->frames[0] +
                       listing->names_capacity + listing->poses.heap_bytes +
                       listing->file.capacity +
                       listing->samples.capacity * sizeof listing->samples.list[0];
    for (uint32_t i = 0; i < listing->other_count; i++)
        info->heap_bytes += sizeof *listing + listing->count * sizeof listing->partner[0] +
                            listing->others[i]->capacity * sizeof listing->frames[0] +
                            listing->others[i]->names_capacity;
    return fv_player_open(&listing_ops, listing, listing->count, NULL, list_file, selection, info,
                          source, error);
}
