/* tools/mcap.py, by mcap_check.py beside it: a recording in MCAP opens in the reader of PyPI's mcap
 * with every message and exact stamps, what Foxglove shows of it is right, and the recording comes
 * back to the byte. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/build_folder.h"

static void a_recording_survives_mcap_and_is_shown_rightly(void **state)
{
    (void)state;
    char folder[] = "/tmp/fovea_mcap_XXXXXX", command[3000];
    assert_non_null(mkdtemp(folder));
    snprintf(
        command, sizeof command,
        "%s/fovea run --source 'sim:orbit?width=320&height=240&frames=40' --set odometry.landmarks=3000 --model src/detect/shipped.fvm --quiet --picture none --set lcm_url= --set loop.priority=0 --set preview.period_frames=10 --set map_every=1 --record %s/run.lcm"
        " && mkdir %s/made && %s/mcap-venv/bin/python tests/transport/mcap_check.py %s/run.lcm %s/made",
        build_folder(), folder, folder, build_folder(), folder, folder);
    const int status = system(command);
    snprintf(command, sizeof command, "rm -r %s", folder);
    assert_int_equal(system(command), 0);
    assert_int_equal(status, 0);
}

int main(void)
{
    char ready[600];
    snprintf(ready, sizeof ready, "%s/mcap-venv/ready", build_folder());
    if (getenv("FOVEA_EMULATED") != NULL || access(ready, F_OK) != 0) {
        printf(
            "SKIPPED test_mcap: it starts programs, and needs the Python of tools/mcap_python.sh\n");
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_recording_survives_mcap_and_is_shown_rightly),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
