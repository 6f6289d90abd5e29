#include "web/foxglove_views.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/watch/robots.h"
#include "message/fields.h"
#include "web/foxglove_make.h"

#include "fovea_camera_status_t.h"
#include "fovea_grid_t.h"
#include "fovea_map_t.h"
#include "fovea_pose_t.h"

enum {
    CAMERA_AT = 34,      /* of messages that begin with a stamp_t and the camera, behind the hash */
    SLOTS_MAX = 1 << 16, /* of landmarks */
    SIDE_MAX = 1024      /* of a grid, cells */
};

/* ---- channels and views ---------------------------------------------------------------------- */

/* What is shown of the messages of a channel. */
struct fv_foxglove_kind {
    const char *channel, *type, *topic; /* "%d" in the topic is the camera */
    bool of_camera;
    enum fv_foxglove_schema schema;
    /* Keeps of a checked message what is shown later; NULL: the message. Whether to show it. */
    bool (*take)(struct fv_foxglove_views *views, const uint8_t *data, size_t bytes);
    fv_foxglove_make *make; /* NULL: JSON */
};

static int32_t channel_find(struct fv_foxglove_views *views, const char *topic, const char *json,
                            enum fv_foxglove_schema schema)
{
    char whole[FV_FOXGLOVE_TOPIC_BYTES + 32];
    snprintf(whole, sizeof whole, "%s%s", views->base, topic);
    for (uint32_t i = 0; i < views->channel_count; i++)
        if (strcmp(views->channels[i].topic, whole) == 0) return (int32_t)i;
    if (views->channel_count == FV_FOXGLOVE_CHANNELS_MAX ||
        strlen(whole) >= FV_FOXGLOVE_TOPIC_BYTES)
        return -1;
    struct fv_foxglove_channel *made = &views->channels[views->channel_count];
    memcpy(made->topic, whole, strlen(whole) + 1);
    made->json = json;
    made->schema = schema;
    return (int32_t)views->channel_count++;
}

static struct fv_foxglove_view *view_find(struct fv_foxglove_views *views,
                                          const struct fv_foxglove_kind *kind, int32_t camera)
{
    char topic[32];
    for (uint32_t i = 0; i < views->view_count; i++)
        if (views->views[i].kind == kind && views->views[i].camera == camera)
            return &views->views[i];
    if (views->view_count == FV_FOXGLOVE_VIEWS_MAX) return NULL;
    if (kind->of_camera)
        snprintf(topic, sizeof topic, "cam%d/%s", camera, kind->topic);
    else
        snprintf(topic, sizeof topic, "%s", kind->topic);
    const int32_t channel =
        channel_find(views, topic, kind->make == NULL ? kind->type : NULL, kind->schema);
    if (channel < 0) return NULL;
    struct fv_foxglove_view *view = &views->views[views->view_count++];
    memset(view, 0, sizeof *view);
    view->kind = kind;
    view->camera = camera;
    view->channel = (uint32_t)channel;
    return view;
}

static bool grow(uint8_t **data, size_t *capacity, size_t bytes)
{
    if (bytes <= *capacity) return true;
    uint8_t *more = realloc(*data, bytes);
    if (more == NULL) return false;
    *data = more;
    *capacity = bytes;
    return true;
}

/* ---- stamps ---------------------------------------------------------------------------------- */

/* Of the stamp_t that a message begins with. */
static void stamp_read(const uint8_t *data, fovea_stamp_t *stamp)
{
    if (__fovea_stamp_t_decode_array(data, 8, CAMERA_AT - 8, stamp, 1) < 0)
        memset(stamp, 0, sizeof *stamp);
}

static void offset_keep(struct fv_foxglove_views *views, const fovea_stamp_t *stamp)
{
    const uint32_t last = (views->offset_next + FV_FOXGLOVE_OFFSETS - 1) % FV_FOXGLOVE_OFFSETS;
    if (views->offsets[last].stamp_ns == stamp->time_ns) return;
    const uint32_t at = views->offset_next++ % FV_FOXGLOVE_OFFSETS;
    views->offsets[at].stamp_ns = stamp->time_ns;
    views->offsets[at].utc_offset_ns = stamp->utc_offset_ns;
}

