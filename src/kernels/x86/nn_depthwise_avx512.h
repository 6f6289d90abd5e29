/* Depthwise convolution with vpdpbusd, for the files of the VNNI and the Ice Lake set.
 *
 * The bytes of up to four rows are interleaved, so that one 32-bit lane holds one channel's column
 * of the kernel, and each column of the kernel costs one vpdpbusd per 16 channels. Three ways:
 *  - blocks: 64 channels at a time; each input column is interleaved once into scratch and used by
 *    all outputs over it;
 *  - flat: few channels; a row of pixels is one run of bytes in which outputs j and inputs j + kx
 *    channels belong together, with the weights repeating every `channels` bytes. Rows are copied
 *    with their borders, columns sorted by stride;
 *  - streams: the same where pixels are whole lanes of 16 bytes and follow each other: each column
 *    is interleaved once for all outputs over it; the scratch holds them up to 48 channels. */
#ifndef FOVEA_KERNELS_X86_NN_DEPTHWISE_AVX512_H
#define FOVEA_KERNELS_X86_NN_DEPTHWISE_AVX512_H

#include "kernels/x86/nn_depthwise_lanes_avx512.h"

enum { COLUMNS_MAX = 72, PHASES_MAX = 3 };

/* Input columns under the kernel of an output pixel, from the first to the last. */
static inline int32_t span_of(const struct fv_nn_depthwise *d)
{
    return (d->kw - 1) * d->dilation_x + 1;
}

/* Those under the kernels of a row of output pixels. */
static inline int32_t columns_of(const struct fv_nn_depthwise *d)
{
    return (d->out_w - 1) * d->stride_x + span_of(d);
}

/* ---- blocks of 64 channels ------------------------------------------------------------------- */

static inline const uint8_t *input_row(const struct fv_nn_depthwise *d, const uint8_t *in,
                                       int32_t y, int32_t ky)
{
    const int32_t iy = y * d->stride_y - d->pad_top + ky * d->dilation_y;
    return ky >= d->kh || iy < 0 || iy >= d->in_h ? NULL
                                                  : in + (ptrdiff_t)iy * d->in_w * d->in_stride;
}

/* Interleave input columns [first, first + count) of the rows for output row y. */
static inline void interleave_columns(const struct fv_nn_depthwise *d, const uint8_t *in, int32_t y,
                                      int32_t first, int32_t count, __mmask64 mask,
                                      uint8_t *scratch)
{
    const __m512i border = _mm512_set1_epi8((char)d->zero_in);
    const int32_t groups = (d->kh + 3) / 4;
    for (int32_t g = 0; g < groups; g++) {
        const uint8_t *row[4];
        for (int32_t r = 0; r < 4; r++)
            row[r] = input_row(d, in, y, 4 * g + r);
        uint8_t *to = scratch + (ptrdiff_t)g * count * 256;
        for (int32_t i = 0; i < count; i++, to += 256) {
            const int32_t x = first + i;
            const int inside = x >= 0 && x < d->in_w;
            const ptrdiff_t at = (ptrdiff_t)x * d->in_stride;
            __m512i v[4], out[4];
            for (int r = 0; r < 4; r++)
                v[r] =
                    inside && row[r] != NULL ? _mm512_maskz_loadu_epi8(mask, row[r] + at) : border;
            interleave(v[0], v[1], v[2], v[3], out);
            for (int q = 0; q < 4; q++)
                _mm512_store_si512(to + 64 * q, out[q]);
        }
    }
}

FV_INLINE void block_outputs(const struct lanes *l, const struct fv_nn_depthwise *d,
                             const uint8_t *scratch, int32_t columns, int32_t outputs, uint8_t *out,
                             const int KW, const int GROUPS, const int PLANES, const int MODE)
{
    const int STEPS = PLANES * GROUPS * KW;
    const ptrdiff_t step = (ptrdiff_t)d->stride_x * 256, out_step = d->out_stride;
    const __mmask64 mask = l->mask;
    ptrdiff_t at[STEPS_MAX];
    struct held h;
    hold(&h, l, d, STEPS);
    for (int s = 0; s < STEPS; s++)
        at[s] = ((ptrdiff_t)(s / KW % GROUPS) * columns + s % KW * d->dilation_x) * 256;
    for (int32_t x = 0; x < outputs; x++, out += out_step, scratch += step) {
        __m512i acc[4] = {l->bias[0], l->bias[1], l->bias[2], l->bias[3]};
#pragma GCC unroll 10
        for (int s = 0; s < STEPS; s++) {
#pragma GCC unroll 4
            for (int q = 0; q < 4; q++)
                acc[q] = _mm512_dpbusd_epi32(acc[q], _mm512_load_si512(scratch + at[s] + 64 * q),
                                             weights_of(&h, l, s, q, STEPS));
        }
        _mm512_mask_storeu_epi8(out, mask, finish(&h, l, acc, MODE));
    }
}

