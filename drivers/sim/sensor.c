#include "sim.h"

/* Noise of a sensor: the sum of four random bytes is nearly normal (its ends lie at 3.4 standard
 * deviations). The bytes come from 64 generators side by side (xorshift32, Marsaglia 2003), so that
 * vectors can be used.
 */

enum { LANES = FV_SIM_SENSOR_LANES };

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

FV_WIDE static void expose(struct fv_sim_sensor *restrict sensor, const uint16_t *restrict linear,
                           int32_t count, uint8_t *restrict grey)
{
    const uint16_t gain = sensor->gain;
    const int16_t spread = sensor->spread;
    for (int32_t i = 0; i < count; i += LANES) {
        const int32_t n = count - i < LANES ? count - i : LANES;
        advance(sensor->state);
        for (int32_t j = 0; j < n; j++) {
            const uint32_t s = sensor->state[j];
            const int32_t sum =
                (int32_t)((s & 255u) + (s >> 8 & 255u) + (s >> 16 & 255u) + (s >> 24)) -
                MIDDLE_OF_BYTES;
            int32_t value = ((linear[i + j] * gain >> 8) + ((int16_t)sum * spread >> 8) + 128) >> 8;
            value = value < 0 ? 0 : value;
            grey[i + j] = (uint8_t)(value > 255 ? 255 : value);
        }
    }
}

void fv_sim_sensor_begin(struct fv_sim_sensor *sensor, double light, double noise, uint64_t seed)
{
    struct fv_random random;
    fv_random_seed(&random, seed);
    for (int32_t j = 0; j < LANES; j++)
        sensor->state[j] = fv_random_u32(&random) | 1u;
    sensor->gain = (uint16_t)(light * 256.0 + 0.5);
    sensor->spread = (int16_t)(noise * 256.0 * 256.0 / spread_of_bytes + 0.5);
}

void fv_sim_sensor_expose(struct fv_sim_sensor *sensor, const uint16_t *linear, int32_t count,
                          uint8_t *grey)
{
    expose(sensor, linear, count, grey);
}
