/* Heads with keypoints, turned boxes and YOLOX against objects computed elsewhere
 * (tests/import/make_points.py): the same objects in the same order, to 0.01 pixels, in one unit as
 * in many; and no more keypoints than there is room for. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "detect/decode.h"

enum { WIDTH = 96, HEIGHT = 64, BYTES_MAX = 1 << 15, OUTPUTS_MAX = 2, ANCHORS = 896 };

/* A file's head with a table of anchors behind it. */
static struct {
    struct fv_model_header header;
    float anchors[ANCHORS][4];
} file;
static struct fv_model_tensor tensors[1 + OUTPUTS_MAX];
static const int32_t inputs[1] = {0}, outputs[OUTPUTS_MAX] = {1, 2};
static const struct fv_model model = {.base = (const uint8_t *)&file,
                                      .header = &file.header,
                                      .tensors = tensors,
                                      .inputs = inputs,
                                      .outputs = outputs};
static _Alignas(64) uint8_t arena[BYTES_MAX];
static struct fv_detect_scratch scratch;
static struct fovea_detection found[FOVEA_DETECTIONS_MAX];
static struct fovea_keypoint points[FOVEA_KEYPOINTS_MAX + 1];
static char line[2 * BYTES_MAX + 16];
static int32_t used; /* bytes of the arena */

static int32_t kind_of(const char *name)
{
    for (file.header.decode.kind = 0; file.header.decode.kind < FV_DECODER_COUNT;
         file.header.decode.kind++)
        if (strcmp(name, fv_detect_decoder_name(&model)) == 0) return file.header.decode.kind;
    fail_msg("no decoder %s", name);
    return 0;
}

/* Those of the face detector for 128 x 128 pixels. */
static void make_anchors(void)
{
    int at = 0;
    for (int level = 0; level < 2; level++) {
        const int cells = level == 0 ? 16 : 8, per_cell = level == 0 ? 2 : 6;
        for (int i = 0; i < cells * cells * per_cell; i++, at++) {
            const int cell = i / per_cell;
            const float anchor[4] = {((float)(cell / cells) + 0.5f) / (float)cells,
                                     ((float)(cell % cells) + 0.5f) / (float)cells, 1, 1};
            memcpy(file.anchors[at], anchor, sizeof anchor);
        }
    }
    assert_int_equal(at, ANCHORS);
}

static void read_head(void)
{
    char *at = line + 5, *name = strsep(&at, " ");
    memset(&file.header, 0, sizeof file.header);
    const int32_t kind = kind_of(name), side = (int32_t)strtol(at, &at, 10);
    file.header.input_count = 1;
    file.header.file_bytes = sizeof file;
    file.header.preprocess = (struct fv_model_preprocess){
        .fit = (int32_t)strtol(at, &at, 10), .width = side, .height = side, .channels = 3};
    struct fv_model_decode *d = &file.header.decode;
    *d = (struct fv_model_decode){.kind = kind,
                                  .iou_threshold = 0.5f,
                                  .max_detections = 300,
                                  .anchor_data = sizeof file.header};
    int32_t *const words[] = {&d->classes,     &d->point_count, &d->point_values,
                              &d->point_score, &d->logits,      &d->normalised};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        *words[i] = (int32_t)strtol(at, &at, 10);
    d->score_threshold = strtof(at, &at);
    tensors[0] = (struct fv_model_tensor){.rank = 4, .dims = {1, side, side, 3}};
    used = 0;
}

static void read_output(FILE *in)
{
    const uint32_t number = 1 + file.header.output_count++;
    struct fv_model_tensor *t = &tensors[number];
    char *at = line + 4;
    *t = (struct fv_model_tensor){.storage = (int32_t)number, .offset = used};
    t->rank = (int32_t)strtol(at, &at, 10);
    for (int32_t i = 0; i < t->rank; i++)
        t->dims[i] = (int32_t)strtol(at, &at, 10);
    t->scale = strtof(at, &at);
    t->zero = (int32_t)strtol(at, &at, 10);
    assert_non_null(fgets(line, sizeof line, in));
    const size_t count = strspn(line, "0123456789abcdef") / 2;
    for (size_t i = 0; i < count; i++) {
        const char hex[3] = {line[2 * i], line[2 * i + 1], 0};
        arena[used++] = (uint8_t)strtoul(hex, NULL, 16);
    }
    used = (used + 63) / 64 * 64;
    assert_in_range(used, 1, BYTES_MAX);
}

static int32_t decode(void)
{
    const uint8_t pixel = 0;
    const struct fovea_image image = {.data = &pixel,
                                      .width = WIDTH,
                                      .height = HEIGHT,
                                      .stride_bytes = WIDTH,
                                      .format = FOVEA_PIXEL_GREY8};
    struct fv_nn_input_fit fit;
    assert_int_equal(fv_nn_input_fit_of(&model, &image, &fit), FOVEA_OK);
    const struct fv_detect_room room = {.points = points};
    return fv_detect_decode(&model, arena, &fit, &scratch, &room, found, FOVEA_DETECTIONS_MAX);
}

