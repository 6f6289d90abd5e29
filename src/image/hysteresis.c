#include "image/hysteresis.h"

void fv_hysteresis_carve(struct fv_hysteresis *hysteresis, int32_t width, int32_t height,
                         struct fv_arena *arena)
{
    hysteresis->height = height;
    hysteresis->words = (width + 63) / 64;
    hysteresis->stride = hysteresis->words + 2;
    const size_t count = (size_t)hysteresis->stride * (size_t)(height + 2);
    hysteresis->weak = fv_arena_take(arena, count, sizeof *hysteresis->weak);
    hysteresis->edges = fv_arena_take(arena, count, sizeof *hysteresis->edges);
    hysteresis->stack = fv_arena_take_raw(arena, count, sizeof *hysteresis->stack);
    hysteresis->waiting = fv_arena_take(arena, count, sizeof *hysteresis->waiting);
}

/* Pixels of a word that are in a row's word or beside one that is. */
static uint64_t widened(const uint64_t *word)
{
    return word[0] | word[0] << 1 | word[0] >> 1 | word[-1] << 63 | word[1] >> 63;
}

/* All of the runs of `weak` that `edges`, a part of it, touches. */
static uint64_t filled(uint64_t edges, uint64_t weak)
{
    uint64_t open_left = weak, open_right = weak, left = edges, right = edges;
    for (int step = 1; step < 64; step *= 2) {
        left |= open_left & left << step;
        right |= open_right & right >> step;
        open_left &= open_left << step;
        open_right &= open_right >> step;
    }
    return left | right;
}

/* Grow one word; returns whether it changed. */
static int grow(const struct fv_hysteresis *hysteresis, int64_t i)
{
    uint64_t *edges = hysteresis->edges + i;
    const uint64_t weak = hysteresis->weak[i];
    const uint64_t near =
        widened(edges - hysteresis->stride) | widened(edges) | widened(edges + hysteresis->stride);
    const uint64_t grown = filled(*edges | (near & weak), weak);
    const int changed = grown != *edges;
    *edges = grown;
    return changed;
}

void fv_hysteresis_begin(const struct fv_hysteresis *hysteresis, struct fv_hysteresis_state *state)
{
    *state = (struct fv_hysteresis_state){.next = hysteresis->stride};
}

bool fv_hysteresis_advance(const struct fv_hysteresis *hysteresis,
                           struct fv_hysteresis_state *state, int32_t words)
{
    const int64_t stride = hysteresis->stride;
    const int64_t beside[8] = {-stride - 1, -stride,    -stride + 1, -1,
                               1,           stride - 1, stride,      stride + 1};
    const int64_t end = stride * (hysteresis->height + 1);
    for (; words > 0 && (state->next < end || state->waiting > 0); words--) {
        const int64_t i = state->waiting > 0 ? hysteresis->stack[--state->waiting] : state->next++;
        hysteresis->waiting[i] = 0;
        if ((hysteresis->weak[i] & ~hysteresis->edges[i]) == 0 || !grow(hysteresis, i)) continue;
        for (int k = 0; k < 8; k++) {
            const int64_t j = i + beside[k];
            if ((hysteresis->weak[j] & ~hysteresis->edges[j]) == 0 || hysteresis->waiting[j])
                continue;
            hysteresis->waiting[j] = 1;
            hysteresis->stack[state->waiting++] = (uint32_t)j;
        }
    }
    return state->next >= end && state->waiting == 0;
}
