#include <string.h>

#include "base/hash.h"
#include "base/elementary.h"
#include "fovea/odometry.h"
#include "geometry/vec.h"
#include "map/archive.h"

size_t fv_archive_bytes_max(const struct fv_map_limits *limits)
{
    const size_t landmark =
        FV_ARCHIVE_LANDMARK_BYTES + FV_MAP_OBSERVERS_MAX * FV_ARCHIVE_OBSERVER_BYTES;
    const size_t feature =
        FV_ARCHIVE_FEATURE_BYTES + (limits->distances ? FV_ARCHIVE_DISTANCE_BYTES : 0);
    const size_t keyframe = FV_ARCHIVE_KEYFRAME_BYTES + (size_t)limits->features * feature;
    return FV_ARCHIVE_HEADER_BYTES + limits->landmarks * landmark + limits->keyframes * keyframe +
           FV_MAP_EDGES_MAX * FV_ARCHIVE_EDGE_BYTES +
           FV_ARCHIVE_SCALES_MAX * (FV_ARCHIVE_SCALE_BYTES + FV_ARCHIVE_GRAVITY_BYTES) +
           fv_archive_grid_bytes(FV_ARCHIVE_GRID_SIDE_MAX) + FV_ARCHIVE_CHECKSUM_BYTES;
}

/* ---- bytes ----------------------------------------------------------------------------------- */

/* A place in the file; `at` goes on where there is no room, so that sizes do not depend on the
 * buffer. */
struct pen {
    uint8_t *out;
    size_t capacity;
    uint64_t at;
};

static void put(struct pen *pen, uint64_t value, int bytes)
{
    if (pen->out != NULL && pen->at + (uint64_t)bytes <= pen->capacity)
        for (int i = 0; i < bytes; i++)
            pen->out[pen->at + (uint64_t)i] = (uint8_t)(value >> (8 * i));
    pen->at += (uint64_t)bytes;
}

static void put_bytes(struct pen *pen, const uint8_t *from, uint32_t bytes)
{
    if (pen->out != NULL && pen->at + bytes <= pen->capacity)
        memcpy(pen->out + pen->at, from, bytes);
    pen->at += bytes;
}

static void put_float(struct pen *pen, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(pen, bits, 4);
}

static void put_double(struct pen *pen, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(pen, bits, 8);
}

static void put_doubles(struct pen *pen, const double *values, int count)
{
    for (int i = 0; i < count; i++)
        put_double(pen, values[i]);
}

/* ---- records --------------------------------------------------------------------------------- */

static void write_landmark(struct pen *pen, const struct fv_landmark *l, uint32_t slot)
{
    put(pen, slot, 4);
    put(pen, l->generation, 4);
    put_doubles(pen, l->point, 3);
    put_float(pen, l->distance);
    put_float(pen, l->spread);
    for (int i = 0; i < 3; i++)
        put(pen, (uint16_t)l->direction[i], 2);
    put(pen, 0, 2);
    put(pen, l->born, 4);
    put(pen, l->seen, 4);
    put(pen, l->expected, 2);
    put(pen, l->found, 2);
    put(pen, l->level, 1);
    put(pen, l->observer_count, 1);
    put(pen, l->best, 1);
    put(pen, 0, 1);
    for (uint32_t i = 0; i < l->observer_count; i++) {
        put(pen, l->observers[i].keyframe, 2);
        put(pen, l->observers[i].feature, 2);
    }
}

static void write_keyframe(struct pen *pen, const struct fv_keyframe *k, uint32_t slot)
{
    put(pen, slot, 4);
    put(pen, k->generation, 4);
    put(pen, k->number, 8);
    put(pen, (uint64_t)k->stamp_ns, 8);
    put(pen, k->map_id, 4);
    put(pen, (uint32_t)k->parent, 4);
    put_double(pen, k->depth);
    put_doubles(pen, k->T_cam_world.R, 9);
    put_doubles(pen, k->T_cam_world.t, 3);
    put(pen, k->features, 4);
    put(pen, k->held, 4);
}

static void write_feature(struct pen *pen, const struct fv_map *map, uint32_t slot,
                          const struct fv_map_frame *frame, uint32_t f)
{
    const int32_t landmark = frame->landmark[f];
    put(pen, frame->points[f].x, 2);
    put(pen, frame->points[f].y, 2);
    put(pen, frame->points[f].level, 2);
    put(pen, (uint16_t)landmark, 2);
    put(pen, landmark == FV_MAP_NONE ? 0 : map->landmarks[landmark].generation, 4);
    put_bytes(pen, frame->descriptors + (size_t)f * FV_MAP_DESCRIPTOR_BYTES,
              FV_MAP_DESCRIPTOR_BYTES);
    if (map->distances == NULL) return;
    const struct fv_inverse_distance *distance = &fv_map_distances(map, slot)[f];
    put_float(pen, distance->value);
    put_float(pen, distance->weight);
}

