#include "fovea/text.h"

#include <errno.h>
#include <fcntl.h>
#include <locale.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* ---- whole files
 * ------------------------------------------------------------------------------------- */

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

enum fovea_status fovea_text_read(const char *path, size_t max_bytes, char **text, size_t *bytes,
                                  struct fovea_error *error)
{
    const int descriptor = open(path, O_RDONLY | O_CLOEXEC);
    if (descriptor < 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: cannot be opened: %s", path,
                               strerror(errno));
    struct stat about;
    enum fovea_status status;
    if (fstat(descriptor, &about) == 0 && S_ISDIR(about.st_mode))
        status = fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: found a directory, expected a file",
                                 path);
    else
        status = read_all(descriptor, path, max_bytes, text, bytes, error);
    close(descriptor);
    return status;
}

/* ---- numbers
 * ----------------------------------------------------------------------------------------- */

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

bool fovea_text_number(const char *text, double *value)
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

bool fovea_text_integer(const char *text, int64_t *value)
{
    if (!is_decimal(text, true)) return false;
    errno = 0;
    const long long number = strtoll(text, NULL, 10);
    if (errno != 0) return false;
    *value = number;
    return true;
}

/* ---- error lines
 * ------------------------------------------------------------------------------------- */

const char *fovea_text_quote(const char *text, char *quoted, size_t bytes)
{
    enum { SHOWN = 48, TAIL = 5 /* "...'" and the zero */ };
    size_t used = 0;
    if (bytes < 16) {
        if (bytes > 0) quoted[0] = '\0';
        return quoted;
    }
    quoted[used++] = '\'';
    size_t i = 0;
    for (; text[i] != '\0' && i < SHOWN; ++i) {
        const unsigned char c = (unsigned char)text[i];
        const bool plain = c >= 32 && c < 127;
        if (used + (plain ? 1 : 4) + TAIL > bytes) break;
        if (plain)
            quoted[used++] = (char)c;
        else
            used += (size_t)snprintf(quoted + used, 5, "\\x%02X", c);
    }
    snprintf(quoted + used, bytes - used, text[i] != '\0' ? "...'" : "'");
    return quoted;
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
    for (size_t j = 0; j <= n; ++j)
        rows[0][j] = (int)j;
    for (size_t i = 1; i <= m; ++i) {
        int *now = rows[i % 3];
        const int *last = rows[(i + 2) % 3], *before = rows[(i + 1) % 3];
        now[0] = (int)i;
        for (size_t j = 1; j <= n; ++j) {
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

const char *fovea_text_nearest(const char *word, const char *const *names, size_t name_count)
{
    const size_t length = strnlen(word, COMPARED);
    const char *nearest = NULL;
    int least = COMPARED + 1;
    for (size_t i = 0; i < name_count; ++i) {
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
