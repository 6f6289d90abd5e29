#include "message/recorded.h"

#include <string.h>

#include "message/fields.h"
#include "message/message.h"
#include "message/wire.h"

#include "fovea_types.h"

size_t fv_message_frame_size_max(const struct fovea_frame *frame)
{
    enum { IMAGE_BYTES = 4 + 4 + 4 + 1 + 8 + 8 + 4 };
    fovea_frame_t empty;
    memset(&empty, 0, sizeof empty);
    size_t bytes = (size_t)fovea_frame_t_encoded_size(&empty);
    for (uint32_t i = 0; i < frame->image_count; i++)
        bytes += IMAGE_BYTES + fv_message_image_bytes(&frame->images[i]);
    return bytes;
}

size_t fv_message_rig_size_max(void)
{
    enum { CAMERA_BYTES = 3 * 1 + 2 * 4 + 1 + 8 + (4 + 8 + 12) * 8 };
    fovea_rig_t empty;
    memset(&empty, 0, sizeof empty);
    return (size_t)fovea_rig_t_encoded_size(&empty) + FOVEA_CAMERAS_MAX * CAMERA_BYTES;
}

size_t fv_message_inputs_size_max(void)
{
    enum { BOX_BYTES = 4 * 4 };
    fovea_inputs_t empty;
    memset(&empty, 0, sizeof empty);
    return (size_t)fovea_inputs_t_encoded_size(&empty) + FOVEA_JOB_COUNT * sizeof(int32_t) +
           FOVEA_INPUT_BOXES_MAX * BOX_BYTES;
}

size_t fv_message_grants_size_max(void)
{
    fovea_grants_t empty;
    memset(&empty, 0, sizeof empty);
    return (size_t)fovea_grants_t_encoded_size(&empty) + FOVEA_JOB_COUNT * sizeof(int32_t);
}

size_t fv_message_parameter_size_max(void)
{
    enum { KEY_BYTES = 64, VALUE_BYTES = 1024 };
    char nothing[] = "";
    const fovea_parameter_t empty = {.key = nothing, .value = nothing};
    return (size_t)fovea_parameter_t_encoded_size(&empty) + KEY_BYTES + VALUE_BYTES;
}

