#include "app/run/backup.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/config/setup.h"
#include "drivers/clock.h"
#include "support/say.h"

#include "fovea_settings_result_t.h"
#include "fovea_settings_t.h"

enum fovea_status fv_backup_open(struct fv_backup *backup, struct fv_parameters *parameters,
                                 const struct fv_settings *started,
                                 const struct fovea_source_info *source, struct fovea_error *error)
{
    const char *prefix = started->runtime.channel_prefix;
    memset(backup, 0, sizeof *backup);
    backup->parameters = parameters;
    backup->started = started;
    backup->source = source;
    backup->message = malloc(FV_BACKUP_MESSAGE_BYTES);
    backup->text = calloc(1, FV_KEPT_BYTES_MAX + 1);
    fv_message_channel(prefix, FV_MESSAGE_SETTINGS, backup->request_channel);
    fv_message_channel(prefix, FV_MESSAGE_SETTINGS_RESULT, backup->channel);
    if (backup->message != NULL && backup->text != NULL) return FOVEA_OK;
    fv_backup_close(backup);
    return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for backups of settings");
}

void fv_backup_close(struct fv_backup *backup)
{
    free(backup->message);
    free(backup->text);
    memset(backup, 0, sizeof *backup);
}

/* ---- on the listener's thread ---------------------------------------------------------------- */

static int encode(const struct fv_backup *backup, int8_t result, const char *text, uint8_t *data,
                  int bytes_max)
{
    const fovea_settings_result_t message = {.utime = fv_clock_ns(CLOCK_REALTIME) / 1000,
                                             .run_id = backup->parameters->requests->run_id,
                                             .id = backup->id,
                                             .sender = backup->sender,
                                             .result = result,
                                             .text = (char *)(uintptr_t)text,
                                             .reason = (char *)(uintptr_t)backup->reason};
    return fovea_settings_result_t_encode(data, 0, bytes_max, &message);
}

static void refuse(struct fv_backup *backup, const fovea_settings_t *request, const char *reason)
{
    uint8_t data[FV_REQUESTS_ANSWER_BYTES];
    struct fv_backup one = {
        .parameters = backup->parameters, .id = request->id, .sender = request->sender};
    snprintf(one.reason, sizeof one.reason, "%s", reason);
    fv_requests_answer(backup->parameters->requests, backup->channel, data,
                       encode(&one, FOVEA_SETTINGS_RESULT_T_RESULT_REFUSED, "", data, sizeof data));
}

static void take(struct fv_backup *backup, const fovea_settings_t *request,
                 const struct fv_received *received)
{
    struct fv_requests *requests = backup->parameters->requests;
    char too_long[80];
    const char *reason;
    enum fv_request_verdict verdict =
        fv_requests_judge(requests, request, received, fv_command_gate_parameters(&requests->gate),
                          atomic_load(&backup->stage) == FV_BACKUP_IDLE, &reason);
    if (verdict == FV_REQUEST_TAKEN && strlen(request->text) > FV_KEPT_BYTES_MAX) {
        snprintf(too_long, sizeof too_long, "found %zu bytes, expected at most %d",
                 strlen(request->text), FV_KEPT_BYTES_MAX);
        verdict = FV_REQUEST_REFUSED;
        reason = too_long;
    }
    if (verdict == FV_REQUEST_REFUSED) refuse(backup, request, reason);
    if (verdict != FV_REQUEST_TAKEN) return;
    backup->id = request->id;
    backup->sender = request->sender;
    backup->reason[0] = '\0';
    snprintf(backup->text, FV_KEPT_BYTES_MAX + 1, "%s", request->text);
    atomic_store(&backup->stage, FV_BACKUP_ASKED);
}

static void take_request(void *context, const struct fv_received *received)
{
    struct fv_backup *backup = context;
    fovea_settings_t request;
    if (received->bytes > FV_BACKUP_MESSAGE_BYTES ||
        fovea_settings_t_decode(received->data, 0, (int)received->bytes, &request) < 0)
        return;
    take(backup, &request, received);
    fovea_settings_t_decode_cleanup(&request);
}

