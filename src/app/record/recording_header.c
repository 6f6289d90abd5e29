#include "app/record/recording_header.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/lcmlog.h"
#include "support/aligned.h"
#include "drivers/fault/file.h"
#include "app/config/classes.h"
#include "app/config/model_file.h"
#include "app/record/recording_types.h"
#include "base/hash.h"
#include "support/calibration.h"
#include "message/fields.h"
#include "message/recorded.h"

#include "fovea_recording_t.h"
#include "source_hash.h"
#include "fovea_rig_t.h"

#if defined(__clang__)
#define COMPILER "clang " __clang_version__
#elif defined(__GNUC__)
#define COMPILER "gcc " __VERSION__
#else
#define COMPILER "unknown compiler"
#endif
#if defined(__x86_64__)
#define PROCESSOR "x86_64"
#elif defined(__aarch64__)
#define PROCESSOR "aarch64"
#else
#define PROCESSOR "unknown processor"
#endif

enum { PARTS_MAX = 10 + FOVEA_CAMERAS_MAX };

const char *fv_recording_version(void)
{
    return FOVEA_VERSION "+" FV_SOURCE_HASH;
}

static const char *const mask_parts[FOVEA_CAMERAS_MAX] = {"mask", "mask2", "mask3", "mask4"};

static void add_part(fovea_recording_t *message, const char *name, const char *origin,
                     const void *data, size_t bytes)
{
    message->parts[message->part_count++] = (fovea_recording_part_t){
        .name = (char *)name, /* lcm-gen knows no const; it only reads */
        .origin = (char *)origin,
        .hash = (int64_t)fv_hash(FV_HASH_START, data, bytes),
        .size_bytes = (int32_t)bytes,
        .data = (uint8_t *)data,
    };
}

/* The settings as YAML text that reads back to the same values. The caller frees it. */
static char *settings_text(const struct fv_settings *settings, size_t *bytes)
{
    char *text = NULL;
    FILE *stream = open_memstream(&text, bytes);
    if (stream == NULL) return NULL;
    fv_settings_print(stream, settings, false);
    if (fclose(stream) == 0) return text;
    free(text);
    return NULL;
}

static enum fovea_status encode(const fovea_recording_t *message, uint8_t **data, uint32_t *bytes,
                                struct fovea_error *error)
{
    int size = fovea_recording_t_encoded_size(message);
    uint8_t *buffer = malloc((size_t)size);
    if (buffer == NULL || fovea_recording_t_encode(buffer, 0, size, message) != size) {
        free(buffer);
        return fovea_error_set(error, FOVEA_ERROR_MEMORY,
                               "no memory for the header of a recording (%d bytes)", size);
    }
    *data = buffer;
    *bytes = (uint32_t)size;
    return FOVEA_OK;
}

/* The caller frees it. */
static uint8_t *rig_bytes(const struct fovea_rig *rig, uint32_t *bytes)
{
    const size_t capacity = fv_message_rig_size_max();
    uint8_t *data = malloc(capacity);
    if (data != NULL) *bytes = fv_message_rig_encode(rig, data, capacity);
    return data;
}

static void add_masks(fovea_recording_t *message, const struct fv_settings *settings)
{
    const struct fovea_rig *rig = &settings->runtime.rig;
    for (uint32_t i = 0; i < rig->camera_count; i++)
        if (rig->cameras[i].mask != NULL)
            add_part(message, mask_parts[i], settings->masks[i], rig->cameras[i].mask,
                     (size_t)rig->cameras[i].camera.width * (size_t)rig->cameras[i].camera.height);
}

/* The settings with the live parameters in force, likewise; "" where the recording began with the
 * run. */
static char *in_force_text(const struct fv_settings *settings,
                           const struct fv_recording_middle *middle, size_t *bytes)
{
    if (middle == NULL) return strdup("");
    struct fv_settings *with = malloc(sizeof *with);
    if (with == NULL) return NULL;
    *with = *settings;
    with->runtime = *middle->in_force;
    char *text = settings_text(with, bytes);
    free(with);
    return text;
}

