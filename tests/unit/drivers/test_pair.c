/* Two sources as one rig: which frames are paired, which go alone and which are dropped; two faked
 * cameras of which one is late, covered by silence or unplugged; what cannot be a pair. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../../../drivers/pair.h"
#include "../../../drivers/table.h"
#include "common/datasets.h"
#include "common/fake_camera.h"
#include "common/live_source.h"
#include "common/patience.h"

static const struct fovea_source_selection everything = {.step = 1};
static const struct fovea_source_ops *const ops = &fv_source_pair;
static struct fovea_source_counts counts;

static struct fovea_source *open_pair(const char *address)
{
    struct fovea_source *source = NULL;
    struct fovea_error error = {.text = ""};
    if (ops->open(address, &everything, &source, &error) != FOVEA_OK ||
        ops->start(source, &error) != FOVEA_OK)
        fail_msg("%s: %s", address, error.text);
    return source;
}

static void close_pair(struct fovea_source *source)
{
    ops->stop(source);
    ops->close(source);
}

/* ---- recordings ------------------------------------------------------------------------------ */

#define LEFT "sim:orbit?width=96&height=64&frames=40&imu=200&wheel_odometry=0"
#define RIGHT "sim:orbit?width=64&height=80&frames=40"

/* All frames; returns how many have both, of `*all`. */
static uint32_t play(const char *address, uint32_t *all)
{
    struct fovea_source *source = open_pair(address);
    struct fovea_frame frame;
    struct fovea_sample samples[64];
    uint32_t both = 0;
    double T[12];
    *all = 0;
    assert_int_equal(ops->info(source)->rig.camera_count, 2);
    while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        assert_int_equal(frame.image_count, 2);
        assert_int_equal(frame.images[0].width, 96);
        assert_true(ops->samples(source, &frame, samples, 64) > 0);
        assert_int_equal(ops->truth_pose(source, &frame, T), FOVEA_OK);
        if (frame.images[1].data != NULL) {
            assert_true(frame.images[1].width == 64 && frame.images[1].height == 80);
            both++;
        } else {
            assert_true(frame.images[1].width == 0 && frame.offset_ns[1] == 0);
        }
        ++*all;
        ops->requeue(source, &frame);
    }
    ops->counts(source, &counts);
    close_pair(source);
    return both;
}

static void equal_stamps_are_pairs(void **state)
{
    (void)state;
    uint32_t all;
    assert_int_equal(play(LEFT " and " RIGHT, &all), 40);
    assert_int_equal(all, 40);
    assert_true(counts.delivered == 40 && counts.dropped == 0);
}

/* Frames that one of them has not: of the first they are lost to the second, of the second the
 * first goes alone. */
static void what_has_no_partner_is_counted(void **state)
{
    (void)state;
    uint32_t all;
#define GAP "?kind=drop&first=10&shortest=5&longest=5&count=1"
    assert_int_equal(play("fault:" LEFT GAP " and " RIGHT, &all), 35);
    assert_true(all == 35 && counts.dropped == 5 + 5); /* by the fault; without a partner */
    assert_int_equal(play(LEFT " and fault:" RIGHT GAP, &all), 35);
    assert_true(all == 40 && counts.dropped == 5); /* those of the first went alone */
    assert_int_equal(counts.delivered, 40);
    assert_int_equal(play(LEFT " and fault:" RIGHT "?kind=drop&first=20&fraction=1", &all), 20);
    assert_int_equal(all, 40); /* the second ended */
}

