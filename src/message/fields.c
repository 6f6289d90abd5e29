#include "message/fields.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "message/wire.h"

#include "fovea_fields.h"

enum { TYPE_COUNT = (int)(sizeof fv_types / sizeof fv_types[0]) };

static const uint8_t wire_bytes[] = {
    [FOVEA_WIRE_INT8] = 1,  [FOVEA_WIRE_BYTE] = 1,   [FOVEA_WIRE_BOOLEAN] = 1,
    [FOVEA_WIRE_INT16] = 2, [FOVEA_WIRE_INT32] = 4,  [FOVEA_WIRE_INT64] = 8,
    [FOVEA_WIRE_FLOAT] = 4, [FOVEA_WIRE_DOUBLE] = 8,
};

const struct fovea_type *fv_message_types(int32_t *count)
{
    *count = TYPE_COUNT;
    return fv_types;
}

static int64_t read_integer(enum fovea_wire wire, const uint8_t *data)
{
    uint64_t value = fv_wire_read(data, wire_bytes[wire]);
    switch (wire) {
    case FOVEA_WIRE_INT8:
        return (int8_t)value;
    case FOVEA_WIRE_INT16:
        return (int16_t)value;
    case FOVEA_WIRE_INT32:
        return (int32_t)value;
    default:
        return (int64_t)value;
    }
}

const struct fovea_type *fv_message_type_of(const uint8_t *data, size_t bytes)
{
    if (bytes < 8) return NULL;
    int64_t hash = (int64_t)fv_wire_read(data, 8);
    for (int i = 0; i < TYPE_COUNT; i++)
        if (fv_types[i].hash() == hash) return &fv_types[i];
    return NULL;
}

/* ---- walking --------------------------------------------------------------------------------- */

static enum fovea_status problem(struct fovea_fields *walk, const char *text)
{
    walk->problem = text;
    return FOVEA_ERROR_INPUT;
}

enum fovea_status fovea_fields_begin(struct fovea_fields *fields, const uint8_t *data, size_t bytes)
{
    const struct fovea_type *type = fv_message_type_of(data, bytes);
    memset(fields, 0, sizeof *fields);
    fields->data = data;
    fields->bytes = bytes;
    if (type == NULL) return problem(fields, "of no known type");
    fields->at = 8; /* the hash */
    fields->level[0].type = type;
    return FOVEA_OK;
}

/* "parts[2].name" from the levels down to the present field. */
static void write_path(const struct fovea_fields *walk, char *path)
{
    int used = 0;
    for (int i = 0; i <= walk->depth && used < FOVEA_FIELD_PATH_BYTES; i++) {
        const struct fv_field *field = &walk->level[i].type->fields[walk->level[i].field];
        bool number =
            field->array && (field->wire == FOVEA_WIRE_STRUCT || field->wire == FOVEA_WIRE_STRING);
        used += snprintf(path + used, (size_t)(FOVEA_FIELD_PATH_BYTES - used), "%s%s",
                         i > 0 ? "." : "", field->name);
        if (number && used < FOVEA_FIELD_PATH_BYTES)
            used += snprintf(path + used, (size_t)(FOVEA_FIELD_PATH_BYTES - used), "[%" PRId32 "]",
                             walk->level[i].element);
    }
}

static enum fovea_status read_string(struct fovea_fields *walk, struct fovea_field *leaf)
{
    if (walk->bytes - walk->at < 4) return problem(walk, "a string's length is cut off");
    uint64_t length = fv_wire_read(walk->data + walk->at, 4);
    if (length < 1 || length > walk->bytes - walk->at - 4)
        return problem(walk, "a string's length does not fit the message");
    leaf->data = walk->data + walk->at + 4;
    if (memchr(leaf->data, 0, length) != leaf->data + length - 1)
        return problem(walk, "a string does not end in its only zero");
    leaf->offset = walk->at + 4;
    leaf->bytes = (uint32_t)length;
    leaf->count = 1;
    leaf->row = 0;
    walk->at += 4 + length;
    walk->level[walk->depth].element++;
    return FOVEA_OK;
}

static enum fovea_status read_numbers(struct fovea_fields *walk, const struct fv_field *field,
                                      int32_t count, struct fovea_field *leaf)
{
    const uint64_t numbers = (uint64_t)count * (field->row > 0 ? (uint64_t)field->row : 1);
    const uint64_t bytes = numbers * wire_bytes[field->wire];
    if (bytes > walk->bytes - walk->at)
        return problem(walk, "a field reaches past the end of the message");
    leaf->data = walk->data + walk->at;
    leaf->offset = walk->at;
    leaf->bytes = (uint32_t)bytes;
    leaf->count = (uint32_t)numbers;
    leaf->row = (uint32_t)field->row;
    if (!field->array && field->wire < FOVEA_WIRE_FLOAT) {
        int64_t value = read_integer(field->wire, leaf->data);
        bool fits = value >= 0 && value <= INT32_MAX;
        walk->level[walk->depth].values[walk->level[walk->depth].field] =
            fits ? (int32_t)value : -1;
    }
    walk->at += bytes;
    walk->level[walk->depth].field++;
    return FOVEA_OK;
}

