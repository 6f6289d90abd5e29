#include "map/map.h"

#include <string.h>

#include "fovea/odometry.h"
#include "geometry/vec.h"

void fv_map_carve(struct fv_map *map, const struct fv_map_limits *limits,
                  const struct fovea_camera *camera, const struct fv_bearing_table *bearings,
                  struct fv_arena *arena)
{
    const int32_t longest = limits->width > limits->height ? limits->width : limits->height;
    map->limits = *limits;
    map->camera = camera;
    map->bearings = bearings;
    map->pixel_px = 1.0 / 64;
    while (longest / map->pixel_px > UINT16_MAX + 1.0)
        map->pixel_px *= 2;
    map->columns = (limits->width + FV_MAP_CELL_PX - 1) / FV_MAP_CELL_PX;
    map->rows = (limits->height + FV_MAP_CELL_PX - 1) / FV_MAP_CELL_PX;
    size_t frames = fv_map_frame_count(map), features = frames * limits->features;
    map->state = fv_arena_take(arena, 1, sizeof *map->state);
    map->keyframes = fv_arena_take(arena, frames, sizeof *map->keyframes);
    map->landmarks = fv_arena_take(arena, limits->landmarks, sizeof *map->landmarks);
    map->free_landmarks = fv_arena_take(arena, limits->landmarks, sizeof *map->free_landmarks);
    map->edges = fv_arena_take(arena, FV_MAP_EDGES_MAX, sizeof *map->edges);
    map->points = fv_arena_take(arena, features, sizeof *map->points);
    map->descriptors = fv_arena_take(arena, features, FV_MAP_DESCRIPTOR_BYTES);
    map->links = fv_arena_take(arena, features, sizeof *map->links);
    map->keypoints = fv_arena_take(arena, (size_t)(1 + FV_MAP_WAITING_MAX) * limits->features,
                                   sizeof *map->keypoints);
    map->cells =
        fv_arena_take(arena, frames * (size_t)(map->columns * map->rows + 1), sizeof *map->cells);
    map->distances =
        limits->distances ? fv_arena_take(arena, features, sizeof *map->distances) : NULL;
}

