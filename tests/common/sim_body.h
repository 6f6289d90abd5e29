/* What the pose messages of a simulated run say of its body. */
#ifndef FOVEA_TESTS_COMMON_SIM_BODY_H
#define FOVEA_TESTS_COMMON_SIM_BODY_H

#include <math.h>
#include <string.h>

#include <cmocka.h>

#include "common/sim_rig.h"
#include "fovea_pose_t.h"
#include "geometry/se3.h"
#include "geometry/vec.h"

/* The message FOVEA_POSE of the last step, in place of what `body` held. */
static inline void sim_body_take(const struct sim_rig *rig, fovea_pose_t *body)
{
    for (uint32_t i = 0; i < rig->outputs.message_count; i++) {
        const struct fovea_message *m = &rig->outputs.messages[i];
        if (strcmp(m->channel, "FOVEA_POSE") != 0) continue;
        fovea_pose_t_decode_cleanup(body);
        assert_true(fovea_pose_t_decode(m->data, 0, (int)m->bytes, body) > 0);
        return;
    }
    fail_msg("no pose message");
}

/* Angle between the gravity that it says and that of the truth, rad; the body is the camera. */
static inline double sim_body_gravity_error(const struct sim_rig *rig, const fovea_pose_t *body)
{
    const double *T = rig->truth[rig->frames - 1], down[3] = {0, 0, -1};
    double R[9], said[3], true_R[9], truth[3];
    fv_so3_from_quaternion(body->orientation, R);
    fv_rotate_back3(R, body->gravity, said);
    assert_true(fv_normalise3(said));
    for (int i = 0; i < 9; i++)
        true_R[i] = T[4 * (i / 3) + i % 3];
    fv_rotate_back3(true_R, down, truth);
    return acos(fv_dot3(said, truth));
}

#endif
