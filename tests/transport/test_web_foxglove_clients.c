/* Foxglove's websocket protocol of fovea-web as programs of others see it, by foxglove_check.py and
 * foxglove_client.cjs beside this: clients of PyPI and npm, answers held against those of
 * foxglove-sdk's server, and messages against those of tools/foxglove/views.py. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/build_folder.h"
#include "common/watched.h"
#include "common/patience.h"
#include "common/web_case.h"

static char folder[] = "/tmp/fovea_foxglove_XXXXXX";
static char socket_path[64], recording[64], further[64];

static bool has(const char *what)
{
    char path[600];
    snprintf(path, sizeof path, "%s/foxglove-venv/%s", build_folder(), what);
    if (getenv("FOVEA_EMULATED") == NULL && access(path, F_OK) == 0) return true;
    printf(
        "SKIPPED test_web_foxglove_clients: in part: it needs what tools/foxglove_python.sh gets (%s)\n",
        what);
    return false;
}

static void check(const char *arguments)
{
    char command[1600];
    snprintf(command, sizeof command,
             "%s/foxglove-venv/bin/python tests/transport/foxglove_check.py %s", build_folder(),
             arguments);
    assert_int_equal(system(command), 0);
}

static void messages_are_those_of_views_py(void **state)
{
    char words[256];
    (void)state;
    if (!has("ready")) return;
    char command[1200];
    snprintf(command, sizeof command,
             "%s/fovea run --source 'sim:orbit?width=320&height=240&frames=110' --model "
             "src/detect/shipped.fvm --quiet --picture none --set lcm_url= --set loop.priority=0 "
             "--set preview.period_frames=10 --set map_every=1 --record %s",
             build_folder(), recording);
    assert_int_equal(system(command), 0);
    snprintf(words, sizeof words, "make %s %s", recording, further);
    check(words);
    const char *const arguments[] = {"--play", further, NULL};
    start(arguments);
    snprintf(words, sizeof words, "views %s", further);
    check(words);
    end();
}

static void start_run(const char *const *more)
{
    char feed[96];
    snprintf(feed, sizeof feed, "web.socket=%s", socket_path);
    const char *arguments[32] = {WATCHED_RUN("sim:orbit?width=320&height=240&frames=1000000"),
                                 "--set",
                                 "loop.priority=0",
                                 "--set",
                                 feed,
                                 "--set",
                                 "commands=[parameters]"};
    for (int i = 0; more[i] != NULL; i++)
        arguments[13 + i] = more[i];
    watched_start(&watched, "run", arguments);
    int64_t end_ns = 0;
    int probe;
    while ((probe = web_connect()) < 0 && fv_test_patient(&end_ns, 10)) {
    }
    assert_true(probe >= 0);
    close(probe);
}

static void answers_are_those_of_foxglove_sdk(void **state)
{
    static const char *const page[] = {"--web", NULL};
    (void)state;
    if (!has("ready")) return;
    start_run(page);
    check("live");
    end_run();
}

static void a_robot_that_is_heard_is_shown(void **state)
{
    static const char *const sends[] = {"--set", "preview.period_frames=4", NULL};
    const char *const arguments[] = {"--lcm", "udpm://239.255.76.67:7667", "--listen", "loopback",
                                     NULL};
    (void)state;
    if (!has("ready")) return;
    start(arguments);
    start_run(sends);
    check("heard");
    end_run();
    end();
}

static void the_client_of_npm_understands_it(void **state)
{
    static const char *const page[] = {"--web", NULL};
    char command[1600];
    (void)state;
    if (!has("npm-ready")) return;
    start_run(page);
    snprintf(command, sizeof command,
             "node tests/transport/foxglove_client.cjs %s/foxglove-venv/node_modules",
             build_folder());
    assert_int_equal(system(command), 0);
    end_run();
}

int main(void)
{
    char command[200];
    if (!web_possible("test_web_foxglove_clients") ||
        !watched_possible("test_web_foxglove_clients"))
        return 0;
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(socket_path, sizeof socket_path, "%s/feed", folder);
    snprintf(recording, sizeof recording, "%s/run.lcm", folder);
    snprintf(further, sizeof further, "%s/further.lcm", folder);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(messages_are_those_of_views_py, tear_down),
        cmocka_unit_test_teardown(answers_are_those_of_foxglove_sdk, tear_down),
        cmocka_unit_test_teardown(a_robot_that_is_heard_is_shown, tear_down),
        cmocka_unit_test_teardown(the_client_of_npm_understands_it, tear_down),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    snprintf(command, sizeof command, "rm -r %s", folder);
    return system(command) != 0 || failed;
}
