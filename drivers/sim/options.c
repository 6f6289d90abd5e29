#include "sim.h"

#include <string.h>

#include "support/uri_options.h"

/* ---- the table of options -------------------------------------------------------------------- */

static const char *const lens_name[] = {"radtan", "equidistant", "pinhole", NULL};
static const char *const textures_name[] = {"natural", "repeated", NULL};

static const double sample_hz_min = 0.01; /* of a sensor; 0: there is none */
#define SAMPLE_HZ_MAX 1000

#define AT(member) offsetof(struct fv_sim_options, member)
static const struct fv_uri_option option_table[] = {
    {"seed", FV_URI_U64, AT(seed), 0, 9007199254740992.0, "integer", NULL},
    {"width", FV_URI_I32, AT(width), 64, 2048, "pixels", NULL},
    {"height", FV_URI_I32, AT(height), 64, 2048, "pixels", NULL},
    {"rate", FV_URI_REAL, AT(rate_hz), 1, 1000, "Hz", NULL},
    {"frames", FV_URI_U64, AT(frames), 0, 9007199254740992.0, "frames, 0: endless", NULL},
    {"lens", FV_URI_WORD, AT(lens), 0, 0, "radtan, equidistant or pinhole", lens_name},
    {"fov", FV_URI_REAL, AT(fov_deg), 30, 130, "degrees across", NULL},
    {"noise", FV_URI_REAL, AT(noise), 0, 20, "grey levels", NULL},
    {"blur", FV_URI_FLAG, AT(blur), 0, 1, "0 or 1", NULL},
    {"rolling", FV_URI_FLAG, AT(rolling), 0, 1, "0 or 1", NULL},
    {"exposure", FV_URI_REAL, AT(exposure_ms), 0.05, 100, "milliseconds", NULL},
    {"readout", FV_URI_REAL, AT(readout_ms), 0, 100, "milliseconds", NULL},
    {"objects", FV_URI_I32, AT(objects), 0, FV_SIM_OBJECTS_MAX, "moving objects", NULL},
    {"textures", FV_URI_WORD, AT(textures), 0, 0, "natural or repeated", textures_name},
    {"light", FV_URI_REAL, AT(light), 0.1, 4, "factor of brightness", NULL},
    {"wheel_odometry", FV_URI_REAL, AT(wheel_odometry_hz), 0, SAMPLE_HZ_MAX, "Hz", NULL},
    {"wheel_odometry_noise", FV_URI_REAL, AT(wheel_odometry_noise), 0, 1, "of a step, relative",
     NULL},
    {"imu", FV_URI_REAL, AT(imu_hz), 0, SAMPLE_HZ_MAX, "Hz", NULL},
    {"imu_noise", FV_URI_REAL, AT(imu_noise), 0, 100, "of EuRoC's densities, factor", NULL},
    {"gyro_bias", FV_URI_REAL, AT(gyro_bias_rad_s), 0, 1, "rad/s", NULL},
    {"acceleration_bias", FV_URI_REAL, AT(acceleration_bias_m_s2), 0, 10, "m/s^2", NULL},
    {"imu_offset", FV_URI_REAL, AT(imu_offset_ms), -100, 100, "milliseconds", NULL},
    {"imu_offset_known", FV_URI_FLAG, AT(imu_offset_known), 0, 1, "0 or 1", NULL},
    {"turn_rate", FV_URI_REAL, AT(turn_rate_deg_s), 140, 1000, "degrees per second", NULL},
    {"baseline", FV_URI_REAL, AT(baseline_m), 0, 0.4, "metres, 0: one camera", NULL},
    {"time", FV_URI_REAL, AT(time_s), 0, 100000, "seconds", NULL},
};
static const struct fv_uri_table options_table = {
    "sim", option_table, sizeof option_table / sizeof option_table[0], NULL, NULL};

static const char *const trajectory_name[FV_SIM_TRAJECTORY_COUNT] = {
    "tour", "orbit", "corridor", "rotate", "stopgo", "fast", "kidnap", "wander", "still", "stand"};

static bool was_given(uint64_t given, size_t offset)
{
    for (size_t i = 0; i < options_table.count; i++)
        if (option_table[i].offset == offset) return (given >> i & 1) != 0;
    return false;
}

