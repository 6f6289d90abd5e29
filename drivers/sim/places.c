#include "builder.h"

#include <stddef.h>

/* The places: a furnished room, a corridor that runs in a ring, a hall, and a house of room and
 * corridor. The camera's ways (motion.c) and the objects' (objects.c) keep clear of what is built
 * here: along the walls furniture is at most 0.65 m deep; what stands freely in the hall's middle
 * is lower than 0.95 m. */

double fv_sim_builder_draw(struct fv_sim_builder *b, double low, double high)
{
    return low + (high - low) * fv_random_unit(&b->random);
}

uint32_t fv_sim_builder_pick(struct fv_sim_builder *b, uint32_t count)
{
    return fv_random_below(&b->random, count);
}

void fv_sim_builder_open(struct fv_sim_builder *b, struct fv_sim_world *world, uint64_t salt)
{
    *b = (struct fv_sim_builder){.world = world};
    fv_random_seed(&b->random, world->seed ^ salt);
    for (int32_t i = 0; i < 2; i++) {
        b->wood[i] = fv_sim_world_texture(world, FV_SIM_WOOD, 1.4, 1.4, FV_SIM_DETAIL_PER_M, false);
        b->carton[i] =
            fv_sim_world_texture(world, FV_SIM_CARTON, 0.9, 0.9, FV_SIM_DETAIL_PER_M, false);
        b->books[i] =
            fv_sim_world_texture(world, FV_SIM_BOOKS, 2.4, 2.6, FV_SIM_DETAIL_PER_M, false);
        b->clutter[i] =
            fv_sim_world_texture(world, FV_SIM_CLUTTER, 2.0, 2.0, FV_SIM_DETAIL_PER_M, false);
    }
    b->fabric = fv_sim_world_texture(world, FV_SIM_FABRIC, 1.4, 1.0, FV_SIM_DETAIL_PER_M, false);
    b->metal = fv_sim_world_texture(world, FV_SIM_METAL, 0.9, 1.2, FV_SIM_DETAIL_PER_M, false);
}

static void face_of(struct fv_sim_face *face, enum fovea_truth_class truth_class)
{
    if (face != NULL) face->truth_class = (uint8_t)truth_class;
}

/* Wall from a to b (a on the left as one looks at it), standing on z. */
void fv_sim_builder_wall(struct fv_sim_world *world, double ax, double ay, double bx, double by,
                         double z, double height, uint16_t texture, double light)
{
    const double origin[3] = {ax, ay, z}, u[3] = {bx - ax, by - ay, 0.0}, v[3] = {0.0, 0.0, height};
    face_of(fv_sim_world_face(world, origin, u, v, texture, light), FOVEA_TRUTH_WALL);
}

static enum fv_sim_material wall_material(struct fv_sim_builder *b)
{
    static const enum fv_sim_material choice[] = {FV_SIM_PLASTER, FV_SIM_BRICK, FV_SIM_PANEL,
                                                  FV_SIM_BLOCKS, FV_SIM_PLASTER};
    return choice[fv_sim_builder_pick(b, 5)];
}

static enum fv_sim_material floor_material(struct fv_sim_builder *b)
{
    static const enum fv_sim_material choice[] = {FV_SIM_PARQUET, FV_SIM_TILES, FV_SIM_CARPET};
    return choice[fv_sim_builder_pick(b, 3)];
}

/* Four walls that look inward (or outward, seen from all round) on the rectangle (cx +- hx, cy +-
 * hy). */
void fv_sim_builder_four_walls(struct fv_sim_builder *b, double cx, double cy, double hx, double hy,
                               double height, double scale, bool inward)
{
    static const double x[5] = {1, 1, -1, -1, 1}, y[5] = {1, -1, -1, 1, 1};
    for (int32_t k = 0; k < 4; k++) {
        const int32_t from = inward ? k : k + 1, to = inward ? k + 1 : k;
        const double length = (k & 1) ? 2.0 * hx : 2.0 * hy;
        const uint16_t texture =
            fv_sim_world_texture(b->world, wall_material(b), length, height, scale, true);
        fv_sim_builder_wall(b->world, cx + x[from] * hx, cy + y[from] * hy, cx + x[to] * hx,
                            cy + y[to] * hy, 0.0, height, texture, 0.92 + 0.05 * k);
    }
}

