#include "kernels/check.h"

#include <stdio.h>
#include <string.h>

static struct fv_nn_add draw_add(struct check *check)
{
    struct fv_nn_add p = {.zero_a = check_between(check, 0, 255),
                          .zero_b = check_between(check, 0, 255)};
    check_draw_range(check, &p.zero_out, &p.act_min, &p.act_max);
    p.m_a = (int32_t)(0x40000000u + check_random(check) % 0x40000000u);
    p.m_b = (int32_t)(0x40000000u + check_random(check) % 0x40000000u);
    p.m_out = (int32_t)(0x40000000u + check_random(check) % 0x40000000u);
    p.s_a = check_between(check, 0, 3) == 0 ? check_between(check, -20, 0)
                                            : check_between(check, -3, 0);
    p.s_b = check_between(check, 0, 3) == 0 ? check_between(check, -20, 0)
                                            : check_between(check, -3, 0);
    p.s_out = check_between(check, -22, -16);
    const int32_t half =
        check_between(check, 0, 3); /* the input of the larger scale has the factor one half */
    if (half == 1) p.m_a = 1 << 30, p.s_a = 0;
    if (half == 2) p.m_b = 1 << 30, p.s_b = 0;
    return p;
}

/* Pairs that come so close to where the sum changes that a line which takes its own distance for
 * nothing is wrong by one. */
static const struct {
    struct fv_nn_add p;
    uint8_t a, b;
} close_pairs[] = {
    {{137, 255, 155, 1073741824, 0, 2046397819, -1, 2047703981, -21, 0, 255}, 241, 16},
    {{5, 233, 130, 1657521193, -1, 1703672430, -1, 1862405204, -17, 0, 255}, 224, 51},
    {{100, 245, 50, 1492474938, -3, 1945151604, -9, 1557124434, -19, 0, 255}, 251, 41},
};

void check_nn_add_u8(struct check *check, fv_k_nn_add_u8_fn *reference, fv_k_nn_add_u8_fn *variant)
{
    const int32_t count =
        check_between(check, 0, 1) ? check_between(check, 1, 300) : 16 * check_between(check, 1, 2);
    const int32_t rows = check_between(check, 1, 9);
    const ptrdiff_t lda = count + check_between(check, 0, 20),
                    ldb = count + check_between(check, 0, 20);
    const size_t bytes_a = (size_t)((rows - 1) * lda + count),
                 bytes_b = (size_t)((rows - 1) * ldb + count);
    struct fv_nn_add p = draw_add(check);
    uint8_t *a = check_buffer(check, bytes_a, 1, 0), *b = check_buffer(check, bytes_b, 1, 0);
    uint8_t *expected = check_buffer(check, bytes_a, 1, 0),
            *found = check_buffer(check, bytes_a, 1, 0);
    check_fill(check, a, bytes_a);
    check_fill(check, b, bytes_b);
    const int32_t close = check_between(check, 0, 31);
    if (close < 3) {
        p = close_pairs[close].p;
        memset(a, close_pairs[close].a, bytes_a);
        memset(b, close_pairs[close].b, bytes_b);
    }
    const int in_place = check_between(check, 0, 1);
    if (in_place) {
        memcpy(found, a, bytes_a);
        memcpy(expected, a, bytes_a);
    }
    reference(&p, a, lda, b, ldb, expected, lda, rows, count);
    variant(&p, in_place ? found : a, lda, b, ldb, found, lda, rows, count);
    check_equal(check, "out", expected, found, bytes_a);
}

void bench_nn_add_u8(struct check *check, fv_k_nn_add_u8_fn *variant)
{
    const struct fv_nn_add p = draw_add(check);
    snprintf(check->size, sizeof check->size, "65536");
    variant(&p, bench_scratch(), 256, bench_scratch() + (1 << 20), 256, bench_scratch() + (2 << 20),
            256, 256, 256);
}

