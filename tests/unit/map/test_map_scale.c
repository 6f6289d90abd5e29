/* Metres per unit of each map, as its own frame is now. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "fovea/odometry.h"
#include "map/map.h"

static struct fv_map_state s;
static const struct fv_map map = {.state = &s};

static void each_map_has_its_own_scale(void **state)
{
    (void)state;
    s.map_id = 7;
    s.S_map_world.s = 4; /* a correction has given the map another unit */
    s.scale = (struct fv_map_scale){.source = FOVEA_SCALE_INERTIAL, .log_scale = log(2)};
    s.left[1].map_id = 3;
    s.left[1].S_map_world.s = 0.5;
    s.left[1].scale = (struct fv_map_scale){.source = FOVEA_SCALE_STEREO, .log_scale = log(3)};
    s.left[2].map_id = 5;
    s.left[2].S_map_world.s = 1;
    s.left_count = 3;
    assert_true(fabs(fv_map_scale_of(&map, 7) - 0.5) < 1e-12);
    assert_true(fabs(fv_map_scale_of(&map, 3) - 6) < 1e-12);
    assert_true(fv_map_scale_of(&map, 5) == 0); /* not known */
    assert_true(fv_map_scale_of(&map, 9) == 0); /* no such map */
    s.left_count = 1;
    assert_true(fv_map_scale_of(&map, 3) == 0); /* not written yet */
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(each_map_has_its_own_scale)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
