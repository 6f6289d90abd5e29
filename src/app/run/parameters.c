#include "app/run/parameters.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "app/config/camera_controls.h"
#include "app/config/kept_parameters.h"
#include "drivers/clock.h"
#include "drivers/table.h"
#include "image/preprocess.h"
#include "support/aligned.h"
#include "support/utf8.h"

#include "fovea_parameter_result_t.h"
#include "fovea_parameter_t.h"

enum {
    REQUEST_BYTES_MAX = 1280, /* key, value and the rest */
    ANSWER_BYTES_MAX = 1536,
    /* The ring gives a record no more than half of its room. */
    RING_BYTES = (2 * FV_PARAMETERS_WAITING + 1) * sizeof(struct fv_parameter_change)
};

static const int64_t keep_ns = 1000000000; /* between two writes of the file */

enum fovea_status fv_parameters_open(struct fv_parameters *parameters, const struct fovea *rt,
                                     const struct fv_settings *settings,
                                     const struct fv_setup *setup, struct fv_requests *requests,
                                     struct fovea_error *error)
{
    const char *prefix = settings->runtime.channel_prefix;
    memset(parameters, 0, sizeof *parameters);
    parameters->rt = rt;
    parameters->ops = setup->ops;
    parameters->source = setup->source;
    (void)fv_setup_check_balance(setup, setup->ops != NULL ? setup->ops->info(setup->source) : NULL,
                                 settings->source, &parameters->unbalanced);
    parameters->requests = requests;
    pthread_mutex_init(&parameters->changing, NULL);
    parameters->settings = malloc(sizeof *parameters->settings);
    parameters->tried = malloc(sizeof *parameters->tried);
    parameters->kept = malloc(sizeof *parameters->kept);
    parameters->kept_tried = malloc(sizeof *parameters->kept_tried);
    parameters->written = malloc(sizeof *parameters->written);
    parameters->keeping = calloc(FV_PARAMETERS_WAITING, sizeof *parameters->keeping);
    parameters->camera_requests =
        calloc(FV_PARAMETERS_WAITING, sizeof *parameters->camera_requests);
    parameters->answers = calloc(FV_PARAMETERS_WAITING, sizeof *parameters->answers);
    parameters->taken = calloc(FV_PARAMETERS_WAITING, sizeof *parameters->taken);
    parameters->ring_memory = fv_aligned_zeroed(RING_BYTES);
    if (parameters->settings == NULL || parameters->tried == NULL || parameters->kept == NULL ||
        parameters->kept_tried == NULL || parameters->written == NULL ||
        parameters->keeping == NULL || parameters->camera_requests == NULL ||
        parameters->answers == NULL || parameters->taken == NULL ||
        parameters->ring_memory == NULL) {
        fv_parameters_close(parameters);
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for live parameters");
    }
    *parameters->settings = *parameters->kept = *settings;
    parameters->kept_calibration =
        fv_kept_parameters_list(parameters->kept, settings->parameters_file);
    if (parameters->kept_calibration == NULL) {
        fv_parameters_close(parameters);
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for live parameters");
    }
    parameters->in_force = settings->runtime;
    fv_ring_init(&parameters->ring, parameters->ring_memory, RING_BYTES);
    fv_message_channel(prefix, FV_MESSAGE_PARAMETER, parameters->request_channel);
    fv_message_channel(prefix, FV_MESSAGE_PARAMETER_RESULT, parameters->channel);
    return FOVEA_OK;
}

void fv_parameters_close(struct fv_parameters *parameters)
{
    free(parameters->settings);
    free(parameters->tried);
    free(parameters->kept);
    free(parameters->kept_tried);
    free(parameters->written);
    free(parameters->kept_calibration);
    free(parameters->keeping);
    free(parameters->camera_requests);
    free(parameters->answers);
    free(parameters->taken);
    free(parameters->ring_memory);
    *parameters = (struct fv_parameters){.rt = NULL};
}

/* ---- on the listener's thread ---------------------------------------------------------------- */

static void print_value(const struct fv_settings *settings, const struct fv_settings_key *key,
                        char value[FV_PARAMETER_VALUE_BYTES])
{
    char *text = fv_settings_value_text(settings, key);
    snprintf(value, FV_PARAMETER_VALUE_BYTES, "%s", text != NULL ? text : "");
    free(text);
}

