#include "support/lcmlog.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fovea_types.h"
#include "support/input.h"

enum fovea_status fv_lcmlog_check_format(const char *name, int64_t byte, int32_t format,
                                         struct fovea_error *error)
{
    if (format == FOVEA_RECORDING_T_FORMAT) return FOVEA_OK;
    return fovea_error_set(
        error, FOVEA_ERROR_UNSUPPORTED,
        "%s: byte %" PRId64 ": found recording format %" PRId32 "%s, expected %d", name, byte,
        format, format == 2 || format == 3 ? ", which Fovea 0.1 reads" : "",
        FOVEA_RECORDING_T_FORMAT);
}

struct fv_lcmlog {
    FILE *file;
    char *path;
    int64_t size, offset; /* bytes of the file; where the next event starts */
    uint8_t *buffer;
    size_t capacity;
    bool cut_off; /* the last read found the end of the file within an event */
};

enum fovea_status fv_lcmlog_open(const char *path, struct fv_lcmlog **log,
                                 struct fovea_error *error)
{
    struct fovea_error reason;
    int64_t size = 0;
    const int descriptor = fv_input_open(path, FV_INPUT_ANY_BYTES, &size, &reason);
    if (descriptor < 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: %.200s", path, reason.text);
    FILE *file = fdopen(descriptor, "rb");
    if (file == NULL) {
        close(descriptor);
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory to open it", path);
    }
    struct fv_lcmlog *opened = calloc(1, sizeof *opened);
    char *name = strdup(path);
    if (opened == NULL || name == NULL) {
        free(opened);
        free(name);
        fclose(file);
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory to open it", path);
    }
    opened->file = file;
    opened->path = name;
    opened->size = size;
    *log = opened;
    return FOVEA_OK;
}

void fv_lcmlog_close(struct fv_lcmlog *log)
{
    if (log == NULL) return;
    fclose(log->file);
    free(log->path);
    free(log->buffer);
    free(log);
}

static uint32_t read_u32(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

static int64_t read_i64(const uint8_t *bytes)
{
    return (int64_t)((uint64_t)read_u32(bytes) << 32 | read_u32(bytes + 4));
}

static enum fovea_status cut_off(struct fv_lcmlog *log, int64_t needed, struct fovea_error *error)
{
    log->cut_off = true;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%s: byte %" PRId64 ": the event is cut off: found %" PRId64
                           " bytes to the end of the file, expected %" PRId64,
                           log->path, log->offset, log->size - log->offset, needed);
}

/* Header and channel of the event at log->offset; leaves the file at the event's data. */
static enum fovea_status read_head(struct fv_lcmlog *log, struct fv_lcmlog_event *event,
                                   struct fovea_error *error)
{
    uint8_t head[FV_LCMLOG_HEADER_BYTES];
    int64_t left = log->size - log->offset;
    event->offset = log->offset;
    log->cut_off = false;
    if (left <= 0) return FOVEA_END;
    if (left < FV_LCMLOG_HEADER_BYTES || fread(head, sizeof head, 1, log->file) != 1)
        return cut_off(log, FV_LCMLOG_HEADER_BYTES, error);
    uint32_t sync = read_u32(head), channel_bytes = read_u32(head + 20),
             data_bytes = read_u32(head + 24);
    if (sync != FV_LCMLOG_SYNC)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte %" PRId64 ": found %08" PRIx32
                               ", expected an LCM event (%08x)",
                               log->path, log->offset, sync, FV_LCMLOG_SYNC);
    if (channel_bytes < 1 || channel_bytes >= FV_LCMLOG_CHANNEL_BYTES)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: byte %" PRId64 ": channel length: found %" PRIu32 ", expected 1 to %d", log->path,
            log->offset + 20, channel_bytes, FV_LCMLOG_CHANNEL_BYTES - 1);
    if (data_bytes > FV_LCMLOG_DATA_BYTES_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte %" PRId64 ": data length: found %" PRIu32
                               ", expected at most %d",
                               log->path, log->offset + 24, data_bytes, FV_LCMLOG_DATA_BYTES_MAX);
    int64_t whole = (int64_t)FV_LCMLOG_HEADER_BYTES + channel_bytes + data_bytes;
    if (left < whole || fread(event->channel, channel_bytes, 1, log->file) != 1)
        return cut_off(log, whole, error);
    event->channel[channel_bytes] = '\0';
    for (uint32_t i = 0; i < channel_bytes; i++)
        if (event->channel[i] < ' ' || event->channel[i] > '~')
            return fovea_error_set(
                error, FOVEA_ERROR_INPUT,
                "%s: byte %" PRId64 ": channel name: found byte %d, expected printable ASCII",
                log->path, log->offset + FV_LCMLOG_HEADER_BYTES + i, event->channel[i]);
    event->number = read_i64(head + 4);
    event->time_us = read_i64(head + 12);
    event->bytes = data_bytes;
    event->data = NULL;
    return FOVEA_OK;
}

