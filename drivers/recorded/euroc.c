/* EuRoC data sets in ASL layout: mav0/cam0/{data.csv,data/,sensor.yaml},
 * mav0/state_groundtruth_estimate0/data.csv. Burri et al., "The EuRoC micro aerial vehicle
 * datasets", IJRR 2016. */
#include <string.h>

#include "support/text.h"
#include "kind.h"
#include "lines.h"
#include "listing.h"
#include "player.h"

/* What stands beside the list, as far as it is there. */
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

static enum fovea_status open_euroc(const char *address,
                                    const struct fovea_source_selection *selection,
                                    struct fovea_source **source, struct fovea_error *error)
{
    char mav[FV_PATH_BYTES], cam[FV_PATH_BYTES], data[FV_PATH_BYTES], list[FV_PATH_BYTES];
    struct fovea_source_info info = {.rate_hz = 0.0};
    enum fovea_status status = fv_path_join(mav, address, "mav0", error);
    if (status == FOVEA_OK && !fv_path_exists(mav)) {
        status = fv_path_join(cam, address, "cam0", error);
        if (status == FOVEA_OK && fv_path_exists(cam))
            status = fv_path_join(mav, address, ".", error);
    }
    if (status == FOVEA_OK) status = fv_path_join(cam, mav, "cam0", error);
    if (status == FOVEA_OK) status = fv_path_join(data, cam, "data", error);
    if (status == FOVEA_OK) status = fv_path_join(list, cam, "data.csv", error);
    if (status != FOVEA_OK) return status;
    struct fv_listing *listing = fv_listing_new(data);
    if (listing == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", address);
    fv_listing_reads(listing, list);
    fv_listing_reads(listing, data);
    status = fv_listing_read(listing, list, ",", fovea_text_integer, "whole nanoseconds", error);
    if (status == FOVEA_OK) status = read_extras(listing, cam, mav, selection, &info, error);
    if (status != FOVEA_OK) {
        fv_listing_free(listing);
        return fv_kind_hint("euroc", address, status, error);
    }
    return fv_listing_open(listing, list, selection, &info, source, error);
}

const struct fovea_source_ops fovea_source_euroc =
    FV_PLAYER_OPS("euroc", "DIR  EuRoC data set in ASL layout (DIR/mav0/cam0)", open_euroc);
