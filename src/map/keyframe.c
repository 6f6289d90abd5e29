/* Keyframes and the frames beside them: features in fixed point, sorted into a grid, and the search
 * for features in it. */
#include <string.h>

#include "geometry/pose.h"
#include "geometry/chi_square.h"
#include "geometry/vec.h"
#include "map/map.h"

enum { CANDIDATES_MAX = 96, RAYS_PER_BATCH = 32 };

static const double sigma_px = 1.0; /* of a key point of level 0; a level's scale multiplies it */

struct fv_map_frame fv_map_frame_at(const struct fv_map *map, uint32_t slot)
{
    const size_t first = (size_t)slot * map->limits.features;
    struct fv_map_frame frame = {.keyframe = map->keyframes + slot,
                                 .points = map->points + first,
                                 .descriptors = map->descriptors + first * FV_MAP_DESCRIPTOR_BYTES,
                                 .landmark = map->links + first,
                                 .cells = map->cells +
                                          (size_t)slot * (size_t)(map->columns * map->rows + 1)};
    if (slot >= map->limits.keyframes)
        frame.keypoints =
            map->keypoints + (size_t)(slot - map->limits.keyframes) * map->limits.features;
    return frame;
}

/* ---- the grid -------------------------------------------------------------------------------- */

static int32_t clamp(int32_t v, int32_t low, int32_t high)
{
    return v < low ? low : v > high ? high : v;
}

static int32_t cell_of(const struct fv_map *map, const struct fv_pixel *p)
{
    const int32_t column =
                      clamp((int32_t)(p->x * map->pixel_px) / FV_MAP_CELL_PX, 0, map->columns - 1),
                  row = clamp((int32_t)(p->y * map->pixel_px) / FV_MAP_CELL_PX, 0, map->rows - 1);
    return row * map->columns + column;
}

static uint16_t fixed(const struct fv_map *map, float px)
{
    const double value = (double)px / map->pixel_px + 0.5;
    return value < 0 ? 0 : value > UINT16_MAX ? UINT16_MAX : (uint16_t)value;
}

bool fv_map_index_frame(const struct fv_map *map, uint32_t slot)
{
    const struct fv_map_frame frame = fv_map_frame_at(map, slot);
    const int32_t cells = map->columns * map->rows;
    int32_t cell = 0;
    for (uint32_t f = 0; f < frame.keyframe->features; f++) {
        const int32_t next = cell_of(map, &frame.points[f]);
        if (next < cell - 1) return false;
        for (; cell <= next; cell++)
            frame.cells[cell] = (uint16_t)f;
    }
    for (; cell <= cells; cell++)
        frame.cells[cell] = (uint16_t)frame.keyframe->features;
    return true;
}

/* ---- geometry of features -------------------------------------------------------------------- */

static void set_keypoint(const double bearing[3], const double A[6], uint32_t level,
                         struct fv_keypoint *k)
{
    const double sigma = sigma_px * fv_level_scale(level);
    for (int i = 0; i < 3; i++)
        k->bearing[i] = (float)bearing[i]; /* NOLINT(*NullDereference): no keyframe is filled */
    for (int i = 0; i < 6; i++)
        k->A[i] = (float)A[i];
    k->weight = (float)(1 / (sigma * sigma));
}

bool fv_map_keypoint(const struct fv_map *map, const struct fv_pixel *point,
                     struct fv_keypoint *keypoint)
{
    double bearing[3], A[6];
    if (!fv_bearing_of(map->bearings, map->camera, point->x * map->pixel_px,
                       point->y * map->pixel_px, bearing, A))
        return false;
    set_keypoint(bearing, A, point->level, keypoint);
    return true;
}

/* Rays of some of a frame's features. */
static void some_rays(const struct fv_map *map, const struct fv_pixel *points, uint32_t count,
                      struct fv_ray *rays)
{
    float pixels[RAYS_PER_BATCH][2];
    for (uint32_t i = 0; i < count; i++) {
        pixels[i][0] = (float)(points[i].x * map->pixel_px);
        pixels[i][1] = (float)(points[i].y * map->pixel_px);
    }
    fv_bearings_of(map->bearings, map->camera, pixels, count, rays);
}

