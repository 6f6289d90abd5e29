#include "support/canvas.h"

#include <stdlib.h>
#include <string.h>

#include "support/font.h"
#include "support/lettering.h"
#include "support/picture.h"
#include "support/utf8.h"

enum { SIDE_MAX = 16384 };

enum fovea_status fv_canvas_create(struct fv_canvas *canvas, int width, int height, uint32_t colour)
{
    if (width < 1 || height < 1 || width > SIDE_MAX || height > SIDE_MAX)
        return FOVEA_ERROR_ARGUMENT;
    uint8_t *rgb = malloc((size_t)width * (size_t)height * 3);
    if (rgb == NULL) return FOVEA_ERROR_SYSTEM;
    *canvas = (struct fv_canvas){width, height, rgb};
    fv_canvas_fill(canvas, 0, 0, width, height, colour);
    return FOVEA_OK;
}

void fv_canvas_free(struct fv_canvas *canvas)
{
    free(canvas->rgb);
    *canvas = (struct fv_canvas){0};
}

static uint8_t *pixel_at(struct fv_canvas *canvas, int x, int y)
{
    return canvas->rgb + ((size_t)y * (size_t)canvas->width + (size_t)x) * 3;
}

static int clamp(int value, int low, int high)
{
    return value < low ? low : value > high ? high : value;
}

/* Coordinates far outside would overflow an int: they are brought to just beyond the canvas first.
 */
static int round_down(float value)
{
    if (!(value > -100000.0F)) return -100000;
    if (value > 100000.0F) return 100000;
    int whole = (int)value;
    return (float)whole > value ? whole - 1 : whole;
}

void fv_canvas_image(struct fv_canvas *canvas, int left, int top, const struct fovea_image *image)
{
    int step = image->format == FOVEA_PIXEL_RGB24 ? 3 : 1;
    if (image->format != FOVEA_PIXEL_GREY8 && image->format != FOVEA_PIXEL_RGB24) return;
    for (int y = 0; y < image->height; y++) {
        if (top + y < 0 || top + y >= canvas->height) continue;
        const uint8_t *row = image->data + (ptrdiff_t)y * image->stride_bytes;
        for (int x = 0; x < image->width; x++) {
            if (left + x < 0 || left + x >= canvas->width) continue;
            uint8_t *to = pixel_at(canvas, left + x, top + y);
            for (int c = 0; c < 3; c++)
                to[c] = row[x * step + (step == 3 ? c : 0)];
        }
    }
}

/* Mix `colour` into one pixel; opacity in [0, 1]. */
static void blend(struct fv_canvas *canvas, int x, int y, uint32_t colour, float opacity)
{
    if (x < 0 || y < 0 || x >= canvas->width || y >= canvas->height || !(opacity > 0.0F)) return;
    if (opacity > 1.0F) opacity = 1.0F;
    uint8_t *to = pixel_at(canvas, x, y);
    for (int c = 0; c < 3; c++) {
        float goal = (float)((colour >> (16 - 8 * c)) & 0xff);
        to[c] = (uint8_t)((float)to[c] + (goal - (float)to[c]) * opacity + 0.5F);
    }
}

void fv_canvas_fill(struct fv_canvas *canvas, int left, int top, int width, int height,
                    uint32_t colour)
{
    int right = clamp(left + width, 0, canvas->width),
        bottom = clamp(top + height, 0, canvas->height);
    for (int y = clamp(top, 0, canvas->height); y < bottom; y++)
        for (int x = clamp(left, 0, canvas->width); x < right; x++) {
            uint8_t *to = pixel_at(canvas, x, y);
            for (int c = 0; c < 3; c++)
                to[c] = (uint8_t)(colour >> (16 - 8 * c));
        }
}

void fv_canvas_line(struct fv_canvas *canvas, float x0, float y0, float x1, float y1,
                    float thickness, uint32_t colour)
{
    float dx = x1 - x0, dy = y1 - y0, length2 = dx * dx + dy * dy, half = thickness * 0.5F;
    int left = clamp(round_down((x0 < x1 ? x0 : x1) - half) - 1, 0, canvas->width);
    int right = clamp(round_down((x0 < x1 ? x1 : x0) + half) + 2, -1, canvas->width - 1);
    int top = clamp(round_down((y0 < y1 ? y0 : y1) - half) - 1, 0, canvas->height);
    int bottom = clamp(round_down((y0 < y1 ? y1 : y0) + half) + 2, -1, canvas->height - 1);
    for (int y = top; y <= bottom; y++)
        for (int x = left; x <= right; x++) {
            float px = (float)x - x0, py = (float)y - y0;
            float along = length2 > 0.0F ? (px * dx + py * dy) / length2 : 0.0F;
            along = along < 0.0F ? 0.0F : along > 1.0F ? 1.0F : along;
            float ex = px - along * dx, ey = py - along * dy;
            blend(canvas, x, y, colour, half + 0.5F - __builtin_sqrtf(ex * ex + ey * ey));
        }
}

