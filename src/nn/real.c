#include "nn/real.h"

#include <math.h> /* of which no function */
#include <string.h>

#include "base/elementary.h"
#include "kernels/nn_requantize.h"
#include "nn/conv.h"

enum {
    BLOCK = 32,        /* floats of 16 channels */
    FACTORS = 7,       /* that are tried */
    RESULTS_MAX = 256, /* of one byte */
    BLOCKS_MAX = 16384 /* of a model: a quarter of a million channels, a second */
};

/* ---- one channel ----------------------------------------------------------------------------- */

/* Where the results grow away from zero: the sum nearest to zero of each result, as the kernels
 * convert it to float32, and the one before; all without their signs. */
struct rises {
    int32_t count;
    double to[RESULTS_MAX], at[RESULTS_MAX], before[RESULTS_MAX];
};

/* What the offset must be at least, and below. */
struct bounds {
    double least, below;
};

/* The sum's size as the float32 that is not above it. */
static double round_sum(int64_t sum)
{
    const int64_t size = sum < 0 ? -sum : sum;
    float x = (float)size;
    if ((double)x > (double)size) x = fv_float_step(x, -1);
    return (double)x;
}

static int32_t exact(const struct fv_nn_real_channel *c, int64_t sum)
{
    return fv_nn_requantize((int32_t)sum, c->multiplier, c->shift);
}

/* The least sum of the channel that comes to `to`, near `guess`; most + 1: none does. */
static int64_t find_rise(const struct fv_nn_real_channel *c, int32_t to, double guess)
{
    int64_t sum = guess < (double)c->least  ? c->least
                  : guess > (double)c->most ? c->most + 1
                                            : (int64_t)guess;
    while (sum <= c->most && exact(c, sum) < to)
        sum++;
    while (sum > c->least && exact(c, sum - 1) >= to)
        sum--;
    return sum;
}

static bool has_sum(const struct fv_nn_real_channel *c, int64_t sum)
{
    return sum >= c->least && sum <= c->most;
}

static void find_rises(const struct fv_nn_real_channel *c, struct rises *r)
{
    const double power = (double)(INT64_C(1) << (30 - c->shift)), m = (double)c->multiplier,
                 each = 2.0 * power / m, up = (-power - 0x1p30) / m, down = (-power + 0x1p30) / m;
    const int32_t lowest = exact(c, c->least), highest = exact(c, c->most);
    /* Results that no sum comes to, or all do, ask nothing, but for the ones next to the others. */
    const int32_t first = c->first < lowest ? lowest < c->last ? lowest : c->last : c->first,
                  last = c->last > highest ? highest + 1 < first ? first : highest + 1 : c->last;
    r->count = 0;
    for (int32_t to = first; to <= last && r->count < RESULTS_MAX; to++) {
        const int64_t rise = find_rise(c, to, each * to + (to > 0 ? up : down));
        const int64_t at = to > 0 ? rise : rise - 1, before = to > 0 ? rise - 1 : rise;
        r->to[r->count] = to > 0 ? to : 1 - to;
        r->at[r->count] = has_sum(c, at) ? round_sum(at) : INFINITY;
        r->before[r->count++] = has_sum(c, before) ? round_sum(before) : -INFINITY;
    }
}

static struct bounds find_bounds(const struct rises *r, double factor)
{
    const double margin = 0x1p-40; /* above what double may err by */
    struct bounds b = {0.0, 1.0};
    for (int32_t i = 0; i < r->count; i++) {
        const double least = r->to[i] - r->at[i] * factor + margin,
                     below = r->to[i] - r->before[i] * factor - margin;
        if (least > b.least) b.least = least;
        if (below < b.below) b.below = below;
    }
    return b;
}

/* A float32 between the bounds: a half, or what is in their middle. */
static bool choose(struct bounds b, float *offset)
{
    *offset = b.least <= 0.5 && 0.5 < b.below ? 0.5F : (float)(b.least + (b.below - b.least) / 2);
    return (double)*offset >= b.least && (double)*offset < b.below;
}

