/* The page of another program than fovea-web (web/pages.h): who gets what that program answers, and
 * that nothing of a run's page is there. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/web_client.h"
#include "web/pages.h"

#define OURS "Origin: http://127.0.0.1:7680\r\n"

static char folder[] = "/tmp/fovea_pages_XXXXXX", token_path[64];
static char answer[WEB_ANSWER_BYTES];

static bool make(void *context, const char *path, struct fv_web_made *made)
{
    const char *const *texts = context; /* state, picture */
    const bool picture = strcmp(path, "/picture.png") == 0;
    if (!picture && strcmp(path, "/state.json") != 0) return false;
    made->type = picture ? "image/png" : "application/json";
    made->data = (uint8_t *)strdup(texts[picture]);
    made->bytes = strlen(texts[picture]);
    return made->data != NULL;
}

static struct fv_web_pages *open_pages_at(const char *address, const char *token)
{
    static const char *const texts[] = {"{\"stage\":\"looking\"}", "a picture"};
    struct fv_web_pages *pages;
    struct fovea_error error;
    const struct fv_web_pages_setup setup = {.address = address,
                                             .port = WEB_PORT,
                                             .token = token,
                                             .index = "/calibrate",
                                             .answer = make,
                                             .context = (void *)(uintptr_t)texts};
    if (fv_web_pages_open(&setup, &pages, &error) != FOVEA_OK) fail_msg("%s", error.text);
    return pages;
}

static struct fv_web_pages *open_pages(const char *token)
{
    return open_pages_at("127.0.0.1", token);
}

/* Where others can read the page, the log says so; whether the page does is up to the browser,
 * which knows how it came there. */
static void what_can_be_read_is_said(void **state)
{
    static const char *const addresses[] = {"0.0.0.0", "127.0.0.1"};
    char said[1000];
    int ends[2];
    (void)state;
    for (int i = 0; i < 2; i++) {
        fflush(stderr);
        assert_int_equal(pipe(ends), 0);
        const int before = dup(STDERR_FILENO);
        assert_int_equal(dup2(ends[1], STDERR_FILENO), STDERR_FILENO);
        struct fv_web_pages *pages = open_pages_at(addresses[i], token_path);
        assert_int_equal(dup2(before, STDERR_FILENO), STDERR_FILENO);
        close(before);
        close(ends[1]);
        const ssize_t bytes = read(ends[0], said, sizeof said - 1);
        close(ends[0]);
        fv_web_pages_close(pages);
        assert_true(bytes > 0);
        said[bytes] = '\0';
        if ((strstr(said, "can be read on the network") != NULL) != (i == 0))
            fail_msg("%s: %s", addresses[i], said);
    }
}

static void the_program_s_answers_are_sent(void **state)
{
    (void)state;
    struct fv_web_pages *pages = open_pages(NULL);
    assert_int_equal(web_get("/", "", answer), 200);
    assert_non_null(strstr(answer, "calibrate.js"));
    assert_non_null(strstr(answer, "/readable.js"));
    assert_non_null(strstr(answer, "id=\"readable\" class=\"readable\" hidden"));
    assert_int_equal(web_get("/readable.js", "", answer), 200);
    assert_int_equal(web_get("/state.json", "", answer), 200);
    assert_non_null(strcasestr(answer, "content-type: application/json"));
    assert_non_null(strstr(answer, "{\"stage\":\"looking\"}"));
    assert_int_equal(web_get("/picture.png", "", answer), 200);
    assert_non_null(strcasestr(answer, "content-type: image/png"));
    assert_int_equal(web_get("/none", "", answer), 404);
    fv_web_pages_close(pages);
}

static void nothing_of_a_run_is_there(void **state)
{
    int socket;
    (void)state;
    struct fv_web_pages *pages = open_pages(NULL);
    assert_int_equal(web_get("/app.js", "", answer), 404);
    assert_int_equal(web_get("/types", "", answer), 404);
    assert_int_equal(web_open(OURS, "", &socket), 404);
    assert_int_equal(web_open_protocol("foxglove.sdk.v1", "/", "", &socket), 404);
    fv_web_pages_close(pages);
}

static void a_strange_host_is_refused_with_the_option_that_adds_it(void **state)
{
    (void)state;
    struct fv_web_pages *pages = open_pages(NULL);
    assert_int_equal(web_ask("GET /state.json HTTP/1.1\r\nHost: evil.org:7680\r\n\r\n", answer),
                     403);
    assert_non_null(strstr(answer, "--host"));
    assert_null(strstr(answer, "--name"));
    fv_web_pages_close(pages);
}

static void without_a_token_nothing_is_shown(void **state)
{
    char view[33], cookie[100];
    (void)state;
    struct fv_web_pages *pages = open_pages(token_path);
    assert_int_equal(web_get("/", "", answer), 401);
    assert_int_equal(web_get("/state.json", "", answer), 401);
    assert_null(strstr(answer, "looking"));
    assert_int_equal(web_get("/picture.png", "", answer), 401);
    assert_null(strstr(answer, "a picture"));
    FILE *file = fopen(token_path, "r");
    assert_non_null(file);
    assert_int_equal(fscanf(file, "view %32s", view), 1);
    fclose(file);
    snprintf(cookie, sizeof cookie, "Cookie: fovea_%d=%s\r\n", WEB_PORT, view);
    assert_int_equal(web_get("/state.json", cookie, answer), 200);
    assert_int_equal(web_get("/picture.png", cookie, answer), 200);
    cookie[strlen(cookie) - 3] ^= 1;
    assert_int_equal(web_get("/state.json", cookie, answer), 401);
    fv_web_pages_close(pages);
}

static int remove_files(void **state)
{
    (void)state;
    unlink(token_path);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_program_s_answers_are_sent),
        cmocka_unit_test(what_can_be_read_is_said),
        cmocka_unit_test(nothing_of_a_run_is_there),
        cmocka_unit_test(a_strange_host_is_refused_with_the_option_that_adds_it),
        cmocka_unit_test(without_a_token_nothing_is_shown),
    };
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(token_path, sizeof token_path, "%s/token", folder);
    return cmocka_run_group_tests(tests, NULL, remove_files);
}
