/* Commands: whom which are taken from, and that with a key nothing recorded or repeated is taken.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "app/network/command_gate.h"
#include "message/message.h"

#include "fovea_command_t.h"

enum { RUN = 77 };

static const uint8_t key[FV_SIPHASH_KEY_BYTES] = "sixteen letters.";

static size_t encode(const fovea_command_t *command, uint8_t data[128])
{
    const int bytes = fovea_command_t_encode(data, 0, 128, command);
    assert_true(bytes > 0);
    return (size_t)bytes;
}

/* With the right code. */
static size_t sign(fovea_command_t command, const uint8_t with[FV_SIPHASH_KEY_BYTES],
                   uint8_t data[128])
{
    command.mac = 0;
    size_t bytes = encode(&command, data);
    command.mac = (int64_t)fv_siphash(with, data, bytes, 0);
    return encode(&command, data);
}

static enum fv_command_verdict judge(struct fv_command_gate *gate, const uint8_t *data,
                                     size_t bytes, bool from_host, double at_s)
{
    struct fv_judged_command command = {.bits = 99};
    const enum fv_command_verdict verdict =
        fv_command_gate_judge(gate, data, bytes, from_host, (int64_t)(at_s * 1e9), &command);
    assert_int_equal(command.verdict, verdict);
    if (verdict != FV_COMMAND_TAKEN) assert_int_equal(command.bits, 0);
    return verdict;
}

static enum fv_command_verdict plain(struct fv_command_gate *gate, int32_t bits, bool from_host)
{
    uint8_t data[128];
    const fovea_command_t command = {.commands = bits};
    return judge(gate, data, encode(&command, data), from_host, 0);
}

static void test_without_key_this_host_may_all_and_the_network_what_is_allowed(void **state)
{
    struct fv_command_gate gate;
    const struct fv_command_rules none = {.from_network = FV_COMMAND_AUTO, .run_id = RUN};
    const struct fv_command_rules some = {.from_network = 1 | 4, .run_id = RUN};
    (void)state;
    fv_command_gate_init(&gate, &none);
    for (int32_t bits = 1; bits <= 8; bits *= 2) {
        assert_int_equal(plain(&gate, bits, true), FV_COMMAND_TAKEN);
        assert_int_equal(plain(&gate, bits, false), FV_COMMAND_FORBIDDEN);
    }
    fv_command_gate_init(&gate, &some);
    assert_int_equal(plain(&gate, 1, false), FV_COMMAND_TAKEN);
    assert_int_equal(plain(&gate, 5, false), FV_COMMAND_TAKEN);
    assert_int_equal(plain(&gate, 3, false), FV_COMMAND_FORBIDDEN);
    assert_int_equal(plain(&gate, 8 | 16, false), FV_COMMAND_FORBIDDEN);
    assert_int_equal(plain(&gate, 8 | 16, true), FV_COMMAND_TAKEN);
    assert_int_equal(plain(&gate, 0, true), FV_COMMAND_UNKNOWN);
    assert_int_equal(plain(&gate, 16, true), FV_COMMAND_UNKNOWN); /* nothing to overwrite with */
    assert_int_equal(plain(&gate, 1 | 32, true), FV_COMMAND_UNKNOWN); /* not alone */
    assert_int_equal(plain(&gate, 32 | 64, true), FV_COMMAND_UNKNOWN);
    assert_int_equal(plain(&gate, 128, true), FV_COMMAND_UNKNOWN);
    assert_int_equal(plain(&gate, 64, true), FV_COMMAND_TAKEN);
    assert_int_equal(plain(&gate, INT32_MIN | 1, true), FV_COMMAND_UNKNOWN);
    assert_int_equal(judge(&gate, (const uint8_t *)"abc", 3, true, 0), FV_COMMAND_MALFORMED);
    assert_int_equal(gate.counts[FV_COMMAND_UNKNOWN], 6);
    assert_int_equal(gate.counts[FV_COMMAND_FORBIDDEN], 2);
    assert_int_equal(gate.counts[FV_COMMAND_MALFORMED], 1);
}

static void test_without_key_another_run_is_refused_when_named(void **state)
{
    struct fv_command_gate gate;
    uint8_t data[128];
    const struct fv_command_rules rules = {.run_id = RUN};
    (void)state;
    fv_command_gate_init(&gate, &rules);
    fovea_command_t command = {.commands = 1, .run_id = RUN};
    assert_int_equal(judge(&gate, data, encode(&command, data), true, 0), FV_COMMAND_TAKEN);
    command.run_id = RUN + 1;
    assert_int_equal(judge(&gate, data, encode(&command, data), true, 0), FV_COMMAND_OTHER_RUN);
}

