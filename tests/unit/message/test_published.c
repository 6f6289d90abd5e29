/* Messages about poses, detections, objects and the map: every field that goes in comes out, what
 * is not known says so, and the largest message of each kind fits one packet. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "message/fields.h"
#include "message/message.h"

#include "fovea_classes_t.h"
#include "fovea_detections_t.h"
#include "fovea_keypoints_t.h"
#include "fovea_features_t.h"
#include "fovea_map_t.h"
#include "fovea_objects_t.h"
#include "fovea_pose_t.h"

static const fovea_stamp_t stamp = {
    .time_ns = 1234567890123, .clock = 1, .meaning = 2, .utc_offset_ns = -5, .sequence = 77};

/* As long as a packet allows, and well-formed. */
static void assert_fits_packet(const char *type, const uint8_t *data, size_t bytes)
{
    const char *why = NULL;
    size_t at = 0;
    assert_in_range(bytes, 1, FV_MESSAGE_PACKET_BYTES - 8 - FV_MESSAGE_CHANNEL_BYTES);
    if (!fv_message_check(type, data, bytes, &why, &at))
        fail_msg("%s: byte %zu: %s", type, at, why);
}

static void count_up(double *values, int count, double from)
{
    for (int i = 0; i < count; i++)
        values[i] = from + i;
}

static void assert_counts_up(const double *values, int count, double from)
{
    for (int i = 0; i < count; i++)
        assert_true(values[i] == from + i);
}

static void assert_unknown(const double *values, int count)
{
    for (int i = 0; i < count; i++)
        assert_true(isnan(values[i]));
}

static struct fovea_pose posed = {.state = FOVEA_TRACKING_OK,
                                  .posed = true,
                                  .map_scale = 1.5,
                                  .inliers = 321,
                                  .quality = 0.75F,
                                  .reset_counter = 4,
                                  .map_id = 6,
                                  .scale_source = FOVEA_SCALE_WHEEL_ODOMETRY,
                                  .scale = 2.5,
                                  .scale_sigma = 0.125,
                                  .reference_keyframe = 1ULL << 40,
                                  .keyframe_stamp_ns = 987654321};

static struct fv_message_pose pose_input(void)
{
    struct fv_message_pose in = {.stamp = stamp,
                                 .parent_frame = "odom",
                                 .child_frame = "body",
                                 .pose = &posed,
                                 .uncalibrated = true,
                                 .scale_configured = true,
                                 .moving = true,
                                 .change_count = 3,
                                 .change_scale = 0.5,
                                 .latency_ns = 55};
    count_up(in.T_parent_child.position, 3, 10);
    count_up(in.T_parent_child.orientation, 4, 20);
    count_up(in.covariance, 21, 100);
    count_up(in.velocity, 3, 30);
    count_up(in.angular_rate, 3, 40);
    count_up(in.T_keyframe_child.position, 3, 50);
    count_up(in.T_keyframe_child.orientation, 4, 60);
    count_up(in.change.position, 3, 70);
    count_up(in.change.orientation, 4, 80);
    count_up(in.T_map_parent.position, 3, 90);
    count_up(in.T_map_parent.orientation, 4, 200);
    return in;
}

/* Encode and decode; the caller cleans up. */
static fovea_pose_t pose_round_trip(const struct fv_message_pose *in)
{
    uint8_t data[2048];
    fovea_pose_t out;
    const uint32_t bytes = fv_message_pose_encode(in, data, fv_message_pose_size_max());
    assert_int_equal(fv_message_pose_encode(in, data, bytes - 1), 0);
    assert_int_equal(fv_message_pose_encode(in, data, bytes), bytes);
    assert_fits_packet("fovea.pose_t", data, bytes);
    assert_int_equal(fovea_pose_t_decode(data, 0, (int)bytes, &out), bytes);
    return out;
}

