#include "paint.h"

/* What hangs and stands on walls: posters, shelves of books, doors, windows; and how light falls on
 * a wall.
 */

/* Lines of blocks, as print looks from afar; every letter a little different. */
static void poster_print(struct fv_sim_brush *b, int32_t x0, int32_t y0, int32_t x1, int32_t y1,
                         int32_t ink)
{
    int32_t y = y0 + 2;
    while (y < y1 - 3) {
        const int32_t height =
            fv_sim_clamp(fv_sim_draw(b, fv_sim_mm(b, 14), fv_sim_mm(b, 70)), 2, y1 - y);
        int32_t x = x0 + 2;
        const int32_t end = x1 - fv_sim_draw(b, 2, fv_sim_clamp((x1 - x0) / 2, 2, 1000));
        while (x < end) {
            const int32_t width = fv_sim_draw(b, height / 3 + 1, height),
                          kind = fv_sim_draw(b, 0, 4);
            if (kind < 3)
                fv_sim_fill(b, x, y, x + fv_sim_clamp(width - 1, 1, end - x), y + height - 1, ink);
            if (kind == 1)
                fv_sim_fill(b, x + width / 3, y + height / 4, x + width, y + height / 2, 255 - ink);
            if (kind == 2) fv_sim_fill(b, x, y, x + width / 2, y + height / 2, 255 - ink);
            x += width + 1;
        }
        y += height + height / 2 + 1;
    }
}

static void poster_shapes(struct fv_sim_brush *b, int32_t x0, int32_t y0, int32_t x1, int32_t y1)
{
    const int32_t w = x1 - x0, h = y1 - y0;
    for (int32_t i = 0; i < 14; i++) {
        const int32_t grey = fv_sim_draw(b, 10, 245);
        const int32_t x = x0 + fv_sim_draw(b, 0, w), y = y0 + fv_sim_draw(b, 0, h),
                      s = fv_sim_draw(b, 2, fv_sim_clamp(w / 3, 3, 4000));
        if (i % 3 == 0) {
            const int32_t r =
                fv_sim_clamp(s / 2, 1, fv_sim_clamp((x1 - x < x - x0 ? x1 - x : x - x0), 1, 4000));
            const int32_t room = y1 - y < y - y0 ? y1 - y : y - y0;
            fv_sim_disc(b, x, y, fv_sim_clamp(r, 0, room > 0 ? room : 0), grey);
        } else if (i % 3 == 1) {
            fv_sim_fill(b, x, y, fv_sim_clamp(x + s, x0, x1),
                        fv_sim_clamp(y + fv_sim_draw(b, 2, fv_sim_clamp(h / 3, 3, 4000)), y0, y1),
                        grey);
        } else {
            int32_t tx[3], ty[3];
            for (int32_t k = 0; k < 3; k++) {
                tx[k] = x0 + fv_sim_draw(b, 0, w - 1);
                ty[k] = y0 + fv_sim_draw(b, 0, h - 1);
            }
            fv_sim_triangle(b, tx, ty, grey);
        }
    }
}

/* A landscape: horizon, hills by triangles, texture in all scales. */
static void poster_landscape(struct fv_sim_brush *b, int32_t x0, int32_t y0, int32_t x1, int32_t y1)
{
    const int32_t w = x1 - x0, h = y1 - y0, horizon = y0 + h / 2;
    fv_sim_fill(b, x0, y0, x1, horizon, fv_sim_draw(b, 170, 230));
    fv_sim_fill(b, x0, horizon, x1, y1, fv_sim_draw(b, 70, 120));
    for (int32_t i = 0; i < 6; i++) {
        const int32_t middle = x0 + fv_sim_draw(b, w / 6, w * 5 / 6),
                      half = fv_sim_draw(b, w / 12, w / 6);
        const int32_t tx[3] = {middle - half, middle + half,
                               middle + fv_sim_draw(b, -half / 2, half / 2)};
        const int32_t ty[3] = {horizon + h / 8, horizon + h / 8,
                               horizon - fv_sim_draw(b, h / 8, h * 2 / 5)};
        fv_sim_triangle(b, tx, ty, fv_sim_draw(b, 30, 160));
    }
    fv_sim_noise(b, x0, y0, x1, y1, fv_sim_clamp(w / 4, 4, 256), 2, 60, 190);
}

