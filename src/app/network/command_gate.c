#include "app/network/command_gate.h"

#include <string.h>

#include "message/fields.h"

#include "fovea_command_t.h"

enum { MAC_BYTES = 8 };

const char *fv_command_verdict_name(enum fv_command_verdict verdict)
{
    static const char *const names[FV_COMMAND_VERDICTS] = {
        [FV_COMMAND_TAKEN] = "taken",         [FV_COMMAND_MALFORMED] = "malformed",
        [FV_COMMAND_UNKNOWN] = "unknown",     [FV_COMMAND_FORBIDDEN] = "not allowed",
        [FV_COMMAND_FORGED] = "forged",       [FV_COMMAND_OTHER_RUN] = "for another run",
        [FV_COMMAND_REPEATED] = "repeated",   [FV_COMMAND_SENDERS] = "too many senders",
        [FV_COMMAND_TOO_OFTEN] = "too often", [FV_COMMAND_BUSY] = "loop busy",
    };
    return names[verdict];
}

const char *fv_command_verdict_reason(enum fv_command_verdict verdict)
{
    static const char *const reasons[FV_COMMAND_VERDICTS] = {
        [FV_COMMAND_TAKEN] = "",
        [FV_COMMAND_MALFORMED] = "malformed: expected an encoded fovea.command_t",
        [FV_COMMAND_UNKNOWN] =
            "unknown commands: expected a sum of 1 (reset), 2 (pause), 4 (resume), 8 (save) and, with save, 16 (overwrite), or 32 (record) or 64 (record-stop) alone",
        [FV_COMMAND_FORBIDDEN] =
            "not allowed from the network: expected one of those in the key `commands`",
        [FV_COMMAND_FORGED] =
            "mac is wrong or absent: expected the code made with the key of command_key",
        [FV_COMMAND_OTHER_RUN] = "for another run: expected the run_id of this one",
        [FV_COMMAND_REPEATED] =
            "repeated: expected a counter above that of the sender's last command",
        [FV_COMMAND_SENDERS] = "too many senders: expected at most 32 with the same key",
        [FV_COMMAND_TOO_OFTEN] = "too often: expected 5 seconds between two saves",
        [FV_COMMAND_BUSY] = "the loop has not yet taken the commands before this one",
    };
    return reasons[verdict];
}

void fv_command_gate_init(struct fv_command_gate *gate, const struct fv_command_rules *rules)
{
    memset(gate, 0, sizeof *gate);
    gate->rules = *rules;
    if (rules->from_network & FV_COMMAND_AUTO)
        gate->rules.from_network = rules->keyed ? FV_COMMAND_ALL | FV_COMMAND_VELOCITY : 0;
}

/* Bits of command_t that the network may send. */
static uint32_t commands_from_network(const struct fv_command_gate *gate)
{
    const uint32_t others = FV_COMMAND_PARAMETERS | FV_COMMAND_LOAD | FV_COMMAND_VELOCITY;
    uint32_t bits = gate->rules.from_network & ~others;
    if (bits & FOVEA_COMMAND_T_SAVE) bits |= FOVEA_COMMAND_T_OVERWRITE;
    if (bits & FOVEA_COMMAND_T_RECORD) bits |= FOVEA_COMMAND_T_RECORD_STOP;
    return bits;
}

bool fv_command_gate_parameters(const struct fv_command_gate *gate)
{
    return (gate->rules.from_network & FV_COMMAND_PARAMETERS) != 0;
}

bool fv_command_gate_loads(const struct fv_command_gate *gate)
{
    return (gate->rules.from_network & FV_COMMAND_LOAD) != 0;
}

bool fv_command_gate_velocities(const struct fv_command_gate *gate)
{
    return (gate->rules.from_network & FV_COMMAND_VELOCITY) != 0;
}

/* Whether the code at the end of the message is right: of the message with 0 in its place. */
static bool is_genuine(const struct fv_command_gate *gate, const struct fv_command_claim *claim)
{
    return claim->bytes >= MAC_BYTES &&
           (fv_siphash(gate->rules.key, claim->data, claim->bytes - MAC_BYTES, MAC_BYTES) ^
            (uint64_t)claim->mac) == 0;
}

