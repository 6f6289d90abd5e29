/* Answers to commands, in a network of the test's own: each command that is taken gets one, in the
 * order of what happened, refused ones get the reason, and a flood of wrong ones gets few. The
 * programs that users copy send the commands to `fovea run` and print the answers. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/network/transport.h"
#include "app/run/answers.h"
#include "app/run/keeper.h"
#include "common/build_folder.h"
#include "common/patience.h"
#include "common/watched.h"

#include "fovea_command_result_t.h"
#include "fovea_command_t.h"

#define URL "udpm://239.255.76.67:7667"

/* ---- the loop's side, by hand ---------------------------------------------------------------- */

struct heard {
    uint32_t count;
    struct {
        int64_t id;
        int8_t result;
        char reason[256];
    } answers[64];
};

static void take_answer(void *context, const struct fv_received *received)
{
    struct heard *heard = context;
    fovea_command_result_t result;
    assert_true(fovea_command_result_t_decode(received->data, 0, (int)received->bytes, &result) >=
                0);
    if (heard->count < 64) {
        heard->answers[heard->count].id = result.id;
        heard->answers[heard->count].result = result.result;
        snprintf(heard->answers[heard->count++].reason, 256, "%s", result.reason);
    }
    fovea_command_result_t_decode_cleanup(&result);
}

static struct fv_transport *transport;
static struct fv_receiver *receiver;
static struct heard heard;
static struct fv_answers answers;
static struct fv_recordings recordings; /* without a folder */

static int open_both(void **state)
{
    struct fovea_error error;
    const struct fv_transport_ears ears = {.listen = "loopback", .prefix = "A"};
    static struct fv_receiver_channel row = {.name = "A_COMMAND_RESULT",
                                             .type = "fovea.command_result_t",
                                             .bytes_max = 512,
                                             .take = take_answer,
                                             .context = &heard};
    const struct fv_receiver_setup setup = {URL, "loopback", &row, 1};
    (void)state;
    memset(&heard, 0, sizeof heard);
    if (fv_transport_open(URL, 0, &transport, &error) != FOVEA_OK ||
        fv_transport_listen(transport, &ears, &error) != FOVEA_OK ||
        fv_receiver_open(&setup, &receiver, &error) != FOVEA_OK) {
        print_error("%s\n", error.text);
        return -1;
    }
    fv_answers_open(&answers, transport, NULL, "A", 7);
    return 0;
}

static int close_both(void **state)
{
    (void)state;
    fv_receiver_close(receiver);
    fv_transport_close(transport);
    return 0;
}

static void send(int64_t id, int32_t bits)
{
    uint8_t data[128];
    const fovea_command_t command = {.id = id, .commands = bits};
    const int bytes = fovea_command_t_encode(data, 0, sizeof data, &command);
    watched_send("A_COMMAND", data, (size_t)bytes);
}

/* Until so many commands have been taken or refused. */
static void arrived(uint64_t count)
{
    struct fv_transport_counts counts = {0};
    int64_t end_ns = 0;
    while (counts.commands + counts.commands_refused < count && fv_test_patient(&end_ns, 10))
        fv_transport_counts(transport, &counts);
    assert_int_equal(counts.commands + counts.commands_refused, count);
}

/* Until there are `count` answers, and no more. */
static void answered(uint32_t count)
{
    int64_t end_ns = 0;
    while (heard.count < count && fv_test_patient(&end_ns, 0))
        fv_receiver_handle(receiver, 10);
    fv_receiver_handle(receiver, 50);
    assert_int_equal(heard.count, count);
}

static void assert_answer(uint32_t at, int64_t id, int8_t result, const char *reason)
{
    assert_int_equal(heard.answers[at].id, id);
    assert_int_equal(heard.answers[at].result, result);
    assert_string_equal(heard.answers[at].reason, reason);
}

enum {
    DONE = FOVEA_COMMAND_RESULT_T_RESULT_DONE,
    REFUSED = FOVEA_COMMAND_RESULT_T_RESULT_REFUSED,
    FAILED = FOVEA_COMMAND_RESULT_T_RESULT_FAILED
};

