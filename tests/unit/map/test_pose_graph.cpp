/* The pose graph beside Ceres: the same cost on graphs with noise, the truth on graphs without, and
 * units of bounded work. */
#include <ceres/ceres.h>

#include "common/cmocka_cpp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <vector>

#include "geometry/vec.h"
#include "map/pose_graph.h"

enum { NODES_MAX = 256, EDGES_MAX = 2048 };
static const double weight[3] = {400, 2500, 900};

static void carve(fv_pose_graph *graph, fv_arena *arena)
{
    const fv_pose_graph_limits limits = {NODES_MAX, EDGES_MAX, 60, 1000};
    fv_pose_graph_carve(graph, &limits, arena);
}

static void *make_graph(fv_pose_graph *graph)
{
    fv_arena arena;
    fv_arena_count(&arena);
    carve(graph, &arena);
    size_t bytes = (arena.used + 63) / 64 * 64;
    void *memory = aligned_alloc(64, bytes);
    memset(memory, 0x5a, bytes);
    fv_arena_init(&arena, memory, bytes);
    carve(graph, &arena);
    fv_pose_graph_begin(graph);
    return memory;
}

static void random_step(fv_random *random, double size, double x[7])
{
    for (int i = 0; i < 7; i++)
        x[i] = size * fv_random_normal(random);
}

/* A walk round a ring that ends where it began, with edges along the way, a few across neighbours,
 * and one that closes the loop; measured with noise, started from the walk as measured. */
static void make_ring(fv_pose_graph *graph, fv_random *random, int count, double noise, int across,
                      std::vector<fv_sim3> *truth)
{
    std::vector<fv_sim3> walk((size_t)count);
    truth->resize((size_t)count);
    for (int i = 0; i < count; i++) {
        double angle = 6.283185 * i / count;
        const double turn[3] = {0.1 * fv_sin(3 * angle), angle > 3.14 ? angle - 6.283185 : angle,
                                0.2},
                     at[3] = {8 * fv_cos(angle), fv_sin(2 * angle), 8 * fv_sin(angle)};
        fv_se3 T;
        fv_so3_exp(turn, T.R);
        fv_copy3(at, T.t);
        fv_sim3_from_se3(&T, 1, &(*truth)[(size_t)i]);
    }
    auto between = [&](int a, int b, double size) {
        fv_sim3 inverse, S, off;
        double x[7];
        fv_sim3_invert(&(*truth)[(size_t)b], &inverse);
        fv_sim3_compose(&(*truth)[(size_t)a], &inverse, &S);
        random_step(random, size, x);
        fv_sim3_exp(x, &off);
        fv_sim3_compose(&off, &S, &S);
        return S;
    };
    std::vector<fv_sim3> measured;
    for (int i = 1; i < count; i++)
        measured.push_back(between(i, i - 1, noise));
    walk[0] = (*truth)[0];
    for (int i = 1; i < count; i++)
        fv_sim3_compose(&measured[(size_t)i - 1], &walk[(size_t)i - 1], &walk[(size_t)i]);
    for (int i = 0; i < count; i++)
        assert_int_equal(fv_pose_graph_add_node(graph, &walk[(size_t)i], i == 0), i);
    for (int i = 1; i < count; i++)
        assert_true(fv_pose_graph_add_edge(graph, (uint32_t)i, (uint32_t)i - 1,
                                           &measured[(size_t)i - 1], weight));
    for (int k = 2; k <= across; k++)
        for (int i = k; i < count; i++) {
            fv_sim3 S = between(i - k, i, noise);
            assert_true(fv_pose_graph_add_edge(graph, (uint32_t)(i - k), (uint32_t)i, &S, weight));
        }
    fv_sim3 S = between(count - 1, 0, noise);
    assert_true(fv_pose_graph_add_edge(graph, (uint32_t)count - 1, 0, &S, weight));
}

static int finish(fv_pose_graph *graph)
{
    int units = 1;
    while (fv_pose_graph_unit(graph))
        units++;
    return units;
}

/* ---- Ceres ----------------------------------------------------------------------------------- */

struct EdgeError {
    const fv_graph_edge *edge;
    bool operator()(const double *a, const double *b, double *residual) const
    {
        fv_sim3 A, B, E;
        fv_sim3_exp(a, &A);
        fv_sim3_exp(b, &B);
        fv_sim3_invert(&A, &A);
        fv_sim3_compose(&B, &A, &E);
        fv_sim3_compose(&edge->S_a_b, &E, &E);
        fv_sim3_log(&E, residual);
        for (int i = 0; i < 7; i++)
            residual[i] *= sqrt(edge->weight[i < 3 ? 0 : i < 6 ? 1 : 2]);
        return true;
    }
};

static double finish_with_ceres(ceres::Problem *problem)
{
    ceres::Solver::Options options;
    options.max_num_iterations = 200;
    options.function_tolerance = 1e-15;
    options.gradient_tolerance = 1e-12;
    options.parameter_tolerance = 1e-14;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, problem, &summary);
    return summary.final_cost;
}

