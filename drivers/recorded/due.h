/* When each sample of a recording is given: with the first frame that is not before its stamp, in
 * the order in which samples were written. A stamp that is not in that order holds no others up:
 * its sample comes between those beside it that are in order, as it did when it was recorded. As
 * many samples as can be are taken to be in order. */
#ifndef FOVEA_RECORDED_DUE_H
#define FOVEA_RECORDED_DUE_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/sensor.h"
#include "fovea/status.h"

struct fv_due {
    const struct fovea_sample *list;
    size_t count, next; /* next: to be given */
    int64_t *due_ns;    /* never falling; NULL: the stamps themselves never fall */
};

/* `list` stays where it is, of at most FV_SAMPLES_MAX samples; `name` stands in errors. Init-only.
 */
enum fovea_status fv_due_open(struct fv_due *due, const struct fovea_sample *list, size_t count,
                              const char *name, struct fovea_error *error);
void fv_due_close(struct fv_due *due);

/* When a sample is due. */
int64_t fv_due_at(const struct fv_due *due, size_t index);
/* Pass over all samples that are due by then. Real-time safe, as is the next. */
void fv_due_start_after(struct fv_due *due, int64_t after_ns);
/* The next samples that are due by then, at most `count_max`. */
uint32_t fv_due_take(struct fv_due *due, int64_t until_ns, struct fovea_sample *samples,
                     uint32_t count_max);

#endif
