#include "paint.h"

#include <string.h>

/* ---- brushes --------------------------------------------------------------------------------- */

void fv_sim_brush_open(struct fv_sim_brush *brush, struct fv_sim_texture *texture,
                       double texels_per_m, uint64_t seed)
{
    brush->texels = texture->texels;
    brush->width = texture->width;
    brush->height = texture->height;
    brush->stride = texture->level[0].stride;
    brush->scale = (int32_t)texels_per_m;
    fv_random_seed(&brush->random, seed);
}

int32_t fv_sim_draw(struct fv_sim_brush *brush, int32_t low, int32_t high)
{
    return low + (int32_t)fv_random_below(&brush->random, (uint32_t)(high - low + 1));
}

int32_t fv_sim_mm(const struct fv_sim_brush *brush, int32_t millimetres)
{
    const int32_t texels = (int32_t)((int64_t)brush->scale * millimetres / 1000);
    return texels < 1 ? 1 : texels;
}

void fv_sim_fill(struct fv_sim_brush *brush, int32_t x0, int32_t y0, int32_t x1, int32_t y1,
                 int32_t grey)
{
    x0 = fv_sim_clamp(x0, 0, brush->width);
    x1 = fv_sim_clamp(x1, 0, brush->width);
    y0 = fv_sim_clamp(y0, 0, brush->height);
    y1 = fv_sim_clamp(y1, 0, brush->height);
    if (x1 <= x0) return;
    for (int32_t y = y0; y < y1; y++)
        memset(brush->texels + (size_t)y * (size_t)brush->stride + x0, fv_sim_clamp(grey, 0, 255),
               (size_t)(x1 - x0));
}

void fv_sim_frame(struct fv_sim_brush *brush, int32_t x0, int32_t y0, int32_t x1, int32_t y1,
                  int32_t thick, int32_t grey)
{
    fv_sim_fill(brush, x0, y0, x1, y0 + thick, grey);
    fv_sim_fill(brush, x0, y1 - thick, x1, y1, grey);
    fv_sim_fill(brush, x0, y0, x0 + thick, y1, grey);
    fv_sim_fill(brush, x1 - thick, y0, x1, y1, grey);
}

void fv_sim_disc(struct fv_sim_brush *brush, int32_t cx, int32_t cy, int32_t radius, int32_t grey)
{
    for (int32_t y = -radius; y <= radius; y++) {
        int32_t x = 0;
        while ((x + 1) * (x + 1) + y * y <= radius * radius)
            x++;
        fv_sim_fill(brush, cx - x, cy + y, cx + x + 1, cy + y + 1, grey);
    }
}

void fv_sim_triangle(struct fv_sim_brush *brush, const int32_t x[3], const int32_t y[3],
                     int32_t grey)
{
    int32_t top = y[0], bottom = y[0];
    for (int32_t i = 1; i < 3; i++) {
        if (y[i] < top) top = y[i];
        if (y[i] > bottom) bottom = y[i];
    }
    for (int32_t row = fv_sim_clamp(top, 0, brush->height);
         row < fv_sim_clamp(bottom, 0, brush->height); row++) {
        int32_t left = INT32_MAX, right = INT32_MIN;
        for (int32_t i = 0; i < 3; i++) {
            const int32_t j = (i + 1) % 3;
            const int32_t low = y[i] < y[j] ? i : j, high = low == i ? j : i;
            if (y[low] == y[high] || row < y[low] || row >= y[high]) continue;
            const int32_t at = x[low] + (x[high] - x[low]) * (row - y[low]) / (y[high] - y[low]);
            if (at < left) left = at;
            if (at > right) right = at;
        }
        if (left <= right) fv_sim_fill(brush, left, row, right + 1, row + 1, grey);
    }
}

/* ---- materials ------------------------------------------------------------------------------- */

/* Courses of stones with joints: bricks, blocks, tiles, boards. Sizes in texels; `shift` moves
 * every other course by half a stone, or by a random amount. */
