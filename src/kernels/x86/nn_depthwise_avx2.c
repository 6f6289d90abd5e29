/* Depthwise convolution with vpmaddwd: two taps at a time, 16 channels at a time, weights as 16-bit sums of their planes. */
#include "kernels/kernels.h"
#include "kernels/x86/nn_avx2.h"

enum { PAIRS_MAX = 32 };

struct block {
    __m256i weights[PAIRS_MAX][2]; /* channels 0-3 8-11 and 4-7 12-15, two taps side by side */
    __m256i bias[2];
    struct scale8 scale[2];
    int32_t pairs;
};

/* Words 0-3 8-11 (`high` 0) or 4-7 12-15 of 16, the order in which interleaving leaves the channels. */
static __m256i pick(const int32_t *words, int high)
{
    const __m128i a = _mm_loadu_si128((const __m128i *)(const void *)(words + 4 * high));
    const __m128i b = _mm_loadu_si128((const __m128i *)(const void *)(words + 8 + 4 * high));
    return _mm256_inserti128_si256(_mm256_castsi128_si256(a), b, 1);
}

static __m256i tap_weights(const struct fv_nn_depthwise *d, int32_t channel, int32_t tap)
{
    __m256i sum = _mm256_setzero_si256();
    const int32_t taps = d->kh * d->kw;
    for (int32_t p = 0; p < d->planes && tap < taps; ++p) {
        const int8_t *w = d->weights + ((ptrdiff_t)p * taps + tap) * d->c16 + channel;
        sum = _mm256_add_epi16(sum, _mm256_cvtepi8_epi16(_mm_load_si128((const __m128i *)(const void *)w)));
    }
    return sum;
}

static void load_block(struct block *b, const struct fv_nn_depthwise *d, int32_t channel)
{
    b->pairs = (d->kh * d->kw + 1) / 2;
    for (int32_t p = 0; p < b->pairs; ++p) {
        const __m256i even = tap_weights(d, channel, 2 * p), odd = tap_weights(d, channel, 2 * p + 1);
        b->weights[p][0] = _mm256_unpacklo_epi16(even, odd);
        b->weights[p][1] = _mm256_unpackhi_epi16(even, odd);
    }
    for (int h = 0; h < 2; ++h) {
        b->bias[h] = pick(d->bias + channel, h);
        load_scale(&b->scale[h], pick(d->multiplier + channel, h), pick(d->shift + channel, h));
    }
}

FV_INLINE __m256i load16(const uint8_t *from)
{
    return _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(const void *)from));
}

static void pixel(const struct block *b, const uint8_t *const *tap, const struct output *o, uint8_t *out, int above)
{
    __m256i low = b->bias[0], high = b->bias[1];
    for (int32_t p = 0; p < b->pairs; ++p) {
        const __m256i even = load16(tap[2 * p]), odd = load16(tap[2 * p + 1]);
        low = _mm256_add_epi32(low, _mm256_madd_epi16(_mm256_unpacklo_epi16(even, odd), b->weights[p][0]));
        high = _mm256_add_epi32(high, _mm256_madd_epi16(_mm256_unpackhi_epi16(even, odd), b->weights[p][1]));
    }
    low = above ? requantize(low, &b->scale[0], 1) : requantize(low, &b->scale[0], 0);
    high = above ? requantize(high, &b->scale[1], 1) : requantize(high, &b->scale[1], 0);
    store16(o, _mm256_packs_epi32(low, high), out);
}

static void row(const struct block *b, const struct fv_nn_depthwise *d, const uint8_t *in, int32_t y, const struct output *o,
                const uint8_t *border, uint8_t *out, int above)
{
    const uint8_t *tap[2 * PAIRS_MAX];
    const int32_t taps = d->kh * d->kw;
    tap[2 * b->pairs - 1] = border; /* when the number of taps is odd; its weights are zero */
    for (int32_t x = 0; x < d->out_w; ++x, out += d->out_stride) {
        for (int32_t t = 0; t < taps; ++t) {
            const int32_t iy = y * d->stride_y - d->pad_top + t / d->kw * d->dilation_y;
            const int32_t ix = x * d->stride_x - d->pad_left + t % d->kw * d->dilation_x;
            const int inside = iy >= 0 && iy < d->in_h && ix >= 0 && ix < d->in_w;
            tap[t] = inside ? in + ((ptrdiff_t)iy * d->in_w + ix) * d->in_stride : border;
        }
        pixel(b, tap, o, out, above);
    }
}

void fv_k_nn_depthwise_u8__avx2(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out, int32_t begin, int32_t end,
                                uint8_t *scratch)
{
    if (d->kh * d->kw > 2 * PAIRS_MAX) {
        fv_k_nn_depthwise_u8__c(d, in, out, begin, end, scratch);
        return;
    }
    uint8_t border[16];
    memset(border, d->zero_in, sizeof border);
    struct output o;
    init_output(&o, d->zero_out, d->act_min, d->act_max, d->table);
    for (int32_t c = 0; c < d->channels; c += 16) {
        struct block b;
        load_block(&b, d, c);
        o.width = d->channels - c < 16 ? d->channels - c : 16;
        for (int32_t y = begin; y < end; ++y) {
            row(&b, d, in + c, y, &o, border, out + c + (ptrdiff_t)(y - begin) * d->out_w * d->out_stride, d->act_min >= d->zero_out);
        }
    }
}
