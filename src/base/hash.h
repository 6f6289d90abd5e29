/* FNV-1a, 64 bits (Fowler, Noll, Vo): tells two states or files apart; no defence against an adversary.
 * Start from FV_HASH_START and feed pieces in order. Real-time safe, any thread. */
#ifndef FOVEA_BASE_HASH_H
#define FOVEA_BASE_HASH_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define FV_HASH_START UINT64_C(14695981039346656037)

static inline uint64_t fv_hash(uint64_t hash, const void *data, size_t bytes)
{
    const uint8_t *byte = (const uint8_t *)data;
    for (size_t i = 0; i < bytes; i++) hash = (hash ^ byte[i]) * UINT64_C(1099511628211);
    return hash;
}

#ifdef __cplusplus
}
#endif
#endif
