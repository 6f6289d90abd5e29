/* A command that watches running robots, as a child of the test, in a network of the test's own,
 * and packets for it. */
#ifndef FOVEA_TESTS_WATCHED_H
#define FOVEA_TESTS_WATCHED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/types.h>

struct watched {
    pid_t process;
    int output; /* what it prints on stdout */
    char kept[1 << 16];
    size_t begin, end;
};

/* Once, before any thread exists. False, and a line with SKIPPED: not possible here. */
bool watched_possible(const char *test);

/* Arguments of `fovea run` in a test: a source by the clock, nothing on the terminal, no picture.
 */
#define WATCHED_RUN(source) "--source", source, "--rate", "real", "--quiet", "--picture", "none"

/* Become `fovea COMMAND ARGUMENTS...`: in a child. */
void watched_exec(const char *command, const char *const *arguments) __attribute__((noreturn));
/* `fovea COMMAND ARGUMENTS...`, of the folder that the test was built into. */
void watched_start(struct watched *watched, const char *command, const char *const *arguments);
/* Whether there is output to read, or its end, after at most so long. */
bool watched_readable(struct watched *watched, int timeout_ms);
/* The next line with its end; false: there is no more. Two minutes of silence fail the test. */
bool watched_line(struct watched *watched, char *text, size_t bytes);
void watched_interrupt(const struct watched *watched);
/* Wait for its end; returns its exit status, -1 after a signal. */
int watched_end(struct watched *watched);

/* The exit code of a line of the shell, -1 after a signal; what it prints goes to `text`, as much
 * as there is room for. */
int watched_shell(const char *line, char *text, size_t bytes);
/* Remove a folder with all that is in it. */
void watched_remove(const char *folder);

/* One packet to the default group of LCM. */
void watched_send(const char *channel, const uint8_t *data, size_t bytes);
/* Until the kernel holds no packet that the programs of this network have not read, so that none of
 * many is lost because they had no processor. */
void watched_wait_until_read(void);

/* A message of the largest packet that there may be; returns its bytes. */
size_t watched_largest(uint8_t *data, size_t capacity);

#endif
