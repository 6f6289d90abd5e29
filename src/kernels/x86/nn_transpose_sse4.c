#include <immintrin.h>
#include <string.h>

#include "kernels/kernels.h"

/* Neighbouring registers interleaved, four times: 16 x 16 bytes transposed. */
static inline void transpose16(__m128i v[16])
{
    __m128i t[16];
#pragma GCC unroll 4
    for (int step = 0; step < 4; step++) {
#pragma GCC unroll 8
        for (int i = 0; i < 8; i++) {
            t[2 * i] = _mm_unpacklo_epi8(v[i], v[i + 8]);
            t[2 * i + 1] = _mm_unpackhi_epi8(v[i], v[i + 8]);
        }
        memcpy(v, t, sizeof t);
    }
}

static void block(const uint8_t *in, ptrdiff_t ldi, uint8_t *out, ptrdiff_t ldo)
{
    __m128i v[16];
    for (int i = 0; i < 16; i++)
        v[i] = _mm_loadu_si128((const __m128i *)(const void *)(in + i * ldi));
    transpose16(v);
    for (int i = 0; i < 16; i++)
        _mm_storeu_si128((__m128i *)(void *)(out + i * ldo), v[i]);
}

void fv_k_nn_transpose_u8__sse4(const uint8_t *in, ptrdiff_t ldi, uint8_t *out, ptrdiff_t ldo,
                                int32_t rows, int32_t columns)
{
    const int32_t whole_rows = rows / 16 * 16, whole_columns = columns / 16 * 16;
    for (int32_t r = 0; r < whole_rows; r += 16) {
        for (int32_t c = 0; c < whole_columns; c += 16)
            block(in + r * ldi + c, ldi, out + c * ldo + r, ldo);
    }
    fv_k_nn_transpose_u8__c(in + whole_columns, ldi, out + whole_columns * ldo, ldo, rows,
                            columns - whole_columns);
    fv_k_nn_transpose_u8__c(in + whole_rows * ldi, ldi, out + whole_rows, ldo, rows - whole_rows,
                            whole_columns);
}
