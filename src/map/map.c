#include "map/map.h"

#include <string.h>

#include "geometry/vec.h"

void fv_map_carve(struct fv_map *map, const struct fv_map_limits *limits, struct fv_arena *arena)
{
    map->limits = *limits;
    map->columns = (limits->width + FV_MAP_CELL_PX - 1) / FV_MAP_CELL_PX;
    map->rows = (limits->height + FV_MAP_CELL_PX - 1) / FV_MAP_CELL_PX;
    size_t views = fv_map_view_count(map), features = views * limits->features;
    map->state = fv_arena_take(arena, 1, sizeof *map->state);
    map->keyframes = fv_arena_take(arena, views, sizeof *map->keyframes);
    map->landmarks = fv_arena_take(arena, limits->landmarks, sizeof *map->landmarks);
    map->free_landmarks = fv_arena_take(arena, limits->landmarks, sizeof *map->free_landmarks);
    map->edges = fv_arena_take(arena, FV_MAP_EDGES_MAX, sizeof *map->edges);
    map->keypoints = fv_arena_take(arena, features, sizeof *map->keypoints);
    map->descriptors = fv_arena_take(arena, features, FV_MAP_DESCRIPTOR_BYTES);
    map->links = fv_arena_take(arena, features, sizeof *map->links);
    map->order = fv_arena_take(arena, features, sizeof *map->order);
    map->cells = fv_arena_take(arena, views * (size_t)(map->columns * map->rows + 1), sizeof *map->cells);
}

void fv_map_reset(struct fv_map *map)
{
    for (uint32_t i = 0; i < fv_map_view_count(map); i++) {
        uint32_t generation = map->keyframes[i].generation + 1;
        memset(&map->keyframes[i], 0, sizeof *map->keyframes);
        map->keyframes[i].generation = generation;
        map->keyframes[i].parent = FV_MAP_NONE;
    }
    for (uint32_t i = 0; i < map->limits.landmarks; i++) {
        uint32_t generation = map->landmarks[i].generation + 1;
        memset(&map->landmarks[i], 0, sizeof *map->landmarks);
        map->landmarks[i].generation = generation;
        map->free_landmarks[i] = map->limits.landmarks - 1 - i;
    }
    memset(map->edges, 0, FV_MAP_EDGES_MAX * sizeof *map->edges);
    uint32_t map_id = map->state->map_next;
    uint64_t keyframe_number = map->state->keyframe_number; /* goes on: numbers name keyframes in messages */
    memset(map->state, 0, sizeof *map->state);
    map->state->free_count = map->limits.landmarks;
    map->state->keyframe_number = keyframe_number;
    map->state->map_id = map->state->odom_id = map_id;
    map->state->map_next = map_id + 1;
    fv_sim3_identity(&map->state->S_map_odom);
}

struct fv_view fv_map_view(const struct fv_map *map, uint32_t slot)
{
    size_t first = (size_t)slot * map->limits.features;
    struct fv_view view = {.frame = map->keyframes + slot,
                           .points = map->keypoints + first,
                           .descriptors = map->descriptors + first * FV_MAP_DESCRIPTOR_BYTES,
                           .landmark = map->links + first,
                           .order = map->order + first,
                           .cells = map->cells + (size_t)slot * (size_t)(map->columns * map->rows + 1)};
    return view;
}

static int32_t fv_clamp(int32_t v, int32_t low, int32_t high)
{
    return v < low ? low : v > high ? high : v;
}

static int32_t fv_cell_of(const struct fv_map *map, const struct fv_keypoint *p)
{
    int32_t column = fv_clamp((int32_t)p->x_px / FV_MAP_CELL_PX, 0, map->columns - 1);
    int32_t row = fv_clamp((int32_t)p->y_px / FV_MAP_CELL_PX, 0, map->rows - 1);
    return row * map->columns + column;
}

static const double sigma_px = 1.0; /* of a key point of level 0; a level's scale multiplies it */

bool fv_map_set_keypoint(struct fv_keypoint *p, const struct fv_bearing_table *bearings,
                         const struct fovea_camera *camera, float x_px, float y_px, uint32_t level)
{
    double bearing[3], A[6], scale = sigma_px * fv_level_scale(level);
    if (!fv_bearing_of(bearings, camera, (double)x_px, (double)y_px, bearing, A)) return false;
    for (int k = 0; k < 3; k++)
        p->bearing[k] = (float)bearing[k];
    for (int k = 0; k < 6; k++)
        p->A[k] = (float)A[k];
    p->x_px = x_px;
    p->y_px = y_px;
    p->weight = (float)(1 / (scale * scale));
    p->level = level;
    return true;
}

