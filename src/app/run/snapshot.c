#include "drivers/table.h"
#include "app/run/snapshot.h"
#include "support/image_pack.h"

#include <malloc.h>
#include <stdlib.h>
#include <string.h>

enum {
    FRAMES_APART = 7,  /* between copies; odd, as detections often come every second frame */
    OBJECT_SCORE = 500 /* an object counts as this number of landmarks */
};

size_t fv_snapshot_bytes(size_t frame_bytes)
{
    return 2 * (frame_bytes + sizeof(struct fv_snapshot_frame));
}

bool fv_snapshot_open(struct fv_snapshot *snapshot, size_t frame_bytes, bool detecting)
{
    *snapshot = (struct fv_snapshot){.detecting = detecting, .frame_bytes = frame_bytes};
    if (frame_bytes > 0) snapshot->memory = malloc(2 * frame_bytes);
    snapshot->frames = calloc(2, sizeof *snapshot->frames);
    if (snapshot->frames != NULL && (snapshot->memory != NULL || frame_bytes == 0)) return true;
    fv_snapshot_close(snapshot);
    return false;
}

void fv_snapshot_close(struct fv_snapshot *snapshot)
{
    free(snapshot->memory);
    free(snapshot->frames);
    *snapshot = (struct fv_snapshot){0};
}

static struct fv_snapshot_frame *other(struct fv_snapshot *snapshot)
{
    return &snapshot->frames[1 - snapshot->best];
}

/* The other frame is whole: keep it when it is the better one. */
static void judge(struct fv_snapshot *snapshot)
{
    struct fv_snapshot_frame *made = other(snapshot), *kept = &snapshot->frames[snapshot->best];
    made->whole = true;
    snapshot->pending = false;
    if (!kept->whole || made->score >= kept->score) snapshot->best = 1 - snapshot->best;
}

static void pixels_copy(struct fv_snapshot *snapshot, struct fv_snapshot_frame *shot,
                        const struct fovea_frame *frame)
{
    uint8_t *pixels = snapshot->memory + (shot == snapshot->frames ? 0 : snapshot->frame_bytes);
    shot->image = fv_image_pack(&frame->images[0], pixels);
}

void fv_snapshot_step(struct fv_snapshot *snapshot, const struct fovea *rt,
                      const struct fovea_frame *frame, const struct fovea_pose *pose)
{
    const uint64_t step = snapshot->steps++;
    if (snapshot->frames == NULL ||
        (snapshot->memory != NULL &&
         fv_image_packed_bytes(&frame->images[0]) > snapshot->frame_bytes) ||
        (snapshot->copied > 0 && step - snapshot->copied < FRAMES_APART))
        return;
    struct fv_snapshot_frame *shot = other(snapshot);
    shot->image = frame->images[0];
    shot->image.data = NULL;
    if (snapshot->memory != NULL) pixels_copy(snapshot, shot, frame);
    shot->stamp_ns = frame->stamp_ns;
    shot->sequence = frame->sequence;
    shot->index = frame->index;
    shot->score = pose->posed ? pose->inliers : 0;
    shot->box_count = 0;
    shot->whole = false;
    const struct fovea_feature *features = fovea_features_get(rt, &shot->feature_count);
    if (shot->feature_count > FOVEA_FEATURES_MAX) shot->feature_count = FOVEA_FEATURES_MAX;
    memcpy(shot->features, features, shot->feature_count * sizeof *features);
    snapshot->copied = step;
    snapshot->pending = snapshot->detecting;
    if (!snapshot->detecting) judge(snapshot);
}

