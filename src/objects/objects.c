#include "objects/objects.h"

#include <string.h>

/* Noise of a box in fractions of its size: measurements of 5 %, a velocity that is unknown to two
 * sizes per second at first and gains two sizes per second within a second (twice what DeepSORT and
 * BoT-SORT take at 30 Hz: objects that turn). */
static const double measured_fraction = 0.05, velocity_fraction = 2.0, drift_fraction = 2.0;
/* Sizes change more slowly than positions. */
static const double size_velocity_fraction = 0.3, size_drift_fraction = 0.2;

static double larger(double a, double b)
{
    return a > b ? a : b;
}

/* ---- memory ---------------------------------------------------------------------------------- */

void fv_objects_carve(struct fv_objects *objects, const struct fovea_objects_config *config,
                      const struct fovea_camera *camera, const double T_body_cam[12],
                      struct fv_arena *persistent, struct fv_arena *frame)
{
    const size_t count = config->count_max;
    objects->config = config;
    objects->camera = camera;
    objects->T_body_cam = T_body_cam;
    objects->state = fv_arena_take(persistent, 1, sizeof *objects->state);
    objects->slots = fv_arena_take(persistent, count, sizeof *objects->slots);
    objects->list = fv_arena_take(persistent, count, sizeof *objects->list);
    objects->cost = fv_arena_take(frame, count * FOVEA_DETECTIONS_MAX, sizeof *objects->cost);
    objects->rows = fv_arena_take(frame, count, sizeof *objects->rows);
    objects->columns = fv_arena_take(frame, FOVEA_DETECTIONS_MAX, sizeof *objects->columns);
    objects->column_of = fv_arena_take(frame, count, sizeof *objects->column_of);
    objects->sides = fv_arena_take(frame, FOVEA_DETECTIONS_MAX, sizeof *objects->sides);
    objects->taken = fv_arena_take(frame, FOVEA_DETECTIONS_MAX, 1);
    objects->assign = fv_arena_take(frame, 1, sizeof *objects->assign);
}

void fv_objects_reset(struct fv_objects *objects)
{
    const struct fv_objects_state before = *objects->state;
    memset(objects->slots, 0, objects->config->count_max * sizeof *objects->slots);
    *objects->state = (struct fv_objects_state){
        .next_id = before.next_id, .updates = before.updates, .confirmed = before.confirmed};
}

/* ---- prediction ------------------------------------------------------------------------------ */

static double size_of(const struct fv_object_slot *slot)
{
    return larger(0.5 * (slot->box[FV_OBJECT_W].x + slot->box[FV_OBJECT_H].x), 1.0);
}

/* Shift of a box's centre when the camera has turned: R takes bearings of the image before to this
 * one's. */
static void turn(const struct fv_objects *objects, struct fv_object_slot *slot, const double R[9])
{
    const double before[2] = {slot->box[FV_OBJECT_X].x, slot->box[FV_OBJECT_Y].x};
    double b[3], turned[3], now[2];
    if (fovea_camera_unproject(objects->camera, before, b, NULL) != FOVEA_OK) return;
    for (int i = 0; i < 3; i++)
        turned[i] = R[3 * i] * b[0] + R[3 * i + 1] * b[1] + R[3 * i + 2] * b[2];
    if (fovea_camera_project(objects->camera, turned, now, NULL) != FOVEA_OK) return;
    slot->box[FV_OBJECT_X].x = now[0];
    slot->box[FV_OBJECT_Y].x = now[1];
}

