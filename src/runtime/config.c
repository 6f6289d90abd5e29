#include "runtime/config.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "base/elementary.h"
#include "grid/grid.h"
#include "image/preprocess.h"
#include "stereo/stereo.h"

static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

void fovea_config_default(struct fovea_config *config)
{
    memset(config, 0, sizeof *config);
#define FV_KEY(name, kind, member, min, max, value, unit, words, cost, help)                       \
    FV_CONFIG_SET_##kind(config->member, max, value);
#include "runtime/config.def"
    config->rig.camera_count = 1;
    config->rig.cameras[0].calibrated = config->rig.cameras[0].has_T_body_cam = true;
}

/* ---- single keys ----------------------------------------------------------------------------- */

struct key {
    const char *name;
    enum fv_config_kind kind;
    bool live;
    size_t offset, bytes;
    int64_t min, max;
    double real_min, real_max;
};

#define ROW(name, kind, live, member, min, max)                                                    \
    {name,                                                                                         \
     FV_CONFIG_##kind,                                                                             \
     live,                                                                                         \
     offsetof(struct fovea_config, member),                                                        \
     sizeof(((struct fovea_config *)0)->member),                                                   \
     (int64_t)(min),                                                                               \
     (int64_t)(max),                                                                               \
     (double)(min),                                                                                \
     (double)(max)},

static const struct key keys[] = {
#define FV_KEY(name, kind, member, min, max, value, unit, words, cost, help)                       \
    ROW(name, kind, false, member, min, max)
#define FV_LIVE_KEY(name, kind, member, min, max, value, unit, words, cost, help)                  \
    ROW(name, kind, true, member, min, max)
#include "runtime/config.def"
};

static enum fovea_status check_whole(const char *name, int64_t value, int64_t min, int64_t max,
                                     struct fovea_error *error)
{
    if (value >= min && value <= max) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: found %lld, expected %lld to %lld",
                           name, (long long)value, (long long)min, (long long)max);
}

static enum fovea_status check_real(const char *name, double value, double min, double max,
                                    struct fovea_error *error)
{
    if (value >= min && value <= max) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: found %g, expected %g to %g", name,
                           value, min, max);
}

static enum fovea_status check_text(const struct key *key, const char *text,
                                    struct fovea_error *error)
{
    const int max = (int)key->max;
    const bool ends = memchr(text, 0, (size_t)max + 1) != NULL;
    if (ends && (int64_t)strlen(text) >= key->min) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                           "%s: found '%.*s'%s, expected %d to %d bytes", key->name, max, text,
                           ends ? "" : " and more", (int)key->min, max);
}

static enum fovea_status check_elements(const struct key *key, const double T[12],
                                        struct fovea_error *error)
{
    for (int i = 0; i < 12; i++) {
        if (T[i] >= key->real_min && T[i] <= key->real_max) continue;
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "%s: found %g as element %d, expected %g to %g", key->name, T[i], i,
                               key->real_min, key->real_max);
    }
    return FOVEA_OK;
}

static enum fovea_status check_key(const struct key *key, const struct fovea_config *config,
                                   struct fovea_error *error)
{
    const char *at = (const char *)config + key->offset;
    switch (key->kind) {
    case FV_CONFIG_U32:
    case FV_CONFIG_FLAGS:
        return check_whole(key->name, *(const uint32_t *)at, key->min, key->max, error);
    case FV_CONFIG_I32:
    case FV_CONFIG_CHOICE:
        return check_whole(key->name, *(const int32_t *)at, key->min, key->max, error);
    case FV_CONFIG_REAL:
        return check_real(key->name, *(const double *)at, key->real_min, key->real_max, error);
    case FV_CONFIG_TEXT:
        return check_text(key, at, error);
    case FV_CONFIG_LIST:
        return check_whole(key->name, *(const uint32_t *)at, key->min, key->max, error);
    case FV_CONFIG_TRANSFORM:
        return check_elements(key, (const double *)at, error);
    case FV_CONFIG_U64: /* the seed: every value is one, though files hold 63 bits */
    case FV_CONFIG_BOOL:
        return FOVEA_OK;
    }
    return FOVEA_OK;
}

