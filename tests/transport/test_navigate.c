/* The navigator drives a run of the simulated robot over LCM, in a network of the test's own: frame
 * by frame in lock-step, twice to the same bits, and its commands are in the recording, which
 * replays. With a key it signs its commands, to the same bits again; without, a run that has one
 * refuses them. A grid in which all is free stands for what a network would see. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <arpa/inet.h>
#include <math.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/build_folder.h"
#include "common/own_network.h"

#include "fovea_grid_t.h"

#define URL "udpm://239.255.76.67:7667?ttl=0"
#define DRIVE                                                                                      \
    "sim:drive?seed=5&commands=1&width=320&height=240&rate=10&baseline=0.12&wheel_odometry=0"

#define T_BODY_CAM "T_body_cam=[[0,-0.34202,0.939693,0.1],[-1,0,0,0],[0,-0.939693,-0.34202,0.8]]"

enum { SIDE = 100, FRAMES = 45, SECONDS_MAX = 600 };

static char folder[] = "/tmp/fovea_navigate_XXXXXX";

static FILE *start(const char *const words[], pid_t *id)
{
    int ends[2];
    assert_int_equal(pipe(ends), 0);
    fflush(NULL);
    *id = fork();
    if (*id == 0) {
        alarm(SECONDS_MAX);
        dup2(ends[1], STDOUT_FILENO);
        close(ends[0]);
        close(ends[1]);
        execv(words[0], (char *const *)(uintptr_t)words);
        _exit(127);
    }
    close(ends[1]);
    return fdopen(ends[0], "r");
}

/* 10 m about the start, all of it free; `side` cells are stated. */
static void send_grid(int side)
{
    static int8_t cells[SIDE * SIDE];
    static uint8_t packet[16384] = {'L', 'C', '0', '2'};
    fovea_grid_t grid = {.frame = (char[]){"odom"},
                         .resolution_m = 0.1,
                         .width = side,
                         .height = side,
                         .origin_position = {-5, -5, 0},
                         .origin_orientation = {1},
                         .row_count = SIDE,
                         .cell_count = SIDE * SIDE,
                         .cells = cells};
    const int head = 8 + sprintf((char *)packet + 8, "FOVEA_GRID") + 1;
    const int bytes = fovea_grid_t_encode(packet, head, (int)sizeof packet - head, &grid);
    const struct sockaddr_in to = {.sin_family = AF_INET,
                                   .sin_port = htons(7667),
                                   .sin_addr.s_addr = inet_addr("239.255.76.67")};
    const int udp = socket(AF_INET, SOCK_DGRAM, 0);
    assert_true(bytes > SIDE * SIDE && udp >= 0);
    assert_int_equal(
        sendto(udp, packet, (size_t)(head + bytes), 0, (const struct sockaddr *)&to, sizeof to),
        head + bytes);
    close(udp);
}

static const char *key_path(const char *before)
{
    static char path[128];
    snprintf(path, sizeof path, "%s%s/command.key", before, folder);
    return path;
}

