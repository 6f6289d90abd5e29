/* SipHash-2-4 (J.-P. Aumasson and D. J. Bernstein, 2012): a code of 64 bits that only who knows the
 * key of 128 bits can make for a text. */
#ifndef FOVEA_APP_NETWORK_SIPHASH_H
#define FOVEA_APP_NETWORK_SIPHASH_H

#include <stddef.h>
#include <stdint.h>

enum { FV_SIPHASH_KEY_BYTES = 16 };

/* Of the `bytes` of `data`, and `zeros` zero bytes behind them, which are not read. */
uint64_t fv_siphash(const uint8_t key[FV_SIPHASH_KEY_BYTES], const uint8_t *data, size_t bytes,
                    size_t zeros);

#endif
