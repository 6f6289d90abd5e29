/* The search by bounds against plain loops: every pair that passes the ratio test, to the last bit,
 * with ties, values that were clipped, few descriptors, descriptors exactly at the bound, and on
 * the C kernels as on the best. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "features/bounded.h"
#include "features/sift_basis.h"

enum { COUNT = 520, CENTRES = 40, TRIALS = 2000, LONG = 300, MANY = 20000, FEW_BYTES = 36 };

static uint8_t descriptors[2][MANY * FEW_BYTES]; /* more than COUNT of 128 bytes */
static int32_t distance[COUNT], second[COUNT];
static uint32_t nearest[COUNT];

/* Descriptors about a few centres; some the same as the one before, some far from all. Of 520,
 * every third is looked at to choose steps, and none of the far ones, so that their values are
 * clipped. */
static void fill(uint32_t bytes, uint64_t seed)
{
    static uint8_t centres[CENTRES * FV_BOUNDED_SIZE_MAX];
    struct fv_random random;
    fv_random_seed(&random, seed);
    for (size_t i = 0; i < sizeof centres; i++)
        centres[i] = (uint8_t)(fv_random_below(&random, 4) == 0 ? fv_random_below(&random, 150)
                                                                : fv_random_below(&random, 40));
    for (int k = 0; k < 2; k++)
        for (size_t i = 0; i < COUNT; i++) {
            uint8_t *one = descriptors[k] + bytes * i;
            const uint8_t *centre = centres + bytes * fv_random_below(&random, CENTRES);
            const uint32_t kind = fv_random_below(&random, 50);
            const uint32_t noise = 1 + fv_random_below(&random, 60);
            for (uint32_t b = 0; b < bytes; b++)
                one[b] = (uint8_t)(centre[b] + fv_random_below(&random, noise));
            if (kind < 4 && i % 3 == 1) memset(one, 255 - (int)kind % 2, bytes);
            if (kind == 4 && i % 3 == 2)
                for (uint32_t b = 0; b < bytes; b++)
                    one[b] = (uint8_t)(b % 2 * 255);
            if (kind == 5 && i > 0) memcpy(one, one - bytes, bytes);
        }
}

/* Descriptors that few coefficients describe: bounds are as large as distances. */
static void fill_smooth(uint32_t bytes)
{
    struct fv_random random;
    fv_random_seed(&random, 3);
    for (int k = 0; k < 2; k++)
        for (size_t i = 0; i < COUNT; i++) {
            const uint32_t low = fv_random_below(&random, 100),
                           high = fv_random_below(&random, 100);
            for (uint32_t b = 0; b < bytes; b++)
                descriptors[k][bytes * i + b] = (uint8_t)(b % 2 != 0 ? high : low);
        }
}

static int32_t distance_of(uint32_t bytes, uint32_t i, uint32_t j)
{
    int32_t sum = 0;
    for (uint32_t b = 0; b < bytes; b++) {
        const int32_t apart = descriptors[0][bytes * i + b] - descriptors[1][bytes * j + b];
        sum += apart * apart;
    }
    return sum;
}

struct plain {
    int32_t distance, second;
    uint32_t index;
};

static struct plain plain_two(uint32_t bytes, uint32_t i, uint32_t count)
{
    struct plain two = {FV_SQUARES_NONE, FV_SQUARES_NONE, 0};
    for (uint32_t j = 0; j < count; j++) {
        const int32_t found = distance_of(bytes, i, j);
        if (found < two.distance)
            two = (struct plain){found, two.distance, j};
        else if (found < two.second)
            two.second = found;
    }
    return two;
}

static bool passes(int32_t found, int32_t other, float ratio)
{
    if (ratio >= 1 || other >= FV_SQUARES_NONE) return true;
    return __builtin_sqrtf((float)found) < ratio * __builtin_sqrtf((float)other);
}

static void check_back(struct fv_bounded *bounded, const struct fv_kernels *kernels, uint32_t bytes,
                       const uint32_t counts[2])
{
    static uint32_t back[COUNT];
    fv_bounded_back(bounded, kernels, nearest, distance, counts[0], back);
    for (uint32_t i = 0; i < counts[0]; i++) {
        uint32_t best = 0;
        int32_t least = INT32_MAX;
        for (uint32_t a = 0; a < counts[0]; a++) {
            const int32_t found = distance_of(bytes, a, nearest[i]);
            if (found < least) best = a;
            if (found < least) least = found;
        }
        assert_int_equal(back[i], best);
    }
}