/* One drive; its recording and its trajectory are `name` in the folder. */
static void drive(const char *name, bool keyed)
{
    char navigate[640], fovea[640], recording[128], trajectory[128], line[512], last[512] = "";
    char key[128], command_key[128];
    pid_t navigator, runtime;
    int status, taken = -1, poses = -1, silences = -1;
    snprintf(navigate, sizeof navigate, "%s/examples/navigate", build_folder());
    snprintf(fovea, sizeof fovea, "%s/fovea", build_folder());
    snprintf(recording, sizeof recording, "%s/%s.log", folder, name);
    snprintf(trajectory, sizeof trajectory, "%s/%s.tum", folder, name);
    snprintf(key, sizeof key, "%s", key_path(""));
    snprintf(command_key, sizeof command_key, "%s", key_path("command_key="));
    /* A slow machine takes seconds for a frame: silence that long must not change what is asked. */
    const char *const controller[] = {
        navigate, "0.8", "0", "--url", URL, "--patience", "99", keyed ? "--key" : NULL, key, NULL};
    FILE *heard = start(controller, &navigator);
    assert_non_null(fgets(line, sizeof line, heard));
    assert_string_equal(line, "listening\n");
    send_grid(SIDE);
    const char *const run[] = {fovea,
                               "run",
                               "--source",
                               DRIVE "&patience=200",
                               "--frames",
                               "45",
                               "--picture",
                               "none",
                               "--record",
                               recording,
                               "--trajectory",
                               trajectory,
                               "--set",
                               "lcm_url=" URL,
                               "--set",
                               T_BODY_CAM,
                               keyed ? "--set" : NULL,
                               command_key,
                               NULL};
    FILE *said = start(run, &runtime);
    while (fgets(line, sizeof line, said) != NULL)
        (void)sscanf(line, " velocity commands: %d taken, 0 refused, 0 malformed", &taken);
    assert_int_equal(waitpid(runtime, &status, 0), runtime);
    assert_int_equal(status, 0);
    assert_int_equal(kill(navigator, SIGTERM), 0);
    while (fgets(line, sizeof line, heard) != NULL)
        snprintf(last, sizeof last, "%s", line);
    assert_int_equal(waitpid(navigator, &status, 0), navigator);
    print_message("%d commands taken; navigate: %s", taken, last);
    assert_int_equal(status, 0);
    assert_int_equal(sscanf(last, "at the goal after %d poses", &poses), 1);
    assert_in_range(poses, FRAMES - 1, FRAMES); /* nobody waits for an answer to the last */
    const char *after = strstr(last, "asked to stand after silence ");
    assert_true(after != NULL && sscanf(after, "asked to stand after silence %d", &silences) == 1);
    /* One for each frame, but the last may come after the end; and what a slow run was sent. */
    assert_in_range(taken, FRAMES - 1, FRAMES + silences);
    fclose(said);
    fclose(heard);
}

/* The whole file; `*way`: how far its last pose is from the first. */
static size_t read_path(const char *name, char text[1 << 15], double *way)
{
    char path[128];
    double first[3] = {0, 0, 0}, at[3] = {0, 0, 0};
    int lines = 0;
    snprintf(path, sizeof path, "%s/%s.tum", folder, name);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    const size_t bytes = fread(text, 1, (1 << 15) - 1, file);
    text[bytes] = '\0';
    fclose(file);
    for (const char *line = text; line[0] != '\0' && line[1] != '\0';
         line = strchr(line, '\n') + 1) {
        double seconds;
        if (sscanf(line, "%lf %lf %lf %lf", &seconds, at, at + 1, at + 2) == 4 && lines++ == 0)
            memcpy(first, at, sizeof first);
        if (strchr(line, '\n') == NULL) break;
    }
    *way = sqrt((at[0] - first[0]) * (at[0] - first[0]) + (at[1] - first[1]) * (at[1] - first[1]) +
                (at[2] - first[2]) * (at[2] - first[2]));
    assert_int_equal(lines, FRAMES);
    return bytes;
}

static void a_run_is_driven_in_lock_step_and_repeats(void **state)
{
    static char one[1 << 15], two[1 << 15];
    char command[1024];
    double way;
    (void)state;
    drive("one", false);
    drive("two", true);
    const size_t bytes = read_path("one", one, &way);
    assert_int_equal(read_path("two", two, &way), bytes);
    assert_memory_equal(one, two, bytes);
    print_message("driven %.3f m\n", way);
    assert_true(way > 0.5 && way < 0.9);
    snprintf(command, sizeof command, "%s/fovea replay %s/one.log >/dev/null", build_folder(),
             folder);
    assert_int_equal(WEXITSTATUS(system(command)), 0);
    snprintf(command, sizeof command, "grep -ac FOVEA_VELOCITY %s/one.log >/dev/null", folder);
    assert_int_equal(WEXITSTATUS(system(command)), 0);
}

