#include "paint.h"

/* The materials of the road. Integers and seeded draws only, as in paint.c. */

/* ---- ground ---------------------------------------------------------------------------------- */

/* Rows run from the left edge of the road to the right one; the pattern of the dashes repeats every
 * 12 m. Worn paint is uneven. */
static void paint_marks(struct fv_sim_brush *b)
{
    const int32_t thick = fv_sim_mm(b, 120), edge = fv_sim_mm(b, 350), dash = fv_sim_mm(b, 4000),
                  period = fv_sim_mm(b, 12000), begin = fv_sim_mm(b, 3000);
    fv_sim_fill(b, 0, edge, b->width, edge + thick, 190);
    fv_sim_fill(b, 0, b->height - edge - thick, b->width, b->height - edge, 190);
    for (int32_t x = begin; x < b->width; x += period)
        fv_sim_fill(b, x, (b->height - thick) / 2, x + dash, (b->height + thick) / 2, 200);
}

/* Of low texture: grain, and clouds of some metres; here and there a patch or a crack. */
static void paint_asphalt(struct fv_sim_texture *texture, struct fv_sim_brush *b, bool shaded)
{
    fv_sim_fill(b, 0, 0, b->width, b->height, fv_sim_draw(b, 92, 112));
    for (int32_t i = 0; i < 6; i++) {
        const int32_t x = fv_sim_draw(b, 0, b->width), y = fv_sim_draw(b, 0, b->height),
                      w = fv_sim_mm(b, fv_sim_draw(b, 800, 5000)),
                      h = fv_sim_mm(b, fv_sim_draw(b, 500, 1800));
        fv_sim_fill(b, x, y, x + w, y + h, fv_sim_draw(b, 86, 112));
    }
    paint_marks(b);
    for (int32_t i = 0; i < 14; i++) { /* cracks wander along the road */
        int32_t x = fv_sim_draw(b, 0, b->width), y = fv_sim_draw(b, 0, b->height);
        const int32_t steps = fv_sim_draw(b, 20, 120);
        for (int32_t k = 0; k < steps; k++) {
            const int32_t run = fv_sim_draw(b, 1, 4);
            fv_sim_fill(b, x, y, x + run, y + 1, 72);
            x += run;
            y += fv_sim_draw(b, -1, 1);
        }
    }
    fv_sim_noise(b, 0, 0, b->width, b->height, fv_sim_mm(b, 6400), 64, 12, 200);
    fv_sim_noise(b, 0, 0, b->width, b->height, 4, 1, 9, 200);
    if (!shaded) return;
    /* The shade of trees, by many soft pieces. */
    for (int32_t i = 0; i < 260; i++) {
        const int32_t grove = fv_sim_mm(b, 10000), at = fv_sim_draw(b, 0, b->width / grove) * grove;
        const int32_t x = at + fv_sim_draw(b, 0, grove * 6 / 10), y = fv_sim_draw(b, 0, b->height);
        const int32_t w = fv_sim_mm(b, fv_sim_draw(b, 150, 1200)),
                      h = fv_sim_mm(b, fv_sim_draw(b, 100, 700)), soft = fv_sim_mm(b, 100);
        fv_sim_paint_shade(texture, x, y, x + w, y + h, soft, 84);
    }
}

static void paint_grass(struct fv_sim_brush *b)
{
    fv_sim_fill(b, 0, 0, b->width, b->height, fv_sim_draw(b, 62, 84));
    fv_sim_noise(b, 0, 0, b->width, b->height, fv_sim_mm(b, 3000), 8, 16, 190);
    fv_sim_noise(b, 0, 0, b->width, b->height, 6, 1, 26, 190);
}

