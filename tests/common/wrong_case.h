/* Commands that must be refused: each runs in a process of its own, so that under sanitizers a
 * finding shows as another status, and must end with status 2 and exactly one line on stderr. Words
 * of a command are separated by blanks; '@' is fv_test_place (datasets.h). */
#ifndef FOVEA_TESTS_COMMON_WRONG_CASE_H
#define FOVEA_TESTS_COMMON_WRONG_CASE_H

#include <stddef.h>

#include "base/elementary.h"

/* Run a command; its wait status. `text`: what it wrote to stderr, valid until the next case. */
int fv_test_command(const char *command, const char **text);
/* `names`: what the line must contain, separated by '|'. */
void fv_test_refused(const char *command, const char *names);
/* Ends in order, or with a line that contains `name`; `iteration` is printed otherwise. */
void fv_test_fine_or_refused(const char *command, const char *name, int iteration);
/* How many commands of the two above there were. */
int fv_test_cases(void);

/* Write a file of fv_test_place. */
void fv_test_put(const char *name, const char *text, size_t bytes);
/* One to four bytes changed, removed or doubled, or the end cut off. */
void fv_test_mutate(struct fv_random *random, char *text, size_t *bytes);

#endif
