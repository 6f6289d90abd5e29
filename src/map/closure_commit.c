/* Closures: the essential graph, and what its solution does to the map. */
#include <string.h>

#include "geometry/vec.h"
#include "map/closure.h"

enum {
    GRAPH_PER_UNIT = 8,
    GRAPH_NEIGHBOURS = FV_CLOSURE_HELD_BY_KEYFRAME - 1,
    GRAPH_SHARED_MIN = 40
};

/* Relative precision of an edge: translation in median depths, rotation, log scale. Drift turns
 * less than it shifts, and stretches more. */
static const double weight_turn = 4, weight_scale = 0.25;
static const double weight_closure = 4;

static void edge_weight(const struct fv_keyframe *a, double factor, double weight[3])
{
    weight[0] = factor / (a->depth > 0 ? a->depth * a->depth : 1);
    weight[1] = factor * weight_turn;
    weight[2] = factor * weight_scale;
}

/* ---- the essential graph --------------------------------------------------------------------- */

void fv_closure_graph_begin(struct fv_closure *closure, const struct fv_map *map)
{
    struct fv_closure_state *s = closure->state;
    const uint32_t map_id = map->keyframes[s->keyframe.slot].map_id;
    struct fv_map_gravity gravity;
    uint64_t oldest = UINT64_MAX;
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        if (map->keyframes[k].used && map->keyframes[k].map_id == map_id &&
            map->keyframes[k].number < oldest)
            oldest = map->keyframes[k].number;
    fv_pose_graph_begin(&closure->graph);
    closure->graph.state->rigid = fv_map_metric_of(map, map_id);
    closure->graph.state->upright = fv_map_upright(map, map_id, &gravity);
    if (closure->graph.state->upright) fv_copy3(gravity.down, closure->graph.state->down);
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        const struct fv_keyframe *keyframe = &map->keyframes[k];
        closure->node_of[k] = -1;
        if (!keyframe->used || keyframe->map_id != map_id) continue;
        struct fv_sim3 *start = &closure->corrections[k]; /* until the commit */
        fv_sim3_from_se3(&keyframe->T_cam_world, 1, start);
        int32_t node = fv_pose_graph_add_node(&closure->graph, start, keyframe->number == oldest);
        closure->nodes[node] = (struct fv_map_handle){k, keyframe->generation};
        closure->node_of[k] = (int16_t)node;
    }
    s->next = 0;
}

static bool in_graph(const struct fv_closure *closure, const struct fv_map *map, int32_t slot)
{
    return slot >= 0 && (uint32_t)slot < map->limits.keyframes && closure->node_of[slot] >= 0 &&
           fv_closure_holds(map, closure->nodes[closure->node_of[slot]]);
}

/* An edge that holds two keyframes as they were to each other. */
static void hold(struct fv_closure *closure, const struct fv_map *map, uint32_t a, uint32_t b,
                 double factor)
{
    struct fv_sim3 S;
    double weight[3];
    const uint32_t i = (uint32_t)closure->node_of[a], j = (uint32_t)closure->node_of[b];
    fv_pose_graph_between(&closure->graph, i, j, &S);
    edge_weight(&map->keyframes[a], factor, weight);
    (void)fv_pose_graph_add_edge(&closure->graph, i, j, &S, weight);
}

static void hold_keyframe(struct fv_closure *closure, const struct fv_map *map, uint32_t slot)
{
    const struct fv_keyframe *k = &map->keyframes[slot];
    struct fv_neighbour near[GRAPH_NEIGHBOURS];
    if (in_graph(closure, map, k->parent)) hold(closure, map, slot, (uint32_t)k->parent, 1);
    uint32_t count = fv_map_neighbours(map, slot, GRAPH_SHARED_MIN, near, GRAPH_NEIGHBOURS);
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_keyframe *other = &map->keyframes[near[i].slot];
        if ((int32_t)near[i].slot == k->parent || (int32_t)slot == other->parent ||
            other->number > k->number || !in_graph(closure, map, (int32_t)near[i].slot))
            continue;
        hold(closure, map, slot, near[i].slot, near[i].shared < 200 ? near[i].shared / 100.0 : 2);
    }
}

