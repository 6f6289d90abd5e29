/* Camera models. Radial-tangential: D. C. Brown, "Close-range camera calibration" (1971), with the
 * rational terms of Claus and Fitzgibbon as OpenCV orders them. Equidistant: J. Kannala and S.
 * Brandt, "A generic camera model and calibration method for conventional, wide-angle, and fish-eye
 * lenses" (PAMI 2006), radially symmetric part. */
#include "fovea/camera.h"

#include <stdbool.h>
#include <stddef.h>

#include "base/elementary.h"
#include "geometry/radtan.h"

enum {
    SCAN_STEPS = 2048,
    BISECTIONS = 48,
    AZIMUTHS = 16,
    EQUIDISTANT_STEPS = 60,
    GRID_COLUMNS = 16,
    GRID_ROWS = 12
};

static const double field_limit_radtan_rad = 1.56; /* the image plane reaches infinity at pi/2 */
static const double field_min_rad =
    0.02; /* a lens that folds back earlier is a wrong calibration */
static const double fraction_seen_min =
    0.4; /* of the image that sees something: a circular fish-eye leaves the corners dark */
static const double residual_max = 1e-9; /* of unprojection, on the plane at distance 1 */

/* ---- radial-tangential ----------------------------------------------------------------------- */

/* Radial factor at r2 and its derivative by r2. False where the rational model's pole has been
 * passed. */
static bool radial_scale(const double *k, double r2, double *scale, double *derivative)
{
    double above, above_derivative, below = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    fv_radtan_above(k, r2, &above, &above_derivative);
    double below_derivative = k[5] + r2 * (2 * k[6] + r2 * 3 * k[7]);
    if (!(below > 1e-9)) return false;
    if (below == 1 && below_derivative == 0) { /* as mostly; without the divisions by 1 */
        *scale = above;
        *derivative = above_derivative;
        return true;
    }
    *scale = above / below;
    *derivative = (above_derivative - *scale * below_derivative) / below;
    return true;
}

/* Distort a point of the plane at distance 1. */
static bool radtan_place(const double *k, double x, double y, double out[2])
{
    const double r2 = x * x + y * y, below = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    double above, unused;
    if (!(below > 1e-9)) return false;
    fv_radtan_above(k, r2, &above, &unused);
    fv_radtan_place(k, x, y, r2, above / below, &out[0], &out[1]);
    return true;
}

/* The same, bit for bit, and the 2x2 derivative `j`, row-major, which is half of the work. */
static bool radtan_distort(const double *k, double x, double y, double out[2], double j[4])
{
    double r2 = x * x + y * y, scale, derivative, u, v, xx, xy, yy;
    if (!radial_scale(k, r2, &scale, &derivative)) return false;
    fv_radtan_place(k, x, y, r2, scale, &u, &v);
    fv_radtan_slopes(k, x, y, scale, derivative, &xx, &xy, &yy);
    out[0] = u;
    out[1] = v;
    j[0] = xx;
    j[1] = j[2] = xy;
    j[3] = yy;
    return true;
}

/* Directions about the axis in which a camera is looked at; one where it is the same in all. */
struct azimuths {
    int count;
    double cosine[AZIMUTHS], sine[AZIMUTHS];
};

static void azimuths_of(const double *k, struct azimuths *of)
{
    const double first = fv_atan2(k[2], k[3]);
    of->count = k[2] != 0 || k[3] != 0 ? AZIMUTHS : 1;
    for (int i = 0; i < of->count; i++) {
        const double azimuth = first + i * (2 * FV_PI / AZIMUTHS);
        of->cosine[i] = fv_cos(azimuth);
        of->sine[i] = fv_sin(azimuth);
    }
}

/* One-to-one at this angle: the derivative keeps its orientation in every direction. */
static bool radtan_monotone(const double *k, const struct azimuths *in, double angle_rad)
{
    double r = fv_tan(angle_rad);
    for (int i = 0; i < in->count; i++) {
        double out[2], j[4];
        if (!radtan_distort(k, r * in->cosine[i], r * in->sine[i], out, j)) return false;
        if (!(j[0] * j[3] - j[1] * j[2] > 0 && j[0] + j[3] > 0)) return false;
    }
    return true;
}

/* The field's edge on the undistorted plane. A tangent is larger than its angle, and only where
 * that does not tell is it needed. */
static double radius_max(const struct fovea_camera *camera)
{
    return fv_tan(camera->field_max_rad);
}

static bool radius_inside(const struct fovea_camera *camera, double r)
{
    return r <= camera->field_max_rad || r <= radius_max(camera);
}

/* Of a point at the squared distance r2 from the axis. */
static bool plane_inside(const struct fovea_camera *camera, double r2, double slack)
{
    const double field = camera->field_max_rad;
    if (r2 <= field * field) return true;
    const double edge = radius_max(camera);
    return r2 <= edge * edge * (1 + slack);
}

