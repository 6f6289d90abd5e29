#include "builder.h"

/* The hall that a robot drives through: rooms one behind the other, with doorways, and what stands
 * in them. Nothing is put where it would close the way from start to goal. What stands on the floor
 * is as wide at its foot as anywhere above it. */

enum kind { LOW_BOX, CRATES, CUPBOARD, BIN, SOFA, PILLAR, KIND_COUNT };
enum { WALL_SCALE = 100, FLOOR_SCALE = 110 };

static const double height_m = 2.7, wall_m = 0.16, pit_depth_m = 0.7;
static const double ends_m = 0.95; /* free round start and goal */

struct hall {
    struct fv_sim_builder builder;
    struct fv_sim_drive *drive;
    struct fv_sim_drive_search *search;
};

static double draw(struct hall *h, double low, double high)
{
    return fv_sim_builder_draw(&h->builder, low, high);
}

static struct fv_sim_block rectangle(double x, double y, double half_x, double half_y, double yaw)
{
    return (struct fv_sim_block){
        .center = {x, y}, .half = {half_x, half_y}, .cosine = fv_cos(yaw), .sine = fv_sin(yaw)};
}

/* ---- rooms ----------------------------------------------------------------------------------- */

static void commit(struct hall *h, const struct fv_sim_block *block)
{
    if (h->drive->block_count == FV_SIM_DRIVE_BLOCKS_MAX) return;
    h->drive->block[h->drive->block_count++] = *block;
    if (h->search != NULL) fv_sim_drive_search_add(h->search, block);
}

/* A piece of a wall across the hall, from y to y. */
static void put_partition(struct hall *h, double x, double from, double to, uint16_t texture)
{
    struct fv_sim_world *world = h->builder.world;
    const double center[2] = {x, 0.5 * (from + to)}, size[3] = {wall_m, to - from, height_m};
    const int32_t first = world->face_count;
    const struct fv_sim_block block =
        rectangle(center[0], center[1], 0.5 * wall_m, 0.5 * (to - from), 0);
    fv_sim_world_box(world, center, 0, size, 0, texture, texture, FV_SIM_SIDES, WALL_SCALE);
    for (int32_t i = first; i < world->face_count; i++)
        world->face[i].truth_class = FOVEA_TRUTH_WALL;
    commit(h, &block);
}

static void put_rooms(struct hall *h)
{
    const struct fv_sim_drive *d = h->drive;
    const uint32_t walls = 1 + fv_sim_builder_pick(&h->builder, 2);
    for (uint32_t i = 0; i < walls; i++) {
        const double even = 2 * d->half[0] * (i + 1.0) / (walls + 1.0) - d->half[0];
        const double x = even + draw(h, -0.5, 0.5), door = draw(h, 1.1, 1.6);
        const double reach = d->half[1] - 0.5 - 0.5 * door, at = draw(h, -reach, reach);
        const uint16_t texture = fv_sim_world_texture(
            h->builder.world, fv_sim_builder_pick(&h->builder, 2) ? FV_SIM_BRICK : FV_SIM_PLASTER,
            2 * d->half[1], height_m, WALL_SCALE, true);
        put_partition(h, x, -d->half[1], at - 0.5 * door, texture);
        put_partition(h, x, at + 0.5 * door, d->half[1], texture);
    }
}

/* ---- a pit in the floor ---------------------------------------------------------------------- */

/* Floor or ceiling cut down to a part of it, 0 to 1 along its sides. */
static void cut(struct fv_sim_face *face, const struct fv_sim_face *whole, const double part[4])
{
    *face = *whole;
    for (int32_t i = 0; i < 3; i++) {
        face->origin[i] = whole->origin[i] + part[0] * whole->u[i] + part[2] * whole->v[i];
        face->u[i] = (part[1] - part[0]) * whole->u[i];
        face->v[i] = (part[3] - part[2]) * whole->v[i];
    }
    face->tex_u = whole->tex_u + (float)part[0] * whole->tex_du;
    face->tex_du = (float)(part[1] - part[0]) * whole->tex_du;
    face->tex_v = whole->tex_v + (float)part[2] * whole->tex_dv;
    face->tex_dv = (float)(part[3] - part[2]) * whole->tex_dv;
}

