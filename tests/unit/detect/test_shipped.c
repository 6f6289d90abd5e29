/* The detector that comes with Fovea, on rendered frames with their truth. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "app/config/model_file.h"
#include "detect/job.h"
#include "drivers/table.h"
#include "fovea/source.h"

enum { ARENA_BYTES = 8 << 20, FRAMES = 12, UNITS_MAX = 100000 };

static const char model_path[] = "src/detect/shipped.fvm";

static float overlap(const struct fovea_detection *d, const struct fovea_truth_box *b)
{
    /* Detections count from the centre of the first pixel, truth from its corner. */
    const float x0 = d->x_min_px + 0.5f, y0 = d->y_min_px + 0.5f, x1 = d->x_max_px + 0.5f,
                y1 = d->y_max_px + 0.5f;
    const float w = (x1 < b->x_max_px ? x1 : b->x_max_px) - (x0 > b->x_min_px ? x0 : b->x_min_px);
    const float h = (y1 < b->y_max_px ? y1 : b->y_max_px) - (y0 > b->y_min_px ? y0 : b->y_min_px);
    if (w <= 0.0f || h <= 0.0f) return 0.0f;
    return w * h /
           ((x1 - x0) * (y1 - y0) + (b->x_max_px - b->x_min_px) * (b->y_max_px - b->y_min_px) -
            w * h);
}

struct score {
    int objects, recalled, found, right;
};

static void judge(const struct fv_detect_job *job, const struct fovea_truth *truth,
                  struct score *score)
{
    for (uint32_t k = 0; k < truth->box_count; k++) {
        const struct fovea_truth_box *b = &truth->boxes[k];
        const float w = b->x_max_px - b->x_min_px, h = b->y_max_px - b->y_min_px;
        if (b->visible_fraction < 0.5f || (w < 24.0f && h < 24.0f)) continue;
        score->objects++;
        for (int32_t i = 0; i < job->count; i++)
            if (job->found[i].class_id == (int32_t)b->object_class - 1 &&
                overlap(&job->found[i], b) >= 0.5f) {
                score->recalled++;
                break;
            }
    }
    for (int32_t i = 0; i < job->count; i++) {
        int right = 0;
        for (uint32_t k = 0; k < truth->box_count; k++)
            right |= job->found[i].class_id == (int32_t)truth->boxes[k].object_class - 1 &&
                     overlap(&job->found[i], &truth->boxes[k]) >= 0.5f;
        score->found++;
        score->right += right;
    }
}

static void look(const struct fv_detect_memory *memory, const struct fv_kernels *kernels,
                 const struct fovea_frame *frame)
{
    uint32_t done;
    assert_int_equal(fv_detect_start(memory, &frame->images[0], frame->stamp_ns, frame->sequence),
                     FOVEA_OK);
    assert_int_equal(fv_detect_advance(memory, kernels, UNITS_MAX, &done), FOVEA_OK);
}

/* A seed and a place that training never saw: most of what shows well is found, and most of what is
 * found is there. */
static void finds_rendered_objects(void **state)
{
    (void)state;
    struct fovea_error error;
    struct fv_model_file file;
    struct fv_kernels kernels;
    struct fv_arena arena;
    struct fv_detect_memory memory = {0};
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    const char *address;
    const struct fovea_source_selection selection = {.step = 60, .frames = FRAMES};
    assert_int_equal(fv_model_file_read(model_path, &file, &error), FOVEA_OK);
    assert_string_equal(fv_model_name(&file.model), "detector"); /* in its messages */
    enum fv_cpu_set set;
    assert_int_equal(fv_cpu_from_environment(&set, &error), FOVEA_OK);
    fv_kernels_init(&kernels, set);
    void *block = aligned_alloc(64, ARENA_BYTES);
    assert_non_null(block);
    memset(block, 0, ARENA_BYTES);
    fv_arena_init(&arena, block, ARENA_BYTES);
    fv_detect_carve(&memory, &arena, &file.model, NULL, 640 * 480);
    assert_int_equal(fv_source_find("sim:orbit?seed=7000001&objects=24", &ops, &address, &error),
                     FOVEA_OK);
    assert_int_equal(ops->open(address, &selection, &source, &error), FOVEA_OK);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    struct score score = {0, 0, 0, 0};
    struct fovea_frame frame;
    struct fovea_truth truth;
    for (int i = 0; i < FRAMES; i++) {
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(ops->truth(source, &frame, &truth), FOVEA_OK);
        look(&memory, &kernels, &frame);
        judge(memory.job, &truth, &score);
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
    free(block);
    fv_model_file_free(&file);
    print_message("objects %d, recalled %d; found %d, right %d\n", score.objects, score.recalled,
                  score.found, score.right);
    assert_true(score.objects >= 5 * FRAMES);
    assert_true(score.recalled * 10 >= score.objects * 8);
    assert_true(score.right * 10 >= score.found * 8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(finds_rendered_objects)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
