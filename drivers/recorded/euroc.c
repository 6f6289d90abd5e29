/* EuRoC data sets in ASL layout: mav0/cam0/{data.csv,data/,sensor.yaml},
 * mav0/state_groundtruth_estimate0/data.csv. Burri et al., "The EuRoC micro aerial vehicle
 * datasets", IJRR 2016. */
#include <string.h>

#include "support/text.h"
#include "euroc_imu.h"
#include "kind.h"
#include "lines.h"
#include "listing.h"
#include "player.h"
#include "rig_options.h"

/* Files beside the list, where they exist. */
static enum fovea_status read_extras(struct fv_listing *listing, const char *cam, const char *mav,
                                     const struct fovea_source_selection *selection,
                                     struct fovea_source_info *info, struct fovea_error *error)
{
    char path[FV_PATH_BYTES];
    double T_body_cam[12];
    bool has_T_body_cam = false;
    enum fovea_status status = fv_path_join(path, cam, "sensor.yaml", error);
    if (status != FOVEA_OK) return status;
    fv_listing_reads(listing, path);
    status = fv_info_set_calibration(info, path, selection, T_body_cam, &has_T_body_cam, error);
    if (status != FOVEA_OK || !has_T_body_cam) return status;
    status = fv_path_join(path, mav, "state_groundtruth_estimate0/data.csv", error);
    if (status != FOVEA_OK || !fv_path_exists(path)) return status;
    struct fv_poses poses;
    fv_listing_reads(listing, path);
    status = fv_poses_read(path, FV_POSES_EUROC, T_body_cam, &poses, error);
    if (status == FOVEA_OK) fv_listing_set_poses(listing, &poses);
    return status;
}

/* The list of frames in a camera's folder; NULL with `error` filled. */
static struct fv_listing *read_camera(const char *cam, char list[FV_PATH_BYTES],
                                      struct fovea_error *error)
{
    char data[FV_PATH_BYTES];
    struct fv_listing *listing = NULL;
    enum fovea_status status = fv_path_join(data, cam, "data", error);
    if (status == FOVEA_OK) status = fv_path_join(list, cam, "data.csv", error);
    if (status != FOVEA_OK) return NULL;
    if ((listing = fv_listing_new(data)) == NULL) {
        fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", cam);
        return NULL;
    }
    fv_listing_reads(listing, list);
    fv_listing_reads(listing, data);
    if (fv_listing_read(listing, list, ",", fv_text_integer, "whole nanoseconds", error) ==
        FOVEA_OK)
        return listing;
    fv_listing_free(listing);
    return NULL;
}

static enum fovea_status read_second(struct fv_listing *listing, const char *mav,
                                     const struct fovea_source_selection *selection,
                                     struct fovea_source_info *info, struct fovea_error *error)
{
    char cam[FV_PATH_BYTES], calibration[FV_PATH_BYTES], list[FV_PATH_BYTES];
    struct fovea_source_info of_second = {.rate_hz = 0};
    double T_body_cam[12];
    bool has_T_body_cam;
    enum fovea_status status = fv_path_join(cam, mav, "cam1", error);
    if (status == FOVEA_OK) status = fv_path_join(calibration, cam, "sensor.yaml", error);
    if (status != FOVEA_OK) return status;
    fv_listing_reads(listing, calibration);
    status = fv_info_set_calibration(&of_second, calibration, selection, T_body_cam,
                                     &has_T_body_cam, error);
    if (status != FOVEA_OK) return status;
    struct fv_listing *second = read_camera(cam, list, error);
    if (second == NULL) return FOVEA_ERROR_INPUT;
    info->rig.camera_count = 2;
    info->rig.cameras[1] = of_second.rig.cameras[0];
    info->cameras[1] = of_second.cameras[0];
    return fv_listing_pair(listing, second, error);
}

static enum fovea_status read_imu(struct fv_listing *listing, const char *mav,
                                  struct fovea_source_info *info, struct fovea_error *error)
{
    char imu[FV_PATH_BYTES], sensor[FV_PATH_BYTES], data[FV_PATH_BYTES];
    struct fv_samples samples = {.list = NULL};
    enum fovea_status status = fv_path_join(imu, mav, "imu0", error);
    if (status == FOVEA_OK) status = fv_path_join(sensor, imu, "sensor.yaml", error);
    if (status == FOVEA_OK) status = fv_path_join(data, imu, "data.csv", error);
    if (status != FOVEA_OK) return status;
    fv_listing_reads(listing, sensor);
    fv_listing_reads(listing, data);
    status = fv_euroc_imu_sensor(sensor, &info->rig.imu, error);
    if (status == FOVEA_OK) status = fv_euroc_imu_samples(data, &samples, error);
    info->rig.has_imu = status == FOVEA_OK;
    fv_listing_set_samples(listing, &samples);
    return status;
}

/* The folder that holds cam0: `mav0` of the address, or the address itself. */
static enum fovea_status find_mav(const char *folder, char mav[FV_PATH_BYTES],
                                  struct fovea_error *error)
{
    char cam[FV_PATH_BYTES];
    enum fovea_status status = fv_path_join(mav, folder, "mav0", error);
    if (status != FOVEA_OK || fv_path_exists(mav)) return status;
    status = fv_path_join(cam, folder, "cam0", error);
    return status == FOVEA_OK && fv_path_exists(cam) ? fv_path_join(mav, folder, ".", error)
                                                     : status;
}

static enum fovea_status open_euroc(const char *address,
                                    const struct fovea_source_selection *selection,
                                    struct fovea_source **source, struct fovea_error *error)
{
    char folder[FV_PATH_BYTES], mav[FV_PATH_BYTES], cam[FV_PATH_BYTES], list[FV_PATH_BYTES];
    struct fv_rig_options options;
    struct fovea_source_info info = {.rate_hz = 0.0};
    enum fovea_status status = fv_rig_options("euroc", address, true, folder, &options, error);
    if (status == FOVEA_OK && options.imu && selection->reverse)
        return fovea_error_set(
            error, FOVEA_ERROR_UNSUPPORTED,
            "euroc: imu: found 1 in reverse, expected 0: a sensor's samples do not turn round");
    if (status == FOVEA_OK) status = find_mav(folder, mav, error);
    if (status == FOVEA_OK) status = fv_path_join(cam, mav, "cam0", error);
    if (status != FOVEA_OK) return status;
    struct fv_listing *listing = read_camera(cam, list, error);
    if (listing == NULL) return fv_kind_hint("euroc", folder, FOVEA_ERROR_INPUT, error);
    status = read_extras(listing, cam, mav, selection, &info, error);
    if (status == FOVEA_OK && options.cameras == 2)
        status = read_second(listing, mav, selection, &info, error);
    if (status == FOVEA_OK && options.imu) status = read_imu(listing, mav, &info, error);
    if (status != FOVEA_OK) {
        fv_listing_free(listing);
        return fv_kind_hint("euroc", folder, status, error);
    }
    return fv_listing_open(listing, list, selection, &info, source, error);
}

const struct fovea_source_ops fv_source_euroc = FV_PLAYER_OPS(
    "euroc",
    "DIR[?OPTION=VALUE&...]  EuRoC data set in ASL layout (DIR/mav0/cam0); options cameras (1 or 2), imu (0 or 1)",
    open_euroc);
