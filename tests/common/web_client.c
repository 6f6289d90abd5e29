#include "common/web_client.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/build_folder.h"

static char program[1100];

bool web_possible(const char *test)
{
    snprintf(program, sizeof program, "%s/fovea-web", build_folder());
    if (access(program, X_OK) == 0) return true;
    printf("SKIPPED %s: fovea-web is not built (libwebsockets-dev)\n", test);
    return false;
}

static int connect_once(void)
{
    const struct sockaddr_in address = {.sin_family = AF_INET,
                                        .sin_port = htons(WEB_PORT),
                                        .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const struct timeval patience = {60, 0}; /* other programs may use the processor */
    const int made = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (made >= 0 && connect(made, (const struct sockaddr *)&address, sizeof address) == 0 &&
        setsockopt(made, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience) == 0 &&
        setsockopt(made, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience) == 0)
        return made;
    if (made >= 0) close(made);
    return -1;
}

pid_t web_start(const char *const *arguments)
{
    const char *words[32] = {program};
    for (int i = 0; arguments[i] != NULL && i < 30; i++)
        words[1 + i] = arguments[i];
    const pid_t process = fork();
    if (process == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        execv(program, (char *const *)(uintptr_t)words);
        _exit(127);
    }
    for (int i = 0; i < 6000 && waitpid(process, NULL, WNOHANG) == 0; i++) {
        const int probe = connect_once();
        if (probe >= 0) {
            close(probe);
            return process;
        }
        usleep(10000);
    }
    return -1;
}

int web_end(pid_t process, bool end)
{
    int status = 0;
    if (end) kill(process, SIGTERM);
    if (waitpid(process, &status, 0) != process) return -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

int web_connect(void)
{
    return connect_once();
}

bool web_send(int socket, const char *text)
{
    const size_t length = strlen(text);
    return send(socket, text, length, MSG_NOSIGNAL) == (ssize_t)length;
}

/* The whole answer as its head states it. */
static bool is_whole(const char *answer, size_t bytes)
{
    const char *end = strstr(answer, "\r\n\r\n"), *length = strcasestr(answer, "content-length:");
    if (end == NULL) return false;
    if (length == NULL || length > end)
        return strncmp(answer, "HTTP/1.1 101", 12) == 0 || strncmp(answer, "HTTP/1.1 304", 12) == 0;
    return bytes >= (size_t)(end + 4 - answer) + strtoul(length + 15, NULL, 10);
}

static int status_of(const char *answer)
{
    return strncmp(answer, "HTTP/1.", 7) == 0 ? (int)strtol(answer + 9, NULL, 10) : 0;
}

int web_ask(const char *request, char answer[WEB_ANSWER_BYTES])
{
    size_t got = 0;
    const int to = web_connect();
    answer[0] = '\0';
    if (to < 0) return 0;
    if (web_send(to, request)) {
        while (got < WEB_ANSWER_BYTES - 1 && !is_whole(answer, got)) {
            const ssize_t more = recv(to, answer + got, WEB_ANSWER_BYTES - 1 - got, 0);
            if (more <= 0) break;
            got += (size_t)more;
            answer[got] = '\0';
        }
    }
    close(to);
    return status_of(answer);
}

int web_get(const char *path, const char *headers, char answer[WEB_ANSWER_BYTES])
{
    char request[2048];
    snprintf(request, sizeof request, "GET %s HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n%s\r\n", path,
             WEB_PORT, headers);
    return web_ask(request, answer);
}

int web_open(const char *origin, const char *headers, int *socket)
{
    char both[1500];
    snprintf(both, sizeof both, "%s%s", origin, headers);
    return web_open_protocol("fovea", "/", both, socket);
}

int web_open_protocol(const char *protocol, const char *path, const char *headers, int *socket)
{
    char request[2048], answer[2048] = "";
    size_t got = 0;
    *socket = web_connect();
    if (*socket < 0) return 0;
    snprintf(
        request, sizeof request,
        "GET %s HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Protocol: %s\r\n%s\r\n",
        path, WEB_PORT, protocol, headers);
    if (web_send(*socket, request))
        while (got < sizeof answer - 1 && strstr(answer, "\r\n\r\n") == NULL &&
               recv(*socket, answer + got, 1, 0) == 1) /* what comes after is a frame's */
            answer[++got] = '\0';
    const int status = status_of(answer);
    if (status != 101) {
        close(*socket);
        *socket = -1;
    }
    return status;
}

bool web_say(int socket, const char *text)
{
    return web_say_frame(socket, 0x81, text, strlen(text));
}

bool web_say_frame(int socket, uint8_t first, const void *data, size_t bytes)
{
    uint8_t head[8] = {first, (uint8_t)(0x80 | bytes)}; /* the mask is 0 */
    size_t length = 6;
    if (bytes > UINT16_MAX) return false;
    if (bytes > 125) {
        head[1] = 0x80 | 126;
        head[2] = (uint8_t)(bytes >> 8);
        head[3] = (uint8_t)bytes;
        length = 8;
    }
    return send(socket, head, length, MSG_NOSIGNAL | MSG_MORE) == (ssize_t)length &&
           send(socket, data, bytes, MSG_NOSIGNAL) == (ssize_t)bytes;
}

int web_hear(int socket, uint8_t *data, size_t capacity, size_t *bytes)
{
    uint8_t head[2], more[8];
    if (recv(socket, head, 2, MSG_WAITALL) != 2) return -1;
    uint64_t length = head[1] & 127;
    const ssize_t wide = length == 126 ? 2 : length == 127 ? 8 : 0;
    if (wide > 0) {
        if (recv(socket, more, (size_t)wide, MSG_WAITALL) != wide) return -1;
        length = 0;
        for (ssize_t i = 0; i < wide; i++)
            length = length << 8 | more[i];
    }
    if (length > capacity ||
        (length > 0 && recv(socket, data, length, MSG_WAITALL) != (ssize_t)length))
        return -1;
    *bytes = length;
    if ((head[0] & 15) == 9) (void)web_say_frame(socket, 0x8a, data, length); /* it lives */
    return head[0] & 15;
}
