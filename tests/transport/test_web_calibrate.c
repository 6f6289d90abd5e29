/* The page of fovea-calibrate camera in a headless Chromium, by calibrate_page.py beside it: from
 * the first picture to the verdict, with a simulated board, also of a run by its page. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/build_folder.h"
#include "common/watched.h"
#include "common/web_client.h"

static void a_browser_leads_from_the_first_picture_to_the_verdict(void **state)
{
    (void)state;
    char folder[] = "/tmp/fovea_page_XXXXXX", command[2000];
    assert_non_null(mkdtemp(folder));
    snprintf(command, sizeof command,
             "%s/browser-venv/bin/python tests/transport/calibrate_page.py %s %s", build_folder(),
             build_folder(), folder);
    const int status = system(command);
    snprintf(command, sizeof command, "rm -r %s", folder);
    assert_int_equal(system(command), 0);
    assert_int_equal(status, 0);
}

int main(void)
{
    char ready[600], program[600];
    snprintf(ready, sizeof ready, "%s/browser-venv/ready", build_folder());
    snprintf(program, sizeof program, "%s/fovea-calibrate", build_folder());
    if (getenv("FOVEA_EMULATED") != NULL || access(ready, F_OK) != 0 ||
        access(program, X_OK) != 0 || access("/usr/bin/chromium", X_OK) != 0 ||
        access("/usr/bin/chromedriver", X_OK) != 0) {
        printf(
            "SKIPPED test_web_calibrate: it needs fovea-calibrate, chromium, chromium-driver and "
            "the Python of tools/browser_python.sh\n");
        return 0;
    }
    if (!web_possible("test_web_calibrate") || !watched_possible("test_web_calibrate")) return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_browser_leads_from_the_first_picture_to_the_verdict),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
