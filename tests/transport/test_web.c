/* What fovea-web refuses: strange hosts and origins, whoever has no token, requests and frames that
 * are damaged or lie about their length. No run is needed. FOVEA_LONG=N sends N damaged requests.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/build_folder.h"
#include "common/short_run.h"
#include "common/web_case.h"

#define OURS "Origin: http://127.0.0.1:7680\r\n"
#define HOST "Host: 127.0.0.1:7680\r\n"

static char folder[] = "/tmp/fovea_web_XXXXXX", token_path[64], socket_path[64];
static char answer[WEB_ANSWER_BYTES];

static void begin(bool with_token)
{
    const char *const arguments[] = {
        "--feed", socket_path, "--lcm-url", "", with_token ? "--token" : NULL, token_path, NULL};
    start(arguments);
}

static void head_is_get_without_a_body(void)
{
    static const char *const paths[] = {"/", "/keys", "/none"};
    for (int i = 0; i < 3; i++) {
        char request[200];
        const int status = web_get(paths[i], "", answer);
        const char *stated = strcasestr(answer, "content-length:");
        assert_non_null(stated);
        const long bytes = strtol(stated + strlen("content-length:"), NULL, 10);
        snprintf(request, sizeof request, "HEAD %s HTTP/1.1\r\n" HOST "\r\n", paths[i]);
        const int to = web_connect();
        assert_true(to >= 0 && web_send(to, request) && web_send(to, request)); /* keeps open */
        char text[8192] = "";
        size_t used = 0;
        for (int heads = 0; heads < 2;) {
            const ssize_t got = recv(to, text + used, sizeof text - 1 - used, 0);
            if (got <= 0) fail_msg("%s: %d of 2 heads, \"%s\"", paths[i], heads, text);
            used += (size_t)got;
            text[used] = '\0';
            heads = 0;
            for (const char *at = text; (at = strstr(at, "\r\n\r\n")) != NULL; at += 4)
                heads++;
        }
        close(to);
        assert_int_equal(strtol(text + strlen("HTTP/1.1 "), NULL, 10), status);
        stated = strcasestr(text, "content-length:");
        assert_int_equal(strtol(stated + strlen("content-length:"), NULL, 10), bytes);
        const char *second = strstr(text, "\r\n\r\n") + 4;
        assert_memory_equal(second, "HTTP/1.1", 8);
    }
}

/* A browser keeps what does not change, and asks about it by its tag. */
static void kept_assets_are_not_sent_again(void)
{
    char tag[64] = "", request[200];
    assert_int_equal(web_get("/three/build/three.module.js", "Accept-Encoding: gzip\r\n", answer),
                     200);
    const char *found = strcasestr(answer, "\r\netag: ");
    assert_non_null(found);
    assert_int_equal(sscanf(found, "\r\n%*s %63s", tag), 1);
    snprintf(request, sizeof request, "Accept-Encoding: gzip\r\nIf-None-Match: \"other\", %s\r\n",
             tag);
    assert_int_equal(web_get("/three/build/three.module.js", request, answer), 304);
    assert_string_equal(strstr(answer, "\r\n\r\n"), "\r\n\r\n");  /* no body */
    assert_int_equal(web_get("/chart.js", request, answer), 200); /* the tag of another */
    assert_int_equal(web_get("/three/build/three.module.js", "", answer), 406); /* a megabyte */
    assert_int_equal(web_get("/keys", "", answer), 200);
    assert_non_null(strcasestr(answer, "cache-control: no-store"));
}

