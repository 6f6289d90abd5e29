/* The simulated camera's frames: the same bits from every machine, compiler and way of asking; life
 * of the source. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "../../../drivers/sim/sim.h"
#include "drivers/table.h"
#include "fovea/source.h"

static struct fovea_source *open_source(const char *address,
                                        const struct fovea_source_selection *selection)
{
    const struct fovea_source_ops *ops;
    const char *rest;
    char uri[256];
    struct fovea_source *source = NULL;
    struct fovea_error error;
    snprintf(uri, sizeof uri, "sim:%s", address);
    assert_int_equal(fv_source_find(uri, &ops, &rest, &error), FOVEA_OK);
    if (ops->open(rest, selection, &source, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    return source;
}

static const struct fovea_source_ops *sim_ops(void)
{
    const struct fovea_source_ops *ops = NULL;
    const char *rest;
    struct fovea_error error;
    assert_int_equal(fv_source_find("sim:", &ops, &rest, &error), FOVEA_OK);
    return ops;
}

static void close_source(struct fovea_source *source)
{
    sim_ops()->stop(source);
    sim_ops()->close(source);
}

/* 64-bit FNV-1a. */
static uint64_t hash_bytes(uint64_t hash, const void *data, size_t bytes)
{
    const uint8_t *p = data;
    for (size_t i = 0; i < bytes; i++)
        hash = (hash ^ p[i]) * 0x100000001B3u;
    return hash;
}

static const uint64_t hash_start = 0xCBF29CE484222325u;

static uint64_t hash_frame(const struct fovea_frame *frame)
{
    return hash_bytes(hash_start, frame->images[0].data,
                      (size_t)frame->images[0].width * (size_t)frame->images[0].height);
}

static uint64_t hash_at(const char *address, uint64_t start, uint64_t *truth_hash)
{
    struct fovea_frame frame;
    static struct fovea_truth truth;
    const struct fovea_source_selection selection = {.start = start, .step = 1};
    struct fovea_source *source = open_source(address, &selection);
    assert_int_equal(sim_ops()->dequeue(source, 0, &frame), FOVEA_OK);
    const uint64_t hash = hash_frame(&frame);
    if (truth_hash != NULL) {
        const size_t pixels = (size_t)frame.images[0].width * (size_t)frame.images[0].height;
        assert_int_equal(sim_ops()->truth(source, &frame, &truth), FOVEA_OK);
        *truth_hash = hash_bytes(hash_start, truth.T_world_cam, sizeof truth.T_world_cam);
        *truth_hash = hash_bytes(*truth_hash, truth.depth_m, pixels * sizeof(float));
        *truth_hash = hash_bytes(*truth_hash, truth.class_mask, pixels);
        for (uint32_t i = 0; i < truth.box_count; i++) {
            const struct fovea_truth_box *b = &truth.boxes[i];
            const float values[5] = {b->x_min_px, b->y_min_px, b->x_max_px, b->y_max_px,
                                     b->visible_fraction};
            *truth_hash = hash_bytes(*truth_hash, &b->id, sizeof b->id);
            *truth_hash = hash_bytes(*truth_hash, values, sizeof values);
        }
    }
    sim_ops()->requeue(source, &frame);
    close_source(source);
    return hash;
}

/* Change these only when the pictures are meant to change: recordings and measurements depend on
 * them. */
