#include "sim.h"

#include <stdlib.h>
#include <string.h>

/* ---- raster: a bearing for every pixel ------------------------------------------------------- */

/* Normalised coordinates of the pixels of a row of tiles, with one pixel of margin all round for
 * samples between pixels. */
enum { STRIP_ROWS = FV_SIM_TILE + 2 };

struct strip {
    double (*at)[2]; /* STRIP_ROWS rows of `columns` */
    int32_t columns; /* from pixel -1 on */
};

/* The last two rows of a strip are the first two of the next. Rows past the image repeat its last
 * one. */
static bool fill_strip(const struct strip *strip, const struct fovea_camera *camera, int32_t ty)
{
    const size_t row_bytes = (size_t)strip->columns * sizeof *strip->at;
    uint8_t *rows = (uint8_t *)strip->at;
    if (ty > 0) memmove(rows, rows + FV_SIM_TILE * row_bytes, 2 * row_bytes);
    for (int32_t row = ty > 0 ? 2 : 0; row < STRIP_ROWS; row++) {
        const int32_t py = ty * FV_SIM_TILE + row - 1;
        if (py >= camera->height)
            memcpy(rows + (size_t)row * row_bytes, rows + (size_t)(row - 1) * row_bytes, row_bytes);
        else if (!fv_sim_rays(camera, -1, py, strip->columns,
                              strip->at + (size_t)row * (size_t)strip->columns))
            return false;
    }
    return true;
}

static bool fill_tile(struct fv_sim_raster *raster, const struct fovea_camera *camera,
                      const struct strip *strip, int32_t tx, int32_t ty)
{
    const int32_t tile = ty * raster->tiles_x + tx;
    float *x = raster->x + (size_t)tile * FV_SIM_TILE_PIXELS,
          *y = raster->y + (size_t)tile * FV_SIM_TILE_PIXELS;
    struct fv_sim_rect bound = {1e9f, -1e9f, 1e9f, -1e9f};
    double mx = 0.0, my = 0.0;
    /* Pixels past the image repeat its edge. */
    for (int32_t r = -1; r <= FV_SIM_TILE; r++) {
        for (int32_t c = -1; c <= FV_SIM_TILE; c++) {
            const int32_t column = tx * FV_SIM_TILE + c + 1, last = strip->columns - 1;
            const double *at =
                strip->at[(r + 1) * strip->columns + (column < last ? column : last)];
            const float fx = (float)at[0], fy = (float)at[1];
            if (fx < bound.x_min) bound.x_min = fx;
            if (fx > bound.x_max) bound.x_max = fx;
            if (fy < bound.y_min) bound.y_min = fy;
            if (fy > bound.y_max) bound.y_max = fy;
            if (r < 0 || c < 0 || r == FV_SIM_TILE || c == FV_SIM_TILE) continue;
            x[r * FV_SIM_TILE + c] = fx;
            y[r * FV_SIM_TILE + c] = fy;
            if (r == FV_SIM_TILE / 2 && c == FV_SIM_TILE / 2) {
                mx = at[0];
                my = at[1];
            }
        }
    }
    const double width = (double)bound.x_max - (double)bound.x_min,
                 height = (double)bound.y_max - (double)bound.y_min;
    bound.x_max += (float)(width / FV_SIM_TILE); /* the far margin, where the edge was repeated */
    bound.y_max += (float)(height / FV_SIM_TILE);
    raster->bound[tile] = bound;
    /* Normalised area of a pixel from the lens's Jacobian at the tile's middle. */
    double pixel[2], j[6];
    raster->pixel_area[tile] = 1.0f;
    if (fovea_camera_project(camera, (const double[3]){mx, my, 1.0}, pixel, j) != FOVEA_OK)
        return false;
    const double det = j[0] * j[4] - j[1] * j[3];
    if (det > 0.0)
        raster->pixel_area[tile] =
            (float)(__builtin_sqrt(__builtin_sqrt(mx * mx + my * my + 1.0)) / det);
    return true;
}

/* Whether all pixels on the edge of the image, margin included, are seen: those inside are nearer
 * to the axis. */
static bool edge_is_seen(const struct fovea_camera *camera)
{
    double at[2];
    for (int32_t px = -1; px < camera->width; px++)
        if (!fv_sim_rays(camera, px, -1, 1, &at) ||
            !fv_sim_rays(camera, px, camera->height - 1, 1, &at))
            return false;
    for (int32_t py = -1; py < camera->height; py++)
        if (!fv_sim_rays(camera, -1, py, 1, &at) ||
            !fv_sim_rays(camera, camera->width - 1, py, 1, &at))
            return false;
    return true;
}