/* Open the floor (face `floor`) over the pit, and wall it in. */
static void put_pit(struct hall *h, int32_t floor)
{
    struct fv_sim_world *world = h->builder.world;
    const struct fv_sim_drive *d = h->drive;
    const struct fv_sim_face whole = world->face[floor];
    const double *p = d->pit;
    double at[4];
    for (int32_t i = 0; i < 4; i++)
        at[i] = (p[i] + d->half[i / 2]) / (2 * d->half[i / 2]);
    const double parts[4][4] = {
        {0, at[0], 0, 1}, {at[1], 1, 0, 1}, {at[0], at[1], 0, at[2]}, {at[0], at[1], at[3], 1}};
    for (int32_t k = 0; k < 4; k++) {
        struct fv_sim_face *face = &world->face[floor];
        if (k > 0)
            face = fv_sim_world_face(world, whole.origin, whole.u, whole.v, whole.texture, 1);
        if (face == NULL) return;
        cut(face, &whole, parts[k]);
    }
    const uint16_t texture = fv_sim_world_texture(world, FV_SIM_BLOCKS, 2, 2, WALL_SCALE, false);
    const int32_t first = world->face_count;
    fv_sim_builder_wall(world, p[1], p[3], p[1], p[2], -pit_depth_m, pit_depth_m, texture, 0.55);
    fv_sim_builder_wall(world, p[1], p[2], p[0], p[2], -pit_depth_m, pit_depth_m, texture, 0.5);
    fv_sim_builder_wall(world, p[0], p[2], p[0], p[3], -pit_depth_m, pit_depth_m, texture, 0.6);
    fv_sim_builder_wall(world, p[0], p[3], p[1], p[3], -pit_depth_m, pit_depth_m, texture, 0.65);
    const double origin[3] = {p[0], p[2], -pit_depth_m}, u[3] = {p[1] - p[0], 0, 0},
                 v[3] = {0, p[3] - p[2], 0};
    fv_sim_world_face(world, origin, u, v, texture, 0.4);
    for (int32_t i = first; i < world->face_count; i++)
        world->face[i].truth_class = FOVEA_TRUTH_PIT;
}

/* ---- what stands there ----------------------------------------------------------------------- */

static void put_box(struct hall *h, const struct fv_sim_block *b, double share, double z,
                    double height, uint16_t side, uint16_t top)
{
    fv_sim_builder_box(&h->builder, b->center[0], b->center[1], z, 2 * share * b->half[0],
                       2 * share * b->half[1], height, fv_atan2(b->sine, b->cosine), side, top,
                       FV_SIM_ALL);
}

static void put_bin(struct hall *h, const struct fv_sim_block *block)
{
    struct fv_sim_builder *b = &h->builder;
    const double r = block->radius, x = block->center[0], y = block->center[1],
                 height = draw(h, 0.4, 0.75);
    fv_sim_builder_shade(b, x, y, 2 * r, 2 * r);
    struct fv_sim_round *round = fv_sim_world_round(b->world, x, y, 0, height, b->metal);
    if (round != NULL) round->q0 = r * r;
    const double lid[3] = {x - r, y - r, height}, u[3] = {2 * r, 0, 0}, v[3] = {0, 2 * r, 0};
    struct fv_sim_face *face = fv_sim_world_face(b->world, lid, u, v, b->clutter[0], 0.7);
    if (face != NULL) face->disc = true;
}

static void put_sofa(struct hall *h, const struct fv_sim_block *block)
{
    struct fv_sim_block back = *block;
    put_box(h, block, 1, 0, 0.42, h->builder.fabric, h->builder.fabric);
    back.half[1] = 0.3 * block->half[1];
    for (int32_t i = 0; i < 2; i++)
        back.center[i] += 0.7 * block->half[1] * (i == 0 ? -block->sine : block->cosine);
    put_box(h, &back, 1, 0.42, 0.4, h->builder.fabric, h->builder.fabric);
}

static void put(struct hall *h, enum kind kind, const struct fv_sim_block *block)
{
    struct fv_sim_builder *b = &h->builder;
    const uint32_t variant = fv_sim_builder_pick(b, 2);
    const double low = draw(h, 0.15, 0.4), high = draw(h, 0.45, 0.95);
    switch (kind) {
    case LOW_BOX:
        put_box(h, block, 1, 0, low, b->carton[variant], b->carton[0]);
        break;
    case CRATES:
        put_box(h, block, 1, 0, high, b->carton[variant], b->carton[1]);
        put_box(h, block, 0.7, high, low, b->clutter[variant], b->clutter[0]);
        break;
    case CUPBOARD:
        put_box(h, block, 1, 0, 0.7 + high, variant ? b->books[0] : b->metal, b->wood[0]);
        break;
    case BIN:
        put_bin(h, block);
        break;
    case SOFA:
        put_sofa(h, block);
        break;
    default:
        put_box(h, block, 1, 0, height_m, b->wood[variant], b->wood[0]);
        break;
    }
}

