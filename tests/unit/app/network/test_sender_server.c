/* Sending to an LCM server (tcpq) that misbehaves: one that takes connections and reads nothing,
 * and one that does not answer at all. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/network/transport.h"
#include "app/network/transport_url.h"
#include "message/message.h"

enum { ROUND_MESSAGES = 200, ROUNDS = 600, CONNECTIONS = 16 };

static int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* A listening socket on a free port. */
static int open_server(int backlog, struct sockaddr_in *address, char url[64])
{
    const int server = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const struct timeval patience = {.tv_sec = 60}; /* of accept and recv */
    socklen_t size = sizeof *address;
    assert_int_equal(setsockopt(server, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience), 0);
    *address =
        (struct sockaddr_in){.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    assert_int_equal(bind(server, (struct sockaddr *)address, sizeof *address), 0);
    assert_int_equal(listen(server, backlog), 0);
    assert_int_equal(getsockname(server, (struct sockaddr *)address, &size), 0);
    snprintf(url, 64, "tcpq://127.0.0.1:%d", ntohs(address->sin_port));
    return server;
}

/* Take the connection of the sender (the check of the URL makes one that says nothing) and greet.
 */
static int greet(int server)
{
    static const uint8_t hello[] = {0x28, 0x76, 0x17, 0xfa, 0, 0, 1, 0};
    uint8_t said[8];
    for (;;) {
        const int peer = accept(server, NULL, NULL);
        assert_true(peer >= 0);
        if (recv(peer, said, sizeof said, MSG_WAITALL) == (ssize_t)sizeof said) {
            assert_int_equal(send(peer, hello, sizeof hello, 0), sizeof hello);
            return peer;
        }
        close(peer);
    }
}

static void publish(struct fv_transport *transport, const char *channel)
{
    static uint8_t data[20000];
    struct fovea_outputs outputs = {.message_count = 1};
    outputs.messages[0] =
        (struct fovea_message){.channel = channel, .data = data, .bytes = sizeof data};
    fv_transport_publish(transport, &outputs);
}

static uint64_t dropped_by_server(const struct fv_transport *transport, const char *channel)
{
    struct fv_transport_sent sent;
    fv_transport_sent(transport, &sent);
    for (uint32_t i = 0; i < sent.count; i++)
        if (strcmp(sent.channels[i].name, channel) == 0)
            return sent.channels[i].dropped[FV_TRANSPORT_DROP_SERVER];
    return 0;
}

/* At first the kernel takes messages, and then none is known to be lost for long. In the end each
 * message is dropped because of the server. */
static void a_server_that_never_reads_is_the_reason_of_drops(void **state)
{
    (void)state;
    char url[64];
    struct sockaddr_in address;
    struct fv_transport *transport;
    struct fovea_error error;
    const int server = open_server(4, &address, url);
    assert_int_equal(fv_transport_open(url, 0, &transport, &error), FOVEA_OK);
    publish(transport, "FOVEA_MAP"); /* the sender greets when there is something to send */
    assert_true(fv_transport_room(transport, false));
    assert_false(fv_transport_room(transport, true)); /* it waits for the server's greeting */
    const int peer = greet(server);
    uint64_t before = 0, after = 0;
    for (int round = 0; round < ROUNDS && after - before < ROUND_MESSAGES; round++) {
        before = dropped_by_server(transport, "FOVEA_FEATURES");
        for (int i = 0; i < ROUND_MESSAGES; i++)
            publish(transport, "FOVEA_FEATURES");
        nanosleep(&(struct timespec){.tv_nsec = 100000000}, NULL);
        after = dropped_by_server(transport, "FOVEA_FEATURES");
    }
    /* Besides those of this round, what a busy machine dropped late of the one before. */
    assert_true(after - before >= ROUND_MESSAGES);
    publish(transport, "FOVEA_POSE"); /* it has room and waits, until it is too old */
    for (int round = 0; round < ROUNDS && dropped_by_server(transport, "FOVEA_POSE") == 0; round++)
        nanosleep(&(struct timespec){.tv_nsec = 100000000}, NULL);
    assert_int_equal(dropped_by_server(transport, "FOVEA_POSE"), 1);
    close(peer);
    close(server);
    fv_transport_close(transport);
}

/* Where a queue of connections is full, Linux answers none. The limit is ours and not the system's:
 * a connection that was begun before is still under way. */
static void a_server_that_does_not_answer_is_waited_for_two_seconds(void **state)
{
    (void)state;
    char url[64];
    struct sockaddr_in address;
    struct fovea_error error;
    int connections[CONNECTIONS], count = 0;
    bool waits = false;
    const int server = open_server(0, &address, url);
    while (count < CONNECTIONS && !waits) {
        const int made = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
        assert_true(made >= 0);
        connections[count++] = made;
        waits = connect(made, (struct sockaddr *)&address, sizeof address) != 0 &&
                poll(&(struct pollfd){.fd = made, .events = POLLOUT}, 1, 300) == 0;
    }
    struct pollfd earlier = {.fd = connections[count - 1], .events = POLLOUT};
    if (!waits) print_message("SKIPPED: this system answers however full a queue is\n");
    const int64_t begin_ns = now_ns();
    if (waits) {
        assert_int_equal(fv_transport_reachable(url, &error), FOVEA_ERROR_SYSTEM);
        assert_true(now_ns() - begin_ns >= 1999000000);
        assert_int_equal(poll(&earlier, 1, 0), 0);
        assert_non_null(strstr(error.text, "no LCM server answers (Connection timed out)"));
    }
    for (int i = 0; i < count; i++)
        close(connections[i]);
    close(server);
    if (!waits) skip();
}

int main(void)
{
    fv_message_prepare();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_server_that_never_reads_is_the_reason_of_drops),
        cmocka_unit_test(a_server_that_does_not_answer_is_waited_for_two_seconds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
