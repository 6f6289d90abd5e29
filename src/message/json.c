/* Messages as JSON (fovea/fields.h). */
#include "fovea/fields.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "message/fields.h"
#include "message/wire.h"

/* Text of which the first `capacity` bytes are kept, the last of them for the zero. */
struct writer {
    char *text;
    size_t capacity, length;
};

static void put(struct writer *out, const char *text, size_t bytes)
{
    const size_t room = out->capacity > out->length + 1 ? out->capacity - out->length - 1 : 0;
    if (room > 0) memcpy(out->text + out->length, text, bytes < room ? bytes : room);
    out->length += bytes;
}

static void put_text(struct writer *out, const char *text)
{
    put(out, text, strlen(text));
}

/* Bytes of the letter of UTF-8 that begins here; 0: none does. */
static size_t letter_bytes(const uint8_t *at, size_t bytes)
{
    const size_t length = at[0] < 0x80                    ? 1
                          : at[0] >= 0xc2 && at[0] < 0xe0 ? 2
                          : at[0] >= 0xe0 && at[0] < 0xf0 ? 3
                          : at[0] >= 0xf0 && at[0] < 0xf5 ? 4
                                                          : 0;
    if (length > bytes) return 0;
    for (size_t i = 1; i < length; i++)
        if ((at[i] & 0xc0) != 0x80) return 0;
    /* Longer than need be, half of a surrogate pair, or beyond the last letter. */
    if (length == 3 && ((at[0] == 0xe0 && at[1] < 0xa0) || (at[0] == 0xed && at[1] >= 0xa0)))
        return 0;
    if (length == 4 && ((at[0] == 0xf0 && at[1] < 0x90) || (at[0] == 0xf4 && at[1] >= 0x90)))
        return 0;
    return length;
}

static void put_string(struct writer *out, const uint8_t *data, size_t bytes)
{
    put(out, "\"", 1);
    for (size_t i = 0; i < bytes;) {
        const size_t letter = letter_bytes(data + i, bytes - i);
        char escaped[8];
        if (letter == 0)
            put_text(out, "\\ufffd");
        else if (data[i] == '"' || data[i] == '\\')
            put(out, (const char[]){'\\', (char)data[i]}, 2);
        else if (data[i] < 0x20 || data[i] == 0x7f)
            put(out, escaped, (size_t)snprintf(escaped, sizeof escaped, "\\u%04x", data[i]));
        else
            put(out, (const char *)data + i, letter);
        i += letter > 0 ? letter : 1;
    }
    put(out, "\"", 1);
}

static const uint8_t sizes[] = {
    [FOVEA_WIRE_INT8] = 1,  [FOVEA_WIRE_BYTE] = 1,   [FOVEA_WIRE_BOOLEAN] = 1,
    [FOVEA_WIRE_INT16] = 2, [FOVEA_WIRE_INT32] = 4,  [FOVEA_WIRE_INT64] = 8,
    [FOVEA_WIRE_FLOAT] = 4, [FOVEA_WIRE_DOUBLE] = 8,
};

static int64_t integer_of(enum fovea_wire wire, uint64_t bits)
{
    switch (wire) {
    case FOVEA_WIRE_INT8:
        return (int8_t)bits;
    case FOVEA_WIRE_INT16:
        return (int16_t)bits;
    case FOVEA_WIRE_INT32:
        return (int32_t)bits;
    default:
        return (int64_t)bits;
    }
}

/* JSON's numbers have a point, printf's what the program's locale has there. Returns the bytes. */
static int with_point(char *text)
{
    int used = 0;
    for (const char *from = text; *from != '\0'; from++) {
        if ((*from >= '0' && *from <= '9') || *from == '-' || *from == '+' || *from == 'e')
            text[used++] = *from;
        else if (used == 0 || text[used - 1] != '.')
            text[used++] = '.';
    }
    text[used] = '\0';
    return used;
}

static void put_number(struct writer *out, enum fovea_wire wire, const uint8_t *data)
{
    const uint64_t bits = fv_wire_read(data, sizes[wire]);
    const uint32_t low = (uint32_t)bits;
    char text[32];
    double value = 0;
    float narrow;
    int used = 0;
    memcpy(&narrow, &low, sizeof narrow);
    if (wire == FOVEA_WIRE_FLOAT)
        value = (double)narrow;
    else if (wire == FOVEA_WIRE_DOUBLE)
        memcpy(&value, &bits, sizeof value);
    if (wire == FOVEA_WIRE_BOOLEAN)
        used = snprintf(text, sizeof text, "%s", bits != 0 ? "true" : "false");
    else if (__builtin_isnan(value))
        used = snprintf(text, sizeof text, "null");
    else if (__builtin_isinf(value))
        used = snprintf(text, sizeof text, "%s", value < 0 ? "-1e999" : "1e999");
    else if (wire == FOVEA_WIRE_FLOAT || wire == FOVEA_WIRE_DOUBLE) {
        snprintf(text, sizeof text, "%.*g", wire == FOVEA_WIRE_FLOAT ? 9 : 17, value);
        used = with_point(text);
    } else
        used = snprintf(text, sizeof text, "%" PRId64, integer_of(wire, bits));
    put(out, text, (size_t)used);
}

