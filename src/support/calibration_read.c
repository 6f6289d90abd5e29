#include "support/calibration_reader.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fovea/image.h"

typedef const struct fv_yaml_node node;

/* The first of several spellings that is there, or NULL. */
static node *any_of(node *parent, const char *const *keys)
{
    for (; *keys != NULL; keys++) {
        node *child = fv_yaml_child(parent, *keys);
        if (child != NULL) return child;
    }
    return NULL;
}

/* ---- size, name, model ----------------------------------------------------------------------- */

static enum fovea_status read_resolution(const struct fv_calibration_reader *r, node *parent)
{
    node *list;
    enum fovea_status status = fv_yaml_require(r->tree, parent, "resolution", &list, r->error);
    if (status != FOVEA_OK) return status;
    if (list->kind != FV_YAML_SEQUENCE || list->count != 2)
        return fv_yaml_refuse(r->tree, list, "a list of 2 numbers: width, height", r->error);
    return fv_calibration_read_size(r, list->first, list->first->next);
}

static enum fovea_status read_intrinsics(const struct fv_calibration_reader *r, node *parent)
{
    static const size_t order[4] = {0, 1, 2, 3};
    double values[4] = {0};
    node *list;
    enum fovea_status status = fv_yaml_require(r->tree, parent, "intrinsics", &list, r->error);
    if (status != FOVEA_OK) return status;
    if ((status = fv_yaml_numbers(r->tree, list, 4, 4, values, NULL, r->error)) != FOVEA_OK)
        return status;
    return fv_calibration_set_pinhole(r, list, values, order);
}

static const struct model {
    const char *name;
    enum fovea_lens lens;
} models[] = {
    {"plumb_bob", FOVEA_LENS_RADTAN},        {"rational_polynomial", FOVEA_LENS_RADTAN},
    {"radtan", FOVEA_LENS_RADTAN},           {"radial-tangential", FOVEA_LENS_RADTAN},
    {"equidistant", FOVEA_LENS_EQUIDISTANT}, {"equi", FOVEA_LENS_EQUIDISTANT},
    {"fisheye", FOVEA_LENS_EQUIDISTANT},     {"none", FOVEA_LENS_RADTAN},
};

static enum fovea_status read_model(const struct fv_calibration_reader *r, node *name)
{
    for (size_t i = 0; i < sizeof models / sizeof models[0]; i++) {
        if (name->kind != FV_YAML_SCALAR || strcmp(name->value, models[i].name) != 0) continue;
        r->calibration->camera.lens = models[i].lens;
        return FOVEA_OK;
    }
    return fv_calibration_unsupported(
        r, name,
        "one of plumb_bob, rational_polynomial, radtan, radial-tangential, equidistant, equi, fisheye, none");
}

static enum fovea_status read_name(const struct fv_calibration_reader *r, node *name)
{
    const char *text = "";
    if (name == NULL || (name->kind == FV_YAML_SCALAR && name->value[0] == '\0')) return FOVEA_OK;
    const enum fovea_status status =
        fv_yaml_string(r->tree, name, sizeof r->calibration->name - 1, &text, r->error);
    if (status == FOVEA_OK) snprintf(r->calibration->name, sizeof r->calibration->name, "%s", text);
    return status;
}

/* ---- the formats ----------------------------------------------------------------------------- */

static const char *const matrix_keys[] = {
    "camera_matrix", "Camera_Matrix", "cameraMatrix", "K", "k", "M1", NULL};
static const char *const distortion_keys[] = {"distortion_coefficients",
                                              "Distortion_Coefficients",
                                              "distCoeffs",
                                              "dist_coeffs",
                                              "D",
                                              "d",
                                              "D1",
                                              NULL};
static const char *const width_keys[] = {"image_width", "image_Width", "width", NULL};
static const char *const height_keys[] = {"image_height", "image_Height", "height", NULL};

/* Parts of camera_info that say that images are not the sensor's whole grid: refused unless they
 * say nothing.
 */
