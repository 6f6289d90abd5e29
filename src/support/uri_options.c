#include "support/uri_options.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "support/text.h"

enum { OPTIONS_MAX = 64 };

void fv_uri_next_word(const char **at, const char *stops, char word[FV_URI_WORD_BYTES])
{
    const size_t length = strcspn(*at, stops),
                 kept = length < FV_URI_WORD_BYTES - 1 ? length : FV_URI_WORD_BYTES - 1;
    memcpy(word, *at, kept);
    word[kept] = '\0';
    *at += length;
}

enum fovea_status fv_uri_unknown(const char *scheme, const char *what, const char *found,
                                 const char *const *names, size_t count, struct fovea_error *error)
{
    char quoted[FV_TEXT_QUOTED_BYTES], list[256];
    const char *like = fv_text_nearest(found, names, count);
    size_t used = 0;
    list[0] = '\0';
    for (size_t i = 0; i < count && used < sizeof list; i++)
        used +=
            (size_t)snprintf(list + used, sizeof list - used, "%s%s", i == 0 ? "" : " ", names[i]);
    fv_text_quote(found, quoted, sizeof quoted);
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: unknown %s %s%s%s%s expected one of: %s",
                           scheme, what, quoted, like != NULL ? ", did you mean '" : ";",
                           like != NULL ? like : "", like != NULL ? "'?" : "", list);
}

static bool store_word(void *to, const struct fv_uri_option *option, const char *value)
{
    for (int32_t i = 0; option->words[i] != NULL; i++) {
        if (strcmp(value, option->words[i]) != 0) continue;
        memcpy(to, &i, sizeof i);
        return true;
    }
    return false;
}

static bool store_set(void *to, const struct fv_uri_option *option, const char *text)
{
    uint32_t set = 0;
    for (;; text++) {
        char word[FV_URI_WORD_BYTES];
        int32_t index;
        fv_uri_next_word(&text, ",", word);
        if (!store_word(&index, option, word)) return false;
        set |= 1u << index;
        if (*text == '\0') break;
    }
    memcpy(to, &set, sizeof set);
    return true;
}

static bool store_number(void *to, const struct fv_uri_option *option, const char *text)
{
    double value;
    int64_t whole;
    if (option->kind == FV_URI_REAL) {
        if (!fv_text_number(text, &value) || value < option->low || value > option->high)
            return false;
        *(double *)to = value;
        return true;
    }
    if (!fv_text_integer(text, &whole) || whole < (int64_t)option->low ||
        whole > (int64_t)option->high)
        return false; /* bounds are whole here; as doubles, 2^53 and one more are the same */
    if (option->kind == FV_URI_U64) *(uint64_t *)to = (uint64_t)whole;
    if (option->kind == FV_URI_I32) *(int32_t *)to = (int32_t)whole;
    if (option->kind == FV_URI_FLAG) *(bool *)to = whole != 0;
    return true;
}

static bool store_pose(struct fv_uri_pose *to, const struct fv_uri_option *option, const char *text)
{
    double value[6] = {0, 0, 0, 0, 0, 0};
    char word[FV_URI_WORD_BYTES];
    int count = 0;
    while (count < 6) {
        const double low = count < 3 ? option->low : -180, high = count < 3 ? option->high : 180;
        fv_uri_next_word(&text, ",", word);
        if (!fv_text_number(word, &value[count]) || value[count] < low || value[count] > high)
            return false;
        count++;
        if (*text == '\0' || count == 6) break;
        text++;
    }
    if (*text != '\0' || (count != 3 && count != 6)) return false;
    memcpy(to->position_m, value, sizeof to->position_m);
    memcpy(to->rotation_deg, value + 3, sizeof to->rotation_deg);
    return true;
}

/* Behind the point, for a bound: none where it is whole. */
static int digits_of(double bound)
{
    return bound == (double)(int64_t)bound ? 0 : 2;
}

