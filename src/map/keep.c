/* What the pools keep: covisibility, redundancy, room for landmarks, and several maps side by side.
 */
#include <string.h>

#include "map/map.h"

enum { RATE_AGAIN_MAX = 8 }; /* candidates rated anew before one goes: ratings may be stale */

/* ---- covisibility ---------------------------------------------------------------------------- */

void fv_map_count_shared(const struct fv_map *map, uint32_t slot, uint16_t *shared)
{
    struct fv_map_frame frame = fv_map_frame_at(map, slot);
    memset(shared, 0, map->limits.keyframes * sizeof *shared);
    for (uint32_t f = 0; f < frame.keyframe->features; f++) {
        if (frame.landmark[f] == FV_MAP_NONE) continue;
        const struct fv_landmark *l = &map->landmarks[frame.landmark[f]];
        for (uint32_t k = 0; k < l->observer_count; k++)
            shared[l->observers[k].keyframe]++;
    }
}

uint32_t fv_map_neighbours(const struct fv_map *map, uint32_t slot, uint32_t shared_min,
                           struct fv_neighbour *neighbours, uint32_t max)
{
    uint16_t shared[FV_MAP_KEYFRAMES_MAX];
    uint32_t count = 0;
    fv_map_count_shared(map, slot, shared);
    if (slot < map->limits.keyframes) shared[slot] = 0;
    for (; count < max; count++) {
        const uint32_t best = fv_map_best_shared_newest(map, shared);
        if (shared[best] == 0 || shared[best] < shared_min) break;
        neighbours[count] =
            (struct fv_neighbour){best, map->keyframes[best].generation, shared[best]};
        shared[best] = 0;
    }
    return count;
}

/* ---- keyframes ------------------------------------------------------------------------------- */

void fv_map_rate_keyframe(struct fv_map *map, uint32_t slot)
{
    struct fv_map_frame frame = fv_map_frame_at(map, slot);
    uint32_t known = 0, enough = 0;
    for (uint32_t f = 0; f < frame.keyframe->features; f++) {
        if (frame.landmark[f] == FV_MAP_NONE) continue;
        known++;
        enough += map->landmarks[frame.landmark[f]].observer_count > FV_MAP_ENOUGH_OBSERVERS;
    }
    frame.keyframe->redundancy = (uint16_t)(known > 0 ? enough * 1000 / known : 1000);
}

/* Highest rated keyframe that may go; held ones only when `held`. Of equals the older. */
static int32_t highest_rated(const struct fv_map *map, bool held)
{
    int32_t best = FV_MAP_NONE;
    for (uint32_t i = 0; i < map->limits.keyframes; i++) {
        const struct fv_keyframe *k = &map->keyframes[i];
        bool newest = k->number + FV_MAP_KEEP_NEWEST >= map->state->keyframe_number &&
                      map->state->keyframe_count > FV_MAP_KEEP_NEWEST;
        if (!k->used || newest || (k->held && !held)) continue;
        if (best == FV_MAP_NONE || k->redundancy > map->keyframes[best].redundancy ||
            (k->redundancy == map->keyframes[best].redundancy &&
             k->number < map->keyframes[best].number))
            best = (int32_t)i;
    }
    return best;
}

static uint32_t oldest_of(const struct fv_map *map)
{
    int32_t oldest = FV_MAP_NONE;
    for (uint32_t i = 0; i < map->limits.keyframes; i++)
        if (map->keyframes[i].used &&
            (oldest == FV_MAP_NONE || map->keyframes[i].number < map->keyframes[oldest].number))
            oldest = (int32_t)i;
    return (uint32_t)oldest;
}

uint32_t fv_map_most_redundant(struct fv_map *map)
{
    if (map->state->keyframe_count <= FV_MAP_KEEP_NEWEST)
        return oldest_of(map); /* small pools: as they come */
    int32_t best = highest_rated(map, false);
    if (best == FV_MAP_NONE) best = highest_rated(map, true);
    if (best == FV_MAP_NONE) return oldest_of(map);
    for (int attempt = 0; attempt < RATE_AGAIN_MAX; attempt++) {
        uint16_t before = map->keyframes[best].redundancy;
        fv_map_rate_keyframe(map, (uint32_t)best);
        if (map->keyframes[best].redundancy >= before) break;
        int32_t next = highest_rated(map, map->keyframes[best].held);
        if (next == best) break;
        best = next;
    }
    return (uint32_t)best;
}

/* ---- landmarks ------------------------------------------------------------------------------- */

/* One clock sweep: landmarks not seen lately are removed, when they have at most `observers_max`
 * observers. */