struct courses {
    int32_t width, height, joint, grey, spread, joint_grey;
    bool random_shift, half_shift;
};

static void paint_courses(struct fv_sim_brush *b, const struct courses *c)
{
    fv_sim_fill(b, 0, 0, b->width, b->height, c->joint_grey);
    for (int32_t y = 0, row = 0; y < b->height; y += c->height, row++) {
        int32_t shift = c->random_shift              ? fv_sim_draw(b, 0, c->width - 1)
                        : c->half_shift && (row & 1) ? c->width / 2
                                                     : 0;
        for (int32_t x = -shift; x < b->width; x += c->width) {
            const int32_t grey = c->grey + fv_sim_draw(b, -c->spread, c->spread);
            fv_sim_fill(b, x, y, x + c->width - c->joint, y + c->height - c->joint, grey);
        }
    }
}

static void paint_speckle(struct fv_sim_brush *b, int32_t per_m2, int32_t mm_low, int32_t mm_high)
{
    const int64_t area = (int64_t)b->width * b->height, unit = (int64_t)b->scale * b->scale;
    const int32_t count = (int32_t)(area * per_m2 / (unit < 1 ? 1 : unit));
    for (int32_t i = 0; i < count; i++) {
        const int32_t x = fv_sim_draw(b, 0, b->width - 1), y = fv_sim_draw(b, 0, b->height - 1);
        const int32_t w = fv_sim_mm(b, fv_sim_draw(b, mm_low, mm_high)),
                      h = fv_sim_mm(b, fv_sim_draw(b, mm_low, mm_high));
        fv_sim_fill(b, x, y, x + w, y + h, fv_sim_draw(b, 20, 235));
    }
}

static void paint_grain(struct fv_sim_brush *b, int32_t amount)
{
    /* Streaks along x: the noise of a canvas squeezed in y, by stretching short runs. */
    for (int32_t y = 0; y < b->height; y++) {
        uint8_t *row = b->texels + (size_t)y * (size_t)b->stride;
        int32_t x = 0;
        while (x < b->width) {
            const int32_t run = fv_sim_draw(b, 6, 40), change = fv_sim_draw(b, -amount, amount);
            for (int32_t end = fv_sim_clamp(x + run, 0, b->width); x < end; x++)
                row[x] = (uint8_t)fv_sim_clamp(row[x] + change, 0, 255);
        }
    }
}

static void paint_carpet(struct fv_sim_brush *b)
{
    const int32_t cell = fv_sim_mm(b, 500);
    fv_sim_fill(b, 0, 0, b->width, b->height, 120);
    for (int32_t y = 0; y < b->height; y += cell) {
        for (int32_t x = 0; x < b->width; x += cell) {
            const int32_t grey = fv_sim_draw(b, 80, 150), kind = fv_sim_draw(b, 0, 3),
                          other = fv_sim_draw(b, 50, 190);
            fv_sim_fill(b, x, y, x + cell, y + cell, grey);
            if (kind == 0)
                fv_sim_disc(b, x + cell / 2, y + cell / 2, cell / fv_sim_draw(b, 3, 6), other);
            if (kind == 1)
                fv_sim_frame(b, x + cell / 5, y + cell / 5, x + cell * 4 / 5, y + cell * 4 / 5,
                             cell / 8 + 1, other);
            if (kind == 2) {
                const int32_t tx[3] = {x, x + cell, x + fv_sim_draw(b, 0, cell)},
                              ty[3] = {y, y + fv_sim_draw(b, 0, cell), y + cell};
                fv_sim_triangle(b, tx, ty, other);
            }
        }
    }
    fv_sim_noise(b, 0, 0, b->width, b->height, fv_sim_mm(b, 400), 2, 26, 190);
}

