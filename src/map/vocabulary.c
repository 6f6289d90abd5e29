#include "map/vocabulary.h"

/* The file as it is, aligned for the Hamming kernels. */
__asm__(".pushsection .rodata\n"
        ".balign 64\n"
        ".global fv_vocabulary_data\n"
        ".hidden fv_vocabulary_data\n"
        ".type fv_vocabulary_data, %object\n"
        "fv_vocabulary_data:\n"
        ".incbin \"src/map/vocabulary.bin\"\n"
        "fv_vocabulary_end:\n"
        ".size fv_vocabulary_data, fv_vocabulary_end - fv_vocabulary_data\n"
        ".popsection\n");

void fv_vocabulary_words(const struct fv_kernels *kernels, const uint8_t *descriptors,
                         uint32_t count, uint16_t *words)
{
    static const uint16_t children[FV_VOCABULARY_BRANCH] = {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,
                                                            10, 11, 12, 13, 14, 15, 16, 17, 18, 19};
    for (uint32_t i = 0; i < count; i++) {
        const uint8_t *descriptor = descriptors + (size_t)i * FV_DESCRIPTOR_BYTES,
                      *level = fv_vocabulary_data;
        uint32_t node = 0, nodes = 1; /* the path so far, and how many nodes its level has */
        for (int depth = 0; depth < FV_VOCABULARY_DEPTH; depth++) {
            uint16_t distances[FV_VOCABULARY_BRANCH];
            kernels->hamming_some_u8(distances, descriptor,
                                     level +
                                         (size_t)node * FV_VOCABULARY_BRANCH * FV_DESCRIPTOR_BYTES,
                                     children, FV_VOCABULARY_BRANCH);
            uint32_t best = 0;
            for (uint32_t k = 1; k < FV_VOCABULARY_BRANCH; k++)
                if (distances[k] < distances[best]) best = k;
            nodes *= FV_VOCABULARY_BRANCH;
            node = node * FV_VOCABULARY_BRANCH + best;
            level += (size_t)nodes * FV_DESCRIPTOR_BYTES;
        }
        words[i] = (uint16_t)node;
    }
}