void fv_sim_builder_floor_and_ceiling(struct fv_sim_builder *b, double cx, double cy, double hx,
                                      double hy, double height, double scale)
{
    const double origin[3] = {cx - hx, cy - hy, 0.0}, ux[3] = {2.0 * hx, 0.0, 0.0},
                 uy[3] = {0.0, 2.0 * hy, 0.0};
    const double above[3] = {cx - hx, cy + hy, height}, down[3] = {0.0, -2.0 * hy, 0.0};
    b->floor = fv_sim_world_texture(b->world, floor_material(b), 2.0 * hx, 2.0 * hy, scale, false);
    b->floor_x = cx - hx;
    b->floor_y = cy + hy;
    b->floor_scale = (double)b->world->texture[b->floor].width / (2.0 * hx);
    face_of(fv_sim_world_face(b->world, origin, ux, uy, b->floor, 1.0), FOVEA_TRUTH_FLOOR);
    const uint16_t ceiling =
        fv_sim_world_texture(b->world, FV_SIM_CEILING, 2.0 * hx, 2.0 * hy, scale * 0.5, false);
    face_of(fv_sim_world_face(b->world, above, ux, down, ceiling, 0.95), FOVEA_TRUTH_BACKGROUND);
}

void fv_sim_builder_shade(struct fv_sim_builder *b, double x, double y, double sx, double sy)
{
    struct fv_sim_texture *floor = &b->world->texture[b->floor];
    const double k = b->floor_scale;
    fv_sim_paint_shade(floor, (int32_t)((x - sx / 2 - b->floor_x) * k),
                       (int32_t)((b->floor_y - y - sy / 2) * k),
                       (int32_t)((x + sx / 2 - b->floor_x) * k),
                       (int32_t)((b->floor_y - y + sy / 2) * k), (int32_t)(0.25 * k), 130);
}

void fv_sim_builder_box(struct fv_sim_builder *b, double x, double y, double z, double sx,
                        double sy, double sz, double yaw, uint16_t side, uint16_t top,
                        uint32_t faces)
{
    const double center[2] = {x, y}, size[3] = {sx, sy, sz};
    if (z < 0.01) fv_sim_builder_shade(b, x, y, sx, sy);
    fv_sim_world_box(b->world, center, z, size, yaw, side, top, faces, FV_SIM_DETAIL_PER_M);
}

/* ---- furniture ------------------------------------------------------------------------------- */

/* Against a wall: (x, y) on the wall, (ax, ay) the direction along it, (nx, ny) out of it. Sizes:
 * along, out, up. */
struct stand {
    double x, y, ax, ay, nx, ny;
};

static void part(struct fv_sim_builder *b, const struct stand *s, double along, double out,
                 double z, double width, double depth, double height, uint16_t side, uint16_t top,
                 uint32_t faces)
{
    const bool x_first = s->ax * s->ax > 0.5;
    fv_sim_builder_box(b, s->x + s->ax * along + s->nx * out, s->y + s->ay * along + s->ny * out, z,
                       x_first ? width : depth, x_first ? depth : width, height, 0.0, side, top,
                       faces);
}

static double put_table(struct fv_sim_builder *b, const struct stand *s)
{
    const double width = fv_sim_builder_draw(b, 1.1, 1.6), depth = 0.6;
    part(b, s, 0.0, depth / 2, 0.70, width, depth, 0.05, b->wood[0], b->wood[0], FV_SIM_CLOSED);
    for (int32_t i = 0; i < 4; i++) {
        const double along = (width / 2 - 0.06) * ((i & 1) ? 1 : -1),
                     out = depth / 2 + 0.24 * ((i & 2) ? 1 : -1);
        part(b, s, along, out, 0.0, 0.06, 0.06, 0.70, b->wood[1], b->wood[1], FV_SIM_SIDES);
    }
    for (int32_t i = 0; i < 3; i++) {
        const double size = fv_sim_builder_draw(b, 0.14, 0.32),
                     deep = fv_sim_builder_draw(b, 0.1, 0.3),
                     high = fv_sim_builder_draw(b, 0.12, 0.42);
        part(b, s, width * (i - 1) * 0.32, depth / 2, 0.75, size, deep, high, b->clutter[i & 1],
             b->clutter[1], FV_SIM_ALL);
    }
    return width;
}

