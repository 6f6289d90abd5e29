#include "kernels/kernels.h"
#include "kernels/x86/nn_avx512.h"

void fv_k_nn_table_u8__avx512icl(const uint8_t *table, const uint8_t *in, uint8_t *out,
                                 int32_t count)
{
    struct table64 t;
    load_table(&t, table);
    for (int32_t i = 0; i < count; i += 64) {
        const __mmask64 mask = first_bytes(count - i);
        _mm512_mask_storeu_epi8(out + i, mask, look_up(_mm512_maskz_loadu_epi8(mask, in + i), &t));
    }
}
