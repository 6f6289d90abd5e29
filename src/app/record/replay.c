#include "app/record/replay.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/aligned.h"
#include "app/record/recording_header.h"
#include "support/say.h"
#include "base/hash.h"
#include "support/lcmlog.h"
#include "message/fields.h"
#include "message/message.h"
#include "message/recorded.h"
#include "runtime/lockstep.h"

#include "fovea_loaded_map_t.h"
#include "fovea_parameter_t.h"

struct replay {
    const char *path;
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fv_recording_header header;
    char channels[FV_MESSAGE_KIND_COUNT][FV_MESSAGE_CHANNEL_BYTES];
    void *memory;
    struct fovea *rt;

    struct fovea_frame frame;                             /* the last one, its pixels in `pixels` */
    bool frame_waits;                                     /* read, but no inputs yet */
    struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX]; /* likewise */
    uint32_t sample_count;
    uint32_t parameter_count;          /* changes, likewise, in `settings` */
    const struct fovea_ready_map *map; /* likewise, in `map_memory`; NULL: none */
    void *map_memory;
    struct fv_settings settings; /* in force from the next step on */
    uint8_t *pixels;
    size_t pixels_capacity;

    int64_t now_ns, stamp_ns;
    uint64_t sequence; /* of the last frame, for telling where a difference is */
    struct fovea_outputs outputs;
    uint32_t compared;     /* of outputs.messages */
    uint64_t events, hash; /* of the log so far, as its end states them */

    unsigned how;  /* enum fv_replay_how */
    bool in_force; /* the next step takes `settings` as it takes changes of parameters */
    fv_replay_function sent;
    void *context;
    struct fv_replay_result *result;
};

static int64_t data_offset(const struct fv_lcmlog_event *event)
{
    return event->offset + FV_LCMLOG_HEADER_BYTES + (int64_t)strlen(event->channel);
}

static enum fovea_status refuse(const struct replay *replay, size_t at, const char *text,
                                struct fovea_error *error)
{
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: byte %" PRId64 ": %s: %s", replay->path,
                           data_offset(&replay->event) + (int64_t)at, replay->event.channel, text);
}

/* Take the event that was read into the hash of the log. */
static void count_event(struct replay *replay)
{
    const struct fv_lcmlog_event *event = &replay->event;
    const size_t channel_bytes = strlen(event->channel);
    uint8_t head[FV_LCMLOG_HEADER_BYTES + FV_LCMLOG_CHANNEL_BYTES];
    fv_recording_event_head(head, event->number, event->time_us, channel_bytes, event->bytes);
    memcpy(head + FV_LCMLOG_HEADER_BYTES, event->channel, channel_bytes + 1);
    replay->hash = fv_recording_hash_event(
        replay->hash, head, FV_LCMLOG_HEADER_BYTES + channel_bytes, event->data, event->bytes);
    replay->events++;
}

/* ---- building -------------------------------------------------------------------------------- */

static enum fovea_status read_header(struct replay *replay, struct fovea_error *error)
{
    enum fovea_status status = fv_lcmlog_next(replay->log, &replay->event, error);
    if (status == FOVEA_END)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte 0: found nothing, expected a recording", replay->path);
    if (status != FOVEA_OK) return status;
    if (!fv_lcmlog_channel_is(replay->event.channel, "RECORDING"))
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: byte 0: found a log that begins with channel %s, expected a recording of fovea run (..._RECORDING)",
            replay->path, replay->event.channel);
    status =
        fv_recording_header_decode(replay->path, data_offset(&replay->event), replay->event.data,
                                   replay->event.bytes, &replay->header, error);
    if (status != FOVEA_OK) return status;
    count_event(replay);
    for (int kind = 0; kind < FV_MESSAGE_KIND_COUNT; kind++)
        fv_message_channel(replay->header.settings.runtime.channel_prefix,
                           (enum fv_message_kind)kind, replay->channels[kind]);
    snprintf(replay->result->recorded_by, sizeof replay->result->recorded_by,
             "Fovea %s on %s, kernels %s", replay->header.version, replay->header.machine,
             replay->header.kernel_set);
    fv_say_clean(replay->result->recorded_by);
    replay->result->identity = replay->header.identity;
    if (strcmp(replay->header.version, fv_recording_version()) != 0)
        fv_say("%s: recorded by %s; this is version %s, whose results may differ", replay->path,
               replay->result->recorded_by, fv_recording_version());
    return FOVEA_OK;
}

