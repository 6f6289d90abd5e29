#include "app/run/fast_pose.h"

#include <stdio.h>

#include "drivers/clock.h"

void fv_fast_pose_open(struct fv_fast_pose *fast, struct fovea *rt, struct fv_transport *transport,
                       const char *prefix, uint32_t rate_hz)
{
    char channel[FV_TRANSPORT_CHANNEL_BYTES];
    snprintf(channel, sizeof channel, "%s_POSE_FAST", prefix);
    fv_transport_sense(transport, channel);
    pthread_mutex_init(&fast->mutex, NULL);
    fast->rt = rt;
    fast->transport = transport;
    fast->period_ns = FV_SECOND_NS / rate_hz;
    fast->next_ns = 0;
}

/* Whether a message of this stamp goes out. One that comes a little early is due: the stamps of
 * sensors vary. */
static bool due(struct fv_fast_pose *fast, int64_t stamp_ns)
{
    const int64_t early_ns = fast->next_ns - stamp_ns;
    /* The stamps are increasing, and near this clock's. */
    if (early_ns > fast->period_ns / 8 && early_ns <= fast->period_ns) return false;
    fast->next_ns =
        (early_ns > -fast->period_ns && early_ns <= fast->period_ns ? fast->next_ns : stamp_ns) +
        fast->period_ns;
    return true;
}

void fv_fast_pose_take(void *context, const struct fovea_imu_sample *sample)
{
    struct fv_fast_pose *fast = context;
    const struct fovea_sample one = {.kind = FOVEA_SAMPLE_IMU, .imu = *sample};
    struct fovea_outputs outputs;
    pthread_mutex_lock(&fast->mutex);
    if (fast->rt != NULL && fovea_sense(fast->rt, &one, 1, &outputs) == FOVEA_OK &&
        due(fast, sample->stamp_ns))
        fv_transport_publish_sensed(fast->transport, &outputs);
    pthread_mutex_unlock(&fast->mutex);
}

void fv_fast_pose_end(struct fv_fast_pose *fast)
{
    if (fast->period_ns == 0) return;
    pthread_mutex_lock(&fast->mutex);
    fast->rt = NULL;
    pthread_mutex_unlock(&fast->mutex);
}
