/* Gravity in a map's file: there and back in the axes of each map, beside grid and distances; a map
 * without it is the file that it always was; damaged values refused with the byte. */
#include <math.h>
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
#include "fovea/odometry.h"
#include "geometry/vec.h"

enum { SIDE = 20 };
static struct small_map small, other;
static struct fv_random dice;
static int8_t cells[SIDE * SIDE];

/* Two maps of some keyframes each, the second one current. */
static void make(bool measured)
{
    fv_random_seed(&dice, 5);
    (measured ? small_map_make_measured : small_map_make)(&small);
    (measured ? small_map_make_measured : small_map_make)(&other);
    for (int k = 0; k < 6; k++) {
        if (k == 3) fv_map_begin_another(&small.map);
        small_map_grow(&small, &dice);
    }
}

/* Both know of gravity, and the first, which was left, has been turned since. */
static void show_gravity(void)
{
    const double turn[3] = {0.3, -0.2, 0.5};
    struct fv_map_odom *left = &small.map.state->left[0];
    left->gravity = (struct fv_map_gravity){{0.6, 0, 0.8}, 0.01};
    left->scale = (struct fv_map_scale){FOVEA_SCALE_INERTIAL, 0, 0.5, 1e-4};
    fv_so3_exp(turn, left->S_map_world.R);
    small.map.state->gravity = (struct fv_map_gravity){{0, -0.8, 0.6}, 0.002};
}

static void give_back(void)
{
    small_map_free(&small);
    small_map_free(&other);
}

static enum fovea_status read_it(const uint8_t *data, size_t bytes, struct fovea_error *error)
{
    struct fv_archive_info info;
    error->text[0] = '\0';
    const enum fovea_status status =
        fv_archive_read(data, bytes, "a.map", &other.map, &info, error);
    if (status == FOVEA_OK) return status;
    if (strstr(error->text, "a.map: byte ") != error->text || strchr(error->text, '\n') != NULL)
        fail_msg("refused without the byte: %s", error->text);
    return status;
}

static void check_same(uint32_t map_id)
{
    struct fv_map_gravity was, is;
    assert_true(fv_map_gravity_of(&small.map, map_id, &was));
    assert_true(fv_map_gravity_of(&other.map, map_id, &is));
    for (int i = 0; i < 3; i++)
        assert_true(fabs(is.down[i] - was.down[i]) < 1e-12);
    assert_true(is.sigma == was.sigma);
}

