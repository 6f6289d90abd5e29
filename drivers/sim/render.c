#include "sim.h"

#include <string.h>

/* Tile by tile: which surfaces may show, which is nearest at every pixel, then its texture. Where
 * neighbouring pixels show different surfaces, four samples per pixel smooth the edge. Loops run
 * over arrays of samples so that the compiler can use vectors; every operation is a plain IEEE one,
 * so the result does not depend on whether it does. */

enum { SAMPLES = FV_SIM_TILE_PIXELS };

/* ---- what it looks like ---------------------------------------------------------------------- */

/* Floats and their bits. */
union punned {
    float real[SAMPLES];
    int32_t bits[SAMPLES];
};

/* Where in the texture and at which level. */
struct look {
    float u[SAMPLES], v[SAMPLES];               /* texels of the base */
    union punned area;                          /* of the footprint, in those texels */
    int32_t fixed_u[SAMPLES], fixed_v[SAMPLES]; /* 256ths of a texel of the level */
    int32_t level[SAMPLES];
    int32_t light[SAMPLES]; /* 256 is plain */
};

FV_IN_WIDE void look_face(const struct fv_sim_surface *s, const float *restrict x,
                          const float *restrict y, int32_t count, float pixel_area,
                          struct look *restrict look)
{
    const float a = s->inverse_z[0], b = s->inverse_z[1], c = s->inverse_z[2];
    const float ua = s->u[0], ub = s->u[1], uc = s->u[2], va = s->v[0], vb = s->v[1], vc = s->v[2];
    const float area = s->area * pixel_area, slant = s->slant, tu = s->tex_u, tv = s->tex_v,
                du = s->tex_du, dv = s->tex_dv;
    for (int32_t i = 0; i < count; i++) {
        const float z = 1.0f / (a * x[i] + b * y[i] + c);
        const float u = (ua * x[i] + ub * y[i] + uc) * z, v = (va * x[i] + vb * y[i] + vc) * z;
        look->u[i] = tu + u * du;
        look->v[i] = tv + v * dv;
        /* Area of the footprint, times the root of the slant (1 / cosine of incidence): halfway
         * between the area and the square of its long side, so that texture seen at a grazing angle
         * neither blurs away nor sparkles. */
        look->area.real[i] = area * z * z * z * __builtin_sqrtf(z * slant);
    }
}

/* Angle of (x, y) in turns, [-0.5, 0.5]; polynomial of the arc tangent good to 1e-4 rad. */
FV_IN_WIDE float turns(float y, float x)
{
    const float ax = __builtin_fabsf(x), ay = __builtin_fabsf(y), low = ax < ay ? ax : ay,
                high = ax < ay ? ay : ax;
    const float q = low / (high + 1e-20f), s = q * q;
    float angle = ((-0.0464964749f * s + 0.15931422f) * s - 0.327622764f) * s * q + q;
    angle = ay > ax ? 1.57079637f - angle : angle;
    angle = x < 0.0f ? 3.14159274f - angle : angle;
    return (y < 0.0f ? -angle : angle) * 0.159154943f;
}