uint32_t fv_message_parameter_encode(const char *key, const char *value, uint8_t *buffer,
                                     size_t capacity)
{
    /* lcm-gen's structs have no const: it reads only */
    const fovea_parameter_t message = {.key = (char *)(uintptr_t)key,
                                       .value = (char *)(uintptr_t)value};
    return fv_wire_encoded(
        fovea_parameter_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

size_t fv_message_loaded_map_size_max(size_t bytes)
{
    char nothing[] = "";
    const fovea_loaded_map_t empty = {.file = nothing};
    return (size_t)fovea_loaded_map_t_encoded_size(&empty) + FV_MESSAGE_MAP_NAME_BYTES + bytes;
}

uint32_t fv_message_loaded_map_encode(const char *file, const uint8_t *data, size_t bytes,
                                      uint8_t *buffer, size_t capacity)
{
    const fovea_loaded_map_t message = {.file = (char *)(uintptr_t)file,
                                        .size_bytes = (int32_t)bytes,
                                        .data = (uint8_t *)(uintptr_t)data};
    return fv_wire_encoded(
        fovea_loaded_map_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

size_t fv_message_image_bytes(const struct fovea_image *image)
{
    if (image->data == NULL) return 0;
    if (image->format == FOVEA_PIXEL_MJPEG) return image->size_bytes;
    size_t bytes = fovea_image_bytes(image->format, image->height, image->stride_bytes);
    return bytes < image->size_bytes ? bytes : image->size_bytes;
}

uint32_t fv_message_frame_encode(const struct fovea_frame *frame, int64_t utc_offset_ns,
                                 uint8_t *buffer, size_t capacity)
{
    fovea_image_t images[FOVEA_CAMERAS_MAX];
    if (frame->image_count > FOVEA_CAMERAS_MAX) return 0;
    for (uint32_t i = 0; i < frame->image_count; i++) {
        const struct fovea_image *image = &frame->images[i];
        images[i] = (fovea_image_t){
            .width = image->width,
            .height = image->height,
            .stride_bytes = image->stride_bytes,
            .pixel_format = (int8_t)image->format,
            .offset_ns = frame->offset_ns[i],
            .exposure_ns = frame->exposure_ns[i],
            .size_bytes = (int32_t)fv_message_image_bytes(image),
            .data = (uint8_t *)image->data, /* lcm-gen knows no const; it only reads */
        };
    }
    const fovea_frame_t message = {
        .stamp = fv_message_stamp(frame, utc_offset_ns),
        .image_count = (int32_t)frame->image_count,
        .images = images,
    };
    return fv_wire_encoded(fovea_frame_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

static void fill_camera(const struct fovea_rig_camera *from, fovea_rig_camera_t *to)
{
    const struct fovea_camera *camera = &from->camera;
    *to = (fovea_rig_camera_t){.calibrated = from->calibrated,
                               .has_readout = from->has_readout,
                               .has_body_cam = from->has_T_body_cam};
    if (from->has_readout) to->readout_ns = from->readout_ns;
    to->width = camera->width;
    to->height = camera->height;
    if (from->calibrated) {
        to->lens = (int8_t)camera->lens;
        to->fx = camera->fx;
        to->fy = camera->fy;
        to->cx = camera->cx;
        to->cy = camera->cy;
        memcpy(to->k, camera->k, sizeof to->k);
    }
    if (from->has_T_body_cam) memcpy(to->body_cam, from->T_body_cam, sizeof to->body_cam);
}

uint32_t fv_message_rig_encode(const struct fovea_rig *rig, uint8_t *buffer, size_t capacity)
{
    fovea_rig_camera_t cameras[FOVEA_CAMERAS_MAX];
    const struct fovea_rig_imu *imu = &rig->imu;
    fovea_rig_t message = {
        .camera_count = (int32_t)rig->camera_count, .cameras = cameras, .has_imu = rig->has_imu};
    if (rig->camera_count > FOVEA_CAMERAS_MAX) return 0;
    for (uint32_t i = 0; i < rig->camera_count; i++)
        fill_camera(&rig->cameras[i], &cameras[i]);
    if (rig->has_imu) {
        memcpy(message.body_imu, imu->T_body_imu, sizeof message.body_imu);
        message.imu_rate_hz = imu->rate_hz;
        message.gyro_noise = imu->gyro_noise;
        message.gyro_walk = imu->gyro_walk;
        message.acceleration_noise = imu->acceleration_noise;
        message.acceleration_walk = imu->acceleration_walk;
        message.gyro_range = imu->gyro_range;
        message.acceleration_range = imu->acceleration_range;
        memcpy(message.gyro_correction, imu->gyro_correction, sizeof message.gyro_correction);
        memcpy(message.acceleration_correction, imu->acceleration_correction,
               sizeof message.acceleration_correction);
        message.imu_time_offset_ns = imu->time_offset_ns;
    }
    return fv_wire_encoded(fovea_rig_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

enum { HASH_BYTES = 8 };

size_t fv_message_sample_size_max(void)
{
    static const fovea_stamp_t stamp;
    return HASH_BYTES + (size_t)__fovea_stamp_t_encoded_array_size(&stamp, 1) +
           FOVEA_SAMPLE_VALUES_MAX * sizeof(double);
}

/* Every kind has its stamp and then doubles, in its struct as on the wire. */
#define CHECK_SAMPLE(KIND, name)                                                                   \
    _Static_assert(sizeof(fovea_##name##_t) - sizeof(fovea_stamp_t) ==                             \
                           sizeof(struct fovea_##name##_sample) - sizeof(int64_t) &&               \
                       sizeof(struct fovea_##name##_sample) <= sizeof(struct fovea_any_sample),    \
                   "a sample holds the doubles of its LCM type, at most FOVEA_SAMPLE_VALUES_MAX");
FOVEA_SAMPLE_KINDS(CHECK_SAMPLE)

uint32_t fv_message_sample_encode(const struct fovea_sample *sample, const fovea_stamp_t *stamp,
                                  uint8_t *buffer, size_t capacity)
{
#define HASH_OF(KIND, name) __fovea_##name##_t_get_hash,
    static int64_t (*const hashes[])(void) = {FOVEA_SAMPLE_KINDS(HASH_OF)};
    const uint32_t count = fovea_sample_value_count(sample->kind);
    if (capacity < HASH_BYTES + count * sizeof(double)) return 0;
    fovea_stamp_t own = *stamp;
    own.time_ns = fovea_sample_stamp(sample);
    const int room = fv_wire_capacity(capacity - HASH_BYTES - count * sizeof(double));
    const int stamp_bytes = __fovea_stamp_t_encode_array(buffer, HASH_BYTES, room, &own, 1);
    if (stamp_bytes < 0) return 0;
    uint8_t *to = buffer + HASH_BYTES + stamp_bytes;
    fv_wire_write(buffer, (uint64_t)hashes[sample->kind](), HASH_BYTES);
    for (uint32_t i = 0; i < count; i++, to += sizeof(double)) {
        uint64_t bits;
        memcpy(&bits, &sample->any.values[i], sizeof bits);
        fv_wire_write(to, bits, sizeof bits);
    }
    return (uint32_t)(to - buffer);
}

/* What a step was given of things that move; false: more than there is room for. */
static bool fill_boxes(const struct fovea_inputs *inputs, fovea_box_t *boxes)
{
    if (inputs->box_count > FOVEA_INPUT_BOXES_MAX) return false;
    for (uint32_t i = 0; i < inputs->box_count; i++) {
        const struct fovea_box *b = &inputs->boxes[i];
        boxes[i] = (fovea_box_t){b->x_min_px, b->y_min_px, b->x_max_px, b->y_max_px};
    }
    return true;
}

uint32_t fv_message_inputs_encode(const struct fovea_inputs *inputs, uint64_t frame_hash,
                                  uint8_t *buffer, size_t capacity)
{
    int32_t units[FOVEA_JOB_COUNT];
    fovea_box_t boxes[FOVEA_INPUT_BOXES_MAX];
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        units[job] = (int32_t)inputs->grants.units[job];
    if (!fill_boxes(inputs, boxes)) return 0;
    const fovea_inputs_t message = {
        .has_frame = inputs->frame != NULL,
        .frame_hash = (int64_t)frame_hash,
        .now_ns = inputs->now_ns,
        .source_state = (int8_t)inputs->source_state,
        .delivered = (int64_t)inputs->source_counts.delivered,
        .missing = (int64_t)inputs->source_counts.missing,
        .damaged = (int64_t)inputs->source_counts.damaged,
        .dropped = (int64_t)inputs->source_counts.dropped,
        .recovered = (int64_t)inputs->source_counts.recovered,
        .commands = (int32_t)inputs->commands,
        .utc_offset_ns = inputs->utc_offset_ns,
        .latency_ns = inputs->latency_ns,
        .frames_late = (int64_t)inputs->frames_late,
        .resident_bytes = (int64_t)inputs->resident_bytes,
        .temperature_c = inputs->temperature_c,
        .sample_count = (int32_t)inputs->sample_count,
        .has_boxes = inputs->has_boxes,
        .boxes_stamp_ns = inputs->boxes_stamp_ns,
        .box_count = (int32_t)inputs->box_count,
        .boxes = boxes,
        .features = (int32_t)inputs->grants.features,
        .job_count = FOVEA_JOB_COUNT,
        .units = units,
    };
    return fv_wire_encoded(fovea_inputs_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

uint32_t fv_message_grants_encode(int64_t now_ns, const struct fovea_grants *grants,
                                  uint8_t *buffer, size_t capacity)
{
    int32_t units[FOVEA_JOB_COUNT];
    for (int job = 0; job < FOVEA_JOB_COUNT; job++)
        units[job] = (int32_t)grants->units[job];
    const fovea_grants_t message = {
        .now_ns = now_ns,
        .features = (int32_t)grants->features,
        .job_count = FOVEA_JOB_COUNT,
        .units = units,
    };
    return fv_wire_encoded(fovea_grants_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

/* ---- back ------------------------------------------------------------------------------------ */

/* Reads the numbers of a checked message in the order of its fields. */
struct reader {
    struct fovea_fields walk;
    struct fovea_field leaf;
};

static uint64_t next_bits(struct reader *reader)
{
    const struct fovea_field *leaf = &reader->leaf;
    if (fovea_fields_next(&reader->walk, &reader->leaf) != FOVEA_OK || leaf->count == 0) return 0;
    return fv_wire_read(leaf->data, leaf->bytes / leaf->count);
}

static int32_t next_i32(struct reader *reader)
{
    return (int32_t)(uint32_t)next_bits(reader);
}

static int64_t next_i64(struct reader *reader)
{
    return (int64_t)next_bits(reader);
}

/* features, job_count and units: the common end of inputs and grants. */
static bool next_grants(struct reader *reader, struct fovea_grants *grants, const char **problem,
                        size_t *at)
{
    int32_t features = next_i32(reader), jobs = next_i32(reader);
    size_t jobs_at = reader->leaf.offset;
    memset(grants, 0, sizeof *grants);
    grants->features = (uint32_t)features;
    if (features < 0 || jobs > FOVEA_JOB_COUNT) {
        *problem = features < 0 ? "fewer than no features are granted"
                                : "there are jobs that this program does not have";
        *at = features < 0 ? jobs_at - 4 : jobs_at;
        return false;
    }
    if (jobs == 0) return true;
    next_bits(reader);
    for (int job = 0; job < jobs; job++)
        grants->units[job] = (uint32_t)fv_wire_read(reader->leaf.data + 4 * job, 4);
    return true;
}

static bool begin(struct reader *reader, const char *type, const uint8_t *data, size_t bytes,
                  const char **problem, size_t *at)
{
    if (!fv_message_check(type, data, bytes, problem, at)) return false;
    return fovea_fields_begin(&reader->walk, data, bytes) == FOVEA_OK;
}

/* The next field as a number of elements, at most `most`. */
static bool next_count(struct reader *reader, uint32_t most, uint32_t *count, const char **problem,
                       size_t *at)
{
    int32_t found = next_i32(reader);
    *count = (uint32_t)found;
    if (found >= 0 && (uint32_t)found <= most) return true;
    *problem = "there are more elements than a step can take";
    *at = reader->leaf.offset;
    return false;
}

static bool next_boxes(struct reader *reader, struct fovea_inputs *found, const char **problem,
                       size_t *at)
{
    found->has_boxes = next_bits(reader) != 0;
    found->boxes_stamp_ns = next_i64(reader);
    if (!next_count(reader, FOVEA_INPUT_BOXES_MAX, &found->box_count, problem, at)) return false;
    for (uint32_t i = 0; i < found->box_count; i++) {
        float *sides[4] = {&found->boxes[i].x_min_px, &found->boxes[i].y_min_px,
                           &found->boxes[i].x_max_px, &found->boxes[i].y_max_px};
        for (int k = 0; k < 4; k++) {
            uint32_t bits = (uint32_t)next_bits(reader);
            memcpy(sides[k], &bits, sizeof bits);
        }
    }
    return true;
}

bool fv_message_inputs_decode(const uint8_t *data, size_t bytes, struct fovea_inputs *inputs,
                              bool *has_frame, uint64_t *frame_hash, const char **problem,
                              size_t *at)
{
    struct reader reader;
    if (!begin(&reader, "fovea.inputs_t", data, bytes, problem, at)) return false;
    struct fovea_inputs found;
    memset(&found, 0, sizeof found);
    bool frame = next_bits(&reader) != 0;
    uint64_t hash = next_bits(&reader);
    found.now_ns = next_i64(&reader);
    uint64_t source_state = next_bits(&reader);
    if (source_state > FOVEA_SOURCE_ENDED) {
        *problem = "the source's state is none of ours";
        *at = reader.leaf.offset;
        return false;
    }
    found.source_state = (enum fovea_source_state)source_state;
    found.source_counts.delivered = next_bits(&reader);
    found.source_counts.missing = next_bits(&reader);
    found.source_counts.damaged = next_bits(&reader);
    found.source_counts.dropped = next_bits(&reader);
    found.source_counts.recovered = next_bits(&reader);
    found.commands = (uint32_t)next_bits(&reader);
    found.utc_offset_ns = next_i64(&reader);
    found.latency_ns = next_i64(&reader);
    found.frames_late = next_bits(&reader);
    found.resident_bytes = next_bits(&reader);
    uint32_t temperature = (uint32_t)next_bits(&reader);
    memcpy(&found.temperature_c, &temperature, sizeof temperature);
    if (!next_count(&reader, FOVEA_INPUT_SAMPLES_MAX + FV_MESSAGE_PARAMETERS_MAX + 1,
                    &found.sample_count, problem, at) ||
        !next_boxes(&reader, &found, problem, at) ||
        !next_grants(&reader, &found.grants, problem, at))
        return false;
    *inputs = found;
    *has_frame = frame;
    *frame_hash = hash;
    return true;
}

bool fv_message_grants_decode(const uint8_t *data, size_t bytes, struct fovea_grants *grants,
                              const char **problem, size_t *at)
{
    struct reader reader;
    if (!begin(&reader, "fovea.grants_t", data, bytes, problem, at)) return false;
    (void)next_i64(&reader); /* now_ns */
    struct fovea_grants found;
    if (!next_grants(&reader, &found, problem, at)) return false;
    *grants = found;
    return true;
}
