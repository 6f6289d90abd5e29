#include "common/small_map.h"

#include <stdlib.h>
#include <string.h>

#include "common/carved.h"

static void carve(void *context, struct fv_arena *arena)
{
    struct small_map *small = context;
    const struct fv_map_limits limits = {
        SMALL_MAP_KEYFRAMES, SMALL_MAP_LANDMARKS, SMALL_MAP_FEATURES, 320, 240, small->measured};
    fv_bearing_carve(&small->bearings, 320, 240, arena);
    fv_map_carve(&small->map, &limits, &small->camera, &small->bearings, arena);
}

static void make(struct small_map *small, bool measured)
{
    memset(small, 0, sizeof *small);
    small->measured = measured;
    small->camera = (struct fovea_camera){.width = 320,
                                          .height = 240,
                                          .fx = 210,
                                          .fy = 211,
                                          .cx = 160.5,
                                          .cy = 119,
                                          .k = {-0.1, 0.01}};
    if (fovea_camera_prepare(&small->camera, NULL) != FOVEA_OK) abort();
    small->memory = carved(carve, small);
    fv_bearing_init(&small->bearings, &small->camera);
    fv_map_reset(&small->map);
}

void small_map_make(struct small_map *small)
{
    make(small, false);
}

void small_map_make_measured(struct small_map *small)
{
    make(small, true);
}

void small_map_free(struct small_map *small)
{
    free(small->memory);
}

static void make_view(struct small_map *small, struct fv_random *random)
{
    const struct fv_map_frame frame = fv_map_frame_at(&small->map, fv_map_current(&small->map));
    struct fovea_feature features[SMALL_MAP_FEATURES] = {{0}};
    uint8_t descriptors[SMALL_MAP_FEATURES * FV_MAP_DESCRIPTOR_BYTES];
    const uint32_t count = SMALL_MAP_FEATURES - fv_random_below(random, 3);
    for (uint32_t i = 0; i < count; i++) {
        features[i].x_px = (float)fv_random_below(random, 3190) / 10;
        features[i].y_px = (float)fv_random_below(random, 2390) / 10;
        features[i].level = (uint8_t)fv_random_below(random, 8);
    }
    for (size_t i = 0; i < sizeof descriptors; i++)
        descriptors[i] = (uint8_t)fv_random_u32(random);
    fv_map_fill_frame(&small->map, fv_map_current(&small->map), features, descriptors, count, NULL);
    frame.keyframe->depth = 1 + fv_random_unit(random);
    frame.keyframe->stamp_ns = (int64_t)fv_random_u32(random);
    double turn[3];
    for (int i = 0; i < 3; i++) {
        turn[i] = 0.3 * fv_random_normal(random);
        frame.keyframe->T_cam_world.t[i] = fv_random_normal(random);
    }
    fv_so3_exp(turn, frame.keyframe->T_cam_world.R);
}

void small_map_grow(struct small_map *small, struct fv_random *random)
{
    struct fv_map *map = &small->map;
    make_view(small, random);
    fv_map_make_room(map, 40, 1000);
    const int32_t before =
        map->state->keyframe_count > 0 ? map->keyframes[fv_map_current(map)].parent : FV_MAP_NONE;
    const uint32_t slot = fv_map_add_keyframe(map, fv_map_current(map));
    map->keyframes[slot].parent =
        before != FV_MAP_NONE && map->keyframes[before].used ? before : FV_MAP_NONE;
    for (uint32_t f = 0; f < map->keyframes[slot].features; f++) {
        uint32_t landmark = fv_random_below(random, SMALL_MAP_LANDMARKS);
        if (f % 3 == 0) {
            const double point[3] = {fv_random_normal(random), fv_random_normal(random), 4};
            const int32_t made = fv_map_add_landmark(map, point, 5);
            if (made == FV_MAP_NONE) continue;
            landmark = (uint32_t)made;
        } else if (f % 3 == 1 || !map->landmarks[landmark].used) {
            continue;
        }
        if (fv_map_link(map, landmark, slot, f)) fv_map_refresh_landmark(map, landmark);
    }
    if (before != FV_MAP_NONE && map->keyframes[before].used && before != (int32_t)slot &&
        slot % 3 == 0)
        fv_map_add_edge(map, (uint32_t)before, slot);
    map->keyframes[fv_map_current(map)].parent = (int32_t)slot;
}

uint8_t *small_map_save(const struct small_map *small, size_t *bytes)
{
    return small_map_save_with(small, NULL, NULL, 0, bytes);
}

