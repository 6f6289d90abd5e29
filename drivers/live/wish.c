#include "wish.h"

#include <errno.h>
#include <unistd.h>

#include "../clock.h"

static const int64_t patience_ns = 3000000000;

void fv_wish_open(struct fv_wish *wish)
{
    pthread_mutex_init(&wish->lock, NULL);
    pthread_cond_init(&wish->done, NULL);
}

void fv_wish_close(struct fv_wish *wish)
{
    pthread_cond_destroy(&wish->done);
    pthread_mutex_destroy(&wish->lock);
}

static enum fovea_status no_answer(struct fv_wish *wish, const char *uri, struct fovea_error *error)
{
    const bool begun = wish->stage == FV_WISH_BEGUN;
    wish->left = begun;
    if (!begun) wish->stage = FV_WISH_NONE;
    atomic_store(&wish->asked, false);
    return fovea_error_set(error, FOVEA_AGAIN, "%s: the camera does not answer%s", uri,
                           begun ? "; it may still take the value" : "");
}

enum fovea_status fv_wish_ask(struct fv_wish *wish, const char *uri, int wake_fd,
                              enum fovea_source_control control, double value,
                              struct fovea_error *error)
{
    const uint64_t one = 1;
    const struct timespec until = fv_clock_timespec(fv_clock_ns(CLOCK_MONOTONIC) + patience_ns);
    enum fovea_status status;
    pthread_mutex_lock(&wish->lock);
    if (wish->stage != FV_WISH_NONE) {
        pthread_mutex_unlock(&wish->lock);
        return fovea_error_set(error, FOVEA_AGAIN,
                               "%s: the camera has not answered to the value before", uri);
    }
    wish->stage = FV_WISH_ASKED;
    wish->left = false;
    wish->control = control;
    wish->value = value;
    atomic_store(&wish->asked, true);
    int late = write(wake_fd, &one, sizeof one) < 0 && errno != EAGAIN ? errno : 0;
    while (wish->stage != FV_WISH_DONE && late == 0)
        late = pthread_cond_clockwait(&wish->done, &wish->lock, CLOCK_MONOTONIC, &until);
    if (wish->stage == FV_WISH_DONE) {
        status = wish->status;
        if (error != NULL) *error = wish->error;
        wish->stage = FV_WISH_NONE;
    } else {
        status = no_answer(wish, uri, error);
    }
    pthread_mutex_unlock(&wish->lock);
    return status;
}

bool fv_wish_take(struct fv_wish *wish, enum fovea_source_control *control, double *value)
{
    if (!atomic_load_explicit(&wish->asked, memory_order_acquire)) return false;
    pthread_mutex_lock(&wish->lock);
    const bool any = wish->stage == FV_WISH_ASKED;
    if (any) {
        wish->stage = FV_WISH_BEGUN;
        *control = wish->control;
        *value = wish->value;
    }
    atomic_store(&wish->asked, false);
    pthread_mutex_unlock(&wish->lock);
    return any;
}

void fv_wish_answer(struct fv_wish *wish, enum fovea_status status, const struct fovea_error *error)
{
    pthread_mutex_lock(&wish->lock);
    wish->status = status;
    wish->error = *error;
    wish->stage = wish->left ? FV_WISH_NONE : FV_WISH_DONE;
    pthread_cond_signal(&wish->done);
    pthread_mutex_unlock(&wish->lock);
}
