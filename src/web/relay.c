#include "web/relay.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/watch/robots.h"
#include "drivers/clock.h"
#include "fovea/fields.h"
#include "message/fields.h"
#include "web/foxglove.h"
#include "web/heard.h"

#include "fovea_camera_status_t.h"
#include "fovea_features_t.h"
#include "fovea_grid_t.h"
#include "fovea_health_t.h"
#include "fovea_map_t.h"
#include "fovea_pose_t.h"
#include "fovea_recorder_t.h"
#include "fovea_segmentation_t.h"

#define PATH_NS (FV_SECOND_NS / 10)

void fv_web_relay_init(struct fv_web_relay *relay, const char *path, uint32_t rate_hz,
                       struct fv_web_store *store)
{
    memset(relay, 0, sizeof *relay);
    relay->path = path;
    relay->store = store;
    relay->source = &fv_web_relay_feed;
    relay->rate_per_1000_s = rate_hz * 1000;
}

void fv_web_relay_play(struct fv_web_relay *relay, struct fv_web_player *player)
{
    relay->player = player;
    relay->source = &fv_web_relay_recording;
}

void fv_web_relay_hear(struct fv_web_relay *relay, struct fv_web_heard *heard)
{
    relay->heard = heard;
    relay->source = &fv_web_relay_robot;
    relay->store->previews = heard != NULL;
}

void fv_web_relay_show(struct fv_web_relay *relay, struct fv_foxglove_shown *foxglove)
{
    relay->foxglove = foxglove;
}

static int64_t utime(void)
{
    return fv_clock_ns(CLOCK_REALTIME) / 1000;
}

/* ---- messages that are looked into ----------------------------------------------------------- */

static bool is(const char *type, const struct fv_feed_message *message)
{
    const char *problem;
    size_t at;
    return fv_message_check(type, message->data, message->bytes, &problem, &at);
}

static void path_follow(struct fv_web_relay *relay, const fovea_pose_t *pose)
{
    struct fv_web_store *store = relay->store;
    const int changes = pose->change_count - relay->change_count;
    const bool other = pose->map_id != relay->map_id ||
                       pose->reset_counter != relay->reset_counter ||
                       (changes != 0 && changes != 1);
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    if (pose->map_id < 0) return;
    if (other)
        fv_web_store_path_begin(store);
    else if (changes == 1)
        fv_web_store_path_change(store, pose->change_scale, pose->change_position,
                                 pose->change_orientation);
    relay->map_id = pose->map_id;
    relay->reset_counter = pose->reset_counter;
    relay->change_count = pose->change_count;
    if (pose->position[0] != pose->position[0] || now_ns - relay->path_ns < PATH_NS) return;
    relay->path_ns = now_ns;
    fv_web_store_path_add(store, pose->position);
}

static void pose_log(struct fv_web_relay *relay, const fovea_pose_t *pose)
{
    const int state = (uint8_t)pose->state, scale = (uint8_t)pose->scale_state;
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    if (state != relay->state && relay->state >= 0)
        fv_web_store_log(
            relay->store, utime(), "pose: %s, after %.1f s of %s", fv_robot_state_name(state),
            (double)(now_ns - relay->state_since_ns) * 1e-9, fv_robot_state_name(relay->state));
    else if (state != relay->state)
        fv_web_store_log(relay->store, utime(), "pose: %s", fv_robot_state_name(state));
    if (state != relay->state) relay->state_since_ns = now_ns;
    if (scale != relay->scale_state)
        fv_web_store_log(relay->store, utime(), "scale: %s", fv_robot_scale_name(scale));
    if (pose->map_id >= 0 && relay->map_id >= 0 && pose->map_id != relay->map_id)
        fv_web_store_log(relay->store, utime(), "map: %d, after %d", pose->map_id, relay->map_id);
    relay->state = state;
    relay->scale_state = scale;
}

static void take_pose(struct fv_web_relay *relay, const struct fv_feed_message *message)
{
    fovea_pose_t pose;
    if (!is("fovea.pose_t", message) ||
        fovea_pose_t_decode(message->data, 0, (int)message->bytes, &pose) < 0)
        return;
    pose_log(relay, &pose);
    path_follow(relay, &pose);
    fovea_pose_t_decode_cleanup(&pose);
}

