/* Text files of lines and fields: lists of frames, poses. The file is held in memory and cut up in
 * place. */
#ifndef FOVEA_RECORDED_LINES_H
#define FOVEA_RECORDED_LINES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

enum { FV_LINE_BYTES_MAX = 4096, FV_LINE_FIELDS_MAX = 32 };

struct fv_lines {
    const char *file; /* as named in errors; kept by address */
    char *text, *next, *end;
    uint32_t line; /* number of the line read last, from 1 */
    size_t field_count;
    char *fields[FV_LINE_FIELDS_MAX]; /* of the line read last */
};

enum fovea_status fv_lines_open(struct fv_lines *lines, const char *path,
                                struct fovea_error *error);
void fv_lines_close(struct fv_lines *lines);

/* The next line that is neither blank nor a comment (#), cut into fields at any of `separators` and
 * blanks. FOVEA_END after the last. FOVEA_ERROR_INPUT: a line too long, with too many fields or a
 * zero byte. */
enum fovea_status fv_lines_next(struct fv_lines *lines, const char *separators,
                                struct fovea_error *error);

/* "file:line: <what>: found 'field', expected <expected>". Returns FOVEA_ERROR_INPUT. */
enum fovea_status fv_lines_refuse(const struct fv_lines *lines, const char *what, const char *field,
                                  const char *expected, struct fovea_error *error);

/* Exactly `count` numbers from field `first` on. */
enum fovea_status fv_lines_numbers(const struct fv_lines *lines, const char *what, size_t first,
                                   size_t count, double *values, struct fovea_error *error);

/* Seconds as decimal text to nanoseconds: exact as long as there is no exponent, digits past the
 * ninth cut off. False unless it is a number and fits. */
bool fv_stamp_from_seconds(const char *text, int64_t *stamp_ns);

#endif
