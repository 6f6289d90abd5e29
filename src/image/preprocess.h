/* A chain of operations on grey images (fovea/preprocess.h) on memory from an arena. */
#ifndef FOVEA_IMAGE_PREPROCESS_H
#define FOVEA_IMAGE_PREPROCESS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "fovea/preprocess.h"
#include "image/filters.h"
#include "image/plane.h"
#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_preprocess {
    struct fovea_preprocess_config config;
    int32_t width, height;
    struct fv_filters filters; /* rows that neighbourhoods need */
    struct fv_gauss denoise, sharpen;
    uint16_t (*bilateral)[256];  /* three tables of weights by difference in grey */
    uint32_t (*counts)[256];     /* four tables of a histogram */
    uint8_t *gamma;              /* table */
    struct fv_contrast contrast; /* carved where the chain has it */
};

/* Whether white_balance is among the operations. Real-time safe. */
bool fv_preprocess_balances(const struct fovea_preprocess_config *config);

/* The chain without white_balance: what is done to grey levels. Real-time safe. */
void fv_preprocess_grey(const struct fovea_preprocess_config *config,
                        struct fovea_preprocess_config *grey);

/* Take the memory of a checked chain for planes of width x height. Init-only. */
void fv_preprocess_carve(struct fv_preprocess *chain, const struct fovea_preprocess_config *config,
                         int32_t width, int32_t height, struct fv_arena *arena);

/* Compute the tables, after carving on memory. Init-only. */
void fv_preprocess_prepare(struct fv_preprocess *chain);

/* Change operations and parameters of a carved chain, which began with at least one operation, and
 * compute its tables; the tiles stay, and it has contrast_enhancement only where it began with it.
 * Real-time safe. */
void fv_preprocess_set(struct fv_preprocess *chain, const struct fovea_preprocess_config *config);

/* Run all operations, from `in` to `out` of the carved size, which are the same or do not overlap.
 * Real-time safe; time is proportional to the pixels. */
void fv_preprocess_run(struct fv_preprocess *chain, const struct fv_kernels *kernels,
                       const struct fv_plane *in, const struct fv_plane *out);

#ifdef __cplusplus
}
#endif
#endif