uint8_t *small_map_save_with(const struct small_map *small, const struct fv_archive_grid *grid,
                             const int8_t *cells, uint32_t piece, size_t *bytes)
{
    const uint32_t count = grid != NULL ? grid->side * grid->side : 0;
    const size_t capacity = fv_archive_bytes_max(&small->map.limits);
    uint8_t *data = malloc(capacity);
    struct fv_archive_state archive = {0};
    fv_archive_begin(&archive, 77);
    if (grid != NULL) fv_archive_want_grid(&archive);
    while (fv_archive_busy(&archive)) {
        if (archive.phase == FV_ARCHIVE_GRID && grid->side > 0) {
            fv_archive_grid_head(&archive, grid, data, capacity);
            for (uint32_t at = 0; at < count; at += piece)
                fv_archive_grid_cells(&archive, cells + at, count - at < piece ? count - at : piece,
                                      data, capacity);
        }
        fv_archive_unit(&archive, &small->map, &small->camera, data, capacity);
    }
    *bytes = fv_archive_take(&archive);
    if (*bytes > capacity) abort();
    fv_archive_seal(data, *bytes);
    return data;
}

struct fv_archive_grid small_map_grid(const struct small_map *small, uint32_t side,
                                      struct fv_random *random, int8_t *cells)
{
    const double turn[3] = {0.1, -0.2, fv_random_unit(random)};
    struct fv_archive_grid grid = {.map_id = small->map.state->map_id,
                                   .side = side,
                                   .resolution_m = 0.05,
                                   .S_map_grid = {.t = {1.5, -2.25, 0.5}, .s = 0.75}};
    fv_so3_exp(turn, grid.S_map_grid.R);
    for (uint32_t i = 0; i < side * side; i++) {
        const int8_t percent = (int8_t)(fv_random_below(random, 102)) - 1;
        cells[i] = fv_archive_cell(percent) ? percent : -1;
    }
    return grid;
}

static const char *keyframe_trouble(const struct fv_map *map, uint32_t slot)
{
    const struct fv_map_frame frame = fv_map_frame_at(map, slot);
    uint32_t links = 0;
    if (frame.keyframe->features > map->limits.features) return "a keyframe has too many features";
    for (uint32_t f = 0; f < frame.keyframe->features; f++) {
        if (frame.landmark[f] == FV_MAP_NONE) continue;
        if (frame.landmark[f] < 0 || (uint32_t)frame.landmark[f] >= map->limits.landmarks)
            return "a link leads nowhere";
        const struct fv_landmark *l = &map->landmarks[frame.landmark[f]];
        bool known = false;
        for (uint32_t i = 0; i < l->observer_count; i++)
            known = known || (l->observers[i].keyframe == slot && l->observers[i].feature == f);
        if (!l->used || !known) return "a landmark does not know its observer";
        links++;
    }
    const int32_t parent = frame.keyframe->parent;
    if (parent != FV_MAP_NONE && (parent < 0 || (uint32_t)parent >= map->limits.keyframes ||
                                  !map->keyframes[parent].used || parent == (int32_t)slot))
        return "a parent is none";
    return links == frame.keyframe->landmarks ? NULL : "a keyframe's landmarks are miscounted";
}

const char *small_map_trouble(const struct fv_map *map)
{
    uint32_t landmarks = 0, keyframes = 0;
    for (uint32_t i = 0; i < map->limits.landmarks; i++) {
        const struct fv_landmark *l = &map->landmarks[i];
        if (!l->used) continue;
        landmarks++;
        if (l->observer_count == 0 || l->observer_count > FV_MAP_OBSERVERS_MAX)
            return "a landmark has no observers";
        for (uint32_t k = 0; k < l->observer_count; k++) {
            const struct fv_observer o = l->observers[k];
            if (o.keyframe >= map->limits.keyframes || !map->keyframes[o.keyframe].used ||
                o.feature >= map->keyframes[o.keyframe].features ||
                fv_map_frame_at(map, o.keyframe).landmark[o.feature] != (int32_t)i)
                return "an observer does not know its landmark";
        }
    }
    for (uint32_t k = 0; k < map->limits.keyframes; k++) {
        if (!map->keyframes[k].used) continue;
        keyframes++;
        const char *trouble = keyframe_trouble(map, k);
        if (trouble != NULL) return trouble;
    }
    if (landmarks != map->state->landmark_count || keyframes != map->state->keyframe_count)
        return "pools are miscounted";
    if (map->state->free_count != map->limits.landmarks - landmarks)
        return "free landmarks are miscounted";
    for (uint32_t i = 0; i < map->state->free_count; i++)
        if (map->landmarks[map->free_landmarks[i]].used) return "a free landmark is used";
    return NULL;
}