/* A stamp off by less than the bound pairs, and its offset is kept. */
static void the_bound_decides(void **state)
{
    (void)state;
    uint32_t all;
#define OFF "?kind=jump&leap=6&first=0&fraction=1"
    assert_int_equal(play(LEFT " and fault:" RIGHT OFF, &all), 40); /* 33 ms / 4 */
    assert_int_equal(play(LEFT " and fault:" RIGHT OFF " within 5", &all), 0);
    assert_true(all == 40 && counts.dropped >= 39 && counts.dropped <= 40); /* one waits */
    struct fovea_source *source = open_pair(LEFT " and fault:" RIGHT OFF " within 7");
    struct fovea_frame frame;
    assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
    assert_true(frame.offset_ns[0] == 0 && frame.offset_ns[1] == 6000000);
    ops->requeue(source, &frame);
    close_pair(source);
#define EARLY "?kind=jump&leap=-6&first=0&fraction=1"
    assert_int_equal(play(LEFT " and fault:" RIGHT EARLY " within 5", &all), 0);
    assert_int_equal(play(LEFT " and fault:" RIGHT EARLY " within 7", &all), 40);
    source = open_pair(LEFT " and fault:" RIGHT EARLY);
    assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
    assert_int_equal(frame.offset_ns[1], -6000000);
    ops->requeue(source, &frame);
    close_pair(source);
}

/* The same numbers on two clocks are not the same instants. */
static void sources_on_two_clocks_are_no_pairs(void **state)
{
    char list[512] = "", address[FV_TEST_PATH_BYTES + 128];
    struct fovea_frame frame;
    (void)state;
    const char *top = fv_test_euroc(fv_test_place);
    struct fovea_source *source = open_pair(LEFT " and " RIGHT);
    for (int i = 0; i < 3; i++) {
        const size_t used = strlen(list);
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(frame.clock, FOVEA_CLOCK_SIMULATED);
        snprintf(list + used, sizeof list - used, "%lld,%lld.png\n", (long long)frame.stamp_ns,
                 1403638538577829376LL + i * 50000000LL);
        ops->requeue(source, &frame);
    }
    close_pair(source);
    fv_test_write_text(fv_test_path(top, "mav0/cam0/data.csv"), list);
    for (int second = 0; second < 2; second++) {
        snprintf(address, sizeof address,
                 second == 0 ? "euroc:%s and euroc:%s" : LEFT " and euroc:%s", top, top);
        source = open_pair(address);
        for (int i = 0; i < 3; i++) {
            assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
            assert_true((frame.images[1].data != NULL) == (second == 0));
            ops->requeue(source, &frame);
        }
        close_pair(source);
    }
    fv_test_folder_remove(top);
}

/* What would take a camera from its user, by the address alone. */
static void a_pair_takes_what_its_sources_take(void **state)
{
    static const struct {
        const char *uri;
        bool takes;
    } rows[] = {
        {"sim:orbit", false},
        {"v4l2:/dev/none", true},
        {"libcamera:none", true},
        {"fault:sim:orbit?kind=black", false},
        {"fault:v4l2:/dev/none?kind=black", true},
        {"fault:fault:v4l2:/dev/none?rate=30?kind=black?kind=drop", true},
        {"pair:sim:orbit and sim:orbit within 4", false},
        {"pair:sim:orbit and v4l2:/dev/none", true},
        {"pair:fault:v4l2:/dev/none?kind=drop and sim: within 4", true},
        {"pair:v4l2:/dev/none", false}, /* to be refused when it is opened */
        {"v4l:/dev/none", false},
        {"nothing", false},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        if (fv_source_takes_device(rows[i].uri) != rows[i].takes) fail_msg("%s", rows[i].uri);
}

static void what_is_no_pair_is_refused(void **state)
{
    static const char *const wrong[][2] = {
        {"sim:", "expected 'URI and URI'"},
        {"sim: and ", "expected 'URI and URI'"},
        {"sim: and sims:", "source: found 'sims:'"},
        {"sim: and sim: within x", "pair: within: found 'x'"},
        {"sim: and sim: within 5000", "pair: within: found '5000'"},
        {"sim: and images:/no within 3/here within 4", "/no within 3/here"},
        {"sim: and v4l2:/dev/video0", "found a camera beside a recording"},
        {"v4l2:/dev/video0?format=GREY and v4l2:/dev/video1?format=YUYV",
         "found pictures of grey8 and of yuyv"},
        {"sim:?baseline=0.1 and sim:?camera2=0.1,0,0&camera3=0.2,0,0", "found 5 cameras in both"},
    };
    (void)state;
    fake_plug(fake_new(), "/dev/video0");
    fake_plug(fake_new(), "/dev/video1");
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct fovea_source *source;
        struct fovea_error error = {.text = ""};
        assert_int_equal(ops->open(wrong[i][0], &everything, &source, &error), FOVEA_ERROR_INPUT);
        if (strstr(error.text, wrong[i][1]) == NULL) fail_msg("%s: %s", wrong[i][0], error.text);
    }
}

