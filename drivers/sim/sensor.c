#include "sim.h"

/* Noise of a sensor: the sum of four random bytes is nearly normal (its ends lie at 3.4 standard deviations).
 * The bytes come from 64 generators side by side (xorshift32, Marsaglia 2003), so that vectors can be used.
 */

enum { LANES = 64 };

FV_IN_WIDE void advance(uint32_t *restrict state)
{
    for (int32_t j = 0; j < LANES; j++) {
        uint32_t s = state[j];
        s ^= s << 13;
        s ^= s >> 17;
        s ^= s << 5;
        state[j] = s;
    }
}

/* The four bytes have a standard deviation of 147.8 about 510. */
static const double spread_of_bytes = 147.8;
enum { MIDDLE_OF_BYTES = 510 };

/* `linear` is in 1/256 grey levels, `gain` in 256ths, `spread` in 1/256 grey levels per 256 of the sum of bytes. */
FV_WIDE static void expose(const uint16_t *restrict linear, int32_t count, uint16_t gain, int16_t spread,
                           uint32_t *restrict state, uint8_t *restrict grey)
{
    for (int32_t i = 0; i < count; i += LANES) {
        const int32_t n = count - i < LANES ? count - i : LANES;
        advance(state);
        for (int32_t j = 0; j < n; j++) {
            const uint32_t s = state[j];
            const int32_t sum =
                (int32_t)((s & 255u) + (s >> 8 & 255u) + (s >> 16 & 255u) + (s >> 24)) - MIDDLE_OF_BYTES;
            int32_t value = ((linear[i + j] * gain >> 8) + ((int16_t)sum * spread >> 8) + 128) >> 8;
            value = value < 0 ? 0 : value;
            grey[i + j] = (uint8_t)(value > 255 ? 255 : value);
        }
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
    expose(linear, count, (uint16_t)(light * 256.0 + 0.5),
           (int16_t)(noise * 256.0 * 256.0 / spread_of_bytes + 0.5), state, grey);
}
