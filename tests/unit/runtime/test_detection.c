/* Detection within the runtime: the same boxes however the work is sliced, each with the stamp of
 * its image; limits; refusals; boxes in the rectified image. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "common/grey_frame.h"
#include "common/detector.h"
#include "fovea/fovea.h"
#include "image/rectify.h"
#include "nn/model.h"

#include "fovea_detections_t.h"
#include "fovea_objects_t.h"

enum { WIDTH = 320, HEIGHT = 240, FRAMES = 60 };

static struct fovea_config config;
static struct fovea_error error;
static uint8_t picture[WIDTH * HEIGHT];

static int setup(void **state)
{
    (void)state;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        picture[i] = (uint8_t)((i % WIDTH / 20 * 37 + i / WIDTH / 15 * 91) ^ (i * 7 & 15));
    fovea_config_default(&config);
    config.rig.cameras[0].camera = (struct fovea_camera){.width = WIDTH,
                                                         .height = HEIGHT,
                                                         .fx = 200,
                                                         .fy = 205,
                                                         .cx = 161,
                                                         .cy = 118,
                                                         .k = {-0.2, 0.04, 1e-3, -5e-4}};
    config.odometry.enabled = false;
    config.detect.model = detector_model(&config.detect.model_bytes);
    if (config.detect.model == NULL) return -1;
    return fovea_camera_prepare(&config.rig.cameras[0].camera, &error) == FOVEA_OK ? 0 : -1;
}

struct made {
    void *memory;
    struct fovea *rt;
};

static struct made make(void)
{
    struct made made = {0};
    size_t bytes = 0;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_OK);
    made.memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, bytes);
    assert_int_equal(fovea_init(made.memory, bytes, &config, &made.rt, &error), FOVEA_OK);
    return made;
}

/* One iteration with `units` units; the detections message, or NULL. */
static const struct fovea_message *iterate(struct fovea *rt, int i, uint32_t units)
{
    static struct fovea_outputs outputs;
    const struct fovea_frame frame =
        grey_frame(picture, WIDTH, HEIGHT, (i + 1) * 1000, (uint64_t)i + 100);
    struct fovea_inputs inputs = {.frame = &frame, .now_ns = frame.stamp_ns};
    fovea_grants_fixed(&config, &inputs.grants);
    fovea_step(rt, &inputs, &outputs);
    const bool waited = (outputs.jobs_waiting & 1u << FOVEA_JOB_DETECT) != 0;
    inputs.grants.units[FOVEA_JOB_DETECT] = units;
    fovea_work(rt, &inputs.grants, &outputs);
    assert_true(outputs.units_done[FOVEA_JOB_DETECT] <= units);
    assert_true(waited == (outputs.units_done[FOVEA_JOB_DETECT] > 0) || units == 0);
    for (uint32_t m = 0; m < outputs.message_count; m++)
        if (strcmp(outputs.messages[m].channel, "FOVEA_DETECTIONS") == 0)
            return &outputs.messages[m];
    return NULL;
}

static void slices_give_the_same_with_the_stamp_of_the_image(void **state)
{
    (void)state;
    struct made whole = make(), sliced = make();
    struct fovea_detections all, some;
    fovea_detections_get(whole.rt, &all);
    assert_int_equal(all.inferences, 0);
    assert_non_null(iterate(whole.rt, 0, 100000));
    fovea_detections_get(whole.rt, &all);
    assert_int_equal(all.inferences, 1);
    assert_in_range(all.count, 1, 100);
    int looked_at = 0, inferences = 0;
    for (int i = 0; i < FRAMES; i++) {
        const struct fovea_message *message = iterate(sliced.rt, i, 2);
        if (message == NULL) continue;
        fovea_detections_t decoded;
        assert_int_equal(fovea_detections_t_decode(message->data, 0, (int)message->bytes, &decoded),
                         message->bytes);
        fovea_detections_get(sliced.rt, &some);
        assert_int_equal(some.inferences, ++inferences);
        assert_int_equal(some.sequence, 100 + looked_at);
        assert_int_equal(decoded.stamp.time_ns, (looked_at + 1) * 1000);
        assert_true(i > looked_at + 2); /* over several frames */
        assert_int_equal(some.count, all.count);
        assert_memory_equal(some.list, all.list, all.count * sizeof *all.list);
        assert_int_equal(decoded.count, all.count);
        for (uint32_t d = 0; d < all.count; d++) {
            const fovea_detection_t *one = &decoded.detections[d];
            assert_true(one->score == all.list[d].score &&
                        one->box.x_max_px == all.list[d].x_max_px);
            assert_string_equal(one->class_name, fovea_detect_label(sliced.rt, one->class_id));
        }
        fovea_detections_t_decode_cleanup(&decoded);
        looked_at = i + 1;
    }
    assert_true(inferences > 2);
    free(whole.memory);
    free(sliced.memory);
}

