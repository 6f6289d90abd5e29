/* Normal equations with blocks of different sizes beside Eigen, which solves the same least-squares
 * problem as one dense system with the landmarks in it. */
#include <Eigen/Dense>

#include "common/cmocka_cpp.h"

#include <limits>
#include <math.h>
#include <string.h>
#include <vector>

#include "base/elementary.h"
#include "geometry/normal_equations.h"

using Eigen::MatrixXd;
using Eigen::VectorXd;
typedef Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> Rows;

static MatrixXd random_matrix(fv_random *random, int rows, int columns)
{
    MatrixXd M(rows, columns);
    for (int r = 0; r < rows; r++)
        for (int c = 0; c < columns; c++)
            M(r, c) = fv_random_normal(random);
    return M;
}

static MatrixXd random_weight(fv_random *random, int m)
{
    const MatrixXd root = random_matrix(random, m, m);
    return root * root.transpose() + 0.1 * MatrixXd::Identity(m, m);
}

/* A block that a residual depends on: rows [first, first + size) of the system, J and W J. */
struct residual_block {
    const double *J, *WJ;
    int first, size;
};

/* A residual of m rows on several blocks, which do not overlap, in any order. */
static void add_residual(const fv_normal *n, const std::vector<residual_block> &blocks,
                         const double *error, int m)
{
    for (const residual_block &a : blocks) {
        fv_normal_add_one(n, a.first, a.size, a.J, a.WJ, error, m, NULL);
        for (const residual_block &b : blocks)
            if (b.first < a.first)
                fv_block_add_inner(n->H + a.first * n->size + b.first, n->size, a.WJ, a.size, b.J,
                                   b.size, m, 1, false);
    }
}

/* The reduced system and, beside it, the whole one: reduced variables first, landmarks after. */
struct problem {
    std::vector<int> first, size; /* of the reduced blocks */
    std::vector<double> H, g;
    MatrixXd whole;
    VectorXd whole_g;
    int reduced = 0;

    problem(const std::vector<int> &sizes, int landmark_values)
    {
        for (int s : sizes) {
            first.push_back(reduced);
            size.push_back(s);
            reduced += s;
        }
        H.assign((size_t)(reduced * reduced), 7);
        g.assign((size_t)reduced, 7);
        const fv_normal n = normal();
        fv_normal_clear(&n);
        whole = MatrixXd::Zero(reduced + landmark_values, reduced + landmark_values);
        whole_g = VectorXd::Zero(reduced + landmark_values);
    }

    fv_normal normal()
    {
        return {H.data(), g.data(), reduced};
    }

    /* A residual of m rows on blocks, with a full weight matrix. */
    void add(fv_random *random, int m, const std::vector<int> &blocks)
    {
        const MatrixXd W = random_weight(random, m);
        const VectorXd e = random_matrix(random, m, 1);
        std::vector<Rows> J, WJ;
        std::vector<residual_block> list;
        MatrixXd all = MatrixXd::Zero(m, whole.cols());
        for (int b : blocks) {
            J.push_back(random_matrix(random, m, size[b]));
            WJ.push_back(W * J.back());
            all.middleCols(first[b], size[b]) = J.back();
        }
        for (size_t k = 0; k < blocks.size(); k++)
            list.push_back({J[k].data(), WJ[k].data(), first[blocks[k]], size[blocks[k]]});
        const fv_normal n = normal();
        add_residual(&n, list, e.data(), m);
        whole += all.transpose() * W * all;
        whole_g -= all.transpose() * W * e;
    }

    MatrixXd reduced_matrix() const
    {
        const MatrixXd M = Eigen::Map<const Rows>(H.data(), reduced, reduced);
        return M.selfadjointView<Eigen::Lower>();
    }
};

/* A landmark that `blocks` see, each by a residual of two rows (and one of the landmark's own). */
struct landmark {
    int size;
    std::vector<Rows> cross;
    std::vector<fv_coupling> couplings;
    double inverse[6], gradient[3];

