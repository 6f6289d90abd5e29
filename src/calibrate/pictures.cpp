#include "calibrate/pictures.h"

#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <dirent.h>
#include <map>
#include <sys/stat.h>

#include "drivers/table.h"
#include "fovea/source.h"
#include "image/grey.h"
#include "kernels/cpu.h"
extern "C" {
#include "support/picture.h"
#include "support/say.h"
}

namespace calibrate
{
namespace
{

volatile std::sig_atomic_t interrupted;

void on_signal(int)
{
    interrupted = 1;
}

int is_picture(const dirent *entry)
{
    const char *dot = std::strrchr(entry->d_name, '.');
    if (dot == nullptr || entry->d_name[0] == '.') return 0;
    for (const char *extension : {".png", ".jpg", ".jpeg"})
        if (strcasecmp(dot, extension) == 0) return 1;
    return 0;
}

Thumbnail thumbnail_of(const Grey &image)
{
    constexpr int width_max = 240;
    Thumbnail small;
    const int n = small.reduction = (image.width + width_max - 1) / width_max;
    small.width = image.width / n;
    small.height = image.height / n;
    for (int y = 0; y < small.height; y++) {
        for (int x = 0; x < small.width; x++) {
            int sum = 0;
            for (int i = 0; i < n * n; i++)
                sum +=
                    image.pixels[(ptrdiff_t)(y * n + i / n) * image.stride_bytes + x * n + i % n];
            small.grey.push_back((uint8_t)(sum / (n * n)));
        }
    }
    return small;
}

/* What is only worth its time for a picture that becomes a view. */
void take(const Grey &image, const Board &board, View &view)
{
    explain_board(image, board, view);
    view.width = image.width;
    view.height = image.height;
    view.thumbnail = thumbnail_of(image);
}

fovea_status collect_folder(const std::string &folder, const Board &board, Refinement refinement,
                            Collection &collection, fovea_error *error)
{
    dirent **entries;
    const int count = scandir(folder.c_str(), &entries, is_picture, versionsort);
    if (count < 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT, "%.300s: %s", folder.c_str(),
                               std::strerror(errno));
    for (int i = 0; i < count; i++) {
        View view;
        view.name = entries[i]->d_name;
        std::free(entries[i]);
        fovea_image image;
        fovea_error why;
        if (fv_say_terminal()) fv_say_status("picture %d of %d", i + 1, count);
        if (fv_picture_read((folder + "/" + view.name).c_str(), &image, &why) == FOVEA_OK) {
            view = view_of({image.data, image.width, image.height, image.stride_bytes}, board,
                           refinement, view.name);
            std::free(const_cast<uint8_t *>(image.data));
        } else {
            view.left_out = why.text;
        }
        collection.views.push_back(view);
    }
    std::free(entries);
    if (fv_say_terminal()) fv_say_status("%s", "");
    if (count == 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: found no picture in it, expected PNG or JPEG files",
                               folder.c_str());
    choose_size(collection);
    return FOVEA_OK;
}

/* Over the corners that both see; infinite where there are none. */
double mean_shift(const View &a, const View &b)
{
    double sum = 0;
    int count = 0;
    for (size_t i = 0; i < a.corners.size() && i < b.corners.size(); i++) {
        if (!seen(a.corners[i]) || !seen(b.corners[i])) continue;
        sum += std::hypot(a.corners[i][0] - b.corners[i][0], a.corners[i][1] - b.corners[i][1]);
        count++;
    }
    return count > 0 ? sum / count : INFINITY;
}

/* Whether a frame's board is worth a view: elsewhere than in all views so far and, where frames
 * come by the clock, where it was in the frame before. */
struct Chooser {
    static constexpr double NEW_SHARE = .04, STILL_PX = 1;
    bool live;
    View before = {};
    bool takes(const View &view, const Collection &collection)
    {
        const bool still = !live || mean_shift(before, view) < STILL_PX;
        before = view;
        if (!view.left_out.empty() || !still) return false;
        for (const View &other : collection.views)
            if (mean_shift(other, view) < NEW_SHARE * collection.width) return false;
        return true;
    }
};

struct Frames {
    const fovea_source_ops *ops = nullptr;
    fovea_source *source = nullptr;
    ~Frames()
    {
        if (source != nullptr) ops->close(source);
    }
};

fovea_status open_source(const std::string &uri, Frames &frames, fovea_error *error)
{
    const char *address;
    fovea_status status = fv_source_find(uri.c_str(), &frames.ops, &address, error);
    if (status != FOVEA_OK) return status;
    fovea_source_selection selection = {};
    selection.step = 1;
    selection.camera_given = true;
    return frames.ops->open(address, &selection, &frames.source, error);
}

fovea_status collect_source(const std::string &uri, const Board &board, Refinement refinement,
                            int views_max, Collection &collection, fovea_error *error)
{
    Frames frames;
    fv_cpu_set set;
    fv_kernels kernels;
    fovea_status status = open_source(uri, frames, error);
    if (status == FOVEA_OK) status = fv_cpu_from_environment(&set, error);
    if (status == FOVEA_OK) status = frames.ops->start(frames.source, error);
    if (status != FOVEA_OK) return status;
    fv_kernels_init(&kernels, set);
    const fovea_source_info *info = frames.ops->info(frames.source);
    const auto &size = info->cameras[0];
    collection.width = size.width;
    collection.height = size.height;
    std::vector<uint8_t> grey((size_t)size.width * (size_t)size.height);
    const fv_plane plane = {grey.data(), size.width, size.height, size.width};
    const bool few = info->frame_count > 0 && info->frame_count <= (uint64_t)views_max;
    Chooser chooser = {info->live};
    uint64_t count = 0;
    std::signal(SIGINT, on_signal);
    while (!interrupted && (int)collection.views.size() < views_max) {
        fovea_frame frame;
        status = frames.ops->dequeue(frames.source, INT64_MAX, &frame);
        if (status == FOVEA_END) break;
        if (status < 0) {
            frames.ops->stop(frames.source);
            return fovea_error_set(error, status, "%.300s: the source failed", uri.c_str());
        }
        if (status != FOVEA_OK) continue;
        if (frame.images[0].data != nullptr) fv_grey_convert(&plane, &kernels, &frame.images[0]);
        const bool there = frame.images[0].data != nullptr;
        View view;
        view.name = "frame " + std::to_string(frame.sequence);
        frames.ops->requeue(frames.source, &frame);
        if (!there) continue;
        const Grey image = {grey.data(), size.width, size.height, size.width};
        detect_board(image, board, refinement, view);
        if (few || chooser.takes(view, collection)) {
            take(image, board, view);
            collection.views.push_back(view);
        }
        count++;
        if (!fv_say_terminal()) continue;
        fv_say_status("frame %llu  %s  %zu of %d pictures", (unsigned long long)count,
                      view.left_out.empty() ? "board" : "no board", collection.views.size(),
                      views_max);
    }
    std::signal(SIGINT, SIG_DFL);
    frames.ops->stop(frames.source);
    if (fv_say_terminal()) fv_say_status("%s", "");
    return FOVEA_OK;
}

} // namespace

View view_of(const Grey &image, const Board &board, Refinement refinement, const std::string &name)
{
    View view;
    view.name = name;
    detect_board(image, board, refinement, view);
    take(image, board, view);
    return view;
}

void choose_size(Collection &collection)
{
    std::map<std::pair<int, int>, int> counts;
    for (const View &view : collection.views)
        if (!view.corners.empty()) counts[{view.width, view.height}]++;
    std::pair<int, int> chosen = {0, 0};
    for (const auto &[size, count] : counts)
        if (chosen.first == 0 || count > counts[chosen]) chosen = size;
    collection.width = chosen.first;
    collection.height = chosen.second;
    for (View &view : collection.views)
        if (std::pair(view.width, view.height) != chosen && view.left_out.empty())
            view.left_out = "its size is " + std::to_string(view.width) + " x " +
                            std::to_string(view.height) + ", the others' " +
                            std::to_string(chosen.first) + " x " + std::to_string(chosen.second);
}

fovea_status collect(const std::string &source, const Board &board, Refinement refinement,
                     int views_max, Collection &collection, fovea_error *error)
{
    struct stat about;
    if (stat(source.c_str(), &about) == 0 && S_ISDIR(about.st_mode))
        return collect_folder(source, board, refinement, collection, error);
    return collect_source(source, board, refinement, views_max, collection, error);
}

} // namespace calibrate