static void refuse(struct fv_parameter_change *change, const char *reason)
{
    change->result = FOVEA_PARAMETER_RESULT_T_RESULT_REFUSED;
    change->bytes = 0;
    snprintf(change->reason, sizeof change->reason, "%.255s", reason);
    fv_utf8_cut(change->reason);
}

/* Without what says that the text was an option. */
static const char *without_option(const char *text)
{
    static const char option[] = "--set: ";
    return strncmp(text, option, sizeof option - 1) == 0 ? text + sizeof option - 1 : text;
}

/* The values tried, as the loop takes them and as a start would. `error` may be NULL. */
static enum fovea_status check_tried(const struct fv_parameters *parameters,
                                     struct fovea_error *error)
{
    const struct fovea_config *config = &parameters->tried->runtime;
    const enum fovea_status status = fovea_parameters_check(parameters->rt, config, error);
    if ((status == FOVEA_OK || status == FOVEA_ERROR_UNSUPPORTED) &&
        parameters->unbalanced.text[0] != '\0' && fv_preprocess_balances(&config->image.preprocess))
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT, "%s", parameters->unbalanced.text);
    return status;
}

/* The value tried as an input of the loop. */
static void describe(const struct fv_parameters *parameters, const struct fv_settings_key *key,
                     struct fv_parameter_change *change)
{
    const struct fovea_config *config = &parameters->tried->runtime;
    change->result = FOVEA_PARAMETER_RESULT_T_RESULT_DONE;
    change->offset = (uint32_t)(key->offset - offsetof(struct fv_settings, runtime));
    change->bytes = (uint32_t)fv_settings_key_bytes(key);
    memcpy(change->raw, (const char *)config + change->offset, change->bytes);
}

static void accept(struct fv_parameters *parameters, const struct fv_settings_key *key,
                   struct fv_parameter_change *change)
{
    describe(parameters, key, change);
    *parameters->settings = *parameters->tried;
}

/* The value among those of the next start, if it goes with them. False: refused. */
static bool try_to_keep(struct fv_parameters *parameters, const char *assignment,
                        struct fv_parameter_change *change)
{
    struct fovea_error error = {0};
    char reason[FV_PARAMETER_REASON_BYTES];
    if (parameters->settings->parameters_file[0] == '\0') {
        refuse(change, "found keep, expected a file in the key parameters.file");
        return false;
    }
    if (parameters->keeping_count == FV_PARAMETERS_WAITING) {
        refuse(change, "too often: the values before this one are not yet kept");
        return false;
    }
    *parameters->kept_tried = *parameters->kept;
    if (fv_settings_set(parameters->kept_tried, assignment, &error) == FOVEA_OK &&
        fv_settings_check(parameters->kept_tried, &error) == FOVEA_OK)
        return true;
    snprintf(reason, sizeof reason, "the next start cannot have it: %.200s",
             without_option(error.text));
    refuse(change, reason);
    return false;
}

/* To be written; the answer comes after that. */
static void keep(struct fv_parameters *parameters, struct fv_parameter_change *change)
{
    *parameters->kept = *parameters->kept_tried;
    parameters->keeping[parameters->keeping_count] = *change;
    parameters->keeping[parameters->keeping_count++].bytes = 0;
    change->answered = false;
}

/* To the thread that may wait for the camera; the answer comes after that. */
static void queue_camera_request(struct fv_parameters *parameters, const fovea_parameter_t *request,
                                 struct fv_parameter_change *change)
{
    if (parameters->camera_request_count == FV_PARAMETERS_WAITING) {
        refuse(change, "too often: the camera has not yet taken the values before this one");
        return;
    }
    struct fv_parameter_change *waits =
        &parameters->camera_requests[parameters->camera_request_count++];
    *waits = *change;
    waits->keep = request->keep;
    snprintf(waits->value, sizeof waits->value, "%s", request->value);
    change->answered = false;
}

