/* The floor under a robot, against simulated ones: a robot drives over a floor that slopes by the
 * filter's own model, or is level, or a ramp, with a camera that is mounted otherwise than is said.
 * Planes are fitted to points on the floor, as in the loop. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "geometry/ground.h"
#include "geometry/linear.h"
#include "geometry/vec.h"

static const double deg = 0.017453292519943295, tilt_sigma = 0.017453292519943295,
                    height_sigma = 0.03, step_m = 0.05;

/* A robot in its world. `error`: what takes points of the body that T_body_cam says to the body
 * that stands on the floor. */
struct world {
    struct fv_random random;
    struct fv_ground ground;
    struct fv_se3 error, T_body_cam, T_odom_world, T_odom_body;
    double position[2], yaw, turn;                     /* turn: rad per metre */
    double slope[2], height;                           /* of the floor under the robot */
    double nod[3], driven, nodded, looked, walk, nods; /* walk, nods: 1 by the model, 0 none */
    double shared[3];                                  /* of all fits */
};

static void rotation(double x, double y, double z, double R[9])
{
    const double r[3] = {x, y, z};
    fv_so3_exp(r, R);
}

/* Standing on a plane, nodding. */
static struct fv_se3 stand_on(const struct world *w)
{
    const double s[2] = {w->slope[0] + w->nod[0], w->slope[1] + w->nod[1]};
    double n[3] = {-s[0], -s[1], 1},
           x[3] = {cos(w->yaw), sin(w->yaw), s[0] * cos(w->yaw) + s[1] * sin(w->yaw)}, y[3];
    struct fv_se3 T;
    (void)fv_normalise3(n);
    (void)fv_normalise3(x);
    fv_cross3(n, x, y);
    for (int i = 0; i < 3; i++) {
        T.R[3 * i] = x[i];
        T.R[3 * i + 1] = y[i];
        T.R[3 * i + 2] = n[i];
    }
    T.t[0] = w->position[0];
    T.t[1] = w->position[1];
    T.t[2] = w->height + w->nod[2];
    return T;
}

static void begin(struct world *w, uint64_t seed, double tilt_x, double tilt_y, double height)
{
    memset(w, 0, sizeof *w);
    fv_random_seed(&w->random, seed);
    rotation(tilt_x, tilt_y, 0, w->error.R);
    w->error.t[2] = height;
    static const double camera[12] = {0, -0.34202, 0.939693, 0.1,       -1,       0,
                                      0, 0,        0,        -0.939693, -0.34202, 0.8};
    fv_se3_from_rows(camera, &w->T_body_cam); /* 20 degrees down */
    fv_so3_orthonormalise(w->T_body_cam.R);
    fv_ground_init(&w->ground, tilt_sigma, height_sigma);
    w->looked = -1;
    w->nods = 1;
}

static void pose(struct world *w)
{
    struct fv_se3 T = stand_on(w);
    fv_se3_compose(&T, &w->error, &T);
    if (w->driven == 0) fv_se3_invert(&T, &w->T_odom_world);
    fv_se3_compose(&w->T_odom_world, &T, &w->T_odom_body);
    fv_ground_drive(&w->ground, &w->T_odom_body);
}

static void drive(struct world *w)
{
    const double step[2] = {step_m * cos(w->yaw), step_m * sin(w->yaw)};
    if (w->driven > 0 || w->looked >= 0) {
        w->height += w->slope[0] * step[0] + w->slope[1] * step[1];
        w->position[0] += step[0];
        w->position[1] += step[1];
        w->yaw += w->turn * step_m;
        w->driven += step_m;
        w->height += w->walk * 0.01 * sqrt(step_m) * fv_random_normal(&w->random);
        for (int i = 0; i < 2; i++)
            w->slope[i] += w->walk * 0.01 * sqrt(step_m) * fv_random_normal(&w->random);
    }
    if (w->driven - w->nodded > 0.249 || w->driven == 0) {
        w->nodded = w->driven;
        for (int i = 0; i < 3; i++)
            w->nod[i] = w->nods * 0.006 * fv_random_normal(&w->random);
    }
    pose(w);
    if (w->looked < 0) w->looked = 0;
}

