#include "app/network/transport_url.h"

#include <arpa/inet.h>
#include <errno.h>
#include <inttypes.h>
#include <netdb.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "support/text.h"

enum { ANSWER_MS = 2000 }; /* that a server has, when a connection is asked for */

static const char *const schemes[] = {
    [FV_TRANSPORT_UDPM] = "udpm://",
    [FV_TRANSPORT_TCPQ] = "tcpq://",
    [FV_TRANSPORT_FILE] = "file://",
    [FV_TRANSPORT_MEMQ] = "memq://",
};

enum fv_transport_kind fv_transport_kind_of(const char *url)
{
    for (int kind = 0; kind < FV_TRANSPORT_UNKNOWN; kind++)
        if (strncmp(url, schemes[kind], strlen(schemes[kind])) == 0)
            return (enum fv_transport_kind)kind;
    return FV_TRANSPORT_UNKNOWN;
}

/* ---- parts ----------------------------------------------------------------------------------- */

struct parts {
    char host[256]; /* or the path of a file */
    char port[16];
    const char *query; /* after '?'; "" */
};

static bool split(const char *url, enum fv_transport_kind kind, struct parts *parts)
{
    const char *at = url + strlen(schemes[kind]);
    size_t length = strcspn(at, kind == FV_TRANSPORT_FILE ? "?" : ":?"), port = 0;
    *parts = (struct parts){.query = ""};
    if (length >= sizeof parts->host) return false;
    memcpy(parts->host, at, length);
    at += length;
    if (*at == ':') {
        port = strcspn(++at, "?");
        if (port == 0 || port >= sizeof parts->port) return false;
        memcpy(parts->port, at, port);
        at += port;
    }
    if (*at == '?') parts->query = at + 1;
    return true;
}

/* "name=value" of a query; false when `name` does not stand at `*at`, which moves behind the pair
 * otherwise. */
static bool query_take(const char **at, const char *name, char value[16])
{
    size_t length = strlen(name);
    if (strncmp(*at, name, length) != 0 || (*at)[length] != '=') return false;
    const char *from = *at + length + 1;
    size_t bytes = strcspn(from, "&");
    snprintf(value, 16, "%.*s", (int)(bytes < 16 ? bytes : 15), from);
    *at = from + bytes + (from[bytes] == '&');
    return true;
}

static bool number_within(const char *text, int64_t low, int64_t high)
{
    int64_t value;
    return fv_text_integer(text, &value) && value >= low && value <= high;
}

static const char *udpm_expected(const struct parts *parts)
{
    struct in_addr group;
    char value[16];
    const char *at = parts->query;
    if (parts->port[0] != '\0' && !number_within(parts->port, 1, 65535))
        return "a port from 1 to 65535";
    if (parts->host[0] == '\0' && parts->port[0] == '\0')
        return NULL; /* LCM's own group and port */
    if (inet_pton(AF_INET, parts->host, &group) != 1 || !IN_MULTICAST(ntohl(group.s_addr)))
        return "an LCM URL like udpm://239.255.76.67:7667";
    while (*at != '\0') {
        if (query_take(&at, "ttl", value)
                ? !number_within(value, 0, 255)
                : !query_take(&at, "recv_buf_size", value) || !number_within(value, 1, INT32_MAX))
            return "ttl=0 to 255 or recv_buf_size=BYTES after the '?'";
    }
    return NULL;
}

enum fovea_status fv_transport_url_check(const char *url, struct fovea_error *error)
{
    struct parts parts;
    const enum fv_transport_kind kind = fv_transport_kind_of(url);
    const char *expected = NULL;
    char value[16];
    if (kind == FV_TRANSPORT_UNKNOWN || strlen(url) > FV_TRANSPORT_URL_BYTES - 16 ||
        !split(url, kind, &parts))
        expected = "an LCM URL like udpm://239.255.76.67:7667";
    else if (kind == FV_TRANSPORT_UDPM)
        expected = udpm_expected(&parts);
    else if (kind == FV_TRANSPORT_TCPQ && parts.port[0] != '\0' &&
             !number_within(parts.port, 1, 65535))
        expected = "a port from 1 to 65535";
    else if (kind == FV_TRANSPORT_FILE &&
             (parts.host[0] == '\0' || !query_take(&parts.query, "mode", value) ||
              (strcmp(value, "w") != 0 && strcmp(value, "a") != 0)))
        expected = "file://PATH?mode=w (or mode=a)";
    if (expected == NULL) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "lcm_url: found \"%.300s\", expected %s", url,
                           expected);
}

void fv_transport_udpm(const char *url, struct sockaddr_in *address)
{
    struct parts parts;
    int64_t port = 7667;
    memset(address, 0, sizeof *address);
    if (!split(url, FV_TRANSPORT_UDPM, &parts)) return;
    fv_text_integer(parts.port, &port);
    address->sin_family = AF_INET;
    address->sin_port = htons((uint16_t)port);
    inet_pton(AF_INET, parts.host[0] != '\0' ? parts.host : "239.255.76.67", &address->sin_addr);
}