static void hold_closures(struct fv_closure *closure, const struct fv_map *map)
{
    for (uint32_t e = 0; e < FV_MAP_EDGES_MAX && e < map->state->edge_count; e++) {
        const struct fv_map_edge *edge = &map->edges[e];
        if (fv_map_holds(map, edge->a, edge->generation_a) &&
            fv_map_holds(map, edge->b, edge->generation_b) &&
            in_graph(closure, map, (int32_t)edge->a) && in_graph(closure, map, (int32_t)edge->b))
            hold(closure, map, edge->a, edge->b, 2);
    }
}

bool fv_closure_graph_unit(struct fv_closure *closure, const struct fv_map *map)
{
    struct fv_closure_state *s = closure->state;
    const uint32_t nodes = closure->graph.state->node_count;
    if (s->next == 0) { /* first, for want of room */
        double weight[3];
        const uint32_t candidate = s->candidates[s->candidate].slot;
        edge_weight(&map->keyframes[s->keyframe.slot], weight_closure, weight);
        (void)fv_pose_graph_add_edge(&closure->graph, (uint32_t)closure->node_of[s->keyframe.slot],
                                     (uint32_t)closure->node_of[candidate],
                                     &s->S_keyframe_candidate, weight);
        hold_closures(closure, map);
    }
    for (uint32_t done = 0; done < GRAPH_PER_UNIT && s->next < nodes; done++, s->next++)
        if (fv_closure_holds(map, closure->nodes[s->next]))
            hold_keyframe(closure, map, closure->nodes[s->next].slot);
    return s->next >= nodes;
}

/* ---- the commit ------------------------------------------------------------------------------ */

/* Corrections of the keyframes that were in the graph. */
static void correct_nodes(struct fv_closure *closure, const struct fv_map *map)
{
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        closure->corrected[k] = in_graph(closure, map, (int32_t)k);
        if (!closure->corrected[k]) continue;
        struct fv_sim3 inverse;
        fv_sim3_invert(&closure->graph.nodes[closure->node_of[k]].S, &inverse);
        fv_sim3_compose(&inverse, &closure->corrections[k], &closure->corrections[k]);
    }
}

/* Keyframes made since, and the frame in work, get the correction of the nearest ancestor that has
 * one. Parents are older than their children, so each step up comes nearer to the graph. */
static void correct_born_since(struct fv_closure *closure, const struct fv_map *map,
                               uint32_t map_id)
{
    for (uint32_t k = 0; k <= map->limits.keyframes; k++) {
        const struct fv_keyframe *keyframe = &map->keyframes[k];
        const bool current = k == fv_map_current(map);
        if (current) closure->corrected[k] = false;
        if (current ? map->state->map_id != map_id
                    : closure->corrected[k] || !keyframe->used || keyframe->map_id != map_id)
            continue;
        int32_t at = keyframe->parent;
        for (uint32_t n = 0;
             n < map->limits.keyframes && at != FV_MAP_NONE && !in_graph(closure, map, at); n++)
            at = map->keyframes[at].parent;
        if (at == FV_MAP_NONE || !in_graph(closure, map, at)) continue;
        closure->corrections[k] = closure->corrections[at];
        closure->corrected[k] = true;
    }
}

/* One correction for all of a map, the current frame where it is in it; `also`: the corrections
 * that there are hold too. */
static void correct_map(struct fv_closure *closure, const struct fv_map *map, uint32_t map_id,
                        const struct fv_sim3 *S, bool also)
{
    for (uint32_t k = 0; k <= map->limits.keyframes; k++) {
        const struct fv_keyframe *keyframe = &map->keyframes[k];
        const bool within = k == fv_map_current(map) ? map->state->map_id == map_id
                                                     : keyframe->used && keyframe->map_id == map_id;
        closure->corrected[k] = within || (also && closure->corrected[k]);
        if (within) closure->corrections[k] = *S;
    }
}