/* Make room for `bytes`, which are known to be in the file. */
static enum fovea_status reserve(struct fv_lcmlog *log, size_t bytes, struct fovea_error *error)
{
    if (bytes <= log->capacity && log->buffer != NULL) return FOVEA_OK;
    size_t capacity = bytes + bytes / 4 + 4096;
    uint8_t *larger = realloc(log->buffer, capacity);
    if (larger == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY,
                               "%s: byte %" PRId64 ": no memory for an event of %zu bytes",
                               log->path, log->offset, bytes);
    log->buffer = larger;
    log->capacity = capacity;
    return FOVEA_OK;
}

enum fovea_status fv_lcmlog_next(struct fv_lcmlog *log, struct fv_lcmlog_event *event,
                                 struct fovea_error *error)
{
    enum fovea_status status = read_head(log, event, error);
    if (status == FOVEA_OK) status = reserve(log, event->bytes, error);
    if (status != FOVEA_OK) return status;
    int64_t whole =
        (int64_t)FV_LCMLOG_HEADER_BYTES + (int64_t)strlen(event->channel) + event->bytes;
    if (event->bytes > 0 && fread(log->buffer, event->bytes, 1, log->file) != 1)
        return cut_off(log, whole, error); /* shortened while being read */
    event->data = log->buffer;
    log->offset += whole;
    return FOVEA_OK;
}

bool fv_lcmlog_cut_off(const struct fv_lcmlog *log)
{
    return log->cut_off;
}

enum fovea_status fv_lcmlog_skim(struct fv_lcmlog *log, struct fv_lcmlog_event *event,
                                 struct fovea_error *error)
{
    enum fovea_status status = read_head(log, event, error);
    if (status != FOVEA_OK) return status;
    return fv_lcmlog_seek(
        log, log->offset + FV_LCMLOG_HEADER_BYTES + (int64_t)strlen(event->channel) + event->bytes,
        error);
}

enum fovea_status fv_lcmlog_seek(struct fv_lcmlog *log, int64_t offset, struct fovea_error *error)
{
    if (fseeko(log->file, offset, SEEK_SET) != 0)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: byte %" PRId64 ": %s", log->path,
                               offset, strerror(errno));
    log->offset = offset;
    return FOVEA_OK;
}

enum fovea_status fv_lcmlog_resync(struct fv_lcmlog *log)
{
    uint32_t window = 0;
    int64_t at = log->offset + 1;
    if (fseeko(log->file, at, SEEK_SET) != 0) return FOVEA_END;
    for (int byte; (byte = getc_unlocked(log->file)) != EOF;) {
        window = window << 8 | (uint32_t)byte;
        if (++at > log->offset + 4 && window == FV_LCMLOG_SYNC)
            return fv_lcmlog_seek(log, at - 4, NULL) == FOVEA_OK ? FOVEA_OK : FOVEA_END;
    }
    return FOVEA_END;
}

bool fv_lcmlog_channel_is(const char *channel, const char *suffix)
{
    size_t length = strlen(channel), tail = strlen(suffix);
    if (length < tail || strcmp(channel + length - tail, suffix) != 0) return false;
    return length == tail || channel[length - tail - 1] == '_';
}

/* ---- frames ---------------------------------------------------------------------------------- */

/* Where the members of an encoded fovea.frame_t lie, and those of each fovea.image_t in it. A
 * sample's message begins with its stamp, too. */
enum {
    AT_STAMP = 8,
    AT_CLOCK = 16,
    AT_MEANING = 17,
    AT_SEQUENCE = 26,
    AT_COUNT = 34,
    AT_IMAGES = 38,

    AT_SAMPLE_VALUES = 34, /* of a sample's message, behind its stamp */

