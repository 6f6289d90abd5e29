/* Two networks at once: each finds what it finds alone, and neither takes the other's part of the
 * grant. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/grey_frame.h"
#include "fovea/fovea.h"

enum { WIDTH = 320, HEIGHT = 240, FRAMES = 100, FEW = 10, MODEL_MAX = 1 << 22, PLENTY = 100000 };

struct model {
    const char *path;
    void *data;
    size_t bytes;
};

static struct model small = {.path = "tests/golden/detector.fvm"},
                    shipped = {.path = "src/detect/shipped.fvm"};
static struct fovea_error error;

/* What a network found in one frame. */
struct inference {
    uint32_t count;
    struct fovea_detection list[FOVEA_DETECTIONS_MAX];
};
static struct inference alone[2][FRAMES]; /* of `small` and `shipped` */

struct made {
    struct fovea_config config;
    void *memory;
    size_t bytes;
    struct fovea *rt;
    struct fovea_outputs outputs;
};

static void configure(struct fovea_config *config, const struct model *first,
                      const struct model *second)
{
    fovea_config_default(config);
    config->rig.cameras[0].camera = (struct fovea_camera){
        .width = WIDTH, .height = HEIGHT, .fx = 200, .fy = 205, .cx = 161, .cy = 118};
    config->odometry.enabled = false;
    assert_int_equal(fovea_camera_prepare(&config->rig.cameras[0].camera, &error), FOVEA_OK);
    config->detect.model = first->data;
    config->detect.model_bytes = first->bytes;
    if (second == NULL) return;
    config->detect2.model = second->data;
    config->detect2.model_bytes = second->bytes;
}

static void make(struct made *made, const struct model *first, const struct model *second)
{
    configure(&made->config, first, second);
    if (fovea_size(&made->config, &made->bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
    made->memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, made->bytes);
    assert_int_equal(fovea_init(made->memory, made->bytes, &made->config, &made->rt, &error),
                     FOVEA_OK);
}

/* Step and work on frame `i` with `units` units for the networks. */
static void iterate(struct made *made, struct fovea *rt, int i, uint32_t units)
{
    static uint8_t picture[WIDTH * HEIGHT];
    for (int k = 0; k < WIDTH * HEIGHT; k++)
        picture[k] =
            (uint8_t)(((k % WIDTH + 3 * i) / 20 * 37 + k / WIDTH / 15 * 91) ^ (k * 7 & 15));
    const struct fovea_frame frame =
        grey_frame(picture, WIDTH, HEIGHT, (i + 1) * 1000, (uint64_t)i);
    struct fovea_inputs inputs = {.frame = &frame, .now_ns = frame.stamp_ns};
    fovea_grants_fixed(&made->config, &inputs.grants);
    fovea_step(rt, &inputs, &made->outputs);
    inputs.grants.units[FOVEA_JOB_DETECT] = units;
    fovea_work(rt, &inputs.grants, &made->outputs);
    assert_true(made->outputs.units_done[FOVEA_JOB_DETECT] <= units);
}

static int setup(void **state)
{
    (void)state;
    struct model *const models[] = {&small, &shipped};
    for (int m = 0; m < 2; m++) {
        FILE *file = fopen(models[m]->path, "rb");
        if (file == NULL) return -1;
        models[m]->data = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, MODEL_MAX);
        models[m]->bytes = fread(models[m]->data, 1, MODEL_MAX, file);
        fclose(file);
        struct made made;
        make(&made, models[m], NULL);
        for (int i = 0; i < FRAMES; i++) {
            struct fovea_detections found;
            iterate(&made, made.rt, i, PLENTY);
            fovea_detections_get(made.rt, &found);
            assert_int_equal(found.sequence, i);
            alone[m][i].count = found.count;
            memcpy(alone[m][i].list, found.list, found.count * sizeof *found.list);
        }
        free(made.memory);
    }
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    free(small.data);
    free(shipped.data);
    return 0;
}

/* The last inference is that of the network alone on the same frame. */
static void assert_as_alone(const struct fovea_detections *found,
                            const struct inference inferences[FRAMES])
{
    const struct inference *inference = &inferences[found->sequence];
    assert_int_equal(found->count, inference->count);
    assert_memory_equal(found->list, inference->list, inference->count * sizeof *inference->list);
}