/* Slabs between two kerbs. */
static void paint_pavement(struct fv_sim_brush *b)
{
    const int32_t slab = fv_sim_mm(b, 500), kerb = fv_sim_mm(b, 150);
    for (int32_t y = 0; y < b->height; y += slab)
        for (int32_t x = 0; x < b->width; x += slab) {
            const int32_t grey = fv_sim_draw(b, 112, 126);
            fv_sim_fill(b, x, y, x + slab, y + slab, grey);
            fv_sim_fill(b, x, y, x + 1, y + slab, 98);
            fv_sim_fill(b, x, y, x + slab, y + 1, 98);
        }
    fv_sim_fill(b, 0, 0, b->width, kerb, 158);
    fv_sim_fill(b, 0, kerb, b->width, kerb + 1, 70);
    fv_sim_fill(b, 0, b->height - kerb, b->width, b->height, 158);
    fv_sim_fill(b, 0, b->height - kerb - 1, b->width, b->height - kerb, 70);
    fv_sim_noise(b, 0, 0, b->width, b->height, fv_sim_mm(b, 2000), 2, 14, 190);
}

/* ---- what stands ----------------------------------------------------------------------------- */

static void paint_window(struct fv_sim_brush *b, int32_t x, int32_t y, int32_t w, int32_t h)
{
    const int32_t frame = fv_sim_mm(b, 70), glass = fv_sim_draw(b, 22, 70);
    const bool curtain = fv_sim_draw(b, 0, 2) == 0, shutter = fv_sim_draw(b, 0, 3) == 0;
    fv_sim_fill(b, x - frame, y - frame, x + w + frame, y + h + frame, fv_sim_draw(b, 130, 240));
    fv_sim_fill(b, x, y, x + w, y + h, glass);
    if (curtain) fv_sim_fill(b, x, y, x + w, y + h * fv_sim_draw(b, 20, 80) / 100, 150);
    fv_sim_fill(b, x + w / 2 - frame / 3, y, x + w / 2 + frame / 3 + 1, y + h, 190);
    fv_sim_fill(b, x - 2 * frame, y + h + frame, x + w + 2 * frame, y + h + 2 * frame, 90);
    if (shutter) fv_sim_fill(b, x, y, x + w, y + h / 3, 110);
}

/* Floors of equal windows, a socle, a cornice and a door. */
static void paint_facade(struct fv_sim_brush *b)
{
    const int32_t grey = fv_sim_draw(b, 120, 222), floors = fv_sim_draw(b, 2, 4),
                  columns = fv_sim_draw(b, 3, 6);
    fv_sim_fill(b, 0, 0, b->width, b->height, grey);
    const int32_t floor = b->height * 9 / 10 / floors, column = b->width / columns,
                  wide = column * fv_sim_draw(b, 38, 60) / 100,
                  high = floor * fv_sim_draw(b, 42, 60) / 100;
    for (int32_t f = 0; f < floors; f++)
        for (int32_t c = 0; c < columns; c++)
            paint_window(b, c * column + (column - wide) / 2, f * floor + floor / 4, wide, high);
    const int32_t door = fv_sim_draw(b, 0, columns - 1) * column + column / 4;
    fv_sim_fill(b, door, b->height - fv_sim_mm(b, 3200), door + fv_sim_mm(b, 1200), b->height,
                fv_sim_draw(b, 30, 110));
    fv_sim_fill(b, 0, b->height - fv_sim_mm(b, 1900), b->width, b->height - fv_sim_mm(b, 1850),
                grey - 40);
    fv_sim_fill(b, 0, 0, b->width, fv_sim_mm(b, 200), grey - 55);
    fv_sim_noise(b, 0, 0, b->width, b->height, fv_sim_mm(b, 3000), 4, 12, 180);
    fv_sim_noise(b, 0, 0, b->width, b->height, 4, 1, 5, 180);
}

static void paint_roof(struct fv_sim_brush *b)
{
    const int32_t row = fv_sim_mm(b, 350);
    for (int32_t y = 0; y < b->height; y += row) {
        fv_sim_fill(b, 0, y, b->width, y + row, fv_sim_draw(b, 66, 84));
        fv_sim_fill(b, 0, y, b->width, y + 2, 48);
    }
    fv_sim_noise(b, 0, 0, b->width, b->height, 32, 1, 16, 190);
}

