/* Heads of detectors against boxes computed elsewhere (tests/import/make_decoders.py): the same
 * boxes, in the same order, to 1e-5; in units as at once; thresholds by class; the best of too many
 * candidates. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "detect/decode.h"

enum { WIDTH = 96, HEIGHT = 64, BYTES_MAX = 1 << 17, LINE_MAX_BYTES = 2 * BYTES_MAX + 16 };

static struct fv_detect_scratch scratch;
static uint8_t arena[BYTES_MAX];
static struct fv_model_header header;
static struct fv_model_tensor tensors[2];
static const int32_t inputs[1] = {0}, outputs[1] = {1};
static float thresholds[8];
static const struct fv_model model = {.base = (const uint8_t *)thresholds,
                                      .header = &header,
                                      .tensors = tensors,
                                      .inputs = inputs,
                                      .outputs = outputs};
static char line[LINE_MAX_BYTES];

static void describe(int32_t kind, int32_t width, int32_t height)
{
    memset(&header, 0, sizeof header);
    memset(tensors, 0, sizeof tensors);
    header.input_count = header.output_count = 1;
    header.preprocess.width = width;
    header.preprocess.height = height;
    header.preprocess.channels = 3;
    header.decode.kind = kind;
    header.decode.max_detections = 300;
    tensors[0] = (struct fv_model_tensor){.rank = 4, .dims = {1, height, width, 3}};
    tensors[1] = (struct fv_model_tensor){.storage = 1};
}

static struct fv_nn_input_fit view_of(int32_t width, int32_t height)
{
    const uint8_t pixel = 0;
    const struct fovea_image image = {.data = &pixel,
                                      .width = width,
                                      .height = height,
                                      .stride_bytes = width,
                                      .format = FOVEA_PIXEL_GREY8};
    struct fv_nn_input_fit fit;
    assert_int_equal(fv_nn_input_fit_of(&model, &image, &fit), FOVEA_OK);
    return fit;
}

/* ---- against the other computation ----------------------------------------------------------- */

/* "head NAME d0 d1 d2 [d3] scale zero classes normalised agnostic score iou anchors..." */
static void read_head(void)
{
    char *at = line + 5, *name = strsep(&at, " ");
    const int32_t kind = strcmp(name, "yolov5") == 0   ? FV_DECODER_YOLOV5
                         : strcmp(name, "yolov8") == 0 ? FV_DECODER_YOLOV8
                                                       : FV_DECODER_YOLOV2;
    describe(kind, WIDTH, HEIGHT);
    struct fv_model_tensor *out = &tensors[1];
    struct fv_model_decode *d = &header.decode;
    out->rank = kind == FV_DECODER_YOLOV2 ? 4 : 3;
    for (int i = 0; i < out->rank; i++)
        out->dims[i] = (int32_t)strtol(at, &at, 10);
    out->scale = strtof(at, &at);
    out->zero = (int32_t)strtol(at, &at, 10);
    d->classes = (int32_t)strtol(at, &at, 10);
    d->normalised = (int32_t)strtol(at, &at, 10);
    d->class_agnostic = (int32_t)strtol(at, &at, 10);
    d->score_threshold = strtof(at, &at);
    d->iou_threshold = strtof(at, &at);
    float *anchor = d->anchors;
    for (char *end = at; anchor < d->anchors + 16; at = end) {
        *anchor = strtof(at, &end);
        if (end == at) break;
        anchor++;
    }
    d->anchor_count = (int32_t)(anchor - d->anchors) / 2;
}

static void read_bytes(void)
{
    const size_t count = strspn(line, "0123456789abcdef") / 2;
    assert_in_range(count, 1, BYTES_MAX);
    for (size_t i = 0; i < count; i++) {
        const char hex[3] = {line[2 * i], line[2 * i + 1], 0};
        arena[i] = (uint8_t)strtoul(hex, NULL, 16);
    }
}

static void near_to(double found, double expected, double scale)
{
    if (!(__builtin_fabs(found - expected) <= 1e-5 * scale))
        fail_msg("found %.9g, expected %.9g", found, expected);
}

