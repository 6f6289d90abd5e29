/* Numbered recordings: none is written over, the oldest go, a crash's stay longest; one run at a
 * time on a file of the user's name. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include <dirent.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/record/recording_file.h"
#include "common/datasets.h"

static char *const folder = fv_test_place;
static char box[FV_TEST_PATH_BYTES + 8];

static void begin(struct fv_recording_file *file, uint32_t keep)
{
    struct fovea_error error;
    if (fv_recording_file_open(file, box, keep, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_int_equal(write(file->output.file, "x", 1), 1);
}

static void finish(struct fv_recording_file *file)
{
    struct fovea_error error;
    if (fv_recording_file_close(file, FV_RECORDING_ALL, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
}

/* A run that ended in order, and one that was cut off. */
static void run(uint32_t keep)
{
    struct fv_recording_file file;
    begin(&file, keep);
    finish(&file);
}

static void crash(uint32_t keep)
{
    const pid_t child = fork();
    if (child == 0) {
        struct fv_recording_file file;
        begin(&file, keep);
        _exit(0);
    }
    waitpid(child, NULL, 0);
}

/* One whose recording ended before it, as on a full disk. */
static void end_early(uint32_t keep, enum fv_recording_holds holds)
{
    struct fv_recording_file file;
    struct fovea_error error;
    begin(&file, keep);
    assert_int_equal(fv_recording_file_close(&file, holds, &error), FOVEA_OK);
}

static int by_name(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* The recordings as "1 2 4! 5", those not ended in order with '!'. */
static void assert_there(const char *expected)
{
    char text[256] = "", *names[64];
    int count = 0;
    DIR *list = opendir(box);
    for (const struct dirent *entry; (entry = readdir(list)) != NULL;)
        if (entry->d_name[0] != '.' && count < 64) names[count++] = strdup(entry->d_name);
    closedir(list);
    qsort(names, (size_t)count, sizeof names[0], by_name);
    for (int i = 0; i < count; i++) {
        struct fv_recording_name read;
        if (fv_recording_name_read(names[i], &read))
            snprintf(text + strlen(text), sizeof text - strlen(text), "%s%d%s",
                     text[0] != '\0' ? " " : "", (int)read.number, read.open ? "!" : "");
        free(names[i]);
    }
    assert_string_equal(text, expected);
}

static void clear(void)
{
    fv_test_folder_remove(box);
}

static void restarts_write_over_none(void **state)
{
    (void)state;
    run(0);
    run(0);
    crash(0);
    run(0);
    assert_there("1 2 3! 4");
    clear();
}

static void the_oldest_that_ended_in_order_go_and_crashes_stay(void **state)
{
    (void)state;
    crash(2);
    for (int i = 0; i < 4; i++)
        run(2);
    assert_there("1! 4 5");
    crash(2);
    run(2);
    assert_there("1! 5 6! 7");
    crash(2); /* the newest two crashes stay: no run that ended in order pushes one out */
    run(2);
    assert_there("6! 7 8! 9");
    clear();
}

static void those_that_ended_early_push_out_none_in_order(void **state)
{
    (void)state;
    run(2);
    for (int i = 0; i < 4; i++)
        end_early(2, FV_RECORDING_PART);
    assert_there("1 3! 4! 5!"); /* the last one beyond `keep` goes as the next run begins */
    run(2);
    assert_there("1 4! 5! 6");
    for (int i = 0; i < 4; i++)
        end_early(2, FV_RECORDING_NONE);
    assert_there("1 4! 5! 6");
    clear();
}

static void what_is_being_written_and_foreign_files_stay(void **state)
{
    (void)state;
    struct fv_recording_file one, other;
    char foreign[sizeof box + 64];
    begin(&one, 1);
    begin(&other, 1);
    snprintf(foreign, sizeof foreign, "%s000000-notes.lcm", box);
    fv_test_write_text(foreign, "mine");
    for (int i = 0; i < 3; i++)
        run(1);
    crash(1);
    crash(1);
    assert_there("1! 2! 5 6! 7!");
    run(1);
    assert_there("1! 2! 7! 8");
    finish(&one); /* it began first, and is not removed as it ends */
    assert_there("1 2! 7!");
    finish(&other);
    assert_there("2 7!");
    assert_int_equal(access(foreign, F_OK), 0);
    clear();
}

static void names_that_a_run_does_not_give_are_not_read(void **state)
{
    (void)state;
    struct fv_recording_name read;
    const char *const foreign[] = {
        "000001.lcm",
        "00001-20261122T210501Z.lcm",
        "000001-20261122T210501Z.lcm.bak",
        "000001-20261122T210501.lcm",
        "000001-2026112T2210501Z.lcm",
        "x000001-20261122T210501Z.lcm",
        "000001-20261122T210501Z.opn.lcm",
        "1234567890123456789-20261122T210501Z.lcm",
        "000001-",
        "",
    };
    for (size_t i = 0; i < sizeof foreign / sizeof foreign[0]; i++)
        assert_false(fv_recording_name_read(foreign[i], &read));
    assert_true(fv_recording_name_read("1234567-00000000T000000Z.open.lcm", &read));
    assert_true(read.open && read.number == 1234567);
    assert_true(fv_recording_name_read("000012-20261122T210501Z.lcm", &read));
    assert_true(!read.open && read.number == 12);
}

static void one_run_at_a_time_on_a_file(void **state)
{
    (void)state;
    struct fv_recording_file one, other;
    struct fovea_error error;
    const char *path = fv_test_path(folder, "one.lcm");
    assert_int_equal(fv_recording_file_open(&one, path, 0, &error), FOVEA_OK);
    assert_int_equal(write(one.output.file, "first", 5), 5);
    assert_int_equal(fv_recording_file_open(&other, path, 0, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "another program"));
    finish(&one);
    struct stat about;
    assert_int_equal(stat(path, &about), 0);
    assert_int_equal(about.st_size, 5);
    assert_int_equal(fv_recording_file_open(&other, path, 0, &error), FOVEA_OK);
    finish(&other);
}

static void a_deleted_recording_is_no_success(void **state)
{
    (void)state;
    struct fv_recording_file file;
    struct fovea_error error;
    begin(&file, 0);
    unlink(file.output.path);
    assert_int_equal(fv_recording_file_close(&file, FV_RECORDING_ALL, &error), FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "deleted"));
    clear();
}

static int set_up(void **state)
{
    if (fv_test_place_set_up(state) != 0) return -1;
    snprintf(box, sizeof box, "%s/box/", folder);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(restarts_write_over_none),
        cmocka_unit_test(the_oldest_that_ended_in_order_go_and_crashes_stay),
        cmocka_unit_test(those_that_ended_early_push_out_none_in_order),
        cmocka_unit_test(what_is_being_written_and_foreign_files_stay),
        cmocka_unit_test(names_that_a_run_does_not_give_are_not_read),
        cmocka_unit_test(one_run_at_a_time_on_a_file),
        cmocka_unit_test(a_deleted_recording_is_no_success),
    };
    return cmocka_run_group_tests(tests, set_up, fv_test_place_tear_down);
}
