/* The job of the one or two networks that find objects or label pixels, or whose raw outputs are
 * sent; of the objects that follow from the detections of the first; and of the free space that
 * follows from the masks of one. */
#include "runtime/config.h"
#include "runtime/jobs.h"

static bool waiting(const struct fovea *rt)
{
    return fv_detection_waiting(&rt->detection) || fv_detection_waiting(&rt->detection2) ||
           fv_free_space_waiting(&rt->free_space);
}

/* Objects take the detections; what moves on its own is kept out of the map from now on. */
static void update_objects(struct fovea *rt, struct fovea_outputs *outputs)
{
    struct fovea_detections detections;
    struct fovea_box movable[FOVEA_INPUT_BOXES_MAX];
    fv_detection_get(&rt->detection, &detections);
    fv_object_stage_update(&rt->objects, &detections);
    fv_output_add(rt, FV_MESSAGE_OBJECTS,
                  fv_object_stage_encode(&rt->objects, &rt->config, &rt->detection,
                                         fv_reset_counter(rt),
                                         rt->outbox.buffer[FV_MESSAGE_OBJECTS],
                                         rt->outbox.capacity[FV_MESSAGE_OBJECTS]),
                  outputs);
    if (!rt->config.odometry.enabled || !fv_config_movable(&rt->config)) return;
    fv_boxes_take(&rt->boxes, detections.stamp_ns, movable,
                  fv_object_stage_movable(&rt->objects, movable));
}

/* Whether the outputs of this work call hold a message of this network. */
static bool is_sent(const struct fovea *rt, int network, const struct fovea_outputs *outputs)
{
    for (uint32_t i = 0; i < outputs->message_count; i++) {
        for (int m = 0; m < FV_DETECTION_MESSAGE_COUNT; m++) {
            const enum fv_message_kind kind =
                fv_detection_kind((enum fv_detection_message)m, network);
            if (outputs->messages[i].data == rt->outbox.buffer[kind]) return true;
        }
    }
    return false;
}

static void send(struct fovea *rt, struct fv_detection *detection, int network,
                 struct fovea_outputs *outputs)
{
    for (int i = 0; i < FV_DETECTION_MESSAGE_COUNT; i++) {
        const enum fv_detection_message message = (enum fv_detection_message)i;
        if (!fv_detection_due(detection, message)) continue;
        const enum fv_message_kind kind = fv_detection_kind(message, network);
        const uint32_t bytes =
            fv_detection_encode(detection, message, &rt->config, fv_reset_counter(rt),
                                rt->outbox.buffer[kind], rt->outbox.capacity[kind]);
        fv_output_add(rt, kind, bytes, outputs);
    }
}

/* Returns the units done; `*complete`: an inference is complete and messages went to the outputs;
 * the rest of a mask follows in later calls. */
static uint32_t advance_one(struct fovea *rt, struct fv_detection *detection, int network,
                            uint32_t units, bool *complete, struct fovea_outputs *outputs)
{
    uint32_t done = 0;
    *complete = false;
    if (is_sent(rt, network, outputs)) return 0; /* a raw network may have more to send */
    const bool due = fv_detection_advance(detection, &rt->config, &rt->kernels, units, &done);
    *complete = due && fv_detection_due(detection, FV_DETECTION_BOXES);
    if (due) send(rt, detection, network, outputs);
    return done;
}

static uint32_t advance_first(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    bool complete;
    const uint32_t done = advance_one(rt, &rt->detection, 0, units, &complete, outputs);
    if (complete && rt->objects.enabled) update_objects(rt, outputs);
    return done;
}

/* ---- free space ------------------------------------------------------------------------------ */

/* The network whose masks make the grid: the first that gives nothing but masks. */
static struct fv_detection *labeller(struct fovea *rt)
{
    return rt->detection.gives == FV_DETECT_MASK ? &rt->detection : &rt->detection2;
}

/* A network keeps its mask until the grid has read it. */
static bool is_kept(struct fovea *rt, const struct fv_detection *detection)
{
    return rt->free_space.enabled && detection == labeller(rt) && detection->enabled &&
           fv_free_space_reads(&rt->free_space, detection->state->inferences);
}

/* A mask that was taken is laid on the floor, which landmarks on it measure first where that is
 * due. Returns the units done. */
static uint32_t lay_on_ground(struct fovea *rt, const struct fovea_segmentation *seen,
                              uint32_t units)
{
    const struct fv_free_space_pose *pose = fv_free_space_taken(&rt->free_space);
    struct fovea_grid_view view = {.seen = seen,
                                   .labels = rt->config.grid_job.labels,
                                   .camera = &rt->config.rig.cameras[0].camera};
    struct fv_ground_plane floor;
    uint32_t done = 0;
    if (pose == NULL) return 0;
    memcpy(view.T_odom_cam, pose->T_odom_cam, sizeof view.T_odom_cam);
    for (; done < units; done++)
        if (!fv_ground_stage_look(&rt->ground, &view, &rt->odometry, &rt->scale, &rt->publish)) {
            const bool known = fv_ground_stage_at(&rt->ground, pose->position_m, &floor);
            fv_free_space_lay(&rt->free_space, known ? &floor : NULL, seen, view.camera,
                              view.labels);
            break;
        }
    return done;
}

