/* fovea export: frames, masks and truth of the simulated camera as files. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/lab/commands.h"
#include "common/datasets.h"
#include "support/picture.h"
#include "drivers/table.h"
#include "fovea/source.h"

static char folder[] = "/tmp/fovea-export-XXXXXX";
static char target[64];

static int set_up(void **state)
{
    (void)state;
    if (mkdtemp(folder) == NULL) return -1;
    snprintf(target, sizeof target, "%s/frames", folder);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    char command[128];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

static int export_some(const char *uri, const char *frames, bool masks)
{
    char *arguments[] = {(char[]){"export"},
                         (char[]){"--source"},
                         (char *)(uintptr_t)uri,
                         (char[]){"--frames"},
                         (char *)(uintptr_t)frames,
                         target,
                         masks ? (char[]){"--masks"} : NULL,
                         NULL};
    return fv_command_export(masks ? 7 : 6, arguments);
}

static int export_frames(const char *uri, const char *frames)
{
    return export_some(uri, frames, true);
}

static void check_mask(const char *name, const struct fovea_truth *truth, int32_t pixels)
{
    char path[128];
    struct fovea_image image;
    struct fovea_error error;
    snprintf(path, sizeof path, "%s/%s", target, name);
    assert_int_equal(fv_picture_read(path, &image, &error), FOVEA_OK);
    assert_memory_equal(image.data, truth->class_mask, (size_t)pixels);
    free((void *)(uintptr_t)image.data);
}

/* What each class of a mask is to a network that labels pixels. */
static void check_map(void)
{
    static const char expected[] = "0 other # background\n1 movable # ball\n2 movable # cone\n"
                                   "3 movable # box\n4 movable # person\n5 floor # floor\n"
                                   "6 wall # wall\n7 obstacle # obstacle\n8 obstacle # pit\n";
    char path[128], found[sizeof expected + 1] = "";
    snprintf(path, sizeof path, "%s/classes-map.txt", target);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    found[fread(found, 1, sizeof expected, file)] = '\0';
    fclose(file);
    assert_string_equal(found, expected);
}

