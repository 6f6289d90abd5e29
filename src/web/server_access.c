/* Who asks: the ends of a connection, its headers, and what they allow. */
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>

#include "drivers/clock.h"
#include "web/server_internal.h"

/* Numbers of open files: the lowest are taken first. */
enum { FILES_MAX = FV_WEB_CONNECTIONS_MAX + 64 };

bool fv_web_server_header(struct lws *wsi, enum lws_token_indexes which, char *to, size_t bytes)
{
    const int length = lws_hdr_total_length(wsi, which);
    to[0] = '\0';
    return length > 0 && (size_t)length < bytes && lws_hdr_copy(wsi, to, (int)bytes, which) > 0;
}

void fv_web_server_addresses(struct lws *wsi, char local[INET_ADDRSTRLEN],
                             char remote[INET_ADDRSTRLEN])
{
    struct sockaddr_in end;
    socklen_t bytes = sizeof end;
    const int socket = lws_get_socket_fd(wsi);
    local[0] = remote[0] = '\0';
    if (getsockname(socket, (struct sockaddr *)&end, &bytes) == 0 && end.sin_family == AF_INET)
        inet_ntop(AF_INET, &end.sin_addr, local, INET_ADDRSTRLEN);
    bytes = sizeof end;
    if (getpeername(socket, (struct sockaddr *)&end, &bytes) == 0 && end.sin_family == AF_INET)
        inet_ntop(AF_INET, &end.sin_addr, remote, INET_ADDRSTRLEN);
}

bool fv_web_server_is_crowd(const struct lws_filter_network_conn_args *arrived)
{
    struct sockaddr_in from, other;
    int count = 0;
    memcpy(&from, &arrived->cli_addr, sizeof from);
    if (from.sin_family != AF_INET || ntohl(from.sin_addr.s_addr) >> 24 == 127) return false;
    for (int file = 0; file < FILES_MAX; file++) {
        socklen_t bytes = sizeof other;
        count += file != arrived->accept_fd &&
                 getpeername(file, (struct sockaddr *)&other, &bytes) == 0 &&
                 other.sin_family == AF_INET && other.sin_addr.s_addr == from.sin_addr.s_addr;
    }
    return count >= FV_WEB_CONNECTIONS_OF_ADDRESS;
}

void fv_web_server_cookie_name(const struct fv_web_server *server, char name[24])
{
    snprintf(name, 24, "fovea_%u", (unsigned)server->port);
}

static enum fv_web_role role_of(struct fv_web_server *server, struct lws *wsi)
{
    char cookies[FV_WEB_COOKIE_BYTES], name[24], token[FV_WEB_TOKEN_DIGITS + 1],
        local[INET_ADDRSTRLEN], remote[INET_ADDRSTRLEN];
    if (server->setup.tokens == NULL) return FV_WEB_OPERATE;
    fv_web_server_cookie_name(server, name);
    if (!fv_web_server_header(wsi, WSI_TOKEN_HTTP_COOKIE, cookies, sizeof cookies) ||
        !fv_web_cookie_token(cookies, name, token))
        return FV_WEB_NOBODY;
    const enum fv_web_role role = fv_web_tokens_role(server->setup.tokens, token);
    fv_web_server_addresses(wsi, local, remote);
    return fv_web_tries_cookie(&server->tries, remote, token, role != FV_WEB_NOBODY,
                               fv_clock_ns(CLOCK_MONOTONIC))
               ? role
               : FV_WEB_NOBODY;
}

/* Whether it names this server, and comes from our page or an origin that is listed; without an
 * origin only where it need not be `of_page`. */
