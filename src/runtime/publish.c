#include "runtime/publish.h"

#include <string.h>

#include "base/elementary.h"
#include "geometry/vec.h"

/* Between frames; over a longer pause there is no velocity. */
static const int64_t pause_max_ns = 500000000;

void fv_publish_carve(struct fv_publish *publish, const double T_body_cam[12],
                      struct fv_arena *persistent)
{
    fv_se3_from_rows(T_body_cam, &publish->T_body_cam);
    publish->state = fv_arena_take(persistent, 1, sizeof *publish->state);
}

const struct fovea_pose *fv_publish_pose(const struct fv_publish *publish)
{
    return &publish->state->pose;
}

/* ---- the camera ------------------------------------------------------------------------------ */

static void from_the_origin(struct fv_publish_state *s)
{
    memset(s->inner, 0, sizeof s->inner);
    memset(s->outer, 0, sizeof s->outer);
}

/* Lengths of a covariance (upper triangle by rows, translation first) in another unit. */
static void scale_covariance(double covariance[21], double factor)
{
    for (int row = 0, k = 0; row < 6; row++)
        for (int column = row; column < 6; column++, k++)
            covariance[k] *= (row < 3 ? factor : 1) * (column < 3 ? factor : 1);
}

/* `metres` per unit of the map. The continuous world has a unit of its own, which closures leave
 * alone. */
static void scale_pose(struct fv_publish_state *s, double metres)
{
    struct fovea_pose *pose = &s->pose;
    const double factor = metres * pose->map_scale;
    for (int i = 0; i < 3; i++) {
        double inner = pose->T_world_cam[4 * i + 3];
        s->outer[i] += factor * (inner - s->inner[i]);
        s->inner[i] = inner;
        pose->T_world_cam[4 * i + 3] = s->outer[i];
    }
    scale_covariance(pose->covariance, factor);
}

/* An error of the scale is one of the way since the keyframe, along it: T_true = T exp(error) with
 * error = (R^T t) e, e the relative error of the scale and (R, t) = T_keyframe_cam in metres. */
static void add_scale_uncertainty(struct fovea_pose *pose, double metres, double sigma)
{
    struct fv_se3 T;
    double way[3];
    fv_se3_from_rows(pose->T_keyframe_cam, &T);
    fv_rotate_back3(T.R, T.t, way);
    fv_se3_add_along(way, metres * metres * sigma * sigma, pose->covariance);
}

/* T_map_world in metres, where the path has bent as well: what takes the published pose to the
 * map's. */
static void scale_map(struct fovea_pose *pose, const struct fv_odometry *odometry, double metres)
{
    struct fv_se3 T_map_cam, T_odom_cam, T;
    fv_odometry_map_pose(odometry, &T_map_cam);
    for (int i = 0; i < 3; i++)
        T_map_cam.t[i] *= metres;
    fv_se3_from_rows(pose->T_world_cam, &T_odom_cam);
    fv_se3_invert(&T_odom_cam, &T);
    fv_se3_compose(&T_map_cam, &T, &T);
    fv_se3_to_rows(&T, pose->T_map_world);
    pose->map_scale = 1;
}

/* The least turn that takes the unit vector `up` to z. */
static void turn_up(const double up[3], double R[9])
{
    const double turn[3] = {up[1], -up[0], 0}, sine = fv_norm3(turn);
    double r[3] = {FV_PI, 0, 0};
    if (sine > 1e-9) {
        const double angle = fv_atan2(sine, up[2]);
        for (int i = 0; i < 3; i++)
            r[i] = turn[i] * angle / sine;
    } else if (up[2] > 0) {
        r[0] = 0;
    }
    fv_so3_exp(r, R);
}

/* How `odom` is turned; not at all before gravity is known. */
static struct fv_se3 upright_of(const struct fv_publish_state *s)
{
    struct fv_se3 U;
    fv_se3_identity(&U);
    if (s->is_upright) memcpy(U.R, s->upright, sizeof U.R);
    return U;
}

/* Direction in which things fall, in the axes of `world`: by the inertial sensor, as the camera
 * stands now, or as the map brought it. */
static bool gravity_of(const struct fv_odometry *odometry, const struct fv_inertial_known *inertial,
                       double down[3])
{
    struct fv_map_gravity kept;
    if (inertial != NULL && inertial->settled) {
        fv_copy3(inertial->gravity, down);
        return true;
    }
    if (!fv_odometry_gravity(odometry, &kept)) return false;
    fv_copy3(kept.down, down);
    return true;
}