/* Leaves in clumps: dark, with light on some and holes between. */
static void paint_foliage(struct fv_sim_brush *b)
{
    fv_sim_fill(b, 0, 0, b->width, b->height, fv_sim_draw(b, 44, 58));
    fv_sim_noise(b, 0, 0, b->width, b->height, fv_sim_mm(b, 1600), 2, 34, 200);
    const int32_t count = b->width * b->height / 40;
    for (int32_t i = 0; i < count; i++) {
        const int32_t x = fv_sim_draw(b, 0, b->width), y = fv_sim_draw(b, 0, b->height),
                      w = fv_sim_draw(b, 1, 4), h = fv_sim_draw(b, 1, 4),
                      grey = fv_sim_draw(b, 0, 3) == 0 ? fv_sim_draw(b, 70, 120)
                                                       : fv_sim_draw(b, 14, 48);
        fv_sim_fill(b, x, y, x + w, y + h, grey);
    }
    fv_sim_noise(b, 0, 0, b->width, b->height, fv_sim_mm(b, 800), 8, 22, 200);
}

static void paint_bark(struct fv_sim_brush *b)
{
    fv_sim_fill(b, 0, 0, b->width, b->height, 58);
    for (int32_t x = 0; x < b->width; x += 3) {
        const int32_t wide = fv_sim_draw(b, 1, 2), grey = fv_sim_draw(b, 36, 84);
        fv_sim_fill(b, x, 0, x + wide, b->height, grey);
    }
    fv_sim_noise(b, 0, 0, b->width, b->height, 16, 1, 20, 190);
}

/* Pickets: the same every 0.2 m, posts every 2 m. */
static void paint_fence(struct fv_sim_brush *b)
{
    const int32_t picket = fv_sim_mm(b, 200), wide = fv_sim_mm(b, 110), post = fv_sim_mm(b, 2000),
                  grey = fv_sim_draw(b, 110, 190);
    fv_sim_fill(b, 0, 0, b->width, b->height, 38);
    for (int32_t x = 0; x < b->width; x += picket)
        fv_sim_fill(b, x, b->height / 12, x + wide, b->height * 9 / 10, grey);
    for (int32_t x = 0; x < b->width; x += post)
        fv_sim_fill(b, x, 0, x + wide, b->height, grey - 30);
    fv_sim_fill(b, 0, b->height / 4, b->width, b->height / 3, grey - 12);
    fv_sim_fill(b, 0, b->height * 3 / 4, b->width, b->height * 5 / 6, grey - 12);
}

/* A guard rail: a beam on posts every 2 m, grass behind it. */
static void paint_rail(struct fv_sim_brush *b)
{
    const int32_t post = fv_sim_mm(b, 2000), h = b->height;
    fv_sim_fill(b, 0, 0, b->width, h, 46);
    fv_sim_noise(b, 0, 0, b->width, h, 8, 1, 22, 190);
    for (int32_t x = 0; x < b->width; x += post)
        fv_sim_fill(b, x, 0, x + fv_sim_mm(b, 130), h, 78);
    fv_sim_fill(b, 0, h * 4 / 100, b->width, h * 12 / 100, 150);
    fv_sim_fill(b, 0, h * 12 / 100, b->width, h * 20 / 100, 88);
    fv_sim_fill(b, 0, h * 20 / 100, b->width, h * 30 / 100, 128);
    fv_sim_fill(b, 0, h * 30 / 100, b->width, h * 34 / 100, 30);
}

/* ---- cars ------------------------------------------------------------------------------------ */

