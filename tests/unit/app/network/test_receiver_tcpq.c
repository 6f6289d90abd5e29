/* The stream of an LCM server: however it is cut into pieces the same messages are taken, claims of
 * gigabytes take no memory, and a server that goes and comes back is heard again. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <arpa/inet.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/network/receiver.h"
#include "app/network/receiver_tcpq.h"
#include "common/patience.h"

static const uint8_t greeting[] = {0x28, 0x76, 0x17, 0xfa, 0, 0, 1, 0};

struct heard {
    uint32_t messages, bytes, from_host;
    uint8_t last;
};

static void take(void *context, const struct fv_received *received)
{
    struct heard *heard = context;
    heard->messages++;
    heard->bytes += received->bytes;
    heard->from_host += received->from_host;
    heard->last = received->bytes > 0 ? received->data[received->bytes - 1] : 0;
}

static size_t put_number(uint8_t *at, uint32_t value)
{
    value = htonl(value);
    memcpy(at, &value, 4);
    return 4;
}

/* A message that claims `claim` bytes and has `bytes`. */
static size_t put_message(uint8_t *at, const char *channel, uint32_t claim, uint32_t bytes,
                          uint8_t last)
{
    size_t used = put_number(at, 1);
    used += put_number(at + used, (uint32_t)strlen(channel));
    memcpy(at + used, channel, strlen(channel));
    used += strlen(channel);
    used += put_number(at + used, claim);
    memset(at + used, 0, bytes);
    if (bytes > 0) at[used + bytes - 1] = last;
    return used + bytes;
}

/* Five messages, of which two are taken: one is foreign, one too long, one has a name too long. */
static size_t put_five(uint8_t *at)
{
    char name[100];
    memset(name, 'n', sizeof name - 1);
    name[sizeof name - 1] = '\0';
    size_t used = put_message(at, "A", 10, 10, 1);
    used += put_message(at + used, "B", 10, 10, 2);
    used += put_message(at + used, "A", 101, 101, 3);
    used += put_message(at + used, name, 0, 0, 0);
    used += put_message(at + used, "A", 100, 100, 5);
    return used;
}

static void test_pieces_of_any_length_give_the_same_messages(void **state)
{
    uint8_t bytes[1024], buffer[100];
    memcpy(bytes, greeting, sizeof greeting);
    const size_t all = sizeof greeting + put_five(bytes + sizeof greeting);
    (void)state;
    for (size_t step = 1; step <= all; step++) {
        struct heard heard = {0};
        struct fv_receiver_table table = {
            .rows = {{.name = "A", .bytes_max = 100, .take = take, .context = &heard}}, .count = 1};
        struct fv_tcpq_stream stream;
        uint32_t taken = 0;
        fv_tcpq_begin(&stream, &table, buffer, sizeof buffer);
        for (size_t at = 0; at < all; at += step)
            assert_true(
                fv_tcpq_feed(&stream, bytes + at, all - at < step ? all - at : step, &taken));
        assert_int_equal(taken, 2);
        assert_int_equal(heard.bytes, 110);
        assert_int_equal(heard.last, 5);
        assert_int_equal(table.dropped[FV_DROP_CHANNEL], 2);
        assert_int_equal(table.dropped[FV_DROP_LONG], 1);
    }
}

static char last_channel[FV_MESSAGE_CHANNEL_BYTES];

static void take_channel(void *context, const struct fv_received *received)
{
    ++*(int *)context;
    snprintf(last_channel, sizeof last_channel, "%s", received->channel);
}

/* The first row that fits takes it, under the name that it came with; a shorter name leaves nothing
 * of a longer one. */
static void test_patterns(void **state)
{
    static const struct {
        const char *name;
        int row;
    } channels[] = {{"LONG_NAME_POSE", 0},
                    {"CAMERA_POSE", 1},
                    {"POSE", 0},
                    {"POSES", -1},
                    {"XX", 2},
                    {"X", -1},
                    {"", -1},
                    {"A_POSE_POSE", 0}};
    uint8_t bytes[256], buffer[100];
    int taken_of[3] = {0}, expected[3] = {0};
    struct fv_receiver_table table = {
        .rows = {{"*CAMERA_POSE", NULL, 100, take_channel, &taken_of[1], true},
                 {"*POSE", NULL, 100, take_channel, &taken_of[0], true},
                 {"??", NULL, 100, take_channel, &taken_of[2], true}},
        .count = 3};
    struct fv_tcpq_stream stream;
    uint32_t taken = 0;
    (void)state;
    fv_tcpq_begin(&stream, &table, buffer, sizeof buffer);
    assert_true(fv_tcpq_feed(&stream, greeting, sizeof greeting, &taken));
    for (size_t i = 0; i < sizeof channels / sizeof channels[0]; i++) {
        const size_t all = put_message(bytes, channels[i].name, 1, 1, 0);
        assert_true(fv_tcpq_feed(&stream, bytes, all, &taken));
        if (channels[i].row < 0) continue;
        expected[channels[i].row]++;
        assert_string_equal(last_channel, channels[i].name);
    }
    assert_memory_equal(taken_of, expected, sizeof expected);
}