enum fovea_status fv_recording_header_encode(const struct fv_settings *settings,
                                             const struct fv_identity *identity,
                                             const char *kernel_set, bool real_time,
                                             const struct fv_recording_middle *middle,
                                             uint8_t **data, uint32_t *bytes,
                                             struct fovea_error *error)
{
    const struct fovea_camera *camera = &settings->runtime.rig.cameras[0].camera;
    struct fv_calibration calibration = {.camera = *camera};
    char calibration_text[FV_CALIBRATION_BYTES_MAX];
    enum fovea_status status =
        fv_calibration_format_text(FV_CALIBRATION_ROS, &calibration, calibration_text, NULL, error);
    if (status != FOVEA_OK) return status;
    size_t text_bytes = 0, types_bytes = 0, in_force_bytes = 0;
    uint32_t rig_size = 0;
    char *text = settings_text(settings, &text_bytes);
    char *types = fv_recording_types_text(&types_bytes), source[FV_FAULT_ADDRESS_BYTES];
    if (!fv_fault_uri_whole(settings->source, source))
        snprintf(source, sizeof source, "%s", settings->source);
    char *in_force = in_force_text(settings, middle, &in_force_bytes);
    uint8_t *rig_data = rig_bytes(&settings->runtime.rig, &rig_size);
    if (text == NULL || types == NULL || rig_data == NULL || in_force == NULL) {
        free(text);
        free(types);
        free(in_force);
        free(rig_data);
        return fovea_error_set(error, FOVEA_ERROR_MEMORY,
                               "no memory for the header of a recording");
    }
    fovea_recording_part_t parts[PARTS_MAX];
    fovea_recording_t message = {
        .format = FOVEA_RECORDING_T_FORMAT,
        .version = (char *)fv_recording_version(),
        .machine = (char *)(PROCESSOR ", " COMPILER),
        .kernel_set = (char *)kernel_set,
        .source = source,
        .real_time = real_time,
        .channel_prefix = (char *)settings->runtime.channel_prefix,
        .parts = parts,
    };
    add_part(&message, "configuration", settings->file, text, text_bytes);
    add_part(&message, "calibration", settings->camera, calibration_text, strlen(calibration_text));
    add_part(&message, "rig", "", rig_data, rig_size);
    add_part(&message, "types", "", types, types_bytes);
    add_masks(&message, settings);
    if (settings->runtime.map != NULL)
        add_part(&message, "map", settings->map_load, settings->runtime.map,
                 settings->runtime.map_bytes);
    if (settings->runtime.detect.model != NULL)
        add_part(&message, "model", settings->model, settings->runtime.detect.model,
                 settings->runtime.detect.model_bytes);
    if (settings->runtime.detect2.model != NULL)
        add_part(&message, "model2", settings->model2, settings->runtime.detect2.model,
                 settings->runtime.detect2.model_bytes);
    if (identity != NULL && identity->bytes > 0)
        add_part(&message, "run", identity->channel, identity->data, identity->bytes);
    if (middle != NULL) {
        add_part(&message, "in_force", "", in_force, in_force_bytes);
        add_part(&message, "state", "", middle->state, middle->state_bytes);
    }
    status = encode(&message, data, bytes, error);
    free(text);
    free(types);
    free(in_force);
    free(rig_data);
    return status;
}

/* ---- back ------------------------------------------------------------------------------------ */

struct source {
    const char *name;
    int64_t offset;
};

static enum fovea_status check_hashes(const struct source *from, const fovea_recording_t *message,
                                      struct fovea_error *error)
{
    for (int32_t i = 0; i < message->part_count; i++) {
        const fovea_recording_part_t *part = &message->parts[i];
        uint64_t hash = fv_hash(FV_HASH_START, part->data, (size_t)part->size_bytes);
        if (hash != (uint64_t)part->hash)
            return fovea_error_set(
                error, FOVEA_ERROR_INPUT,
                "%s: byte %" PRId64 ": %.64s: found hash %016" PRIx64 ", expected %016" PRIx64,
                from->name, from->offset, part->name, hash, (uint64_t)part->hash);
    }
    return FOVEA_OK;
}

static const fovea_recording_part_t *find_part(const fovea_recording_t *message, const char *name)
{
    for (int32_t i = 0; i < message->part_count; i++)
        if (strcmp(message->parts[i].name, name) == 0) return &message->parts[i];
    return NULL;
}

