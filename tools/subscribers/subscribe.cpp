/* Listen to Fovea's messages in C++: print each, and at the end how many came on each channel and
 * whether any is missing.
 *
 *     subscribe-cpp [--url URL] [--prefix FOVEA] [--idle SECONDS] [--quiet]
 *
 * As subscribe.c, with the types that lcm-gen makes for C++ and its own handler per type. `make
 * build/subscribe-cpp` builds it; elsewhere, in a folder of its own: lcm-gen -x
 * PREFIX/share/fovea/lcmtypes/[bf]*.lcm && c++ -I. -o subscribe-cpp subscribe.cpp -llcm
 *
 * What subscribe.c says of buffers and of forged packets holds here, too. A decoder of lcm-gen
 * makes room for as many elements as a message says that it has: a damaged one may ask for
 * gigabytes. */
#include <chrono>
#include <cinttypes>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <string>

#include <lcm/lcm-cpp.hpp>

#include "bot_core/pose_t.hpp"
#include "fovea/camera_status_t.hpp"
#include "fovea/detections_t.hpp"
#include "fovea/features_t.hpp"
#include "fovea/map_t.hpp"
#include "fovea/objects_t.hpp"
#include "fovea/pose_t.hpp"
#include "fovea/preview_t.hpp"
#include "fovea/run_t.hpp"
#include "fovea/statistics_t.hpp"

namespace
{

/* ---- one line about a message ---------------------------------------------------------------- */

const char *name_of(const char *const *names, int count, int value)
{
    return value >= 0 && value < count ? names[value] : "unknown";
}

void print(const fovea::pose_t &m)
{
    static const char *const states[] = {"starting", "tracking", "weak",
                                         "lost",     "paused",   "coasting"};
    static const char *const scales[] = {"free", "initialising", "metric"};
    const bool metric = m.scale_state == fovea::pose_t::SCALE_METRIC;
    std::printf("%s, %s in %s: position %.3f %.3f %.3f %s, scale %s, quality %.2f, %d inliers\n",
                name_of(states, 6, m.state), m.child_frame.c_str(), m.parent_frame.c_str(),
                m.position[0], m.position[1], m.position[2], metric ? "m" : "units",
                name_of(scales, 3, m.scale_state), static_cast<double>(m.quality), m.inliers);
}

void print(const fovea::features_t &m)
{
    std::printf("%d of %d features\n", m.count, m.asked);
}

void print(const fovea::camera_status_t &m)
{
    std::printf("state %d, %d x %d %s\n", m.state, m.width, m.height, m.pixel_format.c_str());
}

void print(const fovea::statistics_t &m)
{
    std::printf("%" PRId64 " frames in, %" PRId64 " processed\n", m.frames_in, m.frames_processed);
}

void print(const fovea::preview_t &m)
{
    std::printf("%d x %d, %d bytes of JPEG\n", m.width, m.height, m.size_bytes);
}

void print(const fovea::map_t &m)
{
    std::printf("map %d, %d landmarks and %d keyframes listed\n", m.map_id, m.landmark_count,
                m.keyframe_count);
}

void print(const fovea::detections_t &m)
{
    std::printf("%d objects found by %s", m.count, m.model.c_str());
    for (const fovea::detection_t &found : m.detections)
        std::printf(", %s with %.2f", found.class_name.c_str(), static_cast<double>(found.score));
    std::printf("\n");
}

void print(const fovea::objects_t &m)
{
    std::printf("%d objects\n", m.count);
}

/* ---- channels -------------------------------------------------------------------------------- */

volatile std::sig_atomic_t stop;

/* What came on one channel. Gaps are counted by the frame number. */
struct Channel {
    std::uint64_t messages = 0, bytes = 0, gaps = 0, malformed = 0;
    std::int64_t first = -1, last = -1;

    void count(const lcm::ReceiveBuffer &received, std::int64_t sequence)
    {
        if (messages == 0)
            first = sequence;
        else if (sequence > last + 1)
            gaps += static_cast<std::uint64_t>(sequence - last - 1);
        last = sequence;
        messages++;
        bytes += received.data_size;
    }
};

class Listener
{
  public:
    Listener(lcm::LCM &lcm, const std::string &prefix, bool quiet)
        : lcm_(lcm), prefix_(prefix), quiet_(quiet)
    {
    }

    /* To LCM the channel is a regular expression, in which a dot is any letter. False: no room, or
     * no network. */
    template <class Type> bool listen(const std::string &suffix)
    {
        std::string pattern;
        for (const char c : prefix_)
            pattern += c == '.' ? std::string("\\.") : std::string(1, c);
        lcm::Subscription *subscription =
            lcm_.subscribe(pattern + "_" + suffix, &Listener::take<Type>, this);
        if (subscription == nullptr) return false;
        subscription->setQueueCapacity(1000); /* messages; 30 unless set */
        return true;
    }

    int report() const
    {
        for (const auto &entry : channels_) {
            const Channel &c = entry.second;
            std::printf("%s %" PRIu64 " messages, %" PRIu64 " bytes, frames %" PRId64 " to %" PRId64
                        ", %" PRIu64 " malformed\n",
                        entry.first.c_str(), c.messages, c.bytes, c.first, c.last, c.malformed);
        }
        /* Features come with every frame unless decimated; then gaps are no loss. */
        const auto features = channels_.find("FEATURES");
        if (features == channels_.end()) return 0;
        std::printf("missing %" PRIu64 "\n", features->second.gaps);
        return features->second.gaps > 0 ? 1 : 0;
    }