/* A factor so small that its product with any sum is less than the offset. */
static bool give_zero(float found[2])
{
    found[0] = 0x1p-40f;
    found[1] = 0.5f;
    return true;
}

bool fv_nn_real_find(const struct fv_nn_real_channel *c, float found[2])
{
    struct rises rises;
    if (c->multiplier == 0) return give_zero(found);
    if (c->multiplier < 1 << 30 || c->shift >= 0 || c->shift < -31 || c->least < INT32_MIN ||
        c->most > INT32_MAX || c->least > c->most)
        return false;
    find_rises(c, &rises);
    const float nearest =
        (float)((double)c->multiplier * 0x1p-31 / (double)(INT64_C(1) << -c->shift));
    for (int i = 0; i < FACTORS; i++) { /* the nearest one, then those on both sides by turns */
        found[0] = fv_float_step(nearest, i % 2 != 0 ? (i + 1) / 2 : -i / 2);
        if (choose(find_bounds(&rises, (double)found[0]), &found[1])) return true;
    }
    return false;
}

/* ---- the channels of a layer ----------------------------------------------------------------- */

/* What all channels share. */
struct layer {
    const int32_t *multiplier, *shift, *bias;
    int32_t channels, zero_out, act_min, act_max;
};

/* Sums of the products of a channel's weights with 0 and 255, whichever is less, and more. */
struct reach {
    int64_t least, most;
};

static void add_weight(struct reach *reach, int32_t weight)
{
    if (weight < 0)
        reach->least += 255 * (int64_t)weight;
    else
        reach->most += 255 * (int64_t)weight;
}

/* 16 channels from `first` on: factors, and `pitch` floats further the offsets. Where one of them
 * has no factor none has. */
static void fill_block(const struct layer *l, int32_t first, const struct reach reach[16],
                       float *real, ptrdiff_t pitch)
{
    const int32_t end = l->channels - first < 16 ? l->channels - first : 16;
    for (int32_t i = 0; i < 16; i++) {
        const int32_t at = first + i;
        float found[2] = {0};
        struct fv_nn_real_channel c = {.first = l->act_min + 1 - l->zero_out,
                                       .last = l->act_max - l->zero_out};
        if (i < end) {
            c.multiplier = l->multiplier[at];
            c.shift = l->shift[at];
            c.least = l->bias[at] + reach[i].least;
            c.most = l->bias[at] + reach[i].most;
        }
        if (!fv_nn_real_find(&c, found)) {
            memset(real, 0, 16 * sizeof *real);
            return;
        }
        for (int32_t part = 0; part < 2; part++)
            real[part * pitch + i] = found[part];
    }
}

void fv_nn_real_gemm(const struct fv_nn_gemm *g, float *real)
{
    const struct layer layer = {.multiplier = g->multiplier,
                                .shift = g->shift,
                                .bias = g->bias,
                                .channels = g->n,
                                .zero_out = g->zero_out,
                                .act_min = g->act_min,
                                .act_max = g->act_max};
    for (int32_t first = 0; first < g->n; first += 16) {
        const int8_t *w = g->weights + (ptrdiff_t)first * g->k4 * 4;
        struct reach reach[16] = {{0, 0}};
        for (int32_t k = 0; k < g->k4 * 4; k += 4) {
            for (int32_t c = 0; c < 16; c++) {
                for (int32_t i = 0; i < 4; i++, w++) /* the factor counts for no padding */
                    add_weight(&reach[c], *w + (k + i < g->k ? g->row_sum_factor : 0));
            }
        }
        fill_block(&layer, first, reach, real + (ptrdiff_t)first * 2, 16);
    }
}

void fv_nn_real_depthwise(const struct fv_nn_depthwise *d, float *real)
{
    const struct layer layer = {.multiplier = d->multiplier,
                                .shift = d->shift,
                                .bias = d->bias,
                                .channels = d->channels,
                                .zero_out = d->zero_out,
                                .act_min = d->act_min,
                                .act_max = d->act_max};
    const int32_t taps = d->kh * d->kw;
    for (int32_t first = 0; first < d->channels; first += 16) {
        struct reach reach[16] = {{0, 0}};
        for (int32_t tap = 0; tap < taps; tap++) {
            for (int32_t c = 0; c < 16; c++) {
                int32_t weight = 0;
                for (int32_t plane = 0; plane < d->planes; plane++)
                    weight += d->weights[((ptrdiff_t)plane * taps + tap) * d->c16 + first + c];
                add_weight(&reach[c], weight);
            }
        }
        fill_block(&layer, first, reach, real + first, d->c16);
    }
}

