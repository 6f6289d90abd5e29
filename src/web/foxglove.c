#include "web/foxglove.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "drivers/clock.h"
#include "fovea/fovea.h"

enum {
    INFO = 0,
    WARNING = 1,
    ERROR = 2, /* levels of a status */
    DATA = 1,
    TIME = 2, /* kinds of bytes */
    DATA_BYTES = 13,
    TIME_BYTES = 9,
    QUALITIES = 3,
    DESCRIBED_BYTES = 8192,
    SMALL_BYTES = 8192,   /* 66 ms at 1 Mbit/s */
    SMALLS_IN_A_ROW = 24, /* before a large one has its turn */
    LARGE_PART = 3        /* large ones have at most a third of the link's time */
};
#define QUALITY_NS (FV_SECOND_NS / 2) /* between two falls */
#define BETTER_NS (3 * FV_SECOND_NS)  /* without a loss, before it rises; twice that each time */
#define BETTER_MAX_NS (60 * FV_SECOND_NS)
#define DEADLINE_NS (20 * FV_SECOND_NS) /* of a request for every key of a slow run */

void fv_foxglove_init(struct fv_foxglove_client *client, enum fv_web_role role, bool operates,
                      int64_t session, int64_t now_ns)
{
    memset(client, 0, sizeof *client);
    client->role = role;
    client->operates = operates;
    snprintf(client->session, sizeof client->session, "%" PRId64, session);
    client->better_ns = BETTER_NS;
    client->quality_ns = client->lost_ns = now_ns;
}

/* Whether there are pictures of the camera, and it wants them. */
static bool wants(const struct fv_foxglove_client *client, const struct fv_foxglove_views *views,
                  int32_t camera)
{
    const int32_t channel = views->image_channels[camera];
    return channel >= 0 && client->subscribed[channel].is;
}

uint32_t fv_foxglove_watches(const struct fv_foxglove_client *client,
                             const struct fv_foxglove_views *views)
{
    uint32_t bits = 0;
    for (int32_t i = 0; i < FOVEA_CAMERAS_MAX && client->epoch == views->epoch; i++)
        if (wants(client, views, i)) bits |= UINT32_C(1) << i;
    return bits;
}

/* ---- texts ----------------------------------------------------------------------------------- */

static void reply(struct fv_foxglove_client *client, int level, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
static void reply(struct fv_foxglove_client *client, int level, const char *format, ...)
{
    va_list arguments;
    if (client->reply_count == FV_FOXGLOVE_REPLIES) {
        client->reply_first++;
        client->reply_count--;
    }
    const uint32_t at = (client->reply_first + client->reply_count++) % FV_FOXGLOVE_REPLIES;
    client->replies[at].level = level;
    va_start(arguments, format);
    vsnprintf(client->replies[at].text, FV_FOXGLOVE_REPLY_BYTES, format, arguments);
    va_end(arguments);
    for (char *letter = client->replies[at].text; *letter != '\0'; letter++)
        if (*letter < ' ' || *letter > '~') *letter = '?'; /* cut letters would be no UTF-8 */
}

/* As text, and freed. Returns its bytes; 0: it does not fit. */
static size_t put_json(json_t *message, uint8_t *to, size_t capacity)
{
    const size_t bytes =
        message != NULL ? json_dumpb(message, (char *)to, capacity, JSON_COMPACT) : 0;
    json_decref(message);
    return bytes <= capacity ? bytes : 0;
}

static size_t next_greeting(struct fv_foxglove_client *client, uint8_t *to, size_t capacity)
{
    if (client->greeted) return 0;
    client->greeted = true;
    json_t *capabilities = client->operates
                               ? json_pack("[sss]", "parameters", "parametersSubscribe", "time")
                               : json_pack("[s]", "time");
    return put_json(json_pack("{ss ss so s{ss} ss}", "op", "serverInfo", "name",
                              "fovea " FOVEA_VERSION, "capabilities", capabilities, "metadata",
                              "fovea", FOVEA_VERSION, "sessionId", client->session),
                    to, capacity);
}

/* Channels of another prefix take the place of those that it knows. */
static size_t next_farewell(struct fv_foxglove_client *client,
                            const struct fv_foxglove_views *views, uint8_t *to, size_t capacity)
{
    if (client->epoch == views->epoch) return 0;
    json_t *ids = json_array();
    for (uint32_t i = 0; i < client->advertised; i++)
        json_array_append_new(ids, json_integer(client->first_id + i));
    const bool any = client->advertised > 0;
    client->epoch = views->epoch;
    client->first_id = views->first_id;
    client->advertised = 0;
    memset(client->subscribed, 0, sizeof client->subscribed);
    memset(client->versions, 0, sizeof client->versions);
    if (any)
        return put_json(json_pack("{ss so}", "op", "unadvertise", "channelIds", ids), to, capacity);
    json_decref(ids);
    return 0;
}

static void base64(const uint8_t *data, size_t bytes, char *to)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < bytes; i += 3) {
        const uint32_t group = (uint32_t)data[i] << 16 |
                               (i + 1 < bytes ? (uint32_t)data[i + 1] << 8 : 0) |
                               (i + 2 < bytes ? (uint32_t)data[i + 2] : 0);
        *to++ = digits[group >> 18];
        *to++ = digits[group >> 12 & 63];
        *to++ = i + 1 < bytes ? digits[group >> 6 & 63] : '=';
        *to++ = i + 2 < bytes ? digits[group & 63] : '=';
    }
    *to = '\0';
}

