/* NumPy's files: arrays read from .npy (format 1.0 to 3.0, little-endian, C order), and written as
 * an archive .npz without compression, which numpy.load reads. Format: "NEP 1 -- A Simple File
 * Format for NumPy Arrays". The heap is used. */
#ifndef FOVEA_APP_LAB_NPY_H
#define FOVEA_APP_LAB_NPY_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "fovea/network.h"

enum { FV_NPY_AXES_MAX = FOVEA_TENSOR_AXES_MAX + 2 };

struct fv_npy {
    enum fovea_tensor_type type;
    int32_t axis_count, shape[FV_NPY_AXES_MAX];
    const void *data;
    size_t bytes; /* of all elements */
    char *file;   /* the whole file, to be given to free() */
};

/* FOVEA_ERROR_INPUT: `error` names the file, what was found and what was expected. */
enum fovea_status fv_npy_read(const char *path, struct fv_npy *array, struct fovea_error *error);
/* The same for a file's bytes. */
enum fovea_status fv_npy_parse(const char *name, const uint8_t *data, size_t bytes,
                               struct fv_npy *array, struct fovea_error *error);

/* "int8 [1, 24, 32, 3]" */
const char *fv_npy_describe(enum fovea_tensor_type type, int32_t axis_count, const int32_t *shape,
                            char *text, size_t bytes);

enum { FV_NPZ_ENTRIES_MAX = 64 };

/* An archive that is being written. */
struct fv_npz {
    FILE *stream;
    int count;
    uint64_t at;
    struct fv_npz_entry {
        char name[80];
        uint32_t checksum, bytes, at;
    } entries[FV_NPZ_ENTRIES_MAX];
};

void fv_npz_begin(struct fv_npz *npz, FILE *stream);
/* Add `array` as `name`. False: it cannot be written, or the archive would pass 4 GiB or
 * FV_NPZ_ENTRIES_MAX. */
bool fv_npz_add(struct fv_npz *npz, const char *name, const struct fv_npy *array);
/* The archive's directory. False: it cannot be written. */
bool fv_npz_end(struct fv_npz *npz);

#endif
