/* Rounding by real numbers: where a channel has it, it gives the bytes of the exact way for every
 * sum that the channel can have, and channels as networks have them do have it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "base/elementary.h"
#include "kernels/nn_requantize.h"
#include "nn/real.h"

static struct fv_random draws;

static int32_t between(int32_t low, int32_t high)
{
    return (int32_t)(low + (int64_t)fv_random_below(&draws, (uint32_t)((int64_t)high - low + 1)));
}

/* As the kernels do, rounding towards zero twice: the double between is exact but for the last of
 * its 53 bits. Those of a zero point of 0 leave the offset positive. */
static int32_t by_real(const struct fv_nn_real_channel *c, const float found[2], int64_t sum)
{
    const bool is_signed = c->first <= 0 || fv_random_below(&draws, 2) == 0;
    float x = (float)sum;
    if (fabs((double)x) > fabs((double)sum)) x = nextafterf(x, 0.0F);
    const float offset = is_signed && sum < 0 ? -found[1] : found[1];
    return (int32_t)((double)x * (double)found[0] + (double)offset);
}

static int32_t clamped(const struct fv_nn_real_channel *c, int32_t result)
{
    return fv_nn_clamp(result, c->first - 1, c->last);
}

static struct fv_nn_real_channel draw_channel(int32_t shift, int32_t reach)
{
    const int32_t zero = between(0, 2) == 0 ? 0 : between(0, 255);
    const int32_t low = between(0, 1) ? zero : 0, high = between(0, 1) ? 255 : between(low, 255);
    return (struct fv_nn_real_channel){
        .multiplier = (int32_t)(0x40000000u + fv_random_u32(&draws) % 0x40000000u),
        .shift = shift,
        .first = low + 1 - zero,
        .last = high - zero,
        .least = -between(0, reach),
        .most = between(0, reach)};
}

/* Every sum of many channels. */
static void test_gives_the_same_bytes(void **state)
{
    (void)state;
    int proven = 0;
    for (int i = 0; i < 300; i++) {
        const struct fv_nn_real_channel c = draw_channel(between(-12, -1), 40000);
        float found[2];
        if (!fv_nn_real_find(&c, found)) continue;
        proven++;
        for (int64_t sum = c.least; sum <= c.most; sum++) {
            const int32_t expected =
                clamped(&c, fv_nn_requantize((int32_t)sum, c.multiplier, c.shift));
            if (clamped(&c, by_real(&c, found, sum)) != expected)
                fail_msg("channel %d: sum %lld", i, (long long)sum);
        }
    }
    print_message("%d of 300 channels\n", proven);
    assert_true(proven >= 270);
}

/* Large sums, beyond what float32 holds: those near the rises, and the ends. */
static void test_gives_the_same_bytes_of_large_sums(void **state)
{
    (void)state;
    int proven = 0;
    for (int i = 0; i < 2000; i++) {
        const struct fv_nn_real_channel c = draw_channel(between(-31, -9), 2000000000);
        float found[2];
        if (!fv_nn_real_find(&c, found)) continue;
        proven++;
        for (int j = 0; j < 2000; j++) {
            const double span = (double)(INT64_C(1) << (31 - c.shift)),
                         half = (double)between(c.first - 1, c.last) - 0.5;
            const int64_t near = (int64_t)(half * span / c.multiplier),
                          drawn = j % 2 != 0 ? between((int32_t)c.least, (int32_t)c.most)
                                             : near + between(-3, 3);
            const int64_t sum = drawn < c.least ? c.least : drawn > c.most ? c.most : drawn;
            const int32_t expected =
                clamped(&c, fv_nn_requantize((int32_t)sum, c.multiplier, c.shift));
            if (clamped(&c, by_real(&c, found, sum)) != expected)
                fail_msg("channel %d: sum %lld", i, (long long)sum);
        }
    }
    assert_true(proven >= 200);
}

/* Sums on one side of zero alone, as a bias makes them: of those nearest to zero nothing is asked
 * that the other side would have asked. */
static void test_takes_sums_of_one_sign(void **state)
{
    (void)state;
    for (int i = 0; i < 200; i++) {
        struct fv_nn_real_channel c = draw_channel(between(-12, -4), 40000);
        const double each = (double)(INT64_C(1) << (31 - c.shift)) / c.multiplier;
        float found[2];
        c.first = -128;
        c.last = 127;
        c.least = (int64_t)(0.48 * each); /* the first ones come to 0 */
        c.most = c.least + between(0, 40000);
        if (i % 2 != 0) {
            const int64_t least = c.least;
            c.least = -c.most;
            c.most = -least;
        }
        assert_true(fv_nn_real_find(&c, found));
        for (int64_t sum = c.least; sum <= c.most; sum++)
            assert_int_equal(clamped(&c, by_real(&c, found, sum)),
                             clamped(&c, fv_nn_requantize((int32_t)sum, c.multiplier, c.shift)));
    }
}

