/* Who may see the page and command: names, origins, cookies, tokens and their file, tries. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "web/access.h"

static char folder[] = "/tmp/fovea_access_XXXXXX", path[64];
static struct fovea_error error;

static void only_our_names_are_ours(void **state)
{
    const char *const names[] = {"robot.local", "front"};
    const struct {
        const char *host;
        uint16_t port;
        bool ours;
    } cases[] = {
        {"127.0.0.1:7680", 7680, true},
        {"localhost:7680", 7680, true},
        {"LOCALHOST:7680", 7680, true},
        {"[::1]:7680", 7680, true},
        {"127.9.9.9:7680", 7680, true},
        {"robot.local:7680", 7680, true},
        {"Robot.Local:7680", 7680, true},
        {"192.168.1.5:7680", 7680, true},
        {"front", 80, true},
        {"front:80", 80, true},
        {"[::1]", 80, true},
        {"front", 7680, false},
        {"127.0.0.1:7681", 7680, false},
        {"127.0.0.1", 7680, false},
        {"192.168.1.6:7680", 7680, false},
        {"evil.org:7680", 7680, false},
        {"robot.local.evil:7680", 7680, false},
        {"127.0.0.1.evil.org:7680", 7680, false},
        {"", 7680, false},
        {":7680", 7680, false},
        {"127.0.0.1:07680", 7680, false},
        {"127.0.0.1:7680 ", 7680, false},
        {"2130706433:7680", 7680, false},
        {"0.0.0.0:7680", 7680, false},
        {"127.0.0.1:7680, evil.org", 7680, false},
    };
    char longest[400];
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        if (fv_web_host_is_ours(cases[i].host, cases[i].port, false, "192.168.1.5", names, 2) !=
            cases[i].ours)
            fail_msg("%s at port %u", cases[i].host, cases[i].port);
    memset(longest, 'a', sizeof longest);
    longest[sizeof longest - 1] = '\0';
    assert_false(fv_web_host_is_ours(longest, 7680, false, "", names, 2));
    assert_false(fv_web_host_is_ours(":7680", 7680, false, "", names, 0));
    assert_true(fv_web_host_is_ours("127.0.0.1", 443, true, "", names, 2));
    assert_false(fv_web_host_is_ours("127.0.0.1", 80, true, "", names, 2));
    assert_false(fv_web_host_is_ours("127.0.0.1", 443, false, "", names, 2));
}

static void some_names_are_the_loopback(void **state)
{
    static const char *const are[] = {"localhost", "LOCALHOST:7680", "127.0.0.1:7680",
                                      "127.9.9.9", "[::1]:7680",     "[::1]"},
                             *const are_not[] = {"",
                                                 ":",
                                                 "robot.local:7680",
                                                 "localhost.evil.org",
                                                 "128.0.0.1",
                                                 "[::2]",
                                                 "127.0.0.1.evil.org:7680"};
    char longest[400];
    (void)state;
    for (size_t i = 0; i < sizeof are / sizeof are[0]; i++)
        if (!fv_web_host_is_loopback(are[i])) fail_msg("%s", are[i]);
    for (size_t i = 0; i < sizeof are_not / sizeof are_not[0]; i++)
        if (fv_web_host_is_loopback(are_not[i])) fail_msg("%s", are_not[i]);
    memset(longest, 'a', sizeof longest);
    longest[sizeof longest - 1] = '\0';
    assert_false(fv_web_host_is_loopback(longest));
}

static void only_our_page_is_an_origin(void **state)
{
    (void)state;
    assert_true(fv_web_origin_is_ours("http://robot.local:7680", "robot.local:7680", false));
    assert_false(fv_web_origin_is_ours("http://robot.local", "robot.local:7680", false));
    assert_false(fv_web_origin_is_ours("https://robot.local:7680", "robot.local:7680", false));
    assert_false(fv_web_origin_is_ours("http://robot.local:7680/", "robot.local:7680", false));
    assert_true(fv_web_origin_is_ours("https://robot.local:7680", "robot.local:7680", true));
    assert_false(fv_web_origin_is_ours("http://robot.local:7680", "robot.local:7680", true));
    assert_false(fv_web_origin_is_ours("null", "robot.local:7680", false));
    assert_false(fv_web_origin_is_ours("", "", false));
}

static void listed_origins_are_compared_whole(void **state)
{
    static const char *const wrong[] = {"app.foxglove.dev", "https://a/b", "https://a b", "://a",
                                        "http:/a",          "https://a/"};
    const char *list = " https://app.foxglove.dev  http://localhost:8080 ";
    (void)state;
    assert_true(fv_web_origin_is_listed("https://app.foxglove.dev", list));
    assert_true(fv_web_origin_is_listed("http://LOCALHOST:8080", list));
    assert_false(fv_web_origin_is_listed("http://localhost:808", list));
    assert_false(fv_web_origin_is_listed("http://localhost:80801", list));
    assert_false(fv_web_origin_is_listed("", list));
    assert_false(fv_web_origin_is_listed(" ", list));
    assert_false(fv_web_origin_is_listed("https://app.foxglove.dev", NULL));
    assert_int_equal(fv_web_origins_check(list, &error), FOVEA_OK);
    assert_int_equal(fv_web_origins_check("null file:// app://lichtblick", &error), FOVEA_OK);
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        assert_int_equal(fv_web_origins_check(wrong[i], &error), FOVEA_ERROR_INPUT);
        assert_non_null(strstr(error.text, "(web.origins): found '"));
    }
}

static void a_cookie_is_found_by_its_whole_name(void **state)
{
    char token[FV_WEB_TOKEN_DIGITS + 1];
    const char *digits = "0123456789abcdef0123456789abcdef";
    char text[200];
    (void)state;
    snprintf(text, sizeof text, "a=b; xfovea_1=no; fovea_1=%s; c=d", digits);
    assert_true(fv_web_cookie_token(text, "fovea_1", token));
    assert_string_equal(token, digits);
    assert_false(fv_web_cookie_token(text, "fovea_11", token));
    assert_false(fv_web_cookie_token(text, "fovea", token));
    snprintf(text, sizeof text, "fovea_1=%s0", digits);
    assert_false(fv_web_cookie_token(text, "fovea_1", token));
    assert_false(fv_web_cookie_token("fovea_1=", "fovea_1", token));
    assert_false(fv_web_cookie_token("", "fovea_1", token));
    assert_false(fv_web_cookie_token(";;; ;", "fovea_1", token));
}

static void write_file(const char *text, mode_t mode)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
    assert_int_equal(chmod(path, mode), 0);
}

static void tokens_are_made_once_and_kept(void **state)
{
    struct fv_web_tokens tokens, again;
    struct stat file;
    bool made;
    (void)state;
    unlink(path);
    assert_int_equal(fv_web_tokens_read(path, &tokens, &made, &error), FOVEA_OK);
    assert_true(made);
    assert_int_equal(stat(path, &file), 0);
    assert_int_equal(file.st_mode & 0777, 0600);
    assert_int_equal(strlen(tokens.view), 32);
    assert_string_not_equal(tokens.view, tokens.operate);
    assert_int_equal(fv_web_tokens_read(path, &again, &made, &error), FOVEA_OK);
    assert_false(made);
    assert_string_equal(tokens.view, again.view);
    assert_string_equal(tokens.operate, again.operate);
    assert_int_equal(fv_web_tokens_role(&tokens, again.view), FV_WEB_VIEW);
    assert_int_equal(fv_web_tokens_role(&tokens, again.operate), FV_WEB_OPERATE);
    again.view[31] = again.view[31] == '0' ? '1' : '0';
    assert_int_equal(fv_web_tokens_role(&tokens, again.view), FV_WEB_NOBODY);
    assert_int_equal(fv_web_tokens_role(&tokens, ""), FV_WEB_NOBODY);
}

static void a_wrong_file_of_tokens_is_refused(void **state)
{
    const char *one = "view 0123456789abcdef0123456789abcdef\n",
               *other = "operate 1123456789abcdef0123456789abcdef\n",
               *same = "operate 0123456789abcdef0123456789abcdef\n";
    const struct {
        const char *first, *second;
        mode_t mode;
        enum fovea_status status;
    } cases[] = {
        {one, other, 0600, FOVEA_OK},
        {one, other, 0640, FOVEA_ERROR_INPUT},
        {one, same, 0600, FOVEA_ERROR_INPUT},
        {one, "", 0600, FOVEA_ERROR_INPUT},
        {"", "", 0600, FOVEA_ERROR_INPUT},
        {"view 0123456789ABCDEF0123456789ABCDEF\n", other, 0600, FOVEA_ERROR_INPUT},
        {"view 0123456789abcdef0123456789abcdef0\n", other, 0600, FOVEA_ERROR_INPUT},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[300];
        struct fv_web_tokens tokens;
        bool made;
        snprintf(text, sizeof text, "%s%s", cases[i].first, cases[i].second);
        write_file(text, cases[i].mode);
        if (fv_web_tokens_read(path, &tokens, &made, &error) != cases[i].status)
            fail_msg("case %zu", i);
        if (cases[i].status != FOVEA_OK) assert_non_null(strstr(error.text, path));
    }
}

static void who_guesses_has_to_wait(void **state)
{
    static struct fv_web_tries tries;
    int64_t now_ns = 1000;
    (void)state;
    for (int i = 0; i < FV_WEB_TRIES; i++) {
        assert_true(fv_web_tries_left(&tries, "10.0.0.1", now_ns));
        fv_web_tries_failed(&tries, "10.0.0.1", ++now_ns);
    }
    assert_false(fv_web_tries_left(&tries, "10.0.0.1", now_ns));
    assert_true(fv_web_tries_left(&tries, "10.0.0.2", now_ns));
    assert_false(fv_web_tries_left(&tries, "10.0.0.1", now_ns + FV_WEB_TRY_WAIT_NS - 1));
    assert_true(fv_web_tries_left(&tries, "10.0.0.1", now_ns + FV_WEB_TRY_WAIT_NS));
    for (int i = 0; i < 3 * FV_WEB_TRIERS_MAX; i++) { /* many addresses take a bounded room */
        char address[48];
        snprintf(address, sizeof address, "10.1.%d.%d", i / 100, i % 100);
        fv_web_tries_failed(&tries, address, ++now_ns);
    }
    assert_true(fv_web_tries_left(&tries, "10.1.0.1", now_ns));
}

