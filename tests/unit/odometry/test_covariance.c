/* What the covariance of a frame makes of a lens that has another focal length: a real frame of two
 * simulated cameras, whose features are moved as a zoom moves them. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "common/sim_rig.h"
#include "geometry/linear.h"
#include "odometry/covariance.h"
#include "odometry/lens.h"
#include "odometry/localise.h"
#include "runtime/state.h"

enum { FRAMES = 40, FEATURES_MAX = 4096 };

/* The frame as it was seen. */
static struct {
    struct fv_odometry *o;
    struct fv_map_frame frame;
    struct fv_inverse_distance *distances;
    struct fv_se3 T;
    struct fv_pixel points[FEATURES_MAX];
    int16_t landmark[FEATURES_MAX];
    struct fv_inverse_distance measured[FEATURES_MAX];
} seen;

static struct sim_rig rig;

static int set_up(void **state)
{
    (void)state;
    sim_rig_open_kept(&rig, "sim:corridor?width=400&height=300&rate=20&baseline=0.11&seed=2", 0,
                      FRAMES);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    sim_rig_build(&rig);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    struct fv_odometry *o = seen.o = &rig.rt->odometry;
    const uint32_t current = fv_map_current(&o->map);
    seen.frame = fv_map_frame_at(&o->map, current);
    seen.distances = fv_map_distances(&o->map, current);
    const uint32_t count = seen.frame.keyframe->features;
    assert_true(o->state->pose.posed && fv_map_metric(&o->map) && count < FEATURES_MAX);
    seen.T = seen.frame.keyframe->T_cam_world;
    memcpy(seen.points, seen.frame.points, count * sizeof *seen.points);
    memcpy(seen.landmark, seen.frame.landmark, count * sizeof *seen.landmark);
    memcpy(seen.measured, seen.distances, count * sizeof *seen.measured);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    sim_rig_close(&rig);
    return 0;
}

/* The frame as lenses see it whose focal length is exp(`change`) times as long, and the pose that
 * it then seems to have. */
static void zoom(double change, struct fv_pose_fit *fit)
{
    const struct fv_map *map = &seen.o->map;
    const struct fovea_camera *camera = map->camera;
    const double factor = exp(change);
    for (uint32_t f = 0; f < seen.frame.keyframe->features; f++) {
        const struct fv_pixel *from = &seen.points[f];
        struct fv_pixel *to = &seen.frame.points[f];
        *to = *from;
        to->x = (uint16_t)lround((camera->cx + factor * (from->x * map->pixel_px - camera->cx)) /
                                 map->pixel_px);
        to->y = (uint16_t)lround((camera->cy + factor * (from->y * map->pixel_px - camera->cy)) /
                                 map->pixel_px);
        seen.frame.landmark[f] = seen.landmark[f];
        if (!fv_map_keypoint(map, to, &seen.frame.keypoints[f]))
            seen.frame.landmark[f] = FV_MAP_NONE;
        seen.distances[f] = seen.measured[f];
        seen.distances[f].value *= (float)factor;
    }
    struct fv_se3 T = seen.T;
    seen.o->localiser.measures = true;
    const uint32_t inliers =
        fv_localiser_refine(&seen.o->localiser, map, &seen.frame, 3, 5, &T, fit);
    assert_true(inliers > 20);
    seen.o->state->pose.inliers = inliers;
    seen.frame.keyframe->T_cam_world = T;
}

static double way(const struct fv_se3 *a, const struct fv_se3 *b)
{
    struct fv_se3 inverse, between;
    fv_se3_invert(b, &inverse);
    fv_se3_compose(a, &inverse, &between);
    return fv_norm3(between.t);
}

/* With measured distances and without, it is found, and so is what the pose was moved by; with them
 * it is surer. */
static void the_focal_length_of_a_frame_is_found(void **state)
{
    struct fv_pose_fit fit;
    struct fv_lens_frame before, lens;
    double without = 0;
    (void)state;
    for (int k = 0; k < 2; k++) {
        const struct fv_inverse_distance *distances = k == 1 ? seen.distances : NULL;
        zoom(0, &fit);
        assert_true(fv_lens_frame_current(seen.o, distances, 1, &before));
        assert_true(fabs(before.change) < 3 * before.sigma && before.sigma < 0.001);
        if (k == 1) assert_true(before.sigma_unit < 0.96 * without);
        without = before.sigma_unit;
        for (int tenths = -15; tenths <= 15; tenths += 5) {
            const double truth = 1e-3 * tenths;
            zoom(truth, &fit);
            assert_true(fv_lens_frame_current(seen.o, distances, 1, &lens));
            assert_true(fabs(lens.change - before.change - truth) < 0.05 * fabs(truth) + 1e-4);
            assert_true(fabs(lens.sigma - before.sigma) < 0.1 * before.sigma);
            struct fv_se3 T = seen.frame.keyframe->T_cam_world;
            const double off = way(&T, &seen.T);
            fv_se3_move(&T, lens.moved);
            assert_true(way(&T, &seen.T) < 0.1 * off + 0.002);
        }
    }
}