void fv_map_sort_view(const struct fv_map *map, uint32_t slot)
{
    struct fv_view view = fv_map_view(map, slot);
    int32_t cells = map->columns * map->rows;
    memset(view.cells, 0, (size_t)(cells + 1) * sizeof *view.cells);
    for (uint32_t i = 0; i < view.frame->features; i++)
        view.cells[fv_cell_of(map, &view.points[i]) + 1]++;
    for (int32_t c = 0; c < cells; c++)
        view.cells[c + 1] = (uint16_t)(view.cells[c + 1] + view.cells[c]);
    /* Place from the back, moving each cell's end down to its start, then mend the ends. */
    for (uint32_t i = view.frame->features; i-- > 0;)
        view.order[--view.cells[fv_cell_of(map, &view.points[i]) + 1]] = (uint16_t)i;
    for (int32_t c = 0; c < cells; c++)
        view.cells[c] = view.cells[c + 1];
    view.cells[cells] = (uint16_t)view.frame->features;
}

void fv_map_copy_view(struct fv_map *map, uint32_t from, uint32_t to)
{
    struct fv_view a = fv_map_view(map, from), b = fv_map_view(map, to);
    uint32_t generation = b.frame->generation + 1, count = a.frame->features;
    *b.frame = *a.frame;
    b.frame->generation = generation;
    b.frame->landmarks = 0;
    memcpy(b.points, a.points, count * sizeof *b.points);
    memcpy(b.descriptors, a.descriptors, (size_t)count * FV_MAP_DESCRIPTOR_BYTES);
    memcpy(b.order, a.order, count * sizeof *b.order);
    memcpy(b.cells, a.cells, (size_t)(map->columns * map->rows + 1) * sizeof *b.cells);
    for (uint32_t i = 0; i < count; i++)
        b.landmark[i] = FV_MAP_NONE;
}

/* ---- keyframes --------------------------------------------------------------------------------------- */

uint32_t fv_map_add_keyframe(struct fv_map *map, uint32_t from)
{
    if (map->state->keyframe_count == map->limits.keyframes)
        fv_map_remove_keyframe(map, fv_map_most_redundant(map));
    uint32_t slot = 0;
    while (map->keyframes[slot].used)
        slot++;
    fv_map_copy_view(map, from, slot);
    map->keyframes[slot].used = true;
    map->keyframes[slot].held = false;
    map->keyframes[slot].redundancy = 0;
    map->keyframes[slot].map_id = map->state->map_id;
    map->keyframes[slot].number = map->state->keyframe_number++;
    map->state->keyframe_count++;
    return slot;
}

void fv_map_remove_keyframe(struct fv_map *map, uint32_t slot)
{
    struct fv_view view = fv_map_view(map, slot);
    for (uint32_t i = 0; i < view.frame->features; i++) {
        int32_t landmark = view.landmark[i];
        if (landmark == FV_MAP_NONE) continue;
        fv_map_unlink(map, (uint32_t)landmark, slot);
        if (map->landmarks[landmark].observer_count == 0) fv_map_remove_landmark(map, (uint32_t)landmark);
    }
    for (uint32_t i = 0; i < fv_map_view_count(map); i++) /* children hang on to the grandparent */
        if (map->keyframes[i].parent == (int32_t)slot) map->keyframes[i].parent = view.frame->parent;
    view.frame->used = false;
    view.frame->generation++;
    view.frame->features = 0;
    map->state->keyframe_count--;
}

/* ---- landmarks --------------------------------------------------------------------------------------- */

int32_t fv_map_add_landmark(struct fv_map *map, const double point[3], uint64_t frame_number)
{
    if (map->state->free_count == 0) return FV_MAP_NONE;
    uint32_t slot = map->free_landmarks[--map->state->free_count];
    struct fv_landmark *l = &map->landmarks[slot];
    uint32_t generation = l->generation + 1;
    memset(l, 0, sizeof *l);
    l->generation = generation;
    l->used = true;
    l->born = l->seen = frame_number;
    l->expected = l->found = 1;
    fv_copy3(point, l->point);
    map->state->landmark_count++;
    if (slot >= map->state->landmark_top) map->state->landmark_top = slot + 1;
    return (int32_t)slot;
}

void fv_map_remove_landmark(struct fv_map *map, uint32_t landmark)
{
    struct fv_landmark *l = &map->landmarks[landmark];
    while (l->observer_count > 0)
        fv_map_unlink(map, landmark, l->observers[l->observer_count - 1].keyframe);
    l->used = false;
    l->generation++;
    map->free_landmarks[map->state->free_count++] = landmark;
    map->state->landmark_count--;
}

