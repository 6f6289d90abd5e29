/* Distances from two cameras of the simulation, against its truth: rectified, distorted, verged and
 * turned, above each other; a baseline that is stated wrong; the same bits from every kernel set.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/carved.h"
#include "drivers/table.h"
#include "features/front_end.h"
#include "geometry/vec.h"
#include "stereo/stereo.h"

enum { FEATURES = 1000, FRAMES = 2, FRAMES_APART = 90 };

/* Two front ends and the stage, on a source. */
struct pair {
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    const struct fovea_rig *rig;
    double T_body_cam1[12];
    struct fv_front_end front_end[2];
    struct fv_stereo stereo;
    void *memory;
};

static void carve_pair(void *context, struct fv_arena *arena)
{
    struct pair *p = context;
    struct fovea_preprocess_config chain;
    const uint32_t looked_at[FV_VIEWER_COUNT] = {8};
    const struct fovea_features_config features = {.count_max = FEATURES,
                                                   .pyramid_levels = 8,
                                                   .threshold = 20,
                                                   .threshold_min = 7,
                                                   .per_cell = 2};
    fovea_preprocess_config_default(&chain);
    memset(p->front_end, 0, sizeof p->front_end);
    for (int i = 0; i < 2; i++) {
        const struct fovea_camera *camera = &p->rig->cameras[i].camera;
        fv_front_end_carve_images(&p->front_end[i], &chain, 0, looked_at, camera->width,
                                  camera->height, 8, arena);
        fv_front_end_carve_features(&p->front_end[i], &features, arena);
        fv_front_end_carve_descriptors(&p->front_end[i], arena);
        if (i == 1) fv_front_end_keep_whole_pixels(&p->front_end[i]);
    }
    fv_stereo_carve(&p->stereo, &p->rig->cameras[0].camera, &p->rig->cameras[1].camera,
                    p->rig->cameras[0].T_body_cam, p->T_body_cam1, FEATURES, arena, arena);
}

/* `stretch`: of the stated place of the second camera. */
static void open_pair(struct pair *p, const char *uri, double stretch)
{
    const char *address;
    struct fovea_error error;
    const struct fovea_source_selection selection = {.step = FRAMES_APART, .frames = FRAMES};
    memset(p, 0, sizeof *p);
    if (fv_source_find(uri, &p->ops, &address, &error) ||
        p->ops->open(address, &selection, &p->source, &error) || p->ops->start(p->source, &error))
        fail_msg("%s", error.text);
    p->rig = &p->ops->info(p->source)->rig;
    memcpy(p->T_body_cam1, p->rig->cameras[1].T_body_cam, sizeof p->T_body_cam1);
    for (int i = 3; i < 12; i += 4)
        p->T_body_cam1[i] *= stretch;
    p->memory = carved(carve_pair, p);
    fv_stereo_init(&p->stereo);
}

static void close_pair(struct pair *p)
{
    p->ops->stop(p->source);
    p->ops->close(p->source);
    free(p->memory);
}

static uint32_t measure(struct pair *p, enum fv_cpu_set set, const struct fovea_frame *frame)
{
    struct fv_kernels kernels;
    struct fv_stereo_view view[2];
    fv_kernels_init(&kernels, set);
    for (int i = 0; i < 2; i++) {
        fv_front_end_take(&p->front_end[i], &kernels, &frame->images[i]);
        (void)fv_front_end_find(&p->front_end[i], &kernels, NULL, FEATURES);
        const struct fv_front_end_found found = fv_front_end_found(&p->front_end[i]);
        view[i] = (struct fv_stereo_view){&p->front_end[i].images.main, found.count, found.features,
                                          found.descriptors};
    }
    return fv_stereo_measure(&p->stereo, &kernels, view);
}

