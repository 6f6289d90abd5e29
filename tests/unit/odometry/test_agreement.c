/* Agreement of the pictures with the map: good on a right map; on one whose keyframes are put wrong
 * it falls, no pose is `tracking`, and the map is given up. A map that begins in doubt is withheld.
 * And drives on which maps went wrong: none is published as tracking. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "runtime/state.h"
#include "common/sim_rig.h"

static struct sim_rig rig;

enum { FRAMES = 150 };

/* Turn the newest keyframe, as a wrong pose would: the pictures say otherwise. */
static void spoil_newest(struct fv_odometry *o)
{
    struct fv_se3 *T = &o->map.keyframes[o->state->newest].T_cam_world, off;
    const double turn[3] = {0.02, -0.03, 0.02};
    fv_so3_exp(turn, off.R);
    memset(off.t, 0, sizeof off.t);
    fv_se3_compose(&off, T, T);
}

static void check_newest(struct fv_odometry *o)
{
    fv_odometry_agreement_queue(o, o->state->newest);
    while (fv_odometry_agreement_waiting(o) || fv_odometry_agreement_fits(o))
        fv_odometry_agreement_unit(o, &rig.rt->kernels);
}

static void run_to(int frame)
{
    while (rig.frames < frame && sim_rig_next(&rig))
        sim_rig_process(&rig);
}

static void a_right_map_agrees(void **state)
{
    (void)state;
    sim_rig_open_kept(&rig, "sim:orbit?width=400&height=300", 0, FRAMES);
    sim_rig_build(&rig);
    run_to(FRAMES);
    const struct fv_agreement_state *g = &rig.rt->odometry.state->agreement;
    printf("%u keyframes checked, %.3f of the matches near\n", g->checks,
           (double)(g->near / g->about));
    assert_true(g->checks >= 8 && g->near > 0.9f * g->about);
    assert_int_equal(fv_agreement_verdict(g), FV_AGREEMENT_GOOD);
    assert_true(fv_agreement_settled(g));
    assert_int_equal(rig.pose[FRAMES - 1].state, FOVEA_TRACKING_OK);
    sim_rig_close(&rig);
}

static void a_wrong_map_is_given_up(void **state)
{
    (void)state;
    sim_rig_open_kept(&rig, "sim:orbit?width=400&height=300", 0, FRAMES);
    sim_rig_build(&rig);
    run_to(FRAMES / 2);
    struct fv_odometry *o = &rig.rt->odometry;
    const struct fovea_pose before = rig.pose[rig.frames - 1];
    assert_true(before.posed);
    fv_agreement_forget(&o->state->agreement);
    spoil_newest(o);
    check_newest(o);
    assert_int_equal(fv_agreement_verdict(&o->state->agreement), FV_AGREEMENT_WEAK);
    check_newest(o);
    assert_int_equal(fv_agreement_verdict(&o->state->agreement), FV_AGREEMENT_WEAK);
    check_newest(o);
    assert_int_equal(fv_agreement_verdict(&o->state->agreement), FV_AGREEMENT_CONTRADICTED);
    run_to(rig.frames + 1);
    assert_false(rig.pose[rig.frames - 1].posed);
    while (!rig.pose[rig.frames - 1].posed && rig.frames < FRAMES) {
        assert_true(o->state->agreement.suspect); /* the next map is not published unchecked */
        run_to(rig.frames + 1);
    }
    assert_true(o->state->agreement.checks >= 2 && !o->state->agreement.suspect);
    run_to(FRAMES);
    const struct fovea_pose after = rig.pose[FRAMES - 1];
    assert_true(after.posed && after.map_id != before.map_id);
    assert_true(after.reset_counter > before.reset_counter);
    for (uint32_t k = 0; k < o->map.limits.keyframes; k++)
        assert_true(!o->map.keyframes[k].used || o->map.keyframes[k].map_id != before.map_id);
    sim_rig_close(&rig);
}

