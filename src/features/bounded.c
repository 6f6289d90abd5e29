#include "features/bounded.h"

#include <stdbool.h>
#include <string.h>

#include "features/sift_basis.h"

/* Why no descriptor is missed. W is the transform without a factor, n its size: W^T W = n I, so
 * that n |a - b|^2 = |W a - W b|^2, of which the chosen coefficients, each once, are a part. With
 * the basis of SIFT descriptors as W, n |a - b|^2 >= |W a - W b|^2 (features/sift_basis.h), and its
 * coefficients are rounded: by .5 at most each, in all by sqrt(28) / 2, less than the 3 by which
 * e_a and e_b are larger.
 *
 * Let x be those of W a less their means (which cancel), c = x clipped to +-FAR steps, a' the
 * values, e_a = |c - step a'|; y, d, b' and e_b the same of b. Clipping each coefficient to one
 * range makes no two farther apart. With the triangle inequality
 *
 *   sqrt(n) |a - b| >= |x - y| >= |c - d| >= step |a' - b'| - e_a - e_b,
 *
 * whatever a' is: its rounding needs no care, its error alone does. It is equal where all energy is
 * in the chosen coefficients and both errors point along a' - b', outwards.
 *
 * A row holds r = floor(|b'|^2 / 2) - a' b' <= (|a' - b'|^2 - |a'|^2) / 2. Where |a - b|^2 <= D,
 * with E the largest e_b,
 *
 *   r <= (within^2 - |a'|^2) / 2,   within = (sqrt(n D) + e_a + E) / step,
 *
 * and r is whole, so the floor of that is the limit. Errors are roots of whole numbers m up to
 * values step^2 / 6, kept as floor(sqrt(m)) + 1, which is larger by 1 / (2 sqrt(m) + 2) at least.
 * So within, 2 / STEP_MAX at least, is too large by 1e-6 at least, the limit by 2e-9, and what
 * double precision rounds of limits up to LIMIT_MAX is below 1e-10.
 *
 * Nothing overflows. A coefficient is a sum of at most 128 bytes with signs: 0 to 32640 for the
 * first, +-16320 for others, so that c and its steps fit 16 bits (67 x 480 + 240 = 32400). Errors
 * sum to at most 40 (4 x 480)^2 = 1.5e8. Where |a'|^2 and |b'|^2 are at most S = SQUARE_MAX, -S / 2
 * - 1 <= r <= 1.5 S = 32764 < LIMIT_MAX, and limits are at least -S / 2; without values a' b' is 0,
 * and r = INT16_MAX behind the last and where no bound holds, above every limit. */

enum {
    BATCH = 16,         /* descriptors transformed at a time */
    SAMPLE = 256,       /* of each set, to choose coefficients by */
    VALUE_MAX = 63,     /* of the kernels' contract */
    SQUARE_MAX = 21843, /* half + product fits 16 bits where both are below: 1.5 of it <= 32767 */
    STEP_MAX = 480,     /* with FAR steps in 16 bits */
    FAR = 67,           /* steps: the error of a value there is more than pack() lets pass */
    LIMIT_MAX = INT16_MAX - 1,
    NOTHING = INT16_MIN - 1 /* less than rows hold */
};

/* Coefficient k of each descriptor of a batch. */
typedef int16_t lanes __attribute__((vector_size(2 * BATCH)));
union batch {
    lanes row[FV_BOUNDED_SIZE_MAX];
    int16_t of[FV_BOUNDED_SIZE_MAX][BATCH];
};
struct values {
    int16_t of[FV_BOUNDED_VALUES_MAX][BATCH];
    int32_t square[BATCH], error[BATCH]; /* of the length, and squared in coefficients */
};

static uint32_t padded(uint32_t count)
{
    return (count + FV_BOUND_GROUP - 1) / FV_BOUND_GROUP * FV_BOUND_GROUP;
}

