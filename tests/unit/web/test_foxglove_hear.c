/* What a client of Foxglove's protocol says: refusals name what they are about, and no words of a
 * stranger do harm. FOVEA_LONG=N says N damaged words. */
#include "common/foxglove_case.h"

static void refusals_name_key_and_reason(void **state)
{
    (void)state;
    drain();
    const char *words =
        "{\"op\":\"setParameters\",\"parameters\":[{\"name\":\"seed\",\"value\":1}]}";
    fv_foxglove_hear((const uint8_t *)words, strlen(words), false, &said);
    assert_int_equal(said.op, FV_FOXGLOVE_SET);
    fv_foxglove_do(&client, &shown, &said, "this token may only look", now_ns);
    until("\"level\":2,\"message\":\"seed: this token may only look\"");
    say("{\"op\":\"setParameters\",\"parameters\":[{\"name\":\"none.such\",\"value\":1}]}");
    until("none.such: no key");
    say("{\"op\":\"setParameters\",\"parameters\":[{\"name\":\"seed\",\"value\":{\"a\":1}}]}");
    until("seed: found an object");
    say("{\"op\":\"setParameters\",\"parameters\":[{\"name\":\"seed\",\"value\":\"AA==\","
        "\"type\":\"byte_array\"}]}");
    until("seed: found bytes");
    say("{\"op\":\"getParameters\",\"parameterNames\":[\"\\u00e4\\\"\"]}");
    until("no key");
    say("{\"op\":\"advertise\",\"channels\":[]}");
    until("clientPublish");
    say("{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":1,\"channelId\":123456}]}");
    until("\"level\":2,\"message\":\"channel 123456: there is none\"");
    say("{\"op\":\"subscribe\",\"op\":\"unsubscribe\"}");
    until("duplicate");
    say("[]");
    until("no object");
    for (int i = 0; i < 100; i++)
        say("{");
    int lines = 0;
    while (next())
        lines += text && strstr((char *)packet, "\"status\"") != NULL;
    assert_int_equal(lines, FV_FOXGLOVE_REPLIES);
}

static void values_are_written_as_a_configuration_has_them(void **state)
{
    static const struct {
        const char *json, *value;
    } cases[] = {{"0.1", "0.1"},
                 {"25", "25"},
                 {"-3", "-3"},
                 {"1e-7", "1e-07"},
                 {"true", "true"},
                 {"\"a b\"", "a b"},
                 {"[1, 0.5, \"x\"]", "[1, 0.5, x]"},
                 {"[]", "[]"}};
    char words[200];
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        snprintf(words, sizeof words,
                 "{\"op\":\"setParameters\",\"parameters\":[{\"name\":\"k\",\"value\":%s}]}",
                 cases[i].json);
        fv_foxglove_hear((const uint8_t *)words, strlen(words), false, &said);
        assert_int_equal(said.op, FV_FOXGLOVE_SET);
        assert_null(said.refused[0]);
        assert_string_equal(said.values[0], cases[i].value);
    }
}

static const char *const words_of_clients[] = {
    "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":1,\"channelId\":1},{\"id\":2,\"channelId\":2}]}",
    "{\"op\":\"unsubscribe\",\"subscriptionIds\":[1,2]}",
    "{\"op\":\"getParameters\",\"parameterNames\":[\"seed\",\"features.threshold\"],\"id\":\"one\"}",
    "{\"op\":\"setParameters\",\"parameters\":[{\"name\":\"seed\",\"value\":{\"a\":[1]}}],\"id\":\"x\"}",
    "{\"op\":\"subscribeParameterUpdates\",\"parameterNames\":[\"seed\"]}",
    "{\"op\":\"unsubscribeParameterUpdates\",\"parameterNames\":[\"seed\"]}",
    "{\"op\":\"advertise\",\"channels\":[{\"id\":1,\"topic\":\"/t\",\"encoding\":\"json\"}]}",
    "{\"op\":\"fetchAsset\",\"uri\":\"package:\\/\\/x\",\"requestId\":1}",
    "\x01\x05\x00\x00\x00 bytes",
    "\x02 call"};
enum { WORDS = sizeof words_of_clients / sizeof words_of_clients[0] };

static void damaged_words_do_no_harm(void **state)
{
    const char *wanted = getenv("FOVEA_LONG");
    const int count = wanted != NULL ? (int)strtol(wanted, NULL, 10) : 1000;
    const fovea_pose_t pose = pose_of(SECOND);
    int wrong = 0;
    (void)state;
    take_pose(&pose);
    for (int n = 0; n < count; n++) {
        const char *words = words_of_clients[below(WORDS)];
        const size_t whole = strlen(words);
        uint8_t damaged[200];
        memcpy(damaged, words, whole);
        for (uint32_t i = 1 + below(4); i > 0; i--)
            damaged[below(whole)] = (uint8_t)below(256);
        const size_t kept = n % 3 == 0 ? below(whole + 1) : whole;
        uint8_t *exact = malloc(kept > 0 ? kept : 1); /* asan sees what is read beyond */
        assert_non_null(exact);
        memcpy(exact, damaged, kept);
        fv_foxglove_hear(exact, kept, n % 4 == 0, &said);
        if (said.op == FV_FOXGLOVE_WRONG) wrong++;
        assert_true(said.count <= FV_FOXGLOVE_NAMES);
        fv_foxglove_do(&client, &shown, &said, n % 5 == 0 ? NULL : "no", now_ns);
        for (int i = 0; i < 40 && next(); i++)
            if (text) assert_true(packet[0] == '{' && packet[bytes - 1] == '}');
        now_ns += SECOND;
        free(exact);
    }
    assert_true(wrong > count / 2);
}

static void deep_and_long_words_are_refused(void **state)
{
    static char words[FV_FOXGLOVE_WORDS_BYTES + 2];
    (void)state;
    memset(words, '[', sizeof words);
    fv_foxglove_hear((const uint8_t *)words, FV_FOXGLOVE_WORDS_BYTES, false, &said);
    assert_int_equal(said.op, FV_FOXGLOVE_WRONG);
    fv_foxglove_hear((const uint8_t *)words, FV_FOXGLOVE_WORDS_BYTES + 1, false, &said);
    assert_non_null(strstr(said.problem, "more than 16384"));
    fv_foxglove_hear((const uint8_t *)"", 0, false, &said);
    assert_int_equal(said.op, FV_FOXGLOVE_WRONG);
    memset(words, '[', 2049); /* whole JSON, one level deeper than is taken */
    memset(words + 2049, ']', 2049);
    fv_foxglove_hear((const uint8_t *)words, 2 * 2049, false, &said);
    assert_non_null(strstr(said.problem, "depth"));
    fv_foxglove_hear((const uint8_t *)words + 1, 2 * 2048, false, &said);
    assert_non_null(strstr(said.problem, "no object"));
    char many[3000] = "{\"op\":\"unsubscribe\",\"subscriptionIds\":[0";
    for (int i = 0; i < 64; i++)
        strcat(many, ",1");
    strcat(many, "]}");
    fv_foxglove_hear((const uint8_t *)many, strlen(many), false, &said);
    assert_non_null(strstr(said.problem, "found 65, expected at most 64"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(refusals_name_key_and_reason, begin, end),
        cmocka_unit_test_setup_teardown(values_are_written_as_a_configuration_has_them, begin, end),
        cmocka_unit_test_setup_teardown(damaged_words_do_no_harm, begin, end),
        cmocka_unit_test_setup_teardown(deep_and_long_words_are_refused, begin, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
