/* Who sends: the message, taking it from a recording, and noticing another sender. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>
#include <unistd.h>

#include "app/network/identity.h"

#include "fovea_run_t.h"

static int setup(void **state)
{
    (void)state;
    fv_message_prepare();
    return 0;
}

static void a_message_names_run_process_and_version(void **state)
{
    (void)state;
    struct fv_identity made;
    fovea_run_t message;
    fv_identity_make(&made, "ROBOT", -5);
    assert_int_equal(made.run_id, -5);
    assert_string_equal(made.channel, "ROBOT_RUN");
    assert_true(fovea_run_t_decode(made.data, 0, (int)made.bytes, &message) > 0);
    assert_int_equal(message.run_id, -5);
    assert_int_equal(message.process, getpid());
    assert_string_equal(message.prefix, "ROBOT");
    assert_string_equal(message.version, FOVEA_VERSION);
    assert_true(strlen(message.host) > 0 && message.utime > 0);
    fovea_run_t_decode_cleanup(&message);
}

static void a_recorded_one_is_taken_as_it_is(void **state)
{
    (void)state;
    struct fv_identity made, read;
    fv_identity_make(&made, "ROBOT", 77);
    assert_true(fv_identity_read(&read, made.data, made.bytes));
    assert_memory_equal(&read, &made, sizeof read);
    for (uint32_t bytes = 0; bytes < made.bytes; bytes++) {
        assert_false(fv_identity_read(&read, made.data, bytes));
        assert_int_equal(read.run_id, 0);
    }
    made.data[0] ^= 1;
    assert_false(fv_identity_read(&read, made.data, made.bytes));
}

static void hear(const struct fv_receiver_channel *row, int64_t run_id)
{
    struct fv_identity other;
    fv_identity_make(&other, "ROBOT", run_id);
    const struct fv_received received = {
        .channel = other.channel, .data = other.data, .bytes = other.bytes};
    row->take(row->context, &received);
}

static void another_sender_is_noticed_once(void **state)
{
    (void)state;
    struct fv_identity_watch watch = {.own = 1};
    const struct fv_receiver_channel row = fv_identity_row("ROBOT", &watch);
    assert_string_equal(row.name, "ROBOT_RUN");
    assert_string_equal(row.type, "fovea.run_t");
    hear(&row, 1);
    assert_int_equal(watch.others, 0);
    hear(&row, 2);
    hear(&row, 2);
    assert_int_equal(watch.others, 1);
    for (int64_t id = 3; id < 100; id++)
        hear(&row, id);
    assert_int_equal(watch.others, FV_IDENTITIES_KNOWN);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_message_names_run_process_and_version),
        cmocka_unit_test(a_recorded_one_is_taken_as_it_is),
        cmocka_unit_test(another_sender_is_noticed_once),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
