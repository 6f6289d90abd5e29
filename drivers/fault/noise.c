/* Noise of the sensor, new in each picture and independent in each byte: the sum of four uniform
 * bytes, whose distribution is near the normal one, scaled to the standard deviation. */
#include "fault.h"

#include "base/elementary.h"

enum { SHIFT = 16, HALF = 1 << (SHIFT - 1), MEAN = 510 };

static const double deviation = 147.80054127099804; /* of the sum: sqrt(4 (256^2 - 1) / 12) */

void fv_fault_noise(struct fv_fault_picture *picture)
{
    const size_t bytes =
        (size_t)picture->width * (size_t)picture->height * (size_t)picture->channels;
    const int32_t gain = (int32_t)(picture->options->amount / deviation * (1 << SHIFT) + 0.5);
    struct fv_random random;
    fv_random_seed(&random, picture->seed);
    for (size_t i = 0; i < bytes; i++) {
        const uint32_t u = fv_random_u32(&random);
        const int32_t sum = (int32_t)((u & 255) + (u >> 8 & 255) + (u >> 16 & 255) + (u >> 24));
        /* biased before the shift, so that it rounds alike below 0 */
        const int32_t value = (int32_t)picture->pixels[i] - 1024 +
                              (((sum - MEAN) * gain + HALF + (1024 << SHIFT)) >> SHIFT);
        picture->pixels[i] = (uint8_t)(value < 0 ? 0 : value > 255 ? 255 : value);
    }
}
