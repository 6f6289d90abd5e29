#include "client.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/dma-buf.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "../clock.h"
#include "../plugin.h"
#include "child.h"

int64_t fv_libcamera_answer_ns = INT64_C(30000000000), fv_libcamera_idle_ns = INT64_C(6000000000),
        fv_libcamera_away_ns = INT64_C(5000000000);
_Atomic int64_t fv_libcamera_patience_ns = INT64_C(1000000000);

/* A buffer of the camera, mapped here. */
struct mapping {
    uint8_t *memory;
    size_t bytes, offset;
    int fd;
};

enum { LEFT_MAX = 4 };

struct fv_libcamera_client {
    char uri[FV_LIBCAMERA_ID_BYTES + 16];
    struct fv_libcamera_agreed agreed;
    pid_t pid;  /* 0: no process */
    int socket; /* -1: likewise */
    int64_t started_ns;
    pid_t left[LEFT_MAX]; /* killed, but held by the kernel: to be reaped once it lets them go */
    uint32_t buffer_count;
    int32_t stride_bytes;
    struct mapping mappings[FV_LIVE_BUFFERS_MAX];
    struct fv_libcamera_request request; /* options stay in it */
    struct fv_libcamera_event event;     /* the last that came */
    struct fv_libcamera_options asked;   /* by the address; those of the request are in force */
    struct fv_libcamera_frame early[FV_LIVE_BUFFERS_MAX]; /* came before an answer */
    uint32_t early_count;
};

static int64_t now_ns(void)
{
    return fv_clock_ns(CLOCK_MONOTONIC);
}

static struct timespec left_until(int64_t deadline_ns)
{
    const int64_t left_ns = deadline_ns - now_ns();
    return fv_clock_timespec(left_ns > 0 ? left_ns : 0);
}

/* ---- the process ----------------------------------------------------------------------------- */

static enum fovea_status start_process(struct fv_libcamera_client *client,
                                       struct fovea_error *error)
{
    static const struct fv_plugin_name name = {
        .scheme = "libcamera", .file = FV_LIBCAMERA_PROGRAM, .package = "libcamera-dev"};
    char path[FV_PLUGIN_PATH_BYTES];
    int place = 0, ends[2];
    while (place < FV_PLUGIN_PLACES && !fv_plugin_path(name.file, place, path))
        place++;
    if (place == FV_PLUGIN_PLACES) return fv_plugin_missing(&name, "", error);
    if (fv_plugin_trusted(path, error) != FOVEA_OK) return FOVEA_ERROR_UNSUPPORTED;
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: no socket: %s", client->uri,
                               strerror(errno));
    const int failure = fv_libcamera_spawn(path, ends[1], &client->pid);
    close(ends[1]);
    if (failure == 0) {
        client->socket = ends[0];
        client->started_ns = now_ns();
        return FOVEA_OK;
    }
    close(ends[0]);
    client->pid = 0;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: %.300s cannot be started: %s",
                           client->uri, path, strerror(failure));
}

/* Whether it has ended, waiting for that until the deadline; `how` as of waitpid, -1 where that is
 * not known.
 */
static bool has_ended(pid_t pid, int64_t deadline_ns, int *how)
{
    const struct timespec pause = {.tv_nsec = 1000000};
    *how = -1;
    for (;;) {
        const pid_t ended = waitpid(pid, how, WNOHANG);
        if (ended == pid || (ended < 0 && errno == ECHILD))
            return true; /* ours, or the application's to reap */
        if (now_ns() >= deadline_ns) return false;
        nanosleep(&pause, NULL);
    }
}

static void reap_left(struct fv_libcamera_client *client)
{
    int how;
    for (int i = 0; i < LEFT_MAX; i++)
        if (client->left[i] != 0 && has_ended(client->left[i], 0, &how)) client->left[i] = 0;
}