static void a_pose_comes_back(void **state)
{
    (void)state;
    const struct fv_message_pose in = pose_input();
    fovea_pose_t out = pose_round_trip(&in);
    assert_true(out.stamp.time_ns == stamp.time_ns && out.stamp.sequence == 77);
    assert_int_equal(out.state, FOVEA_POSE_T_STATE_TRACKING);
    assert_true(out.uncalibrated && out.reset_counter == 4 && out.map_id == 6);
    assert_string_equal(out.parent_frame, "odom");
    assert_string_equal(out.child_frame, "body");
    assert_counts_up(out.position, 3, 10);
    assert_counts_up(out.orientation, 4, 20);
    assert_counts_up(out.covariance, 21, 100);
    assert_true(out.quality == 0.75F && out.inliers == 321);
    assert_counts_up(out.velocity, 3, 30);
    assert_counts_up(out.angular_rate, 3, 40);
    assert_true(out.reference_keyframe == 1LL << 40 && out.keyframe_stamp_ns == 987654321);
    assert_counts_up(out.keyframe_position, 3, 50);
    assert_counts_up(out.keyframe_orientation, 4, 60);
    assert_int_equal(out.scale_state, FOVEA_POSE_T_SCALE_METRIC);
    assert_int_equal(out.scale_source, FOVEA_POSE_T_SOURCE_WHEEL_ODOMETRY);
    assert_true(out.scale == 2.5 && out.scale_sigma == 0.125);
    assert_true(out.change_count == 3 && out.change_scale == 0.5);
    assert_counts_up(out.change_position, 3, 70);
    assert_counts_up(out.change_orientation, 4, 80);
    assert_true(out.map_scale == 1.5 && out.latency_ns == 55);
    assert_counts_up(out.map_position, 3, 90);
    assert_counts_up(out.map_orientation, 4, 200);
    fovea_pose_t_decode_cleanup(&out);
}

static void what_is_not_known_says_so(void **state)
{
    (void)state;
    struct fv_message_pose in = pose_input();
    in.moving = false;
    fovea_pose_t out = pose_round_trip(&in);
    assert_counts_up(out.position, 3, 10);
    assert_unknown(out.velocity, 3);
    assert_unknown(out.angular_rate, 3);
    assert_unknown(out.velocity_covariance, 21);
    assert_unknown(out.gyro_bias, 3);
    assert_unknown(out.acceleration_bias, 3);
    assert_unknown(out.bias_covariance, 21);
    assert_unknown(out.gravity, 3);
    assert_unknown(&out.gravity_sigma, 1);
    fovea_pose_t_decode_cleanup(&out);
}

static void without_a_pose_only_state_and_scale_are_known(void **state)
{
    (void)state;
    struct fovea_pose lost = posed;
    struct fv_message_pose in = pose_input();
    lost.state = FOVEA_TRACKING_LOST;
    lost.posed = false;
    in.pose = &lost;
    for (int paused = 0; paused < 2; paused++) {
        if (paused) in.pose = &posed;
        in.paused = paused;
        fovea_pose_t out = pose_round_trip(&in);
        assert_int_equal(out.state, paused ? FOVEA_POSE_T_STATE_PAUSED : FOVEA_POSE_T_STATE_LOST);
        assert_true(out.map_id == -1 && out.reset_counter == 4);
        assert_unknown(out.position, 3);
        assert_unknown(out.orientation, 4);
        assert_unknown(out.covariance, 21);
        assert_unknown(out.velocity, 3);
        assert_unknown(out.angular_rate, 3);
        assert_true(out.reference_keyframe == -1 && out.keyframe_stamp_ns == 0);
        assert_unknown(out.keyframe_position, 3);
        assert_unknown(out.keyframe_orientation, 4);
        assert_int_equal(out.scale_state, FOVEA_POSE_T_SCALE_METRIC);
        assert_true(out.scale == 2.5 && out.scale_sigma == 0.125);
        assert_unknown(&out.map_scale, 1);
        assert_unknown(out.map_position, 3);
        assert_unknown(out.map_orientation, 4);
        fovea_pose_t_decode_cleanup(&out);
    }
}

static void the_scale_is_free_or_initialising_until_it_is_known(void **state)
{
    (void)state;
    struct fovea_pose unscaled = posed;
    struct fv_message_pose in = pose_input();
    unscaled.scale_source = FOVEA_SCALE_FREE;
    unscaled.scale = 1;
    in.pose = &unscaled;
    for (int configured = 0; configured < 2; configured++) {
        in.scale_configured = configured;
        fovea_pose_t out = pose_round_trip(&in);
        assert_int_equal(out.scale_state,
                         configured ? FOVEA_POSE_T_SCALE_INITIALISING : FOVEA_POSE_T_SCALE_FREE);
        assert_int_equal(out.scale_source, FOVEA_POSE_T_SOURCE_NONE);
        assert_true(out.scale == 1);
        assert_unknown(&out.scale_sigma, 1);
        fovea_pose_t_decode_cleanup(&out);
    }
}