static void choose_transform(struct fv_bounded *bounded, enum fv_bounded_by by)
{
    if (by == FV_BOUNDED_BY_SIFT) {
        bounded->size = bounded->values = FV_SIFT_BASIS_ROWS;
        bounded->square = FV_SIFT_BASIS_SQUARE;
        bounded->rounding = 3;
        return;
    }
    const bool small = bounded->bytes <= FV_BOUNDED_SIZE_MAX / 2;
    bounded->size = small ? FV_BOUNDED_SIZE_MAX / 2 : FV_BOUNDED_SIZE_MAX;
    bounded->values = small ? 24 : FV_BOUNDED_VALUES_MAX;
    bounded->square = bounded->size;
    bounded->rounding = 0;
}

void fv_bounded_carve(struct fv_bounded *bounded, uint32_t count_max, uint32_t bytes,
                      enum fv_bounded_by by, struct fv_arena *arena)
{
    const uint32_t count = padded(count_max);
    bounded->bytes = bytes;
    bounded->by = by;
    choose_transform(bounded, by);
    for (int k = 0; k < 2; k++) {
        struct fv_bounded_set *set = &bounded->sets[k];
        set->queries = fv_arena_take(arena, count, (size_t)bounded->values);
        set->square = fv_arena_take(arena, count, sizeof *set->square);
        set->error = fv_arena_take(arena, count, sizeof *set->error);
        set->trains = fv_arena_take(arena, count, (size_t)bounded->values);
        set->half = fv_arena_take(arena, count, sizeof *set->half);
        set->unbounded = fv_arena_take(arena, count, sizeof *set->unbounded);
    }
    bounded->rows = fv_arena_take_raw(arena, (size_t)count * FV_BOUND_QUERIES, sizeof(int16_t));
    bounded->indices = fv_arena_take_raw(arena, count, sizeof *bounded->indices);
    bounded->distances = fv_arena_take_raw(arena, count, sizeof *bounded->distances);
}

/* Two steps of the transform at once. */
static void butterflies(union batch *x, uint32_t size, uint32_t apart)
{
    for (uint32_t from = 0; from < size; from += 4 * apart)
        for (uint32_t k = from; k < from + apart; k++) {
            const lanes a = x->row[k], b = x->row[k + apart];
            const lanes c = x->row[k + 2 * apart], d = x->row[k + 3 * apart];
            const lanes ab = a + b, a_b = a - b, cd = c + d, c_d = c - d;
            x->row[k] = ab + cd;
            x->row[k + apart] = a_b + c_d;
            x->row[k + 2 * apart] = ab - cd;
            x->row[k + 3 * apart] = a_b - c_d;
        }
}

static void transform_sift(union batch *x, const uint8_t *const at[BATCH])
{
    for (int i = 0; i < BATCH; i++) {
        int16_t wide[FV_SIFT_BASIS_BYTES];
        for (int k = 0; k < FV_SIFT_BASIS_BYTES; k++)
            wide[k] = at[i][k];
        for (int v = 0; v < FV_SIFT_BASIS_ROWS; v++) {
            int32_t sum = 1 << (FV_SIFT_BASIS_SHIFT - 1);
            for (int k = 0; k < FV_SIFT_BASIS_BYTES; k++)
                sum += wide[k] * fv_sift_basis[v][k];
            x->of[v][i] = (int16_t)(sum >> FV_SIFT_BASIS_SHIFT);
        }
    }
}

