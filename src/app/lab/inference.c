#include "app/lab/inference.h"

#include <stdlib.h>
#include <string.h>

#include "nn/run.h"
#include "support/aligned.h"

enum fovea_status fv_inference_open(struct fv_inference *inference, const char *path,
                                    struct fovea_error *error)
{
    enum fv_cpu_set set;
    enum fovea_status status = fv_cpu_from_environment(&set, error);
    if (status == FOVEA_OK) status = fv_model_file_read(path, &inference->file, error);
    if (status != FOVEA_OK) return status;
    fv_kernels_init(&inference->kernels, set);
    fv_model_file_prepare(&inference->file, &inference->kernels);
    inference->arena = fv_aligned_zeroed(fv_nn_arena_bytes(&inference->file.model));
    inference->scratch = calloc(1, sizeof *inference->scratch);
    if (inference->arena == NULL || inference->scratch == NULL ||
        fv_found_open(&inference->found, &inference->file.model) != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: out of memory", path);
    return FOVEA_OK;
}

void fv_inference_close(struct fv_inference *inference)
{
    free(inference->arena);
    free(inference->scratch);
    fv_found_close(&inference->found);
    fv_model_file_free(&inference->file);
    memset(inference, 0, sizeof *inference);
}

enum fovea_status fv_inference_run(struct fv_inference *inference, const struct fovea_image *image)
{
    const struct fv_model *model = &inference->file.model;
    struct fv_found *found = &inference->found;
    const enum fovea_status status = fv_nn_input_fit_of(model, image, &found->fit);
    if (status != FOVEA_OK) return status;
    fv_nn_fill(model, image, &found->fit, NULL, inference->arena, 0,
               model->header->preprocess.height);
    struct fv_nn_progress progress = {0, 0};
    const uint32_t units = inference->units == 0 || inference->units > 1u << 30
                               ? 1u << 30
                               : (uint32_t)inference->units;
    uint32_t done;
    while (fv_nn_run(model, &inference->kernels, inference->arena, &progress, units, &done) ==
           FOVEA_AGAIN)
        continue;
    found->count = fv_detect_decode(model, inference->arena, &found->fit, inference->scratch,
                                    &found->room, found->list, FOVEA_DETECTIONS_MAX);
    return FOVEA_OK;
}
