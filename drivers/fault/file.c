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

/* One schedule more around the address. */
static enum fovea_status wrap(const struct fv_lines *lines, char *address, size_t capacity,
                              struct fovea_error *error)
{
    static const char scheme[] = "fault:";
    char options[FV_LINE_BYTES_MAX + sizeof "kind="];
    struct fv_fault_options read;
    struct fovea_error why;
    const size_t length = strlen(address), more = sizeof scheme - 1;
    if (!options_of(lines, options, sizeof options) ||
        length + strlen(options) + more + 2 > capacity)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s:%u: found an address of more than %zu bytes with the lines before, expected less",
            lines->file, lines->line, capacity - 1);
    if (fv_fault_options_parse(options, &read, &why) != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s:%u: %s", lines->file, lines->line,
                               why.text);
    memmove(address + more, address, length + 1);
    memcpy(address, scheme, more);
    (void)snprintf(address + length + more, capacity - length - more, "?%s", options);
    return FOVEA_OK;
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
