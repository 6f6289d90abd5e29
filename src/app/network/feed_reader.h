/* A reader of the feed of a run on this host (feed.h). What it reads is checked as the bytes of a
 * stranger are: a writer that dies, or lies about lengths, does no harm.
 *
 * One thread at a time. */
#ifndef FOVEA_APP_NETWORK_FEED_READER_H
#define FOVEA_APP_NETWORK_FEED_READER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "app/network/feed_layout.h"
#include "fovea/status.h"

struct fv_feed_reader;

/* A message, copied: valid until the next call of its function. */
struct fv_feed_message {
    char channel[FV_MESSAGE_CHANNEL_BYTES];
    const uint8_t *data;
    uint32_t bytes;
};

/* Connect to the socket `path`, and wish for `frames_per_1000_s` frames. FOVEA_ERROR_SYSTEM: there
 * is no run, it has its most readers already, or what it hands out is no feed. Init-only. */
enum fovea_status fv_feed_reader_open(const char *path, uint32_t frames_per_1000_s,
                                      struct fv_feed_reader **reader, struct fovea_error *error);

/* Of the run: the prefix of its channels, which holds FV_MESSAGE_CHANNEL_BYTES, and its number. */
void fv_feed_reader_prefix(const struct fv_feed_reader *reader, char *prefix);
int64_t fv_feed_reader_run(const struct fv_feed_reader *reader);

/* Wish for another number of frames. False: not now, or the run has ended. */
bool fv_feed_reader_wish(struct fv_feed_reader *reader, uint32_t frames_per_1000_s);

/* The next message; those before the opening are not seen. FOVEA_OK, FOVEA_AGAIN: there is none
 * now, FOVEA_END: there is none and the run has ended. A reader that was overtaken goes on with the
 * newest. */
enum fovea_status fv_feed_reader_next(struct fv_feed_reader *reader,
                                      struct fv_feed_message *message);

/* The newest whole frame, if it is newer than the last, and than the opening. `*images`: its
 * images, valid until the next call; offsets of `frame` count from there, and all lie within it.
 * FOVEA_OK or FOVEA_AGAIN. */
enum fovea_status fv_feed_reader_frame(struct fv_feed_reader *reader, struct fv_feed_frame *frame,
                                       const uint8_t **images);

/* Messages that were overwritten before they were read. */
uint64_t fv_feed_reader_missed(const struct fv_feed_reader *reader);

/* Becomes readable when the run has ended; for poll(). */
int fv_feed_reader_socket(const struct fv_feed_reader *reader);

void fv_feed_reader_close(struct fv_feed_reader *reader);

#endif