struct fv_receiver_channel fv_backup_row(struct fv_backup *backup)
{
    return fv_receiver_channel_of(backup->request_channel, "fovea.settings_t",
                                  FV_BACKUP_MESSAGE_BYTES, take_request, backup);
}

/* ---- giving out ------------------------------------------------------------------------------ */

static void print_keys(FILE *file, const struct fv_settings *settings)
{
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        const struct fv_settings_key *key = &fv_settings_keys[i];
        fprintf(file, "%s%s: ", key->host ? "# " : "", key->name);
        if (strcmp(key->name, "command_key") == 0)
            fprintf(file, "(not given out)"); /* where the key of commands is */
        else
            fv_settings_value_print(file, settings, key);
        fprintf(file, "\n");
    }
}

/* The calibration in force, where a file states it; one of several cameras stays in its file. */
static void print_calibration(FILE *file, const struct fv_settings *settings)
{
    const struct fovea_rig *rig = &settings->runtime.rig;
    const struct fv_calibration calibration = {.camera = rig->cameras[0].camera};
    char text[FV_CALIBRATION_BYTES_MAX];
    if (settings->camera[0] != '\0' && rig->camera_count == 1 &&
        fv_calibration_format_text(FV_CALIBRATION_ROS, &calibration, text, NULL, NULL) == FOVEA_OK)
        fprintf(file, "---\n%s", text);
}

/* All settings in force, of malloc; NULL: no memory. */
static char *give(const struct fv_backup *backup)
{
    char *text = NULL;
    size_t bytes = 0;
    struct fv_settings *settings = malloc(sizeof *settings);
    FILE *file = settings != NULL ? open_memstream(&text, &bytes) : NULL;
    if (file == NULL) {
        free(settings);
        return NULL;
    }
    pthread_mutex_lock(&backup->parameters->changing);
    *settings = *backup->parameters->settings;
    pthread_mutex_unlock(&backup->parameters->changing);
    fprintf(file,
            "# All settings of a run of Fovea %s. Lines that are comments belong to the host, and\n"
            "# stay in its configuration when this file is restored.\n",
            FOVEA_VERSION);
    print_keys(file, settings);
    print_calibration(file, settings);
    free(settings);
    if (fclose(file) == 0 && bytes <= FV_KEPT_BYTES_MAX) return text;
    free(text);
    return NULL;
}

/* ---- taking back ----------------------------------------------------------------------------- */

struct restored {
    struct fv_settings with;   /* of the next start; lines: keys that are kept */
    struct fv_settings before; /* parameters->kept */
    struct fv_settings wanted; /* in force, with all that is live; lines: keys of the text */
    char calibration[FV_CALIBRATION_BYTES_MAX];
    struct fovea_camera camera; /* the same */
    bool has_calibration, keeps_camera;
    uint32_t live, later; /* keys that change */
};

/* It must be one of this camera's frames, and is kept as we print it. */
static enum fovea_status take_calibration(const struct fv_backup *backup, const char *text,
                                          struct restored *restored, struct fovea_error *error)
{
    const struct fv_settings *started = backup->started;
    const struct fovea_source_camera *camera = &backup->source->cameras[0];
    struct fv_calibration read;
    if (started->camera[0] == '\0' || started->runtime.rig.camera_count != 1)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "calibration: found one, expected none where the key camera names "
                               "no file of one camera");
    enum fovea_status status =
        fv_calibration_parse("calibration", text, strlen(text), NULL, &read, error);
    if (status == FOVEA_OK)
        status = fv_calibration_format_text(FV_CALIBRATION_ROS, &read, restored->calibration, NULL,
                                            error);
    restored->camera = read.camera;
    return status != FOVEA_OK
               ? status
               : fv_calibration_fit(&read.camera, camera->width, camera->height,
                                    restored->with.camera_scale, "calibration", error);
}