static void heads_give_what_they_stand_for(void **state)
{
    (void)state;
    static struct fovea_detection found[FOVEA_DETECTIONS_MAX];
    FILE *file = fopen("tests/golden/decoders.txt", "r");
    assert_non_null(file);
    int cases = 0, boxes = 0;
    int32_t count = 0, at = 0;
    while (fgets(line, sizeof line, file) != NULL) {
        if (strncmp(line, "head ", 5) == 0) {
            read_head();
            assert_non_null(fgets(line, sizeof line, file));
            read_bytes();
            const struct fv_nn_input_fit fit = view_of(WIDTH, HEIGHT);
            count =
                fv_detect_decode(&model, arena, &fit, &scratch, NULL, found, FOVEA_DETECTIONS_MAX);
            at = 0;
            cases++;
        } else if (strncmp(line, "box ", 4) == 0) {
            int class_id;
            double v[5];
            assert_int_equal(sscanf(line, "box %d %lf %lf %lf %lf %lf", &class_id, &v[0], &v[1],
                                    &v[2], &v[3], &v[4]),
                             6);
            assert_true(at < count);
            const struct fovea_detection *d = &found[at++];
            assert_int_equal(d->class_id, class_id);
            near_to((double)d->score, v[0], v[0] > 1 ? v[0] : 1);
            near_to((double)d->x_min_px + 0.5, v[1], WIDTH);
            near_to((double)d->y_min_px + 0.5, v[2], WIDTH);
            near_to((double)d->x_max_px + 0.5, v[3], WIDTH);
            near_to((double)d->y_max_px + 0.5, v[4], WIDTH);
            boxes++;
        } else {
            assert_int_equal(at, count);
        }
    }
    fclose(file);
    assert_int_equal(cases, 12);
    assert_true(boxes > 200);
}

/* ---- thresholds, and too many candidates ----------------------------------------------------- */

/* A YOLOv5 output of n rows of two classes: boxes side by side on a grid, scores by `score`. */
static void make_rows(int32_t n, uint8_t (*score)(int32_t row, int32_t class_id))
{
    describe(FV_DECODER_YOLOV5, 256, 256);
    tensors[1].rank = 3;
    tensors[1].dims[0] = 1;
    tensors[1].dims[1] = n;
    tensors[1].dims[2] = 7;
    tensors[1].scale = 1.0f / 255;
    header.decode.classes = 2;
    header.decode.normalised = 1;
    header.decode.iou_threshold = 0.5f;
    for (int32_t i = 0; i < n; i++) {
        const uint8_t row[7] = {
            (uint8_t)(i % 64 * 4), (uint8_t)(i / 64 * 4), 2, 2, 255, score(i, 0), score(i, 1)};
        memcpy(arena + 7 * i, row, sizeof row);
    }
}

static uint8_t rising(int32_t row, int32_t class_id)
{
    return class_id == 0 ? (uint8_t)(10 + row / 10) : 0;
}

static uint8_t both(int32_t row, int32_t class_id)
{
    return (uint8_t)(row == 3 ? 100 + class_id : 0);
}

static void the_best_of_too_many_are_kept(void **state)
{
    (void)state;
    enum { ROWS = 2000 };
    static struct fovea_detection found[FOVEA_DETECTIONS_MAX];
    make_rows(ROWS, rising);
    header.decode.score_threshold = 0.001f;
    const struct fv_nn_input_fit fit = view_of(256, 256);
    assert_int_equal(
        fv_detect_decode(&model, arena, &fit, &scratch, NULL, found, FOVEA_DETECTIONS_MAX),
        FOVEA_DETECTIONS_MAX);
    for (int i = 0; i < FOVEA_DETECTIONS_MAX; i++) {
        /* scores fall by one step every ten; among equals the earlier row comes first */
        const int32_t row = ROWS - 10 - i / 10 * 10 + i % 10;
        assert_true(found[i].score == 1.0f * ((1.0f / 255) * (float)(10 + row / 10)));
        near_to((double)found[i].x_min_px + 0.5,
                (row % 64 * 4 - 1) / 255.0 * 256 < 0 ? 0 : (row % 64 * 4 - 1) / 255.0 * 256, 256);
    }
}

