/* Calibrations as single programs keep them: ORB-SLAM3, Basalt, PhotonVision. */
#include "support/calibration_reader.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef const struct fv_yaml_node node;
typedef const struct fv_calibration_reader reader;

/* "cam1" is 1, NULL is 0; negative for anything else. */
static long camera_index(const char *which)
{
    if (which == NULL) return 0;
    const bool digits = strncmp(which, "cam", 3) == 0 && which[3] != '\0' && strlen(which) < 6 &&
                        strspn(which + 3, "0123456789") == strlen(which + 3);
    return digits ? strtol(which + 3, NULL, 10) : -1;
}

static enum fovea_status refuse_which(reader *r, node *where, const char *which, size_t cameras)
{
    *r->absent = true;
    return fovea_error_set(r->error, FOVEA_ERROR_INPUT,
                           "%s:%u: found %zu camera%s, expected '%.32s' among cam0 to cam%zu",
                           r->tree->file, where->line, cameras, cameras == 1 ? "" : "s", which,
                           cameras > 0 ? cameras - 1 : 0);
}

/* ---- ORB-SLAM3 ------------------------------------------------------------------------------- */

/* The value of "Camera1.fx" for the prefix "Camera1" and the name "fx". */
static node *dotted(reader *r, const char *prefix, const char *name)
{
    char key[64];
    snprintf(key, sizeof key, "%s.%s", prefix, name);
    return fv_yaml_child(r->tree->root, key);
}

static enum fovea_status read_dotted(reader *r, const char *prefix, const char *name, double min,
                                     double max, double *value)
{
    char key[64];
    node *found;
    snprintf(key, sizeof key, "%s.%s", prefix, name);
    const enum fovea_status status = fv_yaml_require(r->tree, r->tree->root, key, &found, r->error);
    return status != FOVEA_OK ? status : fv_yaml_number(r->tree, found, min, max, value, r->error);
}

/* Type, focal lengths, centre and distortion of one camera. */
static enum fovea_status read_orbslam3_camera(reader *r, const char *prefix)
{
    static const char *const types[] = {"PinHole", "KannalaBrandt8", "Rectified"};
    static const char *const pinhole[] = {"k1", "k2", "p1", "p2", "k3"};
    static const char *const fisheye[] = {"k1", "k2", "k3", "k4"};
    static const char *const none[] = {"k4", "k5", "k6"};
    struct fovea_camera *m = &r->calibration->camera;
    node *type;
    size_t kind;
    enum fovea_status status =
        fv_yaml_require(r->tree, r->tree->root, "Camera.type", &type, r->error);
    if (status != FOVEA_OK) return status;
    status = fv_yaml_choice(r->tree, type, types, 3, &kind, r->error);
    if (status != FOVEA_OK) return status;
    double *const firsts[] = {&m->fx, &m->fy, &m->cx, &m->cy};
    for (int i = 0; i < 4; i++) {
        const double low = i < 2 ? FOVEA_CAMERA_FOCAL_MIN_PX : -FOVEA_CAMERA_CENTRE_MAX_PX;
        const double high = i < 2 ? FOVEA_CAMERA_FOCAL_MAX_PX : FOVEA_CAMERA_CENTRE_MAX_PX;
        status =
            read_dotted(r, prefix, fv_calibration_parameter_name(m->lens, i), low, high, firsts[i]);
        if (status != FOVEA_OK) return status;
    }
    if (kind == 2) return FOVEA_OK;
    if (kind == 1) m->lens = FOVEA_LENS_EQUIDISTANT;
    const char *const *names = kind == 1 ? fisheye : pinhole;
    for (int i = 0; i < (kind == 1 ? 4 : 5); i++) {
        /* ORB-SLAM3 takes a lens with none of them, and one without k3. */
        const bool optional = kind == 0 && (i == 4 || dotted(r, prefix, "k1") == NULL);
        if (optional && dotted(r, prefix, names[i]) == NULL) continue;
        status = read_dotted(r, prefix, names[i], -1e6, 1e6, &m->k[i]);
        if (status != FOVEA_OK) return status;
    }
    for (int i = 0; i < 3 && kind == 0; i++)
        if (dotted(r, prefix, none[i]) != NULL)
            return fv_calibration_unsupported(r, dotted(r, prefix, none[i]),
                                              "no such key: ORB-SLAM3 has k1 k2 p1 p2 k3");
    return FOVEA_OK;
}