bool fv_sim_raster_create(struct fv_sim_raster *raster, const struct fovea_camera *camera)
{
    raster->width = camera->width;
    raster->height = camera->height;
    raster->tiles_x = (camera->width + FV_SIM_TILE - 1) / FV_SIM_TILE;
    raster->tiles_y = (camera->height + FV_SIM_TILE - 1) / FV_SIM_TILE;
    const size_t tiles = (size_t)raster->tiles_x * (size_t)raster->tiles_y;
    raster->x = malloc(tiles * FV_SIM_TILE_PIXELS * sizeof(float));
    raster->y = malloc(tiles * FV_SIM_TILE_PIXELS * sizeof(float));
    raster->bound = malloc(tiles * sizeof *raster->bound);
    raster->pixel_area = malloc(tiles * sizeof(float));
    return raster->x != NULL && raster->y != NULL && raster->bound != NULL &&
           raster->pixel_area != NULL && edge_is_seen(camera);
}

bool fv_sim_raster_fill(struct fv_sim_raster *raster, const struct fovea_camera *camera)
{
    struct strip strip = {NULL, raster->width + 1};
    if (raster->filled) return true;
    strip.at = malloc((size_t)STRIP_ROWS * (size_t)strip.columns * sizeof *strip.at);
    bool seen = strip.at != NULL;
    for (int32_t ty = 0; ty < raster->tiles_y && seen; ty++) {
        seen = fill_strip(&strip, camera, ty);
        for (int32_t tx = 0; tx < raster->tiles_x && seen; tx++)
            seen = fill_tile(raster, camera, &strip, tx, ty);
    }
    free(strip.at);
    raster->filled = seen;
    return seen;
}

void fv_sim_raster_free(struct fv_sim_raster *raster)
{
    free(raster->x);
    free(raster->y);
    free(raster->bound);
    free(raster->pixel_area);
    *raster = (struct fv_sim_raster){0};
}

/* ---- surfaces in the camera frame ------------------------------------------------------------ */

static const double near_m = 0.05;

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Direction of the world in the camera frame. */
static void turn(const double T[12], const double world[3], double out[3])
{
    for (int32_t i = 0; i < 3; i++)
        out[i] = T[i] * world[0] + T[4 + i] * world[1] + T[8 + i] * world[2];
}

static void move(const double T[12], const double world[3], double out[3])
{
    const double d[3] = {world[0] - T[3], world[1] - T[7], world[2] - T[11]};
    turn(T, d, out);
}

static void store3(float out[3], const double in[3])
{
    for (int32_t i = 0; i < 3; i++)
        out[i] = (float)in[i];
}

/* Bounds of corner points in the normalised plane; everything when one is beside or behind the
 * camera. false: all of them are behind. */
static bool set_bounds(struct fv_sim_surface *s, const double (*corner)[3], int32_t count,
                       double *z_min)
{
    int32_t behind = 0;
    s->x_min = s->y_min = 1e9f;
    s->x_max = s->y_max = -1e9f;
    *z_min = 1e9;
    for (int32_t i = 0; i < count; i++) {
        const double z = corner[i][2];
        if (z < *z_min) *z_min = z;
        if (z < near_m) {
            behind++;
            continue;
        }
        const float x = (float)(corner[i][0] / z), y = (float)(corner[i][1] / z);
        if (x < s->x_min) s->x_min = x;
        if (x > s->x_max) s->x_max = x;
        if (y < s->y_min) s->y_min = y;
        if (y > s->y_max) s->y_max = y;
    }
    if (behind > 0 && behind < count) {
        s->x_min = s->y_min = -1e9f;
        s->x_max = s->y_max = 1e9f;
    }
    return behind < count;
}

static bool outside(const struct fv_sim_surface *s, const struct fv_sim_rect *bound)
{
    return s->x_min > bound->x_max || s->x_max < bound->x_min || s->y_min > bound->y_max ||
           s->y_max < bound->y_min;
}

