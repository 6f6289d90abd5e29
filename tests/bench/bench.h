/* Benchmarks beside OpenCV: same real image, one thread, same process, samples interleaved, medians
 * of thread-CPU time.
 *
 * A room adds rows in its own tests/bench/bench_<room>.cpp:
 *
 *     static const bench::Stage pyramid("pyramid, 8 levels", "752x480", "resize x7",
 *         [](const bench::Input &input, const struct fv_kernels &kernels) -> bench::Run {
 *             ... set up with kernels ...
 *             return [=] { what is timed };
 *         },
 *         [](const bench::Input &input) -> bench::Run { ... });
 *     static const bench::Peer mix("grey_mix_u8", "cvtColor RGB2GRAY",
 *         [](const bench::Input &input) -> bench::Run { ... });
 *
 * A Stage is timed with the best kernel set of this processor, with sse4 (or neon) and with plain
 * C. A Peer stands beside a kernel of kernels.def, whose own work is bench_<name> of tests/kernels;
 * kernels without one are compared with plain C. */
#ifndef FOVEA_TESTS_BENCH_BENCH_H
#define FOVEA_TESTS_BENCH_BENCH_H

#include <functional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "kernels/kernels.h"

namespace bench
{

struct Input {
    cv::Mat image;      /* 752x480 grey, real where one was found */
    cv::Mat next;       /* a later image of the same camera, or the same */
    std::string origin; /* where it comes from, for the report */
};

using Run = std::function<void()>;

struct Stage {
    Stage(const char *name, const char *size, const char *peer,
          std::function<Run(const Input &, const struct fv_kernels &)> ours,
          std::function<Run(const Input &)> theirs);
    std::string name, size, peer;
    std::function<Run(const Input &, const struct fv_kernels &)> ours;
    std::function<Run(const Input &)> theirs; /* empty: none */
};

struct Peer {
    Peer(const char *kernel, const char *peer, std::function<Run(const Input &)> theirs);
    std::string kernel, peer;
    std::function<Run(const Input &)> theirs;
};

/* Everything that was added, in order of file and line. */
std::vector<const Stage *> &stages();
std::vector<const Peer *> &peers();

struct Result {
    std::string name, size, isa;
    double ours_us;
    std::string peer; /* "" where there is none */
    double peer_us;
    bool kernel = false; /* a row of kernels.def */
};

/* Time the runs in turn until each has enough samples; medians in microseconds. */
std::vector<double> measure(const std::vector<Run> &runs);

/* Time the whole of a frame on a recording (bench_odometry.cpp), one row per set for the mean and
 * for the 99th percentile. */
void run_odometry(std::vector<Result> &results);

/* Writes of the results: build/bench.json, and tables between the markers of pages: of stages and
 * the whole program in docs/measured.md, of kernels in src/kernels/MEASURED.md. */
struct Facts {
    std::string machine, compiler, flags, commit, opencv, image;
};
bool write_json(const std::string &path, const Facts &facts, const std::vector<Result> &results);
bool write_page(const std::string &path, const Facts &facts, const std::vector<Result> &results,
                bool kernels);

} // namespace bench

#endif