static void test_with_key_only_genuine_and_new_commands_are_taken(void **state)
{
    struct fv_command_gate gate;
    uint8_t data[128], wrong_key[FV_SIPHASH_KEY_BYTES] = "sixteen letters?";
    const struct fv_command_rules rules = {
        .from_network = FV_COMMAND_AUTO, .keyed = true, .key = "sixteen letters.", .run_id = RUN};
    fovea_command_t command = {.commands = 2, .run_id = RUN, .sender = 5, .counter = 10};
    (void)state;
    fv_command_gate_init(&gate, &rules);
    assert_int_equal(plain(&gate, 2, true), FV_COMMAND_FORGED); /* from this host too */
    size_t bytes = sign(command, wrong_key, data);
    assert_int_equal(judge(&gate, data, bytes, false, 0), FV_COMMAND_FORGED);
    bytes = sign(command, key, data);
    for (size_t i = 8; i < bytes; i++) { /* each byte of it matters */
        data[i] ^= 4;
        assert_int_not_equal(judge(&gate, data, bytes, false, 0), FV_COMMAND_TAKEN);
        data[i] ^= 4;
    }
    assert_int_equal(judge(&gate, data, bytes, false, 0), FV_COMMAND_TAKEN);
    assert_int_equal(judge(&gate, data, bytes, false, 0), FV_COMMAND_REPEATED);
    command.counter = 9;
    assert_int_equal(judge(&gate, data, sign(command, key, data), true, 0), FV_COMMAND_REPEATED);
    command.counter = 11;
    assert_int_equal(judge(&gate, data, sign(command, key, data), true, 0), FV_COMMAND_TAKEN);
    command.sender = 6;
    command.counter = 0;
    assert_int_equal(judge(&gate, data, sign(command, key, data), true, 0), FV_COMMAND_REPEATED);
    command.counter = 1;
    assert_int_equal(judge(&gate, data, sign(command, key, data), true, 0), FV_COMMAND_TAKEN);
    command.run_id = 0; /* any run: not with a key */
    command.counter = 12;
    assert_int_equal(judge(&gate, data, sign(command, key, data), true, 0), FV_COMMAND_OTHER_RUN);
}

static void test_a_recording_is_worthless_after_a_restart(void **state)
{
    struct fv_command_gate gate;
    uint8_t data[128];
    struct fv_command_rules rules = {.keyed = true, .key = "sixteen letters.", .run_id = RUN};
    const fovea_command_t command = {.commands = 1, .run_id = RUN, .sender = 1, .counter = 1};
    (void)state;
    const size_t bytes = sign(command, key, data);
    fv_command_gate_init(&gate, &rules);
    assert_int_equal(judge(&gate, data, bytes, true, 0), FV_COMMAND_TAKEN);
    rules.run_id = RUN + 1;
    fv_command_gate_init(&gate, &rules);
    assert_int_equal(judge(&gate, data, bytes, true, 0), FV_COMMAND_OTHER_RUN);
}

static void test_the_table_of_senders_is_bounded_and_forgets_none(void **state)
{
    struct fv_command_gate gate;
    uint8_t data[128], first[128];
    const struct fv_command_rules rules = {.keyed = true, .key = "sixteen letters.", .run_id = RUN};
    fovea_command_t command = {.commands = 2, .run_id = RUN, .counter = 3};
    size_t first_bytes = 0;
    (void)state;
    fv_command_gate_init(&gate, &rules);
    for (int i = 0; i < FV_COMMAND_SENDERS_MAX + 5; i++) {
        command.sender = i;
        const size_t bytes = sign(command, key, data);
        if (i == 0) memcpy(first, data, first_bytes = bytes);
        assert_int_equal(judge(&gate, data, bytes, true, 0),
                         i < FV_COMMAND_SENDERS_MAX ? FV_COMMAND_TAKEN : FV_COMMAND_SENDERS);
    }
    assert_int_equal(judge(&gate, first, first_bytes, true, 0), FV_COMMAND_REPEATED);
}

static void test_saves_are_limited(void **state)
{
    struct fv_command_gate gate;
    uint8_t data[128];
    const struct fv_command_rules rules = {.run_id = RUN};
    const fovea_command_t command = {.commands = 8 | 1}, reset = {.commands = 1};
    int taken = 0;
    (void)state;
    fv_command_gate_init(&gate, &rules);
    for (int i = 0; i < 100000; i++) /* ten seconds of a flood */
        taken +=
            judge(&gate, data, encode(&command, data), true, 10 + i * 1e-4) == FV_COMMAND_TAKEN;
    assert_int_equal(taken, 2);
    assert_int_equal(gate.counts[FV_COMMAND_TOO_OFTEN], 99998);
    assert_int_equal(judge(&gate, data, encode(&reset, data), true, 20), FV_COMMAND_TAKEN);
    assert_int_equal(judge(&gate, data, encode(&command, data), true, 20.1), FV_COMMAND_TAKEN);
}

