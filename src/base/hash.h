/* FNV-1a, 64 bits (Fowler, Noll, Vo): tells two states or files apart; no defence against an
 * adversary. Start from FV_HASH_START and feed pieces in order. Real-time safe, any thread. */
#ifndef FOVEA_BASE_HASH_H
#define FOVEA_BASE_HASH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

#define FV_HASH_START UINT64_C(14695981039346656037)

static inline uint64_t fv_hash(uint64_t hash, const void *data, size_t bytes)
{
    const uint8_t *byte = (const uint8_t *)data;
    for (size_t i = 0; i < bytes; i++)
        hash = (hash ^ byte[i]) * UINT64_C(1099511628211);
    return hash;
}

/* The same for much data at once, several bytes a cycle: four interleaved FNV-1a hashes over words
 * of 8 bytes (little-endian processors), then fv_hash over the four and the bytes that are left.
 * `mixed`: the upper half of a lane reaches the lower one, too; multiplying leaves the top bit to
 * itself, so that two flipped signs of a lane would cancel. */
static inline uint64_t fv_hash_lanes(uint64_t hash, const void *data, size_t bytes, bool mixed)
{
    const uint8_t *from = (const uint8_t *)data;
    uint64_t lane[4], word[4];
    size_t at = 0;
    for (uint64_t i = 0; i < 4; i++)
        lane[i] = hash + i;
    for (; at + sizeof word <= bytes; at += sizeof word) {
        memcpy(word, from + at, sizeof word);
        for (int i = 0; i < 4; i++) {
            lane[i] = (lane[i] ^ word[i]) * UINT64_C(1099511628211);
            if (mixed) lane[i] ^= lane[i] >> 32;
        }
    }
    return fv_hash(fv_hash(hash, lane, sizeof lane), from + at, bytes - at);
}

/* Of pixels, as recordings hold it. */
static inline uint64_t fv_hash_bulk(uint64_t hash, const void *data, size_t bytes)
{
    return fv_hash_lanes(hash, data, bytes, false);
}

/* Of states and messages. */
static inline uint64_t fv_hash_state(uint64_t hash, const void *data, size_t bytes)
{
    return fv_hash_lanes(hash, data, bytes, true);
}

#ifdef __cplusplus
}
#endif
#endif