void fv_map_keypoints(const struct fv_map *map, const struct fv_pixel *points, uint32_t count,
                      struct fv_keypoint *keypoints)
{
    struct fv_ray rays[RAYS_PER_BATCH];
    for (uint32_t f = 0; f < count;) {
        const uint32_t left = count - f, some = left < RAYS_PER_BATCH ? left : RAYS_PER_BATCH;
        some_rays(map, points + f, some, rays);
        for (uint32_t i = 0; i < some; i++, f++)
            if (rays[i].seen)
                set_keypoint(rays[i].bearing, rays[i].A, points[f].level, &keypoints[f]);
            else
                memset(&keypoints[f], 0, sizeof keypoints[f]);
    }
}

void fv_map_bearings(const struct fv_map *map, uint32_t slot, float (*bearings)[3])
{
    const struct fv_map_frame frame = fv_map_frame_at(map, slot);
    struct fv_ray rays[RAYS_PER_BATCH];
    for (uint32_t f = 0; f < frame.keyframe->features;) {
        const uint32_t left = frame.keyframe->features - f,
                       some = left < RAYS_PER_BATCH ? left : RAYS_PER_BATCH;
        some_rays(map, frame.points + f, some, rays);
        for (uint32_t i = 0; i < some; i++, f++)
            for (int k = 0; k < 3; k++)
                bearings[f][k] = (float)rays[i].bearing[k];
    }
}

double fv_map_error2(const struct fv_map *map, const struct fv_pixel *point, const double q[3])
{
    double b[3], A[6], e[2];
    if (!fv_bearing_of(map->bearings, map->camera, point->x * map->pixel_px,
                       point->y * map->pixel_px, b, A) ||
        !fv_observation_error(b, A, q, e, 0))
        return 1e9;
    const double sigma = sigma_px * fv_level_scale(point->level);
    return (e[0] * e[0] + e[1] * e[1]) / (sigma * sigma);
}

/* ---- filling --------------------------------------------------------------------------------- */

/* Features of the image into a frame of the map, cell by cell. Links are scratch: the cell of each,
 * as they come. */
static void sort_in(const struct fv_map *map, const struct fv_map_frame *frame,
                    const struct fovea_feature *features, const uint8_t *descriptors,
                    uint32_t count, uint16_t *from)
{
    const int32_t cells = map->columns * map->rows;
    memset(frame->cells, 0, (size_t)(cells + 1) * sizeof *frame->cells);
    for (uint32_t i = 0; i < count; i++) {
        const struct fv_pixel p = {fixed(map, features[i].x_px), fixed(map, features[i].y_px), 0,
                                   0};
        frame->landmark[i] = (int16_t)cell_of(map, &p);
        frame->cells[frame->landmark[i] + 1]++;
    }
    for (int32_t c = 0; c < cells; c++)
        frame->cells[c + 1] = (uint16_t)(frame->cells[c + 1] + frame->cells[c]);
    for (uint32_t i = 0; i < count;
         i++) { /* cells move on to their ends, which index_frame mends */
        const uint32_t at = frame->cells[frame->landmark[i]]++;
        frame->points[at] =
            (struct fv_pixel){fixed(map, features[i].x_px), fixed(map, features[i].y_px),
                              (uint8_t)features[i].level, 0};
        memcpy(frame->descriptors + (size_t)at * FV_MAP_DESCRIPTOR_BYTES,
               descriptors + (size_t)i * FV_MAP_DESCRIPTOR_BYTES, FV_MAP_DESCRIPTOR_BYTES);
        if (from != NULL) from[at] = (uint16_t)i;
    }
}

