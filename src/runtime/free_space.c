#include "runtime/free_space.h"

#include <string.h>

#include "base/elementary.h"
#include "geometry/vec.h"
#include "odometry/surface.h"
#include "runtime/kept_grid.h"

void fv_free_space_carve(struct fv_free_space *stage, const struct fovea_grid_job_config *config,
                         uint32_t features, struct fv_arena *persistent, struct fv_arena *job,
                         struct fv_arena *frame)
{
    stage->enabled = config->enabled;
    if (!stage->enabled) return;
    const struct fovea_grid_config *grid = &config->grid;
    stage->state = fv_arena_take(persistent, 1, sizeof *stage->state);
    stage->kept = fv_arena_take(persistent, 1, sizeof *stage->kept);
    fv_grid_carve(&stage->grid, grid, persistent);
    stage->points_max = features < FOVEA_GRID_POINTS_MAX ? features : FOVEA_GRID_POINTS_MAX;
    stage->points =
        config->landmarks ? fv_arena_take(job, stage->points_max, sizeof *stage->points) : NULL;
    fv_grid_recall_carve(&stage->recall, grid, persistent);
    stage->ranges = fv_arena_take(job, grid->rays, sizeof *stage->ranges);
    stage->cells = fv_arena_take(frame, (size_t)fv_free_space_rows(grid) * grid->side_cells, 1);
    if (!grid->heights) return;
    const size_t heights = (size_t)fv_free_space_height_rows(grid) * grid->side_cells;
    stage->heights_mm = fv_arena_take(frame, heights, sizeof *stage->heights_mm);
    stage->height_counts = fv_arena_take(frame, heights, 1);
}

/* Send what there is, with the stamp of the last mask. */
static void send_anew(struct fv_free_space *stage)
{
    fv_grid_scan_begin(&stage->grid);
    stage->state->phase = FV_FREE_SPACE_SCANNING;
}

void fv_free_space_reset(struct fv_free_space *stage)
{
    if (!stage->enabled) return;
    stage->state->noted.usable = 0;
    if (stage->state->phase == FV_FREE_SPACE_WAITING) stage->state->phase = FV_FREE_SPACE_IDLE;
    if (!stage->grid.state->begun) return;
    fv_grid_forget(&stage->grid);
    fv_grid_recall_forget(&stage->recall);
    stage->state->emptied = FV_FREE_SPACE_EMPTIED;
    send_anew(stage);
}

/* There is no pose at `stamp_ns`: that nothing is known is sent again every second. */
static void say_empty(struct fv_free_space *stage, int64_t stamp_ns)
{
    const int64_t period_ns = 1000000000;
    struct fv_free_space_state *s = stage->state;
    if (s->emptied == FV_FREE_SPACE_FILLED) return;
    if (s->emptied == FV_FREE_SPACE_EMPTIED_TIMED) {
        const bool busy =
            s->phase != FV_FREE_SPACE_IDLE && s->phase != FV_FREE_SPACE_SENDING_HEIGHTS;
        if (busy || stamp_ns - s->emptied_ns < period_ns) return;
        send_anew(stage);
    }
    s->emptied = FV_FREE_SPACE_EMPTIED_TIMED;
    s->emptied_ns = stamp_ns;
}

/* ---- poses ----------------------------------------------------------------------------------- */

/* What cells are in: lengths in metres, in the parent frame of the poses, which changes its unit
 * and its axes too (gravity may be known after metres). */
struct fv_free_space_world fv_free_space_world_of(const struct fv_publish *publish)
{
    const struct fovea_pose *pose = fv_publish_pose(publish);
    return (struct fv_free_space_world){pose->reset_counter, pose->map_id,
                                        fv_publish_last_change(publish).count, 0};
}

bool fv_free_space_same(struct fv_free_space_world a, struct fv_free_space_world b)
{
    return a.reset_counter == b.reset_counter && a.map_id == b.map_id && a.changes == b.changes;
}

bool fv_free_space_metric(const struct fv_publish *publish)
{
    const struct fovea_pose *pose = fv_publish_pose(publish);
    return pose->posed && pose->scale_source != FOVEA_SCALE_FREE;
}