/* ---- what a range cannot say ----------------------------------------------------------------- */

static enum fovea_status check_prefix(const char prefix[32], struct fovea_error *error)
{
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
static enum fovea_status check_rotation(const char *name, const double T[12],
                                        struct fovea_error *error)
{
    for (int a = 0; a < 3; a++) {
        for (int b = a; b < 3; b++) {
            const double dot =
                T[4 * a] * T[4 * b] + T[4 * a + 1] * T[4 * b + 1] + T[4 * a + 2] * T[4 * b + 2];
            const double off = dot - (a == b ? 1.0 : 0.0);
            if (!(off <= 1e-3 && off >= -1e-3)) {
                return fovea_error_set(
                    error, FOVEA_ERROR_ARGUMENT,
                    "%s: found %g as product of rows %d and %d of its rotation, expected %d: orthonormal rows",
                    name, dot, a, b, a == b);
            }
        }
    }
    const double determinant = T[0] * (T[5] * T[10] - T[6] * T[9]) -
                               T[1] * (T[4] * T[10] - T[6] * T[8]) +
                               T[2] * (T[4] * T[9] - T[5] * T[8]);
    if (determinant < 0) {
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "%s: found a reflection, expected a rotation", name);
    }
    return FOVEA_OK;
}

static enum fovea_status check_size(const char *name, const struct fovea_camera *camera,
                                    struct fovea_error *error)
{
    char member[64];
    snprintf(member, sizeof member, "%s width", name);
    const enum fovea_status status =
        check_whole(member, camera->width, FOVEA_IMAGE_WIDTH_MIN, FOVEA_IMAGE_WIDTH_MAX, error);
    if (status != FOVEA_OK) return status;
    snprintf(member, sizeof member, "%s height", name);
    return check_whole(member, camera->height, FOVEA_IMAGE_HEIGHT_MIN, FOVEA_IMAGE_HEIGHT_MAX,
                       error);
}

/* The checks of fovea_camera_prepare without which a camera that was not prepared would give wrong
 * results unnoticed. */
static enum fovea_status check_camera(const char *name, const struct fovea_camera *camera,
                                      struct fovea_error *error)
{
    const double focal_max = FOVEA_CAMERA_FOCAL_MAX_PX, centre_max = FOVEA_CAMERA_CENTRE_MAX_PX;
    const struct {
        const char *name;
        double value, min, max;
    } members[] = {{"fx", camera->fx, FOVEA_CAMERA_FOCAL_MIN_PX, focal_max},
                   {"fy", camera->fy, FOVEA_CAMERA_FOCAL_MIN_PX, focal_max},
                   {"cx", camera->cx, -centre_max, centre_max},
                   {"cy", camera->cy, -centre_max, centre_max}};
    enum fovea_status status = check_size(name, camera, error);
    for (size_t i = 0; i < sizeof members / sizeof members[0] && status == FOVEA_OK; i++) {
        char member[64];
        snprintf(member, sizeof member, "%s %s", name, members[i].name);
        status = check_real(member, members[i].value, members[i].min, members[i].max, error);
    }
    if (status != FOVEA_OK || (camera->field_max_rad > 0 && camera->field_max_rad <= FV_PI))
        return status;
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                           "%s field_max_rad: found %g, expected what fovea_camera_prepare sets",
                           name, camera->field_max_rad);
}

