/* Live parameters of a whole run, in a network of the test's own: each request gets an answer, a
 * recording with twenty changes replays bit for bit, what is kept holds at the next start, and
 * wrong requests change nothing. */
#include <errno.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/network/receiver.h"
#include "common/build_folder.h"
#include "common/patience.h"
#include "common/watched.h"
#include "drivers/table.h"

#include "fovea_parameter_result_t.h"
#include "fovea_parameter_t.h"

#define URL "udpm://239.255.76.67:7667"

enum {
    DONE = FOVEA_PARAMETER_RESULT_T_RESULT_DONE,
    REFUSED = FOVEA_PARAMETER_RESULT_T_RESULT_REFUSED,
    NEEDS_RESTART = FOVEA_PARAMETER_RESULT_T_RESULT_NEEDS_RESTART
};

static char folder[] = "/tmp/fovea_parameters_XXXXXX", kept[96], log_path[96];
static struct watched watched;
static struct fv_receiver *receiver;
static int64_t last_id;
static int changes_sent; /* requests with a value, those too that were sent again */

/* ---- requests and answers -------------------------------------------------------------------- */

static struct {
    bool there;
    int64_t id;
    int8_t result;
    char value[1024], reason[256];
} heard;

static void take_answer(void *context, const struct fv_received *received)
{
    fovea_parameter_result_t result;
    (void)context;
    assert_true(fovea_parameter_result_t_decode(received->data, 0, (int)received->bytes, &result) >=
                0);
    if (result.id == last_id) {
        heard.there = true;
        heard.result = result.result;
        snprintf(heard.value, sizeof heard.value, "%s", result.value);
        snprintf(heard.reason, sizeof heard.reason, "%s", result.reason);
    }
    fovea_parameter_result_t_decode_cleanup(&result);
}

static void send_request(const char *key, const char *value, bool keep)
{
    uint8_t data[2048];
    const fovea_parameter_t request = {.id = last_id,
                                       .key = (char *)(uintptr_t)key,
                                       .value = (char *)(uintptr_t)value,
                                       .keep = keep};
    const int bytes = fovea_parameter_t_encode(data, 0, sizeof data, &request);
    assert_true(bytes > 0);
    changes_sent += value[0] != '\0';
    watched_send("P_PARAMETER", data, (size_t)bytes);
}

/* Ask, again where nothing answers (the run may not listen yet), until there is an answer. */
static void ask(const char *key, const char *value, bool keep)
{
    int64_t end_ns = 0;
    last_id++;
    memset(&heard, 0, sizeof heard);
    while (!heard.there && fv_test_patient(&end_ns, 0)) {
        send_request(key, value, keep);
        for (int i = 0; i < 10 && !heard.there; i++)
            fv_receiver_handle(receiver, 100);
    }
    assert_true(heard.there);
}

static void expect(const char *key, const char *value, int8_t result, const char *in_force,
                   const char *reason)
{
    ask(key, value, false);
    if (heard.result != result || strcmp(heard.value, in_force) != 0 ||
        strstr(heard.reason, reason) == NULL)
        fail_msg("%s=%s: result %d, value \"%s\", \"%s\"; expected %d, \"%s\", \"%s\"", key, value,
                 heard.result, heard.value, heard.reason, result, in_force, reason);
}

/* ---- runs ------------------------------------------------------------------------------------ */

static void start(bool records)
{
    char file[128], record[128];
    snprintf(file, sizeof file, "parameters.file=%s", kept);
    snprintf(record, sizeof record, "record=%s", records ? log_path : "");
    const char *const arguments[] = {
        WATCHED_RUN("sim:orbit?width=160&height=120&rate=15&frames=100000"),
        "--set",
        "channel_prefix=P",
        "--set",
        "image.operations=[sharpen]",
        "--set",
        "record_buffer=1000",
        "--set",
        file,
        "--set",
        record,
        "--set", /* only a replay judges what becomes of the frames */
        records ? "odometry.enabled=true" : "odometry.enabled=false",
        NULL};
    watched_start(&watched, "run", arguments);
}

static void stop(void)
{
    watched_interrupt(&watched);
    assert_int_equal(watched_end(&watched), 0);
}

