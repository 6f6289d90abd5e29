#include "kernels/check.h"

#include <stdio.h>

static const int32_t *draw_exps(struct check *check)
{
    int32_t *exps = check_buffer(check, 1024, 4, 0);
    const int32_t base = check_between(check, 400, 999), end = check_between(check, 1, 256);
    int64_t value = INT32_MAX;
    for (int32_t i = 0; i < 256; i++, value = value * base / 1000)
        exps[i] = i < end ? (int32_t)value : -1;
    return exps;
}

void check_nn_softmax_u8(struct check *check, fv_k_nn_softmax_u8_fn *reference,
                         fv_k_nn_softmax_u8_fn *variant)
{
    static const int32_t most[5] = {40, 40, 1001, 1001, 8191};
    const int32_t depth = check_between(check, 1, most[check_between(check, 0, 4)]),
                  rows = check_between(check, 1, depth <= 40 ? 300 : 20);
    const int32_t *exps = draw_exps(check);
    const size_t bytes = (size_t)depth * (size_t)rows;
    uint8_t *in = check_buffer(check, bytes, 1, 0), *expected = check_buffer(check, bytes, 1, 0),
            *found = check_buffer(check, bytes, 1, 0);
    check_fill(check, in, bytes);
    reference(exps, in, expected, depth, rows);
    variant(exps, in, found, depth, rows);
    check_equal(check, "out", expected, found, bytes);
}

void bench_nn_softmax_u8(struct check *check, fv_k_nn_softmax_u8_fn *variant)
{
    if (check->kept == NULL) check->kept = (void *)(uintptr_t)draw_exps(check);
    snprintf(check->size, sizeof check->size, "4116 x 16");
    variant(check->kept, bench_scratch(), bench_scratch() + (1 << 20), 16, 4116);
}
