/* The bot_core pose, recorded by a run of the program and read by a decoder in Python that knows
 * the published layout only (bot_core_pose.py). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

static char build[512]; /* folder that this program was built into */

static void poses_are_as_libbot2_lays_them_out(void **state)
{
    (void)state;
    char command[2048];
    snprintf(
        command, sizeof command,
        "%s/fovea run --source 'sim:orbit?width=320&height=240&frames=60' --quiet --picture none --set lcm_url= --set scale.allow_unscaled=true --set loop.priority=0 --record %s/bot_core_pose.lcm && python3 tests/transport/bot_core_pose.py %s/bot_core_pose.lcm",
        build, build, build);
    assert_int_equal(system(command), 0);
}

int main(int argc, char **argv)
{
    (void)argc;
    char path[512];
    snprintf(path, sizeof path, "%s", argv[0]); /* BUILD/tests/transport/NAME */
    snprintf(build, sizeof build, "%s", dirname(dirname(dirname(path))));
    if (getenv("FOVEA_EMULATED") != NULL) {
        puts("SKIPPED test_bot_core_pose: it starts the program itself");
        return 0;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(poses_are_as_libbot2_lays_them_out)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