/* Objects come with each inference, carry the stamp of its image, and are what fovea_objects_get
 * gives.
 */
static void objects_follow_the_inferences(void **state)
{
    (void)state;
    config.objects.score_high = config.objects.score_new = config.objects.score_confirm = 0.3;
    struct made made = make();
    struct fovea_objects objects;
    uint32_t confirmed = 0;
    for (int i = 0; i < 5; i++) {
        static struct fovea_outputs outputs;
        const struct fovea_frame frame =
            grey_frame(picture, WIDTH, HEIGHT, (i + 1) * 33333333, (uint64_t)i + 100);
        struct fovea_inputs inputs = {.frame = &frame, .now_ns = frame.stamp_ns};
        fovea_grants_fixed(&config, &inputs.grants);
        fovea_step(made.rt, &inputs, &outputs);
        inputs.grants.units[FOVEA_JOB_DETECT] = 100000;
        fovea_work(made.rt, &inputs.grants, &outputs);
        const struct fovea_message *message = NULL;
        for (uint32_t m = 0; m < outputs.message_count; m++)
            if (strcmp(outputs.messages[m].channel, "FOVEA_OBJECTS") == 0)
                message = &outputs.messages[m];
        assert_non_null(message);
        fovea_objects_t out;
        assert_int_equal(fovea_objects_t_decode(message->data, 0, (int)message->bytes, &out),
                         message->bytes);
        fovea_objects_get(made.rt, &objects);
        assert_int_equal(objects.updates, i + 1);
        assert_int_equal(objects.sequence, 100 + i);
        assert_int_equal(out.stamp.time_ns, frame.stamp_ns);
        assert_int_equal(out.count, objects.count);
        assert_true(out.count > 0);
        confirmed = 0;
        for (uint32_t t = 0; t < objects.count; t++) {
            const struct fovea_object *held = &objects.list[t];
            const fovea_object_t *object = &out.objects[t];
            assert_true(object->id == (int64_t)held->id && object->state == held->state &&
                        object->box.x_max_px == held->x_max_px);
            assert_true(object->age_ns == objects.stamp_ns - held->first_ns &&
                        object->unseen_ns == objects.stamp_ns - held->seen_ns);
            confirmed += held->state == FOVEA_OBJECT_CONFIRMED;
        }
        fovea_objects_t_decode_cleanup(&out);
    }
    assert_true(confirmed > 0); /* nothing moves: what is found again and again is believed */
    config.objects.score_high = config.objects.score_new = config.objects.score_confirm = 0.5;
    free(made.memory);
}

static void limits_hold(void **state)
{
    (void)state;
    struct fovea_detections all, fewer;
    struct made made = make(), limited;
    iterate(made.rt, 0, 100000);
    fovea_detections_get(made.rt, &all);
    assert_true(all.count > 2);
    config.detect.count_max = 2;
    limited = make();
    iterate(limited.rt, 0, 100000);
    fovea_detections_get(limited.rt, &fewer);
    assert_int_equal(fewer.count, 2);
    assert_memory_equal(fewer.list, all.list, 2 * sizeof *all.list);
    free(limited.memory);
    config.detect.count_max = 100;
    config.detect.score_threshold = (double)all.list[1].score;
    limited = make();
    iterate(limited.rt, 0, 100000);
    fovea_detections_get(limited.rt, &fewer);
    assert_true(fewer.count >= 2 && fewer.list[fewer.count - 1].score >= all.list[1].score);
    assert_true(fewer.count == all.count || all.list[fewer.count].score < all.list[1].score);
    free(limited.memory);
    config.detect.score_threshold = 0;
    free(made.memory);
}

/* Every point of the raw box's border must lie in the rectified box, and each of its sides be
 * touched. */