    landmark(fv_random *random, problem *p, int at, int landmark_size,
             const std::vector<int> &blocks)
        : size(landmark_size)
    {
        MatrixXd own = MatrixXd::Identity(size, size);
        VectorXd g = VectorXd::Zero(size);
        const fv_normal n = p->normal();
        for (int b : blocks) {
            const double weight = 0.5 + fv_random_unit(random);
            const Rows J = random_matrix(random, 2, p->size[b]);
            const MatrixXd by_landmark = random_matrix(random, 2, size);
            const VectorXd e = random_matrix(random, 2, 1);
            Rows WJ = J;
            fv_block_weigh(J.data(), (int)J.size(), weight, WJ.data());
            fv_normal_add_one(&n, p->first[b], p->size[b], J.data(), WJ.data(), e.data(), 2, NULL);
            cross.push_back(by_landmark.transpose() * WJ);
            own += weight * by_landmark.transpose() * by_landmark;
            g -= weight * by_landmark.transpose() * e;
            MatrixXd all = MatrixXd::Zero(2, p->whole.cols());
            all.middleCols(p->first[b], p->size[b]) = J;
            all.middleCols(at, size) = by_landmark;
            p->whole += weight * all.transpose() * all;
            p->whole_g -= weight * all.transpose() * e;
        }
        p->whole.block(at, at, size, size) += MatrixXd::Identity(size, size);
        const MatrixXd V = own.inverse();
        for (int r = 0, k = 0; r < size; r++)
            for (int c = r; c < size; c++)
                inverse[k++] = V(r, c);
        for (int k = 0; k < size; k++)
            gradient[k] = g(k);
        for (size_t k = 0; k < blocks.size(); k++)
            couplings.push_back({cross[k].data(), p->first[blocks[k]], p->size[blocks[k]]});
    }
};

static void assert_near(const VectorXd &found, const VectorXd &expected, double bound)
{
    const double off = (found - expected).norm() / expected.norm();
    if (!(off < bound)) fail_msg("relative error %g, at most %g expected", off, bound);
}

static problem fused_problem(fv_random *random, std::vector<landmark> *landmarks)
{
    /* two keyframes with velocity and biases, two without, a similarity */
    problem p({6, 9, 6, 9, 6, 6, 7}, 20 * 3 + 20);
    p.add(random, 15, {0, 1, 2, 3}); /* inertial */
    p.add(random, 15, {3, 2});       /* prior */
    p.add(random, 7, {6, 4});        /* relative pose, its blocks in falling order */
    p.add(random, 7, {6});
    p.add(random, 3, {4, 5, 0}); /* wheel */
    p.add(random, 6, {5});
    for (int i = 0; i < 15; i++)
        landmarks->emplace_back(random, &p, p.reduced + 3 * i, 3, std::vector<int>{4, 0, 2, 5});
    for (int i = 15; i < 20; i++) /* as with rolling shutter, where velocity matters as well */
        landmarks->emplace_back(random, &p, p.reduced + 3 * i, 3, std::vector<int>{1, 4, 3, 0});
    for (int i = 0; i < 10; i++)
        landmarks->emplace_back(random, &p, p.reduced + 60 + i, 1, std::vector<int>{0, 5});
    for (int i = 10; i < 20; i++)
        landmarks->emplace_back(random, &p, p.reduced + 60 + i, 1, std::vector<int>{3, 2, 4});
    return p;
}

/* Poses, velocities and landmarks move as in the dense solution of everything. */
static void test_mixed_blocks_are_solved_as_by_eigen(void **)
{
    for (unsigned seed = 1; seed <= 20; seed++) {
        fv_random random;
        fv_random_seed(&random, seed);
        std::vector<landmark> landmarks;
        problem p = fused_problem(&random, &landmarks);
        const fv_normal n = p.normal();
        for (const landmark &l : landmarks)
            fv_normal_eliminate(&n, l.size, l.inverse, l.gradient, l.couplings.data(),
                                (int)l.couplings.size());
        std::vector<double> x((size_t)p.reduced);
        const VectorXd expected = p.whole.ldlt().solve(p.whole_g);
        assert_true(fv_normal_solve(&n, x.data()));
        VectorXd found(p.whole.cols());
        for (int k = 0; k < p.reduced; k++)
            found(k) = x[(size_t)k];
        int at = p.reduced;
        for (const landmark &l : landmarks) {
            double step[3];
            fv_landmark_step(l.size, l.inverse, l.gradient, l.couplings.data(),
                             (int)l.couplings.size(), x.data(), step);
            for (int k = 0; k < l.size; k++)
                found(at++) = step[k];
        }
        assert_near(found, expected, 1e-9);
    }
}

