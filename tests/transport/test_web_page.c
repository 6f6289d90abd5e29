/* The page of fovea-web in a headless Chromium, by web_page.py beside it: picture, boxes at the
 * right pixels, path, commands, widths, accessibility, a run that begins again, login. */
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

static void a_browser_shows_the_run(void **state)
{
    (void)state;
    char folder[] = "/tmp/fovea_page_XXXXXX", command[2000];
    assert_non_null(mkdtemp(folder));
    snprintf(command, sizeof command,
             "%s/browser-venv/bin/python tests/transport/web_page.py %s %s", build_folder(),
             build_folder(), folder);
    const int status = system(command);
    snprintf(command, sizeof command, "rm -r %s", folder);
    assert_int_equal(system(command), 0);
    assert_int_equal(status, 0);
}

int main(void)
{
    char ready[600];
    snprintf(ready, sizeof ready, "%s/browser-venv/ready", build_folder());
    if (getenv("FOVEA_EMULATED") != NULL || access(ready, F_OK) != 0 ||
        access("/usr/bin/chromium", X_OK) != 0 || access("/usr/bin/chromedriver", X_OK) != 0) {
        printf("SKIPPED test_web_page: it needs chromium, chromium-driver and the Python of "
               "tools/browser_python.sh\n");
        return 0;
    }
    if (!web_possible("test_web_page") || !watched_possible("test_web_page")) return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_browser_shows_the_run),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
