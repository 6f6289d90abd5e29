/* What a person at the terminal sees: the status of a run with its colours, the lines about the
 * pose's state, the reason where nothing was posed, the progress of replay and export. Each command
 * runs in a process of its own, on a pseudo-terminal or on a pipe. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka needs the above */
#include <cmocka.h>

#include <errno.h>
#include <ftw.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/command.h"
#include "support/canvas.h"

enum { TEXT_BYTES = 1 << 20, SECONDS_MAX = 300, WORDS_MAX = 32, COLUMNS_WIDE = 200 };

static char folder[] = "/tmp/fovea_terminal_XXXXXX";
static char text[TEXT_BYTES]; /* what the last command wrote on the terminal, or on stderr */

/* ---- running a command ----------------------------------------------------------------------- */

struct place {
    int columns; /* of a terminal; 0: a pipe */
    const char *no_colour, *term;
};

/* Small pictures, and half of the features: what is drawn and posed is judged elsewhere. */
#define ORBIT "sim:orbit?width=320&height=240"
#define HALF "features.count_max=500"

/* Seconds of a camera, in which the status is shown every quarter of a second. */
#ifdef FOVEA_SANITIZED
#define LIVE_RATE "6"
#else
#define LIVE_RATE "15"
#endif
#define LIVE ORBIT "&rate=" LIVE_RATE
#define LIVE_FRAMES "45"

static const struct place wide = {COLUMNS_WIDE, NULL, "xterm"}, no_terminal = {0, NULL, "xterm"};

__attribute__((noreturn)) static void run_child(const struct place *place,
                                                const char *const words[])
{
    char *argv[WORDS_MAX + 1];
    int argc = 0;
    while (words[argc] != NULL && argc < WORDS_MAX) {
        argv[argc] = strdup(words[argc]);
        argc++;
    }
    argv[argc] = NULL;
    alarm(SECONDS_MAX);
    unsetenv("NO_COLOR");
    if (place->no_colour != NULL) setenv("NO_COLOR", place->no_colour, 1);
    setenv("TERM", place->term, 1);
    if (strcmp(words[0], "fovea") != 0) {
        execvp(argv[0], argv);
        _exit(98);
    }
    if (chdir(folder) != 0) _exit(99);
    exit(fv_dispatch(argc, argv));
}

static void read_all(int from)
{
    size_t used = 0;
    for (;;) {
        const ssize_t got = read(from, text + used, sizeof text - 1 - used);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) break; /* a terminal ends with EIO */
        used += (size_t)got;
    }
    text[used] = '\0';
    close(from);
}

/* The exit status of `words`; `text` is what was written. */
static int run(const struct place *place, const char *const words[])
{
    int from, ends[2], status = -1;
    struct winsize size = {.ws_row = 24, .ws_col = (unsigned short)place->columns};
    pid_t child;
    fflush(NULL);
    if (place->columns > 0) {
        child = forkpty(&from, NULL, NULL, &size);
    } else {
        assert_int_equal(pipe(ends), 0);
        from = ends[0];
        child = fork();
        if (child == 0) {
            dup2(ends[1], STDERR_FILENO);
            dup2(ends[1], STDOUT_FILENO);
        }
        if (child != 0) close(ends[1]);
    }
    if (child == 0) run_child(place, words);
    assert_true(child > 0);
    read_all(from);
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 100 + WTERMSIG(status);
}

static int run_at(const struct place *place, const char *source, const char *frames,
                  const char *rate)
{
    const char *const words[] = {"fovea",    "run",   "--source",  source,   "--set",
                                 "lcm_url=", "--set", HALF,        "--rate", rate,
                                 "--frames", frames,  "--picture", "none",   NULL};
    return run(place, words);
}

static int run_source(const struct place *place, const char *source, const char *frames)
{
    return run_at(place, source, frames, "max");
}

static int run_live(const struct place *place)
{
    return run_at(place, LIVE, LIVE_FRAMES, "real");
}

static void expect(const char *part)
{
    if (strstr(text, part) == NULL) fail_msg("no \"%s\" in:\n%s", part, text);
}

static void expect_none(const char *part)
{
    if (strstr(text, part) != NULL) fail_msg("\"%s\" in:\n%s", part, text);
}

/* ---- a run ----------------------------------------------------------------------------------- */

#define STATUS "\r\033[K"
#define GREEN "\033[32m"