enum fovea_status fovea_fields_next(struct fovea_fields *walk, struct fovea_field *leaf)
{
    if (walk->problem != NULL) return FOVEA_ERROR_INPUT;
    for (;;) { /* every iteration consumes bytes, ends a field, or ends a struct */
        const struct fovea_type *type = walk->level[walk->depth].type;
        int32_t *field_number = &walk->level[walk->depth].field,
                *element = &walk->level[walk->depth].element;
        if (*field_number == type->field_count) {
            if (walk->depth == 0)
                return walk->at == walk->bytes ? FOVEA_END
                                               : problem(walk, "bytes follow the last field");
            walk->depth--;
            walk->level[walk->depth].element++;
            continue;
        }
        const struct fv_field *field = &type->fields[*field_number];
        int32_t count = field->count_field < 0
                            ? field->count
                            : walk->level[walk->depth].values[field->count_field];
        if (count < 0) return problem(walk, "a count is negative");
        bool numbers = field->wire != FOVEA_WIRE_STRING && field->wire != FOVEA_WIRE_STRUCT;
        if (!numbers && *element == count) {
            (*field_number)++;
            *element = 0;
            continue;
        }
        if (field->wire == FOVEA_WIRE_STRUCT) {
            if (walk->depth + 1 == FOVEA_NESTING_MAX) return problem(walk, "types nest too deep");
            if (walk->at == walk->bytes)
                return problem(walk, "a field reaches past the end of the message");
            walk->depth++;
            memset(&walk->level[walk->depth], 0, sizeof walk->level[0]);
            walk->level[walk->depth].type = &fv_types[field->nested];
            continue;
        }
        write_path(walk, leaf->path);
        leaf->wire = field->wire;
        return numbers ? read_numbers(walk, field, count, leaf) : read_string(walk, leaf);
    }
}

bool fv_message_check(const char *type, const uint8_t *data, size_t bytes, const char **why,
                      size_t *at)
{
    struct fovea_fields walk;
    struct fovea_field leaf;
    enum fovea_status status = fovea_fields_begin(&walk, data, bytes);
    if (status == FOVEA_OK && strcmp(walk.level[0].type->name, type) != 0) {
        *why = walk.level[0].type->name;
        *at = 0;
        return false;
    }
    while (status == FOVEA_OK)
        status = fovea_fields_next(&walk, &leaf);
    *why = walk.problem;
    *at = walk.at;
    return status == FOVEA_END;
}

static double double_of(enum fovea_wire wire, const uint8_t *data)
{
    const uint64_t bits = fv_wire_read(data, wire_bytes[wire]);
    const uint32_t low = (uint32_t)bits;
    float single;
    double twice;
    memcpy(&single, &low, sizeof single);
    memcpy(&twice, &bits, sizeof twice);
    return wire == FOVEA_WIRE_FLOAT ? (double)single : twice;
}

double fovea_field_number(const struct fovea_field *field, uint32_t i)
{
    if (field->wire >= FOVEA_WIRE_STRING || i >= field->count) return 0.0;
    const uint8_t *data = field->data + (size_t)i * wire_bytes[field->wire];
    return field->wire >= FOVEA_WIRE_FLOAT ? double_of(field->wire, data)
                                           : (double)read_integer(field->wire, data);
}

int64_t fovea_field_integer(const struct fovea_field *field, uint32_t i)
{
    if (field->wire >= FOVEA_WIRE_STRING || i >= field->count) return 0;
    const uint8_t *data = field->data + (size_t)i * wire_bytes[field->wire];
    if (field->wire < FOVEA_WIRE_FLOAT) return read_integer(field->wire, data);
    const double value = double_of(field->wire, data), limit = 9223372036854775808.0;
    return value >= -limit && value < limit ? (int64_t)value : 0;
}

/* ---- comparing ------------------------------------------------------------------------------- */

/* Whether a field describes the moment or the machine, not the run, so that another run of the same
 * inputs fills it otherwise: the readings of clocks in fovea.statistics_t, its version and its
 * kernel set. `path` as in struct fovea_field. */
static bool is_volatile(const struct fovea_type *type, const char *path)
{
    if (strcmp(type->name, "fovea.statistics_t") != 0) return false;
    const char *of_stage = strncmp(path, "stages[", 7) == 0 ? strchr(path, '.') : NULL;
    if (of_stage != NULL)
        return strcmp(of_stage, ".cpu_ns") == 0 || strcmp(of_stage, ".wall_ns") == 0;
    return strcmp(path, "version") == 0 || strcmp(path, "kernel_set") == 0;
}

/* Whether a field holds what clocks or the process measured, by the last name of its path. */
static bool is_measured(const char *path)
{
    static const char *const names[] = {"latency_ns",  "utc_offset_ns",  "utime",
                                        "frames_late", "resident_bytes", "temperature_c"};
    const char *last = path;
    for (const char *dot = path; (dot = strchr(dot, '.')) != NULL; dot++)
        last = dot + 1;
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (strcmp(last, names[i]) == 0) return true;
    return false;
}

