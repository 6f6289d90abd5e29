#include "app/config/kept_parameters.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "support/output.h"
#include "support/stall.h"
#include "support/text.h"

static const char mark[] = "\n---\n"; /* before the calibration */

enum fovea_status fv_kept_parameters_parse(struct fv_settings *settings, const char *name,
                                           const char *text, const char **calibration,
                                           struct fovea_error *error)
{
    const char *end = strstr(text, mark);
    *calibration = end != NULL ? end + sizeof mark - 1 : NULL;
    memset(settings->line, 0, sizeof settings->line);
    const enum fovea_status status = fv_settings_parse(
        settings, name, text, end != NULL ? (size_t)(end + 1 - text) : strlen(text), error);
    for (size_t i = 0; status == FOVEA_OK && i < fv_settings_key_count; i++)
        if (settings->line[i] != 0 && fv_settings_keys[i].host)
            return fovea_error_set(error, FOVEA_ERROR_INPUT,
                                   "%.200s:%u: %s: found a key of the host, expected it in the "
                                   "configuration alone",
                                   name, settings->line[i], fv_settings_keys[i].name);
    return status;
}

/* The text of the file, of malloc; "" where there is none. NULL: `error` says why. */
static char *file_text(const char *path, struct fovea_error *error)
{
    char *text;
    size_t bytes;
    if (access(path, F_OK) != 0 && errno == ENOENT) return calloc(1, 1);
    return fv_text_read(path, FV_KEPT_BYTES_MAX, &text, &bytes, error) == FOVEA_OK ? text : NULL;
}

/* The file over `settings`, whose lines then say which keys it holds; nothing where there is none.
 */
static enum fovea_status read_file(struct fv_settings *settings, const char *path,
                                   struct fovea_error *error)
{
    const char *calibration;
    char *text = file_text(path, error);
    if (text == NULL) return FOVEA_ERROR_INPUT;
    const enum fovea_status status =
        fv_kept_parameters_parse(settings, path, text, &calibration, error);
    free(text);
    return status;
}

enum fovea_status fv_kept_calibration_read(const struct fv_settings *settings,
                                           struct fv_calibration *calibration, bool *found,
                                           struct fovea_error *error)
{
    char name[FV_SETTINGS_PATH_BYTES + 16];
    const struct fv_settings_key *camera = fv_settings_key_find("camera");
    *found = false;
    if (settings->parameters_file[0] == '\0' || settings->camera[0] == '\0' ||
        settings->line[camera - fv_settings_keys] == FV_SETTINGS_SET)
        return FOVEA_OK;
    char *text = file_text(settings->parameters_file, error);
    if (text == NULL) return FOVEA_ERROR_INPUT;
    const char *begin = strstr(text, mark);
    enum fovea_status status = FOVEA_OK;
    *found = begin != NULL;
    snprintf(name, sizeof name, "%s: calibration", settings->parameters_file);
    if (begin != NULL)
        status = fv_calibration_parse(name, begin + sizeof mark - 1,
                                      strlen(begin + sizeof mark - 1), NULL, calibration, error);
    free(text);
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

char *fv_kept_parameters_list(struct fv_settings *kept, const char *path)
{
    const char *calibration = NULL;
    struct fv_settings *with = malloc(sizeof *with);
    char *text = path[0] != '\0' ? file_text(path, NULL) : NULL;
    memset(kept->line, 0, sizeof kept->line);
    if (with != NULL && text != NULL) {
        *with = *kept;
        if (fv_kept_parameters_parse(with, path, text, &calibration, NULL) == FOVEA_OK)
            *kept = *with;
        else
            calibration = NULL;
    }
    char *copy = strdup(calibration != NULL ? calibration : "");
    free(with);
    free(text);
    return copy;
}

/* The whole file, of malloc; NULL: no memory. */
static char *format(const struct fv_settings *settings, const char *calibration, size_t *bytes)
{
    char *text = NULL;
    FILE *file = open_memstream(&text, bytes);
    if (file == NULL) return NULL;
    fprintf(file, "# Settings that were changed during a run and kept, or restored.\n");
    for (size_t i = 0; i < fv_settings_key_count; i++) {
        if (settings->line[i] == 0) continue;
        fprintf(file, "%s: ", fv_settings_keys[i].name);
        fv_settings_value_print(file, settings, &fv_settings_keys[i]);
        fprintf(file, "\n");
    }
    if (calibration[0] != '\0') fprintf(file, "---\n%s", calibration);
    if (fclose(file) == 0) return text;
    free(text);
    return NULL;
}

static enum fovea_status write_text(const char *path, const char *text, size_t bytes,
                                    struct fovea_error *error)
{
    struct fv_output output;
    const int call = fv_stall_enter(path);
    enum fovea_status status = fv_output_open(&output, path, FV_OUTPUT_WHOLE, error);
    FILE *file = status == FOVEA_OK ? fv_output_stream(&output) : NULL;
    if (file != NULL) {
        fwrite(text, 1, bytes, file);
        status = fv_output_close(&output, error);
    } else if (status == FOVEA_OK) {
        fv_output_discard(&output);
        status = fovea_error_set(error, FOVEA_ERROR_MEMORY, "%.200s: no memory to write it", path);
    }
    fv_stall_leave(call);
    return status == FOVEA_OK ? FOVEA_OK : FOVEA_ERROR_SYSTEM;
}

enum fovea_status fv_kept_parameters_write(const struct fv_settings *settings,
                                           const char *calibration, const char *path,
                                           struct fovea_error *error)
{
    size_t bytes = 0;
    char *text = format(settings, calibration, &bytes);
    enum fovea_status status = FOVEA_OK;
    if (text == NULL) {
        fovea_error_set(error, FOVEA_ERROR_MEMORY, "%.200s: no memory to write it", path);
        status = FOVEA_ERROR_SYSTEM;
    } else if (bytes > FV_KEPT_BYTES_MAX) {
        status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                 "%.200s: found %zu bytes to keep, expected at most %d", path,
                                 bytes, FV_KEPT_BYTES_MAX);
    } else {
        status = write_text(path, text, bytes, error);
    }
    free(text);
    return status;
}
