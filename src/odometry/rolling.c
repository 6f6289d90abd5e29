#include "odometry/rolling.h"

#include "geometry/vec.h"

/* Weight at which a measured distance tells more than the median depth. */
static const double known_parts = 4; /* its sigma is at most a fourth of it */

/* Velocity in the camera's axes, map's unit per second; zero where nothing is known. */
static void velocity_of(const struct fv_odometry *o, const struct fv_odometry_input *input,
                        double velocity[3])
{
    const struct fv_motion *motion = &o->state->localise.motion;
    const bool followed =
        o->state->state == FOVEA_TRACKING_OK || o->state->state == FOVEA_TRACKING_WEAK;
    const int64_t since_ns = input->stamp_ns - motion->stamp_ns;
    const double *t = NULL;
    double seconds = 0;
    if (followed && input->hint.whole && motion->known && since_ns > 0) {
        t = input->hint.T_now_last.t;
        seconds = 1e-9 * (double)since_ns;
    } else if (followed && motion->known) {
        t = motion->T_now_before.t;
        seconds = 1e-9 * (double)motion->interval_ns;
    }
    for (int k = 0; k < 3; k++) /* the camera that was at t has come to the origin */
        velocity[k] = t == NULL ? 0 : -t[k] / seconds;
}

static double inverse_distance_of(const struct fv_odometry *o,
                                  const struct fv_odometry_input *input, uint32_t feature,
                                  double usual)
{
    if (input->distances == NULL || !fv_map_metric(&o->map)) return usual;
    const double value = (double)input->distances[feature].value,
                 weight = (double)input->distances[feature].weight;
    return value * value * weight > known_parts * known_parts ? value : usual;
}

static float within(double value, int32_t size)
{
    return (float)(value < 0 ? 0 : value > size - 1 ? size - 1 : value);
}

/* False: it stays where it is. */
static bool place_one(const struct fv_odometry *o, const struct fv_rolling *rolling,
                      const double velocity[3], double inverse_distance,
                      struct fovea_feature *feature)
{
    const struct fovea_camera *camera = &o->camera;
    const double dt = ((double)feature->y_px / camera->height - 0.5) * rolling->readout_s;
    double q[3], A[6], turn[3], R[9], p[3], pixel[2];
    if (!fv_bearing_of(&o->bearings, camera, (double)feature->x_px, (double)feature->y_px, q, A))
        return false;
    for (int k = 0; k < 3; k++)
        turn[k] = rolling->rate[k] * dt;
    fv_so3_exp(turn, R);
    fv_rotate3(R, q, p);
    for (int k = 0; k < 3; k++)
        p[k] += velocity[k] * dt * inverse_distance;
    if (fovea_camera_project(camera, p, pixel, 0) != FOVEA_OK) return false;
    feature->x_px = within(pixel[0], camera->width);
    feature->y_px = within(pixel[1], camera->height);
    return true;
}

void fv_odometry_place(const struct fv_odometry *o, const struct fv_rolling *rolling,
                       const struct fv_odometry_input *input, struct fovea_feature *placed)
{
    double velocity[3];
    velocity_of(o, input, velocity);
    const bool moves = fv_dot3(velocity, velocity) > 0;
    const double usual = moves ? 1 / fv_odometry_current_depth(o) : 0;
    for (uint32_t i = 0; i < input->count; i++) {
        placed[i] = input->features[i];
        (void)place_one(o, rolling, velocity, inverse_distance_of(o, input, i, usual), &placed[i]);
    }
}
