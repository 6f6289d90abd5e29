/* A growing list of sensor samples, and their order. Init-only. */
#ifndef FOVEA_RECORDED_SAMPLES_H
#define FOVEA_RECORDED_SAMPLES_H

#include <stddef.h>

#include "fovea/sensor.h"
#include "fovea/status.h"

enum { FV_SAMPLES_MAX = 1 << 24 };

struct fv_samples {
    struct fovea_sample *list;
    size_t count, capacity;
};

/* `name` (the file) stands in errors: too many, or out of memory. */
enum fovea_status fv_samples_add(struct fv_samples *samples, const struct fovea_sample *sample,
                                 const char *name, struct fovea_error *error);
/* Sort by stamp; equal stamps by kind and value. */
void fv_samples_sort(struct fv_samples *samples);
void fv_samples_free(struct fv_samples *samples);

#endif
