/* Running a model file that may be hostile: what the mutation test and the fuzz target share. */
#ifndef FOVEA_TESTS_NN_MUTANT_H
#define FOVEA_TESTS_NN_MUTANT_H

#include <stdlib.h>
#include <string.h>

#include "detect/decode.h"
#include "nn/real.h"
#include "nn/run.h"

enum { NN_MUTANT_ARENA_MAX = 1 << 22, NN_MUTANT_UNITS_MAX = 60 };

/* State the size and the checksum that the bytes have, so that the checks behind them are reached.
 */
static inline void nn_mutant_seal(uint8_t *data, size_t bytes)
{
    if (bytes < FV_MODEL_HEADER_BYTES) return;
    const uint32_t size = (uint32_t)bytes, crc = fv_model_checksum(data + 16, bytes - 16);
    memcpy(data + 8, &size, 4);
    memcpy(data + 12, &crc, 4);
}

/* The outputs read by every decoder, whatever the file's own. */
static inline void nn_mutant_decode(const struct fv_model *model, const struct fv_nn_input_fit *fit,
                                    uint8_t *arena)
{
    struct fv_detect_scratch *scratch = malloc(sizeof *scratch);
    struct fovea_detection found[FOVEA_DETECTIONS_MAX];
    static struct fovea_keypoint points[FOVEA_KEYPOINTS_MAX];
    static struct fv_detect_mask mask;
    struct fv_detect_room room = {.points = points, .mask = &mask};
    struct fv_model_header header = *model->header;
    struct fv_model read = *model;
    if (scratch == NULL) abort();
    read.header = &header;
    if (header.decode.anchor_data == 0) header.decode.anchor_data = FV_MODEL_HEADER_BYTES;
    if (header.decode.anchor_count == 0) header.decode.anchor_count = 2;
    if (header.decode.coefficients == 0) header.decode.coefficients = 4;
    if (header.decode.point_count == 0) {
        header.decode.point_count = 5;
        header.decode.point_values = 3;
        header.decode.point_score = 2;
    }
    for (header.decode.kind = 0; header.decode.kind < FV_DECODER_COUNT; header.decode.kind++) {
        int32_t width, height;
        fv_detect_mask_size(&read, &width, &height);
        room.pixels = malloc((size_t)width * (size_t)height + 1);
        room.confidence = malloc((size_t)width * (size_t)height + 1);
        if (room.pixels == NULL || room.confidence == NULL) abort();
        fv_detect_decode(&read, arena, fit, scratch, &room, found, FOVEA_DETECTIONS_MAX);
        free(room.pixels);
        free(room.confidence);
    }
    for (uint32_t i = 0; i < header.output_count; i++)
        if (fv_model_output_name(model, i) != NULL &&
            strlen(fv_model_output_name(model, i)) > 1u << 28)
            abort();
    free(scratch);
}

/* Open, and when that succeeds run some units and the decoder in memory of exactly the stated size.
 * `data`: 64-byte aligned. Returns whether the model was taken. */
static inline int nn_mutant_run(const uint8_t *data, size_t bytes)
{
    struct fv_model model;
    struct fovea_error error;
    struct fv_kernels kernels;
    if (fv_model_open(data, bytes, "mutant", &model, &error) != FOVEA_OK) {
        if (strlen(error.text) < 10 || strchr(error.text, '\n') != NULL) abort();
        return 0;
    }
    if (fv_nn_arena_bytes(&model) > NN_MUTANT_ARENA_MAX) return 1;
    void *raw = NULL;
    if (posix_memalign(&raw, 64, fv_nn_arena_bytes(&model)) != 0) abort();
    uint8_t *arena = raw;
    memset(arena, 0x37, fv_nn_arena_bytes(&model));
    struct fv_nn_progress progress = {0, 0};
    uint32_t done;
    /* the best set, or one of lower ones: which bytes are read past an end differs */
    const enum fv_cpu_set best = fv_cpu_best(fv_cpu_detect()),
                          lower[2] = {FV_CPU_C, best >= FV_CPU_NEON ? FV_CPU_NEON : FV_CPU_AVX2};
    const uint32_t choice = model.header->checksum % 4;
    fv_kernels_init(&kernels, choice < 2 ? best : lower[choice - 2]);
    const size_t table = fv_nn_real_bytes(&model);
    if (table > 0) {
        if (posix_memalign(&raw, 64, table) != 0) abort();
        model.real = memset(raw, 0, table);
        fv_nn_real_fill(&model, &kernels);
    }
    for (int i = 0; i < NN_MUTANT_UNITS_MAX; i++) {
        if (progress.op < (int32_t)model.header->op_count &&
            model.ops[progress.op].row_cost > 1 << 26)
            break;
        if (fv_nn_run(&model, &kernels, arena, &progress, 1, &done) != FOVEA_AGAIN) break;
    }
    uint8_t pixels[16 * 16 * 3] = {1, 2, 3};
    const struct fovea_image image = {.data = pixels,
                                      .width = 16,
                                      .height = 16,
                                      .stride_bytes = 48,
                                      .format = FOVEA_PIXEL_RGB24,
                                      .size_bytes = sizeof pixels};
    struct fv_nn_input_fit fit;
    if (fv_nn_input_fit_of(&model, &image, &fit) == FOVEA_OK) {
        fv_nn_fill(&model, &image, &fit, NULL, arena, 0, model.header->preprocess.height);
    } else {
        fit = (struct fv_nn_input_fit){.image_width = 16,
                                       .image_height = 16,
                                       .width = 16,
                                       .height = 16,
                                       .scale_x = 1,
                                       .scale_y = 1};
    }
    nn_mutant_decode(&model, &fit, arena);
    free(model.real);
    free(arena);
    return 1;
}

#endif