static void take_camera(struct fv_web_relay *relay, const struct fv_feed_message *message)
{
    fovea_camera_status_t camera;
    if (!is("fovea.camera_status_t", message) ||
        fovea_camera_status_t_decode(message->data, 0, (int)message->bytes, &camera) < 0)
        return;
    if ((uint8_t)camera.state != relay->camera_state)
        fv_web_store_log(relay->store, utime(), "camera: %s",
                         fv_robot_camera_name((uint8_t)camera.state));
    relay->camera_state = (uint8_t)camera.state;
    fovea_camera_status_t_decode_cleanup(&camera);
}

static void take_recorder(struct fv_web_relay *relay, const struct fv_feed_message *message)
{
    fovea_recorder_t recorder;
    if (!is("fovea.recorder_t", message) ||
        fovea_recorder_t_decode(message->data, 0, (int)message->bytes, &recorder) < 0)
        return;
    const bool records = recorder.state == FOVEA_RECORDER_T_STATE_RECORDS;
    if (records && !relay->records)
        fv_web_store_log(relay->store, utime(), "recording: %.100s begins", recorder.file);
    if (!records && relay->records)
        fv_web_store_log(relay->store, utime(), "recording: ends%s%.80s",
                         recorder.reason[0] != '\0' ? ": " : "", recorder.reason);
    relay->records = records;
    fovea_recorder_t_decode_cleanup(&recorder);
}

/* What health was: `faults` has a bit for each part with one. */
static void take_health(struct fv_web_relay *relay, const struct fv_feed_message *message)
{
    fovea_health_t health;
    if (!is("fovea.health_t", message) ||
        fovea_health_t_decode(message->data, 0, (int)message->bytes, &health) < 0)
        return;
    for (int32_t i = 0; i < health.count && i < FOVEA_HEALTH_T_COUNT_MAX; i++) {
        const fovea_health_part_t *part = &health.parts[i];
        const uint32_t bit = UINT32_C(1) << i;
        const bool fault = part->state != FOVEA_HEALTH_T_STATE_OK;
        if (strcmp(part->name, "odometry") == 0) continue; /* the state of the pose says it */
        if (fault && (relay->faults & bit) == 0)
            fv_web_store_log(relay->store, utime(), "%.40s %s: %.120s", part->name,
                             part->state == FOVEA_HEALTH_T_STATE_FAILED ? "failed" : "degraded",
                             part->reason);
        if (!fault && (relay->faults & bit) != 0)
            fv_web_store_log(relay->store, utime(), "%.40s: ok again", part->name);
        relay->faults = fault ? relay->faults | bit : relay->faults & ~bit;
    }
    fovea_health_t_decode_cleanup(&health);
}

/* The slot after those that this message lists, as the number of its piece. */
static int32_t piece_of_map(const struct fv_feed_message *message, int32_t last)
{
    (void)last;
    fovea_map_t map;
    if (!is("fovea.map_t", message) ||
        fovea_map_t_decode(message->data, 0, (int)message->bytes, &map) < 0)
        return -1;
    const int32_t piece = map.landmark_first / 256;
    fovea_map_t_decode_cleanup(&map);
    return piece;
}

/* Large ones come by rows: the piece after the last one, or the first. */
static int32_t piece_by_row(int32_t first_row, int32_t last)
{
    return first_row == 0 ? 0 : last >= 0 && last + 1 < FV_WEB_PIECES_MAX ? last + 1 : -1;
}

static int32_t piece_of_grid(const struct fv_feed_message *message, int32_t last)
{
    fovea_grid_t grid;
    if (!is("fovea.grid_t", message) ||
        fovea_grid_t_decode(message->data, 0, (int)message->bytes, &grid) < 0)
        return -1;
    const int32_t piece = piece_by_row(grid.first_row, last);
    fovea_grid_t_decode_cleanup(&grid);
    return piece;
}

static int32_t piece_of_mask(const struct fv_feed_message *message, int32_t last)
{
    fovea_segmentation_t mask;
    if (!is("fovea.segmentation_t", message) ||
        fovea_segmentation_t_decode(message->data, 0, (int)message->bytes, &mask) < 0)
        return -1;
    const int32_t piece = piece_by_row(mask.first_row, last);
    fovea_segmentation_t_decode_cleanup(&mask);
    return piece;
}

/* The last few are held, so that none takes the place of one that pages still wait for. */
static int32_t piece_of_answer(const struct fv_feed_message *message, int32_t last)
{
    enum { ANSWERS = 16 };
    (void)message;
    return (last + 1) % ANSWERS;
}

