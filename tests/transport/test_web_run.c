/* fovea-web beside a run: what a page gets, how a slow one is treated, commands with their answers,
 * and a run that ends and begins again. Frames, messages and packets are counted. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/watched.h"
#include "common/patience.h"
#include "common/web_case.h"
#include "message/fields.h"
#include "support/decode.h"

#include "fovea_command_result_t.h"
#include "fovea_pose_t.h"

#define OURS "Origin: http://127.0.0.1:7680\r\n"

enum { PACKET_BYTES = 1 << 20, WIDTH = 320, HEIGHT = 240 };

static char folder[] = "/tmp/fovea_web_run_XXXXXX", token_path[64], socket_path[64];
static uint8_t packet[PACKET_BYTES];
static size_t bytes;

/* A run of the simulated camera, with its page if `with_page`. */
static void start_run(bool with_page)
{
    char feed[96];
    snprintf(feed, sizeof feed, "web.socket=%s", socket_path);
    const char *const arguments[] = {WATCHED_RUN("sim:orbit?width=320&height=240&frames=1000000"),
                                     "--set",
                                     "features.count_max=500",
                                     "--set",
                                     feed,
                                     "--set",
                                     "channel_prefix=R",
                                     with_page ? "--web" : NULL,
                                     NULL};
    watched_start(&watched, "run", arguments);
}

static int open_page(const char *headers)
{
    int page = -1;
    int64_t end_ns = 0;
    while (web_open(OURS, headers, &page) != 101 && fv_test_patient(&end_ns, 10)) {
    }
    assert_true(page >= 0);
    return page;
}

/* The next text, or packet of a binary frame: its opcode and, of packets, its kind. */
static int next(int page, int *kind)
{
    static uint8_t frame[PACKET_BYTES];
    static size_t used, left; /* of the frame */
    static int of;            /* the page that it came to */
    int opcode = 2;
    if (left == 0 || of != page) {
        while ((opcode = web_hear(page, frame, sizeof frame, &left)) == 9)
            continue; /* it asks whether this end lives */
        used = 0;
        of = page;
    }
    assert_true(opcode == 1 || opcode == 2);
    bytes = left;
    if (opcode == 2) {
        assert_true(left > 4);
        bytes = 0;
        for (int i = 0; i < 4; i++)
            bytes = bytes << 8 | frame[used++];
        assert_true(bytes > 0 && bytes <= left - 4);
    }
    memcpy(packet, frame + used, bytes);
    left = opcode == 2 ? left - 4 - bytes : 0;
    used += bytes;
    packet[bytes] = '\0';
    *kind = opcode == 2 ? packet[0] : 0;
    return opcode;
}

/* Read on until a text holds these words. */
static void until_text(int page, const char *words)
{
    int kind;
    for (int i = 0; i < 20000; i++)
        if (next(page, &kind) == 1 && strstr((char *)packet, words) != NULL) return;
    fail_msg("no text with %s", words);
}

/* Whether the packet is a message of the channel; `*message` is where it begins. */
static bool is_message(const char *channel, const uint8_t **message, size_t *message_bytes)
{
    const size_t length = strlen(channel);
    if (packet[0] != 1 || packet[1] != length || memcmp(packet + 2, channel, length) != 0)
        return false;
    *message = packet + 2 + length;
    *message_bytes = bytes - 2 - length;
    return true;
}

static uint64_t number(size_t at, int count)
{
    uint64_t value = 0;
    for (int i = 0; i < count; i++)
        value = value << 8 | packet[at + (size_t)i];
    return value;
}

/* ---- what a page gets ------------------------------------------------------------------------ */