    AT_WIDTH = 0,
    AT_HEIGHT = 4,
    AT_STRIDE = 8,
    AT_FORMAT = 12,
    AT_OFFSET = 13,
    AT_EXPOSURE = 21,
    AT_SIZE = 29,
    AT_DATA = 33
};

enum { OFFSET_MAX_NS = 1000000000 };

enum fovea_status fv_lcmlog_frame_stamp(struct fv_lcmlog *log, const struct fv_lcmlog_event *event,
                                        int64_t *stamp_ns)
{
    uint8_t head[AT_STAMP + 8];
    const int64_t back = log->offset,
                  data = event->offset + FV_LCMLOG_HEADER_BYTES + (int64_t)strlen(event->channel);
    if (event->bytes < sizeof head || fseeko(log->file, data, SEEK_SET) != 0)
        return FOVEA_ERROR_INPUT;
    const bool read = fread(head, sizeof head, 1, log->file) == 1;
    if (fv_lcmlog_seek(log, back, NULL) != FOVEA_OK || !read ||
        read_i64(head) != __fovea_frame_t_get_hash())
        return FOVEA_ERROR_INPUT;
    *stamp_ns = read_i64(head + AT_STAMP);
    return FOVEA_OK;
}

/* An image that ends before `bytes`; `*at` moves behind it. One whose numbers are all 0 is absent.
 */
static enum fovea_status take_image(const struct fv_lcmlog_event *event, size_t *at,
                                    struct fovea_image *image, struct fovea_error *reason)
{
    const uint8_t *data = event->data + *at;
    const size_t left = event->bytes - *at;
    if (left < AT_DATA || read_u32(data + AT_SIZE) > left - AT_DATA)
        return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                               "found an image past the end of the message, expected less");
    const size_t size_bytes = read_u32(data + AT_SIZE);
    *at += AT_DATA + size_bytes;
    *image = (struct fovea_image){0};
    if (size_bytes == 0 && read_u32(data + AT_WIDTH) == 0 && read_u32(data + AT_HEIGHT) == 0)
        return FOVEA_OK;
    *image = (struct fovea_image){.data = data + AT_DATA,
                                  .width = (int32_t)read_u32(data + AT_WIDTH),
                                  .height = (int32_t)read_u32(data + AT_HEIGHT),
                                  .stride_bytes = (int32_t)read_u32(data + AT_STRIDE),
                                  .format = (enum fovea_pixel_format)data[AT_FORMAT],
                                  .size_bytes = size_bytes};
    if (fovea_image_check(image) == FOVEA_OK) return FOVEA_OK;
    return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                           "found an image of %" PRId32 " x %" PRId32 ", stride %" PRId32
                           ", format %d in %zu bytes, expected a consistent one",
                           image->width, image->height, image->stride_bytes, (int)image->format,
                           size_bytes);
}

/* When the image whose members lie at `data` was taken. */
static enum fovea_status take_times(const uint8_t *data, uint32_t camera, struct fovea_frame *frame,
                                    struct fovea_error *reason)
{
    const int64_t offset_ns = read_i64(data + AT_OFFSET);
    if (offset_ns < -OFFSET_MAX_NS || offset_ns > OFFSET_MAX_NS)
        return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                               "offset_ns: found %" PRId64 ", expected %d to %d", offset_ns,
                               -OFFSET_MAX_NS, OFFSET_MAX_NS);
    frame->offset_ns[camera] = offset_ns;
    frame->exposure_ns[camera] = read_i64(data + AT_EXPOSURE);
    return FOVEA_OK;
}

static enum fovea_status take_images(const struct fv_lcmlog_event *event, struct fovea_frame *frame,
                                     size_t *at, struct fovea_error *reason)
{
    *at = AT_COUNT;
    frame->image_count = read_u32(event->data + AT_COUNT);
    if (frame->image_count < 1 || frame->image_count > FOVEA_CAMERAS_MAX)
        return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                               "image_count: found %" PRId32 ", expected 1 to %d",
                               (int32_t)frame->image_count, FOVEA_CAMERAS_MAX);
    *at = AT_IMAGES;
    for (uint32_t i = 0; i < frame->image_count; i++) {
        const size_t begin = *at;
        if (take_image(event, at, &frame->images[i], reason) == FOVEA_OK &&
            take_times(event->data + begin, i, frame, reason) == FOVEA_OK)
            continue;
        *at = begin;
        return FOVEA_ERROR_INPUT;
    }
    if (*at == event->bytes) return FOVEA_OK;
    return fovea_error_set(reason, FOVEA_ERROR_INPUT,
                           "found %zu bytes after the last image, expected none",
                           event->bytes - *at);
}

