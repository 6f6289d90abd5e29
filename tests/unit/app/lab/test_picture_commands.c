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
    assert_int_equal(CALL(fv_command_image, "image", in, out, "--white-balance"), FV_EXIT_OK);
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
    assert_int_equal(CALL(fv_command_image, "image", in, in, "--white-balance"), FV_EXIT_WRONG);
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

/* Also by another name of the same file. */
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
        assert_int_equal(CALL(fv_command_image, "image", cut, out, "--white-balance"),
                         FV_EXIT_WRONG);
        assert_int_equal(CALL(fv_command_image, "image", cut, out, "--operations", "denoise"),
                         FV_EXIT_WRONG);
    }
    unlink(cut);
}

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
        cmocka_unit_test(what_is_read_is_never_written_over),
        cmocka_unit_test(lost_output_is_reported),
        cmocka_unit_test(networks_without_boxes_are_reported), /* writes over the camera */
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
