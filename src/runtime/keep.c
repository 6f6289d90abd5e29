/* Maps that outlive a run. */
#include "runtime/config.h"
#include "runtime/state.h"

size_t fovea_map_bytes_max(const struct fovea_config *config)
{
    const struct fv_map_limits limits = {
        config->odometry.keyframes,           config->odometry.landmarks,
        config->features.count_max,           config->rig.cameras[0].camera.width,
        config->rig.cameras[0].camera.height, fv_config_stereo(config)};
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
    while (fv_odometry_saving(&rt->odometry))
        (void)fv_odometry_unit(&rt->odometry, &rt->kernels);
    const size_t saved = fv_odometry_save_take(&rt->odometry);
    fovea_map_save_to(rt, NULL, 0);
    if (saved > bytes) return 0;
    fovea_map_seal(buffer, saved);
    return saved;
}
