#include "geometry/bearing.h"

#include "base/elementary.h"
#include "geometry/project.h"
#include "geometry/vec.h"

void fv_bearing_carve(struct fv_bearing_table *table, int32_t width, int32_t height,
                      struct fv_arena *persistent)
{
    table->columns = (width + FV_BEARING_STEP_PX - 1) / FV_BEARING_STEP_PX + 1;
    table->rows = (height + FV_BEARING_STEP_PX - 1) / FV_BEARING_STEP_PX + 1;
    table->nodes = fv_arena_take(persistent, (size_t)table->columns * (size_t)table->rows,
                                 sizeof *table->nodes);
}

void fv_bearing_init(struct fv_bearing_table *table, const struct fovea_camera *camera)
{
    for (int32_t row = 0; row < table->rows; row++) {
        for (int32_t column = 0; column < table->columns; column++) {
            const double pixel[2] = {column * FV_BEARING_STEP_PX, row * FV_BEARING_STEP_PX};
            struct fv_bearing_node *node = &table->nodes[row * table->columns + column];
            double bearing[3];
            const bool seen = fovea_camera_unproject(camera, pixel, bearing, NULL) == FOVEA_OK;
            for (int i = 0; i < 3; i++)
                node->bearing[i] = seen ? (float)bearing[i] : __builtin_nanf("");
        }
    }
}

/* The cell of the table that a pixel lies in, and its position in it. */
struct cell {
    const struct fv_bearing_node *node; /* top left */
    double u, v;                        /* [0, 1] from there */
};

/* False outside the table; then the cell is some other one. */
static inline bool find_cell(const struct fv_bearing_table *table, double x_px, double y_px,
                             struct cell *cell)
{
    const double x = x_px / FV_BEARING_STEP_PX, y = y_px / FV_BEARING_STEP_PX;
    const bool inside = x >= 0 && y >= 0 && x < table->columns && y < table->rows;
    int32_t column = inside ? (int32_t)x : 0, row = inside ? (int32_t)y : 0;
    if (column > table->columns - 2) column = table->columns - 2;
    if (row > table->rows - 2) row = table->rows - 2;
    cell->node = &table->nodes[row * table->columns + column];
    cell->u = x - column;
    cell->v = y - row;
    return inside;
}

/* Bilinear blend of the four nodes around; false where one of them is refused, which makes the norm
 * no number. */
static bool blend(const struct fv_bearing_table *table, double x_px, double y_px, double bearing[3])
{
    struct cell cell;
    if (!find_cell(table, x_px, y_px, &cell)) return false;
    const double u = cell.u, v = cell.v;
    const double weight[4] = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
    const struct fv_bearing_node *corner[4] = {cell.node, cell.node + 1, cell.node + table->columns,
                                               cell.node + table->columns + 1};
    bearing[0] = bearing[1] = bearing[2] = 0;
    for (int k = 0; k < 4; k++)
        for (int i = 0; i < 3; i++)
            bearing[i] += weight[k] * (double)corner[k]->bearing[i];
    return fv_normalise3(bearing);
}

bool fv_bearing_of(const struct fv_bearing_table *table, const struct fovea_camera *camera,
                   double x_px, double y_px, double bearing[3], double A[6])
{
    double b[3], pixel[2], J[6];
    if (!blend(table, x_px, y_px, b)) return false;
    if (fovea_camera_project(camera, b, pixel, J) != FOVEA_OK) return false;
    /* Smallest change of b that moves its pixel onto the key point: J^T (J J^T)^-1 e. */
    const double e0 = x_px - pixel[0], e1 = y_px - pixel[1];
    const double m00 = fv_dot3(J, J), m01 = fv_dot3(J, J + 3), m11 = fv_dot3(J + 3, J + 3);
    const double determinant = m00 * m11 - m01 * m01;
    if (!(determinant > 1e-12)) return false;
    const double u = (m11 * e0 - m01 * e1) / determinant, v = (m00 * e1 - m01 * e0) / determinant;
    for (int i = 0; i < 3; i++)
        b[i] += J[i] * u + J[3 + i] * v;
    if (!fv_normalise3(b)) return false;
    /* J was taken a fraction of a pixel away: make A b = 0 hold exactly. */
    const double s0 = fv_dot3(J, b), s1 = fv_dot3(J + 3, b);
    for (int i = 0; i < 3; i++) {
        A[i] = J[i] - s0 * b[i];
        A[3 + i] = J[3 + i] - s1 * b[i];
    }
    fv_copy3(b, bearing);
    return true;
}