static void compose(const double A[12], const double B[12], double out[12])
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 4; j++) {
            out[4 * i + j] = j == 3 ? A[4 * i + 3] : 0.0;
            for (int k = 0; k < 3; k++)
                out[4 * i + j] += A[4 * i + k] * B[4 * k + j];
        }
    }
}

/* T_b_c1, for the second camera times T_c1_c2. */
static enum fovea_status read_orbslam3_place(reader *r, bool second)
{
    node *root = r->tree->root, *first = fv_yaml_child(root, "IMU.T_b_c1"),
         *between = fv_yaml_child(root, "Stereo.T_c1_c2");
    struct fv_calibration *c = r->calibration;
    double T[12] = {0}, T_between[12] = {0};
    if (first == NULL) first = fv_yaml_child(root, "Tbc");
    if (first == NULL || (second && between == NULL)) return FOVEA_OK;
    enum fovea_status status = fv_calibration_read_transform(r, first, T);
    if (status != FOVEA_OK) return status;
    if (second && (status = fv_calibration_read_transform(r, between, T_between)) != FOVEA_OK)
        return status;
    c->has_T_body_cam = true;
    if (second)
        compose(T, T_between, c->T_body_cam);
    else
        memcpy(c->T_body_cam, T, sizeof T);
    return FOVEA_OK;
}

enum fovea_status fv_calibration_read_orbslam3(reader *r, const char *which, bool *is)
{
    node *root = r->tree->root;
    const bool newer = fv_yaml_child(root, "Camera1.fx") != NULL;
    *is = newer || fv_yaml_child(root, "Camera.type") != NULL ||
          fv_yaml_child(root, "Camera.fx") != NULL;
    if (!*is) return FOVEA_OK;
    const size_t cameras = fv_yaml_child(root, "Camera2.fx") != NULL ? 2 : 1;
    const long index = camera_index(which);
    if (index < 0 || (size_t)index >= cameras) return refuse_which(r, root, which, cameras);
    r->calibration->format = FV_CALIBRATION_ORBSLAM3;
    node *width = fv_yaml_child(root, "Camera.width"), *rate = fv_yaml_child(root, "Camera.fps"),
         *height;
    enum fovea_status status;
    if (width != NULL) {
        status = fv_yaml_require(r->tree, root, "Camera.height", &height, r->error);
        if (status == FOVEA_OK) status = fv_calibration_read_size(r, width, height);
        if (status != FOVEA_OK) return status;
    }
    if (rate != NULL && (status = fv_yaml_number(r->tree, rate, 0, 1e6, &r->calibration->rate_hz,
                                                 r->error)) != FOVEA_OK)
        return status;
    status = read_orbslam3_camera(r, index == 1 ? "Camera2" : newer ? "Camera1" : "Camera");
    if (status != FOVEA_OK) return status;
    status = read_orbslam3_place(r, index == 1);
    if (status != FOVEA_OK || index > 0) return status; /* the record is the first camera's */
    return fv_calibration_read_record(r, root);
}

/* ---- Basalt ---------------------------------------------------------------------------------- */

static enum fovea_status read_member(reader *r, node *parent, const char *name, double min,
                                     double max, double *value)
{
    node *found;
    const enum fovea_status status = fv_yaml_require(r->tree, parent, name, &found, r->error);
    return status != FOVEA_OK ? status : fv_yaml_number(r->tree, found, min, max, value, r->error);
}