static double put_sofa(struct fv_sim_builder *b, const struct stand *s)
{
    const double width = fv_sim_builder_draw(b, 1.3, 1.8);
    part(b, s, 0.0, 0.32, 0.0, width, 0.64, 0.42, b->fabric, b->fabric, FV_SIM_ALL);
    part(b, s, 0.0, 0.09, 0.42, width, 0.18, 0.42, b->fabric, b->fabric, FV_SIM_ALL);
    for (int32_t i = -1; i <= 1; i += 2)
        part(b, s, i * (width / 2 - 0.09), 0.40, 0.42, 0.18, 0.46, 0.2, b->fabric, b->wood[0],
             FV_SIM_ALL);
    part(b, s, fv_sim_builder_draw(b, -0.3, 0.3), 0.25, 0.42, 0.4, 0.14, 0.32, b->clutter[0],
         b->clutter[0], FV_SIM_ALL);
    return width;
}

static double put_crates(struct fv_sim_builder *b, const struct stand *s)
{
    const double low = fv_sim_builder_draw(b, 0.35, 0.5), high = fv_sim_builder_draw(b, 0.25, 0.4);
    part(b, s, -0.28, 0.3, 0.0, 0.5, 0.5, low, b->carton[0], b->carton[1], FV_SIM_ALL);
    part(b, s, 0.27, 0.28, 0.0, 0.45, 0.45, fv_sim_builder_draw(b, 0.3, 0.6), b->carton[1],
         b->carton[0], FV_SIM_ALL);
    part(b, s, -0.25, 0.3, low, 0.38, 0.38, high, b->carton[1], b->carton[1], FV_SIM_ALL);
    part(b, s, -0.25, 0.28, low + high, 0.26, 0.22, 0.2, b->clutter[1], b->clutter[0], FV_SIM_ALL);
    return 1.1;
}

static double put_cupboard(struct fv_sim_builder *b, const struct stand *s)
{
    const double width = fv_sim_builder_draw(b, 0.7, 1.0),
                 height = fv_sim_builder_draw(b, 0.8, 1.7);
    const uint16_t side = fv_sim_builder_pick(b, 2) ? b->metal : b->wood[1];
    part(b, s, 0.0, 0.25, 0.0, width, 0.5, height, side, b->wood[0], FV_SIM_ALL);
    const double along = fv_sim_builder_draw(b, -0.2, 0.2),
                 high = fv_sim_builder_draw(b, 0.15, 0.35);
    part(b, s, along, 0.25, height, 0.3, 0.26, high, b->clutter[0], b->clutter[1], FV_SIM_ALL);
    return width;
}

static double put_shelf(struct fv_sim_builder *b, const struct stand *s)
{
    part(b, s, 0.0, 0.17, 0.0, 1.1, 0.34, 2.0, b->books[fv_sim_builder_pick(b, 2)], b->wood[1],
         FV_SIM_ALL);
    return 1.1;
}

static double put_bin(struct fv_sim_builder *b, const struct stand *s)
{
    const double radius = fv_sim_builder_draw(b, 0.15, 0.22),
                 height = fv_sim_builder_draw(b, 0.4, 0.6), x = s->x + s->nx * 0.3,
                 y = s->y + s->ny * 0.3;
    fv_sim_builder_shade(b, x, y, 2 * radius, 2 * radius);
    struct fv_sim_round *round = fv_sim_world_round(b->world, x, y, 0.0, height, b->metal);
    if (round != NULL) round->q0 = radius * radius;
    const double lid[3] = {x - radius, y - radius, height}, u[3] = {2 * radius, 0, 0},
                 v[3] = {0, 2 * radius, 0};
    struct fv_sim_face *face = fv_sim_world_face(b->world, lid, u, v, b->clutter[0], 0.7);
    if (face != NULL) face->disc = true;
    return 2 * radius + 0.1;
}

