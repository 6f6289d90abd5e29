/* One client of Foxglove's protocol, and what it is shown of a robot with prefix R: for tests of
 * web/foxglove*.c, without sockets and without time. */
#ifndef FOVEA_TESTS_FOXGLOVE_CASE_H
#define FOVEA_TESTS_FOXGLOVE_CASE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/elementary.h"
#include "web/foxglove.h"

#include "fovea_pose_t.h"

#define SECOND INT64_C(1000000000)

enum { PACKET = 700000 };

static struct fv_web_store store;
static struct fv_foxglove_views views;
static struct fv_foxglove_parameters parameters;
static struct fv_foxglove_shown shown = {&store, &views, &parameters};
static struct fv_foxglove_client client;
static struct fv_foxglove_said said;
static uint8_t packet[PACKET], encoded[1 << 16];
static size_t bytes;
static int length; /* of the last message that was encoded */
static bool text;
static int64_t now_ns;

static struct fv_random random_state;

static inline uint32_t below(size_t bound)
{
    return fv_random_below(&random_state, (uint32_t)bound);
}

static inline int begin(void **state)
{
    (void)state;
    memset(&store, 0, sizeof store);
    memset(&parameters, 0, sizeof parameters);
    fv_message_prepare();
    fv_random_seed(&random_state, 12345);
    fv_foxglove_views_init(&views);
    fv_foxglove_views_begin(&views, "R");
    fv_foxglove_init(&client, FV_WEB_OPERATE, true, 5, 0);
    now_ns = 1000 * SECOND;
    return 0;
}

static inline int end(void **state)
{
    (void)state;
    fv_web_store_free(&store);
    fv_foxglove_views_free(&views);
    fv_foxglove_parameters_free(&parameters);
    return 0;
}

static inline fovea_pose_t pose_of(int64_t time_ns)
{
    static char parent[] = "odom", child[] = "body";
    return (fovea_pose_t){.stamp = {.time_ns = time_ns, .utc_offset_ns = 77},
                          .state = FOVEA_POSE_T_STATE_TRACKING,
                          .map_id = 4,
                          .parent_frame = parent,
                          .child_frame = child,
                          .position = {1, 2, 3},
                          .orientation = {1, 0, 0, 0},
                          .map_scale = 2,
                          .map_position = {10, 20, 30},
                          /* a quarter turn about z */
                          .map_orientation = {0.5, 0, 0, 0.5 * 1.7320508075688772}};
}

static inline void take_pose(const fovea_pose_t *pose)
{
    length = fovea_pose_t_encode(encoded, 0, sizeof encoded, pose);
    assert_true(length > 0);
    fv_foxglove_views_take(&views, "POSE", encoded, (size_t)length);
}

/* ---- what is sent ---------------------------------------------------------------------------- */

static inline bool next(void)
{
    bytes = fv_foxglove_next(&client, &shown, packet, sizeof packet - 1, now_ns, &text);
    packet[bytes] = '\0';
    return bytes > 0;
}

/* The next text with these words. */
static inline void until(const char *words)
{
    while (next())
        if (text && strstr((char *)packet, words) != NULL) return;
    fail_msg("no text with %s", words);
}

static inline void drain(void)
{
    while (next())
        continue;
}

static inline void say(const char *words)
{
    fv_foxglove_hear((const uint8_t *)words, strlen(words), false, &said);
    fv_foxglove_do(&client, &shown, &said, NULL, now_ns);
}

static inline uint32_t channel_of(const char *topic)
{
    for (uint32_t i = 0; i < views.channel_count; i++)
        if (strcmp(views.channels[i].topic, topic) == 0) return views.first_id + i;
    fail_msg("no channel %s", topic);
    return 0;
}

static inline void subscribe(const char *topic, uint32_t id)
{
    char words[120];
    drain(); /* only what was advertised can be */
    snprintf(words, sizeof words,
             "{\"op\":\"subscribe\",\"subscriptions\":[{\"id\":%u,\"channelId\":%u}]}", id,
             channel_of(topic));
    say(words);
}

/* The next message of a subscription; false: there is none now. */
static inline bool data_of(uint32_t id)
{
    while (next())
        if (!text && packet[0] == 1 && packet[1] == id) return true;
    return false;
}

#endif
