#include "calibrate/pictures.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <dirent.h>
#include <map>
#include <sys/stat.h>

#include "calibrate/frames.h"
#include "drivers/table.h"
#include "support/calibration.h"
#include "support/text.h"
extern "C" {
#include "support/picture.h"
#include "support/say.h"
}

namespace calibrate
{
namespace
{

constexpr int REPORT_WIDTH_MAX = 240; /* of pictures in the report */

volatile std::sig_atomic_t interrupted;

void on_signal(int)
{
    interrupted = 1;
}

int is_picture(const dirent *entry)
{
    const char *dot = std::strrchr(entry->d_name, '.');
    if (dot == nullptr || entry->d_name[0] == '.') return 0;
    for (const char *extension : {".png", ".jpg", ".jpeg", ".bmp"})
        if (strcasecmp(dot, extension) == 0) return 1;
    return 0;
}

/* What is only worth its time for a picture that becomes a view. */
void take(const Grey &image, const Board &board, View &view)
{
    explain_board(image, board, view);
    view.width = image.width;
    view.height = image.height;
    view.thumbnail = thumbnail_of(image, REPORT_WIDTH_MAX);
}

/* Of a file's name in seconds with a point (1305031102.175304.png) or in nanoseconds (16 digits and
 * more); negative: it is none. */
int64_t stamp_of(const std::string &name)
{
    const std::string stem = name.substr(0, name.rfind('.'));
    int64_t stamp_ns, fraction_ns = 0;
    const size_t point = stem.find('.');
    if (stem.find_first_not_of("0123456789.") != std::string::npos) return -1;
    if (point == std::string::npos)
        return stem.size() >= 16 && fv_text_integer(stem.c_str(), &stamp_ns) ? stamp_ns : -1;
    const std::string fraction = (stem.substr(point + 1) + "000000000").substr(0, 9);
    if (!fv_text_integer(stem.substr(0, point).c_str(), &stamp_ns) || stamp_ns > 9000000000 ||
        !fv_text_integer(fraction.c_str(), &fraction_ns))
        return -1;
    return stamp_ns * 1000000000 + fraction_ns;
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
        view.stamp_ns = stamp_of(view.name);
        collection.views.push_back(view);
    }
    std::free(entries);
    if (fv_say_terminal()) fv_say_status("%s", "");
    if (count == 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: found no picture in it, expected PNG, JPEG or BMP files",
                               folder.c_str());
    choose_size(collection);
    return FOVEA_OK;
}

/* Whether a frame's board is worth a view: elsewhere than in all views so far and, where frames
 * come by the clock, where it was in the frame before. */
struct Chooser {
    bool live;
    View before = {};
    bool still(const View &view)
    {
        const bool it_is = !live || mean_shift(before, view) < STILL_PX;
        before = view;
        return it_is;
    }
    static bool is_new(const View &view, const Collection &collection)
    {
        if (!view.left_out.empty()) return false;
        for (const View &other : collection.views)
            if (mean_shift(other, view) < NEW_SHARE * collection.width) return false;
        return true;
    }
};

/* Of several cameras the board must be still in all, and new in one. */
bool is_chosen(std::vector<Chooser> &choosers, const std::vector<View> &views,
               const std::vector<Collection> &collections)
{
    bool still = true, fresh = false;
    int boards = 0;
    for (size_t k = 0; k < views.size(); k++) {
        still &= choosers[k].still(views[k]) || !views[k].left_out.empty();
        fresh |= Chooser::is_new(views[k], collections[k]);
        boards += views[k].left_out.empty();
    }
    return still && fresh && boards >= std::min(2, (int)views.size());
}

/* The guide of one camera, where there is one, and its observer. */
class Guided
{
  public:
    Guided(const Guidance *guidance, const Board &board, const Collection &size, int views_max,
           bool live)
        : guidance_(guidance), views_max_(views_max)
    {
        if (guidance != nullptr)
            guide_.emplace_back(board, guidance->models, size.width, size.height, views_max, live);
    }
    bool is_on() const
    {
        return guidance_ != nullptr;
    }
    bool ended() const
    {
        return is_on() && guide_[0].done();
    }
    /* Whether this frame is taken. */
    bool look(const Grey &image, const View &view)
    {
        advice_ = guide_[0].look(view);
        if (guidance_->observer != nullptr)
            guidance_->observer->frame(image, view, advice_, guide_[0]);
        if (fv_say_terminal())
            fv_say_status("%zu of at most %d pictures  %s  %s", guide_[0].views().size(),
                          views_max_, advice_.take ? "taken" : advice_.trouble.c_str(),
                          advice_.text.c_str());
        return advice_.take;
    }
    void add(const View &view)
    {
        if (!is_on()) return;
        guide_[0].add(view);
        const std::string next = guide_[0].look(View()).text;
        const double focal = 100 * guide_[0].focal_deviation();
        if (!fv_say_terminal() && std::isfinite(focal))
            fv_say("picture %zu, focal length certain to %.3f %%; next: %s",
                   guide_[0].views().size(), focal, next.c_str());
        else if (!fv_say_terminal())
            fv_say("picture %zu; next: %s", guide_[0].views().size(), next.c_str());
    }

