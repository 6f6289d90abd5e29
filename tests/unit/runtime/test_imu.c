/* Inertial samples through the runtime: judged in the step, told in imu_status_t, and a copy of the
 * runtime goes on with the same bits. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/sim_rig.h"
#include "message/message.h"
#include "runtime/state.h"

#include "fovea_imu_status_t.h"

enum { STATISTICS_EVERY = 10 };

static struct sim_rig rig;

static bool next(void)
{
    if (!sim_rig_next(&rig)) return false;
    sim_rig_take_samples(&rig);
    return true;
}

static void open_rig(int frames)
{
    sim_rig_open(&rig, "sim:orbit?width=160&height=120&imu=200&wheel_odometry=0", 0, frames);
    const struct fovea_rig *seen = &rig.ops->info(rig.source)->rig;
    assert_true(seen->has_imu);
    rig.config.rig.has_imu = true;
    rig.config.rig.imu = seen->imu;
    rig.config.statistics_every = STATISTICS_EVERY;
    sim_rig_build(&rig);
}

/* Of the last step; false: it sent none. */
static bool told(fovea_imu_status_t *status)
{
    for (uint32_t i = 0; i < rig.outputs.message_count; i++) {
        const struct fovea_message *message = &rig.outputs.messages[i];
        if (strcmp(message->channel, "FOVEA_IMU_STATUS") != 0) continue;
        assert_false(message->volatile_values);
        assert_int_equal(fovea_imu_status_t_decode(message->data, 0, (int)message->bytes, status),
                         message->bytes);
        return true;
    }
    return false;
}

static void every_field_is_told(void **state)
{
    (void)state;
    const struct fovea_imu_status in = {
        .state = FOVEA_IMU_FROZEN,
        .stamp_ns = 12,
        .rate_hz = 200.5,
        .counts = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10},
        .time_offset_s = 11,
        .time_offset_sigma_s = 12,
        .time_offset_used_s = 13,
        .mount_error = {14, 15, 16},
        .mount_sigma = {17, 18, 19},
        .mount_angle = 20,
        .mount_angle_sigma = 21,
        .mount_wrong = true,
    };
    uint8_t data[512];
    fovea_imu_status_t out;
    const uint32_t bytes = fv_message_imu_status_encode(&in, fv_message_stamp(NULL, -5), 99, data,
                                                        fv_message_imu_status_size_max());
    assert_int_equal(bytes, fv_message_imu_status_size_max());
    assert_int_equal(
        fv_message_imu_status_encode(&in, fv_message_stamp(NULL, -5), 99, data, bytes - 1), 0);
    assert_int_equal(fovea_imu_status_t_decode(data, 0, (int)bytes, &out), bytes);
    assert_true(out.stamp.sequence == -1 && out.now_ns == 99 && out.sample_stamp_ns == 12);
    assert_true(out.state == FOVEA_IMU_STATUS_T_STATE_FROZEN && out.rate_hz == 200.5);
    assert_true(out.taken == 1 && out.repeated == 2 && out.late == 3 && out.not_finite == 4 &&
                out.saturated == 5 && out.frozen == 6 && out.off_clock == 7 && out.missing == 8 &&
                out.gaps == 9 && out.jumps == 10);
    assert_true(out.time_offset_s == 11 && out.time_offset_sigma_s == 12 &&
                out.time_offset_used_s == 13);
    assert_memory_equal(out.mount_error, in.mount_error, sizeof in.mount_error);
    assert_memory_equal(out.mount_sigma, in.mount_sigma, sizeof in.mount_sigma);
    assert_true(out.mount_angle == 20 && out.mount_angle_sigma == 21 && out.mount_wrong == 1);
}