/* And the run says why it ends: which source, what it found and what it expected. */
static void a_run_with_a_key_takes_nothing_that_is_not_signed(void **state)
{
    char navigate[640], command[2048], line[512];
    pid_t navigator;
    int taken = 0;
    bool ended = false;
    (void)state;
    snprintf(navigate, sizeof navigate, "%s/examples/navigate", build_folder());
    const char *const controller[] = {navigate, "0.8", "0", "--url", URL, NULL};
    FILE *heard = start(controller, &navigator);
    assert_non_null(fgets(line, sizeof line, heard));
    snprintf(command, sizeof command,
             "%s/fovea run --source '" DRIVE "&patience=1' --frames 3 --picture none"
             " --set 'lcm_url=" URL "' --set %s 2>&1",
             build_folder(), key_path("command_key="));
    FILE *said = popen(command, "r"); /* NOLINT(bugprone-command-processor) */
    assert_non_null(said);
    while (fgets(line, sizeof line, said) != NULL) {
        ended |= strstr(line, DRIVE "&patience=1: found no velocity_command_t with sequence 0 "
                                    "for 1 s, expected an answer to each frame\n") != NULL;
        assert_null(strstr(line, "malformed input"));
        (void)sscanf(line, " velocity commands: %d taken", &taken);
        if (strstr(line, "velocity commands") != NULL) print_message("%s", line);
    }
    assert_int_equal(WEXITSTATUS(pclose(said)), 1);
    assert_true(ended && taken == 0);
    kill(navigator, SIGTERM);
    assert_int_equal(waitpid(navigator, NULL, 0), navigator);
    fclose(heard);
}

/* At any time: it tells what came of the drive, and that the goal was not reached. */
static void a_signal_ends_it_with_its_last_line(void **state)
{
    const int signals[] = {SIGINT, SIGTERM};
    (void)state;
    for (size_t i = 0; i < 2; i++) {
        char navigate[640], line[512] = "";
        pid_t navigator;
        int status;
        snprintf(navigate, sizeof navigate, "%s/examples/navigate", build_folder());
        const char *const controller[] = {navigate, "0.8",        "0",  "--url",
                                          URL,      "--patience", "99", NULL};
        FILE *heard = start(controller, &navigator);
        assert_non_null(fgets(line, sizeof line, heard));
        assert_int_equal(kill(navigator, signals[i]), 0);
        assert_non_null(fgets(line, sizeof line, heard));
        print_message("%s", line);
        assert_string_equal(line,
                            "not at the goal after 0 poses, of which 0 could not be steered by; 0 "
                            "grids; stood against its command 0 times; gave up 0 ways that were "
                            "too narrow; asked to stand after silence 0 times\n");
        assert_null(fgets(line, sizeof line, heard));
        assert_int_equal(waitpid(navigator, &status, 0), navigator);
        assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 1);
        fclose(heard);
    }
}

/* How often it asked the robot to stand within a second in which nothing came. */
static int silences_within_a_second(const char *patience_s)
{
    char navigate[640], line[512] = "";
    pid_t navigator;
    int silences = -1;
    snprintf(navigate, sizeof navigate, "%s/examples/navigate", build_folder());
    const char *const controller[] = {navigate, "1",          "0",        "--url",
                                      URL,      "--patience", patience_s, NULL};
    FILE *heard = start(controller, &navigator);
    assert_non_null(fgets(line, sizeof line, heard));
    sleep(1);
    assert_int_equal(kill(navigator, SIGTERM), 0);
    assert_non_null(fgets(line, sizeof line, heard));
    const char *after = strstr(line, "after silence ");
    assert_true(after != NULL && sscanf(after, "after silence %d", &silences) == 1);
    assert_int_equal(waitpid(navigator, NULL, 0), navigator);
    fclose(heard);
    return silences;
}

/* A program that has no processor for a second is tried again. */
static void silence_is_as_long_as_it_is_told(void **state)
{
    int silences = 0;
    (void)state;
    assert_int_equal(silences_within_a_second("99"), 0);
    for (int tries = 0; tries < 20 && silences < 3; tries++)
        silences = silences_within_a_second("0.2");
    assert_true(silences >= 3);
}

/* One line alone says why the robot stands. Unless `side` is 0, a grid of so many cells is sent. */
static void assert_says(const char *expected, int side)
{
    char command[2048], line[512] = "";
    pid_t navigator;
    snprintf(command, sizeof command,
             "exec %s/examples/navigate 0.8 0 --url " URL " --patience 99 2>&1", build_folder());
    const char *const controller[] = {"/bin/sh", "-c", command, NULL};
    FILE *heard = start(controller, &navigator);
    assert_non_null(fgets(line, sizeof line, heard));
    if (side > 0) send_grid(side);
    snprintf(command, sizeof command,
             "%s/fovea run --source '" DRIVE "&patience=200' --frames 60 --quiet --picture none"
             " --set 'lcm_url=" URL "' --set '" T_BODY_CAM "'",
             build_folder());
    assert_int_equal(system(command), 0); /* NOLINT(bugprone-command-processor) */
    assert_non_null(fgets(line, sizeof line, heard));
    if (strncmp(line, expected, strlen(expected)) != 0) fail_msg("%s", line);
    kill(navigator, SIGTERM);
    assert_non_null(fgets(line, sizeof line, heard));
    if (strstr(line, "not at the goal after") == NULL) fail_msg("%s", line);
    assert_int_equal(waitpid(navigator, NULL, 0), navigator);
    fclose(heard);
}

