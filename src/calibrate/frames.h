/* The frames of any source, and the boards in them. */
#ifndef FOVEA_CALIBRATE_FRAMES_H
#define FOVEA_CALIBRATE_FRAMES_H

#include "calibrate/pictures.h"
#include "fovea/source.h"
#include "kernels/kernels.h"

namespace calibrate
{

/* An open source, or none. */
struct Frames {
    const fovea_source_ops *ops = nullptr;
    fovea_source *source = nullptr;
    Frames() = default;
    Frames(const Frames &) = delete;
    Frames &operator=(const Frames &) = delete;
    ~Frames();
};

fovea_status open_frames(const std::string &uri, Frames &frames, fovea_error *error);

/* Finds the boards in frames. */
class Finder
{
  public:
    /* Of the first `cameras` cameras of a source, 0: of all. */
    Finder(const fovea_source_info &info, size_t cameras, const Board &board,
           Refinement refinement);
    /* FOVEA_ERROR_INPUT: FOVEA_CPU names no processor. */
    fovea_status begin(fovea_error *error);
    /* A frame's views, one of each camera. False: a camera gave no image. */
    bool look(const fovea_frame &frame, std::vector<View> &views);
    Grey image(size_t camera) const; /* of the last frame */
    const std::vector<Collection> &sizes() const
    {
        return sizes_;
    }

  private:
    std::vector<Collection> sizes_; /* without views */
    Board board_;
    Refinement refinement_;
    fv_kernels kernels_ = {};
    std::vector<std::vector<uint8_t>> greys_;
};

} // namespace calibrate
#endif
