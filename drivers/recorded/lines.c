#include "lines.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/input.h"
#include "support/text.h"

enum fovea_status fv_lines_open(struct fv_lines *lines, const char *path, struct fovea_error *error)
{
    char *text;
    size_t bytes;
    const enum fovea_status status =
        fv_text_read(path, FV_INPUT_LIST_BYTES_MAX, &text, &bytes, error);
    if (status != FOVEA_OK) return status;
    static const char mark[] = "\xef\xbb\xbf"; /* with which some editors begin UTF-8 */
    const bool marked = bytes >= sizeof mark - 1 && memcmp(text, mark, sizeof mark - 1) == 0;
    *lines = (struct fv_lines){.file = path,
                               .text = text,
                               .next = text + (marked ? sizeof mark - 1 : 0),
                               .end = text + bytes};
    return FOVEA_OK;
}

void fv_lines_close(struct fv_lines *lines)
{
    free(lines->text);
    *lines = (struct fv_lines){0};
}

static enum fovea_status split(struct fv_lines *lines, char *line, const char *separators,
                               struct fovea_error *error)
{
    char cuts[16];
    snprintf(cuts, sizeof cuts, " \t\r%s", separators);
    lines->field_count = 0;
    for (char *p = line + strspn(line, cuts); *p != '\0';) {
        if (lines->field_count == FV_LINE_FIELDS_MAX)
            return fovea_error_set(error, FOVEA_ERROR_INPUT,
                                   "%s:%u: found more than %d fields, expected fewer", lines->file,
                                   lines->line, FV_LINE_FIELDS_MAX);
        lines->fields[lines->field_count++] = p;
        p += strcspn(p, cuts);
        if (*p == '\0') break;
        *p++ = '\0';
        p += strspn(p, cuts);
    }
    return FOVEA_OK;
}

enum fovea_status fv_lines_next(struct fv_lines *lines, const char *separators,
                                struct fovea_error *error)
{
    while (lines->next < lines->end) {
        char *line = lines->next, *end = memchr(line, '\n', (size_t)(lines->end - line));
        if (end == NULL) end = lines->end;
        lines->next = end < lines->end ? end + 1 : end;
        lines->line++;
        if (end - line > FV_LINE_BYTES_MAX)
            return fovea_error_set(
                error, FOVEA_ERROR_INPUT, "%s:%u: found a line of %lld bytes, expected at most %d",
                lines->file, lines->line, (long long)(end - line), FV_LINE_BYTES_MAX);
        *end = '\0';
        if (memchr(line, '\0', (size_t)(end - line)) != NULL)
            return fovea_error_set(error, FOVEA_ERROR_INPUT,
                                   "%s:%u: found a zero byte, expected text", lines->file,
                                   lines->line);
        if (line[strspn(line, " \t\r")] == '#') continue;
        const enum fovea_status status = split(lines, line, separators, error);
        if (status != FOVEA_OK || lines->field_count > 0) return status;
    }
    return FOVEA_END;
}

enum fovea_status fv_lines_refuse(const struct fv_lines *lines, const char *what, const char *field,
                                  const char *expected, struct fovea_error *error)
{
    char quoted[FV_TEXT_QUOTED_BYTES] = "nothing";
    if (field != NULL) fv_text_quote(field, quoted, sizeof quoted);
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s:%u: %s: found %s, expected %s",
                           lines->file, lines->line, what, quoted, expected);
}

enum fovea_status fv_lines_numbers(const struct fv_lines *lines, const char *what, size_t first,
                                   size_t count, double *values, struct fovea_error *error)
{
    for (size_t i = 0; i < count; i++) {
        if (first + i >= lines->field_count)
            return fovea_error_set(
                error, FOVEA_ERROR_INPUT, "%s:%u: %s: found %zu numbers, expected %zu", lines->file,
                lines->line, what, lines->field_count - (first < lines->field_count ? first : 0),
                count);
        if (!fv_text_number(lines->fields[first + i], &values[i]))
            return fv_lines_refuse(lines, what, lines->fields[first + i], "a finite number", error);
    }
    return FOVEA_OK;
}

bool fv_stamp_from_seconds(const char *text, int64_t *stamp_ns)
{
    double seconds;
    if (!fv_text_number(text, &seconds) || seconds < -9.2e9 || seconds > 9.2e9) return false;
    if (strpbrk(text, "eE") != NULL) {
        *stamp_ns = (int64_t)(seconds * 1e9 + (seconds < 0 ? -0.5 : 0.5));
        return true;
    }
    const bool negative = *text == '-';
    int64_t value = 0;
    int fraction = -1; /* digits after the point */
    for (text += *text == '-' || *text == '+'; *text != '\0' && fraction < 9; text++) {
        if (*text == '.') {
            fraction = 0;
            continue;
        }
        value = value * 10 + (*text - '0');
        if (fraction >= 0) ++fraction;
    }
    for (int digits = fraction < 0 ? 0 : fraction; digits < 9; digits++)
        value *= 10;
    *stamp_ns = negative ? -value : value;
    return true;
}
