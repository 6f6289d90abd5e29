/* Odometry with every method that features.method may name: it follows the simulated camera within
 * an error, with the same state on every kernel set; a map of one method localises the others. What
 * has no binary descriptors is refused by name. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "common/sim_rig.h"
#include "fovea/extract.h"

enum { METHODS = FOVEA_FEATURES_SHI_TOMASI + 1, FRAMES = 80 };

static struct sim_rig rig;

/* What each method made of the same frames. */
static struct {
    uint8_t *map; /* sealed, from malloc */
    size_t bytes;
    double T_world_cam[FRAMES][12];
} made[METHODS];

static void open_rig(int start, int frames, int method)
{
    sim_rig_open_kept(&rig, "sim:orbit?width=320&height=240", start, frames);
    rig.config.features.method = (enum fovea_feature_method)method;
    rig.config.preview.period_frames = 0;
}

static int play(void)
{
    int posed = 0;
    while (sim_rig_next(&rig)) {
        sim_rig_process(&rig);
        posed += rig.pose[rig.frames - 1].posed;
    }
    return posed;
}

static void keep(int method)
{
    const size_t capacity = fovea_map_bytes_max(&rig.config);
    uint8_t *map = malloc(capacity);
    assert_non_null(map);
    made[method].bytes = fovea_map_save(rig.rt, map, capacity);
    assert_true(made[method].bytes > 0);
    fovea_map_seal(map, made[method].bytes);
    made[method].map = map;
    for (int n = 0; n < FRAMES; n++)
        memcpy(made[method].T_world_cam[n], rig.pose[n].T_world_cam,
               sizeof made[method].T_world_cam[n]);
}

static void each_follows_the_camera(void **state)
{
    (void)state;
    for (int m = 0; m < METHODS; m++) {
        open_rig(0, FRAMES, m);
        sim_rig_build(&rig);
        const int posed = play();
        const double error = sim_rig_path_error(&rig);
        print_message("%s: posed %d of %d frames, error %.2f %% of the path\n",
                      fovea_feature_method_name((enum fovea_feature_method)m), posed, FRAMES,
                      100 * error);
        assert_in_range(posed, FRAMES - 12, FRAMES);
        for (int n = 12; n < FRAMES; n++)
            assert_true(rig.pose[n].posed);
        assert_true(error < 0.01);
        keep(m);
        sim_rig_close(&rig);
    }
}

static uint64_t hash_of(int method, const char *set)
{
    if (set != NULL)
        setenv("FOVEA_CPU", set, 1);
    else
        unsetenv("FOVEA_CPU");
    open_rig(0, 24, method);
    rig.config.features.count_max = 400;
    sim_rig_build(&rig);
    unsetenv("FOVEA_CPU");
    play();
    assert_true(rig.pose[23].posed);
    const uint64_t hash = fovea_state_hash(rig.rt);
    sim_rig_close(&rig);
    return hash;
}

static void kernel_sets_give_the_same_state(void **state)
{
    (void)state;
    uint64_t before = 0;
    for (int m = 0; m < METHODS; m++) {
        const uint64_t hash = hash_of(m, "c");
        assert_true(hash_of(m, NULL) == hash);
        assert_true(hash != before);
        before = hash;
    }
}

/* All describe corners in the same way, so maps hold for all. */
static void a_map_of_one_localises_another(void **state)
{
    (void)state;
    enum { FROM = 30, AGAIN = 30 };
    static const int pairs[][2] = {{FOVEA_FEATURES_FAST, FOVEA_FEATURES_HARRIS},
                                   {FOVEA_FEATURES_FAST, FOVEA_FEATURES_ORB},
                                   {FOVEA_FEATURES_SHI_TOMASI, FOVEA_FEATURES_FAST}};
    for (size_t p = 0; p < sizeof pairs / sizeof pairs[0]; p++) {
        const int by = pairs[p][0];
        assert_non_null(made[by].map);
        open_rig(FROM, AGAIN, pairs[p][1]);
        rig.config.map = made[by].map;
        rig.config.map_bytes = made[by].bytes;
        rig.config.odometry.localise_only = true;
        sim_rig_build(&rig);
        const int posed = play();
        print_message("map of %s, found by %s: %d of %d frames\n",
                      fovea_feature_method_name((enum fovea_feature_method)by),
                      fovea_feature_method_name((enum fovea_feature_method)pairs[p][1]), posed,
                      AGAIN);
        assert_in_range(posed, AGAIN - 2, AGAIN);
        const double(*T)[12] = made[by].T_world_cam + FROM, way = sim_rig_moved(T[0], T[AGAIN - 1]);
        for (int n = 2; n < AGAIN; n++)
            assert_true(sim_rig_moved(rig.pose[n].T_world_cam, T[n]) < .05 * way);
        sim_rig_close(&rig);
    }
}

static int tear_down(void **state)
{
    (void)state;
    for (int m = 0; m < METHODS; m++)
        free(made[m].map);
    return 0;
}

static void others_are_refused(void **state)
{
    (void)state;
    static const struct {
        int method;
        const char *said;
    } cases[] = {{FOVEA_FEATURES_SIFT, "features.method: found sift, expected fast, orb, harris or "
                                       "shi_tomasi: the loop compares binary descriptors, which "
                                       "sift has not"},
                 {FOVEA_FEATURES_SURF, "features.method: found surf, expected fast, orb, harris or "
                                       "shi_tomasi: the loop compares binary descriptors, which "
                                       "surf has not"},
                 {17, "features.method: found 17, expected 0 to 3"}};
    struct fovea_config config;
    struct fovea_error error;
    size_t bytes;
    fovea_config_default(&config);
    assert_int_equal(config.features.method, FOVEA_FEATURES_FAST);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        config.features.method = (enum fovea_feature_method)cases[i].method;
        assert_int_equal(fovea_size(&config, &bytes, &error), FOVEA_ERROR_ARGUMENT);
        assert_string_equal(error.text, cases[i].said);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_follows_the_camera),
        cmocka_unit_test(kernel_sets_give_the_same_state),
        cmocka_unit_test(a_map_of_one_localises_another),
        cmocka_unit_test(others_are_refused),
    };
    const struct CMUnitTest refused[] = {cmocka_unit_test(others_are_refused)};
    if (getenv("FOVEA_EMULATED") != NULL) {
        puts("SKIPPED the simulated ways of test_methods: minutes under an emulator");
        return cmocka_run_group_tests(refused, NULL, NULL);
    }
    return cmocka_run_group_tests(tests, NULL, tear_down);
}
