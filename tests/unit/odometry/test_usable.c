/* Pictures of no use: blurred, noisy and repeated ones are `weak` or lost, none becomes a keyframe,
 * and the covariance admits the way that the camera goes meanwhile. A camera that stands is no such
 * case. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "common/sim_rig.h"
#include "image/noise.h"
#include "runtime/state.h"

static struct sim_rig rig;

enum { FIRST = 60, LENGTH = 15, AFTER = 6, RAMP = 1 };

static void run(const char *uri, int frames)
{
    sim_rig_open(&rig, uri, 0, frames);
    sim_rig_build(&rig);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
}

/* Distance in the map's unit by which the way since frame `from` is off, its standard deviation,
 * and the true way. */
static double way_off(int from, int n, double *sigma, double *way)
{
    const double unit = 1 / sim_rig_scale(&rig, FIRST - 45, FIRST);
    double a[3], b[3], sum = 0;
    for (int k = 0; k < 3; k++) {
        a[k] = b[k] = 0;
        for (int r = 0; r < 3; r++) { /* seen from the camera at `from`, so that worlds are one */
            const double *P = rig.pose[from].T_world_cam, *Q = rig.truth[from];
            a[k] += P[4 * r + k] * (rig.pose[n].T_world_cam[4 * r + 3] - P[4 * r + 3]);
            b[k] += Q[4 * r + k] * (rig.truth[n][4 * r + 3] - Q[4 * r + 3]);
        }
        sum += (unit * a[k] - b[k]) * (unit * a[k] - b[k]);
    }
    const double *c = rig.pose[n].covariance;
    *sigma = unit * sqrt(c[0] + c[6] + c[11]);
    *way = sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2]);
    return sqrt(sum);
}

static void check_faulty(const char *kind, bool frozen)
{
    char uri[160];
    snprintf(uri, sizeof uri,
             "fault:sim:orbit?width=400&height=300?kind=%s&first=%d&shortest=%d&longest=%d&count=1",
             kind, FIRST, LENGTH, LENGTH);
    run(uri, FIRST + LENGTH + AFTER);
    double off2 = 0, sigma2 = 0;
    int posed = 0;
    assert_true(rig.pose[FIRST - 1].posed);
    const uint64_t keyframe = rig.pose[FIRST - 1].reference_keyframe;
    for (int n = FIRST + (frozen ? RAMP : 0); n < FIRST + LENGTH; n++) {
        const struct fovea_pose *pose = &rig.pose[n];
        assert_int_not_equal(pose->state, FOVEA_TRACKING_OK);
        if (!pose->posed) continue;
        double sigma, way;
        assert_true(pose->reference_keyframe <= keyframe);
        const double off = way_off(FIRST - 1, n, &sigma, &way);
        if (frozen) assert_true(off < 5 * sigma);
        off2 += off * off;
        sigma2 += sigma * sigma;
        posed++;
    }
    if (frozen) {
        printf("%s: %d of %d frames posed, off by %.4f m, said to be %.4f m\n", kind, posed, LENGTH,
               sqrt(off2 / posed), sqrt(sigma2 / posed));
        assert_true(posed > LENGTH / 2 && sigma2 < 9 * off2);
    }
    bool back = false;
    for (int n = FIRST + LENGTH; n < rig.frames; n++)
        back = back || (rig.pose[n].posed && rig.pose[n].map_id == rig.pose[FIRST - 1].map_id);
    assert_true(back);
    sim_rig_close(&rig);
}

static void frozen_pictures_are_weak(void **state)
{
    (void)state;
    check_faulty("freeze", true);
    check_faulty("freeze,noise&amount=3", true);
    check_faulty("freeze,recompress", true);
    check_faulty("freeze,noise&amount=60", true);
}

static void blurred_pictures_are_weak(void **state)
{
    (void)state;
    check_faulty("blur", false);
    check_faulty("motion", false);
    check_faulty("blur&sigma=2", false);
}

static void noisy_pictures_are_weak(void **state)
{
    (void)state;
    check_faulty("noise&amount=60", false);
    check_faulty("noise&amount=16", false);
}

/* A lens that zooms by 3 % seems to step ahead. Where frames of it are called sure, their
 * covariance admits that. */
