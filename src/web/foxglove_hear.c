#include "web/foxglove_hear.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

enum { OP_MESSAGE = 1, OP_CALL = 2, OP_PLAYBACK = 3 };

static void wrong(struct fv_foxglove_said *said, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
static void wrong(struct fv_foxglove_said *said, const char *format, ...)
{
    va_list arguments;
    said->op = FV_FOXGLOVE_WRONG;
    va_start(arguments, format);
    vsnprintf(said->problem, sizeof said->problem, format, arguments);
    va_end(arguments);
}

/* ---- binary ---------------------------------------------------------------------------------- */

/* Our capabilities say that no messages and calls are taken: every one is wrong. */
static void hear_binary(const uint8_t *words, size_t bytes, struct fv_foxglove_said *said)
{
    const uint8_t op = words[0];
    if (op == OP_MESSAGE && bytes >= 5)
        wrong(said, "message: found channel %u, which was not advertised: this server takes none",
              (unsigned)words[1] | (unsigned)words[2] << 8 | (unsigned)words[3] << 16 |
                  (unsigned)words[4] << 24);
    else if (op == OP_MESSAGE || op == OP_CALL || op == OP_PLAYBACK)
        wrong(said, "binary message with opcode %u: found %zu bytes, expected %s", (unsigned)op,
              bytes, op == OP_MESSAGE ? "at least 5" : "none of its kind: this server takes none");
    else
        wrong(said, "binary message: found opcode %u, expected none: this server takes none",
              (unsigned)op);
}

/* ---- JSON ------------------------------------------------------------------------------------ */

/* A member that is an array of at most `most`; NULL, and said->problem: it is none. */
static const json_t *array_of(const json_t *message, const char *member, size_t most,
                              struct fv_foxglove_said *said)
{
    const json_t *found = json_object_get(message, member);
    if (!json_is_array(found)) {
        wrong(said, "%s: found %s, expected an array", member,
              found == NULL ? "none" : "something else");
        return NULL;
    }
    if (json_array_size(found) > most) {
        wrong(said, "%s: found %zu, expected at most %zu", member, json_array_size(found), most);
        return NULL;
    }
    return found;
}

static bool number_of(const json_t *value, uint32_t *number)
{
    if (!json_is_integer(value) || json_integer_value(value) < 0 ||
        json_integer_value(value) > UINT32_MAX)
        return false;
    *number = (uint32_t)json_integer_value(value);
    return true;
}

static void text_of(const json_t *value, char *to, size_t bytes)
{
    const char *text = json_string_value(value);
    snprintf(to, bytes, "%s", text != NULL ? text : "");
}

static void hear_subscribe(const json_t *message, struct fv_foxglove_said *said)
{
    const json_t *all = array_of(message, "subscriptions", FV_FOXGLOVE_SUBSCRIPTIONS, said), *one;
    size_t i;
    said->op = all != NULL ? FV_FOXGLOVE_SUBSCRIBE : FV_FOXGLOVE_WRONG;
    json_array_foreach(all, i, one)
    {
        if (!number_of(json_object_get(one, "id"), &said->subscriptions[i].id) ||
            !number_of(json_object_get(one, "channelId"), &said->subscriptions[i].channel)) {
            wrong(said, "subscriptions[%zu]: expected numbers id and channelId", i);
            return;
        }
        said->count++;
    }
}

static void hear_unsubscribe(const json_t *message, struct fv_foxglove_said *said)
{
    const json_t *all = array_of(message, "subscriptionIds", FV_FOXGLOVE_SUBSCRIPTIONS, said), *one;
    size_t i;
    said->op = all != NULL ? FV_FOXGLOVE_UNSUBSCRIBE : FV_FOXGLOVE_WRONG;
    json_array_foreach(all, i, one)
    {
        if (!number_of(one, &said->subscriptions[i].id)) {
            wrong(said, "subscriptionIds[%zu]: expected a number", i);
            return;
        }
        said->count++;
    }
}

static void hear_names(const json_t *message, enum fv_foxglove_op op, struct fv_foxglove_said *said)
{
    const json_t *all = array_of(message, "parameterNames", FV_FOXGLOVE_NAMES, said), *one;
    size_t i;
    said->op = all != NULL ? op : FV_FOXGLOVE_WRONG;
    json_array_foreach(all, i, one)
    {
        if (!json_is_string(one)) {
            wrong(said, "parameterNames[%zu]: expected a text", i);
            return;
        }
        text_of(one, said->names[said->count++], FV_FOXGLOVE_KEY_BYTES);
    }
}

/* The shortest number that reads back as the same one. */
static void real_text(double value, char *to, size_t bytes)
{
    for (int digits = 15; digits <= 17; digits++) {
        snprintf(to, bytes, "%.*g", digits, value);
        if (strtod(to, NULL) == value) return;
    }
}

static bool scalar_text(const json_t *value, char *to, size_t bytes)
{
    if (json_is_string(value))
        text_of(value, to, bytes);
    else if (json_is_boolean(value))
        snprintf(to, bytes, "%s", json_is_true(value) ? "true" : "false");
    else if (json_is_integer(value))
        snprintf(to, bytes, "%lld", (long long)json_integer_value(value));
    else if (json_is_real(value))
        real_text(json_real_value(value), to, bytes);
    else
        return false;
    return true;
}

/* A value as a configuration has it. Returns why it is none; NULL: it is. */
static const char *value_text(const json_t *value, const char *type,
                              char to[FV_FOXGLOVE_VALUE_BYTES])
{
    char one[FV_FOXGLOVE_VALUE_BYTES];
    size_t used = 0, i;
    const json_t *element;
    if (value == NULL || json_is_null(value)) return "found no value: keys cannot be deleted";
    if (strcmp(type, "byte_array") == 0) return "found bytes, expected a number, truth or text";
    if (json_is_string(value) && json_string_length(value) >= FV_FOXGLOVE_VALUE_BYTES)
        return "found a text of 400 bytes or more";
    if (json_is_string(value) && json_string_length(value) == 0) return "found an empty text";
    if (scalar_text(value, to, FV_FOXGLOVE_VALUE_BYTES)) return NULL;
    if (!json_is_array(value)) return "found an object, expected a number, truth or text";
    to[used++] = '[';
    json_array_foreach(value, i, element)
    {
        if (!scalar_text(element, one, sizeof one) ||
            used + strlen(one) + 4 > FV_FOXGLOVE_VALUE_BYTES)
            return "found an array that is too long, or of something else than numbers and texts";
        used += (size_t)snprintf(to + used, FV_FOXGLOVE_VALUE_BYTES - used, "%s%s",
                                 i > 0 ? ", " : "", one);
    }
    snprintf(to + used, FV_FOXGLOVE_VALUE_BYTES - used, "]");
    return NULL;
}

static void hear_set(const json_t *message, struct fv_foxglove_said *said)
{
    const json_t *all = array_of(message, "parameters", FV_FOXGLOVE_SETS, said), *one;
    size_t i;
    said->op = all != NULL ? FV_FOXGLOVE_SET : FV_FOXGLOVE_WRONG;
    json_array_foreach(all, i, one)
    {
        const json_t *name = json_object_get(one, "name"), *type = json_object_get(one, "type");
        if (!json_is_string(name)) {
            wrong(said, "parameters[%zu]: expected a text name", i);
            return;
        }
        text_of(name, said->names[i], FV_FOXGLOVE_KEY_BYTES);
        said->refused[i] =
            value_text(json_object_get(one, "value"),
                       json_is_string(type) ? json_string_value(type) : "", said->values[i]);
        said->count++;
    }
}

static void hear_message(const json_t *message, struct fv_foxglove_said *said)
{
    static const struct {
        const char *op, *capability;
    } others[] = {{"advertise", "clientPublish"},
                  {"unadvertise", "clientPublish"},
                  {"subscribeConnectionGraph", "connectionGraph"},
                  {"unsubscribeConnectionGraph", "connectionGraph"},
                  {"fetchAsset", "assets"}};
    char op[40];
    const json_t *id = json_object_get(message, "id");
    if (!json_is_string(json_object_get(message, "op"))) {
        wrong(said, "message: found no op, expected a text");
        return;
    }
    if (id != NULL && (!json_is_string(id) || json_string_length(id) >= FV_FOXGLOVE_ID_BYTES)) {
        wrong(said, "id: expected a text of at most %d bytes", FV_FOXGLOVE_ID_BYTES - 1);
        return;
    }
    text_of(id, said->id, sizeof said->id);
    text_of(json_object_get(message, "op"), op, sizeof op);
    if (strcmp(op, "subscribe") == 0) {
        hear_subscribe(message, said);
    } else if (strcmp(op, "unsubscribe") == 0) {
        hear_unsubscribe(message, said);
    } else if (strcmp(op, "getParameters") == 0) {
        hear_names(message, FV_FOXGLOVE_GET, said);
    } else if (strcmp(op, "subscribeParameterUpdates") == 0) {
        hear_names(message, FV_FOXGLOVE_WATCH, said);
    } else if (strcmp(op, "unsubscribeParameterUpdates") == 0) {
        hear_names(message, FV_FOXGLOVE_UNWATCH, said);
    } else if (strcmp(op, "setParameters") == 0) {
        hear_set(message, said);
    } else {
        wrong(said, "op: found '%s', which is none of this protocol", op);
        for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
            if (strcmp(op, others[i].op) == 0)
                wrong(said, "%s: this server has no capability %s", op, others[i].capability);
    }
}

void fv_foxglove_hear(const uint8_t *words, size_t bytes, bool binary,
                      struct fv_foxglove_said *said)
{
    json_error_t error;
    said->id[0] = said->problem[0] = '\0';
    said->count = 0;
    if (binary) {
        said->op = FV_FOXGLOVE_WRONG; /* nothing: an empty problem is not answered */
        if (bytes > 0) hear_binary(words, bytes, said);
        return;
    }
    if (bytes > FV_FOXGLOVE_WORDS_BYTES) {
        wrong(said, "message: found more than %d bytes", FV_FOXGLOVE_WORDS_BYTES);
        return;
    }
    json_t *message = json_loadb((const char *)words, bytes, JSON_REJECT_DUPLICATES, &error);
    if (message == NULL)
        wrong(said, "message: byte %d: no JSON: %.100s", error.position, error.text);
    else if (!json_is_object(message))
        wrong(said, "message: found no object of JSON");
    else
        hear_message(message, said);
    json_decref(message);
}
