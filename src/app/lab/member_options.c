#include "app/lab/member_options.h"

#include <stdio.h>
#include <string.h>

#include "support/text.h"

static bool is_flag(const struct fv_member_option *option)
{
    return option->kind == FV_MEMBER_SET_0 || option->kind == FV_MEMBER_SET_1;
}

void fv_member_options_join(struct fv_option *options, const struct fv_option *more)
{
    int end = 0;
    while (options[end].name != NULL)
        end++;
    for (; more->name != NULL && end < FV_OPTIONS_MAX; more++)
        options[end++] = *more;
    options[end] = (struct fv_option){0};
}

void fv_member_options_offer(struct fv_member_options *members, struct fv_option *options)
{
    struct fv_option rows[FV_MEMBER_OPTIONS_MAX + 1] = {{0}};
    for (int i = 0; members->table[i].option != NULL && i < FV_MEMBER_OPTIONS_MAX; i++) {
        const struct fv_member_option *row = &members->table[i];
        struct fv_member_given *given = &members->given[i];
        rows[i] = (struct fv_option){
            row->option, row->value, is_flag(row) ? FV_OPTION_FLAG : FV_OPTION_TEXT,
            is_flag(row) ? (void *)&given->flag : (void *)&given->text, row->help};
    }
    fv_member_options_join(options, rows);
}

static enum fovea_status store(const struct fv_member_option *row, const char *text, void *at,
                               struct fovea_error *error)
{
    double real = 0;
    int64_t whole = 0;
    switch (row->kind) {
    case FV_MEMBER_SET_0:
    case FV_MEMBER_SET_1:
        *(uint32_t *)at = row->kind == FV_MEMBER_SET_1;
        return FOVEA_OK;
    case FV_MEMBER_WHOLE:
        if (!fv_text_integer(text, &whole) || whole < 0 || whole > UINT32_MAX)
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                                   "--%s: found '%.100s', expected a whole number", row->option,
                                   text);
        *(uint32_t *)at = (uint32_t)whole;
        return FOVEA_OK;
    default:
        if (!fv_text_number(text, &real) || real < -1e9 || real > 1e9)
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                                   "--%s: found '%.100s', expected a number", row->option, text);
        if (row->kind == FV_MEMBER_REAL)
            *(double *)at = real;
        else
            *(float *)at = (float)real;
        return FOVEA_OK;
    }
}

enum fovea_status fv_member_options_read(const struct fv_member_options *members, uint32_t choices,
                                         void *config, struct fovea_error *error)
{
    for (int i = 0; members->table[i].option != NULL; i++) {
        const struct fv_member_option *row = &members->table[i];
        const struct fv_member_given *given = &members->given[i];
        if (given->text == NULL && !given->flag) continue;
        if ((row->with & choices) == 0)
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                                   "--%s: found it without effect, expected %s", row->option,
                                   row->needed);
        const enum fovea_status status =
            store(row, given->text, (char *)config + row->offset, error);
        if (status != FOVEA_OK) return status;
    }
    return FOVEA_OK;
}

void fv_member_options_name(const struct fv_member_options *members, struct fovea_error *error)
{
    for (int i = 0; members->table[i].option != NULL; i++) {
        const struct fv_member_option *row = &members->table[i];
        const size_t length = strlen(row->member);
        if (strncmp(error->text, row->member, length) != 0 || error->text[length] != ':') continue;
        const struct fovea_error wrong = *error;
        fovea_error_set(error, wrong.status, "--%s%s", row->option, wrong.text + length);
        return;
    }
}

enum fovea_status fv_choice_read(const char *option, const char *text, const char *(*name)(int),
                                 int count, int *found, struct fovea_error *error)
{
    char names[192] = "";
    size_t used = 0;
    if (text == NULL) return FOVEA_OK;
    for (int i = 0; i < count; i++)
        if (strcmp(text, name(i)) == 0) {
            *found = i;
            return FOVEA_OK;
        }
    for (int i = 0; i < count && used < sizeof names; i++) {
        const char *between = i == 0 ? "" : i == count - 1 ? " or " : ", ";
        used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", between, name(i));
    }
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "--%s: found '%.100s', expected %s", option,
                           text, names);
}
