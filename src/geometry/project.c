#include "geometry/project.h"

#include <stddef.h>

#include "base/elementary.h"

enum { N = FV_PROJECT_PAIRS };

struct fv_project fv_project_of(const struct fovea_camera *camera)
{
    const double field = camera->field_max_rad, *k = camera->k,
                 radius = camera->lens == FOVEA_LENS_RADTAN ? fv_tan(field) : 0,
                 most = radius > field ? radius : field;
    return (struct fv_project){.camera = *camera,
                               .radius2_max = most * most,
                               .rational = k[5] != 0 || k[6] != 0 || k[7] != 0};
}

/* Likewise. Without rational terms camera.c divides by 1. */
static void radtan_points(const struct fv_project *project, fv_pair points[3][N],
                          fv_pair pixels[2][N], fv_flags seen[N])
{
    const struct fovea_camera *camera = &project->camera;
    const double *k = camera->k;
    for (int i = 0; i < N; i++) {
        const fv_pair w = 1 / points[2][i], x = points[0][i] * w, y = points[1][i] * w,
                      r2 = x * x + y * y;
        fv_pair scale = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
        seen[i] = (points[2][i] > 0) & (r2 <= project->radius2_max);
        if (project->rational) {
            const fv_pair below = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
            scale /= below;
            seen[i] &= below > 1e-9;
        }
        fv_pair place[2];
        fv_pair_place(k, x, y, r2, scale, place);
        pixels[0][i] = camera->fx * place[0] + camera->cx;
        pixels[1][i] = camera->fy * place[1] + camera->cy;
    }
}

static void scalar_points(const struct fovea_camera *camera, fv_pair points[3][N],
                          fv_pair pixels[2][N], fv_flags seen[N])
{
    for (int i = 0; i < N; i++)
        for (int lane = 0; lane < 2; lane++) {
            const double p[3] = {points[0][i][lane], points[1][i][lane], points[2][i][lane]};
            double pixel[2] = {0, 0};
            seen[i][lane] = -(fovea_camera_project(camera, p, pixel, NULL) == FOVEA_OK);
            pixels[0][i][lane] = pixel[0];
            pixels[1][i][lane] = pixel[1];
        }
}

void fv_project_points(const struct fv_project *project, fv_pair points[3][N], fv_pair pixels[2][N],
                       fv_flags seen[N])
{
    if (project->camera.lens == FOVEA_LENS_RADTAN)
        radtan_points(project, points, pixels, seen);
    else
        scalar_points(&project->camera, points, pixels, seen);
}
