/* Mean thread-CPU time (ms) of cv::ORB::detectAndCompute over images given as files; usage: orb_time FEATURES FILE... */
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>

#include <cstdio>
#include <cstdlib>
#include <ctime>

static double now_ms()
{
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

int main(int argc, char **argv)
{
    double sum = 0;
    int images = 0;
    if (argc < 3) return 2;
    cv::setNumThreads(1);
    const cv::Ptr<cv::ORB> orb = cv::ORB::create(std::atoi(argv[1]));
    for (int i = 2; i < argc; i++) {
        const cv::Mat image = cv::imread(argv[i], cv::IMREAD_GRAYSCALE);
        if (image.empty()) return 2;
        for (int round = 0; round < 3; round++) { /* the first one warms caches up */
            std::vector<cv::KeyPoint> points;
            cv::Mat descriptors;
            const double begin = now_ms();
            orb->detectAndCompute(image, cv::noArray(), points, descriptors);
            if (round > 0) sum += now_ms() - begin;
            images += round > 0;
        }
    }
    std::printf("%.4f\n", sum / images);
}
