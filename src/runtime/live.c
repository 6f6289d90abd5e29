#include "runtime/live.h"

#include "image/preprocess.h"
#include "runtime/config.h"

/* ---- what may be taken ----------------------------------------------------------------------- */

/* A number that memory was carved for. */
static enum fovea_status check_most(const char *name, uint32_t value, uint32_t most,
                                    struct fovea_error *error)
{
    if (value <= most) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                           "%s: found %u, expected at most %u, as at the start, or a restart", name,
                           value, most);
}

/* A job that has memory only where it was on at the start. */
static enum fovea_status check_period(const char *name, uint32_t value, uint32_t started,
                                      struct fovea_error *error)
{
    if (value == 0 || started > 0) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_UNSUPPORTED,
                           "%s: found %u, expected 0, as at the start, or a restart", name, value);
}

static bool has_contrast(const struct fovea_preprocess_config *chain)
{
    for (uint32_t i = 0; i < chain->operations.count; i++)
        if (chain->operations.items[i] == FOVEA_OPERATION_CONTRAST_ENHANCEMENT) return true;
    return false;
}

static enum fovea_status check_operations(const struct fovea *rt,
                                          const struct fovea_preprocess_config *chain,
                                          struct fovea_error *error)
{
    const struct fovea_preprocess_config *started = &rt->started.image.preprocess;
    struct fovea_preprocess_config grey, started_grey;
    fv_preprocess_grey(chain, &grey);
    fv_preprocess_grey(started, &started_grey);
    if (grey.operations.count > 0 && started_grey.operations.count == 0)
        return fovea_error_set(
            error, FOVEA_ERROR_UNSUPPORTED,
            "image.operations: found %u operations, expected none but white_balance, as at the start, or a restart",
            chain->operations.count);
    if (has_contrast(chain) && !has_contrast(started))
        return fovea_error_set(
            error, FOVEA_ERROR_UNSUPPORTED,
            "image.operations: found contrast_enhancement, expected it at the start too, or a restart");
    return FOVEA_OK;
}

/* Of checked values: whether they fit the memory of the start. */
static enum fovea_status check_memory(const struct fovea *rt, const struct fovea_config *config,
                                      struct fovea_error *error)
{
    const struct fovea_config *started = &rt->started;
    enum fovea_status status = check_operations(rt, &config->image.preprocess, error);
    if (status == FOVEA_OK)
        status = check_most("features.count_max", config->features.count_max,
                            started->features.count_max, error);
    if (status == FOVEA_OK)
        status = check_most("detect.count_max", config->detect.count_max, started->detect.count_max,
                            error);
    if (status == FOVEA_OK)
        status = check_most("detect2.count_max", config->detect2.count_max,
                            started->detect2.count_max, error);
    if (status == FOVEA_OK)
        status = check_period("preview.period_frames", config->preview.period_frames,
                              started->preview.period_frames, error);
    if (status == FOVEA_OK)
        status = check_period("edges.period_frames", config->edge_job.period_frames,
                              started->edge_job.period_frames, error);
    return status;
}

/* `merged`: the configuration of the start with the live parameters of `config`. */
static enum fovea_status merge(const struct fovea *rt, const struct fovea_config *config,
                               struct fovea_config *merged, struct fovea_error *error)
{
    *merged = rt->started;
    fv_config_take_live(merged, config);
    const enum fovea_status status = fv_config_check_live(merged, error);
    return status == FOVEA_OK ? check_memory(rt, merged, error) : status;
}

enum fovea_status fovea_parameters_check(const struct fovea *rt, const struct fovea_config *config,
                                         struct fovea_error *error)
{
    struct fovea_config merged;
    return merge(rt, config, &merged, error);
}

/* ---- taking it ------------------------------------------------------------------------------- */

void fv_live_spread(struct fovea *rt)
{
    const struct fovea_config *config = &rt->config;
    fv_detection_set(&rt->detection, &config->detect, fv_detection_floor(&config->objects));
    fv_detection_set(&rt->detection2, &config->detect2, 0);
}

void fv_live_apply(struct fovea *rt)
{
    const struct fovea_config *config = &rt->config;
    fv_live_spread(rt);
    fv_front_end_set(&rt->front_end, &config->image.preprocess, &config->features);
    if (rt->stereo_used)
        fv_front_end_set(&rt->second_front_end, &config->image.preprocess, &config->features);
    if (config->odometry.enabled) fv_odometry_set(&rt->odometry, &config->odometry);
}

void fv_live_take(struct fovea *rt, const struct fovea_config *config)
{
    struct fovea_config merged;
    if (merge(rt, config, &merged, NULL) != FOVEA_OK) return;
    fv_config_take_live(&rt->config, &merged);
    fv_live_apply(rt);
}

const struct fovea_config *fovea_config_get(const struct fovea *rt)
{
    return &rt->config;
}
