/* Foxglove's websocket protocol of fovea-web: who is let in, what is refused, damaged and endless
 * words, a client that does not read. FOVEA_LONG=N sends N damaged frames. */
#include <netinet/in.h>
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/elementary.h"
#include "common/build_folder.h"
#include "common/patience.h"
#include "common/watched.h"
#include "common/web_case.h"

#define SDK "foxglove.sdk.v1"
#define OLDER "foxglove.websocket.v1"

enum { ROOM = 8, FRAME_BYTES = 1 << 20 };

static char folder[] = "/tmp/fovea_foxglove_XXXXXX";
static char token_path[64], socket_path[64], recording[64];
static uint8_t frame[FRAME_BYTES + 1];
static size_t bytes;

static void start_alone(bool with_token)
{
    const char *const arguments[] = {"--feed",
                                     socket_path,
                                     "--lcm-url",
                                     "udpm://239.255.76.67:7667",
                                     "--origins",
                                     "https://app.foxglove.dev http://localhost:8080",
                                     with_token ? "--token" : NULL,
                                     token_path,
                                     NULL};
    start(arguments);
}

static void start_recording(void)
{
    const char *const arguments[] = {"--play", recording, NULL};
    start(arguments);
}

static int status_of(const char *protocol, const char *path, const char *headers)
{
    int socket;
    const int status = web_open_protocol(protocol, path, headers, &socket);
    if (socket >= 0) close(socket);
    return status;
}

static int open_client(const char *path, const char *headers)
{
    int client;
    assert_int_equal(web_open_protocol(SDK, path, headers, &client), 101);
    return client;
}

/* Where others may still be being closed. */
static int open_when_there_is_room(void)
{
    int client, status;
    int64_t end_ns = 0;
    while ((status = web_open_protocol(SDK, "/", "", &client)) != 101 &&
           fv_test_patient(&end_ns, 10)) {
    }
    assert_int_equal(status, 101);
    return client;
}

/* The next frame: its opcode, 1 text, 2 bytes. */
static int next(int client)
{
    int opcode;
    while ((opcode = web_hear(client, frame, FRAME_BYTES, &bytes)) == 9)
        continue; /* it asks whether this end lives */
    if (opcode > 0) frame[bytes] = '\0';
    return opcode;
}

static void until_text(int client, const char *words)
{
    for (int i = 0; i < 5000; i++) {
        const int opcode = next(client);
        if (opcode < 0) fail_msg("closed before a text with %s", words);
        if (opcode == 1 && strstr((char *)frame, words) != NULL) return;
    }
    fail_msg("no text with %s", words);
}

/* Subscribe to the channel of a topic, by this number. */
static void subscribe(int client, const char *topic, int number)
{
    char words[120];
    until_text(client, topic);
    const char *id = strstr((char *)frame, "\"id\":");
    assert_non_null(id);
    snprintf(words, sizeof words,
             "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":%d,\"channelId\":%ld}]}", number,
             strtol(id + 5, NULL, 10));
    assert_true(web_say(client, words));
}

/* Read on until a message of that subscription. */
static void until_message(int client, int number)
{
    int opcode;
    do {
        opcode = next(client);
        assert_true(opcode > 0);
    } while (opcode != 2 || frame[0] != 1 || frame[1] != number);
}

/* ---- who is let in --------------------------------------------------------------------------- */

static void pages_come_from_listed_origins(void **state)
{
    char ignored[WEB_ANSWER_BYTES];
    (void)state;
    start_alone(false);
    assert_int_equal(status_of(SDK, "/", ""), 101); /* no page */
    assert_int_equal(status_of(OLDER, "/", ""), 101);
    assert_int_equal(status_of(SDK, "/", "Origin: http://127.0.0.1:7680\r\n"), 101);
    assert_int_equal(status_of(SDK, "/", "Origin: https://app.foxglove.dev\r\n"), 101);
    assert_int_equal(status_of(OLDER, "/", "Origin: http://localhost:8080\r\n"), 101);
    assert_int_equal(status_of(SDK, "/", "Origin: http://localhost:80\r\n"), 403);
    assert_int_equal(status_of(SDK, "/", "Origin: https://evil.org\r\n"), 403);
    assert_int_equal(status_of(SDK, "/", "Origin: null\r\n"), 403);
    assert_int_equal(status_of("fovea", "/", "Origin: https://app.foxglove.dev\r\n"), 403);
    assert_int_not_equal(status_of("foxglove.none", "/", ""), 101);
    assert_int_equal(web_ask("GET / HTTP/1.1\r\nHost: evil.org:7680\r\nUpgrade: websocket\r\n"
                             "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                             "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
                             "Sec-WebSocket-Protocol: " SDK "\r\n\r\n",
                             ignored),
                     403);
    end();
}