void fv_map_reset(struct fv_map *map)
{
    for (uint32_t i = 0; i < fv_map_frame_count(map); i++) {
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
    uint64_t keyframe_number =
        map->state->keyframe_number; /* goes on: numbers name keyframes in messages */
    memset(map->state, 0, sizeof *map->state);
    map->state->free_count = map->limits.landmarks;
    map->state->keyframe_number = keyframe_number;
    map->state->map_id = map->state->odom_id = map_id;
    map->state->map_next = map_id + 1;
    fv_sim3_identity(&map->state->S_map_world);
}

/* ---- keyframes ------------------------------------------------------------------------------- */

uint32_t fv_map_add_keyframe(struct fv_map *map, uint32_t from)
{
    if (map->state->keyframe_count == map->limits.keyframes)
        fv_map_remove_keyframe(map, fv_map_most_redundant(map));
    uint32_t slot = 0;
    while (map->keyframes[slot].used)
        slot++;
    fv_map_copy_frame(map, from, slot);
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
    struct fv_map_frame frame = fv_map_frame_at(map, slot);
    for (uint32_t i = 0; i < frame.keyframe->features; i++) {
        int32_t landmark = frame.landmark[i];
        if (landmark == FV_MAP_NONE) continue;
        fv_map_unlink(map, (uint32_t)landmark, slot);
        if (map->landmarks[landmark].observer_count == 0)
            fv_map_remove_landmark(map, (uint32_t)landmark);
    }
    for (uint32_t i = 0; i < fv_map_frame_count(map); i++) /* children hang on to the grandparent */
        if (map->keyframes[i].parent == (int32_t)slot)
            map->keyframes[i].parent = frame.keyframe->parent;
    frame.keyframe->used = false;
    frame.keyframe->generation++;
    frame.keyframe->features = 0;
    map->state->keyframe_count--;
}

/* ---- landmarks ------------------------------------------------------------------------------- */

int32_t fv_map_add_landmark(struct fv_map *map, const double point[3], uint64_t frame_number)
{
    if (map->state->free_count == 0) return FV_MAP_NONE;
    uint32_t slot = map->free_landmarks[--map->state->free_count];
    struct fv_landmark *l = &map->landmarks[slot];
    uint32_t generation = l->generation + 1;
    memset(l, 0, sizeof *l);
    l->generation = generation;
    l->used = true;
    l->born = l->seen = (uint32_t)frame_number;
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
    struct fv_map_frame frame = fv_map_frame_at(map, keyframe);
    if (frame.landmark[feature] != FV_MAP_NONE) return false;
    for (uint32_t i = 0; i < l->observer_count; i++)
        if (l->observers[i].keyframe == keyframe) return false;
    if (l->observer_count == FV_MAP_OBSERVERS_MAX)
        fv_map_unlink(map, landmark, l->observers[1].keyframe);
    struct fv_observer observer = {(uint16_t)keyframe, (uint16_t)feature};
    l->observers[l->observer_count++] = observer;
    frame.landmark[feature] = (int16_t)landmark;
    frame.keyframe->landmarks++;
    return true;
}

void fv_map_unlink(struct fv_map *map, uint32_t landmark, uint32_t keyframe)
{
    struct fv_landmark *l = &map->landmarks[landmark];
    for (uint32_t i = 0; i < l->observer_count; i++) {
        if (l->observers[i].keyframe != keyframe) continue;
        struct fv_map_frame frame = fv_map_frame_at(map, keyframe);
        frame.landmark[l->observers[i].feature] = FV_MAP_NONE;
        frame.keyframe->landmarks--;
        l->observer_count--;
        for (uint32_t k = i; k < l->observer_count; k++)
            l->observers[k] = l->observers[k + 1];
        if (l->best == i) l->best = 0;
        if (l->best > i) l->best--;
        return;
    }
}

void fv_map_fuse_landmarks(struct fv_map *map, uint32_t keep, uint32_t drop)
{
    struct fv_landmark *from = &map->landmarks[drop], *to = &map->landmarks[keep];
    while (from->observer_count > 0) {
        struct fv_observer o = from->observers[from->observer_count - 1];
        fv_map_unlink(map, drop, o.keyframe);
        if (to->observer_count < FV_MAP_OBSERVERS_MAX)
            (void)fv_map_link(map, keep, o.keyframe, o.feature);
    }
    to->found = (uint16_t)(to->found + from->found / 2);
    if (to->expected < to->found) to->expected = to->found;
    if ((int32_t)(to->seen - from->seen) < 0) to->seen = from->seen;
    fv_map_remove_landmark(map, drop);
    fv_map_refresh_landmark(map, keep);
}

static uint32_t hamming(const uint8_t *a, const uint8_t *b)
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

static const uint8_t *observed_descriptor(const struct fv_map *map, struct fv_observer o)
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
        struct fv_map_frame frame = fv_map_frame_at(map, l->observers[i].keyframe);
        double q[3], ray[3];
        fv_se3_apply(&frame.keyframe->T_cam_world, l->point, q);
        double distance = fv_norm3(q);
        if (i == 0) {
            l->distance = (float)distance;
            l->level = (uint8_t)frame.points[l->observers[0].feature].level;
        }
        fv_rotate_back3(frame.keyframe->T_cam_world.R, q, ray);
        for (int k = 0; k < 3; k++)
            mean[k] += ray[k] / (distance > 1e-12 ? distance : 1e-12);
        uint32_t sum = 0;
        for (uint32_t j = 0; j < l->observer_count; j++)
            sum += hamming(observed_descriptor(map, l->observers[i]),
                           observed_descriptor(map, l->observers[j]));
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
        l->direction[k] = fv_map_direction(mean[k]);
    l->best = (uint8_t)best;
}

/* ---- measured distances ---------------------------------------------------------------------- */

