/* Poses that the loop offers to the thread of the inertial sensor: handed over whole, the newest
 * one, while neither waits. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <pthread.h>
#include <sched.h>

#include "geometry/se3.h"
#include "runtime/sense.h"

static struct fv_sense sense;
static const struct fovea_rig_imu rig = {.T_body_imu = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};

enum { OFFERS = 1000000 };

static void *offer_all(void *context)
{
    (void)context;
    for (int n = 1; n <= OFFERS; n++) {
        struct fv_sense_anchor anchor = {.posed = true, .frame.stamp_ns = n};
        fv_se3_identity(&anchor.T_odom_body);
        anchor.map_id = (uint32_t)n;
        anchor.velocity[0] = anchor.biases.acceleration[2] = n;
        fv_sense_offer(&sense, &anchor);
    }
    return NULL;
}

/* Each pose that another thread takes is one that was offered, and none is older than one before.
 */
static void a_pose_is_taken_whole_while_others_are_offered(void **state)
{
    (void)state;
    pthread_t thread;
    struct fv_sense_pose pose;
    uint32_t before = 0, others = 0;
    fv_sense_init(&sense);
    assert_int_equal(pthread_create(&thread, NULL, offer_all, NULL), 0);
    for (int64_t n = 1; before < OFFERS; n++) {
        const struct fovea_imu_sample sample = {.stamp_ns = OFFERS + n};
        if (!fv_sense_take(&sense, &rig, &sample, &pose)) continue;
        const struct fv_sense_anchor *anchor = &sense.anchor;
        assert_int_equal(anchor->frame.stamp_ns, anchor->map_id);
        assert_true(anchor->velocity[0] == anchor->map_id &&
                    anchor->biases.acceleration[2] == anchor->map_id);
        assert_true(anchor->map_id >= before);
        others += anchor->map_id > before;
        before = anchor->map_id;
        if (n % 64 == 0) sched_yield();
    }
    assert_int_equal(pthread_join(thread, NULL), 0);
    assert_true(others > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pose_is_taken_whole_while_others_are_offered),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
