#include "app/transport.h"

#include <inttypes.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <lcm/lcm.h>

#include "app/aligned.h"
#include "app/say.h"
#include "app/transport_url.h"
#include "base/ring.h"
#include "drivers/thread.h"
#include "message/fields.h"
#include "message/message.h"

#include "bot_core_pose_t.h"
#include "fovea_command_t.h"

enum {
    COMMAND_RING_BYTES = 256,
    COMMANDS_PER_CALL = 32,
    ODOMETRY_RING_BYTES = 1 << 15, /* half a second at 1 kHz */
    LISTEN_TIMEOUT_MS = 100,
    KNOWN_COMMANDS =
        FOVEA_COMMAND_RESET | FOVEA_COMMAND_PAUSE | FOVEA_COMMAND_RESUME | FOVEA_COMMAND_SAVE
};

struct fv_transport {
    struct fv_ring commands; /* of uint32_t, from the listener to the loop */
    uint8_t commands_memory[COMMAND_RING_BYTES];
    struct fv_ring odometry; /* of struct fovea_odometry_sample, likewise */
    uint8_t odometry_memory[ODOMETRY_RING_BYTES];
    lcm_t *out;
    char url[FV_TRANSPORT_URL_BYTES];
    uint64_t sent, failed; /* the loop's */

    bool listening;
    pthread_t listener;
    atomic_bool stop;
    char channel[FV_MESSAGE_CHANNEL_BYTES];
    char odometry_channel[FV_MESSAGE_CHANNEL_BYTES]; /* "": none */
    atomic_uint_fast64_t commands_taken, commands_refused, odometry_taken, odometry_refused;
};

/* ---- out
 * --------------------------------------------------------------------------------------------- */

static enum fovea_status create(const char *url, uint32_t ttl,
                                char complete[FV_TRANSPORT_URL_BYTES], lcm_t **lcm,
                                struct fovea_error *error)
{
    enum fovea_status status = fv_transport_url_check(url, error);
    if (status == FOVEA_OK) status = fv_transport_reachable(url, error);
    if (status != FOVEA_OK) return status;
    fv_transport_url_complete(url, ttl, complete);
    *lcm = lcm_create(complete);
    if (*lcm == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "%s: LCM cannot use this URL", url);
    return FOVEA_OK;
}