static enum fovea_status refuse_binning(const struct fv_calibration_reader *r)
{
    static const char *const keys[] = {"binning_x", "binning_y"};
    static const char *const offsets[] = {"x_offset", "y_offset"};
    for (int i = 0; i < 2; i++) {
        node *binning = fv_yaml_child(r->tree->root, keys[i]);
        if (binning != NULL && strcmp(binning->value, "0") != 0 && strcmp(binning->value, "1") != 0)
            return fv_calibration_unsupported(r, binning,
                                              "0 or 1 (calibrate the images as they come)");
        node *offset = fv_yaml_child(fv_yaml_child(r->tree->root, "roi"), offsets[i]);
        if (offset != NULL && strcmp(offset->value, "0") != 0)
            return fv_calibration_unsupported(r, offset, "0 (calibrate the images as they come)");
    }
    return FOVEA_OK;
}

/* ROS camera_info in both spellings and OpenCV FileStorage differ in keys only. */
static enum fovea_status read_matrix_format(const struct fv_calibration_reader *r)
{
    node *root = r->tree->root, *matrix = any_of(root, matrix_keys),
         *distortion = any_of(root, distortion_keys);
    node *width = any_of(root, width_keys), *height = any_of(root, height_keys);
    node *model = fv_yaml_child(root, "distortion_model"),
         *fisheye = fv_yaml_child(root, "fisheye_model");
    enum fovea_status status;
    r->calibration->format = model == NULL            ? FV_CALIBRATION_OPENCV
                             : matrix->key[1] == '\0' ? FV_CALIBRATION_ROS_MESSAGE
                                                      : FV_CALIBRATION_ROS;
    if (distortion == NULL)
        return fv_yaml_require(r->tree, root, matrix->key[1] == '\0' ? "D" : distortion_keys[0],
                               &distortion, r->error);
    if (width != NULL && height == NULL)
        return fv_yaml_require(r->tree, root,
                               width->key[0] == 'i' ? height_keys[0] : height_keys[2], &height,
                               r->error);
    if (width == NULL && height != NULL)
        return fv_yaml_require(r->tree, root, height->key[0] == 'i' ? width_keys[0] : width_keys[2],
                               &width, r->error);
    if (width != NULL && (status = fv_calibration_read_size(r, width, height)) != FOVEA_OK)
        return status;
    if (model != NULL && (status = read_model(r, model)) != FOVEA_OK) return status;
    if (fisheye != NULL) {
        bool is_fisheye;
        int64_t flag;
        if (fv_yaml_integer(r->tree, fisheye, 0, 1, &flag, NULL) == FOVEA_OK)
            is_fisheye = flag == 1;
        else if ((status = fv_yaml_bool(r->tree, fisheye, &is_fisheye, r->error)) != FOVEA_OK)
            return status;
        if (is_fisheye) r->calibration->camera.lens = FOVEA_LENS_EQUIDISTANT;
    }
    if ((status = refuse_binning(r)) != FOVEA_OK) return status;
    if ((status = read_name(r, fv_yaml_child(root, "camera_name"))) != FOVEA_OK) return status;
    if ((status = fv_calibration_read_matrix(r, matrix)) != FOVEA_OK) return status;
    if ((status = fv_calibration_read_distortion(r, distortion)) != FOVEA_OK) return status;
    return fv_calibration_read_record(r, root);
}

/* What Kalibr and EuRoC files have in common: projection, intrinsics, distortion, resolution. */
static enum fovea_status read_pinhole_format(const struct fv_calibration_reader *r, node *parent,
                                             const char *distortion_key)
{
    node *projection, *model, *distortion;
    enum fovea_status status;
    if ((status = fv_yaml_require(r->tree, parent, "camera_model", &projection, r->error)) !=
        FOVEA_OK)
        return status;
    if (projection->kind != FV_YAML_SCALAR || strcmp(projection->value, "pinhole") != 0)
        return fv_calibration_unsupported(r, projection, "pinhole");
    if ((status = read_intrinsics(r, parent)) != FOVEA_OK) return status;
    if ((status = read_resolution(r, parent)) != FOVEA_OK) return status;
    if ((status = fv_yaml_require(r->tree, parent, "distortion_model", &model, r->error)) !=
        FOVEA_OK)
        return status;
    if ((status = read_model(r, model)) != FOVEA_OK) return status;
    if (strcmp(model->value, "none") == 0) return FOVEA_OK;
    if ((status = fv_yaml_require(r->tree, parent, distortion_key, &distortion, r->error)) !=
        FOVEA_OK)
        return status;
    return fv_calibration_read_distortion(r, distortion);
}

