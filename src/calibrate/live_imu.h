/* An inertial sensor beside a live camera: of Linux IIO, or heard on LCM. */
#ifndef FOVEA_CALIBRATE_LIVE_IMU_H
#define FOVEA_CALIBRATE_LIVE_IMU_H

#include <memory>
#include <string>
#include <vector>

#include "fovea/source.h"

namespace calibrate
{

struct LiveImuSetup {
    std::string sensor;          /* iio:NAME or lcm:CHANNEL; empty: there is none */
    std::string lcm_url, listen; /* as of Heard::open */
    double rate_hz = 0;          /* asked of a device; 0: as it is */
};

/* Append a sample whose numbers are finite and whose stamp is after the last one. */
void append_sample(const fovea_imu_sample &sample, std::vector<fovea_imu_sample> &samples);

/* False: `sensor` is neither. */
bool live_imu_valid(const std::string &sensor);

class LiveImu
{
  public:
    LiveImu();
    LiveImu(const LiveImu &) = delete;
    LiveImu &operator=(const LiveImu &) = delete;
    ~LiveImu();
    fovea_status open(const LiveImuSetup &setup, fovea_error *error);
    /* Append what has come, its stamps on that clock. Often enough that the sockets and rings,
     * which hold seconds, do not overflow. */
    void take(fovea_clock clock, std::vector<fovea_imu_sample> &samples);
    /* How many messages were refused, as they state neither that clock nor their UTC. */
    int no_clock() const;
    double gyro_range() const; /* 0: not known */
    double acceleration_range() const;

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

} // namespace calibrate
#endif