static void predict(struct fv_object_slot *slot, double dt_s)
{
    const double size = size_of(slot), drift = drift_fraction * size,
                 size_drift = size_drift_fraction * size;
    for (int k = 0; k < FV_OBJECT_NUMBERS; k++) {
        const bool is_place = k < FV_OBJECT_W;
        /* Unseen, a size is better left as it was: a box that shrank behind an edge would go on
         * shrinking. */
        if (!is_place && slot->object.unseen > 0)
            slot->box[k].v = slot->box[k].vv = slot->box[k].xv = 0;
        fv_filter_predict(&slot->box[k], dt_s, is_place ? drift * drift : size_drift * size_drift);
    }
    slot->box[FV_OBJECT_W].x = larger(slot->box[FV_OBJECT_W].x, 1.0);
    slot->box[FV_OBJECT_H].x = larger(slot->box[FV_OBJECT_H].x, 1.0);
}

/* R_now_before, and whether it is known. */
static bool rotation_since(const struct fv_objects_state *state,
                           const struct fv_objects_inference *inference, double R[9])
{
    if (!inference->posed || !state->posed || inference->world != state->world) return false;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            double sum = 0;
            for (int k = 0; k < 3; k++)
                sum += inference->T_world_cam[4 * k + i] * state->R_world_cam[3 * k + j];
            R[3 * i + j] = sum;
        }
    }
    return true;
}

static void predict_all(struct fv_objects *objects, const struct fv_objects_inference *inference)
{
    double R[9];
    const struct fv_objects_state *state = objects->state;
    const double dt_s =
        state->started ? (double)(inference->stamp_ns - state->stamp_ns) * 1e-9 : 0.0;
    const bool turned = rotation_since(state, inference, R);
    for (uint32_t i = 0; i < objects->config->count_max; i++) {
        struct fv_object_slot *slot = &objects->slots[i];
        slot->matched = 0;
        if (!slot->used) continue;
        if (turned) turn(objects, slot, R);
        predict(slot, dt_s);
    }
}

/* ---- what a detection does ------------------------------------------------------------------- */

struct measured {
    double number[FV_OBJECT_NUMBERS], sigma[FV_OBJECT_NUMBERS];
};

static struct measured measure(const struct fovea_detection *d)
{
    const double x0 = (double)d->x_min_px, y0 = (double)d->y_min_px, x1 = (double)d->x_max_px,
                 y1 = (double)d->y_max_px;
    const double sigma = larger(measured_fraction * 0.5 * (x1 - x0 + y1 - y0), 0.5);
    return (struct measured){{0.5 * (x0 + x1), 0.5 * (y0 + y1), x1 - x0, y1 - y0},
                             {sigma, sigma, 1.4 * sigma, 1.4 * sigma}};
}

void fv_objects_take(struct fv_objects *objects, struct fv_object_slot *slot,
                     const struct fv_objects_inference *inference, uint32_t detection)
{
    const struct fovea_detection *d = &inference->detections[detection];
    const struct measured m = measure(d);
    for (int k = 0; k < FV_OBJECT_NUMBERS; k++)
        fv_filter_update(&slot->box[k], m.number[k], m.sigma[k] * m.sigma[k]);
    slot->object.score = d->score;
    slot->score_sum += (double)d->score;
    slot->object.class_id = d->class_id;
    slot->object.seen_ns = inference->stamp_ns;
    slot->object.hits++;
    slot->object.unseen = 0;
    slot->matched = 1;
    objects->taken[detection] = 1;
}

static void begin(struct fv_objects *objects, struct fv_object_slot *slot,
                  const struct fv_objects_inference *inference, uint32_t detection)
{
    const struct fovea_detection *d = &inference->detections[detection];
    const struct measured m = measure(d);
    memset(slot, 0, sizeof *slot);
    slot->used = slot->matched = 1;
    slot->score_sum = (double)d->score;
    slot->object = (struct fovea_object){.id = ++objects->state->next_id,
                                         .class_id = d->class_id,
                                         .score = d->score,
                                         .first_ns = inference->stamp_ns,
                                         .seen_ns = inference->stamp_ns,
                                         .hits = 1};
    const double size = 0.5 * (m.number[FV_OBJECT_W] + m.number[FV_OBJECT_H]);
    for (int k = 0; k < FV_OBJECT_NUMBERS; k++) {
        fv_filter_start(&slot->box[k], m.number[k], m.sigma[k],
                        (k < FV_OBJECT_W ? velocity_fraction : size_velocity_fraction) * size);
    }
    objects->taken[detection] = 1;
}

