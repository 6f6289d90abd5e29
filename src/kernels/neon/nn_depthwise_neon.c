/* Depthwise convolution, 16 channels at a time, one tap after the other, weights as 16-bit sums of
 * their planes. */
#include "kernels/neon/nn_neon.h"

enum { TAPS_MAX = 64 };

struct block {
    int16x8_t weights[TAPS_MAX][2];
    int32x4_t bias[4];
    struct scale16 scale;
    int32_t width;
};

static void load_block(struct block *b, const struct fv_nn_depthwise *d, int32_t channel)
{
    const int32_t taps = d->kh * d->kw;
    for (int32_t t = 0; t < taps; t++) {
        b->weights[t][0] = b->weights[t][1] = vdupq_n_s16(0);
        for (int32_t p = 0; p < d->planes; p++) {
            const int8x16_t w = vld1q_s8(d->weights + ((ptrdiff_t)p * taps + t) * d->c16 + channel);
            b->weights[t][0] = vaddw_s8(b->weights[t][0], vget_low_s8(w));
            b->weights[t][1] = vaddw_s8(b->weights[t][1], vget_high_s8(w));
        }
    }
    for (int i = 0; i < 4; i++)
        b->bias[i] = vld1q_s32(d->bias + channel + 4 * i);
    load_scale(&b->scale, d->multiplier + channel, d->shift + channel);
    b->width = d->channels - channel < 16 ? d->channels - channel : 16;
}

static void pixel(const struct block *b, const uint8_t *const *tap, int32_t taps,
                  const struct output *o, uint8_t *out)
{
    int32x4_t acc[4] = {b->bias[0], b->bias[1], b->bias[2], b->bias[3]};
    for (int32_t t = 0; t < taps; t++) {
        const uint8x16_t v = vld1q_u8(tap[t]);
        const int16x8_t low = vreinterpretq_s16_u16(vmovl_u8(vget_low_u8(v))),
                        high = vreinterpretq_s16_u16(vmovl_u8(vget_high_u8(v)));
        acc[0] = vmlal_s16(acc[0], vget_low_s16(low), vget_low_s16(b->weights[t][0]));
        acc[1] = vmlal_high_s16(acc[1], low, b->weights[t][0]);
        acc[2] = vmlal_s16(acc[2], vget_low_s16(high), vget_low_s16(b->weights[t][1]));
        acc[3] = vmlal_high_s16(acc[3], high, b->weights[t][1]);
    }
    requantize16(acc, &b->scale);
    store16(o, acc, out, b->width);
}

static void row(const struct block *b, const struct fv_nn_depthwise *d, const uint8_t *in,
                int32_t y, const struct output *o, const uint8_t *border, uint8_t *out)
{
    const uint8_t *tap[TAPS_MAX];
    const int32_t taps = d->kh * d->kw;
    for (int32_t x = 0; x < d->out_w; x++, out += d->out_stride) {
        for (int32_t ky = 0, t = 0; ky < d->kh; ky++) {
            const int32_t iy = y * d->stride_y - d->pad_top + ky * d->dilation_y;
            for (int32_t kx = 0; kx < d->kw; kx++, t++) {
                const int32_t ix = x * d->stride_x - d->pad_left + kx * d->dilation_x;
                const int inside = iy >= 0 && iy < d->in_h && ix >= 0 && ix < d->in_w;
                tap[t] = inside ? in + ((ptrdiff_t)iy * d->in_w + ix) * d->in_stride : border;
            }
        }
        pixel(b, tap, taps, o, out);
    }
}

void fv_k_nn_depthwise_u8__neon(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out,
                                int32_t begin, int32_t end, uint8_t *scratch)
{
    if (d->kh * d->kw > TAPS_MAX) {
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
        for (int32_t y = begin; y < end; y++) {
            row(&b, d, in + c, y, &o, border,
                out + c + (ptrdiff_t)(y - begin) * d->out_w * d->out_stride);
        }
    }
}
