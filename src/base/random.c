/* xoshiro128++ 1.0 (Blackman and Vigna, "Scrambled linear pseudorandom number generators", ACM TOMS
 * 2021), its state filled by splitmix64 (Steele, Lea and Flood, OOPSLA 2014). */
#include "base/elementary.h"

static uint64_t splitmix(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static uint32_t rotate_left(uint32_t x, int by)
{
    return (x << by) | (x >> (32 - by));
}

void fv_random_seed(struct fv_random *random, uint64_t seed)
{
    uint64_t a = splitmix(&seed), b = splitmix(&seed);
    random->s[0] = (uint32_t)a;
    random->s[1] = (uint32_t)(a >> 32);
    random->s[2] = (uint32_t)b;
    random->s[3] = (uint32_t)(b >> 32);
    if (!(a | b)) /* the one state that never leaves itself */
        random->s[0] = 1;
}

uint32_t fv_random_u32(struct fv_random *random)
{
    uint32_t *s = random->s;
    uint32_t result = rotate_left(s[0] + s[3], 7) + s[0];
    uint32_t t = s[1] << 9;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = rotate_left(s[3], 11);
    return result;
}

uint32_t fv_random_below(struct fv_random *random, uint32_t bound)
{
    return (uint32_t)(((uint64_t)fv_random_u32(random) * bound) >> 32);
}

double fv_random_unit(struct fv_random *random)
{
    uint64_t high = fv_random_u32(random) >> 5, low = fv_random_u32(random) >> 6;
    return (double)((high << 26) | low) * 0x1p-53;
}

double fv_random_normal(struct fv_random *random)
{
    double radius = __builtin_sqrt(-2.0 * fv_log(1.0 - fv_random_unit(random)));
    return radius * fv_cos(2.0 * FV_PI * fv_random_unit(random));
}
