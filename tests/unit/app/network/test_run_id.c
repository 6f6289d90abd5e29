/* Runs have identities of their own, and none has the one that means "no run". */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "app/network/run_id.h"

static void test_runs_differ(void **state)
{
    enum { RUNS = 1000 };
    static int64_t ids[RUNS];
    int64_t ones = 0, zeros = 0;
    struct fovea_error error;
    (void)state;
    for (int i = 0; i < RUNS; i++) {
        assert_int_equal(fv_run_id_make(&ids[i], &error), FOVEA_OK);
        assert_int_not_equal(ids[i], 0);
        ones |= ids[i];
        zeros |= ~ids[i];
        for (int k = 0; k < i; k++)
            assert_int_not_equal(ids[i], ids[k]);
    }
    assert_int_equal(ones, -1); /* all 64 bits vary */
    assert_int_equal(zeros, -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_runs_differ)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
