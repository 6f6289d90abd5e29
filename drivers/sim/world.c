#include "sim.h"

#include <string.h>

/* ---- building blocks ------------------------------------------------------------------------- */

/* A seed of its own for the n-th thing made (SplitMix64's finaliser). */
static uint64_t seed_for(uint64_t seed, uint64_t n)
{
    uint64_t z = seed + (n + 1) * 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

uint16_t fv_sim_world_texture(struct fv_sim_world *world, enum fv_sim_material material,
                              double width_m, double height_m, double texels_per_m, bool wall)
{
    if (world->texture_count == FV_SIM_TEXTURES_MAX) {
        world->full = true;
        return 0;
    }
    const int32_t index = world->texture_count;
    struct fv_sim_texture *texture = &world->texture[index];
    const int32_t width = (int32_t)(width_m * texels_per_m),
                  height = (int32_t)(height_m * texels_per_m);
    if (!fv_sim_texture_create(texture, width < 16 ? 16 : width, height < 16 ? 16 : height)) {
        world->full = true;
        return 0;
    }
    world->texture_count++;
    /* Repeated textures: the same material always looks the same, and walls hang the same things.
     */
    const uint64_t seed =
        seed_for(world->seed, world->repeated ? 1000u + (uint64_t)material : (uint64_t)index);
    fv_sim_paint(texture, material, texels_per_m, seed);
    if (wall) {
        const uint64_t hung = world->repeated ? seed_for(world->seed, 2000) : seed_for(seed, 1);
        fv_sim_paint_wall(texture, texels_per_m, hung, world->repeated ? 2.4 : 0.0);
        fv_sim_paint_light(texture, texels_per_m, seed_for(seed, 2));
    }
    return (uint16_t)index;
}

struct fv_sim_face *fv_sim_world_face(struct fv_sim_world *world, const double origin[3],
                                      const double u[3], const double v[3], uint16_t texture,
                                      double light)
{
    if (world->face_count == FV_SIM_FACES_MAX) {
        world->full = true;
        return NULL;
    }
    struct fv_sim_face *face = &world->face[world->face_count++];
    *face = (struct fv_sim_face){
        .texture = texture, .light = (float)light, .truth_class = FOVEA_TRUTH_OBSTACLE};
    for (int32_t i = 0; i < 3; i++) {
        face->origin[i] = origin[i];
        face->u[i] = u[i];
        face->v[i] = v[i];
    }
    /* The image stands upright: its top row is at v = 1. */
    const struct fv_sim_texture *t = &world->texture[texture];
    face->tex_du = (float)t->width;
    face->tex_v = (float)t->height;
    face->tex_dv = -(float)t->height;
    return face;
}

/* Show a piece of a shared texture at its own scale; a face larger than the texture stretches it.
 */
static void take_piece(struct fv_sim_world *world, struct fv_sim_face *face, double width_m,
                       double height_m, double texels_per_m)
{
    const struct fv_sim_texture *t = &world->texture[face->texture];
    struct fv_random random;
    fv_random_seed(
        &random, seed_for(world->seed, world->repeated ? 7u : 5000u + (uint64_t)world->face_count));
    int32_t du = (int32_t)(width_m * texels_per_m), dv = (int32_t)(height_m * texels_per_m);
    if (du > t->width) du = t->width;
    if (dv > t->height) dv = t->height;
    const int32_t u0 = (int32_t)fv_random_below(&random, (uint32_t)(t->width - du + 1));
    const int32_t v0 = (int32_t)fv_random_below(&random, (uint32_t)(t->height - dv + 1));
    face->tex_u = (float)u0;
    face->tex_du = (float)du;
    face->tex_v = (float)(v0 + dv);
    face->tex_dv = -(float)dv;
}

void fv_sim_world_box(struct fv_sim_world *world, const double center[2], double z,
                      const double size[3], double yaw, uint16_t side, uint16_t top, uint32_t faces,
                      double texels_per_m)
{
    const double c = fv_cos(yaw), s = fv_sin(yaw);
    /* Corners go round anticlockwise from (-x, -y); side k runs from corner k to k + 1 and faces
     * outward. */
    static const double round_x[4] = {-0.5, 0.5, 0.5, -0.5}, round_y[4] = {-0.5, -0.5, 0.5, 0.5};
    static const uint32_t bit[4] = {4, 2, 8, 1};
    double corner[4][2];
    for (int32_t k = 0; k < 4; k++) {
        const double x = round_x[k] * size[0], y = round_y[k] * size[1];
        corner[k][0] = center[0] + c * x - s * y;
        corner[k][1] = center[1] + s * x + c * y;
    }
    for (int32_t k = 0; k < 4; k++) {
        if (!(faces & bit[k])) continue;
        const double *from = corner[k], *to = corner[(k + 1) % 4];
        const double origin[3] = {from[0], from[1], z},
                     u[3] = {to[0] - from[0], to[1] - from[1], 0.0};
        const double v[3] = {0.0, 0.0, size[2]}, width = (k & 1) ? size[1] : size[0];
        /* Outward normal is (u.y, -u.x); light comes mostly from +x -y. */
        const double light = 0.84 + 0.1 * (u[1] * 0.8 + u[0] * 0.6) / width;
        struct fv_sim_face *face = fv_sim_world_face(world, origin, u, v, side, light);
        if (face != NULL && texels_per_m > 0.0)
            take_piece(world, face, width, size[2], texels_per_m);
    }
    const double ux[3] = {c * size[0], s * size[0], 0.0}, uy[3] = {-s * size[1], c * size[1], 0.0};
    if (faces & 16) {
        const double origin[3] = {corner[0][0], corner[0][1], z + size[2]};
        struct fv_sim_face *face = fv_sim_world_face(world, origin, ux, uy, top, 1.06);
        if (face != NULL && texels_per_m > 0.0)
            take_piece(world, face, size[0], size[1], texels_per_m);
    }
    if (faces & 32) {
        const double origin[3] = {corner[3][0], corner[3][1], z}, down[3] = {-uy[0], -uy[1], 0.0};
        struct fv_sim_face *face = fv_sim_world_face(world, origin, ux, down, top, 0.6);
        if (face != NULL && texels_per_m > 0.0)
            take_piece(world, face, size[0], size[1], texels_per_m);
    }
}

struct fv_sim_round *fv_sim_world_round(struct fv_sim_world *world, double x, double y, double z,
                                        double height, uint16_t texture)
{
    if (world->round_count == FV_SIM_ROUNDS_MAX) {
        world->full = true;
        return NULL;
    }
    struct fv_sim_round *round = &world->round[world->round_count++];
    *round = (struct fv_sim_round){.base = {x, y, z},
                                   .axis = {0.0, 0.0, 1.0},
                                   .side = {1.0, 0.0, 0.0},
                                   .height = height,
                                   .light = 1.0f,
                                   .texture = texture,
                                   .truth_class = FOVEA_TRUTH_OBSTACLE};
    return round;
}

/* ---- whole worlds ---------------------------------------------------------------------------- */

bool fv_sim_world_build(struct fv_sim_world *world, const struct fv_sim_options *options)
{
    memset(world, 0, sizeof *world);
    world->seed = seed_for(options->seed, 0);
    world->repeated = options->textures == FV_SIM_TEXTURES_REPEATED;
    switch (options->trajectory) {
    case FV_SIM_TOUR:
        fv_sim_place_house(world);
        break;
    case FV_SIM_CORRIDOR:
        fv_sim_place_corridor(world);
        break;
    case FV_SIM_WANDER:
        fv_sim_place_hall(world);
        break;
    case FV_SIM_ROAD:
        fv_sim_place_road(world, options);
        break;
    case FV_SIM_DRIVE:
        fv_sim_place_drive(world);
        break;
    case FV_SIM_BOARD:
        fv_sim_place_room(world, false);
        fv_sim_place_board(world);
        break;
    default:
        fv_sim_place_room(world, options->trajectory == FV_SIM_KIDNAP);
        break;
    }
    if (options->trajectory != FV_SIM_ROAD) fv_sim_objects_create(world, options);
    if (options->trajectory == FV_SIM_DRIVE && !world->full)
        world->full = !fv_sim_drive_create(world, options);
    world->static_faces = world->face_count;
    world->static_rounds = world->round_count;
    for (int32_t i = 0; i < world->texture_count; i++)
        fv_sim_texture_finish(&world->texture[i]);
    if (!world->full) fv_sim_world_place(world, 0.0);
    return !world->full;
}

void fv_sim_world_free(struct fv_sim_world *world)
{
    for (int32_t i = 0; i < world->texture_count; i++)
        fv_sim_texture_free(&world->texture[i]);
    world->texture_count = 0;
    fv_sim_drive_free(&world->drive);
}
