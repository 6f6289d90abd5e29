/* Maps that outlive a run. */
#include "runtime/state.h"

size_t fovea_map_bytes_max(const struct fovea_config *config)
{
    const struct fv_map_limits limits = {config->odometry.keyframes, config->odometry.landmarks,
                                         config->features.count_max, config->camera.width,
                                         config->camera.height};
    return fv_archive_bytes_max(&limits);
}

void fovea_map_save_to(struct fovea *rt, uint8_t *buffer, size_t bytes)
{
    rt->odometry.save_to = buffer;
    rt->odometry.save_capacity = buffer == NULL ? 0 : bytes;
}

void fovea_map_seal(uint8_t *data, size_t bytes)
{
    fv_archive_seal(data, bytes);
}

size_t fovea_map_save(struct fovea *rt, uint8_t *buffer, size_t bytes)
{
    if (!rt->config.odometry.enabled) return 0;
    *rt->odometry.archive = (struct fv_archive_state){0}; /* one that was going on gives way */
    fovea_map_save_to(rt, buffer, bytes);
    fv_odometry_save_begin(&rt->odometry);
    while (fv_archive_busy(rt->odometry.archive))
        (void)fv_odometry_unit(&rt->odometry, &rt->kernels);
    const size_t saved = fv_archive_take(rt->odometry.archive);
    fovea_map_save_to(rt, NULL, 0);
    if (saved > bytes) return 0;
    fovea_map_seal(buffer, saved);
    return saved;
}
