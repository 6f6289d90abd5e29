/* The trajectory: its file, its bounded points, and the fit to the truth. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/run/trajectory.h"
#include "common/datasets.h"
#include "base/elementary.h"

/* Rotation by `angle` about a unit axis (Rodrigues), row-major 3x4 with zero translation. */
static void rotation_about(const double axis[3], double angle, double T[12])
{
    double c = fv_cos(angle), s = fv_sin(angle), t = 1 - c;
    const double K[9] = {0, -axis[2], axis[1], axis[2], 0, -axis[0], -axis[1], axis[0], 0};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            T[4 * i + j] = (i == j ? c : 0) + s * K[3 * i + j] + t * axis[i] * axis[j];
    T[3] = T[7] = T[11] = 0;
}

static void random_rotation(struct fv_random *random, double T[12])
{
    double axis[3], norm = 0;
    for (int i = 0; i < 3; i++) {
        axis[i] = fv_random_normal(random);
        norm += axis[i] * axis[i];
    }
    for (int i = 0; i < 3; i++)
        axis[i] /= sqrt(norm);
    rotation_about(axis, (fv_random_unit(random) * 2 - 1) * FV_PI, T);
}

/* `dimensions`: of the point set: 3 in general, 2 in a plane, 1 on a line. */
static void fit_known(struct fv_random *random, int dimensions, double noise)
{
    struct fv_trajectory *trajectory;
    struct fovea_error error;
    struct fv_trajectory_summary summary;
    double T[12], turn[12], axes[12], expected2 = 0;
    const double scale = 0.3 + fv_random_unit(random) * 4;
    const int count = 500;
    random_rotation(random, turn);
    random_rotation(random, axes);
    assert_int_equal(fv_trajectory_open(NULL, &trajectory, &error), FOVEA_OK);
    random_rotation(random, T);
    for (int n = 0; n < count; n++) {
        struct fv_trajectory_sample sample = {.stamp_ns = n, .has_truth = true};
        double p[3] = {0, 0, 0};
        for (int d = 0; d < dimensions; d++) {
            double along = fv_random_normal(random) * (3 - d);
            for (int i = 0; i < 3; i++)
                p[i] += along * axes[4 * i + d];
        }
        memcpy(sample.T_world_cam, T, sizeof T);
        for (int i = 0; i < 3; i++) {
            sample.T_world_cam[4 * i + 3] = p[i] + 50;
            double q = 700 - 100 * i, e = noise * fv_random_normal(random);
            for (int j = 0; j < 3; j++)
                q += scale * turn[4 * i + j] * (p[j] + 50);
            sample.truth_m[i] = q + e;
            expected2 += e * e;
        }
        assert_true(fv_trajectory_add(trajectory, &sample));
        if (n % 100 == 0) fv_trajectory_drain(trajectory);
    }
    fv_trajectory_finish(trajectory, &summary);
    assert_int_equal(summary.samples, count);
    assert_true(fabs(summary.scale - scale) < 1e-6 + noise * 0.1);
    assert_true(fabs(summary.error_m - sqrt(expected2 / count)) < 1e-5 + noise * 0.05);
    /* Points for the picture are aligned. */
    double sum2 = 0;
    for (uint32_t n = 0; n < summary.points; n++)
        for (int i = 0; i < 3; i++) {
            double off = summary.centres[n][i] - summary.truths[n][i];
            sum2 += off * off;
        }
    assert_true(fabs(sqrt(sum2 / summary.points) - summary.error_m) < 1e-5 + noise * 1e-3);
    fv_trajectory_close(trajectory);
}

static void test_similarity_is_found(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 3);
    for (int iteration = 0; iteration < 30; iteration++)
        for (int dimensions = 1; dimensions <= 3; dimensions++) {
            fit_known(&random, dimensions, 0);
            fit_known(&random, dimensions, 0.01);
        }
}

/* Maps of different worlds are aligned one by one; one without extent is left out, and too many are
 * no harm.
 */
