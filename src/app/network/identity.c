#include "app/network/identity.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "drivers/clock.h"
#include "message/fields.h"
#include "support/say.h"

#include "fovea_run_t.h"

void fv_identity_make(struct fv_identity *identity, const char *prefix, int64_t run_id)
{
    char host[65] = "", of[FV_MESSAGE_CHANNEL_BYTES], version[] = FOVEA_VERSION;
    memset(identity, 0, sizeof *identity);
    if (gethostname(host, sizeof host - 1) != 0) host[0] = '\0';
    snprintf(of, sizeof of, "%s", prefix);
    fv_message_channel(prefix, FV_MESSAGE_RUN, identity->channel);
    const fovea_run_t message = {.run_id = run_id,
                                 .utime = fv_clock_ns(CLOCK_REALTIME) / 1000,
                                 .prefix = of,
                                 .host = host,
                                 .process = getpid(),
                                 .version = version};
    const int bytes = fovea_run_t_encode(identity->data, 0, sizeof identity->data, &message);
    if (bytes <= 0) return;
    identity->bytes = (uint32_t)bytes;
    identity->run_id = run_id;
}

bool fv_identity_read(struct fv_identity *identity, const uint8_t *data, uint32_t bytes)
{
    const char *problem;
    size_t at;
    fovea_run_t message;
    memset(identity, 0, sizeof *identity);
    if (bytes > sizeof identity->data ||
        !fv_message_check("fovea.run_t", data, bytes, &problem, &at) ||
        fovea_run_t_decode(data, 0, (int)bytes, &message) < 0)
        return false;
    if (strlen(message.prefix) + sizeof "_RUN" <= sizeof identity->channel) {
        identity->run_id = message.run_id;
        identity->bytes = bytes;
        memcpy(identity->data, data, bytes);
        fv_message_channel(message.prefix, FV_MESSAGE_RUN, identity->channel);
    }
    fovea_run_t_decode_cleanup(&message);
    return identity->run_id != 0;
}

/* Said once for each run; of more than are remembered nothing is said. */
static void take(void *context, const struct fv_received *received)
{
    struct fv_identity_watch *watch = context;
    fovea_run_t message;
    if (fovea_run_t_decode(received->data, 0, (int)received->bytes, &message) < 0) return;
    bool known = message.run_id == watch->own || watch->others == FV_IDENTITIES_KNOWN;
    for (uint32_t i = 0; i < watch->others; i++)
        known = known || watch->known[i] == message.run_id;
    if (!known) {
        watch->known[watch->others++] = message.run_id;
        fv_say("LCM: another run sends on %s too: %016" PRIx64 ", process %" PRId64
               " on %.64s, Fovea %.32s; expected one sender per channel_prefix",
               received->channel, (uint64_t)message.run_id, message.process, message.host,
               message.version);
    }
    fovea_run_t_decode_cleanup(&message);
}

struct fv_receiver_channel fv_identity_row(const char *prefix, struct fv_identity_watch *watch)
{
    struct fv_receiver_channel row = {
        .type = "fovea.run_t", .bytes_max = FV_IDENTITY_BYTES, .take = take, .context = watch};
    fv_message_channel(prefix, FV_MESSAGE_RUN, row.name);
    return row;
}
