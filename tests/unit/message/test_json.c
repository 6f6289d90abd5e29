/* Messages as JSON: every value in its place, what is no number as null, and nothing written
 * beyond the room given. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/datasets.h"
#include "fovea/fields.h"

#include "fovea_detections_t.h"
#include "fovea_features_t.h"
#include "fovea_grants_t.h"
#include "fovea_health_t.h"

static char text[4096];

/* The text of an encoded message. */
static const char *json_of(const uint8_t *data, int bytes)
{
    struct fovea_error error;
    size_t length;
    assert_true(bytes > 0);
    if (fovea_message_json(data, (size_t)bytes, text, sizeof text, &length, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    assert_int_equal(strlen(text), length);
    return text;
}

static void numbers_arrays_and_rows(void **state)
{
    (void)state;
    uint8_t data[512], level[2] = {0, 255};
    float p[2][2] = {{1.5F, -0.25F}, {NAN, INFINITY}}, size[2] = {31, 0.1F}, zero[2] = {0};
    float *rows[2] = {p[0], p[1]};
    const fovea_features_t message = {
        .stamp = {.time_ns = INT64_MIN, .clock = -1, .meaning = 3, .sequence = INT64_MAX},
        .reset_counter = -7,
        .width = 640,
        .method = (char *)"fast",
        .total = 2,
        .count = 2,
        .p_px = rows,
        .size_px = size,
        .orientation = zero,
        .response = zero,
        .level = level};
    assert_string_equal(
        json_of(data, fovea_features_t_encode(data, 0, sizeof data, &message)),
        "{\"type\": \"fovea.features_t\", \"stamp\": {\"time_ns\": -9223372036854775808, \"clock\": -1, "
        "\"meaning\": 3, \"utc_offset_ns\": 0, \"sequence\": 9223372036854775807}, \"camera\": 0, "
        "\"reset_counter\": -7, \"width\": 640, \"height\": 0, \"asked\": 0, \"method\": \"fast\", "
        "\"total\": 2, \"first\": 0, \"count\": 2, \"p_px\": [[1.5, -0.25], [null, 1e999]], \"size_px\": [31, "
        "0.100000001], \"orientation\": [0, 0], \"response\": [0, 0], \"level\": [0, 255]}");
    assert_string_equal(fovea_message_type(data, sizeof data), "fovea.features_t");
}

/* A program may have set a locale whose numbers have a comma. */
static void numbers_have_a_point_in_every_locale(void **state)
{
    (void)state;
    char folder[FV_TEST_PATH_BYTES], command[FV_TEST_PATH_BYTES + 128];
    uint8_t data[512], level[1] = {1};
    float p[2] = {1.5F, -0.25F}, size[1] = {0.1F}, zero[1] = {0}, *rows[1] = {p};
    const fovea_features_t message = {.method = (char *)"",
                                      .count = 1,
                                      .p_px = rows,
                                      .size_px = size,
                                      .orientation = zero,
                                      .response = zero,
                                      .level = level};
    fv_test_folder(folder);
    snprintf(command, sizeof command, "localedef -i de_DE -f UTF-8 %s/de_DE.UTF-8 >/dev/null 2>&1",
             folder);
    const bool made = system(command) == 0 && setenv("LOCPATH", folder, 1) == 0 &&
                      setlocale(LC_ALL, "de_DE.UTF-8") != NULL;
    if (made) {
        char number[8];
        snprintf(number, sizeof number, "%.1f", 1.5);
        assert_string_equal(number, "1,5");
        json_of(data, fovea_features_t_encode(data, 0, sizeof data, &message));
        setlocale(LC_ALL, "C");
        assert_non_null(strstr(text, "\"p_px\": [[1.5, -0.25]], \"size_px\": [0.100000001]"));
    } else {
        print_message("SKIPPED numbers in a locale: no localedef with de_DE here\n");
    }
    fv_test_folder_remove(folder);
    if (!made) skip();
}

static void nothing_in_an_array(void **state)
{
    (void)state;
    uint8_t data[256];
    const fovea_grants_t message = {.now_ns = 5, .features = 6};
    assert_string_equal(
        json_of(data, fovea_grants_t_encode(data, 0, sizeof data, &message)),
        "{\"type\": \"fovea.grants_t\", \"now_ns\": 5, \"features\": 6, \"job_count\": 0, "
        "\"units\": []}");
    const fovea_health_t health = {.state = 1};
    const char *found = json_of(data, fovea_health_t_encode(data, 0, sizeof data, &health));
    assert_non_null(strstr(found, "\"state\": 1, \"count\": 0, \"parts\": []}"));
}

static void structs_in_structs(void **state)
{
    (void)state;
    uint8_t data[512];
    fovea_detection_t list[2] = {
        {.class_id = 1, .class_name = (char *)"a", .score = 0.5F, .box = {1, 2, 3, 4}},
        {.class_id = 2, .class_name = (char *)"b", .rectified_box = {5, 6, 7, 8}}};
    const fovea_detections_t message = {.model = (char *)"m", .count = 2, .detections = list};
    const char *found = json_of(data, fovea_detections_t_encode(data, 0, sizeof data, &message));
    assert_non_null(strstr(
        found,
        "\"detections\": [{\"class_id\": 1, \"class_name\": \"a\", \"score\": 0.5, \"box\": {\"x_min_px\": "
        "1, \"y_min_px\": 2, \"x_max_px\": 3, \"y_max_px\": 4}, \"angle\": 0, \"rectified_box\": {\"x_min_px\": 0, "));
    assert_non_null(strstr(found, "}}, {\"class_id\": 2, \"class_name\": \"b\", "));
    assert_non_null(strstr(found, "\"x_max_px\": 7, \"y_max_px\": 8}}]}"));
}

static void strings_are_json_whatever_is_in_them(void **state)
{
    (void)state;
    uint8_t data[512];
    fovea_health_part_t part = {.name = (char *)"\"\\\n\x7f",
                                .reason = (char *)"\xc3\xa4\xe2\x82\xac\xf0\x9f\x98\x80"
                                                  "|\xc0\xaf|\xed\xa0\x80|\xff|\xe2\x82"};
    const fovea_health_t message = {.count = 1, .parts = &part};
    const char *found = json_of(data, fovea_health_t_encode(data, 0, sizeof data, &message));
    assert_non_null(strstr(found, "\"name\": \"\\\"\\\\\\u000a\\u007f\""));
    assert_non_null(strstr(found,
                           "\"reason\": \"\xc3\xa4\xe2\x82\xac\xf0\x9f\x98\x80|\\ufffd\\ufffd|"
                           "\\ufffd\\ufffd\\ufffd|\\ufffd|\\ufffd\\ufffd\"}"));
}

static void the_room_given_is_enough_or_said(void **state)
{
    (void)state;
    uint8_t data[256];
    const fovea_grants_t message = {.now_ns = 5};
    const int bytes = fovea_grants_t_encode(data, 0, sizeof data, &message);
    const size_t whole = strlen(json_of(data, bytes));
    char expected[256];
    strcpy(expected, text);
    for (size_t capacity = 0; capacity <= whole + 1; capacity++) {
        char *exact = malloc(capacity + 1);
        size_t length = 0;
        exact[capacity] = '#';
        assert_int_equal(fovea_message_json(data, (size_t)bytes, exact, capacity, &length, NULL),
                         FOVEA_OK);
        assert_int_equal(length, whole);
        assert_int_equal(exact[capacity], '#');
        if (capacity > 0) {
            assert_int_equal(strlen(exact), capacity - 1);
            assert_memory_equal(exact, expected, capacity - 1);
        }
        free(exact);
    }
}

static void what_is_no_message_is_refused(void **state)
{
    (void)state;
    uint8_t data[256];
    struct fovea_error error;
    size_t length = 77;
    const fovea_grants_t message = {.now_ns = 5};
    const int bytes = fovea_grants_t_encode(data, 0, sizeof data, &message);
    assert_int_equal(
        fovea_message_json(data, (size_t)bytes - 1, text, sizeof text, &length, &error),
        FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "fovea.grants_t: a field reaches past the end"));
    data[0] ^= 1;
    assert_int_equal(fovea_message_json(data, (size_t)bytes, text, sizeof text, &length, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "found a message of no known type"));
    assert_null(fovea_message_type(data, (size_t)bytes));
    assert_null(fovea_message_type(data, 3));
    assert_int_equal(length, 77);
}

static void go_to(struct fovea_fields *fields, const char *path, struct fovea_field *field)
{
    do
        assert_int_equal(fovea_fields_next(fields, field), FOVEA_OK);
    while (strcmp(field->path, path) != 0);
}

static void fields_come_one_by_one_with_their_numbers(void **state)
{
    (void)state;
    uint8_t data[512], level[2] = {0, 255};
    float p[2][2] = {{1.5F, -0.25F}, {NAN, 3e18F}}, size[2] = {-31.75F, INFINITY}, zero[2] = {0};
    float *rows[2] = {p[0], p[1]};
    const fovea_features_t message = {.stamp = {.time_ns = INT64_MIN, .clock = -1},
                                      .reset_counter = -7,
                                      .method = (char *)"",
                                      .count = 2,
                                      .p_px = rows,
                                      .size_px = size,
                                      .orientation = zero,
                                      .response = zero,
                                      .level = level};
    const int bytes = fovea_features_t_encode(data, 0, sizeof data, &message);
    struct fovea_fields fields;
    struct fovea_field field;
    assert_int_equal(fovea_fields_begin(&fields, data, (size_t)bytes), FOVEA_OK);
    go_to(&fields, "stamp.time_ns", &field);
    assert_true(fovea_field_integer(&field, 0) == INT64_MIN);
    assert_true(fovea_field_number(&field, 0) == -9223372036854775808.0);
    go_to(&fields, "stamp.clock", &field);
    assert_true(fovea_field_integer(&field, 0) == -1 && fovea_field_number(&field, 0) == -1.0);
    go_to(&fields, "p_px", &field);
    assert_true(field.count == 4 && field.row == 2);
    assert_true(fovea_field_number(&field, 1) == -0.25 && fovea_field_integer(&field, 0) == 1);
    assert_true(isnan(fovea_field_number(&field, 2)) && fovea_field_integer(&field, 2) == 0);
    assert_true(fovea_field_integer(&field, 3) == (int64_t)3e18F);
    assert_true(fovea_field_number(&field, 4) == 0.0 && fovea_field_integer(&field, 4) == 0);
    go_to(&fields, "size_px", &field);
    assert_true(fovea_field_integer(&field, 0) == -31 && fovea_field_integer(&field, 1) == 0);
    go_to(&fields, "level", &field);
    assert_true(fovea_field_integer(&field, 1) == 255 && fovea_field_number(&field, 1) == 255.0);
    assert_int_equal(fovea_fields_next(&fields, &field), FOVEA_END);
}

static void fields_of_what_is_no_message_say_why(void **state)
{
    (void)state;
    uint8_t data[256];
    struct fovea_fields fields;
    struct fovea_field field;
    const fovea_grants_t message = {.now_ns = 5};
    const int bytes = fovea_grants_t_encode(data, 0, sizeof data, &message);
    assert_int_equal(fovea_fields_begin(&fields, data, (size_t)bytes - 1), FOVEA_OK);
    enum fovea_status status;
    while ((status = fovea_fields_next(&fields, &field)) == FOVEA_OK)
        assert_true(fovea_field_number(&field, 0) == (strcmp(field.path, "now_ns") == 0 ? 5 : 0));
    assert_int_equal(status, FOVEA_ERROR_INPUT);
    assert_string_equal(fields.problem, "a field reaches past the end of the message");
    assert_int_equal(fields.at, bytes - 4);
    assert_int_equal(fovea_fields_next(&fields, &field), FOVEA_ERROR_INPUT);
    data[0] ^= 1;
    assert_int_equal(fovea_fields_begin(&fields, data, (size_t)bytes), FOVEA_ERROR_INPUT);
    assert_int_equal(fovea_fields_next(&fields, &field), FOVEA_ERROR_INPUT);
    assert_string_equal(fields.problem, "of no known type");
    assert_int_equal(fovea_fields_begin(&fields, data, 7), FOVEA_ERROR_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_arrays_and_rows),
        cmocka_unit_test(numbers_have_a_point_in_every_locale),
        cmocka_unit_test(nothing_in_an_array),
        cmocka_unit_test(structs_in_structs),
        cmocka_unit_test(strings_are_json_whatever_is_in_them),
        cmocka_unit_test(the_room_given_is_enough_or_said),
        cmocka_unit_test(what_is_no_message_is_refused),
        cmocka_unit_test(fields_come_one_by_one_with_their_numbers),
        cmocka_unit_test(fields_of_what_is_no_message_say_why),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
