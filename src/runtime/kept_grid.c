#include "runtime/kept_grid.h"

#include <string.h>

/* Written in a unit; a message's cells, in which they are made, are more. */
enum { UNIT_CELLS = 16384 };
_Static_assert((int)UNIT_CELLS <= (int)FV_MESSAGE_GRID_CELLS_MAX, "rows fit into a message's");

enum save { SAVE_NOT_BEGUN = 0, SAVE_GRID, SAVE_LOADED, SAVE_WRITTEN };

/* ---- loading --------------------------------------------------------------------------------- */

void fv_kept_grid_crop(const struct fv_archive_info *info, const uint8_t *data, uint32_t side_max,
                       struct fv_archive_grid *grid, int8_t *cells)
{
    const uint32_t side = info->grid.side < side_max ? info->grid.side : side_max,
                   left = (info->grid.side - side) / 2;
    const double move = left * info->grid.resolution_m;
    *grid = info->grid;
    grid->side = side;
    if (side == 0) return;
    fv_sim3_apply(&info->grid.S_map_grid, (double[]){move, move, 0}, grid->S_map_grid.t);
    for (uint32_t row = 0; row < side; row++)
        memcpy(cells + (size_t)row * side,
               data + info->grid_at + (size_t)(row + left) * info->grid.side + left, side);
}

void fv_kept_grid_take(struct fv_free_space *stage, const struct fv_archive_grid *grid,
                       const int8_t *cells)
{
    if (!stage->enabled) return;
    stage->kept->loaded = *grid;
    stage->kept->own = 0;
    fv_grid_recall_keep(&stage->recall, grid->side, grid->resolution_m, cells);
}

void fv_kept_grid_stretch(struct fv_free_space *stage, uint32_t map_id, double factor)
{
    if (!stage->enabled || stage->kept->loaded.side == 0 || stage->kept->loaded.map_id != map_id)
        return;
    struct fv_sim3 *S = &stage->kept->loaded.S_map_grid;
    S->s *= factor;
    for (int i = 0; i < 3; i++)
        S->t[i] *= factor;
}

/* ---- offering what was loaded ---------------------------------------------------------------- */

struct fv_sim3 fv_kept_grid_own(const struct fv_publish *publish)
{
    const struct fv_sim3 S_map_odom = fv_publish_map(publish);
    struct fv_sim3 S = fv_publish_own_map(publish); /* S_map_own */
    fv_sim3_invert(&S, &S);
    fv_sim3_compose(&S, &S_map_odom, &S);
    return S;
}

bool fv_kept_grid_recall(struct fv_free_space *stage)
{
    const struct fv_archive_grid *loaded = &stage->kept->loaded;
    const struct fv_free_space_pose *pose = &stage->state->pose;
    struct fv_sim3 S; /* S_grid_odom */
    double rows[12];
    if (loaded->side == 0 || loaded->map_id != pose->map_id) return false;
    fv_sim3_invert(&loaded->S_map_grid, &S);
    fv_sim3_compose(&S, &pose->S_own_odom, &S);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++)
            rows[4 * r + c] = S.s * S.R[3 * r + c];
        rows[4 * r + 3] = S.t[r];
    }
    return fv_grid_recall_begin(&stage->recall, &stage->grid, rows, stage->state->ground.height_m);
}

/* ---- saving ---------------------------------------------------------------------------------- */

void fv_kept_grid_save_begin(struct fv_free_space *stage, struct fv_odometry *odometry)
{
    if (!stage->enabled) return;
    stage->kept->save = SAVE_NOT_BEGUN;
    fv_odometry_save_want_grid(odometry);
}

/* As fv_kept_grid_own, of this moment: the map may have been corrected since the last frame. By its
 * camera, which the map knows where the pose is that of a picture. */
static struct fv_sim3 own_now(const struct fv_publish *publish, const struct fv_odometry *odometry)
{
    const struct fovea_pose *pose = fv_publish_pose(publish);
    if (pose->state == FOVEA_TRACKING_COASTING) return fv_kept_grid_own(publish);
    const struct fv_se3 T_odom_cam = fv_publish_child_pose(publish, FV_PUBLISH_CAMERA);
    struct fv_se3 T;
    struct fv_sim3 S, S_cam_odom;
    fv_odometry_map_pose(odometry, &T);
    fv_sim3_from_se3(&T, 1 / pose->scale, &S);
    fv_se3_invert(&T_odom_cam, &T);
    fv_sim3_from_se3(&T, 1, &S_cam_odom);
    fv_sim3_compose(&S, &S_cam_odom, &S);
    return S;
}

