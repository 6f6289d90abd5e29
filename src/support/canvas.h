/* Canvas: an RGB picture to draw plots and overlays on, written as PNG. Off the loop thread; the
 * heap is used.
 *
 * Pixel (0, 0) is the centre of the top left pixel, as in images. Colours are 0xRRGGBB. Everything
 * may reach beyond the border and is cut there. Lines, circles and discs are anti-aliased (coverage
 * from the distance to the shape). */
#ifndef FOVEA_SUPPORT_CANVAS_H
#define FOVEA_SUPPORT_CANVAS_H

#include <stdint.h>

#include "fovea/image.h"
#include "fovea/status.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fv_canvas {
    int width, height;
    uint8_t *rgb; /* height rows of width x 3 bytes */
};

/* FOVEA_ERROR_ARGUMENT for sizes outside [1, 16384], FOVEA_ERROR_SYSTEM without memory. */
enum fovea_status fv_canvas_create(struct fv_canvas *canvas, int width, int height,
                                   uint32_t colour);
void fv_canvas_free(struct fv_canvas *canvas);

/* Copy a grey8 or rgb24 image with its top left pixel at (left, top). */
void fv_canvas_image(struct fv_canvas *canvas, int left, int top, const struct fovea_image *image);

/* Fill the pixels [left, left + width) x [top, top + height). */
void fv_canvas_fill(struct fv_canvas *canvas, int left, int top, int width, int height,
                    uint32_t colour);
/* Straight line with round ends, `thickness` pixels wide. */
void fv_canvas_line(struct fv_canvas *canvas, float x0, float y0, float x1, float y1,
                    float thickness, uint32_t colour);
/* Ring of the given radius, drawn `thickness` wide. */
void fv_canvas_circle(struct fv_canvas *canvas, float x, float y, float radius, float thickness,
                      uint32_t colour);
void fv_canvas_disc(struct fv_canvas *canvas, float x, float y, float radius, uint32_t colour);
/* Outline of a rectangle, max exclusive. */
void fv_canvas_box(struct fv_canvas *canvas, float x_min, float y_min, float x_max, float y_max,
                   float thickness, uint32_t colour);

/* Text, UTF-8, with the pen at (left, base) on the base line, `size` pixels per em: in a font of
 * the system (lettering.h), else in a bitmap font of 6 x 9 pixels times size / 9, in which only
 * printable ASCII shows. Returns the x where the text ends. */
int fv_canvas_letters(struct fv_canvas *canvas, int left, int base, int size, uint32_t colour,
                      const char *text);
int fv_canvas_letters_width(int size, const char *text);
/* The same below (left, top), in lines of 9 pixels times `scale`. */
int fv_canvas_text(struct fv_canvas *canvas, int left, int top, int scale, uint32_t colour,
                   const char *text);
int fv_canvas_text_width(int scale, const char *text);
enum { FV_CANVAS_TEXT_HEIGHT = 9 };

/* Write as PNG. FOVEA_ERROR_SYSTEM: `error` names the file and the reason. */
enum fovea_status fv_canvas_write(const struct fv_canvas *canvas, const char *path,
                                  struct fovea_error *error);

#ifdef __cplusplus
}
#endif
#endif
