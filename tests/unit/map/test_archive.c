/* Maps as files: there and back without loss, also when the map changes while it is written;
 * damaged, hostile and foreign files refused with the byte, or read into a map that is whole. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include "common/small_map.h"
#include "fovea/odometry.h"

static enum fovea_status read_into(struct small_map *small, const uint8_t *data, size_t bytes,
                                   struct fovea_error *error)
{
    struct fv_archive_info info;
    error->text[0] = '\0';
    const enum fovea_status status =
        fv_archive_read(data, bytes, "a.map", &small->map, &info, error);
    if (status != FOVEA_OK &&
        (strstr(error->text, "a.map: byte ") != error->text || strchr(error->text, '\n') != NULL))
        fail_msg("refused without the byte: %s", error->text);
    if (status != FOVEA_OK && strstr(error->text, "expected") == NULL)
        fail_msg("nothing expected: %s", error->text);
    return status;
}

static struct small_map *filled(uint64_t seed, uint32_t keyframes)
{
    struct small_map *small = malloc(sizeof *small);
    struct fv_random random;
    fv_random_seed(&random, seed);
    small_map_make(small);
    for (uint32_t k = 0; k < keyframes; k++)
        small_map_grow(small, &random);
    assert_null(small_map_trouble(&small->map));
    return small;
}

static void give_back(struct small_map *small)
{
    small_map_free(small);
    free(small);
}

static void test_there_and_back(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 8; seed++) {
        struct small_map *from = filled(seed, (uint32_t)(3 + 3 * seed)),
                         *to = filled(seed + 100, 4);
        struct fovea_error error;
        size_t bytes, again_bytes;
        uint8_t *data = small_map_save(from, &bytes);
        if (read_into(to, data, bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
        assert_null(small_map_trouble(&to->map));
        assert_int_equal(to->map.state->landmark_count, from->map.state->landmark_count);
        assert_int_equal(to->map.state->keyframe_count, from->map.state->keyframe_count);
        uint8_t *again = small_map_save(to, &again_bytes);
        assert_int_equal(again_bytes, bytes);
        assert_memory_equal(again, data, bytes);
        for (uint32_t k = 0; k < from->map.limits.keyframes;
             k++) { /* what is not stored is made again */
            const struct fv_map_frame a = fv_map_frame_at(&from->map, k),
                                      b = fv_map_frame_at(&to->map, k);
            if (!a.keyframe->used) continue;
            assert_memory_equal(a.points, b.points, a.keyframe->features * sizeof *a.points);
            assert_memory_equal(a.cells, b.cells,
                                (size_t)(from->map.columns * from->map.rows + 1) * sizeof *a.cells);
            assert_int_equal(a.keyframe->landmarks, b.keyframe->landmarks);
        }
        free(again);
        free(data);
        give_back(from);
        give_back(to);
    }
}

/* What a made-up measurement is worth: some stand on it, some do not. */
static void measure(struct small_map *small, struct fv_random *random)
{
    for (uint32_t k = 0; k < small->map.limits.keyframes; k++)
        for (uint32_t f = 0; f < small->map.keyframes[k].features; f++)
            if (small->map.keyframes[k].used && f % 2 != 0)
                fv_map_distances(&small->map, k)[f] = (struct fv_inverse_distance){
                    (float)fv_random_unit(random), (float)(1e4 * fv_random_unit(random))};
}

/* Landmarks that one keyframe sees, and those of them that stand. */
static uint32_t lonely(const struct fv_map *map, uint32_t *standing)
{
    uint32_t count = 0;
    *standing = 0;
    for (uint32_t i = 0; i < map->limits.landmarks; i++) {
        const struct fv_landmark *l = &map->landmarks[i];
        if (!l->used || l->observer_count != 1) continue;
        count++;
        *standing += fv_map_landmark_stands(map, l);
    }
    return count;
}

/* Distances that two cameras measured: without them, landmarks that one keyframe sees would fall
 * at the first cull after loading. */
