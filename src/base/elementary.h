/* Elementary functions and random numbers that give the same bits on every machine, compiler and C
 * library.
 *
 * libm differs between processors and releases, so nothing that influences a result may use it.
 * These are made of IEEE-754 double additions, multiplications, divisions and integer operations
 * only, compiled without contraction. Accuracy against the exact value, over the whole stated
 * domain: at most 4e-16 relative (absolute near zeros of sin, cos and log). All are real-time safe
 * on any thread. */
#ifndef FOVEA_BASE_ELEMENTARY_H
#define FOVEA_BASE_ELEMENTARY_H

#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

#define FV_PI 3.14159265358979323846

/* |angle_rad| up to 1e6; beyond that, and for NaN, the result is 0 (sin) or 1 (cos). */
double fv_sin(double angle_rad);
double fv_cos(double angle_rad);
double fv_tan(double angle_rad);

/* As C's atan2 for finite arguments, with atan2(0, 0) = 0; result in [-pi, pi]. */
double fv_atan2(double y, double x);

/* exp: argument clamped to [-708, 709]. log: of the argument clamped to at least 2^-1022. */
double fv_exp(double exponent);
double fv_log(double positive);

/* base^exponent for base > 0 as exp(exponent log base): relative error grows with |exponent log
 * base| as usual. */
double fv_pow(double base, double exponent);

/* Largest integer value not above `value`, |value| < 2^51. */
double fv_floor(double value);
/* The float32 `steps` further from zero than x, which is not zero. */
static inline float fv_float_step(float x, int32_t steps)
{
    int32_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits += steps;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* `value`, or the end of [-most, most] that it lies beyond. */
static inline double fv_within(double value, double most)
{
    return value > most ? most : value < -most ? -most : value;
}

/* Seeded generator (xoshiro128++ 1.0 by Blackman and Vigna, public domain algorithm, seeded through
 * splitmix64). A plain struct, so that it lives in the state, is copied and replayed with it. */
struct fv_random {
    uint32_t s[4];
};

void fv_random_seed(struct fv_random *random, uint64_t seed);
uint32_t fv_random_u32(struct fv_random *random);
/* Uniform in [0, bound), unbiased up to 2^-32 (multiply-shift); bound >= 1. */
uint32_t fv_random_below(struct fv_random *random, uint32_t bound);
/* Uniform in [0, 1), 53 bits from two draws. */
double fv_random_unit(struct fv_random *random);
/* Standard normal (Box-Muller; two uniform draws per value). */
double fv_random_normal(struct fv_random *random);

#ifdef __cplusplus
}
#endif
#endif
