/* The program that keeps libcamera in a process of its own. */
#ifndef FOVEA_LIBCAMERA_CHILD_H
#define FOVEA_LIBCAMERA_CHILD_H

#include <stdbool.h>
#include <sys/types.h>

/* Start `path` with the end of a socket as FV_LIBCAMERA_SOCKET; it is never real-time. 0, or an
 * errno value. */
int fv_libcamera_spawn(const char *path, int socket, pid_t *pid);

#endif