static enum fovea_status check_rig_camera(uint32_t index, const struct fovea_rig_camera *camera,
                                          struct fovea_error *error)
{
    static const char *const names[FOVEA_CAMERAS_MAX] = {
        "camera", "rig.cameras[1].camera", "rig.cameras[2].camera", "rig.cameras[3].camera"};
    static const char *const poses[FOVEA_CAMERAS_MAX] = {"T_body_cam", "rig.cameras[1].T_body_cam",
                                                         "rig.cameras[2].T_body_cam",
                                                         "rig.cameras[3].T_body_cam"};
    const char *name = names[index];
    enum fovea_status status = FOVEA_OK;
    if (index == 0 && !(camera->calibrated && camera->has_T_body_cam))
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT,
            "rig.cameras[0]: found no %s, expected that of the camera for odometry",
            camera->calibrated ? "T_body_cam" : "calibration");
    if (camera->calibrated)
        status = check_camera(name, &camera->camera, error);
    else if (camera->mask != NULL)
        status = check_size(name, &camera->camera, error);
    if (status != FOVEA_OK || !camera->has_T_body_cam) return status;
    return check_rotation(poses[index], camera->T_body_cam, error);
}

static enum fovea_status check_imu(const struct fovea_rig_imu *imu, struct fovea_error *error)
{
    const struct {
        const char *name;
        double value;
    } members[] = {{"rig.imu.rate_hz", imu->rate_hz},
                   {"rig.imu.gyro_noise", imu->gyro_noise},
                   {"rig.imu.gyro_walk", imu->gyro_walk},
                   {"rig.imu.acceleration_noise", imu->acceleration_noise},
                   {"rig.imu.acceleration_walk", imu->acceleration_walk},
                   {"rig.imu.gyro_range", imu->gyro_range},
                   {"rig.imu.acceleration_range", imu->acceleration_range}};
    enum fovea_status status = check_rotation("rig.imu.T_body_imu", imu->T_body_imu, error);
    for (size_t i = 0; i < sizeof members / sizeof members[0] && status == FOVEA_OK; i++)
        status = check_real(members[i].name, members[i].value, 0, 1e12, error);
    return status;
}

static enum fovea_status check_rig(const struct fovea_rig *rig, struct fovea_error *error)
{
    enum fovea_status status =
        check_whole("rig.camera_count", rig->camera_count, 1, FOVEA_CAMERAS_MAX, error);
    for (uint32_t i = 0; status == FOVEA_OK && i < rig->camera_count; i++)
        status = check_rig_camera(i, &rig->cameras[i], error);
    return status == FOVEA_OK && rig->has_imu ? check_imu(&rig->imu, error) : status;
}

const char *fv_config_stereo_lacks(const struct fovea_rig *rig)
{
    const struct fovea_rig_camera *second = &rig->cameras[1];
    if (rig->camera_count < 2) return "one camera";
    if (!second->calibrated) return "a second camera without a calibration";
    if (!second->has_T_body_cam) return "a second camera without T_body_cam";
    if (!fv_stereo_serves(rig->cameras[0].T_body_cam, second->T_body_cam))
        return "a second camera less than 5 mm from the first";
    return NULL;
}

bool fv_config_stereo(const struct fovea_config *config)
{
    const enum fovea_sensors sensors = config->odometry.sensors;
    return config->odometry.enabled && sensors != FOVEA_SENSORS_MONO &&
           sensors != FOVEA_SENSORS_MONO_INERTIAL && fv_config_stereo_lacks(&config->rig) == NULL;
}

static bool asks_inertial(enum fovea_sensors sensors)
{
    return sensors == FOVEA_SENSORS_MONO_INERTIAL || sensors == FOVEA_SENSORS_STEREO_INERTIAL;
}

bool fv_config_inertial(const struct fovea_config *config)
{
    const enum fovea_sensors sensors = config->odometry.sensors;
    return config->odometry.enabled && config->rig.has_imu &&
           (asks_inertial(sensors) ||
            (sensors == FOVEA_SENSORS_AUTO && config->scale.source == FOVEA_SCALE_FREE));
}

