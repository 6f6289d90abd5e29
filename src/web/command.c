#include "web/command.h"

#include <string.h>

#include "app/network/command_gate.h"
#include "drivers/clock.h"
#include "message/message.h"

#include "fovea_command_t.h"

enum { COMMAND_BYTES_MAX = 128 };

enum fovea_status fv_web_commander_open(struct fv_web_commander *commander, const char *url,
                                        const char *key, struct fovea_error *error)
{
    memset(commander, 0, sizeof *commander);
    if (url[0] == '\0') return FOVEA_OK;
    commander->keyed = key != NULL;
    if (key != NULL) {
        const enum fovea_status status = fv_command_key_read(key, commander->key, error);
        if (status != FOVEA_OK) return status;
    }
    return fv_transport_open_early(url, 0, &commander->transport, error);
}

int64_t fv_web_commander_send(struct fv_web_commander *commander, const char *prefix,
                              int64_t run_id, int32_t bits)
{
    uint8_t data[COMMAND_BYTES_MAX];
    char channel[FV_MESSAGE_CHANNEL_BYTES];
    const int64_t now_ns = fv_clock_ns(CLOCK_REALTIME);
    commander->id = now_ns > commander->id ? now_ns : commander->id + 1; /* rises */
    fovea_command_t command = {.utime = now_ns / 1000,
                               .id = commander->id,
                               .commands = bits,
                               .run_id = run_id,
                               .sender = FV_WEB_SENDER,
                               .counter = commander->id};
    int bytes = fovea_command_t_encode(data, 0, sizeof data, &command);
    if (commander->keyed && bytes > 0) { /* of the message with mac 0 */
        command.mac = (int64_t)fv_siphash(commander->key, data, (size_t)bytes);
        bytes = fovea_command_t_encode(data, 0, sizeof data, &command);
    }
    fv_message_channel(prefix, FV_MESSAGE_COMMAND, channel);
    if (bytes > 0)
        fv_transport_put(commander->transport,
                         &(struct fovea_message){channel, data, (uint32_t)bytes, true});
    return commander->id;
}

void fv_web_commander_close(struct fv_web_commander *commander)
{
    if (commander->transport == NULL) return;
    fv_transport_finish(commander->transport);
    fv_transport_close(commander->transport);
    commander->transport = NULL;
}
