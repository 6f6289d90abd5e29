/* What the relay makes of a run's feed: which piece of a grid, a mask, a map or an answer each
 * message is, and what it keeps for whom. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/network/feed.h"
#include "common/patience.h"
#include "web/relay.h"

#include "fovea_command_result_t.h"
#include "fovea_grid_t.h"
#include "fovea_map_t.h"
#include "fovea_segmentation_t.h"

static char folder[] = "/tmp/fovea_relay_XXXXXX", path[64];
static struct fv_feed *feed;
static struct fv_web_store store;
static struct fv_web_relay relay;
static uint8_t data[1 << 16];

/* Until the relay has found the run, and the feed its reader. */
static int begin(void **state)
{
    struct fovea_error error;
    (void)state;
    if (mkdtemp(folder) == NULL) return -1;
    snprintf(path, sizeof path, "%s/s", folder);
    const struct fv_feed_setup setup = {
        .path = path, .prefix = "R", .run_id = 7, .frame_bytes = 64};
    if (fv_feed_open(&setup, &feed, &error) != FOVEA_OK) return -1;
    memset(&store, 0, sizeof store);
    fv_web_relay_init(&relay, path, 5, &store);
    const struct fovea_message probe = {"R_POSE", data, 8, false};
    int64_t end_ns = 0;
    while (store.row_count == 0 && fv_test_patient(&end_ns, 2)) {
        fv_feed_put(feed, &probe);
        (void)fv_web_relay_tick(&relay, false);
    }
    return store.running ? 0 : -1;
}

static int end(void **state)
{
    (void)state;
    fv_web_relay_close(&relay);
    fv_feed_close(feed);
    fv_web_store_free(&store);
    const int left = rmdir(folder);
    memcpy(folder + sizeof folder - 7, "XXXXXX", 6);
    return left;
}

static void put(const char *channel, int bytes)
{
    assert_in_range(bytes, 1, sizeof data);
    fv_feed_put(feed, &(struct fovea_message){channel, data, (uint32_t)bytes, false});
    (void)fv_web_relay_tick(&relay, false);
}

/* The row of a piece; NULL: none. `count`: rows of the channel. */
static const struct fv_web_row *row_of(const char *channel, int32_t piece, uint32_t *count)
{
    const struct fv_web_row *found = NULL;
    *count = 0;
    for (uint32_t i = 0; i < store.row_count; i++) {
        if (strcmp(store.rows[i].channel, channel) != 0) continue;
        ++*count;
        if (store.rows[i].piece == piece) found = &store.rows[i];
    }
    return found;
}

static void put_grid(int32_t first_row)
{
    static char odom[] = "odom";
    fovea_grid_t grid;
    memset(&grid, 0, sizeof grid);
    grid.frame = odom;
    grid.first_row = first_row;
    put("R_GRID", fovea_grid_t_encode(data, 0, sizeof data, &grid));
}

static int32_t grid_first_row(const struct fv_web_row *row)
{
    fovea_grid_t grid;
    assert_non_null(row);
    assert_true(fovea_grid_t_decode(row->data, 0, (int)row->bytes, &grid) > 0);
    const int32_t first_row = grid.first_row;
    fovea_grid_t_decode_cleanup(&grid);
    return first_row;
}

/* Each takes the place of the same piece of the grid before; none is lost, none is kept twice. */
static void a_grid_comes_in_pieces_by_rows(void **state)
{
    uint32_t count;
    (void)state;
    for (int round = 0; round < 2; round++)
        for (int32_t piece = 0; piece < 3; piece++)
            put_grid(piece * 70);
    for (int32_t piece = 0; piece < 3; piece++)
        assert_int_equal(grid_first_row(row_of("GRID", piece, &count)), 70 * piece);
    assert_int_equal(count, 3);
    put_grid(0);
    put_grid(50); /* another size */
    assert_int_equal(grid_first_row(row_of("GRID", 1, &count)), 50);
    assert_int_equal(count, 3);
}

/* One of which the beginning was missed is not shown until the next begins. */
static void pieces_beyond_the_last_are_left_out(void **state)
{
    uint32_t count;
    (void)state;
    for (int32_t piece = 0; piece < FV_WEB_PIECES_MAX + 3; piece++)
        put_grid(piece);
    assert_int_equal(grid_first_row(row_of("GRID", FV_WEB_PIECES_MAX - 1, &count)),
                     FV_WEB_PIECES_MAX - 1);
    assert_int_equal(count, FV_WEB_PIECES_MAX);
    put_grid(99); /* nothing begins with it */
    assert_int_equal(grid_first_row(row_of("GRID", 0, &count)), 0);
    assert_int_equal(count, FV_WEB_PIECES_MAX);
    put_grid(0);
    put_grid(77);
    assert_int_equal(grid_first_row(row_of("GRID", 1, &count)), 77);
}

