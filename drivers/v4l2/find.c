/* Which node the camera is behind. Nodes are numbered as cameras come, so a camera that was
 * unplugged may come back under another: the driver remembers the camera, not the node. */
#include <errno.h>
#include <string.h>

#include "v4l2.h"

static void cut(char *to, size_t bytes, const void *from, size_t from_bytes)
{
    const size_t kept = from_bytes < bytes ? from_bytes : bytes - 1;
    memcpy(to, from, kept);
    to[kept] = '\0';
}

static void read_sysfs(const char *node, struct fv_v4l2_identity *identity)
{
    const struct fv_v4l2_system *system = fv_v4l2_system;
    if (!system->attribute(node, "name", identity->name, sizeof identity->name))
        identity->name[0] = '\0';
    if (!system->attribute(node, "index", identity->index, sizeof identity->index))
        identity->index[0] = '\0';
    if (!system->attribute(node, "serial", identity->serial, sizeof identity->serial))
        identity->serial[0] = '\0';
}

bool fv_v4l2_identify(int fd, const char *node, struct fv_v4l2_identity *identity)
{
    struct v4l2_capability capability = {0};
    *identity = (struct fv_v4l2_identity){0};
    if (fv_v4l2_system->ioctl(fd, VIDIOC_QUERYCAP, &capability) != 0) return false;
    cut(identity->driver, sizeof identity->driver, capability.driver, sizeof capability.driver);
    cut(identity->card, sizeof identity->card, capability.card, sizeof capability.card);
    cut(identity->bus_info, sizeof identity->bus_info, capability.bus_info,
        sizeof capability.bus_info);
    read_sysfs(node, identity);
    return true;
}

static bool same_kind(const struct fv_v4l2_identity *a, const struct fv_v4l2_identity *b)
{
    return strcmp(a->name, b->name) == 0 && strcmp(a->index, b->index) == 0;
}

void fv_v4l2_identity_settle(struct fv_v4l2_identity *identity, const char *node)
{
    static char nodes[FV_V4L2_NODES_MAX][FV_V4L2_PATH_BYTES]; /* init-only */
    if (identity->serial[0] == '\0') return;
    const size_t count = fv_v4l2_system->nodes(nodes);
    for (size_t i = 0; i < count; i++) {
        struct fv_v4l2_identity other = {.name = ""};
        if (strcmp(nodes[i], node) == 0) continue;
        read_sysfs(nodes[i], &other);
        if (!same_kind(identity, &other) || strcmp(identity->serial, other.serial) != 0) continue;
        identity->serial[0] = '\0';
        return;
    }
}

/* The same camera: by its serial number wherever it is plugged in, without one by its place. */
static bool is_ours(const struct fv_v4l2_device *device, const struct fv_v4l2_identity *other)
{
    const struct fv_v4l2_identity *ours = &device->identity;
    if (!same_kind(ours, other) || strcmp(ours->driver, other->driver) != 0 ||
        strcmp(ours->card, other->card) != 0)
        return false;
    return ours->serial[0] != '\0' ? strcmp(ours->serial, other->serial) == 0
                                   : strcmp(ours->bus_info, other->bus_info) == 0;
}

/* FOVEA_OK: the node is our camera. FOVEA_GONE: it is not there. FOVEA_ERROR_INPUT: another camera
 * is, named in `error`. */
static enum fovea_status look_at(const struct fv_v4l2_device *device, const char *node,
                                 struct fovea_error *error)
{
    struct fv_v4l2_identity other = {.name = ""};
    read_sysfs(node, &other); /* first, since opening a camera may wake it */
    if (same_kind(&device->identity, &other)) {
        const int fd = fv_v4l2_system->open(node);
        if (fd < 0)
            return errno == EBUSY || errno == EACCES ? FOVEA_OK
                                                     : FOVEA_GONE; /* set-up says why not */
        const bool known = fv_v4l2_identify(fd, node, &other);
        const bool gone = !known && errno == ENODEV;
        fv_v4l2_system->close(fd);
        if (!known) return gone ? FOVEA_GONE : FOVEA_OK;
        if (is_ours(device, &other)) return FOVEA_OK;
    }
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%s: found '%.64s' at %.64s, expected '%.32s' at %.32s", device->uri,
                           other.card[0] != '\0' ? other.card : other.name, node,
                           device->identity.card, device->identity.bus_info);
}

/* A name that udev gives to one camera or one port is taken at its word: no other node is looked
 * at. */
static bool named_by_udev(const char *path)
{
    return strncmp(path, "/dev/v4l/", 9) == 0;
}

enum fovea_status fv_v4l2_find(struct fv_v4l2_device *device, struct fovea_error *error)
{
    static _Thread_local char nodes[FV_V4L2_NODES_MAX][FV_V4L2_PATH_BYTES];
    char node[FV_V4L2_PATH_BYTES];
    struct fovea_error unused;
    const bool there = fv_v4l2_system->resolve(device->options.path, node);
    if (!device->known) { /* the first time: whatever it is */
        if (!there) return FOVEA_GONE;
        memcpy(device->node, node, sizeof node);
        return FOVEA_OK;
    }
    enum fovea_status status = there ? look_at(device, node, error) : FOVEA_GONE;
    if (status == FOVEA_OK) {
        memcpy(device->node, node, sizeof node);
        return FOVEA_OK;
    }
    const size_t count = named_by_udev(device->options.path) ? 0 : fv_v4l2_system->nodes(nodes);
    for (size_t i = 0; i < count; i++) {
        if (look_at(device, nodes[i], &unused) != FOVEA_OK) continue;
        memcpy(device->node, nodes[i], sizeof device->node);
        return FOVEA_OK;
    }
    return FOVEA_GONE; /* `error` names another camera in its place */
}
