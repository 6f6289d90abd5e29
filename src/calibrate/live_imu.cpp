#include "calibrate/live_imu.h"

#include <cmath>
#include <cstring>

#include "calibrate/heard.h"
extern "C" {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow" /* it has structs and functions of one name */
#include "app/network/heard_imu.h"
#include "drivers/iio/iio.h"
#pragma GCC diagnostic pop
}

namespace calibrate
{
namespace
{

/* What follows the scheme; nullptr: it has another. */
const char *behind(const std::string &text, const char *scheme)
{
    const size_t length = std::strlen(scheme);
    return text.compare(0, length, scheme) == 0 && text.size() > length ? text.c_str() + length
                                                                        : nullptr;
}

} // namespace

void append_sample(const fovea_imu_sample &sample, std::vector<fovea_imu_sample> &samples)
{
    for (int i = 0; i < 3; i++)
        if (!std::isfinite(sample.gyro[i]) || !std::isfinite(sample.acceleration[i])) return;
    if (samples.empty() || sample.stamp_ns > samples.back().stamp_ns) samples.push_back(sample);
}

bool live_imu_valid(const std::string &sensor)
{
    return behind(sensor, "iio:") != nullptr || behind(sensor, "lcm:") != nullptr;
}

struct LiveImu::Parts {
    Heard heard;
    std::vector<fv_heard_imu> messages;
    int no_clock = 0;
    fv_iio *iio = nullptr;
    bool is_open = false;

    ~Parts()
    {
        if (iio != nullptr) fv_iio_close(iio);
    }
};

LiveImu::LiveImu() : parts_(new Parts)
{
}

LiveImu::~LiveImu() = default;

fovea_status LiveImu::open(const LiveImuSetup &setup, fovea_error *error)
{
    Parts &parts = *parts_;
    fovea_status status = FOVEA_OK;
    if (const char *name = behind(setup.sensor, "iio:")) {
        status = fv_iio_open(name, setup.rate_hz, &parts.iio, error);
        if (status == FOVEA_OK) status = fv_iio_start(parts.iio, error);
    } else if (const char *channel = behind(setup.sensor, "lcm:")) {
        status = parts.heard.open(
            setup.lcm_url, setup.listen, channel, "fovea.imu_t",
            [&parts](const fv_received &received) {
                fv_heard_imu message;
                if (fv_heard_imu_decode(&received, &message)) parts.messages.push_back(message);
            },
            error);
    } else {
        return FOVEA_OK;
    }
    parts.is_open = status == FOVEA_OK;
    return status;
}

void LiveImu::take(fovea_clock clock, std::vector<fovea_imu_sample> &samples)
{
    Parts &parts = *parts_;
    if (!parts.is_open) return;
    if (parts.iio != nullptr) {
        const int64_t offset_ns = between_clocks(FOVEA_CLOCK_MONOTONIC, clock);
        while (const fovea_imu_sample *read = fv_iio_peek(parts.iio)) {
            fovea_imu_sample sample = *read;
            sample.stamp_ns += offset_ns;
            append_sample(sample, samples);
            fv_iio_release(parts.iio);
        }
        return;
    }
    parts.heard.handle();
    const int64_t utc_offset_ns = between_clocks(clock, FOVEA_CLOCK_REALTIME);
    for (const fv_heard_imu &message : parts.messages) {
        fovea_imu_sample sample = message.sample;
        if (fv_heard_imu_stamp(&message, clock, utc_offset_ns, &sample.stamp_ns))
            append_sample(sample, samples);
        else
            parts.no_clock++;
    }
    parts.messages.clear();
}

int LiveImu::no_clock() const
{
    return parts_->no_clock;
}

double LiveImu::gyro_range() const
{
    return parts_->iio != nullptr ? fv_iio_info(parts_->iio)->gyro_range : 0;
}

double LiveImu::acceleration_range() const
{
    return parts_->iio != nullptr ? fv_iio_info(parts_->iio)->acceleration_range : 0;
}

} // namespace calibrate
