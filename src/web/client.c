#include "web/client.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/clock.h"
#include "fovea/fovea.h"

#include "fovea_command_t.h"

enum {
    KIND_MESSAGE = 1,
    KIND_PICTURE,
    KIND_PATH,
    PLACES_MAX = 512,
    POINTS_FEW = 600,
    ECHO_BYTES = 120
};
#define CLASS_NS (FV_SECOND_NS / 2) /* between two falls */
#define BETTER_NS (2 * FV_SECOND_NS)
#define BETTER_MAX_NS (60 * FV_SECOND_NS)
#define FIRST_NS (FV_SECOND_NS / 4) /* between two rises, before the first fall */
#define SLOW_NS (FV_SECOND_NS / 10) /* beyond the least way to the page and back */
#define FAST_NS (FV_SECOND_NS / 20)

void fv_web_client_init(struct fv_web_client *client, enum fv_web_role role, bool commands)
{
    memset(client, 0, sizeof *client);
    client->role = role;
    client->commands = commands;
    client->news = UINT32_MAX;
    client->path_epoch = UINT32_MAX;
    client->ack_least_ns = BETTER_MAX_NS; /* until one is acknowledged */
    client->better_ns = FIRST_NS;
    client->picture_class = FV_WEB_CLASSES - 1;
}

/* What was sent of another run, or robot. */
static void forget_versions(struct fv_web_client *client)
{
    memset(client->versions, 0, sizeof client->versions);
    client->log_sent = 0;
    client->unacked_count = 0;
}

void fv_web_client_show(struct fv_web_client *client, uint32_t robot, bool commands)
{
    client->robot = robot;
    client->commands = commands;
    client->news = UINT32_MAX;
    client->path_epoch = UINT32_MAX;
    client->camera = 0;
    client->robots_sent = client->sent = client->frame = client->playback = 0;
    forget_versions(client);
}

void fv_web_client_reply(struct fv_web_client *client, const char *format, ...)
{
    va_list arguments;
    if (client->reply_count == FV_WEB_REPLIES) {
        client->reply_first++;
        client->reply_count--;
    }
    char *reply = client->replies[(client->reply_first + client->reply_count++) % FV_WEB_REPLIES];
    va_start(arguments, format);
    vsnprintf(reply, FV_WEB_REPLY_BYTES, format, arguments);
    va_end(arguments);
}

/* ---- packets --------------------------------------------------------------------------------- */

static uint8_t *put(uint8_t *to, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++)
        to[i] = (uint8_t)(value >> 8 * (bytes - 1 - i));
    return to + bytes;
}

static uint8_t *put_float(uint8_t *to, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put(to, bits, 4);
}

/* Letters that mean something in JSON, and all that are not plain, become '?'. */
static void plain(const char *text, char *to, size_t bytes)
{
    size_t i = 0;
    for (; text[i] != '\0' && i + 1 < bytes; i++)
        to[i] = text[i] < ' ' || text[i] > '~' || text[i] == '"' || text[i] == '\\' ? '?' : text[i];
    to[i] = '\0';
}

static size_t next_hello(struct fv_web_client *client, const struct fv_web_store *store, char *to,
                         size_t capacity)
{
    const uint32_t news = store->news;
    char prefix[FV_MESSAGE_CHANNEL_BYTES];
    if (client->news == news) return 0;
    client->news = news;
    plain(store->prefix, prefix, sizeof prefix);
    return (size_t)snprintf(
        to, capacity,
        "{\"kind\":\"hello\",\"version\":\"%s\",\"role\":\"%s\",\"commands\":%s,\"run\":%" PRIu32
        ",\"running\":%s,\"previews\":%s,\"prefix\":\"%s\",\"robot\":%" PRIu32
        ",\"cameras\":%" PRIu32 "}",
        FOVEA_VERSION, client->role == FV_WEB_OPERATE ? "operate" : "view",
        client->commands && client->role == FV_WEB_OPERATE ? "true" : "false", store->run,
        store->running ? "true" : "false", store->previews ? "true" : "false", prefix,
        client->robot, store->cameras);
}

