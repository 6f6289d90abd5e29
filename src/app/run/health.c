#include "app/run/health.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "drivers/clock.h"

static const int64_t starting_ns = 10 * FV_SECOND_NS, inference_ns = 5 * FV_SECOND_NS;

/* A part of no fault; the returned one is the last, to be spoiled. */
static struct fv_health_part *part(struct fv_health *health, const char *name)
{
    struct fv_health_part *added = &health->parts[health->count++];
    *added = (struct fv_health_part){.name = name};
    return added;
}

__attribute__((format(printf, 3, 4))) static void
spoil(struct fv_health_part *of, enum fv_health_state state, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    of->state = state;
    vsnprintf(of->reason, sizeof of->reason, format, arguments);
    va_end(arguments);
}

static double seconds(int64_t ns)
{
    return 1e-9 * (double)ns;
}

static void judge_source(const struct fv_health_facts *facts, struct fv_health_part *source)
{
    static const char *const words[] = {[FOVEA_SOURCE_LATE] = "a frame is late",
                                        [FOVEA_SOURCE_STALLED] = "the camera gives no frames",
                                        [FOVEA_SOURCE_RETURNING] = "the camera is being set up"};
    if (facts->source_state == FOVEA_SOURCE_GONE)
        spoil(source, FV_HEALTH_FAILED, "the camera is gone, for %.1f s",
              seconds(facts->silent_ns));
    else if (facts->silent_ns > facts->silence_ns)
        spoil(source, FV_HEALTH_FAILED, "no frame for %.1f s", seconds(facts->silent_ns));
    else if (facts->source_state > FOVEA_SOURCE_OK && facts->source_state <= FOVEA_SOURCE_RETURNING)
        spoil(source, FV_HEALTH_DEGRADED, "%s", words[facts->source_state]);
    else if (facts->silent_camera > 0 && facts->camera_silent_ns > facts->silence_ns)
        spoil(source, FV_HEALTH_DEGRADED, "camera %" PRIu32 " gives no images, for %.1f s",
              facts->silent_camera, seconds(facts->camera_silent_ns));
}

static void judge_pose(const struct fv_health_facts *facts, struct fv_health_part *odometry)
{
    const double lasts_s = seconds(facts->pose_ns);
    switch (facts->pose) {
    case FV_WATCH_LOST:
        spoil(odometry, facts->pose_ns > facts->silence_ns ? FV_HEALTH_FAILED : FV_HEALTH_DEGRADED,
              "lost for %.1f s", lasts_s);
        break;
    case FV_WATCH_WEAK:
    case FV_WATCH_COASTING:
    case FV_WATCH_PAUSED:
        spoil(odometry, FV_HEALTH_DEGRADED, "%s for %.1f s", fv_watch_name(facts->pose), lasts_s);
        break;
    case FV_WATCH_STARTING:
        if (facts->pose_ns > starting_ns)
            spoil(odometry, FV_HEALTH_DEGRADED, "no map after %.1f s", lasts_s);
        break;
    default:
        break;
    }
    if (odometry->state != FV_HEALTH_OK || facts->calibration == FOVEA_CALIBRATION_OK) return;
    spoil(odometry, FV_HEALTH_DEGRADED, "the calibration %s",
          facts->calibration == FOVEA_CALIBRATION_WRONG ? "does not fit the pictures"
                                                        : "may not fit the pictures");
}

