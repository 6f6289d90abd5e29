#include "app/run/fast_pose.h"

#include <stdio.h>

#include "drivers/clock.h"

void fv_fast_pose_open(struct fv_fast_pose *fast, struct fovea *rt, struct fv_transport *transport,
                       const char *prefix, uint32_t rate_hz)
{
    char channel[FV_TRANSPORT_CHANNEL_BYTES];
    snprintf(channel, sizeof channel, "%s_POSE_FAST", prefix);
    fv_transport_reserve(transport, FV_TRANSPORT_SENSOR, channel);
    pthread_mutex_init(&fast->mutex, NULL);
    fast->rt = rt;
    fast->transport = transport;
    fast->period_ns = FV_SECOND_NS / rate_hz;
    fast->next_ns = 0;
}

bool fv_fast_pose_due(struct fv_fast_pose *fast, int64_t stamp_ns)
{
    const int64_t early_ns = fast->next_ns - stamp_ns, period_ns = fast->period_ns;
    if (early_ns > period_ns / 8 && early_ns <= period_ns) return false;
    const bool on_time = early_ns > -period_ns && early_ns <= period_ns;
    fast->next_ns = (on_time ? fast->next_ns : stamp_ns) + period_ns;
    return true;
}

void fv_fast_pose_take(void *context, const struct fovea_imu_sample *sample)
{
    struct fv_fast_pose *fast = context;
    const struct fovea_sample one = {.kind = FOVEA_SAMPLE_IMU, .imu = *sample};
    struct fovea_outputs outputs;
    pthread_mutex_lock(&fast->mutex);
    if (fast->rt != NULL && fovea_sense(fast->rt, &one, 1, &outputs) == FOVEA_OK &&
        fv_fast_pose_due(fast, sample->stamp_ns))
        fv_transport_put_from(fast->transport, FV_TRANSPORT_SENSOR, &outputs.messages[0]);
    pthread_mutex_unlock(&fast->mutex);
}

void fv_fast_pose_end(struct fv_fast_pose *fast)
{
    if (fast->period_ns == 0) return;
    pthread_mutex_lock(&fast->mutex);
    fast->rt = NULL;
    pthread_mutex_unlock(&fast->mutex);
}
