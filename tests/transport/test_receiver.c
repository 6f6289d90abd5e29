/* The receiver between two hosts of the test's own: what this host sends is heard, what others send
 * only where it is asked for, whatever its addresses and time-to-live say; hostile packets neither
 * end it nor make it grow. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <arpa/inet.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/network/receiver.h"
#include "common/build_folder.h"
#include "common/patience.h"
#include "common/two_hosts.h"

#define GROUP "239.255.76.67"
#define URL "udpm://" GROUP ":7667"

enum { PORT = 7667 };

/* ---- receivers that count -------------------------------------------------------------------- */

struct ear {
    struct fv_receiver *receiver;
    uint32_t host, network; /* messages heard */
    uint32_t last_bytes;
};

static void take(void *context, const struct fv_received *received)
{
    struct ear *ear = context;
    ++*(received->from_host ? &ear->host : &ear->network);
    ear->last_bytes = received->bytes;
}

static void ear_open(struct ear *ear, const char *listen)
{
    struct fovea_error error;
    const struct fv_receiver_channel rows[] = {
        {.name = "A", .bytes_max = 100, .take = take, .context = ear},
        {.name = "T.\xc3\xa4_COMMAND", .bytes_max = 100, .take = take, .context = ear},
        {.name = "A_CHANNEL_WHOSE_NAME_HAS_ALL_OF_THE_63_LETTERS_THAT_LCM_ALLOWS_",
         .bytes_max = 1000,
         .take = take,
         .context = ear},
    };
    const struct fv_receiver_setup setup = {URL, listen, rows, 3};
    memset(ear, 0, sizeof *ear);
    if (fv_receiver_open(&setup, &ear->receiver, &error) != FOVEA_OK) fail_msg("%s", error.text);
}

static void ear_close(struct ear *ear)
{
    fv_receiver_close(ear->receiver);
}

/* Take what comes, until so many messages of this host were heard: packets on veth and loopback are
 * there when the sender returns, but on a loaded machine a moment later. */
static void hear_host(struct ear *ear, uint32_t messages)
{
    int64_t end_ns = 0;
    while (ear->host < messages && fv_test_patient(&end_ns, 0))
        fv_receiver_handle(ear->receiver, 10);
}

/* Take what has come, and follow what has changed. */
static void hear(struct ear *ear)
{
    while (fv_receiver_handle(ear->receiver, 0) > 0)
        continue;
    fv_receiver_handle(ear->receiver, 0);
}

static uint64_t dropped(const struct ear *ear, enum fv_drop reason)
{
    struct fv_receiver_counts counts;
    fv_receiver_counts(ear->receiver, &counts);
    return counts.dropped[reason];
}

/* Take what comes, until so many were dropped for this reason; how many were. */
static uint64_t await_dropped(struct ear *ear, enum fv_drop reason, uint64_t count)
{
    int64_t end_ns = 0;
    while (dropped(ear, reason) < count && fv_test_patient(&end_ns, 1))
        hear(ear);
    return dropped(ear, reason);
}

/* ---- packets --------------------------------------------------------------------------------- */

static size_t packet_make(uint8_t packet[1400], const char *magic, const char *channel,
                          size_t bytes)
{
    const size_t name = strlen(channel) + 1;
    memset(packet, 0, 1400);
    memcpy(packet, magic, 4);
    memcpy(packet + 8, channel, name);
    return 8 + name + bytes;
}

static void send_raw(const void *packet, size_t bytes, const char *to, int ttl)
{
    const int udp = socket(AF_INET, SOCK_DGRAM, 0);
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(PORT)};
    inet_pton(AF_INET, to, &address.sin_addr);
    assert_int_equal(setsockopt(udp, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl), 0);
    assert_int_equal(
        sendto(udp, packet, bytes, 0, (const struct sockaddr *)&address, sizeof address), bytes);
    close(udp);
}

static void send_here(const char *to, int ttl)
{
    uint8_t packet[1400];
    send_raw(packet, packet_make(packet, "LC02", "A", 3), to, ttl);
}

