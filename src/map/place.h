/* Place recognition: which keyframes look like a frame.
 *
 * A frame is the set of visual words of its descriptors (vocabulary.h). The inverted index holds
 * for every word one bit per keyframe slot, so its size is fixed, and adding or removing a keyframe
 * cannot fail. Two frames are as similar as the cosine of their weighted sets: the weight of the
 * words they share over the root of the product of their own weights. How often a word occurs in a
 * frame is left out, since repeated texture would shout down the rest (Jegou, Douze and Schmid, "On
 * the burstiness of visual elements", CVPR 2009).
 *
 * A slot's entry carries the generation of the keyframe that it was made for; fv_place_holds says
 * whether it is still that one, so removing a keyframe does not involve the index. Integer only
 * but for one root; no addresses in the state. Real-time safe. */
#ifndef FOVEA_MAP_PLACE_H
#define FOVEA_MAP_PLACE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "map/vocabulary.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_PLACE_LANES_MAX = 4, /* of 64 keyframes each */
    FV_PLACE_ONE = 65536,   /* the score of two equal frames */
    FV_PLACE_UNIT = 256,    /* descriptors that a unit of work may turn to words */
    /* Of the search for a pose at a place that was recognised, relocalisation and closures alike.
     */
    FV_PLACE_DISTANCE_MAX = 60, /* Hamming, of a match without prediction */
    FV_PLACE_MATCHES_MIN = 15,  /* to sample on */
    FV_PLACE_SAMPLES_MAX = 300,
    FV_PLACE_SAMPLED_MIN = 12,   /* matches that agree with the best sample */
    FV_PLACE_NEIGHBOURS_MAX = 12 /* of a candidate, that are the same place */
};

/* Largest distance of a match over that of the second nearest, without prediction. */
#define FV_PLACE_RATIO_MAX 0.85

/* A set of keyframe slots. */
struct fv_place_set {
    uint64_t lane[FV_PLACE_LANES_MAX];
};

static inline void fv_place_set_add(struct fv_place_set *set, uint32_t slot)
{
    set->lane[slot >> 6] |= UINT64_C(1) << (slot & 63);
}

/* The different words of a frame: filled in pieces, then closed. */
struct fv_place_words {
    uint32_t count;  /* of the list, once closed */
    uint32_t weight; /* sum over it */
    uint64_t present[(FV_VOCABULARY_WORDS + 63) / 64];
};

struct fv_place_slot {
    uint32_t generation; /* of the keyframe */
    uint32_t weight;     /* of its words; 0: no entry */
};

struct fv_place_candidate {
    uint32_t slot;
    uint32_t score; /* of FV_PLACE_ONE */
};

struct fv_place {
    uint32_t keyframes, lanes;
    uint64_t *rows;              /* persistent: `lanes` per word */
    struct fv_place_slot *slots; /* persistent */
};

/* Take memory for an index over `keyframes` slots (at most 64 * FV_PLACE_LANES_MAX): 8 bytes per
 * word and 64 keyframes. Sets sizes and addresses only. */
void fv_place_carve(struct fv_place *place, uint32_t keyframes, struct fv_arena *persistent);
/* Empty the index. */
void fv_place_clear(struct fv_place *place);

/* ---- words of a frame ------------------------------------------------------------------------ */

void fv_place_words_begin(struct fv_place_words *words);
/* Take in descriptors; at most FV_PLACE_UNIT of them make a unit of work. */
void fv_place_words_add(struct fv_place_words *words, const struct fv_kernels *kernels,
                        const uint8_t *descriptors, uint32_t count);

/* ---- the index ------------------------------------------------------------------------------- */

/* Make the entry of a keyframe, in place of any other of the slot. One unit: a bit in each of the
 * words' rows. */
void fv_place_insert(struct fv_place *place, uint32_t slot, uint32_t generation,
                     const struct fv_place_words *words);
void fv_place_remove(struct fv_place *place, uint32_t slot);

static inline bool fv_place_holds(const struct fv_place *place, uint32_t slot, uint32_t generation)
{
    return place->slots[slot].weight != 0 && place->slots[slot].generation == generation;
}

/* Scores of all slots in `among` that have an entry; others are 0. `scores`: place->keyframes
 * elements. One unit: a frame's words times the keyframes that have them. */
void fv_place_scores(const struct fv_place *place, const struct fv_place_words *words,
                     const struct fv_place_set *among, uint32_t *scores);

/* The `max` best of `scores` that are at least `least`, best first, equal ones by slot. Returns how
 * many. */
uint32_t fv_place_best(const uint32_t *scores, uint32_t keyframes, uint32_t least,
                       struct fv_place_candidate *best, uint32_t max);

#ifdef __cplusplus
}
#endif
#endif
