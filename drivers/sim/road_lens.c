#include "sim.h"

#include <string.h>

/* What lies between the road and the pixels: exposure that steps, dirt on the lens, and the light
 * that a low sun in front spreads over the picture. */

static double draw(struct fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

void fv_sim_road_lens_create(struct fv_sim_road *road, uint64_t seed)
{
    struct fv_random random;
    fv_random_seed(&random, seed ^ 0x1E45u);
    const bool steps = fv_random_below(&random, 2) == 0;
    double gain = draw(&random, 0.9, 1.5);
    for (int32_t i = 0; i < FV_SIM_ROAD_GAINS; i++) {
        const bool step = fv_random_below(&random, 3) == 0;
        const double factor = fv_random_below(&random, 2) == 0 ? 1.3 : 1 / 1.3;
        if (i > 0 && steps && step && gain * factor > 0.7 && gain * factor < 1.9) gain *= factor;
        road->gain[i] = gain;
    }
    road->glare = fv_random_below(&random, 2) == 0 ? draw(&random, 20, 70) : 0;
    road->dirty = fv_random_below(&random, 5) < 2;
    /* As the rounds are lit (scene.c), at a height of its own. */
    const double height = draw(&random, 0.15, 0.8), c = fv_cos(height);
    road->sun[0] = 0.8 * c;
    road->sun[1] = -0.6 * c;
    road->sun[2] = fv_sin(height);
}

double fv_sim_road_gain(const struct fv_sim_road *road, double time_s)
{
    const int32_t i = time_s < 0                    ? 0
                      : time_s >= FV_SIM_ROAD_GAINS ? FV_SIM_ROAD_GAINS - 1
                                                    : (int32_t)time_s;
    return road->gain[i];
}

int32_t fv_sim_road_veil(const struct fv_sim_road *road, const double T_world_cam[12])
{
    double along = 0;
    for (int32_t i = 0; i < 3; i++)
        along += road->sun[i] * T_world_cam[4 * i + 2];
    along = along > 0 ? along * along : 0;
    return (int32_t)(road->glare * along * along * 256);
}

/* Darken by a soft disc: `least` is left in its middle, 256ths. */
static void spot(uint8_t *dirt, int32_t width, int32_t height, const int32_t at[2], int32_t radius,
                 int32_t least)
{
    const int32_t square = radius * radius;
    for (int32_t y = at[1] - radius; y <= at[1] + radius; y++) {
        if (y < 0 || y >= height) continue;
        for (int32_t x = at[0] - radius; x <= at[0] + radius; x++) {
            if (x < 0 || x >= width) continue;
            const int32_t off = (x - at[0]) * (x - at[0]) + (y - at[1]) * (y - at[1]);
            if (off >= square) continue;
            uint8_t *p = &dirt[(size_t)y * (size_t)width + (size_t)x];
            const int32_t inner = 256 - off * 256 / square; /* soft to the edge */
            const int32_t kept = 256 - (256 - least) * inner / 256;
            *p = (uint8_t)(*p * kept >> 8);
        }
    }
}

void fv_sim_road_dirt(const struct fv_sim_road *road, uint64_t seed, int32_t width, int32_t height,
                      uint8_t *dirt)
{
    struct fv_random random;
    memset(dirt, 255, (size_t)width * (size_t)height);
    if (!road->dirty) return;
    fv_random_seed(&random, seed ^ 0xD127u);
    const uint32_t spots = 4 + fv_random_below(&random, 16);
    for (uint32_t i = 0; i < spots; i++) {
        const int32_t x = (int32_t)fv_random_below(&random, (uint32_t)width),
                      y = (int32_t)fv_random_below(&random, (uint32_t)height);
        const bool large = fv_random_below(&random, 3) == 0;
        const double share = large ? draw(&random, 0.04, 0.12) : draw(&random, 0.01, 0.03);
        const int32_t least = (int32_t)draw(&random, large ? 150 : 110, 230);
        const int32_t radius = (int32_t)(share * height) + 2;
        spot(dirt, width, height, (const int32_t[2]){x, y}, radius, least);
    }
}
