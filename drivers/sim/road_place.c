#include "sim.h"

/* What stands along the road: ground in strips that follow it, house fronts, hedges and fences,
 * trees, parked cars, and the sky with what is far. Everything keeps clear of the road, and leaves
 * room for the cars that move. */

enum { FACES_KEPT = FV_SIM_ROAD_CARS_MAX * 12 };

static const double period_m = 60.0; /* of the road's texture */
static const double strip_m = 80.0;  /* that it is long: a period, and a piece more */
static const double verge_m = 9.0;   /* wide, on both sides */
static const double sky_m = 900.0, sky_height_m = 500.0, sky_foot_m = -20.0;
enum { SKY_SIDES = 12 };

struct builder {
    struct fv_sim_world *world;
    struct fv_random random;
    uint16_t asphalt[3], verge[2], facade[4], roof, foliage[2], bark, fence, hedge, post, ground;
    uint16_t car[3], glass; /* parked */
};

static double draw(struct builder *b, double low, double high)
{
    return low + (high - low) * fv_random_unit(&b->random);
}

static bool chance(struct builder *b, uint32_t in_100)
{
    return fv_random_below(&b->random, 100) < in_100;
}

/* Light on a surface by its normal: of the sky, and of the sun. */
static double light_on(const struct fv_sim_road *road, double nx, double ny, double nz)
{
    const double sun = nx * road->sun[0] + ny * road->sun[1] + nz * road->sun[2];
    return 0.22 + 0.44 * (sun > 0 ? sun : 0);
}

static bool room_for(const struct fv_sim_world *world, int32_t faces)
{
    return world->face_count + faces <= FV_SIM_FACES_MAX - FACES_KEPT;
}

/* ---- ground ---------------------------------------------------------------------------------- */

static double wrapped(double angle)
{
    return angle - 2 * FV_PI * fv_floor(angle / (2 * FV_PI) + 0.5);
}

/* The strip between two distances aside of the middle line (left positive), from one distance along
 * it to another: a rectangle along the chord, cut where the neighbours begin. */
static void put_strip(struct fv_sim_world *world, const double along[2], double right, double left,
                      uint16_t texture, double texels_per_m)
{
    static const double over_m = 0.04;
    double a[3], b[3], heading[2], slope;
    fv_sim_road_at(&world->road, along[0], a, &heading[0], &slope);
    fv_sim_road_at(&world->road, along[1], b, &heading[1], &slope);
    const double dx = b[0] - a[0], dy = b[1] - a[1], length = __builtin_sqrt(dx * dx + dy * dy);
    const double c = dx / length, s = dy / length, chord = fv_atan2(dy, dx),
                 rise = (b[2] - a[2]) / length;
    const double ta = fv_tan(wrapped(heading[0] - chord)), tb = fv_tan(wrapped(heading[1] - chord));
    const double a0 = -right * ta, a1 = -left * ta, b0 = length - right * tb,
                 b1 = length - left * tb;
    if (b0 - a0 < 0.02 || b1 - a1 < 0.02) return; /* nothing is left on the inner side */
    const double low = (a0 < a1 ? a0 : a1) - over_m, high = (b0 > b1 ? b0 : b1) + over_m;
    const double span = high - low, width = left - right;
    const double origin[3] = {a[0] + low * c - right * s, a[1] + low * s + right * c,
                              a[2] + low * rise};
    const double u[3] = {span * c, span * s, span * rise}, v[3] = {-width * s, width * c, 0};
    struct fv_sim_face *face = fv_sim_world_face(world, origin, u, v, texture,
                                                 light_on(&world->road, -rise * c, -rise * s, 1));
    if (face == NULL) return;
    face->truth_class = FOVEA_TRUTH_FLOOR;
    face->is_cut = true;
    face->cut[0][0] = low - a0 + over_m;
    face->cut[0][1] = span;
    face->cut[0][2] = width * ta;
    face->cut[1][0] = b0 - low + over_m;
    face->cut[1][1] = -span;
    face->cut[1][2] = -width * tb;
    const double from = along[0] - period_m * fv_floor(along[0] / period_m);
    face->tex_u = (float)((from + 3 + low) * texels_per_m);
    face->tex_du = (float)(span * texels_per_m);
}

