#include <string.h>

#include "base/hash.h"
#include "fovea/odometry.h"
#include "geometry/vec.h"
#include "map/archive.h"

/* ---- bytes ----------------------------------------------------------------------------------- */

/* Where reading stands. After the first error nothing is read any more, and values are 0. */
struct reader {
    const uint8_t *data;
    size_t bytes, at; /* bytes: without the checksum */
    const char *name;
    struct fovea_error *error;
    enum fovea_status status;
};

static void refuse(struct reader *r, size_t at, const char *what, int64_t found,
                   const char *expected)
{
    if (r->status != FOVEA_OK) return;
    r->status = fovea_error_set(r->error, FOVEA_ERROR_INPUT,
                                "%.200s: byte %zu: %s: found %lld, expected %s", r->name, at, what,
                                (long long)found, expected);
}

static void refuse_real(struct reader *r, size_t at, const char *what, double found,
                        const char *expected)
{
    if (r->status != FOVEA_OK) return;
    r->status =
        fovea_error_set(r->error, FOVEA_ERROR_INPUT, "%.200s: byte %zu: %s: found %g, expected %s",
                        r->name, at, what, found, expected);
}

static uint64_t get(struct reader *r, int bytes)
{
    uint64_t value = 0;
    if (r->status == FOVEA_OK && r->bytes - r->at < (size_t)bytes)
        refuse(r, r->at, "bytes left", (int64_t)(r->bytes - r->at),
               "more: the counts promise more than there is");
    if (r->status != FOVEA_OK) return 0;
    for (int i = 0; i < bytes; i++)
        value |= (uint64_t)r->data[r->at + (size_t)i] << (8 * i);
    r->at += (size_t)bytes;
    return value;
}

static uint32_t get_u32(struct reader *r)
{
    return (uint32_t)get(r, 4);
}

/* An index below `bound`. */
static uint32_t get_index(struct reader *r, uint32_t bound, const char *what, const char *expected)
{
    const size_t at = r->at;
    const uint32_t value = get_u32(r);
    if (value >= bound) refuse(r, at, what, value, expected);
    return r->status == FOVEA_OK ? value : 0;
}

/* From which a run may count on. */
static uint64_t get_number(struct reader *r, const char *what)
{
    const size_t at = r->at;
    const uint64_t value = get(r, 8);
    if (value >> 62 != 0) refuse(r, at, what, (int64_t)value, "less than 2^62");
    return value;
}

/* Finite and within +-limit. */
static double get_double(struct reader *r, double limit, const char *what)
{
    const size_t at = r->at;
    const uint64_t bits = get(r, 8);
    double value;
    memcpy(&value, &bits, sizeof value);
    if (value >= -limit && value <= limit) return value;
    if (r->status == FOVEA_OK)
        r->status = fovea_error_set(r->error, FOVEA_ERROR_INPUT,
                                    "%.200s: byte %zu: %s: found %g, expected a number within %g",
                                    r->name, at, what, value, limit);
    return 0;
}

static float get_float(struct reader *r, float low, float high, const char *what)
{
    const size_t at = r->at;
    const uint32_t bits = get_u32(r);
    float value;
    memcpy(&value, &bits, sizeof value);
    if (value >= low && value <= high) return value;
    if (r->status == FOVEA_OK)
        r->status = fovea_error_set(r->error, FOVEA_ERROR_INPUT,
                                    "%.200s: byte %zu: %s: found %g, expected %g to %g", r->name,
                                    at, what, (double)value, (double)low, (double)high);
    return 0;
}

static void get_bytes(struct reader *r, uint8_t *to, uint32_t bytes)
{
    if (r->status == FOVEA_OK && r->bytes - r->at < bytes)
        refuse(r, r->at, "bytes left", (int64_t)(r->bytes - r->at),
               "more: the counts promise more than there is");
    if (r->status != FOVEA_OK) return;
    memcpy(to, r->data + r->at, bytes);
    r->at += bytes;
}

