/* The field table against lcm-gen: same hashes, same bytes for every type; damage is seen and
 * named. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fovea/fields.h"
#include "message/fields.h"

#include "fovea_types.h"

/* Decode with the generated code, encode again: the bytes written, or -1. */
#define ROUND_TRIP(T)                                                                              \
    static int round_trip_##T(const uint8_t *in, size_t bytes, uint8_t *out, size_t capacity)      \
    {                                                                                              \
        T message;                                                                                 \
        memset(&message, 0, sizeof message);                                                       \
        int used = T##_decode(in, 0, (int)bytes, &message);                                        \
        int written = used == (int)bytes ? T##_encode(out, 0, (int)capacity, &message) : -1;       \
        if (written >= 0) assert_int_equal(written, T##_encoded_size(&message));                   \
        T##_decode_cleanup(&message);                                                              \
        return written;                                                                            \
    }
FV_EVERY_TYPE(ROUND_TRIP)

static const struct {
    int64_t (*hash)(void);
    int (*round_trip)(const uint8_t *, size_t, uint8_t *, size_t);
} trips[] = {
#define ROW(T) {__##T##_get_hash, round_trip_##T},
    FV_EVERY_TYPE(ROW)};

static uint64_t seed = 1;
static uint32_t draw(uint32_t below)
{
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(seed >> 33) % below;
}

/* lcm-gen's hash, from its description: member names, types of primitives, dimensions; nested
 * hashes are added. */
static int64_t update(int64_t hash, int c)
{
    return (int64_t)((((uint64_t)hash << 8) ^ (uint64_t)(hash >> 55)) + (uint64_t)(int64_t)c);
}
static int64_t update_text(int64_t hash, const char *text)
{
    hash = update(hash, (int)strlen(text));
    for (; *text; text++)
        hash = update(hash, *text);
    return hash;
}
static uint64_t hash_of(const struct fovea_type *types, const struct fovea_type *type)
{
    static const char *const names[] = {"int8_t",  "byte",  "boolean", "int16_t", "int32_t",
                                        "int64_t", "float", "double",  "string"};
    int64_t own = 0x12345678;
    uint64_t nested = 0;
    for (int i = 0; i < type->field_count; i++) {
        const struct fv_field *field = &type->fields[i];
        own = update_text(own, field->name);
        if (field->wire == FOVEA_WIRE_STRUCT)
            nested += hash_of(types, &types[field->nested]);
        else
            own = update_text(own, names[field->wire]);
        own = update(own, field->row > 0 ? 2 : field->array);
        char count[16];
        if (field->array) {
            snprintf(count, sizeof count, "%d", (int)field->count);
            own = update(own, field->count_field >= 0);
            own = update_text(own, field->count_field >= 0 ? type->fields[field->count_field].name
                                                           : count);
        }
        if (field->row > 0) {
            snprintf(count, sizeof count, "%d", (int)field->row);
            own = update_text(update(own, 0), count);
        }
    }
    uint64_t sum = (uint64_t)own + nested;
    return (sum << 1) + (sum >> 63);
}

static void test_hashes(void **state)
{
    (void)state;
    int32_t count;
    const struct fovea_type *types = fv_message_types(&count);
    assert_int_equal(count, sizeof trips / sizeof trips[0]);
    for (int i = 0; i < count; i++)
        if (hash_of(types, &types[i]) != (uint64_t)types[i].hash())
            fail_msg("%s: the table's hash is not lcm-gen's", types[i].name);
}

static void put(uint8_t *out, size_t *at, uint64_t value, int bytes)
{
    for (int i = bytes - 1; i >= 0; i--)
        out[(*at)++] = (uint8_t)(value >> (8 * i));
}

/* A random message of a type, made from the table alone. */
static void make(const struct fovea_type *types, const struct fovea_type *type, uint8_t *out,
                 size_t *at)
{
    static const int sizes[] = {1, 1, 1, 2, 4, 8, 4, 8};
    int32_t counts[FOVEA_FIELDS_MAX] = {0};
    for (int i = 0; i < type->field_count; i++) {
        const struct fv_field *field = &type->fields[i];
        bool counts_others = false;
        for (int j = 0; j < type->field_count; j++)
            counts_others |= type->fields[j].count_field == i;
        int32_t count = field->count_field >= 0 ? counts[field->count_field] : field->count;
        if (field->row > 0) count *= field->row;
        for (int32_t element = 0; element < count; element++) {
            if (field->wire == FOVEA_WIRE_STRUCT) {
                make(types, &types[field->nested], out, at);
            } else if (field->wire == FOVEA_WIRE_STRING) {
                uint32_t length = draw(9);
                put(out, at, length + 1, 4);
                for (uint32_t c = 0; c < length; c++)
                    put(out, at, 'a' + draw(26), 1);
                put(out, at, 0, 1);
            } else {
                uint64_t value = (uint64_t)draw(1u << 31) << 40 ^ (uint64_t)draw(1u << 31) << 20 ^
                                 draw(1u << 31);
                if (counts_others) value = (uint64_t)(counts[i] = (int32_t)draw(6));
                put(out, at, value, sizes[field->wire]);
            }
        }
    }
}

static size_t make_message(const struct fovea_type *types, const struct fovea_type *type,
                           uint8_t *out)
{
    size_t at = 0;
    put(out, &at, (uint64_t)type->hash(), 8);
    make(types, type, out, &at);
    return at;
}

static void test_round_trips(void **state)
{
    (void)state;
    static uint8_t in[1 << 16], out[1 << 16];
    int32_t count;
    const struct fovea_type *types = fv_message_types(&count);
    for (int i = 0; i < count; i++)
        for (int round = 0; round < 200; round++) {
            size_t bytes = make_message(types, &types[i], in), at;
            const char *why;
            if (!fv_message_check(types[i].name, in, bytes, &why, &at))
                fail_msg("%s: byte %zu: %s", types[i].name, at, why);
            int found = -1;
            for (int32_t t = 0; t < count; t++)
                if (trips[t].hash == types[i].hash)
                    found = trips[t].round_trip(in, bytes, out, sizeof out);
            assert_int_equal(found, bytes);
            assert_memory_equal(in, out, bytes);
            struct fv_difference difference;
            assert_true(fv_message_compare(in, bytes, out, bytes, &difference));
        }
}

/* Whatever passes the check must be safe for the generated decoder; what fails must be named. */
static void test_damage(void **state)
{
    (void)state;
    static uint8_t whole[1 << 16], out[1 << 16];
    static char text[1 << 12];
    int32_t count;
    const struct fovea_type *types = fv_message_types(&count);
    uint32_t refused = 0, passed = 0;
    for (int round = 0; round < 20000; round++) {
        int which = (int)draw((uint32_t)count);
        size_t bytes = make_message(types, &types[which], whole), cut = bytes, at = 0;
        for (uint32_t flips = draw(3); flips > 0; flips--)
            whole[8 + draw((uint32_t)bytes - 8)] ^= (uint8_t)(1u << draw(8));
        if (draw(3) == 0) cut = draw((uint32_t)bytes);
        uint8_t *exact = malloc(cut > 0 ? cut : 1); /* so that sanitizers see an over-read */
        memcpy(exact, whole, cut);
        const char *why = NULL;
        size_t length;
        const bool whole_message = fv_message_check(types[which].name, exact, cut, &why, &at);
        assert_int_equal(fovea_message_json(exact, cut, text, sizeof text, &length, NULL),
                         whole_message ? FOVEA_OK : FOVEA_ERROR_INPUT);
        if (whole_message) {
            for (int32_t t = 0; t < count; t++)
                if (trips[t].hash == types[which].hash)
                    assert_int_equal(trips[t].round_trip(exact, cut, out, sizeof out), cut);
            passed++;
        } else {
            assert_non_null(why);
            assert_true(at <= cut);
            refused++;
        }
        free(exact);
    }
    assert_true(refused > 1000 && passed > 1000);
}

static void test_first_difference(void **state)
{
    (void)state;
    float p[3][2] = {{1.0f, 4.0f}, {2.0f, 5.0f}, {3.0f, 6.0f}}, size[3] = {7.0f, 7.0f, 7.0f};
    float *rows[3] = {p[0], p[1], p[2]};
    float orientation[3] = {0}, response[3] = {20.0f, 30.0f, 40.0f};
    uint8_t level[3] = {0, 1, 2}, a[512], b[512];
    fovea_features_t message = {.method = (char *)"fast",
                                .count = 3,
                                .p_px = rows,
                                .size_px = size,
                                .orientation = orientation,
                                .response = response,
                                .level = level};
    message.stamp.sequence = 41;
    int bytes = fovea_features_t_encode(a, 0, sizeof a, &message);
    struct fv_difference difference;

    p[1][1] = 5.5f;
    level[2] = 41;
    assert_int_equal(fovea_features_t_encode(b, 0, sizeof b, &message), bytes);
    assert_false(fv_message_compare(a, (size_t)bytes, b, (size_t)bytes, &difference));
    assert_string_equal(difference.field, "p_px[1][1]");
    assert_string_equal(difference.expected, "5 (40a00000)");
    assert_string_equal(difference.found, "5.5 (40b00000)");

    message.stamp.sequence = 42;
    message.count = 2;
    int shorter = fovea_features_t_encode(b, 0, sizeof b, &message);
    assert_false(fv_message_compare(a, (size_t)bytes, b, (size_t)shorter, &difference));
    assert_string_equal(difference.field, "stamp.sequence");
    assert_string_equal(difference.expected, "41");
    assert_string_equal(difference.found, "42");

    fovea_recording_part_t parts[2] = {{.name = (char *)"configuration", .origin = (char *)"a"},
                                       {.name = (char *)"mask", .origin = (char *)"b"}};
    fovea_recording_t recording = {.version = (char *)"1",
                                   .machine = (char *)"m",
                                   .kernel_set = (char *)"c",
                                   .source = (char *)"s",
                                   .channel_prefix = (char *)"F",
                                   .part_count = 2,
                                   .parts = parts};
    bytes = fovea_recording_t_encode(a, 0, sizeof a, &recording);
    parts[1].origin = (char *)"c";
    assert_int_equal(fovea_recording_t_encode(b, 0, sizeof b, &recording), bytes);
    assert_false(fv_message_compare(a, (size_t)bytes, b, (size_t)bytes, &difference));
    assert_string_equal(difference.field, "parts[1].origin");
    assert_string_equal(difference.expected, "\"b\"");
    assert_string_equal(difference.found, "\"c\"");

    assert_false(fv_message_compare(a, (size_t)bytes, b, 8, &difference)); /* cut off */
    assert_string_equal(difference.expected, "a field");
    b[0] ^= 1;
    assert_false(fv_message_compare(a, (size_t)bytes, b, (size_t)bytes, &difference));
    assert_string_equal(difference.expected, "fovea.recording_t");
    assert_string_equal(difference.found, "an unknown type");
}

/* Clock readings, version and kernel set of the statistics may differ; all else of them, and a
 * field of such a name in another message, may not. */
static void test_volatile_fields(void **state)
{
    (void)state;
    fovea_stage_t stages[2] = {{.name = (char *)"one", .cpu_ns = 1, .wall_ns = 3},
                               {.name = (char *)"two", .cpu_ns = 2, .wall_ns = 4}};
    uint8_t a[512], b[512];
    fovea_statistics_t message = {.version = (char *)"1",
                                  .kernel_set = (char *)"c",
                                  .stage_count = 2,
                                  .stages = stages,
                                  .features = 5};
    struct fv_difference difference;
    const int bytes = fovea_statistics_t_encode(a, 0, sizeof a, &message);
    assert_true(bytes > 0);
    message.version = (char *)"1.1";
    message.kernel_set = (char *)"avx2";
    stages[0].cpu_ns = stages[1].wall_ns = 9;
    const int longer = fovea_statistics_t_encode(b, 0, sizeof b, &message);
    assert_true(fv_message_compare(a, (size_t)bytes, b, (size_t)longer, &difference));
    stages[1].name = (char *)"too";
    assert_int_equal(fovea_statistics_t_encode(b, 0, sizeof b, &message), longer);
    assert_false(fv_message_compare(a, (size_t)bytes, b, (size_t)longer, &difference));
    assert_string_equal(difference.field, "stages[1].name");
    message.features = 6;
    assert_int_equal(fovea_statistics_t_encode(b, 0, sizeof b, &message), longer);
    assert_false(fv_message_compare(a, (size_t)bytes, b, (size_t)longer, &difference));
    assert_string_equal(difference.field, "features");
    message.features = 5;
    stages[1].name = (char *)"two";
    message.version = (char *)"2";
    message.kernel_set = (char *)"c";
    assert_int_equal(fovea_statistics_t_encode(b, 0, sizeof b, &message), bytes);
    assert_true(fv_message_compare(a, (size_t)bytes, b, (size_t)bytes, &difference));
    assert_false(
        fv_message_compare(a, (size_t)bytes - 1, b, (size_t)bytes - 1, &difference)); /* cut off */

    fovea_recording_t recording = {.version = (char *)"1",
                                   .machine = (char *)"m",
                                   .kernel_set = (char *)"c",
                                   .source = (char *)"s",
                                   .channel_prefix = (char *)"F"};
    const int first = fovea_recording_t_encode(a, 0, sizeof a, &recording);
    recording.version = (char *)"2";
    assert_int_equal(fovea_recording_t_encode(b, 0, sizeof b, &recording), first);
    assert_false(fv_message_compare(a, (size_t)first, b, (size_t)first, &difference));
    assert_string_equal(difference.field, "version");
}

/* What clocks and processes measure may differ between two runs, nested or not; in a replay, where
 * it is recorded, it may not. */
static void test_measured_fields(void **state)
{
    (void)state;
    uint8_t a[1024], b[1024];
    struct fv_difference difference;
    fovea_pose_t pose = {.parent_frame = (char *)"odom", .child_frame = (char *)"body"};
    const int bytes = fovea_pose_t_encode(a, 0, sizeof a, &pose);
    assert_true(bytes > 0);
    pose.latency_ns = 110;
    pose.stamp.utc_offset_ns = 7;
    assert_int_equal(fovea_pose_t_encode(b, 0, sizeof b, &pose), bytes);
    assert_true(fv_message_compare_runs(a, (size_t)bytes, b, (size_t)bytes, &difference));
    assert_false(fv_message_compare(a, (size_t)bytes, b, (size_t)bytes, &difference));
    assert_string_equal(difference.field, "stamp.utc_offset_ns");
    pose.stamp.time_ns = 1;
    assert_int_equal(fovea_pose_t_encode(b, 0, sizeof b, &pose), bytes);
    assert_false(fv_message_compare_runs(a, (size_t)bytes, b, (size_t)bytes, &difference));
    assert_string_equal(difference.field, "stamp.time_ns");

    fovea_inputs_t inputs = {.has_frame = 1};
    const int input = fovea_inputs_t_encode(a, 0, sizeof a, &inputs);
    assert_true(input > 0);
    inputs.utc_offset_ns = inputs.latency_ns = inputs.frames_late = inputs.resident_bytes = 9;
    inputs.temperature_c = 50;
    assert_int_equal(fovea_inputs_t_encode(b, 0, sizeof b, &inputs), input);
    assert_true(fv_message_compare_runs(a, (size_t)input, b, (size_t)input, &difference));
    assert_false(fv_message_compare(a, (size_t)input, b, (size_t)input, &difference));
    inputs.features = 3;
    assert_int_equal(fovea_inputs_t_encode(b, 0, sizeof b, &inputs), input);
    assert_false(fv_message_compare_runs(a, (size_t)input, b, (size_t)input, &difference));
    assert_string_equal(difference.field, "features");

    fovea_statistics_t statistics = {.version = (char *)"1", .kernel_set = (char *)"c"};
    const int counts = fovea_statistics_t_encode(a, 0, sizeof a, &statistics);
    assert_true(counts > 0);
    statistics.version = (char *)"2";
    statistics.latency_ns = statistics.frames_late = statistics.resident_bytes = 9;
    statistics.temperature_c = 50;
    assert_int_equal(fovea_statistics_t_encode(b, 0, sizeof b, &statistics), counts);
    assert_true(fv_message_compare_runs(a, (size_t)counts, b, (size_t)counts, &difference));
    statistics.frames_in = 1;
    assert_int_equal(fovea_statistics_t_encode(b, 0, sizeof b, &statistics), counts);
    assert_false(fv_message_compare_runs(a, (size_t)counts, b, (size_t)counts, &difference));
    assert_string_equal(difference.field, "frames_in");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_hashes),          cmocka_unit_test(test_round_trips),
        cmocka_unit_test(test_damage),          cmocka_unit_test(test_first_difference),
        cmocka_unit_test(test_volatile_fields), cmocka_unit_test(test_measured_fields),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
