/* Real roots of polynomials in one variable. Coefficients run from the constant term up. Real-time
 * safe. */
#ifndef FOVEA_GEOMETRY_POLYNOMIAL_H
#define FOVEA_GEOMETRY_POLYNOMIAL_H

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_POLYNOMIAL_DEGREE_MAX = 10 };

/* All simple real roots of `coefficients[0..degree]` within [low, high], in rising order; returns
 * their number. Roots of a derivative split the axis where the polynomial is monotone, so every
 * root has a bracket of its own, in which Newton's iteration is kept. Double roots may be missed or
 * come out once. Bounded: at most 55 brackets of at most 60 steps. */
int fv_polynomial_roots(const double *coefficients, int degree, double low, double high,
                        double *roots);

/* One real root of x^3 + b x^2 + c x + d, the one with the steepest slope nearby (well
 * conditioned). */
double fv_cubic_root(double b, double c, double d);

#ifdef __cplusplus
}
#endif
#endif
