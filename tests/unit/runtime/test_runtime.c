/* The runtime: sizes, refusals, determinism, copies, jobs, decimation. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/elementary.h"
#include "common/grey_frame.h"
#include "fovea/fovea.h"
#include "message/fields.h"
#include "message/message.h"

#include "fovea_features_t.h"
#include "fovea_pose_t.h"
#include "fovea_preview_t.h"

enum { WIDTH = 321, HEIGHT = 243 };

static struct fovea_config config;
static struct fovea_error error;
static uint8_t picture[WIDTH * HEIGHT];

static int setup(void **state)
{
    (void)state;
    struct fv_random random;
    fv_random_seed(&random, 11);
    for (int block = 0; block < 600; block++) {
        const uint32_t x = fv_random_below(&random, WIDTH - 20),
                       y = fv_random_below(&random, HEIGHT - 20);
        const uint32_t size = 4 + fv_random_below(&random, 16),
                       grey = fv_random_below(&random, 256);
        for (uint32_t row = y; row < y + size; row++)
            memset(&picture[row * WIDTH + x], (int)grey, size);
    }
    fovea_config_default(&config);
    config.rig.cameras[0].camera = (struct fovea_camera){
        .width = WIDTH, .height = HEIGHT, .fx = 200, .fy = 200, .cx = 160, .cy = 120};
    assert_int_equal(fovea_camera_prepare(&config.rig.cameras[0].camera, &error), FOVEA_OK);
    return 0;
}

struct made {
    void *memory;
    size_t bytes;
    struct fovea *rt;
};

static struct made make(uint8_t fill)
{
    struct made made = {0};
    assert_int_equal(fovea_size(&config, &made.bytes, &error), FOVEA_OK);
    made.memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, made.bytes);
    memset(made.memory, fill, made.bytes);
    assert_int_equal(fovea_init(made.memory, made.bytes, &config, &made.rt, &error), FOVEA_OK);
    return made;
}

static struct fovea_frame frame_at(int64_t stamp_ns)
{
    return grey_frame(picture, WIDTH, HEIGHT, stamp_ns, (uint64_t)(stamp_ns / 1000));
}

static enum fovea_status step(struct fovea *rt, const struct fovea_frame *frame,
                              struct fovea_outputs *outputs)
{
    struct fovea_inputs inputs = {.frame = frame, .now_ns = frame ? frame->stamp_ns : 0};
    fovea_grants_fixed(&config, &inputs.grants);
    return fovea_step(rt, &inputs, outputs);
}

static const struct fovea_message *find(const struct fovea_outputs *outputs, const char *channel)
{
    for (uint32_t i = 0; i < outputs->message_count; i++) {
        if (strcmp(outputs->messages[i].channel, channel) == 0) return &outputs->messages[i];
    }
    return NULL;
}

static void size_and_table_agree(void **state)
{
    (void)state;
    size_t bytes, sum = 0;
    struct fovea_memory_table table;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_OK);
    assert_int_equal(fovea_memory(&config, &table, &error), FOVEA_OK);
    for (uint32_t i = 0; i < table.count; i++)
        sum += table.rows[i].bytes;
    assert_int_equal(sum, bytes);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, bytes);
    struct fovea *rt;
    assert_int_equal(fovea_init(memory, bytes - 1, &config, &rt, &error), FOVEA_ERROR_MEMORY);
    assert_int_equal(fovea_init((uint8_t *)memory + 8, bytes, &config, &rt, &error),
                     FOVEA_ERROR_MEMORY);
    assert_int_equal(fovea_init(memory, bytes, &config, &rt, &error), FOVEA_OK);
    free(memory);
}

static void bad_configurations_are_refused(void **state)
{
    (void)state;
    size_t bytes = 77;
    const struct fovea_config good = config;
    config.features.count_max = 4001;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_string_equal(error.text, "features.count_max: found 4001, expected 100 to 4000");
    config = good;
    config.rig.cameras[0].camera.width = -5;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_string_equal(error.text, "camera width: found -5, expected 64 to 4096");
    config = good;
    config.rig.cameras[0].camera.field_max_rad =
        0; /* as before fovea_camera_prepare: every point would be out of its field */
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "fovea_camera_prepare"));
    config = good;
    config.rig.cameras[0].camera.fy = NAN;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_string_equal(error.text, "camera fy: found nan, expected 0.001 to 1e+06");
    const struct {
        double *value, wrong;
    } of_camera[] = {{&config.rig.cameras[0].camera.fx, 0},
                     {&config.rig.cameras[0].camera.cx, NAN},
                     {&config.rig.cameras[0].camera.cy, 2e5},
                     {&config.rig.cameras[0].camera.fy, INFINITY},
                     {&config.rig.cameras[0].camera.field_max_rad, 4},
                     {&config.rig.cameras[0].camera.field_max_rad, NAN}};
    for (size_t i = 0; i < sizeof of_camera / sizeof of_camera[0]; i++) {
        config = good;
        *of_camera[i].value = of_camera[i].wrong;
        assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    }
    config = good;
    config.rig.cameras[0].T_body_cam[0] = 2;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    config = good;
    config.rig.cameras[0].T_body_cam[0] = -1;
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    config = good;
    memcpy(config.channel_prefix, "a b", 4);
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    config = good;
    assert_int_equal(bytes, 77);
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_OK);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, bytes);
    struct fovea *rt;
    struct fovea_memory_table table;
    assert_int_equal(fovea_size(NULL, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_size(&config, NULL, &error), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_memory(NULL, &table, &error), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_memory(&config, NULL, NULL), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_init(NULL, bytes, &config, &rt, &error), FOVEA_ERROR_MEMORY);
    assert_int_equal(fovea_init(memory, bytes, NULL, &rt, &error), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_init(memory, bytes, &config, NULL, &error), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fovea_camera_prepare(NULL, &error), FOVEA_ERROR_INPUT);
    fovea_map_seal(memory, 0); /* what fovea_map_save returns when there is nothing to save */
    fovea_map_seal(NULL, 0);
    free(memory);
}

