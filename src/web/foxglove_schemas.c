#include "web/foxglove_schemas.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "web/protobuf.h"

/* Numbers of FieldDescriptorProto.Type (protobuf.dev, descriptor.proto). */
enum type {
    DOUBLE = 1,
    INT64 = 3,
    INT32 = 5,
    FIXED32 = 7,
    TEXT = 9,
    MESSAGE = 11,
    BYTES = 12,
    ENUMERATION = 14
};
enum { OPTIONAL = 1, REPEATED = 3 };

enum { FIELDS_MAX = 9, VALUES_MAX = 9, MESSAGES_MAX = 24 };

struct field {
    const char *name;
    uint8_t number, type, label;
    const char *of; /* the message or enumeration */
};

struct message {
    const char *name; /* with its package */
    struct field fields[FIELDS_MAX + 1];
    const char *enumeration; /* inside it; NULL: none */
    const char *values[VALUES_MAX + 1];
};

#define FOXGLOVE "foxglove."
#define TIMESTAMP "google.protobuf.Timestamp"
#define FIELD(name, number, type, label, of)                                                       \
    {                                                                                              \
        name, number, type, label, of                                                              \
    }
#define ONE(name, number, type) FIELD(name, number, type, OPTIONAL, NULL)
#define TIME(number) FIELD("timestamp", number, MESSAGE, OPTIONAL, TIMESTAMP)
#define OF(name, number, of) FIELD(name, number, MESSAGE, OPTIONAL, FOXGLOVE of)
#define MANY(name, number, of) FIELD(name, number, MESSAGE, REPEATED, FOXGLOVE of)
#define KIND(name, number, of) FIELD(name, number, ENUMERATION, OPTIONAL, FOXGLOVE of)

static const struct message timestamp = {
    TIMESTAMP, {ONE("seconds", 1, INT64), ONE("nanos", 2, INT32)}, NULL, {NULL}};

/* Those that are shown first, in the order of enum fv_foxglove_schema. */
static const struct message messages[] = {
    {FOXGLOVE "CompressedImage",
     {TIME(1), ONE("frame_id", 4, TEXT), ONE("data", 2, BYTES), ONE("format", 3, TEXT)},
     NULL,
     {NULL}},
    {FOXGLOVE "ImageAnnotations",
     {TIME(5), MANY("circles", 1, "CircleAnnotation"), MANY("points", 2, "PointsAnnotation"),
      MANY("texts", 3, "TextAnnotation"), MANY("metadata", 4, "KeyValuePair")},
     NULL,
     {NULL}},
    {FOXGLOVE "PoseInFrame",
     {TIME(1), ONE("frame_id", 2, TEXT), OF("pose", 3, "Pose")},
     NULL,
     {NULL}},
    {FOXGLOVE "FrameTransforms", {MANY("transforms", 1, "FrameTransform")}, NULL, {NULL}},
    {FOXGLOVE "PointCloud",
     {TIME(1), ONE("frame_id", 2, TEXT), OF("pose", 3, "Pose"), ONE("point_stride", 4, FIXED32),
      MANY("fields", 5, "PackedElementField"), ONE("data", 6, BYTES)},
     NULL,
     {NULL}},
    {FOXGLOVE "Grid",
     {TIME(1), ONE("frame_id", 2, TEXT), OF("pose", 3, "Pose"), ONE("column_count", 4, FIXED32),
      OF("cell_size", 5, "Vector2"), ONE("row_stride", 6, FIXED32), ONE("cell_stride", 7, FIXED32),
      MANY("fields", 8, "PackedElementField"), ONE("data", 9, BYTES)},
     NULL,
     {NULL}},
    {FOXGLOVE "Log",
     {TIME(1), KIND("level", 2, "Log.Level"), ONE("message", 3, TEXT), ONE("name", 4, TEXT),
      ONE("file", 5, TEXT), ONE("line", 6, FIXED32)},
     "Level",
     {"UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"}},
    {FOXGLOVE "CircleAnnotation",
     {TIME(1), OF("position", 2, "Point2"), ONE("diameter", 3, DOUBLE), ONE("thickness", 4, DOUBLE),
      OF("fill_color", 5, "Color"), OF("outline_color", 6, "Color"),
      MANY("metadata", 7, "KeyValuePair")},
     NULL,
     {NULL}},
    {FOXGLOVE "PointsAnnotation",
     {TIME(1), KIND("type", 2, "PointsAnnotation.Type"), MANY("points", 3, "Point2"),
      OF("outline_color", 4, "Color"), MANY("outline_colors", 5, "Color"),
      OF("fill_color", 6, "Color"), ONE("thickness", 7, DOUBLE),
      MANY("metadata", 8, "KeyValuePair")},
     "Type",
     {"UNKNOWN", "POINTS", "LINE_LOOP", "LINE_STRIP", "LINE_LIST"}},
    {FOXGLOVE "TextAnnotation",
     {TIME(1), OF("position", 2, "Point2"), ONE("text", 3, TEXT), ONE("font_size", 4, DOUBLE),
      OF("text_color", 5, "Color"), OF("background_color", 6, "Color"),
      MANY("metadata", 7, "KeyValuePair")},
     NULL,
     {NULL}},
    {FOXGLOVE "KeyValuePair", {ONE("key", 1, TEXT), ONE("value", 2, TEXT)}, NULL, {NULL}},
    {FOXGLOVE "Point2", {ONE("x", 1, DOUBLE), ONE("y", 2, DOUBLE)}, NULL, {NULL}},
    {FOXGLOVE "Color",
     {ONE("r", 1, DOUBLE), ONE("g", 2, DOUBLE), ONE("b", 3, DOUBLE), ONE("a", 4, DOUBLE)},
     NULL,
     {NULL}},
    {FOXGLOVE "FrameTransform",
     {TIME(1), ONE("parent_frame_id", 2, TEXT), ONE("child_frame_id", 3, TEXT),
      OF("translation", 4, "Vector3"), OF("rotation", 5, "Quaternion")},
     NULL,
     {NULL}},
    {FOXGLOVE "Pose",
     {OF("position", 1, "Vector3"), OF("orientation", 2, "Quaternion")},
     NULL,
     {NULL}},
    {FOXGLOVE "Vector3",
     {ONE("x", 1, DOUBLE), ONE("y", 2, DOUBLE), ONE("z", 3, DOUBLE)},
     NULL,
     {NULL}},
    {FOXGLOVE "Vector2", {ONE("x", 1, DOUBLE), ONE("y", 2, DOUBLE)}, NULL, {NULL}},
    {FOXGLOVE "Quaternion",
     {ONE("x", 1, DOUBLE), ONE("y", 2, DOUBLE), ONE("z", 3, DOUBLE), ONE("w", 4, DOUBLE)},
     NULL,
     {NULL}},
    {FOXGLOVE "PackedElementField",
     {ONE("name", 1, TEXT), ONE("offset", 2, FIXED32),
      KIND("type", 3, "PackedElementField.NumericType")},
     "NumericType",
     {"UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64"}},
};
enum { MESSAGES = sizeof messages / sizeof messages[0] };
_Static_assert(sizeof messages / sizeof messages[0] <= MESSAGES_MAX, "a mark for each");

