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

static struct fv_web_pages *open_pages(const char *token)
{
    static const char *const texts[] = {"{\"stage\":\"looking\"}", "a picture"};
    struct fv_web_pages *pages;
    struct fovea_error error;
    const struct fv_web_pages_setup setup = {.address = "127.0.0.1",
                                             .port = WEB_PORT,
                                             .token = token,
                                             .index = "/calibrate",
                                             .answer = make,
                                             .context = (void *)(uintptr_t)texts};
    if (fv_web_pages_open(&setup, &pages, &error) != FOVEA_OK) fail_msg("%s", error.text);
    return pages;
}

static void the_program_s_answers_are_sent(void **state)
{
    (void)state;
    struct fv_web_pages *pages = open_pages(NULL);
    assert_int_equal(web_get("/", "", answer), 200);
    assert_non_null(strstr(answer, "calibrate.js"));
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
        cmocka_unit_test(nothing_of_a_run_is_there),
        cmocka_unit_test(a_strange_host_is_refused_with_the_option_that_adds_it),
        cmocka_unit_test(without_a_token_nothing_is_shown),
    };
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(token_path, sizeof token_path, "%s/token", folder);
    return cmocka_run_group_tests(tests, NULL, remove_files);
}