/* A message that was found well-formed, so that its lengths can be relied on. */
struct printing {
    struct writer out;
    const uint8_t *at;
    int32_t depth;
    struct {
        const struct fovea_type *type;
        int32_t field, element, count;
        bool open; /* the name of the field is written, its elements follow */
        int64_t values[FOVEA_FIELDS_MAX];
    } level[FOVEA_NESTING_MAX];
};

/* One number, one row of numbers or one string. */
static void put_element(struct printing *p, const struct fv_field *field)
{
    if (field->wire == FOVEA_WIRE_STRING) {
        const uint32_t bytes = (uint32_t)fv_wire_read(p->at, 4);
        put_string(&p->out, p->at + 4, bytes - 1);
        p->at += 4 + bytes;
        return;
    }
    if (field->row > 0) put(&p->out, "[", 1);
    for (int32_t i = 0; i < (field->row > 0 ? field->row : 1); i++, p->at += sizes[field->wire]) {
        if (i > 0) put(&p->out, ", ", 2);
        put_number(&p->out, field->wire, p->at);
    }
    if (field->row > 0) put(&p->out, "]", 1);
}

static void begin_struct(struct printing *p, const struct fovea_type *type)
{
    memset(&p->level[p->depth], 0, sizeof p->level[0]);
    p->level[p->depth].type = type;
    put(&p->out, "{", 1);
}

static void begin_field(struct printing *p, const struct fv_field *field)
{
    const int32_t number = p->level[p->depth].field;
    if (number > 0) put(&p->out, ", ", 2);
    put(&p->out, "\"", 1);
    put_text(&p->out, field->name);
    put_text(&p->out, field->array ? "\": [" : "\": ");
    p->level[p->depth].open = true;
    p->level[p->depth].element = 0;
    p->level[p->depth].count = field->count_field < 0
                                   ? field->count
                                   : (int32_t)p->level[p->depth].values[field->count_field];
    if (!field->array && field->wire < FOVEA_WIRE_FLOAT)
        p->level[p->depth].values[number] =
            integer_of(field->wire, fv_wire_read(p->at, sizes[field->wire]));
}

static void print_message(struct printing *p, const struct fovea_type *types)
{
    while (p->depth >=
           0) { /* every iteration begins a field, or ends an element, a field or a struct */
        const struct fovea_type *type = p->level[p->depth].type;
        if (p->level[p->depth].field == type->field_count) {
            put(&p->out, "}", 1);
            p->depth--;
            if (p->depth >= 0) p->level[p->depth].element++;
            continue;
        }
        const struct fv_field *field = &type->fields[p->level[p->depth].field];
        if (!p->level[p->depth].open) begin_field(p, field);
        if (p->level[p->depth].element == p->level[p->depth].count) {
            if (field->array) put(&p->out, "]", 1);
            p->level[p->depth].open = false;
            p->level[p->depth].field++;
            continue;
        }
        if (p->level[p->depth].element > 0) put(&p->out, ", ", 2);
        if (field->wire == FOVEA_WIRE_STRUCT) {
            p->depth++;
            begin_struct(p, &types[field->nested]);
            continue;
        }
        put_element(p, field);
        p->level[p->depth].element++;
    }
}

const char *fovea_message_type(const uint8_t *data, size_t bytes)
{
    const struct fovea_type *type = fv_message_type_of(data, bytes);
    return type != NULL ? type->name : NULL;
}

enum fovea_status fovea_message_json(const uint8_t *data, size_t bytes, char *text, size_t capacity,
                                     size_t *length, struct fovea_error *error)
{
    const struct fovea_type *type = fv_message_type_of(data, bytes);
    const char *problem;
    size_t at;
    int32_t count;
    if (type == NULL)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "byte 0: found a message of no known type, expected one of Fovea's");
    if (!fv_message_check(type->name, data, bytes, &problem, &at))
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "byte %zu: %s: %s", at, type->name,
                               problem);
    struct printing p = {.out = {text, capacity, 0}, .at = data + 8};
    put_text(&p.out, "{\"type\": \"");
    put_text(&p.out, type->name);
    put_text(&p.out, type->field_count > 0 ? "\", " : "\"");
    p.level[0].type = type;
    print_message(&p, fv_message_types(&count));
    *length = p.out.length;
    if (capacity > 0) text[p.out.length < capacity ? p.out.length : capacity - 1] = '\0';
    return FOVEA_OK;
}
