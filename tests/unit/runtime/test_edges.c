/* The job of edges: what it sends equals the edges of the frame of its stamp, however the work is
 * divided, and in as many messages as a large image needs. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/grey_frame.h"
#include "fovea/fovea.h"
#include "fovea/segments.h"
#include "message/fields.h"
#include "message/message.h"

#include "fovea_edges_t.h"

enum { WIDTH = 803, HEIGHT = 601, ROW_BYTES = (WIDTH + 7) / 8, FRAMES = 30 };

static uint8_t picture[FRAMES][WIDTH * HEIGHT];
static struct fovea_config config;
static struct fovea_error error;

static void draw(uint8_t *to, int frame)
{
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const int dx = x - 300 - 7 * frame, dy = y - 250;
            to[y * WIDTH + x] =
                (uint8_t)(dx * dx + dy * dy < 14000 ? 200 - (x + y) % 60
                                                    : (x / 40 + y / 30) % 2 * 70 + 20);
        }
}

static int setup(void **state)
{
    (void)state;
    for (int i = 0; i < FRAMES; i++)
        draw(picture[i], i);
    fovea_config_default(&config);
    config.rig.cameras[0].camera = (struct fovea_camera){
        .width = WIDTH, .height = HEIGHT, .fx = 400, .fy = 400, .cx = 400, .cy = 300};
    config.odometry.enabled = false;
    config.preview.period_frames = 0;
    return fovea_camera_prepare(&config.rig.cameras[0].camera, &error) == FOVEA_OK ? 0 : -1;
}

static void *memory_of(size_t bytes)
{
    void *memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
    assert_non_null(memory);
    return memory;
}

static void expected_edges(const uint8_t *pixels, uint8_t *bits)
{
    struct fovea_edges *edges;
    const struct fovea_frame frame = grey_frame(pixels, WIDTH, HEIGHT, 0, 0);
    const size_t bytes = fovea_edges_size(&config.edge_job.edges, WIDTH, HEIGHT, &error);
    void *memory = memory_of(bytes);
    assert_int_equal(
        fovea_edges_init(&edges, &config.edge_job.edges, WIDTH, HEIGHT, memory, bytes, &error),
        FOVEA_OK);
    assert_int_equal(fovea_edges_run(edges, &frame.images[0], bits, ROW_BYTES), FOVEA_OK);
    free(memory);
}

/* The segments of the image, as the message has them. */
static void assert_segments(const uint8_t *pixels, const fovea_edges_t *message)
{
    struct fovea_segments *segments;
    struct fovea_segments_found found;
    const struct fovea_segments_config alone = {
        .length_min_px = config.edge_job.segment_length_min_px, .count_max = 600};
    const struct fovea_frame frame = grey_frame(pixels, WIDTH, HEIGHT, 0, 0);
    const size_t bytes = fovea_segments_size(&alone, WIDTH, HEIGHT, &error);
    void *memory = memory_of(bytes);
    assert_int_equal(fovea_segments_init(&segments, &alone, WIDTH, HEIGHT, memory, bytes, &error),
                     FOVEA_OK);
    assert_int_equal(fovea_segments_run(segments, &frame.images[0], &found), FOVEA_OK);
    assert_int_equal(message->segment_count, config.edge_job.segments ? found.count : 0);
    assert_true(found.count > 50);
    for (int32_t i = 0; i < message->segment_count; i++)
        assert_memory_equal(message->segment_px[i], &found.list[i].x0_px, 4 * sizeof(float));
    free(memory);
}

/* What has come of one image. */
struct heard {
    uint8_t bits[ROW_BYTES * HEIGHT];
    int rows, images;
};

static void take(struct heard *heard, const struct fovea_message *sent)
{
    static uint8_t bits[ROW_BYTES * HEIGHT];
    fovea_edges_t message;
    const char *why = NULL;
    size_t at = 0;
    if (!fv_message_check("fovea.edges_t", sent->data, sent->bytes, &why, &at))
        fail_msg("byte %zu: %s", at, why);
    assert_in_range(sent->bytes, 1, FV_MESSAGE_PACKET_BYTES - 8 - FV_MESSAGE_CHANNEL_BYTES);
    assert_int_equal(fovea_edges_t_decode(sent->data, 0, (int)sent->bytes, &message), sent->bytes);
    assert_int_equal(message.first_row, heard->rows);
    assert_int_equal(message.width, WIDTH);
    assert_int_equal(message.height, HEIGHT);
    assert_int_equal(message.size_bytes, message.row_count * ROW_BYTES);
    assert_string_equal(message.method, fovea_edge_method_name(config.edge_job.edges.method));
    assert_true((double)message.high == config.edge_job.edges.high);
    memcpy(heard->bits + heard->rows * ROW_BYTES, message.bits, (size_t)message.size_bytes);
    heard->rows += message.row_count;
    if (heard->rows < HEIGHT) assert_int_equal(message.segment_count, 0);
    if (heard->rows == HEIGHT) {
        assert_segments(picture[message.stamp.sequence], &message);
        expected_edges(picture[message.stamp.sequence], bits);
        assert_memory_equal(heard->bits, bits, sizeof bits);
        assert_int_equal(message.stamp.time_ns, 1000 * (message.stamp.sequence + 1));
        heard->rows = 0;
        heard->images++;
    }
    fovea_edges_t_decode_cleanup(&message);
}