/* The run as it was when the recording began. */
static enum fovea_status take_state(struct replay *replay, struct fovea_error *error)
{
    const struct fv_recording_header *header = &replay->header;
    struct fovea_error inner;
    if ((replay->how & FV_REPLAY_TRUSTS) == 0)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%s: found a recording that began in the middle of its run, whose state of %zu bytes "
            "is taken as it is: expected --trust-state, for recordings of your own robots alone",
            replay->path, header->state_bytes);
    if (fovea_state_load(replay->rt, header->state, header->state_bytes, &inner) != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.200s: %.300s", replay->path,
                               inner.text);
    if (fovea_parameters_check(replay->rt, &header->in_force->runtime, &inner) != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.200s: in_force: %.300s", replay->path,
                               inner.text);
    replay->settings = *header->in_force;
    replay->in_force = true;
    return FOVEA_OK;
}

static enum fovea_status build(struct replay *replay, struct fovea_error *error)
{
    const struct fovea_config *config = &replay->header.settings.runtime;
    struct fovea_error inner;
    size_t bytes = 0;
    enum fovea_status status = fovea_size(config, &bytes, &inner);
    if (status == FOVEA_OK) {
        replay->memory = fv_aligned_new(bytes);
        if (replay->memory == NULL)
            return fovea_error_set(error, FOVEA_ERROR_MEMORY,
                                   "%s: no memory for a block of %zu bytes", replay->path, bytes);
        status = fovea_init(replay->memory, bytes, config, &replay->rt, &inner);
    }
    if (status != FOVEA_OK)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.200s: configuration: %.300s",
                               replay->path, inner.text);
    replay->settings = replay->header.settings;
    if (replay->header.state != NULL) status = take_state(replay, error);
    if (status != FOVEA_OK) return status;
    replay->result->kernel_set = fovea_cpu_name(replay->rt);
    return FOVEA_OK;
}

/* ---- comparing ------------------------------------------------------------------------------- */

static void note_difference(struct replay *replay, const char *channel, const char *field,
                            const char *found, const char *expected)
{
    struct fv_replay_result *result = replay->result;
    if (result->different) return;
    result->different = true;
    snprintf(result->difference, sizeof result->difference,
             "%.160s: frame %" PRId64 " (stamp %" PRId64 " ns): %s: %s%sfound %s, expected %s",
             replay->path, (int64_t)replay->sequence, replay->stamp_ns, channel, field,
             field[0] != '\0' ? ": " : "", found, expected);
}

/* A recorded message: the next that the runtime sent must be the same. */
static void compare(struct replay *replay)
{
    const struct fv_lcmlog_event *event = &replay->event;
    if (replay->compared == replay->outputs.message_count) {
        note_difference(replay, event->channel, "", "no more messages", "one as recorded");
        return;
    }
    const struct fovea_message *message = &replay->outputs.messages[replay->compared++];
    struct fv_difference difference;
    if (strcmp(message->channel, event->channel) != 0) {
        note_difference(replay, event->channel, "", message->channel, "this channel");
    } else if (fv_message_compare(event->data, event->bytes, message->data, message->bytes,
                                  &difference)) {
        replay->result->messages_equal++;
        replay->result->messages_with_readings += message->volatile_values;
        replay->result->bytes_equal += event->bytes;
    } else {
        note_difference(replay, event->channel, difference.field, difference.found,
                        difference.expected);
    }
}

/* Before the next step or work: everything that was sent must have been in the recording. */
static void expect_none_left(struct replay *replay)
{
    if (replay->compared < replay->outputs.message_count)
        note_difference(replay, replay->outputs.messages[replay->compared].channel, "", "a message",
                        "none, as recorded");
    replay->compared = 0;
    replay->outputs.message_count = 0;
}

/* The frame must be the one that the recorded run was given. */
static void compare_pixels(struct replay *replay, uint64_t expected)
{
    const uint64_t found = fv_lockstep_frame_hash(&replay->frame);
    char texts[2][32];
    if (found == expected) return;
    snprintf(texts[0], sizeof texts[0], "%016" PRIx64, found);
    snprintf(texts[1], sizeof texts[1], "%016" PRIx64, expected);
    note_difference(replay, replay->channels[FV_MESSAGE_FRAME], "hash of the pixels", texts[0],
                    texts[1]);
}

/* ---- feeding --------------------------------------------------------------------------------- */