/* ---- two points at a time: the same operations in the same order, lane by lane --------------- */

static inline fv_pair pair_root(fv_pair a)
{
    return (fv_pair){__builtin_sqrt(a[0]), __builtin_sqrt(a[1])};
}

static inline fv_pair pair_dot3(const fv_pair a[3], const fv_pair b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline fv_flags pair_normalise3(fv_pair a[3])
{
    const fv_pair n = pair_root(pair_dot3(a, a));
    for (int i = 0; i < 3; i++)
        a[i] /= n;
    return n > 1e-150;
}

/* The floats of two nodes as lanes. */
static inline void pair_nodes(const struct fv_bearing_node *a, const struct fv_bearing_node *b,
                              fv_pair node[3])
{
    for (int i = 0; i < 3; i++)
        node[i] = (fv_pair){(double)a->bearing[i], (double)b->bearing[i]};
}

static inline fv_flags pair_blend(const struct fv_bearing_table *table, fv_pair x_px, fv_pair y_px,
                                  fv_pair bearing[3])
{
    struct cell a, b;
    const bool in_a = find_cell(table, x_px[0], y_px[0], &a),
               in_b = find_cell(table, x_px[1], y_px[1], &b);
    const fv_pair u = {a.u, b.u}, v = {a.v, b.v};
    const fv_pair weight[4] = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
    const int32_t offset[4] = {0, 1, table->columns, table->columns + 1};
    bearing[0] = bearing[1] = bearing[2] = (fv_pair){0, 0};
    for (int k = 0; k < 4; k++) {
        fv_pair node[3];
        pair_nodes(a.node + offset[k], b.node + offset[k], node);
        for (int i = 0; i < 3; i++)
            bearing[i] += weight[k] * node[i];
    }
    return (fv_flags){-(int64_t)in_a, -(int64_t)in_b} & pair_normalise3(bearing);
}

/* Radial factor and its derivative; without the rational terms the division is one by 1. */
static inline fv_flags pair_radial_scale(const double *k, bool rational, fv_pair r2, fv_pair *scale,
                                         fv_pair *derivative)
{
    *scale = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    *derivative = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);
    if (!rational) return (fv_flags){-1, -1};
    const fv_pair below = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    *scale /= below;
    *derivative = (*derivative - *scale * (k[5] + r2 * (2 * k[6] + r2 * 3 * k[7]))) / below;
    return below > 1e-9;
}

/* fovea_camera_project of a radial-tangential camera; `radius_max` is the tangent of its field. */
static inline fv_flags pair_project(const struct fovea_camera *camera, bool rational,
                                    double radius_max, const fv_pair p[3], fv_pair pixel[2],
                                    fv_pair J[6])
{
    const double *k = camera->k, p1 = k[2], p2 = k[3];
    const fv_pair w = 1 / p[2], x = p[0] * w, y = p[1] * w, r2 = x * x + y * y;
    fv_pair scale, derivative;
    const fv_flags positive = pair_radial_scale(k, rational, r2, &scale, &derivative);
    fv_pair place[2];
    fv_pair_place(k, x, y, r2, scale, place);
    const fv_pair xx = scale + 2 * x * x * derivative + 2 * p1 * y + 6 * p2 * x;
    const fv_pair xy = 2 * x * y * derivative + 2 * p1 * x + 2 * p2 * y;
    const fv_pair yy = scale + 2 * y * y * derivative + 6 * p1 * y + 2 * p2 * x;
    const fv_pair fx = camera->fx * w, fy = camera->fy * w;
    pixel[0] = camera->fx * place[0] + camera->cx;
    pixel[1] = camera->fy * place[1] + camera->cy;
    J[0] = fx * xx;
    J[1] = fx * xy;
    J[2] = -fx * (xx * x + xy * y);
    J[3] = fy * xy;
    J[4] = fy * yy;
    J[5] = -fy * (xy * x + yy * y);
    return (p[2] > 0) & (r2 <= radius_max * radius_max) & positive;
}

