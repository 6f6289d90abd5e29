#include "pieces.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

static bool is_possible(const fovea_grid_t *piece)
{
    if (piece->width < 1 || piece->height < 1 || piece->width > NAVIGATE_SIDE_MAX ||
        piece->height > NAVIGATE_SIDE_MAX || piece->first_row < 0 || piece->row_count < 1 ||
        piece->row_count > piece->height - piece->first_row)
        return false;
    return piece->cell_count == piece->width * piece->row_count && piece->resolution_m >= 0.01 &&
           piece->resolution_m <= 1 && isfinite(piece->origin_position[0]) &&
           isfinite(piece->origin_position[1]);
}

static void begin(struct navigate_grid *grid, const fovea_grid_t *piece)
{
    grid->frame = (struct navigate_frame){piece->reset_counter, piece->map_id};
    grid->width = piece->width;
    grid->height = piece->height;
    grid->cell_m = piece->resolution_m;
    memcpy(grid->origin, piece->origin_position, sizeof grid->origin);
    grid->sequence = piece->stamp.sequence;
    grid->time_ns = piece->stamp.time_ns;
    grid->rows = 0;
}

static bool follows(const struct navigate_grid *grid, const fovea_grid_t *piece)
{
    return piece->first_row == grid->rows && piece->stamp.sequence == grid->sequence &&
           piece->width == grid->width && piece->height == grid->height;
}

bool navigate_take(struct navigate_grid *grid, const fovea_grid_t *piece)
{
    const bool possible = is_possible(piece);
    if (possible && piece->first_row == 0) begin(grid, piece);
    if (!possible || !follows(grid, piece)) {
        grid->rows = -1; /* nothing follows until a grid begins */
        return false;
    }
    memcpy(grid->cells + (ptrdiff_t)grid->rows * grid->width, piece->cells,
           (size_t)piece->cell_count);
    grid->rows += piece->row_count;
    return grid->rows == grid->height;
}

bool navigate_is_for(const struct navigate_frame *frame, const fovea_pose_t *pose)
{
    return pose->reset_counter == frame->reset_counter && pose->map_id == frame->map_id;
}
