/* Maps that outlive a run. */
#include <string.h>

#include "base/hash.h"
#include "runtime/config.h"
#include "runtime/kept_grid.h"
#include "runtime/ready_map.h"
#include "runtime/state.h"

static struct fv_map_limits limits_of(const struct fovea_config *config)
{
    return (struct fv_map_limits){
        config->odometry.keyframes,           config->odometry.landmarks,
        config->features.count_max,           config->rig.cameras[0].camera.width,
        config->rig.cameras[0].camera.height, fv_config_stereo(config)};
}

size_t fovea_map_bytes_max(const struct fovea_config *config)
{
    const struct fv_map_limits limits = limits_of(config);
    return fv_archive_bytes_max(&limits);
}

void fovea_map_save_to(struct fovea *rt, uint8_t *buffer, size_t bytes)
{
    fv_odometry_save_to(&rt->odometry, buffer, bytes);
}

void fovea_map_seal(uint8_t *data, size_t bytes)
{
    fv_archive_seal(data, bytes);
}

size_t fovea_map_save(struct fovea *rt, uint8_t *buffer, size_t bytes)
{
    if (!rt->config.odometry.enabled) return 0;
    fv_odometry_save_drop(&rt->odometry);
    fovea_map_save_to(rt, buffer, bytes);
    fv_odometry_save_begin(&rt->odometry);
    fv_kept_grid_save_begin(&rt->free_space, &rt->odometry);
    while (fv_odometry_saving(&rt->odometry))
        if (!fv_kept_grid_save_unit(&rt->free_space, &rt->publish, &rt->odometry))
            (void)fv_odometry_unit(&rt->odometry, &rt->kernels);
    const size_t saved = fv_odometry_save_take(&rt->odometry);
    fovea_map_save_to(rt, NULL, 0);
    if (saved > bytes) return 0;
    fovea_map_seal(buffer, saved);
    return saved;
}

/* ---- loading --------------------------------------------------------------------------------- */

/* That a run keeps of a map. */
static size_t grid_cells(const struct fovea_config *config)
{
    const struct fovea_grid_job_config *job = &config->grid_job;
    return job->enabled ? (size_t)job->grid.side_cells * job->grid.side_cells : 0;
}

size_t fovea_map_prepared_bytes(const struct fovea_config *config)
{
    const struct fv_map_limits limits = limits_of(config);
    struct fv_arena arena;
    struct fv_map map = {0};
    fv_arena_count(&arena);
    (void)fv_arena_take(&arena, 1, sizeof(struct fovea_ready_map));
    fv_map_carve(&map, &limits, &config->rig.cameras[0].camera, NULL, &arena);
    (void)fv_arena_take(&arena, grid_cells(config), 1);
    return arena.used;
}

enum fovea_status fovea_map_prepare(const struct fovea *rt, void *memory, size_t bytes,
                                    const uint8_t *data, size_t data_bytes, const char *name,
                                    const struct fovea_ready_map **ready, struct fovea_error *error)
{
    const struct fv_odometry *odometry = &rt->odometry;
    struct fv_arena arena;
    struct fv_map map = {0};
    struct fv_archive_info info;
    struct fv_archive_grid grid;
    if (!rt->config.odometry.enabled)
        return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                               "%.200s: found no odometry, expected odometry.enabled true", name);
    enum fovea_status status =
        fv_arena_check_block(memory, bytes, fovea_map_prepared_bytes(&rt->started), error);
    if (status != FOVEA_OK) return status;
    memset(memory, 0, bytes);
    fv_arena_init(&arena, memory, bytes);
    struct fovea_ready_map *made = fv_arena_take(&arena, 1, sizeof *made);
    fv_map_carve(&map, &odometry->map.limits, &odometry->camera, &odometry->bearings, &arena);
    made->cells = fv_arena_take(&arena, grid_cells(&rt->started), 1);
    status = fv_archive_read(data, data_bytes, name, &map, &info, error);
    if (status == FOVEA_OK && map.state->keyframe_count == 0)
        status =
            fovea_error_set(error, FOVEA_ERROR_INPUT,
                            "%.200s: found a map without keyframes, expected at least one", name);
    if (status != FOVEA_OK) return status;
    fv_kept_grid_crop(&info, data,
                      rt->free_space.enabled ? rt->started.grid_job.grid.side_cells : 0, &grid,
                      made->cells);
    grid.map_id = fv_map_settled_id(&map, grid.map_id);
    if (grid.map_id == UINT32_MAX) grid.side = 0;
    fv_map_settle(&map);
    *made = (struct fovea_ready_map){.map = map,
                                     .grid = grid,
                                     .cells = made->cells,
                                     .frame_number = info.frame_number,
                                     .hash = fv_hash(FV_HASH_START, data, data_bytes)};
    *ready = made;
    return FOVEA_OK;
}
