/* Maps loaded into a run that goes on, in a network of the test's own, by the program that users
 * copy: the camera is found in the map; wrong, damaged, too large and foreign ones are refused and
 * change nothing; recordings of it replay bit for bit, and one whose map was tampered with does
 * not. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/build_folder.h"
#include "common/patience.h"
#include "common/watched.h"
#include "support/lcmlog.h"

#include "fovea_pose_t.h"

static char folder[64], tool[700];

static int ask(const char *words, int wait_s, char *text, size_t bytes)
{
    char line[1400];
    snprintf(line, sizeof line, "%s --prefix R --wait %d %s", tool, wait_s, words);
    return watched_shell(line, text, bytes);
}

/* Ask for what changes nothing until the run listens, and answers in time. */
static void await_run(void)
{
    char text[4096];
    int64_t end_ns = 0;
    int code = 3;
    for (int wait_s = 1; code == 3 && fv_test_patient(&end_ns, 0); wait_s *= 2)
        code = ask("maps", wait_s, text, sizeof text);
    assert_int_equal(code, 0);
}

/* Asked once: a second time, a map would be loaded again. */
static void expect(const char *words, int code, const char *said)
{
    char text[4096];
    const int found = ask(words, FV_TEST_PATIENCE_S, text, sizeof text);
    if (found != code || strstr(text, said) == NULL)
        fail_msg("%s: found %d: %sexpected %d: %s", words, found, text, code, said);
}

static void make_map(const char *source, const char *name, const char *options)
{
    char line[1400], text[4096];
    snprintf(line, sizeof line,
             "%s/fovea run --source '%s' --rate max --quiet --picture none --set listen=none --set "
             "lcm_url= --save-map %s/maps/%s %s 2>&1",
             build_folder(), source, folder, name, options);
    if (watched_shell(line, text, sizeof text) != 0) fail_msg("%s: %s", line, text);
}

/* A copy with one bit of its middle changed, or of which only some is there. */
static void spoil(const char *from, const char *to, long cut)
{
    char path[128];
    struct stat there;
    snprintf(path, sizeof path, "%s/%s", folder, from);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    assert_int_equal(fstat(fileno(file), &there), 0);
    uint8_t *data = malloc((size_t)there.st_size);
    assert_non_null(data);
    size_t bytes = fread(data, 1, (size_t)there.st_size, file);
    fclose(file);
    if (cut > 0) bytes -= (size_t)cut;
    for (size_t i = 1000; cut == 0 && i < bytes; i++) /* of a map, or of the one in a recording */
        if (memcmp(data + i - 1000, "FOVEAMAP", 8) == 0) {
            data[i] ^= 4;
            break;
        }
    snprintf(path, sizeof path, "%s/%s", folder, to);
    file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, bytes, file), bytes);
    assert_int_equal(fclose(file), 0);
    free(data);
}

static void replay(const char *file, const char *option, int code, const char *said)
{
    char line[1400], text[4096];
    snprintf(line, sizeof line, "%s/fovea replay %s/%s --verify %s 2>&1", build_folder(), folder,
             file, option);
    const int found = watched_shell(line, text, sizeof text);
    if (found != code || strstr(text, said) == NULL)
        fail_msg("%s: found %d: %sexpected %d: %s", line, found, text, code, said);
}

struct seen {
    int maps, tracked_before, tracked_after;
    int32_t resets, map_id;
};

static struct seen look(const char *file)
{
    char path[128];
    struct seen seen = {0};
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error;
    snprintf(path, sizeof path, "%s/%s", folder, file);
    assert_int_equal(fv_lcmlog_open(path, &log, &error), FOVEA_OK);
    while (fv_lcmlog_next(log, &event, &error) == FOVEA_OK) {
        fovea_pose_t pose;
        seen.maps += strcmp(event.channel, "R_LOADED_MAP") == 0;
        if (strcmp(event.channel, "R_POSE") != 0 ||
            fovea_pose_t_decode(event.data, 0, (int)event.bytes, &pose) < 0)
            continue;
        const bool tracked = pose.state == FOVEA_POSE_T_STATE_TRACKING;
        seen.resets = pose.reset_counter;
        seen.map_id = pose.map_id;
        seen.tracked_before += tracked && seen.maps == 0;
        seen.tracked_after += tracked && seen.maps > 0;
        fovea_pose_t_decode_cleanup(&pose);
    }
    fv_lcmlog_close(log);
    return seen;
}