/* What becomes known changes odom, from the world's origin: metres, gravity, or both. */
static void change_odom(struct fv_publish *publish, bool metres, double scale,
                        const struct fv_odometry *odometry,
                        const struct fv_inertial_known *inertial)
{
    struct fv_publish_state *s = publish->state;
    const struct fv_se3 *B = &publish->T_body_cam;
    double back[9], down[3], up[3];
    const bool upright = !s->is_upright && gravity_of(odometry, inertial, down);
    metres = metres && !s->metric;
    if (!metres && !upright) return;
    const struct fv_se3 before = upright_of(s);
    if (upright) {
        fv_rotate3(B->R, down, up);
        for (int i = 0; i < 3; i++)
            up[i] = -up[i];
        s->is_upright = fv_normalise3(up);
        if (s->is_upright) turn_up(up, s->upright);
    }
    if (metres) from_the_origin(s);
    if (metres) s->metric = 1;
    if (!s->sent) return;
    s->changes++;
    fv_sim3_identity(&s->change);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            back[3 * r + c] = before.R[3 * c + r];
    const struct fv_se3 now = upright_of(s);
    fv_multiply33(now.R, back, s->change.R);
    if (!metres) return;
    s->change.s = scale;
    fv_rotate3(now.R, B->t, s->change.t);
}

/* The map is still in metres while the camera is lost in it. */
static void keep_scale(struct fovea_pose *pose, const struct fovea_pose *before)
{
    pose->scale = before->scale;
    pose->scale_sigma = before->scale_sigma;
    pose->scale_source = before->scale_source;
}

/* On by the inertial sensor from the last pose that a picture gave. */
static void go_on(struct fv_publish_state *s, const struct fv_inertial_known *inertial)
{
    struct fovea_pose *pose = &s->pose;
    const struct fovea_pose counts = *pose;
    struct fv_se3 T, step = inertial->T_last_now, back;
    double carried[21];
    *pose = s->seen;
    pose->state = FOVEA_TRACKING_COASTING;
    pose->matches = pose->inliers = 0;
    pose->quality = 0;
    pose->keyframes = counts.keyframes;
    pose->landmarks = counts.landmarks;
    fv_se3_from_rows(s->seen.T_world_cam, &T);
    fv_se3_compose(&T, &step, &T);
    fv_se3_to_rows(&T, pose->T_world_cam);
    fv_se3_invert(&step, &back);
    fv_se3_carry_covariance(&back, s->seen.covariance, carried);
    for (int k = 0; k < 21; k++)
        pose->covariance[k] = carried[k] + inertial->covariance[k];
    for (int i = 0; i < 3; i++) /* in the unit of the map */
        step.t[i] /= pose->scale;
    fv_se3_from_rows(s->seen.T_keyframe_cam, &T);
    fv_se3_compose(&T, &step, &T);
    fv_se3_to_rows(&T, pose->T_keyframe_cam);
}

static bool goes_on(const struct fv_publish_state *s, const struct fv_inertial_known *inertial)
{
    return inertial != NULL && inertial->coasting && s->seen.posed &&
           s->seen.map_id == s->pose.map_id && s->seen.reset_counter == s->pose.reset_counter;
}

static void publish_camera(struct fv_publish *publish, const struct fv_odometry *odometry,
                           const struct fv_scale *scale, const struct fv_inertial_known *inertial)
{
    struct fv_publish_state *s = publish->state;
    struct fovea_pose *pose = &s->pose;
    const struct fovea_pose before = *pose;
    *pose = *fv_odometry_pose(odometry);
    pose->scale = 1;
    /* `odom` is new, but where a map that goes on in it begins, which is posed. */
    if (pose->map_id != before.map_id &&
        (!pose->posed || pose->reset_counter != before.reset_counter))
        s->metric = s->is_upright = s->sent = s->changes = 0;
    if (!pose->posed && goes_on(s, inertial)) {
        go_on(s, inertial);
        return;
    }
    s->seen.posed = false;
    if (!pose->posed) {
        if (s->metric) keep_scale(pose, &before);
        return;
    }
    const struct fv_odometry_reference reference = fv_odometry_reference(odometry);
    pose->reference_keyframe = reference.number;
    pose->keyframe_stamp_ns = reference.stamp_ns;
    fv_se3_to_rows(&reference.T_keyframe_cam, pose->T_keyframe_cam);
    const struct fv_scale_value value = fv_scale_get(scale);
    change_odom(publish, value.known, value.metres * pose->map_scale, odometry, inertial);
    s->sent = 1;
    if (!value.known) return;
    scale_pose(s, value.metres);
    add_scale_uncertainty(pose, value.metres, value.sigma);
    scale_map(pose, odometry, value.metres);
    pose->scale = value.metres;
    pose->scale_sigma = value.sigma;
    pose->scale_source = value.source;
    s->seen = *pose;
}

