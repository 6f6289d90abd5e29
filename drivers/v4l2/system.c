#include "system.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "../clock.h"

static int open_node(const char *path)
{
    return open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
}

static int control(int fd, unsigned long request, void *argument)
{
    int result;
    do
        result = ioctl(fd, request, argument);
    while (result < 0 && errno == EINTR);
    return result;
}

static int wait_for(struct pollfd *fds, nfds_t count, int64_t timeout_ns)
{
    const struct timespec timeout = fv_clock_timespec(timeout_ns);
    return ppoll(fds, count, timeout_ns < 0 ? NULL : &timeout, NULL);
}

static void *map(int fd, size_t bytes, int64_t offset)
{
    void *memory = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, offset);
    return memory == MAP_FAILED ? NULL : memory;
}

static size_t list_nodes(char paths[FV_V4L2_NODES_MAX][FV_V4L2_PATH_BYTES])
{
    size_t count = 0;
    DIR *folder = opendir("/dev");
    if (folder == NULL) return 0;
    for (const struct dirent *entry;
         (entry = readdir(folder)) != NULL && count < FV_V4L2_NODES_MAX;) {
        if (strncmp(entry->d_name, "video", 5) != 0 || strlen(entry->d_name) > 16) continue;
        if (entry->d_name[5] < '0' || entry->d_name[5] > '9') continue;
        snprintf(paths[count++], FV_V4L2_PATH_BYTES, "/dev/%.16s", entry->d_name);
    }
    closedir(folder);
    return count;
}

static bool resolve(const char *path, char node[FV_V4L2_PATH_BYTES])
{
    char whole[PATH_MAX];
    if (realpath(path, whole) == NULL || strlen(whole) >= FV_V4L2_PATH_BYTES) return false;
    memcpy(node, whole, strlen(whole) + 1);
    return true;
}

static bool link_to(const char *folder, const char *node, char path[FV_V4L2_PATH_BYTES])
{
    struct dirent **entries;
    bool found = false;
    const int count = scandir(folder, &entries, NULL, alphasort);
    for (int i = 0; i < count; i++) {
        char whole[FV_V4L2_PATH_BYTES], leads_to[FV_V4L2_PATH_BYTES];
        const int length = snprintf(whole, sizeof whole, "%s/%s", folder, entries[i]->d_name);
        if (!found && length < (int)sizeof whole && resolve(whole, leads_to) &&
            strcmp(leads_to, node) == 0) {
            memcpy(path, whole, (size_t)length + 1);
            found = true;
        }
        free(entries[i]);
    }
    if (count >= 0) free(entries);
    return found;
}

static bool attribute(const char *node, const char *name, char *value, size_t bytes)
{
    char path[FV_V4L2_PATH_BYTES + 96];
    const char *base = strrchr(node, '/');
    const char *place = strcmp(name, "serial") == 0 ? "device/../serial" : name;
    if (base == NULL) return false;
    snprintf(path, sizeof path, "/sys/class/video4linux/%.64s/%.64s", base + 1, place);
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) return false;
    const ssize_t length = read(fd, value, bytes - 1);
    close(fd);
    if (length <= 0) return false;
    value[length] = '\0';
    value[strcspn(value, "\n")] = '\0';
    return true;
}

const struct fv_v4l2_system fv_v4l2_system_real = {
    .open = open_node,
    .close = close,
    .ioctl = control,
    .poll = wait_for,
    .map = map,
    .unmap = munmap,
    .nodes = list_nodes,
    .resolve = resolve,
    .link = link_to,
    .attribute = attribute,
};
const struct fv_v4l2_system *fv_v4l2_system = &fv_v4l2_system_real;