static void assert_picture(void)
{
    uint8_t pixels[WIDTH * HEIGHT];
    struct fv_decode_image image = {
        .pixels = pixels, .width = WIDTH, .height = HEIGHT, .stride_bytes = WIDTH};
    struct fovea_error error;
    const size_t points = number(48, 4);
    assert_int_equal(number(44, 2), WIDTH);
    assert_int_equal(number(46, 2), HEIGHT);
    assert_true(points > 20); /* of this very frame */
    for (size_t i = 0; i < points; i++) {
        assert_true(number(52 + 5 * i, 2) < 8 * WIDTH);
        assert_true(number(54 + 5 * i, 2) < 8 * HEIGHT);
    }
    if (number(2, 2) == 1 &&
        fv_decode(packet + 52 + 5 * points, bytes - 52 - 5 * points, &image, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
}

static void a_page_that_acknowledges_nothing_gets_two_pictures(void **state)
{
    uint32_t pictures = 0, poses = 0, places = 0, last = 0;
    const uint8_t *message;
    size_t message_bytes, at;
    const char *problem;
    int kind;
    (void)state;
    start_run(true); /* run --web */
    const int page = open_page("");
    until_text(page, "\"running\":true");
    assert_non_null(strstr((char *)packet, "\"prefix\":\"R\""));
    while (poses < 45) {
        if (next(page, &kind) == 2 && kind == 2) {
            assert_picture();
            assert_true(number(4, 4) > last);
            last = (uint32_t)number(4, 4);
            pictures++;
        }
        if (kind == 3) places += (uint32_t)number(13, 4);
        if (kind != 1 || !is_message("POSE", &message, &message_bytes)) continue;
        assert_true(fv_message_check("fovea.pose_t", message, message_bytes, &problem, &at));
        poses++;
    }
    assert_int_equal(pictures, 2);
    assert_true(places > 5);
    while (pictures < 10) { /* one for each that is on the screen */
        char words[32];
        snprintf(words, sizeof words, "ack %u", last);
        assert_true(web_say(page, words));
        kind = 0;
        while (kind != 2)
            (void)next(page, &kind);
        assert_true(number(4, 4) > last);
        last = (uint32_t)number(4, 4);
        pictures++;
    }
    assert_true(web_say(page, "pictures 0")); /* a hidden page */
    assert_true(web_say(page, "ping hidden"));
    until_text(page, "\"kind\":\"pong\""); /* now the server knows of it */
    for (poses = 0; poses < 40;) {
        (void)next(page, &kind);
        if (kind == 1 && is_message("POSE", &message, &message_bytes)) poses++;
        if (kind == 2) fail_msg("a hidden page got a picture");
    }
    close(page);
    end_run();
    assert_int_equal(web_get("/", "", (char *)packet), 0); /* the page ends with the run */
}

/* ---- commands -------------------------------------------------------------------------------- */

/* The result of the command with this id. */
static int answered(int page, int64_t id)
{
    const uint8_t *message;
    size_t message_bytes, at;
    const char *problem;
    int kind;
    for (int i = 0; i < 20000; i++) {
        fovea_command_result_t result;
        (void)next(page, &kind);
        if (kind != 1 || !is_message("COMMAND_RESULT", &message, &message_bytes)) continue;
        assert_true(
            fv_message_check("fovea.command_result_t", message, message_bytes, &problem, &at));
        assert_true(fovea_command_result_t_decode(message, 0, (int)message_bytes, &result) > 0);
        const bool ours = result.id == id;
        const int said = result.result;
        fovea_command_result_t_decode_cleanup(&result);
        if (ours) return said;
    }
    return -1;
}

static int64_t sent_id(int page, const char *words)
{
    assert_true(web_say(page, words));
    until_text(page, "\"kind\":\"sent\"");
    return strtoll(strstr((char *)packet, "\"id\":\"") + 6, NULL, 10);
}

static void until_state(int page, int wanted)
{
    const uint8_t *message;
    size_t message_bytes;
    int kind;
    for (int i = 0; i < 20000; i++) {
        fovea_pose_t pose;
        (void)next(page, &kind);
        if (kind != 1 || !is_message("POSE", &message, &message_bytes)) continue;
        assert_true(fovea_pose_t_decode(message, 0, (int)message_bytes, &pose) > 0);
        const int found = pose.state;
        fovea_pose_t_decode_cleanup(&pose);
        if (found == wanted) return;
    }
    fail_msg("no pose of state %d", wanted);
}

static void commands_are_sent_and_answered(void **state)
{
    (void)state;
    start_run(true);
    const int page = open_page("");
    until_text(page, "\"running\":true");
    assert_non_null(strstr((char *)packet, "\"commands\":true"));
    int64_t id = sent_id(page, "command 1 pause");
    assert_int_equal(answered(page, id), FOVEA_COMMAND_RESULT_T_RESULT_DONE);
    until_state(page, FOVEA_POSE_T_STATE_PAUSED);
    id = sent_id(page, "command 2 resume");
    assert_int_equal(answered(page, id), FOVEA_COMMAND_RESULT_T_RESULT_DONE);
    id = sent_id(page, "command 3 save"); /* there is no map.save */
    assert_int_not_equal(answered(page, id), FOVEA_COMMAND_RESULT_T_RESULT_DONE);
    close(page);
    end_run();
}

static void who_may_only_look_cannot_command(void **state)
{
    char view[33], cookie[80];
    const char *const arguments[] = {"--feed", socket_path, "--token", token_path, NULL};
    (void)state;
    start_run(false);
    start(arguments);
    FILE *file = fopen(token_path, "r");
    assert_non_null(file);
    assert_int_equal(fscanf(file, "view %32s", view), 1);
    fclose(file);
    snprintf(cookie, sizeof cookie, "Cookie: fovea_7680=%s\r\n", view);
    const int page = open_page(cookie);
    until_text(page, "\"running\":true");
    assert_non_null(strstr((char *)packet, "\"commands\":false"));
    assert_true(web_say(page, "command 1 pause"));
    until_text(page, "\"kind\":\"refused\",\"request\":1");
    assert_true(web_say(page, "parameter 2 once seed"));
    until_text(page, "\"kind\":\"refused\",\"request\":2");
    assert_true(web_say(page, "parameter 3 keep features.threshold 30"));
    until_text(page, "\"kind\":\"refused\",\"request\":3");
    close(page);
    end();
    end_run();
}

/* The resident memory of a process. */
static long resident_kb(pid_t process)
{
    char path[64], line[128];
    long kb = 0;
    snprintf(path, sizeof path, "/proc/%d/status", (int)process);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    while (fgets(line, sizeof line, file) != NULL)
        if (strncmp(line, "VmRSS:", 6) == 0) kb = strtol(line + 6, NULL, 10);
    fclose(file);
    assert_true(kb > 0);
    return kb;
}

static void post_wrong_settings(int to, int count)
{
    static const char head[] =
        "POST /settings HTTP/1.1\r\nHost: 127.0.0.1:7680\r\n" OURS "Content-Length: 20000\r\n\r\n";
    static char request[sizeof head - 1 + 20000]; /* one send: two would wait for each other */
    memcpy(request, head, sizeof head - 1);
    char said[2048] = "";
    for (int i = 0; i < count; i++) {
        assert_int_equal(send(to, request, sizeof request, MSG_NOSIGNAL), sizeof request);
        size_t used = 0;
        while (strstr(said, "byte 0 in settings") == NULL) {
            const ssize_t got = recv(to, said + used, sizeof said - 1 - used, 0);
            if (got <= 0) fail_msg("request %d: found \"%s\"", i, said);
            said[used += (size_t)got] = '\0';
        }
        said[0] = '\0';
    }
}

/* What is refused after its body has come leaves nothing behind on a connection that stays. */
static void refused_settings_leave_no_memory(void **state)
{
    const char *const arguments[] = {"--feed", socket_path, NULL};
    (void)state;
    start_run(false);
    start(arguments);
    const int page = open_page("");
    until_text(page, "\"running\":true");
    close(page);
    const int to = web_connect();
    assert_true(to >= 0);
    post_wrong_settings(to, 100);
    const long before = resident_kb(running);
    post_wrong_settings(to, 2000);
    const long grown = resident_kb(running) - before;
    print_message("2,000 refused settings: %ld KB\n", grown);
#if !defined(FOVEA_SANITIZED) /* sanitizers have memory of their own, and tell of leaks */
    assert_true(grown < 10000);
#endif
    close(to);
    end();
    end_run();
}

/* ---- another run ----------------------------------------------------------------------------- */

static void a_run_that_begins_again_is_found(void **state)
{
    const char *const arguments[] = {"--feed", socket_path, NULL};
    (void)state;
    start(arguments);
    const int page = open_page("");
    until_text(page, "\"run\":0,\"running\":false");
    start_run(false);
    until_text(page, "\"run\":1,\"running\":true");
    until_text(page, "pose: ");
    end_run();
    until_text(page, "\"run\":1,\"running\":false");
    start_run(false);
    until_text(page, "\"run\":2,\"running\":true");
    until_text(page, "\"number\":0,"); /* its log */
    until_state(page, FOVEA_POSE_T_STATE_TRACKING);
    close(page);
    end();
    end_run();
}

int main(void)
{
    if (!web_possible("test_web_run") || !watched_possible("test_web_run")) return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(a_page_that_acknowledges_nothing_gets_two_pictures, tear_down),
        cmocka_unit_test_teardown(commands_are_sent_and_answered, tear_down),
        cmocka_unit_test_teardown(who_may_only_look_cannot_command, tear_down),
        cmocka_unit_test_teardown(refused_settings_leave_no_memory, tear_down),
        cmocka_unit_test_teardown(a_run_that_begins_again_is_found, tear_down),
    };
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(token_path, sizeof token_path, "%s/token", folder);
    snprintf(socket_path, sizeof socket_path, "%s/feed", folder);
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(token_path);
    unlink(socket_path);
    rmdir(folder);
    return failed;
}
