/* Sending over links that are slow, down, forbidden or stuck. The loop's side never waits, every
 * message is either sent or counted as dropped, and what counts as sent arrives.
 *
 * Two networks of the test's own, joined by a pair of virtual cables: this process sends in one, a
 * child counts what comes in the other. FOVEA_LONG=SECONDS: as long, and the latency is judged. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <arpa/inet.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/network/transport.h"
#include "common/no_system_calls.h"
#include "common/own_network.h"
#include "common/patience.h"
#include "../../drivers/clock.h"
#include "image/jpeg.h"
#include "message/message.h"

#include "fovea_preview_t.h"

#define GROUP "239.255.76.67"
#define URL "udpm://" GROUP ":7667"

enum { RATE_HZ = 30, WIDTH = 376, HEIGHT = 240, POSES_MAX = 1 << 16, KINDS = 7 };

static const char *const channels[KINDS] = {
    "FOVEA_POSE",    "FOVEA_CAMERA_POSE",   "FOVEA_FEATURES",  "FOVEA_MAP",
    "FOVEA_PREVIEW", "FOVEA_CAMERA_STATUS", "FOVEA_STATISTICS"};
enum { POSE = 0, CAMERA_POSE = 1, FEATURES = 2, MAP = 3, PREVIEW = 4, STATUS = 5, STATISTICS = 6 };
static const uint32_t sizes[KINDS] = {386, 389, 14054, 5400, 0, 109, 502};

/* What the child hears; shared. */
static struct heard {
    _Atomic uint64_t messages[KINDS], preview_bytes, damaged;
    _Atomic uint32_t poses;
    int64_t latency_ns[POSES_MAX];
    _Atomic int64_t previews_at_ns[1 << 12];
} * heard;

static pid_t child;

static void sleep_ms(int64_t ms)
{
    const struct timespec pause = fv_clock_timespec(ms * 1000000);
    nanosleep(&pause, NULL);
}

static bool command(const char *text)
{
    return system(text) == 0;
}

/* ---- the other end --------------------------------------------------------------------------- */

static void hear_preview(const uint8_t *data, size_t bytes)
{
    fovea_preview_t preview;
    if (fovea_preview_t_decode(data, 0, (int)bytes, &preview) < 0) {
        heard->damaged++;
        return;
    }
    const uint8_t *jpeg = preview.jpeg;
    const int32_t size = preview.size_bytes;
    if (size < 4 || jpeg[0] != 0xff || jpeg[1] != 0xd8 || jpeg[size - 2] != 0xff ||
        jpeg[size - 1] != 0xd9 || preview.width * preview.scale < WIDTH)
        heard->damaged++;
    heard->preview_bytes += (uint64_t)size;
    heard->previews_at_ns[heard->messages[PREVIEW] % (1 << 12)] = fv_clock_ns(CLOCK_MONOTONIC);
    fovea_preview_t_decode_cleanup(&preview);
}

static void hear(const uint8_t *datagram, size_t bytes)
{
    int kind = 0;
    if (bytes < 9 || memcmp(datagram, "LC02", 4) != 0) return;
    const char *channel = (const char *)datagram + 8;
    const size_t named = strnlen(channel, bytes - 8) + 1;
    while (kind < KINDS && strcmp(channel, channels[kind]) != 0)
        kind++;
    if (kind == KINDS) return;
    const uint8_t *data = datagram + 8 + named;
    if (kind != PREVIEW && bytes - 8 - named != sizes[kind]) heard->damaged++;
    if (kind == PREVIEW) hear_preview(data, bytes - 8 - named);
    if (kind == POSE && heard->poses < POSES_MAX) {
        int64_t put_ns;
        memcpy(&put_ns, data, sizeof put_ns);
        heard->latency_ns[heard->poses++] = fv_clock_ns(CLOCK_MONOTONIC) - put_ns;
    }
    heard->messages[kind]++;
}