static uint32_t advance_free_space(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    struct fv_free_space *stage = &rt->free_space;
    const struct fovea_camera *camera = &rt->config.rig.cameras[0].camera;
    const uint8_t *labels = rt->config.grid_job.labels;
    struct fovea_segmentation seen;
    if (!stage->enabled) return 0;
    if (fv_detection_has_mask(labeller(rt), &seen)) fv_free_space_begin(stage, &seen);
    uint32_t done = lay_on_ground(rt, &seen, units);
    while (done < units && fv_free_space_waiting(stage)) {
        done++;
        if (!fv_free_space_unit(stage, &seen, camera, labels)) continue;
        const enum fv_message_kind kind = fv_free_space_kind(stage);
        fv_output_add(
            rt, kind,
            fv_free_space_encode(stage, rt->outbox.buffer[kind], rt->outbox.capacity[kind]),
            outputs);
        /* One part of a kind per work call: its buffer is in use until the next. */
        if (kind == fv_free_space_kind(stage)) break;
    }
    return done;
}

/* ---- the job --------------------------------------------------------------------------------- */

/* Two networks that have work share the grant: half each, and what one leaves is for the other.
 * Each completes at most one inference per work call: its message's buffer is in use until the
 * next, and it gets its next image from the next step. */
static uint32_t advance_networks(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    bool complete;
    if (!fv_detection_waiting(&rt->detection2)) return advance_first(rt, units, outputs);
    uint32_t done =
        fv_detection_waiting(&rt->detection) ? advance_first(rt, units - units / 2, outputs) : 0;
    done += advance_one(rt, &rt->detection2, 1, units - done, &complete, outputs);
    return done + advance_first(rt, units - done, outputs);
}

/* What is left of an update of the grid comes first, a new one after its mask. */
static uint32_t advance(struct fovea *rt, uint32_t units, struct fovea_outputs *outputs)
{
    if (fv_free_space_waiting(&rt->free_space)) {
        const uint32_t done = advance_free_space(rt, units, outputs);
        return done + advance_networks(rt, units - done, outputs);
    }
    const uint32_t done = advance_networks(rt, units, outputs);
    return done + advance_free_space(rt, units - done, outputs);
}

static void carve(struct fovea *rt, struct fv_carving *carving)
{
    const struct fovea_config *config = &rt->config;
    const struct fovea_camera *camera = &config->rig.cameras[0].camera;
    struct fv_arena *persistent = &carving->arenas[FOVEA_MEMORY_PERSISTENT],
                    *job = &carving->arenas[FOVEA_MEMORY_JOB],
                    *frame = &carving->arenas[FOVEA_MEMORY_FRAME];
    fv_detection_carve(&rt->detection, camera, persistent, job, frame);
    fv_carving_book(carving, "detection");
    fv_detection_carve(&rt->detection2, camera, persistent, job, frame);
    fv_carving_book(carving, "detection2");
    fv_object_stage_carve(&rt->objects, config, &rt->detection, persistent, frame);
    fv_carving_book(carving, "objects");
    fv_free_space_carve(&rt->free_space, &config->grid_job, config->features.count_max, persistent,
                        job, frame);
    fv_ground_stage_carve(&rt->ground, &config->grid_job, persistent, job);
    fv_carving_book(carving, "free space");
}

static bool is_due(const struct fovea_detect_config *config, uint64_t number)
{
    return config->enabled && fv_every(number, config->period_frames);
}

/* True: the network takes the frame. */
static bool offer_to(struct fovea *rt, struct fv_detection *detection,
                     const struct fovea_frame *frame)
{
    const struct fv_seen *seen = fv_front_end_images(&rt->front_end);
    if (is_kept(rt, detection)) return false;
    if (!fv_detection_offer(detection, frame, &rt->state->frame, seen,
                            fv_preprocess_balances(&rt->config.image.preprocess)))
        return false;
    if (detection == labeller(rt) && fv_detection_sends(detection, FV_DETECTION_SEGMENTATION))
        fv_free_space_note(&rt->free_space, &rt->publish, &rt->odometry, &rt->state->frame);
    return true;
}

static void offer(struct fovea *rt, const struct fovea_frame *frame)
{
    const uint64_t number = rt->state->frames_processed - 1;
    fv_ground_stage_follow(&rt->ground, &rt->publish, fv_inertial_stage_known(&rt->inertial));
    fv_free_space_follow(&rt->free_space, &rt->publish);
    if (is_due(&rt->config.detect2, number)) offer_to(rt, &rt->detection2, frame);
    if (!is_due(&rt->config.detect, number) || !offer_to(rt, &rt->detection, frame)) return;
    struct fovea_pose pose;
    fovea_pose_get(rt, &pose);
    fv_object_stage_note(&rt->objects, &pose);
}

static void reset(struct fovea *rt)
{
    fv_detection_reset(&rt->detection);
    fv_detection_reset(&rt->detection2);
    fv_object_stage_reset(&rt->objects);
    fv_free_space_reset(&rt->free_space);
    fv_ground_stage_reset(&rt->ground);
}

/* Min: a millisecond, 300 million multiply-accumulates within 20 frames. Fixed: the shipped
 * detector within two frames, ssd_mobilenet_v1 at 300 x 300 within 7. */
const struct fv_job fv_job_detect = {.key = "detect.model",
                                     .units_min = 4,
                                     .units_fixed = 56,
                                     .waiting = waiting,
                                     .advance = advance,
                                     .carve = carve,
                                     .frame = offer,
                                     .reset = reset};