/* The two ends of the closure have one unit of length now, and what hangs between them no more
 * doubt of it than the surer end. */
static void share_unit(const struct fv_closure *closure, struct fv_map *map, uint32_t a, uint32_t b)
{
    const float at_a = map->keyframes[a].unit_variance, at_b = map->keyframes[b].unit_variance;
    const float least = at_a < at_b ? at_a : at_b;
    for (uint32_t k = 0; k < map->limits.keyframes; k++)
        if (closure->corrected[k] && map->keyframes[k].unit_variance > least)
            map->keyframes[k].unit_variance = least;
}

static void apply_corrections(const struct fv_closure *closure, struct fv_map *map)
{
    for (uint32_t i = 0; i < map->state->landmark_top; i++) {
        struct fv_landmark *l = &map->landmarks[i];
        if (!l->used || l->observer_count == 0) continue;
        const uint32_t k = l->observers[0].keyframe;
        if (!closure->corrected[k]) continue;
        double direction[3];
        const double before[3] = {l->direction[0] / (double)FV_MAP_DIRECTION_ONE,
                                  l->direction[1] / (double)FV_MAP_DIRECTION_ONE,
                                  l->direction[2] / (double)FV_MAP_DIRECTION_ONE};
        fv_sim3_apply(&closure->corrections[k], l->point, l->point);
        fv_rotate3(closure->corrections[k].R, before, direction);
        for (int c = 0; c < 3; c++)
            l->direction[c] = fv_map_direction(direction[c]);
        l->distance *= (float)closure->corrections[k].s;
    }
    for (uint32_t k = 0; k <= map->limits.keyframes; k++) {
        if (!closure->corrected[k]) continue;
        fv_sim3_move_pose(&closure->corrections[k], &map->keyframes[k].T_cam_world);
        map->keyframes[k].depth *= closure->corrections[k].s;
    }
}

/* The map `from` becomes part of `to`, hanging on keyframe `on`. */
static void join_maps(struct fv_map *map, uint32_t from, uint32_t to, uint32_t on)
{
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        struct fv_keyframe *keyframe = &map->keyframes[k];
        if (!keyframe->used || keyframe->map_id != from) continue;
        keyframe->map_id = to;
        if (keyframe->parent == FV_MAP_NONE) keyframe->parent = (int32_t)on;
    }
    if (map->state->map_id == from) map->state->map_id = to;
    for (uint32_t i = 0; i < FV_MAP_WORLDS_MAX; i++)
        if (map->state->left[i].map_id == from) map->state->left[i].map_id = UINT32_MAX;
}

/* The group's landmarks go into the keyframe and its neighbours. */
static void list_fusing(struct fv_closure_state *s, const struct fv_map *map)
{
    struct fv_neighbour near[FV_CLOSURE_FUSED_INTO - 1];
    uint32_t count = fv_map_neighbours(map, s->keyframe.slot, 1, near, FV_CLOSURE_FUSED_INTO - 1);
    s->fuse_into[0] = s->keyframe;
    for (uint32_t i = 0; i < count; i++)
        s->fuse_into[i + 1] = (struct fv_map_handle){near[i].slot, near[i].generation};
    s->fuse_count = count + 1;
    s->fuse_at = 0;
}

/* Where a map that was left is entered again, its `odom` has the unit that it had. */
static void stretch_left(struct fv_map_state *s, uint32_t map_id, const struct fv_sim3 *stretch)
{
    for (uint32_t i = 0; i < FV_MAP_WORLDS_MAX; i++)
        if (s->left[i].map_id == map_id)
            fv_sim3_compose(stretch, &s->left[i].S_map_world, &s->left[i].S_map_world);
}

/* Corrections by which the younger of two maps goes to the world of the older one. Where only the
 * own map is in metres it stays so: the other's lengths change. */
