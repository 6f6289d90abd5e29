#include "kernels/check.h"

/* Two bytes per pixel, BENCH_STRIDE pixels per row. */
static const uint8_t *bench_words(void)
{
    return bench_scratch() + (4 << 20);
}

void check_grey_shift_u16(struct check *check, fv_k_grey_shift_u16_fn *reference,
                          fv_k_grey_shift_u16_fn *variant)
{
    const int32_t count = check_between(check, 0, 400), shift = check_between(check, 0, 8);
    uint8_t *source = check_buffer(check, 2 * (size_t)count, 1, 0);
    uint8_t *expected = check_buffer(check, (size_t)count, 1, 0),
            *found = check_buffer(check, (size_t)count, 1, 0);
    check_fill(check, source, 2 * (size_t)count);
    reference(expected, source, count, shift);
    variant(found, source, count, shift);
    check_equal(check, "grey", expected, found, (size_t)count);
}

void bench_grey_shift_u16(struct check *check, fv_k_grey_shift_u16_fn *variant)
{
    (void)check;
    for (int y = 0; y < BENCH_HEIGHT; y++)
        variant(bench_scratch() + y * BENCH_STRIDE, bench_words() + 2 * y * BENCH_STRIDE,
                BENCH_WIDTH, 2);
}

void check_grey_pick_u8(struct check *check, fv_k_grey_pick_u8_fn *reference,
                        fv_k_grey_pick_u8_fn *variant)
{
    const int32_t count = check_between(check, 0, 400), offset = check_between(check, 0, 1);
    uint8_t *source = check_buffer(check, 2 * (size_t)count, 1, 0);
    uint8_t *expected = check_buffer(check, (size_t)count, 1, 0),
            *found = check_buffer(check, (size_t)count, 1, 0);
    check_fill(check, source, 2 * (size_t)count);
    reference(expected, source, count, offset);
    variant(found, source, count, offset);
    check_equal(check, "grey", expected, found, (size_t)count);
}

void bench_grey_pick_u8(struct check *check, fv_k_grey_pick_u8_fn *variant)
{
    (void)check;
    for (int y = 0; y < BENCH_HEIGHT; y++)
        variant(bench_scratch() + y * BENCH_STRIDE, bench_words() + 2 * y * BENCH_STRIDE,
                BENCH_WIDTH, 0);
}

void check_grey_mix_u8(struct check *check, fv_k_grey_mix_u8_fn *reference,
                       fv_k_grey_mix_u8_fn *variant)
{
    const int32_t count = check_between(check, 0, 400),
                  first = check_between(check, 0, 1) ? 9798 : 3735;
    uint8_t *source = check_buffer(check, 3 * (size_t)count, 1, 0);
    uint8_t *expected = check_buffer(check, (size_t)count, 1, 0),
            *found = check_buffer(check, (size_t)count, 1, 0);
    check_fill(check, source, 3 * (size_t)count);
    reference(expected, source, count, first, 13533 - first);
    variant(found, source, count, first, 13533 - first);
    check_equal(check, "grey", expected, found, (size_t)count);
}

void bench_grey_mix_u8(struct check *check, fv_k_grey_mix_u8_fn *variant)
{
    (void)check;
    for (int y = 0; y < BENCH_HEIGHT; y++)
        variant(bench_scratch() + y * BENCH_STRIDE, bench_words() + 3 * y * BENCH_STRIDE,
                BENCH_WIDTH, 9798, 3735);
}

void check_grey_bayer_u8(struct check *check, fv_k_grey_bayer_u8_fn *reference,
                         fv_k_grey_bayer_u8_fn *variant)
{
    const int32_t count = check_between(check, 2, 400);
    const size_t bytes = (size_t)count;
    uint8_t *rows[3];
    for (int k = 0; k < 3; k++) {
        rows[k] = check_buffer(check, bytes, 1, 0);
        check_fill(check, rows[k], bytes);
    }
    uint8_t *expected = check_buffer(check, bytes, 1, 0), *found = check_buffer(check, bytes, 1, 0);
    reference(expected, rows[0], rows[1], rows[2], count);
    variant(found, rows[0], rows[1], rows[2], count);
    check_equal(check, "grey", expected, found, bytes);
}

void bench_grey_bayer_u8(struct check *check, fv_k_grey_bayer_u8_fn *variant)
{
    (void)check;
    for (int y = 1; y < BENCH_HEIGHT; y++) {
        const uint8_t *row = bench_image() + y * BENCH_STRIDE;
        variant(bench_scratch() + y * BENCH_STRIDE, row - BENCH_STRIDE, row, row + BENCH_STRIDE,
                BENCH_WIDTH);
    }
}
