#include "runtime/lockstep.h"

#include <string.h>

#include "base/hash.h"
#include "message/lockstep.h"
#include "message/recorded.h"
#include "runtime/jobs.h"
#include "runtime/ready_map.h"
#include "runtime/state.h"

_Static_assert(sizeof(struct fovea_feature) == 16, "features have no undefined bytes");

void fv_lockstep_own(struct fv_lockstep *lockstep, const char *owner, enum fovea_memory_part part,
                     size_t from, size_t bytes)
{
    const bool kept = part == FOVEA_MEMORY_PERSISTENT || part == FOVEA_MEMORY_JOB;
    if (!kept || bytes == 0) return;
    /* More owners than names: the last takes what is left. */
    if (lockstep->part_count == FV_LOCKSTEP_MAX - 1) {
        struct fv_lockstep_part *last = &lockstep->parts[FV_LOCKSTEP_MAX - 2];
        if (last->part == part) last->bytes = from + bytes - last->from;
        return;
    }
    lockstep->parts[lockstep->part_count++] =
        (struct fv_lockstep_part){.owner = owner, .part = part, .from = from, .bytes = bytes};
}

uint64_t fv_lockstep_frame_hash(const struct fovea_frame *frame)
{
    uint64_t hash = FV_HASH_START;
    if (frame == NULL) return 0;
    for (uint32_t i = 0; i < frame->image_count; i++)
        if (frame->images[i].data != NULL)
            hash = fv_hash_bulk(hash, frame->images[i].data,
                                fv_message_image_bytes(&frame->images[i]));
    return hash;
}

/* ---- what clocks measured -------------------------------------------------------------------- */

enum { READINGS_MAX = 12 };

/* Places of readings, which are zero while something is hashed. */
struct readings {
    uint32_t count;
    uint8_t *at[READINGS_MAX];
    int64_t kept[READINGS_MAX];
};

static void hide(struct readings *readings, void *at)
{
    static const int64_t zero;
    readings->at[readings->count] = at;
    memcpy(&readings->kept[readings->count++], at, sizeof zero);
    memcpy(at, &zero, sizeof zero);
}

static void show(struct readings *readings)
{
    while (readings->count > 0) {
        readings->count--;
        memcpy(readings->at[readings->count], &readings->kept[readings->count], sizeof(int64_t));
    }
}

/* The offsets to UTC that the state remembers with its frames. */
static void hide_in_state(struct fovea *rt, struct readings *readings)
{
    hide(readings, &rt->state->frame.utc_offset_ns);
    if (rt->preview.state != NULL) hide(readings, &rt->preview.state->frame.utc_offset_ns);
    if (rt->edges.state != NULL) hide(readings, &rt->edges.state->frame.utc_offset_ns);
    if (rt->calibration.state != NULL) hide(readings, &rt->calibration.state->frame.utc_offset_ns);
    for (int i = 0; i < 2; i++) {
        struct fv_detection_state *state = (i == 0 ? &rt->detection : &rt->detection2)->state;
        if (state == NULL) continue;
        hide(readings, &state->frame.utc_offset_ns);
        hide(readings, &state->found_frame.utc_offset_ns);
    }
    if (rt->free_space.state == NULL) return;
    hide(readings, &rt->free_space.state->noted_frame.utc_offset_ns);
    hide(readings, &rt->free_space.state->frame.utc_offset_ns);
}

/* In a message that was encoded: the offset to UTC of the stamp that it begins with, or utime, and
 * the latency at the end of a pose. */
static void hide_in_message(enum fv_message_kind kind, uint8_t *data, uint32_t bytes,
                            struct readings *readings)
{
    enum { HASH_BYTES = 8, OFFSET = HASH_BYTES + 8 + 1 + 1, UTIME = HASH_BYTES };
    hide(readings, data + (kind == FV_MESSAGE_BOT_CORE_POSE ? UTIME : OFFSET));
    if (kind == FV_MESSAGE_POSE || kind == FV_MESSAGE_CAMERA_POSE)
        hide(readings, data + bytes - sizeof(int64_t));
}

/* ---- hashing --------------------------------------------------------------------------------- */

