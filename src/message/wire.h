/* What encoders and readers of messages share: lcm-gen takes sizes as int and gives negative ones
 * for failure; numbers on LCM's wire are big-endian. Real-time safe, any thread. */
#ifndef FOVEA_MESSAGE_WIRE_H
#define FOVEA_MESSAGE_WIRE_H

#include <stddef.h>
#include <stdint.h>

/* A buffer's size for lcm-gen's `_encode`. */
static inline int fv_wire_capacity(size_t capacity)
{
    return capacity > INT32_MAX ? INT32_MAX : (int)capacity;
}

/* What `_encode` returned as bytes written: 0 when the message did not fit. */
static inline uint32_t fv_wire_encoded(int bytes)
{
    return bytes > 0 ? (uint32_t)bytes : 0;
}

/* The number in `bytes` bytes, at most 8. */
static inline uint64_t fv_wire_read(const uint8_t *data, uint32_t bytes)
{
    uint64_t value = 0;
    for (uint32_t i = 0; i < bytes; i++)
        value = value << 8 | data[i];
    return value;
}

static inline void fv_wire_write(uint8_t *data, uint64_t value, uint32_t bytes)
{
    for (uint32_t i = 0; i < bytes; i++)
        data[i] = (uint8_t)(value >> 8 * (bytes - 1 - i));
}

#endif
