#include "common/fake_libcamera.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <malloc.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "../../drivers/libcamera/protocol.h"

#define STAGE "FAKE_LIBCAMERA"
enum { BUFFERS = 4, BUFFER_BYTES = 8192, PERIOD_MS = 5 };

static void die(const char *what)
{
    perror(what);
    abort();
}

static int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static struct fake_stage *map_stage(const char *path)
{
    const int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (fd < 0 || ftruncate(fd, sizeof(struct fake_stage)) != 0) die(path);
    struct fake_stage *stage = mmap(NULL, sizeof *stage, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (stage == MAP_FAILED) die(path);
    close(fd);
    return stage;
}

/* ---- in the test ----------------------------------------------------------------------------- */

static void name_in(const struct fake_stage *stage, const char *file, char path[128])
{
    snprintf(path, 128, "%s/%s", stage->folder, file);
}

struct fake_stage *fake_stage_open(void)
{
    char folder[] = "/tmp/fovea-libcamera-XXXXXX", path[128], self[4096];
    const ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    if (mkdtemp(folder) == NULL || length <= 0) die(folder);
    self[length] = '\0';
    snprintf(path, sizeof path, "%s/stage", folder);
    struct fake_stage *stage = map_stage(path);
    memcpy(stage->folder, folder, sizeof folder);
    setenv(STAGE, path, 1);
    setenv("FOVEA_PLUGINS", folder, 1);
    name_in(stage, FV_LIBCAMERA_PROGRAM, path);
    if (symlink(self, path) != 0) die(path);
    return stage;
}

void fake_stage_reset(struct fake_stage *stage)
{
    atomic_store(&stage->rate_hz, 100);
    atomic_store(&stage->away, false);
    atomic_store(&stage->deaf, false);
    atomic_store(&stage->fault, FAKE_NONE);
    atomic_store(&stage->fault_at_set_up, FAKE_NONE);
    atomic_store(&stage->fault_at_learn, FAKE_NONE);
    atomic_store(&stage->fault_when_set, FAKE_NONE);
    atomic_store(&stage->stubborn, false);
    atomic_store(&stage->scribble, 0);
    atomic_store(&stage->lives, 0);
    atomic_store(&stage->set_ups, 0);
    atomic_store(&stage->missed, 0);
    atomic_store(&stage->exposure_us, 0);
    atomic_store(&stage->gain, 0);
    atomic_store(&stage->refuses, false);
    atomic_store(&stage->before_answer, 0);
}

void fake_stage_hide(struct fake_stage *stage, bool hidden)
{
    char shown[128], away[128];
    name_in(stage, FV_LIBCAMERA_PROGRAM, shown);
    name_in(stage, "hidden", away);
    if (rename(hidden ? shown : away, hidden ? away : shown) != 0) die(shown);
}

void fake_stage_close(struct fake_stage *stage)
{
    char path[128];
    name_in(stage, FV_LIBCAMERA_PROGRAM, path);
    unlink(path);
    name_in(stage, "stage", path);
    unlink(path);
    rmdir(stage->folder);
    munmap(stage, sizeof *stage);
}

static long count_lines(const char *path, const char *with)
{
    long count = 0;
    FILE *file = fopen(path, "re");
    for (char line[512]; file != NULL && fgets(line, sizeof line, file) != NULL;)
        count += strstr(line, with) != NULL;
    if (file != NULL) fclose(file);
    return count;
}

/* Children of this process: how many. `signal`: what each is sent, 0 for nothing. */
static long find_children(int signal)
{
    long count = 0;
    char path[300];
    DIR *folder = opendir("/proc");
    for (const struct dirent *entry; folder != NULL && (entry = readdir(folder)) != NULL;) {
        if (entry->d_name[0] < '0' || entry->d_name[0] > '9') continue;
        char parent[32];
        snprintf(path, sizeof path, "/proc/%s/status", entry->d_name);
        snprintf(parent, sizeof parent, "PPid:\t%d\n", (int)getpid());
        if (count_lines(path, parent) == 0) continue;
        count++;
        if (signal != 0) kill((pid_t)atol(entry->d_name), signal);
    }
    if (folder != NULL) closedir(folder);
    return count;
}

void fake_libcamera_end_all(void)
{
    find_children(SIGKILL);
    while (waitpid(-1, NULL, 0) > 0 || errno == EINTR) {
    }
}

struct fake_holdings fake_holdings(void)
{
    struct fake_holdings holdings = {.buffers = count_lines("/proc/self/maps", "fake-buffer"),
                                     .processes = find_children(0)};
    const struct mallinfo2 heap = mallinfo2();
    holdings.heap_bytes = heap.uordblks + heap.hblkhd;
    DIR *folder = opendir("/proc/self/fd");
    while (folder != NULL && readdir(folder) != NULL)
        holdings.descriptors++;
    if (folder != NULL) closedir(folder);
    return holdings;
}

/* ---- in the process -------------------------------------------------------------------------- */

static struct {
    struct fake_stage *stage;
    bool streams, missed, with_camera[BUFFERS];
    uint8_t *buffers[BUFFERS];
    int descriptors[BUFFERS];
    uint32_t sequence;
} me;

static void send_bytes(const void *bytes, size_t count, const int *descriptors,
                       uint32_t descriptor_count)
{
    union {
        struct cmsghdr align;
        char space[CMSG_SPACE(sizeof(int) * BUFFERS)];
    } beside = {.space = {0}};
    struct iovec piece = {.iov_base = (void *)(uintptr_t)bytes, .iov_len = count};
    struct msghdr message = {.msg_iov = &piece, .msg_iovlen = 1};
    if (descriptor_count > 0) {
        message.msg_control = beside.space;
        message.msg_controllen = CMSG_SPACE(sizeof(int) * descriptor_count);
        struct cmsghdr *header = CMSG_FIRSTHDR(&message);
        header->cmsg_level = SOL_SOCKET;
        header->cmsg_type = SCM_RIGHTS;
        header->cmsg_len = CMSG_LEN(sizeof(int) * descriptor_count);
        memcpy(CMSG_DATA(header), descriptors, sizeof(int) * descriptor_count);
    }
    if (sendmsg(FV_LIBCAMERA_SOCKET, &message, MSG_NOSIGNAL) < 0) _exit(0);
}

static void send_event(struct fv_libcamera_event *event, uint32_t descriptor_count)
{
    event->version = FV_LIBCAMERA_VERSION;
    send_bytes(event, fv_libcamera_event_bytes(event->kind), me.descriptors, descriptor_count);
}

static void send_broken(uint32_t kind, enum fovea_status status, const char *text)
{
    struct fv_libcamera_event event = {.kind = kind, .error = {.status = status}};
    snprintf(event.error.text, sizeof event.error.text, "%s", text);
    me.streams = false;
    send_event(&event, 0);
}

/* What is asked for, once. True: something was done in place of what is usual. */
static bool do_wrong(atomic_int *fault, uint32_t kind)
{
    struct fv_libcamera_event event = {.kind = FV_LIBCAMERA_FRAME, .frame = {.index = 77}};
    switch (atomic_load(&me.stage->stubborn) ? atomic_load(fault)
                                             : atomic_exchange(fault, FAKE_NONE)) {
    case FAKE_ABORT:
        signal(SIGABRT, SIG_DFL);
        abort();
    case FAKE_EXIT:
        _exit(3);
    case FAKE_HANG:
        alarm(60); /* a test that fails leaves it to nobody */
        for (;;)
            pause();
    case FAKE_BUSY:
        for (const int64_t end_ns = now_ns() + 1500000000; now_ns() < end_ns;) {
        }
        return false;
    case FAKE_SHORT:
        send_bytes(&event, 3, NULL, 0);
        return true;
    case FAKE_VERSION:
        event.version = FV_LIBCAMERA_VERSION + 1; /* and nothing else is wrong with it */
        event.frame.index = 0;
        send_bytes(&event, fv_libcamera_event_bytes(event.kind), NULL, 0);
        return true;
    case FAKE_INDEX:
        send_event(&event, 0);
        return true;
    case FAKE_DESCRIPTORS:
        send_bytes(&event, 9, me.descriptors, BUFFERS);
        return true;
    case FAKE_FEWER:
        event = (struct fv_libcamera_event){.kind = kind, .buffer_count = BUFFERS};
        send_event(&event, BUFFERS - 1);
        return true;
    case FAKE_BROKEN:
        send_broken(kind, FOVEA_ERROR_SYSTEM, "it is on fire");
        return true;
    default:
        return false;
    }
}

static void send_frame(void)
{
    int index = 0;
    while (index < BUFFERS && !me.with_camera[index])
        index++;
    if (index == BUFFERS) return;
    me.with_camera[index] = false;
    me.sequence++;
    for (int32_t y = 0; y < FAKE_HEIGHT; y++)
        for (int32_t x = 0; x < FAKE_WIDTH; x++)
            me.buffers[index][y * FAKE_STRIDE + x] = fake_pixel(me.sequence - 1, x, y);
    struct fv_libcamera_event event = {.kind = FV_LIBCAMERA_FRAME,
                                       .frame = {.index = (uint32_t)index,
                                                 .bytes = FAKE_STRIDE * FAKE_HEIGHT,
                                                 .stamp = {.stamp_ns = now_ns(),
                                                           .clock_known = true,
                                                           .clock = FOVEA_CLOCK_MONOTONIC,
                                                           .meaning = FOVEA_STAMP_EXPOSURE_START,
                                                           .sequence_known = true,
                                                           .sequence = me.sequence}}};
    send_event(&event, 0);
}

static void learn(struct fv_libcamera_event *event)
{
    event->agreed = (struct fv_libcamera_agreed){.width = FAKE_WIDTH,
                                                 .height = FAKE_HEIGHT,
                                                 .format = FOVEA_PIXEL_GREY8,
                                                 .rate_hz = atomic_load(&me.stage->rate_hz),
                                                 .buffers = BUFFERS,
                                                 .id = "a camera"};
}

static void set_up(struct fv_libcamera_event *event)
{
    event->buffer_count = BUFFERS;
    event->stride_bytes = FAKE_STRIDE;
    for (int i = 0; i < BUFFERS; i++)
        event->buffers[i] = (struct fv_libcamera_buffer){.bytes = BUFFER_BYTES};
    for (int i = 0; i < BUFFERS; i++)
        me.with_camera[i] = true;
    me.streams = true;
}

static void take_options(const struct fv_libcamera_options *options)
{
    atomic_store(&me.stage->exposure_us, (int)(options->exposure_ms * 1000 + 0.5));
    atomic_store(&me.stage->gain, (int)(options->gain * 1000));
}

static void set_controls(const struct fv_libcamera_options *options,
                         struct fv_libcamera_event *event)
{
    for (uint32_t i = 0; i < atomic_load(&me.stage->before_answer); i++)
        send_frame();
    event->error.status = atomic_load(&me.stage->refuses) ? FOVEA_ERROR_INPUT : FOVEA_OK;
    if (event->error.status != FOVEA_OK)
        snprintf(event->error.text, sizeof event->error.text, "gain: found %g, expected [1, 8]",
                 options->gain);
    else
        take_options(options);
}

static void serve(const struct fv_libcamera_request *request)
{
    struct fv_libcamera_event event = {.kind = FV_LIBCAMERA_ANSWER};
    uint32_t descriptors = 0;
    switch (request->call) {
    case FV_LIBCAMERA_LEARN:
        if (do_wrong(&me.stage->fault_at_learn, FV_LIBCAMERA_ANSWER)) return;
        learn(&event);
        break;
    case FV_LIBCAMERA_FIND:
        me.missed = atomic_load(&me.stage->away) || (me.missed && atomic_load(&me.stage->deaf));
        atomic_fetch_add(&me.stage->missed, me.missed);
        event.error.status = me.missed ? FOVEA_GONE : FOVEA_OK;
        break;
    case FV_LIBCAMERA_SET_UP:
        atomic_fetch_add(&me.stage->set_ups, 1);
        if (do_wrong(&me.stage->fault_at_set_up, FV_LIBCAMERA_ANSWER)) return;
        set_up(&event);
        descriptors = BUFFERS;
        break;
    case FV_LIBCAMERA_KNOW:
        take_options(&request->options);
        return;
    case FV_LIBCAMERA_CONTROL:
        if (do_wrong(&me.stage->fault_when_set, FV_LIBCAMERA_BROKEN)) return;
        set_controls(&request->options, &event);
        break;
    case FV_LIBCAMERA_GIVE:
        me.with_camera[request->index] = true;
        return;
    default:
        return;
    }
    send_event(&event, descriptors);
}

static void act(void)
{
    const int scribble = atomic_load(&me.stage->scribble);
    for (int i = 0; i < BUFFERS && scribble > 0; i++)
        me.buffers[i][0] = (uint8_t)(scribble - 1);
    atomic_store(&me.stage->scribble, 0);
    if (!me.streams || do_wrong(&me.stage->fault, FV_LIBCAMERA_BROKEN)) return;
    if (atomic_load(&me.stage->away))
        send_broken(FV_LIBCAMERA_BROKEN, FOVEA_GONE, "the camera is away");
    else
        send_frame();
}

bool fake_libcamera_is_me(const char *name)
{
    return strcmp(name, FV_LIBCAMERA_PROGRAM) == 0;
}

int fake_libcamera_run(void)
{
    static struct fv_libcamera_request request;
    me.stage = map_stage(getenv(STAGE) != NULL ? getenv(STAGE) : "");
    atomic_store(&me.stage->pid, (int)getpid());
    atomic_fetch_add(&me.stage->lives, 1);
    for (int i = 0; i < BUFFERS; i++) {
        me.descriptors[i] = memfd_create("fake-buffer", MFD_CLOEXEC);
        if (me.descriptors[i] < 0 || ftruncate(me.descriptors[i], BUFFER_BYTES) != 0) die("memfd");
        me.buffers[i] =
            mmap(NULL, BUFFER_BYTES, PROT_READ | PROT_WRITE, MAP_SHARED, me.descriptors[i], 0);
    }
    for (;;) {
        struct pollfd socket = {.fd = FV_LIBCAMERA_SOCKET, .events = POLLIN};
        if (poll(&socket, 1, PERIOD_MS) > 0) {
            if (recv(FV_LIBCAMERA_SOCKET, &request, sizeof request, 0) <= 0) return 0;
            serve(&request);
        } else {
            act();
        }
    }
}