static void it_says_that_there_is_no_grid(void **state)
{
    (void)state;
    assert_says("navigate: found no GRID with 50 poses, expected a run with grid.enabled", 0);
}

static void it_says_that_a_grid_is_too_large(void **state)
{
    (void)state;
    assert_says("navigate: GRID: found 30000 x 30000 cells, expected at most ", 30000);
}

static int set_up(void **state)
{
    (void)state;
    FILE *file = fopen(key_path(""), "w");
    assert_non_null(file);
    assert_int_equal(fchmod(fileno(file), 0600), 0);
    fputs("000102030405060708090a0b0c0dFEff\n", file);
    fclose(file);
    return 0;
}

/* In one line, which names the argument. */
static void wrong_arguments_are_refused(void **state)
{
    static const struct {
        const char *words, *line;
    } wrong[] = {
        {"", "X: found no value, expected a number of metres"},
        {"8", "Y: found no value, expected a number of metres"},
        {"1 nan", "Y: found 'nan', expected a number of metres"},
        {"--speed 1 8 -2", "X: found '--speed', expected a number of metres"},
        {"1 2 --speed 0", "--speed: found '0', expected a number above 0"},
        {"1 2 --radius .2m", "--radius: found '.2m', expected a number above 0"},
        {"1 2 --turning", "--turning: found no value, expected a number above 0"},
        {"1 2 --prefix ''", "--prefix: found '', expected 1 to 31 bytes"},
        {"1 2 --prefix A2345678901234567890123456789012",
         "--prefix: found 'A2345678901234567890123456789012', expected 1 to 31 bytes"},
        {"1 2 --faster 3", "found '--faster', expected --url, --prefix, --radius, --speed, "
                           "--turning, --patience, --key, --run-id or --sender"},
        {"1 2 --key /dev/null --sender 1.5", "--sender: found '1.5', expected a whole number"},
        {"1 2 --run-id 0", "--run-id: found '0', expected a whole number other than 0"},
        {"1 2 --run-id -7", "--run-id: found without --key, expected both"},
        {"1 2 --key /dev/null", "--key: command_key: /dev/null: found no ordinary file"},
        {"1 2 --url nowhere",
         "--url: lcm_url: found \"nowhere\", expected an LCM URL like udpm://239.255.76.67:7667\n"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        char command[1024], line[512] = "", expected[512], more[16];
        snprintf(command, sizeof command, "%s/examples/navigate %s 2>&1", build_folder(),
                 wrong[i].words);
        snprintf(expected, sizeof expected, "navigate: %s", wrong[i].line);
        FILE *said = popen(command, "r"); /* NOLINT(bugprone-command-processor) */
        assert_non_null(said);
        assert_non_null(fgets(line, sizeof line, said));
        if (strncmp(line, expected, strlen(expected)) != 0) fail_msg("%s", line);
        assert_null(fgets(more, sizeof more, said));
        assert_int_equal(WEXITSTATUS(pclose(said)), 2);
    }
}

static int tear_down(void **state)
{
    char command[64];
    (void)state;
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command);
}

int main(void)
{
    if (getenv("FOVEA_EMULATED") != NULL) { /* a child would need the kernel to know the format */
        print_message("SKIPPED: emulated, programs cannot be started\n");
        return 0;
    }
    if (!own_network_enter() || !own_network_mend()) {
        print_message("SKIPPED: no network of the test's own here\n");
        return 0;
    }
    if (mkdtemp(folder) == NULL) return 1;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_run_is_driven_in_lock_step_and_repeats),
        cmocka_unit_test(a_run_with_a_key_takes_nothing_that_is_not_signed),
        cmocka_unit_test(a_signal_ends_it_with_its_last_line),
        cmocka_unit_test(silence_is_as_long_as_it_is_told),
        cmocka_unit_test(it_says_that_there_is_no_grid),
        cmocka_unit_test(it_says_that_a_grid_is_too_large),
        cmocka_unit_test(wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