static void a_command_is_done_when_the_step_has_taken_it(void **state)
{
    static struct fv_keeper keeper; /* names no file */
    (void)state;
    send(1, FOVEA_COMMAND_PAUSE);
    send(2, FOVEA_COMMAND_RESET);
    send(3, FOVEA_COMMAND_RESUME);
    send(4, FOVEA_COMMAND_SAVE);
    send(5, 512);
    arrived(5);
    /* Of pause and resume the later one. */
    assert_int_equal(fv_answers_take(&answers, &keeper, &recordings),
                     FOVEA_COMMAND_RESET | FOVEA_COMMAND_RESUME | FOVEA_COMMAND_SAVE);
    answered(1);
    assert_int_equal(heard.answers[0].id, 5);
    assert_int_equal(heard.answers[0].result, REFUSED);
    assert_non_null(strstr(heard.answers[0].reason, "expected a sum of 1 (reset)"));
    fv_answers_step(&answers);
    answered(5);
    for (uint32_t i = 1; i < 4; i++)
        assert_answer(i, i, DONE, "");
    assert_answer(4, 4, REFUSED, "found no file for the map, expected one in map.save");
    fv_answers_step(&answers);
    answered(5);
}

static void a_save_is_answered_when_it_has_ended(void **state)
{
    static uint8_t buffer[8];
    static struct fv_keeper keeper = {.buffer = buffer};
    (void)state;
    send(1, FOVEA_COMMAND_SAVE | FOVEA_COMMAND_RESET);
    arrived(1);
    assert_true(fv_answers_take(&answers, &keeper, &recordings) & FOVEA_COMMAND_SAVE);
    fv_answers_step(&answers);
    answered(0);
    keeper.begun = 1; /* by hand what fv_keeper_commands and the watching thread do */
    atomic_store(&keeper.stage, FV_KEEPER_FILLING);
    (void)fv_answers_take(&answers, &keeper, &recordings);
    answered(0);
    snprintf(keeper.failure.text, sizeof keeper.failure.text, "m.fvmap: no space left");
    atomic_store(&keeper.stage, FV_KEEPER_IDLE);
    (void)fv_answers_take(&answers, &keeper, &recordings);
    answered(1);
    assert_answer(0, 1, FAILED, "m.fvmap: no space left");
}

static void the_end_of_the_run_answers_the_rest(void **state)
{
    static uint8_t buffer[8];
    static struct fv_keeper keeper = {.buffer = buffer};
    (void)state;
    send(1, FOVEA_COMMAND_SAVE);
    arrived(1);
    (void)fv_answers_take(&answers, &keeper, &recordings);
    fv_answers_step(&answers);
    send(2, FOVEA_COMMAND_PAUSE); /* which no step takes any more */
    arrived(2);
    fv_answers_end(&answers, &keeper, &recordings, NULL);
    answered(2);
    assert_answer(0, 1, DONE, "");
    assert_answer(1, 2, REFUSED, "the run has ended");
}

/* 200 wrong commands within less than 2 seconds of the receiver's time, or fewer answers for each
 * second. */
static void a_flood_of_wrong_commands_gets_few_answers(void **state)
{
    static struct fv_keeper keeper;
    struct timespec begin, end;
    (void)state;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (int i = 0; i < 200; i++) {
        send(i, 512);
        usleep(1000);
        if (i % 20 == 0) (void)fv_answers_take(&answers, &keeper, &recordings);
    }
    arrived(200);
    clock_gettime(CLOCK_MONOTONIC, &end);
    (void)fv_answers_take(&answers, &keeper, &recordings);
    const uint32_t seconds = (uint32_t)(end.tv_sec - begin.tv_sec) + 2;
    int64_t end_ns = 0;
    while (heard.count < 10 && fv_test_patient(&end_ns, 0))
        fv_receiver_handle(receiver, 10);
    for (int i = 0; i < 20; i++) /* and what there is besides */
        fv_receiver_handle(receiver, 10);
    assert_true(heard.count >= 10 && heard.count <= 10 * seconds);
}

/* ---- the whole program ----------------------------------------------------------------------- */

/* Runs that wait for commands most of the time: a low rate, in pictures where odometry starts soon.
 */
#define ORBIT "sim:orbit?width=320&height=240&rate=10&frames=100000"
#define HALF "features.count_max=500"

/* What the program prints for the words; its exit code. */
static int ask(const char *program, const char *words, char *line, size_t bytes)
{
    char command[1600];
    snprintf(command, sizeof command, "%s --prefix R --wait 120 %s 2>&1", program, words);
    return watched_shell(command, line, bytes);
}

/* Ask for what changes nothing until the run listens, and answers in time. */
static void await_run(const char *program)
{
    char words[64], line[512];
    int64_t end_ns = 0;
    int code = 3;
    for (int wait_s = 1; code == 3 && fv_test_patient(&end_ns, 0); wait_s *= 2) {
        snprintf(words, sizeof words, "--wait %d resume", wait_s);
        code = ask(program, words, line, sizeof line);
    }
    assert_int_equal(code, 0);
}

