/* The governor: what is left of the period goes to waiting jobs, shortage lowers features, ease
 * raises them again. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "fovea/fovea.h"

enum { PERIOD_NS = 33333333 };

static struct fovea_config config;
static struct fovea_governor governor;

static int setup(void **state)
{
    (void)state;
    fovea_config_default(&config);
    fovea_governor_init(&governor, &config, PERIOD_NS);
    return 0;
}

static uint32_t run(int frames, int64_t step_ns, int64_t work_ns)
{
    struct fovea_grants grants = {0};
    struct fovea_outputs outputs = {0};
    for (int i = 0; i < frames; i++) {
        fovea_governor_next(&governor, &config, &grants);
        fovea_governor_work(&governor, step_ns, 1, &grants);
        outputs.units_done[0] = grants.units[0];
        fovea_governor_learn(&governor, step_ns, work_ns, &outputs);
    }
    fovea_governor_next(&governor, &config, &grants);
    return grants.features;
}

static void grants_fit_into_the_period(void **state)
{
    (void)state;
    struct fovea_grants grants;
    fovea_governor_next(&governor, &config, &grants);
    assert_int_equal(grants.features, config.features.count_max);
    fovea_governor_work(&governor, 5000000, 1, &grants);
    const int64_t planned_ns = 5000000 + grants.units[0] * governor.unit_ns[0];
    assert_true(planned_ns <= PERIOD_NS);
    assert_true(planned_ns > PERIOD_NS / 2);
}

static void minimum_is_kept_when_there_is_no_time(void **state)
{
    (void)state;
    struct fovea_grants grants;
    fovea_governor_next(&governor, &config, &grants);
    fovea_governor_work(&governor, 2 * (int64_t)PERIOD_NS, 1, &grants);
    assert_true(grants.units[0] > 0);
}

static void shortage_lowers_features_and_ease_raises_them(void **state)
{
    (void)state;
    assert_int_equal(run(10, PERIOD_NS, 0),
                     config.features.count_max); /* a short spell changes nothing */
    const uint32_t lowered = run(100, PERIOD_NS, 0);
    assert_true(lowered < config.features.count_max * 3 / 4);
    assert_true(run(2000, PERIOD_NS, 0) >= FOVEA_FEATURES_MIN);
    assert_int_equal(run(20000, PERIOD_NS / 10, 0), config.features.count_max);
}

static void learns_the_cost_of_a_unit(void **state)
{
    (void)state;
    struct fovea_outputs outputs = {0};
    outputs.units_done[0] = 10;
    for (int i = 0; i < 200; i++)
        fovea_governor_learn(&governor, 1000000, 10 * 50000, &outputs);
    assert_in_range(governor.unit_ns[0], 50000, 60000);
    fovea_governor_learn(&governor, 1000000, 10 * 400000, &outputs);
    assert_int_equal(governor.unit_ns[0], 400000); /* rises are believed at once */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(grants_fit_into_the_period, setup),
        cmocka_unit_test_setup(minimum_is_kept_when_there_is_no_time, setup),
        cmocka_unit_test_setup(shortage_lowers_features_and_ease_raises_them, setup),
        cmocka_unit_test_setup(learns_the_cost_of_a_unit, setup),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