/* A landmark is eliminated in the same way whichever block is named first. */
static void test_order_of_couplings_does_not_matter(void **)
{
    fv_random random;
    fv_random_seed(&random, 3);
    problem p({6, 9, 6, 7}, 3);
    landmark l(&random, &p, p.reduced, 3, {0, 1, 2, 3});
    std::vector<double> H = p.H, g = p.g;
    const fv_normal first = p.normal(), second = {H.data(), g.data(), p.reduced};
    const fv_coupling turned[4] = {l.couplings[3], l.couplings[0], l.couplings[2], l.couplings[1]};
    fv_normal_eliminate(&first, 3, l.inverse, l.gradient, l.couplings.data(), 4);
    fv_normal_eliminate(&second, 3, l.inverse, l.gradient, turned, 4);
    for (int r = 0; r < p.reduced; r++)
        for (int c = 0; c <= r; c++)
            assert_true(p.H[(size_t)(r * p.reduced + c)] == H[(size_t)(r * p.reduced + c)]);
    assert_memory_equal(p.g.data(), g.data(), g.size() * sizeof g[0]);
}

/* Without g, as covariances need it, H is the same. */
static void test_gradient_may_be_left_out(void **)
{
    fv_random random, same;
    fv_random_seed(&random, 4);
    same = random;
    problem with({6, 9}, 0), without({6, 9}, 0);
    with.add(&random, 15, {0, 1});
    const MatrixXd W = random_weight(&same, 15);
    (void)random_matrix(&same, 15, 1);
    const Rows J0 = random_matrix(&same, 15, 6), J1 = random_matrix(&same, 15, 9), WJ0 = W * J0,
               WJ1 = W * J1;
    const fv_normal bare = {without.H.data(), NULL, 15};
    add_residual(&bare, {{J0.data(), WJ0.data(), 0, 6}, {J1.data(), WJ1.data(), 6, 9}}, NULL, 15);
    assert_memory_equal(with.H.data(), without.H.data(), with.H.size() * sizeof(double));
}

static void test_damping_is_a_fraction_of_the_diagonal(void **)
{
    fv_random random;
    fv_random_seed(&random, 5);
    problem p({6}, 0), q({6}, 0);
    const double fraction = 0.25;
    const fv_normal at_once = p.normal(), after = q.normal();
    for (int i = 0; i < 5; i++) {
        const Rows J = random_matrix(&random, 2, 6);
        const double e[2] = {1, -2};
        fv_normal_add_one(&at_once, 0, 6, J.data(), J.data(), e, 2, &fraction);
        fv_normal_add_one(&after, 0, 6, J.data(), J.data(), e, 2, NULL);
    }
    fv_normal_damp(&after, fraction, 0);
    assert_near(Eigen::Map<VectorXd>(p.H.data(), 36), Eigen::Map<VectorXd>(q.H.data(), 36), 1e-14);
    fv_normal_damp(&after, 0, 0.5);
    for (int k = 0; k < 6; k++)
        assert_true(fabs(q.H[(size_t)(7 * k)] - p.H[(size_t)(7 * k)] - 0.5) < 1e-12);
    const fv_damping rule = {0.1, 1e-3, 4, 0.5};
    assert_true(fv_damping_lower(&rule, 1) == 0.1 && fv_damping_lower(&rule, 5e-3) == 1e-3);
    assert_true(fv_damping_raise(&rule, 2) == 8.5);
}

/* Row by row or all rows at once: the same but for rounding. */
static void test_rows_may_be_added_one_by_one(void **)
{
    fv_random random;
    fv_random_seed(&random, 9);
    problem p({9, 6}, 0), q({9, 6}, 0);
    const fv_normal at_once = p.normal(), one_by_one = q.normal();
    for (int i = 0; i < 5; i++) {
        const Rows J = random_matrix(&random, 3, 6), WJ = 1.5 * J;
        const VectorXd e = random_matrix(&random, 3, 1);
        fv_normal_add_one(&at_once, 9, 6, J.data(), WJ.data(), e.data(), 3, NULL);
        fv_normal_add_rows(&one_by_one, 9, 6, J.data(), WJ.data(), e.data(), 3);
    }
    assert_near(q.reduced_matrix().reshaped(), p.reduced_matrix().reshaped(), 1e-14);
    assert_near(Eigen::Map<VectorXd>(q.g.data(), 15), Eigen::Map<VectorXd>(p.g.data(), 15), 1e-14);
}