static void the_page_is_sent_with_its_rules(void **state)
{
    const char *const headers[] = {"content-security-policy: default-src 'self'; frame",
                                   "frame-ancestors 'none';", "x-content-type-options: nosniff",
                                   "cache-control: private, no-cache",
                                   "cross-origin-opener-policy: same-origin"};
    (void)state;
    begin(false);
    assert_int_equal(web_get("/", "", answer), 200);
    assert_non_null(strstr(answer, "<title>Fovea</title>")); /* not compressed unless asked for */
    for (size_t i = 0; i < sizeof headers / sizeof headers[0]; i++)
        if (strcasestr(answer, headers[i]) == NULL) fail_msg("no header %s", headers[i]);
    assert_int_equal(web_get("/app.js", "Accept-Encoding: gzip\r\n", answer), 200);
    assert_non_null(strcasestr(answer, "content-encoding: gzip"));
    assert_int_equal(web_get("/types", "", answer), 200);
    assert_non_null(strstr(answer, "//! type fovea.pose_t"));
    assert_int_equal(web_get("/../etc/passwd", "", answer), 404);
    assert_int_equal(web_get("/%2e%2e/etc/passwd", "", answer), 404);
    assert_int_equal(web_get("/none", "", answer), 404);
    assert_int_equal(
        web_ask("POST /login HTTP/1.1\r\n" HOST OURS "Content-Length: 3\r\n\r\na=b", answer),
        404); /* there is no token to ask for */
    assert_int_equal(web_ask("PUT / HTTP/1.1\r\n" HOST "Content-Length: 0\r\n\r\n", answer), 405);
    head_is_get_without_a_body();
    kept_assets_are_not_sent_again();
    end();
}

static void strange_hosts_and_origins_are_refused(void **state)
{
    int socket;
    (void)state;
    begin(false);
    assert_int_equal(web_ask("GET / HTTP/1.1\r\nHost: evil.org:7680\r\n\r\n", answer), 403);
    assert_int_equal(web_ask("GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", answer), 403);
    assert_int_equal(web_ask("GET / HTTP/1.1\r\n" HOST "Host: evil.org:7680\r\n\r\n", answer), 403);
    assert_int_not_equal(web_ask("GET / HTTP/1.1\r\n\r\n", answer), 200);
    assert_int_equal(web_get("/", "Origin: http://evil.org\r\n", answer), 403);
    assert_int_equal(web_get("/", OURS, answer), 200);
    assert_int_equal(web_open("Origin: http://evil.org\r\n", "", &socket), 403);
    assert_int_equal(web_open("Origin: null\r\n", "", &socket), 403);
    assert_int_equal(web_open("", "", &socket), 403);
    assert_int_equal(web_open(OURS, "", &socket), 101);
    close(socket);
    end();
}

/* Settings are taken of our own page alone, and refused when the body is through. */
static void settings_are_judged(const char *more, int status, const char *said)
{
    char request[512];
    snprintf(request, sizeof request,
             "POST /settings HTTP/1.1\r\n" HOST "%sContent-Length: 7\r\n\r\nseed: 1", more);
    assert_int_equal(web_ask(request, answer), status);
    if (strstr(answer, said) == NULL) fail_msg("found %s, expected %s", answer, said);
}

static void posts_are_judged(void **state)
{
    (void)state;
    begin(false);
    settings_are_judged("", 403, "Origin");
    settings_are_judged("Origin: http://evil.org\r\n", 403, "Origin");
    settings_are_judged(OURS, 403, "without --lcm-url");
    assert_int_equal(
        web_ask("POST /none HTTP/1.1\r\n" HOST OURS "Content-Length: 1\r\n\r\nx", answer), 405);
    end();
    begin(true);
    settings_are_judged(OURS, 401, "log in");
    end();
}

/* A server of LCM that does not answer takes the commands, not the page. */
static void without_lcm_there_is_a_page(void **state)
{
    (void)state;
    start((const char *const[]){"--lcm-url", "tcpq://127.0.0.1:1", NULL});
    assert_int_equal(web_get("/", "", answer), 200);
    settings_are_judged(OURS, 403, "found no LCM there");
    end();
}

/* What stands beside an option that has no run to ask; beside a robot that is heard there may be
 * one of this host. */
static void options_of_a_run_are_refused(const char *option, const char *value)
{
    static const char *const of_run[] = {"--lcm-url", "--command-key", "--feed"};
    const int count = strcmp(option, "--lcm") == 0 ? 2 : 3;
    char command[1300], line[300];
    for (int i = 0; i < count; i++) {
        snprintf(command, sizeof command, "%s/fovea-web %s %s %s x 2>&1", build_folder(), option,
                 value, of_run[i]);
        FILE *pipe = popen(command, "r");
        assert_non_null(pipe);
        assert_non_null(fgets(line, sizeof line, pipe));
        assert_int_equal(pclose(pipe), 2 << 8);
        if (strstr(line, option) == NULL || strstr(line, of_run[i]) == NULL)
            fail_msg("found %s", line);
    }
}

