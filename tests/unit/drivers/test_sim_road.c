/* The simulated road: how the car moves, that its camera stands at its height over what it drives
 * on, how much of the picture cars fill, and that frames agree with one another by their truth. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/sim_source.h"

enum { WIDTH = 1241, HEIGHT = 376, SEEDS = 40 };

static const struct fovea_source_ops *const ops = &fv_source_sim;
static struct fovea_truth truth;

static void the_camera_is_that_of_a_car(void **state)
{
    (void)state;
    struct fovea_source *source = sim_source_open_at("road", 0);
    const struct fovea_source_info *info = ops->info(source);
    const struct fovea_camera *camera = &info->rig.cameras[0].camera;
    assert_int_equal(camera->width, WIDTH);
    assert_int_equal(camera->height, HEIGHT);
    assert_true(info->rate_hz == 10 && fabs(camera->fx - 719) < 0.5);
    assert_int_equal(camera->lens, FOVEA_LENS_RADTAN);
    assert_true(camera->k[0] == 0);
    sim_source_close(source);
}

/* What drives show of what they are for; each must occur among the seeds. */
struct seen {
    double speed_most, yaw_most, acceleration_most, slope_most;
    int in_bend, starts, brakes, stops_at_end;
};

static double turned(const double a[12], const double b[12])
{
    /* about the vertical: the forward axes, seen from above */
    const double cross = a[2] * b[6] - a[6] * b[2], dot = a[2] * b[2] + a[6] * b[6];
    return atan2(cross, dot);
}

static void look_at_drive(const struct fv_sim_motion *motion, struct seen *seen)
{
    const double dt = 0.02;
    double a[12], b[12], last_speed = -1;
    fv_sim_motion_pose(motion, 0, a);
    for (int i = 1; i < 30 * 50; i++) {
        fv_sim_motion_pose(motion, i * dt, b);
        const double dx = b[3] - a[3], dy = b[7] - a[7], dz = b[11] - a[11];
        const double speed = sqrt(dx * dx + dy * dy + dz * dz) / dt,
                     yaw = fabs(turned(a, b)) / dt * 57.29578;
        seen->speed_most = fmax(seen->speed_most, speed);
        seen->yaw_most = fmax(seen->yaw_most, yaw);
        if (i < 100 && i % 10 == 0) { /* two seconds, by a tenth each */
            seen->starts++;
            seen->in_bend += yaw > 8;
        }
        if (yaw > 20) assert_true(speed < 15.5); /* at its speed: 8 to 15 m/s */
        if (last_speed >= 0) {
            const double change = (speed - last_speed) / dt;
            seen->acceleration_most = fmax(seen->acceleration_most, fabs(change));
            seen->brakes += change < -2.5;
        }
        seen->slope_most = fmax(seen->slope_most, fabs(b[10]));
        last_speed = speed;
        memcpy(a, b, sizeof a);
    }
}

static void drives_are_as_fast_and_turn_as_much_as_cars_do(void **state)
{
    (void)state;
    struct seen seen = {0};
    for (int seed = 1; seed <= SEEDS; seed++) {
        static struct fv_sim_road road;
        const struct fv_sim_motion motion = {.trajectory = FV_SIM_ROAD, .road = &road};
        memset(&road, 0, sizeof road);
        fv_sim_road_path_create(&road, (uint64_t)seed);
        look_at_drive(&motion, &seen);
        double speed;
        fv_sim_road_way(&road, 55, &speed);
        seen.stops_at_end += speed < 0.5;
    }
    print_message(
        "%d drives: at most %.1f m/s, %.1f degrees/s, %.1f m/s^2; %d of %d moments of the first two seconds in a bend\n",
        SEEDS, seen.speed_most, seen.yaw_most, seen.acceleration_most, seen.in_bend, seen.starts);
    assert_true(seen.speed_most > 20 && seen.speed_most < 25.5);
    assert_true(seen.yaw_most > 40 && seen.yaw_most < 46);
    assert_true(seen.acceleration_most < 9 && seen.brakes > 100);
    assert_true(seen.slope_most > 0.03 && seen.slope_most < 0.15);
    assert_true(seen.in_bend > seen.starts / 3 && seen.in_bend < seen.starts);
    assert_int_equal(seen.stops_at_end, SEEDS);
}