static void paint_clutter(struct fv_sim_brush *b)
{
    fv_sim_fill(b, 0, 0, b->width, b->height, fv_sim_draw(b, 60, 180));
    for (int32_t size = fv_sim_mm(b, 400); size >= 2; size = size * 2 / 3) {
        for (int32_t i = 0; i < 24; i++) {
            const int32_t x = fv_sim_draw(b, 0, b->width), y = fv_sim_draw(b, 0, b->height);
            const int32_t w = fv_sim_draw(b, size / 2, size), h = fv_sim_draw(b, size / 2, size);
            fv_sim_fill(b, x, y, x + w, y + h, fv_sim_draw(b, 15, 240));
        }
    }
    fv_sim_noise(b, 0, 0, b->width, b->height, 32, 2, 24, 180);
}

/* A carton: tape across, a label with lines, an arrow. */
static void paint_carton(struct fv_sim_brush *b, int32_t grey)
{
    fv_sim_fill(b, 0, 0, b->width, b->height, grey);
    fv_sim_noise(b, 0, 0, b->width, b->height, fv_sim_mm(b, 200), 2, 22, 170);
    const int32_t tape = b->width / 10 + 1, at = fv_sim_draw(b, b->width / 3, b->width / 2);
    fv_sim_fill(b, at, 0, at + tape, b->height, grey + 45);
    for (int32_t i = 0; i < 3; i++) {
        const int32_t x = fv_sim_draw(b, 0, b->width * 3 / 4),
                      y = fv_sim_draw(b, 0, b->height * 3 / 4);
        const int32_t w = b->width / 4 + fv_sim_draw(b, 0, b->width / 6);
        const int32_t h = b->height / 5 + fv_sim_draw(b, 0, b->height / 8);
        fv_sim_poster(b, x, y, x + w, y + h);
    }
}

/* A parcel differs from a carton by its broad edges and crossed bands. */
static void paint_parcel(struct fv_sim_brush *b)
{
    const int32_t w = b->width, h = b->height, grey = fv_sim_draw(b, 130, 200),
                  dark = fv_sim_draw(b, 15, 60), band = w / 9;
    fv_sim_fill(b, 0, 0, w, h, grey);
    const int32_t x[4][3] = {
        {0, band, w}, {band, w, w - band}, {w, w - band, 0}, {w - band, 0, band}};
    const int32_t y[4][3] = {{0, 0, h}, {0, h, h}, {0, 0, h}, {0, h, h}};
    for (int32_t i = 0; i < 4; i++)
        fv_sim_triangle(b, x[i], y[i], dark);
    fv_sim_frame(b, 0, 0, w, h, w / 11, dark);
    fv_sim_fill(b, w * 38 / 100, h * 40 / 100, w * 62 / 100, h * 60 / 100, 240);
    fv_sim_noise(b, 0, 0, w, h, 16, 2, 14, 170);
}

/* Bands and fields in strong contrast, at the proportions of the object: they are what tells the
 * classes apart. */
static void paint_ball(struct fv_sim_brush *b)
{
    const int32_t panels = fv_sim_draw(b, 5, 8), dark = fv_sim_draw(b, 20, 90),
                  bright = fv_sim_draw(b, 170, 245);
    for (int32_t i = 0; i < panels; i++)
        fv_sim_fill(b, b->width * i / panels, 0, b->width * (i + 1) / panels, b->height,
                    (i & 1) ? dark : bright);
    for (int32_t i = 0; i < panels; i++)
        fv_sim_disc(b, b->width * (2 * i + 1) / (2 * panels), b->height / 2,
                    b->width / (4 * panels), (i & 1) ? bright : dark);
    fv_sim_noise(b, 0, 0, b->width, b->height, 16, 2, 14, 170);
}