/* Read the value over a copy of what is in force, and take the copy where all is right. */
static void decide(struct fv_parameters *parameters, const fovea_parameter_t *request,
                   struct fv_parameter_change *change)
{
    char assignment[FV_PARAMETER_KEY_BYTES + FV_PARAMETER_VALUE_BYTES];
    struct fovea_error error = {0};
    enum fovea_source_control control;
    const struct fv_settings_key *key = fv_settings_key_find(request->key);
    if (key == NULL) {
        refuse(change, "found an unknown key, expected one that `fovea config` prints as live");
        return;
    }
    print_value(parameters->settings, key, change->value);
    if (request->value[0] == '\0') { /* asks */
        change->result = FOVEA_PARAMETER_RESULT_T_RESULT_DONE;
        return;
    }
    if (!key->live || fv_settings_key_bytes(key) > sizeof change->raw) {
        refuse(change, "found a key that is read at the start, expected a live one, or a restart");
        return;
    }
    *parameters->tried = *parameters->settings;
    snprintf(assignment, sizeof assignment, "%s=%s", key->name, request->value);
    enum fovea_status status = fv_settings_set(parameters->tried, assignment, &error);
    if (status == FOVEA_OK) status = check_tried(parameters, &error);
    const bool later = status == FOVEA_ERROR_UNSUPPORTED && request->keep;
    if (status != FOVEA_OK && !later) {
        refuse(change, without_option(error.text));
        return;
    }
    if (request->keep && !try_to_keep(parameters, assignment, change)) return;
    if (fv_camera_control(key, &control)) {
        queue_camera_request(parameters, request, change);
        return;
    }
    if (later) {
        refuse(change, error.text);
        change->result = FOVEA_PARAMETER_RESULT_T_RESULT_NEEDS_RESTART;
    } else {
        accept(parameters, key, change);
        print_value(parameters->settings, key, change->value);
    }
    if (request->keep) keep(parameters, change);
}

static void begin_change(struct fv_parameter_change *change, const fovea_parameter_t *request)
{
    memset(change, 0, sizeof *change);
    change->answered = true;
    change->id = request->id;
    change->sender = request->sender;
    snprintf(change->key, sizeof change->key, "%s", request->key);
    fv_utf8_cut(change->key);
}

/* Of an answer; 0: it does not fit. */
static int encode(const struct fv_parameters *parameters, struct fv_parameter_change *change,
                  uint8_t data[ANSWER_BYTES_MAX])
{
    const fovea_parameter_result_t message = {.utime = fv_clock_ns(CLOCK_REALTIME) / 1000,
                                              .run_id = parameters->requests->run_id,
                                              .id = change->id,
                                              .sender = change->sender,
                                              .key = change->key,
                                              .value = change->value,
                                              .result = change->result,
                                              .reason = change->reason};
    const int bytes = fovea_parameter_result_t_encode(data, 0, ANSWER_BYTES_MAX, &message);
    return bytes > 0 ? bytes : 0;
}

static void judge(struct fv_parameters *parameters, const fovea_parameter_t *request,
                  const struct fv_received *received)
{
    struct fv_requests *requests = parameters->requests;
    struct fv_parameter_change *change = (void *)fv_ring_reserve(&parameters->ring, sizeof *change),
                               refused;
    uint8_t data[ANSWER_BYTES_MAX];
    const char *reason;
    switch (fv_requests_judge(requests, request, received,
                              fv_command_gate_parameters(&requests->gate), change != NULL,
                              &reason)) {
    case FV_REQUEST_TAKEN:
        if (change == NULL) break; /* there is room: it is none of those */
        begin_change(change, request);
        decide(parameters, request, change);
        fv_ring_commit(&parameters->ring, sizeof *change);
        break;
    case FV_REQUEST_REFUSED:
        begin_change(&refused, request);
        refuse(&refused, reason);
        fv_requests_answer(requests, parameters->channel, data, encode(parameters, &refused, data));
        break;
    case FV_REQUEST_IGNORED:
        break;
    }
}

static void take_request(void *context, const struct fv_received *received)
{
    struct fv_parameters *parameters = context;
    fovea_parameter_t request;
    if (fovea_parameter_t_decode(received->data, 0, (int)received->bytes, &request) < 0) return;
    pthread_mutex_lock(&parameters->changing);
    judge(parameters, &request, received);
    pthread_mutex_unlock(&parameters->changing);
    fovea_parameter_t_decode_cleanup(&request);
}

struct fv_receiver_channel fv_parameters_row(struct fv_parameters *parameters)
{
    struct fv_receiver_channel row = {.type = "fovea.parameter_t",
                                      .bytes_max = REQUEST_BYTES_MAX,
                                      .take = take_request,
                                      .context = parameters};
    snprintf(row.name, sizeof row.name, "%s", parameters->request_channel);
    return row;
}

/* ---- the configuration, read again ----------------------------------------------------------- */