static enum fovea_status read_euroc(const struct fv_calibration_reader *r)
{
    node *root = r->tree->root, *transform = fv_yaml_child(root, "T_BS"),
         *rate = fv_yaml_child(root, "rate_hz");
    r->calibration->format = FV_CALIBRATION_EUROC;
    enum fovea_status status = read_pinhole_format(r, root, "distortion_coefficients");
    if (status != FOVEA_OK) return status;
    if (rate != NULL && (status = fv_yaml_number(r->tree, rate, 0, 1e6, &r->calibration->rate_hz,
                                                 r->error)) != FOVEA_OK)
        return status;
    if ((status = fv_calibration_read_record(r, root)) != FOVEA_OK || transform == NULL)
        return status;
    r->calibration->has_T_body_cam = true;
    return fv_calibration_read_transform(r, transform, r->calibration->T_body_cam);
}

/* The camera before camN in its chain; NULL: there is none. */
static node *camera_before(const struct fv_calibration_reader *r, node *camera)
{
    char key[32];
    const char *number = camera->key + 3;
    const long index = strlen(number) <= 4 ? strtol(number, NULL, 10) : 0;
    if (index <= 0) return NULL;
    snprintf(key, sizeof key, "cam%ld", index - 1);
    node *before = fv_yaml_child(r->tree->root, key);
    return before != NULL && before->kind == FV_YAML_MAPPING ? before : NULL;
}

/* T_cam_body: T_cam_imu, or through T_cn_cnm1 from the camera before, the first of which is the
 * body where it has no T_cam_imu. */
static enum fovea_status read_place(const struct fv_calibration_reader *r, node *camera,
                                    double T_cam_body[12], bool *placed)
{
    double T_cam_last[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}, step[12], product[12];
    enum fovea_status status;
    *placed = false;
    for (node *each = camera, *before;; each = before) {
        node *transform = fv_yaml_child(each, "T_cam_imu"),
             *chained = fv_yaml_child(each, "T_cn_cnm1");
        before = camera_before(r, each);
        const bool last = transform != NULL || chained == NULL || before == NULL;
        if (last && transform == NULL) break;
        status = fv_calibration_read_transform(r, last ? transform : chained, step);
        if (status != FOVEA_OK) return status;
        fv_calibration_multiply(T_cam_last, step, product);
        memcpy(T_cam_last, product, sizeof product);
        *placed = true;
        if (last) break;
    }
    memcpy(T_cam_body, T_cam_last, sizeof T_cam_last);
    return FOVEA_OK;
}

static enum fovea_status read_kalibr(const struct fv_calibration_reader *r, node *camera)
{
    r->calibration->format = FV_CALIBRATION_KALIBR;
    snprintf(r->calibration->name, sizeof r->calibration->name, "%.63s", camera->key);
    enum fovea_status status = read_pinhole_format(r, camera, "distortion_coeffs");
    if (status != FOVEA_OK) return status;
    if ((status = fv_calibration_read_record(r, camera)) != FOVEA_OK) return status;
    node *shift = fv_yaml_child(camera, "timeshift_cam_imu");
    r->calibration->has_time_shift = shift != NULL;
    if (shift != NULL &&
        (status = fv_yaml_number(r->tree, shift, -1e3, 1e3, &r->calibration->time_shift_s,
                                 r->error)) != FOVEA_OK)
        return status;
    double T_cam_body[12] = {0};
    bool placed = false;
    status = read_place(r, camera, T_cam_body, &placed);
    if (status != FOVEA_OK || !placed) return status;
    fv_calibration_invert(T_cam_body, r->calibration->T_body_cam);
    r->calibration->has_T_body_cam = true;
    return FOVEA_OK;
}

/* ---- choosing -------------------------------------------------------------------------------- */

/* The camera of a camchain: a mapping below a key "camN". */
static node *find_camchain(node *root, const char *which)
{
    for (node *each = root->first; root->kind == FV_YAML_MAPPING && each != NULL; each = each->next)
        if (each->kind == FV_YAML_MAPPING && strncmp(each->key, "cam", 3) == 0 &&
            each->key[3] >= '0' && each->key[3] <= '9' &&
            (which == NULL || strcmp(each->key, which) == 0))
            return each;
    return NULL;
}