/* ---- the pool -------------------------------------------------------------------------------- */

/* Whether `a` is given up before `b`; neither was seen in this inference. */
static bool weaker(const struct fv_object_slot *a, const struct fv_object_slot *b)
{
    const bool tentative_a = a->object.state == FOVEA_OBJECT_TENTATIVE,
               tentative_b = b->object.state == FOVEA_OBJECT_TENTATIVE;
    if (tentative_a != tentative_b) return tentative_a;
    if (a->object.unseen != b->object.unseen) return a->object.unseen > b->object.unseen;
    if (a->object.hits != b->object.hits) return a->object.hits < b->object.hits;
    return a->object.id > b->object.id;
}

/* A free slot, or that of the weakest object; NULL when all were seen just now. */
static struct fv_object_slot *room(struct fv_objects *objects)
{
    struct fv_object_slot *weakest = NULL;
    for (uint32_t i = 0; i < objects->config->count_max; i++) {
        struct fv_object_slot *slot = &objects->slots[i];
        if (!slot->used) return slot;
        if (!slot->matched && (weakest == NULL || weaker(slot, weakest))) weakest = slot;
    }
    return weakest;
}

static void begin_new(struct fv_objects *objects, const struct fv_objects_inference *inference)
{
    const struct fovea_objects_config *config = objects->config;
    const double least = config->mode == FOVEA_OBJECTS_SORT ? config->score_new : 0.0;
    for (uint32_t d = 0; d < inference->count; d++) {
        if (objects->taken[d] || (double)inference->detections[d].score < least) continue;
        struct fv_object_slot *slot = room(objects);
        if (slot == NULL)
            return; /* detections come by falling score: none of the others has more right */
        begin(objects, slot, inference, d);
    }
}

/* ---- life ------------------------------------------------------------------------------------ */

static bool is_over(const struct fv_objects *objects, const struct fv_object_slot *slot,
                    int64_t stamp_ns)
{
    const struct fovea_objects_config *config = objects->config;
    if (slot->matched) return false;
    if (config->mode == FOVEA_OBJECTS_CENTROID)
        return slot->object.unseen > config->max_disappeared;
    if (slot->object.state == FOVEA_OBJECT_TENTATIVE) return true;
    const double x = slot->box[FV_OBJECT_X].x, y = slot->box[FV_OBJECT_Y].x, size = size_of(slot);
    const bool gone = x < -size || y < -size || x > objects->camera->width + size ||
                      y > objects->camera->height + size;
    return gone || (double)(stamp_ns - slot->object.seen_ns) * 1e-9 > config->coast_s;
}

/* Whether an object that was seen just now is believed to be there. A detector that
 * errs often does so again in the next image, with a score as low: repetition alone proves little.
 */
static bool is_believed(const struct fv_objects *objects, const struct fv_object_slot *slot)
{
    const struct fovea_objects_config *config = objects->config;
    if (config->mode == FOVEA_OBJECTS_CENTROID || slot->object.state != FOVEA_OBJECT_TENTATIVE)
        return true;
    return slot->object.hits >= config->confirm_hits &&
           slot->score_sum >= config->score_confirm * slot->object.hits;
}

static void age(struct fv_objects *objects, struct fv_object_slot *slot, int64_t stamp_ns)
{
    if (!slot->matched) slot->object.unseen++;
    if (is_over(objects, slot, stamp_ns)) {
        slot->used = 0;
        slot->object.state = FOVEA_OBJECT_ENDED;
    } else if (slot->matched && is_believed(objects, slot)) {
        objects->state->confirmed += slot->object.state == FOVEA_OBJECT_TENTATIVE;
        slot->object.state = FOVEA_OBJECT_CONFIRMED;
    } else if (slot->object.state == FOVEA_OBJECT_CONFIRMED) {
        slot->object.state = FOVEA_OBJECT_COASTING;
    }
}