static enum fovea_status store(const struct fv_uri_table *table, const struct fv_uri_option *option,
                               const char *value, void *options, struct fovea_error *error)
{
    char quoted[FV_TEXT_QUOTED_BYTES];
    void *to = (char *)options + option->offset;
    const bool word = option->kind == FV_URI_WORD, set = option->kind == FV_URI_SET,
               pose = option->kind == FV_URI_POSE;
    if (word   ? store_word(to, option, value)
        : set  ? store_set(to, option, value)
        : pose ? store_pose(to, option, value)
               : store_number(to, option, value))
        return FOVEA_OK;
    fv_text_quote(value, quoted, sizeof quoted);
    if (pose)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: %s: found %s, expected X,Y,Z or X,Y,Z,RX,RY,RZ in [%.*f, %.*f] metres and [-180, 180] degrees (%s)",
            table->scheme, option->name, quoted, digits_of(option->low), option->low,
            digits_of(option->high), option->high, option->unit);
    if (word || set)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: %s: found %s, expected %s",
                               table->scheme, option->name, quoted, option->unit);
    return fovea_error_set(
        error, FOVEA_ERROR_INPUT, "%s: %s: found %s, expected %s in [%.*f, %.*f] (%s)",
        table->scheme, option->name, quoted,
        option->kind == FV_URI_REAL ? "a number" : "a whole number", digits_of(option->low),
        option->low, digits_of(option->high), option->high, option->unit);
}

/* The error for a name of 0.1 that has another one now; FOVEA_OK for all others. */
static enum fovea_status refuse_renamed(const struct fv_uri_table *table, const char *name,
                                        struct fovea_error *error)
{
    for (size_t i = 0; table->renamed != NULL && table->renamed[i][0] != NULL; i++)
        if (strcmp(name, table->renamed[i][0]) == 0)
            return fovea_error_set(
                error, FOVEA_ERROR_INPUT,
                "%s: %s: found an option that Fovea 0.1 reads, expected its name now, '%s'",
                table->scheme, name, table->renamed[i][1]);
    return FOVEA_OK;
}

/* One "name=value". */
static enum fovea_status parse_option(const struct fv_uri_table *table, char *text, void *options,
                                      uint64_t *given, struct fovea_error *error)
{
    const char *names[OPTIONS_MAX + 1];
    const size_t prefix = table->other_prefix != NULL ? strlen(table->other_prefix) : 0;
    const struct fv_uri_option *option = NULL;
    char *value = strchr(text, '=');
    if (value != NULL) *value++ = '\0';
    const bool other = prefix > 0 && strncmp(text, table->other_prefix, prefix) == 0;
    for (size_t i = 0; i < table->count; i++) {
        names[i] = table->options[i].name;
        if (strcmp(text, names[i]) != 0) continue;
        option = &table->options[i];
        if (*given >> i & 1)
            return fovea_error_set(error, FOVEA_ERROR_INPUT,
                                   "%s: %s: found a second time, expected once", table->scheme,
                                   text);
        *given |= UINT64_C(1) << i;
    }
    names[table->count] = table->other_prefix;
    if (option == NULL && refuse_renamed(table, text, error) != FOVEA_OK) return FOVEA_ERROR_INPUT;
    if (option == NULL && !other)
        return fv_uri_unknown(table->scheme, "option", text, names, table->count + (prefix > 0),
                              error);
    if (value == NULL)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: %s: found no value, expected %s=VALUE (%s)", table->scheme,
                               text, text, other ? "of a control" : option->unit);
    return other ? table->other(options, text + prefix, value, error)
                 : store(table, option, value, options, error);
}

enum fovea_status fv_uri_options_parse(const struct fv_uri_table *table, const char *text,
                                       void *options, uint64_t *given, struct fovea_error *error)
{
    char word[FV_URI_WORD_BYTES];
    *given = 0;
    while (*text != '\0') {
        fv_uri_next_word(&text, "&", word);
        if (*text != '\0') text++;
        if (word[0] == '\0') continue;
        const enum fovea_status status = parse_option(table, word, options, given, error);
        if (status != FOVEA_OK) return status;
    }
    return FOVEA_OK;
}