bool fv_map_link(struct fv_map *map, uint32_t landmark, uint32_t keyframe, uint32_t feature)
{
    struct fv_landmark *l = &map->landmarks[landmark];
    struct fv_view view = fv_map_view(map, keyframe);
    if (view.landmark[feature] != FV_MAP_NONE) return false;
    for (uint32_t i = 0; i < l->observer_count; i++)
        if (l->observers[i].keyframe == keyframe) return false;
    if (l->observer_count == FV_MAP_OBSERVERS_MAX) fv_map_unlink(map, landmark, l->observers[1].keyframe);
    struct fv_observer observer = {(uint16_t)keyframe, (uint16_t)feature};
    l->observers[l->observer_count++] = observer;
    view.landmark[feature] = (int32_t)landmark;
    view.frame->landmarks++;
    return true;
}

void fv_map_unlink(struct fv_map *map, uint32_t landmark, uint32_t keyframe)
{
    struct fv_landmark *l = &map->landmarks[landmark];
    for (uint32_t i = 0; i < l->observer_count; i++) {
        if (l->observers[i].keyframe != keyframe) continue;
        struct fv_view view = fv_map_view(map, keyframe);
        view.landmark[l->observers[i].feature] = FV_MAP_NONE;
        view.frame->landmarks--;
        l->observer_count--;
        for (uint32_t k = i; k < l->observer_count; k++)
            l->observers[k] = l->observers[k + 1];
        return;
    }
}

void fv_map_fuse_landmarks(struct fv_map *map, uint32_t keep, uint32_t drop)
{
    struct fv_landmark *from = &map->landmarks[drop], *to = &map->landmarks[keep];
    while (from->observer_count > 0) {
        struct fv_observer o = from->observers[from->observer_count - 1];
        fv_map_unlink(map, drop, o.keyframe);
        if (to->observer_count < FV_MAP_OBSERVERS_MAX) (void)fv_map_link(map, keep, o.keyframe, o.feature);
    }
    to->found = (uint16_t)(to->found + from->found / 2);
    if (to->expected < to->found) to->expected = to->found;
    if (to->seen < from->seen) to->seen = from->seen;
    fv_map_remove_landmark(map, drop);
    fv_map_refresh_landmark(map, keep);
}

static uint32_t fv_hamming(const uint8_t *a, const uint8_t *b)
{
    uint32_t distance = 0;
    for (int i = 0; i < FV_MAP_DESCRIPTOR_BYTES; i += 8) {
        uint64_t x, y;
        memcpy(&x, a + i, 8);
        memcpy(&y, b + i, 8);
        x ^= y;
        x -= (x >> 1) & 0x5555555555555555u;
        x = (x & 0x3333333333333333u) + ((x >> 2) & 0x3333333333333333u);
        x = (x + (x >> 4)) & 0x0f0f0f0f0f0f0f0fu;
        distance += (uint32_t)((x * 0x0101010101010101u) >> 56);
    }
    return distance;
}

static const uint8_t *fv_observed_descriptor(const struct fv_map *map, struct fv_observer o)
{
    return map->descriptors +
           ((size_t)o.keyframe * map->limits.features + o.feature) * FV_MAP_DESCRIPTOR_BYTES;
}

void fv_map_refresh_landmark(struct fv_map *map, uint32_t landmark)
{
    struct fv_landmark *l = &map->landmarks[landmark];
    double mean[3] = {0};
    uint32_t best = 0, best_sum = UINT32_MAX;
    for (uint32_t i = 0; i < l->observer_count; i++) {
        struct fv_view view = fv_map_view(map, l->observers[i].keyframe);
        double q[3], ray[3];
        fv_se3_apply(&view.frame->T_cam_world, l->point, q);
        double distance = fv_norm3(q);
        if (i == 0) {
            l->distance = (float)distance;
            l->level = (uint8_t)view.points[l->observers[0].feature].level;
        }
        fv_rotate_back3(view.frame->T_cam_world.R, q, ray);
        for (int k = 0; k < 3; k++)
            mean[k] += ray[k] / (distance > 1e-12 ? distance : 1e-12);
        uint32_t sum = 0;
        for (uint32_t j = 0; j < l->observer_count; j++)
            sum += fv_hamming(fv_observed_descriptor(map, l->observers[i]),
                              fv_observed_descriptor(map, l->observers[j]));
        if (sum < best_sum) {
            best_sum = sum;
            best = i;
        }
    }
    if (l->observer_count == 0) return;
    /* Of unit rays spread by the angle s, the mean is 1 - s^2 / 2 long. */
    double shorter = 1 - fv_norm3(mean) / l->observer_count;
    l->spread = (float)__builtin_sqrt(shorter > 0 ? 2 * shorter : 0);
    (void)fv_normalise3(mean);
    for (int k = 0; k < 3; k++)
        l->direction[k] = (float)mean[k];
    memcpy(l->descriptor, fv_observed_descriptor(map, l->observers[best]), FV_MAP_DESCRIPTOR_BYTES);
}