/* Which keys are kept, and how many change; a key that is as it would be anyhow is not kept. */
static void count_keys(const struct fv_backup *backup, struct restored *restored)
{
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        const struct fv_settings_key *key = &fv_settings_keys[i];
        restored->wanted.line[i] = restored->with.line[i];
        if (restored->with.line[i] != 0) {
            const bool same = !fv_settings_key_differs(key, &restored->with, &restored->before);
            if (key->live && fv_settings_key_differs(key, &restored->with, &restored->wanted))
                restored->live++;
            if (!key->live && fv_settings_key_differs(key, &restored->with, backup->started))
                restored->later++;
            if (key->live) fv_settings_key_copy(key, &restored->wanted, &restored->with);
            restored->with.line[i] = same && restored->before.line[i] == 0 ? 0 : 1;
        } else {
            restored->with.line[i] = restored->before.line[i];
        }
    }
}

/* Of the calibration that is kept already. */
static enum fovea_status kept_camera(const struct fv_backup *backup, struct restored *restored,
                                     struct fovea_error *error)
{
    const char *text = backup->parameters->kept_calibration;
    char name[FV_SETTINGS_PATH_BYTES + 16];
    struct fv_calibration read;
    restored->keeps_camera = text[0] != '\0' && restored->with.camera[0] != '\0';
    if (!restored->keeps_camera) return FOVEA_OK;
    snprintf(name, sizeof name, "%s: calibration", backup->started->parameters_file);
    const enum fovea_status status =
        fv_calibration_parse(name, text, strlen(text), NULL, &read, error);
    restored->camera = read.camera;
    return status;
}

/* The whole text, before anything changes. */
static enum fovea_status check(const struct fv_backup *backup, struct restored *restored,
                               struct fovea_error *error)
{
    const char *calibration;
    if (backup->started->parameters_file[0] == '\0')
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found no file to restore to, expected one in the key "
                               "parameters.file");
    restored->with = restored->before;
    enum fovea_status status =
        fv_kept_parameters_parse(&restored->with, "settings", backup->text, &calibration, error);
    count_keys(backup, restored);
    if (status == FOVEA_OK) status = fv_settings_check(&restored->with, error);
    restored->has_calibration = calibration != NULL;
    if (status == FOVEA_OK && calibration != NULL)
        status = take_calibration(backup, calibration, restored, error);
    else if (status == FOVEA_OK)
        status = kept_camera(backup, restored, error);
    return status;
}

/* What was written is what is kept: beside it stays what was kept meanwhile. */
static void publish(struct fv_parameters *parameters, const struct restored *restored)
{
    pthread_mutex_lock(&parameters->changing);
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        if (restored->wanted.line[i] == 0) continue;
        fv_settings_key_copy(&fv_settings_keys[i], parameters->kept, &restored->with);
        parameters->kept->line[i] = restored->with.line[i];
    }
    pthread_mutex_unlock(&parameters->changing);
}

