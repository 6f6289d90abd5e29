/* Rays of the simulated camera: those of fovea_camera_unproject, bit for bit, of every lens, and
 * refused where it refuses one or one looks too far aside. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "../../../drivers/sim/sim.h"

enum { WIDTH = 203, HEIGHT = 150 };

static const struct fovea_camera cameras[] = {
    {.lens = FOVEA_LENS_RADTAN, .fx = 124, .fy = 123, .k = {-.2834, .074, .0002, .0000176}},
    {.lens = FOVEA_LENS_RADTAN, .fx = 150, .fy = 150},
    {.lens = FOVEA_LENS_RADTAN, .fx = 90, .fy = 95, .k = {-.0167, .0129, .004, -.002, -.004}},
    {.lens = FOVEA_LENS_RADTAN, .fx = 60, .fy = 60, .k = {.2, -.03, 0, 0, .01}},
    {.lens = FOVEA_LENS_RADTAN, .fx = 160, .fy = 159, .k = {.3, -.02, .001, -.0007, .001, .6, .05}},
    {.lens = FOVEA_LENS_EQUIDISTANT, .fx = 100, .fy = 101, .k = {.0247, -.0224, .0188, -.0068}},
    /* Of these a part is not seen, or looks aside. */
    {.lens = FOVEA_LENS_RADTAN, .fx = 95, .fy = 95, .k = {-.3}},
    {.lens = FOVEA_LENS_EQUIDISTANT, .fx = 60, .fy = 60},
};

static bool expected_of(const struct fovea_camera *camera, double x, double y, double at[2])
{
    double bearing[3];
    if (fovea_camera_unproject(camera, (const double[2]){x, y}, bearing, NULL) != FOVEA_OK ||
        bearing[2] < 0.1)
        return false;
    at[0] = bearing[0] / bearing[2];
    at[1] = bearing[1] / bearing[2];
    return true;
}

static void rays_are_those_of_the_camera(void **state)
{
    (void)state;
    int whole = 0, refused = 0;
    for (size_t c = 0; c < sizeof cameras / sizeof cameras[0]; c++) {
        struct fovea_camera camera = cameras[c];
        struct fovea_error error;
        camera.width = WIDTH;
        camera.height = HEIGHT;
        camera.cx = WIDTH / 2.0 + 3.3;
        camera.cy = HEIGHT / 2.0 - 2.1;
        if (fovea_camera_prepare(&camera, &error) != FOVEA_OK) fail_msg("%s", error.text);
        for (int y = -1; y < HEIGHT; y++) {
            double found[WIDTH][2], expected[WIDTH][2];
            int seen = 0, count = WIDTH - (y & 7); /* also rows that fill no vector */
            for (int x = 0; x < count; x++)
                seen += expected_of(&camera, x - 1, y, expected[x]);
            assert_true(fv_sim_rays(&camera, -1, y, count, found) == (seen == count));
            if (seen == count)
                assert_memory_equal(found, expected, (size_t)count * sizeof found[0]);
            whole += seen == count;
            refused += seen < count;
        }
    }
    print_message("%d rows are seen, %d are not\n", whole, refused);
    assert_true(whole > 6 * HEIGHT && refused > HEIGHT / 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(rays_are_those_of_the_camera)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