/* Coefficients of BATCH descriptors, `stride` apart; those behind `count` repeat the first. */
static void transform(const struct fv_bounded *bounded, union batch *x, const uint8_t *descriptors,
                      uint32_t count, size_t stride)
{
    const uint32_t bytes = bounded->bytes, size = (uint32_t)bounded->size;
    const uint8_t *at[BATCH];
    for (uint32_t i = 0; i < BATCH; i++)
        at[i] = descriptors + stride * (i < count ? i : 0);
    if (bounded->by == FV_BOUNDED_BY_SIFT) {
        transform_sift(x, at);
        return;
    }
    for (uint32_t k = 0; k < bytes; k++)
        for (int i = 0; i < BATCH; i++)
            x->of[k][i] = at[i][k];
    memset(x->row + bytes, 0, (size - bytes) * sizeof x->row[0]);
    uint32_t apart = 1;
    if (size == FV_BOUNDED_SIZE_MAX) { /* an odd number of steps */
        for (uint32_t k = 0; k < size; k += 2) {
            const lanes a = x->row[k], b = x->row[k + 1];
            x->row[k] = a + b;
            x->row[k + 1] = a - b;
        }
        apart = 2;
    }
    for (; apart < size; apart *= 4)
        butterflies(x, size, apart);
}

struct sums {
    int64_t sum[FV_BOUNDED_SIZE_MAX], squares[FV_BOUNDED_SIZE_MAX];
    int32_t least[FV_BOUNDED_SIZE_MAX], most[FV_BOUNDED_SIZE_MAX];
    int64_t count;
};

static void add_sample(const struct fv_bounded *bounded, const struct fv_bounded_set *set,
                       struct sums *sums)
{
    const uint32_t every = (set->count + SAMPLE - 1) / SAMPLE;
    const size_t bytes = bounded->bytes;
    const uint32_t taken = (set->count + every - 1) / every;
    for (uint32_t from = 0; from < taken; from += BATCH) {
        union batch x;
        const uint32_t count = taken - from < BATCH ? taken - from : BATCH;
        transform(bounded, &x, set->descriptors + bytes * every * from, count, bytes * every);
        for (int k = 0; k < bounded->size; k++)
            for (uint32_t i = 0; i < count; i++) {
                const int32_t c = x.of[k][i];
                sums->sum[k] += c;
                sums->squares[k] += c * c;
                if (c < sums->least[k]) sums->least[k] = c;
                if (c > sums->most[k]) sums->most[k] = c;
            }
        sums->count += count;
    }
}

/* Coefficients that vary most, their means, and the step of their values. */
static void choose(struct fv_bounded *bounded)
{
    struct sums sums = {.count = 0};
    double spread[FV_BOUNDED_SIZE_MAX], all = 0;
    int32_t far = 0;
    for (int k = 0; k < bounded->size; k++) {
        sums.least[k] = INT32_MAX;
        sums.most[k] = INT32_MIN;
    }
    for (int k = 0; k < 2; k++)
        add_sample(bounded, &bounded->sets[k], &sums);
    if (sums.count < 1) return;
    for (int k = 0; k < bounded->size; k++)
        spread[k] =
            (double)sums.squares[k] / (double)sums.count -
            (double)sums.sum[k] / (double)sums.count * (double)sums.sum[k] / (double)sums.count;
    for (int v = 0; v < bounded->values; v++) {
        int best = 0;
        for (int k = 1; k < bounded->size; k++)
            if (spread[k] > spread[best]) best = k;
        const int32_t mean = (int32_t)(sums.sum[best] / sums.count);
        bounded->chosen[v] = best;
        bounded->mean[v] = mean;
        all += spread[best] > 0 ? spread[best] : 0;
        spread[best] = -1e300;
        if (sums.most[best] - mean > far) far = sums.most[best] - mean;
        if (mean - sums.least[best] > far) far = mean - sums.least[best];
    }
    /* the largest is VALUE_MAX, and a length of 1.5 of the mean one is within SQUARE_MAX */
    const int32_t of_length = (int32_t)(1.5 * __builtin_sqrt(all / SQUARE_MAX)) + 1;
    const int32_t of_value = (far + VALUE_MAX - 1) / VALUE_MAX;
    bounded->step = of_value > of_length ? of_value : of_length;
    if (bounded->step < 4) bounded->step = 4; /* 65536 / step fits 16 bits */
}