/* What is written is what the source gives. */
static void writes_frames_masks_and_truth(void **state)
{
    (void)state;
    static const char uri[] = "sim:orbit?width=160&height=120&objects=12&seed=3";
    assert_int_equal(export_frames(uri, "2"), FV_EXIT_OK);
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_error error;
    struct fovea_source *source;
    const struct fovea_source_selection selection = {.step = 1, .frames = 2};
    assert_int_equal(fv_source_find(uri, &ops, &address, &error), FOVEA_OK);
    assert_int_equal(ops->open(address, &selection, &source, &error), FOVEA_OK);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    struct fovea_frame frame;
    struct fovea_truth truth;
    uint32_t boxes = 0;
    for (int i = 0; i < 2; i++) {
        char name[32];
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(ops->truth(source, &frame, &truth), FOVEA_OK);
        boxes += truth.box_count;
        snprintf(name, sizeof name, "%06d.mask.png", i);
        check_mask(name, &truth, 160 * 120);
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
    assert_true(boxes > 0);
    char path[128], line[512];
    uint32_t written = 0, classes = 0, named = 0;
    snprintf(path, sizeof path, "%s/truth.json", target);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    while (fgets(line, sizeof line, file) != NULL) {
        written += strstr(line, "\"track_id\"") != NULL;
        classes |= strstr(line, "\"mask_classes\"") != NULL;
        named += classes && strstr(line, "\"name\"") != NULL;
    }
    fclose(file);
    assert_int_equal(written, boxes);
    assert_int_equal(named, FOVEA_TRUTH_CLASS_COUNT);
    check_map();
}

/* A frame that looks into a pit: the mask has it, as the source says. */
static void masks_have_pits(void **state)
{
    (void)state;
    enum { W = 160, H = 120 };
    char path[128];
    struct fovea_image image;
    struct fovea_error error;
    int pit = 0;
    snprintf(target, sizeof target, "%s/pit", folder);
    assert_int_equal(export_frames("sim:drive?width=160&height=120&seed=6&time=2", "1"),
                     FV_EXIT_OK);
    snprintf(path, sizeof path, "%s/000000.mask.png", target);
    assert_int_equal(fv_picture_read(path, &image, &error), FOVEA_OK);
    for (int i = 0; i < W * H; i++)
        pit += image.data[i] == FOVEA_TRUTH_PIT;
    print_message("%d of %d pixels are of a pit\n", pit, W * H);
    assert_true(pit > 100);
    free((void *)(uintptr_t)image.data);
    snprintf(target, sizeof target, "%s/frames", folder);
}

/* Of a rig every camera's images are written, at their own sizes; an absent one leaves no file. */
static void writes_every_camera_of_a_rig(void **state)
{
    enum { W2 = 64, H2 = 80 };
    static const struct fv_test_png form = {.width = W2, .height = H2, .channels = 1, .depth = 8};
    uint8_t pixels[W2 * H2];
    char uri[FV_TEST_PATH_BYTES + 32], path[128];
    struct fovea_image image;
    struct fovea_error error;
    (void)state;
    const char *top = fv_test_euroc(folder);
    fv_test_make_folder(fv_test_path(top, "mav0/cam1"));
    fv_test_make_folder(fv_test_path(top, "mav0/cam1/data"));
    fv_test_write_text(fv_test_path(top, "mav0/cam1/data.csv"), "1403638538627829376,b.png\n");
    fv_test_picture(7, W2, H2, 1, pixels);
    fv_test_write_png(fv_test_path(top, "mav0/cam1/data/b.png"), &form, pixels);
    snprintf(uri, sizeof uri, "euroc:%s?cameras=2", top);
    snprintf(target, sizeof target, "%s/rig", folder);
    assert_int_equal(export_some(uri, "3", false), FV_EXIT_OK);
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "%s/%06d.png", target, i);
        assert_int_equal(fv_picture_read(path, &image, &error), FOVEA_OK);
        assert_int_equal(image.width, FV_TEST_WIDTH);
        free((void *)(uintptr_t)image.data);
        snprintf(path, sizeof path, "%s/%06d.cam1.png", target, i);
        assert_int_equal(access(path, F_OK), i == 1 ? 0 : -1); /* the second frame's alone */
    }
    snprintf(path, sizeof path, "%s/000001.cam1.png", target);
    assert_int_equal(fv_picture_read(path, &image, &error), FOVEA_OK);
    assert_true(image.width == W2 && image.height == H2);
    assert_memory_equal(image.data, pixels, sizeof pixels);
    free((void *)(uintptr_t)image.data);
}

/* A folder that is there already may hold somebody's work; an endless source would fill the disk.
 */
static void refuses_wrong_input(void **state)
{
    (void)state;
    assert_int_equal(export_frames("sim:orbit?width=160&height=120", "1"), FV_EXIT_WRONG);
    snprintf(target, sizeof target, "%s/other", folder);
    assert_int_equal(export_frames("sim:wander", "0"), FV_EXIT_WRONG);
    assert_int_equal(access(target, F_OK), -1);
    char uri[FV_TEST_PATH_BYTES + 32];
    snprintf(uri, sizeof uri, "euroc:%s", fv_test_euroc(folder));
    assert_int_equal(export_frames(uri, "1"), FV_EXIT_WRONG); /* --masks of a recording */
    assert_int_equal(access(target, F_OK), -1);               /* before anything was written */
    assert_int_equal(export_some(uri, "1", false), FV_EXIT_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(writes_frames_masks_and_truth),
        cmocka_unit_test(masks_have_pits),
        cmocka_unit_test(writes_every_camera_of_a_rig),
        cmocka_unit_test(refuses_wrong_input),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
