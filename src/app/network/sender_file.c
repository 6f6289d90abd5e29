/* A log written without subscribers (file:), and memq:, where messages end in this program.
 *
 * The log is opened once, by the rules of support/output.h. A new one takes its place with its
 * first message: until then whatever an earlier run left there is kept. A message that does not fit
 * the disk is taken out of it again, so that it stays a row of whole events. */
#include <arpa/inet.h>
#include <endian.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/uio.h>
#include <unistd.h>

#include "app/network/sender_outlet.h"
#include "app/network/transport_url.h"
#include "drivers/clock.h"
#include "support/lcmlog.h"
#include "support/output.h"
#include "support/say.h"
#include "support/stall.h"

struct log_outlet {
    struct fv_outlet outlet; /* first */
    struct fv_output output;
    off_t end; /* of the last whole event */
    int64_t number;
};

static bool never_begun(const struct fv_outlet *outlet, enum fv_sender_class class)
{
    (void)outlet;
    (void)class;
    return false;
}

static bool always_left(struct fv_outlet *outlet)
{
    (void)outlet;
    return true;
}

/* All of the parts, or the reason. `call` is its place among the calls that may stall. */
static int write_all(int file, struct iovec *parts, int count, int call)
{
    for (int i = 0; i < count;) {
        const ssize_t written = writev(file, parts + i, count - i);
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) return written < 0 ? errno : ENOSPC;
        fv_stall_move(call);
        size_t left = (size_t)written;
        for (; i < count && left >= parts[i].iov_len; i++)
            left -= parts[i].iov_len;
        if (i == count) break;
        parts[i].iov_base = (uint8_t *)parts[i].iov_base + left;
        parts[i].iov_len -= left;
    }
    return 0;
}

/* False: nothing of it is in the log. */
static bool log_write(struct log_outlet *log, struct iovec *parts, int count)
{
    struct fv_output *output = &log->output;
    const int call = fv_stall_enter(output->path);
    const bool whole =
        write_all(output->file, parts, count, call) == 0 && fv_output_place(output) == 0;
    if (!whole && output->named && ftruncate(output->file, log->end) == 0)
        (void)lseek(output->file, log->end, SEEK_SET);
    fv_stall_leave(call);
    return whole;
}

static int log_send(struct fv_outlet *outlet, const struct fv_outgoing *message, int64_t now_ns)
{
    struct log_outlet *log = (struct log_outlet *)outlet;
    uint8_t header[FV_LCMLOG_HEADER_BYTES];
    const size_t named = strlen(message->channel);
    (void)now_ns;
    const uint32_t lengths[] = {htonl((uint32_t)named), htonl(message->bytes)};
    const uint64_t numbers[] = {
        htobe64((uint64_t)log->number),
        htobe64((uint64_t)(fv_clock_ns(CLOCK_REALTIME) / 1000)),
    };
    const uint32_t sync = htonl(FV_LCMLOG_SYNC);
    memcpy(header, &sync, 4);
    memcpy(header + 4, numbers, sizeof numbers);
    memcpy(header + 20, lengths, sizeof lengths);
    struct iovec parts[] = {{header, sizeof header},
                            {(void *)(uintptr_t)message->channel, named},
                            {(void *)(uintptr_t)message->data, message->bytes}};
    if (!log_write(log, parts, 3)) return FV_TRANSPORT_DROP_FILE;
    log->number++;
    log->end += (off_t)(sizeof header + named + message->bytes);
    return FV_OUTLET_SENT;
}

static bool log_close(struct fv_outlet *outlet)
{
    struct log_outlet *log = (struct log_outlet *)outlet;
    struct fovea_error error;
    enum fovea_status status = FOVEA_OK;
    const int call = fv_stall_enter(log->output.path);
    if (log->number == 0)
        fv_output_discard(&log->output);
    else
        status = fv_output_close(&log->output, &error);
    if (status != FOVEA_OK) fv_say("lcm_url: %s", error.text);
    fv_stall_leave(call);
    free(log);
    return status == FOVEA_OK;
}

enum fovea_status fv_outlet_file(const char *url, struct fv_outlet **outlet,
                                 struct fovea_error *error)
{
    char path[FV_TRANSPORT_URL_BYTES];
    struct fovea_error why;
    struct log_outlet *log = calloc(1, sizeof *log);
    if (log == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for LCM");
    log->outlet = (struct fv_outlet){.stalled = FV_TRANSPORT_DROP_FILE,
                                     .send = log_send,
                                     .begun = never_begun,
                                     .bulk_left = always_left,
                                     .close = log_close};
    fv_transport_file(url, path);
    const enum fovea_status status =
        fv_transport_appends(url) ? fv_output_append(&log->output, path, &why)
                                  : fv_output_open(&log->output, path, FV_OUTPUT_WHOLE, &why);
    if (status != FOVEA_OK) {
        free(log);
        return fovea_error_set(error, status, "lcm_url: %.400s", why.text);
    }
    if (log->output.named) log->end = lseek(log->output.file, 0, SEEK_END);
    *outlet = &log->outlet;
    return FOVEA_OK;
}

static int send_nowhere(struct fv_outlet *outlet, const struct fv_outgoing *message, int64_t now_ns)
{
    (void)outlet;
    (void)message;
    (void)now_ns;
    return FV_OUTLET_SENT;
}

static bool nowhere_close(struct fv_outlet *outlet)
{
    free(outlet);
    return true;
}

enum fovea_status fv_outlet_nowhere(struct fv_outlet **outlet, struct fovea_error *error)
{
    struct fv_outlet *nowhere = calloc(1, sizeof *nowhere);
    if (nowhere == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for LCM");
    *nowhere = (struct fv_outlet){.send = send_nowhere,
                                  .begun = never_begun,
                                  .bulk_left = always_left,
                                  .close = nowhere_close};
    *outlet = nowhere;
    return FOVEA_OK;
}
