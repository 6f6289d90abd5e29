/* LCM in a network of the test's own: the missing route is found and mended, sending makes no heap
 * call, commands come in and hostile ones do not. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>
#include <lcm/lcm.h>

#include "app/run/heap.h"
#include "app/network/transport.h"
#include "common/build_folder.h"
#include "common/own_network.h"
#include "common/patience.h"
#include "drivers/clock.h"

#include "bot_core_pose_t.h"
#include "fovea_command_t.h"

#define URL "udpm://239.255.76.67:7667"
#define PREFIX                                                                                     \
    "T.\xc3\xa4" /* a mark and a letter beyond ASCII, as channels of other programs may have */

static bool own_network;

static void sleep_ms(long ms)
{
    struct timespec pause = {.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000};
    nanosleep(&pause, NULL);
}

/* Run the very command that users are shown. */
static void mend_as_shown(void)
{
    static const char line[] = FV_TRANSPORT_MEND, sudo[] = "sudo ";
    char command[2 * sizeof line] = "set -e; ";
    size_t used = strlen(command);
    for (const char *at = line; *at != '\0';) {
        if (strncmp(at, sudo, sizeof sudo - 1) == 0) /* root already */
            at += sizeof sudo - 1;
        else
            command[used++] = *at++;
    }
    if (system(command) != 0) fail_msg("%s: failed", command);
}

static void send_on(lcm_t *lcm, const char *channel, int32_t bits)
{
    uint8_t data[64];
    fovea_command_t command = {.utime = 1, .commands = bits};
    int bytes = fovea_command_t_encode(data, 0, sizeof data, &command);
    assert_int_equal(lcm_publish(lcm, channel, data, (unsigned)bytes), 0);
}

static void send_command(lcm_t *lcm, int32_t bits)
{
    send_on(lcm, PREFIX "_COMMAND", bits);
}

/* What has come, merged as no loop would: every bit. Refused ones that are to be answered give
 * none.
 */
static uint32_t commands_of(struct fv_transport *transport)
{
    struct fv_judged_command command;
    uint32_t bits = 0;
    while (fv_transport_command(transport, &command))
        bits |= command.bits;
    return bits;
}

