#include "log_rig.h"

#include <stdio.h>
#include <string.h>

#include "support/calibration.h"

/* Of the generated types. */
int64_t __fovea_recording_t_get_hash(void);
int64_t __fovea_rig_t_get_hash(void);

/* Big-endian members one after the other, as lcm-gen encodes them. */
struct cursor {
    const uint8_t *data;
    size_t bytes, at;
    bool short_of; /* a member went past the end */
};

static uint64_t take_number(struct cursor *cursor, size_t bytes)
{
    uint64_t number = 0;
    if (cursor->bytes - cursor->at < bytes) cursor->short_of = true;
    for (size_t i = 0; i < bytes && !cursor->short_of; i++)
        number = number << 8 | cursor->data[cursor->at++];
    return number;
}

/* `bytes` bytes, which stay in the event; NULL when there are fewer. */
static const uint8_t *take_bytes(struct cursor *cursor, size_t bytes)
{
    if (cursor->short_of || cursor->bytes - cursor->at < bytes) {
        cursor->short_of = true;
        return NULL;
    }
    cursor->at += bytes;
    return cursor->data + cursor->at - bytes;
}

/* A string: its length with the zero, then its bytes. "" when it does not fit or does not end. */
static const char *take_string(struct cursor *cursor)
{
    const size_t length = (size_t)take_number(cursor, 4);
    const uint8_t *text = take_bytes(cursor, length);
    if (text == NULL || length == 0 || text[length - 1] != '\0') cursor->short_of = true;
    return cursor->short_of ? "" : (const char *)text;
}

static void take_numbers(struct cursor *cursor, double *values, int count)
{
    for (int i = 0; i < count; i++) {
        const uint64_t bits = take_number(cursor, 8);
        memcpy(&values[i], &bits, sizeof bits);
    }
}

static bool all_finite(const double *values, int count)
{
    for (int i = 0; i < count; i++)
        if (!(values[i] > -1e12 && values[i] < 1e12)) return false;
    return true;
}

static enum fovea_status take_camera(struct cursor *cursor, struct fovea_rig_camera *camera,
                                     struct fovea_error *error)
{
    struct fovea_camera *lens = &camera->camera;
    *camera = (struct fovea_rig_camera){.calibrated = take_number(cursor, 1) != 0};
    lens->width = (int32_t)take_number(cursor, 4);
    lens->height = (int32_t)take_number(cursor, 4);
    lens->lens = (enum fovea_lens)take_number(cursor, 1);
    double *const members[] = {&lens->fx, &lens->fy, &lens->cx, &lens->cy};
    for (int i = 0; i < 4; i++)
        take_numbers(cursor, members[i], 1);
    take_numbers(cursor, lens->k, FOVEA_LENS_COEFFICIENTS);
    camera->has_readout = take_number(cursor, 1) != 0;
    camera->readout_ns = (int64_t)take_number(cursor, 8);
    camera->has_T_body_cam = take_number(cursor, 1) != 0;
    take_numbers(cursor, camera->T_body_cam, 12);
    if (cursor->short_of) return FOVEA_OK; /* said by the caller */
    if (!all_finite(camera->T_body_cam, 12))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "T_body_cam: found no finite number, expected metres");
    if (camera->has_T_body_cam && !fv_calibration_is_rotation(camera->T_body_cam))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "T_body_cam: found no rotation, expected orthonormal rows");
    if (!camera->calibrated) return FOVEA_OK;
    if (lens->lens > FOVEA_LENS_EQUIDISTANT)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "lens: found %d, expected 0 or 1",
                               (int)lens->lens);
    return fovea_camera_prepare(lens, error);
}

