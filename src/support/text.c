#include "support/text.h"

#include <errno.h>
#include <locale.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "support/input.h"
#include "support/utf8.h"

/* ---- whole files ----------------------------------------------------------------------------- */

/* Read until the end or one byte past the limit, so that the caller sees that there was more. */
static enum fovea_status read_all(int descriptor, const char *path, size_t max_bytes, char **text,
                                  size_t *bytes, struct fovea_error *error)
{
    size_t capacity = 4096, used = 0;
    char *buffer = malloc(capacity);
    while (buffer != NULL) {
        if (used + 1 == capacity) {
            char *larger = realloc(buffer, capacity *= 2);
            if (larger == NULL) break;
            buffer = larger;
        }
        const ssize_t got = read(descriptor, buffer + used, capacity - 1 - used);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) {
            free(buffer);
            return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: cannot be read: %s", path,
                                   strerror(errno));
        }
        used += (size_t)got;
        if (used > max_bytes) {
            free(buffer);
            return fovea_error_set(error, FOVEA_ERROR_INPUT,
                                   "%s: found more than %zu bytes, expected at most that", path,
                                   max_bytes);
        }
        if (got == 0) {
            buffer[used] = '\0';
            *text = buffer;
            *bytes = used;
            return FOVEA_OK;
        }
    }
    free(buffer);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory after %zu bytes", path,
                           used);
}

enum fovea_status fv_text_read(const char *path, size_t max_bytes, char **text, size_t *bytes,
                               struct fovea_error *error)
{
    struct fovea_error reason;
    const int descriptor = fv_input_open(path, (int64_t)max_bytes, NULL, &reason);
    if (descriptor < 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: %.200s", path, reason.text);
    const enum fovea_status status = read_all(descriptor, path, max_bytes, text, bytes, error);
    close(descriptor);
    return status;
}

/* ---- numbers --------------------------------------------------------------------------------- */

/* Shape of a decimal number, checked by hand since strtod also takes blanks, hexadecimal, "nan" and
 * "infinity". */
static bool is_decimal(const char *text, bool whole)
{
    const char *p = text + (*text == '-' || *text == '+');
    size_t digits = strspn(p, "0123456789");
    p += digits;
    if (!whole && *p == '.') {
        const size_t fraction = strspn(++p, "0123456789");
        digits += fraction;
        p += fraction;
    }
    if (digits == 0) return false;
    if (!whole && (*p == 'e' || *p == 'E')) {
        ++p;
        p += *p == '-' || *p == '+';
        const size_t exponent = strspn(p, "0123456789");
        if (exponent == 0) return false;
        p += exponent;
    }
    return *p == '\0';
}

bool fv_text_number(const char *text, double *value)
{
    if (!is_decimal(text, false)) return false;
    const locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    if (c == (locale_t)0) return false;
    const double number = strtod_l(text, NULL, c);
    freelocale(c);
    if (!(number - number == 0.0)) return false;
    *value = number;
    return true;
}

bool fv_text_integer(const char *text, int64_t *value)
{
    if (!is_decimal(text, true)) return false;
    errno = 0;
    const long long number = strtoll(text, NULL, 10);
    if (errno != 0) return false;
    *value = number;
    return true;
}

/* ---- error lines ----------------------------------------------------------------------------- */

bool fv_text_shown(uint32_t code)
{
    return code >= 0x20 && code != 0x7f && !(code >= 0x80 && code < 0xa0) &&
           !(code >= 0x200e && code <= 0x200f) && !(code >= 0x2028 && code <= 0x202e) &&
           !(code >= 0x2066 && code <= 0x2069);
}

const char *fv_text_quote(const char *text, char *quoted, size_t bytes)
{
    enum { SHOWN = 48, TAIL = 5 /* "...'" and the zero */ };
    size_t used = 0;
    if (bytes < 16) {
        if (bytes > 0) quoted[0] = '\0';
        return quoted;
    }
    quoted[used++] = '\'';
    size_t i = 0;
    while (text[i] != '\0' && i < SHOWN) {
        uint32_t code;
        const int length = fv_utf8_decode(text + i, &code);
        const size_t shown = length > 0 && fv_text_shown(code) ? (size_t)length : 0;
        if (used + (shown > 0 ? shown : 4) + TAIL > bytes) break;
        if (shown > 0)
            memcpy(quoted + used, text + i, shown);
        else
            snprintf(quoted + used, 5, "\\x%02X", (unsigned char)text[i]);
        used += shown > 0 ? shown : 4;
        i += shown > 0 ? shown : 1;
    }
    snprintf(quoted + used, bytes - used, text[i] != '\0' ? "...'" : "'");
    return quoted;
}

const char *fv_text_count(uint64_t count, const char *noun, char text[FV_TEXT_COUNT_BYTES])
{
    snprintf(text, FV_TEXT_COUNT_BYTES, "%llu %.20s%s", (unsigned long long)count, noun,
             count == 1 ? "" : "s");
    return text;
}

static unsigned char lower(char c)
{
    return (unsigned char)(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
}

enum { COMPARED = 64 };

/* Optimal string alignment distance, three rolling rows. */
static int distance(const char *a, size_t m, const char *b, size_t n)
{
    int rows[3][COMPARED + 1];
    for (size_t j = 0; j <= n; j++)
        rows[0][j] = (int)j;
    for (size_t i = 1; i <= m; i++) {
        int *now = rows[i % 3];
        const int *last = rows[(i + 2) % 3], *before = rows[(i + 1) % 3];
        now[0] = (int)i;
        for (size_t j = 1; j <= n; j++) {
            const int cost = lower(a[i - 1]) != lower(b[j - 1]);
            int best = last[j - 1] + cost;
            if (last[j] + 1 < best) best = last[j] + 1;
            if (now[j - 1] + 1 < best) best = now[j - 1] + 1;
            if (i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) &&
                lower(a[i - 2]) == lower(b[j - 1]) && before[j - 2] + 1 < best)
                best = before[j - 2] + 1;
            now[j] = best;
        }
    }
    return rows[m % 3][n];
}

const char *fv_text_nearest(const char *word, const char *const *names, size_t name_count)
{
    const size_t length = strnlen(word, COMPARED);
    const char *nearest = NULL;
    int least = COMPARED + 1;
    for (size_t i = 0; i < name_count; i++) {
        const size_t name_length = strnlen(names[i], COMPARED);
        const size_t longer = length > name_length ? length : name_length;
        const int allowed = longer < 3 ? 0 : longer < 8 ? 1 : (int)(longer / 4);
        const int d = distance(word, length, names[i], name_length);
        if (d <= allowed && d < least) {
            least = d;
            nearest = names[i];
        }
    }
    return nearest;
}
