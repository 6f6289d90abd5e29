/* Matching by nearest centroids: of all pairs the nearest is matched, then the nearest of what is
 * left, up to max_distance. */
#include "objects/objects.h"

static double distance2(const struct fv_object_slot *slot, const struct fovea_detection *d)
{
    /* From where it was seen last: centroid matching does not predict. */
    const double dx = 0.5 * ((double)d->x_min_px + (double)d->x_max_px) -
                      0.5 * ((double)slot->object.x_min_px + (double)slot->object.x_max_px);
    const double dy = 0.5 * ((double)d->y_min_px + (double)d->y_max_px) -
                      0.5 * ((double)slot->object.y_min_px + (double)slot->object.y_max_px);
    return dx * dx + dy * dy;
}

/* Nearest detection of the slot's class that is free, or -1. */
static int32_t nearest(const struct fv_objects *objects, const struct fv_object_slot *slot,
                       const struct fv_objects_inference *inference, double *best)
{
    int32_t found = -1;
    for (uint32_t d = 0; d < inference->count; d++) {
        if (objects->taken[d] || inference->detections[d].class_id != slot->object.class_id)
            continue;
        const double distance = distance2(slot, &inference->detections[d]);
        if (found >= 0 && distance >= *best) continue;
        *best = distance;
        found = (int32_t)d;
    }
    return found;
}

/* Set the object to the detection: centroid matching does not filter. */
static void hold(struct fv_object_slot *slot, double x0, double y0, double x1, double y1)
{
    const double held[FV_OBJECT_NUMBERS] = {0.5 * (x0 + x1), 0.5 * (y0 + y1), x1 - x0, y1 - y0};
    for (int k = 0; k < FV_OBJECT_NUMBERS; k++) {
        slot->box[k].x = held[k];
        slot->box[k].v = 0;
    }
}

static void restore(struct fv_object_slot *slot)
{
    const struct fovea_object *t = &slot->object;
    hold(slot, (double)t->x_min_px, (double)t->y_min_px, (double)t->x_max_px, (double)t->y_max_px);
}

static void move_to(struct fv_object_slot *slot, const struct fovea_detection *d)
{
    hold(slot, (double)d->x_min_px, (double)d->y_min_px, (double)d->x_max_px, (double)d->y_max_px);
}

void fv_objects_match_centroid(struct fv_objects *objects,
                               const struct fv_objects_inference *inference)
{
    const double limit = objects->config->max_distance_px * objects->config->max_distance_px;
    const uint32_t slots = objects->config->count_max;
    for (uint32_t i = 0; i < slots; i++) {
        if (objects->slots[i].used) restore(&objects->slots[i]);
        objects->column_of[i] = -2; /* nearest not known */
    }
    for (uint32_t round = 0; round < slots; round++) {
        double least = limit;
        int32_t slot = -1;
        for (uint32_t i = 0; i < slots; i++) {
            struct fv_object_slot *s = &objects->slots[i];
            if (!s->used || s->matched) continue;
            double distance = 0;
            int32_t *near = &objects->column_of[i];
            if (*near == -2 || (*near >= 0 && objects->taken[*near]))
                *near = nearest(objects, s, inference, &distance);
            if (*near < 0) continue;
            distance = distance2(s, &inference->detections[*near]);
            if (slot >= 0 ? distance >= least : distance > least) continue;
            least = distance;
            slot = (int32_t)i;
        }
        if (slot < 0) return;
        const int32_t d = objects->column_of[slot];
        fv_objects_take(objects, &objects->slots[slot], inference, (uint32_t)d);
        move_to(&objects->slots[slot], &inference->detections[d]);
    }
}
