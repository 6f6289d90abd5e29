/* Frame sources: cameras, recordings and the simulated camera behind one operations table.
 *
 * Life of a source: open -> start -> { dequeue -> requeue }* -> stop -> close. `open` may allocate,
 * read files and start threads; between `start` and `stop` the calls made on the loop thread
 * (dequeue, requeue, truth, truth_pose) make no heap call, and wait at most until the deadline. At
 * most `FOVEA_SOURCE_FRAMES_HELD` frames may be held at once, or as many as the selection asks for.
 */
#ifndef FOVEA_SOURCE_H
#define FOVEA_SOURCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/image.h"
#include "fovea/rig.h"
#include "fovea/sensor.h"
#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FOVEA_SOURCE_FRAMES_HELD = 2, FOVEA_SOURCE_FRAMES_HELD_MAX = 4 };

/* On which clock a stamp was taken. */
enum fovea_clock {
    /* CLOCK_MONOTONIC of the host of the camera, also when its recording is played */
    FOVEA_CLOCK_MONOTONIC = 0,
    FOVEA_CLOCK_BOOTTIME = 1,
    FOVEA_CLOCK_REALTIME = 2, /* UTC since 1970 */
    FOVEA_CLOCK_RECORDED = 3, /* whatever clock a recording of other programs was made with */
    FOVEA_CLOCK_SIMULATED = 4 /* starts at 0 with the run */
};

/* Which instant of the exposure a stamp means. */
enum fovea_stamp_meaning {
    FOVEA_STAMP_UNKNOWN = 0,
    FOVEA_STAMP_EXPOSURE_START = 1, /* of the first row */
    /* of the middle row where the readout time is known, else of the first (global: of all) */
    FOVEA_STAMP_EXPOSURE_MIDDLE = 2,
    FOVEA_STAMP_EXPOSURE_END = 3 /* end of the frame: the last row was read out */
};

/* State of a source as the loop and LCM see it. */
enum fovea_source_state {
    FOVEA_SOURCE_OK = 0,
    FOVEA_SOURCE_LATE = 1,      /* a frame is overdue */
    FOVEA_SOURCE_STALLED = 2,   /* present, but no frame for long */
    FOVEA_SOURCE_GONE = 3,      /* unplugged */
    FOVEA_SOURCE_RETURNING = 4, /* being set up, or set up and its first frame awaited */
    FOVEA_SOURCE_ENDED = 5      /* recording finished */
};

/* What the cameras of a rig saw at one stamp: an image per camera, in the rig's order. A camera
 * that gave none has an empty image (`data` NULL, all else 0). All images of a camera have the size
 * that the source's info states of it; cameras may differ. All images have the info's format. */
struct fovea_frame {
    struct fovea_image images[FOVEA_CAMERAS_MAX];
    int64_t stamp_ns;
    int64_t offset_ns[FOVEA_CAMERAS_MAX]; /* of each image: to add to stamp_ns for its own stamp */
    int64_t exposure_ns[FOVEA_CAMERAS_MAX]; /* of each image; 0: not known */
    enum fovea_clock clock;
    enum fovea_stamp_meaning stamp_meaning;
    /* index in the recording, or the driver's counter; gaps mean lost frames. Of a frame that an
     * LCM log holds: as recorded. */
    uint64_t sequence;
    uint64_t index;       /* what fovea_source_selection.start counts; live sources: 0 */
    uint32_t slot;        /* the driver's own: which buffer to requeue */
    uint32_t image_count; /* cameras of the rig, absent images among them; at least 1 */
};

/* Object classes that the simulated camera shows. */
enum fovea_truth_class {
    FOVEA_TRUTH_BACKGROUND = 0,
    FOVEA_TRUTH_BALL = 1,
    FOVEA_TRUTH_CONE = 2,
    FOVEA_TRUTH_BOX = 3,          /* also cars */
    FOVEA_TRUTH_PERSON = 4,       /* a person-sized post */
    FOVEA_TRUTH_OBJECT_COUNT = 5, /* those above are of objects that move, and have boxes */
    /* of what stands still, in masks alone; ceilings and the sky are background */
    FOVEA_TRUTH_FLOOR = 5, /* the ground, of roads too */
    FOVEA_TRUTH_WALL = 6,  /* of rooms and houses; doorposts; fences */
    FOVEA_TRUTH_OBSTACLE = 7,
    FOVEA_TRUTH_PIT = 8, /* the inside of a hole in the floor */
    FOVEA_TRUTH_CLASS_COUNT
};

enum { FOVEA_TRUTH_BOXES_MAX = 128 };

