/* Requests for maps, without a run: only ordinary files of the folder are opened, by names without
 * a path; the list has those that were written last, newest first; of requests that come while one
 * is under way, one is refused with each step. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "app/run/map_loads.h"
#include "common/small_map.h"

#include "fovea_command_result_t.h"
#include "fovea_map_files_t.h"
#include "fovea_map_load_t.h"

enum { FILES = FV_MAP_LOADS_FILES_MAX + 6, FIRST_TIME = 1000000 };

static char folder[64], outside[64];
static struct fv_settings settings;
static struct fv_requests requests;
static struct fv_map_loads loads;
static uint8_t *map;
static size_t map_bytes;

static void put(const char *in, const char *name, int64_t time)
{
    char path[320];
    const struct timespec times[2] = {{time, 0}, {time, 0}};
    snprintf(path, sizeof path, "%s/%s", in, name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(map, 1, map_bytes, file), map_bytes);
    assert_int_equal(fflush(file), 0);
    assert_int_equal(futimens(fileno(file), times), 0);
    assert_int_equal(fclose(file), 0);
}

static int make(void **state)
{
    struct small_map small;
    struct fv_random random;
    struct fovea_error error;
    char path[320];
    (void)state;
    snprintf(folder, sizeof folder, "/tmp/fovea_loads_XXXXXX");
    snprintf(outside, sizeof outside, "/tmp/fovea_loads_XXXXXX");
    if (mkdtemp(folder) == NULL || mkdtemp(outside) == NULL) return -1;
    fv_random_seed(&random, 3);
    small_map_make(&small);
    for (int k = 0; k < 4; k++)
        small_map_grow(&small, &random);
    map = small_map_save(&small, &map_bytes);
    small_map_free(&small);
    fv_settings_default(&settings);
    settings.runtime.rig.cameras[0].camera.width = 320;
    settings.runtime.rig.cameras[0].camera.height = 240;
    snprintf(settings.map_folder, sizeof settings.map_folder, "%s", folder);
    put(outside, "map", FIRST_TIME);
    snprintf(path, sizeof path, "%s/sub", folder);
    if (mkdir(path, 0700) != 0) return -1;
    put(path, "map", FIRST_TIME);
    if (fv_requests_open(&requests, &(struct fv_command_rules){.run_id = 5}, &error) == FOVEA_OK &&
        fv_map_loads_open(&loads, &requests, NULL, &settings, &error) == FOVEA_OK)
        return 0;
    print_error("%s\n", error.text);
    return -1;
}

static int clear(void **state)
{
    char line[200];
    (void)state;
    fv_map_loads_close(&loads);
    fv_requests_close(&requests);
    free(map);
    snprintf(line, sizeof line, "rm -r %s %s", folder, outside);
    return system(line);
}

static void ask(const char *file, int64_t id)
{
    uint8_t data[1024];
    const struct fv_receiver_channel row = fv_map_loads_row(&loads);
    const fovea_map_load_t request = {.id = id, .file = (char *)(uintptr_t)file};
    const int bytes = fovea_map_load_t_encode(data, 0, sizeof data, &request);
    assert_true(bytes > 0);
    const struct fv_received received = {row.name, data, (uint32_t)bytes, true};
    row.take(row.context, &received);
}

/* The loop's step, in which nothing is given. */
static void step(void)
{
    struct fv_recorder *const none[2] = {NULL, NULL};
    struct fovea_inputs inputs = {.now_ns = 0};
    fv_map_loads_take(&loads, &inputs, false);
    assert_null(inputs.map);
    fv_map_loads_step(&loads, none, &inputs, NULL, NULL);
}

static void expect_refused(const char *file, const char *reason)
{
    fovea_command_result_t result;
    ask(file, 7);
    fv_map_loads_tend(&loads);
    assert_int_equal(atomic_load(&loads.stage), FV_MAP_LOADS_ANSWERED);
    assert_false(loads.lists);
    assert_true(fovea_command_result_t_decode(loads.message, 0, (int)loads.answer_bytes, &result) >
                0);
    if (strstr(result.reason, reason) == NULL)
        fail_msg("%s: found \"%s\", expected \"%s\"", file, result.reason, reason);
    assert_int_equal(result.result, FOVEA_COMMAND_RESULT_T_RESULT_REFUSED);
    assert_int_equal(result.commands, FOVEA_MAP_LOAD_T_LOAD);
    assert_int_equal(result.id, 7);
    assert_int_equal(result.run_id, 5);
    fovea_command_result_t_decode_cleanup(&result);
    step();
    assert_int_equal(atomic_load(&loads.stage), FV_MAP_LOADS_IDLE);
}

/* ---- the tests ------------------------------------------------------------------------------- */

