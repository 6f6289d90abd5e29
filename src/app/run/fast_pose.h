/* Poses between frames, for controllers: each sample of a live inertial sensor carries the last
 * pose on and goes out as fast_pose_t, on the thread that brought it (IIO's or the receiver's). So
 * it is under way some microseconds after the sample, also while the loop works on a frame.
 *
 * The samples are the step's inputs all the same (imu_input.h): nothing here is recorded, and no
 * result of a step depends on it. */
#ifndef FOVEA_APP_RUN_FAST_POSE_H
#define FOVEA_APP_RUN_FAST_POSE_H

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#include "app/network/transport.h"
#include "fovea/fovea.h"

struct fv_fast_pose {
    struct fovea *rt; /* NULL: not open, or ended */
    struct fv_transport *transport;
    int64_t period_ns;     /* at least, from message to message */
    int64_t next_ns;       /* stamp from which the next one is due */
    pthread_mutex_t mutex; /* between the samples' thread and the end */
};

/* In zeroed memory. Send at most `rate_hz`, 1 to 1,000, on <prefix>_POSE_FAST. Init-only. */
void fv_fast_pose_open(struct fv_fast_pose *fast, struct fovea *rt, struct fv_transport *transport,
                       const char *prefix, uint32_t rate_hz);

/* Whether a message of this stamp goes out; if so, the next one is due a period later. One that
 * comes up to an eighth of a period early is due, since the stamps of sensors vary: so the rate is
 * kept. After a gap, or when the stamps go back by more than a period, the rate begins again at
 * this stamp. */
bool fv_fast_pose_due(struct fv_fast_pose *fast, int64_t stamp_ns);

/* The next sample, its stamp on the frames' clock; `context` is a struct fv_fast_pose. From one
 * thread, on which it may wait for the end alone. */
void fv_fast_pose_take(void *context, const struct fovea_imu_sample *sample);

/* Nothing is sent afterwards, and neither runtime nor transport is touched. Also where it was never
 * opened, and again. */
void fv_fast_pose_end(struct fv_fast_pose *fast);

#endif