static const struct {
    const char *address;
    uint64_t frame, image, truth;
} golden[] = {
    {"tour?width=320&height=240", 0, 0xd364054129bed019u, 0xb1bab3126791762cu},
    {"tour?width=320&height=240&objects=16", 1100, 0xa4f0fe14f2977664u, 0xf082765982dd2c3du},
    {"orbit", 123, 0x839a1ae2879bae9bu, 0x2419d0ecfcf8058au},
    {"orbit?seed=99&width=320&height=240&lens=equidistant&objects=24&noise=5", 77,
     0x9da10932ce4fb0a6u, 0x7c09cecdd17897ebu},
    {"corridor?width=320&height=240&textures=repeated", 400, 0x5c1b7cb6436d27f9u,
     0xb05b48052be778eeu},
    {"rotate?width=200&height=130&lens=pinhole", 50, 0xa95a95b882c22834u, 0xe6db91cf2be2ed1fu},
    {"stopgo?width=160&height=120&seed=4", 300, 0xfd4bd41ebb4c1799u, 0x2d9f88869bc50088u},
    {"fast?width=320&height=240&blur=1&exposure=15", 100, 0x9f19415826b8cc07u, 0x04c93d60149e1990u},
    {"kidnap?width=320&height=240", 440, 0x742fd52bac7ed3b6u, 0xa79f1ce739542ffau},
    {"wander?width=320&height=240&objects=30", 100000, 0xc6fb1eee4677dc7du, 0xd2c6d074318c7815u},
    {"still?width=320&height=240&rolling=1&light=0.5", 9, 0x1f551bdf26ff6484u, 0xbe90f91278371396u},
    {"orbit?width=320&height=240&rolling=1&blur=1&objects=12", 200, 0x4f4708e23fc7da13u,
     0xc5a7780337a4e82eu},
    {"road", 20, 0xcb4f56c2ac8a1692u, 0xd5e7df5d04054b61u},
    {"road?seed=6&width=620&height=188", 45, 0x0888caa31bb72939u, 0x34bec09b9918065cu},
    {"road?seed=3&width=400&height=200&lens=radtan&blur=1&exposure=12", 30, 0x0846b6d9b27559f1u,
     0x6432a60dee236f88u},
    {"drive?width=320&height=240", 0, 0x57ad473b4d0349ddu, 0x0083aa8487e9498fu},
    {"drive?width=320&height=240&seed=7&objects=8&baseline=0.1", 400, 0x727848548922d51bu,
     0xbc65728d31f8dedau},
};

static void test_golden(void **state)
{
    (void)state;
    int wrong = 0;
    for (size_t i = 0; i < sizeof golden / sizeof golden[0]; i++) {
        uint64_t truth;
        const uint64_t image = hash_at(golden[i].address, golden[i].frame, &truth);
        if (image == golden[i].image && truth == golden[i].truth) continue;
        wrong++;
        print_message("    {\"%s\", %d, 0x%016llxu, 0x%016llxu},\n", golden[i].address,
                      (int)golden[i].frame, (unsigned long long)image, (unsigned long long)truth);
    }
    assert_int_equal(wrong, 0);
}

static void test_seeds_differ(void **state)
{
    (void)state;
    uint64_t seen[12];
    for (int seed = 0; seed < 12; seed++) {
        char address[64];
        snprintf(address, sizeof address, "orbit?seed=%d&width=160&height=120", seed);
        seen[seed] = hash_at(address, 0, NULL);
        for (int other = 0; other < seed; other++)
            assert_true(seen[other] != seen[seed]);
    }
}

/* Any way of asking for a frame gives the same one. */
static void test_order_does_not_matter(void **state)
{
    (void)state;
    static const char *const addresses[] = {"orbit?width=160&height=120&frames=9",
                                            "tour?width=160&height=120&frames=9&blur=1&rolling=1"};
    for (size_t n = 0; n < 2; n++) {
        uint64_t forward[9];
        int64_t stamp[9];
        struct fovea_frame frame;
        struct fovea_source *source = open_source(addresses[n], NULL);
        for (int i = 0; i < 9; i++) {
            assert_int_equal(sim_ops()->dequeue(source, 0, &frame), FOVEA_OK);
            forward[i] = hash_frame(&frame);
            stamp[i] = frame.stamp_ns;
            assert_int_equal(frame.sequence, i);
            sim_ops()->requeue(source, &frame);
        }
        assert_int_equal(sim_ops()->dequeue(source, 0, &frame), FOVEA_END);
        assert_int_equal(sim_ops()->state(source), FOVEA_SOURCE_ENDED);
        close_source(source);
        /* From 1 in steps of 3, two of them: frames 1 and 4; turned round. */
        const struct fovea_source_selection selection = {
            .start = 1, .step = 3, .frames = 2, .reverse = true};
        source = open_source(addresses[n], &selection);
        assert_int_equal(sim_ops()->info(source)->frame_count, 2);
        const int expected[2] = {4, 1};
        int64_t last = -1;
        for (int i = 0; i < 2; i++) {
            assert_int_equal(sim_ops()->dequeue(source, 0, &frame), FOVEA_OK);
            assert_int_equal(frame.sequence, expected[i]);
            assert_true(hash_frame(&frame) == forward[expected[i]]);
            assert_true(frame.stamp_ns == stamp[expected[1 - i]]);
            assert_true(frame.stamp_ns > last);
            last = frame.stamp_ns;
            sim_ops()->requeue(source, &frame);
        }
        assert_int_equal(sim_ops()->dequeue(source, 0, &frame), FOVEA_END);
        close_source(source);
    }
}

