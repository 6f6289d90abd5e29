/* The runtime's side of libcamera: a device behind the live source (drivers/live/live.h) whose
 * camera is in a process of its own (protocol.h), which is started, watched and ended here.
 *
 * What a fault of that process becomes: one that ends by itself (a signal, an abort, an exit) or
 * sends what makes no sense is a broken stream, FOVEA_ERROR_SYSTEM, and the line says how it ended;
 * one that does not answer a request within fv_libcamera_answer_ns, or before the source is
 * stopped, or uses no processor time for fv_libcamera_idle_ns meanwhile, or has not ended
 * fv_libcamera_patience_ns after it was asked to, is killed. Whether the camera is there the next
 * process says. Once a camera has gone its process is killed at once: to stop a camera that is not
 * there is what libcamera aborts over. One process is there while a source is open, also while its
 * camera is away.
 *
 * Frames are not copied: the loop sees the camera's buffers, mapped here for reading until
 * `tear_down`; they outlive the process. A frame costs two messages through the socket. The process
 * runs at ordinary scheduling whatever the loop has, and takes no signals from the terminal. No
 * heap call but in open, find and set_up.
 */
#ifndef FOVEA_LIBCAMERA_CLIENT_H
#define FOVEA_LIBCAMERA_CLIENT_H

#include "protocol.h"

struct fv_libcamera_client;

/* For tests to shorten. How long a request may take (30 s: a machine under load takes seconds to
 * start libcamera); without the process working (6 s: the kernel waits up to 5 s for an answer of a
 * USB camera); how long one process is believed that the camera is away (5 s); and to end or to be
 * reaped may take (1 s). */
extern int64_t fv_libcamera_answer_ns, fv_libcamera_idle_ns, fv_libcamera_away_ns;
extern _Atomic int64_t fv_libcamera_patience_ns; /* set while a source runs, too */

/* Start a process and let it find the camera, configure it once and let it go again; one that ends
 * or hangs over it is followed by another, once. `notice` gets a line of that and where not all is
 * as asked. Negative: `error` says why, nothing is left. Init-only. */
enum fovea_status fv_libcamera_open(const struct fv_libcamera_options *options,
                                    struct fv_libcamera_client **client,
                                    struct fv_libcamera_agreed *agreed, struct fovea_error *notice,
                                    struct fovea_error *error);

size_t fv_libcamera_heap_bytes(void);

extern const struct fv_live_ops fv_libcamera_live; /* its `close` ends what `open` began */

#endif
