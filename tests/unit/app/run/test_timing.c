/* Histograms, curves, and heap counting. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "app/run/heap.h"
#include "app/run/timing.h"
#include "base/elementary.h"

static struct fv_histogram histogram;
static struct fv_curve curve;

static int compare(const void *a, const void *b)
{
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

static void test_percentiles_against_sorting(void **state)
{
    (void)state;
    enum { COUNT = 20000 };
    static int64_t values[COUNT];
    struct fv_random random;
    fv_random_seed(&random, 7);
    memset(&histogram, 0, sizeof histogram);
    int64_t sum = 0;
    for (int i = 0; i < COUNT; i++) {
        values[i] = (int64_t)fv_exp(fv_random_unit(&random) * 25.0); /* 1 ns to 72 s */
        sum += values[i];
        fv_histogram_add(&histogram, values[i]);
    }
    qsort(values, COUNT, sizeof values[0], compare);
    const double fractions[] = {0.01, 0.1, 0.25, 0.5, 0.9, 0.99, 0.999, 1.0};
    for (size_t i = 0; i < sizeof fractions / sizeof fractions[0]; i++) {
        double exact = (double)values[(int)ceil(fractions[i] * COUNT) - 1];
        double got = (double)fv_histogram_percentile(&histogram, fractions[i]);
        assert_true(fabs(got - exact) <= exact * 0.004 + 0.5);
    }
    assert_int_equal(fv_histogram_mean(&histogram), sum / COUNT);
    assert_int_equal(histogram.max_ns, values[COUNT - 1]);
}

static void test_histogram_edges(void **state)
{
    (void)state;
    memset(&histogram, 0, sizeof histogram);
    assert_int_equal(fv_histogram_mean(&histogram), 0);
    assert_int_equal(fv_histogram_percentile(&histogram, 0.99), 0);
    fv_histogram_add(&histogram, -5);
    assert_int_equal(fv_histogram_percentile(&histogram, 1.0), 0);
    fv_histogram_add(&histogram, INT64_MAX / 4);
    fv_histogram_add(&histogram, 255);
    fv_histogram_add(&histogram, 256);
    assert_int_equal(histogram.count, 4);
    assert_int_equal(fv_histogram_percentile(&histogram, 0.5), 255);
    assert_int_equal(histogram.max_ns, INT64_MAX / 4);
    /* Every value lies in a bucket whose middle is near it. */
    for (int64_t value = 1; value < (int64_t)1 << 40; value = value * 5 / 4 + 1) {
        memset(&histogram, 0, sizeof histogram);
        fv_histogram_add(&histogram, value);
        fv_histogram_add(&histogram, INT64_MAX / 4);
        double got = (double)fv_histogram_percentile(&histogram, 0.5);
        assert_true(fabs(got - (double)value) <= (double)value * 0.004);
    }
}

static void test_curve_keeps_sum_and_maximum(void **state)
{
    (void)state;
    fv_curve_init(&curve);
    int64_t sum = 0, count = 100003;
    for (int64_t i = 0; i < count; i++) {
        int64_t value = i == 77777 ? 5000000 : i % 100;
        sum += value;
        fv_curve_add(&curve, value);
    }
    int64_t got = 0, largest = 0, frames = 0, where = 0;
    for (uint32_t i = 0; i < curve.bins; i++) {
        got += curve.sum_ns[i];
        frames += i + 1 < curve.bins ? curve.stride : curve.in_last;
        if (curve.max_ns[i] > largest) {
            largest = curve.max_ns[i];
            where = i;
        }
    }
    assert_int_equal(got, sum);
    assert_int_equal(frames, count);
    assert_int_equal(largest, 5000000);
    assert_int_equal(where, 77777 / curve.stride);
    assert_true(curve.bins > FV_CURVE_BINS / 2 - 1 && curve.bins <= FV_CURVE_BINS);
}

static void test_heap_calls_are_seen(void **state)
{
    (void)state;
    if (!fv_heap_counted()) {
        print_message("heap counting SKIPPED: this build has a sanitizer's allocator\n");
        return;
    }
    void *volatile kept = malloc(10); /* not armed */
    fv_heap_arm();
    assert_int_equal(fv_heap_calls(), 0);
    kept = realloc(kept, 200);
    assert_int_equal(fv_heap_calls(), 1);
    void *volatile more = calloc(3, 7);
    void *aligned = NULL;
    assert_int_equal(posix_memalign(&aligned, 64, 100), 0);
    void *volatile other = aligned_alloc(64, 128);
    assert_int_equal(fv_heap_calls(), 4);
    assert_int_equal((uintptr_t)aligned % 64, 0);
    assert_int_equal((uintptr_t)other % 64, 0);
    free(kept);
    free(more);
    free(aligned);
    free(other);
    assert_int_equal(fv_heap_calls(), 8);
    char *volatile copy = strdup("inside the C library too");
    assert_int_equal(fv_heap_calls(), 9);
    fv_heap_disarm();
    free(copy);
    assert_int_equal(fv_heap_calls(), 9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_percentiles_against_sorting),
        cmocka_unit_test(test_histogram_edges),
        cmocka_unit_test(test_curve_keeps_sum_and_maximum),
        cmocka_unit_test(test_heap_calls_are_seen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
