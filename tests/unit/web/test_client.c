/* What a page is sent, and when: the newest of each message, two pictures on their way, a class of
 * pictures that follows the link, no more than it can say. Without sockets and without time: the
 * clock is the test's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "web/client.h"

#define MS INT64_C(1000000)

static struct fv_web_store store;
static struct fv_web_client client;
static uint8_t packet[FV_WEB_PACKET_BYTES_MAX];
static size_t bytes;
static bool text;
static int64_t now_ns;

static int begin(void **state)
{
    (void)state;
    memset(&store, 0, sizeof store);
    fv_web_store_begin(&store, "R");
    fv_web_client_init(&client, FV_WEB_OPERATE, true);
    now_ns = 1000 * MS;
    return 0;
}

static int end(void **state)
{
    (void)state;
    fv_web_store_free(&store);
    return 0;
}

/* The kind of the next packet: 0 text, -1 none. */
static int next(void)
{
    bytes = fv_web_client_next(&client, &store, packet, sizeof packet - 1, now_ns, &text);
    packet[bytes] = '\0';
    return bytes == 0 ? -1 : text ? 0 : packet[0];
}

static void drain(void)
{
    while (next() >= 0)
        continue;
}

static enum fv_web_said say(const char *words)
{
    struct fv_web_command command;
    return fv_web_client_hear(&client, words, strlen(words), now_ns, &command);
}

static void message(const char *channel, int32_t piece, const char *what)
{
    fv_web_store_message(&store, &(struct fv_web_kept){.channel = channel,
                                                       .piece = piece,
                                                       .data = (const uint8_t *)what,
                                                       .bytes = (uint32_t)strlen(what)});
    (void)fv_web_store_tick(&store, now_ns);
}

/* Another frame, of noise. */
static void frame(void)
{
    enum { WIDTH = 64, HEIGHT = 48 };
    struct fv_web_picture *picture = &store.picture;
    uint8_t *pixels = malloc(WIDTH * HEIGHT);
    assert_non_null(pixels);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        pixels[i] = (uint8_t)(i * 2654435761u >> 13);
    free((void *)(uintptr_t)picture->image.data);
    picture->image = (struct fovea_image){.data = pixels,
                                          .width = WIDTH,
                                          .height = HEIGHT,
                                          .stride_bytes = WIDTH,
                                          .format = FOVEA_PIXEL_GREY8,
                                          .size_bytes = WIDTH * HEIGHT};
    picture->number++;
    picture->taken_ns = now_ns;
}

static void a_page_gets_the_newest_of_each_message_once(void **state)
{
    (void)state;
    assert_int_equal(next(), 0);
    assert_non_null(strstr((char *)packet, "\"kind\":\"hello\""));
    drain();
    message("POSE", 0, "old");
    message("POSE", 0, "new");
    message("MAP", 0, "first");
    message("MAP", 1, "second");
    message("RUN", 0, "run");
    int poses = 0, maps = 0, runs = 0, order = 0, kind;
    while ((kind = next()) >= 0) {
        assert_int_equal(kind, 1);
        poses += strcmp((char *)packet + 2, "POSEnew") == 0;
        runs += strcmp((char *)packet + 2, "RUNrun") == 0;
        maps += strncmp((char *)packet + 2, "MAP", 3) == 0;
        order++;
        if (strncmp((char *)packet + 2, "MAP", 3) == 0) assert_true(order > 2); /* last */
    }
    assert_int_equal(poses, 1);
    assert_int_equal(maps, 2);
    assert_int_equal(runs, 1);
    fv_web_store_begin(&store, "S"); /* another run: nothing of the old one is sent */
    assert_int_equal(next(), 0);
    assert_non_null(strstr((char *)packet, "\"prefix\":\"S\""));
    message("POSE", 0, "other");
    drain();
    assert_string_equal((char *)store.rows[0].channel, "POSE");
    assert_int_equal(store.row_count, 1);
}

static void a_message_is_sent_no_more_often_than_it_may(void **state)
{
    int sent = 0;
    (void)state;
    drain();
    for (int i = 0; i < 1000; i++, now_ns += MS) {
        fv_web_store_message(&store, &(struct fv_web_kept){.channel = "POSE",
                                                           .data = (const uint8_t *)"x",
                                                           .bytes = 1,
                                                           .pause_ns = 100 * MS});
        (void)fv_web_store_tick(&store, now_ns);
        sent += next() == 1;
    }
    assert_in_range(sent, 9, 11);
}

