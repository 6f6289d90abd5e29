/* The table of keys: the library, the program and the comments of the public headers agree with its
 * rows. */
#include <ctype.h>
#include <glob.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "app/config/settings.h"
#include "runtime/config.h"
#include "support/text.h"

/* ---- the comments of the public headers ------------------------------------------------------ */

struct member {
    const char *path; /* in struct fovea_config */
    enum fv_config_kind kind;
    double min, max;
    const char *value; /* as the row writes it */
};

static const struct member members[] = {
#define FV_KEY(name, kind, member, min, max, value, unit, words, cost, help)                       \
    {#member, FV_CONFIG_##kind, (double)(min), (double)(max), #value},
#include "runtime/config.def"
};

/* All public headers one after the other, and the same text with spaces in place of comments. */
static char *headers, *code;

static int headers_read(void **state)
{
    (void)state;
    glob_t found;
    size_t used = 0;
    struct fovea_error error;
    assert_int_equal(glob("include/fovea/*.h", 0, NULL, &found), 0);
    for (size_t i = 0; i < found.gl_pathc; i++) {
        char *text;
        size_t bytes;
        assert_int_equal(fv_text_read(found.gl_pathv[i], 1 << 20, &text, &bytes, &error), FOVEA_OK);
        headers = realloc(headers, used + bytes + 1);
        memcpy(headers + used, text, bytes);
        used += bytes;
        headers[used] = '\0';
        free(text);
    }
    globfree(&found);
    code = strdup(headers);
    for (char *open = code, *end; (open = strstr(open, "/*")) != NULL; open = end) {
        end = strstr(open, "*/");
        assert_non_null(end);
        end += 2;
        memset(open, ' ', (size_t)(end - open));
    }
    return 0;
}

static int headers_free(void **state)
{
    (void)state;
    free(headers);
    free(code);
    return 0;
}

/* Where `name` is declared in the struct called so, as an index into both texts; 0: nowhere. */
static size_t declaration(const char *structure, const char *name)
{
    char begin[64];
    snprintf(begin, sizeof begin, "struct %s {", structure);
    const char *from = strstr(code, begin);
    if (from == NULL) return 0;
    const char *end = strstr(from, "\n};");
    const size_t length = strlen(name);
    for (const char *at = from; (at = strstr(at, name)) != NULL && at < end; at++) {
        const bool alone = isspace((unsigned char)at[-1]) || at[-1] == '*';
        if (alone && strchr(";,[", at[length]) != NULL) return (size_t)(at - code);
    }
    return 0;
}

/* The comment of the declaration: behind it on its line, or else before it; on one line. */
static void comment_of(size_t at, char *comment, size_t bytes)
{
    const char *from = strchr(headers + at, ';');
    const char *line = strchr(from, '\n'), *open = strstr(from, "/*");
    if (open == NULL || open > line) {
        size_t end = at;
        open = NULL;
        while (end > 0 && code[end - 1] != ';' && open == NULL) {
            end--;
            if (strncmp(headers + end, "/*", 2) == 0) open = headers + end;
        }
    }
    size_t used = 0;
    for (; open != NULL && strncmp(open, "*/", 2) != 0 && used + 1 < bytes; open++) {
        const bool space = isspace((unsigned char)*open) || *open == '*';
        if (!space || (used > 0 && comment[used - 1] != ' ')) comment[used++] = space ? ' ' : *open;
    }
    comment[used] = '\0';
}

/* "default 1" is not in "default 15". */
static bool says_default(const char *comment, const char *value)
{
    char text[64];
    const int length = snprintf(text, sizeof text, "default %s", value);
    for (const char *at = comment; (at = strstr(at, text)) != NULL; at++) {
        const char next = at[length];
        if (!isalnum((unsigned char)next) &&
            !(next == '.' && isdigit((unsigned char)at[length + 1])))
            return true;
    }
    return false;
}

static void headers_name_range_and_default_of_every_key(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof members / sizeof members[0]; i++) {
        const struct member *member = &members[i];
        const char *dot = strrchr(member->path, '.'), *name = dot != NULL ? dot + 1 : member->path;
        char structure[64] = "fovea_config", comment[1024], range[64];
        const char *inner = strrchr(member->path, '.');
        while (inner != NULL && inner > member->path && inner[-1] != '.')
            inner--; /* "preprocess.gamma" of "image.preprocess.gamma" */
        /* "detect2.count_max" is of the second struct fovea_detect_config */
        if (strncmp(member->path, "rig.cameras", 11) == 0)
            snprintf(structure, sizeof structure, "fovea_rig_camera");
        else if (dot != NULL)
            snprintf(structure, sizeof structure, "fovea_%.*s_config", (int)strcspn(inner, ".2"),
                     inner);
        const size_t at = declaration(structure, name);
        if (at == 0) fail_msg("struct %s: no member %s", structure, name);
        comment_of(at, comment, sizeof comment);
        if (!says_default(comment, member->value))
            fail_msg("%s: 'default %s' is not in: %s", member->path, member->value, comment);
        if (member->kind != FV_CONFIG_U32 && member->kind != FV_CONFIG_REAL &&
            member->kind != FV_CONFIG_TEXT)
            continue;
        snprintf(range, sizeof range, "[%.10g, %.10g]", member->min, member->max);
        if (strstr(comment, range) == NULL)
            fail_msg("%s: '%s' is not in: %s", member->path, range, comment);
    }
}

