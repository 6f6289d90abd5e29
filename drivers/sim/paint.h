/* Painting on the base level of a texture: integer arithmetic and seeded draws only. Coordinates
 * are texels, x to the right, y down; everything is cut to the canvas. Internal to the painters
 * (paint.c, noise.c, posters.c). At most one draw in an expression or argument list: C leaves their
 * order open, and compilers differ. */
#ifndef FOVEA_DRIVERS_SIM_PAINT_H
#define FOVEA_DRIVERS_SIM_PAINT_H

#include "sim.h"

struct fv_sim_brush {
    uint8_t *texels;
    int32_t width, height, stride;
    int32_t scale; /* texels per metre */
    struct fv_random random;
};

void fv_sim_brush_open(struct fv_sim_brush *brush, struct fv_sim_texture *texture,
                       double texels_per_m, uint64_t seed);
/* Uniform in [low, high]. */
int32_t fv_sim_draw(struct fv_sim_brush *brush, int32_t low, int32_t high);
/* Texels of a length in millimetres, at least 1. */
int32_t fv_sim_mm(const struct fv_sim_brush *brush, int32_t millimetres);
void fv_sim_fill(struct fv_sim_brush *brush, int32_t x0, int32_t y0, int32_t x1, int32_t y1,
                 int32_t grey);
void fv_sim_frame(struct fv_sim_brush *brush, int32_t x0, int32_t y0, int32_t x1, int32_t y1,
                  int32_t thick, int32_t grey);
void fv_sim_disc(struct fv_sim_brush *brush, int32_t cx, int32_t cy, int32_t radius, int32_t grey);
/* Filled triangle. */
void fv_sim_triangle(struct fv_sim_brush *brush, const int32_t x[3], const int32_t y[3],
                     int32_t grey);
/* Add multi-octave value noise, cells from `cell` texels down to `finest`, each octave `fall`/256
 * of the one before. */
void fv_sim_noise(struct fv_sim_brush *brush, int32_t x0, int32_t y0, int32_t x1, int32_t y1,
                  int32_t cell, int32_t finest, int32_t amplitude, int32_t fall);
/* The materials of the road (road_paint.c). */
void fv_sim_paint_road(struct fv_sim_texture *texture, struct fv_sim_brush *brush,
                       enum fv_sim_material material);
/* Posters, signs and the like (posters.c). */
void fv_sim_poster(struct fv_sim_brush *brush, int32_t x0, int32_t y0, int32_t x1, int32_t y1);
void fv_sim_books(struct fv_sim_brush *brush, int32_t x0, int32_t y0, int32_t x1, int32_t y1);

#endif
