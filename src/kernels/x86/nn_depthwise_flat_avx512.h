/* Depthwise convolution of few channels: a row of pixels is one run of bytes in which outputs j and
 * inputs j + kx channels belong together, with the weights repeating every `channels` bytes. Rows
 * are copied with their borders, columns sorted by stride. */
#ifndef FOVEA_KERNELS_X86_NN_DEPTHWISE_FLAT_AVX512_H
#define FOVEA_KERNELS_X86_NN_DEPTHWISE_FLAT_AVX512_H

#include "kernels/x86/nn_depthwise_lanes_avx512.h"

/* Bytes of one copied row: for each remainder modulo the stride, the columns with it side by side,
 * and room to read past. */
static inline ptrdiff_t flat_part(const struct fv_nn_depthwise *d)
{
    return (ptrdiff_t)((columns_of(d) + d->stride_x - 1) / d->stride_x) * d->channels + 64;
}

static inline int has_flat_room(const struct fv_nn_depthwise *d, int32_t rows)
{
    const int32_t span = span_of(d), all = columns_of(d);
    const int32_t most = span > COLUMNS_MAX ? span : COLUMNS_MAX;
    const ptrdiff_t room = (ptrdiff_t)(all < most ? all : most) * 256 * groups_of(d);
    return flat_part(d) * d->stride_x * rows <= room;
}

static inline int flat_fits(const struct fv_nn_depthwise *d)
{
    if (d->stride_x > 1 && d->channels >= 48) return 0; /* sorting columns takes longer */
    const int32_t blocks = (d->channels + 63) / 64;
    const int is_stored = d->out_stride == d->channels || d->channels == 16 || d->channels == 32;
    return d->kh <= 4 && d->planes * d->kw <= STEPS_MAX && d->channels * 5 < blocks * 64 * 4 &&
           is_stored && has_flat_room(d, d->kh) && phases_of(d) <= PHASES_MAX;
}