static void a_token_is_asked_for(void **state)
{
    char view[33], operate[33], headers[128], path[80];
    (void)state;
    start_alone(true);
    FILE *file = fopen(token_path, "r");
    assert_non_null(file);
    assert_int_equal(fscanf(file, "view %32s\noperate %32s", view, operate), 2);
    fclose(file);
    assert_int_equal(status_of(SDK, "/", ""), 401);
    snprintf(headers, sizeof headers, "Cookie: fovea_7680=%s\r\n", view);
    assert_int_equal(status_of(SDK, "/", headers), 101);
    snprintf(headers, sizeof headers, "Authorization: Bearer %s\r\n", view);
    int client = open_client("/", headers);
    until_text(client, "\"serverInfo\"");
    assert_non_null(strstr((char *)frame, "\"capabilities\":[\"time\"]"));
    assert_true(web_say(client, "{\"op\":\"setParameters\",\"parameters\":[{\"name\":\"seed\","
                                "\"value\":1}]}"));
    until_text(client, "\"level\":2,\"message\":\"seed: this token may only look\"");
    close(client);
    snprintf(path, sizeof path, "/?token=%s", operate);
    client = open_client(path, "");
    until_text(client, "\"serverInfo\"");
    assert_non_null(strstr((char *)frame, "\"parameters\",\"parametersSubscribe\",\"time\""));
    assert_true(web_say(client, "{\"op\":\"getParameters\",\"parameterNames\":[]}"));
    until_text(client, "parameters: there is no run");
    close(client);
    char both[160]; /* an argument that is long does not hide the next one */
    snprintf(both, sizeof both, "%s&robot=1", path);
    assert_int_equal(status_of(SDK, both, ""), 404);
    snprintf(both, sizeof both, "/?x=%060d&%s", 0, path + 2);
    assert_int_equal(status_of(SDK, both, ""), 101);
    /* The page itself takes no token of an address. */
    snprintf(headers, sizeof headers, "Origin: http://127.0.0.1:7680\r\n");
    assert_int_equal(status_of("fovea", path, headers), 401);
    for (int i = 0; i < 5; i++)
        assert_int_equal(status_of(SDK, "/?token=00000000000000000000000000000000", ""), 401);
    assert_int_equal(status_of(SDK, path, ""), 429); /* and it reveals nothing */
    snprintf(headers, sizeof headers, "Cookie: fovea_7680=%s\r\n", view);
    assert_int_equal(status_of(SDK, "/", headers), 101);
    end();
}

static void there_is_room_for_eight(void **state)
{
    int clients[ROOM], page;
    (void)state;
    start_alone(false);
    for (int i = 0; i < ROOM; i++)
        clients[i] = open_client("/", "");
    assert_int_equal(status_of(OLDER, "/", ""), 503);
    assert_int_equal(web_open("Origin: http://127.0.0.1:7680\r\n", "", &page), 101);
    close(page);
    close(clients[3]);
    clients[3] = open_when_there_is_room();
    for (int i = 0; i < ROOM; i++)
        close(clients[i]);
    end();
}

/* The second of three robots runs, with two cameras; the third is one of another host. Each client
 * is shown one. */