/* True inverse distance of a feature; 0 where the surface around it is no plane across the ray. */
static double true_value(const struct pair *p, const struct fovea_truth *truth,
                         const struct fovea_feature *feature, const struct fv_ray *ray)
{
    const int32_t width = p->rig->cameras[0].camera.width;
    const int reach = 1 + (int)(3 * fv_pyramid_scale(feature->level));
    const int32_t x = (int32_t)(feature->x_px + 0.5f), y = (int32_t)(feature->y_px + 0.5f);
    double least = 1e9, most = 0;
    for (int v = -reach; v <= reach; v += reach)
        for (int u = -reach; u <= reach; u += reach) {
            const double z = (double)truth->depth_m[(y + v) * width + x + u];
            if (!(z > 0)) return 0;
            least = z < least ? z : least;
            most = z > most ? z : most;
        }
    if (most > 1.1 * least) return 0;
    return ray->bearing[2] / (double)truth->depth_m[y * width + x];
}

struct result {
    uint32_t features, measured, judged, within3; /* sigmas */
    double square;                                /* mean squared error in sigmas, of those */
    double ratio;     /* median of measured over true, where known to 2 % */
    double median_px; /* of the error along the curve, level 0 */
};

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double middle(double *values, uint32_t count)
{
    qsort(values, count, sizeof *values, by_size);
    return count > 0 ? values[count / 2] : 0;
}

static struct result judge(const char *uri, double stretch)
{
    static double ratios[FEATURES * FRAMES], errors_px[FEATURES * FRAMES];
    static struct fovea_truth truth;
    struct pair p;
    struct fovea_frame frame;
    struct result r = {0};
    uint32_t ratio_count = 0;
    open_pair(&p, uri, stretch);
    while (p.ops->dequeue(p.source, INT64_MAX, &frame) == FOVEA_OK) {
        r.measured += measure(&p, FV_CPU_C, &frame);
        r.features += p.front_end[0].features.count;
        assert_int_equal(p.ops->truth(p.source, &frame, &truth), FOVEA_OK);
        for (uint32_t f = 0; f < p.front_end[0].features.count; f++) {
            const struct fv_inverse_distance *m = &p.stereo.measured[f];
            if (!(m->weight > 0)) continue;
            const double value =
                true_value(&p, &truth, &p.front_end[0].features.list[f], &p.stereo.ray[f]);
            if (!(value > 0)) continue;
            const double e = ((double)m->value - value) * __builtin_sqrt((double)m->weight);
            struct fv_stereo_place place;
            double turned[3];
            fv_stereo_turn(&p.stereo, p.stereo.ray[f].bearing, turned);
            if (!fv_stereo_project(&p.stereo, turned, value, &place)) continue;
            errors_px[r.judged++] =
                fv_abs((double)m->value - value) *
                __builtin_sqrt(place.along[0] * place.along[0] + place.along[1] * place.along[1]);
            if (e * e < 9) {
                r.within3++;
                r.square += e * e;
            }
            if (fv_inverse_distance_known(m, 50)) ratios[ratio_count++] = (double)m->value / value;
        }
        p.ops->requeue(p.source, &frame);
    }
    close_pair(&p);
    r.square /= r.within3 > 0 ? r.within3 : 1;
    r.median_px = middle(errors_px, r.judged);
    r.ratio = middle(ratios, ratio_count);
    print_message(
        "%s: %u features, %u measured, %u judged, %.1f %% within 3 sigma (mean square %.2f), "
        "error %.3f px, measured/true %.4f\n",
        uri, r.features, r.measured, r.judged, 100.0 * r.within3 / r.judged, r.square, r.median_px,
        r.ratio);
    return r;
}

static void expect_good(const char *uri)
{
    const struct result r = judge(uri, 1);
    assert_true(r.measured > r.features / 4);
    assert_true(r.judged > 400);
    assert_true(r.within3 > 0.95 * r.judged);
    assert_true(r.square > 0.4 && r.square < 1.6);
    assert_true(r.median_px < 0.12);
    assert_true(fv_abs(r.ratio - 1) < 0.004);
}

