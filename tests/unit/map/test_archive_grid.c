/* The grid in a map's file: there and back without loss, beside maps with and without measured
 * distances; files without one as ever; damaged ones refused with the byte. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "common/small_map.h"
#include "fovea/grid.h"

static struct small_map small, other;
static struct fv_random dice;
static int8_t cells[FV_ARCHIVE_GRID_SIDE_MAX * FV_ARCHIVE_GRID_SIDE_MAX];

static void make(bool measured)
{
    fv_random_seed(&dice, 5);
    (measured ? small_map_make_measured : small_map_make)(&small);
    (measured ? small_map_make_measured : small_map_make)(&other);
    for (int k = 0; k < 6; k++)
        small_map_grow(&small, &dice);
}

static void give_back(void)
{
    small_map_free(&small);
    small_map_free(&other);
}

static enum fovea_status read_it(const uint8_t *data, size_t bytes, struct fv_archive_info *info,
                                 struct fovea_error *error)
{
    error->text[0] = '\0';
    const enum fovea_status status = fv_archive_read(data, bytes, "a.map", &other.map, info, error);
    if (status == FOVEA_OK) return status;
    assert_int_equal(info->grid.side, 0);
    if (strstr(error->text, "a.map: byte ") != error->text || strchr(error->text, '\n') != NULL)
        fail_msg("refused without the byte: %s", error->text);
    return status;
}

static void there_and_back(void **state)
{
    (void)state;
    const uint32_t sides[] = {16, 128, 37, 512};
    for (int measured = 0; measured < 2; measured++) {
        make(measured != 0);
        size_t plain_bytes;
        uint8_t *plain = small_map_save(&small, &plain_bytes);
        for (int i = 0; i < 4; i++) {
            const struct fv_archive_grid grid = small_map_grid(&small, sides[i], &dice, cells);
            struct fv_archive_info info;
            struct fovea_error error;
            size_t bytes;
            uint8_t *data = small_map_save_with(&small, &grid, cells, 1000, &bytes);
            assert_int_equal(bytes, plain_bytes + fv_archive_grid_bytes(sides[i]));
            assert_int_equal(data[8], measured ? 6 : 5);
            if (read_it(data, bytes, &info, &error) != FOVEA_OK) fail_msg("%s", error.text);
            assert_memory_equal(&info.grid, &grid, sizeof grid);
            assert_memory_equal(data + info.grid_at, cells, sides[i] * sides[i]);
            assert_null(small_map_trouble(&other.map));
            /* The rest is what it is without a grid. */
            assert_memory_equal(data + FV_ARCHIVE_HEADER_BYTES, plain + FV_ARCHIVE_HEADER_BYTES,
                                plain_bytes - FV_ARCHIVE_HEADER_BYTES - FV_ARCHIVE_CHECKSUM_BYTES);
            free(data);
        }
        free(plain);
        give_back();
    }
}

/* Asked for, but there was nothing to write: the file is that of a map without one. */
static void without_one_the_file_is_as_ever(void **state)
{
    (void)state;
    make(false);
    const struct fv_archive_grid none = {0};
    struct fv_archive_info info;
    struct fovea_error error;
    size_t bytes, none_bytes;
    uint8_t *data = small_map_save(&small, &bytes),
            *asked = small_map_save_with(&small, &none, cells, 1, &none_bytes);
    assert_int_equal(data[8], FV_ARCHIVE_VERSION);
    assert_int_equal(none_bytes, bytes);
    assert_memory_equal(data, asked, bytes);
    assert_int_equal(read_it(data, bytes, &info, &error), FOVEA_OK);
    assert_int_equal(info.grid.side, 0);
    free(data);
    free(asked);
    give_back();
}

