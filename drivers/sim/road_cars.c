#include "sim.h"

/* Cars: a body, a cabin with leaning windows on it, and their shadow; vans and trucks are boxes.
 * They stand beside the road, go ahead of the camera, overtake on the left or come towards it. */

static const struct {
    double length, width, body, cabin; /* m: of the body's top and the cabin's height */
} sizes[FV_SIM_CAR_SHAPE_COUNT] = {
    [FV_SIM_CAR] = {4.4, 1.8, 0.72, 0.55},
    [FV_SIM_VAN] = {5.2, 2.0, 1.85, 0},
    [FV_SIM_TRUCK] = {9.0, 2.5, 2.8, 0},
};
static const double clearance_m = 0.18;

/* In the car's own frame: x ahead, y to the left, z up from the ground. */
struct frame {
    struct fv_sim_world *world;
    double position[3], c, s;
    uint16_t object;
};

static double light_on(const struct fv_sim_road *road, const double n[3])
{
    const double sun = n[0] * road->sun[0] + n[1] * road->sun[1] + n[2] * road->sun[2];
    return 0.22 + 0.44 * (sun > 0 ? sun : 0);
}

/* A face from a corner along u and v, all of the frame. */
static struct fv_sim_face *put(const struct frame *f, const double corner[3], const double u[3],
                               const double v[3], uint16_t texture)
{
    const double *from[3] = {corner, u, v};
    double to[3][3], n[3];
    for (int32_t i = 0; i < 3; i++) {
        to[i][0] = f->c * from[i][0] - f->s * from[i][1] + (i == 0 ? f->position[0] : 0);
        to[i][1] = f->s * from[i][0] + f->c * from[i][1] + (i == 0 ? f->position[1] : 0);
        to[i][2] = from[i][2] + (i == 0 ? f->position[2] : 0);
    }
    for (int32_t i = 0; i < 3; i++)
        n[i] = to[1][(i + 1) % 3] * to[2][(i + 2) % 3] - to[1][(i + 2) % 3] * to[2][(i + 1) % 3];
    const double size = __builtin_sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int32_t i = 0; i < 3; i++)
        n[i] /= size;
    struct fv_sim_face *face =
        fv_sim_world_face(f->world, to[0], to[1], to[2], texture, light_on(&f->world->road, n));
    if (face != NULL) face->object = f->object;
    return face;
}

/* The part of a car's texture that shows its side, or its end. */
static void show(struct fv_sim_face *face, bool end)
{
    if (face == NULL) return;
    const float width = face->tex_du;
    face->tex_u = end ? 0.75f * width : 0;
    face->tex_du = end ? 0.25f * width : 0.75f * width;
}

/* The plain upper edge of the side: no wheels. */
static void show_plain(struct fv_sim_face *face)
{
    if (face == NULL) return;
    show(face, false);
    face->tex_v *= 0.3f;
    face->tex_dv *= 0.25f;
}

/* The five sides of a box of which `z` is the foot. */
static void put_body(const struct frame *f, double length, double width, double z, double height,
                     uint16_t paint)
{
    const double x = length / 2, y = width / 2, up[3] = {0, 0, height};
    const double ahead[3] = {length, 0, 0}, back[3] = {-length, 0, 0}, left[3] = {0, width, 0},
                 right[3] = {0, -width, 0};
    show(put(f, (const double[3]){-x, -y, z}, ahead, up, paint), false);
    show(put(f, (const double[3]){x, y, z}, back, up, paint), false);
    show(put(f, (const double[3]){x, -y, z}, left, up, paint), true);
    show(put(f, (const double[3]){-x, y, z}, right, up, paint), true);
    show_plain(put(f, (const double[3]){-x, -y, z + height}, ahead, left, paint));
}

/* Windows that lean in by `lean` at the front and the back, and a roof. */
static void put_cabin(const struct frame *f, double begin, double end, double width, double z,
                      double height, uint16_t glass, uint16_t paint)
{
    const double lean = 0.55, length = end - begin, y = width / 2;
    for (int32_t k = 0; k < 2; k++) {
        const double x = k == 0 ? begin : end, yy = k == 0 ? -y : y, way = k == 0 ? 1 : -1;
        struct fv_sim_face *side =
            put(f, (const double[3]){x, yy, z}, (const double[3]){way * length, 0, 0},
                (const double[3]){0, 0, height}, glass);
        if (side != NULL) { /* u from lean v to length - lean v */
            side->is_cut = true;
            side->cut[0][1] = length;
            side->cut[0][2] = -lean;
            side->cut[1][0] = length;
            side->cut[1][1] = -length;
            side->cut[1][2] = -lean;
        }
        put(f, (const double[3]){k == 0 ? begin : end, k == 0 ? y : -y, z},
            (const double[3]){0, k == 0 ? -width : width, 0},
            (const double[3]){way * lean, 0, height}, glass);
    }
    show_plain(put(f, (const double[3]){begin + lean, -y, z + height},
                   (const double[3]){length - 2 * lean, 0, 0}, (const double[3]){0, width, 0},
                   paint));
}