static uint32_t check(struct fv_bounded *bounded, const struct fv_kernels *kernels, uint32_t bytes,
                      const uint32_t counts[2], float ratio)
{
    const uint8_t *const both[2] = {descriptors[0], descriptors[1]};
    uint32_t kept = 0;
    assert_true(fv_bounded_pack(bounded, both, counts));
    fv_bounded_two(bounded, kernels, ratio, distance, second, nearest);
    for (uint32_t i = 0; i < counts[0]; i++) {
        const struct plain expected = plain_two(bytes, i, counts[1]);
        const bool pass = passes(expected.distance, expected.second, ratio);
        assert_int_equal(passes(distance[i], second[i], ratio), pass);
        if (!pass) continue;
        assert_int_equal(distance[i], expected.distance);
        assert_int_equal(second[i], expected.second);
        assert_int_equal(nearest[i], expected.index);
        kept++;
    }
    if (ratio >= 1) check_back(bounded, kernels, bytes, counts);
    return kept;
}

/* The search with memory for `count` descriptors, and the C kernels (set 0) or the best. */
struct fixture {
    struct fv_bounded bounded;
    struct fv_kernels kernels;
    void *memory;
};

static void set_up(struct fixture *fixture, uint32_t count, uint32_t bytes, enum fv_bounded_by by,
                   int set)
{
    struct fv_arena arena;
    enum fv_cpu_set best;
    fv_arena_count(&arena);
    fv_bounded_carve(&fixture->bounded, count, bytes, by, &arena);
    const size_t size = arena.used;
    fixture->memory = aligned_alloc(64, (size + 63) / 64 * 64);
    assert_non_null(fixture->memory);
    fv_arena_init(&arena, fixture->memory, size);
    fv_bounded_carve(&fixture->bounded, count, bytes, by, &arena);
    assert_false(arena.exhausted);
    assert_int_equal(fv_cpu_from_environment(&best, NULL), FOVEA_OK);
    fv_kernels_init(&fixture->kernels, set == 0 ? FV_CPU_C : best);
}

static void pairs_are_those_of_plain_loops(void **state)
{
    (void)state;
    static const uint32_t sizes[] = {33, 64, 81, 128, 128},
                          counts[][2] = {{COUNT, COUNT - 1}, {33, 129}, {5, 1}, {1, 2}, {2, 1}};
    static const float ratios[] = {1, .8f, .002f};
    for (size_t s = 0; s < sizeof sizes / sizeof sizes[0]; s++)
        for (int set = 0; set < 2; set++) {
            struct fixture fixture;
            set_up(&fixture, COUNT, sizes[s], s == 4 ? FV_BOUNDED_BY_SIFT : FV_BOUNDED_BY_WALSH,
                   set);
            fill(sizes[s], 7 + s);
            for (size_t c = 0; c < sizeof counts / sizeof counts[0]; c++)
                for (size_t r = c == 0 ? 1 : 0; r < 3; r++) {
                    const uint32_t kept =
                        check(&fixture.bounded, &fixture.kernels, sizes[s], counts[c], ratios[r]);
                    if (c == 0 && r == 1) assert_in_range(kept, 1, COUNT - 1);
                }
            check(&fixture.bounded, &fixture.kernels, sizes[s], counts[0], 1);
            fill_smooth(sizes[s]);
            check(&fixture.bounded, &fixture.kernels, sizes[s], counts[0], 1);
            free(fixture.memory);
        }
}

/* What bounds by the basis rest on, in whole numbers: no length grows by more than is said, since
 * no eigenvalue of B B^T is larger than the largest sum of a row's magnitudes, and sums fit. */
