#include "common/fake_inside.h"

#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../../drivers/v4l2/system.h"

enum { LINKS_MAX = 4 };

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static struct fake_camera cameras[FAKE_CAMERAS_MAX];
static size_t camera_count;
static int next_fd = FAKE_FD_FIRST;
static struct link {
    char path[128];
    const struct fake_camera *camera;
} links[LINKS_MAX];
static size_t link_count;

void fake_lock(void)
{
    pthread_mutex_lock(&lock);
}

void fake_unlock(void)
{
    pthread_mutex_unlock(&lock);
}

/* ---- which camera ---------------------------------------------------------------------------- */

/* Under the lock, as all from here on. The camera is found while its descriptor is open, plugged in
 * or not.
 */
static struct fake_camera *by_fd(int fd)
{
    for (size_t i = 0; i < camera_count; i++)
        if (cameras[i].fd == fd && fd >= FAKE_FD_FIRST) return &cameras[i];
    return NULL;
}

static struct fake_camera *by_node(const char *node)
{
    for (size_t i = 0; i < camera_count; i++)
        if (cameras[i].plugged && strcmp(cameras[i].node, node) == 0) return &cameras[i];
    return NULL;
}

/* ---- the system calls ------------------------------------------------------------------------ */

static int fake_open(const char *path)
{
    fake_lock();
    struct fake_camera *camera = by_node(path);
    int fd = fake_refuse(ENOENT);
    if (camera != NULL && camera->open_now > 0) {
        fd = fake_refuse(EBUSY);
    } else if (camera != NULL) {
        const struct fake_failure *f = camera->failures;
        int reason = 0;
        for (int i = 0; i < FAKE_FAILURES_MAX; i++)
            if (f[i].request == 0 && f[i].reason != 0 && f[i].times != 0) reason = f[i].reason;
        camera->open_now += reason == 0;
        camera->opens++;
        camera->fd = next_fd;
        fd = reason == 0 ? next_fd++ : fake_refuse(reason);
    }
    fake_unlock();
    return fd;
}

static int fake_close(int fd)
{
    fake_lock();
    struct fake_camera *camera = by_fd(fd);
    assert_non_null(camera);
    assert_int_equal(camera->open_now, 1);
    camera->open_now = 0;
    camera->fd = -1;
    camera->dead = false;
    if (camera->plugged) fake_stream(camera, false);
    fake_unlock();
    return 0;
}

static int fake_ioctl(int fd, unsigned long request, void *argument)
{
    int result;
    fake_lock();
    struct fake_camera *camera = by_fd(fd);
    assert_non_null(camera);
    if (!fake_alive(camera)) {
        result = fake_refuse(ENODEV);
        goto done;
    }
    for (int i = 0; i < FAKE_FAILURES_MAX; i++) {
        struct fake_failure *f = &camera->failures[i];
        if (f->request != request || f->times == 0) continue;
        f->times -= f->times > 0;
        result = fake_refuse(f->reason);
        goto done;
    }
    result = fake_answer(camera, request, argument);
done:
    fake_unlock();
    return result;
}

static short events_now(const struct fake_camera *camera)
{
    if (camera == NULL) return POLLNVAL;
    if (!fake_alive(camera)) return POLLERR | POLLHUP | POLLPRI;
    if (camera->fatal) return POLLERR;
    return (short)((fake_frame_ready(camera) ? POLLIN : 0) | (camera->source_change ? POLLPRI : 0));
}

/* fds[0] is a real descriptor, fds[1] (if any) one of ours. */
static int fake_poll(struct pollfd *fds, nfds_t count, int64_t timeout_ns)
{
    const int64_t end_ns = fake_clock_ns(CLOCK_MONOTONIC) + timeout_ns;
    for (;;) {
        short events = 0;
        if (count > 1) {
            fake_lock();
            events = events_now(by_fd(fds[1].fd));
            fake_unlock();
            fds[1].revents = (short)(events & (fds[1].events | POLLERR | POLLHUP | POLLNVAL));
            events = fds[1].revents;
        }
        const int64_t left_ns = end_ns - fake_clock_ns(CLOCK_MONOTONIC);
        const struct timespec pause = {.tv_nsec = events != 0 || left_ns <= 0 ? 0 : 200000};
        const int woken = ppoll(fds, 1, &pause, NULL);
        if (events != 0 || woken != 0 || left_ns <= 0) return woken + (events != 0);
    }
}