static void take_camera(const fovea_rig_camera_t *from, struct fovea_rig_camera *to)
{
    struct fovea_camera *camera = &to->camera;
    *to = (struct fovea_rig_camera){.calibrated = from->calibrated,
                                    .has_readout = from->has_readout,
                                    .readout_ns = from->readout_ns,
                                    .has_T_body_cam = from->has_body_cam,
                                    .camera = {.width = from->width,
                                               .height = from->height,
                                               .lens = (enum fovea_lens)from->lens,
                                               .fx = from->fx,
                                               .fy = from->fy,
                                               .cx = from->cx,
                                               .cy = from->cy}};
    memcpy(camera->k, from->k, sizeof camera->k);
    memcpy(to->T_body_cam, from->body_cam, sizeof to->T_body_cam);
}

static void take_imu(const fovea_rig_t *from, struct fovea_rig_imu *imu)
{
    *imu = (struct fovea_rig_imu){.rate_hz = from->imu_rate_hz,
                                  .gyro_noise = from->gyro_noise,
                                  .gyro_walk = from->gyro_walk,
                                  .acceleration_noise = from->acceleration_noise,
                                  .acceleration_walk = from->acceleration_walk,
                                  .gyro_range = from->gyro_range,
                                  .acceleration_range = from->acceleration_range,
                                  .time_offset_ns = from->imu_time_offset_ns};
    memcpy(imu->gyro_correction, from->gyro_correction, sizeof imu->gyro_correction);
    memcpy(imu->acceleration_correction, from->acceleration_correction,
           sizeof imu->acceleration_correction);
    memcpy(imu->T_body_imu, from->body_imu, sizeof imu->T_body_imu);
}

/* The rig but for its first camera, whose calibration and place have parts of their own. */
static enum fovea_status read_rig(const struct source *from, const fovea_recording_part_t *part,
                                  struct fovea_rig *rig, struct fovea_error *error)
{
    const char *problem = "it cannot be decoded";
    size_t at = 0;
    fovea_rig_t read;
    memset(&read, 0, sizeof read);
    if (!fv_message_check("fovea.rig_t", part->data, (size_t)part->size_bytes, &problem, &at) ||
        fovea_rig_t_decode(part->data, 0, part->size_bytes, &read) < 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: byte %" PRId64 ": rig: byte %zu: %s",
                               from->name, from->offset, at, problem);
    enum fovea_status status = FOVEA_OK;
    struct fovea_error why = {.text = ""};
    if (read.camera_count < 1 || read.camera_count > FOVEA_CAMERAS_MAX)
        status =
            fovea_error_set(&why, FOVEA_ERROR_INPUT, "camera_count: found %d, expected 1 to %d",
                            read.camera_count, FOVEA_CAMERAS_MAX);
    for (int32_t i = 1; status == FOVEA_OK && i < read.camera_count; i++) {
        take_camera(&read.cameras[i], &rig->cameras[i]);
        if (rig->cameras[i].calibrated)
            status = fovea_camera_prepare(&rig->cameras[i].camera, &why);
    }
    if (status == FOVEA_OK) {
        rig->cameras[0].has_readout = read.cameras[0].has_readout;
        rig->cameras[0].readout_ns = read.cameras[0].readout_ns;
        rig->camera_count = (uint32_t)read.camera_count;
        rig->has_imu = read.has_imu;
        take_imu(&read, &rig->imu);
    }
    fovea_rig_t_decode_cleanup(&read);
    return status == FOVEA_OK
               ? FOVEA_OK
               : fovea_error_set(error, FOVEA_ERROR_INPUT, "%s: byte %" PRId64 ": rig: %.256s",
                                 from->name, from->offset, why.text);
}

