/* The frame that a run keeps for its picture: boxes go to the image of their stamp only, and the
 * frame with most objects stays. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "drivers/table.h"
#include "app/run/snapshot.h"
#include "common/short_run.h"
#include "common/sim_rig.h"

static struct sim_rig rig;
static struct fv_snapshot snapshot;

/* Process one frame and offer it; returns its stamp. */
static int64_t offer(void)
{
    struct fovea_pose pose;
    struct fovea_outputs outputs;
    assert_true(sim_rig_next(&rig));
    const int64_t stamp_ns = rig.frame.stamp_ns;
    assert_int_equal(fovea_step(rig.rt, &rig.inputs, &rig.outputs), FOVEA_OK);
    fovea_pose_get(rig.rt, &pose);
    fv_snapshot_step(&snapshot, rig.rt, &rig.frame, &pose);
    rig.ops->requeue(rig.source, &rig.frame);
    (void)fovea_work(rig.rt, &rig.inputs.grants, &outputs);
    return stamp_ns;
}

static void detected(int64_t stamp_ns, uint32_t count)
{
    static const struct fovea_detection list[3];
    const struct fovea_detections detections = {
        .inferences = 1, .stamp_ns = stamp_ns, .count = count, .list = list};
    const struct fovea_objects objects = {.updates = 0};
    fv_snapshot_work(&snapshot, &detections, &objects);
}

static void tracked(int64_t stamp_ns, const struct fovea_object *list, uint32_t count)
{
    const struct fovea_detections detections = {.inferences = 1, .stamp_ns = stamp_ns};
    const struct fovea_objects objects = {
        .updates = 1, .stamp_ns = stamp_ns, .count = count, .list = list};
    fv_snapshot_work(&snapshot, &detections, &objects);
}

static void test_boxes_go_to_the_image_of_their_stamp(void **state)
{
    (void)state;
    assert_true(fv_snapshot_open(&snapshot, 320 * 240, true));
    const int64_t first_ns = offer();
    detected(first_ns - 1, 3);
    assert_null(fv_snapshot_best(&snapshot)); /* of an earlier image */
    detected(first_ns, 2);
    const struct fv_snapshot_frame *best = fv_snapshot_best(&snapshot);
    assert_non_null(best);
    assert_true(best->stamp_ns == first_ns);
    assert_int_equal(best->box_count, 2);
    assert_in_range(best->feature_count, 100, FOVEA_FEATURES_MAX);
    assert_int_equal(best->image.width, 320);

    int64_t stamps[8];
    for (int i = 0; i < 8; i++)
        stamps[i] = offer();
    detected(stamps[7] + 1, 3); /* the copied image was passed over */
    const int64_t next_ns = offer();
    detected(next_ns, 3);
    best = fv_snapshot_best(&snapshot);
    assert_true(best->stamp_ns == next_ns);
    assert_int_equal(best->box_count, 3);
    fv_snapshot_close(&snapshot);
}

static void test_the_frame_with_most_objects_stays(void **state)
{
    (void)state;
    static const struct fovea_object list[3] = {
        {.id = 7, .state = FOVEA_OBJECT_CONFIRMED, .score = 0.5F},
        {.id = 8, .state = FOVEA_OBJECT_TENTATIVE},
        {.id = 9, .state = FOVEA_OBJECT_COASTING},
    };
    assert_true(fv_snapshot_open(&snapshot, 320 * 240, true));
    const int64_t first_ns = offer();
    tracked(first_ns, list, 3);
    const struct fv_snapshot_frame *best = fv_snapshot_best(&snapshot);
    assert_int_equal(best->box_count, 2); /* not the tentative one */
    assert_int_equal(best->boxes[0].id, 7);
    assert_true(best->boxes[1].coasting);
    int64_t later_ns = 0;
    for (int i = 0; i < 7; i++)
        later_ns = offer();
    tracked(later_ns, list + 1, 2);
    assert_true(fv_snapshot_best(&snapshot)->stamp_ns == first_ns);
    fv_snapshot_close(&snapshot);
}

static void test_a_frame_that_is_too_large_is_left_out(void **state)
{
    (void)state;
    assert_true(fv_snapshot_open(&snapshot, 320 * 240 - 1, false));
    offer();
    assert_null(fv_snapshot_best(&snapshot));
    fv_snapshot_close(&snapshot);
    assert_true(fv_snapshot_open(&snapshot, 320 * 240, false));
    offer();
    assert_non_null(fv_snapshot_best(&snapshot)); /* without a network at once */
    fv_snapshot_close(&snapshot);
    offer(); /* closed: nothing is wanted */
}

