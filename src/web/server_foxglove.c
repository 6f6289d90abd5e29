#include <stdlib.h>
#include <string.h>

#include "drivers/clock.h"
#include "web/server_internal.h"

enum { TOGETHER = 16 /* messages that are handed over before other sockets have their turn */ };

static struct fv_web_place_of_foxglove *place_of(struct fv_web_server *server,
                                                 const struct lws *wsi)
{
    for (int i = 0; i < FV_WEB_FOXGLOVE_MAX; i++)
        if (server->foxglove[i].socket == wsi) return &server->foxglove[i];
    return NULL;
}

/* Before it opens: who may, and whether there is room. */
static int judge(struct fv_web_server *server, struct lws *wsi)
{
    enum fv_web_role role;
    int status = server->setup.robots == NULL ? HTTP_STATUS_NOT_FOUND
                                              : fv_web_server_judge_foxglove(server, wsi, &role);
    if (status == HTTP_STATUS_OK && fv_web_server_robot(wsi) >= server->setup.robots->count)
        status = HTTP_STATUS_NOT_FOUND;
    if (status == HTTP_STATUS_OK && place_of(server, NULL) == NULL)
        status = HTTP_STATUS_SERVICE_UNAVAILABLE;
    return status == HTTP_STATUS_OK ? 0 : fv_web_server_refuse(server, wsi, status);
}

static int arrive(struct fv_web_server *server, struct lws *wsi)
{
    enum fv_web_role role;
    struct fv_web_place_of_foxglove *place = place_of(server, NULL);
    const uint32_t robot = fv_web_server_robot(wsi);
    if (place == NULL || server->setup.robots == NULL || robot >= server->setup.robots->count ||
        fv_web_server_judge_foxglove(server, wsi, &role) != HTTP_STATUS_OK)
        return -1;
    fv_web_server_hasten(wsi);
    place->socket = wsi;
    place->robot = robot;
    place->words_bytes = 0;
    fv_foxglove_init(&place->client, role,
                     role == FV_WEB_OPERATE && fv_web_server_is_commanded(server, robot),
                     server->session, fv_clock_ns(CLOCK_MONOTONIC));
    lws_callback_on_writable(wsi);
    return 0;
}

static int send_next(struct fv_web_server *server, struct lws *wsi)
{
    struct fv_web_place_of_foxglove *place = place_of(server, wsi);
    uint8_t *packet = server->packet + LWS_PRE;
    if (place == NULL) return -1;
    for (int i = 0; i < TOGETHER; i++) {
        bool text;
        struct fv_web_link link;
        fv_web_server_link(wsi, &link);
        if (link.behind || link.queued) return 0; /* it is asked again */
        if (link.bytes_per_s > 0) place->client.bytes_per_s = link.bytes_per_s;
        const size_t bytes =
            fv_foxglove_next(&place->client, &server->foxglove_robots[place->robot].shown, packet,
                             FV_WEB_PACKET_BYTES_MAX, fv_clock_ns(CLOCK_MONOTONIC), &text);
        if (bytes == 0) return 0;
        if (lws_write(wsi, packet, bytes, text ? LWS_WRITE_TEXT : LWS_WRITE_BINARY) < 0) return -1;
        if (lws_send_pipe_choked(wsi)) break;
    }
    lws_callback_on_writable(wsi); /* there is more */
    return 0;
}

/* Frames come in pieces; a message that is too long ends the connection. */
static int hear(struct fv_web_server *server, struct lws *wsi, const void *words, size_t length)
{
    struct fv_web_place_of_foxglove *place = place_of(server, wsi);
    if (place == NULL) return -1;
    if (lws_is_first_fragment(wsi)) place->words_bytes = 0;
    if (length > sizeof place->words - place->words_bytes) return -1;
    if (length > 0) memcpy(place->words + place->words_bytes, words, length);
    place->words_bytes += length;
    if (!lws_is_final_fragment(wsi)) return 0;
    fv_foxglove_hear(place->words, place->words_bytes, lws_frame_is_binary(wsi) != 0,
                     &server->said);
    place->words_bytes = 0;
    fv_foxglove_do(&place->client, &server->foxglove_robots[place->robot].shown, &server->said,
                   fv_web_server_refusal(server, server->setup.robots->robots[place->robot].relay,
                                         place->client.role),
                   fv_clock_ns(CLOCK_MONOTONIC));
    lws_callback_on_writable(wsi);
    return 0;
}