  private:
    const Guidance *guidance_;
    int views_max_;
    std::vector<Guide> guide_; /* one, or none */
    Advice advice_;
};

/* Of `cameras` cameras, 0: of all that the source has. */
fovea_status collect_source(const std::string &uri, const Board &board, Refinement refinement,
                            int views_max, size_t cameras, const Guidance *guidance,
                            const SizeCheck &check, std::vector<Collection> &collections,
                            fovea_error *error)
{
    Frames frames;
    fovea_status status = open_frames(uri, frames, error);
    if (status != FOVEA_OK) return status;
    const fovea_source_info *info = frames.ops->info(frames.source);
    Finder finder(*info, cameras, board, refinement);
    status = finder.begin(error);
    if (status == FOVEA_OK && check) status = check(finder.sizes(), error);
    if (status == FOVEA_OK) status = frames.ops->start(frames.source, error);
    if (status != FOVEA_OK) return status;
    collections = finder.sizes();
    const bool few = info->frame_count > 0 && info->frame_count <= (uint64_t)views_max;
    std::vector<Chooser> choosers(collections.size(), {info->live});
    std::vector<View> views;
    Guided guided(guidance != nullptr && !few ? guidance : nullptr, board, collections[0],
                  views_max, info->live);
    uint64_t count = 0;
    const Interruption interruption;
    while (!interruption.came() && (int)collections[0].views.size() < views_max &&
           !guided.ended()) {
        fovea_frame frame;
        status = frames.ops->dequeue(frames.source, INT64_MAX, &frame);
        if (status == FOVEA_END) break;
        if (status < 0) {
            frames.ops->stop(frames.source);
            return fv_source_failed(frames.ops, frames.source, uri.c_str(), status, error);
        }
        if (status != FOVEA_OK) continue;
        const bool there = finder.look(frame, views);
        frames.ops->requeue(frames.source, &frame);
        if (!there) continue;
        const bool chosen = guided.is_on() ? guided.look(finder.image(0), views[0])
                                           : is_chosen(choosers, views, collections) || few;
        if (chosen) {
            for (size_t k = 0; k < views.size(); k++) {
                take(finder.image(k), board, views[k]);
                collections[k].clock = frame.clock;
                collections[k].views.push_back(views[k]);
            }
            guided.add(views[0]);
        }
        count++;
        if (guided.is_on() || !fv_say_terminal()) continue;
        fv_say_status("frame %llu  %s  %zu of %d pictures", (unsigned long long)count,
                      views[0].left_out.empty() ? "board" : "no board", collections[0].views.size(),
                      views_max);
    }
    frames.ops->stop(frames.source);
    if (fv_say_terminal()) fv_say_status("%s", "");
    return FOVEA_OK;
}

bool is_folder(const std::string &source)
{
    struct stat about;
    return stat(source.c_str(), &about) == 0 && S_ISDIR(about.st_mode);
}

/* How many pictures of a source are taken: of a folder, or a recording of at most that many, all.
 */
fovea_status count_pictures(const std::string &uri, int views_max, size_t &pictures,
                            fovea_error *error)
{
    dirent **entries;
    if (is_folder(uri)) {
        const int found = scandir(uri.c_str(), &entries, is_picture, nullptr);
        pictures = (size_t)std::max(0, found);
        for (int i = 0; i < found; i++)
            std::free(entries[i]);
        if (found >= 0) std::free(entries);
        return FOVEA_OK;
    }
    Frames frames;
    const fovea_status status = open_frames(uri, frames, error);
    if (status != FOVEA_OK) return status;
    const uint64_t count = frames.ops->info(frames.source)->frame_count;
    pictures = (size_t)count;
    if (count > 0 && count <= (uint64_t)views_max) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%.300s: found a source %s, expected for each camera a folder or a "
                           "recording of at most %d pictures, or one source with all cameras",
                           uri.c_str(), count > 0 ? "with more pictures" : "that is live",
                           views_max);
}

} // namespace

Interruption::Interruption()
{
    interrupted = 0;
    std::signal(SIGINT, on_signal);
}

Interruption::~Interruption()
{
    std::signal(SIGINT, SIG_DFL);
}

bool Interruption::came() const
{
    return interrupted != 0;
}