/* ---- header ---------------------------------------------------------------------------------- */

enum { SIZE_AT = 16, LANDMARKS_AT = 136, GRAVITIES_AT = 184 };

static bool known_version(uint32_t version)
{
    return version >= FV_ARCHIVE_VERSION && version <= FV_ARCHIVE_VERSION_LAST;
}

/* `what` is one of FV_ARCHIVE_HAS_*. */
static bool version_has(uint32_t version, uint32_t what)
{
    return ((version - FV_ARCHIVE_VERSION) & what) != 0;
}

static void read_envelope(struct reader *r, uint32_t *version_of)
{
    if (r->bytes < FV_ARCHIVE_HEADER_BYTES + FV_ARCHIVE_CHECKSUM_BYTES) {
        refuse(r, r->bytes, "size of the file", (int64_t)r->bytes, "at least 200 bytes of a map");
        return;
    }
    if (memcmp(r->data, "FOVEAMAP", 8) != 0) {
        refuse(r, 0, "first byte", r->data[0], "FOVEAMAP: this is not a map");
        return;
    }
    r->at = 8;
    const uint32_t version = get_u32(r), order = get_u32(r);
    if (order == 0x04030201)
        refuse(r, 12, "byte order mark", order, "that of a little-endian file");
    if (version < FV_ARCHIVE_VERSION)
        refuse(r, 8, "version of the map format", version,
               "3 to 10: only the Fovea before 0.1 that saved it reads it, map the place again");
    else if (version > FV_ARCHIVE_VERSION_LAST)
        refuse(r, 8, "version of the map format", version,
               "3 to 10: a later Fovea saved it and reads it, or map the place again");
    *version_of = version;
    if (order != 0x01020304) refuse(r, 12, "byte order mark", order, "16909060");
    const uint64_t bytes = get(r, 8);
    if (bytes != r->bytes)
        refuse(r, 16, "size stated", (int64_t)bytes,
               "that of the file: it is cut, or something was added");
    if (r->status != FOVEA_OK) return;
    struct reader end = *r;
    end.at = r->bytes - FV_ARCHIVE_CHECKSUM_BYTES;
    const uint64_t stated = get(&end, 8);
    const uint64_t found = fv_hash(FV_HASH_START, r->data, r->bytes - FV_ARCHIVE_CHECKSUM_BYTES);
    if (found != stated) {
        r->status = fovea_error_set(
            r->error, FOVEA_ERROR_INPUT,
            "%.200s: byte %zu: checksum: found %016llx, expected %016llx: the file is damaged",
            r->name, r->bytes - FV_ARCHIVE_CHECKSUM_BYTES, (unsigned long long)found,
            (unsigned long long)stated);
        return;
    }
    r->bytes -= FV_ARCHIVE_CHECKSUM_BYTES;
}

