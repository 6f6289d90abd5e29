#include "runtime/ground.h"

#include <string.h>

#include "geometry/vec.h"

enum { POINTS = 256, SAMPLES = 64 }; /* a fit is a unit of some 0.2 ms */

static const double look_each_m = 0.5;

void fv_ground_stage_carve(struct fv_ground_stage *stage,
                           const struct fovea_grid_job_config *config, struct fv_arena *persistent,
                           struct fv_arena *job)
{
    stage->enabled = config->enabled;
    if (!stage->enabled) return;
    stage->config = *config;
    stage->state = fv_arena_take(persistent, 1, sizeof *stage->state);
    stage->points = fv_arena_take(job, POINTS, sizeof *stage->points);
}

void fv_ground_stage_reset(struct fv_ground_stage *stage)
{
    if (stage->enabled) memset(stage->state, 0, sizeof *stage->state);
}

/* ---- poses ----------------------------------------------------------------------------------- */

static void begin(struct fv_ground_stage *stage)
{
    const double rad_per_deg = 0.017453292519943295;
    struct fv_ground_stage_state *s = stage->state;
    if (s->begun) return;
    s->begun = 1;
    fv_random_seed(&s->random, 1);
    fv_ground_init(&s->ground, stage->config.tilt_sigma_deg * rad_per_deg,
                   stage->config.height_sigma_m);
}

/* Gravity by its last estimate, in the axes that an earlier one gave to odom. */
static void level(struct fv_ground_stage *stage, const struct fv_publish *publish,
                  const struct fv_inertial_known *inertial)
{
    double g[3];
    if (inertial == NULL || !inertial->settled || !publish->state->is_upright) return;
    fv_publish_turn(publish, inertial->gravity, g);
    if (!(g[2] < 0)) return;
    const double slope[2] = {-g[0] / g[2], -g[1] / g[2]};
    fv_ground_level(&stage->state->ground, slope, inertial->gravity_sigma);
}

void fv_ground_stage_follow(struct fv_ground_stage *stage, const struct fv_publish *publish,
                            const struct fv_inertial_known *inertial)
{
    if (!stage->enabled) return;
    struct fv_ground_stage_state *s = stage->state;
    if (!fv_free_space_metric(publish)) return;
    begin(stage);
    const struct fv_free_space_world world = fv_free_space_world_of(publish);
    if (!fv_free_space_same(world, s->world)) {
        s->world = world;
        s->looked = 0;
        s->phase = FV_GROUND_IDLE;
        fv_ground_place(&s->ground);
    }
    const struct fv_se3 T_odom_body = fv_publish_child_pose(publish, FV_PUBLISH_BODY);
    fv_ground_drive(&s->ground, &T_odom_body);
    level(stage, publish, inertial);
}

bool fv_ground_stage_at(const struct fv_ground_stage *stage, const double position[2],
                        struct fv_ground_plane *plane)
{
    return stage->enabled && fv_ground_at(&stage->state->ground, position, plane);
}

void fv_ground_stage_mount(const struct fv_ground_stage *stage, struct fovea_ground *ground)
{
    const struct fv_ground *g = &stage->state->ground;
    ground->mount_slope[0] = g->x[3];
    ground->mount_slope[1] = g->x[4];
    ground->mount_height_m = g->x[5];
    for (int i = 0; i < 3; i++)
        ground->mount_sigma[i] = __builtin_sqrt(g->P[(FV_GROUND_SIZE + 1) * (i + 3)]);
    ground->landmarks_taken = g->taken;
    ground->landmarks_refused = g->refused;
}

/* ---- landmarks ------------------------------------------------------------------------------- */

/* A mask as points of the last frame's camera, in units of the map, see it. */
struct floor_pixels {
    struct fv_grid_look look;
    struct fv_se3 T_seen_now; /* camera, from the last frame's */
    double metres;            /* per unit of the map */
};

static bool lies_on_floor(const void *context, const double point[3])
{
    const struct floor_pixels *pixels = context;
    double p[3];
    for (int i = 0; i < 3; i++)
        p[i] = pixels->metres * point[i];
    fv_se3_apply(&pixels->T_seen_now, p, p);
    return fv_grid_label(&pixels->look, p) == FOVEA_GRID_FLOOR;
}