FV_IN_WIDE void look_round(const struct fv_sim_surface *s, const float *restrict x,
                           const float *restrict y, const float *restrict inverse_z, int32_t count,
                           float pixel_area, struct look *restrict look)
{
    const float area = s->area * pixel_area, over = 1.0f / s->height;
    for (int32_t i = 0; i < count; i++) {
        /* NOLINTNEXTLINE(clang-analyzer-core.NullDereference): NULL is for walls and floors, which
         * cover tiles whole */
        const float z = 1.0f / inverse_z[i], dx = x[i] * z - s->p[0], dy = y[i] * z - s->p[1],
                    dz = z - s->p[2];
        const float up = dx * s->a[0] + dy * s->a[1] + dz * s->a[2];
        const float c1 = dx * s->e1[0] + dy * s->e1[1] + dz * s->e1[2],
                    c2 = dx * s->e2[0] + dy * s->e2[1] + dz * s->e2[2];
        look->u[i] = (turns(c2, c1) + 0.5f) * s->tex_du;
        look->v[i] = (1.0f - up * over) * s->tex_dv;
        look->area.real[i] = area * z * z * 1.4f;
        /* Outward normal: the gradient of distance^2 - radius^2. */
        const float bend = 0.5f * s->q1 + s->q2 * up + up;
        const float nx = dx - bend * s->a[0], ny = dy - bend * s->a[1], nz = dz - bend * s->a[2];
        const float cosine = (nx * s->sun[0] + ny * s->sun[1] + nz * s->sun[2]) /
                             __builtin_sqrtf(nx * nx + ny * ny + nz * nz + 1e-12f);
        look->light[i] = (int32_t)(s->light * (180.0f + 80.0f * cosine));
    }
}

/* Level for a footprint, from the bits of its area. Half-octaves of length are octaves of area,
 * which the exponent of a float counts: level l for footprints of 2^(l-1) to 2^l texels of the
 * base, so that a level's texel is never smaller than the pixel. */
FV_IN_WIDE int32_t level_of(int32_t area_bits, int32_t last)
{
    const int32_t level = (area_bits >> 23) - 126, low = level < 0 ? 0 : level;
    return low > last ? last : low;
}

/* Bits of the scale of a level: 2^-(level / 2), times 5/7 for odd ones (texture.c). */
FV_IN_WIDE int32_t scale_bits(int32_t level)
{
    const int32_t one = 0x3F800000, five_sevenths = 0x3F36DB6E;
    return one - (-(level & 1) & (one - five_sevenths)) - ((level >> 1) << 23);
}

/* 256ths of a texel of a level, from texels of the base and 256 times the level's scale; kept
 * inside. */
FV_IN_WIDE int32_t texel_at(float base, float size, float fine)
{
    const int32_t last = (int32_t)(size * fine) - 128, at = (int32_t)(base * fine) - 128,
                  low = at < last ? at : last;
    return low > 0 ? low : 0;
}

/* Whether all samples have one level (as mostly); then only level[0] is set. */
FV_IN_WIDE bool find_levels(const struct fv_sim_texture *texture, int32_t count,
                            struct look *restrict look)
{
    const int32_t last = texture->level_count - 1;
    int32_t least = INT32_MAX, most = 0; /* positive floats are in the order of their bits */
    for (int32_t i = 0; i < count; i++) {
        least = look->area.bits[i] < least ? look->area.bits[i] : least;
        most = look->area.bits[i] > most ? look->area.bits[i] : most;
    }
    look->level[0] = level_of(least, last);
    if (look->level[0] == level_of(most, last)) return true;
    for (int32_t i = 0; i < count; i++)
        look->level[i] = level_of(look->area.bits[i], last);
    return false;
}

/* The four texels round every sample: upper and lower pair, the left one in the low byte. */
FV_IN_WIDE void fetch_one_level(const struct fv_sim_texture *texture, int32_t count,
                                struct look *restrict look, uint16_t *restrict upper,
                                uint16_t *restrict lower)
{
    const struct fv_sim_level *l = &texture->level[look->level[0]];
    const uint8_t *top = l->texels, *bottom = l->texels + l->stride;
    const float width = texture->u_max, height = texture->v_max;
    const int32_t stride = l->stride, bits = scale_bits(look->level[0]);
    int32_t at[SAMPLES];
    float fine;
    memcpy(&fine, &bits, sizeof fine);
    fine *= 256.0f;
    for (int32_t i = 0; i < count; i++) {
        look->fixed_u[i] = texel_at(look->u[i], width, fine);
        look->fixed_v[i] = texel_at(look->v[i], height, fine);
        at[i] = (look->fixed_v[i] >> 8) * stride + (look->fixed_u[i] >> 8);
    }
    for (int32_t i = 0; i < count; i++) {
        const uint8_t *t = top + at[i], *b = bottom + at[i];
        upper[i] = (uint16_t)(t[0] | t[1] << 8);
        lower[i] = (uint16_t)(b[0] | b[1] << 8);
    }
}