/* In the child: a network of its own, then whatever comes, until killed. */
static void listen_there(int from_parent, int to_parent)
{
    static uint8_t datagram[1 << 16];
    char byte = unshare(CLONE_NEWNET) == 0 ? 'y' : 'n';
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (write(to_parent, &byte, 1) != 1 || read(from_parent, &byte, 1) != 1) _exit(1);
    if (!command("ip link set lo up && ip addr add 10.77.0.2/24 dev v1 && ip link set v1 up"))
        _exit(1);
    const int receiver = own_network_receiver(GROUP, 7667, "10.77.0.2");
    byte = receiver >= 0 ? 'y' : 'n';
    if (write(to_parent, &byte, 1) != 1) _exit(1);
    for (;;) {
        const ssize_t got = recv(receiver, datagram, sizeof datagram, 0);
        if (got > 0) hear(datagram, (size_t)got);
    }
}

static bool route_here(void)
{
    return command("ip link set v0 up && ip route replace 224.0.0.0/4 dev v0");
}

/* Both networks and the child. False: not permitted here, or no program ip or tc. */
static bool join_networks(void)
{
    int there[2], back[2];
    char text[256], byte = 'n';
    if (!command("command -v ip >/dev/null && command -v tc >/dev/null") || !own_network_enter() ||
        pipe(there) != 0 || pipe(back) != 0)
        return false;
    heard = mmap(NULL, sizeof *heard, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    child = fork();
    if (child == 0) listen_there(there[0], back[1]);
    if (read(back[0], &byte, 1) != 1 || byte != 'y') return false;
    snprintf(text, sizeof text,
             "ip link set lo up && ip link add v0 type veth peer name v1 netns %ld && "
             "ip addr add 10.77.0.1/24 dev v0",
             (long)child);
    if (!command(text) || !route_here()) return false;
    return write(there[1], "g", 1) == 1 && read(back[0], &byte, 1) == 1 && byte == 'y';
}

/* ---- this end: a loop ------------------------------------------------------------------------ */

struct sending {
    struct fv_transport *transport;
    int iterations;
    int64_t late_ns;            /* the loop itself, at most: a busy machine */
    int64_t longest_ns, cpu_ns; /* of the hand-overs: the longest, all together */
    bool filtered;              /* no system call but sleeping was permitted */
};

static uint8_t data[KINDS][60000];
static uint32_t preview_bytes;

/* A picture of noise: as large as previews come. */
static void make_preview(void)
{
    static uint8_t pixels[WIDTH * HEIGHT], jpeg[2 * WIDTH * HEIGHT];
    const struct fv_plane plane = {pixels, WIDTH, HEIGHT, WIDTH};
    struct fv_jpeg encoder;
    uint32_t noise = 1;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        pixels[i] = (uint8_t)(((noise = noise * 1664525u + 1013904223u) >> 27) + (uint32_t)i % 97);
    fv_jpeg_start(&encoder, WIDTH, HEIGHT, 70, jpeg, sizeof jpeg);
    while (!fv_jpeg_encode(&encoder, &plane, 64, jpeg))
        ;
    const struct fv_message_preview message = {.width = WIDTH,
                                               .height = HEIGHT,
                                               .scale = 2.0,
                                               .jpeg = jpeg,
                                               .jpeg_bytes = (uint32_t)encoder.used};
    preview_bytes = fv_message_preview_encode(&message, data[PREVIEW], sizeof data[PREVIEW]);
    assert_true(preview_bytes > 15000);
}

static void add(struct fovea_outputs *outputs, int kind)
{
    outputs->messages[outputs->message_count++] =
        (struct fovea_message){.channel = channels[kind],
                               .data = data[kind],
                               .bytes = kind == PREVIEW ? preview_bytes : sizes[kind]};
}

static void iteration(struct sending *sending, int i)
{
    struct fovea_outputs outputs = {0};
    const int64_t begin_ns = fv_clock_ns(CLOCK_MONOTONIC);
    const int64_t cpu_ns = fv_clock_ns(CLOCK_THREAD_CPUTIME_ID);
    memcpy(data[POSE], &begin_ns, sizeof begin_ns);
    add(&outputs, POSE);
    add(&outputs, CAMERA_POSE);
    add(&outputs, FEATURES);
    if (i % 5 == 0) add(&outputs, MAP);
    add(&outputs, STATUS);
    if (i % 30 == 0) add(&outputs, STATISTICS);
    if (i % 10 == 0) add(&outputs, PREVIEW);
    fv_transport_publish(sending->transport, &outputs);
    const int64_t took_ns = fv_clock_ns(CLOCK_MONOTONIC) - begin_ns;
    sending->cpu_ns += fv_clock_ns(CLOCK_THREAD_CPUTIME_ID) - cpu_ns;
    if (took_ns > sending->longest_ns) sending->longest_ns = took_ns;
}

static void *loop(void *context)
{
    struct sending *sending = context;
    struct timespec due;
    sending->filtered = no_system_calls();
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (int i = 0; i < sending->iterations; i++) {
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        const int64_t late_ns = fv_clock_ns(CLOCK_MONOTONIC) - fv_clock_from_timespec(due);
        if (late_ns > sending->late_ns) sending->late_ns = late_ns;
        iteration(sending, i);
        /* A camera makes up for nothing, either. */
        const int64_t next_ns = fv_clock_from_timespec(due) + FV_SECOND_NS / RATE_HZ,
                      now_ns = fv_clock_ns(CLOCK_MONOTONIC);
        due = fv_clock_timespec(next_ns > now_ns ? next_ns : now_ns);
    }
    return NULL;
}

static void start(struct sending *sending, const char *url, int iterations)
{
    struct fovea_error error;
    *sending = (struct sending){.iterations = iterations};
    memset(heard, 0, sizeof *heard);
    if (fv_transport_open(url, 1, &sending->transport, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
}

static void run(struct sending *sending)
{
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, loop, sending), 0);
    pthread_join(thread, NULL);
    if (!sending->filtered) print_message("SKIPPED the proof of no system call: no seccomp here\n");
}

/* ---- what came of it ------------------------------------------------------------------------- */

static uint64_t dropped(const struct fv_transport_channel *channel)
{
    uint64_t all = 0;
    for (int i = 0; i < FV_TRANSPORT_DROPS; i++)
        all += channel->dropped[i];
    return all;
}

static const struct fv_transport_channel *find(const struct fv_transport_sent *sent, int kind)
{
    for (uint32_t i = 0; i < sent->count; i++)
        if (strcmp(sent->channels[i].name, channels[kind]) == 0) return &sent->channels[i];
    fail_msg("%s: not offered", channels[kind]);
    return NULL;
}

/* All messages that arrived. */
static uint64_t arrived(void)
{
    uint64_t all = 0;
    for (int kind = 0; kind < KINDS; kind++)
        all += heard->messages[kind];
    return all;
}

/* Bytes that wait for the child to read them. */
static unsigned long unread(void)
{
    char path[64], line[256];
    unsigned long waiting = 0;
    snprintf(path, sizeof path, "/proc/%d/net/udp", (int)child);
    FILE *sockets = fopen(path, "r");
    assert_non_null(sockets);
    while (fgets(line, sizeof line, sockets) != NULL) {
        unsigned port;
        unsigned long bytes;
        if (sscanf(line, " %*d: %*x:%x %*x:%*x %*x %*x:%lx", &port, &bytes) == 2 && port == 7667)
            waiting += bytes;
    }
    fclose(sockets);
    return waiting;
}

static void finish(struct fv_transport *transport, struct fv_transport_sent *sent)
{
    uint64_t before;
    int64_t end_ns = 0;
    fv_transport_finish(transport);
    fv_transport_sent(transport, sent);
    do /* until nothing more comes */
        before = arrived();
    while (fv_test_patient(&end_ns, 300) && (arrived() != before || unread() > 0));
    for (uint32_t i = 0; i < sent->count; i++) {
        const struct fv_transport_channel *channel = &sent->channels[i];
        assert_int_equal(channel->offered, channel->sent + dropped(channel));
    }
}

static int by_size(const void *a, const void *b)
{
    const int64_t first = *(const int64_t *)a, second = *(const int64_t *)b;
    return (first > second) - (first < second);
}

static int64_t percentile_ns(double fraction)
{
    const uint32_t count = heard->poses;
    qsort(heard->latency_ns, count, sizeof heard->latency_ns[0], by_size);
    return count > 0 ? heard->latency_ns[(uint32_t)(fraction * (double)(count - 1))] : 0;
}

static double seconds_between_previews(void)
{
    int64_t longest = 0;
    for (uint64_t i = 1; i < heard->messages[PREVIEW] && i < (1 << 12); i++) {
        const int64_t gap = heard->previews_at_ns[i] - heard->previews_at_ns[i - 1];
        if (gap > longest) longest = gap;
    }
    return (double)longest * 1e-9;
}

static int long_seconds(void)
{
    const char *text = getenv("FOVEA_LONG");
    return text != NULL ? atoi(text) : 0;
}

static void slow_link(const char *shape)
{
    char text[256];
    struct sending sending;
    struct fv_transport_sent sent;
    const int seconds = long_seconds() > 0 ? long_seconds() : 4;
    snprintf(text, sizeof text, "tc qdisc replace dev v0 root tbf rate 1mbit burst 4kb %s", shape);
    assert_true(command(text));
    start(&sending, URL, seconds * RATE_HZ);
    run(&sending);
    finish(sending.transport, &sent);
    uint64_t all = 0;
    for (int kind = 0; kind < KINDS; kind++)
        all += find(&sent, kind)->sent;
    int64_t end_ns = 0;
    while (arrived() < all && fv_test_patient(&end_ns, 10)) {
    }
    assert_true(command("tc qdisc del dev v0 root"));
    for (int kind = 0; kind < KINDS; kind++) { /* what is counted as sent arrived, whole */
        const struct fv_transport_channel *channel = find(&sent, kind);
        print_message("  %-20s offered %5d sent %5d arrived %5d\n", channel->name,
                      (int)channel->offered, (int)channel->sent, (int)heard->messages[kind]);
        assert_int_equal(heard->messages[kind], channel->sent);
    }
    fv_transport_tell(stdout, sending.transport);
    fv_transport_close(sending.transport);
    assert_int_equal(heard->damaged, 0);
    assert_int_equal(heard->messages[POSE], sending.iterations);
    assert_int_equal(heard->messages[CAMERA_POSE], sending.iterations);
    assert_int_equal(heard->messages[STATUS], sending.iterations);
    assert_true(heard->messages[PREVIEW] >= (uint64_t)(seconds + 4) / 5);
    print_message(
        "  %s: pose p50 %.1f ms p99 %.1f ms max %.1f ms; hand-over %.3f ms mean CPU, "
        "%.3f ms longest wall; previews of %d bytes, at most %.1f s apart; loop late by "
        "%.1f ms at most\n",
        shape, (double)percentile_ns(0.5) * 1e-6, (double)percentile_ns(0.99) * 1e-6,
        (double)percentile_ns(1) * 1e-6, (double)sending.cpu_ns * 1e-6 / sending.iterations,
        (double)sending.longest_ns * 1e-6, (int)(heard->preview_bytes / heard->messages[PREVIEW]),
        seconds_between_previews(), (double)sending.late_ns * 1e-6);
    if (long_seconds() == 0) return;
    assert_true(percentile_ns(0.99) < 100000000);
    assert_true(seconds_between_previews() < 5.0);
}

static void every_pose_passes_a_slow_link_with_a_short_queue(void **state)
{
    (void)state;
    slow_link("latency 400ms");
}

static void every_pose_passes_a_slow_link_with_a_long_queue(void **state)
{
    (void)state;
    slow_link("limit 1000000");
}

/* ---- links that do not work ------------------------------------------------------------------ */

/* One iteration after the other until the child has heard a pose that was sent after `from`. */
static void send_until_heard(struct sending *sending)
{
    const uint64_t before = heard->messages[POSE];
    int64_t end_ns = 0;
    for (int i = 1; heard->messages[POSE] < before + 3 && fv_test_patient(&end_ns, 20); i++)
        iteration(sending, i);
    assert_true(heard->messages[POSE] >= before + 3);
}

static void expect_drops(struct sending *sending, enum fv_transport_drop reason)
{
    struct fv_transport_sent sent;
    uint64_t counted = 0;
    int64_t end_ns = 0;
    for (int i = 1; counted < 10 && fv_test_patient(&end_ns, 5); i++) {
        iteration(sending, i);
        fv_transport_sent(sending->transport, &sent);
        counted = find(&sent, POSE)->dropped[reason];
    }
    assert_true(counted >= 10);
}

static void an_interface_goes_down_and_comes_back(void **state)
{
    (void)state;
    struct sending sending;
    struct fv_transport_sent sent;
    start(&sending, URL, 0);
    send_until_heard(&sending);
    assert_true(command("ip link set v0 down"));
    expect_drops(&sending, FV_TRANSPORT_DROP_ROUTE);
    assert_true(route_here());
    send_until_heard(&sending);
    assert_true(command("ip route del 224.0.0.0/4"));
    expect_drops(&sending, FV_TRANSPORT_DROP_ROUTE);
    assert_true(route_here());
    send_until_heard(&sending);
    finish(sending.transport, &sent);
    fv_transport_close(sending.transport);
}

static void a_firewall_is_counted(void **state)
{
    (void)state;
    struct sending sending;
    struct fv_transport_sent sent;
    if (!command("iptables -A OUTPUT -p udp -d " GROUP " -j DROP 2>/dev/null")) {
        print_message("SKIPPED a_firewall_is_counted: no iptables here\n");
        skip();
    }
    start(&sending, URL, 0);
    expect_drops(&sending, FV_TRANSPORT_DROP_FIREWALL);
    assert_true(command("iptables -F OUTPUT"));
    send_until_heard(&sending);
    finish(sending.transport, &sent);
    fv_transport_close(sending.transport);
}

/* A full queue that is not ours: another program's flood. Linux would report what it drops as sent.
 */
static void a_full_queue_is_not_counted_as_sent(void **state)
{
    (void)state;
    struct sending sending;
    struct fv_transport_sent sent;
    assert_true(command("tc qdisc replace dev v0 root tbf rate 8kbit burst 2kb limit 3000"));
    start(&sending, URL, RATE_HZ * 2);
    run(&sending);
    finish(sending.transport, &sent);
    assert_true(command("tc qdisc del dev v0 root"));
    assert_true(find(&sent, POSE)->dropped[FV_TRANSPORT_DROP_QUEUE] > 0);
    assert_true(heard->messages[POSE] <= find(&sent, POSE)->sent);
    fv_transport_close(sending.transport);
}

/* ---- a server that stops reading ------------------------------------------------------------- */

static int server_open(char url[64])
{
    const int made = socket(AF_INET, SOCK_STREAM, 0);
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    assert_int_equal(bind(made, (struct sockaddr *)&address, sizeof address), 0);
    assert_int_equal(listen(made, 4), 0);
    assert_int_equal(getsockname(made, (struct sockaddr *)&address, &size), 0);
    snprintf(url, 64, "tcpq://127.0.0.1:%d", ntohs(address.sin_port));
    return made;
}

/* A loop goes on until there is something to read. */
static void await(int descriptor, struct sending *sending)
{
    struct pollfd wait = {.fd = descriptor, .events = POLLIN};
    int64_t end_ns = 0;
    for (int i = 1; poll(&wait, 1, 10) == 0 && fv_test_patient(&end_ns, 0); i++)
        iteration(sending, i);
    assert_true(wait.revents != 0);
}

/* Take connections until one says something (the check of the URL makes one that does not), and
 * answer. */
static int server_greet(int server, struct sending *sending)
{
    static const uint8_t hello[] = {0x28, 0x76, 0x17, 0xfa, 0, 0, 1, 0};
    static const uint8_t client[] = {0x28, 0x76, 0x17, 0xfb, 0, 0, 1, 0};
    uint8_t said[sizeof client];
    for (;;) {
        await(server, sending);
        const int peer = accept(server, NULL, NULL);
        assert_true(peer >= 0);
        await(peer, sending);
        if (recv(peer, said, sizeof said, MSG_WAITALL) == (ssize_t)sizeof said) {
            assert_memory_equal(said, client, sizeof said);
            assert_int_equal(send(peer, hello, sizeof hello, 0), sizeof hello);
            return peer;
        }
        close(peer);
    }
}

static void take(int peer, void *bytes, size_t count)
{
    assert_int_equal(recv(peer, bytes, count, MSG_WAITALL), count);
}

/* The next message must be one of ours, whole. */
static void take_message(int peer)
{
    static uint8_t body[1 << 16];
    uint32_t head[2], length;
    take(peer, head, sizeof head);
    assert_int_equal(ntohl(head[0]), 1);
    assert_true(ntohl(head[1]) < 64);
    take(peer, body, ntohl(head[1]));
    take(peer, &length, sizeof length);
    assert_true(ntohl(length) <= sizeof body);
    take(peer, body, ntohl(length));
}

static void a_server_that_stops_reading_stops_nothing(void **state)
{
    (void)state;
    char url[64];
    struct sending sending;
    struct fv_transport_sent sent;
    const int server = server_open(url);
    start(&sending, url, 0);
    const int peer = server_greet(server, &sending);
    for (int i = 0; i < 20; i++) {
        iteration(&sending, i);
        sleep_ms(2);
    }
    for (int i = 0; i < 30; i++)
        take_message(peer);
    for (int i = 0; i < 1500; i++) { /* 22 MB, more than the kernel holds for a connection */
        iteration(&sending, i);
        if (i % 2 == 0) sleep_ms(1);
    }
    fv_transport_sent(sending.transport, &sent);
    assert_true(dropped(find(&sent, FEATURES)) > 0);
    close(peer); /* it is connected to again */
    const int again = server_greet(server, &sending);
    for (int i = 0; i < 20; i++) {
        iteration(&sending, i);
        sleep_ms(2);
    }
    take_message(again);
    fv_transport_finish(sending.transport);
    fv_transport_sent(sending.transport, &sent);
    for (uint32_t i = 0; i < sent.count; i++)
        assert_int_equal(sent.channels[i].offered,
                         sent.channels[i].sent + dropped(&sent.channels[i]));
    fv_transport_close(sending.transport);
    close(again);
    close(server);
}

int main(void)
{
    if (getenv("FOVEA_EMULATED") != NULL || geteuid() != 0 || !join_networks()) {
        printf("SKIPPED test_sending: no networks of its own (root, ip and tc make them)\n");
        if (child > 0) kill(child, SIGKILL);
        return 0;
    }
    fv_message_prepare();
    make_preview();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_pose_passes_a_slow_link_with_a_short_queue),
        cmocka_unit_test(every_pose_passes_a_slow_link_with_a_long_queue),
        cmocka_unit_test(an_interface_goes_down_and_comes_back),
        cmocka_unit_test(a_firewall_is_counted),
        cmocka_unit_test(a_full_queue_is_not_counted_as_sent),
        cmocka_unit_test(a_server_that_stops_reading_stops_nothing),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    kill(child, SIGKILL);
    return failed;
}
