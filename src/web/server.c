#include "web/server.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#include <openssl/ssl.h>

#include "drivers/clock.h"
#include "support/say.h"
#include "web/server_internal.h"

enum {
    LOOK_US = 10000,             /* at the feed, while somebody looks at the page */
    LOOK_SELDOM_US = 50000,      /* the ring of messages holds a second and a half */
    UNSENT_BYTES_MAX = 8192,     /* in the kernel: newer messages must not wait behind old ones */
    FOXGLOVE_CHUNK_BYTES = 4096, /* of what a client says, at once */
    FRAME_BYTES = 16384,         /* of a frame, but for its last packet */
    SLOW_CLASS = 4               /* of pictures: the link is so slow that messages go more seldom */
};

#define TOGETHER_NS (FV_SECOND_NS / 33) /* messages are sent as many at once, or with a picture */
#define SELDOM_NS (FV_SECOND_NS / 12)

/* ---- websockets ------------------------------------------------------------------------------ */

static struct fv_web_place_of_client *place_of(struct fv_web_server *server, struct lws *wsi)
{
    for (int i = 0; i < FV_WEB_CLIENTS_MAX; i++)
        if (server->clients[i].socket == wsi) return &server->clients[i];
    return NULL;
}

static struct fv_web_relay *shown_to(const struct fv_web_server *server,
                                     const struct fv_web_client *client)
{
    return server->setup.robots->robots[client->robot].relay;
}

bool fv_web_server_is_commanded(const struct fv_web_server *server, uint32_t robot)
{
    return server->setup.commander->transport != NULL &&
           server->setup.robots->robots[robot].relay->heard == NULL;
}

