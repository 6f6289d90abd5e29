/* The inertial sensor of the simulated camera. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "../../../drivers/sim/sim.h"

enum { RATE_HZ = 200, SAMPLES_MAX = 6200 };

static const double gravity_m_s2 = 9.80665;
static const struct fovea_source_ops *const ops = &fv_source_sim;
static struct fovea_imu_sample list[SAMPLES_MAX];

static struct fovea_source *open_source(const char *address)
{
    const struct fovea_source_selection all = {.step = 1};
    struct fovea_source *source = NULL;
    struct fovea_error error;
    if (ops->open(address, &all, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    assert_true(ops->info(source)->rig.has_imu);
    return source;
}

static void close_source(struct fovea_source *source)
{
    ops->stop(source);
    ops->close(source);
}

/* All samples up to a number of frames; sample k has the stamp k / RATE_HZ. */
static uint32_t take_samples(struct fovea_source *source, uint32_t frames)
{
    static struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX];
    struct fovea_frame frame;
    uint32_t count = 0;
    for (uint32_t n = 0; n < frames; n++) {
        assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_OK);
        const uint32_t came = ops->samples(source, &frame, samples, FOVEA_INPUT_SAMPLES_MAX);
        ops->requeue(source, &frame);
        for (uint32_t i = 0; i < came; i++, count++) {
            assert_int_equal(samples[i].kind, FOVEA_SAMPLE_IMU);
            assert_true(count < SAMPLES_MAX);
            assert_true(samples[i].imu.stamp_ns == (int64_t)count * 1000000000 / RATE_HZ);
            list[count] = samples[i].imu;
        }
    }
    return count;
}

/* q <- q turned by the rotation vector r. */
static void turn_by(double q[4], const double r[3])
{
    const double angle = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    const double s = angle > 0 ? sin(angle / 2) / angle : 0.5, c = cos(angle / 2);
    const double p[4] = {q[0], q[1], q[2], q[3]}, d[4] = {c, s * r[0], s * r[1], s * r[2]};
    q[0] = p[0] * d[0] - p[1] * d[1] - p[2] * d[2] - p[3] * d[3];
    q[1] = p[0] * d[1] + p[1] * d[0] + p[2] * d[3] - p[3] * d[2];
    q[2] = p[0] * d[2] - p[1] * d[3] + p[2] * d[0] + p[3] * d[1];
    q[3] = p[0] * d[3] + p[1] * d[2] - p[2] * d[1] + p[3] * d[0];
}