/* Radius on the undistorted plane whose purely radial distortion gives `distorted`: Newton kept
 * inside a bracket, whose upper end is the field's edge until one is found. */
static double radtan_radius(const struct fovea_camera *camera, double distorted)
{
    double low = 0, high = -1, scale, derivative, error, slope;
    double r = radius_inside(camera, distorted) ? distorted : radius_max(camera);
    for (int i = 0; i < FV_RADTAN_RADIAL_STEPS; i++) {
        if (!radial_scale(camera->k, r * r, &scale, &derivative))
            return high < 0 ? radius_max(camera) : high;
        fv_radtan_radial_error(r, distorted, scale, derivative, &error, &slope);
        if (error > 0)
            high = r;
        else
            low = r;
        double next = r - error / slope;
        if (!(slope > 0 && next >= low && (high < 0 ? radius_inside(camera, next) : next <= high)))
            next = 0.5 * (low + (high < 0 ? radius_max(camera) : high));
        double step = next - r;
        r = next;
        if (fv_radtan_radius_found(step, r)) break;
    }
    return r;
}

/* Undistorted plane point of distorted (u, v), and the derivative of distortion there. */
static bool radtan_undistort(const struct fovea_camera *camera, double u, double v, double out[2],
                             double j[4])
{
    const double *k = camera->k;
    double distorted = __builtin_sqrt(u * u + v * v);
    double ratio = distorted > 0 ? radtan_radius(camera, distorted) / distorted : 1;
    double x = u * ratio, y = v * ratio, got[2];
    bool close = false;
    for (int i = 0; i < FV_RADTAN_PLANE_STEPS; i++) {
        if (!radtan_distort(k, x, y, got, j)) return false;
        double a = u - got[0], b = v - got[1], determinant = j[0] * j[3] - j[1] * j[2];
        close = a * a + b * b <= residual_max * residual_max;
        if (!(determinant > 0) || fv_radtan_point_found(a * a + b * b, distorted)) break;
        fv_radtan_move(a, b, j[0], j[1], j[3], determinant, &x, &y);
    }
    out[0] = x;
    out[1] = y;
    return close && plane_inside(camera, x * x + y * y, 1e-12);
}

static enum fovea_status radtan_project(const struct fovea_camera *camera, const double p[3],
                                        double pixel[2], double jacobian[6])
{
    if (!(p[2] > 0)) return FOVEA_ERROR_ARGUMENT;
    double w = 1 / p[2], x = p[0] * w, y = p[1] * w, r2 = x * x + y * y;
    if (!plane_inside(camera, r2, 0)) return FOVEA_ERROR_ARGUMENT;
    double out[2], j[4];
    if (!(jacobian ? radtan_distort(camera->k, x, y, out, j) : radtan_place(camera->k, x, y, out)))
        return FOVEA_ERROR_ARGUMENT;
    pixel[0] = camera->fx * out[0] + camera->cx;
    pixel[1] = camera->fy * out[1] + camera->cy;
    if (jacobian) {
        double fx = camera->fx * w, fy = camera->fy * w;
        jacobian[0] = fx * j[0];
        jacobian[1] = fx * j[1];
        jacobian[2] = -fx * (j[0] * x + j[1] * y);
        jacobian[3] = fy * j[2];
        jacobian[4] = fy * j[3];
        jacobian[5] = -fy * (j[2] * x + j[3] * y);
    }
    return FOVEA_OK;
}

static enum fovea_status radtan_unproject(const struct fovea_camera *camera, double u, double v,
                                          double bearing[3], double jacobian[6])
{
    double plane[2], j[4];
    if (!radtan_undistort(camera, u, v, plane, j)) return FOVEA_ERROR_ARGUMENT;
    double x = plane[0], y = plane[1], n = 1 / __builtin_sqrt(x * x + y * y + 1), n3 = n * n * n;
    bearing[0] = x * n;
    bearing[1] = y * n;
    bearing[2] = n;
    if (jacobian) {
        double d = 1 / (j[0] * j[3] - j[1] * j[2]), fx = d / camera->fx, fy = d / camera->fy;
        double inverse[4] = {j[3] * fx, -j[1] * fy, -j[2] * fx, j[0] * fy}; /* d(plane)/d(pixel) */
        double by_plane[6] = {n - x * x * n3, -x * y * n3, -x * y * n3,
                              n - y * y * n3, -x * n3,     -y * n3};
        for (int row = 0; row < 3; row++)
            for (int column = 0; column < 2; column++)
                jacobian[2 * row + column] = by_plane[2 * row] * inverse[column] +
                                             by_plane[2 * row + 1] * inverse[2 + column];
    }
    return FOVEA_OK;
}

