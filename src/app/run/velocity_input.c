#include "app/run/velocity_input.h"

#include <inttypes.h>
#include <string.h>

#include "drivers/table.h"
#include "message/fields.h"
#include "support/say.h"

#include "fovea_velocity_command_t.h"

enum { VELOCITY_BYTES_MAX = 256 };
static const double plausible = 100; /* m/s, rad/s: nothing that is driven here is faster */

void fv_velocity_input_open(struct fv_velocity_input *input, struct fv_requests *requests,
                            const struct fovea_source_ops *ops, struct fovea_source *source,
                            const char *prefix)
{
    memset(input, 0, sizeof *input);
    input->requests = requests;
    input->ops = ops;
    input->source = source;
    pthread_mutex_init(&input->lock, NULL);
    fv_message_channel(prefix, FV_MESSAGE_VELOCITY_COMMAND, input->channel);
}

static void add(atomic_uint_fast64_t *count)
{
    atomic_fetch_add_explicit(count, 1, memory_order_relaxed);
}

/* Well-formed, finite and of a size that makes sense. */
static bool decode(const struct fv_received *received, fovea_velocity_command_t *message)
{
    const char *problem;
    size_t at;
    if (!fv_message_check("fovea.velocity_command_t", received->data, received->bytes, &problem,
                          &at) ||
        fovea_velocity_command_t_decode(received->data, 0, (int)received->bytes, message) < 0)
        return false;
    for (int i = 0; i < 3; i++)
        if (!(message->velocity_m_s[i] > -plausible && message->velocity_m_s[i] < plausible &&
              message->angular_rate[i] > -plausible && message->angular_rate[i] < plausible))
            return false;
    return true;
}

/* Said once, since a controller gets no answer. */
static void say_dropped(struct fv_velocity_input *input, const char *why)
{
    if (!input->said) fv_say("velocity commands are dropped: %s", why);
    input->said = true;
}

static enum fovea_status drive(struct fv_velocity_input *input,
                               const struct fovea_velocity_command *command,
                               struct fovea_error *error)
{
    enum fovea_status status = FOVEA_END;
    pthread_mutex_lock(&input->lock);
    if (input->source != NULL) status = fv_source_drive(input->ops, input->source, command, error);
    pthread_mutex_unlock(&input->lock);
    return status;
}

static void hand_over(struct fv_velocity_input *input, const fovea_velocity_command_t *message)
{
    struct fovea_velocity_command command = {.sequence = message->sequence};
    struct fovea_error error = {.text = ""};
    memcpy(command.velocity_m_s, message->velocity_m_s, sizeof command.velocity_m_s);
    memcpy(command.angular_rate, message->angular_rate, sizeof command.angular_rate);
    const enum fovea_status status = drive(input, &command, &error);
    if (status < 0) say_dropped(input, error.text);
    if (status == FOVEA_END) return;
    add(status == FOVEA_OK      ? &input->taken
        : status == FOVEA_AGAIN ? &input->busy
                                : &input->refused);
}

static void take(void *context, const struct fv_received *received)
{
    struct fv_velocity_input *input = context;
    struct fv_command_gate *gate = &input->requests->gate;
    fovea_velocity_command_t message;
    if (!decode(received, &message)) {
        add(&input->malformed);
        say_dropped(input, "found a malformed one or a number of 100 and more, expected a "
                           "velocity_command_t in m/s and rad/s");
        return;
    }
    const struct fv_command_claim claim = {.data = received->data,
                                           .bytes = received->bytes,
                                           .from_host = received->from_host,
                                           .allowed = fv_command_gate_velocities(gate),
                                           .run_id = message.run_id,
                                           .sender = message.sender,
                                           .counter = message.counter,
                                           .mac = message.mac};
    const enum fv_command_verdict verdict = fv_command_gate_claim(gate, &claim);
    if (verdict == FV_COMMAND_TAKEN) {
        hand_over(input, &message);
        return;
    }
    add(&input->refused);
    say_dropped(input, fv_command_verdict_reason(verdict));
}

struct fv_receiver_channel fv_velocity_input_row(struct fv_velocity_input *input)
{
    return fv_receiver_channel_of(input->channel, "fovea.velocity_command_t", VELOCITY_BYTES_MAX,
                                  take, input);
}

bool fv_velocity_input_drives(const struct fv_velocity_input *input)
{
    return atomic_load_explicit(&input->taken, memory_order_relaxed) > 0;
}

void fv_velocity_input_end(struct fv_velocity_input *input)
{
    if (input->source == NULL) return;
    pthread_mutex_lock(&input->lock);
    input->source = NULL;
    pthread_mutex_unlock(&input->lock);
}

void fv_velocity_input_tell(FILE *out, const struct fv_velocity_input *input)
{
    const uint64_t taken = atomic_load(&input->taken), refused = atomic_load(&input->refused),
                   malformed = atomic_load(&input->malformed), busy = atomic_load(&input->busy);
    if (taken + refused + malformed + busy == 0) return;
    fprintf(out,
            "  velocity commands: %" PRIu64 " taken, %" PRIu64 " refused, %" PRIu64
            " malformed, %" PRIu64 " too many at once\n",
            taken, refused, malformed, busy);
}