static void sweep(struct fv_map *map, uint32_t wanted, uint32_t observers_max,
                  uint64_t frame_number)
{
    struct fv_map_state *s = map->state;
    for (uint32_t n = 0; n < map->limits.landmarks && s->free_count < wanted; n++) {
        uint32_t slot = s->sweep;
        s->sweep = slot + 1 < map->limits.landmarks ? slot + 1 : 0;
        const struct fv_landmark *l = &map->landmarks[slot];
        if (l->used && l->observer_count <= observers_max &&
            (uint32_t)frame_number - l->seen > FV_MAP_UNSEEN_FRAMES)
            fv_map_remove_landmark(map, slot);
    }
}

void fv_map_make_room(struct fv_map *map, uint32_t wanted, uint64_t frame_number)
{
    static const uint32_t observers_max[] = {2, 3, FV_MAP_OBSERVERS_MAX};
    for (int round = 0; round < 3 && map->state->free_count < wanted; round++)
        sweep(map, wanted, observers_max[round], frame_number);
    while (map->state->free_count < wanted && map->state->keyframe_count > 2)
        fv_map_remove_keyframe(map, fv_map_most_redundant(map));
}

/* ---- edges and maps -------------------------------------------------------------------------- */

void fv_map_add_edge(struct fv_map *map, uint32_t a, uint32_t b)
{
    struct fv_map_edge *edge = &map->edges[map->state->edge_count++ % FV_MAP_EDGES_MAX];
    *edge = (struct fv_map_edge){a, b, map->keyframes[a].generation, map->keyframes[b].generation};
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        map->keyframes[k].held = false;
    for (uint32_t i = 0; i < FV_MAP_EDGES_MAX && i < map->state->edge_count; i++) {
        const struct fv_map_edge *e = &map->edges[i];
        if (!fv_map_holds(map, e->a, e->generation_a) || !fv_map_holds(map, e->b, e->generation_b))
            continue;
        map->keyframes[e->a].held = map->keyframes[e->b].held = true;
    }
}

static void leave(const struct fv_map *map)
{
    struct fv_map_state *s = map->state;
    struct fv_map_odom current;
    (void)fv_map_odom_of(map, s->map_id, &current);
    for (uint32_t i = 0; i < FV_MAP_WORLDS_MAX; i++) /* at most one entry per map */
        if (s->left[i].map_id == s->map_id) s->left[i].odom_id = s->left[i].map_id = UINT32_MAX;
    s->left[s->left_count++ % FV_MAP_WORLDS_MAX] = current;
}

/* An `odom` frame of its own, of which nothing is known. */
static void begin_odom(struct fv_map_state *s, uint32_t odom_id)
{
    s->odom_id = odom_id;
    fv_sim3_identity(&s->S_map_world);
    memset(&s->scale, 0, sizeof s->scale);
    memset(&s->gravity, 0, sizeof s->gravity);
}

void fv_map_begin_another(struct fv_map *map)
{
    leave(map);
    map->state->map_id = map->state->map_next++;
    begin_odom(map->state, map->state->map_id);
}

void fv_map_continue_in_another(struct fv_map *map, const struct fv_sim3 *S_map_world,
                                double turn_variance)
{
    const struct fv_map_gravity gravity = map->state->gravity;
    fv_map_begin_another(map);
    map->state->S_map_world = *S_map_world;
    if (!(gravity.sigma > 0)) return;
    map->state->gravity = gravity;
    map->state->gravity.sigma = __builtin_sqrt(gravity.sigma * gravity.sigma + turn_variance);
}

void fv_map_enter(struct fv_map *map, uint32_t map_id)
{
    struct fv_map_state *s = map->state;
    if (s->map_id == map_id) return;
    struct fv_map_odom entered; /* leaving may write over it */
    const bool known = fv_map_odom_of(map, map_id, &entered);
    leave(map);
    s->map_id = map_id;
    if (!known) {
        begin_odom(s, s->map_next++);
        return;
    }
    s->odom_id = entered.odom_id;
    s->S_map_world = entered.S_map_world;
    s->scale = entered.scale;
    s->gravity = entered.gravity;
}

void fv_map_drop(struct fv_map *map, uint32_t map_id)
{
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        if (map->keyframes[k].used && map->keyframes[k].map_id == map_id)
            fv_map_remove_keyframe(map, k);
}

uint32_t fv_map_count_keyframes(const struct fv_map *map, uint32_t map_id)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        count += map->keyframes[k].used && map->keyframes[k].map_id == map_id;
    return count;
}
