/* Similarities: the group's own laws, and alignment of landmarks known to two cameras against
 * synthetic truth. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "geometry/pose.h"
#include "geometry/sim3.h"
#include "geometry/vec.h"

enum { CORRESPONDENCES = 120 };
static const double focal_px = 450, limit = 9.21;

static double uniform(struct fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

static void random_step(struct fv_random *random, double size, double x[7])
{
    for (int i = 0; i < 7; i++)
        x[i] = size * uniform(random, -1, 1);
}

static double difference(const struct fv_sim3 *A, const struct fv_sim3 *B)
{
    double worst = fabs(A->s - B->s);
    for (int i = 0; i < 9; i++)
        worst = fmax(worst, fabs(A->R[i] - B->R[i]));
    for (int i = 0; i < 3; i++)
        worst = fmax(worst, fabs(A->t[i] - B->t[i]));
    return worst;
}

/* exp is a homomorphism along each direction, log its inverse; from steps of 1e-9 to large ones,
 * mixed with pure rotation, pure scale and pure translation. */
static void test_exponential(void **context)
{
    (void)context;
    struct fv_random random;
    fv_random_seed(&random, 11);
    for (int n = 0; n < 2000; n++) {
        double x[7], half[7], back[7];
        random_step(&random, pow(10, uniform(&random, -9, 0.3)), x);
        if (n % 5 == 1) x[3] = x[4] = x[5] = 0;
        if (n % 5 == 2) x[6] = 0;
        if (n % 5 == 3) x[6] *= 1e-4;
        if (n % 5 == 4) x[3] *= 1e-5, x[4] *= 1e-5, x[5] *= 1e-5;
        for (int i = 0; i < 7; i++)
            half[i] = x[i] / 2;
        struct fv_sim3 S, H, twice;
        fv_sim3_exp(x, &S);
        fv_sim3_exp(half, &H);
        fv_sim3_compose(&H, &H, &twice);
        assert_true(difference(&S, &twice) < 1e-11);
        fv_sim3_log(&S, back);
        double size = 0, off = 0;
        for (int i = 0; i < 7; i++) {
            size += x[i] * x[i];
            off += (back[i] - x[i]) * (back[i] - x[i]);
        }
        assert_true(sqrt(off) < 1e-8 * sqrt(size) + 1e-14);
    }
}

/* The matrix of the exponential is the limit of many small steps. */
static void test_exponential_by_steps(void **context)
{
    (void)context;
    const double x[7] = {0.7, -0.4, 1.1, 0.5, 0.9, -0.3, 0.6};
    double small[7];
    for (int i = 0; i < 7; i++)
        small[i] = x[i] / 1048576;
    struct fv_sim3 S, step;
    fv_sim3_exp(x, &S);
    fv_so3_exp(small + 3, step.R); /* to first order, the translation as it is */
    memcpy(step.t, small, sizeof step.t);
    step.s = fv_exp(small[6]);
    for (int k = 0; k < 20; k++)
        fv_sim3_compose(&step, &step, &step);
    assert_true(difference(&S, &step) < 1e-5);
}

static void test_group(void **context)
{
    (void)context;
    struct fv_random random;
    fv_random_seed(&random, 5);
    for (int n = 0; n < 200; n++) {
        double x[7], y[7], p[3] = {uniform(&random, -3, 3), 1, 2}, q[3], r[3];
        struct fv_sim3 A, B, C, I, one;
        random_step(&random, 1, x);
        random_step(&random, 1, y);
        fv_sim3_exp(x, &A);
        fv_sim3_exp(y, &B);
        fv_sim3_compose(&A, &B, &C);
        fv_sim3_apply(&B, p, q);
        fv_sim3_apply(&A, q, q);
        fv_sim3_apply(&C, p, r);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(q[i] - r[i]) < 1e-12);
        fv_sim3_invert(&A, &I);
        fv_sim3_compose(&A, &I, &C);
        fv_sim3_identity(&one);
        assert_true(difference(&C, &one) < 1e-12);

        /* A camera's pose follows its world: points are seen in the same direction, further by the
         * scale. */
        struct fv_se3 T, moved;
        fv_so3_exp(y + 3, T.R);
        fv_copy3(y, T.t);
        moved = T;
        fv_sim3_move_pose(&A, &moved);
        double seen[3], seen_moved[3];
        fv_se3_apply(&T, p, seen);
        fv_sim3_apply(&A, p, q);
        fv_se3_apply(&moved, q, seen_moved);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(seen_moved[i] - A.s * seen[i]) < 1e-11);
    }
}