static size_t next_channel(struct fv_foxglove_client *client, const struct fv_foxglove_views *views,
                           uint8_t *to, size_t capacity)
{
    uint8_t described[DESCRIBED_BYTES];
    char schema[DESCRIBED_BYTES / 3 * 4 + 8];
    if (client->advertised == views->channel_count) return 0;
    const struct fv_foxglove_channel *channel = &views->channels[client->advertised];
    const bool is_json = channel->json != NULL;
    if (is_json)
        snprintf(schema, sizeof schema, "{\"type\": \"object\"}");
    else
        base64(described, fv_foxglove_schema_describe(channel->schema, described, sizeof described),
               schema);
    const uint32_t id = client->first_id + client->advertised++;
    return put_json(json_pack("{ss s[{sI ss ss ss ss ss}]}", "op", "advertise", "channels", "id",
                              (json_int_t)id, "topic", channel->topic, "encoding",
                              is_json ? "json" : "protobuf", "schemaName",
                              is_json ? channel->json : fv_foxglove_schema_name(channel->schema),
                              "schemaEncoding", is_json ? "jsonschema" : "protobuf", "schema",
                              schema),
                    to, capacity);
}

static size_t next_reply(struct fv_foxglove_client *client, uint8_t *to, size_t capacity)
{
    if (client->reply_count == 0) return 0;
    const uint32_t at = client->reply_first++ % FV_FOXGLOVE_REPLIES;
    client->reply_count--;
    return put_json(json_pack("{ss si ss}", "op", "status", "level", client->replies[at].level,
                              "message", client->replies[at].text),
                    to, capacity);
}

/* ---- parameters ------------------------------------------------------------------------------ */

/* A number or truth where the key is one and the value reads so, else a text. */
static json_t *value_of(const struct fv_settings_key *key, const char *value, bool *real)
{
    char *end;
    *real = key->kind == FV_CONFIG_REAL;
    if (key->kind == FV_CONFIG_BOOL && strcmp(value, "true") == 0) return json_true();
    if (key->kind == FV_CONFIG_BOOL && strcmp(value, "false") == 0) return json_false();
    if (key->kind == FV_CONFIG_U32 || key->kind == FV_CONFIG_U64 || key->kind == FV_CONFIG_I32) {
        const long long number = strtoll(value, &end, 10);
        if (end != value && *end == '\0') return json_integer(number);
    }
    if (*real) {
        const double number = strtod(value, &end);
        json_t *made = end != value && *end == '\0' ? json_real(number) : NULL; /* not NaN */
        if (made != NULL) return made;
        *real = false;
    }
    json_t *text = json_string(value);
    return text != NULL ? text : json_string("?"); /* no UTF-8 */
}

static void add_parameter(json_t *list, const struct fv_foxglove_parameters *parameters,
                          uint32_t key)
{
    bool real;
    if (parameters->keys[key].value == NULL) return;
    json_t *value = value_of(&fv_settings_keys[key], parameters->keys[key].value, &real);
    json_t *made = json_pack("{ss so}", "name", fv_settings_keys[key].name, "value", value);
    if (made != NULL && real) json_object_set_new(made, "type", json_string("float64"));
    if (made != NULL) json_array_append_new(list, made);
}

static size_t put_parameters(json_t *list, const char *id, uint8_t *to, size_t capacity)
{
    json_t *message = json_pack("{ss so}", "op", "parameterValues", "parameters", list);
    if (message != NULL && id[0] != '\0') json_object_set_new(message, "id", json_string(id));
    return put_json(message, to, capacity);
}

