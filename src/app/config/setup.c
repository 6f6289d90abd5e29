#include "drivers/table.h"
#include "app/config/setup.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "support/man.h"
#include "app/config/camera_controls.h"
#include "app/config/kept_parameters.h"
#include "support/say.h"
#include "app/config/map_file.h"
#include "app/config/classes.h"
#include "app/config/mask.h"
#include "base/elementary.h"
#include "geometry/se3.h"
#include "image/preprocess.h"
#include "map/archive.h"
#include "support/calibration.h"
#include "support/stall.h"

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
    for (const struct fovea_source_ops *const *ops = fv_source_table; *ops != NULL; ops++) {
        if (man)
            source_man(*ops);
        else
            printf("  %s:%s\n", (*ops)->name, (*ops)->help);
    }
}

static enum fovea_status take_sets(const struct fv_setup_options *options,
                                   struct fv_settings *settings, struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    for (int i = 0; i < options->sets.count && status == FOVEA_OK; i++)
        status = fv_settings_set(settings, options->sets.values[i], error);
    return status;
}

enum fovea_status fv_setup_settings(const struct fv_setup_options *options,
                                    struct fv_settings *settings, struct fovea_error *error)
{
    enum fovea_status status = FOVEA_OK;
    fv_settings_default(settings);
    if (options->config != NULL && options->config[0] == '\0')
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "--config: found '', expected a file");
    if (options->config != NULL) status = fv_settings_read(settings, options->config, error);
    if (status == FOVEA_OK) status = take_sets(options, settings, error);
    if (status == FOVEA_OK && settings->parameters_file[0] != '\0') {
        /* The program's own file: a robot starts without it rather than not at all. */
        struct fovea_error why;
        if (fv_kept_parameters_read(settings, &why) == FOVEA_OK)
            status = take_sets(options, settings, error); /* they win */
        else
            fv_say("%s; the kept parameters are left out", why.text);
    }
    if (status == FOVEA_OK) status = set(settings, "source", "source", options->source, error);
    if (status == FOVEA_OK) status = set(settings, "camera", "camera", options->camera, error);
    if (status == FOVEA_OK) status = set(settings, "camera_fov", "fov", options->fov, error);
    if (status == FOVEA_OK) status = set(settings, "rate", "rate", options->rate, error);
    if (status == FOVEA_OK) status = set(settings, "record", "record", options->record, error);
    if (status == FOVEA_OK) status = set(settings, "map.load", "map", options->map, error);
    if (status == FOVEA_OK)
        status = set(settings, "map.save", "save-map", options->save_map, error);
    if (status == FOVEA_OK) status = set(settings, "detect.model", "model", options->model, error);
    return status == FOVEA_OK ? fv_settings_check(settings, error) : status;
}

/* A file that the user changed shall not be passed over in silence. */
static void say_kept(const struct fv_settings *settings)
{
    struct stat own, kept;
    const bool newer = stat(settings->camera, &own) == 0 &&
                       stat(settings->parameters_file, &kept) == 0 && own.st_mtime > kept.st_mtime;
    fv_say("camera: the calibration kept in %.200s stands for %.200s%s", settings->parameters_file,
           settings->camera,
           newer ? ", which was changed later; without the lines after --- in the former it holds"
                 : "");
}

