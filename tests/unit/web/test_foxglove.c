/* What a client of Foxglove's protocol is shown: views field by field, the newest of each channel
 * that it wants; and that no message of a stranger does harm. Without packages. */
#include <math.h>

#include "common/foxglove_case.h"

#include "fovea_detections_t.h"
#include "fovea_grid_t.h"
#include "fovea_map_t.h"

/* ---- our messages ---------------------------------------------------------------------------- */

static void take_grid(int64_t time_ns, int32_t first, int32_t count, int8_t value)
{
    static char frame[] = "odom";
    int8_t cells[64];
    memset(cells, value, sizeof cells);
    const fovea_grid_t grid = {.stamp = {.time_ns = time_ns},
                               .map_id = 4,
                               .frame = frame,
                               .resolution_m = 0.25,
                               .width = 5,
                               .height = 4,
                               .origin_position = {1, 0, 0},
                               .origin_orientation = {1, 0, 0, 0},
                               .first_row = first,
                               .row_count = count,
                               .cell_count = 5 * count,
                               .cells = cells};
    length = fovea_grid_t_encode(encoded, 0, sizeof encoded, &grid);
    assert_true(length > 0);
    fv_foxglove_views_take(&views, "GRID", encoded, (size_t)length);
}

/* Landmarks in these slots, of a piece that lists slots from first to last. */
static void take_map(int32_t first, int32_t last, int32_t count, int32_t *slots)
{
    int32_t maps[8];
    float places[8][3], *rows[8];
    for (int i = 0; i < count; i++) {
        maps[i] = slots[i] % 10 == 9 ? 3 : 4;
        for (int k = 0; k < 3; k++)
            places[i][k] = (float)(slots[i] + k);
        rows[i] = places[i];
    }
    const fovea_map_t map = {.stamp = {.time_ns = SECOND},
                             .map_id = 4,
                             .own_scale = 2,
                             .own_position = {1, 1, 1},
                             .own_orientation = {1, 0, 0, 0},
                             .landmark_slots = 1000,
                             .landmark_first = first,
                             .landmark_last = last,
                             .landmark_count = count,
                             .landmark_slot = slots,
                             .landmark_map = maps,
                             .landmark_p = rows};
    length = fovea_map_t_encode(encoded, 0, sizeof encoded, &map);
    assert_true(length > 0);
    fv_foxglove_views_take(&views, "MAP", encoded, (size_t)length);
}

/* ---- a reader of Protocol Buffers ------------------------------------------------------------ */

struct piece {
    const uint8_t *at;
    size_t bytes;
};

static uint64_t varint(struct piece *from)
{
    uint64_t value = 0;
    for (int shift = 0;; shift += 7) {
        assert_true(from->bytes > 0 && shift < 70);
        value |= (uint64_t)(*from->at & 0x7f) << shift;
        from->bytes--;
        if ((*from->at++ & 0x80) == 0) return value;
    }
}

/* The n-th field of this number: its bytes, those of a number as little-endian. */
static struct piece field(struct piece from, uint32_t number, int n)
{
    static uint8_t made[8][8];
    static int turn;
    while (from.bytes > 0) {
        const uint64_t tag = varint(&from);
        struct piece value = {from.at, (tag & 7) == 1 ? 8 : 4};
        if ((tag & 7) == 0) {
            const uint64_t found = varint(&from);
            turn = (turn + 1) % 8;
            memcpy(made[turn], &found, 8);
            value = (struct piece){made[turn], 8};
        } else {
            if ((tag & 7) == 2) value.bytes = (size_t)varint(&from);
            value.at = from.at;
            assert_true(value.bytes <= from.bytes);
            from.at += value.bytes;
            from.bytes -= value.bytes;
        }
        if (tag >> 3 == number && n-- == 0) return value;
    }
    return (struct piece){NULL, 0};
}

