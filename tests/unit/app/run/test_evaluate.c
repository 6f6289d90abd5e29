/* What tools/evaluate measures of a run, by tests/evaluate/measures.py: it needs a Python with
 * numpy. Whole sweeps, which need Dask, pyarrow and DuckDB, are tests/evaluate/sweeps.py. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>

static int with_python(const char *arguments)
{
    const char *python = getenv("FOVEA_PYTHON");
    char command[1024];
    snprintf(command, sizeof command, "'%.700s' %s",
             python != NULL ? python : "build/venv-import/bin/python", arguments);
    return system(command);
}

static void runs_are_measured_as_they_should_be(void **state)
{
    (void)state;
    if (with_python("-c 'import numpy' 2>/dev/null") != 0) {
        printf("SKIPPED measures of tools/evaluate: no Python with the package numpy\n");
        return;
    }
    assert_int_equal(with_python("tests/evaluate/measures.py 2>&1"), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(runs_are_measured_as_they_should_be)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
