#include "app/config/setup.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/config/man.h"
#include "app/config/map_file.h"
#include "app/config/classes.h"
#include "app/config/mask.h"
#include "map/archive.h"
#include "support/calibration.h"

/* A key that has an option of its own, which errors name: "--set: map.save: found" would name one
 * that nobody gave. */
static enum fovea_status set(struct fv_settings *settings, const char *key, const char *option,
                             const char *value, struct fovea_error *error)
{
    char assignment[FV_SETTINGS_PATH_BYTES + 64], given[64], text[FOVEA_ERROR_TEXT_BYTES];
    if (value == NULL) return FOVEA_OK;
    if (strlen(value) >= FV_SETTINGS_PATH_BYTES)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "--%s: found %zu bytes, expected at most %d", option, strlen(value),
                               FV_SETTINGS_PATH_BYTES - 1);
    snprintf(assignment, sizeof assignment, "%s=%s", key, value);
    const enum fovea_status status = fv_settings_set(settings, assignment, error);
    const int length = snprintf(given, sizeof given, "--set: %s:", key);
    if (status == FOVEA_OK || error == NULL || strncmp(error->text, given, (size_t)length) != 0)
        return status;
    memcpy(text, error->text, sizeof text);
    return fovea_error_set(error, status, "--%s:%s", option, text + length);
}

/* "DIR  EuRoC data set": the address, and what it is. */
static void source_man(const struct fovea_source_ops *ops)
{
    char term[32], address[256];
    const char *gap = strstr(ops->help, "  ");
    snprintf(term, sizeof term, "%s:", ops->name);
    snprintf(address, sizeof address, "%.*s", gap != NULL ? (int)(gap - ops->help) : 0, ops->help);
    fv_man_item(term, address, gap != NULL ? gap + 2 : ops->help);
}

void fv_setup_sources_print(void)
{
    const bool man = fv_options_man_printed();
    if (man)
        fv_man_section("SOURCES");
    else
        printf("\nsources:\n");
    for (const struct fovea_source_ops *const *ops = fovea_source_table; *ops != NULL; ops++) {
        if (man)
            source_man(*ops);
        else
            printf("  %s:%s\n", (*ops)->name, (*ops)->help);
    }
}

enum fovea_status fv_setup_settings(const struct fv_setup_options *options,
                                    struct fv_settings *settings, struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    fv_settings_default(settings);
    if (options->config != NULL && options->config[0] == '\0')
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "--config: found '', expected a file");
    if (options->config != NULL) status = fv_settings_read(settings, options->config, error);
    for (int i = 0; i < options->sets.count && status == FOVEA_OK; i++)
        status = fv_settings_set(settings, options->sets.values[i], error);
    if (status == FOVEA_OK) status = set(settings, "source", "source", options->source, error);
    if (status == FOVEA_OK) status = set(settings, "camera", "camera", options->camera, error);
    if (status == FOVEA_OK) status = set(settings, "rate", "rate", options->rate, error);
    if (status == FOVEA_OK) status = set(settings, "record", "record", options->record, error);
    if (status == FOVEA_OK) status = set(settings, "map.load", "map", options->map, error);
    if (status == FOVEA_OK)
        status = set(settings, "map.save", "save-map", options->save_map, error);
    if (status == FOVEA_OK) status = set(settings, "detect.model", "model", options->model, error);
    return status == FOVEA_OK ? fv_settings_check(settings, error) : status;
}

/* The file is looked at before the source is opened: what is quickly wrong is quickly said. */
static enum fovea_status camera_read(struct fv_settings *settings, struct fovea_error *error)
{
    struct fovea_calibration calibration;
    if (settings->camera[0] == '\0') return FOVEA_OK;
    enum fovea_status status = fovea_calibration_read(settings->camera, NULL, &calibration, error);
    if (status == FOVEA_OK) settings->runtime.camera = calibration.camera;
    if (status != FOVEA_OK) fv_settings_blame(settings, "camera", error);
    return status;
}

static enum fovea_status model2_read(struct fv_settings *settings, struct fv_setup *setup,
                                     struct fovea_error *error)
{
    const enum fovea_status status = fv_model_file_read(settings->model2, &setup->model2, error);
    settings->runtime.detect2.model = setup->model2.data;
    settings->runtime.detect2.model_bytes = setup->model2.bytes;
    if (status != FOVEA_OK) fv_settings_blame(settings, "detect2.model", error);
    return status;
}

static enum fovea_status model_read(struct fv_settings *settings, struct fv_setup *setup,
                                    struct fovea_error *error)
{
    if (settings->model[0] == '\0') return FOVEA_OK; /* there is no second one without it */
    enum fovea_status status = fv_model_file_read(settings->model, &setup->model, error);
    settings->runtime.detect.model = setup->model.data;
    settings->runtime.detect.model_bytes = setup->model.bytes;
    if (status != FOVEA_OK) fv_settings_blame(settings, "detect.model", error);
    if (status == FOVEA_OK &&
        (status = fv_classes_resolve(settings, &setup->model.model, error)) != FOVEA_OK)
        fv_settings_locate(settings, error);
    if (status != FOVEA_OK || settings->model2[0] == '\0') return status;
    return model2_read(settings, setup, error);
}

static bool takes_colour(const struct fv_model_file *file)
{
    return file->data != NULL && file->model.header->preprocess.channels == 3;
}

bool fv_setup_wants_colour(const struct fv_setup *setup)
{
    return takes_colour(&setup->model) || takes_colour(&setup->model2);
}