static double double_of(struct piece from, uint32_t number)
{
    double value = 0;
    const struct piece found = field(from, number, 0);
    if (found.at != NULL) memcpy(&value, found.at, sizeof value);
    return value;
}

static uint64_t number_of(struct piece from, uint32_t number)
{
    uint64_t value = 0;
    const struct piece found = field(from, number, 0);
    if (found.at != NULL) memcpy(&value, found.at, found.bytes);
    return value;
}

static int64_t time_of(struct piece from)
{
    return (int64_t)number_of(from, 1) * SECOND + (int64_t)number_of(from, 2);
}

static void assert_text(struct piece found, const char *expected)
{
    assert_int_equal(found.bytes, strlen(expected));
    assert_memory_equal(found.at, expected, found.bytes);
}

static struct piece payload(void)
{
    return (struct piece){packet + 13, bytes - 13};
}

/* ---- tests ----------------------------------------------------------------------------------- */

static void a_pose_is_shown_in_the_map(void **state)
{
    const fovea_pose_t pose = pose_of(3 * SECOND);
    (void)state;
    take_pose(&pose);
    subscribe("/R/pose", 7);
    assert_true(data_of(7));
    uint64_t stamp;
    memcpy(&stamp, packet + 5, 8);
    assert_int_equal(stamp, 3 * SECOND + 77);
    assert_int_equal(time_of(field(payload(), 1, 0)), 3 * SECOND + 77);
    assert_text(field(payload(), 2, 0), "map");
    const struct piece at = field(payload(), 3, 0), position = field(at, 1, 0);
    /* 2 R p + t, R a turn by 120 degrees about z */
    const double c = -0.5, s = 0.86602540378443864676;
    assert_true(fabs(double_of(position, 1) - (10 + 2 * (c * 1 - s * 2))) < 1e-12);
    assert_true(fabs(double_of(position, 2) - (20 + 2 * (s * 1 + c * 2))) < 1e-12);
    assert_true(fabs(double_of(position, 3) - 36) < 1e-12);
    assert_true(double_of(field(at, 2, 0), 4) == 0.5); /* w is the last */
    assert_true(double_of(field(at, 2, 0), 1) == 0);
    subscribe("/R/transforms", 8);
    assert_true(data_of(8));
    assert_text(field(field(payload(), 1, 0), 3, 0), "body");
    subscribe("/R/transforms", 9); /* refused: there is one */
    until("subscribed already");
    assert_non_null(strstr((char *)packet, "\"level\":1,"));
    assert_false(data_of(9));
    fovea_pose_t unknown = pose_of(4 * SECOND);
    unknown.position[1] = NAN;
    take_pose(&unknown);
    assert_false(data_of(7));
}

static void a_grid_is_shown_when_all_its_rows_are_there(void **state)
{
    const fovea_pose_t pose = pose_of(SECOND);
    (void)state;
    take_grid(SECOND, 0, 4, 1); /* before there is a pose */
    take_pose(&pose);
    take_grid(SECOND, 0, 3, 11);
    take_grid(2 * SECOND, 3, 1, 12); /* of another one */
    take_grid(SECOND, 2, 2, 12);     /* twice the third row */
    for (uint32_t i = 0; i < views.channel_count; i++)
        assert_string_not_equal(views.channels[i].topic, "/R/grid");
    take_grid(SECOND, 3, 1, -1);
    subscribe("/R/grid", 3);
    assert_true(data_of(3));
    const struct piece cells = field(payload(), 9, 0), size = field(payload(), 5, 0);
    assert_int_equal(cells.bytes, 20);
    assert_int_equal((int8_t)cells.at[14], 11);
    assert_int_equal((int8_t)cells.at[15], -1);
    assert_int_equal(number_of(payload(), 4), 5);
    assert_true(double_of(size, 1) == 0.5 && double_of(size, 2) == 0.5); /* in the map's unit */
    const struct piece origin = field(field(payload(), 3, 0), 1, 0);
    assert_true(fabs(double_of(origin, 1) - 9) < 1e-12); /* 10 + 2 cos 120 */
    assert_text(field(field(payload(), 8, 0), 1, 0), "occupancy");
    fovea_pose_t later = pose_of(2 * SECOND); /* does not move what was seen before it */
    take_grid(2 * SECOND, 0, 4, 1);
    later.map_position[0] = 50;
    take_pose(&later);
    assert_true(data_of(3));
    const struct piece same = field(field(payload(), 3, 0), 1, 0);
    assert_true(fabs(double_of(same, 1) - 9) < 1e-12);
}

