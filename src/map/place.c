#include "map/place.h"

#include <string.h>

void fv_place_carve(struct fv_place *place, uint32_t keyframes, struct fv_arena *arena)
{
    place->keyframes = keyframes;
    place->lanes = (keyframes + 63) / 64;
    place->rows =
        fv_arena_take(arena, (size_t)FV_VOCABULARY_WORDS * place->lanes, sizeof *place->rows);
    place->slots = fv_arena_take(arena, keyframes, sizeof *place->slots);
}

void fv_place_clear(struct fv_place *place)
{
    memset(place->rows, 0, (size_t)FV_VOCABULARY_WORDS * place->lanes * sizeof *place->rows);
    memset(place->slots, 0, place->keyframes * sizeof *place->slots);
}

void fv_place_words_begin(struct fv_place_words *words)
{
    memset(words, 0, sizeof *words);
}

void fv_place_words_add(struct fv_place_words *words, const struct fv_kernels *kernels,
                        const uint8_t *descriptors, uint32_t count)
{
    uint16_t word[FV_PLACE_UNIT];
    for (uint32_t done = 0; done < count;) {
        const uint32_t some = count - done < FV_PLACE_UNIT ? count - done : FV_PLACE_UNIT;
        fv_vocabulary_words(kernels, descriptors + (size_t)done * FV_DESCRIPTOR_BYTES, some, word);
        for (uint32_t i = 0; i < some; i++) {
            const uint64_t bit = UINT64_C(1) << (word[i] & 63);
            if (words->present[word[i] >> 6] & bit) continue;
            words->present[word[i] >> 6] |= bit;
            words->count++;
            words->weight += fv_vocabulary_weight(word[i]);
        }
        done += some;
    }
}

/* Take the lowest bit out of `bits`. */
static uint32_t next_bit(uint64_t *bits)
{
    const uint32_t bit = (uint32_t)__builtin_ctzll(*bits);
    *bits &= *bits - 1;
    return bit;
}

void fv_place_remove(struct fv_place *place, uint32_t slot)
{
    if (place->slots[slot].weight == 0) return;
    uint64_t *row = place->rows + (slot >> 6);
    for (uint32_t w = 0; w < FV_VOCABULARY_WORDS; w++, row += place->lanes)
        *row &= ~(UINT64_C(1) << (slot & 63));
    memset(&place->slots[slot], 0, sizeof *place->slots);
}

void fv_place_insert(struct fv_place *place, uint32_t slot, uint32_t generation,
                     const struct fv_place_words *words)
{
    fv_place_remove(place, slot);
    /* A frame without any word of weight keeps an entry that nothing finds, so that it is not made
     * again. */
    place->slots[slot] = (struct fv_place_slot){generation, words->weight > 0 ? words->weight : 1};
    for (uint32_t k = 0; k < sizeof words->present / sizeof *words->present; k++)
        for (uint64_t bits = words->present[k]; bits != 0;) {
            const uint32_t word = 64 * k + next_bit(&bits);
            place->rows[(size_t)word * place->lanes + (slot >> 6)] |= UINT64_C(1) << (slot & 63);
        }
}

void fv_place_scores(const struct fv_place *place, const struct fv_place_words *words,
                     const struct fv_place_set *among, uint32_t *scores)
{
    memset(scores, 0, place->keyframes * sizeof *scores);
    for (uint32_t k = 0; k < sizeof words->present / sizeof *words->present; k++)
        for (uint64_t bits = words->present[k]; bits != 0;) {
            const uint32_t word = 64 * k + next_bit(&bits), weight = fv_vocabulary_weight(word);
            const uint64_t *row = place->rows + (size_t)word * place->lanes;
            for (uint32_t lane = 0; lane < place->lanes; lane++)
                for (uint64_t who = row[lane] & among->lane[lane]; who != 0;)
                    scores[64 * lane + next_bit(&who)] += weight;
        }
    for (uint32_t slot = 0; slot < place->keyframes; slot++) {
        if (scores[slot] == 0) continue;
        const double product = (double)words->weight * place->slots[slot].weight;
        scores[slot] = (uint32_t)(FV_PLACE_ONE * (double)scores[slot] / __builtin_sqrt(product));
    }
}

uint32_t fv_place_best(const uint32_t *scores, uint32_t keyframes, uint32_t least,
                       struct fv_place_candidate *best, uint32_t max)
{
    uint32_t count = 0;
    for (uint32_t slot = 0; slot < keyframes; slot++) {
        if (scores[slot] < least || scores[slot] == 0) continue;
        uint32_t at = count;
        for (; at > 0 && best[at - 1].score < scores[slot]; at--)
            if (at < max) best[at] = best[at - 1];
        if (at >= max) continue;
        best[at] = (struct fv_place_candidate){slot, scores[slot]};
        if (count < max) count++;
    }
    return count;
}