bool fv_transport_file(const char *url, char path[FV_TRANSPORT_URL_BYTES])
{
    struct parts parts;
    path[0] = '\0';
    if (fv_transport_kind_of(url) != FV_TRANSPORT_FILE || !split(url, FV_TRANSPORT_FILE, &parts))
        return false;
    snprintf(path, FV_TRANSPORT_URL_BYTES, "%s", parts.host);
    return true;
}

int fv_transport_ttl(const char *url)
{
    const char *found = strstr(url, "ttl=");
    return found != NULL ? (int)strtol(found + 4, NULL, 10) : 0;
}

bool fv_transport_appends(const char *url)
{
    return strstr(url, "?mode=a") != NULL;
}

void fv_transport_url_complete(const char *url, uint32_t ttl, char complete[FV_TRANSPORT_URL_BYTES])
{
    bool add = fv_transport_kind_of(url) == FV_TRANSPORT_UDPM && strstr(url, "ttl=") == NULL;
    bool bare =
        strcmp(url, schemes[FV_TRANSPORT_UDPM]) == 0; /* LCM takes options after an address only */
    if (add)
        snprintf(complete, FV_TRANSPORT_URL_BYTES, "%s%s%cttl=%" PRIu32, url,
                 bare ? "239.255.76.67:7667" : "", strchr(url, '?') != NULL ? '&' : '?', ttl);
    else
        snprintf(complete, FV_TRANSPORT_URL_BYTES, "%s", url);
}

/* ---- is there anything at the other end? ----------------------------------------------------- */

/* LCM's own test of the route prints several lines and gives no reason, so ask first. */
static enum fovea_status check_route(const char *url, struct fovea_error *error)
{
    struct sockaddr_in address;
    fv_transport_udpm(url, &address);
    int probe = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    int failed = probe < 0 || connect(probe, (const struct sockaddr *)&address, sizeof address) != 0
                     ? errno
                     : 0;
    if (probe >= 0) close(probe);
    if (failed == 0) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                           "%s: no route for LCM messages (%s); this remedies it: %s", url,
                           strerror(failed), FV_TRANSPORT_MEND);
}

enum fovea_status fv_transport_server(const char *url, struct sockaddr_in *address,
                                      struct fovea_error *error)
{
    struct parts parts;
    const struct addrinfo wanted = {.ai_family = AF_INET, .ai_socktype = SOCK_STREAM};
    struct addrinfo *found = NULL;
    if (!split(url, FV_TRANSPORT_TCPQ, &parts)) return FOVEA_ERROR_INPUT;
    const int failed = getaddrinfo(parts.host[0] != '\0' ? parts.host : "localhost",
                                   parts.port[0] != '\0' ? parts.port : "7700", &wanted, &found);
    if (failed != 0)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: %s", url, gai_strerror(failed));
    memcpy(address, found->ai_addr, sizeof *address);
    freeaddrinfo(found);
    return FOVEA_OK;
}

/* 0, or why not; ETIMEDOUT after ANSWER_MS, where nothing answers at all. */
static int connect_within(int probe, const struct sockaddr_in *address)
{
    struct pollfd ready = {.fd = probe, .events = POLLOUT};
    int failed = 0;
    socklen_t size = sizeof failed;
    if (connect(probe, (const struct sockaddr *)address, sizeof *address) == 0) return 0;
    if (errno != EINPROGRESS) return errno;
    const int came = poll(&ready, 1, ANSWER_MS);
    if (came <= 0) return came == 0 ? ETIMEDOUT : errno;
    return getsockopt(probe, SOL_SOCKET, SO_ERROR, &failed, &size) == 0 ? failed : errno;
}

static enum fovea_status check_server(const char *url, struct fovea_error *error)
{
    struct sockaddr_in address;
    enum fovea_status status = fv_transport_server(url, &address, error);
    if (status != FOVEA_OK) return status;
    const int probe = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const int failed = probe < 0 ? errno : connect_within(probe, &address);
    if (probe >= 0) close(probe);
    if (failed == 0) return FOVEA_OK;
    return fovea_error_set(
        error, FOVEA_ERROR_SYSTEM,
        "%s: no LCM server answers (%s); start one there, or send by udpm://, which needs none",
        url, strerror(failed));
}

enum fovea_status fv_transport_reachable(const char *url, struct fovea_error *error)
{
    const enum fv_transport_kind kind = fv_transport_kind_of(url);
    if (kind == FV_TRANSPORT_UDPM) return check_route(url, error);
    return kind == FV_TRANSPORT_TCPQ ? check_server(url, error) : FOVEA_OK;
}