int64_t fv_foxglove_views_time(const struct fv_foxglove_views *views, int64_t stamp_ns)
{
    const uint32_t last = (views->offset_next + FV_FOXGLOVE_OFFSETS - 1) % FV_FOXGLOVE_OFFSETS;
    fovea_stamp_t stamp = {.time_ns = stamp_ns,
                           .utc_offset_ns = views->offsets[last].utc_offset_ns};
    for (int i = 0; i < FV_FOXGLOVE_OFFSETS; i++)
        if (views->offsets[i].stamp_ns == stamp_ns)
            stamp.utc_offset_ns = views->offsets[i].utc_offset_ns;
    return fv_foxglove_make_time(&stamp);
}

/* ---- what is kept of messages ---------------------------------------------------------------- */

/* A line of the log when a state changes. */
static void log_change(struct fv_foxglove_views *views, int *state, int now, const char *who,
                       const char *name, bool bad, int64_t time_ns)
{
    char text[64];
    if (*state == now) return;
    *state = now;
    snprintf(text, sizeof text, "%s: %s", who, name);
    const uint64_t at = views->log_count++ % FV_FOXGLOVE_LOG_MAX;
    struct fv_protobuf to = {.data = views->log[at].data, .capacity = FV_FOXGLOVE_LOG_BYTES};
    fv_foxglove_make_log(time_ns, bad, who, text, &to);
    views->log[at].bytes = (uint32_t)to.bytes;
    views->log[at].time_ns = time_ns;
}

/* The name of a state; its number where there is none ("?"), as views.py has it. */
static const char *name_of(const char *name, int state, char number[8])
{
    if (strcmp(name, "?") != 0) return name;
    snprintf(number, 8, "%d", state);
    return number;
}

static bool take_pose(struct fv_foxglove_views *views, const uint8_t *data, size_t bytes)
{
    fovea_pose_t pose;
    char number[8];
    if (fovea_pose_t_decode(data, 0, (int)bytes, &pose) < 0) return false;
    log_change(views, &views->pose_state, pose.state, "pose",
               name_of(fv_robot_state_name(pose.state), pose.state, number),
               pose.state == FOVEA_POSE_T_STATE_LOST || pose.state == FOVEA_POSE_T_STATE_WEAK,
               fv_foxglove_make_time(&pose.stamp));
    const bool known = fv_foxglove_make_known(&pose);
    if (known) {
        views->to_map.map_id = pose.map_id;
        views->to_map.scale = pose.map_scale;
        memcpy(views->to_map.position, pose.map_position, sizeof views->to_map.position);
        memcpy(views->to_map.orientation, pose.map_orientation, sizeof views->to_map.orientation);
    }
    fovea_pose_t_decode_cleanup(&pose);
    return known;
}

static bool is_known_pose(struct fv_foxglove_views *views, const uint8_t *data, size_t bytes)
{
    fovea_pose_t pose;
    (void)views;
    if (fovea_pose_t_decode(data, 0, (int)bytes, &pose) < 0) return false;
    const bool known = fv_foxglove_make_known(&pose);
    fovea_pose_t_decode_cleanup(&pose);
    return known;
}

static bool take_camera_status(struct fv_foxglove_views *views, const uint8_t *data, size_t bytes)
{
    fovea_camera_status_t camera;
    char number[8], who[16];
    if (fovea_camera_status_t_decode(data, 0, (int)bytes, &camera) < 0) return false;
    if (camera.camera >= 0 && camera.camera < FOVEA_CAMERAS_MAX) {
        snprintf(who, sizeof who, "cam%d", camera.camera);
        log_change(views, &views->camera_states[camera.camera], camera.state, who,
                   name_of(fv_robot_camera_name(camera.state), camera.state, number),
                   camera.state >= FOVEA_CAMERA_STATUS_T_STATE_LATE &&
                       camera.state <= FOVEA_CAMERA_STATUS_T_STATE_GONE,
                   fv_foxglove_make_time(&camera.stamp));
    }
    fovea_camera_status_t_decode_cleanup(&camera);
    return true;
}

static bool landmarks_grow(struct fv_foxglove_views *views, int32_t slots)
{
    if (slots <= views->landmark_slots) return true;
    if (slots > SLOTS_MAX) return false;
    struct fv_foxglove_landmark *more =
        realloc(views->landmarks, (size_t)slots * sizeof *views->landmarks);
    if (more == NULL) return false;
    for (int32_t i = views->landmark_slots; i < slots; i++)
        more[i].map = -1;
    views->landmarks = more;
    views->landmark_slots = slots;
    return true;
}

