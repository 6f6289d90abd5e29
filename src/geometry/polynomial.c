#include "geometry/polynomial.h"

#include "geometry/vec.h"

static double value(const double *c, int degree, double x)
{
    double v = c[degree];
    for (int i = degree - 1; i >= 0; i--)
        v = v * x + c[i];
    return v;
}

static double value_and_slope(const double *c, int degree, double x, double *slope)
{
    double v = c[degree], s = 0;
    for (int i = degree - 1; i >= 0; i--) {
        s = s * x + v;
        v = v * x + c[i];
    }
    *slope = s;
    return v;
}

/* The root between low and high, where the signs differ. `tolerance` is relative to 1 + |x|. */
static double bracketed_root(const double *c, int degree, double low, double high, double at_low,
                             double tolerance)
{
    double x = 0.5 * (low + high), before = high - low;
    for (int i = 0; i < 60; i++) {
        double slope, v = value_and_slope(c, degree, x, &slope);
        if (v == 0) return x;
        if ((v > 0) == (at_low > 0))
            low = x;
        else
            high = x;
        double next = x - v / slope;
        /* Newton's iteration creeps far from the root of a high power: then halve. */
        if (!(next > low && next < high) || fv_abs(next - x) > 0.5 * before)
            next = 0.5 * (low + high);
        double step = fv_abs(next - x);
        before = step;
        x = next;
        if (step <= tolerance * (1 + fv_abs(x))) break;
    }
    return x;
}

int fv_polynomial_roots(const double *coefficients, int degree, double low, double high,
                        double *roots)
{
    /* Derivatives, scaled so that coefficients stay of the same order; row d has degree d. */
    double derivative[FV_POLYNOMIAL_DEGREE_MAX + 1][FV_POLYNOMIAL_DEGREE_MAX + 1];
    for (int i = 0; i <= degree; i++)
        derivative[degree][i] = coefficients[i];
    for (int d = degree - 1; d >= 1; d--)
        for (int i = 0; i <= d; i++)
            derivative[d][i] = derivative[d + 1][i + 1] * (i + 1) / (d + 1);
    double splits[FV_POLYNOMIAL_DEGREE_MAX + 2];
    int count = 0;
    for (int d = 1; d <= degree; d++) {
        const double *c = derivative[d];
        double tolerance = d == degree ? 1e-14 : 1e-9, found[FV_POLYNOMIAL_DEGREE_MAX + 2];
        double left = low, at_left = value(c, d, left);
        int roots_found = 0;
        for (int i = 0; i <= count; i++) {
            double right = i < count ? splits[i] : high, at_right = value(c, d, right);
            if ((at_left > 0) != (at_right > 0))
                found[roots_found++] = bracketed_root(c, d, left, right, at_left, tolerance);
            left = right;
            at_left = at_right;
        }
        count = roots_found;
        for (int i = 0; i < count; i++)
            splits[i] = found[i];
    }
    for (int i = 0; i < count; i++)
        roots[i] = splits[i];
    return count;
}

double fv_cubic_root(double b, double c, double d)
{
    /* Start on the outer side of the extremum that faces the root, where Newton's iteration is
     * monotone. */
    double discriminant = b * b - 3 * c, x;
    if (discriminant >= 0) {
        double width = __builtin_sqrt(discriminant), left = (-b - width) / 3,
               right = (-b + width) / 3;
        double at_left = ((left + b) * left + c) * left + d;
        x = at_left > 0 ? left - 1.2 * width / 3 : right + 1.2 * width / 3;
        /* The single root beyond the extrema, or the outer one of three. */
        if (at_left > 0 && ((x + b) * x + c) * x + d > 0) x = left - width;
        if (at_left <= 0 && ((x + b) * x + c) * x + d < 0) x = right + width;
    } else {
        x = -b / 3;
        double slope = (3 * x + 2 * b) * x + c, v = ((x + b) * x + c) * x + d;
        x -= v / slope;
    }
    for (int i = 0; i < 50; i++) {
        double v = ((x + b) * x + c) * x + d, slope = (3 * x + 2 * b) * x + c;
        double step = slope != 0 ? v / slope : 0;
        x -= step;
        if (fv_abs(step) <= 1e-13 * fv_abs(x) + 1e-300) break;
    }
    return x;
}
