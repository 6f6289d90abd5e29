/* The jar of message types for lcm-spy: LCM's Java reads every message of a run with it
 * (ReadRecording.java). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/build_folder.h"

#define LCM_JAR "/usr/share/java/lcm.jar"

static void every_message_is_read_by_java(void **state)
{
    (void)state;
    char command[4096];
    snprintf(
        command, sizeof command,
        "%s/fovea run --source 'sim:?width=320&height=240' --frames 60 --model src/detect/shipped.fvm --quiet --picture none --set lcm_url= --set scale.allow_unscaled=true --set loop.priority=0 --record %s/jar.lcm && java -Xshare:auto -cp " LCM_JAR
        ":%s/fovea-types.jar tests/transport/ReadRecording.java %s/jar.lcm FOVEA_POSE FOVEA_CAMERA_POSE FOVEA_BOT_CORE_POSE FOVEA_FEATURES FOVEA_STATISTICS FOVEA_CAMERA_STATUS FOVEA_PREVIEW FOVEA_MAP FOVEA_DETECTIONS FOVEA_OBJECTS FOVEA_FRAME FOVEA_INPUTS FOVEA_GRANTS FOVEA_RECORDING FOVEA_RECORDING_END; status=$?; rm -f %s/jar.lcm; exit $status",
        build_folder(), build_folder(), build_folder(), build_folder(), build_folder());
    assert_int_equal(system(command), 0);
}

int main(void)
{
    char jar[560];
    snprintf(jar, sizeof jar, "%s/fovea-types.jar", build_folder());
    if (access(jar, R_OK) != 0 || access(LCM_JAR, R_OK) != 0 || getenv("FOVEA_EMULATED") != NULL) {
        puts(
            "SKIPPED test_jar: no jar of types in this build ('make jar' installs Java), or emulated");
        return 0;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_message_is_read_by_java)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
