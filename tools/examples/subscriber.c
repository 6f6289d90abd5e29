/* Poses of a running Fovea by LCM: a line for each, until MESSAGES have come.
 *
 *     subscriber [URL [MESSAGES]]
 *
 * The pose is T_odom_body: where the robot's body is, in the frame that it had at the start. */
#include <stdio.h>
#include <stdlib.h>

#include <lcm/lcm.h>

#include "fovea_pose_t.h"

static long received;

static void on_pose(const lcm_recv_buf_t *packet, const char *channel, const fovea_pose_t *pose,
                    void *context)
{
    static const char *const states[] = {"starting", "tracking", "weak",
                                         "lost",     "paused",   "coasting"};
    (void)packet;
    (void)context;
    received++;
    const int known = pose->state >= 0 && pose->state <= FOVEA_POSE_T_STATE_COASTING;
    printf("%s %.3f %s", channel, (double)pose->stamp.time_ns * 1e-9,
           known ? states[pose->state] : "unknown");
    if (pose->state == FOVEA_POSE_T_STATE_TRACKING || pose->state == FOVEA_POSE_T_STATE_WEAK)
        printf(" %.3f %.3f %.3f %s", pose->position[0], pose->position[1], pose->position[2],
               pose->scale_state == FOVEA_POSE_T_SCALE_METRIC ? "m" : "units");
    printf("\n");
    fflush(stdout);
}

int main(int argc, char **argv)
{
    lcm_t *lcm = lcm_create(argc > 1 ? argv[1] : NULL); /* NULL: $LCM_DEFAULT_URL, or LCM's own */
    const long wanted = argc > 2 ? atol(argv[2]) : 0;   /* 0: for ever */
    if (lcm == NULL) return 1;
    fovea_pose_t_subscription_t *poses = fovea_pose_t_subscribe(lcm, "FOVEA_POSE", on_pose, NULL);
    if (poses == NULL) return 1;
    printf("listening\n");
    fflush(stdout);
    while ((wanted == 0 || received < wanted) && lcm_handle(lcm) == 0) {
    }
    fovea_pose_t_unsubscribe(lcm, poses);
    lcm_destroy(lcm);
    return received >= wanted ? 0 : 1;
}