static bool is_apart(const struct fv_sim_drive *d, const struct fv_sim_block *block)
{
    const double size = block->radius > 0 ? block->radius : block->half[0] + block->half[1];
    return fv_sim_block_distance(block, d->start[0], d->start[1]) > ends_m &&
           fv_sim_block_distance(block, d->goal[0], d->goal[1]) > ends_m &&
           fv_sim_drive_gap(d, block->center, 0.75 * size) > 0.03;
}

static struct fv_sim_block draw_block(struct hall *h, enum kind kind)
{
    static const double sizes[KIND_COUNT][4] = {
        [LOW_BOX] = {0.15, 0.35, 0.12, 0.3}, [CRATES] = {0.2, 0.4, 0.2, 0.35},
        [CUPBOARD] = {0.3, 0.6, 0.18, 0.25}, [BIN] = {0.14, 0.22, 0.14, 0.22},
        [SOFA] = {0.6, 0.9, 0.32, 0.4},      [PILLAR] = {0.14, 0.22, 0.14, 0.22}};
    const double *s = sizes[kind], *half = h->drive->half;
    const double x = draw(h, 0.4 - half[0], half[0] - 0.4),
                 y = draw(h, 0.4 - half[1], half[1] - 0.4);
    const double a = draw(h, s[0], s[1]), b = draw(h, s[2], s[3]), yaw = draw(h, 0, FV_PI);
    struct fv_sim_block block = rectangle(x, y, a, b, yaw);
    if (kind == BIN) block.radius = a;
    return block;
}

/* Where it is free and leaves a way. */
static void put_things(struct hall *h)
{
    const int32_t count = 9 + (int32_t)fv_sim_builder_pick(&h->builder, 8);
    for (int32_t i = 0, tries = 0; i < count && tries < 300; tries++) {
        const enum kind kind = (enum kind)fv_sim_builder_pick(&h->builder, KIND_COUNT);
        const struct fv_sim_block block = draw_block(h, kind);
        if (!is_apart(h->drive, &block) || !fv_sim_drive_has_way(h->search, &block)) continue;
        commit(h, &block);
        put(h, kind, &block);
        i++;
    }
}

/* In two of three halls. */
static bool choose_pit(struct hall *h)
{
    struct fv_sim_drive *d = h->drive;
    const bool wanted = fv_sim_builder_pick(&h->builder, 3) > 0;
    for (int32_t tries = 0; wanted && tries < 60; tries++) {
        const double a = draw(h, 0.4, 0.8), b = draw(h, 0.4, 0.7);
        const double x = draw(h, 0.3 + a - d->half[0], d->half[0] - a - 0.3),
                     y = draw(h, 0.3 + b - d->half[1], d->half[1] - b - 0.3);
        const struct fv_sim_block block = rectangle(x, y, a, b, 0);
        if (!is_apart(d, &block) || !fv_sim_drive_has_way(h->search, &block)) continue;
        commit(h, &block);
        d->pit[0] = x - a;
        d->pit[1] = x + a;
        d->pit[2] = y - b;
        d->pit[3] = y + b;
        return true;
    }
    return false;
}

void fv_sim_place_drive(struct fv_sim_world *world)
{
    struct hall hall = {.drive = &world->drive}, *h = &hall;
    struct fv_sim_drive *d = h->drive;
    fv_sim_builder_open(&h->builder, world, 5);
    d->half[0] = draw(h, 4.0, 5.5);
    d->half[1] = draw(h, 2.8, 3.8);
    const double aside = d->half[1] - 0.9;
    d->start[0] = 0.9 - d->half[0];
    d->goal[0] = d->half[0] - 0.9;
    d->start[1] = draw(h, -aside, aside);
    d->goal[1] = draw(h, -aside, aside);
    world->room[0] = d->half[0];
    world->room[1] = d->half[1];
    fv_sim_builder_four_walls(&h->builder, 0, 0, d->half[0], d->half[1], height_m, WALL_SCALE,
                              true);
    const int32_t floor = world->face_count;
    fv_sim_builder_floor_and_ceiling(&h->builder, 0, 0, d->half[0], d->half[1], height_m,
                                     FLOOR_SCALE);
    put_rooms(h);
    h->search = fv_sim_drive_search_open(d);
    if (h->search == NULL) {
        world->full = true;
        return;
    }
    if (choose_pit(h)) put_pit(h, floor);
    put_things(h);
    fv_sim_drive_plan(h->search, d);
    fv_sim_drive_search_close(h->search);
}