/* A transport that opens where there is no route counts what it cannot send. */
static struct fv_transport *open_without_route(const struct fovea_outputs *outputs)
{
    struct fv_transport *transport = NULL;
    struct fovea_error error;
    struct fv_transport_sent sent = {0};
    const struct fv_transport_ears ears = {.listen = "loopback", .prefix = PREFIX};
    if (fv_transport_open_early(URL, 0, &transport, &error) != FOVEA_OK ||
        fv_transport_listen(transport, &ears, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    fv_transport_publish(transport, outputs);
    int64_t end_ns = 0;
    while (sent.channels[0].dropped[FV_TRANSPORT_DROP_ROUTE] == 0 && fv_test_patient(&end_ns, 10))
        fv_transport_sent(transport, &sent);
    assert_int_equal(sent.channels[0].dropped[FV_TRANSPORT_DROP_ROUTE], 1);
    assert_int_equal(sent.channels[0].sent, 0);
    return transport;
}

/* The route has come meanwhile: it sends and hears. */
static void expect_sent_and_heard(struct fv_transport *transport,
                                  const struct fovea_outputs *outputs)
{
    struct fv_transport_counts counts = {0};
    fv_transport_publish(transport, outputs);
    lcm_t *lcm = lcm_create(URL "?ttl=0");
    assert_non_null(lcm);
    int64_t end_ns = 0;
    for (int i = 0; (counts.sent == 0 || counts.commands == 0) && fv_test_patient(&end_ns, 10);
         i++) {
        if (i % 50 == 0) send_command(lcm, FOVEA_COMMAND_PAUSE);
        fv_transport_counts(transport, &counts);
    }
    assert_int_equal(counts.sent, 1);
    assert_true(counts.commands > 0);
    lcm_destroy(lcm);
    fv_transport_close(transport);
}

static void test_missing_route(void **state)
{
    (void)state;
    struct fovea_error error;
    if (!own_network) {
        print_message("SKIPPED test_missing_route: no network namespace of its own\n");
        skip();
    }
    assert_int_equal(fv_transport_check(URL, 0, &error), FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, FV_TRANSPORT_MEND));
    assert_non_null(strstr(error.text, "no route"));
    static uint8_t data[10];
    const struct fovea_outputs outputs = {
        .message_count = 1,
        .messages[0] = {.channel = "T_EARLY", .data = data, .bytes = sizeof data}};
    struct fv_transport *transport = open_without_route(&outputs);
    if (geteuid() != 0 || system("command -v ip >/dev/null") != 0) {
        print_message("SKIPPED the command that mends it: not root, or no program ip\n");
        assert_true(own_network_mend());
    } else { /* here the loopback is down; the second time a route leads nowhere */
        mend_as_shown();
        assert_int_equal(system("ip route del 224.0.0.0/4; ip route add unreachable 224.0.0.0/4"),
                         0);
        assert_int_equal(fv_transport_check(URL, 0, &error), FOVEA_ERROR_SYSTEM);
        mend_as_shown();
    }
    if (fv_transport_check(URL, 0, &error) != FOVEA_OK) fail_msg("%s", error.text);
    expect_sent_and_heard(transport, &outputs);
}

static void test_urls(void **state)
{
    (void)state;
    static const char *const wrong[] = {
        "udpm",
        "udpm://1.2.3.4:7667",
        "udpm://239.255.76.67:0",
        "udpm://239.255.76.67:x",
        "udpm://239.255.76.67:70000",
        "udpm://nonsense",
        "nothing://",
        "udpm://99999999999999999999999999999999999999999999999999999999999999999999"};
    struct fv_transport *transport = NULL;
    struct fovea_error error;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        enum fovea_status status = fv_transport_open(wrong[i], 0, &transport, &error);
        assert_true(status == FOVEA_ERROR_INPUT || (i == 6 && status == FOVEA_ERROR_SYSTEM));
        assert_non_null(strstr(error.text, wrong[i]));
    }
    assert_int_equal(fv_transport_open("", 0, &transport, &error), FOVEA_OK);
    assert_null(transport);
    fv_transport_publish(NULL, &(struct fovea_outputs){0});
    assert_int_equal(commands_of(NULL), 0);
    fv_transport_close(NULL);
}

struct sender {
    struct fv_transport *transport;
    const struct fovea_outputs *outputs;
    uint64_t heap_calls, planted;
};

static void *send_many(void *context)
{
    struct sender *sender = context;
    fv_heap_arm();
    for (int i = 0; i < 1000; i++) {
        while (!fv_transport_room(sender->transport, false))
            sleep_ms(1);
        fv_transport_publish(sender->transport, sender->outputs);
        (void)commands_of(sender->transport);
    }
    sender->heap_calls = fv_heap_calls();
    void *volatile planted = malloc(1); /* is seen, and so is its end */
    free(planted);
    sender->planted = fv_heap_calls();
    fv_heap_disarm();
    return NULL;
}