static void what_is_for_operators_is_sent_to_no_other_page(void **state)
{
    (void)state;
    for (int operates = 0; operates < 2; operates++) {
        fv_web_client_init(&client, operates ? FV_WEB_OPERATE : FV_WEB_VIEW, false);
        drain();
        fv_web_store_message(&store, &(struct fv_web_kept){.channel = "PARAMETER_RESULT",
                                                           .data = (const uint8_t *)"x",
                                                           .bytes = 1,
                                                           .operators = true});
        (void)fv_web_store_tick(&store, now_ns);
        message("POSE", 0, "y");
        int parameters = 0, poses = 0;
        for (int kind = next(); kind >= 0; kind = next()) {
            parameters += kind == 1 && memcmp(packet + 2, "PARAMETER_RESULT", 16) == 0;
            poses += kind == 1 && memcmp(packet + 2, "POSE", 4) == 0;
        }
        assert_int_equal(parameters, operates);
        assert_int_equal(poses, 1);
    }
}

static void a_store_takes_no_more_than_its_room(void **state)
{
    (void)state;
    for (int32_t piece = 0; piece < 3 * FV_WEB_ROWS_MAX; piece++)
        message("MAP", piece, "x");
    assert_int_equal(store.row_count, FV_WEB_ROWS_MAX);
    const double position[3] = {1, 2, 3};
    for (int i = 0; i < 3 * FV_WEB_PATH_MAX; i++)
        fv_web_store_path_add(&store, position);
    for (int i = 0; i < 3 * FV_WEB_LOG_MAX; i++)
        fv_web_store_log(&store, 0, "line %d", i);
    int lines = 0, places = 0, kind;
    while ((kind = next()) >= 0) {
        lines += kind == 0 && strstr((char *)packet, "\"kind\":\"log\"") != NULL;
        if (kind == 3) places += packet[15] << 8 | packet[16];
    }
    assert_int_equal(lines, FV_WEB_LOG_MAX);
    assert_int_equal(places, FV_WEB_PATH_MAX);
}

static void the_path_follows_a_change_of_unit(void **state)
{
    const double position[3] = {1, 2, 3}, moved[3] = {10, 0, 0};
    const double turned[4] = {0.70710678118654752, 0, 0, 0.70710678118654752}; /* 90 degrees, z */
    (void)state;
    fv_web_store_path_add(&store, position);
    fv_web_store_path_change(&store, 2, moved, turned);
    assert_true(store.path[0].position[0] > 5.9999F && store.path[0].position[0] < 6.0001F);
    assert_true(store.path[0].position[1] > 1.9999F && store.path[0].position[1] < 2.0001F);
    assert_true(store.path[0].position[2] > 5.9999F && store.path[0].position[2] < 6.0001F);
}

static void two_pictures_are_on_their_way_at_most(void **state)
{
    char words[32];
    (void)state;
    drain();
    for (int i = 0; i < 5; i++) {
        frame();
        assert_int_equal(next(), i < 2 ? 2 : -1);
        assert_int_equal(next(), -1); /* once */
    }
    assert_int_equal(say("ack 1"), FV_WEB_SAID_NOTHING);
    assert_int_equal(next(), 2); /* the newest, number 5 */
    assert_int_equal(packet[7], 5);
    snprintf(words, sizeof words, "ack %u", UINT32_MAX);
    assert_int_equal(say(words), FV_WEB_SAID_NOTHING);
    assert_int_equal(client.unacked_count, 0);
    assert_int_equal(say("pictures 0"), FV_WEB_SAID_NOTHING);
    frame();
    assert_int_equal(next(), -1);
    assert_int_equal(say("pictures 1"), FV_WEB_SAID_NOTHING);
    assert_int_equal(next(), 2);
}

static void a_jpeg_is_made_once_for_all_pages(void **state)
{
    struct fv_web_client others[4];
    (void)state;
    for (int i = 0; i < 4; i++)
        fv_web_client_init(&others[i], FV_WEB_VIEW, true);
    frame();
    for (int i = 0; i < 4; i++)
        while (fv_web_client_next(&others[i], &store, packet, sizeof packet, now_ns, &text) > 0)
            continue;
    assert_int_equal(others[3].sent, 1);
    assert_int_equal(store.picture.made, 1);
}