static void put_ground(struct builder *b)
{
    struct fv_sim_world *world = b->world;
    const double side = FV_SIM_ROAD_HALF_WIDTH_M;
    double along = 0, lowest = 1e9;
    uint16_t asphalt = b->asphalt[0];
    while (along < FV_SIM_ROAD_LENGTH_M - 1) {
        const double k = fv_sim_road_curvature(&world->road, along + 1), bend = k < 0 ? -k : k;
        double step = bend > 0.03 ? 2.0 : bend > 0.004 ? 3.0 : 8.0;
        if (along + step > FV_SIM_ROAD_LENGTH_M - 1) step = FV_SIM_ROAD_LENGTH_M - along;
        const double ends[2] = {along, along + step};
        double at[3], heading, slope;
        fv_sim_road_at(&world->road, along, at, &heading, &slope);
        lowest = at[2] < lowest ? at[2] : lowest;
        if (fv_random_below(&b->random, 12) == 0)
            asphalt = b->asphalt[fv_random_below(&b->random, 3)];
        put_strip(world, ends, -side, side, asphalt, 40);
        put_strip(world, ends, side, side + verge_m, b->verge[0], 24);
        put_strip(world, ends, -side - verge_m, -side, b->verge[1], 24);
        along += step;
    }
    const struct fv_sim_road_point *middle = &world->road.point[FV_SIM_ROAD_POINTS / 2];
    const double origin[3] = {middle->x - 1000, middle->y - 1000, lowest - 0.4},
                 u[3] = {2000, 0, 0}, v[3] = {0, 2000, 0};
    struct fv_sim_face *face =
        fv_sim_world_face(world, origin, u, v, b->ground, light_on(&world->road, 0, 0, 1));
    if (face != NULL) face->truth_class = FOVEA_TRUTH_FLOOR;
}

/* A ring of sky about the middle of the road, and under it what is far. */
static void put_sky(struct builder *b)
{
    struct fv_sim_world *world = b->world;
    const struct fv_sim_road_point *middle = &world->road.point[FV_SIM_ROAD_POINTS / 2];
    const uint16_t texture =
        fv_sim_world_texture(world, FV_SIM_ROAD_SKY, 2 * FV_PI * sky_m, sky_height_m, 0.8, false);
    const double reach = sky_m / fv_cos(FV_PI / SKY_SIDES), turn = 2 * FV_PI / SKY_SIDES;
    for (int32_t k = 0; k < SKY_SIDES; k++) {
        /* Seen from inside, the next corner clockwise is to the right. */
        const double from = -turn * k, to = -turn * (k + 1);
        const double origin[3] = {middle->x + reach * fv_cos(from),
                                  middle->y + reach * fv_sin(from), sky_foot_m};
        const double u[3] = {reach * (fv_cos(to) - fv_cos(from)),
                             reach * (fv_sin(to) - fv_sin(from)), 0},
                     v[3] = {0, 0, sky_height_m};
        struct fv_sim_face *face = fv_sim_world_face(world, origin, u, v, texture, 1.2);
        if (face == NULL) return;
        face->truth_class = FOVEA_TRUTH_BACKGROUND;
        const float width = face->tex_du / SKY_SIDES;
        face->tex_u = (float)k * width;
        face->tex_du = width;
    }
}

/* ---- what stands ----------------------------------------------------------------------------- */

/* An upright rectangle from one place aside of the road to another, seen from the left of the way
 * from the first to the second; a piece of a texture, which begins at `piece_m`. */
static void put_wall(struct builder *b, const double from[3], const double to[3], double height,
                     uint16_t texture, double texels_per_m, double piece_m)
{
    struct fv_sim_world *world = b->world;
    const double u[3] = {to[0] - from[0], to[1] - from[1], to[2] - from[2]}, v[3] = {0, 0, height};
    const double length = __builtin_sqrt(u[0] * u[0] + u[1] * u[1]);
    /* u and v are perpendicular only on level ground; a step in height is left to the foot. */
    const double level[3] = {u[0], u[1], 0};
    struct fv_sim_face *face = fv_sim_world_face(
        world, from, level, v, texture, light_on(&world->road, u[1] / length, -u[0] / length, 0));
    if (face != NULL) face->truth_class = FOVEA_TRUTH_WALL;
    if (face == NULL || texels_per_m <= 0) return;
    const struct fv_sim_texture *t = &world->texture[texture];
    const double most = (double)t->width / texels_per_m - length;
    const double begin = most > 0 ? piece_m - most * fv_floor(piece_m / most) : 0;
    face->tex_u = (float)(begin * texels_per_m);
    if (most > 0) face->tex_du = (float)(length * texels_per_m);
}