static bool take_map(struct fv_foxglove_views *views, const uint8_t *data, size_t bytes)
{
    fovea_map_t map;
    if (fovea_map_t_decode(data, 0, (int)bytes, &map) < 0) return false;
    const bool fits = landmarks_grow(views, map.landmark_slots);
    for (int32_t i = map.landmark_first < 0 ? 0 : map.landmark_first;
         fits && i < map.landmark_last && i < views->landmark_slots; i++)
        views->landmarks[i].map = -1;
    for (int32_t i = 0; fits && i < map.landmark_count; i++) {
        const int32_t slot = map.landmark_slot[i];
        if (slot < 0 || slot >= views->landmark_slots) continue;
        views->landmarks[slot].map = map.landmark_map[i];
        memcpy(views->landmarks[slot].p, map.landmark_p[i], sizeof views->landmarks[slot].p);
    }
    fovea_map_t_decode_cleanup(&map);
    return fits;
}

/* The rows of one grid, in their order: whether the last has come. */
static bool rows_take(struct fv_foxglove_views *views, const fovea_grid_t *grid)
{
    const int64_t cells = (int64_t)grid->width * grid->height;
    if (grid->width < 1 || grid->height < 1 || grid->width > SIDE_MAX || grid->height > SIDE_MAX ||
        cells > FV_FOXGLOVE_VIEW_BYTES - 1000 || grid->row_count < 0 ||
        grid->row_count > SIDE_MAX || grid->cell_count != grid->width * grid->row_count)
        return false;
    if (grid->first_row == 0) {
        int8_t *more = realloc(views->cells, (size_t)cells);
        if (more == NULL) return false;
        views->cells = more;
        views->cells_wide = grid->width;
        views->cells_high = grid->height;
        views->cells_stamp_ns = grid->stamp.time_ns;
        views->rows_there = 0;
    }
    if (views->cells == NULL || grid->width != views->cells_wide ||
        grid->height != views->cells_high || grid->stamp.time_ns != views->cells_stamp_ns ||
        grid->first_row != views->rows_there || grid->row_count > grid->height - grid->first_row)
        return false;
    memcpy(views->cells + (size_t)grid->first_row * (size_t)grid->width, grid->cells,
           (size_t)grid->cell_count);
    views->rows_there += grid->row_count;
    return views->rows_there == views->cells_high;
}

static bool take_grid(struct fv_foxglove_views *views, const uint8_t *data, size_t bytes)
{
    fovea_grid_t grid;
    if (fovea_grid_t_decode(data, 0, (int)bytes, &grid) < 0) return false;
    const bool whole =
        rows_take(views, &grid) && grid.map_id >= 0 && grid.map_id == views->to_map.map_id;
    fovea_grid_t_decode_cleanup(&grid);
    return whole;
}

/* ---- the table ------------------------------------------------------------------------------- */