static void send_other(const char *from, const char *to, uint8_t ttl)
{
    uint8_t packet[1400];
    const size_t bytes = packet_make(packet, "LC02", "A", 3);
    two_hosts_send(&(struct two_hosts_packet){from, to, PORT, ttl, packet, bytes});
}

static void run(const char *command)
{
    if (system(command) != 0) fail_msg("%s: failed", command);
}

static void route_to(const char *interface)
{
    char command[128];
    snprintf(command, sizeof command, "ip route replace 224.0.0.0/4 dev %s", interface);
    run(command);
}

/* ---- who is heard ---------------------------------------------------------------------------- */

struct ears {
    struct ear loopback, eth0, any;
};

static void ears_open(struct ears *ears)
{
    ear_open(&ears->loopback, "loopback");
    ear_open(&ears->eth0, "eth0");
    ear_open(&ears->any, "any");
}

static void ears_close(struct ears *ears)
{
    ear_close(&ears->loopback);
    ear_close(&ears->eth0);
    ear_close(&ears->any);
}

/* Each must have heard as many of this host and, but for the first, of the network. */
static void expect(struct ears *ears, uint32_t host, uint32_t network)
{
    struct ear *const all[] = {&ears->loopback, &ears->eth0, &ears->any};
    for (int i = 0; i < 3; i++) {
        int64_t end_ns = 0;
        while ((all[i]->host < host || all[i]->network < network * (i > 0)) &&
               fv_test_patient(&end_ns, 0))
            fv_receiver_handle(all[i]->receiver, 10);
        hear(all[i]);
        if (all[i]->host != host || all[i]->network != (i > 0 ? network : 0))
            fail_msg("receiver %d: found %u of this host and %u of the network, expected %u and %u",
                     i, all[i]->host, all[i]->network, host, i > 0 ? network : 0);
    }
}

static void test_this_host_is_heard_wherever_the_route_leads(void **state)
{
    static const char *const routes[] = {"eth0", "lo"};
    (void)state;
    for (int i = 0; i < 2; i++) {
        struct ears ears;
        route_to(routes[i]);
        ears_open(&ears);
        send_here(GROUP, 0);
        expect(&ears, 1, 0);
        send_here(GROUP, 1);
        expect(&ears, 2, 0);
        ears_close(&ears);
    }
    route_to("eth0");
}

static void test_others_are_heard_only_where_asked_for(void **state)
{
    struct ears ears;
    (void)state;
    ears_open(&ears);
    send_other(TWO_HOSTS_OTHER, GROUP, 0);
    expect(&ears, 0, 1);
    send_other(TWO_HOSTS_OTHER, GROUP, 1);
    expect(&ears, 0, 2);
    assert_true(await_dropped(&ears.loopback, FV_DROP_KERNEL, 2) >= 2);
    ears_close(&ears);
}

/* With accept_local the kernel takes packets from outside that bear an own address. */
static void test_a_spoofed_own_address_is_of_the_network(void **state)
{
    struct ears ears;
    (void)state;
    run("for i in all eth0; do echo 1 >/proc/sys/net/ipv4/conf/$i/accept_local; "
        "echo 0 >/proc/sys/net/ipv4/conf/$i/rp_filter; done");
    ears_open(&ears);
    send_other(TWO_HOSTS_HERE, GROUP, 0);
    send_other(TWO_HOSTS_HERE, GROUP, 1);
    expect(&ears, 0, 2);
    send_other("127.0.0.1", GROUP, 1); /* which no kernel takes from outside */
    send_here(GROUP, 0);
    expect(&ears, 1, 2);
    ears_close(&ears);
}

static void test_unicast_reaches_nobody(void **state)
{
    struct ears ears;
    (void)state;
    ears_open(&ears);
    send_other(TWO_HOSTS_OTHER, TWO_HOSTS_HERE, 64);
    send_here(TWO_HOSTS_HERE, 0);
    send_here("127.0.0.1", 0);
    send_here(GROUP, 0); /* after which the others would have come */
    send_other(TWO_HOSTS_OTHER, GROUP, 1);
    expect(&ears, 1, 1);
    ears_close(&ears);
}