static void expect_answer(const char *program, const char *words, int code, const char *text)
{
    char line[512];
    const int found = ask(program, words, line, sizeof line);
    if (found != code || strcmp(line, text) != 0)
        fail_msg("%s %s: exit %d, \"%s\"; expected %d, \"%s\"", program, words, found, line, code,
                 text);
}

static void programs_print_the_answers_of_a_run(void **state)
{
    static struct watched watched;
    char folder[] = "/tmp/fovea_answers_XXXXXX", map[64], save[96], tools[2][700];
    struct stat saved;
    (void)state;
    assert_non_null(mkdtemp(folder));
    snprintf(map, sizeof map, "%s/m.fvmap", folder);
    snprintf(save, sizeof save, "map.save=%s", map);
    snprintf(tools[0], sizeof tools[0], "%s/command", build_folder());
    snprintf(tools[1], sizeof tools[1], "python3 tools/subscribers/command.py --types %s/python",
             build_folder());
    const char *const arguments[] = {
        "--source", ORBIT, "--rate", "real", "--quiet", "--picture",        "none",
        "--set",    HALF,  "--set",  save,   "--set",   "channel_prefix=R", NULL};
    watched_start(&watched, "run", arguments);
    await_run(tools[0]);
    for (int i = 0; i < 2; i++) {
        expect_answer(tools[i], "pause", 0, "done\n");
        expect_answer(tools[i], "reset resume", 0, "done\n");
        expect_answer(tools[i], "overwrite", 1,
                      "refused: unknown commands: expected a sum of 1 (reset), 2 (pause), 4 "
                      "(resume), 8 (save) and, with save, 16 (overwrite), or 32 (record) or 64 "
                      "(record-stop) alone\n");
    }
    expect_answer(tools[0], "save", 0, "done\n");
    assert_int_equal(stat(map, &saved), 0); /* the answer comes when the file is there */
    assert_true(saved.st_size > 0);
    expect_answer(tools[0], "--sender 3 --run-id 5 reset", 1,
                  "refused: for another run: expected the run_id of this one\n");
    watched_interrupt(&watched);
    assert_int_equal(watched_end(&watched), 0);
    watched_remove(folder);
}

static bool replays(const char *path, const char *option)
{
    char command[1400], line[512] = "", last[512] = "";
    snprintf(command, sizeof command, "%s/fovea replay %s --verify %s 2>&1", build_folder(), path,
             option);
    FILE *pipe = popen(command, "r");
    assert_non_null(pipe);
    while (fgets(line, sizeof line, pipe) != NULL)
        memcpy(last, line, sizeof last);
    const int status = pclose(pipe);
    if (status != 0) print_message("%s: %s", path, last);
    return status == 0;
}

/* The only recording in the folder that ended in order. */
static void find_recording(const char *folder, char *path, size_t bytes)
{
    char command[200];
    snprintf(command, sizeof command, "ls %s/records/*Z.lcm", folder);
    assert_int_equal(watched_shell(command, path, bytes), 0);
    path[strcspn(path, "\n")] = '\0';
}

/* A recording that commands begin and end replays bit for bit, with the parameters that were
 * changed before and in it; the run's own recording does, too: a step sees nothing of it. */
static void recordings_by_command_replay(void **state)
{
    static struct watched watched;
    char folder[] = "/tmp/fovea_answers_XXXXXX", whole[64], kept[96], tools[2][700], path[256];
    (void)state;
    assert_non_null(mkdtemp(folder));
    snprintf(whole, sizeof whole, "%s/whole.lcm", folder);
    snprintf(kept, sizeof kept, "record_folder=%s/records", folder);
    snprintf(tools[0], sizeof tools[0], "%s/command", build_folder());
    snprintf(tools[1], sizeof tools[1], "python3 tools/subscribers/command.py --types %s/python",
             build_folder());
    const char *const arguments[] = {
        WATCHED_RUN("sim:tour?width=320&height=240&rate=12&frames=100000"),
        "--set",
        HALF,
        "--set",
        kept,
        "--set",
        "channel_prefix=R",
        "--set",
        "record_buffer=1000", /* of a disk that is busy */
        "--record",
        whole,
        NULL};
    watched_start(&watched, "run", arguments);
    await_run(tools[0]);
    expect_answer(tools[0], "record-stop", 1, "refused: found no recording to end\n");
    expect_answer(tools[1], "features.threshold=27", 0, "done\n");
    expect_answer(tools[0], "record", 0, "done\n");
    expect_answer(tools[0], "record", 1, "refused: a recording has been begun already\n");
    expect_answer(tools[1], "features.threshold=24", 0, "done\n");
    usleep(500000);
    expect_answer(tools[0], "record-stop", 0, "done\n");
    find_recording(folder, path, sizeof path);
    watched_interrupt(&watched);
    assert_int_equal(watched_end(&watched), 0);
    assert_false(replays(path, "")); /* it is not trusted */
    assert_true(replays(path, "--trust-state"));
    assert_true(replays(whole, ""));
    watched_remove(folder);
}

