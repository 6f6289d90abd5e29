#include "sim.h"

/* Moving objects: four classes, each of one size, on closed lanes that keep clear of the camera and
 * the furniture but cross in the picture, so that they occlude one another. */

static const double ball_radius_m = 0.15;
static const double cone_radius_m = 0.18, cone_height_m = 0.50, cone_plate_m = 0.40,
                    cone_plate_height_m = 0.03;
static const double box_size_m[3] = {0.40, 0.30, 0.30};
static const double leg_radius_m = 0.14, leg_height_m = 0.85;
static const double torso_radius_m = 0.22, torso_base_m = 0.60, torso_height_m = 0.92;
static const double head_radius_m = 0.115, head_base_m = 1.485; /* top at 1.715 */

enum { VARIANTS = 3 };
static const double ring_corner_m = 0.9;

/* ---- lanes ----------------------------------------------------------------------------------- */

double fv_sim_ring_length(const double half[2], double corner)
{
    return 4.0 * (half[0] + half[1] - 2.0 * corner) + 2.0 * FV_PI * corner;
}

void fv_sim_ring(const double half[2], double corner, double along, double position[2],
                 double *heading)
{
    const double arc = 0.5 * FV_PI * corner, length = fv_sim_ring_length(half, corner);
    along -= length * fv_floor(along / length);
    /* Anticlockwise from the middle of nothing: side k runs in direction k * 90 degrees, then an
     * arc to the left. */
    for (int32_t k = 0; k < 4; k++) {
        const double straight = 2.0 * (((k & 1) ? half[1] : half[0]) - corner),
                     turn = 0.5 * FV_PI * k;
        const double c = (k == 0) - (k == 2), s = (k == 1) - (k == 3); /* cos and sin of turn */
        const double side = (k & 1) ? half[0] : half[1], reach = (k & 1) ? half[1] : half[0];
        double x = along - (reach - corner), y = -side; /* in the side's own axes */
        *heading = turn;
        if (along > straight && (along <= straight + arc || k == 3)) {
            const double angle = (along - straight) / corner;
            x = reach - corner + corner * fv_sin(angle);
            y = -side + corner * (1.0 - fv_cos(angle));
            *heading = turn + angle;
        }
        position[0] = c * x - s * y;
        position[1] = s * x + c * y;
        if (along <= straight + arc) return;
        along -= straight + arc;
    }
}

void fv_sim_object_pose(const struct fv_sim_object *o, double time_s, double position[2],
                        double *heading)
{
    if (o->on_ring) {
        const double along = o->phase + o->rate * time_s;
        fv_sim_ring(o->radius, ring_corner_m, along, position, heading);
        if (o->rate < 0.0) *heading += FV_PI;
        return;
    }
    const double angle = o->phase + o->rate * time_s;
    const double wobble = 1.0 + o->wobble * fv_sin(o->wobble_rate * time_s + o->wobble_phase);
    const double slope =
        o->wobble * o->wobble_rate * fv_cos(o->wobble_rate * time_s + o->wobble_phase);
    const double c = fv_cos(angle), s = fv_sin(angle);
    position[0] = o->center[0] + o->radius[0] * wobble * c;
    position[1] = o->center[1] + o->radius[1] * wobble * s;
    *heading = fv_atan2(o->radius[1] * (wobble * c * o->rate + slope * s),
                        o->radius[0] * (slope * c - wobble * s * o->rate));
}

/* ---- creation -------------------------------------------------------------------------------- */

static double draw(struct fv_random *random, double low, double high)
{
    return low + (high - low) * fv_random_unit(random);
}

/* Ellipses in a room: persons walk outside of the camera's way, low things roll below it. */
static void choose_ellipse(struct fv_sim_object *o, const struct fv_sim_world *world,
                           int32_t number, struct fv_random *random)
{
    double x = world->room[0], y = world->room[1], speed = draw(random, 0.2, 0.6);
    o->wobble = draw(random, 0.0, 0.04);
    if (world->lane[0] <= 0.0 && x > 10.0) { /* the hall: the middle is the camera's */
        x = o->object_class == FOVEA_TRUTH_PERSON ? draw(random, 8.6, 9.2) : draw(random, 1.5, 8.5);
        y = o->object_class == FOVEA_TRUTH_PERSON ? draw(random, 6.1, 6.6) : draw(random, 1.0, 6.0);
        o->wobble *= 0.5;
    } else if (o->object_class == FOVEA_TRUTH_PERSON) {
        /* Persons of one lane keep their distance: same speed, spread over the lane. */
        const int32_t lane = number & 1, place = number / 2;
        x -= 1.05 + 0.45 * lane;
        y -= 0.95 + 0.40 * lane;
        o->radius[0] = x;
        o->radius[1] = y;
        o->rate = lane ? -0.25 : 0.21;
        o->phase = (double)(world->seed % 628u) * 0.01 + 1.1 * place + 0.8 * lane;
        o->wobble_phase = draw(random, 0.0, 2.0 * FV_PI);
        o->wobble_rate = 0.4;
        o->wobble = 0.01;
        return;
    } else {
        const double fraction = draw(random, 0.25, 0.78);
        x = fraction * (x - 0.9);
        y = fraction * (y - 0.9);
    }
    o->radius[0] = x;
    o->radius[1] = y;
    o->rate = speed / (0.5 * (x + y)) * (fv_random_below(random, 2) ? 1.0 : -1.0);
    o->phase = draw(random, 0.0, 2.0 * FV_PI);
    o->wobble_rate = draw(random, 0.3, 0.9);
    o->wobble_phase = draw(random, 0.0, 2.0 * FV_PI);
}