/* Place beside the road, `lateral` to the left of the middle line. */
static void beside(const struct fv_sim_road *road, double along, double lateral, double position[3],
                   double *heading)
{
    double slope;
    fv_sim_road_at(road, along, position, heading, &slope);
    position[0] -= lateral * fv_sin(*heading);
    position[1] += lateral * fv_cos(*heading);
}

/* On the side (+1 left, -1 right) a wall from `along` over `length`, facing the road. false: it
 * would stand on the road elsewhere. */
static bool put_along(struct builder *b, int32_t side, double along, double length, double lateral,
                      double height, double foot, uint16_t texture, double texels_per_m)
{
    double p[3], q[3], heading;
    beside(&b->world->road, along, side * lateral, p, &heading);
    beside(&b->world->road, along + length, side * lateral, q, &heading);
    const double dx = q[0] - p[0], dy = q[1] - p[1];
    const double least = 0.75 * lateral;
    if (dx * dx + dy * dy < 0.25 || !room_for(b->world, 1) ||
        fv_sim_road_clearance(&b->world->road, p[0], p[1]) < least ||
        fv_sim_road_clearance(&b->world->road, q[0], q[1]) < least)
        return false;
    p[2] = (p[2] < q[2] ? p[2] : q[2]) + foot;
    q[2] = p[2];
    /* The left side of the road is seen on its right side: from its far end to the near one. */
    put_wall(b, side > 0 ? p : q, side > 0 ? q : p, height, texture, texels_per_m,
             along + 7.0 * side);
    return true;
}

/* A house: its front, the side that is come towards, and a roof that leans back. */
static bool put_house(struct builder *b, int32_t side, double along, double length, double lateral)
{
    struct fv_sim_world *world = b->world;
    const uint16_t facade = b->facade[fv_random_below(&b->random, 4)];
    const double height = draw(b, 6, 12), depth = 8, roof = draw(b, 0, 4);
    double p[3], q[3], heading;
    if (!room_for(world, 4)) return false;
    beside(&world->road, along, side * lateral, p, &heading);
    beside(&world->road, along + length, side * lateral, q, &heading);
    const double ux = (q[0] - p[0]), uy = (q[1] - p[1]), n = __builtin_sqrt(ux * ux + uy * uy);
    const double bx = -side * uy / n, by = side * ux / n; /* away from the road */
    const double back[2][3] = {{p[0] + depth * bx, p[1] + depth * by, 0},
                               {q[0] + depth * bx, q[1] + depth * by, 0}};
    for (int32_t i = 0; i < 2; i++)
        if (fv_sim_road_clearance(&world->road, back[i][0], back[i][1]) < 7) return false;
    if (!put_along(b, side, along, length, lateral, height + 1.5, -1.5, facade, 0)) return false;
    const double foot = (p[2] < q[2] ? p[2] : q[2]) - 1.5;
    const double near[3] = {p[0], p[1], foot}, far[3] = {back[0][0], back[0][1], foot};
    put_wall(b, side > 0 ? far : near, side > 0 ? near : far, height + 1.5, facade, 0, 0);
    if (roof < 1) return true;
    const double *first = side > 0 ? p : q, *second = side > 0 ? q : p;
    const double origin[3] = {first[0], first[1], foot + height + 1.5},
                 u[3] = {second[0] - first[0], second[1] - first[1], 0},
                 v[3] = {0.5 * depth * bx, 0.5 * depth * by, roof};
    fv_sim_world_face(world, origin, u, v, b->roof,
                      light_on(&world->road, -bx * 0.6, -by * 0.6, 0.8));
    return true;
}

static struct fv_sim_round *put_round(struct builder *b, double x, double y, double z,
                                      double height, double radius, uint16_t texture, bool crown)
{
    if (b->world->round_count == FV_SIM_ROUNDS_MAX) return NULL;
    struct fv_sim_round *round = fv_sim_world_round(b->world, x, y, z, height, texture);
    const double angle = draw(b, 0, 2 * FV_PI);
    round->side[0] = fv_cos(angle);
    round->side[1] = fv_sin(angle);
    round->light = (float)draw(b, 0.75, 1.05);
    if (crown) { /* an ellipsoid */
        round->q1 = 4 * radius * radius / height;
        round->q2 = -round->q1 / height;
    } else {
        round->q0 = radius * radius;
    }
    return round;
}