/* Only some of the landmarks: as good as they are many. */
static void a_stride_takes_some_of_the_landmarks(void **state)
{
    struct fv_pose_fit fit;
    struct fv_lens_frame all, some;
    (void)state;
    zoom(0.01, &fit);
    assert_true(fv_lens_frame_current(seen.o, NULL, 1, &all));
    assert_true(fv_lens_frame_current(seen.o, NULL, 4, &some));
    assert_in_range(4 * some.points, all.points, all.points + 3);
    assert_true(fabs(some.sigma_unit / all.sigma_unit - 2) < 0.3);
    assert_true(fv_lens_frame_measure(seen.o, &some));
    assert_in_range(some.points, FV_LENS_FRAME_POINTS / 2, FV_LENS_FRAME_POINTS);
}

/* Of a frozen frame, of one without a pose and of one with few landmarks the watch takes none. */
static void the_watch_takes_good_frames_alone(void **state)
{
    struct fv_pose_fit fit;
    struct fv_lens_frame lens;
    struct fv_odometry_state *s = seen.o->state;
    (void)state;
    zoom(0, &fit);
    assert_true(fv_lens_frame_measure(seen.o, &lens));
    s->usable.frozen = true;
    assert_false(fv_lens_frame_measure(seen.o, &lens));
    s->usable.frozen = false;
    s->pose.posed = false;
    assert_false(fv_lens_frame_measure(seen.o, &lens));
    s->pose.posed = true;
    for (uint32_t left = 45; left >= 35; left -= 10) {
        uint32_t kept = 0;
        for (uint32_t f = 0; f < seen.frame.keyframe->features; f++)
            if (seen.frame.landmark[f] != FV_MAP_NONE && ++kept > left)
                seen.frame.landmark[f] = FV_MAP_NONE;
        s->pose.inliers = left;
        assert_int_equal(fv_lens_frame_measure(seen.o, &lens), left > 40);
    }
}

/* By how much changes of the focal length vary in good runs, `sigma` by independent errors: twice
 * that, and .1 % that frames of a map have in common. Of the mean of `frames`. */
static double spread_of(double sigma, double frames)
{
    return sqrt(4 * sigma * sigma / frames + 1e-6);
}

/* The covariance of the frame with lenses whose focal length is exp(`change`) times as long, where
 * nothing is known from frames before. */
static bool write_zoomed(double change, struct fv_lens_frame *lens, double *sigma)
{
    struct fv_pose_fit fit;
    zoom(change, &fit);
    assert_true(fv_lens_frame_current(seen.o, seen.distances, 1, lens));
    *sigma = lens->sigma_unit * sqrt(fv_pose_variance(&fit));
    memset(&seen.o->state->covariance, 0, sizeof seen.o->state->covariance);
    return fv_covariance_write(seen.o, &seen.frame, &fit);
}

/* Something hides the image but for `share` of its width: the pose by what is left of it, and what
 * of its place and turn it leaves open, the lens aside. */
static bool write_hidden(double share, double *place, double *turn)
{
    struct fv_pose_fit fit;
    const double *covariance = seen.o->state->pose.covariance,
                 *lens = seen.o->state->covariance.lens;
    zoom(0, &fit);
    for (uint32_t f = 0; f < seen.frame.keyframe->features; f++)
        if (seen.points[f].x * seen.o->map.pixel_px > share * seen.o->map.camera->width)
            seen.frame.landmark[f] = FV_MAP_NONE;
    struct fv_se3 T = seen.T;
    assert_true(fv_localiser_refine(&seen.o->localiser, &seen.o->map, &seen.frame, 3, 5, &T, &fit) >
                20);
    seen.frame.keyframe->T_cam_world = T;
    memset(&seen.o->state->covariance, 0, sizeof seen.o->state->covariance);
    const bool reliable = fv_covariance_write(seen.o, &seen.frame, &fit);
    *place = sqrt(covariance[0] + covariance[6] + covariance[11] - lens[0] - lens[6] - lens[11]);
    *turn = sqrt(covariance[15] + covariance[18] + covariance[20] - lens[15] - lens[18] - lens[20]);
    return reliable;
}

