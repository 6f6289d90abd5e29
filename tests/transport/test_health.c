/* The health of a whole run: on a machine whose sysfs says that it is hot, less work is granted and
 * health_t says so; the recording replays to the bit all the same. On one that says nothing, all
 * parts of the host are well. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/build_folder.h"
#include "common/datasets.h"

#include "fovea_grants_t.h"
#include "fovea_health_t.h"
#include "support/lcmlog.h"

static char folder[FV_TEST_IN_MEMORY_BYTES];

static void shell(const char *format, ...) __attribute__((format(printf, 1, 2)));
static void shell(const char *format, ...)
{
    char command[3000];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(command, sizeof command, format, arguments);
    va_end(arguments);
    if (system(command) != 0) fail_msg("%s", command);
}

/* The reason of the part `host` in the last health_t of the log. Returns how many there were. */
static int last_reason(char reason[128], int *state)
{
    char path[256];
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    int count = 0;
    snprintf(path, sizeof path, "%s/sent.log", folder);
    if (fv_lcmlog_open(path, &log, &error) != FOVEA_OK) fail_msg("%s", error.text);
    while (fv_lcmlog_next(log, &event, &error) == FOVEA_OK) {
        fovea_health_t health;
        if (strcmp(event.channel, "FOVEA_HEALTH") != 0) continue;
        assert_true(fovea_health_t_decode(event.data, 0, (int)event.bytes, &health) > 0);
        assert_true(health.run_id != 0 && health.utime > 0 && health.count >= 6);
        assert_string_equal(health.parts[0].name, "self_test");
        assert_int_equal(health.parts[0].state, FOVEA_HEALTH_T_STATE_OK);
        const fovea_health_part_t *host = &health.parts[health.count - 1];
        assert_string_equal(host->name, "host");
        assert_true(health.state >= host->state);
        snprintf(reason, 128, "%s", host->reason);
        *state = host->state;
        count++;
        fovea_health_t_decode_cleanup(&health);
    }
    fv_lcmlog_close(log);
    return count;
}

static void run(const char *root)
{
    shell(
        "FOVEA_SYS_ROOT=%s/%s %s/fovea run --source 'sim:orbit?width=160&height=120' --rate real --frames 60 --quiet"
        " --picture none --set 'lcm_url=file://%s/sent.log?mode=w' --set loop.priority=0 --set record_buffer=1000 --record %s/run.log"
        " && %s/fovea replay %s/run.log --verify >%s/said",
        folder, root, build_folder(), folder, folder, build_folder(), folder, folder);
}

/* What the jobs of the recording were granted together in the first work that had time to give
 * away, beyond what they always get. No unit was measured before it: only the period, its share and
 * the step before come in. */
static int first_granted(void)
{
    char path[256];
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    int always = 0, first = 0;
    snprintf(path, sizeof path, "%s/run.log", folder);
    for (int pass = 0; pass < 2; pass++) {
        if (fv_lcmlog_open(path, &log, &error) != FOVEA_OK) fail_msg("%s", error.text);
        for (int n = 0; fv_lcmlog_next(log, &event, &error) == FOVEA_OK;) {
            fovea_grants_t grants;
            int sum = 0;
            if (strcmp(event.channel, "FOVEA_GRANTS") != 0) continue;
            assert_true(fovea_grants_t_decode(event.data, 0, (int)event.bytes, &grants) > 0);
            for (int i = 0; i < grants.job_count; i++)
                sum += grants.units[i];
            if (pass == 0 && (n++ == 0 || sum < always)) always = sum;
            if (pass == 1 && first == 0 && sum > always) first = sum - always;
            fovea_grants_t_decode_cleanup(&grants);
        }
        fv_lcmlog_close(log);
    }
    return first;
}

static int granted_hot; /* of half the period: at most 0.85 * 33.3 ms / 2 in units of 0.25 ms */

