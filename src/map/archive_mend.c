/* Making a map whole that was read: its links, pools and lists. */
#include "map/archive.h"

/* Observers whose keyframes link back, each keyframe once. */
static void mend_landmark(struct fv_map *map, uint32_t slot)
{
    struct fv_landmark *l = &map->landmarks[slot];
    uint8_t kept = 0, best = 0;
    for (uint32_t i = 0; i < l->observer_count; i++) {
        const struct fv_observer o = l->observers[i];
        const struct fv_map_frame frame = fv_map_frame_at(map, o.keyframe);
        bool again = false;
        for (uint32_t j = 0; j < kept; j++)
            again = again || l->observers[j].keyframe == o.keyframe;
        if (!again && frame.keyframe->used && o.feature < frame.keyframe->features &&
            frame.landmark[o.feature] == (int32_t)slot) {
            if (i == l->best) best = kept;
            l->observers[kept++] = o;
        }
    }
    l->observer_count = kept;
    l->best = best;
}

/* Links whose landmarks know of them; then what follows from links. */
static void mend_keyframe(struct fv_map *map, uint32_t slot)
{
    struct fv_map_frame frame = fv_map_frame_at(map, slot);
    frame.keyframe->landmarks = 0;
    for (uint32_t f = 0; f < frame.keyframe->features; f++) {
        if (frame.landmark[f] == FV_MAP_NONE) continue;
        const struct fv_landmark *l = &map->landmarks[frame.landmark[f]];
        bool known = false;
        for (uint32_t i = 0; i < l->observer_count; i++)
            known = known || (l->observers[i].keyframe == slot && l->observers[i].feature == f);
        if (!known) frame.landmark[f] = FV_MAP_NONE;
        frame.keyframe->landmarks += known;
    }
    /* A parent is older, so that chains of parents end. */
    const int32_t parent = frame.keyframe->parent;
    if (parent < 0 || parent >= (int32_t)map->limits.keyframes || !map->keyframes[parent].used ||
        map->keyframes[parent].number >= frame.keyframe->number)
        frame.keyframe->parent = FV_MAP_NONE;
}

void fv_archive_mend(struct fv_map *map)
{
    for (uint32_t i = 0; i < map->limits.landmarks; i++)
        if (map->landmarks[i].used) mend_landmark(map, i);
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        if (map->keyframes[k].used) mend_keyframe(map, k);
    map->state->free_count = 0;
    map->state->landmark_top = map->limits.landmarks;
    for (uint32_t i = map->limits.landmarks; i-- > 0;) {
        struct fv_landmark *l = &map->landmarks[i];
        if (l->used && l->observer_count == 0) {
            l->used = false;
            map->state->landmark_count--;
        }
        if (!l->used) map->free_landmarks[map->state->free_count++] = i;
    }
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        if (map->keyframes[k].used) fv_map_rate_keyframe(map, k);
}