static enum fovea_status check_sensors(const struct fovea_config *config, struct fovea_error *error)
{
    const char *lacks = fv_config_stereo_lacks(&config->rig);
    const enum fovea_sensors sensors = config->odometry.sensors;
    if (asks_inertial(sensors) && !config->rig.has_imu)
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT,
            "odometry.sensors: found %s without an inertial sensor, expected a rig that has one, auto, mono or stereo",
            sensors == FOVEA_SENSORS_MONO_INERTIAL ? "mono_inertial" : "stereo_inertial");
    if (asks_inertial(sensors) && config->scale.source != FOVEA_SCALE_FREE)
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT,
            "odometry.sensors: found %s with a scale source, expected scale.source free: the inertial sensor gives the metres",
            sensors == FOVEA_SENSORS_MONO_INERTIAL ? "mono_inertial" : "stereo_inertial");
    if ((sensors != FOVEA_SENSORS_STEREO && sensors != FOVEA_SENSORS_STEREO_INERTIAL) ||
        lacks == NULL)
        return FOVEA_OK;
    return fovea_error_set(
        error, FOVEA_ERROR_ARGUMENT,
        "odometry.sensors: found stereo with %s, expected two cameras with calibrations and places on the body, or mono",
        lacks);
}

bool fv_config_movable(const struct fovea_config *config)
{
    uint32_t any = 0;
    for (int i = 0; i < FOVEA_OBJECT_CLASSES_MAX / 32; i++)
        any |= config->objects.movable[i];
    return any != 0;
}

/* Pictures have more methods than the loop. */
static enum fovea_status check_method(enum fovea_feature_method method, struct fovea_error *error)
{
    if (method != FOVEA_FEATURES_SIFT && method != FOVEA_FEATURES_SURF) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                           "features.method: found %s, expected fast, orb, harris or shi_tomasi: "
                           "the loop compares binary descriptors, which %s has not",
                           method == FOVEA_FEATURES_SIFT ? "sift" : "surf",
                           method == FOVEA_FEATURES_SIFT ? "sift" : "surf");
}

/* Limits that depend on another key. */
static enum fovea_status check_pairs(const struct fovea_config *config, struct fovea_error *error)
{
    const struct fovea_features_config *features = &config->features;
    if (features->threshold_min > features->threshold)
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT,
            "features.threshold_min: found %u, expected at most features.threshold, which is %u",
            features->threshold_min, features->threshold);
    if (config->preview.level >= features->pyramid_levels)
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT,
            "preview.level: found %u, expected less than features.pyramid_levels, which is %u",
            config->preview.level, features->pyramid_levels);
    if (config->detect2.model != NULL && config->detect.model == NULL)
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT,
            "detect2.model: found a network, expected detect.model to be set too");
    return FOVEA_OK;
}

/* A camera over the floor, and a range that the grid holds. */
static enum fovea_status check_grid(const struct fovea_config *config, struct fovea_error *error)
{
    const struct fovea_grid_job_config *job = &config->grid_job;
    const double height = config->rig.cameras[0].T_body_cam[11], least_m = 0.01;
    if (!job->enabled && job->grid.heights)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "grid.heights: found true, expected grid.enabled to be true too: "
                               "heights are those of its cells");
    if (!job->enabled) return FOVEA_OK;
    if (job->grid.heights && !job->landmarks)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "grid.heights: found true with grid.landmarks false, expected that "
                               "true: heights are of its points");
    if (!config->odometry.enabled)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "grid.enabled: found odometry.enabled false, expected true: the "
                               "grid stands on poses");
    if (!(height >= least_m))
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "grid.enabled: found a camera %g m over z = 0 of the body, which is "
                               "the floor, expected T_body_cam to state its height, at least %g m",
                               height, least_m);
    return fv_grid_check(&job->grid, error);
}

