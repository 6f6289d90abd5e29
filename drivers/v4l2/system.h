/* The system calls of the V4L2 driver, so that tests can put a fake device behind them. */
#ifndef FOVEA_V4L2_SYSTEM_H
#define FOVEA_V4L2_SYSTEM_H

#include <poll.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { FV_V4L2_PATH_BYTES = 256, FV_V4L2_NODES_MAX = 64 };

/* As the calls of the same names unless said otherwise: -1 (map: NULL) and errno on failure. */
struct fv_v4l2_system {
    int (*open)(const char *path); /* to read and write, not blocking */
    int (*close)(int fd);
    int (*ioctl)(int fd, unsigned long request, void *argument); /* goes on after a signal */
    int (*poll)(struct pollfd *fds, nfds_t count, int64_t timeout_ns);
    void *(*map)(int fd, size_t bytes, int64_t offset); /* shared, to read and write */
    int (*unmap)(void *memory, size_t bytes);
    /* Device nodes of this host (/dev/videoN); returns how many. */
    size_t (*nodes)(char paths[FV_V4L2_NODES_MAX][FV_V4L2_PATH_BYTES]);
    /* The node that a name stands for, through links. False: there is none. */
    bool (*resolve)(const char *path, char node[FV_V4L2_PATH_BYTES]);
    /* The first name in `folder`, in the order of their letters, that leads to the node. False:
     * there is none. */
    bool (*link)(const char *folder, const char *node, char path[FV_V4L2_PATH_BYTES]);
    /* What sysfs says of a node: "name", "index", "serial" (of its USB device); without the
     * newline. False: nothing. */
    bool (*attribute)(const char *node, const char *name, char *value, size_t bytes);
};

extern const struct fv_v4l2_system fv_v4l2_system_real;
/* What the driver calls. Tests set it before a source is opened. */
extern const struct fv_v4l2_system *fv_v4l2_system;

#endif
