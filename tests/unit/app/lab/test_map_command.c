/* fovea map: what it exports counts up, pictures are pictures, wrong words and files are refused.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "app/lab/commands.h"
#include "app/lab/map_open.h"
#include "app/config/map_file.h"
#include "common/datasets.h"
#include "common/small_map.h"

static char *const folder = fv_test_place;
static char map[FV_TEST_PATH_BYTES + 16], ply[FV_TEST_PATH_BYTES + 16],
    tum[FV_TEST_PATH_BYTES + 16], png[FV_TEST_PATH_BYTES + 16];
static uint32_t keyframes, landmarks;

static int call(const char *a, const char *b, const char *c, const char *d, const char *e,
                const char *f)
{
    const char *words[] = {"map", a, b, c, d, e, f, NULL};
    char *argv[8];
    int argc = 0;
    while (words[argc] != NULL) {
        argv[argc] = (char *)(uintptr_t)words[argc]; /* getopt only moves them */
        argc++;
    }
    argv[argc] = NULL;
    return fv_command_map(argc, argv);
}

static int count_lines(const char *path, const char *from)
{
    char line[256];
    int count = 0;
    bool counting = from == NULL;
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    while (fgets(line, sizeof line, file) != NULL) {
        count += counting;
        counting = counting || strcmp(line, from) == 0;
    }
    fclose(file);
    return count;
}

static void test_info_export_draw(void **state)
{
    (void)state;
    unsigned char head[8] = {0};
    assert_int_equal(call("info", map, NULL, NULL, NULL, NULL), FV_EXIT_OK);
    assert_int_equal(call("export", map, "--ply", ply, "--tum", tum), FV_EXIT_OK);
    assert_int_equal(count_lines(tum, NULL), keyframes);
    assert_int_equal(count_lines(ply, "end_header\n"), keyframes + landmarks);
    assert_int_equal(call("draw", map, png, NULL, NULL, NULL), FV_EXIT_OK);
    FILE *file = fopen(png, "rb");
    assert_non_null(file);
    assert_int_equal(fread(head, 1, sizeof head, file), sizeof head);
    fclose(file);
    assert_memory_equal(head, "\x89PNG\r\n\x1a\n", sizeof head);
}

static void test_wrong_words(void **state)
{
    (void)state;
    assert_int_equal(call("show", map, NULL, NULL, NULL, NULL), FV_EXIT_WRONG);
    assert_int_equal(call("draw", map, NULL, NULL, NULL, NULL), FV_EXIT_WRONG);
    assert_int_equal(call("export", map, NULL, NULL, NULL, NULL), FV_EXIT_WRONG);
    assert_int_equal(call("info", map, "--ply", ply, NULL, NULL), FV_EXIT_WRONG);
    assert_int_equal(call("info", map, "--map", "0", NULL, NULL), FV_EXIT_WRONG); /* it lists all */
    assert_int_equal(call("draw", map, map, NULL, NULL, NULL),
                     FV_EXIT_WRONG); /* over what it reads */
    assert_int_equal(call("draw", map, png, "--map", "7", NULL), FV_EXIT_WRONG);
    assert_int_equal(call("draw", map, png, "--map", "4294967296", NULL),
                     FV_EXIT_WRONG); /* 0, and 2^32 */
    assert_int_equal(call("draw", map, png, "--map", "-4294967296", NULL), FV_EXIT_WRONG);
    assert_int_equal(call("info", "/nonexistent", NULL, NULL, NULL, NULL), FV_EXIT_WRONG);
    assert_int_equal(call("info", ply, NULL, NULL, NULL, NULL), FV_EXIT_WRONG); /* no map */
    assert_int_equal(call("info", map, NULL, NULL, NULL, NULL), FV_EXIT_OK);    /* still there */
}

static enum fovea_status write_map(const char *to, const uint8_t *data, size_t bytes)
{
    const struct fv_map_file_rules alone = {.keep = 1, .overwrite = true};
    struct fv_map_file_saved saved;
    return fv_map_file_save(to, &alone, data, bytes, &saved, NULL);
}

/* A file that says that two thousand million maps came before: what it holds is listed all the
 * same, at once. */
static void test_many_maps(void **state)
{
    (void)state;
    uint8_t *data;
    size_t bytes;
    char many[FV_TEST_PATH_BYTES + 16];
    snprintf(many, sizeof many, "%s/many.map", folder);
    assert_int_equal(fv_map_file_read(map, &data, &bytes, NULL), FOVEA_OK);
    memcpy(data + 160, (const uint8_t[]){0xff, 0xff, 0xff, 0x7f}, 4);
    fv_archive_seal(data, bytes);
    assert_int_equal(write_map(many, data, bytes), FOVEA_OK);
    free(data);
    alarm(120); /* instead of hanging */
    assert_int_equal(call("info", many, NULL, NULL, NULL, NULL), FV_EXIT_OK);
    alarm(0);
}

/* What a map's grid holds is counted. */
static void test_grid(void **state)
{
    (void)state;
    enum { SIDE = 30 };
    struct small_map small;
    struct fv_random random;
    struct fv_map_open open;
    struct fovea_error error;
    int8_t cells[SIDE * SIDE];
    uint32_t free_cells = 0, occupied = 0;
    size_t bytes;
    char path[FV_TEST_PATH_BYTES + 16];
    snprintf(path, sizeof path, "%s/grid.map", folder);
    fv_random_seed(&random, 4);
    small_map_make(&small);
    for (int k = 0; k < 3; k++)
        small_map_grow(&small, &random);
    const struct fv_archive_grid grid = small_map_grid(&small, SIDE, &random, cells);
    for (int i = 0; i < SIDE * SIDE; i++) {
        free_cells += cells[i] >= 0 && cells[i] < 35;
        occupied += cells[i] > 65;
    }
    uint8_t *data = small_map_save_with(&small, &grid, cells, SIDE, &bytes);
    assert_int_equal(write_map(path, data, bytes), FOVEA_OK);
    free(data);
    small_map_free(&small);
    assert_int_equal(call("info", path, NULL, NULL, NULL, NULL), FV_EXIT_OK);
    if (fv_map_open(path, &open, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_true(open.info.grid.side == SIDE && free_cells > 100 && occupied > 100);
    assert_true(open.grid_free == free_cells && open.grid_occupied == occupied);
    fv_map_open_free(&open);
    if (fv_map_open(map, &open, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_true(open.info.grid.side == 0 && open.grid_free == 0 && open.grid_occupied == 0);
    fv_map_open_free(&open);
}

static int set_up(void **state)
{
    struct small_map small;
    struct fv_random random;
    size_t bytes;
    if (fv_test_place_set_up(state) != 0) return -1;
    snprintf(map, sizeof map, "%s/a.map", folder);
    snprintf(ply, sizeof ply, "%s/a.ply", folder);
    snprintf(tum, sizeof tum, "%s/a.tum", folder);
    snprintf(png, sizeof png, "%s/a.png", folder);
    fv_random_seed(&random, 3);
    small_map_make(&small);
    for (int k = 0; k < 7; k++)
        small_map_grow(&small, &random);
    keyframes = small.map.state->keyframe_count;
    landmarks = small.map.state->landmark_count;
    uint8_t *data = small_map_save(&small, &bytes);
    const int failed = write_map(map, data, bytes) != FOVEA_OK;
    free(data);
    small_map_free(&small);
    return failed;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_info_export_draw),
        cmocka_unit_test(test_wrong_words),
        cmocka_unit_test(test_many_maps),
        cmocka_unit_test(test_grid),
    };
    return cmocka_run_group_tests(tests, set_up, fv_test_place_tear_down);
}