static void write_value(const struct fovea_field *leaf, uint32_t element, char *text)
{
    const uint8_t *data =
        leaf->data +
        (size_t)element * (leaf->wire == FOVEA_WIRE_STRING ? 0 : wire_bytes[leaf->wire]);
    switch (leaf->wire) {
    case FOVEA_WIRE_STRING:
        snprintf(text, FV_FIELD_VALUE_BYTES, "\"%.56s\"", (const char *)data);
        break;
    case FOVEA_WIRE_FLOAT:
        snprintf(text, FV_FIELD_VALUE_BYTES, "%.9g (%08" PRIx64 ")", double_of(leaf->wire, data),
                 fv_wire_read(data, 4));
        break;
    case FOVEA_WIRE_DOUBLE:
        snprintf(text, FV_FIELD_VALUE_BYTES, "%.17g (%016" PRIx64 ")", double_of(leaf->wire, data),
                 fv_wire_read(data, 8));
        break;
    case FOVEA_WIRE_BYTE:
        snprintf(text, FV_FIELD_VALUE_BYTES, "%u", data[0]);
        break;
    default:
        snprintf(text, FV_FIELD_VALUE_BYTES, "%" PRId64, read_integer(leaf->wire, data));
        break;
    }
}

/* Name the first element that differs between two leaves of the same path. False: none does. */
static bool leaves_differ(const struct fovea_field *expected, const struct fovea_field *found,
                          struct fv_difference *difference)
{
    if (expected->bytes == found->bytes && memcmp(expected->data, found->data, found->bytes) == 0)
        return false;
    uint32_t element = 0,
             step = expected->wire == FOVEA_WIRE_STRING ? 0 : wire_bytes[expected->wire];
    while (step > 0 &&
           memcmp(expected->data + element * step, found->data + element * step, step) == 0)
        element++;
    if (expected->row > 0)
        snprintf(difference->field, FOVEA_FIELD_PATH_BYTES, "%.70s[%" PRIu32 "][%" PRIu32 "]",
                 expected->path, element / expected->row, element % expected->row);
    else if (expected->count > 1)
        snprintf(difference->field, FOVEA_FIELD_PATH_BYTES, "%.80s[%" PRIu32 "]", expected->path,
                 element);
    else
        memcpy(difference->field, expected->path, FOVEA_FIELD_PATH_BYTES);
    write_value(expected, element, difference->expected);
    write_value(found, element, difference->found);
    return true;
}

static void describe(enum fovea_status status, const struct fovea_fields *walk, char *text)
{
    snprintf(text, FV_FIELD_VALUE_BYTES, "%s",
             status == FOVEA_OK    ? "a field"
             : status == FOVEA_END ? "end"
                                   : walk->problem);
}

static bool compare(const uint8_t *expected, size_t expected_bytes, const uint8_t *found,
                    size_t found_bytes, bool measured, struct fv_difference *difference)
{
    memset(difference, 0, sizeof *difference);
    if (expected_bytes == found_bytes && memcmp(expected, found, found_bytes) == 0) return true;
    const struct fovea_type *type = fv_message_type_of(expected, expected_bytes);
    const struct fovea_type *found_type = fv_message_type_of(found, found_bytes);
    if (type == NULL || type != found_type) {
        snprintf(difference->expected, FV_FIELD_VALUE_BYTES, "%s",
                 type != NULL ? type->name : "an unknown type");
        snprintf(difference->found, FV_FIELD_VALUE_BYTES, "%s",
                 found_type != NULL ? found_type->name : "an unknown type");
        return false;
    }
    struct fovea_fields walks[2];
    struct fovea_field leaves[2];
    (void)fovea_fields_begin(&walks[0], expected, expected_bytes);
    (void)fovea_fields_begin(&walks[1], found, found_bytes);
    for (;;) {
        enum fovea_status first = fovea_fields_next(&walks[0], &leaves[0]);
        enum fovea_status second = fovea_fields_next(&walks[1], &leaves[1]);
        if (first == FOVEA_OK && second == FOVEA_OK) {
            if (is_volatile(type, leaves[0].path)) continue;
            if (!measured && is_measured(leaves[0].path)) continue;
            if (leaves_differ(&leaves[0], &leaves[1], difference)) return false;
            continue;
        }
        if (first == FOVEA_END && second == FOVEA_END) return true;
        describe(first, &walks[0], difference->expected);
        describe(second, &walks[1], difference->found);
        return false;
    }
}

bool fv_message_compare(const uint8_t *expected, size_t expected_bytes, const uint8_t *found,
                        size_t found_bytes, struct fv_difference *difference)
{
    return compare(expected, expected_bytes, found, found_bytes, true, difference);
}

bool fv_message_compare_runs(const uint8_t *expected, size_t expected_bytes, const uint8_t *found,
                             size_t found_bytes, struct fv_difference *difference)
{
    return compare(expected, expected_bytes, found, found_bytes, false, difference);
}