/* Room in the ring, for which the loop is waited for. NULL: it takes nothing. */
static struct fv_parameter_change *await_room(struct fv_parameters *parameters)
{
    void *room = NULL;
    for (int i = 0; i < 200 && room == NULL; i++) {
        room = fv_ring_reserve(&parameters->ring, sizeof(struct fv_parameter_change));
        if (room == NULL) nanosleep(&(struct timespec){.tv_nsec = 10000000}, NULL);
    }
    return room;
}

/* Change one key, if that goes with what is in force. */
static enum fovea_status change_key(struct fv_parameters *parameters,
                                    const struct fv_settings_key *key,
                                    const struct fv_settings *wanted, struct fovea_error *error)
{
    *parameters->tried = *parameters->settings;
    fv_settings_key_copy(key, parameters->tried, wanted);
    if (check_tried(parameters, NULL) != FOVEA_OK) return FOVEA_AGAIN;
    struct fv_parameter_change *change = await_room(parameters);
    if (change == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "%s: the loop has taken no parameter for 2 s", key->name);
    memset(change, 0, sizeof *change);
    snprintf(change->key, sizeof change->key, "%s", key->name);
    accept(parameters, key, change);
    print_value(parameters->settings, key, change->value);
    fv_ring_commit(&parameters->ring, sizeof *change);
    return FOVEA_OK;
}

/* Whether a reload changes the key. */
static bool changes(const struct fv_parameters *parameters, const struct fv_settings_key *key,
                    const struct fv_settings *wanted, bool named)
{
    return key->live && (!named || wanted->line[key - fv_settings_keys] != 0) &&
           fv_settings_key_differs(key, parameters->settings, wanted);
}

/* Set the controls that a reload changes: all of it, or nothing. */
static enum fovea_status set_cameras(struct fv_parameters *parameters,
                                     const struct fv_settings *wanted, bool named,
                                     struct fovea_error *error)
{
    bool set[FOVEA_SOURCE_CONTROL_COUNT] = {false};
    enum fovea_status status = FOVEA_OK;
    enum fovea_source_control control;
    struct fovea_error said = {.text = ""}, unused;
    for (size_t i = 0; i < fv_settings_key_count && status == FOVEA_OK; i++) {
        const struct fv_settings_key *key = &fv_settings_keys[i];
        if (!fv_camera_control(key, &control) || !changes(parameters, key, wanted, named)) continue;
        status = fv_source_control(parameters->ops, parameters->source, control,
                                   fv_camera_control_value(wanted, control), &said);
        set[control] = status == FOVEA_OK;
    }
    for (int i = 0; i < FOVEA_SOURCE_CONTROL_COUNT && status != FOVEA_OK; i++) {
        control = (enum fovea_source_control)i;
        if (set[i])
            (void)fv_source_control(parameters->ops, parameters->source, control,
                                    fv_camera_control_value(parameters->settings, control),
                                    &unused);
    }
    return status == FOVEA_OK ? FOVEA_OK
                              : fovea_error_set(error, FOVEA_ERROR_INPUT, "%s", said.text);
}

/* Again and again over the keys: where two limit each other, one of them can go first. */
static enum fovea_status change_all(struct fv_parameters *parameters,
                                    const struct fv_settings *wanted, bool named, uint32_t *count,
                                    struct fovea_error *error)
{
    for (uint32_t before = UINT32_MAX; before != *count;) {
        before = *count;
        for (size_t i = 0; i < fv_settings_key_count; i++) {
            const struct fv_settings_key *key = &fv_settings_keys[i];
            if (!changes(parameters, key, wanted, named)) continue;
            const enum fovea_status status = change_key(parameters, key, wanted, error);
            if (status < 0) return status;
            *count += status == FOVEA_OK;
        }
    }
    return FOVEA_OK;
}

enum fovea_status fv_parameters_reload(struct fv_parameters *parameters,
                                       const struct fv_settings *wanted, bool named,
                                       uint32_t *count, struct fovea_error *error)
{
    *count = 0;
    if (parameters->rt == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM, "no parameters can change in this run");
    pthread_mutex_lock(&parameters->changing);
    *parameters->tried = named ? *parameters->settings : *wanted;
    for (size_t i = 0; named && i < fv_settings_key_count; i++)
        if (fv_settings_keys[i].live && wanted->line[i] != 0)
            fv_settings_key_copy(&fv_settings_keys[i], parameters->tried, wanted);
    enum fovea_status status = check_tried(parameters, error);
    if (status == FOVEA_OK) status = set_cameras(parameters, wanted, named, error);
    if (status == FOVEA_OK) status = change_all(parameters, wanted, named, count, error);
    pthread_mutex_unlock(&parameters->changing);
    return status;
}