/* The front or back, alike, at columns from `x0` on. */
static void paint_car_end(struct fv_sim_brush *b, int32_t x0, int32_t grey)
{
    const int32_t w = b->width - x0, h = b->height, low = h - fv_sim_mm(b, 720), part = h - low;
    const int32_t lamp[2] = {x0 + w * 3 / 100, x0 + w * 80 / 100};
    fv_sim_fill(b, x0, 0, b->width, h, grey);
    if (h > fv_sim_mm(b, 1400)) fv_sim_fill(b, x0 + w / 10, h / 10, x0 + w * 9 / 10, low - 4, 35);
    fv_sim_fill(b, x0, low + part * 70 / 100, b->width, h, 30);
    for (int32_t i = 0; i < 2; i++)
        fv_sim_fill(b, lamp[i], low + part / 8, lamp[i] + w * 17 / 100, low + part / 2, 205);
    fv_sim_fill(b, x0 + w * 36 / 100, low + part / 2, x0 + w * 64 / 100, low + part * 66 / 100,
                235);
    for (int32_t i = 0; i < 7; i++) /* the plate's letters */
        fv_sim_fill(b, x0 + w * (38 + 4 * i) / 100, low + part * 53 / 100,
                    x0 + w * (40 + 4 * i) / 100, low + part * 63 / 100, fv_sim_draw(b, 20, 120));
}

/* Three quarters of the columns show the side of a car or van, the others its end. */
static void paint_car(struct fv_sim_brush *b)
{
    static const int32_t paints[] = {18, 30, 60, 90, 130, 185, 215, 225};
    const int32_t grey = paints[fv_sim_draw(b, 0, 7)], w = b->width * 3 / 4, h = b->height,
                  line = grey > 100 ? grey - 50 : grey + 25, wheel = fv_sim_mm(b, 310);
    fv_sim_fill(b, 0, 0, w, h, grey);
    if (h > fv_sim_mm(b, 1400)) /* of a van: windows above */
        fv_sim_fill(b, w / 12, h / 8, w * 11 / 12, h * 42 / 100, fv_sim_draw(b, 20, 45));
    for (int32_t i = 1; i < 4; i++)
        fv_sim_fill(b, w * i / 4, h / 20, w * i / 4 + 2, h * 85 / 100, line);
    fv_sim_fill(b, 0, h * 45 / 100, w, h * 45 / 100 + 2, line);
    fv_sim_fill(b, 0, h * 88 / 100, w, h, 24);
    for (int32_t i = 0; i < 2; i++) {
        const int32_t x = i == 0 ? w * 19 / 100 : w * 81 / 100, y = h - wheel * 8 / 10;
        fv_sim_disc(b, x, y, wheel * 118 / 100, 16);
        fv_sim_disc(b, x, y, wheel * 60 / 100, 120);
        fv_sim_disc(b, x, y, wheel * 25 / 100, 60);
    }
    paint_car_end(b, w, grey);
    fv_sim_noise(b, 0, 0, b->width, h, fv_sim_mm(b, 1200), 8, 12, 190);
}

static void paint_truck(struct fv_sim_brush *b)
{
    const int32_t grey = fv_sim_draw(b, 90, 215), w = b->width * 3 / 4, h = b->height;
    fv_sim_fill(b, 0, 0, w, h, grey);
    fv_sim_poster(b, w / 12, h / 10, w * 6 / 10, h * 7 / 10);
    fv_sim_poster(b, w * 65 / 100, h / 6, w * 95 / 100, h * 6 / 10);
    fv_sim_fill(b, 0, h * 80 / 100, w, h, 30);
    for (int32_t i = 0; i < 3; i++)
        fv_sim_disc(b, w * (12 + 34 * i) / 100, h * 89 / 100, fv_sim_mm(b, 400), 18);
    paint_car_end(b, w, grey);
    fv_sim_noise(b, 0, 0, b->width, h, 96, 8, 12, 190);
}

/* Dark glass with the sky in it, and posts. */
static void paint_glass(struct fv_sim_brush *b)
{
    fv_sim_fill(b, 0, 0, b->width, b->height, 30);
    const int32_t x = fv_sim_draw(b, 0, b->width / 2);
    fv_sim_fill(b, x, 0, x + b->width / 5, b->height / 2, 105);
    fv_sim_noise(b, 0, 0, b->width, b->height, 64, 8, 20, 190);
    fv_sim_frame(b, 0, 0, b->width, b->height, b->height / 12, 70);
    fv_sim_fill(b, b->width / 2, 0, b->width / 2 + b->height / 12, b->height, 60);
}

