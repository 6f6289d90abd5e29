/* A file of schedules: each line is one, upon those above it.
 *
 *     # kinds, then options
 *     black      first=60  shortest=10 longest=10 count=1
 *     imu_unplug first=120 shortest=40 longest=40 count=1 */
#include "file.h"

#include <stdio.h>
#include <string.h>

#include "../recorded/lines.h"
#include "fault.h"

/* The fields of a line as options of an address; false: they do not fit. */
static bool options_of(const struct fv_lines *lines, char *text, size_t capacity)
{
    int length = snprintf(text, capacity, "kind=%s", lines->fields[0]);
    for (size_t i = 1; i < lines->field_count && length >= 0 && (size_t)length < capacity; i++)
        length += snprintf(text + length, capacity - (size_t)length, "&%s", lines->fields[i]);
    return length >= 0 && (size_t)length < capacity;
}

/* One schedule more around the address; false: it does not fit. */
static bool wrapped(const char *options, char *address, size_t capacity)
{
    static const char scheme[] = "fault:";
    const size_t length = strlen(address), more = sizeof scheme - 1;
    if (length + strlen(options) + more + 2 > capacity) return false;
    memmove(address + more, address, length + 1);
    memcpy(address, scheme, more);
    (void)snprintf(address + length + more, capacity - length - more, "?%s", options);
    return true;
}

static enum fovea_status wrap(const struct fv_lines *lines, char *address, size_t capacity,
                              struct fovea_error *error)
{
    char options[FV_LINE_BYTES_MAX + sizeof "kind="];
    struct fv_fault_options read;
    struct fovea_error why;
    const bool fits = options_of(lines, options, sizeof options);
    if (fits && fv_fault_options_parse(options, &read, &why) != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s:%u: %s", lines->file, lines->line,
                               why.text);
    if (fits && wrapped(options, address, capacity)) return FOVEA_OK;
    return fovea_error_set(
        error, FOVEA_ERROR_INPUT,
        "%s:%u: found an address of more than %zu bytes with the lines before, expected less",
        lines->file, lines->line, capacity - 1);
}

enum fovea_status fv_fault_file_read(const char *path, char *address, size_t capacity,
                                     struct fovea_error *error)
{
    struct fv_lines lines;
    uint32_t count = 0;
    enum fovea_status status = fv_lines_open(&lines, path, error);
    if (status != FOVEA_OK) return status;
    while ((status = fv_lines_next(&lines, "", error)) == FOVEA_OK) {
        status = wrap(&lines, address, capacity, error);
        if (status != FOVEA_OK) break;
        count++;
    }
    fv_lines_close(&lines);
    if (status != FOVEA_END) return status;
    if (count == 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: found no line, expected kinds of faults and their options",
                               path);
    return FOVEA_OK;
}

bool fv_fault_uri_whole(const char *uri, char whole[FV_FAULT_ADDRESS_BYTES])
{
    static const char scheme[] = "fault:", file[] = "file=";
    const char *at = uri, *end = uri + strlen(uri);
    uint32_t depth = 0;
    for (; strncmp(at, scheme, sizeof scheme - 1) == 0; at += sizeof scheme - 1)
        depth++;
    /* The options of the outermost stand last. */
    const char *options[FV_FAULT_ADDRESS_BYTES / sizeof scheme];
    const size_t most = sizeof options / sizeof options[0];
    const char *cut = end;
    for (uint32_t i = 0; i < depth && i < most; i++) {
        const char *mark = memrchr(at, '?', (size_t)(cut - at));
        options[i] = mark != NULL ? mark + 1 : end;
        cut = mark != NULL ? mark : cut;
    }
    if (depth > most || cut - at >= FV_FAULT_ADDRESS_BYTES) return false;
    snprintf(whole, FV_FAULT_ADDRESS_BYTES, "%.*s", (int)(cut - at), at);
    for (uint32_t i = depth; i-- > 0;) {
        char text[FV_FAULT_ADDRESS_BYTES];
        struct fovea_error error;
        const size_t length = strcspn(options[i], "?");
        const bool is_file = strncmp(options[i], file, sizeof file - 1) == 0;
        snprintf(text, sizeof text, "%.*s", (int)length, options[i]);
        if (is_file ? fv_fault_file_read(text + sizeof file - 1, whole, FV_FAULT_ADDRESS_BYTES,
                                         &error) != FOVEA_OK
                    : !wrapped(text, whole, FV_FAULT_ADDRESS_BYTES))
            return false;
    }
    return true;
}
