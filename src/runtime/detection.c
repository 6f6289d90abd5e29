#include "runtime/detection.h"

#include <stddef.h>
#include <string.h>

#include "base/elementary.h"
#include "nn/real.h"
#include "runtime/tensors.h"

enum {
    BOXES_PER_UNIT = 16, /* of 8 points each, about 1 us per point here */
    PIXEL_BYTES_MAX = 3  /* of the formats that the detector reads */
};

/* ---- set-up ---------------------------------------------------------------------------------- */

static enum fovea_status check_use(const struct fv_model *model, const char *key,
                                   struct fovea_error *error)
{
    if (!fv_nn_takes_images(model)) {
        return fovea_error_set(error, FOVEA_ERROR_ARGUMENT,
                               "%s: found %u inputs, expected one: an image of 1 or 3 channels",
                               key, fv_model_input_count(model));
    }
    return FOVEA_OK;
}

enum fovea_status fv_detection_prepare(struct fv_detection *detection, const char *key,
                                       const struct fovea_detect_config *settings,
                                       const struct fovea_camera *camera, struct fovea_error *error)
{
    *detection = (struct fv_detection){.settings = *settings};
    if (settings->model == NULL) return FOVEA_OK;
    enum fovea_status status =
        fv_model_open(settings->model, settings->model_bytes, key, &detection->model, error);
    if (status == FOVEA_OK) status = check_use(&detection->model, key, error);
    if (status != FOVEA_OK) return status;
    /* As `fovea rectify` does unasked; a lens too wide for a pinhole gets a cylinder. */
    for (int shape = FV_RECTIFIED_PINHOLE;
         shape <= FV_RECTIFIED_CYLINDER && !detection->has_rectified; shape++) {
        detection->has_rectified =
            fv_rectified_choose(camera, (enum fv_rectified_shape)shape, FV_RECTIFIED_CROP,
                                camera->width, camera->height, &detection->rectified,
                                NULL) == FOVEA_OK;
    }
    detection->enabled = true;
    detection->gives = fv_detect_gives(&detection->model);
    return FOVEA_OK;
}

/* The lowest score that the second stage of matching objects takes. */
float fv_detection_floor(const struct fovea_objects_config *objects)
{
    const float least = 0.01f;
    if (objects->mode != FOVEA_OBJECTS_SORT) return 0.0f;
    return (float)objects->score_low > least ? (float)objects->score_low : least;
}

