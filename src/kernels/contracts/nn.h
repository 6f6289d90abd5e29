/* Contracts of the int8 network kernels.
 *
 * Activations are unsigned bytes, weights signed bytes, accumulators 32 bits wide (wrapping).
 * Requantisation is the one of gemmlowp, exactly: high product with 31 fractional bits rounded half
 * up, then a shift right rounded half away from zero (fv_nn_requantize in kernels/nn_requantize.h).
 * Every variant gives the same bits. */
#ifndef FOVEA_KERNELS_CONTRACTS_NN_H
#define FOVEA_KERNELS_CONTRACTS_NN_H

#include <stddef.h>
#include <stdint.h>

/* A matrix product: n outputs from k inputs each. Arrays per channel hold n rounded up to 16
 * entries. */
struct fv_nn_gemm {
    int32_t k, k4, n;      /* k4 = (k + 3) / 4 */
    const int8_t *weights; /* [n / 16][k4][16][4], zero where k or n is padding; 64-byte aligned */
    const int32_t *bias, *multiplier, *shift; /* 64-byte aligned; shift in [-31, 30] */
    const uint8_t *table;                     /* 256 bytes applied to the result, or NULL */
    int32_t zero_out, act_min, act_max; /* added, then clamped to [act_min, act_max] in [0, 255] */
    int32_t row_sum_factor; /* times the sum of the row's k inputs, added to each accumulator */
    const float *real;      /* by 16 channels, or NULL: see below; 64-byte aligned */
};

/* A second way to the same results, which a variant may take: for each 16 channels 16 factors and
 * 16 offsets, such that sum factor + offset, where the offset has the sum's sign, gives the same
 * bytes as requantize once its fraction is cut off (nn/real.h). The sum as float32 and the product
 * plus the offset are rounded towards zero. Where the first factor is 0 these 16 channels have
 * none. Where act_min >= zero_out the offset's sign does not matter. */

/* out[i ldo + c] = table[clamp(requantize(bias[c] + sum_k a[i lda + k] w[c][k] + factor sum_k a[i
 * lda + k]) + zero)] for i < m, c < n. Reads a row's bytes up to 4 k4 rounded up to 64; writes
 * exactly n bytes per row.
 */
typedef void fv_k_nn_gemm_u8_fn(const struct fv_nn_gemm *gemm, const uint8_t *a, ptrdiff_t lda,
                                uint8_t *out, ptrdiff_t ldo, int32_t m);

/* Rows at equal distances: row i begins at `in + i in_step`, its outputs at `out + i out_step`. */
struct fv_nn_rows {
    const uint8_t *in;
    uint8_t *out;
    ptrdiff_t in_step, out_step;
    int32_t count; /* at least 1 */
};

/* The same product of rows whose inputs lie apart, in groups of four: group j from the row's begin
 * + offsets[j] on, j < k4, with k = 4 k4 and row_sum_factor 0. `rows`: `count` runs of rows, at
 * least 1. Reads nothing else; a row may be computed twice. Where it has no variant but C, it is
 * faster to gather the rows for nn_gemm_u8. */
typedef void fv_k_nn_apart_u8_fn(const struct fv_nn_gemm *gemm, const int32_t *offsets,
                                 const struct fv_nn_rows *rows, int32_t count);

/* The accumulators themselves: out[i ldo + c] for c < n rounded up to 16, without requantisation.
 * Reads as above. */
typedef void fv_k_nn_gemm_i32_fn(const struct fv_nn_gemm *gemm, const uint8_t *a, ptrdiff_t lda,
                                 int32_t *out, ptrdiff_t ldo, int32_t m);

/* A depthwise convolution with one output per channel. */
struct fv_nn_depthwise {
    int32_t in_h, in_w, channels,
        in_stride; /* stride: bytes from pixel to pixel, rows follow without gap */
    int32_t out_w, out_stride;
    int32_t kh, kw, stride_y, stride_x, dilation_y, dilation_x, pad_top, pad_left;
    int32_t planes, c16;   /* weights are the sum of 1..3 planes; channels rounded up to 16 */
    const int8_t *weights; /* [planes][kh kw][c16]; 64-byte aligned */
    const int32_t *bias, *multiplier, *shift; /* c16 each */
    const uint8_t *table;
    int32_t zero_in, zero_out, act_min, act_max; /* outside the image the input is zero_in */
    const float *real; /* as of struct fv_nn_gemm, but c16 factors, then c16 offsets */
};

/* Output rows [begin, end). `in` is the image's first pixel, `out` that of row `begin`. `scratch`:
 * 64-byte aligned, 256 bytes times ceil(kh / 4) times min((out_w - 1) stride_x + span, max(72,
 * span)), where span = (kw - 1) dilation_x + 1. May read 64 bytes past the image; writes exactly
 * `channels` bytes per output pixel. */
typedef void fv_k_nn_depthwise_u8_fn(const struct fv_nn_depthwise *d, const uint8_t *in,
                                     uint8_t *out, int32_t begin, int32_t end, uint8_t *scratch);

/* out[i] = table[in[i]], i < count; in == out is allowed. */
typedef void fv_k_nn_table_u8_fn(const uint8_t *table, const uint8_t *in, uint8_t *out,
                                 int32_t count);