/* Whether the interface has a member in the group. */
static bool joined(const char *interface)
{
    char line[256];
    bool here = false, found = false;
    FILE *file = fopen("/proc/net/igmp", "r");
    while (fgets(line, sizeof line, file) != NULL) {
        char name[32];
        if (sscanf(line, "%*d %31[^ \t:]", name) == 1 && line[0] != '\t')
            here = strcmp(name, interface) == 0;
        found = found || (here && strstr(line, "434CFFEF") != NULL);
    }
    fclose(file);
    return found;
}

static void test_memberships_follow_routes_and_interfaces(void **state)
{
    struct ear ear;
    (void)state;
    run("ip link add other0 type veth peer name other1 && ip link set other1 up && ip addr add 10.8.0.1/24 dev other0 && "
        "ip link set other0 up multicast on");
    ear_open(&ear, "loopback");
    assert_true(joined("eth0") && joined("lo") && !joined("other0"));
    route_to("other0");
    hear(&ear);
    assert_true(!joined("eth0") && joined("lo") && joined("other0"));
    send_here(GROUP, 0);
    hear_host(&ear, 1);
    assert_int_equal(ear.host, 1);
    run("ip link del other0"); /* and the route with it */
    hear(&ear);
    assert_true(!joined("eth0") && joined("lo"));
    route_to("eth0");
    hear(&ear);
    assert_true(joined("eth0"));
    run("ip link set eth0 down"); /* the route goes, and comes back by hand only */
    hear(&ear);
    run("ip link set eth0 up");
    route_to("eth0");
    hear(&ear);
    send_here(GROUP, 1);
    hear_host(&ear, 2);
    assert_int_equal(ear.host, 2);
    ear_close(&ear);
    assert_false(joined("eth0"));
}

/* Between two looks at the news. */
static void test_an_interface_is_made_again(void **state)
{
    static const char make[] = "ip link add again0 index 77 type veth peer name again1 && "
                               "ip link set again0 up multicast on";
    struct ear ear;
    (void)state;
    run(make);
    ear_open(&ear, "again0");
    assert_true(joined("again0"));
    run("ip link del again0");
    run(make);
    assert_false(joined("again0"));
    hear(&ear);
    assert_true(joined("again0"));
    run("ip link del again0");
    hear(&ear);
    ear_close(&ear);
}

static void test_an_interface_may_come_later(void **state)
{
    struct ear ear;
    (void)state;
    ear_open(&ear, "late0"); /* says so */
    run("ip link add late0 type veth peer name late1 && ip link set late0 up");
    hear(&ear);
    assert_true(joined("late0"));
    run("ip link del late0");
    hear(&ear);
    ear_close(&ear);
}

/* Python's lcm, which is liblcm, sends here as users' programs do. */
static void test_programs_with_liblcm_are_heard(void **state)
{
    char command[1200], ready[600];
    struct ears ears;
    (void)state;
    snprintf(ready, sizeof ready, "%s/venv-lcm/ready", build_folder());
    if (access(ready, R_OK) != 0) {
        print_message("SKIPPED a sender in Python: no package lcm in %s/venv-lcm\n",
                      build_folder());
        skip();
    }
    for (int lo = 0; lo < 2; lo++) {
        route_to(lo ? "lo" : "eth0");
        ears_open(&ears);
        for (int ttl = 0; ttl < 2; ttl++) {
            snprintf(command, sizeof command,
                     "%s/venv-lcm/bin/python -c \"import lcm; c = lcm.LCM('" URL "?ttl=%d'); "
                     "c.publish('T.\xc3\xa4_COMMAND', b'abc'); c.publish('A' * 63, b'foreign')\"",
                     build_folder(), ttl);
            run(command);
            expect(&ears, 1 + (uint32_t)ttl, 0);
        }
        ears_close(&ears);
    }
    route_to("eth0");
}

/* ---- what is no message ---------------------------------------------------------------------- */