static void read_header(struct reader *r, struct fv_archive_info *info)
{
    struct fovea_camera *camera = &info->camera;
    const char *size = "an image's size", *pool = "the size of a pool";
    camera->width = (int32_t)get_index(r, 65536, "width", size);
    camera->height = (int32_t)get_index(r, 65536, "height", size);
    camera->lens = (enum fovea_lens)get_index(r, 2, "lens", "0 or 1");
    info->features_max = get_index(r, 65536, "features", pool);
    camera->fx = get_double(r, 1e6, "fx");
    camera->fy = get_double(r, 1e6, "fy");
    camera->cx = get_double(r, 1e6, "cx");
    camera->cy = get_double(r, 1e6, "cy");
    for (int i = 0; i < FOVEA_LENS_COEFFICIENTS; i++)
        camera->k[i] = get_double(r, 1e6, "distortion");
    info->landmarks = get_u32(r);
    info->keyframes = get_u32(r);
    info->edges = get_u32(r);
    info->landmark_slots = get_index(r, 1 << 20, "landmark slots", pool);
    info->keyframe_slots = get_index(r, 1 << 12, "keyframe slots", pool);
    info->map_id = get_u32(r);
    info->map_next = get_index(r, UINT32_C(1) << 31, "next map", "less than 2^31");
    info->scales = get_u32(r);
    info->keyframe_number = get_number(r, "next keyframe");
    info->frame_number = get_number(r, "frames");
    info->gravities = version_has(info->version, FV_ARCHIVE_HAS_GRAVITY) ? get_u32(r) : 0;
    r->at = FV_ARCHIVE_HEADER_BYTES;
    if (info->landmarks > info->landmark_slots)
        refuse(r, LANDMARKS_AT, "landmarks", info->landmarks, "at most the slots");
    if (info->keyframes > info->keyframe_slots)
        refuse(r, 140, "keyframes", info->keyframes, "at most the slots");
    if (info->edges > FV_MAP_EDGES_MAX) refuse(r, 144, "edges", info->edges, "at most 128");
    if (info->scales > FV_ARCHIVE_SCALES_MAX) refuse(r, 164, "scales", info->scales, "at most 9");
    if (info->gravities > FV_ARCHIVE_SCALES_MAX)
        refuse(r, GRAVITIES_AT, "gravities", info->gravities, "at most 9");
}

bool fv_archive_outline(const uint8_t *header, uint64_t bytes, struct fv_archive_outline *outline)
{
    struct reader r = {.data = header, .bytes = FV_ARCHIVE_HEADER_BYTES, .at = 8};
    if (memcmp(header, "FOVEAMAP", 8) != 0) return false;
    const uint32_t version = get_u32(&r);
    if (!known_version(version)) return false;
    r.at = SIZE_AT;
    if (get(&r, 8) != bytes) return false;
    r.at = LANDMARKS_AT;
    *outline = (struct fv_archive_outline){get_u32(&r), version_has(version, FV_ARCHIVE_HAS_GRID)};
    return true;
}

enum fovea_status fv_archive_info(const uint8_t *data, size_t bytes, const char *name,
                                  struct fv_archive_info *info, struct fovea_error *error)
{
    struct reader r = {data, bytes, 0, name, error, FOVEA_OK};
    memset(info, 0, sizeof *info);
    read_envelope(&r, &info->version);
    if (r.status == FOVEA_OK) read_header(&r, info);
    return r.status;
}

/* ---- records --------------------------------------------------------------------------------- */

static void read_landmark(struct reader *r, struct fv_map *map)
{
    const size_t at = r->at;
    const uint32_t slot =
        get_index(r, map->limits.landmarks, "landmark slot",
                  "less than odometry.landmarks: raise it to that of the run that saved the map");
    struct fv_landmark *l = &map->landmarks[slot];
    if (l->used) refuse(r, at, "landmark slot", slot, "one that comes once");
    if (r->status != FOVEA_OK) return;
    l->generation = get_u32(r);
    for (int i = 0; i < 3; i++)
        l->point[i] = get_double(r, 1e12, "coordinate");
    l->distance = get_float(r, 0, 1e12F, "distance");
    l->spread = get_float(r, 0, 4, "spread");
    for (int i = 0; i < 3; i++)
        l->direction[i] = (int16_t)get(r, 2);
    (void)get(r, 2);
    l->born = get_u32(r);
    l->seen = get_u32(r);
    l->expected = (uint16_t)get(r, 2);
    l->found = (uint16_t)get(r, 2);
    const uint32_t level = (uint32_t)get(r, 1), observers = (uint32_t)get(r, 1),
                   best = (uint32_t)get(r, 1);
    (void)get(r, 1);
    if (level >= FOVEA_PYRAMID_LEVELS_MAX) refuse(r, at + 60, "level", level, "at most 7");
    if (observers > FV_MAP_OBSERVERS_MAX) refuse(r, at + 61, "observers", observers, "at most 12");
    if (best > 0 && best >= observers)
        refuse(r, at + 62, "best observer", best, "less than the observers");
    for (uint32_t i = 0; i < observers && r->status == FOVEA_OK; i++) {
        const size_t here = r->at;
        l->observers[i].keyframe = (uint16_t)get(r, 2);
        l->observers[i].feature = (uint16_t)get(r, 2);
        if (l->observers[i].keyframe >= map->limits.keyframes)
            refuse(r, here, "keyframe slot", l->observers[i].keyframe,
                   "less than odometry.keyframes: raise it to that of the run that saved the map");
    }
    if (r->status != FOVEA_OK) return;
    l->level = (uint8_t)level;
    l->observer_count = (uint8_t)observers;
    l->best = (uint8_t)best;
    l->used = true;
    map->state->landmark_count++;
}

