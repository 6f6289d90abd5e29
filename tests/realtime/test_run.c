/* fovea run from end to end, each run in a process of its own: the simulated camera and every
 * recording come through to the end without a heap call of the loop and within their memory; the
 * JSON and the picture are there; a signal ends it. */
#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/command.h"
#include "app/run/heap.h"
#include "common/data_folder.h"
#include "common/datasets.h"
#include "common/patience.h"
#include "support/yaml_tree.h"

/* Of the whole process. */
enum {
    RESIDENT_MAX_BYTES = 32 << 20,
    RESIDENT_FULL_MAX_BYTES =
        40 << 20, /* with room for 256 keyframes, and the simulated world, 15 MB */
    ARGUMENTS_MAX = 24
};

/* Sanitizers are slow, and under them no memory is judged: fewer frames of each source serve. Of
 * threads, what happens between two repeats with every frame. */
#ifdef __SANITIZE_THREAD__
#define FRAMES 12
#elif defined FOVEA_SANITIZED
#define FRAMES 40
#else
#define FRAMES 120
#endif
#define TEXT_OF(number) #number
#define TEXT(number) TEXT_OF(number)
#define FRAMES_TEXT TEXT(FRAMES)

static char folder[] = "/tmp/fovea_run_XXXXXX";
static char stats_path[64], picture_path[64];

static pid_t running; /* 0: none */

static pid_t begin(const char *source, const char *const more[])
{
    const char *words[ARGUMENTS_MAX + 1] = {"fovea",    "run",       "--quiet",   "--set",
                                            "lcm_url=", "--source",  source,      "--stats",
                                            stats_path, "--picture", picture_path};
    int argc = 11;
    for (int i = 0; more != NULL && more[i] != NULL && argc < ARGUMENTS_MAX; i++)
        words[argc++] = more[i];
    fflush(NULL);
    pid_t child = fork();
    if (child == 0) {
        char *argv[ARGUMENTS_MAX + 1]; /* getopt_long moves them about */
        for (int i = 0; i <= argc; i++)
            argv[i] = i < argc ? strdup(words[i]) : NULL;
        exit(fv_dispatch(argc, argv));
    }
    running = child;
    return child;
}

static int end(pid_t child)
{
    int status = -1;
    waitpid(child, &status, 0);
    running = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + status;
}

/* What a test that failed left would go on for ever, and hold the files of the next. */
static int end_running(void **state)
{
    (void)state;
    if (running > 0 && kill(running, SIGKILL) == 0) end(running);
    return 0;
}

static struct fv_yaml_tree *stats_read(void)
{
    struct fv_yaml_tree *tree;
    struct fovea_error error;
    if (fv_yaml_read(stats_path, &tree, &error) != FOVEA_OK) fail_msg("%s", error.text);
    return tree;
}

static int64_t value(const struct fv_yaml_tree *tree, const char *section, const char *key)
{
    int64_t whole = -1;
    struct fovea_error error;
    const struct fv_yaml_node *node =
        section != NULL ? fv_yaml_child(tree->root, section) : tree->root;
    node = node != NULL ? fv_yaml_child(node, key) : NULL;
    if (node == NULL) fail_msg("no %s in the JSON", key);
    if (fv_yaml_integer(tree, node, 0, INT64_MAX, &whole, &error) != FOVEA_OK)
        fail_msg("%s", error.text);
    return whole;
}

static void assert_fine(const char *source, int64_t frames, int64_t resident_max,
                        const char *const more[])
{
    struct stat info;
    int status = end(begin(source, more));
    if (status != FV_EXIT_OK) fail_msg("%s: exit status %d", source, status);
    struct fv_yaml_tree *tree = stats_read();
    assert_int_equal(value(tree, "frames", "in"), frames);
    assert_int_equal(value(tree, "frames", "processed"), frames);
    assert_int_equal(value(tree, "frames", "dropped"), 0);
    assert_true(value(tree, "step", "p99_ns") > 0);
    if (fv_heap_counted()) {
        assert_int_equal(value(tree, NULL, "heap_calls_after_init"), 0);
        int64_t resident = value(tree, "memory", "resident_max_bytes");
        bool emulated = getenv("FOVEA_EMULATED") != NULL; /* the emulator's own memory is in it */
        if (!emulated && resident > resident_max)
            fail_msg("%s: %lld bytes resident", source, (long long)resident);
    }
    fv_yaml_free(tree);
    assert_int_equal(stat(picture_path, &info), 0);
    assert_true(info.st_size > 1000);
}

static void test_simulated(void **state)
{
    const char *const some[] = {"--frames", FRAMES_TEXT, NULL};
    const char *const recorded[] = {"--frames", FRAMES_TEXT, "--record", "/dev/null", NULL};
    (void)state;
    assert_fine("sim:", FRAMES, RESIDENT_MAX_BYTES, some);
    assert_fine("sim:orbit?lens=equidistant&width=752", FRAMES, RESIDENT_MAX_BYTES, recorded);
}