static bool set_face(struct fv_sim_surface *s, const struct fv_sim_face *face,
                     const struct fv_sim_texture *texture, const double T[12],
                     const struct fv_sim_rect *bound)
{
    double o[3], u[3], v[3], n[3], corner[4][3], z_min;
    move(T, face->origin, o);
    turn(T, face->u, u);
    turn(T, face->v, v);
    cross(u, v, n);
    const double on = dot(o, n), nn = __builtin_sqrt(dot(n, n));
    if (on > -1e-4 * nn) return false; /* seen from behind, or edge on */
    for (int32_t i = 0; i < 3; i++) {
        corner[0][i] = o[i];
        corner[1][i] = o[i] + u[i];
        corner[2][i] = o[i] + v[i];
        corner[3][i] = o[i] + u[i] + v[i];
    }
    if (!set_bounds(s, (const double(*)[3])corner, 4, &z_min) || outside(s, bound)) return false;
    const double uu = dot(u, u), vv = dot(v, v), ou = dot(o, u) / uu, ov = dot(o, v) / vv;
    double iz[3], cu[3], cv[3], c[3];
    for (int32_t i = 0; i < 3; i++) {
        iz[i] = n[i] / on;
        cu[i] = u[i] / uu - ou * iz[i];
        cv[i] = v[i] / vv - ov * iz[i];
    }
    cross(cu, cv, c);
    const double det = dot(c, iz), size = (double)face->tex_du * (double)face->tex_dv;
    store3(s->inverse_z, iz);
    store3(s->u, cu);
    store3(s->v, cv);
    s->area = (float)__builtin_fabs(det * size);
    s->slant = (float)(nn / -on);
    s->tex_u = face->tex_u;
    s->tex_v = face->tex_v;
    s->tex_du = face->tex_du;
    s->tex_dv = face->tex_dv;
    s->light = face->light;
    s->texture = texture;
    s->object = face->object;
    s->truth_class = face->truth_class;
    s->is_round = false;
    s->disc = face->disc;
    s->is_cut = face->is_cut;
    for (int32_t k = 0; k < 2 && face->is_cut; k++) {
        double cut[3];
        for (int32_t i = 0; i < 3; i++)
            cut[i] = face->cut[k][0] * iz[i] + face->cut[k][1] * cu[i] + face->cut[k][2] * cv[i];
        store3(s->cut[k], cut);
    }
    return true;
}

static double radius_square(const struct fv_sim_round *round, double s)
{
    return round->q0 + round->q1 * s + round->q2 * s * s;
}

static bool set_round(struct fv_sim_surface *s, const struct fv_sim_round *round,
                      const struct fv_sim_texture *texture, const double T[12],
                      const struct fv_sim_rect *bound)
{
    double p[3], a[3], e1[3], e2[3], corner[8][3], z_min, square = radius_square(round, 0.0);
    move(T, round->base, p);
    turn(T, round->axis, a);
    turn(T, round->side, e1);
    cross(a, e1, e2);
    const double top = radius_square(round, round->height);
    if (top > square) square = top;
    if (round->q2 < 0.0) {
        const double widest = radius_square(round, -0.5 * round->q1 / round->q2);
        if (widest > square) square = widest;
    }
    const double radius = __builtin_sqrt(square);
    for (int32_t k = 0; k < 8; k++) {
        for (int32_t i = 0; i < 3; i++)
            corner[k][i] = p[i] + ((k & 1) ? round->height : 0.0) * a[i] +
                           ((k & 2) ? radius : -radius) * e1[i] +
                           ((k & 4) ? radius : -radius) * e2[i];
    }
    if (!set_bounds(s, (const double(*)[3])corner, 8, &z_min) || outside(s, bound)) return false;
    const double k = 1.0 + round->q2, pa = dot(p, a),
                 c = dot(p, p) - k * pa * pa + round->q1 * pa - round->q0;
    if (c <= 0.0) return false; /* the camera is inside */
    store3(s->p, p);
    store3(s->a, a);
    store3(s->e1, e1);
    store3(s->e2, e2);
    double sun[3];
    turn(T, (const double[3]){0.48, -0.36, 0.8}, sun);
    store3(s->sun, sun);
    s->height = (float)round->height;
    s->q1 = (float)round->q1;
    s->q2 = (float)round->q2;
    s->k = (float)k;
    s->pa = (float)pa;
    s->c = (float)c;
    s->tex_u = 0.0f;
    s->tex_v = 0.0f;
    s->tex_du = (float)texture->width;
    s->tex_dv = (float)texture->height;
    /* Texels per metre, squared: across by the girth, along by the height. */
    s->area = (float)((double)texture->width / (2.0 * FV_PI * radius) * (double)texture->height /
                      round->height);
    s->slant =
        (float)(z_min > near_m ? 1.0 / z_min : 1.0 / near_m); /* nearest: for depth culling */
    s->light = round->light;
    s->texture = texture;
    s->object = round->object;
    s->truth_class = round->truth_class;
    s->is_round = true;
    s->disc = false;
    s->is_cut = false;
    return true;
}

