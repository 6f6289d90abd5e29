/* The player of recordings: it gives all frames and messages in their order and at their pace, from
 * the position that was asked for. Whatever is in the file, each call gives a picture, a message or
 * one line about damage. */
#include <malloc.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/short_run.h"
#include "drivers/clock.h"
#include "message/wire.h"
#include "support/text.h"
#include "web/relay.h"

enum { FRAMES = 40, PERIOD_MS = 50 }; /* every eleventh iteration has none */

static char folder[] = "/tmp/fovea-test-XXXXXX", path[64], changed[64];
static uint8_t *whole;
static size_t whole_bytes;

static struct fv_web_player *open_player(const char *name)
{
    struct fv_web_player *player;
    struct fovea_error damage, error;
    if (fv_web_player_open(name, &player, &damage, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_string_equal(damage.text, "");
    return player;
}

/* Play up to `now_ns`; the number of frames, and the sequence of the last. */
static int play(struct fv_web_player *player, int64_t now_ns, int64_t *last)
{
    struct fv_web_player_out out;
    enum fv_web_played played;
    int frames = 0;
    while ((played = fv_web_player_next(player, now_ns, &out)) != FV_WEB_PLAYED_NOTHING) {
        if (played != FV_WEB_PLAYED_FRAME) continue;
        frames++;
        *last = (int64_t)out.frame.sequence;
    }
    return frames;
}

static void frames_come_at_their_pace(void **state)
{
    struct fv_web_player *player = open_player(path);
    struct fv_web_playback playback;
    int64_t last = -1, now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    (void)state;
    assert_int_equal(play(player, now_ns, &last), 1);
    now_ns += 10 * PERIOD_MS * INT64_C(1000000); /* 0 to 9 before the one without a frame */
    play(player, now_ns, &last);
    assert_int_equal(last, 9);
    fv_web_player_state(player, &playback);
    assert_in_range(playback.position_ms, 10 * PERIOD_MS - 1, 10 * PERIOD_MS + 40);
    assert_int_equal(playback.length_ms, (FRAMES - 1) * PERIOD_MS);
    fv_web_player_seek(player, 30 * PERIOD_MS);
    now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    play(player, now_ns, &last);
    assert_int_equal(last, 30);
    fv_web_player_seek(player, 3 * PERIOD_MS); /* back */
    fv_web_player_pause(player, true);
    assert_int_equal(play(player, now_ns + INT64_C(1000000000), &last), 1); /* one while paused */
    assert_int_equal(last, 3);
    fv_web_player_seek(player, 0);
    fv_web_player_pause(player, false);
    assert_int_equal(play(player, fv_clock_ns(CLOCK_MONOTONIC) + INT64_C(4000000000), &last),
                     FRAMES - FRAMES / 11);
    fv_web_player_state(player, &playback);
    assert_true(playback.paused && playback.position_ms == playback.length_ms);
    fv_web_player_close(player);
}

/* The relay shows each picture with its own features, and nothing of what came before a jump. */
static void the_relay_shows_it(void **state)
{
    static struct fv_web_store store;
    static struct fv_web_relay relay;
    (void)state;
    fv_web_relay_init(&relay, "", 60, &store);
    fv_web_relay_play(&relay, open_player(path));
    fv_web_player_pause(relay.player, true);
    fv_web_player_seek(relay.player, 15 * PERIOD_MS);
    assert_true(fv_web_relay_tick(&relay, true));
    assert_int_equal(store.picture.sequence, 15);
    assert_int_equal(store.picture.image.width, 160);
    assert_true(store.picture.point_count > 20);
    assert_true(store.running && store.playback_version > 0 && store.playback.paused);
    const uint32_t run = store.run;
    fv_web_player_seek(relay.player, 0);
    (void)fv_web_relay_tick(&relay, true);
    assert_int_equal(store.picture.sequence, 0);
    assert_int_equal(store.run, run + 1);
    fv_web_player_close(relay.player);
    fv_web_relay_close(&relay);
    fv_web_store_free(&store);
}

/* Each camera of a rig that somebody looks at; another one while it is paused, too. */
static void the_relay_shows_every_camera(void **state)
{
    static const struct short_run rig = {
        .width = 160, .height = 120, .iterations = 8, .features = 100, .rig = true};
    static struct fv_web_store store;
    static struct fv_web_relay relay;
    char name[80];
    (void)state;
    snprintf(name, sizeof name, "%s/rig.lcm", folder);
    short_run_record(name, &rig);
    fv_web_relay_init(&relay, "", 60, &store);
    fv_web_relay_play(&relay, open_player(name));
    relay.cameras = 1;
    fv_web_player_pause(relay.player, true);
    fv_web_player_seek(relay.player, PERIOD_MS);
    assert_true(fv_web_relay_tick(&relay, true));
    assert_int_equal(store.cameras, 2);
    assert_int_equal(store.picture.image.width, 160);
    assert_null(fv_web_store_picture(&store, 1)->image.data);
    relay.cameras = 3;
    for (int i = 0; i < 2; i++)
        (void)fv_web_relay_tick(&relay, true);
    assert_int_equal(fv_web_store_picture(&store, 1)->image.width, 120);
    assert_int_equal(fv_web_store_picture(&store, 1)->stamp_ns, store.picture.stamp_ns);
    fv_web_player_close(relay.player);
    fv_web_relay_close(&relay);
    fv_web_store_free(&store);
    assert_int_equal(unlink(name), 0);
}

static void damage_ends_in_one_line(void **state)
{
    uint64_t seed = 3;
    uint32_t refused = 0, played = 0;
    uint8_t *copy = malloc(whole_bytes);
    (void)state;
    for (int round = 0; round < 60; round++) {
        struct fv_web_player *player;
        struct fovea_error damage = {0}, error = {0};
        int64_t last;
        memcpy(copy, whole, whole_bytes);
        for (int flips = 0; flips < 1 + round % 7; flips++) {
            seed = seed * 6364136223846793005u + 1442695040888963407u;
            const size_t span = round % 2 == 0 ? 4096 : whole_bytes;
            copy[(size_t)(seed >> 20) % span] ^= (uint8_t)(1u << (seed >> 61));
        }
        FILE *file = fopen(changed, "wb");
        assert_int_equal(fwrite(copy, 1, whole_bytes - (size_t)round * 1000, file),
                         whole_bytes - (size_t)round * 1000);
        fclose(file);
        if (fv_web_player_open(changed, &player, &damage, &error) != FOVEA_OK) {
            assert_int_equal(strncmp(error.text, changed, strlen(changed)), 0);
            refused++;
            continue;
        }
        played++;
        if (round > 0) assert_int_equal(strncmp(damage.text, changed, strlen(changed)), 0);
        play(player, fv_clock_ns(CLOCK_MONOTONIC) + INT64_C(4000000000), &last);
        fv_web_player_close(player);
    }
    print_message("60 damaged recordings: %u refused, %u played\n", refused, played);
    assert_true(refused > 2 && played > 20);
    free(copy);
}

/* Where in the file the n-th frame's event begins. */
static size_t frame_at(int n)
{
    size_t at = 0;
    for (int seen = 0; at + 33 < whole_bytes;) {
        const size_t channel = fv_wire_read(whole + at + 20, 4);
        if (memcmp(whole + at + 28 + channel - 5, "FRAME", 5) == 0 && seen++ == n) return at;
        at += 28 + channel + fv_wire_read(whole + at + 24, 4);
    }
    fail_msg("no frame %d", n);
    return 0;
}

static void write_changed(const uint8_t *bytes)
{
    FILE *file = fopen(changed, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, whole_bytes, file), whole_bytes);
    fclose(file);
}

/* A position is in whole ms, and a frame may begin between two: a seek to the position where the
 * player stands shows the same frame. */
static void it_stays_where_it_stands(void **state)
{
    struct fv_web_playback playback;
    int64_t last = -1;
    uint8_t *copy = malloc(whole_bytes), *time;
    (void)state;
    memcpy(copy, whole, whole_bytes);
    time = copy + frame_at(5) + 12;
    fv_wire_write(time, fv_wire_read(time, 8) + 333, 8);
    write_changed(copy);
    struct fv_web_player *player = open_player(changed);
    fv_web_player_pause(player, true);
    fv_web_player_seek(player, 5 * PERIOD_MS + 1);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(play(player, fv_clock_ns(CLOCK_MONOTONIC), &last), 1);
        assert_int_equal(last, 5);
        fv_web_player_state(player, &playback);
        fv_web_player_seek(player, playback.position_ms);
    }
    fv_web_player_close(player);
    free(copy);
}

