#include "map/pose_graph.h"

#include <string.h>

#include "geometry/normal_equations.h"
#include "geometry/vec.h"

enum { UNIT_LINEARISE = 40, UNIT_JUDGE = 150 /* edges */, UNIT_ITERATIONS = 2 };

static const struct fv_damping damping_rule = {.fall = 0.1, .floor = 1e-12, .rise = 30};
static const double converged_fraction = 1e-8; /* of the cost: a step that saves less is the last */

void fv_pose_graph_carve(struct fv_pose_graph *g, const struct fv_pose_graph_limits *limits,
                         struct fv_arena *job)
{
    g->limits = *limits;
    g->state = fv_arena_take(job, 1, sizeof *g->state);
    g->nodes = fv_arena_take(job, limits->nodes, sizeof *g->nodes);
    g->edges = fv_arena_take(job, limits->edges, sizeof *g->edges);
    g->neighbours = fv_arena_take(job, 2 * limits->edges, sizeof *g->neighbours);
    g->order = fv_arena_take(job, limits->nodes, sizeof *g->order);
}

/* ---- building -------------------------------------------------------------------------------- */

void fv_pose_graph_begin(struct fv_pose_graph *g)
{
    memset(g->state, 0, sizeof *g->state);
}

int32_t fv_pose_graph_add_node(struct fv_pose_graph *g, const struct fv_sim3 *S, bool fixed)
{
    if (g->state->node_count == g->limits.nodes) return -1;
    struct fv_graph_node *node = &g->nodes[g->state->node_count];
    memset(node, 0, sizeof *node);
    node->S = node->before = *S;
    node->fixed = fixed;
    node->parent = -1;
    return (int32_t)g->state->node_count++;
}

bool fv_pose_graph_add_edge(struct fv_pose_graph *g, uint32_t a, uint32_t b,
                            const struct fv_sim3 *S_a_b, const double weight[3])
{
    if (g->state->edge_count == g->limits.edges || a == b) return false;
    struct fv_graph_edge *edge = &g->edges[g->state->edge_count++];
    memset(edge, 0, sizeof *edge);
    edge->S_a_b = *S_a_b;
    memcpy(edge->weight, weight, sizeof edge->weight);
    edge->a = a;
    edge->b = b;
    return true;
}

void fv_pose_graph_between(const struct fv_pose_graph *g, uint32_t a, uint32_t b,
                           struct fv_sim3 *S_a_b)
{
    struct fv_sim3 inverse;
    fv_sim3_invert(&g->nodes[b].S, &inverse);
    fv_sim3_compose(&g->nodes[a].S, &inverse, S_a_b);
}

/* Lists of the edges of each node, one after the other. */
static void list_neighbours(struct fv_pose_graph *g)
{
    const struct fv_pose_graph_state *s = g->state;
    for (uint32_t e = 0; e < s->edge_count; e++) {
        g->nodes[g->edges[e].a].first++;
        g->nodes[g->edges[e].b].first++;
    }
    uint32_t end = 0;
    for (uint32_t n = 0; n < s->node_count; n++)
        g->nodes[n].first = end += g->nodes[n].first;
    for (uint32_t e = s->edge_count;
         e-- > 0;) { /* from the back, so that each list keeps the edges' order */
        g->neighbours[--g->nodes[g->edges[e].a].first] = e;
        g->neighbours[--g->nodes[g->edges[e].b].first] = e;
    }
}

static uint32_t neighbours_end(const struct fv_pose_graph *g, uint32_t node)
{
    return node + 1 < g->state->node_count ? g->nodes[node + 1].first : 2 * g->state->edge_count;
}

/* Breadth first from a node: moving ones join the order with their parents before them. A fixed
 * node gives no parent's block, so its children are roots of the elimination. */