/* A pose that is not known to 1 % of the depth and 10 mrad is not relied on, though the landmarks
 * that are left agree. */
static void what_little_holds_is_not_relied_on(void **state)
{
    const double depth = seen.o->map.keyframes[seen.o->state->newest].depth;
    int relied = 0;
    double place, turn;
    (void)state;
    for (int share = 100; share >= 10; share -= 5) {
        const bool reliable = write_hidden(0.01 * share, &place, &turn);
        assert_true(reliable == (place <= 0.01 * depth && turn <= 0.01));
        relied += reliable;
        if (share == 100) assert_true(place < 0.001 * depth && turn < 0.001);
    }
    print_message("relied on in %d of 19\n", relied);
    assert_in_range(relied, 10, 18);
}

/* The four parts of the first sixth of the image show four directions at most. They pull harder
 * here than noise would, and then the other two are not taken for known. */
static void few_parts_leave_no_direction_known(void **state)
{
    double S[36], place, turn;
    (void)state;
    for (int percent = 10; percent <= 16; percent += 2) {
        (void)write_hidden(0.01 * percent, &place, &turn);
        for (int row = 0, k = 0; row < 6; row++)
            for (int column = row; column < 6; column++, k++)
                S[6 * row + column] = S[6 * column + row] = seen.o->state->parts[k];
        assert_true(fv_ldlt_factor(S, 6));
    }
}

/* Not to be relied on where it is another by more than 1 % and three times the spread; from there
 * on, four times what the pose moves by is in the covariance, from twice on that itself; what the
 * parts of the image show grows too, by much less, and the rest as the variance of the errors. */
static void another_focal_length_is_admitted(void **state)
{
    struct fv_lens_frame lens;
    double plain[21], sigma;
    const double *covariance = seen.o->state->pose.covariance, *parts = seen.o->state->parts;
    int same = 0, admitted = 0, weak = 0;
    (void)state;
    assert_true(write_zoomed(0, &lens, &sigma));
    memcpy(plain, covariance, sizeof plain);
    const double variance = sigma * sigma / (lens.sigma_unit * lens.sigma_unit);
    for (int tenths = -18; tenths <= 18; tenths++) {
        const bool reliable = write_zoomed(1e-3 * tenths, &lens, &sigma);
        const double spreads = fabs(lens.change) / spread_of(sigma, 1),
                     times = spreads > 3   ? 4
                             : spreads > 2 ? 1
                                           : 0,
                     noisier = sigma * sigma / (lens.sigma_unit * lens.sigma_unit) / variance;
        assert_true(reliable == !(spreads > 3 && fabs(lens.change) > 0.01));
        for (int row = 0, k = 0; row < 6; row++)
            for (int column = row; column < 6; column++, k++) {
                const double added = times * times * lens.moved[row] * lens.moved[column],
                             size = sqrt(plain[row * (13 - row) / 2] *
                                         plain[column * (13 - column) / 2]);
                assert_true(fabs(parts[k]) < 16 * size);
                assert_true(fabs(covariance[k] - added - parts[k]) < 1.2 * noisier * size);
                assert_true(fabs(seen.o->state->covariance.lens[k] - added) <= 1e-9 * fabs(added));
            }
        same += times == 0;
        admitted += times > 0 && reliable;
        weak += !reliable;
    }
    print_message("%d times the same, %d times admitted, %d times weak\n", same, admitted, weak);
    assert_true(same >= 3 && admitted >= 8 && weak >= 10);
}

/* What is too small to be seen in one frame is seen in several that agree, and forgotten. */
static void a_small_change_is_seen_in_several_frames(void **state)
{
    struct fv_lens_frame lens;
    struct fv_pose_fit fit;
    double sigma;
    int before = 0, after = 0;
    const double *added = seen.o->state->covariance.lens;
    (void)state;
    write_zoomed(0, &lens, &sigma);
    const double least = 2 * spread_of(sigma, 10), most = 2 * spread_of(sigma, 1),
                 small = 0.8 * least + 0.2 * most - lens.change;
    (void)write_zoomed(small, &lens, &sigma);
    assert_true(lens.change > least && lens.change < most);
    while (added[0] == 0 && before++ < 20)
        (void)fv_covariance_write(seen.o, &seen.frame, (zoom(small, &fit), &fit));
    assert_in_range(before, 2, 12);
    assert_true(fabs(added[11] / (lens.moved[2] * lens.moved[2]) - 1) < 1e-6);
    while (added[0] > 0 && after++ < 20)
        (void)fv_covariance_write(seen.o, &seen.frame, (zoom(0, &fit), &fit));
    assert_in_range(after, 1, 10);
}