static void leave(struct fv_libcamera_client *client, pid_t pid)
{
    for (int i = 0; i < LEFT_MAX; i++) {
        if (client->left[i] != 0) continue;
        client->left[i] = pid;
        return;
    }
}

/* Let it end by itself for so long, then kill it. One that the kernel holds is left to it, and
 * reaped later. */
static int end_process(struct fv_libcamera_client *client, int64_t patience_ns)
{
    int how = -1;
    if (client->socket >= 0) close(client->socket);
    client->socket = -1;
    if (client->pid == 0) return how;
    if (!has_ended(client->pid, now_ns() + patience_ns, &how)) {
        kill(client->pid, SIGKILL);
        if (!has_ended(client->pid, now_ns() + fv_libcamera_patience_ns, &how))
            leave(client, client->pid);
    }
    client->pid = 0;
    return how;
}

/* It closed its end: it has ended, or is about to. */
static enum fovea_status died(struct fv_libcamera_client *client, struct fovea_error *error)
{
    const int how = end_process(client, fv_libcamera_patience_ns);
    char text[64] = "ended";
    if (how != -1 && WIFSIGNALED(how))
        snprintf(text, sizeof text, "was ended by signal %d (%s)", WTERMSIG(how),
                 strsignal(WTERMSIG(how)));
    else if (how != -1)
        snprintf(text, sizeof text, "ended with status %d", WEXITSTATUS(how));
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                           "%s: libcamera's process %s: another is started", client->uri, text);
}

/* ---- messages -------------------------------------------------------------------------------- */

static enum fovea_status no_sense(struct fv_libcamera_client *client, struct fovea_error *error)
{
    end_process(client, 0);
    return fovea_error_set(
        error, FOVEA_ERROR_SYSTEM,
        "%s: found a message of libcamera's process that makes no sense, expected one of version %d",
        client->uri, FV_LIBCAMERA_VERSION);
}

static enum fovea_status ask(struct fv_libcamera_client *client, uint32_t call,
                             struct fovea_error *error)
{
    client->request.version = FV_LIBCAMERA_VERSION;
    client->request.call = call;
    const size_t bytes = fv_libcamera_request_bytes(call);
    if (client->socket < 0) return died(client, error);
    if (send(client->socket, &client->request, bytes, MSG_NOSIGNAL | MSG_DONTWAIT) ==
        (ssize_t)bytes)
        return FOVEA_OK;
    if (errno != EAGAIN) return died(client, error);
    end_process(client, 0);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                           "%s: libcamera's process takes no more requests", client->uri);
}

/* Descriptors that came with a message, at most FV_LIVE_BUFFERS_MAX: how many. */
static uint32_t take_descriptors(struct msghdr *message, int descriptors[FV_LIVE_BUFFERS_MAX])
{
    struct cmsghdr *header = CMSG_FIRSTHDR(message);
    if (header == NULL || header->cmsg_level != SOL_SOCKET || header->cmsg_type != SCM_RIGHTS)
        return 0;
    const size_t bytes = header->cmsg_len - CMSG_LEN(0);
    memcpy(descriptors, CMSG_DATA(header), bytes);
    return (uint32_t)(bytes / sizeof(int));
}

static void close_all(const int *descriptors, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        close(descriptors[i]);
}

/* Another process made it: what is true or false is one of the two, and texts end. */
static bool is_well_formed(struct fv_libcamera_event *event)
{
    const bool *const flags[] = {&event->frame.damaged, &event->frame.stamp.clock_known,
                                 &event->frame.stamp.sequence_known};
    for (size_t i = 0; i < sizeof flags / sizeof flags[0]; i++) {
        uint8_t byte;
        memcpy(&byte, flags[i], sizeof byte);
        if (byte > 1) return false;
    }
    event->error.text[FOVEA_ERROR_TEXT_BYTES - 1] = '\0';
    event->notice.text[FOVEA_ERROR_TEXT_BYTES - 1] = '\0';
    event->agreed.id[FV_LIBCAMERA_ID_BYTES - 1] = '\0';
    return true;
}

