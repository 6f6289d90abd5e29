/* Motion JPEG from a camera: the decoder with its own memory gives the bits of the ordinary one,
 * makes no heap call, and lets no damaged frame through or keep anything of it. `test_mjpeg N`
 * decodes N damaged frames (default 300). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/decode.h"
#include "app/run/heap.h"
#include "common/datasets.h"
#include "common/fake_camera.h"
#include "common/live_source.h"

enum { W = 320, H = 240, PICTURES = 4, STRIDE = 320, DAMAGED = 300 };

static uint32_t damaged_frames = DAMAGED;

/* ---- pictures -------------------------------------------------------------------------------- */

static char *const folder = fv_test_place;
static struct {
    uint8_t *data;
    size_t bytes;
} pictures[PICTURES]; /* grey, colour, RGB and progressive */
static uint8_t expected[H * STRIDE], found[H * STRIDE];

static int make_pictures(void **state)
{
    static uint8_t samples[W * H * 3];
    if (fv_test_place_set_up(state) != 0) return -1;
    for (uint32_t i = 0; i < PICTURES; i++) {
        const char *path = fv_test_path(folder, "picture.jpg");
        const int32_t channels = i == 0 ? 1 : 3;
        fv_test_picture(i, W, H, channels, samples);
        fv_test_write_jpeg(path, W, H, channels, i == 3, i == 2, samples);
        pictures[i].data = fv_test_read(path, &pictures[i].bytes);
    }
    return 0;
}

static int drop_pictures(void **state)
{
    for (int i = 0; i < PICTURES; i++)
        free(pictures[i].data);
    return fv_test_place_tear_down(state);
}

static const struct fv_decode_image into = {
    .pixels = found, .width = W, .height = H, .stride_bytes = STRIDE};
static const struct fv_decode_image reference = {
    .pixels = expected, .width = W, .height = H, .stride_bytes = STRIDE};

/* The picture without its Huffman tables (FF C4), as most cameras send it. */
static size_t without_tables(const uint8_t *data, size_t bytes, uint8_t *out)
{
    size_t used = 2, at = 2;
    memcpy(out, data, 2);
    while (at + 4 <= bytes && data[at] == 0xff && data[at + 1] != 0xda) {
        const size_t length = 2 + (size_t)data[at + 2] * 256 + data[at + 3];
        if (data[at + 1] != 0xc4) {
            memcpy(out + used, data + at, length);
            used += length;
        }
        at += length;
    }
    memcpy(out + used, data + at, bytes - at);
    return used + bytes - at;
}

static uint64_t random_state = 1;
static uint32_t draw(uint32_t below)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)((random_state >> 33) % below);
}

/* One of the ways in which frames are damaged on their way. */
static size_t damage(const uint8_t *data, size_t bytes, uint8_t *out)
{
    memcpy(out, data, bytes);
    switch (draw(5)) {
    case 0:
        return draw((uint32_t)bytes); /* cut off */
    case 1:                           /* bytes changed anywhere */
        for (uint32_t i = 0, n = 1 + draw(20); i < n; i++)
            out[draw((uint32_t)bytes)] = (uint8_t)draw(256);
        return bytes;
    case 2: { /* a packet lost */
        const size_t at = draw((uint32_t)bytes), lost = 1 + draw(600),
                     end = at + lost < bytes ? at + lost : bytes;
        memmove(out + at, out + end, bytes - end);
        return bytes - (end - at);
    }
    case 3: /* a packet of zeros, or of ones */
        memset(out + draw((uint32_t)bytes - 64), draw(2) ? 0 : 255, 64);
        return bytes;
    default: /* the header */
        for (uint32_t i = 0; i < 3; i++)
            out[draw(200)] ^= (uint8_t)(1u << draw(8));
        return bytes;
    }
}

/* ---- tests ----------------------------------------------------------------------------------- */

static void test_same_bits(void **state)
{
    (void)state;
    struct fv_jpeg_decoder *decoder;
    struct fovea_error error = {.text = ""};
    assert_int_equal(fv_jpeg_decoder_open(W, &decoder, &error), FOVEA_OK);
    for (int round = 0; round < 3; round++)
        for (int i = 0; i < PICTURES - 1; i++) {
            assert_int_equal(
                fv_decode_jpeg(pictures[i].data, pictures[i].bytes, &reference, &error), FOVEA_OK);
            memset(found, round, sizeof found);
            fv_heap_arm();
            const enum fovea_status status =
                fv_jpeg_decode(decoder, pictures[i].data, pictures[i].bytes, &into, &error);
            fv_heap_disarm();
            assert_true(fv_heap_calls() == 0);
            if (status != FOVEA_OK) fail_msg("picture %d: %s", i, error.text);
            assert_memory_equal(expected, found, sizeof found);
        }
    assert_int_equal(fv_jpeg_decode(decoder, pictures[3].data, pictures[3].bytes, &into, &error),
                     FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "several scans"));
    size_t most, all = fv_jpeg_decoder_bytes(decoder, &most);
    assert_true(most > 10000 && most < all);
    print_message("of %zu bytes %zu were needed for %d columns\n", all, most, W);
    fv_jpeg_decoder_close(decoder);
}