static void reach(struct fv_pose_graph *g, uint32_t from)
{
    for (uint32_t k = g->nodes[from].first; k < neighbours_end(g, from); k++) {
        const struct fv_graph_edge *edge = &g->edges[g->neighbours[k]];
        struct fv_graph_node *other = &g->nodes[edge->a == from ? edge->b : edge->a];
        if (other->fixed || other->tree_edge != UINT32_MAX) continue;
        other->tree_edge = g->neighbours[k];
        other->parent = g->nodes[from].fixed ? -1 : (int32_t)from;
        g->order[g->state->ordered++] = (uint32_t)(other - g->nodes);
    }
}

bool fv_pose_graph_start(struct fv_pose_graph *g)
{
    struct fv_pose_graph_state *s = g->state;
    list_neighbours(g);
    s->ordered = 0;
    for (uint32_t n = 0; n < s->node_count; n++)
        g->nodes[n].tree_edge = UINT32_MAX;
    for (uint32_t n = 0; n < s->node_count; n++)
        if (g->nodes[n].fixed) reach(g, n);
    for (uint32_t k = 0; k < s->ordered; k++)
        reach(g, g->order[k]);
    for (uint32_t n = 0; n < s->node_count; n++)
        if (g->nodes[n].tree_edge == UINT32_MAX) g->nodes[n].fixed = 1;
    if (s->ordered == 0) return false;
    s->damping = 1e-6;
    s->next = 0;
    s->phase = FV_GRAPH_LINEARISE;
    return true;
}

/* ---- errors ---------------------------------------------------------------------------------- */

static void edge_error(const struct fv_pose_graph *g, const struct fv_graph_edge *edge, double e[7])
{
    struct fv_sim3 inverse, E;
    fv_sim3_invert(&g->nodes[edge->a].S, &inverse);
    fv_sim3_compose(&g->nodes[edge->b].S, &inverse, &E);
    fv_sim3_compose(&edge->S_a_b, &E, &E);
    fv_sim3_log(&E, e);
}

static double weight_of(const struct fv_graph_edge *edge, int row)
{
    return edge->weight[row < 3 ? 0 : row < 6 ? 1 : 2];
}

static double edge_cost(const struct fv_graph_edge *edge, const double e[7])
{
    double cost = 0;
    for (int i = 0; i < 7; i++)
        cost += weight_of(edge, i) * e[i] * e[i];
    return cost / 2;
}

/* Columns of [x] and of R's adjoint: 7x7 matrices over (translation, rotation, log scale). */
static void small_adjoint(const double e[7], double ad[49])
{
    const double *u = e, *w = e + 3;
    const double W[9] = {0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0},
                 U[9] = {0, -u[2], u[1], u[2], 0, -u[0], -u[1], u[0], 0};
    memset(ad, 0, 49 * sizeof *ad);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) {
            ad[7 * r + c] = W[3 * r + c] + (r == c ? e[6] : 0);
            ad[7 * r + 3 + c] = U[3 * r + c];
            ad[7 * (3 + r) + 3 + c] = W[3 * r + c];
        }
        ad[7 * r + 6] = -u[r];
    }
}

static void adjoint(const struct fv_sim3 *S, double Ad[49])
{
    const double *t = S->t, T[9] = {0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0};
    double TR[9];
    fv_multiply33(T, S->R, TR);
    memset(Ad, 0, 49 * sizeof *Ad);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) {
            Ad[7 * r + c] = S->s * S->R[3 * r + c];
            Ad[7 * r + 3 + c] = TR[3 * r + c];
            Ad[7 * (3 + r) + 3 + c] = S->R[3 * r + c];
        }
        Ad[7 * r + 6] = -t[r];
    }
    Ad[48] = 1;
}

static void multiply77(const double A[49], const double B[49], double out[49])
{
    for (int r = 0; r < 7; r++) {
        double row[7] = {0};
        for (int k = 0; k < 7; k++)
            for (int c = 0; c < 7; c++)
                row[c] += A[7 * r + k] * B[7 * k + c];
        memcpy(out + 7 * r, row, sizeof row);
    }
}

/* Derivative of log(exp(x) exp(e)) by x at 0 (left) and of log(exp(e) exp(x)) (right): 1 -+ ad/2 +
 * ad^2/12 - ad^4/720 + ad^6/30240, Bernoulli's numbers over factorials. */
