/* The feed of a run: all outgoing messages as they are encoded, and raw frames, in shared memory
 * that programs on this host may read (feed_reader.h). LCM is not needed.
 *
 * A Unix socket hands out the memory, a memfd that is sealed so that nobody can change its size or
 * map it for writing any more; then it listens to what the reader wishes. The loop's thread writes:
 * wait-free, without a system call but the clock's, and nothing at all while there is no reader.
 * A thread of the feed serves the socket. A reader that is slow or stopped costs nothing; it misses
 * messages and counts them.
 *
 * The socket is the owner's and the group's (0660): of the group `fovea`, where there is one that
 * the process may use. At most FV_FEED_READERS_MAX readers at once. */
#ifndef FOVEA_APP_NETWORK_FEED_H
#define FOVEA_APP_NETWORK_FEED_H

#include <stddef.h>
#include <stdint.h>

#include "fovea/fovea.h"

enum { FV_FEED_READERS_MAX = 16, FV_FEED_PATH_BYTES = 95 };

struct fv_feed;

struct fv_feed_setup {
    const char *path; /* of the socket; "": *feed is NULL */
    const char *prefix;
    int64_t run_id;
    size_t frame_bytes;       /* of all images of a frame without gaps, at most */
    uint32_t picture_rate_hz; /* frames that are copied in a second, at most; 0: none */
};

/* A socket that a run left behind is replaced. FOVEA_ERROR_INPUT: `path` is too long, is no socket,
 * cannot be made, or another run offers its feed there. FOVEA_ERROR_SYSTEM: no memory or thread.
 * Init-only. */
enum fovea_status fv_feed_open(const struct fv_feed_setup *setup, struct fv_feed **feed,
                               struct fovea_error *error);

/* Write this message, which must stay, for every new reader and once a second. Init-only. */
void fv_feed_repeat(struct fv_feed *feed, const struct fovea_message *message);

/* Write the messages of a step or a work. NULL: nothing. Loop thread, wait-free. */
void fv_feed_publish(struct fv_feed *feed, const struct fovea_outputs *outputs);

/* Write a message. Loop thread, wait-free; after it has ended, any one thread. */
void fv_feed_put(struct fv_feed *feed, const struct fovea_message *message);

/* Write the frame, if a reader wishes for one now. Loop thread, wait-free. */
void fv_feed_frame(struct fv_feed *feed, const struct fovea_frame *frame);

/* Remove the socket and end. */
void fv_feed_close(struct fv_feed *feed);

#endif