/* What single ranges do not say of the chain. */
static enum fovea_status check_chain(const struct fovea_image_config *image,
                                     struct fovea_error *error)
{
    const struct fovea_preprocess_config *chain = &image->preprocess;
    const struct {
        const char *name;
        uint32_t size;
    } sizes[] = {{"image.denoise_size", chain->denoise_size},
                 {"image.sharpen_size", chain->sharpen_size}};
    for (size_t i = 0; i < 2; i++)
        if (sizes[i].size % 2 == 0)
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s: found %u, expected 3, 5 or 7",
                                   sizes[i].name, sizes[i].size);
    if (chain->normalize_low >= chain->normalize_high)
        return fovea_error_set(
            error, FOVEA_ERROR_ARGUMENT,
            "image.normalize_low: found %u, expected less than image.normalize_high, which is %u",
            chain->normalize_low, chain->normalize_high);
    for (uint32_t i = 0; i < chain->operations.count; i++)
        if ((unsigned)chain->operations.items[i] >= FOVEA_OPERATION_COUNT)
            return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                                   "image.operations: found operation %u, expected 0 to %d",
                                   (unsigned)chain->operations.items[i], FOVEA_OPERATION_COUNT - 1);
    if (fv_preprocess_balances(chain) && (image->seen_by & FOVEA_VIEWER_NETWORKS) == 0)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "image.operations: found white_balance, expected networks in "
                               "image.seen_by: nobody else looks at colours");
    return FOVEA_OK;
}

static enum fovea_status check_edges(const struct fovea_edges_config *edges,
                                     struct fovea_error *error)
{
    if (edges->method == FOVEA_EDGES_CANNY && edges->low > edges->high)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "edges.low: found %g, expected at most edges.high, which is %g",
                               edges->low, edges->high);
    if (edges->laplacian_size == 2)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "edges.laplacian_size: found 2, expected 1 or 3");
    return FOVEA_OK;
}

static enum fovea_status check_heights(const struct fovea_objects_config *objects,
                                       struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    for (int i = 0; i < FOVEA_OBJECT_CLASSES_MAX && status == FOVEA_OK; i++)
        status = check_real("objects.heights", (double)objects->height_m[i], 0,
                            FOVEA_OBJECT_HEIGHT_MAX_M, error);
    return status;
}

void fv_config_take_live(struct fovea_config *config, const struct fovea_config *from)
{
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
        if (keys[i].live)
            memcpy((char *)config + keys[i].offset, (const char *)from + keys[i].offset,
                   keys[i].bytes);
}

/* Limits between several live keys. */
static enum fovea_status check_together(const struct fovea_config *config,
                                        struct fovea_error *error)
{
    enum fovea_status status = check_pairs(config, error);
    if (status == FOVEA_OK) status = check_chain(&config->image, error);
    return status == FOVEA_OK ? check_edges(&config->edge_job.edges, error) : status;
}

enum fovea_status fv_config_check_live(const struct fovea_config *config, struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    for (size_t i = 0; i < sizeof keys / sizeof keys[0] && status == FOVEA_OK; i++)
        if (keys[i].live) status = check_key(&keys[i], config, error);
    return status == FOVEA_OK ? check_together(config, error) : status;
}

enum fovea_status fv_config_check(const struct fovea_config *config, struct fovea_error *error)
{
    if (config == NULL)
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "config: found NULL, expected one");
    enum fovea_status status = check_method(config->features.method, error);
    for (size_t i = 0; i < sizeof keys / sizeof keys[0] && status == FOVEA_OK; i++)
        status = check_key(&keys[i], config, error);
    if (status == FOVEA_OK) status = check_rig(&config->rig, error);
    if (status == FOVEA_OK) status = check_sensors(config, error);
    if (status == FOVEA_OK) status = check_together(config, error);
    if (status == FOVEA_OK) status = check_heights(&config->objects, error);
    if (status == FOVEA_OK) status = check_grid(config, error);
    return status == FOVEA_OK ? check_prefix(config->channel_prefix, error) : status;
}
