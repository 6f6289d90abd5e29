/* KITTI odometry sequences: times.txt, image_0/NNNNNN.png (grey) or image_2 (colour), calib.txt,
 * poses.txt. Geiger, Lenz, Urtasun, "Are we ready for autonomous driving?", CVPR 2012. Its images
 * are rectified: no distortion. */
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "kind.h"
#include "lines.h"
#include "listing.h"
#include "player.h"
#include "rig_options.h"

/* "png" or "jpg", by the first frame that is there. */
static enum fovea_status find_extension(const char *images, const char **extension,
                                        struct fovea_error *error)
{
    static const char *const extensions[] = {"png", "jpg"};
    enum { LOOKED_AT = 1000 };
    char name[32], path[FV_PATH_BYTES];
    *extension = extensions[0];
    for (int i = 0; i < 2 * LOOKED_AT; i++) {
        snprintf(name, sizeof name, "%06d.%s", i / 2, extensions[i % 2]);
        const enum fovea_status status = fv_path_join(path, images, name, error);
        if (status != FOVEA_OK) return status;
        if (!fv_path_exists(path)) continue;
        *extension = extensions[i % 2];
        return FOVEA_OK;
    }
    return FOVEA_OK;
}

/* Names are the frames' numbers. */
static enum fovea_status read_list(struct fv_listing *listing, const char *times,
                                   const char *images, struct fovea_error *error)
{
    char name[32];
    const char *extension;
    struct fv_lines lines;
    enum fovea_status status = find_extension(images, &extension, error);
    if (status == FOVEA_OK) status = fv_lines_open(&lines, times, error);
    if (status != FOVEA_OK) return status;
    while ((status = fv_lines_next(&lines, "", error)) == FOVEA_OK) {
        int64_t stamp_ns;
        snprintf(name, sizeof name, "%06zu.%s", fv_listing_count(listing), extension);
        status = fv_stamp_from_seconds(lines.fields[0], &stamp_ns)
                     ? fv_listing_add(listing, stamp_ns, name, error)
                     : fv_lines_refuse(&lines, "time", lines.fields[0], "seconds", error);
        if (status != FOVEA_OK) break;
    }
    fv_lines_close(&lines);
    return status == FOVEA_END ? FOVEA_OK : status;
}

/* The row "P0: fx 0 cx tx 0 fy cy ty 0 0 1 tz": K [I | t] in the frame of the first grey camera,
 * which is the body's here (x right, y down, z forward). */
static enum fovea_status take_projection(const struct fv_lines *lines, uint32_t at,
                                         struct fovea_source_info *info, struct fovea_error *error)
{
    double P[12];
    const enum fovea_status status = fv_lines_numbers(lines, lines->fields[0], 1, 12, P, error);
    if (status != FOVEA_OK) return status;
    const bool projection = P[0] > 0.001 && P[0] < 1e6 && P[5] > 0.001 && P[5] < 1e6 && P[1] == 0 &&
                            P[4] == 0 && P[8] == 0 && P[9] == 0 && P[10] == 1 && P[2] > -1e5 &&
                            P[2] < 1e5 && P[6] > -1e5 && P[6] < 1e5;
    if (!projection)
        return fv_lines_refuse(lines, lines->fields[0], lines->fields[1],
                               "a projection fx 0 cx tx 0 fy cy ty 0 0 1 tz", error);
    struct fovea_rig_camera *camera = &info->rig.cameras[at];
    *camera = (struct fovea_rig_camera){
        .calibrated = true,
        .has_T_body_cam = true,
        .camera = {.lens = FOVEA_LENS_RADTAN, .fx = P[0], .fy = P[5], .cx = P[2], .cy = P[6]},
        .T_body_cam = {1, 0, 0, (P[11] * P[2] - P[3]) / P[0], 0, 1, 0, (P[11] * P[6] - P[7]) / P[5],
                       0, 0, 1, -P[11]}};
    snprintf(info->cameras[at].origin, sizeof info->cameras[at].origin, "%s", lines->file);
    return FOVEA_OK;
}

/* Of camera `at` of the rig. */
static enum fovea_status read_calibration(const char *path, const char *key, uint32_t at,
                                          struct fovea_source_info *info, struct fovea_error *error)
{
    struct fv_lines lines;
    enum fovea_status status = fv_lines_open(&lines, path, error);
    if (status != FOVEA_OK) return status;
    while (!info->rig.cameras[at].calibrated &&
           (status = fv_lines_next(&lines, "", error)) == FOVEA_OK)
        if (strcmp(lines.fields[0], key) == 0 &&
            (status = take_projection(&lines, at, info, error)) != FOVEA_OK)
            break;
    if (status == FOVEA_END)
        status = fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: found no line '%s', expected it",
                                 path, key);
    fv_lines_close(&lines);
    return status;
}

