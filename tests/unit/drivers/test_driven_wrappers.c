/* A driven source within another: `fault:` and `pair:` pass velocity commands on, and all that a
 * source says of its failure; what is within and cannot be driven refuses in its own words. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../../../drivers/sim/sim.h"
#include "../../../drivers/table.h"

#define SIZE "width=96&height=64&wheel_odometry=0"
#define DRIVE "sim:drive?seed=5&commands=1&" SIZE
#define PARKED "sequence:sim:orbit?" SIZE "&frames=9" /* cannot be driven */
#define NO_FAULT "?kind=black&first=1000000"

enum { FRAMES = 40 };

static const struct fovea_source_selection everything = {.step = 1};
static struct fovea_error error;

struct opened {
    const struct fovea_source_ops *ops;
    struct fovea_source *source;
};

static struct opened open_source(const char *uri)
{
    struct opened o = {0};
    const char *address;
    if (fv_source_find(uri, &o.ops, &address, &error) != FOVEA_OK ||
        o.ops->open(address, &everything, &o.source, &error) != FOVEA_OK ||
        o.ops->start(o.source, &error) != FOVEA_OK)
        fail_msg("%s: %s", uri, error.text);
    return o;
}

static void close_source(struct opened o)
{
    o.ops->stop(o.source);
    o.ops->close(o.source);
}

static enum fovea_status drive(struct opened o, int64_t sequence, double turning)
{
    const struct fovea_velocity_command command = {
        .sequence = sequence, .velocity_m_s = {0.3, 0, 0}, .angular_rate = {0, 0, turning}};
    return fv_source_drive(o.ops, o.source, &command, &error);
}

/* What a source gave that was driven along a bend. */
struct drive {
    uint64_t hash[2]; /* of the pictures of its cameras */
    double T[FRAMES][12];
    struct fovea_velocity_sample taken[FRAMES];
    uint32_t taken_count, cameras;
};

static uint64_t hash_of(const struct fovea_image *image, uint64_t hash)
{
    for (size_t i = 0; i < image->size_bytes; i++)
        hash = (hash ^ image->data[i]) * 0x100000001B3u;
    return hash;
}

static void take_samples(struct opened o, const struct fovea_frame *frame, struct drive *d)
{
    struct fovea_sample samples[16];
    const uint32_t count = o.ops->samples(o.source, frame, samples, 16);
    for (uint32_t i = 0; i < count; i++) {
        assert_int_equal(samples[i].kind, FOVEA_SAMPLE_VELOCITY);
        assert_true(d->taken_count < FRAMES);
        d->taken[d->taken_count++] = samples[i].velocity;
    }
}

static struct drive drive_along(const char *uri)
{
    struct drive d = {.hash = {1, 1}};
    struct fovea_frame frame;
    const struct opened o = open_source(uri);
    d.cameras = o.ops->info(o.source)->rig.camera_count;
    for (int n = 0; n < FRAMES; n++) {
        assert_int_equal(o.ops->dequeue(o.source, INT64_MAX, &frame), FOVEA_OK);
        assert_int_equal(frame.sequence, n);
        for (uint32_t i = 0; i < frame.image_count && i < 2; i++)
            d.hash[i] = hash_of(&frame.images[i], d.hash[i]);
        assert_int_equal(o.ops->truth_pose(o.source, &frame, d.T[n]), FOVEA_OK);
        take_samples(o, &frame, &d);
        o.ops->requeue(o.source, &frame);
        assert_int_equal(drive(o, n, n < FRAMES / 2 ? 0.6 : -0.2), FOVEA_OK);
    }
    assert_int_equal(o.ops->dequeue(o.source, 0, &frame), FOVEA_OK);
    o.ops->requeue(o.source, &frame);
    assert_int_equal(o.ops->dequeue(o.source, 0, &frame), FOVEA_AGAIN); /* its answer is due */
    close_source(o);
    assert_int_equal(d.taken_count, FRAMES - 1);
    return d;
}

static void expect_same_way(const struct drive *a, const struct drive *b)
{
    assert_memory_equal(a->T, b->T, sizeof a->T);
    assert_memory_equal(a->taken, b->taken, sizeof a->taken);
    assert_true(a->hash[0] == b->hash[0]);
}

static void a_drive_within_faults_is_the_drive(void **state)
{
    (void)state;
    const struct drive alone = drive_along(DRIVE), within = drive_along("fault:" DRIVE NO_FAULT),
                       twice =
                           drive_along("fault:fault:" DRIVE NO_FAULT "?kind=noise&first=999999"),
                       black = drive_along("fault:" DRIVE "?kind=black&first=5&fraction=1");
    assert_true(memcmp(alone.T[0], alone.T[FRAMES - 1], sizeof alone.T[0]) != 0);
    expect_same_way(&alone, &within);
    expect_same_way(&alone, &twice);
    assert_memory_equal(alone.T, black.T, sizeof alone.T);
    assert_true(alone.hash[0] != black.hash[0]);
}

/* Two cameras of one robot, which both show the same way. */
static void both_of_a_pair_are_driven(void **state)
{
    (void)state;
    const struct drive alone = drive_along(DRIVE), both = drive_along("pair:" DRIVE " and " DRIVE);
    assert_int_equal(both.cameras, 2);
    expect_same_way(&alone, &both);
    assert_true(both.hash[1] == alone.hash[0]);
}

