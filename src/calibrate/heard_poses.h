/* Poses of a robot's body on LCM, while pictures are taken. */
#ifndef FOVEA_CALIBRATE_HEARD_POSES_H
#define FOVEA_CALIBRATE_HEARD_POSES_H

#include <atomic>
#include <thread>
#include <vector>

#include "calibrate/heard.h"
extern "C" {
#include "drivers/recorded/poses.h"
}

namespace calibrate
{

/* Hears a channel of bot_core.pose_t, as robots send it, on a thread of its own. */
class HeardPoses
{
  public:
    HeardPoses() = default;
    HeardPoses(const HeardPoses &) = delete;
    HeardPoses &operator=(const HeardPoses &) = delete;
    ~HeardPoses();
    fovea_status open(const std::string &url, const std::string &listen, const std::string &channel,
                      fovea_error *error);
    /* End hearing. What came, on the clock of the pictures: `utime` is UTC, or already of that
     * clock where it is recorded or simulated. */
    std::vector<fv_pose> end(fovea_clock clock);

  private:
    void take(const fv_received &received);
    Heard heard_;
    std::vector<fv_pose> poses_;
    std::atomic<bool> ended_ = false;
    std::thread thread_;
};

} // namespace calibrate
#endif