static void a_lens_that_zooms_is_told(void **state)
{
    char uri[160];
    int sure = 0, before = 0;
    (void)state;
    snprintf(uri, sizeof uri,
             "fault:sim:orbit?width=400&height=300?kind=zoom&factor=1.03&first=%d&shortest=%d&"
             "longest=%d&count=1",
             FIRST, LENGTH, LENGTH);
    run(uri, FIRST + LENGTH + AFTER);
    const uint64_t keyframe = rig.pose[FIRST - 1].reference_keyframe;
    for (int n = FIRST - 20; n < FIRST + LENGTH; n++) {
        double sigma, way;
        const double off = way_off(FIRST - 21, n, &sigma, &way);
        if (rig.pose[n].state != FOVEA_TRACKING_OK || rig.pose[n].reference_keyframe > keyframe)
            continue;
        assert_true(off < 4 * sigma + 0.03 * way);
        sure += n >= FIRST;
        before += n < FIRST;
    }
    print_message("before the lens zooms %d of 20 frames are sure, then %d of %d\n", before, sure,
                  LENGTH);
    assert_in_range(before, 18, 20);
    assert_in_range(sure, 0, LENGTH - 4);
    sim_rig_close(&rig);
}

/* Starts and stops of a robot, which brakes; with noise, as every camera has. */
static void standing_is_not_frozen(void **state)
{
    (void)state;
    int stood = 0, weak = 0;
    run("sim:stopgo?width=400&height=300", 260);
    for (int n = 120; n < rig.frames; n++) {
        if (sim_rig_moved(rig.truth[n - 1], rig.truth[n]) > 1e-4) continue;
        stood++;
        weak += rig.pose[n].state != FOVEA_TRACKING_OK;
    }
    printf("%d frames stood, %d of them not tracking\n", stood, weak);
    assert_true(stood > 20);
    assert_int_equal(weak, 0);
    sim_rig_close(&rig);
}

/* Frames that lack for half a second make one long interval. What follows is as fast as before,
 * and no picture that repeats itself. */
static void a_gap_is_no_freeze(void **state)
{
    enum { BEGIN = 180, GAP = 60, SETTLED = 10, END = 230 };
    char uri[192];
    int tracking = 0;
    (void)state;
    snprintf(
        uri, sizeof uri,
        "fault:sim:orbit?seed=3&width=320&height=240&rate=120?kind=drop&first=%d&shortest=%d&longest=%d&count=1",
        BEGIN, GAP, GAP);
    sim_rig_open(&rig, uri, 0, END + GAP);
    sim_rig_build(&rig);
    while (sim_rig_next(&rig)) {
        sim_rig_process(&rig);
        assert_false(rig.frames > BEGIN && rig.rt->odometry.state->usable.frozen);
    }
    const uint64_t keyframe = rig.pose[BEGIN - 1].reference_keyframe;
    assert_int_equal(rig.pose[BEGIN - 1].state, FOVEA_TRACKING_OK);
    for (int n = BEGIN + SETTLED; n < END; n++)
        tracking += rig.pose[n].state == FOVEA_TRACKING_OK;
    printf("behind a gap %d of %d frames tracking\n", tracking, END - BEGIN - SETTLED);
    assert_true(4 * tracking > 3 * (END - BEGIN - SETTLED));
    assert_true(rig.pose[END - 1].reference_keyframe > keyframe);
    sim_rig_close(&rig);
}

/* A camera that all at once is slower, but moves: what looked like a freeze ends. */
static void creeping_is_no_freeze(void **state)
{
    enum { FAST = 12, FAST_FRAMES = 40, WEAK_MAX = 12, END = 90 };
    int64_t stamp_ns = 0;
    int tracking = 0, frozen = 0;
    (void)state;
    sim_rig_open(&rig, "sim:orbit?seed=3&width=320&height=240&rate=60", 0, 0);
    sim_rig_build(&rig);
    while (rig.frames < END && sim_rig_next(&rig)) {
        for (int k = 1; k < FAST && rig.frames < FAST_FRAMES; k++) {
            rig.ops->requeue(rig.source, &rig.frame);
            assert_true(sim_rig_next(&rig));
        }
        rig.frame.stamp_ns = rig.inputs.now_ns = stamp_ns += 33333333;
        sim_rig_process(&rig);
        frozen += rig.rt->odometry.state->usable.frozen;
    }
    assert_int_equal(rig.pose[FAST_FRAMES - 1].state, FOVEA_TRACKING_OK);
    for (int n = FAST_FRAMES + WEAK_MAX; n < END; n++)
        tracking += rig.pose[n].state == FOVEA_TRACKING_OK;
    printf("slower at once: %d frames taken as frozen; %d of %d tracking\n", frozen, tracking,
           END - FAST_FRAMES - WEAK_MAX);
    assert_true(frozen < WEAK_MAX);
    assert_true(4 * tracking > 3 * (END - FAST_FRAMES - WEAK_MAX));
    sim_rig_close(&rig);
}

