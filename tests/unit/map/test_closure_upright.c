/* Closures and merged maps in which gravity is known: roll and pitch stay what they are, whatever
 * the relation says of them; what it tilts too far is another place; maps that do not know of
 * gravity learn it. */
#include "common/closure_ring.h"
#include "fovea/odometry.h"

static const double true_down[3] = {0, -1, 0};

/* The current map knows gravity, as the drift has it there, from now on. */
static void show_gravity(double sigma)
{
    fv_rotate3(w.drift.R, true_down, w.map.state->gravity.down);
    w.map.state->gravity.sigma = sigma;
}

static void hold_metres(void)
{
    w.map.state->scale = (struct fv_map_scale){FOVEA_SCALE_STEREO, 0, 0, 1e-5};
}

static void make_metric_world(uint64_t seed)
{
    measures = true;
    make_world(seed);
    measures = false;
    w.step[6] = 0;
}

/* What each keyframe has for down in its own axes, by the map's gravity. */
static double own_down[KEYFRAMES][3];

static void note_tilts(void)
{
    struct fv_map_gravity gravity;
    for (uint32_t n = 0; n < w.count; n++) {
        const struct fv_keyframe *k = &w.map.keyframes[w.slot[n]];
        assert_true(fv_map_gravity_of(&w.map, k->map_id, &gravity));
        fv_rotate3(k->T_cam_world.R, gravity.down, own_down[n]);
    }
}

/* By how much it is another now, the most of all keyframes, rad. */
static double most_tilted(void)
{
    struct fv_map_gravity gravity;
    double most = 0;
    for (uint32_t n = 0; n < w.count; n++) {
        const struct fv_keyframe *k = &w.map.keyframes[w.slot[n]];
        double now[3], off[3];
        assert_true(fv_map_gravity_of(&w.map, k->map_id, &gravity));
        fv_rotate3(k->T_cam_world.R, gravity.down, now);
        fv_subtract3(now, own_down[n], off);
        most = fmax(most, fv_norm3(off));
    }
    return most;
}

/* Go round until a correction is about to be made, by the graph or as it is; false where none is.
 */
static bool go_round(void)
{
    while (w.count < KEYFRAMES) {
        add_keyframe();
        offer(w.count - 1);
        while (fv_closure_waiting(&w.closure)) {
            struct fv_closure_outcome outcome;
            if (w.closure.state->phase == FV_CLOSURE_GRAPH ||
                w.closure.state->phase == FV_CLOSURE_COMMIT)
                return true;
            (void)fv_closure_unit(&w.closure, &w.map, &w.kernels, &outcome);
        }
    }
    return false;
}

/* A world frame in metres leaves 4 degrees of freedom, another 5: what drifted in yaw and place,
 * and in scale, is corrected, and what drifted in tilt is not. */
static void test_roll_and_pitch_stay(void **context)
{
    (void)context;
    for (int metric = 0; metric < 2; metric++)
        for (uint64_t seed = 5; seed < 9; seed++) {
            if (metric)
                make_metric_world(seed);
            else
                make_world(seed);
            if (metric) hold_metres();
            show_gravity(0.002);
            assert_true(go_round());
            const double off = fabs(distance_off(w.count - 1, 2));
            note_tilts();
            assert_true(work(false));
            assert_int_equal(w.closure.state->counts.closed, 1);
            assert_true(most_tilted() < 1e-9);
            assert_true(off > 0.2 && fabs(distance_off(w.count - 1, 2)) < 0.3 * off);
            assert_true(metric == (w.map.state->S_map_world.s == 1));
            free(w.memory);
        }
}