  private:
    /* No exception may leave it: liblcm, which calls it, is C. */
    template <class Type> void take(const lcm::ReceiveBuffer *received, const std::string &name)
    {
        Channel &channel = channels_[name.substr(prefix_.size() + 1)];
        try {
            Type message;
            if (message.decode(received->data, 0, static_cast<int>(received->data_size)) < 0)
                channel.malformed++;
            else
                handle(channel, *received, name, message);
        } catch (const std::exception &problem) {
            std::fprintf(stderr, "%s: %s\n", name.c_str(), problem.what());
            channel.malformed++;
        }
    }

    template <class Type>
    void handle(Channel &channel, const lcm::ReceiveBuffer &received, const std::string &name,
                const Type &message)
    {
        channel.count(received, message.stamp.sequence);
        if (quiet_) return;
        std::printf("%s: frame %" PRId64 " at %.6f s: ", name.c_str(), message.stamp.sequence,
                    static_cast<double>(message.stamp.time_ns) * 1e-9);
        print(message);
    }

    /* This one knows its time, but not the number of its frame. */
    void handle(Channel &channel, const lcm::ReceiveBuffer &received, const std::string &name,
                const bot_core::pose_t &message)
    {
        channel.count(received, channel.last + 1);
        if (!quiet_)
            std::printf("%s: at %.6f s: position %.3f %.3f %.3f m\n", name.c_str(),
                        static_cast<double>(message.utime) * 1e-6, message.pos[0], message.pos[1],
                        message.pos[2]);
    }

    /* Who sends: printed when it changes, which is a restart or a second sender. */
    void handle(Channel &channel, const lcm::ReceiveBuffer &received, const std::string &name,
                const fovea::run_t &message)
    {
        if (channel.messages == 0 || message.run_id != run_id_)
            std::printf("%s: run %016" PRIx64 " of process %" PRId64 " on %s, Fovea %s%s\n",
                        name.c_str(), static_cast<std::uint64_t>(message.run_id), message.process,
                        message.host.c_str(), message.version.c_str(),
                        channel.messages > 0 ? ": a restart, or another sender" : "");
        run_id_ = message.run_id;
        channel.count(received, channel.last + 1);
    }

    lcm::LCM &lcm_;
    std::string prefix_;
    bool quiet_;
    std::map<std::string, Channel> channels_;
    std::int64_t run_id_ = 0;
};

void on_signal(int)
{
    stop = 1;
}

/* Until asked to stop, or nothing has come for `idle_s` (0: for ever). */
void listen_to(lcm::LCM &lcm, double idle_s)
{
    using Clock = std::chrono::steady_clock;
    Clock::time_point last = Clock::now();
    while (stop == 0 &&
           (idle_s <= 0 || std::chrono::duration<double>(Clock::now() - last).count() < idle_s))
        if (lcm.handleTimeout(100) > 0) last = Clock::now();
}

int usage()
{
    std::fprintf(stderr,
                 "usage: subscribe-cpp [--url URL] [--prefix FOVEA] [--idle SECONDS] [--quiet]\n");
    return 2;
}

} // namespace

int main(int argc, char **argv)
{
    std::string url = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=8388608", prefix = "FOVEA";
    double idle_s = 0;
    bool quiet = false;
    for (int i = 1; i < argc; i++) {
        const std::string option = argv[i];
        if (option == "--quiet")
            quiet = true;
        else if (i + 1 < argc && option == "--url")
            url = argv[++i];
        else if (i + 1 < argc && option == "--prefix")
            prefix = argv[++i];
        else if (i + 1 < argc && option == "--idle")
            idle_s = std::atof(argv[++i]);
        else
            return usage();
    }
    lcm::LCM lcm(url);
    Listener listener(lcm, prefix, quiet);
    if (!lcm.good() || !listener.listen<fovea::pose_t>("POSE") ||
        !listener.listen<fovea::pose_t>("CAMERA_POSE") ||
        !listener.listen<bot_core::pose_t>("BOT_CORE_POSE") ||
        !listener.listen<fovea::features_t>("FEATURES") ||
        !listener.listen<fovea::camera_status_t>("CAMERA_STATUS") ||
        !listener.listen<fovea::statistics_t>("STATISTICS") ||
        !listener.listen<fovea::preview_t>("PREVIEW") || !listener.listen<fovea::map_t>("MAP") ||
        !listener.listen<fovea::detections_t>("DETECTIONS") ||
        !listener.listen<fovea::objects_t>("OBJECTS") || !listener.listen<fovea::run_t>("RUN")) {
        std::fprintf(
            stderr,
            "subscribe-cpp: %s: LCM cannot listen with this URL; 'fovea check' says what is missing\n",
            url.c_str());
        return 1;
    }
    std::signal(SIGINT, on_signal);
    std::signal(SIGTERM, on_signal);
    std::printf("listening\n");
    std::fflush(stdout);
    listen_to(lcm, idle_s);
    return listener.report();
}