static bool is_waiting(const struct fv_foxglove_request *request)
{
    for (uint32_t key = 0; key < fv_settings_key_count; key++)
        if (request->waits[key]) return true;
    return false;
}

/* A request whose keys have all been answered. */
static size_t next_values(struct fv_foxglove_client *client,
                          const struct fv_foxglove_parameters *parameters, uint8_t *to,
                          size_t capacity, int64_t now_ns)
{
    for (int i = 0; i < FV_FOXGLOVE_REQUESTS; i++) {
        struct fv_foxglove_request *request = &client->requests[i];
        if (!request->used || (is_waiting(request) && now_ns < request->deadline_ns)) continue;
        request->used = false;
        for (uint32_t key = 0; request->sets && key < fv_settings_key_count; key++)
            if (request->waits[key])
                reply(client, ERROR, "%s: the run has not answered", fv_settings_keys[key].name);
        if (request->sets && request->id[0] == '\0') continue; /* only updates show it */
        json_t *list = json_array();
        for (uint32_t key = 0; key < fv_settings_key_count; key++)
            if (request->keys[key]) add_parameter(list, parameters, key);
        return put_parameters(list, request->id, to, capacity);
    }
    return 0;
}

static size_t next_updates(struct fv_foxglove_client *client,
                           const struct fv_foxglove_parameters *parameters, uint8_t *to,
                           size_t capacity)
{
    json_t *list = NULL;
    for (uint32_t key = 0; key < fv_settings_key_count; key++) {
        const uint32_t version = parameters->keys[key].version;
        if (!client->watched[key] || client->watched_versions[key] == version) continue;
        client->watched_versions[key] = version;
        if (list == NULL) list = json_array();
        add_parameter(list, parameters, key);
    }
    return list != NULL ? put_parameters(list, "", to, capacity) : 0;
}

void fv_foxglove_answered(struct fv_foxglove_client *client,
                          const struct fv_foxglove_answer *answer)
{
    const char *name = fv_settings_keys[answer->key].name;
    for (int i = 0; i < FV_FOXGLOVE_REQUESTS; i++) {
        struct fv_foxglove_request *request = &client->requests[i];
        if (!request->used || !request->waits[answer->key]) continue;
        bool ours = !request->sets;
        for (int n = 0; n < FV_FOXGLOVE_SETS; n++)
            if (request->sets && answer->id != 0 && request->sent[n] == answer->id) {
                request->sent[n] = 0;
                ours = true;
            }
        if (!ours) continue;
        request->waits[answer->key] = false;
        const char *reason = answer->reason;
        const size_t length = strlen(name);
        if (strncmp(reason, name, length) == 0 && strncmp(reason + length, ": ", 2) == 0)
            reason += length + 2; /* it is named once */
        if (answer->result == FV_FOXGLOVE_SILENT || (request->sets && reason[0] != '\0'))
            reply(client, answer->result == FV_FOXGLOVE_NEEDS_RESTART ? WARNING : ERROR, "%s: %s",
                  name, reason);
    }
}

/* ---- what is subscribed to ------------------------------------------------------------------- */

static size_t put_number(uint8_t *to, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++)
        to[i] = (uint8_t)(value >> 8 * i);
    return (size_t)bytes;
}

static size_t next_time(struct fv_foxglove_client *client, const struct fv_foxglove_views *views,
                        uint8_t *to)
{
    if (client->time_ns == views->time_ns || views->time_ns == 0) return 0;
    client->time_ns = views->time_ns;
    to[0] = TIME;
    put_number(to + 1, (uint64_t)views->time_ns, 8);
    return TIME_BYTES;
}

static size_t put_head(const struct fv_foxglove_client *client, uint32_t channel, int64_t time_ns,
                       uint8_t *to)
{
    to[0] = DATA;
    put_number(to + 1, client->subscribed[channel].id, 4);
    put_number(to + 5, (uint64_t)time_ns, 8);
    return DATA_BYTES;
}

static size_t next_view(struct fv_foxglove_client *client, struct fv_foxglove_views *views,
                        uint32_t index, uint8_t *to, size_t capacity)
{
    const struct fv_foxglove_view *view = &views->views[index];
    size_t bytes;
    if (!client->subscribed[view->channel].is || client->versions[index] == view->version) return 0;
    client->versions[index] = view->version;
    const uint8_t *made = fv_foxglove_views_made(views, index, &bytes);
    if (made == NULL || DATA_BYTES + bytes > capacity) return 0;
    const size_t head = put_head(client, view->channel, view->time_ns, to);
    memcpy(to + head, made, bytes);
    return head + bytes;
}

