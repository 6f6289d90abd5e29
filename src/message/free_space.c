/* Free space as LCM bytes: the grid, the scan and heights. */
#include <assert.h>
#include <string.h>

#include "message/message.h"
#include "message/wire.h"

#include "fovea_grid_t.h"
#include "fovea_height_grid_t.h"
#include "fovea_scan_t.h"

static_assert((int)FV_MESSAGE_GRID_CELLS_MAX == FOVEA_GRID_T_CELLS_MAX, "the limit of grid_t");
static_assert((int)FOVEA_GRID_UNKNOWN == FOVEA_GRID_T_UNKNOWN, "the unknown cell of grid_t");
static_assert((int)FV_MESSAGE_HEIGHTS_CELLS_MAX == FOVEA_HEIGHT_GRID_T_CELLS_MAX,
              "the limit of height_grid_t");
static_assert((int)FOVEA_GRID_HEIGHT_UNKNOWN == FOVEA_HEIGHT_GRID_T_UNKNOWN,
              "the unknown cell of height_grid_t");

static char odom[] = "odom", body[] = "body"; /* lcm-gen knows no const, and only reads */

size_t fv_message_grid_size_max(uint32_t cells)
{
    const fovea_grid_t empty = {.frame = odom};
    const size_t most = cells < FV_MESSAGE_GRID_CELLS_MAX ? cells : FV_MESSAGE_GRID_CELLS_MAX;
    return (size_t)fovea_grid_t_encoded_size(&empty) + most;
}

uint32_t fv_message_grid_encode(const struct fv_message_grid *in, uint8_t *buffer, size_t capacity)
{
    const struct fovea_grid_place *place = in->place;
    const struct fovea_ground *ground = in->ground;
    fovea_grid_t message = {
        .stamp = in->stamp,
        .reset_counter = (int32_t)in->reset_counter,
        .map_id = (int32_t)in->map_id,
        .frame = odom,
        .resolution_m = place->resolution_m,
        .width = (int32_t)place->width,
        .height = (int32_t)place->height,
        .origin_position = {place->origin_m[0], place->origin_m[1], ground->height_m},
        .origin_orientation = {1, 0, 0, 0},
        .ground_position = {ground->position_m[0], ground->position_m[1], ground->height_m},
        .ground_slope = {(float)ground->slope[0], (float)ground->slope[1]},
        .free_below = (float)FOVEA_GRID_FREE_BELOW,
        .occupied_above = (float)FOVEA_GRID_OCCUPIED_ABOVE,
        .first_row = in->first_row,
        .row_count = in->row_count,
        .cell_count = in->row_count * (int32_t)place->width,
        .cells = (int8_t *)in->cells,
    };
    for (int i = 0; i < 6; i++)
        message.ground_covariance[i] = (float)ground->covariance[i];
    return fv_wire_encoded(fovea_grid_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

size_t fv_message_heights_size_max(uint32_t cells)
{
    const fovea_height_grid_t empty = {.frame = odom};
    const size_t most = cells < FV_MESSAGE_HEIGHTS_CELLS_MAX ? cells : FV_MESSAGE_HEIGHTS_CELLS_MAX;
    return (size_t)fovea_height_grid_t_encoded_size(&empty) + most * 3;
}

uint32_t fv_message_heights_encode(const struct fv_message_heights *in, uint8_t *buffer,
                                   size_t capacity)
{
    const struct fovea_grid_place *place = in->place;
    const fovea_height_grid_t message = {
        .stamp = in->stamp,
        .reset_counter = (int32_t)in->reset_counter,
        .map_id = (int32_t)in->map_id,
        .frame = odom,
        .resolution_m = place->resolution_m,
        .width = (int32_t)place->width,
        .height = (int32_t)place->height,
        .origin_position = {place->origin_m[0], place->origin_m[1], in->floor_m},
        .origin_orientation = {1, 0, 0, 0},
        .first_row = in->first_row,
        .row_count = in->row_count,
        .cell_count = in->row_count * (int32_t)place->width,
        .height_mm = (int16_t *)in->heights_mm,
        .point_count = (int8_t *)in->counts,
    };
    return fv_wire_encoded(
        fovea_height_grid_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}

size_t fv_message_scan_size_max(uint32_t count)
{
    const fovea_scan_t empty = {.frame = body};
    return (size_t)fovea_scan_t_encoded_size(&empty) + count * sizeof(float);
}

uint32_t fv_message_scan_encode(const struct fv_message_scan *in, uint8_t *buffer, size_t capacity)
{
    const double turn = 6.283185307179586;
    const fovea_scan_t message = {
        .stamp = in->stamp,
        .frame = body,
        .angle_step = (float)(turn / in->count),
        .range_max_m = in->range_max_m,
        .count = (int32_t)in->count,
        .range_m = (float *)in->range_m,
    };
    return fv_wire_encoded(fovea_scan_t_encode(buffer, 0, fv_wire_capacity(capacity), &message));
}