static enum fovea_status read_any(const struct fv_calibration_reader *r, const char *which)
{
    node *root = r->tree->root, *missing;
    bool is;
    enum fovea_status status = fv_calibration_read_orbslam3(r, which, &is);
    if (is) return status;
    status = fv_calibration_read_basalt(r, which, &is);
    if (is) return status;
    if (which != NULL || find_camchain(root, NULL) != NULL) {
        node *camera = find_camchain(root, which);
        if (camera != NULL) return read_kalibr(r, camera);
        node *other = fv_yaml_child(root, which);
        if (other != NULL)
            return fv_yaml_refuse(r->tree, other, "a mapping with the keys of a camera", r->error);
        *r->absent = root->kind == FV_YAML_MAPPING;
        return fv_yaml_require(r->tree, root, which, &missing, r->error);
    }
    status = fv_calibration_read_photonvision(r, &is);
    if (is) return status;
    if (any_of(root, matrix_keys) != NULL) return read_matrix_format(r);
    if (fv_yaml_child(root, "intrinsics") != NULL || fv_yaml_child(root, "T_BS") != NULL)
        return read_euroc(r);
    if (root->count == 0 || root->kind != FV_YAML_MAPPING)
        return fovea_error_set(
            r->error, FOVEA_ERROR_INPUT,
            "%s:%u: found no keys, expected a camera calibration (camera_matrix, K, intrinsics or cam0)",
            r->tree->file, root->line);
    /* One of the keys misspelt is named as such. */
    static const char *const heads[] = {"camera_matrix", "cameraMatrix", "intrinsics", "cam0",
                                        NULL};
    for (size_t i = 0; heads[i] != NULL; i++)
        for (node *each = root->first; each != NULL; each = each->next)
            if (strcmp(each->key, heads[i]) == 0)
                return fv_yaml_refuse(r->tree, each, "a mapping with the keys of a camera",
                                      r->error);
            else if (strlen(each->key) > 3 && fv_text_nearest(each->key, &heads[i], 1) != NULL)
                return fv_yaml_require(r->tree, root, heads[i], &missing, r->error);
    char quoted[FV_TEXT_QUOTED_BYTES];
    return fovea_error_set(
        r->error, FOVEA_ERROR_INPUT,
        "%s:%u: found the key %s first, expected one of camera_matrix, K, intrinsics, cam0 in the file",
        r->tree->file, root->first->line, fv_text_quote(root->first->key, quoted, sizeof quoted));
}

static enum fovea_status read_tree(const struct fv_yaml_tree *tree, const char *which,
                                   struct fv_calibration *calibration, bool *absent,
                                   struct fovea_error *error)
{
    struct fv_calibration found = {0};
    const struct fv_calibration_reader reader = {
        .tree = tree, .calibration = &found, .error = error, .absent = absent};
    *absent = false;
    enum fovea_status status = read_any(&reader, which);
    if (status != FOVEA_OK) return status;
    struct fovea_error why = {0};
    status = fovea_camera_prepare(&found.camera, &why);
    if (status != FOVEA_OK) return fovea_error_set(error, status, "%s: %s", tree->file, why.text);
    *calibration = found;
    return FOVEA_OK;
}

enum fovea_status fv_calibration_parse(const char *name, const char *text, size_t bytes,
                                       const char *which, struct fv_calibration *calibration,
                                       struct fovea_error *error)
{
    struct fv_yaml_tree *tree;
    bool absent;
    enum fovea_status status = fv_yaml_parse(name, text, bytes, &tree, error);
    if (status != FOVEA_OK) return status;
    status = read_tree(tree, which, calibration, &absent, error);
    fv_yaml_free(tree);
    return status;
}

static enum fovea_status read_file(const char *path, const char *which,
                                   struct fv_calibration *calibration, bool *absent,
                                   struct fovea_error *error)
{
    struct fv_yaml_tree *tree;
    *absent = false;
    enum fovea_status status = fv_yaml_read(path, &tree, error);
    if (status != FOVEA_OK) return status;
    status = read_tree(tree, which, calibration, absent, error);
    fv_yaml_free(tree);
    return status;
}

enum fovea_status fv_calibration_read(const char *path, const char *which,
                                      struct fv_calibration *calibration, struct fovea_error *error)
{
    bool absent;
    return read_file(path, which, calibration, &absent, error);
}

enum fovea_status fv_calibration_read_if_there(const char *path, const char *which,
                                               struct fv_calibration *calibration, bool *found,
                                               struct fovea_error *error)
{
    bool absent;
    const enum fovea_status status = read_file(path, which, calibration, &absent, error);
    *found = status == FOVEA_OK;
    return absent ? FOVEA_OK : status;
}
