/* Samples of sensors: every kind of fovea/sensor.h has its LCM type, its channel, and goes into a
 * log and back with every bit. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "fovea/sensor.h"
#include "message/fields.h"
#include "message/message.h"
#include "message/recorded.h"
#include "support/lcmlog.h"

static const char *const names[] = {
#define NAME(KIND, name) "fovea." #name "_t",
    FOVEA_SAMPLE_KINDS(NAME)};

static int setup(void **state)
{
    (void)state;
    fv_message_prepare();
    return 0;
}

static const struct fovea_type *find_type(const char *name)
{
    int32_t count;
    const struct fovea_type *types = fv_message_types(&count);
    for (int32_t i = 0; i < count; i++)
        if (strcmp(types[i].name, name) == 0) return &types[i];
    fail_msg("found no type %s", name);
    return NULL;
}

/* The recorder writes a sample's doubles one after another, so its type must be a stamp and as many
 * doubles. */
static void every_type_is_a_stamp_and_the_doubles_of_its_struct(void **state)
{
    (void)state;
    for (int kind = 0; kind < FOVEA_SAMPLE_KIND_COUNT; kind++) {
        const struct fovea_type *type = find_type(names[kind]);
        int32_t doubles = 0;
        assert_string_equal(type->fields[0].name, "stamp");
        assert_int_equal(type->fields[0].wire, FOVEA_WIRE_STRUCT);
        for (int32_t i = 1; i < type->field_count; i++) {
            const struct fv_field *field = &type->fields[i];
            if (field->wire != FOVEA_WIRE_DOUBLE || field->count < 1)
                fail_msg("%s: %s: found no fixed number of doubles", type->name, field->name);
            doubles += field->count * (field->row > 0 ? field->row : 1);
        }
        assert_int_equal(doubles, fovea_sample_value_count(kind));
    }
}

static void every_kind_has_a_channel_of_its_own(void **state)
{
    (void)state;
    char found[FV_MESSAGE_KIND_COUNT][FV_MESSAGE_CHANNEL_BYTES];
    for (int kind = 0; kind < FV_MESSAGE_KIND_COUNT; kind++)
        fv_message_channel("ROBOT", (enum fv_message_kind)kind, found[kind]);
    for (int kind = 0; kind < FV_MESSAGE_KIND_COUNT; kind++)
        for (int other = 0; other < kind; other++)
            assert_string_not_equal(found[kind], found[other]);
    assert_string_equal(found[fv_message_of_sample(FOVEA_SAMPLE_IMU)], "ROBOT_IMU");
    assert_string_equal(found[fv_message_of_sample(FOVEA_SAMPLE_WHEEL_ODOMETRY)],
                        "ROBOT_WHEEL_ODOMETRY");
}

static void make(struct fovea_sample *sample, int kind)
{
    memset(sample, 0, sizeof *sample);
    sample->kind = (enum fovea_sample_kind)kind;
    sample->any.stamp_ns = INT64_C(1403636579763555584) + kind;
    for (uint32_t i = 0; i < fovea_sample_value_count(sample->kind); i++)
        sample->any.values[i] = (i % 2 == 0 ? 1.0 : -1.0) / (3.0 + i + 10.0 * kind);
}

static struct fv_lcmlog_event event_of(const uint8_t *data, uint32_t bytes)
{
    struct fv_lcmlog_event event = {.offset = 1000, .bytes = bytes, .data = data};
    snprintf(event.channel, sizeof event.channel, "ANY");
    return event;
}

static void samples_come_back_with_every_bit(void **state)
{
    (void)state;
    const fovea_stamp_t stamp = {
        .time_ns = -1, .clock = FOVEA_CLOCK_REALTIME, .utc_offset_ns = 77, .sequence = 5};
    for (int kind = 0; kind < FOVEA_SAMPLE_KIND_COUNT; kind++) {
        uint8_t data[256];
        size_t at;
        const char *problem;
        struct fovea_sample sample, found;
        struct fovea_error error;
        make(&sample, kind);
        memset(&found, 0xff, sizeof found);
        const uint32_t bytes =
            fv_message_sample_encode(&sample, &stamp, data, fv_message_sample_size_max());
        if (!fv_message_check(names[kind], data, bytes, &problem, &at))
            fail_msg("%s: byte %zu: %s", names[kind], at, problem);
        const struct fv_lcmlog_event event = event_of(data, bytes);
        if (fv_lcmlog_sample("log", &event, &found, &error) != FOVEA_OK)
            fail_msg("%s: %s", names[kind], error.text);
        assert_memory_equal(&found, &sample, sizeof found);
        assert_int_equal(fv_message_sample_encode(&sample, &stamp, data, bytes), bytes);
        assert_int_equal(fv_message_sample_encode(&sample, &stamp, data, bytes - 1), 0);
        assert_int_equal(fv_message_sample_encode(&sample, &stamp, data, 4), 0);
    }
}

static void samples_that_hold_no_number_or_are_cut_off_are_refused(void **state)
{
    (void)state;
    const fovea_stamp_t stamp = {.time_ns = 0};
    for (int kind = 0; kind < FOVEA_SAMPLE_KIND_COUNT; kind++) {
        uint8_t data[256];
        char expected[64];
        struct fovea_sample sample, found;
        struct fovea_error error;
        make(&sample, kind);
        const uint32_t last = fovea_sample_value_count(sample.kind) - 1;
        sample.any.values[last] = (double)NAN;
        const uint32_t bytes = fv_message_sample_encode(&sample, &stamp, data, sizeof data);
        struct fv_lcmlog_event event = event_of(data, bytes);
        const bool judged = kind == FOVEA_SAMPLE_IMU; /* by the step */
        assert_int_equal(fv_lcmlog_sample("log", &event, &found, &error),
                         judged ? FOVEA_OK : FOVEA_ERROR_INPUT);
        snprintf(expected, sizeof expected, "log: byte %zu: found a sample with a number that",
                 1000 + FV_LCMLOG_HEADER_BYTES + strlen("ANY") + 34 + 8 * (size_t)last);
        if (judged)
            assert_true(isnan(found.any.values[last]));
        else if (strstr(error.text, expected) == NULL)
            fail_msg("%s", error.text);
        for (event.bytes = 0; event.bytes < bytes; event.bytes++) {
            assert_int_equal(fv_lcmlog_sample("log", &event, &found, &error), FOVEA_ERROR_INPUT);
            assert_non_null(strstr(error.text, names[kind]));
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_type_is_a_stamp_and_the_doubles_of_its_struct),
        cmocka_unit_test(every_kind_has_a_channel_of_its_own),
        cmocka_unit_test(samples_come_back_with_every_bit),
        cmocka_unit_test(samples_that_hold_no_number_or_are_cut_off_are_refused),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
