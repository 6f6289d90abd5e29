/* Each output pixel of a pooling is the largest of its window's inputs, for windows drawn at
 * random: images smaller than the window, and windows that lie beyond the image. An inaccessible
 * page follows the image and its slack, so that reading past it faults. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>
#include <sys/mman.h>

#include "base/elementary.h"
#include "kernels/cpu.h"
#include "nn/run.h"

enum { ROUNDS = 3000, OUT_MAX = 1 << 17, IMAGE_MAX = 1 << 18, GUARD = 1 << 16, UNTOUCHED = 0x5A };

static struct fv_random source;
static uint8_t *image_end, out[OUT_MAX]; /* image_end: of what may be read */

static int32_t draw(int32_t least, int32_t most)
{
    return least + (int32_t)fv_random_below(&source, (uint32_t)(most - least + 1));
}

static struct fv_op_pool draw_pool(void)
{
    const int32_t far = draw(0, 2) == 0 ? 90 : 3,
                  channels = draw(0, 3) == 0 ? draw(100, 3000) : draw(1, 40);
    const struct fv_op_window w = {.kh = draw(1, 5),
                                   .kw = draw(1, 5),
                                   .stride_y = draw(1, 3),
                                   .stride_x = draw(1, 3),
                                   .dilation_y = 1,
                                   .dilation_x = 1,
                                   .pad_top = draw(0, far),
                                   .pad_left = draw(0, far)};
    const struct fv_op_image im = {.batch = draw(1, 2),
                                   .in_h = draw(1, 4),
                                   .in_w = draw(1, channels > 40 ? 10 : 70),
                                   .in_c = channels,
                                   .in_stride = channels + (draw(0, 3) == 0 ? 5 : 0),
                                   .out_h = draw(1, 4),
                                   .out_w = draw(1, channels > 40 ? 5 : far),
                                   .out_c = channels,
                                   .out_stride = channels + (draw(0, 3) == 0 ? 5 : 0)};
    const int32_t least = draw(0, 3) == 0 ? draw(0, 255) : 0;
    return (struct fv_op_pool){
        .image = im, .window = w, .act_min = least, .act_max = draw(0, 1) ? 255 : draw(least, 255)};
}

/* `row`: of output pixels, counted over all images. */
static int32_t largest(const struct fv_op_pool *p, const uint8_t *image, int32_t row, int32_t x,
                       int32_t channel)
{
    const struct fv_op_image *im = &p->image;
    const int32_t y = row % im->out_h * p->window.stride_y - p->window.pad_top,
                  first = row / im->out_h * im->in_h;
    int32_t most = p->act_min;
    x = x * p->window.stride_x - p->window.pad_left;
    for (int32_t iy = y; iy < y + p->window.kh; iy++) {
        for (int32_t ix = x; ix < x + p->window.kw; ix++) {
            if (iy < 0 || iy >= im->in_h || ix < 0 || ix >= im->in_w) continue;
            const int32_t value = image[((first + iy) * im->in_w + ix) * im->in_stride + channel];
            most = value > most ? value : most;
        }
    }
    return most < p->act_max ? most : p->act_max;
}

static void check_outputs(const struct fv_op_pool *p, const uint8_t *image)
{
    const struct fv_op_image *im = &p->image;
    for (int32_t i = 0; i < im->batch * im->out_h * im->out_w; i++) {
        const uint8_t *pixel = out + i * im->out_stride;
        for (int32_t c = 0; c < im->out_stride; c++) {
            assert_int_equal(pixel[c], c < im->in_c
                                           ? largest(p, image, i / im->out_w, i % im->out_w, c)
                                           : UNTOUCHED);
        }
    }
}

static void outputs_are_the_largest_of_their_windows(void **state)
{
    struct fv_kernels kernels;
    (void)state;
    fv_random_seed(&source, 5);
    for (int round = 0; round < ROUNDS; round++) {
        const struct fv_model_op op = {.u.pool = draw_pool()};
        const struct fv_op_image *im = &op.u.pool.image;
        const int32_t pixels = im->batch * im->in_h * im->in_w, rows = im->batch * im->out_h,
                      half = draw(0, rows);
        uint8_t *image =
            image_end - FV_MODEL_SLACK_BYTES - ((pixels - 1) * im->in_stride + im->in_c);
        const struct fv_nn_call call = {
            .kernels = &kernels, .op = &op, .in = {image}, .out = {out}};
        fv_kernels_init(&kernels, round % 2 == 0 ? FV_CPU_C : fv_cpu_best(fv_cpu_detect()));
        memset(out, UNTOUCHED, sizeof out);
        fv_nn_op_pool(&call, 0, half);
        fv_nn_op_pool(&call, half, rows);
        check_outputs(&op.u.pool, image);
    }
}

static int map_image(void **state)
{
    (void)state;
    uint8_t *pages =
        mmap(NULL, IMAGE_MAX + GUARD, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (pages == MAP_FAILED) return -1;
    image_end = pages + IMAGE_MAX;
    fv_random_seed(&source, 17);
    for (int32_t i = 0; i < IMAGE_MAX; i++)
        pages[i] = (uint8_t)fv_random_u32(&source);
    return mprotect(image_end, GUARD, PROT_NONE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(outputs_are_the_largest_of_their_windows)};
    return cmocka_run_group_tests(tests, map_image, NULL);
}