static enum fovea_status read_mask(const struct source *from, const fovea_recording_part_t *part,
                                   struct fovea_rig_camera *camera, uint8_t **mask,
                                   struct fovea_error *error)
{
    const int64_t expected = (int64_t)camera->camera.width * camera->camera.height;
    if (part->size_bytes != expected || expected == 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte %" PRId64 ": %s: found %" PRId32
                               " bytes, expected %" PRId64,
                               from->name, from->offset, part->name, part->size_bytes, expected);
    *mask = malloc((size_t)expected);
    if (*mask == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory for a mask", from->name);
    memcpy(*mask, part->data, (size_t)expected);
    camera->mask = *mask;
    return FOVEA_OK;
}

static enum fovea_status read_masks(const struct source *from, const fovea_recording_t *message,
                                    struct fv_recording_header *header, struct fovea_error *error)
{
    struct fovea_rig *rig = &header->settings.runtime.rig;
    enum fovea_status status = FOVEA_OK;
    for (uint32_t i = 0; i < rig->camera_count && status == FOVEA_OK; i++) {
        const fovea_recording_part_t *part = find_part(message, mask_parts[i]);
        if (part != NULL)
            status = read_mask(from, part, &rig->cameras[i], &header->masks[i], error);
    }
    return status;
}

static enum fovea_status read_map(const struct source *from, const fovea_recording_part_t *part,
                                  struct fv_recording_header *header, struct fovea_error *error)
{
    const size_t bytes = (size_t)part->size_bytes;
    header->map = malloc(bytes + 1);
    if (header->map == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory for the map", from->name);
    memcpy(header->map, part->data, bytes);
    header->settings.runtime.map = header->map;
    header->settings.runtime.map_bytes = bytes;
    return FOVEA_OK;
}

/* `part` NULL: there is none. */
static enum fovea_status read_model(const struct source *from, const fovea_recording_part_t *part,
                                    void **data, struct fovea_detect_config *detect,
                                    struct fv_model *model, struct fovea_error *error)
{
    if (part == NULL) return FOVEA_OK;
    const size_t bytes = (size_t)part->size_bytes;
    *data = fv_aligned_new(bytes + FV_CACHE_LINE_BYTES);
    if (*data == NULL)
        return fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory for the model",
                               from->name);
    memcpy(*data, part->data, bytes);
    detect->model = *data;
    detect->model_bytes = bytes;
    return fv_model_open(*data, bytes, from->name, model, error);
}

static enum fovea_status read_models(const struct source *from, const fovea_recording_t *message,
                                     struct fv_recording_header *header, struct fovea_error *error)
{
    const fovea_recording_part_t *part = find_part(message, "model");
    struct fovea_config *config = &header->settings.runtime;
    const fovea_recording_part_t *second = find_part(message, "model2");
    struct fv_model model, model2;
    enum fovea_status status =
        read_model(from, part, &header->model, &config->detect, &model, error);
    if (status == FOVEA_OK && part != NULL)
        status = fv_classes_resolve(&header->settings, &model, error);
    if (status == FOVEA_OK)
        status = read_model(from, second, &header->model2, &config->detect2, &model2, error);
    if (status == FOVEA_OK && part != NULL)
        status = fv_classes_resolve_grid(&header->settings, &model, second ? &model2 : NULL, error);
    return status;
}

/* Of a recording that began in the middle of its run: the live parameters then, and its state. */
static enum fovea_status read_middle(const struct source *from, const fovea_recording_t *message,
                                     struct fv_recording_header *header, struct fovea_error *error)
{
    const fovea_recording_part_t *state = find_part(message, "state");
    const fovea_recording_part_t *in_force = find_part(message, "in_force");
    char label[160];
    if (state == NULL && in_force == NULL) return FOVEA_OK;
    if (state == NULL || in_force == NULL)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte %" PRId64 ": found one of the parts state and in_force, "
                               "expected both or none",
                               from->name, from->offset);
    struct fv_settings *read = malloc(sizeof *read);
    header->in_force = malloc(sizeof *header->in_force);
    header->state_bytes = (size_t)state->size_bytes;
    header->state = malloc(header->state_bytes + 1);
    enum fovea_status status = FOVEA_OK;
    if (read == NULL || header->in_force == NULL || header->state == NULL) {
        status = fovea_error_set(error, FOVEA_ERROR_MEMORY, "%s: no memory for the state of a run",
                                 from->name);
    } else {
        memcpy(header->state, state->data, header->state_bytes);
        snprintf(label, sizeof label, "%.128s: in_force", from->name);
        fv_settings_default(read);
        status = fv_settings_parse(read, label, (const char *)in_force->data,
                                   (size_t)in_force->size_bytes, error);
        *header->in_force = header->settings;
    }
    for (size_t i = 0; status == FOVEA_OK && i < fv_settings_key_count; i++)
        if (fv_settings_keys[i].live)
            fv_settings_key_copy(&fv_settings_keys[i], header->in_force, read);
    free(read);
    return status;
}