/* A plane of odom from one of the world at a place. */
static void plane_in_odom(const struct world *w, double plane[3])
{
    double n[3] = {-w->slope[0], -w->slope[1], 1},
           p[3] = {w->position[0], w->position[1], w->height};
    double m[3], q[3];
    fv_rotate3(w->T_odom_world.R, n, m);
    fv_se3_apply(&w->T_odom_world, p, q);
    plane[0] = -m[0] / m[2];
    plane[1] = -m[1] / m[2];
    plane[2] = q[2] + plane[0] * (w->ground.position[0] - q[0]) +
               plane[1] * (w->ground.position[1] - q[1]);
}

/* The floor in the axes of the body that is said. */
static void true_mount(const struct world *w, double plane[3])
{
    const double *R = w->error.R; /* its last row is the floor's normal */
    plane[0] = -R[6] / R[8];
    plane[1] = -R[7] / R[8];
    plane[2] = -w->error.t[2] / R[8];
}

/* Fit a plane to points of the floor, or to ones that lie `above` it, and let the ground see it. */
static bool look(struct world *w, double above, double uneven)
{
    enum { COUNT = 150 };
    static struct fv_floor_point points[COUNT];
    struct fv_se3 T_odom_cam, T_cam_odom;
    struct fv_floor floor;
    double plane[3];
    const double tilted[2] = {uneven * 0.004 * fv_random_normal(&w->random) + w->shared[0],
                              uneven * 0.004 * fv_random_normal(&w->random) + w->shared[1]},
                 raised =
                     above + w->shared[2] + uneven * 0.008 * 0.8 * fv_random_normal(&w->random);
    fv_se3_compose(&w->T_odom_body, &w->T_body_cam, &T_odom_cam);
    fv_se3_invert(&T_odom_cam, &T_cam_odom);
    plane_in_odom(w, plane);
    for (int i = 0; i < COUNT; i++) {
        const double r = 0.8 + 2.7 * fv_random_unit(&w->random),
                     a = 1.2 * (fv_random_unit(&w->random) - 0.5) +
                         atan2(w->T_odom_body.R[3], w->T_odom_body.R[0]),
                     x = r * cos(a), y = r * sin(a),
                     p[3] = {w->ground.position[0] + x, w->ground.position[1] + y,
                             plane[2] + (plane[0] + tilted[0]) * x + (plane[1] + tilted[1]) * y +
                                 raised};
        points[i].sigma = 0.03;
        fv_se3_apply(&T_cam_odom, p, points[i].p);
        const double longer = 1 / (1 + points[i].sigma * fv_random_normal(&w->random));
        for (int k = 0; k < 3; k++)
            points[i].p[k] *= longer;
    }
    struct fv_floor_prior prior = {.sigma_rad = 0.05, .off_max_rad = 0.2};
    fv_ground_down(&w->ground, &T_odom_cam, prior.down);
    if (!fv_floor_estimate(points, COUNT, &prior, 64, 20, &w->random, &floor)) return false;
    return fv_ground_see(&w->ground, &T_odom_cam, &floor, 0);
}

static void drive_by(struct world *w, double metres, bool looks)
{
    for (const double end = w->driven + metres; w->driven < end - 1e-9;) {
        drive(w);
        if (!looks || w->driven - w->looked < 0.499) continue;
        w->looked = w->driven;
        (void)look(w, 0, 1);
    }
}

/* e' P^-1 e of three of the six, and the largest error in standard deviations. */
static double nees(const struct world *w, int first, const double truth[3], double *worst)
{
    double A[9], e[3], v[3];
    *worst = 0;
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++)
            A[3 * r + c] = w->ground.P[6 * (first + r) + first + c];
        v[r] = e[r] = w->ground.x[first + r] - truth[r];
        *worst = fmax(*worst, fabs(e[r]) / sqrt(A[4 * r]));
    }
    assert_true(fv_ldlt_solve(A, 3, v));
    return fv_dot3(e, v);
}

/* ---- tests ----------------------------------------------------------------------------------- */