void fv_free_space_follow(struct fv_free_space *stage, const struct fv_publish *publish)
{
    if (!stage->enabled) return;
    const bool lost = !fv_free_space_metric(publish);
    if (lost && stage->grid.state->begun) fv_kept_grid_keep(stage);
    if (lost || !fv_free_space_same(fv_free_space_world_of(publish), stage->state->world))
        fv_free_space_reset(stage);
    if (lost) say_empty(stage, publish->state->stamp_ns);
}

/* What is not known of the scale lies along the line of sight. */
static struct fovea_grid_point in_metres(const struct fv_surface_point *from,
                                         const struct fovea_pose *pose,
                                         const struct fv_se3 *T_odom_cam)
{
    double q[3], p[3];
    for (int k = 0; k < 3; k++)
        q[k] = pose->scale * (double)from->position[k];
    fv_se3_apply(T_odom_cam, q, p);
    const double along = pose->scale * (double)from->along,
                 by_unit = pose->scale_sigma * fv_norm3(q);
    return (struct fovea_grid_point){.position_m = {(float)p[0], (float)p[1], (float)p[2]},
                                     .along_m =
                                         (float)__builtin_sqrt(along * along + by_unit * by_unit),
                                     .across_m = (float)(pose->scale * (double)from->across)};
}

/* The points of the frame; returns their number. */
static uint32_t note_points(struct fv_free_space *stage, const struct fv_odometry *odometry,
                            const struct fovea_pose *pose, const struct fv_se3 *T_odom_cam)
{
    enum { PIECE = 64 };
    struct fv_surface_point piece[PIECE];
    uint32_t next = 0, count = 0, found = PIECE;
    while (found > 0 && count < stage->points_max) {
        const uint32_t left = stage->points_max - count;
        found = fv_odometry_surface(odometry, &next, piece, left < PIECE ? left : PIECE);
        for (uint32_t i = 0; i < found; i++)
            stage->points[count++] = in_metres(&piece[i], pose, T_odom_cam);
    }
    return count;
}

bool fv_free_space_vouched(const struct fv_free_space *stage, const struct fv_publish *publish)
{
    return stage->grid.state->begun && fv_free_space_metric(publish) &&
           fv_free_space_same(fv_free_space_world_of(publish), stage->state->world);
}

void fv_free_space_note(struct fv_free_space *stage, const struct fv_publish *publish,
                        const struct fv_odometry *odometry, const struct fv_frame_id *frame)
{
    if (!stage->enabled) return;
    struct fv_free_space_state *s = stage->state;
    const struct fovea_pose *pose = fv_publish_pose(publish);
    s->noted_frame = *frame;
    s->noted = (struct fv_free_space_pose){.usable = fv_free_space_metric(publish)};
    if (!s->noted.usable) return;
    const struct fv_se3 T_odom_cam = fv_publish_child_pose(publish, FV_PUBLISH_CAMERA),
                        T_odom_body = fv_publish_child_pose(publish, FV_PUBLISH_BODY);
    fv_se3_to_rows(&T_odom_cam, s->noted.T_odom_cam);
    s->noted.position_m[0] = T_odom_body.t[0];
    s->noted.position_m[1] = T_odom_body.t[1];
    s->noted.yaw_rad = fv_atan2(T_odom_body.R[3], T_odom_body.R[0]);
    s->noted.floor_m = T_odom_body.t[2];
    if (stage->points != NULL) s->noted.points = note_points(stage, odometry, pose, &T_odom_cam);
    s->noted.S_own_odom = fv_kept_grid_own(publish);
    s->noted.map_id = fv_map_current_id(fv_odometry_map(odometry));
    s->world = fv_free_space_world_of(publish);
}

/* ---- the update ------------------------------------------------------------------------------ */

bool fv_free_space_waiting(const struct fv_free_space *stage)
{
    return stage->enabled && stage->state->phase != FV_FREE_SPACE_IDLE;
}

bool fv_free_space_reads(const struct fv_free_space *stage, uint64_t inferences)
{
    if (!stage->enabled) return false;
    const struct fv_free_space_state *s = stage->state;
    return s->phase == FV_FREE_SPACE_WAITING || s->phase == FV_FREE_SPACE_UPDATING ||
           (s->noted.usable && inferences != s->inferences);
}

