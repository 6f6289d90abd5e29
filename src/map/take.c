/* A map that was read beside the loop, taken in place of the one that is there. */
#include "map/map.h"

#include <string.h>

/* ---- settling -------------------------------------------------------------------------------- */

/* The ids of the current map and of all that have keyframes, each once. */
struct ids {
    uint32_t count, id[1 + FV_MAP_KEYFRAMES_MAX];
};

static void find_ids(const struct fv_map *map, struct ids *ids)
{
    ids->count = 1;
    ids->id[0] = map->state->map_id;
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        if (!map->keyframes[k].used) continue;
        uint32_t i = 0;
        while (i < ids->count && ids->id[i] != map->keyframes[k].map_id)
            i++;
        ids->id[i] = map->keyframes[k].map_id;
        if (i == ids->count) ids->count++;
    }
}

/* How many of them are lower. */
static uint32_t rank_of(const struct ids *ids, uint32_t id)
{
    uint32_t rank = 0;
    for (uint32_t i = 0; i < ids->count; i++)
        rank += ids->id[i] < id;
    return rank;
}

uint32_t fv_map_settled_id(const struct fv_map *from, uint32_t map_id)
{
    struct ids ids;
    find_ids(from, &ids);
    for (uint32_t i = 0; i < ids.count; i++)
        if (ids.id[i] == map_id) return rank_of(&ids, map_id);
    return UINT32_MAX;
}

/* Maps that were left and have keyframes, by their new ids. */
static void settle_left(struct fv_map *map, const struct ids *ids)
{
    struct fv_map_state *s = map->state;
    const uint32_t count = s->left_count < FV_MAP_WORLDS_MAX ? s->left_count : FV_MAP_WORLDS_MAX;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (fv_map_count_keyframes(map, s->left[i].map_id) == 0) continue;
        s->left[kept] = s->left[i];
        s->left[kept].map_id = s->left[kept].odom_id = rank_of(ids, s->left[i].map_id);
        kept++;
    }
    memset(s->left + kept, 0, (FV_MAP_WORLDS_MAX - kept) * sizeof s->left[0]);
    s->left_count = kept;
}

/* Keyframes in the order of their numbers; of equal ones, which only damaged files have, in that of
 * their slots. */
static void settle_numbers(struct fv_map *map)
{
    uint64_t numbers[FV_MAP_KEYFRAMES_MAX] = {0};
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        for (uint32_t i = 0; i < map->limits.keyframes; i++)
            numbers[k] += map->keyframes[i].used &&
                          (map->keyframes[i].number < map->keyframes[k].number ||
                           (map->keyframes[i].number == map->keyframes[k].number && i < k));
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        if (map->keyframes[k].used) map->keyframes[k].number = numbers[k];
    map->state->keyframe_number = map->state->keyframe_count;
}

void fv_map_settle(struct fv_map *map)
{
    struct ids ids;
    find_ids(map, &ids);
    settle_left(map, &ids);
    settle_numbers(map);
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        if (map->keyframes[k].used)
            map->keyframes[k].map_id = rank_of(&ids, map->keyframes[k].map_id);
    map->state->map_id = map->state->odom_id = rank_of(&ids, map->state->map_id);
    map->state->map_next = ids.count;
}

/* ---- taking ---------------------------------------------------------------------------------- */

static void take_state(struct fv_map_state *s, const struct fv_map_state *from, uint32_t first_id,
                       uint64_t first_number)
{
    *s = *from;
    s->mark = 0;
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

/* Of keyframes that are there: what was read has no others. */
static void take_edge(struct fv_map *map, const struct fv_map *from, uint32_t i)
{
    const struct fv_map_edge e = from->edges[i];
    map->edges[i] = (struct fv_map_edge){e.a, e.b, map->keyframes[e.a].generation,
                                         map->keyframes[e.b].generation};
}

void fv_map_take(struct fv_map *map, const struct fv_map *from, uint32_t frames_later)
{
    const uint32_t first_id = map->state->map_next;
    const uint64_t first_number = map->state->keyframe_number;
    fv_map_reset(map);
    take_state(map->state, from->state, first_id, first_number);
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        if (from->keyframes[k].used) take_keyframe(map, from, k, first_id, first_number);
    for (uint32_t i = 0; i < map->limits.landmarks; i++)
        if (from->landmarks[i].used)
            take_landmark(&map->landmarks[i], &from->landmarks[i], frames_later);
    memcpy(map->free_landmarks, from->free_landmarks,
           from->state->free_count * sizeof *map->free_landmarks);
    for (uint32_t i = 0; i < FV_MAP_EDGES_MAX && i < from->state->edge_count; i++)
        take_edge(map, from, i);
}

bool fv_map_same_limits(const struct fv_map *a, const struct fv_map *b)
{
    const struct fv_map_limits *p = &a->limits, *q = &b->limits;
    return p->keyframes == q->keyframes && p->landmarks == q->landmarks &&
           p->features == q->features && p->width == q->width && p->height == q->height &&
           p->distances == q->distances;
}
