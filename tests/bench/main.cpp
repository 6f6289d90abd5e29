/* make bench: every stage and kernel beside OpenCV's function. See bench.h.
 *
 *   bench [--program FOVEA] [--json FILE] [--tables FILE] [--commit TEXT] [--compiler TEXT]
 *         [--flags TEXT] [NAME...]
 *
 * With NAMEs only rows whose name contains one of them are run, and no tables are written. */
#include "bench/bench.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "kernels/check.h"
#include "oracle/images.h"

namespace bench
{

std::vector<const Stage *> &stages()
{
    static std::vector<const Stage *> all;
    return all;
}

std::vector<const Peer *> &peers()
{
    static std::vector<const Peer *> all;
    return all;
}

Stage::Stage(const char *name_, const char *size_, const char *peer_,
             std::function<Run(const Input &, const struct fv_kernels &)> ours_,
             std::function<Run(const Input &)> theirs_)
    : name(name_), size(size_), peer(peer_), ours(std::move(ours_)), theirs(std::move(theirs_))
{
    stages().push_back(this);
}

Peer::Peer(const char *kernel_, const char *peer_, std::function<Run(const Input &)> theirs_)
    : kernel(kernel_), peer(peer_), theirs(std::move(theirs_))
{
    peers().push_back(this);
}

static double cpu_us()
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

std::vector<double> measure(const std::vector<Run> &runs)
{
    constexpr double sample_us = 300, budget_us = 400000;
    constexpr size_t samples_max = 61, samples_min = 5;
    std::vector<int> repeats(runs.size(), 1);
    std::vector<std::vector<double>> samples(runs.size());
    for (size_t i = 0; i < runs.size(); i++) {
        runs[i]();
        const double start = cpu_us();
        runs[i]();
        repeats[i] = std::max(1, static_cast<int>(sample_us / std::max(0.5, cpu_us() - start)));
    }
    const double begin = cpu_us();
    while (samples[0].size() < samples_max &&
           (samples[0].size() < samples_min ||
            cpu_us() - begin < budget_us * static_cast<double>(runs.size()))) {
        for (size_t i = 0; i < runs.size(); i++) {
            const double start = cpu_us();
            for (int k = 0; k < repeats[i]; k++)
                runs[i]();
            samples[i].push_back((cpu_us() - start) / repeats[i]);
        }
    }
    std::vector<double> medians;
    for (auto &s : samples) {
        std::nth_element(s.begin(), s.begin() + static_cast<std::ptrdiff_t>(s.size() / 2), s.end());
        medians.push_back(s[s.size() / 2]);
    }
    return medians;
}

} // namespace bench