FV_IN_WIDE void fetch_levels(const struct fv_sim_texture *texture, int32_t count,
                             struct look *restrict look, uint16_t *restrict upper,
                             uint16_t *restrict lower)
{
    const float width = texture->u_max, height = texture->v_max;
    union punned scale;
    for (int32_t i = 0; i < count; i++)
        scale.bits[i] = scale_bits(look->level[i]);
    for (int32_t i = 0; i < count; i++) {
        look->fixed_u[i] = texel_at(look->u[i], width, scale.real[i] * 256.0f);
        look->fixed_v[i] = texel_at(look->v[i], height, scale.real[i] * 256.0f);
    }
    for (int32_t i = 0; i < count; i++) {
        const struct fv_sim_level *l = &texture->level[look->level[i]];
        const uint8_t *t =
                          l->texels + (look->fixed_v[i] >> 8) * l->stride + (look->fixed_u[i] >> 8),
                      *b = t + l->stride;
        upper[i] = (uint16_t)(t[0] | t[1] << 8);
        lower[i] = (uint16_t)(b[0] | b[1] << 8);
    }
}

/* Bilinear in 16 bits: rows modulo 2^16 (their true values fit), halved so that their difference
 * has a sign. Out in 1/256 grey levels. */
FV_IN_WIDE void blend(const struct look *restrict look, int32_t count,
                      const uint16_t *restrict upper, const uint16_t *restrict lower,
                      uint16_t *restrict out)
{
    int16_t value[SAMPLES];
    for (int32_t i = 0; i < count; i++) {
        const uint16_t fu = (uint16_t)(look->fixed_u[i] & 255), t = upper[i], b = lower[i];
        const uint16_t top =
            (uint16_t)((uint16_t)(t << 8) + (uint16_t)((uint16_t)((t >> 8) - (t & 255)) * fu));
        const uint16_t bottom =
            (uint16_t)((uint16_t)(b << 8) + (uint16_t)((uint16_t)((b >> 8) - (b & 255)) * fu));
        const int16_t high = (int16_t)(top >> 1), low = (int16_t)(bottom >> 1);
        const int16_t fv = (int16_t)((look->fixed_v[i] & 255) << 7), step = (int16_t)(low - high);
        value[i] = (int16_t)(high + (int16_t)(((int32_t)step * fv) >> 16) * 2);
    }
    for (int32_t i = 0; i < count; i++) {
        const int32_t bright = value[i] * look->light[i] >> 7;
        out[i] = (uint16_t)(bright < 65535 ? bright : 65535);
    }
}

FV_WIDE static void shade(const struct fv_sim_surface *s, const float *x, const float *y,
                          const float *inverse_z, int32_t count, float pixel_area,
                          uint16_t *restrict out)
{
    struct look look;
    uint16_t upper[SAMPLES], lower[SAMPLES];
    if (s->is_round) {
        look_round(s, x, y, inverse_z, count, pixel_area, &look);
    } else {
        const int32_t light = (int32_t)(s->light * 256.0f);
        look_face(s, x, y, count, pixel_area, &look);
        for (int32_t i = 0; i < count; i++)
            look.light[i] = light;
    }
    if (find_levels(s->texture, count, &look))
        fetch_one_level(s->texture, count, &look, upper, lower);
    else
        fetch_levels(s->texture, count, &look, upper, lower);
    blend(&look, count, upper, lower, out);
}

/* Which samples show which candidate: those of candidate k are at[begin[k]] to at[begin[k + 1] -
 * 1]. */
struct sorted {
    int32_t begin[FV_SIM_SURFACES_MAX + 2];
    uint16_t at[SAMPLES];
};