static void gravity_of_each_map_is_read_in_its_own_axes(void **state)
{
    (void)state;
    for (int kind = 0; kind < 4; kind++) {
        make(kind % 2 != 0);
        show_gravity();
        const struct fv_archive_grid grid = small_map_grid(&small, SIDE, &dice, cells);
        struct fovea_error error;
        size_t bytes, again_bytes;
        uint8_t *data =
            small_map_save_with(&small, kind < 2 ? NULL : &grid, cells, SIDE * SIDE, &bytes);
        assert_int_equal(data[8], 7 + kind);
        if (read_it(data, bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
        check_same(0);
        check_same(1);
        fv_map_enter(&other.map, 0); /* it goes with its map */
        assert_true(other.map.state->gravity.sigma == 0.01);
        assert_true(other.map.state->scale.log_scale == 0.5);
        fv_map_enter(&other.map, 1);
        assert_true(other.map.state->gravity.sigma == 0.002);
        if (kind < 2) { /* the grid is its owner's to write again */
            uint8_t *again = small_map_save(&other, &again_bytes);
            assert_int_equal(again_bytes, bytes);
            assert_memory_equal(again, data, bytes);
            free(again);
        }
        free(data);
        give_back();
    }
}

static void a_map_without_it_is_the_file_it_always_was(void **state)
{
    (void)state;
    make(false);
    struct fovea_error error;
    struct fv_map_gravity gravity;
    size_t bytes, more_bytes;
    uint8_t *data = small_map_save(&small, &bytes);
    assert_int_equal(data[8], FV_ARCHIVE_VERSION);
    show_gravity();
    small.map.state->left[0].scale = (struct fv_map_scale){0};
    uint8_t *more = small_map_save(&small, &more_bytes);
    assert_int_equal(more_bytes, bytes + 2 * FV_ARCHIVE_GRAVITY_BYTES);
    assert_memory_equal(more + FV_ARCHIVE_HEADER_BYTES, data + FV_ARCHIVE_HEADER_BYTES,
                        bytes - FV_ARCHIVE_HEADER_BYTES - FV_ARCHIVE_CHECKSUM_BYTES);
    assert_int_equal(read_it(more, more_bytes, &error), FOVEA_OK);
    assert_true(fv_map_gravity_of(&other.map, 1, &gravity));
    assert_int_equal(read_it(data, bytes, &error), FOVEA_OK); /* nothing of before is left */
    assert_false(fv_map_gravity_of(&other.map, 0, &gravity));
    assert_false(fv_map_gravity_of(&other.map, 1, &gravity));
    free(more);
    free(data);
    give_back();
}

static void damaged_values_are_refused_with_the_byte(void **state)
{
    (void)state;
    make(false);
    show_gravity();
    struct fovea_error error;
    size_t bytes;
    uint8_t *data = small_map_save(&small, &bytes);
    const size_t at = bytes - FV_ARCHIVE_CHECKSUM_BYTES - 2 * (size_t)FV_ARCHIVE_GRAVITY_BYTES;
    const struct {
        size_t at, named;
        uint8_t value;
        const char *expected;
    } cases[] = {
        {at, at, 9, "map of a gravity: found 9, expected less than the next map's"},
        {at, at + FV_ARCHIVE_GRAVITY_BYTES, 0, "map of a gravity: found 0, expected one that"},
        {at + 4, at + 4, 1, "reserved bytes of a gravity: found 1, expected 0"},
        {at + 22, at + 8, 0xe0, "square of gravity's direction: found "},
        {at + 15, at + 8, 0xc0, "direction of gravity: found "},
        {at + 31, at + 24, 0x7f, "direction of gravity: found "},
        {at + 39, at + 32, 0xbf, "standard deviation of gravity: found -0.002, expected more"},
        {at + 39, at + 32, 0x7f, "standard deviation of gravity: found "},
        {184, 184, 10, "gravities: found 10, expected at most 9"},
        {184, bytes - 48, 1, "bytes left: found 40, expected none"},
        {184, bytes - 8, 3, "bytes left: found 0, expected more"},
        {8, at, 3, "bytes left: found 80, expected none"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char place[32];
        const uint8_t kept = data[cases[i].at];
        data[cases[i].at] = cases[i].value;
        fv_archive_seal(data, bytes);
        if (read_it(data, bytes, &error) != FOVEA_ERROR_INPUT) fail_msg("case %zu", i);
        snprintf(place, sizeof place, "a.map: byte %zu: ", cases[i].named);
        if (strstr(error.text, cases[i].expected) == NULL ||
            strstr(error.text, place) != error.text)
            fail_msg("case %zu: %s", i, error.text);
        data[cases[i].at] = kept;
    }
    fv_archive_seal(data, bytes);
    assert_int_equal(read_it(data, bytes, &error), FOVEA_OK);
    free(data);
    give_back();
}

/* Any byte of the records, to any value: refused, or a unit vector with a sigma. */
static void whatever_is_read_is_a_direction(void **state)
{
    (void)state;
    make(false);
    show_gravity();
    struct fovea_error error;
    size_t bytes;
    uint32_t refused = 0;
    uint8_t *data = small_map_save(&small, &bytes), *bad = malloc(bytes);
    const size_t at = bytes - FV_ARCHIVE_CHECKSUM_BYTES - 2 * (size_t)FV_ARCHIVE_GRAVITY_BYTES;
    for (int n = 0; n < 4000; n++) {
        memcpy(bad, data, bytes);
        bad[at + fv_random_below(&dice, 2 * FV_ARCHIVE_GRAVITY_BYTES)] =
            (uint8_t)fv_random_u32(&dice);
        fv_archive_seal(bad, bytes);
        if (read_it(bad, bytes, &error) != FOVEA_OK) {
            refused++;
            continue;
        }
        for (uint32_t id = 0; id < 2; id++) {
            struct fv_map_gravity gravity;
            if (!fv_map_gravity_of(&other.map, id, &gravity)) continue;
            assert_true(fabs(fv_norm3(gravity.down) - 1) < 1e-6 && gravity.sigma <= FV_PI);
        }
    }
    assert_in_range(refused, 800, 3900);
    free(bad);
    free(data);
    give_back();
}

/* The oldest of as many maps as are remembered, in whose place the one goes that is left for it. */
static void a_map_that_is_entered_keeps_what_is_known(void **state)
{
    (void)state;
    static struct fv_map_state s;
    struct fv_map map = {.state = &s};
    s.map_next = 1;
    for (int n = 0; n < FV_MAP_WORLDS_MAX; n++) {
        s.gravity = (struct fv_map_gravity){{0, 0, 1}, 0.001 * (n + 1)};
        fv_map_begin_another(&map);
    }
    fv_map_enter(&map, 0);
    assert_true(s.map_id == 0 && s.gravity.sigma == 0.001);
    fv_map_enter(&map, 5);
    assert_true(s.map_id == 5 && s.gravity.sigma == 0.006);
    fv_map_enter(&map, 0);
    assert_true(s.map_id == 0 && s.gravity.sigma == 0.001);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gravity_of_each_map_is_read_in_its_own_axes),
        cmocka_unit_test(a_map_without_it_is_the_file_it_always_was),
        cmocka_unit_test(damaged_values_are_refused_with_the_byte),
        cmocka_unit_test(whatever_is_read_is_a_direction),
        cmocka_unit_test(a_map_that_is_entered_keeps_what_is_known),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