static void a_wrong_mount_is_found_by_landmarks(void **state)
{
    (void)state;
    struct world w;
    double mount[3], floor[3], worst;
    begin(&w, 1, -0.6 * deg, 0.8 * deg, 0.03); /* together 1 degree */
    w.turn = 0.3;
    drive_by(&w, 10, true);
    true_mount(&w, mount);
    plane_in_odom(&w, floor);
    (void)nees(&w, 3, mount, &worst);
    printf("mount after 10 m: off %.3f %.3f deg %.1f mm, worst %.2f sigma of %.3f deg, %.1f mm\n",
           (w.ground.x[3] - mount[0]) / deg, (w.ground.x[4] - mount[1]) / deg,
           1000 * (w.ground.x[5] - mount[2]), worst, sqrt(w.ground.P[21]) / deg,
           1000 * sqrt(w.ground.P[35]));
    assert_true(worst < 3);
    assert_true(fabs(w.ground.x[3] - mount[0]) < 0.25 * deg &&
                fabs(w.ground.x[4] - mount[1]) < 0.25 * deg &&
                fabs(w.ground.x[5] - mount[2]) < 0.01);
    assert_true(sqrt(w.ground.P[21]) < 0.3 * deg && sqrt(w.ground.P[35]) < 0.008);
    (void)nees(&w, 0, floor, &worst);
    assert_true(worst < 3 && w.ground.taken >= 15 && w.ground.refused == 0);
}

/* The covariance states the errors: by the model that the filter has of floors, robots and fits. */
static void errors_are_those_that_the_covariance_states(void **state)
{
    enum { SEEDS = 60 };
    (void)state;
    for (int looks = 0; looks < 2; looks++) {
        double sum[2] = {0, 0};
        for (int seed = 1; seed <= SEEDS; seed++) {
            struct world w;
            double truth[3], worst;
            begin(&w, (uint64_t)seed, 0, 0, 0);
            double tilt[3];
            for (int i = 0; i < 3; i++)
                tilt[i] = fv_random_normal(&w.random);
            rotation(tilt_sigma * tilt[0], tilt_sigma * tilt[1], 0, w.error.R);
            w.error.t[2] = height_sigma * tilt[2];
            for (int i = 0; i < 3; i++)
                w.shared[i] = (i < 2 ? 0.004 : 0.005) * fv_random_normal(&w.random);
            w.walk = 1;
            w.turn = fv_random_unit(&w.random) - 0.5;
            drive_by(&w, 6, looks);
            plane_in_odom(&w, truth);
            sum[0] += nees(&w, 0, truth, &worst) / (3 * SEEDS);
            true_mount(&w, truth);
            sum[1] += nees(&w, 3, truth, &worst) / (3 * SEEDS);
        }
        printf("%s landmarks: squared error over variance: floor %.2f, mount %.2f\n",
               looks ? "with" : "without", sum[0], sum[1]);
        for (int i = 0; i < 2; i++)
            assert_true(sum[i] > 0.5 && sum[i] < 2);
    }
}

/* Level, 5 % up, level: within .8 % of the slope from a metre behind each bend on. */
static void a_ramp_is_followed(void **state)
{
    (void)state;
    for (int looks = 0; looks < 2; looks++) {
        struct world w;
        double worst = 0, least_bend = 1;
        begin(&w, 3, 0, 0, 0);
        w.nods = 0.3;
        drive_by(&w, 3, looks);
        for (int part = 0; part < 2; part++) {
            double truth[3];
            w.slope[0] = part == 0 ? 0.05 : 0;
            plane_in_odom(&w, truth);
            least_bend = fmin(least_bend, fabs(w.ground.x[0] - truth[0]));
            drive_by(&w, 1, looks);
            for (int i = 0; i < 60; i++) {
                drive_by(&w, step_m, looks);
                plane_in_odom(&w, truth);
                worst = fmax(worst, fabs(w.ground.x[0] - truth[0]));
                worst = fmax(worst, fabs(w.ground.x[1] - truth[1]));
                assert_true(fabs(w.ground.x[2] - truth[2]) < 0.03);
            }
        }
        printf("ramp %s landmarks: slope wrong by at most %.4f\n", looks ? "with" : "without",
               worst);
        assert_true(least_bend > 0.04); /* it had to follow */
        assert_true(worst < 0.008);
    }
}