static enum fovea_status read_parts(const struct source *from, const fovea_recording_t *message,
                                    struct fv_recording_header *header, struct fovea_error *error)
{
    enum fovea_status status = check_hashes(from, message, error);
    if (status != FOVEA_OK) return status;
    const fovea_recording_part_t *configuration = find_part(message, "configuration");
    const fovea_recording_part_t *calibration = find_part(message, "calibration");
    const fovea_recording_part_t *rig = find_part(message, "rig");
    const fovea_recording_part_t *map = find_part(message, "map");
    const fovea_recording_part_t *run = find_part(message, "run");
    const fovea_recording_part_t *types = find_part(message, "types");
    if (configuration == NULL || calibration == NULL || rig == NULL || types == NULL)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte %" PRId64 ": found no %s, expected one", from->name,
                               from->offset,
                               configuration == NULL ? "configuration"
                               : calibration == NULL ? "calibration"
                               : rig == NULL         ? "rig"
                                                     : "description of the types");
    status = fv_recording_types_check(from->name, from->offset, (const char *)types->data,
                                      (size_t)types->size_bytes, error);
    if (status != FOVEA_OK) return status;
    if (run != NULL && !fv_identity_read(&header->identity, run->data, (uint32_t)run->size_bytes))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte %" PRId64 ": run: found %" PRId32
                               " bytes that are no fovea.run_t, expected one",
                               from->name, from->offset, run->size_bytes);
    char label[160];
    snprintf(label, sizeof label, "%.128s: configuration", from->name);
    status = fv_settings_parse(&header->settings, label, (const char *)configuration->data,
                               (size_t)configuration->size_bytes, error);
    struct fv_calibration read;
    if (status == FOVEA_OK) {
        snprintf(label, sizeof label, "%.128s: calibration", from->name);
        status = fv_calibration_parse(label, (const char *)calibration->data,
                                      (size_t)calibration->size_bytes, NULL, &read, error);
    }
    if (status != FOVEA_OK) return status;
    header->settings.runtime.rig.cameras[0].camera = read.camera;
    status = read_rig(from, rig, &header->settings.runtime.rig, error);
    if (status == FOVEA_OK) status = read_masks(from, message, header, error);
    if (map != NULL && status == FOVEA_OK) status = read_map(from, map, header, error);
    if (status == FOVEA_OK) status = read_models(from, message, header, error);
    return status == FOVEA_OK ? read_middle(from, message, header, error) : status;
}

enum fovea_status fv_recording_header_decode(const char *name, int64_t offset, const uint8_t *data,
                                             size_t bytes, struct fv_recording_header *header,
                                             struct fovea_error *error)
{
    const struct source from = {name, offset};
    const char *problem;
    size_t at;
    memset(header, 0, sizeof *header);
    fv_settings_default(&header->settings);
    if (!fv_message_check("fovea.recording_t", data, bytes, &problem, &at))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%s: byte %" PRId64 ": header of a recording: %s", name,
                               offset + (int64_t)at, problem);
    fovea_recording_t message;
    memset(&message, 0, sizeof message);
    enum fovea_status status = FOVEA_OK;
    if (fovea_recording_t_decode(data, 0, (int)bytes, &message) < 0)
        status =
            fovea_error_set(error, FOVEA_ERROR_INPUT,
                            "%s: byte %" PRId64 ": the header cannot be decoded", name, offset);
    else
        status = fv_lcmlog_check_format(name, offset + 8, message.format, error);
    if (status == FOVEA_OK) status = read_parts(&from, &message, header, error);
    if (status == FOVEA_OK) {
        header->real_time = message.real_time;
        snprintf(header->version, sizeof header->version, "%s", message.version);
        snprintf(header->machine, sizeof header->machine, "%s", message.machine);
        snprintf(header->kernel_set, sizeof header->kernel_set, "%s", message.kernel_set);
    } else {
        for (int i = 0; i < FOVEA_CAMERAS_MAX; i++)
            free(header->masks[i]);
        memset(header->masks, 0, sizeof header->masks);
        free(header->model);
        free(header->model2);
        free(header->map);
        free(header->state);
        free(header->in_force);
        header->map = header->state = NULL;
        header->in_force = NULL;
        header->model = header->model2 = NULL;
    }
    fovea_recording_t_decode_cleanup(&message);
    return status;
}
