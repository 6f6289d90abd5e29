/* The source `fault:`: what each fault does to a picture, and what passes untouched. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../../../drivers/fault/fault.h"
#include "../../../drivers/table.h"

static struct fv_fault_options options_of(const char *text)
{
    struct fv_fault_options options;
    struct fovea_error error = {.text = ""};
    if (fv_fault_options_parse(text, &options, &error) != FOVEA_OK)
        fail_msg("%s: %s", text, error.text);
    return options;
}

/* ---- pictures -------------------------------------------------------------------------------- */

enum { WIDTH = 131, HEIGHT = 77, BYTES = 3 * WIDTH * HEIGHT };

static uint8_t pixels[BYTES], scratch[BYTES], last[BYTES];

static struct fv_fault_picture picture_of(const struct fv_fault_options *options, int32_t channels)
{
    return (struct fv_fault_picture){.options = options,
                                     .pixels = pixels,
                                     .width = WIDTH,
                                     .height = HEIGHT,
                                     .channels = channels,
                                     .seed = 11,
                                     .window_seed = 12,
                                     .last = last,
                                     .scratch = scratch};
}

/* A picture with structure of all sizes, from integers alone. */
static void scene_draw(void)
{
    uint32_t at = 1;
    for (int i = 0; i < BYTES; i++) {
        const int x = i % (3 * WIDTH), y = i / (3 * WIDTH);
        at = at * 1664525u + 1013904223u;
        pixels[i] = (uint8_t)(60 + (x / 17 + y / 9) % 3 * 50 + (int)(at >> 27));
        last[i] = (uint8_t)(i * 7);
    }
}

static void level_draw(uint8_t level)
{
    memset(pixels, level, BYTES);
}

static void noise_has_the_deviation_that_is_asked_for(void **state)
{
    const struct fv_fault_options options = options_of("kind=noise&amount=12");
    struct fv_fault_picture picture = picture_of(&options, 3);
    double sum = 0, sum2 = 0;
    (void)state;
    level_draw(128);
    fv_fault_noise(&picture);
    for (int i = 0; i < BYTES; i++) {
        const double off = pixels[i] - 128.0;
        sum += off;
        sum2 += off * off;
    }
    assert_true(fabs(sum / BYTES) < 0.25);
    assert_true(fabs(sqrt(sum2 / BYTES) - 12) < 0.2);
    memcpy(last, pixels, BYTES);
    level_draw(128);
    picture.seed++;
    fv_fault_noise(&picture);
    int same = 0;
    for (int i = 0; i < BYTES; i++)
        same += pixels[i] == last[i];
    assert_true(same < BYTES / 10);
    level_draw(0);
    fv_fault_noise(&picture); /* it does not wrap around */
    for (int i = 0; i < BYTES; i++)
        assert_true(pixels[i] < 60);
}

/* Sum and second moments about the middle of what a bright square of 3 x 3 pixels became. */
static void moments(double *sum, double *xx, double *yy, double *xy)
{
    *sum = *xx = *yy = *xy = 0;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const double value = pixels[y * WIDTH + x], dx = x - 65.0, dy = y - 38.0;
            *sum += value;
            *xx += value * dx * dx;
            *yy += value * dy * dy;
            *xy += value * dx * dy;
        }
    *xx /= *sum;
    *yy /= *sum;
    *xy /= *sum;
}

static void square_draw(void)
{
    level_draw(0);
    for (int y = 28; y <= 48; y++)
        for (int x = 55; x <= 75; x++)
            pixels[y * WIDTH + x] = 255;
}

static void blur_is_a_gaussian(void **state)
{
    const struct fv_fault_options options = options_of("kind=blur&sigma=4");
    struct fv_fault_picture picture = picture_of(&options, 1);
    double sum, xx, yy, xy, before = 255 * 21 * 21, own = (21 * 21 - 1) / 12.0;
    (void)state;
    square_draw();
    fv_fault_blur(&picture);
    moments(&sum, &xx, &yy, &xy);
    assert_true(fabs(sum / before - 1) < 0.01);
    assert_true(fabs(xx - own - 16) < 0.8 && fabs(yy - own - 16) < 0.8 && fabs(xy) < 0.1);
    level_draw(77);
    fv_fault_blur(&picture);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        assert_int_equal(pixels[i], 77); /* at the border, too */
}

