/* fovea-web over TLS: the certificate that it makes is one for its hosts, everything that holds
 * without encryption holds with it, and what is no TLS, or broken, leaves nothing behind. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <dirent.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>
#include <openssl/ssl.h>

#include "base/elementary.h"
#include "common/datasets.h"
#include "common/patience.h"
#include "common/watched.h"
#include "common/web_client.h"

#define HOST "Host: 127.0.0.1:7680\r\n"
#define OURS "Origin: https://127.0.0.1:7680\r\n"
#define UPGRADE                                                                                    \
    "GET / HTTP/1.1\r\n" HOST "Connection: Upgrade\r\nUpgrade: websocket\r\n"                      \
    "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"                 \
    "Sec-WebSocket-Protocol: fovea\r\n"

static char folder[] = "/tmp/fovea_tls_XXXXXX", socket_path[64], token[64], certificate[64],
            key[64];
static char answer[WEB_ANSWER_BYTES];

static pid_t start(bool make)
{
    const char *const arguments[] = {"--feed",
                                     socket_path,
                                     "--lcm-url",
                                     "",
                                     "--token",
                                     token,
                                     "--name",
                                     "robot.local",
                                     "--certificate",
                                     certificate,
                                     "--certificate-key",
                                     key,
                                     make ? "--make-certificate" : NULL,
                                     NULL};
    const pid_t process = web_start(arguments);
    assert_true(process > 0);
    return process;
}

/* ---- a client -------------------------------------------------------------------------------- */

struct encrypted {
    SSL_CTX *context;
    SSL *ssl;
    int socket;
};

static void encrypted_close(struct encrypted *to)
{
    SSL_free(to->ssl);
    SSL_CTX_free(to->context);
    close(to->socket);
}

/* A connection that trusts the certificate alone, to a host of this name. */
static bool encrypted_open(struct encrypted *to, const char *name, int newest)
{
    to->context = SSL_CTX_new(TLS_client_method());
    to->socket = web_connect();
    assert_true(to->context != NULL && to->socket >= 0);
    assert_int_equal(SSL_CTX_load_verify_locations(to->context, certificate, NULL), 1);
    SSL_CTX_set_verify(to->context, SSL_VERIFY_PEER, NULL);
    SSL_CTX_set_security_level(to->context, 0);
    SSL_CTX_set_min_proto_version(to->context, newest);
    SSL_CTX_set_max_proto_version(to->context, newest);
    to->ssl = SSL_new(to->context);
    X509_VERIFY_PARAM *expected = SSL_get0_param(to->ssl);
    if (strcmp(name, "127.0.0.1") == 0)
        X509_VERIFY_PARAM_set1_ip_asc(expected, name);
    else
        X509_VERIFY_PARAM_set1_host(expected, name, 0);
    SSL_set_fd(to->ssl, to->socket);
    return SSL_connect(to->ssl) == 1;
}

/* Send a request and read what is answered: the status; 0: none. */
static int ask(const char *request)
{
    struct encrypted to;
    int status = 0, used = 0, got;
    assert_true(encrypted_open(&to, "127.0.0.1", TLS1_3_VERSION));
    assert_true(SSL_write(to.ssl, request, (int)strlen(request)) > 0);
    do {
        got = SSL_read(to.ssl, answer + used, (int)sizeof answer - 1 - used);
        used += got > 0 ? got : 0;
        answer[used] = '\0';
    } while (got > 0 && strstr(answer, "\r\n\r\n") == NULL);
    if (sscanf(answer, "HTTP/1.1 %d", &status) != 1) status = 0;
    encrypted_close(&to);
    return status;
}

static int login(const char *word)
{
    char request[512], digits[2][40], text[160] = "";
    FILE *file = fopen(token, "r");
    assert_non_null(file);
    const size_t bytes = fread(text, 1, sizeof text - 1, file);
    fclose(file);
    text[bytes] = '\0';
    assert_int_equal(sscanf(text, "view %39s operate %39s", digits[0], digits[1]), 2);
    snprintf(
        request, sizeof request,
        "POST /login HTTP/1.1\r\n" HOST OURS
        "Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 38\r\n\r\ntoken=%s",
        strcmp(word, "operate") == 0 ? digits[1] : digits[0]);
    return ask(request);
}

/* ---- tests ----------------------------------------------------------------------------------- */