static void long_labels_are_cut_between_letters(void **state)
{
    (void)state;
    char label[200], cut[FV_MESSAGE_LABEL_BYTES_MAX];
    memset(label, 'a', sizeof label);
    label[63] = '\0';
    fv_message_label(label, cut);
    assert_string_equal(cut, label);
    label[63] = 'a';
    label[199] = '\0';
    fv_message_label(label, cut);
    assert_int_equal(strlen(cut), 63);
    memcpy(label + 62, "\xe2\x82\xac", 3); /* a letter of three bytes across the end */
    fv_message_label(label, cut);
    assert_int_equal(strlen(cut), 62);
}

/* The largest message of all: 300 detections whose labels are as long as a message holds. */
static void the_most_detections_fit_a_packet(void **state)
{
    (void)state;
    static struct fovea_detection found[FOVEA_DETECTIONS_MAX];
    static float rectified[FOVEA_DETECTIONS_MAX][4];
    static const char *names[FOVEA_DETECTIONS_MAX];
    char label[200];
    memset(label, 'x', sizeof label);
    label[199] = '\0';
    for (int i = 0; i < FOVEA_DETECTIONS_MAX; i++) {
        const float x = (float)i;
        found[i] = (struct fovea_detection){.class_id = i,
                                            .score = 1.0F / (1 + x),
                                            .x_min_px = x,
                                            .y_min_px = x + 1,
                                            .x_max_px = x + 2,
                                            .y_max_px = x + 3};
        for (int k = 0; k < 4; k++)
            rectified[i][k] = x + 4 + (float)k;
        names[i] = i % 2 == 0 ? label : "person";
    }
    const struct fv_message_detections in = {.stamp = stamp,
                                             .reset_counter = 2,
                                             .model = label,
                                             .width = 752,
                                             .height = 480,
                                             .rectified_shape = 1,
                                             .rectified = {1, 2, 3, 4},
                                             .count = FOVEA_DETECTIONS_MAX,
                                             .detections = found,
                                             .names = names,
                                             .rectified_boxes = rectified};
    const size_t bound = fv_message_detections_size_max(FOVEA_DETECTIONS_MAX, 199);
    void *scratch = malloc(fv_message_detections_scratch_bytes(FOVEA_DETECTIONS_MAX, 199));
    uint8_t *data = malloc(bound);
    const uint32_t bytes = fv_message_detections_encode(&in, scratch, data, bound);
    assert_fits_packet("fovea.detections_t", data, bytes);
    assert_true(bytes <= bound && bound <= FV_MESSAGE_PACKET_BYTES - 8 - FV_MESSAGE_CHANNEL_BYTES);
    fovea_detections_t out;
    assert_int_equal(fovea_detections_t_decode(data, 0, (int)bytes, &out), bytes);
    assert_true(out.count == FOVEA_DETECTIONS_MAX && out.reset_counter == 2 &&
                out.rectified_shape == 1 && out.rectified_fx == 1 && out.rectified_cy == 4);
    assert_int_equal(strlen(out.model), FV_MESSAGE_LABEL_BYTES_MAX - 1);
    for (int i = 0; i < out.count; i++) {
        const fovea_detection_t *one = &out.detections[i];
        assert_true(one->class_id == i && one->score == found[i].score &&
                    one->box.x_min_px == found[i].x_min_px &&
                    one->box.y_max_px == found[i].y_max_px &&
                    one->rectified_box.x_min_px == rectified[i][0] &&
                    one->rectified_box.y_max_px == rectified[i][3]);
        assert_int_equal(strlen(one->class_name), i % 2 == 0 ? 63 : 6);
    }
    fovea_detections_t_decode_cleanup(&out);
    free(data);
    free(scratch);
}