/* Whether a freeze goes on where poses are `px` from where motion ended, and from the last. */
static bool goes_on(double px, bool noisy)
{
    struct fv_odometry *o = &rig.rt->odometry;
    struct fv_usable_state *s = &o->state->usable;
    const struct fv_map_frame frame = fv_map_frame_at(&o->map, fv_map_current(&o->map));
    const double turn[3] = {0, px / o->map.camera->fx, 0};
    struct fv_se3 off, T_last;
    fv_so3_exp(turn, off.R);
    memset(off.t, 0, sizeof off.t);
    fv_se3_compose(&off, &frame.keyframe->T_cam_world, &T_last);
    s->frozen = true;
    s->noisy = noisy;
    s->frozen_at = T_last;
    fv_odometry_judge_freeze(o, &frame, &T_last, &frame.keyframe->T_cam_world);
    return s->frozen;
}

/* What ends a freeze where pictures are clear does not where they are noisy. */
static void noise_alone_ends_no_freeze(void **state)
{
    (void)state;
    run("sim:orbit?width=400&height=300", 30);
    assert_true(rig.pose[29].posed);
    assert_true(goes_on(1.8, true));
    assert_false(goes_on(1.8, false));
    assert_false(goes_on(3.5, true));
    sim_rig_close(&rig);
}

enum { FEATURES = 400 };
static struct fovea_feature features[FEATURES];
static uint8_t descriptors[FEATURES][32];

/* A picture whose features are those numbered from `first` on, and what is said of it. */
static void show(struct fv_usable_state *state, uint32_t first, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t number = first + i, row = number / 97;
        features[i] =
            (struct fovea_feature){.x_px = (float)(number % 97), .y_px = (float)row, .score = 50};
        memset(descriptors[i], (int)(number * 31 % 251), sizeof descriptors[i]);
    }
    fv_usable_picture(state, count, features, descriptors[0]);
}

static void old_features_tell(void **unused)
{
    (void)unused;
    static struct fv_usable_state state;
    memset(&state, 0, sizeof state);
    show(&state, 0, 0);
    assert_true(!state.repeated && !state.patched);
    show(&state, 1, 400);
    assert_true(!state.repeated && !state.patched && fv_usable(&state));
    show(&state, 401, 400); /* all of it new */
    assert_true(!state.repeated && !state.patched);
    show(&state, 101, 300); /* the first again, of which a box hides a part, two pictures later */
    assert_true(state.repeated && !fv_usable(&state));
    show(&state, 781, 400); /* 20 of 400 are old: chance */
    assert_true(!state.repeated && !state.patched);
    show(&state, 1081, 400); /* 100 of 400 */
    assert_true(!state.repeated && state.patched && !fv_usable(&state));
    for (uint32_t n = 1; n <= 4; n++) { /* a little of the next ones may be old, too */
        show(&state, 1000 + 500 * n, 400);
        assert_true(!state.repeated && state.patched == (n <= 3));
    }
}

/* Transfers that break off: below a row that each picture draws it is the last good one. Frames of
 * which more than a little is old are no longer `tracking`. */
static void patched_pictures_are_weak(void **unused)
{
    (void)unused;
    int tracking = 0;
    run("fault:sim:orbit?width=400&height=300?kind=partial&first=60&shortest=15&longest=15&count=1",
        FIRST + LENGTH + AFTER);
    assert_int_equal(rig.pose[FIRST - 1].state, FOVEA_TRACKING_OK);
    const uint64_t keyframe = rig.pose[FIRST - 1].reference_keyframe;
    for (int n = FIRST; n < FIRST + LENGTH; n++) {
        tracking += rig.pose[n].state == FOVEA_TRACKING_OK;
        assert_true(!rig.pose[n].posed || tracking > 0 ||
                    rig.pose[n].reference_keyframe <= keyframe);
    }
    assert_true(tracking <= 1); /* where only the last rows of the first one are old */
    assert_int_equal(rig.pose[FIRST + LENGTH + AFTER - 1].state, FOVEA_TRACKING_OK);
    sim_rig_close(&rig);
}

/* No map begins with pictures of a fault that lasts from one frame to another, but soon after. */
static void assert_no_map_in(const char *fault, int from, int to, int begun)
{
    enum { END = 60 };
    int before = 0, tracking = 0;
    char uri[200];
    snprintf(
        uri, sizeof uri,
        "fault:sim:tour?seed=1&width=320&height=240?%s&first=%d&shortest=%d&longest=%d&count=1",
        fault, from, to - from, to - from);
    run(uri, END);
    for (int n = 0; n < END; n++) {
        before += n < to && rig.pose[n].posed;
        tracking += rig.pose[n].state == FOVEA_TRACKING_OK;
    }
    printf("%s: %d poses in it, %d frames tracking\n", fault, before, tracking);
    assert_int_equal(before, 0);
    assert_true(rig.pose[to + begun].posed && 2 * tracking > END - to);
    sim_rig_close(&rig);
}