namespace
{

using bench::Input;
using bench::Result;
using bench::Run;

bool chosen(const std::string &name, const std::vector<std::string> &filter)
{
    return filter.empty() ||
           std::any_of(filter.begin(), filter.end(), [&](const std::string &part) {
               return name.find(part) != std::string::npos;
           });
}

cv::Mat fit(const cv::Mat &image)
{
    cv::Mat grey;
    cv::resize(image, grey, cv::Size(BENCH_WIDTH, BENCH_HEIGHT), 0, 0, cv::INTER_AREA);
    return grey;
}

Input find_input()
{
    const std::vector<std::string> euroc = images_under(data_folder() + "/euroc_mh05_a", 1000);
    if (euroc.size() > 110) {
        const cv::Mat image = cv::imread(euroc[100], cv::IMREAD_GRAYSCALE),
                      next = cv::imread(euroc[102], cv::IMREAD_GRAYSCALE);
        if (image.cols == BENCH_WIDTH && image.rows == BENCH_HEIGHT)
            return {image, next, "EuRoC MH_05, frame 100"};
    }
    const std::string leuven = "/usr/share/doc/opencv-doc/examples/data/leuven";
    const cv::Mat a = cv::imread(leuven + "A.jpg", cv::IMREAD_GRAYSCALE),
                  b = cv::imread(leuven + "B.jpg", cv::IMREAD_GRAYSCALE);
    if (!a.empty() && !b.empty()) return {fit(a), fit(b), "opencv-doc leuvenA, scaled"};
    const cv::Mat made = cv::Mat(BENCH_HEIGHT, BENCH_WIDTH, CV_8U,
                                 const_cast<uint8_t *>(bench_image()), BENCH_STRIDE)
                             .clone();
    return {made, made, "drawn rectangles with noise (no real image found)"};
}

/* Kernel sets to time, best first, C last. */
std::vector<struct fv_kernels> kernel_sets()
{
    std::vector<struct fv_kernels> sets;
    for (int cap = FV_CPU_SET_COUNT - 1; cap >= 0; cap--) {
        struct fv_kernels kernels;
        fv_kernels_init(&kernels, static_cast<enum fv_cpu_set>(cap));
        const bool base = cap == FV_CPU_SSE4 || cap == FV_CPU_NEON || cap == FV_CPU_C;
        if (kernels.set == cap && (base || sets.empty())) sets.push_back(kernels);
    }
    return sets;
}

void report(const Result &r)
{
    std::printf("%-34s %-10s %-10s %10.1f us", r.name.c_str(), r.size.c_str(), r.isa.c_str(),
                r.ours_us);
    if (!r.peer.empty())
        std::printf("  %-32s %10.1f us  ratio %.3f", r.peer.c_str(), r.peer_us,
                    r.ours_us / r.peer_us);
    std::printf("\n");
}

void run_stage(const bench::Stage &stage, const Input &input, std::vector<Result> &results)
{
    const std::vector<struct fv_kernels> sets = kernel_sets();
    std::vector<Run> runs;
    for (const auto &kernels : sets)
        runs.push_back(stage.ours(input, kernels));
    if (stage.theirs) runs.push_back(stage.theirs(input));
    const std::vector<double> us = bench::measure(runs);
    for (size_t i = 0; i < sets.size(); i++) {
        results.push_back({stage.name, stage.size, fv_cpu_set_name(sets[i].set), us[i],
                           stage.theirs ? stage.peer : "", stage.theirs ? us.back() : 0});
        report(results.back());
    }
}

void run_kernel(const std::string &kernel, const Input &input, std::vector<Result> &results)
{
    const bench::Peer *peer = nullptr;
    for (const bench::Peer *p : bench::peers())
        if (p->kernel == kernel) peer = p;
    std::vector<const struct kernel_variant *> variants;
    std::vector<struct check> checks;
    const uint32_t isas = fv_cpu_detect();
    for (int i = 0; i < kernel_variant_count; i++)
        if (kernel == kernel_variants[i].kernel &&
            (kernel_variants[i].bit & isas) == kernel_variants[i].bit)
            variants.push_back(&kernel_variants[i]);
    checks.resize(variants.size());
    std::vector<Run> runs;
    for (size_t i = 0; i < variants.size(); i++) {
        std::memset(&checks[i], 0, sizeof checks[i]);
        checks[i].random = 1;
        checks[i].kernel = variants[i]->kernel;
        checks[i].isa = variants[i]->isa;
        runs.push_back([&checks, &variants, i] { variants[i]->bench(&checks[i]); });
    }
    if (peer != nullptr) runs.push_back(peer->theirs(input));
    const std::vector<double> us = bench::measure(runs);
    for (size_t i = 0; i < variants.size(); i++) {
        const std::string size = checks[i].size[0] != '\0' ? checks[i].size : "752x480";
        results.push_back({kernel, size, variants[i]->isa, us[i],
                           peer != nullptr ? peer->peer : "plain C",
                           peer != nullptr ? us.back() : us[0], true});
        report(results.back());
        check_release(&checks[i]);
    }
}

/* The whole step and frame on a real recording, as the program itself measures them. Several rows
 * without a peer. */
void run_program(const std::string &program, std::vector<Result> &results)
{
    const std::string recording = data_folder() + "/euroc_mh05_a",
                      stats = program + "-bench-stats.json";
    if (!std::filesystem::exists(recording) || !std::filesystem::exists(program)) {
        std::printf("SKIPPED the step on a recording: no %s or no %s\n", recording.c_str(),
                    program.c_str());
        return;
    }
    for (const char *set : {"", "sse4", "neon", "c"}) {
        const std::string command = "FOVEA_CPU=" + std::string(set) + " '" + program +
                                    "' run --source 'euroc:" + recording +
                                    "' --quiet --picture none --stats '" + stats +
                                    "' >/dev/null 2>&1";
        if (std::system(command.c_str()) != 0) continue; /* a set that this processor lacks */
        const cv::FileStorage file(stats, cv::FileStorage::READ | cv::FileStorage::FORMAT_JSON);
        std::filesystem::remove(stats);
        for (const char *part : {"step", "frame"}) {
            const double p50_ns = static_cast<double>(file[part]["p50_ns"]);
            const std::string isa =
                set[0] != '\0' ? set : fv_cpu_set_name(fv_cpu_best(fv_cpu_detect()));
            results.push_back({std::string(part) + ", EuRoC MH_05, median", "752x480", isa,
                               p50_ns * 1e-3, "", 0});
            report(results.back());
        }
    }
    std::stable_sort(results.begin(), results.end(), [](const Result &a, const Result &b) {
        return (a.name.rfind("step", 0) == 0    ? 0
                : a.name.rfind("frame", 0) == 0 ? 1
                                                : 2) < (b.name.rfind("step", 0) == 0    ? 0
                                                        : b.name.rfind("frame", 0) == 0 ? 1
                                                                                        : 2);
    });
}

std::string machine()
{
    std::ifstream info("/proc/cpuinfo");
    for (std::string line; std::getline(info, line);)
        if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
    return "unknown processor";
}

} // namespace