static void put_text(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
}

/* What `backup` prints of a run that was just started. */
static char *back_up(const char *tool)
{
    char command[1400], *text = calloc(1, 65536);
    assert_non_null(text);
    int64_t end_ns = 0;
    for (int wait_s = 5; strncmp(text, "# All settings", 14) != 0 && fv_test_patient(&end_ns, 0);
         wait_s *= 2) {
        snprintf(command, sizeof command, "%s --prefix R --wait %d backup", tool, wait_s);
        (void)watched_shell(command, text, 65536); /* until the run listens */
    }
    return text;
}

static void replace(char *text, const char *from, const char *to)
{
    char *at = strstr(text, from);
    assert_non_null(at);
    assert_int_equal(strlen(from), strlen(to));
    memcpy(at, to, strlen(to));
}

/* Settings and calibration that were restored hold in the next run; wrong ones change nothing. */
static void settings_are_restored(void **state)
{
    static const char camera_text[] =
        "image_width: 160\nimage_height: 120\ncamera_name: cam\ndistortion_model: plumb_bob\n"
        "camera_matrix: {rows: 3, cols: 3, data: [121.5, 0, 80, 0, 121.5, 60, 0, 0, 1]}\n"
        "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n";
    static struct watched watched;
    char folder[] = "/tmp/fovea_answers_XXXXXX", camera[64], kept[80], file[64], config[64],
         config_text[300], tool[700], words[100];
    (void)state;
    assert_non_null(mkdtemp(folder));
    snprintf(camera, sizeof camera, "%s/camera.yaml", folder);
    snprintf(kept, sizeof kept, "%s/kept.yaml", folder);
    snprintf(file, sizeof file, "%s/other.yaml", folder);
    snprintf(config, sizeof config, "%s/config.yaml", folder);
    snprintf(words, sizeof words, "restore:%s", file);
    snprintf(tool, sizeof tool, "python3 tools/subscribers/command.py --types %s/python",
             build_folder());
    put_text(camera, camera_text);
    snprintf(config_text, sizeof config_text, "camera: %s\nparameters.file: %s\n", camera, kept);
    put_text(config, config_text);
    const char *const arguments[] = {
        "--config",
        config,
        WATCHED_RUN("sim:orbit?width=160&height=120&rate=10&frames=100000"),
        "--set",
        "channel_prefix=R",
        NULL};
    watched_start(&watched, "run", arguments);
    char *text = back_up(tool);
    replace(text, "121.5", "122.5");
    replace(text, "\nimage_width: 160", "\nimage_width: 161");
    put_text(file, text);
    expect_answer(tool, words, 1,
                  "refused: calibration: image size: found 161 x 120, expected 160 x 120 as the "
                  "frames have\n");
    assert_int_not_equal(access(kept, F_OK), 0);
    replace(text, "\nimage_width: 161", "\nimage_width: 160");
    replace(text, "\nstatistics_every: 30\n", "\nstatistics_every: 31\n");
    replace(text, "\nodometry.keyframes: 128\n", "\nodometry.keyframes: 129\n");
    put_text(file, text);
    expect_answer(tool, words, 0, "done: 1 took hold, 1 and the calibration with the next start\n");
    free(text);
    watched_interrupt(&watched);
    assert_int_equal(watched_end(&watched), 0);
    watched_start(&watched, "run", arguments);
    text = back_up(tool);
    assert_non_null(strstr(text, "122.5"));
    assert_non_null(strstr(text, "\nstatistics_every: 31\n"));
    assert_non_null(strstr(text, "\nodometry.keyframes: 129\n"));
    free(text);
    watched_interrupt(&watched);
    assert_int_equal(watched_end(&watched), 0);
    watched_remove(folder);
}

int main(void)
{
    if (!watched_possible("test_answers")) return 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_command_is_done_when_the_step_has_taken_it, open_both,
                                        close_both),
        cmocka_unit_test_setup_teardown(a_save_is_answered_when_it_has_ended, open_both,
                                        close_both),
        cmocka_unit_test_setup_teardown(the_end_of_the_run_answers_the_rest, open_both, close_both),
        cmocka_unit_test_setup_teardown(a_flood_of_wrong_commands_gets_few_answers, open_both,
                                        close_both),
        cmocka_unit_test(programs_print_the_answers_of_a_run),
        cmocka_unit_test(recordings_by_command_replay),
        cmocka_unit_test(settings_are_restored),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