/* The road's faces carry the camera: below it, 1.65 m. And the truth of a pixel of the road lies on
 * it. */
static void the_camera_is_1_65_m_over_the_road(void **state)
{
    (void)state;
    for (int seed = 1; seed <= 4; seed++) {
        char address[64];
        struct fovea_frame frame;
        snprintf(address, sizeof address, "road?seed=%d&objects=0&width=320&height=240", seed);
        struct fovea_source *source = sim_source_open_at(address, 15);
        const struct fovea_camera *camera = &ops->info(source)->rig.cameras[0].camera;
        assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_OK);
        assert_int_equal(ops->truth(source, &frame, &truth), FOVEA_OK);
        const double *T = truth.T_world_cam;
        const double along =
            fv_sim_road_way(&source->world.road, fv_sim_frame_time(source, 15), &(double){0});
        double road[3], heading, slope, bearing[3];
        fv_sim_road_at(&source->world.road, along, road, &heading, &slope);
        assert_true(fabs(T[11] - road[2] - 1.65) < 0.03);
        assert_true(fabs(hypot(T[3] - road[0], T[7] - road[1]) - 1.75) < 0.01);
        /* The middle of the lowest row sees the road some metres ahead. */
        const int x = 160, y = 239;
        const double z = (double)truth.depth_m[y * 320 + x];
        assert_int_equal(fovea_camera_unproject(camera, (const double[2]){x, y}, bearing, NULL),
                         FOVEA_OK);
        double p[3];
        for (int i = 0; i < 3; i++)
            p[i] = T[4 * i + 3] +
                   (T[4 * i] * bearing[0] + T[4 * i + 1] * bearing[1] + T[4 * i + 2] * bearing[2]) *
                       z / bearing[2];
        double best = 1e9, height = 0;
        for (double s = along; s < along + 15; s += 0.05) { /* NOLINT */
            fv_sim_road_at(&source->world.road, s, road, &heading, &slope);
            const double off = hypot(p[0] - road[0], p[1] - road[1]);
            if (off < best) height = road[2];
            best = fmin(best, off);
        }
        assert_true(best < 4 && fabs(p[2] - height) < 0.05);
        sim_source_close(source);
    }
}

