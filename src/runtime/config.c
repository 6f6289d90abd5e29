#include "runtime/config.h"

#include <string.h>

#include "fovea/elementary.h"

void fovea_config_default(struct fovea_config *config)
{
    memset(config, 0, sizeof *config);
    config->features = (struct fovea_features_config){
        .count_max = 1000, .pyramid_levels = 8, .threshold = 20, .threshold_min = 7, .per_cell = 2};
    config->odometry = (struct fovea_odometry_config){.enabled = true,
                                                      .keyframes = 128,
                                                      .landmarks = 16000,
                                                      .window = 8,
                                                      .inliers_good = 40,
                                                      .lost_frames_reset = 15,
                                                      .loops = true};
    config->detect = (struct fovea_detect_config){.period_frames = 1, .count_max = 100};
    config->scale.camera_height_m = 1;
    config->track = (struct fovea_track_config){.mode = FOVEA_TRACK_SORT,
                                                .tracks_max = 128,
                                                .confirm_hits = 2,
                                                .score_confirm = 0.5,
                                                .score_high = 0.4,
                                                .score_low = 0.2,
                                                .score_new = 0.4,
                                                .coast_s = 2.0,
                                                .max_distance_px = 60,
                                                .max_disappeared = 20};
    config->preview = (struct fovea_preview_config){.period_frames = 10, .quality = 70, .level = 2};
    config->seed = 1;
    config->T_base_cam[0] = config->T_base_cam[5] = config->T_base_cam[10] = 1.0;
    memcpy(config->channel_prefix, "FOVEA", sizeof "FOVEA");
    config->pose_every = 1;
    config->features_every = 1;
    config->statistics_every = 30;
    config->camera_status_every = 1;
    config->map_every = 5;
}

struct range {
    const char *name;
    uint64_t value, low, high;
};

static enum fovea_status check_ranges(const struct range *ranges, size_t count,
                                      struct fovea_error *error)
{
    for (size_t i = 0; i < count; i++) {
        if (ranges[i].value < ranges[i].low || ranges[i].value > ranges[i].high) {
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                                   "%s: found %lld, expected %llu to %llu", ranges[i].name,
                                   (long long)ranges[i].value,
                                   /* of signed members too */ (unsigned long long)ranges[i].low,
                                   (unsigned long long)ranges[i].high);
        }
    }
    return FOVEA_OK;
}

static enum fovea_status check_prefix(const char prefix[32], struct fovea_error *error)
{
    if (memchr(prefix, 0, 32) == NULL || prefix[0] == 0) {
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "channel_prefix: found '%.31s'%s, expected 1 to 31 bytes", prefix,
                               prefix[0] != 0 ? " and more" : "");
    }
    for (const char *c = prefix; *c != 0; c++) {
        const bool alphanumeric =
            (*c >= 'a' && *c <= 'z') || (*c >= 'A' && *c <= 'Z') || (*c >= '0' && *c <= '9');
        if (!alphanumeric && strchr("_/.-", *c) == NULL) {
            return fovea_error_set(
                error, FOVEA_ERROR_ARGUMENT,
                "channel_prefix: found byte 0x%02x, expected letters, digits and _ / . -",
                (unsigned char)*c);
        }
    }
    return FOVEA_OK;
}

/* A rotation must be orthonormal to 1e-3: figures typed with four digits pass, a transposed scale
 * does not. */
static enum fovea_status check_transform(const double T[12], struct fovea_error *error)
{
    for (int i = 0; i < 12; i++) {
        if (!(T[i] > -1e6 && T[i] < 1e6)) {
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                                   "T_base_cam: found %g as element %d, expected -1e+06 to 1e+06",
                                   T[i], i);
        }
    }
    for (int a = 0; a < 3; a++) {
        for (int b = a; b < 3; b++) {
            const double dot =
                T[4 * a] * T[4 * b] + T[4 * a + 1] * T[4 * b + 1] + T[4 * a + 2] * T[4 * b + 2];
            const double off = dot - (a == b ? 1.0 : 0.0);
            if (off > 1e-3 || off < -1e-3) {
                return fovea_error_set(
                    error, FOVEA_ERROR_ARGUMENT,
                    "T_base_cam: found %g as product of rows %d and %d of its rotation, expected %d: orthonormal rows",
                    dot, a, b, a == b);
            }
        }
    }
    const double determinant = T[0] * (T[5] * T[10] - T[6] * T[9]) -
                               T[1] * (T[4] * T[10] - T[6] * T[8]) +
                               T[2] * (T[4] * T[9] - T[5] * T[8]);
    if (determinant < 0) {
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "T_base_cam: found a reflection, expected a rotation");
    }
    return FOVEA_OK;
}

static enum fovea_status check_real(const char *name, double value, double low, double high,
                                    struct fovea_error *error)
{
    if (value >= low && value <= high) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: found %g, expected %g to %g", name,
                           value, low, high);
}

static enum fovea_status check_track(const struct fovea_track_config *track,
                                     struct fovea_error *error)
{
    enum fovea_status status = check_real("track.score_high", track->score_high, 0, 1, error);
    if (status == FOVEA_OK)
        status = check_real("track.score_confirm", track->score_confirm, 0, 1, error);
    if (status == FOVEA_OK) status = check_real("track.score_low", track->score_low, 0, 1, error);
    if (status == FOVEA_OK) status = check_real("track.score_new", track->score_new, 0, 1, error);
    if (status == FOVEA_OK) status = check_real("track.coast_s", track->coast_s, 0, 60, error);
    if (status == FOVEA_OK)
        status = check_real("track.max_distance_px", track->max_distance_px, 1, 10000, error);
    for (int i = 0; i < FOVEA_TRACK_CLASSES_MAX && status == FOVEA_OK; i++)
        status = check_real("track.heights", (double)track->height_m[i], 0, 100, error);
    return status;
}