/* The child of a sequence by its place; NULL past the last. */
static node *item_of(node *sequence, size_t index)
{
    node *item = sequence == NULL || sequence->kind != FV_YAML_SEQUENCE ? NULL : sequence->first;
    while (item != NULL && index-- > 0)
        item = item->next;
    return item;
}

static enum fovea_status read_basalt_lens(reader *r, node *camera)
{
    static const char *const types[] = {"pinhole", "pinhole-radtan8", "kb4"};
    static const int coefficients[] = {0, 8, 4};
    struct fovea_camera *m = &r->calibration->camera;
    node *type, *values;
    size_t kind = 0;
    enum fovea_status status = fv_yaml_require(r->tree, camera, "camera_type", &type, r->error);
    if (status != FOVEA_OK) return status;
    while (kind < 3 && strcmp(type->value, types[kind]) != 0)
        kind++;
    if (kind == 3)
        return fv_calibration_unsupported(r, type, "one of pinhole, pinhole-radtan8, kb4");
    status = fv_yaml_require(r->tree, camera, "intrinsics", &values, r->error);
    if (status != FOVEA_OK) return status;
    m->lens = kind == 2 ? FOVEA_LENS_EQUIDISTANT : FOVEA_LENS_RADTAN;
    double *const firsts[] = {&m->fx, &m->fy, &m->cx, &m->cy};
    for (int i = 0; i < 4 + coefficients[kind]; i++) {
        const double low = i < 2   ? FOVEA_CAMERA_FOCAL_MIN_PX
                           : i < 4 ? -FOVEA_CAMERA_CENTRE_MAX_PX
                                   : -1e6;
        const double high = i < 2   ? FOVEA_CAMERA_FOCAL_MAX_PX
                            : i < 4 ? FOVEA_CAMERA_CENTRE_MAX_PX
                                    : 1e6;
        status = read_member(r, values, fv_calibration_parameter_name(m->lens, i), low, high,
                             i < 4 ? firsts[i] : &m->k[i - 4]);
        if (status != FOVEA_OK) return status;
    }
    return FOVEA_OK;
}