static size_t next_robots(struct fv_web_client *client, char *to, size_t capacity)
{
    const struct fv_web_robots *robots = client->robots;
    if (robots == NULL || client->robots_sent == robots->version) return 0;
    client->robots_sent = robots->version;
    return (size_t)snprintf(to, capacity,
                            "{\"kind\":\"robots\",\"shown\":%" PRIu32 ",\"robots\":%s}",
                            client->robot, robots->text);
}

static size_t next_log(struct fv_web_client *client, const struct fv_web_store *store, char *to,
                       size_t capacity)
{
    char text[FV_WEB_LOG_BYTES];
    if (client->log_sent > store->log_count) client->log_sent = 0; /* another run */
    if (client->log_sent == store->log_count) return 0;
    if (store->log_count - client->log_sent > FV_WEB_LOG_MAX)
        client->log_sent = store->log_count - FV_WEB_LOG_MAX;
    const uint64_t at = client->log_sent++;
    plain(store->log[at % FV_WEB_LOG_MAX].text, text, sizeof text);
    return (size_t)snprintf(to, capacity,
                            "{\"kind\":\"log\",\"number\":%" PRIu64 ",\"utime\":%" PRId64
                            ",\"text\":\"%s\"}",
                            at, store->log[at % FV_WEB_LOG_MAX].utime, text);
}

/* How a recording that is played stands. */
static size_t next_playback(struct fv_web_client *client, const struct fv_web_store *store,
                            char *to, size_t capacity)
{
    const struct fv_web_playback *playback = &store->playback;
    if (client->playback == store->playback_version) return 0;
    client->playback = store->playback_version;
    return (size_t)snprintf(to, capacity,
                            "{\"kind\":\"playback\",\"position_ms\":%" PRId64
                            ",\"length_ms\":%" PRId64 ",\"speed\":%.3f,\"paused\":%s}",
                            playback->position_ms, playback->length_ms, playback->speed,
                            playback->paused ? "true" : "false");
}

static size_t next_reply(struct fv_web_client *client, char *to)
{
    if (client->reply_count == 0) return 0;
    const char *reply = client->replies[client->reply_first++ % FV_WEB_REPLIES];
    client->reply_count--;
    const size_t length = strlen(reply);
    memcpy(to, reply, length + 1);
    return length;
}

/* A message that the client has not got, pieces of the map or all others; the one after the last
 * that was sent comes first. */
static size_t next_message(struct fv_web_client *client, const struct fv_web_store *store,
                           bool of_map, uint8_t *to, size_t capacity)
{
    for (uint32_t n = 1; n <= store->row_count; n++) {
        const uint32_t i = (client->row + n) % store->row_count;
        const struct fv_web_row *row = &store->rows[i];
        const size_t length = strlen(row->channel);
        if (client->versions[i] == row->version || row->version == 0 ||
            (strcmp(row->channel, "MAP") == 0) != of_map)
            continue;
        client->versions[i] = row->version;
        if (row->operators && client->role != FV_WEB_OPERATE) continue;
        client->row = i;
        if (2 + length + row->bytes > capacity) continue;
        uint8_t *at = put(put(to, KIND_MESSAGE, 1), length, 1);
        memcpy(at, row->channel, length);
        memcpy(at + length, row->data, row->bytes);
        return 2 + length + row->bytes;
    }
    return 0;
}

static size_t next_path(struct fv_web_client *client, const struct fv_web_store *store, uint8_t *to)
{
    const uint64_t oldest =
        store->path_count > FV_WEB_PATH_MAX ? store->path_count - FV_WEB_PATH_MAX : 0;
    const bool fresh = client->path_epoch != store->path_epoch;
    if (fresh) client->path_sent = oldest;
    if (client->path_sent < oldest) client->path_sent = oldest;
    if (!fresh && client->path_sent == store->path_count) return 0;
    client->path_epoch = store->path_epoch;
    const uint64_t left = store->path_count - client->path_sent;
    const uint32_t count = left < PLACES_MAX ? (uint32_t)left : PLACES_MAX;
    uint8_t *at = put(put(to, KIND_PATH, 1), store->path_epoch, 4);
    at = put(put(at, client->path_sent, 8), count, 4);
    for (uint32_t n = 0; n < count; n++)
        for (int i = 0; i < 3; i++)
            at = put_float(at, store->path[(client->path_sent + n) % FV_WEB_PATH_MAX].position[i]);
    client->path_sent += count;
    return (size_t)(at - to);
}