/* Foxglove's pixels begin at the corner of the image, ours at the centre of its first pixel. */
static void a_turned_box_is_half_a_pixel_further(void **state)
{
    static char name[] = "pallet";
    fovea_detection_t one = {
        .class_name = name, .box = {10, 20, 30, 60}, .angle = 1.57079632F /* a quarter turn */};
    const fovea_detections_t all = {
        .model = name, .stamp = {.time_ns = SECOND}, .count = 1, .detections = &one};
    (void)state;
    length = fovea_detections_t_encode(encoded, 0, sizeof encoded, &all);
    assert_true(length > 0);
    fv_foxglove_views_take(&views, "DETECTIONS", encoded, (size_t)length);
    subscribe("/R/cam0/detections", 5);
    assert_true(data_of(5));
    const struct piece outline = field(payload(), 2, 0), first = field(outline, 3, 0);
    assert_true(fabs(double_of(first, 1) - 40.5) < 1e-5);
    assert_true(fabs(double_of(first, 2) - 30.5) < 1e-5);
    const struct piece label = field(payload(), 3, 0);
    assert_true(double_of(field(label, 2, 0), 1) == double_of(first, 1));
    assert_text(field(label, 3, 0), "pallet 0.00");
}

static void the_map_is_all_landmarks_so_far(void **state)
{
    (void)state;
    take_map(0, 10, 3, (int32_t[]){1, 2, 9}); /* 9 is of another map */
    take_map(10, 20, 1, (int32_t[]){15});
    subscribe("/R/map", 1);
    assert_true(data_of(1));
    assert_int_equal(field(payload(), 6, 0).bytes, 3 * 12);
    float x;
    memcpy(&x, field(payload(), 6, 0).at + 24, 4);
    assert_true(x == 2 * 15 + 1);                /* own_scale p + own_position */
    take_map(0, 10, 1, (int32_t[]){2});          /* 1 is gone */
    take_map(90, 100, 2, (int32_t[]){-3, 1000}); /* no slots */
    assert_true(data_of(1));
    assert_int_equal(field(payload(), 6, 0).bytes, 2 * 12);
    assert_false(data_of(1));
}

static void the_log_says_changes_alone(void **state)
{
    fovea_pose_t pose = pose_of(SECOND);
    (void)state;
    take_pose(&pose);
    take_pose(&pose);
    pose.state = FOVEA_POSE_T_STATE_LOST;
    take_pose(&pose);
    subscribe("/R/log", 2);
    assert_true(data_of(2));
    assert_text(field(payload(), 3, 0), "pose: tracking");
    assert_int_equal(number_of(payload(), 2), 2);
    assert_true(data_of(2));
    assert_text(field(payload(), 3, 0), "pose: lost");
    assert_text(field(payload(), 4, 0), "pose");
    assert_int_equal(number_of(payload(), 2), 3);
    assert_false(data_of(2));
    for (int i = 0; i < 1000; i++) { /* the last ones are kept */
        pose.state = i % 2 == 0 ? FOVEA_POSE_T_STATE_TRACKING : FOVEA_POSE_T_STATE_LOST;
        take_pose(&pose);
    }
    int lines = 0;
    while (data_of(2))
        lines++;
    assert_int_equal(lines, FV_FOXGLOVE_LOG_MAX);
}

