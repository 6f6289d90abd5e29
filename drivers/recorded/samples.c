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

static int compare_values(const double *a, const double *b, int count)
{
    for (int i = 0; i < count; i++)
        if (a[i] != b[i]) return a[i] < b[i] ? -1 : 1;
    return 0;
}

static int compare(const void *a, const void *b)
{
    const struct fovea_sample *p = a, *q = b;
    const int64_t earlier = fovea_sample_stamp(p), later = fovea_sample_stamp(q);
    if (earlier != later) return earlier < later ? -1 : 1;
    if (p->kind != q->kind) return p->kind < q->kind ? -1 : 1;
    if (p->kind == FOVEA_SAMPLE_IMU) {
        const int order = compare_values(p->imu.gyro, q->imu.gyro, 3);
        return order != 0 ? order : compare_values(p->imu.acceleration, q->imu.acceleration, 3);
    }
    const struct fovea_wheel_odometry_sample *v = &p->wheel_odometry, *w = &q->wheel_odometry;
    const int order = compare_values(v->position_m, w->position_m, 3);
    return order != 0 ? order : compare_values(v->orientation, w->orientation, 4);
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
