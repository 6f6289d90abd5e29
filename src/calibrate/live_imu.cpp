#include "calibrate/live_imu.h"

#include <cmath>
#include <cstring>
#include <list>

#include "calibrate/heard.h"
extern "C" {
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow" /* it has structs and functions of one name */
#include "drivers/iio/iio.h"
#pragma GCC diagnostic pop
}

#include "fovea_imu_t.h"

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

bool is_finite(const fovea_imu_sample &sample)
{
    bool finite = true;
    for (int i = 0; i < 3; i++)
        finite = finite && std::isfinite(sample.gyro[i]) && std::isfinite(sample.acceleration[i]);
    return finite;
}

} // namespace

bool live_imu_valid(const std::string &sensor)
{
    return behind(sensor, "iio:") != nullptr || behind(sensor, "lcm:") != nullptr;
}

struct LiveImu::Parts {
    struct Message {
        fovea_imu_sample sample;
        int clock;
        int64_t utc_offset_ns;
    };
    Heard heard;
    std::list<Message> messages;
    fv_iio *iio = nullptr;
    bool is_open = false;

    ~Parts()
    {
        if (iio != nullptr) fv_iio_close(iio);
    }
    void take_message(const uint8_t *data, uint32_t bytes)
    {
        fovea_imu_t message;
        if (fovea_imu_t_decode(data, 0, (int)bytes, &message) < 0) return;
        Message taken = {{}, message.stamp.clock, message.stamp.utc_offset_ns};
        taken.sample.stamp_ns = message.stamp.time_ns;
        std::copy(message.gyro, message.gyro + 3, taken.sample.gyro);
        std::copy(message.acceleration, message.acceleration + 3, taken.sample.acceleration);
        messages.push_back(taken);
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
            [&parts](const uint8_t *data, uint32_t bytes) { parts.take_message(data, bytes); },
            error);
    } else {
        return FOVEA_OK;
    }
    parts.is_open = status == FOVEA_OK;
    return status;
}

/* A stamp by LCM counts as it is where it states the frames' own clock; else by its UTC, where it
 * states that. */
void LiveImu::take(fovea_clock clock, std::vector<fovea_imu_sample> &samples)
{
    Parts &parts = *parts_;
    const auto append = [&](fovea_imu_sample sample, int64_t offset_ns) {
        sample.stamp_ns += offset_ns;
        if (is_finite(sample) && (samples.empty() || sample.stamp_ns > samples.back().stamp_ns))
            samples.push_back(sample);
    };
    if (!parts.is_open) return;
    if (parts.iio != nullptr) {
        const int64_t offset_ns = between_clocks(FOVEA_CLOCK_MONOTONIC, clock);
        while (const fovea_imu_sample *sample = fv_iio_peek(parts.iio)) {
            append(*sample, offset_ns);
            fv_iio_release(parts.iio);
        }
        return;
    }
    parts.heard.handle();
    for (const Parts::Message &message : parts.messages)
        append(message.sample,
               message.clock == clock || message.utc_offset_ns == 0
                   ? 0
                   : message.utc_offset_ns + between_clocks(FOVEA_CLOCK_REALTIME, clock));
    parts.messages.clear();
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