static void *fake_map(int fd, size_t bytes, int64_t offset)
{
    fake_lock();
    struct fake_camera *camera = by_fd(fd);
    assert_non_null(camera);
    assert_true((size_t)offset + bytes <= 32 * (size_t)FAKE_FRAME_BYTES_MAX);
    if (camera->memory == NULL) camera->memory = calloc(32, FAKE_FRAME_BYTES_MAX);
    camera->mapped_now++;
    void *memory = camera->memory + offset;
    fake_unlock();
    return memory;
}

static int fake_unmap(void *memory, size_t bytes)
{
    (void)bytes;
    fake_lock();
    for (size_t i = 0; i < camera_count; i++) {
        const uint8_t *begin = cameras[i].memory, *at = memory;
        if (begin != NULL && at >= begin && at < begin + 32 * (size_t)FAKE_FRAME_BYTES_MAX)
            cameras[i].mapped_now--;
    }
    fake_unlock();
    return 0;
}

static size_t fake_nodes(char paths[FV_V4L2_NODES_MAX][FV_V4L2_PATH_BYTES])
{
    size_t count = 0;
    fake_lock();
    for (size_t i = 0; i < camera_count; i++)
        if (cameras[i].plugged) snprintf(paths[count++], FV_V4L2_PATH_BYTES, "%s", cameras[i].node);
    fake_unlock();
    return count;
}

static bool fake_resolve(const char *path, char node[FV_V4L2_PATH_BYTES])
{
    fake_lock();
    const struct fake_camera *camera = by_node(path);
    for (size_t i = 0; i < link_count && i < LINKS_MAX; i++)
        if (strcmp(links[i].path, path) == 0 && links[i].camera->plugged) camera = links[i].camera;
    if (camera != NULL) snprintf(node, FV_V4L2_PATH_BYTES, "%s", camera->node);
    fake_unlock();
    return camera != NULL;
}

static bool fake_link_to(const char *folder, const char *node, char path[FV_V4L2_PATH_BYTES])
{
    bool found = false;
    fake_lock();
    for (size_t i = 0; i < link_count && !found; i++) {
        found = strncmp(links[i].path, folder, strlen(folder)) == 0 && links[i].camera->plugged &&
                strcmp(links[i].camera->node, node) == 0;
        if (found) memcpy(path, links[i].path, sizeof links[0].path);
    }
    fake_unlock();
    return found;
}

static bool fake_attribute(const char *node, const char *name, char *value, size_t bytes)
{
    fake_lock();
    const struct fake_camera *camera = by_node(node);
    const char *found = camera == NULL                ? NULL
                        : strcmp(name, "name") == 0   ? camera->name
                        : strcmp(name, "serial") == 0 ? camera->serial
                        : strcmp(name, "index") == 0  ? "0"
                                                      : NULL;
    if (found != NULL) snprintf(value, bytes, "%s", found);
    fake_unlock();
    return found != NULL;
}

static const struct fv_v4l2_system fake_system = {
    .open = fake_open,
    .close = fake_close,
    .ioctl = fake_ioctl,
    .poll = fake_poll,
    .map = fake_map,
    .unmap = fake_unmap,
    .nodes = fake_nodes,
    .resolve = fake_resolve,
    .link = fake_link_to,
    .attribute = fake_attribute,
};

/* ---- for tests ------------------------------------------------------------------------------- */

void fake_begin(void)
{
    camera_count = link_count = 0;
    memset(cameras, 0, sizeof cameras);
    fv_v4l2_system = &fake_system;
}