static void refuse_rotation(struct reader *r, size_t at, const char *what, double found,
                            int expected)
{
    if (r->status != FOVEA_OK) return;
    r->status = fovea_error_set(r->error, FOVEA_ERROR_INPUT,
                                "%.200s: byte %zu: %s of a rotation: found %.6g, expected %d",
                                r->name, at, what, found, expected);
}

static void read_rotation(struct reader *r, double R[9])
{
    static const char *const products[3][3] = {
        {"product of rows 0 and 0", "product of rows 0 and 1", "product of rows 0 and 2"},
        {"", "product of rows 1 and 1", "product of rows 1 and 2"},
        {"", "", "product of rows 2 and 2"}};
    const size_t at = r->at;
    double across[3];
    for (int i = 0; i < 9; i++)
        R[i] = get_double(r, 1.001, "rotation");
    for (int a = 0; a < 3; a++)
        for (int b = a; b < 3; b++) {
            const double product = fv_dot3(R + 3 * a, R + 3 * b), off = product - (a == b);
            if (off > 1e-6 || off < -1e-6) refuse_rotation(r, at, products[a][b], product, a == b);
        }
    fv_cross3(R, R + 3, across);
    if (fv_dot3(across, R + 6) < 0) refuse_rotation(r, at, "determinant", -1, 1);
}

static void read_translation(struct reader *r, double t[3])
{
    for (int i = 0; i < 3; i++)
        t[i] = get_double(r, 1e12, "translation");
}

/* Of a map whose features have none, they are read and left. */
static void read_distance(struct reader *r, struct fv_inverse_distance *distance)
{
    const float value = get_float(r, -1e9F, 1e9F, "inverse distance"),
                weight = get_float(r, 0, 1e30F, "weight of a distance");
    if (distance != NULL) *distance = (struct fv_inverse_distance){value, weight};
}

static void read_features(struct reader *r, struct fv_map *map, uint32_t slot, bool measured)
{
    struct fv_inverse_distance *distances = fv_map_distances(map, slot);
    struct fv_map_frame frame = fv_map_frame_at(map, slot);
    const size_t first = r->at;
    for (uint32_t f = 0; f < frame.keyframe->features && r->status == FOVEA_OK; f++) {
        const size_t at = r->at;
        const uint16_t x = (uint16_t)get(r, 2), y = (uint16_t)get(r, 2);
        const uint32_t level = (uint32_t)get(r, 2), landmark = (uint32_t)get(r, 2),
                       generation = get_u32(r);
        struct fv_keypoint keypoint;
        get_bytes(r, frame.descriptors + (size_t)f * FV_MAP_DESCRIPTOR_BYTES,
                  FV_MAP_DESCRIPTOR_BYTES);
        if (distances != NULL) distances[f] = (struct fv_inverse_distance){0, 0};
        if (measured) read_distance(r, distances != NULL ? &distances[f] : NULL);
        if (level >= FOVEA_PYRAMID_LEVELS_MAX) refuse(r, at + 4, "level", level, "at most 7");
        frame.points[f] = (struct fv_pixel){x, y, (uint8_t)level, 0};
        if (r->status == FOVEA_OK && !fv_map_keypoint(map, &frame.points[f], &keypoint))
            refuse(r, at, "feature", f, "a pixel that the lens model knows");
        const bool holds = landmark < map->limits.landmarks && map->landmarks[landmark].used &&
                           map->landmarks[landmark].generation == generation;
        frame.landmark[f] = holds ? (int16_t)landmark : FV_MAP_NONE;
    }
    if (r->status == FOVEA_OK && !fv_map_index_frame(map, slot))
        refuse(r, first, "features of keyframe", slot, "them cell by cell of the grid");
}