/* ---- alignment ------------------------------------------------------------------------------- */

static void look(const double p[3], struct fv_random *random, double noise_px, double bearing[3],
                 double A[6])
{
    double x = p[0] / p[2] + noise_px * fv_random_normal(random) / focal_px,
           y = p[1] / p[2] + noise_px * fv_random_normal(random) / focal_px,
           n = sqrt(x * x + y * y + 1), f = focal_px * n;
    const double b[3] = {x / n, y / n, 1 / n}, J[6] = {f, 0, -f * x, 0, f, -f * y};
    memcpy(bearing, b, sizeof b);
    memcpy(A, J, sizeof J);
}

static void make_correspondences(struct fv_random *random, double outliers, double noise_px,
                                 double distance_sigma, const struct fv_sim3 *S_a_b,
                                 struct fv_correspondence *correspondences)
{
    struct fv_sim3 S_b_a;
    fv_sim3_invert(S_a_b, &S_b_a);
    for (int i = 0; i < CORRESPONDENCES; i++) {
        struct fv_correspondence *m = &correspondences[i];
        memset(m, 0, sizeof *m);
        double depth = uniform(random, 2, 8);
        const double p[3] = {depth * uniform(random, -0.5, 0.5), depth * uniform(random, -0.4, 0.4),
                             depth};
        fv_copy3(p, m->point_a);
        fv_sim3_apply(&S_b_a, p, m->point_b);
        look(m->point_a, random, noise_px, m->bearing_a, m->A_a);
        look(m->point_b, random, noise_px, m->bearing_b, m->A_b);
        m->weight_a = m->weight_b = 1;
        m->sigma_a = m->sigma_b = distance_sigma;
        const double longer_a = 1 + distance_sigma * fv_random_normal(random),
                     longer_b = 1 + distance_sigma * fv_random_normal(random);
        for (int k = 0; k < 3; k++) { /* landmarks are off as well, along the ray */
            m->point_a[k] *= longer_a;
            m->point_b[k] *= longer_b;
        }
        if (i < outliers * CORRESPONDENCES) {
            const double other[3] = {uniform(random, -3, 3), uniform(random, -3, 3),
                                     uniform(random, 2, 8)};
            fv_copy3(other, m->point_b);
            look(other, random, noise_px, m->bearing_b, m->A_b);
        }
    }
}

static void random_similarity(struct fv_random *random, struct fv_sim3 *S)
{
    double x[7];
    random_step(random, 0.3, x);
    x[6] *= 4; /* scales of 0.3 to 3.3 */
    fv_sim3_exp(x, S);
}

static void test_alignment_exact(void **context)
{
    (void)context;
    struct fv_random random;
    fv_random_seed(&random, 21);
    for (int n = 0; n < 200; n++) {
        struct fv_sim3 truth, found;
        double a[6][3], b[6][3];
        random_similarity(&random, &truth);
        for (int i = 0; i < 6; i++) {
            for (int k = 0; k < 3; k++)
                b[i][k] = uniform(&random, -2, 2);
            fv_sim3_apply(&truth, b[i], a[i]);
        }
        assert_true(
            fv_sim3_align((const double(*)[3])a, (const double(*)[3])b, n % 2 ? 3 : 6, &found));
        assert_true(difference(&truth, &found) < 1e-8);
        for (int i = 0; i < 6; i++) /* on a line there is no answer */
            for (int k = 0; k < 3; k++)
                b[i][k] = i * (k + 1.0);
        assert_false(fv_sim3_align((const double(*)[3])a, (const double(*)[3])b, 6, &found));
    }
}

