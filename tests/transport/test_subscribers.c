/* The subscribers in C, C++ and Python each receive every message of 1,000 frames at 200 Hz, and
 * the one in Java, whose socket has only the room that the system gives by default, every message
 * that is sent after it printed those before; in a network of the test's own. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/network/transport.h"
#include "common/build_folder.h"
#include "common/detector.h"
#include "common/own_network.h"
#include "common/patience.h"
#include "fovea/fovea.h"

#include "fovea_features_t.h"

#define URL "udpm://239.255.76.67:7667"

#define IDLE_S "20" /* on a busy machine Python and the runtime take seconds to start */

#define LCM_JAR "/usr/share/java/lcm.jar"

enum { FRAMES = 1000, FOLLOWED_FRAMES = 60, PERIOD_NS = 5000000, WIDTH = 320, HEIGHT = 240 };

enum { CHANNELS = 9 };
static const char *const suffixes[CHANNELS] = {"FEATURES", "CAMERA_STATUS", "STATISTICS",
                                               "PREVIEW",  "POSE",          "CAMERA_POSE",
                                               "MAP",      "DETECTIONS",    "OBJECTS"};

/* ---- subscribers ----------------------------------------------------------------------------- */

struct subscriber {
    pid_t process;
    FILE *output;
    uint64_t lines; /* about messages, as far as it was followed */
};

/* Start one and wait until it listens. */
static void start(struct subscriber *subscriber, char *const arguments[])
{
    int ends[2];
    char line[256];
    assert_int_equal(pipe(ends), 0);
    subscriber->lines = 0;
    subscriber->process = fork();
    if (subscriber->process == 0) {
        dup2(ends[1], STDOUT_FILENO);
        close(ends[0]);
        close(ends[1]);
        execvp(arguments[0], arguments);
        _exit(127);
    }
    close(ends[1]);
    subscriber->output = fdopen(ends[0], "r");
    if (fgets(line, sizeof line, subscriber->output) == NULL || strcmp(line, "listening\n") != 0)
        fail_msg("%s does not listen", arguments[0]);
}

/* Wait until it has printed `messages` lines, one per message; it ends itself when none comes. */
static void follow(struct subscriber *subscriber, uint64_t messages)
{
    char line[512];
    for (; subscriber->lines < messages; subscriber->lines++)
        if (fgets(line, sizeof line, subscriber->output) == NULL || strncmp(line, "FOVEA_", 6) != 0)
            fail_msg("found the subscriber's end after %llu messages, expected %llu",
                     (unsigned long long)subscriber->lines, (unsigned long long)messages);
}