static void take_features(struct fv_web_relay *relay, const struct fv_feed_message *message)
{
    fovea_features_t features;
    if (!is("fovea.features_t", message) ||
        fovea_features_t_decode(message->data, 0, (int)message->bytes, &features) < 0)
        return;
    if (features.camera == 0 && features.first == 0) {
        const uint32_t at = relay->overlay_next++ % FV_WEB_OVERLAYS;
        const int32_t count =
            features.count < FV_WEB_POINTS_MAX ? features.count : FV_WEB_POINTS_MAX;
        relay->overlays[at].stamp_ns = features.stamp.time_ns;
        relay->overlays[at].count = (uint32_t)count;
        for (int32_t i = 0; i < count; i++)
            relay->overlays[at].points[i] = (struct fv_web_point){
                features.p_px[i][0], features.p_px[i][1], (uint8_t)features.level[i]};
    }
    fovea_features_t_decode_cleanup(&features);
}

/* ---- the table ------------------------------------------------------------------------------- */

static const struct shown {
    const char *channel, *type;
    int64_t pause_ns; /* between two that are sent to a page */
    void (*take)(struct fv_web_relay *relay, const struct fv_feed_message *message);
    /* Which piece it is, after `last` of the channel; -1: not to be shown. NULL: 0. */
    int32_t (*piece)(const struct fv_feed_message *message, int32_t last);
    enum { FOR_ALL, FOR_OPERATORS, FOR_NOBODY } whom; /* it is sent to as it is */
} table[] = {
    {"POSE", "fovea.pose_t", FV_SECOND_NS / 33, take_pose, NULL, FOR_ALL},
    {"RUN", "fovea.run_t", 0, NULL, NULL, FOR_ALL},
    {"STATISTICS", "fovea.statistics_t", FV_SECOND_NS / 10, NULL, NULL, FOR_ALL},
    {"CAMERA_STATUS", "fovea.camera_status_t", FV_SECOND_NS / 2, take_camera, NULL, FOR_ALL},
    {"HEALTH", "fovea.health_t", FV_SECOND_NS / 5, take_health, NULL, FOR_ALL},
    {"OBJECTS", "fovea.objects_t", FV_SECOND_NS / 30, NULL, NULL, FOR_ALL},
    {"DETECTIONS", "fovea.detections_t", FV_SECOND_NS / 30, NULL, NULL, FOR_ALL},
    {"DETECTIONS2", "fovea.detections_t", FV_SECOND_NS / 30, NULL, NULL, FOR_ALL},
    {"KEYPOINTS", "fovea.keypoints_t", FV_SECOND_NS / 30, NULL, NULL, FOR_ALL},
    {"KEYPOINTS2", "fovea.keypoints_t", FV_SECOND_NS / 30, NULL, NULL, FOR_ALL},
    {"SEGMENTATION", "fovea.segmentation_t", FV_SECOND_NS / 10, NULL, piece_of_mask, FOR_ALL},
    {"SEGMENTATION2", "fovea.segmentation_t", FV_SECOND_NS / 10, NULL, piece_of_mask, FOR_ALL},
    {"GRID", "fovea.grid_t", FV_SECOND_NS / 4, NULL, piece_of_grid, FOR_ALL},
    {"MAP", "fovea.map_t", FV_SECOND_NS / 2, NULL, piece_of_map, FOR_ALL},
    {"RECORDER", "fovea.recorder_t", 0, take_recorder, NULL, FOR_ALL},
    {"COMMAND_RESULT", "fovea.command_result_t", 0, NULL, piece_of_answer, FOR_ALL},
    {"SETTINGS_RESULT", "fovea.settings_result_t", 0, NULL, NULL, FOR_OPERATORS},
    {"MAP_FILES", "fovea.map_files_t", 0, NULL, NULL, FOR_OPERATORS},
    {"PARAMETER_RESULT", "fovea.parameter_result_t", 0, NULL, piece_of_answer,
     FOR_OPERATORS}, /* values may be secret */
    {"FEATURES", "fovea.features_t", 0, take_features, NULL, FOR_NOBODY},
    {"CAMERA_POSE", "fovea.pose_t", 0, NULL, NULL, FOR_NOBODY},
    {"PREVIEW", "fovea.preview_t", 0, NULL, NULL, FOR_NOBODY},
};
enum { SHOWN = sizeof table / sizeof table[0] };
_Static_assert(sizeof table / sizeof table[0] <= FV_WEB_SHOWN_MAX, "each has its last piece");

