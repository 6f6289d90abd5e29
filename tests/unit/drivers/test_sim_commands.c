/* The simulated robot driven by velocity commands: each frame waits for the answer to the one
 * before, the same commands give the same frames, and what was taken comes out as samples. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../../../drivers/clock.h"
#include "common/sim_source.h"

static const struct fovea_source_ops *const ops = &fv_source_sim;
static struct fovea_error error;

#define DRIVE "drive?seed=5&width=96&height=64&wheel_odometry=0&commands=1"

static enum fovea_status drive(struct fovea_source *source, int64_t sequence, double speed,
                               double turning)
{
    const struct fovea_velocity_command command = {
        .sequence = sequence, .velocity_m_s = {speed, 0, 0}, .angular_rate = {0, 0, turning}};
    return ops->drive(source, &command, &error);
}

static uint64_t hash_of(const struct fovea_image *image, uint64_t hash)
{
    for (size_t i = 0; i < image->size_bytes; i++)
        hash = (hash ^ image->data[i]) * 0x100000001B3u;
    return hash;
}

/* Drives `frames` frames along a bend; T: of the last frame. */
static uint64_t hash_of_drive(double turning, int frames, double T[12])
{
    struct fovea_source *source = sim_source_open(DRIVE, NULL);
    struct fovea_frame frame;
    uint64_t hash = 1;
    for (int n = 0; n < frames; n++) {
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        hash = hash_of(&frame.images[0], hash);
        assert_int_equal(ops->truth_pose(source, &frame, T), FOVEA_OK);
        ops->requeue(source, &frame);
        assert_int_equal(drive(source, (int64_t)frame.sequence, 0.2, turning), FOVEA_OK);
    }
    sim_source_close(source);
    return hash;
}

static void the_same_commands_give_the_same_frames(void **state)
{
    double T[12], left[12], right[12];
    (void)state;
    const uint64_t hash = hash_of_drive(0.5, 40, T);
    assert_true(hash == hash_of_drive(0.5, 40, left));
    assert_memory_equal(T, left, sizeof T);
    assert_true(hash != hash_of_drive(-0.5, 40, right));
    /* Forward is the third column: to the left of the other's. */
    assert_true(right[2] * left[6] - right[6] * left[2] > 0.8);
}

static void a_frame_waits_for_the_answer_to_the_one_before(void **state)
{
    struct fovea_source *source = sim_source_open(DRIVE, NULL);
    struct fovea_frame frame;
    (void)state;
    assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_OK);
    ops->requeue(source, &frame);
    assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_AGAIN);
    assert_int_equal(drive(source, 7, 0.2, 0), FOVEA_OK); /* for another frame: dropped */
    assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_AGAIN);
    assert_int_equal(drive(source, 0, 0.2, 0), FOVEA_OK);
    assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_OK);
    assert_int_equal(frame.sequence, 1);
    ops->requeue(source, &frame);
    assert_int_equal(drive(source, -1, 0.2, 0), FOVEA_OK); /* for whichever it is */
    assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_OK);
    assert_int_equal(frame.sequence, 2);
    sim_source_close(source);
}

/* After its patience without an answer the source gives up, and says which frame had none. */
static void a_source_that_gets_no_answer_fails_with_its_reason(void **state)
{
    struct fovea_source *source = sim_source_open(DRIVE, NULL);
    struct fovea_frame frame;
    (void)state;
    assert_true(source->commands.patience_s == 20);
    assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_OK);
    ops->requeue(source, &frame);
    assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_AGAIN);
    assert_int_equal(ops->complaint(source, &error), FOVEA_OK);
    assert_non_null(strstr(error.text, "the goal is "));
    assert_int_equal(ops->complaint(source, &error), FOVEA_AGAIN);
    assert_int_equal(ops->failure(source, &error), FOVEA_AGAIN);
    source->commands.waits_since_ns -= INT64_C(20000000000);
    assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_ERROR_INPUT);
    assert_int_equal(ops->complaint(source, &error), FOVEA_AGAIN);
    assert_int_equal(ops->failure(source, &error), FOVEA_OK);
    assert_string_equal(
        error.text,
        "found no velocity_command_t with sequence 0 for 20 s, expected an answer to each frame");
    sim_source_close(source);
    /* Answers to other frames are named. */
    source = sim_source_open(DRIVE, NULL);
    assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_OK);
    ops->requeue(source, &frame);
    assert_int_equal(drive(source, 7, 0.2, 0), FOVEA_OK);
    assert_int_equal(drive(source, 5, 0.2, 0), FOVEA_OK);
    assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_AGAIN);
    source->commands.waits_since_ns -= INT64_C(20000000000);
    assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_ERROR_INPUT);
    assert_int_equal(ops->failure(source, &error), FOVEA_OK);
    assert_non_null(strstr(error.text, "for 20 s (2 came, the last with 5), expected"));
    sim_source_close(source);
}

