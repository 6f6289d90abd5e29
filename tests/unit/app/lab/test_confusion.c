/* The confusion matrix of label pictures: as many classes as a mask can tell apart, each with its
 * own row and column, beside one that is counted here; and maps as editors leave them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "app/lab/confusion.h"

enum { MOST = FOVEA_SEGMENTATION_CLASSES_MAX, SIDE = 64, PIXELS = SIDE * SIDE };

static struct fv_model_header header;
static const struct fv_model model = {.base = (const uint8_t *)&header, .header = &header};
static struct fv_confusion confusion;
static struct fovea_error error;
static char path[] = "/tmp/fovea-confusion-XXXXXX";

static int set_up(void **state)
{
    (void)state;
    const int file = mkstemp(path);
    return file < 0 ? -1 : close(file);
}

static int tear_down(void **state)
{
    (void)state;
    return unlink(path);
}

static enum fovea_status open_map(const char *text)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0 && fclose(file) == 0);
    return fv_confusion_open(&confusion, path, &model, &error);
}

/* A mask of the picture's size in which each pixel has the class of `classes`; the list has them in
 * the order of their numbers. */
static void add(const uint8_t *labels, const uint8_t *classes)
{
    static struct fovea_segmentation_class list[MOST];
    static uint8_t index[256];
    struct fovea_segmentation seen = {.image_width = SIDE,
                                      .image_height = SIDE,
                                      .width = SIDE,
                                      .height = SIDE,
                                      .fit = {SIDE, SIDE, 0, 0, SIDE, SIDE},
                                      .part = {0, 0, SIDE, SIDE},
                                      .list = list,
                                      .pixels = classes,
                                      .index = index};
    uint32_t areas[256] = {0};
    for (int i = 0; i < PIXELS; i++)
        areas[classes[i]]++;
    memset(index, FOVEA_SEGMENTATION_NONE, sizeof index);
    for (int c = 0; c < MOST; c++) {
        if (areas[c] == 0) continue;
        list[seen.count] =
            (struct fovea_segmentation_class){.class_id = c, .object = -1, .pixels = areas[c]};
        index[c] = (uint8_t)seen.count++;
    }
    assert_int_equal(fv_confusion_add(&confusion, labels, &seen), FOVEA_OK);
}

static void each_of_the_most_classes_has_its_row(void **state)
{
    (void)state;
    static char text[16 * MOST];
    static uint8_t labels[PIXELS], classes[PIXELS];
    static uint64_t expected[MOST + 1][MOST + 1];
    header.decode.classes = MOST;
    for (int c = 0, at = 0; c < MOST; c++) /* in another order than that of the classes */
        at += snprintf(text + at, sizeof text - (size_t)at, "%d %d\n", c, MOST - 1 - c);
    assert_int_equal(open_map(text), FOVEA_OK);
    assert_int_equal(confusion.count, MOST);
    memset(expected, 0, sizeof expected);
    for (int i = 0; i < PIXELS; i++) {
        labels[i] = (uint8_t)(i % MOST);
        classes[i] = (uint8_t)(i % 7 == 0 ? i * 31 % 256 : MOST - 1 - labels[i]); /* 255: none */
        expected[labels[i]][classes[i] < MOST ? MOST - 1 - classes[i] : MOST]++;
    }
    add(labels, classes);
    assert_true(confusion.pixels == PIXELS && confusion.ignored == 0);
    for (int row = 0; row <= MOST; row++)
        for (int column = 0; column <= MOST; column++)
            assert_int_equal(confusion.cells[row][column], expected[row][column]);
}

/* Classes that the map does not name are the last column, however many the network has. */
static void classes_that_are_not_judged_are_other(void **state)
{
    (void)state;
    static uint8_t labels[PIXELS], classes[PIXELS];
    int judged = 0;
    header.decode.classes = 0; /* the network says none: any number of a mask */
    assert_int_equal(open_map("1 254\n2 0\n"), FOVEA_OK);
    for (int i = 0; i < PIXELS; i++) {
        labels[i] = 1;
        classes[i] = (uint8_t)(i % 255);
        judged += classes[i] == 254;
    }
    add(labels, classes);
    assert_int_equal(confusion.cells[0][0], judged);
    assert_int_equal(confusion.cells[0][1], (PIXELS + 254) / 255);
    assert_int_equal(confusion.cells[0][2], PIXELS - judged - (PIXELS + 254) / 255);
}

/* A mask has no class from 255 on, so none can be judged. */
static void numbers_beyond_those_of_masks_are_refused(void **state)
{
    (void)state;
    header.decode.classes = 300;
    assert_int_equal(open_map("1 254\n"), FOVEA_OK);
    assert_int_equal(open_map("1 255\n"), FOVEA_ERROR_INPUT);
    assert_int_equal(open_map("1 299\n"), FOVEA_ERROR_INPUT);
}

static void a_byte_order_mark_is_no_part_of_a_map(void **state)
{
    (void)state;
    header.decode.classes = 9;
    for (int marked = 0; marked < 2; marked++) {
        assert_int_equal(open_map(marked ? "\xef\xbb\xbf"
                                           "7 3\r\n8 4\r\n"
                                         : "7 3\n8 4\n"),
                         FOVEA_OK);
        assert_true(confusion.count == 2 && confusion.row_of[7] == 0 && confusion.row_of[8] == 1);
        assert_true(confusion.column_of[3] == 0 && confusion.column_of[4] == 1);
    }
    assert_int_equal(open_map("\xef\xbb\xbf# none\n"), FOVEA_ERROR_INPUT);
    assert_int_equal(open_map("7 3\n\xef\xbb\xbf"
                              "8 4\n"),
                     FOVEA_ERROR_INPUT); /* elsewhere it is a fault */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_of_the_most_classes_has_its_row),
        cmocka_unit_test(classes_that_are_not_judged_are_other),
        cmocka_unit_test(numbers_beyond_those_of_masks_are_refused),
        cmocka_unit_test(a_byte_order_mark_is_no_part_of_a_map),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
