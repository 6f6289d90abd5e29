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

#include "app/command.h"
#include "support/picture.h"
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

static int export_frames(const char *uri, const char *frames)
{
    char *arguments[] = {(char[]){"export"},
                         (char[]){"--masks"},
                         (char[]){"--source"},
                         (char *)(uintptr_t)uri,
                         (char[]){"--frames"},
                         (char *)(uintptr_t)frames,
                         target,
                         NULL};
    return fv_command_export(7, arguments);
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
    assert_int_equal(fovea_source_find(uri, &ops, &address, &error), FOVEA_OK);
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
    uint32_t written = 0;
    snprintf(path, sizeof path, "%s/truth.json", target);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    while (fgets(line, sizeof line, file) != NULL)
        written += strstr(line, "\"track_id\"") != NULL;
    fclose(file);
    assert_int_equal(written, boxes);
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
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(writes_frames_masks_and_truth),
        cmocka_unit_test(refuses_wrong_input),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