enum fovea_status fv_transport_open(const char *url, uint32_t ttl, struct fv_transport **transport,
                                    struct fovea_error *error)
{
    if (url[0] == '\0') {
        *transport = NULL;
        return FOVEA_OK;
    }
    struct fv_transport *opened = fv_aligned_zeroed(sizeof *opened);
    if (opened == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for LCM");
    fv_ring_init(&opened->commands, opened->commands_memory, sizeof opened->commands_memory);
    fv_ring_init(&opened->odometry, opened->odometry_memory, sizeof opened->odometry_memory);
    enum fovea_status status = create(url, ttl, opened->url, &opened->out, error);
    if (status != FOVEA_OK) {
        free(opened);
        return status;
    }
    /* LCM makes its transmit mutex on the heap when the first message goes out: not on the loop
     * thread, then. The channel is the one of LCM's own test messages. */
    lcm_publish(opened->out, "LCM_SELF_TEST", "lcm self test", 13);
    *transport = opened;
    return FOVEA_OK;
}

void fv_transport_publish(struct fv_transport *transport, const struct fovea_outputs *outputs)
{
    if (transport == NULL) return;
    for (uint32_t i = 0; i < outputs->message_count; i++) {
        const struct fovea_message *message = &outputs->messages[i];
        const bool sent =
            lcm_publish(transport->out, message->channel, message->data, message->bytes) == 0;
        ++*(sent ? &transport->sent : &transport->failed);
    }
}

/* ---- in
 * ---------------------------------------------------------------------------------------------- */

static void take_command(const lcm_recv_buf_t *received, const char *channel, void *context)
{
    struct fv_transport *transport = context;
    const char *problem;
    size_t at;
    fovea_command_t command;
    (void)channel;
    bool good =
        fv_message_check("fovea.command_t", received->data, received->data_size, &problem, &at) &&
        fovea_command_t_decode(received->data, 0, (int)received->data_size, &command) >= 0 &&
        command.commands != 0 && (command.commands & ~KNOWN_COMMANDS) == 0;
    uint32_t bits = good ? (uint32_t)command.commands : 0;
    uint8_t *room = good ? fv_ring_reserve(&transport->commands, sizeof bits) : NULL;
    if (room == NULL) {
        atomic_fetch_add(&transport->commands_refused, 1);
        return;
    }
    memcpy(room, &bits, sizeof bits);
    fv_ring_commit(&transport->commands, sizeof bits);
    atomic_fetch_add(&transport->commands_taken, 1);
}

/* A pose as odometry: finite, with a quaternion that is one, at a time that nanoseconds can tell.
 */
static bool odometry_from(const bot_core_pose_t *pose, struct fovea_odometry_sample *sample)
{
    const double *q = pose->orientation;
    double norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    if (!(norm2 > 0.98 && norm2 < 1.02) || pose->utime < 0 || pose->utime > INT64_MAX / 1000)
        return false;
    sample->stamp_ns = pose->utime * 1000;
    for (int i = 0; i < 4; i++)
        sample->orientation[i] = q[i] / __builtin_sqrt(norm2);
    for (int i = 0; i < 3; i++) {
        if (!(pose->pos[i] > -1e9 && pose->pos[i] < 1e9)) return false;
        sample->position_m[i] = pose->pos[i];
    }
    return true;
}

static void take_odometry(const lcm_recv_buf_t *received, const char *channel, void *context)
{
    struct fv_transport *transport = context;
    const char *problem;
    size_t at;
    bot_core_pose_t pose;
    struct fovea_odometry_sample sample;
    (void)channel;
    bool good =
        fv_message_check("bot_core.pose_t", received->data, received->data_size, &problem, &at) &&
        bot_core_pose_t_decode(received->data, 0, (int)received->data_size, &pose) >= 0 &&
        odometry_from(&pose, &sample);
    uint8_t *room = good ? fv_ring_reserve(&transport->odometry, sizeof sample) : NULL;
    if (room == NULL) {
        atomic_fetch_add(&transport->odometry_refused, 1);
        return;
    }
    memcpy(room, &sample, sizeof sample);
    fv_ring_commit(&transport->odometry, sizeof sample);
    atomic_fetch_add(&transport->odometry_taken, 1);
}

/* To LCM a channel to listen to is a regular expression: what is no letter or digit is to stand for
 * itself alone. Letters beyond ASCII take several bytes, between which no backslash may come. */
static lcm_subscription_t *subscribe_to(struct fv_transport *transport, lcm_t *in,
                                        const char *channel, lcm_msg_handler_t take)
{
    char pattern[2 * FV_MESSAGE_CHANNEL_BYTES];
    size_t used = 0;
    for (; *channel != '\0' && used + 2 < sizeof pattern; channel++) {
        const unsigned char byte = (unsigned char)*channel;
        const bool letter = ((byte | 0x20) >= 'a' && (byte | 0x20) <= 'z') || byte >= 0x80;
        if (!letter && (byte < '0' || byte > '9') && byte != '_') pattern[used++] = '\\';
        pattern[used++] = *channel;
    }
    pattern[used] = '\0';
    return lcm_subscribe(in, pattern, take, transport);
}

static bool subscribe(struct fv_transport *transport, lcm_t *in)
{
    if (subscribe_to(transport, in, transport->channel, take_command) == NULL) return false;
    if (transport->odometry_channel[0] == '\0') return true;
    lcm_subscription_t *subscription =
        subscribe_to(transport, in, transport->odometry_channel, take_odometry);
    return subscription != NULL && lcm_subscription_set_queue_capacity(subscription, 256) == 0;
}

static void *listen_for_commands(void *context)
{
    struct fv_transport *transport = context;
    lcm_t *in = lcm_create(transport->url);
    /* LCM tests here whether its own messages come back, for up to ten seconds: why this is done
     * off the loop. */
    if (in == NULL || !subscribe(transport, in)) {
        fv_say(
            "%s: LCM messages do not come back on this host, so commands%s will not be heard; this mends "
            "it: %s",
            transport->url, transport->odometry_channel[0] != '\0' ? " and odometry" : "",
            FV_TRANSPORT_MEND);
    } else {
        /* Without a connection (tcpq) LCM would select() on descriptor -1, which aborts. */
        while (!atomic_load(&transport->stop))
            if (lcm_get_fileno(in) < 0 || lcm_handle_timeout(in, LISTEN_TIMEOUT_MS) < 0) break;
    }
    if (in != NULL) lcm_destroy(in);
    return NULL;
}

enum fovea_status fv_transport_listen(struct fv_transport *transport, const char *prefix,
                                      const char *odometry_channel, struct fovea_error *error)
{
    if (transport == NULL || transport->listening) return FOVEA_OK;
    fv_message_prepare();
    fv_message_channel(prefix, FV_MESSAGE_COMMAND, transport->channel);
    snprintf(transport->odometry_channel, sizeof transport->odometry_channel, "%s",
             odometry_channel != NULL ? odometry_channel : "");
    int failed = fv_thread_start(&transport->listener, listen_for_commands, transport);
    if (failed != 0)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "no thread to listen for commands: %s",
                               strerror(failed));
    transport->listening = true;
    return FOVEA_OK;
}

