/* Recordings in the layout of the TUM RGB-D benchmark: rgb.txt, groundtruth.txt; camera.yaml where
 * somebody put one. Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS
 * 2012. */
#include <string.h>

#include "kind.h"
#include "lines.h"
#include "listing.h"
#include "player.h"

static enum fovea_status read_extras(struct fv_listing *listing, const char *folder,
                                     const struct fovea_source_selection *selection,
                                     struct fovea_source_info *info, struct fovea_error *error)
{
    static const double identity[12] = {1, 0, 0, 0, 0, 1,
                                        0, 0, 0, 0, 1, 0}; /* its poses are the camera's */
    char path[FV_PATH_BYTES];
    enum fovea_status status = fv_path_join(path, folder, "camera.yaml", error);
    if (status == FOVEA_OK) fv_listing_reads(listing, path);
    if (status == FOVEA_OK)
        status = fv_info_set_calibration(info, path, selection, NULL, NULL, error);
    if (status != FOVEA_OK ||
        (status = fv_path_join(path, folder, "groundtruth.txt", error)) != FOVEA_OK)
        return status;
    fv_listing_reads(listing, path);
    if (!fv_path_exists(path)) return FOVEA_OK;
    struct fv_poses poses;
    status = fv_poses_read(path, FV_POSES_TUM, identity, &poses, error);
    if (status == FOVEA_OK) fv_listing_set_poses(listing, &poses);
    return status;
}

static enum fovea_status open_tum(const char *address,
                                  const struct fovea_source_selection *selection,
                                  struct fovea_source **source, struct fovea_error *error)
{
    char list[FV_PATH_BYTES];
    struct fovea_source_info info = {.rate_hz = 0.0};
    enum fovea_status status = fv_path_join(list, address, "rgb.txt", error);
    if (status != FOVEA_OK) return status;
    struct fv_listing *listing = fv_listing_new(address);
    if (listing == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", address);
    fv_listing_reads(listing, list);
    status = fv_listing_read(listing, list, "", fv_stamp_from_seconds, "seconds", error);
    if (status == FOVEA_OK) status = read_extras(listing, address, selection, &info, error);
    if (status != FOVEA_OK) {
        fv_listing_free(listing);
        return fv_kind_hint("tum", address, status, error);
    }
    return fv_listing_open(listing, list, selection, &info, source, error);
}

const struct fovea_source_ops fv_source_tum =
    FV_PLAYER_OPS("tum", "DIR  recording in TUM RGB-D layout (DIR/rgb.txt)", open_tum);