/* The steps of fv_bearing_of, each for a block of pairs: within a step the pairs do not wait for
 * each other, and the processor hides their divisions and roots behind one another. */
enum { BLOCK = 8 };

struct ray_pair {
    fv_pair b[3], J[6], e[2]; /* bearing, d(pixel)/d(point), pixel still to go */
    fv_flags seen;
};

static void pairs_start(const struct fv_bearing_table *table, const float (*pixels)[2],
                        struct ray_pair *pair, int count)
{
    for (int k = 0; k < count; k++, pair++, pixels += 2) {
        pair->e[0] = (fv_pair){(double)pixels[0][0], (double)pixels[1][0]};
        pair->e[1] = (fv_pair){(double)pixels[0][1], (double)pixels[1][1]};
        pair->seen = pair_blend(table, pair->e[0], pair->e[1], pair->b);
    }
}

static void pairs_project(const struct fovea_camera *camera, struct ray_pair *pair, int count)
{
    const double field = camera->field_max_rad;
    const bool rational = camera->k[5] != 0 || camera->k[6] != 0 || camera->k[7] != 0;
    for (int k = 0; k < count; k++, pair++) {
        fv_pair pixel[2];
        fv_flags seen = pair_project(camera, rational, field, pair->b, pixel, pair->J);
        if (!(seen[0] & seen[1])) /* a tangent is larger than its angle, and seldom needed */
            seen = pair_project(camera, rational, fv_tan(field), pair->b, pixel, pair->J);
        pair->seen &= seen;
        pair->e[0] -= pixel[0];
        pair->e[1] -= pixel[1];
    }
}

static void pairs_step(struct ray_pair *pair, int count)
{
    for (int k = 0; k < count; k++, pair++) {
        const fv_pair *J = pair->J, e0 = pair->e[0], e1 = pair->e[1];
        const fv_pair m00 = pair_dot3(J, J), m01 = pair_dot3(J, J + 3),
                      m11 = pair_dot3(J + 3, J + 3);
        const fv_pair determinant = m00 * m11 - m01 * m01;
        const fv_pair u = (m11 * e0 - m01 * e1) / determinant,
                      v = (m00 * e1 - m01 * e0) / determinant;
        for (int i = 0; i < 3; i++)
            pair->b[i] += J[i] * u + J[3 + i] * v;
        pair->seen &= (determinant > 1e-12) & pair_normalise3(pair->b);
    }
}

static void pairs_finish(const struct ray_pair *pair, int count, struct fv_ray *rays)
{
    for (int k = 0; k < count; k++, pair++, rays += 2) {
        const fv_pair *J = pair->J, *b = pair->b, s0 = pair_dot3(J, b), s1 = pair_dot3(J + 3, b);
        fv_pair A[6];
        for (int i = 0; i < 3; i++) {
            A[i] = J[i] - s0 * b[i];
            A[3 + i] = J[3 + i] - s1 * b[i];
        }
        for (int lane = 0; lane < 2; lane++) {
            for (int i = 0; i < 3; i++)
                rays[lane].bearing[i] = b[i][lane];
            for (int i = 0; i < 6; i++)
                rays[lane].A[i] = A[i][lane];
            rays[lane].seen = pair->seen[lane] != 0;
        }
    }
}

void fv_bearings_of(const struct fv_bearing_table *table, const struct fovea_camera *camera,
                    const float (*pixels)[2], uint32_t count, struct fv_ray *rays)
{
    uint32_t done = 0;
    while (camera->lens == FOVEA_LENS_RADTAN && count - done >= 2) {
        struct ray_pair pairs[BLOCK];
        const int here = count - done < 2 * BLOCK ? (int)(count - done) / 2 : BLOCK;
        pairs_start(table, pixels + done, pairs, here);
        pairs_project(camera, pairs, here);
        pairs_step(pairs, here);
        pairs_finish(pairs, here, rays + done);
        done += 2 * (uint32_t)here;
    }
    for (; done < count; done++) {
        struct fv_ray *ray = &rays[done];
        ray->seen = fv_bearing_of(table, camera, (double)pixels[done][0], (double)pixels[done][1],
                                  ray->bearing, ray->A);
    }
}