/* Output rows that are done together. */
static inline int32_t flat_together(const struct fv_nn_depthwise *d)
{
    return d->kh == 3 && d->kw == 3 && d->planes == 1 && rows_together(d) > 1 && has_flat_room(d, 4)
               ? 2
               : 1;
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

/* Outputs j, j + step, ... of TOGETHER rows, by the copies of KH rows. */
FV_INLINE void flat_outputs(const struct lanes *l, const struct fv_nn_depthwise *d,
                            const uint8_t *const rows[4], ptrdiff_t part, int32_t j, int32_t step,
                            int32_t total, uint8_t *out, const int KH, const int KW,
                            const int PLANES, const int TOGETHER, const int MODE)
{
    const __m512i none = _mm512_setzero_si512();
    const int STEPS = TOGETHER * PLANES * KW;
    ptrdiff_t columns[STEPS_MAX];
    struct held h;
    hold(&h, l, d, l->weights, STEPS);
    for (int kx = 0; kx < KW; kx++) {
        const int32_t column = kx * d->dilation_x;
        columns[kx] = column % d->stride_x * part + (ptrdiff_t)(column / d->stride_x) * d->channels;
    }
    for (; j < total; j += step) {
        __m512i acc[2][4];
#pragma GCC unroll 4
        for (int q = 0; q < 4; q++)
            acc[0][q] = acc[1][q] = l->bias[q];
#pragma GCC unroll 3
        for (int kx = 0; kx < KW; kx++) {
            const ptrdiff_t at = columns[kx] + j;
            __m512i v[4];
            interleave(_mm512_loadu_si512(rows[0] + at),
                       KH > 1 ? _mm512_loadu_si512(rows[1] + at) : none,
                       KH > 2 ? _mm512_loadu_si512(rows[2] + at) : none,
                       KH > 3 ? _mm512_loadu_si512(rows[3] + at) : none, v);
#pragma GCC unroll 2
            for (int p = 0; p < TOGETHER * PLANES; p++) {
#pragma GCC unroll 4
                for (int q = 0; q < 4; q++)
                    acc[p / PLANES][q] =
                        _mm512_dpbusd_epi32(acc[p / PLANES][q], v[q],
                                            weights_of(&h, l->weights, p * KW + kx, q, STEPS));
            }
        }
        store_pixels(d, out, j, total, finish(&h, l, acc[0], MODE));
        if (TOGETHER > 1)
            store_pixels(d, out + (ptrdiff_t)d->out_w * d->out_stride, j, total,
                         finish(&h, l, acc[1], MODE));
    }
}

typedef void flat_outputs_fn(const struct lanes *l, const struct fv_nn_depthwise *d,
                             const uint8_t *const rows[4], ptrdiff_t part, int32_t j, int32_t step,
                             int32_t total, uint8_t *out);

/* Functions of their own, so that each has the registers that it needs. */
#define FLAT(name, kh, kw, planes, together, mode)                                                 \
    static __attribute__((noinline)) void name(                                                    \
        const struct lanes *l, const struct fv_nn_depthwise *d, const uint8_t *const rows[4],      \
        ptrdiff_t part, int32_t j, int32_t step, int32_t total, uint8_t *out)                      \
    {                                                                                              \
        flat_outputs(l, d, rows, part, j, step, total, out, kh, kw, planes, together, mode);       \
    }
FLAT(flat_two_from_zero, 4, 3, 1, 2, BY_REAL | FROM_ZERO)
FLAT(flat_two, 4, 3, 1, 2, BY_REAL)
FLAT(flat_two_exactly, 4, 3, 1, 2, 0)
FLAT(flat_3x3_from_zero, 3, 3, 1, 1, BY_REAL | FROM_ZERO)
FLAT(flat_3x3, 3, 3, 1, 1, BY_REAL)
FLAT(flat_by_real, d->kh, d->kw, d->planes, 1, BY_REAL)
FLAT(flat_exactly, d->kh, d->kw, d->planes, 1, 0)

static inline flat_outputs_fn *flat_for(const struct lanes *l, const struct fv_nn_depthwise *d,
                                        int32_t together)
{
    const int mode = mode_of(l, d);
    if (together == 2)
        return mode == 0 ? flat_two_exactly : mode == BY_REAL ? flat_two : flat_two_from_zero;
    if (mode == 0) return flat_exactly;
    if (d->planes == 1 && d->kw == 3 && d->kh == 3)
        return mode == BY_REAL ? flat_3x3 : flat_3x3_from_zero;
    return flat_by_real;
}

/* The copies of `count` rows from the first under output row y on. Rows of a kernel without gaps
 * share `room` places in rotation: each is copied once, those up to `copied` are there. */
static inline void copy_rows(const struct fv_nn_depthwise *d, const uint8_t *in, int32_t y,
                             int32_t count, int32_t room, int32_t *copied, uint8_t *scratch,
                             const uint8_t *rows[4])
{
    const ptrdiff_t part = flat_part(d), pitch = part * d->stride_x;
    const int is_rotating = d->dilation_y == 1;
    const int32_t first = y * d->stride_y - d->pad_top;
    for (int32_t ky = 0; ky < count; ky++) {
        const int32_t iy = first + ky * d->dilation_y,
                      turn = is_rotating ? (iy % room + room) % room : ky;
        uint8_t *to = scratch + turn * pitch;
        if (!is_rotating || iy > *copied)
            copy_flat(d, input_row(d, in, y, ky, count - d->kh + 1), to, part);
        rows[ky] = to;
    }
    *copied = first + count - 1;
}

static inline void by_flat_rows(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out,
                                int32_t begin, int32_t end, uint8_t *scratch)
{
    const int32_t phases = phases_of(d), total = d->out_w * d->channels,
                  together = flat_together(d);
    struct lanes lanes[PHASES_MAX];
    load_phases(lanes, d, phases);
    int32_t copied = INT32_MIN;
    for (int32_t y = begin, some; y < end; y += some) {
        const uint8_t *rows[4] = {NULL};
        some = end - y < together ? end - y : together;
        copy_rows(d, in, y, d->kh + some - 1, d->kh + together - 1, &copied, scratch, rows);
        for (int32_t p = 0; p < phases && p * 64 < total; p++) {
            flat_outputs_fn *const outputs = flat_for(&lanes[p], d, some);
            outputs(&lanes[p], d, rows, flat_part(d), p * 64, phases * 64, total, out);
        }
        out += (ptrdiff_t)some * d->out_w * d->out_stride;
    }
}

#endif