/* Each of the three measures alone puts a map in doubt; the first two, or lasting doubt, end it. */
static void each_measure_counts(void **state)
{
    (void)state;
    const struct {
        struct fv_agreement_state measured;
        enum fv_agreement_verdict one, three;
    } cases[] = {
        {{.near = 90, .about = 100, .all = 105, .known = 90}, FV_AGREEMENT_GOOD, FV_AGREEMENT_GOOD},
        {{.near = 81, .about = 100, .all = 105, .known = 90}, FV_AGREEMENT_WEAK, FV_AGREEMENT_WEAK},
        {{.near = 79, .about = 100, .all = 105, .known = 90},
         FV_AGREEMENT_WEAK,
         FV_AGREEMENT_CONTRADICTED},
        {{.near = 95, .about = 100, .all = 130, .known = 90}, FV_AGREEMENT_WEAK, FV_AGREEMENT_WEAK},
        {{.near = 95, .about = 100, .all = 140, .known = 90},
         FV_AGREEMENT_WEAK,
         FV_AGREEMENT_CONTRADICTED},
        {{.near = 86, .about = 100, .all = 105, .known = 60}, FV_AGREEMENT_WEAK, FV_AGREEMENT_WEAK},
        {{.near = 95, .about = 100, .all = 105, .known = 60}, FV_AGREEMENT_GOOD, FV_AGREEMENT_GOOD},
    };
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        struct fv_agreement_state s = cases[k].measured;
        s.checks = 1;
        assert_int_equal(fv_agreement_verdict(&s), cases[k].one);
        s.checks = 3;
        assert_int_equal(fv_agreement_verdict(&s), cases[k].three);
        s.doubts = s.checks = 4;
        assert_int_equal(fv_agreement_verdict(&s), FV_AGREEMENT_CONTRADICTED);
    }
}

/* So does a motion that is off alike from pair to pair; a hint of it keeps a suspect map back. */
static void a_bias_counts(void **state)
{
    (void)state;
    struct fv_agreement_state s = {.near = 94, .about = 100, .all = 105, .known = 90, .checks = 1};
    s.motion_bias.pairs = 1;
    s.motion_bias.way[0] = 0.1;
    s.motion_bias.evidence = 100;
    assert_int_equal(fv_agreement_verdict(&s), FV_AGREEMENT_WEAK);
    s.checks = 3;
    assert_int_equal(fv_agreement_verdict(&s), FV_AGREEMENT_CONTRADICTED);
    s.motion_bias.way[0] = 0.01;
    assert_int_equal(fv_agreement_verdict(&s), FV_AGREEMENT_GOOD);
    s.suspect = true;
    fv_agreement_confirm(&s);
    assert_true(fv_agreement_withholds(&s));
    s.motion_bias.evidence = 1;
    assert_false(fv_agreement_withholds(&s));
    s.motion_bias.evidence = 100;
    fv_agreement_forget(&s); /* another map */
    assert_true(fv_motion_bias_clear(&s.motion_bias));
}

/* A suspect map is published with a confident pose after two checks, or after three that are clear.
 */
static void a_suspect_map_is_confirmed(void **state)
{
    (void)state;
    const struct {
        struct fv_agreement_state measured;
        bool confident, published;
    } cases[] = {
        {{.near = 94, .about = 100, .all = 105, .known = 90, .checks = 2}, false, false},
        {{.near = 94, .about = 100, .all = 105, .known = 90, .checks = 3}, false, true},
        {{.near = 92, .about = 100, .all = 105, .known = 90, .checks = 9}, false, false},
        {{.near = 92, .about = 100, .all = 105, .known = 90, .checks = 1}, true, false},
        {{.near = 92, .about = 100, .all = 105, .known = 90, .checks = 2}, true, true},
        {{.near = 81, .about = 100, .all = 105, .known = 90, .checks = 9}, true, false},
    };
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        struct fv_agreement_state s = cases[k].measured;
        s.suspect = true;
        if (cases[k].confident) fv_agreement_confirm(&s);
        assert_int_equal(fv_agreement_withholds(&s), !cases[k].published);
        assert_int_equal(s.suspect, !cases[k].published);
    }
}

/* Three weak poses in a row are withheld where near is not high, until one is confident; in what is
 * left of a map, the first. */
static void weak_poses_are_withheld(void **state)
{
    (void)state;
    struct fv_agreement_state s = {.near = 87, .about = 100, .all = 105, .known = 90, .checks = 1};
    for (int n = 0; n < 3; n++) {
        assert_false(fv_agreement_unsure(&s));
        fv_agreement_note_weak(&s);
    }
    assert_true(fv_agreement_unsure(&s));
    s.near = 89;
    assert_false(fv_agreement_unsure(&s));
    s.near = 87;
    fv_agreement_confirm(&s);
    assert_false(fv_agreement_unsure(&s));
    fv_agreement_forget(&s);
    for (int n = 0; n < 9; n++)
        fv_agreement_note_weak(&s);
    assert_false(fv_agreement_unsure(&s)); /* nothing speaks against this map */
    s.left = true;
    assert_true(fv_agreement_unsure(&s));
    fv_agreement_confirm(&s);
    fv_agreement_note_weak(&s);
    assert_false(fv_agreement_unsure(&s));
}