static void test_tables_left_out(void **state)
{
    (void)state;
    struct fv_jpeg_decoder *decoder;
    struct fovea_error error = {.text = ""};
    uint8_t *bare = malloc(pictures[1].bytes);
    const size_t bytes = without_tables(pictures[1].data, pictures[1].bytes, bare);
    assert_true(bytes < pictures[1].bytes - 300);
    assert_int_equal(fv_jpeg_decoder_open(W, &decoder, &error), FOVEA_OK);
    assert_int_equal(fv_decode_jpeg(pictures[1].data, pictures[1].bytes, &reference, &error),
                     FOVEA_OK);
    if (fv_jpeg_decode(decoder, bare, bytes, &into, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_memory_equal(expected, found, sizeof found);
    fv_jpeg_decoder_close(decoder);
    free(bare);
}

/* After each damaged picture a good one without tables has its own bits. */
static void test_damaged(void **state)
{
    (void)state;
    struct fv_jpeg_decoder *decoder;
    struct fovea_error error = {.text = ""}, reason;
    uint32_t refused = 0;
    uint8_t *bad = malloc(pictures[1].bytes), *bare = malloc(pictures[1].bytes);
    const size_t bare_bytes = without_tables(pictures[1].data, pictures[1].bytes, bare);
    assert_int_equal(fv_jpeg_decoder_open(W, &decoder, &error), FOVEA_OK);
    assert_int_equal(fv_decode_jpeg(pictures[1].data, pictures[1].bytes, &reference, &error),
                     FOVEA_OK);
    for (uint32_t i = 0; i < damaged_frames; i++) {
        const size_t bytes = damage(pictures[1].data, pictures[1].bytes, bad);
        fv_heap_arm();
        if (fv_jpeg_decode(decoder, bad, bytes, &into, &reason) != FOVEA_OK) {
            refused++;
            assert_true(strlen(reason.text) > 5 && strchr(reason.text, '\n') == NULL);
        }
        fv_heap_disarm();
        assert_true(fv_heap_calls() == 0);
        if (i % 8 != 0) continue;
        assert_int_equal(fv_jpeg_decode(decoder, bare, bare_bytes, &into, &error), FOVEA_OK);
        assert_memory_equal(expected, found, sizeof found);
    }
    print_message("%u of %u damaged pictures were refused\n", refused, damaged_frames);
    assert_true(refused >
                damaged_frames / 2); /* the others decode: a changed coefficient is a picture too */
    fv_jpeg_decoder_close(decoder);
    free(bad);
    free(bare);
}

/* Through the whole source: every other frame is cut off or ends in the middle. */
static size_t fill_damaged(uint32_t index, uint8_t *data, size_t capacity)
{
    const size_t bytes = pictures[1].bytes;
    assert_true(bytes <= capacity);
    memcpy(data, pictures[1].data, bytes);
    return index % 2 == 1 ? 20 + bytes * (index % 13) / 14 : bytes;
}

static void test_source(void **state)
{
    (void)state;
    const uint32_t frames = damaged_frames / 2;
    struct fovea_error error;
    assert_int_equal(fv_decode_jpeg(pictures[1].data, pictures[1].bytes, &reference, &error),
                     FOVEA_OK);
    fake_begin();
    struct fake_camera *camera = fake_new();
    camera->fill = fill_damaged;
    camera->rate_hz = 0;
    camera->width = W;
    camera->height = H;
    fake_plug(camera, "/dev/video0");
    struct fovea_source *source = fv_test_start("/dev/video0?format=MJPG");
    for (uint32_t i = 0; i < frames; i++) {
        const struct fovea_frame frame = fv_test_next_frame(source);
        assert_int_equal(frame.images[0].format, FOVEA_PIXEL_GREY8);
        assert_true(frame.sequence % 2 == 0);
        for (int32_t y = 0; y < H && i < 20; y++)
            assert_memory_equal(frame.images[0].data + (ptrdiff_t)y * frame.images[0].stride_bytes,
                                expected + y * STRIDE, W);
    }
    const struct fovea_source_counts counts = fv_test_counts(source);
    assert_true(counts.delivered == frames && counts.damaged >= frames - 1 &&
                counts.recovered == 0);
    assert_true(fv_test_complains_of(source, "damaged JPEG"));
    fv_test_finish(source);
    fake_end();
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_bits),
        cmocka_unit_test(test_tables_left_out),
        cmocka_unit_test(test_damaged),
        cmocka_unit_test(test_source),
    };
    if (argc > 1) damaged_frames = (uint32_t)atoi(argv[1]);
    return cmocka_run_group_tests(tests, make_pictures, drop_pictures);
}
