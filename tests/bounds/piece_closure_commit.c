/* Of closures: the essential graph, and the correction of the map. */
#include "map/closure_commit.c"

#include <stdlib.h>

#include "bounds/counter.h"
#include "bounds/full_map.h"
#include "bounds/limits.h"
#include "bounds/pieces.h"

LIMIT(GRAPH_PER_UNIT, CLOSURE_GRAPH_KEYFRAMES);

struct committing {
    struct fovea *rt;
    struct fv_closure *closure;
    struct fv_map *map;
    uint32_t slot;
    struct fv_closure_outcome outcome;
};

static void begin(void *context)
{
    struct committing *c = context;
    fv_closure_graph_begin(c->closure, c->map);
}

static void hold_edges(void *context)
{
    struct committing *c = context;
    hold_closures(c->closure, c->map);
}

static void hold_one(void *context)
{
    struct committing *c = context;
    hold_keyframe(c->closure, c->map, c->slot);
}

static void start(void *context)
{
    struct committing *c = context;
    MUST(fv_pose_graph_start(&c->closure->graph));
}

static void unit(void *context)
{
    struct committing *c = context;
    (void)fv_pose_graph_unit(&c->closure->graph);
}

static void commit(void *context)
{
    struct committing *c = context;
    fv_closure_commit(c->closure, c->map, &c->outcome);
}

/* All keyframes in a row, each the parent of the next; edges of closures all over. */
static void make_graph(struct committing *c)
{
    const uint32_t keyframes = c->map->limits.keyframes;
    struct fv_closure_state *s = c->closure->state;
    full_map_fill(&c->rt->odometry, FV_MAP_OBSERVERS_MAX);
    c->map->state->gravity = (struct fv_map_gravity){{0, 1, 0}, 0.01}; /* tilts are held */
    for (uint32_t i = 0; i < FV_MAP_EDGES_MAX; i++)
        fv_map_add_edge(c->map, i % keyframes, (i + keyframes / 2) % keyframes);
    s->keyframe =
        (struct fv_map_handle){keyframes - 1, c->map->keyframes[keyframes - 1].generation};
    s->candidates[0] = (struct fv_map_handle){0, c->map->keyframes[0].generation};
    s->candidate = 0;
    fv_sim3_identity(&s->S_keyframe_candidate);
    s->S_keyframe_candidate.s = 1.1;
    s->S_keyframe_candidate.t[0] = 0.3;
}

static void solve(struct committing *c)
{
    const struct fv_pose_graph_state *g = c->closure->graph.state;
    do {
        const enum fv_graph_phase phase = g->phase;
        const double took = (double)counter_of(unit, c);
        piece_note(phase == FV_GRAPH_LINEARISE ? PIECE_graph_linearised
                   : phase == FV_GRAPH_FACTOR  ? PIECE_graph_factored
                   : phase == FV_GRAPH_SOLVE   ? PIECE_graph_iterated
                                               : PIECE_graph_judged,
                   took);
    } while (g->phase != FV_GRAPH_DONE && g->phase != FV_GRAPH_IDLE);
}

void pieces_of_closure_commit(struct fovea *rt)
{
    struct fv_odometry *o = &rt->odometry;
    static struct committing c;
    c.rt = rt;
    c.closure = &o->closure;
    c.map = &o->map;
    make_graph(&c);
    NOTE(graph_begun, begin, &c, 1);
    NOTE(closures_held, hold_edges, &c, 1);
    for (c.slot = c.map->limits.keyframes; c.slot-- > 0;)
        NOTE(keyframe_held, hold_one, &c, 1);
    /* The list of edges full. */
    for (uint32_t k = 0; o->closure.graph.state->edge_count < o->closure.graph.limits.edges; k++)
        hold(c.closure, c.map, k % c.map->limits.keyframes,
             (k + 1 + k / c.map->limits.keyframes) % c.map->limits.keyframes, 1);
    NOTE(graph_started, start, &c, 1);
    solve(&c);
    for (uint32_t k = 0; k < c.map->limits.keyframes; k++)
        if (k % 2 == 1) o->closure.node_of[k] = -1; /* born since: corrected by ancestors */
    NOTE(closure_committed, commit, &c, 1);
}
