/* Commands of the `fovea` program. A command is one row of the table in commands.c: its name, one
 * line of help, the text of its manual page and the function that does it, in NAME_command.c of its
 * room and declared in the commands.h there. A row is added when the command works, not before. */
#ifndef FOVEA_APP_COMMAND_H
#define FOVEA_APP_COMMAND_H

#include "support/say.h"

struct fv_command {
    const char *name;
    const char *help;                  /* one line, no full stop */
    int (*run)(int argc, char **argv); /* argv[0] is the command's name; returns enum fv_exit */
    const char *description;           /* sentences for the manual page */
    const char *examples;              /* command lines, one per line */
};

/* All commands, ended by a row whose name is NULL. */
extern const struct fv_command fv_commands[];

/* All of the program: find the command in argv[1] and run it. Returns the exit status,
 * FV_EXIT_FAILED (and a line) also when what it printed on stdout could not be written. */
int fv_dispatch(int argc, char **argv);

#endif