/* ---- the body -------------------------------------------------------------------------------- */

/* T_body_cam as far as it can be used: while the scale is free, its metres mean nothing beside the
 * map's units, and the body is taken to sit where the camera does. */
static struct fv_se3 usable_T_body_cam(const struct fv_publish *publish)
{
    struct fv_se3 T_body_cam = publish->T_body_cam;
    if (publish->state->pose.scale_source == FOVEA_SCALE_FREE)
        memset(T_body_cam.t, 0, sizeof T_body_cam.t);
    return T_body_cam;
}

/* T_odom_cam = U B T_world_cam and T_odom_body = U B T_world_cam B^-1 with B = T_body_cam and U =
 * upright. */
struct fv_se3 fv_publish_child_pose(const struct fv_publish *publish, enum fv_publish_child child)
{
    const struct fv_se3 B = usable_T_body_cam(publish);
    struct fv_se3 T, inverse;
    fv_se3_from_rows(publish->state->pose.T_world_cam, &T);
    fv_se3_compose(&B, &T, &T);
    if (publish->state->is_upright) {
        const struct fv_se3 U = upright_of(publish->state);
        fv_se3_compose(&U, &T, &T);
    }
    if (child == FV_PUBLISH_CAMERA) return T;
    fv_se3_invert(&B, &inverse);
    fv_se3_compose(&T, &inverse, &T);
    return T;
}

void fv_publish_turn(const struct fv_publish *publish, const double v[3], double out[3])
{
    const struct fv_se3 U = upright_of(publish->state);
    double turned[3];
    fv_rotate3(publish->T_body_cam.R, v, turned);
    fv_rotate3(U.R, turned, out);
}

const struct fv_rates *fv_publish_rates(const struct fv_publish *publish,
                                        enum fv_publish_child child)
{
    return &publish->rates[child];
}

static void find_rates(const struct fv_se3 *before, const struct fv_se3 *now, int64_t step_ns,
                       struct fv_rates *rates)
{
    struct fv_se3 inverse, turn;
    fv_se3_invert(before, &inverse);
    fv_se3_compose(&inverse, now, &turn);
    fv_so3_log(turn.R, rates->rotation_rate);
    for (int i = 0; i < 3; i++) {
        rates->rotation_rate[i] *= 1e9 / (double)step_ns;
        rates->velocity[i] = (now->t[i] - before->t[i]) * 1e9 / (double)step_ns;
    }
    rates->known = true;
}

/* The camera's velocity and rate, and those of the body that it is fixed to. */
static void sensed_rates(struct fv_publish *publish, const struct fv_inertial_known *inertial)
{
    const struct fv_se3 B = usable_T_body_cam(publish),
                        T = fv_publish_child_pose(publish, FV_PUBLISH_CAMERA);
    struct fv_rates *camera = &publish->rates[FV_PUBLISH_CAMERA],
                    *body = &publish->rates[FV_PUBLISH_BODY];
    double lever[3], turned[3], added[3];
    camera->known = true;
    fv_publish_turn(publish, inertial->velocity, camera->velocity);
    fv_copy3(inertial->rate, camera->rotation_rate);
    camera->velocity_sigma = inertial->velocity_sigma;
    camera->rotation_rate_sigma = inertial->rate_sigma;
    *body = *camera;
    fv_rotate3(B.R, inertial->rate, body->rotation_rate);
    fv_rotate_back3(B.R, B.t, lever); /* from the body to the camera, in the camera's axes */
    fv_cross3(inertial->rate, lever, turned);
    fv_rotate3(T.R, turned, added);
    fv_subtract3(camera->velocity, added, body->velocity);
}