static void basis_is_nearly_orthogonal(void **state)
{
    (void)state;
    for (int i = 0; i < FV_SIFT_BASIS_ROWS; i++) {
        int64_t all = 0, sum = 0;
        for (int j = 0; j < FV_SIFT_BASIS_ROWS; j++) {
            int64_t product = 0;
            for (int k = 0; k < FV_SIFT_BASIS_BYTES; k++)
                product += fv_sift_basis[i][k] * fv_sift_basis[j][k];
            all += product < 0 ? -product : product;
        }
        for (int k = 0; k < FV_SIFT_BASIS_BYTES; k++)
            sum += fv_sift_basis[i][k] < 0 ? -fv_sift_basis[i][k] : fv_sift_basis[i][k];
        assert_in_range(all, 1, (int64_t)FV_SIFT_BASIS_SQUARE << (2 * FV_SIFT_BASIS_SHIFT));
        assert_in_range(sum, 1, FV_SIFT_BASIS_SUM);
    }
}

/* Descriptors that a few Walsh functions make up, all as much: 128 + s times their sum. Those that
 * differ have all energy in kept coefficients, n s each, and errors of rounding along one line. */
struct line {
    uint32_t bytes, functions[3];
    int32_t active;
    int32_t s[2][3]; /* set 0: a query and two that set the step; set 1: see draw() */
    int32_t near;    /* of set 1: the one that is nearest to the query */
    float ratio;     /* just passed */
};

static void put_line(const struct line *line)
{
    for (int k = 0; k < 2; k++)
        for (uint32_t i = 0; i < 3; i++)
            for (uint32_t b = 0; b < line->bytes; b++) {
                int32_t sum = 0;
                for (int a = 0; a < line->active; a++)
                    sum += __builtin_parity(b & line->functions[a]) != 0 ? -1 : 1;
                descriptors[k][line->bytes * i + b] = (uint8_t)(128 + line->s[k][i] * sum);
            }
}

/* A query, one at a distance, and on the other side two that are as far (then the first of set 1
 * is right, as the lowest) or little farther (then the last is). */
static void draw(struct line *line, struct fv_random *random)
{
    line->active = 1 + (int32_t)fv_random_below(random, 3);
    for (uint32_t a = 0; a < 3; a++)
        line->functions[a] = 1 + a + 3 * fv_random_below(random, line->bytes / 3 - 1);
    const uint32_t widest = 125 / (uint32_t)line->active;
    const uint32_t wide = widest / 2 + fv_random_below(random, widest - widest / 2);
    const int32_t query = (int32_t)fv_random_below(random, wide + 1) - (int32_t)wide / 2;
    const int32_t apart = 1 + (int32_t)fv_random_below(random, wide / 2);
    const int32_t more = (int32_t)fv_random_below(random, 2);
    const int32_t side = fv_random_below(random, 2) == 0 ? -1 : 1;
    const int32_t other = query - side * (apart + more);
    line->near = more == 0 ? 0 : 2;
    for (int i = 0; i < 3; i++)
        line->s[1][i] = i == line->near ? query + side * apart : other;
    line->s[0][0] = query;
    line->s[0][1] = (int32_t)wide;
    line->s[0][2] = (int32_t)fv_random_below(random, 5) - (int32_t)wide;
    line->ratio = 1.0005f * (float)apart / (float)(apart + more);
}

/* Value, error and row of descriptors of a line, worked out from s alone. */
struct rounded {
    int32_t value, rest;
    double error;
};

static struct rounded round_one(const struct line *line, const struct fv_bounded *bounded,
                                int32_t s)
{
    int v = 0;
    while (bounded->chosen[v] != (int32_t)line->functions[0])
        v++;
    const int32_t c = (int32_t)line->bytes * s - bounded->mean[v], step = bounded->step;
    const int32_t value = (c + step / 2 + 100 * step) / step - 100;
    const int32_t square = line->active * (c - value * step) * (c - value * step);
    return (struct rounded){value, c - value * step,
                            (double)((int32_t)__builtin_sqrt((double)square) + 1)};
}

/* Whether the nearest is exactly at the limit of the distance it has, the others below it, and no
 * error could be left out. */
