#include "app/lab/map_open.h"

#include <stdlib.h>
#include <string.h>

#include "support/aligned.h"
#include "app/config/map_file.h"
#include "base/hash.h"

static void carve(struct fv_map_open *open, struct fv_arena *arena)
{
    const struct fv_archive_info *info = &open->info;
    const struct fv_map_limits limits = {info->keyframe_slots, info->landmark_slots,
                                         info->features_max,   info->camera.width,
                                         info->camera.height,  false};
    fv_bearing_carve(&open->bearings, info->camera.width, info->camera.height, arena);
    fv_map_carve(&open->map, &limits, &open->camera, &open->bearings, arena);
}

/* Sizes as the runtime could have had them, so that a file cannot ask for all memory. */
static enum fovea_status check_sizes(const char *path, const struct fv_archive_info *info,
                                     struct fovea_error *error)
{
    const struct {
        const char *what;
        int64_t found, low, high;
        int byte;
    } rows[] = {{"width", info->camera.width, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_WIDTH_MAX, 24},
                {"height", info->camera.height, FOVEA_IMAGE_HEIGHT_MIN, FOVEA_IMAGE_HEIGHT_MAX, 28},
                {"features", info->features_max, 1, FOVEA_FEATURES_MAX, 36},
                {"landmark slots", info->landmark_slots, 1, FOVEA_ODOMETRY_LANDMARKS_MAX, 148},
                {"keyframe slots", info->keyframe_slots, 2, FV_MAP_KEYFRAMES_MAX, 152}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        if (rows[i].found < rows[i].low || rows[i].found > rows[i].high)
            return fovea_error_set(error, FOVEA_ERROR_INPUT,
                                   "%.200s: byte %d: %s: found %lld, expected %lld to %lld", path,
                                   rows[i].byte, rows[i].what, (long long)rows[i].found,
                                   (long long)rows[i].low, (long long)rows[i].high);
    return FOVEA_OK;
}

static void count_grid(struct fv_map_open *open, const uint8_t *data)
{
    const uint32_t cells = open->info.grid.side * open->info.grid.side;
    for (uint32_t i = 0; i < cells; i++) {
        const int8_t percent = (int8_t)data[open->info.grid_at + i];
        open->grid_free += percent >= 0 && percent < 50;
        open->grid_occupied += percent > 50;
    }
}

static enum fovea_status fill(struct fv_map_open *open, const char *path, const uint8_t *data,
                              size_t bytes, struct fovea_error *error)
{
    struct fv_arena arena;
    enum fovea_status status = fv_archive_info(data, bytes, path, &open->info, error);
    if (status == FOVEA_OK) status = check_sizes(path, &open->info, error);
    if (status != FOVEA_OK) return status;
    struct fovea_error reason;
    if (fovea_camera_prepare(&open->info.camera, &reason) != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.200s: byte 40: camera: %.200s", path,
                               reason.text);
    fv_arena_count(&arena);
    carve(open, &arena);
    const size_t needed = arena.used;
    open->memory = fv_aligned_new(needed);
    if (open->memory == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "%.200s: no memory for the map (%zu bytes)", path, needed);
    fv_arena_init(&arena, open->memory, needed);
    carve(open, &arena);
    open->camera = open->info.camera;
    fv_bearing_init(&open->bearings, &open->camera);
    status = fv_archive_read(data, bytes, path, &open->map, &open->info, error);
    if (status == FOVEA_OK) count_grid(open, data);
    return status;
}

enum fovea_status fv_map_open_bytes(const uint8_t *data, size_t bytes, const char *name,
                                    struct fv_map_open *open, struct fovea_error *error)
{
    memset(open, 0, sizeof *open);
    open->file_bytes = bytes;
    open->hash = fv_hash(FV_HASH_START, data, bytes);
    enum fovea_status status = fill(open, name, data, bytes, error);
    if (status != FOVEA_OK) fv_map_open_free(open);
    return status;
}

enum fovea_status fv_map_open(const char *path, struct fv_map_open *open, struct fovea_error *error)
{
    uint8_t *data;
    size_t bytes;
    memset(open, 0, sizeof *open);
    enum fovea_status status = fv_map_file_read(path, &data, &bytes, error);
    if (status != FOVEA_OK) return status;
    status = fv_map_open_bytes(data, bytes, path, open, error);
    free(data);
    return status;
}

void fv_map_open_free(struct fv_map_open *open)
{
    free(open->memory);
    open->memory = NULL;
}

uint32_t fv_map_open_order(const struct fv_map_open *open, uint32_t map_id, uint32_t *slots)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < open->map.limits.keyframes; k++) {
        const struct fv_keyframe *keyframe = &open->map.keyframes[k];
        if (!keyframe->used || keyframe->map_id != map_id) continue;
        uint32_t at = count++;
        for (; at > 0 && open->map.keyframes[slots[at - 1]].number > keyframe->number; at--)
            slots[at] = slots[at - 1];
        slots[at] = k;
    }
    return count;
}

bool fv_map_open_largest(const struct fv_map_open *open, uint32_t *map_id)
{
    uint32_t most = 0;
    for (uint32_t k = 0; k < open->map.limits.keyframes; k++) {
        if (!open->map.keyframes[k].used) continue;
        const uint32_t id = open->map.keyframes[k].map_id,
                       count = fv_map_count_keyframes(&open->map, id);
        if (count > most) *map_id = id;
        if (count > most) most = count;
    }
    return most > 0;
}

uint32_t fv_map_open_map_of(const struct fv_map_open *open, const struct fv_landmark *landmark)
{
    return open->map.keyframes[landmark->observers[0].keyframe].map_id;
}

void fv_map_open_centre(const struct fv_map_open *open, uint32_t slot, double centre[3])
{
    const double origin[3] = {0, 0, 0};
    fv_se3_apply_inverse(&open->map.keyframes[slot].T_cam_world, origin, centre);
}
