/* An older map entered again, at the runtime: the published frame becomes another, and so the reset
 * counter rises, as with every new map. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "common/sim_rig.h"

enum { FIRST = 24, OTHER = 60, AGAIN = 14 };
#define ORBIT "sim:orbit?width=320&height=240&lens=pinhole&fov=70&rate=3"

static struct sim_rig rig;

static void every_change_of_the_map_raises_the_counter(void **state)
{
    (void)state;
    bool entered_again = false, started_another = false;
    sim_rig_open(&rig,
                 "sequence:" ORBIT "[frames=24] then " ORBIT "&seed=5[frames=60] then " ORBIT
                 "[start=8,frames=14]",
                 0, 0);
    sim_rig_build(&rig);
    while (sim_rig_next(&rig))
        sim_rig_process(&rig);
    assert_int_equal(rig.frames, FIRST + OTHER + AGAIN);
    int before = -1;
    for (int k = 0; k < rig.frames; k++) {
        const struct fovea_pose *now = &rig.pose[k];
        if (!now->posed) continue;
        if (before >= 0) {
            const struct fovea_pose *then = &rig.pose[before];
            assert_true(now->reset_counter >= then->reset_counter);
            if ((now->map_id != then->map_id) != (now->reset_counter != then->reset_counter))
                fail_msg("frame %d: map %u after %u, reset counter %u after %u", k, now->map_id,
                         then->map_id, now->reset_counter, then->reset_counter);
            started_another |= now->map_id > then->map_id;
            entered_again |= now->map_id < then->map_id;
        }
        before = k;
    }
    assert_true(started_another && entered_again);
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_change_of_the_map_raises_the_counter)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