void fake_end(void)
{
    for (size_t i = 0; i < camera_count; i++) {
        assert_int_equal(cameras[i].open_now, 0);
        assert_int_equal(cameras[i].mapped_now, 0);
        free(cameras[i].memory);
        cameras[i].memory = NULL;
    }
    fv_v4l2_system = &fv_v4l2_system_real;
}

int fake_set_up(void **state)
{
    (void)state;
    fake_begin();
    return 0;
}

int fake_tear_down(void **state)
{
    (void)state;
    fake_end();
    return 0;
}

struct fake_camera *fake_new(void)
{
    assert_true(camera_count < FAKE_CAMERAS_MAX);
    struct fake_camera *camera = &cameras[camera_count++];
    *camera = (struct fake_camera){
        .driver = "fake",
        .card = "Fake camera",
        .bus_info = "usb-fake-1",
        .name = "Fake camera: video",
        .serial = "",
        .formats = {V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_Y10, V4L2_PIX_FMT_Y12, V4L2_PIX_FMT_Y16,
                    V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_UYVY, V4L2_PIX_FMT_NV12, V4L2_PIX_FMT_YUV420,
                    V4L2_PIX_FMT_SRGGB8, V4L2_PIX_FMT_SBGGR8, V4L2_PIX_FMT_SGRBG8,
                    V4L2_PIX_FMT_SGBRG8, V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_RGB24,
                    V4L2_PIX_FMT_BGR24},
        .width = 96,
        .height = 64,
        .rate_hz = 900,
        .controls =
            {{V4L2_CID_BRIGHTNESS, "Brightness", V4L2_CTRL_TYPE_INTEGER, -64, 64, 4, 0, {NULL}, 0},
             {V4L2_CID_GAIN, "Gain", V4L2_CTRL_TYPE_INTEGER, 0, 255, 1, 16, {NULL}, 0},
             {V4L2_CID_AUTOGAIN, "Gain, Automatic", V4L2_CTRL_TYPE_BOOLEAN, 0, 1, 1, 1, {NULL}, 0},
             {V4L2_CID_EXPOSURE_AUTO,
              "Auto Exposure",
              V4L2_CTRL_TYPE_MENU,
              0,
              3,
              1,
              3,
              {NULL, "Manual Mode", NULL, "Aperture Priority Mode", NULL},
              0},
             {V4L2_CID_EXPOSURE_ABSOLUTE,
              "Exposure Time, Absolute",
              V4L2_CTRL_TYPE_INTEGER,
              3,
              2047,
              1,
              166,
              {NULL},
              0}},
    };
    camera->fd = -1;
    camera->last_stamp_ns = 0;
    return camera;
}

void fake_plug(struct fake_camera *camera, const char *node)
{
    fake_lock();
    camera->plugged = true;
    camera->sequence = 0;
    camera->streaming = camera->fatal = false;
    camera->queue_count = 0;
    camera->set_rate_hz = camera->rate_hz;
    camera->format = camera->formats[0];
    camera->set_width = camera->width;
    camera->set_height = camera->height;
    /* A descriptor of the time before stays dead. */
    if (camera->open_now > 0) camera->dead = true;
    snprintf(camera->node, sizeof camera->node, "%s", node);
    fake_unlock();
}

void fake_unplug(struct fake_camera *camera)
{
    fake_lock();
    camera->plugged = camera->streaming = false;
    fake_unlock();
}

void fake_link(const char *path, const struct fake_camera *camera)
{
    fake_lock();
    snprintf(links[link_count].path, sizeof links[0].path, "%s", path);
    links[link_count++].camera = camera;
    fake_unlock();
}

void fake_fail(struct fake_camera *camera, unsigned long request, int reason, int times)
{
    for (int i = 0; i < FAKE_FAILURES_MAX; i++) {
        struct fake_failure *f = &camera->failures[i];
        if (f->times != 0 && f->request != request) continue;
        *f = (struct fake_failure){request, reason, times};
        return;
    }
}
