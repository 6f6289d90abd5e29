/* SIGHUP under a service manager: the configuration is read again, and what can change during the
 * run does. A wrong one is refused whole, in one line, and the run goes on as it was. */
#include <stdlib.h>
#include <string.h>

#include "app/run/run.h"
#include "support/say.h"

enum fovea_status fv_run_keep_settings(struct fv_run *run, struct fovea_error *error)
{
    if (fv_service_manager() == NULL) return FOVEA_OK;
    run->as_read = malloc(sizeof *run->as_read);
    if (run->as_read == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for the configuration");
    *run->as_read = run->settings;
    return FOVEA_OK;
}

/* Keys whose new value the start must know. */
static void say_others(const struct fv_settings *before, const struct fv_settings *now)
{
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        const struct fv_settings_key *key = &fv_settings_keys[i];
        if (!key->live && memcmp((const char *)before + key->offset,
                                 (const char *)now + key->offset, fv_settings_key_bytes(key)) != 0)
            fv_say("fovea run: %s: found a new value, expected a restart for it", key->name);
    }
}

static enum fovea_status reload(struct fv_run *run, uint32_t *count, struct fovea_error *error)
{
    struct fv_settings *now = malloc(sizeof *now);
    if (now == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory for the configuration");
    enum fovea_status status = fv_setup_settings(&run->options, now, error);
    if (status == FOVEA_OK) {
        status = fv_parameters_reload(&run->parameters, now, false, count, error);
        if (status != FOVEA_OK) fv_settings_locate(now, error);
    }
    if (status == FOVEA_OK) say_others(run->as_read, now);
    free(now);
    return status;
}

void fv_run_reload(struct fv_run *run)
{
    struct fovea_error error;
    uint32_t count = 0;
    if (!atomic_exchange(&run->reload, false)) return;
    fv_service_reloading(&run->service);
    if (reload(run, &count, &error) == FOVEA_OK)
        fv_say_note("fovea run: the configuration was read again: %u parameters changed", count);
    else
        fv_say("fovea run: %s; the configuration stays as it was", error.text);
    fv_service_ready(&run->service);
}