/* ---- guided search ----------------------------------------------------------------------------------- */

enum { CANDIDATES_MAX = 96 };

/* Features of the view within the square around (x, y); cut at CANDIDATES_MAX. */
static int32_t fv_gather(const struct fv_map *map, const struct fv_view *view, double x, double y,
                         double radius, int level_min, int level_max, bool only_free, uint16_t *candidates)
{
    int32_t c0 = fv_clamp((int32_t)(x - radius) / FV_MAP_CELL_PX, 0, map->columns - 1);
    int32_t c1 = fv_clamp((int32_t)(x + radius) / FV_MAP_CELL_PX, 0, map->columns - 1);
    int32_t r0 = fv_clamp((int32_t)(y - radius) / FV_MAP_CELL_PX, 0, map->rows - 1);
    int32_t r1 = fv_clamp((int32_t)(y + radius) / FV_MAP_CELL_PX, 0, map->rows - 1);
    int32_t count = 0;
    for (int32_t r = r0; r <= r1; r++) {
        /* Cells of a row follow each other in `order`. */
        uint32_t first = view->cells[r * map->columns + c0], last = view->cells[r * map->columns + c1 + 1];
        for (uint32_t k = first; k < last && count < CANDIDATES_MAX; k++) {
            const struct fv_keypoint *p = &view->points[view->order[k]];
            double dx = (double)p->x_px - x, dy = (double)p->y_px - y;
            if (dx * dx + dy * dy > radius * radius || (int)p->level < level_min || (int)p->level > level_max)
                continue;
            if (only_free && view->landmark[view->order[k]] != FV_MAP_NONE) continue;
            candidates[count++] = view->order[k];
        }
    }
    return count;
}

static struct fv_found fv_nearest(const struct fv_kernels *kernels, const struct fv_view *view,
                                  const uint16_t *candidates, int32_t count, const uint8_t *descriptor)
{
    struct fv_found found = {FV_MAP_NONE, 256, 256};
    uint16_t distances[CANDIDATES_MAX];
    if (count > 0) kernels->hamming_some_u8(distances, descriptor, view->descriptors, candidates, count);
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

struct fv_found fv_map_search(const struct fv_map *map, const struct fv_kernels *kernels, uint32_t slot,
                              double x_px, double y_px, double radius_px, int level_min, int level_max,
                              const uint8_t *descriptor, bool only_free)
{
    const struct fv_found none = {FV_MAP_NONE, 256, 256};
    uint16_t candidates[CANDIDATES_MAX];
    if (!(x_px > -1e4 && x_px < 1e5 && y_px > -1e4 && y_px < 1e5)) return none;
    struct fv_view view = fv_map_view(map, slot);
    int32_t count = fv_gather(map, &view, x_px, y_px, radius_px, level_min, level_max, only_free, candidates);
    return fv_nearest(kernels, &view, candidates, count, descriptor);
}

struct fv_found fv_map_search_line(const struct fv_map *map, const struct fv_kernels *kernels, uint32_t slot,
                                   const double box[4], const double normal[3], double limit_rad,
                                   int level_min, int level_max, const uint8_t *descriptor)
{
    static const double scales[] = {1, 1.2, 1.44, 1.728, 2.0736, 2.48832, 2.985984, 3.5831808};
    uint16_t candidates[CANDIDATES_MAX];
    int32_t count = 0, corner[4];
    for (int i = 0; i < 4; i++) {
        double margin = i < 2 ? -6 : 6, limit = (i & 1 ? map->rows : map->columns) * FV_MAP_CELL_PX - 1;
        double v = box[i] + margin;
        corner[i] = (int32_t)(v > 0 ? (v < limit ? v : limit) : 0) / FV_MAP_CELL_PX;
    }
    struct fv_view view = fv_map_view(map, slot);
    for (int32_t r = corner[1]; r <= corner[3]; r++) {
        uint32_t first = view.cells[r * map->columns + corner[0]],
                 last = view.cells[r * map->columns + corner[2] + 1];
        for (uint32_t k = first; k < last && count < CANDIDATES_MAX; k++) {
            uint32_t f = view.order[k];
            const struct fv_keypoint *p = &view.points[f];
            if (view.landmark[f] != FV_MAP_NONE || (int)p->level < level_min || (int)p->level > level_max)
                continue;
            double off = normal[0] * (double)p->bearing[0] + normal[1] * (double)p->bearing[1] +
                         normal[2] * (double)p->bearing[2];
            if (off * off > limit_rad * limit_rad * scales[p->level & 7] * scales[p->level & 7]) continue;
            candidates[count++] = (uint16_t)f;
        }
    }
    return fv_nearest(kernels, &view, candidates, count, descriptor);
}