static bool request_is_ours(const struct fv_web_server *server, struct lws *wsi, bool of_page,
                            const char *listed)
{
    char host[FV_WEB_NAME_BYTES], origin[FV_WEB_NAME_BYTES + 8], local[INET_ADDRSTRLEN],
        remote[INET_ADDRSTRLEN];
    const bool encrypted = server->setup.certificate.file != NULL;
    fv_web_server_addresses(wsi, local, remote);
    if (!fv_web_server_header(wsi, WSI_TOKEN_HOST, host, sizeof host) ||
        !fv_web_host_is_ours(host, server->port, encrypted, local, server->setup.names,
                             server->setup.name_count))
        return false;
    if (!of_page && lws_hdr_total_length(wsi, WSI_TOKEN_ORIGIN) == 0) return true;
    return fv_web_server_header(wsi, WSI_TOKEN_ORIGIN, origin, sizeof origin) &&
           (fv_web_origin_is_ours(origin, host, encrypted) ||
            fv_web_origin_is_listed(origin, listed));
}

int fv_web_server_judge(struct fv_web_server *server, struct lws *wsi, bool of_page,
                        enum fv_web_role *role)
{
    if (!request_is_ours(server, wsi, of_page, NULL)) return HTTP_STATUS_FORBIDDEN;
    *role = role_of(server, wsi);
    return *role != FV_WEB_NOBODY ? HTTP_STATUS_OK : HTTP_STATUS_UNAUTHORIZED;
}

/* What the query of the address says behind `name` ("robot="); NULL: nothing. An argument before it
 * that did not fit would hide it from libwebsockets, so there is room for all that may come. */
static const char *argument(struct lws *wsi, const char *name, char text[FV_WEB_HEADERS_BYTES])
{
    return lws_get_urlarg_by_name(wsi, name, text, FV_WEB_HEADERS_BYTES);
}

/* The token of a client that is no page: of a header, or of the query of the address. */
static bool foxglove_token(struct lws *wsi, char token[FV_WEB_TOKEN_DIGITS + 1])
{
    static const char bearer[] = "Bearer ";
    char text[FV_WEB_HEADERS_BYTES];
    const char *found = NULL;
    if (fv_web_server_header(wsi, WSI_TOKEN_HTTP_AUTHORIZATION, text, sizeof text))
        found = strncasecmp(text, bearer, strlen(bearer)) == 0 ? text + strlen(bearer) : NULL;
    else
        found = argument(wsi, "token=", text);
    if (found == NULL) return false;
    const bool fits = strlen(found) == FV_WEB_TOKEN_DIGITS;
    memcpy(token, fits ? found : "", fits ? FV_WEB_TOKEN_DIGITS + 1 : 1);
    return true; /* a wrong one, if it does not fit */
}

/* Wrong ones are limited as at the login. */
static int judge_token(struct fv_web_server *server, struct lws *wsi, enum fv_web_role *role)
{
    char token[FV_WEB_TOKEN_DIGITS + 1], local[INET_ADDRSTRLEN], remote[INET_ADDRSTRLEN];
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    *role = role_of(server, wsi);
    if (*role != FV_WEB_NOBODY) return HTTP_STATUS_OK;
    fv_web_server_addresses(wsi, local, remote);
    if (!fv_web_tries_left(&server->tries, remote, now_ns)) return 429;
    const bool any = foxglove_token(wsi, token);
    *role = any ? fv_web_tokens_role(server->setup.tokens, token) : FV_WEB_NOBODY;
    if (*role != FV_WEB_NOBODY) return HTTP_STATUS_OK;
    if (any) fv_web_tries_failed(&server->tries, remote, now_ns);
    return HTTP_STATUS_UNAUTHORIZED;
}

int fv_web_server_judge_foxglove(struct fv_web_server *server, struct lws *wsi,
                                 enum fv_web_role *role)
{
    if (!request_is_ours(server, wsi, false, server->setup.origins)) return HTTP_STATUS_FORBIDDEN;
    return judge_token(server, wsi, role);
}

uint32_t fv_web_server_robot(struct lws *wsi)
{
    char text[FV_WEB_HEADERS_BYTES];
    const char *of = argument(wsi, "robot=", text);
    const unsigned long robot = of != NULL ? strtoul(of, NULL, 10) : 0;
    return robot < UINT32_MAX ? (uint32_t)robot : UINT32_MAX;
}
