/* `fovea echo` as a whole program, in a network of the test's own: what is sent on its channels is
 * printed whole and in order, each message on one line of JSON, and nothing else is. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/build_folder.h"
#include "common/watched.h"
#include "fovea/fields.h"

#include "fovea_box_t.h"
#include "fovea_features_t.h"

static struct watched watched;

/* A box whose first number is `n`, sent on `channel`. */
static void send_box(const char *channel, float n)
{
    const fovea_box_t box = {n, 2, 3, 4};
    uint8_t data[64];
    watched_send(channel, data, (size_t)fovea_box_t_encode(data, 0, sizeof data, &box));
}

/* Start, and send on a channel of its own until the program hears. */
static void start(const char *const *arguments)
{
    watched_start(&watched, "echo", arguments);
    while (!watched_readable(&watched, 20))
        send_box("READY", 0);
}

/* The next line that is not about READY. */
static const char *line(void)
{
    static char text[4096];
    do
        if (!watched_line(&watched, text, sizeof text)) return NULL;
    while (strstr(text, "\"READY\"") != NULL);
    return text;
}

/* The next line is about `channel`, and its message is `message`. */
static void assert_line(const char *channel, unsigned bytes, const char *message)
{
    const char *text = line();
    char head[128], tail[1024];
    assert_non_null(text);
    snprintf(head, sizeof head, "{\"channel\":\"%s\",\"utime\":", channel);
    snprintf(tail, sizeof tail, ",\"host\":true,\"bytes\":%u,\"message\":%s}\n", bytes, message);
    if (strncmp(text, head, strlen(head)) != 0) fail_msg("found %s, expected %s", text, head);
    const char *digits = text + strlen(head);
    const size_t count = strspn(digits, "0123456789");
    assert_true(count >= 16 && strtoll(digits, NULL, 10) > 1600000000000000);
    assert_string_equal(digits + count, tail);
}

#define BOX(n)                                                                                     \
    "{\"type\": \"fovea.box_t\", \"x_min_px\": " #n                                                \
    ", \"y_min_px\": 2, \"x_max_px\": 3, \"y_max_px\": 4}"

static void test_a_channel(void **state)
{
    static const char *const arguments[] = {"A_BOX", "READY", NULL};
    (void)state;
    start(arguments);
    send_box("A_BOX", 1);
    send_box("B_BOX", 2);
    send_box("A_BOX_", 3);
    send_box("A_BO", 4);
    send_box("A_BOX", 5);
    assert_line("A_BOX", 24, BOX(1));
    assert_line("A_BOX", 24, BOX(5));
    watched_interrupt(&watched);
    assert_null(line());
    assert_int_equal(watched_end(&watched), 0);
}

static void test_patterns(void **state)
{
    static const char *const arguments[] = {"READY", "A*_B?X", "?_END", NULL};
    (void)state;
    start(arguments);
    send_box("A_BOX", 1);
    send_box("AA_BOX", 2);
    send_box("A_BX", 3);
    send_box("BA_BOX", 4);
    send_box("A_B_BIX_BAX", 5);
    send_box("A_BOXX", 6);
    send_box("_END", 7);
    send_box("1_END", 8);
    assert_line("A_BOX", 24, BOX(1));
    assert_line("AA_BOX", 24, BOX(2));
    assert_line("A_B_BIX_BAX", 24, BOX(5));
    assert_line("1_END", 24, BOX(8));
    watched_interrupt(&watched);
    assert_int_equal(watched_end(&watched), 0);
}

/* What is no message, and what claims more than it has, is one line too; the largest packet is
 * printed whole. */
static void test_odd_messages(void **state)
{
    static const char *const arguments[] = {"*", NULL};
    static uint8_t data[65000];
    static char text[1 << 19];
    (void)state;
    start(arguments);
    watched_send("X\"\n", (const uint8_t *)"?", 1);
    const char *found = line();
    assert_non_null(found);
    assert_non_null(strstr(found, "{\"channel\":\"X\\\"\\u000a\","));
    assert_non_null(strstr(found, "\"bytes\":1,\"message\":null,\"problem\":\"byte 0: "));

    fovea_features_t features;
    memset(&features, 0, sizeof features);
    features.method = (char *)"";
    const int bytes = fovea_features_t_encode(data, 0, sizeof data, &features);
    watched_send("CUT", data, (size_t)bytes - 3);
    found = line();
    assert_non_null(found);
    assert_non_null(strstr(found, "\"message\":null,\"problem\":\"byte "));
    assert_non_null(strstr(found, "fovea.features_t"));

    const size_t most = watched_largest(data, sizeof data);
    watched_send("LARGE", data, most);
    assert_true(watched_line(&watched, text, sizeof text));
    size_t length;
    static char expected[1 << 19];
    struct fovea_error error;
    assert_int_equal(fovea_message_json(data, most, expected, sizeof expected, &length, &error),
                     FOVEA_OK);
    assert_true(length > 100000);
    assert_non_null(strstr(text, expected));
    watched_interrupt(&watched);
    assert_int_equal(watched_end(&watched), 0);
}

static void test_count_and_timeout(void **state)
{
    static const char *const two[] = {"READY", "A", "--count", "3", NULL};
    static const char *const none[] = {"A", "--timeout", "1", NULL};
    static const char *const nobody[] = {"A", "--listen", "none", NULL};
    static const char *const file[] = {"A", "--lcm-url", "file://x", NULL};
    static const char *const empty[] = {"", NULL};
    (void)state;
    start(two);
    for (int i = 0; i < 5; i++)
        send_box("A", 0);
    char text[4096];
    for (int i = 0; i < 3; i++)
        assert_true(watched_line(&watched, text, sizeof text));
    assert_false(watched_line(&watched, text, sizeof text));
    assert_int_equal(watched_end(&watched), 0);
    watched_start(&watched, "echo", none);
    assert_int_equal(watched_end(&watched), 1);
    watched_start(&watched, "echo", nobody);
    assert_int_equal(watched_end(&watched), 2);
    watched_start(&watched, "echo", file);
    assert_int_equal(watched_end(&watched), 2);
    watched_start(&watched, "echo", empty);
    assert_int_equal(watched_end(&watched), 2);
}

/* The channel of a message has a prefix: without it, a line names the channel that runs send. */
static void test_a_name_without_prefix(void **state)
{
    (void)state;
    char command[640], said[256] = "";
    snprintf(command, sizeof command, "%s/fovea echo GRID --timeout 1 2>&1 >/dev/null",
             build_folder());
    FILE *out = popen(command, "r"); /* NOLINT(bugprone-command-processor) */
    assert_non_null(out);
    assert_non_null(fgets(said, sizeof said, out));
    assert_string_equal(
        said, "fovea echo: GRID: runs send FOVEA_GRID, unless their channel_prefix is another\n");
    while (fgets(said, sizeof said, out) != NULL)
        ;
    assert_int_equal(WEXITSTATUS(pclose(out)), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_channel),
        cmocka_unit_test(test_patterns),
        cmocka_unit_test(test_odd_messages),
        cmocka_unit_test(test_count_and_timeout),
        cmocka_unit_test(test_a_name_without_prefix),
    };
    if (!watched_possible("test_echo")) return 0;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