static void paint_cone(struct fv_sim_brush *b)
{
    fv_sim_fill(b, 0, 0, b->width, b->height, fv_sim_draw(b, 95, 140));
    const int32_t bright = fv_sim_draw(b, 215, 250);
    fv_sim_fill(b, 0, b->height * 22 / 100, b->width, b->height * 40 / 100, bright);
    fv_sim_fill(b, 0, b->height * 55 / 100, b->width, b->height * 75 / 100, bright);
    fv_sim_fill(b, 0, b->height * 95 / 100, b->width, b->height, 40);
    fv_sim_noise(b, 0, 0, b->width, b->height, 16, 2, 12, 170);
}

static void paint_clothes(struct fv_sim_brush *b)
{
    const int32_t grey = fv_sim_draw(b, 30, 200), kind = fv_sim_draw(b, 0, 3),
                  other = fv_sim_clamp(grey + (grey > 120 ? -80 : 80), 0, 255);
    fv_sim_fill(b, 0, 0, b->width, b->height, grey);
    for (int32_t i = 0; kind == 0 && i < 8; i++)
        fv_sim_fill(b, 0, b->height * i / 8, b->width, b->height * i / 8 + b->height / 18, other);
    for (int32_t i = 0; kind == 1 && i < 6; i++)
        fv_sim_fill(b, b->width * i / 6, 0, b->width * i / 6 + b->width / 14, b->height, other);
    if (kind == 2) fv_sim_fill(b, 0, b->height / 2, b->width, b->height, other);
    for (int32_t i = 0; i < 5; i++) {
        const int32_t x = fv_sim_draw(b, 0, b->width), y = fv_sim_draw(b, b->height / 6, b->height),
                      s = b->width / 12 + 1;
        const int32_t w = fv_sim_draw(b, s, 2 * s), h = fv_sim_draw(b, s, 2 * s);
        fv_sim_fill(b, x, y, x + w, y + h, fv_sim_draw(b, 10, 245));
    }
    fv_sim_noise(b, 0, 0, b->width, b->height, 32, 2, 30, 180);
}

static void paint_head(struct fv_sim_brush *b)
{
    fv_sim_fill(b, 0, 0, b->width, b->height, fv_sim_draw(b, 120, 200));
    fv_sim_fill(b, 0, 0, b->width, b->height * 2 / 5, fv_sim_draw(b, 20, 90));
    fv_sim_fill(b, 0, 0, b->width / 2, b->height * 3 / 5, fv_sim_draw(b, 20, 90));
    for (int32_t i = 0; i < 2; i++)
        fv_sim_fill(b, b->width * (60 + 16 * i) / 100, b->height / 2,
                    b->width * (66 + 16 * i) / 100, b->height * 56 / 100, 25);
    fv_sim_noise(b, 0, 0, b->width, b->height, 16, 2, 16, 170);
}

static void paint_wood(struct fv_sim_brush *b)
{
    paint_courses(b, &(struct courses){b->width, b->height / 4 + 1, 2, fv_sim_draw(b, 90, 150), 18,
                                       50, true, false});
    paint_grain(b, 18);
    fv_sim_noise(b, 0, 0, b->width, b->height, 48, 3, 30, 190);
}

static void paint_fabric(struct fv_sim_brush *b)
{
    fv_sim_fill(b, 0, 0, b->width, b->height, fv_sim_draw(b, 60, 170));
    fv_sim_noise(b, 0, 0, b->width, b->height, 64, 2, 46, 200);
    paint_speckle(b, 40, 15, 60);
}

static void paint_metal(struct fv_sim_brush *b)
{
    const int32_t w = b->width, h = b->height;
    fv_sim_fill(b, 0, 0, w, h, fv_sim_draw(b, 70, 150));
    fv_sim_noise(b, 0, 0, w, h, 32, 2, 18, 170);
    fv_sim_frame(b, 3, 3, w - 3, h - 3, 3, 40);
    fv_sim_poster(b, w / 5, h / 6, w * 3 / 5, h / 2);
    paint_speckle(b, 20, 10, 60);
}

/* Walls, floors and ceilings: courses of stones (none: plain), grain, clouds of noise, specks.
 * Lengths in mm.
 */
