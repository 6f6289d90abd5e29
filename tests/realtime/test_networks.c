/* A real network in the loop: with a millisecond of work per frame ssd_mobilenet_v1 completes over
 * several frames, and finds what it finds in one go; no unit takes more than 0.25 ms. The model
 * comes from $FOVEA_DATA and is imported here. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "support/picture.h"
#include "app/config/model_file.h"
#include "common/imported.h"
#include "detect/job.h"
#include "fovea/fovea.h"

static struct fv_model_file model;

static int64_t cpu_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* Import the model; false where that cannot be. */
static bool import_model(void)
{
    char target[] = "/tmp/fovea-test-XXXXXX";
    struct fovea_error error = {0};
    const int file = mkstemp(target);
    if (file < 0) return false;
    close(file);
    const bool imported = fv_test_import("ssd_mobilenet_v1_coco_quant_meta", NULL, target);
    const bool read = imported && fv_model_file_read(target, &model, &error) == FOVEA_OK;
    if (imported && !read) fail_msg("%s", error.text);
    unlink(target);
    return read;
}

static bool read_picture(const char *name, struct fovea_image *image)
{
    char path[512];
    struct fovea_error error;
    snprintf(path, sizeof path, "%s/images/%s", fv_data_folder(), name);
    return fv_picture_read_colour(path, image, &error) == FOVEA_OK;
}

/* ---- in the loop ----------------------------------------------------------------------------- */

struct made {
    void *memory;
    struct fovea *rt;
    struct fovea_config config;
};

static struct made make(const struct fovea_image *image)
{
    struct made made = {0};
    struct fovea_error error;
    size_t bytes = 0;
    fovea_config_default(&made.config);
    made.config.rig.cameras[0].camera = (struct fovea_camera){.width = image->width,
                                                              .height = image->height,
                                                              .fx = 500,
                                                              .fy = 500,
                                                              .cx = image->width / 2,
                                                              .cy = image->height / 2};
    made.config.odometry.enabled = false;
    made.config.preview.period_frames = 0;
    made.config.detect.model = model.data;
    made.config.detect.model_bytes = model.bytes;
    assert_int_equal(fovea_camera_prepare(&made.config.rig.cameras[0].camera, &error), FOVEA_OK);
    if (fovea_size(&made.config, &bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
    made.memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, bytes);
    assert_int_equal(fovea_init(made.memory, bytes, &made.config, &made.rt, &error), FOVEA_OK);
    return made;
}

/* Frames that it takes with so much time each (0: no limit); the picture is the same in all. */
static int frames_until_found(struct made *made, const struct fovea_image *image, int64_t budget_ns,
                              struct fovea_detections *found)
{
    struct fovea_outputs outputs;
    for (int i = 0; i < 5000; i++) {
        const struct fovea_frame frame = {
            .image_count = 1, .images[0] = *image, .stamp_ns = 1000 + i, .sequence = (uint64_t)i};
        struct fovea_inputs inputs = {.frame = &frame, .now_ns = frame.stamp_ns};
        fovea_grants_fixed(&made->config, &inputs.grants);
        fovea_step(made->rt, &inputs, &outputs);
        const int64_t begin = cpu_ns();
        do {
            const struct fovea_grants grants = {.units = {[FOVEA_JOB_DETECT] = 1}};
            if (fovea_work(made->rt, &grants, &outputs) == FOVEA_OK) {
                fovea_detections_get(made->rt, found);
                return i + 1;
            }
        } while (budget_ns == 0 || cpu_ns() - begin < budget_ns);
    }
    return -1;
}

static void slices_of_a_millisecond_find_the_same(void **state)
{
    (void)state;
    static const char *const names[] = {"kite_and_cold.jpg", "pets.jpg"};
    for (int n = 0; n < 2; n++) {
        struct fovea_image image;
        struct fovea_detections whole, sliced;
        if (!read_picture(names[n], &image)) {
            printf("SKIPPED %s: not there\n", names[n]);
            continue;
        }
        struct made a = make(&image), b = make(&image);
        assert_int_equal(frames_until_found(&a, &image, 0, &whole), 1);
        const int frames = frames_until_found(&b, &image, 1000000, &sliced);
        printf("%s: %u detections, after %d frames with 1 ms each\n", names[n], whole.count,
               frames);
        assert_true(frames > 2);
        assert_true(whole.count > 0);
        assert_int_equal(whole.count, sliced.count);
        assert_memory_equal(whole.list, sliced.list, whole.count * sizeof *whole.list);
        assert_int_equal(sliced.sequence, 0); /* that of the first frame, which was looked at */
        assert_int_equal(sliced.stamp_ns, 1000);
        free(a.memory);
        free(b.memory);
        free((void *)(uintptr_t)image.data);
    }
}

/* ---- units ----------------------------------------------------------------------------------- */

static void no_unit_takes_more_than_a_quarter_of_a_millisecond(void **state)
{
    (void)state;
    enum {
        RUNS = 9,
        RUNS_MAX = 2000,
        UNITS_MAX = 2000
    }; /* the more, while something else holds them up */
    static int64_t best[UNITS_MAX];
    struct fovea_image image;
    struct fv_kernels kernels;
    struct fv_detect_memory memory;
    struct fv_arena arena;
    if (getenv("FOVEA_TIMED") == NULL || !read_picture("pets.jpg", &image)) {
        printf("SKIPPED times of units: judged in the ordinary build, with $FOVEA_DATA\n");
        return;
    }
    fv_kernels_init(&kernels, fv_cpu_best(fv_cpu_detect()));
    fv_arena_count(&arena);
    fv_detect_carve(&memory, &arena, &model.model, NULL, image.size_bytes);
    void *block = aligned_alloc(64, arena.used);
    fv_arena_init(&arena, block, arena.used);
    fv_detect_carve(&memory, &arena, &model.model, NULL, image.size_bytes);
    int units = 0, longest = 0;
    for (int run = 0; run < RUNS || (run < RUNS_MAX && best[longest] > 250000); run++) {
        assert_int_equal(fv_detect_start(&memory, &image, 1, 1), FOVEA_OK);
        enum fovea_status status = FOVEA_AGAIN;
        for (units = 0; status == FOVEA_AGAIN; units++) {
            uint32_t done;
            assert_true(units < UNITS_MAX);
            const int64_t begin = cpu_ns();
            status = fv_detect_advance(&memory, &kernels, 1, &done);
            const int64_t took = cpu_ns() - begin;
            if (run == 0 || took < best[units]) best[units] = took;
        }
        longest = 0;
        for (int i = 1; i < units; i++)
            longest = best[i] > best[longest] ? i : longest;
    }
    printf("%d units from picture to boxes, the longest %.3f ms (number %d)\n", units,
           (double)best[longest] * 1e-6, longest);
    assert_true(best[longest] <= 250000);
    free(block);
    free((void *)(uintptr_t)image.data);
}

int main(void)
{
    if (!import_model()) return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(slices_of_a_millisecond_find_the_same),
        cmocka_unit_test(no_unit_takes_more_than_a_quarter_of_a_millisecond),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    fv_model_file_free(&model);
    return failed;
}