static void leave(struct fv_web_server *server, struct lws *wsi)
{
    struct fv_web_place_of_foxglove *place = place_of(server, wsi);
    if (place != NULL) place->socket = NULL;
}

int fv_web_foxglove(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in,
                    size_t length)
{
    static const struct fv_web_protocol foxglove = {judge, arrive, send_next, hear, leave};
    (void)user;
    return fv_web_websocket(&foxglove, wsi, reason, in, length);
}

/* ---- what they are shown --------------------------------------------------------------------- */

static void answered(void *context, const struct fv_foxglove_answer *answer)
{
    struct fv_web_foxglove_robot *robot = context;
    struct fv_web_server *server = robot->server;
    for (int i = 0; i < FV_WEB_FOXGLOVE_MAX; i++)
        if (server->foxglove[i].socket != NULL &&
            robot == &server->foxglove_robots[server->foxglove[i].robot])
            fv_foxglove_answered(&server->foxglove[i].client, answer);
    server->changed = true;
}

bool fv_web_foxglove_open(struct fv_web_server *server)
{
    if (server->setup.robots == NULL) return true;
    const struct fv_web_robots *robots = server->setup.robots;
    server->foxglove_robots = calloc(robots->count, sizeof *server->foxglove_robots);
    if (server->foxglove_robots == NULL) return false;
    server->session = fv_clock_ns(CLOCK_REALTIME);
    for (uint32_t i = 0; i < robots->count; i++) {
        struct fv_web_foxglove_robot *robot = &server->foxglove_robots[i];
        fv_foxglove_views_init(&robot->views);
        robot->server = server;
        robot->parameters.commander = server->setup.commander;
        robot->parameters.answered = answered;
        robot->parameters.context = robot;
        robot->shown = (struct fv_foxglove_shown){robots->robots[i].relay->store, &robot->views,
                                                  &robot->parameters};
        fv_web_relay_show(robots->robots[i].relay, &robot->shown);
    }
    return true;
}

void fv_web_foxglove_close(struct fv_web_server *server)
{
    for (uint32_t i = 0; server->foxglove_robots != NULL && i < server->setup.robots->count; i++) {
        fv_web_relay_show(server->setup.robots->robots[i].relay, NULL);
        fv_foxglove_views_free(&server->foxglove_robots[i].views);
        fv_foxglove_parameters_free(&server->foxglove_robots[i].parameters);
    }
    free(server->foxglove_robots);
}

bool fv_web_foxglove_wish(struct fv_web_server *server)
{
    bool any = false;
    for (int i = 0; i < FV_WEB_FOXGLOVE_MAX; i++) {
        const struct fv_web_place_of_foxglove *place = &server->foxglove[i];
        if (place->socket == NULL) continue;
        any = true;
        server->setup.robots->robots[place->robot].relay->cameras |=
            fv_foxglove_watches(&place->client, &server->foxglove_robots[place->robot].views);
    }
    return any;
}

void fv_web_foxglove_changed(struct fv_web_server *server)
{
    for (int i = 0; i < FV_WEB_FOXGLOVE_MAX; i++)
        if (server->foxglove[i].socket != NULL)
            lws_callback_on_writable(server->foxglove[i].socket);
}

void fv_web_foxglove_tick(struct fv_web_server *server)
{
    for (uint32_t i = 0; i < server->setup.robots->count; i++) {
        const struct fv_web_relay *relay = server->setup.robots->robots[i].relay;
        struct fv_foxglove_parameters *parameters = &server->foxglove_robots[i].parameters;
        memcpy(parameters->prefix, relay->prefix, sizeof parameters->prefix);
        parameters->run_id = relay->reader != NULL ? (int64_t)fv_feed_reader_run(relay->reader) : 0;
        fv_foxglove_parameters_tick(parameters, fv_clock_ns(CLOCK_MONOTONIC));
    }
    for (int i = 0; i < FV_WEB_FOXGLOVE_MAX; i++)
        server->changed |= server->foxglove[i].socket != NULL; /* requests have deadlines */
}
