/* What tools/import writes about the use of a model, by tests/import/uses.py and segments.py: they
 * need the build's Python with tflite, numpy and flatbuffers. */
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

static void uses_are_written_and_refused_as_they_should_be(void **state)
{
    (void)state;
    if (with_python("-c 'import tflite, numpy, flatbuffers' 2>/dev/null") != 0) {
        printf(
            "SKIPPED uses of imported models: no Python with the packages tflite, numpy and flatbuffers\n");
        return;
    }
    assert_int_equal(with_python("tests/import/uses.py"), 0);
}

static void networks_that_label_pixels_are_recognised_or_refused(void **state)
{
    (void)state;
    if (with_python("-c 'import tflite, numpy, flatbuffers' 2>/dev/null") != 0) {
        printf(
            "SKIPPED networks that label pixels: no Python with the packages tflite, numpy and flatbuffers\n");
        return;
    }
    assert_int_equal(with_python("tests/import/segments.py"), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(networks_that_label_pixels_are_recognised_or_refused),
        cmocka_unit_test(uses_are_written_and_refused_as_they_should_be)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
