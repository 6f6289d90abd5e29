#include "app/network/listener.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/clock.h"
#include "drivers/thread.h"
#include "support/say.h"

#include "bot_core_pose_t.h"

enum {
    COMMAND_BYTES_MAX = 128,
    ODOMETRY_BYTES_MAX = 256,
};

void fv_listener_init(struct fv_listener *listener)
{
    fv_ring_init(&listener->commands, listener->commands_memory, sizeof listener->commands_memory);
    fv_ring_init(&listener->wheel_odometry, listener->wheel_odometry_memory,
                 sizeof listener->wheel_odometry_memory);
}

/* To the loop, which also sends the answers. False: there is no room. */
static bool pass_command(struct fv_listener *listener, const struct fv_judged_command *command)
{
    uint8_t *room = fv_ring_reserve(&listener->commands, sizeof *command);
    if (room == NULL) return false;
    memcpy(room, command, sizeof *command);
    fv_ring_commit(&listener->commands, sizeof *command);
    return true;
}

static void take_command(void *context, const struct fv_received *received)
{
    struct fv_listener *listener = context;
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    struct fv_judged_command command;
    if (fv_command_gate_judge(&listener->gate, received->data, received->bytes, received->from_host,
                              now_ns, &command) == FV_COMMAND_TAKEN)
        fv_command_gate_count(&listener->gate, pass_command(listener, &command) ? FV_COMMAND_TAKEN
                                                                                : FV_COMMAND_BUSY);
    else if (fv_command_gate_answers(&listener->gate, &command, now_ns))
        (void)pass_command(listener, &command);
}

/* A robot that is faster than its limits is a wrong limit more often than an attack. */
static void say_too_fast(struct fv_listener *listener)
{
    const struct fv_wheel_odometry_limits *limits = &listener->wheel_odometry_gate.limits;
    if (listener->said_too_fast) return;
    listener->said_too_fast = true;
    fv_say(
        "wheel odometry: a sample is farther from the last one than scale.wheel_odometry_max_m_s (%g) and "
        "scale.wheel_odometry_max_rad_s (%g) allow; such samples are dropped",
        limits->speed_m_s, limits->turn_rad_s);
}

static void take_wheel_odometry(void *context, const struct fv_received *received)
{
    struct fv_listener *listener = context;
    bot_core_pose_t pose;
    struct fovea_wheel_odometry_sample sample;
    if (bot_core_pose_t_decode(received->data, 0, (int)received->bytes, &pose) < 0) return;
    const enum fv_wheel_odometry_verdict verdict =
        fv_wheel_odometry_gate_judge(&listener->wheel_odometry_gate, &pose, &sample);
    if (verdict == FV_WHEEL_ODOMETRY_TOO_FAST) say_too_fast(listener);
    if (verdict != FV_WHEEL_ODOMETRY_TAKEN) return;
    uint8_t *room = fv_ring_reserve(&listener->wheel_odometry, sizeof sample);
    if (room != NULL) {
        memcpy(room, &sample, sizeof sample);
        fv_ring_commit(&listener->wheel_odometry, sizeof sample);
    }
    fv_wheel_odometry_gate_count(&listener->wheel_odometry_gate,
                                 room != NULL ? FV_WHEEL_ODOMETRY_TAKEN : FV_WHEEL_ODOMETRY_BUSY);
}

static void *run(void *context)
{
    struct fv_listener *listener = context;
    while (!atomic_load(&listener->stop))
        fv_receiver_handle(listener->receiver, -1);
    return NULL;
}