static void rectified_boxes_hold_the_raw_ones(void **state)
{
    (void)state;
    struct made made = make();
    struct fv_rectified rectified;
    fovea_detections_t out;
    const struct fovea_message *message = iterate(made.rt, 0, 100000);
    assert_int_equal(fovea_detections_t_decode(message->data, 0, (int)message->bytes, &out),
                     message->bytes);
    assert_int_equal(fv_rectified_choose(&config.rig.cameras[0].camera, FV_RECTIFIED_PINHOLE,
                                         FV_RECTIFIED_CROP, WIDTH, HEIGHT, &rectified, &error),
                     FOVEA_OK);
    assert_int_equal(out.rectified_shape, FV_RECTIFIED_PINHOLE);
    assert_true(out.rectified_fx == rectified.fx && out.rectified_cy == rectified.cy);
    for (int d = 0; d < out.count; d++) {
        const fovea_box_t *box = &out.detections[d].box, *around = &out.detections[d].rectified_box;
        double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
        for (int i = 0; i < 4 * 2; i++) { /* corners and middles of the sides, by the way back */
            const double fraction[8][2] = {{0, 0}, {.5, 0}, {1, 0}, {1, .5},
                                           {1, 1}, {.5, 1}, {0, 1}, {0, .5}};
            const double x =
                (double)box->x_min_px + fraction[i][0] * (double)(box->x_max_px - box->x_min_px);
            const double y =
                (double)box->y_min_px + fraction[i][1] * (double)(box->y_max_px - box->y_min_px);
            double at[2], raw[2];
            assert_true(fv_rectified_from_raw(&rectified, &config.rig.cameras[0].camera, x, y, at));
            assert_true(
                fv_rectified_to_raw(&rectified, &config.rig.cameras[0].camera, at[0], at[1], raw));
            assert_true(__builtin_fabs(raw[0] - x) < 1e-6 && __builtin_fabs(raw[1] - y) < 1e-6);
            for (int k = 0; k < 2; k++) {
                low[k] = at[k] < low[k] ? at[k] : low[k];
                high[k] = at[k] > high[k] ? at[k] : high[k];
            }
        }
        assert_true(__builtin_fabs((double)around->x_min_px - low[0]) < 1e-3);
        assert_true(__builtin_fabs((double)around->y_min_px - low[1]) < 1e-3);
        assert_true(__builtin_fabs((double)around->x_max_px - high[0]) < 1e-3);
        assert_true(__builtin_fabs((double)around->y_max_px - high[1]) < 1e-3);
    }
    fovea_detections_t_decode_cleanup(&out);
    free(made.memory);
}

static void a_reset_forgets_the_look_under_way(void **state)
{
    (void)state;
    struct made made = make();
    struct fovea_outputs outputs;
    iterate(made.rt, 0, 3);
    const struct fovea_inputs reset = {.frame = NULL, .commands = FOVEA_COMMAND_RESET};
    fovea_step(made.rt, &reset, &outputs);
    assert_int_equal(outputs.jobs_waiting & 1u << FOVEA_JOB_DETECT, 0);
    struct fovea_detections found;
    assert_non_null(iterate(made.rt, 7, 100000));
    fovea_detections_get(made.rt, &found);
    assert_int_equal(found.sequence, 107);
    assert_int_equal(found.inferences, 1);
    free(made.memory);
}

static void wrong_models_are_refused(void **state)
{
    (void)state;
    const struct fovea_config good = config;
    size_t bytes;
    uint8_t *copy = aligned_alloc(64, (config.detect.model_bytes + 63) / 64 * 64);
    memcpy(copy, config.detect.model, config.detect.model_bytes);
    config.detect.model = copy;
    copy[config.detect.model_bytes / 2] ^= 1;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "detect.model: byte 12"));
    copy[config.detect.model_bytes / 2] ^= 1;
    struct fv_model_header *header = (struct fv_model_header *)(void *)copy;
    header->preprocess.channels = 2;
    header->checksum = fv_model_checksum(copy + 16, config.detect.model_bytes - 16);
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_string_equal(error.text,
                        "detect.model: found 1 inputs, expected one: an image of 1 or 3 channels");
    config = good;
    config.detect.score_threshold = 1.5;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_string_equal(error.text, "detect.score_threshold: found 1.5, expected 0 to 1");
    config = good;
    free(copy);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(slices_give_the_same_with_the_stamp_of_the_image),
        cmocka_unit_test(objects_follow_the_inferences),
        cmocka_unit_test(limits_hold),
        cmocka_unit_test(rectified_boxes_hold_the_raw_ones),
        cmocka_unit_test(a_reset_forgets_the_look_under_way),
        cmocka_unit_test(wrong_models_are_refused),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
