#include "features/nearest.h"

#include <string.h>

static uint32_t groups_of(uint32_t count)
{
    return (count + FV_SQUARES_GROUP - 1) / FV_SQUARES_GROUP;
}

void fv_nearest_carve(struct fv_nearest *nearest, uint32_t count_max, uint32_t bytes,
                      struct fv_packed *sets, uint32_t set_count, struct fv_arena *arena)
{
    const size_t padded = (size_t)groups_of(count_max) * FV_SQUARES_GROUP;
    nearest->count_max = count_max;
    nearest->bytes = bytes;
    nearest->words = (int32_t)(bytes + 3) / 4;
    const size_t row = 4 * (size_t)nearest->words;
    for (uint32_t i = 0; i < set_count; i++) {
        sets[i].trains = fv_arena_take(arena, padded, row);
        sets[i].bias = fv_arena_take(arena, padded, sizeof *sets[i].bias);
        sets[i].queries = fv_arena_take(arena, count_max, row);
        sets[i].square = fv_arena_take(arena, count_max, sizeof *sets[i].square);
    }
}

void fv_nearest_pack(const struct fv_nearest *nearest, struct fv_packed *set,
                     const uint8_t *descriptors, uint32_t count)
{
    const uint32_t groups = groups_of(count), words = (uint32_t)nearest->words;
    set->count = count;
    for (uint32_t i = count; i < groups * FV_SQUARES_GROUP; i++)
        set->bias[i] = FV_SQUARES_NONE;
    if (groups > 0) /* of the last group some may be missing */
        memset(set->trains + (size_t)(groups - 1) * FV_SQUARES_GROUP * words * 4, 0,
               (size_t)FV_SQUARES_GROUP * words * 4);
    for (uint32_t i = 0; i < count; i++) {
        const uint8_t *from = descriptors + (size_t)i * nearest->bytes;
        uint8_t *train =
            set->trains +
            ((size_t)(i / FV_SQUARES_GROUP) * words * FV_SQUARES_GROUP + i % FV_SQUARES_GROUP) * 4;
        int8_t *query = set->queries + (size_t)i * words * 4;
        int32_t square = 0, sum = 0;
        for (uint32_t k = 0; k < 4 * words; k++) {
            const int32_t value = k < nearest->bytes ? from[k] : 0;
            train[(size_t)(k / 4) * FV_SQUARES_GROUP * 4 + k % 4] = (uint8_t)value;
            query[k] = (int8_t)(k < nearest->bytes ? value - 128 : 0);
            square += value * value;
            sum += value;
        }
        set->square[i] = square;
        set->bias[i] = square - 256 * sum;
    }
}

void fv_nearest_find(const struct fv_nearest *nearest, const struct fv_kernels *kernels,
                     const struct fv_packed *a, const struct fv_packed *b, int32_t *distance,
                     int32_t *second, uint32_t *index)
{
    kernels->squares_two_u8(distance, second, index, a->queries, (int32_t)a->count, b->trains,
                            b->bias, (int32_t)groups_of(b->count), nearest->words);
    for (uint32_t i = 0; i < a->count; i++) {
        distance[i] += a->square[i];
        second[i] = second[i] < FV_SQUARES_NONE ? second[i] + a->square[i] : second[i];
    }
}