/* ---- equidistant ----------------------------------------------------------------------------- */

static double equidistant_distort(const double *k, double angle, double *slope)
{
    double a2 = angle * angle;
    *slope = 1 + a2 * (3 * k[0] + a2 * (5 * k[1] + a2 * (7 * k[2] + a2 * 9 * k[3])));
    return angle * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
}

static enum fovea_status equidistant_project(const struct fovea_camera *camera, const double p[3],
                                             double pixel[2], double jacobian[6])
{
    double r2 = p[0] * p[0] + p[1] * p[1], r = __builtin_sqrt(r2), n2 = r2 + p[2] * p[2];
    double angle = fv_atan2(r, p[2]), slope;
    if (!(n2 > 0 && angle <= camera->field_max_rad) || (!(r > 0) && !(p[2] > 0)))
        return FOVEA_ERROR_ARGUMENT;
    double distorted = equidistant_distort(camera->k, angle, &slope);
    /* On the axis every direction is radial, and the ratio has the limit 1/z. */
    bool axis = !(r > 1e-12 * p[2]);
    double c = axis ? 1 : p[0] / r, s = axis ? 0 : p[1] / r,
           across = axis ? 1 / p[2] : distorted / r;
    pixel[0] = camera->fx * across * p[0] + camera->cx;
    pixel[1] = camera->fy * across * p[1] + camera->cy;
    if (jacobian) {
        double along = slope * p[2] / n2, depth = -slope * r / n2, mixed = (along - across) * c * s;
        jacobian[0] = camera->fx * (across * s * s + along * c * c);
        jacobian[1] = camera->fx * mixed;
        jacobian[2] = camera->fx * depth * c;
        jacobian[3] = camera->fy * mixed;
        jacobian[4] = camera->fy * (across * c * c + along * s * s);
        jacobian[5] = camera->fy * depth * s;
    }
    return FOVEA_OK;
}

/* Angle whose distortion is `distorted`; negative where there is none within the field. */
static double equidistant_angle(const struct fovea_camera *camera, double distorted)
{
    double low = 0, high = camera->field_max_rad, slope;
    double limit = equidistant_distort(camera->k, high, &slope);
    if (!(distorted <= limit)) return -1;
    double angle = distorted < high ? distorted : high;
    for (int i = 0; i < EQUIDISTANT_STEPS; i++) {
        double error = equidistant_distort(camera->k, angle, &slope) - distorted;
        if (error > 0)
            high = angle;
        else
            low = angle;
        double next = angle - error / slope;
        if (!(slope > 0 && next >= low && next <= high)) next = 0.5 * (low + high);
        double step = next - angle;
        angle = next;
        if (step < 1e-15 && step > -1e-15) break;
    }
    return angle;
}

static enum fovea_status equidistant_unproject(const struct fovea_camera *camera, double u,
                                               double v, double bearing[3], double jacobian[6])
{
    double distorted = __builtin_sqrt(u * u + v * v), slope;
    double angle = equidistant_angle(camera, distorted);
    if (!(angle >= 0)) return FOVEA_ERROR_ARGUMENT;
    (void)equidistant_distort(camera->k, angle, &slope);
    bool axis = !(distorted > 1e-12);
    double c = axis ? 1 : u / distorted, s = axis ? 0 : v / distorted;
    double sine = fv_sin(angle), cosine = fv_cos(angle), across = axis ? 1 : sine / distorted;
    if (!(slope > 0)) return FOVEA_ERROR_ARGUMENT;
    bearing[0] = axis ? u : sine * c;
    bearing[1] = axis ? v : sine * s;
    bearing[2] = cosine;
    if (jacobian) {
        double along = cosine / slope, fx = 1 / camera->fx, fy = 1 / camera->fy;
        jacobian[0] = fx * (along * c * c + across * s * s);
        jacobian[1] = fy * (along - across) * c * s;
        jacobian[2] = fx * (along - across) * c * s;
        jacobian[3] = fy * (along * s * s + across * c * c);
        jacobian[4] = -fx * sine / slope * c;
        jacobian[5] = -fy * sine / slope * s;
    }
    return FOVEA_OK;
}

/* ---- both ------------------------------------------------------------------------------------ */

static bool monotone(const struct fovea_camera *camera, const struct azimuths *in, double angle_rad)
{
    if (camera->lens == FOVEA_LENS_RADTAN) return radtan_monotone(camera->k, in, angle_rad);
    double slope;
    (void)equidistant_distort(camera->k, angle_rad, &slope);
    return slope > 0;
}

static bool finite(double v)
{
    return v - v == 0;
}

