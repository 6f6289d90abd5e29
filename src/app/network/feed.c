#include "app/network/feed.h"

#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "app/network/feed_layout.h"
#include "drivers/clock.h"
#include "drivers/thread.h"
#include "support/image_pack.h"
#include "support/say.h"

#ifndef F_SEAL_FUTURE_WRITE
#define F_SEAL_FUTURE_WRITE 0x0010
#endif

_Static_assert(sizeof(struct fv_feed_record) <= FV_FEED_RECORD_UNIT, "room for a filler");
_Static_assert(sizeof(struct fv_feed_header) <= FV_FEED_HEADER_BYTES, "one page");
_Static_assert(FV_FEED_RING_BYTES % FV_FEED_RECORD_UNIT == 0, "records end with the ring");

struct fv_feed {
    struct fv_feed_header *header; /* the memory */
    uint8_t *ring, *slots;
    size_t bytes, frame_bytes;
    uint64_t number, frames; /* of records; of frames: the loop's */
    int64_t frame_ns;        /* when the last was copied */
    struct fovea_message repeated;
    int64_t repeated_ns;
    uint32_t repeated_to; /* readers */
    uint32_t rate_max;    /* frames in 1,000 seconds */
    atomic_uint readers;
    _Atomic int64_t period_ns; /* between frames that are wished for; 0: none */

    int memory, socket, wake;
    struct sockaddr_un address;
    struct stat made; /* the socket's file */
    struct reader {
        int socket;
        uint32_t wish;
        uint8_t part[sizeof(struct fv_feed_wish)];
        size_t got;
    } list[FV_FEED_READERS_MAX];
    uint32_t count;
    pthread_t thread;
    bool running;
};

/* ---- the loop's side ------------------------------------------------------------------------- */

static uint64_t whole_units(uint64_t bytes)
{
    return (bytes + FV_FEED_RECORD_UNIT - 1) / FV_FEED_RECORD_UNIT * FV_FEED_RECORD_UNIT;
}

/* A record of `size` bytes at `at`, which is announced before anything of it is overwritten. */
static uint8_t *begin(struct fv_feed *feed, uint64_t at, uint64_t size)
{
    atomic_store_explicit(&feed->header->begun, at + size, memory_order_relaxed);
    fv_feed_fence();
    return feed->ring + at % FV_FEED_RING_BYTES;
}

void fv_feed_put(struct fv_feed *feed, const struct fovea_message *message)
{
    if (feed == NULL || atomic_load_explicit(&feed->readers, memory_order_relaxed) == 0) return;
    const uint64_t size =
        whole_units(sizeof(struct fv_feed_record) + message->bytes + sizeof(uint64_t));
    uint64_t at = atomic_load_explicit(&feed->header->written, memory_order_relaxed);
    const uint64_t left = FV_FEED_RING_BYTES - at % FV_FEED_RING_BYTES;
    if (size > FV_FEED_RING_BYTES / 4) return; /* no message is as long */
    if (size > left) {
        const struct fv_feed_record filler = {.size = (uint32_t)left};
        memcpy(begin(feed, at, left), &filler, sizeof filler);
        at += left;
        atomic_store_explicit(&feed->header->written, at, memory_order_release);
    }
    struct fv_feed_record record = {
        .number = ++feed->number, .size = (uint32_t)size, .bytes = message->bytes};
    memcpy(record.channel, message->channel,
           strnlen(message->channel, sizeof record.channel - 1)); /* the rest is 0 */
    uint8_t *to = begin(feed, at, size);
    memcpy(to, &record, sizeof record);
    memcpy(to + sizeof record, message->data, message->bytes);
    memcpy(to + size - sizeof record.number, &record.number, sizeof record.number);
    atomic_store_explicit(&feed->header->written, at + size, memory_order_release);
}

void fv_feed_repeat(struct fv_feed *feed, const struct fovea_message *message)
{
    if (feed != NULL) feed->repeated = *message;
}

static void repeat(struct fv_feed *feed)
{
    const uint32_t readers = atomic_load_explicit(&feed->readers, memory_order_relaxed);
    const bool newer = readers > feed->repeated_to;
    feed->repeated_to = readers;
    if (readers == 0 || feed->repeated.data == NULL) return;
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    if (!newer && now_ns - feed->repeated_ns < FV_SECOND_NS) return;
    feed->repeated_ns = now_ns;
    fv_feed_put(feed, &feed->repeated);
}

