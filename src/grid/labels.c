/* What the mask of a view shows of points (grid.h, cells.h). */
#include "grid/cells.h"

/* The largest (x^2 + y^2) / z^2 of the image's corners, with a tenth more of the radius for what a
 * lens moves sideways; infinite where a corner has no direction or looks backwards. */
static double outside_of(const struct fovea_camera *camera)
{
    double most = 0;
    for (int i = 0; i < 4; i++) {
        const double pixel[2] = {(i & 1) * camera->width - 0.5, (i >> 1) * camera->height - 0.5};
        double b[3];
        if (fovea_camera_unproject(camera, pixel, b, NULL) != FOVEA_OK || !(b[2] > 0))
            return __builtin_inf();
        const double here = (b[0] * b[0] + b[1] * b[1]) / (b[2] * b[2]);
        most = here > most ? here : most;
    }
    return 1.21 * most;
}

/* The camera with the mask's pixels, of which each is a place from 0 to 1 further. */
static struct fv_project project_of(const struct fovea_grid_view *view)
{
    const struct fovea_segmentation *s = view->seen;
    struct fovea_camera camera = *view->camera;
    camera.fx /= s->raw_scale[0];
    camera.fy /= s->raw_scale[1];
    camera.cx = (camera.cx - s->raw_offset[0]) / s->raw_scale[0] + 0.5;
    camera.cy = (camera.cy - s->raw_offset[1]) / s->raw_scale[1] + 0.5;
    return fv_project_of(&camera);
}

struct fv_grid_look fv_grid_look_of(const struct fovea_grid_view *view)
{
    const struct fovea_segmentation *s = view->seen;
    const double *T = view->T_odom_cam, height = T[11] - fv_grid_floor_at(view, T[3], T[7]);
    struct fv_grid_look look = {.view = view,
                                .from = {T[3], T[7]},
                                .inverse_height = 1 / height,
                                .beside = {T[3] - view->position_m[0], T[7] - view->position_m[1]}};
    look.outside = outside_of(view->camera);
    look.project = project_of(view);
    for (int row = 0; row < 3; row++) {
        for (int k = 0; k < 3; k++)
            look.R[row][k] = T[4 * k + row];
        look.up[row] = -look.R[row][2] * height;
    }
    for (int i = 0; i < 256; i++) {
        const uint8_t place = s->index[i];
        const int32_t class_id = place < s->count ? s->list[place].class_id : -1;
        look.of[i] = class_id >= 0 && class_id < 256 ? view->labels[class_id] : FOVEA_GRID_IGNORED;
    }
    return look;
}

/* Where the mask has a point of the camera's frame, in its pixels; false: it is not in the image.
 */
bool fv_grid_in_mask(const struct fv_grid_look *look, const double point[3], double at[2])
{
    const struct fovea_segmentation *s = look->view->seen;
    const double across = point[0] * point[0] + point[1] * point[1];
    if (look->outside < __builtin_inf() &&
        !(point[2] > 0 && across <= look->outside * point[2] * point[2]))
        return false; /* as most points: less work than to project them */
    return fovea_camera_project(&look->project.camera, point, at, NULL) == FOVEA_OK && at[0] >= 0 &&
           at[0] < s->width && at[1] >= 0 && at[1] < s->height;
}

/* Of a point at `at` in the mask. */
static int label_in(const struct fv_grid_look *look, double column, double row)
{
    const struct fovea_segmentation *s = look->view->seen;
    const int64_t at = (int64_t)row * s->width + (int64_t)column;
    const int label = look->of[s->pixels[at]];
    return label == FOVEA_GRID_FLOOR && s->confidence != NULL && s->confidence[at] < look->least
               ? FV_GRID_UNSURE
               : label;
}

int fv_grid_label(const struct fv_grid_look *look, const double point[3])
{
    double at[2];
    return fv_grid_in_mask(look, point, at) ? label_in(look, at[0], at[1]) : -1;
}

void fv_grid_labels(const struct fv_grid_look *look, const double along[3], int32_t first,
                    int16_t labels[FV_GRID_AHEAD])
{
    enum { PAIRS = FV_PROJECT_PAIRS };
    const double width = look->view->seen->width, height = look->view->seen->height;
    fv_pair points[3][PAIRS], at[2][PAIRS], step = {first, first + 1};
    fv_flags seen[PAIRS];
    for (int i = 0; i < PAIRS; i++, step += 2)
        for (int k = 0; k < 3; k++)
            points[k][i] = look->up[k] + along[k] * step;
    fv_project_points(&look->project, points, at, seen);
    for (int i = 0; i < PAIRS; i++) {
        const fv_pair x = at[0][i], y = at[1][i];
        const fv_flags in = seen[i] & (x >= 0) & (x < width) & (y >= 0) & (y < height);
        for (int lane = 0; lane < 2; lane++)
            labels[2 * i + lane] = (int16_t)(in[lane] ? label_in(look, x[lane], y[lane]) : -1);
    }
}
