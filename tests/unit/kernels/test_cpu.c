/* Picking a kernel set: names, caps, and the error line for what is unknown or missing. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "kernels/kernels.h"

static void names_are_read_back(void **state)
{
    (void)state;
    const uint32_t isas = fv_cpu_detect();
    for (int set = 0; set < FV_CPU_SET_COUNT; set++) {
        enum fv_cpu_set found = FV_CPU_SET_COUNT;
        struct fovea_error error = {0};
        const enum fovea_status status =
            fv_cpu_parse(fv_cpu_set_name((enum fv_cpu_set)set), &found, &error);
        struct fv_kernels kernels;
        fv_kernels_init(&kernels, (enum fv_cpu_set)set);
        if (status == FOVEA_OK) {
            assert_int_equal(found, set);
            assert_int_equal(kernels.set, set);
        } else {
            assert_int_equal(status, FOVEA_ERROR_ARGUMENT);
            assert_int_equal(found, FV_CPU_SET_COUNT);
            assert_non_null(strstr(error.text, "which this processor lacks"));
            assert_true(kernels.set < (enum fv_cpu_set)set);
        }
        assert_int_equal(kernels.isas & ~isas, 0);
        assert_int_equal(kernels.isas & ~fv_cpu_allowed((enum fv_cpu_set)set), 0);
    }
    assert_string_equal(fv_cpu_set_name(FV_CPU_SET_COUNT), "unknown");
}

static void nothing_stands_for_the_best(void **state)
{
    (void)state;
    enum fv_cpu_set set = FV_CPU_SET_COUNT;
    assert_int_equal(fv_cpu_parse(NULL, &set, NULL), FOVEA_OK);
    assert_int_equal(set, fv_cpu_best(fv_cpu_detect()));
    assert_int_equal(fv_cpu_parse("", &set, NULL), FOVEA_OK);
    assert_int_equal(set, fv_cpu_best(fv_cpu_detect()));
}

static void unknown_names_are_refused_with_what_is_offered(void **state)
{
    (void)state;
    enum fv_cpu_set set = FV_CPU_SET_COUNT;
    struct fovea_error error = {0};
    assert_int_equal(fv_cpu_parse("SSE4", &set, &error), FOVEA_ERROR_ARGUMENT);
    assert_int_equal(set, FV_CPU_SET_COUNT);
    assert_non_null(strstr(
        error.text, "FOVEA_CPU: found 'SSE4', which is not a kernel set; expected one of c"));
}

static void the_environment_caps_the_table(void **state)
{
    (void)state;
    enum fv_cpu_set set = FV_CPU_SET_COUNT;
    setenv("FOVEA_CPU", "c", 1);
    assert_int_equal(fv_cpu_from_environment(&set, NULL), FOVEA_OK);
    assert_int_equal(set, FV_CPU_C);
    struct fv_kernels kernels;
    fv_kernels_init(&kernels, set);
#define FV_KERNEL(name, ...) assert_true(kernels.name == fv_k_##name##__c);
#include "kernels/kernels.def"
#undef FV_KERNEL
    unsetenv("FOVEA_CPU");
}

/* The best variant of each row is the one in the table. */
static void the_best_variant_is_picked(void **state)
{
    (void)state;
    struct fv_kernels kernels;
    fv_kernels_init(&kernels, fv_cpu_best(fv_cpu_detect()));
#define BEST(name, isa, bit)                                                                       \
    if (kernels.isas & (bit)) best = (void (*)(void))fv_k_##name##__##isa;
#define FV_KERNEL(name, ...)                                                                       \
    {                                                                                              \
        void (*best)(void) = (void (*)(void))fv_k_##name##__c;                                     \
        FV_VARIANTS(BEST, name, __VA_ARGS__)                                                       \
        assert_true((void (*)(void))kernels.name == best);                                         \
    }
#include "kernels/kernels.def"
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_are_read_back),
        cmocka_unit_test(nothing_stands_for_the_best),
        cmocka_unit_test(unknown_names_are_refused_with_what_is_offered),
        cmocka_unit_test(the_environment_caps_the_table),
        cmocka_unit_test(the_best_variant_is_picked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