/* A channel whose sums all come to one result, and one of zeros. */
static void test_takes_channels_without_rises(void **state)
{
    (void)state;
    const struct fv_nn_real_channel dead = {.multiplier = 0x50000000,
                                            .shift = -31,
                                            .first = -127,
                                            .last = 127,
                                            .least = -50000000,
                                            .most = 60000000},
                                    zero = {.first = 1, .last = 255, .least = -9, .most = 9};
    float found[2];
    assert_true(fv_nn_real_find(&dead, found));
    for (int64_t sum = dead.least; sum <= dead.most; sum += 100003)
        assert_int_equal(by_real(&dead, found, sum), 0);
    assert_true(fv_nn_real_find(&zero, found));
    assert_int_equal(by_real(&zero, found, 9), 0);
    assert_true(found[0] != 0.0F); /* which would say that there is none */
}

static void test_refuses_what_it_does_not_know(void **state)
{
    (void)state;
    const struct fv_nn_real_channel good = {
        .multiplier = 0x50000000, .shift = -7, .first = 1, .last = 255, .least = -900, .most = 900};
    float found[2];
    assert_true(fv_nn_real_find(&good, found));
    struct fv_nn_real_channel bad = good;
    bad.shift = 0;
    assert_false(fv_nn_real_find(&bad, found));
    bad = good;
    bad.multiplier = 0x3fffffff;
    assert_false(fv_nn_real_find(&bad, found));
    bad = good;
    bad.most = INT64_C(1) << 31;
    assert_false(fv_nn_real_find(&bad, found));
    bad = good;
    bad.least = -(INT64_C(1) << 31) - 1;
    assert_false(fv_nn_real_find(&bad, found));
}

/* A sum where results rise, which float32 does not tell from the one before. */
static int32_t rise_float32_lacks(int32_t multiplier, int32_t shift)
{
    for (int32_t sum = 1 << 27, before = fv_nn_requantize(sum, multiplier, shift);; sum++) {
        const int32_t result = fv_nn_requantize(sum, multiplier, shift);
        if (result != before && sum % 16 != 0) return sum;
        before = result;
    }
}

/* What a layer's weights let its sums reach is asked of them: a layer whose sums are small is
 * rounded so where any other would not be. */
static void test_layers_reach(void **state)
{
    (void)state;
    static _Alignas(64) int8_t weights[64];
    static _Alignas(64) int32_t bias[16], multiplier[16], shift[16];
    static _Alignas(64) float real[32];
    struct fv_nn_gemm g = {.k = 1,
                           .k4 = 1,
                           .n = 16,
                           .weights = weights,
                           .bias = bias,
                           .multiplier = multiplier,
                           .shift = shift,
                           .zero_out = 128,
                           .act_max = 255};
    for (int i = 0; i < 16; i++) {
        weights[4 * i] = 1;
        multiplier[i] = 0x5a5a5a5b;
        shift[i] = -20;
    }
    fv_nn_real_gemm(&g, real);
    assert_true(real[0] != 0.0F); /* 0 to 255: one result */
    bias[3] = rise_float32_lacks(multiplier[3], shift[3]) - 100;
    fv_nn_real_gemm(&g, real);
    assert_true(real[0] == 0.0F); /* one without it leaves all without it */
    weights[4 * 3] = 0;           /* which now comes to no rise */
    fv_nn_real_gemm(&g, real);
    assert_true(real[0] != 0.0F);
    weights[4 * 3 + 1] = 1; /* what is multiplied counts, padding or not */
    fv_nn_real_gemm(&g, real);
    assert_true(real[0] == 0.0F);
}

static void give(struct fv_model_op *op, int32_t channels, int32_t k4)
{
    op->kind = FV_OP_CONV;
    op->u.conv.image.out_c = channels;
    op->u.conv.k4 = k4;
}

/* A file whose operators share their numbers could ask for hours of work: it gets no table for what
 * is beyond any network. */
static void test_work_is_bounded(void **state)
{
    (void)state;
    static struct fv_model_op ops[3];
    struct fv_model_header header = {.file_bytes = 1 << 20, .op_count = 3};
    const struct fv_model model = {.header = &header, .ops = ops};
    const size_t begin = 64, block = 128; /* bytes */
    assert_int_equal(fv_nn_real_bytes(&model), 0);
    give(&ops[0], 16, 4);
    give(&ops[1], 16 * 10000, 1);
    assert_int_equal(fv_nn_real_bytes(&model), begin + block + 10000 * block);
    give(&ops[2], 16 * 10000, 1);
    assert_int_equal(fv_nn_real_bytes(&model), begin + block + 10000 * block);
    give(&ops[1], 16, 1 << 17); /* 8 MiB of weights, of 1 */
    assert_int_equal(fv_nn_real_bytes(&model), begin + block + 10000 * block);
    give(&ops[2], 16, 1);
    assert_int_equal(fv_nn_real_bytes(&model), begin + 2 * block);
}

int main(void)
{
    fv_random_seed(&draws, 1);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_gives_the_same_bytes),
                                       cmocka_unit_test(test_gives_the_same_bytes_of_large_sums),
                                       cmocka_unit_test(test_takes_sums_of_one_sign),
                                       cmocka_unit_test(test_takes_channels_without_rises),
                                       cmocka_unit_test(test_refuses_what_it_does_not_know),
                                       cmocka_unit_test(test_layers_reach),
                                       cmocka_unit_test(test_work_is_bounded)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
