/* The table of commands: the only place that knows them all. */
#include "app/command.h"

#include <stddef.h>

const struct fv_command fv_commands[] = {
    {"config", "print the commented configuration, or check a file", fv_command_config},
    {NULL, NULL, NULL},
};
