/* The linear part of pose-graph optimisation: conjugate gradients, with the spanning tree solved
 * exactly. */
#include <string.h>

#include "geometry/normal_equations.h"
#include "map/pose_graph.h"

static const double residual_fraction =
    1e-8; /* of the first squared residual, where iterating ends */

/* out += M x, or M^T x. */
static void add_product(const double M[49], bool transposed, const double x[7], double out[7])
{
    for (int r = 0; r < 7; r++) {
        double sum = 0;
        for (int c = 0; c < 7; c++)
            sum += M[transposed ? 7 * c + r : 7 * r + c] * x[c];
        out[r] += sum;
    }
}

/* The same for an edge's block. */
static void add_block(const float M[49], bool transposed, const double x[7], double out[7])
{
    for (int r = 0; r < 7; r++) {
        double sum = 0;
        for (int c = 0; c < 7; c++)
            sum += (double)M[transposed ? 7 * c + r : 7 * r + c] * x[c];
        out[r] += sum;
    }
}

/* Add a lower triangle by rows. */
static void add_triangle(const double triangle[28], double M[49])
{
    for (int r = 0, i = 0; r < 7; r++)
        for (int c = 0; c <= r; c++)
            M[7 * r + c] += triangle[i++];
}

/* ---- the tree -------------------------------------------------------------------------------- */

static void damp(const struct fv_pose_graph_state *s, const struct fv_graph_node *node,
                 double D[49])
{
    for (int a = 0; a < 7; a++)
        D[8 * a] += s->damping * node->diagonal[8 * a] + 1e-12;
    for (int r = 0; r < 3 && s->upright; r++)
        for (int c = 0; c < 3; c++)
            D[7 * (3 + r) + 3 + c] += node->held[3 * r + c];
}

/* Diagonal blocks of the tree alone: the sum over the edges of a node to its parent and to
 * its children. */
static void tree_blocks(struct fv_pose_graph *g)
{
    for (uint32_t k = 0; k < g->state->ordered; k++) {
        struct fv_graph_node *node = &g->nodes[g->order[k]];
        memset(node->factor, 0, sizeof node->factor);
        damp(g->state, node, node->factor);
    }
    for (uint32_t k = 0; k < g->state->ordered; k++) {
        uint32_t at = g->order[k];
        struct fv_graph_node *node = &g->nodes[at];
        const struct fv_graph_edge *edge = &g->edges[node->tree_edge];
        bool is_a = edge->a == at;
        add_triangle(node->own, node->factor);
        if (node->parent < 0) continue;
        add_triangle(node->parents, g->nodes[node->parent].factor);
        for (int r = 0; r < 7; r++)
            for (int c = 0; c < 7; c++)
                node->to_parent[7 * r + c] = (double)edge->block[is_a ? 7 * r + c : 7 * c + r];
    }
}

bool fv_graph_factor(struct fv_pose_graph *g)
{
    tree_blocks(g);
    for (uint32_t k = g->state->ordered; k-- > 0;) {
        struct fv_graph_node *node = &g->nodes[g->order[k]];
        if (!fv_ldlt_factor(node->factor, 7)) return false;
        if (node->parent < 0) continue;
        double solved[49], column[7]; /* factor^-1 to_parent */
        for (int c = 0; c < 7; c++) {
            for (int r = 0; r < 7; r++)
                column[r] = node->to_parent[7 * r + c];
            fv_ldlt_back(node->factor, 7, column);
            for (int r = 0; r < 7; r++)
                solved[7 * r + c] = column[r];
        }
        double *above = g->nodes[node->parent].factor;
        for (int q = 0; q < 7; q++)
            fv_block_add_inner(above, 7, node->to_parent + 7 * q, 7, solved + 7 * q, 7, 1, -1,
                               true);
        memcpy(node->to_parent, solved, sizeof solved);
    }
    return true;
}