/* Furniture along one wall from its left end (as seen from inside), with gaps. */
static void furnish_wall(struct fv_sim_builder *b, double ax, double ay, double bx, double by,
                         double free_from, double free_to)
{
    const double dx = bx - ax, dy = by - ay, length = __builtin_sqrt(dx * dx + dy * dy);
    struct stand s = {.ax = dx / length, .ay = dy / length, .nx = dy / length, .ny = -dx / length};
    double at = 0.75 + fv_sim_builder_draw(b, 0.0, 0.4);
    while (at < length - 1.75) {
        if (at + 1.9 > free_from && at < free_to) {
            at = free_to;
            continue;
        }
        s.x = ax + s.ax * (at + 0.8);
        s.y = ay + s.ay * (at + 0.8);
        double width = 0.0;
        switch (fv_sim_builder_pick(b, 7)) {
        case 0:
            width = put_table(b, &s);
            break;
        case 1:
            width = put_sofa(b, &s);
            break;
        case 2:
            width = put_crates(b, &s);
            break;
        case 3:
            width = put_cupboard(b, &s);
            break;
        case 4:
            width = put_bin(b, &s);
            break;
        default:
            width = put_shelf(b, &s);
            break;
        }
        at += 0.8 + width / 2 + fv_sim_builder_draw(b, 0.05, 0.9);
    }
}

static void furnish(struct fv_sim_builder *b, double cx, double cy, double hx, double hy,
                    double door_from, double door_to)
{
    furnish_wall(b, cx + hx, cy + hy, cx + hx, cy - hy, 1e9, 1e9);
    furnish_wall(b, cx + hx, cy - hy, cx - hx, cy - hy, door_from, door_to);
    furnish_wall(b, cx - hx, cy - hy, cx - hx, cy + hy, 1e9, 1e9);
    furnish_wall(b, cx - hx, cy + hy, cx + hx, cy + hy, 1e9, 1e9);
    /* A low pile in the middle, askew. */
    fv_sim_builder_box(b, cx, cy, 0.0, 0.42, 0.34, 0.3, fv_sim_builder_draw(b, 0.0, 1.5),
                       b->carton[0], b->clutter[0], FV_SIM_ALL);
    fv_sim_builder_box(b, cx + 0.03, cy, 0.3, 0.26, 0.2, 0.18, fv_sim_builder_draw(b, 0.0, 1.5),
                       b->clutter[1], b->clutter[1], FV_SIM_ALL);
}

void fv_sim_place_room(struct fv_sim_world *world, bool store)
{
    struct fv_sim_builder builder, *b = &builder;
    const double hx = 4.5, hy = 3.6, height = 2.8;
    world->room[0] = hx;
    world->room[1] = hy;
    fv_sim_builder_open(b, world, 1);
    fv_sim_builder_four_walls(b, 0.0, 0.0, hx, hy, height, 120.0, true);
    fv_sim_builder_floor_and_ceiling(b, 0.0, 0.0, hx, hy, height, 110.0);
    furnish(b, 0.0, 0.0, hx, hy, 1e9, 1e9);
    if (!store) return;
    /* A second room that cannot be seen from the first. */
    world->store[0] = 30.0;
    fv_sim_builder_four_walls(b, 30.0, 0.0, 3.0, 2.5, height, 100.0, true);
    fv_sim_builder_floor_and_ceiling(b, 30.0, 0.0, 3.0, 2.5, height, 80.0);
    furnish(b, 30.0, 0.0, 3.0, 2.5, 1e9, 1e9);
}

