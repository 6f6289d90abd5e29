#include "app/config/camera_controls.h"

#include <string.h>

#include "drivers/table.h"
#include "support/say.h"

static const struct {
    const char *key;
    size_t offset; /* of the member, a double, in struct fv_settings */
} controls[FOVEA_SOURCE_CONTROL_COUNT] = {
    [FOVEA_SOURCE_EXPOSURE] = {"camera_exposure_ms",
                               offsetof(struct fv_settings, runtime.camera_exposure_ms)},
    [FOVEA_SOURCE_GAIN] = {"camera_gain", offsetof(struct fv_settings, runtime.camera_gain)},
};

bool fv_camera_control(const struct fv_settings_key *key, enum fovea_source_control *control)
{
    for (int i = 0; i < FOVEA_SOURCE_CONTROL_COUNT; i++) {
        if (key->offset != controls[i].offset) continue;
        *control = (enum fovea_source_control)i;
        return true;
    }
    return false;
}

double fv_camera_control_value(const struct fv_settings *settings,
                               enum fovea_source_control control)
{
    double value;
    memcpy(&value, (const char *)settings + controls[control].offset, sizeof value);
    return value;
}

static bool is_kept(const struct fv_settings *settings, const char *name)
{
    const struct fv_settings_key *key = fv_settings_key_find(name);
    return key != NULL && settings->line[key - fv_settings_keys] == FV_SETTINGS_KEPT;
}

enum fovea_status fv_camera_controls_set(const struct fv_settings *settings,
                                         const struct fovea_source_ops *ops,
                                         struct fovea_source *source, struct fovea_error *error)
{
    for (int i = 0; i < FOVEA_SOURCE_CONTROL_COUNT; i++) {
        const enum fovea_source_control control = (enum fovea_source_control)i;
        const double value = fv_camera_control_value(settings, control);
        struct fovea_error said = {.text = ""};
        if (control == FOVEA_SOURCE_EXPOSURE ? !(value > 0) : value < 0) continue;
        const enum fovea_status status = fv_source_control(ops, source, control, value, &said);
        const bool left_out =
            status != FOVEA_OK && (ops->control == NULL || is_kept(settings, controls[i].key));
        if (status != FOVEA_OK && !left_out) {
            *error = said;
            fv_settings_blame(settings, controls[i].key, error);
            return FOVEA_ERROR_INPUT;
        }
        if (said.text[0] != '\0')
            fv_say("fovea: %s: %.400s%s", controls[i].key, said.text,
                   left_out ? "; it is left out" : "");
    }
    return FOVEA_OK;
}
