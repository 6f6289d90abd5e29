#include "app/watch/compare.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fovea/sensor.h"
#include "message/fields.h"
#include "support/lcmlog.h"
#include "support/say.h"

#include "fovea_types.h"

/* ---- hashes ---------------------------------------------------------------------------------- */

/* The first name whose hash differs, or that one list alone has. */
static void name_difference(int32_t a_count, const fovea_named_hash_t *a, int32_t b_count,
                            const fovea_named_hash_t *b, const char **name)
{
    *name = NULL;
    for (int32_t i = 0; i < a_count || i < b_count; i++) {
        const bool both = i < a_count && i < b_count;
        if (both && a[i].hash == b[i].hash && strcmp(a[i].name, b[i].name) == 0) continue;
        bool b_has = false; /* what `a` has there; else it is what `b` lacks */
        for (int32_t k = i; k < b_count && i < a_count; k++)
            b_has = b_has || strcmp(a[i].name, b[k].name) == 0;
        *name = i < a_count && (!b_has || i >= b_count) ? a[i].name : b[i].name;
        return;
    }
}

bool fv_compare_lockstep(const uint8_t *a, uint32_t a_bytes, const uint8_t *b, uint32_t b_bytes,
                         struct fv_compared *compared)
{
    fovea_lockstep_t first, second;
    const char *stage = NULL, *message = NULL;
    bool equal = true;
    if (fovea_lockstep_t_decode(a, 0, (int)a_bytes, &first) < 0) return false;
    if (fovea_lockstep_t_decode(b, 0, (int)b_bytes, &second) < 0) {
        fovea_lockstep_t_decode_cleanup(&first);
        return false;
    }
    if (first.inputs_hash != second.inputs_hash) {
        equal = false;
        if (compared->inputs[0] == '\0')
            snprintf(compared->inputs, sizeof compared->inputs, "by their hash");
    } else {
        name_difference(first.stage_count, first.stages, second.stage_count, second.stages, &stage);
        name_difference(first.message_count, first.messages, second.message_count, second.messages,
                        &message);
        equal = stage == NULL && message == NULL && first.state_hash == second.state_hash;
        if (stage != NULL && compared->stage[0] == '\0')
            snprintf(compared->stage, sizeof compared->stage, "%.63s", stage);
        if (message != NULL && compared->message[0] == '\0')
            snprintf(compared->message, sizeof compared->message, "%.63s", message);
    }
    fovea_lockstep_t_decode_cleanup(&first);
    fovea_lockstep_t_decode_cleanup(&second);
    return equal;
}

/* ---- iterations of a recording --------------------------------------------------------------- */

enum kind { INPUT, INPUTS, GRANTS, MESSAGE, LOCKSTEP, END };

struct event {
    enum kind kind;
    char suffix[FV_LCMLOG_CHANNEL_BYTES];
    size_t at; /* of its data in the iteration's bytes */
    uint32_t bytes;
};

struct side {
    const char *path;
    struct fv_lcmlog *log;
    struct fv_lcmlog_event next; /* read, and not taken */
    bool at_end;                 /* there is no next, from the byte `end` on */
    bool whole;                  /* it ended with RECORDING_END */
    int64_t end;
    size_t prefix_bytes;
    struct event *events; /* of the iteration */
    uint32_t count, capacity;
    uint8_t *bytes;
    size_t used, room;
    int64_t sequence, stamp_ns; /* of the last frame */
};

static enum kind kind_of(const char *suffix)
{
    for (int kind = 0; kind < FOVEA_SAMPLE_KIND_COUNT; kind++)
        if (strcmp(suffix, fovea_sample_channel((enum fovea_sample_kind)kind)) == 0) return INPUT;
    if (strcmp(suffix, "FRAME") == 0 || strcmp(suffix, "PARAMETER") == 0 ||
        strcmp(suffix, "LOADED_MAP") == 0)
        return INPUT;
    if (strcmp(suffix, "INPUTS") == 0) return INPUTS;
    if (strcmp(suffix, "GRANTS") == 0) return GRANTS;
    if (strcmp(suffix, "LOCKSTEP") == 0) return LOCKSTEP;
    return strcmp(suffix, "RECORDING_END") == 0 ? END : MESSAGE;
}

static const char *suffix_of(const struct side *side)
{
    const size_t length = strlen(side->next.channel);
    return side->next.channel + (length > side->prefix_bytes ? side->prefix_bytes : 0);
}