static void choose_ring(struct fv_sim_object *o, const struct fv_sim_world *world, int32_t number,
                        struct fv_random *random)
{
    /* Persons keep to the side; low things may be nearer to the middle. */
    const double aside = (o->object_class == FOVEA_TRUTH_PERSON ? 0.80 : draw(random, 0.45, 0.8)) *
                         ((number & 1) ? 1.0 : -1.0);
    o->on_ring = true;
    o->radius[0] = world->lane[0] + aside;
    o->radius[1] = world->lane[1] + aside;
    o->rate = draw(random, 0.3, 0.9);
    if (fv_random_below(random, 2)) o->rate = -o->rate;
    o->phase = draw(random, 0.0, fv_sim_ring_length(o->radius, ring_corner_m));
}

void fv_sim_objects_create(struct fv_sim_world *world, const struct fv_sim_options *options)
{
    static const enum fovea_truth_class order[4] = {FOVEA_TRUTH_PERSON, FOVEA_TRUTH_BALL,
                                                    FOVEA_TRUTH_BOX, FOVEA_TRUTH_CONE};
    static const enum fv_sim_material material[FOVEA_TRUTH_OBJECT_COUNT] = {
        FV_SIM_CLOTHES, FV_SIM_BALL, FV_SIM_CONE, FV_SIM_PARCEL, FV_SIM_CLOTHES};
    uint16_t variant[FOVEA_TRUTH_OBJECT_COUNT][VARIANTS] = {{0}}, head[VARIANTS] = {0};
    struct fv_random random;
    fv_random_seed(&random, world->seed ^ 0x0B7EC75u);
    for (int32_t c = 1; c < FOVEA_TRUTH_OBJECT_COUNT; c++) {
        for (int32_t k = 0; k < VARIANTS && k * 4 < options->objects; k++)
            variant[c][k] = fv_sim_world_texture(world, material[c], 1.0, 1.0, 128.0, false);
    }
    for (int32_t k = 0; k < VARIANTS && k * 4 < options->objects; k++)
        head[k] = fv_sim_world_texture(world, FV_SIM_HEAD, 1.0, 1.0, 64.0, false);
    const bool has_room = world->room[0] > 0.0, has_ring = world->lane[0] > 0.0;
    for (int32_t i = 0; i < options->objects; i++) {
        struct fv_sim_object *o = &world->object[world->object_count++];
        const int32_t number = i / 4;
        *o = (struct fv_sim_object){.object_class = order[i % 4]};
        o->texture = variant[o->object_class][number % VARIANTS];
        o->texture_head = head[number % VARIANTS];
        if (has_ring && (!has_room || (number & 1)))
            choose_ring(o, world, number, &random);
        else
            choose_ellipse(o, world, has_ring ? number / 2 : number, &random);
    }
}

/* Nearest that a person comes to the camera between two times. */
static double clearance(const struct fv_sim_object *o, const struct fv_sim_motion *motion,
                        double begin_s, double end_s)
{
    double least = 1e9;
    /* A step more or less is no matter.
     * NOLINTNEXTLINE(clang-analyzer-security.FloatLoopCounter) */
    for (double t = begin_s; t < end_s; t += 0.1) {
        double position[2], heading, T_world_cam[12];
        fv_sim_object_pose(o, t, position, &heading);
        fv_sim_motion_pose(motion, t, T_world_cam);
        const double dx = position[0] - T_world_cam[3], dy = position[1] - T_world_cam[7],
                     square = dx * dx + dy * dy;
        if (square < least) least = square;
    }
    return __builtin_sqrt(least);
}

void fv_sim_objects_clear(struct fv_sim_world *world, const struct fv_sim_motion *motion,
                          double begin_s, double end_s)
{
    const double enough_m = 0.75;
    enum { TRIES = 24 };
    for (int32_t i = 0; i < world->object_count; i++) {
        struct fv_sim_object *o = &world->object[i];
        if (o->object_class != FOVEA_TRUTH_PERSON) continue;
        double best = -1.0, best_phase = o->phase;
        for (int32_t k = 0; k < TRIES && best < enough_m; k++) {
            const double least = clearance(o, motion, begin_s, end_s);
            if (least > best) {
                best = least;
                best_phase = o->phase;
            }
            o->phase += 0.53;
        }
        o->phase = best_phase;
    }
}

