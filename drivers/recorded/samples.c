#include "samples.h"

#include <stdbool.h>
#include <stdlib.h>

enum fovea_status fv_samples_add(struct fv_samples *samples, const struct fovea_sample *sample,
                                 const char *name, struct fovea_error *error)
{
    if (samples->count == samples->capacity) {
        const size_t larger = samples->capacity == 0 ? 1024 : 2 * samples->capacity;
        struct fovea_sample *moved =
            larger > FV_SAMPLES_MAX ? NULL : realloc(samples->list, larger * sizeof *moved);
        if (moved == NULL)
            return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: no memory for %zu samples", name,
                                   larger);
        samples->list = moved;
        samples->capacity = larger;
    }
    samples->list[samples->count++] = *sample;
    return FOVEA_OK;
}

static int compare(const void *a, const void *b)
{
    const struct fovea_sample *p = a, *q = b;
    const int64_t earlier = fovea_sample_stamp(p), later = fovea_sample_stamp(q);
    if (earlier != later) return earlier < later ? -1 : 1;
    if (p->kind != q->kind) return p->kind < q->kind ? -1 : 1;
    const double *v = p->any.values, *w = q->any.values;
    for (uint32_t i = 0; i < fovea_sample_value_count(p->kind); i++)
        if (v[i] != w[i]) return v[i] < w[i] ? -1 : 1;
    return 0;
}

void fv_samples_sort(struct fv_samples *samples)
{
    bool sorted = true;
    for (size_t i = 1; i < samples->count && sorted; i++)
        sorted = fovea_sample_stamp(&samples->list[i - 1]) <= fovea_sample_stamp(&samples->list[i]);
    if (!sorted) qsort(samples->list, samples->count, sizeof samples->list[0], compare);
}

void fv_samples_free(struct fv_samples *samples)
{
    free(samples->list);
    *samples = (struct fv_samples){.list = NULL};
}
