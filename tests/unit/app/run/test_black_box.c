/* Runs that end, runs that are killed and pairs of runs, in any order, over one folder of numbered
 * recordings and one map. A model says what must be there after each: every recording ever seen,
 * with the bytes it had; one more for each run that ended in order, and that one replays; every
 * recording readable, that of a kill up to its last instant; every map that later ones have not
 * pushed out. FOVEA_KILLS: how many runs are killed (6); the campaign says 200, five times. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include <dirent.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "app/command.h"
#include "app/config/map_file.h"
#include "app/record/recording_file.h"
#include "app/record/replay.h"
#include "base/hash.h"
#include "base/elementary.h"
#include "common/datasets.h"
#include "map/archive.h"
#include "support/lcmlog.h"

enum { FILES_MAX = 1024, MAPS_KEPT = 10, SAFE = MAPS_KEPT - 2, SECONDS_MAX = 300 };

static char *const folder = fv_test_place;
static char box[FV_TEST_PATH_BYTES + 8], map[FV_TEST_PATH_BYTES + 8];
static struct fv_random random_;
static uint64_t seed;
static int op; /* number of the operation, for messages */

#define FAIL(...)                                                                                  \
    do {                                                                                           \
        print_error("seed %llu, operation %d: ", (unsigned long long)seed, op);                    \
        fail_msg(__VA_ARGS__);                                                                     \
    } while (0)

/* ---- runs ------------------------------------------------------------------------------------ */

static pid_t begin_run(uint32_t frames)
{
    char source[128], count[16], keep[32];
    snprintf(source, sizeof source, "sim:orbit?width=320&height=240&rate=100&seed=%u",
             (unsigned)fv_random_below(&random_, 1 << 20));
    snprintf(count, sizeof count, "%u", (unsigned)frames);
    snprintf(keep, sizeof keep, "map.keep=%d", MAPS_KEPT);
    fflush(NULL);
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child != 0) return child;
    const char *words[] = {"fovea",
                           "run",
                           "--source",
                           source,
                           "--rate",
                           "real",
                           "--record",
                           box,
                           "--save-map",
                           map,
                           "--picture",
                           "none",
                           "--quiet",
                           "--set",
                           "lcm_url=",
                           "--set",
                           keep,
                           "--set",
                           "record_buffer=300", /* other runs' syncs hold up writes */
                           "--frames",
                           count,
                           NULL};
    int words_count = 0;
    while (words[words_count] != NULL)
        words_count++;
    alarm(SECONDS_MAX);
    char said[sizeof map + 32];
    snprintf(said, sizeof said, "%s/said.%d", folder, (int)getpid());
    if (freopen(said, "w", stderr) == NULL) _exit(99);
    exit(fv_dispatch(words_count, (char **)(uintptr_t)words));
}

static int64_t now_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    return now.tv_sec * INT64_C(1000000) + now.tv_nsec / 1000;
}

static void wait_some(uint32_t most_ms)
{
    const int64_t us = 1000 * (int64_t)fv_random_below(&random_, most_ms);
    nanosleep(&(struct timespec){.tv_sec = us / 1000000, .tv_nsec = us % 1000000 * 1000}, NULL);
}

/* ---- the model ------------------------------------------------------------------------------- */

static struct {
    char name[64];
    uint64_t hash;
} known[FILES_MAX];
static int known_count, closed_count;
static uint64_t maps[FILES_MAX]; /* hashes of those that must still be there */
static int maps_count;
static int64_t oldest_us; /* longest time from the last write to the kill */

static uint64_t hash_of(const char *path)
{
    size_t bytes;
    void *data = fv_test_read(path, &bytes);
    const uint64_t hash = fv_hash(FV_HASH_START, data, bytes);
    free(data);
    return hash;
}

