#include "common/live_source.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include <string.h>
#include <time.h>

/* For what comes sooner unless others take the processor. */
#define WAIT_NS INT64_C(60000000000)

int64_t fv_test_now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

struct fovea_source *fv_test_open(const char *address)
{
    static const struct fovea_source_selection everything = {.step = 1};
    struct fovea_source *source = NULL;
    struct fovea_error error = {.text = ""};
    if (fv_source_v4l2.open(address, &everything, &source, &error) != FOVEA_OK)
        fail_msg("%s: %s", address, error.text);
    return source;
}

struct fovea_source *fv_test_start(const char *address)
{
    struct fovea_source *source = fv_test_open(address);
    struct fovea_error error;
    assert_int_equal(fv_source_v4l2.start(source, &error), FOVEA_OK);
    return source;
}

void fv_test_finish(struct fovea_source *source)
{
    fv_source_v4l2.stop(source);
    fv_source_v4l2.close(source);
}

struct fovea_frame fv_test_hold_frame(struct fovea_source *source)
{
    struct fovea_frame frame;
    struct fovea_error error = {.text = ""};
    const int64_t end_ns = fv_test_now_ns() + WAIT_NS;
    enum fovea_status status;
    do
        status = fv_source_v4l2.dequeue(source, end_ns, &frame);
    while (status != FOVEA_OK && status >= 0 && fv_test_now_ns() < end_ns);
    if (status != FOVEA_OK) {
        (void)fv_source_v4l2.complaint(source, &error);
        fail_msg("no frame: %s: %s", fovea_status_name(status), error.text);
    }
    return frame;
}

struct fovea_frame fv_test_next_frame(struct fovea_source *source)
{
    struct fovea_frame frame = fv_test_hold_frame(source);
    fv_source_v4l2.requeue(source, &frame);
    return frame;
}

void fv_test_wait_for_state(struct fovea_source *source, enum fovea_source_state wanted)
{
    struct fovea_frame frame;
    const int64_t end_ns = fv_test_now_ns() + WAIT_NS;
    enum fovea_source_state state; /* asked once: a camera that was OK is late 3 ms later */
    while ((state = fv_source_v4l2.state(source)) != wanted && fv_test_now_ns() < end_ns)
        if (fv_source_v4l2.dequeue(source, fv_test_now_ns() + 1000000, &frame) == FOVEA_OK)
            fv_source_v4l2.requeue(source, &frame);
    assert_int_equal(state, wanted);
}

struct fovea_source_counts fv_test_counts(struct fovea_source *source)
{
    struct fovea_source_counts counts;
    fv_source_v4l2.counts(source, &counts);
    return counts;
}

bool fv_test_complains_of(struct fovea_source *source, const char *words)
{
    struct fovea_error error;
    const int64_t end_ns = fv_test_now_ns() + WAIT_NS;
    do {
        while (fv_source_v4l2.complaint(source, &error) == FOVEA_OK)
            if (strstr(error.text, words) != NULL) return true;
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    } while (fv_test_now_ns() < end_ns);
    return false;
}
