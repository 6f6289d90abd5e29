/* fovea features, match, rectify, image, edges and detect on a drawn picture, and on wrong input.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "app/lab/commands.h"
#include "fovea/extract.h"
#include "support/picture.h"
#include "common/nn_mutant.h"
#include "base/elementary.h"

enum { WIDTH = 400, HEIGHT = 300 };

static char folder[] = "/tmp/fovea-picture-XXXXXX";
static char in[64], out[64], camera[64];

static int set_up(void **state)
{
    (void)state;
    static uint8_t pixels[WIDTH * HEIGHT];
    struct fv_random random;
    struct fovea_error error;
    if (mkdtemp(folder) == NULL) return -1;
    snprintf(in, sizeof in, "%s/in.png", folder);
    snprintf(out, sizeof out, "%s/out.png", folder);
    snprintf(camera, sizeof camera, "%s/camera.yaml", folder);
    fv_random_seed(&random, 2);
    memset(pixels, 90, sizeof pixels);
    for (int n = 0; n < 400; n++) {
        const int x = (int)fv_random_below(&random, WIDTH - 24),
                  y = (int)fv_random_below(&random, HEIGHT - 24);
        const int grey = (int)fv_random_below(&random, 256),
                  size = 5 + (int)fv_random_below(&random, 18);
        for (int row = y; row < y + size; row++)
            memset(pixels + row * WIDTH + x, grey, (size_t)size);
    }
    const struct fovea_image image = {pixels,       WIDTH, HEIGHT, WIDTH, FOVEA_PIXEL_GREY8,
                                      sizeof pixels};
    if (fv_picture_write(in, &image, &error) != FOVEA_OK) return -1;
    FILE *file = fopen(camera, "w");
    if (file == NULL) return -1;
    fprintf(
        file,
        "image_width: %d\nimage_height: %d\ncamera_matrix:\n  data: [300, 0, 200, 0, 300, 150, 0, 0, 1]\n"
        "distortion_model: plumb_bob\ndistortion_coefficients:\n  data: [-0.2, 0.03, 0, 0, 0]\n",
        WIDTH, HEIGHT);
    return fclose(file);
}

static int tear_down(void **state)
{
    (void)state;
    unlink(in);
    unlink(out);
    unlink(camera);
    return rmdir(folder);
}

/* Run a command with up to 11 arguments, ended by NULL. */
static int call(int (*command)(int, char **), const char *const arguments[])
{
    char copies[12][128], *argv[13];
    int argc = 0;
    for (; arguments[argc] != NULL; argc++) {
        snprintf(copies[argc], sizeof copies[argc], "%s", arguments[argc]);
        argv[argc] = copies[argc];
    }
    argv[argc] = NULL;
    return command(argc, argv);
}
#define CALL(command, ...) call(command, (const char *const[]){__VA_ARGS__, NULL})

static void size_of(const char *path, int width, int height)
{
    struct fovea_image image;
    struct fovea_error error;
    assert_int_equal(fv_picture_read(path, &image, &error), FOVEA_OK);
    assert_int_equal(image.width, width);
    assert_int_equal(image.height, height);
    free((void *)(uintptr_t)image.data);
    unlink(path);
}