/* The next message, if one is there, into `event`. FOVEA_AGAIN: none. `descriptors`: NULL where
 * none are expected. */
static enum fovea_status receive(struct fv_libcamera_client *client, int *descriptors,
                                 uint32_t *count, struct fovea_error *error)
{
    union {
        struct cmsghdr align;
        char space[CMSG_SPACE(sizeof(int) * FV_LIVE_BUFFERS_MAX)];
    } beside;
    int unexpected[FV_LIVE_BUFFERS_MAX];
    struct iovec piece = {.iov_base = &client->event, .iov_len = sizeof client->event};
    struct msghdr message = {.msg_iov = &piece,
                             .msg_iovlen = 1,
                             .msg_control = beside.space,
                             .msg_controllen = sizeof beside.space};
    if (client->socket < 0) return died(client, error);
    const ssize_t bytes = recvmsg(client->socket, &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
    if (bytes < 0 && (errno == EAGAIN || errno == EINTR)) return FOVEA_AGAIN;
    if (bytes <= 0) return died(client, error);
    const uint32_t came =
        take_descriptors(&message, descriptors != NULL ? descriptors : unexpected);
    if (descriptors == NULL) close_all(unexpected, came);
    if (count != NULL) *count = came;
    struct fv_libcamera_event *event = &client->event;
    if ((size_t)bytes >= offsetof(struct fv_libcamera_event, frame) &&
        event->version == FV_LIBCAMERA_VERSION &&
        (size_t)bytes == fv_libcamera_event_bytes(event->kind) && is_well_formed(event))
        return FOVEA_OK;
    if (descriptors != NULL) close_all(descriptors, came);
    if (count != NULL) *count = 0;
    return no_sense(client, error);
}

static bool can_be_read(int fd)
{
    struct pollfd one = {.fd = fd, .events = POLLIN};
    return poll(&one, 1, 0) > 0;
}

/* What a process has worked, and since when no more. */
struct work {
    int64_t cpu_ns, since_ns;
};

static bool stands_still(pid_t pid, struct work *work)
{
    clockid_t clock;
    struct timespec cpu;
    if (clock_getcpuclockid(pid, &clock) != 0 || clock_gettime(clock, &cpu) != 0) return false;
    const int64_t cpu_ns = fv_clock_from_timespec(cpu);
    if (cpu_ns != work->cpu_ns) *work = (struct work){cpu_ns, now_ns()};
    return now_ns() - work->since_ns >= fv_libcamera_idle_ns;
}

/* Until there is a message, the source is stopped, or it is time to look whether the process still
 * works. */
static void wait_for_message(const struct fv_libcamera_client *client, int quit_fd,
                             int64_t deadline_ns)
{
    struct pollfd fds[2] = {{.fd = client->socket, .events = POLLIN},
                            {.fd = quit_fd, .events = POLLIN}};
    const int64_t look_ns = now_ns() + fv_libcamera_idle_ns / 8;
    const struct timespec left = left_until(look_ns < deadline_ns ? look_ns : deadline_ns);
    ppoll(fds, 2, &left, NULL);
}

/* A frame that came before an answer is for the next `take`. */
static void keep_frame(struct fv_libcamera_client *client)
{
    if (client->event.kind == FV_LIBCAMERA_FRAME && client->early_count < FV_LIVE_BUFFERS_MAX)
        client->early[client->early_count++] = client->event.frame;
}

/* Until the answer, past frames from before. `quit_fd`: -1 while opening. */
static enum fovea_status await_answer(struct fv_libcamera_client *client, int quit_fd,
                                      int *descriptors, uint32_t *count, struct fovea_error *error)
{
    const int64_t deadline_ns = now_ns() + fv_libcamera_answer_ns;
    struct work work = {-1, now_ns()};
    for (;;) {
        enum fovea_status status = receive(client, descriptors, count, error);
        if (status == FOVEA_OK && client->event.kind == FV_LIBCAMERA_ANSWER) break;
        if (status == FOVEA_OK && descriptors != NULL) {
            close_all(descriptors, *count);
            *count = 0;
        }
        if (status == FOVEA_OK) keep_frame(client);
        if (status == FOVEA_OK && client->event.kind == FV_LIBCAMERA_BROKEN) {
            end_process(client, 0); /* which `take` finds out */
            break;
        }
        if (status != FOVEA_OK && status != FOVEA_AGAIN) return status;
        const bool over = can_be_read(quit_fd);
        if (over || now_ns() >= deadline_ns || stands_still(client->pid, &work)) {
            end_process(client, 0);
            return fovea_error_set(
                error, FOVEA_ERROR_SYSTEM, "%s: %s: its process was killed", client->uri,
                over ? "stopped while libcamera was asked" : "libcamera does not answer");
        }
        if (status == FOVEA_AGAIN) wait_for_message(client, quit_fd, deadline_ns);
    }
    if (client->event.error.text[0] != '\0' && error != NULL) *error = client->event.error;
    return client->event.error.status;
}

/* ---- buffers --------------------------------------------------------------------------------- */

static void unmap(struct fv_libcamera_client *client)
{
    for (uint32_t i = 0; i < client->buffer_count; i++) {
        munmap(client->mappings[i].memory, client->mappings[i].bytes);
        close(client->mappings[i].fd);
    }
    client->buffer_count = 0;
}

/* Takes the descriptors. */
static enum fovea_status map(struct fv_libcamera_client *client, const int *descriptors,
                             uint32_t count, struct fovea_error *error)
{
    const struct fv_libcamera_event *event = &client->event;
    bool right = count == event->buffer_count && count == client->agreed.buffers;
    for (uint32_t i = 0; i < count && right; i++)
        right = event->buffers[i].offset < event->buffers[i].bytes;
    if (!right) {
        close_all(descriptors, count);
        return no_sense(client, error);
    }
    client->stride_bytes = event->stride_bytes;
    for (uint32_t i = 0; i < count; i++) {
        struct mapping *mapping = &client->mappings[i];
        mapping->bytes = event->buffers[i].bytes;
        mapping->offset = event->buffers[i].offset;
        mapping->fd = descriptors[i];
        mapping->memory = mmap(NULL, mapping->bytes, PROT_READ, MAP_SHARED, mapping->fd, 0);
        if (mapping->memory == MAP_FAILED) {
            fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: mapping a buffer: %s", client->uri,
                            strerror(errno));
            close_all(descriptors + i, count - i);
            unmap(client);
            return FOVEA_ERROR_SYSTEM;
        }
        client->buffer_count = i + 1;
    }
    return FOVEA_OK;
}