/* What comes does not follow on what came, as after a seek: as many lines as were sent before. */
static void the_log_begins_again(void **state)
{
    fovea_pose_t pose = pose_of(SECOND);
    (void)state;
    take_pose(&pose);
    subscribe("/R/log", 2);
    assert_true(data_of(2));
    assert_text(field(payload(), 3, 0), "pose: tracking");
    fv_foxglove_views_begin(&views, "R");
    pose.state = FOVEA_POSE_T_STATE_LOST;
    take_pose(&pose);
    assert_true(data_of(2));
    assert_text(field(payload(), 3, 0), "pose: lost");
    assert_false(data_of(2));
    say("{\"op\":\"unsubscribe\",\"subscriptionIds\":[2]}");
    subscribe("/R/log", 3); /* lines of this run alone */
    assert_true(data_of(3));
    assert_text(field(payload(), 3, 0), "pose: lost");
    assert_false(data_of(3));
}

static void who_is_slow_gets_the_newest(void **state)
{
    (void)state;
    for (int i = 1; i <= 3; i++) {
        const fovea_pose_t pose = pose_of(i * SECOND);
        take_pose(&pose);
    }
    subscribe("/R/pose", 7);
    assert_true(data_of(7));
    assert_int_equal(time_of(field(payload(), 1, 0)), 3 * SECOND + 77);
    assert_false(data_of(7));
    say("{\"op\":\"unsubscribe\",\"subscriptionIds\":[7]}");
    const fovea_pose_t pose = pose_of(9 * SECOND);
    take_pose(&pose);
    assert_false(data_of(7));
    assert_int_equal(client.time_ns, 9 * SECOND + 77); /* time goes on */
}

static void none_keeps_the_others_waiting(void **state)
{
    bool seen[9] = {false};
    (void)state;
    take_map(0, 10, 1, (int32_t[]){1});
    subscribe("/R/map", 1);
    const fovea_pose_t first = pose_of(SECOND);
    take_pose(&first);
    subscribe("/R/pose", 7);
    for (int i = 2; i < 100; i++) { /* there is a new pose and a new map whenever it can be sent */
        const fovea_pose_t pose = pose_of(i * SECOND);
        take_pose(&pose);
        take_map(0, 10, 1, (int32_t[]){1});
        while (next() && packet[0] != 1)
            continue; /* the time */
        seen[packet[1]] = true;
    }
    assert_true(seen[1] && seen[7]);
}

/* All of a map is shown when a part of it comes: small messages, and a large view. */
static void a_large_view_leaves_the_link_to_poses(void **state)
{
    enum { LINK = 50000 /* bytes per second */ };
    uint64_t of_map = 0, all = 0;
    const fovea_pose_t first = pose_of(SECOND);
    (void)state;
    take_pose(&first);
    for (int32_t at = 0; at < 1000; at += 8) {
        int32_t slots[8];
        for (int32_t i = 0; i < 8; i++)
            slots[i] = at + i;
        take_map(at, at + 8, 8, slots);
    }
    subscribe("/R/map", 1);
    assert_true(data_of(1));
    assert_true(bytes > 10000);
    subscribe("/R/pose", 7);
    client.bytes_per_s = LINK;
    for (int i = 2; i < 10000; i++) { /* there is a new part whenever something can be sent */
        const fovea_pose_t pose = pose_of(i * SECOND);
        take_pose(&pose);
        take_map(0, 10, 1, (int32_t[]){1});
        while (next() && packet[0] != 1)
            continue; /* the time */
        now_ns += (int64_t)(bytes * SECOND / LINK);
        all += bytes;
        if (packet[1] == 1) of_map += bytes;
    }
    assert_true(of_map > all / 4 && of_map < 2 * all / 5);
}

