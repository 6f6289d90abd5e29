/* Closures and merged maps in metres: corrections are motions, what has other lengths is another
 * place, and maps of other units come to metres. */
#include "common/closure_ring.h"
#include "fovea/odometry.h"

/* The current map is in metres from now on, by two cameras. */
static void hold_metres(void)
{
    w.map.state->scale = (struct fv_map_scale){FOVEA_SCALE_STEREO, 0, 0, 1e-5};
    assert_true(fv_map_metric(&w.map));
}

static void make_metric_world(uint64_t seed)
{
    measures = true;
    make_world(seed);
    measures = false;
    w.step[6] = 0;
}

static bool go_round(void)
{
    bool closed = false;
    while (w.count < KEYFRAMES && !closed) {
        add_keyframe();
        offer(w.count - 1);
        closed = work(false);
    }
    return closed;
}

/* Lost, and another map begun in a world of its own, which `x` takes the true one to. */
static void begin_another(const double x[7])
{
    fv_map_begin_another(&w.map);
    fv_sim3_exp(x, &w.drift);
    memset(w.landmark_of, 0xff, sizeof w.landmark_of);
    w.map.keyframes[fv_map_current(&w.map)].parent = FV_MAP_NONE;
}

/* Fifteen keyframes in a world that `x` takes the true one to, without drift. */
static void make_first_map(const double x[7])
{
    w.step[0] = w.step[1] = w.step[2] = w.step[3] = w.step[4] = 0;
    fv_sim3_exp(x, &w.drift);
    for (int i = 0; i < 15; i++) {
        add_keyframe();
        offer(w.count - 1);
        assert_false(work(false));
    }
}

/* Right closures are all taken, with the noise that pixels have and drift over some keyframes. */
static void test_metres_stay_metres(void **context)
{
    (void)context;
    for (uint64_t seed = 1; seed <= 12; seed++) {
        make_metric_world(seed);
        hold_metres();
        assert_true(go_round());
        assert_int_equal(w.closure.state->counts.implausible, 0);
        assert_true(w.closure.state->correction.s == 1);
        assert_true(fv_map_metric(&w.map) && w.map.state->S_map_world.s == 1);
        assert_true(fabs(distance_off(w.count - 1, 2)) < 0.2);
        for (uint32_t i = 0; i < w.closure.graph.state->node_count; i++)
            assert_true(fabs(w.closure.graph.nodes[i].S.s - 1) < 1e-12);
        free(w.memory);
    }
}

/* The same place, but that its lengths are 9 % others: of metres that is not so. */
static void test_other_lengths_are_another_place(void **context)
{
    (void)context;
    for (int metric = 0; metric < 2; metric++) {
        make_metric_world(5);
        w.step[6] = 0.0015;
        if (metric) hold_metres();
        assert_true(go_round() == !metric);
        assert_true(w.closure.state->counts.confirmed > 0);
        assert_true(w.closure.state->counts.implausible > 0 || !metric);
        free(w.memory);
    }
}

static void test_maps_in_metres_merge_by_a_motion(void **context)
{
    (void)context;
    const double first[7] = {1, 0, 2, 0, 0.4, 0.1, 0}, second[7] = {3, 1, -2, 0.5, 1, -0.3, 0};
    make_metric_world(6);
    hold_metres();
    make_first_map(first);
    begin_another(second);
    hold_metres();
    assert_true(go_round());
    assert_int_equal(w.closure.state->counts.merged, 1);
    assert_true(w.closure.state->correction.s == 1 && fv_map_metric(&w.map));
    assert_true(fabs(distance_off(w.count - 1, 2)) < 0.05);
    free(w.memory);
}

/* A map of any unit that a run in metres comes round to, as one that was loaded, is in metres from
 * then on; where it has its origin and how it is turned stays. */
static void test_unscaled_map_comes_to_metres(void **context)
{
    (void)context;
    const double first[7] = {1, 0, 2, 0, 0.4, 0.1, 0.6}, second[7] = {3, 1, -2, 0.5, 1, -0.3, 0};
    make_metric_world(6);
    make_first_map(first);
    const uint32_t older = w.map.state->map_id;
    const struct fv_se3 was = w.map.keyframes[w.slot[7]].T_cam_world;
    const double depth = w.map.keyframes[w.slot[7]].depth;
    assert_true(!fv_map_metric(&w.map) && fabs(distance_off(14, 0)) > 1);
    begin_another(second);
    hold_metres();
    assert_true(go_round());
    assert_int_equal(w.closure.state->counts.merged, 1);
    assert_int_equal(w.map.state->map_id, older);
    assert_true(fv_map_metric(&w.map) && w.map.state->S_map_world.s == 1);
    const struct fv_keyframe *now = &w.map.keyframes[w.slot[7]];
    assert_memory_equal(now->T_cam_world.R, was.R, sizeof was.R);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(now->T_cam_world.t[i] - was.t[i] * exp(-0.6)) < 0.02);
    assert_true(fabs(now->depth / depth - exp(-0.6)) < 0.005);
    assert_int_equal(changed.stretched_map, older);
    assert_true(fabs(changed.stretch - exp(-0.6)) < 0.005);
    assert_true(fabs(distance_off(14, 0)) < 0.05 && fabs(distance_off(w.count - 1, 2)) < 0.05);
    check_links();
    free(w.memory);
}

/* Until a correction is about to be made; false where none is. */
static bool go_round_to_commit(void)
{
    while (w.count < KEYFRAMES) {
        add_keyframe();
        offer(w.count - 1);
        while (fv_closure_waiting(&w.closure)) {
            struct fv_closure_outcome outcome;
            if (w.closure.state->phase == FV_CLOSURE_COMMIT) return true;
            (void)fv_closure_unit(&w.closure, &w.map, &w.kernels, &outcome);
        }
    }
    return false;
}

/* Both maps were left when one comes to metres: entered again, its `odom` is what it was. */
static void test_odom_of_a_map_that_was_left_stays(void **context)
{
    (void)context;
    const double first[7] = {1, 0, 2, 0, 0.4, 0.1, 0.6}, second[7] = {3, 1, -2, 0.5, 1, -0.3, 0};
    double before[3], after[3];
    make_metric_world(6);
    make_first_map(first);
    const uint32_t older = w.map.state->map_id;
    centre_in_odom(w.slot[7], before);
    begin_another(second);
    hold_metres();
    assert_true(go_round_to_commit());
    fv_map_begin_another(&w.map);
    assert_true(work(false));
    assert_int_equal(changed.stretched_map, older);
    assert_true(fabs(changed.stretch - exp(-0.6)) < 0.005);
    fv_map_enter(&w.map, older);
    assert_int_equal(w.map.state->odom_id, older);
    centre_in_odom(w.slot[7], after);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(after[i] - before[i]) < 1e-9);
    free(w.memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_metres_stay_metres),
        cmocka_unit_test(test_other_lengths_are_another_place),
        cmocka_unit_test(test_maps_in_metres_merge_by_a_motion),
        cmocka_unit_test(test_unscaled_map_comes_to_metres),
        cmocka_unit_test(test_odom_of_a_map_that_was_left_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