/* ---- pictures -------------------------------------------------------------------------------- */

/* Whether a picture of a class is through the link in the time in which a class is fast. To try it
 * would hold up messages for longer than that. */
static bool is_carried(const struct fv_web_client *client, struct fv_web_picture *picture,
                       int picture_class)
{
    size_t bytes;
    return client->bytes_per_s == 0 ||
           fv_web_picture_jpeg(picture, picture_class, &bytes) == NULL ||
           (double)bytes / (double)client->bytes_per_s < FAST_NS * 1e-9;
}

/* Once for each new frame. A page begins with the smallest pictures, whose way to it and back is
 * that of the link alone. What larger ones take beyond, messages have to wait for, too: the class
 * falls when that is long, and rises when it is short. */
static void judge_class(struct fv_web_client *client, struct fv_web_picture *picture,
                        int64_t now_ns)
{
    if (client->frame == picture->number) return;
    client->frame = picture->number;
    const bool waiting =
        client->unacked_count > 0 && now_ns - client->unacked[0].sent_ns > FV_SECOND_NS;
    const int64_t beyond_ns = client->ack_ns - client->ack_least_ns; /* ack_ns 0: not known */
    if (waiting || beyond_ns > SLOW_NS) {
        if (now_ns - client->class_ns < CLASS_NS || client->picture_class == FV_WEB_CLASSES - 1)
            return;
        client->picture_class++;
        client->ack_ns = 0;
        client->class_ns = now_ns;
        client->better_ns = client->better_ns < BETTER_NS       ? BETTER_NS
                            : client->better_ns < BETTER_MAX_NS ? 2 * client->better_ns
                                                                : BETTER_MAX_NS;
    } else if (client->picture_class > 0 && client->ack_ns > 0 && beyond_ns < FAST_NS &&
               now_ns - client->class_ns > client->better_ns) {
        client->class_ns = now_ns;
        if (!is_carried(client, picture, client->picture_class - 1)) return;
        client->picture_class--;
        client->ack_ns = 0;
    }
}

static uint8_t *put_points(uint8_t *at, const struct fv_web_picture *picture, int picture_class)
{
    const uint32_t most = picture_class < 3 ? FV_WEB_POINTS_MAX : POINTS_FEW;
    const uint32_t every = (picture->point_count + most - 1) / most;
    uint32_t count = 0;
    uint8_t *head = at;
    at = put(at, 0, 4);
    for (uint32_t i = 0; every > 0 && i < picture->point_count; i += every, count++) {
        const struct fv_web_point *point = &picture->points[i];
        at = put(at, (uint64_t)(point->x_px * 8.0F + 0.5F), 2);
        at = put(put(at, (uint64_t)(point->y_px * 8.0F + 0.5F), 2), point->level, 1);
    }
    put(head, count, 4);
    return at;
}

/* Kind, class, shrink (2), number (4), stamp (8), sequence (8), age of the frame when it came here
 * (8, ns, -1 not known), microseconds from there to here (4), now (8, ns), raw width and height
 * (2 each), count of features (4), of each x and y in eighths of raw pixels (2 each) and level (1);
 * then the JPEG. */
static size_t next_picture(struct fv_web_client *client, struct fv_web_store *store, uint8_t *to,
                           size_t capacity, int64_t now_ns)
{
    struct fv_web_picture *picture = fv_web_store_picture(store, client->camera);
    size_t bytes = 0;
    if (picture->image.data == NULL || client->hidden) return 0;
    judge_class(client, picture, now_ns);
    if (client->sent == picture->number || client->unacked_count == FV_WEB_UNACKED_MAX) return 0;
    int class = client->picture_class;
    const uint8_t *jpeg;
    const size_t head = 64 + 5 * (size_t)FV_WEB_POINTS_MAX;
    const int64_t begin_ns = fv_clock_ns(CLOCK_MONOTONIC);
    while ((jpeg = fv_web_picture_jpeg(picture, class, &bytes)) != NULL &&
           head + bytes > capacity && class < FV_WEB_CLASSES - 1)
        class ++;
    now_ns += fv_clock_ns(CLOCK_MONOTONIC) - begin_ns; /* what the JPEG took, if this one made it */
    client->sent = picture->number;
    if (jpeg == NULL || head + bytes > capacity) return 0;
    uint8_t *at = put(put(to, KIND_PICTURE, 1), (uint64_t) class, 1);
    at = put(at, (uint64_t)fv_web_jpeg_shrink(picture->image.width, class), 2);
    at = put(put(at, picture->number, 4), (uint64_t)picture->stamp_ns, 8);
    at = put(put(at, (uint64_t)picture->sequence, 8), (uint64_t)picture->age_ns, 8);
    at = put(at, (uint64_t)((now_ns - picture->taken_ns) / 1000), 4);
    at = put(at, (uint64_t)now_ns, 8);
    at = put(put(at, (uint64_t)picture->image.width, 2), (uint64_t)picture->image.height, 2);
    at = put_points(at, picture, class);
    memcpy(at, jpeg, bytes);
    client->unacked[client->unacked_count].number = picture->number;
    client->unacked[client->unacked_count].picture_class = client->picture_class;
    client->unacked[client->unacked_count++].sent_ns = now_ns;
    return (size_t)(at - to) + bytes;
}