/* A frame, of noise; `wide`: wider than pages get. */
static void frame(int32_t width)
{
    enum { HEIGHT = 48 };
    uint8_t *pixels = malloc((size_t)width * HEIGHT);
    assert_non_null(pixels);
    for (int32_t i = 0; i < width * HEIGHT; i++)
        pixels[i] = (uint8_t)((uint32_t)i * 2654435761U >> 13);
    free((void *)(uintptr_t)store.picture.image.data);
    store.picture.image = (struct fovea_image){.data = pixels,
                                               .width = width,
                                               .height = HEIGHT,
                                               .stride_bytes = width,
                                               .format = FOVEA_PIXEL_GREY8,
                                               .size_bytes = (size_t)width * HEIGHT};
    store.picture.number++;
    store.picture.stamp_ns = now_ns;
    fv_foxglove_views_picture(&views, now_ns);
}

static void pictures_fall_in_quality_and_keep_their_size(void **state)
{
    (void)state;
    subscribe("/R/cam0/image", 4);
    assert_int_equal(fv_foxglove_watches(&client, &views), 1);
    const int32_t widths[] = {64, 1600};
    for (int w = 0; w < 2; w++) {
        frame(widths[w]);
        assert_true(data_of(4));
        assert_false(data_of(4));
        const struct piece jpeg = field(payload(), 2, 0);
        assert_text(field(payload(), 3, 0), "jpeg");
        assert_text(field(payload(), 4, 0), "cam0");
        const uint8_t *at = jpeg.at;
        while (!(at[0] == 0xff && at[1] == 0xc0))
            at++;
        assert_int_equal(at[7] << 8 | at[8], widths[w]);
    }
    const uint64_t made = store.picture.made;
    assert_int_equal(client.quality, 0);
    for (int i = 0; i < 3; i++) { /* of two frames each, the client has time for one */
        frame(64);
        frame(64);
        now_ns += SECOND;
        assert_true(data_of(4));
    }
    assert_int_equal(client.quality, 2);
    assert_int_equal(store.picture.made, made + 3);
    for (int i = 0; i < 200; i++) {
        frame(64);
        now_ns += SECOND;
        assert_true(data_of(4));
    }
    assert_int_equal(client.quality, 0);
}

/* Of the message with its stamp, even where the clock was set since. */
static void a_picture_has_the_time_of_its_stamp_in_utc(void **state)
{
    fovea_pose_t pose = pose_of(SECOND);
    (void)state;
    take_pose(&pose);
    assert_int_equal(fv_foxglove_views_time(&views, SECOND), SECOND + 77);
    pose.stamp.time_ns = 2 * SECOND;
    pose.stamp.utc_offset_ns = 99;
    take_pose(&pose);
    assert_int_equal(fv_foxglove_views_time(&views, SECOND), SECOND + 77);
    assert_int_equal(fv_foxglove_views_time(&views, 2 * SECOND), 2 * SECOND + 99);
    assert_int_equal(fv_foxglove_views_time(&views, 3 * SECOND), 3 * SECOND + 99);
}

static void each_camera_has_its_pictures(void **state)
{
    (void)state;
    frame(64);
    drain();
    store.cameras = 2;
    drain();
    assert_int_equal(fv_foxglove_watches(&client, &views), 0);
    subscribe("/R/cam1/image", 6);
    assert_int_equal(fv_foxglove_watches(&client, &views), 2);
    assert_false(data_of(6));
    uint8_t *pixels = calloc(32, 16);
    const struct fovea_image image = {.data = pixels,
                                      .width = 32,
                                      .height = 16,
                                      .stride_bytes = 32,
                                      .format = FOVEA_PIXEL_GREY8,
                                      .size_bytes = 32 * 16};
    assert_non_null(pixels);
    fv_web_picture_take(fv_web_store_picture(&store, 1), &image, now_ns, 1, -1);
    assert_true(data_of(6));
    assert_text(field(payload(), 4, 0), "cam1");
    assert_int_equal(time_of(field(payload(), 1, 0)), now_ns);
    assert_false(data_of(6));
}

