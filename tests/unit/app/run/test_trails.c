/* Trails of objects in fixed memory: a run of any length fits, thinned evenly, and only confirmed
 * objects count. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "app/run/trails.h"

static void a_long_run_is_thinned_evenly(void **state)
{
    (void)state;
    static struct fv_trails trails;
    enum { INFERENCES = 100000, OBJECTS = 7 };
    for (int inference = 0; inference < INFERENCES; inference++) {
        struct fovea_object list[OBJECTS + 1];
        for (int i = 0; i <= OBJECTS; i++) {
            list[i] = (struct fovea_object){.id = (uint64_t)i + 1,
                                            .class_id = i,
                                            .state = i < OBJECTS ? FOVEA_OBJECT_CONFIRMED
                                                                 : FOVEA_OBJECT_COASTING,
                                            .x_min_px = (float)(10 * i),
                                            .x_max_px = (float)(10 * i + 4)};
        }
        const struct fovea_objects objects = {.updates = 1,
                                              .stamp_ns =
                                                  5000000000 + inference * INT64_C(100000000),
                                              .count = OBJECTS + 1,
                                              .list = list};
        fv_trails_observe(&trails, &objects);
        assert_true(trails.count <= FV_TRAILS_MAX);
    }
    assert_int_equal(trails.inferences, INFERENCES);
    assert_true(trails.stride == 128); /* the smallest power of two with which all fits */
    assert_int_equal(trails.count, (INFERENCES + 127) / 128 * OBJECTS);
    for (uint32_t i = 0; i < trails.count; i++) {
        const struct fv_trail_point *p = &trails.points[i];
        assert_int_equal(p->inference, i / OBJECTS);
        assert_int_equal(p->id, i % OBJECTS + 1);
        assert_true(p->x_px == (float)(10 * p->class_id + 2));
        assert_true(p->time_s > 12.79F * (float)p->inference - 0.01F &&
                    p->time_s < 12.81F * (float)p->inference + 0.01F);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_long_run_is_thinned_evenly)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