void fv_feed_publish(struct fv_feed *feed, const struct fovea_outputs *outputs)
{
    if (feed == NULL) return;
    repeat(feed);
    for (uint32_t i = 0; i < outputs->message_count; i++)
        fv_feed_put(feed, &outputs->messages[i]);
}

static void images_copy(struct fv_feed *feed, uint8_t *data, const struct fovea_frame *frame,
                        struct fv_feed_frame *head)
{
    uint64_t used = 0;
    for (uint32_t i = 0; i < frame->image_count && i < FOVEA_CAMERAS_MAX; i++) {
        const struct fovea_image *image = &frame->images[i];
        if (image->data == NULL || fv_image_packed_bytes(image) > feed->frame_bytes - used)
            continue;
        const struct fovea_image packed = fv_image_pack(image, data + used);
        head->images[i] =
            (struct fv_feed_image){packed.width,           packed.height, packed.stride_bytes,
                                   (int32_t)packed.format, used,          packed.size_bytes};
        used += packed.size_bytes;
    }
}

void fv_feed_frame(struct fv_feed *feed, const struct fovea_frame *frame)
{
    if (feed == NULL || frame == NULL) return;
    const int64_t period_ns = atomic_load_explicit(&feed->period_ns, memory_order_relaxed);
    if (period_ns == 0) return;
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    /* On a grid of the period, which a frame may be ahead of by a fourth: frames that come at that
     * very rate come a little early and late. The grid goes on by a period with each. */
    if (feed->frames > 0 && now_ns - feed->frame_ns < period_ns - period_ns / 4) return;
    const int64_t due_ns = feed->frame_ns + period_ns;
    feed->frame_ns = feed->frames > 0 && now_ns - due_ns < period_ns ? due_ns : now_ns;
    const uint64_t number = ++feed->frames;
    uint8_t *at = feed->slots + (number - 1) % FV_FEED_FRAMES * feed->header->slot_bytes;
    struct fv_feed_slot *slot = (struct fv_feed_slot *)(void *)at;
    struct fv_feed_frame head = {.stamp_ns = frame->stamp_ns,
                                 .sequence = (int64_t)frame->sequence,
                                 .clock = (int32_t)frame->clock,
                                 .image_count = frame->image_count};
    atomic_store_explicit(&slot->begun, number, memory_order_relaxed);
    fv_feed_fence();
    images_copy(feed, at + sizeof *slot, frame, &head);
    slot->frame = head;
    atomic_store_explicit(&slot->whole, number, memory_order_release);
    atomic_store_explicit(&feed->header->frames, number, memory_order_release);
}

/* ---- the thread ------------------------------------------------------------------------------ */

/* What all readers wish for, as far as it is allowed. */
static void wishes_add(struct fv_feed *feed)
{
    uint32_t most = 0;
    for (uint32_t i = 0; i < feed->count; i++)
        most = feed->list[i].wish > most ? feed->list[i].wish : most;
    if (most > feed->rate_max) most = feed->rate_max;
    atomic_store(&feed->period_ns, most > 0 ? 1000 * FV_SECOND_NS / most : 0);
    atomic_store(&feed->readers, feed->count);
}

static bool hand_out(const struct fv_feed *feed, int to)
{
    uint8_t byte = 0;
    union {
        struct cmsghdr head;
        uint8_t room[CMSG_SPACE(sizeof(int))];
    } control = {0};
    struct iovec data = {&byte, 1};
    const struct msghdr message = {.msg_iov = &data,
                                   .msg_iovlen = 1,
                                   .msg_control = &control,
                                   .msg_controllen = sizeof control};
    struct cmsghdr *head = CMSG_FIRSTHDR(&message);
    head->cmsg_level = SOL_SOCKET;
    head->cmsg_type = SCM_RIGHTS;
    head->cmsg_len = CMSG_LEN(sizeof(int));
    memcpy(CMSG_DATA(head), &feed->memory, sizeof(int));
    return sendmsg(to, &message, MSG_NOSIGNAL | MSG_DONTWAIT) == 1;
}

