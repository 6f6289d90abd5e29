/* Small text tools that the configuration, calibration files and drivers share: whole files, strict
 * numbers, and the pieces of a good error line. Init-only, any thread; nothing here belongs into
 * the loop. Of the drivers and the command: not in the library, and not installed. */
#ifndef FOVEA_SUPPORT_TEXT_H
#define FOVEA_SUPPORT_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Read a whole file of at most `max_bytes` into memory from malloc (the caller frees it), followed
 * by a zero byte that `*bytes` does not count. FOVEA_ERROR_INPUT: not there, no file, or too
 * large (support/input.h), as `error` says. */
enum fovea_status fv_text_read(const char *path, size_t max_bytes, char **text, size_t *bytes,
                               struct fovea_error *error);

/* A finite decimal number that takes up the whole of `text` ("1", "-.5e-3"); the decimal point is
 * '.' in every locale. False, and `*value` untouched, for anything else: blanks, hexadecimal, nan,
 * inf, overflow. */
bool fv_text_number(const char *text, double *value);

/* The same for a whole decimal number that fits 64 bits. */
bool fv_text_integer(const char *text, int64_t *value);

/* Whether a code point may be shown on a terminal: false for what steers it or turns the direction
 * of writing (control characters, and those that format bidirectional text). */
bool fv_text_shown(uint32_t code);

/* "1 loop", "2 loops": a count with its noun, which takes an s. Returns `text`. */
enum { FV_TEXT_COUNT_BYTES = 48 };
const char *fv_text_count(uint64_t count, const char *noun, char text[FV_TEXT_COUNT_BYTES]);

/* Copy for display: about 48 bytes of `text` and bytes - 1 in all, UTF-8 as it is, other
 * bytes, control characters and those that turn the direction of text as \xNN, "..." where cut, in
 * single quotes. Returns `quoted`. */
const char *fv_text_quote(const char *text, char *quoted, size_t bytes);

enum { FV_TEXT_QUOTED_BYTES = 208 }; /* enough for every result of fv_text_quote */

/* The name most like `word` by edit distance (Damerau-Levenshtein with adjacent swaps, case
 * ignored) when at most a quarter of the longer one's letters differ (one of three to seven
 * letters, none of fewer); NULL when none is. Names and words are compared over their first 64
 * bytes. */
const char *fv_text_nearest(const char *word, const char *const *names, size_t name_count);

#ifdef __cplusplus
}
#endif
#endif
