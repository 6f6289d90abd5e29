/* Metres per unit of each map, and gravity in it, as its own frame is now. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

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
    assert_true(fabs(fv_map_scale_of(&map, 7, NULL) - 0.5) < 1e-12);
    assert_true(fabs(fv_map_scale_of(&map, 3, NULL) - 6) < 1e-12);
    assert_true(fv_map_scale_of(&map, 5, NULL) == 0); /* not known */
    assert_true(fv_map_scale_of(&map, 9, NULL) == 0); /* no such map */
    s.left_count = 1;
    assert_true(fv_map_scale_of(&map, 3, NULL) == 0); /* not written yet */
}

static void each_map_has_its_own_gravity(void **state)
{
    (void)state;
    static const double quarter[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1}; /* about z */
    struct fv_map_gravity gravity;
    s = (struct fv_map_state){.map_id = 7, .left_count = 2};
    fv_sim3_identity(&s.S_map_world);
    memcpy(s.S_map_world.R, quarter, sizeof quarter); /* a correction has turned the map */
    s.S_map_world.s = 3;
    s.gravity = (struct fv_map_gravity){{0.6, 0, 0.8}, 0.02};
    s.left[1].map_id = 3;
    fv_sim3_identity(&s.left[1].S_map_world);
    s.left[1].gravity = (struct fv_map_gravity){{0, 1, 0}, 0.01};
    assert_true(fv_map_gravity_of(&map, 7, &gravity));
    assert_true(fabs(gravity.down[0]) < 1e-12 && fabs(gravity.down[1] - 0.6) < 1e-12 &&
                fabs(gravity.down[2] - 0.8) < 1e-12 && gravity.sigma == 0.02);
    assert_true(fv_map_gravity_of(&map, 3, &gravity));
    assert_true(gravity.down[1] == 1 && gravity.sigma == 0.01);
    assert_false(fv_map_gravity_of(&map, 0, &gravity)); /* that of left[0], not known */
    assert_false(fv_map_gravity_of(&map, 9, &gravity)); /* no such map */
    fv_map_begin_another(&(struct fv_map){.state = &s});
    assert_false(fv_map_gravity_of(&map, s.map_id, &gravity));
    assert_true(fv_map_gravity_of(&map, 7, &gravity) && fabs(gravity.down[1] - 0.6) < 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(each_map_has_its_own_scale),
                                       cmocka_unit_test(each_map_has_its_own_gravity)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