static const struct shown *shown_find(const struct fv_web_relay *relay, const char *channel)
{
    const size_t length = strlen(relay->prefix);
    if (length > 0) {
        if (strncmp(channel, relay->prefix, length) != 0 || channel[length] != '_') return NULL;
        channel += length + 1;
    }
    for (size_t i = 0; i < SHOWN; i++)
        if (strcmp(channel, table[i].channel) == 0) return &table[i];
    return NULL;
}

const char *fv_web_relay_shows(uint32_t index, const char **type)
{
    if (index >= SHOWN) return NULL;
    *type = table[index].type;
    return table[index].channel;
}

void fv_web_relay_take(struct fv_web_relay *relay, const struct fv_feed_message *message,
                       bool watched)
{
    const struct shown *shown = shown_find(relay, message->channel);
    if (shown == NULL) return;
    if (relay->foxglove != NULL) {
        fv_foxglove_views_take(relay->foxglove->views, shown->channel, message->data,
                               message->bytes);
        fv_foxglove_parameters_take(relay->foxglove->parameters, shown->channel, message->data,
                                    message->bytes);
    }
    if (shown->whom == FOR_NOBODY && !watched) return;
    int32_t *last = &relay->pieces[shown - table];
    if (shown->take != NULL) shown->take(relay, message);
    if (shown->piece != NULL) *last = shown->piece(message, *last);
    if (shown->whom != FOR_NOBODY && *last >= 0)
        fv_web_store_message(relay->store,
                             &(struct fv_web_kept){.channel = shown->channel,
                                                   .piece = *last,
                                                   .data = message->data,
                                                   .bytes = message->bytes,
                                                   .pause_ns = shown->pause_ns,
                                                   .operators = shown->whom == FOR_OPERATORS});
}

/* ---- pictures -------------------------------------------------------------------------------- */

void fv_web_relay_picture(struct fv_web_relay *relay, const struct fovea_image *image,
                          int64_t stamp_ns, int64_t sequence, int64_t age_ns)
{
    struct fv_web_picture *picture = &relay->store->picture;
    fv_web_picture_take(picture, image, stamp_ns, sequence, age_ns);
    if (relay->foxglove != NULL) fv_foxglove_views_picture(relay->foxglove->views, stamp_ns);
    for (int i = 0; i < FV_WEB_OVERLAYS; i++) {
        if (relay->overlays[i].stamp_ns != stamp_ns) continue;
        picture->point_count = relay->overlays[i].count;
        memcpy(picture->points, relay->overlays[i].points,
               picture->point_count * sizeof picture->points[0]);
    }
}

void fv_web_relay_begin(struct fv_web_relay *relay, const char *prefix)
{
    snprintf(relay->prefix, sizeof relay->prefix, "%s", prefix);
    relay->overlay_next = 0;
    for (size_t i = 0; i < SHOWN; i++) /* what comes by rows is shown from its first row on */
        relay->pieces[i] = table[i].piece != NULL ? -1 : 0;
    memset(relay->overlays, 0, sizeof relay->overlays);
    relay->state = relay->scale_state = relay->map_id = relay->camera_state = -1;
    relay->records = false;
    relay->faults = 0;
    fv_web_store_begin(relay->store, relay->prefix);
    if (relay->foxglove == NULL) return;
    fv_foxglove_views_begin(relay->foxglove->views, relay->prefix);
    fv_foxglove_parameters_begin(relay->foxglove->parameters);
}

void fv_web_relay_silent(struct fv_web_relay *relay)
{
    fv_web_store_log(relay->store, utime(), "%s", relay->source->silence);
    fv_web_store_end(relay->store);
}

void fv_web_relay_cameras(struct fv_web_relay *relay, uint32_t count)
{
    if (count == relay->store->cameras || count > FOVEA_CAMERAS_MAX) return;
    relay->store->cameras = count;
    relay->store->news++;
}

bool fv_web_relay_tick(struct fv_web_relay *relay, bool watched)
{
    const bool changed = relay->source->tick(relay, watched);
    return fv_web_store_tick(relay->store, fv_clock_ns(CLOCK_MONOTONIC)) || changed;
}

void fv_web_relay_close(struct fv_web_relay *relay)
{
    relay->source->close(relay);
}
