/* What an earlier run has left stays when a later one is refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "common/datasets.h"
#include "common/wrong_case.h"

enum { PATH_BYTES = FV_TEST_PATH_BYTES + 64 };

/* ---- what an earlier run has left ------------------------------------------------------------ */

static void assert_kept(const char *name)
{
    char path[PATH_BYTES], found[16] = "";
    snprintf(path, sizeof path, "%s/%s", fv_test_place, name);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    const size_t bytes = fread(found, 1, sizeof found - 1, file);
    fclose(file);
    if (bytes != 4 || strcmp(found, "kept") != 0)
        fail_msg("%s: found [%s], expected what stood there", name, found);
}

/* One wrong word costs nobody the results of yesterday, and leaves no empty file behind. */
static void test_results_are_kept(void **state)
{
    static const char *const results[] = {"record",  "trajectory", "trajectory-final", "detections",
                                          "objects", "stats",      "picture"};
    static const char *const wrong[][2] = {
        {"--trajectory @/none/x", "@/none/x"},
        {"--trajectory-final @/none/x", "@/none/x"},
        {"--objects @/none/x", "@/none/x"},
        {"--record @/none/x", "@/none/x"},
        {"--set lcm_url=udpm://239.255.76.67:0", "lcm_url"},
        {"--set lcm_url=file://@/none/x?mode=w", "lcm_url|@/none/x"},
        {"--trajectory=", "--trajectory|''"},
        {"--trajectory-final=", "--trajectory-final|''"},
        {"--objects=", "--objects|''"},
        {"--stats=", "--stats|''"},
        {"--truth @/other", "--truth|found no truth in images:"},
    };
    static const char small[] =
        "image_width: 96\nimage_height: 64\nK: [80, 0, 48, 0, 81, 32, 0, 0, 1]\nD: [0, 0, 0, 0]\n";
    (void)state;
    char linked_to[PATH_BYTES], link[PATH_BYTES];
    const char *images = fv_test_images(fv_test_place); /* quicker to open than a simulated world */
    fv_test_put("cam.yaml", small, sizeof small - 1);
    fv_test_put("kept", "kept", 4);
    snprintf(linked_to, sizeof linked_to, "%s/linked", fv_test_place);
    snprintf(link, sizeof link, "%s/link", fv_test_place);
    assert_int_equal(symlink("linked", link), 0);
    for (size_t i = 0; i < sizeof results / sizeof results[0]; i++)
        for (size_t j = 0; j < sizeof wrong / sizeof wrong[0]; j++) {
            char command[512], unmade[PATH_BYTES];
            if (strncmp(wrong[j][0] + 2, results[i], strcspn(wrong[j][0], " =") - 2) == 0) continue;
            static const char *const names[] = {"unmade", "kept", "link"};
            for (int k = 0; k < 3; k++) {
                snprintf(
                    command, sizeof command,
                    "fovea run --source images:@/images --camera @/cam.yaml --frames 1 --model src/detect/shipped.fvm --picture none --%s @/%s %s",
                    results[i], names[k], wrong[j][0]);
                fv_test_refused(command, wrong[j][1]);
            }
            assert_kept("kept");
            if (access(linked_to, F_OK) == 0) fail_msg("%s: made the file of a link", command);
            snprintf(unmade, sizeof unmade, "%s/unmade", fv_test_place);
            if (access(unmade, F_OK) == 0) fail_msg("%s: left an empty file", command);
        }
    fv_test_folder_remove(images);
}

/* `fovea check` asks whether the log of LCM can be written and leaves it as it is, or unmade. */
static void test_check_keeps_the_log(void **state)
{
    static const char *const commands[] = {
        "fovea check --set lcm_url=file://@/kept?mode=w",
        "fovea check --memory-only --set lcm_url=file://@/kept?mode=w",
        "fovea check --bench --source sim:still?frames=31 --set lcm_url=file://@/unmade?mode=w",
        "fovea check --set lcm_url=file://@/unmade?mode=a"};
    const char *text;
    char unmade[PATH_BYTES];
    (void)state;
    fv_test_put("kept", "kept", 4);
    snprintf(unmade, sizeof unmade, "%s/unmade", fv_test_place);
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
        const int status = fv_test_command(commands[i], &text);
        if (status != 0) fail_msg("%s: wait status %x: [%s]", commands[i], status, text);
        assert_kept("kept");
        if (access(unmade, F_OK) == 0) fail_msg("%s: made the file", commands[i]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_results_are_kept),
        cmocka_unit_test(test_check_keeps_the_log),
    };
    return cmocka_run_group_tests(tests, fv_test_place_set_up, fv_test_place_tear_down);
}