static void test_measured_distances(void **state)
{
    struct small_map from, to, plain;
    struct fv_random random;
    struct fovea_error error;
    size_t bytes, plain_bytes, again_bytes;
    uint32_t stand, again_stand;
    (void)state;
    fv_random_seed(&random, 77);
    small_map_make_measured(&from);
    small_map_make_measured(&to);
    small_map_make(&plain);
    for (int k = 0; k < 6; k++)
        small_map_grow(&from, &random);
    measure(&from, &random);
    uint8_t *data = small_map_save(&from, &bytes);
    assert_int_equal(data[8], FV_ARCHIVE_VERSION + FV_ARCHIVE_HAS_DISTANCES);
    if (read_into(&to, data, bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_null(small_map_trouble(&to.map));
    const uint32_t alone = lonely(&from.map, &stand);
    if (stand <= 10 || stand + 10 >= alone) fail_msg("%u of %u stand", stand, alone);
    assert_int_equal(lonely(&to.map, &again_stand), alone);
    assert_int_equal(again_stand, stand);
    for (uint32_t k = 0; k < from.map.limits.keyframes; k++)
        assert_memory_equal(fv_map_distances(&to.map, k), fv_map_distances(&from.map, k),
                            from.map.keyframes[k].features * sizeof(struct fv_inverse_distance));
    uint8_t *again = small_map_save(&to, &again_bytes);
    assert_int_equal(again_bytes, bytes);
    assert_memory_equal(again, data, bytes);

    /* A run with one camera leaves them, and its own map is as ever. */
    if (read_into(&plain, data, bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_null(small_map_trouble(&plain.map));
    uint8_t *without = small_map_save(&plain, &plain_bytes);
    assert_int_equal(without[8], FV_ARCHIVE_VERSION);
    assert_true(plain_bytes < bytes);
    if (read_into(&to, without, plain_bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_int_equal(lonely(&to.map, &again_stand), alone);
    assert_int_equal(again_stand, 0); /* none of an earlier map's is left */

    size_t weight = FV_ARCHIVE_HEADER_BYTES; /* of the first feature of the first keyframe */
    for (uint32_t i = 0; i < from.map.state->landmark_count; i++)
        weight += FV_ARCHIVE_LANDMARK_BYTES + (size_t)FV_ARCHIVE_OBSERVER_BYTES * data[weight + 61];
    weight += FV_ARCHIVE_KEYFRAME_BYTES + FV_ARCHIVE_FEATURE_BYTES + 4;
    memset(data + weight, 0xff, 4);
    fv_archive_seal(data, bytes);
    assert_int_equal(read_into(&to, data, bytes, &error), FOVEA_ERROR_INPUT);
    if (strstr(error.text, "weight of a distance: found ") == NULL) fail_msg("%s", error.text);
    free(without);
    free(again);
    free(data);
    small_map_free(&from);
    small_map_free(&to);
    small_map_free(&plain);
}

/* Scales of the maps whose unit is known, per unit of their points; repeated or impossible ones
 * are refused. */
static void test_scales(void **state)
{
    (void)state;
    struct small_map *from = filled(6, 4), *to = filled(5, 2);
    struct fv_random random;
    struct fovea_error error;
    size_t bytes;
    fv_random_seed(&random, 31);
    struct fv_map_state *s = from->map.state;
    s->scale = (struct fv_map_scale){FOVEA_SCALE_CAMERA_HEIGHT, 0, 0.5, 0.01};
    s->S_map_world.s = 2;
    fv_map_begin_another(&from->map);
    assert_int_equal(s->scale.source, FOVEA_SCALE_FREE);
    for (int k = 0; k < 3; k++)
        small_map_grow(from, &random);
    s->scale = (struct fv_map_scale){FOVEA_SCALE_WHEEL_ODOMETRY, 0, -1.25, 0.04};
    uint8_t *data = small_map_save(from, &bytes);
    if (read_into(to, data, bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
    const struct fv_map_scale current = to->map.state->scale;
    assert_true(current.source == FOVEA_SCALE_WHEEL_ODOMETRY && current.log_scale == -1.25 &&
                current.variance == 0.04);
    fv_map_enter(&to->map, 0);
    const struct fv_map_scale left = to->map.state->scale;
    assert_true(left.source == FOVEA_SCALE_CAMERA_HEIGHT && left.log_scale == 0.5 - fv_log(2) &&
                left.variance == 0.01);
    assert_true(to->map.state->S_map_world.s == 1 && to->map.state->odom_id == 0);

    const size_t first = bytes - FV_ARCHIVE_CHECKSUM_BYTES - 2 * (size_t)FV_ARCHIVE_SCALE_BYTES;
    const struct {
        size_t at;
        uint8_t value;
        const char *expected;
    } cases[] = {{first, 0, "map of a scale: found 0, expected one that comes once"},
                 {first + 4, 5, "source of a scale: found 5, expected 1 to 4"},
                 {first + 15, 0x7f, "logarithm of a scale"},
                 {first + 23, 0xbf, "variance of a scale"},
                 {164, 10, "byte 164: scales: found 10"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const uint8_t kept = data[cases[i].at];
        data[cases[i].at] = cases[i].value;
        fv_archive_seal(data, bytes);
        assert_int_equal(read_into(to, data, bytes, &error), FOVEA_ERROR_INPUT);
        if (strstr(error.text, cases[i].expected) == NULL) fail_msg("case %zu: %s", i, error.text);
        data[cases[i].at] = kept;
    }
    free(data);
    give_back(from);
    give_back(to);
}

/* Keyframes come and go between the units: what is read is whole, and has what stayed all the time.
 */
static void test_saved_while_it_changes(void **state)
{
    (void)state;
    const uint64_t seeds = 40;
    uint32_t lost = 0, units = 0;
    for (uint64_t seed = 1; seed <= seeds; seed++) {
        struct small_map *from = filled(seed, 14), *to = filled(seed, 2);
        struct fv_archive_state archive = {0};
        struct fv_random random;
        struct fovea_error error;
        uint32_t before[SMALL_MAP_KEYFRAMES];
        const size_t capacity = fv_archive_bytes_max(&from->map.limits);
        uint8_t *data = malloc(capacity);
        fv_random_seed(&random, seed);
        for (uint32_t k = 0; k < SMALL_MAP_KEYFRAMES; k++)
            before[k] = from->map.keyframes[k].used ? from->map.keyframes[k].generation : 0;
        fv_archive_begin(&archive, 5);
        for (; fv_archive_busy(&archive); units++) {
            fv_archive_unit(&archive, &from->map, &from->camera, data, capacity);
            if (fv_random_below(&random, 3) == 0) small_map_grow(from, &random);
            if (fv_random_below(&random, 5) == 0)
                fv_map_remove_keyframe(&from->map, fv_map_most_redundant(&from->map));
        }
        const size_t bytes = fv_archive_take(&archive);
        fv_archive_seal(data, bytes);
        if (read_into(to, data, bytes, &error) != FOVEA_OK)
            fail_msg("seed %u: %s", (unsigned)seed, error.text);
        const char *trouble = small_map_trouble(&to->map);
        if (trouble != NULL) fail_msg("seed %u: %s", (unsigned)seed, trouble);
        for (uint32_t k = 0; k < SMALL_MAP_KEYFRAMES; k++)
            lost += before[k] != 0 && fv_map_holds(&from->map, k, before[k]) &&
                    !fv_map_holds(&to->map, k, before[k]);
        free(data);
        give_back(from);
        give_back(to);
    }
    assert_int_equal(lost, 0);
    assert_in_range(units, seeds * 6, seeds * (SMALL_MAP_KEYFRAMES + 6));
}

static void test_without_a_buffer_the_units_are_the_same(void **state)
{
    (void)state;
    struct small_map *small = filled(3, 9);
    struct fv_archive_state with = {0}, without = {0}, short_one = {0};
    const size_t capacity = fv_archive_bytes_max(&small->map.limits);
    uint8_t *data = malloc(capacity), small_buffer[1000 + 64];
    memset(small_buffer, 0xee, sizeof small_buffer);
    fv_archive_begin(&with, 5);
    fv_archive_begin(&without, 5);
    fv_archive_begin(&short_one, 5);
    while (fv_archive_busy(&with)) {
        fv_archive_unit(&with, &small->map, &small->camera, data, capacity);
        fv_archive_unit(&without, &small->map, &small->camera, NULL, 0);
        fv_archive_unit(&short_one, &small->map, &small->camera, small_buffer, 1000);
        assert_memory_equal(&with, &without, sizeof with);
        assert_memory_equal(&with, &short_one, sizeof with);
    }
    for (int i = 1000; i < 1064; i++)
        assert_int_equal(small_buffer[i], 0xee);
    free(data);
    give_back(small);
}

static void test_damaged_files_are_refused(void **state)
{
    (void)state;
    struct small_map *from = filled(4, 8), *to = filled(5, 2);
    struct fv_random random;
    struct fovea_error error;
    size_t bytes;
    uint8_t *data = small_map_save(from, &bytes), *bad = malloc(2 * bytes);
    fv_random_seed(&random, 8);
    for (int n = 0; n < 1000; n++) {
        size_t length = bytes;
        memcpy(bad, data, bytes);
        if (n % 4 == 0) {
            length = fv_random_below(&random, (uint32_t)bytes);
        } else if (n % 4 == 1) { /* a run of noise */
            const size_t at = fv_random_below(&random, (uint32_t)bytes);
            for (size_t i = at; i < bytes && i < at + 1 + (size_t)n; i++)
                bad[i] = (uint8_t)(bad[i] + 1 + fv_random_below(&random, 255));
        } else if (n % 4 == 2) { /* something added, or doubled */
            length += 1 + fv_random_below(&random, (uint32_t)bytes - 1);
            memcpy(bad + bytes, data, length - bytes);
        } else {
            bad[fv_random_below(&random, (uint32_t)bytes)] ^=
                (uint8_t)(1u << fv_random_below(&random, 8));
        }
        if (read_into(to, bad, length, &error) == FOVEA_OK) fail_msg("damage %d was read", n);
    }
    free(bad);
    free(data);
    give_back(from);
    give_back(to);
}

/* Files whose checksum fits whatever they say: refused, or read into a map that is whole. */
static void test_hostile_files_do_no_harm(void **state)
{
    (void)state;
    struct small_map *from = filled(6, 8), *to = filled(5, 2);
    struct fv_random random;
    struct fovea_error error;
    size_t bytes;
    uint32_t refused = 0;
    uint8_t *data = small_map_save(from, &bytes), *bad = malloc(bytes);
    fv_random_seed(&random, 9);
    for (int n = 0; n < 3000; n++) {
        memcpy(bad, data, bytes);
        for (uint32_t flips = 1 + fv_random_below(&random, 4); flips > 0; flips--) {
            uint32_t at = fv_random_below(&random, n % 3 == 0 ? 192 : (uint32_t)bytes);
            bad[at] = (uint8_t)(n % 2 == 0 ? fv_random_u32(&random) : 0xff);
        }
        fv_archive_seal(bad, bytes);
        refused += read_into(to, bad, bytes, &error) != FOVEA_OK;
        const char *trouble = small_map_trouble(&to->map);
        if (trouble != NULL) fail_msg("file %d: %s", n, trouble);
    }
    assert_in_range(refused, 300, 2999);
    free(bad);
    free(data);
    give_back(from);
    give_back(to);
}

static void test_foreign_files_are_refused(void **state)
{
    (void)state;
    struct small_map *from = filled(6, 5), *to = filled(5, 2);
    struct fovea_error error;
    size_t bytes;
    uint8_t *data = small_map_save(from, &bytes);
    const struct {
        size_t at;
        uint8_t value;
        const char *expected;
    } cases[] = {
        {0, 'G', "byte 0: first byte"},
        {8, 1,
         "byte 8: version of the map format: found 1, expected 3 to 10: only the Fovea before 0.1"},
        {8, 2,
         "byte 8: version of the map format: found 2, expected 3 to 10: only the Fovea before 0.1"},
        {8, 11,
         "byte 8: version of the map format: found 11, expected 3 to 10: a later Fovea saved it"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const uint8_t kept = data[cases[i].at];
        data[cases[i].at] = cases[i].value;
        assert_int_equal(read_into(to, data, bytes, &error), FOVEA_ERROR_INPUT);
        if (strstr(error.text, cases[i].expected) == NULL) fail_msg("%s", error.text);
        data[cases[i].at] = kept;
    }
    for (int i = 0; i < 2; i++) { /* the mark as a big-endian writer would leave it */
        const uint8_t kept = data[12 + i];
        data[12 + i] = data[15 - i];
        data[15 - i] = kept;
    }
    assert_int_equal(read_into(to, data, bytes, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "byte 12: byte order mark"));
    free(data);
    data = small_map_save(from, &bytes);
    /* The first and the last feature of the first keyframe change places. */
    size_t at = FV_ARCHIVE_HEADER_BYTES;
    for (uint32_t i = 0; i < from->map.state->landmark_count; i++)
        at += FV_ARCHIVE_LANDMARK_BYTES + (size_t)FV_ARCHIVE_OBSERVER_BYTES * data[at + 61];
    const size_t last =
        FV_ARCHIVE_FEATURE_BYTES * (size_t)(data[at + FV_ARCHIVE_KEYFRAME_BYTES - 8] - 1);
    at += FV_ARCHIVE_KEYFRAME_BYTES;
    for (size_t i = 0; i < FV_ARCHIVE_FEATURE_BYTES; i++) {
        const uint8_t kept = data[at + i];
        data[at + i] = data[at + last + i];
        data[at + last + i] = kept;
    }
    fv_archive_seal(data, bytes);
    assert_int_equal(read_into(to, data, bytes, &error), FOVEA_ERROR_INPUT);
    if (strstr(error.text, "features of keyframe: found 0, expected them cell by cell") == NULL)
        fail_msg("%s", error.text);
    free(data);
    data = small_map_save(from, &bytes);
    to->camera.fx += 0.01;
    assert_int_equal(read_into(to, data, bytes, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "byte 24: camera: found 320 x 240"));
    to->camera.fx -= 0.01;
    assert_int_equal(read_into(to, data, bytes, &error), FOVEA_OK);
    free(data);
    give_back(from);
    give_back(to);
}

/* Numbers that the rest of the map agrees with, and that a run could not count on from; and a
 * mirror. */
static void test_numbers_have_room(void **state)
{
    (void)state;
    struct small_map *from = filled(6, 5), *to = filled(5, 2);
    struct fovea_error error;
    size_t bytes, pose = FV_ARCHIVE_HEADER_BYTES;
    uint8_t *data = small_map_save(from, &bytes), *bad = malloc(bytes);
    for (uint32_t i = 0; i < from->map.state->landmark_count; i++)
        pose += FV_ARCHIVE_LANDMARK_BYTES + (size_t)FV_ARCHIVE_OBSERVER_BYTES * data[pose + 61];
    pose += 40;
    const struct {
        size_t at;
        uint8_t value;
        const char *expected;
    } cases[] = {
        {163, 0x80, "byte 160: next map: found 2147483649, expected less than 2^31"},
        {175, 0x40, "byte 168: next keyframe: found 4611686018427387909, expected less than 2^62"},
        {183, 0xff, "byte 176: frames: found -72057594037927859, expected less than 2^62"},
        {pose + 7, 0, "product of rows 0 and 0 of a rotation: found 0."},
        {pose, 0, "determinant of a rotation: found -1, expected 1"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        memcpy(bad, data, bytes);
        bad[cases[i].at] = cases[i].value;
        for (size_t k = 7; k < 24 && cases[i].at == pose;
             k += 8) /* the first row the other way round */
            bad[pose + k] ^= 0x80;
        fv_archive_seal(bad, bytes);
        assert_int_equal(read_into(to, bad, bytes, &error), FOVEA_ERROR_INPUT);
        if (strstr(error.text, cases[i].expected) == NULL) fail_msg("case %zu: %s", i, error.text);
    }
    free(bad);
    free(data);
    give_back(from);
    give_back(to);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_there_and_back),
        cmocka_unit_test(test_measured_distances),
        cmocka_unit_test(test_scales),
        cmocka_unit_test(test_saved_while_it_changes),
        cmocka_unit_test(test_without_a_buffer_the_units_are_the_same),
        cmocka_unit_test(test_damaged_files_are_refused),
        cmocka_unit_test(test_hostile_files_do_no_harm),
        cmocka_unit_test(test_foreign_files_are_refused),
        cmocka_unit_test(test_numbers_have_room),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