/* ---- requests that change a camera ----------------------------------------------------------- */

/* Take the first that waits, its value read into `tried`. False: none. */
static bool take_camera_request(struct fv_parameters *parameters,
                                struct fv_parameter_change *change,
                                char assignment[FV_PARAMETER_KEY_BYTES + FV_PARAMETER_VALUE_BYTES])
{
    if (parameters->camera_request_count == 0) return false;
    *change = parameters->camera_requests[0];
    parameters->camera_request_count--;
    memmove(parameters->camera_requests, parameters->camera_requests + 1,
            parameters->camera_request_count * sizeof *parameters->camera_requests);
    snprintf(assignment, FV_PARAMETER_KEY_BYTES + FV_PARAMETER_VALUE_BYTES, "%s=%s", change->key,
             change->value);
    *parameters->tried = *parameters->settings;
    return fv_settings_set(parameters->tried, assignment, NULL) == FOVEA_OK; /* as before */
}

/* The camera has answered: to the loop. */
static void end_camera_request(struct fv_parameters *parameters, const struct fv_settings_key *key,
                               struct fv_parameter_change *change)
{
    struct fv_parameter_change *room = await_room(parameters);
    if (room == NULL) return; /* the loop stands still: nobody would send an answer */
    if (change->bytes > 0) *parameters->settings = *parameters->tried;
    print_value(parameters->settings, key, change->value);
    if (change->keep && change->bytes > 0) keep(parameters, change);
    *room = *change;
    fv_ring_commit(&parameters->ring, sizeof *room);
}

/* False: there is none, or the camera does not answer. */
static bool serve_camera_request(struct fv_parameters *parameters)
{
    char assignment[FV_PARAMETER_KEY_BYTES + FV_PARAMETER_VALUE_BYTES];
    struct fv_parameter_change change;
    struct fovea_error said;
    enum fovea_source_control control;
    pthread_mutex_lock(&parameters->changing);
    const bool any = take_camera_request(parameters, &change, assignment);
    const struct fv_settings_key *key = any ? fv_settings_key_find(change.key) : NULL;
    const bool one = key != NULL && fv_camera_control(key, &control);
    const double before = one ? fv_camera_control_value(parameters->settings, control) : 0,
                 value = one ? fv_camera_control_value(parameters->tried, control) : 0;
    pthread_mutex_unlock(&parameters->changing);
    if (!one) return false;
    const enum fovea_status status =
        fv_source_control(parameters->ops, parameters->source, control, value, &said);
    pthread_mutex_lock(&parameters->changing);
    *parameters->tried = *parameters->settings;
    if (status != FOVEA_OK) {
        refuse(&change, said.text);
    } else if (change.keep && !try_to_keep(parameters, assignment, &change)) {
        (void)fv_source_control(parameters->ops, parameters->source, control, before, &said);
    } else {
        (void)fv_settings_set(parameters->tried, assignment, NULL);
        describe(parameters, key, &change);
        snprintf(change.reason, sizeof change.reason, "%.255s", said.text);
        fv_utf8_cut(change.reason);
    }
    end_camera_request(parameters, key, &change);
    pthread_mutex_unlock(&parameters->changing);
    return status != FOVEA_AGAIN;
}

/* ---- what is kept ---------------------------------------------------------------------------- */

/* Take what is to be written; false: nothing, or too soon after the last time. */
static bool take_kept(struct fv_parameters *parameters, bool now)
{
    const int64_t now_ns = fv_clock_ns(CLOCK_MONOTONIC);
    pthread_mutex_lock(&parameters->changing);
    const bool due =
        parameters->keeping_count > 0 && (now || now_ns - parameters->written_ns >= keep_ns);
    if (due) {
        parameters->answer_count = parameters->keeping_count;
        memcpy(parameters->answers, parameters->keeping,
               parameters->keeping_count * sizeof *parameters->keeping);
        parameters->keeping_count = 0;
        *parameters->written = *parameters->kept;
        parameters->answers_passed = 0;
        parameters->written_ns = now_ns;
    }
    pthread_mutex_unlock(&parameters->changing);
    return due;
}

