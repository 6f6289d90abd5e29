/* The network that comes with Fovea and labels pixels, on rendered frames of seeds that training
 * never saw: how much of each class it finds, and the same mask on every kernel set. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "app/config/model_file.h"
#include "detect/decode.h"
#include "detect/job.h"
#include "drivers/table.h"
#include "fovea/source.h"

enum { ARENA_BYTES = 8 << 20, FRAMES = 4, CLASSES = 5, PIXELS = 640 * 480, UNITS_MAX = 100000 };

static const char *const names[CLASSES] = {"floor", "wall", "obstacle", "movable", "other"};
static const char *const worlds[] = {"sim:orbit?seed=7000001&objects=12",
                                     "sim:wander?seed=7000002&objects=24",
                                     "sim:drive?seed=7000003"};
/* Of the classes of pixels of the simulated camera. */
static const uint8_t class_of[FOVEA_TRUTH_CLASS_COUNT] = {4, 3, 3, 3, 3, 0, 1, 2, 2};

/* 0.963 and 0.858 when it was trained. */
static const double floor_min = 0.9, mean_min = 0.78;

static struct fv_model_file file;
static struct fv_detect_memory memory;
static void *block;
static uint8_t seen[PIXELS];
static int64_t both[CLASSES], either[CLASSES];

static int set_up(void **state)
{
    (void)state;
    struct fovea_error error;
    struct fv_arena arena;
    if (fv_model_file_read("src/detect/segmenter.fvm", &file, &error) != FOVEA_OK) return -1;
    block = aligned_alloc(64, ARENA_BYTES);
    if (block == NULL) return -1;
    memset(block, 0, ARENA_BYTES);
    fv_arena_init(&arena, block, ARENA_BYTES);
    fv_detect_carve(&memory, &arena, &file.model, NULL, PIXELS);
    return arena.exhausted ? -1 : 0;
}

static int tear_down(void **state)
{
    (void)state;
    free(block);
    fv_model_file_free(&file);
    return 0;
}

static void look(const struct fv_kernels *kernels, const struct fovea_frame *frame,
                 struct fovea_segmentation *segmentation)
{
    uint32_t done;
    assert_int_equal(fv_detect_start(&memory, &frame->images[0], frame->stamp_ns, frame->sequence),
                     FOVEA_OK);
    assert_int_equal(fv_detect_advance(&memory, kernels, UNITS_MAX, &done), FOVEA_OK);
    fv_detect_segmentation(&memory, segmentation);
}

/* At the size of the frame. */
static void enlarge(const struct fovea_segmentation *segmentation)
{
    uint8_t classes[256];
    memset(classes, CLASSES, sizeof classes);
    for (uint32_t i = 0; i < segmentation->count; i++)
        classes[i] = (uint8_t)segmentation->list[i].class_id;
    fovea_segmentation_enlarge(segmentation, classes, seen);
}

static void count(const struct fovea_truth *truth)
{
    for (int i = 0; i < PIXELS; i++) {
        const uint8_t there = class_of[truth->class_mask[i]];
        either[there]++;
        if (seen[i] == there)
            both[there]++;
        else if (seen[i] < CLASSES)
            either[seen[i]]++;
    }
}

/* Frames of a world, each with what `use` makes of it. */
static void for_frames(const char *uri,
                       void (*use)(const struct fovea_frame *, struct fovea_truth *))
{
    struct fovea_error error;
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    const char *address;
    struct fovea_frame frame;
    struct fovea_truth truth;
    const struct fovea_source_selection selection = {.step = 60, .frames = FRAMES};
    assert_int_equal(fv_source_find(uri, &ops, &address, &error), FOVEA_OK);
    assert_int_equal(ops->open(address, &selection, &source, &error), FOVEA_OK);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    for (int i = 0; i < FRAMES; i++) {
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(ops->truth(source, &frame, &truth), FOVEA_OK);
        use(&frame, &truth);
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
}

static void judge(const struct fovea_frame *frame, struct fovea_truth *truth)
{
    struct fovea_error error;
    struct fv_kernels kernels;
    struct fovea_segmentation segmentation;
    enum fv_cpu_set set;
    assert_int_equal(fv_cpu_from_environment(&set, &error), FOVEA_OK);
    fv_kernels_init(&kernels, set);
    look(&kernels, frame, &segmentation);
    enlarge(&segmentation);
    count(truth);
}

static void finds_floor_walls_and_what_stands_and_moves(void **state)
{
    (void)state;
    double sum = 0.0;
    assert_string_equal(fv_model_name(&file.model), "segmenter"); /* in its messages */
    for (int c = 0; c < CLASSES; c++)
        assert_string_equal(fv_detect_label(&file.model, c), names[c]);
    for (size_t w = 0; w < sizeof worlds / sizeof *worlds; w++)
        for_frames(worlds[w], judge);
    for (int c = 0; c < CLASSES; c++) {
        const double iou = (double)both[c] / (double)either[c];
        print_message("%s: %.3f\n", names[c], iou);
        sum += iou;
    }
    assert_true((double)both[0] >= floor_min * (double)either[0]);
    assert_true(sum >= mean_min * CLASSES);
}

/* Of this processor's kernel sets. */
static void compare(const struct fovea_frame *frame, struct fovea_truth *truth)
{
    static uint8_t mask[PIXELS], confidence[PIXELS];
    (void)truth;
    int compared = 0;
    for (int set = FV_CPU_C; set < FV_CPU_SET_COUNT; set++) {
        struct fovea_error error;
        struct fv_kernels kernels;
        struct fovea_segmentation segmentation;
        enum fv_cpu_set known;
        if (fv_cpu_parse(fv_cpu_set_name((enum fv_cpu_set)set), &known, &error) != FOVEA_OK)
            continue;
        fv_kernels_init(&kernels, known);
        look(&kernels, frame, &segmentation);
        const size_t pixels = (size_t)segmentation.width * (size_t)segmentation.height;
        assert_non_null(segmentation.confidence);
        if (compared++ > 0) {
            assert_memory_equal(segmentation.pixels, mask, pixels);
            assert_memory_equal(segmentation.confidence, confidence, pixels);
        }
        memcpy(mask, segmentation.pixels, pixels);
        memcpy(confidence, segmentation.confidence, pixels);
    }
    assert_true(compared >= 1);
}

static void kernel_sets_agree(void **state)
{
    (void)state;
    for_frames(worlds[0], compare);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_floor_walls_and_what_stands_and_moves),
        cmocka_unit_test(kernel_sets_agree),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