/* A relation that is wrong by 2 degrees in tilt tilts a map without gravity, and none with it. */
static void test_wrong_tilt_does_not_tilt_the_map(void **context)
{
    (void)context;
    const double turn[3] = {0.035, 0, 0};
    double R[9], tilted[9], most[2];
    fv_so3_exp(turn, R);
    for (int upright = 0; upright < 2; upright++) {
        make_metric_world(7);
        hold_metres();
        if (upright) show_gravity(0.002);
        assert_true(go_round());
        struct fv_sim3 *S = &w.closure.state->S_keyframe_candidate;
        fv_multiply33(R, S->R, tilted);
        memcpy(S->R, tilted, sizeof tilted);
        if (!upright) show_gravity(0.002);
        note_tilts();
        if (!upright) w.map.state->gravity.sigma = 0;
        assert_true(work(false));
        w.map.state->gravity.sigma = 0.002;
        most[upright] = most_tilted();
        free(w.memory);
    }
    assert_true(most[1] < 1e-9 && most[0] > 5e-3);
}

static const double first[7] = {1, 0, 2, 0, 0.4, 0.1, 0}, second[7] = {3, 1, -2, 0.5, 1, -0.3, 0};

/* Fifteen keyframes of a map in a world that `x` takes the true one to. */
static void make_first_map(const double x[7])
{
    memset(w.step, 0, sizeof w.step);
    fv_sim3_exp(x, &w.drift);
    for (int i = 0; i < 15; i++) {
        add_keyframe();
        offer(w.count - 1);
        assert_false(work(false));
    }
}

static void begin_another(const double x[7])
{
    fv_map_begin_another(&w.map);
    fv_sim3_exp(x, &w.drift);
    memset(w.landmark_of, 0xff, sizeof w.landmark_of);
    w.map.keyframes[fv_map_current(&w.map)].parent = FV_MAP_NONE;
}

static double angle(const double a[3], const double b[3])
{
    double across[3];
    fv_cross3(a, b, across);
    return atan2(fv_norm3(across), fv_dot3(a, b));
}

static void test_maps_in_metres_merge_upright(void **context)
{
    (void)context;
    struct fv_map_gravity was, is;
    make_metric_world(6);
    hold_metres();
    make_first_map(first);
    show_gravity(0.002);
    const uint32_t older = w.map.state->map_id;
    assert_true(fv_map_gravity_of(&w.map, older, &was));
    begin_another(second);
    hold_metres();
    show_gravity(0.002);
    w.map.state->gravity.down[0] += 0.006; /* known to that */
    (void)fv_normalise3(w.map.state->gravity.down);
    assert_true(go_round());
    note_tilts();
    assert_true(work(false));
    assert_int_equal(w.closure.state->counts.merged, 1);
    assert_int_equal(w.map.state->map_id, older);
    assert_true(w.closure.state->correction.s == 1 && most_tilted() < 1e-9);
    assert_true(fv_map_gravity_of(&w.map, older, &is)); /* that of the younger, turned with it */
    assert_true(angle(was.down, is.down) < 1e-9);
    assert_true(fabs(distance_off(w.count - 1, 2)) < 0.1);
    check_links();
    free(w.memory);
}

/* The same, but that gravity of the two differs by more than it may, or is the other way round. */
static void test_a_tilted_place_is_another(void **context)
{
    (void)context;
    for (int tilted = 0; tilted < 3; tilted++) {
        make_metric_world(6);
        hold_metres();
        make_first_map(first);
        show_gravity(0.002);
        begin_another(second);
        hold_metres();
        show_gravity(0.002);
        w.map.state->gravity.down[0] += tilted == 1 ? 0.06 : tilted == 0 ? 0.02 : 0;
        (void)fv_normalise3(w.map.state->gravity.down);
        for (int i = 0; i < 3 && tilted == 2; i++)
            w.map.state->gravity.down[i] *= -1;
        assert_true(go_round() == !tilted);
        assert_true(w.closure.state->counts.confirmed > 0);
        assert_true((w.closure.state->counts.implausible > 0) == (tilted != 0));
        free(w.memory);
    }
}

/* Gravity that is known to 12 degrees only, and is off by as much: maps are joined as pictures have
 * them. */
