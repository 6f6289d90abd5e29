/* `fovea compare --live` as a whole program, in a network of the test's own: what two runs send is
 * compared by iteration, however far one of them is behind, and what one of them did not send, or
 * what is nonsense, is no equality. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/watched.h"

#include "fovea_lockstep_t.h"

enum { LEFT, RIGHT };

static struct watched watched;

/* What iteration n of a run sends; some of it is changed by a test. */
struct sent {
    int64_t iteration, stamp_ns, inputs, stages[2], messages[1];
    const char *stage; /* name of the second stage */
};

static struct sent sent_by(int64_t n)
{
    return (struct sent){n, 1000 * n, 10 + n, {20 + n, 30 + n}, {40 + n}, "odometry"};
}

static void send(int side, const struct sent *sent)
{
    static char features[] = "features", pose[] = "POSE";
    char stage[64], prefix[16], channel[32];
    uint8_t data[1024];
    snprintf(stage, sizeof stage, "%s", sent->stage);
    fovea_named_hash_t stages[] = {{features, sent->stages[0]}, {stage, sent->stages[1]}};
    fovea_named_hash_t messages[] = {{pose, sent->messages[0]}};
    const fovea_lockstep_t message = {
        .stamp = {.time_ns = sent->stamp_ns, .sequence = sent->iteration},
        .iteration = sent->iteration,
        .inputs_hash = sent->inputs,
        .state_hash = sent->stages[0] ^ sent->stages[1],
        .stage_count = 2,
        .stages = stages,
        .message_count = 1,
        .messages = messages};
    const int bytes = fovea_lockstep_t_encode(data, 0, sizeof data, &message);
    assert_true(bytes > 0);
    snprintf(prefix, sizeof prefix, "%s", side == LEFT ? "LEFT" : "RIGHT");
    snprintf(channel, sizeof channel, "%s_LOCKSTEP", prefix);
    watched_send(channel, data, (size_t)bytes);
}

static void send_both(int64_t n)
{
    const struct sent sent = sent_by(n);
    send(n % 2 == 0 ? LEFT : RIGHT, &sent);
    send(n % 2 == 0 ? RIGHT : LEFT, &sent);
}

/* Whether a program of this network is in the group of LCM. */
static bool is_heard(void)
{
    char line[256];
    bool found = false;
    FILE *groups = fopen("/proc/net/igmp", "r");
    assert_non_null(groups);
    while (fgets(line, sizeof line, groups) != NULL)
        found = found || strstr(line, "434CFFEF") != NULL;
    fclose(groups);
    return found;
}

static void start_waiting(const char *iterations, const char *timeout_s)
{
    const char *const arguments[] = {"--live",   "LEFT",      "RIGHT",   "--iterations",
                                     iterations, "--timeout", timeout_s, NULL};
    watched_start(&watched, "compare", arguments);
    for (int i = 0; i < 6000 && !is_heard(); i++)
        usleep(10000);
    assert_true(is_heard());
}

/* What is sent ends it, and no silence while this test waits for a processor. */
static void start(const char *iterations)
{
    start_waiting(iterations, "600");
}

/* The one line that it prints, without what a terminal would obey; and it ends so. */
static void end(char *text, size_t bytes, int status)
{
    assert_true(watched_line(&watched, text, bytes));
    assert_null(strchr(text, '\x1b'));
    assert_int_equal(watched_end(&watched), status);
}

static void expect(const char *words, int status)
{
    char text[1024];
    end(text, sizeof text, status);
    if (strstr(text, words) == NULL) fail_msg("found \"%s\", expected \"%s\"", text, words);
}

static void equal_runs_are_equal(void **state)
{
    (void)state;
    start("8");
    for (int64_t n = 0; n < 8; n++)
        send_both(n);
    expect("equal: 8 iterations, 8 of them", 0);
}

static void another_stamp_is_another_input(void **state)
{
    (void)state;
    start("8");
    for (int64_t n = 0; n < 5; n++)
        send_both(n);
    struct sent moved = sent_by(5);
    send(LEFT, &moved);
    moved.stamp_ns = 6000; /* a frame was dropped */
    send(RIGHT, &moved);
    expect("after 5 equal iterations: inputs: stamp.time_ns: found 6000, expected 5000", 1);
}

static void the_first_difference_is_named(void **state)
{
    static const struct {
        size_t at; /* of a number of struct sent */
        const char *words;
    } cases[] = {{offsetof(struct sent, inputs), "inputs: by their hash"},
                 {offsetof(struct sent, stages[0]), "first stage: features; first message: none"},
                 {offsetof(struct sent, stages[1]), "first stage: odometry; first message: none"},
                 {offsetof(struct sent, messages), "none that is known; first message: POSE"}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        start("8");
        send_both(0);
        struct sent other = sent_by(1);
        send(RIGHT, &other);
        int64_t number;
        memcpy(&number, (const char *)&other + cases[i].at, sizeof number);
        number++;
        memcpy((char *)&other + cases[i].at, &number, sizeof number);
        send(LEFT, &other);
        expect(cases[i].words, 1);
    }
}