void fv_web_server_hasten(struct lws *wsi)
{
    const int unsent = UNSENT_BYTES_MAX, on = 1, socket = lws_get_socket_fd(wsi);
    setsockopt(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &unsent, sizeof unsent);
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

static int arrive(struct fv_web_server *server, struct lws *wsi)
{
    enum fv_web_role role;
    struct fv_web_place_of_client *place = place_of(server, NULL);
    if (place == NULL || fv_web_server_judge(server, wsi, true, &role) != HTTP_STATUS_OK) return -1;
    fv_web_server_hasten(wsi);
    place->socket = wsi;
    place->sent_ns = 0;
    fv_web_client_init(&place->client, role, fv_web_server_is_commanded(server, 0));
    if (server->setup.robots->count > 1) place->client.robots = server->setup.robots;
    lws_callback_on_writable(wsi);
    return 0;
}

static bool send_text(struct lws *wsi, uint8_t *text, size_t bytes)
{
    return bytes == 0 || lws_write(wsi, text, bytes, LWS_WRITE_TEXT) >= 0;
}

/* All that the page has not got, in one frame: each packet behind its length. */
static int send_next(struct fv_web_server *server, struct lws *wsi)
{
    struct fv_web_place_of_client *place = place_of(server, wsi);
    uint8_t *packet = server->packet + LWS_PRE;
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    size_t used = 0, bytes = 1;
    bool text = false;
    struct fv_web_link link;
    if (place == NULL) return -1;
    fv_web_server_link(wsi, &link);
    place->client.bytes_per_s = link.bytes_per_s;
    const bool slow = place->client.picture_class >= SLOW_CLASS;
    if ((slow && place->client.reply_count == 0 && now_ns - place->sent_ns < SELDOM_NS) ||
        link.behind) {
        server->changed = true; /* it is asked again */
        return 0;
    }
    place->sent_ns = now_ns;
    while (!text && bytes > 0 && used < FRAME_BYTES) {
        bytes = fv_web_client_next(&place->client, shown_to(server, &place->client)->store,
                                   packet + used + 4, FV_WEB_PACKET_BYTES_MAX - used - 4, now_ns,
                                   &text);
        if (text || bytes == 0) break;
        for (int i = 0; i < 4; i++)
            packet[used + (size_t)i] = (uint8_t)(bytes >> 8 * (3 - i));
        used += 4 + bytes;
    }
    if (text && !send_text(wsi, packet + 4, bytes)) return -1; /* texts come before all else */
    if (used > 0 && lws_write(wsi, packet, used, LWS_WRITE_BINARY) < 0) return -1;
    if (bytes > 0) lws_callback_on_writable(wsi); /* there is more */
    return 0;
}

const char *fv_web_server_refusal(const struct fv_web_server *server,
                                  const struct fv_web_relay *relay, enum fv_web_role role)
{
    return role != FV_WEB_OPERATE  ? "this token may only look"
           : relay->player != NULL ? "a recording is played: there is no run to ask"
           : server->setup.commander == NULL || server->setup.commander->transport == NULL
               ? "fovea-web was started without --lcm-url, or found no LCM there"
           : relay->heard != NULL  ? "nothing is asked of a robot that is heard"
           : relay->reader == NULL ? "there is no run"
                                   : NULL;
}

/* What all pages see changes: who may only look may not. */
static void play(struct fv_web_server *server, struct fv_web_client *client,
                 const struct fv_web_command *command)
{
    struct fv_web_relay *relay = shown_to(server, client);
    const char *reason = client->role != FV_WEB_OPERATE ? "this token may only look"
                         : relay->player == NULL        ? "a run is shown, no recording"
                                                        : NULL;
    if (reason != NULL) {
        fv_web_client_reply(client, "{\"kind\":\"refused\",\"request\":%u,\"reason\":\"%s\"}",
                            command->request, reason);
        return;
    }
    switch (command->play) {
    case FV_WEB_PAUSE:
    case FV_WEB_RESUME:
        fv_web_player_pause(relay->player, command->play == FV_WEB_PAUSE);
        break;
    case FV_WEB_SEEK:
        fv_web_player_seek(relay->player, (int64_t)command->play_to);
        break;
    case FV_WEB_SPEED:
        fv_web_player_speed(relay->player, command->play_to);
        break;
    }
    relay->told_ns = 0; /* soon */
}

static void command(struct fv_web_server *server, struct fv_web_client *client,
                    const struct fv_web_command *command)
{
    const struct fv_web_relay *relay = shown_to(server, client);
    const char *reason = fv_web_server_refusal(server, relay, client->role);
    if (reason != NULL) {
        fv_web_client_reply(client, "{\"kind\":\"refused\",\"request\":%u,\"reason\":\"%s\"}",
                            command->request, reason);
        return;
    }
    struct fv_web_commander *commander = server->setup.commander;
    const int64_t run_id = fv_feed_reader_run(relay->reader);
    const int64_t id =
        command->bits != 0 ? fv_web_commander_send(commander, relay->prefix, run_id, command->bits)
        : command->loads   ? fv_web_commander_map(commander, relay->prefix, run_id, command->key)
                           : fv_web_commander_set(commander, relay->prefix, run_id, command->key,
                                                  command->value, command->keep);
    fv_web_client_reply(client, "{\"kind\":\"sent\",\"request\":%u,\"id\":\"%lld\"}",
                        command->request, (long long)id);
}

static int hear(struct fv_web_server *server, struct lws *wsi, const void *words, size_t length)
{
    struct fv_web_command said;
    struct fv_web_place_of_client *place = place_of(server, wsi);
    if (place == NULL || !lws_is_first_fragment(wsi) || !lws_is_final_fragment(wsi)) return -1;
    const enum fv_web_said what =
        fv_web_client_hear(&place->client, words, length, fv_clock_ns(CLOCK_MONOTONIC), &said);
    if (what == FV_WEB_SAID_WRONG) return -1;
    if (what == FV_WEB_SAID_PLAY) play(server, &place->client, &said);
    if (what == FV_WEB_SAID_ROBOT && said.request < server->setup.robots->count &&
        said.request != place->client.robot)
        fv_web_client_show(&place->client, said.request,
                           fv_web_server_is_commanded(server, said.request));
    if (what == FV_WEB_SAID_COMMAND) command(server, &place->client, &said);
    lws_callback_on_writable(wsi);
    return 0;
}

int fv_web_server_refuse(struct fv_web_server *server, struct lws *wsi, int status)
{
    char text[128];
    const int length =
        snprintf(text, sizeof text,
                 "HTTP/1.1 %d Refused\r\nContent-Length: 0\r\nConnection: close\r\n\r\n", status);
    SSL *encrypted = server->setup.certificate.file != NULL ? lws_get_ssl(wsi) : NULL;
    if (encrypted != NULL)
        (void)SSL_write(encrypted, text, length);
    else
        (void)send(lws_get_socket_fd(wsi), text, (size_t)length, MSG_NOSIGNAL | MSG_DONTWAIT);
    return -1;
}

/* Before a websocket opens: who may, and whether there is room. */
static int judge(struct fv_web_server *server, struct lws *wsi)
{
    enum fv_web_role role;
    int status = server->setup.robots == NULL ? HTTP_STATUS_NOT_FOUND
                                              : fv_web_server_judge(server, wsi, true, &role);
    if (status == HTTP_STATUS_OK && place_of(server, NULL) == NULL)
        status = HTTP_STATUS_SERVICE_UNAVAILABLE;
    return status == HTTP_STATUS_OK ? 0 : fv_web_server_refuse(server, wsi, status);
}

static void leave(struct fv_web_server *server, struct lws *wsi)
{
    struct fv_web_place_of_client *place = place_of(server, wsi);
    if (place != NULL) place->socket = NULL;
}

int fv_web_websocket(const struct fv_web_protocol *protocol, struct lws *wsi,
                     enum lws_callback_reasons reason, void *in, size_t length)
{
    struct fv_web_server *server = lws_context_user(lws_get_context(wsi));
    switch (reason) {
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
        return protocol->judge(server, wsi);
    case LWS_CALLBACK_ESTABLISHED:
        return protocol->arrive(server, wsi);
    case LWS_CALLBACK_SERVER_WRITEABLE:
        return protocol->send_next(server, wsi);
    case LWS_CALLBACK_RECEIVE:
        return protocol->hear(server, wsi, in, length);
    case LWS_CALLBACK_CLOSED:
        protocol->leave(server, wsi);
        return 0;
    default:
        return 0;
    }
}

static int on_page(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in,
                   size_t length)
{
    static const struct fv_web_protocol page = {judge, arrive, send_next, hear, leave};
    (void)user;
    return fv_web_websocket(&page, wsi, reason, in, length);
}

/* ---- the server ------------------------------------------------------------------------------ */

/* The last number is what is handed to the kernel at once: without one it is FV_WEB_WORDS_BYTES. */
static const struct lws_protocols protocols[] = {
    {"http", fv_web_http, sizeof(struct fv_web_request), 0, 0, NULL, 0},
    {"fovea", on_page, 0, FV_WEB_WORDS_BYTES, 0, NULL, FV_WEB_PACKET_BYTES_MAX},
    {"foxglove.sdk.v1", fv_web_foxglove, 0, FOXGLOVE_CHUNK_BYTES, 0, NULL, FV_WEB_PACKET_BYTES_MAX},
    {"foxglove.websocket.v1", fv_web_foxglove, 0, FOXGLOVE_CHUNK_BYTES, 0, NULL,
     FV_WEB_PACKET_BYTES_MAX},
    {NULL, NULL, 0, 0, 0, NULL, 0},
};

/* A page that is gone is noticed, and its place is free again. */
static const lws_retry_bo_t liveness = {.secs_since_valid_ping = 10, .secs_since_valid_hangup = 25};

/* Set the cameras of each robot that somebody looks at. Whether there is a client at all. */
static bool wish_cameras(struct fv_web_server *server)
{
    bool any = false;
    for (uint32_t i = 0; i < server->setup.robots->count; i++)
        server->setup.robots->robots[i].relay->cameras = 0;
    for (int i = 0; i < FV_WEB_CLIENTS_MAX; i++) {
        const struct fv_web_client *client = &server->clients[i].client;
        if (server->clients[i].socket == NULL) continue;
        any = true;
        if (!client->hidden) shown_to(server, client)->cameras |= UINT32_C(1) << client->camera;
    }
    return fv_web_foxglove_wish(server) || any;
}

static void tick(lws_sorted_usec_list_t *timer)
{
    struct fv_web_server *server = lws_container_of(timer, struct fv_web_server, timer);
    bool pictured;
    if (server->setup.robots == NULL) return; /* a page that asks by itself */
    const bool any = wish_cameras(server);
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    server->changed |= fv_web_robots_tick(server->setup.robots, &pictured);
    fv_web_foxglove_tick(server);
    if (server->changed && (pictured || now_ns - server->sent_ns >= TOGETHER_NS)) {
        server->changed = false;
        server->sent_ns = now_ns;
        for (int i = 0; i < FV_WEB_CLIENTS_MAX; i++)
            if (server->clients[i].socket != NULL)
                lws_callback_on_writable(server->clients[i].socket);
        fv_web_foxglove_changed(server);
    }
    lws_sul_schedule(server->context, 0, &server->timer, tick, any ? LOOK_US : LOOK_SELDOM_US);
}

enum fovea_status fv_web_server_open(const struct fv_web_setup *setup,
                                     struct fv_web_server **server, struct fovea_error *error)
{
    struct fv_web_server *made = calloc(1, sizeof *made);
    *server = NULL;
    if (made == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for the server");
    made->setup = *setup;
    lws_set_log_level(0, NULL);
    struct lws_context_creation_info info = {
        .port = setup->port,
        .iface = strcmp(setup->address, "0.0.0.0") != 0 ? setup->address : NULL,
        .protocols = protocols,
        .user = made,
        .gid = -1,
        .uid = -1,
        .max_http_header_data = FV_WEB_HEADERS_BYTES,
        .max_http_header_pool = FV_WEB_CONNECTIONS_MAX, /* who sends half a request holds one */
        .fd_limit_per_thread = FV_WEB_CONNECTIONS_MAX,
        .timeout_secs = 5,
        .timeout_secs_ah_idle = 5,
        .keepalive_timeout = 5,
        .ka_time = 10,
        .ka_probes = 3,
        .ka_interval = 5,
        .retry_and_idle_policy = &liveness,
        .vhost_name = "fovea",
        .options = LWS_SERVER_OPTION_EXPLICIT_VHOSTS | LWS_SERVER_OPTION_DISABLE_IPV6 |
                   LWS_SERVER_OPTION_FAIL_UPON_UNABLE_TO_BIND,
    };
    if (setup->certificate.file != NULL) {
        info.options |= LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT;
        info.ssl_cert_filepath = setup->certificate.file;
        info.ssl_private_key_filepath = setup->certificate.key_file;
        info.ssl_options_set = SSL_OP_NO_TLSv1 | SSL_OP_NO_TLSv1_1 | SSL_OP_NO_RENEGOTIATION;
        info.alpn = "http/1.1";
    }
    made->context = lws_create_context(&info);
    if (made->context != NULL) made->vhost = lws_create_vhost(made->context, &info);
    if (made->vhost == NULL) {
        fv_web_server_close(made);
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found no way to listen at %s port %u, expected an address of this "
                               "host and a port that no other program uses",
                               setup->address, (unsigned)setup->port);
    }
    made->port = (uint16_t)lws_get_vhost_listen_port(made->vhost);
    if (!fv_web_foxglove_open(made)) {
        fv_web_server_close(made);
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for the server");
    }
    lws_sul_schedule(made->context, 0, &made->timer, tick, 1);
    *server = made;
    return FOVEA_OK;
}

uint16_t fv_web_server_port(const struct fv_web_server *server)
{
    return server->port;
}

void fv_web_server_warn(const struct fv_web_server *server, const char *program)
{
    const bool encrypted = server->setup.certificate.file != NULL;
    if (!encrypted && strncmp(server->setup.address, "127.", 4) != 0)
        fv_say("%sall that the page shows can be read on the network: it is not encrypted",
               program);
}

bool fv_web_server_run(struct fv_web_server *server)
{
    while (!server->stopped)
        if (lws_service(server->context, 0) < 0) return false;
    return true;
}

void fv_web_server_stop(struct fv_web_server *server)
{
    server->stopped = true;
    lws_cancel_service(server->context);
}

void fv_web_server_close(struct fv_web_server *server)
{
    if (server->context != NULL) {
        lws_sul_schedule(server->context, 0, &server->timer, tick, LWS_SET_TIMER_USEC_CANCEL);
        lws_context_destroy(server->context);
    }
    fv_web_foxglove_close(server);
    free(server);
}