void fv_map_fill_frame(const struct fv_map *map, uint32_t slot,
                       const struct fovea_feature *features, const uint8_t *descriptors,
                       uint32_t count, uint16_t *from)
{
    const struct fv_map_frame frame = fv_map_frame_at(map, slot);
    struct fv_ray rays[RAYS_PER_BATCH];
    uint32_t kept = 0;
    if (count > map->limits.features) count = map->limits.features;
    sort_in(map, &frame, features, descriptors, count, from);
    for (uint32_t f = 0; f < count;) {
        const uint32_t some = count - f < RAYS_PER_BATCH ? count - f : RAYS_PER_BATCH;
        some_rays(map, frame.points + f, some, rays);
        for (uint32_t i = 0; i < some; i++, f++) {
            if (!rays[i].seen) continue;
            set_keypoint(rays[i].bearing, rays[i].A, frame.points[f].level, &frame.keypoints[kept]);
            if (kept != f) {
                frame.points[kept] = frame.points[f];
                memcpy(frame.descriptors + (size_t)kept * FV_MAP_DESCRIPTOR_BYTES,
                       frame.descriptors + (size_t)f * FV_MAP_DESCRIPTOR_BYTES,
                       FV_MAP_DESCRIPTOR_BYTES);
                if (from != NULL) from[kept] = from[f];
            }
            kept++;
        }
    }
    frame.keyframe->features = kept;
    for (uint32_t f = 0; f < kept; f++)
        frame.landmark[f] = FV_MAP_NONE;
    (void)fv_map_index_frame(map, slot);
}

void fv_map_copy_frame(struct fv_map *map, uint32_t from, uint32_t to)
{
    const struct fv_map_frame a = fv_map_frame_at(map, from), b = fv_map_frame_at(map, to);
    const uint32_t generation = b.keyframe->generation + 1, count = a.keyframe->features;
    *b.keyframe = *a.keyframe;
    b.keyframe->generation = generation;
    b.keyframe->landmarks = 0;
    memcpy(b.points, a.points, count * sizeof *b.points);
    memcpy(b.descriptors, a.descriptors, (size_t)count * FV_MAP_DESCRIPTOR_BYTES);
    memcpy(b.cells, a.cells, (size_t)(map->columns * map->rows + 1) * sizeof *b.cells);
    if (map->distances != NULL)
        memcpy(fv_map_distances(map, to), fv_map_distances(map, from),
               count * sizeof *map->distances);
    if (b.keypoints != NULL && a.keypoints != NULL)
        memcpy(b.keypoints, a.keypoints, count * sizeof *b.keypoints);
    for (uint32_t i = 0; i < count; i++)
        b.landmark[i] = FV_MAP_NONE;
}

/* ---- guided search --------------------------------------------------------------------------- */

/* Features of the frame within the square around (x, y); cut at CANDIDATES_MAX. */
static int32_t gather(const struct fv_map *map, const struct fv_map_frame *frame, double x,
                      double y, double radius, int level_min, int level_max, bool only_free,
                      uint16_t *candidates)
{
    const int32_t c0 = clamp((int32_t)(x - radius) / FV_MAP_CELL_PX, 0, map->columns - 1),
                  c1 = clamp((int32_t)(x + radius) / FV_MAP_CELL_PX, 0, map->columns - 1),
                  r0 = clamp((int32_t)(y - radius) / FV_MAP_CELL_PX, 0, map->rows - 1),
                  r1 = clamp((int32_t)(y + radius) / FV_MAP_CELL_PX, 0, map->rows - 1);
    const double square = radius * radius;
    int32_t count = 0;
    for (int32_t r = r0; r <= r1; r++) {
        /* Cells of a row follow each other. */
        const uint32_t first = frame->cells[r * map->columns + c0],
                       last = frame->cells[r * map->columns + c1 + 1];
        for (uint32_t f = first; f < last && count < CANDIDATES_MAX; f++) {
            const struct fv_pixel *p = &frame->points[f];
            const double dx = p->x * map->pixel_px - x, dy = p->y * map->pixel_px - y;
            /* Without branches, which would often be mispredicted. */
            const bool within = !(dx * dx + dy * dy > square),
                       free = frame->landmark[f] == FV_MAP_NONE;
            candidates[count] = (uint16_t)f;
            count += within & ((int)p->level >= level_min) & ((int)p->level <= level_max) &
                     (free | !only_free);
        }
    }
    return count;
}