static void poster_checks(struct fv_sim_brush *b, int32_t x0, int32_t y0, int32_t x1, int32_t y1)
{
    const int32_t cell = fv_sim_clamp((x1 - x0) / fv_sim_draw(b, 4, 9), 2, 4000);
    for (int32_t y = y0; y < y1; y += cell) {
        for (int32_t x = x0; x < x1; x += cell)
            fv_sim_fill(b, x, y, fv_sim_clamp(x + cell, x0, x1), fv_sim_clamp(y + cell, y0, y1),
                        fv_sim_draw(b, 0, 2) ? fv_sim_draw(b, 10, 110) : fv_sim_draw(b, 150, 250));
    }
}

void fv_sim_poster(struct fv_sim_brush *b, int32_t x0, int32_t y0, int32_t x1, int32_t y1)
{
    if (x1 - x0 < 8 || y1 - y0 < 8) return;
    const int32_t border = fv_sim_clamp(fv_sim_mm(b, fv_sim_draw(b, 12, 40)), 1, (x1 - x0) / 5);
    const int32_t paper = fv_sim_draw(b, 0, 2) ? fv_sim_draw(b, 190, 245) : fv_sim_draw(b, 20, 80);
    fv_sim_fill(b, x0, y0, x1, y1, paper > 128 ? fv_sim_draw(b, 10, 80) : fv_sim_draw(b, 170, 240));
    x0 += border;
    y0 += border;
    x1 -= border;
    y1 -= border;
    fv_sim_fill(b, x0, y0, x1, y1, paper);
    const int32_t kind = fv_sim_draw(b, 0, 4), third = (y1 - y0) / 3;
    if (third < 3) return;
    if (kind == 0) poster_print(b, x0, y0, x1, y1, 255 - paper);
    if (kind == 1) poster_shapes(b, x0, y0, x1, y1);
    if (kind == 2) poster_landscape(b, x0, y0, x1, y1);
    if (kind == 3) {
        poster_landscape(b, x0, y0, x1, y1 - third);
        poster_print(b, x0, y1 - third, x1, y1, 255 - paper);
    }
    if (kind == 4) {
        poster_checks(b, x0, y0, x1, y1 - third);
        poster_print(b, x0, y1 - third, x1, y1, 255 - paper);
    }
}

void fv_sim_books(struct fv_sim_brush *b, int32_t x0, int32_t y0, int32_t x1, int32_t y1)
{
    const int32_t shelves = fv_sim_clamp((y1 - y0) / fv_sim_mm(b, 330), 2, 20),
                  board = fv_sim_mm(b, 24);
    fv_sim_fill(b, x0, y0, x1, y1, 45);
    for (int32_t s = 0; s < shelves; s++) {
        const int32_t top = y0 + (y1 - y0) * s / shelves,
                      bottom = y0 + (y1 - y0) * (s + 1) / shelves - board;
        fv_sim_fill(b, x0, bottom, x1, bottom + board, fv_sim_draw(b, 120, 150));
        for (int32_t x = x0 + board; x < x1 - board;) {
            const int32_t width = fv_sim_mm(b, fv_sim_draw(b, 18, 70)),
                          gap = fv_sim_draw(b, 0, 12) == 0 ? fv_sim_mm(b, 90) : 1;
            const int32_t height = (bottom - top) * fv_sim_draw(b, 55, 95) / 100,
                          grey = fv_sim_draw(b, 20, 235);
            const int32_t right = fv_sim_clamp(x + width, x, x1 - board);
            fv_sim_fill(b, x, bottom - height, right, bottom, grey);
            const int32_t band = bottom - height + height * fv_sim_draw(b, 10, 60) / 100;
            fv_sim_fill(b, x, band, right, band + height / fv_sim_draw(b, 6, 14) + 1, 255 - grey);
            x += width + gap;
        }
    }
    fv_sim_frame(b, x0, y0, x1, y1, board, 110);
    fv_sim_noise(b, x0, y0, x1, y1, 32, 2, 16, 180);
}