static bool metres(const struct fv_map_scale *scale, const struct fv_sim3 *S_map_world)
{
    return scale->source == FOVEA_SCALE_STEREO && scale->log_scale == 0 && S_map_world->s == 1;
}

bool fv_map_metric(const struct fv_map *map)
{
    return map->distances != NULL && metres(&map->state->scale, &map->state->S_map_world);
}

bool fv_map_odom_of(const struct fv_map *map, uint32_t map_id, struct fv_map_odom *odom)
{
    const struct fv_map_state *s = map->state;
    *odom = (struct fv_map_odom){s->map_id, s->odom_id, s->S_map_world, s->scale, s->gravity};
    for (uint32_t i = 0; i < FV_MAP_WORLDS_MAX && i < s->left_count && odom->map_id != map_id; i++)
        if (s->left[i].map_id == map_id) *odom = s->left[i];
    return odom->map_id == map_id;
}

bool fv_map_metric_of(const struct fv_map *map, uint32_t map_id)
{
    struct fv_map_odom odom;
    return map->distances != NULL && fv_map_odom_of(map, map_id, &odom) &&
           metres(&odom.scale, &odom.S_map_world);
}

double fv_map_scale_of(const struct fv_map *map, uint32_t map_id, double *variance)
{
    struct fv_map_odom odom;
    const bool known = fv_map_odom_of(map, map_id, &odom) && odom.scale.source != FOVEA_SCALE_FREE;
    if (variance != NULL) *variance = known ? odom.scale.variance : 0;
    return known ? fv_exp(odom.scale.log_scale) / odom.S_map_world.s : 0;
}

bool fv_map_gravity_of(const struct fv_map *map, uint32_t map_id, struct fv_map_gravity *gravity)
{
    struct fv_map_odom odom;
    if (!fv_map_odom_of(map, map_id, &odom) || !(odom.gravity.sigma > 0)) return false;
    fv_rotate3(odom.S_map_world.R, odom.gravity.down, gravity->down);
    gravity->sigma = odom.gravity.sigma;
    return true;
}

bool fv_map_upright(const struct fv_map *map, uint32_t map_id, struct fv_map_gravity *gravity)
{
    return fv_map_gravity_of(map, map_id, gravity) && gravity->sigma <= FV_MAP_GRAVITY_SIGMA;
}

bool fv_map_landmark_stands(const struct fv_map *map, const struct fv_landmark *l)
{
    if (l->observer_count != 1 || map->distances == NULL) return l->observer_count >= 2;
    const struct fv_observer o = l->observers[0];
    return fv_inverse_distance_known(&fv_map_distances(map, o.keyframe)[o.feature],
                                     FV_MAP_KNOWN_PARTS / 2);
}

/* ---- for those who show a map ---------------------------------------------------------------- */

bool fv_map_landmark_at(const struct fv_map *map, uint32_t slot, uint32_t *map_id,
                        double position[3])
{
    const struct fv_landmark *l = &map->landmarks[slot];
    if (!l->used || l->observer_count == 0) return false;
    *map_id = map->keyframes[l->observers[0].keyframe].map_id;
    fv_copy3(l->point, position);
    return true;
}

struct fv_se3 fv_map_camera_at(const struct fv_map *map, uint32_t slot)
{
    const struct fv_keyframe *keyframe = &map->keyframes[slot];
    struct fv_se3 T;
    double back[3];
    fv_se3_invert(&keyframe->T_cam_world, &T);
    fv_rotate3(T.R, keyframe->seen_from, back);
    fv_subtract3(T.t, back, T.t);
    return T;
}

bool fv_map_keyframe_at(const struct fv_map *map, uint32_t slot, struct fv_map_keyframe *keyframe)
{
    const struct fv_keyframe *kept = &map->keyframes[slot];
    if (!kept->used) return false;
    keyframe->map_id = kept->map_id;
    keyframe->parent = kept->parent;
    keyframe->number = kept->number;
    keyframe->stamp_ns = kept->stamp_ns;
    keyframe->T_world_cam = fv_map_camera_at(map, slot);
    return true;
}
