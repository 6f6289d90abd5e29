#include "calibrate/moving.h"

#include <algorithm>

#include "calibrate/frames.h"
#include "drivers/table.h"
extern "C" {
#include "support/say.h"
}

namespace calibrate
{
namespace
{

/* The samples that come with a frame. */
void take_samples(const Frames &frames, const fovea_frame &frame,
                  std::vector<fovea_imu_sample> &samples)
{
    fovea_sample some[FOVEA_INPUT_SAMPLES_MAX];
    uint32_t count = FOVEA_INPUT_SAMPLES_MAX;
    while (frames.ops->samples != nullptr && count == FOVEA_INPUT_SAMPLES_MAX) {
        count = frames.ops->samples(frames.source, &frame, some, FOVEA_INPUT_SAMPLES_MAX);
        for (uint32_t i = 0; i < count; i++)
            if (some[i].kind == FOVEA_SAMPLE_IMU) append_sample(some[i].imu, samples);
    }
}

/* What somebody who moves the rig is to know. */
void say_progress(const Moving &moving, const View &view, double since_s, double seconds)
{
    int boards = 0;
    for (const View &one : moving.cameras[0].views)
        boards += one.left_out.empty();
    if (!fv_say_terminal()) return;
    fv_say_status("%.0f of %.0f s  %d pictures with a board, %zu samples  %s", since_s, seconds,
                  boards, moving.samples.size(),
                  view.left_out.empty() ? "turn quickly about all axes, one after the other"
                                        : "no board: bring it back into the image");
}

fovea_status check_sensor(const fovea_source_info &info, const LiveImuSetup &imu,
                          const std::string &source, fovea_error *error)
{
    const bool own = (info.sample_kinds & (1u << FOVEA_SAMPLE_IMU)) != 0;
    if (own && !imu.sensor.empty())
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "--imu: found %.100s beside the source's own inertial sensor, "
                               "expected 'source'",
                               imu.sensor.c_str());
    if (own || !imu.sensor.empty()) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "%.300s: found no inertial sensor, expected a source that has one, as "
                           "'euroc:DIR?imu=1', or --imu iio:NAME or lcm:CHANNEL",
                           source.c_str());
}

} // namespace

fovea_status collect_moving(const std::string &source, const LiveImuSetup &imu, const Board &board,
                            double seconds, Moving &moving, fovea_error *error)
{
    Frames frames;
    LiveImu beside;
    fovea_status status = open_frames(source, frames, error);
    if (status != FOVEA_OK) return status;
    const fovea_source_info *info = frames.ops->info(frames.source);
    Finder finder(*info, 0, board, Refinement::OWN);
    status = check_sensor(*info, imu, source, error);
    if (status == FOVEA_OK) status = finder.begin(error);
    if (status == FOVEA_OK) status = beside.open(imu, error);
    if (status == FOVEA_OK) status = frames.ops->start(frames.source, error);
    if (status != FOVEA_OK) return status;
    moving.rig = info->rig;
    moving.cameras = finder.sizes();
    moving.imu_range[0] = beside.gyro_range();
    moving.imu_range[1] = beside.acceleration_range();
    const bool whole = info->frame_count > 0 && !info->live;
    std::vector<View> views;
    int64_t begin_ns = INT64_MIN;
    const Interruption interruption;
    while (!interruption.came()) {
        fovea_frame frame;
        status = frames.ops->dequeue(frames.source, INT64_MAX, &frame);
        if (status == FOVEA_END) break;
        if (status < 0) {
            frames.ops->stop(frames.source);
            return fv_source_failed(frames.ops, frames.source, source.c_str(), status, error);
        }
        if (status != FOVEA_OK) continue;
        if (begin_ns == INT64_MIN) begin_ns = frame.stamp_ns;
        const double since_s = 1e-9 * (double)(frame.stamp_ns - begin_ns);
        take_samples(frames, frame, moving.samples);
        beside.take(frame.clock, moving.samples);
        const bool there = finder.look(frame, views);
        frames.ops->requeue(frames.source, &frame);
        if (!whole && since_s > seconds) break;
        if (!there) continue;
        for (size_t k = 0; k < views.size(); k++) {
            views[k].width = moving.cameras[k].width;
            views[k].height = moving.cameras[k].height;
            moving.cameras[k].views.push_back(views[k]);
        }
        say_progress(moving, views[0], since_s,
                     whole && info->rate_hz > 0 ? (double)info->frame_count / info->rate_hz
                                                : seconds);
    }
    frames.ops->stop(frames.source);
    if (fv_say_terminal()) fv_say_status("%s", "");
    if (moving.samples.empty() && beside.no_clock() > 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "%.100s: found no sample whose stamp states the clock of the "
                               "pictures or its UTC (clock, utc_offset_ns) among %d",
                               imu.sensor.c_str(), beside.no_clock());
    return FOVEA_OK;
}

std::vector<Collection> still_views(const Moving &moving, int views_max)
{
    std::vector<Collection> chosen = moving.cameras;
    for (Collection &collection : chosen)
        collection.views.clear();
    for (size_t v = 0; v < moving.cameras[0].views.size(); v++) {
        bool is_new = false;
        int boards = 0;
        for (size_t k = 0; k < chosen.size(); k++) {
            const View &view = moving.cameras[k].views[v];
            bool fresh = view.left_out.empty();
            boards += fresh;
            for (const View &other : chosen[k].views)
                fresh = fresh && !(mean_shift(other, view) < NEW_SHARE * chosen[k].width);
            is_new |= fresh;
        }
        if (!is_new || boards < std::min(2, (int)chosen.size())) continue;
        for (size_t k = 0; k < chosen.size(); k++)
            chosen[k].views.push_back(moving.cameras[k].views[v]);
        if ((int)chosen[0].views.size() >= views_max) break;
    }
    return chosen;
}

} // namespace calibrate
