#include "arguments.h"

#include <string.h>

#include "support/say.h"
#include "support/text.h"

enum kind { PREFIX, TEXT, NUMBER, POSITIVE, WHOLE, NOT_ZERO };

struct argument {
    const char *name;
    enum kind kind;
    void *target;
    bool with_key; /* means nothing without --key */
};

static const char *const expected[] = {
    [PREFIX] = "1 to 31 bytes",      [TEXT] = "a text",
    [NUMBER] = "a number of metres", [POSITIVE] = "a number above 0, at most 100",
    [WHOLE] = "a whole number",      [NOT_ZERO] = "a whole number other than 0",
};

static bool fits(const struct argument *argument, const char *value)
{
    double *number = argument->target;
    int64_t *whole = argument->target;
    switch (argument->kind) {
    case PREFIX:
    case TEXT:
        *(const char **)argument->target = value;
        return value[0] != '\0' &&
               (argument->kind == TEXT || strlen(value) <= NAVIGATE_PREFIX_BYTES_MAX);
    case NUMBER:
        return fv_text_number(value, number);
    case POSITIVE:
        return fv_text_number(value, number) && *number > 0 && *number <= 100;
    case WHOLE:
        return fv_text_integer(value, whole);
    case NOT_ZERO:
        return fv_text_integer(value, whole) && *whole != 0;
    }
    return false;
}

/* `value` NULL: there is none. */
static bool take(const struct argument *argument, const char *value)
{
    if (value != NULL && fits(argument, value)) return true;
    fv_say_wrong("navigate: %s: found %s%s%s, expected %s", argument->name,
                 value != NULL ? "'" : "", value != NULL ? value : "no value",
                 value != NULL ? "'" : "", expected[argument->kind]);
    return false;
}

static const struct argument *find(const struct argument *options, const char *name)
{
    while (options->name != NULL && strcmp(options->name, name) != 0)
        options++;
    if (options->name != NULL) return options;
    fv_say_wrong("navigate: found '%s', expected --url, --prefix, --radius, --speed, --turning, "
                 "--patience, --key, --run-id or --sender",
                 name);
    return NULL;
}

bool navigate_arguments_read(struct navigate_arguments *arguments, int argc, char **argv)
{
    const struct argument goal[] = {{"X", NUMBER, &arguments->goal[0], false},
                                    {"Y", NUMBER, &arguments->goal[1], false}};
    const struct argument options[] = {
        {"--url", TEXT, &arguments->url, false},
        {"--prefix", PREFIX, &arguments->prefix, false},
        {"--radius", POSITIVE, &arguments->robot.radius_m, false},
        {"--speed", POSITIVE, &arguments->robot.speed_m_s, false},
        {"--turning", POSITIVE, &arguments->robot.turning_rad_s, false},
        {"--patience", POSITIVE, &arguments->patience_s, false},
        {"--key", TEXT, &arguments->key_path, false},
        {"--run-id", NOT_ZERO, &arguments->run_id, true},
        {"--sender", WHOLE, &arguments->sender, true},
        {0},
    };
    const char *keyless = NULL;
    for (int k = 0; k < 2; k++)
        if (!take(&goal[k], 1 + k < argc ? argv[1 + k] : NULL)) return false;
    for (int i = 3; i < argc; i += 2) {
        const struct argument *option = find(options, argv[i]);
        if (option == NULL || !take(option, i + 1 < argc ? argv[i + 1] : NULL)) return false;
        if (option->with_key) keyless = option->name;
    }
    if (keyless == NULL || arguments->key_path != NULL) return true;
    fv_say_wrong("navigate: %s: found without --key, expected both", keyless);
    return false;
}