static struct fovea_grid_view view_of(const struct fv_free_space *stage,
                                      const struct fovea_segmentation *seen,
                                      const struct fovea_camera *camera, const uint8_t *labels)
{
    const struct fv_free_space_state *s = stage->state;
    struct fovea_grid_view view = {.stamp_ns = s->frame.stamp_ns,
                                   .seen = seen,
                                   .labels = labels,
                                   .camera = camera,
                                   .position_m = {s->pose.position_m[0], s->pose.position_m[1]},
                                   .yaw_rad = s->pose.yaw_rad,
                                   .floor_m = s->ground.height_m,
                                   .points = stage->points,
                                   .point_count = s->pose.points};
    memcpy(view.T_odom_cam, s->pose.T_odom_cam, sizeof view.T_odom_cam);
    memcpy(view.floor_slope, s->ground.slope, sizeof view.floor_slope);
    memcpy(view.floor_covariance, s->ground.covariance, sizeof view.floor_covariance);
    return view;
}

void fv_free_space_begin(struct fv_free_space *stage, const struct fovea_segmentation *seen)
{
    struct fv_free_space_state *s = stage->state;
    if (!stage->enabled || s->phase != FV_FREE_SPACE_IDLE || seen->inferences == s->inferences)
        return;
    s->inferences = seen->inferences;
    if (!s->noted.usable || s->noted_frame.stamp_ns != seen->stamp_ns) return;
    s->frame = s->noted_frame;
    s->pose = s->noted;
    s->noted.usable = 0;
    s->phase = FV_FREE_SPACE_WAITING;
}

const struct fv_free_space_pose *fv_free_space_taken(const struct fv_free_space *stage)
{
    return stage->enabled && stage->state->phase == FV_FREE_SPACE_WAITING ? &stage->state->pose
                                                                          : NULL;
}

void fv_free_space_lay(struct fv_free_space *stage, const struct fv_ground_plane *floor,
                       const struct fovea_segmentation *seen, const struct fovea_camera *camera,
                       const uint8_t labels[256])
{
    struct fv_free_space_state *s = stage->state;
    const double tilt2 = 0.1 * 0.1, height2 = 0.1 * 0.1; /* a body that leans stands somehow */
    const struct fv_ground_plane body = {.height_m = s->pose.floor_m,
                                         .covariance = {tilt2, 0, 0, tilt2, 0, height2}},
                                 *plane = floor != NULL ? floor : &body;
    s->ground = (struct fovea_ground){.stamp_ns = s->frame.stamp_ns,
                                      .position_m = {s->pose.position_m[0], s->pose.position_m[1]},
                                      .height_m = plane->height_m,
                                      .slope = {plane->slope[0], plane->slope[1]}};
    memcpy(s->ground.covariance, plane->covariance, sizeof s->ground.covariance);
    const struct fovea_grid_view view = view_of(stage, seen, camera, labels);
    s->phase = FV_FREE_SPACE_IDLE;
    if (!fv_grid_begin(&stage->grid, &view)) return;
    s->phase = FV_FREE_SPACE_UPDATING;
    s->emptied = FV_FREE_SPACE_FILLED;
}

bool fv_free_space_unit(struct fv_free_space *stage, const struct fovea_segmentation *seen,
                        const struct fovea_camera *camera, const uint8_t labels[256])
{
    struct fv_free_space_state *s = stage->state;
    if (s->phase == FV_FREE_SPACE_UPDATING) {
        const struct fovea_grid_view view = view_of(stage, seen, camera, labels);
        if (!fv_grid_advance(&stage->grid, &view)) return false;
        if (fv_kept_grid_recall(stage))
            s->phase = FV_FREE_SPACE_RECALLING;
        else
            send_anew(stage);
        return false;
    }
    if (s->phase == FV_FREE_SPACE_RECALLING) {
        if (fv_grid_recall_advance(&stage->recall, &stage->grid)) send_anew(stage);
        return false;
    }
    if (s->phase == FV_FREE_SPACE_SCANNING) {
        if (!fv_grid_scan_advance(&stage->grid, stage->ranges)) return false;
        s->phase = FV_FREE_SPACE_SENDING_GRID;
        s->sent = 0;
        return false;
    }
    return true;
}