/* Only for genuine commands: nobody else may move a counter. */
static enum fv_command_verdict pass_counter(struct fv_command_gate *gate,
                                            const struct fv_command_claim *command)
{
    uint32_t i = 0;
    if (command->counter <= 0) return FV_COMMAND_REPEATED;
    while (i < gate->sender_count && gate->senders[i].sender != command->sender)
        i++;
    if (i == FV_COMMAND_SENDERS_MAX) return FV_COMMAND_SENDERS;
    if (i == gate->sender_count) {
        gate->senders[gate->sender_count++].sender = command->sender;
        gate->senders[i].counter = 0;
    }
    if (command->counter <= gate->senders[i].counter) return FV_COMMAND_REPEATED;
    gate->senders[i].counter = command->counter;
    return FV_COMMAND_TAKEN;
}

enum fv_command_verdict fv_command_gate_claim(struct fv_command_gate *gate,
                                              const struct fv_command_claim *claim)
{
    const struct fv_command_rules *rules = &gate->rules;
    if (!claim->from_host && !claim->allowed) return FV_COMMAND_FORBIDDEN;
    if (rules->keyed && !is_genuine(gate, claim)) return FV_COMMAND_FORGED;
    if (claim->run_id != rules->run_id && (rules->keyed || claim->run_id != 0))
        return FV_COMMAND_OTHER_RUN;
    return rules->keyed ? pass_counter(gate, claim) : FV_COMMAND_TAKEN;
}

static enum fv_command_verdict judge(struct fv_command_gate *gate, const uint8_t *data,
                                     size_t bytes, bool from_host, int64_t now_ns,
                                     struct fv_judged_command *judged)
{
    const char *problem;
    size_t at;
    fovea_command_t command;
    if (!fv_message_check("fovea.command_t", data, bytes, &problem, &at) ||
        fovea_command_t_decode(data, 0, (int)bytes, &command) < 0)
        return FV_COMMAND_MALFORMED;
    const uint32_t bits = (uint32_t)command.commands;
    *judged = (struct fv_judged_command){
        .bits = bits, .commands = command.commands, .id = command.id, .sender = command.sender};
    const uint32_t alone = FOVEA_COMMAND_T_RECORD | FOVEA_COMMAND_T_RECORD_STOP;
    if ((bits & ~(uint32_t)FOVEA_COMMAND_T_OVERWRITE) == 0 || (bits & ~(uint32_t)FV_COMMAND_ALL) ||
        ((bits & alone) && (bits & (bits - 1))))
        return FV_COMMAND_UNKNOWN;
    const struct fv_command_claim claim = {.data = data,
                                           .bytes = bytes,
                                           .from_host = from_host,
                                           .allowed = (bits & ~commands_from_network(gate)) == 0,
                                           .run_id = command.run_id,
                                           .sender = command.sender,
                                           .counter = command.counter,
                                           .mac = command.mac};
    const enum fv_command_verdict verdict = fv_command_gate_claim(gate, &claim);
    if (verdict != FV_COMMAND_TAKEN) return verdict;
    if (bits & FOVEA_COMMAND_T_SAVE) {
        if (gate->saved && now_ns - gate->saved_ns < FV_COMMAND_SAVE_NS)
            return FV_COMMAND_TOO_OFTEN;
        gate->saved = true;
        gate->saved_ns = now_ns;
    }
    return FV_COMMAND_TAKEN;
}

void fv_command_gate_count(struct fv_command_gate *gate, enum fv_command_verdict verdict)
{
    atomic_fetch_add_explicit(&gate->counts[verdict], 1, memory_order_relaxed);
}

enum fv_command_verdict fv_command_gate_judge(struct fv_command_gate *gate, const uint8_t *data,
                                              size_t bytes, bool from_host, int64_t now_ns,
                                              struct fv_judged_command *command)
{
    *command = (struct fv_judged_command){0};
    command->verdict = judge(gate, data, bytes, from_host, now_ns, command);
    if (command->verdict != FV_COMMAND_TAKEN) {
        command->bits = 0;
        fv_command_gate_count(gate, command->verdict);
    }
    return command->verdict;
}

bool fv_command_gate_answers(struct fv_command_gate *gate, const struct fv_judged_command *command,
                             int64_t now_ns)
{
    if (command->verdict == FV_COMMAND_TAKEN || command->verdict == FV_COMMAND_MALFORMED)
        return false;
    if (gate->refusals == 0 || now_ns - gate->refusals_ns >= INT64_C(1000000000)) {
        gate->refusals = 0;
        gate->refusals_ns = now_ns;
    }
    if (gate->refusals == FV_COMMAND_REFUSALS_PER_S) return false;
    gate->refusals++;
    return true;
}
