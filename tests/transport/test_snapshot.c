/* `fovea snapshot` as a whole program, in a network of the test's own: the file is the picture that
 * was sent, what is no picture is passed over, and a file that was there stays until a whole one
 * replaces it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/watched.h"
#include "image/jpeg.h"
#include "support/decode.h"
#include "support/picture.h"
#include "support/text.h"

#include "fovea_preview_t.h"

enum { WIDTH = 96, HEIGHT = 64, JPEG_BYTES = 20000 };

static struct watched watched;
static char folder[] = "/tmp/fovea_snapshot_XXXXXX", path[64], picture[64];
static uint8_t jpeg[JPEG_BYTES], decoded[WIDTH * HEIGHT];
static size_t jpeg_bytes;
static struct fovea_error error;

/* A gradient as JPEG, and what a reader sees of it. */
static int set_up(void **state)
{
    static uint8_t pixels[WIDTH * HEIGHT];
    struct fv_jpeg encoder;
    struct fv_decode_image to = {
        .pixels = decoded, .width = WIDTH, .height = HEIGHT, .stride_bytes = WIDTH};
    (void)state;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        pixels[i] = (uint8_t)(i % WIDTH * 2 + i / WIDTH);
    const struct fv_plane plane = {pixels, WIDTH, HEIGHT, WIDTH};
    fv_jpeg_start(&encoder, WIDTH, HEIGHT, 80, jpeg, sizeof jpeg);
    while (!fv_jpeg_encode(&encoder, &plane, 1000, jpeg)) {
    }
    jpeg_bytes = encoder.used;
    if (encoder.overflow || fv_decode(jpeg, jpeg_bytes, &to, &error) != FOVEA_OK) return -1;
    if (mkdtemp(folder) == NULL) return -1;
    snprintf(path, sizeof path, "%s/now.jpg", folder);
    snprintf(picture, sizeof picture, "%s/now.png", folder);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    remove(path);
    remove(picture);
    return rmdir(folder);
}

static void send(const char *channel, const uint8_t *data, size_t bytes)
{
    uint8_t message[JPEG_BYTES + 1000];
    const fovea_preview_t preview = {.stamp = {.time_ns = 1500000000, .sequence = 45},
                                     .width = WIDTH,
                                     .height = HEIGHT,
                                     .scale = 2.0736,
                                     .size_bytes = (int32_t)bytes,
                                     .jpeg = (uint8_t *)(uintptr_t)data};
    const int size = fovea_preview_t_encode(message, 0, sizeof message, &preview);
    assert_true(size > 0);
    watched_send(channel, message, (size_t)size);
}

/* Start, and send what is no picture, then the picture, until the program has one; its line. */
static const char *taken(const char *const *arguments, const char *channel)
{
    static char text[1024];
    uint8_t broken[JPEG_BYTES];
    memcpy(broken, jpeg, jpeg_bytes);
    memset(broken + 2, 0, 40); /* no header follows the mark */
    watched_start(&watched, "snapshot", arguments);
    while (!watched_readable(&watched, 20)) {
        send("OTHER_POSE", jpeg, jpeg_bytes);
        send(channel, (const uint8_t *)"GIF89a", 6);
        send(channel, broken, jpeg_bytes);
        send(channel, jpeg, jpeg_bytes);
    }
    assert_true(watched_line(&watched, text, sizeof text));
    assert_int_equal(watched_end(&watched), 0);
    return text;
}

static void the_file_is_the_picture_as_it_was_sent(void **state)
{
    (void)state;
    char *text;
    size_t bytes;
    const char *const arguments[] = {path, NULL};
    const char *line = taken(arguments, "LEFT_PREVIEW");
    assert_non_null(strstr(line, "96 x 64 pixels of LEFT_PREVIEW, frame 45 at 1.500 s, 2.07 raw"));
    assert_int_equal(fv_text_read(path, 1 << 20, &text, &bytes, &error), FOVEA_OK);
    assert_int_equal(bytes, jpeg_bytes);
    assert_memory_equal(text, jpeg, bytes);
    free(text);
}

static void a_png_holds_its_pixels(void **state)
{
    (void)state;
    struct fovea_image image;
    const char *const arguments[] = {picture, "--prefix", "LEFT", NULL};
    taken(arguments, "LEFT_PREVIEW");
    assert_int_equal(fv_picture_read(picture, &image, &error), FOVEA_OK);
    assert_true(image.width == WIDTH && image.height == HEIGHT && image.stride_bytes == WIDTH);
    assert_memory_equal(image.data, decoded, sizeof decoded);
    free((void *)(uintptr_t)image.data);
}

static void without_a_picture_the_file_stays(void **state)
{
    (void)state;
    char *text;
    size_t bytes;
    const char *const other[] = {path, "--prefix", "RIGHT", "--timeout", "1", NULL};
    const char *const name[] = {"now.gif", NULL};
    const char *const away[] = {"/nowhere/now.jpg", NULL};
    FILE *file = fopen(path, "w");
    assert_true(file != NULL && fputs("kept", file) >= 0 && fclose(file) == 0);
    watched_start(&watched, "snapshot", other);
    for (int i = 0; i < 20; i++) {
        send("LEFT_PREVIEW", jpeg, jpeg_bytes);
        send("RIGHT_PREVIEW", (const uint8_t *)"GIF89a", 6);
        usleep(10000);
    }
    assert_int_equal(watched_end(&watched), 1);
    assert_int_equal(fv_text_read(path, 1 << 20, &text, &bytes, &error), FOVEA_OK);
    assert_string_equal(text, "kept");
    free(text);
    watched_start(&watched, "snapshot", name);
    assert_int_equal(watched_end(&watched), 2);
    watched_start(&watched, "snapshot", away);
    assert_int_not_equal(watched_end(&watched), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_file_is_the_picture_as_it_was_sent),
        cmocka_unit_test(a_png_holds_its_pixels),
        cmocka_unit_test(without_a_picture_the_file_stays),
    };
    if (!watched_possible("test_snapshot")) return 0;
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