/* The second is not driven, or has nothing of this clock: the command is for the first all the
 * same.
 */
static void the_first_of_a_pair_is_driven_alone(void **state)
{
    (void)state;
    const struct drive alone = drive_along(DRIVE),
                       orbit = drive_along("pair:" DRIVE " and sim:orbit?" SIZE),
                       parked = drive_along("pair:" DRIVE " and " PARKED);
    expect_same_way(&alone, &orbit);
    expect_same_way(&alone, &parked);
    assert_true(orbit.hash[1] != 1 && orbit.hash[1] != alone.hash[0]);
    assert_true(parked.hash[1] == 1);
}

/* Too many at once for either of them. */
static void a_command_that_finds_no_room_is_said_to(void **state)
{
    const struct opened o = open_source("pair:" DRIVE " and " DRIVE);
    (void)state;
    for (int i = 0; i < FV_SIM_COMMANDS_QUEUE; i++)
        assert_int_equal(drive(o, i, 0), FOVEA_OK);
    assert_int_equal(drive(o, 99, 0), FOVEA_AGAIN);
    close_source(o);
}

static void expect_refusal(const char *uri, const char *line)
{
    const struct opened o = open_source(uri);
    assert_int_equal(drive(o, 0, 0), FOVEA_ERROR_UNSUPPORTED);
    assert_string_equal(error.text, line);
    close_source(o);
}

#define CANNOT "sequence: found a velocity command, expected a source that can be driven"
#define NOT_DRIVEN "sim: commands: found a velocity command, expected sim:drive with commands=1"

static void what_cannot_be_driven_refuses_in_its_own_words(void **state)
{
    (void)state;
    expect_refusal(PARKED, CANNOT);
    expect_refusal("fault:" PARKED NO_FAULT, CANNOT);
    expect_refusal("fault:fault:" PARKED NO_FAULT NO_FAULT, CANNOT);
    expect_refusal("fault:sim:orbit?" SIZE NO_FAULT, NOT_DRIVEN);
    expect_refusal("pair:" PARKED " and " PARKED, CANNOT);
    expect_refusal("pair:" PARKED " and " DRIVE, CANNOT); /* the body is the first one's */
    expect_refusal("pair:sim:orbit?" SIZE " and " DRIVE, NOT_DRIVEN);
}

/* ---- a controller that is silent ------------------------------------------------------------- */

#define SILENT "sim:drive?seed=5&commands=1&patience=0.05&" SIZE
#define WHY                                                                                        \
    "found no velocity_command_t with sequence 0 for 0.05 s, expected an answer to each frame"

/* Whatever deadline the caller sets. */
static void expect_failure(const char *uri, int64_t deadline_ns)
{
    char line[512];
    struct fovea_frame frame;
    const struct opened o = open_source(uri);
    enum fovea_status status = o.ops->dequeue(o.source, INT64_MAX, &frame);
    assert_int_equal(status, FOVEA_OK);
    o.ops->requeue(o.source, &frame);
    assert_int_equal(fv_source_failure(o.ops, o.source, &error), FOVEA_AGAIN);
    do
        status = o.ops->dequeue(o.source, deadline_ns, &frame);
    while (status == FOVEA_AGAIN);
    assert_int_equal(status, FOVEA_ERROR_INPUT);
    assert_int_equal(fv_source_failed(o.ops, o.source, uri, status, &error), status);
    snprintf(line, sizeof line, "%s: %s", uri, WHY);
    assert_string_equal(error.text, line);
    close_source(o);
}

static void a_failure_is_told_with_its_reason(void **state)
{
    (void)state;
    expect_failure(SILENT, INT64_MAX);
    expect_failure(SILENT, 0);
    expect_failure("fault:" SILENT NO_FAULT, INT64_MAX);
    expect_failure("sequence:" SILENT, INT64_MAX);
    expect_failure("pair:" SILENT " and sim:orbit?" SIZE, INT64_MAX);
    /* Nobody drives the second, and the first does not wait. */
    expect_failure("pair:sim:orbit?" SIZE " and " SILENT, INT64_MAX);
    expect_failure("pair:sim:orbit?" SIZE " and " SILENT, 0);
}

static void a_failure_without_a_reason_names_the_source(void **state)
{
    (void)state;
    const struct opened o = open_source("sim:orbit?" SIZE);
    assert_int_equal(fv_source_failed(o.ops, o.source, "sim:orbit", FOVEA_ERROR_SYSTEM, &error),
                     FOVEA_ERROR_SYSTEM);
    assert_string_equal(error.text, "sim:orbit: found an error of the source (refused by the "
                                    "system), expected a frame");
    close_source(o);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_drive_within_faults_is_the_drive),
        cmocka_unit_test(both_of_a_pair_are_driven),
        cmocka_unit_test(the_first_of_a_pair_is_driven_alone),
        cmocka_unit_test(a_command_that_finds_no_room_is_said_to),
        cmocka_unit_test(what_cannot_be_driven_refuses_in_its_own_words),
        cmocka_unit_test(a_failure_is_told_with_its_reason),
        cmocka_unit_test(a_failure_without_a_reason_names_the_source),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