/* A trunk, and a crown of a few ellipsoids. */
static void put_tree(struct builder *b, double x, double y, double z, double height, int32_t crowns)
{
    const double radius = height * draw(b, 0.18, 0.3);
    if (fv_sim_road_clearance(&b->world->road, x, y) < FV_SIM_ROAD_HALF_WIDTH_M + 1.0) return;
    put_round(b, x, y, z - 1, 0.45 * height + 1, 0.03 * height, b->bark, false);
    for (int32_t i = 0; i < crowns; i++) {
        /* The first in the middle, the others round it, lower and smaller. */
        const double angle = draw(b, 0, 2 * FV_PI), off = i > 0 ? draw(b, 0.5, 0.9) * radius : 0,
                     up = i > 0 ? draw(b, 0.22, 0.55) : 0.3,
                     size = i > 0 ? draw(b, 0.3, 0.6) : draw(b, 0.6, 0.9);
        put_round(b, x + off * fv_cos(angle), y + off * fv_sin(angle), z + up * height,
                  (i > 0 ? 1.2 * size * (1 - up) : 0.7) * height, radius * size, b->foliage[i % 2],
                  true);
    }
}

static void put_trees(struct builder *b, int32_t side, double low, double high, double every_m,
                      int32_t crowns)
{
    for (double along = draw(b, 0, every_m); along < FV_SIM_ROAD_LENGTH_M; /* NOLINT */
         along += every_m * draw(b, 0.5, 1.5)) {
        double p[3], heading;
        beside(&b->world->road, along, side * draw(b, low, high), p, &heading);
        put_tree(b, p[0], p[1], p[2] - 0.3, draw(b, 5, 13), crowns);
    }
}

/* Fences, hedges and rails: pieces of one texture, again and again. */
static void put_fences(struct builder *b, int32_t side, double lateral, double height,
                       uint16_t texture, uint32_t in_100)
{
    bool on = chance(b, in_100);
    for (double along = 0; along < FV_SIM_ROAD_LENGTH_M - 8;) { /* NOLINT */
        const double k = fv_sim_road_curvature(&b->world->road, along),
                     length = k > 0.02 || k < -0.02 ? 4 : 8;
        if (on) put_along(b, side, along, length, lateral, height + 0.3, -0.3, texture, 32);
        if (chance(b, 12)) on = chance(b, in_100);
        along += length;
    }
}

static void put_houses(struct builder *b, int32_t side, double low, double high, double gap_most)
{
    for (double along = draw(b, 0, 8); along < FV_SIM_ROAD_LENGTH_M - 16;) { /* NOLINT */
        const double length = draw(b, 9, 16);
        put_house(b, side, along, length, draw(b, low, high));
        along += length + (chance(b, 40) ? draw(b, 1, gap_most) : 0);
    }
}

static void put_parked(struct builder *b, int32_t side, double lateral, uint32_t in_100)
{
    bool on = chance(b, in_100);
    for (double along = draw(b, 4, 10); along < FV_SIM_ROAD_LENGTH_M - 8; /* NOLINT */
         along += draw(b, 5.6, 7.5)) {
        if (chance(b, 15)) on = chance(b, in_100);
        if (!on || chance(b, 15) || !room_for(b->world, 11)) continue;
        const uint32_t paint = fv_random_below(&b->random, 3);
        const struct fv_sim_car car = {
            .shape = chance(b, 80) ? FV_SIM_CAR : FV_SIM_VAN,
            .paint = b->car[paint],
            .glass = b->glass,
            .lateral_m = side * lateral,
        };
        fv_sim_road_car_put(b->world, &car, along, side > 0, 0);
    }
}

/* Reflector posts of a highway. */
static void put_posts(struct builder *b, int32_t side)
{
    for (double along = 5; along < FV_SIM_ROAD_LENGTH_M; along += 25) { /* NOLINT */
        double p[3], heading;
        beside(&b->world->road, along, side * 4.7, p, &heading);
        if (!room_for(b->world, 4)) return;
        fv_sim_world_box(b->world, p, p[2] - 0.2, (const double[3]){0.1, 0.12, 1.2}, heading,
                         b->post, b->post, 15, 0);
    }
}

