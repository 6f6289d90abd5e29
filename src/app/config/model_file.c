#include "app/config/model_file.h"

#include <stdlib.h>
#include <string.h>

#include "nn/real.h"
#include "support/input.h"
#include "support/aligned.h"
#include "support/text.h"

enum fovea_status fv_model_file_read(const char *path, struct fv_model_file *file,
                                     struct fovea_error *error)
{
    char *data;
    *file = (struct fv_model_file){.data = NULL};
    enum fovea_status status =
        fv_text_read(path, FV_INPUT_MODEL_BYTES_MAX, &data, &file->bytes, error);
    if (status != FOVEA_OK) return status;
    if (file->bytes >= 8 && memcmp(data + 4, "TFL3", 4) == 0) {
        free(data);
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%.300s: found a TensorFlow Lite model, expected a .fvm file: make it with 'python3 tools/import %.100s'",
            path, path);
    }
    file->data = fv_aligned_new(file->bytes + FV_CACHE_LINE_BYTES); /* kernels read whole lines */
    if (file->data != NULL) memcpy(file->data, data, file->bytes);
    free(data);
    if (file->data == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%.300s: out of memory", path);
    status = fv_model_open(file->data, file->bytes, path, &file->model, error);
    if (status != FOVEA_OK) fv_model_file_free(file);
    return status;
}

void fv_model_file_prepare(struct fv_model_file *file, const struct fv_kernels *kernels)
{
    const size_t bytes = fv_nn_real_bytes(&file->model);
    file->model.real = bytes == 0 ? NULL : fv_aligned_zeroed(bytes);
    fv_nn_real_fill(&file->model, kernels);
}

void fv_model_file_free(struct fv_model_file *file)
{
    free(file->model.real);
    free(file->data);
    *file = (struct fv_model_file){.data = NULL};
}