/* A clear change is held for turns while pictures no longer show it, as when the map is made anew
 * by that lens, and halves in 70 of them. One that is not clear is not held. */
static void a_clear_change_is_held(void **state)
{
    struct fv_covariance_state *s = &seen.o->state->covariance;
    struct fv_lens_frame lens;
    struct fv_pose_fit fit;
    double sigma;
    (void)state;
    (void)write_zoomed(0.003, &lens, &sigma);
    assert_true(lens.change < 3 * spread_of(sigma, 1) && s->focal_held == 0);
    (void)write_zoomed(0.015, &lens, &sigma);
    assert_true(lens.change > 3 * spread_of(sigma, 1) && s->focal == fabs(lens.change));
    for (int k = 1; k <= 70; k++) {
        fv_covariance_begin(s);
        (void)fv_covariance_write(seen.o, &seen.frame, (zoom(0, &fit), &fit));
        assert_true(fabs(s->focal / (fabs(lens.change) * pow(0.99, k)) - 1) < 1e-9);
    }
    assert_true(s->focal < 0.5 * fabs(lens.change) && s->lens[0] == 0);
    zoom(0.012, &fit); /* the other one is clear again, and larger than what is left */
    (void)fv_covariance_write(seen.o, &seen.frame, &fit);
    assert_true(s->focal_held == s->focal && s->focal > 0.6 * fabs(lens.change));
}

/* Whether another focal length is counted in each of `frames` behind a change, clear or not, that
 * show it `spreads` off; `together`: what is seen in several frames counts too. */
static void show_again(bool is_clear, double spreads, bool together, bool counted[], int frames)
{
    struct fv_covariance_state *s = &seen.o->state->covariance;
    struct fv_lens_frame lens;
    struct fv_pose_fit fit;
    double sigma;
    (void)write_zoomed(0, &lens, &sigma);
    const double small = spreads * spread_of(sigma, 1) - lens.change;
    (void)write_zoomed(is_clear ? 0.008 : 0.0045, &lens, &sigma);
    assert_true((lens.change > 3 * spread_of(sigma, 1)) == is_clear);
    s->change_sum = s->change_weight = 0;
    zoom(small, &fit);
    for (int k = 0; k < frames; k++) {
        fv_covariance_begin(s);
        if (!together) s->change_sum = s->change_weight = 0;
        (void)fv_covariance_write(seen.o, &seen.frame, &fit);
        counted[k] = s->lens[0] > 0;
    }
}

/* Behind a clear change of more than .4 % .8 times the spread is enough for another, for 300
 * frames, and less in several frames that agree. */
static void a_lens_that_changed_may_change_again(void **state)
{
    bool counted[301];
    (void)state;
    show_again(false, 1.4, false, counted, 301);
    for (int k = 0; k < 301; k++)
        assert_false(counted[k]);
    show_again(true, 1.4, false, counted, 301);
    for (int k = 0; k < 301; k++)
        assert_true(counted[k] == (k < 300));
    show_again(false, 0.7, true, counted, 10);
    assert_false(counted[9]);
    show_again(true, 0.7, true, counted, 10);
    assert_true(!counted[0] && counted[9]);
}

/* What was added of a keyframe is added to the frames that refer to it. */
static void the_reference_keeps_what_its_focal_length_added(void **state)
{
    struct fv_lens_frame lens;
    double sigma, without[21], *covariance = seen.o->state->pose.covariance;
    struct fv_reference_state *reference = &seen.o->state->reference;
    const struct fv_reference_state kept = *reference;
    (void)state;
    reference->slot = seen.o->state->newest;
    reference->generation = seen.o->map.keyframes[reference->slot].generation;
    memset(reference->lens, 0, sizeof reference->lens);
    (void)write_zoomed(0, &lens, &sigma);
    memcpy(without, covariance, sizeof without);
    reference->lens[0] = 4 * without[0]; /* to one side */
    (void)write_zoomed(0, &lens, &sigma);
    const double trace =
        covariance[0] + covariance[6] + covariance[11] - without[0] - without[6] - without[11];
    assert_true(fabs(trace / (4 * without[0]) - 1) < 1e-6);
    reference->generation++; /* that of another keyframe */
    (void)write_zoomed(0, &lens, &sigma);
    assert_memory_equal(covariance, without, sizeof without);
    *reference = kept;
}