static bool is_tight(const struct line *line, const struct fv_bounded *bounded)
{
    const struct rounded query = round_one(line, bounded, line->s[0][0]);
    const struct rounded near = round_one(line, bounded, line->s[1][line->near]);
    const struct rounded other = round_one(line, bounded, line->s[1][1]);
    const double step = bounded->step, n = line->bytes, active = line->active;
    const double apart = line->s[0][0] - line->s[1][line->near];
    const double largest = near.error > other.error ? near.error : other.error;
    const double within =
        (__builtin_sqrt(n * n * active * apart * apart) + query.error + largest) / step;
    const double limit = (within * within - active * query.value * query.value) / 2;
    const int32_t row =
        line->active * near.value * near.value / 2 - line->active * query.value * near.value;
    const int32_t before =
        line->active * other.value * other.value / 2 - line->active * query.value * other.value;
    assert_true(row <= limit);
    return row + 1 > limit && before < row && within * query.error > 2 * step &&
           within * near.error > 2 * step && near.error >= other.error;
}

static void swap_sets(void)
{
    for (size_t i = 0; i < 3 * (size_t)FV_BOUNDED_SIZE_MAX; i++) {
        const uint8_t kept = descriptors[0][i];
        descriptors[0][i] = descriptors[1][i];
        descriptors[1][i] = kept;
    }
}

static void nearest_at_the_limit_are_found(void **state)
{
    (void)state;
    static const uint32_t counts[2] = {3, 3};
    for (uint32_t bytes = 64; bytes <= 128; bytes += 64)
        for (int set = 0; set < 2; set++) {
            struct fixture fixture;
            struct fv_random random;
            struct line line = {.bytes = bytes};
            uint32_t tight[4] = {0};
            set_up(&fixture, 3, bytes, FV_BOUNDED_BY_WALSH, set);
            fv_random_seed(&random, bytes);
            for (int trial = 0; trial < TRIALS; trial++) {
                draw(&line, &random);
                put_line(&line);
                check(&fixture.bounded, &fixture.kernels, bytes, counts, 1);
                if (is_tight(&line, &fixture.bounded)) tight[line.active]++;
                if (line.ratio < 1)
                    check(&fixture.bounded, &fixture.kernels, bytes, counts, line.ratio);
                swap_sets(); /* and so from the other side */
                check(&fixture.bounded, &fixture.kernels, bytes, counts, 1);
            }
            for (int active = 1; active <= 3; active++)
                assert_in_range(tight[active], 10, TRIALS);
            free(fixture.memory);
        }
}

/* Descriptors that are not looked at to choose the step, and of which all values are about 40: the
 * square of their length is about 2^16, and a row of one with itself would leave 16 bits. */
static void long_ones_are_found(void **state)
{
    (void)state;
    enum { BYTES = FV_BOUNDED_SIZE_MAX, ABOUT = 65536, APART = 2000 };
    static const uint32_t counts[2] = {LONG, LONG};
    const uint8_t *const both[2] = {descriptors[0], descriptors[1]};
    struct fixture fixture;
    struct fv_random random;
    for (int set = 0; set < 2; set++) {
        set_up(&fixture, LONG, BYTES, FV_BOUNDED_BY_WALSH, set);
        struct fv_bounded *bounded = &fixture.bounded;
        fv_random_seed(&random, 5);
        for (int k = 0; k < 2; k++)
            for (size_t i = 0; i < (size_t)LONG * BYTES; i++)
                descriptors[k][i] = (uint8_t)(120 + fv_random_below(&random, 16));
        assert_true(fv_bounded_pack(bounded, both, counts));
        for (size_t i = 1; i < LONG; i += 2) { /* those at even places are looked at */
            double sum[BYTES];
            const double length = 40.3 + .001 * (double)i;
            for (int b = 0; b < BYTES; b++)
                sum[b] = 128;
            for (int v = 0; v < bounded->values; v++) {
                const double c =
                    (fv_random_below(&random, 2) == 0 ? -length : length) * bounded->step +
                    (bounded->chosen[v] == 0 ? 0 : bounded->mean[v]);
                for (int b = 0; b < BYTES; b++)
                    sum[b] += (__builtin_parity((unsigned)(b & bounded->chosen[v])) != 0 ? -c : c) /
                              BYTES;
            }
            for (size_t b = 0; b < BYTES; b++)
                descriptors[0][BYTES * i + b] = descriptors[1][BYTES * i + b] =
                    (uint8_t)(sum[b] + .5);
            descriptors[1][BYTES * i]++;
        }
        check(bounded, &fixture.kernels, BYTES, counts, 1);
        uint32_t near = 0;
        for (uint32_t i = 1; i < LONG; i += 2)
            near += bounded->sets[0].square[i] > ABOUT - APART &&
                    bounded->sets[0].square[i] < ABOUT + APART;
        assert_in_range(near, LONG / 4, LONG);
        free(fixture.memory);
    }
}

