/* The commands of this room; rows in app/commands.c. argv[0] is the name; they return enum fv_exit.
 */
#ifndef FOVEA_APP_LAB_COMMANDS_H
#define FOVEA_APP_LAB_COMMANDS_H

#include "support/say.h"

int fv_command_features(int argc, char **argv); /* features of a picture */
int fv_command_match(int argc, char **argv);    /* matches of two pictures */
int fv_command_rectify(int argc, char **argv);  /* a picture without distortion */
int fv_command_image(int argc, char **argv);    /* a picture after operations */
int fv_command_cameras(int argc, char **argv);  /* the cameras of this host */
int fv_command_edges(int argc, char **argv);    /* the edges of a picture */
int fv_command_segments(int argc, char **argv); /* the line segments of a picture */
int fv_command_detect(int argc, char **argv);   /* what a network finds in pictures */
int fv_command_segment(int argc, char **argv);  /* the class of each pixel of a picture */
int fv_command_map(int argc, char **argv);      /* what a map file holds */
int fv_command_model(int argc, char **argv);    /* what a model file holds */
int fv_command_export(int argc, char **argv);   /* frames and truth as files */

#endif
