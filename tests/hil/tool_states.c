/* hil-tool states LOG [state=NAME...] [pose=N...] [rate=HZ]
 * What the messages of a recording say of the camera and of the pose, change by change. Fails
 * unless the states of the camera that are named come in this order and those of the pose in theirs
 * (others may lie between), and, with rate=, steps without a frame came at least at 0.7 of that
 * rate while the camera was gone. A pose=3 (lost) that is named must be said while no frame comes,
 * not with the first one after.
 */
#include "tool.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/lcmlog.h"
#include "fovea_camera_status_t.h"
#include "fovea_pose_t.h"

static const char *const pose_names[] = {"starting", "tracking", "weak", "lost", "paused"};
static const char *const names[] = {"ok", "late", "stalled", "gone", "returning", "ended"};

static struct seen {
    int last_state;
    long frames, poses, pose_state[5], gone_steps;
    int64_t gone_ns, gone_since_ns;
    uint64_t delivered, damaged, dropped, recovered;
} seen = {.last_state = -1};

static int wanted_count, next_wanted, pose_count, next_pose;
static const char *wanted[16];
static int wanted_poses[16];
static int last_pose = -1;
static bool frame_came, step_has_frame, lost_too_late;

static void take_status(const fovea_camera_status_t *status)
{
    const int state = status->state;
    seen.delivered = (uint64_t)status->delivered;
    seen.damaged = (uint64_t)status->damaged;
    seen.dropped = (uint64_t)status->dropped;
    seen.recovered = (uint64_t)status->recovered;
    if (state < 0 || state > 5) tool_fail("unknown state %d", state);
    if (state == FOVEA_CAMERA_STATUS_T_STATE_GONE) {
        seen.gone_steps++;
        if (seen.last_state != state) seen.gone_since_ns = status->now_ns;
        seen.gone_ns += status->now_ns - seen.gone_since_ns;
        seen.gone_since_ns = status->now_ns;
    }
    if (state != seen.last_state)
        printf("camera %s after %lld frames\n", names[state], (long long)status->delivered);
    seen.last_state = state;
    if (next_wanted < wanted_count && strcmp(wanted[next_wanted], names[state]) == 0) next_wanted++;
}

static void take_pose(int state)
{
    if (state < 0 || state > 4) tool_fail("unknown state %d of the pose", state);
    if (state != last_pose) printf("pose %s after %ld poses\n", pose_names[state], seen.poses);
    if (next_pose < pose_count && wanted_poses[next_pose] == state) {
        next_pose++;
        lost_too_late = lost_too_late || (state == 3 && step_has_frame);
    }
    seen.pose_state[state]++;
    last_pose = state;
}

static void take_event(const struct fv_lcmlog_event *event)
{
    uint8_t *data = (uint8_t *)(uintptr_t)event->data;
    fovea_camera_status_t status;
    fovea_pose_t pose;
    if (fv_lcmlog_channel_is(event->channel, "FRAME")) {
        seen.frames++;
        frame_came = true;
    }
    if (fv_lcmlog_channel_is(event->channel, "INPUTS")) { /* begins a step, behind its frame */
        step_has_frame = frame_came;
        frame_came = false;
    }
    if (fv_lcmlog_channel_is(event->channel, "CAMERA_STATUS") &&
        fovea_camera_status_t_decode(data, 0, (int)event->bytes, &status) >= 0) {
        take_status(&status);
        fovea_camera_status_t_decode_cleanup(&status);
    }
    if (fv_lcmlog_channel_is(event->channel, "CAMERA_POSE") &&
        fovea_pose_t_decode(data, 0, (int)event->bytes, &pose) >= 0) {
        take_pose(pose.state);
        seen.poses++;
        fovea_pose_t_decode_cleanup(&pose);
    }
}

int tool_states(int argc, char **argv)
{
    struct fv_lcmlog *log;
    struct fv_lcmlog_event event;
    struct fovea_error error = {.text = ""};
    double rate_hz = 0;
    if (argc < 2 || fv_lcmlog_open(argv[1], &log, &error) != FOVEA_OK)
        tool_fail("states: %s", error.text);
    for (int i = 2; i < argc && wanted_count < 16 && pose_count < 16; i++) {
        if (strncmp(argv[i], "state=", 6) == 0) wanted[wanted_count++] = argv[i] + 6;
        if (strncmp(argv[i], "pose=", 5) == 0) wanted_poses[pose_count++] = atoi(argv[i] + 5);
        if (strncmp(argv[i], "rate=", 5) == 0) rate_hz = atof(argv[i] + 5);
    }
    while (fv_lcmlog_next(log, &event, &error) == FOVEA_OK)
        take_event(&event);
    fv_lcmlog_close(log);
    printf(
        "%ld frames, %ld poses (%ld starting, %ld tracking, %ld weak, %ld lost); delivered %llu, damaged %llu, dropped %llu, recovered %llu; %ld steps in %.2f s while gone\n",
        seen.frames, seen.poses, seen.pose_state[0], seen.pose_state[1], seen.pose_state[2],
        seen.pose_state[3], (unsigned long long)seen.delivered, (unsigned long long)seen.damaged,
        (unsigned long long)seen.dropped, (unsigned long long)seen.recovered, seen.gone_steps,
        (double)seen.gone_ns * 1e-9);
    const bool went_on =
        rate_hz == 0 || (seen.gone_steps >= 3 &&
                         (double)seen.gone_steps >= 0.7 * rate_hz * (double)seen.gone_ns * 1e-9);
    if (lost_too_late) printf("lost only when the camera was back\n");
    return next_wanted == wanted_count && next_pose == pose_count && !lost_too_late && went_on ? 0
                                                                                               : 1;
}