/* Messages of a channel among the outputs of the last work. */
static int messages(const struct made *made, const char *channel)
{
    int count = 0;
    for (uint32_t m = 0; m < made->outputs.message_count; m++)
        count += strcmp(made->outputs.messages[m].channel, channel) == 0;
    return count;
}

static void with_a_large_grant_both_look_at_every_frame(void **state)
{
    (void)state;
    struct made made;
    uint32_t objects[2] = {0};
    make(&made, &small, &shipped);
    for (int i = 0; i < FRAMES / 8; i++) {
        struct fovea_detections first, second;
        iterate(&made, made.rt, i, PLENTY);
        fovea_detections_get(made.rt, &first);
        fovea_detections2_get(made.rt, &second);
        assert_int_equal(first.sequence, i);
        assert_int_equal(second.sequence, i);
        assert_as_alone(&first, alone[0]);
        assert_as_alone(&second, alone[1]);
        assert_int_equal(messages(&made, "FOVEA_DETECTIONS"), 1);
        assert_int_equal(messages(&made, "FOVEA_DETECTIONS2"), 1);
        assert_int_equal(messages(&made, "FOVEA_OBJECTS"), 1); /* of the first alone */
        objects[0] += first.count;
        objects[1] += second.count;
    }
    assert_true(objects[0] > 0);
    assert_int_not_equal(objects[0], objects[1]); /* they are two networks */
    free(made.memory);
}

/* Less than either network needs for an inference. */
static void a_small_grant_is_shared_and_changes_no_box(void **state)
{
    (void)state;
    struct made made;
    uint64_t inferences[2] = {0}, longest[2] = {0}, since[2] = {0};
    make(&made, &small, &shipped);
    for (int i = 0; i < FRAMES; i++) {
        struct fovea_detections found[2];
        int complete = 0;
        iterate(&made, made.rt, i, FEW);
        fovea_detections_get(made.rt, &found[0]);
        fovea_detections2_get(made.rt, &found[1]);
        for (int m = 0; m < 2; m++) {
            since[m]++;
            if (found[m].inferences == inferences[m]) continue;
            assert_int_equal(found[m].inferences, ++inferences[m]);
            assert_as_alone(&found[m], alone[m]);
            longest[m] = since[m] > longest[m] ? since[m] : longest[m];
            since[m] = 0;
            complete++;
        }
        /* what one leaves, the other takes: units are left over when both are complete */
        assert_true(made.outputs.units_done[FOVEA_JOB_DETECT] == FEW || complete == 2);
    }
    for (int m = 0; m < 2; m++)
        assert_true(inferences[m] >= 2 && longest[m] <= FRAMES / 2);
    free(made.memory);
}

static void a_copy_goes_on_with_both(void **state)
{
    (void)state;
    struct made made;
    struct fovea *copy;
    make(&made, &small, &shipped);
    for (int i = 0; i < 5; i++)
        iterate(&made, made.rt, i, FEW);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, made.bytes);
    assert_int_equal(fovea_copy(made.rt, memory, made.bytes, &copy), FOVEA_OK);
    for (int i = 5; i < FRAMES; i++)
        iterate(&made, made.rt, i, FEW);
    const uint64_t hash = fovea_state_hash(made.rt);
    memset(made.memory, 0xa5, made.bytes);
    for (int i = 5; i < FRAMES; i++)
        iterate(&made, copy, i, FEW);
    assert_true(fovea_state_hash(copy) == hash);
    struct fovea_detections second;
    fovea_detections2_get(copy, &second);
    assert_true(second.inferences > 0);
    assert_string_not_equal(fovea_detect_label(copy, 0), fovea_detect2_label(copy, 0));
    free(memory);
    free(made.memory);
}

static void a_wrong_second_network_is_refused_by_its_key(void **state)
{
    (void)state;
    struct fovea_config config;
    size_t bytes;
    const struct model none = {.data = NULL};
    configure(&config, &none, &shipped);
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_string_equal(error.text,
                        "detect2.model: found a network, expected detect.model to be set too");
    configure(&config, &small, &shipped);
    config.detect2.model_bytes -= 64;
    assert_true(fovea_size(&config, &bytes, &error) < 0);
    assert_int_equal(strncmp(error.text, "detect2.model: ", 15), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(with_a_large_grant_both_look_at_every_frame),
        cmocka_unit_test(a_small_grant_is_shared_and_changes_no_box),
        cmocka_unit_test(a_copy_goes_on_with_both),
        cmocka_unit_test(a_wrong_second_network_is_refused_by_its_key),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