void visit_source(const std::string &source, void (*visit)(void *, const char *), void *context)
{
    dirent **entries;
    if (is_folder(source)) {
        const int count = scandir(source.c_str(), &entries, is_picture, nullptr);
        for (int i = 0; i < count; i++) {
            visit(context, (source + "/" + entries[i]->d_name).c_str());
            std::free(entries[i]);
        }
        if (count >= 0) std::free(entries);
        return;
    }
    Frames frames;
    fovea_error error;
    if (open_frames(source, frames, &error) == FOVEA_OK && frames.ops->reads != nullptr)
        frames.ops->reads(frames.source, visit, context);
}

Thumbnail thumbnail_of(const Grey &image, int width_max)
{
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

namespace
{

fovea_status collect_one(const std::string &source, const Board &board, Refinement refinement,
                         int views_max, const Guidance *guidance, const SizeCheck &check,
                         Collection &collection, fovea_error *error)
{
    if (is_folder(source)) return collect_folder(source, board, refinement, collection, error);
    std::vector<Collection> one;
    const fovea_status status =
        collect_source(source, board, refinement, views_max, 1, guidance, check, one, error);
    if (!one.empty()) collection = one[0];
    return status;
}

} // namespace

SizeCheck size_of(const fovea_camera &camera, const std::string &file)
{
    return [=](const std::vector<Collection> &sizes, fovea_error *error) {
        fovea_camera fitted = camera;
        return fv_calibration_fit(&fitted, sizes[0].width, sizes[0].height, false, file.c_str(),
                                  error);
    };
}

fovea_status collect(const std::string &source, const Board &board, Refinement refinement,
                     int views_max, Collection &collection, fovea_error *error,
                     const SizeCheck &check)
{
    return collect_one(source, board, refinement, views_max, nullptr, check, collection, error);
}

fovea_status collect_guided(const std::string &source, const Board &board, Refinement refinement,
                            int views_max, const Guidance &guidance, Collection &collection,
                            fovea_error *error)
{
    return collect_one(source, board, refinement, views_max, &guidance, nullptr, collection, error);
}

fovea_status expect_guidance(const std::string &source, int views_max, fovea_error *error)
{
    if (is_folder(source))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.300s: found a folder, all pictures of which are taken, expected "
                               "a camera or a recording",
                               source.c_str());
    Frames frames;
    fovea_error why;
    if (open_frames(source, frames, &why) != FOVEA_OK) return FOVEA_OK;
    const uint64_t count = frames.ops->info(frames.source)->frame_count;
    if (count == 0 || count > (uint64_t)views_max) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%.300s: found %llu frames, all of which are taken, expected a camera "
                           "or a recording of more than --views %d",
                           source.c_str(), (unsigned long long)count, views_max);
}

namespace
{

fovea_status one_camera(const std::string &source, fovea_error *error)
{
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%.300s: found one camera, expected two or more: a source with "
                           "several, or --source once for each",
                           source.c_str());
}

fovea_status expect_as_many(const std::string &source, size_t found, const std::string &first,
                            size_t expected, fovea_error *error)
{
    if (found == expected) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%.200s: found %zu pictures, expected %zu as in %.200s: one of each "
                           "camera at each instant",
                           source.c_str(), found, expected, first.c_str());
}

} // namespace

fovea_status collect_rig(const std::vector<std::string> &sources, const Board &board, int views_max,
                         std::vector<Collection> &collections, fovea_error *error,
                         const SizeCheck &check)
{
    const std::string &first = sources[0];
    if (sources.size() == 1 && is_folder(first)) return one_camera(first, error);
    if (sources.size() == 1) {
        const auto several = [&](const std::vector<Collection> &sizes, fovea_error *why) {
            if (sizes.size() < 2) return one_camera(first, why);
            return check ? check(sizes, why) : FOVEA_OK;
        };
        return collect_source(first, board, Refinement::OWN, views_max, 0, nullptr, several,
                              collections, error);
    }
    std::vector<size_t> counts(sources.size());
    for (size_t k = 0; k < sources.size(); k++) {
        fovea_status status = count_pictures(sources[k], views_max, counts[k], error);
        if (status == FOVEA_OK)
            status = expect_as_many(sources[k], counts[k], first, counts[0], error);
        if (status != FOVEA_OK) return status;
    }
    for (const std::string &source : sources) {
        Collection collection;
        fovea_status status = collect(source, board, Refinement::OWN, views_max, collection, error);
        if (status != FOVEA_OK) return status;
        collections.push_back(collection);
        status = expect_as_many(source, collection.views.size(), first, collections[0].views.size(),
                                error);
        if (status != FOVEA_OK) return status;
    }
    return FOVEA_OK;
}

} // namespace calibrate