static void test_no_heap_call(void **state)
{
    (void)state;
    static uint8_t data[100000]; /* in two fragments */
    struct fv_transport *transport = NULL;
    struct fovea_error error;
    struct fv_transport_counts counts;
    if (!fv_heap_counted()) {
        print_message("SKIPPED test_no_heap_call: sanitizers own the heap\n");
        skip();
    }
    if (fv_transport_open(URL, 0, &transport, &error) != FOVEA_OK) fail_msg("%s", error.text);
    struct fovea_outputs outputs = {.message_count = 2};
    outputs.messages[0] = (struct fovea_message){.channel = "T_SMALL", .data = data, .bytes = 100};
    outputs.messages[1] =
        (struct fovea_message){.channel = "T_LARGE", .data = data, .bytes = sizeof data};
    struct sender sender = {.transport = transport, .outputs = &outputs};
    pthread_t thread; /* as the loop: not the thread that opened */
    assert_int_equal(pthread_create(&thread, NULL, send_many, &sender), 0);
    pthread_join(thread, NULL);
    assert_int_equal(sender.heap_calls, 0);
    assert_int_equal(sender.planted, 2);
    fv_transport_finish(transport);
    fv_transport_counts(transport, &counts);
    assert_int_equal(counts.sent, 2000);
    assert_int_equal(counts.dropped, 0);
    fv_transport_close(transport);
}

/* What liblcm, which other programs receive with, makes of ours: whole messages, long ones too, and
 * the repeated one. */
struct got {
    uint32_t large, repeated, wrong;
};

static const uint8_t repeated[] = {1, 2, 3, 4, 5};

static void take_large(const lcm_recv_buf_t *received, const char *channel, void *context)
{
    struct got *got = context;
    (void)channel;
    got->large++;
    if (received->data_size != 150000) got->wrong++;
    for (uint32_t i = 0; i < received->data_size; i++)
        if (((const uint8_t *)received->data)[i] != (uint8_t)(i * 7 >> 3)) got->wrong++;
}

static void take_repeated(const lcm_recv_buf_t *received, const char *channel, void *context)
{
    struct got *got = context;
    (void)channel;
    got->repeated++;
    if (received->data_size != sizeof repeated ||
        memcmp(received->data, repeated, sizeof repeated) != 0)
        got->wrong++;
}

static void test_liblcm_receives(void **state)
{
    (void)state;
    static uint8_t data[150000];
    struct fv_transport *transport = NULL;
    struct fovea_error error;
    struct got got = {0};
    for (uint32_t i = 0; i < sizeof data; i++)
        data[i] = (uint8_t)(i * 7 >> 3);
    lcm_t *lcm = lcm_create(URL "?ttl=0");
    assert_non_null(lcm_subscribe(lcm, "T_LARGE", take_large, &got));
    assert_non_null(lcm_subscribe(lcm, "T_RUN", take_repeated, &got));
    if (fv_transport_open(URL, 0, &transport, &error) != FOVEA_OK) fail_msg("%s", error.text);
    fv_transport_repeat(transport, "T_RUN", repeated, sizeof repeated);
    struct fovea_outputs outputs = {.message_count = 1};
    outputs.messages[0] =
        (struct fovea_message){.channel = "T_LARGE", .data = data, .bytes = sizeof data};
    const int64_t begin_ns = fv_clock_ns(CLOCK_MONOTONIC);
    int64_t end_ns = 0;
    uint32_t published = 0;
    for (int i = 0; (got.large < 5 || got.repeated < 3) && fv_test_patient(&end_ns, 0); i++) {
        if (i % 10 == 0) {
            fv_transport_publish(transport, &outputs);
            published++;
        }
        (void)lcm_handle_timeout(lcm, 50);
    }
    const int64_t seconds = (fv_clock_ns(CLOCK_MONOTONIC) - begin_ns) / FV_SECOND_NS;
    assert_in_range(got.large, 5, published);
    assert_in_range(got.repeated, 3, 2 + seconds); /* each second */
    assert_int_equal(got.wrong, 0);
    lcm_destroy(lcm);
    fv_transport_close(transport);
}

/* Wait until so many have come, taken or refused. */
static struct fv_transport_counts judged(struct fv_transport *transport, uint64_t all)
{
    struct fv_transport_counts counts;
    int64_t end_ns = 0;
    do
        fv_transport_counts(transport, &counts);
    while (counts.commands + counts.commands_refused < all && fv_test_patient(&end_ns, 10));
    assert_int_equal(counts.commands + counts.commands_refused, all);
    return counts;
}

