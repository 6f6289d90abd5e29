/* The player: every recorded source is a list of frames and a way to fetch one; the rest is here.
 *
 * A reader thread fetches frames in the order of the selection into a ring of FV_PLAYER_SLOTS
 * buffers, made at open, and so decodes ahead of the loop. The loop thread takes ready slots and
 * gives them back through two lock-free rings; it waits on a semaphore with a deadline and shares
 * no lock with the reader. The reader runs at normal priority with signals blocked and a stack of
 * 256 KiB.
 *
 * Frames that are missing or damaged, or whose stamp leaps ahead of the frames that follow, are
 * skipped, counted and named. Counts travel with the frames: fovea_source_ops.counts gives those up
 * to the frame dequeued last, so that they do not depend on how far ahead the reader is.
 *
 * Played in reverse, a frame's stamp is mirrored inside the range that is played (first +
 * last - stamp), so that time still goes forward; its sequence stays the index in the recording. */
#ifndef FOVEA_RECORDED_PLAYER_H
#define FOVEA_RECORDED_PLAYER_H

#include "fovea/source.h"

enum { FV_PLAYER_SLOTS = 6 };

/* Where the reader puts a frame: `frame.images[i]` describes the buffer of camera i (size, stride,
 * format as in the info) and `pixels[i]` is its memory. */
struct fv_slot {
    struct fovea_frame frame;
    struct fovea_source_counts counts;
    uint8_t *pixels[FOVEA_CAMERAS_MAX]; /* of as many cameras as the rig has */
    size_t capacity_bytes[FOVEA_CAMERAS_MAX];
};

/* A recording as the player sees it. `fetch` and `stamp` are called by one thread at a time. */
struct fv_recording_ops {
    /* Fetch frame `index` (into pixels, stamp_ns, exposure_ns, clock, stamp_meaning, sequence). Of
     * an image that is absent only `images[i].data` is set, to NULL; the player restores it.
     * FOVEA_OK with a text in `error`: the frame is
     * good, and the line is said. FOVEA_GONE: missing; FOVEA_ERROR_INPUT: damaged; `error` names
     * file and reason. FOVEA_END: the recording is over before its count. */
    enum fovea_status (*fetch)(void *recording, uint64_t index, struct fv_slot *slot,
                               struct fovea_error *error);
    /* Stamp of frame `index`, quickly: with each frame the stamps of the next few are asked for.
     * Negative: it has none. NULL: stamps are known with their frames only, which cannot be played
     * in reverse then. */
    enum fovea_status (*stamp)(void *recording, uint64_t index, int64_t *stamp_ns);
    /* Loop thread, no heap; NULL where there is none. */
    enum fovea_status (*truth)(const void *recording, const struct fovea_frame *frame,
                               struct fovea_truth *truth);
    /* All samples of its sensors in the order in which they came, in memory of the recording; a
     * stamp may be out of order (recorded/due.h). NULL: it has none. */
    const struct fovea_sample *(*samples)(const void *recording, size_t *count);
    void (*close)(void *recording);
    /* As fovea_source_ops.reads; NULL: no files. */
    void (*reads)(const void *recording, void (*visit)(void *context, const char *path),
                  void *context);
};

/* Make a source of an open recording of `count` frames (0: not known, played to the end), with
 * images of at least `image_bytes` by camera (NULL: as size and format need; `fetch` may set an
 * image's stride and size_bytes within capacity_bytes). `info` is complete but for frame_count (a
 * camera_count of 0 becomes 1); heap_bytes is what the recording itself holds. The recording is
 * closed with the source, and also on error. `origin` names the recording in errors. */
enum fovea_status fv_player_open(const struct fv_recording_ops *ops, void *recording,
                                 uint64_t count, const size_t *image_bytes, const char *origin,
                                 const struct fovea_source_selection *selection,
                                 const struct fovea_source_info *info, struct fovea_source **source,
                                 struct fovea_error *error);

/* Frames per second from the median of the first steps between stamps, so that gaps do not matter;
 * 0: no step. */
double fv_player_rate(const struct fv_recording_ops *ops, void *recording, uint64_t count);

/* The rest of fovea_source_ops, the same for all recordings. */
const struct fovea_source_info *fv_player_info(const struct fovea_source *source);
enum fovea_status fv_player_start(struct fovea_source *source, struct fovea_error *error);
enum fovea_status fv_player_dequeue(struct fovea_source *source, int64_t deadline_ns,
                                    struct fovea_frame *frame);
void fv_player_requeue(struct fovea_source *source, const struct fovea_frame *frame);
void fv_player_stop(struct fovea_source *source);
void fv_player_close(struct fovea_source *source);
enum fovea_status fv_player_truth(struct fovea_source *source, const struct fovea_frame *frame,
                                  struct fovea_truth *truth);
enum fovea_status fv_player_truth_pose(struct fovea_source *source, const struct fovea_frame *frame,
                                       double T_world_cam[12]);
uint32_t fv_player_samples(struct fovea_source *source, const struct fovea_frame *frame,
                           struct fovea_sample *samples, uint32_t count_max);
void fv_player_counts(const struct fovea_source *source, struct fovea_source_counts *counts);
enum fovea_source_state fv_player_state(const struct fovea_source *source);
enum fovea_status fv_player_complaint(struct fovea_source *source, struct fovea_error *error);
void fv_player_reads(const struct fovea_source *source,
                     void (*visit)(void *context, const char *path), void *context);

/* An operations table with all of them. */
#define FV_PLAYER_OPS(name_, help_, open_)                                                         \
    {                                                                                              \
        .name = (name_), .help = (help_), .open = (open_), .info = fv_player_info,                 \
        .start = fv_player_start, .dequeue = fv_player_dequeue, .requeue = fv_player_requeue,      \
        .stop = fv_player_stop, .close = fv_player_close, .truth = fv_player_truth,                \
        .truth_pose = fv_player_truth_pose, .samples = fv_player_samples,                          \
        .counts = fv_player_counts, .state = fv_player_state, .complaint = fv_player_complaint,    \
        .reads = fv_player_reads                                                                   \
    }

extern const struct fovea_source_ops fv_source_euroc, fv_source_tum, fv_source_kitti,
    fv_source_images, fv_source_lcmlog, fv_source_video;

#endif