static void near_to(double value, double expected, double allowed)
{
    if (!(fabs(value - expected) <= allowed))
        fail_msg("found %.9g, expected %.9g", value, expected);
}

/* One line of the file; `at`: the set that comes next, `point`: the keypoint. */
static void compare(int32_t count, int32_t *at, int32_t *point)
{
    double v[7];
    if (sscanf(line, "set %lf %lf %lf %lf %lf %lf %lf", v, v + 1, v + 2, v + 3, v + 4, v + 5,
               v + 6) == 7) {
        if (*at >= count) fail_msg("%d objects found", count);
        const struct fovea_detection *d = &found[(*at)++];
        assert_int_equal(d->class_id, (int)v[0]);
        near_to((double)d->score, v[1], 1e-5);
        near_to((double)d->x_min_px, v[2], 0.01);
        near_to((double)d->y_min_px, v[3], 0.01);
        near_to((double)d->x_max_px, v[4], 0.01);
        near_to((double)d->y_max_px, v[5], 0.01);
        near_to((double)d->angle, v[6], 1e-4);
    } else if (sscanf(line, "point %lf %lf %lf", v, v + 1, v + 2) == 3) {
        const struct fovea_keypoint *p = &points[(*point)++];
        near_to((double)p->x_px, v[0], 0.01);
        near_to((double)p->y_px, v[1], 0.01);
        assert_int_equal(isnan(p->score), isnan(v[2]));
        if (!isnan(v[2])) near_to((double)p->score, v[2], 1e-5);
    } else {
        assert_string_equal(line, "end\n");
        assert_int_equal(*at, count);
    }
}

static void heads_give_the_keypoints_that_they_stand_for(void **state)
{
    (void)state;
    FILE *in = fopen("tests/golden/points.txt", "r");
    assert_non_null(in);
    int32_t count = -1, at = 0, point = 0, objects = 0, keypoints = 0, cases = 0;
    make_anchors();
    while (fgets(line, sizeof line, in) != NULL) {
        if (strncmp(line, "head ", 5) == 0) {

            read_head();
            cases++;
            count = -1;
        } else if (strncmp(line, "out ", 4) == 0) {
            read_output(in);
        } else {
            if (count < 0) {
                count = decode();
                at = point = 0;
                objects += count;
                keypoints += fv_detect_point_count(&model) > 0;
            }
            compare(count, &at, &point);
        }
    }
    fclose(in);
    assert_int_equal(cases, 7);
    assert_int_equal(keypoints, 4);
    assert_true(objects > 100);
}

/* 200 people of 17 keypoints: those of the best 100 are read, in their order. */
static void keypoints_of_the_first_hundred_are_given(void **state)
{
    (void)state;
    enum { SETS = 200, EACH = 17, ROW = 6 + 3 * EACH };
    memset(&file.header, 0, sizeof file.header);
    file.header.input_count = file.header.output_count = 1;
    file.header.preprocess = (struct fv_model_preprocess){.width = 96, .height = 64, .channels = 3};
    file.header.decode = (struct fv_model_decode){.kind = FV_DECODER_END2END,
                                                  .classes = 1,
                                                  .max_detections = 300,
                                                  .point_count = EACH,
                                                  .point_values = 3,
                                                  .point_score = 2};
    tensors[0] = (struct fv_model_tensor){.rank = 4, .dims = {1, 64, 96, 3}};
    tensors[1] = (struct fv_model_tensor){
        .storage = 1, .rank = 3, .dims = {1, SETS, ROW}, .scale = 1.0f, .zero = 0};
    for (int i = 0; i < SETS; i++) {
        uint8_t *row = arena + (ptrdiff_t)i * ROW;
        memset(row, 0, ROW);
        row[2] = row[3] = 20;
        row[4] = 1; /* the score */
        for (int k = 0; k < EACH; k++)
            row[6 + 3 * k] = (uint8_t)(i + k);
    }
    memset(points, 0x7f, sizeof points);
    const struct fovea_keypoint untouched = points[0];
    assert_int_equal(fv_detect_sets_max(&model), 100);
    assert_int_equal(decode(), SETS);
    for (int i = 0; i < 100 * EACH; i++)
        near_to((double)points[i].x_px, i / EACH + i % EACH - 0.5, 1e-3);
    assert_memory_equal(&points[100 * EACH], &untouched, sizeof untouched);
    file.header.decode.point_count = 0;
    assert_int_equal(fv_detect_gives(&model), FV_DETECT_BOXES);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(heads_give_the_keypoints_that_they_stand_for),
        cmocka_unit_test(keypoints_of_the_first_hundred_are_given),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