/* ---- placing --------------------------------------------------------------------------------- */

static struct fv_sim_round *put_round(struct fv_sim_world *world, const double position[2],
                                      double z, double height, uint16_t texture, double heading,
                                      int32_t id)
{
    struct fv_sim_round *round =
        fv_sim_world_round(world, position[0], position[1], z, height, texture);
    if (round == NULL) return NULL;
    round->side[0] = fv_cos(heading);
    round->side[1] = fv_sin(heading);
    round->object = (uint16_t)id;
    return round;
}

/* `way`: metres that it has rolled. */
static void put_ball(struct fv_sim_world *world, const struct fv_sim_object *o,
                     const double position[2], double heading, double way, int32_t id)
{
    const double c = fv_cos(heading), s = fv_sin(heading), r = ball_radius_m;
    const double roll = (way < 0.0 ? -way : way) / r, cr = fv_cos(roll), sr = fv_sin(roll);
    struct fv_sim_round *round =
        fv_sim_world_round(world, position[0] + r * s, position[1] - r * c, r, 2.0 * r, o->texture);
    if (round == NULL) return;
    /* It rolls about the horizontal axis across its way. */
    round->axis[0] = -s;
    round->axis[1] = c;
    round->axis[2] = 0.0;
    round->side[0] = c * cr;
    round->side[1] = s * cr;
    round->side[2] = -sr;
    round->q1 = 2.0 * r;
    round->q2 = -1.0;
    round->object = (uint16_t)id;
}

static void put_cone(struct fv_sim_world *world, const struct fv_sim_object *o,
                     const double position[2], double heading, int32_t id)
{
    const double slope = cone_radius_m / cone_height_m, z = cone_plate_height_m;
    struct fv_sim_round *round =
        put_round(world, position, z, cone_height_m - z, o->texture, heading, id);
    if (round != NULL) {
        const double radius = slope * (cone_height_m - z);
        round->q0 = radius * radius;
        round->q1 = -2.0 * radius * slope;
        round->q2 = slope * slope;
    }
    const double size[3] = {cone_plate_m, cone_plate_m, cone_plate_height_m};
    const int32_t first = world->face_count;
    fv_sim_world_box(world, position, 0.0, size, heading, o->texture_head, o->texture_head, 31,
                     0.0);
    for (int32_t i = first; i < world->face_count; i++) {
        world->face[i].object = (uint16_t)id;
        world->face[i].light *= 0.45f;
    }
}

static void put_person(struct fv_sim_world *world, const struct fv_sim_object *o,
                       const double position[2], double heading, int32_t id)
{
    struct fv_sim_round *legs =
        put_round(world, position, 0.0, leg_height_m, o->texture, heading, id);
    struct fv_sim_round *torso =
        put_round(world, position, torso_base_m, torso_height_m, o->texture, heading, id);
    struct fv_sim_round *head =
        put_round(world, position, head_base_m, 2.0 * head_radius_m, o->texture_head, heading, id);
    if (head == NULL) return;
    legs->q0 = leg_radius_m * leg_radius_m;
    legs->light = 0.6f;
    const double square = 4.0 * torso_radius_m * torso_radius_m / torso_height_m;
    torso->q1 = square;
    torso->q2 = -square / torso_height_m;
    head->q1 = 2.0 * head_radius_m;
    head->q2 = -1.0;
}

void fv_sim_world_place(struct fv_sim_world *world, double time_s)
{
    world->face_count = world->static_faces;
    world->round_count = world->static_rounds;
    if (world->road.car_count > 0) {
        fv_sim_road_cars_place(world, time_s);
        return;
    }
    for (int32_t i = 0; i < world->object_count; i++) {
        const struct fv_sim_object *o = &world->object[i];
        double position[2], heading,
            way = o->rate * time_s * (o->on_ring ? 1.0 : 0.5 * (o->radius[0] + o->radius[1]));
        if (world->drive.tick_count > 0)
            fv_sim_drive_mover(&world->drive, i, time_s, position, &heading, &way);
        else
            fv_sim_object_pose(o, time_s, position, &heading);
        const int32_t id = i + 1;
        if (o->object_class == FOVEA_TRUTH_BALL) put_ball(world, o, position, heading, way, id);
        if (o->object_class == FOVEA_TRUTH_CONE) put_cone(world, o, position, heading, id);
        if (o->object_class == FOVEA_TRUTH_PERSON) put_person(world, o, position, heading, id);
        if (o->object_class == FOVEA_TRUTH_BOX) {
            const int32_t first = world->face_count;
            fv_sim_world_box(world, position, 0.0, box_size_m, heading, o->texture, o->texture, 31,
                             0.0);
            for (int32_t k = first; k < world->face_count; k++)
                world->face[k].object = (uint16_t)id;
        }
    }
}
