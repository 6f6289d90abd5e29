/* The description of types that a recording carries: it names every type, and a reader accepts
 * those that it knows and refuses, by line, those that it would misread. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "app/record/recording_types.h"
#include "message/fields.h"

static char *text;
static size_t text_bytes;

static int make_text(void **state)
{
    (void)state;
    text = fv_recording_types_text(&text_bytes);
    return text != NULL ? 0 : -1;
}

static int free_text(void **state)
{
    (void)state;
    free(text);
    return 0;
}

static void every_type_is_described(void **state)
{
    (void)state;
    int32_t count;
    const struct fovea_type *types = fv_message_types(&count);
    assert_int_equal(strlen(text), text_bytes);
    for (int32_t i = 0; i < count; i++) {
        char line[128], definition[128];
        snprintf(line, sizeof line, "//! type %s %016llx\n", types[i].name,
                 (unsigned long long)types[i].hash());
        snprintf(definition, sizeof definition, "struct %s {", strchr(types[i].name, '.') + 1);
        const char *at = strstr(text, line);
        if (at == NULL) fail_msg("%s: found no description", types[i].name);
        const char *next = strstr(at + 1, "//! type "), *begins = strstr(at, definition);
        if (begins == NULL || (next != NULL && begins > next))
            fail_msg("%s: found no definition behind its name", types[i].name);
    }
    struct fovea_error error;
    assert_int_equal(fv_recording_types_check("log", 0, text, text_bytes, &error), FOVEA_OK);
}

/* The text with the line of `type` replaced; the caller frees it. */
static char *with_line(const char *type, const char *line)
{
    char start[96];
    snprintf(start, sizeof start, "//! type %s ", type);
    const char *at = strstr(text, start), *end = strchr(at, '\n');
    char *changed = malloc(text_bytes + strlen(line) + 1);
    memcpy(changed, text, (size_t)(at - text));
    strcpy(changed + (at - text), line);
    strcat(changed, end);
    return changed;
}

static void assert_refused(const char *type, const char *line, enum fovea_status expected,
                           const char *said)
{
    struct fovea_error error;
    char *changed = with_line(type, line);
    assert_int_equal(fv_recording_types_check("a.lcm", 77, changed, strlen(changed), &error),
                     expected);
    if (strstr(error.text, "a.lcm: byte 77: types: ") == NULL || strstr(error.text, said) == NULL)
        fail_msg("%s", error.text);
    free(changed);
}

static void other_types_of_the_same_name_are_refused(void **state)
{
    (void)state;
    assert_refused("bot_core.pose_t", "//! type bot_core.pose_t 00000000000000ff",
                   FOVEA_ERROR_UNSUPPORTED,
                   "line 1: found bot_core.pose_t with hash 00000000000000ff, expected ");
    assert_refused("bot_core.pose_t", "//! type bot_core.pose_t ff", FOVEA_ERROR_INPUT,
                   "line 1: found no name and hash of a type");
    assert_refused("bot_core.pose_t", "//! type bot_core.pose_t 00000000000000fg",
                   FOVEA_ERROR_INPUT, "line 1: found no name and hash of a type");
    assert_refused("bot_core.pose_t", "//! type  00000000000000ff", FOVEA_ERROR_INPUT,
                   "line 1: found no name and hash of a type");
    assert_refused("fovea.inputs_t", "", FOVEA_ERROR_INPUT, "found no fovea.inputs_t, expected it");
}

/* A later version adds types, an earlier one lacks some. */
static void other_versions_of_format_4_are_read(void **state)
{
    (void)state;
    static const char *const lines[] = {"", "//! type fovea.tag_t 0123456789abcdef"};
    for (int i = 0; i < 2; i++) {
        struct fovea_error error;
        char *changed = with_line("fovea.scan_t", lines[i]);
        if (fv_recording_types_check("log", 0, changed, strlen(changed), &error) != FOVEA_OK)
            fail_msg("%s", error.text);
        free(changed);
    }
}

/* Any damage is either refused or harmless, and nothing beyond the bytes is read. */
static void damage_is_survived(void **state)
{
    (void)state;
    uint32_t seed = 1;
    for (int round = 0; round < 2000; round++) {
        const size_t bytes = (seed = seed * 1664525u + 1013904223u) % text_bytes;
        char *exact = malloc(bytes + 1);
        struct fovea_error error;
        memcpy(exact, text, bytes);
        exact[(seed >> 8) % (bytes + 1)] = (char)(seed >> 24);
        exact = realloc(exact, bytes > 0 ? bytes : 1);
        const enum fovea_status status = fv_recording_types_check("log", 0, exact, bytes, &error);
        assert_true(status == FOVEA_OK || status == FOVEA_ERROR_INPUT ||
                    status == FOVEA_ERROR_UNSUPPORTED);
        if (bytes < text_bytes / 2) assert_int_not_equal(status, FOVEA_OK);
        free(exact);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_type_is_described),
        cmocka_unit_test(other_types_of_the_same_name_are_refused),
        cmocka_unit_test(other_versions_of_format_4_are_read),
        cmocka_unit_test(damage_is_survived),
    };
    return cmocka_run_group_tests(tests, make_text, free_text);
}