/* The inputs as recordings hold them, in the buffer of the message, which is not written yet. */
static uint64_t hash_inputs(struct fovea *rt, const struct fovea_inputs *inputs)
{
    uint8_t *buffer = rt->outbox.buffer[FV_MESSAGE_LOCKSTEP];
    const size_t capacity = rt->outbox.capacity[FV_MESSAGE_LOCKSTEP];
    const fovea_stamp_t stamp = fv_message_stamp(inputs->frame, 0);
    uint64_t hash = FV_HASH_START;
    for (uint32_t i = 0; i < inputs->sample_count; i++) {
        const uint32_t bytes =
            fv_message_sample_encode(&inputs->samples[i], &stamp, buffer, capacity);
        hash = fv_hash_state(hash, buffer, bytes);
    }
    struct fovea_inputs counted = *inputs;
    counted.resident_bytes = 0; /* and what else clocks and processes measure */
    counted.temperature_c = 0;
    counted.latency_ns = 0;
    counted.utc_offset_ns = 0;
    counted.frames_late = 0;
    const uint32_t bytes =
        fv_message_inputs_encode(&counted, fv_lockstep_frame_hash(inputs->frame), buffer, capacity);
    hash = fv_hash_state(hash, buffer, bytes);
    if (inputs->map != NULL) hash = fv_hash(hash, &inputs->map->hash, sizeof inputs->map->hash);
    return fv_hash(hash, &stamp.time_ns, sizeof stamp.time_ns);
}

void fv_lockstep_begin(struct fovea *rt, const struct fovea_inputs *inputs)
{
    struct fv_lockstep *lockstep = &rt->lockstep;
    lockstep->due = fv_every(rt->state->steps, rt->config.lockstep_every);
    if (!lockstep->due) return;
    lockstep->iteration = rt->state->steps;
    lockstep->message_count = 0;
    lockstep->inputs_hash = hash_inputs(rt, inputs);
}

void fv_lockstep_sent(struct fovea *rt, const struct fovea_outputs *outputs)
{
    struct fv_lockstep *lockstep = &rt->lockstep;
    if (!lockstep->due) return;
    for (uint32_t i = 0; i < outputs->message_count; i++) {
        const struct fovea_message *message = &outputs->messages[i];
        const uint32_t at = lockstep->message_count;
        if (message->volatile_values || at == FV_LOCKSTEP_MAX) continue;
        lockstep->kinds[at] =
            (uint32_t)((message->channel - rt->outbox.channel[0]) / FV_MESSAGE_CHANNEL_BYTES);
        const enum fv_message_kind kind = (enum fv_message_kind)lockstep->kinds[at];
        uint8_t *data = rt->outbox.buffer[kind] + (message->data - rt->outbox.buffer[kind]);
        struct readings readings = {.count = 0};
        hide_in_message(kind, data, message->bytes, &readings);
        lockstep->hashes[at] = fv_hash_state(FV_HASH_START, data, message->bytes);
        show(&readings);
        lockstep->message_count++;
    }
}

void fv_lockstep_end(struct fovea *rt, const struct fovea_grants *grants,
                     struct fovea_outputs *outputs)
{
    struct fv_lockstep *lockstep = &rt->lockstep;
    if (!lockstep->due) return;
    lockstep->inputs_hash =
        fv_hash(lockstep->inputs_hash, &grants->features, sizeof grants->features);
    lockstep->inputs_hash = fv_hash(lockstep->inputs_hash, grants->units, sizeof grants->units);
    fv_lockstep_sent(rt, outputs);
    lockstep->due = false;
    struct fv_message_lockstep message = {
        .stamp =
            rt->state->any_frame ? fv_frame_id_stamp(&rt->state->frame) : fv_message_stamp(NULL, 0),
        .iteration = lockstep->iteration,
        .inputs_hash = lockstep->inputs_hash,
        .message_count = lockstep->message_count,
        .prefix_bytes =
            strlen(rt->config.channel_prefix) + (rt->config.channel_prefix[0] != '\0' ? 1 : 0),
    };
    uint32_t features;
    const struct fovea_feature *found = fovea_features_get(rt, &features);
    message.stages[message.stage_count++] = (struct fv_message_hash){
        "features", fv_hash_state(FV_HASH_START, found, features * sizeof *found)};
    struct readings readings = {.count = 0};
    hide_in_state(rt, &readings);
    for (uint32_t i = 0; i < lockstep->part_count; i++) {
        const struct fv_lockstep_part *part = &lockstep->parts[i];
        const uint64_t hash =
            fv_hash_state(FV_HASH_START, rt->part_base[part->part] + part->from, part->bytes);
        message.stages[message.stage_count++] = (struct fv_message_hash){part->owner, hash};
        message.state_hash = fv_hash(message.state_hash, &hash, sizeof hash);
    }
    show(&readings);
    for (uint32_t i = 0; i < lockstep->message_count; i++)
        message.messages[i] =
            (struct fv_message_hash){rt->outbox.channel[lockstep->kinds[i]], lockstep->hashes[i]};
    fv_output_add(rt, FV_MESSAGE_LOCKSTEP,
                  fv_message_lockstep_encode(&message, rt->outbox.buffer[FV_MESSAGE_LOCKSTEP],
                                             rt->outbox.capacity[FV_MESSAGE_LOCKSTEP]),
                  outputs);
}
