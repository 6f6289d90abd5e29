/* What other rooms ask of odometry: its results, and saving the map. */
#include "odometry/odometry.h"

const struct fovea_pose *fv_odometry_pose(const struct fv_odometry *o)
{
    return &o->state->pose;
}

void fv_odometry_own_sigmas(const struct fv_odometry *o, double *position, double *turn)
{
    const struct fovea_pose *pose = &o->state->pose;
    *position = pose->posed ? o->state->covariance.own_position / pose->map_scale : 0;
    *turn = pose->posed ? o->state->covariance.own_turn : 0;
}

uint32_t fv_odometry_reset_counter(const struct fv_odometry *o)
{
    return o->state->reset_counter;
}

void fv_odometry_map_pose(const struct fv_odometry *o, struct fv_se3 *T_map_cam)
{
    *T_map_cam = fv_map_camera_at(&o->map, fv_map_current(&o->map));
}

/* By way of the world of the map, which corrections move against that of the pose. */
struct fv_odometry_reference fv_odometry_reference(const struct fv_odometry *o)
{
    const struct fv_keyframe *keyframe = &o->map.keyframes[o->state->newest];
    struct fv_odometry_reference reference = {
        .slot = o->state->newest, .number = keyframe->number, .stamp_ns = keyframe->stamp_ns};
    struct fv_se3 T_map_cam, T_keyframe_map = fv_map_camera_at(&o->map, o->state->newest);
    fv_odometry_map_pose(o, &T_map_cam);
    fv_se3_invert(&T_keyframe_map, &T_keyframe_map);
    fv_se3_compose(&T_keyframe_map, &T_map_cam, &reference.T_keyframe_cam);
    return reference;
}

const struct fv_map *fv_odometry_map(const struct fv_odometry *o)
{
    return &o->map;
}

double fv_odometry_focal_px(const struct fv_odometry *o)
{
    return o->focal_px;
}

struct fv_closure_counts fv_odometry_closure_counts(const struct fv_odometry *o)
{
    if (!o->config.closures) return (struct fv_closure_counts){0};
    return o->closure.state->counts;
}

bool fv_odometry_withholds(const struct fv_odometry *o)
{
    return fv_agreement_withholds(&o->state->agreement);
}

void fv_odometry_keep_scale(struct fv_odometry *o, const struct fv_map_scale *scale)
{
    o->map.state->scale = *scale;
}

void fv_odometry_keep_gravity(struct fv_odometry *o, const struct fv_map_gravity *gravity)
{
    o->map.state->gravity = *gravity;
}

bool fv_odometry_gravity(const struct fv_odometry *o, struct fv_map_gravity *gravity)
{
    *gravity = o->map.state->gravity;
    return gravity->sigma > 0;
}

/* ---- saving the map -------------------------------------------------------------------------- */

void fv_odometry_save_to(struct fv_odometry *o, uint8_t *buffer, size_t bytes)
{
    o->saver.buffer = buffer;
    o->saver.capacity = buffer == NULL ? 0 : bytes;
}

void fv_odometry_save_begin(struct fv_odometry *o)
{
    fv_archive_begin(o->saver.archive, o->state->frame_number);
}

void fv_odometry_save_want_grid(struct fv_odometry *o)
{
    fv_archive_want_grid(o->saver.archive);
}

bool fv_odometry_save_at_grid(const struct fv_odometry *o)
{
    return o->saver.archive->phase == FV_ARCHIVE_GRID;
}

void fv_odometry_save_grid_head(struct fv_odometry *o, const struct fv_archive_grid *grid)
{
    fv_archive_grid_head(o->saver.archive, grid, o->saver.buffer, o->saver.capacity);
}

void fv_odometry_save_grid_cells(struct fv_odometry *o, const int8_t *cells, uint32_t count)
{
    fv_archive_grid_cells(o->saver.archive, cells, count, o->saver.buffer, o->saver.capacity);
}

void fv_odometry_save_drop(struct fv_odometry *o)
{
    *o->saver.archive = (struct fv_archive_state){0};
}

bool fv_odometry_saving(const struct fv_odometry *o)
{
    return fv_archive_busy(o->saver.archive);
}

size_t fv_odometry_save_take(struct fv_odometry *o)
{
    return fv_archive_take(o->saver.archive);
}