/* Of the grid where it lies now, by the transform from `odom` to the own frame of map `map_id`. */
static struct fv_archive_grid head_of(const struct fv_free_space *stage, uint32_t map_id,
                                      const struct fv_sim3 *S_own_odom)
{
    const struct fovea_grid_place place = fv_grid_place(&stage->grid);
    const double corner[3] = {place.origin_m[0], place.origin_m[1], stage->state->ground.height_m};
    struct fv_archive_grid head = {.map_id = map_id,
                                   .side = place.width,
                                   .resolution_m = place.resolution_m,
                                   .S_map_grid = *S_own_odom};
    fv_so3_orthonormalise(head.S_map_grid.R); /* T_body_cam is one to four digits */
    fv_sim3_apply(&head.S_map_grid, corner, head.S_map_grid.t);
    return head;
}

void fv_kept_grid_keep(struct fv_free_space *stage)
{
    const struct fv_free_space_pose *pose = &stage->state->pose;
    const struct fv_kept_grid_state *kept = stage->kept;
    const struct fv_grid *grid = &stage->grid;
    const bool others = kept->loaded.side > 0 && !kept->own && kept->loaded.map_id != pose->map_id;
    /* A save under way goes on with what it began with. */
    if (others || kept->save == SAVE_LOADED || !pose->usable || !fv_grid_recall_any(grid)) return;
    const struct fv_archive_grid head = head_of(stage, pose->map_id, &pose->S_own_odom);
    fv_grid_recall_rows(grid, grid->state->corner, 0, head.side, stage->recall.percent);
    fv_kept_grid_take(stage, &head, stage->recall.percent);
    stage->kept->own = 1;
}

/* Decide what is saved, and write where it lies. */
static void begin(struct fv_free_space *stage, const struct fv_publish *publish,
                  struct fv_odometry *odometry)
{
    struct fv_kept_grid_state *kept = stage->kept;
    const struct fv_map *map = fv_odometry_map(odometry);
    kept->row = 0;
    kept->save = SAVE_WRITTEN;
    if (fv_free_space_vouched(stage, publish) && fv_grid_recall_any(&stage->grid)) {
        const struct fv_sim3 S_own_odom = own_now(publish, odometry);
        const struct fv_archive_grid head = head_of(stage, fv_map_current_id(map), &S_own_odom);
        kept->save = SAVE_GRID;
        kept->corner[0] = stage->grid.state->corner[0];
        kept->corner[1] = stage->grid.state->corner[1];
        kept->world = stage->state->world;
        fv_odometry_save_grid_head(odometry, &head);
    } else if (kept->loaded.side > 0 && fv_map_count_keyframes(map, kept->loaded.map_id) > 0) {
        kept->save = SAVE_LOADED;
        fv_odometry_save_grid_head(odometry, &kept->loaded);
    }
}

/* Rows of the grid as it lay when the save began. */
static void write_rows(struct fv_free_space *stage, const struct fv_publish *publish,
                       struct fv_odometry *odometry)
{
    struct fv_kept_grid_state *kept = stage->kept;
    const bool own = kept->save == SAVE_GRID;
    const int64_t side = own ? stage->grid.config.side_cells : kept->loaded.side,
                  most = UNIT_CELLS / side, left = side - kept->row,
                  rows = left < most ? left : most;
    const int8_t *cells = stage->cells;
    if (!own)
        cells = stage->recall.percent + kept->row * side;
    else if (fv_free_space_vouched(stage, publish) &&
             fv_free_space_same(kept->world, stage->state->world))
        fv_grid_recall_rows(&stage->grid, kept->corner, kept->row, rows, stage->cells);
    else
        memset(stage->cells, FOVEA_GRID_UNKNOWN, (size_t)(rows * side));
    fv_odometry_save_grid_cells(odometry, cells, (uint32_t)(rows * side));
    kept->row += rows;
    if (kept->row == side) kept->save = SAVE_WRITTEN;
}

bool fv_kept_grid_save_unit(struct fv_free_space *stage, const struct fv_publish *publish,
                            struct fv_odometry *odometry)
{
    if (!stage->enabled || !fv_odometry_save_at_grid(odometry)) return false;
    if (stage->kept->save == SAVE_WRITTEN) return false;
    if (stage->kept->save == SAVE_NOT_BEGUN)
        begin(stage, publish, odometry);
    else
        write_rows(stage, publish, odometry);
    return true;
}
