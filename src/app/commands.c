/* The table of commands: the only place that knows them all. */
#include "app/command.h"

#include <stddef.h>

const struct fv_command fv_commands[] = {
    {"run", "run the loop on a camera, a recording or the simulated camera", fv_command_run},
    {"check", "tell whether a configuration will run on this machine, and its memory",
     fv_command_check},
    {"config", "print the commented configuration, or check a file", fv_command_config},
    {"replay", "run a recording again and compare every message", fv_command_replay},
    {"features", "find, describe and draw the features of a picture", fv_command_features},
    {"match", "match the features of two pictures", fv_command_match},
    {"rectify", "take the lens's distortion out of a picture", fv_command_rectify},
    {"detect", "find objects in pictures with an int8 network", fv_command_detect},
    {"model", "tell what a model file holds, needs and how fast it runs here", fv_command_model},
    {"export", "write the frames of a source, and their truth, as files", fv_command_export},
    {"map", "tell what a saved map holds, export it, draw it", fv_command_map},
    {NULL, NULL, NULL},
};