static void commands_write_pictures(void **state)
{
    (void)state;
    assert_int_equal(CALL(fv_command_features, "features", in, "--draw", out), FV_EXIT_OK);
    size_of(out, WIDTH, HEIGHT);
    assert_int_equal(CALL(fv_command_features, "features", in, "--draw", out, "--method", "sift"),
                     FV_EXIT_OK);
    size_of(out, WIDTH, HEIGHT);
    assert_int_equal(CALL(fv_command_match, "match", in, in, "--draw", out), FV_EXIT_OK);
    size_of(out, 2 * WIDTH, HEIGHT);
    assert_int_equal(
        CALL(fv_command_match, "match", in, in, "--method", "sift", "--geometry", "homography"),
        FV_EXIT_OK);
    /* Builds with SURF=no refuse it. */
    struct fovea_extract_config surf;
    fovea_extract_config_default(&surf, FOVEA_FEATURES_SURF);
    const enum fv_exit expected =
        fovea_extract_size(&surf, WIDTH, HEIGHT, NULL) > 0 ? FV_EXIT_OK : FV_EXIT_WRONG;
    assert_int_equal(CALL(fv_command_features, "features", in, "--method", "surf"), expected);
    assert_int_equal(
        CALL(fv_command_match, "match", in, in, "--method", "surf", "--geometry", "homography"),
        expected);
    assert_int_equal(CALL(fv_command_match, "match", in, in, "--geometry", "essential", "--focal",
                          "300", "--draw", out),
                     FV_EXIT_OK);
    size_of(out, 2 * WIDTH, HEIGHT);
    assert_int_equal(CALL(fv_command_rectify, "rectify", in, out, "--camera", camera), FV_EXIT_OK);
    size_of(out, WIDTH, HEIGHT);
    assert_int_equal(
        CALL(fv_command_rectify, "rectify", in, out, "--camera", camera, "--size", "320x200"),
        FV_EXIT_OK);
    size_of(out, 320, 200);
    assert_int_equal(
        CALL(fv_command_image, "image", in, out, "--operations", "denoise,normalize,sharpen"),
        FV_EXIT_OK);
    size_of(out, WIDTH, HEIGHT);
    assert_int_equal(CALL(fv_command_edges, "edges", in, out, "--method", "canny", "--norm", "l2"),
                     FV_EXIT_OK);
    size_of(out, WIDTH, HEIGHT);
    assert_int_equal(CALL(fv_command_segments, "segments", in, out, "--min-length", "9", "--json"),
                     FV_EXIT_OK);
    size_of(out, WIDTH, HEIGHT);
    assert_int_equal(
        CALL(fv_command_rectify, "rectify", in, out, "--camera", camera, "--shape", "cylinder"),
        FV_EXIT_OK);
    size_of(out, WIDTH, HEIGHT);
}

static void wrong_input_is_reported(void **state)
{
    (void)state;
    assert_int_equal(CALL(fv_command_features, "features", "nowhere.png"), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_features, "features", camera), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_features, "features", in, "--max", "0"), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_features, "features", in, "--ignore", "4,4,2"), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_features, "features", in, "--method", "shift"), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_features, "features", in, "--levels", "9"), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_features, "features", in, "--distance", "257"), FV_EXIT_WRONG);
    assert_int_equal(
        CALL(fv_command_features, "features", in, "--method", "sift", "--descriptor", "binary"),
        FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_features, "features", in, "--draw", "/nowhere/x.png"),
                     FV_EXIT_FAILED);
    assert_int_equal(CALL(fv_command_match, "match", in), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_match, "match", in, in, "--ratio", "0"), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_match, "match", in, in, "--matcher", "flann"), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_match, "match", in, in, "--geometry", "essential"),
                     FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_match, "match", in, in, "--geometry", "epipolar"),
                     FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_image, "image", in, out), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_image, "image", in, out, "--operations", "denoise,blur"),
                     FV_EXIT_WRONG);
    assert_int_equal(
        CALL(fv_command_image, "image", in, out, "--operations", "denoise", "--size", "4"),
        FV_EXIT_WRONG);
    assert_int_equal(
        CALL(fv_command_image, "image", in, out, "--operations", "gamma", "--gamma", "x"),
        FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_segments, "segments", in, out, "--min-length", "long"),
                     FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_segments, "segments", in, in), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_edges, "edges", in, out, "--method", "kanny"), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_edges, "edges", in, out, "--low", "200"), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_edges, "edges", in, out, "--high", "1e9"), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_image, "image", in, in, "--operations", "gamma"),
                     FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_image, "image", in, out, "--operations", "white_balance"),
                     FV_EXIT_WRONG); /* grey */
    assert_int_equal(CALL(fv_command_rectify, "rectify", in, out), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_rectify, "rectify", in, out, "--camera", in), FV_EXIT_WRONG);
    assert_int_equal(
        CALL(fv_command_rectify, "rectify", in, out, "--camera", camera, "--shape", "cube"),
        FV_EXIT_WRONG);
    assert_int_equal(
        CALL(fv_command_rectify, "rectify", in, out, "--camera", camera, "--size", "9x9"),
        FV_EXIT_WRONG);
    assert_int_not_equal(access(out, F_OK), 0);
}

