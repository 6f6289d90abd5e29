/* Types that later versions fill: at the limits that they name, each fits one packet. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "message/message.h"

#include "fovea_calibration_warning_t.h"
#include "fovea_classes_t.h"
#include "fovea_command_result_t.h"
#include "fovea_recorder_t.h"
#include "fovea_settings_result_t.h"
#include "fovea_edges_t.h"
#include "fovea_grid_t.h"
#include "fovea_height_grid_t.h"
#include "fovea_health_t.h"
#include "fovea_keypoints_t.h"
#include "fovea_lockstep_t.h"
#include "fovea_parameter_result_t.h"
#include "fovea_scan_t.h"
#include "fovea_segmentation_t.h"
#include "fovea_tensors_t.h"
#include "fovea_velocity_command_t.h"

static char text[32768]; /* as long as any text may be */

/* The longest text of at most `bytes` bytes. */
static char *longest(size_t bytes)
{
    return text + sizeof text - 1 - bytes;
}

static int setup(void **state)
{
    (void)state;
    memset(text, 'x', sizeof text - 1);
    return 0;
}

static void assert_fits(const char *type, int bytes)
{
    if (bytes <= 0 || bytes > FV_MESSAGE_PACKET_BYTES - 8 - FV_MESSAGE_CHANNEL_BYTES)
        fail_msg("%s: found %d bytes, expected at most one packet", type, bytes);
}

static void tensors_fit(void **state)
{
    (void)state;
    fovea_tensor_t list[FOVEA_TENSORS_T_COUNT_MAX];
    memset(list, 0, sizeof list);
    for (int i = 0; i < FOVEA_TENSORS_T_COUNT_MAX; i++) {
        list[i].name = longest(63);
        list[i].dimension_count = 6;
    }
    list[0].size_bytes = FOVEA_TENSORS_T_BYTES_MAX;
    const fovea_tensors_t message = {
        .model = longest(63), .count = FOVEA_TENSORS_T_COUNT_MAX, .tensors = list};
    assert_fits("tensors_t", fovea_tensors_t_encoded_size(&message));
}

static void segmentations_fit(void **state)
{
    (void)state;
    fovea_segment_class_t classes[FOVEA_SEGMENTATION_T_CLASSES_MAX];
    memset(classes, 0, sizeof classes);
    for (int i = 0; i < FOVEA_SEGMENTATION_T_CLASSES_MAX; i++)
        classes[i].class_name = longest(63);
    const fovea_segmentation_t message = {.model = longest(63),
                                          .class_count = FOVEA_SEGMENTATION_T_CLASSES_MAX,
                                          .classes = classes,
                                          .run_count = FOVEA_SEGMENTATION_T_RUNS_MAX,
                                          .confidence_count = FOVEA_SEGMENTATION_T_RUNS_MAX};
    assert_fits("segmentation_t", fovea_segmentation_t_encoded_size(&message));
}

static void keypoints_fit(void **state)
{
    (void)state;
    enum { EACH = FOVEA_KEYPOINTS_T_POINTS_MAX / FOVEA_KEYPOINTS_T_COUNT_MAX };
    static float point[2];
    float *rows[EACH];
    fovea_keypoint_set_t sets[FOVEA_KEYPOINTS_T_COUNT_MAX];
    memset(sets, 0, sizeof sets);
    for (int i = 0; i < EACH; i++)
        rows[i] = point;
    for (int i = 0; i < FOVEA_KEYPOINTS_T_COUNT_MAX; i++) {
        sets[i].class_name = longest(63);
        sets[i].point_count = EACH;
        sets[i].p_px = rows;
    }
    const fovea_keypoints_t message = {
        .model = longest(63), .count = FOVEA_KEYPOINTS_T_COUNT_MAX, .sets = sets};
    assert_fits("keypoints_t", fovea_keypoints_t_encoded_size(&message));
}

static void classes_fit(void **state)
{
    (void)state;
    fovea_class_score_t classes[FOVEA_CLASSES_T_COUNT_MAX];
    memset(classes, 0, sizeof classes);
    for (int i = 0; i < FOVEA_CLASSES_T_COUNT_MAX; i++)
        classes[i].class_name = longest(63);
    const fovea_classes_t message = {
        .model = longest(63), .count = FOVEA_CLASSES_T_COUNT_MAX, .classes = classes};
    assert_fits("classes_t", fovea_classes_t_encoded_size(&message));
}

