/* Commands of the `fovea` program. A command is one row of the table in commands.c: its name, one
 * line of help, the text of its manual page and the function that does it, in NAME_command.c. A row
 * is added when the command works, not before. */
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

int fv_command_run(int argc, char **argv);      /* the real-time loop */
int fv_command_check(int argc, char **argv);    /* will it run here */
int fv_command_config(int argc, char **argv);   /* print or check a configuration */
int fv_command_replay(int argc, char **argv);   /* run a recording again */
int fv_command_features(int argc, char **argv); /* features of a picture */
int fv_command_match(int argc, char **argv);    /* matches of two pictures */
int fv_command_rectify(int argc, char **argv);  /* a picture without distortion */
int fv_command_image(int argc, char **argv);    /* a picture after operations */
int fv_command_edges(int argc, char **argv);    /* the edges of a picture */
int fv_command_detect(int argc, char **argv);   /* what a network finds in pictures */
int fv_command_map(int argc, char **argv);      /* what a map file holds */
int fv_command_model(int argc, char **argv);    /* what a model file holds */
int fv_command_export(int argc, char **argv);   /* frames and truth as files */

#endif