/* Wait for its end; it must have got as many messages as were sent on each channel. */
static void expect(struct subscriber *subscriber, const char *name, const uint64_t sent[CHANNELS])
{
    uint64_t got[CHANNELS] = {0};
    char line[256], suffix[64];
    unsigned long long messages, malformed = 0;
    int status;
    while (fgets(line, sizeof line, subscriber->output) != NULL) {
        print_message("  %s: %s", name, line);
        if (strncmp(line, "FEATURES ", 9) == 0 &&
            sscanf(line, "%*[^m]messages, %*d bytes, frames %*d to %*d, %llu", &malformed) != 1)
            malformed = 0;
        if (sscanf(line, "%63s %llu messages", suffix, &messages) == 2)
            for (int i = 0; i < CHANNELS; i++)
                if (strcmp(suffix, suffixes[i]) == 0) got[i] = messages;
    }
    fclose(subscriber->output);
    waitpid(subscriber->process, &status, 0);
    for (int i = 0; i < CHANNELS; i++)
        if (got[i] != sent[i])
            fail_msg("%s: %s: found %llu messages, expected %llu", name, suffixes[i],
                     (unsigned long long)got[i], (unsigned long long)sent[i]);
    assert_int_equal(malformed, 1);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

/* ---- the run --------------------------------------------------------------------------------- */

static void count_and_publish(struct fv_transport *transport, const struct fovea_outputs *outputs,
                              uint64_t sent[CHANNELS])
{
    for (uint32_t m = 0; m < outputs->message_count; m++) {
        const char *suffix = outputs->messages[m].channel + strlen("FOVEA_");
        int i = 0;
        while (i < CHANNELS && strcmp(suffix, suffixes[i]) != 0)
            i++;
        if (i == CHANNELS) fail_msg("%s: a message that this test does not know", suffix);
        sent[i]++;
    }
    fv_transport_publish(transport, outputs);
}

static uint64_t sum(const uint64_t sent[CHANNELS])
{
    uint64_t messages = 0;
    for (int i = 0; i < CHANNELS; i++)
        messages += sent[i];
    return messages;
}

/* Bytes that wait for those who hear LCM, in the fullest of their sockets. */
static unsigned unread(void)
{
    char line[256];
    unsigned most = 0, port, bytes;
    FILE *sockets = fopen("/proc/net/udp", "r");
    assert_non_null(sockets);
    while (fgets(line, sizeof line, sockets) != NULL)
        if (sscanf(line, " %*d: %*x:%x %*x:%*x %*x %*x:%x", &port, &bytes) == 2 && port == 7667 &&
            bytes > most)
            most = bytes;
    fclose(sockets);
    return most;
}

/* A sender that has no processor gets it. */
static void wait_for_room(struct fv_transport *transport)
{
    int64_t end_ns = 0;
    bool room;
    while (!(room = fv_transport_room(transport, false)) && fv_test_patient(&end_ns, 1)) {
    }
    if (!room) fail_msg("the sender sends nothing");
}

/* A subscriber that has no processor gets the time that its socket has no room for. */
static void wait_for_subscribers(void)
{
    enum { ENOUGH_BYTES = 1 << 16 };
    int64_t end_ns = 0;
    unsigned bytes;
    while ((bytes = unread()) > ENOUGH_BYTES && fv_test_patient(&end_ns, 1)) {
    }
    if (bytes > ENOUGH_BYTES) fail_msg("a subscriber has left %u bytes unread", bytes);
}

/* Frames of noise, which is full of corners, through the runtime and out: 1,000 at 200 Hz, or fewer
 * as `follower` prints them. */
static void run(struct fovea *rt, const struct fovea_config *config, struct fv_transport *transport,
                struct subscriber *follower, uint64_t sent[CHANNELS])
{
    static uint8_t pixels[WIDTH * HEIGHT];
    struct timespec due;
    uint32_t noise = 1;
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        pixels[i] = (uint8_t)((noise = noise * 1664525u + 1013904223u) >> 24);
    for (uint32_t n = 0; n < (follower != NULL ? FOLLOWED_FRAMES : FRAMES); n++) {
        struct fovea_frame frame = {.image_count = 1,
                                    .images[0] = {.data = pixels,
                                                  .width = WIDTH,
                                                  .height = HEIGHT,
                                                  .stride_bytes = WIDTH,
                                                  .format = FOVEA_PIXEL_GREY8,
                                                  .size_bytes = sizeof pixels},
                                    .stamp_ns = 1 + (int64_t)n * PERIOD_NS,
                                    .sequence = n};
        struct fovea_inputs inputs = {.frame = &frame, .now_ns = frame.stamp_ns};
        struct fovea_outputs outputs;
        fovea_grants_fixed(config, &inputs.grants);
        if (follower == NULL) clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        wait_for_room(transport);
        wait_for_subscribers();
        fovea_step(rt, &inputs, &outputs);
        count_and_publish(transport, &outputs, sent);
        fovea_work(rt, &inputs.grants, &outputs);
        count_and_publish(transport, &outputs, sent);
        if (follower != NULL) follow(follower, sum(sent));
        due.tv_nsec += PERIOD_NS;
        due.tv_sec += due.tv_nsec / 1000000000;
        due.tv_nsec %= 1000000000;
    }
}

/* The beginning of a message alone: a subscriber counts it as malformed and goes on. */
static void publish_truncated(struct fv_transport *transport)
{
    uint8_t data[16];
    fovea_features_t empty;
    memset(&empty, 0, sizeof empty);
    empty.method = (char *)"";
    uint8_t whole[128];
    assert_true(fovea_features_t_encode(whole, 0, sizeof whole, &empty) > (int)sizeof data);
    memcpy(data, whole, sizeof data);
    struct fovea_outputs outputs = {.message_count = 1};
    outputs.messages[0] =
        (struct fovea_message){.channel = "FOVEA_FEATURES", .data = data, .bytes = sizeof data};
    fv_transport_publish(transport, &outputs);
}

static void run_runtime(struct subscriber *follower, uint64_t sent[CHANNELS])
{
    struct fovea_config config;
    struct fovea_error error;
    struct fv_transport *transport = NULL;
    struct fovea *rt;
    size_t bytes;
    fovea_config_default(&config);
    config.rig.cameras[0].camera = (struct fovea_camera){
        .width = WIDTH, .height = HEIGHT, .fx = 300, .fy = 300, .cx = 160, .cy = 120};
    config.detect.model = detector_model(&config.detect.model_bytes);
    assert_int_equal(fovea_camera_prepare(&config.rig.cameras[0].camera, &error), FOVEA_OK);
    if (fovea_size(&config, &bytes, &error) != FOVEA_OK) fail_msg("%s", error.text);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    assert_int_equal(fovea_init(memory, bytes, &config, &rt, &error), FOVEA_OK);
    if (fv_transport_open(URL, 0, &transport, &error) != FOVEA_OK) fail_msg("%s", error.text);
    publish_truncated(transport);
    run(rt, &config, transport, follower, sent);
    struct fv_transport_counts counts;
    fv_transport_finish(transport);
    fv_transport_counts(transport, &counts);
    assert_int_equal(counts.dropped, 0);
    fv_transport_close(transport);
    free(memory);
}

/* False: `file`, which it needs, is not there. */
static bool can_start(const char *language, const char *file)
{
    if (access(file, R_OK) == 0) return true;
    print_message("SKIPPED the %s subscriber: no %s\n", language, file);
    return false;
}

static void test_every_message(void **state)
{
    (void)state;
    char in_c[640], in_cpp[640], python[640], types[640], ready[640];
    snprintf(in_c, sizeof in_c, "%s/subscribe", build_folder());
    snprintf(in_cpp, sizeof in_cpp, "%s/subscribe-cpp", build_folder());
    snprintf(python, sizeof python, "%s/venv-lcm/bin/python", build_folder());
    snprintf(types, sizeof types, "%s/python", build_folder());
    snprintf(ready, sizeof ready, "%s/venv-lcm/ready", build_folder());
    char *const c_arguments[] = {in_c, (char *)"--quiet", (char *)"--idle", (char *)IDLE_S, NULL};
    char *const cpp_arguments[] = {in_cpp, (char *)"--quiet", (char *)"--idle", (char *)IDLE_S,
                                   NULL};
    char *const python_arguments[] = {python,
                                      (char *)"tools/subscribers/subscribe.py",
                                      (char *)"--quiet",
                                      (char *)"--idle",
                                      (char *)IDLE_S,
                                      (char *)"--types",
                                      types,
                                      NULL};
    const bool with_cpp = can_start("C++", in_cpp), with_python = can_start("Python", ready);
    struct subscriber first, second, third;
    uint64_t sent[CHANNELS] = {0};
    start(&first, c_arguments);
    if (with_cpp) start(&second, cpp_arguments);
    if (with_python) start(&third, python_arguments);
    run_runtime(NULL, sent);
    assert_int_equal(sent[0], FRAMES); /* features */
    assert_int_equal(sent[4], FRAMES); /* poses */
    for (int i = 0; i < CHANNELS; i++)
        assert_true(sent[i] > 0);
    expect(&first, "C", sent);
    if (with_cpp) expect(&second, "C++", sent);
    if (with_python) expect(&third, "Python", sent);
}

static void test_a_signal_ends_python_in_order(void **state)
{
    const struct timespec a_while = {.tv_nsec = 200000000};
    char python[640], types[640], ready[640];
    int status;
    (void)state;
    snprintf(python, sizeof python, "%s/venv-lcm/bin/python", build_folder());
    snprintf(types, sizeof types, "%s/python", build_folder());
    snprintf(ready, sizeof ready, "%s/venv-lcm/ready", build_folder());
    char *const arguments[] = {python, (char *)"tools/subscribers/subscribe.py", (char *)"--types",
                               types, NULL};
    if (!can_start("Python", ready)) skip();
    struct subscriber subscriber;
    start(&subscriber, arguments);
    nanosleep(&a_while, NULL); /* it waits for messages */
    kill(subscriber.process, SIGINT);
    assert_int_equal(waitpid(subscriber.process, &status, 0), subscriber.process);
    fclose(subscriber.output);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
}

static void test_every_message_in_java(void **state)
{
    (void)state;
    char types[640], path[1400];
    snprintf(types, sizeof types, "%s/fovea-types.jar", build_folder());
    snprintf(path, sizeof path, "%s:" LCM_JAR, types);
    char *const arguments[] = {
        (char *)"java",   (char *)"-cp", path, (char *)"tools/subscribers/Subscribe.java",
        (char *)"--idle", (char *)"60",  NULL};
    if (!can_start("Java", types) || !can_start("Java", LCM_JAR)) skip();
    struct subscriber subscriber;
    uint64_t sent[CHANNELS] = {0};
    start(&subscriber, arguments);
    run_runtime(&subscriber, sent);
    assert_int_equal(sent[0], FOLLOWED_FRAMES);
    kill(subscriber.process, SIGTERM);
    expect(&subscriber, "Java", sent);
}

/* Under qemu-user a child would need the kernel to know the format. */
static bool can_start_children(void)
{
    int status = 0;
    char program[640];
    snprintf(program, sizeof program, "%s/subscribe", build_folder());
    pid_t child = fork();
    if (child == 0) {
        close(STDERR_FILENO);
        execl(program, program, "--help", (char *)NULL);
        _exit(127);
    }
    waitpid(child, &status, 0);
    return WIFEXITED(status) && WEXITSTATUS(status) == 2; /* usage */
}

int main(void)
{
    if (!can_start_children()) {
        printf(
            "SKIPPED test_subscribers: programs of this architecture cannot be started from an emulator\n");
        return 0;
    }
    struct fovea_error error;
    if (!(own_network_enter() && own_network_mend()) &&
        fv_transport_check(URL, 0, &error) != FOVEA_OK) {
        printf("SKIPPED test_subscribers: no network namespace of its own, and %s\n", error.text);
        return 0;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_every_message),
                                       cmocka_unit_test(test_a_signal_ends_python_in_order),
                                       cmocka_unit_test(test_every_message_in_java)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