/* Where the next keyframe comes before a pair's motion is fitted, it is fitted beside it. */
static void no_pair_of_features_goes_unfitted(uint32_t features)
{
    sim_rig_open_kept(&rig, "sim:orbit?width=400&height=300", 0, FRAMES);
    rig.config.features.count_max = features;
    sim_rig_build(&rig);
    run_to(FRAMES / 2);
    struct fv_odometry *o = &rig.rt->odometry;
    struct fv_agreement_state *g = &o->state->agreement;
    check_newest(o);
    const uint32_t checks = g->checks, seen = g->motion_bias.seen;
    for (int n = 0; n < 3; n++) {
        fv_odometry_agreement_queue(o, o->state->newest);
        while (fv_odometry_agreement_waiting(o))
            fv_odometry_agreement_unit(o, &rig.rt->kernels);
        assert_true(fv_odometry_agreement_fits(o));
    }
    assert_int_equal(g->checks, checks + 3);
    assert_int_equal(g->motion_bias.seen, seen + 2); /* the last waits for the next, or for time */
    sim_rig_close(&rig);
}

/* However few units matching takes. */
static void no_pair_goes_unfitted(void **state)
{
    (void)state;
    no_pair_of_features_goes_unfitted(1000);
    no_pair_of_features_goes_unfitted(180);
}

/* By one camera alone, poses of a map that stay weak are `lost` until one is confident. */
static void a_map_that_stays_weak_is_withheld(void **state)
{
    (void)state;
    sim_rig_open_kept(&rig, "sim:orbit?width=400&height=300", 0, FRAMES);
    sim_rig_build(&rig);
    run_to(FRAMES - 6);
    struct fv_odometry *o = &rig.rt->odometry;
    assert_int_equal(rig.pose[rig.frames - 1].state, FOVEA_TRACKING_OK);
    const uint32_t good = o->config.inliers_good, resets = fv_odometry_reset_counter(o);
    o->config.inliers_good = 100000;
    for (int n = 1; n <= 4; n++) {
        o->state->agreement.near = 0.85f * o->state->agreement.about;
        run_to(rig.frames + 1);
        assert_int_equal(rig.pose[rig.frames - 1].posed, n < 3);
    }
    o->config.inliers_good = good;
    run_to(rig.frames + 1);
    assert_int_equal(rig.pose[rig.frames - 1].state, FOVEA_TRACKING_OK);
    assert_int_equal(fv_odometry_reset_counter(o), resets);
    sim_rig_close(&rig);
}

/* The first check of a map that was made from several views decides whether it is suspect; of a map
 * that is entered again it does not. */
static void a_first_check_counts(void **state)
{
    (void)state;
    sim_rig_open_kept(&rig, "sim:orbit?width=400&height=300", 0, FRAMES);
    sim_rig_build(&rig);
    run_to(FRAMES / 2);
    struct fv_odometry *o = &rig.rt->odometry;
    struct fv_agreement_state *g = &o->state->agreement;
    assert_true(rig.pose[rig.frames - 1].posed && !g->suspect);
    fv_agreement_begin(g);
    assert_true(g->fresh && !fv_agreement_withholds(g));
    check_newest(o);
    assert_false(g->fresh || fv_agreement_withholds(g));
    fv_agreement_forget(g);
    spoil_newest(o);
    check_newest(o);
    assert_false(fv_agreement_withholds(g));
    fv_agreement_begin(g);
    check_newest(o);
    assert_true(!g->fresh && fv_agreement_withholds(g));
    sim_rig_close(&rig);
}

/* A pose that is confident by all else publishes a suspect map, in the same step. */
static void a_confident_pose_publishes(void **state)
{
    (void)state;
    sim_rig_open_kept(&rig, "sim:orbit?width=400&height=300", 0, FRAMES);
    sim_rig_build(&rig);
    run_to(FRAMES - 2);
    struct fv_agreement_state *g = &rig.rt->odometry.state->agreement;
    assert_int_equal(rig.pose[rig.frames - 1].state, FOVEA_TRACKING_OK);
    g->suspect = true;
    g->near = 0.92f * g->about;
    g->checks = 1;
    run_to(FRAMES - 1);
    assert_false(rig.pose[rig.frames - 1].posed);
    g->checks = 2;
    run_to(FRAMES);
    assert_int_equal(rig.pose[rig.frames - 1].state, FOVEA_TRACKING_OK);
    sim_rig_close(&rig);
}