static void test_names_and_lengths_are_exact(void **state)
{
    static const char longest[] = "A_CHANNEL_WHOSE_NAME_HAS_ALL_OF_THE_63_LETTERS_THAT_LCM_ALLOWS_";
    static const char *const foreign[] = {"", "B", "AB", "a", "T.\xc3\xa4_COMMANDS", "TX_COMMAND"};
    uint8_t packet[1400];
    struct ear ear;
    (void)state;
    ear_open(&ear, "loopback");
    for (size_t i = 0; i < sizeof foreign / sizeof foreign[0]; i++)
        send_raw(packet, packet_make(packet, "LC02", foreign[i], 3), GROUP, 0);
    for (size_t bytes = 0; bytes < 10; bytes++)
        send_raw("LC02\0\0\0\0A", bytes, GROUP, 0); /* cut: the last lacks its zero only */
    const uint64_t filtered = sizeof foreign / sizeof foreign[0] + 9;
    send_raw(packet, packet_make(packet, "LC02", "A", 0), GROUP, 0);
    send_raw(packet, packet_make(packet, "LC02", "A", 100), GROUP, 0);
    send_raw(packet, packet_make(packet, "LC02", "A", 101), GROUP, 0);
    send_raw(packet, packet_make(packet, "LC02", "A", 1390), GROUP, 0);
    send_raw(packet, packet_make(packet, "LC02", longest, 1000), GROUP, 0);
    send_raw(packet, packet_make(packet, "LC02", longest, 1001), GROUP, 0);
    hear_host(&ear, 3);
    assert_int_equal(await_dropped(&ear, FV_DROP_LONG, 3), 3);
    assert_int_equal(await_dropped(&ear, FV_DROP_KERNEL, filtered + 1), filtered + 1);
    assert_int_equal(ear.host, 3);
    assert_int_equal(ear.last_bytes, 1000);
    ear_close(&ear);
}

/* The packets that end a program with liblcm 1.3.1: the offset of a fragment near 2^32, in one
 * packet and in two; and a first fragment of a message that says it has 256 MB. */
static size_t fragment_make(uint8_t packet[1400], uint32_t total, uint32_t offset, uint16_t number,
                            uint16_t count)
{
    const uint32_t header[] = {htonl(0x4c433033), htonl(7), htonl(total), htonl(offset)};
    const uint16_t numbers[] = {htons(number), htons(count)};
    memset(packet, 'x', 1400);
    memcpy(packet, header, sizeof header);
    memcpy(packet + 16, numbers, sizeof numbers);
    if (number > 0) return 100;
    memcpy(packet + 20, "A", 2);
    return 100;
}

static void send_fragments(const char *to, bool from_here)
{
    static const struct {
        uint32_t total, offset;
        uint16_t number, count;
    } fragments[] = {
        {100, 0xffffffc0, 0, 2}, {200, 0, 0, 3},          {200, 0xffffffb0, 1, 3},
        {100, 0xfffffff0, 0, 1}, {268435456, 0, 0, 5000}, {0xffffffff, 0, 0, 65535},
    };
    uint8_t packet[1400];
    for (size_t i = 0; i < sizeof fragments / sizeof fragments[0]; i++) {
        const size_t bytes = fragment_make(packet, fragments[i].total, fragments[i].offset,
                                           fragments[i].number, fragments[i].count);
        if (from_here)
            send_raw(packet, bytes, to, 0);
        else
            two_hosts_send(&(struct two_hosts_packet){TWO_HOSTS_OTHER, to, PORT, 1, packet, bytes});
    }
}

static uint64_t resident_bytes(void)
{
    char text[4096];
    const int file = open("/proc/self/smaps_rollup", O_RDONLY);
    const ssize_t bytes = file < 0 ? 0 : read(file, text, sizeof text - 1);
    if (file >= 0) close(file);
    text[bytes > 0 ? bytes : 0] = '\0';
    const char *rss = strstr(text, "\nRss:");
    return rss != NULL ? strtoull(rss + 5, NULL, 10) * 1024 : 0;
}