void fv_sim_road_car_put(struct fv_sim_world *world, const struct fv_sim_car *car, double along_m,
                         bool back, uint16_t object)
{
    struct frame f = {.world = world, .object = 0};
    double heading, slope;
    fv_sim_road_at(&world->road, along_m, f.position, &heading, &slope);
    f.position[0] -= car->lateral_m * fv_sin(heading);
    f.position[1] += car->lateral_m * fv_cos(heading);
    if (back) heading += FV_PI;
    f.c = fv_cos(heading);
    f.s = fv_sin(heading);
    const double length = sizes[car->shape].length, width = sizes[car->shape].width,
                 body = sizes[car->shape].body;
    struct fv_sim_face *shadow = put(
        &f, (const double[3]){-length / 2 - 0.15, -width / 2 - 0.15, 0.03},
        (const double[3]){length + 0.3, 0, 0}, (const double[3]){0, width + 0.3, 0}, car->glass);
    if (shadow == NULL) return;
    shadow->light = 0.35f;
    shadow->truth_class = FOVEA_TRUTH_FLOOR;
    f.object = object;
    put_body(&f, length, width, clearance_m, body, car->paint);
    if (sizes[car->shape].cabin > 0)
        put_cabin(&f, -1.9, 1.0, width - 0.2, clearance_m + body, sizes[car->shape].cabin,
                  car->glass, car->paint);
}

/* ---- those that move ------------------------------------------------------------------------- */

static double draw(struct fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

static enum fv_sim_car_shape draw_shape(struct fv_random *random)
{
    const uint32_t kind = fv_random_below(random, 10);
    return kind < 4 ? FV_SIM_CAR : kind < 6 ? FV_SIM_VAN : FV_SIM_TRUCK;
}

/* The first may go ahead of the camera; then they come towards it, and on a highway they overtake.
 */
static void choose(struct fv_sim_car *car, const struct fv_sim_road *road, int32_t number,
                   struct fv_random *random)
{
    const bool leads = number == 0 && fv_random_below(random, 2) == 0;
    const bool overtakes = road->scenery == FV_SIM_HIGHWAY;
    car->shape = draw_shape(random);
    if (leads) {
        car->follows = true;
        car->lateral_m = -1.75;
        car->along_m = draw(random, 11, 24) + sizes[car->shape].length / 2;
        car->speed_m_s = draw(random, 0, 0.6);
    } else if (overtakes) {
        car->follows = true;
        car->lateral_m = 1.9;
        car->along_m = draw(random, 4, 10) + 14 * (number - 1);
        car->speed_m_s = draw(random, 0.5, 2.0);
    } else {
        car->lateral_m = 1.9;
        car->along_m = draw(random, 25, 70) + 60 * number;
        car->speed_m_s = -draw(random, 6, 12);
    }
}

void fv_sim_road_cars_create(struct fv_sim_world *world, const struct fv_sim_options *options)
{
    struct fv_random random;
    fv_random_seed(&random, world->seed ^ 0xCA25u);
    const uint16_t glass = fv_sim_world_texture(world, FV_SIM_ROAD_GLASS, 2.6, 0.7, 96, false);
    for (int32_t i = 0; i < options->objects && i < FV_SIM_ROAD_CARS_MAX; i++) {
        struct fv_sim_car *car = &world->road.car[world->road.car_count++];
        choose(car, &world->road, i, &random);
        const double length = sizes[car->shape].length, height = sizes[car->shape].body;
        const enum fv_sim_material paint =
            car->shape == FV_SIM_TRUCK ? FV_SIM_ROAD_TRUCK : FV_SIM_ROAD_CAR;
        car->paint =
            fv_sim_world_texture(world, paint, length + sizes[car->shape].width, height, 96, false);
        car->glass = glass;
        world->object[world->object_count++] =
            (struct fv_sim_object){.object_class = FOVEA_TRUTH_BOX};
    }
}

void fv_sim_road_cars_place(struct fv_sim_world *world, double time_s)
{
    for (int32_t i = 0; i < world->road.car_count; i++) {
        const struct fv_sim_car *car = &world->road.car[i];
        double speed, along = car->along_m;
        if (car->follows)
            along += fv_sim_road_way(&world->road, time_s, &speed) +
                     4 * fv_sin(0.25 * car->speed_m_s * time_s + i);
        else
            along += fv_sim_road_way(&world->road, 0, &speed) + car->speed_m_s * time_s;
        if (along < 3 || along > FV_SIM_ROAD_LENGTH_M - 3) continue;
        fv_sim_road_car_put(world, car, along, car->speed_m_s < 0, (uint16_t)(i + 1));
    }
}