static void zoom_scales_about_the_middle(void **state)
{
    static const struct {
        const char *text;
        double factor;
    } rows[] = {
        {"kind=zoom&factor=1", 1}, {"kind=zoom&factor=1.5", 1.5}, {"kind=zoom&factor=0.8", 0.8}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct fv_fault_options options = options_of(rows[i].text);
        struct fv_fault_picture picture = picture_of(&options, 1);
        double sum, xx, yy, xy, own = 21 * 21 / 12.0, factor2 = rows[i].factor * rows[i].factor;
        square_draw();
        fv_fault_zoom(&picture);
        moments(&sum, &xx, &yy, &xy);
        assert_true(fabs(sum / (255 * 21 * 21 * factor2) - 1) < 0.06);
        assert_true(fabs(xx / (own * factor2) - 1) < 0.06 && fabs(yy / (own * factor2) - 1) < 0.06);
        assert_true(fabs(xy) < 0.1);
        level_draw(77);
        fv_fault_zoom(&picture);
        for (int k = 0; k < WIDTH * HEIGHT; k++)
            assert_int_equal(pixels[k], 77);
    }
}

static void motion_is_along_one_line(void **state)
{
    const struct fv_fault_options options = options_of("kind=motion&length=25");
    struct fv_fault_picture picture = picture_of(&options, 1);
    double sum, xx, yy, xy, own = (21 * 21 - 1) / 12.0, along = (25 * 25 - 1) / 12.0;
    (void)state;
    for (picture.window_seed = 1; picture.window_seed < 9; picture.window_seed++) {
        square_draw();
        fv_fault_motion(&picture);
        moments(&sum, &xx, &yy, &xy);
        xx -= own;
        yy -= own;
        assert_true(fabs(sum / (255 * 21 * 21) - 1) < 0.01);
        assert_true(fabs(xx + yy - along) < 4);    /* as long as it should be, but for rounding */
        assert_true(fabs(xx * yy - xy * xy) < 40); /* and thin: no extent across */
    }
    level_draw(77);
    fv_fault_motion(&picture);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        assert_int_equal(pixels[i], 77);
}

/* Something before the lens hides the share that is asked for, by one dark level. */
static void occlusion_hides_the_share_that_is_asked_for(void **state)
{
    (void)state;
    static const double shares[] = {0.02, 0.3, 0.7, 0.95};
    for (int i = 0; i < 4; i++)
        for (uint64_t seed = 1; seed <= 20; seed++) {
            char text[64];
            snprintf(text, sizeof text, "kind=occlusion&share=%g", shares[i]);
            const struct fv_fault_options options = options_of(text);
            struct fv_fault_picture picture = picture_of(&options, 1);
            picture.window_seed = seed;
            level_draw(200);
            fv_fault_occlusion(&picture);
            int hides = 0, level = -1;
            for (int k = 0; k < WIDTH * HEIGHT; k++) {
                if (pixels[k] == 200) continue;
                if (level < 0) level = pixels[k];
                assert_int_equal(pixels[k], level);
                hides++;
            }
            assert_in_range(level, 10, 69);
            const double share = (double)hides / (WIDTH * HEIGHT);
            assert_true(share >= shares[i] && share < shares[i] + 0.02);
        }
}

static void exposure_and_white_end_at_the_end(void **state)
{
    (void)state;
    const struct fv_fault_options options = options_of("kind=exposure&gain=1.5");
    struct fv_fault_picture picture = picture_of(&options, 1);
    for (int k = 0; k < 256; k++)
        pixels[k] = (uint8_t)k;
    fv_fault_exposure(&picture);
    for (int k = 0; k < 256; k++)
        assert_int_equal(pixels[k], k > 169 ? 255 : (3 * k + 1) / 2);
    fv_fault_white(&picture);
    for (int k = 0; k < WIDTH * HEIGHT; k++)
        assert_int_equal(pixels[k], 255);
}

