/* Poses between frames in a run: the samples' thread sends them while the loop steps, at most at
 * the rate asked for, and neither a step's result nor the end depends on it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "app/run/fast_pose.h"
#include "common/sim_rig.h"
#include "drivers/clock.h"

enum { FRAMES = 80, POSED = 50, IMU_HZ = 200 };

static struct sim_rig rig;
static struct fv_fast_pose fast;

/* ---- the thread of a sensor ------------------------------------------------------------------ */

/* Short beside a step, and the processor is free for it. */
static void rest(void)
{
    usleep(50);
}

static struct {
    struct fovea_imu_sample samples[FOVEA_INPUT_SAMPLES_MAX];
    uint32_t count;
    bool last;               /* nothing comes after this list */
    atomic_uint asked, done; /* lists */
    atomic_uint taken;       /* samples of the list */
} sensor;

static void *sense_all(void *context)
{
    for (unsigned list_number = 1;; list_number++) {
        while (atomic_load(&sensor.asked) < list_number)
            rest();
        for (uint32_t i = 0; i < sensor.count; i++) {
            fv_fast_pose_take(context, &sensor.samples[i]);
            atomic_store(&sensor.taken, i + 1);
        }
        const bool last = sensor.last;
        atomic_store(&sensor.done, list_number);
        if (last) return NULL;
    }
}

/* Hand a list over, once the one before has been worked on; wait until half of it has been, since
 * samples come before the step of their frame: the rest is taken while that goes on. */
static void give(const struct fovea_sample *samples, uint32_t count, bool last)
{
    while (atomic_load(&sensor.done) < atomic_load(&sensor.asked))
        rest();
    sensor.count = 0;
    for (uint32_t i = 0; i < count; i++)
        if (samples[i].kind == FOVEA_SAMPLE_IMU) sensor.samples[sensor.count++] = samples[i].imu;
    sensor.last = last;
    atomic_store(&sensor.taken, 0);
    atomic_fetch_add(&sensor.asked, 1);
    while (atomic_load(&sensor.taken) < sensor.count / 2)
        rest();
}

/* ---- a run ----------------------------------------------------------------------------------- */

static void open_rig(void)
{
    sim_rig_open(&rig, "sim:orbit?width=320&height=240&rate=20&imu=200&baseline=0.12", 0, FRAMES);
    rig.config.rig = rig.ops->info(rig.source)->rig;
    rig.config.odometry.keyframes = 40;
    rig.config.features.count_max = 500;
    sim_rig_build(&rig);
}

/* All frames, their samples on another thread at the same time where `thread`. */
static uint64_t drive(bool thread)
{
    while (sim_rig_next(&rig)) {
        sim_rig_take_samples(&rig);
        if (thread) give(rig.samples, rig.inputs.sample_count, false);
        sim_rig_process(&rig);
    }
    return fovea_state_hash(rig.rt);
}

/* What was sent on the channel in a run at a rate; `alone` is the state without. */
static uint64_t sent_at(uint32_t rate_hz, uint64_t alone)
{
    struct fv_transport *transport;
    struct fv_transport_sent sent;
    struct fovea_error error;
    pthread_t thread;
    open_rig();
    if (fv_transport_open("memq://", 0, &transport, &error) != FOVEA_OK) fail_msg("%s", error.text);
    memset(&fast, 0, sizeof fast);
    fv_fast_pose_open(&fast, rig.rt, transport, "TEST", rate_hz);
    sensor.asked = sensor.done = 0;
    assert_int_equal(pthread_create(&thread, NULL, sense_all, &fast), 0);
    const uint64_t state = drive(true);
    fv_fast_pose_end(&fast);
    give(rig.samples, rig.inputs.sample_count, true); /* nobody is there for them */
    assert_int_equal(pthread_join(thread, NULL), 0);
    fv_transport_finish(transport);
    fv_transport_sent(transport, &sent);
    assert_int_equal(sent.count, 1);
    assert_string_equal(sent.channels[0].name, "TEST_POSE_FAST");
    assert_int_equal(sent.channels[0].offered, sent.channels[0].sent);
    fv_transport_close(transport);
    sim_rig_close(&rig);
    assert_true(state == alone);
    return sent.channels[0].sent;
}

static void they_are_sent_at_the_rate_beside_the_steps(void **state)
{
    (void)state;
    open_rig();
    const uint64_t alone = drive(false);
    sim_rig_close(&rig);
    const uint64_t all = sent_at(1000, alone), some = sent_at(50, alone);
    const uint64_t samples = (uint64_t)(FRAMES - POSED) * IMU_HZ / 20;
    print_message("%d of %d samples after frame %d, at 50 Hz %d\n", (int)all, (int)samples, POSED,
                  (int)some);
    /* At least the first half of each frame's are, and at 50 Hz one or two of a frame's ten. */
    assert_true(all >= samples / 2 - 10 && all <= (uint64_t)FRAMES * IMU_HZ / 20);
    assert_true(some >= FRAMES - POSED - 1 && some <= all / 2);
}

/* How many of `count` samples, `step_ns` apart from `stamp_ns` on, are due; every second one comes
 * `vary_ns` early. */
static int due_of(int count, int64_t stamp_ns, int64_t step_ns, int64_t vary_ns)
{
    int sent = 0;
    for (int i = 0; i < count; i++)
        sent += fv_fast_pose_due(&fast, stamp_ns + i * step_ns - (i % 2) * vary_ns);
    return sent;
}

static void the_rate_is_kept(void **state)
{
    enum { PERIOD_NS = 10000000, MS = 1000000 };
    const int64_t begin_ns = 1000 * (int64_t)PERIOD_NS, later_ns = 2 * begin_ns;
    (void)state;
    fast = (struct fv_fast_pose){.period_ns = PERIOD_NS};
    /* Sensor at the rate, its stamps varying by a tenth of the period: all of them. */
    assert_int_equal(due_of(100, begin_ns, PERIOD_NS, MS), 100);
    /* A sensor whose samples come every 7 of its 10 ms: still one in 10 ms. */
    assert_int_equal(due_of(100, begin_ns + 200 * PERIOD_NS, 7 * MS, 0), 70);
    /* After a gap none is made up for: at four times the rate a fourth of them. */
    assert_int_equal(due_of(100, later_ns, PERIOD_NS / 4, 0), 25);
    /* The clock is set back: the rate from there on, without waiting for where it was. */
    assert_int_equal(due_of(100, begin_ns, PERIOD_NS / 4, 0), 25);
}

static void an_end_without_a_beginning_is_none(void **state)
{
    (void)state;
    memset(&fast, 0, sizeof fast);
    fv_fast_pose_end(&fast);
    assert_null(fast.rt);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(they_are_sent_at_the_rate_beside_the_steps),
        cmocka_unit_test(the_rate_is_kept),
        cmocka_unit_test(an_end_without_a_beginning_is_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
