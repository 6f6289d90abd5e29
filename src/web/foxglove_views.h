/* What Foxglove and Lichtblick show of our messages: views of them in Foxglove's schemas, with the
 * topics, the meaning and the stamps of tools/foxglove/views.py, whose head lists them. A view is
 * made when a client wants it, once for all clients, of the message that came last; who is slow
 * gets the newest. Channels are made known when the first message of theirs comes, pictures and log
 * at once.
 *
 * Bounded: FV_FOXGLOVE_VIEWS_MAX views of at most FV_FOXGLOVE_VIEW_BYTES each, FV_FOXGLOVE_LOG_MAX
 * lines, the landmarks and the grid that a run can have. Messages are a stranger's, and checked as
 * their type. One thread. */
#ifndef FOVEA_WEB_FOXGLOVE_VIEWS_H
#define FOVEA_WEB_FOXGLOVE_VIEWS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fovea/rig.h"
#include "message/message.h"
#include "web/foxglove_schemas.h"

enum {
    FV_FOXGLOVE_CHANNELS_MAX = 48, /* of four cameras, some 40 */
    FV_FOXGLOVE_VIEWS_MAX = 48,
    FV_FOXGLOVE_VIEW_BYTES = 600000,
    FV_FOXGLOVE_LOG_MAX = 64,
    FV_FOXGLOVE_LOG_BYTES = 128,
    FV_FOXGLOVE_TOPIC_BYTES = FV_MESSAGE_CHANNEL_BYTES + 32,
    FV_FOXGLOVE_OFFSETS = 8
};

struct fv_foxglove_kind;

struct fv_foxglove_view {
    const struct fv_foxglove_kind *kind;
    int32_t camera;
    uint32_t channel; /* index */
    uint32_t version; /* counts what came; made: of which `made` is */
    uint32_t made_version;
    int64_t time_ns;
    uint8_t *raw, *made; /* of malloc: the message, and what it is shown as */
    size_t raw_bytes, raw_capacity, made_bytes, made_capacity;
};

struct fv_foxglove_views {
    uint32_t epoch;                     /* counts prefixes: channels of another one are others */
    char base[FV_FOXGLOVE_TOPIC_BYTES]; /* of topics: "/FOVEA/" */
    uint32_t first_id;                  /* of the first channel; ids are never used again */
    uint32_t channel_count;
    struct fv_foxglove_channel {
        char topic[FV_FOXGLOVE_TOPIC_BYTES];
        const char *json; /* name of the type that it shows as JSON; NULL: `schema` */
        enum fv_foxglove_schema schema;
    } channels[FV_FOXGLOVE_CHANNELS_MAX];
    int32_t image_channels[FOVEA_CAMERAS_MAX], log_channel; /* -1: not known yet */
    uint32_t view_count;
    struct fv_foxglove_view views[FV_FOXGLOVE_VIEWS_MAX];

    uint8_t *scratch; /* of malloc: where a view is made */

    int64_t time_ns; /* the newest stamp, in UTC where that is known */

    uint64_t log_count, log_first; /* lines, and those before this run; the last
                                    * FV_FOXGLOVE_LOG_MAX are kept */
    struct {
        int64_t time_ns;
        uint32_t bytes;
        uint8_t data[FV_FOXGLOVE_LOG_BYTES];
    } log[FV_FOXGLOVE_LOG_MAX];
    int pose_state, camera_states[FOVEA_CAMERAS_MAX]; /* -1: none yet */

    /* From `odom` to `map`, by the last pose. */
    struct {
        int32_t map_id; /* -1: not known */
        double scale, position[3], orientation[4];
    } to_map;
    struct fv_foxglove_landmark {
        int32_t map; /* -1: there is none in this slot */
        float p[3];
    } * landmarks; /* of malloc, by slot */
    int32_t landmark_slots;
    int8_t *cells; /* of malloc: the grid whose rows are coming */
    int32_t cells_wide, cells_high, rows_there;
    int64_t cells_stamp_ns;

    /* From stamps to UTC, of the last messages: pictures of a feed do not have it. */
    struct {
        int64_t stamp_ns, utc_offset_ns;
    } offsets[FV_FOXGLOVE_OFFSETS];
    uint32_t offset_next;
};

void fv_foxglove_views_init(struct fv_foxglove_views *views);
void fv_foxglove_views_free(struct fv_foxglove_views *views);

/* Another run, or what comes does not follow on what came: forget what was shown. */
void fv_foxglove_views_begin(struct fv_foxglove_views *views, const char *prefix);

/* A message on a channel, named without the prefix ("POSE"). */
void fv_foxglove_views_take(struct fv_foxglove_views *views, const char *channel,
                            const uint8_t *data, size_t bytes);

/* The rig has so many cameras. */
void fv_foxglove_views_cameras(struct fv_foxglove_views *views, uint32_t count);

/* A picture of the first camera has come. */
void fv_foxglove_views_picture(struct fv_foxglove_views *views, int64_t stamp_ns);

/* What view `index` shows now; NULL: nothing. */
const uint8_t *fv_foxglove_views_made(struct fv_foxglove_views *views, uint32_t index,
                                      size_t *bytes);

/* A JPEG of a camera as CompressedImage, at `to`. Returns its bytes; 0: it does not fit. */
size_t fv_foxglove_views_image(const struct fv_foxglove_views *views, int32_t camera,
                               int64_t stamp_ns, const uint8_t *jpeg, size_t jpeg_bytes,
                               uint8_t *to, size_t capacity);

/* A stamp in UTC where that is known. */
int64_t fv_foxglove_views_time(const struct fv_foxglove_views *views, int64_t stamp_ns);

#endif