/* Where a device writes past the processor's caches, reading is begun and ended with the kernel's
 * leave; memory that needs none refuses the call. */
static void let_read(const struct mapping *mapping, uint64_t when)
{
    const struct dma_buf_sync sync = {.flags = when | DMA_BUF_SYNC_READ};
    while (ioctl(mapping->fd, DMA_BUF_IOCTL_SYNC, &sync) < 0 &&
           (errno == EINTR || errno == EAGAIN)) {
    }
}

/* ---- the device ------------------------------------------------------------------------------ */

static enum fovea_status find(void *of, int quit_fd, struct fovea_error *error)
{
    struct fv_libcamera_client *client = of;
    enum fovea_status status = FOVEA_OK;
    reap_left(client);
    if (client->socket < 0) {
        status = start_process(client, error);
        client->request.agreed = client->agreed;
        if (status == FOVEA_OK) status = ask(client, FV_LIBCAMERA_KNOW, error);
    }
    if (status == FOVEA_OK) status = ask(client, FV_LIBCAMERA_FIND, error);
    if (status == FOVEA_OK) status = await_answer(client, quit_fd, NULL, NULL, error);
    /* libcamera looks around when it starts, and then believes the kernel's events: a camera that
     * came when it was not listening stays away for it. */
    if (status == FOVEA_GONE && now_ns() - client->started_ns > fv_libcamera_away_ns)
        end_process(client, 0);
    return status;
}