static void test_several_maps(void **state)
{
    (void)state;
    struct fv_trajectory *trajectory;
    struct fv_trajectory_summary summary;
    struct fv_random random;
    fv_random_seed(&random, 21);
    assert_int_equal(fv_trajectory_open(NULL, &trajectory, NULL), FOVEA_OK);
    const int per_map = 50, maps = FV_TRAJECTORY_MAPS_MAX + 10;
    for (int map = 0; map < maps; map++) {
        double turn[12], scale = 0.5 + fv_random_unit(&random);
        random_rotation(&random, turn);
        for (int n = 0; n < per_map; n++) {
            struct fv_trajectory_sample sample = {.map = (uint32_t)map * 2 + 7, .has_truth = true};
            memcpy(sample.T_world_cam, turn, sizeof turn);
            for (int i = 0; i < 3; i++)
                sample.truth_m[i] = map == 3 ? 5.0 : fv_random_normal(&random) + map;
            for (int i = 0; i < 3; i++) {
                double p = i;
                for (int j = 0; j < 3; j++)
                    p += turn[4 * j + i] * sample.truth_m[j] / scale;
                sample.T_world_cam[4 * i + 3] = p;
            }
            fv_trajectory_add(trajectory, &sample);
        }
        fv_trajectory_drain(trajectory);
    }
    fv_trajectory_finish(trajectory, &summary);
    assert_int_equal(summary.maps, maps);
    assert_int_equal(summary.judged, (FV_TRAJECTORY_MAPS_MAX - 1) * per_map);
    assert_true(summary.error_m < 1e-6);
    for (uint32_t n = 0; n < summary.points; n++) {
        bool left_out = summary.map_of[n] == 3 || summary.map_of[n] >= FV_TRAJECTORY_MAPS_MAX;
        assert_int_equal(isnan(summary.centres[n][0]) != 0, left_out);
        if (!left_out) assert_true(fabs(summary.centres[n][1] - summary.truths[n][1]) < 1e-6);
    }
    fv_trajectory_close(trajectory);
}

static void test_no_extent(void **state)
{
    (void)state;
    struct fv_trajectory *trajectory;
    struct fv_trajectory_summary summary;
    struct fv_trajectory_sample sample = {.has_truth = true,
                                          .T_world_cam = {1, 0, 0, 4, 0, 1, 0, 5, 0, 0, 1, 6}};
    assert_int_equal(fv_trajectory_open(NULL, &trajectory, NULL), FOVEA_OK);
    for (int i = 0; i < 10; i++)
        fv_trajectory_add(trajectory, &sample);
    fv_trajectory_finish(trajectory, &summary);
    assert_true(isnan(summary.error_m));
    fv_trajectory_close(trajectory);
    fv_trajectory_finish(NULL, &summary);
    assert_int_equal(summary.samples, 0);
}

