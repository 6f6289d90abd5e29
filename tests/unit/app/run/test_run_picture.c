/* The picture of a run: its layout follows what the run had, letters come from the plug-in, and the
 * parts show what they should, by their colours. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include <png.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/command.h"
#include "app/lab/lettering.h"
#include "app/run/run_picture.h"

/* The sheet is as large for small images. */
#define SMALL "?width=320&height=240"

enum { WIDTH = 1600, WORDS_MAX = 24 };

static char path[] = "/tmp/fovea_picture_XXXXXX";
static uint8_t *rgb;
static int height;

/* Run and read the picture. */
static void picture_of(const char *const more[])
{
    const char *words[WORDS_MAX + 1] = {"fovea",    "run",       "--quiet", "--set",
                                        "lcm_url=", "--picture", path,      "--rate",
                                        "max",      "--frames",  "50",      "--source"};
    int count = 12, status = -1;
    for (int i = 0; more[i] != NULL && count < WORDS_MAX; i++)
        words[count++] = more[i];
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) exit(fv_dispatch(count, (char **)(uintptr_t)words));
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
    png_image png = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_file(&png, path));
    png.format = PNG_FORMAT_RGB;
    assert_int_equal(png.width, WIDTH);
    height = (int)png.height;
    rgb = realloc(rgb, PNG_IMAGE_SIZE(png));
    assert_non_null(rgb);
    assert_true(png_image_finish_read(&png, NULL, rgb, 0, NULL));
}

/* Pixels of exactly this colour in a part of the sheet's width. */
static int count_of(uint32_t colour, int left, int right)
{
    int found = 0;
    for (int y = 0; y < height; y++)
        for (int x = left; x < right; x++) {
            const uint8_t *p = rgb + 3 * ((size_t)y * WIDTH + (size_t)x);
            found += ((uint32_t)p[0] << 16 | (uint32_t)p[1] << 8 | p[2]) == colour;
        }
    return found;
}

static void test_a_run_with_everything_has_two_rows_of_two_parts(void **state)
{
    (void)state;
    const char *const more[] = {"sim:tour" SMALL, "--model", "src/detect/shipped.fvm", NULL};
    picture_of(more);
    assert_in_range(height, 1100, 1400);
    assert_in_range(count_of(0x39d353, 0, WIDTH / 2), 300, 100000);            /* features */
    assert_in_range(count_of(FV_PICTURE_TRUTH, WIDTH / 2, WIDTH), 50, 100000); /* truth's path */
    assert_in_range(count_of(FV_PICTURE_OURS, WIDTH / 2, WIDTH), 50, 100000);  /* ours */
    assert_in_range(count_of(0x4caf6d, 0, WIDTH), 1000, 100000); /* tracking, in the ribbon */
}

static void test_what_a_run_does_not_have_is_left_out(void **state)
{
    (void)state;
    const char *const alone[] = {"sim:orbit" SMALL, NULL};
    const char *const blind[] = {"sim:orbit" SMALL, "--set", "odometry.enabled=false", NULL};
    const char *const rotated[] = {"sim:rotate" SMALL, NULL}; /* never posed: no path */
    picture_of(alone);
    const int whole = height;
    assert_in_range(count_of(FV_PICTURE_OURS, WIDTH / 2, WIDTH), 50, 100000);
    picture_of(blind);
    assert_int_equal(height, whole);
    assert_int_equal(count_of(0x4caf6d, 0, WIDTH), 0); /* no state */
    picture_of(rotated);
    assert_in_range(count_of(0xf2d16b, 0, WIDTH), 1000, 100000); /* starting */
}

static void test_letters_come_from_the_plug_in(void **state)
{
    (void)state;
    struct fv_canvas canvas;
    const int bitmap = fv_canvas_letters_width(20, "i");
    assert_int_equal(bitmap, fv_canvas_letters_width(20, "W"));
    fv_lettering_open();
    if (fv_canvas_letters_width(20, "i") == fv_canvas_letters_width(20, "W")) {
        print_message("SKIPPED: found no plug-in fovea-text.so, or no font\n");
        skip();
    }
    assert_true(fv_canvas_letters_width(20, "i") < fv_canvas_letters_width(20, "W"));
    assert_true(fv_canvas_letters_width(40, "W") > fv_canvas_letters_width(20, "W"));
    assert_int_equal(fv_canvas_create(&canvas, 64, 40, 0xffffff), FOVEA_OK);
    const int end = fv_canvas_letters(&canvas, 4, 30, 24, 0x000000, "\u00f8S");
    assert_int_equal(end, 4 + fv_canvas_letters_width(24, "\u00f8S"));
    int grey = 0, black = 0;
    for (int i = 0; i < 64 * 40; i++) {
        grey += canvas.rgb[3 * i] > 40 && canvas.rgb[3 * i] < 215;
        black += canvas.rgb[3 * i] < 40;
    }
    assert_in_range(grey, 20, 600); /* smooth edges */
    assert_in_range(black, 20, 600);
    fv_canvas_free(&canvas);
}

static int set_up(void **state)
{
    (void)state;
    const int file = mkstemp(path);
    return file < 0 ? -1 : close(file);
}

static int tear_down(void **state)
{
    (void)state;
    free(rgb);
    return unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_run_with_everything_has_two_rows_of_two_parts),
        cmocka_unit_test(test_what_a_run_does_not_have_is_left_out),
        cmocka_unit_test(test_letters_come_from_the_plug_in),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
