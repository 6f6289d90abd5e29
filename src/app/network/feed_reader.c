#include "app/network/feed_reader.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

enum { FEED_BYTES_MAX = 1 << 30, MESSAGE_BYTES_MAX = FV_FEED_RING_BYTES / 4, SKIPS_MAX = 8 };

struct fv_feed_reader {
    int socket;
    const struct fv_feed_header *header;
    const uint8_t *ring, *slots;
    size_t bytes;
    uint64_t slot_bytes; /* of the header, read once and checked */
    uint64_t at, number, missed, frame;
    uint8_t *message, *images; /* copies */
};

/* ---- opening --------------------------------------------------------------------------------- */

/* The descriptor that the run hands out; -1: none. */
static int memory_receive(int socket)
{
    uint8_t byte;
    int memory = -1;
    union {
        struct cmsghdr head;
        uint8_t room[CMSG_SPACE(sizeof(int))];
    } control;
    struct iovec data = {&byte, 1};
    struct msghdr message = {.msg_iov = &data,
                             .msg_iovlen = 1,
                             .msg_control = &control,
                             .msg_controllen = sizeof control};
    if (recvmsg(socket, &message, MSG_CMSG_CLOEXEC) != 1) return -1;
    const struct cmsghdr *head = CMSG_FIRSTHDR(&message);
    if (head == NULL || head->cmsg_level != SOL_SOCKET || head->cmsg_type != SCM_RIGHTS ||
        head->cmsg_len < CMSG_LEN(sizeof(int)))
        return -1;
    const size_t count = (head->cmsg_len - CMSG_LEN(0)) / sizeof(int);
    for (size_t i = 0; i < count; i++) { /* more than one is no feed: none of them is kept */
        memcpy(&memory, CMSG_DATA(head) + i * sizeof memory, sizeof memory);
        if (count > 1) close(memory);
    }
    return count == 1 ? memory : -1;
}

/* Whether the lengths are those of a feed. The size cannot change: it is sealed. */
static bool is_feed(struct fv_feed_reader *reader)
{
    const struct fv_feed_header *header = reader->header;
    reader->slot_bytes = header->slot_bytes;
    return header->magic == FV_FEED_MAGIC && header->bytes == reader->bytes &&
           header->ring_bytes == FV_FEED_RING_BYTES && reader->slot_bytes % 64 == 0 &&
           reader->slot_bytes >= sizeof(struct fv_feed_slot) &&
           reader->slot_bytes <= FEED_BYTES_MAX &&
           FV_FEED_HEADER_BYTES + FV_FEED_RING_BYTES + FV_FEED_FRAMES * reader->slot_bytes ==
               reader->bytes;
}

static bool memory_map(struct fv_feed_reader *reader, int memory)
{
    struct stat size;
    const int seals = fcntl(memory, F_GET_SEALS);
    if (seals < 0 || !(seals & F_SEAL_SHRINK) || fstat(memory, &size) != 0 ||
        size.st_size < FV_FEED_HEADER_BYTES + FV_FEED_RING_BYTES || size.st_size > FEED_BYTES_MAX)
        return false;
    void *mapped = mmap(NULL, (size_t)size.st_size, PROT_READ, MAP_SHARED, memory, 0);
    if (mapped == MAP_FAILED) return false;
    reader->bytes = (size_t)size.st_size;
    reader->header = mapped;
    reader->ring = (const uint8_t *)mapped + FV_FEED_HEADER_BYTES;
    reader->slots = reader->ring + FV_FEED_RING_BYTES;
    if (!is_feed(reader)) return false;
    reader->message = malloc(MESSAGE_BYTES_MAX);
    reader->images = malloc((size_t)reader->slot_bytes);
    reader->at = atomic_load_explicit(&reader->header->written, memory_order_acquire);
    reader->frame = atomic_load_explicit(&reader->header->frames, memory_order_acquire);
    return reader->message != NULL && reader->images != NULL;
}

static enum fovea_status connect_to(struct fv_feed_reader *reader, const char *path,
                                    struct fovea_error *error)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const struct timeval patience = {2, 0};
    if (strlen(path) >= sizeof address.sun_path)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found a socket of %zu bytes, expected a path of at most %zu",
                               strlen(path), sizeof address.sun_path - 1);
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    reader->socket = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (reader->socket < 0 ||
        setsockopt(reader->socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience) != 0 ||
        setsockopt(reader->socket, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience) != 0 ||
        connect(reader->socket, (const struct sockaddr *)&address, sizeof address) != 0)
        return fovea_error_set(
            error, FOVEA_ERROR_SYSTEM,
            errno == EACCES
                ? "%s: found the feed of a run, but no right to read it (group fovea): %s"
                : "%s: found no run that offers its feed there (web.socket): %s",
            path, strerror(errno));
    return FOVEA_OK;
}

enum fovea_status fv_feed_reader_open(const char *path, uint32_t frames_per_1000_s,
                                      struct fv_feed_reader **reader, struct fovea_error *error)
{
    *reader = NULL;
    struct fv_feed_reader *made = calloc(1, sizeof *made);
    if (made == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for the feed");
    made->socket = -1;
    enum fovea_status status = connect_to(made, path, error);
    if (status == FOVEA_OK) {
        const int memory = memory_receive(made->socket);
        const bool mapped = memory >= 0 && memory_map(made, memory);
        if (memory >= 0) close(memory);
        if (!mapped || !fv_feed_reader_wish(made, frames_per_1000_s))
            status = fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                                     "%s: found no feed behind the socket, expected that of a run "
                                     "with fewer than 16 readers and of this version",
                                     path);
    }
    if (status == FOVEA_OK)
        *reader = made;
    else
        fv_feed_reader_close(made);
    return status;
}

