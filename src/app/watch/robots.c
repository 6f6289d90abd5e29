#include "app/watch/robots.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "support/say.h"

#include "fovea_camera_status_t.h"
#include "fovea_health_t.h"
#include "fovea_pose_t.h"
#include "fovea_run_t.h"
#include "fovea_statistics_t.h"

#define NAME_OF(names, value)                                                                      \
    ((value) >= 0 && (size_t)(value) < sizeof(names) / sizeof *(names) ? (names)[value] : "?")

const char *fv_robot_state_name(int state)
{
    static const char *const names[] = {"starting", "tracking", "weak",
                                        "lost",     "paused",   "coasting"};
    return NAME_OF(names, state);
}

const char *fv_robot_camera_name(int camera_state)
{
    static const char *const names[] = {"ok", "late", "stalled", "gone", "returning", "ended"};
    return NAME_OF(names, camera_state);
}

const char *fv_robot_scale_name(int scale_state)
{
    static const char *const names[] = {"free", "initialising", "metric"};
    return NAME_OF(names, scale_state);
}

const char *fv_robot_health_name(int health)
{
    static const char *const names[] = {"ok", "degraded", "failed"};
    return NAME_OF(names, health);
}

/* Text of others, which may go to a terminal. */
static void keep(char name[FV_ROBOT_NAME_BYTES], const char *text)
{
    snprintf(name, FV_ROBOT_NAME_BYTES, "%s", text);
    fv_say_clean(name);
}

/* ---- who ------------------------------------------------------------------------------------- */

static void begin_window(struct fv_robot *robot, int64_t now_ns)
{
    robot->window_ns = now_ns;
    robot->window_first = false;
    robot->window_processed = (double)robot->processed;
    robot->window_late = (double)robot->late;
    robot->window_poses = robot->window_times = 0;
    robot->window_sum_ms = robot->window_max_ms = 0;
    for (uint32_t i = 0; i < robot->stage_count; i++)
        robot->stages[i].sum_ms = 0;
}

static void forget_counts(struct fv_robot *robot)
{
    robot->state = robot->scale_state = robot->camera_state = robot->health = -1;
    robot->faults[0] = '\0';
    robot->quality = robot->latency_ms = robot->temperature_c = NAN;
    for (int i = 0; i < 3; i++)
        robot->position[i] = NAN;
    robot->frames_hz = robot->poses_hz = robot->frame_mean_ms = robot->frame_max_ms =
        robot->late_hz = NAN;
    robot->map_id = -1;
    robot->counted = false;
    robot->window_ns = 0;
    robot->stage_count = 0;
}

/* The robot of a channel that ends in `suffix`, an old one or a new one; NULL: no room. */
static struct fv_robot *robot_of(struct fv_robots *robots, const struct fv_received *received,
                                 const char *suffix)
{
    char prefix[FV_MESSAGE_CHANNEL_BYTES];
    const size_t length = strlen(received->channel) - strlen(suffix);
    uint32_t at = 0;
    memcpy(prefix, received->channel, length);
    prefix[length] = '\0';
    fv_say_clean(prefix);
    while (at < robots->count && strcmp(robots->robots[at].prefix, prefix) < 0)
        at++;
    struct fv_robot *robot = &robots->robots[at];
    if (at == robots->count || strcmp(robot->prefix, prefix) != 0) {
        if (robots->count == FV_ROBOTS_MAX) {
            robots->crowded++;
            return NULL;
        }
        memmove(robot + 1, robot, (robots->count - at) * sizeof *robot);
        robots->count++;
        memset(robot, 0, sizeof *robot);
        memcpy(robot->prefix, prefix, length + 1);
        forget_counts(robot);
    }
    robot->heard_ns = robots->now_ns;
    robot->from_host = received->from_host;
    if (robot->window_ns == 0) robot->window_ns = robots->now_ns;
    return robot;
}

/* ---- what they say --------------------------------------------------------------------------- */