/* Bytes of 0 and 255 alone, all the same, and the largest step there is. */
static void extremes_are_found(void **state)
{
    (void)state;
    static const uint32_t counts[][2] = {{1, 1}, {1, 2}, {2, 3}, {33, 65}, {40, 40}};
    for (int set = 0; set < 2; set++)
        for (uint32_t bytes = 64; bytes <= 128; bytes += 64) {
            struct fixture fixture;
            struct fv_random random;
            set_up(&fixture, 65, bytes, FV_BOUNDED_BY_WALSH, set);
            fv_random_seed(&random, 9);
            for (int kind = 0; kind < 4; kind++)
                for (size_t c = 0; c < sizeof counts / sizeof counts[0]; c++) {
                    if (kind == 3 && c != 4) continue;
                    memset(descriptors, kind == 3 ? 239 : 255 * (kind % 2), sizeof descriptors);
                    for (size_t i = 0; kind == 2 && i < (size_t)65 * bytes; i++) {
                        descriptors[0][i] = (uint8_t)(255 * fv_random_below(&random, 2));
                        descriptors[1][i] = (uint8_t)(255 * fv_random_below(&random, 2));
                    }
                    if (kind == 3) memset(descriptors[0], 0, bytes);
                    check(&fixture.bounded, &fixture.kernels, bytes, counts[c], 1);
                    check(&fixture.bounded, &fixture.kernels, bytes, counts[c], .95f);
                    if (kind == 3 && bytes == 128) assert_int_equal(fixture.bounded.step, 480);
                }
            free(fixture.memory);
        }
}

/* As many as an extractor gives. */
static void nearest_of_many_are_found(void **state)
{
    (void)state;
    static const uint32_t counts[2] = {3, MANY};
    for (int set = 0; set < 2; set++) {
        struct fixture fixture;
        struct fv_random random;
        set_up(&fixture, MANY, FEW_BYTES, FV_BOUNDED_BY_WALSH, set);
        fv_random_seed(&random, 11);
        for (size_t i = 0; i < sizeof descriptors[1]; i++)
            descriptors[1][i] = (uint8_t)fv_random_below(&random, 60);
        memcpy(descriptors[0], descriptors[1], 3 * (size_t)FEW_BYTES);
        memcpy(descriptors[1] + (size_t)FEW_BYTES * (MANY - 1), descriptors[0] + FEW_BYTES,
               FEW_BYTES);
        memset(descriptors[1] + FEW_BYTES, 0, FEW_BYTES);
        check(&fixture.bounded, &fixture.kernels, FEW_BYTES, counts, 1);
        assert_int_equal(nearest[1], MANY - 1);
        free(fixture.memory);
    }
}

static void noise_is_refused(void **state)
{
    (void)state;
    struct fixture fixture;
    set_up(&fixture, COUNT, FV_BOUNDED_SIZE_MAX, FV_BOUNDED_BY_WALSH, 0);
    const uint8_t *const both[2] = {descriptors[0], descriptors[1]};
    memset(descriptors, 0, sizeof descriptors);
    memset(descriptors[0], 255, FV_BOUNDED_SIZE_MAX);
    assert_false(fv_bounded_pack(&fixture.bounded, both, (const uint32_t[2]){COUNT, COUNT}));
    free(fixture.memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(basis_is_nearly_orthogonal),
        cmocka_unit_test(pairs_are_those_of_plain_loops),
        cmocka_unit_test(nearest_at_the_limit_are_found),
        cmocka_unit_test(long_ones_are_found),
        cmocka_unit_test(extremes_are_found),
        cmocka_unit_test(nearest_of_many_are_found),
        cmocka_unit_test(noise_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