static enum fovea_status set_up(void *of, int quit_fd, struct fovea_error *error)
{
    struct fv_libcamera_client *client = of;
    int descriptors[FV_LIVE_BUFFERS_MAX];
    uint32_t count = 0;
    enum fovea_status status = ask(client, FV_LIBCAMERA_SET_UP, error);
    if (status == FOVEA_OK) status = await_answer(client, quit_fd, descriptors, &count, error);
    client->early_count = 0;
    if (status == FOVEA_OK)
        status = map(client, descriptors, count, error);
    else
        close_all(descriptors, count);
    if (status != FOVEA_OK) end_process(client, 0);
    return status;
}

static void tear_down(void *of)
{
    struct fv_libcamera_client *client = of;
    client->early_count = 0;
    unmap(client);
    end_process(client, fv_libcamera_patience_ns);
}

static enum fovea_status use_frame(struct fv_libcamera_client *client,
                                   const struct fv_libcamera_frame *frame,
                                   struct fv_live_buffer *buffer, struct fovea_error *error)
{
    if (frame->index >= client->buffer_count) return no_sense(client, error);
    const struct mapping *mapping = &client->mappings[frame->index];
    const size_t room = mapping->bytes - mapping->offset;
    let_read(mapping, DMA_BUF_SYNC_START);
    buffer->index = frame->index;
    buffer->data = mapping->memory + mapping->offset;
    buffer->bytes = frame->bytes < room ? (size_t)frame->bytes : room;
    buffer->stride_bytes = client->stride_bytes;
    buffer->damaged = frame->damaged;
    buffer->stamp = frame->stamp;
    return FOVEA_OK;
}

static enum fovea_status use_event(struct fv_libcamera_client *client,
                                   struct fv_live_buffer *buffer, struct fovea_error *error)
{
    const struct fv_libcamera_event *event = &client->event;
    if (event->kind == FV_LIBCAMERA_BROKEN) {
        *error = event->error;
        if (event->error.status == FOVEA_GONE) end_process(client, 0);
        return event->error.status == FOVEA_GONE ? FOVEA_GONE : FOVEA_ERROR_SYSTEM;
    }
    if (event->kind != FV_LIBCAMERA_FRAME) return no_sense(client, error);
    return use_frame(client, &event->frame, buffer, error);
}

static bool take_early(struct fv_libcamera_client *client, struct fv_libcamera_frame *frame)
{
    if (client->early_count == 0) return false;
    *frame = client->early[0];
    client->early_count--;
    memmove(client->early, client->early + 1, client->early_count * sizeof *client->early);
    return true;
}

static enum fovea_status take(void *of, int64_t deadline_ns, int wake_fd,
                              struct fv_live_buffer *buffer, struct fovea_error *error)
{
    struct fv_libcamera_client *client = of;
    struct fv_libcamera_frame early;
    reap_left(client);
    if (take_early(client, &early)) return use_frame(client, &early, buffer, error);
    enum fovea_status status = receive(client, NULL, NULL, error);
    if (status == FOVEA_AGAIN) {
        struct pollfd fds[2] = {{.fd = wake_fd, .events = POLLIN},
                                {.fd = client->socket, .events = POLLIN}};
        const struct timespec left = left_until(deadline_ns);
        ppoll(fds, 2, &left, NULL);
        status = receive(client, NULL, NULL, error);
    }
    return status == FOVEA_OK ? use_event(client, buffer, error) : status;
}

static enum fovea_status give(void *of, uint32_t index, struct fovea_error *error)
{
    struct fv_libcamera_client *client = of;
    let_read(&client->mappings[index], DMA_BUF_SYNC_END);
    client->request.index = index;
    return ask(client, FV_LIBCAMERA_GIVE, error);
}