/* Axis-aligned bounds of the visible part of one object, raw-image pixels, max exclusive. */
struct fovea_truth_box {
    uint32_t id; /* constant over the run, from 1 */
    enum fovea_truth_class object_class;
    float x_min_px, y_min_px, x_max_px, y_max_px;
    /* visible pixels / pixels if nothing occluded it and the image were larger */
    float visible_fraction;
};

/* What is exactly known about a frame. Members that a source does not know are absent: has_pose
 * false, box_count 0, NULL maps. Maps are owned by the source and valid until the frame is
 * requeued. */
struct fovea_truth {
    bool has_pose;
    double T_world_cam[12]; /* row-major 3x4: camera points (metres) to the world; z of the world is
                               up in `sim:` */
    uint32_t box_count;
    struct fovea_truth_box boxes[FOVEA_TRUTH_BOXES_MAX];
    const float *depth_m;      /* width x height, z of the camera frame; 0: unknown */
    const uint8_t *class_mask; /* width x height, enum fovea_truth_class */
};

/* How frames of a recording are chosen: start, start + step, start + 2 step, ..., at most `frames`
 * of them (0: all); played last first when `reverse`, with stamps that still rise. Live sources
 * refuse anything but a number of frames. `colour`: recordings of PNG and JPEG files that have
 * colours give RGB24 frames in place of grey ones; others ignore it. `camera_given`: the caller has
 * a calibration: the source's own is not needed, and an unreadable one is ignored. */
struct fovea_source_selection {
    uint64_t start;
    uint64_t step; /* at least 1 */
    uint64_t frames;
    bool reverse;
    bool colour;
    bool camera_given;
    bool by_clock; /* frames are taken by the clock: a source that is driven waits for no command */
    /* Frames that may be held at once; 0 is FOVEA_SOURCE_FRAMES_HELD, more than
     * FOVEA_SOURCE_FRAMES_HELD_MAX is as many. A source that keeps a frame of another back while it
     * takes the next one asks for one more than is asked of itself. */
    uint32_t frames_held;
};

/* What went wrong with single frames since start, counted by the source. */
struct fovea_source_counts {
    uint64_t delivered;
    uint64_t missing; /* listed but absent */
    /* truncated, undecodable, wrong size, or a stamp that leaps ahead of the frames around it */
    uint64_t damaged;
    uint64_t dropped;   /* lost by the driver or overrun */
    uint64_t recovered; /* times the camera came back */
};

/* What a source states of one camera beside its calibration, which may be of another size. */
struct fovea_source_camera {
    int32_t width, height; /* of all its images */
    char origin[256];      /* file that its calibration came from, or "built in"; "": it has none */
    int32_t stride_bytes;  /* of its rows; 0: as narrow as the format allows, or not known */
};

struct fovea_source_info {
    struct fovea_source_camera
        cameras[FOVEA_CAMERAS_MAX]; /* as many as the rig has, in its order */
    enum fovea_pixel_format format; /* of every image */
    double rate_hz;                 /* nominal; 0: not known */
    uint64_t frame_count;           /* frames that will be delivered; 0: endless or not known */
    bool live;                      /* frames come by the clock and are lost when not taken */
    bool has_truth;                 /* of the first camera */
    uint32_t sample_kinds;          /* of its samples: bit 1 << enum fovea_sample_kind per kind */
    struct fovea_rig rig;           /* the source's own calibration, as far as it has one */
    size_t heap_bytes; /* what open allocated outside the runtime's block, for the memory table */
};

/* Controls of a camera that change while it runs, each a number. */
enum fovea_source_control {
    /* Exposure time in milliseconds. 0: as the address says, or where it says nothing, as the
     * camera was before the first change; so its automatism may be on again. */
    FOVEA_SOURCE_EXPOSURE = 0,
    FOVEA_SOURCE_GAIN = 1, /* in the unit of the source's option `gain`; negative: likewise */
    FOVEA_SOURCE_CONTROL_COUNT
};

/* A motion of the body, in its frame: x forward, y left, z up. */
struct fovea_velocity_command {
    int64_t sequence; /* of the frame that it answers; negative: of the last one */
    double velocity_m_s[3];
    double angular_rate[3]; /* rad/s */
};

struct fovea_source; /* one open source; each driver defines its own */

struct fovea_source_ops {
    const char *name; /* scheme of the URI */
    const char *help; /* one line: "DIR  EuRoC data set in ASL layout" */