/* Counting sort; samples that show nothing (hit -1) are left out. */
FV_IN_WIDE void sort_by_hit(const int32_t *restrict hit, int32_t count, int32_t list_count,
                            struct sorted *restrict sorted)
{
    int32_t *place =
        sorted->begin; /* one further on, so that filling in moves them to where they belong */
    for (int32_t k = 0; k < list_count + 2; k++)
        place[k] = 0;
    for (int32_t i = 0; i < count; i++)
        place[hit[i] + 2] += hit[i] >= 0;
    for (int32_t k = 1; k < list_count + 2; k++)
        place[k] += place[k - 1];
    for (int32_t i = 0; i < count; i++) {
        if (hit[i] >= 0) sorted->at[place[hit[i] + 1]++] = (uint16_t)i;
    }
}

/* Trace and shade samples; `seen` takes surface index + 1. */
FV_WIDE static void see(const struct fv_sim_scene *scene, const uint16_t *list, int32_t list_count,
                        const float *x, const float *y, int32_t count, float pixel_area,
                        uint16_t *restrict light, uint16_t *restrict seen)
{
    float inverse_z[SAMPLES], px[SAMPLES], py[SAMPLES], pz[SAMPLES];
    int32_t hit[SAMPLES];
    uint16_t out[SAMPLES];
    struct sorted sorted;
    fv_sim_trace(scene, list, list_count, x, y, count, inverse_z, hit);
    int32_t other = 0;
    for (int32_t i = 0; i < count; i++)
        other |= hit[i] ^ hit[0];
    const uint16_t first = hit[0] < 0 ? 0 : (uint16_t)(list[hit[0]] + 1);
    for (int32_t i = 0; i < count; i++) {
        light[i] = 0;
        seen[i] = other == 0 ? first : 0;
    }
    if (other == 0) {
        if (first > 0) shade(&scene->surface[first - 1], x, y, inverse_z, count, pixel_area, light);
        return;
    }
    sort_by_hit(hit, count, list_count, &sorted);
    for (int32_t k = 0; k < list_count; k++) {
        const uint16_t *at = sorted.at + sorted.begin[k];
        const int32_t n = sorted.begin[k + 1] - sorted.begin[k];
        if (n == 0) continue; /* most candidates turn out to be hidden */
        for (int32_t j = 0; j < n; j++) {
            px[j] = x[at[j]];
            py[j] = y[at[j]];
            pz[j] = inverse_z[at[j]];
        }
        shade(&scene->surface[list[k]], px, py, pz, n, pixel_area, out);
        for (int32_t j = 0; j < n; j++) {
            light[at[j]] = out[j];
            seen[at[j]] = (uint16_t)(list[k] + 1);
        }
    }
}

/* ---- tiles ----------------------------------------------------------------------------------- */

struct job {
    const struct fv_sim_scene *scene;
    const struct fv_sim_raster *raster;
    struct fv_sim_canvas *canvas;
    int32_t y_begin, y_end;
};

/* Where a pixel row begins in the canvas. */
static inline size_t row_start(const struct job *job, int32_t y)
{
    return (size_t)(y % job->canvas->rows) * (size_t)job->raster->width;
}

/* A row of a tile into the canvas; of the last tile only what the image has. */
static inline void row_write(uint16_t *to, const uint16_t *row, int32_t columns)
{
    if (columns == FV_SIM_TILE)
        memcpy(to, row, FV_SIM_TILE * sizeof *row); /* of a size known to the compiler */
    else
        memcpy(to, row, (size_t)columns * sizeof *row);
}