/* Values of a batch. The error counts what rounding and clipping take, whatever they give. */
static void round_batch(const struct fv_bounded *bounded, const union batch *x,
                        struct values *values)
{
    const int16_t step = (int16_t)bounded->step;
    const int16_t inverse = (int16_t)((65536 + step / 2) / step), far = (int16_t)(FAR * step);
    memset(values->square, 0, sizeof values->square);
    memset(values->error, 0, sizeof values->error);
    for (int v = 0; v < bounded->values; v++) {
        const int16_t *of = x->of[bounded->chosen[v]];
        const int16_t mean = (int16_t)bounded->mean[v];
        int16_t *value = values->of[v];
        int16_t apart[BATCH];
        for (int i = 0; i < BATCH; i++) {
            int16_t c = (int16_t)(of[i] - mean);
            c = c < far ? c : far;
            c = c > -far ? c : (int16_t)-far;
            int16_t rounded = (int16_t)(((int32_t)(int16_t)(c + step / 2) * inverse) >> 16);
            rounded = rounded < VALUE_MAX ? rounded : VALUE_MAX;
            rounded = rounded > -VALUE_MAX ? rounded : -VALUE_MAX;
            value[i] = rounded;
            apart[i] = (int16_t)(c - step * rounded);
        }
        for (int i = 0; i < BATCH; i++) {
            values->square[i] += value[i] * value[i];
            values->error[i] += apart[i] * apart[i];
        }
    }
}

/* Descriptors from..from + count - 1 as queries and trains; zeros behind them. */
static void put(const struct fv_bounded *bounded, struct fv_bounded_set *set, uint32_t from,
                uint32_t count, const struct values *values)
{
    const size_t all = (size_t)bounded->values;
    int8_t *queries = set->queries + all * from;
    uint8_t *trains = set->trains + (from / FV_BOUND_GROUP * FV_BOUND_GROUP) * all +
                      2 * (size_t)(from % FV_BOUND_GROUP);
    for (size_t v = 0; v < all; v += 2, trains += 2 * FV_BOUND_GROUP) {
        const int16_t *a = values->of[v], *b = values->of[v + 1];
        for (int i = 0; i < BATCH; i++) {
            trains[2 * i] = (uint8_t)(a[i] + FV_BOUND_ZERO);
            trains[2 * i + 1] = (uint8_t)(b[i] + FV_BOUND_ZERO);
        }
        for (size_t i = 0; i < BATCH; i++) {
            queries[all * i + v] = (int8_t)a[i];
            queries[all * i + v + 1] = (int8_t)b[i];
        }
    }
    for (uint32_t i = 0; i < BATCH; i++) {
        const bool holds = values->error[i] >= 0;
        set->square[from + i] = values->square[i];
        set->half[from + i] = holds ? (int16_t)(values->square[i] / 2) : INT16_MAX;
        const int32_t root = holds ? (int32_t)__builtin_sqrt((double)values->error[i]) + 1 : 0;
        set->error[from + i] = holds ? root + bounded->rounding : -1;
        if (i < count && !holds) set->unbounded[set->unbounded_count++] = (uint16_t)(from + i);
        if (set->error[from + i] > set->error_max) set->error_max = set->error[from + i];
    }
}

static void pack(const struct fv_bounded *bounded, struct fv_bounded_set *set)
{
    /* rounding alone has a mean square error of step^2 / 12; clipping more */
    const int32_t error_max = bounded->values * bounded->step * bounded->step / 6;
    const size_t bytes = bounded->bytes;
    set->error_max = 0;
    set->unbounded_count = 0;
    for (uint32_t from = 0; from < padded(set->count); from += BATCH) {
        union batch x;
        struct values values;
        const uint32_t left = from < set->count ? set->count - from : 0;
        transform(bounded, &x, set->descriptors + (left > 0 ? bytes * from : 0), left, bytes);
        round_batch(bounded, &x, &values);
        for (uint32_t i = 0; i < BATCH; i++)
            if (i >= left || values.square[i] > SQUARE_MAX || values.error[i] > error_max) {
                for (int v = 0; v < bounded->values; v++)
                    values.of[v][i] = 0;
                values.error[i] = -1;
            }
        put(bounded, set, from, left, &values);
    }
}

