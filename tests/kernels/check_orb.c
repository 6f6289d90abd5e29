#include "kernels/check.h"

#include <string.h>

/* An image with everything around a centre that moments and BRIEF may read. */
struct patch {
    uint8_t *image;
    int32_t width, height, stride;
};

static struct patch random_patch(struct check *check, int32_t margin)
{
    struct patch patch;
    patch.width = check_between(check, 2 * margin + 1, 2 * margin + 40);
    patch.height = check_between(check, 2 * margin + 1, 2 * margin + 20);
    patch.stride = patch.width + check_between(check, 0, 30);
    const size_t bytes = (size_t)(patch.stride * (patch.height - 1) + patch.width);
    patch.image = check_buffer(check, bytes, 1, 0);
    check_fill(check, patch.image, bytes);
    return patch;
}

static int32_t random_centre(struct check *check, const struct patch *patch, int32_t margin)
{
    return check_between(check, margin, patch->height - 1 - margin) * patch->stride +
           check_between(check, margin, patch->width - 1 - margin);
}

void check_blur7_row_u8(struct check *check, fv_k_blur7_row_u8_fn *reference,
                        fv_k_blur7_row_u8_fn *variant)
{
    const int32_t width = check_between(check, 4, check_between(check, 0, 1) ? 300 : 40);
    const uint8_t *rows[7];
    for (int i = 0; i < 7; i++) {
        uint8_t *row = check_buffer(check, (size_t)width, 1, 0);
        check_fill(check, row, (size_t)width);
        rows[i] = i > 0 && check_between(check, 0, 3) == 0 ? rows[i - 1] : row;
    }
    uint16_t *scratch = check_buffer(check, 2 * (size_t)(width + FV_BLUR7_PAD), 64, 0);
    uint8_t *expected = check_buffer(check, (size_t)width, 1, 0),
            *found = check_buffer(check, (size_t)width, 1, 0);
    reference(expected, rows, width, scratch);
    check_fill(check, scratch, 2 * (size_t)(width + FV_BLUR7_PAD));
    variant(found, rows, width, scratch);
    check_equal(check, "blurred row", expected, found, (size_t)width);
}

void bench_blur7_row_u8(struct check *check, fv_k_blur7_row_u8_fn *variant)
{
    (void)check;
    static uint16_t scratch[BENCH_WIDTH + FV_BLUR7_PAD] __attribute__((aligned(64)));
    for (int y = 3; y < BENCH_HEIGHT - 3; y++) {
        const uint8_t *rows[7];
        for (int i = 0; i < 7; i++)
            rows[i] = bench_image() + (y + i - 3) * BENCH_STRIDE;
        variant(bench_scratch() + y * BENCH_STRIDE, rows, BENCH_WIDTH, scratch);
    }
}

void check_moments_u8(struct check *check, fv_k_moments_u8_fn *reference,
                      fv_k_moments_u8_fn *variant)
{
    enum { COUNT = 5 };
    const struct patch patch = random_patch(check, 16);
    int32_t centres[COUNT], count = check_between(check, 0, COUNT);
    for (int i = 0; i < COUNT; i++)
        centres[i] = random_centre(check, &patch, 16);
    int32_t *expected = check_buffer(check, 8 * (size_t)count, 4, 0),
            *found = check_buffer(check, 8 * (size_t)count, 4, 0);
    reference(expected, patch.image, patch.stride, centres, count);
    variant(found, patch.image, patch.stride, centres, count);
    check_equal(check, "moments", expected, found, 8 * (size_t)count);
}

enum { BENCH_FEATURES = 1000 };

static int32_t bench_centre(int i)
{
    return (20 + i * 7919 % (BENCH_HEIGHT - 40)) * BENCH_STRIDE + 20 +
           i * 6151 % (BENCH_WIDTH - 48);
}

void bench_moments_u8(struct check *check, fv_k_moments_u8_fn *variant)
{
    int32_t centres[BENCH_FEATURES], m[2 * BENCH_FEATURES];
    strcpy(check->size, "1000 features");
    for (int i = 0; i < BENCH_FEATURES; i++)
        centres[i] = bench_centre(i);
    variant(m, bench_image(), BENCH_STRIDE, centres, BENCH_FEATURES);
    memcpy(bench_scratch(), m, sizeof m);
}

void check_brief_u8(struct check *check, fv_k_brief_u8_fn *reference, fv_k_brief_u8_fn *variant)
{
    enum { REACH = 21, MARGIN = REACH + 3 };
    const struct patch patch = random_patch(check, MARGIN);
    const uint8_t *centre = patch.image + random_centre(check, &patch, MARGIN);
    int8_t positions[4 * FV_BRIEF_BITS];
    for (int i = 0; i < 4 * FV_BRIEF_BITS; i++)
        positions[i] = (int8_t)check_between(check, -REACH, REACH);
    const int32_t sign = check_between(check, 0, 1) ? 1 : -1, upright = check_between(check, 0, 1);
    const int32_t along = upright ? sign : sign * patch.stride,
                  across = upright ? sign * patch.stride : -sign;
    uint8_t *expected = check_buffer(check, FV_DESCRIPTOR_BYTES, 1, 0);
    uint8_t *found = check_buffer(check, FV_DESCRIPTOR_BYTES, 1, 0);
    reference(expected, centre, positions, along, across);
    variant(found, centre, positions, along, across);
    check_equal(check, "descriptor", expected, found, FV_DESCRIPTOR_BYTES);
}

void bench_brief_u8(struct check *check, fv_k_brief_u8_fn *variant)
{
    strcpy(check->size, "1000 features");
    int8_t positions[4 * FV_BRIEF_BITS];
    for (int i = 0; i < 4 * FV_BRIEF_BITS; i++)
        positions[i] = (int8_t)(i * 31 % 37 - 18);
    for (int i = 0; i < BENCH_FEATURES; i++)
        variant(bench_scratch() + FV_DESCRIPTOR_BYTES * i, bench_image() + bench_centre(i),
                positions, 1, BENCH_STRIDE);
}