static void boxes_of_objects(struct fv_snapshot_frame *shot, const struct fovea_objects *objects)
{
    for (uint32_t i = 0; i < objects->count && shot->box_count < FV_SNAPSHOT_BOXES_MAX; i++) {
        const struct fovea_object *t = &objects->list[i];
        if (t->state != FOVEA_OBJECT_CONFIRMED && t->state != FOVEA_OBJECT_COASTING) continue;
        const bool coasting = t->state == FOVEA_OBJECT_COASTING;
        shot->boxes[shot->box_count++] =
            (struct fv_snapshot_box){t->x_min_px, t->y_min_px, t->x_max_px,     t->y_max_px,
                                     t->score,    t->class_id, (uint32_t)t->id, coasting};
        shot->score += coasting ? 0 : OBJECT_SCORE;
    }
}

static void boxes_of_detections(struct fv_snapshot_frame *shot,
                                const struct fovea_detections *detections)
{
    for (uint32_t i = 0; i < detections->count && shot->box_count < FV_SNAPSHOT_BOXES_MAX; i++) {
        const struct fovea_detection *d = &detections->list[i];
        shot->boxes[shot->box_count++] = (struct fv_snapshot_box){
            d->x_min_px, d->y_min_px, d->x_max_px, d->y_max_px, d->score, d->class_id, 0, false};
        shot->score += OBJECT_SCORE;
    }
}

void fv_snapshot_work(struct fv_snapshot *snapshot, const struct fovea_detections *detections,
                      const struct fovea_objects *objects)
{
    if (!snapshot->pending || detections->inferences == 0) return;
    struct fv_snapshot_frame *shot = other(snapshot);
    if (detections->stamp_ns > shot->stamp_ns) { /* this image was passed over: take the next */
        snapshot->pending = false;
        snapshot->copied = 0;
    }
    if (detections->stamp_ns != shot->stamp_ns) return;
    if (objects->updates > 0 && objects->stamp_ns == shot->stamp_ns)
        boxes_of_objects(shot, objects);
    else
        boxes_of_detections(shot, detections);
    judge(snapshot);
}

const struct fv_snapshot_frame *fv_snapshot_best(const struct fv_snapshot *snapshot)
{
    return snapshot->frames != NULL && snapshot->frames[snapshot->best].whole
               ? &snapshot->frames[snapshot->best]
               : NULL;
}

/* ---- reading a frame again ------------------------------------------------------------------- */

/* The first frame of an open source, into memory of the snapshot. */
static bool frame_take(struct fv_snapshot *snapshot, const struct fovea_source_ops *ops,
                       struct fovea_source *source)
{
    struct fv_snapshot_frame *shot = &snapshot->frames[snapshot->best];
    struct fovea_error error;
    struct fovea_frame frame;
    enum fovea_status status = ops->start(source, &error);
    if (status != FOVEA_OK) return false;
    do
        status = ops->dequeue(source, INT64_MAX, &frame);
    while (status == FOVEA_AGAIN);
    if (status == FOVEA_OK) {
        const struct fovea_image *image = &frame.images[0];
        if (frame.index == shot->index && image->size_bytes == shot->image.size_bytes)
            snapshot->memory = malloc(image->size_bytes);
        if (snapshot->memory != NULL) {
            memcpy(snapshot->memory, image->data, image->size_bytes);
            shot->image = *image;
            shot->image.data = snapshot->memory;
        }
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    return shot->image.data != NULL;
}

bool fv_snapshot_fetch(struct fv_snapshot *snapshot, const char *uri, bool colour)
{
    const struct fv_snapshot_frame *best = fv_snapshot_best(snapshot);
    if (best == NULL || best->image.data != NULL) return best != NULL;
    const struct fovea_source_selection selection = {
        .start = best->index, .step = 1, .frames = 1, .colour = colour, .camera_given = true};
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_source *source;
    struct fovea_error error;
    bool taken = false;
    if (fv_source_find(uri, &ops, &address, &error) == FOVEA_OK &&
        ops->open(address, &selection, &source, &error) == FOVEA_OK) {
        taken = frame_take(snapshot, ops, source);
        ops->close(source);
    }
    malloc_trim(0); /* what the source had goes back to the system before the picture is drawn */
    if (!taken) fv_snapshot_close(snapshot);
    return taken;
}