/* The program itself as people start it: with LCM, whose libraries and buffers count, and to its
 * very end, when it draws its picture. */
static void test_program(void **state)
{
    const char *build = getenv("FOVEA_PLUGINS");
    char program[512];
    struct rusage used;
    int status;
    (void)state;
    if (build == NULL || getenv("FOVEA_EMULATED") != NULL || !fv_heap_counted()) {
        print_message("SKIPPED the program's memory: no FOVEA_PLUGINS, emulated or instrumented\n");
        return;
    }
    snprintf(program, sizeof program, "%s/fovea", build);
    fflush(NULL);
    pid_t child = fork();
    if (child == 0) {
        execl(program, program, "run", "--frames", FRAMES_TEXT, "--quiet", "--stats", stats_path,
              "--picture", picture_path, (char *)NULL);
        _exit(127);
    }
    assert_int_equal(wait4(child, &status, 0, &used), child);
    assert_int_equal(status, 0);
    struct fv_yaml_tree *tree = stats_read();
    int64_t resident = value(tree, "memory", "resident_max_bytes"),
            whole = (int64_t)used.ru_maxrss << 10;
    fv_yaml_free(tree);
    if (resident > RESIDENT_MAX_BYTES) fail_msg("%lld bytes resident", (long long)resident);
    if (whole > RESIDENT_MAX_BYTES)
        fail_msg("%lld bytes resident when the picture was drawn", (long long)whole);
}

static void test_largest_map(void **state)
{
    const char *const largest[] = {"--frames", FRAMES_TEXT, "--set", "odometry.keyframes=256",
                                   NULL};
    (void)state;
    assert_fine("sim:", FRAMES, RESIDENT_FULL_MAX_BYTES, largest);
}

static void test_recordings(void **state)
{
    static const struct {
        const char *scheme, *name;
        int64_t frames; /* at most */
    } recordings[] = {
        {"euroc", "euroc_mh05_a", FRAMES},
        {"kitti", "kitti00_a", 80},
        {"kitti", "kitti06_a", 51},
        {"tum", "handheld_7scenes_a", FRAMES},
    };
    const char *const part[] = {"--frames", FRAMES_TEXT, NULL};
    (void)state;
    for (size_t i = 0; i < sizeof recordings / sizeof recordings[0]; i++) {
        char path[512], source[640];
        snprintf(path, sizeof path, "%s/%s", fv_data_folder(), recordings[i].name);
        snprintf(source, sizeof source, "%s:%s", recordings[i].scheme, path);
        if (access(path, R_OK) != 0) {
            print_message("SKIPPED %s: not there\n", source);
            continue;
        }
        const int64_t frames = recordings[i].frames;
        assert_fine(source, frames < FRAMES ? frames : FRAMES, RESIDENT_MAX_BYTES, part);
    }
}

/* Until a recording has begun to grow: the loop runs. */
static void wait_until_it_runs(const char *recording)
{
    struct stat info = {.st_size = 0};
    int64_t end_ns = 0;
    while ((stat(recording, &info) != 0 || info.st_size < 1 << 16) &&
           fv_test_patient(&end_ns, 10)) {
    }
    assert_true(info.st_size >= 1 << 16);
}

static void test_signals_end_cleanly(void **state)
{
    const int signals[] = {SIGINT, SIGTERM};
    char recording[64];
    /* As many frames may wait as a disk that others use takes seconds for. */
    const char *const real[] = {
        "--rate", "real", "--record", recording, "--set", "record_buffer=200", NULL};
    (void)state;
    snprintf(recording, sizeof recording, "%s/run.lcm", folder);
    for (int i = 0; i < 2; i++) {
        pid_t child = begin("sim:wander?width=160&height=120", real);
        wait_until_it_runs(recording);
        kill(child, signals[i]);
        assert_int_equal(end(child), FV_EXIT_OK);
        struct fv_yaml_tree *tree = stats_read();
        assert_true(value(tree, "frames", "processed") > 0);
        fv_yaml_free(tree);
        unlink(recording);
    }
}

/* A calibration whose opening waits, until the lease on it is given up. -1: there are no leases
 * here.
 */
static int hold(const char *path, const char *text)
{
    fv_test_write_text(path, text);
    signal(SIGIO, SIG_IGN);
    const int file = open(path, O_RDWR | O_CLOEXEC);
    if (fcntl(file, F_SETLEASE, F_WRLCK) == 0) return file;
    print_message("SKIPPED signals while a file is opened: no leases here\n");
    close(file);
    return -1;
}

