/* The code that proves to a run with command_key that its sender knows the key. */
#ifndef FOVEA_EXAMPLES_NAVIGATE_SIGN_H
#define FOVEA_EXAMPLES_NAVIGATE_SIGN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct navigate_key {
    uint64_t words[2];
};

/* From a file of 32 hexadecimal digits; false: it is none. */
bool navigate_key_read(const char *path, struct navigate_key *key);

/* SipHash-2-4 (J.-P. Aumasson and D. J. Bernstein, 2012) of an encoded message whose mac is 0. */
int64_t navigate_sign(const struct navigate_key *key, const uint8_t *data, size_t bytes);

#endif