static void test_search_and_refinement(void **context)
{
    (void)context;
    const double fractions[] = {0, 0.3, 0.5};
    struct fv_random random;
    fv_random_seed(&random, 3);
    static struct fv_correspondence correspondences[CORRESPONDENCES];
    for (int n = 0; n < 90; n++) {
        struct fv_sim3 truth, found, off, inverse;
        double fraction = fractions[n % 3], x[7];
        random_similarity(&random, &truth);
        make_correspondences(&random, fraction, 0.7, 0.005, &truth, correspondences);
        struct fv_sim3_search search;
        fv_sim3_search_begin(&search, 300);
        while (fv_sim3_search_more(&search, correspondences, CORRESPONDENCES, 7, limit, &random))
            ;
        assert_true(search.best_inliers > 0.5 * (1 - fraction) * CORRESPONDENCES);
        found = search.best;
        for (int i = 0; i < CORRESPONDENCES; i++) {
            double square[2];
            fv_sim3_invert(&found, &inverse);
            correspondences[i].inlier =
                fv_sim3_errors(&correspondences[i], &found, &inverse, square) &&
                square[0] < limit && square[1] < limit;
        }
        uint32_t inliers = 0;
        for (int round = 0; round < 3; round++)
            inliers = fv_sim3_refine(correspondences, CORRESPONDENCES, limit, 4, false, &found);
        assert_true(inliers >= 0.85 * (1 - fraction) * CORRESPONDENCES);
        for (int i = 0; i < fraction * CORRESPONDENCES; i++)
            if (correspondences[i].inlier) inliers--;
        assert_true(inliers >=
                    0.85 * (1 - fraction) * CORRESPONDENCES); /* few outliers among them */
        fv_sim3_invert(&truth, &inverse);
        fv_sim3_compose(&inverse, &found, &off);
        fv_sim3_log(&off, x);
        assert_true(fabs(x[6]) < 0.003);
        assert_true(sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5]) < 0.003);
        assert_true(sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) < 0.015 * 5 / truth.s);
    }
}

/* Between maps of one unit the scale is not touched, and the motion is that which fits best with
 * it, also from a first guess with another. */
static void test_rigid_refinement(void **context)
{
    (void)context;
    struct fv_random random;
    fv_random_seed(&random, 5);
    static struct fv_correspondence correspondences[CORRESPONDENCES];
    for (int n = 0; n < 30; n++) {
        struct fv_sim3 truth, found, off, inverse;
        double x[7];
        random_similarity(&random, &truth);
        truth.s = 1;
        make_correspondences(&random, 0, 0.7, 0.005, &truth, correspondences);
        for (int i = 0; i < CORRESPONDENCES; i++)
            correspondences[i].inlier = true;
        found = truth;
        found.s = 1.05;
        assert_true(fv_sim3_refine(correspondences, CORRESPONDENCES, limit, 4, true, &found) >
                    0.85 * CORRESPONDENCES);
        assert_true(found.s == 1);
        fv_sim3_invert(&truth, &inverse);
        fv_sim3_compose(&inverse, &found, &off);
        fv_sim3_log(&off, x);
        assert_true(sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5]) < 0.003);
        assert_true(sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) < 0.015 * 5);
    }
}

/* Errors of a camera that stands one unit beside the other: a point 4 units away that is 10 % too
 * far off along the other's ray is 10 px off here, which is two standard deviations if its distance
 * is known to 5 %. */
static void test_errors_along_the_ray(void **context)
{
    (void)context;
    const double in_a[3] = {1, 0, 4}, in_b[3] = {0, 0, 4}, further = 1.1, aside_b[3] = {0, 0.1, 4};
    struct fv_random random;
    struct fv_sim3 S_a_b, S_b_a;
    struct fv_correspondence exact = {.sigma_a = 0.05,
                                      .sigma_b = 0.05,
                                      .weight_a = 1,
                                      .weight_b = 1},
                             m;
    double square[2];
    fv_sim3_identity(&S_a_b);
    S_a_b.t[0] = 1;
    fv_sim3_invert(&S_a_b, &S_b_a);
    fv_random_seed(&random, 1);
    fv_copy3(in_a, exact.point_a);
    fv_copy3(in_b, exact.point_b);
    look(in_a, &random, 0, exact.bearing_a, exact.A_a);
    look(in_b, &random, 0, exact.bearing_b, exact.A_b);
    assert_true(fv_sim3_errors(&exact, &S_a_b, &S_b_a, square) && square[0] < 1e-12 &&
                square[1] < 1e-12);
    m = exact;
    for (int k = 0; k < 3; k++) {
        m.point_a[k] *= further;
        m.point_b[k] *= further;
    }
    assert_true(fv_sim3_errors(&m, &S_a_b, &S_b_a, square));
    assert_true(square[0] > 3 && square[0] < 4.2 && square[1] > 3 && square[1] < 4.2);
    m.sigma_a = m.sigma_b =
        0; /* where the points are said to be exact, each counts with all its pixels */
    assert_true(fv_sim3_errors(&m, &S_a_b, &S_b_a, square));
    assert_true(square[0] > 60 && square[1] > 60);
    m = exact;
    fv_copy3(aside_b, m.point_b); /* not along its ray: nothing is forgiven */
    assert_true(fv_sim3_errors(&m, &S_a_b, &S_b_a, square) && square[0] > 80);
    m = exact;
    memset(m.bearing_b, 0, sizeof m.bearing_b); /* not seen by b at all */
    memset(m.A_b, 0, sizeof m.A_b);
    m.weight_b = 0;
    assert_true(fv_sim3_errors(&m, &S_a_b, &S_b_a, square) && square[0] < 1e-12 && square[1] == 0);
}