/* An event that is cut off is the end of what was written. */
static enum fovea_status advance(struct side *side, struct fovea_error *error)
{
    const enum fovea_status status = fv_lcmlog_next(side->log, &side->next, error);
    side->at_end = status == FOVEA_END || fv_lcmlog_cut_off(side->log);
    side->end = side->next.offset;
    return side->at_end ? FOVEA_OK : status;
}

static enum fovea_status side_open(struct side *side, const char *path, struct fovea_error *error)
{
    static const char first[] = "RECORDING";
    side->path = path;
    side->sequence = -1;
    enum fovea_status status = fv_lcmlog_open(path, &side->log, error);
    if (status == FOVEA_OK) status = advance(side, error);
    if (status == FOVEA_OK && fv_lcmlog_cut_off(side->log)) status = FOVEA_ERROR_INPUT;
    if (status != FOVEA_OK) return status;
    if (side->at_end || !fv_lcmlog_channel_is(side->next.channel, first))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte 0: found %s, expected a recording of fovea run", path,
                               side->at_end ? "nothing" : side->next.channel);
    side->prefix_bytes = strlen(side->next.channel) - strlen(first);
    return advance(side, error);
}

static void side_close(struct side *side)
{
    fv_lcmlog_close(side->log);
    free(side->events);
    free(side->bytes);
}

/* Room for one more element of `size`, of `count`. */
static bool grow(void **list, uint32_t count, uint32_t *capacity, size_t size)
{
    if (count < *capacity) return true;
    const uint32_t wanted = *capacity == 0 ? 64 : 2 * *capacity;
    void *larger = realloc(*list, wanted * size);
    if (larger == NULL) return false;
    *list = larger;
    *capacity = wanted;
    return true;
}

static bool keep(struct side *side, enum kind kind)
{
    const struct fv_lcmlog_event *next = &side->next;
    if (!grow((void **)&side->events, side->count, &side->capacity, sizeof *side->events))
        return false;
    if (side->bytes == NULL || side->used + next->bytes > side->room) {
        const size_t room = 2 * (side->used + next->bytes) + 1;
        uint8_t *larger = realloc(side->bytes, room);
        if (larger == NULL) return false;
        side->bytes = larger;
        side->room = room;
    }
    struct event *event = &side->events[side->count++];
    *event = (struct event){.kind = kind, .at = side->used, .bytes = next->bytes};
    snprintf(event->suffix, sizeof event->suffix, "%s", suffix_of(side));
    if (next->bytes > 0) memcpy(side->bytes + side->used, next->data, next->bytes);
    side->used += next->bytes;
    return true;
}

/* Hashes are decoded, and inputs that are broken are no difference of two runs. */
static enum fovea_status check(const struct side *side, enum kind kind, struct fovea_error *error)
{
    const char *problem;
    size_t at;
    const char *type = kind == INPUTS     ? "fovea.inputs_t"
                       : kind == LOCKSTEP ? "fovea.lockstep_t"
                                          : NULL;
    if (type == NULL || fv_message_check(type, side->next.data, side->next.bytes, &problem, &at))
        return FOVEA_OK;
    const int64_t byte = side->next.offset + FV_LCMLOG_HEADER_BYTES +
                         (int64_t)strlen(side->next.channel) + (int64_t)at;
    return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: byte %" PRId64 ": %s: %s", side->path,
                           byte, side->next.channel, problem);
}

/* All events of the next iteration: inputs, messages of the step, grants, messages of the work.
 * None (count 0): the recording is at its end. */
static enum fovea_status iteration_read(struct side *side, struct fovea_error *error)
{
    bool worked = false;
    enum fovea_status status = FOVEA_OK;
    side->count = 0;
    side->used = 0;
    while (status == FOVEA_OK && !side->at_end) {
        const enum kind kind = kind_of(suffix_of(side));
        struct fovea_frame frame;
        if (worked && (kind == INPUT || kind == INPUTS)) break;
        if (kind == END) {
            side->whole = true;
            break;
        }
        status = check(side, kind, error);
        if (status == FOVEA_OK && strcmp(suffix_of(side), "FRAME") == 0) {
            status = fv_lcmlog_frame(side->path, &side->next, &frame, error);
            side->sequence = (int64_t)frame.sequence;
            side->stamp_ns = frame.stamp_ns;
        }
        if (status != FOVEA_OK) return status;
        if (!keep(side, kind))
            return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory for an iteration",
                                   side->path);
        worked = worked || kind == GRANTS;
        status = advance(side, error);
    }
    return status;
}

/* ---- comparing ------------------------------------------------------------------------------- */