/* A stamp that nothing can be computed with is damage, and what is before it is played. */
static void stamps_without_bounds_are_damage(void **state)
{
    static const uint64_t stamps[] = {UINT64_C(1) << 63, INT64_MAX, (UINT64_C(1) << 55) + 1,
                                      UINT64_C(0) - (UINT64_C(1) << 55) - 1};
    uint8_t *copy = malloc(whole_bytes);
    (void)state;
    for (int i = 0; i < 8; i++) {
        struct fv_web_player *player;
        struct fovea_error damage = {0}, error = {0};
        int64_t last = -1;
        memcpy(copy, whole, whole_bytes);
        for (int byte = 0; byte < 8; byte++)
            copy[frame_at(i < 4 ? 5 : 0) + 12 + (size_t)byte] =
                (uint8_t)(stamps[i % 4] >> (56 - 8 * byte));
        write_changed(copy);
        const enum fovea_status status = fv_web_player_open(changed, &player, &damage, &error);
        assert_int_equal(status, i < 4 ? FOVEA_OK : FOVEA_ERROR_INPUT);
        assert_non_null(strstr(i < 4 ? damage.text : error.text, "found an event of the time"));
        if (i >= 4) continue;
        play(player, fv_clock_ns(CLOCK_MONOTONIC) + INT64_C(4000000000), &last);
        assert_int_equal(last, 4);
        fv_web_player_close(player);
    }
    free(copy);
}