void fv_feed_reader_close(struct fv_feed_reader *reader)
{
    if (reader == NULL) return;
    if (reader->header != NULL) munmap((void *)(uintptr_t)reader->header, reader->bytes);
    if (reader->socket >= 0) close(reader->socket);
    free(reader->message);
    free(reader->images);
    free(reader);
}

void fv_feed_reader_prefix(const struct fv_feed_reader *reader, char *prefix)
{
    memcpy(prefix, reader->header->prefix, FV_MESSAGE_CHANNEL_BYTES - 1);
    prefix[FV_MESSAGE_CHANNEL_BYTES - 1] = '\0';
}

int64_t fv_feed_reader_run(const struct fv_feed_reader *reader)
{
    return reader->header->run_id;
}

bool fv_feed_reader_wish(struct fv_feed_reader *reader, uint32_t frames_per_1000_s)
{
    const struct fv_feed_wish wish = {frames_per_1000_s};
    return send(reader->socket, &wish, sizeof wish, MSG_NOSIGNAL | MSG_DONTWAIT) == sizeof wish;
}

/* ---- reading --------------------------------------------------------------------------------- */

static bool run_ended(const struct fv_feed_reader *reader)
{
    struct pollfd polled = {reader->socket, POLLIN, 0};
    return poll(&polled, 1, 0) > 0;
}

/* Whether what was copied from `at` on was whole: nothing of it had begun to be overwritten. */
static bool is_kept(const struct fv_feed_reader *reader, uint64_t at)
{
    fv_feed_fence();
    return atomic_load_explicit(&reader->header->begun, memory_order_relaxed) - at <=
           FV_FEED_RING_BYTES;
}

/* Copy the record at reader->at. False: it was overwritten, or is none. */
static bool record_copy(struct fv_feed_reader *reader, uint64_t written,
                        struct fv_feed_record *record)
{
    uint64_t last = 0;
    const uint64_t offset = reader->at % FV_FEED_RING_BYTES, left = FV_FEED_RING_BYTES - offset;
    memcpy(record, reader->ring + offset, sizeof *record);
    if (!is_kept(reader, reader->at) || record->size == 0 || record->size > left ||
        record->size % FV_FEED_RECORD_UNIT != 0 || record->size > written - reader->at)
        return false;
    if (record->number == 0) return true;
    if (record->bytes > MESSAGE_BYTES_MAX ||
        sizeof *record + record->bytes + sizeof last > record->size)
        return false;
    memcpy(reader->message, reader->ring + offset + sizeof *record, record->bytes);
    memcpy(&last, reader->ring + offset + record->size - sizeof last, sizeof last);
    return is_kept(reader, reader->at) && last == record->number;
}

enum fovea_status fv_feed_reader_next(struct fv_feed_reader *reader,
                                      struct fv_feed_message *message)
{
    struct fv_feed_record record;
    /* A filler, or a place that was overwritten: of a writer that is honest, few in a row. */
    for (int skips = 0;; skips++) {
        if (skips == SKIPS_MAX) return FOVEA_AGAIN;
        const bool ended = run_ended(reader);
        const uint64_t written =
            atomic_load_explicit(&reader->header->written, memory_order_acquire);
        if (written == reader->at) return ended ? FOVEA_END : FOVEA_AGAIN;
        if (!record_copy(reader, written, &record)) {
            reader->at = written; /* what lies between is missed, and counted by its numbers */
            continue;
        }
        reader->at += record.size;
        if (record.number != 0) break;
    }
    if (reader->number != 0 && record.number > reader->number)
        reader->missed += record.number - reader->number - 1;
    reader->number = record.number;
    memcpy(message->channel, record.channel, sizeof message->channel);
    message->channel[sizeof message->channel - 1] = '\0';
    message->data = reader->message;
    message->bytes = record.bytes;
    return FOVEA_OK;
}

/* Whether all images lie within the slot. */
static bool is_inside(const struct fv_feed_reader *reader, const struct fv_feed_frame *frame)
{
    const uint64_t most = reader->slot_bytes - sizeof(struct fv_feed_slot);
    if (frame->image_count > FOVEA_CAMERAS_MAX) return false;
    for (uint32_t i = 0; i < frame->image_count; i++) {
        const struct fv_feed_image *image = &frame->images[i];
        if (image->offset > most || image->bytes > most - image->offset) return false;
    }
    return true;
}

enum fovea_status fv_feed_reader_frame(struct fv_feed_reader *reader, struct fv_feed_frame *frame,
                                       const uint8_t **images)
{
    for (int tries = 0; tries < FV_FEED_FRAMES; tries++) {
        const uint64_t number = atomic_load_explicit(&reader->header->frames, memory_order_acquire);
        if (number == 0 || number == reader->frame) return FOVEA_AGAIN;
        const uint8_t *at = reader->slots + (number - 1) % FV_FEED_FRAMES * reader->slot_bytes;
        const struct fv_feed_slot *slot = (const struct fv_feed_slot *)(const void *)at;
        if (atomic_load_explicit(&slot->whole, memory_order_acquire) != number) continue;
        *frame = slot->frame;
        memcpy(reader->images, at + sizeof *slot, (size_t)reader->slot_bytes - sizeof *slot);
        fv_feed_fence();
        if (atomic_load_explicit(&slot->begun, memory_order_relaxed) != number) continue;
        reader->frame = number;
        if (!is_inside(reader, frame)) return FOVEA_AGAIN;
        *images = reader->images;
        return FOVEA_OK;
    }
    return FOVEA_AGAIN;
}

uint64_t fv_feed_reader_missed(const struct fv_feed_reader *reader)
{
    return reader->missed;
}

int fv_feed_reader_socket(const struct fv_feed_reader *reader)
{
    return reader->socket;
}