static void read_keyframe(struct reader *r, struct fv_map *map, bool measured)
{
    const size_t at = r->at;
    const uint32_t slot =
        get_index(r, map->limits.keyframes, "keyframe slot",
                  "less than odometry.keyframes: raise it to that of the run that saved the map");
    struct fv_keyframe *k = &map->keyframes[slot];
    if (k->used) refuse(r, at, "keyframe slot", slot, "one that comes once");
    if (r->status != FOVEA_OK) return;
    k->generation = get_u32(r);
    k->number = get(r, 8);
    k->stamp_ns = (int64_t)get(r, 8);
    k->map_id = get_u32(r);
    k->parent = (int32_t)get_u32(r);
    k->depth = get_double(r, 1e12, "depth");
    read_rotation(r, k->T_cam_world.R);
    read_translation(r, k->T_cam_world.t);
    const size_t features_at = r->at;
    const uint32_t features = get_u32(r);
    k->held = get_u32(r) != 0;
    if (features > map->limits.features)
        refuse(r, features_at, "features", features,
               "at most features.count_max: raise it to that of the run that saved the map");
    if (k->number >= map->state->keyframe_number)
        refuse(r, at + 8, "number", (int64_t)k->number, "less than that of the next keyframe");
    if (!(k->depth > 0)) refuse(r, at + 32, "depth", 0, "more than 0");
    if (k->map_id >= map->state->map_next)
        refuse(r, at + 24, "map", k->map_id, "less than the next map's");
    if (r->status != FOVEA_OK) return;
    k->features = features;
    k->used = true;
    map->state->keyframe_count++;
    read_features(r, map, slot, measured);
}

static void read_edge(struct reader *r, struct fv_map *map)
{
    struct fv_map_edge e;
    e.a =
        get_index(r, map->limits.keyframes, "keyframe of an edge", "less than odometry.keyframes");
    e.b =
        get_index(r, map->limits.keyframes, "keyframe of an edge", "less than odometry.keyframes");
    e.generation_a = get_u32(r);
    e.generation_b = get_u32(r);
    if (r->status == FOVEA_OK && fv_map_holds(map, e.a, e.generation_a) &&
        fv_map_holds(map, e.b, e.generation_b) && e.a != e.b)
        fv_map_add_edge(map, e.a, e.b);
}

/* What a loaded map that is not the current one has of an `odom` frame; `what` names the record at
 * `at`. NULL: there is no room. */
static struct fv_map_odom *left_of(struct reader *r, struct fv_map_state *s, uint32_t map_id,
                                   size_t at, const char *what)
{
    for (uint32_t i = 0; i < s->left_count; i++)
        if (s->left[i].map_id == map_id) return &s->left[i];
    if (s->left_count == FV_MAP_WORLDS_MAX) {
        refuse(r, at, what, map_id, "the current one among nine");
        return NULL;
    }
    s->left[s->left_count] = (struct fv_map_odom){.map_id = map_id, .odom_id = map_id};
    fv_sim3_identity(&s->left[s->left_count].S_map_world);
    return &s->left[s->left_count++];
}

