/* What a convolution gives to the matrix product, gathered or where it lies: of each output pixel
 * the inputs under its kernel, or what stands for zero outside of the image, for windows drawn at
 * random: borders, strides, dilation, pictures that lie in larger ones, and images smaller than the
 * kernel. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "base/elementary.h"
#include "kernels/cpu.h"
#include "nn/run.h"

enum { SIDE_MAX = 70, STRIDE_MAX = 24, K_MAX = 5 * 5 * STRIDE_MAX, ROUNDS = 600, ZERO = 131 };
enum { PIXELS_MAX = SIDE_MAX * SIDE_MAX, SLACK = 64 };

static uint8_t image[PIXELS_MAX * STRIDE_MAX + SLACK], out[PIXELS_MAX];
static uint8_t found[PIXELS_MAX][K_MAX];
static _Alignas(64) uint8_t scratch[FV_MODEL_CONV_PIXELS * (K_MAX + 160)];
static int times[PIXELS_MAX];
static _Alignas(64) uint8_t base[64 + (K_MAX + 3) / 4 * 64]; /* of the file: parameters, weights */
static struct fv_model_tensor scratch_record;

/* In place of the product: takes the rows. */
static void take_rows(const struct fv_nn_gemm *g, const uint8_t *a, ptrdiff_t lda, uint8_t *to,
                      ptrdiff_t ldo, int32_t m)
{
    assert_int_equal(ldo, 1);
    for (int32_t i = 0; i < m; i++) {
        memcpy(found[to - out + i], a + i * lda, (size_t)g->k);
        times[to - out + i]++;
    }
}

/* Likewise in place of the product of inputs that lie apart: takes those with a weight. */
static void take_row_apart(const struct fv_nn_gemm *g, const int32_t *offsets, const uint8_t *in,
                           ptrdiff_t to)
{
    uint8_t *row = found[to];
    for (int32_t k = 0; k < 4 * g->k4; k++) {
        if (g->weights[k / 4 * 64 + k % 4] != 0) *row++ = in[offsets[k / 4] + k % 4];
    }
    assert_int_equal(row - found[to], g->k);
    times[to]++;
}

static void take_apart(const struct fv_nn_gemm *g, const int32_t *offsets,
                       const struct fv_nn_rows *rows, int32_t count)
{
    for (const struct fv_nn_rows *r = rows; r < rows + count; r++) {
        for (int32_t i = 0; i < r->count; i++)
            take_row_apart(g, offsets, r->in + i * r->in_step, r->out + i * r->out_step - out);
    }
}

static struct fv_random source;

static int32_t draw(int32_t least, int32_t most)
{
    return least + (int32_t)fv_random_below(&source, (uint32_t)(most - least + 1));
}

static struct fv_op_conv draw_conv(void)
{
    const struct fv_op_window w = {.kh = draw(1, 5),
                                   .kw = draw(1, 5),
                                   .stride_y = draw(1, 3),
                                   .stride_x = draw(1, 3),
                                   .dilation_y = draw(0, 3) == 0 ? 2 : 1,
                                   .dilation_x = draw(0, 3) == 0 ? 2 : 1,
                                   .pad_top = draw(0, 3),
                                   .pad_left = draw(-2, 3)};
    const int32_t channels = draw(1, 20),
                  most = draw(0, 3) == 0 ? 6 : SIDE_MAX; /* often smaller than the kernel */
    struct fv_op_image im = {.batch = draw(1, 2),
                             .in_h = draw(1, 12),
                             .in_w = draw(1, most),
                             .in_c = channels,
                             .in_stride = draw(0, 3) == 0 ? channels + 4 : channels,
                             .out_h = draw(1, 12),
                             .out_c = 1,
                             .out_stride = 1};
    im.out_w = draw(1, (im.in_w + 2 * (w.pad_left < 0 ? 0 : w.pad_left)) / w.stride_x + 1);
    return (struct fv_op_conv){
        .image = im,
        .window = w,
        .k = w.kh * w.kw * channels,
        .k4 = (w.kh * w.kw * channels + 3) / 4,
        .zero_in = ZERO,
        .weights = 64,
    };
}