static void poster_door(struct fv_sim_brush *b, int32_t x0, int32_t y0, int32_t x1, int32_t y1)
{
    const int32_t trim = fv_sim_mm(b, 70), grey = fv_sim_draw(b, 70, 190), w = x1 - x0, h = y1 - y0;
    fv_sim_fill(b, x0 - trim, y0 - trim, x1 + trim, y1, fv_sim_draw(b, 40, 90));
    fv_sim_fill(b, x0, y0, x1, y1, grey);
    for (int32_t i = 0; i < 2; i++) {
        const int32_t top = y0 + h * (10 + 45 * i) / 100;
        fv_sim_fill(b, x0 + w / 6, top, x1 - w / 6, top + h * 35 / 100, grey - 25);
        fv_sim_frame(b, x0 + w / 6, top, x1 - w / 6, top + h * 35 / 100, fv_sim_mm(b, 14),
                     grey + 35);
    }
    fv_sim_disc(b, x0 + w * 9 / 10, y0 + h / 2, fv_sim_mm(b, 32), 235);
    fv_sim_poster(b, x0 + w / 3, y0 + h / 12, x0 + w * 2 / 3, y0 + h / 12 + w / 3);
    fv_sim_noise(b, x0, y0, x1, y1, 64, 2, 28, 190);
}

static void poster_window(struct fv_sim_brush *b, int32_t x0, int32_t y0, int32_t x1, int32_t y1)
{
    const int32_t bar = fv_sim_mm(b, 50);
    poster_landscape(b, x0, y0, x1, y1);
    fv_sim_frame(b, x0 - bar, y0 - bar, x1 + bar, y1 + bar, bar, 240);
    fv_sim_fill(b, (x0 + x1 - bar) / 2, y0, (x0 + x1 + bar) / 2, y1, 240);
    fv_sim_fill(b, x0, (y0 * 2 + y1) / 3, x1, (y0 * 2 + y1) / 3 + bar, 240);
    fv_sim_fill(b, x0 - 2 * bar, y1 + bar, x1 + 2 * bar, y1 + 2 * bar, 90);
}

/* One thing on the wall whose left edge is at x; returns its width. Heights are over the floor. */
static int32_t hang(struct fv_sim_brush *b, int32_t x)
{
    const int32_t floor = b->height, kind = fv_sim_draw(b, 0, 9);
    if (kind == 0 && floor > fv_sim_mm(b, 2250)) {
        poster_door(b, x, floor - fv_sim_mm(b, 2050), x + fv_sim_mm(b, 900), floor);
        return fv_sim_mm(b, 980);
    }
    if (kind == 1) {
        const int32_t width = fv_sim_mm(b, fv_sim_draw(b, 900, 1500));
        poster_window(b, x, floor - fv_sim_mm(b, 2150), x + width, floor - fv_sim_mm(b, 950));
        return width + fv_sim_mm(b, 100);
    }
    if (kind == 2) {
        const int32_t width = fv_sim_mm(b, fv_sim_draw(b, 700, 1300)),
                      top = floor - fv_sim_mm(b, fv_sim_draw(b, 1500, 2100));
        fv_sim_books(b, x, top, x + width, top + fv_sim_mm(b, 900));
        return width;
    }
    /* Otherwise a column of one or two posters or signs. */
    const int32_t width = fv_sim_mm(b, fv_sim_draw(b, 220, 950));
    int32_t y = floor - fv_sim_mm(b, fv_sim_draw(b, 1900, 2500));
    for (int32_t i = 0; i < 3 && y < floor - fv_sim_mm(b, 400); i++) {
        const int32_t height = fv_sim_mm(b, fv_sim_draw(b, 250, 1000));
        fv_sim_poster(b, x, y, x + width, fv_sim_clamp(y + height, y, floor - fv_sim_mm(b, 150)));
        y += height + fv_sim_mm(b, fv_sim_draw(b, 80, 500));
    }
    return width;
}

