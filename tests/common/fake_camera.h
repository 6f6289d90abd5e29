/* A camera that is not there: it stands behind the system calls of the V4L2 driver
 * (drivers/v4l2/system.h) and does what a test asks of it, also what no virtual driver of the
 * kernel does. Several may stand side by side. Frames come by the clock, or as fast as buffers are
 * given back with rate_hz 0. Any thread. */
#ifndef FOVEA_TESTS_FAKE_CAMERA_H
#define FOVEA_TESTS_FAKE_CAMERA_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <linux/videodev2.h>

enum {
    FAKE_CAMERAS_MAX = 4,
    FAKE_FORMATS_MAX = 16,
    FAKE_CONTROLS_MAX = 8,
    FAKE_FAILURES_MAX = 8,
    FAKE_FRAME_BYTES_MAX = 1 << 20
};

/* What stamps say. */
enum fake_stamps {
    FAKE_STAMPS_MONOTONIC = 0, /* start of exposure, as flagged */
    FAKE_STAMPS_END,           /* end of frame, as flagged */
    FAKE_STAMPS_BOOTTIME,      /* clock not stated */
    FAKE_STAMPS_REALTIME,      /* clock not stated */
    FAKE_STAMPS_STRANGE,       /* of no clock at all */
    FAKE_STAMPS_REPEATED,      /* every other frame has that of the one before */
    FAKE_STAMPS_BACKWARD       /* every third frame lies before the one before */
};

struct fake_control {
    uint32_t id;
    const char *name;
    uint32_t type; /* enum v4l2_ctrl_type */
    int64_t minimum, maximum, step;
    int64_t value;
    const char *menu[5]; /* rows by index; NULL: not there */
    int refuses;         /* errno of writing; 0: takes values */
};

/* The next `times` calls of a request fail (times < 0: all). */
struct fake_failure {
    unsigned long request;
    int reason, times;
};

struct fake_camera {
    /* What it is. Set before it is plugged in. */
    const char *driver, *card, *bus_info, *name, *serial;
    uint32_t formats[FAKE_FORMATS_MAX];
    int32_t width, height;  /* the only size it gives; others become this one */
    int32_t stride_padding; /* bytes added to each row */
    double rate_hz;         /* 0: as fast as buffers come */
    bool any_size, planes, no_rates;
    uint32_t buffers_max; /* fewer than asked; 0: as asked */
    struct fake_control controls[FAKE_CONTROLS_MAX];
    int grain; /* not 0: it makes of values multiples of this, and does not say so */

    /* Fill frame `index` and return its bytes; NULL: byte i is (i + 37 index) & 255 over the whole
     * frame. */
    size_t (*fill)(uint32_t index, uint8_t *data, size_t capacity);

    /* What goes wrong; may be changed at any time under fake_lock. */
    struct fake_failure failures[FAKE_FAILURES_MAX];
    enum fake_stamps stamps;
    uint32_t error_every, truncate_every, drop_every; /* 0: never */
    uint32_t sequence;                                /* of the next frame */
    bool silent;                                      /* no frames */
    bool fatal;         /* poll says POLLERR, DQBUF EIO, until STREAMOFF */
    bool source_change; /* one event */
    int32_t width_now;  /* it gives this width at S_FMT from now on; 0: `width` */

    /* What happened; read under fake_lock. */
    uint64_t frames, set_ups, opens;
    uint32_t open_now, mapped_now;

    /* The fake's own. */
    bool plugged, streaming, queued[32];
    bool dead; /* the open descriptor is of before it was unplugged */
    uint32_t buffer_count, queue[32], queue_count, format;
    int fd;
    char node[64];
    int32_t set_width, set_height;
    double set_rate_hz;
    int64_t due_ns, last_stamp_ns;
    uint32_t made;
    uint8_t *memory; /* of all buffers */
    size_t buffer_bytes;
};

/* Put the fake in the place of the system calls, with no cameras; and take it away again (fails the
 * test where descriptors or mappings are left). */
void fake_begin(void);
void fake_end(void);
/* Both around one test, as fixtures of CMocka. */
int fake_set_up(void **state);
int fake_tear_down(void **state);

/* A camera of 96 x 64 in every format, 1000 frames a second, with controls; for tests to change.
 * Not plugged in. */
struct fake_camera *fake_new(void);
void fake_plug(struct fake_camera *camera, const char *node);
void fake_unplug(struct fake_camera *camera);
/* A link, as udev makes them: a camera's node, or dangling while it is away. */
void fake_link(const char *path, const struct fake_camera *camera);

void fake_lock(void);
void fake_unlock(void);
/* Under the lock. */
void fake_fail(struct fake_camera *camera, unsigned long request, int reason, int times);
const struct fake_control *fake_control(const struct fake_camera *camera, uint32_t id);

#endif