static const struct fv_foxglove_kind kinds[] = {
    {"POSE", "fovea.pose_t", "pose", false, FV_FOXGLOVE_POSE_IN_FRAME, take_pose,
     fv_foxglove_make_pose},
    {"POSE", "fovea.pose_t", "transforms", false, FV_FOXGLOVE_FRAME_TRANSFORMS, is_known_pose,
     fv_foxglove_make_transforms},
    {"CAMERA_POSE", "fovea.pose_t", "camera_pose", false, FV_FOXGLOVE_POSE_IN_FRAME, is_known_pose,
     fv_foxglove_make_pose},
    {"CAMERA_POSE", "fovea.pose_t", "transforms", false, FV_FOXGLOVE_FRAME_TRANSFORMS,
     is_known_pose, fv_foxglove_make_transforms},
    {"FEATURES", "fovea.features_t", "features", true, FV_FOXGLOVE_IMAGE_ANNOTATIONS, NULL,
     fv_foxglove_make_features},
    {"DETECTIONS", "fovea.detections_t", "detections", true, FV_FOXGLOVE_IMAGE_ANNOTATIONS, NULL,
     fv_foxglove_make_detections},
    {"DETECTIONS2", "fovea.detections_t", "detections2", true, FV_FOXGLOVE_IMAGE_ANNOTATIONS, NULL,
     fv_foxglove_make_detections},
    {"OBJECTS", "fovea.objects_t", "objects", true, FV_FOXGLOVE_IMAGE_ANNOTATIONS, NULL,
     fv_foxglove_make_objects},
    {"KEYPOINTS", "fovea.keypoints_t", "keypoints", true, FV_FOXGLOVE_IMAGE_ANNOTATIONS, NULL,
     fv_foxglove_make_keypoints},
    {"KEYPOINTS2", "fovea.keypoints_t", "keypoints2", true, FV_FOXGLOVE_IMAGE_ANNOTATIONS, NULL,
     fv_foxglove_make_keypoints},
    {"PREVIEW", "fovea.preview_t", "preview", true, FV_FOXGLOVE_COMPRESSED_IMAGE, NULL,
     fv_foxglove_make_preview},
    {"MAP", "fovea.map_t", "map", false, FV_FOXGLOVE_POINT_CLOUD, take_map, fv_foxglove_make_map},
    {"GRID", "fovea.grid_t", "grid", false, FV_FOXGLOVE_GRID, take_grid, fv_foxglove_make_grid},
    {"STATISTICS", "fovea.statistics_t", "statistics", false, 0, NULL, NULL},
    {"CAMERA_STATUS", "fovea.camera_status_t", "camera_status", false, 0, take_camera_status, NULL},
};
enum { KINDS = sizeof kinds / sizeof kinds[0] };

static void show(struct fv_foxglove_views *views, const struct fv_foxglove_kind *kind,
                 const uint8_t *data, size_t bytes)
{
    const int32_t camera = kind->of_camera ? (int8_t)data[CAMERA_AT] : 0;
    fovea_stamp_t stamp;
    if (camera < 0 || camera >= FOVEA_CAMERAS_MAX) return;
    struct fv_foxglove_view *view = view_find(views, kind, camera);
    if (view == NULL || !grow(&view->raw, &view->raw_capacity, bytes)) return;
    memcpy(view->raw, data, bytes);
    view->raw_bytes = bytes;
    view->version++;
    stamp_read(data, &stamp);
    view->time_ns = fv_foxglove_make_time(&stamp);
    if (view->time_ns > views->time_ns) views->time_ns = view->time_ns;
    offset_keep(views, &stamp);
    if (kind->schema == FV_FOXGLOVE_GRID) /* its place in the map is that of now */
        (void)fv_foxglove_views_made(views, (uint32_t)(view - views->views), &(size_t){0});
}

void fv_foxglove_views_take(struct fv_foxglove_views *views, const char *channel,
                            const uint8_t *data, size_t bytes)
{
    const char *problem;
    size_t at;
    bool checked = false;
    for (int i = 0; i < KINDS; i++) {
        if (strcmp(channel, kinds[i].channel) != 0) continue;
        if (!checked && !fv_message_check(kinds[i].type, data, bytes, &problem, &at)) return;
        checked = true;
        if (kinds[i].take == NULL || kinds[i].take(views, data, bytes))
            show(views, &kinds[i], data, bytes);
    }
}

/* ---- views ----------------------------------------------------------------------------------- */

/* Without its first member, "type", which the schema names. */
static size_t make_json(const struct fv_foxglove_view *view, char *to, size_t capacity)
{
    struct fovea_error error;
    size_t length;
    if (fovea_message_json(view->raw, view->raw_bytes, to, capacity, &length, &error) != FOVEA_OK ||
        length >= capacity)
        return 0;
    const char *rest = strchr(to, ',');
    if (rest == NULL) return 0;
    const size_t kept = length - (size_t)(rest + 1 - to);
    memmove(to + 1, rest + 1, kept);
    return 1 + kept;
}

const uint8_t *fv_foxglove_views_made(struct fv_foxglove_views *views, uint32_t index,
                                      size_t *bytes)
{
    struct fv_foxglove_view *view = &views->views[index];
    if (view->made_version != view->version && view->raw_bytes > 0) {
        view->made_version = view->version;
        view->made_bytes = 0;
        if (views->scratch == NULL) views->scratch = malloc(FV_FOXGLOVE_VIEW_BYTES);
        if (views->scratch == NULL) return NULL;
        struct fv_protobuf to = {.data = views->scratch, .capacity = FV_FOXGLOVE_VIEW_BYTES};
        if (view->kind->make != NULL)
            view->kind->make(views, view->raw, view->raw_bytes, &to);
        else
            to.bytes = make_json(view, (char *)to.data, to.capacity);
        if (!to.full && to.bytes > 0 && grow(&view->made, &view->made_capacity, to.bytes)) {
            memcpy(view->made, to.data, to.bytes);
            view->made_bytes = to.bytes;
        }
    }
    *bytes = view->made_bytes;
    return view->made_bytes > 0 ? view->made : NULL;
}