static void frames_are_processed_and_odd_ones_refused(void **state)
{
    (void)state;
    struct made made = make(0);
    struct fovea_outputs outputs;
    struct fovea_frame frame = frame_at(1000000);
    assert_int_equal(step(made.rt, &frame, &outputs), FOVEA_OK);
    uint32_t count;
    const struct fovea_feature *features = fovea_features_get(made.rt, &count);
    assert_in_range(count, 100, config.features.count_max);
    for (uint32_t i = 0; i < count; i++) {
        assert_true(features[i].x_px >= 0 && features[i].x_px < WIDTH);
        assert_true(features[i].y_px >= 0 && features[i].y_px < HEIGHT);
    }
    assert_non_null(find(&outputs, "FOVEA_FEATURES"));
    assert_int_equal(step(made.rt, &frame, &outputs), FOVEA_AGAIN); /* the same stamp again */
    frame = frame_at(500000);
    assert_int_equal(step(made.rt, &frame, &outputs), FOVEA_AGAIN); /* back in time */
    frame = frame_at(2000000);
    frame.images[0].width--;
    assert_int_equal(step(made.rt, &frame, &outputs), FOVEA_AGAIN);
    frame = frame_at(2000000);
    frame.images[0].size_bytes--;
    assert_int_equal(step(made.rt, &frame, &outputs), FOVEA_AGAIN);
    frame = frame_at(2000000);
    frame.images[1] = frame.images[0]; /* the second camera's, while the first has none */
    frame.images[0] = (struct fovea_image){.data = NULL};
    frame.image_count = 2;
    assert_int_equal(step(made.rt, &frame, &outputs), FOVEA_AGAIN);
    assert_int_equal(step(made.rt, NULL, &outputs), FOVEA_AGAIN);
    assert_non_null(find(&outputs, "FOVEA_CAMERA_STATUS"));
    assert_null(find(&outputs, "FOVEA_FEATURES"));
    frame = frame_at(2000000);
    assert_int_equal(step(made.rt, &frame, &outputs), FOVEA_OK);

    struct fovea_stats stats;
    fovea_stats_get(made.rt, &stats);
    assert_int_equal(stats.frames_in, 7);
    assert_int_equal(stats.frames_processed, 2);
    assert_int_equal(stats.refused_stamp, 2);
    assert_int_equal(stats.refused_format, 3);
    assert_int_equal(stats.frames_refused, 5);
    assert_int_equal(stats.steps_without_frame, 1);
    free(made.memory);
}