static void rows_of(const double q[4], double R[9])
{
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double rows[9] = {
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
        2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    memcpy(R, rows, sizeof rows);
}

/* True pose of the sensor. */
static void true_pose(const struct fovea_source *source, double time_s, double T_world_imu[12])
{
    fv_sim_motion_pose(&source->motion, time_s, T_world_imu);
    fv_sim_compose(T_world_imu, ops->info(source)->rig.imu.T_body_imu, T_world_imu);
}

/* From the true pose and velocity at `begin_s`, through samples 1 to `last`: how far the pose is
 * off the true one then. */
static void integrate(const struct fovea_source *source, double begin_s, uint32_t last,
                      double *off_m, double *off_deg)
{
    const double step_s = 1.0 / RATE_HZ;
    double T[12], q[4], R[9], p[3], v[3], before[12], after[12];
    true_pose(source, begin_s, T);
    true_pose(source, begin_s - 1e-4, before);
    true_pose(source, begin_s + 1e-4, after);
    const double first[9] = {T[0], T[1], T[2], T[4], T[5], T[6], T[8], T[9], T[10]};
    fv_sim_quaternion(first, q);
    for (int i = 0; i < 3; i++) {
        p[i] = T[4 * i + 3];
        v[i] = (after[4 * i + 3] - before[4 * i + 3]) / 2e-4;
    }
    for (uint32_t k = 1; k <= last; k++) {
        const double half[3] = {list[k].gyro[0] * step_s / 2, list[k].gyro[1] * step_s / 2,
                                list[k].gyro[2] * step_s / 2};
        turn_by(q, half);
        rows_of(q, R);
        turn_by(q, half);
        for (int i = 0; i < 3; i++) {
            double a = i == 2 ? -gravity_m_s2 : 0;
            for (int c = 0; c < 3; c++)
                a += R[3 * i + c] * list[k].acceleration[c];
            p[i] += v[i] * step_s + a * step_s * step_s / 2;
            v[i] += a * step_s;
        }
    }
    true_pose(source, begin_s + (double)last * step_s, T);
    rows_of(q, R);
    double off2 = 0, trace = 0;
    for (int i = 0; i < 3; i++) {
        off2 += (p[i] - T[4 * i + 3]) * (p[i] - T[4 * i + 3]);
        for (int c = 0; c < 3; c++)
            trace += R[3 * i + c] * T[4 * i + c];
    }
    *off_m = sqrt(off2);
    *off_deg = acos(fmin(1, (trace - 1) / 2)) * 57.29578;
}

/* Samples without noise, integrated for 30 s from the true pose and velocity, give the pose back
 * within 1 mm and 0.01 degrees; with an offset, that of so much later. */
static void ideal_samples_give_the_motion_back(void **state)
{
    static const struct {
        const char *address;
        double offset_s;
        int64_t stated_ns;
    } runs[] = {
        {"orbit?", 0, -2500000},
        {"fast?turn_rate=300&", 0, -2500000},
        {"stopgo?", 0, -2500000},
        {"tour?", 0, -2500000},
        {"corridor?", 0, -2500000},
        {"rotate?", 0, -2500000},
        {"wander?", 0, -2500000},
        {"orbit?imu_offset=12.5&", 0.0125, 10000000},
        {"orbit?imu_offset=-7&imu_offset_known=0&", -0.007, -2500000},
        {"orbit?imu_pose=0.3,-0.2,0.5,20,-35,140&", 0, -2500000},
        {"fast?turn_rate=300&imu_pose=-0.4,0.1,0.3,90,0,-90&", 0, -2500000},
    };
    (void)state;
    for (size_t i = 0; i < sizeof runs / sizeof runs[0]; i++) {
        char address[160];
        double off_m, off_deg;
        snprintf(address, sizeof address,
                 "%swidth=64&height=64&imu=200&imu_noise=0&wheel_odometry=0&objects=0",
                 runs[i].address);
        struct fovea_source *source = open_source(address);
        const uint32_t count = take_samples(source, 899);
        assert_true(count > 5900);
        integrate(source, fv_sim_frame_time(source, 0) + runs[i].offset_s, count - 1, &off_m,
                  &off_deg);
        print_message("%-50s %u samples, off by %.4f mm, %.5f degrees\n", runs[i].address, count,
                      1e3 * off_m, off_deg);
        assert_true(off_m < 1e-3 && off_deg < 0.01);
        assert_true(ops->info(source)->rig.imu.time_offset_ns == runs[i].stated_ns);
        close_source(source);
    }
}

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

/* Beside the body's origin, at the arm r, the sensor reads w x (w x r) + dw/dt x r more. */
static void an_arm_adds_what_turning_accelerates(void **state)
{
    static const char at_origin[] =
        "fast?turn_rate=300&width=64&height=64&imu=200&imu_noise=0&wheel_odometry=0&objects=0";
    static const double arm[3] = {0.4, -0.3, 0.2};
    static struct fovea_imu_sample origin[SAMPLES_MAX];
    char address[160];
    double largest = 0, off = 0;
    (void)state;
    struct fovea_source *source = open_source(at_origin);
    const uint32_t count = take_samples(source, 200);
    close_source(source);
    memcpy(origin, list, sizeof origin);
    snprintf(address, sizeof address, "%s&imu_pose=0.4,-0.3,0.2", at_origin);
    source = open_source(address);
    assert_int_equal(take_samples(source, 200), count);
    close_source(source);
    for (uint32_t k = 1; k + 1 < count; k++) {
        double faster[3], tangential[3], velocity[3], centripetal[3];
        for (int i = 0; i < 3; i++)
            faster[i] = (origin[k + 1].gyro[i] - origin[k - 1].gyro[i]) * RATE_HZ / 2;
        cross(faster, arm, tangential);
        cross(origin[k].gyro, arm, velocity);
        cross(origin[k].gyro, velocity, centripetal);
        for (int i = 0; i < 3; i++) {
            assert_true(fabs(list[k].gyro[i] - origin[k].gyro[i]) < 1e-9);
            const double more = tangential[i] + centripetal[i],
                         read = list[k].acceleration[i] - origin[k].acceleration[i];
            largest = fmax(largest, fabs(more));
            off = fmax(off, fabs(read - more));
        }
    }
    print_message("an arm adds up to %.2f m/s^2, off by at most %.3f\n", largest, off);
    assert_true(largest > 8 && off < 0.012 * largest);
}

/* At rest and without noise only gravity and the biases are read: others for each seed, of the
 * deviation that was asked for. */
static void biases_begin_as_asked_for(void **state)
{
    double gyro2 = 0, acceleration2 = 0, last = 0;
    enum { SEEDS = 60 };
    (void)state;
    for (int seed = 1; seed <= SEEDS; seed++) {
        char address[160];
        snprintf(address, sizeof address,
                 "still?width=64&height=64&imu=200&imu_noise=0&wheel_odometry=0&objects=0&seed=%d&"
                 "gyro_bias=0.02&acceleration_bias=0.3",
                 seed);
        struct fovea_source *source = open_source(address);
        const uint32_t count = take_samples(source, 2);
        double T[12];
        fv_sim_motion_pose(&source->motion, 0, T);
        assert_true(count > 2);
        assert_memory_equal(list[0].gyro, list[count - 1].gyro, sizeof list[0].gyro);
        for (int i = 0; i < 3; i++) {
            const double bias = list[1].acceleration[i] - T[8 + i] * gravity_m_s2;
            gyro2 += list[1].gyro[i] * list[1].gyro[i] / (3 * SEEDS);
            acceleration2 += bias * bias / (3 * SEEDS);
        }
        assert_true(list[1].gyro[0] != last);
        last = list[1].gyro[0];
        close_source(source);
    }
    assert_true(fabs(sqrt(gyro2) / 0.02 - 1) < 0.2); /* 180 numbers: 5 % is one deviation */
    assert_true(fabs(sqrt(acceleration2) / 0.3 - 1) < 0.2);
}

/* Where the body is carried off in an instant, and back, the sensor reads rest: the samples around
 * it are gravity alone, and none shows the leap. */
static void who_is_carried_off_reads_rest(void **state)
{
    (void)state;
    struct fovea_source *source =
        open_source("kidnap?width=64&height=64&imu=200&imu_noise=0&wheel_odometry=0&objects=0");
    const uint32_t count = take_samples(source, 600);
    const double leaps_s[] = {14.0, 17.0};
    for (size_t i = 0; i < 2; i++) {
        const double at = (leaps_s[i] - fv_sim_frame_time(source, 0)) * RATE_HZ;
        const struct fovea_imu_sample *over = &list[(uint32_t)ceil(at)];
        double force2 = 0;
        for (int k = 0; k < 3; k++) {
            assert_true(over->gyro[k] == 0);
            force2 += over->acceleration[k] * over->acceleration[k];
        }
        assert_true(fabs(sqrt(force2) - gravity_m_s2) < 1e-6);
    }
    for (uint32_t n = 0; n < count; n++) {
        double rate2 = 0, force2 = 0;
        for (int k = 0; k < 3; k++) {
            rate2 += list[n].gyro[k] * list[n].gyro[k];
            force2 += list[n].acceleration[k] * list[n].acceleration[k];
        }
        assert_true(sqrt(rate2) < 1.5 && fabs(sqrt(force2) - gravity_m_s2) < 3);
    }
    close_source(source);
}

/* White noise of the density that is asked for, and an end to each range. */
static void densities_and_ranges_are_as_asked_for(void **state)
{
    (void)state;
    static const char *const address =
        "still?width=64&height=64&imu=200&wheel_odometry=0&objects=0&gyro_noise=0.01&gyro_walk=0"
        "&acceleration_noise=0.05&acceleration_walk=0&imu_noise=2";
    struct fovea_source *source = open_source(address);
    const uint32_t count = take_samples(source, 600);
    const struct fovea_rig_imu *imu = &ops->info(source)->rig.imu;
    double mean[6] = {0}, square[6] = {0};
    assert_true(imu->gyro_noise == 0.02 && imu->acceleration_noise == 0.1);
    assert_true(imu->gyro_walk == 0 && imu->acceleration_walk == 0 && imu->gyro_range == 0);
    for (uint32_t n = 0; n < count; n++)
        for (int i = 0; i < 6; i++) {
            const double v = i < 3 ? list[n].gyro[i] : list[n].acceleration[i - 3];
            mean[i] += v / count;
            square[i] += v * v / count;
        }
    for (int i = 0; i < 6; i++) {
        const double density =
            sqrt((square[i] - mean[i] * mean[i]) / RATE_HZ); /* 4,000 numbers: 1.1 % */
        assert_true(fabs(density / (i < 3 ? 0.02 : 0.1) - 1) < 0.05);
    }
    close_source(source);
    source = open_source("fast?width=64&height=64&imu=200&wheel_odometry=0&objects=0&imu_noise=0"
                         "&gyro_range=2&acceleration_range=9");
    const uint32_t turning = take_samples(source, 600);
    uint32_t at_end[2] = {0, 0};
    for (uint32_t n = 0; n < turning; n++)
        for (int i = 0; i < 3; i++) {
            assert_true(fabs(list[n].gyro[i]) <= 2 && fabs(list[n].acceleration[i]) <= 9);
            at_end[0] += fabs(list[n].gyro[i]) == 2;
            at_end[1] += fabs(list[n].acceleration[i]) == 9;
        }
    assert_true(at_end[0] > 100 && at_end[1] > 100);
    assert_true(ops->info(source)->rig.imu.gyro_range == 2);
    close_source(source);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ideal_samples_give_the_motion_back),
        cmocka_unit_test(an_arm_adds_what_turning_accelerates),
        cmocka_unit_test(biases_begin_as_asked_for),
        cmocka_unit_test(densities_and_ranges_are_as_asked_for),
        cmocka_unit_test(who_is_carried_off_reads_rest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
