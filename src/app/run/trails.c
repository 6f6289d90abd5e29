#include "app/run/trails.h"

/* Drop every other entry; the rest is renumbered. */
static void thin(struct fv_trails *trails)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < trails->count; i++) {
        struct fv_trail_point point = trails->points[i];
        if (point.inference % 2 != 0) continue;
        point.inference /= 2;
        trails->points[kept++] = point;
    }
    trails->count = kept;
    if (trails->stride <= UINT32_MAX / 2) trails->stride *= 2;
}

void fv_trails_observe(struct fv_trails *trails, const struct fovea_objects *objects)
{
    if (trails->stride == 0) {
        trails->stride = 1;
        trails->first_ns = objects->stamp_ns;
    }
    trails->last_ns = objects->stamp_ns;
    if (trails->count + FOVEA_OBJECTS_MAX > FV_TRAILS_MAX) thin(trails);
    const uint32_t inference = trails->inferences++;
    if (inference % trails->stride != 0) return;
    for (uint32_t i = 0; i < objects->count && trails->count < FV_TRAILS_MAX; i++) {
        const struct fovea_object *t = &objects->list[i];
        if (t->state != FOVEA_OBJECT_CONFIRMED) continue;
        trails->points[trails->count++] = (struct fv_trail_point){
            .time_s = (float)((double)(objects->stamp_ns - trails->first_ns) * 1e-9),
            .x_px = 0.5F * (t->x_min_px + t->x_max_px),
            .y_px = 0.5F * (t->y_min_px + t->y_max_px),
            .id = (uint32_t)t->id,
            .inference = inference / trails->stride,
            .class_id = t->class_id};
    }
}