/* Both poses, of that frame, in a state that odometry does not have, without numbers. */
static void assert_paused(const struct fovea_outputs *outputs, const struct fovea_frame *frame)
{
    static const char *const channels[] = {"FOVEA_POSE", "FOVEA_CAMERA_POSE"};
    for (int i = 0; i < 2; i++) {
        const struct fovea_message *message = find(outputs, channels[i]);
        fovea_pose_t pose;
        assert_non_null(message);
        assert_true(fovea_pose_t_decode(message->data, 0, (int)message->bytes, &pose) > 0);
        assert_int_equal(pose.state, FOVEA_POSE_T_STATE_PAUSED);
        assert_int_equal(pose.stamp.time_ns, frame->stamp_ns);
        assert_true(isnan(pose.position[0]) && isnan(pose.orientation[0]) &&
                    isnan(pose.covariance[0]));
        assert_int_equal(pose.reference_keyframe, -1);
        assert_int_equal(pose.inliers, 0);
        fovea_pose_t_decode_cleanup(&pose);
    }
    assert_null(find(outputs, "FOVEA_BOT_CORE_POSE"));
    assert_null(find(outputs, "FOVEA_FEATURES"));
}

static void commands_pause_resume_and_reset(void **state)
{
    (void)state;
    struct made made = make(0);
    struct fovea_outputs outputs;
    struct fovea_frame frame = frame_at(5000000);
    struct fovea_inputs inputs = {.frame = &frame, .commands = FOVEA_COMMAND_PAUSE};
    fovea_grants_fixed(&config, &inputs.grants);
    assert_int_equal(fovea_step(made.rt, &inputs, &outputs), FOVEA_AGAIN);
    assert_paused(&outputs, &frame);
    inputs.commands = 0;
    frame.stamp_ns += 1000;
    assert_int_equal(fovea_step(made.rt, &inputs, &outputs), FOVEA_AGAIN);
    assert_paused(&outputs, &frame);
    inputs.frame = NULL;
    assert_int_equal(fovea_step(made.rt, &inputs, &outputs), FOVEA_AGAIN);
    assert_null(find(&outputs, "FOVEA_POSE"));
    inputs.frame = &frame;
    inputs.commands = FOVEA_COMMAND_RESUME | FOVEA_COMMAND_SAVE;
    assert_int_equal(fovea_step(made.rt, &inputs, &outputs), FOVEA_OK);
    assert_true(outputs.jobs_waiting & 1u << FOVEA_JOB_MAP); /* the map is being saved */
    frame.stamp_ns = 1000;                                   /* after a reset time may start anew */
    inputs.commands = FOVEA_COMMAND_RESET;
    assert_int_equal(fovea_step(made.rt, &inputs, &outputs), FOVEA_OK);
    struct fovea_stats stats;
    fovea_stats_get(made.rt, &stats);
    assert_int_equal(stats.reset_counter, 1);
    assert_int_equal(stats.refused_paused, 2);
    free(made.memory);
}

/* Run both for a while with the same inputs: every message must agree to the byte. */
static void compare_runs(struct fovea *a, struct fovea *b, int first, int steps)
{
    static struct fovea_outputs from_a, from_b;
    for (int i = first; i < first + steps; i++) {
        struct fovea_frame frame = frame_at((i + 1) * 1000000);
        for (int phase = 0; phase < 2; phase++) {
            struct fovea_grants grants;
            fovea_grants_fixed(&config, &grants);
            if (phase == 0) {
                step(a, &frame, &from_a);
                step(b, &frame, &from_b);
            } else {
                fovea_work(a, &grants, &from_a);
                fovea_work(b, &grants, &from_b);
            }
            assert_int_equal(from_a.message_count, from_b.message_count);
            for (uint32_t m = 0; m < from_a.message_count; m++) {
                const struct fovea_message *sent = &from_a.messages[m],
                                           *other = &from_b.messages[m];
                struct fv_difference difference = {
                    .field = "a volatile field"}; /* equal too: there is no clock */
                assert_string_equal(sent->channel, other->channel);
                if (!fv_message_compare(sent->data, sent->bytes, other->data, other->bytes,
                                        &difference) ||
                    memcmp(sent->data, other->data, sent->bytes) != 0)
                    fail_msg("%s: %s: %s, %s", sent->channel, difference.field, difference.expected,
                             difference.found);
            }
        }
        assert_true(fovea_state_hash(a) == fovea_state_hash(b));
    }
}

