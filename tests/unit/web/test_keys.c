/* The keys of the configuration for the page: strict JSON, every key once, and what each says is
 * what the table of keys says. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <zlib.h>

#include "app/config/settings.h"
#include "web/keys.h"

/* ---- a strict reader of what is expected: objects of texts, booleans and lists of texts --------
 */

static const char *at;

static void blank(void)
{
    at += strspn(at, " \t\r\n");
}

static bool comes(char c)
{
    blank();
    if (*at != c) return false;
    at++;
    return true;
}

/* The text that begins here, of at most 1023 bytes. */
static const char *text(char to[2048])
{
    size_t used = 0;
    if (!comes('"')) fail_msg("no text at %.40s", at);
    for (; *at != '"'; at++) {
        unsigned code;
        assert_true((unsigned char)*at >= ' ' && used < 2047);
        if (*at != '\\') {
            to[used++] = *at;
            continue;
        }
        at++;
        if (*at == 'u') {
            assert_int_equal(sscanf(at + 1, "%4x", &code), 1);
            assert_true(code < 128);
            to[used++] = (char)code;
            at += 4;
        } else {
            assert_non_null(strchr("\"\\", *at));
            to[used++] = *at;
        }
    }
    at++;
    to[used] = '\0';
    return to;
}

struct key {
    char name[2048], kind[2048], range[2048], help[2048], cost[2048], preset[2048];
    char words[16][2048];
    uint32_t word_count;
    bool live, has_cost;
};

static void words_read(struct key *key)
{
    assert_true(comes('['));
    do
        text(key->words[key->word_count++]);
    while (comes(','));
    assert_true(comes(']'));
}

static bool truth(void)
{
    blank();
    const bool yes = strncmp(at, "true", 4) == 0;
    assert_true(yes || strncmp(at, "false", 5) == 0);
    at += yes ? 4 : 5;
    return yes;
}

static void key_read(struct key *key)
{
    char member[2048];
    memset(key, 0, sizeof *key);
    assert_true(comes('{'));
    do {
        text(member);
        assert_true(comes(':'));
        if (strcmp(member, "name") == 0)
            text(key->name);
        else if (strcmp(member, "kind") == 0)
            text(key->kind);
        else if (strcmp(member, "range") == 0)
            text(key->range);
        else if (strcmp(member, "help") == 0)
            text(key->help);
        else if (strcmp(member, "default") == 0)
            text(key->preset);
        else if (strcmp(member, "words") == 0)
            words_read(key);
        else if (strcmp(member, "live") == 0)
            key->live = truth();
        else if (strcmp(member, "cost") == 0)
            key->has_cost = text(key->cost) != NULL;
        else
            fail_msg("found the member %s", member);
    } while (comes(','));
    assert_true(comes('}'));
}

/* ---- tests ----------------------------------------------------------------------------------- */

static const char *kind_expected(const struct fv_settings_key *key)
{
    return key->kind == FV_CONFIG_BOOL     ? "boolean"
           : key->kind == FV_CONFIG_CHOICE ? "choice"
           : key->kind == FV_CONFIG_U32 || key->kind == FV_CONFIG_U64 ||
                   key->kind == FV_CONFIG_I32 || key->kind == FV_CONFIG_REAL
               ? "number"
               : "text";
}

static void every_key_is_there_as_the_table_has_it(void **state)
{
    static struct fv_settings settings;
    static struct key key;
    size_t bytes;
    (void)state;
    char *json = (char *)fv_web_keys_json(&bytes);
    assert_non_null(json);
    assert_int_equal(strlen(json), bytes);
    fv_settings_default(&settings);
    at = json;
    assert_true(comes('['));
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        const struct fv_settings_key *row = &fv_settings_keys[i];
        char range[FV_SETTINGS_RANGE_BYTES], *preset = fv_settings_value_text(&settings, row);
        if (i > 0) assert_true(comes(','));
        key_read(&key);
        fv_settings_range_print(row, range, sizeof range);
        assert_string_equal(key.name, row->name);
        assert_string_equal(key.kind, kind_expected(row));
        assert_string_equal(key.range, range);
        assert_string_equal(key.help, row->help);
        assert_string_equal(key.preset, preset);
        assert_int_equal(key.live, row->live);
        assert_int_equal(key.has_cost, row->cost != NULL);
        if (row->cost != NULL) assert_string_equal(key.cost, row->cost);
        assert_int_equal(key.word_count > 0, row->kind == FV_CONFIG_CHOICE);
        for (uint32_t k = 0; k < key.word_count; k++)
            assert_string_equal(key.words[k], row->choices[k]);
        if (key.word_count > 0) assert_null(row->choices[key.word_count]);
        free(preset);
    }
    assert_true(comes(']'));
    blank();
    assert_int_equal(*at, '\0');
    free(json);
}

/* Some that are known by hand, so that the test does not only compare the table with itself. */
static void known_keys_say_what_they_are(void **state)
{
    static struct key key;
    size_t bytes, seen = 0;
    (void)state;
    char *json = (char *)fv_web_keys_json(&bytes);
    at = json;
    assert_true(comes('['));
    do {
        key_read(&key);
        if (strcmp(key.name, "odometry.sensors") == 0) {
            assert_string_equal(key.kind, "choice");
            assert_string_equal(key.preset, "auto");
            assert_int_equal(key.word_count, 5);
            assert_string_equal(key.words[4], "stereo_inertial");
            seen++;
        }
        if (strcmp(key.name, "map.keep") == 0) {
            assert_string_equal(key.kind, "number");
            assert_string_equal(key.preset, "3");
            assert_string_equal(key.range, "1 to 10 files");
            seen++;
        }
        if (strcmp(key.name, "map.overwrite") == 0) {
            assert_string_equal(key.kind, "boolean");
            assert_string_equal(key.preset, "false");
            seen++;
        }
        if (strcmp(key.name, "map.save") == 0) {
            assert_string_equal(key.kind, "text");
            assert_string_equal(key.preset, "\"\"");
            seen++;
        }
    } while (comes(','));
    assert_int_equal(seen, 4);
    free(json);
}

static void the_packed_ones_are_the_same(void **state)
{
    size_t plain_bytes, packed_bytes = 0;
    (void)state;
    uint8_t *plain = fv_web_keys_json(&plain_bytes), *packed = fv_web_keys_gzip(&packed_bytes),
            *again = malloc(plain_bytes + 1);
    assert_true(plain != NULL && packed != NULL && again != NULL);
    assert_true(packed_bytes < plain_bytes / 2);
    z_stream stream = {.next_in = packed, .avail_in = (uInt)packed_bytes};
    assert_int_equal(inflateInit2(&stream, 16 + MAX_WBITS), Z_OK);
    stream.next_out = again;
    stream.avail_out = (uInt)plain_bytes + 1;
    assert_int_equal(inflate(&stream, Z_FINISH), Z_STREAM_END);
    assert_int_equal(stream.total_out, plain_bytes);
    assert_int_equal(stream.avail_in, 0);
    assert_memory_equal(again, plain, plain_bytes);
    inflateEnd(&stream);
    free(again);
    free(packed);
    free(plain);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_key_is_there_as_the_table_has_it),
        cmocka_unit_test(known_keys_say_what_they_are),
        cmocka_unit_test(the_packed_ones_are_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