void fv_publish_step(struct fv_publish *publish, const struct fv_odometry *odometry,
                     const struct fv_scale *scale, const struct fv_inertial_known *inertial,
                     int64_t stamp_ns)
{
    struct fv_publish_state *s = publish->state;
    const struct fv_se3 before[] = {fv_publish_child_pose(publish, FV_PUBLISH_BODY),
                                    fv_publish_child_pose(publish, FV_PUBLISH_CAMERA)};
    const bool posed_before = s->pose.posed;
    const uint32_t map_id = s->pose.map_id;
    const enum fovea_scale_source source = s->pose.scale_source;
    const uint32_t changes = s->changes;
    const int64_t step_ns = stamp_ns - s->stamp_ns;
    publish_camera(publish, odometry, scale, inertial);
    s->stamp_ns = stamp_ns;
    memset(publish->rates, 0, sizeof publish->rates);
    if (s->pose.posed && inertial != NULL && inertial->moving) {
        sensed_rates(publish, inertial);
        return;
    }
    if (!posed_before || !s->pose.posed || s->pose.map_id != map_id ||
        s->pose.scale_source != source || s->changes != changes || step_ns <= 0 ||
        step_ns > pause_max_ns)
        return;
    for (int child = 0; child < FV_PUBLISH_CHILDREN; child++) {
        const struct fv_se3 T = fv_publish_child_pose(publish, (enum fv_publish_child)child);
        find_rates(&before[child], &T, step_ns, &publish->rates[child]);
    }
}

void fv_publish_covariance(const struct fv_publish *publish, enum fv_publish_child child,
                           double covariance[21])
{
    const struct fv_se3 B = usable_T_body_cam(publish);
    if (child == FV_PUBLISH_CAMERA)
        memcpy(covariance, publish->state->pose.covariance, 21 * sizeof *covariance);
    else
        fv_se3_carry_covariance(&B, publish->state->pose.covariance, covariance);
}

struct fv_se3 fv_publish_keyframe_pose(const struct fv_publish *publish,
                                       enum fv_publish_child child)
{
    const struct fovea_pose *pose = &publish->state->pose;
    const struct fv_se3 B = usable_T_body_cam(publish);
    /* Metres, or the unit of the continuous world, per unit of the map. */
    const double factor =
        pose->scale_source != FOVEA_SCALE_FREE ? pose->scale : 1 / pose->map_scale;
    struct fv_se3 T, inverse;
    fv_se3_from_rows(pose->T_keyframe_cam, &T);
    for (int i = 0; i < 3; i++)
        T.t[i] *= factor;
    if (child == FV_PUBLISH_CAMERA) return T;
    fv_se3_invert(&B, &inverse);
    fv_se3_compose(&B, &T, &T);
    fv_se3_compose(&T, &inverse, &T);
    return T;
}

struct fv_publish_change fv_publish_last_change(const struct fv_publish *publish)
{
    const struct fv_publish_state *s = publish->state;
    struct fv_publish_change change = {.count = s->changes, .S_new_old = s->change};
    if (s->changes == 0) fv_sim3_identity(&change.S_new_old);
    return change;
}

struct fv_sim3 fv_publish_map(const struct fv_publish *publish)
{
    const struct fovea_pose *pose = &publish->state->pose;
    const struct fv_se3 B = usable_T_body_cam(publish);
    struct fv_se3 T;
    struct fv_sim3 S, left, right;
    fv_se3_from_rows(pose->T_map_world, &T);
    fv_sim3_from_se3(&T, pose->map_scale, &S);
    fv_se3_invert(&B, &T);
    fv_sim3_from_se3(&B, 1, &left);
    fv_sim3_from_se3(&T, 1, &right);
    fv_sim3_compose(&left, &S, &S);
    fv_sim3_compose(&S, &right, &S);
    if (!publish->state->is_upright) return S;
    T = upright_of(publish->state); /* so is the map */
    fv_sim3_from_se3(&T, 1, &left);
    fv_se3_invert(&T, &T);
    fv_sim3_from_se3(&T, 1, &right);
    fv_sim3_compose(&left, &S, &S);
    fv_sim3_compose(&S, &right, &S);
    return S;
}

struct fv_sim3 fv_publish_own_map(const struct fv_publish *publish)
{
    const struct fv_se3 B = usable_T_body_cam(publish);
    struct fv_sim3 S;
    fv_sim3_from_se3(&B, publish->state->pose.scale, &S);
    if (!publish->state->is_upright) return S;
    const struct fv_se3 U = upright_of(publish->state);
    struct fv_sim3 left;
    fv_sim3_from_se3(&U, 1, &left);
    fv_sim3_compose(&left, &S, &S);
    return S;
}