/* What is said of the rotation's error, against the errors made: where landmarks are where they are
 * said to be, and where their distances are as vague as after little parallax. */
static void test_certainty_of_turn(void **context)
{
    (void)context;
    enum { ROUNDS = 100 };
    static const double distance_sigmas[] = {0.005, 0.03, 0.05};
    struct fv_random random;
    static struct fv_correspondence correspondences[CORRESPONDENCES];
    struct fv_sim3 truth, found, off;
    struct fv_sim3_certainty certainty;
    double said = 0, made = 0, x[7];
    fv_random_seed(&random, 17);
    for (int n = 0; n < 3 * ROUNDS; n++) {
        if (n % ROUNDS == 0) said = made = 0;
        random_similarity(&random, &truth);
        make_correspondences(&random, 0, 1, distance_sigmas[n / ROUNDS], &truth, correspondences);
        for (int i = 0; i < CORRESPONDENCES; i++)
            correspondences[i].inlier = true;
        found = truth;
        (void)fv_sim3_refine(correspondences, CORRESPONDENCES, limit, 6, false, &found);
        fv_sim3_judge(correspondences, CORRESPONDENCES, &found, &certainty);
        said += certainty.turn_sigma * certainty.turn_sigma / ROUNDS;
        fv_sim3_invert(&truth, &truth);
        fv_sim3_compose(&truth, &found, &off);
        fv_sim3_log(&off, x);
        made += (x[3] * x[3] + x[4] * x[4] + x[5] * x[5]) / ROUNDS;
        if (n % ROUNDS != ROUNDS - 1) continue;
        print_message("turn off by %.5f rad, %.5f said\n", sqrt(made), sqrt(said));
        assert_true(made < 2.25 * said && said < 2.25 * made);
    }
    for (int i = 0; i < CORRESPONDENCES; i++) /* in one direction alone */
        correspondences[i].inlier =
            fabs(correspondences[i].point_a[0]) < 0.1 * correspondences[i].point_a[2];
    fv_sim3_judge(correspondences, CORRESPONDENCES, &found, &certainty);
    assert_true(certainty.turn_sigma > 2 * sqrt(said));
    for (int i = 3; i < CORRESPONDENCES; i++)
        correspondences[i].inlier = false;
    correspondences[0].inlier = correspondences[1].inlier = false;
    fv_sim3_judge(correspondences, CORRESPONDENCES, &found, &certainty);
    assert_true(certainty.turn_sigma > 1);
}