static void round_shape(struct fv_canvas *canvas, const float centre[2], float inner, float outer,
                        uint32_t colour)
{
    int left = clamp(round_down(centre[0] - outer) - 1, 0, canvas->width);
    int right = clamp(round_down(centre[0] + outer) + 2, -1, canvas->width - 1);
    int top = clamp(round_down(centre[1] - outer) - 1, 0, canvas->height);
    int bottom = clamp(round_down(centre[1] + outer) + 2, -1, canvas->height - 1);
    for (int y = top; y <= bottom; y++)
        for (int x = left; x <= right; x++) {
            float dx = (float)x - centre[0], dy = (float)y - centre[1];
            float distance = __builtin_sqrtf(dx * dx + dy * dy);
            float cover = outer + 0.5F - distance, hole = distance - inner + 0.5F;
            blend(canvas, x, y, colour, cover < hole ? cover : hole);
        }
}

void fv_canvas_circle(struct fv_canvas *canvas, float x, float y, float radius, float thickness,
                      uint32_t colour)
{
    float half = thickness * 0.5F;
    round_shape(canvas, (const float[2]){x, y}, radius - half, radius + half, colour);
}

void fv_canvas_disc(struct fv_canvas *canvas, float x, float y, float radius, uint32_t colour)
{
    round_shape(canvas, (const float[2]){x, y}, -1.0F, radius, colour);
}

void fv_canvas_box(struct fv_canvas *canvas, float x_min, float y_min, float x_max, float y_max,
                   float thickness, uint32_t colour)
{
    float right = x_max - 1.0F, bottom = y_max - 1.0F;
    fv_canvas_line(canvas, x_min, y_min, right, y_min, thickness, colour);
    fv_canvas_line(canvas, right, y_min, right, bottom, thickness, colour);
    fv_canvas_line(canvas, right, bottom, x_min, bottom, thickness, colour);
    fv_canvas_line(canvas, x_min, bottom, x_min, y_min, thickness, colour);
}

/* ---- text ------------------------------------------------------------------------------------ */

static const struct fv_lettering *letters; /* NULL: the bitmap font */

void fv_canvas_use_lettering(const struct fv_lettering *lettering)
{
    letters = lettering;
}

static int bitmap_scale(int size)
{
    return size >= 18 ? size / 9 : 1;
}

static int bitmap_letter(struct fv_canvas *canvas, int left, int base, int scale, uint32_t colour,
                         uint32_t code)
{
    const uint8_t *glyph = fv_font_glyph(code < 127 ? (char)code : '?');
    const int top = base - (FV_FONT_ROWS - 1) * scale;
    for (int y = 0; canvas != NULL && y < FV_FONT_ROWS; y++)
        for (int x = 0; x < FV_FONT_COLUMNS; x++)
            if ((glyph[y] >> (FV_FONT_COLUMNS - 1 - x)) & 1)
                fv_canvas_fill(canvas, left + x * scale, top + y * scale, scale, scale, colour);
    return FV_FONT_ADVANCE * scale;
}

/* Draw one letter, or measure it where `canvas` is NULL; returns how far the pen moves. */
static int letter_draw(struct fv_canvas *canvas, int left, int base, int size, uint32_t colour,
                       uint32_t code)
{
    struct fv_letter letter;
    if (letters == NULL || !letters->letter(size, code, &letter))
        return bitmap_letter(canvas, left, base, bitmap_scale(size), colour, code);
    for (int y = 0; canvas != NULL && y < letter.height; y++)
        for (int x = 0; x < letter.width; x++)
            blend(canvas, left + letter.left + x, base - letter.top + y, colour,
                  (float)letter.coverage[y * letter.stride + x] / 255.0F);
    return letter.advance;
}

static int text_draw(struct fv_canvas *canvas, int left, int base, int size, uint32_t colour,
                     const char *text)
{
    while (*text != '\0') {
        uint32_t code;
        const int bytes = fv_utf8_decode(text, &code);
        left += letter_draw(canvas, left, base, size, colour, bytes > 0 ? code : '?');
        text += bytes > 0 ? bytes : 1;
    }
    return left;
}

int fv_canvas_letters(struct fv_canvas *canvas, int left, int base, int size, uint32_t colour,
                      const char *text)
{
    return text_draw(canvas, left, base, size, colour, text);
}

int fv_canvas_letters_width(int size, const char *text)
{
    return text_draw(NULL, 0, 0, size, 0, text);
}

static int size_of(int scale)
{
    return letters == NULL ? 9 * scale : scale == 1 ? 12 : 10 * scale + 1;
}

int fv_canvas_text(struct fv_canvas *canvas, int left, int top, int scale, uint32_t colour,
                   const char *text)
{
    const int base = top + (letters == NULL ? FV_FONT_ROWS - 1 : FV_FONT_ROWS + 1) * scale;
    return text_draw(canvas, left, base, size_of(scale), colour, text);
}

int fv_canvas_text_width(int scale, const char *text)
{
    return text_draw(NULL, 0, 0, size_of(scale), 0, text);
}

enum fovea_status fv_canvas_write(const struct fv_canvas *canvas, const char *path,
                                  struct fovea_error *error)
{
    const int32_t stride = 3 * canvas->width;
    const struct fovea_image image = {canvas->rgb,       canvas->width,
                                      canvas->height,    stride,
                                      FOVEA_PIXEL_RGB24, (size_t)stride * (size_t)canvas->height};
    return fv_picture_write_drawn(path, &image, error);
}
