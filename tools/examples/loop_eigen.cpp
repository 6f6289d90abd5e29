/* loop.c in C++: the runtime as an object, its pose as an Eigen::Isometry3d.
 *
 *     loop_eigen WIDTH HEIGHT FX FY CX CY [RATE_HZ] <frames
 *
 * Each line is "seconds state x y z angle", the angle in degrees since the start; the last line is
 * the length of the path, in the same unit as x y z (docs/frames-and-time.md). */
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <stdexcept>
#include <vector>

#include <Eigen/Geometry>

#include <fovea/fovea.h>

class Runtime
{
  public:
    explicit Runtime(fovea_config config) : config_(config)
    {
        fovea_error error;
        size_t bytes;
        if (fovea_camera_prepare(&config_.rig.cameras[0].camera, &error) != FOVEA_OK ||
            fovea_size(&config_, &bytes, &error) != FOVEA_OK)
            throw std::runtime_error(error.text);
        block_.resize(bytes + FOVEA_BLOCK_ALIGNMENT);
        const auto start = reinterpret_cast<std::uintptr_t>(block_.data());
        const std::uintptr_t skip = -start & (FOVEA_BLOCK_ALIGNMENT - 1);
        if (fovea_init(block_.data() + skip, bytes, &config_, &rt_, &error) != FOVEA_OK)
            throw std::runtime_error(error.text);
    }
    Runtime(const Runtime &) = delete; /* the block holds addresses of itself */
    Runtime &operator=(const Runtime &) = delete;

    fovea_pose step(const fovea_frame &frame)
    {
        fovea_inputs inputs{};
        fovea_outputs outputs;
        fovea_pose pose;
        inputs.frame = &frame;
        inputs.now_ns = frame.stamp_ns;
        fovea_grants_fixed(&config_, &inputs.grants);
        fovea_step(rt_, &inputs, &outputs);
        fovea_pose_get(rt_, &pose);
        fovea_work(rt_, &inputs.grants, &outputs);
        return pose;
    }

  private:
    fovea_config config_;
    std::vector<std::uint8_t> block_;
    fovea *rt_ = nullptr;
};

/* T_world_cam: points of the camera to where the camera was at the start. */
static std::optional<Eigen::Isometry3d> pose_of(const fovea_pose &pose)
{
    if (!pose.posed) return std::nullopt;
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.matrix().topRows<3>() =
        Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(pose.T_world_cam);
    return T;
}

static int run(int argc, char **argv)
{
    static const char *const states[] = {"starting", "tracking", "weak", "lost"};
    fovea_config config;
    fovea_config_default(&config);
    fovea_camera &camera = config.rig.cameras[0].camera;
    camera.width = std::atoi(argv[1]);
    camera.height = std::atoi(argv[2]);
    camera.fx = std::atof(argv[3]);
    camera.fy = std::atof(argv[4]);
    camera.cx = std::atof(argv[5]);
    camera.cy = std::atof(argv[6]);
    Runtime runtime(config);
    std::vector<std::uint8_t> pixels(size_t(camera.width) * size_t(camera.height));
    const double period_s = 1.0 / (argc > 7 ? std::atof(argv[7]) : 30.0);
    std::optional<Eigen::Vector3d> last;
    double length = 0;
    for (unsigned n = 0; std::fread(pixels.data(), 1, pixels.size(), stdin) == pixels.size(); n++) {
        fovea_frame frame{};
        frame.images[0] = {pixels.data(), camera.width,      camera.height,
                           camera.width,  FOVEA_PIXEL_GREY8, pixels.size()};
        frame.image_count = 1;
        frame.stamp_ns = std::int64_t(n * period_s * 1e9);
        frame.clock = FOVEA_CLOCK_RECORDED;
        frame.sequence = n;
        const fovea_pose pose = runtime.step(frame);
        std::printf("%.3f %s", n * period_s, states[pose.state]);
        if (const auto T = pose_of(pose)) {
            const Eigen::Vector3d at = T->translation();
            const double angle = Eigen::AngleAxisd(T->rotation()).angle() * 180 / EIGEN_PI;
            std::printf(" %.6f %.6f %.6f %.3f", at.x(), at.y(), at.z(), angle);
            if (last) length += (at - *last).norm();
            last = at;
        }
        std::printf("\n");
    }
    std::printf("length %.6f\n", length);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc < 7) {
        std::fprintf(stderr, "usage: loop_eigen WIDTH HEIGHT FX FY CX CY [RATE_HZ] <frames\n");
        return 2;
    }
    try {
        return run(argc, argv);
    } catch (const std::exception &problem) {
        std::fprintf(stderr, "loop_eigen: %s\n", problem.what());
        return 2;
    }
}
