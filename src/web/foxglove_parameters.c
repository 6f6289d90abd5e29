#include "web/foxglove_parameters.h"

#include <stdlib.h>
#include <string.h>

#include "drivers/clock.h"
#include "message/fields.h"

#include "fovea_parameter_result_t.h"

#define PATIENCE_NS (FV_FOXGLOVE_PATIENCE_S * FV_SECOND_NS)

void fv_foxglove_parameters_free(struct fv_foxglove_parameters *parameters)
{
    for (size_t i = 0; i < FV_SETTINGS_KEYS_MAX; i++) {
        free(parameters->keys[i].value);
        parameters->keys[i].value = NULL;
    }
}

int32_t fv_foxglove_parameters_find(const char *name)
{
    const struct fv_settings_key *key = fv_settings_key_find(name);
    return key == NULL ? -1 : (int32_t)(key - fv_settings_keys);
}

void fv_foxglove_parameters_want(struct fv_foxglove_parameters *parameters, uint32_t key)
{
    parameters->keys[key].wanted = true;
}

static void report(struct fv_foxglove_parameters *parameters, uint32_t key, int64_t id,
                   enum fv_foxglove_result result, const char *reason)
{
    const struct fv_foxglove_answer answer = {key, id, result, reason};
    if (parameters->answered != NULL) parameters->answered(parameters->context, &answer);
}

static void ask(struct fv_foxglove_parameters *parameters, int slot, int64_t now_ns)
{
    for (uint32_t key = 0; key < fv_settings_key_count; key++) {
        if (!parameters->keys[key].wanted) continue;
        parameters->keys[key].wanted = false;
        parameters->asked[slot].key = key;
        parameters->asked[slot].sent_ns = now_ns;
        parameters->asked[slot].run_id = parameters->run_id;
        parameters->asked[slot].id =
            fv_web_commander_set(parameters->commander, parameters->prefix, parameters->run_id,
                                 fv_settings_keys[key].name, "", false);
        return;
    }
}

void fv_foxglove_parameters_tick(struct fv_foxglove_parameters *parameters, int64_t now_ns)
{
    for (int i = 0; i < FV_FOXGLOVE_ASKED_MAX; i++) {
        if (parameters->asked[i].id != 0 && parameters->asked[i].run_id != parameters->run_id) {
            parameters->asked[i].id = 0;
            fv_foxglove_parameters_want(parameters, parameters->asked[i].key);
        }
        if (parameters->asked[i].id != 0 && now_ns - parameters->asked[i].sent_ns > PATIENCE_NS) {
            parameters->asked[i].id = 0;
            report(parameters, parameters->asked[i].key, 0, FV_FOXGLOVE_SILENT,
                   "the run has not answered for 10 s");
        }
        if (parameters->asked[i].id == 0 && parameters->commander != NULL &&
            parameters->commander->transport != NULL && parameters->run_id != 0)
            ask(parameters, i, now_ns);
    }
}

/* Count another value than before. */
static void keep(struct fv_foxglove_parameters *parameters, uint32_t key, const char *value)
{
    if (parameters->keys[key].value != NULL && strcmp(parameters->keys[key].value, value) == 0)
        return;
    char *made = strdup(value);
    if (made == NULL) return;
    free(parameters->keys[key].value);
    parameters->keys[key].value = made;
    parameters->keys[key].version++;
}

static void take_result(struct fv_foxglove_parameters *parameters, const uint8_t *data,
                        size_t bytes)
{
    fovea_parameter_result_t result;
    if (fovea_parameter_result_t_decode(data, 0, (int)bytes, &result) < 0) return;
    const int32_t key = fv_foxglove_parameters_find(result.key);
    if (key >= 0) {
        keep(parameters, (uint32_t)key, result.value);
        for (int i = 0; i < FV_FOXGLOVE_ASKED_MAX; i++)
            if (parameters->asked[i].id == result.id && result.sender == FV_WEB_SENDER)
                parameters->asked[i].id = 0;
        report(parameters, (uint32_t)key, result.sender == FV_WEB_SENDER ? result.id : 0,
               result.result == FOVEA_PARAMETER_RESULT_T_RESULT_DONE ? FV_FOXGLOVE_DONE
               : result.result == FOVEA_PARAMETER_RESULT_T_RESULT_REFUSED
                   ? FV_FOXGLOVE_REFUSED
                   : FV_FOXGLOVE_NEEDS_RESTART,
               result.reason);
    }
    fovea_parameter_result_t_decode_cleanup(&result);
}

void fv_foxglove_parameters_begin(struct fv_foxglove_parameters *parameters)
{
    for (uint32_t key = 0; key < fv_settings_key_count; key++)
        if (parameters->keys[key].value != NULL) parameters->keys[key].wanted = true;
}

void fv_foxglove_parameters_take(struct fv_foxglove_parameters *parameters, const char *channel,
                                 const uint8_t *data, size_t bytes)
{
    const char *problem;
    size_t at;
    if (strcmp(channel, "SETTINGS_RESULT") == 0) /* all of them may have been restored */
        fv_foxglove_parameters_begin(parameters);
    if (strcmp(channel, "PARAMETER_RESULT") != 0 ||
        !fv_message_check("fovea.parameter_result_t", data, bytes, &problem, &at))
        return;
    take_result(parameters, data, bytes);
}
