#include "app/network/siphash.h"

static uint64_t rotate(uint64_t value, int bits)
{
    return value << bits | value >> (64 - bits);
}

static uint64_t little_endian(const uint8_t *at, size_t bytes)
{
    uint64_t value = 0;
    for (size_t i = 0; i < bytes; i++)
        value |= (uint64_t)at[i] << (8 * i);
    return value;
}

static void rounds(uint64_t v[4], int count)
{
    for (int i = 0; i < count; i++) {
        v[0] += v[1];
        v[2] += v[3];
        v[1] = rotate(v[1], 13) ^ v[0];
        v[3] = rotate(v[3], 16) ^ v[2];
        v[0] = rotate(v[0], 32);
        v[2] += v[1];
        v[0] += v[3];
        v[1] = rotate(v[1], 17) ^ v[2];
        v[3] = rotate(v[3], 21) ^ v[0];
        v[2] = rotate(v[2], 32);
    }
}

static void absorb(uint64_t v[4], uint64_t word)
{
    v[3] ^= word;
    rounds(v, 2);
    v[0] ^= word;
}

/* At most 8 bytes from `at` on, of which the first `bytes` are there. */
static uint64_t word_at(const uint8_t *data, size_t bytes, size_t at)
{
    const size_t left = at < bytes ? bytes - at : 0;
    return left > 0 ? little_endian(data + at, left < 8 ? left : 8) : 0;
}

uint64_t fv_siphash(const uint8_t key[FV_SIPHASH_KEY_BYTES], const uint8_t *data, size_t bytes,
                    size_t zeros)
{
    const uint64_t k0 = little_endian(key, 8), k1 = little_endian(key + 8, 8);
    uint64_t v[4] = {k0 ^ UINT64_C(0x736f6d6570736575), k1 ^ UINT64_C(0x646f72616e646f6d),
                     k0 ^ UINT64_C(0x6c7967656e657261), k1 ^ UINT64_C(0x7465646279746573)};
    const size_t all = bytes + zeros, whole = all / 8 * 8;
    for (size_t at = 0; at < whole; at += 8)
        absorb(v, word_at(data, bytes, at));
    absorb(v, (uint64_t)all << 56 | word_at(data, bytes, whole));
    v[2] ^= 0xff;
    rounds(v, 4);
    return v[0] ^ v[1] ^ v[2] ^ v[3];
}