/* Largest part of the picture that cars fill in some frames of a drive. */
static double part_of_cars(const char *address)
{
    enum { PIXELS = 320 * 97 };
    const struct fovea_source_selection selection = {.step = 12, .frames = 5};
    struct fovea_source *source = NULL;
    struct fovea_frame frame;
    struct fovea_error error;
    double most = 0;
    if (ops->open(address, &selection, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    while (ops->dequeue(source, 0, &frame) == FOVEA_OK) {
        int cars = 0;
        assert_int_equal(ops->truth(source, &frame, &truth), FOVEA_OK);
        for (int i = 0; i < PIXELS; i++)
            cars += truth.class_mask[i] == FOVEA_TRUTH_BOX;
        most = fmax(most, (double)cars / PIXELS);
        ops->requeue(source, &frame);
    }
    sim_source_close(source);
    return most;
}

static void moving_cars_fill_up_to_two_fifths_of_the_picture(void **state)
{
    enum { DRIVES = 16 };
    (void)state;
    double most = 0;
    int some = 0;
    for (int seed = 1; seed <= DRIVES; seed++) {
        char address[64];
        snprintf(address, sizeof address, "road?seed=%d&width=320&height=97", seed);
        const double part = part_of_cars(address);
        most = fmax(most, part);
        some += part > 0.01;
    }
    print_message("moving cars: in %d of %d drives, at most %.2f of the picture\n", some, DRIVES,
                  most);
    assert_true(most > 0.3 && most < 0.45 && some > DRIVES / 2);
    assert_true(part_of_cars("road?seed=1&width=320&height=97&objects=0") == 0);
}

/* Grey level at a place between pixels. */
static double at_place(const struct fovea_image *image, const double pixel[2])
{
    const int x = (int)floor(pixel[0]), y = (int)floor(pixel[1]);
    const double u = pixel[0] - x, v = pixel[1] - y;
    const uint8_t *p = image->data + (size_t)y * (size_t)image->width + x;
    return (1 - v) * ((1 - u) * p[0] + u * p[1]) +
           v * ((1 - u) * p[image->width] + u * p[image->width + 1]);
}

/* Moved by depth and pose, a frame is like the next but for the light. */
static void frames_agree_by_their_truth(void **state)
{
    (void)state;
    for (int seed = 1; seed <= 6; seed++) {
        static float depth[WIDTH * HEIGHT];
        struct fovea_frame a, b;
        char address[64];
        double A[12], aa = 0, ab = 0, bb = 0, sa = 0, sb = 0;
        int count = 0;
        snprintf(address, sizeof address, "road?seed=%d&objects=0&noise=0", seed);
        struct fovea_source *source = sim_source_open_at(address, 12);
        const struct fovea_camera *camera = &ops->info(source)->rig.cameras[0].camera;
        assert_int_equal(ops->dequeue(source, 0, &a), FOVEA_OK);
        assert_int_equal(ops->dequeue(source, 0, &b), FOVEA_OK);
        assert_int_equal(ops->truth(source, &a, &truth), FOVEA_OK);
        memcpy(depth, truth.depth_m, sizeof depth);
        memcpy(A, truth.T_world_cam, sizeof A);
        assert_int_equal(ops->truth_pose(source, &b, truth.T_world_cam), FOVEA_OK);
        const double *B = truth.T_world_cam;
        for (int y = 3; y < HEIGHT - 3; y += 3)
            for (int x = 3; x < WIDTH - 3; x += 3) {
                const double z = (double)depth[y * WIDTH + x];
                double bearing[3], p[3], q[3], pixel[2];
                if (z > 300 || z <= 0) continue; /* the sky is white */
                if (fovea_camera_unproject(camera, (const double[2]){x, y}, bearing, NULL))
                    continue;
                for (int i = 0; i < 3; i++)
                    p[i] = A[4 * i + 3] - B[4 * i + 3] +
                           (A[4 * i] * bearing[0] + A[4 * i + 1] * bearing[1] +
                            A[4 * i + 2] * bearing[2]) *
                               z / bearing[2];
                for (int i = 0; i < 3; i++)
                    q[i] = B[i] * p[0] + B[4 + i] * p[1] + B[8 + i] * p[2];
                if (q[2] < 1 || fovea_camera_project(camera, q, pixel, NULL)) continue;
                if (pixel[0] < 1 || pixel[1] < 1 || pixel[0] > WIDTH - 3 || pixel[1] > HEIGHT - 3)
                    continue;
                const double g = a.images[0].data[y * WIDTH + x], h = at_place(&b.images[0], pixel);
                aa += g * g;
                bb += h * h;
                ab += g * h;
                sa += g;
                sb += h;
                count++;
            }
        const double correlation =
            (ab - sa * sb / count) / sqrt((aa - sa * sa / count) * (bb - sb * sb / count));
        print_message("seed %d: %d pixels in both frames, correlation %.3f\n", seed, count,
                      correlation);
        assert_true(count > 10000 && correlation > 0.8);
        sim_source_close(source);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_camera_is_that_of_a_car),
        cmocka_unit_test(drives_are_as_fast_and_turn_as_much_as_cars_do),
        cmocka_unit_test(the_camera_is_1_65_m_over_the_road),
        cmocka_unit_test(moving_cars_fill_up_to_two_fifths_of_the_picture),
        cmocka_unit_test(frames_agree_by_their_truth),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
