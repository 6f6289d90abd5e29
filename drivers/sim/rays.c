#include "sim.h"

/* Normalised coordinates of the pixels of a row: the steps of fovea_camera_unproject for a
 * radial-tangential lens, bit for bit, of LANES pixels at once, so that the compiler can use
 * vectors and no pixel waits for the divisions of another. A pixel that leaves the usual way, and
 * every pixel of other lenses, is left to fovea_camera_unproject itself. */

enum { LANES = 8, RADIAL_STEPS = 60, PLANE_STEPS = 20 };

/* Whole numbers as wide as the coordinates, for vectors: 0 or -1. */
struct lanes {
    double u[LANES], v[LANES], distorted[LANES]; /* of the image, and the distance from its axis */
    double radius[LANES];                        /* undistorted */
    double x[LANES], y[LANES];
    int64_t odd[LANES]; /* left the usual way */
};

/* Newton's steps to the radius whose distortion is `distorted`; those that would leave the bracket
 * are odd. */
FV_IN_WIDE void find_radii(const double k[8], double radius_max, struct lanes *restrict l)
{
    double r[LANES], low[LANES], high[LANES];
    int64_t done[LANES], left = -1;
    for (int32_t i = 0; i < LANES; i++) {
        r[i] = l->distorted[i] <= radius_max ? l->distorted[i] : radius_max;
        low[i] = 0;
        high[i] = radius_max;
        done[i] = l->odd[i] = 0;
    }
    for (int32_t step = 0; step < RADIAL_STEPS && left != 0; step++) {
        left = 0;
        for (int32_t i = 0; i < LANES; i++) {
            const double r2 = r[i] * r[i];
            const double scale = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
            const double derivative = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);
            const double error = r[i] * scale - l->distorted[i],
                         slope = scale + 2 * r[i] * r[i] * derivative;
            const double top = error > 0 ? r[i] : high[i], bottom = error > 0 ? low[i] : r[i];
            const double next = r[i] - error / slope, moved = next - r[i],
                         near = 1e-13 * (1 + next);
            const int64_t fits = -(int64_t)((slope > 0) & (next >= bottom) & (next <= top));
            l->odd[i] |= ~done[i] & ~fits;
            high[i] = done[i] ? high[i] : top;
            low[i] = done[i] ? low[i] : bottom;
            r[i] = done[i] ? r[i] : next;
            done[i] |= -(int64_t)((moved < near) & (moved > -near));
            left |= ~(done[i] | l->odd[i]);
        }
    }
    for (int32_t i = 0; i < LANES; i++) {
        l->odd[i] |= ~done[i];
        l->radius[i] = r[i];
    }
}

/* Newton's steps on the plane at distance 1, from the point at that radius. */
FV_IN_WIDE void find_points(const double k[8], struct lanes *restrict l)
{
    const double p1 = k[2], p2 = k[3];
    double x[LANES], y[LANES], to_x[LANES], to_y[LANES];
    int64_t done[LANES], left = -1;
    for (int32_t i = 0; i < LANES; i++) {
        const double ratio = l->distorted[i] > 0 ? l->radius[i] / l->distorted[i] : 1;
        x[i] = l->u[i] * ratio;
        y[i] = l->v[i] * ratio;
        done[i] = 0;
    }
    for (int32_t step = 0; step < PLANE_STEPS && left != 0; step++) {
        left = 0;
        for (int32_t i = 0; i < LANES; i++) {
            const double r2 = x[i] * x[i] + y[i] * y[i];
            const double scale = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
            const double derivative = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);
            const double a = l->u[i] -
                             (x[i] * scale + 2 * p1 * x[i] * y[i] + p2 * (r2 + 2 * x[i] * x[i])),
                         b = l->v[i] -
                             (y[i] * scale + p1 * (r2 + 2 * y[i] * y[i]) + 2 * p2 * x[i] * y[i]);
            const double xx = scale + 2 * x[i] * x[i] * derivative + 2 * p1 * y[i] + 6 * p2 * x[i],
                         xy = 2 * x[i] * y[i] * derivative + 2 * p1 * x[i] + 2 * p2 * y[i],
                         yy = scale + 2 * y[i] * y[i] * derivative + 6 * p1 * y[i] + 2 * p2 * x[i];
            const double determinant = xx * yy - xy * xy, miss = a * a + b * b,
                         enough = 1e-28 * (1 + l->distorted[i] * l->distorted[i]);
            to_x[i] = x[i] + (yy * a - xy * b) / determinant;
            to_y[i] = y[i] + (xx * b - xy * a) / determinant;
            const int64_t there = -(int64_t)(miss <= enough), falls = -(int64_t)(determinant > 0);
            l->odd[i] |= ~done[i] & ~falls;
            done[i] |= there;
            left |= ~(done[i] | l->odd[i]);
        }
        for (int32_t i = 0; i < LANES; i++) {
            x[i] = done[i] ? x[i] : to_x[i];
            y[i] = done[i] ? y[i] : to_y[i];
        }
    }
    for (int32_t i = 0; i < LANES; i++) {
        l->odd[i] |= ~done[i];
        l->x[i] = x[i];
        l->y[i] = y[i];
    }
}

FV_WIDE static void find_lanes(const double k[8], double radius_max, struct lanes *l)
{
    find_radii(k, radius_max, l);
    find_points(k, l);
}

static bool find_one(const struct fovea_camera *camera, double px, double py, double at[2])
{
    double bearing[3];
    if (fovea_camera_unproject(camera, (const double[2]){px, py}, bearing, NULL) != FOVEA_OK)
        return false;
    if (bearing[2] < 0.1) return false;
    at[0] = bearing[0] / bearing[2];
    at[1] = bearing[1] / bearing[2];
    return true;
}

/* The same from the point on the plane. */
static bool from_plane(const struct fovea_camera *camera, double x, double y, double at[2])
{
    const double n = 1 / __builtin_sqrt(x * x + y * y + 1);
    if (x * x + y * y > camera->field_max_rad * camera->field_max_rad || n < 0.1) return false;
    at[0] = x * n / n;
    at[1] = y * n / n;
    return true;
}

bool fv_sim_rays(const struct fovea_camera *camera, double px, double py, int32_t count,
                 double (*at)[2])
{
    const bool usual = camera->lens == FOVEA_LENS_RADTAN && camera->k[5] == 0 &&
                       camera->k[6] == 0 && camera->k[7] == 0;
    const double radius_max = usual ? fv_tan(camera->field_max_rad) : 0;
    for (int32_t first = 0; first < count; first += LANES) {
        struct lanes l;
        for (int32_t i = 0; i < LANES; i++) {
            l.u[i] = (px + (first + i) - camera->cx) / camera->fx;
            l.v[i] = (py - camera->cy) / camera->fy;
            l.distorted[i] = __builtin_sqrt(l.u[i] * l.u[i] + l.v[i] * l.v[i]);
        }
        if (usual) find_lanes(camera->k, radius_max, &l);
        for (int32_t i = 0; i < LANES && first + i < count; i++) {
            if (usual && l.odd[i] == 0 && from_plane(camera, l.x[i], l.y[i], at[first + i]))
                continue;
            if (!find_one(camera, px + (first + i), py, at[first + i])) return false;
        }
    }
    return true;
}