static double solve_with_ceres(const fv_pose_graph *graph)
{
    std::vector<double> x(7 * graph->state->node_count);
    ceres::Problem problem;
    for (uint32_t n = 0; n < graph->state->node_count; n++) {
        fv_sim3_log(&graph->nodes[n].S, &x[7 * n]);
        problem.AddParameterBlock(&x[7 * n], 7);
        if (graph->nodes[n].fixed) problem.SetParameterBlockConstant(&x[7 * n]);
    }
    for (uint32_t e = 0; e < graph->state->edge_count; e++)
        problem.AddResidualBlock(
            new ceres::NumericDiffCostFunction<EdgeError, ceres::CENTRAL, 7, 7, 7>(
                new EdgeError{&graph->edges[e]}),
            nullptr, &x[7 * graph->edges[e].a], &x[7 * graph->edges[e].b]);
    return finish_with_ceres(&problem);
}

/* The n-th graph is solved, to what Ceres found, and less than `share` of what it cost. */
static void comes_to(fv_pose_graph *graph, int n, double expected, double share)
{
    assert_true(fv_pose_graph_start(graph));
    finish(graph);
    assert_int_equal(graph->state->phase, FV_GRAPH_DONE);
    assert_true(graph->state->cost < share * graph->state->cost_at_start);
    if (!(fabs(graph->state->cost - expected) <= 1e-6 * expected))
        fail_msg("graph %d: cost %.12g, Ceres %.12g", n, graph->state->cost, expected);
}

static void test_same_cost_as_ceres(void **)
{
    fv_random random;
    fv_random_seed(&random, 17);
    for (int n = 0; n < 6; n++) {
        fv_pose_graph graph;
        void *memory = make_graph(&graph);
        std::vector<fv_sim3> truth;
        make_ring(&graph, &random, n < 4 ? 20 + 12 * n : 150, n % 2 ? 0.03 : 0.01, n < 2 ? 1 : 3,
                  &truth);
        double expected = solve_with_ceres(&graph);
        comes_to(&graph, n, expected, 0.9);
        free(memory);
    }
}

/* The same where roll and pitch are held: 5 variables of a node, or with one unit of length 4. */
struct UprightError {
    const fv_pose_graph *graph;
    const fv_graph_edge *edge;
    std::vector<fv_sim3> start;
    fv_sim3 at(uint32_t node, const double *x) const
    {
        const fv_sim3 &from = start[node];
        double down[3], turn[3], R[9];
        fv_sim3 S;
        fv_rotate3(from.R, graph->state->down, down);
        for (int i = 0; i < 3; i++)
            turn[i] = x[3] * down[i];
        fv_so3_exp(turn, R);
        fv_multiply33(R, from.R, S.R);
        fv_copy3(x, S.t);
        S.s = fv_exp(x[4]);
        return S;
    }
    bool operator()(const double *a, const double *b, double *residual) const
    {
        fv_sim3 A = at(edge->a, a), E;
        const fv_sim3 B = at(edge->b, b);
        fv_sim3_invert(&A, &A);
        fv_sim3_compose(&B, &A, &E);
        fv_sim3_compose(&edge->S_a_b, &E, &E);
        fv_sim3_log(&E, residual);
        for (int i = 0; i < 7; i++)
            residual[i] *= sqrt(edge->weight[i < 3 ? 0 : i < 6 ? 1 : 2]);
        return true;
    }
};

static double solve_upright_with_ceres(const fv_pose_graph *graph)
{
    std::vector<double> x(5 * graph->state->node_count);
    std::vector<fv_sim3> start;
    ceres::Problem problem;
    for (uint32_t n = 0; n < graph->state->node_count; n++) {
        start.push_back(graph->nodes[n].S);
        fv_copy3(graph->nodes[n].S.t, &x[5 * n]);
        x[5 * n + 4] = log(graph->nodes[n].S.s);
        problem.AddParameterBlock(&x[5 * n], 5);
        if (graph->nodes[n].fixed)
            problem.SetParameterBlockConstant(&x[5 * n]);
        else if (graph->state->rigid)
            problem.SetManifold(&x[5 * n], new ceres::SubsetManifold(5, {4}));
    }
    for (uint32_t e = 0; e < graph->state->edge_count; e++)
        problem.AddResidualBlock(
            new ceres::NumericDiffCostFunction<UprightError, ceres::CENTRAL, 7, 5, 5>(
                new UprightError{graph, &graph->edges[e], start}),
            nullptr, &x[5 * graph->edges[e].a], &x[5 * graph->edges[e].b]);
    return finish_with_ceres(&problem);
}