/* Each loaded map has an `odom` frame of its own, that is its world. */
static void read_scale(struct reader *r, struct fv_map *map)
{
    struct fv_map_state *s = map->state;
    const size_t at = r->at;
    const uint32_t map_id = get_index(r, s->map_next, "map of a scale", "less than the next map's");
    struct fv_map_scale scale = {.source = get_u32(r)}, *kept = &s->scale;
    scale.log_scale = get_double(r, 30, "logarithm of a scale");
    scale.variance = get_double(r, 1e3, "variance of a scale");
    if (scale.source < FOVEA_SCALE_CAMERA_HEIGHT || scale.source > FOVEA_SCALE_INERTIAL)
        refuse(r, at + 4, "source of a scale", scale.source, "1 to 4");
    if (!(scale.variance > 0)) refuse(r, at + 16, "variance of a scale", 0, "more than 0");
    if (r->status == FOVEA_OK && map_id != s->map_id) {
        struct fv_map_odom *odom = left_of(r, s, map_id, at, "map of a scale");
        kept = odom != NULL ? &odom->scale : NULL;
    }
    if (r->status != FOVEA_OK || kept == NULL) return;
    if (kept->source != FOVEA_SCALE_FREE)
        refuse(r, at, "map of a scale", map_id, "one that comes once");
    else
        *kept = scale;
}

static void read_gravity(struct reader *r, struct fv_map *map)
{
    struct fv_map_state *s = map->state;
    const size_t at = r->at;
    const uint32_t map_id =
        get_index(r, s->map_next, "map of a gravity", "less than the next map's");
    struct fv_map_gravity gravity, *kept = &s->gravity;
    const uint32_t reserved = get_u32(r);
    if (reserved != 0) refuse(r, at + 4, "reserved bytes of a gravity", reserved, "0");
    for (int i = 0; i < 3; i++)
        gravity.down[i] = get_double(r, 1.001, "direction of gravity");
    gravity.sigma = get_double(r, FV_PI, "standard deviation of gravity");
    const double off = fv_dot3(gravity.down, gravity.down) - 1;
    if (r->status == FOVEA_OK && (off > 1e-6 || off < -1e-6))
        refuse_real(r, at + 8, "square of gravity's direction", off + 1, "1: a unit vector");
    if (r->status == FOVEA_OK && !(gravity.sigma > 0))
        refuse_real(r, at + 32, "standard deviation of gravity", gravity.sigma, "more than 0");
    if (r->status == FOVEA_OK && map_id != s->map_id) {
        struct fv_map_odom *odom = left_of(r, s, map_id, at, "map of a gravity");
        kept = odom != NULL ? &odom->gravity : NULL;
    }
    if (r->status != FOVEA_OK || kept == NULL) return;
    if (kept->sigma > 0)
        refuse(r, at, "map of a gravity", map_id, "one that comes once");
    else
        *kept = gravity;
}

/* Its cells stay where they are in the file. */
static void read_grid(struct reader *r, const struct fv_map *map, struct fv_archive_info *info)
{
    struct fv_archive_grid grid;
    const size_t at = r->at;
    grid.map_id = get_index(r, map->state->map_next, "map of the grid", "less than the next map's");
    grid.side = get_u32(r);
    grid.resolution_m = get_double(r, 1, "side of a cell");
    grid.S_map_grid.s = get_double(r, 1e9, "scale of the grid");
    read_rotation(r, grid.S_map_grid.R);
    read_translation(r, grid.S_map_grid.t);
    if (grid.side < FV_ARCHIVE_GRID_SIDE_MIN || grid.side > FV_ARCHIVE_GRID_SIDE_MAX)
        refuse(r, at + 4, "side of the grid", grid.side, "16 to 512 cells");
    if (!(grid.resolution_m >= 0.02))
        refuse_real(r, at + 8, "side of a cell", grid.resolution_m, "0.02 to 1 m");
    if (!(grid.S_map_grid.s >= 1e-9))
        refuse_real(r, at + 16, "scale of the grid", grid.S_map_grid.s, "more than 0");
    const size_t cells = (size_t)grid.side * grid.side;
    if (r->status == FOVEA_OK && r->bytes - r->at < cells)
        refuse(r, r->at, "bytes left", (int64_t)(r->bytes - r->at),
               "more: the grid has more cells than there are");
    for (size_t i = 0; i < cells && r->status == FOVEA_OK; i++)
        if (!fv_archive_cell((int8_t)r->data[r->at + i]))
            refuse(r, r->at + i, "cell of the grid", (int8_t)r->data[r->at + i],
                   "-1, 0 to 34 or 66 to 100");
    if (r->status != FOVEA_OK) return;
    info->grid = grid;
    info->grid_at = r->at;
    r->at += cells;
}