/* Where the first unit of the scan ends, and in the last one. */
static uint8_t at_the_seam(int32_t row, int32_t class_id)
{
    return class_id == 0 && (row == 9361 || row == 9362 || row == 11999) ? (uint8_t)(200 - row % 7)
                                                                         : 0;
}

static void units_go_on_where_the_last_one_ended(void **state)
{
    (void)state;
    const struct fv_detect_limits none = {.count = 0};
    struct fovea_detection found[4];
    int units = 1;
    make_rows(12000, at_the_seam); /* of 7 values: a unit reads 9362 rows */
    header.decode.score_threshold = 0.2f;
    const struct fv_nn_input_fit fit = view_of(256, 256);
    fv_detect_decode_start(&scratch);
    for (; fv_detect_decode_unit(&model, arena, &fit, &none, &scratch, NULL) == FOVEA_AGAIN;
         units++)
        assert_true(units < 10);
    assert_int_equal(units, 4); /* two of the scan, the sort, the suppression */
    assert_int_equal(fv_detect_decode_take(&model, &none, &scratch, found, 4, NULL), 3);
}

static void thresholds_by_class_hold(void **state)
{
    (void)state;
    struct fovea_detection found[4];
    make_rows(8, both);
    const struct fv_nn_input_fit fit = view_of(256, 256);
    header.decode.score_threshold = 0.2f;
    header.decode.class_agnostic = 0;
    assert_int_equal(fv_detect_decode(&model, arena, &fit, &scratch, NULL, found, 4), 2);
    assert_int_equal(found[0].class_id, 1);
    thresholds[1] = 0.2f; /* of class 0, at offset 4 */
    thresholds[2] = 0.5f;
    header.decode.thresholds = 4;
    assert_int_equal(fv_detect_decode(&model, arena, &fit, &scratch, NULL, found, 4), 1);
    assert_int_equal(found[0].class_id, 0);
    header.decode.class_agnostic = 1;
    thresholds[2] = 0.2f;
    assert_int_equal(fv_detect_decode(&model, arena, &fit, &scratch, NULL, found, 4), 1);
    assert_int_equal(found[0].class_id, 1);
}

/* Boxes of both classes in one place, of the scores 0.392 and 0.396. */
static int32_t decode_down_to(float floor, struct fovea_detection *found, int32_t *uncertain)
{
    const struct fv_detect_limits limits = {.floor = floor};
    const struct fv_nn_input_fit fit = view_of(256, 256);
    fv_detect_decode_start(&scratch);
    while (fv_detect_decode_unit(&model, arena, &fit, &limits, &scratch, NULL) == FOVEA_AGAIN)
        continue;
    return fv_detect_decode_take(&model, &limits, &scratch, found, 4, uncertain);
}

static void uncertain_boxes_come_last_and_suppress_no_others(void **state)
{
    (void)state;
    struct fovea_detection found[4];
    int32_t uncertain;
    make_rows(8, both);
    header.decode.thresholds = 4;
    thresholds[1] = 0.2f;
    thresholds[2] = 0.5f;
    header.decode.class_agnostic = 0;
    assert_int_equal(decode_down_to(0.1f, found, &uncertain), 1);
    assert_int_equal(uncertain, 1);
    assert_true(found[0].class_id == 0 && found[1].class_id == 1 &&
                found[1].score > found[0].score);
    assert_int_equal(decode_down_to(0.45f, found, &uncertain), 1); /* a floor raises no threshold */
    assert_int_equal(uncertain, 0);
    header.decode.class_agnostic = 1;
    assert_int_equal(decode_down_to(0.1f, found, &uncertain), 1);
    assert_int_equal(uncertain, 0);
    assert_int_equal(found[0].class_id, 0);
    thresholds[1] = 0.6f;
    assert_int_equal(decode_down_to(0.1f, found, &uncertain), 0);
    assert_int_equal(uncertain, 1);
    assert_int_equal(found[0].class_id, 1);
}