static void the_page_is_served_by_the_certificate_that_was_made(void **state)
{
    char cookie[128], request[1024];
    struct stat about;
    struct encrypted to;
    (void)state;
    const pid_t process = start(true);
    assert_int_equal(stat(key, &about), 0);
    assert_int_equal(about.st_mode & 0777, 0600);
    for (int version = TLS1_VERSION; version <= TLS1_3_VERSION; version++) {
        assert_int_equal(encrypted_open(&to, "robot.local", version), version >= TLS1_2_VERSION);
        encrypted_close(&to);
    }
    assert_false(encrypted_open(&to, "evil.org", TLS1_3_VERSION));
    encrypted_close(&to);
    assert_int_equal(ask("GET /app.js HTTP/1.1\r\n" HOST "\r\n"), 401);
    assert_int_equal(ask(UPGRADE OURS "\r\n"), 401);
    assert_int_equal(login("operate"), 303);
    const char *set = strcasestr(answer, "set-cookie: ");
    assert_non_null(set);
    assert_non_null(strstr(set, "; Secure\r\n"));
    assert_int_equal(sscanf(set + strlen("set-cookie: "), "%127[^;]", cookie), 1);
    snprintf(request, sizeof request, "GET /app.js HTTP/1.1\r\n" HOST "Cookie: %s\r\n\r\n", cookie);
    assert_int_equal(ask(request), 200);
    snprintf(request, sizeof request, UPGRADE OURS "Cookie: %s\r\n\r\n", cookie);
    assert_int_equal(ask(request), 101);
    snprintf(request, sizeof request, UPGRADE "Origin: http://127.0.0.1:7680\r\nCookie: %s\r\n\r\n",
             cookie);
    assert_int_equal(ask(request), 403);
    assert_int_equal(web_end(process, true), 0);
    /* The files stay as they are. */
    struct stat again;
    const pid_t next = start(true);
    assert_int_equal(stat(key, &again), 0);
    assert_true(again.st_ino == about.st_ino && again.st_mtim.tv_nsec == about.st_mtim.tv_nsec);
    assert_int_equal(web_end(next, true), 0);
    /* As after an interrupted start: the key is there, and stays. */
    assert_int_equal(unlink(certificate), 0);
    const pid_t third = start(true);
    assert_int_equal(stat(key, &again), 0);
    assert_true(again.st_ino == about.st_ino && again.st_mtim.tv_nsec == about.st_mtim.tv_nsec);
    assert_true(encrypted_open(&to, "robot.local", TLS1_3_VERSION));
    encrypted_close(&to);
    assert_int_equal(web_end(third, true), 0);
}

static int descriptors(pid_t process)
{
    char path[64];
    int count = 0;
    snprintf(path, sizeof path, "/proc/%d/fd", (int)process);
    DIR *files = opendir(path);
    while (files != NULL && readdir(files) != NULL)
        count++;
    closedir(files);
    return count;
}

static void what_is_no_tls_leaves_nothing_behind(void **state)
{
    enum { TIMES = 300 };
    struct fv_random random;
    (void)state;
    const pid_t process = start(true);
    fv_random_seed(&random, 7);
    assert_int_equal(web_ask("GET / HTTP/1.1\r\n" HOST "\r\n", answer), 0);
    const int before = descriptors(process);
    for (int i = 0; i < TIMES; i++) {
        uint8_t bytes[600] = {22, 3, 1, 2, 0, 1, 0, 1, 252, 3, 3}; /* as a greeting begins */
        const size_t from = i % 3 == 0 ? 0 : (size_t)(i % 12), length = 1 + (size_t)(i * 2) % 600;
        for (size_t k = from; k < sizeof bytes; k++)
            bytes[k] = (uint8_t)fv_random_below(&random, 256);
        const int socket = web_connect();
        assert_true(socket >= 0);
        (void)send(socket, bytes, length, MSG_NOSIGNAL);
        close(socket);
    }
    assert_int_equal(ask("GET / HTTP/1.1\r\n" HOST "\r\n"), 401); /* the page of the login */
    int64_t end_ns = 0;
    while (descriptors(process) > before && fv_test_patient(&end_ns, 20)) {
    }
    assert_true(descriptors(process) <= before);
    assert_int_equal(web_end(process, true), 0);
}

