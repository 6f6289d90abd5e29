#include "app/config/kept_parameters.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "support/output.h"
#include "support/stall.h"

/* The file over `settings`, whose lines then say which keys it holds; nothing where there is none.
 */
static enum fovea_status read_file(struct fv_settings *settings, const char *path,
                                   struct fovea_error *error)
{
    memset(settings->line, 0, sizeof settings->line);
    if (access(path, F_OK) != 0 && errno == ENOENT) return FOVEA_OK;
    const enum fovea_status status = fv_settings_read(settings, path, error);
    for (size_t i = 0; status == FOVEA_OK && i < fv_settings_key_count; i++)
        if (settings->line[i] != 0 && !fv_settings_keys[i].live)
            return fovea_error_set(
                error, FOVEA_ERROR_INPUT,
                "%.200s:%u: %s: found a key that is no live parameter, expected live ones only",
                path, settings->line[i], fv_settings_keys[i].name);
    return status;
}

enum fovea_status fv_kept_parameters_read(struct fv_settings *settings, struct fovea_error *error)
{
    if (settings->parameters_file[0] == '\0') return FOVEA_OK;
    struct fv_settings *with = malloc(sizeof *with);
    if (with == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%.200s: no memory to read it",
                               settings->parameters_file);
    *with = *settings;
    enum fovea_status status = read_file(with, settings->parameters_file, error);
    if (status == FOVEA_OK) {
        snprintf(with->file, sizeof with->file, "%s", settings->parameters_file);
        status = fv_settings_check(with, error);
    }
    for (size_t i = 0; status == FOVEA_OK && i < fv_settings_key_count; i++) {
        if (with->line[i] == 0) continue;
        fv_settings_key_copy(&fv_settings_keys[i], settings, with);
        settings->line[i] = FV_SETTINGS_KEPT;
    }
    free(with);
    return status;
}

void fv_kept_parameters_list(struct fv_settings *kept, const char *path)
{
    struct fv_settings *with = malloc(sizeof *with);
    memset(kept->line, 0, sizeof kept->line);
    if (with == NULL) return;
    *with = *kept;
    if (path[0] != '\0' && read_file(with, path, NULL) == FOVEA_OK) *kept = *with;
    free(with);
}

enum fovea_status fv_kept_parameters_write(const struct fv_settings *settings, const char *path,
                                           struct fovea_error *error)
{
    struct fv_output output;
    const int call = fv_stall_enter(path);
    enum fovea_status status = fv_output_open(&output, path, FV_OUTPUT_WHOLE, error);
    FILE *file = status == FOVEA_OK ? fv_output_stream(&output) : NULL;
    if (file != NULL) {
        fprintf(file, "# Live parameters that were changed during a run, and kept.\n");
        for (size_t i = 0; i < fv_settings_key_count; i++) {
            if (settings->line[i] == 0) continue;
            fprintf(file, "%s: ", fv_settings_keys[i].name);
            fv_settings_value_print(file, settings, &fv_settings_keys[i]);
            fprintf(file, "\n");
        }
        status = fv_output_close(&output, error);
    } else if (status == FOVEA_OK) {
        fv_output_discard(&output);
        status = fovea_error_set(error, FOVEA_ERROR_MEMORY, "%.200s: no memory to write it", path);
    }
    fv_stall_leave(call);
    return status == FOVEA_OK ? FOVEA_OK : FOVEA_ERROR_SYSTEM;
}
