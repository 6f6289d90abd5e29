#include "calibrate/frames.h"

#include "app/network/feed_source.h"
#include "drivers/table.h"
#include "image/grey.h"
#include "kernels/cpu.h"

namespace calibrate
{

Frames::~Frames()
{
    if (source != nullptr) ops->close(source);
}

fovea_status open_frames(const std::string &uri, Frames &frames, fovea_error *error)
{
    const char *address;
    fovea_status status = FOVEA_OK;
    if (uri.compare(0, 5, "feed:") == 0) { /* of a run, which keeps its camera */
        frames.ops = &fv_source_feed;
        address = uri.c_str() + 5;
    } else {
        status = fv_source_find(uri.c_str(), &frames.ops, &address, error);
    }
    if (status != FOVEA_OK) return status;
    fovea_source_selection selection = {};
    selection.step = 1;
    selection.camera_given = true;
    return frames.ops->open(address, &selection, &frames.source, error);
}

Finder::Finder(const fovea_source_info &info, size_t cameras, const Board &board,
               Refinement refinement)
    : sizes_(cameras > 0 ? cameras : info.rig.camera_count), board_(board), refinement_(refinement),
      greys_(sizes_.size())
{
    for (size_t k = 0; k < sizes_.size(); k++) {
        sizes_[k].width = info.cameras[k].width;
        sizes_[k].height = info.cameras[k].height;
    }
}

fovea_status Finder::begin(fovea_error *error)
{
    fv_cpu_set set;
    const fovea_status status = fv_cpu_from_environment(&set, error);
    if (status == FOVEA_OK) fv_kernels_init(&kernels_, set);
    return status;
}

Grey Finder::image(size_t camera) const
{
    const Collection &size = sizes_[camera];
    return {greys_[camera].data(), size.width, size.height, size.width};
}

bool Finder::look(const fovea_frame &frame, std::vector<View> &views)
{
    bool all = true;
    views.assign(sizes_.size(), View());
    for (size_t k = 0; k < sizes_.size(); k++) {
        const int width = sizes_[k].width, height = sizes_[k].height;
        greys_[k].resize((size_t)width * (size_t)height);
        const fv_plane plane = {greys_[k].data(), width, height, width};
        if (frame.images[k].data != nullptr)
            fv_grey_convert(&plane, &kernels_, &frame.images[k]);
        else
            all = false;
    }
    if (!all) return false;
    for (size_t k = 0; k < sizes_.size(); k++) {
        views[k].name = "frame " + std::to_string(frame.sequence);
        views[k].stamp_ns = frame.stamp_ns + frame.offset_ns[k];
        detect_board(image(k), board_, refinement_, views[k]);
    }
    return true;
}

} // namespace calibrate
