#include "geometry/radtan.h"
#include "sim.h"

/* Normalised coordinates of the pixels of a row: the steps of fovea_camera_unproject for a
 * radial-tangential lens (geometry/radtan.h), bit for bit, of LANES pixels at once, so that the
 * compiler can use vectors and no pixel waits for the divisions of another. A pixel that leaves the
 * usual way, and every pixel of other lenses, is left to fovea_camera_unproject itself. */

enum { LANES = 8 };

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
    for (int32_t step = 0; step < FV_RADTAN_RADIAL_STEPS && left != 0; step++) {
        left = 0;
        for (int32_t i = 0; i < LANES; i++) {
            double scale, derivative, error, slope;
            fv_radtan_above(k, r[i] * r[i], &scale, &derivative);
            fv_radtan_radial_error(r[i], l->distorted[i], scale, derivative, &error, &slope);
            const double top = error > 0 ? r[i] : high[i], bottom = error > 0 ? low[i] : r[i];
            const double next = r[i] - error / slope, moved = next - r[i];
            const int64_t fits = -(int64_t)((slope > 0) & (next >= bottom) & (next <= top));
            l->odd[i] |= ~done[i] & ~fits;
            high[i] = done[i] ? high[i] : top;
            low[i] = done[i] ? low[i] : bottom;
            r[i] = done[i] ? r[i] : next;
            done[i] |= -(int64_t)fv_radtan_radius_found(moved, next);
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
    double x[LANES], y[LANES], to_x[LANES], to_y[LANES];
    int64_t done[LANES], left = -1;
    for (int32_t i = 0; i < LANES; i++) {
        const double ratio = l->distorted[i] > 0 ? l->radius[i] / l->distorted[i] : 1;
        x[i] = l->u[i] * ratio;
        y[i] = l->v[i] * ratio;
        done[i] = 0;
    }
    for (int32_t step = 0; step < FV_RADTAN_PLANE_STEPS && left != 0; step++) {
        left = 0;
        for (int32_t i = 0; i < LANES; i++) {
            const double r2 = x[i] * x[i] + y[i] * y[i];
            double scale, derivative, u, v, xx, xy, yy;
            fv_radtan_above(k, r2, &scale, &derivative);
            fv_radtan_place(k, x[i], y[i], r2, scale, &u, &v);
            fv_radtan_slopes(k, x[i], y[i], scale, derivative, &xx, &xy, &yy);
            const double a = l->u[i] - u, b = l->v[i] - v, determinant = xx * yy - xy * xy;
            to_x[i] = x[i];
            to_y[i] = y[i];
            fv_radtan_move(a, b, xx, xy, yy, determinant, &to_x[i], &to_y[i]);
            const int64_t there = -(int64_t)fv_radtan_point_found(a * a + b * b, l->distorted[i]),
                          falls = -(int64_t)(determinant > 0);
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