static void an_address_says_which_robot(void **state)
{
    char other_path[80], feed[96];
    (void)state;
    snprintf(other_path, sizeof other_path, "%s/other", folder);
    snprintf(feed, sizeof feed, "web.socket=%s", other_path);
    const char *const arguments[] = {"--feed",   socket_path, "--feed",
                                     other_path, "--lcm",     "udpm://239.255.76.67:7667",
                                     "--prefix", "H",         NULL};
    const char *const run[] = {
        WATCHED_RUN("sim:orbit?width=160&height=120&baseline=0.1&frames=1000000"),
        "--set",
        "loop.priority=0",
        "--set",
        "channel_prefix=T",
        "--set",
        feed,
        NULL};
    start(arguments);
    assert_int_equal(status_of(SDK, "/?robot=3", ""), 404);
    assert_int_equal(status_of(SDK, "/?robot=4294967296", ""), 404);
    assert_int_equal(status_of(SDK, "/?robot=-1", ""), 404);
    const int first = open_client("/", ""), second = open_client("/?robot=1", "");
    watched_start(&watched, "run", run);
    subscribe(second, "/T/cam0/image", 1);
    subscribe(second, "/T/cam1/image", 2);
    until_message(second, 2);
    assert_non_null(memmem(frame, bytes, "cam1", 4));
    assert_true(web_say(first, "{\"op\":\"none\"}"));
    until_text(first, "\"serverInfo\"");
    assert_non_null(strstr((char *)frame, "\"parameters\""));
    assert_int_equal(next(first), 1); /* and nothing of the other robot */
    assert_non_null(strstr((char *)frame, "op: found 'none'"));
    end_run();
    const int third = open_client("/?robot=2", "");
    until_text(third, "\"serverInfo\""); /* nothing can be asked of it */
    assert_non_null(strstr((char *)frame, "\"capabilities\":[\"time\"]"));
    assert_true(web_say(third, "{\"op\":\"setParameters\",\"parameters\":[{\"name\":\"seed\","
                               "\"value\":1}]}"));
    until_text(third, "seed: nothing is asked of a robot that is heard");
    close(first);
    close(second);
    close(third);
    end();
}

/* ---- words ----------------------------------------------------------------------------------- */

static void long_words_come_in_pieces(void **state)
{
    char words[16000] = "{\"op\":\"unsubscribeParameterUpdates\",\"parameterNames\":[\"a\"";
    (void)state;
    start_alone(false);
    const int client = open_client("/", ""), other = open_client("/", "");
    while (strlen(words) < 600)
        strcat(words, ",\"features.threshold\"");
    strcat(words, "]}");
    memset(words + strlen(words), ' ', 12000 - strlen(words)); /* more than is read at once */
    assert_true(web_say_frame(client, 0x81, words, 12000));
    until_text(client, "parameters: there is no run");
    assert_true(web_say_frame(client, 0x01, words, 5000)); /* the same, as three frames */
    assert_true(web_say_frame(client, 0x00, words + 5000, 5000));
    assert_true(web_say_frame(client, 0x80, words + 10000, 2000));
    until_text(client, "parameters: there is no run");
    assert_true(web_say_frame(client, 0x81, "{\"op\":\"none\"}", 13));
    until_text(client, "op: found 'none'");
    static char endless[20000];
    memset(endless, ' ', sizeof endless);
    assert_true(web_say_frame(client, 0x81, endless, sizeof endless));
    while (next(client) > 0) /* that one is closed */
        continue;
    assert_true(web_say(other, "{\"op\":\"none\"}"));
    until_text(other, "op: found 'none'");
    close(client);
    close(other);
    end();
}

