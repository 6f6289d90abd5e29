/* The configuration as commented YAML. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "app/config/settings.h"
#include "support/utf8.h"
#include "support/text.h"

enum { COMMENT_COLUMNS = 110 };

/* Words of `text`, broken into comment lines. `column` is where the line stands; returns where it
 * ends. */
static int wrap(FILE *file, int indent, int column, const char *text)
{
    while (*text != '\0') {
        int length = (int)strcspn(text, " ");
        if (column + 1 + length > COMMENT_COLUMNS) {
            fprintf(file, "\n%*s#  ", indent, "");
            column = indent + 3;
        }
        column += fprintf(file, " %.*s", length, text);
        text += length;
        text += strspn(text, " ");
    }
    return column;
}

bool fv_settings_has_auto(const struct fv_settings_key *key)
{
    size_t count = 0;
    if (key->kind != FV_CONFIG_FLAGS) return false;
    while (key->choices[count] != NULL)
        count++;
    return key->max >> count != 0;
}

void fv_settings_range_print(const struct fv_settings_key *key, char *range, size_t bytes)
{
    const char *unit = key->unit, *space = unit[0] != '\0' ? " " : "";
    size_t used = 0;
    switch (key->kind) {
    case FV_CONFIG_U32:
    case FV_CONFIG_U64:
    case FV_CONFIG_I32:
        snprintf(range, bytes, "%" PRId64 " to %" PRId64 "%s%s", key->min, key->max, space, unit);
        return;
    case FV_CONFIG_REAL:
        snprintf(range, bytes, "%g to %g%s%s", key->real_min, key->real_max, space, unit);
        return;
    case FV_CONFIG_BOOL:
        snprintf(range, bytes, "true | false");
        return;
    case FV_CONFIG_CHOICE:
        for (size_t i = 0; key->choices[i] != NULL && used < bytes; i++)
            used += (size_t)snprintf(range + used, bytes - used, "%s%s", i > 0 ? " | " : "",
                                     key->choices[i]);
        return;
    case FV_CONFIG_LIST:
    case FV_CONFIG_FLAGS:
        used = (size_t)snprintf(range, bytes, "%sa list of",
                                fv_settings_has_auto(key) ? "auto | " : "");
        for (size_t i = 0; key->choices[i] != NULL && used < bytes; i++)
            used += (size_t)snprintf(range + used, bytes - used, "%s %s", i > 0 ? "," : "",
                                     key->choices[i]);
        return;
    case FV_CONFIG_TEXT:
        snprintf(range, bytes, "%s, at most %" PRId64 " bytes", unit[0] != '\0' ? unit : "text",
                 key->max);
        return;
    case FV_CONFIG_TRANSFORM:
        snprintf(range, bytes, "R: a rotation; t: %" PRId64 " to %" PRId64 "%s%s", key->min,
                 key->max, space, unit);
        return;
    }
}

static void comment(FILE *file, const struct fv_settings_key *key, int indent)
{
    char range[FV_SETTINGS_RANGE_BYTES];
    int column = fprintf(file, "%*s#", indent, "");
    char bracketed[FV_SETTINGS_RANGE_BYTES + 7];
    fv_settings_range_print(key, range, sizeof range);
    snprintf(bracketed, sizeof bracketed, "[%s]%s", range, key->live ? " live" : "");
    wrap(file, indent, column, key->help);
    column = fprintf(file, "\n%*s#", indent, "") - 1;
    column = wrap(file, indent, column, bracketed);
    if (key->cost != NULL) {
        column = wrap(file, indent, column, "cost:");
        wrap(file, indent, column, key->cost);
    }
    fprintf(file, "\n");
}

/* The shortest of the usual lengths that reads back to the same number, wherever the locale puts
 * its point.
 */
static void number(FILE *file, double value)
{
    char text[40];
    for (int digits = 15; digits <= 17; digits++) {
        double back;
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (fv_text_number(text, &back) && back == value) break;
    }
    fputs(text, file);
}

/* What YAML lets stand in double quotes as itself: not its line breaks, not control characters. */
static bool stands_as_itself(uint32_t code)
{
    return (code >= 0x20 && code < 0x7f) || (code >= 0xa0 && code != 0x2028 && code != 0x2029 &&
                                             code != 0xfeff && code != 0xfffe && code != 0xffff);
}

