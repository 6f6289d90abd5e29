/* What the process that keeps libcamera sends (drivers/libcamera/protocol.h): answers, frames and
 * buffers, to a client that opens, sets up, takes and gives back. Whatever comes, frames lie in
 * what was mapped, texts end and no descriptor is lost. The input is a row of messages: one byte
 * for the kind and the descriptors beside it, then which bytes of a message that makes sense are
 * others: pairs of place and value, as many as the second byte says. */
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

/* The client itself: its process is this one. */
#include "../../drivers/libcamera/client.c"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

enum { BUFFERS = 2, BUFFER_BYTES = 4096, MESSAGES_MAX = 8 };

static struct fv_libcamera_event sensible(uint32_t kind)
{
    struct fv_libcamera_event event;
    memset(&event, 0, sizeof event);
    event.version = FV_LIBCAMERA_VERSION;
    event.kind = kind;
    event.frame.bytes = 100;
    event.agreed = (struct fv_libcamera_agreed){
        .width = 64, .height = 48, .format = FOVEA_PIXEL_GREY8, .buffers = BUFFERS};
    event.buffer_count = BUFFERS;
    event.stride_bytes = 64;
    for (int i = 0; i < BUFFERS; i++)
        event.buffers[i].bytes = BUFFER_BYTES;
    return event;
}

static void send_event(int socket, const struct fv_libcamera_event *event, size_t bytes,
                       uint32_t descriptors)
{
    union {
        struct cmsghdr align;
        char space[CMSG_SPACE(sizeof(int) * FV_LIVE_BUFFERS_MAX)];
    } beside = {.space = ""};
    struct iovec piece = {.iov_base = (void *)(uintptr_t)event, .iov_len = bytes};
    struct msghdr message = {.msg_iov = &piece, .msg_iovlen = 1};
    int files[FV_LIVE_BUFFERS_MAX];
    for (uint32_t i = 0; i < descriptors; i++) {
        files[i] = memfd_create("fuzz", MFD_CLOEXEC);
        if (files[i] < 0 || ftruncate(files[i], BUFFER_BYTES) != 0) abort();
    }
    if (descriptors > 0) {
        message.msg_control = beside.space;
        message.msg_controllen = CMSG_SPACE(sizeof(int) * descriptors);
        struct cmsghdr *header = CMSG_FIRSTHDR(&message);
        header->cmsg_level = SOL_SOCKET;
        header->cmsg_type = SCM_RIGHTS;
        header->cmsg_len = CMSG_LEN(sizeof(int) * descriptors);
        memcpy(CMSG_DATA(header), files, sizeof(int) * descriptors);
    }
    if (sendmsg(socket, &message, MSG_NOSIGNAL | MSG_DONTWAIT) < 0) abort();
    close_all(files, descriptors);
}

/* All messages of the input, and the end of the stream. */
static void send_all(int socket, const uint8_t *data, size_t bytes)
{
    size_t at = 0;
    for (int i = 0; i < MESSAGES_MAX && at + 2 <= bytes; i++) {
        const uint32_t kind = data[at] & 3,
                       descriptors = (data[at] >> 2) % (FV_LIVE_BUFFERS_MAX + 1);
        struct fv_libcamera_event event = sensible(kind);
        size_t length = fv_libcamera_event_bytes(kind);
        int pairs = data[at + 1];
        for (at += 2; pairs > 0 && at + 3 <= bytes; pairs--, at += 3) {
            const size_t place = (size_t)(data[at] | data[at + 1] << 8);
            if (place < sizeof event)
                ((uint8_t *)&event)[place] = data[at + 2];
            else
                length = 1 + data[at + 2]; /* a message of another size */
        }
        send_event(socket, &event, length, descriptors);
    }
}

static int descriptors_open(void)
{
    const int next = dup(STDIN_FILENO); /* the lowest that is free: more, where some were lost */
    close(next);
    return next;
}

static void expect(bool holds)
{
    if (!holds) abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    struct fv_libcamera_client *client = calloc(1, sizeof *client);
    struct fovea_error error = {.text = ""};
    struct fv_live_buffer buffer;
    int ends[2], wake[2];
    const int before = descriptors_open();
    if (client == NULL || pipe(wake) != 0 ||
        socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0)
        abort();
    client->socket = ends[0];
    send_all(ends[1], data, bytes);
    shutdown(ends[1], SHUT_WR);
    enum fovea_status status = ask(client, FV_LIBCAMERA_LEARN, &error);
    if (status == FOVEA_OK) status = await_answer(client, -1, NULL, NULL, &error);
    client->agreed = client->event.agreed;
    if (status == FOVEA_OK) status = set_up(client, -1, &error);
    while (status == FOVEA_OK) {
        status = take(client, 0, wake[0], &buffer, &error);
        if (status != FOVEA_OK) break;
        const struct mapping *mapping = &client->mappings[buffer.index];
        expect(buffer.index < client->buffer_count && buffer.data >= mapping->memory &&
               buffer.data + buffer.bytes <= mapping->memory + mapping->bytes);
        status = give(client, buffer.index, &error);
    }
    expect(strnlen(error.text, sizeof error.text) < sizeof error.text);
    expect(strnlen(client->event.notice.text, FOVEA_ERROR_TEXT_BYTES) < FOVEA_ERROR_TEXT_BYTES);
    close_client(client);
    close(ends[1]);
    close(wake[0]);
    close(wake[1]);
    expect(descriptors_open() == before);
    return 0;
}