/* "" or what differs: the field and both values. */
static void event_compare(const struct side *a, const struct event *first, const struct side *b,
                          const struct event *second, char *text, size_t capacity)
{
    struct fv_difference difference;
    text[0] = '\0';
    if (!fv_message_compare_runs(a->bytes + first->at, first->bytes, b->bytes + second->at,
                                 second->bytes, &difference))
        snprintf(text, capacity, "%.40s: %.60s%sfound %.40s, expected %.40s", first->suffix,
                 difference.field, difference.field[0] != '\0' ? ": " : "", difference.found,
                 difference.expected);
}

static bool is_input(enum kind kind)
{
    return kind == INPUT || kind == INPUTS || kind == GRANTS;
}

/* The next event from `at` on that is an input, or that is a message. */
static const struct event *next_of(const struct side *side, bool input, uint32_t *at)
{
    while (*at < side->count) {
        const struct event *event = &side->events[(*at)++];
        if (event->kind != LOCKSTEP && is_input(event->kind) == input) return event;
    }
    return NULL;
}

/* The first difference of inputs, or of messages, in the order of the events. */
static void first_difference(const struct side *a, const struct side *b, bool input, char *text,
                             size_t capacity)
{
    uint32_t a_at = 0, b_at = 0;
    text[0] = '\0';
    while (text[0] == '\0') {
        const struct event *first = next_of(a, input, &a_at), *second = next_of(b, input, &b_at);
        if (first == NULL && second == NULL) return;
        if (first == NULL || second == NULL || strcmp(first->suffix, second->suffix) != 0)
            snprintf(text, capacity, "found %.60s, expected %.60s",
                     second != NULL ? second->suffix : "nothing",
                     first != NULL ? first->suffix : "nothing");
        else
            event_compare(a, first, b, second, text, capacity);
    }
}

static const struct event *lockstep_of(const struct side *side)
{
    for (uint32_t i = 0; i < side->count; i++)
        if (side->events[i].kind == LOCKSTEP) return &side->events[i];
    return NULL;
}

/* False: this iteration differs. */
static bool iteration_compare(const struct side *a, const struct side *b,
                              struct fv_compared *compared)
{
    const struct event *first = lockstep_of(a), *second = lockstep_of(b);
    bool equal = true;
    first_difference(a, b, true, compared->inputs, sizeof compared->inputs);
    if (compared->inputs[0] == '\0')
        first_difference(a, b, false, compared->message, sizeof compared->message);
    if (first != NULL && second != NULL && compared->inputs[0] == '\0') {
        equal = fv_compare_lockstep(a->bytes + first->at, first->bytes, b->bytes + second->at,
                                    second->bytes, compared);
        compared->hashed += equal;
    }
    return equal && compared->inputs[0] == '\0' && compared->message[0] == '\0';
}

/* At least one is at its end. */
static void end(const struct side *a, const struct side *b, struct fv_compared *compared)
{
    const bool both = a->count == 0 && b->count == 0;
    const struct side *shorter = both ? (a->whole ? b : a) : (a->count == 0 ? a : b);
    char text[64] = "ends";
    if (!shorter->whole) snprintf(text, sizeof text, "is cut off at byte %" PRId64, shorter->end);
    if (!both || !shorter->whole)
        snprintf(compared->ended, sizeof compared->ended, "%.120s %s%s", shorter->path, text,
                 both ? "" : ", the other goes on");
    compared->incomplete = compared->ended[0] != '\0';
}

enum fovea_status fv_compare_recordings(const char *a_path, const char *b_path,
                                        struct fv_compared *compared, struct fovea_error *error)
{
    struct side a = {0}, b = {0};
    memset(compared, 0, sizeof *compared);
    enum fovea_status status = side_open(&a, a_path, error);
    if (status == FOVEA_OK) status = side_open(&b, b_path, error);
    while (status == FOVEA_OK && !compared->different) {
        status = iteration_read(&a, error);
        if (status == FOVEA_OK) status = iteration_read(&b, error);
        if (status != FOVEA_OK) break;
        if (a.at_end && !a.whole) a.count = 0; /* the last iteration may lack its end */
        if (b.at_end && !b.whole) b.count = 0;
        if (a.count == 0 || b.count == 0) {
            end(&a, &b, compared);
            break;
        }
        compared->different = !iteration_compare(&a, &b, compared);
        if (compared->different) {
            compared->iteration = compared->iterations;
            compared->sequence = a.sequence;
            compared->stamp_ns = a.stamp_ns;
        } else {
            compared->iterations++;
        }
    }
    fv_say_clean(compared->inputs);
    fv_say_clean(compared->stage);
    fv_say_clean(compared->message);
    side_close(&a);
    side_close(&b);
    return status;
}