/* Copy `count` runs of `run` bytes: run i from `in + i step` to `out + i pitch`, in order; pitch >=
 * run + 15. Reads and writes up to 15 bytes past a run (what is written there is not specified). */
typedef void fv_k_nn_gather_u8_fn(const uint8_t *in, ptrdiff_t step, uint8_t *out, ptrdiff_t pitch,
                                  int32_t run, int32_t count);

/* Parameters of an element-wise sum; both inputs are moved by 20 bits before their multipliers. */
struct fv_nn_add {
    int32_t zero_a, zero_b, zero_out, m_a, s_a, m_b, s_b, m_out,
        s_out; /* s_a and s_b in [-31, 0] */
    int32_t act_min, act_max;
};

/* out[r ldo + i] = clamp(requantize(requantize(a') + requantize(b')) + zero_out), a' = (a[r lda +
 * i] - zero_a) 2^20, for r < rows, i < count; a == out or b == out with the same stride is allowed.
 */
typedef void fv_k_nn_add_u8_fn(const struct fv_nn_add *add, const uint8_t *a, ptrdiff_t lda,
                               const uint8_t *b, ptrdiff_t ldb, uint8_t *out, ptrdiff_t ldo,
                               int32_t rows, int32_t count);

/* The same for other operators, with x = a[r lda + i] - zero_a and y = b[r ldb + i] - zero_b: the
 * difference in place of the sum; the product, requantize(x y) by m_out and s_out; PRELU, which is
 * requantize(x) by m_a and s_a where x >= 0, else the product. Shifts that these use for a product
 * or for x are in [-31, 30]. */
typedef fv_k_nn_add_u8_fn fv_k_nn_sub_u8_fn, fv_k_nn_mul_u8_fn, fv_k_nn_prelu_u8_fn;

/* Slopes by channel in real numbers, each float32 with |slope| <= 2^14: with x = in[r ldi + i] -
 * zero_in and slope = slopes[i] where x < 0, slopes[count] elsewhere, out[r ldo + i] = zero_out + x
 * slope, rounded once as float32 and once to the nearest whole number, ties to even; clamped to [0,
 * 255], for r < rows, i < count. in == out with the same stride is allowed. */
struct fv_nn_slopes {
    int32_t zero_in, zero_out;
    const float *slopes; /* [count + 1] */
};
typedef void fv_k_nn_slopes_u8_fn(const struct fv_nn_slopes *p, const uint8_t *in, ptrdiff_t ldi,
                                  uint8_t *out, ptrdiff_t ldo, int32_t rows, int32_t count);

/* out[i] = max(a[i], b[i]); a == out is allowed. */
typedef void fv_k_nn_max_u8_fn(const uint8_t *a, const uint8_t *b, uint8_t *out, int32_t count);
/* out[i] = min(a[i], b[i]); likewise. Of both loops compilers find the vectors of SSE2 and NEON by
 * themselves. */
typedef fv_k_nn_max_u8_fn fv_k_nn_min_u8_fn;

/* One row of a bilinear resize whose weights are multiples of 2^-bits, bits <= 10. Entries as in
 * the model file: lower and upper source column, weight of the upper one in [0, 2^bits]. */
struct fv_nn_blend {
    int32_t channels, in_stride, out_w, out_stride, bits;
    /* sums below middle 2^(2 bits) round halves down: 0, or 128 where bytes stand for signed
     * ones */
    int32_t middle;
    const int32_t *columns; /* [out_w][3] */
};

/* out[x out_stride + c] = (2^(2 bits - 1) - (sum < middle 2^(2 bits)) + sum) >> 2 bits, sum that
 * over the four neighbours of weight times value (with bits = 0 the neighbour itself), where `top`
 * and `bottom` are the source rows and `weight` in [0, 2^bits] that of the bottom one. Reads up to
 * 64 bytes past a pixel; writes exactly `channels` bytes per pixel. */
typedef void fv_k_nn_blend_u8_fn(const struct fv_nn_blend *p, const uint8_t *top,
                                 const uint8_t *bottom, int32_t weight, uint8_t *out);

/* out[i] = index of the first largest of in[i axis .. i axis + axis - 1], i < count. Reads up to 64
 * bytes past the end. */
typedef void fv_k_nn_argmax_u8_fn(const uint8_t *in, int32_t axis, int32_t *out, int32_t count);

/* Softmax of rows of `depth` packed bytes, gemmlowp's fixed point with 12 integer bits in the sum.
 * `exps`: 256 words, exp of minus the distance from the row's largest value in Q0.31, -1 where the
 * term is left out; exps[0] is 2^31 - 1 and they fall; depth is at most 8191, so that the sum fits
 * its 32 bits, unsigned. */
typedef void fv_k_nn_softmax_u8_fn(const int32_t *exps, const uint8_t *in, uint8_t *out,
                                   int32_t depth, int32_t rows);

/* Transpose bytes: out[c ldo + r] = in[r ldi + c], r < rows, c < columns. */
typedef void fv_k_nn_transpose_u8_fn(const uint8_t *in, ptrdiff_t ldi, uint8_t *out, ptrdiff_t ldo,
                                     int32_t rows, int32_t columns);

#endif