/* DIR/poses.txt; where there is none, poses/07.txt beside a folder sequences/07, as in the
 * benchmark's own archives. */
static enum fovea_status find_poses(const char *folder, char path[FV_PATH_BYTES],
                                    struct fovea_error *error)
{
    char whole[PATH_MAX];
    const enum fovea_status status = fv_path_join(path, folder, "poses.txt", error);
    if (status != FOVEA_OK || fv_path_exists(path) || realpath(folder, whole) == NULL)
        return status;
    char *number = strrchr(whole, '/');
    *number++ = '\0';
    char *sequences = strrchr(whole, '/');
    if (sequences == NULL || strcmp(sequences, "/sequences") != 0) return FOVEA_OK;
    *sequences = '\0';
    snprintf(path, FV_PATH_BYTES, "%.2000s/poses/%.255s.txt", whole, number);
    return FOVEA_OK;
}

static enum fovea_status read_extras(struct fv_listing *listing, const char *folder,
                                     const char *key,
                                     const struct fovea_source_selection *selection,
                                     struct fovea_source_info *info, struct fovea_error *error)
{
    char path[FV_PATH_BYTES];
    enum fovea_status status = fv_path_join(path, folder, "calib.txt", error);
    if (status == FOVEA_OK) fv_listing_reads(listing, path);
    if (status == FOVEA_OK && fv_path_exists(path))
        status = read_calibration(path, key, 0, info, error);
    if (status == FOVEA_OK && fv_path_exists(path) && info->rig.camera_count == 2)
        status = read_calibration(path, "P1:", 1, info, error);
    if (status != FOVEA_OK && selection->camera_given)
        status = FOVEA_OK; /* its own is not needed */
    if (status != FOVEA_OK || (status = find_poses(folder, path, error)) != FOVEA_OK) return status;
    fv_listing_reads(listing, path);
    if (!fv_path_exists(path)) return FOVEA_OK;
    struct fv_poses poses;
    status = fv_poses_read_kitti(path, &poses, error);
    if (status == FOVEA_OK) fv_listing_set_poses(listing, &poses);
    return status;
}

/* The same stamps, other images. */
static enum fovea_status read_second(struct fv_listing *listing, const char *folder,
                                     const char *times, struct fovea_error *error)
{
    char images[FV_PATH_BYTES];
    enum fovea_status status = fv_path_join(images, folder, "image_1", error);
    if (status == FOVEA_OK && !fv_path_exists(images))
        status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                 "%s: found no such folder, expected the second camera's images",
                                 images);
    if (status != FOVEA_OK) return status;
    struct fv_listing *second = fv_listing_new(images);
    if (second == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", images);
    fv_listing_reads(second, images);
    status = read_list(second, times, images, error);
    if (status == FOVEA_OK) return fv_listing_pair(listing, second, error);
    fv_listing_free(second);
    return status;
}

static enum fovea_status open_kitti(const char *address,
                                    const struct fovea_source_selection *selection,
                                    struct fovea_source **source, struct fovea_error *error)
{
    char folder[FV_PATH_BYTES], times[FV_PATH_BYTES], images[FV_PATH_BYTES];
    struct fv_rig_options options;
    struct fovea_source_info info = {.rate_hz = 0.0};
    const char *key = "P0:";
    enum fovea_status status = fv_rig_options("kitti", address, false, folder, &options, error);
    if (status == FOVEA_OK) status = fv_path_join(times, folder, "times.txt", error);
    if (status == FOVEA_OK) status = fv_path_join(images, folder, "image_0", error);
    if (status == FOVEA_OK && !fv_path_exists(images)) {
        key = "P2:";
        status = fv_path_join(images, folder, "image_2", error);
    }
    if (status != FOVEA_OK) return status;
    struct fv_listing *listing = fv_listing_new(images);
    if (listing == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: out of memory", folder);
    info.rig.camera_count = (uint32_t)options.cameras;
    fv_listing_reads(listing, times);
    fv_listing_reads(listing, images);
    status = read_list(listing, times, images, error);
    if (status == FOVEA_OK) status = read_extras(listing, folder, key, selection, &info, error);
    if (status == FOVEA_OK && options.cameras == 2)
        status = read_second(listing, folder, times, error);
    if (status != FOVEA_OK) {
        fv_listing_free(listing);
        return fv_kind_hint("kitti", folder, status, error);
    }
    return fv_listing_open(listing, times, selection, &info, source, error);
}

const struct fovea_source_ops fv_source_kitti = FV_PLAYER_OPS(
    "kitti",
    "DIR[?cameras=2]  KITTI odometry sequence (DIR/image_0, DIR/times.txt); with two cameras DIR/image_1 too",
    open_kitti);
