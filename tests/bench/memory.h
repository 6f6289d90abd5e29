/* Memory of stages for benchmarks: carved from a vector, freed with it. */
#ifndef FOVEA_TESTS_BENCH_MEMORY_H
#define FOVEA_TESTS_BENCH_MEMORY_H

#include <functional>
#include <memory>
#include <vector>

#include <opencv2/core.hpp>

#include "base/arena.h"
#include "image/pyramid.h"

namespace bench
{

/* Run a carving function twice: to count, and on memory of that size. */
class Block
{
  public:
    explicit Block(const std::function<void(struct fv_arena *)> &carve)
    {
        struct fv_arena arena;
        fv_arena_count(&arena);
        carve(&arena);
        memory.resize(arena.used + 64);
        const auto address = reinterpret_cast<uintptr_t>(memory.data());
        fv_arena_init(&arena, memory.data() + (64 - address % 64) % 64, memory.size() - 64);
        carve(&arena);
    }

  private:
    std::vector<uint8_t> memory;
};

inline struct fv_plane plane(const cv::Mat &grey)
{
    return fv_plane_of(grey.data, grey.cols, grey.rows, static_cast<int32_t>(grey.step));
}

struct Pyramid {
    cv::Mat image;
    struct fovea_image frame;
    struct fv_pyramid pyramid;
    Block block;

    Pyramid(const cv::Mat &grey, uint32_t levels)
        : image(grey), frame{grey.data,         grey.cols,
                             grey.rows,         static_cast<int32_t>(grey.step),
                             FOVEA_PIXEL_GREY8, grey.step * static_cast<size_t>(grey.rows)},
          pyramid(), block([&](struct fv_arena *arena) {
              fv_pyramid_carve(&pyramid, grey.cols, grey.rows, levels, arena);
          })
    {
    }
    Pyramid(const Pyramid &) = delete;
    Pyramid &operator=(const Pyramid &) = delete;
};

} // namespace bench

#endif
