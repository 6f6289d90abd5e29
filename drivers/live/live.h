/* The live source: what every camera driver shares. A driver brings a device (find, set up, take a
 * buffer, give it back); recovery, stamps, counting, decoding and the handing over to the loop are
 * here.
 *
 * A camera thread of the source's own is the only one that calls the device, so that no system call
 * of a driver, however long it hangs, holds up the loop: a camera that is being unplugged can block
 * its callers for seconds. Frames go to the loop, and buffers back, through two lock-free rings;
 * the loop waits on a semaphore with its deadline. The camera thread takes over the scheduling of
 * the thread that first dequeues. Raw frames are not copied: the loop sees the driver's buffer.
 * MJPEG is decoded on the camera thread into FV_LIVE_DECODED buffers made at open, with no heap
 * call.
 *
 * Buffers that the loop holds are waited for before a device is torn down. */
#ifndef FOVEA_LIVE_LIVE_H
#define FOVEA_LIVE_LIVE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/source.h"
#include "order.h"
#include "recovery.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FV_LIVE_BUFFERS_MIN = 3, FV_LIVE_BUFFERS_MAX = 8, FV_LIVE_DECODED = 4 };

/* One buffer as a device gave it. */
struct fv_live_buffer {
    uint32_t index; /* below FV_LIVE_BUFFERS_MAX */
    const uint8_t *data;
    size_t bytes;         /* filled */
    int32_t stride_bytes; /* of a raw image */
    bool damaged;         /* the driver says so */
    struct fv_order_stamp stamp;
};

/* A device, called by the camera thread alone (but for `close`, which comes when that has ended).
 * No call but `set_up` and `find` may use the heap. `quit_fd` can be read once the source is being
 * stopped: whatever may wait for long then gives up. */
struct fv_live_ops {
    /* Whether the camera is there. FOVEA_OK; FOVEA_GONE; negative: another camera is in its place.
     */
    enum fovea_status (*find)(void *device, int quit_fd, struct fovea_error *error);
    /* Make it stream as it did when it was opened: same size and format. FOVEA_OK: it does; `error`
     * may then hold a notice all the same. FOVEA_GONE: unplugged meanwhile. Negative:
     * refused. Nothing is left open on failure. */
    enum fovea_status (*set_up)(void *device, int quit_fd, struct fovea_error *error);
    void (*tear_down)(void *device);
    /* Wait for a filled buffer until the deadline, or until `wake_fd` can be read. FOVEA_AGAIN:
     * none. FOVEA_GONE: unplugged. Negative: streaming is broken. */
    enum fovea_status (*take)(void *device, int64_t deadline_ns, int wake_fd,
                              struct fv_live_buffer *buffer, struct fovea_error *error);
    /* A buffer is free again. As `take`. */
    enum fovea_status (*give)(void *device, uint32_t index, struct fovea_error *error);
    void (*close)(void *device);
    /* As fovea_source_ops.control, while it is set up; or while the source is not started, by the
     * thread that asks. `quit_fd`: -1 then. */
    enum fovea_status (*control)(void *device, enum fovea_source_control control, double value,
                                 int quit_fd, struct fovea_error *error);
    /* NULL, or: a good frame, decoded, just before the loop gets it. */
    void (*seen)(void *device, const struct fovea_image *image);
};

struct fv_live_setup {
    const char *uri; /* named in complaints; copied */
    /* cameras[0], rate_hz, and the format of the device (MJPEG becomes grey8) */
    struct fovea_source_info info;
    size_t frame_bytes_min; /* a raw frame with fewer is truncated; 0: by size, format and stride */
    bool split;             /* two cameras share a picture (split.h), which is possible */
    uint32_t buffers;       /* how many the device has at most */
    int64_t readout_ns;     /* negative: not given */
    const struct fv_recovery_times *times; /* NULL: by the rate */
};

/* Make a source of an open device, which is closed with it and also on error. */
enum fovea_status fv_live_open(const struct fv_live_ops *ops, void *device,
                               const struct fv_live_setup *setup,
                               const struct fovea_source_selection *selection,
                               struct fovea_source **source, struct fovea_error *error);

/* Refuses what a live source cannot do: anything but a number of frames. */
enum fovea_status fv_live_selection(const char *scheme,
                                    const struct fovea_source_selection *selection,
                                    struct fovea_error *error);

/* Said once at the next `complaint`, whichever thread asks: for what was negotiated at open. */
void fv_live_notice(struct fovea_source *source, const struct fovea_error *line);

/* The rest of fovea_source_ops, the same for all live sources. */
const struct fovea_source_info *fv_live_info(const struct fovea_source *source);
enum fovea_status fv_live_start(struct fovea_source *source, struct fovea_error *error);
enum fovea_status fv_live_dequeue(struct fovea_source *source, int64_t deadline_ns,
                                  struct fovea_frame *frame);
void fv_live_requeue(struct fovea_source *source, const struct fovea_frame *frame);
void fv_live_stop(struct fovea_source *source);
void fv_live_close(struct fovea_source *source);
void fv_live_counts(const struct fovea_source *source, struct fovea_source_counts *counts);
enum fovea_source_state fv_live_state(const struct fovea_source *source);
enum fovea_status fv_live_complaint(struct fovea_source *source, struct fovea_error *error);
bool fv_live_takes_device(const char *address);
enum fovea_status fv_live_control(struct fovea_source *source, enum fovea_source_control control,
                                  double value, struct fovea_error *error);

#define FV_LIVE_OPS(name_, help_, open_)                                                           \
    {                                                                                              \
        .name = (name_), .help = (help_), .open = (open_), .info = fv_live_info,                   \
        .start = fv_live_start, .dequeue = fv_live_dequeue, .requeue = fv_live_requeue,            \
        .stop = fv_live_stop, .close = fv_live_close, .counts = fv_live_counts,                    \
        .state = fv_live_state, .complaint = fv_live_complaint, .control = fv_live_control,        \
        .takes_device = fv_live_takes_device                                                       \
    }

extern const struct fovea_source_ops fv_source_v4l2, fv_source_libcamera;

#ifdef __cplusplus
}
#endif
#endif