enum fovea_status fv_lcmlog_frame(const char *name, const struct fv_lcmlog_event *event,
                                  struct fovea_frame *frame, struct fovea_error *error)
{
    const int64_t start = event->offset + FV_LCMLOG_HEADER_BYTES + (int64_t)strlen(event->channel);
    const uint8_t *data = event->data;
    if (event->bytes < AT_IMAGES || read_i64(data) != __fovea_frame_t_get_hash())
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte %" PRId64
                               ": found another type, expected fovea.frame_t of recording format 4",
                               name, start);
    if (data[AT_CLOCK] > FOVEA_CLOCK_SIMULATED || data[AT_MEANING] > FOVEA_STAMP_EXPOSURE_END)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: byte %" PRId64
            ": clock and meaning of the stamp: found %d and %d, expected at most %d and %d",
            name, start + AT_CLOCK, data[AT_CLOCK], data[AT_MEANING], FOVEA_CLOCK_SIMULATED,
            FOVEA_STAMP_EXPOSURE_END);
    struct fovea_frame found = {
        .stamp_ns = read_i64(data + AT_STAMP),
        .clock = (enum fovea_clock)data[AT_CLOCK],
        .stamp_meaning = (enum fovea_stamp_meaning)data[AT_MEANING],
        .sequence = (uint64_t)read_i64(data + AT_SEQUENCE),
    };
    struct fovea_error reason = {.text = ""};
    size_t at;
    if (take_images(event, &found, &at, &reason) != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: byte %" PRId64 ": %.300s", name,
                               start + (int64_t)at, reason.text);
    *frame = found;
    return FOVEA_OK;
}

/* ---- samples --------------------------------------------------------------------------------- */

/* The kind whose type a sample's event is of; FOVEA_SAMPLE_KIND_COUNT: none. */
static enum fovea_sample_kind kind_of(const struct fv_lcmlog_event *event)
{
#define HASH_OF(KIND, name) __fovea_##name##_t_get_hash,
    static int64_t (*const hashes[])(void) = {FOVEA_SAMPLE_KINDS(HASH_OF)};
    int kind = 0;
    if (event->bytes < AT_SAMPLE_VALUES) return FOVEA_SAMPLE_KIND_COUNT;
    const uint32_t count = (event->bytes - AT_SAMPLE_VALUES) / 8;
    while (kind < FOVEA_SAMPLE_KIND_COUNT &&
           (read_i64(event->data) != hashes[kind]() || fovea_sample_value_count(kind) != count))
        kind++;
    return (event->bytes - AT_SAMPLE_VALUES) % 8 == 0 ? (enum fovea_sample_kind)kind
                                                      : FOVEA_SAMPLE_KIND_COUNT;
}

enum fovea_status fv_lcmlog_sample(const char *name, const struct fv_lcmlog_event *event,
                                   struct fovea_sample *sample, struct fovea_error *error)
{
#define TYPE_OF(KIND, name) " fovea." #name "_t"
    const int64_t start = event->offset + FV_LCMLOG_HEADER_BYTES + (int64_t)strlen(event->channel);
    struct fovea_sample found;
    memset(&found, 0, sizeof found);
    found.kind = kind_of(event);
    if (found.kind == FOVEA_SAMPLE_KIND_COUNT)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: byte %" PRId64
            ": found another type or length, expected one of" FOVEA_SAMPLE_KINDS(TYPE_OF),
            name, start);
    found.any.stamp_ns = read_i64(event->data + AT_STAMP);
    for (uint32_t i = 0; i < fovea_sample_value_count(found.kind); i++) {
        const uint32_t at = AT_SAMPLE_VALUES + 8 * i;
        const int64_t bits = read_i64(event->data + at);
        memcpy(&found.any.values[i], &bits, sizeof bits);
        /* those of an inertial sensor are judged by the step, and recorded as they came */
        if (found.kind != FOVEA_SAMPLE_IMU && found.any.values[i] - found.any.values[i] != 0)
            return fovea_error_set(
                error, FOVEA_ERROR_INPUT,
                "%s: byte %" PRId64
                ": found a sample with a number that is not finite, expected none",
                name, start + at);
    }
    *sample = found;
    return FOVEA_OK;
}
