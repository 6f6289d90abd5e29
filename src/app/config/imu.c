#include "app/config/imu.h"

#include <string.h>

#include "drivers/recorded/euroc_imu.h"
#include "message/message.h"

static const char *behind(const char *text, const char *scheme)
{
    const size_t length = strlen(scheme);
    return strncmp(text, scheme, length) == 0 ? text + length : NULL;
}

const char *fv_imu_lcm_channel(const struct fv_settings *settings)
{
    return behind(settings->imu, "lcm:");
}

const char *fv_imu_iio_name(const struct fv_settings *settings)
{
    return behind(settings->imu, "iio:");
}

static enum fovea_status check(const struct fv_settings *settings,
                               const struct fovea_source_info *info, struct fovea_error *error)
{
    const char *channel = fv_imu_lcm_channel(settings), *name = fv_imu_iio_name(settings);
    const size_t length = channel != NULL ? strlen(channel) : name != NULL ? strlen(name) : 0;
    if (length == 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "imu: found '%s', expected lcm:CHANNEL or iio:NAME", settings->imu);
    if (channel != NULL && length >= FV_MESSAGE_CHANNEL_BYTES)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "imu: found a channel of %zu bytes, expected at most %d", length,
                               FV_MESSAGE_CHANNEL_BYTES - 1);
    if (channel != NULL && (settings->lcm_url[0] == '\0' || strcmp(settings->listen, "none") == 0))
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "imu: found '%s' with %s, expected an lcm_url and a listen that hear it", settings->imu,
            settings->lcm_url[0] == '\0' ? "an empty lcm_url" : "listen: none");
    if (info->rig.has_imu)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "imu: found '%s' beside the source's own inertial sensor, expected one of the two",
            settings->imu);
    if (settings->imu_file[0] == '\0')
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "imu_file: found none beside imu, expected the file of '%s' (T_BS, densities; 'fovea-calibrate imu' writes one)",
            settings->imu);
    return FOVEA_OK;
}

static enum fovea_status join(struct fv_settings *settings, const struct fovea_source_info *info,
                              struct fv_iio **iio, struct fovea_error *error)
{
    struct fovea_rig_imu *imu = &settings->runtime.rig.imu;
    const char *name = fv_imu_iio_name(settings);
    enum fovea_status status = check(settings, info, error);
    if (status != FOVEA_OK) return status;
    status = fv_euroc_imu_sensor(settings->imu_file, imu, error);
    if (status != FOVEA_OK) {
        fv_settings_blame(settings, "imu_file", error);
        return status;
    }
    settings->runtime.rig.has_imu = true;
    if (name == NULL) return FOVEA_OK;
    status = fv_iio_open(name, imu->rate_hz, iio, error);
    if (status != FOVEA_OK) return status;
    const struct fv_iio_info *found = fv_iio_info(*iio);
    if (found->rate_hz > 0) imu->rate_hz = found->rate_hz;
    imu->gyro_range = found->gyro_range;
    imu->acceleration_range = found->acceleration_range;
    return FOVEA_OK;
}

enum fovea_status fv_imu_join(struct fv_settings *settings, const struct fovea_source_info *info,
                              struct fv_iio **iio, struct fovea_error *error)
{
    if (settings->imu[0] == '\0') return FOVEA_OK;
    const enum fovea_status status = join(settings, info, iio, error);
    if (status != FOVEA_OK) fv_settings_locate(settings, error);
    return status;
}
