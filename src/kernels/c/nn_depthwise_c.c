#include "kernels/kernels.h"
#include "kernels/nn_requantize.h"

static int32_t accumulate(const struct fv_nn_depthwise *d, const uint8_t *in, int32_t y, int32_t x,
                          int32_t c)
{
    uint32_t sum = (uint32_t)d->bias[c];
    const int32_t taps = d->kh * d->kw;
    for (int32_t tap = 0; tap < taps; tap++) {
        const int32_t iy = y * d->stride_y - d->pad_top + tap / d->kw * d->dilation_y;
        const int32_t ix = x * d->stride_x - d->pad_left + tap % d->kw * d->dilation_x;
        const int inside = iy >= 0 && iy < d->in_h && ix >= 0 && ix < d->in_w;
        const int32_t v =
            inside ? in[((ptrdiff_t)iy * d->in_w + ix) * d->in_stride + c] : d->zero_in;
        for (int32_t p = 0; p < d->planes; p++)
            sum += (uint32_t)(v * d->weights[((ptrdiff_t)p * taps + tap) * d->c16 + c]);
    }
    return (int32_t)sum;
}

static void row(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out, int32_t y)
{
    for (int32_t x = 0; x < d->out_w; x++) {
        for (int32_t c = 0; c < d->channels; c++) {
            const int32_t acc = accumulate(d, in, y, x, c);
            const int32_t scaled = fv_nn_requantize(acc, d->multiplier[c], d->shift[c]);
            const uint8_t value = fv_nn_output(scaled, d->zero_out, d->act_min, d->act_max);
            out[(ptrdiff_t)x * d->out_stride + c] = d->table == NULL ? value : d->table[value];
        }
    }
}

void fv_k_nn_depthwise_u8__c(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out,
                             int32_t begin, int32_t end, uint8_t *scratch)
{
    (void)scratch;
    for (int32_t y = begin; y < end; y++)
        row(d, in, out + (ptrdiff_t)(y - begin) * d->out_w * d->out_stride, y);
}
