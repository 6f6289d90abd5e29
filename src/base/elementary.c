/* Elementary functions from additions, multiplications, divisions and integer operations alone.
 *
 * Every function reduces its argument to a small interval, where a Taylor series is cut so late
 * that the rest is below 2^-56 of the result, and evaluates the series so that the leading term is
 * added last. Reductions follow W. J. Cody and W. Waite, "Software Manual for the Elementary
 * Functions" (1980): constants are split so that the products with the small whole number are
 * exact. */
#include "base/elementary.h"

#include <string.h>

double fv_floor(double value)
{
    if (!(value > -0x1p51 && value < 0x1p51)) return value;
    double whole = (double)(int64_t)value;
    return whole > value ? whole - 1.0 : whole;
}

static double polynomial(const double *c, int count, double x)
{
    double sum = c[count - 1];
    for (int i = count - 2; i >= 0; i--)
        sum = sum * x + c[i];
    return sum;
}

/* ---- circle functions ------------------------------------------------------------------------ */

/* pi/2 in three parts: 33 bits, the next 33 bits, and 53 more. */
static const double half_pi_1 = 0x1.921fb544p+0, half_pi_2 = 0x1.0b4611a6p-34,
                    half_pi_3 = 0x1.3198a2e037073p-69;

/* angle = quadrant * pi/2 + rest + tail, |rest| <= pi/4 (a little more through rounding). Returns
 * quadrant mod 4. */
static int reduce_angle(double angle, double *rest, double *tail)
{
    double quadrant = fv_floor(angle * 0x1.45f306dc9c883p-1 + 0.5);
    double head = angle - quadrant * half_pi_1; /* both exact: 20 + 33 bits, then cancellation */
    double second = quadrant * half_pi_2;       /* exact */
    double r = head - second;
    double virtual_second = head - r; /* two-sum: what rounding took from r */
    double lost = (head - (r + virtual_second)) + (virtual_second - second);
    double t = lost - quadrant * half_pi_3;
    *rest = r + t;
    *tail = (r - *rest) + t;
    return (int)((int64_t)quadrant & 3);
}

/* 1/(2n+1)! and 1/(2n)!, alternating, from the cubic and the quartic term on. */
static const double sin_series[] = {-1.0 / 6,
                                    1.0 / 120,
                                    -1.0 / 5040,
                                    1.0 / 362880,
                                    -1.0 / 39916800,
                                    1.0 / 6227020800.0,
                                    -1.0 / 1307674368000.0,
                                    1.0 / 355687428096000.0};
static const double cos_series[] = {1.0 / 24,
                                    -1.0 / 720,
                                    1.0 / 40320,
                                    -1.0 / 3628800,
                                    1.0 / 479001600,
                                    -1.0 / 87178291200.0,
                                    1.0 / 20922789888000.0,
                                    -1.0 / 6402373705728000.0};

static double sin_small(double x, double tail)
{
    double z = x * x;
    return x + (x * z * polynomial(sin_series, 8, z) + tail * (1.0 - 0.5 * z));
}

static double cos_small(double x, double tail)
{
    double z = x * x, half = 0.5 * z;
    double one = 1.0 - half;
    return one + (((1.0 - one) - half) + (z * z * polynomial(cos_series, 8, z) - x * tail));
}

/* Sine of angle + shift * pi/2. */
static double sin_shifted(double angle, int shift)
{
    double rest, tail;
    int quadrant = (reduce_angle(angle, &rest, &tail) + shift) & 3;
    double value = quadrant & 1 ? cos_small(rest, tail) : sin_small(rest, tail);
    return quadrant & 2 ? -value : value;
}

double fv_sin(double angle_rad)
{
    return angle_rad >= -1e6 && angle_rad <= 1e6 ? sin_shifted(angle_rad, 0) : 0.0;
}

double fv_cos(double angle_rad)
{
    return angle_rad >= -1e6 && angle_rad <= 1e6 ? sin_shifted(angle_rad, 1) : 1.0;
}

double fv_tan(double angle_rad)
{
    return fv_sin(angle_rad) / fv_cos(angle_rad);
}

/* atan(k/4), k = 0..4, as head and tail, and pi/2 likewise. */
static const double atan_head[] = {0.0, 0x1.f5b75f92c80ddp-3, 0x1.dac670561bb4fp-2,
                                   0x1.4978fa3269ee1p-1, 0x1.921fb54442d18p-1};