static enum fovea_status take_frame(struct replay *replay, struct fovea_error *error)
{
    struct fovea_frame frame;
    enum fovea_status status = fv_lcmlog_frame(replay->path, &replay->event, &frame, error);
    if (status != FOVEA_OK) return status;
    if (replay->frame_waits)
        return refuse(replay, 0, "found a second frame for one step, expected inputs", error);
    size_t bytes = 0;
    for (uint32_t i = 0; i < frame.image_count; i++)
        bytes += frame.images[i].size_bytes;
    if (bytes > replay->pixels_capacity) {
        uint8_t *larger = realloc(replay->pixels, bytes);
        if (larger == NULL)
            return fovea_error_set(error, FOVEA_ERROR_MEMORY,
                                   "%s: no memory for a frame of %zu bytes", replay->path, bytes);
        replay->pixels = larger;
        replay->pixels_capacity = bytes;
    }
    bytes = 0;
    for (uint32_t i = 0; i < frame.image_count; i++) {
        struct fovea_image *image = &frame.images[i];
        if (image->data == NULL) continue;
        memcpy(replay->pixels + bytes, image->data, image->size_bytes);
        image->data = replay->pixels + bytes;
        bytes += image->size_bytes;
    }
    replay->frame = frame;
    replay->frame_waits = true;
    return FOVEA_OK;
}

static bool is_sample(const struct replay *replay, const char *channel)
{
    for (int kind = 0; kind < FOVEA_SAMPLE_KIND_COUNT; kind++)
        if (strcmp(channel, replay->channels[fv_message_of_sample(kind)]) == 0) return true;
    return false;
}

static enum fovea_status take_sample(struct replay *replay, struct fovea_error *error)
{
    if (replay->frame_waits)
        return refuse(replay, 0, "found a sample after the frame of its step, expected inputs",
                      error);
    if (replay->sample_count == FOVEA_INPUT_SAMPLES_MAX)
        return refuse(replay, 0, "found more samples than one step takes, expected inputs", error);
    return fv_lcmlog_sample(replay->path, &replay->event, &replay->samples[replay->sample_count++],
                            error);
}

/* A change of a parameter: it must be one that the runtime takes, as it took it then. */
static enum fovea_status take_parameter(struct replay *replay, struct fovea_error *error)
{
    const struct fv_lcmlog_event *event = &replay->event;
    struct fovea_error inner = {0};
    const char *problem;
    size_t at;
    char assignment[2048];
    fovea_parameter_t change;
    if (replay->frame_waits)
        return refuse(replay, 0, "found a parameter after the frame of its step, expected inputs",
                      error);
    if (replay->parameter_count == FV_MESSAGE_PARAMETERS_MAX)
        return refuse(replay, 0, "found more parameters than one step takes, expected inputs",
                      error);
    if (!fv_message_check("fovea.parameter_t", event->data, event->bytes, &problem, &at))
        return refuse(replay, at, problem, error);
    if (fovea_parameter_t_decode(event->data, 0, (int)event->bytes, &change) < 0)
        return refuse(replay, 0, "found a broken message, expected a parameter_t", error);
    const struct fv_settings_key *key = fv_settings_key_find(change.key);
    const int bytes = snprintf(assignment, sizeof assignment, "%s=%s", change.key, change.value);
    fovea_parameter_t_decode_cleanup(&change);
    if (key == NULL || !key->live || bytes >= (int)sizeof assignment)
        return refuse(replay, 0, "found a key that is no live parameter, expected one", error);
    enum fovea_status status = fv_settings_set(&replay->settings, assignment, &inner);
    if (status == FOVEA_OK)
        status = fovea_parameters_check(replay->rt, &replay->settings.runtime, &inner);
    if (status != FOVEA_OK) { /* of a value that was no option */
        const char *option = strstr(inner.text, "--set: ");
        return refuse(replay, 0, option == inner.text ? inner.text + strlen("--set: ") : inner.text,
                      error);
    }
    replay->parameter_count++;
    return FOVEA_OK;
}