static void channels_of_another_robot_are_others(void **state)
{
    const fovea_pose_t pose = pose_of(SECOND);
    (void)state;
    assert_true(next());
    assert_non_null(strstr((char *)packet, "\"op\":\"serverInfo\""));
    assert_non_null(strstr((char *)packet, "\"sessionId\":\"5\""));
    take_pose(&pose);
    subscribe("/R/pose", 7);
    const uint32_t before = views.first_id, count = views.channel_count;
    fv_foxglove_views_begin(&views, "R"); /* the same robot: they stay */
    take_pose(&pose);
    assert_true(data_of(7));
    fv_foxglove_views_begin(&views, "S\"");
    until("\"op\":\"unadvertise\"");
    assert_int_equal(views.first_id, before + count);
    until("\"topic\":\"/S?/cam0/image\"");
    take_pose(&pose);
    assert_false(data_of(7));
}

/* Whatever a recording or a network holds. */
static void damaged_messages_do_no_harm(void **state)
{
    static const char *const channels[] = {"POSE", "MAP", "GRID", "CAMERA_POSE"};
    static uint8_t whole[4][1 << 12];
    size_t lengths[4];
    const fovea_pose_t pose = pose_of(SECOND);
    (void)state;
    take_pose(&pose);
    lengths[0] = lengths[3] = (size_t)length;
    memcpy(whole[0], encoded, lengths[0]);
    memcpy(whole[3], encoded, lengths[0]);
    take_map(0, 10, 3, (int32_t[]){1, 2, 9});
    lengths[1] = (size_t)length;
    memcpy(whole[1], encoded, lengths[1]);
    take_grid(SECOND, 0, 4, 1);
    lengths[2] = (size_t)length;
    memcpy(whole[2], encoded, lengths[2]);
    for (int n = 0; n < 2000; n++) {
        const int of = n % 4;
        uint8_t *damaged = malloc(lengths[of]);
        assert_non_null(damaged);
        memcpy(damaged, whole[of], lengths[of]);
        for (int i = 0; i < 3; i++) /* behind the type, or nothing would be decoded */
            damaged[8 + below(lengths[of] - 8)] = (uint8_t)below(256);
        fv_foxglove_views_take(&views, channels[of], damaged, lengths[of]);
        free(damaged);
        for (uint32_t i = 0; i < views.view_count; i++)
            (void)fv_foxglove_views_made(&views, i, &bytes);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_pose_is_shown_in_the_map, begin, end),
        cmocka_unit_test_setup_teardown(a_grid_is_shown_when_all_its_rows_are_there, begin, end),
        cmocka_unit_test_setup_teardown(a_turned_box_is_half_a_pixel_further, begin, end),
        cmocka_unit_test_setup_teardown(the_map_is_all_landmarks_so_far, begin, end),
        cmocka_unit_test_setup_teardown(the_log_says_changes_alone, begin, end),
        cmocka_unit_test_setup_teardown(the_log_begins_again, begin, end),
        cmocka_unit_test_setup_teardown(who_is_slow_gets_the_newest, begin, end),
        cmocka_unit_test_setup_teardown(none_keeps_the_others_waiting, begin, end),
        cmocka_unit_test_setup_teardown(a_large_view_leaves_the_link_to_poses, begin, end),
        cmocka_unit_test_setup_teardown(pictures_fall_in_quality_and_keep_their_size, begin, end),
        cmocka_unit_test_setup_teardown(a_picture_has_the_time_of_its_stamp_in_utc, begin, end),
        cmocka_unit_test_setup_teardown(each_camera_has_its_pictures, begin, end),
        cmocka_unit_test_setup_teardown(channels_of_another_robot_are_others, begin, end),
        cmocka_unit_test_setup_teardown(damaged_messages_do_no_harm, begin, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