static void what_one_run_did_not_send_is_said(void **state)
{
    (void)state;
    start("4");
    for (int64_t n = 0; n < 3; n++)
        send_both(n);
    for (int64_t n = 3; n < 303; n++) { /* more than wait for a partner */
        const struct sent alone = sent_by(n);
        send(LEFT, &alone);
        watched_wait_until_read();
    }
    send_both(303);
    expect("equal: 4 iterations, 4 of them with hashes of the state; 300 were not compared, since "
           "RIGHT did not send them",
           1);
}

static void silence_ends_it(void **state)
{
    (void)state;
    start_waiting("8", "1");
    expect("equal: 0 iterations", 1);
}

/* Nothing is heard of it where this test has no processor in its second: then it is tried again. */
static void a_run_that_goes_on_alone_ends_it(void **state)
{
    char text[1024] = "";
    (void)state;
    for (int tries = 0; tries < 60 && strstr(text, "since LEFT did not send them") == NULL;
         tries++) {
        start_waiting("8", "1");
        send_both(0);
        for (int64_t n = 1; !watched_readable(&watched, 20); n++) {
            const struct sent alone = sent_by(n);
            if (n > 6000) fail_msg("it does not end");
            send(RIGHT, &alone);
        }
        end(text, sizeof text, 1);
    }
    assert_non_null(strstr(text, "since LEFT did not send them"));
}

static void nonsense_is_left_and_names_are_cleaned(void **state)
{
    static const uint8_t nonsense[300] = {1, 2, 3};
    (void)state;
    start("8");
    send_both(0);
    watched_send("LEFT_LOCKSTEP", nonsense, sizeof nonsense);
    watched_send("RIGHT_LOCKSTEP", nonsense, 1);
    struct sent strange = sent_by(1);
    strange.stage = "\x1b[31mred";
    send(LEFT, &strange);
    strange.stages[1]++;
    send(RIGHT, &strange);
    expect("[31mred", 1);
}

/* ---- two real runs --------------------------------------------------------------------------- */

#define CORRIDOR "sim:corridor?width=160&height=120&frames=40&rate=10"

/* To its end, and until all that it sent was read: 40 messages, which one socket holds. */
static void run_to_its_end(const char *prefix, const char *source)
{
    static struct watched run;
    char name[64];
    snprintf(name, sizeof name, "channel_prefix=%s", prefix);
    const char *const arguments[] = {"--source",         source,      "--rate", "max",
                                     "--quiet",          "--picture", "none",   "--set",
                                     "lockstep_every=1", "--set",     name,     NULL};
    watched_start(&run, "run", arguments);
    assert_int_equal(watched_end(&run), 0);
    watched_wait_until_read();
}

static void a_run_that_is_behind_has_sent_what_it_has(void **state)
{
    (void)state;
    start("12");
    run_to_its_end("RIGHT", CORRIDOR);
    run_to_its_end("LEFT", CORRIDOR);
    expect("equal: 12 iterations, 12 of them with hashes of the state\n", 0);
}

static void a_run_far_behind_is_compared_from_its_start(void **state)
{
    (void)state;
    start("40");
    run_to_its_end("LEFT", CORRIDOR);
    run_to_its_end("RIGHT", "fault:" CORRIDOR "?kind=noise&first=10&count=1&shortest=3&longest=3");
    expect("at frame 10 (iteration 10, stamp 1000000000 ns), after 10 equal iterations: inputs: "
           "by their hash\n",
           1);
}

/* What LEFT sent before it was heard may be where they became different. */
static void what_was_not_heard_is_no_first_difference(void **state)
{
    (void)state;
    start("40");
    for (int64_t n = 50; n < 53; n++)
        send_both(n);
    struct sent other = sent_by(60);
    send(LEFT, &other);
    other.stages[1]++;
    send(RIGHT, &other);
    expect("after 3 equal iterations; iterations 53 to 59 were not seen of both, so what differed "
           "first is not known; at this one: equal inputs; stage: odometry; message: none\n",
           1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equal_runs_are_equal),
        cmocka_unit_test(another_stamp_is_another_input),
        cmocka_unit_test(the_first_difference_is_named),
        cmocka_unit_test(what_one_run_did_not_send_is_said),
        cmocka_unit_test(silence_ends_it),
        cmocka_unit_test(a_run_that_goes_on_alone_ends_it),
        cmocka_unit_test(a_run_that_is_behind_has_sent_what_it_has),
        cmocka_unit_test(a_run_far_behind_is_compared_from_its_start),
        cmocka_unit_test(what_was_not_heard_is_no_first_difference),
        cmocka_unit_test(nonsense_is_left_and_names_are_cleaned),
    };
    if (!watched_possible("test_compare_live")) return 0;
    return cmocka_run_group_tests_name("transport/test_compare_live", tests, NULL, NULL);
}
