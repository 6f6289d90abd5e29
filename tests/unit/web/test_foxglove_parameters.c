/* Parameters of a client of Foxglove's protocol, with answers of a run that the test gives: values
 * are the run's, only its own answer ends a request, and silence is said. */
#include "common/foxglove_case.h"

#include "fovea_parameter_result_t.h"

#define COUNT "features.threshold"
#define REAL "scale.wheel_odometry_max_m_s"

static struct fv_web_commander commander;

static void answered(void *context, const struct fv_foxglove_answer *answer)
{
    (void)context;
    fv_foxglove_answered(&client, answer);
}

static int begin_run(void **state)
{
    struct fovea_error error;
    if (begin(state) != 0 || fv_web_commander_open(&commander, "memq://", NULL, &error) != FOVEA_OK)
        return -1;
    parameters.commander = &commander;
    parameters.run_id = 5;
    parameters.answered = answered;
    memcpy(parameters.prefix, "R", 2);
    drain(); /* what comes at the start */
    return 0;
}

static int end_run(void **state)
{
    fv_web_commander_close(&commander);
    return end(state);
}

/* What the run says of a key, to the request of this number and sender. */
static void result(int64_t id, int64_t sender, const char *key, const char *value, int result,
                   const char *reason)
{
    const fovea_parameter_result_t message = {.id = id,
                                              .sender = sender,
                                              .key = (char *)(uintptr_t)key,
                                              .value = (char *)(uintptr_t)value,
                                              .result = (int8_t)result,
                                              .reason = (char *)(uintptr_t)reason};
    length = fovea_parameter_result_t_encode(encoded, 0, sizeof encoded, &message);
    assert_true(length > 0);
    fv_foxglove_parameters_take(&parameters, "PARAMETER_RESULT", encoded, (size_t)length);
}

static void done(const char *key, const char *value)
{
    result(commander.id, FV_WEB_SENDER, key, value, FOVEA_PARAMETER_RESULT_T_RESULT_DONE, "");
}

static void a_value_is_what_the_run_answers(void **state)
{
    (void)state;
    say("{\"op\":\"getParameters\",\"parameterNames\":[\"" COUNT "\",\"" REAL
        "\"],\"id\":\"one\"}");
    assert_false(next());
    fv_foxglove_parameters_tick(&parameters, now_ns);
    assert_true(commander.id > 0);
    const int64_t last = commander.id; /* both were asked for, in the order of the keys */
    result(last - 1, FV_WEB_SENDER, COUNT, "20", FOVEA_PARAMETER_RESULT_T_RESULT_DONE, "");
    assert_false(next());
    done(REAL, "2.5");
    until("\"op\":\"parameterValues\"");
    assert_non_null(strstr((char *)packet, "\"id\":\"one\""));
    assert_non_null(strstr((char *)packet, "{\"name\":\"" COUNT "\",\"value\":20}"));
    assert_non_null(strstr((char *)packet, "\"value\":2.5,\"type\":\"float64\"}"));
    assert_false(next());
}

static void only_its_own_answer_ends_a_change(void **state)
{
    (void)state;
    say("{\"op\":\"setParameters\",\"parameters\":[{\"name\":\"" COUNT
        "\",\"value\":33}],\"id\":\"set\"}");
    const int64_t id = commander.id;
    result(id - 1, FV_WEB_SENDER, COUNT, "31", FOVEA_PARAMETER_RESULT_T_RESULT_DONE, "");
    result(id, FV_WEB_SENDER + 1, COUNT, "32", FOVEA_PARAMETER_RESULT_T_RESULT_DONE, "");
    assert_false(next());
    done(COUNT, "33");
    until("\"id\":\"set\"");
    assert_non_null(strstr((char *)packet, "\"value\":33"));
    assert_false(next());
}

static void a_refusal_has_its_level_and_names_the_key_once(void **state)
{
    const char *words = "{\"op\":\"setParameters\",\"parameters\":[{\"name\":\"" COUNT
                        "\",\"value\":33}],\"id\":\"set\"}";
    (void)state;
    say(words);
    result(commander.id, FV_WEB_SENDER, COUNT, "20", FOVEA_PARAMETER_RESULT_T_RESULT_REFUSED,
           COUNT ": too large");
    until("\"level\":2,\"message\":\"" COUNT ": too large\"");
    until("\"value\":20");
    say(words);
    result(commander.id, FV_WEB_SENDER, COUNT, "20", FOVEA_PARAMETER_RESULT_T_RESULT_NEEDS_RESTART,
           "needs a restart");
    until("\"level\":1,\"message\":\"" COUNT ": needs a restart\"");
}

