#include "features/match.h"

enum { NO_DISTANCE = 257 };

void fv_matcher_carve(struct fv_matcher *matcher, uint32_t count_max, struct fv_arena *arena)
{
    matcher->count_max = count_max;
    matcher->nearest = fv_arena_take(arena, count_max, sizeof *matcher->nearest);
    matcher->second = fv_arena_take(arena, count_max, sizeof *matcher->second);
    matcher->back = fv_arena_take(arena, count_max, sizeof *matcher->back);
    matcher->back_second = fv_arena_take(arena, count_max, sizeof *matcher->back_second);
}

static uint16_t distance_of(uint32_t match)
{
    return match == FV_MATCH_NONE ? NO_DISTANCE : (uint16_t)(match >> FV_MATCH_INDEX_BITS);
}

static uint16_t index_of(uint32_t match)
{
    return (uint16_t)(match & ((1u << FV_MATCH_INDEX_BITS) - 1));
}

/* Distance limit and ratio test. */
static bool passes(const struct fv_match *match, const struct fv_match_rules *rules)
{
    if (match->distance > rules->distance_max) return false;
    return rules->ratio_q8 >= FV_MATCH_RATIO_ANY ||
           256u * match->distance < (uint32_t)rules->ratio_q8 * match->second;
}

uint32_t fv_match_all(struct fv_matcher *matcher, const struct fv_kernels *kernels,
                      const uint8_t *queries, uint32_t query_count, const uint8_t *trains,
                      uint32_t train_count, const struct fv_match_rules *rules,
                      struct fv_match *matches)
{
    uint32_t count = 0;
    kernels->hamming_two_u8(matcher->nearest, matcher->second, queries, (int32_t)query_count,
                            trains, (int32_t)train_count);
    if (rules->mutual)
        kernels->hamming_two_u8(matcher->back, matcher->back_second, trains, (int32_t)train_count,
                                queries, (int32_t)query_count);
    for (uint32_t q = 0; q < query_count; q++) {
        const uint32_t nearest = matcher->nearest[q];
        if (nearest == FV_MATCH_NONE) continue;
        const struct fv_match match = {(uint16_t)q, index_of(nearest), distance_of(nearest),
                                       distance_of(matcher->second[q])};
        if (rules->mutual && index_of(matcher->back[match.train]) != q) continue;
        if (passes(&match, rules)) matches[count++] = match;
    }
    return count;
}