static void damaged_ones_are_refused_with_the_byte(void **state)
{
    (void)state;
    enum { SIDE = 20 };
    make(false);
    const struct fv_archive_grid grid = small_map_grid(&small, SIDE, &dice, cells);
    struct fv_archive_info info;
    struct fovea_error error;
    size_t bytes;
    uint8_t *data = small_map_save_with(&small, &grid, cells, 77, &bytes);
    const size_t at = bytes - FV_ARCHIVE_CHECKSUM_BYTES - fv_archive_grid_bytes(SIDE),
                 first = at + FV_ARCHIVE_GRID_BYTES;
    const struct {
        size_t at;
        uint8_t value;
        const char *expected;
    } cases[] = {
        {at, 9, "map of the grid: found 9, expected less than the next map's"},
        {at + 4, 15, "side of the grid: found 15, expected 16 to 512 cells"},
        {at + 5, 3, "side of the grid: found 788, expected 16 to 512 cells"},
        {at + 4, 21, "bytes left: found 400, expected more: the grid has more cells"},
        {at + 4, 19, "bytes left: found 39, expected none"},
        {at + 14, 0, "side of a cell"},
        {at + 15, 0x7f, "side of a cell: found "},
        {at + 15, 0xbf, "side of a cell"},
        {at + 23, 0xbf, "scale of the grid"},
        {at + 23, 0, "scale of the grid"},
        {at + 31, 0, "product of rows 0 and 0 of a rotation"},
        {at + 119, 0x7f, "translation: found "},
        {first, 35, "cell of the grid: found 35, expected -1, 0 to 34 or 66 to 100"},
        {first + 7, 65, "cell of the grid: found 65"},
        {first + 399, 101, "cell of the grid: found 101"},
        {first + 399, 0x80, "cell of the grid: found -128"},
        {8, 3, "bytes left: found 520, expected none"},
        {8, 11, "byte 8: version of the map format: found 11, expected 3 to 10: a later Fovea"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char place[32];
        const uint8_t kept = data[cases[i].at];
        data[cases[i].at] = cases[i].value;
        fv_archive_seal(data, bytes);
        if (read_it(data, bytes, &info, &error) != FOVEA_ERROR_INPUT) fail_msg("case %zu", i);
        if (strstr(error.text, cases[i].expected) == NULL) fail_msg("case %zu: %s", i, error.text);
        snprintf(place, sizeof place, "a.map: byte %zu: ", cases[i].at);
        if (cases[i].at >= first && strstr(error.text, place) != error.text)
            fail_msg("case %zu: %s", i, error.text);
        data[cases[i].at] = kept;
    }
    fv_archive_seal(data, bytes);
    assert_int_equal(read_it(data, bytes, &info, &error), FOVEA_OK);
    /* Cut anywhere, with the size and the checksum put right. */
    for (size_t length = at; length < bytes; length += 13) {
        uint8_t *cut = malloc(length);
        memcpy(cut, data, length);
        for (int i = 0; i < 8; i++)
            cut[16 + i] = (uint8_t)(length >> (8 * i));
        fv_archive_seal(cut, length);
        assert_int_equal(read_it(cut, length, &info, &error), FOVEA_ERROR_INPUT);
        free(cut);
    }
    free(data);
    give_back();
}

/* The archive knows the sizes and the cells that the grid has without knowing its header. */
static void sizes_and_cells_are_those_of_the_grid(void **state)
{
    (void)state;
    struct fovea_grid_config config;
    size_t bytes;
    fovea_grid_config_default(&config);
    config.range_m = 0.5;
    const uint32_t sides[] = {FV_ARCHIVE_GRID_SIDE_MIN - 1, FV_ARCHIVE_GRID_SIDE_MIN,
                              FV_ARCHIVE_GRID_SIDE_MAX, FV_ARCHIVE_GRID_SIDE_MAX + 1};
    for (int i = 0; i < 4; i++) {
        config.side_cells = sides[i];
        assert_int_equal(fovea_grid_size(&config, &bytes, NULL),
                         i == 1 || i == 2 ? FOVEA_OK : FOVEA_ERROR_ARGUMENT);
    }
    for (int percent = -128; percent < 128; percent++)
        assert_int_equal(fv_archive_cell((int8_t)percent),
                         percent == FOVEA_GRID_UNKNOWN ||
                             (percent >= 0 && percent < 100 * FOVEA_GRID_FREE_BELOW - 1e-9) ||
                             (percent > 100 * FOVEA_GRID_OCCUPIED_ABOVE + 1e-9 && percent <= 100));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(there_and_back),
        cmocka_unit_test(without_one_the_file_is_as_ever),
        cmocka_unit_test(damaged_ones_are_refused_with_the_byte),
        cmocka_unit_test(sizes_and_cells_are_those_of_the_grid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
