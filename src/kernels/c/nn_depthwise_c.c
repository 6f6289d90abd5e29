#include "kernels/kernels.h"
#include "kernels/nn_requantize.h"

#include <stdbool.h>
#include <string.h>

enum { BLOCK = 16 }; /* channels that are summed together */

static inline void add_tap(uint32_t acc[restrict BLOCK], const uint8_t *in, const int8_t *w)
{
    for (int32_t c = 0; c < BLOCK; c++)
        acc[c] += (uint32_t)(in[c] * w[c]);
}

/* Accumulators of a block of channels from `first` on. Where the block has more than there are, the
 * input's next bytes are read. */
static void accumulate(const struct fv_nn_depthwise *d, const uint8_t *in, int32_t y, int32_t x,
                       int32_t first, uint32_t acc[BLOCK])
{
    uint8_t outside[BLOCK];
    const int32_t taps = d->kh * d->kw;
    memset(outside, d->zero_in, sizeof outside);
    for (int32_t c = 0; c < BLOCK; c++)
        acc[c] = (uint32_t)d->bias[first + c];
    for (int32_t tap = 0; tap < taps; tap++) {
        const int32_t iy = y * d->stride_y - d->pad_top + tap / d->kw * d->dilation_y;
        const int32_t ix = x * d->stride_x - d->pad_left + tap % d->kw * d->dilation_x;
        const bool inside = iy >= 0 && iy < d->in_h && ix >= 0 && ix < d->in_w;
        const uint8_t *from =
            inside ? in + ((ptrdiff_t)iy * d->in_w + ix) * d->in_stride + first : outside;
        for (int32_t p = 0; p < d->planes; p++)
            add_tap(acc, from, d->weights + ((ptrdiff_t)p * taps + tap) * d->c16 + first);
    }
}

static void row(const struct fv_nn_depthwise *d, const uint8_t *in, uint8_t *out, int32_t y)
{
    uint32_t acc[BLOCK];
    for (int32_t x = 0; x < d->out_w; x++) {
        for (int32_t c = 0; c < d->channels; c++) {
            if (c % BLOCK == 0) accumulate(d, in, y, x, c, acc);
            const int32_t scaled =
                fv_nn_requantize((int32_t)acc[c % BLOCK], d->multiplier[c], d->shift[c]);
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
