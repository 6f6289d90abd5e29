/* How much a link takes: learnt from simulated links, of a clock that is the test's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "app/network/sender_link.h"

enum { MS = 1000000, FEATURES_BYTES = 14000 };

/* A link of a given rate (bytes per millisecond) behind a queue; a burst passes at once after rest.
 */
struct world {
    struct fv_link link;
    int64_t now_ns;
    double queued, credit, rate, burst;
    int64_t longest_ms; /* that a byte would have waited behind bulk */
    uint64_t passed;
};

static void begin(struct world *world, double rate, double burst)
{
    *world = (struct world){.rate = rate, .burst = burst, .credit = burst, .now_ns = 1000 * MS};
    fv_link_init(&world->link, world->now_ns);
}

static void a_millisecond(struct world *world)
{
    world->now_ns += MS;
    world->credit += world->rate;
    const double out = world->queued < world->credit ? world->queued : world->credit;
    world->queued -= out;
    world->credit -= out;
    if (world->credit > world->burst) world->credit = world->burst;
    fv_link_observe(&world->link, world->queued < 0.5, world->now_ns);
    const int64_t wait_ms = (int64_t)(world->queued / world->rate);
    if (wait_ms > world->longest_ms) world->longest_ms = wait_ms;
}

static void offer(struct world *world, size_t bytes)
{
    if (fv_link_ask(&world->link, bytes) != FV_LINK_GO) return;
    fv_link_sent(&world->link, bytes, world->now_ns);
    world->queued += (double)bytes;
    world->passed++;
}

/* Messages of `bytes`, or what the budget allows where that is less, whenever the link asks. */
static void run(struct world *world, int ms, size_t bytes)
{
    for (int i = 0; i < ms; i++) {
        offer(world, bytes < world->link.budget ? bytes : world->link.budget);
        a_millisecond(world);
    }
}

static void a_slow_link_is_learnt_and_state_waits_80_ms_at_most(void **state)
{
    (void)state;
    struct world world;
    begin(&world, 125.0, 4000.0); /* 1 Mbit/s */
    offer(&world, FEATURES_BYTES);
    run(&world, 500, 60000);
    world.longest_ms = 0;
    run(&world, 20000, 60000);
    assert_true(world.link.slow);
    assert_true(world.longest_ms <= 80);
    assert_true(world.link.budget > 6000 && world.link.budget < 13000);
    assert_int_equal(fv_link_ask(&world.link, 40000),
                     world.link.batch > 0 ? FV_LINK_WAIT : FV_LINK_TOO_LONG);
}

static void a_fast_link_takes_everything_at_once(void **state)
{
    (void)state;
    struct world world;
    begin(&world, 125000.0, 125000.0);
    run(&world, 10, FEATURES_BYTES);
    assert_int_equal(world.passed, 10);
    run(&world, 100, 60000);
    assert_int_equal(world.link.budget, FV_LINK_DATAGRAM_BYTES);
    assert_false(world.link.slow);
}

/* The sender had no processor for a second; the link is fast all the same. */
static void a_late_look_does_not_make_a_link_slow(void **state)
{
    (void)state;
    struct world world;
    begin(&world, 125000.0, 125000.0);
    for (int i = 0; i < 10; i++) {
        offer(&world, FEATURES_BYTES);
        world.queued = 0;
        world.now_ns += 1000 * (int64_t)MS;
        fv_link_observe(&world.link, true, world.now_ns);
    }
    assert_int_equal(world.passed, 10);
    assert_false(world.link.slow);
}

static void a_link_that_gets_faster_is_found_out(void **state)
{
    (void)state;
    struct world world;
    begin(&world, 125.0, 4000.0);
    run(&world, 2000, FEATURES_BYTES);
    assert_true(world.link.slow);
    world.rate = 12500.0;
    world.burst = 100000.0;
    run(&world, 2000, 60000);
    assert_false(world.link.slow);
}

/* Nothing but messages that are too long: after a while one is tried again. */
static void a_budget_that_nothing_fits_grows(void **state)
{
    (void)state;
    struct world world;
    begin(&world, 125.0, 4000.0);
    run(&world, 2000, 60000);
    world.passed = 0;
    for (int i = 0; i < 10000; i++) {
        offer(&world, FEATURES_BYTES);
        a_millisecond(&world);
    }
    assert_true(world.passed > 0 && world.passed < 10);
}

static void a_full_queue_halves_the_budget(void **state)
{
    (void)state;
    struct world world;
    begin(&world, 125.0, 4000.0);
    const size_t before = world.link.budget;
    fv_link_refused(&world.link, world.now_ns);
    assert_int_equal(world.link.budget, before / 2);
    for (int i = 0; i < 20; i++)
        fv_link_refused(&world.link, world.now_ns);
    assert_int_equal(world.link.budget, FV_LINK_LEAST_BYTES);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_slow_link_is_learnt_and_state_waits_80_ms_at_most),
        cmocka_unit_test(a_fast_link_takes_everything_at_once),
        cmocka_unit_test(a_late_look_does_not_make_a_link_slow),
        cmocka_unit_test(a_link_that_gets_faster_is_found_out),
        cmocka_unit_test(a_budget_that_nothing_fits_grows),
        cmocka_unit_test(a_full_queue_halves_the_budget),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
