/* Model files of networks (.fvm, src/nn/model.h) in memory of their own. The heap is used;
 * init-only. */
#ifndef FOVEA_APP_CONFIG_MODEL_FILE_H
#define FOVEA_APP_CONFIG_MODEL_FILE_H

#include "fovea/status.h"
#include "kernels/kernels.h"
#include "nn/model.h"

struct fv_model_file {
    uint8_t *data; /* at a cache line; NULL: none */
    size_t bytes;
    struct fv_model model;
};

/* Read and check. FOVEA_ERROR_INPUT or FOVEA_ERROR_SYSTEM: `error` names the file and what is
 * wrong, and nothing is left in `file`. */
enum fovea_status fv_model_file_read(const char *path, struct fv_model_file *file,
                                     struct fovea_error *error);
/* Make its network faster with these kernels (nn/real.h), where there is memory for it. */
void fv_model_file_prepare(struct fv_model_file *file, const struct fv_kernels *kernels);
void fv_model_file_free(struct fv_model_file *file);

#endif