static void log_derivatives(const double e[7], double left[49], double right[49])
{
    double ad[49], square[49], fourth[49], sixth[49];
    small_adjoint(e, ad);
    multiply77(ad, ad, square);
    multiply77(square, square, fourth);
    multiply77(fourth, square, sixth);
    for (int i = 0; i < 49; i++) {
        double even = square[i] / 12 - fourth[i] / 720 + sixth[i] / 30240 + (i % 8 == 0 ? 1 : 0);
        left[i] = even - ad[i] / 2;
        right[i] = even + ad[i] / 2;
    }
}

/* ---- linearising ----------------------------------------------------------------------------- */

/* W A of one edge. */
static void weigh(const struct fv_graph_edge *edge, const double A[49], double WA[49])
{
    for (int k = 0; k < 7; k++)
        fv_block_weigh(A + 7 * k, 7, weight_of(edge, k), WA + 7 * k);
}

/* What the edge adds to the gradient and the diagonal of a node; the latter is kept in `tree`
 * unless NULL. */
static void add_to_node(const double A[49], const double WA[49], const double e[7],
                        struct fv_graph_node *node, double *tree)
{
    double own[49] = {0};
    fv_block_add_inner(own, 7, WA, 7, A, 7, 7, 1, false);
    for (int k = 0; k < 7; k++)
        fv_block_add_vector(node->gradient, WA + 7 * k, 7, e + k, 1, -1);
    for (int i = 0; i < 49; i++)
        node->diagonal[i] += own[i];
    for (int r = 0, i = 0; r < 7 && tree != NULL; r++)
        for (int c = 0; c <= r; c++)
            tree[i++] = own[7 * r + c];
}

/* Keep of each row's turn what is about the vertical, as a node has it in its own axes. */
static void keep_upright(const struct fv_pose_graph *g, const struct fv_graph_node *node,
                         double A[49])
{
    double down[3];
    fv_rotate3(node->S.R, g->state->down, down);
    for (int row = 0; row < 7; row++)
        fv_keep_along3(down, A + 7 * row + 3);
}

/* Steps multiply on the left: S <- exp(x) S. */
static void linearise_edge(struct fv_pose_graph *g, uint32_t number)
{
    struct fv_graph_edge *edge = &g->edges[number];
    struct fv_graph_node *a = &g->nodes[edge->a], *b = &g->nodes[edge->b];
    double e[7], left[49], by_a[49], by_b[49], weighted[49], Ad[49], block[49] = {0};
    edge_error(g, edge, e);
    g->state->cost += edge_cost(edge, e);
    log_derivatives(e, left, by_a);
    for (int i = 0; i < 49; i++)
        by_a[i] = -by_a[i];
    adjoint(&edge->S_a_b, Ad);
    multiply77(left, Ad, by_b);
    for (int row = 0; row < 6 && g->state->rigid; row++) /* else shifts would be made up by scale */
        by_a[7 * row + 6] = by_b[7 * row + 6] = 0;
    if (g->state->upright) {
        keep_upright(g, a, by_a);
        keep_upright(g, b, by_b);
    }
    weigh(edge, by_a, weighted);
    fv_block_add_inner(block, 7, weighted, 7, by_b, 7, 7, 1, false);
    for (int i = 0; i < 49; i++)
        edge->block[i] = (float)block[i];
    add_to_node(by_a, weighted, e, a,
                a->tree_edge == number   ? a->own
                : b->tree_edge == number ? b->parents
                                         : NULL);
    weigh(edge, by_b, weighted);
    add_to_node(by_b, weighted, e, b,
                b->tree_edge == number   ? b->own
                : a->tree_edge == number ? a->parents
                                         : NULL);
}

/* Turns that a node may not make: equations of their own, which say 0. */
static void hold_tilt(const struct fv_pose_graph *g, struct fv_graph_node *node)
{
    double down[3];
    fv_rotate3(node->S.R, g->state->down, down);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            node->held[3 * r + c] = (r == c) - down[r] * down[c];
}