    /* Mandatory. `address` is what follows "name:" in the URI. On failure `error` holds the line to
     * print and nothing is left open. Init-only. */
    enum fovea_status (*open)(const char *address, const struct fovea_source_selection *selection,
                              struct fovea_source **source, struct fovea_error *error);
    /* Valid from open to close. */
    const struct fovea_source_info *(*info)(const struct fovea_source *source);
    enum fovea_status (*start)(struct fovea_source *source, struct fovea_error *error);
    /* Wait for a frame until CLOCK_MONOTONIC reaches `deadline_ns` (INT64_MAX: no limit; 0: do not
     * wait). FOVEA_OK: `frame` is valid until requeued. FOVEA_AGAIN: none in time. FOVEA_END: no
     * more will come. FOVEA_GONE: the camera is away, keep asking. Negative: the source is beyond
     * repair. Loop thread. FOVEA_AGAIN comes at once while as many frames are held as may be, and
     * early after a signal. */
    enum fovea_status (*dequeue)(struct fovea_source *source, int64_t deadline_ns,
                                 struct fovea_frame *frame);
    void (*requeue)(struct fovea_source *source, const struct fovea_frame *frame);
    void (*stop)(struct fovea_source *source);
    void (*close)(struct fovea_source *source);

    /* Optional (NULL where it does not apply). */

    /* Whether opening `address` would take a device from the program that uses it. Looks at the
     * text alone. NULL: none does. Not on the loop thread. */
    bool (*takes_device)(const char *address);
    enum fovea_status (*truth)(struct fovea_source *source, const struct fovea_frame *frame,
                               struct fovea_truth *truth);
    /* The pose of `truth` alone, in microseconds where the maps may take as long as a frame.
     * FOVEA_ERROR_UNSUPPORTED: the pose of this frame is not known. */
    enum fovea_status (*truth_pose)(struct fovea_source *source, const struct fovea_frame *frame,
                                    double T_world_cam[12]);
    /* Samples of the sensors that go with the cameras, of any kind, in the order of their stamps:
     * of the time after the last call up to this frame's stamp (before the first frame: of one
     * frame period), at most `count_max`; the rest comes with the next call. Returns their number.
     * Loop thread. */
    uint32_t (*samples)(struct fovea_source *source, const struct fovea_frame *frame,
                        struct fovea_sample *samples, uint32_t count_max);
    void (*counts)(const struct fovea_source *source, struct fovea_source_counts *counts);
    enum fovea_source_state (*state)(const struct fovea_source *source);
    /* One line about the next frame that was skipped (file and reason), or at the start about what
     * is left out of all; FOVEA_AGAIN when there is none. To be called a few times a
     * second. Off the loop thread. */
    enum fovea_status (*complaint)(struct fovea_source *source, struct fovea_error *error);
    /* Change one control of all cameras of the source. A time or gain takes the place of the
     * automatism. FOVEA_OK: it is done and holds until the source is closed, also when the camera
     * comes back; the frames of the next exposures show it, and tell it in exposure_ns where the
     * time is known. `error` may then hold a line on what the camera made of it. FOVEA_ERROR_INPUT,
     * FOVEA_ERROR_UNSUPPORTED: out of its range, or it has none. FOVEA_GONE: the camera is away.
     * FOVEA_AGAIN: it did not answer in time. Whatever the error, the camera is as it was, but
     * where the line says otherwise. From open to close, by one thread at a time that is not the
     * loop's; waits for the camera, at most 3 seconds. NULL: nothing can be changed. */
    enum fovea_status (*control)(struct fovea_source *source, enum fovea_source_control control,
                                 double value, struct fovea_error *error);
    /* Ask the body that carries the cameras for a motion, from the frame after the one that
     * `command` answers. Where the source waits for such commands, a frame comes only when the one
     * before it has been answered. What it took it gives out as a sample. FOVEA_ERROR_UNSUPPORTED:
     * it is not driven as it was opened; FOVEA_AGAIN: too many wait. From start to stop, by one
     * thread at a time, the loop's or another; wait-free. NULL: it cannot be driven. */
    enum fovea_status (*drive)(struct fovea_source *source,
                               const struct fovea_velocity_command *command,
                               struct fovea_error *error);
    /* Why dequeue gave a negative status, as a line to stand behind the source's name: "found ...,
     * expected ...". FOVEA_AGAIN: it gave none. By the thread that called dequeue, or when that has
     * ended. NULL: it gives none, or no reason. */
    enum fovea_status (*failure)(const struct fovea_source *source, struct fovea_error *error);
    /* Call `visit` with the path of every file that the open source has read or may read, and of
     * every folder of which it reads all files, so that none of them is overwritten. NULL: it reads
     * no files. Not on the loop thread. */
    void (*reads)(const struct fovea_source *source, void (*visit)(void *context, const char *path),
                  void *context);
};

#ifdef __cplusplus
}
#endif
#endif
