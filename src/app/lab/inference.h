/* A network for commands on pictures: its file, memory and what it found last. The heap is used. */
#ifndef FOVEA_APP_LAB_INFERENCE_H
#define FOVEA_APP_LAB_INFERENCE_H

#include "app/config/model_file.h"
#include "app/lab/found.h"
#include "kernels/kernels.h"

struct fv_inference {
    struct fv_model_file file;
    struct fv_kernels kernels;
    uint8_t *arena;
    struct fv_detect_scratch *scratch;
    struct fv_found found;
    uint64_t units; /* run this many at a time; 0: all */
};

/* Begin with {0}. `error` names what is wrong; fv_inference_close is due in any case. */
enum fovea_status fv_inference_open(struct fv_inference *inference, const char *path,
                                    struct fovea_error *error);
void fv_inference_close(struct fv_inference *inference);

/* What the network finds in a picture. FOVEA_ERROR_UNSUPPORTED: it takes none. */
enum fovea_status fv_inference_run(struct fv_inference *inference, const struct fovea_image *image);

#endif