static size_t next_line(struct fv_foxglove_client *client, const struct fv_foxglove_views *views,
                        uint8_t *to)
{
    if (client->log_sent < views->log_first) client->log_sent = views->log_first;
    if (views->log_channel < 0 || !client->subscribed[views->log_channel].is ||
        client->log_sent == views->log_count)
        return 0;
    if (views->log_count - client->log_sent > FV_FOXGLOVE_LOG_MAX)
        client->log_sent = views->log_count - FV_FOXGLOVE_LOG_MAX;
    const uint64_t at = client->log_sent++ % FV_FOXGLOVE_LOG_MAX;
    const size_t head = put_head(client, (uint32_t)views->log_channel, views->log[at].time_ns, to);
    memcpy(to + head, views->log[at].data, views->log[at].bytes);
    return head + views->log[at].bytes;
}

/* Once for each picture that is there to be sent. */
static void judge_quality(struct fv_foxglove_client *client, uint32_t before, uint32_t number,
                          int64_t now_ns)
{
    const bool lost = before != 0 && number > before + 1;
    if (lost) client->lost_ns = now_ns;
    if (lost && client->quality < QUALITIES - 1 && now_ns - client->quality_ns > QUALITY_NS) {
        client->quality++;
        client->quality_ns = now_ns;
        client->better_ns =
            2 * client->better_ns < BETTER_MAX_NS ? 2 * client->better_ns : BETTER_MAX_NS;
    } else if (client->quality > 0 && now_ns - client->lost_ns > client->better_ns &&
               now_ns - client->quality_ns > client->better_ns) {
        client->quality--;
        client->quality_ns = now_ns;
    }
}

/* Of the size that the camera gives: annotations are in its pixels. */
static size_t next_picture(struct fv_foxglove_client *client, const struct fv_foxglove_shown *shown,
                           int32_t camera, uint8_t *to, size_t capacity, int64_t now_ns)
{
    const struct fv_foxglove_views *views = shown->views;
    struct fv_web_picture *picture = fv_web_store_picture(shown->store, (uint32_t)camera);
    size_t bytes, made = 0;
    if (!wants(client, views, camera) || picture->image.data == NULL ||
        client->pictures[camera] == picture->number)
        return 0;
    judge_quality(client, client->pictures[camera], picture->number, now_ns);
    client->pictures[camera] = picture->number;
    for (int quality = client->quality; made == 0 && quality < QUALITIES; quality++) {
        const uint8_t *jpeg =
            fv_web_picture_jpeg(picture, fv_web_jpeg_whole(picture->image.width, quality), &bytes);
        if (jpeg == NULL) return 0;
        made = fv_foxglove_views_image(views, camera, picture->stamp_ns, jpeg, bytes,
                                       to + DATA_BYTES, capacity - DATA_BYTES);
    }
    if (made == 0) return 0;
    return put_head(client, (uint32_t)views->image_channels[camera],
                    fv_foxglove_views_time(views, picture->stamp_ns), to) +
           made;
}

/* A view is as large as its message or as what was made of the one before, which grows: of a map
 * that comes in parts all of it is shown. */
static bool is_small(const struct fv_foxglove_views *views, uint32_t index)
{
    if (index >= views->view_count) return index == views->view_count; /* the log, or a picture */
    const struct fv_foxglove_view *view = &views->views[index];
    return view->raw_bytes <= SMALL_BYTES && view->made_bytes <= SMALL_BYTES;
}

/* The small ones or the large ones, each in its turn, so that none keeps the others waiting: views,
 * the log, pictures. */
static size_t next_sized(struct fv_foxglove_client *client, const struct fv_foxglove_shown *shown,
                         bool small, uint8_t *to, size_t capacity, int64_t now_ns)
{
    const uint32_t count = shown->views->view_count, all = count + 1 + FOVEA_CAMERAS_MAX;
    for (uint32_t n = 0; n < all; n++) {
        const uint32_t i = client->turns[small]++ % all;
        if (is_small(shown->views, i) != small) continue;
        const size_t bytes = i < count    ? next_view(client, shown->views, i, to, capacity)
                             : i == count ? next_line(client, shown->views, to)
                                          : next_picture(client, shown, (int32_t)(i - count - 1),
                                                         to, capacity, now_ns);
        if (bytes > 0) return bytes;
    }
    return 0;
}