/* ---- the whole file -------------------------------------------------------------------------- */

static bool same_camera(const struct fovea_camera *a, const struct fovea_camera *b)
{
    bool same = a->width == b->width && a->height == b->height && a->lens == b->lens;
    const double p[4] = {a->fx, a->fy, a->cx, a->cy}, q[4] = {b->fx, b->fy, b->cx, b->cy};
    for (int i = 0; i < 4; i++)
        same = same && p[i] - q[i] < 1e-6 && q[i] - p[i] < 1e-6;
    for (int i = 0; i < FOVEA_LENS_COEFFICIENTS; i++)
        same = same && a->k[i] - b->k[i] < 1e-9 && b->k[i] - a->k[i] < 1e-9;
    return same;
}

enum fovea_status fv_archive_read(const uint8_t *data, size_t bytes, const char *name,
                                  struct fv_map *map, struct fv_archive_info *info,
                                  struct fovea_error *error)
{
    const struct fovea_camera *camera = map->camera;
    struct reader r = {data, bytes, FV_ARCHIVE_HEADER_BYTES,
                       name, error, fv_archive_info(data, bytes, name, info, error)};
    if (r.status != FOVEA_OK) return r.status;
    r.bytes -= FV_ARCHIVE_CHECKSUM_BYTES;
    if (!same_camera(&info->camera, camera))
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%.200s: byte 24: camera: found %d x %d with f %.6g %.6g c %.6g %.6g, expected this run's %d x %d with f %.6g %.6g c %.6g %.6g and its distortion",
            name, info->camera.width, info->camera.height, info->camera.fx, info->camera.fy,
            info->camera.cx, info->camera.cy, camera->width, camera->height, camera->fx, camera->fy,
            camera->cx, camera->cy);
    fv_map_reset(map);
    map->state->keyframe_number = info->keyframe_number;
    map->state->map_id = map->state->odom_id = info->map_id;
    map->state->map_next = info->map_next;
    if (info->map_id >= info->map_next)
        refuse(&r, 156, "map", info->map_id, "less than the next map's");
    for (uint32_t i = 0; i < info->landmarks && r.status == FOVEA_OK; i++)
        read_landmark(&r, map);
    for (uint32_t i = 0; i < info->keyframes && r.status == FOVEA_OK; i++)
        read_keyframe(&r, map, version_has(info->version, FV_ARCHIVE_HAS_DISTANCES));
    for (uint32_t i = 0; i < info->edges && r.status == FOVEA_OK; i++)
        read_edge(&r, map);
    for (uint32_t i = 0; i < info->scales && r.status == FOVEA_OK; i++)
        read_scale(&r, map);
    for (uint32_t i = 0; i < info->gravities && r.status == FOVEA_OK; i++)
        read_gravity(&r, map);
    if (version_has(info->version, FV_ARCHIVE_HAS_GRID)) read_grid(&r, map, info);
    if (r.at != r.bytes) refuse(&r, r.at, "bytes left", (int64_t)(r.bytes - r.at), "none");
    if (r.status == FOVEA_OK)
        fv_archive_mend(map);
    else
        fv_map_reset(map);
    if (r.status != FOVEA_OK) info->grid.side = 0;
    return r.status;
}