/* In a process that may have no more memory than it has. */
static void test_fragments_are_dropped_without_memory(void **state)
{
    (void)state;
    const pid_t child = fork();
    if (child == 0) {
        const struct rlimit none = {0, 0};
        struct ear ear;
        ear_open(&ear, "any");
#if !defined(FOVEA_SANITIZED)
        if (setrlimit(RLIMIT_AS, &none) != 0) _exit(2); /* ulimit -v 0: not a page more */
#else
        (void)none;
#endif
        for (int i = 0; i < 20; i++) {
            send_fragments(GROUP, true);
            send_fragments(TWO_HOSTS_HERE, true);
            send_fragments(GROUP, false);
            send_fragments(TWO_HOSTS_HERE, false);
            hear(&ear);
        }
        if (await_dropped(&ear, FV_DROP_KERNEL, 2 * 20 * 6) < 2 * 20 * 6) _exit(4);
        if (ear.host + ear.network != 0) _exit(3);
        send_here(GROUP, 0);
        hear_host(&ear, 1);
        _exit(ear.host == 1 ? 0 : 5);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
}

static void flood(struct ear *ear, int packets)
{
    const uint32_t before = ear->host;
    uint8_t packet[1400];
    for (int i = 0; i < packets; i++) {
        const size_t bytes = i % 4 == 3 ? fragment_make(packet, 1u << 28, 0, 0, 5000)
                                        : packet_make(packet, "LC02", i % 4 == 2 ? "B" : "A",
                                                      i % 4 == 1 ? 1000 : 50);
        send_raw(packet, bytes, GROUP, 0);
        if (i % 16 == 0) hear_host(ear, before + (uint32_t)i / 4 + 1); /* each fourth is heard */
    }
    hear_host(ear, before + (uint32_t)packets / 4);
    hear(ear);
}

static void test_a_flood_takes_no_memory(void **state)
{
    struct ear ear;
    (void)state;
    ear_open(&ear, "any");
    flood(&ear, 2000);
    const uint64_t before = resident_bytes();
    const uint32_t heard = ear.host;
    flood(&ear, 40000);
    assert_true(before > 0 || access("/proc/self/smaps_rollup", R_OK) != 0);
#if !defined(FOVEA_SANITIZED) /* sanitizers have memory of their own */
    assert_int_equal(resident_bytes(), before);
#endif
    assert_int_equal(ear.host - heard, 10000);
    ear_close(&ear);
}

/* ---- what is not heard at all ---------------------------------------------------------------- */

static void test_nothing_is_opened_where_nothing_is_to_be_heard(void **state)
{
    static const char *const urls[] = {"memq://", "file:///tmp/x?mode=w"};
    struct fv_receiver *receiver;
    struct fovea_error error;
    (void)state;
    const struct fv_receiver_setup none = {.url = URL, .listen = "none"};
    assert_int_equal(fv_receiver_open(&none, &receiver, &error), FOVEA_OK);
    assert_null(receiver);
    for (int i = 0; i < 2; i++) {
        const struct fv_receiver_setup setup = {.url = urls[i], .listen = "any"};
        assert_int_equal(fv_receiver_open(&setup, &receiver, &error), FOVEA_OK);
        assert_null(receiver);
    }
    const struct fv_receiver_setup wrong = {.url = URL, .listen = "a name that is too long"};
    assert_int_equal(fv_receiver_open(&wrong, &receiver, &error), FOVEA_ERROR_INPUT);
}

int main(void)
{
    if (getenv("FOVEA_EMULATED") != NULL || !two_hosts_enter()) {
        printf("SKIPPED test_receiver: no two network namespaces here, or no program ip\n");
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_this_host_is_heard_wherever_the_route_leads),
        cmocka_unit_test(test_others_are_heard_only_where_asked_for),
        cmocka_unit_test(test_a_spoofed_own_address_is_of_the_network),
        cmocka_unit_test(test_unicast_reaches_nobody),
        cmocka_unit_test(test_memberships_follow_routes_and_interfaces),
        cmocka_unit_test(test_an_interface_is_made_again),
        cmocka_unit_test(test_an_interface_may_come_later),
        cmocka_unit_test(test_programs_with_liblcm_are_heard),
        cmocka_unit_test(test_names_and_lengths_are_exact),
        cmocka_unit_test(test_fragments_are_dropped_without_memory),
        cmocka_unit_test(test_a_flood_takes_no_memory),
        cmocka_unit_test(test_nothing_is_opened_where_nothing_is_to_be_heard),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    two_hosts_leave();
    return failed;
}