/* ---- sceneries ------------------------------------------------------------------------------- */

static void street(struct builder *b)
{
    for (int32_t side = -1; side <= 1; side += 2) {
        put_houses(b, side, 8.0, 10.0, 6);
        put_parked(b, side, 5.1, 60);
        put_trees(b, side, 6.3, 7.0, 28, 5);
        put_fences(b, side, 7.4, 1.1, b->fence, 30);
    }
}

static void suburb(struct builder *b)
{
    for (int32_t side = -1; side <= 1; side += 2) {
        put_fences(b, side, 7.0, side > 0 ? 1.3 : 1.6, side > 0 ? b->fence : b->hedge, 70);
        put_houses(b, side, 13, 20, 25);
        put_trees(b, side, 8, 15, 16, 5);
        put_parked(b, side, 5.1, 25);
    }
}

static void highway(struct builder *b)
{
    for (int32_t side = -1; side <= 1; side += 2) {
        put_fences(b, side, 5.6, 0.9, b->post, side > 0 ? 75 : 40);
        put_posts(b, side);
        put_trees(b, side, 14, 45, 10, 4);
        put_fences(b, side, draw(b, 28, 45), 9, b->hedge, 70);
    }
}

static void open_builder(struct builder *b, struct fv_sim_world *world)
{
    const double length = strip_m, wide = 2 * FV_SIM_ROAD_HALF_WIDTH_M;
    const bool paved = world->road.scenery == FV_SIM_STREET;
    *b = (struct builder){.world = world};
    fv_random_seed(&b->random, world->seed ^ 0x5EE2u);
    b->asphalt[0] = fv_sim_world_texture(world, FV_SIM_ROAD_ASPHALT, length, wide, 40, false);
    b->asphalt[1] = fv_sim_world_texture(world, FV_SIM_ROAD_SHADED, length, wide, 40, false);
    b->asphalt[2] = b->asphalt[0];
    for (int32_t i = 0; i < 2; i++) {
        b->verge[i] = fv_sim_world_texture(world, paved ? FV_SIM_ROAD_PAVEMENT : FV_SIM_ROAD_GRASS,
                                           length, verge_m, 24, false);
        b->foliage[i] = fv_sim_world_texture(world, FV_SIM_ROAD_FOLIAGE, 12, 5, 48, false);
    }
    for (int32_t i = 0; i < 4 && world->road.scenery != FV_SIM_HIGHWAY; i++)
        b->facade[i] = fv_sim_world_texture(world, FV_SIM_ROAD_FACADE, 14, 10, 40, false);
    b->roof = fv_sim_world_texture(world, FV_SIM_ROAD_ROOF, 14, 5, 32, false);
    b->bark = fv_sim_world_texture(world, FV_SIM_ROAD_BARK, 1.5, 4, 48, false);
    b->fence = fv_sim_world_texture(world, FV_SIM_ROAD_FENCE, 24, 1.6, 32, false);
    b->hedge = fv_sim_world_texture(world, FV_SIM_ROAD_FOLIAGE, 40, 4, 32, false);
    b->post = fv_sim_world_texture(world, FV_SIM_ROAD_RAIL, 24, 1.2, 32, false);
    b->ground = fv_sim_world_texture(world, FV_SIM_ROAD_GRASS, 100, 100, 8, false);
    for (int32_t i = 0; i < 3; i++) {
        b->car[i] = fv_sim_world_texture(world, FV_SIM_ROAD_CAR, 6.2, 0.9, 96, false);
    }
    b->glass = fv_sim_world_texture(world, FV_SIM_ROAD_GLASS, 2.6, 0.7, 96, false);
}

void fv_sim_place_road(struct fv_sim_world *world, const struct fv_sim_options *options)
{
    struct builder b;
    fv_sim_road_path_create(&world->road, world->seed);
    fv_sim_road_lens_create(&world->road, world->seed);
    open_builder(&b, world);
    put_sky(&b);
    put_ground(&b);
    switch (world->road.scenery) {
    case FV_SIM_STREET:
        street(&b);
        break;
    case FV_SIM_SUBURB:
        suburb(&b);
        break;
    default:
        highway(&b);
        break;
    }
    fv_sim_road_cars_create(world, options);
}
