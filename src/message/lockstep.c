#include "message/lockstep.h"

#include <string.h>

#include "message/message.h"
#include "message/recorded.h"
#include "message/wire.h"

#include "fovea_lockstep_t.h"

_Static_assert((int)FV_MESSAGE_LOCKSTEP_MAX == (int)FOVEA_LOCKSTEP_T_COUNT_MAX,
               "what the type says");

size_t fv_message_lockstep_size_max(void)
{
    fovea_lockstep_t empty;
    memset(&empty, 0, sizeof empty);
    const size_t named = 4 + FV_MESSAGE_CHANNEL_BYTES + 8,
                 own = (size_t)fovea_lockstep_t_encoded_size(&empty) +
                       2 * (size_t)FV_MESSAGE_LOCKSTEP_MAX * named,
                 inputs = fv_message_inputs_size_max(), sample = fv_message_sample_size_max();
    const size_t hashed = inputs > sample ? inputs : sample;
    return own > hashed ? own : hashed;
}

static void names(const struct fv_message_hash *in, uint32_t count, size_t skipped,
                  fovea_named_hash_t *out)
{
    for (uint32_t i = 0; i < count; i++)
        out[i] = (fovea_named_hash_t){.name = (char *)(uintptr_t)(in[i].name + skipped),
                                      .hash = (int64_t)in[i].hash};
}

uint32_t fv_message_lockstep_encode(const struct fv_message_lockstep *in, uint8_t *buffer,
                                    size_t capacity)
{
    fovea_named_hash_t stages[FV_MESSAGE_LOCKSTEP_MAX], messages[FV_MESSAGE_LOCKSTEP_MAX];
    names(in->stages, in->stage_count, 0, stages);
    names(in->messages, in->message_count, in->prefix_bytes, messages);
    const fovea_lockstep_t message = {.stamp = in->stamp,
                                      .iteration = (int64_t)in->iteration,
                                      .inputs_hash = (int64_t)in->inputs_hash,
                                      .state_hash = (int64_t)in->state_hash,
                                      .stage_count = (int32_t)in->stage_count,
                                      .stages = stages,
                                      .message_count = (int32_t)in->message_count,
                                      .messages = messages};
    return fv_wire_encoded(
        fovea_lockstep_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}
