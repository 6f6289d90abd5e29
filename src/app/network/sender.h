/* The sending half of a transport: a thread that owns every socket and log, and the rings through
 * which the loop hands it messages.
 *
 * The loop copies a message into the ring of its class and goes on: no system call, lock or heap
 * call, and no waiting for a link, a server or a disk. The classes, first served first: state
 * (poses, status, statistics, run, answers to commands), the message that is repeated, what the
 * watching thread says, poses between frames (of the inertial sensor's thread), objects (with
 * detections, the map and unknown channels), features, previews. A preview that has waited for a
 * second goes before objects and features, so that these do not keep it back for ever.
 *
 * Every message ends in one of two ways: it is sent, or it is dropped for one of the reasons below
 * and counted for its channel. offered == sent + dropped as soon as the thread has ended.
 *
 * State is sent at once. The others are sent as fast as the link takes them (sender_link.h): while
 * it is busy, the newest message of a channel replaces those before it, and a message longer than
 * what the link takes in 80 ms is dropped; a preview is encoded again with less quality, then
 * smaller, until it fits. */
#ifndef FOVEA_APP_NETWORK_SENDER_H
#define FOVEA_APP_NETWORK_SENDER_H

#include <stdbool.h>
#include <stdint.h>

#include "app/network/transport.h"
#include "fovea/fovea.h"

struct fv_sender;

/* `url` is checked and complete. A file is opened here and nowhere else.
 * FOVEA_ERROR_INPUT: the file cannot be written, or another program writes it. FOVEA_ERROR_SYSTEM:
 * no socket, memory or thread. Init-only. */
enum fovea_status fv_sender_open(const char *url, struct fv_sender **sender,
                                 struct fovea_error *error);

/* Send this message first, and again every second, until the end: `bytes` at most
 * FV_SENDER_REPEATED_BYTES. The sending thread offers it; the loop never does. Init-only, once. */
enum { FV_SENDER_REPEATED_BYTES = 512 };
void fv_sender_repeat(struct fv_sender *sender, const char *channel, const uint8_t *data,
                      uint32_t bytes);

/* Copy a message into its ring. Loop thread, wait-free, no system call. */
void fv_sender_put(struct fv_sender *sender, const struct fovea_message *message);

/* As fv_transport_reserve and fv_transport_put_from. Of the sensor's, a newer message replaces
 * those that could not be sent; those of the watching thread are state. */
void fv_sender_reserve(struct fv_sender *sender, enum fv_transport_thread thread,
                       const char *channel);
void fv_sender_put_from(struct fv_sender *sender, enum fv_transport_thread thread,
                        const struct fovea_message *message);

/* Whether each of the loop's rings is about half empty, or this has been asked in vain for a
 * second, as where a server does not read. For frames that do not come by the clock: to be asked
 * before an iteration. `settled`: besides, all is sent but features and previews, so that no state
 * of the next iteration overtakes what was made in this one. Loop thread. */
bool fv_sender_room(struct fv_sender *sender, bool settled);

/* Send what is left, for at most FV_SENDER_FINISH_MS; drop the rest; end the thread. Where a disk
 * or pipe does not return from a write, the thread is left behind and false is returned. Afterwards
 * nothing is sent. Init-only. */
enum { FV_SENDER_FINISH_MS = 1000 };
bool fv_sender_finish(struct fv_sender *sender);

/* After fv_sender_finish: sync and close what was sent to. False: a log may not last; one line has
 * said so. What did not end in time counts as dropped, not here. Once; init-only. */
bool fv_sender_sync(struct fv_sender *sender);

/* Exact after fv_sender_finish; before that, messages may be waiting. */
void fv_sender_counts(const struct fv_sender *sender, struct fv_transport_sent *counts);

/* Finish and free. */
void fv_sender_close(struct fv_sender *sender);

#endif