/* The table of channels; returns their number. */
static uint32_t fill_table(struct fv_listener *listener, const struct fv_transport_ears *ears,
                           struct fv_receiver_channel rows[FV_RECEIVER_CHANNELS_MAX])
{
    uint32_t count = 1;
    memset(rows, 0, FV_RECEIVER_CHANNELS_MAX * sizeof rows[0]);
    rows[0] = (struct fv_receiver_channel){.type = "fovea.command_t",
                                           .bytes_max = COMMAND_BYTES_MAX,
                                           .take = take_command,
                                           .context = listener};
    fv_message_channel(ears->prefix, FV_MESSAGE_COMMAND, rows[0].name);
    if (ears->wheel_odometry_channel != NULL && ears->wheel_odometry_channel[0] != '\0')
        rows[count++] = fv_receiver_channel_of(ears->wheel_odometry_channel, "bot_core.pose_t",
                                               ODOMETRY_BYTES_MAX, take_wheel_odometry, listener);
    for (uint32_t i = 0; i < ears->more_count && count < FV_RECEIVER_CHANNELS_MAX; i++)
        rows[count++] = ears->more[i];
    return count;
}

enum fovea_status fv_listener_start(struct fv_listener *listener, const char *url,
                                    const struct fv_transport_ears *ears, struct fovea_error *error)
{
    struct fv_receiver_channel rows[FV_RECEIVER_CHANNELS_MAX];
    if (listener->receiver != NULL) return FOVEA_OK;
    fv_command_gate_init(&listener->gate, &ears->rules);
    fv_wheel_odometry_gate_init(&listener->wheel_odometry_gate, &ears->wheel_odometry_limits);
    const struct fv_receiver_setup setup = {url, ears->listen, rows,
                                            fill_table(listener, ears, rows)};
    enum fovea_status status = fv_receiver_open(&setup, &listener->receiver, error);
    if (status != FOVEA_OK || listener->receiver == NULL) return status;
    const int failed = fv_thread_start(&listener->thread, run, listener);
    if (failed == 0) return FOVEA_OK;
    fv_receiver_close(listener->receiver);
    listener->receiver = NULL;
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "no thread to listen for commands: %s",
                           strerror(failed));
}

bool fv_listener_command(struct fv_listener *listener, struct fv_judged_command *command)
{
    size_t bytes;
    const uint8_t *data = fv_ring_peek(&listener->commands, &bytes);
    if (data == NULL) return false;
    memcpy(command, data, sizeof *command);
    fv_ring_release(&listener->commands, sizeof *command);
    return true;
}

uint32_t fv_listener_wheel_odometry(struct fv_listener *listener,
                                    struct fovea_wheel_odometry_sample *samples, uint32_t count_max)
{
    uint32_t count = 0;
    for (; count < count_max; count++) {
        size_t bytes;
        const uint8_t *data = fv_ring_peek(&listener->wheel_odometry, &bytes);
        if (data == NULL) break;
        memcpy(&samples[count], data, sizeof samples[count]);
        fv_ring_release(&listener->wheel_odometry, sizeof samples[count]);
    }
    return count;
}

void fv_listener_counts(const struct fv_listener *listener, struct fv_transport_counts *counts)
{
    for (int i = 0; i < FV_COMMAND_VERDICTS; i++) {
        counts->command_verdicts[i] = atomic_load(&listener->gate.counts[i]);
        counts->commands_refused += i != FV_COMMAND_TAKEN ? counts->command_verdicts[i] : 0;
    }
    for (int i = 0; i < FV_WHEEL_ODOMETRY_VERDICTS; i++) {
        counts->wheel_odometry_verdicts[i] = atomic_load(&listener->wheel_odometry_gate.counts[i]);
        counts->wheel_odometry_refused +=
            i != FV_WHEEL_ODOMETRY_TAKEN ? counts->wheel_odometry_verdicts[i] : 0;
    }
    counts->commands = counts->command_verdicts[FV_COMMAND_TAKEN];
    counts->wheel_odometry = counts->wheel_odometry_verdicts[FV_WHEEL_ODOMETRY_TAKEN];
    fv_receiver_counts(listener->receiver, &counts->received);
}

void fv_listener_stop(struct fv_listener *listener)
{
    if (listener->receiver == NULL) return;
    atomic_store(&listener->stop, true);
    fv_receiver_wake(listener->receiver);
    pthread_join(listener->thread, NULL);
    fv_receiver_close(listener->receiver);
    listener->receiver = NULL;
}
