#include "../clock.h"
#include "sim.h"

#include <string.h>

/* The cameras of the rig. The body's frame is the first camera's (x right, y down, z forward), or
 * the driving robot's; the others are like the first, each in a pose of its own beside it. Masks
 * are the configuration's. */

/* Calibration with the asked field of view across; coefficients like those of a common
 * machine-vision lens, scaled so that they bend equally at the edge of any field. */
static enum fovea_status make_camera(const struct fv_sim_options *o, struct fovea_camera *camera,
                                     struct fovea_error *error)
{
    const double half = 0.5 * o->fov_deg * FV_PI / 180.0;
    double edge = fv_tan(half); /* distorted radius at the left and right edge */
    *camera =
        (struct fovea_camera){.width = o->width, .height = o->height, .lens = FOVEA_LENS_RADTAN};
    camera->cx = 0.5 * (o->width - 1) + 3.2;
    camera->cy = 0.5 * (o->height - 1) - 1.7;
    if (o->lens == FV_SIM_LENS_RADTAN) {
        const double scale = 0.84 / edge < 1.0 ? 0.84 / edge : 1.0, s2 = scale * scale;
        camera->k[0] = -0.28 * s2;
        camera->k[1] = 0.075 * s2 * s2;
        camera->k[2] = 2e-4;
        camera->k[3] = -1e-4;
        const double r2 = edge * edge;
        edge *= 1.0 + camera->k[0] * r2 + camera->k[1] * r2 * r2;
    } else if (o->lens == FV_SIM_LENS_EQUIDISTANT) {
        camera->lens = FOVEA_LENS_EQUIDISTANT;
        camera->k[0] = 0.02;
        camera->k[1] = -0.012;
        camera->k[2] = 0.004;
        camera->k[3] = -0.0008;
        const double h2 = half * half;
        edge = half * (1.0 + h2 * (camera->k[0] +
                                   h2 * (camera->k[1] + h2 * (camera->k[2] + h2 * camera->k[3]))));
    }
    camera->fx = 0.5 * o->width / edge;
    camera->fy = camera->fx * 1.001;
    return fovea_camera_prepare(camera, error);
}

/* T_body_cam of the cameras that were asked for; returns how many. */
static uint32_t place_cameras(const struct fv_sim_options *o, double T[FOVEA_CAMERAS_MAX][12])
{
    const struct fv_uri_pose first = {{0}, {0}}, beside = {{o->baseline_m, 0, 0}, {0}};
    const struct {
        bool asked;
        const struct fv_uri_pose *pose;
    } cameras[FOVEA_CAMERAS_MAX] = {
        {true, &first},
        {o->baseline_m > 0 || fv_sim_option_given(o, offsetof(struct fv_sim_options, camera2)),
         o->baseline_m > 0 ? &beside : &o->camera2},
        {fv_sim_option_given(o, offsetof(struct fv_sim_options, camera3)), &o->camera3},
        {fv_sim_option_given(o, offsetof(struct fv_sim_options, camera4)), &o->camera4},
    };
    double T_body_first[12];
    uint32_t count = 0;
    fv_sim_drive_camera(T_body_first);
    while (count < FOVEA_CAMERAS_MAX && cameras[count].asked) {
        fv_sim_pose_rows(cameras[count].pose, T[count]);
        if (o->trajectory == FV_SIM_DRIVE) fv_sim_compose(T_body_first, T[count], T[count]);
        count++;
    }
    return count;
}

enum fovea_status fv_sim_rig_describe(const struct fv_sim_options *options, struct fovea_rig *rig,
                                      struct fovea_error *error)
{
    double T_body_cam[FOVEA_CAMERAS_MAX][12];
    const enum fovea_status status = make_camera(options, &rig->cameras[0].camera, error);
    if (status != FOVEA_OK) return status;
    rig->camera_count = place_cameras(options, T_body_cam);
    for (uint32_t i = 0; i < rig->camera_count; i++) {
        struct fovea_rig_camera *camera = &rig->cameras[i];
        camera->camera = rig->cameras[0].camera;
        camera->calibrated = true;
        camera->has_readout = true;
        if (options->rolling) camera->readout_ns = fv_clock_from_ms(options->readout_ms);
        camera->has_T_body_cam = rig->camera_count > 1 || options->trajectory == FV_SIM_DRIVE;
        if (camera->has_T_body_cam) memcpy(camera->T_body_cam, T_body_cam[i], sizeof T_body_cam[i]);
    }
    return FOVEA_OK;
}