static void reader_accept(struct fv_feed *feed)
{
    const int socket = accept4(feed->socket, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (socket < 0) { /* without a descriptor for it, it stays ready: look again a little later */
        const struct timespec later = {.tv_nsec = 100000000};
        if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM)
            nanosleep(&later, NULL);
        return;
    }
    if (feed->count == FV_FEED_READERS_MAX || !hand_out(feed, socket)) {
        close(socket);
        return;
    }
    feed->list[feed->count++] = (struct reader){.socket = socket};
}

/* Take what a reader sends; false: it is gone. */
static bool reader_hear(struct reader *reader)
{
    const ssize_t got =
        recv(reader->socket, reader->part + reader->got, sizeof reader->part - reader->got, 0);
    if (got < 0) return errno == EAGAIN || errno == EINTR;
    if (got == 0) return false;
    reader->got += (size_t)got;
    if (reader->got == sizeof reader->part) {
        struct fv_feed_wish wish;
        memcpy(&wish, reader->part, sizeof wish);
        reader->wish = wish.frames_per_1000_s;
        reader->got = 0;
    }
    return true;
}

static void *serve(void *context)
{
    struct fv_feed *feed = context;
    for (;;) {
        struct pollfd polled[FV_FEED_READERS_MAX + 2] = {{feed->wake, POLLIN, 0},
                                                         {feed->socket, POLLIN, 0}};
        for (uint32_t i = 0; i < feed->count; i++)
            polled[i + 2] = (struct pollfd){feed->list[i].socket, POLLIN, 0};
        if (poll(polled, feed->count + 2, -1) < 0 && errno != EINTR) break;
        if (polled[0].revents != 0) break;
        for (uint32_t i = feed->count; i-- > 0;)
            if (polled[i + 2].revents != 0 && !reader_hear(&feed->list[i])) {
                close(feed->list[i].socket);
                feed->list[i] = feed->list[--feed->count];
            }
        if (polled[1].revents != 0) reader_accept(feed);
        wishes_add(feed);
    }
    return NULL;
}

/* ---- opening and closing --------------------------------------------------------------------- */

/* A socket that nobody listens on any more. */
static bool is_left_behind(const struct sockaddr_un *address)
{
    struct stat there;
    if (lstat(address->sun_path, &there) != 0 || !S_ISSOCK(there.st_mode)) return false;
    const int asking = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (asking < 0) return false;
    const bool refused = connect(asking, (const struct sockaddr *)address, sizeof *address) != 0 &&
                         errno == ECONNREFUSED;
    close(asking);
    return refused;
}

/* Give the socket, which listens as `made`, its name, if nothing else has it. */
static bool socket_name(const struct fv_feed *feed, const char *made)
{
    const char *path = feed->address.sun_path;
    bool named = link(made, path) == 0;
    if (!named && errno == EEXIST && is_left_behind(&feed->address) && unlink(path) == 0)
        named = link(made, path) == 0;
    const int reason = errno;
    unlink(made);
    errno = reason;
    return named;
}

/* Of the group `fovea`, where there is one. */
static void group_give(const char *path)
{
    struct stat made;
    const struct group *group = getgrnam("fovea");
    if (group == NULL || (lstat(path, &made) == 0 && made.st_gid == group->gr_gid)) return;
    if (chown(path, (uid_t)-1, group->gr_gid) != 0)
        fv_say("%s: the group fovea may not read it: %s", path, strerror(errno));
}

/* Under a name of its own until it listens and is the group's. */
static enum fovea_status socket_open(struct fv_feed *feed, const char *path,
                                     struct fovea_error *error)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (strlen(path) > FV_FEED_PATH_BYTES)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "web.socket: found %zu bytes, expected a path of at most %d",
                               strlen(path), FV_FEED_PATH_BYTES);
    feed->address.sun_family = AF_UNIX;
    snprintf(feed->address.sun_path, sizeof feed->address.sun_path, "%s", path);
    snprintf(address.sun_path, sizeof address.sun_path, "%s.%ld", path, (long)getpid());
    feed->socket = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    unlink(address.sun_path); /* ours by its number: a run with the same one left it behind */
    const mode_t mask = umask(0177);
    const bool bound = bind(feed->socket, (struct sockaddr *)&address, sizeof address) == 0;
    umask(mask);
    if (bound) group_give(address.sun_path);
    const bool listens =
        bound && chmod(address.sun_path, 0660) == 0 && listen(feed->socket, 8) == 0;
    if (bound && !listens) {
        const int reason = errno;
        unlink(address.sun_path);
        errno = reason;
    }
    if (!listens || !socket_name(feed, address.sun_path))
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "web.socket: %s cannot be made: %s", path,
                               errno == EEXIST ? "found a file, or the socket of another run"
                                               : strerror(errno));
    if (lstat(path, &feed->made) == 0) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "web.socket: %s: %s", path, strerror(errno));
}

