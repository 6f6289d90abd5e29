/* Files of one folder that are asked for by name from outside. */
#ifndef FOVEA_SUPPORT_FOLDER_H
#define FOVEA_SUPPORT_FOLDER_H

#include <sys/stat.h>

/* Open `name`, which holds no '/', in the open folder for reading: an ordinary file, no link, pipe
 * or device. Never waits for another program. -1: none, and errno says why (EINVAL: no ordinary
 * file; ELOOP: a link). */
int fv_folder_open_file(int folder, const char *name, struct stat *there);

#endif