/* A map that the step took in place of its own: checked as every map file is. */
static enum fovea_status take_map(struct replay *replay, struct fovea_error *error)
{
    const struct fv_lcmlog_event *event = &replay->event;
    struct fovea_error inner = {0};
    const char *problem;
    size_t at;
    fovea_loaded_map_t loaded;
    if (replay->frame_waits || replay->map != NULL)
        return refuse(replay, 0,
                      replay->map != NULL
                          ? "found a second map for one step, expected inputs"
                          : "found a map after the frame of its step, expected inputs",
                      error);
    if (!fv_message_check("fovea.loaded_map_t", event->data, event->bytes, &problem, &at))
        return refuse(replay, at, problem, error);
    const size_t bytes = fovea_map_prepared_bytes(&replay->header.settings.runtime);
    if (replay->map_memory == NULL) replay->map_memory = fv_aligned_new(bytes);
    if (replay->map_memory == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory for a map of %zu bytes",
                               replay->path, bytes);
    if (fovea_loaded_map_t_decode(event->data, 0, (int)event->bytes, &loaded) < 0)
        return refuse(replay, 0, "found a broken message, expected a loaded_map_t", error);
    const enum fovea_status status =
        fovea_map_prepare(replay->rt, replay->map_memory, bytes, loaded.data,
                          (size_t)loaded.size_bytes, "the map", &replay->map, &inner);
    fovea_loaded_map_t_decode_cleanup(&loaded);
    return status == FOVEA_OK ? FOVEA_OK : refuse(replay, 0, inner.text, error);
}

static enum fovea_status check_grants(const struct replay *replay,
                                      const struct fovea_grants *grants, struct fovea_error *error)
{
    uint32_t most = replay->header.settings.runtime.features.count_max;
    char text[96];
    if (grants->features <= most) return FOVEA_OK;
    snprintf(text, sizeof text, "found %" PRIu32 " features granted, expected at most %" PRIu32,
             grants->features, most);
    return refuse(replay, 0, text, error);
}

static enum fovea_status step(struct replay *replay, struct fovea_error *error)
{
    struct fovea_inputs inputs;
    bool has_frame;
    uint64_t hash;
    const char *problem;
    size_t at;
    if (!fv_message_inputs_decode(replay->event.data, replay->event.bytes, &inputs, &has_frame,
                                  &hash, &problem, &at))
        return refuse(replay, at, problem, error);
    if (has_frame != replay->frame_waits)
        return refuse(replay, 8,
                      has_frame
                          ? "found inputs that had a frame, expected the frame before them"
                          : "found inputs without a frame, expected those of the frame before",
                      error);
    if (inputs.sample_count !=
        replay->sample_count + replay->parameter_count + (replay->map != NULL))
        return refuse(replay, 8,
                      "found another number of samples, parameters and maps before them, expected "
                      "sample_count",
                      error);
    inputs.map = replay->map;
    replay->map = NULL;
    inputs.sample_count = replay->sample_count;
    if (replay->parameter_count > 0 || replay->in_force)
        inputs.parameters = &replay->settings.runtime;
    replay->parameter_count = 0;
    replay->in_force = false;
    enum fovea_status status = check_grants(replay, &inputs.grants, error);
    if (status != FOVEA_OK) return status;
    expect_none_left(replay);
    inputs.samples = replay->samples;
    replay->sample_count = 0;
    if (has_frame) {
        inputs.frame = &replay->frame;
        replay->stamp_ns = replay->frame.stamp_ns;
        replay->sequence = replay->frame.sequence;
        replay->result->frames++;
        compare_pixels(replay, hash);
    }
    replay->frame_waits = false;
    replay->now_ns = inputs.now_ns;
    fovea_step(replay->rt, &inputs, &replay->outputs);
    replay->result->steps++;
    if (replay->sent != NULL) replay->sent(replay->context, replay->now_ns, &replay->outputs);
    return FOVEA_OK;
}

static enum fovea_status work(struct replay *replay, struct fovea_error *error)
{
    struct fovea_grants grants;
    const char *problem;
    size_t at;
    if (!fv_message_grants_decode(replay->event.data, replay->event.bytes, &grants, &problem, &at))
        return refuse(replay, at, problem, error);
    if (replay->result->works == replay->result->steps)
        return refuse(replay, 0, "found work without a step before it", error);
    enum fovea_status status = check_grants(replay, &grants, error);
    if (status != FOVEA_OK) return status;
    expect_none_left(replay);
    fovea_work(replay->rt, &grants, &replay->outputs);
    replay->result->works++;
    if (replay->sent != NULL) replay->sent(replay->context, replay->now_ns, &replay->outputs);
    return FOVEA_OK;
}