/* ---- a model's table: offsets by operator, then the blocks ----------------------------------- */

/* Channels that are rounded, or 0, and the bytes of their weights. */
static int32_t channels_of(const struct fv_model_op *op, int64_t *weights)
{
    const struct fv_op_conv *c = &op->u.conv;
    const struct fv_op_depthwise *d = &op->u.depthwise;
    if (op->kind == FV_OP_DEPTHWISE) {
        *weights = (int64_t)d->planes * d->window.kh * d->window.kw * d->c16;
        return d->image.in_c;
    }
    if (op->kind != FV_OP_CONV || c->single_rounding || c->parts > 1) return 0;
    *weights = ((int64_t)c->image.out_c + 15) / 16 * 64 * c->k4;
    return c->image.out_c;
}

static size_t begin_of_blocks(const struct fv_model *model)
{
    return ((size_t)model->header->op_count + 15) / 16 * 16;
}

/* Where the operator's blocks begin; `end` goes past them. Of a file whose operators share weights,
 * so that they are far more than the file, or that has far more channels than any network, only the
 * first ones have blocks: else a file could make the set-up take minutes. `all_weights`: the
 * bytes of their weights so far. */
static size_t next_blocks(const struct fv_model *model, const struct fv_model_op *op, size_t *end,
                          uint64_t *all_weights)
{
    int64_t weights = 0;
    const int32_t channels = channels_of(op, &weights);
    const size_t floats = ((size_t)channels + 15) / 16 * BLOCK;
    if (channels == 0 || *end + floats > begin_of_blocks(model) + BLOCKS_MAX * BLOCK ||
        *all_weights + (uint64_t)weights > 4 * (uint64_t)model->header->file_bytes)
        return 0;
    const size_t begin = *end;
    *all_weights += (uint64_t)weights;
    *end += floats;
    return begin;
}

size_t fv_nn_real_bytes(const struct fv_model *model)
{
    const size_t begin = begin_of_blocks(model);
    size_t end = begin;
    uint64_t weights = 0;
    for (uint32_t i = 0; i < model->header->op_count; i++)
        next_blocks(model, &model->ops[i], &end, &weights);
    return end == begin ? 0 : end * sizeof(float);
}

void fv_nn_real_carve(struct fv_model *model, struct fv_arena *arena)
{
    const size_t bytes = fv_nn_real_bytes(model);
    model->real = bytes == 0 ? NULL : fv_arena_take(arena, bytes, 1);
}

void fv_nn_real_fill(const struct fv_model *model, const struct fv_kernels *kernels)
{
    size_t end = begin_of_blocks(model);
    uint64_t weights = 0;
    if ((kernels->isas & FV_ISA_AVX512VNNI) == 0 || model->real == NULL) return;
    for (uint32_t i = 0; i < model->header->op_count; i++) {
        const struct fv_model_op *op = &model->ops[i];
        const size_t begin = next_blocks(model, op, &end, &weights);
        float *real = (float *)(void *)model->real + begin;
        if (begin == 0) continue;
        if (op->kind == FV_OP_DEPTHWISE) {
            const struct fv_nn_depthwise d = fv_nn_depthwise_of(model, op);
            fv_nn_real_depthwise(&d, real);
        } else {
            const struct fv_nn_gemm g = fv_nn_gemm_of(model, op);
            fv_nn_real_gemm(&g, real);
        }
        model->real[i] = (uint32_t)begin;
    }
}

const float *fv_nn_real_of(const struct fv_model *model, const struct fv_model_op *op)
{
    const ptrdiff_t index = op - model->ops;
    if (model->real == NULL || model->real[index] == 0) return NULL;
    return (const float *)(const void *)model->real + model->real[index];
}