/* A table top, a kerb, and a wall are not the floor, and leave it where it is. */
static void other_planes_are_not_taken(void **state)
{
    (void)state;
    struct world w;
    begin(&w, 5, 0, 0, 0);
    drive(&w);
    const struct fv_ground before = w.ground;
    assert_false(look(&w, 0.45, 0));
    assert_false(look(&w, 0.15, 0));
    assert_false(look(&w, -0.3, 0)); /* a pit's bottom */
    struct fv_se3 T_odom_cam;
    struct fv_floor wall = {.down = {0, 0, 1}, .height = 2};
    wall.information[0] = wall.information[3] = wall.information[5] = 1e6;
    fv_se3_compose(&w.T_odom_body, &w.T_body_cam, &T_odom_cam);
    assert_false(fv_ground_see(&w.ground, &T_odom_cam, &wall, 0));
    assert_memory_equal(w.ground.x, before.x, sizeof before.x);
    assert_memory_equal(w.ground.P, before.P, sizeof before.P);
    assert_int_equal(w.ground.taken, 0);
    assert_true(w.ground.refused >= 3);
    assert_true(look(&w, 0, 0));
    for (int i = 0; i < 20; i++) /* nor after many of them */
        assert_false(look(&w, 0.45, 0));
}

/* Gravity alone: the tilt of the mount, as floors are level in the mean, and not its height. */
static void gravity_bounds_the_tilt(void **state)
{
    (void)state;
    struct world w;
    double mount[3], worst;
    begin(&w, 7, 1 * deg, 0, 0.03); /* leans sideways, which its straight way does not show */
    drive(&w);
    const double up[3] = {w.T_odom_world.R[2], w.T_odom_world.R[5], w.T_odom_world.R[8]},
                 level[2] = {-up[0] / up[2], -up[1] / up[2]};
    for (int i = 0; i < 800; i++) {
        w.slope[0] = 0.03 * sin(w.driven * 0.7); /* a floor that rolls */
        w.slope[1] = 0.03 * sin(w.driven * 0.5);
        drive(&w);
        fv_ground_level(&w.ground, level, 0.003);
    }
    true_mount(&w, mount);
    (void)nees(&w, 3, mount, &worst);
    printf("mount by gravity after 40 m: off %.2f %.2f deg, sigma %.2f deg\n",
           (w.ground.x[3] - mount[0]) / deg, (w.ground.x[4] - mount[1]) / deg,
           sqrt(w.ground.P[28]) / deg);
    assert_true(worst < 3);
    assert_true(fabs(w.ground.x[4] - mount[1]) < 0.6 * deg);
    assert_true(sqrt(w.ground.P[28]) < 0.7 * deg && sqrt(w.ground.P[28]) > 0.3 * deg);
    assert_true(sqrt(w.ground.P[35]) > 0.95 * height_sigma);
}

/* Gravity that is a degree off is outweighed by landmarks, and tilts the floor by little. */
static void gravity_that_is_wrong_does_little(void **state)
{
    (void)state;
    struct world w;
    double floor[3], worst;
    begin(&w, 17, 0, 0, 0);
    for (int i = 0; i < 20; i++) {
        drive_by(&w, 1, true);
        const double up[3] = {w.T_odom_world.R[2], w.T_odom_world.R[5], w.T_odom_world.R[8]},
                     level[2] = {-up[0] / up[2] + 1 * deg, -up[1] / up[2]};
        fv_ground_level(&w.ground, level, 0.003);
    }
    plane_in_odom(&w, floor);
    (void)nees(&w, 0, floor, &worst);
    printf("gravity off by a degree: floor off by %.2f deg\n", (w.ground.x[0] - floor[0]) / deg);
    assert_true(fabs(w.ground.x[0] - floor[0]) < 0.2 * deg && worst < 3);
}