void fv_sim_scene_set(struct fv_sim_scene *scene, const struct fv_sim_world *world,
                      const double T_world_cam[12], const struct fv_sim_rect *bound)
{
    int32_t count = 0;
    for (int32_t i = 0; i < world->face_count; i++) {
        const struct fv_sim_face *face = &world->face[i];
        if (set_face(&scene->surface[count], face, &world->texture[face->texture], T_world_cam,
                     bound))
            count++;
    }
    for (int32_t i = 0; i < world->round_count; i++) {
        const struct fv_sim_round *round = &world->round[i];
        if (set_round(&scene->surface[count], round, &world->texture[round->texture], T_world_cam,
                      bound))
            count++;
    }
    scene->surface_count = count;
}

/* ---- what may be seen in a rectangle of bearings --------------------------------------------- */

/* Smallest and largest value of an affine function over a rectangle. */
static inline float affine_max(const float f[3], const struct fv_sim_rect *r)
{
    return f[2] + f[0] * (f[0] > 0.0f ? r->x_max : r->x_min) +
           f[1] * (f[1] > 0.0f ? r->y_max : r->y_min);
}

static inline float affine_min(const float f[3], const struct fv_sim_rect *r)
{
    return f[2] + f[0] * (f[0] > 0.0f ? r->x_min : r->x_max) +
           f[1] * (f[1] > 0.0f ? r->y_min : r->y_max);
}

/* Whether a surface may show in the rectangle, its largest 1/z there, and, when it fills the
 * rectangle, its smallest. */
static bool may_show(const struct fv_sim_surface *s, const struct fv_sim_rect *r, float *nearest,
                     float *filled)
{
    *filled = -1.0f;
    if (outside(s, r)) return false;
    if (s->is_round) {
        *nearest = s->slant;
        return true;
    }
    *nearest = affine_max(s->inverse_z, r);
    if (*nearest <= 0.0f || affine_max(s->u, r) < 0.0f || affine_max(s->v, r) < 0.0f) return false;
    float past_u[3], past_v[3];
    for (int32_t i = 0; i < 3; i++) {
        past_u[i] = s->inverse_z[i] - s->u[i];
        past_v[i] = s->inverse_z[i] - s->v[i];
    }
    if (affine_max(past_u, r) < 0.0f || affine_max(past_v, r) < 0.0f) return false;
    if (s->is_cut && (affine_max(s->cut[0], r) < 0.0f || affine_max(s->cut[1], r) < 0.0f))
        return false;
    if (s->is_cut && (affine_min(s->cut[0], r) < 0.0f || affine_min(s->cut[1], r) < 0.0f))
        return true;
    const float farthest = affine_min(s->inverse_z, r);
    if (!s->disc && farthest > 0.0f && affine_min(s->u, r) >= 0.0f && affine_min(s->v, r) >= 0.0f &&
        affine_min(past_u, r) >= 0.0f && affine_min(past_v, r) >= 0.0f)
        *filled = farthest;
    return true;
}

int32_t fv_sim_scene_cull(const struct fv_sim_scene *scene, const uint16_t *from,
                          int32_t from_count, const struct fv_sim_rect *bound, uint16_t *list,
                          bool *covered)
{
    float near_of[FV_SIM_SURFACES_MAX], cover = -1.0f;
    int32_t count = 0, cover_at = -1, kept = 0;
    if (from == NULL) from_count = scene->surface_count;
    for (int32_t i = 0; i < from_count; i++) {
        const uint16_t index = from == NULL ? (uint16_t)i : from[i];
        float nearest, filled;
        if (!may_show(&scene->surface[index], bound, &nearest, &filled)) continue;
        if (filled > cover) {
            cover = filled;
            cover_at = index;
        }
        near_of[count] = nearest;
        list[count++] = index;
    }
    for (int32_t i = 0; i < count; i++) {
        if (near_of[i] >= cover) list[kept++] = list[i];
    }
    *covered = kept == 1 && cover_at == list[0];
    return kept;
}
