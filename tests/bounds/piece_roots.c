/* Of roots of polynomials. */
#include "geometry/polynomial.c"

#include "bounds/counter.h"
#include "bounds/pieces.h"

struct rooting {
    double coefficients[FV_POLYNOMIAL_DEGREE_MAX + 1], result;
};

static void step(void *context)
{
    struct rooting *r = context;
    double slope;
    r->result = value_and_slope(r->coefficients, FV_POLYNOMIAL_DEGREE_MAX, 0.3, &slope) / slope;
}

static void triple(void *context)
{
    struct rooting *r = context;
    r->result = fv_cubic_root(r->coefficients[2], r->coefficients[1], r->coefficients[0]);
}

void pieces_of_roots(struct fovea *rt)
{
    static struct rooting r;
    (void)rt;
    for (int k = 0; k <= FV_POLYNOMIAL_DEGREE_MAX; k++)
        r.coefficients[k] = 1.0 / (k + 1);
    NOTE(root_step, step, &r, 1);
    for (int n = 1; n < 200; n++) { /* a triple root, nearly */
        const double x = 0.37 * n;
        r.coefficients[2] = -3 * x;
        r.coefficients[1] = 3 * x * x + 1e-12 * (n % 3 - 1);
        r.coefficients[0] = -x * x * x;
        NOTE(cubic_root, triple, &r, 1);
    }
}