static void write_kept(struct fv_parameters *parameters)
{
    struct fovea_error error;
    char reason[FV_PARAMETER_REASON_BYTES];
    const char *path = parameters->settings->parameters_file;
    if (fv_kept_parameters_write(parameters->written, parameters->kept_calibration, path, &error) ==
        FOVEA_OK)
        return;
    snprintf(reason, sizeof reason, "not kept for the next start: %.200s", error.text);
    for (uint32_t i = 0; i < parameters->answer_count; i++)
        refuse(&parameters->answers[i], reason);
}

/* To the loop, which sends answers; those that find no room wait. */
static void pass_answers(struct fv_parameters *parameters)
{
    pthread_mutex_lock(&parameters->changing);
    while (parameters->answers_passed < parameters->answer_count) {
        void *room = fv_ring_reserve(&parameters->ring, sizeof(struct fv_parameter_change));
        if (room == NULL) break;
        memcpy(room, &parameters->answers[parameters->answers_passed++],
               sizeof(struct fv_parameter_change));
        fv_ring_commit(&parameters->ring, sizeof(struct fv_parameter_change));
    }
    pthread_mutex_unlock(&parameters->changing);
}

void fv_parameters_tend(struct fv_parameters *parameters, bool now)
{
    if (parameters->rt == NULL) return;
    while (!now && serve_camera_request(parameters))
        continue;
    if (parameters->answers_passed == parameters->answer_count && take_kept(parameters, now))
        write_kept(parameters);
    pass_answers(parameters);
}

/* ---- on the loop's --------------------------------------------------------------------------- */

void fv_parameters_take(struct fv_parameters *parameters, struct fovea_inputs *inputs)
{
    parameters->taken_count = 0;
    if (parameters->taken == NULL) return; /* nothing is heard */
    while (parameters->taken_count < FV_PARAMETERS_WAITING) {
        size_t bytes;
        const uint8_t *data = fv_ring_peek(&parameters->ring, &bytes);
        if (data == NULL) return;
        struct fv_parameter_change *change = &parameters->taken[parameters->taken_count++];
        memcpy(change, data, sizeof *change);
        fv_ring_release(&parameters->ring, sizeof *change);
        if (change->bytes == 0) continue;
        memcpy((char *)&parameters->in_force + change->offset, change->raw, change->bytes);
        inputs->parameters = &parameters->in_force;
    }
}

static void answer(const struct fv_parameters *parameters, struct fv_parameter_change *change,
                   struct fv_transport *transport, struct fv_feed *feed)
{
    uint8_t data[ANSWER_BYTES_MAX];
    if (!change->answered) return;
    const int bytes = encode(parameters, change, data);
    if (bytes == 0) return;
    const struct fovea_message out = {parameters->channel, data, (uint32_t)bytes, true};
    fv_transport_put(transport, &out);
    fv_feed_put(feed, &out);
}

void fv_parameters_step(struct fv_parameters *parameters, struct fv_recorder *const recorders[2],
                        const struct fovea_inputs *inputs, struct fv_transport *transport,
                        struct fv_feed *feed)
{
    for (uint32_t i = 0; i < parameters->taken_count; i++) {
        struct fv_parameter_change *change = &parameters->taken[i];
        for (int n = 0; n < 2 && change->bytes > 0; n++)
            fv_recorder_parameter(recorders[n], inputs, change->key, change->value);
        answer(parameters, change, transport, feed);
    }
    parameters->taken_count = 0;
}

void fv_parameters_end(struct fv_parameters *parameters, struct fv_transport *transport,
                       struct fv_feed *feed)
{
    struct fovea_inputs none = {.frame = NULL};
    if (parameters->rt == NULL) return; /* nothing is heard */
    pthread_mutex_lock(&parameters->changing);
    for (uint32_t i = 0; i < parameters->camera_request_count; i++) {
        struct fv_parameter_change *waits = &parameters->camera_requests[i];
        print_value(parameters->settings, fv_settings_key_find(waits->key), waits->value);
        refuse(waits, "the run has ended");
        answer(parameters, waits, transport, feed);
    }
    parameters->camera_request_count = 0;
    pthread_mutex_unlock(&parameters->changing);
    do {
        fv_parameters_tend(parameters, true);
        fv_parameters_take(parameters, &none);
        for (uint32_t i = 0; i < parameters->taken_count; i++) {
            if (parameters->taken[i].bytes > 0) refuse(&parameters->taken[i], "the run has ended");
            answer(parameters, &parameters->taken[i], transport, feed);
        }
    } while (parameters->taken_count > 0);
}