/* Large ones take a part of the link alone: for the rest of the time small ones do not wait for
 * one. */
static void note_large(struct fv_foxglove_client *client, size_t bytes, int64_t now_ns)
{
    if (client->bytes_per_s == 0) return;
    const double link_s = (double)bytes / (double)client->bytes_per_s;
    client->large_ns = now_ns + (int64_t)(LARGE_PART * (link_s < 1 ? link_s : 1) * 1e9);
}

/* Poses and numbers do not wait for pictures on a slow link, nor pictures for ever for these. */
static size_t next_data(struct fv_foxglove_client *client, const struct fv_foxglove_shown *shown,
                        uint8_t *to, size_t capacity, int64_t now_ns)
{
    if (now_ns < client->large_ns) return next_sized(client, shown, true, to, capacity, now_ns);
    const bool small_first = client->smalls < SMALLS_IN_A_ROW;
    size_t bytes = next_sized(client, shown, small_first, to, capacity, now_ns);
    const bool small = (bytes > 0) == small_first;
    if (bytes == 0) bytes = next_sized(client, shown, !small_first, to, capacity, now_ns);
    if (bytes > 0) client->smalls = small ? client->smalls + 1 : 0;
    if (bytes > SMALL_BYTES) note_large(client, bytes, now_ns);
    return bytes;
}

size_t fv_foxglove_next(struct fv_foxglove_client *client, const struct fv_foxglove_shown *shown,
                        uint8_t *to, size_t capacity, int64_t now_ns, bool *text)
{
    size_t bytes;
    *text = true;
    fv_foxglove_views_cameras(shown->views, shown->store->cameras);
    if ((bytes = next_greeting(client, to, capacity)) > 0) return bytes;
    if ((bytes = next_farewell(client, shown->views, to, capacity)) > 0) return bytes;
    if ((bytes = next_channel(client, shown->views, to, capacity)) > 0) return bytes;
    if ((bytes = next_reply(client, to, capacity)) > 0) return bytes;
    if ((bytes = next_values(client, shown->parameters, to, capacity, now_ns)) > 0) return bytes;
    if ((bytes = next_updates(client, shown->parameters, to, capacity)) > 0) return bytes;
    *text = false;
    if ((bytes = next_time(client, shown->views, to)) > 0) return bytes;
    return next_data(client, shown, to, capacity, now_ns);
}

/* ---- what a client says ---------------------------------------------------------------------- */

static bool is_used(const struct fv_foxglove_client *client, uint32_t subscription)
{
    for (int i = 0; i < FV_FOXGLOVE_CHANNELS_MAX; i++)
        if (client->subscribed[i].is && client->subscribed[i].id == subscription) return true;
    return false;
}

static void subscribe(struct fv_foxglove_client *client, struct fv_foxglove_views *views,
                      uint32_t subscription, uint32_t id)
{
    const uint32_t channel = id - client->first_id;
    if (id < client->first_id || channel >= client->advertised) {
        reply(client, ERROR, "channel %" PRIu32 ": there is none", id);
        return;
    }
    if (client->subscribed[channel].is || is_used(client, subscription)) {
        reply(client, WARNING, "channel %" PRIu32 ": %s", id,
              client->subscribed[channel].is ? "subscribed already"
                                             : "another one has this subscription's id");
        return;
    }
    client->subscribed[channel].is = true;
    client->subscribed[channel].id = subscription;
    for (uint32_t i = 0; i < views->view_count; i++) /* what came last is sent once more */
        if (views->views[i].channel == channel) client->versions[i] = 0;
    if ((int32_t)channel == views->log_channel) client->log_sent = 0;
    for (int i = 0; i < FOVEA_CAMERAS_MAX; i++)
        if ((int32_t)channel == views->image_channels[i]) client->pictures[i] = 0;
}

static void unsubscribe(struct fv_foxglove_client *client, uint32_t subscription)
{
    for (int i = 0; i < FV_FOXGLOVE_CHANNELS_MAX; i++)
        if (client->subscribed[i].id == subscription) client->subscribed[i].is = false;
}