static void quoted(FILE *file, const char *text)
{
    uint32_t code;
    fputc('"', file);
    for (int bytes; (bytes = fv_utf8_decode(text, &code)) > 0; text += bytes) {
        if (code == '"' || code == '\\')
            fprintf(file, "\\%c", (int)code);
        else if (stands_as_itself(code))
            fprintf(file, "%.*s", bytes, text);
        else
            fprintf(file, "\\u%04x", (unsigned)code);
    }
    fputc('"', file);
}

static void list_print(FILE *file, const struct fv_settings_key *key, const uint32_t *list)
{
    fputc('[', file);
    for (uint32_t i = 0; i < list[0]; i++)
        fprintf(file, "%s%s", i == 0 ? "" : ", ", key->choices[list[1 + i]]);
    fputc(']', file);
}

static void flags_print(FILE *file, const struct fv_settings_key *key, uint32_t flags)
{
    const char *before = "";
    if (fv_settings_has_auto(key) && flags == (uint32_t)key->max) {
        fputs("auto", file);
        return;
    }
    fputc('[', file);
    for (int i = 0; key->choices[i] != NULL; i++) {
        if (!(flags >> i & 1)) continue;
        fprintf(file, "%s%s", before, key->choices[i]);
        before = ", ";
    }
    fputc(']', file);
}

void fv_settings_value_print(FILE *file, const struct fv_settings *settings,
                             const struct fv_settings_key *key)
{
    const char *at = (const char *)settings + key->offset;
    switch (key->kind) {
    case FV_CONFIG_U32:
        fprintf(file, "%" PRIu32, *(const uint32_t *)at);
        return;
    case FV_CONFIG_U64:
        fprintf(file, "%" PRIu64, *(const uint64_t *)at);
        return;
    case FV_CONFIG_I32:
        fprintf(file, "%" PRId32, *(const int32_t *)at);
        return;
    case FV_CONFIG_BOOL:
        fputs(*(const bool *)at ? "true" : "false", file);
        return;
    case FV_CONFIG_REAL:
        number(file, *(const double *)at);
        return;
    case FV_CONFIG_TEXT:
        quoted(file, at);
        return;
    case FV_CONFIG_CHOICE:
        fputs(key->choices[*(const int *)at], file);
        return;
    case FV_CONFIG_FLAGS:
        flags_print(file, key, *(const uint32_t *)at);
        return;
    case FV_CONFIG_LIST:
        list_print(file, key, (const uint32_t *)at);
        return;
    case FV_CONFIG_TRANSFORM:
        for (int i = 0; i < 12; i++) {
            fputs(i == 0 ? "[[" : i % 4 == 0 ? "], [" : ", ", file);
            number(file, ((const double *)at)[i]);
        }
        fputs("]]", file);
        return;
    }
}

char *fv_settings_value_text(const struct fv_settings *settings, const struct fv_settings_key *key)
{
    char *value = NULL;
    size_t bytes = 0;
    FILE *memory = open_memstream(&value, &bytes);
    if (memory == NULL) return NULL;
    fv_settings_value_print(memory, settings, key);
    if (fclose(memory) == 0) return value;
    free(value);
    return NULL;
}

void fv_settings_print(FILE *file, const struct fv_settings *settings, bool commented)
{
    const char *section = "";
    if (commented)
        fprintf(
            file,
            "# Configuration of Fovea %s. Any key may be left out; 'fovea run --set key=value' overrides one.\n",
            FOVEA_VERSION);
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        const struct fv_settings_key *key = &fv_settings_keys[i];
        const char *dot = strchr(key->name, '.');
        size_t length = dot != NULL ? (size_t)(dot - key->name) : 0;
        int indent = length > 0 ? 2 : 0;
        if (length > 0 && (strncmp(section, key->name, length) != 0 || section[length] != '.')) {
            fprintf(file, "%s%.*s:\n", commented ? "\n" : "", (int)length, key->name);
            section = key->name;
        } else if (commented) {
            fprintf(file, "\n");
        }
        if (commented) comment(file, key, indent);
        fprintf(file, "%*s%s: ", indent, "", dot != NULL ? dot + 1 : key->name);
        fv_settings_value_print(file, settings, key);
        fprintf(file, "\n");
    }
}