static void first_pass(const struct job *job, int32_t tile, const uint16_t *list, int32_t count,
                       bool covered)
{
    const struct fv_sim_raster *raster = job->raster;
    const int32_t tx = tile % raster->tiles_x * FV_SIM_TILE,
                  ty = tile / raster->tiles_x * FV_SIM_TILE;
    const int32_t r0 = job->y_begin > ty ? job->y_begin - ty : 0,
                  r1 = job->y_end < ty + FV_SIM_TILE ? job->y_end - ty : FV_SIM_TILE;
    const int32_t columns = raster->width - tx < FV_SIM_TILE ? raster->width - tx : FV_SIM_TILE;
    const size_t first = (size_t)tile * FV_SIM_TILE_PIXELS + (size_t)(r0 * FV_SIM_TILE);
    uint16_t light[SAMPLES], seen[SAMPLES];
    if (r1 <= r0) return;
    const int32_t samples = (r1 - r0) * FV_SIM_TILE;
    if (covered) {
        shade(&job->scene->surface[list[0]], raster->x + first, raster->y + first, NULL, samples,
              raster->pixel_area[tile], light);
        for (int32_t i = 0; i < samples; i++)
            seen[i] = (uint16_t)(list[0] + 1);
    } else {
        see(job->scene, list, count, raster->x + first, raster->y + first, samples,
            raster->pixel_area[tile], light, seen);
    }
    for (int32_t r = r0; r < r1; r++) {
        const size_t to = row_start(job, ty + r) + (size_t)tx;
        row_write(job->canvas->linear + to, light + (r - r0) * FV_SIM_TILE, columns);
        row_write(job->canvas->surface + to, seen + (r - r0) * FV_SIM_TILE, columns);
    }
}

/* A step between surfaces of less than this (1/256 grey levels) needs no smoothing. */
static const int32_t edge_step = 5 * 256;

/* Marks pixels of a row that border on another surface of the row `other` and differ in brightness.
 */
FV_IN_WIDE void mark_steps(const uint16_t *restrict surface, const uint16_t *restrict light,
                           const uint16_t *restrict other_surface,
                           const uint16_t *restrict other_light, uint16_t *restrict mark)
{
    for (int32_t c = 0; c < FV_SIM_TILE; c++) {
        const uint16_t high = light[c] > other_light[c] ? light[c] : other_light[c],
                       low = light[c] > other_light[c] ? other_light[c] : light[c];
        mark[c] |= (uint16_t)((uint16_t) - (surface[c] != other_surface[c]) &
                              (uint16_t) - ((uint16_t)(high - low) > edge_step));
    }
}

/* A row of a tile with a pixel more on either side; past the image and the tile the last one is
 * repeated. */
FV_IN_WIDE void row_read(const uint16_t *from, int32_t columns, bool left, bool right,
                         uint16_t *restrict line)
{
    if (columns == FV_SIM_TILE) { /* as mostly */
        /* A loop becomes one vector move; a fortified memcpy into a row picked by index is a call.
         */
        for (int32_t c = 0; c < FV_SIM_TILE; c++)
            line[c + 1] = from[c];
    } else {
        for (int32_t c = 0; c < FV_SIM_TILE; c++)
            line[c + 1] = from[c < columns ? c : columns - 1];
    }
    line[0] = from[left ? -1 : 0];
    line[FV_SIM_TILE + 1] = from[right ? columns : columns - 1];
}

