/* Lines for people from a source's own thread to whoever asks, by kind; never for the loop thread.
 */
#ifndef FOVEA_DRIVERS_COMPLAINTS_H
#define FOVEA_DRIVERS_COMPLAINTS_H

#include <pthread.h>
#include <stdbool.h>

#include "fovea/status.h"

enum { FV_COMPLAINTS_KINDS = 8 };

/* The first line of each kind since it was last asked for. */
struct fv_complaints {
    pthread_mutex_t lock;
    bool waiting[FV_COMPLAINTS_KINDS];
    struct fovea_error lines[FV_COMPLAINTS_KINDS];
};

static inline void fv_complaints_open(struct fv_complaints *complaints)
{
    pthread_mutex_init(&complaints->lock, NULL);
}

static inline void fv_complaints_close(struct fv_complaints *complaints)
{
    pthread_mutex_destroy(&complaints->lock);
}

/* A line that was the last of its kind is not given again (until forgotten). */
void fv_complaints_add(struct fv_complaints *complaints, int kind, const struct fovea_error *line);
/* Lines of kinds first..last may come again. */
void fv_complaints_forget(struct fv_complaints *complaints, int first, int last);
/* As fovea_source_ops.complaint. */
enum fovea_status fv_complaints_take(struct fv_complaints *complaints, struct fovea_error *line);

#endif
