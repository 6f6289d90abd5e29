/* Mutated packets on every input from a network: each goes to the group of a network of the
 * program's own, where the runtime's listener and a viewer's receiver hear it, and, as part of a
 * server's stream, into the parser of tcpq. Meant for a build with sanitizers.
 *
 * Usage: packets COUNT. Exit 0 when all was taken or counted, a good command is still taken at the
 * end, and (without sanitizers) resident memory has not grown. */
#include <arpa/inet.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "app/network/receiver.h"
#include "app/network/receiver_tcpq.h"
#include "app/network/transport.h"
#include "common/own_network.h"

#include "bot_core_pose_t.h"
#include "fovea_command_t.h"
#include "fovea_features_t.h"

#define URL "udpm://239.255.76.67:7667"

enum { SEEDS = 6, PACKET_BYTES = 2048, BURST = 16 };

static struct {
    uint8_t data[PACKET_BYTES];
    size_t bytes;
} seeds[SEEDS];

static uint64_t state = 88172645463325252u, heard;

_Noreturn static void die(const char *what)
{
    fprintf(stderr, "packets: %s\n", what);
    exit(2);
}

static uint32_t next_random(void)
{
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (uint32_t)(state >> 16);
}

static size_t begin(int seed, const char *magic, const char *channel)
{
    const size_t name = strlen(channel) + 1;
    memcpy(seeds[seed].data, magic, 4);
    memcpy(seeds[seed].data + 8, channel, name);
    return 8 + name;
}

static void make_seeds(void)
{
    const fovea_command_t command = {.commands = FOVEA_COMMAND_T_PAUSE};
    const bot_core_pose_t pose = {.utime = 5, .orientation = {1}};
    fovea_features_t features;
    static uint8_t none[1]; /* memcpy wants an address also for no bytes */
    memset(&features, 0, sizeof features);
    features.method = (char *)"fast";
    features.level = none;
    size_t at = begin(0, "LC02", "T_COMMAND");
    seeds[0].bytes =
        at + (size_t)fovea_command_t_encode(seeds[0].data, (int)at, PACKET_BYTES, &command);
    at = begin(1, "LC02", "ODOM");
    seeds[1].bytes =
        at + (size_t)bot_core_pose_t_encode(seeds[1].data, (int)at, PACKET_BYTES, &pose);
    at = begin(2, "LC02", "T_FEATURES");
    const int bytes = fovea_features_t_encode(seeds[2].data, (int)at, PACKET_BYTES, &features);
    seeds[2].bytes = at + (bytes > 0 ? (size_t)bytes : 0);
    at = begin(3, "LC02", "T_ANY");
    seeds[3].bytes = at + 500;
    seeds[4].bytes = begin(4, "LC03", "") + 100;
    seeds[5].bytes = 40;
    for (int i = 0; i < SEEDS; i++)
        if (seeds[i].bytes < 10 || seeds[i].bytes > PACKET_BYTES) die("a seed cannot be made");
}

/* A seed with some bytes changed, cut or longer; one in 16 as it is. */
static size_t mutate(uint8_t packet[PACKET_BYTES])
{
    const uint32_t seed = next_random() % SEEDS, changes = next_random() % 16;
    size_t bytes = seeds[seed].bytes;
    memcpy(packet, seeds[seed].data, PACKET_BYTES);
    for (uint32_t i = 0; i < changes; i++) {
        static const uint8_t odd[] = {0, 1, 0x7f, 0x80, 0xff, 0xfe};
        const size_t at = next_random() % 4 == 0 ? next_random() % bytes
                                                 : bytes - 1 - next_random() % (bytes / 2);
        packet[at] = next_random() % 2 ? (uint8_t)next_random() : odd[next_random() % sizeof odd];
    }
    if (changes > 0 && next_random() % 8 == 0) bytes = next_random() % (PACKET_BYTES - 1) + 1;
    return bytes;
}

static void take(void *context, const struct fv_received *received)
{
    (void)context;
    for (uint32_t i = 0; i < received->bytes; i++)
        heard += received->data[i] & 1;
}

static void feed_stream(struct fv_receiver_table *table, const uint8_t *packet, size_t bytes)
{
    static struct fv_tcpq_stream stream;
    static uint8_t buffer[512];
    static bool open;
    static const uint8_t greeting[] = {0x28, 0x76, 0x17, 0xfa, 0, 0, 1, 0};
    uint32_t taken = 0;
    uint8_t head[12] = {0, 0, 0, 1, 0, 0, 0, 1, 'A', 0, 0, 0};
    if (!open) {
        fv_tcpq_begin(&stream, table, buffer, sizeof buffer);
        fv_tcpq_feed(&stream, greeting, sizeof greeting, &taken);
    }
    head[11] = (uint8_t)(bytes >> 8); /* the low byte comes from the packet: lengths that are off */
    open = fv_tcpq_feed(&stream, head, sizeof head, &taken) &&
           fv_tcpq_feed(&stream, packet, bytes, &taken);
}