/* Above the new picture, below the last one, and the row between is drawn anew each time. */
static void a_partial_picture_ends_in_the_last_one(void **state)
{
    (void)state;
    const struct fv_fault_options options = options_of("kind=partial");
    int rows[40], least = HEIGHT, most = 0;
    for (uint64_t seed = 0; seed < 40; seed++) {
        struct fv_fault_picture picture = picture_of(&options, 1);
        picture.seed = seed;
        level_draw(100);
        memset(last, 50, BYTES);
        fv_fault_partial(&picture);
        int row = 0;
        while (row < HEIGHT && pixels[row * WIDTH] == 100)
            row++;
        for (int k = 0; k < WIDTH * HEIGHT; k++)
            assert_int_equal(pixels[k], k < row * WIDTH ? 100 : 50);
        rows[seed] = row;
        if (row < least) least = row;
        if (row > most) most = row;
    }
    assert_true(least >= HEIGHT / 8 && most <= HEIGHT - HEIGHT / 8 && most - least > HEIGHT / 3);
    assert_int_not_equal(rows[0], rows[1]);
}

static double recompressed_error(const char *text, int32_t channels)
{
    const struct fv_fault_options options = options_of(text);
    struct fv_fault_picture picture = picture_of(&options, channels);
    double sum2 = 0;
    scene_draw();
    memcpy(last, pixels, BYTES);
    fv_fault_recompress(&picture);
    const int bytes = WIDTH * HEIGHT * channels;
    for (int i = 0; i < bytes; i++)
        sum2 += (double)(pixels[i] - last[i]) * (double)(pixels[i] - last[i]);
    return sqrt(sum2 / bytes);
}

static void recompression_loses_more_at_a_lower_quality(void **state)
{
    (void)state;
    for (int32_t channels = 1; channels <= 3; channels += 2) {
        const double best = recompressed_error("kind=recompress&quality=100", channels),
                     good = recompressed_error("kind=recompress&quality=80", channels),
                     poor = recompressed_error("kind=recompress&quality=10", channels);
        assert_true(best < 0.6 && good > 1.5 * best && poor > 1.5 * good);
    }
    const struct fv_fault_options options = options_of("kind=recompress&quality=1");
    struct fv_fault_picture picture = picture_of(&options, 1);
    level_draw(128);
    fv_fault_recompress(&picture);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        assert_int_equal(pixels[i], 128);
}

/* Every compiler, instruction set and architecture gives these bits. */
static void faults_have_the_same_bits_everywhere(void **state)
{
    static const struct {
        const char *name;
        void (*apply)(struct fv_fault_picture *);
        uint64_t hash;
    } rows[] = {
        {"freeze", fv_fault_freeze, UINT64_C(0xe4750d7f14eab58b)},
        {"black", fv_fault_black, UINT64_C(0x7a71a1a36b20399e)},
        {"white", fv_fault_white, UINT64_C(0x7b666201bff09bfa)},
        {"occlusion", fv_fault_occlusion, UINT64_C(0x871d4edd56e33e66)},
        {"zoom", fv_fault_zoom, UINT64_C(0x1ffddffe6cd0c879)},
        {"blur", fv_fault_blur, UINT64_C(0xe274e2b8add1ec27)},
        {"motion", fv_fault_motion, UINT64_C(0xc9e123a4036a1b0)},
        {"exposure", fv_fault_exposure, UINT64_C(0xd07237f79fe7b774)},
        {"noise", fv_fault_noise, UINT64_C(0x82fba4c7a74e11ba)},
        {"recompress", fv_fault_recompress, UINT64_C(0xcbd18ef087e9fb1c)},
        {"partial", fv_fault_partial, UINT64_C(0x50986a0ee76923a7)},
    };
    const struct fv_fault_options options = options_of("kind=blur&level=3");
    int wrong = 0;
    (void)state;
    assert_int_equal(sizeof rows / sizeof rows[0], FV_FAULT_OF_FRAMES);
    for (int i = 0; i < FV_FAULT_OF_FRAMES; i++) {
        struct fv_fault_picture picture = picture_of(&options, 3);
        uint64_t hash = 0xcbf29ce484222325u;
        scene_draw();
        rows[i].apply(&picture);
        for (int k = 0; k < BYTES; k++)
            hash = (hash ^ pixels[k]) * 0x100000001b3u;
        if (hash == rows[i].hash) continue;
        print_error("%s: found %#llx, expected %#llx\n", rows[i].name, (unsigned long long)hash,
                    (unsigned long long)rows[i].hash);
        wrong++;
    }
    assert_int_equal(wrong, 0);
}

