/* Calibrations as single programs keep them: ORB-SLAM3, Basalt, PhotonVision. */
#include "support/calibration_writer.h"

#include <math.h>
#include <string.h>

bool fv_calibration_whole_rate(const struct fv_calibration *c)
{
    return c->rate_hz >= 1 && c->rate_hz == floor(c->rate_hz);
}

static double parameter(const struct fovea_camera *m, int index)
{
    const double first[4] = {m->fx, m->fy, m->cx, m->cy};
    return index < 4 ? first[index] : m->k[index - 4];
}

/* ---- ORB-SLAM3 ------------------------------------------------------------------------------- */

/* The camera's part of a settings file. ORB-SLAM3 reads matrices of floats only. */
void fv_calibration_write_orbslam3(struct fv_calibration_writer *w, const struct fv_calibration *c)
{
    const struct fovea_camera *m = &c->camera;
    const bool fisheye = m->lens == FOVEA_LENS_EQUIDISTANT;
    fv_calibration_put(w, "%%YAML:1.0\n---\nFile.version: \"1.0\"\nCamera.type: \"%s\"\n",
                       fisheye ? "KannalaBrandt8" : "PinHole");
    for (int i = 0; i < (fisheye ? 8 : 9); i++) {
        const double value = parameter(m, i);
        fv_calibration_put(w, "Camera1.%s: ", fv_calibration_parameter_name(m->lens, i));
        fv_calibration_put_numbers(w, &value, 1);
        fv_calibration_put(w, "\n");
    }
    fv_calibration_put(w, "Camera.width: %d\nCamera.height: %d\n", m->width, m->height);
    if (fv_calibration_whole_rate(c)) fv_calibration_put(w, "Camera.fps: %.0f\n", c->rate_hz);
    if (c->has_T_body_cam) {
        fv_calibration_put(w, "IMU.T_b_c1: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: f\n"
                              "   data: [");
        fv_calibration_put_numbers(w, c->T_body_cam, 12);
        fv_calibration_put(w, ", 0.0, 0.0, 0.0, 1.0]\n");
    }
    fv_calibration_put_record(w, 0, c, true);
}

/* ---- JSON ------------------------------------------------------------------------------------ */

static void put_member(struct fv_calibration_writer *w, const char *name, double value, bool last)
{
    fv_calibration_put(w, "\"%s\": ", name);
    fv_calibration_put_numbers(w, &value, 1);
    if (!last) fv_calibration_put(w, ", ");
}

/* The unit quaternion x y z w of a rotation: the largest component is found first, so that no
 * division loses digits. */
static void quaternion_of(const double T[12], double q[4])
{
    const double xx = T[0], yy = T[5], zz = T[10];
    const double squares[4] = {1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz,
                               1 + xx + yy + zz};
    int largest = 0;
    for (int i = 1; i < 4; i++)
        if (squares[i] > squares[largest]) largest = i;
    const double half = 2 * sqrt(squares[largest]);                  /* four times the component */
    const double plus[3] = {T[9] + T[6], T[2] + T[8], T[4] + T[1]};  /* yz, xz, xy */
    const double minus[3] = {T[9] - T[6], T[2] - T[8], T[4] - T[1]}; /* xw, yw, zw */
    for (int i = 0; i < 3; i++)
        if (i != largest) q[i] = (largest == 3 ? minus[i] : plus[3 - i - largest]) / half;
    if (largest < 3) q[3] = minus[largest] / half;
    q[largest] = half / 4;
    double norm = 0;
    for (int i = 0; i < 4; i++)
        norm += q[i] * q[i];
    for (int i = 0; i < 4; i++)
        q[i] /= sqrt(norm);
}

/* The radius at distance 1 up to which Basalt projects: where the lens model still grows. */
static double radius_max(const struct fovea_camera *camera)
{
    struct fovea_camera prepared = *camera;
    return fovea_camera_prepare(&prepared, NULL) == FOVEA_OK ? tan(prepared.field_max_rad) : 0;
}

static void put_basalt_place(struct fv_calibration_writer *w, const struct fv_calibration *c)
{
    static const char *const names[] = {"px", "py", "pz", "qx", "qy", "qz", "qw"};
    double v[7] = {0, 0, 0, 0, 0, 0, 1};
    if (c->has_T_body_cam) {
        for (int i = 0; i < 3; i++)
            v[i] = c->T_body_cam[4 * i + 3];
        quaternion_of(c->T_body_cam, v + 3);
    }
    for (int i = 0; i < 7; i++)
        put_member(w, names[i], v[i], i == 6);
}

void fv_calibration_write_basalt(struct fv_calibration_writer *w, const struct fv_calibration *c)
{
    const struct fovea_camera *m = &c->camera;
    const bool fisheye = m->lens == FOVEA_LENS_EQUIDISTANT;
    bool ideal = true;
    for (int i = 0; i < FOVEA_LENS_COEFFICIENTS; i++)
        ideal &= m->k[i] == 0;
    const int count = fisheye ? 8 : ideal ? 4 : 12;
    fv_calibration_put(w, "{\n  \"value0\": {\n    \"T_imu_cam\": [{");
    put_basalt_place(w, c);
    fv_calibration_put(w, "}],\n    \"intrinsics\": [{\"camera_type\": \"%s\", \"intrinsics\": {",
                       fisheye ? "kb4"
                       : ideal ? "pinhole"
                               : "pinhole-radtan8");
    for (int i = 0; i < count; i++)
        put_member(w, fv_calibration_parameter_name(m->lens, i), parameter(m, i),
                   i == count - 1 && count != 12);
    if (count == 12) put_member(w, "rpmax", radius_max(m), true);
    fv_calibration_put(w,
                       "}}],\n    \"resolution\": [[%d, %d]],\n    \"vignette\": [],\n"
                       "    \"cam_time_offset_ns\": %.0f\n  }",
                       m->width, m->height, c->has_time_shift ? c->time_shift_s * 1e9 : 0);
    fv_calibration_put_record(w, 2, c, true);
    fv_calibration_put(w, "\n}\n");
}

static void put_json_matrix(struct fv_calibration_writer *w, const char *name, int rows, int cols,
                            const double *values)
{
    fv_calibration_put(w, "  \"%s\": {\"rows\": %d, \"cols\": %d, \"type\": 6, \"data\": [", name,
                       rows, cols);
    fv_calibration_put_numbers(w, values, (size_t)rows * (size_t)cols);
    fv_calibration_put(w, "]},\n");
}

void fv_calibration_write_photonvision(struct fv_calibration_writer *w,
                                       const struct fv_calibration *c)
{
    const struct fovea_camera *m = &c->camera;
    const double K[9] = {m->fx, 0, m->cx, 0, m->fy, m->cy, 0, 0, 1};
    fv_calibration_put(w, "{\n  \"resolution\": {\"width\": %d.0, \"height\": %d.0},\n", m->width,
                       m->height);
    put_json_matrix(w, "cameraIntrinsics", 3, 3, K);
    put_json_matrix(w, "distCoeffs", 1, (int)fv_calibration_coefficient_count(m, 5), m->k);
    fv_calibration_put(w, "  \"calobjectWarp\": [],\n  \"observations\": [],\n"
                          "  \"calobjectSize\": {\"width\": 0.0, \"height\": 0.0},\n"
                          "  \"calobjectSpacing\": 0.0,\n  \"lensmodel\": \"LENSMODEL_OPENCV\"");
    fv_calibration_put_record(w, 2, c, true);
    fv_calibration_put(w, "\n}\n");
}
