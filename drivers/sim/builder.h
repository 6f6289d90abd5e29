/* What the places of the simulated camera are built from (places.c): walls, floors and boxes with
 * materials drawn from the seed. */
#ifndef FOVEA_DRIVERS_SIM_BUILDER_H
#define FOVEA_DRIVERS_SIM_BUILDER_H

#include "sim.h"

/* Faces of a box (fv_sim_world_box). */
enum { FV_SIM_SIDES = 15, FV_SIM_ALL = 31, FV_SIM_CLOSED = 63 };

#define FV_SIM_DETAIL_PER_M 150.0 /* texels per metre on furniture */

struct fv_sim_builder {
    struct fv_sim_world *world;
    struct fv_random random;
    uint16_t wood[2], fabric, carton[2], books[2], metal, clutter[2];
    uint16_t floor; /* texture that furniture throws shade on */
    double floor_x, floor_y,
        floor_scale; /* world of the texture's top left corner; texels per metre */
};

void fv_sim_builder_open(struct fv_sim_builder *b, struct fv_sim_world *world, uint64_t salt);
double fv_sim_builder_draw(struct fv_sim_builder *b, double low, double high);
uint32_t fv_sim_builder_pick(struct fv_sim_builder *b, uint32_t count);
/* Wall from a to b (a on the left as one looks at it), standing on z. */
void fv_sim_builder_wall(struct fv_sim_world *world, double ax, double ay, double bx, double by,
                         double z, double height, uint16_t texture, double light);
/* Four walls that look inward (or outward, seen from all round) on the rectangle (cx +- hx, cy +-
 * hy). */
void fv_sim_builder_four_walls(struct fv_sim_builder *b, double cx, double cy, double hx, double hy,
                               double height, double scale, bool inward);
void fv_sim_builder_floor_and_ceiling(struct fv_sim_builder *b, double cx, double cy, double hx,
                                      double hy, double height, double scale);
/* The shade on the floor of what stands on a rectangle. */
void fv_sim_builder_shade(struct fv_sim_builder *b, double x, double y, double sx, double sy);
/* An upright box standing on z; with its shade where that is the floor. */
void fv_sim_builder_box(struct fv_sim_builder *b, double x, double y, double z, double sx,
                        double sy, double sz, double yaw, uint16_t side, uint16_t top,
                        uint32_t faces);

#endif