/* Frames for a while, each picture acknowledged `way_ns` after it was sent. Returns pictures. */
static int play(int frames, int64_t way_ns)
{
    int pictures = 0;
    for (int i = 0; i < frames; i++, now_ns += 66 * MS) {
        char words[32];
        while (client.unacked_count > 0 && now_ns - client.unacked[0].sent_ns >= way_ns) {
            snprintf(words, sizeof words, "ack %u", client.unacked[0].number);
            assert_int_equal(say(words), FV_WEB_SAID_NOTHING);
        }
        frame();
        for (int kind; (kind = next()) >= 0;)
            pictures += kind == 2;
    }
    return pictures;
}

/* 6,000 frames over a fast link bring the client to this class. The time that a JPEG takes by the
 * clock counts, too, and other programs lengthen it: the same frames are tried again, from the same
 * state. */
static void play_to(int picture_class)
{
    const struct fv_web_client before = client;
    const int64_t before_ns = now_ns;
    (void)play(6000, 20 * MS);
    for (int tries = 1; client.picture_class != picture_class && tries < 20; tries++) {
        client = before;
        now_ns = before_ns;
        (void)play(6000, 20 * MS);
    }
    assert_int_equal(client.picture_class, picture_class);
}

static void size_and_quality_fall_before_the_rate_and_come_back(void **state)
{
    (void)state;
    assert_true(play(60, 20 * MS) >= 59);
    assert_int_equal(client.picture_class, 0);
    (void)play(300, 700 * MS); /* the link takes 700 ms for two pictures */
    assert_int_equal(client.picture_class, FV_WEB_CLASSES - 1);
    play_to(0);
}

static void a_long_way_alone_changes_no_class(void **state)
{
    (void)state;
    (void)play(300, 190 * MS); /* each, from the first: a far page, not a slow link */
    assert_int_equal(client.picture_class, 0);
}

/* The way is short as long as pictures are small; a larger one would hold up messages. */
static void no_class_is_tried_that_the_link_cannot_carry(void **state)
{
    size_t small, larger;
    (void)state;
    (void)play(60, 20 * MS);
    (void)play(300, 700 * MS);
    assert_int_equal(client.picture_class, FV_WEB_CLASSES - 1);
    (void)fv_web_picture_jpeg(&store.picture, FV_WEB_CLASSES - 2, &small);
    (void)fv_web_picture_jpeg(&store.picture, FV_WEB_CLASSES - 3, &larger);
    assert_true(larger > small);
    client.bytes_per_s = (small + larger) / 2 * 20; /* 50 ms for something between */
    play_to(FV_WEB_CLASSES - 2);
    client.bytes_per_s = 0;
    play_to(0);
}

static void replies_wait_in_their_order(void **state)
{
    (void)state;
    drain();
    for (int i = 0; i < FV_WEB_REPLIES + 1; i++)
        fv_web_client_reply(&client, "{\"number\":%d}", i);
    for (int i = 1; i < FV_WEB_REPLIES + 1; i++) { /* the oldest gave way */
        char expected[32];
        snprintf(expected, sizeof expected, "{\"number\":%d}", i);
        assert_int_equal(next(), 0);
        assert_string_equal((char *)packet, expected);
    }
    assert_int_not_equal(next(), 0);
}