/* Whether it is mapped, and every page of it there: the loop must not wait for one. */
static bool memory_open(struct fv_feed *feed, const struct fv_feed_setup *setup)
{
    const uint64_t slot = (sizeof(struct fv_feed_slot) + setup->frame_bytes + 63) / 64 * 64;
    const int seals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL;
    feed->frame_bytes = setup->frame_bytes;
    feed->bytes = FV_FEED_HEADER_BYTES + FV_FEED_RING_BYTES + FV_FEED_FRAMES * slot;
    feed->memory = memfd_create("fovea-feed", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    if (feed->memory < 0 || ftruncate(feed->memory, (off_t)feed->bytes) != 0) return false;
    void *memory =
        mmap(NULL, feed->bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, feed->memory, 0);
    if (memory == MAP_FAILED) return false;
    feed->header = memory;
    feed->ring = (uint8_t *)memory + FV_FEED_HEADER_BYTES;
    feed->slots = feed->ring + FV_FEED_RING_BYTES;
    feed->header->magic = FV_FEED_MAGIC;
    feed->header->bytes = feed->bytes;
    feed->header->ring_bytes = FV_FEED_RING_BYTES;
    feed->header->slot_bytes = slot;
    feed->header->run_id = setup->run_id;
    snprintf(feed->header->prefix, sizeof feed->header->prefix, "%s", setup->prefix);
    return fcntl(feed->memory, F_ADD_SEALS, seals) == 0;
}

enum fovea_status fv_feed_open(const struct fv_feed_setup *setup, struct fv_feed **feed,
                               struct fovea_error *error)
{
    *feed = NULL;
    if (setup->path[0] == '\0') return FOVEA_OK;
    struct fv_feed *made = calloc(1, sizeof *made);
    if (made == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for the feed");
    made->memory = made->socket = -1;
    made->wake = eventfd(0, EFD_CLOEXEC);
    made->rate_max = setup->picture_rate_hz * 1000;
    enum fovea_status status = FOVEA_OK;
    if (made->wake < 0 || !memory_open(made, setup))
        status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "web.socket: no shared memory: %s",
                                 strerror(errno));
    if (status == FOVEA_OK) status = socket_open(made, setup->path, error);
    if (status == FOVEA_OK) {
        const int failed = fv_thread_start(&made->thread, serve, made);
        made->running = failed == 0;
        if (failed != 0)
            status = fovea_error_set(error, FOVEA_ERROR_SYSTEM, "web.socket: no thread: %s",
                                     strerror(failed));
    }
    if (status == FOVEA_OK)
        *feed = made;
    else
        fv_feed_close(made);
    return status;
}

void fv_feed_close(struct fv_feed *feed)
{
    struct stat there;
    if (feed == NULL) return;
    if (feed->running) {
        const uint64_t one = 1;
        if (write(feed->wake, &one, sizeof one) != (ssize_t)sizeof one) abort();
        pthread_join(feed->thread, NULL);
    }
    for (uint32_t i = 0; i < feed->count; i++)
        close(feed->list[i].socket);
    /* Another run may have made one in its place. */
    if (feed->made.st_ino != 0 && lstat(feed->address.sun_path, &there) == 0 &&
        there.st_ino == feed->made.st_ino && there.st_dev == feed->made.st_dev)
        unlink(feed->address.sun_path);
    if (feed->header != NULL) munmap(feed->header, feed->bytes);
    if (feed->memory >= 0) close(feed->memory);
    if (feed->socket >= 0) close(feed->socket);
    if (feed->wake >= 0) close(feed->wake);
    free(feed);
}