static void test_a_frame_of_a_recording_is_read_again(void **state)
{
    (void)state;
    assert_true(fv_snapshot_open(&snapshot, 0, false));
    assert_false(fv_snapshot_fetch(&snapshot, "sim:orbit?width=320&height=240", false));
    const int64_t stamp_ns = offer();
    assert_null(fv_snapshot_best(&snapshot)->image.data);
    assert_true(fv_snapshot_fetch(&snapshot, "sim:orbit?width=320&height=240", false));
    const struct fv_snapshot_frame *best = fv_snapshot_best(&snapshot);
    assert_non_null(best->image.data);
    assert_true(best->stamp_ns == stamp_ns);
    /* The pixels are those of this frame: the runtime finds the same features in them. */
    struct fovea_inputs inputs = {.now_ns = INT64_MAX / 2};
    const struct fovea_frame again = {
        .images = {best->image}, .image_count = 1, .stamp_ns = INT64_MAX / 2};
    inputs.frame = &again;
    fovea_grants_fixed(&rig.config, &inputs.grants);
    assert_int_equal(fovea_step(rig.rt, &inputs, &rig.outputs), FOVEA_OK);
    uint32_t count;
    const struct fovea_feature *features = fovea_features_get(rig.rt, &count);
    assert_int_equal(count, best->feature_count);
    assert_memory_equal(features, best->features, count * sizeof *features);
    fv_snapshot_close(&snapshot);
}

/* Of an LCM log, whose frames keep the numbers that they had when they were recorded. */
static void check_read_again(const char *uri, bool reverse)
{
    static const struct fovea_pose pose = {.posed = true, .inliers = 50};
    static uint8_t pixels[320 * 240];
    const struct fovea_source_selection selection = {.step = 1, .reverse = reverse};
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error;
    uint64_t sequence = 0;
    assert_int_equal(fv_source_find(uri, &ops, &address, &error), FOVEA_OK);
    if (ops->open(address, &selection, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    assert_true(fv_snapshot_open(&snapshot, 0, false));
    for (int n = 0; n < 14; n++) {
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        sequence = frame.sequence;
        memcpy(pixels, frame.images[0].data, sizeof pixels);
        if (n == 13) fv_snapshot_step(&snapshot, rig.rt, &frame, &pose);
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
    assert_true(fv_snapshot_fetch(&snapshot, uri, false));
    const struct fv_snapshot_frame *best = fv_snapshot_best(&snapshot);
    assert_int_equal(best->sequence, sequence);
    assert_int_not_equal(best->index, sequence);
    assert_int_equal(best->image.size_bytes, sizeof pixels);
    assert_memory_equal(best->image.data, pixels, sizeof pixels);
    fv_snapshot_close(&snapshot);
}

static void test_a_frame_of_a_log_is_read_again_by_its_place(void **state)
{
    (void)state;
    static const struct short_run run = {
        .width = 320, .height = 240, .iterations = 40, .features = 100};
    char folder[] = "/tmp/fovea-snapshot-XXXXXX", path[64], uri[80];
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/run.lcm", folder);
    snprintf(uri, sizeof uri, "lcmlog:%s", path);
    short_run_record(path,
                     &run); /* every eleventh iteration has no frame: numbers run ahead of places */
    check_read_again(uri, false);
    check_read_again(uri, true);
    assert_int_equal(unlink(path) | rmdir(folder), 0);
}

static void test_a_frame_that_cannot_be_read_again_leaves_none(void **state)
{
    (void)state;
    sim_rig_close(&rig);
    sim_rig_open(&rig, "sim:orbit?width=320&height=240", 0, 100);
    sim_rig_build(&rig);
    assert_true(fv_snapshot_open(&snapshot, 0, false));
    offer();
    assert_false(fv_snapshot_fetch(&snapshot, "sim:orbit?width=640&height=480", false));
    assert_null(fv_snapshot_best(&snapshot));
    assert_true(fv_snapshot_open(&snapshot, 0, false));
    offer();
    assert_false(fv_snapshot_fetch(&snapshot, "euroc:/nowhere", false));
    assert_null(fv_snapshot_best(&snapshot));
}

static int set_up(void **state)
{
    (void)state;
    sim_rig_open(&rig, "sim:orbit?width=320&height=240", 0, 100);
    sim_rig_build(&rig);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    sim_rig_close(&rig);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_boxes_go_to_the_image_of_their_stamp),
        cmocka_unit_test(test_the_frame_with_most_objects_stays),
        cmocka_unit_test(test_a_frame_that_is_too_large_is_left_out),
        cmocka_unit_test(test_a_frame_of_a_recording_is_read_again),
        cmocka_unit_test(test_a_frame_of_a_log_is_read_again_by_its_place),
        cmocka_unit_test(test_a_frame_that_cannot_be_read_again_leaves_none),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