/* ---- the library's own check ----------------------------------------------------------------- */

static struct fv_settings settings;
static struct fovea_error error;

/* fv_settings_check hands the runtime's struct to the library's check. */
static void assert_refused(const struct fv_settings_key *key)
{
    char name[64];
    assert_int_equal(fv_settings_check(&settings, &error), FOVEA_ERROR_INPUT);
    snprintf(name, sizeof name, "%s (default): found ", key->name);
    if (strstr(error.text, name) == NULL) fail_msg("'%s' is not in: %s", name, error.text);
}

static void library_checks_the_range_of_every_key(void **state)
{
    (void)state;
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        const struct fv_settings_key *key = &fv_settings_keys[i];
        if (key->offset >= sizeof settings.runtime) continue; /* the program's own */
        char *at = (char *)&settings + key->offset;
        fv_settings_default(&settings);
        assert_int_equal(fv_settings_check(&settings, &error), FOVEA_OK);
        switch (key->kind) {
        case FV_CONFIG_U32:
            *(uint32_t *)at = (uint32_t)key->max + 1;
            assert_refused(key);
            if (key->min > 0) {
                *(uint32_t *)at = (uint32_t)key->min - 1;
                assert_refused(key);
            }
            break;
        case FV_CONFIG_LIST:
            *(uint32_t *)at = (uint32_t)key->max + 1;
            assert_refused(key);
            break;
        case FV_CONFIG_CHOICE:
            *(int *)at = (int)key->max + 1;
            assert_refused(key);
            *(int *)at = -1;
            assert_refused(key);
            break;
        case FV_CONFIG_REAL:
            *(double *)at = key->real_max * 1.001;
            assert_refused(key);
            *(double *)at = key->real_min - 0.001;
            assert_refused(key);
            break;
        case FV_CONFIG_TRANSFORM:
            ((double *)at)[3] = key->real_max * 1.001;
            assert_refused(key);
            break;
        case FV_CONFIG_TEXT:
            memset(at, 'a', (size_t)key->max + 1); /* no zero at the end */
            assert_refused(key);
            break;
        default:
            break;
        }
    }
}

static void a_choice_has_a_word_for_each_of_its_values(void **state)
{
    (void)state;
    int choices = 0;
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        const struct fv_settings_key *key = &fv_settings_keys[i];
        int64_t count = 0;
        if (key->kind == FV_CONFIG_CHOICE) {
            while (key->choices[count] != NULL)
                count++;
            assert_int_equal(count, key->max + 1);
            choices++;
        } else {
            assert_true((key->choices != NULL) ==
                        (key->kind == FV_CONFIG_FLAGS || key->kind == FV_CONFIG_LIST));
        }
    }
    assert_true(choices > 0);
}

static void the_manual_is_that_of_the_table(void **state)
{
    (void)state;
    char *made = NULL, *committed;
    size_t made_bytes = 0, committed_bytes;
    FILE *file = open_memstream(&made, &made_bytes);
    fv_settings_default(&settings);
    fv_settings_markdown(file, &settings);
    fclose(file);
    assert_int_equal(
        fv_text_read("docs/configuration.md", 1 << 20, &committed, &committed_bytes, &error),
        FOVEA_OK);
    if (made_bytes != committed_bytes || memcmp(made, committed, made_bytes) != 0)
        fail_msg("docs/configuration.md is not of this table of keys: run make docs");
    free(made);
    free(committed);
}

/* A file of settings that is restored could otherwise have any file of the host read, written or
 * deleted. What a step may change is never the host's. */
static void keys_that_name_files_are_of_the_host(void **state)
{
    static const char *const units[] = {"file", "folder", "file or folder/", "URI", "URL", "files"};
    uint32_t found = 0;
    (void)state;
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        const struct fv_settings_key *key = &fv_settings_keys[i];
        bool names = key->kind == FV_CONFIG_TEXT && key->max >= FV_SETTINGS_PATH_BYTES - 1;
        for (size_t k = 0; k < sizeof units / sizeof units[0]; k++)
            names = names || strcmp(key->unit, units[k]) == 0;
        if (names && !key->host) fail_msg("%s: found no FV_HOST_KEY, expected one", key->name);
        if (key->live && key->host) fail_msg("%s: found a live key of the host", key->name);
        found += names;
    }
    assert_true(found >= 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(headers_name_range_and_default_of_every_key),
        cmocka_unit_test(library_checks_the_range_of_every_key),
        cmocka_unit_test(a_choice_has_a_word_for_each_of_its_values),
        cmocka_unit_test(the_manual_is_that_of_the_table),
        cmocka_unit_test(keys_that_name_files_are_of_the_host),
    };
    return cmocka_run_group_tests(tests, headers_read, headers_free);
}