static enum fovea_status take_imu(struct cursor *cursor, struct fovea_rig *rig,
                                  struct fovea_error *error)
{
    struct fovea_rig_imu *imu = &rig->imu;
    double noise[7];
    rig->has_imu = take_number(cursor, 1) != 0;
    take_numbers(cursor, imu->T_body_imu, 12);
    take_numbers(cursor, noise, 7);
    take_numbers(cursor, imu->gyro_correction, 12);
    take_numbers(cursor, imu->acceleration_correction, 12);
    imu->time_offset_ns = (int64_t)take_number(cursor, 8);
    imu->rate_hz = noise[0];
    imu->gyro_noise = noise[1];
    imu->gyro_walk = noise[2];
    imu->acceleration_noise = noise[3];
    imu->acceleration_walk = noise[4];
    imu->gyro_range = noise[5];
    imu->acceleration_range = noise[6];
    if (cursor->short_of) return FOVEA_OK; /* said by the caller */
    if (!all_finite(noise, 7) || !all_finite(imu->T_body_imu, 12) ||
        !all_finite(imu->gyro_correction, 12) || !all_finite(imu->acceleration_correction, 12))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "imu: found a number that is not finite, expected finite ones");
    if (!rig->has_imu || fv_calibration_is_rotation(imu->T_body_imu)) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "T_body_imu: found no rotation, expected orthonormal rows");
}

static enum fovea_status take_rig(struct cursor *cursor, struct fovea_rig *rig,
                                  struct fovea_error *error)
{
    struct fovea_error reason = {.text = ""};
    *rig = (struct fovea_rig){.camera_count = 0};
    if (take_number(cursor, 8) != (uint64_t)__fovea_rig_t_get_hash())
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found another type, expected fovea.rig_t");
    rig->camera_count = (uint32_t)take_number(cursor, 4);
    if (rig->camera_count < 1 || rig->camera_count > FOVEA_CAMERAS_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "camera_count: found %d, expected 1 to %d",
                               (int)rig->camera_count, FOVEA_CAMERAS_MAX);
    for (uint32_t i = 0; i < rig->camera_count; i++)
        if (take_camera(cursor, &rig->cameras[i], &reason) != FOVEA_OK)
            return fovea_error_set(error, FOVEA_ERROR_INPUT, "camera %u: %.256s", i, reason.text);
    const enum fovea_status status = take_imu(cursor, rig, error);
    if (cursor->short_of || cursor->at != cursor->bytes)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "found %zu bytes, expected the length of its cameras",
                               cursor->bytes);
    return status;
}

static enum fovea_status find_rig(struct cursor *cursor, const char *name, int64_t start,
                                  struct fovea_rig *rig, struct fovea_error *error)
{
    const uint32_t parts = (uint32_t)take_number(cursor, 4);
    for (uint32_t i = 0; i < parts && !cursor->short_of; i++) {
        const char *part = take_string(cursor);
        take_string(cursor);    /* origin */
        take_number(cursor, 8); /* hash */
        const size_t bytes = (size_t)take_number(cursor, 4);
        const uint8_t *data = take_bytes(cursor, bytes);
        if (data == NULL || strcmp(part, "rig") != 0) continue;
        struct cursor inside = {.data = data, .bytes = bytes};
        struct fovea_error reason = {.text = ""};
        struct fovea_rig found;
        if (take_rig(&inside, &found, &reason) != FOVEA_OK)
            return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.256s: byte %lld: rig: %.400s", name,
                                   (long long)start + (long long)(cursor->at - bytes + inside.at),
                                   reason.text);
        *rig = found;
        return FOVEA_OK;
    }
    if (!cursor->short_of) return FOVEA_AGAIN;
    return fovea_error_set(
        error, FOVEA_ERROR_INPUT,
        "%s: byte %lld: found a length past the end of the message, expected less", name,
        (long long)start + (long long)cursor->at);
}

enum fovea_status fv_log_rig(const char *name, const struct fv_lcmlog_event *event,
                             struct fovea_rig *rig, struct fovea_error *error)
{
    struct cursor cursor = {.data = event->data, .bytes = event->bytes};
    const int64_t start = event->offset + FV_LCMLOG_HEADER_BYTES + (int64_t)strlen(event->channel);
    if (take_number(&cursor, 8) != (uint64_t)__fovea_recording_t_get_hash()) return FOVEA_AGAIN;
    const int32_t format = (int32_t)take_number(&cursor, 4);
    if (!cursor.short_of) {
        const enum fovea_status status = fv_lcmlog_check_format(name, start + 8, format, error);
        if (status != FOVEA_OK) return status;
    }
    for (int i = 0; i < 4; i++)
        take_string(&cursor); /* version, machine, kernel set, source */
    take_number(&cursor, 1);  /* real_time */
    take_string(&cursor);     /* channel prefix */
    return find_rig(&cursor, name, start, rig, error);
}