static int open_all(void **state)
{
    struct fovea_error error;
    static struct fv_receiver_channel row = {.name = "P_PARAMETER_RESULT",
                                             .type = "fovea.parameter_result_t",
                                             .bytes_max = 2048,
                                             .take = take_answer};
    const struct fv_receiver_setup setup = {URL, "loopback", &row, 1};
    (void)state;
    if (mkdtemp(folder) == NULL) return -1;
    snprintf(kept, sizeof kept, "%s/kept.yaml", folder);
    snprintf(log_path, sizeof log_path, "%s/run.lcmlog", folder);
    return fv_receiver_open(&setup, &receiver, &error) == FOVEA_OK ? 0 : -1;
}

static int close_all(void **state)
{
    (void)state;
    fv_receiver_close(receiver);
    watched_remove(folder);
    return 0;
}

/* Output of a command of the build, and its exit code. */
static int run_command(const char *words, char *text, size_t bytes)
{
    char command[1400];
    snprintf(command, sizeof command, "%s/%s 2>&1", build_folder(), words);
    return watched_shell(command, text, bytes);
}

static uint32_t big_endian(const uint8_t bytes[4])
{
    return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

/* Events of the log on the channel: each is a sync word, a number, a time, two lengths, the channel
 * and the data. */
static int count_events(const char *path, const char *channel)
{
    enum { HEAD_BYTES = 4 + 8 + 8 + 4 + 4 };
    uint8_t head[HEAD_BYTES];
    char name[64];
    int count = 0;
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    while (fread(head, 1, HEAD_BYTES, file) == HEAD_BYTES) {
        const uint32_t length = big_endian(head + 20);
        assert_true(length < sizeof name);
        assert_int_equal(fread(name, 1, length, file), length);
        name[length] = '\0';
        count += strcmp(name, channel) == 0;
        assert_int_equal(fseek(file, big_endian(head + 24), SEEK_CUR), 0);
    }
    fclose(file);
    return count;
}

/* The simulated camera was set to 2.5 ms in place of 5, and a gain of 4: from one frame to the next
 * they are brighter than the way of the camera makes them. */
static void assert_frames_changed(void)
{
    static const struct fovea_source_selection all = {.step = 1};
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
    struct fovea_frame frame;
    struct fovea_error error;
    const char *address;
    char uri[128];
    double before = 0, rise = 0;
    int64_t exposure_ns = 0;
    snprintf(uri, sizeof uri, "lcmlog:%s", log_path);
    assert_int_equal(fv_source_find(uri, &ops, &address, &error), FOVEA_OK);
    assert_int_equal(ops->open(address, &all, &source, &error), FOVEA_OK);
    assert_int_equal(ops->start(source, &error), FOVEA_OK);
    while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        const struct fovea_image *image = &frame.images[0];
        double sum = 0;
        for (int32_t y = 0; y < image->height; y++)
            for (int32_t x = 0; x < image->width; x++)
                sum += image->data[y * image->stride_bytes + x];
        if (before == 0) assert_int_equal(frame.exposure_ns[0], 5000000);
        if (before > 0 && sum / before > rise) rise = sum / before;
        before = sum;
        exposure_ns = frame.exposure_ns[0];
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    ops->close(source);
    assert_int_equal(exposure_ns, 2500000);
    if (rise < 1.3) fail_msg("from one frame to the next at most %g times the grey", rise);
}

/* ---- tests ----------------------------------------------------------------------------------- */

static void test_a_recording_with_twenty_changes_replays_bit_for_bit(void **state)
{
    static const char *const changes[][2] = {{"features.threshold", "30"},
                                             {"features.threshold_min", "12"},
                                             {"features.per_cell", "4"},
                                             {"features.count_max", "400"},
                                             {"image.operations", "[denoise, sharpen, gamma]"},
                                             {"image.gamma", "0.8"},
                                             {"image.denoise_size", "5"},
                                             {"odometry.inliers_good", "25"},
                                             {"preview.quality", "30"},
                                             {"preview.period_frames", "3"},
                                             {"pose_every", "2"},
                                             {"features_every", "3"},
                                             {"map_every", "7"},
                                             {"statistics_every", "10"},
                                             {"image.operations", "[]"},
                                             {"camera_status_every", "4"},
                                             {"edges.low", "40"},
                                             {"features.count_max", "500"},
                                             {"camera_exposure_ms", "2.5"},
                                             {"camera_gain", "4"}};
    enum { CHANGES = sizeof changes / sizeof changes[0] };
    char words[256], text[4096];
    (void)state;
    assert_int_equal(CHANGES, 20);
    start(true);
    ask("features.per_cell", "2", false); /* until the run listens */
    for (int i = 0; i < CHANGES; i++)
        expect(changes[i][0], changes[i][1], DONE, changes[i][1], "");
    usleep(200000);
    stop();
    assert_frames_changed();
    /* More where a request was sent again before its answer came. */
    assert_true(count_events(log_path, "P_PARAMETER") >= CHANGES + 1);
    assert_int_equal(count_events(log_path, "P_PARAMETER_RESULT"), 0);
    snprintf(words, sizeof words, "fovea replay %s --verify", log_path);
    if (run_command(words, text, sizeof text) != 0) fail_msg("%s: %s", words, text);
}

/* Whatever the key. */
static void test_an_empty_value_asks(void **state)
{
    (void)state;
    changes_sent = 0;
    start(true);
    ask("features.per_cell", "2", false); /* until the run listens */
    expect("features.threshold", "", DONE, "20", "");
    expect("features.threshold", "25", DONE, "25", "");
    expect("features.threshold", "", DONE, "25", "");
    expect("seed", "", DONE, "1", "");
    expect("lcm_url", "", DONE, "\"" URL "\"", "");
    expect("features.treshold", "", REFUSED, "", "unknown key");
    stop();
    /* None but the changes: two, or more where a request was sent again before its answer came. */
    assert_in_range(count_events(log_path, "P_PARAMETER"), 2, changes_sent);
}

static void test_wrong_requests_change_nothing(void **state)
{
    (void)state;
    start(false);
    expect("features.threshold", "25", DONE, "25", "");
    expect("features.threshold", "101", REFUSED, "25", "features.threshold: found '101', expected");
    expect("features.threshold", "many", REFUSED, "25", "found 'many'");
    expect("features.threshold", "30, seed: 7", REFUSED, "25", "expected one value");
    expect("features.threshold_min", "26", REFUSED, "7", "at most features.threshold, which is 25");
    expect("features.treshold", "25", REFUSED, "", "unknown key");
    expect("seed", "7", REFUSED, "1", "read at the start");
    expect("lcm_url", "udpm://239.255.76.67:1", REFUSED, "\"" URL "\"", "read at the start");
    expect("camera_exposure_ms", "67", REFUSED, "0",
           "sim: exposure (ms): found 67, expected [0.05");
    expect("camera_exposure_ms", "10001", REFUSED, "0", "camera_exposure_ms: found '10001'");
    expect("camera_gain", "17", REFUSED, "-1", "sim: gain: found 17, expected [0.0625, 16]");
    expect("camera_gain", "2", DONE, "2", "");
    expect("camera_gain", "-1", DONE, "-1", "");
    expect("features.count_max", "1001", REFUSED, "1000", "expected at most 1000");
    expect("edges.period_frames", "1", REFUSED, "0", "or a restart");
    expect("image.operations", "[contrast_enhancement]", REFUSED, "[sharpen]", "or a restart");
    expect("features.threshold", "25", DONE, "25", "");
    stop();
}

static void test_what_is_kept_holds_at_the_next_start(void **state)
{
    struct stat at;
    char text[4096], words[256];
    (void)state;
    start(false);
    ask("features.threshold", "33", true);
    assert_int_equal(heard.result, DONE);
    assert_int_equal(stat(kept, &at), 0);
    ask("edges.period_frames", "5", true); /* which had no memory */
    assert_int_equal(heard.result, NEEDS_RESTART);
    assert_string_equal(heard.value, "0");
    ask("features.threshold", "200", true); /* wrong: the file stays */
    assert_int_equal(heard.result, REFUSED);
    ask("features.per_cell", "3", false); /* not kept */
    assert_int_equal(heard.result, DONE);
    stop();
    start(false);
    expect("features.threshold", "200", REFUSED, "33", "");
    expect("edges.period_frames", "4", DONE, "4", "");
    expect("features.per_cell", "200", REFUSED, "2", "");
    ask("camera_exposure_ms", "7", true);
    assert_int_equal(heard.result, DONE);
    stop();
    start(false);
    expect("camera_exposure_ms", "", DONE, "7", "");
    stop();
    /* What a start could not read is refused, though it goes with what is in force now. */
    start(false);
    ask("features.threshold", "60", false);
    assert_int_equal(heard.result, DONE);
    ask("features.threshold_min", "40", true);
    assert_int_equal(heard.result, REFUSED);
    assert_non_null(strstr(heard.reason, "the next start cannot have it: features.threshold_min"));
    ask("features.threshold_min", "40", false);
    assert_int_equal(heard.result, DONE);
    stop();
    /* A file that does not go with the configuration, or is wrong, does not keep a robot from
     * starting. */
    static const char *const wrong[][2] = {
        {"features.threshold_min: 50\n", "features.threshold_min: found 50"},
        {"features.threshold: 25\nrecord: x.lcmlog\n",
         "kept.yaml:2: record: found a key of the host"},
        {"features.threshold: [\n", "kept.yaml:"}};
    for (int i = 0; i < 3; i++) {
        FILE *kept_file = fopen(kept, "w");
        assert_non_null(kept_file);
        fputs(wrong[i][0], kept_file);
        fclose(kept_file);
        snprintf(
            words, sizeof words,
            "fovea run --source 'sim:?width=160&height=120' --frames 1 --quiet --picture none --set lcm_url= "
            "--set parameters.file=%s",
            kept);
        assert_int_equal(run_command(words, text, sizeof text), 0);
        if (strstr(text, wrong[i][1]) == NULL || strstr(text, "left out") == NULL)
            fail_msg("found %s, expected %s", text, wrong[i][1]);
    }
    FILE *file;
    /* Nor is it a file that the run reads. */
    snprintf(words, sizeof words, "fovea run --source sim: --config %s --set parameters.file=%s",
             kept, kept);
    file = fopen(kept, "w");
    assert_non_null(file);
    fprintf(file, "features.threshold: 25\n");
    fclose(file);
    assert_int_equal(run_command(words, text, sizeof text), 2);
    assert_non_null(strstr(text, "parameters.file"));
    assert_int_equal(unlink(kept), 0);
}

/* Ask for a wrong value until the one in force is `expected`. */
static void await_threshold(const char *expected)
{
    int64_t end_ns = 0;
    do {
        ask("features.threshold", "200", false);
        if (strcmp(heard.value, expected) == 0) return;
    } while (fv_test_patient(&end_ns, 100));
    fail_msg("features.threshold: found %s, expected %s", heard.value, expected);
}

/* At once: a run that is late may read it now. */
static void write_config(const char *path, const char *text)
{
    char part[160];
    snprintf(part, sizeof part, "%s.part", path);
    FILE *file = fopen(part, "w");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(rename(part, path), 0);
}

/* A service manager, whose socket this is. */
static int manager_open(const char *name)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const struct timeval patience = {.tv_sec = FV_TEST_PATIENCE_S};
    const int manager = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    memcpy(address.sun_path + 1, name, strlen(name));
    assert_int_equal(bind(manager, (const struct sockaddr *)&address,
                          (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1 + strlen(name))),
                     0);
    assert_int_equal(setsockopt(manager, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience), 0);
    return manager;
}

