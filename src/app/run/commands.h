/* The commands of this room; rows in app/commands.c. argv[0] is the name; they return enum fv_exit.
 */
#ifndef FOVEA_APP_RUN_COMMANDS_H
#define FOVEA_APP_RUN_COMMANDS_H

#include "support/say.h"

int fv_command_run(int argc, char **argv);    /* the real-time loop */
int fv_command_check(int argc, char **argv);  /* will it run here */
int fv_command_replay(int argc, char **argv); /* run a recording again */

#endif
