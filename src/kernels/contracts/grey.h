/* Contracts of the kernels that turn captured pixels into grey levels, one row at a time.
 *
 * Common to all: `count` >= 0 pixels; no alignment needed; nothing is read or written outside the stated ranges; source and
 * destination do not overlap; every variant gives the same bits. */
#ifndef FOVEA_KERNELS_CONTRACTS_GREY_H
#define FOVEA_KERNELS_CONTRACTS_GREY_H

#include <stdint.h>

/* grey[i] = min(source[i] >> shift, 255), shift in [0, 8]; source 2-byte aligned. */
typedef void fv_k_grey_shift_u16_fn(uint8_t *grey, const uint16_t *source, int32_t count, int32_t shift);

/* grey[i] = source[2 i + offset], offset 0 or 1; reads source[0 .. 2 count - 1]. */
typedef void fv_k_grey_pick_u8_fn(uint8_t *grey, const uint8_t *source, int32_t count, int32_t offset);

#endif