static const double atan_tail[] = {0.0, 0x1.8ab6e3cf7afbdp-57, 0x1.a2b7f222f65e2p-56,
                                   0x1.2419a87f2a458p-56, 0x1.1a62633145c07p-55};
static const double half_pi_head = 0x1.921fb54442d18p+0, half_pi_tail = 0x1.1a62633145c07p-54;
static const double atan_series[] = {-1.0 / 3, 1.0 / 5,   -1.0 / 7, 1.0 / 9,  -1.0 / 11,
                                     1.0 / 13, -1.0 / 15, 1.0 / 17, -1.0 / 19};

double fv_atan2(double y, double x)
{
    double a = x < 0 ? -x : x, b = y < 0 ? -y : y;
    int swapped = b > a;
    double large = swapped ? b : a, small = swapped ? a : b;
    if (!(large > 0)) return 0.0;
    if (large > 0x1p1000) {
        large *= 0x1p-100;
        small *= 0x1p-100;
    } else if (large < 0x1p-900) {
        large *= 0x1p100;
        small *= 0x1p100;
    }
    /* atan(s/l) = atan(c) + atan((s - c l) / (l + c s)), with c the nearest quarter: |t| <= 1/8. */
    const double ratio = small / large;
    if (!(ratio <= 1)) return __builtin_nan(""); /* no number, or both infinite */
    int k = (int)(ratio * 4.0 + 0.5);
    double c = 0.25 * k;
    double t = (small - c * large) / (large + c * small), z = t * t;
    double rest = t + (t * z * polynomial(atan_series, 9, z) + atan_tail[k]), head = atan_head[k];
    if (swapped) {
        rest = half_pi_tail - rest;
        head = half_pi_head - head;
    }
    if (x < 0) {
        rest = 2 * half_pi_tail - rest;
        head = 2 * half_pi_head - head;
    }
    return y < 0 ? -(head + rest) : head + rest;
}

/* ---- exponential and logarithm --------------------------------------------------------------- */

static const double ln2_head = 0x1.62e42feep-1, ln2_tail = 0x1.a39ef35793c76p-33;
static const double exp_series[] = {
    1.0 / 6,      1.0 / 24,      1.0 / 120,      1.0 / 720,       1.0 / 5040,        1.0 / 40320,
    1.0 / 362880, 1.0 / 3628800, 1.0 / 39916800, 1.0 / 479001600, 1.0 / 6227020800.0};

double fv_exp(double exponent)
{
    double x = exponent > 709.0 ? 709.0 : exponent >= -708.0 ? exponent : -708.0;
    double k = fv_floor(x * 0x1.71547652b82fep+0 + 0.5);
    double head = x - k * ln2_head, tail = k * ln2_tail, r = head - tail;
    double lost = (head - r) - tail;
    double z = r * r;
    double fraction = 1.0 + (r + (0.5 * z + (z * r * polynomial(exp_series, 11, r) + lost)));
    uint64_t bits = (uint64_t)(1023 + (int64_t)k) << 52;
    double scale;
    memcpy(&scale, &bits, sizeof scale);
    return fraction * scale;
}

/* 2/(2n+1), n = 1..: log((1+s)/(1-s)) = 2 s + s (2/3 s^2 + 2/5 s^4 + ...). */
static const double log_series[] = {2.0 / 3,  2.0 / 5,  2.0 / 7,  2.0 / 9,  2.0 / 11, 2.0 / 13,
                                    2.0 / 15, 2.0 / 17, 2.0 / 19, 2.0 / 21, 2.0 / 23};

double fv_log(double positive)
{
    double x = positive >= 0x1p-1022 ? positive : 0x1p-1022;
    if (x > 0x1.fffffffffffffp1023) x = 0x1.fffffffffffffp1023;
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    /* x = 2^k m with m in [sqrt(1/2), sqrt(2)). */
    int64_t k = (int64_t)((bits + (0x3ff0000000000000u - 0x3fe6a09e667f3bcdu)) >> 52) - 1023;
    bits -= (uint64_t)k << 52;
    double m;
    memcpy(&m, &bits, sizeof m);
    double f = m - 1.0, s = f / (2.0 + f), z = s * s;
    double half = 0.5 * f * f;
    double series = z * polynomial(log_series, 11, z);
    double whole = (double)k;
    return whole * ln2_head - ((half - (s * (half + series) + whole * ln2_tail)) - f);
}

double fv_pow(double base, double exponent)
{
    return fv_exp(exponent * fv_log(base));
}