/* A robot that turns on a floor shows how it is tilted against it, with nothing else to measure. */
static void turning_shows_the_tilt_of_the_mount(void **state)
{
    (void)state;
    struct world w;
    double mount[3], worst;
    begin(&w, 13, 0, 1 * deg, 0);
    w.turn = 1;
    drive_by(&w, 6, false);
    true_mount(&w, mount);
    (void)nees(&w, 3, mount, &worst);
    printf("mount by turning over 6 m: off %.2f %.2f deg, sigma %.2f deg\n",
           (w.ground.x[3] - mount[0]) / deg, (w.ground.x[4] - mount[1]) / deg,
           sqrt(w.ground.P[21]) / deg);
    assert_true(worst < 3 && fabs(w.ground.x[3] - mount[0]) < 0.5 * deg);
    assert_true(sqrt(w.ground.P[21]) < 0.4 * deg);
}

/* What the mount learnt is there in another odom at once; standing still learns nothing. */
static void the_mount_outlives_odom(void **state)
{
    (void)state;
    struct world w;
    double floor[3], worst;
    begin(&w, 9, -1 * deg, 0, -0.03);
    drive_by(&w, 8, true);
    const double sigma = sqrt(w.ground.P[21]);
    fv_ground_place(&w.ground);
    struct fv_ground_plane plane;
    assert_false(fv_ground_at(&w.ground, w.ground.position, &plane));
    w.yaw += 2;
    w.driven = 0; /* odom begins here */
    pose(&w);
    plane_in_odom(&w, floor);
    (void)nees(&w, 0, floor, &worst);
    assert_true(worst < 3 && fabs(w.ground.x[1] - floor[1]) < 0.6 * deg);
    assert_true(sqrt(w.ground.P[0]) < sqrt(sigma * sigma + 0.006 * 0.006) + 1e-4);
    const struct fv_ground before = w.ground;
    for (int i = 0; i < 100; i++)
        pose(&w);
    assert_memory_equal(&w.ground, &before, sizeof before);
    /* Ahead, the plane goes on and is known less well. */
    const double ahead[2] = {w.ground.position[0] + 3, w.ground.position[1]};
    assert_true(fv_ground_at(&w.ground, ahead, &plane));
    assert_true(fabs(plane.height_m - (w.ground.x[2] + 3 * w.ground.x[0])) < 1e-12);
    assert_true(plane.covariance[5] > w.ground.P[14] + 8 * w.ground.P[0]);
}

/* Where the metre was made of the camera's height, landmarks say nothing of it. */
static void a_height_that_the_unit_was_made_of_is_not_measured(void **state)
{
    (void)state;
    struct world w;
    begin(&w, 11, 0, 0, 0);
    drive(&w);
    struct fv_se3 T_odom_cam;
    fv_se3_compose(&w.T_odom_body, &w.T_body_cam, &T_odom_cam);
    struct fv_floor floor = {.height = 0.85};
    fv_ground_down(&w.ground, &T_odom_cam, floor.down);
    floor.information[0] = floor.information[3] = floor.information[5] = 1e6;
    const double tilt = w.ground.P[0], height = w.ground.P[14], x = w.ground.x[2];
    assert_true(fv_ground_see(&w.ground, &T_odom_cam, &floor, INFINITY));
    assert_true(w.ground.P[0] < 0.2 * tilt);
    assert_true(w.ground.P[14] > 0.9 * height && fabs(w.ground.x[2] - x) < 1e-3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_wrong_mount_is_found_by_landmarks),
        cmocka_unit_test(errors_are_those_that_the_covariance_states),
        cmocka_unit_test(a_ramp_is_followed),
        cmocka_unit_test(other_planes_are_not_taken),
        cmocka_unit_test(gravity_bounds_the_tilt),
        cmocka_unit_test(gravity_that_is_wrong_does_little),
        cmocka_unit_test(turning_shows_the_tilt_of_the_mount),
        cmocka_unit_test(the_mount_outlives_odom),
        cmocka_unit_test(a_height_that_the_unit_was_made_of_is_not_measured),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
