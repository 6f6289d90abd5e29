/* Map files outlive a death at any instant: a child that saves one map after another is killed at a
 * random moment, and what is there then is one of the maps, whole. FOVEA_KILLS: how often (100; the
 * campaign says 1,000). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "app/map_file.h"
#include "common/datasets.h"
#include "common/small_map.h"

static char folder[FV_TEST_PATH_BYTES], path[FV_TEST_PATH_BYTES + 16];

struct file {
    uint8_t *data;
    size_t bytes;
};

static struct file make_file(uint32_t keyframes)
{
    struct small_map small;
    struct fovea_random random;
    struct file file;
    fovea_random_seed(&random, keyframes);
    small_map_make(&small);
    for (uint32_t k = 0; k < keyframes; k++)
        small_map_grow(&small, &random);
    file.data = small_map_save(&small, &file.bytes);
    small_map_free(&small);
    return file;
}

static void save_for_ever(const struct file files[2], int first)
{
    for (int n = first;; n = !n)
        if (fv_map_file_write(path, files[n].data, files[n].bytes, NULL) != FOVEA_OK) _exit(1);
}

static void test_kills(void **state)
{
    (void)state;
    const char *asked = getenv("FOVEA_KILLS");
    const int kills = asked != NULL ? atoi(asked) : 100;
    const struct file files[2] = {make_file(4), make_file(9)};
    struct fovea_random random;
    int found[2] = {0, 0}, parts = 0;
    fovea_random_seed(&random, (uint64_t)time(NULL));
    assert_int_equal(fv_map_file_write(path, files[0].data, files[0].bytes, NULL), FOVEA_OK);
    for (int n = 0; n < kills; n++) {
        const pid_t child = fork();
        assert_true(child >= 0);
        if (child == 0) save_for_ever(files, n % 2);
        nanosleep(&(struct timespec){.tv_nsec = 200000 + fovea_random_below(&random, 12000000)},
                  NULL);
        int status;
        kill(child, SIGKILL);
        assert_int_equal(waitpid(child, &status, 0), child);
        assert_true(WIFSIGNALED(status)); /* it did not give up by itself */
        struct file read;
        struct fovea_error error;
        struct fv_archive_info info;
        char part[sizeof path + 8];
        snprintf(part, sizeof part, "%s.part", path);
        parts += access(part, F_OK) == 0;
        if (fv_map_file_read(path, &read.data, &read.bytes, &error) != FOVEA_OK)
            fail_msg("kill %d: %s", n, error.text);
        if (fv_archive_info(read.data, read.bytes, path, &info, &error) != FOVEA_OK)
            fail_msg("kill %d: %s", n, error.text);
        const int which = read.bytes == files[1].bytes;
        assert_int_equal(read.bytes, files[which].bytes);
        assert_memory_equal(read.data, files[which].data, read.bytes);
        found[which]++;
        free(read.data);
    }
    print_message(
        "%d kills: found one map %d times and the other %d times, cut short while writing %d times\n",
        kills, found[0], found[1], parts);
    if (kills >= 100) assert_true(found[0] > 0 && found[1] > 0 && parts > 0);
    free(files[0].data);
    free(files[1].data);
}

static void test_errors(void **state)
{
    (void)state;
    struct fovea_error error;
    struct file file = make_file(2), read;
    assert_int_equal(fv_map_file_write("/nonexistent/a.map", file.data, file.bytes, &error),
                     FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "/nonexistent/a.map"));
    assert_int_equal(fv_map_file_read("/nonexistent/a.map", &read.data, &read.bytes, &error),
                     FOVEA_ERROR_INPUT);
    assert_int_equal(fv_map_file_read(folder, &read.data, &read.bytes, &error), FOVEA_ERROR_INPUT);
    assert_int_equal(fv_map_file_probe("/nonexistent/a.map", &error), FOVEA_ERROR_INPUT);
    assert_int_equal(fv_map_file_probe(folder, &error), FOVEA_ERROR_INPUT);
    assert_int_equal(fv_map_file_probe("/dev/null", &error), FOVEA_ERROR_INPUT);
    /* A full disk leaves the old map, and no other file. */
    assert_int_equal(fv_map_file_write(path, file.data, file.bytes, &error), FOVEA_OK);
    char part[sizeof path + 8];
    snprintf(part, sizeof part, "%s.part", path);
    (void)unlink(part);
    assert_int_equal(fv_map_file_probe(path, &error), FOVEA_OK);
    assert_int_equal(access(part, F_OK), -1);
    assert_int_equal(symlink("/dev/full", part), 0);
    assert_int_equal(fv_map_file_write(path, file.data, 100, &error), FOVEA_ERROR_SYSTEM);
    assert_int_equal(access(part, F_OK), -1);
    assert_int_equal(fv_map_file_read(path, &read.data, &read.bytes, &error), FOVEA_OK);
    assert_int_equal(read.bytes, file.bytes);
    free(read.data);
    free(file.data);
}

static int set_up(void **state)
{
    (void)state;
    fv_test_folder(folder);
    snprintf(path, sizeof path, "%s/a.map", folder);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    fv_test_folder_remove(folder);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_kills),
        cmocka_unit_test(test_errors),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
