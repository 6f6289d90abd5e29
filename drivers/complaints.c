#include "complaints.h"

#include <string.h>

void fv_complaints_add(struct fv_complaints *complaints, int kind, const struct fovea_error *line)
{
    pthread_mutex_lock(&complaints->lock);
    if (strcmp(complaints->lines[kind].text, line->text) != 0) {
        if (!complaints->waiting[kind]) complaints->lines[kind] = *line;
        complaints->waiting[kind] = true;
    }
    pthread_mutex_unlock(&complaints->lock);
}

void fv_complaints_forget(struct fv_complaints *complaints, int first, int last)
{
    pthread_mutex_lock(&complaints->lock);
    for (int kind = first; kind <= last; kind++)
        if (!complaints->waiting[kind]) complaints->lines[kind].text[0] = '\0';
    pthread_mutex_unlock(&complaints->lock);
}

enum fovea_status fv_complaints_take(struct fv_complaints *complaints, struct fovea_error *line)
{
    enum fovea_status status = FOVEA_AGAIN;
    pthread_mutex_lock(&complaints->lock);
    for (int kind = 0; kind < FV_COMPLAINTS_KINDS && status == FOVEA_AGAIN; kind++) {
        if (!complaints->waiting[kind]) continue;
        complaints->waiting[kind] = false;
        if (line != NULL) *line = complaints->lines[kind];
        status = FOVEA_OK;
    }
    pthread_mutex_unlock(&complaints->lock);
    return status;
}