static std::vector<double> random_system(fv_random *random, int n)
{
    const Rows root = random_matrix(random, n, n);
    const Rows A = root * root.transpose() + 0.01 * n * MatrixXd::Identity(n, n);
    return std::vector<double>(A.data(), A.data() + A.size());
}

/* However a factorisation is cut into units, down to single columns, its bits are the same. */
static void test_units_give_the_same_bits_as_one_go(void **)
{
    fv_random random;
    fv_random_seed(&random, 6);
    for (int n : {1, 6, 15, 73, (int)FV_NORMAL_SIZE_MAX}) {
        const std::vector<double> A = random_system(&random, n);
        std::vector<double> whole = A;
        assert_true(fv_ldlt_factor(whole.data(), n));
        for (int columns : {1, 2, 7, 50}) {
            std::vector<double> cut = A;
            for (int first = 0; first < n; first += columns)
                assert_true(fv_ldlt_columns(cut.data(), n, first,
                                            first + columns < n ? first + columns : n));
            assert_memory_equal(cut.data(), whole.data(), whole.size() * sizeof(double));
        }
    }
}

/* Variables in units of 1e-8 and 1e8 cost no digits. */
static void test_badly_scaled_systems_are_solved(void **)
{
    fv_random random;
    fv_random_seed(&random, 7);
    for (int n : {6, 15, 60}) {
        const std::vector<double> A = random_system(&random, n);
        std::vector<double> scaled = A, g((size_t)n), x((size_t)n), unit((size_t)n);
        for (int k = 0; k < n; k++) {
            unit[(size_t)k] = pow(10, 16 * fv_random_unit(&random) - 8);
            g[(size_t)k] = unit[(size_t)k] * fv_random_normal(&random);
        }
        VectorXd b(n), found(n);
        for (int r = 0; r < n; r++) {
            b(r) = g[(size_t)r] / unit[(size_t)r];
            for (int c = 0; c < n; c++)
                scaled[(size_t)(r * n + c)] *= unit[(size_t)r] * unit[(size_t)c];
        }
        const fv_normal normal = {scaled.data(), g.data(), n};
        assert_true(fv_normal_solve(&normal, x.data()));
        for (int k = 0; k < n; k++)
            found(k) = x[(size_t)k] * unit[(size_t)k];
        const MatrixXd M = Eigen::Map<const Rows>(A.data(), n, n);
        assert_near(found, M.ldlt().solve(b), 1e-9);
    }
}

/* False, and x as it was: nothing that is not a number comes back. */
static void test_singular_systems_are_refused(void **)
{
    fv_random random;
    fv_random_seed(&random, 8);
    enum { N = 21 };
    const double inf = std::numeric_limits<double>::infinity(), nan = NAN;
    const std::vector<double> good = random_system(&random, N);
    const Rows thin = random_matrix(&random, N, N - 1), deficient = thin * thin.transpose();
    for (int which = 0; which < 7; which++) {
        std::vector<double> A = good, g(N, 1), x(N, 3);
        if (which == 0) A.assign(N * N, 0);
        if (which == 1) A.assign(deficient.data(), deficient.data() + N * N);
        if (which == 2) A[N * 7 + 7] = -1;
        if (which == 3) A[N * 9 + 4] = nan;
        if (which == 4) A[N * 9 + 4] = inf;
        if (which == 5) A[N * 20 + 20] = inf;
        if (which == 6) g[5] = nan;
        std::vector<double> units = A;
        const fv_normal normal = {A.data(), g.data(), N};
        if (fv_normal_solve(&normal, x.data())) fail_msg("system %d is solved", which);
        for (double v : x)
            assert_true(v == 3);
        int column = 0;
        while (column < N && fv_ldlt_columns(units.data(), N, column, column + 1))
            column++;
        assert_true(which == 6 ? column == N : column < N);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_mixed_blocks_are_solved_as_by_eigen),
        cmocka_unit_test(test_order_of_couplings_does_not_matter),
        cmocka_unit_test(test_gradient_may_be_left_out),
        cmocka_unit_test(test_damping_is_a_fraction_of_the_diagonal),
        cmocka_unit_test(test_rows_may_be_added_one_by_one),
        cmocka_unit_test(test_units_give_the_same_bits_as_one_go),
        cmocka_unit_test(test_badly_scaled_systems_are_solved),
        cmocka_unit_test(test_singular_systems_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