static struct fv_found nearest(const struct fv_kernels *kernels, const struct fv_map_frame *frame,
                               const uint16_t *candidates, int32_t count, const uint8_t *descriptor)
{
    struct fv_found found = {FV_MAP_NONE, 256, 256};
    uint16_t distances[CANDIDATES_MAX];
    if (count > 0)
        kernels->hamming_some_u8(distances, descriptor, frame->descriptors, candidates, count);
    for (int32_t k = 0; k < count; k++) {
        if (distances[k] < found.distance) {
            found.second = found.distance;
            found.distance = distances[k];
            found.feature = candidates[k];
        } else if (distances[k] < found.second) {
            found.second = distances[k];
        }
    }
    return found;
}

struct fv_found fv_map_search(const struct fv_map *map, const struct fv_kernels *kernels,
                              uint32_t slot, double x_px, double y_px, double radius_px,
                              int level_min, int level_max, const uint8_t *descriptor,
                              bool only_free)
{
    const struct fv_found none = {FV_MAP_NONE, 256, 256};
    uint16_t candidates[CANDIDATES_MAX];
    if (!(x_px > -1e4 && x_px < 1e5 && y_px > -1e4 && y_px < 1e5)) return none;
    const struct fv_map_frame frame = fv_map_frame_at(map, slot);
    const int32_t count =
        gather(map, &frame, x_px, y_px, radius_px, level_min, level_max, only_free, candidates);
    return nearest(kernels, &frame, candidates, count, descriptor);
}

int32_t fv_map_find_landmark(const struct fv_map *map, const struct fv_kernels *kernels,
                             const struct fv_landmark *l, uint32_t keyframe, double radius_px,
                             bool only_free)
{
    const struct fv_map_frame frame = fv_map_frame_at(map, keyframe);
    double q[3], pixel[2];
    for (uint32_t k = 0; k < l->observer_count; k++)
        if (l->observers[k].keyframe == keyframe) return FV_MAP_NONE;
    fv_se3_apply(&frame.keyframe->T_cam_world, l->point, q);
    if (!fv_map_project(map, q, pixel)) return FV_MAP_NONE;
    const int level = fv_map_predict_level(l, fv_norm3(q));
    if (level < 0) return FV_MAP_NONE;
    const struct fv_found found = fv_map_search(
        map, kernels, keyframe, pixel[0], pixel[1], radius_px * fv_level_scale((uint32_t)level),
        level - 1, level + 1, fv_map_descriptor(map, l), only_free);
    if (found.feature == FV_MAP_NONE || found.distance > FV_MAP_FUSE_DISTANCE_MAX ||
        fv_map_error2(map, &frame.points[found.feature], q) > FV_CHI_SQUARE_95_2)
        return FV_MAP_NONE;
    return found.feature;
}

struct fv_found fv_map_search_line(const struct fv_map *map, const struct fv_kernels *kernels,
                                   uint32_t slot, const float (*bearings)[3], const double box[4],
                                   const double normal[3], double limit_rad, int level_min,
                                   int level_max, const uint8_t *descriptor)
{
    uint16_t candidates[CANDIDATES_MAX];
    int32_t count = 0, corner[4];
    for (int i = 0; i < 4; i++) {
        const double margin = i < 2 ? -6 : 6,
                     limit = (i & 1 ? map->rows : map->columns) * FV_MAP_CELL_PX - 1;
        const double v = box[i] + margin;
        corner[i] = (int32_t)(v > 0 ? (v < limit ? v : limit) : 0) / FV_MAP_CELL_PX;
    }
    const struct fv_map_frame frame = fv_map_frame_at(map, slot);
    for (int32_t r = corner[1]; r <= corner[3]; r++) {
        const uint32_t first = frame.cells[r * map->columns + corner[0]],
                       last = frame.cells[r * map->columns + corner[2] + 1];
        for (uint32_t f = first; f < last && count < CANDIDATES_MAX; f++) {
            const int level = frame.points[f].level;
            const double off = normal[0] * (double)bearings[f][0] +
                               normal[1] * (double)bearings[f][1] +
                               normal[2] * (double)bearings[f][2],
                         limit = limit_rad * fv_level_scale((uint32_t)level);
            candidates[count] = (uint16_t)f;
            count += (frame.landmark[f] == FV_MAP_NONE) & (level >= level_min) &
                     (level <= level_max) & !(off * off > limit * limit);
        }
    }
    return nearest(kernels, &frame, candidates, count, descriptor);
}
