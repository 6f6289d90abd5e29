/* The bot_core pose, recorded by a run of the program and read by a decoder in Python that knows
 * the published layout only (bot_core_pose.py). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "common/build_folder.h"

static void poses_are_as_libbot2_lays_them_out(void **state)
{
    (void)state;
    char command[2048];
    snprintf(
        command, sizeof command,
        "%s/fovea run --source 'sim:orbit?width=320&height=240&frames=60' --quiet --picture none --set lcm_url= --set scale.allow_unscaled=true --set loop.priority=0 --record %s/bot_core_pose.lcm && python3 tests/transport/bot_core_pose.py %s/bot_core_pose.lcm",
        build_folder(), build_folder(), build_folder());
    assert_int_equal(system(command), 0);
}

int main(void)
{
    if (getenv("FOVEA_EMULATED") != NULL) {
        puts("SKIPPED test_bot_core_pose: it starts the program itself");
        return 0;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(poses_are_as_libbot2_lays_them_out)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
