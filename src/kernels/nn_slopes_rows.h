/* The rows of nn_slopes_u8 (contracts/nn.h), for a set whose file defines struct job, job_of and
 * vector for SLOPES_LANES bytes before it includes this. What is left of a row is for plain C, row
 * by row, so that every set writes in the same order. */
#include "kernels/kernels.h"

FV_INLINE struct job job_of(const struct fv_nn_slopes *p, float rising);
FV_INLINE void vector(const struct job *job, const uint8_t *in, const float *slopes, uint8_t *out);

FV_INLINE void slopes_rows(const struct fv_nn_slopes *p, const uint8_t *in, ptrdiff_t ldi,
                           uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count)
{
    const struct job job = job_of(p, p->slopes[count]);
    const int32_t whole = count - count % SLOPES_LANES;
    struct fv_nn_slopes rest = *p;
    rest.slopes += whole;
    for (int32_t r = 0; r < rows; r++, in += ldi, out += ldo) {
        for (int32_t i = 0; i < whole; i += SLOPES_LANES)
            vector(&job, in + i, p->slopes + i, out + i);
        if (whole < count)
            fv_k_nn_slopes_u8__c(&rest, in + whole, ldi, out + whole, ldo, 1, count - whole);
    }
}
