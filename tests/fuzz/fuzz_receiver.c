/* What comes in from a network: packets, the stream of an LCM server, commands and odometry.
 * Whatever the bytes are, nothing is read or written out of bounds, the counts add up, and no
 * command is taken without its proof. The first byte says which input the rest is: 0 a packet, 1 a
 * stream, in pieces as long as the second byte, 2 a command for a gate with a key, 3 one without.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/network/command_gate.h"
#include "app/network/wheel_odometry_gate.h"
#include "app/network/receiver_packet.h"
#include "app/network/receiver_tcpq.h"

#include "fovea_command_t.h"

int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

enum { RUN = 77, STREAM_BYTES = 256 };

static struct fv_receiver_table table;
static struct fv_command_gate open_gate, keyed_gate;
static struct fv_wheel_odometry_gate odometry;
static uint8_t *stream_buffer; /* on the heap, where each byte beyond it is seen */

static void expect(bool holds)
{
    if (!holds) abort();
}

static void take_command(void *context, const struct fv_received *received)
{
    struct fv_judged_command command;
    const enum fv_command_verdict verdict = fv_command_gate_judge(
        context, received->data, received->bytes, received->from_host, 0, &command);
    expect(verdict == command.verdict && (verdict == FV_COMMAND_TAKEN) == (command.bits != 0));
    if (verdict == FV_COMMAND_TAKEN) expect((command.bits & ~(uint32_t)FV_COMMAND_ALL) == 0);
    expect(verdict != FV_COMMAND_MALFORMED || (command.id == 0 && command.commands == 0));
}

static void take_wheel_odometry(void *context, const struct fv_received *received)
{
    bot_core_pose_t pose;
    struct fovea_wheel_odometry_sample sample;
    expect(bot_core_pose_t_decode(received->data, 0, (int)received->bytes, &pose) >= 0);
    if (fv_wheel_odometry_gate_judge(context, &pose, &sample) != FV_WHEEL_ODOMETRY_TAKEN) return;
    for (int i = 0; i < 3; i++)
        expect(sample.position_m[i] > -1e9 && sample.position_m[i] < 1e9);
    expect(sample.stamp_ns >= 0);
}

static void take_any(void *context, const struct fv_received *received)
{
    unsigned *sum = context;
    for (uint32_t i = 0; i < received->bytes; i++)
        *sum += received->data[i];
}

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    static unsigned sum;
    const struct fv_command_rules rules = {
        .from_network = FV_COMMAND_AUTO, .keyed = true, .key = "sixteen letters.", .run_id = RUN};
    const struct fv_command_rules unkeyed = {.from_network = 3, .run_id = RUN};
    (void)argc;
    (void)argv;
    fv_message_prepare();
    fv_command_gate_init(&keyed_gate, &rules);
    fv_command_gate_init(&open_gate, &unkeyed);
    fv_wheel_odometry_gate_init(&odometry, &(struct fv_wheel_odometry_limits){3, 6});
    table.count = 5;
    table.rows[0] =
        (struct fv_receiver_channel){"C", "fovea.command_t", 128, take_command, &open_gate, false};
    table.rows[1] = (struct fv_receiver_channel){
        "O", "bot_core.pose_t", 256, take_wheel_odometry, &odometry, false};
    table.rows[2] = (struct fv_receiver_channel){"R", NULL, 64, take_any, &sum, false};
    table.rows[3] =
        (struct fv_receiver_channel){"F", "fovea.features_t", STREAM_BYTES, take_any, &sum, false};
    table.rows[4] = (struct fv_receiver_channel){"A*?B*", NULL, 64, take_any, &sum, true};
    stream_buffer = malloc(STREAM_BYTES);
    return 0;
}

static uint64_t handled(void)
{
    uint64_t all = table.taken;
    for (int i = 0; i < FV_DROP_COUNT; i++)
        all += table.dropped[i];
    return all;
}

static void feed_packet(const uint8_t *data, size_t bytes)
{
    const uint64_t before = handled();
    uint8_t *exact = malloc(bytes > 0 ? bytes : 1);
    memcpy(exact, data, bytes);
    fv_packet_take(&table, exact, bytes, bytes > 300, bytes % 2 == 0);
    expect(handled() == before + 1); /* every packet is taken or counted as dropped, once */
    free(exact);
}

static void feed_stream(const uint8_t *data, size_t bytes, size_t step)
{
    struct fv_tcpq_stream stream;
    uint32_t taken = 0;
    fv_tcpq_begin(&stream, &table, stream_buffer, STREAM_BYTES);
    for (size_t at = 0; at < bytes; at += step)
        if (!fv_tcpq_feed(&stream, data + at, bytes - at < step ? bytes - at : step, &taken)) break;
    expect(stream.got <= stream.wanted);
}

/* The library's own proof of a command: made here, without the gate's code. */
static void feed_keyed(const uint8_t *data, size_t bytes)
{
    uint8_t text[256];
    struct fv_judged_command command, again;
    const struct fv_command_gate before = keyed_gate;
    const enum fv_command_verdict verdict =
        fv_command_gate_judge(&keyed_gate, data, bytes, false, 0, &command);
    if (verdict != FV_COMMAND_TAKEN) return;
    uint64_t mac = 0;
    expect(bytes >= 8 && bytes <= sizeof text);
    for (int i = 0; i < 8; i++)
        mac = mac << 8 | data[bytes - 8 + (size_t)i];
    memcpy(text, data, bytes);
    memset(text + bytes - 8, 0, 8);
    expect(fv_siphash(keyed_gate.rules.key, text, bytes, 0) == mac);
    expect(fv_command_gate_judge(&keyed_gate, data, bytes, false, 0, &again) ==
           FV_COMMAND_REPEATED);
    keyed_gate = before; /* the next input finds the same gate */
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    if (bytes < 2) return 0;
    odometry.any = false;
    open_gate.saved = false;
    const struct fv_received command = {"C", data + 1, (uint32_t)bytes - 1, bytes % 2 == 0};
    switch (data[0] % 4) {
    case 0:
        feed_packet(data + 1, bytes - 1);
        break;
    case 1:
        feed_stream(data + 2, bytes - 2, data[1] == 0 ? 1 : data[1]);
        break;
    case 2:
        feed_keyed(data + 1, bytes - 1);
        break;
    default:
        take_command(&open_gate, &command);
    }
    return 0;
}
