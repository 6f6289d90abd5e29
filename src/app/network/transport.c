#include "app/network/transport.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/network/listener.h"
#include "app/network/sender.h"
#include "app/network/transport_url.h"
#include "support/aligned.h"
#include "support/say.h"

struct fv_transport {
    char url[FV_TRANSPORT_URL_BYTES];
    struct fv_listener listener;
    struct fv_sender *sender;
};

static enum fovea_status open_transport(const char *url, uint32_t ttl, bool routes_may_come,
                                        struct fv_transport **transport, struct fovea_error *error)
{
    char complete[FV_TRANSPORT_URL_BYTES];
    *transport = NULL;
    if (url[0] == '\0') return FOVEA_OK;
    enum fovea_status status = fv_transport_url_check(url, error);
    if (status == FOVEA_OK) status = fv_transport_reachable(url, error);
    /* A route may come later: messages count as dropped until then, and memberships follow it. */
    const bool awaited = status == FOVEA_ERROR_SYSTEM && routes_may_come &&
                         fv_transport_kind_of(url) == FV_TRANSPORT_UDPM;
    if (awaited) fv_say("no LCM messages until there is a route: %s", error->text);
    if (status != FOVEA_OK && !awaited) return status;
    struct fv_transport *opened = fv_aligned_zeroed(sizeof *opened);
    if (opened == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for LCM");
    fv_transport_url_complete(url, ttl, complete);
    snprintf(opened->url, sizeof opened->url, "%s", url);
    fv_listener_init(&opened->listener);
    status = fv_sender_open(complete, &opened->sender, error);
    if (status != FOVEA_OK)
        free(opened);
    else
        *transport = opened;
    return status;
}

enum fovea_status fv_transport_open(const char *url, uint32_t ttl, struct fv_transport **transport,
                                    struct fovea_error *error)
{
    return open_transport(url, ttl, false, transport, error);
}

enum fovea_status fv_transport_open_early(const char *url, uint32_t ttl,
                                          struct fv_transport **transport,
                                          struct fovea_error *error)
{
    return open_transport(url, ttl, true, transport, error);
}

void fv_transport_repeat(struct fv_transport *transport, const char *channel, const uint8_t *data,
                         uint32_t bytes)
{
    if (transport != NULL) fv_sender_repeat(transport->sender, channel, data, bytes);
}

void fv_transport_publish(struct fv_transport *transport, const struct fovea_outputs *outputs)
{
    if (transport == NULL) return;
    for (uint32_t i = 0; i < outputs->message_count; i++)
        fv_sender_put(transport->sender, &outputs->messages[i]);
}

void fv_transport_reserve(struct fv_transport *transport, enum fv_transport_thread thread,
                          const char *channel)
{
    if (transport != NULL) fv_sender_reserve(transport->sender, thread, channel);
}

void fv_transport_put_from(struct fv_transport *transport, enum fv_transport_thread thread,
                           const struct fovea_message *message)
{
    if (transport != NULL) fv_sender_put_from(transport->sender, thread, message);
}

void fv_transport_put(struct fv_transport *transport, const struct fovea_message *message)
{
    if (transport != NULL) fv_sender_put(transport->sender, message);
}

enum fovea_status fv_transport_listen(struct fv_transport *transport,
                                      const struct fv_transport_ears *ears,
                                      struct fovea_error *error)
{
    if (transport == NULL) return FOVEA_OK;
    return fv_listener_start(&transport->listener, transport->url, ears, error);
}

bool fv_transport_command(struct fv_transport *transport, struct fv_judged_command *command)
{
    return transport != NULL && fv_listener_command(&transport->listener, command);
}

uint32_t fv_transport_wheel_odometry(struct fv_transport *transport,
                                     struct fovea_wheel_odometry_sample *samples,
                                     uint32_t count_max)
{
    return transport != NULL ? fv_listener_wheel_odometry(&transport->listener, samples, count_max)
                             : 0;
}

bool fv_transport_room(struct fv_transport *transport, bool settled)
{
    return transport == NULL || fv_sender_room(transport->sender, settled);
}

void fv_transport_finish(struct fv_transport *transport)
{
    if (transport != NULL) (void)fv_sender_finish(transport->sender);
}

const char *fv_transport_drop_name(enum fv_transport_drop reason)
{
    static const char *const names[FV_TRANSPORT_DROPS] = {
        "busy", "newer", "long", "late", "queue", "route", "firewall", "server", "file", "end"};
    return names[reason];
}

void fv_transport_sent(const struct fv_transport *transport, struct fv_transport_sent *sent)
{
    memset(sent, 0, sizeof *sent);
    if (transport != NULL) fv_sender_counts(transport->sender, sent);
}

static uint64_t dropped_of(const struct fv_transport_channel *channel)
{
    uint64_t all = 0;
    for (int reason = 0; reason < FV_TRANSPORT_DROPS; reason++)
        all += channel->dropped[reason];
    return all;
}

uint64_t fv_transport_lost(const struct fv_transport *transport, uint64_t *offered)
{
    struct fv_transport_sent sent;
    uint64_t lost = 0;
    *offered = 0;
    if (transport == NULL || fv_transport_kind_of(transport->url) != FV_TRANSPORT_FILE) return 0;
    fv_sender_counts(transport->sender, &sent);
    for (uint32_t i = 0; i < sent.count; i++) {
        *offered += sent.channels[i].offered;
        lost += dropped_of(&sent.channels[i]);
    }
    return lost;
}

bool fv_transport_sync(struct fv_transport *transport)
{
    return transport == NULL || fv_sender_sync(transport->sender);
}

void fv_transport_counts(const struct fv_transport *transport, struct fv_transport_counts *counts)
{
    memset(counts, 0, sizeof *counts);
    if (transport == NULL) return;
    struct fv_transport_sent sent;
    fv_sender_counts(transport->sender, &sent);
    for (uint32_t i = 0; i < sent.count; i++) {
        counts->sent += sent.channels[i].sent;
        counts->dropped += dropped_of(&sent.channels[i]);
    }
    fv_listener_counts(&transport->listener, counts);
}

/* One number of a list, whose first comes with its heading. */
static void tell_count(FILE *out, const char **before, uint64_t count, const char *name)
{
    if (count == 0) return;
    fprintf(out, "%s %" PRIu64 " (%s)", *before, count, name);
    *before = ",";
}

static void end_list(FILE *out, const char *before)
{
    if (before[0] == ',') fprintf(out, "\n");
}

/* The kernel's drops are left out: they are mostly other programs' messages. */
static void tell_received(FILE *out, const struct fv_transport_counts *counts)
{
    const char *before = "  LCM: packets dropped:";
    for (int i = 0; i < FV_DROP_COUNT; i++)
        if (i != FV_DROP_KERNEL)
            tell_count(out, &before, counts->received.dropped[i], fv_drop_name((enum fv_drop)i));
    end_list(out, before);
    before = "  LCM: commands refused:";
    for (int i = FV_COMMAND_TAKEN + 1; i < FV_COMMAND_VERDICTS; i++)
        tell_count(out, &before, counts->command_verdicts[i],
                   fv_command_verdict_name((enum fv_command_verdict)i));
    end_list(out, before);
    before = "  LCM: wheel odometry refused:";
    for (int i = FV_WHEEL_ODOMETRY_TAKEN + 1; i < FV_WHEEL_ODOMETRY_VERDICTS; i++)
        tell_count(out, &before, counts->wheel_odometry_verdicts[i],
                   fv_wheel_odometry_verdict_name((enum fv_wheel_odometry_verdict)i));
    end_list(out, before);
}

static void channel_tell(FILE *out, const struct fv_transport_channel *channel)
{
    if (dropped_of(channel) == 0) return;
    fprintf(out, "  LCM: %s: %" PRIu64 " of %" PRIu64 " messages sent; dropped:", channel->name,
            channel->sent, channel->offered);
    for (int reason = 0, any = 0; reason < FV_TRANSPORT_DROPS; reason++) {
        if (channel->dropped[reason] == 0) continue;
        fprintf(out, "%s %" PRIu64 " %s", any++ > 0 ? "," : "", channel->dropped[reason],
                fv_transport_drop_name((enum fv_transport_drop)reason));
    }
    fprintf(out, "\n");
}

void fv_transport_tell(FILE *out, const struct fv_transport *transport)
{
    struct fv_transport_counts counts;
    struct fv_transport_sent sent;
    fv_transport_counts(transport, &counts);
    fv_transport_sent(transport, &sent);
    for (uint32_t i = 0; i < sent.count; i++)
        channel_tell(out, &sent.channels[i]);
    tell_received(out, &counts);
}

void fv_transport_close(struct fv_transport *transport)
{
    if (transport == NULL) return;
    fv_listener_stop(&transport->listener);
    fv_sender_close(transport->sender);
    free(transport);
}