/* The second camera sees what the first does, moved by the disparity of its depth; the first sees
 * what it does alone. */
static void test_second_camera(void **state)
{
    (void)state;
    static const char alone[] = "orbit?width=320&height=240&noise=0&lens=pinhole&objects=0";
    static const char pair[] =
        "orbit?width=320&height=240&noise=0&lens=pinhole&objects=0&baseline=0.2";
    static struct fovea_truth truth;
    struct fovea_frame frame;
    struct fovea_source *source = open_source(pair, NULL);
    const struct fovea_rig *rig = &sim_ops()->info(source)->rig;
    const double fx = rig->cameras[0].camera.fx;
    int64_t moved_sum = 0, same_sum = 0, count = 0;
    assert_int_equal(rig->camera_count, 2);
    assert_true(rig->cameras[0].T_body_cam[3] == 0 && rig->cameras[1].T_body_cam[3] == 0.2);
    assert_true(rig->cameras[1].calibrated && rig->cameras[1].camera.fx == fx);
    assert_int_equal(sim_ops()->dequeue(source, 0, &frame), FOVEA_OK);
    assert_int_equal(frame.image_count, 2);
    assert_int_equal(fovea_image_check(&frame.images[1]), FOVEA_OK);
    assert_int_equal(hash_frame(&frame), hash_at(alone, 0, NULL));
    assert_int_equal(sim_ops()->truth(source, &frame, &truth), FOVEA_OK);
    for (int y = 10; y < 230; y++)
        for (int x = 60; x < 310; x++) {
            const float depth_m = truth.depth_m[y * 320 + x];
            const int to = depth_m > 0 ? x - (int)(fx * 0.2 / (double)depth_m + 0.5) : -1;
            if (to < 0) continue;
            const int value = frame.images[0].data[y * 320 + x];
            moved_sum += abs(value - frame.images[1].data[y * 320 + to]);
            same_sum += abs(value - frame.images[1].data[y * 320 + x]);
            count++;
        }
    assert_true(count > 40000);
    assert_true(3 * moved_sum < same_sum);
    close_source(source);
}

/* Mean difference of grey levels where camera `from` and camera `to` see the same: by the depth of
 * `from`, or (NULL) of cameras with one centre. `*count`: pixels that both see. */
static double difference(const struct fovea_frame *frame, const struct fovea_rig *rig, int from,
                         int to, const float *depth_m, int *count)
{
    const struct fovea_image *image = &frame->images[from];
    const double *A = rig->cameras[from].T_body_cam, *B = rig->cameras[to].T_body_cam;
    double sum = 0;
    *count = 0;
    for (int y = 0; y < image->height; y++)
        for (int x = 0; x < image->width; x++) {
            double b[3], body[3], p[3], pixel[2];
            const double z = depth_m != NULL ? (double)depth_m[y * image->width + x] : 1;
            if (fovea_camera_unproject(&rig->cameras[from].camera, (const double[2]){x, y}, b,
                                       NULL) != FOVEA_OK)
                continue;
            for (int i = 0; i < 3; i++)
                body[i] = (A[4 * i] * b[0] + A[4 * i + 1] * b[1] + A[4 * i + 2] * b[2]) * z / b[2] +
                          A[4 * i + 3] - B[4 * i + 3];
            for (int i = 0; i < 3; i++)
                p[i] = B[i] * body[0] + B[4 + i] * body[1] + B[8 + i] * body[2];
            if (p[2] < 0.1 ||
                fovea_camera_project(&rig->cameras[to].camera, p, pixel, NULL) != FOVEA_OK)
                continue;
            const int u = (int)floor(pixel[0]), v = (int)floor(pixel[1]);
            if (u < 0 || v < 0 || u + 1 >= image->width || v + 1 >= image->height) continue;
            const uint8_t *at = frame->images[to].data + v * image->width + u;
            const double fu = pixel[0] - u, fv = pixel[1] - v;
            const double there = (1 - fv) * ((1 - fu) * at[0] + fu * at[1]) +
                                 fv * ((1 - fu) * at[image->width] + fu * at[image->width + 1]);
            sum += fabs(image->data[y * image->width + x] - there);
            ++*count;
        }
    return sum / (*count > 0 ? *count : 1);
}