static void a_wrong_origin_is_refused(void)
{
    char command[1300], line[300];
    snprintf(command, sizeof command,
             "timeout 120 %s/fovea-web --origins 'https://a https://b/page' 2>&1", build_folder());
    FILE *pipe = popen(command, "r");
    assert_non_null(pipe);
    assert_non_null(fgets(line, sizeof line, pipe));
    assert_int_equal(pclose(pipe), 2 << 8);
    assert_non_null(strstr(line, "--origins (web.origins): found 'https://b/page'"));
}

/* Where a recording is played, what is of a run is refused: as an option, and as a request. */
static void a_recording_is_no_run(void **state)
{
    const struct short_run run = {.width = 160, .height = 120, .iterations = 4, .features = 200};
    char recording[64];
    (void)state;
    snprintf(recording, sizeof recording, "%s/played.lcm", folder);
    options_of_a_run_are_refused("--play", recording);
    a_wrong_origin_is_refused();
    options_of_a_run_are_refused("--lcm", "udpm://239.255.76.67:7667");
    short_run_record(recording, &run);
    const char *const arguments[] = {"--play", recording, NULL};
    start(arguments);
    settings_are_judged(OURS, 403, "a recording is played");
    end();
    unlink(recording);
}

/* What POST /login with this body says. */
static int login(const char *token)
{
    char request[512], body[256];
    snprintf(body, sizeof body, "token=%s", token);
    snprintf(request, sizeof request,
             "POST /login HTTP/1.1\r\n" HOST OURS
             "Content-Type: application/x-www-form-urlencoded\r\nContent-Length: %zu\r\n\r\n%s",
             strlen(body), body);
    return web_ask(request, answer);
}

static void read_tokens(char view[33], char operate[33])
{
    FILE *file = fopen(token_path, "r");
    assert_non_null(file);
    assert_int_equal(fscanf(file, "view %32s\noperate %32s", view, operate), 2);
    fclose(file);
}

static void assert_role(const char *cookie, const char *role)
{
    uint8_t text[1000];
    char wanted[40];
    size_t bytes;
    int socket;
    assert_int_equal(web_open(OURS, cookie, &socket), 101);
    assert_int_equal(web_hear(socket, text, sizeof text - 1, &bytes), 1);
    text[bytes] = '\0';
    snprintf(wanted, sizeof wanted, "\"role\":\"%s\"", role);
    assert_non_null(strstr((char *)text, wanted));
    close(socket);
}

static void without_the_token_only_the_login_page_is_seen(void **state)
{
    const char *const closed[] = {"/", "/app.js", "/types", "/none", "/live.js"};
    char view[33], operate[33], cookie[128];
    struct stat file;
    int socket;
    (void)state;
    begin(true);
    assert_int_equal(stat(token_path, &file), 0);
    assert_int_equal(file.st_mode & 0777, 0600);
    read_tokens(view, operate);
    for (size_t i = 0; i < sizeof closed / sizeof closed[0]; i++)
        if (web_get(closed[i], "", answer) != 401) fail_msg("%s", closed[i]);
    assert_int_equal(web_get("/", "", answer), 401);
    assert_non_null(strstr(answer, "<form method=\"post\" action=\"/login\""));
    assert_int_equal(web_get("/login", "", answer), 200);
    assert_int_equal(web_get("/style.css", "", answer), 200);
    assert_int_equal(web_open(OURS, "", &socket), 401);
    assert_int_equal(web_open(OURS, "Cookie: fovea_7680=0123\r\n", &socket), 401);

    assert_int_equal(login(view), 303);
    assert_non_null(strcasestr(answer, "HttpOnly"));
    assert_non_null(strcasestr(answer, "SameSite=Strict"));
    assert_null(strcasestr(answer, "location: http")); /* the token is never in an address */
    snprintf(cookie, sizeof cookie, "Cookie: other=1; fovea_7680=%s\r\n", view);
    assert_int_equal(web_get("/", cookie, answer), 200);
    assert_non_null(strstr(answer, "<title>Fovea</title>"));
    assert_role(cookie, "view");
    snprintf(cookie, sizeof cookie, "Cookie: fovea_7680=%s\r\n", operate);
    assert_role(cookie, "operate");

    for (int i = 0; i < 5; i++)
        assert_int_equal(login("00000000000000000000000000000000"), 401);
    assert_int_equal(login("00000000000000000000000000000000"), 429);
    assert_int_equal(login(operate), 429); /* and it reveals nothing */
    assert_int_equal(web_get("/", cookie, answer), 200);
    end();
}