/* ---- cameras --------------------------------------------------------------------------------- */

static struct fake_camera *cameras[2];

static struct fovea_source *open_cameras(void)
{
    for (int i = 0; i < 2; i++) {
        cameras[i] = fake_new();
        cameras[i]->rate_hz = 50;
        fake_plug(cameras[i], i == 0 ? "/dev/video0" : "/dev/video1");
    }
    return open_pair("v4l2:/dev/video0?format=GREY and v4l2:/dev/video1?format=GREY within 30");
}

/* Wait for a frame with both, or with one alone. */
static void await(struct fovea_source *source, bool both)
{
    int64_t end_ns = 0;
    while (fv_test_patient(&end_ns, 0)) {
        struct fovea_frame frame;
        const enum fovea_status status = ops->dequeue(source, fv_test_now_ns() + 100000000, &frame);
        if (status != FOVEA_OK) continue;
        const bool found = frame.images[1].data != NULL;
        assert_non_null(frame.images[0].data);
        assert_true(!found || (frame.offset_ns[1] <= 30000000 && frame.offset_ns[1] >= -30000000));
        ops->requeue(source, &frame);
        if (found == both) return;
    }
    fail_msg("no frame %s", both ? "with both" : "of one alone");
}

static void a_camera_that_is_silent_leaves_the_other_alone(void **state)
{
    (void)state;
    struct fovea_source *source = open_cameras();
    assert_true(ops->info(source)->live);
    await(source, true);
    fake_lock();
    cameras[1]->silent = true;
    fake_unlock();
    await(source, false);
    fake_lock();
    cameras[1]->silent = false;
    fake_unlock();
    await(source, true);
    fake_unplug(cameras[1]);
    await(source, false);
    fake_plug(cameras[1], "/dev/video1");
    await(source, true);
    ops->counts(source, &counts);
    assert_true(counts.delivered > 0 && counts.recovered >= 1);
    assert_true(ops->state(source) <= FOVEA_SOURCE_LATE); /* another may take the processor now */
    close_pair(source);
}

/* The first is the rig's clock: without it there is no frame, and its state is that of the pair. */
static void without_the_first_there_is_no_frame(void **state)
{
    (void)state;
    struct fovea_source *source = open_cameras();
    struct fovea_frame frame;
    await(source, true);
    fake_unplug(cameras[0]);
    bool gone = false;
    int64_t end_ns = 0;
    while (!gone && fv_test_patient(&end_ns, 0)) {
        const enum fovea_status status = ops->dequeue(source, fv_test_now_ns() + 20000000, &frame);
        if (status == FOVEA_OK) ops->requeue(source, &frame);
        gone = ops->state(source) == FOVEA_SOURCE_GONE;
    }
    assert_true(gone);
    fake_plug(cameras[0], "/dev/video0");
    await(source, true);
    close_pair(source);
}

int main(void)
{
#define FAKE(name) cmocka_unit_test_setup_teardown(name, fake_set_up, fake_tear_down)
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equal_stamps_are_pairs),
        cmocka_unit_test(what_has_no_partner_is_counted),
        cmocka_unit_test(the_bound_decides),
        cmocka_unit_test_setup_teardown(sources_on_two_clocks_are_no_pairs, fv_test_place_set_up,
                                        fv_test_place_tear_down),
        cmocka_unit_test(a_pair_takes_what_its_sources_take),
        FAKE(what_is_no_pair_is_refused),
        FAKE(a_camera_that_is_silent_leaves_the_other_alone),
        FAKE(without_the_first_there_is_no_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