/* 30 keypoints of 100 objects, and one object of 3000 keypoints. */
static void the_most_keypoints_fit_a_packet(void **state)
{
    (void)state;
    static struct fovea_detection found[FOVEA_KEYPOINT_SETS_MAX];
    static struct fovea_keypoint points[FOVEA_KEYPOINTS_MAX];
    static const char *names[FOVEA_KEYPOINT_SETS_MAX];
    static const uint32_t sets[2] = {FOVEA_KEYPOINT_SETS_MAX, 1};
    char label[200];
    memset(label, 'x', sizeof label);
    label[199] = '\0';
    for (int i = 0; i < FOVEA_KEYPOINTS_MAX; i++)
        points[i] = (struct fovea_keypoint){(float)i, (float)-i, i % 2 == 0 ? NAN : 0.5F};
    for (int i = 0; i < FOVEA_KEYPOINT_SETS_MAX; i++) {
        found[i] = (struct fovea_detection){
            .class_id = i, .score = 1.0F / (float)(i + 1), .x_min_px = (float)i, .y_max_px = 7};
        names[i] = label;
    }
    for (int k = 0; k < 2; k++) {
        const uint32_t each = FOVEA_KEYPOINTS_MAX / sets[k];
        const struct fv_message_keypoints in = {.stamp = stamp,
                                                .model = label,
                                                .width = 752,
                                                .height = 480,
                                                .count = sets[k],
                                                .point_count = each,
                                                .detections = found,
                                                .names = names,
                                                .points = points};
        const size_t bound = fv_message_keypoints_size_max(sets[k], each);
        void *scratch = malloc(fv_message_keypoints_scratch_bytes(sets[k], each));
        uint8_t *data = malloc(bound);
        const uint32_t bytes = fv_message_keypoints_encode(&in, scratch, data, bound);
        assert_int_equal(bytes, bound);
        assert_fits_packet("fovea.keypoints_t", data, bytes);
        fovea_keypoints_t out;
        assert_int_equal(fovea_keypoints_t_decode(data, 0, (int)bytes, &out), bytes);
        assert_true(out.count == (int)sets[k] && out.width == 752 && out.height == 480);
        for (int i = 0; i < out.count; i++) {
            const fovea_keypoint_set_t *set = &out.sets[i];
            assert_true(set->class_id == i && set->score == found[i].score &&
                        set->box.x_min_px == (float)i && set->box.y_max_px == 7);
            assert_int_equal(set->point_count, each);
            for (int p = 0; p < set->point_count; p++) {
                const int n = i * set->point_count + p;
                assert_true(set->p_px[p][0] == (float)n && set->p_px[p][1] == (float)-n);
                assert_int_equal(isnan(set->point_score[p]), n % 2 == 0);
            }
        }
        fovea_keypoints_t_decode_cleanup(&out);
        free(data);
        free(scratch);
    }
}

static void the_most_classes_come_back(void **state)
{
    (void)state;
    static struct fovea_detection found[FV_MESSAGE_CLASSES_MAX];
    static const char *names[FV_MESSAGE_CLASSES_MAX];
    for (int i = 0; i < FV_MESSAGE_CLASSES_MAX; i++) {
        found[i] = (struct fovea_detection){.class_id = 1000 - i, .score = 0.5F};
        names[i] = i % 2 == 0
                       ? "even"
                       : "a label of more than sixty-three bytes, which a message cuts: here";
    }
    const struct fv_message_classes in = {.stamp = stamp,
                                          .model = "m",
                                          .count = FV_MESSAGE_CLASSES_MAX,
                                          .detections = found,
                                          .names = names};
    uint8_t data[16384];
    assert_in_range(fv_message_classes_size_max(FV_MESSAGE_CLASSES_MAX), 1, sizeof data);
    const uint32_t bytes = fv_message_classes_encode(&in, data, sizeof data);
    assert_fits_packet("fovea.classes_t", data, bytes);
    fovea_classes_t out;
    assert_int_equal(fovea_classes_t_decode(data, 0, (int)bytes, &out), bytes);
    assert_int_equal(out.count, FV_MESSAGE_CLASSES_MAX);
    for (int i = 0; i < out.count; i++) {
        assert_true(out.classes[i].class_id == 1000 - i && out.classes[i].score == 0.5F);
        assert_int_equal(strlen(out.classes[i].class_name), i % 2 == 0 ? 4 : 63);
    }
    fovea_classes_t_decode_cleanup(&out);
}

