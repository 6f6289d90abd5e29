/* Other programs of Fovea, in the folder of this one, as processes beside it. */
#ifndef FOVEA_SUPPORT_PROGRAM_H
#define FOVEA_SUPPORT_PROGRAM_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

/* The path of the program `name` in the folder of this one. False: it is not there. */
bool fv_program_beside(const char *name, char *path, size_t bytes);

/* Start it with these words, ended by NULL, and the signals of a program that was just started,
 * whatever is blocked here; a hangup that is ignored stays so, as nohup has it. It gets the
 * terminal, and no other open file. Returns 0, or an errno value. */
int fv_program_start(const char *path, const char *const *words, pid_t *process);

#endif