/* One that was killed: every event up to the cut is well-formed. `killed_us`: 0, or when. */
static void read_killed(const char *path, int64_t killed_us)
{
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event = {.time_us = 0};
    struct fovea_error error;
    enum fovea_status status;
    struct stat about;
    int count = 0;
    bool ended = false;
    if (fv_lcmlog_open(path, &log, &error) != FOVEA_OK) FAIL("%s", error.text);
    while ((status = fv_lcmlog_next(log, &event, &error)) == FOVEA_OK) {
        ended = fv_lcmlog_channel_is(event.channel, "RECORDING_END");
        count++;
    }
    /* Only the last event may be cut off. */
    if (status != FOVEA_END && strstr(error.text, "cut off") == NULL) FAIL("%s", error.text);
    fv_lcmlog_close(log);
    assert_int_equal(stat(path, &about), 0);
    const int64_t age_us =
        killed_us - about.st_mtim.tv_sec * INT64_C(1000000) - about.st_mtim.tv_nsec / 1000;
    if (count > 0 && !ended && age_us > oldest_us) oldest_us = age_us;
}

static void read_closed(const char *path)
{
    struct fv_replay_result result;
    struct fovea_error error;
    if (fv_replay(path, FV_REPLAY_STOPS, NULL, NULL, &result, &error) != FOVEA_OK)
        FAIL("%s", error.text);
    if (result.difference[0] != '\0') FAIL("%s: %s", path, result.difference);
}

/* `added`: runs that ended in order since the last look; `runs`: all of them. */
static void look_at_recordings(int added, int runs, int64_t killed_us)
{
    const int closed_before = closed_count, known_before = known_count;
    bool seen[FILES_MAX] = {false};
    DIR *list = opendir(box);
    for (const struct dirent *entry; list != NULL && (entry = readdir(list)) != NULL;) {
        struct fv_recording_name read;
        char path[sizeof box + 256];
        int i = 0;
        if (entry->d_name[0] == '.') continue;
        if (!fv_recording_name_read(entry->d_name, &read)) FAIL("found %s", entry->d_name);
        snprintf(path, sizeof path, "%s%s", box, entry->d_name);
        const uint64_t hash = hash_of(path);
        while (i < known_count && strcmp(known[i].name, entry->d_name) != 0)
            i++;
        if (i < known_count && known[i].hash != hash) FAIL("%s has changed", path);
        seen[i] = true;
        if (i < known_count) continue;
        known[i].hash = hash;
        snprintf(known[i].name, sizeof known[i].name, "%.63s", entry->d_name);
        known_count++;
        closed_count += !read.open;
        if (read.open)
            read_killed(path, killed_us);
        else
            read_closed(path);
    }
    if (list != NULL) closedir(list);
    for (int i = 0; i < known_count; i++)
        if (!seen[i]) FAIL("%s is gone", known[i].name);
    if (closed_count - closed_before < added || known_count - known_before > runs)
        FAIL("%d runs, of which %d ended in order, left %d recordings, %d of them closed", runs,
             added, known_count - known_before, closed_count - closed_before);
}

/* Maps at the first SAFE places of a chain cannot be pushed out by one operation. */
static void look_at_maps(void)
{
    uint64_t now[2 * MAPS_KEPT];
    bool safe[2 * MAPS_KEPT];
    int count = 0;
    for (int i = 0; i < 2 * MAPS_KEPT; i++) {
        char path[sizeof map + 32];
        uint8_t *data;
        size_t bytes;
        struct fovea_error error;
        struct fv_archive_info info;
        const int older = i % MAPS_KEPT;
        int length = snprintf(path, sizeof path, "%s%s", map, i < MAPS_KEPT ? "" : ".small");
        if (older > 0) snprintf(path + length, sizeof path - (size_t)length, ".%d", older);
        if (access(path, F_OK) != 0) {
            if (i == 0 && maps_count > 0) FAIL("%s is gone", path);
            continue;
        }
        if (fv_map_file_read(path, &data, &bytes, &error) != FOVEA_OK ||
            fv_archive_info(data, bytes, path, &info, &error) != FOVEA_OK)
            FAIL("%s", error.text);
        free(data);
        now[count] = hash_of(path);
        safe[count++] = older < SAFE;
    }
    for (int m = 0; m < maps_count; m++) {
        int i = 0;
        while (i < count && now[i] != maps[m])
            i++;
        if (i == count) FAIL("a map is gone");
    }
    maps_count = 0;
    for (int i = 0; i < count; i++)
        if (safe[i]) maps[maps_count++] = now[i];
}