static void only_names_within_the_folder_are_opened(void **state)
{
    static const char wrong[] = "found no name of a file";
    char name[FV_MESSAGE_MAP_NAME_BYTES + 1], path[128];
    (void)state;
    snprintf(path, sizeof path, "%s/map", outside);
    expect_refused(path, wrong);
    snprintf(path, sizeof path, "../%s/map", outside + strlen("/tmp/"));
    expect_refused(path, wrong);
    snprintf(path, sizeof path, "sub/../../%s/map", outside + strlen("/tmp/"));
    expect_refused(path, wrong);
    expect_refused("sub/map", wrong);
    expect_refused(".", wrong);
    expect_refused(".hidden", wrong);
    expect_refused("two\nlines", wrong);
    expect_refused("delete\x7f", wrong);
    expect_refused("cut\xc3", wrong);
    memset(name, 'n', sizeof name);
    name[FV_MESSAGE_MAP_NAME_BYTES] = '\0';
    expect_refused(name, wrong);
    name[FV_MESSAGE_MAP_NAME_BYTES - 1] = '\0';
    expect_refused(name, "n: No such file or directory, expected a map in map.folder");
}

static void only_ordinary_files_are_opened(void **state)
{
    char path[128], target[128];
    (void)state;
    expect_refused("sub", "sub: found no ordinary file");
    snprintf(path, sizeof path, "%s/pipe", folder);
    assert_int_equal(mkfifo(path, 0600), 0);
    expect_refused("pipe", "pipe: found no ordinary file"); /* and nothing waits for a writer */
    snprintf(path, sizeof path, "%s/link", folder);
    snprintf(target, sizeof target, "%s/map", outside);
    assert_int_equal(symlink(target, path), 0);
    expect_refused("link", "link: found a link");
    snprintf(path, sizeof path, "%s/empty", folder);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    fclose(file);
    expect_refused("empty", "empty: found 0 bytes, expected 1 to ");
    snprintf(path, sizeof path, "%s/large", folder);
    file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(ftruncate(fileno(file), (off_t)loads.capacity + 1), 0);
    fclose(file);
    expect_refused("large", "what this run has room for");
}

static void the_list_has_the_newest_first(void **state)
{
    fovea_map_files_t list;
    char name[16];
    (void)state;
    for (int i = 0; i < FILES; i++) { /* in an order that is none */
        snprintf(name, sizeof name, "map-%d", i * 31 % FILES);
        put(folder, name, FIRST_TIME + i * 31 % FILES);
    }
    ask("", 9);
    fv_map_loads_tend(&loads);
    assert_true(loads.lists);
    assert_true(fovea_map_files_t_decode(loads.message, 0, (int)loads.answer_bytes, &list) > 0);
    assert_int_equal(list.id, 9);
    assert_int_equal(list.run_id, 5);
    assert_int_equal(list.count, FV_MAP_LOADS_FILES_MAX); /* no link, no pipe, nothing empty */
    for (int i = 0; i < list.count; i++) {
        snprintf(name, sizeof name, "map-%d", FILES - 1 - i);
        assert_string_equal(list.files[i].name, name);
        assert_int_equal(list.files[i].utime, INT64_C(1000000) * (FIRST_TIME + FILES - 1 - i));
        assert_int_equal(list.files[i].bytes, map_bytes);
        assert_true(list.files[i].landmarks > 0);
    }
    fovea_map_files_t_decode_cleanup(&list);
    step();
}

static void those_that_come_meanwhile_are_refused(void **state)
{
    size_t bytes;
    (void)state;
    ask("first", 1);
    ask("second", 2);
    ask("third", 3);
    assert_int_equal(loads.command.id, 1);
    assert_string_equal(loads.file, "first");
    assert_int_equal(atomic_load(&requests.gate.counts[FV_COMMAND_BUSY]), 2);
    assert_non_null(fv_ring_peek(&requests.ring, &bytes));
    fv_requests_step(&requests, NULL, NULL);
    assert_null(fv_ring_peek(&requests.ring, &bytes)); /* both answers are sent */
    step();
    assert_int_equal(atomic_load(&loads.stage), FV_MAP_LOADS_ASKED); /* the first still is */
    fv_map_loads_tend(&loads);
    step();
    assert_int_equal(atomic_load(&loads.stage), FV_MAP_LOADS_IDLE);
    expect_refused("fifth", "fifth: No such file or directory");
}

static void a_folder_that_is_none_is_named(void **state)
{
    static struct fv_map_loads other;
    struct fv_settings wrong = settings;
    struct fovea_error error;
    (void)state;
    snprintf(wrong.map_folder, sizeof wrong.map_folder, "%s/absent", folder);
    assert_int_equal(fv_map_loads_open(&other, &requests, NULL, &wrong, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "/absent: found No such file or directory, expected a "));
    snprintf(wrong.map_folder, sizeof wrong.map_folder, "%s/map", outside);
    assert_int_equal(fv_map_loads_open(&other, &requests, NULL, &wrong, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "/map: found a file, expected a folder"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(only_names_within_the_folder_are_opened),
        cmocka_unit_test(only_ordinary_files_are_opened),
        cmocka_unit_test(the_list_has_the_newest_first),
        cmocka_unit_test(those_that_come_meanwhile_are_refused),
        cmocka_unit_test(a_folder_that_is_none_is_named),
    };
    return cmocka_run_group_tests(tests, make, clear);
}
