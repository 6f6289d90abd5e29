/* The visual vocabulary: a tree of binary centres that gives every ORB descriptor a word.
 *
 * Each node has FV_VOCABULARY_BRANCH children, FV_VOCABULARY_DEPTH levels deep; a descriptor goes
 * to the nearest child on each level (the first of equally near ones) and its word is the leaf that
 * it ends in. Centres are medians under the Hamming distance (Nister and Stewenius, "Scalable
 * recognition with a vocabulary tree", CVPR 2006; binary as in Galvez-Lopez and Tardos, "Bags of
 * binary words", T-RO 2012).
 *
 * vocabulary.bin, made by tools/vocabulary/train.sh, is linked into the library as read-only data:
 * all centres, level by level, 32 bytes each, then one weight per word, little-endian. Integer
 * only; any thread.
 */
#ifndef FOVEA_MAP_VOCABULARY_H
#define FOVEA_MAP_VOCABULARY_H

#include <stdint.h>

#include "features/spread.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_VOCABULARY_BRANCH = 20,
    FV_VOCABULARY_DEPTH = 3,
    FV_VOCABULARY_WORDS = 20 * 20 * 20,
    FV_VOCABULARY_CENTRES = 20 + 20 * 20 + FV_VOCABULARY_WORDS,
    FV_VOCABULARY_WEIGHT_ONE =
        64, /* of a weight: log(images / images with the word) squared, in 1/64 */
    FV_VOCABULARY_BYTES = FV_VOCABULARY_CENTRES * 32 + FV_VOCABULARY_WORDS * 2
};

/* The whole of vocabulary.bin. */
extern const uint8_t fv_vocabulary_data[FV_VOCABULARY_BYTES];

/* Words of `count` descriptors (FV_DESCRIPTOR_BYTES each, 8-byte aligned). Real-time safe: 60
 * distances each.
 */
void fv_vocabulary_words(const struct fv_kernels *kernels, const uint8_t *descriptors,
                         uint32_t count, uint16_t *words);

/* How much a word tells, in 1 / FV_VOCABULARY_WEIGHT_ONE: rare words much, words of every image
 * nothing. */
static inline uint32_t fv_vocabulary_weight(uint32_t word)
{
    const uint8_t *at = fv_vocabulary_data + (size_t)FV_VOCABULARY_CENTRES * 32 + 2 * (size_t)word;
    return (uint32_t)at[0] | (uint32_t)at[1] << 8;
}

#ifdef __cplusplus
}
#endif
#endif