/* Tilts of the nodes against `down`, before and after. */
static void test_upright_as_ceres(void **)
{
    fv_random random;
    fv_random_seed(&random, 23);
    for (int n = 0; n < 6; n++) {
        fv_pose_graph graph;
        void *memory = make_graph(&graph);
        std::vector<fv_sim3> truth;
        make_ring(&graph, &random, 20 + 20 * n, n % 2 ? 0.03 : 0.01, n < 2 ? 1 : 3, &truth);
        graph.state->rigid = n > 2;
        graph.state->upright = 1;
        const double down[3] = {0.36, -0.48, 0.8};
        fv_copy3(down, graph.state->down);
        for (uint32_t k = 0; k < graph.state->node_count && n > 2; k++)
            graph.nodes[k].S.s = 1;
        for (uint32_t e = 0; e < graph.state->edge_count && n > 2; e++)
            graph.edges[e].S_a_b.s = 1;
        std::vector<fv_sim3> before;
        for (uint32_t k = 0; k < graph.state->node_count; k++)
            before.push_back(graph.nodes[k].S);
        const double expected = solve_upright_with_ceres(&graph);
        comes_to(&graph, n, expected, 0.99);
        double most = 0, turned = 0;
        for (uint32_t k = 0; k < graph.state->node_count; k++) {
            double was[3], is[3], off[3];
            fv_rotate3(before[k].R, down, was);
            fv_rotate3(graph.nodes[k].S.R, down, is);
            fv_subtract3(was, is, off);
            most = fmax(most, fv_norm3(off));
            turned = fmax(turned, fabs(before[k].R[0] - graph.nodes[k].S.R[0]));
            assert_true(n < 3 || graph.nodes[k].S.s == 1);
        }
        assert_true(most < 1e-12 && turned > 1e-3);
        free(memory);
    }
}

/* Without noise in the measurements the truth is found, however far the start is off. */
static void test_truth_without_noise(void **)
{
    fv_random random;
    fv_random_seed(&random, 4);
    fv_pose_graph graph;
    void *memory = make_graph(&graph);
    std::vector<fv_sim3> truth;
    make_ring(&graph, &random, 60, 0, 2, &truth);
    for (int i = 1; i < 60; i++) {
        double x[7];
        fv_sim3 off;
        random_step(&random, 0.1, x);
        fv_sim3_exp(x, &off);
        fv_sim3_compose(&off, &graph.nodes[i].S, &graph.nodes[i].S);
    }
    assert_true(fv_pose_graph_start(&graph));
    finish(&graph);
    for (int i = 0; i < 60; i++) {
        for (int k = 0; k < 3; k++)
            assert_true(fabs(graph.nodes[i].S.t[k] - truth[(size_t)i].t[k]) < 1e-6);
        assert_true(fabs(graph.nodes[i].S.s - 1) < 1e-7);
    }
    free(memory);
}

/* What no path ties to a fixed node stays, and does no harm; nothing to move is no job; a full
 * graph says so.
 */
static void test_edges_of_use(void **)
{
    fv_random random;
    fv_random_seed(&random, 9);
    fv_pose_graph graph;
    void *memory = make_graph(&graph);
    std::vector<fv_sim3> truth;
    make_ring(&graph, &random, 30, 0.02, 2, &truth);
    fv_sim3 alone;
    double x[7] = {1, 2, 3, 0.1, 0.2, 0.3, 0.4};
    fv_sim3_exp(x, &alone);
    int32_t first = fv_pose_graph_add_node(&graph, &alone, false),
            second = fv_pose_graph_add_node(&graph, &alone, false);
    assert_true(
        fv_pose_graph_add_edge(&graph, (uint32_t)first, (uint32_t)second, &truth[3], weight));
    assert_true(fv_pose_graph_start(&graph));
    finish(&graph);
    assert_memory_equal(&graph.nodes[first].S, &alone, sizeof alone);
    assert_memory_equal(&graph.nodes[second].S, &alone, sizeof alone);

    fv_pose_graph_begin(&graph);
    for (int i = 0; i < NODES_MAX; i++)
        assert_int_equal(fv_pose_graph_add_node(&graph, &alone, i == 0), i);
    assert_int_equal(fv_pose_graph_add_node(&graph, &alone, false), -1);
    assert_false(fv_pose_graph_start(&graph));
    for (int i = 0; i < EDGES_MAX; i++)
        assert_true(fv_pose_graph_add_edge(&graph, 0, 1, &truth[0], weight));
    assert_false(fv_pose_graph_add_edge(&graph, 0, 1, &truth[0], weight));
    free(memory);
}

/* The largest graph ends within bounded units, the same bits every time. */
static void test_largest(void **)
{
    double cost[2];
    for (int n = 0; n < 2; n++) {
        fv_random random;
        fv_random_seed(&random, 2);
        fv_pose_graph graph;
        void *memory = make_graph(&graph);
        std::vector<fv_sim3> truth;
        make_ring(&graph, &random, NODES_MAX, 0.005, 7, &truth);
        assert_true(fv_pose_graph_start(&graph));
        int units = finish(&graph);
        if (units > 2000) fail_msg("%d units", units);
        cost[n] = graph.state->cost;
        free(memory);
    }
    assert_memory_equal(&cost[0], &cost[1], sizeof cost[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_cost_as_ceres),
        cmocka_unit_test(test_upright_as_ceres),
        cmocka_unit_test(test_truth_without_noise),
        cmocka_unit_test(test_edges_of_use),
        cmocka_unit_test(test_largest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