/* Returns RESULT_*; `backup->reason` says what happened. */
static int8_t restore(struct fv_backup *backup, struct restored *restored)
{
    struct fv_parameters *parameters = backup->parameters;
    struct fovea_error error = {0};
    uint32_t changed = 0;
    pthread_mutex_lock(&parameters->changing);
    restored->before = *parameters->kept;
    restored->wanted = *parameters->settings;
    enum fovea_status status = check(backup, restored, &error);
    pthread_mutex_unlock(&parameters->changing);
    const bool camera = restored->has_calibration || restored->keeps_camera;
    if (status == FOVEA_OK) /* reads files */
        status = fv_setup_check_next(&restored->with, backup->source,
                                     camera ? &restored->camera : NULL, &error);
    if (status != FOVEA_OK) {
        snprintf(backup->reason, sizeof backup->reason, "%.255s", error.text);
        return FOVEA_SETTINGS_RESULT_T_RESULT_REFUSED;
    }
    const char *calibration =
        restored->has_calibration ? restored->calibration : parameters->kept_calibration;
    char *kept = strdup(calibration);
    if (kept == NULL)
        status = fovea_error_set(&error, FOVEA_ERROR_MEMORY, "no memory");
    else
        status = fv_kept_parameters_write(&restored->with, calibration,
                                          backup->started->parameters_file, &error);
    if (status != FOVEA_OK) {
        free(kept);
        snprintf(backup->reason, sizeof backup->reason, "%.255s", error.text);
        return status == FOVEA_ERROR_INPUT ? FOVEA_SETTINGS_RESULT_T_RESULT_REFUSED
                                           : FOVEA_SETTINGS_RESULT_T_RESULT_FAILED;
    }
    publish(parameters, restored);
    free(parameters->kept_calibration);
    parameters->kept_calibration = kept;
    error.text[0] = '\0';
    if (fv_parameters_reload(parameters, &restored->wanted, true, &changed, &error) != FOVEA_OK)
        changed = 0; /* all of them at the next start, then */
    else
        error.text[0] = '\0';
    snprintf(backup->reason, sizeof backup->reason,
             "%u took hold, %u%s with the next start%s%.128s", changed,
             restored->later + (restored->live > changed ? restored->live - changed : 0),
             restored->has_calibration ? " and the calibration" : "",
             error.text[0] != '\0' ? ": " : "", error.text);
    return FOVEA_SETTINGS_RESULT_T_RESULT_DONE;
}

static int8_t work(struct fv_backup *backup, char **given)
{
    *given = NULL;
    if (backup->ended) return FOVEA_SETTINGS_RESULT_T_RESULT_REFUSED;
    if (backup->text[0] == '\0') {
        *given = give(backup);
        if (*given != NULL) return FOVEA_SETTINGS_RESULT_T_RESULT_DONE;
    } else {
        struct restored *restored = calloc(1, sizeof *restored);
        const int8_t result =
            restored != NULL ? restore(backup, restored) : FOVEA_SETTINGS_RESULT_T_RESULT_FAILED;
        if (restored == NULL) snprintf(backup->reason, sizeof backup->reason, "no memory");
        free(restored);
        return result;
    }
    snprintf(backup->reason, sizeof backup->reason, "no memory");
    return FOVEA_SETTINGS_RESULT_T_RESULT_FAILED;
}

void fv_backup_tend(struct fv_backup *backup)
{
    char *given;
    if (atomic_load(&backup->stage) != FV_BACKUP_ASKED) return;
    const int8_t result = work(backup, &given);
    const int bytes = encode(backup, result, given != NULL ? given : "", backup->message,
                             FV_BACKUP_MESSAGE_BYTES);
    backup->answer_bytes = bytes > 0 ? (uint32_t)bytes : 0;
    free(given);
    if (backup->text[0] != '\0' && result == FOVEA_SETTINGS_RESULT_T_RESULT_DONE)
        fv_say_note("fovea run: settings were restored: %s", backup->reason);
    atomic_store(&backup->stage, FV_BACKUP_ANSWERED);
}

void fv_backup_end(struct fv_backup *backup, struct fv_transport *transport, struct fv_feed *feed)
{
    if (backup->parameters == NULL) return;
    fv_backup_step(backup, transport, feed);
    if (atomic_load(&backup->stage) == FV_BACKUP_ASKED) {
        backup->ended = true;
        snprintf(backup->reason, sizeof backup->reason, "the run has ended");
    }
    fv_backup_tend(backup);
    fv_backup_step(backup, transport, feed);
}

/* ---- on the loop's --------------------------------------------------------------------------- */

void fv_backup_step(struct fv_backup *backup, struct fv_transport *transport, struct fv_feed *feed)
{
    if (atomic_load_explicit(&backup->stage, memory_order_acquire) != FV_BACKUP_ANSWERED) return;
    const struct fovea_message out = {backup->channel, backup->message, backup->answer_bytes, true};
    if (backup->answer_bytes > 0) {
        fv_transport_put(transport, &out);
        fv_feed_put(feed, &out);
    }
    atomic_store_explicit(&backup->stage, FV_BACKUP_IDLE, memory_order_release);
}
