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
    std::string sensor; /* iio:NAME or lcm:CHANNEL; empty: there is none */
    std::string lcm_url, listen;
    double rate_hz = 0; /* asked of a device; 0: as it is */
};

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
    double gyro_range() const; /* 0: not known */
    double acceleration_range() const;

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

} // namespace calibrate
#endif
