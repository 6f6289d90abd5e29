/* The canvas: shapes land where they should, everything is cut at the border, and the PNG reads
 * back. */
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>
#include <png.h>

#include "support/canvas.h"
#include "support/font.h"

static uint32_t colour_at(const struct fv_canvas *canvas, int x, int y)
{
    const uint8_t *p = canvas->rgb + (y * canvas->width + x) * 3;
    return (uint32_t)p[0] << 16 | (uint32_t)p[1] << 8 | p[2];
}

static void test_shapes(void **state)
{
    (void)state;
    struct fv_canvas canvas;
    assert_int_equal(fv_canvas_create(&canvas, 64, 32, 0xffffff), FOVEA_OK);
    fv_canvas_line(&canvas, 2, 10, 50, 10, 1, 0x102030);
    assert_int_equal(colour_at(&canvas, 2, 10), 0x102030);
    assert_int_equal(colour_at(&canvas, 50, 10), 0x102030);
    assert_int_equal(colour_at(&canvas, 20, 12), 0xffffff);
    fv_canvas_disc(&canvas, 30, 20, 4, 0xff0000);
    assert_int_equal(colour_at(&canvas, 30, 20), 0xff0000);
    assert_int_equal(colour_at(&canvas, 33, 20), 0xff0000);
    assert_int_equal(colour_at(&canvas, 36, 20), 0xffffff);
    fv_canvas_circle(&canvas, 10, 20, 6, 1, 0x00ff00);
    assert_int_equal(colour_at(&canvas, 16, 20), 0x00ff00);
    assert_int_equal(colour_at(&canvas, 10, 20), 0xffffff);
    fv_canvas_free(&canvas);
}

static void test_border(void **state)
{
    (void)state;
    struct fv_canvas canvas;
    assert_int_equal(fv_canvas_create(&canvas, 16, 16, 0), FOVEA_OK);
    fv_canvas_line(&canvas, -FLT_MAX, -5, FLT_MAX, 20, 3, 0xffffff);
    fv_canvas_line(&canvas, NAN, 3, 4, INFINITY, 3, 0xffffff);
    fv_canvas_circle(&canvas, 1e30F, -1e30F, 1e30F, 2, 0xffffff);
    fv_canvas_box(&canvas, -100, -100, 500, 500, 1, 0xffffff);
    fv_canvas_fill(&canvas, -5, -5, 7, 7, 0x123456);
    assert_int_equal(colour_at(&canvas, 1, 1), 0x123456);
    assert_int_equal(colour_at(&canvas, 2, 2), 0);
    fv_canvas_text(&canvas, -3, 12, 2, 0xffffff, "border");
    fv_canvas_free(&canvas);
    assert_int_equal(fv_canvas_create(&canvas, 0, 5, 0), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(fv_canvas_create(&canvas, 5, 20000, 0), FOVEA_ERROR_ARGUMENT);
}

static void test_font(void **state)
{
    (void)state;
    for (int a = ' '; a <= '~'; a++)
        for (int b = a + 1; b <= '~'; b++)
            assert_memory_not_equal(fv_font_glyph((char)a), fv_font_glyph((char)b), FV_FONT_ROWS);
    assert_ptr_equal(fv_font_glyph('\n'), fv_font_glyph('?'));
}

static void test_png(void **state)
{
    (void)state;
    char path[] = "/tmp/fovea_canvas_XXXXXX";
    close(mkstemp(path));
    struct fv_canvas canvas;
    struct fovea_error error;
    assert_int_equal(fv_canvas_create(&canvas, 20, 10, 0x304050), FOVEA_OK);
    uint8_t grey[6] = {10, 20, 30, 40, 50, 60};
    struct fovea_image image = {grey, 3, 2, 3, FOVEA_PIXEL_GREY8, sizeof grey};
    fv_canvas_image(&canvas, 18, 9, &image);
    assert_int_equal(fv_canvas_write(&canvas, path, &error), FOVEA_OK);
    png_image png = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_file(&png, path));
    png.format = PNG_FORMAT_RGB;
    uint8_t *back = malloc(PNG_IMAGE_SIZE(png));
    assert_true(png_image_finish_read(&png, NULL, back, 0, NULL));
    assert_memory_equal(back, canvas.rgb, 20 * 10 * 3);
    assert_int_equal(colour_at(&canvas, 19, 9), 0x141414);
    free(back);
    unlink(path);
    assert_int_equal(fv_canvas_write(&canvas, "/nowhere/picture.png", &error), FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "/nowhere/picture.png"));
    assert_non_null(strstr(error.text, "No such file"));
    /* What cannot take the picture stays: a device, or a link to one. */
    struct stat there;
    assert_int_equal(symlink("/dev/full", path), 0);
    assert_int_equal(fv_canvas_write(&canvas, path, &error), FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "No space left"));
    assert_int_equal(lstat(path, &there), 0);
    unlink(path);
    /* But of a file there is no half. */
    struct rlimit before;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    const struct rlimit limit = {40, before.rlim_max};
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
    const enum fovea_status status = fv_canvas_write(&canvas, path, &error);
    setrlimit(RLIMIT_FSIZE, &before);
    assert_int_equal(status, FOVEA_ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "File too large"));
    assert_int_equal(lstat(path, &there), -1);
    fv_canvas_free(&canvas);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_shapes),
        cmocka_unit_test(test_border),
        cmocka_unit_test(test_font),
        cmocka_unit_test(test_png),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
