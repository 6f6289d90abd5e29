#include "sim.h"

#include <string.h>

/* ---- the table of options -------------------------------------------------------------------- */

static const char *const lens_name[] = {"radtan", "equidistant", "pinhole", NULL};
static const char *const textures_name[] = {"natural", "repeated", NULL};

#define AT_BODY                                                                                    \
    {                                                                                              \
        {0},                                                                                       \
        {                                                                                          \
            0                                                                                      \
        }                                                                                          \
    } /* a pose: the body's own */

static const double sample_hz_min = 0.01; /* of a sensor; 0: there is none */

#define AT(member) offsetof(struct fv_sim_options, member)
static const struct fv_uri_option option_table[] = {
#define FV_SIM_OPTION(name, kind, type, member, value, low, high, unit, words)                     \
    {name, FV_URI_##kind, AT(member), low, high, unit, words},
#include "options.def"
#undef FV_SIM_OPTION
};
static const char *const renamed[][2] = {
    {"odometry", "wheel_odometry"}, {"odometry_noise", "wheel_odometry_noise"}, {NULL, NULL}};
static const struct fv_uri_table options_table = {
    "sim", option_table, sizeof option_table / sizeof option_table[0], NULL, NULL, renamed};

static const char *const trajectory_name[FV_SIM_TRAJECTORY_COUNT] = {
    "tour",   "orbit", "corridor", "rotate", "stopgo", "fast", "kidnap",
    "wander", "still", "stand",    "road",   "board",  "drive"};

bool fv_sim_option_given(const struct fv_sim_options *options, size_t offset)
{
    for (size_t i = 0; i < options_table.count; i++)
        if (option_table[i].offset == offset) return (options->given >> i & 1) != 0;
    return false;
}

/* ---- values ---------------------------------------------------------------------------------- */

static enum fovea_status check_sample_rate(const char *name, double hz, struct fovea_error *error)
{
    if (hz == 0 || hz >= sample_hz_min) return FOVEA_OK;
    return fovea_error_set(error, FOVEA_ERROR_INPUT,
                           "sim: %s: found %g Hz, expected 0 or a number in [%g, %d]", name, hz,
                           sample_hz_min, FV_SIM_SAMPLE_HZ_MAX);
}

/* Cameras are numbered without a gap, and each has one pose. */
static enum fovea_status check_cameras(const struct fv_sim_options *options,
                                       struct fovea_error *error)
{
    const bool second = fv_sim_option_given(options, AT(camera2)),
               third = fv_sim_option_given(options, AT(camera3)),
               fourth = fv_sim_option_given(options, AT(camera4));
    if (second && options->baseline_m > 0)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: baseline: found %g beside camera2, expected one of the two",
                               options->baseline_m);
    const bool two = second || options->baseline_m > 0;
    if ((third && !two) || (fourth && !third))
        return fovea_error_set(
            error, FOVEA_ERROR_INPUT, "sim: %s: found it without %s, expected both",
            third && !two ? "camera3" : "camera4", third && !two ? "camera2" : "camera3");
    return FOVEA_OK;
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
    if (options->trajectory == FV_SIM_ROAD && options->objects > FV_SIM_ROAD_CARS_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: objects: found %d, expected at most %d cars on the road",
                               (int)options->objects, FV_SIM_ROAD_CARS_MAX);
    if (options->trajectory == FV_SIM_DRIVE && options->objects > FV_SIM_DRIVE_MOVERS_MAX)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: objects: found %d, expected at most %d beside a driving robot",
                               (int)options->objects, FV_SIM_DRIVE_MOVERS_MAX);
    if (options->trajectory != FV_SIM_DRIVE && options->commands)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: commands: found 1 with the trajectory %s, expected drive",
                               trajectory_name[options->trajectory]);
    if (options->stands && (options->trajectory != FV_SIM_DRIVE || options->commands))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: stands: found 1 with %s, expected drive without commands",
                               options->commands ? "commands"
                                                 : trajectory_name[options->trajectory]);
    if (!options->commands &&
        fv_sim_option_given(options, offsetof(struct fv_sim_options, patience_s)))
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: patience: found %g without commands, expected commands=1",
                               options->patience_s);
    if (options->trajectory != FV_SIM_FAST && options->turn_rate_deg_s != FV_SIM_TURN_DEG_S)
        return fovea_error_set(error, FOVEA_ERROR_INPUT,
                               "sim: turn_rate: found %g with the trajectory %s, expected fast",
                               options->turn_rate_deg_s, trajectory_name[options->trajectory]);
    enum fovea_status status =
        check_sample_rate("wheel_odometry", options->wheel_odometry_hz, error);
    if (status == FOVEA_OK) status = check_sample_rate("imu", options->imu_hz, error);
    return status == FOVEA_OK ? check_cameras(options, error) : status;
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
    case FV_SIM_ROAD:
        return 8;
    case FV_SIM_DRIVE:
        return 3;
    case FV_SIM_BOARD:
        return 0;
    default:
        return 6;
    }
}

/* A car's camera has a size and a rate of its own: KITTI's. */
static void default_road(struct fv_sim_options *o)
{
    const double half = 1241 / (2 * FV_SIM_ROAD_FOCAL_PX);
    o->width = 1241;
    o->height = 376;
    o->rate_hz = 10;
    o->lens = FV_SIM_LENS_PINHOLE;
    o->fov_deg = 2 * fv_atan2(half, 1) * 180 / FV_PI;
}

enum fovea_status fv_sim_options_parse(const char *address, struct fv_sim_options *options,
                                       struct fovea_error *error)
{
    struct fv_sim_options o = {
        .trajectory = FV_SIM_TRAJECTORY_COUNT,
#define FV_SIM_OPTION(name, kind, type, member, value, low, high, unit, words) .member = value,
#include "options.def"
#undef FV_SIM_OPTION
    };
    char word[FV_URI_WORD_BYTES];
    fv_uri_next_word(&address, "?", word);
    for (int32_t i = 0; i < FV_SIM_TRAJECTORY_COUNT; i++) {
        if (strcmp(word, trajectory_name[i]) == 0) o.trajectory = (enum fv_sim_trajectory)i;
    }
    if (word[0] == '\0') o.trajectory = FV_SIM_TOUR;
    if (o.trajectory == FV_SIM_TRAJECTORY_COUNT)
        return fv_uri_unknown("sim", "trajectory", word, trajectory_name, FV_SIM_TRAJECTORY_COUNT,
                              error);
    o.objects = default_objects(o.trajectory);
    if (o.trajectory == FV_SIM_ROAD) default_road(&o);
    if (*address != '\0') address++;
    enum fovea_status status = fv_uri_options_parse(&options_table, address, &o, &o.given, error);
    if (status != FOVEA_OK) return status;
    if (!fv_sim_option_given(&o, AT(fov_deg)) &&
        (o.trajectory != FV_SIM_ROAD || fv_sim_option_given(&o, AT(lens))))
        o.fov_deg = o.lens == FV_SIM_LENS_EQUIDISTANT ? 105.0
                    : o.trajectory == FV_SIM_DRIVE    ? 100.0
                                                      : 80.0;
    if (!fv_sim_option_given(&o, AT(frames)))
        o.frames = fv_sim_motion_frames(o.trajectory, o.rate_hz);
    status = check_together(&o, error);
    if (status == FOVEA_OK) *options = o;
    return status;
}
