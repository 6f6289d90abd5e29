#include "calibrate/heard_poses.h"

#include <algorithm>
#include <cmath>

#include "bot_core_pose_t.h"

namespace calibrate
{
namespace
{

bool is_before(const fv_pose &a, const fv_pose &b)
{
    return a.stamp_ns < b.stamp_ns;
}

bool is_same(const fv_pose &a, const fv_pose &b)
{
    return a.stamp_ns == b.stamp_ns;
}

} // namespace

HeardPoses::~HeardPoses()
{
    end(FOVEA_CLOCK_REALTIME);
}

/* Poses that are none are left out. */
void HeardPoses::take(const fv_received &received)
{
    constexpr double off = .05; /* of the length of a quaternion */
    bot_core_pose_t message;
    if (bot_core_pose_t_decode(received.data, 0, (int)received.bytes, &message) < 0) return;
    fv_pose pose = {};
    double squares = 0;
    bool finite = message.utime > 0 && message.utime < INT64_MAX / 1000;
    pose.stamp_ns = finite ? 1000 * message.utime : 0;
    for (int i = 0; i < 4; i++)
        squares += message.orientation[i] * message.orientation[i];
    for (int i = 0; i < 4; i++)
        pose.rotation_wxyz[i] = message.orientation[i] / std::sqrt(squares);
    for (int i = 0; i < 3; i++) {
        pose.position_m[i] = message.pos[i];
        finite = finite && std::isfinite(message.pos[i]);
    }
    if (finite && std::fabs(std::sqrt(squares) - 1) < off) poses_.push_back(pose);
}

fovea_status HeardPoses::open(const std::string &url, const std::string &listen,
                              const std::string &channel, fovea_error *error)
{
    const fovea_status status = heard_.open(
        url, listen, channel, "bot_core.pose_t",
        [this](const fv_received &received) { take(received); }, error);
    if (status != FOVEA_OK) return status;
    thread_ = std::thread([this] {
        constexpr int patience_ms = 50;
        while (!ended_)
            heard_.handle(patience_ms);
    });
    return FOVEA_OK;
}

std::vector<fv_pose> HeardPoses::end(fovea_clock clock)
{
    ended_ = true;
    if (thread_.joinable()) thread_.join();
    const bool of_host = clock == FOVEA_CLOCK_MONOTONIC || clock == FOVEA_CLOCK_BOOTTIME;
    const int64_t offset_ns = of_host ? between_clocks(FOVEA_CLOCK_REALTIME, clock) : 0;
    std::vector<fv_pose> poses = poses_;
    std::sort(poses.begin(), poses.end(), is_before);
    poses.erase(std::unique(poses.begin(), poses.end(), is_same), poses.end());
    for (fv_pose &pose : poses)
        pose.stamp_ns += offset_ns;
    return poses;
}

} // namespace calibrate