size_t fv_web_client_next(struct fv_web_client *client, struct fv_web_store *store, uint8_t *to,
                          size_t capacity, int64_t now_ns, bool *text)
{
    size_t bytes;
    *text = true;
    if (client->run != store->run) forget_versions(client);
    client->run = store->run;
    if ((bytes = next_hello(client, store, (char *)to, capacity)) > 0) return bytes;
    if ((bytes = next_robots(client, (char *)to, capacity)) > 0) return bytes;
    if ((bytes = next_playback(client, store, (char *)to, capacity)) > 0) return bytes;
    if ((bytes = next_reply(client, (char *)to)) > 0) return bytes;
    if ((bytes = next_log(client, store, (char *)to, capacity)) > 0) return bytes;
    *text = false;
    if ((bytes = next_message(client, store, false, to, capacity)) > 0) return bytes;
    if ((bytes = next_path(client, store, to)) > 0) return bytes;
    if ((bytes = next_picture(client, store, to, capacity, now_ns)) > 0) return bytes;
    return next_message(client, store, true, to, capacity);
}

/* ---- what a page says ------------------------------------------------------------------------ */

static bool number_read(const char *text, uint32_t *number)
{
    char *end;
    if (*text < '0' || *text > '9') return false;
    const unsigned long long value = strtoull(text, &end, 10);
    *number = (uint32_t)value;
    return *end == '\0' && value <= UINT32_MAX;
}

static void acknowledge(struct fv_web_client *client, uint32_t number, int64_t now_ns)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < client->unacked_count; i++) {
        if (client->unacked[i].number > number) {
            client->unacked[kept++] = client->unacked[i];
            continue;
        }
        const int64_t way_ns = now_ns - client->unacked[i].sent_ns;
        if (way_ns < client->ack_least_ns) client->ack_least_ns = way_ns;
        if (client->unacked[i].picture_class == client->picture_class) client->ack_ns = way_ns;
    }
    client->unacked_count = kept;
}

/* The words of command_t, at least one. */
static bool words_read(char *words, int32_t *bits)
{
    static const struct {
        const char *word;
        int32_t bit;
    } known[] = {{"reset", FOVEA_COMMAND_T_RESET},
                 {"pause", FOVEA_COMMAND_T_PAUSE},
                 {"resume", FOVEA_COMMAND_T_RESUME},
                 {"save", FOVEA_COMMAND_T_SAVE},
                 {"overwrite", FOVEA_COMMAND_T_OVERWRITE},
                 {"record", FOVEA_COMMAND_T_RECORD},
                 {"record-stop", FOVEA_COMMAND_T_RECORD_STOP}};
    char *rest = NULL;
    *bits = 0;
    for (char *word = strtok_r(words, " ", &rest); word != NULL;
         word = strtok_r(NULL, " ", &rest)) {
        int32_t bit = 0;
        for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
            if (strcmp(word, known[i].word) == 0) bit = known[i].bit;
        if (bit == 0) return false;
        *bits |= bit;
    }
    return *bits != 0;
}