/* Low boxes close to the corridor's corners, out of the lanes. */
static void corridor_clutter(struct fv_sim_builder *b, double hx, double hy)
{
    for (int32_t i = 0; i < 4; i++) {
        const double x = (hx - 0.35) * ((i & 1) ? 1 : -1), y = (hy - 0.35) * ((i & 2) ? 1 : -1);
        fv_sim_builder_box(b, x, y, 0.0, 0.45, 0.4, fv_sim_builder_draw(b, 0.4, 0.7), 0.0,
                           b->carton[i & 1], b->carton[0], FV_SIM_ALL);
        fv_sim_builder_box(b, x, y, 0.7, 0.3, 0.26, 0.25, 0.3, b->clutter[i & 1], b->clutter[1],
                           FV_SIM_ALL);
    }
}

void fv_sim_place_corridor(struct fv_sim_world *world)
{
    struct fv_sim_builder builder, *b = &builder;
    const double hx = 5.4, hy = 4.2, inner_x = 3.0, inner_y = 1.8, height = 2.7;
    world->lane[0] = (hx + inner_x) / 2;
    world->lane[1] = (hy + inner_y) / 2;
    fv_sim_builder_open(b, world, 2);
    fv_sim_builder_four_walls(b, 0.0, 0.0, hx, hy, height, 110.0, true);
    fv_sim_builder_four_walls(b, 0.0, 0.0, inner_x, inner_y, height, 110.0, false);
    fv_sim_builder_floor_and_ceiling(b, 0.0, 0.0, hx, hy, height, 90.0);
    corridor_clutter(b, hx, hy);
}

void fv_sim_place_house(struct fv_sim_world *world)
{
    struct fv_sim_builder builder, *b = &builder;
    const double hx = 4.0, hy = 3.2, thick = 0.2, height = 2.7, ring_x = 6.6, ring_y = 5.8;
    const double door_left = 0.55, door_right = -0.55, lintel = 2.15; /* in the wall y = -hy */
    world->room[0] = hx;
    world->room[1] = hy;
    world->lane[0] = (ring_x + hx + thick) / 2;
    world->lane[1] = (ring_y + hy + thick) / 2;
    fv_sim_builder_open(b, world, 3);
    fv_sim_builder_four_walls(b, 0.0, 0.0, ring_x, ring_y, height, 80.0, true);
    fv_sim_builder_floor_and_ceiling(b, 0.0, 0.0, ring_x, ring_y, height, 80.0);
    const int32_t first = world->face_count;
    fv_sim_builder_four_walls(b, 0.0, 0.0, hx, hy, height, 100.0, true);
    fv_sim_builder_four_walls(b, 0.0, 0.0, hx + thick, hy + thick, height, 80.0, false);
    /* Wall 1 of each four is the one at -y: cut the doorway out of it, leaving left, right and
     * lintel. */
    for (int32_t k = 0; k < 2; k++) {
        struct fv_sim_face *face = &world->face[first + 4 * k + 1];
        const struct fv_sim_face whole = *face;
        const double length = k ? 2.0 * (hx + thick) : 2.0 * hx, start = k ? -(hx + thick) : hx,
                     sign = k ? 1.0 : -1.0;
        const double near = sign > 0 ? (door_right - start) / length : (start - door_left) / length;
        const double far = sign > 0 ? (door_left - start) / length : (start - door_right) / length;
        const double cut[3][4] = {{0, near, 0, 1}, {far, 1, 0, 1}, {near, far, lintel / height, 1}};
        for (int32_t c = 0; c < 3; c++) {
            if (c > 0)
                face = fv_sim_world_face(world, whole.origin, whole.u, whole.v, whole.texture,
                                         whole.light);
            if (face == NULL) return;
            face->truth_class = whole.truth_class;
            for (int32_t i = 0; i < 3; i++) {
                face->origin[i] = whole.origin[i] + cut[c][0] * whole.u[i] + cut[c][2] * whole.v[i];
                face->u[i] = (cut[c][1] - cut[c][0]) * whole.u[i];
                face->v[i] = (cut[c][3] - cut[c][2]) * whole.v[i];
            }
            face->tex_u = (float)cut[c][0] * whole.tex_du;
            face->tex_du = (float)(cut[c][1] - cut[c][0]) * whole.tex_du;
            face->tex_v = whole.tex_v + (float)cut[c][2] * whole.tex_dv;
            face->tex_dv = (float)(cut[c][3] - cut[c][2]) * whole.tex_dv;
        }
    }
    /* Jambs and the underside of the lintel. */
    fv_sim_builder_wall(world, door_left, -hy, door_left, -hy - thick, 0.0, lintel, b->wood[0],
                        0.8);
    fv_sim_builder_wall(world, door_right, -hy - thick, door_right, -hy, 0.0, lintel, b->wood[0],
                        0.9);
    const double under[3] = {door_right, -hy, lintel}, u[3] = {door_left - door_right, 0, 0},
                 v[3] = {0, -thick, 0};
    face_of(fv_sim_world_face(world, under, u, v, b->wood[1], 0.6), FOVEA_TRUTH_WALL);
    furnish(b, 0.0, 0.0, hx, hy, hx - door_left - 0.6, hx - door_right + 0.6);
    corridor_clutter(b, ring_x, ring_y);
}