static enum fovea_status camera_check(const struct fovea_camera *c, struct fovea_error *error)
{
    const enum fovea_status bad = FOVEA_ERROR_INPUT;
    if (c->lens != FOVEA_LENS_RADTAN && c->lens != FOVEA_LENS_EQUIDISTANT)
        return fovea_error_set(error, bad,
                               "camera lens: found %d, expected 0 (radtan) or 1 (equidistant)",
                               (int)c->lens);
    if (!(finite(c->fx) && finite(c->fy) && c->fx > 0 && c->fy > 0))
        return fovea_error_set(
            error, bad, "camera fx fy: found %g %g, expected finite numbers above 0", c->fx, c->fy);
    if (c->width < 0 || c->height < 0 || (c->width == 0) != (c->height == 0))
        return fovea_error_set(error, bad,
                               "camera size: found %d x %d, expected both above 0, or 0 x 0",
                               c->width, c->height);
    if (!(finite(c->cx) && finite(c->cy)))
        return fovea_error_set(error, bad, "camera cx cy: found %g %g, expected finite numbers",
                               c->cx, c->cy);
    if (c->width > 0 && !(c->cx > -2.0 * c->width && c->cx < 2.0 * c->width &&
                          c->cy > -2.0 * c->height && c->cy < 2.0 * c->height))
        return fovea_error_set(
            error, bad, "camera cx cy: found %g %g, expected within two sizes of a %d x %d image",
            c->cx, c->cy, c->width, c->height);
    for (int i = 0; i < FOVEA_LENS_COEFFICIENTS; i++)
        if (!finite(c->k[i]))
            return fovea_error_set(
                error, bad, "camera distortion coefficient %d: found %g, expected a finite number",
                i + 1, c->k[i]);
    return FOVEA_OK;
}

/* Fraction of the image that some direction maps to; 1 where the size is not stated. */
static double fraction_seen(const struct fovea_camera *camera)
{
    int seen = 0;
    if (camera->width == 0) return 1;
    for (int i = 0; i < GRID_COLUMNS * GRID_ROWS; i++) {
        const int column = i % GRID_COLUMNS, row = i / GRID_COLUMNS;
        const double pixel[2] = {(column + 0.5) / GRID_COLUMNS * camera->width,
                                 (row + 0.5) / GRID_ROWS * camera->height};
        double bearing[3];
        seen += fovea_camera_unproject(camera, pixel, bearing, NULL) == FOVEA_OK;
    }
    return (double)seen / (GRID_COLUMNS * GRID_ROWS);
}

enum fovea_status fovea_camera_prepare(struct fovea_camera *camera, struct fovea_error *error)
{
    if (camera == NULL)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "camera: found NULL, expected one");
    enum fovea_status status = camera_check(camera, error);
    if (status != FOVEA_OK) return status;
    double limit = camera->lens == FOVEA_LENS_RADTAN ? field_limit_radtan_rad : FV_PI;
    double low = 0, high = limit;
    bool folds = false;
    struct azimuths azimuths;
    azimuths_of(camera->k, &azimuths);
    for (int i = 1; i <= SCAN_STEPS && !folds; i++) {
        double angle = limit * i / SCAN_STEPS;
        folds = !monotone(camera, &azimuths, angle);
        *(folds ? &high : &low) = angle;
    }
    for (int i = 0; i < BISECTIONS && folds; i++) {
        double middle = 0.5 * (low + high);
        *(monotone(camera, &azimuths, middle) ? &low : &high) = middle;
    }
    if (low < field_min_rad)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "camera distortion: folds back at %.4f rad from the axis, expected at least %.2f rad",
            low, field_min_rad);
    camera->field_max_rad = low;
    const double seen = fraction_seen(camera);
    if (seen < fraction_seen_min)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "camera distortion: folds back at %.2f rad from the axis, so that only %.0f %% of the image sees anything, expected at least %.0f %%",
            low, 100 * seen, 100 * fraction_seen_min);
    return FOVEA_OK;
}

enum fovea_status fovea_camera_project(const struct fovea_camera *camera, const double point[3],
                                       double pixel[2], double jacobian[6])
{
    return camera->lens == FOVEA_LENS_RADTAN ? radtan_project(camera, point, pixel, jacobian)
                                             : equidistant_project(camera, point, pixel, jacobian);
}

enum fovea_status fovea_camera_unproject(const struct fovea_camera *camera, const double pixel[2],
                                         double bearing[3], double jacobian[6])
{
    double u = (pixel[0] - camera->cx) / camera->fx, v = (pixel[1] - camera->cy) / camera->fy;
    return camera->lens == FOVEA_LENS_RADTAN
               ? radtan_unproject(camera, u, v, bearing, jacobian)
               : equidistant_unproject(camera, u, v, bearing, jacobian);
}