/* ---- messages -------------------------------------------------------------------------------- */

enum fv_message_kind fv_free_space_kind(const struct fv_free_space *stage)
{
    const uint32_t phase = stage->state->phase;
    return phase == FV_FREE_SPACE_SENDING_GRID      ? FV_MESSAGE_GRID
           : phase == FV_FREE_SPACE_SENDING_HEIGHTS ? FV_MESSAGE_GRID_HEIGHTS
                                                    : FV_MESSAGE_SCAN;
}

/* Rows of the grid that a message takes: those after the ones that were sent. */
struct rows {
    struct fovea_grid_place place;
    int32_t first, count;
};

/* `most`: that fit. After the last of them, `then` is the phase. */
static struct rows take_rows(struct fv_free_space *stage, uint32_t most,
                             enum fv_free_space_phase then)
{
    struct fv_free_space_state *s = stage->state;
    struct rows rows = {fv_grid_place(&stage->grid), s->sent, (int32_t)most};
    const int32_t left = (int32_t)rows.place.height - rows.first;
    s->sent += rows.count;
    if (rows.count < left) return rows;
    rows.count = left;
    s->sent = 0;
    s->phase = then;
    return rows;
}

static uint32_t encode_heights(struct fv_free_space *stage, uint8_t *buffer, size_t capacity)
{
    const struct fv_free_space_state *s = stage->state;
    const struct rows rows =
        take_rows(stage, fv_free_space_height_rows(&stage->grid.config), FV_FREE_SPACE_IDLE);
    const struct fv_message_heights message = {.stamp = fv_frame_id_stamp(&s->frame),
                                               .reset_counter = s->world.reset_counter,
                                               .map_id = s->world.map_id,
                                               .place = &rows.place,
                                               .floor_m = s->ground.height_m,
                                               .first_row = rows.first,
                                               .row_count = rows.count,
                                               .heights_mm = stage->heights_mm,
                                               .counts = stage->height_counts};
    fv_grid_height_rows(&stage->grid, rows.first, rows.count, stage->heights_mm,
                        stage->height_counts);
    return fv_message_heights_encode(&message, buffer, capacity);
}

static uint32_t encode_grid(struct fv_free_space *stage, uint8_t *buffer, size_t capacity)
{
    const struct fv_free_space_state *s = stage->state;
    const struct rows rows =
        take_rows(stage, fv_free_space_rows(&stage->grid.config), FV_FREE_SPACE_SENDING_SCAN);
    const struct fv_message_grid message = {.stamp = fv_frame_id_stamp(&s->frame),
                                            .reset_counter = s->world.reset_counter,
                                            .map_id = s->world.map_id,
                                            .place = &rows.place,
                                            .ground = &s->ground,
                                            .first_row = rows.first,
                                            .row_count = rows.count,
                                            .cells = stage->cells};
    fv_grid_rows(&stage->grid, rows.first, rows.count, stage->cells);
    return fv_message_grid_encode(&message, buffer, capacity);
}

uint32_t fv_free_space_encode(struct fv_free_space *stage, uint8_t *buffer, size_t capacity)
{
    struct fv_free_space_state *s = stage->state;
    if (s->phase == FV_FREE_SPACE_SENDING_GRID) return encode_grid(stage, buffer, capacity);
    if (s->phase == FV_FREE_SPACE_SENDING_HEIGHTS) return encode_heights(stage, buffer, capacity);
    const struct fv_message_scan message = {.stamp = fv_frame_id_stamp(&s->frame),
                                            .range_max_m = (float)stage->grid.config.range_m,
                                            .count = stage->grid.config.rays,
                                            .range_m = stage->ranges};
    s->phase = stage->heights_mm != NULL ? FV_FREE_SPACE_SENDING_HEIGHTS : FV_FREE_SPACE_IDLE;
    return fv_message_scan_encode(&message, buffer, capacity);
}