/* A quarter turn around z and a shift, so that each axis shows where it went. */
static void the_most_objects_fit_a_packet(void **state)
{
    (void)state;
    static struct fovea_object objects[FOVEA_OBJECTS_MAX];
    static const char *names[FOVEA_OBJECTS_MAX];
    char label[200];
    memset(label, 'x', sizeof label);
    label[199] = '\0';
    for (int i = 0; i < FOVEA_OBJECTS_MAX; i++) {
        objects[i] = (struct fovea_object){.id = (uint64_t)i + 1,
                                           .class_id = i,
                                           .state = FOVEA_OBJECT_CONFIRMED,
                                           .score = 0.5F,
                                           .x_min_px = 1,
                                           .y_max_px = 2,
                                           .x_px_s = 3,
                                           .y_px_s = 4,
                                           .hits = 7,
                                           .located = (enum fovea_object_located)(i % 3),
                                           .first_ns = stamp.time_ns - 1000,
                                           .seen_ns = stamp.time_ns - 10,
                                           .position_m = {1, 2, 3},
                                           .velocity_m_s = {4, 5, 6},
                                           .covariance_m2 = {1, 0.5, 0.25, 2, 0.125, 3},
                                           .velocity_covariance_m2_s2 = {4, 0, 0, 5, 0, 6}};
        names[i] = label;
    }
    const struct fv_message_objects in = {.stamp = stamp,
                                          .reset_counter = 2,
                                          .width = 752,
                                          .height = 480,
                                          .T_odom_world = {0, -1, 0, 10, 1, 0, 0, 20, 0, 0, 1, 30},
                                          .count = FOVEA_OBJECTS_MAX,
                                          .objects = objects,
                                          .names = names};
    const size_t bound = fv_message_objects_size_max(FOVEA_OBJECTS_MAX, 199);
    void *scratch = malloc(fv_message_objects_scratch_bytes(FOVEA_OBJECTS_MAX, 199));
    uint8_t *data = malloc(bound);
    const uint32_t bytes = fv_message_objects_encode(&in, scratch, data, bound);
    assert_int_equal(bytes, bound);
    assert_fits_packet("fovea.objects_t", data, bytes);
    fovea_objects_t out;
    assert_int_equal(fovea_objects_t_decode(data, 0, (int)bytes, &out), bytes);
    const fovea_object_t *not = &out.objects[0], *camera = &out.objects[1], *odom = &out.objects[2];
    assert_true(out.count == FOVEA_OBJECTS_MAX && odom->id == 3 && odom->hits == 7 &&
                odom->age_ns == 1000 && odom->unseen_ns == 10 && odom->velocity_px_s[1] == 4);
    assert_true(not ->located == 0 && not ->position_m[0] == 0 && not ->covariance_m2[0] == 0);
    assert_int_equal(camera->located, FOVEA_OBJECT_T_LOCATED_CAMERA);
    assert_true(camera->position_m[0] == 1 && camera->covariance_m2[3] == 2);
    assert_int_equal(odom->located, FOVEA_OBJECT_T_LOCATED_ODOM);
    assert_true(odom->position_m[0] == 10 - 2 && odom->position_m[1] == 20 + 1 &&
                odom->position_m[2] == 33);
    assert_true(odom->velocity_m_s[0] == -5 && odom->velocity_m_s[1] == 4 &&
                odom->velocity_m_s[2] == 6);
    static const float turned[6] = {2, -0.5F, -0.125F, 1, 0.25F, 3};
    assert_memory_equal(odom->covariance_m2, turned, sizeof turned);
    assert_true(odom->velocity_covariance_m2_s2[0] == 5 && odom->velocity_covariance_m2_s2[3] == 4);
    fovea_objects_t_decode_cleanup(&out);
    free(data);
    free(scratch);
}