static struct fv_foxglove_request *request_begin(struct fv_foxglove_client *client, const char *id,
                                                 bool sets, int64_t now_ns)
{
    for (int i = 0; i < FV_FOXGLOVE_REQUESTS; i++) {
        struct fv_foxglove_request *request = &client->requests[i];
        if (request->used) continue;
        memset(request, 0, sizeof *request);
        request->used = true;
        request->sets = sets;
        request->deadline_ns = now_ns + DEADLINE_NS;
        memcpy(request->id, id, FV_FOXGLOVE_ID_BYTES);
        return request;
    }
    reply(client, ERROR, "parameters: %d requests wait for the run's answer, expected fewer",
          FV_FOXGLOVE_REQUESTS);
    return NULL;
}

static void get(struct fv_foxglove_client *client, struct fv_foxglove_parameters *parameters,
                const struct fv_foxglove_said *said, int64_t now_ns)
{
    struct fv_foxglove_request *request = request_begin(client, said->id, false, now_ns);
    if (request == NULL) return;
    for (uint32_t key = 0; said->count == 0 && key < fv_settings_key_count; key++)
        request->keys[key] = true;
    for (uint32_t i = 0; i < said->count; i++) {
        const int32_t key = fv_foxglove_parameters_find(said->names[i]);
        if (key >= 0)
            request->keys[key] = true;
        else
            reply(client, WARNING, "%s: no key of the configuration", said->names[i]);
    }
    for (uint32_t key = 0; key < fv_settings_key_count; key++) {
        request->waits[key] = request->keys[key];
        if (request->keys[key]) fv_foxglove_parameters_want(parameters, key);
    }
}

static void set(struct fv_foxglove_client *client, struct fv_foxglove_parameters *parameters,
                const struct fv_foxglove_said *said, int64_t now_ns)
{
    struct fv_foxglove_request *request = request_begin(client, said->id, true, now_ns);
    if (request == NULL) return;
    request->deadline_ns = now_ns + FV_FOXGLOVE_PATIENCE_S * FV_SECOND_NS;
    for (uint32_t i = 0; i < said->count; i++) {
        const int32_t key = fv_foxglove_parameters_find(said->names[i]);
        const char *reason = key < 0 ? "no key of the configuration" : said->refused[i];
        if (reason != NULL) reply(client, ERROR, "%s: %s", said->names[i], reason);
        if (key >= 0) request->keys[key] = true;
        if (reason != NULL) continue;
        request->waits[key] = true;
        request->sent[i] =
            fv_web_commander_set(parameters->commander, parameters->prefix, parameters->run_id,
                                 said->names[i], said->values[i], false);
    }
}

static void watch(struct fv_foxglove_client *client,
                  const struct fv_foxglove_parameters *parameters,
                  const struct fv_foxglove_said *said)
{
    const bool watched = said->op == FV_FOXGLOVE_WATCH;
    for (uint32_t i = 0; i < said->count; i++) {
        const int32_t key = fv_foxglove_parameters_find(said->names[i]);
        if (key < 0) continue;
        client->watched[key] = watched;
        client->watched_versions[key] = parameters->keys[key].version;
    }
}

static void refuse(struct fv_foxglove_client *client, const struct fv_foxglove_said *said,
                   const char *reason)
{
    if (said->op != FV_FOXGLOVE_SET) {
        reply(client, ERROR, "parameters: %s", reason);
        return;
    }
    for (uint32_t i = 0; i < said->count; i++)
        reply(client, ERROR, "%s: %s", said->names[i], reason);
}

void fv_foxglove_do(struct fv_foxglove_client *client, const struct fv_foxglove_shown *shown,
                    const struct fv_foxglove_said *said, const char *refusal, int64_t now_ns)
{
    switch (said->op) {
    case FV_FOXGLOVE_WRONG:
        if (said->problem[0] != '\0') reply(client, ERROR, "%s", said->problem);
        return;
    case FV_FOXGLOVE_SUBSCRIBE:
        for (uint32_t i = 0; i < said->count; i++)
            subscribe(client, shown->views, said->subscriptions[i].id,
                      said->subscriptions[i].channel);
        return;
    case FV_FOXGLOVE_UNSUBSCRIBE:
        for (uint32_t i = 0; i < said->count; i++)
            unsubscribe(client, said->subscriptions[i].id);
        return;
    default:
        break;
    }
    if (refusal != NULL)
        refuse(client, said, refusal);
    else if (said->op == FV_FOXGLOVE_GET)
        get(client, shown->parameters, said, now_ns);
    else if (said->op == FV_FOXGLOVE_SET)
        set(client, shown->parameters, said, now_ns);
    else
        watch(client, shown->parameters, said);
}
