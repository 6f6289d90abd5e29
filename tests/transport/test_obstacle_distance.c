/* tools/examples/obstacle_distance.py between LCM and a receiver of pymavlink, in a network of the
 * test's own: the sectors of scans made by hand and by chance, those of a simulated run until its
 * pose is lost, and wrong arguments (obstacle_distance_check.py). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/build_folder.h"
#include "common/own_network.h"

static void check(const char *part)
{
    char command[2048];
    snprintf(
        command, sizeof command,
        "timeout 300 %s/mavlink-venv/bin/python tests/transport/obstacle_distance_check.py %s %s",
        build_folder(), build_folder(), part);
    assert_int_equal(system(command), 0);
}

static void each_scan_is_a_message_with_its_sectors(void **state)
{
    (void)state;
    check("made");
}

static void a_run_shows_obstacles_where_they_are_until_it_is_lost(void **state)
{
    (void)state;
    check("run");
}

static void wrong_arguments_are_refused_in_a_line(void **state)
{
    (void)state;
    check("arguments");
}

int main(void)
{
    char ready[640];
    snprintf(ready, sizeof ready, "%s/mavlink-venv/ready", build_folder());
    if (getenv("FOVEA_EMULATED") != NULL) {
        puts("SKIPPED test_obstacle_distance: emulated, programs cannot be started");
        return 0;
    }
    if (access(ready, R_OK) != 0) {
        printf("SKIPPED obstacle_distance.py: no Python packages lcm and pymavlink in "
               "%s/mavlink-venv\n",
               build_folder());
        return 0;
    }
    if (!own_network_enter() || !own_network_mend()) {
        puts("SKIPPED obstacle_distance.py: no network of the test's own here");
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_scan_is_a_message_with_its_sectors),
        cmocka_unit_test(a_run_shows_obstacles_where_they_are_until_it_is_lost),
        cmocka_unit_test(wrong_arguments_are_refused_in_a_line),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
