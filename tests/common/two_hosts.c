#include "common/two_hosts.h"

#include <arpa/inet.h>
#include <linux/if_packet.h>
#include <net/ethernet.h>
#include <net/if.h>
#include <netinet/ip.h>
#include <netinet/udp.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/own_network.h"

#define MAC_HERE "02:00:00:00:00:01"

static pid_t other = -1;
static int line = -1; /* to the other host: whole Ethernet frames, each answered by a byte */

static void run_other(int end)
{
    uint8_t frame[1600], done = 1;
    ssize_t bytes;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (unshare(CLONE_NEWNET) != 0 || write(end, &done, 1) != 1) _exit(1);
    if (read(end, &done, 1) != 1) _exit(1); /* eth0 is here now */
    if (system("ip link set lo up && ip addr add " TWO_HOSTS_OTHER
               "/24 dev eth0 && ip link set eth0 up") != 0)
        _exit(1);
    const int raw = socket(AF_PACKET, SOCK_RAW, 0);
    const struct sockaddr_ll eth0 = {.sll_family = AF_PACKET,
                                     .sll_protocol = htons(ETH_P_IP),
                                     .sll_ifindex = (int)if_nametoindex("eth0")};
    if (raw < 0 || write(end, &done, 1) != 1) _exit(1);
    while ((bytes = recv(end, frame, sizeof frame, 0)) > 0) {
        done = sendto(raw, frame, (size_t)bytes, 0, (const struct sockaddr *)&eth0, sizeof eth0) ==
               bytes;
        if (write(end, &done, 1) != 1) break;
    }
    _exit(0);
}

static bool join_hosts(void)
{
    char command[512];
    uint8_t ready;
    snprintf(command, sizeof command,
             "ip link set lo up && ip link add eth0 address " MAC_HERE
             " type veth peer name eth0 netns %ld && ip addr add " TWO_HOSTS_HERE
             "/24 dev eth0 && ip link set eth0 up && ip route add 224.0.0.0/4 dev eth0",
             (long)other);
    return read(line, &ready, 1) == 1 && system(command) == 0 && write(line, &ready, 1) == 1 &&
           read(line, &ready, 1) == 1;
}

bool two_hosts_enter(void)
{
    int ends[2];
    if (system("command -v ip >/dev/null") != 0 || !own_network_enter()) return false;
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) return false;
    other = fork();
    if (other == 0) {
        close(ends[0]);
        run_other(ends[1]);
    }
    close(ends[1]);
    line = ends[0];
    if (other > 0 && join_hosts()) return true;
    two_hosts_leave();
    return false;
}

static uint16_t checksum(const uint8_t *data, size_t bytes)
{
    uint32_t sum = 0;
    for (size_t i = 0; i < bytes; i += 2)
        sum += (uint32_t)data[i] << 8 | data[i + 1];
    while (sum >> 16)
        sum = (sum & 0xffff) + (sum >> 16);
    return (uint16_t)~sum;
}

void two_hosts_send(const struct two_hosts_packet *packet)
{
    uint8_t frame[1600] = {2, 0, 0, 0, 0, 1, 2, 0, 0, 0, 0, 2, 0x08, 0x00}, done = 0;
    const size_t udp_bytes = sizeof(struct udphdr) + packet->bytes;
    struct iphdr ip = {.version = 4, .ihl = 5, .ttl = packet->ttl, .protocol = IPPROTO_UDP};
    const struct udphdr udp = {.source = htons(4000),
                               .dest = htons(packet->port),
                               .len = htons((uint16_t)udp_bytes)}; /* no checksum */
    const size_t bytes = 14 + sizeof ip + udp_bytes;
    ip.tot_len = htons((uint16_t)(sizeof ip + udp_bytes));
    inet_pton(AF_INET, packet->from, &ip.saddr);
    inet_pton(AF_INET, packet->to, &ip.daddr);
    const uint8_t *group = (const uint8_t *)&ip.daddr;
    if (IN_MULTICAST(ntohl(ip.daddr)))
        memcpy(frame, (uint8_t[]){1, 0, 0x5e, group[1] & 0x7f, group[2], group[3]}, 6);
    memcpy(frame + 14, &ip, sizeof ip);
    ip.check = htons(checksum(frame + 14, sizeof ip));
    memcpy(frame + 14, &ip, sizeof ip);
    memcpy(frame + 14 + sizeof ip, &udp, sizeof udp);
    memcpy(frame + 14 + sizeof ip + sizeof udp, packet->data, packet->bytes);
    if (send(line, frame, bytes, 0) != (ssize_t)bytes || read(line, &done, 1) != 1 || !done) {
        fprintf(stderr, "two_hosts_send: failed\n");
        abort();
    }
}

void two_hosts_leave(void)
{
    if (line >= 0) close(line);
    if (other > 0) waitpid(other, NULL, 0);
    line = -1;
    other = -1;
}