static void rotation_of(const double q[4], double T[12])
{
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double rows[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                               {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                               {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
    for (int i = 0; i < 3; i++)
        memcpy(T + 4 * i, rows[i], sizeof rows[i]);
}

/* The identity means that the place is not known: every file must state one. */
static enum fovea_status read_basalt_place(reader *r, node *place)
{
    static const char *const names[] = {"qx", "qy", "qz", "qw", "px", "py", "pz"};
    double v[7] = {0}, norm = 0;
    struct fv_calibration *c = r->calibration;
    for (int i = 0; i < 7; i++) {
        const double bound = i < 4 ? 2 : 1e300;
        const enum fovea_status status = read_member(r, place, names[i], -bound, bound, &v[i]);
        if (status != FOVEA_OK) return status;
        if (i < 4) norm += v[i] * v[i];
    }
    norm = sqrt(norm);
    if (!(fabs(norm - 1) < 1e-3))
        return fv_yaml_refuse(r->tree, place, "a quaternion qx qy qz qw of length 1", r->error);
    for (int i = 0; i < 4; i++)
        v[i] /= norm;
    rotation_of(v, c->T_body_cam);
    for (int i = 0; i < 3; i++)
        c->T_body_cam[4 * i + 3] = v[4 + i];
    c->has_T_body_cam = !(fabs(v[3]) == 1 && v[4] == 0 && v[5] == 0 && v[6] == 0);
    if (!c->has_T_body_cam) memset(c->T_body_cam, 0, sizeof c->T_body_cam);
    return FOVEA_OK;
}

enum fovea_status fv_calibration_read_basalt(reader *r, const char *which, bool *is)
{
    node *root = fv_yaml_child(r->tree->root, "value0"), *cameras;
    *is = root != NULL;
    if (!*is) return FOVEA_OK;
    r->calibration->format = FV_CALIBRATION_BASALT;
    enum fovea_status status = fv_yaml_require(r->tree, root, "intrinsics", &cameras, r->error);
    if (status != FOVEA_OK) return status;
    if (cameras->kind != FV_YAML_SEQUENCE || cameras->count == 0)
        return fv_yaml_refuse(r->tree, cameras, "a list of cameras", r->error);
    const long index = camera_index(which);
    if (index < 0 || (size_t)index >= cameras->count)
        return refuse_which(r, cameras, which, cameras->count);
    status = read_basalt_lens(r, item_of(cameras, (size_t)index));
    if (status != FOVEA_OK) return status;
    node *size = item_of(fv_yaml_child(root, "resolution"), (size_t)index);
    if (size != NULL && (size->kind != FV_YAML_SEQUENCE || size->count != 2))
        return fv_yaml_refuse(r->tree, size, "a list of 2 numbers: width, height", r->error);
    if (size != NULL &&
        (status = fv_calibration_read_size(r, size->first, size->first->next)) != FOVEA_OK)
        return status;
    node *place = item_of(fv_yaml_child(root, "T_imu_cam"), (size_t)index);
    if (place != NULL && (status = read_basalt_place(r, place)) != FOVEA_OK) return status;
    node *shift = fv_yaml_child(root, "cam_time_offset_ns");
    double shift_ns = 0;
    if (shift != NULL &&
        (status = fv_yaml_number(r->tree, shift, -1e12, 1e12, &shift_ns, r->error)) != FOVEA_OK)
        return status;
    r->calibration->has_time_shift = shift_ns != 0;
    r->calibration->time_shift_s = shift_ns / 1e9;
    return index > 0 ? FOVEA_OK : fv_calibration_read_record(r, r->tree->root);
}

/* ---- PhotonVision ---------------------------------------------------------------------------- */

/* Its sizes are numbers with a point. */
static enum fovea_status read_whole(reader *r, node *parent, const char *name, int32_t *value)
{
    double found = 0;
    node *child;
    enum fovea_status status = fv_yaml_require(r->tree, parent, name, &child, r->error);
    if (status != FOVEA_OK) return status;
    status = fv_yaml_number(r->tree, child, 1, 65535, &found, r->error);
    if (status != FOVEA_OK) return status;
    if (found != floor(found))
        return fv_yaml_refuse(r->tree, child, "a whole number in [1, 65535]", r->error);
    *value = (int32_t)found;
    return FOVEA_OK;
}

enum fovea_status fv_calibration_read_photonvision(reader *r, bool *is)
{
    node *root = r->tree->root, *matrix = fv_yaml_child(root, "cameraIntrinsics"), *size,
         *distortion = fv_yaml_child(root, "distCoeffs"), *model = fv_yaml_child(root, "lensmodel");
    *is = matrix != NULL;
    if (!*is) return FOVEA_OK;
    r->calibration->format = FV_CALIBRATION_PHOTONVISION;
    enum fovea_status status = fv_yaml_require(r->tree, root, "resolution", &size, r->error);
    if (status != FOVEA_OK) return status;
    if ((status = read_whole(r, size, "width", &r->calibration->camera.width)) != FOVEA_OK)
        return status;
    if ((status = read_whole(r, size, "height", &r->calibration->camera.height)) != FOVEA_OK)
        return status;
    if (model != NULL && strcmp(model->value, "LENSMODEL_OPENCV") != 0)
        return fv_calibration_unsupported(r, model, "LENSMODEL_OPENCV");
    if (distortion == NULL) distortion = fv_yaml_child(root, "cameraExtrinsics"); /* up to 2023 */
    if (distortion == NULL) return fv_yaml_require(r->tree, root, "distCoeffs", &size, r->error);
    if ((status = fv_calibration_read_matrix(r, matrix)) != FOVEA_OK) return status;
    if ((status = fv_calibration_read_distortion(r, distortion)) != FOVEA_OK) return status;
    return fv_calibration_read_record(r, root);
}