static void take_run(void *context, const struct fv_received *received)
{
    struct fv_robot *robot = robot_of(context, received, "_RUN");
    fovea_run_t run;
    if (robot == NULL || fovea_run_t_decode(received->data, 0, (int)received->bytes, &run) < 0)
        return;
    if (robot->run_id != 0 && robot->run_id != run.run_id) {
        robot->restarts++;
        forget_counts(robot);
        robot->window_ns = ((struct fv_robots *)context)->now_ns;
    }
    robot->run_id = run.run_id;
    robot->process = run.process;
    keep(robot->host, run.host);
    keep(robot->version, run.version);
    fovea_run_t_decode_cleanup(&run);
}

static void take_pose(void *context, const struct fv_received *received)
{
    fovea_pose_t pose;
    if (fovea_pose_t_decode(received->data, 0, (int)received->bytes, &pose) < 0) return;
    const bool of_body = strcmp(pose.child_frame, "cam0") != 0; /* CAMERA_POSE ends alike */
    struct fv_robot *robot = of_body ? robot_of(context, received, "_POSE") : NULL;
    if (robot != NULL) {
        const int state = (uint8_t)pose.state; /* no constant is negative */
        if (robot->state != state) robot->state_since_ns = robot->heard_ns;
        robot->state = state;
        robot->scale_state = (uint8_t)pose.scale_state;
        robot->quality = (double)pose.quality;
        robot->inliers = pose.inliers;
        robot->map_id = pose.map_id;
        robot->reset_counter = pose.reset_counter;
        robot->latency_ms = pose.latency_ns != 0 ? (double)pose.latency_ns * 1e-6 : NAN;
        memcpy(robot->position, pose.position, sizeof robot->position);
        robot->window_poses++;
    }
    fovea_pose_t_decode_cleanup(&pose);
}

static void take_camera(void *context, const struct fv_received *received)
{
    struct fv_robot *robot = robot_of(context, received, "_CAMERA_STATUS");
    fovea_camera_status_t camera;
    if (robot == NULL ||
        fovea_camera_status_t_decode(received->data, 0, (int)received->bytes, &camera) < 0)
        return;
    robot->camera_state = (uint8_t)camera.state;
    robot->width = camera.width;
    robot->height = camera.height;
    fovea_camera_status_t_decode_cleanup(&camera);
}

/* Times of a step and the work after it, stage by stage. */
static void add_times(struct fv_robot *robot, const fovea_statistics_t *statistics)
{
    double all_ms = 0;
    for (int32_t i = 0; i < statistics->stage_count; i++) {
        const fovea_stage_t *stage = &statistics->stages[i];
        const double ms = (double)stage->wall_ns * 1e-6; /* whatever is claimed, no overflow */
        all_ms += ms;
        if (i >= FV_ROBOT_STAGES_MAX) continue;
        if ((uint32_t)i >= robot->stage_count) {
            robot->stages[i] = (struct fv_robot_stage){.mean_ms = NAN};
            robot->stage_count = (uint32_t)i + 1;
        }
        keep(robot->stages[i].name, stage->name);
        robot->stages[i].sum_ms += ms;
    }
    robot->window_times++;
    robot->window_sum_ms += all_ms;
    if (all_ms > robot->window_max_ms) robot->window_max_ms = all_ms;
}

static void take_statistics(void *context, const struct fv_received *received)
{
    struct fv_robot *robot = robot_of(context, received, "_STATISTICS");
    fovea_statistics_t statistics;
    if (robot == NULL ||
        fovea_statistics_t_decode(received->data, 0, (int)received->bytes, &statistics) < 0)
        return;
    const bool fresh = !robot->counted || statistics.frames_processed < robot->processed;
    robot->processed = statistics.frames_processed;
    robot->late = statistics.frames_late;
    robot->dropped = statistics.source_dropped;
    robot->damaged = statistics.source_damaged;
    robot->refused = statistics.frames_refused;
    robot->resident_bytes = statistics.resident_bytes;
    robot->temperature_c = (double)statistics.temperature_c;
    if (fresh) begin_window(robot, robot->heard_ns);
    if (fresh) robot->window_first = true;
    robot->counted = true;
    add_times(robot, &statistics);
    fovea_statistics_t_decode_cleanup(&statistics);
}