/* Their shifts reach further than those of sums: products are small. */
static struct fv_nn_add draw_product(struct check *check)
{
    struct fv_nn_add p = draw_add(check);
    const int far = check_between(check, 0, 7) == 0; /* all that the model's check lets through */
    p.s_a = far ? check_between(check, -31, 30) : check_between(check, -8, 3);
    p.s_out = far ? check_between(check, -31, 30) : check_between(check, -20, 2);
    return p;
}

static void check_products(struct check *check, fv_k_nn_add_u8_fn *reference,
                           fv_k_nn_add_u8_fn *variant)
{
    const int32_t count = check_between(check, 1, 300), rows = check_between(check, 1, 5);
    const ptrdiff_t lda = count + check_between(check, 0, 20),
                    ldb = check_between(check, 0, 1) ? 0 : lda;
    const size_t bytes = (size_t)((rows - 1) * lda + count);
    const struct fv_nn_add p = draw_product(check);
    uint8_t *a = check_buffer(check, bytes, 1, 0),
            *b = check_buffer(check, ldb == 0 ? (size_t)count : bytes, 1, 0);
    uint8_t *expected = check_buffer(check, bytes, 1, 0), *found = check_buffer(check, bytes, 1, 0);
    check_fill(check, a, bytes);
    check_fill(check, b, ldb == 0 ? (size_t)count : bytes);
    memcpy(found, a, bytes);
    memcpy(expected, a, bytes);
    reference(&p, a, lda, b, ldb, expected, lda, rows, count);
    variant(&p, found, lda, b, ldb, found, lda, rows, count);
    check_equal(check, "out", expected, found, bytes);
}

void check_nn_sub_u8(struct check *check, fv_k_nn_sub_u8_fn *reference, fv_k_nn_sub_u8_fn *variant)
{
    check_nn_add_u8(check, reference, variant);
}

void bench_nn_sub_u8(struct check *check, fv_k_nn_sub_u8_fn *variant)
{
    bench_nn_add_u8(check, variant);
}

void check_nn_mul_u8(struct check *check, fv_k_nn_mul_u8_fn *reference, fv_k_nn_mul_u8_fn *variant)
{
    check_products(check, reference, variant);
}

void bench_nn_mul_u8(struct check *check, fv_k_nn_mul_u8_fn *variant)
{
    bench_nn_add_u8(check, variant);
}

void check_nn_prelu_u8(struct check *check, fv_k_nn_prelu_u8_fn *reference,
                       fv_k_nn_prelu_u8_fn *variant)
{
    check_products(check, reference, variant);
}

void bench_nn_prelu_u8(struct check *check, fv_k_nn_prelu_u8_fn *variant)
{
    bench_nn_add_u8(check, variant);
}

void check_nn_max_u8(struct check *check, fv_k_nn_max_u8_fn *reference, fv_k_nn_max_u8_fn *variant)
{
    const int32_t count = check_between(check, 1, 300);
    uint8_t *a = check_buffer(check, (size_t)count, 1, 0),
            *b = check_buffer(check, (size_t)count, 1, 0);
    uint8_t *expected = check_buffer(check, (size_t)count, 1, 0),
            *found = check_buffer(check, (size_t)count, 1, 0);
    check_fill(check, a, (size_t)count);
    check_fill(check, b, (size_t)count);
    memcpy(found, a, (size_t)count);
    reference(a, b, expected, count);
    variant(found, b, found, count);
    check_equal(check, "out", expected, found, (size_t)count);
}

void bench_nn_max_u8(struct check *check, fv_k_nn_max_u8_fn *variant)
{
    snprintf(check->size, sizeof check->size, "65536");
    variant(bench_scratch(), bench_scratch() + (1 << 20), bench_scratch() + (2 << 20), 65536);
}

void check_nn_min_u8(struct check *check, fv_k_nn_min_u8_fn *reference, fv_k_nn_min_u8_fn *variant)
{
    check_nn_max_u8(check, reference, variant);
}

void bench_nn_min_u8(struct check *check, fv_k_nn_min_u8_fn *variant)
{
    bench_nn_max_u8(check, variant);
}