static uint64_t resident_kb(void)
{
    char text[4096] = "";
    const int file = open("/proc/self/smaps_rollup", O_RDONLY);
    if (file < 0 || read(file, text, sizeof text - 1) < 0) return 0;
    close(file);
    const char *rss = strstr(text, "\nRss:");
    return rss != NULL ? strtoull(rss + 5, NULL, 10) : 0;
}

/* The bits of all commands that have come. */
static uint32_t commands_of(struct fv_transport *transport)
{
    struct fv_judged_command command;
    uint32_t bits = 0;
    while (fv_transport_command(transport, &command))
        bits |= command.bits;
    return bits;
}

static void drain(struct fv_transport *transport, struct fv_receiver *viewer)
{
    struct fovea_wheel_odometry_sample samples[64];
    while (fv_receiver_handle(viewer, 0) > 0)
        continue;
    (void)commands_of(transport);
    while (fv_transport_wheel_odometry(transport, samples, 64) > 0)
        continue;
}

static void flood(uint64_t count, int udp, const struct sockaddr_in *to,
                  struct fv_transport *transport, struct fv_receiver *viewer)
{
    static struct fv_receiver_table table = {
        .rows = {{.name = "A", .bytes_max = 400, .take = take}}, .count = 1};
    uint8_t packet[PACKET_BYTES];
    for (uint64_t i = 0; i < count; i++) {
        const size_t bytes = mutate(packet);
        sendto(udp, packet, bytes, 0, (const struct sockaddr *)to, sizeof *to);
        feed_stream(&table, packet, bytes);
        if (i % BURST == BURST - 1) drain(transport, viewer);
    }
}

/* Sends a good command until it is taken. */
static bool still_hears(int udp, const struct sockaddr_in *to, struct fv_transport *transport)
{
    const struct timespec pause = {.tv_nsec = 10000000};
    for (int i = 0; i < 500; i++) {
        (void)commands_of(transport);
        sendto(udp, seeds[0].data, seeds[0].bytes, 0, (const struct sockaddr *)to, sizeof *to);
        nanosleep(&pause, NULL);
        if (commands_of(transport) == FOVEA_COMMAND_PAUSE) return true;
    }
    return false;
}

int main(int argc, char **argv)
{
    const uint64_t count = argc == 2 ? strtoull(argv[1], NULL, 10) : 0;
    struct fovea_error error;
    struct fv_transport *transport;
    struct fv_receiver *viewer;
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(7667)};
    if (count == 0) die("usage: packets COUNT");
    if (!own_network_enter() || !own_network_mend()) die("no network of its own");
    const struct fv_transport_ears ears = {.listen = "any",
                                           .prefix = "T",
                                           .wheel_odometry_channel = "ODOM",
                                           .wheel_odometry_limits = {3, 6}};
    const struct fv_receiver_channel rows[] = {
        {.name = "T_FEATURES", .type = "fovea.features_t", .bytes_max = 1024, .take = take},
        {.name = "T_ANY", .bytes_max = 600, .take = take}};
    const struct fv_receiver_setup setup = {URL, "any", rows, 2};
    if (fv_transport_open(URL, 0, &transport, &error) != FOVEA_OK ||
        fv_transport_listen(transport, &ears, &error) != FOVEA_OK ||
        fv_receiver_open(&setup, &viewer, &error) != FOVEA_OK)
        die(error.text);
    make_seeds();
    inet_pton(AF_INET, "239.255.76.67", &to.sin_addr);
    const int udp = socket(AF_INET, SOCK_DGRAM, 0);
    flood(count / 20 + 1, udp, &to, transport, viewer);
    const uint64_t before = resident_kb();
    flood(count, udp, &to, transport, viewer);
    const uint64_t after = resident_kb();
    const bool hears = still_hears(udp, &to, transport);
    struct fv_transport_counts counts;
    fv_transport_counts(transport, &counts);
    printf("%" PRIu64 " packets: listener took %" PRIu64 ", commands %" PRIu64 " refused %" PRIu64
           ", wheel odometry %" PRIu64 " refused %" PRIu64 "; dropped",
           count, counts.received.taken, counts.commands, counts.commands_refused,
           counts.wheel_odometry, counts.wheel_odometry_refused);
    for (int i = 0; i < FV_DROP_COUNT; i++)
        printf(" %s %" PRIu64, fv_drop_name((enum fv_drop)i), counts.received.dropped[i]);
    printf("; resident %" PRIu64 " kB before, %" PRIu64 " after%s\n", before, after,
           hears ? "" : "; A GOOD COMMAND IS NO LONGER TAKEN");
    fv_receiver_close(viewer);
    fv_transport_close(transport);
#if defined(FOVEA_SANITIZED)
    return hears ? 0 : 1;
#else
    return hears && after == before ? 0 : 1;
#endif
}
