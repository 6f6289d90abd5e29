#include "common/program.h"

#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "common/patience.h"

enum { WORDS_MAX = 24, TEXT_BYTES = 1 << 14 };

static const char *errors;

void program_says_to(const char *file)
{
    errors = file;
}

pid_t program_begin(const char *const words[], int output, void (*prepare)(const void *context),
                    const void *context)
{
    fflush(NULL);
    unlink(errors);
    const pid_t child = fork();
    if (child != 0) return child;
    char *argv[WORDS_MAX + 1] = {(char[]){"fovea"}};
    int argc = 1;
    for (; words[argc - 1] != NULL; argc++)
        argv[argc] = strdup(words[argc - 1]);
    dup2(open(errors, O_WRONLY | O_CREAT | O_TRUNC | O_APPEND, 0600), STDERR_FILENO);
    dup2(output >= 0 ? output : open("/dev/null", O_WRONLY), STDOUT_FILENO);
    signal(SIGINT, SIG_DFL); /* shells let what they start in the background ignore it, and nohup
                                ignores hangups */
    signal(SIGHUP, SIG_DFL);
    if (prepare != NULL) prepare(context);
    exit(fv_dispatch(argc, argv));
}

int program_end(pid_t child)
{
    int status = -1;
    int64_t end_ns = 0;
    do {
        if (waitpid(child, &status, WNOHANG) == child)
            return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
    } while (fv_test_patient(&end_ns, 100));
    kill(child, SIGKILL);
    waitpid(child, &status, 0);
    fail_msg("the program did not end in %d s", FV_TEST_PATIENCE_S);
    return -1;
}

const char *program_said(void)
{
    static char text[TEXT_BYTES];
    FILE *file = fopen(errors, "r");
    const size_t bytes = file != NULL ? fread(text, 1, sizeof text - 1, file) : 0;
    if (file != NULL) fclose(file);
    text[bytes] = '\0';
    return text;
}

void program_expect_end(pid_t child, int code)
{
    const int found = program_end(child);
    if (found != code)
        fail_msg("the program ended with %d, expected %d; it said \"%s\"", found, code,
                 program_said());
}

void program_expect_said(const char *words)
{
    if (strstr(program_said(), words) == NULL)
        fail_msg("found \"%s\", expected \"%s\"", program_said(), words);
}

void program_wait_until_said(const char *words)
{
    int64_t end_ns = 0;
    while (strstr(program_said(), words) == NULL && fv_test_patient(&end_ns, 100)) {
    }
    program_expect_said(words);
}

off_t program_file_bytes(const char *path)
{
    struct stat about;
    return stat(path, &about) == 0 ? about.st_size : 0;
}

void program_wait_until_grown(const char *path, off_t bytes)
{
    int64_t end_ns = 0;
    while (program_file_bytes(path) < bytes && fv_test_patient(&end_ns, 100)) {
    }
    if (program_file_bytes(path) < bytes)
        fail_msg("%s has %lld bytes, expected %lld; the program said \"%s\"", path,
                 (long long)program_file_bytes(path), (long long)bytes, program_said());
}