void fv_sim_place_hall(struct fv_sim_world *world)
{
    struct fv_sim_builder builder, *b = &builder;
    const double hx = 13.0, hy = 10.0, height = 5.5;
    world->room[0] = hx;
    world->room[1] = hy;
    fv_sim_builder_open(b, world, 4);
    fv_sim_builder_four_walls(b, 0.0, 0.0, hx, hy, height, 64.0, true);
    fv_sim_builder_floor_and_ceiling(b, 0.0, 0.0, hx, hy, height, 54.0);
    furnish(b, 0.0, 0.0, hx, hy, 1e9, 1e9);
    /* Pillars and racks round the free middle (|x| < 8, |y| < 5.5), low islands in it, banners
     * under the ceiling. */
    for (int32_t i = 0; i < 14; i++) {
        const double angle = i * (2.0 * FV_PI / 14.0) + 0.2, x = 10.6 * fv_cos(angle),
                     y = 7.9 * fv_sin(angle);
        if (i % 2) {
            fv_sim_builder_box(b, x, y, 0.0, 0.5, 0.5, height, 0.0, b->metal, b->metal,
                               FV_SIM_SIDES);
            continue;
        }
        fv_sim_builder_box(b, x, y, 0.0, 1.6, 0.6, 2.2, angle, b->books[(i / 2) & 1], b->wood[0],
                           FV_SIM_ALL);
        fv_sim_builder_box(b, x, y, 2.2, 0.8, 0.5, fv_sim_builder_draw(b, 0.4, 0.8), angle,
                           b->carton[0], b->carton[1], FV_SIM_ALL);
    }
    for (int32_t i = 0; i < 12; i++) {
        const double x = -7.0 + 2.8 * (i % 6) + fv_sim_builder_draw(b, -0.5, 0.5),
                     y = (i < 6 ? -2.6 : 2.6) + fv_sim_builder_draw(b, -1.2, 1.2),
                     yaw = fv_sim_builder_draw(b, 0.0, 1.5);
        const double low = fv_sim_builder_draw(b, 0.35, 0.6),
                     length = fv_sim_builder_draw(b, 0.5, 1.0),
                     width = fv_sim_builder_draw(b, 0.5, 0.8);
        fv_sim_builder_box(b, x, y, 0.0, length, width, low, yaw, b->carton[i & 1], b->carton[1],
                           FV_SIM_ALL);
        fv_sim_builder_box(b, x + 0.05, y, low, 0.35, 0.3, fv_sim_builder_draw(b, 0.15, 0.3),
                           yaw + 0.5, b->clutter[i & 1], b->clutter[0], FV_SIM_ALL);
    }
    for (int32_t i = 0; i < 8; i++) {
        const double x = -9.0 + 2.6 * i, y = (i & 1) ? 4.0 : -4.0;
        fv_sim_builder_box(b, x, y, 3.0, 1.3, 0.04, 1.5, fv_sim_builder_draw(b, -0.8, 0.8),
                           b->clutter[i & 1], b->wood[0], FV_SIM_CLOSED);
    }
}
