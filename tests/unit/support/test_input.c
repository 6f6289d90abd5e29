/* Opening a file to read never waits, and what may be read has a bound. */
#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/datasets.h"
#include "support/input.h"

static char folder[] = "/tmp/fovea_input_XXXXXX";
static char name[64];

static void refused(const char *path, enum fovea_status status, const char *words)
{
    struct fovea_error reason = {.text = ""};
    assert_int_equal(fv_input_open(path, 100, NULL, &reason), -1);
    assert_int_equal(reason.status, status);
    if (strstr(reason.text, words) == NULL)
        fail_msg("found \"%s\", expected \"%s\"", reason.text, words);
    assert_int_equal(fv_input_check(path, 100, &reason), status);
    assert_int_equal(fv_input_open(path, 100, NULL, NULL), -1);
}

static void test_only_a_regular_file_is_opened(void **state)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)state;
    alarm(60); /* opening a pipe would wait for a writer */
    refused(name, FOVEA_GONE, "No such file");
    refused(folder, FOVEA_ERROR_INPUT, "found a directory, expected a file");
    refused("/dev/zero", FOVEA_ERROR_INPUT, "found a device, expected a file");
    assert_int_equal(mkfifo(name, 0600), 0);
    refused(name, FOVEA_ERROR_INPUT, "found a pipe, expected a file");
    unlink(name);
    snprintf(address.sun_path, sizeof address.sun_path, "%s", name);
    const int server = socket(AF_UNIX, SOCK_STREAM, 0);
    assert_int_equal(bind(server, (struct sockaddr *)&address, sizeof address), 0);
    refused(name, FOVEA_ERROR_INPUT, "found a socket, expected a file");
    close(server);
    unlink(name);
    alarm(0);
}

static void test_a_file_over_its_limit_is_refused(void **state)
{
    struct fovea_error reason = {.text = ""};
    int64_t bytes = 0;
    (void)state;
    const int file = open(name, O_WRONLY | O_CREAT, 0600);
    assert_int_equal(ftruncate(file, 100), 0);
    const int opened = fv_input_open(name, 100, &bytes, &reason);
    assert_true(opened >= 0);
    assert_int_equal(bytes, 100);
    assert_true(fcntl(opened, F_GETFD) & FD_CLOEXEC);
    close(opened);
    assert_int_equal(ftruncate(file, 101), 0);
    refused(name, FOVEA_ERROR_INPUT, "found 101 bytes, expected at most 100");
    close(file);
    unlink(name);
}

/* Whoever holds a lease is asked to give it up; with O_NONBLOCK alone the opening would fail. */
static void test_a_leased_file_is_waited_for(void **state)
{
    int64_t bytes = 0;
    (void)state;
    fv_test_write_text(name, "leased");
    signal(SIGIO, SIG_IGN);
    const int file = open(name, O_RDWR);
    if (fcntl(file, F_SETLEASE, F_WRLCK) != 0) {
        print_message("SKIPPED leases: %s\n", strerror(errno));
        close(file);
        skip();
    }
    const pid_t child = fork();
    if (child == 0) { /* gives it up when it is asked for it */
        while (fcntl(file, F_GETLEASE) == F_WRLCK)
            usleep(10000);
        usleep(100000);
        fcntl(file, F_SETLEASE, F_UNLCK);
        _exit(0);
    }
    close(file);
    const int opened = fv_input_open(name, 100, &bytes, NULL);
    assert_true(opened >= 0);
    assert_int_equal(bytes, 6);
    close(opened);
    unlink(name);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_only_a_regular_file_is_opened),
        cmocka_unit_test(test_a_file_over_its_limit_is_refused),
        cmocka_unit_test(test_a_leased_file_is_waited_for),
    };
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(name, sizeof name, "%s/file", folder);
    const int failed = cmocka_run_group_tests_name("unit/support/test_input", tests, NULL, NULL);
    fv_test_folder_remove(folder);
    return failed;
}
