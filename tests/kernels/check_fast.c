#include <string.h>

#include "kernels/check.h"

enum { SLACK = 64, MARGIN = 3 };

void check_fast_score_u8(struct check *check, fv_k_fast_score_u8_fn *reference,
                         fv_k_fast_score_u8_fn *variant)
{
    const int32_t count = check_between(check, 1, 300), threshold = check_between(check, 1, 254);
    const int32_t stride = count + 2 * MARGIN + check_between(check, 0, 40);
    const size_t bytes = (size_t)(stride * 6 + count + 2 * MARGIN);
    uint8_t *image = check_buffer(check, bytes, 1, SLACK);
    uint8_t *expected = check_buffer(check, (size_t)count, 1, SLACK),
            *found = check_buffer(check, (size_t)count, 1, SLACK);
    const uint8_t *pixels = image + 3 * stride + MARGIN;
    uint8_t *thresholds = check_buffer(check, (size_t)count, 1, SLACK);
    check_fill(check, image, bytes);
    /* Low thresholds more often: noise passes them everywhere. And another for some pixels. */
    const int32_t t = check_between(check, 0, 1) ? threshold : 1 + threshold % 30,
                  other = check_between(check, 1, 254), some = check_between(check, 0, 9);
    for (int32_t i = 0; i < count; i++)
        thresholds[i] = (uint8_t)(check_between(check, 1, 10) <= some ? other : t);
    reference(expected, pixels, stride, thresholds, count);
    variant(found, pixels, stride, thresholds, count);
    check_equal(check, "scores", expected, found, (size_t)count);
}

void bench_fast_score_u8(struct check *check, fv_k_fast_score_u8_fn *variant)
{
    (void)check;
    uint8_t thresholds[BENCH_STRIDE];
    memset(thresholds, 20, sizeof thresholds);
    for (int y = 3; y < BENCH_HEIGHT - 3; y++)
        variant(bench_scratch() + y * BENCH_STRIDE, bench_image() + y * BENCH_STRIDE + 3,
                BENCH_STRIDE, thresholds, BENCH_WIDTH - 6);
}

void check_fast_peaks_u8(struct check *check, fv_k_fast_peaks_u8_fn *reference,
                         fv_k_fast_peaks_u8_fn *variant)
{
    const int32_t count = check_between(check, 1, 300);
    const size_t bytes = (size_t)count + 2, columns_bytes = 2 * (size_t)((count + 1) / 2);
    uint8_t *rows[3];
    for (int k = 0; k < 3; k++) {
        rows[k] = check_buffer(check, bytes, 1, SLACK);
        check_fill(check, rows[k], bytes);
    }
    if (check_between(check, 0, 1))
        for (size_t i = 0; i < bytes; i++)
            for (int k = 0; k < 3; k++)
                if (check_between(check, 0, 9)) rows[k][i] = 0;
    uint16_t *expected = check_buffer(check, columns_bytes, 2, 0),
             *found = check_buffer(check, columns_bytes, 2, 0);
    const int32_t n = reference(expected, rows[0], rows[1], rows[2], 1, count + 1);
    const int32_t m = variant(found, rows[0], rows[1], rows[2], 1, count + 1);
    if (n != m) check_fail(check, "C finds %d peaks, found %d", n, m);
    check_equal(check, "columns", expected, found, columns_bytes);
}

void bench_fast_peaks_u8(struct check *check, fv_k_fast_peaks_u8_fn *variant)
{
    uint8_t *scores = bench_scratch();
    uint16_t *columns = (uint16_t *)(void *)(scores + BENCH_STRIDE * BENCH_HEIGHT);
    if (check->kept == NULL) {
        uint8_t thresholds[BENCH_STRIDE];
        memset(thresholds, 20, sizeof thresholds);
        check->kept = scores;
        for (int y = 3; y < BENCH_HEIGHT - 3; y++)
            fv_k_fast_score_u8__c(scores + y * BENCH_STRIDE, bench_image() + y * BENCH_STRIDE + 3,
                                  BENCH_STRIDE, thresholds, BENCH_WIDTH - 6);
    }
    for (int y = 4; y < BENCH_HEIGHT - 4; y++) {
        const uint8_t *row = scores + y * BENCH_STRIDE;
        variant(columns, row - BENCH_STRIDE, row, row + BENCH_STRIDE, 1, BENCH_WIDTH - 7);
    }
}