int main(int argc, char **argv)
{
    std::map<std::string, std::string> options;
    std::vector<std::string> filter;
    for (int i = 1; i < argc; i++) {
        if (std::strncmp(argv[i], "--", 2) == 0 && i + 1 < argc) {
            options[argv[i] + 2] = argv[i + 1];
            i++;
        } else {
            filter.push_back(argv[i]);
        }
    }
    cv::setNumThreads(1);
    const Input input = find_input();
    const bench::Facts facts = {machine(),         options["compiler"], options["flags"],
                                options["commit"], CV_VERSION,          input.origin};
    std::printf("%s; %s; %s; commit %s; OpenCV %s; image: %s\n", facts.machine.c_str(),
                facts.compiler.c_str(), facts.flags.c_str(), facts.commit.c_str(),
                facts.opencv.c_str(), facts.image.c_str());

    bench_image_set(input.image.data, input.image.step);
    std::vector<Result> results;
    for (const bench::Stage *stage : bench::stages())
        if (chosen(stage->name, filter)) run_stage(*stage, input, results);
    for (int i = 0; i < kernel_variant_count; i++)
        if (kernel_variants[i].bit == 0 && chosen(kernel_variants[i].kernel, filter))
            run_kernel(kernel_variants[i].kernel, input, results);

    if (chosen("step and work", filter)) {
        const size_t before = results.size();
        bench::run_odometry(results);
        std::for_each(results.begin() + static_cast<std::ptrdiff_t>(before), results.end(), report);
    }
    if (options.count("program") && filter.empty()) run_program(options["program"], results);
    if (results.empty()) {
        std::printf("no row of that name\n");
        return 1;
    }
    if (options.count("json") && !bench::write_json(options["json"], facts, results)) return 1;
    if (options.count("tables") && filter.empty() &&
        !bench::write_page(options["tables"], facts, results, false))
        return 1;
    if (options.count("kernels") && filter.empty() &&
        !bench::write_page(options["kernels"], facts, results, true))
        return 1;
    return 0;
}