static void results_do_not_depend_on_what_memory_held(void **state)
{
    (void)state;
    struct made a = make(0x00), b = make(0xff);
    compare_runs(a.rt, b.rt, 0, 30);
    free(a.memory);
    free(b.memory);
}

static void a_copy_goes_on_alone(void **state)
{
    (void)state;
    struct made a = make(0), twin = make(0), b = {0};
    compare_runs(a.rt, twin.rt, 0, 11); /* stop in the middle of a preview */
    b.memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, a.bytes);
    memset(b.memory, 0x77, a.bytes);
    assert_int_equal(fovea_copy(a.rt, b.memory, a.bytes - 1, &b.rt), FOVEA_ERROR_MEMORY);
    assert_int_equal(fovea_copy(a.rt, b.memory, a.bytes, &b.rt), FOVEA_OK);
    memset(a.memory, 0xee, a.bytes); /* nothing may point back */
    compare_runs(twin.rt, b.rt, 11, 30);
    free(a.memory);
    free(b.memory);
    free(twin.memory);
}

/* Each byte of the state counts, in both parts; 64 bytes all over it stand for them. */
static void each_byte_changes_the_hash(void **state)
{
    (void)state;
    struct made a = make(0), b = make(0);
    const size_t bytes = fovea_state_bytes(a.rt), data_begin = bytes / 64;
    uint8_t *data = malloc(bytes);
    assert_non_null(data);
    fovea_state_save(a.rt, data);
    const uint64_t hash = fovea_state_hash(a.rt);
    for (size_t k = 0; k < 64; k++) {
        const size_t at = data_begin + (bytes - 1 - data_begin) * k / 63;
        data[at] ^= 0x40;
        assert_int_equal(fovea_state_load(b.rt, data, bytes, &error), FOVEA_OK);
        assert_true(fovea_state_hash(b.rt) != hash);
        data[at] ^= 0x40;
    }
    assert_int_equal(fovea_state_load(b.rt, data, bytes, &error), FOVEA_OK);
    assert_true(fovea_state_hash(b.rt) == hash);
    free(data);
    free(a.memory);
    free(b.memory);
}

/* A runtime that was given the bytes of another's state goes on as that one does; those of another
 * configuration or length are refused, and change nothing. */
static void a_state_goes_on_in_another(void **state)
{
    (void)state;
    struct made a = make(0), twin = make(0), b = make(0xff);
    const size_t bytes = fovea_state_bytes(a.rt);
    uint8_t *data = malloc(bytes);
    compare_runs(a.rt, twin.rt, 0, 11);
    fovea_state_save(a.rt, data);
    assert_int_equal(fovea_state_load(b.rt, data, bytes - 1, &error), FOVEA_ERROR_INPUT);
    data[0] ^= 1; /* of the layout */
    assert_int_equal(fovea_state_load(b.rt, data, bytes, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "another version or configuration"));
    assert_true(fovea_state_hash(b.rt) != fovea_state_hash(a.rt));
    data[0] ^= 1;
    assert_int_equal(fovea_state_load(b.rt, data, bytes, &error), FOVEA_OK);
    compare_runs(twin.rt, b.rt, 11, 30);
    free(data);
    free(a.memory);
    free(b.memory);
    free(twin.memory);
}

/* Noise at the best quality takes more bytes than a packet holds: it comes at a lower one, not
 * never. */