/* Of what fovea_camera_prepare has looked at, what would be silently wrong had it never seen the
 * camera. */
static enum fovea_status check_camera(const struct fovea_camera *camera, struct fovea_error *error)
{
    enum fovea_status status = check_real("camera fx", camera->fx, 0.001, 1e6, error);
    if (status == FOVEA_OK) status = check_real("camera fy", camera->fy, 0.001, 1e6, error);
    if (status == FOVEA_OK) status = check_real("camera cx", camera->cx, -1e5, 1e5, error);
    if (status == FOVEA_OK) status = check_real("camera cy", camera->cy, -1e5, 1e5, error);
    if (status != FOVEA_OK || (camera->field_max_rad > 0 && camera->field_max_rad <= FOVEA_PI))
        return status;
    return fovea_error_set(
        error, FOVEA_ERROR_ARGUMENT,
        "camera field_max_rad: found %g, expected what fovea_camera_prepare sets",
        camera->field_max_rad);
}

bool fv_config_movable(const struct fovea_config *config)
{
    uint32_t any = 0;
    for (int i = 0; i < FOVEA_TRACK_CLASSES_MAX / 32; i++)
        any |= config->track.movable[i];
    return any != 0;
}

static enum fovea_status check_scale(const struct fovea_scale_config *scale,
                                     struct fovea_error *error)
{
    if ((unsigned)scale->source > FOVEA_SCALE_ODOMETRY) {
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "scale.source: found %d, expected 0 to 2", (int)scale->source);
    }
    if (!(scale->camera_height_m >= 0.01 && scale->camera_height_m <= 1000)) {
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "scale.camera_height_m: found %g, expected 0.01 to 1000",
                               scale->camera_height_m);
    }
    return FOVEA_OK;
}

enum fovea_status fv_config_check(const struct fovea_config *config, struct fovea_error *error)
{
    if (config == NULL)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "config: found NULL, expected one");
    const struct fovea_features_config *f = &config->features;
    const struct range ranges[] = {
        {"camera width", (uint64_t)(int64_t)config->camera.width, FOVEA_IMAGE_WIDTH_MIN,
         FOVEA_IMAGE_WIDTH_MAX},
        {"camera height", (uint64_t)(int64_t)config->camera.height, FOVEA_IMAGE_HEIGHT_MIN,
         FOVEA_IMAGE_HEIGHT_MAX},
        {"features.count_max", f->count_max, FOVEA_FEATURES_MIN, FOVEA_FEATURES_MAX},
        {"features.pyramid_levels", f->pyramid_levels, 1, FOVEA_PYRAMID_LEVELS_MAX},
        {"features.threshold", f->threshold, 2, 100},
        {"features.threshold_min", f->threshold_min, 2, f->threshold},
        {"features.per_cell", f->per_cell, 1, 8},
        {"odometry.keyframes", config->odometry.keyframes, 8, FOVEA_ODOMETRY_KEYFRAMES_MAX},
        {"odometry.landmarks", config->odometry.landmarks, 1000, FOVEA_ODOMETRY_LANDMARKS_MAX},
        {"odometry.window", config->odometry.window, 3, 12},
        {"odometry.inliers_good", config->odometry.inliers_good, 20, 200},
        {"odometry.lost_frames_reset", config->odometry.lost_frames_reset, 1, 10000},
        {"detect.period_frames", config->detect.period_frames, 1, 1000000},
        {"detect.count_max", config->detect.count_max, 1, FOVEA_DETECTIONS_MAX},
        {"track.mode", (uint64_t)(int64_t)config->track.mode, FOVEA_TRACK_SORT, FOVEA_TRACK_OFF},
        {"track.tracks_max", config->track.tracks_max, 1, FOVEA_TRACKS_MAX},
        {"track.confirm_hits", config->track.confirm_hits, 1, 100},
        {"track.max_disappeared", config->track.max_disappeared, 0, 10000},
        {"preview.period_frames", config->preview.period_frames, 0, 1000000},
        {"preview.quality", config->preview.quality, 1, 100},
        {"preview.level", config->preview.level, 0, f->pyramid_levels - 1},
        {"pose_every", config->pose_every, 0, 1000000},
        {"features_every", config->features_every, 0, 1000000},
        {"statistics_every", config->statistics_every, 0, 1000000},
        {"camera_status_every", config->camera_status_every, 0, 1000000},
        {"map_every", config->map_every, 0, 1000000},
    };
    enum fovea_status status = check_ranges(ranges, sizeof ranges / sizeof ranges[0], error);
    if (status == FOVEA_OK) status = check_camera(&config->camera, error);
    if (status == FOVEA_OK)
        status = check_real("detect.score_threshold", config->detect.score_threshold, 0, 1, error);
    if (status == FOVEA_OK)
        status = check_real("detect.iou_threshold", config->detect.iou_threshold, 0, 1, error);
    if (status == FOVEA_OK) status = check_track(&config->track, error);
    if (status == FOVEA_OK) status = check_prefix(config->channel_prefix, error);
    if (status == FOVEA_OK) status = check_scale(&config->scale, error);
    if (status == FOVEA_OK) status = check_transform(config->T_base_cam, error);
    return status;
}
