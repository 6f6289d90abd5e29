#include "sign.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { DIGITS = 32 };

bool navigate_key_read(const char *path, struct navigate_key *key)
{
    char text[DIGITS + 1] = "", pair[3] = "";
    FILE *file = fopen(path, "r");
    if (file == NULL) return false;
    const size_t count = fread(text, 1, DIGITS, file);
    fclose(file);
    if (count < DIGITS || strspn(text, "0123456789abcdefABCDEF") < DIGITS) return false;
    key->words[0] = key->words[1] = 0;
    for (int i = 0; i < DIGITS / 2; i++) {
        memcpy(pair, text + 2 * i, 2);
        key->words[i / 8] |= (uint64_t)strtoul(pair, NULL, 16) << 8 * (i % 8);
    }
    return true;
}

static uint64_t turned(uint64_t value, int bits)
{
    return value << bits | value >> (64 - bits);
}

static void mix(uint64_t v[4], int rounds)
{
    for (; rounds > 0; rounds--) {
        v[0] += v[1];
        v[2] += v[3];
        v[1] = turned(v[1], 13) ^ v[0];
        v[3] = turned(v[3], 16) ^ v[2];
        v[0] = turned(v[0], 32);
        v[2] += v[1];
        v[0] += v[3];
        v[1] = turned(v[1], 17) ^ v[2];
        v[3] = turned(v[3], 21) ^ v[0];
        v[2] = turned(v[2], 32);
    }
}

static void absorb(uint64_t v[4], uint64_t word)
{
    v[3] ^= word;
    mix(v, 2);
    v[0] ^= word;
}

int64_t navigate_sign(const struct navigate_key *key, const uint8_t *data, size_t bytes)
{
    const uint64_t k0 = key->words[0], k1 = key->words[1];
    uint64_t v[4] = {k0 ^ 0x736f6d6570736575, k1 ^ 0x646f72616e646f6d, k0 ^ 0x6c7967656e657261,
                     k1 ^ 0x7465646279746573},
             word = 0;
    for (size_t i = 0; i < bytes; i++) {
        word |= (uint64_t)data[i] << 8 * (i % 8);
        if (i % 8 < 7) continue;
        absorb(v, word);
        word = 0;
    }
    absorb(v, word | (uint64_t)bytes << 56);
    v[2] ^= 0xff;
    mix(v, 4);
    return (int64_t)(v[0] ^ v[1] ^ v[2] ^ v[3]);
}
