/* Samples of an inertial sensor as LCM brings them (fovea.imu_t), and how their stamps come onto
 * the clock of the frames. */
#ifndef FOVEA_APP_NETWORK_HEARD_IMU_H
#define FOVEA_APP_NETWORK_HEARD_IMU_H

#include "app/network/receiver.h"
#include "fovea/sensor.h"

struct fv_heard_imu {
    struct fovea_imu_sample sample; /* its stamp on `clock` */
    int64_t utc_offset_ns;          /* to add to it for UTC; 0: not known */
    int32_t clock;
    uint32_t from_host;
};

/* Of a message whose row has the type "fovea.imu_t". */
bool fv_heard_imu_decode(const struct fv_received *received, struct fv_heard_imu *heard);

/* The stamp on the frames' clock, to whose stamps `utc_offset_ns` is added for UTC. It counts as it
 * is where the message states that clock and comes from this host; else by its UTC. False: the
 * message states neither. */
bool fv_heard_imu_stamp(const struct fv_heard_imu *heard, int clock, int64_t utc_offset_ns,
                        int64_t *stamp_ns);

#endif
