/* The command of this room; rows in app/commands.c. argv[0] is its name; it returns enum fv_exit.
 */
#ifndef FOVEA_APP_CONFIG_COMMANDS_H
#define FOVEA_APP_CONFIG_COMMANDS_H

#include "support/say.h"

int fv_command_config(int argc, char **argv); /* print or check a configuration */

#endif