static void states_are_told_at_once(void **state)
{
    (void)state;
    fovea_imu_status_t status;
    struct fovea_imu_status now = {.state = FOVEA_IMU_NONE};
    open_rig(60);
    for (int frame = 0; next(); frame++) {
        const bool broken = frame >= 23 && frame < 27;
        for (uint32_t i = 0; broken && i < rig.inputs.sample_count; i++)
            rig.samples[i].imu.gyro[1] = NAN;
        if (frame >= 41 && frame < 50) rig.inputs.sample_count = 0;
        sim_rig_process(&rig);
        fovea_imu_status_get(rig.rt, &now);
        const bool silent = frame >= 47 && frame < 50; /* later than 0.2 s */
        const int expected = broken   ? FOVEA_IMU_NOT_FINITE
                             : silent ? FOVEA_IMU_SILENT
                                      : FOVEA_IMU_OK;
        if ((int)now.state != expected) fail_msg("frame %d: %d", frame, (int)now.state);
        const bool changes = frame == 23 || frame == 27 || frame == 47 || frame == 50;
        const bool sent = told(&status);
        assert_int_equal(sent, changes || frame % STATISTICS_EVERY == 0);
        if (changes) assert_int_equal(status.state, expected);
        if (!sent) continue;
        assert_true(status.time_offset_s == now.time_offset_s &&
                    status.time_offset_sigma_s == now.time_offset_sigma_s &&
                    status.mount_angle_sigma == now.mount_angle_sigma);
        assert_memory_equal(status.mount_sigma, now.mount_sigma, sizeof now.mount_sigma);
    }
    /* Odometry has begun to find them. */
    assert_true(now.time_offset_sigma_s > 0 && now.time_offset_sigma_s < 0.03);
    assert_true(now.mount_sigma[0] > 0 && now.mount_sigma[0] < 0.1);
    assert_in_range(now.counts.not_finite, 25, 28); /* of four frames at 30 Hz */
    assert_int_equal(now.counts.missing, 60);       /* of nine frames */
    assert_int_equal(now.counts.gaps, 2);
    sim_rig_close(&rig);
}

static void a_copy_goes_on_with_the_same_bits(void **state)
{
    (void)state;
    open_rig(40);
    void *memory = aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (rig.rt->block_bytes + 63) / 64 * 64);
    struct fovea *copy = NULL;
    struct fovea_outputs outputs;
    assert_non_null(memory);
    for (int frame = 0; next(); frame++) {
        if (frame == 20)
            assert_int_equal(fovea_copy(rig.rt, memory, rig.rt->block_bytes, &copy), FOVEA_OK);
        if (frame % 3 == 0 && rig.inputs.sample_count > 2) rig.samples[2] = rig.samples[1];
        sim_rig_process(&rig);
        if (copy == NULL) continue;
        (void)fovea_step(copy, &rig.inputs, &outputs);
        (void)fovea_work(copy, &rig.inputs.grants, &outputs);
        assert_true(fovea_state_hash(copy) == fovea_state_hash(rig.rt));
        assert_int_equal(copy->imu.count, rig.rt->imu.count);
        assert_memory_equal(copy->imu.clean, rig.rt->imu.clean,
                            copy->imu.count * sizeof *copy->imu.clean);
    }
    struct fovea_imu_status status;
    fovea_imu_status_get(copy, &status);
    assert_int_equal(status.counts.repeated, status.counts.missing);
    assert_true(status.counts.repeated > 10);
    free(memory);
    sim_rig_close(&rig);
}

/* Who has none pays nothing. */
static void without_a_sensor_there_is_no_state(void **state)
{
    (void)state;
    fovea_imu_status_t message;
    struct fovea_imu_status status;
    sim_rig_open(&rig, "sim:orbit?width=160&height=120", 0, 2);
    sim_rig_build(&rig);
    while (next()) {
        sim_rig_process(&rig);
        assert_false(told(&message));
    }
    fovea_imu_status_get(rig.rt, &status);
    assert_int_equal(status.state, FOVEA_IMU_NONE);
    assert_null(rig.rt->imu.state);
    sim_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_field_is_told),
        cmocka_unit_test(states_are_told_at_once),
        cmocka_unit_test(a_copy_goes_on_with_the_same_bits),
        cmocka_unit_test(without_a_sensor_there_is_no_state),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