/* ---- the outputs of TFLite_Detection_PostProcess --------------------------------------------- */

/* Two boxes: the whole image, of class 3, and its upper left quarter, of class 1. The model lists
 * boxes, classes, scores and their number as `order` says. */
static int32_t decode_ssd(const int32_t order[4], struct fovea_detection found[4])
{
    static const float values[14] = {0, 0, 1, 1, 0, 0, 0.5f, 0.5f, 3, 1, 0.75f, 0.5f, 2};
    static const int32_t first[4] = {0, 8, 10, 12}, sizes[4] = {8, 2, 2, 1};
    struct fv_model_tensor all[5] = {{.rank = 4, .dims = {1, HEIGHT, WIDTH, 3}}};
    const struct fv_model_op op = {
        .kind = FV_OP_DETECTION, .output_count = 4, .outputs = {1, 2, 3, 4}};
    int32_t listed[4];
    describe(FV_DECODER_SSD, WIDTH, HEIGHT);
    header.op_count = 1;
    header.output_count = 4;
    memcpy(arena, values, sizeof values);
    for (int i = 0; i < 4; i++) {
        all[1 + i] = (struct fv_model_tensor){.type = FV_TYPE_F32,
                                              .rank = 1,
                                              .dims = {sizes[i]},
                                              .offset = 4 * first[i],
                                              .storage = 1 + i};
        listed[i] = 1 + order[i];
    }
    const struct fv_model ssd = {.base = model.base,
                                 .header = &header,
                                 .tensors = all,
                                 .ops = &op,
                                 .inputs = inputs,
                                 .outputs = listed};
    const struct fv_nn_input_fit fit = view_of(WIDTH, HEIGHT);
    return fv_detect_decode(&ssd, arena, &fit, &scratch, NULL, found, 4);
}

/* Models of the TensorFlow 2 detection API list them by scores, boxes, number, classes. */
static void ssd_outputs_are_known_in_any_order(void **state)
{
    (void)state;
    static const int32_t orders[3][4] = {{0, 1, 2, 3}, {2, 0, 3, 1}, {3, 2, 1, 0}};
    for (int i = 0; i < 3; i++) {
        struct fovea_detection found[4];
        assert_int_equal(decode_ssd(orders[i], found), 2);
        assert_int_equal(found[0].class_id, 3);
        near_to((double)found[0].score, 0.75, 1);
        near_to((double)found[0].x_max_px + 0.5, WIDTH, WIDTH);
        assert_int_equal(found[1].class_id, 1);
        near_to((double)found[1].score, 0.5, 1);
        near_to((double)found[1].y_max_px + 0.5, HEIGHT / 2, HEIGHT);
    }
}

/* ---- boxes and scores before it -------------------------------------------------------------- */

/* Three anchors; the second box is moved and widened against its own, the third is below the
 * threshold. */