static void cookies_are_no_way_to_guess_tokens(void **state)
{
    char view[33], operate[33], cookie[128];
    int socket;
    (void)state;
    begin(true);
    read_tokens(view, operate);
    for (int i = 0; i < 5; i++) {
        snprintf(cookie, sizeof cookie, "Cookie: fovea_7680=%032x\r\n", (unsigned)i);
        for (int again = 0; again < 2; again++)
            assert_int_equal(i % 2 == 0 ? web_get("/keys", cookie, answer)
                                        : web_open(OURS, cookie, &socket),
                             401);
    }
    snprintf(cookie, sizeof cookie, "Cookie: fovea_7680=%s\r\n", operate);
    assert_int_equal(web_get("/keys", cookie, answer), 401);
    assert_int_equal(web_open(OURS, cookie, &socket), 401);
    assert_int_equal(login(operate), 429);
    end();
}

static void a_network_needs_a_token(void **state)
{
    const char *const wrong[][6] = {{"--address", "0.0.0.0"},
                                    {"--address", "robot"},
                                    {"--port", "70000"},
                                    {"--rate", "0"},
                                    {"--feed"},
                                    {"--address", "10.255.0.1", "--token", token_path}};
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const char *arguments[7] = {0};
        memcpy(arguments, wrong[i], sizeof wrong[i]);
        int status = 0;
        const pid_t process = fork();
        if (process == 0) {
            char path[1100];
            snprintf(path, sizeof path, "%s/fovea-web", build_folder());
            execl(path, path, arguments[0], arguments[1], arguments[2], arguments[3], (char *)NULL);
            _exit(127);
        }
        waitpid(process, &status, 0);
        if (!WIFEXITED(status) || WEXITSTATUS(status) != 2) fail_msg("%s", wrong[i][1]);
    }
}

/* ---- damage ---------------------------------------------------------------------------------- */

static uint32_t drawn(uint32_t *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return *seed >> 8;
}

