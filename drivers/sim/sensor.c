#include "sim.h"

/* Noise of a sensor: the sum of four random bytes is nearly normal (its ends lie at 3.4 standard deviations).
 * The bytes come from 64 generators side by side (xorshift32, Marsaglia 2003), so that vectors can be used.
 */

enum { LANES = 64 };

static void advance(uint32_t *restrict state)
{
    for (int32_t j = 0; j < LANES; j++) {
        uint32_t s = state[j];
        s ^= s << 13;
        s ^= s >> 17;
        s ^= s << 5;
        state[j] = s;
    }
}

void fv_sim_sensor(const uint16_t *linear, int32_t count, double light, double noise, uint64_t seed,
                   uint8_t *grey)
{
    uint32_t state[LANES];
    struct fovea_random random;
    fovea_random_seed(&random, seed);
    for (int32_t j = 0; j < LANES; j++)
        state[j] = fovea_random_u32(&random) | 1u;
    /* Linear is in 1/256 grey levels; the four bytes have a standard deviation of 147.8 about 510. */
    const uint16_t gain = (uint16_t)(light * 256.0 + 0.5);
    const int16_t spread = (int16_t)(noise * 256.0 * 256.0 / 147.8 + 0.5);
    for (int32_t i = 0; i < count; i += LANES) {
        const int32_t n = count - i < LANES ? count - i : LANES;
        advance(state);
        for (int32_t j = 0; j < n; j++) {
            const uint32_t s = state[j];
            const int32_t sum = (int32_t)((s & 255u) + (s >> 8 & 255u) + (s >> 16 & 255u) + (s >> 24)) - 510;
            int32_t value = ((linear[i + j] * gain >> 8) + ((int16_t)sum * spread >> 8) + 128) >> 8;
            value = value < 0 ? 0 : value;
            grey[i + j] = (uint8_t)(value > 255 ? 255 : value);
        }
    }
}