static size_t bytes_of(const char *path, uint8_t *bytes, size_t size)
{
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    const size_t count = fread(bytes, 1, size, file);
    fclose(file);
    return count;
}

/* A picture that was cut off anywhere is refused with a line, by both of the ways to read it. */
static void damaged_pictures_are_reported(void **state)
{
    static uint8_t bytes[1 << 20];
    char cut[80];
    (void)state;
    snprintf(cut, sizeof cut, "%s/cut.png", folder);
    FILE *file = fopen(in, "rb");
    assert_non_null(file);
    const size_t whole = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    for (size_t eighths = 1; eighths < 8; eighths++) {
        file = fopen(cut, "wb");
        assert_non_null(file);
        assert_int_equal(fwrite(bytes, whole * eighths / 8, 1, file), 1);
        fclose(file);
        struct fovea_image image;
        struct fovea_error error;
        assert_int_equal(fv_picture_read_colour(cut, &image, &error), FOVEA_ERROR_INPUT);
        assert_int_equal(CALL(fv_command_image, "image", cut, out, "--operations", "denoise"),
                         FV_EXIT_WRONG);
    }
    unlink(cut);
}

static void put32(uint8_t *at, uint32_t value)
{
    for (int i = 0; i < 4; i++)
        at[i] = (uint8_t)(value >> 8 * i);
}

/* A BMP of 64 x 64 pixels, of 24 bits, of 32 from the top, or of 8 with a palette. */
static size_t make_bmp(uint8_t *bmp, int bits, const uint8_t rgb[64 * 64][3])
{
    const uint32_t palette = bits == 8 ? 1024 : 0, row = 64u * (uint32_t)bits / 8,
                   start = 54 + palette;
    memset(bmp, 0, start);
    bmp[0] = 'B';
    bmp[1] = 'M';
    put32(bmp + 10, start);
    put32(bmp + 14, 40);
    put32(bmp + 18, 64);
    put32(bmp + 22, bits == 32 ? (uint32_t)-64 : 64);
    bmp[28] = (uint8_t)bits;
    for (uint32_t i = 0; i < palette / 4; i++) /* index i is the level 255 - i */
        memset(bmp + 54 + 4 * (size_t)i, (int)(255 - i), 3);
    for (uint32_t i = 0; i < 64 * 64; i++) {
        const uint32_t y = i / 64, from_file = bits == 32 ? y : 63 - y;
        uint8_t *to = bmp + start + (size_t)from_file * row + (size_t)(i % 64) * (size_t)bits / 8;
        for (int c = 0; bits > 8 && c < 3; c++)
            to[c] = rgb[i][2 - c];
        if (bits == 8) to[0] = (uint8_t)(255 - rgb[i][0]);
    }
    return start + (size_t)64 * row;
}

/* Every command reads the same formats: the pixels of a BMP are those of the PNG. */
static void all_formats_give_the_same_pixels(void **state)
{
    (void)state;
    static uint8_t rgb[64 * 64][3], bmp[1 << 15];
    char path[80];
    struct fovea_error error;
    struct fovea_image png, read;
    snprintf(path, sizeof path, "%s/picture", folder);
    for (int grey = 0; grey < 2; grey++) {
        for (int i = 0; i < 64 * 64; i++)
            for (int c = 0; c < 3; c++)
                rgb[i][c] = (uint8_t)(i * (grey ? 7 : 7 + c) + i / 64);
        const struct fovea_image image = {&rgb[0][0], 64, 64, 192, FOVEA_PIXEL_RGB24, sizeof rgb};
        enum fovea_status (*const readers[])(const char *, struct fovea_image *,
                                             struct fovea_error *) = {fv_picture_read,
                                                                      fv_picture_read_colour};
        for (int reader = 0; reader < 2; reader++)
            for (int bits = grey ? 8 : 24; bits <= 32; bits += grey ? 16 : 8) {
                assert_int_equal(fv_picture_write(out, &image, &error), FOVEA_OK);
                assert_int_equal(readers[reader](out, &png, &error), FOVEA_OK);
                const size_t bytes = make_bmp(bmp, bits, (const uint8_t(*)[3])rgb);
                for (size_t short_by = 0; short_by < 2; short_by++) {
                    FILE *file = fopen(path, "wb");
                    assert_non_null(file);
                    assert_int_equal(fwrite(bmp, bytes - short_by, 1, file), 1);
                    fclose(file);
                    if (short_by > 0)
                        assert_int_equal(readers[reader](path, &read, &error), FOVEA_ERROR_INPUT);
                    else
                        assert_int_equal(readers[reader](path, &read, &error), FOVEA_OK);
                    if (short_by > 0) continue;
                    assert_int_equal(read.size_bytes, png.size_bytes);
                    assert_memory_equal(read.data, png.data, png.size_bytes);
                    free((void *)(uintptr_t)read.data);
                }
                free((void *)(uintptr_t)png.data);
            }
    }
    unlink(path);
    unlink(out);
}

