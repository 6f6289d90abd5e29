/* The rig in the configuration: what is refused, and the masks of all its cameras in the block. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "fovea/fovea.h"
#include "runtime/state.h"

static struct fovea_config config;
static struct fovea_error error;

/* Two calibrated cameras of different sizes, a third that is not calibrated, an inertial sensor. */
static int make_config(void **state)
{
    static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    struct fovea_rig *rig = &config.rig;
    (void)state;
    fovea_config_default(&config);
    config.odometry.keyframes = 8;
    config.odometry.landmarks = 1000;
    rig->cameras[0].camera = (struct fovea_camera){
        .width = 160, .height = 120, .fx = 150, .fy = 150, .cx = 80, .cy = 60};
    rig->camera_count = 3;
    rig->cameras[1] = rig->cameras[0];
    rig->cameras[1].camera.width = 96;
    rig->cameras[1].camera.height = 64;
    rig->cameras[2].camera = (struct fovea_camera){.width = 64, .height = 80};
    rig->has_imu = true;
    memcpy(rig->imu.T_body_imu, identity, sizeof identity);
    for (int i = 0; i < 2; i++)
        if (fovea_camera_prepare(&rig->cameras[i].camera, &error) != FOVEA_OK) return -1;
    return 0;
}

static void expect_refused(const char *text)
{
    size_t bytes;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    if (strstr(error.text, text) == NULL) fail_msg("found \"%s\", expected %s", error.text, text);
    make_config(NULL);
}

static void wrong_rigs_are_refused_by_name(void **state)
{
    static const uint8_t mask[64 * 80];
    struct fovea_rig *rig = &config.rig;
    size_t bytes;
    (void)state;
    if (fovea_size(&config, &bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
    rig->camera_count = 0;
    expect_refused("rig.camera_count: found 0, expected 1 to 4");
    rig->camera_count = 5;
    expect_refused("rig.camera_count: found 5, expected 1 to 4");
    rig->cameras[0].calibrated = false;
    expect_refused("rig.cameras[0]: found no calibration");
    rig->cameras[0].has_T_body_cam = false;
    expect_refused("rig.cameras[0]: found no T_body_cam");
    rig->cameras[1].camera.width = 5000;
    expect_refused("rig.cameras[1].camera width: found 5000, expected 64 to 4096");
    rig->cameras[1].camera.fx = NAN;
    expect_refused("rig.cameras[1].camera fx: found nan");
    rig->cameras[1].camera.field_max_rad = 0;
    expect_refused("rig.cameras[1].camera field_max_rad");
    rig->cameras[1].T_body_cam[5] = -1;
    expect_refused("rig.cameras[1].T_body_cam: found a reflection");
    rig->cameras[1].T_body_cam[5] = NAN;
    expect_refused("rig.cameras[1].T_body_cam: found nan");
    rig->imu.T_body_imu[0] = 0.5;
    expect_refused("rig.imu.T_body_imu: found 0.25");
    rig->imu.gyro_noise = -1;
    expect_refused("rig.imu.gyro_noise: found -1, expected 0 to");
    rig->cameras[2].camera.height = 0; /* a mask of no known size */
    rig->cameras[2].mask = mask;
    expect_refused("rig.cameras[2].camera height: found 0");
    rig->cameras[3].camera.fx = NAN; /* beyond the rig's cameras: not looked at */
    if (fovea_size(&config, &bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
}

static void each_camera_keeps_a_mask_of_its_own_size(void **state)
{
    uint8_t *first = malloc(160 * 120), *third = malloc(64 * 80);
    size_t bytes, without;
    struct fovea *rt, *copy;
    (void)state;
    make_config(NULL);
    memset(first, 255, 160 * 120);
    memset(third, 7, 64 * 80);
    assert_int_equal(fovea_size(&config, &without, &error), FOVEA_OK);
    config.rig.cameras[0].mask = first;
    config.rig.cameras[2].mask = third;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_OK);
    assert_true(bytes >= without + 160 * 120 + 64 * 80);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, bytes);
    void *other = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, bytes);
    assert_int_equal(fovea_init(memory, bytes, &config, &rt, &error), FOVEA_OK);
    free(first); /* the runtime has copies of its own */
    free(third);
    assert_int_equal(fovea_copy(rt, other, bytes, &copy), FOVEA_OK);
    free(memory);
    const struct fovea_rig_camera *kept = copy->config.rig.cameras;
    assert_true(kept[0].mask[0] == 255 && kept[0].mask[160 * 120 - 1] == 255);
    assert_null(kept[1].mask);
    assert_true(kept[2].mask[0] == 7 && kept[2].mask[64 * 80 - 1] == 7);
    assert_true(kept[2].mask > (uint8_t *)other && kept[2].mask < (uint8_t *)other + bytes);
    free(other);
    make_config(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wrong_rigs_are_refused_by_name),
        cmocka_unit_test(each_camera_keeps_a_mask_of_its_own_size),
    };
    return cmocka_run_group_tests(tests, make_config, NULL);
}