/* The file is looked at before the source is opened: what is quickly wrong is quickly said. */
static enum fovea_status camera_read(struct fv_settings *settings, struct fovea_error *error)
{
    struct fv_calibration calibration;
    if (settings->camera[0] == '\0') return FOVEA_OK;
    bool kept = false;
    if (fv_kept_calibration_read(settings, &calibration, &kept, error) != FOVEA_OK) {
        fv_say("%s; the kept calibration is left out", error->text);
        kept = false;
    }
    if (kept) say_kept(settings);
    enum fovea_status status =
        kept ? FOVEA_OK : fv_calibration_read(settings->camera, NULL, &calibration, error);
    if (status == FOVEA_OK) settings->runtime.rig.cameras[0].camera = calibration.camera;
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

static enum fovea_status no_model(const struct fv_settings *settings, struct fovea_error *error)
{
    if (!settings->runtime.grid_job.enabled) return FOVEA_OK;
    fovea_error_set(error, FOVEA_ERROR_INPUT,
                    "grid.enabled: found no detect.model, expected a network that labels pixels");
    fv_settings_locate(settings, error);
    return FOVEA_ERROR_INPUT;
}

static enum fovea_status model_read(struct fv_settings *settings, struct fv_setup *setup,
                                    struct fovea_error *error)
{
    if (settings->model[0] == '\0') return no_model(settings, error);
    enum fovea_status status = fv_model_file_read(settings->model, &setup->model, error);
    settings->runtime.detect.model = setup->model.data;
    settings->runtime.detect.model_bytes = setup->model.bytes;
    if (status != FOVEA_OK) fv_settings_blame(settings, "detect.model", error);
    if (status == FOVEA_OK &&
        (status = fv_classes_resolve(settings, &setup->model.model, error)) != FOVEA_OK)
        fv_settings_locate(settings, error);
    const bool second = settings->model2[0] != '\0'; /* there is none without the first */
    if (status == FOVEA_OK && second) status = model2_read(settings, setup, error);
    if (status == FOVEA_OK &&
        (status = fv_classes_resolve_grid(settings, &setup->model.model,
                                          second ? &setup->model2.model : NULL, error)) != FOVEA_OK)
        fv_settings_locate(settings, error);
    return status;
}

static bool takes_colour(const struct fv_model_file *file)
{
    return file->data != NULL && file->model.header->preprocess.channels == 3;
}

bool fv_setup_wants_colour(const struct fv_setup *setup)
{
    return takes_colour(&setup->model) || takes_colour(&setup->model2);
}

static bool is_grey(enum fovea_pixel_format format)
{
    return format == FOVEA_PIXEL_GREY8 || format == FOVEA_PIXEL_Y10 || format == FOVEA_PIXEL_Y12 ||
           format == FOVEA_PIXEL_Y14 || format == FOVEA_PIXEL_Y16;
}

enum fovea_status fv_setup_check_balance(const struct fv_setup *setup,
                                         const struct fovea_source_info *info, const char *source,
                                         struct fovea_error *error)
{
    if (!fv_setup_wants_colour(setup))
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "image.operations: found white_balance, expected a network of "
                               "colours (detect.model): nobody else looks at colours");
    if (is_grey(info->format))
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "image.operations: found white_balance, expected a source with "
                               "colours: %.100s gives grey images",
                               source);
    return FOVEA_OK;
}

static enum fovea_status check_balance(const struct fv_settings *settings,
                                       const struct fv_setup *setup,
                                       const struct fovea_source_info *info,
                                       struct fovea_error *error)
{
    if (!fv_preprocess_balances(&settings->runtime.image.preprocess)) return FOVEA_OK;
    const enum fovea_status status = fv_setup_check_balance(setup, info, settings->source, error);
    if (status != FOVEA_OK) fv_settings_locate(settings, error);
    return status;
}

/* Whether the configuration asks for what needs the camera's calibration: poses, or positions of
 * objects. Detection, tracking in the image and previews need none. */
static bool measures(const struct fv_settings *settings)
{
    return settings->runtime.odometry.enabled || settings->runtime.objects.ground ||
           settings->heights[0] != '\0';
}

/* A camera without distortion that sees `fov_deg` across. */
static struct fovea_camera rough_camera(int32_t width, int32_t height, double fov_deg)
{
    const double half = fov_deg * 0.008726646259971648; /* radians */
    const double focal_px = 0.5 * width * fv_cos(half) / fv_sin(half);
    return (struct fovea_camera){.width = width,
                                 .height = height,
                                 .fx = focal_px,
                                 .fy = focal_px,
                                 .cx = 0.5 * (width - 1),
                                 .cy = 0.5 * (height - 1)};
}

/* `rough`: where a calibration is lacking, a camera of 60 degrees stands in for it. */
static enum fovea_status camera_fit(struct fv_settings *settings,
                                    const struct fovea_source_info *info, bool rough,
                                    struct fovea_error *error)
{
    enum { FOV_WHERE_NONE_IS_STATED_DEG = 60 };
    struct fovea_camera *camera = &settings->runtime.rig.cameras[0].camera;
    const bool given = settings->camera[0] != '\0', own = info->rig.cameras[0].calibrated;
    const char *origin = given ? settings->camera : info->cameras[0].origin;
    const double fov_deg = settings->runtime.camera_fov_deg;
    if (fov_deg > 0 && (given || own))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "camera_fov: found %g, expected 0 beside the calibration %s",
                               fov_deg, origin);
    if (!given && !own && (fov_deg > 0 || rough || !measures(settings))) {
        *camera = rough_camera(info->cameras[0].width, info->cameras[0].height,
                               fov_deg > 0 ? fov_deg : FOV_WHERE_NONE_IS_STATED_DEG);
        return fovea_camera_prepare(camera, error);
    }
    if (!given && !own)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%.200s: camera: found no calibration with this source, expected --camera FILE "
            "('fovea-calibrate camera --source %.100s --target chessboard:9x6:0.025 --out "
            "camera.yaml' makes one), --fov DEGREES for rough poses, or --set "
            "odometry.enabled=false",
            settings->source, settings->source);
    if (!given) *camera = info->rig.cameras[0].camera;
    return fv_calibration_fit(camera, info->cameras[0].width, info->cameras[0].height,
                              settings->camera_scale, origin, error);
}

