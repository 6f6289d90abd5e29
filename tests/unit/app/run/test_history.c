/* The counters of a robot that survive restarts: their file, its place, and when a run writes it.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "app/run/history.h"
#include "app/run/run.h"
#include "common/fresh_root.h"
#include "drivers/clock.h"

static void test_history(void **state)
{
    (void)state;
    char path[128], text[256];
    struct fv_history history, read;
    struct fovea_error error;
    snprintf(path, sizeof path, "%s/history", root);
    assert_int_equal(fv_history_read(path, &history, &error), FOVEA_OK);
    assert_int_equal(history.starts, 0);
    history = (struct fv_history){7, 6, 1234567890123, 4, 5, 6, 8};
    assert_int_equal(fv_history_write(path, &history, &error), FOVEA_OK);
    assert_int_equal(fv_history_read(path, &read, &error), FOVEA_OK);
    assert_memory_equal(&history, &read, sizeof read);
    put("/history", "");
    assert_int_equal(fv_history_read(path, &read, &error), FOVEA_OK);
    assert_int_equal(read.starts, 0);
    put("/history", "junk\n");
    assert_int_equal(fv_history_read(path, &read, &error), FOVEA_ERROR_INPUT);
    static const struct {
        const char *text, *said;
    } wrong[] = {
        {"", "history: line 1: found '', expected \"starts: NUMBER\""},
        {"starts: 1\nends: -1\n", "history: line 2: found 'ends: -1', expected \"ends: NUMBER\""},
        {"starts: 1\nends: 2\nseconds: 0\nframes: 0\nsource_failures: 0\npose_failures: 0\nhot_seconds: 0\n",
         "history: line 2: found 2 ends, expected at most the 1 starts"},
        {"starts: 1\nends: 1\nseconds: 0\nframes: 0\nsource_failures: 0\npose_failures: 0\nhot_seconds: 0",
         "history: line 7: found more or no end of the line, expected 7 lines"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        snprintf(text, sizeof text, "%s", wrong[i].text);
        assert_int_equal(fv_history_parse("history", text, &read, &error), FOVEA_ERROR_INPUT);
        assert_string_equal(error.text, wrong[i].said);
    }
}

static void test_where_history_is_kept(void **state)
{
    (void)state;
    char path[64];
    static const struct {
        const char *folder, *asked, *config, *path;
    } cases[] = {
        {"/var/lib/fovea", "auto", "/etc/fovea/front.yaml", "/var/lib/fovea/front.health"},
        {"/var/lib/fovea:/var/lib/more", "auto", "rig.yaml", "/var/lib/fovea/rig.health"},
        {"/var/lib/fovea", "auto", "front", "/var/lib/fovea/front.health"},
        {"/var/lib/fovea", "auto", "", ""},
        {NULL, "auto", "/etc/fovea/front.yaml", ""},
        {"/var/lib/fovea", "", "/etc/fovea/front.yaml", ""},
        {"/var/lib/fovea", "kept", "/etc/fovea/front.yaml", "kept"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        if (cases[i].folder != NULL)
            setenv("STATE_DIRECTORY", cases[i].folder, 1);
        else
            unsetenv("STATE_DIRECTORY");
        fv_history_path(cases[i].asked, cases[i].config, path, sizeof path);
        assert_string_equal(path, cases[i].path);
    }
    unsetenv("STATE_DIRECTORY");
}

static struct fv_run run;

/* Counters whose disk is away at the start and comes back: the file is tried again each minute, not
 * at each look, and then has all that was counted meanwhile; likewise when it goes away later. */
static void test_counters_are_kept_when_they_can_be(void **state)
{
    (void)state;
    enum { TRIES = 3, LOOKS = 5, FRAMES = 10 };
    struct fv_history kept;
    struct fovea_error error;
    char disk[80], away[80];
    memset(&run, 0, sizeof run);
    run.quiet = true;
    run.settings.health_silence_ms = 60000;
    fv_watch_open(&run.watch, false, true);
    snprintf(disk, sizeof disk, "%s/disk", root);
    snprintf(away, sizeof away, "%s/away", root);
    snprintf(run.health.history_path, sizeof run.health.history_path, "%s/front.health", disk);
    run.loop.real_time = true;
    setenv("FOVEA_SYS_ROOT", root, 1);
    fv_run_health_open(&run);
    unsetenv("FOVEA_SYS_ROOT");
    for (int minute = 1; minute <= TRIES; minute++) {
        run.shared.frames += FRAMES;
        run.health.counted_ns -= 60 * FV_SECOND_NS;
        run.health.kept_ns -= 60 * FV_SECOND_NS;
        fv_run_health_tend(&run);
    }
    assert_int_equal(mkdir(disk, 0777), 0);
    for (int look = 0; look < LOOKS; look++)
        fv_run_health_tend(&run);
    assert_int_equal(access(run.health.history_path, F_OK), -1);
    run.health.kept_ns -= 60 * FV_SECOND_NS;
    fv_run_health_tend(&run);
    assert_int_equal(fv_history_read(run.health.history_path, &kept, &error), FOVEA_OK);
    assert_int_equal(kept.starts, 1);
    assert_int_equal(kept.frames, TRIES * FRAMES);
    assert_in_range(kept.seconds, TRIES * 60, TRIES * 60 + 10);

    assert_int_equal(rename(disk, away), 0);
    run.shared.frames += FRAMES;
    run.health.kept_ns -= 60 * FV_SECOND_NS;
    fv_run_health_tend(&run);
    assert_int_equal(rename(away, disk), 0);
    run.health.kept_ns -= 60 * FV_SECOND_NS;
    fv_run_health_tend(&run);
    assert_int_equal(fv_history_read(run.health.history_path, &kept, &error), FOVEA_OK);
    assert_int_equal(kept.frames, (TRIES + 1) * FRAMES);
    assert_int_equal(kept.ends, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_history, make_root, remove_root),
        cmocka_unit_test(test_where_history_is_kept),
        cmocka_unit_test_setup_teardown(test_counters_are_kept_when_they_can_be, make_root,
                                        remove_root),
    };
    return cmocka_run_group_tests_name("history", tests, NULL, NULL);
}