typedef void block_outputs_fn(const struct lanes *l, const struct fv_nn_depthwise *d,
                              const uint8_t *scratch, int32_t columns, int32_t outputs,
                              uint8_t *out);

/* Functions of their own, so that each has the registers that it needs. */
#define BLOCKS(name, kw, groups, planes, mode)                                                     \
    static __attribute__((noinline)) void name(                                                    \
        const struct lanes *l, const struct fv_nn_depthwise *d, const uint8_t *scratch,            \
        int32_t columns, int32_t outputs, uint8_t *out)                                            \
    {                                                                                              \
        block_outputs(l, d, scratch, columns, outputs, out, kw, groups, planes, mode);             \
    }
BLOCKS(blocks_3x3_from_zero, 3, 1, 1, BY_REAL | FROM_ZERO)
BLOCKS(blocks_3x3, 3, 1, 1, BY_REAL)
BLOCKS(blocks_5x5_from_zero, 5, 2, 1, BY_REAL | FROM_ZERO)
BLOCKS(blocks_5x5, 5, 2, 1, BY_REAL)
BLOCKS(blocks_by_real, d->kw, (d->kh + 3) / 4, d->planes, BY_REAL)
BLOCKS(blocks_exactly, d->kw, (d->kh + 3) / 4, d->planes, 0)

static inline block_outputs_fn *blocks_of(const struct lanes *l, const struct fv_nn_depthwise *d)
{
    const int32_t groups = (d->kh + 3) / 4;
    const int mode = mode_of(l, d);
    if (mode == 0) return blocks_exactly;
    if (d->planes == 1 && d->kw == 3 && groups == 1)
        return mode == BY_REAL ? blocks_3x3 : blocks_3x3_from_zero;
    if (d->planes == 1 && d->kw == 5 && groups == 2)
        return mode == BY_REAL ? blocks_5x5 : blocks_5x5_from_zero;
    return blocks_by_real;
}

static inline void block_row(const struct lanes *l, const struct fv_nn_depthwise *d,
                             const uint8_t *in, uint8_t *out, int32_t y, uint8_t *scratch)
{
    const int32_t span = span_of(d);
    block_outputs_fn *const outputs = blocks_of(l, d);
    const int32_t most = span > COLUMNS_MAX ? 1 : (COLUMNS_MAX - span) / d->stride_x + 1;
    for (int32_t x = 0, count; x < d->out_w; x += count) {
        count = d->out_w - x < most ? d->out_w - x : most;
        const int32_t columns = (count - 1) * d->stride_x + span;
        interleave_columns(d, in, y, x * d->stride_x - d->pad_left, columns, l->mask, scratch);
        outputs(l, d, scratch, columns, count, out + (ptrdiff_t)x * d->out_stride);
    }
}

/* The first `channels` channels. */
static inline void by_blocks(const struct fv_nn_depthwise *d, int32_t channels, const uint8_t *in,
                             uint8_t *out, int32_t begin, int32_t end, uint8_t *scratch)
{
    struct lanes l;
    for (int32_t c = 0; c < channels; c += 64) {
        load_lanes(&l, d, c, 0);
        l.mask = first_bytes(channels - c);
        for (int32_t y = begin; y < end; y++) {
            block_row(&l, d, in + c, out + c + (ptrdiff_t)(y - begin) * d->out_w * d->out_stride, y,
                      scratch);
        }
    }
}

/* ---- flat rows ------------------------------------------------------------------------------- */

/* Bytes of one copied row: for each remainder modulo the stride, the columns with it side by side,
 * and room to read past. */