/* The program ends with 2 and one line that says this. */
static void expect_refused(const char *const *arguments, const char *words)
{
    int ends[2];
    char text[1024] = "";
    assert_int_equal(pipe(ends), 0);
    const int kept = dup(STDERR_FILENO);
    dup2(ends[1], STDERR_FILENO);
    const pid_t process = web_start(arguments);
    dup2(kept, STDERR_FILENO);
    close(kept);
    close(ends[1]);
    const ssize_t got = read(ends[0], text, sizeof text - 1);
    close(ends[0]);
    text[got > 0 ? got : 0] = '\0';
    assert_int_equal(process, -1); /* it ended */
    if (strstr(text, words) == NULL) fail_msg("found \"%s\", expected \"%s\"", text, words);
    assert_true(strchr(text, '\n') == text + strlen(text) - 1);
}

static void wrong_files_are_named(void **state)
{
    char none[80], other[80], other_key[80], open_key[80], command[400];
    (void)state;
    assert_int_equal(web_end(start(true), true), 0); /* both files are there */
    snprintf(none, sizeof none, "%s/none", folder);
    snprintf(other, sizeof other, "%s/other.crt", folder);
    snprintf(other_key, sizeof other_key, "%s/other.key", folder);
    snprintf(open_key, sizeof open_key, "%s/open.key", folder);
    const char *const second[] = {"--feed",
                                  socket_path,
                                  "--lcm-url",
                                  "",
                                  "--certificate",
                                  other,
                                  "--certificate-key",
                                  other_key,
                                  "--make-certificate",
                                  NULL};
    assert_int_equal(web_end(web_start(second), true), 0);
    snprintf(command, sizeof command, "cp %s %s && chmod 644 %s", key, open_key, open_key);
    assert_int_equal(system(command), 0);
    const struct {
        const char *certificate, *key, *words;
    } cases[] = {
        {certificate, NULL, "expected the first two together"},
        {none, key, "none: found No such file or directory, expected a certificate in PEM"},
        {certificate, none, "none: found No such file or directory, expected a key"},
        {folder, key, "found no ordinary file, expected a certificate"},
        {token, key, "found something else, expected a certificate"},
        {certificate, certificate, "everybody may use"},
        {certificate, token, "found something else, expected a key"},
        {certificate, open_key, "a file that everybody may use"},
        {certificate, other_key, "found the key of another certificate"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *const arguments[] = {"--feed",
                                         socket_path,
                                         "--lcm-url",
                                         "",
                                         "--certificate",
                                         cases[i].certificate,
                                         cases[i].key != NULL ? "--certificate-key" : NULL,
                                         cases[i].key,
                                         NULL};
        expect_refused(arguments, cases[i].words);
    }
    const char *const name[] = {"--certificate",      none,     "--certificate-key", none,
                                "--make-certificate", "--name", "a,IP:1.2.3.4",      NULL};
    expect_refused(name, "found a --name that is none of a host");
    char weak[80], weak_key[80];
    snprintf(weak, sizeof weak, "%s/weak.crt", folder);
    snprintf(weak_key, sizeof weak_key, "%s/weak.key", folder);
    snprintf(command, sizeof command,
             "openssl req -x509 -newkey rsa:1024 -nodes -subj /CN=weak -keyout %s -out %s "
             "2>/dev/null && chmod 600 %s",
             weak_key, weak, weak_key);
    assert_int_equal(system(command), 0);
    const char *const refused[] = {"--feed", socket_path,         "--lcm-url", "",  "--certificate",
                                   weak,     "--certificate-key", weak_key,    NULL};
    expect_refused(refused, "found what OpenSSL does not serve");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_page_is_served_by_the_certificate_that_was_made),
        cmocka_unit_test(what_is_no_tls_leaves_nothing_behind),
        cmocka_unit_test(wrong_files_are_named),
    };
    if (!watched_possible("test_web_encrypted") || !web_possible("test_web_encrypted")) return 0;
    signal(SIGPIPE, SIG_IGN);
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(socket_path, sizeof socket_path, "%s/feed", folder);
    snprintf(token, sizeof token, "%s/token", folder);
    snprintf(certificate, sizeof certificate, "%s/web.crt", folder);
    snprintf(key, sizeof key, "%s/web.key", folder);
    const int failed =
        cmocka_run_group_tests_name("transport/test_web_encrypted", tests, NULL, NULL);
    fv_test_folder_remove(folder);
    return failed;
}