static void test_gravity_known_roughly_holds_nothing(void **context)
{
    (void)context;
    make_metric_world(6);
    hold_metres();
    make_first_map(first);
    show_gravity(0.2);
    begin_another(second);
    hold_metres();
    show_gravity(0.2);
    w.map.state->gravity.down[0] += 0.4;
    (void)fv_normalise3(w.map.state->gravity.down);
    assert_true(go_round());
    assert_true(work(false));
    assert_int_equal(w.closure.state->counts.merged, 1);
    assert_true(fabs(distance_off(w.count - 1, 2)) < 0.01);
    free(w.memory);
}

/* Maps by one camera, each with its unit and the metres of that, known to some per cent: they are
 * joined by 5 degrees of freedom, and where they differ by far more the place is another. */
static void test_metres_of_two_maps_agree(void **context)
{
    (void)context;
    const double unit[7] = {3, 1, -2, 0.5, 1, -0.3, 0.6};
    for (int run = 0; run < 3; run++) { /* the last: as far off, but known as roughly */
        const bool is_far = run > 0, wrong = run == 1;
        const double variance = run == 2 ? 0.01 : 4e-4;
        make_world(6);
        make_first_map(first);
        show_gravity(0.002);
        w.map.state->scale = (struct fv_map_scale){FOVEA_SCALE_INERTIAL, 0, 0.03, variance};
        begin_another(unit);
        show_gravity(0.002);
        w.map.state->scale =
            (struct fv_map_scale){FOVEA_SCALE_INERTIAL, 0, -0.6 - (is_far ? 0.3 : 0.04), variance};
        assert_true(go_round() == !wrong);
        assert_true(w.closure.state->counts.confirmed > 0);
        assert_true((w.closure.state->counts.implausible > 0) == wrong);
        if (!wrong) {
            note_tilts();
            assert_true(work(false) && most_tilted() < 1e-9);
            assert_true(fabs(log(w.map.state->S_map_world.s) + 0.6) < 0.01);
            assert_true(fabs(distance_off(w.count - 1, 2)) < 0.1);
        }
        free(w.memory);
    }
}

/* A map of any unit and tilt that an upright one in metres comes round to, as one that was loaded:
 * all 7 degrees of freedom are found, and it is metric and upright from then on. The other way
 * round an upright map makes the younger one so. */
static void test_the_map_that_knows_gravity_tells_the_other(void **context)
{
    (void)context;
    const double other_unit[7] = {1, 0, 2, 0, 0.4, 0.1, 0.6};
    for (int younger_knows = 0; younger_knows < 2; younger_knows++) {
        struct fv_map_gravity gravity;
        double expected[3];
        make_metric_world(6);
        make_first_map(younger_knows ? other_unit : first);
        const struct fv_sim3 drift = w.drift;
        if (!younger_knows) show_gravity(0.004);
        const uint32_t older = w.map.state->map_id;
        begin_another(second);
        hold_metres();
        if (younger_knows) show_gravity(0.004);
        assert_true(go_round());
        assert_true(work(false));
        assert_int_equal(w.closure.state->counts.merged, 1);
        assert_int_equal(w.map.state->map_id, older);
        assert_true(fv_map_gravity_of(&w.map, older, &gravity));
        fv_rotate3(drift.R, true_down, expected);
        assert_true(angle(expected, gravity.down) < 5e-3 && gravity.sigma == 0.004);
        assert_true(fv_map_metric(&w.map));
        fv_rotate3(w.drift.R, true_down, expected); /* in `odom` as it was all the time */
        assert_true(angle(expected, w.map.state->gravity.down) < 5e-3);
        assert_true(fabs(distance_off(w.count - 1, 2)) < 0.1);
        free(w.memory);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_roll_and_pitch_stay),
        cmocka_unit_test(test_wrong_tilt_does_not_tilt_the_map),
        cmocka_unit_test(test_maps_in_metres_merge_upright),
        cmocka_unit_test(test_a_tilted_place_is_another),
        cmocka_unit_test(test_gravity_known_roughly_holds_nothing),
        cmocka_unit_test(test_metres_of_two_maps_agree),
        cmocka_unit_test(test_the_map_that_knows_gravity_tells_the_other),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