static void who_guesses_cookies_has_to_wait_too(void **state)
{
    static struct fv_web_tries tries;
    static const char right[] = "00000000000000000000000000000000";
    char wrong[FV_WEB_TOKEN_DIGITS + 1];
    int64_t now_ns = 1000;
    (void)state;
    for (int i = 0; i < 100; i++) /* a browser that kept an old one: it can log in */
        assert_false(
            fv_web_tries_cookie(&tries, "10.0.0.1", "old", false, now_ns += FV_WEB_TRY_WAIT_NS));
    assert_true(fv_web_tries_left(&tries, "10.0.0.1", now_ns));
    assert_true(fv_web_tries_cookie(&tries, "10.0.0.1", right, true, now_ns));
    for (int i = 0; i < FV_WEB_TRIES; i++) {
        snprintf(wrong, sizeof wrong, "%032x", 1U + (unsigned)i);
        assert_true(fv_web_tries_left(&tries, "10.0.0.2", now_ns));
        assert_false(fv_web_tries_cookie(&tries, "10.0.0.1", wrong, false, now_ns));
        assert_false(fv_web_tries_cookie(&tries, "10.0.0.2", wrong, false, now_ns));
    }
    assert_false(fv_web_tries_left(&tries, "10.0.0.1", now_ns));
    assert_false(fv_web_tries_left(&tries, "10.0.0.2", now_ns));
    assert_true(fv_web_tries_cookie(&tries, "10.0.0.1", right, true, now_ns)); /* was in */
    assert_false(fv_web_tries_cookie(&tries, "10.0.0.2", right, true, now_ns));
    assert_true(fv_web_tries_cookie(&tries, "10.0.0.3", right, true, now_ns));
    now_ns += FV_WEB_TRY_WAIT_NS;
    assert_true(fv_web_tries_cookie(&tries, "10.0.0.2", right, true, now_ns));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(only_our_names_are_ours),
        cmocka_unit_test(some_names_are_the_loopback),
        cmocka_unit_test(only_our_page_is_an_origin),
        cmocka_unit_test(listed_origins_are_compared_whole),
        cmocka_unit_test(a_cookie_is_found_by_its_whole_name),
        cmocka_unit_test(tokens_are_made_once_and_kept),
        cmocka_unit_test(a_wrong_file_of_tokens_is_refused),
        cmocka_unit_test(who_guesses_has_to_wait),
        cmocka_unit_test(who_guesses_cookies_has_to_wait_too),
    };
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(path, sizeof path, "%s/token", folder);
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(path);
    rmdir(folder);
    return failed;
}