/* `T_source` takes points of a sensor to the source's body, where `T_body_source` begins. */
static void place(const struct fv_se3 *T_body_source, const double T_source[12], double T_body[12])
{
    struct fv_se3 T;
    fv_se3_from_rows(T_source, &T);
    fv_se3_compose(T_body_source, &T, &T);
    fv_se3_to_rows(&T, T_body);
}

/* What the source has beside its first camera, whose place on the body the settings state: the rest
 * of the rig comes along, so that it has the body of the settings too. */
static enum fovea_status rig_join(struct fv_settings *settings,
                                  const struct fovea_source_info *info, struct fovea_error *error)
{
    const struct fovea_rig *from = &info->rig;
    struct fovea_rig *rig = &settings->runtime.rig;
    struct fv_se3 T_body_source, T_source_cam;
    const bool placed = from->cameras[0].has_T_body_cam;
    if (from->has_imu && !placed)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%.200s: found an inertial sensor, but no pose of the first camera on the body, expected both",
            settings->source);
    rig->camera_count = from->camera_count;
    rig->cameras[0].has_readout = from->cameras[0].has_readout;
    rig->cameras[0].readout_ns = from->cameras[0].readout_ns;
    rig->has_imu = from->has_imu;
    fv_se3_from_rows(rig->cameras[0].T_body_cam, &T_body_source);
    if (placed) {
        fv_se3_from_rows(from->cameras[0].T_body_cam, &T_source_cam);
        fv_se3_invert(&T_source_cam, &T_source_cam);
        fv_se3_compose(&T_body_source, &T_source_cam, &T_body_source);
    }
    for (uint32_t i = 1; i < from->camera_count; i++) {
        struct fovea_rig_camera *camera = &rig->cameras[i];
        *camera = from->cameras[i];
        camera->has_T_body_cam = camera->has_T_body_cam && placed;
        if (camera->has_T_body_cam)
            place(&T_body_source, from->cameras[i].T_body_cam, camera->T_body_cam);
    }
    rig->imu = from->imu;
    if (from->has_imu) place(&T_body_source, from->imu.T_body_imu, rig->imu.T_body_imu);
    return FOVEA_OK;
}

/* Cameras of a rig that its source has no calibration of, as two live ones: from the file of the
 * key `camera`, where that is a camchain (cam0, cam1 ...). One that it lacks stays without; one
 * that is malformed is refused. */
static enum fovea_status cameras_read(struct fv_settings *settings, struct fovea_source_info *info,
                                      struct fovea_error *error)
{
    struct fv_calibration first, other;
    struct fovea_rig *rig = &info->rig;
    bool found = false;
    if (settings->camera[0] == '\0' || rig->camera_count < 2 || rig->cameras[1].calibrated)
        return FOVEA_OK;
    enum fovea_status status =
        fv_calibration_read_if_there(settings->camera, "cam0", &first, &found, error);
    if (status == FOVEA_OK && !found) return FOVEA_OK;
    for (uint32_t i = 1; i < rig->camera_count && status == FOVEA_OK; i++) {
        struct fovea_rig_camera *camera = &rig->cameras[i];
        char which[16];
        snprintf(which, sizeof which, "cam%u", i);
        status = fv_calibration_read_if_there(settings->camera, which, &other, &found, error);
        if (!found) continue;
        camera->camera = other.camera;
        camera->calibrated = true;
        camera->has_T_body_cam = other.has_T_body_cam;
        memcpy(camera->T_body_cam, other.T_body_cam, sizeof camera->T_body_cam);
        snprintf(info->cameras[i].origin, sizeof info->cameras[i].origin, "%.255s",
                 settings->camera);
    }
    if (status != FOVEA_OK) {
        fv_settings_blame(settings, "camera", error);
        return status;
    }
    /* Where the file states no body, it is the first camera. */
    static const double identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    rig->cameras[0].has_T_body_cam = true;
    memcpy(rig->cameras[0].T_body_cam, first.has_T_body_cam ? first.T_body_cam : identity,
           sizeof identity);
    return FOVEA_OK;
}