/* Cameras stand in any pose on the body: toed and tilted ones see what the first sees, moved by its
 * depth, and four that look ahead, right, back and left see all round without a gap. */
static void test_rig(void **state)
{
    (void)state;
    static struct fovea_truth truth;
    struct fovea_frame frame;
    int count;
    struct fovea_source *source = open_source(
        "orbit?width=320&height=240&noise=0&lens=pinhole&objects=0&camera2=0.2,0.05,-0.1,4,-8,6&"
        "camera3=-0.15,-0.1,0.05,-6,10,-90&camera4=0,0,0",
        NULL);
    const struct fovea_rig *rig = &sim_ops()->info(source)->rig;
    assert_int_equal(rig->camera_count, 4);
    assert_int_equal(sim_ops()->dequeue(source, 0, &frame), FOVEA_OK);
    assert_int_equal(frame.image_count, 4);
    assert_memory_equal(frame.images[0].data, frame.images[3].data, 320 * 240);
    assert_int_equal(sim_ops()->truth(source, &frame, &truth), FOVEA_OK);
    for (int k = 1; k < 3; k++) {
        const double moved = difference(&frame, rig, 0, k, truth.depth_m, &count);
        print_message("camera %d: %d pixels in common, off by %.2f grey levels\n", k + 1, count,
                      moved);
        assert_true(count > 30000 && moved < 6);
    }
    sim_ops()->requeue(source, &frame);
    close_source(source);
    source = open_source("wander?width=320&height=240&noise=0&lens=pinhole&fov=100&objects=0&"
                         "camera2=0,0,0,0,90,0&camera3=0,0,0,0,180,0&camera4=0,0,0,0,-90,0",
                         NULL);
    rig = &sim_ops()->info(source)->rig;
    assert_int_equal(sim_ops()->dequeue(source, 0, &frame), FOVEA_OK);
    assert_true(rig->cameras[1].T_body_cam[2] > 1 - 1e-12);
    assert_true(rig->cameras[2].T_body_cam[10] < -1 + 1e-12);
    for (int k = 0; k < 4; k++) {
        const double seam = difference(&frame, rig, k, (k + 1) % 4, NULL, &count);
        print_message("cameras %d and %d: %d pixels at the seam, off by %.2f grey levels\n", k + 1,
                      (k + 1) % 4 + 1, count, seam);
        assert_true(count > 1000 && seam < 6);
        assert_true(difference(&frame, rig, k, (k + 2) % 4, NULL, &count) == 0 && count == 0);
    }
    close_source(source);
}

static void test_frames_say_what_they_are(void **state)
{
    (void)state;
    struct fovea_frame a, b, c;
    struct fovea_source *source =
        open_source("still?width=96&height=80&rate=20&exposure=4&noise=3", NULL);
    const struct fovea_source_info *info = sim_ops()->info(source);
    assert_true(info->rig.cameras[0].calibrated && info->has_truth && !info->live);
    assert_int_equal(info->cameras[0].width, 96);
    assert_int_equal(info->rig.cameras[0].camera.width, 96);
    assert_true(info->rig.cameras[0].camera.field_max_rad > 0.5);
    assert_int_equal(info->frame_count, 600);
    assert_true(info->heap_bytes > 1000000);
    assert_int_equal(sim_ops()->dequeue(source, 0, &a), FOVEA_OK);
    assert_int_equal(sim_ops()->dequeue(source, 0, &b), FOVEA_OK);
    assert_int_equal(sim_ops()->dequeue(source, 0, &c), FOVEA_AGAIN); /* two may be held */
    assert_int_equal(fovea_image_check(&a.images[0]), FOVEA_OK);
    assert_int_equal(a.stamp_ns, 0);
    assert_int_equal(b.stamp_ns, 50000000);
    assert_int_equal(b.exposure_ns[0], 4000000);
    assert_int_equal(b.clock, FOVEA_CLOCK_SIMULATED);
    assert_int_equal(b.stamp_meaning, FOVEA_STAMP_EXPOSURE_MIDDLE);
    sim_ops()->requeue(source, &a);
    assert_int_equal(sim_ops()->dequeue(source, 0, &c), FOVEA_OK);
    struct fovea_source_counts counts;
    sim_ops()->counts(source, &counts);
    assert_int_equal(counts.delivered, 3);
    close_source(source);
}