/* Until the run has sent the manager what begins so; it sends other words as well. */
static void await_word(int manager, const char *begin)
{
    char text[256];
    int64_t end_ns = 0;
    do {
        ssize_t got;
        do /* one with a timeout is not begun again by itself */
            got = recv(manager, text, sizeof text - 1, 0);
        while (got < 0 && errno == EINTR);
        text[got > 0 ? got : 0] = '\0';
        if (strncmp(text, begin, strlen(begin)) == 0) return;
        if (got <= 0) break;
    } while (fv_test_patient(&end_ns, 0));
    fail_msg("the service manager was not sent %s", begin);
}

/* The run reads its configuration again, and goes on. */
static void reload(int manager)
{
    assert_int_equal(kill(watched.process, SIGHUP), 0);
    await_word(manager, "RELOADING=1");
    await_word(manager, "READY=1");
}

/* The lower limit of the first file is above the upper one of the second, and the other way round:
 * no order of the keys does for both. */
static void test_a_service_reads_its_configuration_again(void **state)
{
    static const char both[] =
        "source: sim:orbit?width=160&height=120&rate=15&frames=100000\nchannel_prefix: P\nrate: real\n"
        "record_buffer: 1000\n";
    char config[128], text[512], words[256], output[4096];
    (void)state;
    snprintf(config, sizeof config, "%s/run.yaml", folder);
    snprintf(text, sizeof text, "%sfeatures: {threshold: 40, threshold_min: 30}\n", both);
    write_config(config, text);
    setenv("NOTIFY_SOCKET", "@fovea_test_parameters", 1);
    const int manager = manager_open("fovea_test_parameters");
    const char *const arguments[] = {"--config", config,     "--quiet", "--picture",
                                     "none",     "--record", log_path,  NULL};
    assert_true(unlink(log_path) == 0 || true);
    watched_start(&watched, "run", arguments);
    unsetenv("NOTIFY_SOCKET");
    await_word(manager, "READY=1");
    await_threshold("40");
    snprintf(text, sizeof text,
             "%sfeatures: {threshold: 20, threshold_min: 10}\npose_every: 3\ncamera_gain: 3\n",
             both);
    write_config(config, text);
    reload(manager);
    await_threshold("20");
    snprintf(text, sizeof text, "%sfeatures: {threshold: 9, threshold_min: 10}\n", both);
    write_config(config, text); /* wrong: nothing of it is taken, and the run goes on */
    reload(manager);
    snprintf(text, sizeof text,
             "%sfeatures: {threshold: 60, threshold_min: 50}\nseed: 5\ncamera_gain: 99\n",
             both); /* what the camera refuses */
    write_config(config, text);
    reload(manager);
    await_threshold("20");
    expect("camera_gain", "", DONE, "3", "");
    snprintf(text, sizeof text, "%sfeatures: {threshold: 60, threshold_min: 50}\nseed: 5\n", both);
    write_config(config, text);
    reload(manager);
    await_threshold("60");
    stop();
    close(manager);
    assert_int_equal(count_events(log_path, "P_PARAMETER"), 4 + 4);
    snprintf(words, sizeof words, "fovea replay %s --verify", log_path);
    if (run_command(words, output, sizeof output) != 0) fail_msg("%s: %s", words, output);
}