/* ---- values ---------------------------------------------------------------------------------- */

static enum fovea_status check_sample_rate(const char *name, double hz, struct fovea_error *error)
{
    if (hz == 0 || hz >= sample_hz_min) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "sim: %s: found %g Hz, expected 0 or a number in [%g, %d]", name, hz,
                           sample_hz_min, SAMPLE_HZ_MAX);
}

static enum fovea_status check_together(const struct fv_sim_options *options,
                                        struct fovea_error *error)
{
    const double period_ms = 1000.0 / options->rate_hz;
    if (options->exposure_ms > period_ms)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "sim: exposure: found %g ms, expected at most the frame period of %g ms (rate=%g)",
            options->exposure_ms, period_ms, options->rate_hz);
    if (options->rolling && options->readout_ms > period_ms)
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT,
            "sim: readout: found %g ms, expected at most the frame period of %g ms (rate=%g)",
            options->readout_ms, period_ms, options->rate_hz);
    const double widest = options->lens == FV_SIM_LENS_EQUIDISTANT ? 130.0 : 110.0;
    if (options->fov_deg > widest)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: fov: found %g, expected at most %g degrees with this lens",
                               options->fov_deg, widest);
    if (options->trajectory != FV_SIM_FAST && options->turn_rate_deg_s != FV_SIM_TURN_DEG_S)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: turn_rate: found %g with the trajectory %s, expected fast",
                               options->turn_rate_deg_s, trajectory_name[options->trajectory]);
    const enum fovea_status status =
        check_sample_rate("wheel_odometry", options->wheel_odometry_hz, error);
    return status == FOVEA_OK ? check_sample_rate("imu", options->imu_hz, error) : status;
}

static int32_t default_objects(enum fv_sim_trajectory trajectory)
{
    switch (trajectory) {
    case FV_SIM_CORRIDOR:
        return 4;
    case FV_SIM_TOUR:
        return 8;
    case FV_SIM_WANDER:
        return 12;
    default:
        return 6;
    }
}

enum fovea_status fv_sim_options_parse(const char *address, struct fv_sim_options *options,
                                       struct fovea_error *error)
{
    struct fv_sim_options o = {.trajectory = FV_SIM_TRAJECTORY_COUNT,
                               .seed = 1,
                               .width = 640,
                               .height = 480,
                               .rate_hz = 30.0,
                               .noise = 2.0,
                               .exposure_ms = 5.0,
                               .readout_ms = 20.0,
                               .light = 1.0,
                               .wheel_odometry_hz = 100.0,
                               .wheel_odometry_noise = 0.05,
                               .imu_noise = 1.0,
                               .imu_offset_known = true,
                               .turn_rate_deg_s = FV_SIM_TURN_DEG_S};
    char word[FV_URI_WORD_BYTES];
    uint64_t given;
    fv_uri_next_word(&address, "?", word);
    for (int32_t i = 0; i < FV_SIM_TRAJECTORY_COUNT; i++) {
        if (strcmp(word, trajectory_name[i]) == 0) o.trajectory = (enum fv_sim_trajectory)i;
    }
    if (word[0] == '\0') o.trajectory = FV_SIM_TOUR;
    if (o.trajectory == FV_SIM_TRAJECTORY_COUNT)
        return fv_uri_unknown("sim", "trajectory", word, trajectory_name, FV_SIM_TRAJECTORY_COUNT,
                              error);
    o.objects = default_objects(o.trajectory);
    if (*address != '\0') address++;
    enum fovea_status status = fv_uri_options_parse(&options_table, address, &o, &given, error);
    if (status != FOVEA_OK) return status;
    o.wheel_odometry_given = was_given(given, AT(wheel_odometry_hz));
    if (!was_given(given, AT(fov_deg)))
        o.fov_deg = o.lens == FV_SIM_LENS_EQUIDISTANT ? 105.0 : 80.0;
    if (!was_given(given, AT(frames))) o.frames = fv_sim_motion_frames(o.trajectory, o.rate_hz);
    status = check_together(&o, error);
    if (status == FOVEA_OK) *options = o;
    return status;
}
