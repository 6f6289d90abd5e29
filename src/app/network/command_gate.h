/* Which commands are taken: the one place where a fovea.command_t from outside becomes bits for the
 * loop, or a reason for its refusal.
 *
 * Without a key every command from this host is taken, and from the network those that the
 * configuration allows. With a key each command must carry the code of the whole message
 * (siphash.h), name this run and have a higher counter than any before of its sender, wherever it
 * is from: what was recorded, from this run or another, is worthless. Saving writes and syncs a
 * file, so saves are taken at most once in FV_COMMAND_SAVE_NS.
 *
 * No heap, no system call, no clock; one thread at a time, but counts may be read from any. */
#ifndef FOVEA_APP_NETWORK_COMMAND_GATE_H
#define FOVEA_APP_NETWORK_COMMAND_GATE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "app/network/siphash.h"
#include "fovea/status.h"

enum {
    FV_COMMAND_SENDERS_MAX = 32,
    FV_COMMAND_ALL = 127, /* bits of command_t */
    /* in the place of OVERWRITE, which goes with SAVE, among those that the network may send */
    FV_COMMAND_PARAMETERS = 16,
    FV_COMMAND_LOAD = 64, /* maps; likewise in the place of RECORD_STOP, which goes with RECORD */
    FV_COMMAND_VELOCITY = 128, /* velocity commands (velocity_command_t) */
    FV_COMMAND_AUTO = 1 << 30
};
#define FV_COMMAND_SAVE_NS INT64_C(5000000000)

struct fv_command_rules {
    /* enum fovea_command bits that the network may send, FV_COMMAND_PARAMETERS, FV_COMMAND_LOAD and
     * FV_COMMAND_VELOCITY; FV_COMMAND_AUTO: all with a key, none without */
    uint32_t from_network;
    bool keyed;
    uint8_t key[FV_SIPHASH_KEY_BYTES];
    int64_t run_id;
};

enum fv_command_verdict {
    FV_COMMAND_TAKEN,
    FV_COMMAND_MALFORMED, /* no command_t */
    FV_COMMAND_UNKNOWN,   /* no bits, or others than there are */
    FV_COMMAND_FORBIDDEN, /* from the network, and not allowed from there */
    FV_COMMAND_FORGED,    /* its code is wrong or absent */
    FV_COMMAND_OTHER_RUN, /* it names another run */
    FV_COMMAND_REPEATED,  /* its counter is no higher than one before */
    FV_COMMAND_SENDERS,   /* there is no room for one more sender */
    FV_COMMAND_TOO_OFTEN, /* a save too soon after the last */
    FV_COMMAND_BUSY,      /* the loop has not yet taken those before */
    FV_COMMAND_VERDICTS
};
/* "forged"; for reports. */
const char *fv_command_verdict_name(enum fv_command_verdict verdict);
/* What was expected, for the sender of a refused command; at most 255 bytes. */
const char *fv_command_verdict_reason(enum fv_command_verdict verdict);

/* A judged command. */
struct fv_judged_command {
    enum fv_command_verdict verdict;
    uint32_t bits; /* enum fovea_command; 0: refused */
    /* Of the message, for the answer; 0 where it is malformed. */
    int32_t commands;
    int64_t id, sender;
};

/* Refused commands that are answered in a second: a flood of wrong ones does not become a flood of
 * answers. */
enum { FV_COMMAND_REFUSALS_PER_S = 10 };

struct fv_command_gate {
    struct fv_command_rules rules;
    struct {
        int64_t sender, counter;
    } senders[FV_COMMAND_SENDERS_MAX];
    uint32_t sender_count;
    bool saved;
    int64_t saved_ns;
    int64_t refusals_ns; /* when the second began in which this many refusals were answered */
    uint32_t refusals;
    atomic_uint_fast64_t counts[FV_COMMAND_VERDICTS];
};

void fv_command_gate_init(struct fv_command_gate *gate, const struct fv_command_rules *rules);

/* What a message says of its sender, and where it came from. */
struct fv_command_claim {
    const uint8_t *data; /* the whole encoded message, which ends in its code */
    size_t bytes;
    bool from_host;
    bool allowed; /* from the network */
    int64_t run_id, sender, counter, mac;
};

/* Judge the sender of a well-formed message that asks for something: allowed, genuine, for this
 * run, not repeated. Nothing is counted. FV_COMMAND_TAKEN where it may ask. */
enum fv_command_verdict fv_command_gate_claim(struct fv_command_gate *gate,
                                              const struct fv_command_claim *claim);

/* Whether the network may change parameters. */
bool fv_command_gate_parameters(const struct fv_command_gate *gate);
/* Whether it may load maps. */
bool fv_command_gate_loads(const struct fv_command_gate *gate);

/* Whether it may drive the source. */
bool fv_command_gate_velocities(const struct fv_command_gate *gate);

/* Judge the encoded message at `now_ns` (CLOCK_MONOTONIC), and count it if it is refused. Returns
 * command->verdict. */
enum fv_command_verdict fv_command_gate_judge(struct fv_command_gate *gate, const uint8_t *data,
                                              size_t bytes, bool from_host, int64_t now_ns,
                                              struct fv_judged_command *command);

/* Whether this refused command is to be answered: it has an id, and fewer than
 * FV_COMMAND_REFUSALS_PER_S were in this second. Counts it. */
bool fv_command_gate_answers(struct fv_command_gate *gate, const struct fv_judged_command *command,
                             int64_t now_ns);

void fv_command_gate_count(struct fv_command_gate *gate, enum fv_command_verdict verdict);

/* Read a key from a file of 32 hexadecimal digits. FOVEA_ERROR_INPUT: there is no such file, it is
 * no ordinary one, others than its owner may read or write it, it is neither root's nor ours, or it
 * holds something else; `error` says how a key is made. Init-only. */
enum fovea_status fv_command_key_read(const char *path, uint8_t key[FV_SIPHASH_KEY_BYTES],
                                      struct fovea_error *error);

#endif