static void rectified_cameras_measure_the_truth(void **state)
{
    (void)state;
    expect_good("sim:orbit?lens=pinhole&baseline=0.11&seed=2");
}

static void distorted_cameras_measure_the_truth(void **state)
{
    (void)state;
    expect_good("sim:orbit?lens=radtan&baseline=0.11&seed=4");
    expect_good("sim:orbit?lens=equidistant&camera2=0,0.1,0&seed=6");
}

static void verged_and_turned_cameras_measure_the_truth(void **state)
{
    (void)state;
    expect_good("sim:orbit?lens=radtan&camera2=0.12,0.01,0.02,0,-6,0&seed=8");
    expect_good("sim:orbit?lens=radtan&camera2=0.12,0,0,2,-3,12&seed=10");
}

/* Twice as far as stated is twice as far for all: nothing else could show it. */
static void a_baseline_stated_wrong_scales_all_distances(void **state)
{
    (void)state;
    const struct result r = judge("sim:orbit?lens=radtan&baseline=0.11&seed=4", 1.05);
    assert_true(fv_abs(r.ratio * 1.05 - 1) < 0.004);
}

static void every_kernel_set_gives_the_same_bits(void **state)
{
    (void)state;
    static struct fv_inverse_distance first[FEATURES];
    struct pair p;
    struct fovea_frame frame;
    open_pair(&p, "sim:orbit?lens=radtan&camera2=0.12,0,0,2,-3,12&seed=10", 1);
    assert_int_equal(p.ops->dequeue(p.source, INT64_MAX, &frame), FOVEA_OK);
    const uint32_t measured = measure(&p, FV_CPU_C, &frame), count = p.front_end[0].features.count;
    assert_true(measured > 100);
    memcpy(first, p.stereo.measured, count * sizeof *first);
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        assert_int_equal(measure(&p, (enum fv_cpu_set)set, &frame), measured);
        assert_memory_equal(first, p.stereo.measured, count * sizeof *first);
    }
    p.ops->requeue(p.source, &frame);
    close_pair(&p);
}

/* A covered camera sees nothing, and the other's features are not measured. */
static void a_covered_camera_measures_nothing(void **state)
{
    (void)state;
    struct pair p;
    struct fovea_frame frame;
    open_pair(&p, "sim:orbit?baseline=0.11", 1);
    assert_int_equal(p.ops->dequeue(p.source, INT64_MAX, &frame), FOVEA_OK);
    const struct fovea_image seen = frame.images[1];
    uint8_t *black = calloc((size_t)seen.height, seen.stride_bytes);
    frame.images[1].data = black;
    assert_int_equal(measure(&p, FV_CPU_C, &frame), 0);
    frame.images[1] = seen;
    assert_true(measure(&p, FV_CPU_C, &frame) > 100);
    free(black);
    p.ops->requeue(p.source, &frame);
    close_pair(&p);
}

static void cameras_at_one_place_do_not_serve(void **state)
{
    (void)state;
    const double here[12] = {1, 0, 0, 0.2, 0, 1, 0, 0, 0, 0, 1, 0},
                 turned[12] = {0, -1, 0, 0.202, 1, 0, 0, 0, 0, 0, 1, 0},
                 beside[12] = {1, 0, 0, 0.3, 0, 1, 0, 0, 0, 0, 1, 0};
    assert_false(fv_stereo_serves(here, here));
    assert_false(fv_stereo_serves(here, turned));
    assert_true(fv_stereo_serves(here, beside));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rectified_cameras_measure_the_truth),
        cmocka_unit_test(distorted_cameras_measure_the_truth),
        cmocka_unit_test(verged_and_turned_cameras_measure_the_truth),
        cmocka_unit_test(a_baseline_stated_wrong_scales_all_distances),
        cmocka_unit_test(every_kernel_set_gives_the_same_bits),
        cmocka_unit_test(a_covered_camera_measures_nothing),
        cmocka_unit_test(cameras_at_one_place_do_not_serve),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