struct laid {
    int32_t width, height, joint, grey_low, grey_high, spread, joint_grey;
    bool random_shift, half_shift;
    int32_t grain, cell, finest, amplitude, fall, specks_per_m2, speck_low, speck_high;
};

static const struct laid laid_table[] = {
    [FV_SIM_PLASTER] = {0, 0, 0, 135, 180, 0, 0, false, false, 0, 1200, 2, 30, 185, 6, 8, 40},
    [FV_SIM_BRICK] = {240, 80, 14, 90, 130, 32, 175, false, true, 0, 900, 2, 34, 190, 0, 0, 0},
    [FV_SIM_PANEL] = {420, 900, 18, 120, 160, 20, 60, false, false, 0, 500, 2, 28, 195, 0, 0, 0},
    [FV_SIM_BLOCKS] = {500, 250, 16, 130, 165, 18, 95, false, true, 0, 1000, 2, 32, 195, 0, 0, 0},
    [FV_SIM_PARQUET] = {700, 110, 1, 105, 140, 30, 55, true, false, 12, 1500, 4, 32, 180, 2, 15,
                        70},
    [FV_SIM_TILES] = {400, 400, 14, 120, 150, 34, 65, false, false, 0, 800, 2, 30, 195, 3, 15, 60},
    [FV_SIM_CEILING] = {600, 600, 25, 185, 185, 10, 130, false, false, 0, 300, 2, 26, 190, 2, 40,
                        150},
};

static void paint_laid(struct fv_sim_brush *b, const struct laid *l)
{
    const int32_t grey = fv_sim_draw(b, l->grey_low, l->grey_high);
    if (l->width == 0)
        fv_sim_fill(b, 0, 0, b->width, b->height, grey);
    else
        paint_courses(b, &(struct courses){fv_sim_mm(b, l->width), fv_sim_mm(b, l->height),
                                           fv_sim_mm(b, l->joint), grey, l->spread, l->joint_grey,
                                           l->random_shift, l->half_shift});
    if (l->grain > 0) paint_grain(b, l->grain);
    fv_sim_noise(b, 0, 0, b->width, b->height, fv_sim_mm(b, l->cell), l->finest, l->amplitude,
                 l->fall);
    if (l->specks_per_m2 > 0) paint_speckle(b, l->specks_per_m2, l->speck_low, l->speck_high);
}

void fv_sim_paint(struct fv_sim_texture *texture, enum fv_sim_material material,
                  double texels_per_m, uint64_t seed)
{
    struct fv_sim_brush brush, *b = &brush;
    fv_sim_brush_open(b, texture, texels_per_m, seed);
    if (material >= FV_SIM_ROAD_FIRST) {
        fv_sim_paint_road(texture, b, material);
        return;
    }
    switch (material) {
    case FV_SIM_CARPET:
        paint_carpet(b);
        break;
    case FV_SIM_WOOD:
        paint_wood(b);
        break;
    case FV_SIM_FABRIC:
        paint_fabric(b);
        break;
    case FV_SIM_CARTON:
        paint_carton(b, fv_sim_draw(b, 110, 160));
        break;
    case FV_SIM_BOOKS:
        fv_sim_books(b, 0, 0, b->width, b->height);
        break;
    case FV_SIM_METAL:
        paint_metal(b);
        break;
    case FV_SIM_CLUTTER:
        paint_clutter(b);
        break;
    case FV_SIM_BALL:
        paint_ball(b);
        break;
    case FV_SIM_CONE:
        paint_cone(b);
        break;
    case FV_SIM_PARCEL:
        paint_parcel(b);
        break;
    case FV_SIM_CLOTHES:
        paint_clothes(b);
        break;
    case FV_SIM_HEAD:
        paint_head(b);
        break;
    case FV_SIM_CHESSBOARD:
        fv_sim_paint_board(b);
        break;
    default:
        paint_laid(b, &laid_table[material]);
        break;
    }
}