static void describe(struct fv_object_slot *slot)
{
    const struct fv_filter *box = slot->box;
    const double w = 0.5 * box[FV_OBJECT_W].x, h = 0.5 * box[FV_OBJECT_H].x;
    slot->object.x_min_px = (float)(box[FV_OBJECT_X].x - w);
    slot->object.x_max_px = (float)(box[FV_OBJECT_X].x + w);
    slot->object.y_min_px = (float)(box[FV_OBJECT_Y].x - h);
    slot->object.y_max_px = (float)(box[FV_OBJECT_Y].x + h);
    slot->object.x_px_s = (float)box[FV_OBJECT_X].v;
    slot->object.y_px_s = (float)box[FV_OBJECT_Y].v;
}

/* Insert into the list, which is sorted by rising id. */
static void list_object(struct fv_objects *objects, const struct fovea_object *object)
{
    uint32_t at = objects->state->listed++;
    for (; at > 0 && objects->list[at - 1].id > object->id; at--)
        objects->list[at] = objects->list[at - 1];
    objects->list[at] = *object;
}

void fv_objects_update(struct fv_objects *objects, const struct fv_objects_inference *inference)
{
    struct fv_objects_state *state = objects->state;
    if (state->started && state->stamp_ns >= inference->stamp_ns) return;
    memset(objects->taken, 0, inference->count + inference->uncertain);
    predict_all(objects, inference);
    if (objects->config->mode == FOVEA_OBJECTS_SORT)
        fv_objects_match_sort(objects, inference);
    else
        fv_objects_match_centroid(objects, inference);
    begin_new(objects, inference);
    state->listed = 0;
    for (uint32_t i = 0; i < objects->config->count_max; i++) {
        struct fv_object_slot *slot = &objects->slots[i];
        if (!slot->used) continue;
        const bool was_believed = slot->object.state != FOVEA_OBJECT_TENTATIVE;
        age(objects, slot, inference->stamp_ns);
        describe(slot);
        fv_objects_locate(objects, slot, inference);
        if (slot->object.state != FOVEA_OBJECT_ENDED || was_believed)
            list_object(objects, &slot->object);
    }
    state->updates++;
    state->started = 1;
    state->stamp_ns = inference->stamp_ns;
    state->sequence = inference->sequence;
    state->posed = inference->posed;
    state->world = inference->world;
    for (int i = 0; i < 9; i++)
        state->R_world_cam[i] = inference->T_world_cam[i / 3 * 4 + i % 3];
}

/* ---- what is reported ------------------------------------------------------------------------ */

void fv_objects_get(const struct fv_objects *objects, struct fovea_objects *list)
{
    const struct fv_objects_state *state = objects->state;
    *list = (struct fovea_objects){.updates = state->updates,
                                   .confirmed = state->confirmed,
                                   .stamp_ns = state->stamp_ns,
                                   .sequence = state->sequence,
                                   .count = state->listed,
                                   .list = objects->list};
}

uint32_t fv_objects_movable(const struct fv_objects *objects, float (*boxes)[4], uint32_t capacity)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < objects->config->count_max && count < capacity; i++) {
        const struct fovea_object *t = &objects->slots[i].object;
        const int32_t c = t->class_id;
        if (!objects->slots[i].used || c < 0 || c >= FOVEA_OBJECT_CLASSES_MAX ||
            (objects->config->movable[c / 32] >> c % 32 & 1) == 0)
            continue;
        const float box[4] = {t->x_min_px, t->y_min_px, t->x_max_px, t->y_max_px};
        memcpy(boxes[count++], box, sizeof box);
    }
    return count;
}