static void heat_is_said_and_replays(void **unused)
{
    (void)unused;
    char reason[128] = "";
    int state = -1;
    shell(
        "mkdir -p %s/hot/sys/class/thermal/thermal_zone0 && cd %s/hot/sys/class/thermal/thermal_zone0"
        " && echo cpu-thermal >type && echo 78500 >temp",
        folder, folder);
    run("hot");
    assert_true(last_reason(reason, &state) >= 1);
    assert_int_equal(state, FOVEA_HEALTH_T_STATE_DEGRADED);
    assert_string_equal(reason,
                        "78.5 degrees, the limit is 80.0; work is kept to 50 % of the period");
    granted_hot = first_granted();
    assert_in_range(granted_hot, 1, 56);
}

static void a_machine_that_says_nothing_is_well(void **unused)
{
    (void)unused;
    char reason[128] = "?";
    int state = -1;
    run("none");
    assert_true(last_reason(reason, &state) >= 1);
    assert_int_equal(state, FOVEA_HEALTH_T_STATE_OK);
    assert_string_equal(reason, "");
    assert_true(first_granted() > granted_hot);
}

/* A run that is killed has begun and has not ended. How many of its frames are processed by the
 * clock is the machine's affair. */
static void counters_survive_a_kill(void **unused)
{
    (void)unused;
    const char *run =
        "fovea run --source 'sim:orbit?width=160&height=120' --rate real --quiet --picture none --set lcm_url="
        " --set loop.priority=0 --set health.state_file=";
    shell("%s/%s%s/state --frames 30", build_folder(), run, folder);
    shell(
        "%s/%s%s/state & pid=$!; for i in $(seq 600); do grep -q 'starts: 2' %s/state && break; sleep 0.1; done; kill -9 $pid; wait $pid; test $? = 137",
        build_folder(), run, folder, folder);
    shell("grep '^frames: [1-9]' %s/state >%s/before", folder, folder);
    shell("%s/%s%s/state --frames 30", build_folder(), run, folder);
    shell("grep -qx 'starts: 3' %s/state && grep -qx 'ends: 2' %s/state", folder, folder);
    shell(
        "before=$(cut -d' ' -f2 %s/before) && after=$(sed -n 's/^frames: //p' %s/state) && test $after -gt $before",
        folder, folder);
}

/* A robot does not stand still for counters that are damaged; those stay as they are. As a unit of
 * systemd it has a place for them by itself. */
static void a_run_goes_on_without_counters(void **unused)
{
    (void)unused;
    const char *run =
        "fovea run --source 'sim:orbit?width=160&height=120' --rate real --quiet --picture none --set lcm_url="
        " --set loop.priority=0 --frames 5";
    shell("echo junk >%s/damaged", folder);
    shell("%s/%s --set health.state_file=%s/damaged 2>%s/said", build_folder(), run, folder,
          folder);
    shell("grep -q \"damaged: line 1: found 'junk', expected\" %s/said", folder);
    shell("echo junk | cmp - %s/damaged", folder);
    /* A wrong name is refused before anything is made. */
    shell("%s/%s --set health.state_file=%s/none/kept 2>%s/said; test $? = 2", build_folder(), run,
          folder, folder);
    shell("grep -q 'health.state_file: .*none/kept: cannot be written' %s/said", folder);
    shell("echo 'lcm_url: \"\"' >%s/front.yaml", folder);
    shell("STATE_DIRECTORY=%s %s/%s --config %s/front.yaml", folder, build_folder(), run, folder);
    shell("grep -qx 'ends: 1' %s/front.health", folder);
    /* That place may be gone, as on a disk that has failed. */
    shell("STATE_DIRECTORY=%s/gone %s/%s --config %s/front.yaml 2>%s/said", folder, build_folder(),
          run, folder, folder);
    shell("grep -q 'gone/front.health: cannot be written' %s/said", folder);
}

int main(void)
{
    if (getenv("FOVEA_EMULATED") != NULL) {
        puts("SKIPPED: the program is not started under an emulator");
        return 0;
    }
    fv_test_folder_in_memory(folder);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(heat_is_said_and_replays),
        cmocka_unit_test(a_machine_that_says_nothing_is_well),
        cmocka_unit_test(counters_survive_a_kill),
        cmocka_unit_test(a_run_goes_on_without_counters),
    };
    const int failed = cmocka_run_group_tests_name("health of a run", tests, NULL, NULL);
    fv_test_folder_remove(folder);
    return failed != 0;
}
