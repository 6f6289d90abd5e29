#include "drivers/table.h"
#include "common/played.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <string.h>

#include "common/datasets.h"

void played_source(const struct fovea_source_ops *ops, struct fovea_source *source,
                   struct played *played)
{
    struct fovea_frame frame;
    struct fovea_error error;
    enum fovea_status status;
    memset(played, 0, sizeof *played);
    played->rate_hz = ops->info(source)->rate_hz;
    played->has_camera = ops->info(source)->rig.cameras[0].calibrated;
    played->camera = ops->info(source)->rig.cameras[0].camera;
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    while ((status = ops->dequeue(source, INT64_MAX, &frame)) == FOVEA_OK &&
           played->count < PLAYED_MAX) {
        played->sequence[played->count] = frame.sequence;
        for (int32_t i = 0; i < frame.images[0].width; i++)
            played->picture[played->count] =
                played->picture[played->count] * 31 + frame.images[0].data[i];
        played->stamp_ns[played->count++] = frame.stamp_ns;
        ops->requeue(source, &frame);
    }
    assert_int_equal(status, FOVEA_END);
    ops->counts(source, &played->counts);
    (void)ops->complaint(source, &played->complaint);
    ops->stop(source);
    ops->close(source);
}

enum fovea_status played_uri(const char *scheme, const char *address,
                             const struct fovea_source_selection *selection, struct played *played,
                             struct fovea_error *error)
{
    char uri[FV_TEST_PATH_BYTES + 16];
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    snprintf(uri, sizeof uri, "%s:%s", scheme, address);
    assert_int_equal(fv_source_find(uri, &ops, &address, error), FOVEA_OK);
    const enum fovea_status status = ops->open(address, selection, &source, error);
    if (status == FOVEA_OK) played_source(ops, source, played);
    return status;
}

void played_fine(const char *scheme, const char *address, struct played *played)
{
    static const struct fovea_source_selection everything = {.step = 1};
    struct fovea_error error = {.text = ""};
    if (played_uri(scheme, address, &everything, played, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
}