const char *fv_foxglove_schema_name(enum fv_foxglove_schema schema)
{
    return messages[schema].name;
}

/* Mark the message and those that its fields are of, which the table lists behind it or which were
 * marked from a later one: so often as there are messages, at most. */
static void mark_needed(int first, bool needed[MESSAGES_MAX])
{
    bool more = true;
    memset(needed, 0, MESSAGES_MAX * sizeof needed[0]);
    needed[first] = true;
    for (int round = 0; more && round < MESSAGES; round++) {
        more = false;
        for (int m = 0; m < MESSAGES; m++) {
            for (const struct field *field = messages[m].fields; needed[m] && field->name != NULL;
                 field++)
                for (int n = 0; field->type == MESSAGE && n < MESSAGES; n++) {
                    if (needed[n] || strcmp(field->of, messages[n].name) != 0) continue;
                    needed[n] = more = true;
                }
        }
    }
}

/* DescriptorProto and what is in it. */
static void put_field(struct fv_protobuf *to, const struct field *field)
{
    char of[64];
    const size_t begun = fv_protobuf_begin(to, 2);
    fv_protobuf_text(to, 1, field->name);
    fv_protobuf_number(to, 3, field->number);
    fv_protobuf_number(to, 4, field->label);
    fv_protobuf_number(to, 5, field->type);
    if (field->of != NULL) {
        snprintf(of, sizeof of, ".%s", field->of);
        fv_protobuf_text(to, 6, of);
    }
    fv_protobuf_end(to, begun);
}

static void put_message(struct fv_protobuf *to, const struct message *message)
{
    const size_t begun = fv_protobuf_begin(to, 4);
    fv_protobuf_text(to, 1, strrchr(message->name, '.') + 1);
    for (const struct field *field = message->fields; field->name != NULL; field++)
        put_field(to, field);
    if (message->enumeration != NULL) {
        const size_t enumeration = fv_protobuf_begin(to, 4);
        fv_protobuf_text(to, 1, message->enumeration);
        for (uint32_t i = 0; message->values[i] != NULL; i++) {
            const size_t value = fv_protobuf_begin(to, 2);
            fv_protobuf_text(to, 1, message->values[i]);
            fv_protobuf_number(to, 2, i);
            fv_protobuf_end(to, value);
        }
        fv_protobuf_end(to, enumeration);
    }
    fv_protobuf_end(to, begun);
}

size_t fv_foxglove_schema_describe(enum fv_foxglove_schema schema, uint8_t *data, size_t capacity)
{
    struct fv_protobuf to = {.data = data, .capacity = capacity};
    bool needed[MESSAGES_MAX];
    mark_needed((int)schema, needed);
    size_t file = fv_protobuf_begin(&to, 1);
    fv_protobuf_text(&to, 1, "google/protobuf/timestamp.proto");
    fv_protobuf_text(&to, 2, "google.protobuf");
    put_message(&to, &timestamp);
    fv_protobuf_text(&to, 12, "proto3");
    fv_protobuf_end(&to, file);
    file = fv_protobuf_begin(&to, 1);
    fv_protobuf_text(&to, 1, fv_foxglove_schema_name(schema));
    fv_protobuf_text(&to, 2, "foxglove");
    fv_protobuf_text(&to, 3, "google/protobuf/timestamp.proto");
    for (int m = 0; m < MESSAGES; m++)
        if (needed[m]) put_message(&to, &messages[m]);
    fv_protobuf_text(&to, 12, "proto3");
    fv_protobuf_end(&to, file);
    return to.full ? 0 : to.bytes;
}