static void compare_number(struct replay *replay, const char *field, uint64_t found,
                           uint64_t expected)
{
    char texts[2][32];
    if (found == expected) return;
    snprintf(texts[0], sizeof texts[0], "%" PRIu64, found);
    snprintf(texts[1], sizeof texts[1], "%" PRIu64, expected);
    note_difference(replay, replay->event.channel, field, texts[0], texts[1]);
}

/* What the log says of itself must be so: then nothing was taken out, put in or edited where no
 * message shows it. */
static enum fovea_status end(struct replay *replay, struct fovea_error *error)
{
    struct fv_replay_result *result = replay->result;
    struct fv_recording_end stated;
    const char *problem;
    size_t at;
    if (!fv_recording_end_decode(replay->event.data, replay->event.bytes, &stated, &problem, &at))
        return refuse(replay, at, problem, error);
    expect_none_left(replay);
    compare_number(replay, "iterations", result->works, stated.iterations);
    compare_number(replay, "events", replay->events, stated.events);
    compare_number(replay, "hash of all events before",
                   fv_hash(replay->hash, stated.reason, strlen(stated.reason)), stated.hash);
    result->end = stated.reason[0] != '\0' ? FV_REPLAY_ENDED_EARLY : FV_REPLAY_WHOLE;
    memcpy(result->reason, stated.reason, sizeof result->reason);
    fv_say_clean(result->reason);
    return FOVEA_OK;
}

static enum fovea_status feed(struct replay *replay, struct fovea_error *error)
{
    enum fovea_status status;
    replay->result->end = FV_REPLAY_CUT_OFF;
    while ((status = fv_lcmlog_next(replay->log, &replay->event, error)) == FOVEA_OK) {
        const char *channel = replay->event.channel;
        replay->result->offset = replay->event.offset;
        if (replay->result->end != FV_REPLAY_CUT_OFF)
            return refuse(replay, 0, "found an event after the end of the recording, expected none",
                          error);
        if (strcmp(channel, replay->channels[FV_MESSAGE_RECORDING_END]) == 0)
            status = end(replay, error);
        else if (strcmp(channel, replay->channels[FV_MESSAGE_FRAME]) == 0)
            status = take_frame(replay, error);
        else if (is_sample(replay, channel))
            status = take_sample(replay, error);
        else if (strcmp(channel, replay->channels[FV_MESSAGE_PARAMETER]) == 0)
            status = take_parameter(replay, error);
        else if (strcmp(channel, replay->channels[FV_MESSAGE_LOADED_MAP]) == 0)
            status = take_map(replay, error);
        else if (strcmp(channel, replay->channels[FV_MESSAGE_INPUTS]) == 0)
            status = step(replay, error);
        else if (strcmp(channel, replay->channels[FV_MESSAGE_GRANTS]) == 0)
            status = work(replay, error);
        else
            compare(replay);
        if (status != FOVEA_OK) return status;
        if (replay->result->different && (replay->how & FV_REPLAY_STOPS)) return FOVEA_OK;
        count_event(replay);
    }
    if (replay->frame_waits || replay->sample_count > 0 || replay->parameter_count > 0 ||
        replay->map != NULL || replay->compared < replay->outputs.message_count ||
        replay->result->works < replay->result->steps)
        replay->result->end = FV_REPLAY_CUT_OFF;
    return status == FOVEA_END ? FOVEA_OK : status;
}

enum fovea_status fv_replay(const char *path, unsigned how, fv_replay_function sent, void *context,
                            struct fv_replay_result *result, struct fovea_error *error)
{
    struct replay *replay = calloc(1, sizeof *replay);
    memset(result, 0, sizeof *result);
    if (replay == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory to replay", path);
    replay->path = path;
    replay->how = how;
    replay->sent = sent;
    replay->context = context;
    replay->result = result;
    replay->hash = FV_HASH_START;
    fv_message_prepare();
    enum fovea_status status = fv_lcmlog_open(path, &replay->log, error);
    if (status == FOVEA_OK) status = read_header(replay, error);
    if (status == FOVEA_OK) status = build(replay, error);
    if (status == FOVEA_OK) status = feed(replay, error);
    fv_lcmlog_close(replay->log);
    for (int i = 0; i < FOVEA_CAMERAS_MAX; i++)
        free(replay->header.masks[i]);
    free(replay->header.model);
    free(replay->header.model2);
    free(replay->header.map);
    free(replay->header.state);
    free(replay->header.in_force);
    free(replay->memory);
    free(replay->map_memory);
    free(replay->pixels);
    free(replay);
    return status;
}
