/* Recordings in a folder that fovea-web lists and sends: whole, and nothing else of this host. */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/web_case.h"

static char folder[] = "/tmp/fovea_web_recordings_XXXXXX", token_path[64];
static char answer[WEB_ANSWER_BYTES];

/* A file of this folder, whose bytes are its place modulo 251. */
static void write_file(const char *name, size_t bytes)
{
    char path[160];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    for (size_t i = 0; i < bytes; i++)
        assert_true(fputc((int)(i % 251), file) != EOF);
    assert_int_equal(fclose(file), 0);
}

static void remove_file(const char *name)
{
    char path[160];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    assert_int_equal(unlink(path), 0);
}

/* Of a server with tokens. To others it is as if there were no folder. */
static void recordings_are_for_operators(void)
{
    char view[33], operate[33], cookie[80];
    FILE *file = fopen(token_path, "r");
    assert_non_null(file);
    assert_int_equal(fscanf(file, "view %32s\noperate %32s", view, operate), 2);
    fclose(file);
    snprintf(cookie, sizeof cookie, "Cookie: fovea_%d=%s\r\n", WEB_PORT, view);
    assert_int_equal(web_get("/recordings", cookie, answer), 200);
    assert_string_equal(strstr(answer, "\r\n\r\n") + 4, "null\n");
    assert_int_equal(web_get("/recordings/new.lcm", cookie, answer), 404);
    snprintf(cookie, sizeof cookie, "Cookie: fovea_%d=%s\r\n", WEB_PORT, operate);
    assert_int_equal(web_get("/recordings/new.lcm", cookie, answer), 200);
}

static void recordings_are_listed_and_sent(void **state)
{
    static const char *const not [] = {
        "/recordings/../token",  "/recordings/%2e%2e%2ftoken", "/recordings/link.lcm",
        "/recordings/notes.txt", "/recordings/.hidden.lcm",    "/recordings/none.lcm",
        "/recordings/a%22b.lcm", "/recordings//etc/passwd",    "/recordings/",
        "/recordings/pipe.lcm",  "/recordingsnew.lcm",         "/recordings/new.lcm/",
        "/recordings/folder.lcm"};
    enum { BYTES = 100000 };
    char path[160], other[160];
    (void)state;
    write_file("old.lcm", 10);
    write_file("new.lcm", BYTES);
    write_file("notes.txt", 10);
    write_file(".hidden.lcm", 10);
    write_file("a\"b.lcm", 10);
    snprintf(path, sizeof path, "%s/link.lcm", folder);
    snprintf(other, sizeof other, "%s/new.lcm", folder);
    assert_int_equal(symlink(other, path), 0);
    snprintf(path, sizeof path, "%s/pipe.lcm", folder);
    assert_int_equal(mkfifo(path, 0600), 0);
    snprintf(path, sizeof path, "%s/folder.lcm", folder);
    assert_int_equal(mkdir(path, 0700), 0);
    const struct timespec then[2] = {{.tv_sec = 1000}, {.tv_sec = 1000}};
    snprintf(path, sizeof path, "%s/old.lcm", folder);
    assert_int_equal(utimensat(AT_FDCWD, path, then, 0), 0);
    start((const char *const[]){"--lcm-url", "", "--recordings", folder, NULL});
    assert_int_equal(web_get("/recordings", "", answer), 200);
    const char *list = strstr(answer, "\r\n\r\n") + 4;
    static const char first[] = "[{\"name\":\"new.lcm\",\"bytes\":100000,\"utime\":1";
    if (strncmp(list, first, sizeof first - 1) != 0 ||
        strstr(list, "},{\"name\":\"old.lcm\",\"bytes\":10,\"utime\":1000000000}]\n") == NULL)
        fail_msg("found %s", list);
    for (int i = 0; i < 3; i++) { /* again: nothing of the one before is left */
        assert_int_equal(web_get("/recordings/new.lcm", "", answer), 200);
        assert_non_null(
            strcasestr(answer, "content-disposition: attachment; filename=\"new.lcm\""));
        assert_non_null(strcasestr(answer, "content-length: 100000\r\n"));
        const uint8_t *data = (const uint8_t *)strstr(answer, "\r\n\r\n") + 4;
        for (size_t k = 0; k < BYTES; k++)
            if (data[k] != k % 251) fail_msg("byte %zu is %d", k, data[k]);
    }
    for (size_t i = 0; i < sizeof not / sizeof not [0]; i++)
        if (web_get(not [i], "", answer) != 404) fail_msg("%s: found %.60s", not [i], answer);
    end();
    start((const char *const[]){"--lcm-url", "", NULL});
    assert_int_equal(web_get("/recordings", "", answer), 200);
    assert_string_equal(strstr(answer, "\r\n\r\n") + 4, "null\n");
    assert_int_equal(web_get("/recordings/new.lcm", "", answer), 404);
    end();
    start((const char *const[]){"--lcm-url", "", "--recordings", folder, "--token", token_path,
                                NULL});
    assert_int_equal(web_get("/recordings", "", answer), 401);
    assert_int_equal(web_get("/recordings/new.lcm", "", answer), 401);
    recordings_are_for_operators();
    end();
    static const char *const made[] = {"old.lcm",  "new.lcm",  "notes.txt", ".hidden.lcm",
                                       "a\"b.lcm", "link.lcm", "pipe.lcm"};
    for (size_t i = 0; i < sizeof made / sizeof made[0]; i++)
        remove_file(made[i]);
    snprintf(path, sizeof path, "%s/folder.lcm", folder);
    assert_int_equal(rmdir(path), 0);
}

int main(void)
{
    if (!web_possible("test_web_recordings")) return 0;
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(token_path, sizeof token_path, "%s/token", folder);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(recordings_are_listed_and_sent, tear_down),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(token_path);
    rmdir(folder);
    return failed;
}