/* Requests and frames that are right, before they are damaged. */
static size_t sample(uint32_t which, char *data)
{
    static const char *const requests[] = {
        "GET / HTTP/1.1\r\n" HOST "Accept-Encoding: gzip\r\nCookie: fovea_7680=0\r\n\r\n",
        "POST /login HTTP/1.1\r\n" HOST OURS "Content-Length: 38\r\n\r\n"
        "token=0123456789abcdef0123456789abcdef",
        "POST /settings HTTP/1.1\r\n" HOST OURS "Content-Length: 7\r\n\r\nseed: 1",
        "GET / HTTP/1.1\r\n" HOST OURS "Upgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Protocol: fovea\r\n\r\n\x81\x85\1\2\3\4`al%0",
        "GET /app.js HTTP/1.1\r\n" HOST "Upgrade: h2c\r\nHTTP2-Settings: AAMAAABkAAQ\r\n"
        "Connection: Upgrade, HTTP2-Settings\r\n\r\nPRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    };
    const char *request = requests[which % (sizeof requests / sizeof requests[0])];
    strcpy(data, request);
    return strlen(request);
}

static void damaged_requests_do_no_harm(void **state)
{
    const char *wanted = getenv("FOVEA_LONG");
    const long count = wanted != NULL ? strtol(wanted, NULL, 10) : 300;
    uint32_t seed = 1;
    (void)state;
    begin(true);
    for (long i = 0; i < count; i++) {
        char data[1024], ignored[512];
        size_t bytes = sample((uint32_t)i, data);
        for (uint32_t n = drawn(&seed) % 6; n > 0; n--)
            data[drawn(&seed) % bytes] = (char)drawn(&seed);
        if (drawn(&seed) % 4 == 0) bytes = 1 + drawn(&seed) % bytes;
        const int to = web_connect();
        assert_true(to >= 0);
        (void)send(to, data, bytes, MSG_NOSIGNAL);
        if (drawn(&seed) % 8 == 0) (void)recv(to, ignored, sizeof ignored, MSG_DONTWAIT);
        close(to);
    }
    assert_int_equal(web_get("/login", "", answer), 200);
    end();
}

static void frames_that_lie_end_their_connection_alone(void **state)
{
    static const struct {
        const char *what;
        size_t bytes;
        uint8_t data[24];
    } frames[] = {
        {"2^63 bytes", 14, {0x81, 0xff, 0x80, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}},
        {"2^62 bytes", 14, {0x81, 0xff, 0x40, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}},
        {"an opcode that there is not", 6, {0x8b, 0x80, 0, 0, 0, 0}},
        {"a long ping", 10, {0x89, 0xfe, 1, 0, 0, 0, 0, 0, 0, 0}},
        {"words that there are not", 9, {0x81, 0x83, 0, 0, 0, 0, 'f', 'o', 'o'}},
        {"an empty text", 6, {0x81, 0x80, 0, 0, 0, 0}},
        {"half a text", 11, {0x01, 0x85, 0, 0, 0, 0, 'a', 'c', 'k', ' ', '1'}},
        {"no number", 11, {0x81, 0x85, 0, 0, 0, 0, 'a', 'c', 'k', ' ', 'x'}},
        {"zeros", 11, {0x81, 0x85, 0, 0, 0, 0, 'a', 'c', 0, ' ', '1'}},
    };
    uint8_t heard[2000], huge[4096] = {0x81, 0xfe, 0x0f, 0xf0};
    size_t bytes;
    (void)state;
    begin(false);
    int other, to, opcode = 2;
    assert_int_equal(web_open(OURS, "", &other), 101);
    assert_int_equal(web_hear(other, heard, sizeof heard, &bytes), 1);
    for (size_t i = 0; i <= sizeof frames / sizeof frames[0]; i++) {
        const bool last = i == sizeof frames / sizeof frames[0];
        const void *data = last ? huge : frames[i].data;
        assert_int_equal(web_open(OURS, "", &to), 101);
        (void)send(to, data, last ? sizeof huge : frames[i].bytes, MSG_NOSIGNAL);
        if (!last && frames[i].bytes == 14) /* what it claims never comes */
            (void)send(to, huge, sizeof huge, MSG_NOSIGNAL);
        opcode = 2;
        for (int n = 0; n < 20 && (opcode == 1 || opcode == 2); n++) /* hello, and then the end */
            opcode = web_hear(to, heard, sizeof heard, &bytes);
        if (opcode != -1 && opcode != 8) fail_msg("%s", last ? "4,080 bytes" : frames[i].what);
        close(to);
    }
    assert_true(web_say(other, "ping 7"));
    opcode = 2;
    while (opcode == 2) /* the path, which is empty */
        opcode = web_hear(other, heard, sizeof heard - 1, &bytes);
    assert_int_equal(opcode, 1);
    heard[bytes] = '\0';
    assert_non_null(strstr((char *)heard, "\"pong\",\"echo\":\"7\""));
    close(other);
    end();
}

int main(void)
{
    if (!web_possible("test_web") || !watched_possible("test_web")) return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(the_page_is_sent_with_its_rules, tear_down),
        cmocka_unit_test_teardown(posts_are_judged, tear_down),
        cmocka_unit_test_teardown(without_lcm_there_is_a_page, tear_down),
        cmocka_unit_test_teardown(a_recording_is_no_run, tear_down),
        cmocka_unit_test_teardown(strange_hosts_and_origins_are_refused, tear_down),
        cmocka_unit_test_teardown(without_the_token_only_the_login_page_is_seen, tear_down),
        cmocka_unit_test_teardown(cookies_are_no_way_to_guess_tokens, tear_down),
        cmocka_unit_test_teardown(a_network_needs_a_token, tear_down),
        cmocka_unit_test_teardown(damaged_requests_do_no_harm, tear_down),
        cmocka_unit_test_teardown(frames_that_lie_end_their_connection_alone, tear_down),
    };
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(token_path, sizeof token_path, "%s/token", folder);
    snprintf(socket_path, sizeof socket_path, "%s/feed", folder);
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(token_path);
    rmdir(folder);
    return failed;
}
