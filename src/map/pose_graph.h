/* Pose-graph optimisation: poses that similarities tie together, adjusted to agree with all of
 * them; a job.
 *
 * A node is S_cam_world of a keyframe, an edge says what S_a_b between two of them should be.
 * Minimised is half the sum over edges of the weighted squares of log(S_a_b S_b_world
 * S_a_world^-1), by Levenberg-Marquardt; after H. Strasdat, J. Montiel, A. Davison, "Scale
 * drift-aware large scale monocular SLAM" (RSS 2010). Each step is solved by conjugate gradients
 * with the exact solution of a spanning tree as preconditioner, which needs no fill-in and so fixed
 * memory (F. Dellaert et al., "Subgraph-preconditioned conjugate gradients for large scale SLAM",
 * IROS 2010).
 *
 * Where gravity is known in the world of the nodes, each keeps the roll and pitch that it came
 * with: a step turns it about the vertical alone, which leaves 4 degrees of freedom to a node
 * whose unit of length is held (`rigid`), 5 to others; T. Qin, P. Li, S. Shen, "VINS-Mono" (T-RO
 * 2018), section VIII. An edge still says what all of the turn between its ends should be; what
 * roll and pitch cannot follow stays an error of it. Works on its own copy, in units of bounded
 * cost; state holds no addresses. Real-time safe. */
#ifndef FOVEA_MAP_POSE_GRAPH_H
#define FOVEA_MAP_POSE_GRAPH_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "geometry/sim3.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_pose_graph_limits {
    uint32_t nodes, edges;
    uint32_t steps;      /* of Levenberg-Marquardt, tried ones counted, [1, 100] */
    uint32_t iterations; /* of conjugate gradients per step, [10, 2000] */
};

struct fv_graph_node {
    struct fv_sim3 S, before; /* S_cam_world in work, and as last accepted */
    double diagonal[49];      /* of the normal equations, lower triangle, without damping */
    double gradient[7];
    double held[9]; /* of turns: that which leaves the vertical where it is not; where upright */
    /* what the tree's edge to the parent adds to the two diagonals: lower triangles by rows */
    double own[28], parents[28];
    double factor[49];    /* of what elimination of the tree left of the diagonal block */
    double to_parent[49]; /* tree's block between this node (rows) and its parent; then factor^-1
                             times it */
    double step[7], residual[7], direction[7], image[7], preconditioned[7];
    int32_t parent;     /* in the tree; -1: a root, or not reached */
    uint32_t tree_edge; /* that leads to the parent */
    uint32_t first;     /* of its entries in the list of neighbours */
    uint32_t fixed;     /* not moved: asked for, or tied to nothing that is */
};

struct fv_graph_edge {
    struct fv_sim3 S_a_b;
    double weight[3]; /* of translation, rotation, log scale: 1 / sigma^2 */
    /* Of the normal equations: rows a, columns b. It tells how steps hang together, and not where
     * they end: floats do. */
    float block[49];
    uint32_t a, b;
};

enum fv_graph_phase {
    FV_GRAPH_IDLE = 0,
    FV_GRAPH_LINEARISE = 1,
    FV_GRAPH_FACTOR = 2,
    FV_GRAPH_SOLVE = 3,
    FV_GRAPH_JUDGE = 4,
    FV_GRAPH_DONE = 5
};

struct fv_pose_graph_state {
    enum fv_graph_phase phase;
    uint32_t node_count, edge_count, ordered; /* nodes in the tree's order */
    uint32_t next, step, iteration;
    /* To be set after fv_pose_graph_begin: scales are 1 and stay so; roll and pitch of all nodes
     * stay what they are against `down`, a unit vector in the axes of world. */
    uint32_t rigid, upright;
    double down[3];
    double cost, cost_before, cost_at_start, damping;
    double rho, rho_start; /* of conjugate gradients */
};

struct fv_pose_graph {
    struct fv_pose_graph_limits limits;
    struct fv_pose_graph_state *state;
    struct fv_graph_node *nodes;
    struct fv_graph_edge *edges;
    uint32_t *neighbours; /* edges of each node */
    uint32_t *order;      /* nodes that move, parents first */
};

void fv_pose_graph_carve(struct fv_pose_graph *graph, const struct fv_pose_graph_limits *limits,
                         struct fv_arena *job);

/* Empty the graph; then add nodes and edges, and start. */
void fv_pose_graph_begin(struct fv_pose_graph *graph);
/* Number of the node, -1 when there is no room. */
int32_t fv_pose_graph_add_node(struct fv_pose_graph *graph, const struct fv_sim3 *S_cam_world,
                               bool fixed);
/* False when there is no room. */
bool fv_pose_graph_add_edge(struct fv_pose_graph *graph, uint32_t a, uint32_t b,
                            const struct fv_sim3 *S_a_b, const double weight[3]);
/* What nodes say of the edge now: S_a_world S_b_world^-1. */
void fv_pose_graph_between(const struct fv_pose_graph *graph, uint32_t a, uint32_t b,
                           struct fv_sim3 *S_a_b);
/* Build the tree. Nodes that no path ties to a fixed one do not move. False when nothing moves. */
bool fv_pose_graph_start(struct fv_pose_graph *graph);

/* One unit of bounded work; true when units are left. Afterwards nodes[].S is the
 * result. */
bool fv_pose_graph_unit(struct fv_pose_graph *graph);

/* ---- between the files of the job ------------------------------------------------------------ */

/* Factor the tree with the damping. False when a block is not positive definite. */
bool fv_graph_factor(struct fv_pose_graph *graph);
/* Begin to solve for the steps; then iterate until false. */
void fv_graph_solve_begin(struct fv_pose_graph *graph);
bool fv_graph_solve_more(struct fv_pose_graph *graph);

#ifdef __cplusplus
}
#endif
#endif