/* Where in the tile pixels border on another surface and differ in brightness; returns how many. */
FV_WIDE static int32_t find_edges(const struct job *job, int32_t tx, int32_t ty, uint8_t *list)
{
    const int32_t width = job->raster->width, y_first = ty > job->y_begin ? ty : job->y_begin;
    const int32_t y_last = ty + FV_SIM_TILE < job->y_end ? ty + FV_SIM_TILE : job->y_end;
    const int32_t columns = width - tx < FV_SIM_TILE ? width - tx : FV_SIM_TILE;
    const bool left = tx > 0, right = tx + columns < width;
    /* Rows above, of and below the one looked at, in turn. */
    uint16_t surface[3][FV_SIM_TILE + 2], light[3][FV_SIM_TILE + 2];
    int32_t count = 0;
    for (int32_t y = y_first - 1; y <= y_last; y++) {
        const int32_t inside = y < job->y_begin  ? job->y_begin
                               : y >= job->y_end ? job->y_end - 1
                                                 : y;
        const size_t start = row_start(job, inside) + (size_t)tx;
        row_read(job->canvas->surface + start, columns, left, right, surface[(y + 3) % 3]);
        row_read(job->canvas->linear + start, columns, left, right, light[(y + 3) % 3]);
        if (y < y_first + 1) continue;
        const int32_t up = (y + 1) % 3, here = (y + 2) % 3, down = (y + 3) % 3;
        const uint16_t *own_surface = surface[here] + 1, *own_light = light[here] + 1;
        uint16_t mark[FV_SIM_TILE] = {0};
        mark_steps(own_surface, own_light, surface[here], light[here], mark);
        mark_steps(own_surface, own_light, surface[here] + 2, light[here] + 2, mark);
        mark_steps(own_surface, own_light, surface[up] + 1, light[up] + 1, mark);
        mark_steps(own_surface, own_light, surface[down] + 1, light[down] + 1, mark);
        uint16_t any = 0;
        for (int32_t c = 0; c < FV_SIM_TILE; c++)
            any |= mark[c];
        for (int32_t c = 0; any != 0 && c < columns; c++) {
            list[count] = (uint8_t)((y - 1 - ty) * FV_SIM_TILE + c);
            count += mark[c] != 0;
        }
    }
    return count;
}

/* Four samples on a rotated grid, in eighths of a pixel. */
static const float sub_x[4] = {-0.125f, 0.375f, -0.375f, 0.125f},
                   sub_y[4] = {-0.375f, -0.125f, 0.125f, 0.375f};

static void second_pass(const struct job *job, int32_t tile, const uint16_t *list, int32_t count)
{
    const struct fv_sim_raster *raster = job->raster;
    const int32_t tx = tile % raster->tiles_x * FV_SIM_TILE,
                  ty = tile / raster->tiles_x * FV_SIM_TILE;
    const float *tile_x = raster->x + (size_t)tile * FV_SIM_TILE_PIXELS,
                *tile_y = raster->y + (size_t)tile * FV_SIM_TILE_PIXELS;
    uint8_t edge[SAMPLES];
    uint16_t light[SAMPLES], seen[SAMPLES];
    float x[SAMPLES], y[SAMPLES];
    const int32_t edges = find_edges(job, tx, ty, edge);
    for (int32_t first = 0; first < edges; first += SAMPLES / 4) {
        const int32_t n = edges - first < SAMPLES / 4 ? edges - first : SAMPLES / 4;
        for (int32_t j = 0; j < n; j++) {
            /* Bearings between pixels from the differences to the neighbours in the tile. */
            const int32_t p = edge[first + j], c = p % FV_SIM_TILE, r = p / FV_SIM_TILE;
            const int32_t h = c + 1 < FV_SIM_TILE && tx + c + 1 < raster->width ? p : p - 1;
            const int32_t v =
                r + 1 < FV_SIM_TILE && ty + r + 1 < raster->height ? p : p - FV_SIM_TILE;
            const float xx = tile_x[h + 1] - tile_x[h], yx = tile_y[h + 1] - tile_y[h];
            const float xy = tile_x[v + FV_SIM_TILE] - tile_x[v],
                        yy = tile_y[v + FV_SIM_TILE] - tile_y[v];
            for (int32_t k = 0; k < 4; k++) {
                x[4 * j + k] = tile_x[p] + sub_x[k] * xx + sub_y[k] * xy;
                y[4 * j + k] = tile_y[p] + sub_x[k] * yx + sub_y[k] * yy;
            }
        }
        see(job->scene, list, count, x, y, 4 * n, raster->pixel_area[tile], light, seen);
        for (int32_t j = 0; j < n; j++) {
            const int32_t p = edge[first + j], sum = light[4 * j] + light[4 * j + 1] +
                                                     light[4 * j + 2] + light[4 * j + 3];
            const size_t to = row_start(job, ty + p / FV_SIM_TILE) + (size_t)(tx + p % FV_SIM_TILE);
            job->canvas->linear[to] = (uint16_t)(sum / 4);
        }
    }
}