/* Until most of 20 poses in a row are tracked. */
static void wait_for_tracking(void)
{
    char line[1400], text[64];
    snprintf(line, sizeof line,
             "timeout 60 %s/fovea echo R_POSE --count 20 2>&1 | grep -c '\"state\": 1,'",
             build_folder());
    for (int i = 0; i < 20; i++)
        if (watched_shell(line, text, sizeof text) == 0 && strtol(text, NULL, 10) > 15) return;
}

static void maps_are_loaded_and_replayed(void **state)
{
    static struct watched watched;
    char whole[96], kept[96], maps[96], link[128], line[200];
    (void)state;
    snprintf(folder, sizeof folder, "/tmp/fovea_maps_XXXXXX");
    assert_non_null(mkdtemp(folder));
    snprintf(tool, sizeof tool, "python3 tools/subscribers/command.py --types %s/python",
             build_folder());
    snprintf(maps, sizeof maps, "map.folder=%s/maps", folder);
    snprintf(kept, sizeof kept, "record_folder=%s/records", folder);
    snprintf(whole, sizeof whole, "%s/whole.lcm", folder);
    snprintf(line, sizeof line, "%s/maps", folder);
    assert_int_equal(mkdir(line, 0700), 0);
    make_map("sim:stand?width=320&height=240&frames=190", "here", "--set features.count_max=400");
    make_map("sim:orbit?width=352&height=240&frames=40", "foreign", "--set features.count_max=400");
    make_map("sim:stand?width=320&height=240&frames=60", "large", "");
    spoil("maps/here", "maps/damaged", 0);
    spoil("maps/here", "maps/short", 9);
    snprintf(link, sizeof link, "%s/maps/link", folder);
    assert_int_equal(symlink("here", link), 0);
    snprintf(line, sizeof line, "%s/maps/.hidden", folder);
    assert_int_equal(mkdir(line, 0700), 0);

    const char *const arguments[] = {WATCHED_RUN("sim:stand?width=320&height=240&rate=10"),
                                     "--set",
                                     maps,
                                     "--set",
                                     kept,
                                     "--set",
                                     "channel_prefix=R",
                                     "--set",
                                     "features.count_max=400",
                                     "--set",
                                     "record_buffer=1000",
                                     "--record",
                                     whole,
                                     NULL};
    watched_start(&watched, "run", arguments);
    await_run();
    expect("maps", 0, "here  ");
    expect("load:../maps/here", 1, "refused: found no name of a file");
    expect("load:.hidden", 1, "refused: found no name of a file");
    expect("load:absent", 1, "refused: absent: No such file or directory, expected a map");
    expect("load:link", 1, "refused: link: found a link");
    expect("load:damaged", 1, "refused: damaged: byte ");
    expect("load:short", 1, "refused: short: byte 16: size stated");
    expect("load:foreign", 1, "refused: foreign: byte 24: camera: found 352 x 240");
    expect("load:large", 1, "refused: large: ");
    expect("load:here", 0, "done\n");
    wait_for_tracking();
    expect("record", 0, "done\n");
    expect("load:here", 0, "done\n");
    wait_for_tracking();
    expect("record-stop", 0, "done\n");
    watched_interrupt(&watched);
    assert_int_equal(watched_end(&watched), 0);

    const struct seen seen = look("whole.lcm");
    assert_int_equal(seen.maps, 2); /* what was refused is in no step */
    assert_int_equal(seen.resets, 2);
    assert_true(seen.map_id >= 2);
    assert_true(seen.tracked_after > 0);
    replay("whole.lcm", "", 0, "equal bit for bit");
    replay("records/*Z.lcm", "", 2, "--trust-state"); /* for its state */
    replay("records/*Z.lcm", "--trust-state", 0, "equal bit for bit");
    spoil("whole.lcm", "spoiled.lcm", 0);
    replay("spoiled.lcm", "", 2, "R_LOADED_MAP: the map: byte ");
    watched_remove(folder);
}

int main(void)
{
    if (!watched_possible("test_map_loads")) return 0;
    const struct CMUnitTest tests[] = {cmocka_unit_test(maps_are_loaded_and_replayed)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