static enum fovea_status camera_fit(struct fv_settings *settings,
                                    const struct fovea_source_info *info, struct fovea_error *error)
{
    struct fovea_camera *camera = &settings->runtime.camera;
    const char *origin = settings->camera[0] != '\0' ? settings->camera : info->camera_origin;
    if (settings->camera[0] == '\0') {
        if (!info->rig.cameras[0].calibrated)
            return fovea_error_set(
                error, FOVEA_ERROR_INPUT,
                "%.200s: camera: found no calibration with this source, expected --camera FILE",
                settings->source);
        *camera = info->rig.cameras[0].camera;
    }
    return fovea_calibration_fit(camera, info->width, info->height, settings->camera_scale, origin,
                                 error);
}

static enum fovea_status map_read(struct fv_settings *settings, struct fv_setup *setup,
                                  struct fovea_error *error)
{
    struct fovea_config *config = &settings->runtime;
    enum fovea_status status = FOVEA_OK;
    if (settings->map_load[0] != '\0')
        status = fv_map_file_read(settings->map_load, &setup->map, &config->map_bytes, error);
    else if (config->odometry.localise_only) {
        fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "map.localise_only: found true without a map, expected map.load to name one");
        fv_settings_locate(settings, error);
        return FOVEA_ERROR_INPUT;
    }
    if (status != FOVEA_OK) fv_settings_blame(settings, "map.load", error);
    config->map = setup->map;
    config->map_name = settings->map_load;
    return status;
}

enum fovea_status fv_setup_read(struct fv_settings *settings, struct fv_setup *setup,
                                struct fovea_error *error)
{
    const struct fovea_camera *camera = &settings->runtime.camera;
    enum fovea_status status = FOVEA_OK;
    if (settings->mask[0] != '\0') {
        status = fv_mask_read(settings->mask, camera->width, camera->height, &setup->mask, error);
        settings->runtime.mask = setup->mask;
        if (status != FOVEA_OK) fv_settings_blame(settings, "mask", error);
    }
    if (status == FOVEA_OK) status = map_read(settings, setup, error);
    return status == FOVEA_OK ? fv_settings_check(settings, error) : status;
}

enum fovea_status fv_setup_open(struct fv_settings *settings,
                                const struct fovea_source_selection *selection,
                                struct fv_setup *setup, struct fovea_error *error)
{
    const char *address;
    *setup = (struct fv_setup){0};
    enum fovea_status status = camera_read(settings, error);
    if (status == FOVEA_OK) status = model_read(settings, setup, error);
    if (status != FOVEA_OK) return status;
    status = fovea_source_find(settings->source, &setup->ops, &address, error);
    struct fovea_source_selection chosen = *selection;
    chosen.colour = fv_setup_wants_colour(setup);
    chosen.camera_given = settings->camera[0] != '\0';
    if (status == FOVEA_OK) status = setup->ops->open(address, &chosen, &setup->source, error);
    if (status != FOVEA_OK) {
        fv_settings_blame(settings, "source", error);
        return status;
    }
    status = camera_fit(settings, setup->ops->info(setup->source), error);
    return status == FOVEA_OK ? fv_setup_read(settings, setup, error) : status;
}

/* Cameras are for `fovea check`: opening one would take it from who uses it. */
static bool is_camera(const struct fovea_source_ops *ops)
{
    return strcmp(ops->name, "v4l2") == 0 || strcmp(ops->name, "libcamera") == 0;
}

enum fovea_status fv_setup_check_files(struct fv_settings *settings, struct fovea_error *error)
{
    const struct fovea_source_selection all = {.step = 1};
    struct fv_setup setup = {0};
    struct fv_archive_info info;
    const char *address;
    enum fovea_status status = fovea_source_find(settings->source, &setup.ops, &address, error);
    if (status != FOVEA_OK) {
        fv_settings_blame(settings, "source", error);
        return status;
    }
    if (!is_camera(setup.ops)) {
        status = fv_setup_open(settings, &all, &setup, error);
    } else {
        status = camera_read(settings, error);
        if (status == FOVEA_OK) status = model_read(settings, &setup, error);
        if (status == FOVEA_OK && settings->runtime.camera.width > 0)
            status = fv_setup_read(settings, &setup, error);
    }
    if (status == FOVEA_OK && setup.map != NULL) {
        status = fv_archive_info(setup.map, settings->runtime.map_bytes, settings->map_load, &info,
                                 error);
        if (status != FOVEA_OK) fv_settings_blame(settings, "map.load", error);
    }
    fv_setup_close(&setup);
    return status;
}

void fv_setup_close_source(struct fv_setup *setup)
{
    if (setup->source != NULL) setup->ops->close(setup->source);
    setup->source = NULL;
}

void fv_setup_close(struct fv_setup *setup)
{
    fv_setup_close_source(setup);
    free(setup->mask);
    free(setup->map);
    fv_model_file_free(&setup->model);
    fv_model_file_free(&setup->model2);
    *setup = (struct fv_setup){0};
}

bool fv_setup_real_time(const struct fv_settings *settings, const struct fv_setup *setup)
{
    return settings->rate == FV_RATE_REAL ||
           (settings->rate == FV_RATE_AUTO && setup->ops->info(setup->source)->live);
}

size_t fv_setup_frame_bytes(const struct fv_setup *setup)
{
    const struct fovea_source_info *info = setup->ops->info(setup->source);
    return info->rig.camera_count *
           fovea_image_bytes(info->format, info->height,
                             fovea_image_stride_min(info->format, info->width));
}

enum fv_exit fv_setup_exit(enum fovea_status status)
{
    return status == FOVEA_ERROR_SYSTEM || status == FOVEA_ERROR_MEMORY ? FV_EXIT_FAILED
                                                                        : FV_EXIT_WRONG;
}
