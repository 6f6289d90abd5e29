/* Recordings of real cameras, where they are there: size, number of frames, calibration and truth
 * as their data sets state them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <unistd.h>

#include "common/data_folder.h"
#include "common/datasets.h"
#include "drivers/table.h"
#include "fovea/source.h"

static void real_recordings_are_what_they_are_said_to_be(void **state)
{
    (void)state;
    static const struct {
        const char *uri, *folder;
        int32_t width, height;
        uint64_t count;
        double fx;
    } real[] = {
        {"euroc:", "euroc_mh05_a", 752, 480, 270, 458.654},
        {"kitti:", "kitti00_a", 1241, 376, 80, 718.856},
        {"kitti:", "kitti06_a", 1226, 370, 51, 707.0912},
        {"tum:", "handheld_7scenes_a", 640, 480, 250, 585.0},
        {"images:", "vamr_checkerboard/images", 752, 480, 92, 0},
    };
    for (size_t i = 0; i < sizeof real / sizeof real[0]; i++) {
        char uri[FV_TEST_PATH_BYTES];
        const struct fovea_source_ops *ops;
        const char *address;
        struct fovea_source *source;
        struct fovea_error error;
        struct fovea_frame frame;
        snprintf(uri, sizeof uri, "%s%s/%s", real[i].uri, fv_data_folder(), real[i].folder);
        assert_int_equal(fv_source_find(uri, &ops, &address, &error), FOVEA_OK);
        if (access(address, R_OK) != 0) {
            print_message("SKIPPED %s: not there\n", real[i].folder);
            continue;
        }
        const struct fovea_source_selection few = {.step = 10};
        if (ops->open(address, &few, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
        const struct fovea_source_info *info = ops->info(source);
        assert_int_equal(info->cameras[0].width, real[i].width);
        assert_int_equal(info->cameras[0].height, real[i].height);
        assert_int_equal(info->frame_count, (real[i].count + 9) / 10);
        assert_int_equal(info->rig.cameras[0].calibrated, real[i].fx > 0);
        if (info->rig.cameras[0].calibrated)
            assert_true(info->rig.cameras[0].camera.fx == real[i].fx);
        if (ops->start(source, &error) != FOVEA_OK) fail_msg("%s", error.text);
        static struct fovea_truth truth;
        size_t frames = 0, poses = 0;
        for (enum fovea_status status;
             (status = ops->dequeue(source, INT64_MAX, &frame)) != FOVEA_END;) {
            assert_int_equal(status, FOVEA_OK);
            ++frames;
            if (info->has_truth && ops->truth(source, &frame, &truth) == FOVEA_OK && truth.has_pose)
                ++poses;
            ops->requeue(source, &frame);
        }
        assert_int_equal(frames, info->frame_count);
        if (info->has_truth) assert_int_equal(poses, frames);
        assert_int_equal(info->has_truth, real[i].fx > 0);
        ops->stop(source);
        ops->close(source);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(real_recordings_are_what_they_are_said_to_be),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