void fv_foxglove_views_cameras(struct fv_foxglove_views *views, uint32_t count)
{
    char topic[32];
    for (uint32_t i = 0; i < count && i < FOVEA_CAMERAS_MAX; i++) {
        if (views->image_channels[i] >= 0) continue;
        snprintf(topic, sizeof topic, "cam%u/image", (unsigned)i);
        views->image_channels[i] = channel_find(views, topic, NULL, FV_FOXGLOVE_COMPRESSED_IMAGE);
    }
}

void fv_foxglove_views_picture(struct fv_foxglove_views *views, int64_t stamp_ns)
{
    const int64_t time_ns = fv_foxglove_views_time(views, stamp_ns);
    if (time_ns > views->time_ns) views->time_ns = time_ns;
}

size_t fv_foxglove_views_image(const struct fv_foxglove_views *views, int32_t camera,
                               int64_t stamp_ns, const uint8_t *jpeg, size_t jpeg_bytes,
                               uint8_t *data, size_t capacity)
{
    struct fv_protobuf to = {.data = data, .capacity = capacity};
    fv_foxglove_make_image(fv_foxglove_views_time(views, stamp_ns), camera, jpeg, jpeg_bytes, &to);
    return to.full ? 0 : to.bytes;
}

/* ---- runs ------------------------------------------------------------------------------------ */

static void forget(struct fv_foxglove_views *views)
{
    for (uint32_t i = 0; i < views->view_count; i++) {
        free(views->views[i].raw);
        free(views->views[i].made);
        views->views[i].raw = views->views[i].made = NULL;
        views->views[i].raw_capacity = views->views[i].made_capacity = 0;
        views->views[i].raw_bytes = views->views[i].made_bytes = 0;
        views->views[i].made_version = views->views[i].version; /* nothing is shown */
    }
    free(views->landmarks);
    free(views->cells);
    views->landmarks = NULL;
    views->cells = NULL;
    views->landmark_slots = 0;
    views->log_first = views->log_count;
    views->time_ns = 0;
    views->pose_state = -1;
    for (int i = 0; i < FOVEA_CAMERAS_MAX; i++)
        views->camera_states[i] = -1;
    views->to_map.map_id = -1;
    memset(views->offsets, 0, sizeof views->offsets);
}

static void no_channels(struct fv_foxglove_views *views)
{
    for (int i = 0; i < FOVEA_CAMERAS_MAX; i++)
        views->image_channels[i] = -1;
    views->log_channel = -1;
}

void fv_foxglove_views_init(struct fv_foxglove_views *views)
{
    memset(views, 0, sizeof *views);
    no_channels(views);
    views->first_id = 1;
    forget(views);
}

void fv_foxglove_views_begin(struct fv_foxglove_views *views, const char *prefix)
{
    char base[FV_FOXGLOVE_TOPIC_BYTES];
    size_t length = (size_t)snprintf(base, sizeof base - 1, "/%s", prefix);
    while (length > 1 && base[length - 1] == '_')
        length--;
    if (length > 1) base[length++] = '/';
    base[length] = '\0';
    for (size_t i = 0; i < length; i++) /* of a stranger, it may be, and it goes into JSON */
        if (base[i] < ' ' || base[i] > '~' || base[i] == '"' || base[i] == '\\') base[i] = '?';
    forget(views);
    if (views->epoch > 0 && strcmp(base, views->base) == 0) return;
    memcpy(views->base, base, length + 1);
    views->epoch++;
    views->first_id += views->channel_count;
    views->channel_count = views->view_count = 0;
    no_channels(views);
    fv_foxglove_views_cameras(views, 1);
    views->log_channel = channel_find(views, "log", NULL, FV_FOXGLOVE_LOG);
}

void fv_foxglove_views_free(struct fv_foxglove_views *views)
{
    forget(views);
    free(views->scratch);
    views->scratch = NULL;
}