static void the_largest_piece_of_the_map_comes_back(void **state)
{
    (void)state;
    static struct fv_message_map in = {.stamp = {.sequence = 5},
                                       .map_id = 2,
                                       .own_scale = 3,
                                       .own = {{1, 2, 3}, {4, 5, 6, 7}},
                                       .landmark_slots = 1000,
                                       .landmark_last = FV_MESSAGE_MAP_LANDMARKS,
                                       .keyframe_slots = 128,
                                       .keyframe_last = FV_MESSAGE_MAP_KEYFRAMES,
                                       .landmark_count = FV_MESSAGE_MAP_LANDMARKS,
                                       .keyframe_count = FV_MESSAGE_MAP_KEYFRAMES};
    for (int i = 0; i < FV_MESSAGE_MAP_LANDMARKS; i++)
        in.landmarks[i] = (struct fv_message_landmark){i, i % 3, {(float)i, 1, 2}};
    for (int i = 0; i < FV_MESSAGE_MAP_KEYFRAMES; i++)
        in.keyframes[i] = (struct fv_message_keyframe){.slot = i,
                                                       .map_id = 2,
                                                       .parent = i - 1,
                                                       .number = 100 + i,
                                                       .stamp_ns = 1000 + i,
                                                       .position = {(float)i, 3, 4},
                                                       .orientation = {5, 6, 7, 8}};
    uint8_t data[16384];
    const uint32_t bytes = fv_message_map_encode(&in, data, sizeof data);
    assert_int_equal(bytes, fv_message_map_size_max());
    assert_fits_packet("fovea.map_t", data, bytes);
    fovea_map_t out;
    assert_int_equal(fovea_map_t_decode(data, 0, (int)bytes, &out), bytes);
    assert_true(out.own_scale == 3 && out.own_position[2] == 3 && out.own_orientation[3] == 7);
    for (int i = 0; i < out.landmark_count; i++)
        assert_true(out.landmark_slot[i] == i && out.landmark_map[i] == i % 3 &&
                    out.landmark_p[i][0] == (float)i && out.landmark_p[i][2] == 2);
    for (int i = 0; i < out.keyframe_count; i++) {
        const fovea_keyframe_t *one = &out.keyframes[i];
        assert_true(one->slot == i && one->map_id == 2 && one->parent == i - 1 &&
                    one->number == 100 + i && one->stamp_ns == 1000 + i &&
                    one->position[0] == (float)i && one->orientation[3] == 8);
    }
    fovea_map_t_decode_cleanup(&out);
}

/* The bounds that the runtime carves by. */
static void every_kind_fits_a_packet(void **state)
{
    (void)state;
    const size_t sizes[] = {fv_message_pose_size_max(),
                            fv_message_bot_core_pose_size(),
                            fv_message_statistics_size_max(),
                            fv_message_camera_status_size_max(),
                            fv_message_imu_status_size_max(),
                            fv_message_map_size_max(),
                            fv_message_features_size_max(FOVEA_FEATURES_T_COUNT_MAX),
                            fv_message_objects_size_max(FOVEA_OBJECTS_MAX, 1000),
                            fv_message_detections_size_max(FOVEA_DETECTIONS_MAX, 1000),
                            fv_message_keypoints_size_max(FOVEA_KEYPOINT_SETS_MAX, 30),
                            fv_message_keypoints_size_max(1, FOVEA_KEYPOINTS_MAX),
                            fv_message_classes_size_max(FV_MESSAGE_CLASSES_MAX),
                            fv_message_segmentation_size_max(),
                            fv_message_edges_size_max()};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++)
        assert_in_range(sizes[i], 1, FV_MESSAGE_PACKET_BYTES - 8 - FV_MESSAGE_CHANNEL_BYTES);
}

/* docs/messages.md shows every type as it is; tests run in the project's folder. */
static void the_manual_shows_every_type(void **state)
{
    (void)state;
    if (getenv("FOVEA_EMULATED") != NULL) {
        puts("SKIPPED the_manual_shows_every_type: no shell under an emulator");
        return;
    }
    if (system("tools/messages_md.sh | cmp -s - docs/messages.md") != 0)
        fail_msg(
            "docs/messages.md: found older types, expected those of include/lcmtypes: make docs");
}

int main(void)
{
    fv_message_prepare();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pose_comes_back),
        cmocka_unit_test(what_is_not_known_says_so),
        cmocka_unit_test(without_a_pose_only_state_and_scale_are_known),
        cmocka_unit_test(the_scale_is_free_or_initialising_until_it_is_known),
        cmocka_unit_test(long_labels_are_cut_between_letters),
        cmocka_unit_test(the_most_detections_fit_a_packet),
        cmocka_unit_test(the_most_keypoints_fit_a_packet),
        cmocka_unit_test(the_most_classes_come_back),
        cmocka_unit_test(the_most_objects_fit_a_packet),
        cmocka_unit_test(the_largest_piece_of_the_map_comes_back),
        cmocka_unit_test(every_kind_fits_a_packet),
        cmocka_unit_test(the_manual_shows_every_type),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