static void edges_fit(void **state)
{
    (void)state;
    static float segment[4];
    float *rows[FOVEA_EDGES_T_SEGMENTS_MAX];
    for (int i = 0; i < FOVEA_EDGES_T_SEGMENTS_MAX; i++)
        rows[i] = segment;
    const fovea_edges_t message = {.method = longest(23),
                                   .size_bytes = FOVEA_EDGES_T_BYTES_MAX,
                                   .segment_count = FOVEA_EDGES_T_SEGMENTS_MAX,
                                   .segment_px = rows};
    assert_fits("edges_t", fovea_edges_t_encoded_size(&message));
    assert_true((752 + 7) / 8 * 480 <= FOVEA_EDGES_T_BYTES_MAX); /* EuRoC's images in one */
}

static void grids_and_scans_fit(void **state)
{
    (void)state;
    const fovea_grid_t grid = {.frame = longest(23), .cell_count = FOVEA_GRID_T_CELLS_MAX};
    const fovea_scan_t scan = {.frame = longest(23), .count = FOVEA_SCAN_T_COUNT_MAX};
    assert_fits("grid_t", fovea_grid_t_encoded_size(&grid));
    const fovea_height_grid_t heights = {.frame = longest(23),
                                         .cell_count = FOVEA_HEIGHT_GRID_T_CELLS_MAX};
    assert_fits("height_grid_t", fovea_height_grid_t_encoded_size(&heights));
    assert_fits("scan_t", fovea_scan_t_encoded_size(&scan));
}

static void health_and_calibration_fit(void **state)
{
    (void)state;
    static float mean[2];
    float *rows[FOVEA_CALIBRATION_WARNING_T_CELLS_MAX];
    fovea_health_part_t parts[FOVEA_HEALTH_T_COUNT_MAX];
    memset(parts, 0, sizeof parts);
    for (int i = 0; i < FOVEA_HEALTH_T_COUNT_MAX; i++) {
        parts[i].name = longest(23);
        parts[i].reason = longest(127);
    }
    for (int i = 0; i < FOVEA_CALIBRATION_WARNING_T_CELLS_MAX; i++)
        rows[i] = mean;
    const fovea_health_t health = {.count = FOVEA_HEALTH_T_COUNT_MAX, .parts = parts};
    const fovea_calibration_warning_t warning = {.reason = longest(127),
                                                 .cell_count =
                                                     FOVEA_CALIBRATION_WARNING_T_CELLS_MAX,
                                                 .mean_px = rows};
    assert_fits("health_t", fovea_health_t_encoded_size(&health));
    assert_fits("calibration_warning_t", fovea_calibration_warning_t_encoded_size(&warning));
}

static void commands_and_answers_fit(void **state)
{
    (void)state;
    const fovea_velocity_command_t velocity = {.sequence = 1};
    const fovea_command_result_t command = {.reason = longest(255)};
    const fovea_parameter_result_t parameter = {
        .key = longest(63), .value = longest(1023), .reason = longest(255)};
    const fovea_recorder_t recorder = {.file = longest(127), .reason = longest(255)};
    assert_fits("recorder_t", fovea_recorder_t_encoded_size(&recorder));
    const fovea_settings_result_t settings = {.text = longest(32767), .reason = longest(255)};
    assert_fits("settings_result_t", fovea_settings_result_t_encoded_size(&settings));
    assert_fits("velocity_command_t", fovea_velocity_command_t_encoded_size(&velocity));
    assert_fits("command_result_t", fovea_command_result_t_encoded_size(&command));
    assert_fits("parameter_result_t", fovea_parameter_result_t_encoded_size(&parameter));
}

static void hashes_fit(void **state)
{
    (void)state;
    fovea_named_hash_t list[FOVEA_LOCKSTEP_T_COUNT_MAX];
    memset(list, 0, sizeof list);
    for (int i = 0; i < FOVEA_LOCKSTEP_T_COUNT_MAX; i++)
        list[i].name = longest(63);
    const fovea_lockstep_t message = {.stage_count = FOVEA_LOCKSTEP_T_COUNT_MAX,
                                      .stages = list,
                                      .message_count = FOVEA_LOCKSTEP_T_COUNT_MAX,
                                      .messages = list};
    assert_fits("lockstep_t", fovea_lockstep_t_encoded_size(&message));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tensors_fit),
        cmocka_unit_test(segmentations_fit),
        cmocka_unit_test(keypoints_fit),
        cmocka_unit_test(classes_fit),
        cmocka_unit_test(edges_fit),
        cmocka_unit_test(grids_and_scans_fit),
        cmocka_unit_test(health_and_calibration_fit),
        cmocka_unit_test(commands_and_answers_fit),
        cmocka_unit_test(hashes_fit),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