/* ---- the test -------------------------------------------------------------------------------- */

/* Until a run has begun to record; what comes before takes half a second. */
static void wait_for_recording(void)
{
    for (int i = 0; i < 1000; i++) {
        int count = 0;
        DIR *list = opendir(box);
        for (const struct dirent *entry; list != NULL && (entry = readdir(list)) != NULL;)
            count += entry->d_name[0] != '.';
        if (list != NULL) closedir(list);
        if (count > known_count) return;
        nanosleep(&(struct timespec){.tv_nsec = 5000000}, NULL);
    }
}

static int operate(void)
{
    const int runs = 1 + (fv_random_below(&random_, 3) == 0);
    pid_t children[2];
    bool killed[2];
    int kills = 0, added = 0;
    int64_t killed_us = 0;
    for (int i = 0; i < runs; i++) {
        killed[i] = fv_random_below(&random_, 4) > 0;
        children[i] = begin_run(killed[i] ? 20 + fv_random_below(&random_, 100) : 20);
    }
    for (int i = 0; i < runs; i++) {
        if (!killed[i]) continue;
        if (fv_random_below(&random_, 5) > 0) wait_for_recording();
        wait_some(700);
        kill(children[i], SIGKILL);
        killed_us = now_us();
        kills++;
    }
    for (int i = 0; i < runs; i++) {
        int status;
        assert_int_equal(waitpid(children[i], &status, 0), children[i]);
        char said[sizeof map + 32];
        size_t bytes;
        snprintf(said, sizeof said, "%s/said.%d", folder, (int)children[i]);
        if (!killed[i] && status != 0)
            FAIL("a run ended with status %x: %s", (unsigned)status,
                 (const char *)fv_test_read(said, &bytes));
        unlink(said);
        added += WIFEXITED(status) && WEXITSTATUS(status) == 0;
    }
    look_at_recordings(added, runs, runs == 1 ? killed_us : 0);
    look_at_maps();
    return kills;
}

static void runs_and_kills_in_any_order_lose_nothing(void **state)
{
    (void)state;
    const char *asked = getenv("FOVEA_KILLS"), *given = getenv("FOVEA_SEED");
    const int wanted = asked != NULL ? atoi(asked) : getenv("FOVEA_EMULATED") != NULL ? 2 : 6;
    seed = given != NULL ? strtoull(given, NULL, 10) : (uint64_t)time(NULL);
    fv_random_seed(&random_, seed);
    int kills = 0;
    for (op = 0; kills < wanted; op++)
        kills += operate();
    print_message("seed %llu: %d operations, %d kills; %d recordings, %d of them closed; "
                  "killed at most %.0f ms after the last write\n",
                  (unsigned long long)seed, op, kills, known_count, closed_count,
                  (double)oldest_us * 1e-3);
    /* A loaded machine may hold up the loop, so time is judged in the campaign only. */
    const char *campaign = getenv("FOVEA_LONG");
    if (campaign != NULL && *campaign != '\0') assert_true(oldest_us < 1000000);
}

static int set_up(void **state)
{
    if (fv_test_place_set_up(state) != 0) return -1;
    snprintf(box, sizeof box, "%s/box/", folder);
    snprintf(map, sizeof map, "%s/map", folder);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(runs_and_kills_in_any_order_lose_nothing),
    };
    return cmocka_run_group_tests(tests, set_up, fv_test_place_tear_down);
}