static void take_health(void *context, const struct fv_received *received)
{
    struct fv_robot *robot = robot_of(context, received, "_HEALTH");
    fovea_health_t health;
    size_t length = 0;
    if (robot == NULL ||
        fovea_health_t_decode(received->data, 0, (int)received->bytes, &health) < 0)
        return;
    robot->health = (uint8_t)health.state;
    robot->faults[0] = '\0';
    for (int32_t i = 0; i < health.count && length < sizeof robot->faults; i++) {
        const fovea_health_part_t *part = &health.parts[i];
        if (part->state == FOVEA_HEALTH_T_STATE_OK) continue;
        length += (size_t)snprintf(robot->faults + length, sizeof robot->faults - length,
                                   "%s%s %s: %s", length > 0 ? "; " : "", part->name,
                                   fv_robot_health_name((uint8_t)part->state), part->reason);
    }
    fv_say_clean(robot->faults);
    fovea_health_t_decode_cleanup(&health);
}

enum fovea_status fv_robots_rows(struct fv_robots *robots, const char *prefix,
                                 struct fv_receiver_channel rows[FV_ROBOT_ROWS],
                                 struct fovea_error *error)
{
    static const struct {
        const char *suffix, *type;
        void (*take)(void *context, const struct fv_received *received);
    } kinds[FV_ROBOT_ROWS] = {{"_RUN", "fovea.run_t", take_run},
                              {"_POSE", "fovea.pose_t", take_pose},
                              {"_CAMERA_STATUS", "fovea.camera_status_t", take_camera},
                              {"_STATISTICS", "fovea.statistics_t", take_statistics},
                              {"_HEALTH", "fovea.health_t", take_health}};
    if (strlen(prefix) + strlen("_CAMERA_STATUS") >= FV_MESSAGE_CHANNEL_BYTES)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "PREFIX: found %zu bytes, expected at most %zu", strlen(prefix),
                               FV_MESSAGE_CHANNEL_BYTES - 1 - strlen("_CAMERA_STATUS"));
    for (int i = 0; i < FV_ROBOT_ROWS; i++) {
        rows[i] = (struct fv_receiver_channel){.type = kinds[i].type,
                                               .bytes_max = FV_RECEIVER_BYTES_MAX,
                                               .take = kinds[i].take,
                                               .context = robots,
                                               .pattern = true};
        snprintf(rows[i].name, sizeof rows[i].name, "%.49s%s", prefix, kinds[i].suffix);
    }
    return FOVEA_OK;
}

/* ---- windows --------------------------------------------------------------------------------- */

void fv_robots_init(struct fv_robots *robots, int64_t window_ns)
{
    memset(robots, 0, sizeof *robots);
    robots->window_ns = window_ns;
}

/* A number that nothing was heard of in the window is not known. */
static void end_window(struct fv_robot *robot, int64_t now_ns)
{
    const double seconds = (double)(now_ns - robot->window_ns) * 1e-9;
    const uint32_t times = robot->window_times;
    const bool counted = robot->counted && times > (robot->window_first ? 1 : 0);
    robot->poses_hz = robot->state >= 0 ? robot->window_poses / seconds : NAN;
    robot->frames_hz =
        counted ? ((double)robot->processed - robot->window_processed) / seconds : NAN;
    robot->late_hz = counted ? ((double)robot->late - robot->window_late) / seconds : NAN;
    robot->frame_mean_ms = times > 0 ? robot->window_sum_ms / times : NAN;
    robot->frame_max_ms = times > 0 ? robot->window_max_ms : NAN;
    for (uint32_t i = 0; i < robot->stage_count; i++)
        robot->stages[i].mean_ms = times > 0 ? robot->stages[i].sum_ms / times : NAN;
    begin_window(robot, now_ns);
}

void fv_robots_tick(struct fv_robots *robots)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < robots->count; i++) {
        struct fv_robot *robot = &robots->robots[i];
        if (robots->now_ns - robot->heard_ns >= FV_ROBOT_GONE_NS) continue;
        if (robots->now_ns - robot->window_ns >= robots->window_ns)
            end_window(robot, robots->now_ns);
        if (kept != i) robots->robots[kept] = *robot;
        kept++;
    }
    robots->count = kept;
}