/* ---- sky ------------------------------------------------------------------------------------- */

/* Row of the horizon, of 0.8 texels per metre over a foot at -20 m. */
static int32_t horizon(const struct fv_sim_brush *b)
{
    return b->height - 18;
}

/* Bright, brighter about the sun (of the azimuth that the light has); clouds of low contrast. */
static void paint_air(struct fv_sim_brush *b)
{
    /* The texture runs clockwise from +x; the sun stands at atan2(-0.6, 0.8) of the world. */
    const int32_t sun_x = b->width * 1024 / 10000, sun_y = horizon(b) - fv_sim_draw(b, 90, 330);
    for (int32_t y = 0; y < b->height; y++) {
        const int32_t base = 205 + 30 * y / b->height;
        for (int32_t x = 0; x < b->width; x++) {
            int32_t dx = x > sun_x ? x - sun_x : sun_x - x;
            if (dx > b->width / 2) dx = b->width - dx;
            const int32_t off = dx * dx + (y - sun_y) * (y - sun_y);
            const int32_t glow = 6000000 / (off + 60000);
            b->texels[(size_t)y * (size_t)b->stride + (size_t)x] =
                (uint8_t)fv_sim_clamp(base + glow, 0, 255);
        }
    }
    fv_sim_noise(b, 0, 0, b->width, horizon(b) - 40, 256, 32, 20, 170);
}

/* Hills and woods against the sky: heights wander; `rough` is how. */
static void paint_ridge(struct fv_sim_brush *b, int32_t low, int32_t high, int32_t rough,
                        int32_t grey)
{
    int32_t height = fv_sim_draw(b, low, high) * 16, drift = 0;
    for (int32_t x = 0; x < b->width; x++) {
        drift = fv_sim_clamp(drift + fv_sim_draw(b, -rough, rough), -3 * rough, 3 * rough);
        height = fv_sim_clamp(height + drift, low * 16, high * 16);
        if (height == low * 16 || height == high * 16) drift = -drift / 2;
        const int32_t top = horizon(b) - height / 16;
        for (int32_t y = fv_sim_clamp(top, 0, b->height); y < b->height; y++) {
            const int32_t leaf = fv_sim_draw(b, -14, 14);
            b->texels[(size_t)y * (size_t)b->stride + (size_t)x] = (uint8_t)(grey + leaf);
        }
    }
}

static void paint_sky(struct fv_sim_brush *b)
{
    paint_air(b);
    paint_ridge(b, 6, 34, 1, 132);
    paint_ridge(b, 4, 22, 9, 60);
}

void fv_sim_paint_road(struct fv_sim_texture *texture, struct fv_sim_brush *brush,
                       enum fv_sim_material material)
{
    switch (material) {
    case FV_SIM_ROAD_ASPHALT:
    case FV_SIM_ROAD_SHADED:
        paint_asphalt(texture, brush, material == FV_SIM_ROAD_SHADED);
        break;
    case FV_SIM_ROAD_GRASS:
        paint_grass(brush);
        break;
    case FV_SIM_ROAD_PAVEMENT:
        paint_pavement(brush);
        break;
    case FV_SIM_ROAD_FACADE:
        paint_facade(brush);
        break;
    case FV_SIM_ROAD_ROOF:
        paint_roof(brush);
        break;
    case FV_SIM_ROAD_FOLIAGE:
        paint_foliage(brush);
        break;
    case FV_SIM_ROAD_BARK:
        paint_bark(brush);
        break;
    case FV_SIM_ROAD_FENCE:
        paint_fence(brush);
        break;
    case FV_SIM_ROAD_RAIL:
        paint_rail(brush);
        break;
    case FV_SIM_ROAD_CAR:
        paint_car(brush);
        break;
    case FV_SIM_ROAD_TRUCK:
        paint_truck(brush);
        break;
    case FV_SIM_ROAD_GLASS:
        paint_glass(brush);
        break;
    default:
        paint_sky(brush);
        break;
    }
}