/* Of a rigid motion: which scale the landmarks would rather have, within what is said of it. */
static void test_certainty_of_scale(void **context)
{
    (void)context;
    enum { ROUNDS = 100 };
    static const double distance_sigmas[] = {0.005, 0.03}, factors[] = {1, 0.97, 1.08};
    struct fv_random random;
    static struct fv_correspondence correspondences[CORRESPONDENCES];
    fv_random_seed(&random, 23);
    for (int kind = 0; kind < 6; kind++) {
        const double factor = factors[kind % 3], sigma = distance_sigmas[kind / 3];
        double square = 0, said = 0, mean = 0;
        for (int n = 0; n < ROUNDS; n++) {
            struct fv_sim3 truth, found;
            struct fv_sim3_certainty certainty;
            random_similarity(&random, &truth);
            truth.s = factor;
            make_correspondences(&random, 0, 1, sigma, &truth, correspondences);
            for (int i = 0; i < CORRESPONDENCES; i++)
                correspondences[i].inlier = true;
            found = truth;
            (void)fv_sim3_refine(correspondences, CORRESPONDENCES, 1e300, 6, true, &found);
            assert_true(found.s == 1);
            fv_sim3_judge(correspondences, CORRESPONDENCES, &found, &certainty);
            const double off = certainty.log_scale - log(factor);
            square += off * off / ROUNDS;
            mean += certainty.log_scale / ROUNDS;
            said += certainty.scale_sigma * certainty.scale_sigma / ROUNDS;
        }
        print_message("log scale %.4f: found %.4f, off by %.5f, %.5f said\n", log(factor), mean,
                      sqrt(square), sqrt(said));
        assert_true(fabs(mean - log(factor)) < 0.2 * fabs(log(factor)) + 0.5 * sqrt(said));
        if (factor == 1) assert_true(square < 2.25 * said && said < 2.25 * square);
        if (factor > 1) assert_true(mean > 3 * sqrt(said));
    }
    for (int i = 0; i < CORRESPONDENCES; i++)
        correspondences[i].inlier = false;
    struct fv_sim3 none;
    struct fv_sim3_certainty certainty;
    fv_sim3_identity(&none);
    fv_sim3_judge(correspondences, CORRESPONDENCES, &none, &certainty);
    assert_true(certainty.log_scale == 0 && certainty.scale_sigma > 1e300);
}

/* Gravity of the one is that of the other to the last bit but rounding, also where it is wrong by
 * a degree; what that leaves open is found, from wherever it begins. */
static void test_level_relation(void **context)
{
    (void)context;
    struct fv_random random;
    fv_random_seed(&random, 29);
    static struct fv_correspondence correspondences[CORRESPONDENCES];
    for (int n = 0; n < 40; n++) {
        const bool rigid = n % 2 != 0, wrong = n % 4 > 1;
        struct fv_sim3 truth, found, off, inverse;
        double x[7], b[3], a[3], is[3], tilt[9], turn[3];
        random_similarity(&random, &truth);
        if (rigid) truth.s = 1;
        make_correspondences(&random, 0, 0.7, 0.005, &truth, correspondences);
        for (int i = 0; i < 3; i++) {
            b[i] = fv_random_normal(&random);
            turn[i] = 0.01 * fv_random_normal(&random);
        }
        (void)fv_normalise3(b);
        fv_rotate3(truth.R, b, a);
        fv_so3_exp(turn, tilt);
        if (wrong) {
            fv_rotate3(tilt, a, is);
            fv_copy3(is, a);
        }
        for (int i = 0; i < CORRESPONDENCES; i++)
            correspondences[i].inlier = true;
        found = truth;
        fv_multiply33(tilt, truth.R, found.R);
        assert_true(fv_sim3_level(correspondences, CORRESPONDENCES, 30, rigid, a, b, &found));
        assert_true(rigid == (found.s == 1));
        fv_rotate3(found.R, b, is);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(is[i] - a[i]) < 1e-12);
        struct fv_sim3 again = truth; /* from another turn about it, and place */
        for (int i = 0; i < 3; i++) {
            turn[i] = 0.02 * a[i];
            again.t[i] += 0.05;
        }
        fv_so3_exp(turn, tilt);
        fv_multiply33(tilt, truth.R, again.R);
        assert_true(fv_sim3_level(correspondences, CORRESPONDENCES, 30, rigid, a, b, &again));
        fv_sim3_invert(&again, &inverse);
        fv_sim3_compose(&inverse, &found, &off);
        fv_sim3_log(&off, x);
        for (int i = 0; i < 7; i++)
            if (!(fabs(x[i]) < 1e-4)) fail_msg("%d: x[%d] %g", n, i, x[i]);
        if (wrong) continue;
        fv_sim3_invert(&truth, &inverse);
        fv_sim3_compose(&inverse, &found, &off);
        fv_sim3_log(&off, x);
        assert_true(sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5]) < 0.003);
        assert_true(sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) < 0.015 * 5 / truth.s);
    }
}

