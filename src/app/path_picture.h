/* The picture of a path: the camera's centres, and the truth where there is one, seen along the direction in
 * which the path extends least. Off the loop thread. */
#ifndef FOVEA_APP_PATH_PICTURE_H
#define FOVEA_APP_PATH_PICTURE_H

#include "app/trajectory.h"

/* FOVEA_ERROR_SYSTEM: the picture could not be written. `name` is the source, for the title. */
enum fovea_status fv_path_picture(const char *path, const char *name,
                                  const struct fv_trajectory_summary *summary, struct fovea_error *error);

#endif