/* Turns since a keyframe of another focal length are off by as much as that is. */
static void the_turn_since_such_a_reference_is_in_doubt(void **state)
{
    enum { RX = 15, RY = 18, RZ = 20 };
    const double focal = 0.03;
    struct fv_odometry_state *s = seen.o->state;
    const struct fv_reference_state kept = s->reference;
    const struct fv_keyframe *reference = &seen.o->map.keyframes[s->newest];
    struct fv_lens_frame lens;
    struct fv_se3 inverse, since;
    double sigma, without[21], turn[3];
    const double *covariance = s->pose.covariance;
    (void)state;
    s->reference.slot = s->newest;
    s->reference.generation = reference->generation;
    memset(s->reference.lens, 0, sizeof s->reference.lens);
    s->reference.focal = 0;
    (void)write_zoomed(0, &lens, &sigma);
    memcpy(without, covariance, sizeof without);
    s->reference.focal = focal;
    (void)write_zoomed(0, &lens, &sigma);
    fv_se3_invert(&reference->T_cam_world, &inverse);
    fv_se3_compose(&seen.frame.keyframe->T_cam_world, &inverse, &since);
    fv_so3_log(since.R, turn);
    const double across2 = turn[0] * turn[0] + turn[1] * turn[1],
                 added = covariance[RX] + covariance[RY] - without[RX] - without[RY];
    print_message("turned by %.4f rad across the axis\n", sqrt(across2));
    assert_true(across2 > 1e-6 && fabs(added / (focal * focal * across2) - 1) < 1e-6);
    assert_true(covariance[RZ] == without[RZ] && covariance[0] == without[0]);
    s->reference = kept;
}

/* A keyframe that becomes the reference with its own frame keeps what was added of that; a
 * correction that changes the map's unit changes it likewise. Goes on with the run: the last. */
static void a_new_reference_takes_what_was_added(void **state)
{
    struct fv_sim3 grown;
    int own = 0, added = 0;
    (void)state;
    sim_rig_close(&rig);
    sim_rig_open(&rig,
                 "fault:sim:corridor?width=400&height=300&rate=20&baseline=0.11&seed=2?kind=zoom&"
                 "factor=1.008&first=30&shortest=40&longest=40&count=1",
                 0, 70);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    sim_rig_build(&rig);
    struct fv_odometry_state *s = rig.rt->odometry.state;
    while (sim_rig_next(&rig)) {
        const uint32_t slot = s->reference.slot, generation = s->reference.generation;
        sim_rig_process(&rig);
        if (s->reference.slot == slot && s->reference.generation == generation) continue;
        assert_memory_equal(s->reference.lens, s->covariance.lens, sizeof s->reference.lens);
        assert_true(s->reference.focal == s->covariance.focal);
        own++;
        added += s->reference.lens[0] > 0;
    }
    print_message("%d keyframes, another focal length added of %d\n", own, added);
    assert_true(own > 5 && added > 1);
    for (int k = 0; k < 21; k++)
        s->reference.parts[k] = s->reference.lens[k] = 1;
    fv_sim3_identity(&grown);
    grown.s = 3;
    fv_odometry_follow_correction(&rig.rt->odometry, &grown);
    const double *const both[] = {s->reference.parts, s->reference.lens};
    for (int i = 0; i < 2; i++) /* of x and x, x and rx, rz and rz */
        assert_true(both[i][0] == 9 && both[i][3] == 3 && both[i][20] == 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_focal_length_of_a_frame_is_found),
        cmocka_unit_test(the_watch_takes_good_frames_alone),
        cmocka_unit_test(a_stride_takes_some_of_the_landmarks),
        cmocka_unit_test(what_little_holds_is_not_relied_on),
        cmocka_unit_test(few_parts_leave_no_direction_known),
        cmocka_unit_test(another_focal_length_is_admitted),
        cmocka_unit_test(a_small_change_is_seen_in_several_frames),
        cmocka_unit_test(a_clear_change_is_held),
        cmocka_unit_test(a_lens_that_changed_may_change_again),
        cmocka_unit_test(the_reference_keeps_what_its_focal_length_added),
        cmocka_unit_test(the_turn_since_such_a_reference_is_in_doubt),
        cmocka_unit_test(a_new_reference_takes_what_was_added),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