static uint8_t input_at(const struct fv_op_conv *c, int32_t n, int32_t y, int32_t x,
                        int32_t channel)
{
    const struct fv_op_image *im = &c->image;
    return y < 0 || y >= im->in_h || x < 0 || x >= im->in_w
               ? ZERO
               : image[((n * im->in_h + y) * im->in_w + x) * im->in_stride + channel];
}

/* `row`: of output pixels, counted over all images. */
static void check_pixel(const struct fv_op_conv *c, int32_t row, int32_t x)
{
    const struct fv_op_window *w = &c->window;
    const int32_t n = row / c->image.out_h, iy = row % c->image.out_h * w->stride_y - w->pad_top,
                  ix = x * w->stride_x - w->pad_left;
    const uint8_t *inputs = found[row * c->image.out_w + x];
    for (int32_t ky = 0; ky < w->kh; ky++)
        for (int32_t kx = 0; kx < w->kw; kx++)
            for (int32_t channel = 0; channel < c->image.in_c; channel++)
                assert_int_equal(*inputs++, input_at(c, n, iy + ky * w->dilation_y,
                                                     ix + kx * w->dilation_x, channel));
}

/* All that was used of the scratch is cleared, and nothing past its end was touched. */
static void check_scratch(void)
{
    const size_t end = (size_t)scratch_record.bytes;
    for (size_t i = 0; i < sizeof scratch; i++)
        assert_int_equal(scratch[i], i < end ? 0 : ZERO);
}

/* A weight of one for each of the k inputs of the channel; the scratch that the loader asks for. */
static void set_weights(const struct fv_op_conv *c)
{
    memset(base, 0, sizeof base);
    for (int32_t k = 0; k < c->k; k++)
        base[c->weights + k / 4 * 64 + k % 4] = 1;
    scratch_record.bytes =
        FV_MODEL_CONV_PIXELS * ((c->k4 * 4 + 15 + 63) / 64 * 64) + FV_MODEL_SLACK_BYTES;
}

static void rows_hold_the_inputs_of_their_pixels(void **state)
{
    const struct fv_model model = {.base = base, .tensors = &scratch_record};
    struct fv_kernels kernels;
    (void)state;
    fv_random_seed(&source, 11);
    for (size_t i = 0; i < sizeof image; i++)
        image[i] = (uint8_t)fv_random_u32(&source);
    for (int round = 0; round < ROUNDS; round++) {
        const struct fv_model_op op = {.u.conv = draw_conv()};
        const struct fv_op_image *im = &op.u.conv.image;
        fv_kernels_init(&kernels, round % 2 == 0 ? FV_CPU_C : fv_cpu_best(fv_cpu_detect()));
        kernels.nn_gemm_u8 = take_rows;
        kernels.nn_apart_u8 = round % 3 == 0 ? fv_k_nn_apart_u8__c : take_apart;
        set_weights(&op.u.conv);
        const struct fv_nn_call call = {.model = &model,
                                        .kernels = &kernels,
                                        .op = &op,
                                        .in = {image},
                                        .out = {out},
                                        .scratch = scratch};
        memset(times, 0, sizeof times);
        memset(scratch, 0, sizeof scratch);
        memset(scratch + scratch_record.bytes, ZERO, sizeof scratch - (size_t)scratch_record.bytes);
        const int32_t rows = im->batch * im->out_h, half = draw(0, rows);
        fv_nn_op_conv(&call, 0, half);
        fv_nn_op_conv(&call, half, rows);
        for (int32_t y = 0; y < rows; y++)
            for (int32_t x = 0; x < im->out_w; x++) {
                assert_int_equal(times[y * im->out_w + x], 1);
                check_pixel(&op.u.conv, y, x);
            }
        check_scratch();
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(rows_hold_the_inputs_of_their_pixels)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