/* With white balance the colours are kept; the operations beside it change the brightness. */
static void white_balance_is_an_operation(void **state)
{
    (void)state;
    static const uint8_t seen[2][3] = {{200, 100, 50}, {100, 50, 25}};
    static uint8_t rgb[64 * 64][3];
    struct fovea_error error;
    struct fovea_image read;
    char path[80];
    snprintf(path, sizeof path, "%s/warm.png", folder);
    for (int i = 0; i < 64 * 64; i++)
        memcpy(rgb[i], seen[i % 64 / 32], 3);
    const struct fovea_image image = {&rgb[0][0], 64, 64, 192, FOVEA_PIXEL_RGB24, sizeof rgb};
    assert_int_equal(fv_picture_write(path, &image, &error), FOVEA_OK);
    assert_int_equal(CALL(fv_command_image, "image", path, out, "--operations",
                          "white_balance,gamma", "--gamma", "1"),
                     FV_EXIT_OK);
    assert_int_equal(fv_picture_read_colour(out, &read, &error), FOVEA_OK);
    for (int side = 0; side < 2; side++)
        for (int c = 0; c < 3; c++) /* the means, 150, 75 and 37.5, become 87.5 */
            assert_in_range(read.data[side * 3 * 63 + c], side ? 57 : 116, side ? 59 : 117);
    free((void *)(uintptr_t)read.data);
    assert_int_equal(
        CALL(fv_command_image, "image", path, out, "--operations", "normalize,white_balance"),
        FV_EXIT_OK);
    assert_int_equal(fv_picture_read_colour(out, &read, &error), FOVEA_OK);
    assert_int_not_equal(read.data[0], 117);
    free((void *)(uintptr_t)read.data);
    unlink(out);
    unlink(path);
}

/* Also by another name of the same file. */
static void what_is_read_is_never_written_over(void **state)
{
    (void)state;
    static uint8_t before[2][1 << 18], after[1 << 18];
    const char *const kept[2] = {in, camera};
    size_t size[2];
    for (int i = 0; i < 2; i++)
        size[i] = bytes_of(kept[i], before[i], sizeof before[i]);
    assert_int_equal(symlink(in, out), 0);
    assert_int_equal(CALL(fv_command_features, "features", in, "--draw", in), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_features, "features", in, "--draw", out), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_match, "match", in, in, "--draw", in), FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_rectify, "rectify", in, in, "--camera", camera),
                     FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_rectify, "rectify", in, out, "--camera", camera),
                     FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_rectify, "rectify", in, camera, "--camera", camera),
                     FV_EXIT_WRONG);
    unlink(out);
    assert_int_equal(
        CALL(fv_command_rectify, "rectify", in, out, "--camera", camera, "--write-camera", camera),
        FV_EXIT_WRONG);
    /* DIR/in.png is the picture itself. */
    assert_int_equal(CALL(fv_command_detect, "detect", "--model", "src/detect/shipped.fvm",
                          "--draw", folder, in),
                     FV_EXIT_WRONG);
    char drawn[96];
    snprintf(drawn, sizeof drawn, "%s/drawn", folder);
    /* Nor are two pictures of one name drawn into one file; the second is not even looked for. */
    assert_int_equal(CALL(fv_command_detect, "detect", "--model", "src/detect/shipped.fvm",
                          "--draw", drawn, in, "elsewhere/in.jpg"),
                     FV_EXIT_WRONG);
    assert_int_not_equal(access(drawn, F_OK), 0);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(bytes_of(kept[i], after, sizeof after), size[i]);
        assert_memory_equal(before[i], after, size[i]);
    }
}