/* ---- the source ------------------------------------------------------------------------------ */

struct played {
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
};

static struct played play(const char *uri, const struct fovea_source_selection *selection)
{
    struct played played = {0};
    struct fovea_error error = {.text = ""};
    const char *address;
    if (fv_source_find(uri, &played.ops, &address, &error) != FOVEA_OK ||
        played.ops->open(address, selection, &played.source, &error) != FOVEA_OK ||
        played.ops->start(played.source, &error) != FOVEA_OK)
        fail_msg("%s: %s", uri, error.text);
    return played;
}

static bool next(struct played *played, struct fovea_frame *frame)
{
    return played->ops->dequeue(played->source, INT64_MAX, frame) == FOVEA_OK;
}

static void end(struct played *played)
{
    played->ops->stop(played->source);
    played->ops->close(played->source);
}

/* Mean and largest difference of two images. */
static double differ(const struct fovea_image *a, const struct fovea_image *b, int *most)
{
    double sum = 0;
    *most = 0;
    for (int32_t y = 0; y < a->height; y++)
        for (int32_t x = 0; x < a->width; x++) {
            const int off =
                abs((int)a->data[y * a->stride_bytes + x] - (int)b->data[y * b->stride_bytes + x]);
            sum += off;
            if (off > *most) *most = off;
        }
    return sum / (double)(a->width * a->height);
}

#define SIM "sim:orbit?width=96&height=64&imu=200&baseline=0.1&frames=30"

static void all_but_the_faulty_pictures_is_the_source_s_own(void **state)
{
    static const struct fovea_source_selection selections[] = {{.step = 1},
                                                               {.start = 3, .step = 2}};
    (void)state;
    for (int s = 0; s < 2; s++) {
        struct played own = play(SIM, &selections[s]),
                      faulty =
                          play("fault:" SIM "?kind=noise&first=10&shortest=6&longest=6&count=1",
                               &selections[s]);
        struct fovea_frame a, b;
        int spoilt = 0;
        while (next(&own, &a)) {
            struct fovea_sample p[32], q[32];
            double T[12], U[12];
            assert_true(next(&faulty, &b));
            assert_true(a.stamp_ns == b.stamp_ns && a.index == b.index &&
                        a.sequence == b.sequence && a.image_count == 2 && b.image_count == 2);
            const uint32_t count = own.ops->samples(own.source, &a, p, 32);
            assert_int_equal(faulty.ops->samples(faulty.source, &b, q, 32), count);
            assert_true(count > 0);
            for (uint32_t i = 0; i < count; i++)
                assert_memory_equal(&p[i].imu, &q[i].imu, sizeof p[i].imu);
            assert_int_equal(own.ops->truth_pose(own.source, &a, T), FOVEA_OK);
            assert_int_equal(faulty.ops->truth_pose(faulty.source, &b, U), FOVEA_OK);
            assert_memory_equal(T, U, sizeof T);
            int most[2];
            const double first = differ(&a.images[0], &b.images[0], &most[0]),
                         second = differ(&a.images[1], &b.images[1], &most[1]);
            if (a.index >= 10 && a.index < 16) {
                assert_true(first > 8 && second > 8 && fabs(first - second) > 0); /* of its own */
                spoilt++;
            } else {
                assert_int_equal(most[0] + most[1], 0);
            }
            own.ops->requeue(own.source, &a);
            faulty.ops->requeue(faulty.source, &b);
        }
        assert_false(next(&faulty, &b));
        assert_int_equal(spoilt, s == 0 ? 6 : 3);
        end(&own);
        end(&faulty);
    }
}