static void test_a_terminal_shows_state_frames_and_map(void **state)
{
    (void)state;
    assert_int_equal(run_live(&wide), 0);
    double seconds;
    unsigned frame, landmarks, keyframes, frames;
    double rate;
    int found = 0;
    /* a change of state begins with the same words */
    for (const char *status = text; found != 6;) {
        status = strstr(status + 1, STATUS GREEN "tracking\033[0m ");
        if (status == NULL) fail_msg("no status with the state tracking in:\n%s", text);
        found = sscanf(status,
                       STATUS GREEN "tracking\033[0m %lf s  frame %u/%u  %lf Hz  %u "
                                    "landmarks  %u keyframes",
                       &seconds, &frame, &frames, &rate, &landmarks, &keyframes);
    }
    assert_int_equal(frames, atoi(LIVE_FRAMES));
    assert_in_range(frame, 1, frames);
    assert_true(seconds >= 0.0 && seconds <= frame / atof(LIVE_RATE));
    assert_in_range(landmarks, 100, 20000);
    assert_in_range(keyframes, 2, 256);
}

static void test_a_change_of_state_is_one_line(void **state)
{
    (void)state;
    assert_int_equal(run_source(&no_terminal, ORBIT, "35"), 0);
    assert_memory_equal(text, "starting from frame 1 on, at 0.000 s\n", 37);
    expect("\nweak from frame ");
    expect(" starting\n");
    expect("\ntracking from frame ");
    expect(" weak\n");
    expect("\n  states: starting ");
}

static void test_what_is_no_terminal_gets_neither_status_nor_colour(void **state)
{
    (void)state;
    assert_int_equal(run_source(&no_terminal, ORBIT, "35"), 0);
    expect_none("\r");
    expect_none("\033");
    expect_none("Hz  ");
}

static void test_colours_are_left_out_on_request(void **state)
{
    (void)state;
    const struct place asked = {COLUMNS_WIDE, "1", "xterm"}, empty = {COLUMNS_WIDE, "", "xterm"},
                       dumb = {COLUMNS_WIDE, NULL, "dumb"};
    assert_int_equal(run_source(&asked, ORBIT, "35"), 0);
    expect_none("\033[3");
    expect("tracking from frame ");
    assert_int_equal(run_source(&dumb, ORBIT, "35"), 0);
    expect_none("\033[3");
    assert_int_equal(run_source(&empty, ORBIT, "35"), 0); /* as no-color.org says */
    expect(GREEN "tracking\033[0m from frame ");
}

static void test_a_narrow_terminal_gets_whole_fields(void **state)
{
    (void)state;
    const struct place narrow = {44, "1", "xterm"};
    assert_int_equal(run_live(&narrow), 0);
    int seen = 0;
    for (const char *at = text; (at = strstr(at, STATUS)) != NULL;) {
        at += strlen(STATUS);
        const size_t length = strcspn(at, "\r\n");
        char line[64];
        if (length == 0 || strncmp(at, "sim:", 4) == 0) continue; /* the summary follows the last */
        if (strncmp(at, "tracking ", 9) != 0 || memmem(at, length, " from frame ", 12) != NULL)
            continue;
        assert_in_range(length, 1, 43);
        snprintf(line, sizeof line, "%.*s", (int)length, at);
        const char *last = strrchr(line, ' ');
        assert_non_null(last);
        if (strcmp(last, " Hz") != 0 && strstr(last, "/300") == NULL)
            fail_msg("cut within a field: \"%s\"", line);
        assert_null(strstr(line, "MiB"));
        seen++;
    }
    assert_true(seen > 0);
}

/* ---- why nothing was posed ------------------------------------------------------------------- */

/* Forty pictures of one grey. */
static void blank_pictures(void)
{
    char path[128];
    struct fv_canvas canvas;
    struct fovea_error error;
    assert_int_equal(fv_canvas_create(&canvas, 320, 240, 0x404040), FOVEA_OK);
    for (int i = 0; i < 40; i++) {
        snprintf(path, sizeof path, "%s/blank%02d.png", folder, i);
        assert_int_equal(fv_canvas_write(&canvas, path, &error), FOVEA_OK);
    }
    fv_canvas_free(&canvas);
}

static void camera_write(void)
{
    char path[128];
    snprintf(path, sizeof path, "%s/camera.yaml", folder);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "cam0:\n  camera_model: pinhole\n  intrinsics: [250, 250, 160, 120]\n"
                  "  distortion_model: radtan\n  distortion_coeffs: [0, 0, 0, 0]\n"
                  "  resolution: [320, 240]\n");
    assert_int_equal(fclose(file), 0);
}

static void test_the_summary_says_why_nothing_was_posed(void **state)
{
    (void)state;
    camera_write();
    blank_pictures();
    assert_int_equal(run_source(&no_terminal, "images:blank*.png", "40"), 0);
    expect("why no pose: too few corners in the images");
    assert_int_equal(run_source(&no_terminal, "sim:rotate?width=320&height=240", "60"), 0);
    expect("why no pose: never enough parallax");
    expect("\n  scale: unknown, as no frame has a pose\n");
    assert_int_equal(run_source(&no_terminal, ORBIT, "35"), 0);
    expect_none("why no pose");
    expect("scale: unknown; the unit is the median depth at the start of each map");
}