static void it_moves_as_it_is_asked_to_and_tells_what_it_took(void **state)
{
    struct fovea_source *source = sim_source_open(DRIVE, NULL);
    struct fovea_sample samples[FOVEA_INPUT_SAMPLES_MAX];
    struct fovea_frame frame;
    double first[12], T[12];
    int64_t stamp_ns = 0;
    (void)state;
    for (int n = 0; n < 60; n++) {
        assert_int_equal(ops->dequeue(source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(ops->truth_pose(source, &frame, n == 0 ? first : T), FOVEA_OK);
        const uint32_t count = ops->samples(source, &frame, samples, FOVEA_INPUT_SAMPLES_MAX);
        assert_int_equal(count, n > 0);
        if (n > 0) {
            assert_int_equal(samples[0].kind, FOVEA_SAMPLE_VELOCITY);
            assert_true(samples[0].velocity.stamp_ns == stamp_ns);
            assert_true(samples[0].velocity.velocity_m_s[0] == 0.001 * n &&
                        samples[0].velocity.angular_rate[2] == 0);
        }
        stamp_ns = frame.stamp_ns;
        ops->requeue(source, &frame);
        assert_int_equal(drive(source, n, 0.001 * (n + 1), 0), FOVEA_OK);
    }
    /* The sum of the velocities from frame 1 on, over the frame period. */
    const double way = hypot(T[3] - first[3], T[7] - first[7]);
    assert_true(fabs(way - 0.001 * 58 * 59 / 2 / 30) < 0.002);
    assert_true((ops->info(source)->sample_kinds & 1u << FOVEA_SAMPLE_VELOCITY) != 0);
    sim_source_close(source);
}

static void the_drive_ends_at_the_goal(void **state)
{
    struct fovea_source *source = sim_source_open(DRIVE, NULL);
    struct fovea_frame frame;
    int frames = 0;
    (void)state;
    struct fv_sim_drive *d = &source->world.drive;
    d->goal[0] = d->tick[0].position[0] + 0.6 * cos(d->tick[0].yaw);
    d->goal[1] = d->tick[0].position[1] + 0.6 * sin(d->tick[0].yaw);
    while (ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK) {
        ops->requeue(source, &frame);
        assert_int_equal(drive(source, frames++, 0.3, 0), FOVEA_OK);
    }
    assert_int_equal(ops->state(source), FOVEA_SOURCE_ENDED);
    assert_true(frames > 50 && frames < 100);
    assert_int_equal(ops->complaint(source, &error), FOVEA_OK);
    assert_non_null(strstr(error.text, "the goal is 0.600 m ahead of the start and 0.000 m to"));
    assert_int_equal(ops->complaint(source, &error), FOVEA_OK);
    assert_non_null(strstr(error.text, "sim: drive: at the goal after 1."));
    assert_non_null(strstr(error.text, "contacts 0"));
    sim_source_close(source);
}

/* The last command holds for half a second of the drive. */
static void by_the_clock_nothing_is_waited_for(void **state)
{
    const struct fovea_source_selection selection = {.step = 1, .by_clock = true};
    struct fovea_source *source = sim_source_open(DRIVE, &selection);
    struct fovea_frame frame;
    double T[12], at[80][2];
    (void)state;
    assert_int_equal(drive(source, 0, 0.9, 0), FOVEA_OK);
    assert_int_equal(drive(source, -1, 0.3, 0), FOVEA_OK); /* newer */
    for (int n = 0; n < 80; n++) {
        assert_int_equal(ops->dequeue(source, 0, &frame), FOVEA_OK);
        assert_int_equal(ops->truth_pose(source, &frame, T), FOVEA_OK);
        at[n][0] = T[3];
        at[n][1] = T[7];
        ops->requeue(source, &frame);
    }
    const double moves = hypot(at[15][0] - at[14][0], at[15][1] - at[14][1]);
    assert_true(fabs(moves - 0.3 / 30) < 1e-6);
    assert_true(hypot(at[79][0] - at[60][0], at[79][1] - at[60][1]) < 1e-9);
    sim_source_close(source);
}

static void other_sources_and_selections_are_refused_by_name(void **state)
{
    const struct fovea_source_selection later = {.start = 5, .step = 1};
    struct fovea_source *source = sim_source_open("orbit?width=96&height=64", NULL);
    (void)state;
    assert_int_equal(drive(source, 0, 0.1, 0), FOVEA_ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "expected sim:drive with commands=1"));
    sim_source_close(source);
    assert_int_equal(ops->open(DRIVE, &later, &source, &error), FOVEA_ERROR_UNSUPPORTED);
    assert_int_equal(ops->open(DRIVE "&frames=0", NULL, &source, &error), FOVEA_ERROR_INPUT);
    assert_int_equal(ops->open("orbit?commands=1", NULL, &source, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "with the trajectory orbit, expected drive"));
    assert_int_equal(ops->open("drive?patience=3", NULL, &source, &error), FOVEA_ERROR_INPUT);
    assert_non_null(strstr(error.text, "found 3 without commands, expected commands=1"));
}

static void more_than_a_few_at_once_are_refused(void **state)
{
    struct fovea_source *source = sim_source_open(DRIVE, NULL);
    (void)state;
    for (int i = 0; i < FV_SIM_COMMANDS_QUEUE; i++)
        assert_int_equal(drive(source, i, 0.1, 0), FOVEA_OK);
    assert_int_equal(drive(source, 99, 0.1, 0), FOVEA_AGAIN);
    sim_source_close(source);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_same_commands_give_the_same_frames),
        cmocka_unit_test(a_frame_waits_for_the_answer_to_the_one_before),
        cmocka_unit_test(a_source_that_gets_no_answer_fails_with_its_reason),
        cmocka_unit_test(it_moves_as_it_is_asked_to_and_tells_what_it_took),
        cmocka_unit_test(the_drive_ends_at_the_goal),
        cmocka_unit_test(by_the_clock_nothing_is_waited_for),
        cmocka_unit_test(other_sources_and_selections_are_refused_by_name),
        cmocka_unit_test(more_than_a_few_at_once_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
