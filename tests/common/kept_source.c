#include "common/kept_source.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "drivers/table.h"
#include "fovea/sensor.h"

struct kept_frame {
    struct fovea_frame frame; /* its images in `pixels` */
    uint8_t *pixels;
    double T_world_cam[12];
    size_t samples_end; /* those of this frame and of all before it */
};

/* What has been taken of an address from one frame on. */
struct reel {
    char address[240];
    uint64_t start;
    struct fovea_source *camera;
    struct kept_frame *frames;
    size_t count;
    struct fovea_sample *samples;
    size_t sample_count;
    struct reel *next;
};

struct fovea_source {
    struct reel *reel;
    uint64_t frames; /* 0: no end */
    size_t taken, samples_taken;
};

static struct reel *reels;

static const struct fovea_source_ops *sim(void)
{
    static const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_error error;
    if (ops == NULL && fv_source_find("sim:", &ops, &address, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    return ops;
}

static struct reel *reel_of(const char *address, uint64_t start)
{
    const struct fovea_source_selection selection = {.start = start, .step = 1};
    struct fovea_error error;
    struct reel *reel = reels;
    while (reel != NULL && (strcmp(reel->address, address) != 0 || reel->start != start))
        reel = reel->next;
    if (reel != NULL) return reel;
    reel = calloc(1, sizeof *reel);
    assert_non_null(reel);
    assert_true(strlen(address) < sizeof reel->address);
    snprintf(reel->address, sizeof reel->address, "%s", address);
    reel->start = start;
    if (sim()->open(address, &selection, &reel->camera, &error) != FOVEA_OK ||
        sim()->start(reel->camera, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    reel->next = reels;
    reels = reel;
    return reel;
}

static void keep_samples(struct reel *reel, const struct fovea_frame *frame)
{
    reel->samples = realloc(reel->samples,
                            (reel->sample_count + FOVEA_INPUT_SAMPLES_MAX) * sizeof *reel->samples);
    assert_non_null(reel->samples);
    const uint32_t count = sim()->samples(reel->camera, frame, reel->samples + reel->sample_count,
                                          FOVEA_INPUT_SAMPLES_MAX);
    assert_true(count < FOVEA_INPUT_SAMPLES_MAX);
    reel->sample_count += count;
}

static void keep_pixels(struct kept_frame *kept)
{
    size_t bytes = 0;
    for (uint32_t k = 0; k < kept->frame.image_count; k++)
        bytes += kept->frame.images[k].size_bytes;
    kept->pixels = malloc(bytes);
    assert_non_null(kept->pixels);
    bytes = 0;
    for (uint32_t k = 0; k < kept->frame.image_count; k++) {
        struct fovea_image *image = &kept->frame.images[k];
        memcpy(kept->pixels + bytes, image->data, image->size_bytes);
        image->data = kept->pixels + bytes;
        bytes += image->size_bytes;
    }
}

/* One more frame, if there is one. */
static enum fovea_status keep_frame(struct reel *reel)
{
    struct fovea_frame frame;
    const enum fovea_status status = sim()->dequeue(reel->camera, INT64_MAX, &frame);
    if (status != FOVEA_OK) return status;
    reel->frames = realloc(reel->frames, (reel->count + 1) * sizeof *reel->frames);
    assert_non_null(reel->frames);
    struct kept_frame *kept = &reel->frames[reel->count++];
    kept->frame = frame;
    keep_pixels(kept);
    keep_samples(reel, &frame);
    kept->samples_end = reel->sample_count;
    assert_int_equal(sim()->truth_pose(reel->camera, &frame, kept->T_world_cam), FOVEA_OK);
    sim()->requeue(reel->camera, &frame);
    return FOVEA_OK;
}

static enum fovea_status kept_open(const char *address,
                                   const struct fovea_source_selection *selection,
                                   struct fovea_source **source, struct fovea_error *error)
{
    (void)error;
    assert_true(selection->step == 1 && !selection->reverse);
    *source = calloc(1, sizeof **source);
    assert_non_null(*source);
    (*source)->reel = reel_of(address, selection->start);
    (*source)->frames = selection->frames;
    return FOVEA_OK;
}

static const struct fovea_source_info *kept_info(const struct fovea_source *source)
{
    return sim()->info(source->reel->camera);
}

static enum fovea_status kept_start(struct fovea_source *source, struct fovea_error *error)
{
    (void)source;
    (void)error;
    return FOVEA_OK;
}

static enum fovea_status kept_dequeue(struct fovea_source *source, int64_t deadline_ns,
                                      struct fovea_frame *frame)
{
    (void)deadline_ns;
    if (source->frames > 0 && source->taken == source->frames) return FOVEA_END;
    if (source->taken == source->reel->count) {
        const enum fovea_status status = keep_frame(source->reel);
        if (status != FOVEA_OK) return status;
    }
    *frame = source->reel->frames[source->taken++].frame;
    return FOVEA_OK;
}

static void kept_requeue(struct fovea_source *source, const struct fovea_frame *frame)
{
    (void)source;
    (void)frame;
}

static void kept_stop(struct fovea_source *source)
{
    (void)source;
}

static void kept_close(struct fovea_source *source)
{
    free(source);
}

static const struct kept_frame *kept_of(const struct fovea_source *source,
                                        const struct fovea_frame *frame)
{
    const uint64_t at = frame->index - source->reel->start;
    assert_true(at < source->taken);
    return &source->reel->frames[at];
}

static enum fovea_status kept_truth_pose(struct fovea_source *source,
                                         const struct fovea_frame *frame, double T_world_cam[12])
{
    memcpy(T_world_cam, kept_of(source, frame)->T_world_cam, 12 * sizeof *T_world_cam);
    return FOVEA_OK;
}

static uint32_t kept_samples(struct fovea_source *source, const struct fovea_frame *frame,
                             struct fovea_sample *samples, uint32_t count_max)
{
    const size_t left = kept_of(source, frame)->samples_end - source->samples_taken,
                 count = left < count_max ? left : count_max;
    if (count > 0)
        memcpy(samples, source->reel->samples + source->samples_taken, count * sizeof *samples);
    source->samples_taken += count;
    return (uint32_t)count;
}

const struct fovea_source_ops kept_sim = {
    .name = "sim",
    .help = "frames of sim that are kept",
    .open = kept_open,
    .info = kept_info,
    .start = kept_start,
    .dequeue = kept_dequeue,
    .requeue = kept_requeue,
    .stop = kept_stop,
    .close = kept_close,
    .truth_pose = kept_truth_pose,
    .samples = kept_samples,
};