static void write_header(struct pen *pen, const struct fv_archive_state *archive,
                         const struct fv_map *map, const struct fovea_camera *camera,
                         uint64_t bytes)
{
    put_bytes(pen, (const uint8_t *)"FOVEAMAP", 8);
    put(pen,
        FV_ARCHIVE_VERSION + (map->distances != NULL ? FV_ARCHIVE_HAS_DISTANCES : 0) +
            (archive->has_grid ? FV_ARCHIVE_HAS_GRID : 0) +
            (archive->gravities > 0 ? FV_ARCHIVE_HAS_GRAVITY : 0),
        4);
    put(pen, 0x01020304, 4);
    put(pen, bytes, 8);
    put(pen, (uint32_t)camera->width, 4);
    put(pen, (uint32_t)camera->height, 4);
    put(pen, (uint32_t)camera->lens, 4);
    put(pen, map->limits.features, 4);
    const double parameters[4] = {camera->fx, camera->fy, camera->cx, camera->cy};
    put_doubles(pen, parameters, 4);
    put_doubles(pen, camera->k, FOVEA_LENS_COEFFICIENTS);
    put(pen, archive->landmarks, 4);
    put(pen, archive->keyframes, 4);
    put(pen, archive->edges, 4);
    put(pen, map->limits.landmarks, 4);
    put(pen, map->limits.keyframes, 4);
    put(pen, map->state->map_id, 4);
    put(pen, map->state->map_next, 4);
    put(pen, archive->scales, 4);
    put(pen, map->state->keyframe_number, 8);
    put(pen, archive->frame_number, 8);
    put(pen, archive->gravities, 4);
    put(pen, 0, 4);
}

/* ---- units ----------------------------------------------------------------------------------- */

void fv_archive_begin(struct fv_archive_state *archive, uint64_t frame_number)
{
    if (fv_archive_busy(archive)) return;
    *archive = (struct fv_archive_state){
        .at = FV_ARCHIVE_HEADER_BYTES, .frame_number = frame_number, .phase = FV_ARCHIVE_LANDMARKS};
}

static void landmarks_unit(struct fv_archive_state *archive, const struct fv_map *map,
                           struct pen *pen)
{
    const uint32_t left = map->limits.landmarks - archive->slot;
    const uint32_t end =
        archive->slot + (left < FV_ARCHIVE_UNIT_LANDMARKS ? left : FV_ARCHIVE_UNIT_LANDMARKS);
    for (; archive->slot < end; archive->slot++) {
        if (!map->landmarks[archive->slot].used) continue;
        write_landmark(pen, &map->landmarks[archive->slot], archive->slot);
        archive->landmarks++;
    }
    if (archive->slot < map->limits.landmarks) return;
    archive->slot = 0;
    archive->feature = UINT32_MAX;
    archive->phase = FV_ARCHIVE_KEYFRAMES;
}

/* A keyframe's record, then its features in pieces. When the keyframe goes meanwhile, so does what
 * was written of it. */
static void keyframes_unit(struct fv_archive_state *archive, const struct fv_map *map,
                           struct pen *pen)
{
    if (archive->feature != UINT32_MAX && !fv_map_holds(map, archive->slot, archive->generation)) {
        pen->at = archive->record_at;
        archive->feature = UINT32_MAX;
        archive->keyframes--;
        archive->slot++;
    }
    if (archive->feature == UINT32_MAX) {
        while (archive->slot < map->limits.keyframes && !map->keyframes[archive->slot].used)
            archive->slot++;
        if (archive->slot == map->limits.keyframes) {
            archive->phase = FV_ARCHIVE_EDGES;
            return;
        }
        archive->record_at = pen->at;
        archive->generation = map->keyframes[archive->slot].generation;
        archive->features = map->keyframes[archive->slot].features;
        archive->feature = 0;
        archive->keyframes++;
        write_keyframe(pen, &map->keyframes[archive->slot], archive->slot);
    }
    const struct fv_map_frame frame = fv_map_frame_at(map, archive->slot);
    const uint32_t left = archive->features - archive->feature;
    const uint32_t end =
        archive->feature + (left < FV_ARCHIVE_UNIT_FEATURES ? left : FV_ARCHIVE_UNIT_FEATURES);
    for (; archive->feature < end; archive->feature++)
        write_feature(pen, map, archive->slot, &frame, archive->feature);
    if (archive->feature < archive->features) return;
    archive->feature = UINT32_MAX;
    archive->slot++;
}

/* Metres per unit of the map, as its points are. */
static void write_scale(struct fv_archive_state *archive, const struct fv_map *map, struct pen *pen,
                        const struct fv_map_odom *odom)
{
    if (odom->scale.source == FOVEA_SCALE_FREE || fv_map_count_keyframes(map, odom->map_id) == 0)
        return;
    put(pen, odom->map_id, 4);
    put(pen, odom->scale.source, 4);
    put_double(pen, odom->scale.log_scale - fv_log(odom->S_map_world.s));
    put_double(pen, odom->scale.variance);
    archive->scales++;
}