static void wait_until_opened(int held)
{
    int64_t end_ns = 0;
    while (fcntl(held, F_GETLEASE) == F_WRLCK && fv_test_patient(&end_ns, 10)) {
    }
    assert_int_not_equal(fcntl(held, F_GETLEASE), F_WRLCK);
}

/* While things are opened, here the calibration: that goes on, no frame comes any more, all that
 * was asked for is written, and a map of an earlier run is not replaced by one of nothing. */
static void test_signals_before_the_first_frame(void **state)
{
    static const char calibration[] =
        "image_width: 96\nimage_height: 64\ndistortion_model: plumb_bob\nD: []\n"
        "K: [80, 0, 48, 0, 81, 32, 0, 0, 1]\n";
    const int signals[] = {SIGINT, SIGTERM};
    char map[64], camera[64], images[FV_TEST_PATH_BYTES], source[FV_TEST_PATH_BYTES + 16],
        text[16] = "";
    const char *const options[] = {"--save-map", map, "--camera", camera, NULL};
    (void)state;
    snprintf(images, sizeof images, "%s", fv_test_images(folder));
    snprintf(source, sizeof source, "images:%s", images);
    snprintf(map, sizeof map, "%s/earlier.map", folder);
    snprintf(camera, sizeof camera, "%s/camera.yaml", folder);
    fv_test_write_text(map, "earlier");
    for (int i = 0; i < 2; i++) {
        const int held = hold(camera, calibration);
        if (held < 0) return;
        pid_t child = begin(source, options);
        wait_until_opened(held);
        kill(child, signals[i]);
        usleep(100000);
        if (i == 1) { /* time without a processor is no time that it was given */
            kill(child, SIGSTOP);
            usleep(2500000);
            kill(child, SIGCONT);
        }
        fcntl(held, F_SETLEASE, F_UNLCK);
        close(held);
        assert_int_equal(end(child), FV_EXIT_OK);
        struct fv_yaml_tree *tree = stats_read();
        assert_int_equal(value(tree, "frames", "processed"), 0);
        fv_yaml_free(tree);
    }
    FILE *file = fopen(map, "r");
    assert_true(file != NULL && fgets(text, sizeof text, file) != NULL && fclose(file) == 0);
    assert_string_equal(text, "earlier");
    unlink(map);
    unlink(camera);
    fv_test_folder_remove(images);
}

/* While the program still waits for a file to be opened, as on a network that is gone. */
static void test_signals_end_the_set_up(void **state)
{
    const int signals[] = {SIGINT, SIGTERM};
    char camera[64];
    const char *const waiting[] = {"--camera", camera, NULL};
    (void)state;
    snprintf(camera, sizeof camera, "%s/camera.yaml", folder);
    for (int i = 0; i < 2; i++) {
        int status = 0;
        const int held = hold(camera, "never read");
        if (held < 0) return;
        pid_t child = begin("sim:still", waiting), ended = 0;
        wait_until_opened(held);
        kill(child, signals[i]);
        int64_t end_ns = 0;
        while ((ended = waitpid(child, &status, WNOHANG)) == 0 && fv_test_patient(&end_ns, 100)) {
        }
        if (ended == 0) {
            kill(child, SIGKILL);
            end(child);
        }
        close(held);
        assert_int_equal(ended, child);
        assert_true(WIFSIGNALED(status) && WTERMSIG(status) == signals[i]);
    }
    unlink(camera);
}

static void test_unwritable_results_fail(void **state)
{
    const char *const options[] = {"--stats", "--trajectory", "--trajectory-final", "--truth",
                                   "--record"};
    (void)state;
    if (access("/dev/full", W_OK) != 0) {
        print_message("SKIPPED /dev/full: not there\n");
        return;
    }
    for (size_t i = 0; i < sizeof options / sizeof options[0]; i++) {
        const char *const full[] = {"--frames", "20", options[i], "/dev/full", NULL};
        assert_int_equal(end(begin("sim:orbit?width=320&height=240", full)), FV_EXIT_FAILED);
    }
}

static int folder_make(void **state)
{
    (void)state;
    if (mkdtemp(folder) == NULL) return 1;
    snprintf(stats_path, sizeof stats_path, "%s/stats.json", folder);
    snprintf(picture_path, sizeof picture_path, "%s/timings.png", folder);
    return 0;
}

static int folder_remove(void **state)
{
    (void)state;
    unlink(stats_path);
    unlink(picture_path);
    return rmdir(folder);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_teardown(name, end_running)
    const struct CMUnitTest tests[] = {
        TEST(test_simulated),
        TEST(test_program),
        TEST(test_largest_map),
        TEST(test_recordings),
        TEST(test_signals_end_cleanly),
        TEST(test_signals_before_the_first_frame),
        TEST(test_signals_end_the_set_up),
        TEST(test_unwritable_results_fail),
    };
    return cmocka_run_group_tests(tests, folder_make, folder_remove);
}
