/* Commands of the program as processes of the test's own: begun, watched by what they say on stderr
 * and what they write, and ended. The folder of what they say goes at the end of the test. */
#ifndef FOVEA_TESTS_PROGRAM_H
#define FOVEA_TESTS_PROGRAM_H

#include <sys/types.h>

/* Once: where what the commands say is kept. */
void program_says_to(const char *file);

/* Begin `fovea WORDS...`, words ending with NULL, in a child; its stdout is `output` (-1:
 * /dev/null). `prepare` (NULL: nothing) runs in the child just before, and sees `context`. */
pid_t program_begin(const char *const words[], int output, void (*prepare)(const void *context),
                    const void *context);
/* Wait for its end: its exit code, or 1000 and the signal that ended it. Longer than the patience
 * fails the test. */
int program_end(pid_t child);
/* It ends with this code. */
void program_expect_end(pid_t child, int code);

/* What the last command has said so far, and that it has said, or will say, these words. */
const char *program_said(void);
void program_expect_said(const char *words);
void program_wait_until_said(const char *words);

/* Bytes of a file; 0: none. Wait until it has so many: what writes it works. */
off_t program_file_bytes(const char *path);
void program_wait_until_grown(const char *path, off_t bytes);

#endif