/* The two passes over a block of tiles share its list of candidates. */
static void block_pass(const struct job *job, int32_t bx, int32_t by, bool second)
{
    const struct fv_sim_raster *raster = job->raster;
    uint16_t in_block[FV_SIM_SURFACES_MAX], in_tile[FV_SIM_SURFACES_MAX];
    struct fv_sim_rect bound = {1e9f, -1e9f, 1e9f, -1e9f};
    const int32_t x_end =
        bx + FV_SIM_BLOCK_TILES < raster->tiles_x ? bx + FV_SIM_BLOCK_TILES : raster->tiles_x;
    const int32_t y_end =
        by + FV_SIM_BLOCK_TILES < raster->tiles_y ? by + FV_SIM_BLOCK_TILES : raster->tiles_y;
    for (int32_t y = by; y < y_end; y++) {
        for (int32_t x = bx; x < x_end; x++) {
            const struct fv_sim_rect *tile = &raster->bound[y * raster->tiles_x + x];
            if (tile->x_min < bound.x_min) bound.x_min = tile->x_min;
            if (tile->x_max > bound.x_max) bound.x_max = tile->x_max;
            if (tile->y_min < bound.y_min) bound.y_min = tile->y_min;
            if (tile->y_max > bound.y_max) bound.y_max = tile->y_max;
        }
    }
    bool covered;
    const int32_t block_count = fv_sim_scene_cull(job->scene, NULL, 0, &bound, in_block, &covered);
    for (int32_t y = by; y < y_end; y++) {
        if ((y + 1) * FV_SIM_TILE <= job->y_begin || y * FV_SIM_TILE >= job->y_end) continue;
        for (int32_t x = bx; x < x_end; x++) {
            const int32_t tile = y * raster->tiles_x + x;
            const int32_t count = fv_sim_scene_cull(job->scene, in_block, block_count,
                                                    &raster->bound[tile], in_tile, &covered);
            if (!second)
                first_pass(job, tile, in_tile, count, covered);
            else if (!covered)
                second_pass(job, tile, in_tile, count);
        }
    }
}

static void blocks_pass(const struct job *job, int32_t by, bool second)
{
    for (int32_t bx = 0; bx < job->raster->tiles_x; bx += FV_SIM_BLOCK_TILES)
        block_pass(job, bx, by, second);
}

/* The second pass over a row of blocks, of which the next has had its first: no other changes its
 * pixels any more. */
static void blocks_finish(const struct job *job, int32_t by)
{
    const struct fv_sim_canvas *canvas = job->canvas;
    const int32_t top = by * FV_SIM_TILE, bottom = top + FV_SIM_BLOCK_ROWS;
    const int32_t y_begin = top > job->y_begin ? top : job->y_begin,
                  y_end = bottom < job->y_end ? bottom : job->y_end;
    blocks_pass(job, by, true);
    if (canvas->finished != NULL)
        canvas->finished(canvas->context, canvas->linear + row_start(job, y_begin), y_begin, y_end);
}

void fv_sim_render(const struct fv_sim_scene *scene, const struct fv_sim_raster *raster,
                   int32_t y_begin, int32_t y_end, struct fv_sim_canvas *canvas)
{
    const struct job job = {scene, raster, canvas, y_begin, y_end};
    const int32_t first = y_begin / FV_SIM_BLOCK_ROWS * FV_SIM_BLOCK_TILES;
    int32_t by = first;
    for (; by < raster->tiles_y && by * FV_SIM_TILE < y_end; by += FV_SIM_BLOCK_TILES) {
        blocks_pass(&job, by, false);
        if (by > first) blocks_finish(&job, by - FV_SIM_BLOCK_TILES);
    }
    if (by > first) blocks_finish(&job, by - FV_SIM_BLOCK_TILES);
}
