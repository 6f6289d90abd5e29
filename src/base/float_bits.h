/* The bits of a float as a number, and back. Those of floats that are not negative are in the order
 * of the values, so that integer code can compare them. */
#ifndef FOVEA_BASE_FLOAT_BITS_H
#define FOVEA_BASE_FLOAT_BITS_H

#include <stdint.h>
#include <string.h>

static inline int32_t fv_float_bits(float value)
{
    int32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static inline float fv_float_of_bits(int32_t bits)
{
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

#endif