/* preconditioned = tree^-1 residual. */
static void apply_tree(struct fv_pose_graph *g)
{
    const struct fv_pose_graph_state *s = g->state;
    for (uint32_t k = 0; k < s->ordered; k++)
        memcpy(g->nodes[g->order[k]].preconditioned, g->nodes[g->order[k]].residual,
               7 * sizeof(double));
    for (uint32_t k = s->ordered; k-- > 0;) {
        struct fv_graph_node *node = &g->nodes[g->order[k]];
        if (node->parent < 0) continue;
        double taken[7] = {0}, *above = g->nodes[node->parent].preconditioned;
        add_product(node->to_parent, true, node->preconditioned, taken);
        for (int i = 0; i < 7; i++)
            above[i] -= taken[i];
    }
    for (uint32_t k = 0; k < s->ordered; k++) {
        struct fv_graph_node *node = &g->nodes[g->order[k]];
        fv_ldlt_back(node->factor, 7, node->preconditioned);
        if (node->parent < 0) continue;
        double taken[7] = {0};
        add_product(node->to_parent, false, g->nodes[node->parent].preconditioned, taken);
        for (int i = 0; i < 7; i++)
            node->preconditioned[i] -= taken[i];
    }
}

/* ---- conjugate gradients --------------------------------------------------------------------- */

/* image = H direction. Fixed nodes have direction zero, and their image is not read. */
static void apply_system(struct fv_pose_graph *g)
{
    const struct fv_pose_graph_state *s = g->state;
    for (uint32_t k = 0; k < s->ordered; k++) {
        struct fv_graph_node *node = &g->nodes[g->order[k]];
        double D[49];
        memcpy(D, node->diagonal, sizeof D);
        damp(s, node, D);
        memset(node->image, 0, sizeof node->image);
        add_product(D, false, node->direction, node->image);
    }
    for (uint32_t e = 0; e < s->edge_count; e++) {
        const struct fv_graph_edge *edge = &g->edges[e];
        struct fv_graph_node *a = &g->nodes[edge->a], *b = &g->nodes[edge->b];
        if (a->fixed || b->fixed) continue;
        add_block(edge->block, false, b->direction, a->image);
        add_block(edge->block, true, a->direction, b->image);
    }
}

void fv_graph_solve_begin(struct fv_pose_graph *g)
{
    struct fv_pose_graph_state *s = g->state;
    for (uint32_t k = 0; k < s->ordered; k++) {
        struct fv_graph_node *node = &g->nodes[g->order[k]];
        memset(node->step, 0, sizeof node->step);
        memcpy(node->residual, node->gradient, sizeof node->residual);
    }
    apply_tree(g);
    s->rho = 0;
    s->iteration = 0;
    for (uint32_t k = 0; k < s->ordered; k++) {
        struct fv_graph_node *node = &g->nodes[g->order[k]];
        memcpy(node->direction, node->preconditioned, sizeof node->direction);
        for (int i = 0; i < 7; i++)
            s->rho += node->residual[i] * node->preconditioned[i];
    }
    s->rho_start = s->rho;
}

bool fv_graph_solve_more(struct fv_pose_graph *g)
{
    struct fv_pose_graph_state *s = g->state;
    if (!(s->rho > 0) || s->iteration++ >= g->limits.iterations) return false;
    apply_system(g);
    double curvature = 0, rho = 0;
    for (uint32_t k = 0; k < s->ordered; k++)
        for (int i = 0; i < 7; i++)
            curvature += g->nodes[g->order[k]].direction[i] * g->nodes[g->order[k]].image[i];
    if (!(curvature > 0)) return false;
    double along = s->rho / curvature;
    for (uint32_t k = 0; k < s->ordered; k++) {
        struct fv_graph_node *node = &g->nodes[g->order[k]];
        for (int i = 0; i < 7; i++) {
            node->step[i] += along * node->direction[i];
            node->residual[i] -= along * node->image[i];
        }
    }
    apply_tree(g);
    for (uint32_t k = 0; k < s->ordered; k++)
        for (int i = 0; i < 7; i++)
            rho += g->nodes[g->order[k]].residual[i] * g->nodes[g->order[k]].preconditioned[i];
    double ratio = rho / s->rho;
    for (uint32_t k = 0; k < s->ordered; k++) {
        struct fv_graph_node *node = &g->nodes[g->order[k]];
        for (int i = 0; i < 7; i++)
            node->direction[i] = node->preconditioned[i] + ratio * node->direction[i];
    }
    s->rho = rho;
    return rho > residual_fraction * s->rho_start;
}
