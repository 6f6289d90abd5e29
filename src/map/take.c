/* A map that was read beside the loop, taken in place of the one that is there. */
#include "map/map.h"

#include <string.h>

/* ---- settling -------------------------------------------------------------------------------- */

/* How many maps with keyframes, or the current one, have lower ids. */
static uint32_t rank_of_map(const struct fv_map *map, uint32_t map_id)
{
    uint32_t rank = 0, last = 0;
    for (;; rank++) { /* once for each id, from the lowest on */
        uint32_t next = map_id;
        if (map->state->map_id < next && (rank == 0 || map->state->map_id > last))
            next = map->state->map_id;
        for (uint32_t k = 0; k < map->limits.keyframes; k++)
            if (map->keyframes[k].used && map->keyframes[k].map_id < next &&
                (rank == 0 || map->keyframes[k].map_id > last))
                next = map->keyframes[k].map_id;
        if (next == map_id) return rank;
        last = next;
    }
}

/* Maps that were left and have keyframes, by their new ids. */
static void settle_left(struct fv_map *map)
{
    struct fv_map_state *s = map->state;
    const uint32_t count = s->left_count < FV_MAP_WORLDS_MAX ? s->left_count : FV_MAP_WORLDS_MAX;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (fv_map_count_keyframes(map, s->left[i].map_id) == 0) continue;
        s->left[kept] = s->left[i];
        s->left[kept].map_id = s->left[kept].odom_id = rank_of_map(map, s->left[i].map_id);
        kept++;
    }
    memset(s->left + kept, 0, (FV_MAP_WORLDS_MAX - kept) * sizeof s->left[0]);
    s->left_count = kept;
}

void fv_map_settle(struct fv_map *map)
{
    uint32_t ids[FV_MAP_KEYFRAMES_MAX], numbers[FV_MAP_KEYFRAMES_MAX] = {0}, highest = 0;
    const uint32_t current = rank_of_map(map, map->state->map_id);
    settle_left(map);
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        if (!map->keyframes[k].used) continue;
        ids[k] = rank_of_map(map, map->keyframes[k].map_id);
        for (uint32_t i = 0; i < map->limits.keyframes; i++)
            numbers[k] += map->keyframes[i].used &&
                          (map->keyframes[i].number < map->keyframes[k].number ||
                           (map->keyframes[i].number == map->keyframes[k].number && i < k));
        if (ids[k] > highest) highest = ids[k];
    }
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        if (!map->keyframes[k].used) continue;
        map->keyframes[k].map_id = ids[k];
        map->keyframes[k].number = numbers[k];
    }
    map->state->map_id = map->state->odom_id = current;
    map->state->map_next = (current > highest ? current : highest) + 1;
    map->state->keyframe_number = map->state->keyframe_count;
}

/* ---- taking ---------------------------------------------------------------------------------- */

static void take_state(struct fv_map_state *s, const struct fv_map_state *from)
{
    const uint32_t first_id = s->map_next;
    const uint64_t first_number = s->keyframe_number;
    *s = *from;
    s->map_id += first_id;
    s->odom_id += first_id;
    s->map_next += first_id;
    s->keyframe_number += first_number;
    for (uint32_t i = 0; i < FV_MAP_WORLDS_MAX && i < s->left_count; i++) {
        s->left[i].map_id += first_id;
        s->left[i].odom_id += first_id;
    }
}

static void take_keyframe(struct fv_map *map, const struct fv_map *from, uint32_t slot,
                          uint32_t first_id, uint64_t first_number)
{
    const struct fv_map_frame out = fv_map_frame_at(map, slot), in = fv_map_frame_at(from, slot);
    const uint32_t generation = out.keyframe->generation, features = in.keyframe->features;
    *out.keyframe = *in.keyframe;
    out.keyframe->generation = generation;
    out.keyframe->map_id += first_id;
    out.keyframe->number += first_number;
    memcpy(out.points, in.points, features * sizeof *out.points);
    memcpy(out.descriptors, in.descriptors, (size_t)features * FV_MAP_DESCRIPTOR_BYTES);
    memcpy(out.landmark, in.landmark, features * sizeof *out.landmark);
    memcpy(out.cells, in.cells, ((size_t)(map->columns * map->rows) + 1) * sizeof *out.cells);
    if (map->distances != NULL)
        memcpy(fv_map_distances(map, slot), fv_map_distances(from, slot),
               features * sizeof *map->distances);
}

static void take_landmark(struct fv_landmark *out, const struct fv_landmark *in,
                          uint32_t frames_later)
{
    const uint32_t generation = out->generation;
    *out = *in;
    out->generation = generation;
    out->mark = 0;
    out->born += frames_later;
    out->seen += frames_later;
}

static void take_edge(struct fv_map *map, const struct fv_map *from, uint32_t i)
{
    const struct fv_map_edge e = from->edges[i];
    if (!fv_map_holds(from, e.a, e.generation_a) || !fv_map_holds(from, e.b, e.generation_b))
        return;
    map->edges[i] = (struct fv_map_edge){e.a, e.b, map->keyframes[e.a].generation,
                                         map->keyframes[e.b].generation};
}

void fv_map_take(struct fv_map *map, const struct fv_map *from, uint32_t frames_later)
{
    const uint32_t first_id = map->state->map_next;
    const uint64_t first_number = map->state->keyframe_number;
    take_state(map->state, from->state);
    const struct fv_map_state taken = *map->state;
    fv_map_reset(map);
    *map->state = taken;
    map->state->mark = 0;
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        if (from->keyframes[k].used) take_keyframe(map, from, k, first_id, first_number);
    for (uint32_t i = 0; i < map->limits.landmarks; i++)
        if (from->landmarks[i].used)
            take_landmark(&map->landmarks[i], &from->landmarks[i], frames_later);
    memcpy(map->free_landmarks, from->free_landmarks,
           from->state->free_count * sizeof *map->free_landmarks);
    for (uint32_t i = 0; i < FV_MAP_EDGES_MAX; i++)
        take_edge(map, from, i);
}

bool fv_map_same_limits(const struct fv_map *a, const struct fv_map *b)
{
    const struct fv_map_limits *p = &a->limits, *q = &b->limits;
    return p->keyframes == q->keyframes && p->landmarks == q->landmarks &&
           p->features == q->features && p->width == q->width && p->height == q->height &&
           p->distances == q->distances;
}