/* PNG in a file whose name says JPEG would be taken for what it is not. */
static void names_of_other_pictures_are_refused(void **state)
{
    (void)state;
    char other[96];
    snprintf(other, sizeof other, "%s/out.jpg", folder);
    assert_int_equal(CALL(fv_command_rectify, "rectify", in, other, "--camera", camera),
                     FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_segment, "segment", "--model", "src/detect/segmenter.fvm",
                          "--draw", other, in),
                     FV_EXIT_WRONG);
    assert_int_equal(CALL(fv_command_segment, "segment", "--model", "src/detect/segmenter.fvm",
                          "--mask", other, in),
                     FV_EXIT_WRONG);
    assert_int_not_equal(access(other, F_OK), 0);
}

/* Standard output of the child is full: it ends with the status of what could not be written. */
static void lost_output_is_reported(void **state)
{
    (void)state;
    const char *const lines[][6] = {{"fovea", "features", "--json", in},
                                    {"fovea", "match", "--json", in, in},
                                    {"fovea", "config"},
                                    {"fovea", "help"},
                                    {"fovea", "--version"},
                                    {"fovea", "-h"},
                                    {"fovea", "run", "--help"},
                                    {"fovea", "run", "-h"}};
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        fflush(NULL);
        const pid_t child = fork();
        if (child == 0) {
            if (freopen("/dev/full", "w", stdout) == NULL) _exit(99);
            _exit(call(fv_dispatch, lines[i]));
        }
        int status = -1;
        assert_int_equal(waitpid(child, &status, 0), child);
        assert_true(WIFEXITED(status));
        assert_int_equal(WEXITSTATUS(status), FV_EXIT_FAILED);
    }
}

/* A network that gives no boxes is run all the same, and a line says why the lists stay empty. */
static void networks_without_boxes_are_reported(void **state)
{
    (void)state;
    static _Alignas(64) uint8_t model[1 << 14];
    char said[512] = "";
    const size_t bytes = bytes_of("tests/golden/detector.fvm", model, sizeof model);
    const int32_t none = FV_DECODER_NONE;
    memcpy(model + offsetof(struct fv_model_header, decode.kind), &none, sizeof none);
    nn_mutant_seal(model, bytes);
    FILE *file = fopen(camera, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(model, 1, bytes, file), bytes);
    assert_int_equal(fclose(file), 0);
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        if (freopen(out, "w", stderr) == NULL || freopen("/dev/null", "w", stdout) == NULL)
            _exit(99);
        const int code = CALL(fv_command_detect, "detect", "--model", camera, in, in);
        fflush(NULL);
        _exit(code);
    }
    int status = -1;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(WEXITSTATUS(status), FV_EXIT_OK);
    bytes_of(out, (uint8_t *)said, sizeof said - 1);
    assert_non_null(strstr(said, "the lists stay empty"));
    assert_ptr_equal(strchr(said, '\n'), said + strlen(said) - 1); /* once */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(commands_write_pictures),
        cmocka_unit_test(wrong_input_is_reported),
        cmocka_unit_test(damaged_pictures_are_reported),
        cmocka_unit_test(all_formats_give_the_same_pixels),
        cmocka_unit_test(white_balance_is_an_operation),
        cmocka_unit_test(what_is_read_is_never_written_over),
        cmocka_unit_test(names_of_other_pictures_are_refused),
        cmocka_unit_test(lost_output_is_reported),
        cmocka_unit_test(networks_without_boxes_are_reported), /* writes over the camera */
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