static inline ptrdiff_t flat_part(const struct fv_nn_depthwise *d)
{
    return (ptrdiff_t)((columns_of(d) + d->stride_x - 1) / d->stride_x) * d->channels + 64;
}

static inline int32_t common_divisor(int32_t a, int32_t b)
{
    while (b != 0) {
        const int32_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

/* Every n-th 64 bytes of a row stand for the same channels. */
static inline int32_t phases_of(const struct fv_nn_depthwise *d)
{
    return d->channels / common_divisor(d->channels, 64);
}

static inline void load_phases(struct lanes *lanes, const struct fv_nn_depthwise *d, int32_t phases)
{
    for (int32_t p = 0; p < phases; p++)
        load_lanes(&lanes[p], d, p * 64 % d->channels, d->channels);
}

static inline int flat_fits(const struct fv_nn_depthwise *d)
{
    if (d->stride_x > 1 && d->channels >= 48) return 0; /* sorting columns takes longer */
    const int32_t span = span_of(d), all = columns_of(d);
    const int32_t most = span > COLUMNS_MAX ? span : COLUMNS_MAX;
    const ptrdiff_t room = (ptrdiff_t)(all < most ? all : most) * 256 * ((d->kh + 3) / 4);
    const int32_t blocks = (d->channels + 63) / 64;
    const int is_stored = d->out_stride == d->channels || d->channels == 16 || d->channels == 32;
    return d->kh <= 4 && d->planes * d->kw <= STEPS_MAX && d->channels * 5 < blocks * 64 * 4 &&
           is_stored && flat_part(d) * d->stride_x * d->kh <= room && phases_of(d) <= PHASES_MAX;
}

/* `count` pixels of BYTES bytes, `step` bytes apart, side by side. */
FV_INLINE void gather_pixels(uint8_t *to, const uint8_t *from, ptrdiff_t step, int32_t count,
                             const int BYTES)
{
    for (int32_t i = 0; i < count; i++, to += BYTES, from += step) {
        if (BYTES == 8)
            _mm_storel_epi64((__m128i *)(void *)to,
                             _mm_loadl_epi64((const __m128i *)(const void *)from));
#pragma GCC unroll 2
        for (int at = 0; at + 16 <= BYTES; at += 16)
            _mm_storeu_si128((__m128i *)(void *)(to + at),
                             _mm_loadu_si128((const __m128i *)(const void *)(from + at)));
    }
}

static inline void copy_pixels(uint8_t *to, const uint8_t *from, ptrdiff_t step, int32_t count,
                               int32_t bytes)
{
    if (step == bytes) {
        memcpy(to, from, (size_t)count * (size_t)bytes);
        return;
    }
    switch (bytes) {
    case 8:
        gather_pixels(to, from, step, count, 8);
        return;
    case 16:
        gather_pixels(to, from, step, count, 16);
        return;
    case 32:
        gather_pixels(to, from, step, count, 32);
        return;
    default: /* in pieces that reach up to 15 bytes further, where others are written later */
        for (int32_t i = 0; i < count; i++, to += bytes, from += step) {
            for (int32_t at = 0; at < bytes; at += 16)
                memcpy(to + at, from + at, 16);
        }
    }
}

/* Columns phase, phase + stride_x, ... of a row side by side, zero_in outside the image. */
static inline void copy_phase(const struct fv_nn_depthwise *d, const uint8_t *row, int32_t phase,
                              uint8_t *to)
{
    const int32_t all = columns_of(d), s = d->stride_x, c = d->channels;
    const int32_t count = phase < all ? (all - phase + s - 1) / s : 0;
    const int32_t before = (d->pad_left - phase + s - 1) / s, /* columns left of the image */
        inside = (d->in_w + d->pad_left - phase + s - 1) / s;
    const int32_t left = before < 0       ? 0
                         : before < count ? before
                                          : count,
                  right = inside < left    ? left
                          : inside < count ? inside
                                           : count;
    memset(to, d->zero_in, (size_t)left * (size_t)c);
    if (right > left)
        copy_pixels(to + (ptrdiff_t)left * c,
                    row + (ptrdiff_t)(phase + left * s - d->pad_left) * d->in_stride,
                    (ptrdiff_t)s * d->in_stride, right - left, c);
    memset(to + (ptrdiff_t)right * c, d->zero_in, (size_t)(count - right) * (size_t)c);
}

FV_INLINE void fill(uint8_t *to, int32_t value, ptrdiff_t bytes)
{
    const __m512i all = _mm512_set1_epi8((char)value);
    for (; bytes > 0; bytes -= 64, to += 64)
        _mm512_mask_storeu_epi8(to, first_bytes(bytes), all);
}

/* Every second column of a row of pixels without gap, and the others: 64 bytes are sorted at once.
 * Up to 63 bytes past the last one are written, which others overwrite, or nobody reads. */
static inline void copy_halves(const struct fv_nn_depthwise *d, const uint8_t *row, uint8_t *to,
                               ptrdiff_t part)
{
    const __m512i order = d->channels == 8    ? _mm512_setr_epi64(0, 2, 4, 6, 1, 3, 5, 7)
                          : d->channels == 16 ? _mm512_setr_epi64(0, 1, 4, 5, 2, 3, 6, 7)
                                              : _mm512_setr_epi64(0, 1, 2, 3, 4, 5, 6, 7);
    const int32_t all = columns_of(d), c = d->channels,
                  left = d->pad_left < all ? d->pad_left : all,
                  right = left + d->in_w < all ? left + d->in_w : all;
    uint8_t *first = to + left % 2 * part + (ptrdiff_t)(left / 2) * c,
            *second = to + (1 - left % 2) * part + (ptrdiff_t)((left + 1) / 2) * c;
    for (ptrdiff_t at = 0; at < (ptrdiff_t)(right - left) * c; at += 64) {
        const __m512i v = _mm512_permutexvar_epi64(order, _mm512_loadu_si512(row + at));
        _mm256_storeu_si256((__m256i *)(void *)(first + at / 2), _mm512_castsi512_si256(v));
        _mm256_storeu_si256((__m256i *)(void *)(second + at / 2), _mm512_extracti64x4_epi64(v, 1));
    }
    for (int32_t phase = 0; phase < 2; phase++, to += part) {
        const ptrdiff_t before = (left - phase + 1) / 2, end = (right - phase + 1) / 2,
                        count = (all - phase + 1) / 2;
        fill(to, d->zero_in, before * c);
        fill(to + end * c, d->zero_in, (count - end) * c);
    }
}

static inline void copy_flat(const struct fv_nn_depthwise *d, const uint8_t *row, uint8_t *to,
                             ptrdiff_t part)
{
    if (row == NULL) {
        memset(to, d->zero_in, (size_t)(part * d->stride_x));
        return;
    }
    if (d->stride_x == 2 && d->in_stride == d->channels &&
        (d->channels == 8 || d->channels == 16 || d->channels == 32)) {
        copy_halves(d, row, to, part);
        return;
    }
    for (int32_t phase = 0; phase < d->stride_x; phase++)
        copy_phase(d, row, phase, to + phase * part);
}

/* Bytes from j on, of `total`, of a row of output pixels: those follow each other, or are 16 or 32
 * bytes each. */
FV_INLINE void store_pixels(const struct fv_nn_depthwise *d, uint8_t *out, int32_t j, int32_t total,
                            __m512i bytes)
{
    const __mmask64 mask = first_bytes(total - j);
    if (d->out_stride == d->channels) {
        _mm512_mask_storeu_epi8(out + j, mask, bytes);
        return;
    }
    uint8_t *to = out + (ptrdiff_t)(j / d->channels) * d->out_stride;
    if (d->channels == 32) {
        _mm256_storeu_si256((__m256i *)(void *)to, _mm512_castsi512_si256(bytes));
        if (total - j > 32)
            _mm256_storeu_si256((__m256i *)(void *)(to + d->out_stride),
                                _mm512_extracti64x4_epi64(bytes, 1));
        return;
    }
    __m128i pixel[4] = {_mm512_castsi512_si128(bytes), _mm512_extracti32x4_epi32(bytes, 1),
                        _mm512_extracti32x4_epi32(bytes, 2), _mm512_extracti32x4_epi32(bytes, 3)};
#pragma GCC unroll 4
    for (int i = 0; i < 4; i++, to += d->out_stride) {
        if (total - j > 16 * i) _mm_storeu_si128((__m128i *)(void *)to, pixel[i]);
    }
}

/* Outputs j, j + step, ... of one row, by the copies of KH rows. */
FV_INLINE void flat_outputs(const struct lanes *l, const struct fv_nn_depthwise *d,
                            const uint8_t *const rows[4], ptrdiff_t part, int32_t j, int32_t step,
                            int32_t total, uint8_t *out, const int KH, const int KW,
                            const int PLANES, const int MODE)
{
    const __m512i none = _mm512_setzero_si512();
    ptrdiff_t columns[STEPS_MAX];
    struct held h;
    hold(&h, l, d, PLANES * KW);
    for (int kx = 0; kx < KW; kx++) {
        const int32_t column = kx * d->dilation_x;
        columns[kx] = column % d->stride_x * part + (ptrdiff_t)(column / d->stride_x) * d->channels;
    }
    for (; j < total; j += step) {
        __m512i acc[4] = {l->bias[0], l->bias[1], l->bias[2], l->bias[3]};
#pragma GCC unroll 3
        for (int kx = 0; kx < KW; kx++) {
            const ptrdiff_t at = columns[kx] + j;
            __m512i v[4];
            interleave(_mm512_loadu_si512(rows[0] + at),
                       KH > 1 ? _mm512_loadu_si512(rows[1] + at) : none,
                       KH > 2 ? _mm512_loadu_si512(rows[2] + at) : none,
                       KH > 3 ? _mm512_loadu_si512(rows[3] + at) : none, v);
            for (int p = 0; p < PLANES; p++) {
#pragma GCC unroll 4
                for (int q = 0; q < 4; q++)
                    acc[q] = _mm512_dpbusd_epi32(acc[q], v[q],
                                                 weights_of(&h, l, p * KW + kx, q, PLANES * KW));
            }
        }
        store_pixels(d, out, j, total, finish(&h, l, acc, MODE));
    }
}

static inline void by_flat_rows(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out,
                                int32_t begin, int32_t end, uint8_t *scratch)
{
    const int32_t phases = phases_of(d), total = d->out_w * d->channels;
    const ptrdiff_t part = flat_part(d), pitch = part * d->stride_x;
    const int small = d->kh == 3 && d->kw == 3;
    struct lanes lanes[PHASES_MAX];
    load_phases(lanes, d, phases);
    int32_t copied = INT32_MIN; /* the last row whose copy is there */
    for (int32_t y = begin; y < end; y++, out += (ptrdiff_t)d->out_w * d->out_stride) {
        const uint8_t *rows[4] = {NULL};
        for (int32_t ky = 0; ky < d->kh; ky++) {
            const int32_t iy = y * d->stride_y - d->pad_top + ky * d->dilation_y;
            /* Rows of a kernel without gaps share kh copies in rotation: each is copied once. */
            const int32_t turn = d->dilation_y == 1 ? (iy % d->kh + d->kh) % d->kh : ky;
            uint8_t *to = scratch + turn * pitch;
            if (d->dilation_y != 1 || iy > copied) copy_flat(d, input_row(d, in, y, ky), to, part);
            rows[ky] = to;
        }
        copied = y * d->stride_y - d->pad_top + d->kh - 1;
        for (int32_t p = 0; p < phases && p * 64 < total; p++) {
            const struct lanes *l = &lanes[p];
            const int32_t step = phases * 64;
            const int mode = mode_of(l, d);
            if (small && d->planes == 1 && mode == (BY_REAL | FROM_ZERO))
                flat_outputs(l, d, rows, part, p * 64, step, total, out, 3, 3, 1,
                             BY_REAL | FROM_ZERO);
            else if (small && d->planes == 1 && mode == BY_REAL)
                flat_outputs(l, d, rows, part, p * 64, step, total, out, 3, 3, 1, BY_REAL);
            else if (small && mode == (BY_REAL | FROM_ZERO))
                flat_outputs(l, d, rows, part, p * 64, step, total, out, 3, 3, d->planes,
                             BY_REAL | FROM_ZERO);
            else if (mode != 0)
                flat_outputs(l, d, rows, part, p * 64, step, total, out, d->kh, d->kw, d->planes,
                             BY_REAL);
            else
                flat_outputs(l, d, rows, part, p * 64, step, total, out, d->kh, d->kw, d->planes,
                             0);
        }
    }
}

/* Channels from `first` on alone. */
static inline struct fv_nn_depthwise last_channels(const struct fv_nn_depthwise *d, int32_t first)
{
    struct fv_nn_depthwise last = *d;
    last.channels -= first;
    last.weights += first;
    last.bias += first;
    last.multiplier += first;
    last.shift += first;
    if (d->real != NULL) last.real += first;
    return last;
}

/* Whole blocks, and what is left, a quarter or half of one, as flat rows. */
static inline void by_blocks_and_rows(const struct fv_nn_depthwise *d, const uint8_t *in,
                                      uint8_t *out, int32_t begin, int32_t end, uint8_t *scratch)
{
    const int32_t first = d->channels / 64 * 64;
    const struct fv_nn_depthwise last = last_channels(d, first);
    if (first > 0 && (last.channels == 16 || last.channels == 32) && flat_fits(&last)) {
        by_blocks(d, first, in, out, begin, end, scratch);
        by_flat_rows(&last, in + first, out + first, begin, end, scratch);
    } else {
        by_blocks(d, d->channels, in, out, begin, end, scratch);
    }
}

/* ---- streams of lanes ------------------------------------------------------------------------ */

/* Of each of four streams an output reads kw lanes, a pixel apart. */
static inline ptrdiff_t stream_pitch(const struct fv_nn_depthwise *d)
{
    return ((ptrdiff_t)(d->out_w + d->kw - 1) * d->channels + 64 + 127) / 64 * 64;
}

/* Bytes before a stream, so that the image begins at a cache line. */
static inline ptrdiff_t stream_lead(const struct fv_nn_depthwise *d)
{
    return (64 - d->pad_left * d->channels % 64) % 64;
}

static inline int streams_fit(const struct fv_nn_depthwise *d)
{
    const int32_t all = d->out_w - 1 + d->kw;
    const ptrdiff_t room = (ptrdiff_t)(all < COLUMNS_MAX ? all : COLUMNS_MAX) * 256;
    return d->channels % 16 == 0 && d->stride_x == 1 && d->dilation_x == 1 && d->kh <= 8 &&
           d->planes * ((d->kh + 3) / 4) * d->kw <= STEPS_MAX && d->in_stride == d->channels &&
           d->out_stride == d->channels && 4 * stream_pitch(d) <= room &&
           phases_of(d) <= PHASES_MAX;
}

/* Those of kernel rows from ky on. */
static inline void fill_streams(const struct fv_nn_depthwise *d, const uint8_t *in, int32_t y,
                                int32_t ky, uint8_t *streams, ptrdiff_t pitch)
{
    streams += stream_lead(d);
    const __m512i border = _mm512_set1_epi8((char)d->zero_in);
    const ptrdiff_t total = (ptrdiff_t)(d->out_w - 1 + d->kw) * d->channels,
                    before = (ptrdiff_t)d->pad_left * d->channels,
                    left = before < total ? before : total,
                    after = left + (ptrdiff_t)d->in_w * d->channels,
                    right = after < total ? after : total;
    const uint8_t *row[4];
    for (int32_t r = 0; r < 4; r++)
        row[r] = input_row(d, in, y, ky + r);
    for (ptrdiff_t at = left; at < right; at += 64) {
        __m512i v[4], lanes[4];
        for (int r = 0; r < 4; r++)
            v[r] = row[r] != NULL ? _mm512_loadu_si512(row[r] + at - left) : border;
        interleave(v[0], v[1], v[2], v[3], lanes);
        for (int q = 0; q < 4; q++)
            _mm512_storeu_si512(streams + q * pitch + at, lanes[q]);
    }
    for (int q = 0; q < 4; q++) {
        memset(streams + q * pitch, d->zero_in, (size_t)left);
        memset(streams + q * pitch + right, d->zero_in, (size_t)(total - right));
    }
}

FV_INLINE void stream_outputs(const struct lanes *l, const struct fv_nn_depthwise *d,
                              const uint8_t *streams, ptrdiff_t pitch, int32_t j, int32_t step,
                              int32_t total, uint8_t *out, const int KW, const int GROUPS,
                              const int PLANES, const int MODE)
{
    struct held h;
    hold(&h, l, d, PLANES * GROUPS * KW);
    streams += stream_lead(d);
    for (; j < total; j += step) {
        __m512i acc[4] = {l->bias[0], l->bias[1], l->bias[2], l->bias[3]};
        for (int g = 0; g < GROUPS; g++) {
#pragma GCC unroll 5
            for (int kx = 0; kx < KW; kx++) {
                const uint8_t *from = streams + 4 * g * pitch + (ptrdiff_t)kx * d->channels + j;
                for (int p = 0; p < PLANES; p++) {
#pragma GCC unroll 4
                    for (int q = 0; q < 4; q++)
                        acc[q] = _mm512_dpbusd_epi32(
                            acc[q], _mm512_loadu_si512(from + q * pitch),
                            weights_of(&h, l, (p * GROUPS + g) * KW + kx, q, PLANES * GROUPS * KW));
                }
            }
        }
        const __mmask64 mask = first_bytes(total - j);
        _mm512_mask_storeu_epi8(out + j, mask, finish(&h, l, acc, MODE));
    }
}

/* Functions of their own, so that each has the registers that it needs. */
#define STREAMS(name, kw, groups, mode)                                                            \
    static __attribute__((noinline)) void name(                                                    \
        const struct lanes *l, const struct fv_nn_depthwise *d, const uint8_t *streams,            \
        ptrdiff_t pitch, int32_t j, int32_t step, int32_t total, uint8_t *out)                     \
    {                                                                                              \
        stream_outputs(l, d, streams, pitch, j, step, total, out, kw, groups, 1, mode);            \
    }
STREAMS(streams_3x3_from_zero, 3, 1, BY_REAL | FROM_ZERO)
STREAMS(streams_3x3, 3, 1, BY_REAL)
STREAMS(streams_5x5_from_zero, 5, 2, BY_REAL | FROM_ZERO)
STREAMS(streams_5x5, 5, 2, BY_REAL)

/* Any kernel. */
static inline void streams_of(const struct lanes *l, const struct fv_nn_depthwise *d,
                              const uint8_t *streams, ptrdiff_t pitch, int32_t j, int32_t step,
                              int32_t total, uint8_t *out)
{
    const int32_t groups = (d->kh + 3) / 4;
    if (l->is_real)
        stream_outputs(l, d, streams, pitch, j, step, total, out, d->kw, groups, d->planes,
                       BY_REAL);
    else
        stream_outputs(l, d, streams, pitch, j, step, total, out, d->kw, groups, d->planes, 0);
}

static inline void by_streams(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out,
                              int32_t begin, int32_t end, uint8_t *streams)
{
    const int32_t phases = phases_of(d), total = d->out_w * d->channels, step = phases * 64;
    const int32_t groups = (d->kh + 3) / 4;
    const ptrdiff_t pitch = stream_pitch(d);
    const int small = d->kw == 3 && groups == 1 && d->planes == 1,
              large = d->kw == 5 && groups == 2 && d->planes == 1;
    struct lanes lanes[PHASES_MAX];
    load_phases(lanes, d, phases);
    for (int32_t y = begin; y < end; y++, out += total) {
        for (int32_t g = 0; g < groups; g++)
            fill_streams(d, in, y, 4 * g, streams + 4 * g * pitch, pitch);
        for (int32_t p = 0; p < phases && p * 64 < total; p++) {
            const struct lanes *l = &lanes[p];
            const int mode = mode_of(l, d);
            void (*outputs)(const struct lanes *, const struct fv_nn_depthwise *, const uint8_t *,
                            ptrdiff_t, int32_t, int32_t, int32_t, uint8_t *) = streams_of;
            if (small && mode != 0)
                outputs = mode == BY_REAL ? streams_3x3 : streams_3x3_from_zero;
            else if (large && mode != 0)
                outputs = mode == BY_REAL ? streams_5x5 : streams_5x5_from_zero;
            outputs(l, d, streams, pitch, p * 64, step, total, out);
        }
    }
}

static inline void depthwise(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out,
                             int32_t begin, int32_t end, uint8_t *scratch)
{
    if (streams_fit(d))
        by_streams(d, in, out, begin, end, scratch);
    else if (flat_fits(d))
        by_flat_rows(d, in, out, begin, end, scratch);
    else if (d->planes * ((d->kh + 3) / 4) * d->kw <= STEPS_MAX)
        by_blocks_and_rows(d, in, out, begin, end, scratch);
    else
        fv_k_nn_depthwise_u8__avx2(d, in, out, begin, end, scratch);
}

#endif