static void preview_of_noise_comes_too(void **state)
{
    (void)state;
    static uint8_t before[sizeof picture];
    struct fv_random random;
    struct fovea_outputs outputs;
    const struct fovea_preview_config usual = config.preview;
    uint32_t previews = 0, bytes_max = 0;
    memcpy(before, picture, sizeof picture);
    fv_random_seed(&random, 5);
    for (size_t i = 0; i < sizeof picture; i++)
        picture[i] = (uint8_t)fv_random_below(&random, 256);
    config.preview =
        (struct fovea_preview_config){.period_frames = 1, .quality = 100, .level = 0, .cameras = 1};
    struct made made = make(0);
    for (int i = 0; i < 60; i++) {
        struct fovea_frame frame = frame_at((i + 1) * 1000000);
        struct fovea_grants grants;
        step(made.rt, &frame, &outputs);
        fovea_grants_fixed(&config, &grants);
        fovea_work(made.rt, &grants, &outputs);
        const struct fovea_message *message = find(&outputs, "FOVEA_PREVIEW");
        if (message == NULL) continue;
        previews++;
        if (message->bytes > bytes_max) bytes_max = message->bytes;
    }
    assert_in_range(bytes_max + sizeof "FOVEA_PREVIEW" + 8, 40000, FV_MESSAGE_PACKET_BYTES);
    free(made.memory);
    config.preview = usual;
    memcpy(picture, before, sizeof picture);
    assert_true(previews > 0);
}

/* A preview tells the time, number, clock and UTC of the frame that it shows, as the test below
 * gave them. */
static void assert_preview_of(const struct fovea_message *message, int64_t stamp_ns)
{
    fovea_preview_t preview;
    assert_true(fovea_preview_t_decode(message->data, 0, (int)message->bytes, &preview) > 0);
    assert_int_equal(preview.stamp.time_ns, stamp_ns);
    assert_int_equal(preview.stamp.sequence, stamp_ns / 1000);
    assert_int_equal(preview.stamp.clock, FOVEA_CLOCK_BOOTTIME);
    assert_int_equal(preview.stamp.meaning, FOVEA_STAMP_EXPOSURE_END);
    assert_int_equal(preview.stamp.utc_offset_ns, 12345);
    fovea_preview_t_decode_cleanup(&preview);
}

static void preview_takes_the_granted_units_and_keeps_its_stamp(void **state)
{
    (void)state;
    config.preview.period_frames = 40;
    struct made made = make(0);
    struct fovea_outputs outputs;
    int previews = 0, works = 0;
    for (int i = 0; i < 100; i++) {
        struct fovea_frame frame = frame_at((i + 1) * 1000000);
        frame.clock = FOVEA_CLOCK_BOOTTIME;
        frame.stamp_meaning = FOVEA_STAMP_EXPOSURE_END;
        struct fovea_inputs inputs = {
            .frame = &frame, .now_ns = frame.stamp_ns, .utc_offset_ns = 12345};
        fovea_grants_fixed(&config, &inputs.grants);
        fovea_step(made.rt, &inputs, &outputs);
        const bool waiting = (outputs.jobs_waiting & 1u << FOVEA_JOB_PREVIEW) != 0;
        struct fovea_grants grants = {.units = {[FOVEA_JOB_PREVIEW] = 2}};
        fovea_work(made.rt, &grants, &outputs);
        assert_true(outputs.units_done[FOVEA_JOB_PREVIEW] <= 2);
        assert_true(waiting == (outputs.units_done[FOVEA_JOB_PREVIEW] > 0));
        works += waiting;
        const struct fovea_message *preview = find(&outputs, "FOVEA_PREVIEW");
        if (preview != NULL) assert_preview_of(preview, (40 * previews + 1) * 1000000);
        previews += preview != NULL;
    }
    assert_int_equal(previews, 3);
    assert_true(works > 9);
    config.preview.period_frames = 10;
    free(made.memory);
}

static void masked_pixels_give_no_features(void **state)
{
    (void)state;
    uint8_t *mask = malloc(WIDTH * HEIGHT);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        mask[i] = i % WIDTH < WIDTH / 2 ? 0 : 255;
    config.rig.cameras[0].mask = mask;
    struct made made = make(0);
    free(mask); /* the runtime has its own copy */
    config.rig.cameras[0].mask = NULL;
    struct fovea_outputs outputs;
    struct fovea_frame frame = frame_at(1000000);
    step(made.rt, &frame, &outputs);
    uint32_t count;
    const struct fovea_feature *features = fovea_features_get(made.rt, &count);
    assert_true(count > 50);
    for (uint32_t i = 0; i < count; i++)
        assert_true(features[i].x_px > WIDTH / 2 - 2);
    free(made.memory);
}