static uint32_t least_u32(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

/* Of one message. */
static uint32_t sets_max(const struct fv_detection *detection)
{
    return least_u32(detection->settings.count_max,
                     (uint32_t)fv_detect_sets_max(&detection->model));
}

static uint32_t points_of(const struct fv_detection *detection)
{
    return (uint32_t)fv_detect_point_count(&detection->model);
}

static uint32_t classes_max(const struct fv_detection *detection)
{
    return least_u32(detection->settings.count_max, FV_MESSAGE_CLASSES_MAX);
}

/* For the message that needs most; one is encoded at a time. */
static size_t scratch_bytes(const struct fv_detection *detection)
{
    if (detection->gives == 0) return FV_MESSAGE_TENSOR_BYTES_MAX;
    const size_t boxes = fv_message_detections_scratch_bytes(detection->settings.count_max,
                                                             fv_detection_label_bytes(detection));
    const size_t points =
        (detection->gives & FV_DETECT_POINTS) == 0
            ? 0
            : fv_message_keypoints_scratch_bytes(sets_max(detection), points_of(detection));
    const size_t mask =
        (detection->gives & FV_DETECT_MASK) == 0 ? 0 : fv_message_segmentation_scratch_bytes();
    const size_t list = points > boxes ? points : boxes;
    return mask > list ? mask : list;
}

void fv_detection_set(struct fv_detection *detection, const struct fovea_detect_config *settings,
                      float floor)
{
    detection->settings = *settings;
    detection->floor = floor;
}

void fv_detection_carve(struct fv_detection *detection, const struct fovea_camera *camera,
                        struct fv_arena *persistent, struct fv_arena *job, struct fv_arena *frame)
{
    if (!detection->enabled) return;
    const size_t pixels = (size_t)camera->width * (size_t)camera->height;
    detection->state = fv_arena_take(persistent, 1, sizeof *detection->state);
    fv_nn_real_carve(&detection->model, frame);
    fv_detect_carve(&detection->memory, job, &detection->model, NULL, pixels * PIXEL_BYTES_MAX);
    detection->message_scratch = fv_arena_take(frame, scratch_bytes(detection), 1);
}

void fv_detection_init(const struct fv_detection *detection, const struct fv_kernels *kernels)
{
    if (detection->enabled) fv_nn_real_fill(&detection->model, kernels);
}

bool fv_detection_sends(const struct fv_detection *detection, enum fv_detection_message message)
{
    static const uint32_t bits[FV_DETECTION_MESSAGE_COUNT] = {
        [FV_DETECTION_BOXES] = FV_DETECT_BOXES,
        [FV_DETECTION_KEYPOINTS] = FV_DETECT_POINTS,
        [FV_DETECTION_CLASSES] = FV_DETECT_CLASSES,
        [FV_DETECTION_SEGMENTATION] = FV_DETECT_MASK};
    if (!detection->enabled) return false;
    return message == FV_DETECTION_TENSORS ? detection->gives == 0
                                           : (detection->gives & bits[message]) != 0;
}

bool fv_detection_due(const struct fv_detection *detection, enum fv_detection_message message)
{
    return fv_detection_sends(detection, message) &&
           (detection->state->mask_row == 0 || message == FV_DETECTION_SEGMENTATION);
}

enum fv_message_kind fv_detection_kind(enum fv_detection_message message, int network)
{
    static const enum fv_message_kind kinds[FV_DETECTION_MESSAGE_COUNT][2] = {
        [FV_DETECTION_BOXES] = {FV_MESSAGE_DETECTIONS, FV_MESSAGE_DETECTIONS2},
        [FV_DETECTION_KEYPOINTS] = {FV_MESSAGE_KEYPOINTS, FV_MESSAGE_KEYPOINTS2},
        [FV_DETECTION_CLASSES] = {FV_MESSAGE_CLASSES, FV_MESSAGE_CLASSES2},
        [FV_DETECTION_SEGMENTATION] = {FV_MESSAGE_SEGMENTATION, FV_MESSAGE_SEGMENTATION2},
        [FV_DETECTION_TENSORS] = {FV_MESSAGE_TENSORS, FV_MESSAGE_TENSORS2}};
    return kinds[message][network];
}

size_t fv_detection_label_bytes(const struct fv_detection *detection)
{
    size_t longest = 0;
    for (uint32_t i = 0; i < fv_model_label_count(&detection->model); i++) {
        const size_t bytes = strlen(fv_model_label(&detection->model, (int32_t)i));
        longest = bytes > longest ? bytes : longest;
    }
    return longest;
}

size_t fv_detection_message_bytes(const struct fv_detection *detection,
                                  enum fv_detection_message message)
{
    switch (message) {
    case FV_DETECTION_BOXES:
        return fv_message_detections_size_max(detection->settings.count_max,
                                              fv_detection_label_bytes(detection));
    case FV_DETECTION_KEYPOINTS:
        return fv_message_keypoints_size_max(sets_max(detection), points_of(detection));
    case FV_DETECTION_CLASSES:
        return fv_message_classes_size_max(classes_max(detection));
    case FV_DETECTION_SEGMENTATION:
        return fv_message_segmentation_size_max();
    default:
        return FV_MESSAGE_PACKET_BYTES;
    }
}

/* ---- the job --------------------------------------------------------------------------------- */

void fv_detection_reset(struct fv_detection *detection)
{
    if (!detection->enabled) return;
    fv_detect_stop(&detection->memory);
    detection->state->mapping = FV_DETECTION_IDLE;
    detection->state->mask_row = 0;
}

bool fv_detection_waiting(const struct fv_detection *detection)
{
    return detection->enabled &&
           (!fv_detect_idle(&detection->memory) || detection->state->mapping != FV_DETECTION_IDLE);
}

bool fv_detection_offer(struct fv_detection *detection, const struct fovea_frame *frame,
                        const struct fv_frame_id *id, const struct fv_seen *seen,
                        bool white_balance)
{
    if (!detection->enabled || fv_detection_waiting(detection)) return false;
    struct fovea_image before, after;
    const enum fovea_status status =
        fv_detect_start(&detection->memory, &frame->images[0], id->stamp_ns, id->sequence);
    if (status != FOVEA_OK) return false;
    if (fv_seen_luma(seen, FV_VIEWER_NETWORKS, &before, &after))
        fv_nn_job_relight(fv_detect_network(&detection->memory), &before, &after);
    if (white_balance) fv_nn_job_balance(fv_detect_network(&detection->memory));
    detection->state->frame = *id;
    detection->state->limits =
        (struct fv_detect_limits){.score = (float)detection->settings.score_threshold,
                                  .iou = (float)detection->settings.iou_threshold,
                                  .count = (int32_t)detection->settings.count_max,
                                  .floor = detection->floor};
    if (detection->gives == 0) detection->state->mapped = 0;
    return true;
}

/* The box in the rectified image around the corners and edge middles of one in the raw image;
 * points that the rectified image does not show are left out. Empty where none is shown. */
static void rectify_box(const struct fv_detection *detection, const struct fovea_camera *camera,
                        const struct fovea_detection *found, float box[4])
{
    const double x[3] = {(double)found->x_min_px,
                         0.5 * ((double)found->x_min_px + (double)found->x_max_px),
                         (double)found->x_max_px};
    const double y[3] = {(double)found->y_min_px,
                         0.5 * ((double)found->y_min_px + (double)found->y_max_px),
                         (double)found->y_max_px};
    const double cosine = fv_cos((double)found->angle), sine = fv_sin((double)found->angle);
    double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
    for (int i = 0; i < 9; i++) {
        double at[2];
        const double dx = x[i % 3] - x[1], dy = y[i / 3] - y[1];
        const double px = found->angle == 0.0f ? x[i % 3] : x[1] + cosine * dx - sine * dy,
                     py = found->angle == 0.0f ? y[i / 3] : y[1] + sine * dx + cosine * dy;
        if (i == 4 || !fv_rectified_from_raw(&detection->rectified, camera, px, py, at)) continue;
        for (int k = 0; k < 2; k++) {
            low[k] = at[k] < low[k] ? at[k] : low[k];
            high[k] = at[k] > high[k] ? at[k] : high[k];
        }
    }
    const bool shown = high[0] > low[0] && high[1] > low[1];
    for (int k = 0; k < 2; k++) {
        box[k] = shown ? (float)low[k] : 0.0f;
        box[2 + k] = shown ? (float)high[k] : 0.0f;
    }
}

/* One unit of boxes; true when all are done. */
static bool map_some(struct fv_detection *detection, const struct fovea_camera *camera)
{
    struct fv_detection_state *state = detection->state;
    uint32_t count, uncertain;
    const struct fovea_detection *found = fv_detect_found(&detection->memory, &count, &uncertain);
    const uint32_t end =
        count - state->mapped > BOXES_PER_UNIT ? state->mapped + BOXES_PER_UNIT : count;
    for (; state->mapped < end; state->mapped++) {
        float *box = state->rectified[state->mapped];
        memset(box, 0, 4 * sizeof *box);
        if (detection->has_rectified) rectify_box(detection, camera, &found[state->mapped], box);
    }
    return state->mapped == count;
}

/* The network alone; then each message takes a unit. */
static bool advance_raw(struct fv_detection *detection, const struct fv_kernels *kernels,
                        uint32_t units, uint32_t *done)
{
    const struct fv_nn_job *nn = fv_detect_network(&detection->memory);
    if (!fv_nn_job_done(nn) && fv_nn_job_advance(nn, kernels, units, done) != FOVEA_OK)
        return false;
    if (*done == units) return false;
    ++*done;
    return true;
}

bool fv_detection_advance(struct fv_detection *detection, const struct fovea_config *config,
                          const struct fv_kernels *kernels, uint32_t units, uint32_t *done)
{
    struct fv_detection_state *state = detection->state;
    *done = 0;
    if (!fv_detection_waiting(detection) || units == 0) return false;
    if (detection->gives == 0) return advance_raw(detection, kernels, units, done);
    if (state->mapping == FV_DETECTION_SENDING) {
        ++*done;
        return true;
    }
    if (state->mapping == FV_DETECTION_IDLE) {
        detection->memory.limits = state->limits;
        if (fv_detect_advance(&detection->memory, kernels, units, done) != FOVEA_OK) return false;
        state->mapping = FV_DETECTION_MAPPING;
        state->mapped = 0;
    }
    while (*done < units) {
        ++*done;
        if (fv_detection_sends(detection, FV_DETECTION_BOXES) &&
            !map_some(detection, &config->rig.cameras[0].camera))
            continue;
        state->mapping =
            (detection->gives & FV_DETECT_MASK) != 0 ? FV_DETECTION_SENDING : FV_DETECTION_IDLE;
        state->found_frame = state->frame;
        state->inferences++;
        return true;
    }
    return false;
}

/* ---- what was found -------------------------------------------------------------------------- */

static void names_of(const struct fv_detection *detection, const struct fovea_detection *found,
                     uint32_t count, const char **names)
{
    for (uint32_t i = 0; i < count; i++)
        names[i] = fv_detect_label(&detection->model, found[i].class_id);
}

/* The next message of a raw network's outputs; the last one ends the inference. */
static uint32_t encode_raw(struct fv_detection *detection, uint8_t *buffer, size_t capacity)
{
    struct fv_detection_state *state = detection->state;
    const struct fv_nn_job *nn = fv_detect_network(&detection->memory);
    const fovea_stamp_t stamp = fv_frame_id_stamp(&state->frame);
    const uint32_t bytes =
        fv_tensors_encode(&detection->model, fv_nn_job_arena(nn), &stamp, &state->mapped,
                          detection->message_scratch, buffer, capacity);
    if (state->mapped < fv_tensors_bytes(&detection->model)) return bytes;
    fv_nn_job_end(nn);
    state->found_frame = state->frame;
    state->inferences++;
    return bytes;
}

static uint32_t encode_boxes(const struct fv_detection *detection,
                             const struct fovea_config *config, uint32_t reset_counter,
                             uint8_t *buffer, size_t capacity)
{
    const char *names[FOVEA_DETECTIONS_MAX];
    uint32_t count, uncertain;
    const struct fovea_detection *found = fv_detect_found(&detection->memory, &count, &uncertain);
    names_of(detection, found, count, names);
    const struct fv_message_detections message = {
        .stamp = fv_frame_id_stamp(&detection->state->found_frame),
        .reset_counter = reset_counter,
        .model = fv_model_name(&detection->model),
        .width = config->rig.cameras[0].camera.width,
        .height = config->rig.cameras[0].camera.height,
        .rectified_shape = detection->has_rectified ? (int8_t)detection->rectified.shape : -1,
        .rectified = {detection->rectified.fx, detection->rectified.fy, detection->rectified.cx,
                      detection->rectified.cy},
        .count = count,
        .detections = found,
        .names = names,
        .rectified_boxes = detection->state->rectified,
    };
    return fv_message_detections_encode(&message, detection->message_scratch, buffer, capacity);
}

static uint32_t encode_keypoints(const struct fv_detection *detection,
                                 const struct fovea_config *config, uint8_t *buffer,
                                 size_t capacity)
{
    const char *names[FOVEA_DETECTIONS_MAX];
    struct fovea_detections found;
    fv_detection_get(detection, &found);
    names_of(detection, found.list, found.set_count, names);
    const struct fv_message_keypoints message = {
        .stamp = fv_frame_id_stamp(&detection->state->found_frame),
        .model = fv_model_name(&detection->model),
        .width = config->rig.cameras[0].camera.width,
        .height = config->rig.cameras[0].camera.height,
        .count = found.set_count,
        .point_count = found.point_count,
        .detections = found.list,
        .names = names,
        .points = found.points,
    };
    return fv_message_keypoints_encode(&message, detection->message_scratch, buffer, capacity);
}

static uint32_t encode_classes(const struct fv_detection *detection, uint8_t *buffer,
                               size_t capacity)
{
    const char *names[FOVEA_DETECTIONS_MAX];
    uint32_t count, uncertain;
    const struct fovea_detection *found = fv_detect_found(&detection->memory, &count, &uncertain);
    count = least_u32(count, FV_MESSAGE_CLASSES_MAX);
    names_of(detection, found, count, names);
    const struct fv_message_classes message = {
        .stamp = fv_frame_id_stamp(&detection->state->found_frame),
        .model = fv_model_name(&detection->model),
        .count = count,
        .detections = found,
        .names = names,
    };
    return fv_message_classes_encode(&message, buffer, capacity);
}

/* The next rows of the mask; the last ones make the network free. */
static uint32_t encode_mask(struct fv_detection *detection, uint8_t *buffer, size_t capacity)
{
    struct fv_detection_state *state = detection->state;
    struct fovea_segmentation seen;
    fv_detect_segmentation(&detection->memory, &seen);
    struct fv_message_segmentation message = {.stamp = fv_frame_id_stamp(&state->found_frame),
                                              .model = fv_model_name(&detection->model),
                                              .seen = &seen};
    for (uint32_t i = 0; i < seen.count; i++)
        message.names[i] = fv_detect_label(&detection->model, seen.list[i].class_id);
    const uint32_t bytes = fv_message_segmentation_encode(
        &message, &state->mask_row, detection->message_scratch, buffer, capacity);
    if (state->mask_row < seen.height) return bytes;
    state->mapping = FV_DETECTION_IDLE;
    state->mask_row = 0;
    return bytes;
}

uint32_t fv_detection_encode(struct fv_detection *detection, enum fv_detection_message message,
                             const struct fovea_config *config, uint32_t reset_counter,
                             uint8_t *buffer, size_t capacity)
{
    switch (message) {
    case FV_DETECTION_BOXES:
        return encode_boxes(detection, config, reset_counter, buffer, capacity);
    case FV_DETECTION_KEYPOINTS:
        return encode_keypoints(detection, config, buffer, capacity);
    case FV_DETECTION_CLASSES:
        return encode_classes(detection, buffer, capacity);
    case FV_DETECTION_SEGMENTATION:
        return encode_mask(detection, buffer, capacity);
    default:
        return encode_raw(detection, buffer, capacity);
    }
}

void fv_detection_get(const struct fv_detection *detection, struct fovea_detections *detections)
{
    memset(detections, 0, sizeof *detections);
    if (!detection->enabled || detection->state->inferences == 0) return;
    uint32_t count, uncertain;
    const struct fovea_detection *found = fv_detect_found(&detection->memory, &count, &uncertain);
    *detections = (struct fovea_detections){
        .inferences = detection->state->inferences,
        .stamp_ns = detection->state->found_frame.stamp_ns,
        .sequence = detection->state->found_frame.sequence,
        .count = count,
        .uncertain = uncertain,
        .list = found,
        .set_count = least_u32(count, (uint32_t)fv_detect_sets_max(&detection->model)),
        .point_count = points_of(detection),
        .points = fv_detect_points(&detection->memory),
    };
}

void fv_detection_get_segmentation(const struct fv_detection *detection,
                                   struct fovea_segmentation *segmentation)
{
    memset(segmentation, 0, sizeof *segmentation);
    if (!detection->enabled || (detection->gives & FV_DETECT_MASK) == 0 ||
        detection->state->inferences == 0)
        return;
    fv_detect_segmentation(&detection->memory, segmentation);
    segmentation->inferences = detection->state->inferences;
    segmentation->stamp_ns = detection->state->found_frame.stamp_ns;
    segmentation->sequence = detection->state->found_frame.sequence;
}

bool fv_detection_has_mask(const struct fv_detection *detection,
                           struct fovea_segmentation *segmentation)
{
    fv_detection_get_segmentation(detection, segmentation);
    return segmentation->inferences > 0 && !fv_detect_decoding(&detection->memory);
}

const char *fv_detection_label(const struct fv_detection *detection, int32_t class_id)
{
    return detection->enabled ? fv_detect_label(&detection->model, class_id) : "";
}
