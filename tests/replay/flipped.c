/* A recording with lockstep_every: 1 of a run in whose state a bit is flipped before one of its
 * steps: what a processor with a fault does. everywhere.sh makes it on one architecture and
 * compares it with the run without a fault on another.
 *
 *     flipped FILE SOURCE [OWNER FRAME]
 *
 * SOURCE is a URI with an end, such as sim:orbit?frames=12; OWNER a stage or job as `fovea check`
 * lists its memory, whose middle byte is changed before the step of frame FRAME, from 0. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "app/config/settings.h"
#include "app/record/recorder.h"
#include "drivers/table.h"
#include "runtime/state.h"

static const struct fovea_source_ops *ops;
static struct fovea_source *source;
static struct fv_settings settings;
static struct fovea *rt;
static struct fv_recorder *recorder;

static void expect(enum fovea_status status, const struct fovea_error *error)
{
    if (status == FOVEA_OK) return;
    fprintf(stderr, "flipped: %s\n", error->text);
    exit(2);
}

static void open_run(const char *uri, const char *path)
{
    const struct fovea_source_selection whole = {.step = 1};
    struct fovea_error error = {.text = "the source does not open"};
    const char *address;
    size_t bytes = 0;
    expect(fv_source_find(uri, &ops, &address, &error), &error);
    expect(ops->open(address, &whole, &source, &error), &error);
    expect(ops->start(source, &error), &error);
    fv_settings_default(&settings);
    struct fovea_config *config = &settings.runtime;
    config->rig.cameras[0].camera = ops->info(source)->rig.cameras[0].camera;
    config->lockstep_every = 1;
    config->features.count_max = 300;
    expect(fovea_size(config, &bytes, &error), &error);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    expect(fovea_init(memory, bytes, config, &rt, &error), &error);
    const struct fovea_camera *camera = &config->rig.cameras[0].camera;
    const struct fv_recorder_setup setup = {.path = path,
                                            .settings = &settings,
                                            .kernel_set = fovea_cpu_name(rt),
                                            .frame_bytes =
                                                (size_t)camera->width * (size_t)camera->height};
    expect(fv_recorder_open(&setup, &recorder, &error), &error);
}

static void flip(const char *owner)
{
    for (uint32_t i = 0; i < rt->lockstep.part_count; i++) {
        const struct fv_lockstep_part *part = &rt->lockstep.parts[i];
        if (strcmp(part->owner, owner) != 0) continue;
        rt->part_base[part->part][part->from + part->bytes / 2] ^= 4;
        return;
    }
    fprintf(stderr, "flipped: found nothing of %s in the state\n", owner);
    exit(2);
}

static void iterate(const struct fovea_frame *frame)
{
    struct fovea_inputs inputs = {.frame = frame, .now_ns = frame->stamp_ns};
    struct fovea_outputs outputs;
    fovea_grants_fixed(&settings.runtime, &inputs.grants);
    while (!fv_recorder_room(recorder))
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    fovea_step(rt, &inputs, &outputs);
    fv_recorder_step(recorder, &inputs, &outputs);
    fovea_work(rt, &inputs.grants, &outputs);
    fv_recorder_work(recorder, &inputs, &inputs.grants, &outputs);
}

int main(int argc, char **argv)
{
    struct fovea_error error = {.text = "the recording is not complete"};
    struct fovea_frame frame;
    if (argc != 3 && argc != 5) {
        fprintf(stderr, "usage: flipped FILE SOURCE [OWNER FRAME]\n");
        return 2;
    }
    const uint64_t at = argc == 5 ? strtoull(argv[4], NULL, 10) : UINT64_MAX;
    open_run(argv[2], argv[1]);
    uint64_t n = 0;
    for (; ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK; n++) {
        if (n == at) flip(argv[3]);
        iterate(&frame);
        ops->requeue(source, &frame);
    }
    expect(fv_recorder_close(recorder, NULL), &error);
    ops->stop(source);
    ops->close(source);
    free(rt);
    printf("%" PRIu64 " frames\n", n);
    return argc == 5 && at >= n;
}