/* As many are taken and refused. */
static void expect_counts(struct fv_transport *transport, uint64_t taken, uint64_t refused)
{
    const struct fv_transport_counts counts = judged(transport, taken + refused);
    assert_int_equal(counts.commands, taken);
    assert_int_equal(counts.commands_refused, refused);
}

static void test_commands(void **state)
{
    (void)state;
    struct fv_transport *transport = NULL;
    struct fovea_error error;
    const struct fv_transport_ears ears = {.listen = "loopback", .prefix = PREFIX};
    if (fv_transport_open(URL, 0, &transport, &error) != FOVEA_OK ||
        fv_transport_listen(transport, &ears, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    lcm_t *lcm = lcm_create(URL "?ttl=0");
    assert_non_null(lcm);
    struct fv_transport_counts counts;
    uint64_t base = 1;
    send_command(lcm, FOVEA_COMMAND_SAVE); /* the listener is there from the start */
    expect_counts(transport, base, 0);
    assert_int_equal(commands_of(transport), FOVEA_COMMAND_SAVE);
    assert_int_equal(commands_of(transport), 0);

    send_command(lcm, FOVEA_COMMAND_PAUSE);
    send_command(lcm, FOVEA_COMMAND_RESET);
    expect_counts(transport, base + 2, 0);
    assert_int_equal(commands_of(transport), FOVEA_COMMAND_RESET | FOVEA_COMMAND_PAUSE);

    /* Other robots' commands: to LCM a channel to listen to is a pattern, in which a dot is any
     * letter. */
    static const char *const others[] = {"T/\xc3\xa4_COMMAND", PREFIX "_COMMANDS",
                                         "X" PREFIX "_COMMAND", "T.B_COMMAND", "_COMMAND"};
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
        send_on(lcm, others[i], FOVEA_COMMAND_RESET);
    send_command(lcm, FOVEA_COMMAND_PAUSE);
    expect_counts(transport, base + 3, 0);
    assert_int_equal(commands_of(transport), FOVEA_COMMAND_PAUSE);

    uint8_t hostile[24] = {0};
    lcm_publish(lcm, PREFIX "_COMMAND", hostile, sizeof hostile);
    lcm_publish(lcm, PREFIX "_COMMAND", hostile, 3);
    send_command(lcm, 0);
    send_command(lcm, 1 << 20);
    expect_counts(transport, base + 3, 2);
    fv_transport_counts(transport, &counts);
    assert_int_equal(counts.received.dropped[FV_DROP_TYPE], 2);
    assert_int_equal(counts.received.dropped[FV_DROP_CHANNEL], 0); /* the kernel's */
    assert_int_equal(commands_of(transport), 0);

    send_command(lcm, FOVEA_COMMAND_SAVE); /* so soon after the first, or the one before */
    int64_t end_ns = 0;
    while (judged(transport, base + 3 + 3).commands_refused < 3 && fv_test_patient(&end_ns, 0)) {
        assert_int_equal(commands_of(transport), FOVEA_COMMAND_SAVE);
        base++;
        send_command(lcm, FOVEA_COMMAND_SAVE);
    }
    assert_int_equal(commands_of(transport), 0);
    for (int i = 0; i < 100;
         i++) { /* more than the ring holds, at a pace that the socket can hold */
        send_command(lcm, FOVEA_COMMAND_PAUSE);
        sleep_ms(1);
    }
    counts = judged(transport, base + 3 + 3 + 100);
    (void)commands_of(transport);
    assert_true(counts.commands_refused > 3);
    send_command(lcm, FOVEA_COMMAND_RESET);
    expect_counts(transport, counts.commands + 1, counts.commands_refused);
    assert_int_equal(commands_of(transport), FOVEA_COMMAND_RESET);
    lcm_destroy(lcm);
    char *printed = NULL, expected[128];
    size_t bytes;
    FILE *out = open_memstream(&printed, &bytes);
    fv_transport_tell(out, transport);
    fclose(out);
    fv_transport_counts(transport, &counts);
    snprintf(expected, sizeof expected,
             "  LCM: packets dropped: 2 (type)\n"
             "  LCM: commands refused: 2 (unknown), 1 (too often), %d (loop busy)\n",
             (int)counts.commands_refused - 3);
    assert_string_equal(printed, expected);
    free(printed);
    fv_transport_close(transport);
}

static void send_pose(lcm_t *lcm, const char *channel, const bot_core_pose_t *pose)
{
    uint8_t data[256];
    int bytes = bot_core_pose_t_encode(data, 0, sizeof data, pose);
    assert_int_equal(lcm_publish(lcm, channel, data, (unsigned)bytes), 0);
}

/* Poses of the robot's odometry come in order, on their very channel alone; what is no pose is
 * refused. */
static void test_odometry(void **state)
{
    (void)state;
    struct fv_transport *transport = NULL;
    struct fovea_error error;
    struct fovea_wheel_odometry_sample samples[8];
    const bot_core_pose_t good = {
        .utime = 1000002, .pos = {1, -2, 3}, .orientation = {0.603, 0, 0.804, 0}};
    const struct fv_transport_ears ears = {.listen = "loopback",
                                           .prefix = "T",
                                           .wheel_odometry_channel = "ODOM.1",
                                           .wheel_odometry_limits = {3, 6}};
    bot_core_pose_t wrong[7] = {good, good, good, good, good, good, good}, next = good;
    if (fv_transport_open(URL, 0, &transport, &error) != FOVEA_OK ||
        fv_transport_listen(transport, &ears, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    lcm_t *lcm = lcm_create(URL "?ttl=0");
    assert_non_null(lcm);
    send_pose(lcm, "ODOM.1", &good);
    send_pose(lcm, "ODOMx1", &good);
    send_pose(lcm, "ODOM.12", &good);
    wrong[0].utime = -1;
    wrong[1].utime = INT64_MAX / 1000 + 1;
    wrong[2].pos[1] = (double)NAN;
    wrong[3].orientation[2] = 0; /* no rotation */
    wrong[4].orientation[0] = (double)NAN;
    wrong[5].utime -= 1; /* older */
    wrong[6].utime += 1000000;
    wrong[6].pos[2] = 30; /* at 27 m/s */
    for (int i = 0; i < 7; i++)
        send_pose(lcm, "ODOM.1", &wrong[i]);
    lcm_publish(lcm, "ODOM.1", "abc", 3);
    next.utime++;
    send_pose(lcm, "ODOM.1", &next);

    struct fv_transport_counts counts;
    int64_t end_ns = 0;
    do
        fv_transport_counts(transport, &counts);
    while ((counts.wheel_odometry < 2 || counts.wheel_odometry_refused < 7) &&
           fv_test_patient(&end_ns, 10));
    assert_int_equal(counts.wheel_odometry, 2);
    assert_int_equal(counts.wheel_odometry_verdicts[FV_WHEEL_ODOMETRY_MALFORMED], 5);
    assert_int_equal(counts.wheel_odometry_verdicts[FV_WHEEL_ODOMETRY_OLD], 1);
    assert_int_equal(counts.wheel_odometry_verdicts[FV_WHEEL_ODOMETRY_TOO_FAST], 1);
    assert_int_equal(counts.wheel_odometry_refused, 7);
    assert_int_equal(counts.received.dropped[FV_DROP_TYPE], 1);
    assert_int_equal(fv_transport_wheel_odometry(transport, samples, 1), 1);
    assert_int_equal(fv_transport_wheel_odometry(transport, samples + 1, 7), 1);
    assert_int_equal(samples[0].stamp_ns, 1000002000);
    assert_int_equal(samples[1].stamp_ns, 1000003000);
    assert_true(samples[0].position_m[0] == 1 && samples[0].position_m[1] == -2 &&
                samples[0].position_m[2] == 3);
    assert_true(fabs(samples[0].orientation[0] - 0.6) < 1e-9 &&
                fabs(samples[0].orientation[2] - 0.8) < 1e-9);
    lcm_destroy(lcm);
    fv_transport_close(transport);
}

/* The programs that send commands, in C and in Python, prove that they know the key; without it,
 * with another or for another run they are refused. */
static void test_tools_send_what_is_taken(void **state)
{
    static const char *const digits[] = {"000102030405060708090a0b0c0d0e0f",
                                         "000102030405060708090a0b0c0d0e00"};
    struct fv_transport *transport = NULL;
    struct fovea_error error;
    struct fv_transport_ears ears = {.listen = "loopback", .prefix = "K", .rules = {.run_id = -99}};
    char folder[] = "/tmp/fovea-key-XXXXXX", key[2][64], tools[2][1200];
    uint64_t taken = 0;
    (void)state;
    if (getenv("FOVEA_EMULATED") != NULL) {
        print_message("SKIPPED test_tools: programs cannot be started from an emulator\n");
        skip();
    }
    assert_non_null(mkdtemp(folder));
    for (int i = 0; i < 2; i++) {
        snprintf(key[i], sizeof key[i], "%s/%d", folder, i);
        const int file = open(key[i], O_WRONLY | O_CREAT, 0600);
        assert_int_equal(write(file, digits[i], 32), 32);
        close(file);
    }
    assert_int_equal(fv_command_key_read(key[0], ears.rules.key, &error), FOVEA_OK);
    ears.rules.keyed = true;
    if (fv_transport_open(URL, 0, &transport, &error) != FOVEA_OK ||
        fv_transport_listen(transport, &ears, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    snprintf(tools[0], sizeof tools[0], "%s/command", build_folder());
    snprintf(tools[1], sizeof tools[1], "python3 tools/subscribers/command.py --types %s/python",
             build_folder());
    for (int i = 0; i < 2; i++) {
        char command[3000];
        struct fv_transport_counts counts;
        for (int k = 0; k < 4; k++) { /* without a key, with another, for another run, right */
            char with[256] = "";
            const char *run_id = k == 2 ? "-98" : "-99";
            if (k > 0)
                snprintf(with, sizeof with,
                         i == 0 ? "--run-id %s --key %s" : "--run-id=%s --key %s", run_id,
                         key[k == 1]);
            snprintf(command, sizeof command, "%s --prefix K --wait 0 --sender %d %s pause resume",
                     tools[i], i + 1, with);
            if (system(command) != 0) fail_msg("%s: failed", command);
        }
        taken++;
        expect_counts(transport, taken, 3 * taken);
        fv_transport_counts(transport, &counts);
        assert_int_equal(counts.command_verdicts[FV_COMMAND_FORGED], 2 * taken);
        assert_int_equal(counts.command_verdicts[FV_COMMAND_OTHER_RUN], taken);
        assert_int_equal(commands_of(transport), FOVEA_COMMAND_PAUSE | FOVEA_COMMAND_RESUME);
    }
    fv_transport_close(transport);
    for (int i = 0; i < 2; i++)
        unlink(key[i]);
    rmdir(folder);
}

int main(void)
{
    own_network = own_network_enter();
    struct fovea_error error;
    if (!own_network && fv_transport_check(URL, 0, &error) != FOVEA_OK) {
        printf("SKIPPED test_transport: no network namespace of its own, and %s\n", error.text);
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_missing_route),
        cmocka_unit_test(test_urls),
        cmocka_unit_test(test_no_heap_call),
        cmocka_unit_test(test_liblcm_receives),
        cmocka_unit_test(test_commands),
        cmocka_unit_test(test_odometry),
        cmocka_unit_test(test_tools_send_what_is_taken),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