static void test_what_is_no_server_is_left(void **state)
{
    static const uint8_t wrong[][12] = {
        {0x28, 0x76, 0x17, 0xfb, 0, 0, 1, 0},             /* a client */
        {0x28, 0x76, 0x17, 0xfa, 0, 0, 2, 0},             /* another version */
        {0x28, 0x76, 0x17, 0xfa, 0, 0, 1, 0, 0, 0, 0, 2}, /* a subscription */
    };
    (void)state;
    for (int i = 0; i < 3; i++) {
        struct fv_receiver_table table = {.count = 0};
        struct fv_tcpq_stream stream;
        uint8_t buffer[1];
        uint32_t taken = 0;
        fv_tcpq_begin(&stream, &table, buffer, sizeof buffer);
        assert_false(fv_tcpq_feed(&stream, wrong[i], sizeof wrong[i], &taken));
        assert_int_equal(table.dropped[FV_DROP_MALFORMED], 1);
    }
}

static void test_a_claim_of_gigabytes_is_passed_over(void **state)
{
    static uint8_t zeros[1 << 16];
    struct heard heard = {0};
    struct fv_receiver_table table = {
        .rows = {{.name = "A", .bytes_max = 100, .take = take, .context = &heard}}, .count = 1};
    struct fv_tcpq_stream stream;
    uint8_t bytes[64], buffer[100];
    uint32_t taken = 0;
    (void)state;
    fv_tcpq_begin(&stream, &table, buffer, sizeof buffer);
    fv_tcpq_feed(&stream, greeting, sizeof greeting, &taken);
    fv_tcpq_feed(&stream, bytes, put_message(bytes, "A", 1u << 28, 0, 0), &taken);
    for (int i = 0; i < (1 << 28) / (1 << 16); i++)
        assert_true(fv_tcpq_feed(&stream, zeros, sizeof zeros, &taken));
    assert_int_equal(taken, 0);
    fv_tcpq_feed(&stream, bytes, put_message(bytes, "A", 3, 3, 9), &taken);
    assert_int_equal(taken, 1);
    assert_int_equal(heard.last, 9);
}

/* ---- a server of the test's own -------------------------------------------------------------- */

static int open_server(char url[64])
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t bytes = sizeof address;
    const int server = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(server, (struct sockaddr *)&address, sizeof address), 0);
    assert_int_equal(listen(server, 4), 0);
    getsockname(server, (struct sockaddr *)&address, &bytes);
    snprintf(url, 64, "tcpq://127.0.0.1:%d", ntohs(address.sin_port));
    return server;
}

/* The receiver's connection, and that it asks for its channel alone. */
static int accept_client(int server, struct fv_receiver *receiver)
{
    static const uint8_t wanted[] = {0x28, 0x76, 0x17, 0xfb, 0, 0, 1,   0,    0,   0,
                                     0,    2,    0,    0,    0, 4, 'A', '\\', '.', 'b'};
    uint8_t got[64];
    size_t used = 0;
    for (int i = 0; i < 3; i++)
        fv_receiver_handle(receiver, 1500);
    const int client = accept(server, NULL, NULL);
    while (used < sizeof wanted) {
        const ssize_t some = recv(client, got + used, sizeof got - used, 0);
        assert_true(some > 0);
        used += (size_t)some;
    }
    assert_int_equal(used, sizeof wanted);
    assert_memory_equal(got, wanted, sizeof wanted);
    return client;
}

static void test_a_server_may_go_and_come_back(void **state)
{
    struct heard heard = {0};
    const struct fv_receiver_channel row = {
        .name = "A.b", .bytes_max = 100, .take = take, .context = &heard};
    struct fv_receiver *receiver;
    struct fovea_error error;
    uint8_t bytes[512];
    char url[64];
    (void)state;
    const int server = open_server(url);
    const struct fv_receiver_setup setup = {url, "loopback", &row, 1};
    assert_int_equal(fv_receiver_open(&setup, &receiver, &error), FOVEA_OK);
    for (uint32_t time = 1; time <= 2; time++) {
        const int client = accept_client(server, receiver);
        const size_t used = put_message(bytes, "A.b", 7, 7, 1);
        assert_int_equal(send(client, greeting, sizeof greeting, 0), sizeof greeting);
        assert_int_equal(send(client, bytes, used, 0), used);
        int64_t end_ns = 0;
        while (heard.messages < time && fv_test_patient(&end_ns, 0))
            fv_receiver_handle(receiver, 10);
        assert_int_equal(heard.messages, time);
        assert_int_equal(heard.from_host, 0); /* who sent it the server alone knows */
        close(client);
        fv_receiver_handle(receiver, 1000);
    }
    fv_receiver_close(receiver);
    close(server);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pieces_of_any_length_give_the_same_messages),
        cmocka_unit_test(test_patterns),
        cmocka_unit_test(test_what_is_no_server_is_left),
        cmocka_unit_test(test_a_claim_of_gigabytes_is_passed_over),
        cmocka_unit_test(test_a_server_may_go_and_come_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