/* Ten in a second, whoever asks; never a message that is no command, nor one that was taken. */
static void refused_commands_are_answered_at_a_limited_rate(void **state)
{
    struct fv_command_gate gate;
    struct fv_judged_command command;
    uint8_t data[128];
    const struct fv_command_rules rules = {.run_id = RUN};
    const fovea_command_t wrong = {.commands = 512, .id = 5, .sender = 6}, right = {.commands = 1};
    int answered = 0;
    (void)state;
    fv_command_gate_init(&gate, &rules);
    fv_command_gate_judge(&gate, data, encode(&wrong, data), true, 0, &command);
    assert_true(command.id == 5 && command.sender == 6 && command.commands == 512);
    for (int i = 0; i < 25000; i++)
        answered += fv_command_gate_answers(&gate, &command, (int64_t)i * 100000);
    assert_int_equal(answered, 30); /* 2.5 seconds */
    fv_command_gate_judge(&gate, data, encode(&right, data), true, 0, &command);
    assert_false(fv_command_gate_answers(&gate, &command, INT64_C(9000000000)));
    fv_command_gate_judge(&gate, data, 5, true, 0, &command);
    assert_false(fv_command_gate_answers(&gate, &command, INT64_C(9000000000)));
    for (int i = FV_COMMAND_TAKEN + 1; i < FV_COMMAND_VERDICTS; i++) {
        const size_t bytes = strlen(fv_command_verdict_reason((enum fv_command_verdict)i));
        assert_true(bytes > 0 && bytes <= 255);
    }
}

static void write_key(const char *path, const char *text, mode_t mode)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
    assert_int_equal(chmod(path, mode), 0);
}

static void test_a_key_is_read_from_a_private_file_only(void **state)
{
    char folder[] = "/tmp/fovea-key-XXXXXX", path[64], command[600];
    uint8_t read[FV_SIPHASH_KEY_BYTES];
    struct fovea_error error;
    (void)state;
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/key", folder);
    assert_int_equal(fv_command_key_read(path, read, &error), FOVEA_ERROR_INPUT);
    /* The very command that users are given makes one. */
    const char *advice = strstr(error.text, "to make a key: ");
    assert_non_null(advice);
    snprintf(command, sizeof command, "%s", advice + strlen("to make a key: "));
    assert_int_equal(system(command), 0);
    assert_int_equal(fv_command_key_read(path, read, &error), FOVEA_OK);
    write_key(path, "000102030405060708090a0B0c0d0eFf\n", 0600);
    assert_int_equal(fv_command_key_read(path, read, &error), FOVEA_OK);
    assert_int_equal(read[1], 1);
    assert_int_equal(read[11], 11);
    assert_int_equal(read[15], 255);
    write_key(path, "000102030405060708090a0B0c0d0eFf\n", 0640);
    assert_int_equal(fv_command_key_read(path, read, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "chmod 600"));
    const char *const wrong[] = {"", "00010203", "000102030405060708090a0b0c0d0eg0",
                                 "000102030405060708090a0b0c0d0e0f00",
                                 "000102030405060708090a0b0c0d0e0f x"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        write_key(path, wrong[i], 0600);
        assert_int_equal(fv_command_key_read(path, read, &error), FOVEA_ERROR_INPUT);
        assert_non_null(strstr(error.text, path));
    }
    unlink(path);
    assert_int_equal(mkfifo(path, 0600), 0); /* does not hang */
    assert_int_equal(fv_command_key_read(path, read, &error), FOVEA_ERROR_INPUT);
    unlink(path);
    assert_int_equal(fv_command_key_read(folder, read, &error), FOVEA_ERROR_INPUT);
    rmdir(folder);
}

int main(void)
{
    fv_message_prepare();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_without_key_this_host_may_all_and_the_network_what_is_allowed),
        cmocka_unit_test(test_without_key_another_run_is_refused_when_named),
        cmocka_unit_test(test_with_key_only_genuine_and_new_commands_are_taken),
        cmocka_unit_test(test_a_recording_is_worthless_after_a_restart),
        cmocka_unit_test(test_the_table_of_senders_is_bounded_and_forgets_none),
        cmocka_unit_test(test_saves_are_limited),
        cmocka_unit_test(refused_commands_are_answered_at_a_limited_rate),
        cmocka_unit_test(test_a_key_is_read_from_a_private_file_only),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