static void test_file_and_points(void **state)
{
    (void)state;
    enum { COUNT = 30001 };
    char path[] = "/tmp/fovea_trajectory_XXXXXX";
    close(mkstemp(path));
    struct fv_trajectory *trajectory;
    struct fv_trajectory_summary summary;
    struct fovea_error error;
    struct fv_random random;
    fv_random_seed(&random, 9);
    static struct fv_trajectory_sample samples[COUNT];
    assert_int_equal(fv_trajectory_open(path, &trajectory, &error), FOVEA_OK);
    for (int n = 0; n < COUNT; n++) {
        samples[n].stamp_ns = 1403638127245096960 + (int64_t)n * 50000000;
        random_rotation(&random, samples[n].T_world_cam);
        for (int i = 0; i < 3; i++)
            samples[n].T_world_cam[4 * i + 3] = n + i * 0.25;
        while (!fv_trajectory_add(trajectory, &samples[n]))
            fv_trajectory_drain(trajectory);
    }
    fv_trajectory_finish(trajectory, &summary);
    assert_int_equal(summary.samples, COUNT);
    assert_true(summary.points > FV_TRAJECTORY_POINTS_MAX / 4 &&
                summary.points <= FV_TRAJECTORY_POINTS_MAX);
    double stride = summary.centres[1][0] - summary.centres[0][0];
    for (uint32_t i = 0; i < summary.points; i++)
        assert_true(summary.centres[i][0] == stride * i);
    fv_trajectory_close(trajectory);

    FILE *file = fopen(path, "r");
    assert_int_equal(fscanf(file, "# map 0%*1[\n]"), 0);
    for (int n = 0; n < COUNT; n++) {
        long long seconds, rest;
        double t[3], q[4], R[9];
        assert_int_equal(fscanf(file, "%lld.%lld %lf %lf %lf %lf %lf %lf %lf", &seconds, &rest,
                                &t[0], &t[1], &t[2], &q[0], &q[1], &q[2], &q[3]),
                         9);
        assert_int_equal(seconds * 1000000000 + rest, samples[n].stamp_ns);
        assert_true(t[0] == n && t[2] == n + 0.5);
        const double x = q[0], y = q[1], z = q[2], w = q[3];
        const double expected[9] = {
            1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
            2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
        memcpy(R, expected, sizeof R);
        for (int i = 0; i < 9; i++)
            assert_true(fabs(R[i] - samples[n].T_world_cam[i / 3 * 4 + i % 3]) < 1e-7);
    }
    fclose(file);
    unlink(path);
    assert_int_equal(fv_trajectory_open("/nowhere/path.tum", &trajectory, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "/nowhere/path.tum"));
}

/* A line before each stretch in one map says which; of the truth, which is in none, nothing. */
static void test_maps_are_marked(void **state)
{
    (void)state;
    static const uint32_t maps[] = {0, 0, 7, 7, 0, FV_TRAJECTORY_NO_MAP};
    static const char expected[] = "# map 0\n0 0 # map 7\n7 7 # map 0\n0 ";
    char path[] = "/tmp/fovea-test-XXXXXX", line[256], found[256] = "";
    struct fv_trajectory *trajectory;
    struct fv_trajectory_summary summary;
    struct fovea_error error;
    close(mkstemp(path));
    assert_int_equal(fv_trajectory_open(path, &trajectory, &error), FOVEA_OK);
    for (int n = 0; n < 6; n++) {
        const struct fv_trajectory_sample sample = {
            .map = maps[n], .T_world_cam = {1, 0, 0, maps[n] % 100, 0, 1, 0, 0, 0, 0, 1, 0}};
        assert_true(fv_trajectory_add(trajectory, &sample));
    }
    fv_trajectory_finish(trajectory, &summary);
    fv_trajectory_close(trajectory);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    int poses = 0;
    while (fgets(line, sizeof line, file) != NULL) {
        double seconds, x;
        if (line[0] != '#' && poses < 5) {
            assert_int_equal(sscanf(line, "%lf %lf", &seconds, &x), 2);
            snprintf(line, sizeof line, "%.0f ", x);
        } else if (line[0] != '#') {
            line[0] = '\0';
        }
        poses += line[0] != '#';
        strcat(found, line);
    }
    fclose(file);
    unlink(path);
    assert_int_equal(poses, 6);
    assert_string_equal(found, expected);
}

/* A folder gets a file per map, and a map that is met again goes on in its own. */
static void test_a_file_for_each_map(void **state)
{
    (void)state;
    static const uint32_t maps[] = {3, 3, 8, 3};
    char folder[] = "/tmp/fovea-test-XXXXXX", path[64], text[256];
    struct fv_trajectory *trajectory;
    struct fovea_error error;
    struct fv_trajectory_summary summary;
    assert_non_null(mkdtemp(folder));
    static const char *const before[] = {"map-12.tum", "map-3.tum", "map-x.tum", "map-.tum",
                                         "map-1.tum.old"};
    snprintf(path, sizeof path, "%s/maps", folder);
    assert_int_equal(mkdir(path, 0777), 0);
    for (int k = 0; k < 5; k++) { /* of an earlier run two, of others three */
        snprintf(path, sizeof path, "%s/maps/%s", folder, before[k]);
        fv_test_write_text(path, "earlier\n");
    }
    snprintf(path, sizeof path, "%s/maps/", folder);
    assert_int_equal(fv_trajectory_open(path, &trajectory, &error), FOVEA_OK);
    for (int n = 0; n < 4; n++) {
        const struct fv_trajectory_sample sample = {
            .map = maps[n], .T_world_cam = {1, 0, 0, n, 0, 1, 0, 0, 0, 0, 1, 0}};
        assert_true(fv_trajectory_add(trajectory, &sample));
    }
    fv_trajectory_finish(trajectory, &summary);
    assert_int_equal(summary.failed, 0);
    fv_trajectory_close(trajectory);
    static const struct {
        const char *name, *expected;
    } files[] = {{"map-3.tum", "# map 3\n0.000000000 0 0 0 0 0 0 1\n0.000000000 1 0 0 0 0 0 1\n"
                               "# map 3\n0.000000000 3 0 0 0 0 0 1\n"},
                 {"map-8.tum", "# map 8\n0.000000000 2 0 0 0 0 0 1\n"}};
    for (int k = 0; k < 2; k++) {
        snprintf(path, sizeof path, "%s/maps/%s", folder, files[k].name);
        FILE *file = fopen(path, "r");
        assert_non_null(file);
        text[fread(text, 1, sizeof text - 1, file)] = '\0';
        fclose(file);
        assert_string_equal(text, files[k].expected);
        assert_int_equal(unlink(path), 0);
    }
    for (int k = 2; k < 5; k++) {
        snprintf(path, sizeof path, "%s/maps/%s", folder, before[k]);
        assert_int_equal(unlink(path), 0);
    }
    snprintf(path, sizeof path, "%s/maps", folder);
    assert_int_equal(rmdir(path), 0); /* nothing else is there */
    assert_int_equal(rmdir(folder), 0);
}

static void test_full_disk(void **state)
{
    (void)state;
    struct fv_trajectory *trajectory;
    struct fv_trajectory_summary summary;
    struct fovea_error error;
    const struct fv_trajectory_sample sample = {
        .T_world_cam = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    assert_int_equal(fv_trajectory_open("/dev/full", &trajectory, &error), FOVEA_OK);
    assert_true(fv_trajectory_add(trajectory, &sample));
    fv_trajectory_finish(trajectory, &summary);
    assert_int_equal(summary.samples, 1);
    assert_int_equal(summary.failed, ENOSPC);
    fv_trajectory_close(trajectory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_similarity_is_found), cmocka_unit_test(test_several_maps),
        cmocka_unit_test(test_no_extent),           cmocka_unit_test(test_file_and_points),
        cmocka_unit_test(test_maps_are_marked),     cmocka_unit_test(test_full_disk),
        cmocka_unit_test(test_a_file_for_each_map),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