/* Parts of patched pictures stand while the rest moves, which no one motion explains. */
static void no_map_begins_with_pictures_of_no_use(void **unused)
{
    (void)unused;
    assert_no_map_in("kind=partial", 3, 33, 10);
    assert_no_map_in("kind=noise&amount=16", 1, 25, 12);
}

/* The world, an exposure or its noise changes: none of it is a noisy picture. */
static void what_cameras_do_is_not_noisy(void **unused)
{
    static const char *const uris[] = {
        "sim:road?width=400&height=300",
        "sim:corridor?width=400&height=300",
        "fault:sim:orbit?width=400&height=300?kind=exposure&gain=4&first=20&shortest=10&longest=10&count=2",
        "fault:sim:road?width=400&height=300?kind=exposure&gain=5&first=20&shortest=10&longest=10&count=2",
        "fault:sim:orbit?width=400&height=300?kind=exposure&gain=0.1&first=20&shortest=10&longest=10&count=2",
        "fault:sim:orbit?width=400&height=300?kind=noise&amount=6&first=20&shortest=10&longest=10&count=2",
        "fault:sim:orbit?width=400&height=300?kind=black&first=20&shortest=10&longest=10&count=2",
    };
    (void)unused;
    for (size_t i = 0; i < sizeof uris / sizeof *uris; i++) {
        sim_rig_open(&rig, uris[i], 0, 60);
        sim_rig_build(&rig);
        while (sim_rig_next(&rig)) {
            sim_rig_process(&rig);
            assert_false(rig.rt->odometry.state->usable.noisy);
        }
        assert_int_equal(rig.frames, 60);
        sim_rig_close(&rig);
    }
}

/* Number of pictures that are noisy before `count` of that noise are taken as they are; `count`:
 * all of them. */
static uint32_t noisy_for(struct fv_usable_state *state, double grey_levels, uint32_t count)
{
    for (uint32_t n = 0; n < count; n++) {
        fv_usable_noise(state, (uint32_t)(grey_levels * FV_NOISE_ONE));
        if (fv_usable(state)) return n;
    }
    return count;
}

static void noise_is_judged_by_what_is_usual(void **unused)
{
    (void)unused;
    static struct fv_usable_state state;
    memset(&state, 0, sizeof state);
    assert_int_equal(noisy_for(&state, 60, 30), 30); /* from the start */
    for (int n = 0; n < 30; n++)
        assert_int_equal(noisy_for(&state, 2, 1), 0); /* at once when it ends */
    assert_int_equal(noisy_for(&state, 13, 30), 8);   /* a little more than is never judged */
    memset(&state, 0, sizeof state);
    assert_int_equal(noisy_for(&state, 12, 1), 0); /* texture, from one picture to the next */
    memset(&state, 0, sizeof state);
    assert_int_equal(noisy_for(&state, 20, 200), 95); /* a gain that stays */
    for (int n = 0; n < 30; n++)
        assert_int_equal(noisy_for(&state, 20, 1), 0);
    assert_int_equal(noisy_for(&state, 48, 1), 0); /* of which this is not two and a half times */
    memset(&state, 0, sizeof state);
    assert_int_equal(noisy_for(&state, 60, 400), 315);
    fv_usable_forget(&state); /* the map, not the camera */
    assert_int_equal(noisy_for(&state, 60, 1), 0);
    for (int n = 0; n < 30; n++)
        assert_int_equal(noisy_for(&state, 2, 1), 0);
    assert_int_equal(noisy_for(&state, 60, 30), 30);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frozen_pictures_are_weak),
        cmocka_unit_test(blurred_pictures_are_weak),
        cmocka_unit_test(noisy_pictures_are_weak),
        cmocka_unit_test(a_lens_that_zooms_is_told),
        cmocka_unit_test(standing_is_not_frozen),
        cmocka_unit_test(old_features_tell),
        cmocka_unit_test(a_gap_is_no_freeze),
        cmocka_unit_test(creeping_is_no_freeze),
        cmocka_unit_test(noise_alone_ends_no_freeze),
        cmocka_unit_test(patched_pictures_are_weak),
        cmocka_unit_test(no_map_begins_with_pictures_of_no_use),
        cmocka_unit_test(what_cameras_do_is_not_noisy),
        cmocka_unit_test(noise_is_judged_by_what_is_usual),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
