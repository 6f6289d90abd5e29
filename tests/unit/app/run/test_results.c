/* Files of detections and objects: what stands in them, byte for byte; nothing found; a full ring;
 * a full disk. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/run/results.h"

static char folder[] = "/tmp/fovea-results-XXXXXX";
static char detections_path[64], objects_path[64];

static int set_up(void **state)
{
    (void)state;
    if (mkdtemp(folder) == NULL) return -1;
    snprintf(detections_path, sizeof detections_path, "%s/found.json", folder);
    snprintf(objects_path, sizeof objects_path, "%s/objects.txt", folder);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    unlink(detections_path);
    unlink(objects_path);
    return rmdir(folder);
}

static void holds(const char *path, const char *expected)
{
    char text[1024] = "";
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    assert_string_equal(text, expected);
}

static const struct fovea_detection found[2] = {{9.5f, 19.5f, 29.5f, 59.5f, 0.75f, 0, 0},
                                                {-0.5f, -0.5f, 1.5f, 2.5f, 0.5f, 3, 0}};

/* COCO counts from the corner of the first pixel, MOTChallenge from 1 at its middle; only confirmed
 * objects were seen. */
static void what_is_handed_over_is_written(void **state)
{
    (void)state;
    const struct fovea_object list[3] = {
        {.id = 4,
         .state = FOVEA_OBJECT_CONFIRMED,
         .score = 0.75f,
         .x_min_px = 9,
         .y_min_px = 19,
         .x_max_px = 29,
         .y_max_px = 59},
        {.id = 5, .state = FOVEA_OBJECT_COASTING, .score = 0.5f, .x_max_px = 7, .y_max_px = 8},
        {.id = 6, .state = FOVEA_OBJECT_TENTATIVE, .score = 0.5f, .x_max_px = 7, .y_max_px = 8}};
    const struct fovea_detections none = {.inferences = 1, .sequence = 6},
                                  two = {.inferences = 2, .sequence = 7, .count = 2, .list = found};
    const struct fovea_objects no_objects = {.updates = 0},
                               objects = {.updates = 2, .sequence = 7, .count = 3, .list = list};
    struct fv_results *results;
    struct fovea_error error;
    assert_int_equal(fv_results_open(detections_path, objects_path, &results, &error), FOVEA_OK);
    fv_results_add(results, &none, &no_objects);
    fv_results_add(results, &two, &objects);
    assert_int_equal(fv_results_close(results, &error), FOVEA_OK); /* which drains */
    holds(
        detections_path,
        "[\n"
        "{\"image_id\": 7, \"category_id\": 1, \"bbox\": [10.000, 20.000, 20.000, 40.000], \"score\": 0.750000},\n"
        "{\"image_id\": 7, \"category_id\": 4, \"bbox\": [0.000, 0.000, 2.000, 3.000], \"score\": 0.500000}\n]\n");
    holds(objects_path, "8,4,10.00,20.00,20.00,40.00,0.7500,-1,-1,-1\n");
}

static void nothing_found_is_an_empty_list(void **state)
{
    (void)state;
    struct fv_results *results;
    struct fovea_error error;
    assert_int_equal(fv_results_open(detections_path, NULL, &results, &error), FOVEA_OK);
    assert_int_equal(fv_results_close(results, &error), FOVEA_OK);
    holds(detections_path, "[]\n");
    assert_int_equal(fv_results_open(NULL, NULL, &results, &error), FOVEA_OK);
    assert_null(results);
    assert_true(fv_results_room(results));
    assert_int_equal(fv_results_open("/none/found.json", NULL, &results, &error),
                     FOVEA_ERROR_INPUT);
}

/* As long as there is room nothing is lost, over many times the ring; without it the loss is named.
 */
static void what_finds_no_room_is_reported(void **state)
{
    (void)state;
    static struct fovea_detection many[FOVEA_DETECTIONS_MAX];
    const struct fovea_detections full = {
        .inferences = 1, .count = FOVEA_DETECTIONS_MAX, .list = many};
    const struct fovea_objects no_objects = {.updates = 0};
    struct fv_results *results;
    struct fovea_error error;
    assert_int_equal(fv_results_open(detections_path, NULL, &results, &error), FOVEA_OK);
    for (int n = 0; n < 1000; n++) {
        if (!fv_results_room(results)) fv_results_drain(results);
        fv_results_add(results, &full, &no_objects);
    }
    assert_int_equal(fv_results_close(results, &error), FOVEA_OK);
    assert_int_equal(fv_results_open(detections_path, NULL, &results, &error), FOVEA_OK);
    while (fv_results_room(results))
        fv_results_add(results, &full, &no_objects);
    for (int n = 0; n < 100; n++)
        fv_results_add(results, &full, &no_objects);
    assert_int_equal(fv_results_close(results, &error), FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "found.json"));
    assert_int_equal(fv_results_open("/dev/full", NULL, &results, &error), FOVEA_OK);
    fv_results_add(results, &full, &no_objects);
    assert_int_equal(fv_results_close(results, &error), FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "/dev/full"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_handed_over_is_written),
        cmocka_unit_test(nothing_found_is_an_empty_list),
        cmocka_unit_test(what_finds_no_room_is_reported),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