static void linearise_unit(struct fv_pose_graph *g)
{
    struct fv_pose_graph_state *s = g->state;
    if (s->next == 0) {
        s->cost = 0;
        for (uint32_t n = 0; n < s->node_count; n++) {
            memset(g->nodes[n].diagonal, 0, sizeof g->nodes[n].diagonal);
            memset(g->nodes[n].gradient, 0, sizeof g->nodes[n].gradient);
            if (s->upright) hold_tilt(g, &g->nodes[n]);
        }
    }
    for (uint32_t done = 0; done < UNIT_LINEARISE && s->next < s->edge_count; done++)
        linearise_edge(g, s->next++);
    if (s->next < s->edge_count) return;
    s->cost_before = s->cost;
    if (s->step == 0) s->cost_at_start = s->cost;
    s->phase = FV_GRAPH_FACTOR;
}

/* ---- judging a step -------------------------------------------------------------------------- */

static void take_steps(struct fv_pose_graph *g)
{
    for (uint32_t k = 0; k < g->state->ordered; k++) {
        struct fv_graph_node *node = &g->nodes[g->order[k]];
        struct fv_sim3 moved;
        if (g->state->upright) {
            double down[3];
            fv_rotate3(node->S.R, g->state->down, down);
            fv_keep_along3(down, node->step + 3);
        }
        fv_sim3_exp(node->step, &moved);
        node->before = node->S;
        fv_sim3_compose(&moved, &node->S, &node->S);
        fv_so3_orthonormalise(node->S.R);
    }
}

static void judge(struct fv_pose_graph *g)
{
    struct fv_pose_graph_state *s = g->state;
    s->step++;
    s->next = 0;
    bool last = s->step >= g->limits.steps;
    if (s->cost <= s->cost_before) {
        bool converged = s->cost_before - s->cost <= converged_fraction * s->cost_before;
        s->damping = fv_damping_lower(&damping_rule, s->damping);
        s->phase = last || converged ? FV_GRAPH_DONE : FV_GRAPH_LINEARISE;
        return;
    }
    for (uint32_t k = 0; k < s->ordered; k++)
        g->nodes[g->order[k]].S = g->nodes[g->order[k]].before;
    bool converged = s->cost - s->cost_before <= converged_fraction * s->cost_before;
    s->cost = s->cost_before;
    s->damping = fv_damping_raise(&damping_rule, s->damping);
    s->phase = last || converged || s->damping > 1e6 ? FV_GRAPH_DONE : FV_GRAPH_FACTOR;
}

static void judge_unit(struct fv_pose_graph *g)
{
    struct fv_pose_graph_state *s = g->state;
    if (s->next == 0) {
        take_steps(g);
        s->cost = 0;
    }
    for (uint32_t done = 0; done < UNIT_JUDGE && s->next < s->edge_count; done++) {
        double e[7];
        edge_error(g, &g->edges[s->next], e);
        s->cost += edge_cost(&g->edges[s->next++], e);
    }
    if (s->next == s->edge_count) judge(g);
}

bool fv_pose_graph_unit(struct fv_pose_graph *g)
{
    struct fv_pose_graph_state *s = g->state;
    switch (s->phase) {
    case FV_GRAPH_LINEARISE:
        linearise_unit(g);
        break;
    case FV_GRAPH_FACTOR:
        s->phase = fv_graph_factor(g) ? FV_GRAPH_SOLVE : FV_GRAPH_DONE;
        if (s->phase == FV_GRAPH_SOLVE) fv_graph_solve_begin(g);
        break;
    case FV_GRAPH_SOLVE:
        for (int k = 0; k < UNIT_ITERATIONS && s->phase == FV_GRAPH_SOLVE; k++)
            if (!fv_graph_solve_more(g)) s->phase = FV_GRAPH_JUDGE;
        s->next = 0;
        break;
    case FV_GRAPH_JUDGE:
        judge_unit(g);
        break;
    case FV_GRAPH_IDLE:
    case FV_GRAPH_DONE:
        break;
    }
    return s->phase != FV_GRAPH_DONE && s->phase != FV_GRAPH_IDLE;
}