static void test_the_program_that_users_copy_changes_parameters(void **state)
{
    char command[1024], line[512];
    (void)state;
    start(false);
    expect("features.threshold", "21", DONE, "21", "");
    static const char *const asked[][3] = {
        {"features.threshold=24", "done\n", "0"},
        {"features.threshold=", "features.threshold: 24\n", "0"},
        {"features.threshold=240",
         "refused: features.threshold: found '240', expected a whole number in [2, 100]\n", "1"}};
    for (size_t i = 0; i < sizeof asked / sizeof asked[0]; i++) {
        snprintf(command, sizeof command,
                 "python3 tools/subscribers/command.py --types %s/python --prefix P --wait 60 "
                 "'%s' 2>&1",
                 build_folder(), asked[i][0]);
        assert_int_equal(watched_shell(command, line, sizeof line), asked[i][2][0] - '0');
        assert_string_equal(line, asked[i][1]);
    }
    stop();
}

int main(void)
{
    if (!watched_possible("test_parameters")) return 0;
    signal(SIGHUP, SIG_DFL); /* ignored under nohup, and by the programs that it starts */
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_recording_with_twenty_changes_replays_bit_for_bit),
        cmocka_unit_test(test_an_empty_value_asks),
        cmocka_unit_test(test_wrong_requests_change_nothing),
        cmocka_unit_test(test_what_is_kept_holds_at_the_next_start),
        cmocka_unit_test(test_a_service_reads_its_configuration_again),
        cmocka_unit_test(test_the_program_that_users_copy_changes_parameters),
    };
    return cmocka_run_group_tests_name("parameters", tests, open_all, close_all);
}
