#include "log_calibration.h"

#include <stdio.h>
#include <string.h>

int64_t __fovea_recording_t_get_hash(void); /* of the generated type */

/* Big-endian members one after the other, as lcm-gen encodes them. */
struct cursor {
    const uint8_t *data;
    size_t bytes, at;
    bool short_of; /* a member went past the end */
};

static uint64_t take_number(struct cursor *cursor, size_t bytes)
{
    uint64_t number = 0;
    if (cursor->bytes - cursor->at < bytes) cursor->short_of = true;
    for (size_t i = 0; i < bytes && !cursor->short_of; ++i)
        number = number << 8 | cursor->data[cursor->at++];
    return number;
}

/* `bytes` bytes, which stay in the event; NULL when there are fewer. */
static const uint8_t *take_bytes(struct cursor *cursor, size_t bytes)
{
    if (cursor->short_of || cursor->bytes - cursor->at < bytes) {
        cursor->short_of = true;
        return NULL;
    }
    cursor->at += bytes;
    return cursor->data + cursor->at - bytes;
}

/* A string: its length with the zero, then its bytes. "" when it does not fit or does not end. */
static const char *take_string(struct cursor *cursor)
{
    const size_t length = (size_t)take_number(cursor, 4);
    const uint8_t *text = take_bytes(cursor, length);
    if (text == NULL || length == 0 || text[length - 1] != '\0') cursor->short_of = true;
    return cursor->short_of ? "" : (const char *)text;
}

enum fovea_status fv_log_calibration(const char *name, const struct fovea_log_event *event,
                                     struct fovea_calibration *calibration,
                                     struct fovea_error *error)
{
    struct cursor cursor = {.data = event->data, .bytes = event->bytes};
    const int64_t start = event->offset + FOVEA_LOG_HEADER_BYTES + (int64_t)strlen(event->channel);
    if (take_number(&cursor, 8) != (uint64_t)__fovea_recording_t_get_hash()) return FOVEA_AGAIN;
    take_number(&cursor, 4); /* format */
    for (int i = 0; i < 4; ++i)
        take_string(&cursor); /* version, machine, kernel set, source */
    take_number(&cursor, 1);  /* real_time */
    take_string(&cursor);     /* channel prefix */
    const uint32_t parts = (uint32_t)take_number(&cursor, 4);
    for (uint32_t i = 0; i < parts && !cursor.short_of; ++i) {
        const char *part = take_string(&cursor);
        take_string(&cursor);    /* origin */
        take_number(&cursor, 8); /* hash */
        const size_t bytes = (size_t)take_number(&cursor, 4);
        const uint8_t *data = take_bytes(&cursor, bytes);
        if (data == NULL || strcmp(part, "calibration") != 0) continue;
        char label[320];
        snprintf(label, sizeof label, "%.256s: calibration", name);
        return fovea_calibration_parse(label, (const char *)data, bytes, NULL, calibration, error);
    }
    if (!cursor.short_of) return FOVEA_AGAIN;
    return fovea_error_set(
        error, FOVEA_ERROR_INPUT,
        "%s: byte %lld: found a length past the end of the message, expected less", name,
        (long long)start + (long long)cursor.at);
}