/* `camera` counts from 1: pictures of the other stay as they are. */
static void a_fault_of_one_camera_leaves_the_other(void **state)
{
    static const struct fovea_source_selection all = {.step = 1, .frames = 4};
    (void)state;
    for (int camera = 1; camera <= 2; camera++) {
        char uri[160];
        snprintf(uri, sizeof uri, "fault:%s?kind=black&level=3&first=2&fraction=1&camera=%d", SIM,
                 camera);
        struct played own = play(SIM, &all), faulty = play(uri, &all);
        struct fovea_frame a, b;
        while (next(&own, &a)) {
            assert_true(next(&faulty, &b));
            for (int i = 0; i < 2; i++) {
                int most;
                const double off = differ(&a.images[i], &b.images[i], &most);
                assert_true((off > 8) == (i + 1 == camera && a.index >= 2));
                assert_true(off > 8 || most == 0);
            }
            own.ops->requeue(own.source, &a);
            faulty.ops->requeue(faulty.source, &b);
        }
        end(&own);
        end(&faulty);
    }
}

static void a_frozen_picture_is_the_last_good_one(void **state)
{
    static const struct fovea_source_selection selections[] = {
        {.step = 1}, {.step = 1, .frames = 30, .reverse = true}, {.start = 12, .step = 1}};
    static uint8_t good[2][96 * 64];
    (void)state;
    for (int s = 0; s < 3; s++) {
        struct played played =
            play("fault:sim:orbit?width=96&height=64&baseline=0.1&frames=30?kind=freeze&first=10&"
                 "shortest=6&longest=6&count=1",
                 &selections[s]);
        struct fovea_frame frame;
        double before_m = -1000;
        int frozen = 0;
        while (next(&played, &frame)) {
            const bool faulty = frame.index >= 10 && frame.index < 16;
            double T[12];
            assert_int_equal(played.ops->truth_pose(played.source, &frame, T), FOVEA_OK);
            for (int i = 0; i < 2; i++) {
                const bool kept = memcmp(good[i], frame.images[i].data, 96 * 64) == 0;
                /* The first picture of the third run is faulty, and then frozen. */
                if (faulty && (frozen > 0 || s < 2)) assert_true(kept);
                if (!faulty && before_m > -1000) assert_false(kept);
                memcpy(good[i], frame.images[i].data, 96 * 64);
            }
            assert_true(T[3] != before_m); /* the truth moves on */
            before_m = T[3];
            frozen += faulty;
            played.ops->requeue(played.source, &frame);
        }
        assert_int_equal(frozen, s == 2 ? 4 : 6);
        end(&played);
    }
}

static void kinds_are_applied_in_the_order_of_the_list(void **state)
{
    static const struct fovea_source_selection all = {.step = 1, .frames = 3};
    static const char *const uris[] = {
        "fault:sim:orbit?width=96&height=64?kind=noise,black&first=0&level=100&amount=5",
        "fault:sim:orbit?width=96&height=64?kind=black,noise&first=0&level=100&amount=5"};
    (void)state;
    struct fovea_frame a, b;
    int most;
    struct played first = play(uris[0], &all), second = play(uris[1], &all);
    while (next(&first, &a)) {
        assert_true(next(&second, &b));
        assert_true(differ(&a.images[0], &b.images[0], &most) == 0);
        const struct fovea_image level = {
            .data = memset(scratch, 100, 96 * 64), .width = 96, .height = 64, .stride_bytes = 96};
        const double off = differ(&a.images[0], &level, &most); /* noise on black, not black */
        assert_true(off > 3 && off < 5);
        first.ops->requeue(first.source, &a);
        second.ops->requeue(second.source, &b);
    }
    end(&first);
    end(&second);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_has_the_deviation_that_is_asked_for),
        cmocka_unit_test(blur_is_a_gaussian),
        cmocka_unit_test(zoom_scales_about_the_middle),
        cmocka_unit_test(motion_is_along_one_line),
        cmocka_unit_test(occlusion_hides_the_share_that_is_asked_for),
        cmocka_unit_test(exposure_and_white_end_at_the_end),
        cmocka_unit_test(a_partial_picture_ends_in_the_last_one),
        cmocka_unit_test(recompression_loses_more_at_a_lower_quality),
        cmocka_unit_test(faults_have_the_same_bits_everywhere),
        cmocka_unit_test(all_but_the_faulty_pictures_is_the_source_s_own),
        cmocka_unit_test(a_fault_of_one_camera_leaves_the_other),
        cmocka_unit_test(a_frozen_picture_is_the_last_good_one),
        cmocka_unit_test(kinds_are_applied_in_the_order_of_the_list),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