static void silence_is_said(void **state)
{
    (void)state;
    say("{\"op\":\"setParameters\",\"parameters\":[{\"name\":\"" COUNT
        "\",\"value\":33}],\"id\":\"set\"}");
    now_ns += FV_FOXGLOVE_PATIENCE_S * SECOND - 1;
    assert_false(next());
    now_ns++;
    until("\"id\":\"set\"");
    until("\"level\":2,\"message\":\"" COUNT ": the run has not answered\"");
    say("{\"op\":\"getParameters\",\"parameterNames\":[\"" COUNT "\"],\"id\":\"get\"}");
    fv_foxglove_parameters_tick(&parameters, now_ns);
    fv_foxglove_parameters_tick(&parameters, now_ns + FV_FOXGLOVE_PATIENCE_S * SECOND);
    assert_false(next());
    fv_foxglove_parameters_tick(&parameters, now_ns + FV_FOXGLOVE_PATIENCE_S * SECOND + 1);
    until("\"level\":2,\"message\":\"" COUNT ": the run has not answered for 10 s\"");
    until("\"parameters\":[]");
}

static void a_new_run_is_asked_at_once(void **state)
{
    (void)state;
    say("{\"op\":\"getParameters\",\"parameterNames\":[\"" COUNT "\"],\"id\":\"get\"}");
    fv_foxglove_parameters_tick(&parameters, now_ns);
    const int64_t first = commander.id;
    fv_foxglove_parameters_tick(&parameters, now_ns);
    assert_int_equal(commander.id, first);
    parameters.run_id++;
    fv_foxglove_parameters_tick(&parameters, now_ns);
    const int64_t second = commander.id;
    assert_true(second > first);
    done(COUNT, "20");
    until("\"value\":20");
    fv_foxglove_parameters_tick(&parameters, now_ns + FV_FOXGLOVE_PATIENCE_S * SECOND + 1);
    assert_int_equal(commander.id, second);
    assert_false(next());
}

static void who_watches_a_key_gets_its_changes(void **state)
{
    (void)state;
    say("{\"op\":\"subscribeParameterUpdates\",\"parameterNames\":[\"" COUNT "\"]}");
    result(1, FV_WEB_SENDER + 1, COUNT, "40", FOVEA_PARAMETER_RESULT_T_RESULT_DONE, "");
    until("\"value\":40");
    assert_null(strstr((char *)packet, "\"id\""));
    result(2, FV_WEB_SENDER + 1, COUNT, "40", FOVEA_PARAMETER_RESULT_T_RESULT_DONE, "");
    assert_false(next()); /* it is the same */
    say("{\"op\":\"unsubscribeParameterUpdates\",\"parameterNames\":[\"" COUNT "\"]}");
    result(3, FV_WEB_SENDER + 1, COUNT, "41", FOVEA_PARAMETER_RESULT_T_RESULT_DONE, "");
    assert_false(next());
}

/* Keys whose values the run was asked for, and has not answered. */
static int asked_count(void)
{
    int count = 0;
    for (int i = 0; i < FV_FOXGLOVE_ASKED_MAX; i++)
        count += parameters.asked[i].id != 0;
    return count;
}

static void known_values_are_asked_for_again_when_settings_were_restored(void **state)
{
    (void)state;
    result(1, FV_WEB_SENDER + 1, COUNT, "40", FOVEA_PARAMETER_RESULT_T_RESULT_DONE, "");
    fv_foxglove_parameters_tick(&parameters, now_ns);
    assert_int_equal(asked_count(), 0);
    fv_foxglove_parameters_take(&parameters, "SETTINGS_RESULT", encoded, 0);
    fv_foxglove_parameters_tick(&parameters, now_ns);
    assert_int_equal(asked_count(), 1); /* no key that is not known */
    done(COUNT, "40");
    fv_foxglove_parameters_tick(&parameters, now_ns);
    assert_int_equal(asked_count(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_value_is_what_the_run_answers, begin_run, end_run),
        cmocka_unit_test_setup_teardown(only_its_own_answer_ends_a_change, begin_run, end_run),
        cmocka_unit_test_setup_teardown(a_refusal_has_its_level_and_names_the_key_once, begin_run,
                                        end_run),
        cmocka_unit_test_setup_teardown(a_new_run_is_asked_at_once, begin_run, end_run),
        cmocka_unit_test_setup_teardown(silence_is_said, begin_run, end_run),
        cmocka_unit_test_setup_teardown(who_watches_a_key_gets_its_changes, begin_run, end_run),
        cmocka_unit_test_setup_teardown(
            known_values_are_asked_for_again_when_settings_were_restored, begin_run, end_run),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