static enum fovea_status rig_fit(struct fv_settings *settings, const struct fovea_source_info *seen,
                                 bool rough, struct fovea_error *error)
{
    struct fovea_rig *rig = &settings->runtime.rig;
    struct fovea_source_info known = *seen, *info = &known;
    enum fovea_status status = camera_fit(settings, info, rough, error);
    if (status == FOVEA_OK) status = cameras_read(settings, info, error);
    if (status == FOVEA_OK) status = rig_join(settings, info, error);
    for (uint32_t i = 1; i < rig->camera_count && status == FOVEA_OK; i++) {
        struct fovea_rig_camera *camera = &rig->cameras[i];
        const struct fovea_source_camera *one = &info->cameras[i];
        if (camera->calibrated)
            status = fv_calibration_fit(&camera->camera, one->width, one->height,
                                        settings->camera_scale, one->origin, error);
        else
            camera->camera = (struct fovea_camera){.width = one->width, .height = one->height};
    }
    return status;
}

static enum fovea_status masks_read(struct fv_settings *settings, struct fv_setup *setup,
                                    struct fovea_error *error)
{
    static const char *const keys[FOVEA_CAMERAS_MAX] = {"mask", "mask2", "mask3", "mask4"};
    struct fovea_rig *rig = &settings->runtime.rig;
    enum fovea_status status = FOVEA_OK;
    for (uint32_t i = 0; i < FOVEA_CAMERAS_MAX && status == FOVEA_OK; i++) {
        const struct fovea_camera *camera = &rig->cameras[i].camera;
        if (settings->masks[i][0] == '\0') continue;
        if (i < rig->camera_count)
            status = fv_mask_read(settings->masks[i], camera->width, camera->height,
                                  &setup->masks[i], error);
        else
            status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                     "%s: found '%.200s', expected none: the source has %u %s",
                                     keys[i], settings->masks[i], rig->camera_count,
                                     rig->camera_count == 1 ? "camera" : "cameras");
        rig->cameras[i].mask = setup->masks[i];
        if (status != FOVEA_OK) fv_settings_blame(settings, keys[i], error);
    }
    return status;
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
    enum fovea_status status = masks_read(settings, setup, error);
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
    status = fv_source_find(settings->source, &setup->ops, &address, error);
    struct fovea_source_selection chosen = *selection;
    chosen.colour = fv_setup_wants_colour(setup);
    chosen.camera_given = settings->camera[0] != '\0';
    chosen.by_clock = settings->rate == FV_RATE_REAL;
    if (status == FOVEA_OK) status = setup->ops->open(address, &chosen, &setup->source, error);
    if (status != FOVEA_OK) {
        fv_settings_blame(settings, "source", error);
        return status;
    }
    const struct fovea_source_info *info = setup->ops->info(setup->source);
    status = check_balance(settings, setup, info, error);
    if (status == FOVEA_OK)
        status = fv_camera_controls_set(settings, setup->ops, setup->source, error);
    if (status == FOVEA_OK) status = rig_fit(settings, info, false, error);
    if (status == FOVEA_OK) status = fv_imu_join(settings, info, &setup->iio, error);
    return status == FOVEA_OK ? fv_setup_read(settings, setup, error) : status;
}

bool fv_setup_lacks_calibration(const struct fv_settings *settings, const struct fv_setup *setup)
{
    return setup->source != NULL && settings->camera[0] == '\0' &&
           settings->runtime.camera_fov_deg == 0 &&
           !setup->ops->info(setup->source)->rig.cameras[0].calibrated && measures(settings);
}

enum fovea_status fv_setup_open_rough(struct fv_settings *settings, struct fv_setup *setup,
                                      struct fovea_error *error)
{
    const struct fovea_source_info *info = setup->ops->info(setup->source);
    enum fovea_status status = rig_fit(settings, info, true, error);
    if (status == FOVEA_OK) status = fv_imu_join(settings, info, &setup->iio, error);
    return status == FOVEA_OK ? fv_setup_read(settings, setup, error) : status;
}

