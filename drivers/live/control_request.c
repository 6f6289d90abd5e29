#include "control_request.h"

#include <errno.h>
#include <unistd.h>

#include "../clock.h"

static const int64_t patience_ns = 3000000000;

void fv_control_request_open(struct fv_control_request *request)
{
    pthread_mutex_init(&request->lock, NULL);
    pthread_cond_init(&request->done, NULL);
}

void fv_control_request_close(struct fv_control_request *request)
{
    pthread_cond_destroy(&request->done);
    pthread_mutex_destroy(&request->lock);
}

static enum fovea_status no_answer(struct fv_control_request *request, const char *uri,
                                   struct fovea_error *error)
{
    const bool begun = request->stage == FV_CONTROL_REQUEST_BEGUN;
    request->abandoned = begun;
    if (!begun) request->stage = FV_CONTROL_REQUEST_NONE;
    atomic_store(&request->asked, false);
    return fovea_error_set(error, FOVEA_AGAIN, "%s: the camera does not answer%s", uri,
                           begun ? "; it may still take the value" : "");
}

enum fovea_status fv_control_request_ask(struct fv_control_request *request, const char *uri,
                                         int wake_fd, enum fovea_source_control control,
                                         double value, struct fovea_error *error)
{
    const uint64_t one = 1;
    const struct timespec until = fv_clock_timespec(fv_clock_ns(CLOCK_MONOTONIC) + patience_ns);
    enum fovea_status status;
    pthread_mutex_lock(&request->lock);
    if (request->stage != FV_CONTROL_REQUEST_NONE) {
        pthread_mutex_unlock(&request->lock);
        return fovea_error_set(error, FOVEA_AGAIN,
                               "%s: the camera has not answered to the value before", uri);
    }
    request->stage = FV_CONTROL_REQUEST_ASKED;
    request->abandoned = false;
    request->control = control;
    request->value = value;
    atomic_store(&request->asked, true);
    int late = write(wake_fd, &one, sizeof one) < 0 && errno != EAGAIN ? errno : 0;
    while (request->stage != FV_CONTROL_REQUEST_DONE && late == 0)
        late = pthread_cond_clockwait(&request->done, &request->lock, CLOCK_MONOTONIC, &until);
    if (request->stage == FV_CONTROL_REQUEST_DONE) {
        status = request->status;
        if (error != NULL) *error = request->error;
        request->stage = FV_CONTROL_REQUEST_NONE;
    } else {
        status = no_answer(request, uri, error);
    }
    pthread_mutex_unlock(&request->lock);
    return status;
}

bool fv_control_request_take(struct fv_control_request *request, enum fovea_source_control *control,
                             double *value)
{
    if (!atomic_load_explicit(&request->asked, memory_order_acquire)) return false;
    pthread_mutex_lock(&request->lock);
    const bool any = request->stage == FV_CONTROL_REQUEST_ASKED;
    if (any) {
        request->stage = FV_CONTROL_REQUEST_BEGUN;
        *control = request->control;
        *value = request->value;
    }
    atomic_store(&request->asked, false);
    pthread_mutex_unlock(&request->lock);
    return any;
}

void fv_control_request_answer(struct fv_control_request *request, enum fovea_status status,
                               const struct fovea_error *error)
{
    pthread_mutex_lock(&request->lock);
    request->status = status;
    request->error = *error;
    request->stage = request->abandoned ? FV_CONTROL_REQUEST_NONE : FV_CONTROL_REQUEST_DONE;
    pthread_cond_signal(&request->done);
    pthread_mutex_unlock(&request->lock);
}