static void what_a_page_cannot_say_is_refused(void **state)
{
    const char *const wrong[] = {"",
                                 "ack",
                                 "ack x",
                                 "ack -1",
                                 "ack 1x",
                                 "nothing 1",
                                 "command",
                                 "command 1",
                                 "command x save",
                                 "command 1 fly",
                                 "ack 99999999999",
                                 "pictures",
                                 "parameter 1",
                                 "parameter 1 once",
                                 "parameter 1 ever features.threshold 3"};
    char longest[FV_WEB_WORDS_BYTES + 2];
    struct fv_web_command command;
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        if (say(wrong[i]) != FV_WEB_SAID_WRONG) fail_msg("%s", wrong[i]);
    memset(longest, 'a', sizeof longest);
    assert_int_equal(fv_web_client_hear(&client, longest, sizeof longest, now_ns, &command),
                     FV_WEB_SAID_WRONG);
    assert_int_equal(fv_web_client_hear(&client, "ack\0001", 5, now_ns, &command),
                     FV_WEB_SAID_WRONG);
    assert_int_equal(fv_web_client_hear(&client, "command 7 save overwrite", 24, now_ns, &command),
                     FV_WEB_SAID_COMMAND);
    assert_int_equal(command.request, 7);
    assert_int_equal(command.bits, 24);
    const char parameter[] = "parameter 8 keep image.operations [denoise, gamma]";
    assert_int_equal(fv_web_client_hear(&client, parameter, sizeof parameter - 1, now_ns, &command),
                     FV_WEB_SAID_COMMAND);
    assert_true(command.bits == 0 && !command.loads && command.keep && command.request == 8);
    assert_string_equal(command.key, "image.operations");
    assert_string_equal(command.value, "[denoise, gamma]");
    assert_int_equal(fv_web_client_hear(&client, "parameter 9 once seed", 21, now_ns, &command),
                     FV_WEB_SAID_COMMAND);
    assert_true(!command.keep);
    assert_string_equal(command.value, "");
    assert_int_equal(fv_web_client_hear(&client, "map 3 hall 2.map", 16, now_ns, &command),
                     FV_WEB_SAID_COMMAND);
    assert_true(command.loads && command.bits == 0 && command.request == 3);
    assert_string_equal(command.key, "hall 2.map");
    assert_int_equal(fv_web_client_hear(&client, "map 4", 5, now_ns, &command),
                     FV_WEB_SAID_COMMAND);
    assert_true(command.loads);
    assert_string_equal(command.key, "");
    assert_int_equal(fv_web_client_hear(&client, "robot 2", 7, now_ns, &command),
                     FV_WEB_SAID_ROBOT);
    assert_int_equal(command.request, 2);
    assert_int_equal(say("camera 1"), FV_WEB_SAID_NOTHING);
    assert_int_equal(client.camera, 1);
    assert_int_equal(say("camera 4"), FV_WEB_SAID_NOTHING);
    assert_int_equal(client.camera, 0);
    drain();
    assert_int_equal(say("ping \"}<x\\"), FV_WEB_SAID_NOTHING);
    drain();
    assert_int_equal(say("ping a\"b"), FV_WEB_SAID_NOTHING);
    assert_int_equal(next(), 0);
    assert_non_null(strstr((char *)packet, "\"echo\":\"a?b\"")); /* it stays JSON */
}

/* Of another robot a page gets all that it was not sent yet, and pictures of the first camera. */
static void another_robot_is_shown_from_its_beginning(void **state)
{
    (void)state;
    message("POSE", 0, "abc");
    drain();
    say("camera 1");
    drain();
    assert_true(next() < 0);
    fv_web_client_show(&client, 1, false);
    assert_int_equal(client.camera, 0);
    assert_int_equal(next(), 0);
    assert_non_null(strstr((char *)packet, "\"kind\":\"hello\""));
    assert_non_null(strstr((char *)packet, "\"commands\":false"));
    assert_non_null(strstr((char *)packet, "\"robot\":1"));
    int kind;
    do /* the log, and then the message again */
        kind = next();
    while (kind == 0);
    assert_int_equal(kind, 1);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)
    const struct CMUnitTest tests[] = {
        TEST(a_page_gets_the_newest_of_each_message_once),
        TEST(a_message_is_sent_no_more_often_than_it_may),
        TEST(what_is_for_operators_is_sent_to_no_other_page),
        TEST(a_store_takes_no_more_than_its_room),
        TEST(the_path_follows_a_change_of_unit),
        TEST(two_pictures_are_on_their_way_at_most),
        TEST(a_jpeg_is_made_once_for_all_pages),
        TEST(size_and_quality_fall_before_the_rate_and_come_back),
        TEST(a_long_way_alone_changes_no_class),
        TEST(no_class_is_tried_that_the_link_cannot_carry),
        TEST(replies_wait_in_their_order),
        TEST(what_a_page_cannot_say_is_refused),
        TEST(another_robot_is_shown_from_its_beginning),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
