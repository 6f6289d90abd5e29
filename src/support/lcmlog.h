/* Reading LCM log files, as written by `fovea run --record` and by lcm-logger.
 *
 * A log is a row of events. Each has a 28-byte header, all big-endian: sync word 0xEDA1DA01 (4),
 * number (8), microseconds since 1970 (8), channel length (4), data length (4); then channel and
 * data. Logs come from outside and may be cut off, damaged or hostile: every length is held against
 * the file before it is used, and an error names file and byte. (lcm_eventlog_read_next_event
 * allocates what the header asks for and skips damage without a word.)
 *
 * Memory: one buffer on the heap, as large as the largest event read. Not real-time safe; one
 * thread per log. Of the drivers and the command: not in the library, and not installed. */
#ifndef FOVEA_SUPPORT_LCMLOG_H
#define FOVEA_SUPPORT_LCMLOG_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/source.h"
#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    FV_LCMLOG_CHANNEL_BYTES = 64, /* LCM's limit, zero included */
    FV_LCMLOG_HEADER_BYTES = 28,
    FV_LCMLOG_DATA_BYTES_MAX = 1 << 28
};
#define FV_LCMLOG_SYNC 0xEDA1DA01u

struct fv_lcmlog_event {
    int64_t offset; /* of the event in the file, bytes */
    int64_t number; /* as the writer counted */
    int64_t time_us;
    char channel[FV_LCMLOG_CHANNEL_BYTES];
    uint32_t bytes;
    const uint8_t *data; /* in memory of the log, valid until the next read; NULL when skimming */
};

/* Whether this program reads recordings of `format`, which stands at `byte` of the file `name`.
 * FOVEA_ERROR_UNSUPPORTED: `error` says what was found and what reads it. */
enum fovea_status fv_lcmlog_check_format(const char *name, int64_t byte, int32_t format,
                                         struct fovea_error *error);

struct fv_lcmlog;

/* Open a log for reading. FOVEA_ERROR_INPUT: cannot be opened, or not a regular file. */
enum fovea_status fv_lcmlog_open(const char *path, struct fv_lcmlog **log,
                                 struct fovea_error *error);
void fv_lcmlog_close(struct fv_lcmlog *log);

/* Next event with its data. FOVEA_END after the last one; FOVEA_ERROR_INPUT: `error` names file,
 * byte, found, expected. After an error event->offset is the place of what could not be read, and
 * the position is not defined (fv_lcmlog_seek and fv_lcmlog_resync mend that). */
enum fovea_status fv_lcmlog_next(struct fv_lcmlog *log, struct fv_lcmlog_event *event,
                                 struct fovea_error *error);

/* Whether the last read failed because the file ends within an event: cut off, not damaged. */
bool fv_lcmlog_cut_off(const struct fv_lcmlog *log);

/* As fv_lcmlog_next without reading the data: quick, for making an index. */
enum fovea_status fv_lcmlog_skim(struct fv_lcmlog *log, struct fv_lcmlog_event *event,
                                 struct fovea_error *error);

/* Go on with the event at `offset`, from an earlier event, or 0. */
enum fovea_status fv_lcmlog_seek(struct fv_lcmlog *log, int64_t offset, struct fovea_error *error);

/* After an error: go on with the next sync word behind the place of what could not be read. By
 * chance it may stand inside data: what follows it is then rarely an event. FOVEA_END: there is
 * none. */
enum fovea_status fv_lcmlog_resync(struct fv_lcmlog *log);

/* Whether the channel's last part is `suffix`: "FOVEA_FRAME" and "FRAME" end in "FRAME", "SUBFRAME"
 * does not.
 */
bool fv_lcmlog_channel_is(const char *channel, const char *suffix);

/* Read an event that holds a fovea.frame_t. Its images point into the event's data; its clock is
 * that of the recording and its sequence that of the recorded frame. FOVEA_ERROR_INPUT: other type,
 * or sizes that do not fit; `name` (the file) and the byte stand in `error`. */
enum fovea_status fv_lcmlog_frame(const char *name, const struct fv_lcmlog_event *event,
                                  struct fovea_frame *frame, struct fovea_error *error);

/* Read an event that holds a sample (fovea/sensor.h), of any kind. FOVEA_ERROR_INPUT: of another
 * type or length, or with a number that is not finite, but for those of inertial sensors, which a
 * step judges; as fv_lcmlog_frame. */
enum fovea_status fv_lcmlog_sample(const char *name, const struct fv_lcmlog_event *event,
                                   struct fovea_sample *sample, struct fovea_error *error);

/* Stamp of a frame that was skimmed, without reading its picture; the log stays where it is.
 * FOVEA_ERROR_INPUT: it holds no fovea.frame_t. */
enum fovea_status fv_lcmlog_frame_stamp(struct fv_lcmlog *log, const struct fv_lcmlog_event *event,
                                        int64_t *stamp_ns);

#ifdef __cplusplus
}
#endif
#endif