static void masks_of_two_networks_count_apart(void **state)
{
    static char model[] = "m";
    uint32_t count;
    fovea_segmentation_t mask;
    (void)state;
    memset(&mask, 0, sizeof mask);
    mask.model = model;
    for (int32_t piece = 0; piece < 4; piece++) {
        mask.first_row = piece * 10;
        put("R_SEGMENTATION", fovea_segmentation_t_encode(data, 0, sizeof data, &mask));
        if (piece < 2)
            put("R_SEGMENTATION2", fovea_segmentation_t_encode(data, 0, sizeof data, &mask));
    }
    assert_non_null(row_of("SEGMENTATION", 3, &count));
    assert_int_equal(count, 4);
    assert_non_null(row_of("SEGMENTATION2", 1, &count));
    assert_int_equal(count, 2);
}

/* A map goes round by slots of its pool. */
static void a_map_comes_in_pieces_by_slots(void **state)
{
    uint32_t count;
    fovea_map_t map;
    (void)state;
    memset(&map, 0, sizeof map);
    for (int32_t slot = 0; slot < 2048; slot += 256) {
        map.landmark_first = slot;
        put("R_MAP", fovea_map_t_encode(data, 0, sizeof data, &map));
    }
    map.landmark_first = 512;
    put("R_MAP", fovea_map_t_encode(data, 0, sizeof data, &map));
    assert_non_null(row_of("MAP", 7, &count));
    assert_int_equal(count, 8);
}

/* The last sixteen answers stay; those with values are for who may operate. */
static void answers_are_kept_side_by_side(void **state)
{
    static char reason[] = "";
    uint32_t count;
    fovea_command_result_t result;
    (void)state;
    memset(&result, 0, sizeof result);
    result.reason = reason;
    for (int i = 0; i < 20; i++) {
        const int bytes = fovea_command_result_t_encode(data, 0, sizeof data, &result);
        put("R_COMMAND_RESULT", bytes);
        if (i < 2) put("R_PARAMETER_RESULT", bytes);
    }
    const struct fv_web_row *row = row_of("COMMAND_RESULT", 3, &count);
    assert_non_null(row);
    assert_int_equal(count, 16);
    assert_false(row->operators);
    row = row_of("PARAMETER_RESULT", 1, &count);
    assert_true(row != NULL && row->operators);
    put("R_MAP_FILES", 64);
    row = row_of("MAP_FILES", 0, &count);
    assert_true(row != NULL && row->operators);
}

/* For Foxglove's clients, or made into something else. */
static void some_messages_go_to_no_page(void **state)
{
    static const char *const channels[] = {"R_PREVIEW", "R_CAMERA_POSE", "R_FEATURES"};
    uint32_t count;
    (void)state;
    for (int i = 0; i < 3; i++) {
        put(channels[i], 64);
        (void)row_of(channels[i] + 2, 0, &count);
        assert_int_equal(count, 0);
    }
}

/* Neither another robot's messages nor ones of another type under a known name. */
static void what_is_not_known_is_left(void **state)
{
    uint32_t count;
    fovea_map_t map;
    (void)state;
    memset(&map, 0, sizeof map);
    const int bytes = fovea_map_t_encode(data, 0, sizeof data, &map);
    put("R_GRID", bytes);
    put("Q_MAP", bytes);
    put("RMAP", bytes);
    put("R_NOBODY", bytes);
    memset(data, 0xff, 64);
    put("R_MAP", 64);
    (void)row_of("GRID", 0, &count);
    assert_int_equal(count, 0);
    (void)row_of("MAP", 0, &count);
    assert_int_equal(count, 0);
    (void)row_of("NOBODY", 0, &count);
    assert_int_equal(count, 0);
}

/* Tries without the time between them; how often the log gives a reason. */
static int try_without_run(int times)
{
    const uint64_t before = store.log_count;
    uint64_t said = before;
    for (int i = 0; i < times; i++) {
        relay.next_try_ns = 0;
        const bool changed = fv_web_relay_tick(&relay, false);
        assert_true(changed || store.log_count == said); /* pages get the line */
        said = store.log_count;
    }
    return (int)(said - before);
}

static void why_there_is_no_run_is_said_once(void **state)
{
    (void)state;
    fv_feed_close(feed);
    feed = NULL;
    while (store.running)
        (void)fv_web_relay_tick(&relay, false);
    assert_int_equal(try_without_run(5), 0);
    assert_int_equal(try_without_run(100), 1);
    assert_non_null(strstr(store.log[(store.log_count - 1) % FV_WEB_LOG_MAX].text, path));
    FILE *other = fopen(path, "w"); /* no socket */
    assert_non_null(other);
    fclose(other);
    assert_int_equal(try_without_run(100), 1);
    assert_int_equal(unlink(path), 0);
}

int main(void)
{
#define RUN(name) cmocka_unit_test_setup_teardown(name, begin, end)
    const struct CMUnitTest tests[] = {
        RUN(a_grid_comes_in_pieces_by_rows),    RUN(pieces_beyond_the_last_are_left_out),
        RUN(masks_of_two_networks_count_apart), RUN(a_map_comes_in_pieces_by_slots),
        RUN(answers_are_kept_side_by_side),     RUN(what_is_not_known_is_left),
        RUN(some_messages_go_to_no_page),       RUN(why_there_is_no_run_is_said_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
