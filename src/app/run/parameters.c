#include "app/run/parameters.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "app/config/camera_controls.h"
#include "app/config/kept_parameters.h"
#include "app/run/parameters_internal.h"
#include "drivers/clock.h"
#include "drivers/table.h"
#include "image/preprocess.h"
#include "support/aligned.h"
#include "support/utf8.h"

#include "fovea_parameter_result_t.h"
#include "fovea_parameter_t.h"

enum {
    REQUEST_BYTES_MAX = 1280, /* key, value and the rest */
    /* The ring gives a record no more than half of its room. */
    RING_BYTES = (2 * FV_PARAMETERS_WAITING + 1) * sizeof(struct fv_parameter_change)
};

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

void fv_parameters_print_value(const struct fv_settings *settings,
                               const struct fv_settings_key *key,
                               char value[FV_PARAMETER_VALUE_BYTES])
{
    char *text = fv_settings_value_text(settings, key);
    snprintf(value, FV_PARAMETER_VALUE_BYTES, "%s", text != NULL ? text : "");
    free(text);
}

void fv_parameters_refuse(struct fv_parameter_change *change, const char *reason)
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

void fv_parameters_describe(const struct fv_parameters *parameters,
                            const struct fv_settings_key *key, struct fv_parameter_change *change)
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
    fv_parameters_describe(parameters, key, change);
    *parameters->settings = *parameters->tried;
}

bool fv_parameters_try_to_keep(struct fv_parameters *parameters, const char *assignment,
                               struct fv_parameter_change *change)
{
    struct fovea_error error = {0};
    char reason[FV_PARAMETER_REASON_BYTES];
    if (parameters->settings->parameters_file[0] == '\0') {
        fv_parameters_refuse(change, "found keep, expected a file in the key parameters.file");
        return false;
    }
    if (parameters->keeping_count == FV_PARAMETERS_WAITING) {
        fv_parameters_refuse(change, "too often: the values before this one are not yet kept");
        return false;
    }
    *parameters->kept_tried = *parameters->kept;
    if (fv_settings_set(parameters->kept_tried, assignment, &error) == FOVEA_OK &&
        fv_settings_check(parameters->kept_tried, &error) == FOVEA_OK)
        return true;
    snprintf(reason, sizeof reason, "the next start cannot have it: %.200s",
             without_option(error.text));
    fv_parameters_refuse(change, reason);
    return false;
}

void fv_parameters_keep(struct fv_parameters *parameters, struct fv_parameter_change *change)
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
        fv_parameters_refuse(change,
                             "too often: the camera has not yet taken the values before this one");
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
        fv_parameters_refuse(
            change, "found an unknown key, expected one that `fovea config` prints as live");
        return;
    }
    fv_parameters_print_value(parameters->settings, key, change->value);
    if (request->value[0] == '\0') { /* asks */
        change->result = FOVEA_PARAMETER_RESULT_T_RESULT_DONE;
        return;
    }
    if (!key->live || fv_settings_key_bytes(key) > sizeof change->raw) {
        fv_parameters_refuse(
            change, "found a key that is read at the start, expected a live one, or a restart");
        return;
    }
    *parameters->tried = *parameters->settings;
    snprintf(assignment, sizeof assignment, "%s=%s", key->name, request->value);
    enum fovea_status status = fv_settings_set(parameters->tried, assignment, &error);
    if (status == FOVEA_OK) status = check_tried(parameters, &error);
    const bool later = status == FOVEA_ERROR_UNSUPPORTED && request->keep;
    if (status != FOVEA_OK && !later) {
        fv_parameters_refuse(change, without_option(error.text));
        return;
    }
    if (request->keep && !fv_parameters_try_to_keep(parameters, assignment, change)) return;
    if (fv_camera_control(key, &control)) {
        queue_camera_request(parameters, request, change);
        return;
    }
    if (later) {
        fv_parameters_refuse(change, error.text);
        change->result = FOVEA_PARAMETER_RESULT_T_RESULT_NEEDS_RESTART;
    } else {
        accept(parameters, key, change);
        fv_parameters_print_value(parameters->settings, key, change->value);
    }
    if (request->keep) fv_parameters_keep(parameters, change);
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

int fv_parameters_encode(const struct fv_parameters *parameters, struct fv_parameter_change *change,
                         uint8_t data[FV_PARAMETERS_ANSWER_BYTES])
{
    const fovea_parameter_result_t message = {.utime = fv_clock_ns(CLOCK_REALTIME) / 1000,
                                              .run_id = parameters->requests->run_id,
                                              .id = change->id,
                                              .sender = change->sender,
                                              .key = change->key,
                                              .value = change->value,
                                              .result = change->result,
                                              .reason = change->reason};
    const int bytes =
        fovea_parameter_result_t_encode(data, 0, FV_PARAMETERS_ANSWER_BYTES, &message);
    return bytes > 0 ? bytes : 0;
}

static void judge(struct fv_parameters *parameters, const fovea_parameter_t *request,
                  const struct fv_received *received)
{
    struct fv_requests *requests = parameters->requests;
    struct fv_parameter_change *change = (void *)fv_ring_reserve(&parameters->ring, sizeof *change),
                               refused;
    uint8_t data[FV_PARAMETERS_ANSWER_BYTES];
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
        fv_parameters_refuse(&refused, reason);
        fv_requests_answer(requests, parameters->channel, data,
                           fv_parameters_encode(parameters, &refused, data));
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
    return fv_receiver_channel_of(parameters->request_channel, "fovea.parameter_t",
                                  REQUEST_BYTES_MAX, take_request, parameters);
}

/* ---- the configuration, read again ----------------------------------------------------------- */

struct fv_parameter_change *fv_parameters_await_room(struct fv_parameters *parameters)
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
    struct fv_parameter_change *change = fv_parameters_await_room(parameters);
    if (change == NULL)
        return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                               "%s: the loop has taken no parameter for 2 s", key->name);
    memset(change, 0, sizeof *change);
    snprintf(change->key, sizeof change->key, "%s", key->name);
    accept(parameters, key, change);
    fv_parameters_print_value(parameters->settings, key, change->value);
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
