/* The whole of a frame (pyramid, features, pose, map) on a real recording, from its first frame on,
 * start included, beside cv::ORB on the same images: every frame goes through all kernel sets and
 * OpenCV in turn. */
#include "bench/bench.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>

#include <opencv2/features2d.hpp>

#include "fovea/fovea.h"
#include "drivers/table.h"
#include "fovea/source.h"
#include "oracle/images.h"

namespace bench
{
namespace
{

double cpu_us()
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

struct Free {
    void operator()(struct fovea *rt) const
    {
        std::free(rt);
    }
};

/* A runtime of default configuration held to a kernel set ("": the best), and what its frames took.
 */
struct Contender {
    std::string set;
    std::unique_ptr<struct fovea, Free> rt;
    std::vector<double> us;
    double features = 0;
};

bool build(const struct fovea_config &config, Contender &c)
{
    struct fovea_error error;
    struct fovea *rt = nullptr;
    size_t bytes;
    if (fovea_size(&config, &bytes, &error) != FOVEA_OK) return false;
    void *memory = std::aligned_alloc(FOVEA_BLOCK_ALIGNMENT, (bytes + 63) / 64 * 64);
    setenv("FOVEA_CPU", c.set.c_str(), 1);
    const bool built = fovea_init(memory, bytes, &config, &rt, &error) == FOVEA_OK;
    unsetenv("FOVEA_CPU");
    if (!built) { /* a set that this processor lacks */
        std::free(memory);
        return false;
    }
    c.set = fovea_cpu_name(rt);
    c.rt.reset(rt);
    return true;
}

void process(const struct fovea_config &config, const struct fovea_frame &frame, Contender &c)
{
    struct fovea_inputs inputs = {};
    struct fovea_outputs outputs;
    uint32_t count;
    inputs.frame = &frame;
    inputs.now_ns = frame.stamp_ns;
    fovea_grants_fixed(&config, &inputs.grants);
    const double start = cpu_us();
    (void)fovea_step(c.rt.get(), &inputs, &outputs);
    (void)fovea_work(c.rt.get(), &inputs.grants, &outputs);
    c.us.push_back(cpu_us() - start);
    (void)fovea_features_get(c.rt.get(), &count);
    c.features += count;
}

double mean(const std::vector<double> &values)
{
    double sum = 0;
    for (double v : values)
        sum += v;
    return sum / static_cast<double>(values.size());
}

double p99(std::vector<double> values)
{
    std::sort(values.begin(), values.end());
    return values[values.size() * 99 / 100];
}

/* Rows for one recording with a number of features. */
void run_recording(const char *title, const std::string &uri, uint32_t features,
                   std::vector<Result> &results)
{
    const struct fovea_source_ops *ops;
    const char *address;
    struct fovea_error error;
    struct fovea_source *source;
    struct fovea_source_selection all_frames = {};
    all_frames.step = 1;
    if (fv_source_find(uri.c_str(), &ops, &address, &error) != FOVEA_OK ||
        ops->open(address, &all_frames, &source, &error) != FOVEA_OK ||
        ops->start(source, &error) != FOVEA_OK) {
        std::printf("SKIPPED the odometry on a recording: %s\n", error.text);
        return;
    }
    struct fovea_config config;
    fovea_config_default(&config);
    config.rig.cameras[0].camera = ops->info(source)->rig.cameras[0].camera;
    config.features.count_max = features;
    std::vector<Contender> all;
    for (const char *set : {"", "sse4", "neon"}) {
        Contender c;
        c.set = set;
        if (build(config, c)) all.push_back(std::move(c));
    }
    const cv::Ptr<cv::ORB> orb = cv::ORB::create(static_cast<int>(features));
    std::vector<double> orb_us;
    for (struct fovea_frame frame; ops->dequeue(source, INT64_MAX, &frame) == FOVEA_OK;
         ops->requeue(source, &frame)) {
        for (Contender &c : all)
            process(config, frame, c);
        const cv::Mat image(frame.images[0].height, frame.images[0].width, CV_8U,
                            const_cast<uint8_t *>(frame.images[0].data),
                            static_cast<size_t>(frame.images[0].stride_bytes));
        std::vector<cv::KeyPoint> points;
        cv::Mat descriptors;
        const double start = cpu_us();
        orb->detectAndCompute(image, cv::noArray(), points, descriptors);
        orb_us.push_back(cpu_us() - start);
    }
    const std::string pixels = std::to_string(config.rig.cameras[0].camera.width) + "x" +
                               std::to_string(config.rig.cameras[0].camera.height);
    ops->stop(source);
    ops->close(source);
    for (const Contender &c : all) {
        const int used = static_cast<int>(c.features / static_cast<double>(c.us.size()));
        const std::string size = pixels + ", " + std::to_string(used) + " features",
                          name = std::string("step and work, ") + title;
        results.push_back({name + ", mean", size, c.set, mean(c.us), "ORB::detectAndCompute, mean",
                           mean(orb_us)});
        results.push_back(
            {name + ", p99", size, c.set, p99(c.us), "ORB::detectAndCompute, mean", mean(orb_us)});
    }
}

} // namespace

void run_odometry(std::vector<Result> &results)
{
    run_recording("EuRoC MH_05", "euroc:" + data_folder() + "/euroc_mh05_a", 1000, results);
    run_recording("KITTI 00", "kitti:" + data_folder() + "/kitti00_a", 2000, results);
}

} // namespace bench