/* A recording from the middle of a run has its state in the header, which is not held. */
static void a_state_is_not_held(void **state)
{
    const struct short_run run = {
        .width = 160, .height = 120, .iterations = 12, .features = 200, .begin = 5};
    (void)state;
    short_run_record(changed, &run);
    const struct mallinfo2 before = mallinfo2();
    struct fv_web_player *player = open_player(changed);
    const struct mallinfo2 after = mallinfo2();
    const long held =
        (long)(after.uordblks + after.hblkhd) - (long)(before.uordblks + before.hblkhd);
    print_message("held by a player: %ld bytes\n", held);
#if !defined(FOVEA_SANITIZED) /* sanitizers own the heap */
    assert_in_range(held, 1, 1 << 20);
#endif
    fv_web_player_close(player);
}

int main(void)
{
    const struct short_run run = {
        .width = 160, .height = 120, .iterations = FRAMES, .features = 200};
    struct fovea_error error;
    char *text;
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(path, sizeof path, "%s/good", folder);
    snprintf(changed, sizeof changed, "%s/changed", folder);
    short_run_record(path, &run);
    if (fv_text_read(path, 1 << 28, &text, &whole_bytes, &error) != FOVEA_OK) return 1;
    whole = (uint8_t *)text;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_come_at_their_pace),
        cmocka_unit_test(the_relay_shows_it),
        cmocka_unit_test(the_relay_shows_every_camera),
        cmocka_unit_test(damage_ends_in_one_line),
        cmocka_unit_test(it_stays_where_it_stands),
        cmocka_unit_test(stamps_without_bounds_are_damage),
        cmocka_unit_test(a_state_is_not_held),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    unlink(path);
    unlink(changed);
    rmdir(folder);
    free(whole);
    return failed;
}