bool fv_bounded_pack(struct fv_bounded *bounded, const uint8_t *const descriptors[2],
                     const uint32_t counts[2])
{
    for (int k = 0; k < 2; k++) {
        bounded->sets[k].descriptors = descriptors[k];
        bounded->sets[k].count = counts[k];
    }
    choose(bounded);
    if (bounded->step > STEP_MAX) return false;
    for (int k = 0; k < 2; k++)
        pack(bounded, &bounded->sets[k]);
    return true;
}

/* A query against all of a set. */
struct search {
    const struct fv_bounded *bounded;
    const struct fv_kernels *kernels;
    const struct fv_bounded_set *from, *to;
    uint32_t query;
    const int16_t *row;
};

struct two {
    int32_t distance, second;
    uint32_t index;
};

/* What a row holds at most where the squared distance is at most `square`. */
static int16_t limit_of(const struct search *search, double square)
{
    const struct fv_bounded *bounded = search->bounded;
    const int32_t error = search->from->error[search->query];
    if (error < 0) return LIMIT_MAX;
    const double within =
        (__builtin_sqrt(bounded->square * square) + error + search->to->error_max) / bounded->step;
    const double limit = (within * within - search->from->square[search->query]) / 2;
    /* down, below 0 too */
    return limit > LIMIT_MAX ? LIMIT_MAX : (int16_t)((int32_t)(limit - INT16_MIN) + INT16_MIN);
}

/* Those whose row holds more than `above` and at most `limit`; returns how many. */
static int32_t pick(const struct search *search, int32_t above, int16_t limit)
{
    uint16_t *indices = search->bounded->indices;
    const int32_t count = search->kernels->squares_below_s16(
        indices, search->row, (int32_t)padded(search->to->count), limit);
    if (above == NOTHING) return count;
    int32_t picked = 0;
    for (int32_t i = 0; i < count; i++) {
        const uint16_t at = indices[i];
        indices[picked] = at;
        picked += search->row[at] > above;
    }
    return picked;
}

/* Compare also those whose row holds more than `above` and at most `limit`; with NOTHING, those
 * without a bound too. */
static void compare(const struct search *search, int32_t above, int16_t limit, struct two *two)
{
    const struct fv_bounded *bounded = search->bounded;
    const uint8_t *query = search->from->descriptors + (size_t)bounded->bytes * search->query;
    int32_t count = pick(search, above, limit);
    for (uint32_t i = 0; above == NOTHING && i < search->to->unbounded_count; i++)
        bounded->indices[count++] = search->to->unbounded[i];
    search->kernels->squares_some_u8(bounded->distances, query, search->to->descriptors,
                                     (int32_t)bounded->bytes, bounded->indices, count);
    for (int32_t i = 0; i < count; i++) {
        const int32_t distance = bounded->distances[i];
        const uint32_t index = bounded->indices[i];
        if (distance < two->distance || (distance == two->distance && index < two->index)) {
            *two = (struct two){distance, two->distance, index};
        } else if (distance < two->second) {
            two->second = distance;
        }
    }
}

static int16_t second_least(const int16_t least[FV_BOUND_LANES])
{
    int16_t first = INT16_MAX, second = LIMIT_MAX;
    for (int i = 0; i < FV_BOUND_LANES; i++) {
        const int16_t later = least[i] > first ? least[i] : first;
        first = least[i] < first ? least[i] : first;
        second = later < second ? later : second;
    }
    return second;
}

static const struct two none = {FV_SQUARES_NONE, FV_SQUARES_NONE, 0};