static void write_gravity(struct fv_archive_state *archive, const struct fv_map *map,
                          struct pen *pen, const struct fv_map_odom *odom)
{
    double down[3];
    if (!(odom->gravity.sigma > 0) || fv_map_count_keyframes(map, odom->map_id) == 0) return;
    fv_rotate3(odom->S_map_world.R, odom->gravity.down, down);
    put(pen, odom->map_id, 4);
    put(pen, 0, 4);
    put_doubles(pen, down, 3);
    put_double(pen, odom->gravity.sigma);
    archive->gravities++;
}

static void write_each(struct fv_archive_state *archive, const struct fv_map *map, struct pen *pen,
                       void (*write)(struct fv_archive_state *, const struct fv_map *, struct pen *,
                                     const struct fv_map_odom *))
{
    const struct fv_map_state *s = map->state;
    struct fv_map_odom current;
    (void)fv_map_odom_of(map, s->map_id, &current);
    write(archive, map, pen, &current);
    for (uint32_t i = 0; i < FV_MAP_WORLDS_MAX && i < s->left_count; i++)
        if (s->left[i].map_id != s->map_id) write(archive, map, pen, &s->left[i]);
}

/* All counts of the header are known. */
static void end(struct fv_archive_state *archive, const struct fv_map *map,
                const struct fovea_camera *camera, struct pen *pen)
{
    struct pen head = {pen->out, pen->capacity, 0};
    pen->at += FV_ARCHIVE_CHECKSUM_BYTES;
    write_header(&head, archive, map, camera, pen->at);
    archive->phase = FV_ARCHIVE_DONE;
}

static void edges_unit(struct fv_archive_state *archive, const struct fv_map *map,
                       const struct fovea_camera *camera, struct pen *pen)
{
    for (uint32_t i = 0; i < FV_MAP_EDGES_MAX && i < map->state->edge_count; i++) {
        const struct fv_map_edge *e = &map->edges[i];
        if (!fv_map_holds(map, e->a, e->generation_a) || !fv_map_holds(map, e->b, e->generation_b))
            continue;
        put(pen, e->a, 4);
        put(pen, e->b, 4);
        put(pen, e->generation_a, 4);
        put(pen, e->generation_b, 4);
        archive->edges++;
    }
    write_each(archive, map, pen, write_scale);
    write_each(archive, map, pen, write_gravity);
    if (archive->with_grid)
        archive->phase = FV_ARCHIVE_GRID;
    else
        end(archive, map, camera, pen);
}

void fv_archive_unit(struct fv_archive_state *archive, const struct fv_map *map,
                     const struct fovea_camera *camera, uint8_t *out, size_t capacity)
{
    struct pen pen = {out, capacity, archive->at};
    if (archive->phase == FV_ARCHIVE_LANDMARKS)
        landmarks_unit(archive, map, &pen);
    else if (archive->phase == FV_ARCHIVE_KEYFRAMES)
        keyframes_unit(archive, map, &pen);
    else if (archive->phase == FV_ARCHIVE_EDGES)
        edges_unit(archive, map, camera, &pen);
    else if (archive->phase == FV_ARCHIVE_GRID)
        end(archive, map, camera, &pen);
    archive->at = pen.at;
}

/* ---- the grid -------------------------------------------------------------------------------- */

void fv_archive_want_grid(struct fv_archive_state *archive)
{
    archive->with_grid = 1;
}

void fv_archive_grid_head(struct fv_archive_state *archive, const struct fv_archive_grid *grid,
                          uint8_t *out, size_t capacity)
{
    struct pen pen = {out, capacity, archive->at};
    put(&pen, grid->map_id, 4);
    put(&pen, grid->side, 4);
    put_double(&pen, grid->resolution_m);
    put_double(&pen, grid->S_map_grid.s);
    put_doubles(&pen, grid->S_map_grid.R, 9);
    put_doubles(&pen, grid->S_map_grid.t, 3);
    archive->has_grid = 1;
    archive->at = pen.at;
}

void fv_archive_grid_cells(struct fv_archive_state *archive, const int8_t *cells, uint32_t count,
                           uint8_t *out, size_t capacity)
{
    struct pen pen = {out, capacity, archive->at};
    put_bytes(&pen, (const uint8_t *)cells, count);
    archive->at = pen.at;
}

size_t fv_archive_take(struct fv_archive_state *archive)
{
    if (archive->phase != FV_ARCHIVE_DONE) return 0;
    archive->phase = FV_ARCHIVE_IDLE;
    return (size_t)archive->at;
}

void fv_archive_seal(uint8_t *data, size_t bytes)
{
    if (bytes < FV_ARCHIVE_CHECKSUM_BYTES) return;
    struct pen pen = {data, bytes, bytes - FV_ARCHIVE_CHECKSUM_BYTES};
    put(&pen, fv_hash(FV_HASH_START, data, bytes - FV_ARCHIVE_CHECKSUM_BYTES), 8);
}
