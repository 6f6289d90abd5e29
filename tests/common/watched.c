#include "common/watched.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/build_folder.h"
#include "common/own_network.h"

#include "fovea_preview_t.h"

enum { ARGUMENTS_MAX = 30, SILENCE_MS = 120000 };

static char program[1100];

static bool can_start_children(void)
{
    int status = 0;
    const pid_t child = fork();
    if (child == 0) {
        close(STDOUT_FILENO);
        close(STDERR_FILENO);
        execl(program, program, "nothing", (char *)NULL);
        _exit(127);
    }
    waitpid(child, &status, 0);
    return WIFEXITED(status) && WEXITSTATUS(status) == 2;
}

bool watched_possible(const char *test)
{
    snprintf(program, sizeof program, "%s/fovea", build_folder());
    const char *missing = !can_start_children() ? "programs of this architecture cannot be started"
                          : !own_network_enter() || !own_network_mend()
                              ? "no network namespace of its own"
                              : NULL;
    if (missing != NULL) printf("SKIPPED %s: %s\n", test, missing);
    return missing == NULL;
}

void watched_exec(const char *command, const char *const *arguments)
{
    const char *words[ARGUMENTS_MAX] = {program, command};
    for (int i = 0; arguments[i] != NULL; i++)
        words[2 + i] = arguments[i];
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    execv(program, (char *const *)(uintptr_t)words);
    _exit(127);
}

void watched_start(struct watched *watched, const char *command, const char *const *arguments)
{
    int ends[2];
    assert_int_equal(pipe(ends), 0);
    watched->begin = watched->end = 0;
    watched->process = fork();
    if (watched->process == 0) {
        dup2(ends[1], STDOUT_FILENO);
        close(ends[0]);
        close(ends[1]);
        watched_exec(command, arguments);
    }
    close(ends[1]);
    watched->output = ends[0];
}

bool watched_readable(struct watched *watched, int timeout_ms)
{
    struct pollfd wait = {.fd = watched->output, .events = POLLIN};
    return watched->begin < watched->end || poll(&wait, 1, timeout_ms) > 0;
}

bool watched_line(struct watched *watched, char *text, size_t bytes)
{
    size_t used = 0;
    while (used + 1 < bytes) {
        if (watched->begin == watched->end) {
            if (!watched_readable(watched, SILENCE_MS)) {
                kill(watched->process, SIGKILL);
                fail_msg("%s: nothing is printed, and it does not end", program);
            }
            const ssize_t got = read(watched->output, watched->kept, sizeof watched->kept);
            if (got < 0 && errno == EINTR) continue;
            if (got <= 0) break;
            watched->begin = 0;
            watched->end = (size_t)got;
        }
        text[used++] = watched->kept[watched->begin++];
        if (text[used - 1] == '\n') break;
    }
    text[used] = '\0';
    return used > 0;
}

void watched_interrupt(const struct watched *watched)
{
    assert_int_equal(kill(watched->process, SIGINT), 0);
}

int watched_end(struct watched *watched)
{
    int status = 0;
    char text[256];
    while (watched_line(watched, text, sizeof text))
        continue;
    close(watched->output);
    waitpid(watched->process, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

int watched_shell(const char *line, char *text, size_t bytes)
{
    char rest[4096];
    FILE *pipe = popen(line, "r");
    assert_non_null(pipe);
    text[fread(text, 1, bytes - 1, pipe)] = '\0';
    while (fread(rest, 1, sizeof rest, pipe) > 0) /* so that it does not end by a broken pipe */
        continue;
    const int status = pclose(pipe);
    return status >= 0 && (status & 127) == 0 ? status >> 8 : -1;
}

void watched_remove(const char *folder)
{
    char line[512], text[512];
    snprintf(line, sizeof line, "rm -r %s 2>&1", folder);
    if (watched_shell(line, text, sizeof text) != 0) fail_msg("%s", text);
}

void watched_send(const char *channel, const uint8_t *data, size_t bytes)
{
    static uint8_t packet[1 << 16];
    const size_t head = 8 + strlen(channel) + 1;
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(7667)};
    const unsigned char ttl = 0;
    inet_pton(AF_INET, "239.255.76.67", &to.sin_addr);
    memcpy(packet, "LC02\0\0\0\0", 8);
    memcpy(packet + 8, channel, strlen(channel) + 1);
    memcpy(packet + head, data, bytes);
    const int udp = socket(AF_INET, SOCK_DGRAM, 0);
    assert_int_equal(setsockopt(udp, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl), 0);
    assert_int_equal(sendto(udp, packet, head + bytes, 0, (const struct sockaddr *)&to, sizeof to),
                     head + bytes);
    close(udp);
}

void watched_wait_until_read(void)
{
    unsigned waiting = 1;
    for (int i = 0; i < 60000 && waiting > 0; i++) {
        char line[256];
        FILE *sockets = fopen("/proc/net/udp", "r");
        assert_non_null(sockets);
        waiting = 0;
        while (fgets(line, sizeof line, sockets) != NULL) {
            unsigned port, bytes;
            if (sscanf(line, " %*d: %*x:%x %*x:%*x %*x %*x:%x", &port, &bytes) == 2 && port == 7667)
                waiting += bytes;
        }
        fclose(sockets);
        if (waiting > 0) usleep(1000);
    }
    assert_int_equal(waiting, 0);
}

size_t watched_largest(uint8_t *data, size_t capacity)
{
    static uint8_t bytes[64000];
    fovea_preview_t preview;
    memset(&preview, 0, sizeof preview);
    memset(bytes, 200, sizeof bytes);
    preview.size_bytes = sizeof bytes;
    preview.jpeg = bytes;
    const int used = fovea_preview_t_encode(data, 0, (int)capacity, &preview);
    assert_true(used > 0);
    return (size_t)used;
}