enum fovea_status fv_setup_check_files(struct fv_settings *settings, struct fovea_error *error)
{
    const struct fovea_source_selection all = {.step = 1};
    struct fv_setup setup = {0};
    struct fv_archive_info info;
    const char *address;
    enum fovea_status status = fv_source_find(settings->source, &setup.ops, &address, error);
    if (status != FOVEA_OK) {
        fv_settings_blame(settings, "source", error);
        return status;
    }
    /* Cameras are for `fovea check`: opening one would take it from who uses it. */
    if (!fv_source_takes_device(settings->source)) {
        char imu[sizeof settings->imu]; /* no more is a device of IIO */
        memcpy(imu, settings->imu, sizeof imu);
        if (fv_imu_iio_name(settings) != NULL) settings->imu[0] = '\0';
        status = fv_setup_open(settings, &all, &setup, error);
        memcpy(settings->imu, imu, sizeof imu);
    } else {
        status = camera_read(settings, error);
        if (status == FOVEA_OK) status = model_read(settings, &setup, error);
        if (status == FOVEA_OK && settings->runtime.rig.cameras[0].camera.width > 0)
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

static enum fovea_status check_next(struct fv_settings *next, const struct fovea_source_info *info,
                                    const struct fovea_camera *kept, struct fv_setup *setup,
                                    struct fovea_error *error)
{
    const struct fovea_rig now = next->runtime.rig;
    struct fv_calibration calibration;
    size_t block_bytes;
    enum fovea_status status = FOVEA_OK;
    if (kept != NULL) {
        next->runtime.rig.cameras[0].camera = *kept;
    } else if (next->camera[0] != '\0') {
        status = fv_calibration_read(next->camera, NULL, &calibration, error);
        if (status == FOVEA_OK) next->runtime.rig.cameras[0].camera = calibration.camera;
    }
    if (status == FOVEA_OK) status = model_read(next, setup, error);
    if (status == FOVEA_OK) status = check_balance(next, setup, info, error);
    if (status == FOVEA_OK) status = rig_fit(next, info, false, error);
    if (status == FOVEA_OK && next->imu[0] != '\0') {
        next->runtime.rig.has_imu = now.has_imu;
        next->runtime.rig.imu = now.imu;
    }
    if (status == FOVEA_OK) status = fv_setup_read(next, setup, error);
    return status == FOVEA_OK ? fovea_size(&next->runtime, &block_bytes, error) : status;
}

enum fovea_status fv_setup_check_next(const struct fv_settings *next,
                                      const struct fovea_source_info *info,
                                      const struct fovea_camera *kept, struct fovea_error *error)
{
    struct fv_setup setup = {0};
    struct fv_settings *with = malloc(sizeof *with);
    if (with == NULL) return fovea_error_set(error, FOVEA_ERROR_MEMORY, "no memory");
    *with = *next;
    for (int i = 0; i < FOVEA_CAMERAS_MAX; i++)
        with->runtime.rig.cameras[i].mask = NULL;
    with->runtime.map = NULL;
    with->runtime.map_bytes = 0;
    with->runtime.detect.model = with->runtime.detect2.model = NULL;
    with->runtime.detect.model_bytes = with->runtime.detect2.model_bytes = 0;
    for (size_t i = 0; i < fv_settings_key_count; i++)
        if (with->line[i] != 0) with->line[i] = FV_SETTINGS_KEPT;
    const int call = fv_stall_enter("files that restored settings name");
    const enum fovea_status status = check_next(with, info, kept, &setup, error);
    fv_stall_leave(call);
    fv_setup_close(&setup);
    free(with);
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
    fv_iio_close(setup->iio);
    for (int i = 0; i < FOVEA_CAMERAS_MAX; i++)
        free(setup->masks[i]);
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
    size_t bytes = 0;
    for (uint32_t i = 0; i < info->rig.camera_count; i++) {
        const struct fovea_source_camera *camera = &info->cameras[i];
        const int32_t least = fovea_image_stride_min(info->format, camera->width);
        bytes += fovea_image_bytes(info->format, camera->height,
                                   camera->stride_bytes > least ? camera->stride_bytes : least);
    }
    return bytes;
}

enum fv_exit fv_setup_exit(enum fovea_status status)
{
    return status == FOVEA_ERROR_SYSTEM || status == FOVEA_ERROR_MEMORY ? FV_EXIT_FAILED
                                                                        : FV_EXIT_WRONG;
}
