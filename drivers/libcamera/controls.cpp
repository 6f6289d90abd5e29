#include "controls.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <string>

#include "fovea/status.h"

namespace
{

using libcamera::Camera;
using libcamera::ControlId;
using libcamera::ControlInfo;
using libcamera::ControlList;
using libcamera::ControlValue;
namespace controls = libcamera::controls;

struct Asked {
    const Camera &camera;
    const char *uri;
    ControlList *list;
    fovea_error *error;
};

double number_of(const ControlValue &value)
{
    switch (value.type()) {
    case libcamera::ControlTypeBool:
        return value.get<bool>();
    case libcamera::ControlTypeByte:
        return value.get<uint8_t>();
    case libcamera::ControlTypeInteger32:
        return value.get<int32_t>();
    case libcamera::ControlTypeInteger64:
        return static_cast<double>(value.get<int64_t>());
    case libcamera::ControlTypeFloat:
        return static_cast<double>(value.get<float>());
    default:
        return std::nan("");
    }
}

bool make_value(libcamera::ControlType type, double number, ControlValue *value)
{
    const bool whole = number == std::floor(number) && std::fabs(number) < 9e15;
    switch (type) {
    case libcamera::ControlTypeBool:
        value->set(number != 0);
        return number == 0 || number == 1;
    case libcamera::ControlTypeByte:
        value->set(static_cast<uint8_t>(std::clamp(number, 0.0, 255.0)));
        return whole;
    case libcamera::ControlTypeInteger32:
        value->set(static_cast<int32_t>(std::clamp(number, -2147483648.0, 2147483647.0)));
        return whole;
    case libcamera::ControlTypeInteger64:
        value->set(static_cast<int64_t>(whole ? number : 0));
        return whole;
    case libcamera::ControlTypeFloat:
        value->set(static_cast<float>(number));
        return true;
    default:
        return false;
    }
}

const ControlId *control_named(const Camera &camera, const std::string &name, std::string *list)
{
    for (const auto &[id, info] : camera.controls()) {
        if (id->name() == name) return id;
        *list += (list->empty() ? "" : " ") + id->name();
    }
    return nullptr;
}

// A control that is not `required` is left out where the camera does not have it. `unit`: theirs in
// ours.
enum fovea_status add_number(const Asked &asked, const ControlId &id, const char *what,
                             double value, double unit, bool required)
{
    const auto found = asked.camera.controls().find(id.id());
    if (found == asked.camera.controls().end()) {
        if (!required) return FOVEA_OK;
        return fovea_error_set(asked.error, FOVEA_ERROR_INPUT,
                               "%s: %s: this camera has no such control", asked.uri, what);
    }
    const ControlInfo &info = found->second;
    const double low = number_of(info.min()), high = number_of(info.max());
    ControlValue made;
    const bool fits = !(value < low) && !(value > high);
    if (!fits || !make_value(id.type(), value, &made))
        return fovea_error_set(asked.error, FOVEA_ERROR_INPUT,
                               "%s: %s: found %.10g, expected [%.10g, %.10g]", asked.uri, what,
                               value * unit, low * unit, high * unit);
    asked.list->set(id.id(), made);
    return FOVEA_OK;
}

enum fovea_status add_control_value(const Asked &asked, const fv_libcamera_control_value &given)
{
    std::string names;
    const ControlId *id = control_named(asked.camera, given.name, &names);
    if (id == nullptr)
        return fovea_error_set(asked.error, FOVEA_ERROR_INPUT,
                               "%s: unknown control '%.63s'; expected one of: %.300s", asked.uri,
                               given.name, names.c_str());
    char *end = nullptr;
    const double value = std::strtod(given.value, &end);
    const std::string what = std::string("control.") + given.name;
    if (end == given.value || *end != '\0' || !std::isfinite(value))
        return fovea_error_set(asked.error, FOVEA_ERROR_INPUT,
                               "%s: %s: found '%.63s', expected a number", asked.uri, what.c_str(),
                               given.value);
    return add_number(asked, *id, what.c_str(), value, 1, true);
}

// Which of exposure time and gain are automatic.
enum fovea_status add_modes(const Asked &asked, const fv_libcamera_options &options)
{
    const bool manual_time =
        options.exposure_ms > 0 || (options.auto_exposure_given && !options.auto_exposure);
#if FV_LIBCAMERA_AT_LEAST(0, 5)
    // Each is automatic or manual on its own: a fixed time with automatic gain is possible.
    enum fovea_status status = FOVEA_OK;
    if (options.auto_exposure_given)
        status = add_number(asked, controls::ExposureTimeMode, "auto_exposure",
                            manual_time ? controls::ExposureTimeModeManual
                                        : controls::ExposureTimeModeAuto,
                            1, !manual_time);
    if (status == FOVEA_OK && (options.auto_gain_given || options.gain >= 0))
        status = add_number(asked, controls::AnalogueGainMode, "auto_gain",
                            options.auto_gain ? controls::AnalogueGainModeAuto
                                              : controls::AnalogueGainModeManual,
                            1, options.auto_gain);
    return status;
#else
    // One switch for both; with a fixed time given and the switch on, pipelines that can keep the
    // gain automatic do.
    if (!options.auto_exposure_given && !options.auto_gain_given) return FOVEA_OK;
    return add_number(asked, controls::AeEnable, "auto_exposure", !manual_time || options.auto_gain,
                      1, options.auto_exposure || options.auto_gain);
#endif
}

} // namespace

bool fv_libcamera_has_control(const Camera &camera, const ControlId &id)
{
    return camera.controls().find(id.id()) != camera.controls().end();
}

enum fovea_status fv_libcamera_controls(const Camera &camera, const fv_libcamera_options &options,
                                        const char *uri, ControlList *list, fovea_error *error)
{
    const Asked asked = {camera, uri, list, error};
    enum fovea_status status = add_modes(asked, options);
    if (status == FOVEA_OK && options.exposure_ms > 0)
        status = add_number(asked, controls::ExposureTime, "exposure (ms)",
                            std::round(options.exposure_ms * 1000), 0.001, true);
    if (status == FOVEA_OK && options.gain >= 0)
        status = add_number(asked, controls::AnalogueGain, "gain", options.gain, 1, true);
    if (status == FOVEA_OK && options.rate_hz > 0 &&
        fv_libcamera_has_control(camera, controls::FrameDurationLimits)) {
        const auto duration_us = static_cast<int64_t>(std::llround(1e6 / options.rate_hz));
        const std::array<int64_t, 2> limits{duration_us, duration_us};
        list->set(controls::FrameDurationLimits, libcamera::Span<const int64_t, 2>(limits));
    }
    for (uint32_t i = 0; i < options.control_value_count && status == FOVEA_OK; i++)
        status = add_control_value(asked, options.control_values[i]);
    return status;
}