void fv_sim_paint_wall(struct fv_sim_texture *texture, double texels_per_m, uint64_t seed,
                       double period_m)
{
    struct fv_sim_brush brush, *b = &brush;
    fv_sim_brush_open(b, texture, texels_per_m, seed);
    const int32_t period = period_m > 0.0 ? (int32_t)(period_m * texels_per_m) : 0;
    const struct fv_random first = b->random;
    int32_t x = fv_sim_mm(b, 150), begin = x;
    while (x < b->width - fv_sim_mm(b, 300)) {
        if (period > 0 && x - begin >= period - fv_sim_mm(b, 400)) {
            begin += period;
            x = begin;
            b->random = first;
            continue;
        }
        x += hang(b, x);
        x += fv_sim_mm(b, fv_sim_draw(b, 60, 380));
    }
    /* High walls: large banners above. */
    const int32_t above = b->height - fv_sim_mm(b, 2700);
    for (x = fv_sim_mm(b, 400); above > fv_sim_mm(b, 1000) && x < b->width - fv_sim_mm(b, 2000);) {
        const int32_t width = fv_sim_mm(b, fv_sim_draw(b, 700, 2000)),
                      top = fv_sim_mm(b, fv_sim_draw(b, 250, 700));
        fv_sim_poster(b, x, top, x + width,
                      fv_sim_clamp(top + fv_sim_mm(b, fv_sim_draw(b, 700, 2400)), top, above));
        x += width + fv_sim_mm(b, fv_sim_draw(b, 150, 900));
    }
    /* A skirting board and a cable duct: long straight lines, as rooms have. */
    fv_sim_fill(b, 0, b->height - fv_sim_mm(b, 90), b->width, b->height, 70);
    fv_sim_fill(b, 0, fv_sim_mm(b, 60), b->width, fv_sim_mm(b, 90), 100);
}

void fv_sim_paint_shade(struct fv_sim_texture *texture, int32_t x0, int32_t y0, int32_t x1,
                        int32_t y1, int32_t soft, int32_t strength)
{
    if (soft < 1) soft = 1;
    for (int32_t y = fv_sim_clamp(y0 - soft, 0, texture->height);
         y < fv_sim_clamp(y1 + soft, 0, texture->height); y++) {
        uint8_t *row = texture->texels + (size_t)y * (size_t)texture->level[0].stride;
        const int32_t dy = y < y0 ? y0 - y : y > y1 ? y - y1 : 0;
        for (int32_t x = fv_sim_clamp(x0 - soft, 0, texture->width);
             x < fv_sim_clamp(x1 + soft, 0, texture->width); x++) {
            const int32_t dx = x < x0 ? x0 - x : x > x1 ? x - x1 : 0;
            const int32_t near = fv_sim_clamp(256 - (dx + dy) * 256 / soft, 0, 256);
            row[x] = (uint8_t)(row[x] * (256 * 256 - near * strength) / (256 * 256));
        }
    }
}

enum { COLUMNS = 512 };

/* A row of texels: the corners' and lamps' light by column, the edges' of the row. */
FV_WIDE static void light_row(uint8_t *restrict texel, const int32_t *restrict corner,
                              const int32_t *restrict lamp, int32_t edge, int32_t count)
{
    for (int32_t x = 0; x < count; x++) {
        const int32_t gain = (180 + corner[x] + edge) * lamp[x] / 256;
        texel[x] = (uint8_t)fv_sim_clamp(texel[x] * gain / 205, 0, 255);
    }
}

/* A parabola per lamp along the wall; edges and corners are 30 % darker. */
void fv_sim_paint_light(struct fv_sim_texture *texture, double texels_per_m, uint64_t seed)
{
    const int32_t w = texture->width, h = texture->height, near = (int32_t)(texels_per_m * 0.7);
    int32_t corner[COLUMNS], lamp[COLUMNS];
    struct fv_random random;
    fv_random_seed(&random, seed);
    const int32_t pool = (int32_t)(texels_per_m * 2.6),
                  at = (int32_t)fv_random_below(&random, (uint32_t)pool);
    for (int32_t left = 0; left < w; left += COLUMNS) {
        const int32_t count = w - left < COLUMNS ? w - left : COLUMNS;
        for (int32_t i = 0; i < count; i++) {
            const int32_t x = left + i, p = ((x + at) % pool) * 512 / pool - 256;
            corner[i] =
                fv_sim_clamp((x < w - 1 - x ? x : w - 1 - x) * 256 / near, 0, 256) * 38 / 256;
            lamp[i] = 256 - p * p / 1024;
        }
        for (int32_t y = 0; y < h; y++) {
            const int32_t edge =
                fv_sim_clamp((y < h - 1 - y ? y : h - 1 - y) * 256 / near, 0, 256) * 38 / 256;
            light_row(texture->texels + (size_t)y * (size_t)texture->level[0].stride + left, corner,
                      lamp, edge, count);
        }
    }
}