/* Noise has the standard deviation that was asked for, is new in every frame, and nothing else
 * moves when all stands. */
static void test_noise(void **state)
{
    (void)state;
    struct fovea_frame a, b;
    struct fovea_source *source = open_source("still?objects=0&noise=3", NULL);
    assert_int_equal(sim_ops()->dequeue(source, 0, &a), FOVEA_OK);
    assert_int_equal(sim_ops()->dequeue(source, 0, &b), FOVEA_OK);
    double sum = 0, square = 0;
    int count = 0;
    for (int32_t i = 0; i < 640 * 480; i++) {
        if (a.images[0].data[i] < 30 || a.images[0].data[i] > 225) continue; /* not clipped */
        const double d = (double)a.images[0].data[i] - b.images[0].data[i];
        sum += d;
        square += d * d;
        count++;
    }
    const double mean = sum / count, variance = square / count - mean * mean;
    print_message(
        "noise 3: difference of two frames has mean %.3f, variance %.2f (expected 18.2)\n", mean,
        variance);
    assert_true(mean > -0.03 && mean < 0.03);
    assert_true(variance > 17.4 && variance < 19.0);
    close_source(source);
    source = open_source("still?objects=0&noise=0", NULL);
    assert_int_equal(sim_ops()->dequeue(source, 0, &a), FOVEA_OK);
    assert_int_equal(sim_ops()->dequeue(source, 0, &b), FOVEA_OK);
    assert_memory_equal(a.images[0].data, b.images[0].data, 640 * 480);
    close_source(source);
}

static double thread_ms(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec * 1e3 + (double)now.tv_nsec * 1e-6;
}

/* 5 ms on a core of its own; here other tests run beside it, and the machine may be emulated or
 * instrumented. */
#if defined(FOVEA_SANITIZED) || !defined(__x86_64__)
static const double frame_ms_most = 1000;
#else
static const double frame_ms_most = 20;
#endif

static void test_timing(void **state)
{
    (void)state;
    static const char *const names[] = {"tour", "orbit", "corridor", "wander"};
    for (size_t n = 0; n < 4; n++) {
        const struct fovea_source_selection selection = {.start = 5, .step = 37};
        struct fovea_frame frame;
        const double begin = thread_ms();
        struct fovea_source *source = open_source(names[n], &selection);
        const double opened = thread_ms();
        double most = 0.0;
        enum { FRAMES = 20 };
        for (int i = 0; i < FRAMES; i++) {
            const double before = thread_ms();
            assert_int_equal(sim_ops()->dequeue(source, 0, &frame), FOVEA_OK);
            const double took = thread_ms() - before;
            if (took > most) most = took;
            sim_ops()->requeue(source, &frame);
        }
        print_message("%-9s open %.0f ms, %.1f MiB; 640x480 frame mean %.2f ms, at most %.2f ms\n",
                      names[n], opened - begin,
                      (double)sim_ops()->info(source)->heap_bytes / 1048576.0,
                      (thread_ms() - opened) / FRAMES, most);
        assert_true((thread_ms() - opened) / FRAMES < frame_ms_most);
        close_source(source);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_golden),
        cmocka_unit_test(test_seeds_differ),
        cmocka_unit_test(test_order_does_not_matter),
        cmocka_unit_test(test_frames_say_what_they_are),
        cmocka_unit_test(test_noise),
        cmocka_unit_test(test_second_camera),
        cmocka_unit_test(test_rig),
        cmocka_unit_test(test_timing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
