/* What the page can show, as it was heard last: messages, the path, a log of changes, the newest
 * frame and its pictures. It is the same for all clients, so that a client costs no memory of its
 * own but numbers (client.h): each knows which version of each thing it was sent, and gets the
 * newest. What a slow client has not got when something newer comes, it never gets.
 *
 * Bounded: FV_WEB_ROWS_MAX messages, FV_WEB_PATH_MAX places, FV_WEB_LOG_MAX lines. One thread. */
#ifndef FOVEA_WEB_STORE_H
#define FOVEA_WEB_STORE_H

#include <stdbool.h>
#include <stdint.h>

#include "fovea/image.h"
#include "fovea/rig.h"
#include "message/message.h"
#include "web/jpeg.h"
#include "web/player.h"

enum {
    FV_WEB_ROWS_MAX = 320, /* pieces of a map, and one or few of each other message */
    FV_WEB_PATH_MAX = 8192,
    FV_WEB_LOG_MAX = 64,
    FV_WEB_LOG_BYTES = 200,
    FV_WEB_POINTS_MAX = 2500
};

struct fv_web_row {
    char channel[FV_MESSAGE_CHANNEL_BYTES]; /* without the prefix: "POSE" */
    int32_t piece;  /* of messages that come in pieces, and of answers; else 0 */
    bool operators; /* only pages that may operate get it */
    bool waits;     /* it changed since `version` was counted up */
    uint32_t version, bytes, capacity;
    int64_t due_ns, pause_ns; /* not to be sent again before; between two times */
    uint8_t *data;
};

struct fv_web_place {
    float position[3];
};

struct fv_web_point {
    float x_px, y_px;
    uint8_t level;
};

/* The newest frame, and its JPEGs as far as somebody asked for them. */
struct fv_web_picture {
    uint32_t number;                              /* 0: there is none */
    int64_t stamp_ns, sequence, age_ns, taken_ns; /* age -1: its clock is not ours */
    struct fovea_image image;                     /* of malloc */
    uint32_t point_count;                         /* features of this very frame */
    struct fv_web_point points[FV_WEB_POINTS_MAX];
    struct {
        uint8_t *data;
        size_t bytes, capacity;
        uint32_t number;
    } jpeg[FV_WEB_JPEGS];
    uint64_t made; /* JPEGs, since the start */
};

struct fv_web_store {
    uint32_t row_count;
    struct fv_web_row rows[FV_WEB_ROWS_MAX];

    /* A new epoch begins a new path; places count from the start of theirs. */
    uint32_t path_epoch;
    uint64_t path_count;
    struct fv_web_place path[FV_WEB_PATH_MAX];

    uint64_t log_count; /* since the start of the run; the last FV_WEB_LOG_MAX are kept */
    struct {
        int64_t utime; /* microseconds since 1970 */
        char text[FV_WEB_LOG_BYTES];
    } log[FV_WEB_LOG_MAX];

    struct fv_web_picture picture; /* of the first camera */
    struct fv_web_picture others[FOVEA_CAMERAS_MAX - 1];
    uint32_t cameras; /* of the rig; 0: not known */
    struct fv_web_playback playback;
    bool previews;             /* pictures are previews, heard over LCM */
    uint32_t playback_version; /* counts its changes; 0: a run is shown, no recording */
    uint32_t run;              /* counts runs that were found; 0: none yet */
    uint32_t news;             /* counts changes of what follows and of `run` */
    bool running;
    char prefix[FV_MESSAGE_CHANNEL_BYTES];
};

struct fv_web_kept {
    const char *channel;
    int32_t piece;
    const uint8_t *data;
    uint32_t bytes;
    int64_t pause_ns; /* it is sent again that long after the last time at the earliest */
    bool operators;
};

/* Keep a message; without room for one more row it is dropped. */
void fv_web_store_message(struct fv_web_store *store, const struct fv_web_kept *kept);
/* Count up versions of what waits and is due. Returns whether there is any. */
bool fv_web_store_tick(struct fv_web_store *store, int64_t now_ns);

void fv_web_store_path_begin(struct fv_web_store *store);
void fv_web_store_path_add(struct fv_web_store *store, const double position[3]);
/* p_new = scale R(orientation) p_old + position, for all of the path; orientation is w x y z. */
void fv_web_store_path_change(struct fv_web_store *store, double scale, const double position[3],
                              const double orientation[4]);

void fv_web_store_log(struct fv_web_store *store, int64_t utime, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Forget all, for another run, whose channels begin with `prefix`; or the run has ended. */
void fv_web_store_begin(struct fv_web_store *store, const char *prefix);
void fv_web_store_end(struct fv_web_store *store);

/* That of a camera; from number FOVEA_CAMERAS_MAX on the first's. Of a camera that the rig does not
 * have it holds no image. */
struct fv_web_picture *fv_web_store_picture(struct fv_web_store *store, uint32_t camera);
/* Another frame, without features; the image, of malloc, becomes the picture's. */
void fv_web_picture_take(struct fv_web_picture *picture, const struct fovea_image *image,
                         int64_t stamp_ns, int64_t sequence, int64_t age_ns);
/* Its JPEG in a class, made now if nobody asked before. NULL: none. */
const uint8_t *fv_web_picture_jpeg(struct fv_web_picture *picture, int picture_class,
                                   size_t *bytes);

void fv_web_store_free(struct fv_web_store *store);

#endif