/* Images whose edges were heard, with `units` of work per frame. */
static int images_heard(uint32_t units)
{
    static struct heard heard;
    struct fovea *rt;
    size_t bytes;
    memset(&heard, 0, sizeof heard);
    assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_OK);
    void *memory = memory_of(bytes), *moved = memory_of(bytes);
    assert_int_equal(fovea_init(memory, bytes, &config, &rt, &error), FOVEA_OK);
    for (int i = 0; i < FRAMES; i++) {
        const struct fovea_frame frame =
            grey_frame(picture[i], WIDTH, HEIGHT, 1000 * (i + 1), (uint64_t)i);
        struct fovea_inputs inputs = {.frame = &frame, .now_ns = frame.stamp_ns};
        struct fovea_outputs outputs;
        fovea_grants_fixed(&config, &inputs.grants);
        inputs.grants.units[FOVEA_JOB_EDGES] = units;
        assert_int_equal(fovea_step(rt, &inputs, &outputs), FOVEA_OK);
        for (enum fovea_status status = FOVEA_AGAIN; status == FOVEA_AGAIN;) {
            status = fovea_work(rt, &inputs.grants, &outputs);
            for (uint32_t m = 0; m < outputs.message_count; m++)
                if (strcmp(outputs.messages[m].channel, "FOVEA_EDGES") == 0)
                    take(&heard, &outputs.messages[m]);
            if (units < 1000) break; /* a part of the work, then the next frame */
        }
        if (i != FRAMES / 2) continue;
        assert_int_equal(fovea_copy(rt, moved, bytes, &rt), FOVEA_OK); /* goes on there */
        memset(memory, 0x5a, bytes);
    }
    free(memory);
    free(moved);
    return heard.images;
}

static void edges_are_those_of_the_frame_of_their_stamp(void **state)
{
    (void)state;
    for (int method = 0; method < FOVEA_EDGE_METHOD_COUNT; method++)
        for (int norm = 0; norm < 2; norm++) {
            config.edge_job.period_frames = 3;
            config.edge_job.edges.method = (enum fovea_edge_method)method;
            config.edge_job.edges.norm = (enum fovea_gradient_norm)norm;
            config.edge_job.segments = norm == 1;
            assert_int_equal(images_heard(1000000), FRAMES / 3);
            const int slow = images_heard(norm == 1 ? 60 : 7);
            assert_in_range(slow, 2, FRAMES / 3 - 1);
        }
}

static void without_its_key_the_job_takes_no_memory(void **state)
{
    (void)state;
    size_t with, without;
    config.edge_job.segments = true;
    config.edge_job.period_frames = 1;
    assert_int_equal(fovea_size(&config, &with, &error), FOVEA_OK);
    config.edge_job.period_frames = 0;
    assert_int_equal(fovea_size(&config, &without, &error), FOVEA_OK);
    assert_true(with > without + WIDTH * HEIGHT);
    assert_int_equal(images_heard(1000), 0);
}

static void wrong_thresholds_are_refused(void **state)
{
    (void)state;
    size_t bytes;
    struct fovea_config wrong = config;
    wrong.edge_job.edges.method = FOVEA_EDGES_CANNY;
    wrong.edge_job.edges.low = 200;
    assert_int_equal(fovea_size(&wrong, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_string_equal(error.text,
                        "edges.low: found 200, expected at most edges.high, which is 150");
    wrong = config;
    wrong.edge_job.edges.laplacian_size = 2;
    assert_int_equal(fovea_size(&wrong, &bytes, &error), FOVEA_ERROR_ARGUMENT);
    assert_non_null(strstr(error.text, "edges.laplacian_size"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(edges_are_those_of_the_frame_of_their_stamp),
        cmocka_unit_test(without_its_key_the_job_takes_no_memory),
        cmocka_unit_test(wrong_thresholds_are_refused),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
