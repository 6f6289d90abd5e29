/* Velocity commands from outside: what is well-formed and allowed reaches the source, the rest is
 * counted; with a key only what was made with it, once. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "app/network/siphash.h"
#include "app/run/velocity_input.h"

#include "fovea_velocity_command_t.h"

enum { RUN = 77 };

static struct fv_requests requests;
static struct fv_velocity_input input;
static struct fovea_velocity_command driven;
static int drives;
static enum fovea_status answer;

static enum fovea_status take(struct fovea_source *source,
                              const struct fovea_velocity_command *command,
                              struct fovea_error *error)
{
    (void)source;
    driven = *command;
    drives++;
    return answer == FOVEA_OK ? FOVEA_OK : fovea_error_set(error, answer, "no");
}

static const struct fovea_source_ops ops = {.name = "fake", .drive = take},
                                     still_ops = {.name = "still"};
static int some_source;

static void open_input(const struct fovea_source_ops *of, uint32_t from_network, bool keyed)
{
    struct fovea_error error;
    const struct fv_command_rules rules = {
        .from_network = from_network, .keyed = keyed, .key = {1, 2, 3}, .run_id = RUN};
    assert_int_equal(fv_requests_open(&requests, &rules, &error), FOVEA_OK);
    fv_velocity_input_open(&input, &requests, of, (struct fovea_source *)(void *)&some_source,
                           "ROBOT");
    drives = 0;
    answer = FOVEA_OK;
}

static void send(const fovea_velocity_command_t *message, bool with_key, bool from_host, int cut)
{
    uint8_t data[256];
    fovea_velocity_command_t made = *message;
    const struct fv_receiver_channel row = fv_velocity_input_row(&input);
    int bytes = fovea_velocity_command_t_encode(data, 0, sizeof data, &made);
    if (with_key) {
        made.mac = (int64_t)fv_siphash((const uint8_t[FV_SIPHASH_KEY_BYTES]){1, 2, 3}, data,
                                       (size_t)bytes, 0);
        bytes = fovea_velocity_command_t_encode(data, 0, sizeof data, &made);
    }
    assert_true(bytes > 0 && bytes <= (int)row.bytes_max);
    row.take(row.context, &(struct fv_received){.data = data,
                                                .bytes = (uint32_t)(bytes - cut),
                                                .from_host = from_host});
}

static const fovea_velocity_command_t ahead = {
    .sequence = 12, .velocity_m_s = {0.4, 0, 0}, .angular_rate = {0, 0, -0.5}};

static void expect_counts(uint64_t taken, uint64_t refused, uint64_t malformed, uint64_t busy)
{
    assert_int_equal(atomic_load(&input.taken), taken);
    assert_int_equal(atomic_load(&input.refused), refused);
    assert_int_equal(atomic_load(&input.malformed), malformed);
    assert_int_equal(atomic_load(&input.busy), busy);
    fv_requests_close(&requests);
}

static void commands_of_this_host_reach_the_source(void **state)
{
    (void)state;
    open_input(&ops, 0, false);
    assert_string_equal(fv_velocity_input_row(&input).name, "ROBOT_VELOCITY_COMMAND");
    assert_false(fv_velocity_input_drives(&input));
    send(&ahead, false, true, 0);
    assert_int_equal(drives, 1);
    assert_true(fv_velocity_input_drives(&input));
    assert_true(driven.sequence == 12 && driven.velocity_m_s[0] == 0.4 &&
                driven.angular_rate[2] == -0.5);
    answer = FOVEA_AGAIN;
    send(&ahead, false, true, 0);
    fv_velocity_input_end(&input); /* the source is no more */
    send(&ahead, false, true, 0);
    assert_int_equal(drives, 2);
    expect_counts(1, 0, 0, 1);
}

static void what_is_not_a_motion_is_malformed(void **state)
{
    (void)state;
    open_input(&ops, 0, false);
    fovea_velocity_command_t wrong = ahead;
    wrong.velocity_m_s[1] = NAN;
    send(&wrong, false, true, 0);
    wrong = ahead;
    wrong.angular_rate[0] = 1e3;
    send(&wrong, false, true, 0);
    send(&ahead, false, true, 3);
    assert_int_equal(drives, 0);
    assert_false(fv_velocity_input_drives(&input));
    expect_counts(0, 0, 3, 0);
}

static void the_network_drives_only_where_it_is_allowed_to(void **state)
{
    (void)state;
    open_input(&ops, FV_COMMAND_ALL, false); /* all others */
    send(&ahead, false, false, 0);
    assert_int_equal(drives, 0);
    assert_true(input.said);
    expect_counts(0, 1, 0, 0);
    open_input(&ops, FV_COMMAND_VELOCITY, false);
    send(&ahead, false, false, 0);
    assert_int_equal(drives, 1);
    expect_counts(1, 0, 0, 0);
}

static void with_a_key_each_command_counts_once(void **state)
{
    fovea_velocity_command_t message = ahead;
    (void)state;
    open_input(&ops, FV_COMMAND_AUTO, true);
    assert_false(input.said);
    send(&message, false, true, 0); /* no code */
    assert_true(input.said);
    message.counter = 5;
    send(&message, true, true, 0); /* for no run */
    message.run_id = RUN;
    send(&message, true, false, 0);
    send(&message, true, false, 0); /* again */
    assert_int_equal(drives, 1);
    expect_counts(1, 3, 0, 0);
}

static void a_source_that_cannot_be_driven_refuses_by_name(void **state)
{
    (void)state;
    open_input(&still_ops, 0, false);
    send(&ahead, false, true, 0);
    send(&ahead, false, true, 0);
    assert_true(input.said);
    expect_counts(0, 2, 0, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(commands_of_this_host_reach_the_source),
        cmocka_unit_test(what_is_not_a_motion_is_malformed),
        cmocka_unit_test(the_network_drives_only_where_it_is_allowed_to),
        cmocka_unit_test(with_a_key_each_command_counts_once),
        cmocka_unit_test(a_source_that_cannot_be_driven_refuses_by_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