/* "once|keep KEY [VALUE]": the value is the rest, with its spaces. */
static bool parameter_read(char *words, struct fv_web_command *command)
{
    char *rest = NULL;
    const char *how = strtok_r(words, " ", &rest), *key = strtok_r(NULL, " ", &rest);
    if (how == NULL || key == NULL) return false;
    command->bits = 0;
    command->keep = strcmp(how, "keep") == 0;
    if (!command->keep && strcmp(how, "once") != 0) return false;
    snprintf(command->key, sizeof command->key, "%s", key);
    snprintf(command->value, sizeof command->value, "%s", rest != NULL ? rest : "");
    return true;
}

/* "[FILE]": the rest, with its spaces. */
static void map_read(const char *words, struct fv_web_command *command)
{
    command->bits = 0;
    command->loads = true;
    snprintf(command->key, sizeof command->key, "%s", words != NULL ? words : "");
}

static bool play_read(char *words, struct fv_web_command *command)
{
    static const char *const known[] = {[FV_WEB_PAUSE] = "pause",
                                        [FV_WEB_RESUME] = "resume",
                                        [FV_WEB_SEEK] = "seek",
                                        [FV_WEB_SPEED] = "speed"};
    char *rest = NULL, *end;
    const char *what = strtok_r(words, " ", &rest), *number = strtok_r(NULL, " ", &rest);
    if (what == NULL) return false;
    for (int i = 0; i < 4; i++) {
        if (strcmp(what, known[i]) != 0) continue;
        command->play = i;
        const bool needs = i == FV_WEB_SEEK || i == FV_WEB_SPEED;
        if (needs != (number != NULL)) return false;
        command->play_to = needs ? strtod(number, &end) : 0.0;
        return !needs || (end != number && *end == '\0' && command->play_to >= 0.0 &&
                          command->play_to < 1e12);
    }
    return false;
}

enum fv_web_said fv_web_client_hear(struct fv_web_client *client, const char *words, size_t length,
                                    int64_t now_ns, struct fv_web_command *command)
{
    char text[FV_WEB_WORDS_BYTES + 1], echoed[ECHO_BYTES + 1], *rest = NULL;
    uint32_t number;
    if (length > FV_WEB_WORDS_BYTES || memchr(words, '\0', length) != NULL)
        return FV_WEB_SAID_WRONG;
    memcpy(text, words, length);
    text[length] = '\0';
    const char *verb = strtok_r(text, " ", &rest), *word = strtok_r(NULL, " ", &rest);
    if (verb == NULL || word == NULL) return FV_WEB_SAID_WRONG;
    if (strcmp(verb, "ping") == 0) {
        plain(word, echoed, sizeof echoed);
        fv_web_client_reply(client, "{\"kind\":\"pong\",\"echo\":\"%s\",\"now_ms\":%.3f}", echoed,
                            (double)now_ns * 1e-6);
        return FV_WEB_SAID_NOTHING;
    }
    if (!number_read(word, &number)) return FV_WEB_SAID_WRONG;
    command->loads = false;
    if (strcmp(verb, "ack") == 0) {
        acknowledge(client, number, now_ns);
    } else if (strcmp(verb, "pictures") == 0) {
        client->hidden = number == 0;
        client->unacked_count = 0;
    } else if (strcmp(verb, "camera") == 0) {
        client->camera = number < FOVEA_CAMERAS_MAX ? number : 0;
        client->sent = client->frame = client->unacked_count = 0;
        fv_web_client_reply(client, "{\"kind\":\"camera\",\"camera\":%" PRIu32 "}", client->camera);
    } else if (strcmp(verb, "robot") == 0) {
        command->request = number;
        return FV_WEB_SAID_ROBOT;
    } else if (strcmp(verb, "command") == 0) {
        command->request = number;
        return words_read(rest, &command->bits) ? FV_WEB_SAID_COMMAND : FV_WEB_SAID_WRONG;
    } else if (strcmp(verb, "map") == 0) {
        command->request = number;
        map_read(rest, command);
        return FV_WEB_SAID_COMMAND;
    } else if (strcmp(verb, "play") == 0) {
        command->request = number;
        return play_read(rest, command) ? FV_WEB_SAID_PLAY : FV_WEB_SAID_WRONG;
    } else if (strcmp(verb, "parameter") == 0) {
        command->request = number;
        return parameter_read(rest, command) ? FV_WEB_SAID_COMMAND : FV_WEB_SAID_WRONG;
    } else {
        return FV_WEB_SAID_WRONG;
    }
    return FV_WEB_SAID_NOTHING;
}
