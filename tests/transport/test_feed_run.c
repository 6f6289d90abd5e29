/* The feed of `fovea run` without LCM: `fovea echo`, `fovea top` and `fovea snapshot` read it, a
 * PNG is the very frame that was processed, and the run's results are the same to the byte with and
 * without readers. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/build_folder.h"
#include "common/patience.h"
#include "common/watched.h"
#include "support/lcmlog.h"
#include "support/picture.h"
#include "support/text.h"

#include "fovea_frame_t.h"

enum { TEXT_BYTES = 1 << 16 };
#define HALF "features.count_max=500" /* what is seen is judged elsewhere */

static char folder[] = "/tmp/fovea_feed_run_XXXXXX", path[64];
static struct watched watched;
static struct fovea_error error;

static int set_up(void **state)
{
    (void)state;
    if (mkdtemp(folder) == NULL) return -1;
    snprintf(path, sizeof path, "%s/s", folder);
    return 0;
}

static int tear_down(void **state)
{
    char command[64];
    (void)state;
    snprintf(command, sizeof command, "rm -r %s", folder);
    return system(command);
}

/* `fovea` with these words, in which @ is the folder; what it prints, and its exit code. */
static int fovea(const char *words, char text[TEXT_BYTES])
{
    char command[PATH_MAX + 2048];
    size_t used = (size_t)snprintf(command, sizeof command, "%s/fovea ", build_folder());
    for (const char *at = words; *at != '\0' && used < sizeof command - 80; at++)
        used += (size_t)(*at == '@' ? sprintf(command + used, "%s", folder)
                                    : sprintf(command + used, "%c", *at));
    snprintf(command + used, sizeof command - used, " 2>&1");
    FILE *pipe = popen(command, "r");
    assert_non_null(pipe);
    const size_t got = fread(text, 1, TEXT_BYTES - 1, pipe);
    text[got] = '\0';
    const int status = pclose(pipe);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void start_run(const char *source, const char *setting)
{
    char socket[96], record[96];
    snprintf(socket, sizeof socket, "web.socket=%s", path);
    snprintf(record, sizeof record, "%s/run.lcm", folder);
    const char *const arguments[] = {"--source",
                                     source,
                                     "--rate",
                                     "real",
                                     "--quiet",
                                     "--picture",
                                     "none",
                                     "--record",
                                     record,
                                     "--set",
                                     "lcm_url=",
                                     "--set",
                                     socket,
                                     "--set",
                                     "channel_prefix=R",
                                     "--set",
                                     "record_buffer=1000",
                                     "--set",
                                     setting,
                                     NULL};
    watched_start(&watched, "run", arguments);
    int64_t end_ns = 0;
    while (access(path, F_OK) != 0 && fv_test_patient(&end_ns, 10)) {
    }
}

/* The frame of this sequence in the recording, whose pixels are `picture`. */
static void assert_recorded(int64_t sequence, const struct fovea_image *picture)
{
    char record[96];
    struct fv_lcmlog *log = NULL;
    struct fv_lcmlog_event event;
    bool found = false;
    snprintf(record, sizeof record, "%s/run.lcm", folder);
    if (fv_lcmlog_open(record, &log, &error) != FOVEA_OK) fail_msg("%s", error.text);
    while (!found && fv_lcmlog_next(log, &event, &error) == FOVEA_OK) {
        fovea_frame_t frame;
        if (strcmp(event.channel, "R_FRAME") != 0) continue;
        assert_true(fovea_frame_t_decode(event.data, 0, (int)event.bytes, &frame) > 0);
        if (frame.stamp.sequence == sequence) {
            found = true;
            assert_int_equal(frame.images[0].size_bytes, picture->size_bytes);
            assert_memory_equal(frame.images[0].data, picture->data, picture->size_bytes);
        }
        fovea_frame_t_decode_cleanup(&frame);
    }
    fv_lcmlog_close(log);
    assert_true(found);
}

static void commands_read_a_run_without_lcm(void **state)
{
    static char text[TEXT_BYTES];
    char png[96];
    struct fovea_image picture;
    (void)state;
    start_run("sim:orbit?width=320&height=240&rate=15&frames=100000", HALF);
    assert_int_equal(fovea("snapshot @/raw.png --feed @/s --timeout 120", text), 0);
    const char *at = strstr(text, "320 x 240 pixels of cam0, frame ");
    assert_non_null(at);
    const long long sequence = strtoll(strstr(at, "frame ") + 6, NULL, 10);
    assert_int_equal(fovea("snapshot @/preview.jpg --feed @/s --timeout 120", text), 0);
    assert_non_null(strstr(text, "of R_PREVIEW"));
    assert_int_equal(fovea("echo R_RUN --count 1 --feed @/s", text), 0);
    assert_non_null(strstr(text, "{\"channel\":\"R_RUN\""));
    assert_int_equal(fovea("echo '*_POSE' --count 10 --feed @/s", text), 0);
    assert_non_null(strstr(text, "{\"channel\":\"R_CAMERA_POSE\""));
    int64_t end_ns = 0;
    int heard;
    while ((heard = fovea("top --once --feed @/s", text)) == 1 && fv_test_patient(&end_ns, 0)) {
    } /* a run that is slow sends nothing for an interval */
    assert_int_equal(heard, 0);
    assert_non_null(strstr(text, "\nR "));
    assert_int_equal(
        fovea(
            "run --source sim:orbit --frames 1 --quiet --picture none --set lcm_url= --set web.socket=@/s",
            text),
        2);
    assert_non_null(strstr(text, "web.socket"));
    watched_interrupt(&watched);
    assert_int_equal(watched_end(&watched), 0);
    assert_int_not_equal(access(path, F_OK), 0);
    assert_int_equal(fovea("echo R_POSE --feed @/s", text), 1);
    assert_non_null(strstr(text, "found no run that offers its feed there"));
    assert_int_equal(fovea("echo R_POSE --feed @/s --listen any", text), 2);
    snprintf(png, sizeof png, "%s/raw.png", folder);
    if (fv_picture_read(png, &picture, &error) != FOVEA_OK) fail_msg("%s", error.text);
    assert_recorded(sequence, &picture);
    free((void *)(uintptr_t)picture.data);
}

/* Recordings pad rows to whole cache lines. */
static void frames_with_padded_rows_are_offered(void **state)
{
    static char text[TEXT_BYTES];
    char source[96];
    (void)state;
    assert_int_equal(fovea("export @/e --source 'sim:orbit?width=108&height=80' --frames 90", text),
                     0);
    snprintf(source, sizeof source, "images:%s/e", folder);
    start_run(source, "odometry.enabled=false");
    if (fovea("snapshot @/padded.png --feed @/s --timeout 120", text) != 0) fail_msg("%s", text);
    assert_non_null(strstr(text, "108 x 80 pixels of cam0"));
    watched_interrupt(&watched);
    assert_int_equal(watched_end(&watched), 0);
}

/* Messages and frames, from the start of a run to its end. */
static pid_t start_reader(void)
{
    const pid_t reader = fork();
    if (reader != 0) return reader;
    const char *const arguments[] = {"read.png", "--feed", path, NULL};
    if (chdir(folder) != 0 || freopen("/dev/null", "w", stderr) == NULL ||
        freopen("/dev/null", "w", stdout) == NULL)
        _exit(1);
    for (;;) {
        const pid_t once = fork();
        if (once == 0) watched_exec("snapshot", arguments);
        waitpid(once, NULL, 0);
        usleep(5000);
    }
}

/* The trajectory of a run, from malloc; `read`: of one whose feed is read. */
static char *track_of(bool read, size_t *bytes)
{
    static char text[TEXT_BYTES];
    char words[400], file[96], *track;
    snprintf(words, sizeof words,
             "run --source 'sim:orbit?width=320&height=240' --frames 180 --quiet --picture none "
             "--set " HALF " --set lcm_url= --trajectory @/%d %s",
             read, read ? "--set web.socket=@/s" : "");
    const pid_t reader = read ? start_reader() : 0;
    assert_int_equal(fovea(words, text), 0);
    if (reader > 0) {
        kill(reader, SIGKILL);
        waitpid(reader, NULL, 0);
    }
    snprintf(file, sizeof file, "%s/%d", folder, read);
    if (fv_text_read(file, 1 << 20, &track, bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
    return track;
}

/* A reader that has no processor while the run lasts is tried again. */
static void a_feed_changes_no_result(void **state)
{
    char file[96];
    size_t bytes, read_bytes;
    (void)state;
    char *track = track_of(false, &bytes);
    snprintf(file, sizeof file, "%s/read.png", folder);
    for (int tries = 0; tries < 10 && access(file, F_OK) != 0; tries++) {
        char *read = track_of(true, &read_bytes);
        assert_true(bytes > 1000);
        assert_int_equal(bytes, read_bytes);
        assert_memory_equal(track, read, bytes);
        free(read);
    }
    assert_int_equal(access(file, F_OK), 0); /* somebody did read */
    free(track);
}

int main(void)
{
    if (!watched_possible("test_feed_run")) return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(commands_read_a_run_without_lcm),
        cmocka_unit_test(frames_with_padded_rows_are_offered),
        cmocka_unit_test(a_feed_changes_no_result),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
