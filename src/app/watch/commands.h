/* The commands of this room; rows in app/commands.c. argv[0] is the name; they return enum fv_exit.
 */
#ifndef FOVEA_APP_WATCH_COMMANDS_H
#define FOVEA_APP_WATCH_COMMANDS_H

#include "support/say.h"

int fv_command_compare(int argc, char **argv);  /* where two runs became different */
int fv_command_echo(int argc, char **argv);     /* messages as JSON */
int fv_command_top(int argc, char **argv);      /* robots that run */
int fv_command_snapshot(int argc, char **argv); /* a preview as a file */

#endif