/* More than one message holds: the pieces follow each other and are of this frame. */
static void many_features_are_sent_in_pieces(void **state)
{
    (void)state;
    enum { SIDE = 640, HIGH = 480 };
    const struct fovea_config usual = config;
    uint8_t *noise = malloc(SIDE * HIGH);
    struct fv_random random;
    fv_random_seed(&random, 5);
    for (int i = 0; i < SIDE * HIGH; i++)
        noise[i] = (uint8_t)fv_random_below(&random, 256);
    config.rig.cameras[0].camera = (struct fovea_camera){
        .width = SIDE, .height = HIGH, .fx = 400, .fy = 400, .cx = 320, .cy = 240};
    assert_int_equal(fovea_camera_prepare(&config.rig.cameras[0].camera, &error), FOVEA_OK);
    config.features.count_max = FOVEA_FEATURES_MAX;
    config.features.per_cell = 8;
    struct made made = make(0);
    const struct fovea_frame frame = grey_frame(noise, SIDE, HIGH, 1000000, 1);
    struct fovea_outputs outputs;
    uint32_t count;
    int32_t sent = 0;
    step(made.rt, &frame, &outputs);
    const struct fovea_feature *features = fovea_features_get(made.rt, &count);
    assert_in_range(count, FOVEA_FEATURES_T_COUNT_MAX + 1, FOVEA_FEATURES_MAX);
    for (uint32_t i = 0; i < outputs.message_count; i++) {
        const struct fovea_message *message = &outputs.messages[i];
        fovea_features_t out;
        if (strcmp(message->channel, "FOVEA_FEATURES") != 0) continue;
        assert_int_equal(fovea_features_t_decode(message->data, 0, (int)message->bytes, &out),
                         message->bytes);
        assert_true(out.stamp.time_ns == 1000000 && out.first == sent &&
                    out.total == (int32_t)count);
        for (int32_t k = 0; k < out.count; k++)
            assert_true(out.p_px[k][0] == features[sent + k].x_px &&
                        out.response[k] == features[sent + k].score);
        sent += out.count;
        fovea_features_t_decode_cleanup(&out);
    }
    assert_int_equal(sent, count);
    free(made.memory);
    free(noise);
    config = usual;
}

static void decimation_is_kept(void **state)
{
    (void)state;
    config.features_every = 3;
    config.camera_status_every = 0;
    struct made made = make(0);
    int features = 0, status = 0;
    for (int i = 0; i < 30; i++) {
        struct fovea_outputs outputs;
        struct fovea_frame frame = frame_at((i + 1) * 1000000);
        step(made.rt, &frame, &outputs);
        features += find(&outputs, "FOVEA_FEATURES") != NULL;
        status += find(&outputs, "FOVEA_CAMERA_STATUS") != NULL;
    }
    assert_int_equal(features, 10);
    assert_int_equal(status, 0);
    config.features_every = config.camera_status_every = 1;
    free(made.memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(size_and_table_agree),
        cmocka_unit_test(bad_configurations_are_refused),
        cmocka_unit_test(frames_are_processed_and_odd_ones_refused),
        cmocka_unit_test(commands_pause_resume_and_reset),
        cmocka_unit_test(results_do_not_depend_on_what_memory_held),
        cmocka_unit_test(a_copy_goes_on_alone),
        cmocka_unit_test(each_byte_changes_the_hash),
        cmocka_unit_test(a_state_goes_on_in_another),
        cmocka_unit_test(preview_of_noise_comes_too),
        cmocka_unit_test(preview_takes_the_granted_units_and_keeps_its_stamp),
        cmocka_unit_test(masked_pixels_give_no_features),
        cmocka_unit_test(many_features_are_sent_in_pieces),
        cmocka_unit_test(decimation_is_kept),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
