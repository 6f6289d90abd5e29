#include "web/command.h"

#include <stdlib.h>
#include <string.h>

#include "app/network/command_gate.h"
#include "drivers/clock.h"
#include "message/message.h"

#include "fovea_command_t.h"
#include "fovea_map_load_t.h"
#include "fovea_parameter_t.h"
#include "fovea_settings_t.h"

enum { COMMAND_BYTES_MAX = 128, PARAMETER_BYTES_MAX = 1024 };

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

/* A number that rises. */
static int64_t next_id(struct fv_web_commander *commander, int64_t now_ns)
{
    commander->id = now_ns > commander->id ? now_ns : commander->id + 1;
    return commander->id;
}

/* Proves that the sender knows the key: of the message with mac 0. */
static int64_t mac_of(const struct fv_web_commander *commander, const uint8_t *data, int bytes)
{
    return commander->keyed && bytes > 0
               ? (int64_t)fv_siphash(commander->key, data, (size_t)bytes, 0)
               : 0;
}

static void put(struct fv_web_commander *commander, const char *prefix, enum fv_message_kind kind,
                const uint8_t *data, int bytes)
{
    char channel[FV_MESSAGE_CHANNEL_BYTES];
    fv_message_channel(prefix, kind, channel);
    if (bytes > 0)
        fv_transport_put(commander->transport,
                         &(struct fovea_message){channel, data, (uint32_t)bytes, true});
}

int64_t fv_web_commander_send(struct fv_web_commander *commander, const char *prefix,
                              int64_t run_id, int32_t bits)
{
    uint8_t data[COMMAND_BYTES_MAX];
    const int64_t now_ns = fv_clock_ns(CLOCK_REALTIME);
    fovea_command_t command = {.utime = now_ns / 1000,
                               .id = next_id(commander, now_ns),
                               .commands = bits,
                               .run_id = run_id,
                               .sender = FV_WEB_SENDER,
                               .counter = commander->id};
    const int bytes = fovea_command_t_encode(data, 0, sizeof data, &command);
    command.mac = mac_of(commander, data, bytes);
    put(commander, prefix, FV_MESSAGE_COMMAND, data,
        fovea_command_t_encode(data, 0, sizeof data, &command));
    return commander->id;
}

int64_t fv_web_commander_set(struct fv_web_commander *commander, const char *prefix, int64_t run_id,
                             const char *key, const char *value, bool keep)
{
    uint8_t data[PARAMETER_BYTES_MAX];
    const int64_t now_ns = fv_clock_ns(CLOCK_REALTIME);
    fovea_parameter_t request = {.utime = now_ns / 1000,
                                 .id = next_id(commander, now_ns),
                                 .key = (char *)(uintptr_t)key,
                                 .value = (char *)(uintptr_t)value,
                                 .keep = keep,
                                 .run_id = run_id,
                                 .sender = FV_WEB_SENDER,
                                 .counter = commander->id};
    const int bytes = fovea_parameter_t_encode(data, 0, sizeof data, &request);
    request.mac = mac_of(commander, data, bytes);
    put(commander, prefix, FV_MESSAGE_PARAMETER, data,
        fovea_parameter_t_encode(data, 0, sizeof data, &request));
    return commander->id;
}

int64_t fv_web_commander_map(struct fv_web_commander *commander, const char *prefix, int64_t run_id,
                             const char *file)
{
    uint8_t data[PARAMETER_BYTES_MAX];
    const int64_t now_ns = fv_clock_ns(CLOCK_REALTIME);
    fovea_map_load_t request = {.utime = now_ns / 1000,
                                .id = next_id(commander, now_ns),
                                .file = (char *)(uintptr_t)file,
                                .run_id = run_id,
                                .sender = FV_WEB_SENDER,
                                .counter = commander->id};
    const int bytes = fovea_map_load_t_encode(data, 0, sizeof data, &request);
    request.mac = mac_of(commander, data, bytes);
    put(commander, prefix, FV_MESSAGE_MAP_LOAD, data,
        fovea_map_load_t_encode(data, 0, sizeof data, &request));
    return commander->id;
}

int64_t fv_web_commander_settings(struct fv_web_commander *commander, const char *prefix,
                                  int64_t run_id, const char *text)
{
    const size_t capacity = FV_KEPT_BYTES_MAX + 512;
    const int64_t now_ns = fv_clock_ns(CLOCK_REALTIME);
    uint8_t *data = malloc(capacity);
    if (data == NULL) return 0;
    fovea_settings_t request = {.utime = now_ns / 1000,
                                .id = next_id(commander, now_ns),
                                .text = (char *)(uintptr_t)text,
                                .run_id = run_id,
                                .sender = FV_WEB_SENDER,
                                .counter = commander->id};
    const int bytes = fovea_settings_t_encode(data, 0, capacity, &request);
    request.mac = mac_of(commander, data, bytes);
    put(commander, prefix, FV_MESSAGE_SETTINGS, data,
        fovea_settings_t_encode(data, 0, capacity, &request));
    free(data);
    return commander->id;
}

void fv_web_commander_close(struct fv_web_commander *commander)
{
    if (commander->transport == NULL) return;
    fv_transport_finish(commander->transport);
    fv_transport_close(commander->transport);
    commander->transport = NULL;
}