static void judge_host(const struct fv_health_facts *facts, struct fv_health_part *host)
{
    const struct fv_host *h = &facts->host;
    const uint32_t cut = FV_HOST_CAPPED | FV_HOST_THROTTLED | FV_HOST_SOFT_LIMIT;
    char done[48] = "";
    if (facts->share < FV_HOST_SHARE_MAX)
        snprintf(done, sizeof done, "; work is kept to %u %% of the period", facts->share);
    if ((h->throttled & cut) != 0)
        spoil(host, FV_HEALTH_DEGRADED, "the system throttles the processor%s%s",
              (h->throttled & FV_HOST_UNDER_VOLTAGE) != 0 ? ", its voltage is low" : "", done);
    else if (facts->share < FV_HOST_SHARE_MAX)
        spoil(host, FV_HEALTH_DEGRADED, "%.1f degrees, the limit is %.1f%s",
              (double)h->temperature_c, (double)fv_host_limit_c(h, facts->heat_limit_c), done);
    else if ((h->throttled & FV_HOST_UNDER_VOLTAGE) != 0)
        spoil(host, FV_HEALTH_DEGRADED, "the voltage is low");
}

/* What goes out: messages and the recording. */
static void judge_outputs(const struct fv_health_facts *facts, struct fv_health *health)
{
    if (facts->publishes) {
        struct fv_health_part *publisher = part(health, "publisher");
        if (!facts->sends)
            spoil(publisher, FV_HEALTH_FAILED, "no message can be sent");
        else if (facts->unsent > 0 && facts->sent_ns > facts->silence_ns)
            spoil(publisher, FV_HEALTH_FAILED, "no message has left for %.1f s",
                  1e-9 * (double)facts->sent_ns);
        else if (facts->unsent > 0)
            spoil(publisher, FV_HEALTH_DEGRADED, "%llu messages were not sent",
                  (unsigned long long)facts->unsent);
    }
    if (!facts->records) return;
    struct fv_health_part *recorder = part(health, "recorder");
    if (facts->recording_ended)
        spoil(recorder, FV_HEALTH_FAILED, "the recording has ended, the run goes on");
}

void fv_health_judge(const struct fv_health_facts *facts, struct fv_health *health)
{
    struct fv_health_part *at;
    memset(health, 0, sizeof *health);
    at = part(health, "self_test");
    if (facts->self_test[0] != '\0') spoil(at, FV_HEALTH_FAILED, "%s", facts->self_test);
    judge_source(facts, part(health, "source"));
    if (facts->imu_state != FOVEA_IMU_NONE) {
        at = part(health, "imu");
        if (facts->imu_state != FOVEA_IMU_OK)
            spoil(at, FV_HEALTH_DEGRADED, "%s",
                  fovea_imu_state_name((enum fovea_imu_state)facts->imu_state));
    }
    if (facts->pose != FV_WATCH_RUNNING) judge_pose(facts, part(health, "odometry"));
    if (facts->has_network) {
        at = part(health, "network");
        if (facts->inferences > 0 && facts->inference_ns > inference_ns &&
            facts->silent_ns <= facts->silence_ns)
            spoil(at, FV_HEALTH_DEGRADED, "no inference for %.1f s", seconds(facts->inference_ns));
    }
    at = part(health, "loop");
    if (facts->stood_ns > facts->silence_ns)
        spoil(at, FV_HEALTH_FAILED, "no step has ended for %.1f s", seconds(facts->stood_ns));
    else if (facts->late > 0)
        spoil(at, FV_HEALTH_DEGRADED, "%llu frames came too late and were dropped",
              (unsigned long long)facts->late);
    judge_outputs(facts, health);
    at = part(health, "memory");
    if (facts->unlocked[0] != '\0') spoil(at, FV_HEALTH_DEGRADED, "%s", facts->unlocked);
    judge_host(facts, part(health, "host"));
}

enum fv_health_state fv_health_worst(const struct fv_health *health)
{
    enum fv_health_state worst = FV_HEALTH_OK;
    for (uint32_t i = 0; i < health->count; i++)
        if (health->parts[i].state > worst) worst = health->parts[i].state;
    return worst;
}

bool fv_health_differs(const struct fv_health *a, const struct fv_health *b)
{
    bool differs = a->count != b->count;
    for (uint32_t i = 0; i < a->count && !differs; i++)
        differs = a->parts[i].state != b->parts[i].state;
    return differs;
}