static struct floor_pixels pixels_of(const struct fovea_grid_view *view,
                                     const struct fv_se3 *T_odom_cam, double metres)
{
    struct floor_pixels pixels = {.look = fv_grid_look_of(view), .metres = metres};
    struct fv_se3 T;
    fv_se3_from_rows(view->T_odom_cam, &T);
    fv_se3_invert(&T, &T);
    fv_se3_compose(&T, T_odom_cam, &pixels.T_seen_now);
    return pixels;
}

static bool is_due(const struct fv_ground_stage *stage, const struct fv_publish *publish)
{
    const struct fv_ground_stage_state *s = stage->state;
    return fv_free_space_metric(publish) &&
           fv_publish_pose(publish)->state != FOVEA_TRACKING_COASTING && s->ground.placed &&
           (!s->looked || s->ground.driven_m - s->looked_m >= look_each_m);
}

static struct fv_floor_look look_of(const struct fv_ground_stage *stage)
{
    struct fv_ground_stage_state *s = stage->state;
    struct fv_floor_look look = {
        .random = &s->random, .points = stage->points, .points_max = POINTS, .samples = SAMPLES};
    fv_copy3(s->down, look.down);
    return look;
}

/* From where the last frame sees the floor. */
static void gather_begin(struct fv_ground_stage *stage, const struct fv_odometry *odometry,
                         const struct fv_scale *scale, const struct fv_publish *publish)
{
    struct fv_ground_stage_state *s = stage->state;
    const struct fv_scale_value value = fv_scale_get(scale);
    s->T_odom_cam = fv_publish_child_pose(publish, FV_PUBLISH_CAMERA);
    s->metres = value.metres;
    s->height_sigma = value.source == FOVEA_SCALE_CAMERA_HEIGHT ? __builtin_inf() : value.sigma;
    fv_ground_down(&s->ground, &s->T_odom_cam, s->down);
    s->gather = fv_scale_gather_begin(odometry);
    s->phase = FV_GROUND_GATHERING;
    s->looked = 1;
    s->looked_m = s->ground.driven_m;
}

/* Points of the floor, a piece. */
static void gather(struct fv_ground_stage *stage, const struct fovea_grid_view *view,
                   const struct fv_odometry *odometry)
{
    struct fv_ground_stage_state *s = stage->state;
    const struct floor_pixels pixels = pixels_of(view, &s->T_odom_cam, s->metres);
    struct fv_floor_look look = look_of(stage);
    look.takes = lies_on_floor;
    look.context = &pixels;
    if (fv_scale_gather_floor(odometry, &look, &s->gather)) s->phase = FV_GROUND_GATHERED;
}

/* A first fit shows how well the points are known, a second one measures the floor. */
static void fit(struct fv_ground_stage *stage)
{
    struct fv_ground_stage_state *s = stage->state;
    const struct fv_floor_look look = look_of(stage);
    const bool first = s->phase == FV_GROUND_GATHERED;
    struct fv_floor floor;
    s->phase = FV_GROUND_IDLE;
    if (!fv_scale_fit_floor(&look, s->gather.count, &floor)) return;
    if (first) {
        fv_scale_sharpen_floor(&look, s->gather.count, &floor);
        fv_copy3(floor.down, s->down);
        s->phase = FV_GROUND_SHARPENED;
        return;
    }
    fv_floor_in_metres(&floor, s->metres);
    (void)fv_ground_see(&s->ground, &s->T_odom_cam, &floor, s->height_sigma);
}

bool fv_ground_stage_look(struct fv_ground_stage *stage, const struct fovea_grid_view *view,
                          const struct fv_odometry *odometry, const struct fv_scale *scale,
                          const struct fv_publish *publish)
{
    if (!stage->enabled) return false;
    struct fv_ground_stage_state *s = stage->state;
    if (s->phase >= FV_GROUND_GATHERED) {
        fit(stage);
        return true;
    }
    if (s->phase == FV_GROUND_GATHERING && s->seen_ns != view->seen->stamp_ns)
        s->phase = FV_GROUND_IDLE; /* what was gathered is of another mask */
    if (s->phase == FV_GROUND_IDLE) {
        if (s->seen_ns == view->seen->stamp_ns || !is_due(stage, publish)) return false;
        s->seen_ns = view->seen->stamp_ns;
        gather_begin(stage, odometry, scale, publish);
    }
    gather(stage, view, odometry);
    return true;
}