/* How far above the second least bound to look at first, so that once is mostly enough: what some
 * three of four earlier queries needed. */
static void learn(int32_t *above, int32_t needed)
{
    enum { STEP = 8 };
    *above += needed > *above ? 3 * STEP : -STEP;
    *above = *above > 0 ? *above : 0;
}

static struct two find(const struct search *search, const int16_t least[FV_BOUND_LANES],
                       double ratio, int32_t *above)
{
    struct two two = none;
    const int32_t few = second_least(least);
    int16_t done = (int16_t)(few + *above < LIMIT_MAX ? few + *above : LIMIT_MAX);
    compare(search, NOTHING, done, &two);
    if (ratio < 1 && two.second < FV_SQUARES_NONE) {
        /* roots in single precision do not make a ratio of squares that much smaller */
        const double passing = ratio * ratio * 1.00001;
        const int16_t limit = limit_of(search, passing * two.second);
        learn(above, limit - few);
        if (limit > done) compare(search, done, limit, &two);
        done = limit > done ? limit : done;
        /* those not compared are farther than passing times what the second is at most */
        if (two.distance >= passing * two.second)
            return (struct two){two.second, two.second, two.index};
    }
    const int16_t limit = limit_of(search, two.second);
    if (limit > done) compare(search, done, limit, &two);
    return two;
}

static void bound(const struct search *search, const int8_t *queries, int16_t *least)
{
    const struct fv_bounded *bounded = search->bounded;
    const int32_t stride = (int32_t)padded(search->to->count);
    search->kernels->squares_bound_s16(bounded->rows, stride, least, queries, search->to->trains,
                                       search->to->half, stride / FV_BOUND_GROUP,
                                       bounded->values / 2);
}

void fv_bounded_two(const struct fv_bounded *bounded, const struct fv_kernels *kernels, float ratio,
                    int32_t *distance, int32_t *second, uint32_t *index)
{
    struct search search = {bounded, kernels, &bounded->sets[0], &bounded->sets[1], 0, NULL};
    int32_t above = 0;
    for (uint32_t q = 0; q < search.from->count; q += FV_BOUND_QUERIES) {
        int16_t least[FV_BOUND_QUERIES][FV_BOUND_LANES];
        bound(&search, search.from->queries + (size_t)q * (size_t)bounded->values, &least[0][0]);
        for (uint32_t k = 0; k < FV_BOUND_QUERIES && q + k < search.from->count; k++) {
            search.query = q + k;
            search.row = bounded->rows + (size_t)k * padded(search.to->count);
            const struct two two = find(&search, least[k], (double)ratio, &above);
            distance[q + k] = two.distance;
            second[q + k] = two.second;
            index[q + k] = two.index;
        }
    }
}

void fv_bounded_back(const struct fv_bounded *bounded, const struct fv_kernels *kernels,
                     const uint32_t *which, const int32_t *most, uint32_t count, uint32_t *index)
{
    struct search search = {bounded, kernels, &bounded->sets[1], &bounded->sets[0], 0, NULL};
    const size_t values = (size_t)bounded->values;
    for (uint32_t q = 0; q < count; q += FV_BOUND_QUERIES) {
        int16_t least[FV_BOUND_QUERIES][FV_BOUND_LANES];
        int8_t queries[FV_BOUND_QUERIES * FV_BOUNDED_VALUES_MAX];
        for (uint32_t k = 0; k < FV_BOUND_QUERIES; k++)
            memcpy(queries + k * values,
                   search.from->queries + values * which[q + k < count ? q + k : q], values);
        bound(&search, queries, &least[0][0]);
        for (uint32_t k = 0; k < FV_BOUND_QUERIES && q + k < count; k++) {
            search.query = which[q + k];
            search.row = bounded->rows + (size_t)k * padded(search.to->count);
            struct two two = none;
            compare(&search, NOTHING, limit_of(&search, most[q + k]), &two);
            index[q + k] = two.index;
        }
    }
}
