#include "geometry/bearing.h"

#include "geometry/vec.h"

void fv_bearing_carve(struct fv_bearing_table *table, int32_t width, int32_t height, struct fv_arena *persistent)
{
    table->columns = (width + FV_BEARING_STEP_PX - 1) / FV_BEARING_STEP_PX + 1;
    table->rows = (height + FV_BEARING_STEP_PX - 1) / FV_BEARING_STEP_PX + 1;
    table->nodes = fv_arena_take(persistent, (size_t)table->columns * (size_t)table->rows, sizeof *table->nodes);
}

void fv_bearing_init(struct fv_bearing_table *table, const struct fovea_camera *camera)
{
    for (int32_t row = 0; row < table->rows; row++) {
        for (int32_t column = 0; column < table->columns; column++) {
            const double pixel[2] = {column * FV_BEARING_STEP_PX, row * FV_BEARING_STEP_PX};
            struct fv_bearing_node *node = &table->nodes[row * table->columns + column];
            double bearing[3] = {0, 0, 0};
            fovea_camera_unproject(camera, pixel, bearing, NULL);
            for (int i = 0; i < 3; i++) node->bearing[i] = (float)bearing[i];
        }
    }
}

/* Bilinear blend of the four nodes around; false where one of them is refused. */
static bool blend(const struct fv_bearing_table *table, double x_px, double y_px, double bearing[3])
{
    const double x = x_px / FV_BEARING_STEP_PX, y = y_px / FV_BEARING_STEP_PX;
    if (!(x >= 0 && y >= 0 && x < table->columns && y < table->rows)) return false;
    int32_t column = (int32_t)x, row = (int32_t)y;
    if (column > table->columns - 2) column = table->columns - 2;
    if (row > table->rows - 2) row = table->rows - 2;
    const double u = x - column, v = y - row;
    const struct fv_bearing_node *a = &table->nodes[row * table->columns + column], *b = a + table->columns;
    const struct fv_bearing_node *corner[4] = {a, a + 1, b, b + 1};
    const double weight[4] = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
    bearing[0] = bearing[1] = bearing[2] = 0;
    for (int k = 0; k < 4; k++) {
        const float *node = corner[k]->bearing;
        if (node[0] == 0 && node[1] == 0 && node[2] == 0) return false;
        for (int i = 0; i < 3; i++) bearing[i] += weight[k] * (double)node[i];
    }
    return fv_normalise3(bearing);
}

bool fv_bearing_of(const struct fv_bearing_table *table, const struct fovea_camera *camera, double x_px, double y_px,
                   double bearing[3], double A[6])
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
    for (int i = 0; i < 3; i++) b[i] += J[i] * u + J[3 + i] * v;
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
