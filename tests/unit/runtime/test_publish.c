/* What stays of `odom` when odometry has another map. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "runtime/publish.h"

static struct fv_publish_state state;
static struct fv_odometry_state odometry_state;
static struct fv_publish publish = {.state = &state};
static const struct fv_odometry odometry = {.state = &odometry_state};

/* A world in metres and upright, in which a pose was sent. */
static int begin(void **unused)
{
    (void)unused;
    memset(&state, 0, sizeof state);
    memset(&odometry_state, 0, sizeof odometry_state);
    fv_se3_identity(&publish.T_body_cam);
    for (int k = 0; k < 3; k++)
        state.upright[4 * k] = 1;
    state.metric = state.is_upright = state.sent = state.changes = 1;
    return 0;
}

static void step_lost(uint32_t map_id, uint32_t reset_counter)
{
    odometry_state.pose = (struct fovea_pose){
        .state = FOVEA_TRACKING_LOST, .map_id = map_id, .reset_counter = reset_counter};
    fv_publish_step(&publish, &odometry, NULL, NULL, 100);
}

static void a_loss_leaves_it(void **unused)
{
    (void)unused;
    step_lost(0, 0);
    assert_true(state.metric && state.is_upright && state.sent && state.changes == 1);
}

/* The number changes with the loss, the counter where another map begins, later. */
static void a_map_that_is_given_up_ends_it(void **unused)
{
    (void)unused;
    step_lost(1, 0);
    assert_true(!state.metric && !state.is_upright && !state.sent && state.changes == 0);
}

static void an_older_map_has_another(void **unused)
{
    (void)unused;
    step_lost(1, 1);
    assert_true(!state.metric && !state.is_upright && !state.sent && state.changes == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_loss_leaves_it, begin),
        cmocka_unit_test_setup(a_map_that_is_given_up_ends_it, begin),
        cmocka_unit_test_setup(an_older_map_has_another, begin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
