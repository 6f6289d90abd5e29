#include "common/wrong_case.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
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
#include "common/datasets.h"

enum { TEXT_MAX = 1 << 15, ARGUMENTS_MAX = 24, SECONDS_MAX = 300 };

static int cases;

int fv_test_cases(void)
{
    return cases;
}

void fv_test_put(const char *name, const char *text, size_t bytes)
{
    fv_test_write(fv_test_path(fv_test_place, name), text, bytes);
}

/* ---- running one case ------------------------------------------------------------------------ */

static size_t read_all(int fd, char *text)
{
    size_t used = 0;
    ssize_t got;
    while ((got = read(fd, text + used, TEXT_MAX - 1 - used)) > 0)
        used += (size_t)got;
    text[used] = '\0';
    return used;
}

/* Run the program in a child process; its stderr goes to `text`. Returns the wait status. */
static int run(int argc, char **argv, char *text)
{
    int ends[2];
    assert_int_equal(pipe(ends), 0);
    fflush(NULL);
    pid_t child = fork();
    if (child == 0) {
        alarm(SECONDS_MAX);
        dup2(ends[1], STDERR_FILENO);
        close(ends[0]);
        close(ends[1]);
        if (freopen("/dev/null", "w", stdout) == NULL) _exit(99);
        exit(fv_dispatch(argc, argv));
    }
    close(ends[1]);
    read_all(ends[0], text);
    close(ends[0]);
    int status = -1;
    waitpid(child, &status, 0);
    return status;
}

static void replace_folder(const char *from, char *to, size_t bytes)
{
    size_t used = 0;
    for (; *from != '\0' && used + 1 < bytes; from++) {
        if (*from == '@')
            used += (size_t)snprintf(to + used, bytes - used, "%s", fv_test_place);
        else
            to[used++] = *from;
    }
    to[used < bytes ? used : bytes - 1] = '\0';
}

/* Words are separated by blanks; '@' is the fv_test_place. */
static int words(const char *command, char *line, size_t bytes, char **argv)
{
    int argc = 0;
    replace_folder(command, line, bytes);
    for (char *word = strtok(line, " "); word != NULL && argc < ARGUMENTS_MAX;
         word = strtok(NULL, " "))
        argv[argc++] = word;
    argv[argc] = NULL;
    return argc;
}

int fv_test_command(const char *command, const char **text)
{
    static char said[TEXT_MAX];
    char line[4096], *argv[ARGUMENTS_MAX + 1];
    const int argc = words(command, line, sizeof line, argv);
    *text = said;
    return run(argc, argv, said);
}

static void assert_one_line(const char *what, const char *text)
{
    const char *end = strchr(text, '\n');
    if (end == NULL || end == text || end[1] != '\0')
        fail_msg("%s: not one line: [%s]", what, text);
}

void fv_test_refused(const char *command, const char *names)
{
    char wanted[512];
    const char *text;
    const int status = fv_test_command(command, &text);
    cases++;
    if (!WIFEXITED(status) || WEXITSTATUS(status) != FV_EXIT_WRONG)
        fail_msg("%s: wait status %x: [%s]", command, status, text);
    assert_one_line(command, text);
    replace_folder(names, wanted, sizeof wanted);
    for (char *name = strtok(wanted, "|"); name != NULL; name = strtok(NULL, "|"))
        if (strstr(text, name) == NULL) fail_msg("%s: '%s' is not in [%s]", command, name, text);
}

void fv_test_fine_or_refused(const char *command, const char *name, int iteration)
{
    char wanted[256];
    const char *text;
    const int status = fv_test_command(command, &text);
    cases++;
    replace_folder(name, wanted, sizeof wanted);
    if (WIFEXITED(status) && WEXITSTATUS(status) == FV_EXIT_OK) return;
    if (!WIFEXITED(status) || WEXITSTATUS(status) != FV_EXIT_WRONG)
        fail_msg("iteration %d of %s: wait status %x: [%s]", iteration, command, status, text);
    assert_one_line(command, text);
    if (strstr(text, wanted) == NULL)
        fail_msg("iteration %d of %s: '%s' is not in [%s]", iteration, command, wanted, text);
}

void fv_test_mutate(struct fv_random *random, char *text, size_t *bytes)
{
    uint32_t changes = 1 + fv_random_below(random, 4);
    for (uint32_t i = 0; i<changes && * bytes> 2; i++) {
        size_t at = fv_random_below(random, (uint32_t)*bytes - 1);
        uint32_t kind = fv_random_below(random, 4);
        if (kind == 0) {
            text[at] = (char)fv_random_below(random, 256);
        } else if (kind == 1) {
            memmove(text + at, text + at + 1, *bytes - at - 1);
            (*bytes)--;
        } else if (kind == 2) {
            text[at] = ":#-[]{}\"'&*!|>%@`,\n\t 0.9"[fv_random_below(random, 24)];
        } else {
            *bytes = at + 1;
        }
    }
}