/* What camera a makes of a relation: squared errors of its pixels and of how far its points are. */
static double cost_in_a(const struct fv_correspondence *m, const struct fv_sim3 *S)
{
    double cost = 0;
    for (int i = 0; i < CORRESPONDENCES; i++) {
        double q[3], e[2] = {0, 0}, J[6];
        fv_sim3_apply(S, m[i].point_b, q);
        assert_true(fv_observation_error(m[i].bearing_a, m[i].A_a, q, e, J));
        const double off = (fv_dot3(m[i].bearing_a, q) / fv_norm3(m[i].point_a) - 1) / m[i].sigma_a;
        cost += m[i].weight_a * (e[0] * e[0] + e[1] * e[1]) + off * off;
    }
    return cost;
}

/* By how much of x the best relation along it is away. */
static double away(const struct fv_correspondence *m, const struct fv_sim3 *S, const double x[7])
{
    double back[7];
    struct fv_sim3 step, more, less;
    for (int k = 0; k < 7; k++)
        back[k] = -x[k];
    fv_sim3_exp(x, &step);
    fv_sim3_compose(&step, S, &more);
    fv_sim3_exp(back, &step);
    fv_sim3_compose(&step, S, &less);
    const double up = cost_in_a(m, &more), down = cost_in_a(m, &less);
    return (down - up) / 2 / (up + down - 2 * cost_in_a(m, S));
}

/* Of all relations that are level: where gravity contradicts the pictures, too. Small errors, so
 * that none has less weight, in one camera, whose other knows its points. */
static void test_level_relation_is_the_best(void **context)
{
    (void)context;
    struct fv_random random;
    fv_random_seed(&random, 31);
    static struct fv_correspondence correspondences[CORRESPONDENCES];
    for (int n = 0; n < 20; n++) {
        const double tilts[3] = {1e-3, -1e-3, 5e-4};
        struct fv_sim3 truth, found;
        double b[3], a[3], is[3], tilt[9];
        random_similarity(&random, &truth);
        make_correspondences(&random, 0, 0.05, 0.0005, &truth, correspondences);
        for (int i = 0; i < CORRESPONDENCES; i++) {
            correspondences[i].inlier = true;
            correspondences[i].weight_a = 0.01;
            correspondences[i].weight_b = 0;
            correspondences[i].sigma_a = 0.01;
            correspondences[i].sigma_b = 1e-9;
        }
        for (int i = 0; i < 3; i++)
            b[i] = fv_random_normal(&random);
        (void)fv_normalise3(b);
        fv_rotate3(truth.R, b, is);
        fv_so3_exp(tilts, tilt);
        fv_rotate3(tilt, is, a);
        found = truth;
        assert_true(fv_sim3_level(correspondences, CORRESPONDENCES, 20, false, a, b, &found));
        for (int k = 0; k < 5; k++) { /* translation, turn about gravity, scale */
            double x[7] = {0};
            if (k < 3) x[k] = 1e-3;
            for (int i = 0; i < 3 && k == 3; i++)
                x[3 + i] = 1e-3 * a[i];
            if (k == 4) x[6] = 1e-3;
            const double by = away(correspondences, &found, x);
            if (!(fabs(by) < 0.01)) fail_msg("%d: %g of %d", n, by, k);
        }
    }
}

/* Chance alone does not make a similarity. */
static void test_search_without_truth(void **context)
{
    (void)context;
    struct fv_random random;
    struct fv_sim3 truth;
    static struct fv_correspondence correspondences[CORRESPONDENCES];
    fv_random_seed(&random, 8);
    fv_sim3_identity(&truth);
    for (int n = 0; n < 20; n++) {
        make_correspondences(&random, 1, 0.7, 0.02, &truth, correspondences);
        struct fv_sim3_search search;
        fv_sim3_search_begin(&search, 300);
        while (fv_sim3_search_more(&search, correspondences, CORRESPONDENCES, 40, limit, &random))
            ;
        assert_int_equal(search.done, 300);
        assert_true(search.best_inliers < 12);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exponential),
        cmocka_unit_test(test_exponential_by_steps),
        cmocka_unit_test(test_group),
        cmocka_unit_test(test_alignment_exact),
        cmocka_unit_test(test_search_and_refinement),
        cmocka_unit_test(test_level_relation),
        cmocka_unit_test(test_level_relation_is_the_best),
        cmocka_unit_test(test_rigid_refinement),
        cmocka_unit_test(test_errors_along_the_ray),
        cmocka_unit_test(test_certainty_of_turn),
        cmocka_unit_test(test_certainty_of_scale),
        cmocka_unit_test(test_search_without_truth),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