uint32_t fv_transport_commands(struct fv_transport *transport)
{
    uint32_t all = 0;
    if (transport == NULL) return 0;
    for (int i = 0; i < COMMANDS_PER_CALL; i++) {
        size_t bytes;
        uint32_t bits;
        const uint8_t *data = fv_ring_peek(&transport->commands, &bytes);
        if (data == NULL) break;
        memcpy(&bits, data, sizeof bits);
        fv_ring_release(&transport->commands, sizeof bits);
        if (bits & (FOVEA_COMMAND_PAUSE | FOVEA_COMMAND_RESUME))
            all &= ~(uint32_t)(FOVEA_COMMAND_PAUSE | FOVEA_COMMAND_RESUME);
        all |= bits;
    }
    return all;
}

uint32_t fv_transport_odometry(struct fv_transport *transport,
                               struct fovea_odometry_sample *samples, uint32_t count_max)
{
    uint32_t count = 0;
    if (transport == NULL) return 0;
    for (; count < count_max; count++) {
        size_t bytes;
        const uint8_t *data = fv_ring_peek(&transport->odometry, &bytes);
        if (data == NULL) break;
        memcpy(&samples[count], data, sizeof samples[count]);
        fv_ring_release(&transport->odometry, sizeof samples[count]);
    }
    return count;
}

void fv_transport_counts(const struct fv_transport *transport, struct fv_transport_counts *counts)
{
    memset(counts, 0, sizeof *counts);
    if (transport == NULL) return;
    counts->sent = transport->sent;
    counts->failed = transport->failed;
    counts->commands = atomic_load(&transport->commands_taken);
    counts->commands_refused = atomic_load(&transport->commands_refused);
    counts->odometry = atomic_load(&transport->odometry_taken);
    counts->odometry_refused = atomic_load(&transport->odometry_refused);
}

void fv_transport_tell(FILE *out, const struct fv_transport *transport)
{
    struct fv_transport_counts counts;
    fv_transport_counts(transport, &counts);
    if (counts.failed + counts.commands_refused + counts.odometry_refused == 0) return;
    fprintf(out,
            "  LCM: %" PRIu64 " messages could not be sent, %" PRIu64 " commands and %" PRIu64
            " messages of odometry were refused\n",
            counts.failed, counts.commands_refused, counts.odometry_refused);
}

void fv_transport_close(struct fv_transport *transport)
{
    if (transport == NULL) return;
    if (transport->listening) {
        atomic_store(&transport->stop, true);
        pthread_join(transport->listener, NULL);
    }
    lcm_destroy(transport->out);
    free(transport);
}