static void damaged_frames_do_no_harm(void **state)
{
    static const char *const samples[] = {
        "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":1,\"channelId\":1},{\"id\":2,\"channelId\":2}]}",
        "{\"op\":\"setParameters\",\"parameters\":[{\"name\":\"seed\",\"value\":[1]}],\"id\":\"x\"}",
        "{\"op\":\"getParameters\",\"parameterNames\":[\"seed\"],\"id\":\"one\"}",
        "{\"op\":\"unsubscribe\",\"subscriptionIds\":[1,2]}"};
    const char *wanted = getenv("FOVEA_LONG");
    const long count = wanted != NULL ? strtol(wanted, NULL, 10) : 1000;
    struct fv_random random;
    int client = -1, opened = 0;
    (void)state;
    start_recording();
    fv_random_seed(&random, 7);
    for (long i = 0; i < count; i++) {
        uint8_t data[256] = {fv_random_below(&random, 4) == 0 ? 0x82 : 0x81};
        const char *words = samples[fv_random_below(&random, 4)];
        const size_t length = strlen(words);
        data[1] = (uint8_t)(0x80 | length);
        memcpy(data + 6, words, length);
        /* Half of them as frames, the rest in their words alone. */
        const uint32_t first = i % 2 == 0 ? 0 : 6;
        for (uint32_t n = fv_random_below(&random, 5); n > 0; n--)
            data[first + fv_random_below(&random, (uint32_t)length + 6 - first)] =
                (uint8_t)fv_random_u32(&random);
        if (client < 0) {
            client = open_when_there_is_room();
            opened++;
        }
        const bool sent = send(client, data, 6 + length, MSG_NOSIGNAL) == (ssize_t)(6 + length);
        char ignored[4096];
        bool closed = !sent;
        for (ssize_t got = 1; got > 0;) {
            got = recv(client, ignored, sizeof ignored, MSG_DONTWAIT);
            closed |= got == 0;
        }
        if (closed || i % 50 == 49) { /* or frames that lie about their length swallow the rest */
            close(client);
            client = -1;
        }
    }
    if (client >= 0) close(client);
    assert_true(opened > 10);
    client = open_when_there_is_room();
    until_text(client, "\"serverInfo\"");
    close(client);
    end();
}

/* ---- one that does not read ------------------------------------------------------------------ */

static void who_does_not_read_slows_nobody(void **state)
{
    int seen = 0, late = 0;
    uint64_t newest = 0, stamp;
    (void)state;
    start_recording();
    const int slow = open_client("/", ""), quick = open_client("/", ""), few = 4096;
    setsockopt(slow, SOL_SOCKET, SO_RCVBUF, &few, sizeof few);
    subscribe(slow, "/FOVEA/cam0/image", 1);
    subscribe(slow, "/FOVEA/cam0/features", 2);
    subscribe(quick, "/FOVEA/cam0/image", 1);
    subscribe(quick, "/FOVEA/cam0/features", 2);
    while (seen < 60) { /* features of that many frames */
        until_message(quick, 2);
        memcpy(&newest, frame + 5, 8);
        seen++;
    }
    for (stamp = 0; stamp < newest;) { /* it reads again, and soon has the newest */
        until_message(slow, 2);
        memcpy(&stamp, frame + 5, 8);
        late++;
    }
    if (late >= seen) fail_msg("%d messages of %d", late, seen);
    close(slow);
    close(quick);
    end();
}

int main(void)
{
    char command[1200];
    if (!web_possible("test_web_foxglove") || !watched_possible("test_web_foxglove")) return 0;
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(token_path, sizeof token_path, "%s/token", folder);
    snprintf(socket_path, sizeof socket_path, "%s/feed", folder);
    snprintf(recording, sizeof recording, "%s/run.lcm", folder);
    snprintf(command, sizeof command,
             "%s/fovea run --source 'sim:orbit?width=320&height=240&frames=150' "
             "--quiet --picture none --set lcm_url= --set loop.priority=0 "
             "--record %s",
             build_folder(), recording);
    if (system(command) != 0) return 1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(pages_come_from_listed_origins, tear_down),
        cmocka_unit_test_teardown(a_token_is_asked_for, tear_down),
        cmocka_unit_test_teardown(there_is_room_for_eight, tear_down),
        cmocka_unit_test_teardown(an_address_says_which_robot, tear_down),
        cmocka_unit_test_teardown(long_words_come_in_pieces, tear_down),
        cmocka_unit_test_teardown(damaged_frames_do_no_harm, tear_down),
        cmocka_unit_test_teardown(who_does_not_read_slows_nobody, tear_down),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    snprintf(command, sizeof command, "rm -r %s", folder);
    return system(command) != 0 || failed;
}