/* A lorry that hardly moves against the camera fills a third of the picture, and the first map
 * hangs on it; the other begins without doubt, but not clearly: nothing but the first pose, which
 * is `weak`, is published. */
static void a_map_of_a_lorry_is_withheld(void **state)
{
    (void)state;
    static const struct {
        int seed, frames;
    } drives[] = {{72, 39}, {24, 69}};
    for (int i = 0; i < 2; i++) {
        char uri[48];
        int posed = 0;
        snprintf(uri, sizeof uri, "sim:road?seed=%d", drives[i].seed);
        sim_rig_open(&rig, uri, 0, drives[i].frames);
        sim_rig_build(&rig);
        run_to(drives[i].frames);
        for (int n = 0; n < rig.frames; n++) {
            posed += rig.pose[n].posed;
            assert_true(rig.pose[n].state != FOVEA_TRACKING_OK);
        }
        printf("%s: %d frames posed\n", uri, posed);
        assert_int_equal(posed, 1);
        sim_rig_close(&rig);
    }
}

/* Way of the estimate over that of the truth in the ten frames up to one; 0: not of one map. */
static double scale_at(int n)
{
    double way = 0, real = 0;
    for (int k = n - 10; k < n; k++) {
        if (k < 0 || !rig.pose[k].posed || !rig.pose[k + 1].posed ||
            rig.pose[k].map_id != rig.pose[n].map_id)
            return 0;
        way += sim_rig_moved(rig.pose[k].T_world_cam, rig.pose[k + 1].T_world_cam);
        real += sim_rig_moved(rig.truth[k], rig.truth[k + 1]);
    }
    return real > 0.1 ? way / real : 0;
}

/* Of these seeds version 0.1 published maps as `tracking` whose scale changes by 4.6 to 7.2. */
static void no_wrong_map_of_a_drive_is_confident(void **state)
{
    (void)state;
    static const int seeds[] = {54, 99};
    for (int i = 0; i < 2; i++) {
        char uri[48];
        double least = 1e9, most = 0;
        snprintf(uri, sizeof uri, "sim:road?seed=%d", seeds[i]);
        sim_rig_open(&rig, uri, 0, 45);
        sim_rig_build(&rig);
        run_to(45);
        int posed = 0, tracking = 0;
        for (int n = 0; n < rig.frames; n++) {
            const double scale = scale_at(n);
            posed += rig.pose[n].posed;
            tracking += rig.pose[n].state == FOVEA_TRACKING_OK;
            if (scale <= 0 || rig.pose[n].map_id != rig.pose[rig.frames - 1].map_id) continue;
            least = fmin(least, scale);
            most = fmax(most, scale);
        }
        printf("%s: %d frames posed, %d tracking, scale changes %.2f times\n", uri, posed, tracking,
               most / least);
        assert_true(most < 3 * least || tracking < 10);
        sim_rig_close(&rig);
    }
}

/* In a bend, beside a lorry: the first map turns by two thirds of what the camera does and slides
 * to the side, which fits both. Before it was looked for, 31 frames of it were published. */
static void a_map_bent_between_two_motions_is_given_up(void **state)
{
    (void)state;
    enum { BEND = 35 };
    int posed[BEND] = {0}, most = 0;
    sim_rig_open(&rig, "sim:road?seed=10", 0, BEND);
    sim_rig_build(&rig);
    run_to(BEND);
    for (int n = 0; n < rig.frames; n++) {
        if (!rig.pose[n].posed) continue;
        assert_true(rig.pose[n].map_id < BEND);
        if (++posed[rig.pose[n].map_id] > most) most = posed[rig.pose[n].map_id];
    }
    printf("%d frames of one map published\n", most);
    assert_true(most < 10);
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_right_map_agrees),
        cmocka_unit_test(a_wrong_map_is_given_up),
        cmocka_unit_test(each_measure_counts),
        cmocka_unit_test(a_bias_counts),
        cmocka_unit_test(a_suspect_map_is_confirmed),
        cmocka_unit_test(weak_poses_are_withheld),
        cmocka_unit_test(no_pair_goes_unfitted),
        cmocka_unit_test(a_map_that_stays_weak_is_withheld),
        cmocka_unit_test(a_first_check_counts),
        cmocka_unit_test(a_confident_pose_publishes),
        cmocka_unit_test(a_map_of_a_lorry_is_withheld),
        cmocka_unit_test(no_wrong_map_of_a_drive_is_confident),
        cmocka_unit_test(a_map_bent_between_two_motions_is_given_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