/* Options with one control changed; without a number, as the address has it, else automatic. */
static void change_options(struct fv_libcamera_options *options,
                           const struct fv_libcamera_options *asked,
                           enum fovea_source_control control, double value)
{
    if (control == FOVEA_SOURCE_EXPOSURE) {
        const bool given = value > 0, said = asked->exposure_ms > 0 || asked->auto_exposure_given;
        options->exposure_ms = given ? value : asked->exposure_ms;
        options->auto_exposure = !given && (!said || asked->auto_exposure);
        options->auto_exposure_given = true;
    } else {
        const bool given = value >= 0, said = asked->gain >= 0 || asked->auto_gain_given;
        options->gain = given ? value : asked->gain;
        options->auto_gain = !given && (!said || asked->auto_gain);
        options->auto_gain_given = true;
    }
}

static enum fovea_status change(void *of, enum fovea_source_control control, double value,
                                int quit_fd, struct fovea_error *error)
{
    struct fv_libcamera_client *client = of;
    const struct fv_libcamera_options before = client->request.options;
    change_options(&client->request.options, &client->asked, control, value);
    enum fovea_status status = ask(client, FV_LIBCAMERA_CONTROL, error);
    if (status == FOVEA_OK) status = await_answer(client, quit_fd, NULL, NULL, error);
    if (status != FOVEA_OK) client->request.options = before;
    return status;
}

static void close_client(void *of)
{
    struct fv_libcamera_client *client = of;
    tear_down(client);
    reap_left(client);
    free(client);
}

const struct fv_live_ops fv_libcamera_live = {
    .find = find,
    .set_up = set_up,
    .tear_down = tear_down,
    .take = take,
    .give = give,
    .control = change,
    .close = close_client,
};

/* ---- opening --------------------------------------------------------------------------------- */

size_t fv_libcamera_heap_bytes(void)
{
    return sizeof(struct fv_libcamera_client);
}

/* By a process just started. `lost`: that was, but came to grief over it. */
static enum fovea_status learn(struct fv_libcamera_client *client, bool *lost,
                               struct fovea_error *error)
{
    enum fovea_status status = start_process(client, error);
    *lost = false;
    if (status != FOVEA_OK) return status;
    status = ask(client, FV_LIBCAMERA_LEARN, error);
    if (status == FOVEA_OK) status = await_answer(client, -1, NULL, NULL, error);
    *lost = client->socket < 0;
    return status;
}

enum fovea_status fv_libcamera_open(const struct fv_libcamera_options *options,
                                    struct fv_libcamera_client **out,
                                    struct fv_libcamera_agreed *agreed, struct fovea_error *notice,
                                    struct fovea_error *error)
{
    struct fv_libcamera_client *client = calloc(1, sizeof *client);
    if (client == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "libcamera: out of memory");
    client->socket = -1;
    client->request.options = client->asked = *options;
    snprintf(client->uri, sizeof client->uri, "libcamera:%s", options->id);
    bool lost;
    struct fovea_error grief = {.text = ""}, unused;
    if (error == NULL) error = &unused;
    enum fovea_status status = learn(client, &lost, error);
    if (lost) { /* one fault of libcamera's, as while streaming: another process may do */
        grief = *error;
        status = learn(client, &lost, error);
    }
    if (status != FOVEA_OK) {
        close_client(client);
        return status > 0 ? FOVEA_ERROR_SYSTEM : status;
    }
    client->agreed = *agreed = client->event.agreed;
    *notice = client->event.notice;
    if (grief.text[0] != '\0')
        fovea_error_set(notice, FOVEA_OK, "%.256s%s%.200s", grief.text,
                        notice->text[0] != '\0' ? "; " : "", client->event.notice.text);
    snprintf(client->uri, sizeof client->uri, "libcamera:%s", agreed->id);
    *out = client;
    return FOVEA_OK;
}
