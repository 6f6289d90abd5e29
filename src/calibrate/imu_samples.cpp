#include "calibrate/imu_samples.h"

#include <cmath>
#include <sys/stat.h>

#include "drivers/table.h"
#include "fovea/source.h"
extern "C" {
#include "drivers/recorded/euroc_imu.h"
}

namespace calibrate
{
namespace
{

/* Recordings hold samples as they came. */
bool is_finite(const fovea_imu_sample &sample)
{
    bool finite = true;
    for (int i = 0; i < 3; i++)
        finite = finite && std::isfinite(sample.gyro[i]) && std::isfinite(sample.acceleration[i]);
    return finite;
}

bool is_file(const std::string &path)
{
    struct stat about;
    return stat(path.c_str(), &about) == 0 && S_ISREG(about.st_mode);
}

/* A log to find noise in is whole: samples that are repeated or late leave it open what is. */
fovea_status append_rising(const std::string &path, const fovea_imu_sample &sample,
                           std::vector<fovea_imu_sample> &samples, fovea_error *error)
{
    if (!samples.empty() && sample.stamp_ns <= samples.back().stamp_ns)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "%.300s: timestamp: found %lld, expected one after the sample before, of %lld",
            path.c_str(), (long long)sample.stamp_ns, (long long)samples.back().stamp_ns);
    samples.push_back(sample);
    return FOVEA_OK;
}

fovea_status read_file(const std::string &path, std::vector<fovea_imu_sample> &samples,
                       fovea_error *error)
{
    fv_samples list = {};
    fovea_status status = fv_euroc_imu_samples(path.c_str(), &list, error);
    for (size_t i = 0; status == FOVEA_OK && i < list.count; i++)
        if (is_finite(list.list[i].imu))
            status = append_rising(path, list.list[i].imu, samples, error);
    fv_samples_free(&list);
    return status;
}

/* Samples that come with the frames, which are not looked at. */
fovea_status drain(const fovea_source_ops *ops, fovea_source *source, const std::string &uri,
                   std::vector<fovea_imu_sample> &samples, fovea_error *error)
{
    fovea_status status = ops->start(source, error);
    if (status != FOVEA_OK) return status;
    for (;;) {
        fovea_frame frame;
        fovea_sample some[FOVEA_INPUT_SAMPLES_MAX];
        status = ops->dequeue(source, INT64_MAX, &frame);
        if (status < 0 || status == FOVEA_END) break;
        if (status != FOVEA_OK) continue;
        uint32_t count;
        do {
            count = ops->samples(source, &frame, some, FOVEA_INPUT_SAMPLES_MAX);
            for (uint32_t i = 0; i < count; i++)
                if (some[i].kind == FOVEA_SAMPLE_IMU && is_finite(some[i].imu))
                    samples.push_back(some[i].imu);
        } while (count == FOVEA_INPUT_SAMPLES_MAX);
        ops->requeue(source, &frame);
    }
    ops->stop(source);
    if (status == FOVEA_END) return FOVEA_OK;
    return fv_source_failed(ops, source, uri.c_str(), status, error);
}

} // namespace

fovea_status read_imu(const std::string &source, std::vector<fovea_imu_sample> &samples,
                      fovea_error *error)
{
    if (is_file(source)) return read_file(source, samples, error);
    const fovea_source_ops *ops;
    const char *address;
    fovea_source *opened;
    fovea_source_selection selection = {};
    selection.step = 1;
    selection.camera_given = true;
    fovea_status status = fv_source_find(source.c_str(), &ops, &address, error);
    if (status == FOVEA_OK) status = ops->open(address, &selection, &opened, error);
    if (status != FOVEA_OK) return status;
    const fovea_source_info *info = ops->info(opened);
    if ((info->sample_kinds & (1u << FOVEA_SAMPLE_IMU)) == 0 || ops->samples == nullptr)
        status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                 "%.300s: found no inertial sensor, expected a recording that has "
                                 "one, or a file of its samples",
                                 source.c_str());
    else if (info->frame_count == 0)
        status = fovea_error_set(error, FOVEA_ERROR_INPUT,
                                 "%.300s: found a source without an end, expected a recording",
                                 source.c_str());
    else
        status = drain(ops, opened, source, samples, error);
    ops->close(opened);
    return status;
}

} // namespace calibrate