static void test_the_summary_says_how_well_scale_is_known(void **state)
{
    (void)state;
    const char *const words[] = {"fovea",     "run",
                                 "--source",  ORBIT,
                                 "--set",     "lcm_url=",
                                 "--picture", "none",
                                 "--frames",  "60",
                                 "--rate",    "max",
                                 "--set",     "scale.source=wheel_odometry",
                                 "--set",     HALF,
                                 NULL};
    assert_int_equal(run(&no_terminal, words), 0);
    expect("scale: metres, from wheel odometry, to ");
    expect(" % (1 sigma)\n");
}

static void test_the_summary_says_why_no_cell_is_known(void **state)
{
    (void)state;
    static const struct {
        const char *source, *frames, *said;
    } cases[] = {
        {ORBIT, "40", "free space: none known at the end: poses are not in metres\n"},
        {ORBIT, "1", "free space: none known at the end: no image was labelled\n"},
        {ORBIT "&baseline=0.1", "40", " occupied\n"},
    };
    char *network = realpath("src/detect/segmenter.fvm", NULL);
    assert_non_null(network);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *const words[] = {
            "fovea",     "run",
            "--source",  cases[i].source,
            "--set",     "lcm_url=",
            "--model",   network,
            "--picture", "none",
            "--frames",  cases[i].frames,
            "--set",     "grid.enabled=true",
            "--set",     "T_body_cam=[[0, 0, 1, 0.3], [-1, 0, 0, 0], [0, -1, 0, 0.5]]",
            "--set",     HALF,
            NULL};
        assert_int_equal(run(&no_terminal, words), 0);
        expect(cases[i].said);
    }
    free(network);
}

/* ---- progress -------------------------------------------------------------------------------- */

static void test_replay_and_export_show_how_far_they_are(void **state)
{
    (void)state;
    const char *const record[] = {"fovea",     "run",   "--source", ORBIT, "--set",  "lcm_url=",
                                  "--picture", "none",  "--frames", "40",  "--rate", "max",
                                  "--record",  "a.lcm", "--set",    HALF,  NULL};
    const char *const replay[] = {"fovea", "replay", "a.lcm", NULL};
    const char *const export[] = {"fovea",    "export", "--source", ORBIT,
                                  "--frames", "10",     "frames",   NULL};
    assert_int_equal(run(&no_terminal, record), 0);
    assert_int_equal(run(&wide, replay), 0);
    expect(STATUS "replay  frame ");
    expect(" %");
    assert_int_equal(run(&no_terminal, replay), 0);
    expect_none("replay  frame ");
    assert_int_equal(run(&wide, export), 0);
    expect(STATUS "export  frame 1  10 %");
}

/* tools/evaluate and tools/train show theirs by tools/progress.py. */
static void test_tools_in_python_show_how_far_they_are(void **state)
{
    (void)state;
    const char *const words[] = {"python3", "-c",
                                 "import sys\n"
                                 "sys.path.insert(0, 'tools')\n"
                                 "import progress\n"
                                 "progress.show('train', 50, 200, 'loss 0.125')\n"
                                 "progress.show('train', 51, 200, 'loss 9')\n"
                                 "progress.show('train', 200, 200)\n"
                                 "progress.clear()\n"
                                 "print('end', file=sys.stderr)\n",
                                 NULL};
    if (system("python3 -c 1") != 0) {
        print_message("SKIPPED: found no python3\n");
        skip();
    }
    assert_int_equal(run(&wide, words), 0);
    assert_string_equal(text, "\r\033[Ktrain  50/200  25 %  loss 0.125\r\033[Ktrain  200/200  100 %"
                              "\r\033[Kend\r\n");
    assert_int_equal(run(&no_terminal, words), 0);
    assert_string_equal(text, "end\n");
}

/* ---- */

static int set_up(void **state)
{
    (void)state;
    return mkdtemp(folder) == NULL ? -1 : 0;
}

static int forget(const char *path, const struct stat *about, int kind, struct FTW *at)
{
    (void)about;
    (void)kind;
    (void)at;
    return remove(path);
}

static int tear_down(void **state)
{
    (void)state;
    return nftw(folder, forget, 8, FTW_DEPTH | FTW_PHYS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_terminal_shows_state_frames_and_map),
        cmocka_unit_test(test_a_change_of_state_is_one_line),
        cmocka_unit_test(test_what_is_no_terminal_gets_neither_status_nor_colour),
        cmocka_unit_test(test_colours_are_left_out_on_request),
        cmocka_unit_test(test_a_narrow_terminal_gets_whole_fields),
        cmocka_unit_test(test_the_summary_says_why_nothing_was_posed),
        cmocka_unit_test(test_the_summary_says_how_well_scale_is_known),
        cmocka_unit_test(test_the_summary_says_why_no_cell_is_known),
        cmocka_unit_test(test_replay_and_export_show_how_far_they_are),
        cmocka_unit_test(test_tools_in_python_show_how_far_they_are),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
