/* A step of the exposure: all brightness times a factor, cut off at the end. */
#include "fault.h"

enum { SHIFT = 8 };

void fv_fault_exposure(struct fv_fault_picture *picture)
{
    const size_t bytes =
        (size_t)picture->width * (size_t)picture->height * (size_t)picture->channels;
    const uint32_t gain = (uint32_t)(picture->options->gain * (1 << SHIFT) + 0.5);
    for (size_t i = 0; i < bytes; i++) {
        const uint32_t value = (picture->pixels[i] * gain + (1 << (SHIFT - 1))) >> SHIFT;
        picture->pixels[i] = (uint8_t)(value > 255 ? 255 : value);
    }
}