static void bring_together(struct fv_closure *closure, struct fv_map *map, uint32_t own,
                           uint32_t others, struct fv_closure_outcome *outcome)
{
    const struct fv_closure_state *s = closure->state;
    struct fv_sim3 S = s->correction, stretch;
    const bool is_younger = own > others;
    const bool stretched =
        is_younger && fv_map_metric_of(map, own) && !fv_map_metric_of(map, others);
    if (!is_younger) fv_sim3_invert(&S, &S);
    fv_sim3_identity(&stretch);
    if (stretched) {
        stretch.s = 1 / S.s;
        fv_sim3_compose(&stretch, &S, &S);
        S.s = 1;
    }
    correct_map(closure, map, is_younger ? own : others, &S, false);
    share_unit(closure, map, s->keyframe.slot, s->candidates[s->candidate].slot);
    if (stretched) {
        correct_map(closure, map, others, &stretch, true);
        stretch_left(map->state, others, &stretch);
    }
    outcome->stretched_map = others;
    outcome->stretch = stretch.s;
}

/* Gravity in the map that two become, in the axes of the older one: as that has it, else as the
 * younger. False: neither knows. */
static bool find_gravity(const struct fv_map *map, const struct fv_closure_state *s, uint32_t own,
                         uint32_t others, struct fv_map_gravity *gravity)
{
    const double *R = s->correction.R; /* from the axes of `own` to those of `others` */
    struct fv_map_gravity known;
    if (fv_map_gravity_of(map, own > others ? others : own, gravity)) return true;
    if (!fv_map_gravity_of(map, own > others ? own : others, &known)) return false;
    if (own > others)
        fv_rotate3(R, known.down, gravity->down);
    else
        fv_rotate_back3(R, known.down, gravity->down);
    gravity->sigma = known.sigma;
    return true;
}

/* `odom` frames of that map that know nothing of it. */
static void share_gravity(struct fv_map_state *s, uint32_t map_id,
                          const struct fv_map_gravity *gravity)
{
    if (s->map_id == map_id && !(s->gravity.sigma > 0)) {
        fv_rotate_back3(s->S_map_world.R, gravity->down, s->gravity.down);
        s->gravity.sigma = gravity->sigma;
    }
    for (uint32_t i = 0; i < FV_MAP_WORLDS_MAX && i < s->left_count; i++) {
        struct fv_map_odom *left = &s->left[i];
        if (left->map_id != map_id || left->gravity.sigma > 0) continue;
        fv_rotate_back3(left->S_map_world.R, gravity->down, left->gravity.down);
        left->gravity.sigma = gravity->sigma;
    }
}

void fv_closure_commit(struct fv_closure *closure, struct fv_map *map,
                       struct fv_closure_outcome *outcome)
{
    struct fv_closure_state *s = closure->state;
    const uint32_t keyframe = s->keyframe.slot, candidate = s->candidates[s->candidate].slot;
    const uint32_t own = map->keyframes[keyframe].map_id, others = map->keyframes[candidate].map_id;
    struct fv_map_gravity gravity;
    const bool upright = own != others && find_gravity(map, s, own, others, &gravity);
    outcome->stretch = 1;
    list_fusing(s, map);
    if (own == others) {
        correct_nodes(closure, map);
        correct_born_since(closure, map, own);
        s->counts.closed++;
        share_unit(closure, map, keyframe, candidate);
    } else {
        bring_together(closure, map, own, others, outcome);
        s->counts.merged++;
    }
    apply_corrections(closure, map);
    if (own != others)
        join_maps(map, own > others ? own : others, own > others ? others : own,
                  own > others ? candidate : keyframe);
    fv_map_add_edge(map, keyframe, candidate);
    const uint32_t current = fv_map_current(map);
    outcome->committed = true;
    fv_sim3_identity(&outcome->S_new_current);
    if (closure->corrected[current]) {
        outcome->S_new_current = closure->corrections[current];
        fv_sim3_compose(&outcome->S_new_current, &map->state->S_map_world,
                        &map->state->S_map_world);
    }
    if (upright) share_gravity(map->state, own > others ? others : own, &gravity);
}