static void ssd_before_its_post_processing(void **state)
{
    (void)state;
    static _Alignas(64) float file[256];
    static const float anchors[12] = {0.5f, 0.5f,  0.5f, 0.25f, 0.5f, 0.25f,
                                      0.5f, 0.25f, 0.5f, 0.5f,  1,    1};
    static const float boxes[12] = {0, 0, 0, 0, 1, 2, 0, 2.5f, 0, 0, 0, 0},
                       scores[9] = {0.1f, 0.75f, 0, 0.2f, 0.1f, 0.5f, 1, 0.1f, 0.1f};
    memcpy(file + FV_MODEL_HEADER_BYTES / 4, anchors, sizeof anchors);
    for (int swapped = 0; swapped < 2; swapped++) {
        const int32_t listed[2] = {1 + swapped, 2 - swapped};
        const struct fv_model_tensor all[3] = {
            {.rank = 4, .dims = {1, HEIGHT, WIDTH, 3}},
            {.type = FV_TYPE_F32, .rank = 3, .dims = {1, 3, 4}, .storage = 1},
            {.type = FV_TYPE_F32,
             .rank = 3,
             .dims = {1, 3, 3},
             .offset = sizeof boxes,
             .storage = 2}};
        const struct fv_model raw = {.base = (const uint8_t *)file,
                                     .header = &header,
                                     .tensors = all,
                                     .inputs = inputs,
                                     .outputs = listed};
        struct fovea_detection found[4];
        describe(FV_DECODER_SSD_RAW, WIDTH, HEIGHT);
        header.output_count = 2;
        header.file_bytes = sizeof file;
        header.decode.classes = 2;
        header.decode.score_threshold = 0.3f;
        header.decode.iou_threshold = 0.5f;
        header.decode.anchor_data = FV_MODEL_HEADER_BYTES;
        for (int i = 0; i < 4; i++)
            header.decode.box_scales[i] = i < 2 ? 10 : 5;
        memcpy(arena, boxes, sizeof boxes);
        memcpy(arena + sizeof boxes, scores, sizeof scores);
        const struct fv_nn_input_fit fit = view_of(WIDTH, HEIGHT);
        assert_int_equal(fv_detect_decode(&raw, arena, &fit, &scratch, NULL, found, 4), 2);
        assert_int_equal(found[0].class_id, 0);
        near_to((double)found[0].x_min_px + 0.5, 0.375 * WIDTH, WIDTH);
        near_to((double)found[0].y_max_px + 0.5, 0.75 * HEIGHT, HEIGHT);
        assert_int_equal(found[1].class_id, 1);
        near_to((double)found[1].score, 0.5, 1);
        /* centre 0.3 by 0.55, width 0.25 e^0.5, height 0.5 */
        near_to((double)found[1].x_min_px + 0.5, (0.3 - 0.125 * 1.6487212707) * WIDTH, WIDTH);
        near_to((double)found[1].x_max_px + 0.5, (0.3 + 0.125 * 1.6487212707) * WIDTH, WIDTH);
        near_to((double)found[1].y_min_px + 0.5, 0.3 * HEIGHT, HEIGHT);
    }
}

/* Outputs whose shape does not fit their decoder, down to a single number, give nothing. */
static void foreign_shapes_give_nothing(void **state)
{
    (void)state;
    static _Alignas(64) uint8_t file[1024];
    const int32_t listed[4] = {1, 2, 1, 2};
    for (int32_t kind = 0; kind < FV_DECODER_COUNT; kind++) {
        for (int32_t rank = 0; rank <= 4; rank++) {
            struct fv_model_tensor all[3] = {{.rank = 4, .dims = {1, HEIGHT, WIDTH, 3}},
                                             {.rank = rank, .dims = {1, 1, 1, 1}},
                                             {.rank = rank, .dims = {1, 1, 1, 1}}};
            const struct fv_model odd = {.base = file,
                                         .header = &header,
                                         .tensors = all,
                                         .inputs = inputs,
                                         .outputs = listed};
            struct fovea_detection found[4];
            if (rank > 0)
                all[1].dims[rank - 1] =
                    16; /* of four boxes, of which the other output holds no scores */
            describe(kind, WIDTH, HEIGHT);
            header.output_count = kind == FV_DECODER_SSD_RAW ? 2 : 4;
            header.file_bytes = sizeof file;
            header.decode.anchor_data = FV_MODEL_HEADER_BYTES;
            header.decode.score_threshold = 0.5f;
            memset(arena, 0, 64);
            const struct fv_nn_input_fit fit = view_of(WIDTH, HEIGHT);
            const int32_t count = fv_detect_decode(&odd, arena, &fit, &scratch, NULL, found, 4);
            if (count != 0) fail_msg("decoder %d, %d axes: found %d boxes", kind, rank, count);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(heads_give_what_they_stand_for),
        cmocka_unit_test(the_best_of_too_many_are_kept),
        cmocka_unit_test(units_go_on_where_the_last_one_ended),
        cmocka_unit_test(thresholds_by_class_hold),
        cmocka_unit_test(uncertain_boxes_come_last_and_suppress_no_others),
        cmocka_unit_test(ssd_outputs_are_known_in_any_order),
        cmocka_unit_test(ssd_before_its_post_processing),
        cmocka_unit_test(foreign_shapes_give_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
